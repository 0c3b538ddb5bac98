"""Scene files of drill-strings in motion, in TOML: keys and types are the argument and class names of the package.

title = "..."

[well]                           # optional, see `well.scenefile`: survey or stations, sections
[string]                         # components; or [discs]: inertias, stiffnesses, dampings, drags
[mud]                            # optional

[drive]
speed = "60 rpm"                 # or { type = "Ramp", value = "60 rpm", end = 5.0 }
inertia = 2900.0                 # with a control that has one
control = { type = "SoftSpeed" } # Stiff (which needs none), PI, Matched, Motor, SoftTorque, SoftSpeed

[bit]                            # not where the lower end is free
weight = "80 kN"
law = { type = "Stribeck", static = "6 kN m", dynamic = "4 kN m", speed = "3 rad/s" }

[hook]                           # optional: stiffness, speed
[wall_friction]                  # optional: static, kinetic, speed, of_rotation, of_hole
[drag]                           # optional: torsion, axial

[simulate]                       # duration, and what else `simulate` takes
duration = 60.0

[rod]                            # optional: an exact rod for the lower part in its hole: depth, elements, degree,
depth = 2800.0                   # wall_damping

[stability]                      # optional: speeds, weights, and what else `stability` takes
[response]                       # optional: frequencies, and what else `frequency_response` takes
[fit]                            # optional: readings of a rig, their noise; [[fit.unknowns]]: name, least, largest

Numbers are in SI, or text with a unit (`quantities.DIMENSIONS`).
"""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np

from cosserat_fenicsx.checks import File, instance, number, refuse, store
from cosserat_fenicsx.drilling.bit_laws import BitOnRock
from cosserat_fenicsx.drilling.choose import chosen
from cosserat_fenicsx.drilling.fitting import DrillingFit, fit, ranges_of
from cosserat_fenicsx.drilling.history import DrillingHistory
from cosserat_fenicsx.drilling.linear import frequencies
from cosserat_fenicsx.drilling.linear.response import FrequencyResponse, frequency_response
from cosserat_fenicsx.drilling.linear.stability import SPEEDS, Stability, stability
from cosserat_fenicsx.drilling.motion import check_arguments as check_simulation
from cosserat_fenicsx.drilling.motion import simulate
from cosserat_fenicsx.drilling.readings import READ, Readings
from cosserat_fenicsx.drilling.scene import Discs, Drilling
from cosserat_fenicsx.drilling.top_drive import DriveControl, Hook, TopDrive
from cosserat_fenicsx.drilling.wall_friction import FrictionLaw, ViscousDrag, WallFriction
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.parts import (
    AngularVelocity,
    Depth,
    FileName,
    Frequency,
    Number,
    Part,
    Settings,
    Time,
    Values,
    at_least,
    between,
    concerning,
    misplaced,
    positive,
)
from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.results.screen import InWords
from cosserat_fenicsx.scene.parameters import parameter_of
from cosserat_fenicsx.well.components import DrillString
from cosserat_fenicsx.well.hole import Borehole, Mud


#: What a file may ask for, in messages on one that asks for nothing.
NOTHING_ASKED = "nothing is asked for: expected [simulate] with duration, [stability] with speeds, [response] or [fit]"


class _Tuned(DriveControl):
    """Base of controls with gains that a function of the same name chooses for the string."""

    @property
    def _needs_inertia(self):
        return type(self).__name__


@dataclass(frozen=True)
class SoftTorque(_Tuned):
    """Gains of `SoftTorque` for the string of the file."""


@dataclass(frozen=True)
class SoftSpeed(_Tuned):
    """Gains of `SoftSpeed` for the string of the file."""


@dataclass(frozen=True)
class SimulateDrilling(Settings):
    """Arguments of `simulate` in a scene file; None for its own defaults.

    Args:
        duration: s; needed for a motion. model, dt, elements, save_every, profile_every: as for `simulate`.
    """

    duration: Time | None = None
    model: str | None = None
    dt: Time | None = None
    elements: int | None = None
    save_every: Time | None = None
    profile_every: Time | None = None

    called = "simulate"


@dataclass(frozen=True)
class RodBelow(Part):
    """An exact rod for the lower part of the string, below waves for the pipe above, see `mixed_scene`.

    Args:
        depth, wall_damping: as for `mixed_scene`, with its defaults. elements, degree: as for `MixedScene.run`.
    """

    depth: Depth | None = None
    elements: Annotated[int, Number(limits=at_least(1, "a number of elements"), whole=True)] | None = None
    degree: Annotated[int, Number(limits=at_least(1, "a degree"), whole=True)] = 2
    wall_damping: Annotated[float, Number(limits=at_least(0))] | None = None

    called = "rod"


