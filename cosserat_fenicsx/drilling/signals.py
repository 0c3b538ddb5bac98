"""Speeds of drive and hook over time: values, means over steps, and steps cut at jumps."""

import itertools
import math
import numbers

import numpy as np

from cosserat_fenicsx import units
from cosserat_fenicsx.checks import call, number, refuse, warn

# Speeds (rad/s) above this are probably revolutions a minute: 300 rev/min are 31.4 rad/s.
_FAST = 32.0
# Time (s) up to which a signal that is smooth is looked at for its largest value.
_LONG = 600.0


def doubt_speed(owner: object, field: str, speed: float) -> None:
    """Warn of a speed of a drive (rad/s) that looks like revolutions a minute; `owner`: the part or function's name."""
    if abs(speed) > _FAST:
        name = owner if isinstance(owner, str) else type(owner).__name__
        warn(
            f"{name}.{field} = {speed:g} rad/s are {speed / units.rpm:.0f} rev/min, faster than drives turn a string: "
            f"{speed:g} rev/min are {speed * units.rpm:.4g} rad/s, or '{speed:g} rpm'"
        )


def doubt_decay(owner: object, speed: float | None, most: float = 15.0, unit: str = "rad/s") -> None:
    """Warn of a speed of decay that looks like revolutions a minute, or like a slip (m/s) that no string has."""
    if speed is not None and speed > most:
        rate = f"'{speed:g} rpm', {speed * units.rpm:.3g} rad/s"
        rate += "" if unit == "rad/s" else ", with of_rotation=True"
        warn(
            f"{type(owner).__name__}.speed = {speed:g} {unit} is faster than friction at rest fades, at 0.1 to 10 "
            f"rad/s of a bit and below 2 m/s of slip: {speed:g} rev/min are {rate}"
        )


class ScalarSignal:
    """A number at every time (s), from a number or from a function of time. jumps: times where it is not smooth, s;
    time steps end there; constant: whether it is a number."""

    def __init__(self, owner, field, value, unit):
        self._where, self.unit = f"{type(owner).__name__}.{field}", unit
        self.constant = isinstance(value, numbers.Real) and not isinstance(value, bool)
        if self.constant:
            value = number(owner, field, value, f"a finite number ({unit})", math.isfinite)
        elif not callable(value):
            refuse(owner, field, value, f"a number ({unit}) or a function of time that gives one")
        self._value, self.jumps = value, tuple(sorted(float(t) for t in getattr(value, "jumps", ())))

    def __call__(self, t: float) -> float:
        if self.constant:
            return self._value
        given = call(self._value, t, self._where, " at t = {:g} s")
        if type(given) is float and math.isfinite(given):  # what follows takes as long as the function
            return given
        found = np.asarray(given).reshape(-1) if np.size(given) == 1 else np.array([np.nan])
        if found.dtype.kind not in "biuf" or not np.isfinite(found).all():
            refuse(self._where.split(".")[0], self._where.split(".")[1], given, f"a finite number ({self.unit}) at "
                   f"t = {t:g} s")  # fmt: skip
        return float(found[0])

    @property
    def largest(self) -> float:
        """The largest value up to the last time at which it is not smooth, or up to 600 s."""
        if self.constant:
            return self._value
        # at times that are no multiples of any period
        times = max(self.jumps, default=_LONG) * (np.arange(2001) * (math.sqrt(5) - 1) / 2 % 1)
        return max(self(t) for t in (*self.jumps, *times.tolist()))

    def jump(self, t: float) -> float:
        """The height of the jump at a time, from the values just before and just after it."""
        if self.constant:
            return 0.0
        near = 1e-9 * max(1.0, abs(t))
        return self(t + near) - self(t - near)

    def mean(self, start: float, end: float) -> float:
        """The mean from one time to another, by Gauss's two points between jumps."""
        if self.constant:
            return self._value
        total, cuts = 0.0, [start, *(t for t in self.jumps if start < t < end), end]
        for a, b in itertools.pairwise(cuts):
            middle, off = (a + b) / 2, (b - a) / (2 * 3**0.5)
            total += (b - a) * (self(middle - off) + self(middle + off)) / 2
        return total / (end - start)


def means(signal, first: int, steps: int, dt: float) -> np.ndarray:
    """(steps,) means of a signal over steps of dt (s), from one of a number on."""
    if signal.constant:
        return np.full(steps, signal(0.0))
    return np.array([signal.mean(n * dt, (n + 1) * dt) for n in range(first, first + steps)])


def intervals(signals, steps, dt):
    """Rows (length, signals at the begin, signals at the end, 1 where a step ends) of steps, cut at jumps. signals: a
    list of `ScalarSignal`. steps: (first, last + 1). dt: s."""
    first, last = steps
    times, n = np.arange(first, last + 1) * dt, len(signals)
    jumps = {t for signal in signals for t in signal.jumps if times[0] <= t < times[-1]}
    near, ends = 1e-9 * dt, np.ones(len(times) - 1)
    if inner := sorted(t for t in jumps if np.abs(times - t).min() > near):
        times = np.sort(np.concatenate([times, inner]))
        ends = np.ones(len(times) - 1)
        ends[np.searchsorted(times, inner) - 1] = 0.0
    rows = np.empty((len(times) - 1, 2 + 2 * n))
    lengths = times[1:] - times[:-1]
    lengths[(ends == 1.0) & (np.abs(lengths - dt) <= 1e-8 + near)] = dt
    rows[:, 0], rows[:, -1] = lengths, ends
    for i, signal in enumerate(signals):
        if signal.constant:
            rows[:, 1 + i] = rows[:, 1 + n + i] = signal(0.0)
            continue
        before = np.array([signal(t) for t in times])
        after = before.copy()
        for j in np.flatnonzero([any(abs(t - x) <= near for x in jumps) for t in times]) if jumps else ():
            before[j], after[j] = signal(times[j] - 1e-6 * dt), signal(times[j] + 1e-6 * dt)
        rows[:, 1 + i], rows[:, 1 + n + i] = after[:-1], before[1:]
    return rows
