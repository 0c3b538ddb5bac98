"""Kinds of fields: what a field of a part takes, how it is checked, read from data and written, and its JSON Schema.

See `parts`, which this module serves: annotations become kinds by `kind_of`.
"""

import contextlib
import dataclasses
import functools
import importlib
import inspect
import math
import numbers
import pkgutil
import re
import types
import typing
from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from cosserat_fenicsx import checks
from cosserat_fenicsx.checks import instance, refuse
from cosserat_fenicsx.quantities import DIMENSIONS, LARGEST, in_si
from cosserat_fenicsx.errors import SceneError, nearest

#: {what its members are: class} of all families.
FAMILIES = {}


class NotData(Exception):
    """A part of a scene has no form as data; its text names the place and says why."""

    def __init__(self, why, where=()):
        super().__init__(why, where)
        self.why, self.where = why, where

    def __str__(self):
        return f"{spoken(self.where)}: {self.why}" if self.where else self.why

    def inside(self, key):
        """The same within an outer place."""
        return NotData(self.why, (key, *self.where))


def members(family):
    """{name: class} of a family, in the order of definition, classes of the package first."""
    _import(family._homes)
    return {name: cls for name, cls in family._members.items() if dataclasses.is_dataclass(cls)}


def member(family, name):
    """The class of a name in a family, or None; imports what may define it where it is not known yet."""
    if not isinstance(name, str):
        return None
    if name in family._twice:
        raise SceneError(f"type = '{name}': several classes have this name: expected a unique name")
    found = family._members.get(name)
    return found if dataclasses.is_dataclass(found) else members(family).get(name)


@functools.cache
def _import(homes):
    for home in homes:
        module = importlib.import_module(home)
        for found in pkgutil.iter_modules(getattr(module, "__path__", ())):
            importlib.import_module(f"{home}.{found.name}")


def is_family(cls):
    """Whether a class is a family itself."""
    return isinstance(cls, type) and getattr(cls, "_family", None) is cls


@functools.cache
def arguments_of(make):
    """{name: (`Kind`, whether it must be given)} of a constructor: a dataclass, or a method that makes one."""
    hints = _hints(make) | (_hints(make.__init__) if isinstance(make, type) else {})
    taken = inspect.signature(make).parameters.values()
    found = {x.name: (kind_of(hints.get(x.name)), x.default is x.empty) for x in taken if x.kind is not x.VAR_KEYWORD}
    if len(found) < len(taken):  # a method that hands other arguments on to its class
        found = {name: (kind, False) for name, (kind, _) in arguments_of(make.__self__).items()} | found
    return found


@functools.cache
def fields_of(cls):
    """{name: `Kind`} of the arguments of a dataclass."""
    hints = _hints(cls)
    return {field.name: kind_of(hints.get(field.name)) for field in dataclasses.fields(cls) if field.init}


def _hints(made):
    try:
        return typing.get_type_hints(made, include_extras=True)
    except NameError:  # annotations as text, of a class inside a function
        return {}


def spoken(where):
    """A place in a file, a tuple of keys and numbers, as text: "loads[1].force"."""
    words = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in where)
    return words.removeprefix(".")


def misplaced(where, message):
    """A `SceneError` on what stands at a place of a file, a tuple of keys and numbers."""
    problem = SceneError(message)
    problem.where = where
    return problem


@contextlib.contextmanager
def concerning(*where):
    """A `SceneError` from inside is about this place of a file, unless it has one of its own."""
    try:
        yield
    except SceneError as problem:
        problem.where = problem.where or where
        raise


# How messages begin: the name of a class or a part; a field, "Scene.loads[0]", "Scene: loads[0]", "simulate: depth = ".
_BEGINS = re.compile(r"(\w[\w -]*?)(?:\.(\w+)|: (\w+)(?= =|\[)|:)(?:\[(\d+)\])?")


