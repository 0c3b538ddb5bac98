"""Scene files of strings in wells, in TOML: keys and types are the argument and class names of the package.

title = "..."

[well]
survey = "survey.csv"            # or .xlsx, beside this file; or stations = [[0, 0, 0], [1100, 40, 30]]: md, inc, azi
columns = ["md", "inc", "azi"]   # optional: names of the columns of the file
degrees = true                   # optional
length_unit = "m"                # optional: of the measured depths of survey or stations, such as "ft"
sheet = "as drilled"             # optional: of an .xlsx file, the first one if left out
wall_stiffness = 1e9             # optional
tortuosity = { amplitude = 0.5, period = "300 ft", seed = 1 }  # optional: makes a plan crooked
sections = [
    { to = 2500.0, diameter = 0.2224, friction = 0.20, name = "casing" },
    { to = 3438.0, diameter = "8.5 in", friction = 0.30, name = "open hole" },
]

[string]
order = "bit up"                 # optional, or "top down"
components = [
    { type = "Bit", diameter = "8.5 in" },
    { type = "Collar", size = "NC46-65", length = 90.0 },
    { type = "DrillPipe", size = "5 in 19.50 lb/ft" },
]

[mud]                            # not where all components have their weight in mud
density = "10.2 ppg"

[[operations]]
type = "RotaryDrilling"
weight = "18 klbf"
torque = 5000.0

[torque_and_drag]                # optional: depth, model, tol, torque_convention
depth = 3438.0

[depth_sweep]                    # optional: depths, a list or equally spaced; friction; model, tol other than above
depths = { from = "300 m", to = 3438.0, count = 20 }
friction = [0.1, 0.2, 0.3]

[strength]                       # optional: grade, wear (or tables by names of components), safety, buckling, model
grade = { "drill pipe" = "S135" }
wear = 0.8

[build_rate]                     # optional: of each operation with weight on bit
anisotropy = 0.1                 # optional

Numbers are in SI, or text with a unit (`quantities.DIMENSIONS`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np

from cosserat_fenicsx import units as constants
from cosserat_fenicsx.checks import File, refuse, warn
from cosserat_fenicsx.parts import Depth, Number, Part, Settings, Values, between, concerning, positive
from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.results.result import Result
from cosserat_fenicsx.results.screen import InWords
from cosserat_fenicsx.well.answer import TorqueAndDrag
from cosserat_fenicsx.well.assembly import LENGTH, BuildRate, assembly_of, build_rate
from cosserat_fenicsx.well.components import DrillString, in_columns
from cosserat_fenicsx.well.hole import Borehole, Mud
from cosserat_fenicsx.well.operations import BackReam, Operation, Ream
from cosserat_fenicsx.well.pieces import pieces_of, within
from cosserat_fenicsx.well.rod.rod_answer import check_rod
from cosserat_fenicsx.well.solve import CONVENTIONS, ROD, check_settings, torque_and_drag
from cosserat_fenicsx.well.sweep import DepthSweep, depth_sweep
from cosserat_fenicsx.well.utilisation import strengths_of

_SOFT = (
    "the soft string by a differential equation along the axis, and what that leaves out is estimated with each answer."
)
_ROD = "the exact rod in contact with the wall, stiff and with its clearance, on meshes that are refined until tol."
#: Descriptions of the models of `torque_and_drag`.
_MODELS = {
    "soft": _SOFT,
    "buckled": f"{_SOFT[:-1]}; with the wall force of a helix where it is one.",
    "rod": _ROD,
    "auto": f"first {_SOFT} Where that is above tol: {_ROD}",
}


@dataclass(frozen=True)
class TorqueAndDragSettings(Settings):
    """Arguments of `torque_and_drag` in a scene file; None for its own defaults.

    Args:
        depth: measured depth of the bit, m. model, tol, torque_convention: as for `torque_and_drag`.
    """

    depth: Depth | None = None
    model: str | None = None
    tol: float | None = None
    torque_convention: str | None = None

    called = "torque_and_drag"


@dataclass(frozen=True)
class DepthSweepSettings(Settings):
    """Arguments of `depth_sweep` in a scene file; None for its own defaults.

    Args:
        depths: measured depths of the bit, m: a list, or equally spaced ones.
        friction: a number for all sections of the hole, or a list: each a number, or one for each section.
        model, tol: as for `depth_sweep`; None for those of [torque_and_drag].
    """

    depths: Annotated[Sequence[float], Values(Number("length", positive("a measured depth")))]
    friction: Any = None
    model: str | None = None
    tol: float | None = None

    called = "depth_sweep"


@dataclass(frozen=True)
class StrengthSettings(Part):
    """Settings for the strength of a string in a scene file.

    Args:
        grade, wear: of the drill pipe, or tables by names of components, see `TorqueAndDrag.utilisation`.
        safety: factor in the margin of overpull and the most weight on bit.
        buckling: "helical" or "sinusoidal": which limits the weight on bit. model: by which it is found.
    """

    grade: Any = "E75"
    wear: Any = 1.0
    safety: float = 1.1
    buckling: Literal["helical", "sinusoidal"] = "helical"
    model: Literal["soft", "buckled", "rod"] = "buckled"

    called = "strength"

    def of(self, answer: TorqueAndDrag) -> dict[str, Result]:
        """{name: `Utilisation`, `MarginOfOverpull`, and `MostWeightOnBit` where there is a weight on bit}."""
        found = {"strength": answer.utilisation(self.grade, self.wear)}
        found["overpull"] = answer.margin_of_overpull(self.grade, self.wear, safety=self.safety)
        if answer.operation.weight > 0:
            found["weight_on_bit"] = answer.most_weight_on_bit(
                self.grade, self.wear, safety=self.safety, buckling=self.buckling, model=self.model
            )
        return found


@dataclass(frozen=True)
class BuildRateSettings(Part):
    """Arguments of `build_rate` in a scene file.

    Args:
        anisotropy: as for `build_rate`.
    """

    anisotropy: Annotated[float, between(0, 10)] = 0.1

    called = "build_rate"


@dataclass(frozen=True)
class WellScene(InWords, Part):
    """A string in its hole and its operations, from `read`.

    Args:
        well: the `Borehole`. string: the `DrillString`. operations: in the order of the file.
        mud: the `Mud`, or None.
        torque_and_drag: arguments of `torque_and_drag`, or None. depth_sweep: arguments of `depth_sweep`, or None.
        strength: what is asked of the string's strength, or None.
        build_rate: arguments of `build_rate`, or None.
        title: for tables and charts.

    Raises:
        SceneError: what does not fit the hole, before anything is solved, and unknown settings.
    """

    well: Borehole
    string: DrillString
    operations: tuple[Operation, ...]
    mud: Mud | None = None
    torque_and_drag: TorqueAndDragSettings | None = None
    depth_sweep: DepthSweepSettings | None = None
    strength: StrengthSettings | None = None
    build_rate: BuildRateSettings | None = None
    title: str = ""

    def validate(self):
        hole, settings, sweep = self.well, self.settings, self.sweep
        self._doubt_lengths()
        here = [settings.pop("depth", hole.length)]
        friction, depths = sweep.get("friction", []), sweep.get("depths", [])
        of_sweep = {name: sweep[name] for name in ("model", "tol") if name in sweep}
        with concerning("depth_sweep", "friction"):
            for value in friction if isinstance(friction, list) else [friction]:
                hole.with_friction(value)
        self._check(settings, here)
        with concerning("depth_sweep", "depths"):
            if len(depths):
                within(f"depth_sweep: depths[{depths.argmax()}]", hole, float(depths.max()))
        with concerning("depth_sweep"):
            self._check({**settings, **of_sweep}, self.string.fitting(depths))
        if self.strength is not None:
            with concerning("strength"):
                strengths_of("strength", self.string.laid(here[0]), self.strength.grade, self.strength.wear)
        if self.build_rate is not None:
            with concerning("build_rate"):
                self._check_builds(*here)

    def _doubt_lengths(self):
        """Warn of components whose lengths are whole millimetres, and not hundredths of a foot, in a hole in feet."""
        found = []
        for part in self.string.components if self.hole.path.unit == "ft" else ():
            mm, feet = ((part.length or 0.0) / size for size in (1e-3, constants.foot / 1200))
            if mm > 1000 and abs(mm - round(mm)) < 1e-6 and abs(feet - round(feet)) > 1e-3:
                found.append(f"{part.length:.10g} m of the {part.name}")
        if found:
            text = f"string: lengths in m beside a survey in feet: {', '.join(found)}"
            warn(f"{text}: if these are feet, write '{found[0].split()[0]} ft' and so on")

    def _check_builds(self, depth):
        """Refuse an assembly that `build_rate` cannot take."""
        if not self.drilling:
            refuse("build_rate", "operations", "none with weight on bit", "one that drills, such as Sliding")
        laid = self.string.laid(depth)
        assembly_of(self.hole, laid, self.mud, self.drilling[0], depth, min(LENGTH, depth))

    @property
    def drilling(self) -> list[Operation]:
        """The operations with weight on bit."""
        return [operation for operation in self.operations if operation.weight > 0]

    def _check(self, asked, depths):
        """Refuse settings of `torque_and_drag`, and what does not fit the hole at some depths."""
        hole = self.well
        check_settings(**asked)
        for depth in depths:
            _, laid = pieces_of(hole, self.string, self.operations[0], self.mud, depth)
            if asked.get("model") == ROD:
                for operation in self.operations:
                    convention = asked.get("torque_convention", CONVENTIONS[0])
                    check_rod(hole, in_columns(laid, self.mud), operation, self.mud, convention)

    def sentences(self, units: Units):
        """On hole, mud, string, operations and model, in some units."""
        if self.title:
            yield self.title
        yield from self.hole.sentences(units)
        if self.mud is not None:
            yield from self.mud.sentences(units)
        settings, sweep = self.settings, self.sweep
        yield from self.string.sentences_at(settings.get("depth", self.hole.length), self.mud, units)
        for operation in self.operations:
            on_bit = f"{units.told(operation.weight, 'N')} and {units.told(operation.torque, 'N m')}"
            loads = f"on bit {on_bit}" if operation.weight or operation.torque else "no load on the bit"
            moves = ""
            if isinstance(operation, Ream | BackReam):
                moves = f", {units.told(operation.speed, 'm/s')} along the hole at {operation.rpm:g} rev/min"
            yield f"Operation: {operation.name}{moves}, {loads}."
        if sweep:
            low, high = (units.told(x, "m") for x in (sweep["depths"].min(), sweep["depths"].max()))
            yield f"Sweep over {len(sweep['depths'])} depths of the bit, {low} to {high}."
        if self.strength is not None:
            asked = self.strength
            yield (
                f"Strength: grade {asked.grade}, wear {asked.wear}; margin of overpull, and the most weight on bit "
                f"where there is one, with a safety factor of {asked.safety:g} and {asked.buckling} buckling."
            )
        if self.build_rate is not None:
            yield f"Rates of build by several criteria, anisotropy {self.build_rate.anisotropy:g}."
        model, tol = settings.get("model", "auto"), settings.get("tol", 1e-4)
        yield f"Model: {model}, tol = {tol:g}: {_MODELS[model]}"

    @property
    def hole(self) -> Borehole:
        """The hole."""
        return self.well

    @property
    def settings(self) -> dict[str, Any]:
        """Arguments of `torque_and_drag`."""
        return self.torque_and_drag.given() if self.torque_and_drag else {}

    @property
    def sweep(self) -> dict[str, Any]:
        """Arguments of `depth_sweep` beside these, empty where the file asks for none."""
        return self.depth_sweep.given() | {"depths": np.array(self.depth_sweep.depths)} if self.depth_sweep else {}

    def answer(self, operation: Operation) -> TorqueAndDrag:
        """The answer of `torque_and_drag` for an operation."""
        return torque_and_drag(self.hole, self.string, operation, mud=self.mud, **self.settings)

    def run(self) -> list[TorqueAndDrag]:
        """The answers of `torque_and_drag`, one an operation; see also `swept`."""
        return [self.answer(operation) for operation in self.operations]

    def builds(self, operation: Operation) -> BuildRate:
        """The rates of build of an operation with weight on bit."""
        settings = (self.build_rate or BuildRateSettings()).arguments()
        return build_rate(self.hole, self.string, operation, mud=self.mud, depth=self.settings.get("depth"), **settings)

    def swept(self, folder: File | None = None) -> DepthSweep | None:
        """The sweep over depths that the file asks for, else None; `folder`: see `depth_sweep`."""
        if self.depth_sweep is None:
            return None
        settings = {name: value for name, value in self.settings.items() if name != "depth"}
        return depth_sweep(
            self.hole, self.string, self.operations, mud=self.mud, folder=folder, **{**settings, **self.sweep}
        )
