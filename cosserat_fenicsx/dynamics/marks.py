"""The times of a motion that a step must end at: jumps and kinks of loads, saved states, the end."""

import math
from typing import NamedTuple

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.signals import signals_of

# Interval over which a jump is detected, as a share of the duration; changes below the second number, relative to the
# largest value, may be rounding.
_JUMP_INTERVAL, _ROUNDING = 1e-9, 1e-13


class Mark(NamedTuple):
    """A time (s) that a step ends at.

    Attributes:
        kink: whether a load or a prescribed motion is not smooth there (a kink or a jump).
        jump: whether a load jumps there or a prescribed motion has a kink: accelerations and velocities jump.
        saved: whether the state is saved.
    """

    time: float
    kink: bool = False
    jump: bool = False
    saved: bool = True


def marks_of(scene, duration, save_every, ends=()):
    """The `Mark`s of a motion, ascending: the first at 0, the last at the end.

    Args:
        scene: a `Scene`; duration: s; save_every: s between saved states, or None.
        ends: ends (s) of shorter durations that the motion was computed for before, see `resume`.

    Raises:
        SceneError: a prescribed motion that is discontinuous.
    """
    _check_driven(scene, duration)
    signals = [(item, signal) for item in scene.moving for signal in signals_of(item).values()]
    kinks = {t for _, signal in signals for t in signal.jumps if 0 < t < duration}
    jumps = {
        t
        for item, signal in signals
        for t in signal.jumps
        if t in kinks and (item not in scene.loads or _jumps_at(signal, t, duration))
    }
    saved = set(ends)
    if save_every is not None:
        count = math.ceil(duration / save_every - 1e-9)
        saved |= {k * save_every for k in range(1, count)}
    marks = [Mark(0.0)]
    for t in sorted(kinks | saved):
        mark, before = Mark(t, t in kinks, t in jumps, t in saved), marks[-1]
        if t - before.time > 1e-9 * duration:
            marks.append(mark)
        else:  # times that differ by rounding alone are merged
            either = (one or other for one, other in zip(before[1:], mark[1:], strict=True))
            marks[-1] = Mark(t if mark.kink else before.time, *either)
    return [*marks, Mark(duration)]


def _check_driven(scene, duration):
    """Refuse discontinuous prescribed motions: the work of such a support grows without bound as steps get shorter."""
    for i, support in enumerate(scene.supports):
        for field, signal in signals_of(support).items():
            for t in signal.jumps:
                if 0 < t <= duration and _jumps_at(signal, t, duration):
                    rise = _rise(signal, t, _JUMP_INTERVAL * duration, duration)
                    raise SceneError(
                        f"supports[{i}] ({type(support).__name__} at {support.station}): its {field} jumps at t = "
                        f"{t:g} s, by {rise:.4g} {signal.unit}: expected a continuous one, such as a Ramp or a RunUp"
                    )


def _jumps_at(signal, t, until):
    """Whether the value of a signal jumps at the time t (s), not only its slope; `until` (s) is the end of the motion.

    A continuous signal changes by half as much over half the interval; a discontinuous one by as much.
    """
    rise = _rise(signal, t, _JUMP_INTERVAL * until, until)
    if rise <= 0.75 * _rise(signal, t, 2 * _JUMP_INTERVAL * until, until):
        return False
    return rise > _ROUNDING * max(np.abs(signal(u)).max() for u in np.linspace(0, until, 33))


def _rise(signal, t, apart, until):
    """Largest change of a component of a signal from t - apart to t + apart, or to `until` where that is earlier; s."""
    return float(np.abs(np.subtract(signal(min(t + apart, until)), signal(t - apart))).max())
