"""A smooth planned path made as crooked as drilled ones are."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.interpolate import CubicSpline

from cosserat_fenicsx.checks import instance, refuse, store, warn
from cosserat_fenicsx.parts import Length, Number, Part, at_least, between
from cosserat_fenicsx.units import deg_per_30m
from cosserat_fenicsx.well.path import WellPath

# Stations a period, and nodes a period of random numbers; most stations; degrees per 30 m above which is warned.
_STATIONS, _NODES, _MOST, _STEEP = 12, 2, 200_000, 20.0


@dataclass(frozen=True)
class Tortuosity(Part):
    """Arguments of `tortuosity`, in a scene file too: amplitude (degrees), period (m) and seed; text with a unit."""

    amplitude: Annotated[float, between(0, 10, "an angle (degrees)")]
    period: Length
    seed: Annotated[int, Number(limits=at_least(0), whole=True)] | None = None

    called = "tortuosity"

    def in_words(self, units):
        """What it makes of a plan, in some units."""
        how = "a helix, without a seed" if self.seed is None else f"seed {self.seed}"
        return f"amplitude {self.amplitude:g} degrees, period {units.told(self.period, 'm')}, {how}"


def tortuosity(path: WellPath, amplitude: float | str, period: float | str, seed: int | None = None) -> WellPath:
    """The path with a small deviation of its direction, which vanishes at both ends.

    Without a seed the direction goes round that of the plan, a helix with a dogleg of 2 pi amplitude/period of its own.
    With a seed its deviations in two directions across the plan are smooth random functions of the
    depth, with random values every half of a period and amplitude/sqrt(2) as their standard deviations. Deviations are
    about directions that do not turn along the path, so that vertical parts have them, too.

    Args:
        path: the plan. amplitude: angle of the deviation, degrees, or text with a unit; at most 10 degrees.
        period: along the path, m, or text with a unit; of at most a half of the path's length.
        seed: of the random numbers, a whole number; the same one gives the same path.

    Raises:
        SceneError: a number outside its range; so short a period that there were more than 200 000 stations. A hole
            that turns by more than 20 degrees per 30 m gives a `SceneWarning`.
    """
    given = Tortuosity(amplitude, period, seed)
    instance(given, "path", path, WellPath, "a WellPath")
    amplitude, period, seed = math.radians(given.amplitude), given.period, given.seed
    if period > path.length / 2:
        refuse(given, "period", period, f"a length (m), at most half of the path's, {path.length / 2:g}")
    if path.length / period * _STATIONS > _MOST:
        expected = f"at least {path.length * _STATIONS / _MOST:.3g} m, for {_MOST} stations at most"
        refuse(given, "period", period, expected)
    turn = 2 * math.pi * amplitude / period
    if turn > _STEEP * deg_per_30m:
        warn(f"tortuosity: amplitude = {given.amplitude:g} degrees and period = {period:g} m turn the hole by "
             f"{turn / deg_per_30m:.3g} degrees per 30 m; drilled ones are crooked by a few: 300 feet are '300 ft' or "
             "91.44")  # fmt: skip
    md = np.linspace(0.0, path.length, math.ceil(path.length / period * _STATIONS) + 1)
    high, right = _deviations(md, path.length, amplitude, period, seed)
    tangent, across, aside = _frames(path, md)
    bent = tangent + np.tan(high)[:, None] * across + np.tan(right)[:, None] * aside
    inc, azi = np.arctan2(np.hypot(bent[:, 0], bent[:, 1]), bent[:, 2]), np.arctan2(bent[:, 1], bent[:, 0])
    found = WellPath.from_survey(md, inc, azi % (2 * np.pi), degrees=False)
    store(found, crooked=given)
    return found


def _deviations(md, length, amplitude, period, seed):
    """Angles (rad) towards two directions across the path, faded out over a period at both ends."""
    fade = np.minimum(1.0, np.minimum(md, length - md) / period)
    fade = fade**2 * (3 - 2 * fade)
    if seed is None:
        angle = 2 * np.pi * md / period
        return amplitude * fade * np.array([np.cos(angle), np.sin(angle)])
    nodes = np.linspace(0.0, length, math.ceil(length / period * _NODES) + 1)
    values = np.random.default_rng(seed).normal(0.0, amplitude / math.sqrt(2), (2, len(nodes)))
    return fade * CubicSpline(nodes, values, axis=1)(md)


def _frames(path, md):
    """Tangents at measured depths, and two unit vectors across each, which turn about it as little as they can."""
    tangent = path.tangent(md)
    across = np.empty_like(tangent)
    first = np.eye(3)[np.argmin(np.abs(tangent[0]))]
    for i, t in enumerate(tangent):
        first = first - (first @ t) * t
        first /= np.linalg.norm(first)
        across[i] = first
    return tangent, across, np.cross(tangent, across)
