"""Checks of users' input: every refusal names the field, its value and what was expected.

Also the types that annotations of the public interface share, and messages on arguments that a public class or function
does not have.
"""

import dataclasses
import functools
import inspect
import itertools
import math
import numbers
import re
import stat
import sys
import types
import warnings
from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from cosserat_fenicsx.quantities import BY_UNIT, LARGEST, MOST, in_si
from cosserat_fenicsx.errors import SceneError, SceneWarning, nearest

#: Numbers, as a list, a tuple or an array.
Numbers = Sequence[float] | np.ndarray
#: Rows of numbers.
Rows = Sequence[Numbers] | np.ndarray
#: Three numbers, or a function of the time (s) that returns them.
NumbersInTime = Numbers | Callable[[float], Numbers]
#: The path of a file.
File = str | PathLike[str]

#: Largest size (bytes) of a text file that is read.
MOST_TEXT = 2**27
# How workbooks of spreadsheet programs begin: as .zip archives (.xlsx, .ods), or as .xls.
_WORKBOOKS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")
_SMALLEST = min(MOST.values())
_OF_STRINGS = ("cosserat_fenicsx.well.", "cosserat_fenicsx.drilling.")
# Diameters (m) above this are wider than those of wells.
_WIDEST = 1.5
# Diameters above this are probably in mm, not in inches.
_INCHES = 50.0
# Longer texts of values, such as a rod's, are abbreviated in messages.
_LONGEST = 100


def name_of(owner):
    """The name of an object in messages: its class, or what it is called in scene files; a text as it is."""
    return owner if isinstance(owner, str) else getattr(owner, "called", "") or type(owner).__name__


def refuse(owner, field, value, expected):
    """Raise a SceneError: 'owner.field = value: expected ...'."""
    where, given = name_of(owner), repr(value)
    if len(given) > _LONGEST:
        given = f"{given[:_LONGEST]}..."
    raise SceneError(f"{where}.{field} = {given}: expected {expected}")


def warn(text, kind=SceneWarning):
    """Give a warning, at the line outside the package from which it was called."""
    frame, level = sys._getframe(1), 2
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "cosserat_fenicsx":
        frame, level = frame.f_back, level + 1
    warnings.warn(text, kind, stacklevel=2 if frame is None else level)


@functools.lru_cache
def _unit_of(expected):
    unit = re.search(r"\(([^(),]+)", expected)
    return unit[1] if unit else ""


def _in_si(owner, field, value, unit, dimension=None):
    """A number from text with a unit of a dimension, None for that of `unit`; anything else as it is."""
    dimension = dimension or ("angle" if unit == "degrees" else BY_UNIT.get(unit))
    if not isinstance(value, str) or dimension is None:
        return value
    found = in_si(f"{name_of(owner)}.{field}", value, dimension)
    return math.degrees(found) if unit == "degrees" else found


class _Typed(str):
    """A text that messages show as it is."""

    __repr__ = str.__str__


def number(owner, field, value, expected, accept, above_zero=False, dimension=None):
    """`value` as a float where it is a number that `accept` accepts, or text with a unit; refused otherwise.

    Args:
        expected: for messages, with the SI unit in its first parentheses.
        above_zero: whether numbers so small that their powers are zero are refused too.
        dimension: of text with a unit, see `quantities.DIMENSIONS`; None for that of the SI unit.
    """
    unit, told = _unit_of(expected), value
    if isinstance(value, str) and unit == "degrees" and not any(map(str.isdigit, value)):
        refuse(owner, field, value, expected)
    if isinstance(value, str):
        value = _in_si(owner, field, value, unit, dimension)
        if not isinstance(value, str):
            told = _Typed(f"{told!r} ({value:.10g} {unit})")
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        quoted = isinstance(value, str) and value.strip().lstrip("+-").replace(".", "", 1).isdigit()
        refuse(owner, field, value, f"{expected}, without quotes" if quoted else expected)
    try:
        given = float(value)
    except OverflowError:  # an integer of more than 308 digits
        refuse(owner, field, f"{str(value)[:10]}...", expected)
    if math.isnan(given) or not accept(given):
        refuse(owner, field, told, expected)
    if above_zero and given < 1 / LARGEST:
        refuse(owner, field, told, f"{expected} from {1 / LARGEST:g} to {LARGEST:g}")
    if abs(given) > _SMALLEST and abs(given) != math.inf:
        most = _most(owner, unit)
        if abs(given) > most:
            refuse(owner, field, told, f"{expected}, of at most {most:g}{f' {unit}' if unit else ''}")
    return given


