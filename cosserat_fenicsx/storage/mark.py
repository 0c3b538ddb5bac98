"""Marks of objects: flat data by which an object is compared with one of an earlier run.

A mark is {place: number, text, None or list of these}, data for JSON. Every object is walked as a whole: all fields of
a dataclass (but those that it leaves out of comparisons), all entries of lists and dicts. Functions of time and of the
arc length are sampled where it is known on which interval they are used; of other functions the code is compared.
"""

import contextlib
import dataclasses
import dis
import functools
import hashlib
import inspect
import json
import os
import reprlib
import types
from enum import Enum

import numpy as np

from cosserat_fenicsx.checks import NAMED
from cosserat_fenicsx.scene.rod import Rod
from cosserat_fenicsx.scene.signals import Signal

_PLAIN = (type(None), bool, int, float, str)
# Arrays with more entries than this are hashed where they are compared exactly.
_LONGEST = 64
# Places along a rod where functions of the arc length are sampled, and times up to the duration.
_ALONG, _IN_TIME = 9, 33
# Times after the duration, as multiples of it, where functions of time are sampled for a later, longer duration.
_AHEAD = np.geomspace(1.001, 1009.0, 40)
# Python's instructions with names of objects outside the function.
_READS = ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_DEREF", "LOAD_CLASSDEREF", "LOAD_FROM_DICT_OR_GLOBALS")
_ASSIGNS = ("STORE_GLOBAL", "STORE_DEREF")
_CODE = ": code"


class NotMarked(Exception):
    """An object that cannot be compared with another one; its text says of which type it is."""


def mark_of(value, where="", times=None):
    """The mark of a value, equal for values that compute the same; where: its name, with which all places begin; times:
    where functions of time are sampled, s, see `sample_times`; None where there is no time. With times, objects of a
    class without declared fields are compared by their attributes; without, NotMarked for a value that is none of
    numbers, texts, arrays, lists, dicts, functions, and dataclasses of these (as the parts of scenes and of wells are).
    """
    walk = _Walk(times)
    walk.into(where, value)
    return walk.found


def sample_times(duration):
    """Times (s) at which functions of time are sampled: up to the duration, and after it for longer durations."""
    within = duration * np.concatenate([np.linspace(0, 1, _IN_TIME), np.geomspace(1e-4, 1, 30)[:-1]])
    return sorted({*within.tolist(), *(duration * _AHEAD).tolist()})


def until(mark, time):
    """The part of a mark up to a time, s."""
    return {place: value for place, value in mark.items() if _time_of(place) <= time * (1 + 1e-12)}


def difference(given, expected, what, rounding=0.0):
    """The first difference of two marks in words, of a function at the sample that differs most; None for none. what:
    the stored thing that `expected` belongs to, such as "motion"; rounding: relative difference of numbers that counts
    as equal."""
    groups = {}
    for place in expected:
        groups.setdefault(place.partition(" at ")[0], []).append(place)
    for group in groups.values():
        missing = next((place for place in group if place not in given), None)
        if missing:
            return f"it has no {missing}"
        size = max(_size(expected[place]) for place in group)
        apart = [_apart(given[place], expected[place], exactly=not rounding) for place in group]
        if max(apart) > rounding * size:
            place = group[int(np.argmax(apart))]
            if place.endswith(_CODE):
                return f"the code of {place.removesuffix(_CODE)}, or something that it uses, was changed"
            return f"{place} is {reprlib.repr(given[place])}, where the {what} has {reprlib.repr(expected[place])}"
    return next((f"the {what} has no {place}" for place in given if place not in expected), None)


