"""Parts of scenes: classes that say of each field what it takes, and register themselves.

A part is a frozen dataclass derived from `Part`. What its fields take follows from their annotations:

    float, int, str, bool             a finite number without unit, a whole number, a text, true or false
    Length, Torque, ...               numbers with a unit; text such as "20 klbf" or "8 1/2 in" is accepted everywhere
    Annotated[Torque, at_least(0)]    the same in another range
    Vector                            three finite numbers; `Annotated[Numbers, Several("length", 2)]` two lengths
    InTime[AngularVelocity]           also a function of time (s)
    Literal["rest", "steady"]         one of these
    tuple[X, ...], X | None           several of these, or None
    a class, or a union of classes    an object of it; of a family: of any of its members

The constructor checks and normalises the fields; then `validate` may check what concerns several of them. `reading`
(see `codec`) makes parts from scene files and from stored data with the same annotations.

A family is a class that others are derived from, `class BitLaw(Part, family="bit law")`. Every dataclass derived from
it is a member under its own name, in scene files, in stored data and in the reference, from the moment it is defined.
"""

import dataclasses
import functools
import importlib
import math
import numbers
import pkgutil
import types
import typing
from collections.abc import Callable, Sequence
from os import PathLike
from typing import Annotated, Any, Literal, TypeVar

import numpy as np

from cosserat_fenicsx import checks
from cosserat_fenicsx.checks import Numbers, instance, refuse, store
from cosserat_fenicsx.dimensions import DIMENSIONS, LARGEST, in_si


class Part:
    """Base of the parts of scenes, see the head of the module.

    Class arguments:
        family: what the members of a new family are, in words, such as "bit law".
        homes: modules and packages beside that of the class whose members are imported before the family is listed.
    """

    _family: typing.ClassVar[Any] = None

    def __init_subclass__(cls, family="", homes=(), **more):
        super().__init_subclass__(**more)
        if family:
            cls._family, cls._of, cls._homes, cls._members = cls, family, (cls.__module__, *homes), {}
        elif cls._family is not None and not cls.__name__.startswith("_") and "<locals>" not in cls.__qualname__:
            known = cls._family._members.get(cls.__name__)
            if known is not None and (known.__module__, known.__qualname__) != (cls.__module__, cls.__qualname__):
                raise TypeError(
                    f"class {cls.__name__}: {known.__module__} has a {cls._of} of this name: expected another name"
                )
            cls._family._members[cls.__name__] = cls

    def __post_init__(self):
        for name, kind in fields_of(type(self)).items():
            store(self, **{name: kind.check(self, name, getattr(self, name))})
        self.validate()

    def validate(self):
        """Refuse values that do not fit each other; the fields themselves are checked and normalised already."""


def members(family):
    """{name: class} of a family, in the order of definition, those of the package first."""
    _import(family._homes)
    return {name: cls for name, cls in family._members.items() if dataclasses.is_dataclass(cls)}


@functools.cache
def _import(homes):
    for home in homes:
        module = importlib.import_module(home)
        for found in pkgutil.iter_modules(getattr(module, "__path__", ())):
            importlib.import_module(f"{home}.{found.name}")


def is_family(cls):
    """Whether a class is a family itself."""
    return isinstance(cls, type) and issubclass(cls, Part) and cls is cls._family


@functools.cache
def fields_of(cls):
    """{name: `Kind`} of the arguments of a dataclass."""
    hints = _hints(cls)
    return {field.name: kind_of(hints.get(field.name)) for field in dataclasses.fields(cls) if field.init}


def _hints(cls):
    try:
        return typing.get_type_hints(cls, include_extras=True)
    except NameError:  # annotations as text, of a class inside a function
        return {}


@dataclasses.dataclass(frozen=True)
class Kind:
    """What a field takes; this one takes anything."""

    def check(self, owner, field, value):
        """The value in its normal form; refused where it does not fit: 'Owner.field = value: expected ...'."""
        return value

    @property
    def words(self):
        """What is expected."""
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
        """What is expected, with the unit."""
        what, unit = self.what or "a number", f" ({unit})" if unit else ""
        if self.high < math.inf:
            return f"{what} from {self.low:g} to {self.high:g}{unit}"
        if self.low == -math.inf:
            return f"{self.what or 'a finite number'}{unit}"
        infinite = " or infinity" if self.infinite else ""
        if self.low == 0 and self.above:
            return f"{self.what}{unit}, positive{infinite}" if self.what else f"a positive number{infinite}{unit}"
        return f"{what}{unit}, not negative{infinite}" if self.low == 0 else f"{what} from {self.low:g}{infinite}{unit}"


