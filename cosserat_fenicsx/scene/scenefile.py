"""Scene files in TOML: their keys and types are the argument and class names of the package.

[[rods]]
name = "column"
curve = { type = "Line", start = [0, 0, 0], end = [0, 0, 20] }
section = { type = "Circle", diameter = 0.2 }
material = { E = 210e9, nu = 0.3 }
# a section that jumps: section = [{ to = 5.0, type = "Circle", diameter = 0.2 }, { type = "Circle", diameter = 0.1 }]
# mass off the axis: eccentricity = [0.01, 0.0], or [{ to = 5.0, offset = [0.01, 0.0] }, { offset = [0.0, 0.0] }]
# a curve from a file beside this one: curve = { type = "Spline", points = "survey.csv" }

[[supports]]
type = "Clamp"
station = "column.start"          # or "column.end", or "column@5.0" for s = 5 m

[[loads]]
type = "Force"
station = "column.end"
force = [0, 0, -1e5]

# in a motion: force = { type = "Triangle", value = [0, 0, 50], peak = 1.0, end = 2.0 }, or Step, Ramp, RunUp, Sine,
# Table

[[velocities]]                    # optional, initial velocities of a motion
rod = "column"
angular = [0, 0, 6.28]

[[joints]]                        # optional, between rods that touch
first = "column.end"
second = "beam.start"

[solve]                           # optional: defaults of the command line
load_factors = [0.5, 1.0]

[simulate]                        # a motion, instead of an equilibrium path; arguments of `simulate`
duration = 10.0                   # s
tol = 1e-3                        # or dt = 0.01
start = 0.9                       # optional: begin at the equilibrium of the loads just before t = 0 at this factor
"""

import dataclasses
import inspect
from pathlib import Path
from typing import Any

from cosserat_fenicsx.checks import File, store
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.scene.curves import CURVES
from cosserat_fenicsx.scene.loads import LOADS
from cosserat_fenicsx.scene.profiles import SECTIONS
from cosserat_fenicsx.scene.rod import Damping, Rod, kind_of, look_up
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.scene.sections import Material, Stiffness
from cosserat_fenicsx.scene.signals import ALONG, SIGNALS
from cosserat_fenicsx.scene.supports import SUPPORTS, InitialVelocity, Joint
from cosserat_fenicsx.scene.toml_tables import check_arguments, tables_of
from cosserat_fenicsx.scene.toml_tables import entries as _entries
from cosserat_fenicsx.scene.toml_tables import known_keys as _known_keys
from cosserat_fenicsx.scene.toml_tables import table as _table

#: Keys of [solve]: the arguments of `solve` that are plain values, with their TOML types.
SOLVE_KEYS = {
    "load_factors": (list, str, int, float),
    "model": (str,),
    "formulation": (str,),
    "tol": (int, float),
    "bound": (list,),
    "elements": (int,),
    "degree": (int,),
    "control": (str,),
    "branch": (int,),
}
#: Keys of [simulate]: the arguments of `simulate` that are plain values, with their TOML types.
SIMULATE_KEYS = {
    **dict.fromkeys(("duration", "tol", "dt", "save_every", "start", "load_factor"), (int, float)),
    **dict.fromkeys(("scheme", "model"), (str,)),
    **dict.fromkeys(("elements", "degree"), (int,)),
}


def read_scene(file: File) -> tuple[Scene, dict[str, Any]]:
    """A scene and its solver settings from a TOML file.

    Args:
        file: path of the file.

    Returns:
        (Scene, dict of the [solve] table): `solve(scene, **settings)` does what the file says.

    Raises:
        SceneError: the file is missing or not TOML, a key or a type is unknown (named, with the nearest known one), or
            a value is refused.
    """
    scene, settings, _ = _read(file)
    return scene, settings


def read_motion(file: File) -> tuple[Scene, dict[str, Any]]:
    """A scene and the arguments of its motion from a TOML file: `simulate(scene, **arguments)`.

    Args:
        file: path of the file.

    Returns:
        (Scene, dict of the [simulate] table), empty where there is none.

    Raises:
        SceneError: see `read_scene`.
    """
    scene, _, settings = _read(file)
    return scene, settings


