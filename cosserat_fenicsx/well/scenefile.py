"""Scene files of strings in wells, in TOML: keys and types are the argument and class names of the package.

title = "..."

[well]
survey = "survey.csv"            # beside this file; or stations = [[0, 0, 0], [1100, 40, 30]], rows of md, inc, azi
columns = ["md", "inc", "azi"]   # optional: names of the columns of the file
degrees = true                   # optional
length_unit = "m"                # optional: of the measured depths of survey or stations, such as "ft"
wall_stiffness = 1e9             # optional
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

[depth_sweep]                    # optional: depths, or from, to and count; friction; model, tol other than above
from = 300.0
to = 3438.0
count = 20
friction = [0.1, 0.2, 0.3]

Numbers are in SI, or text with a unit (`dimensions`).
"""

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cosserat_fenicsx.checks import File, number, refuse
from cosserat_fenicsx.dimensions import in_si, size_of
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.parts import members
from cosserat_fenicsx.scene.sections import Material, Stiffness
from cosserat_fenicsx.scene.toml_tables import check_arguments, class_named, entries, known_keys, table, tables_of
from cosserat_fenicsx.well.answer import TorqueAndDrag
from cosserat_fenicsx.well.components import DrillString, StringPart
from cosserat_fenicsx.well.depth_sweep import DepthSweep, depth_sweep
from cosserat_fenicsx.well.hole import Borehole, HoleSection, Mud
from cosserat_fenicsx.well.operations import Operation
from cosserat_fenicsx.well.path import WellPath
from cosserat_fenicsx.well.pieces import pieces_of
from cosserat_fenicsx.well.rod.rod_answer import check_rod
from cosserat_fenicsx.well.torque_and_drag import CONVENTIONS, ROD, check_settings, torque_and_drag

#: Dimensions of arguments that may be written with a unit.
_LENGTHS = ("to", "diameter", "length", "contact_radius", "outer_diameter", "inner_diameter", "tool_joint",
            "body_diameter", "depth")  # fmt: skip
_DIMENSIONS = {
    **dict.fromkeys(_LENGTHS, "length"), "torque": "moment", "density": "density", "inside": "density",
    "mass": "mass per length", "speed": "speed", "rpm": "rotation", "wall_stiffness": "pressure", "E": "pressure",
}  # fmt: skip
#: Keys of the tables whose keys are not the arguments of a class.
KEYS = {
    "well": ("survey", "stations", "columns", "degrees", "length_unit", "wall_stiffness", "sections"),
    "string": ("components", "order"),
    "torque_and_drag": ("depth", "model", "tol", "torque_convention"),
    "depth_sweep": ("depths", "from", "to", "count", "friction", "model", "tol"),
}
_OF_SWEEPS = ("friction", "model", "tol")


@dataclass(frozen=True)
class WellScene:
    """A string in its hole and what is done with it, from `read_well`.

    Attributes:
        hole: the `Borehole`. string: the `DrillString`. mud: the `Mud`, or None. operations: in the order of the file.
        settings: arguments of `torque_and_drag`.
        sweep: arguments of `depth_sweep` beside these, empty where the file asks for none.
    """

    title: str
    hole: Borehole
    string: DrillString
    mud: Mud | None
    operations: tuple[Operation, ...]
    settings: dict[str, Any] = field(default_factory=dict)
    sweep: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self):
        """Refuse, before anything is solved, what does not fit the hole, and unknown settings."""
        settings = {name: value for name, value in self.settings.items() if name != "depth"}
        friction, depths = self.sweep.get("friction", []), self.sweep.get("depths", [])
        of_sweep = {name: self.sweep[name] for name in ("model", "tol") if name in self.sweep}
        for value in friction if isinstance(friction, list) else [friction]:
            self.hole.with_friction(value)
        here = [self.settings.get("depth", self.hole.length)]
        for asked, places in ((settings, here), ({**settings, **of_sweep}, depths)):
            check_settings(**asked)
            for depth in places:
                _, laid = pieces_of(self.hole, self.string, self.operations[0], self.mud, depth)
                if asked.get("model") == ROD:
                    for operation in self.operations:
                        convention = asked.get("torque_convention", CONVENTIONS[0])
                        check_rod(self.hole, laid, operation, self.mud, convention)

    def answer(self, operation: Operation) -> TorqueAndDrag:
        """The answer of `torque_and_drag` for an operation."""
        return torque_and_drag(self.hole, self.string, operation, mud=self.mud, **self.settings)

    def answers(self) -> list[TorqueAndDrag]:
        """The answers of `torque_and_drag`, one an operation."""
        return [self.answer(operation) for operation in self.operations]

    def depth_sweep(self, folder: File | None = None) -> DepthSweep | None:
        """The sweep over depths that the file asks for, else None; `folder`: see `depth_sweep`."""
        if not self.sweep:
            return None
        settings = {name: value for name, value in self.settings.items() if name != "depth"}
        return depth_sweep(
            self.hole, self.string, self.operations, mud=self.mud, folder=folder, **{**settings, **self.sweep}
        )


def read_well(file: File) -> WellScene:
    """A string in its hole from a scene file with a [well] table.

    Raises:
        SceneError: the file is missing or not TOML, a key, a type or a unit is unknown, or a value is refused.
    """
    return well_in(tables_of(file), Path(file))


def well_in(tables, file):
    """The `WellScene` in the tables of a file, a Path; see `read_well`."""
    try:
        return _scene(tables, file.parent)
    except SceneError as problem:
        raise SceneError(f"{file}: {problem}") from None


