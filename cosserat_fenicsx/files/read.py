"""Scene files, in TOML: their tables, keys and types are the argument and class names of the package.

A file holds the arguments of the class that it is read as: `RodScene`, `WellScene` or `DrillingScene`. In every file:

use = ["my_rig"]                 # optional: modules that define parts of the user's own
[materials.steel]                # optional: materials, which others refer to by their names
E = "210 GPa"

Numbers are in SI, or text with a unit (`dimensions`).
"""

from os import PathLike
from pathlib import Path
from typing import Any

from cosserat_fenicsx.checks import File, refuse, store
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.files.toml import place_of, text_and_tables, to_toml
from cosserat_fenicsx.new_files import replaced
from cosserat_fenicsx.parts import Part, Reading, made, misplaced, schema, to_data, use
from cosserat_fenicsx.scene.sections import Material
from cosserat_fenicsx.storage.store import read as stored

#: The kinds of scene files.
KINDS = ("rods", "well", "drilling")
# Tables that a drill-string in motion has, and a string in a well has not.
_OF_DRILLING = {"drive", "bit", "hook", "wall_friction", "drag", "simulate", "stability", "discs"}


def class_of(kind: str) -> type:
    """The class of the scene files of a kind, `KINDS`; those of the others are not imported, which takes a while."""
    if kind == "drilling":
        from cosserat_fenicsx.drilling.scenefile import DrillingScene as found
    elif kind == "well":
        from cosserat_fenicsx.well.scenefile import WellScene as found
    else:
        from cosserat_fenicsx.files.rods import RodScene as found
    return found


def kind_of(tables) -> str:
    """The kind of a file by its tables, also where one of them is missing or misspelt: one of `KINDS`."""
    if "drive" in tables or ({"string", "well", "discs"} & tables.keys() and _OF_DRILLING & tables.keys()):
        return "drilling"
    return "well" if "rods" not in tables and {"well", "string", "operations"} & tables.keys() else "rods"


def read(file: File, scene: Any = None) -> Any:
    """What a scene file describes (rods, a string in a well, a drill-string in motion), or what a folder holds so far.

    Args:
        file: path of a TOML file, see the head of this module; or the `folder` of `simulate` or
            `depth_sweep`, which another process may still be writing to.
        scene: of a folder whose scene cannot be stored as data, see `resume`; else None.

    Returns:
        Of a file a `RodScene`, a `WellScene` or a `DrillingScene`; `run()` computes what the file asks for. Of a folder
        a `History`, a `DrillingHistory` or a `DepthSweep`.

    Raises:
        SceneError: the file is missing or not TOML, a key, a type or a unit is unknown (named, with the nearest known
            one), or a value is refused; the message gives line and column. Of a folder: nothing that was stored is
            there, it is of another scene, or damaged.
    """
    if isinstance(file, str | PathLike) and Path(file).is_dir():
        return stored(file, scene)
    if scene is not None:
        refuse("read", "scene", scene, f"None, since {file} is no folder")
    return read_with_tables(file)[0]


def read_with_tables(file):
    """(what `read` returns, the tables of the file); errors as there."""
    text, tables = text_and_tables(file)
    try:
        return from_tables(tables, Path(file).parent), tables
    except SceneError as problem:
        place = place_of(text, problem.where) if problem.where else None
        at = f", line {place[0]}, column {place[1]}" if place else ""
        raise SceneError(f"{file}{at}: {problem}") from None


def from_tables(tables, folder):
    """What `read` returns, from the tables of a file in a folder, a Path."""
    tables = dict(tables)
    use(tables.pop("use", ()))
    materials = tables.pop("materials", {})
    if not isinstance(materials, dict):
        raise misplaced(("materials",), f"materials = {materials!r}: expected tables, [materials.name]")
    named = {name: made(Material, entry, ("materials", name)) for name, entry in materials.items()}
    found = made(class_of(kind_of(tables)), tables, (), Reading(folder, {"Material": named}))
    if named and hasattr(found, "scene"):
        store(found.scene, materials=named)
    return found


def write(scene: Part, file: File) -> None:
    """Write a scene as a scene file, which `read` reads back as an equal one.

    Args:
        scene: a `RodScene`, a `WellScene`, a `DrillingScene`, or a `Scene`.
        file: path of the file, which is replaced.

    Raises:
        NotData: a function written in Python, or a class that is known by no name.
    """
    text = to_toml(to_data(scene, whole=False))
    with replaced(file, each_process=True) as fresh:
        fresh.write_text(text, encoding="utf-8")


def schema_of_files() -> dict:
    """The JSON Schema of scene files, which editors complete and check them with."""
    definitions, found = {}, []
    material = {"type": "object", "additionalProperties": {"$ref": "#/$defs/Material"}}
    for kind in KINDS:
        one = schema(class_of(kind))
        definitions |= one.pop("$defs")
        one.pop("$schema")
        one["properties"] |= {"use": {"type": "array", "items": {"type": "string"}}, "materials": material}
        found.append(one)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Scene files of cosserat_fenicsx",
        "anyOf": found,
        "$defs": definitions,
    }
