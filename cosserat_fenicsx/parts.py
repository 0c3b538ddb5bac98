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

The constructor checks and normalises the fields; then `validate` may check what concerns several of them. Scene files
and stored data are read and written by the same annotations (`from_data`, `to_data`), which JSON Schema describes too
(`schema`): an object is a table whose keys are the arguments of its constructor, with "type" where several classes are
possible.

A family is a class that others are derived from, `class BitLaw(Part, family="bit law")`. Every dataclass derived from
it is a member under its own name, in scene files, in stored data and in the reference, from the moment it is defined.
"""

import dataclasses
import functools
import importlib
import inspect
import numbers
import typing
import weakref
from collections.abc import Callable
from os import PathLike
from typing import Annotated, Any, TypeVar

from cosserat_fenicsx.checks import Numbers, direction
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.kinds import (
    FAMILIES,
    FileName as FileName,
    Items as Items,
    Kind as Kind,
    Limits as Limits,
    NotData as NotData,
    Number as Number,
    Object as Object,
    Optional as Optional,
    Reading as Reading,
    Several as Several,
    Text as Text,
    Values as Values,
    Writing,
    arguments_of as arguments_of,
    between as between,
    concerning as concerning,
    fields_of,
    made as made,
    members as members,
    misplaced as misplaced,
    spoken as spoken,
    table_schema,
)


class _Readable(type):
    """Lets `help` and `dir` show what a class is for, and not what `dataclass` adds to it."""

    def __dir__(cls):
        return [name for name in super().__dir__() if not name.startswith("__") or name in ("__call__", "__doc__")]

    @property
    def __signature__(cls):
        """The arguments and their defaults; the docstring has their units."""
        own = inspect.signature(cls.__init__)
        arguments = [x.replace(annotation=x.empty) for name, x in own.parameters.items() if name != "self"]
        return own.replace(parameters=arguments, return_annotation=own.empty)


class Part(metaclass=_Readable):
    """Base of the parts of scenes, see the head of the module.

    Class arguments:
        family: what the members of a new family are, in words, such as "bit law".
        homes: modules and packages beside that of the class whose members are imported before the family is listed.
    """

    _family: typing.ClassVar[Any] = None
    #: Its name in messages, where that is not the name of the class.
    called: typing.ClassVar[str] = ""

    def __init_subclass__(cls, family="", homes=(), **more):
        super().__init_subclass__(**more)
        if family:
            cls._family, cls._of, cls._homes = cls, family, (cls.__module__, *homes)
            cls._members, cls._twice = {}, set()
            FAMILIES[family] = cls
        elif cls._family is not None and not cls.__name__.startswith("_") and "<locals>" not in cls.__qualname__:
            known = cls._family._members.get(cls.__name__)
            if known is not None and (known.__module__, known.__qualname__) != (cls.__module__, cls.__qualname__):
                if known.__module__.startswith("cosserat_fenicsx."):
                    raise TypeError(
                        f"class {cls.__name__}: {known.__module__} has a {cls._of} of this name: expected another name"
                    )
                cls._family._twice.add(cls.__name__)  # refused where data name it
            cls._family._members[cls.__name__] = cls

    def __post_init__(self):
        for name, kind in fields_of(type(self)).items():
            given = getattr(self, name)
            if (value := kind.check(self, name, given)) is not given:
                object.__setattr__(self, name, value)
        self.validate()

    def validate(self):
        """Refuse values that do not fit each other; the fields themselves are checked and normalised already."""

    def arguments(self):
        """{name: value} that the constructor makes an equal object from."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.init}

    def in_words(self, units):
        """Its class and the arguments that are not their defaults, in some `Units`: "Motor(torque 10 kN m)"."""
        kinds, words = fields_of(type(self)), []
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name in kinds and value is not None and not (value is field.default or value == field.default):
                words.append(f"{field.name} {kinds[field.name].told(value, units)}")
        return f"{type(self).__name__}({', '.join(words)})" if words else type(self).__name__

    @classmethod
    def constructors(cls):
        """Constructors for tables: the class, and class methods with other arguments."""
        return (cls,)

    @classmethod
    def constructor(cls, names):
        """The one of `constructors` that has the arguments of these names."""
        _, *others = cls.constructors()
        own = arguments_of(cls).keys()
        return next((make for make in others if (arguments_of(make).keys() - own) & set(names)), cls)


class Settings(Part):
    """Base of tables of arguments of a function; None for its own defaults."""

    def given(self) -> dict[str, Any]:
        """The arguments that are given."""
        return {name: value for name, value in self.arguments().items() if value is not None}


class FunctionOfTime(
    Part,
    family="function of time",
    homes=("cosserat_fenicsx.scene.signals", "cosserat_fenicsx.scene.supports"),
):
    """Base of functions of time (s), with the attribute `jumps`, times where they are not smooth.

    Their numbers, in the fields `value` or `values`, may be text with a unit, which what they are given to converts.
    """

    def in_units(self, check):
        """The same function where `check` has made every text with a unit, and single numbers, a number in SI."""
        if hasattr(self, "value"):
            value = _checked(self.value, check)
            return self if value is self.value else dataclasses.replace(self, value=value)
        rows = getattr(self, "values", None)
        if not isinstance(rows, list | tuple):
            return self
        values = tuple(_checked(row, check) for row in rows)
        same = all(a is b for a, b in zip(rows, values, strict=True))
        return self if same else dataclasses.replace(self, values=values)