def whole(owner, field, value):
    """`value` where it is a whole number above zero; refused otherwise."""
    if isinstance(value, bool) or not isinstance(value, numbers.Integral) or value < 1:
        refuse(owner, field, value, "a whole number above zero")
    return value


def tolerance(owner, value):
    """`value` where it serves as `tol`; refused otherwise."""
    return number(owner, "tol", value, "a number from 1e-12 to below 1", lambda x: 1e-12 <= x < 1)


def _most(owner, unit):
    """The largest size of a number with a unit that an object has."""
    of_strings = any(kind.__module__.startswith(_OF_STRINGS) for kind in type(owner).__mro__)
    return MOST.get(unit, LARGEST) if of_strings else LARGEST


def positive(owner, field, value, unit):
    """A number above zero, neither so small nor so large that its powers are not numbers."""
    return number(owner, field, value, f"a positive number ({unit})", lambda x: 0 < x < math.inf, above_zero=True)


def stiffness(owner, field, value, unit):
    """A number above zero; infinity is allowed."""
    return number(owner, field, value, f"a positive number or infinity ({unit})", lambda x: x > 0)


def finite_array(owner, field, value, expected):
    """`value` as an array of floats of any shape; refused unless all are finite numbers, or texts with a unit, alone or
    in a list, of the dimension of the first one in the parentheses of `expected`."""
    if isinstance(value, str):
        value = _in_si(owner, field, value, _unit_of(expected))
    if isinstance(value, list | tuple):
        rows = (x if isinstance(x, list | tuple) else (x,) for x in value)
        kinds = set(map(type, itertools.chain.from_iterable(rows)))
        if bool in kinds:
            refuse(owner, field, value, expected)
        if str in kinds:
            value = [_in_si(owner, f"{field}[{i}]", x, _unit_of(expected)) for i, x in enumerate(value)]
    try:
        array = np.asarray(value)
    except ValueError:
        refuse(owner, field, value, expected)
    if array.dtype.kind not in "iuf" or not np.isfinite(array).all():
        refuse(owner, field, value, expected)
    if np.abs(array).max(initial=0) > LARGEST:
        refuse(owner, field, value, f"{expected}, none beyond {LARGEST:g}")
    return array.astype(float)


def vector(owner, field, value, unit, size=3):
    """A tuple of `size` finite numbers; text with a unit is converted."""
    if type(value) is tuple and len(value) == size and all(type(x) is float and abs(x) <= LARGEST for x in value):
        return value  # at once: frames have tens of thousands of points
    expected = f"{size} finite numbers ({unit})"
    if size == 3 and isinstance(value, numbers.Real | str):
        expected += f", such as (0, 0, {1 if unit == 'direction' else _downwards(value, unit)})"
    array = finite_array(owner, field, value, expected)
    if array.shape != (size,):
        refuse(owner, field, value, expected)
    return tuple(array.tolist())


def _downwards(value, unit):
    """A number or a text with a unit as it is written in a vector, downwards where it is a load or gravity."""
    if unit not in ("N", "N/m", "m/s^2") or str(value).startswith(("-", "+")):
        return repr(value)
    return f"-{value}" if not isinstance(value, str) else f'"-{value}"'


def text_of(file, expected, *, pipes=False):
    """The text of a user's file, without the mark that some editors begin files with, or a SceneError: it cannot be
    read, is no plain file (or pipe, with `pipes`), is too large, holds a workbook, or is not UTF-8; expected: in
    messages."""
    data = bytes_of(file, expected, pipes=pipes)
    if data.startswith(_WORKBOOKS):
        raise SceneError(f"{file}: a workbook or another archive: expected {expected}; save the sheet as .csv (UTF-8)")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as problem:
        raise SceneError(f"{file}: not UTF-8 ({problem.reason} at byte {problem.start}): save it as UTF-8") from None


