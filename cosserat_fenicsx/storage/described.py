"""Descriptions of tasks and cases as data, by which a folder knows whether it is asked for the same study."""

import dataclasses
import dis
import functools
import hashlib
import inspect
import os
import types

import numpy as np

from cosserat_fenicsx.arguments import NAMED

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