def _checked(value, check):
    if isinstance(value, str | numbers.Real):
        return (check(value),)
    if isinstance(value, list | tuple) and any(isinstance(x, str) for x in value):
        return tuple(map(check, value))
    return value


class FunctionAlong(
    Part, family="function along a rod", homes=("cosserat_fenicsx.scene.signals", "cosserat_fenicsx.actions.tendons")
):
    """Base of functions of the arc length of a rod, m."""


def to_data(part, whole=True):
    """A part as a table of lists, numbers, texts and None, which JSON can hold; "use": modules of users' classes;
    whole: whether arguments with their default values are written too. NotData for a function written in Python, or an
    object of a class that is not known by its name."""
    writing = Writing(whole)
    data = Object((type(part),)).write(part, writing)
    return data | ({"use": sorted(writing.modules)} if writing.modules else {})


def from_data(cls, data):
    """The part of a class from `to_data`; SceneError where these are no data of such a part."""
    try:
        use(data.get("use", ()))
        return made(cls, {key: value for key, value in data.items() if key != "use"})
    except (AttributeError, IndexError, KeyError, TypeError, ValueError, ArithmeticError, RecursionError) as problem:
        name = cls.__name__
        raise SceneError(f"these are no data of a {name} ({type(problem).__name__}: {problem})") from None


def use(modules):
    """Import modules that define parts of the user's own; SceneError where one cannot be imported."""
    if not isinstance(modules, list | tuple):
        raise misplaced(("use",), f"use = {modules!r}: expected a list of the names of modules")
    for i, module in enumerate(modules):
        try:
            importlib.import_module(module)
        except Exception as problem:  # a user's module may raise anything
            raise misplaced(
                ("use", i), f"use[{i}] = {module!r}: cannot be imported ({type(problem).__name__}: {problem})"
            ) from None


def schema(cls):
    """The JSON Schema of tables of a class, with definitions of all classes in them."""
    definitions = {}
    found = table_schema(cls, definitions)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **found, "$defs": definitions}


def positive(what="", *, infinite=False):
    """Limits of numbers above zero, also of infinity where that is allowed; `what`: see `Limits`."""
    return Limits(0.0, above=True, infinite=infinite, what=what)


def at_least(low, what=""):
    """Limits of numbers from `low`; `what`: see `Limits`."""
    return Limits(low, what=what)


@dataclasses.dataclass(frozen=True)
class Direction(Several):
    """Three finite numbers that are not all zero, made a unit vector."""

    words = "a direction, three numbers"

    def check(self, owner, field, value):
        return direction(owner, field, value)


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
DampingTime = Annotated[float, Number("time", at_least(0, "a damping time"))]
Rate = Annotated[float, Number("rate", at_least(0, "a rate"))]
Frequency = Annotated[float, Number("frequency")]
Stiffness = Annotated[float, Number("stiffness", positive(infinite=True))]
TorsionalStiffness = Annotated[float, Number("torsional stiffness", at_least(0))]
WallStiffness = Annotated[float, Number("stiffness per length", positive())]
Damping = Annotated[float, Number("damping", at_least(0))]
TorsionalDamping = Annotated[float, Number("torsional damping", at_least(0))]
DampingPerLength = Annotated[float, Number("damping per length", at_least(0))]
QuadraticDrag = Annotated[float, Number("drag per length", at_least(0))]
Friction = Annotated[float, Number(limits=between(0, 5, "a coefficient of friction"))]
Ratio = Annotated[float, Number(limits=positive())]
Count = Annotated[int, Number(limits=at_least(1), whole=True)]
#: Three numbers, inertial.
Vector = Annotated[Numbers, Several()]
#: Three numbers of any length, inertial, made a unit vector.
UnitVector = Annotated[Numbers, Direction()]
#: The name of a file.
File = Annotated[str | PathLike[str], FileName()]


# Results of one function that are kept for a scene.
_MOST = 64


def per_scene(function):
    """Decorator of a function (scene, ...) whose results depend on its arguments alone and are never changed. Arguments
    that cannot be hashed are passed on; so are exceptions, which are not remembered."""
    known = {}  # by the scene's id, which its end takes out

    @functools.wraps(function)
    def remembered(scene, *args, **named):
        key = (*args, *named.items())
        key += (*map(type, args), *map(type, named.values()))  # True is not 1 where a number is expected
        try:
            if id(scene) not in known:
                known[id(scene)] = {}, weakref.ref(scene, lambda _, number=id(scene): known.pop(number, None))
            results, _ = known[id(scene)]
            if key in results:
                return results[key]
        except TypeError:
            return function(scene, *args, **named)
        if len(results) >= _MOST:
            results.clear()
        results[key] = function(scene, *args, **named)
        return results[key]

    return remembered
