"""A cell of the map: one number of one method on one trial, and what became of it."""

import re
from dataclasses import asdict, dataclass

import numpy as np

RIGHT = "right"
SAID = "wrong and said so"
SILENT = "silently wrong"
STOPPED = "stopped"
NOT = "does not apply"
MISSING = "not installed"
VERDICTS = (RIGHT, SAID, STOPPED, SILENT, NOT, MISSING)


@dataclass(frozen=True)
class Cell:
    """A number and a verdict.

    Attributes:
        verdict: one of VERDICTS.
        value: the number; None where there is none.
        unit: of the number, in words.
        note: why, in a few words.
        seconds: that it took.
    """

    verdict: str
    value: float | None = None
    unit: str = ""
    note: str = ""
    seconds: float = 0.0

    def plain(self):
        """As JSON holds it: infinity and nan as words."""
        found = asdict(self)
        if self.value is not None and not np.isfinite(self.value):
            found["value"] = str(self.value)
        return found

    @classmethod
    def of(cls, plain):
        """The cell that `plain` was made of."""
        value = plain["value"]
        return cls(**{**plain, "value": float(value) if isinstance(value, str) else value})

    @property
    def number(self):
        """The number in a few characters."""
        return "-" if self.value is None else f"{self.value:.2g}" if abs(self.value) < 1e4 else f"{self.value:.0e}"


@dataclass(frozen=True)
class Answer:
    """What a method answers.

    Attributes:
        tip: displacements of the tip at the load factors, (n, 3) m; nan where the method has none.
        said: what the method itself says against its answer, in words; empty where it says nothing.
        note: more about the answer.
        events: load factors of the limit points it reports.
        iterations: Newton's, where they are known.
        stable: what it calls stable, by load factor, (n,) bool; None where it has no word on that.
    """

    tip: np.ndarray
    said: str = ""
    note: str = ""
    events: tuple = ()
    iterations: int | None = None
    stable: np.ndarray | None = None


class Stopped(Exception):
    """The method gave up, and said so.

    Args:
        words: its own.
        reached: the last load factor that it has an answer for; nan where nobody knows.
    """

    def __init__(self, words, reached=np.nan):
        super().__init__(" ".join(str(words).split()))
        self.reached = reached


def load_factor_in(words):
    """The load factor that was reached by a path's last words; nan where they name none."""
    found = re.search(r"beyond the load factor ([-+.e\d]*\d)", str(words))
    return float(found[1]) if found else np.nan


class NotForIt(Exception):
    """The method does not have what the trial asks for; says what."""


class NotInstalled(Exception):
    """The method's program is not here."""


def judged(error, limit, answer, unit, note=""):
    """The cell of an answer with an error that may be as large as `limit`."""
    if error <= limit:
        verdict = RIGHT
    else:
        verdict = SAID if answer.said else SILENT
    words = "; ".join(w for w in (note, answer.note, answer.said) if w)
    return Cell(verdict, float(error), unit, words)
