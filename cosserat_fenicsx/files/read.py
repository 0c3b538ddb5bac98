"""Scene files, in TOML: their tables, keys and types are the argument and class names of the package.

A file holds the arguments of the class that it is read as: `RodScene`, `WellScene` or `DrillingScene`. In every file:

use = ["my_rig"]                 # optional: modules that define parts of the user's own
[materials.steel]                # optional: materials, which others refer to by their names
E = "210 GPa"

Numbers are in SI, or text with a unit (`quantities.DIMENSIONS`). Of a file the places of its keys are known.

A file of rods:

[[rods]]
name = "column"
curve = { type = "Line", start = [0, 0, 0], end = [0, 0, 20] }
section = { type = "Circle", diameter = 0.2 }
material = { E = "210 GPa", nu = 0.3 }
# a section that jumps: section = [{ to = 5.0, type = "Circle", diameter = 0.2 }, { type = "Circle", diameter = 0.1 }]
# mass off the axis: eccentricity = [0.01, 0.0], or [{ to = 5.0, offset = [0.01, 0.0] }, { offset = [0.0, 0.0] }]
# a curve from a file beside this one: curve = { type = "Spline", points = "survey.csv" }

[mesh]                            # optional, rods from the lines of a mesh beside this file: arguments of `frame_from`
file = "tower.msh"
material = "steel"
clamped = "FEET"
groups = [{ name = "LEGS", section = { type = "Circle", diameter = 0.2 } }]  # or section = {...}, of all lines

[[supports]]
type = "Clamp"
station = "column.start"          # or "column.end", or "column@5.0" for s = 5 m

[[loads]]
type = "Force"
station = "column.end"
force = [0, 0, "-100 kN"]

# in a motion: force = { type = "Triangle", value = [0, 0, 50], peak = 1.0, end = 2.0 }, or Step, Ramp, RunUp, Sine,
# Table

[[velocities]]                    # optional, initial velocities of a motion
rod = "column"
angular = [0, 0, 6.28]

[[joints]]                        # optional, between rods that touch
first = "column.end"
second = "beam.start"

[[stages]]                        # optional, after the loads above: ramped one after another, each stays
name = "wind"
loads = [{ type = "LineForce", rod = "column", force = [30, 0, 0] }]
# supports = [...], release = ["column.end", "loads[0]"], load_factors = "0:1"

[solve]                           # optional: arguments of `solve`
load_factors = [0.5, 1.0]

[simulate]                        # a motion, instead of an equilibrium path; arguments of `simulate`
duration = 10.0                   # s
tol = 1e-3                        # or dt = 0.01
start = 0.9                       # optional: begin at the equilibrium of the loads just before t = 0 at this factor
"""

import dataclasses
import json
import math
import numbers
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Annotated, Any

from cosserat_fenicsx.checks import File, refuse, store, text_of
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.new_files import replaced
from cosserat_fenicsx.parts import (
    Items,
    Object,
    Optional,
    Part,
    Reading,
    Settings,
    Time,
    arguments_of,
    made,
    misplaced,
    positive,
    schema,
    spoken,
    to_data,
    use,
)
from cosserat_fenicsx.scene.action import Action
from cosserat_fenicsx.scene.frames import Mesh
from cosserat_fenicsx.scene.rod import Rod
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.scene.sections import Material
from cosserat_fenicsx.scene.stages import Stage, load_factors_in
from cosserat_fenicsx.scene.supports import InitialVelocity, Joint, Support
from cosserat_fenicsx.storage.store import read as stored

_BLANK = re.compile(r"(?:\s|#[^\n]*)*")
_KEY = re.compile(r"""[ \t]*("(?:[^"\\\n]|\\.)*"|'[^'\n]*'|[A-Za-z0-9_-]+)[ \t]*(\.?)""")
_TEXT = re.compile(r'''"""(?:[^\\]|\\.)*?"{3,5}|\'\'\'.*?\'{3,5}|"(?:[^"\\\n]|\\.)*"|'[^'\n]*\'''', re.S)
_OTHER = re.compile(r"[^,\]}\n#]*")
_DIGITS = re.compile(r"[-+]?\d[\w.+-]*\s*$")
_QUOTED = "; text, and a number with its unit, stand in quotes"
_AT = re.compile(r" \(at line (\d+), column (\d+)\)$")