@dataclass(frozen=True)
class StabilityMap(Part):
    """Speeds (rad/s) and weights on bit (N) of a map of stability: lists, or equally spaced ones.

    Args:
        up_to, kind: as for `stability`.
    """

    speeds: Annotated[Sequence[float], Values(Number("angular velocity", positive()))] = SPEEDS
    weights: Annotated[Sequence[float], Values(Number("force", positive()))] | None = None
    up_to: Annotated[Frequency, positive()] = 10.0
    kind: Literal["torsion", "axial"] = "torsion"

    called = "stability"


@dataclass(frozen=True)
class ResponseAt(Part):
    """Frequencies (Hz), a list or equally spaced ones, and other arguments of `frequency_response`."""

    frequencies: Annotated[Sequence[float], Values(Number("frequency", positive()))] | None = None
    kind: Literal["torsion", "axial"] = "torsion"
    speed: Annotated[AngularVelocity, at_least(0)] | None = None
    unstable: bool = False

    called = "response"


@dataclass(frozen=True)
class FitUnknown(Part):
    """A number of the string that is to be found.

    Args:
        name: of a number of a `Drilling`, such as "bit.law.static" or "hole.sections[0].friction".
        least, largest: between which it is, in SI or text with a unit.
    """

    name: str
    least: Any
    largest: Any


@dataclass(frozen=True)
class FitToReadings(Part):
    """Arguments of `fit` in a scene file; model and step are those of [simulate].

    Args:
        readings: the name of a .csv file, see `Readings.from_csv`, and columns there.
        noise: {quantity: standard deviation}, in SI or text with a unit.
        unknowns: the numbers that are to be found, each a `FitUnknown`.
        clock: s that the readings' time 0 is after the start of the motion; or "unknown".
        confidence, leave_out: as for `fit`.

    Raises:
        SceneError: no such file, or what `Readings` refuses; an unknown that is given twice.
    """

    readings: Annotated[File, FileName()]
    noise: Any
    unknowns: tuple[FitUnknown, ...]
    columns: Any = None
    clock: Time | Literal["unknown"] = 0.0
    confidence: Annotated[float, between(0.01, 0.9999)] = 0.95
    leave_out: bool = True

    called = "fit"

    def validate(self):
        for name in ("noise", "columns"):
            instance(self, name, getattr(self, name), Mapping if name == "noise" else (Mapping, type(None)),
                     "a table by names of quantities, such as { surface_torque = ... }")  # fmt: skip
        if len(self.ranges) < max(1, len(self.unknowns)):
            refuse(self, "unknowns", [x.name for x in self.unknowns], "at least one, each with a name of its own")
        store(self, readings=os.path.abspath(self.readings),
              data=Readings.from_csv(self.readings, self.noise, self.columns))  # fmt: skip
        if self.clock != "unknown":
            store(self, clock=number(self, "clock", self.clock, "a time (s), or 'unknown'", math.isfinite))

    @property
    def ranges(self) -> dict[str, tuple]:
        """{name: (least, largest)}, as given."""
        return {x.name: (x.least, x.largest) for x in self.unknowns}