def _read(file):
    """Scene, [solve] and [simulate] of a file."""
    file = Path(file)
    tables = tables_of(file)
    if "well" in tables:
        raise SceneError(
            f"{file}: a string in a well: expected `read_well` in Python, `cosserat run` or `cosserat explain`"
        )
    if "rods" not in tables and not tables.keys().isdisjoint({"string", "operations"}):
        raise SceneError(f"{file}: [well] is missing: expected [well], [string] and [[operations]]")
    try:
        return _scene(tables, file.parent)
    except SceneError as problem:
        raise SceneError(f"{file}: {problem}") from None


def _scene(tables, folder):
    _known_keys(
        "the file",
        tables,
        {"title", "materials", "rods", "supports", "joints", "loads", "velocities", "solve", "simulate"},
    )
    materials = {
        name: _build(f"materials.{name}", table, (Material,), {})
        for name, table in _table("materials", tables.get("materials", {})).items()
    }
    rods = [_rod(f"rods[{i}]", entry, materials, folder) for i, entry in _entries("rods", tables)]
    stations = {rod.name: rod for rod in rods}
    supports = [_build(f"supports[{i}]", entry, SUPPORTS, stations) for i, entry in _entries("supports", tables)]
    loads = [_build(f"loads[{i}]", entry, action_classes(), stations, folder) for i, entry in _entries("loads", tables)]
    joints = [_build(f"joints[{i}]", entry, (Joint,), stations) for i, entry in _entries("joints", tables)]
    velocities = [
        _build(f"velocities[{i}]", entry, (InitialVelocity,), stations) for i, entry in _entries("velocities", tables)
    ]
    title = tables.get("title", "")
    if not isinstance(title, str):
        raise SceneError(f"title = {title!r}: expected a string")
    settings = [_settings(name, tables, keys) for name, keys in (("solve", SOLVE_KEYS), ("simulate", SIMULATE_KEYS))]
    if "simulate" in tables and "duration" not in settings[1]:
        raise SceneError("[simulate]: 'duration' is missing: expected how long the motion lasts (s)")
    if isinstance(settings[0].get("load_factors"), str):
        settings[0]["load_factors"] = load_factors_in(settings[0]["load_factors"])
    scene = Scene(rods, supports, loads, joints, title, velocities)
    store(scene, materials=materials)
    return scene, *settings


def load_factors_in(text):
    """The load factors of a text: "0:1" is a tuple (0.0, 1.0), "0.5,1" a list [0.5, 1.0], see `solve`.

    Raises:
        SceneError: it is neither.
    """
    separator = ":" if ":" in text else ","
    try:
        values = [float(part) for part in text.split(separator)]
    except ValueError:
        values = []
    if not values or (separator == ":" and len(values) != 2):
        raise SceneError(
            f"load factors '{text}': expected A:B (the solver chooses its steps) or A,B,... (reached exactly)"
        )
    return tuple(values) if separator == ":" else values


def action_classes():
    """The classes that [[loads]] may have: loads, and the public names of the subpackage `actions`."""
    import cosserat_fenicsx  # imports the modules of its names when they are first used

    return (*LOADS, *(getattr(cosserat_fenicsx, name) for name in cosserat_fenicsx.names_in("actions")))


def _settings(name, tables, keys):
    """A table of arguments with checked names and types."""
    settings = _table(name, tables.get(name, {}))
    _known_keys(f"[{name}]", settings, keys)
    for key, value in settings.items():
        if not isinstance(value, keys[key]) or isinstance(value, bool):
            names = " or ".join(kind.__name__ for kind in keys[key])
            raise SceneError(f"[{name}].{key} = {value!r}: expected {names}")
    return settings


def _rod(where, entry, materials, folder):
    _known_keys(where, entry, {"name", "curve", "section", "material", "damping", "eccentricity"})
    for key in ("curve", "section"):
        if key not in entry:
            raise SceneError(f"{where}: '{key}' is missing: expected a table with a type")
    material = entry.get("material")
    if isinstance(material, str):
        if material not in materials:
            raise SceneError(
                f"{where}.material = '{material}': {nearest(material, materials) or 'no [materials] given'}"
            )
        material = materials[material]
    elif material is not None:
        material = _build(f"{where}.material", material, (Material,), {})
    curve = _build(f"{where}.curve", entry["curve"], CURVES, {}, folder)
    section = _section(f"{where}.section", entry["section"])
    more = {"name": entry["name"]} if "name" in entry else {}
    if "damping" in entry:
        more["damping"] = _damping(f"{where}.damping", entry["damping"])
    if "eccentricity" in entry:
        more["eccentricity"] = _eccentricity(f"{where}.eccentricity", entry["eccentricity"])
    try:
        return Rod(curve, section, material, **more)
    except SceneError as problem:
        raise SceneError(f"{where}: {problem}") from None


