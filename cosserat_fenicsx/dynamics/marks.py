"""The times that the steps of a motion land on."""

import math
from typing import NamedTuple

from cosserat_fenicsx.scene.signals import jumps_at, signals_of


class Mark(NamedTuple):
    """A time (s) to land on: whether a load or a prescribed motion bends there, whether one jumps, whether the state is saved."""

    time: float
    bends: bool = False
    jumps: bool = False
    saved: bool = True


def marks_of(scene, duration, save_every, ends=()):
    """The `Mark`s of a motion, the first at 0, the last the end; `ends` are earlier ones. A bend of a prescribed motion is a jump."""
    signals = [(item, signal) for item in scene.moving for signal in signals_of(item).values()]
    bends = {t for _, signal in signals for t in signal.jumps if 0 < t < duration}
    jumps = {
        t
        for item, signal in signals
        for t in signal.jumps
        if t in bends and (item not in scene.loads or jumps_at(signal, t, duration))
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