def _concerned(message, given):
    """The place in a file that a message on a whole scene is about, by its beginning and the arguments; or None."""
    found = _BEGINS.match(message)
    owner, *fields, number = found.groups() if found else ("", None, None, None)
    field = fields[0] or fields[1]
    for name, value in given.items():
        items = enumerate(value) if isinstance(value, list | tuple) else [(None, value)]
        for i, item in items:
            if owner == name or owner in _names_in(item):
                return tuple(x for x in (name, i, field) if x is not None)
    known = next((name for name in given if field and f"_{name}".endswith(f"_{field}")), None)
    return None if known is None else (known, *([int(number)] if number else []))


def _names_in(part):
    """The names of a part and of all parts in it, as messages have them."""
    if isinstance(part, list | tuple):
        return {name for item in part for name in _names_in(item)}
    if not hasattr(part, "arguments"):
        return set()
    return {checks.name_of(part), getattr(part, "name", "")} | _names_in(list(part.arguments().values()))


@dataclasses.dataclass(frozen=True)
class Reading:
    """Where data are read from: the folder of the scene file, to which names of files are relative (None for stored
    data), {name of a class: {name: object}} of objects that data may refer to by their names, and a function that says
    of an unknown key where else it may stand."""

    folder: Path | None = None
    named: dict = dataclasses.field(default_factory=dict)
    elsewhere: Callable[[str], str] = lambda key: ""


@dataclasses.dataclass
class Writing:
    """How data are written: `whole`, with defaults too; `modules`: where classes of users are defined."""

    whole: bool = True
    modules: set = dataclasses.field(default_factory=set)


def made(make, data, where=(), reading=Reading()):
    """An object from a table of the arguments of a constructor, or a SceneError with its place `where`: no table, an
    unknown or a missing key, or a value that is refused."""
    if not isinstance(data, dict):
        raise misplaced(where, f"{spoken(where)} = {data!r}: expected a table")
    name = make.__name__
    if hasattr(make, "constructors"):
        make = make.constructor(data.keys())
    known, at = arguments_of(make), ""
    if where:
        at = f"[{spoken(where)}]" if getattr(make, "called", "") else f"{spoken(where)} ({name})"
    _check_keys(data, known, [key for key, (_, needed) in known.items() if needed], at, where, reading)
    given = {key: known[key][0].read((*where, key), value, reading) for key, value in data.items()}
    try:
        return make(**given)
    except SceneError as problem:
        if not where:
            problem.where = problem.where or _concerned(str(problem), given)
            raise
        at = "" if str(problem).startswith(f"{spoken(where)}.") else f"{spoken(where)}: "
        field = re.match(r"\w+\.(\w+)", str(problem))  # 'Owner.field = value: ...'
        raise misplaced((*where, field[1]) if field and field[1] in data else where, f"{at}{problem}") from None


def _check_keys(data, known, needed, at, where=None, reading=Reading()):
    """Refuse unknown and missing keys of a table, which messages call `at`, "" for the file."""
    for key in data:
        if key not in known:
            place = None if where is None else (*where, key)
            hint = f"'{key}', {reading.elsewhere(key) or nearest(key, known)}"
            raise misplaced(place, f"{at or 'the file'}: unknown key {hint}")
    for key in needed:
        if key not in data:
            raise misplaced(where, f"{at}: '{key}' is missing" if at else f"[{key}] is missing")


def table_schema(cls, definitions):
    """The JSON Schema of tables of a class; definitions of the classes in them are added to `definitions`."""
    makes = cls.constructors() if hasattr(cls, "constructors") else (cls,)
    known, needed = {}, []
    for make in makes:
        for name, (kind, must) in arguments_of(make).items():
            known.setdefault(name, kind.schema(definitions))
            needed += [name] if must and len(makes) == 1 else []
    told = (cls.__doc__ or "").strip().partition("\n")[0]
    return {"type": "object", "description": told, "properties": known, "required": needed,
            "additionalProperties": False}  # fmt: skip


def _plain(value, writing):
    """A value as data, whatever it is."""
    if hasattr(value, "as_data"):
        return _plain(value.as_data(), writing)
    if value is None or isinstance(value, str | bool | int | float):
        return value
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple | dict):
        parts = [_plain(x, writing) for x in (value.values() if isinstance(value, dict) else value)]
        return dict(zip(value, parts, strict=True)) if isinstance(value, dict) else parts
    if hasattr(value, "arguments"):
        return Object((value._family or type(value),)).write(value, writing)
    what = "a function written in Python" if callable(value) else f"a part of the class {type(value).__name__}"
    raise NotData(f"{what} cannot be stored as data")


