"""Starts, stops, period and peaks of the motion of a bit, and their errors by the time step."""

from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cosserat_fenicsx.drilling.protocol import SERIES
from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.quantities import Quantity, Units, as_text

SPEED, TORQUE = Quantity("speed", unit="rad/s", shown="rpm"), Quantity("torque", unit="N m", shown="kN m")
WEIGHT = Quantity("weight on bit", unit="N", shown="kN")
#: A bit below this share of the drive's mean speed is at rest (the laws hold it at zero exactly).
AT_REST = 1e-6
# A bit that has started reaches this share.
_FAST = 0.5
# Periods that differ by less, over their mean, are those of a periodic motion, and are the same.
_REGULAR, _SAME = 0.2, 0.02


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
        stuck: share of the time that the bit is at rest, over whole periods where there are some; 1 where it never
            turns.
        severity: half the range of the bit's speed over the mean speed of the drive, or of the bit where the drive
            stands: 0 for a steady rotation, 1 and more where the bit comes to rest; NaN where both stand in the mean,
            and for a bit that never turned.
        torque: (smallest, largest) surface torque, N m. bit_torque: the same at the bit.
        caution: a sentence where the bit stays in an unstable steady state that nothing disturbs, or where a `ZTorque`
            has no torque to free it; else "".
        unbounded: whether the motion grows without bound: to speeds that no string has.
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
    caution: str = ""
    unbounded: bool = False

    @property
    def sticks(self) -> bool:
        """Whether the bit turns and comes to rest in this time, or swings back."""
        return len(self.starts) > 1 or 0.01 < self.stuck < 1

    @property
    def irregular(self) -> bool:
        """Whether the times between starts differ by more than a fifth: peaks of such a motion depend on any step."""
        return len(self.periods) > 1 and bool(np.ptp(self.periods) > _REGULAR * self.period)

    def _period_in_words(self):
        """The mean time between starts, and the shortest and the longest one where they differ."""
        low, high = self.periods.min(), self.periods.max()
        if high - low < _SAME * self.period:
            return f"period {self.period:.5g} s"
        what = "no single period" if self.irregular else "the period changes"
        return f"{what}: starts {low:.3g} to {high:.3g} s apart, {self.period:.3g} s in the mean"

    def __str__(self):
        return self.summary()

    def summary(self, units: Any = "SI") -> str:
        """The motion in a sentence, in some units: "SI", "field" or a dict of units by dimensions.

        Raises:
            SceneError: unknown units.
        """
        (rpm, turning), (moment, size) = (Units(units).on_screen(x) for x in (SPEED, TORQUE))
        if max(self.peak, -self.least, abs(self.drive)) == 0:
            return f"From {self.since:g} to {self.until:g} s neither drive nor bit turns."
        least, peak, mean = (x / turning for x in (self.least, self.peak, self.mean))
        speed = f"bit speed {least:.4g} to {peak:.4g} {rpm}, mean {mean:.4g} {rpm}"
        again = "" if np.isnan(self.period) else f"{self._period_in_words()}, "
        if self.unbounded:
            what = f"UNSTABLE, the motion grows without bound: {speed}"
        elif self.stuck == 1:
            what = (
                "the bit never turned. Where the surface torque still grows, simulate a longer time; where it does "
                "not, the drive's torque does not free the bit and the string: expected less static torque on bit or "
                "friction, or a stronger drive"
            )
        elif not self.sticks:
            what = f"no stick-slip: {speed}, severity {as_text(self.severity, 3)}"
        elif self.stuck < 1e-3:
            turns = "swings back" if self.least < 0 else "stops for a moment"
            what = f"the bit {turns} and does not stick: {again}{speed}"
        else:
            what = f"stick-slip: {again}{speed}, at rest {100 * self.stuck:.3g} % of the time"
        low, high = (as_text(x / size, 4) for x in self.torque)
        told = f"From {self.since:g} to {self.until:g} s: {what}; surface torque {low} to {high} {moment}."
        return f"{told} {Units(units).sentence(self.caution)}".rstrip()