def positive(what="", *, infinite=False):
    """Limits of numbers above zero, also of infinity where it is allowed; `what`: see `Limits`."""
    return Limits(0.0, above=True, infinite=infinite, what=what)


def at_least(low, what=""):
    """Limits of numbers from `low`; `what`: see `Limits`."""
    return Limits(low, what=what)


def between(low, high, what=""):
    """Limits of numbers from `low` to `high`; `what`: see `Limits`."""
    return Limits(low, high, what=what)


@dataclasses.dataclass(frozen=True)
class Number(Kind):
    """A number of a dimension (see `dimensions`), None for none; text with a unit is converted."""

    dimension: str | None = None
    limits: Limits = Limits()
    whole: bool = False

    @property
    def unit(self):
        """The SI unit, "" for none."""
        return DIMENSIONS[self.dimension].si if self.dimension else ""

    @property
    def words(self):
        """See `Kind`."""
        limits = self.limits
        if self.whole and not limits.what:
            limits = dataclasses.replace(limits, what="a whole number")
        return limits.words(self.unit)

    def check(self, owner, field, value):
        """See `Kind`."""
        if self.dimension and isinstance(value, str):
            value = in_si(f"{_name(owner)}.{field}", value, self.dimension)
        whole = (lambda x: x == int(x)) if self.whole else (lambda x: True)
        found = checks.number(owner, field, value, self.words, lambda x: self.limits.admit(x) and whole(x))
        if self.limits.above and self.limits.low == 0 and found < 1 / LARGEST:
            refuse(owner, field, value, f"{self.words} from {1 / LARGEST:g} to {LARGEST:g}")
        return int(found) if self.whole else found


@dataclasses.dataclass(frozen=True)
class Several(Kind):
    """A tuple of `size` finite numbers of a dimension, or, without one, of the unit in `unit`."""

    dimension: str | None = None
    size: int = 3
    unit: str = ""

    @property
    def words(self):
        """See `Kind`."""
        unit = self.unit or Number(self.dimension).unit
        return f"{self.size} finite numbers" + (f" ({unit})" if unit else "")

    def check(self, owner, field, value):
        """See `Kind`."""
        if self.dimension and isinstance(value, list | tuple) and any(isinstance(x, str) for x in value):
            value = [in_si(f"{_name(owner)}.{field}[{i}]", x, self.dimension) for i, x in enumerate(value)]
        return checks.vector(owner, field, value, self.unit or Number(self.dimension).unit or "number", self.size)


@dataclasses.dataclass(frozen=True)
class Text(Kind):
    """A text."""

    words = "a text"

    def check(self, owner, field, value):
        """See `Kind`."""
        return instance(owner, field, value, str, self.words)


@dataclasses.dataclass(frozen=True)
class Flag(Kind):
    """True or False."""

    words = "True or False"

    def check(self, owner, field, value):
        """See `Kind`."""
        return instance(owner, field, value, bool, self.words)


@dataclasses.dataclass(frozen=True)
class FileName(Kind):
    """The name of a file; in a scene file, beside it."""

    words = "the name of a file"

    def check(self, owner, field, value):
        """See `Kind`."""
        return instance(owner, field, value, str | PathLike, self.words)


@dataclasses.dataclass(frozen=True)
class Choice(Kind):
    """One of some values."""

    values: tuple = ()

    @property
    def words(self):
        """See `Kind`."""
        return " or ".join(map(repr, self.values))

    def check(self, owner, field, value):
        """See `Kind`."""
        if not isinstance(value, type(self.values[0])) or value not in self.values:
            refuse(owner, field, value, self.words)
        return value


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
        """See `Kind`."""
        *first, last = [f"{name}(...)" for name in self.known()] or ["an object"]
        return f"{', '.join(first)} or {last}" if first else last

    def check(self, owner, field, value):
        """See `Kind`."""
        return value if isinstance(value, self.classes) else instance(owner, field, value, self.classes, self.words)