class _Walk:
    """A walk through a value; `found` is the mark so far."""

    def __init__(self, times):
        self.found, self._times, self._rods, self._inside = {}, times, {}, set()

    def into(self, where, value, s=None):
        """Add a value; `s`: arc lengths (m) at which functions of the arc length are sampled, None where none are."""
        value = value.item() if isinstance(value, np.generic) else value
        if isinstance(value, Enum):
            self.found[where] = f"{_full_name(type(value))}.{value.name}"
        elif isinstance(value, _PLAIN):
            self.found[where] = value
        elif isinstance(value, complex):
            self.found[where] = [value.real, value.imag]
        elif isinstance(value, os.PathLike):
            self.found[where] = os.fspath(value)
        elif isinstance(value, np.ndarray) and value.dtype.kind in "biufcU":
            self._array(where, value)
        elif isinstance(value, list | tuple):
            self._items(where, value, s)
        elif isinstance(value, dict):
            self.found[f"{where}: names"] = [str(key) for key in value]
            for key, inner in value.items():
                self.into(f"{where}[{key!r}]", inner, s)
        elif isinstance(value, Rod) and value in self._rods:
            self.found[where] = self._rods[value]
        elif isinstance(value, Signal):
            self._signal(where, value)
        elif dataclasses.is_dataclass(value) and not isinstance(value, type):
            self._fields(where, value, s)
        elif callable(value):
            self._function(where, value, s)
        else:
            self._unknown(where, value)

    def _array(self, where, array):
        if array.dtype.kind == "c":
            self._array(where, np.stack([array.real, array.imag], axis=-1))
        elif array.size > _LONGEST and self._times is None:
            self.found[where] = [*map(str, array.shape), array.dtype.str, _hash(array.tobytes())]
        else:
            self.found[where] = array.tolist()

    def _items(self, where, items, s):
        if _is_numbers(items):
            array = np.asarray(items)
            if array.dtype.kind == "O":  # whole numbers beyond 64 bits
                self.found[where] = list(items)
            else:
                self._array(where, array)
            return
        self.found[where] = f"{len(items)} items"
        for i, item in enumerate(items):
            self.into(f"{where}[{i}]", item, s)

    def _fields(self, where, value, s):
        if isinstance(value, Rod):
            self._rods[value] = value.name
            s = np.linspace(0, value.length, _ALONG)
        elif isinstance(getattr(value, "rod", None), Rod):
            s = np.linspace(0, value.rod.length, _ALONG)
        self.found[where] = _full_name(type(value))
        for field in dataclasses.fields(value):
            if field.init and field.compare:
                self.into(f"{where}.{field.name}" if where else field.name, getattr(value, field.name), s)

    def _signal(self, where, signal):
        self.found[f"{where}: jumps"] = list(signal.jumps)
        if self._times is None or dataclasses.is_dataclass(signal.function):
            self.into(where, signal.function)
        else:
            self._samples(where, signal, self._times, "t", "s")

    def _function(self, where, function, s):
        if s is not None:
            self._samples(where, function, s, "s", "m")
        elif self._times is not None and not isinstance(function, type | types.BuiltinFunctionType):
            self.found[f"{where}: jumps"] = [float(t) for t in getattr(function, "jumps", ())]
            self._samples(where, function, self._times, "t", "s")
        else:
            self._code(where, function)

    def _samples(self, where, function, places, letter, unit):
        self.found[where] = "a function"
        for place in np.asarray(places).tolist():
            with contextlib.suppress(Exception):  # it need not be defined beyond the duration
                self.into(f"{where} at {letter} = {place!r} {unit}", function(place))

    def _code(self, where, function):
        if isinstance(function, functools.partial):
            self._code(where, function.func)
            self.into(f"{where}: given", [*function.args, function.keywords])
            return
        if isinstance(function, types.MethodType):
            self._code(where, function.__func__)
            self.into(f"{where}: of", function.__self__)
            return
        if isinstance(function, types.FunctionType):
            function = inspect.unwrap(function, stop=lambda f: not hasattr(f, NAMED))  # one of the package's own
            self.found[f"{where}: function"] = _full_name(function)
            self.found[where + _CODE] = _hash(repr(_code(function, set())).encode())
        elif isinstance(function, type | types.BuiltinFunctionType | np.ufunc):
            self.found[f"{where}: function"] = _full_name(function)
        else:
            raise NotMarked(_full_name(type(function)))

    def _unknown(self, where, value):
        if self._times is None:
            raise NotMarked(_full_name(type(value)))
        self.found[where] = _full_name(type(value))
        if id(value) not in self._inside:
            self._inside.add(id(value))
            for name, inner in getattr(value, "__dict__", {}).items():
                self.into(f"{where}.{name}", inner)