def bytes_of(file, expected, *, pipes=False):
    """The content of a user's file; arguments and errors as of `text_of`, but for what is in it."""
    file = Path(file)
    try:
        mode = file.stat().st_mode
        plain = stat.S_ISREG(mode) or stat.S_ISDIR(mode) or (pipes and stat.S_ISFIFO(mode))
        data = b""
        if plain:
            with file.open("rb") as stream:
                data = stream.read(MOST_TEXT + 1)
    except OSError as problem:
        raise SceneError(f"{file}: cannot be read ({problem.strerror}): expected {expected}") from None
    except ValueError as problem:  # a null character in its name
        raise SceneError(f"{str(file)!r}: cannot be read ({problem}): expected {expected}") from None
    if not plain:
        raise SceneError(f"{file}: no plain file: expected {expected}")
    if len(data) > MOST_TEXT:
        raise SceneError(f"{file}: larger than {MOST_TEXT / 2**20:g} MiB: expected {expected}")
    return data


def call(function, x, name, where):
    """function(x) of a user's function of a number; exceptions become a SceneError whose message begins `name` and ends
    `where`, such as " at t = {:g} s" with x in it."""
    try:
        return function(x)
    except Exception as problem:  # a user's function may raise any exception
        raise SceneError(f"{name} raised {type(problem).__name__} ({problem}){where.format(x)}") from problem


def doubt_width(owner, field):
    """Warn of a diameter (m) of a hole, or of what is in it, that is probably in inches."""
    diameter = getattr(owner, field)
    if diameter is not None and diameter > _WIDEST:
        asks = "inches? 8.5 in are '8.5 in', or 0.2159"
        asks = f"mm? {diameter:g} mm are '{diameter:g} mm', or {diameter / 1e3:g}" if diameter > _INCHES else asks
        warn(f"{name_of(owner)}.{field} = {diameter:g} m is wider than holes are: is it in {asks}")


def direction(owner, field, value):
    """The unit vector along three finite numbers that are not all zero, a tuple."""
    given = vector(owner, field, value, "direction")
    size = math.hypot(*given)
    if size == 0.0:
        refuse(owner, field, value, "a direction, not zero")
    if abs(size - 1.0) < 1e-15:  # a unit vector stays the same to the last digit
        return given
    return tuple(x / size for x in given)


def instance(owner, field, value, kinds, expected):
    """`value`; refused unless it is an instance of `kinds`."""
    if not isinstance(value, kinds):
        refuse(owner, field, value, expected)
    return value


def store(obj, **fields):
    """Set checked fields on a frozen dataclass from its __post_init__."""
    for name, value in fields.items():
        object.__setattr__(obj, name, value)


#: Attribute of functions that report their arguments in words.
NAMED = "_names_its_arguments"


def in_words(found):
    """A public class or function with messages on wrong arguments; any other object unchanged. Classes stay the same
    objects: the method `__init__` of those that are dataclasses is replaced."""
    if isinstance(found, types.FunctionType):
        return _checked(found, found)
    if dataclasses.is_dataclass(found) and isinstance(found.__init__, types.FunctionType):
        own = "__init__" in vars(found)
        found.__init__ = _checked(found.__init__ if own else inspect.unwrap(found.__init__), found)
    return found


def _checked(call, named):
    if hasattr(call, NAMED):
        return call

    @functools.wraps(call)
    def checked(*given, **named_ones):
        try:
            return call(*given, **named_ones)
        except TypeError:
            words = _wrong_arguments(call, named.__name__, given, named_ones)
            if words is None:  # raised inside the call
                raise
        raise TypeError(words)

    setattr(checked, NAMED, True)
    return checked


def _wrong_arguments(call, name, given, named):
    """A message on the wrong arguments of a call; None if they fit."""
    signature = inspect.signature(call)
    try:
        signature.bind(*given, **named)
        return None
    except TypeError as problem:
        usual = str(problem)
    known = [x for x in signature.parameters if x != "self"]
    for unknown in named:
        if unknown not in known:
            return f"{name} has no argument '{unknown}': {nearest(unknown, known)}"
    taken = [x if signature.parameters[x].default is inspect.Parameter.empty else f"{x}=..." for x in known]
    return f"{name}: {usual}: expected {name}({', '.join(taken)})"
