"""`Study`: the cases of a task, and what came of each."""

from typing import Any, NamedTuple

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.results.result import import_library


class Failure(NamedTuple):
    """A case without a result: `case`, its arguments, and `why`, a sentence that says what was raised."""

    case: dict[str, Any]
    why: str


class Study:
    """The results of a task over many cases, from `study`; the same on all ranks.

    Attributes:
        cases: list of dicts, the arguments of each case, in their order.
        results: list, what the task returned for each case: a number, a text, an array, or a dict of these by name
            (lists have become arrays); None for a case that failed or is not computed.
        grid: {name: list of values} whose product the cases are; None where they were given one by one.
        failures: list of `Failure` (case, why), in the order of the cases.
        done: (cases,) whether each case is computed, failures included; all are, but in the `path` of an exception.
        seconds: (cases,) time that each case took on its rank, s; NaN where it is not computed.
    """

    #: For messages.
    axis = "case"

    def __init__(self, cases, grid, outcomes):
        self.cases: list[dict[str, Any]] = cases
        self.grid: dict[str, list[Any]] | None = grid
        self._outcomes = outcomes  # {number of the case: (result, why it failed or "", s)}
        self.results: list[Any] = [outcomes.get(i, (None,))[0] for i in range(len(cases))]
        self.failures: list[Failure] = [Failure(cases[i], outcomes[i][1]) for i in sorted(outcomes) if outcomes[i][1]]
        self.done: np.ndarray = np.array([i in outcomes for i in range(len(cases))])
        self.seconds: np.ndarray = np.array([outcomes[i][2] if i in outcomes else np.nan for i in range(len(cases))])

    def __len__(self):
        return int(self.done.sum())

    def why(self, i: int) -> str:
        """The sentence on the failure of case i; "" where it has not failed."""
        return self._outcomes[i][1] if i in self._outcomes else ""

    def to_dataframe(self) -> Any:
        """A pandas DataFrame with a row for every case: its arguments, its results and `failure`, a text, "" for none.

        A result that is a single value is in the column `result`, that of a dict in columns by its names ("name
        (result)" where an argument has it). What is missing is NaN or None; an array is one entry.

        Raises:
            InstallationError: pandas is missing.
        """
        return dataframe(self)

    def to_xarray(self) -> Any:
        """An xarray Dataset of the columns of `to_dataframe`: over the arguments where the cases are a grid, else over
        `case`. Results that are arrays have further dimensions "name_0", "name_1" ...

        Raises:
            InstallationError: xarray is missing.
            SceneError: arrays of a result differ in shape.
        """
        return dataset(self)

    def __repr__(self):
        failed = f", {len(self.failures)} failed" if self.failures else ""
        return f"Study({len(self.cases)} cases, {len(self)} done{failed})"

    def __str__(self):
        return as_lines(self)


# Rows that are shown, and failures; more are counted.
_ROWS, _FAILURES = 40, 12


def _columns(study):
    """({name: values of the arguments}, {name: values of the results}), with None for what is missing."""
    given = {name: [case.get(name) for case in study.cases] for name in _names(study.cases)}
    results = [x if x is None or isinstance(x, dict) else {"result": x} for x in study.results]
    results = [x or {} for x in results]
    taken = {*given, "failure"}
    found = {
        f"{name} (result)" if name in taken else name: [result.get(name) for result in results]
        for name in _names(results)
    }
    return given, found


def _names(dicts):
    return list(dict.fromkeys(name for x in dicts for name in x))


def _failures(study):
    return [study.why(i) for i in range(len(study.cases))]


def dataframe(study):
    """See `Study.to_dataframe`."""
    pandas = import_library("pandas", "to_dataframe")
    given, found = _columns(study)
    columns = {name: _series(pandas, values) for name, values in {**given, **found}.items()}
    return pandas.DataFrame({**columns, "failure": _failures(study)})