@dataclasses.dataclass(frozen=True)
class Kind:
    """The values that a field accepts; this kind accepts any."""

    def check(self, owner, field, value):
        """The value in its normal form; refused where it does not fit: 'Owner.field = value: expected ...'."""
        return value

    def read(self, where, data, reading):
        """The argument of the constructor, from data at a place of a file, see `made`."""
        return data

    def write(self, value, writing):
        """A value as data, see `to_data`."""
        return _plain(value, writing)

    def schema(self, definitions):
        """The JSON Schema of its data; `definitions`: of classes, to which it adds."""
        return {}

    def told(self, value, units):
        """A value as text, in some `Units`."""
        return value.in_words(units) if hasattr(value, "arguments") else f"{value}"

    @property
    def words(self):
        """A description of the expected values."""
        return "any value"


@dataclasses.dataclass(frozen=True)
class Limits:
    """The range of a number.

    Attributes:
        low, high: smallest and largest value. above: whether `low` itself is refused. infinite: whether infinity is
            allowed. what: in messages, such as "a coefficient of friction".
    """

    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    infinite: bool = False
    what: str = ""

    def admit(self, value):
        """Whether a number that is not NaN lies in the range."""
        low = value > self.low if self.above else value >= self.low
        return low and value <= self.high and (self.infinite or math.isfinite(value))

    def words(self, unit):
        """The expected range, with the unit."""
        what, unit = self.what or "a number", f" ({unit})" if unit else ""
        if self.high < math.inf:
            low = f"above {self.low:g} and up to" if self.above else f"from {self.low:g} to"
            return f"{what} {low} {self.high:g}{unit}"
        if self.low == -math.inf:
            return f"{self.what or 'a finite number'}{unit}"
        infinite = " or infinity" if self.infinite else ""
        if self.low == 0 and self.above:
            return f"{self.what}{unit}, positive{infinite}" if self.what else f"a positive number{infinite}{unit}"
        return f"{what}{unit}, not negative{infinite}" if self.low == 0 else f"{what} from {self.low:g}{infinite}{unit}"


def between(low, high, what=""):
    """Limits of numbers from `low` to `high`; `what`: see `Limits`."""
    return Limits(low, high, what=what)


@dataclasses.dataclass(frozen=True)
class Number(Kind):
    """A number of a dimension (see `quantities.DIMENSIONS`), None for none; text with a unit is converted."""

    dimension: str | None = None
    limits: Limits = Limits()
    whole: bool = False

    @property
    def unit(self):
        """The SI unit, "" for none."""
        return DIMENSIONS[self.dimension].si if self.dimension else ""

    @property
    def words(self):
        limits = self.limits
        if self.whole and not limits.what:
            limits = dataclasses.replace(limits, what="a whole number")
        return limits.words(self.unit)

    def check(self, owner, field, value):
        if type(value) is float and 1 / LARGEST < abs(value) < 1e5 and not self.whole and self.limits.admit(value):
            return value  # as most are; the whole check takes longer
        above_zero = self.limits.above and self.limits.low == 0
        admitted = (lambda x: self.limits.admit(x) and x == int(x)) if self.whole else self.limits.admit
        found = checks.number(owner, field, value, self.words, admitted, above_zero, self.dimension)
        return int(found) if self.whole else found

    def told(self, value, units):
        return units.told(value, self.unit, self.dimension) if self.dimension else f"{value:g}"

    def schema(self, definitions):
        low, high = self.limits.low, self.limits.high
        bounds = {"exclusiveMinimum" if self.limits.above else "minimum": low} if low > -math.inf else {}
        bounds |= {"maximum": high} if high < math.inf else {}
        dimension = self.dimension or ("angle" if "(degrees)" in self.words else None)
        if not dimension:
            return {"type": "integer" if self.whole else "number", **bounds}
        names = ", ".join(DIMENSIONS[dimension].units)
        text = {"type": "string", "pattern": r"^\s*[-+]?[0-9.]", "description": f"a number with a unit: {names}"}
        return {"description": self.words, "anyOf": [{"type": "number", **bounds}, text]}