@dataclass(frozen=True)
class DrillingScene(InWords, Part):
    """A drill-string in motion and its computations, from `read`.

    Args:
        drive: the `TopDrive`.
        string: the `DrillString`; or discs: `Discs`.
        bit, hook, mud, drag, depth, start: as for `Drilling`. well: its hole. wall_friction: its friction.
        simulate: arguments of `simulate`. rod: a `RodBelow`, for the motion of an exact rod below pipe. stability: a
            map of stability, response: a frequency response, fit: numbers that are to be found from readings; or None.
        title: for tables and charts.

    Attributes:
        scene: the `Drilling`. mixed: the `MixedScene` of [rod], or None.

    Raises:
        SceneError: parts that are missing or do not fit each other.
    """

    drive: TopDrive
    string: DrillString | None = None
    discs: Discs | None = None
    bit: BitOnRock | None = None
    well: Borehole | None = None
    hook: Hook | None = None
    mud: Mud | None = None
    wall_friction: WallFriction | FrictionLaw | None = None
    drag: ViscousDrag | None = None
    depth: Depth | None = None
    start: Literal["rest", "steady"] = "rest"
    simulate: SimulateDrilling | None = None
    rod: RodBelow | None = None
    stability: StabilityMap | None = None
    response: ResponseAt | None = None
    fit: FitToReadings | None = None
    title: str = ""

    def validate(self):
        if (self.string is None) == (self.discs is None):
            raise misplaced(("discs",) if self.discs else None, "expected [drive], and either [string] or [discs]")
        parts = {"bit": self.bit, "hole": self.well, "hook": self.hook, "mud": self.mud, "drag": self.drag}
        parts |= {"friction": self.wall_friction, "depth": self.depth, "start": self.start}
        string, drive = self.string or self.discs, self.drive
        if isinstance(drive.control, _Tuned):
            name = type(drive.control).__name__
            standing = Drilling(string, TopDrive(0.0), **parts)
            drive = replace(drive, control=getattr(frequencies, name)(standing, drive.inertia))
        store(self, scene=Drilling(string, drive, **parts))
        settings = self.settings
        model = settings.pop("model", "auto")
        if "duration" in settings:
            check_simulation(self.scene, **settings)
        chosen(self.scene, model)
        store(self, mixed=self._mixed(model, settings))
        if self.weights:
            self.scene.with_case(weight=self.weights[0])  # refused where there is no bit
        if self.fit:
            with concerning("fit", "unknowns"):
                store(self, _ranges=ranges_of(self.scene, self.fit.ranges))

    def _mixed(self, model, settings):
        if self.rod is None:
            return None
        for name in ("elements", "profile_every"):
            if name in settings:
                refuse(self.simulate, name, settings[name], "None beside [rod], which has elements and no profiles")
        if model != "auto":
            refuse(self.simulate, "model", model, "'auto' beside [rod], which is a model of its own")
        # imported here, since it takes long
        from cosserat_fenicsx.drilling.mixed import mixed_scene

        damping = {} if self.rod.wall_damping is None else {"wall_damping": self.rod.wall_damping}
        return mixed_scene(self.scene, self.rod.depth, **damping)

    def sentences(self, units: Units):
        """On the `Drilling` and on what is asked for, in some units."""
        duration = self.settings.get("duration")
        if self.title:
            yield self.title
        yield from self.scene.sentences(units, duration) if self.mixed is None else self.mixed.sentences(units)
        if duration is not None:
            yield f"Asked for: a motion of {duration:g} s."
        if self.speeds:
            weights = f" and {len(self.weights)} weights on bit" if self.weights else ""
            yield f"Asked for: stability at {len(self.speeds)} speeds{weights}."
        if self.response:
            yield f"Asked for: frequency response in {self.response.kind}."
        if self.fit:
            yield from self._fit_in_words(units)

    def _fit_in_words(self, units):
        """On readings, noise, clock, and bounds and start of each unknown of [fit]."""

        def told(value, unit):
            return f"{value:g}" if unit in ("", "1") else units.told(value, unit)

        data, clock = self.fit.data, self.fit.clock
        count = sum(np.isfinite(x).sum() for x in data.values.values())
        noise = ", ".join(f"{name} (noise {told(data.noise[name], READ[name])})" for name in data.values)
        late = "unknown" if clock == "unknown" else told(clock, "s")
        yield f"Asked for: numbers that fit {count} readings of {noise}; clock {late}."
        for name, (low, high) in self._ranges.items():
            here = parameter_of(self.scene, name)
            ends = f"{told(low, here.unit)} and {told(high, here.unit)}"
            yield f"Unknown: {name} between {ends}, here {told(here.value, here.unit)}."

    @property
    def settings(self) -> dict[str, Any]:
        """Arguments of `simulate`."""
        return self.simulate.given() if self.simulate else {}

    @property
    def speeds(self) -> tuple[float, ...]:
        """Speeds of the map of stability, rad/s; empty where the file asks for none."""
        return self.stability.speeds if self.stability else ()

    @property
    def weights(self) -> tuple[float, ...]:
        """Weights on bit of the map of stability, N; empty where the file asks for none."""
        return self.stability.weights or () if self.stability else ()

    def run(self, **changed) -> DrillingHistory:
        """The motion by `simulate`, or with [rod] by `MixedScene.run`; `changed`: arguments other than in the file.

        Raises:
            SceneError: no duration; a folder beside [rod]; see `simulate`, whose other exceptions it raises too.
        """
        given = {**self.settings, **changed}
        if given.get("duration") is None:
            raise SceneError(f"simulate.duration = None: {NOTHING_ASKED}")
        if self.mixed is None:
            return simulate(self.scene, **given)
        if given.pop("folder", None) is not None:
            raise SceneError("folder: expected none beside [rod]; in Python simulate(found.mixed.scene, folder=...)")
        return self.mixed.run(**{"elements": self.rod.elements, "degree": self.rod.degree, **given})

    def map(self) -> Stability | None:
        """The growth of every mode at the speeds and weights of the file, see `stability`; None where it asks for none.

        Raises:
            SceneError, NotConverged: see `stability`.
        """
        return stability(self.scene, **self.stability.arguments()) if self.stability else None

    def respond(self) -> FrequencyResponse | None:
        """The `frequency_response` of the file; None where it asks for none.

        Raises:
            SceneError, NotConverged: see `frequency_response`.
        """
        return frequency_response(self.scene, **self.response.arguments()) if self.response else None

    def fitted(self) -> DrillingFit | None:
        """The numbers that fit the readings of the file, see `fit`; None where it asks for none.

        Raises:
            SceneError, NotConverged: see `fit`.
        """
        if self.fit is None:
            return None
        asked = {name: self.settings[name] for name in ("model", "dt") if name in self.settings}
        asked |= {"confidence": self.fit.confidence, "leave_out": self.fit.leave_out}
        clock = None if self.fit.clock == "unknown" else self.fit.clock
        return fit(self.scene, self.fit.data, self.fit.ranges, clock=clock, **asked)
