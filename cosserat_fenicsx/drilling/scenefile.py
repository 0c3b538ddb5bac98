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

[simulate]                       # duration, and what else `simulate_drilling` takes
duration = 60.0

[stability]                      # optional: speeds, weights

Numbers are in SI, or text with a unit (`dimensions`).
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cosserat_fenicsx.checks import File, positive, refuse
from cosserat_fenicsx.dimensions import DIMENSIONS, in_si
from cosserat_fenicsx.drilling.bit_laws import BitLaw, BitOnRock, Stribeck, Wear
from cosserat_fenicsx.drilling.choose import chosen
from cosserat_fenicsx.drilling.history import DrillingHistory
from cosserat_fenicsx.drilling.linear.frequencies import SoftSpeed, SoftTorque
from cosserat_fenicsx.drilling.linear.stability import Stability, stability
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.drilling.segments import Discs
from cosserat_fenicsx.drilling.simulate import check_arguments as check_simulation
from cosserat_fenicsx.drilling.simulate import simulate_drilling
from cosserat_fenicsx.drilling.top_drive import DriveControl, Hook, TopDrive
from cosserat_fenicsx.drilling.wall_friction import ViscousDrag, WallFriction
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.parts import members
from cosserat_fenicsx.scene.signals import SIGNALS
from cosserat_fenicsx.scene.toml_tables import check_arguments, class_named, known_keys, table, tables_of
from cosserat_fenicsx.well.hole import Mud
from cosserat_fenicsx.well.scenefile import hole_in, made, string_in

#: Dimensions of arguments that may be written with a unit, by class.
_DIMENSIONS = {
    "TopDrive": {"speed": "angular velocity"},
    "Matched": {"torque": "moment"},
    "Motor": {"torque": "moment"},
    "Hook": {"stiffness": "stiffness", "speed": "speed"},
    "BitOnRock": {"weight": "force", "rock_stiffness": "stiffness"},
    "Stribeck": {"static": "moment", "dynamic": "moment", "speed": "angular velocity", "radius": "length"},
    "Cutting": {"a": "length", "epsilon": "pressure"},
    "Wear": {"stress": "pressure", "length": "length"},
    "Lobes": {"amplitude": "length"},
}
#: Keys of the tables whose keys are not the arguments of a class.
KEYS = {
    "simulate": ("duration", "model", "dt", "elements", "save_every", "profile_every"),
    "stability": ("speeds", "weights"),
}
_TABLES = ("title", "well", "string", "discs", "mud", "drive", "bit", "hook", "wall_friction", "drag", "depth", "start",
           *KEYS)  # fmt: skip
_TUNED = (SoftTorque, SoftSpeed)


@dataclass(frozen=True)
class DrillingScene:
    """A drill-string in motion and what is computed of it, from `read_drilling_scene`.

    Attributes:
        scene: the `Drilling`. settings: arguments of `simulate_drilling`.
        speeds: rad/s, and weights: N, of the map of stability; empty where the file asks for none.
    """

    title: str
    scene: Drilling
    settings: dict[str, Any] = field(default_factory=dict)
    speeds: tuple[float, ...] = ()
    weights: tuple[float, ...] = ()

    def simulate(self, **changed) -> DrillingHistory:
        """The motion by `simulate_drilling`; `changed`: arguments other than in the file.

        Raises:
            SceneError: no duration; see `simulate_drilling`, whose other exceptions it raises too.
        """
        given = {**self.settings, **changed}
        if given.get("duration") is None:
            raise SceneError("simulate.duration = None: expected a positive number (s), in [simulate]")
        return simulate_drilling(self.scene, **given)

    def stability(self) -> Stability | None:
        """The growth of every mode at the speeds and weights of the file, see `stability`; None where it asks for none.

        Raises:
            SceneError, NotConverged: see `stability`.
        """
        return stability(self.scene, self.speeds, self.weights or None) if self.speeds else None


def read_drilling_scene(file: File) -> DrillingScene:
    """A drill-string in motion from a scene file with a [drive] table.

    Raises:
        SceneError: the file is missing or not TOML, a key, a type or a unit is unknown, or a value is refused.
    """
    return drilling_in(tables_of(file), Path(file))


def drilling_in(tables, file):
    """The `DrillingScene` in the tables of a file, a Path; see `read_drilling_scene`."""
    try:
        return _scene(tables, file.parent)
    except SceneError as problem:
        raise SceneError(f"{file}: {problem}") from None


def _scene(tables, folder):
    known_keys("the file (of a drill-string in motion)", tables, _TABLES)
    if "drive" not in tables or ("string" in tables) == ("discs" in tables):
        raise SceneError("expected [drive], and either [string] or [discs]")
    parts = {"mud": (Mud,), "hook": (Hook,), "drag": (ViscousDrag,)}
    given = {name: made(name, tables[name], kinds) if name == "mud" else _made(name, tables[name], kinds)
             for name, kinds in parts.items() if name in tables}  # fmt: skip
    if "discs" in tables:
        given["string"] = _made("discs", tables["discs"], (Discs,))
    else:
        given["string"] = string_in(tables["string"])
    if "well" in tables:
        given["hole"] = hole_in(table("well", tables["well"]), folder)
    if "depth" in tables:
        given["depth"] = in_si("depth", tables["depth"], "length")
    if "start" in tables:
        given["start"] = tables["start"]
    if "bit" in tables:
        given["bit"] = _made("bit", tables["bit"], (BitOnRock,))
    if "wall_friction" in tables:
        given["friction"] = _friction(dict(table("wall_friction", tables["wall_friction"])))
    scene = Drilling(drive=_drive(dict(table("drive", tables["drive"])), given), **given)
    settings = _settings(dict(table("simulate", tables.get("simulate", {}))))
    if "duration" in settings:
        check_simulation(scene, **{name: value for name, value in settings.items() if name != "model"})
    chosen(scene, settings.get("model", "auto"))
    speeds, weights = _stability(dict(table("stability", tables.get("stability", {}))), scene)
    return DrillingScene(str(tables.get("title", "")), scene, settings, speeds, weights)