@dataclasses.dataclass(frozen=True)
class Several(Kind):
    """A tuple of `size` finite numbers of a dimension, or, without one, of the unit in `unit`."""

    dimension: str | None = None
    size: int = 3
    unit: str = ""

    @property
    def words(self):
        unit = self.unit or Number(self.dimension).unit
        return f"{self.size} finite numbers" + (f" ({unit})" if unit else "")

    def check(self, owner, field, value):
        if self.dimension and isinstance(value, list | tuple) and any(isinstance(x, str) for x in value):
            value = [in_si(f"{checks.name_of(owner)}.{field}[{i}]", x, self.dimension) for i, x in enumerate(value)]
        return checks.vector(owner, field, value, self.unit or Number(self.dimension).unit or "number", self.size)

    def schema(self, definitions):
        item = Number(self.dimension).schema(definitions)
        return {"type": "array", "items": item, "minItems": self.size, "maxItems": self.size}


class _Instance(Kind):
    """An object of a class of Python: its `class_`, and the `json` type of its data."""

    class_, json = object, ""

    def check(self, owner, field, value):
        return instance(owner, field, value, self.class_, self.words)

    def schema(self, definitions):
        return {"type": self.json}


class Text(_Instance):
    """A text."""

    words, class_, json = "a text", str, "string"


class Flag(_Instance):
    """True or False."""

    words, class_, json = "True or False", bool, "boolean"


class FileName(_Instance):
    """The name of a file; in a scene file, beside it. Where others than names are allowed, these stay as they are."""

    words, class_, json = "the name of a file", str | PathLike, ("string", "array")

    def read(self, where, data, reading):
        return reading.folder / data if reading.folder is not None and isinstance(data, str) else data


@dataclasses.dataclass(frozen=True)
class Choice(Kind):
    """One of some values."""

    values: tuple = ()

    @property
    def words(self):
        return " or ".join(map(repr, self.values))

    def check(self, owner, field, value):
        if not isinstance(value, type(self.values[0])) or value not in self.values:
            refuse(owner, field, value, self.words)
        return value

    def schema(self, definitions):
        return {"enum": list(self.values)}


