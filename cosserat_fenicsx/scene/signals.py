"""Vectors that depend on time, or change along a rod: any function, and the usual ones as classes.

A load or a prescribed motion takes a vector, one of the classes below, or a function of time (s) that returns a vector,
with `jumps` at the times where it is not smooth: time steps end there. The attribute `straight` marks functions that
are linear between their jumps, and resolved by steps of any length.

Vectors that change along a rod, for distributed loads, have classes of their own (`Along`, `AlongTable`,
`AlongPieces`), so that a function of the arc length cannot be taken for one of time.
"""

import itertools
import math
import numbers
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import PurePath
from typing import Annotated

import numpy as np

from cosserat_fenicsx.checks import (
    File,
    Numbers,
    Rows,
    call,
    finite_array,
    name_of,
    number,
    refuse,
    store,
    text_of,
    vector,
)
from cosserat_fenicsx.quantities import LARGEST
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.kinds import Either
from cosserat_fenicsx.numerics import jump_of
from cosserat_fenicsx.parts import FileName, FunctionAlong, FunctionOfTime, Limits, Number

_Time = Annotated[float, Number("time", Limits(what="a time"))]


class _Timed(FunctionOfTime):
    """Base of functions of time that are smooth but at the times of their fields `start`, `peak` and `end`, s."""

    def validate(self):
        if not isinstance(self.value, tuple | list | np.ndarray | str | numbers.Real) or isinstance(self.value, bool):
            refuse(self, "value", self.value, "a vector, such as (0, 0, 1), or a number")
        for (_, before), (field, after) in itertools.pairwise(self._times.items()):
            if after <= before:
                refuse(self, field, after, f"a time after {before:g} s")

    @property
    def _times(self):
        given = {field: getattr(self, field, None) for field in ("start", "peak", "end")}
        return {field: t for field, t in given.items() if t is not None}

    @property
    def jumps(self):
        """Where it is not smooth, s."""
        return tuple(self._times.values())

    def _acts(self, t):
        return self.start <= t and (self.end is None or t < self.end)

    def _share(self, t):
        """The share of the time from `start` to `end` that has passed at t, in [0, 1]."""
        return min(max((t - self.start) / (self.end - self.start), 0.0), 1.0)


@dataclass(frozen=True)
class Step(_Timed):
    """`value` from `start` up to `end`, or without end; zero otherwise. Times in s.

    Raises:
        SceneError: numbers that are not finite, or an end that is not after the start.
    """

    value: Numbers
    start: _Time = 0.0
    end: _Time | None = None

    straight = True

    def __call__(self, t: float) -> tuple:
        """The vector at t."""
        return _times(self._acts(t), self.value)


@dataclass(frozen=True)
class Ramp(_Timed):
    """Zero up to `start`, linear from there, `value` from `end` on. Times in s.

    Raises:
        SceneError: numbers that are not finite, or an end that is not after the start.
    """

    value: Numbers
    start: _Time = 0.0
    end: _Time = 1.0

    straight = True

    def __call__(self, t: float) -> tuple:
        """The vector at t."""
        return _times(self._share(t), self.value)


@dataclass(frozen=True)
class RunUp(_Timed):
    """A smooth start of a motion with constant speed: zero up to `start`, the rate of change `value` (per s) from `end`
    on.

    In between the acceleration is value/T (1 - cos(2 pi (t - start)/T)), T = end - start, which is continuous with its
    first derivative. Times in s.

    After Kane, Ryan & Banerjee, J. Guid. Control Dyn. 10 (1987) 139, doi:10.2514/3.20195.

    Raises:
        SceneError: numbers that are not finite, or an end that is not after the start.
    """

    value: Numbers
    start: _Time = 0.0
    end: _Time = 1.0

    def __call__(self, t: float) -> tuple:
        """The vector at t."""
        x = self._share(t)
        ran = x * x / 2 + (math.cos(2 * math.pi * x) - 1) / (2 * math.pi) ** 2
        return _times((self.end - self.start) * ran + max(t - self.end, 0.0), self.value)


