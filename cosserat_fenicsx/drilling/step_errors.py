"""How much the step of a string in motion matters: numbers of the motion, compared with a run at twice the step."""

from typing import NamedTuple

import numpy as np

from cosserat_fenicsx.drilling.protocol import SERIES
from cosserat_fenicsx.errors import NotConverged, SceneError

_BIT, _DRIVE, _TORQUE = (1 + SERIES.index(name) for name in ("bit_speed", "drive_speed", "surface_torque"))
# A step is longer than another one from so many times that on.
_LONGER = 1.499


class Cycle(NamedTuple):
    """Numbers of a motion, or their errors.

    Attributes:
        period: mean time between two starts of the bit, s; NaN where it starts fewer than twice.
        peak: largest speed of the bit, in the sense of the drive, rad/s. least_torque, largest_torque: at the surface,
            N m.
    """

    period: float
    peak: float
    least_torque: float
    largest_torque: float


def cycle_of(rows, since=0.0):
    """The `Cycle` in rows of `StringModel.advance` from a time (s) on; speeds in the sense in which the drive turns.

    A bit starts where it passes half the mean speed of the drive after less than a tenth of it.
    """
    rows = rows[rows[:, 0] >= since]
    t, speed, torque = rows[:, 0], rows[:, _BIT], rows[:, _TORQUE]
    drive = rows[:, _DRIVE].mean()
    if drive < 0:
        drive, speed = -drive, -speed
    slow, up = speed < 0.1 * drive, np.flatnonzero((speed[1:] >= 0.5 * drive) & (speed[:-1] < 0.5 * drive))
    rested = np.diff(np.concatenate([[0], np.cumsum(slow)[up]])) > 0
    up = up[rested]
    starts = t[up] + (0.5 * drive - speed[up]) / (speed[up + 1] - speed[up]) * (t[up + 1] - t[up])
    period = float(np.diff(starts).mean()) if len(starts) > 1 else np.nan
    return Cycle(period, float(speed.max()), float(torque.min()), float(torque.max()))


def step_errors(model, rows, since=0.0):
    """Errors of the `Cycle` of a motion by its step, from a run with twice the step, which takes a quarter to a half
    of the time.

    Twice the difference of the two runs is returned: twice the error of the finer one where that is of the first order
    in the step, six times where it is of the second. A motion that is not periodic, or a bit that sticks just so, may
    depend on any step. Where a law of friction, or a mesh that is as coarse as it can be, allows no run with 1.5 times
    the step, the other run is one with half of it, and takes two to four times the time.

    Args:
        model: a `StringModel` with `with_step(factor)`, such as `TorsionWaves`, which has computed the motion.
        rows: that `advance` returned, (n, ...). since: see `cycle_of`.

    Returns:
        A `Cycle` of errors, all NaN where no other run was possible.
    """
    for factor in (2.0, 0.5):
        try:
            other = model.with_step(factor)
            if factor > 1 and other.dt < _LONGER * model.dt:
                continue
            found = cycle_of(other.advance(int(np.ceil(rows[-1, 0] / other.dt - 1e-6))), since)
        except (SceneError, NotConverged):  # of that step
            continue
        return Cycle(*(2 * abs(a - b) for a, b in zip(cycle_of(rows, since), found, strict=True)))
    return Cycle(*[np.nan] * 4)