@dataclasses.dataclass(frozen=True)
class Object(Kind):
    """An object of one of some classes, or of the members of a family."""

    classes: tuple = ()

    def known(self):
        """{name: class} of the classes that are allowed."""
        found = {}
        for cls in self.classes:
            found |= members(cls) if is_family(cls) else {cls.__name__: cls}
        return found

    @property
    def words(self):
        known = [f"{name}(...)" for name in self.known()]
        *first, last = known or [f"a {cls._of}" if is_family(cls) else "an object" for cls in self.classes[:1]]
        return f"{', '.join(first)} or {last}" if first else last

    def check(self, owner, field, value):
        return value if isinstance(value, self.classes) else instance(owner, field, value, self.classes, self.words)

    @property
    def _typed(self):
        """Whether data say the class."""
        return len(self.classes) > 1 or is_family(self.classes[0])

    @property
    def _usual(self):
        """The class of data that do not say it, or None: the only one, or one that is named beside its family."""
        first, *others = self.classes
        return first if not is_family(first) and all(map(is_family, others)) else None

    def _find(self, name):
        for cls in self.classes:
            found = member(cls, name) if is_family(cls) else cls
            if found is not None and found.__name__ == name:
                return found
        return None

    def read(self, where, data, reading):
        """See `Kind`: a table; the name of an object; or the name of a class, for an object without arguments."""
        if isinstance(data, self.classes):
            return data
        if isinstance(data, str):
            for cls in self.classes:
                if cls.__name__ in reading.named:
                    named = reading.named[cls.__name__]
                    if data not in named:
                        words = nearest(data, named) if named else f"no [{cls.__name__.lower()}s] given"
                        raise misplaced(where, f"{spoken(where)} = {data!r}: {words}")
                    return named[data]
            data = {"type": data}
        if not isinstance(data, dict):
            raise misplaced(where, f"{spoken(where)} = {data!r}: expected a table")
        if self._usual and "type" not in data:
            return made(self._usual, data, where, reading)
        data = dict(data)
        if "type" not in data:
            raise misplaced(where, f"{spoken(where)}: 'type' is missing; known: {', '.join(self.known())}")
        name = data.pop("type")
        cls = self._find(name)
        if cls is None:
            raise misplaced((*where, "type"), f"{spoken(where)}.type = {name!r}: {nearest(name, self.known())}")
        return made(cls, data, where, reading)

    def write(self, value, writing):
        cls = type(value)
        twice = any(cls.__name__ in getattr(known, "_twice", ()) for known in self.classes)
        if twice or not isinstance(value, self.classes) or self._find(cls.__name__) is not cls:
            if hasattr(value, "arguments"):
                raise NotData(f"a part of the class {cls.__name__} cannot be stored as data")
            return super().write(value, writing)
        if not cls.__module__.startswith("cosserat_fenicsx."):
            writing.modules.add(cls.__module__)
        data, defaults = {"type": cls.__name__} if self._typed else {}, inspect.signature(cls).parameters
        known, name = arguments_of(cls), ""
        try:
            for name, given in value.arguments().items():
                default = defaults[name].default
                same = given is default or given is None or (type(given) is type(default) and given == default)
                if writing.whole or not same:
                    data[name] = known[name][0].write(given, writing)
        except NotData as problem:
            raise problem.inside(name) from None
        return data

    def schema(self, definitions):
        found, named = [], any(cls.__name__ == "Material" for cls in self.classes)
        for name, cls in self.known().items():
            if name not in definitions:
                definitions[name] = {}  # refers to itself
                definitions[name] |= table_schema(cls, definitions)
                definitions[name]["properties"] |= {"type": {"const": name}}
            reference = {"$ref": f"#/$defs/{name}"}
            said = self._typed and cls is not self._usual
            found.append({"allOf": [reference], "required": ["type"]} if said else reference)
            if self._typed and not any(needed for _, needed in arguments_of(cls).values()):
                found.append({"const": name})
        if named:
            found.append({"type": "string", "description": "the name of one in the table of that class"})
        return found[0] if len(found) == 1 else {"anyOf": found or [{"type": "object"}]}


@dataclasses.dataclass(frozen=True)
class Optional(Kind):
    """None, or what another kind takes."""

    inner: Kind = Kind()

    @property
    def words(self):
        return f"{self.inner.words}, or None"

    def check(self, owner, field, value):
        return None if value is None else self.inner.check(owner, field, value)

    def read(self, where, data, reading):
        return None if data is None else self.inner.read(where, data, reading)

    def write(self, value, writing):
        return None if value is None else self.inner.write(value, writing)

    def told(self, value, units):
        return self.inner.told(value, units)

    def schema(self, definitions):
        return self.inner.schema(definitions)


@dataclasses.dataclass(frozen=True)
class Either(Kind):
    """Values of another kind, or objects of some classes, such as functions of time."""

    inner: Kind = Kind()
    classes: tuple = ()
    functions: bool = False

    @property
    def objects(self):
        """The kind of the objects."""
        return Object((FAMILIES["function of time"],) * self.functions + self.classes)

    @property
    def words(self):
        if self.functions:
            return f"{self.inner.words}, or a function of time that gives one"
        return f"{self.inner.words}, or {self.objects.words}"

    def check(self, owner, field, value):
        if callable(value) or isinstance(value, self.objects.classes):
            scaled = getattr(value, "in_units", None)
            return value if scaled is None else scaled(lambda x: self.inner.check(owner, field, x))
        if not isinstance(value, numbers.Real | str | list | tuple | np.ndarray):
            refuse(owner, field, value, self.words)
        return self.inner.check(owner, field, value)

    def read(self, where, data, reading):
        return (self.objects if isinstance(data, dict) else self.inner).read(where, data, reading)

    def write(self, value, writing):
        return (self.objects if isinstance(value, self.objects.classes) else self.inner).write(value, writing)

    def schema(self, definitions):
        return {"anyOf": [self.inner.schema(definitions), self.objects.schema(definitions)]}