@dataclass(frozen=True)
class Triangle(_Timed):
    """Linear from zero at `start` to `value` at `peak` and back to zero at `end`; zero otherwise. Times in s.

    Raises:
        SceneError: numbers that are not finite, or times that do not ascend.
    """

    value: Numbers
    start: _Time = 0.0
    peak: _Time = 1.0
    end: _Time = 2.0

    straight = True

    def __call__(self, t: float) -> tuple:
        """The vector at t."""
        up, down = (t - self.start) / (self.peak - self.start), (self.end - t) / (self.end - self.peak)
        return _times(max(min(up, down), 0.0), self.value)


@dataclass(frozen=True)
class Sine(_Timed):
    """`value` times sin(2 pi frequency (t - start) + phase) from `start` up to `end`, or without end; zero otherwise.

    Args:
        value: amplitude; frequency: Hz; phase: rad; start, end: s.

    Raises:
        SceneError: numbers that are not finite, or an end that is not after the start.
    """

    value: Numbers
    frequency: float
    phase: float = 0.0
    start: _Time = 0.0
    end: _Time | None = None

    def __call__(self, t: float) -> tuple:
        """The vector at t."""
        wave = math.sin(2 * math.pi * self.frequency * (t - self.start) + self.phase)
        return _times(self._acts(t) and wave, self.value)


@dataclass(frozen=True)
class Table(FunctionOfTime):
    """Piecewise linear between the rows of a table; constant before the first and after the last.

    Args:
        times: (n,) ascending, s; values: (n, 3).

    Raises:
        SceneError: times that do not ascend, or not one value for each.
    """

    times: Numbers
    values: Rows

    straight = True

    def __post_init__(self):
        if isinstance(self.times, list | tuple) and any(isinstance(t, str) for t in self.times):
            times = [number(self, f"times[{i}]", t, "a time (s)", math.isfinite) for i, t in enumerate(self.times)]
            store(self, times=tuple(times))
        times = _ascending(self, "times", "ascending times (s)")
        rows = self.values
        if not _as_text(rows):
            rows = _numbers_of(self, "values", rows, "finite numbers, one row a time")
        ragged = _as_text(rows) and len({len(x) if isinstance(x, list | tuple) else 0 for x in rows}) > 1
        if ragged or np.ndim(rows) not in (1, 2) or len(rows) != len(times):
            refuse(self, "values", self.values, f"one vector for each of the {len(times)} times")

    @property
    def jumps(self):
        """Where it is not smooth, s."""
        return tuple(float(t) for t in self.times)

    def __call__(self, t: float) -> tuple:
        """The vector at t."""
        times, columns = self._numbers
        return tuple(float(np.interp(t, times, column)) for column in columns)

    @cached_property
    def _numbers(self):
        """(times, columns) as arrays, converted once, since long tables are evaluated often."""
        return np.array(self.times, dtype=float), np.array(
            np.atleast_2d(np.transpose(self.values)), dtype=float, order="C"
        )


def _as_text(rows):
    """Whether rows of a table contain text with units, which the owner of the table converts."""
    if not isinstance(rows, list | tuple):
        return False
    return any(isinstance(x, str) for row in rows for x in (row if isinstance(row, list | tuple) else (row,)))


def _ascending(owner, field, expected):
    """The array (n,) of a field that holds ascending numbers."""
    given = getattr(owner, field)
    array = _numbers_of(owner, field, given, expected)
    if array.ndim != 1 or not len(array) or not (np.diff(array) > 0).all():
        refuse(owner, field, given, expected)
    return array


def _numbers_of(owner, field, given, expected):
    """An array of finite numbers, also of those that a data frame of mixed columns or a list of fractions holds."""
    try:
        given_as_floats = np.asarray(given, dtype=float)
    except (OverflowError, TypeError, ValueError):
        refuse(owner, field, given, expected)
    return finite_array(owner, field, given_as_floats, expected)


def _times(factor, value):
    return tuple(float(factor) * x for x in (value if np.ndim(value) else (value,)))