def _damping(where, entry):
    """A `Damping` from its arguments, or from { ratio, frequencies }."""
    if "ratio" not in _table(where, entry):
        return _build(where, entry, (Damping,), {})
    _known_keys(f"{where} (by a ratio)", entry, {"ratio", "frequencies"})
    if "frequencies" not in entry:
        raise SceneError(f"{where}: 'frequencies' is missing: expected the two (Hz) that have this ratio")
    try:
        return Damping.ratio(**entry)
    except SceneError as problem:
        raise SceneError(f"{where}: {problem}") from None


def _eccentricity(where, entry):
    """(a1, a2), or the pieces (s_end, (a1, a2)) from an array of tables, the last with or without `to`."""
    if not isinstance(entry, list) or not any(isinstance(piece, dict) for piece in entry):
        return entry
    for i, piece in enumerate(entry):
        _known_keys(f"{where}[{i}]", _table(f"{where}[{i}]", piece), {"to", "offset"})
        for key in ("offset",) if i == len(entry) - 1 else ("to", "offset"):
            if key not in piece:
                raise SceneError(
                    f"{where}[{i}]: '{key}' is missing: expected where this piece ends, and its offset (m)"
                )
    return [(piece.get("to"), piece["offset"]) for piece in entry]


def _section(where, entry):
    """A section, or the pieces (s_end, section) from an array of sections, the last with or without `to`."""
    if not isinstance(entry, list):
        return _one_section(where, entry)
    pieces = []
    for i, piece in enumerate(entry):
        piece = dict(_table(f"{where}[{i}]", piece))
        if "to" not in piece and i < len(entry) - 1:
            raise SceneError(f"{where}[{i}]: 'to' is missing: expected the arc length (m) where this piece ends")
        pieces.append((piece.pop("to", None), _one_section(f"{where}[{i}]", piece)))
    return pieces


def _one_section(where, entry):
    """A section; a `Stiffness` with an argument that `Stiffness.offset` alone has is made by it."""
    given, offsets = dict(_table(where, entry)), {"centroid", "shear_centre", "angle", "shear_coupling"}
    if given.get("type") != "Stiffness" or given.keys().isdisjoint(offsets):
        return _build(where, entry, SECTIONS, {})
    del given["type"]
    arguments = inspect.signature(Stiffness.offset).parameters.keys() - {"others"}
    _known_keys(f"{where} (Stiffness, offset)", given, {*arguments, "mass", "inertia", "outline"})
    for name in ("shear", "axial", "bending", "torsion"):
        if name not in given:
            raise SceneError(f"{where} (Stiffness, offset): '{name}' is missing")
    try:
        return Stiffness.offset(**given)
    except SceneError as problem:
        raise SceneError(f"{where}: {problem}") from None


def _build(where, entry, classes, rods, folder=None):
    """An object from a table whose keys are the arguments of its class; file names are relative to `folder`."""
    entry = dict(_table(where, entry))
    names = {cls.__name__: cls for cls in classes}
    if "type" not in entry and len(classes) > 1:
        raise SceneError(f"{where}: 'type' is missing; known: {', '.join(names)}")
    name = entry.pop("type", classes[0].__name__)
    if not isinstance(name, str) or name not in names:
        raise SceneError(f"{where}.type = {name!r}: {nearest(name, names)}")
    kind = names[name]
    arguments = check_arguments(where, kind, entry)
    for field in dataclasses.fields(kind):
        if field.metadata.get("file") and isinstance(entry.get(field.name), str):
            entry[field.name] = folder / entry[field.name]
    for name in [name for name in arguments if name in entry]:
        if kind_of(arguments[name].annotation):
            entry[name] = look_up(f"{where}.{name}", entry[name], kind_of(arguments[name].annotation), rods)
        elif isinstance(entry[name], dict):
            entry[name] = _build(f"{where}.{name}", entry[name], (*SIGNALS, *ALONG), {}, folder)
    try:
        return kind(**entry)
    except SceneError as problem:
        raise SceneError(f"{where}: {problem}") from None
