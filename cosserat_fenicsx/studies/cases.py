"""The cases of a study: a list of arguments by name, or the product of the values of each."""

import inspect
import itertools
from collections.abc import Iterable, Mapping

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.errors import SceneError


def cases_of(cases):
    """(list of dicts of arguments, {name: list of values} of their grid or None).

    Args:
        cases: an iterable of dicts; or a dict of lists of values, whose product is taken: the last name runs fastest.

    Raises:
        SceneError: they are something else, or there is none.
    """
    if isinstance(cases, Mapping):
        grid = {_name(name): _values(name, values) for name, values in cases.items()}
        if not grid:
            refuse("study", "cases", cases, "at least one name with a list of values")
        return [dict(zip(grid, values, strict=True)) for values in itertools.product(*grid.values())], grid
    expected = "dicts of arguments by name, or one dict of lists of values by name"
    if not isinstance(cases, Iterable) or isinstance(cases, str | bytes):
        refuse("study", "cases", cases, expected)
    found = list(cases)
    if not found:
        refuse("study", "cases", cases, "at least one case")
    for i, case in enumerate(found):
        if not isinstance(case, Mapping):
            refuse("study", f"cases[{i}]", case, expected)
    return [{_name(name): value for name, value in case.items()} for case in found], None


def _name(name):
    if not isinstance(name, str):
        refuse("study", "cases", name, "names of the task's arguments, as texts")
    return name


def _values(name, values):
    if isinstance(values, np.ndarray) and values.ndim == 1:
        values = values.tolist()  # Python's numbers, as those of a list are
    if isinstance(values, str | bytes | Mapping) or not isinstance(values, Iterable):
        refuse("study", f"cases['{name}']", values, "a list of values")
    values = list(values)
    if not values:
        refuse("study", f"cases['{name}']", values, "at least one value")
    return values


def unshared(value):
    """A case, or a part of one, with lists, dicts and arrays of its own, which a task may change: those given belong to
    several cases."""
    if isinstance(value, np.ndarray):
        return value.copy()
    if type(value) in (list, tuple):
        return type(value)(map(unshared, value))
    return {name: unshared(part) for name, part in value.items()} if type(value) is dict else value


def check_task(task, cases):
    """Refuse a task that cannot be called with its cases, before any of them is computed.

    Raises:
        SceneError: it is no function, or has no such arguments.
    """
    if not callable(task):
        refuse("study", "task", task, "a function of the arguments of a case")
    try:
        signature = inspect.signature(task)
    except ValueError:  # some functions written in C do not tell
        return
    for i, case in enumerate(cases):
        try:
            signature.bind(**case)
        except TypeError as problem:
            raise SceneError(
                f"study.cases: case {i} has the names {', '.join(case) or '(none)'}, and the task refuses them "
                f"({problem}): expected the arguments of the task, {signature}"
            ) from None