# What other files are that users take for scene files, by the ends of their names.
_OTHER_FILES = {
    ".py": "a Python program, not a scene file (.toml): expected `python3 {file}`",
    ".csv": "a table, not a scene file (.toml): expected a scene file that names it, such as "
    'points = "{file.name}" of a Spline, or survey = "{file.name}" under [well]',
}


class _GivenTwice(Exception):
    """A table or a key is defined twice; `args`: its name, and the offsets of both definitions."""


def text_and_tables(file):
    """(text, tables) of a TOML file; SceneError where it is missing, or not TOML."""
    file = Path(file)
    text = text_of(file, "a scene file in TOML", pipes=True)
    try:
        return text, tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        if words := _OTHER_FILES.get(file.suffix.lower()):
            raise SceneError(f"{file}: {words.format(file=file)}") from None
        raise SceneError(f"{file}{_refused(text, str(problem))}") from None
    except ValueError as problem:  # of a whole number of thousands of digits
        raise SceneError(f"{file}: not valid TOML: {str(problem).partition(';')[0]}") from None
    except RecursionError:
        raise SceneError(f"{file}: not valid TOML: nested too deeply") from None


def _refused(text, problem):
    """Line, column and reason of a text that `tomllib` refuses with this message."""
    if problem.startswith(("Cannot ", "Duplicate ")):
        try:
            places(text)
        except _GivenTwice as twice:
            name, offset, first = twice.args
            return f"{_at(text, offset)}: {name} is given twice, first at{_at(text, first)[1:]}: expected it once"
        except (AttributeError, IndexError, ValueError):  # the text is no TOML further down
            pass
    at, why = _AT.search(problem), _AT.sub("", problem)
    where = f", line {at[1]}, column {at[2]}" if at else ""
    if "Invalid value" in problem:
        why += _QUOTED
    elif at:  # after a number that more follows, as its unit
        line, column = text.split("\n")[int(at[1]) - 1], int(at[2]) - 1
        number, more = _DIGITS.search(line[:column]), _OTHER.match(line, column)[0].rstrip()
        why = f'expected quotes, "{number[0]}{more}"{_QUOTED}' if number and more else why
    return f"{where}: not valid TOML: {why}"


def _at(text, offset):
    """ ", line ..., column ..." of an offset."""
    line, column = _line_and_column(text, offset)
    return f", line {line}, column {column}"


def _line_and_column(text, offset):
    before = text[:offset]
    return before.count("\n") + 1, len(before) - before.rfind("\n")


def place_of(text, where):
    """(line, column), from 1, of the innermost key or item of a place that valid TOML has, see `places`; or None."""
    found = places(text)
    inner = next((where[:n] for n in range(len(where), 0, -1) if where[:n] in found), None)
    return None if inner is None else _line_and_column(text, found[inner])


def places(text):
    """{place: offset} of all keys and items of TOML, or `_GivenTwice`; a place is a tuple of keys and numbers."""
    found, counts, table, i = {}, {}, (), 0
    while (i := _BLANK.match(text, i).end()) < len(text):
        if text[i] != "[":
            i = _pair(text, i, table, found)
            continue
        begin, many = i, text.startswith("[[", i)
        keys, i = _keys(text, i + 1 + many)
        i += 1 + many
        table = ()
        for key in keys[:-1]:  # within the last table of an array
            table = (*table, key)
            table = (*table, counts[table] - 1) if table in counts else table
        table = (*table, keys[-1])
        if table in found and not (many and table in counts):
            raise _GivenTwice(f"[{'[' * many}{spoken(table)}]{']' * many}", begin, found[table])
        found.setdefault(table, begin)
        if many:
            counts[table] = counts.get(table, 0) + 1
            table = (*table, counts[table] - 1)
            found[table] = begin
    return found