@dataclass(frozen=True)
class Signal:
    """A checked function of time in a field of a load or a support.

    Args:
        owner: the name of the class of the load or support; field, unit: for error messages.
        function: of t (s), returns `size` numbers.
        jumps: times where it is not smooth, s.
        place: where its load or support acts, for error messages.
        inner: the `Kind` of its values, which knows their limits.
    """

    owner: str
    field: str
    unit: str
    function: object
    jumps: tuple
    size: int = 3
    place: str = ""
    inner: object = None

    def as_data(self):
        """Its form in stored data: the function."""
        return self.function

    def __call__(self, t: float) -> tuple:
        """The vector at t, s. Raises SceneError: the function raised, or returned another number of values, values that
        are not finite, or outside the limits of the field; the message gives the time."""
        when = f"at the time t = {t:g} s" + (f", of the {self.owner} at {self.place}" if self.place else "")
        given = call(self.function, t, f"{self.owner}.{self.field}: its function", f", {when}")
        given = (given,) if self.size == 1 and isinstance(given, numbers.Real) else given
        limits = getattr(self.inner, "limits", None)
        floats = type(given) is tuple and all(type(x) is float and abs(x) <= LARGEST for x in given)
        floats = floats and (limits is None or all(map(limits.admit, given)))
        if floats and len(given) == self.size:
            return given  # the usual case; the full check takes ten times as long
        try:
            found = vector(self.owner, self.field, given, self.unit, self.size)
            return found if limits is None else (self.inner.check(self.owner, self.field, found[0]),)
        except SceneError as problem:
            raise SceneError(f"{problem}, {when}") from None


@dataclass(frozen=True)
class VectorInTime(Either):
    """Numbers of a dimension, three or one; or, with `functions`, a function of time, with the `jumps` of its owner;
    or, with `FunctionAlong` among the classes, one of the arc length of the `rod` of its owner."""

    functions: bool = True

    def check(self, owner, field, value):
        if self.classes and isinstance(value, str | PurePath):
            refuse(owner, field, value, f"a vector, or AlongTable({str(value)!r}) for a file of s and three components")
        if isinstance(value, self.classes):
            self._refuse_jumps(owner, field)
            if not isinstance(owner.rod, str):  # `Scene` looks a name up
                value.check(owner.rod.length)
            return value
        if self.functions and callable(value):
            return self._signal(owner, field, value)
        if not any(map(callable, vars(owner).values())):  # jumps of another field
            self._refuse_jumps(owner, field)
        return self.inner.check(owner, field, value)

    def _signal(self, owner, field, function):
        unit = self.inner.unit or Number(self.inner.dimension).unit
        if isinstance(function, FunctionOfTime):
            function = function.in_units(lambda x: number(owner, field, x, f"a number ({unit})", math.isfinite))
        if not isinstance(owner.jumps, tuple | list):
            refuse(owner, "jumps", owner.jumps, "a list of times (s)")
        given = [number(owner, "jumps", t, "finite times (s)", math.isfinite) for t in owner.jumps]
        store(owner, jumps=tuple(given))
        jumps = tuple(sorted({float(t) for t in (*getattr(function, "jumps", ()), *given)}))
        place = getattr(owner, "station", None) or getattr(owner, "rod", None)
        place = str(getattr(place, "name", place) or "")
        size = getattr(self.inner, "size", 1)
        signal = Signal(type(owner).__name__, field, unit, function, jumps, size, place, self.inner)
        signal(0.0)
        return signal

    def _refuse_jumps(self, owner, field):
        if len(owner.jumps):
            refuse(owner, "jumps", owner.jumps, f"none, since {field} does not depend on time")


def signals_of(item):
    """{field: `Signal`} of a load or a support."""
    return {name: value for name, value in vars(item).items() if isinstance(value, Signal)}


def at(item, t):
    """A load or a support with its values at the time t (s); unchanged where it does not depend on time."""
    return with_values(item, values_at(item, t))


def values_at(item, t):
    """{field: value} at the time t (s) of the time-dependent fields of a load or a support."""
    return {name: signal(t) for name, signal in signals_of(item).items()}


def with_values(item, values):
    """A load or a support with `values_at` a time, which it has from then on."""
    if not values:
        return item
    other = object.__new__(type(item))  # not by its constructor, whose checks take longer than a signal's own
    vars(other).update(vars(item), **values, jumps=())
    return other


def sample_times(item, until):
    """Sample times (s) up to `until` for checks of a load or a support: its jumps, the midpoints between them, and
    times spread logarithmically; only 0 if it does not depend on time."""
    signals = signals_of(item)
    if not signals:
        return [0.0]
    jumps = {t for signal in signals.values() for t in signal.jumps if 0 < t < until}
    marks = [0.0, *sorted(jumps), until]
    between = [(a + b) / 2 for a, b in itertools.pairwise(marks)]
    return [*marks, *between, *(until * np.geomspace(1e-4, 1, 30)[:-1]).tolist()]


