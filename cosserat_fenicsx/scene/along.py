"""Vectors that change along a rod, for distributed loads.

They have classes of their own, so that a function of the arc length cannot be taken for one of time.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath

import numpy as np

from cosserat_fenicsx.checks import File, Numbers, Rows, call, number, refuse, text_of, vector
from cosserat_fenicsx.errors import SceneError

# Elements end at the rows of tables of up to this length. Longer ones have kinks inside elements.
_MOST_BREAKS = 64
_SAMPLES = 33


@dataclass(frozen=True)
class Along:
    """A function of the arc length.

    Args:
        function: s (m) -> three numbers, inertial; smooth.
    """

    function: Callable[[float], Numbers]

    breaks = ()

    def __post_init__(self):
        if not callable(self.function):
            refuse(self, "function", self.function, "a function of the arc length s (m)")

    def __call__(self, s):
        """(n, 3) at arc lengths s (n,), m.

        Raises:
            SceneError: the function raised, or returned something else than three finite numbers.
        """
        values = []
        for x in np.asarray(s, dtype=float).tolist():
            given = call(self.function, x, "Along.function", f" at s = {x:g} m")
            values.append(vector("Along", f"function({x:g})", given, "per length"))
        return np.array(values).reshape(-1, 3)

    def check(self, length):
        """Evaluate it at samples in [0, length], m; raises SceneError as a call does."""
        self(np.linspace(0, length, _SAMPLES))


@dataclass(frozen=True)
class AlongTable:
    """Piecewise linear between the rows of a table; constant before the first and after the last.

    Args:
        s: (n,) ascending arc lengths, m; or the name of a .csv file of four columns, s and the three components.
        values: (n, 3), inertial; None with a file.

    Raises:
        SceneError: arc lengths that do not ascend, not one vector per arc length, or a file that cannot be read.
    """

    s: Numbers | File = field(metadata={"file": True})
    values: Rows | None = None

    def __post_init__(self):
        s, values = self.s, self.values
        if values is None:
            table = _read(s)
            s, values = table[:, 0], table[:, 1:]
        try:
            s, values = np.asarray(s, dtype=float), np.asarray(values, dtype=float)
        except (ValueError, TypeError):
            refuse(self, "values", self.values, "finite numbers, one row an arc length")
        if s.ndim != 1 or not len(s) or not np.isfinite(s).all() or not (np.diff(s) > 0).all():
            refuse(self, "s", self.s, "ascending arc lengths (m)")
        if values.shape != (len(s), 3) or not np.isfinite(values).all():
            refuse(self, "values", self.values, f"three finite numbers for each of the {len(s)} arc lengths")
        object.__setattr__(self, "s", tuple(s.tolist()))
        object.__setattr__(self, "values", tuple(map(tuple, values.tolist())))

    @property
    def breaks(self):
        """Where it is not smooth, m."""
        return self.s if len(self.s) <= _MOST_BREAKS else ()

    @property
    def kinks(self):
        """Where it is not smooth inside elements, m."""
        return () if self.breaks else self.s

    def __call__(self, s):
        """(n, 3) at arc lengths s (n,), m."""
        return np.column_stack([np.interp(s, self.s, column) for column in zip(*self.values, strict=True)])

    def check(self, length):
        """Refuse a table whose range does not overlap [0, length], m."""
        if self.s[-1] < 0 or self.s[0] > length:
            refuse(self, "s", self.s, f"arc lengths along the rod, from 0 to {length:g} m")


@dataclass(frozen=True)
class AlongPieces:
    """Piecewise constant.

    Args:
        pieces: (s_end, vector) in order from the start of the rod, s_end in m; after the last it is zero.

    Raises:
        SceneError: ends that do not ascend, or vectors that are not three finite numbers.
    """

    pieces: Sequence[tuple[float, Numbers]]

    def __post_init__(self):
        if not isinstance(self.pieces, list | tuple) or not self.pieces:
            refuse(self, "pieces", self.pieces, "a list of (s_end, vector)")
        kept, before = [], 0.0
        for i, piece in enumerate(self.pieces):
            if not isinstance(piece, list | tuple) or len(piece) != 2:
                refuse(self, f"pieces[{i}]", piece, "(s_end, vector)")
            end = number(self, f"pieces[{i}]", piece[0], f"an arc length above {before:g} m first",
                         lambda x, before=before: before < x < math.inf)  # fmt: skip
            kept.append((end, vector(self, f"pieces[{i}]", piece[1], "per length")))
            before = end
        object.__setattr__(self, "pieces", tuple(kept))

    @property
    def breaks(self):
        """Where it jumps, m."""
        return tuple(end for end, _ in self.pieces)

    def __call__(self, s):
        """(n, 3) at arc lengths s (n,), m."""
        values = np.array([*(value for _, value in self.pieces), (0.0, 0.0, 0.0)])
        return values[np.searchsorted(self.breaks, s, side="left")]

    def check(self, length):
        """Pieces fit any length."""


#: Functions of the arc length in scene files, and all functions of the arc length.
ALONG = (AlongTable, AlongPieces)
FUNCTIONS_ALONG = (Along, *ALONG)
FunctionAlong = Along | AlongTable | AlongPieces


def along_or_vector(owner, field, value, rod):
    """`value` where it is a function of the arc length, checked along the rod; None where it is something else."""
    if isinstance(value, str | PurePath):
        refuse(owner, field, value, f"a vector, or AlongTable({str(value)!r}) for a file of s and three components")
    if not isinstance(value, FUNCTIONS_ALONG):
        return None
    if len(owner.jumps):
        refuse(owner, "jumps", owner.jumps, f"none, since {field} does not depend on time")
    if not isinstance(rod, str):  # `Scene` looks a name up
        value.check(rod.length)
    return value


def values_of(value, s):
    """(3,) or (n, 3) numbers of a vector or of a function of the arc length at s (n,), m."""
    return value(s) if isinstance(value, FUNCTIONS_ALONG) else value


def breaks_of(value):
    """Arc lengths (m) where a vector or a function of the arc length is not smooth."""
    return getattr(value, "breaks", ()) if isinstance(value, FUNCTIONS_ALONG) else ()


def kinks_of(value):
    """Arc lengths (m) where a function of the arc length is not smooth, though elements need not end there."""
    return getattr(value, "kinks", ()) if isinstance(value, FUNCTIONS_ALONG) else ()


def _read(file):
    text = text_of(file, "arc lengths and vectors as .csv")
    try:
        table = np.loadtxt(text.splitlines(), delimiter=",", comments="#", ndmin=2)
    except ValueError as problem:
        raise SceneError(
            f"AlongTable.s = {str(file)!r}: cannot be read ({problem}): expected arc lengths (m), or a .csv file of "
            "four columns, s (m) and three components, no heading but lines that begin with #"
        ) from None
    if table.shape[1] != 4:
        raise SceneError(
            f"AlongTable.s = {str(file)!r}: {table.shape[1]} columns: expected four, s (m) and three components"
        )
    return table