def _series(pandas, values):
    array = _filled(values)
    if array.ndim > 1 or array.dtype == object:
        array = np.empty(len(values), object)
        array[:] = values
    return pandas.Series(array)


def dataset(study):
    """See `Study.to_xarray`."""
    xarray = import_library("xarray", "to_xarray")
    given, found = _columns(study)
    if study.grid is None:
        dims, shape = ("case",), (len(study.cases),)
        coordinates = {"case": np.arange(len(study.cases))}
        coordinates |= {name: ("case", _labels(values)) for name, values in given.items()}
    else:
        dims, shape = tuple(study.grid), tuple(map(len, study.grid.values()))
        coordinates = {name: _labels(values) for name, values in study.grid.items()}
    variables = {"failure": (dims, np.array(_failures(study)).reshape(shape))}
    for name, values in found.items():
        array = _filled(values)
        if array.dtype == object and any(isinstance(value, np.ndarray) for value in values):
            raise SceneError(f"to_xarray: the arrays of '{name}' differ in shape: expected the same one in all cases")
        more = tuple(f"{name}_{k}" for k in range(array.ndim - 1))
        variables[name] = ((*dims, *more), array.reshape(*shape, *array.shape[1:]))
    return xarray.Dataset(variables, coordinates)


def _filled(values):
    """An array of values, missing ones filled with NaN or ""; of objects where they have no common type or shape."""
    known = [value for value in values if value is not None]
    kinds = {np.asarray(value).dtype.kind if _is_plain(value) else "O" for value in known}
    shapes = {np.shape(value) for value in known if _is_plain(value)}
    if not known or len(shapes) != 1 or "O" in kinds or ("U" in kinds and len(kinds) > 1):
        array = np.empty(len(values), object)
        array[:] = values
        return array if known else np.full(len(values), np.nan)
    missing = "" if kinds == {"U"} else np.nan
    filler = np.full(shapes.pop(), missing)
    return np.array([filler if value is None else value for value in values])


def _is_plain(value):
    return isinstance(value, bool | int | float | complex | str | np.ndarray)


def _labels(values):
    """Values as a coordinate: as they are where these are numbers or texts alone, else as texts."""
    array = _filled(values)
    return array if array.ndim == 1 and array.dtype != object else np.array([_label(value) for value in values])


def _label(value):
    name = getattr(value, "name", None)
    return name if isinstance(name, str) else str(value)


def as_lines(study):
    """Text: a table of cases and results, and what failed."""
    from rich.table import Table

    from cosserat_fenicsx.results.screen import as_text

    given, found = _columns(study)
    columns = given | found
    table = Table(title=f"{len(study.cases)} cases, {len(study)} done, {len(study.failures)} failed")
    table.add_column("case", justify="right")
    for name, values in columns.items():
        texts = all(isinstance(value, str | type(None)) for value in values)
        table.add_column(name, justify="left" if texts else "right")
    if study.failures:
        table.add_column("failed")
    before = -1
    for i in _shown(len(study.cases)):
        if i > before + 1:
            table.add_row(*["..."] * len(table.columns))
        before = i
        failed = ["yes" if study.why(i) else ""] if study.failures else []
        table.add_row(str(i), *(_cell(values[i]) for values in columns.values()), *failed)
    lines = [as_text(table)]
    numbers = [i for i in range(len(study.cases)) if study.why(i)]
    lines += [f"case {i} failed: {study.why(i)}" for i in numbers[:_FAILURES]]
    if len(numbers) > _FAILURES:
        lines.append(f"and {len(numbers) - _FAILURES} more: Study.failures has all")
    return "\n".join(lines)


def _shown(count):
    return [i for i in range(count) if i < _ROWS // 2 or i >= count - _ROWS // 2]


def _cell(value):
    if value is None:
        return ""
    if isinstance(value, float | complex) and not isinstance(value, bool):
        return f"{value:.6g}"
    if isinstance(value, np.ndarray):
        return f"array {value.shape}" if value.size > 4 else np.array2string(value, precision=4)
    text = _label(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
