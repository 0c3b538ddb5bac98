"""Stick-slip of a bit: when it starts and stops, the period, peaks, and how severe it is."""

from dataclasses import dataclass

import numpy as np

#: The laws hold a bit at zero exactly: one whose speed is below this share of the drive's mean speed is at rest.
AT_REST = 1e-6
#: A bit that has started reaches this share of it.
FAST = 0.5


@dataclass(frozen=True)
class StickSlip:
    """The motion of a bit between two times.

    Attributes:
        since, until: s.
        drive, mean: mean speeds of top drive and bit, rad/s, over whole periods where there are some.
        peak, least: largest and smallest speed of the bit, rad/s.
        period: mean time between two starts of the bit from rest, s; NaN where it starts fewer than twice.
        periods: (n,) those times, s. starts, stops: when the bit starts and stops, s. A bit that swings back stops
            where it ceases to turn with the drive, and starts where it does so again.
        stuck: share of the time that the bit is at rest, over whole periods where there are some.
        severity: half the range of the bit's speed over the mean speed of the drive: 0 for a steady rotation, 1 and
            more where the bit comes to rest.
        torque: (smallest, largest) surface torque, N m. bit_torque: the same at the bit.
    """

    since: float
    until: float
    drive: float
    mean: float
    peak: float
    least: float
    period: float
    periods: np.ndarray
    starts: np.ndarray
    stops: np.ndarray
    stuck: float
    severity: float
    torque: tuple[float, float]
    bit_torque: tuple[float, float]

    @property
    def sticks(self) -> bool:
        """Whether the bit comes to rest in this time, or swings back."""
        return len(self.starts) > 1 or self.stuck > 0.01

    def __str__(self):
        if max(self.peak, -self.least, abs(self.drive)) == 0:
            return f"From {self.since:g} to {self.until:g} s neither drive nor bit turns."
        rpm = 30 / np.pi
        speed = f"bit speed {self.least * rpm:.4g} to {self.peak * rpm:.4g} rpm, mean {self.mean * rpm:.4g} rpm"
        if not self.sticks:
            what = f"no stick-slip: {speed}, severity {self.severity:.3g}"
        else:
            again = "" if np.isnan(self.period) else f"period {self.period:.5g} s, "
            what = f"stick-slip: {again}{speed}, at rest {100 * self.stuck:.3g} % of the time"
        low, high = (x / 1e3 for x in self.torque)
        return f"From {self.since:g} to {self.until:g} s: {what}; surface torque {low:.4g} to {high:.4g} kN m."


def crossings(times, speed, level, fast):
    """Times (s) where a bit starts from rest, and where it comes to rest, interpolated.

    It rests up to the speed `level`. A start is the last rise above it before the speed `fast` is reached; between two
    starts it comes to rest: where it creeps, or rises and falls back, there is no start.

    Args:
        times: (n,) s; speed: (n,) rad/s; level, fast: rad/s, positive.

    Returns:
        (starts, stops). What begins above the level has no start there.
    """
    size = np.abs(speed)
    above = size > level
    k = np.flatnonzero(above[1:] != above[:-1])
    at = times[k] + (level - size[k]) / (size[k + 1] - size[k]) * (times[k + 1] - times[k])
    edges = [0, *(k + 1), len(size)]
    runs = [size[a:b].max() >= fast for a, b in zip(edges[:-1], edges[1:], strict=True)]  # between two crossings
    begins = [i for i in range(len(k)) if above[k[i] + 1] and runs[i + 1]]
    ends = [i for i in range(len(k)) if not above[k[i] + 1] and runs[i]]
    return at[begins], at[ends]


def stick_slip_of(history, since):
    """The `StickSlip` of a `DrillingHistory` from a time (s) on."""
    rows = history.times >= since
    t, bit = history.times[rows], history.bit_speed[rows]
    lengths = np.diff(t)
    drive = history.drive_speed[rows]
    usual = max(float(np.abs(drive).mean()), 1e-3)
    level = AT_REST * usual
    # a bit that swings back passes through rest between two samples: what turns against the drive has stopped, too
    forth = np.maximum(np.sign(drive.mean()) * bit, 0.0) if abs(drive.mean()) > usual / 2 else bit
    starts, stops = crossings(t, forth, level, FAST * usual)
    periods = np.diff(starts)
    whole = (t[1:] > starts[0]) & (t[1:] <= starts[-1]) if len(periods) else np.full(len(lengths), True)
    mean_drive, mean = (_mean(values, lengths * whole) for values in (drive, bit))
    slow = whole & (np.abs(bit[1:]) <= level) & (np.abs(bit[:-1]) <= level)
    torque, bit_torque = history.surface_torque[rows], history.torque_on_bit[rows]
    return StickSlip(
        float(t[0]), float(t[-1]), mean_drive, mean, float(bit.max()), float(bit.min()),
        float(periods.mean()) if len(periods) else np.nan, periods, starts, stops,
        float(lengths[slow].sum() / lengths[whole].sum()), float(np.ptp(bit) / 2 / max(abs(mean_drive), 1e-300)),
        (float(torque.min()), float(torque.max())), (float(bit_torque.min()), float(bit_torque.max())),
    )  # fmt: skip


def _mean(values, lengths):
    """Over time, by trapezoids."""
    return float((lengths @ (values[1:] + values[:-1])) / 2 / lengths.sum())
