"""Descriptions of tasks and cases as data, by which a folder knows whether it is asked for the same study."""

import contextlib
import dataclasses
import dis
import functools
import hashlib
import inspect
import os
import reprlib
import types

import numpy as np

from cosserat_fenicsx.checks import NAMED
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.rod import Rod, Station
from cosserat_fenicsx.scene.signals import FUNCTIONS_ALONG, Signal, sample_times, signals_of

# Arrays with more entries than this are described by a hash.
_LONGEST = 64
# Python's instructions with names of objects outside the function.
_READS = ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_DEREF", "LOAD_CLASSDEREF", "LOAD_FROM_DICT_OR_GLOBALS")
_ASSIGNS = ("STORE_GLOBAL", "STORE_DEREF")
_PLAIN = (type(None), bool, int, float, str)


class NotDescribed(Exception):
    """A value that cannot be compared with another one; its text says of which type it is."""


def described(value):
    """A value as data for JSON, the same for what computes the same.

    Raises:
        NotDescribed: it is none of numbers, texts, arrays, lists, dicts, functions, and dataclasses of these (as the
            parts of scenes and of wells are).
    """
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, _PLAIN):
        return value
    if isinstance(value, complex):
        return {"complex": [value.real, value.imag]}
    if isinstance(value, np.ndarray) and value.dtype.kind in "biufcU":
        told = value.tolist() if value.size <= _LONGEST and value.dtype.kind != "c" else _hash(value.tobytes())
        return {"array": told, "shape": value.shape, "dtype": value.dtype.str}
    if isinstance(value, list | tuple):
        return [described(x) for x in value]
    if isinstance(value, dict):
        return {"dict": [[described(key), described(x)] for key, x in value.items()]}
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = (field.name for field in dataclasses.fields(value) if field.init)
        return {"type": _full_name(type(value)), **{name: described(getattr(value, name)) for name in fields}}
    if callable(value):
        return task_described(value)
    raise NotDescribed(_full_name(type(value)))


def task_described(task):
    """A function as data: its name, and a hash of its code and of the objects that it uses.

    Raises:
        NotDescribed: an object whose state is not known.
    """
    if isinstance(task, functools.partial):
        return {**task_described(task.func), "given": described([*task.args, task.keywords])}
    if isinstance(task, types.MethodType):
        return {**task_described(task.__func__), "of": described(task.__self__)}
    if isinstance(task, types.FunctionType):
        task = inspect.unwrap(task, stop=lambda f: not hasattr(f, NAMED))  # one of the package's own
        return {"function": _full_name(task), "code": _hash(repr(_code(task, set())).encode())}
    if isinstance(task, type | types.BuiltinFunctionType | np.ufunc):
        return {"function": _full_name(task)}
    raise NotDescribed(_full_name(type(task)))


def _full_name(named):
    return f"{getattr(named, '__module__', None)}.{getattr(named, '__qualname__', named)}"


def _hash(data):
    return hashlib.sha256(data).hexdigest()[:16]


def _code(function, seen):
    """What a function does, as nested tuples: its instructions, and the functions of its own module and the objects
    that these name. Other modules, and objects that may change while it runs, are left out."""
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
    """The description of an object that cannot change; None for others."""
    try:
        return described(value) if _is_fixed(value) else None
    except NotDescribed:
        return None


def _is_fixed(value):
    if isinstance(value, tuple):
        return all(map(_is_fixed, value))
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return type(value).__dataclass_params__.frozen
    return isinstance(value, (*_PLAIN, complex, np.generic))


_SAMPLES = 9
#: Relative differences below this are rounding, such as by another release of a library.
_ROUNDING = 1e-9
#: Times after the duration, as multiples of it, where functions of time are sampled for a later, longer duration.
_AHEAD = np.geomspace(1.001, 1009.0, 40)


def fingerprint(scene, duration):
    """The data of a scene, without initial velocities, with functions sampled.

    Args:
        scene: a `Scene`.
        duration: s; functions of time are sampled up to this time.

    Returns:
        {description: number, string or list of these}, which can be written as JSON.
    """
    found = {"number of rods": len(scene.rods)}
    for i, rod in enumerate(scene.rods):
        found |= _of_rod(f"rods[{i}]", rod)
    for kind in ("supports", "joints", "loads"):
        items = getattr(scene, kind)
        found[f"number of {kind}"] = len(items)
        for i, item in enumerate(items):
            found |= _of_item(f"{kind}[{i}] ({type(item).__name__})", item, duration)
    return found


