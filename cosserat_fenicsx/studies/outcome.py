"""`Study`: the cases of a task and their outcomes; and outcomes as data for JSON and back, to the last digit."""

import numbers
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cosserat_fenicsx.checks import File, refuse
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quantities import Quantity, Units
from cosserat_fenicsx.results import screen
from cosserat_fenicsx.results.result import Result, import_library

# Types that a task may return.
_EXPECTED = "a number, a text, an array of numbers or of texts, None, or a dict of these by name"


class Failure(NamedTuple):
    """A case without a result: `case`, its arguments, and `why`, a sentence that says what was raised."""

    case: dict[str, Any]
    why: str


class Study(Result):
    """The results of a task over many cases, from `study`; the same on all ranks.

    Attributes:
        cases: list of dicts, the arguments of each case, in their order.
        results: list, what the task returned for each case: a number, a text, an array, or a dict of these by name
            (lists have become arrays); None for a case that failed or is not computed.
        grid: {name: list of values} whose product the cases are; None where they were given one by one.
        failures: list of `Failure` (case, why), in the order of the cases.
        done: (cases,) whether each case is computed, failures included; all are, but in the `path` of an exception.
        seconds: (cases,) time that each case took on its rank, s; NaN where it is not computed.
        units: {name of an argument or a result: its unit, such as "N"}, which may be set; in other units of tables and
            charts what is not named stays as it is.
    """

    #: For messages.
    axis = _rows_axis = "case"

    def __init__(self, cases, grid, outcomes):
        self.cases: list[dict[str, Any]] = cases
        self.grid: dict[str, list[Any]] | None = grid
        self.units: dict[str, str] = {}
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

    @property
    def quantities(self) -> dict[str, Quantity]:
        """{name: `Quantity`} of the arguments, the results and `failure`, a text, "" for none."""
        given, found = _columns(self)
        columns = {**given, **found, "failure": [self.why(i) for i in range(len(self.cases))]}
        return super().quantities | {
            name: Quantity(name, name, self.units.get(name, "1"), axes=("case",), getter=lambda _, x=values: _series(x))
            for name, values in columns.items()
        }

    def to_dataframe(self, units: str | Mapping = "SI") -> Any:
        """A pandas DataFrame with a row for every case: its arguments, its results and `failure`, a text, "" for none.

        A single value is in the column `result`, the values of a dict in columns by their names ("name (result)" where
        an argument has the name). Missing values are NaN or None; an array is one entry.

        Raises:
            InstallationError: pandas is missing.
        """
        pandas = import_library("pandas", "to_dataframe")
        return pandas.DataFrame({name: pandas.Series(values) for name, values in self.columns(units).items()})

    def columns(self, units: str | Mapping = "SI", axis: str = "") -> dict[str, np.ndarray]:
        """{heading: (cases,)} as of `Result`, but with unknown columns too."""
        units, found = Units(units), {}
        for quantity in self.quantities.values():
            found |= quantity.columns(quantity.of(self), units)
        return found

    def to_xarray(self, units: str | Mapping = "SI") -> Any:
        """An xarray Dataset of the columns of `to_dataframe`: over the arguments where the cases are a grid, else over
        `case`. Results that are arrays have further dimensions "name_0", "name_1" ...

        Raises:
            InstallationError: xarray is missing.
            SceneError: arrays of a result differ in shape.
        """
        xarray, units = import_library("xarray", "to_xarray"), Units(units)
        given, found = _columns(self)
        known, failures = self.quantities, [self.why(i) for i in range(len(self.cases))]

        def shown(name, array):
            unit, size = units.of(known[name])
            return array if size == 1.0 else array / size, {"units": unit}

        if self.grid is None:
            dims, shape = ("case",), (len(self.cases),)
            coordinates = {"case": np.arange(len(self.cases))}
            coordinates |= {name: ("case", *shown(name, _labels(values))) for name, values in given.items()}
        else:
            dims, shape = tuple(self.grid), tuple(map(len, self.grid.values()))
            coordinates = {name: (name, *shown(name, _labels(values))) for name, values in self.grid.items()}
        variables = {"failure": (dims, np.array(failures).reshape(shape))}
        for name, values in found.items():
            array = _filled(values)
            if array.dtype == object and any(isinstance(value, np.ndarray) for value in values):
                raise SceneError(f"to_xarray: the arrays of '{name}' differ in shape: expected one in all cases")
            more = tuple(f"{name}_{k}" for k in range(array.ndim - 1))
            array, about = shown(name, array)
            variables[name] = ((*dims, *more), array.reshape(*shape, *array.shape[1:]), about)
        return xarray.Dataset(variables, coordinates)

    def plot(self, file: File | None = None, name: str | None = None, *, units: str | Mapping = "SI",
             width: int | None = None):  # fmt: skip
        """Chart of a result over the first argument that is a number; see `plot_quantity`.

        Args:
            name: of the result; None for the first that is a number.
        """
        known = [x for x, values in _columns(self)[1].items() if _series(values).dtype.kind in "fi"]
        if name is None and not known:
            raise SceneError("plot: expected a study with a result that is a number for each case")
        return self.plot_quantity(name or known[0], file, units=units, width=width)

    def __repr__(self):
        failed = f", {len(self.failures)} failed" if self.failures else ""
        return f"Study({len(self.cases)} cases, {len(self)} done{failed})"

    def _answer(self, units):
        yield f"{len(self.cases)} cases, {len(self)} done, {len(self.failures)} failed"
        failed = [i for i in range(len(self.cases)) if self.why(i)]
        yield from (f"case {i} failed: {self.why(i)}" for i in failed[:_FAILURES])
        if len(failed) > _FAILURES:
            yield f"and {len(failed) - _FAILURES} more: Study.failures has all"

    def _table(self, units, rows):
        count, known = len(self.cases), self.quantities
        given = [(Quantity("case"), np.arange(count))]
        for name, quantity in known.items():
            values = quantity.of(self)
            if name == "failure":
                quantity, values = Quantity("failed"), ["yes" if text else "" for text in values]
            elif values.dtype.kind not in "fi":
                values = [_cell(x) for x in values]
            if name != "failure" or self.failures:
                given.append((quantity, values))
        half = max(rows // 2, 1)
        return screen.table(given, units, rows, which=[i for i in range(count) if i < half or i >= count - half])


# Failures that are listed; more are counted.
_FAILURES = 12


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


def _series(values):
    """(n,) values as numbers or texts, or as objects."""
    array = _filled(values)
    return _objects(values) if array.ndim > 1 else array


def _objects(values):
    array = np.empty(len(values), object)
    array[:] = values
    return array


def _filled(values):
    """An array of values, missing ones filled with NaN or ""; of objects where they have no common type or shape."""
    known = [value for value in values if value is not None]
    kinds = {np.asarray(value).dtype.kind if _is_plain(value) else "O" for value in known}
    shapes = {np.shape(value) for value in known if _is_plain(value)}
    if not known or len(shapes) != 1 or "O" in kinds or ("U" in kinds and len(kinds) > 1):
        return _objects(values) if known else np.full(len(values), np.nan)
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


def _cell(value):
    if value is None:
        return ""
    if isinstance(value, float | complex) and not isinstance(value, bool):
        return f"{value:.6g}"
    if isinstance(value, np.ndarray):
        return f"array {value.shape}" if value.size > 4 else np.array2string(value, precision=4)
    text = _label(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def to_data(result):
    """A task's result as data, or a SceneError where it is none of what a task may return."""
    if isinstance(result, dict):
        for name in result:
            if not isinstance(name, str):
                refuse("study", "task", name, "names of results that are texts")
        return {"dict": {name: _of_value(value) for name, value in result.items()}}
    return _of_value(result)


def from_data(data):
    """The result of `to_data`; lists have become arrays."""
    if not isinstance(data, dict):
        return data
    if "dict" in data:
        return {name: from_data(value) for name, value in data["dict"].items()}
    if "number" in data:
        return complex(*data["number"])
    flat = np.array(data["array"], dtype=data["dtype"])
    return (flat.view(complex) if data["complex numbers"] else flat).reshape(data["shape"])


def _of_value(value):
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        value = value.item()
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, complex):
        return {"number": [value.real, value.imag]}
    if isinstance(value, numbers.Real):  # such as a fraction
        return float(value)
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        array = np.asarray(None)
    masked = isinstance(value, np.ma.MaskedArray)  # whose mask would be lost
    if masked or not isinstance(value, np.ndarray | list | tuple) or array.dtype.kind not in "biufcU":
        refuse("study.task", "result", value, _EXPECTED)
    flat, pairs = array.ravel(), array.dtype.kind == "c"
    if pairs:
        flat = flat.astype(complex).view(float)
    elif array.dtype.kind == "f" and array.itemsize > 8:
        flat = flat.astype(float)
    return {"array": flat.tolist(), "dtype": flat.dtype.str, "shape": array.shape, "complex numbers": pairs}
