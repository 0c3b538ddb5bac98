"""A drill-string in motion: string, hole, drive, hook, bit, mud and friction; its uniform parts, or `Discs`."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Literal

import numpy as np

from cosserat_fenicsx.checks import refuse, store, warn
from cosserat_fenicsx.drilling import bit_curves  # noqa: F401 its laws join their family
from cosserat_fenicsx.drilling.bit_laws import BitOnRock, Stribeck
from cosserat_fenicsx.drilling.joints import Joint, joints_of
from cosserat_fenicsx.drilling.top_drive import Hook, Motor, TopDrive
from cosserat_fenicsx.drilling.wall_friction import FrictionLaw, ViscousDrag
from cosserat_fenicsx.parts import (
    Damping,
    Depth,
    Inertia,
    Mass,
    Number,
    Part,
    TorsionalDamping,
    TorsionalStiffness,
    positive,
)
from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.results.screen import InWords
from cosserat_fenicsx.units import rpm
from cosserat_fenicsx.well.components import DrillString, in_columns
from cosserat_fenicsx.well.hole import Borehole, Mud
from cosserat_fenicsx.well.operations import doubt_load
from cosserat_fenicsx.well.tools import check_flows


@dataclass(frozen=True)
class Segment:
    """A uniform part of a string. length: m. GJ, rhoJ: torsional stiffness, N m^2, and polar inertia per length, kg m,
    with tool joints, see `StringPart.torsion`. EA: N. rhoA: kg/m, with tool joints. radius: of contact, m. weight: in
    mud, N/m; name: of the component. damping_time: of Kelvin and Voigt, s."""

    length: float
    GJ: float
    rhoJ: float
    EA: float
    rhoA: float
    radius: float
    weight: float
    name: str
    damping_time: float = 0.0

    @property
    def torsional_speed(self) -> float:
        """Of waves, sqrt(G/rho) without tool joints, m/s."""
        return math.sqrt(self.GJ / self.rhoJ)

    @property
    def torsional_impedance(self) -> float:
        """J sqrt(G rho) without tool joints, N m s/rad."""
        return math.sqrt(self.GJ * self.rhoJ)

    @property
    def axial_speed(self) -> float:
        """Of waves, sqrt(E/rho), m/s."""
        return math.sqrt(self.EA / self.rhoA)

    @property
    def axial_impedance(self) -> float:
        """A sqrt(E rho), N s/m."""
        return math.sqrt(self.EA * self.rhoA)


def segment_of(place, weight):
    """The `Segment` of a `Laid` component of a weight in mud (N/m); a SceneError without stiffness or mass."""
    part = place.component
    stiffness = part.stiffness
    if stiffness is None:
        refuse(part, "stiffness", None, "a Stiffness with mass and inertia, for a motion")
    for field in ("mass", "inertia"):
        if getattr(stiffness, field) is None:
            refuse(part, f"stiffness.{field}", None, "the mass (kg/m) and inertia (kg m) of the section, for a motion")
    if math.isinf(stiffness.axial):
        refuse(part, "stiffness.axial", stiffness.axial, "a finite axial stiffness (N), for a motion")
    mass = stiffness.mass if part.mass is None else part.mass
    return Segment(place.bottom - place.top, *part.torsion, stiffness.axial, mass, part.contact_radius, weight,
                   part.name, part.damping_time)  # fmt: skip


@dataclass(frozen=True)
class Discs(Part):
    """Discs from the top drive down to the bit, joined by springs and dampers in torsion, and, with masses, axially.

    The first disc is the top drive's own inertia (beside that of `TopDrive`), the last the bit's.

    Args:
        inertias: (n,) kg m^2. stiffnesses: (n - 1,) N m/rad between neighbours.
        dampings: (n - 1,) N m s/rad between neighbours; None for none.
        drags: (n,) N m s/rad between a disc and the hole; None for none.
        masses: (n,) kg; None where discs turn alone. Their weight is left out, in tensions too.
        axial_stiffnesses, axial_dampings, axial_drags: as in torsion, N/m, N s/m, N s/m.

    Raises:
        SceneError: numbers that are not positive, or lists whose lengths do not fit.
    """

    inertias: tuple[Annotated[Inertia, positive()], ...]
    stiffnesses: tuple[Annotated[TorsionalStiffness, positive()], ...]
    dampings: tuple[TorsionalDamping, ...] | None = None
    drags: tuple[TorsionalDamping, ...] | None = None
    masses: tuple[Annotated[Mass, positive()], ...] | None = None
    axial_stiffnesses: tuple[Annotated[float, Number("stiffness", positive())], ...] | None = None
    axial_dampings: tuple[Damping, ...] | None = None
    axial_drags: tuple[Damping, ...] | None = None

    def validate(self):
        n = len(self.inertias)
        if n < 2:
            refuse(self, "inertias", self.inertias, "at least two (kg m^2)")
        sizes = {"stiffnesses": n - 1, "dampings": n - 1, "drags": n}
        axial = {"masses": n} | {f"axial_{name}": size for name, size in sizes.items()}
        for field, size in (sizes | axial).items():
            given = getattr(self, field)
            if field in axial and self.masses is None:
                if given is not None:
                    refuse(self, field, given, "None for discs without masses")
                continue
            if given is None and field.endswith(("dampings", "drags")):
                given = (0.0,) * size
            if given is None or len(given) != size:
                refuse(self, field, given, f"{size} numbers, with {n} discs")
            store(self, **{field: given})


@dataclass(frozen=True)
class Drilling(InWords, Part):
    """A drill-string with its drive, hook, bit and friction.

    Args:
        string: a `DrillString`, or `Discs`.
        drive: a `TopDrive`.
        bit: a `BitOnRock`; None where the lower end is free.
        hole: a `Borehole`; None for a string without walls, as in a straight vertical hole.
        hook: a `Hook`; None for a rigid one at rest, or, where the bit has a `Cutting` law and a weight, for one whose
            load stays the same, so that the string follows the bit.
        mud: a `Mud`; None where all components have their weight in mud, or where there is no hole: in air.
        friction: `WallFriction` or another law; None for the friction of the hole, the same at rest and in motion.
        drag: `ViscousDrag`; None for none.
        depth: measured depth of the bit, m; None for the bottom of the hole, or the string's length without one.
        start: "rest": untwisted, hanging in its weight, with the static weight on bit; or "steady": all of it turns at
            the drive's speed and moves at the hook's, twisted by friction, drag and bit.

    Raises:
        SceneError: parts that are missing or do not fit each other.
    """

    string: DrillString | Discs
    drive: TopDrive
    bit: BitOnRock | None = None
    hole: Borehole | None = None
    hook: Hook | None = None
    mud: Mud | None = None
    friction: FrictionLaw | None = None
    drag: ViscousDrag | None = None
    depth: Depth | None = None
    start: Literal["rest", "steady"] = "rest"

    def validate(self):
        if self.discs is not None:
            for field in ("hole", "mud", "friction", "drag", "depth"):
                if getattr(self, field) is not None:
                    refuse(self, field, getattr(self, field), "None for Discs, whose drags are their own")
            if self.hook is not None and self.string.masses is None:
                refuse(self, "hook", self.hook, "None for Discs without masses, which turn alone")
            return
        if self.friction is not None and self.hole is None:
            refuse(self, "friction", self.friction, "None, or a hole (Borehole) beside it, at whose wall it acts")
        if self.depth is None and self.hole is None and self.string.components[-1].length is None:
            refuse(self.string.components[-1], "length", None, "a length (m), where there is neither hole nor depth")
        in_air = next((part.name for part in self.string.components if part.weight is None), None)
        if in_air and self.fluids is None:
            refuse(self, "mud", None, f"a Mud beside the hole, since {in_air} is given by its weight in air; Mud(0) "
                   "for air")  # fmt: skip
        _ = self.segments
        if self.hole is not None and self.mud is not None:
            self.mud.doubt_depths(self.hole, self.bit_depth)
        if self.motor is not None and self.bit is None:
            refuse(self, "bit", None, f"a BitOnRock below {self.motor.name}, which turns it")
        check_flows(self.motors)
        self._doubt_torques()

    def _doubt_torques(self):
        """Warn of weights and torques at bit and drive that are probably in other units."""
        control, bit, drag = self.drive.control, self.bit, self.drag
        stiffness, inertia = self.hook.stiffness if self.hook else math.inf, self.drive.inertia
        for called, value, odd, usual in (
            ("Hook.stiffness", f"{stiffness:g} N/m", stiffness < 1e5, "about 5e6: 5 MN/m are 5e6 or '5 MN/m'"),
            ("TopDrive.inertia", f"{inertia:g} kg m^2", 0 < inertia < 20, "about 1000 to 4000: 2.9 t m^2 are 2900"),
            ("ViscousDrag", f"{drag} 1/s", drag and max(drag.torsion, drag.axial) > 50, "0.05 to 5 1/s: it is a rate"),
        ):
            if odd:
                warn(f"{called} = {value} is hardly that of a rig with a string, {usual}")
        if isinstance(control, Motor):
            doubt_load("Motor.torque", control.torque, "torque", of="drive")
        if bit is None:
            return
        doubt_load("BitOnRock.weight", bit.most or 0.0, "weight")
        law = None if bit.law.needs_weight else bit.law.resistance(bit.most)  # one by the weight may be small
        if law is not None:
            called = f"The torque of {type(bit.law).__name__}(...)"
            doubt_load(called, max(law.still, law.kinetic), "torque", "; coefficients of friction need radius= (m)")

    @property
    def discs(self) -> Discs | None:
        """The string, where it is one of `Discs`."""
        return self.string if isinstance(self.string, Discs) else None

    @cached_property
    def bit_depth(self) -> float:
        """Measured depth of the lower end, m."""
        if self.depth is not None:
            return self.depth
        return self.hole.length if self.hole else math.fsum(part.length for part in self.string.components)

    @cached_property
    def laid(self) -> list:
        """The components in their places, from the bit up."""
        return self.string.laid(self.bit_depth, str if self.hole is None else self.hole.path.told)

    @cached_property
    def fluids(self) -> Mud | None:
        """The mud: without a hole air where none is given."""
        return self.mud if self.mud is not None or self.hole is not None else Mud(0.0)

    @cached_property
    def places(self) -> list:
        """The uniform parts of the string in their places, from the top down: components, cut between fluids."""
        return in_columns(self.laid, self.fluids)[::-1]

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """The uniform parts of the string, from the top down."""
        return tuple(segment_of(place, place.weight_in(self.fluids)) for place in self.places)

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """Where tools part the string, from the top down."""
        return () if self.discs else joints_of(self.laid, [place.bottom for place in self.places])

    @cached_property
    def motors(self) -> tuple:
        """Each `MudMotor` of the string, from the top down."""
        return tuple(x.tool for x in self.joints if x.turns)

    @property
    def motor(self):
        """The lowest `MudMotor` of the string, which turns the bit, or None."""
        return self.motors[-1] if self.motors else None

    @cached_property
    def motors_above(self) -> np.ndarray:
        """(segments,) how many motors are above each of them."""
        return np.searchsorted([x.segment for x in self.joints if x.turns], np.arange(len(self.segments)))

    @cached_property
    def turned(self) -> tuple[Segment, ...]:
        """The parts below the lowest motor, which turn with the bit; none without one."""
        below = self.motors_above == len(self.motors)
        return tuple(x for x, turns in zip(self.segments, below, strict=True) if turns) if self.motors else ()

    @cached_property
    def inertias(self) -> np.ndarray:
        """(motors + 1,) of what turns with the drive, and of the parts below each motor, kg m^2."""
        return np.bincount(self.motors_above, [x.rhoJ * x.length for x in self.segments], len(self.motors) + 1)

    @property
    def turned_inertia(self) -> float:
        """Of the parts below the lowest motor, kg m^2; 0 without one."""
        return float(self.inertias[-1]) if self.motors else 0.0

    @property
    def drag_rates(self) -> tuple[float, float]:
        """Rates of drag along the axis and of torsion, 1/s."""
        return (0.0, 0.0) if self.drag is None else (self.drag.axial, self.drag.torsion)

    @property
    def bit_inertia(self) -> float:
        """At the lower end, beside that of the string's sections: of bit and rotor of the lowest motor, kg m^2."""
        return (self.bit.inertia if self.bit else 0.0) + (self.motor.rotor_inertia if self.motor else 0.0)

    @property
    def damped(self) -> bool:
        """Whether a component has a damping time."""
        return not self.discs and any(part.damping_time for part in self.segments)

    @property
    def by_elements(self) -> bool:
        """Whether motion is computed by elements in torsion, too: that of discs, damped strings and several motors."""
        return self.discs is not None or self.damped or len(self.motors) > 1

    def with_case(self, speed: float | None = None, weight: float | None = None) -> "Drilling":
        """The same scene at another speed of the drive (rad/s) or another static weight on bit (N).

        Raises:
            SceneError: a weight where there is no bit.
        """
        drive = self.drive if speed is None else replace(self.drive, speed=speed)
        if weight is not None and self.bit is None:
            refuse(self, "bit", None, "a BitOnRock, whose weight is to change")
        bit = self.bit if weight is None else replace(self.bit, weight=weight)
        return replace(self, drive=drive, bit=bit)

    def sentences(self, units: Units, duration: float | None = None):
        """On string, hole, drive, bit, hook and friction, in some units.

        Args:
            duration: s, up to which speeds that depend on time are said.
        """
        if self.discs:
            inertias = ", ".join(units.told(x, "kg m^2") for x in self.discs.inertias)
            yield f"String: {len(self.discs.inertias)} discs from the drive down, of {inertias}."
        else:
            yield from self._string_in_words(units)
        drive, bit, hook = self.drive, self.bit, self.hook
        asked = "no speed asked for"
        if drive.speed is not None:
            asked = _over_time(drive.signal(), "rad/s", "angular velocity", units, duration)
        inertia = f", inertia {units.told(drive.inertia, 'kg m^2')}" if drive.inertia else ""
        yield f"Drive: {asked}, {drive.control.in_words(units)}{inertia}."
        for joint in self.joints:
            yield joint.tool.sentence(units)
        yield (
            "Bit: none, the lower end is free." if bit is None else f"Bit: {', '.join(_at_bit(bit, units, duration))}."
        )
        if hook is not None:
            stiff = units.told(hook.stiffness, "N/m", "stiffness") if math.isfinite(hook.stiffness) else "rigid"
            upwards = _over_time(hook.signal(), "m/s", "speed", units, duration)
            yield f"Hook: {stiff}, the block moves upwards at {upwards}."
        for name in ("friction", "drag"):
            if (law := getattr(self, name)) is not None:
                yield f"{name.capitalize()}: {law.in_words(units)}."

    def _string_in_words(self, units):
        mud, told = self.mud, units.told
        fluid = " in air" if mud is not None or self.hole is None else ""
        fluid = " in mud" if mud is not None and mud.densities([0.0, self.bit_depth]).any() else fluid
        for part in self.segments:
            weight = told(part.weight, "N/m", "force per length", ".5g", "N/m")
            torsion = told(part.torsional_impedance, "N m s/rad", form=".5g")
            axial = told(part.axial_impedance, "N s/m", form=".5g")
            speeds = [told(x, "m/s", "wave speed", ".5g") for x in (part.torsional_speed, part.axial_speed)]
            yield (
                f"String, {part.name}: {told(part.length, 'm')}, {weight}{fluid}, impedance {torsion} in torsion and "
                f"{axial} along the axis, waves at {' and '.join(speeds)}."
            )
        if mud is not None:
            yield from mud.sentences(units)
        depth = told(self.bit_depth, "m")
        if self.hole is None:
            yield f"Hole: none, no walls; bit at md = {depth}, the string hangs vertically."
            return
        yield from self.hole.sections_in_words(units)
        inclination = math.degrees(self.hole.path.inclination.max())
        yield f"Bit at md = {depth}; largest inclination of the hole {inclination:.4g} degrees."


def _over_time(signal, unit, dimension, units, duration):
    """A speed, or from which to which it goes up to a time (s), in some units; of rotation in rpm."""

    def told(value):
        return f"{value / rpm:.5g} rpm" if unit == "rad/s" else units.told(value, unit, dimension, ".5g")

    if signal.constant:
        return told(signal(0.0))
    until = duration or max(signal.jumps, default=1.0)
    times = [*(until * k / 200 for k in range(201)), *(t for t in signal.jumps if 0 <= t <= until)]
    values = [signal(t) for t in times]
    return f"{told(min(values))} to {told(max(values))}, which depends on time"


def _at_bit(bit, units, duration):
    yield bit.law.in_words(units)
    if bit.weight:
        if bit.varies:
            yield f"on bit {_over_time(bit.signal(), 'N', 'force', units, duration)}"
        else:
            yield f"{units.told(bit.weight, 'N')} on bit"
    if bit.inertia:
        yield f"inertia {units.told(bit.inertia, 'kg m^2')}"
    if bit.weight and isinstance(bit.law, Stribeck) and bit.law.radius is None:
        yield "its torque does not follow the weight: that takes coefficients and a radius"