# Elements end at the rows of tables of up to this length. Longer ones have kinks inside elements.
_MOST_BREAKS = 64


def vector_at(owner, field, function, s, unit, size=3):
    """The vector that a user's function of the arc length returns at s, m; its errors become `SceneError`s."""
    given = call(function, s, f"{name_of(owner)}.{field}", " at s = {:g} m")
    return vector(owner, f"{field}({s:g})", given, unit, size)


@dataclass(frozen=True)
class Along(FunctionAlong):
    """A function of the arc length.

    Args:
        function: s (m) -> three numbers, inertial; smooth: one that jumps is refused, and where it has a kink in
            elements, errors are estimated as smaller than they are.
    """

    function: Callable[[float], Numbers]
    breaks = kinks = ()  # smooth

    def validate(self):
        if not callable(self.function):
            refuse(self, "function", self.function, "a function of the arc length s (m)")

    def __call__(self, s):
        """(n, 3) at arc lengths s (n,), m. Raises SceneError: the function raised, or returned something else than
        three finite numbers."""
        values = [vector_at("Along", "function", self.function, x, "per length") for x in np.asarray(s, float).tolist()]
        return np.array(values).reshape(-1, 3)

    def check(self, length):
        """Refuse a function that jumps in [0, length], m, as samples tell; raises SceneError as a call does, too."""
        if (s := jump_of(self, 0.0, length, alike=True)) is not None:
            raise SceneError(
                f"Along: its function jumps at s = {s:.6g} m: expected AlongPieces, or an AlongTable with two rows "
                "close to it, at which elements end"
            )


@dataclass(frozen=True)
class AlongTable(FunctionAlong):
    """Piecewise linear between the rows of a table; constant before the first and after the last.

    Args:
        s: (n,) ascending arc lengths, m; or the name of a .csv file of four columns, s and the three components.
        values: (n, 3), inertial; None with a file.

    Raises:
        SceneError: arc lengths that do not ascend, not one vector per arc length, or a file that cannot be read.
    """

    s: Annotated[Numbers | File, FileName()]
    values: Rows | None = None

    def __post_init__(self):
        if self.values is None:
            table = read_table(self, "s", self.s, 4, "four columns, s (m) and three components")
            store(self, s=table[:, 0], values=table[:, 1:])
        s = _ascending(self, "s", "ascending arc lengths (m)")
        expected = f"three finite numbers for each of the {len(s)} arc lengths"
        values = _numbers_of(self, "values", self.values, expected)
        if values.shape != (len(s), 3):
            refuse(self, "values", self.values, expected)
        store(self, s=tuple(s.tolist()), values=tuple(map(tuple, values.tolist())))

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
class AlongPieces(FunctionAlong):
    """Piecewise constant.

    Args:
        pieces: (s_end, vector) in order from the start of the rod, s_end in m; after the last it is zero.

    Raises:
        SceneError: ends that do not ascend, or vectors that are not three finite numbers.
    """

    pieces: Sequence[tuple[float, Numbers]]
    kinks = ()

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
        store(self, pieces=tuple(kept))

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


def values_of(value, s):
    """(3,) or (n, 3) numbers of a vector or of a function of the arc length at s (n,), m."""
    return value(s) if isinstance(value, FunctionAlong) else value


def read_table(owner, field, file, columns, expected):
    """The numbers (n, columns) of a .csv file without a heading; owner, field: what has the file, for messages;
    expected: the columns in words, their number first."""
    where = f"{name_of(owner)}.{field} = {str(file)!r}"
    try:
        table = np.loadtxt(text_of(file, f"{expected}, as .csv").splitlines(), delimiter=",", comments="#", ndmin=2)
    except ValueError as problem:
        raise SceneError(
            f"{where}: cannot be read ({problem}): expected a .csv file of {expected}; no heading but lines that begin "
            "with #"
        ) from None
    if table.shape[1] != columns:
        raise SceneError(f"{where}: {table.shape[1]} columns: expected {expected}")
    return table
