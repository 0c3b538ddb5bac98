"""Waves that a drive sends back larger than they come: frequencies and growth, by its reflection coefficient.

At a real frequency a drive of the impedance Zd reflects waves in a string of the impedance Z by |(Zd - Z)/(Zd + Z)|.
Where that is R, above 1, and waves lose exp(-2 a) on their way down the string and up again, in the time 2 T, they
grow by about (log R - 2 a)/(2 T) 1/s, where the lower end reflects them whole. A control that acts late does so at high
frequencies, and one with two filters in a row, unless another filter or the losses of the string prevent it.
"""

import math
from typing import NamedTuple

import numpy as np

from cosserat_fenicsx.drilling.linear.impedances import torsional
from cosserat_fenicsx.drilling.linear_control import arrays_of
from cosserat_fenicsx.errors import SceneError

# Sampled frequencies (Hz); the lowest times the travel time of the string, the highest over the rates of the control,
# 1/s. A slower growth (1/s) is not told.
_SAMPLES, _LOWEST, _HIGHEST, _SLOW = 6000, 0.1, 10.0, 1e-3


class FedWaves(NamedTuple):
    """Waves that grow: lowest, highest and fastest of the frequencies (Hz), and how fast, 1/s."""

    low: float
    high: float
    fastest: float
    growth: float

    def __str__(self):
        return (
            f"the drive sends waves of {self.low:.3g} to {self.high:.3g} Hz back larger than they come, by more than "
            f"the string loses: those of {self.fastest:.3g} Hz grow by about {self.growth:.2g} 1/s. A longer filter or "
            "a shorter delay of its control helps; "
            f"stability(..., up_to={math.ceil(1.2 * self.fastest)}) has the fastest"
        )


def fed_waves(scene, above: float = 0.0) -> FedWaves | None:
    """The `FedWaves` of a `Drilling` above a frequency (Hz), in torsion; None where there are none, for `Discs`, and
    for controls that the linear theory does not know."""
    control = scene.drive.control
    if scene.discs:
        return None
    try:
        Z = scene.segments[0].torsional_impedance
        gains = control.gains(Z)
        rates = [] if gains.linear is None else [*np.abs(np.linalg.eigvals(arrays_of(gains.linear)[0]))]
        rates += [1 / control.late] if control.late else []
        if not rates:  # of most controls
            return None
        guide = torsional(scene)
    except SceneError:  # a control without gains
        return None
    lowest, highest = max(above, _LOWEST / guide.travel), _HIGHEST * max(rates)
    if lowest >= highest:
        return None
    f = np.geomspace(lowest, highest, _SAMPLES)
    s = 2j * math.pi * f
    w, P, *_ = guide.top(s)
    sent, come = np.abs(P + Z * w), np.abs(P - Z * w)
    lost = sum(part.decay(s) for part in guide.parts)
    growth = (np.log(sent / np.maximum(come, 1e-12 * sent)) - 2 * lost) / (2 * guide.travel)
    k, grows = int(growth.argmax()), growth > _SLOW
    if not grows[k]:
        return None
    first, last = np.flatnonzero(grows)[[0, -1]]
    return FedWaves(*map(float, (f[first], f[last], f[k], growth[k])))
