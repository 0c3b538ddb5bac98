"""A smooth planned path made as crooked as drilled ones are."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.interpolate import CubicSpline

from cosserat_fenicsx.checks import instance, number, refuse
from cosserat_fenicsx.parts import Length, Number, Part, at_least, between
from cosserat_fenicsx.well.path import WellPath

# Stations a period, and nodes a period of random numbers; most stations.
_STATIONS, _NODES, _MOST = 12, 2, 200_000


@dataclass(frozen=True)
class Tortuosity(Part):
    """Arguments of `tortuosity` in a scene file: amplitude (degrees), period (m) and seed."""

    amplitude: Annotated[float, between(0, 10, "an angle (degrees)")]
    period: Length
    seed: Annotated[int, Number(limits=at_least(0), whole=True)] | None = None

    called = "tortuosity"


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
        SceneError: a number outside its range; so short a period that there were more than 200 000 stations.
    """
    who = "tortuosity"
    instance(who, "path", path, WellPath, "a WellPath")
    if isinstance(amplitude, str):
        amplitude = math.degrees(number(who, "amplitude", amplitude, "an angle (rad)", math.isfinite))
    amplitude = math.radians(
        number(who, "amplitude", amplitude, "an angle from 0 to 10 degrees", lambda x: 0 <= x <= 10)
    )
    most = path.length / 2
    period = number(
        who, "period", period, f"a length (m), at most half of the path's, {most:g}", lambda x: 0 < x <= most
    )
    if path.length / period * _STATIONS > _MOST:
        refuse(who, "period", period, f"at least {path.length * _STATIONS / _MOST:.3g} m, for {_MOST} stations at most")
    if seed is not None and (isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0):
        refuse(who, "seed", seed, "a whole number from 0 on, or None")
    md = np.linspace(0.0, path.length, math.ceil(path.length / period * _STATIONS) + 1)
    high, right = _deviations(md, path.length, amplitude, period, seed)
    tangent, across, aside = _frames(path, md)
    bent = tangent + np.tan(high)[:, None] * across + np.tan(right)[:, None] * aside
    inc, azi = np.arctan2(np.hypot(bent[:, 0], bent[:, 1]), bent[:, 2]), np.arctan2(bent[:, 1], bent[:, 0])
    return WellPath.from_survey(md, inc, azi % (2 * np.pi), degrees=False)


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