def _scene(tables, folder):
    known = ("title", "well", "string", "mud", "operations", "torque_and_drag", "depth_sweep")
    known_keys("the file (of a well)", tables, known)
    for name in ("well", "string", "operations"):
        if not tables.get(name):
            raise SceneError(f"[{name}] is missing: expected [well], [string] and [[operations]]")
    hole = hole_in(table("well", tables["well"]), folder)
    string = string_in(tables["string"])
    given = entries("operations", tables)
    operations = tuple(made(f"operations[{i}]", entry, _members(Operation)) for i, entry in given)
    mud = made("mud", tables["mud"], (Mud,)) if "mud" in tables else None
    settings = dict(table("torque_and_drag", tables.get("torque_and_drag", {})))
    known_keys("[torque_and_drag]", settings, KEYS["torque_and_drag"])
    if "depth" in settings:
        settings["depth"] = _depth("torque_and_drag", "depth", settings["depth"])
    sweep = _sweep(table("depth_sweep", tables["depth_sweep"])) if "depth_sweep" in tables else {}
    return WellScene(str(tables.get("title", "")), hole, string, mud, operations, settings, sweep)


def string_in(given):
    """The `DrillString` of a [string] table."""
    string = dict(table("string", given))
    known_keys("[string]", string, KEYS["string"])
    parts = [made(f"string.components[{i}]", entry, _members(StringPart)) for i, entry in entries("components", string)]
    return DrillString(parts, **{name: string[name] for name in ("order",) if name in string})


def hole_in(well, folder):
    """The `Borehole` of a [well] table; names of files in it are beside those in `folder`, a Path."""
    known_keys("[well]", well, KEYS["well"])
    if ("survey" in well) == ("stations" in well):
        raise SceneError("[well]: expected either survey, the name of a .csv file, or stations, rows of md, inc, azi")
    unit = None
    if "length_unit" in well:
        unit = size_of("well.length_unit", well["length_unit"], "length")
    degrees = well.get("degrees")
    if "survey" in well:
        columns = well.get("columns", ["md", "inc", "azi"])
        if not isinstance(columns, list) or len(columns) != 3 or not isinstance(well["survey"], str):
            raise SceneError("[well]: expected survey, the name of a .csv file, and columns, three names of columns")
        path = WellPath.from_csv(folder / well["survey"], *columns, degrees=degrees, length_unit=unit)
    else:
        try:
            rows = [(_station(i, depth, unit or 1.0), *angles) for i, (depth, *angles) in enumerate(well["stations"])]
            md, inc, azi = np.array(rows, dtype=float).T
        except (ValueError, TypeError, OverflowError) as problem:
            if isinstance(problem, SceneError):
                raise
            raise SceneError("well.stations: expected rows of three numbers: md, inclination, azimuth") from None
        path = WellPath.from_survey(md, inc, azi, degrees)
    sections = [made(f"well.sections[{i}]", entry, (HoleSection,)) for i, entry in entries("sections", well)]
    stiff = {name: in_si(f"well.{name}", well[name], "pressure") for name in ("wall_stiffness",) if name in well}
    return Borehole(path, sections, **stiff)


def _station(i, depth, unit):
    """Measured depth of a station, m: text has its own unit."""
    return in_si(f"well.stations[{i}]", depth, "length") if isinstance(depth, str) else depth * unit


def _sweep(given):
    known_keys("[depth_sweep]", given, KEYS["depth_sweep"])
    if "depths" in given:
        if not isinstance(given["depths"], list) or not given["depths"]:
            refuse("depth_sweep", "depths", given["depths"], "a list of measured depths, such as [1000.0, 2000.0]")
        depths = [_depth("depth_sweep", f"depths[{i}]", x) for i, x in enumerate(given["depths"])]
    else:
        for name in ("from", "to", "count"):
            if name not in given:
                raise SceneError(f"[depth_sweep]: '{name}' is missing: expected depths, or from, to and count")
        count = given["count"]
        if not isinstance(count, int) or isinstance(count, bool) or count < 1:
            raise SceneError(f"depth_sweep.count = {count!r}: expected how many depths")
        depths = np.linspace(*(_depth("depth_sweep", name, given[name]) for name in ("from", "to")), count)
    return {"depths": depths, **{name: given[name] for name in _OF_SWEEPS if name in given}}


def _depth(table, name, value):
    value = in_si(f"{table}.{name}", value, "length")
    return number(table, name, value, "a measured depth (m), positive", lambda x: 0 < x < np.inf)


def _members(family):
    return tuple(members(family).values())


def made(where, entry, classes):
    """An object from a table whose keys are the arguments of its class."""
    entry = dict(table(where, entry))
    cls = classes[0] if len(classes) == 1 else class_named(where, entry.pop("type", None), classes)
    check_arguments(where, cls, entry)
    for name, value in entry.items():
        if name in ("material", "stiffness"):
            entry[name] = made(f"{where}.{name}", value, (Material if name == "material" else Stiffness,))
        elif name == "weight":  # on bit, or in mud
            entry[name] = in_si(f"{where}.{name}", value, "force" if issubclass(cls, Operation) else "force per length")
        elif name in _DIMENSIONS and name in {item.name for item in dataclasses.fields(cls)}:
            entry[name] = in_si(f"{where}.{name}", value, _DIMENSIONS[name])
    try:
        return cls(**entry)
    except SceneError as problem:
        raise SceneError(f"{where}: {problem}") from None
