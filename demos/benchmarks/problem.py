"""What a published problem is: its source and input, the published numbers, ours, and a picture."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

#: The published problems by name, in the order of their registration.
PROBLEMS = {}


@dataclass(frozen=True)
class Row:
    """One published number beside ours.

    Attributes:
        quantity: its name and unit, such as "tip displacement u_z, m".
        published: as printed in the source; an array for several values of one quantity.
        ours: the same as this package finds it.
        estimate: its estimate of the error of `ours`, in the unit of the quantity; 0 where a formula is evaluated.
        allowed: what |ours - published| is at most.
        because: why they may differ by this much, such as "digits printed" or "measured; clamp not rigid".
    """

    quantity: str
    published: float | np.ndarray
    ours: float | np.ndarray
    estimate: float | np.ndarray
    allowed: float | np.ndarray
    because: str

    @property
    def difference(self):
        """ours - published, of the value where it is largest against what is allowed."""
        differences = np.atleast_1d(np.subtract(self.ours, self.published))
        return float(differences[np.argmax(np.abs(differences) / self.allowed)])

    @property
    def agrees(self):
        """Whether every value is within what is allowed."""
        return bool(np.all(np.abs(np.subtract(self.ours, self.published)) <= self.allowed))


@dataclass(frozen=True)
class Problem:
    """A published problem.

    Attributes:
        name: of its function. title: in the table.
        chapter: "statics", "stability", "motion", "wells" or "drilling".
        source: authors, year, journal, DOI or public file, as a reader finds it.
        given: the input in one line: geometry, section, load.
        remark: what a reader has to know, as where another code or a measurement is better; "" for nothing.
        solve: returns (rows, draw): the `Row`s, and a function that writes a picture into a .png file.
    """

    name: str
    title: str
    chapter: str
    source: str
    given: str
    remark: str
    solve: Callable


def problem(title, chapter, source, given, remark=""):
    """Register a function as the solution of a published problem; it returns (rows, draw) as `Problem.solve` does."""

    def register(solve):
        PROBLEMS[solve.__name__] = Problem(solve.__name__, title, chapter, source, given, remark, solve)
        return solve

    return register