@dataclasses.dataclass(frozen=True)
class Optional(Kind):
    """None, or what another kind takes."""

    inner: Kind = Kind()

    @property
    def words(self):
        """See `Kind`."""
        return f"{self.inner.words}, or None"

    def check(self, owner, field, value):
        """See `Kind`."""
        return None if value is None else self.inner.check(owner, field, value)


@dataclasses.dataclass(frozen=True)
class Function(Kind):
    """What another kind takes, or a function that returns it."""

    inner: Kind = Kind()

    @property
    def words(self):
        """See `Kind`."""
        return f"{self.inner.words}, or a function of time that gives one"

    def check(self, owner, field, value):
        """See `Kind`."""
        if callable(value):
            return value
        if not isinstance(value, numbers.Real | str | list | tuple | np.ndarray):
            refuse(owner, field, value, self.words)
        return self.inner.check(owner, field, value)


@dataclasses.dataclass(frozen=True)
class Items(Kind):
    """A tuple of what another kind takes."""

    inner: Kind = Kind()

    @property
    def words(self):
        """See `Kind`."""
        return f"a list, each {self.inner.words}"

    def check(self, owner, field, value):
        """See `Kind`."""
        instance(owner, field, value, list | tuple | np.ndarray, self.words)
        return tuple(self.inner.check(owner, f"{field}[{i}]", x) for i, x in enumerate(value))


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
    if dataclasses.is_dataclass(annotation) or is_family(annotation):
        return Object((annotation,))
    return Kind()


def _union(given):
    others = [x for x in given if x is not type(None)]
    functions = [x for x in others if typing.get_origin(x) is Callable]
    kinds = [kind_of(x) for x in others if x not in functions]
    if len(kinds) == 1:
        found = kinds[0]
    elif kinds and all(isinstance(kind, Object) for kind in kinds):
        found = Object(tuple(cls for kind in kinds for cls in kind.classes))
    else:
        found = Kind()
    if functions:
        found = Function(found)
    return Optional(found) if len(others) < len(given) else found


def _limited(kind, limits):
    """A kind with other limits of its numbers."""
    if isinstance(kind, Number):
        return dataclasses.replace(kind, limits=limits)
    return dataclasses.replace(kind, inner=_limited(kind.inner, limits))


def _name(owner):
    return owner if isinstance(owner, str) else type(owner).__name__


_T = TypeVar("_T")
#: A value, or a function of time (s) that returns one.
InTime = _T | Callable[[float], _T]

#: Numbers with a unit, in SI. Where nothing else is said they are finite, of either sign.
Length = Annotated[float, Number("length", positive())]
Diameter = Annotated[float, Number("diameter", positive())]
Depth = Annotated[float, Number("length", positive("a measured depth"))]
ForceSize = Annotated[float, Number("force")]
Torque = Annotated[float, Number("moment")]
Mass = Annotated[float, Number("mass", at_least(0))]
MassPerLength = Annotated[float, Number("mass per length", positive())]
ForcePerLength = Annotated[float, Number("force per length")]
Inertia = Annotated[float, Number("moment of inertia", at_least(0))]
Density = Annotated[float, Number("density", at_least(0, "a density"))]
Pressure = Annotated[float, Number("pressure", positive())]
Speed = Annotated[float, Number("speed")]
AngularVelocity = Annotated[float, Number("angular velocity")]
Rotation = Annotated[float, Number("rotation", positive())]
Time = Annotated[float, Number("time")]
Rate = Annotated[float, Number("rate", at_least(0, "a rate"))]
Frequency = Annotated[float, Number("frequency")]
Stiffness = Annotated[float, Number("stiffness", positive(infinite=True))]
TorsionalStiffness = Annotated[float, Number("torsional stiffness", at_least(0))]
WallStiffness = Annotated[float, Number("stiffness per length", positive())]
Damping = Annotated[float, Number("damping", at_least(0))]
TorsionalDamping = Annotated[float, Number("torsional damping", at_least(0))]
Friction = Annotated[float, Number(limits=between(0, 5, "a coefficient of friction"))]
Ratio = Annotated[float, Number(limits=positive())]
Count = Annotated[int, Number(limits=at_least(1), whole=True)]
#: Three numbers, inertial.
Vector = Annotated[Numbers, Several()]
#: The name of a file.
File = Annotated[str | PathLike[str], FileName()]