@dataclasses.dataclass(frozen=True)
class Items(Kind):
    """A tuple of what another kind takes."""

    inner: Kind = Kind()

    @property
    def words(self):
        return f"a list, each {self.inner.words}"

    def check(self, owner, field, value):
        instance(owner, field, value, list | tuple | np.ndarray, self.words)
        return tuple(self.inner.check(owner, f"{field}[{i}]", x) for i, x in enumerate(value))

    def read(self, where, data, reading):
        if isinstance(data, dict) and isinstance(self.inner, Object):
            raise misplaced(where, f"{spoken(where)} = {data!r}: expected an array of tables, [[{spoken(where)}]]")
        if not isinstance(data, list):
            return data  # refused by the constructor
        return [self.inner.read((*where, i), x, reading) for i, x in enumerate(data)]

    def write(self, value, writing):
        found = []
        try:
            for x in value:
                found.append(self.inner.write(x, writing))
        except NotData as problem:
            raise problem.inside(len(found)) from None
        return found

    def schema(self, definitions):
        return {"type": "array", "items": self.inner.schema(definitions)}


_SPACED = ("from", "to", "count")


@dataclasses.dataclass(frozen=True)
class Values(Items):
    """A list of numbers; or `count` equally spaced ones in a table of "from", "to" and "count"."""

    def check(self, owner, field, value):
        if isinstance(value, dict):
            _check_keys(value, _SPACED, _SPACED, f"{checks.name_of(owner)}.{field}")
            low, high = (self.inner.check(owner, f"{field}.{key}", value[key]) for key in ("from", "to"))
            count = Number(limits=between(2, 10_000, "how many"), whole=True)
            value = np.linspace(low, high, count.check(owner, f"{field}.count", value["count"])).tolist()
        if not isinstance(value, list | tuple | np.ndarray) or not len(value):
            refuse(owner, field, value, self.words)
        return super().check(owner, field, value)

    @property
    def words(self):
        return f"a list, each {self.inner.words}, or {{ from = ..., to = ..., count = ... }}"

    def schema(self, definitions):
        ends = self.inner.schema(definitions)
        known = {"from": ends, "to": ends, "count": {"type": "integer", "minimum": 2}}
        table = {"type": "object", "properties": known, "required": list(known), "additionalProperties": False}
        return {"anyOf": [super().schema(definitions), table]}


_PLAIN = {float: Number(), int: Number(whole=True), str: Text(), bool: Flag()}


def kind_of(annotation):
    """The `Kind` of an annotation, see the head of the module; one that takes anything where it says nothing."""
    origin, given = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is Annotated:
        kind = next((x for x in given[1:] if isinstance(x, Kind)), None) or kind_of(given[0])
        limits = [x for x in given[1:] if isinstance(x, Limits)]
        return _limited(kind, limits[-1]) if limits else kind
    if origin in (typing.Union, types.UnionType):
        return _union(given)
    if origin is Literal:
        return Choice(given)
    if (origin is tuple and given[-1] is ...) or origin in (list, Sequence):
        return Items(kind_of(given[0]))
    if annotation in _PLAIN:
        return _PLAIN[annotation]
    if hasattr(annotation, "by_name"):
        return annotation.by_name
    if dataclasses.is_dataclass(annotation) or is_family(annotation):
        return Object((annotation,))
    return Kind()


def _union(given):
    others = [x for x in given if x is not type(None)]
    functions = [x for x in others if typing.get_origin(x) is Callable]
    kinds = [kind_of(x) for x in others if x not in functions]
    classes = tuple(cls for kind in kinds if isinstance(kind, Object) for cls in kind.classes)
    plain = [kind for kind in kinds if not isinstance(kind, Object)]
    found = plain[0] if len(plain) == 1 else Kind()
    if plain and (functions or classes):
        found = Either(found, classes, bool(functions))
    elif classes:
        found = Object(classes)
    return Optional(found) if len(others) < len(given) else found


def _limited(kind, limits):
    """A kind with other limits of its numbers."""
    if isinstance(kind, Number):
        return dataclasses.replace(kind, limits=limits)
    return dataclasses.replace(kind, inner=_limited(kind.inner, limits))
