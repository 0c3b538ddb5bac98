"""`Study`: the cases of a task, and what came of each."""

from typing import Any, NamedTuple

import numpy as np

from cosserat_fenicsx.studies import tables


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
        return tables.dataframe(self)

    def to_xarray(self) -> Any:
        """An xarray Dataset of the columns of `to_dataframe`: over the arguments where the cases are a grid, else over
        `case`. Results that are arrays have further dimensions "name_0", "name_1" ...

        Raises:
            InstallationError: xarray is missing.
            SceneError: arrays of a result differ in shape.
        """
        return tables.dataset(self)

    def __repr__(self):
        failed = f", {len(self.failures)} failed" if self.failures else ""
        return f"Study({len(self.cases)} cases, {len(self)} done{failed})"

    def __str__(self):
        return tables.as_lines(self)