def _keys(text, i):
    keys, more = [], "."
    while more:
        match = _KEY.match(text, i)
        key = match[1]
        keys.append(json.loads(key) if key[0] == '"' else key.strip("'"))
        more, i = match[2], match.end()
    return keys, i


def _pair(text, i, table, found):
    """Note a key and what its value holds; returns where it ends."""
    keys, end = _keys(text, i)
    if (*table, *keys) in found:
        raise _GivenTwice(spoken((*table, *keys)), i, found[(*table, *keys)])
    for n in range(1, len(keys) + 1):
        found.setdefault((*table, *keys[:n]), i)
    return _value(text, end + 1, (*table, *keys), found)


def _value(text, i, place, found):
    i = _BLANK.match(text, i).end()
    if text[i] not in "[{":
        return (_TEXT if text[i] in "\"'" else _OTHER).match(text, i).end()
    close, count = "]" if text[i] == "[" else "}", 0
    i = _BLANK.match(text, i + 1).end()
    while text[i] != close:
        if close == "]":
            found[(*place, count)] = i
            i = _value(text, i, (*place, count), found)
        else:
            i = _pair(text, i, place, found)
        i = _BLANK.match(text, i).end()
        if text[i] == ",":
            i, count = _BLANK.match(text, i + 1).end(), count + 1
    return i + 1


def to_toml(tables):
    """Tables of numbers, texts, lists and tables as TOML; None is left out. Lists of tables become [[arrays]], and
    tables [tables], at the top; within these they stand in line."""
    plain = {name: value for name, value in tables.items() if not _is_tables(value)}
    blocks = ["\n".join(f"{_key(name)} = {_inline(value)}" for name, value in plain.items() if value is not None)]
    for name, value in tables.items():
        for table in (value if isinstance(value, list) else [value]) if _is_tables(value) else ():
            head = f"[[{_key(name)}]]" if isinstance(value, list) else f"[{_key(name)}]"
            pairs = [f"{_key(key)} = {_inline(inner)}" for key, inner in table.items() if inner is not None]
            blocks.append("\n".join([head, *pairs]))
    return "\n\n".join(block for block in blocks if block) + "\n"


def _is_tables(value):
    return isinstance(value, dict) or (isinstance(value, list) and value and all(isinstance(x, dict) for x in value))


def _key(name):
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)


def _inline(value):
    if isinstance(value, dict):
        inner = ", ".join(f"{_key(name)} = {_inline(x)}" for name, x in value.items() if x is not None)
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, list):
        return f"[{', '.join(map(_inline, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


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
        found = RodScene
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
    """The object that `read` returns, from the tables of a file in a folder (a Path)."""
    tables = dict(tables)
    use(tables.pop("use", ()))
    materials = tables.pop("materials", {})
    if not isinstance(materials, dict):
        raise misplaced(("materials",), f"materials = {materials!r}: expected tables, [materials.name]")
    named = {name: made(Material, entry, ("materials", name)) for name, entry in materials.items()}
    cls = class_of(kind_of(tables))
    found = made(cls, tables, (), Reading(folder, {"Material": named}, partial(_tables_with, cls)))
    if named and hasattr(found, "scene"):
        store(found.scene, materials=named)
    return found


def _tables_with(cls, key):
    """Words on the tables of a file, read as a class, that have a key; "" where there is none."""
    inner = {name: kind.inner for name, (kind, _) in arguments_of(cls).items() if isinstance(kind, Optional)}
    tables = {name: kind.classes[0] for name, kind in inner.items() if isinstance(kind, Object)}
    found = [f"[{name}]" for name, table in tables.items() if key in arguments_of(table)]
    return f"which is a key of {' and '.join(found)}" if found else ""


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