def _full_name(named):
    return f"{getattr(named, '__module__', None)}.{getattr(named, '__qualname__', named)}"


def _hash(data):
    return hashlib.sha256(data).hexdigest()[:16]


# -- the code of functions -------------------------------------------------------------------------------------------


def _code(function, seen):
    """A function as nested tuples: its instructions, and what it names in its own module and that does not change."""
    if function in seen:
        return function.__qualname__
    seen.add(function)
    known = {**function.__globals__, **_enclosed(function)}
    given = [*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).items()]
    instructions, names = _instructions(function.__code__, function.__doc__)
    used = [_of_fixed(value) for value in given]
    for name in sorted(names):
        value = known.get(name)
        if isinstance(value, types.FunctionType) and value.__module__ == function.__module__:
            used.append((name, _code(value, seen)))
        else:
            used.append((name, _of_fixed(value)))
    return instructions, used


def _enclosed(function):
    found = {}
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            found[name] = cell.cell_contents
        except ValueError:  # not assigned yet
            continue
    return found


def _instructions(code, doc=None):
    """(instructions and constants of a code object and of those in it, names that it reads and does not assign)."""
    constants, names, assigned = [], set(), set()
    for step in dis.get_instructions(code):
        if step.opname in _READS:
            names.add(step.argval)
        elif step.opname in _ASSIGNS:
            assigned.add(step.argval)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            inner, inner_names = _instructions(constant)
            constants.append(inner)
            names |= inner_names - {*code.co_cellvars}
        elif constant != doc or doc is None:
            constants.append(sorted(map(repr, constant)) if isinstance(constant, frozenset) else constant)
    return (code.co_code, code.co_names, constants), names - assigned


def _of_fixed(value):
    """The mark of an object that cannot change; None for others."""
    try:
        return mark_of(value) if _is_fixed(value) else None
    except NotMarked:
        return None


def _is_fixed(value):
    if isinstance(value, tuple):
        return all(map(_is_fixed, value))
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return type(value).__dataclass_params__.frozen
    return isinstance(value, (*_PLAIN, complex, np.generic))


# -- comparison ------------------------------------------------------------------------------------------------------


def _time_of(place):
    _, mark, time = place.partition(" at t = ")
    return float(time.partition(" s")[0]) if mark else 0.0


def _is_numbers(items):
    """Whether a list holds numbers alone, or lists of as many each, and at least one."""
    if items and all(isinstance(item, list | tuple) for item in items):
        return all(map(_is_numbers, items)) and len(set(map(len, items))) == 1
    numbers = (isinstance(x, int | float | np.integer | np.floating) and not isinstance(x, bool) for x in items)
    return len(items) > 0 and all(numbers)


def _apart(a, b, exactly):
    """The largest difference of two values; infinity where they differ and are not arrays of numbers of one shape."""
    if exactly:
        return 0.0 if json.dumps(a) == json.dumps(b) else np.inf  # where 1 is not 1.0, and NaN is itself
    a, b = _array(a), _array(b)
    if a.dtype.kind == "f" and b.dtype.kind == "f" and a.shape == b.shape:
        # equal infinities differ by 0
        apart = np.abs(np.subtract(a, b, out=np.zeros(a.shape), where=a != b))
        return float(np.nan_to_num(apart, nan=np.inf, posinf=np.inf).max(initial=0.0))
    return 0.0 if a.dtype == b.dtype and a.shape == b.shape and bool((a == b).all()) else np.inf


def _size(value):
    array = _array(value)
    return float(np.abs(array[np.isfinite(array)]).max(initial=0.0)) if array.dtype.kind == "f" else 0.0


def _array(value):
    """Numbers as floats, anything else as it is."""
    try:
        array = np.asarray(value)
    except ValueError:
        array = np.empty(0)
    return array.astype(float) if array.dtype.kind in "iuf" else np.array(value, dtype=object)
