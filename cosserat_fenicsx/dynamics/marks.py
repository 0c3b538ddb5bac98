"""The times that the steps of a motion land on."""

import math
from typing import NamedTuple

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.signals import signals_of

# What is a short time, over the duration; changes below this, over the largest value, may be rounding.
_SHORT, _NOISE = 1e-9, 1e-13


class Mark(NamedTuple):
    """A time (s) to land on: whether a load or a prescribed motion bends there, whether one jumps, whether the state is saved."""

    time: float
    bends: bool = False
    jumps: bool = False
    saved: bool = True


def marks_of(scene, duration, save_every, ends=()):
    """The `Mark`s of a motion, the first at 0, the last the end; `ends` are earlier ones. A bend of a prescribed motion is a jump.

    Raises:
        SceneError: a prescribed motion that jumps to another place.
    """
    _check_driven(scene, duration)
    signals = [(item, signal) for item in scene.moving for signal in signals_of(item).values()]
    bends = {t for _, signal in signals for t in signal.jumps if 0 < t < duration}
    jumps = {
        t
        for item, signal in signals
        for t in signal.jumps
        if t in bends and (item not in scene.loads or _jumps_at(signal, t, duration))
    }
    saved = set(ends)
    if save_every is not None:
        count = math.ceil(duration / save_every - 1e-9)
        saved |= {k * save_every for k in range(1, count)}
    marks = [Mark(0.0)]
    for t in sorted(bends | saved):
        mark, before = Mark(t, t in bends, t in jumps, t in saved), marks[-1]
        if t - before.time > 1e-9 * duration:
            marks.append(mark)
        else:  # two of them that differ by rounding are one
            either = (one or other for one, other in zip(before[1:], mark[1:], strict=True))
            marks[-1] = Mark(t if mark.bends else before.time, *either)
    return [*marks, Mark(duration)]


def _check_driven(scene, duration):
    """Refuse places that jump: the shorter the steps, the more work such a support does, without bound."""
    for i, support in enumerate(scene.supports):
        for field, signal in signals_of(support).items():
            for t in signal.jumps:
                if 0 < t <= duration and _jumps_at(signal, t, duration):
                    raise SceneError(
                        f"supports[{i}] ({type(support).__name__} at {support.station}): its {field} jumps at t = {t:g} s, by "
                        f"{_rise(signal, t, _SHORT * duration, duration):.4g} {signal.unit}: expected one that goes there in some "
                        "time, such as a Ramp or a RunUp"
                    )


def _jumps_at(signal, t, until):
    """Whether a signal's value jumps at the time t (s), or its slope alone; `until` is the end of the motion."""
    rise = _rise(signal, t, _SHORT * until, until)
    if rise <= 0.75 * _rise(signal, t, 2 * _SHORT * until, until):
        return False
    return rise > _NOISE * max(np.abs(signal(u)).max() for u in np.linspace(0, until, 33))


def _rise(signal, t, apart, until):
    """By how much a signal's value changes from so long before the time t to as long after it, or to the end, s."""
    return float(np.abs(np.subtract(signal(min(t + apart, until)), signal(t - apart))).max())