@dataclass(frozen=True)
class Solve(Settings):
    """Arguments of `solve` in a scene file, see there.

    Args:
        load_factors: a number or a list, reached exactly; or "A:B", where the solver chooses its steps.
        model, formulation, tol, bound, elements, degree, control, branch: as for `solve`.
    """

    load_factors: Any = None
    model: str | None = None
    formulation: str | None = None
    tol: float | None = None
    bound: Sequence[str] | None = None
    elements: int | None = None
    degree: int | None = None
    control: str | None = None
    branch: int | None = None

    called = "solve"

    def validate(self):
        if isinstance(self.load_factors, str):
            store(self, load_factors=load_factors_in(self.load_factors))
        elif self.load_factors is not None:
            given = self.load_factors if isinstance(self.load_factors, list | tuple) else [self.load_factors]
            if any(isinstance(x, bool) or not isinstance(x, numbers.Real) for x in given):
                refuse(self, "load_factors", self.load_factors, "a number, a list of numbers, or a text such as '0:1'")
        if self.bound is not None:
            store(self, bound=list(self.bound))


@dataclass(frozen=True)
class Simulate(Settings):
    """Arguments of `simulate` in a scene file, see there.

    Args:
        duration: s. tol, dt, model, scheme, save_every, start, load_factor, elements, degree, estimate: as for
            `simulate`.
    """

    duration: Annotated[Time, positive()]
    tol: float | None = None
    dt: Time | None = None
    model: str | None = None
    scheme: str | None = None
    save_every: Time | None = None
    start: float | None = None
    load_factor: float | None = None
    elements: int | None = None
    degree: int | None = None
    estimate: bool | None = None

    called = "simulate"


@dataclass(frozen=True, eq=False)
class RodScene(Part):
    """A scene of rods and what is to be computed of it, from `read`.

    Args:
        mesh: more rods, with joints and supports, along the lines of a mesh; None for none. Loads and supports may name
            its groups of rods as a `rod`, and its sets of points as a `station`: they act on each of them.
        rods, supports, loads, joints, velocities, stages, title: those of the `Scene`.
        solve: arguments of `solve`; None for its defaults.
        simulate: arguments of `simulate`, for a motion; None for an equilibrium path.

    Attributes:
        scene: the `Scene`.

    Raises:
        SceneError: see `Scene`.
    """

    rods: Annotated[Sequence[Rod], Items(Object((Rod,)))] = ()
    supports: Sequence[Support] = ()
    loads: Sequence[Action] = ()
    joints: Sequence[Joint] = ()
    title: str = ""
    velocities: Sequence[InitialVelocity] = ()
    stages: Sequence[Stage] = ()
    solve: Solve | None = None
    simulate: Simulate | None = None
    mesh: Mesh | None = None

    def __repr__(self):
        return f"<RodScene of {self.scene!r}>"

    def validate(self):
        names = [field.name for field in dataclasses.fields(Scene)]
        given = {name: getattr(self, name) for name in names}
        if self.mesh:
            if self.stages:
                refuse(self, "stages", self.stages, "none beside a [mesh]; Frame.scene(loads, stages=...) has both")
            for rod in self.rods:
                if self.mesh.frame.places_of("rod", rod.name):
                    refuse(self, "rods", rod.name, "another name, since it is that of a group of lines of the [mesh]")
            given |= {x: self.mesh.everywhere(x, given[x], self.rods) for x in ("supports", "loads", "velocities")}
            for name in ("rods", "joints", "supports"):
                given[name] = [*given[name], *getattr(self.mesh.frame, name)]  # messages count those of the file
        store(self, scene=Scene(**given))

    @property
    def settings(self) -> dict[str, Any]:
        """Arguments of `solve`."""
        return self.solve.given() if self.solve else {}

    @property
    def motion(self) -> dict[str, Any]:
        """Arguments of `simulate`; empty where the file asks for no motion."""
        return self.simulate.given() if self.simulate else {}

    def run(self, **changed):
        """The motion by `simulate` where the file has a duration, else the equilibrium path by `solve`.

        Args:
            changed: arguments other than in the file.

        Returns:
            A `History` or a `Path`.

        Raises:
            SceneError, NotConverged: see `simulate` and `solve`.
        """
        if self.simulate or "duration" in changed:
            from cosserat_fenicsx.dynamics.simulate import simulate

            return simulate(self.scene, **{**self.motion, **changed})
        from cosserat_fenicsx.statics.solve import solve

        return solve(self.scene, **{**self.settings, **changed})