def crossings(times, speed, level, fast):
    """(starts, stops): interpolated times (s) at which a bit starts from rest, and comes to rest.

    It rests up to the speed `level` (rad/s). A start is the last rise above it before the speed `fast` (rad/s) is
    reached: creep, or a rise that falls back, is no start, nor is the first of `times` (n,) above the level.
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
    # a bit that swings back passes through rest between two samples: a bit that turns against the drive has stopped
    forth = np.maximum(np.sign(drive.mean()) * bit, 0.0) if abs(drive.mean()) > usual / 2 else bit
    starts, stops = crossings(t, forth, level, _FAST * usual)
    periods = np.diff(starts)
    whole = (t[1:] > starts[0]) & (t[1:] <= starts[-1]) if len(periods) else np.full(len(lengths), True)
    mean_drive, mean = (_mean(values, lengths * whole) for values in (drive, bit))
    slow = whole & (np.abs(bit[1:]) <= level) & (np.abs(bit[:-1]) <= level)
    of = abs(mean_drive) if abs(mean_drive) > AT_REST * abs(mean) else abs(mean)
    torque, bit_torque = history.surface_torque[rows], history.torque_on_bit[rows]
    stuck = float(lengths[slow].sum() / lengths[whole].sum())
    return StickSlip(
        float(t[0]), float(t[-1]), mean_drive, mean, float(bit.max()), float(bit.min()),
        float(periods.mean()) if len(periods) else np.nan, periods, starts, stops,
        stuck, float(np.ptp(bit) / 2 / of) if of and stuck < 1 else np.nan,
        (float(torque.min()), float(torque.max())), (float(bit_torque.min()), float(bit_torque.max())),
    )  # fmt: skip


def _mean(values, lengths):
    """Over time, by trapezoids."""
    return float((lengths @ (values[1:] + values[:-1])) / 2 / lengths.sum())


def alias(history):
    """A caution where profiles are further apart than half the period of stick-slip; else ""."""
    if len(history) <= 5 or len(history.profile_times) < 3:
        return ""
    apart, period = float(np.diff(history.profile_times).max()), history.stick_slip().period
    if not apart > period / 2:  # also for NaN: without stick-slip there is no period
        return ""
    return (f"profiles are {apart:.3g} s apart, and the period of stick-slip is {period:.3g} s: maps and films show a "
            f"pattern that is not there; profile_every = {period / 10:.2g} (s) avoids it")  # fmt: skip


def turns(history):
    """Whether drive or bit turn."""
    return bool(np.any(history.drive_speed) or np.any(history.bit_speed))


_BIT, _DRIVE, _TORQUE = (1 + SERIES.index(name) for name in ("bit_speed", "drive_speed", "surface_torque"))
# Least ratio of a longer step to the step of the motion.
_LONGER = 1.499
# A bit below this share of the drive's mean speed is slow, and may start from there.
_SLOW = 0.1


class Cycle(NamedTuple):
    """Numbers of a motion, or their errors. period: mean time between two starts of the bit, s; NaN where it starts
    fewer than twice; peak: largest speed of the bit, in the sense of the drive, rad/s. least_torque, largest_torque: at
    the surface, N m."""

    period: float
    peak: float
    least_torque: float
    largest_torque: float


def cycle_of(rows, since=0.0, slow=_SLOW):
    """The `Cycle` in rows of `StringModel.advance` from a time (s) on; speeds in the sense in which the drive turns.

    A bit starts where it passes half the mean speed of the drive after less than the share `slow` of it.
    """
    rows = rows[rows[:, 0] >= since]
    t, speed, torque = rows[:, 0], rows[:, _BIT], rows[:, _TORQUE]
    drive = rows[:, _DRIVE].mean()
    if drive < 0:
        drive, speed = -drive, -speed
    rests, up = speed < slow * drive, np.flatnonzero((speed[1:] >= 0.5 * drive) & (speed[:-1] < 0.5 * drive))
    rested = np.diff(np.concatenate([[0], np.cumsum(rests)[up]])) > 0
    up = up[rested]
    starts = t[up] + (0.5 * drive - speed[up]) / (speed[up + 1] - speed[up]) * (t[up + 1] - t[up])
    period = float(np.diff(starts).mean()) if len(starts) > 1 else np.nan
    return Cycle(period, float(speed.max()), float(torque.min()), float(torque.max()))


def step_errors(dt, other_model, rows, since=0.0, more=()):
    """A `Cycle` of errors of a motion by its step, from a run with twice the step and one with half of it, and more.

    The errors are twice the larger one of the two differences: twice the error where it is of first order in the step,
    six times where it is of second order. Where fronts pass or the bit barely sticks, errors have no order, and of two
    runs the numbers may agree by chance; three seldom do. For the same reason both torques have the larger error of
    theirs. The error of the period covers what counts as a start: up to which speed the bit is slow before it. A motion
    that is not periodic may depend on any step. NaN where no other run is possible; a law of friction or the coarsest
    mesh may allow none with 1.5 times the step.

    Args:
        dt: step of the motion, s. other_model: function of the ratio of steps that returns a `StringModel` at rest.
        rows: of the motion, see `StringModel.advance`. since: see `cycle_of`.
        more: functions that return further `StringModel`s of the same motion.
    """
    here, found = np.array(cycle_of(rows, since)), []
    for k, make in enumerate((partial(other_model, 2.0), partial(other_model, 0.5), *more)):
        try:
            other = make()
            if k == 0 and other.dt < _LONGER * dt:
                continue
            there = cycle_of(other.advance(int(np.ceil(rows[-1, 0] / other.dt - 1e-6))), since)
        except (SceneError, NotConverged):  # of that step
            continue
        found.append(2 * np.abs(here - there))
    if not found:
        return Cycle(*[np.nan] * 4)
    period, peak, *torques = np.max(found, axis=0).tolist()
    periods = [cycle_of(rows, since, slow)[0] for slow in (0.8 * _SLOW, _SLOW, 1.2 * _SLOW)]
    return Cycle(max(period, float(np.ptp(periods))), peak, *[max(torques)] * 2)
