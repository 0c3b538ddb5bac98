"""A cell of the table: a number and a verdict for a method on a trial."""

import re
from dataclasses import asdict, dataclass

import numpy as np

RIGHT = "right"
SAID = "wrong and said so"
SILENT = "silently wrong"
STOPPED = "stopped"
NOT = "does not apply"
MISSING = "not installed"
#: The unit in which `numerics` of a method gives how far the clamp's quaternion is from a rotation.
NO_ROTATION = "norm of q at the clamp, less one"


@dataclass(frozen=True)
class Cell:
    """A verdict, a number (or None) with its unit, a short reason, and the computing time."""

    verdict: str
    value: float | None = None
    unit: str = ""
    note: str = ""
    seconds: float = 0.0

    def plain(self):
        """A dict for JSON, with infinity and nan as strings."""
        found = asdict(self)
        if self.value is not None and not np.isfinite(self.value):
            found["value"] = str(self.value)
        return found

    @classmethod
    def of(cls, plain):
        """The cell from the result of `plain`."""
        value = plain["value"]
        return cls(**{**plain, "value": float(value) if isinstance(value, str) else value})

    @property
    def number(self):
        """The number in a few characters."""
        return "-" if self.value is None else f"{self.value:.2g}" if abs(self.value) < 1e4 else f"{self.value:.0e}"


@dataclass(frozen=True)
class Answer:
    """The answer of a method: displacements of the tip at the load factors, (n, 3) m, nan where it has none; what it
    says of doubts, and more about it; load factors of limit points; Newton iterations; and whether it reports stability
    at each load factor, (n,) bool. The last two are None where unknown."""

    tip: np.ndarray
    said: str = ""
    note: str = ""
    events: tuple = ()
    iterations: int | None = None
    stable: np.ndarray | None = None


class Stopped(Exception):
    """The method stopped with a message; reached: the last load factor with an answer; nan if unknown."""

    def __init__(self, words, reached=np.nan):
        super().__init__(" ".join(str(words).split()))
        self.reached = reached


def load_factor_in(words):
    """The load factor named in the error message of a path; nan if there is none."""
    found = re.search(r"beyond the load factor ([-+.e\d]*\d)", str(words))
    return float(found[1]) if found else np.nan


class NotForIt(Exception):
    """The method lacks a feature that the trial needs; the message names it."""


class NotInstalled(Exception):
    """The method's program is not installed."""


class Method:
    """A column of the table, which is no part of this package.

    key, title, what: its name, its head, what it is in a sentence; own: whether it is part of this package; spatial:
    whether it supports rods that leave a plane; turn: rotation vector (rad) of the trial of objectivity; solve(problem,
    jump): an `Answer`; jump: the whole load at once. Raises Stopped, NotForIt, NotInstalled.
    """

    own, spatial, turn = False, True, (0.8, -0.6, 0.88)

    def numerics(self, key):
        """(problem, Answer, number or None, unit) of a trial about loops; raises as `solve`."""
        raise NotForIt("a matter of loops on PETSc")


def judged(error, limit, answer, unit, note=""):
    """The cell of an answer whose error may be at most `limit`."""
    if error <= limit:
        verdict = RIGHT
    else:
        verdict = SAID if answer.said else SILENT
    words = "; ".join(w for w in (note, answer.note, answer.said) if w)
    return Cell(verdict, float(error), unit, words)