def fingerprint_at(scene, times):
    """The part of a scene's fingerprint that depends on time, at `times` (s), without functions that raise there."""
    found = {}
    for kind in ("supports", "loads"):
        for i, item in enumerate(getattr(scene, kind)):
            for name, signal in signals_of(item).items():
                for t in times:
                    with contextlib.suppress(SceneError):  # a function need not be defined beyond the duration
                        found[_time_words(f"{kind}[{i}] ({type(item).__name__}).{name}", t)] = list(signal(t))
    return found


def times_ahead(duration):
    """Times (s) after a duration, see `fingerprint_at`."""
    return (duration * _AHEAD).tolist()


def difference(given, expected):
    """Text that says where two fingerprints differ; None where they agree to rounding.

    It gives the first quantity that differs, and the sample where this differs most.
    """
    groups = {}
    for what in expected:
        groups.setdefault(what.partition(" at ")[0], []).append(what)
    for group in groups.values():
        missing = next((what for what in group if what not in given), None)
        if missing:
            return f"it has no {missing}"
        size = max(_size(expected[what]) for what in group)
        apart = [_apart(given[what], expected[what]) for what in group]
        if max(apart) > _ROUNDING * size:
            what = group[int(np.argmax(apart))]
            return f"{what} is {reprlib.repr(given[what])}, where the motion has {reprlib.repr(expected[what])}"
    return next((f"the motion has no {what}" for what in given if what not in expected), None)


def _of_rod(where, rod):
    found = {f"{where}.name": rod.name, f"{where}.length (m)": rod.length, f"{where}.damping": repr(rod.damping)}
    s = np.linspace(0, rod.length, _SAMPLES)
    along, places, frames = rod.stiffness_at(s), rod.curve.position(s), rod.curve.frame(s)
    for k, x in enumerate(s):
        at = f"at s = {x:.6g} m"
        found[f"{where}.curve {at}"] = [*places[k].tolist(), *frames[k].ravel().tolist()]
        for name, values in along._asdict().items():
            if name == "matrix" and values is None:
                continue  # motions stored before sections had matrices lack this entry
            found[f"{where}: {name} {at}"] = None if values is None else np.asarray(values)[k].tolist()
        if rod.mass_centre:  # motions stored before rods had eccentricities lack this entry
            found[f"{where}: eccentricity {at}"] = rod.mass_centre.at(x).tolist()
    return found


def _of_item(where, item, duration):
    found = {}
    for name, value in vars(item).items():
        what = f"{where}.{name}"
        if isinstance(value, Station):
            found[what] = [value.rod.name, value.s]
        elif isinstance(value, Rod):
            found[what] = value.name
        elif isinstance(value, Signal):
            found[f"{what}: jumps"] = list(value.jumps)
            found |= {_time_words(what, t): list(value(t)) for t in sample_times(item, duration)}
        elif value is None or isinstance(value, str | bool | int | float):
            found[what] = value
        elif isinstance(value, FUNCTIONS_ALONG):
            found[f"{what}: breaks"] = list(value.breaks)
            along = np.linspace(0, item.rod.length, _SAMPLES)
            found |= {f"{what} at s = {s:.6g} m": value([s])[0].tolist() for s in along}
        elif _is_numbers(value):
            found[what] = np.asarray(value, dtype=float).tolist()
        else:  # other data of a user's own load are compared by type alone
            found[what] = type(value).__name__
    return found


def _time_words(what, t):
    return f"{what} at t = {t!r} s"


def _is_numbers(value):
    try:
        return np.asarray(value).dtype.kind in "iuf"
    except ValueError:
        return False


def _apart(a, b):
    """The largest difference of two values; infinity where they differ and are not arrays of numbers of one shape."""
    a, b = _array(a), _array(b)
    if a.dtype.kind == "f" and b.dtype.kind == "f" and a.shape == b.shape:
        # equal infinities differ by 0
        return float(np.abs(np.subtract(a, b, out=np.zeros(a.shape), where=a != b)).max(initial=0.0))
    return 0.0 if a.shape == b.shape and bool((a == b).all()) else np.inf


def _size(value):
    array = _array(value)
    return float(np.abs(array[np.isfinite(array)]).max(initial=0.0)) if array.dtype.kind == "f" else 0.0


def _array(value):
    """Numbers as floats, anything else as it is."""
    if _is_numbers(value):
        return np.asarray(value, dtype=float)
    return np.array(value, dtype=object)