def _drive(entry, given):
    """The `TopDrive` of a table; the tuned controls need the rest of the scene, arguments of `Drilling`."""
    control = entry.get("control")
    if isinstance(control, str):
        control = {"type": control}
    if control is not None:
        known = (*members(DriveControl).values(), *_TUNED)
        kind = class_named("drive.control", table("drive.control", control).get("type"), known)
        if kind in _TUNED:
            known_keys(f"drive.control ({kind.__name__})", control, ("type",))
            if "inertia" not in entry:
                raise SceneError(f"drive.inertia is missing: expected that of the drive (kg m^2), about 2000 to 4000: "
                                 f"{kind.__name__} chooses its gains by it")  # fmt: skip
            inertia = positive("TopDrive", "inertia", entry["inertia"], "kg m^2, of the drive")
            standing = Drilling(drive=TopDrive(0.0), **given)
            discs = isinstance(standing.string, Discs)  # refused there
            entry["control"] = kind(*((standing, inertia) if discs else (standing.string, inertia, standing.bit_depth)))
        else:
            entry["control"] = _made("drive.control", control, known)
    return _made("drive", entry, (TopDrive,))


def _friction(entry):
    dimension = "angular velocity" if entry.get("of_rotation") is True else "speed"
    if "speed" in entry:
        entry["speed"] = in_si("wall_friction.speed", entry["speed"], dimension)
    return _made("wall_friction", entry, (WallFriction,))


def _made(where, entry, classes):
    """An object from a table whose keys are the arguments of its class; objects that are made already stay."""
    entry = dict(table(where, entry))
    cls = classes[0] if len(classes) == 1 else class_named(where, entry.pop("type", None), classes)
    check_arguments(where, cls, entry)
    inner, dimensions = (
        {"law": tuple(members(BitLaw).values()) if cls is BitOnRock else (Stribeck,), "wear": (Wear,)},
        _DIMENSIONS.get(cls.__name__, {}),
    )
    for name, value in entry.items():
        if name in inner:
            entry[name] = _made(f"{where}.{name}", value, inner[name])
        elif isinstance(value, dict) and name == "speed" and cls in (TopDrive, Hook):
            entry[name] = _signal(f"{where}.{name}", value, dimensions[name])
        elif name in dimensions:
            entry[name] = in_si(f"{where}.{name}", value, dimensions[name])
        elif isinstance(value, list):
            entry[name] = tuple(value)
    try:
        return cls(**entry)
    except SceneError as problem:
        raise SceneError(f"{where}: {problem}") from None


def _signal(where, entry, dimension):
    """A function of time from a table: `value` or `values` are numbers there, and vectors in the package's classes."""
    entry = dict(entry)
    cls = class_named(where, entry.pop("type", None), SIGNALS)
    check_arguments(where, cls, entry)
    if "value" in entry:
        entry["value"] = (in_si(f"{where}.value", entry["value"], dimension),)
    if isinstance(entry.get("values"), list):
        entry["values"] = [(in_si(f"{where}.values[{i}]", x, dimension),) for i, x in enumerate(entry["values"])]
    if isinstance(entry.get("times"), list):
        entry["times"] = [in_si(f"{where}.times[{i}]", x, "time") for i, x in enumerate(entry["times"])]
    for name in ("start", "peak", "end"):
        if name in entry:
            entry[name] = in_si(f"{where}.{name}", entry[name], "time")
    try:
        return cls(**entry)
    except SceneError as problem:
        raise SceneError(f"{where}: {problem}") from None


def _settings(given):
    known_keys("[simulate]", given, KEYS["simulate"])
    for name in ("duration", "dt", "save_every", "profile_every"):
        if name in given:
            given[name] = in_si(f"simulate.{name}", given[name], "time")
    return given


def _stability(given, scene):
    known_keys("[stability]", given, KEYS["stability"])
    found = []
    for name, dimension in (("speeds", "angular velocity"), ("weights", "force")):
        values = given.get(name, [])
        if isinstance(values, dict):
            values = _range(f"stability.{name}", values, dimension)
        elif isinstance(values, list):
            values = [in_si(f"stability.{name}[{i}]", x, dimension) for i, x in enumerate(values)]
        else:
            refuse("stability", name, values, "a list, or { from = ..., to = ..., count = ... }")
        unit = DIMENSIONS[dimension].si
        found.append(tuple(positive("stability", name, x, unit) for x in values))
    if given and not found[0]:
        raise SceneError("[stability]: 'speeds' is missing: expected a list, or { from = ..., to = ..., count = ... }")
    if found[1]:
        scene.with_case(weight=found[1][0])  # refused where there is no bit
    return found


def _range(where, given, dimension):
    known_keys(where, given, ("from", "to", "count"))
    for name in ("from", "to", "count"):
        if name not in given:
            raise SceneError(f"{where}: '{name}' is missing: expected from, to and count")
    count = given["count"]
    if not isinstance(count, int) or isinstance(count, bool) or not 2 <= count <= 10_000:
        raise SceneError(f"{where}.count = {count!r}: expected how many, from 2")
    ends = [positive(where, name, in_si(f"{where}.{name}", given[name], dimension), DIMENSIONS[dimension].si)
            for name in ("from", "to")]  # fmt: skip
    return np.linspace(*ends, count).tolist()
