"""How far the direction of a thread along a rod turns, and the share of its tension that friction leaves (Euler).

A thread that slides over what guides it has T' = -mu |t'| T on the way from its pulled end, with the unit direction t:
the tension there times exp(-mu times the turning up to a place). The directions at the Gauss points of the elements
are interpolated over an element and halves of its neighbours, if these are about as long; |t'| of the polynomials is
integrated in parts, since it has a kink where a curve in a plane bends back. At stations and kinks t may jump, by the
angle between its two sides.

A thread that stretches need not slide: between two of its cells the larger tension is at most exp(mu times the turning)
of the other. It sticks where it is less, and where it would be more, thread passes towards the larger one (`slipped`).
"""

from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polypow

from cosserat_fenicsx.numerics import gauss

# Gauss points of a part of an element; samples to find where |t'| is least, and Newton's iterations to that place.
_POINTS, _WEIGHTS = (gauss(4).points + 1) / 2, gauss(4).weights / 2
_SAMPLES, _ITERATIONS = np.linspace(0.0, 1.0, 9), 5
# A lower bound of lengths, for divisions.
_TINY = 1e-150
# Least distance of points of other elements that an element's polynomial takes, over its length: less than that of
# Gauss's points.
_BESIDE = 0.1
# Share of the largest |t'| of an element below which its least one makes a kink of the tension; the least change of the
# tension along the element, over itself, that matters; and the distance from an end, over the element's length, to
# which kinks count as there: they matter by its square.
_KINK, _SLIGHT, _AT_END = 0.1, 1e-9, 1e-3
# What decides between stick and slip is above rounding by this share; smaller angles (rad) hold nothing; rounds in
# which all wrong ends of cells change, and all rounds; iterations for a tension.
_ABOVE, _SMOOTH, _TOGETHER, _ROUNDS, _FOUND = 1e-12, 1e-14, 30, 1000, 30


class Turning:
    """The turning of a thread along a rod.

    Args:
        scene: a `Scene`; rod: its rod. breaks: (elements + 1,) ends of its elements over its length, from 0 to 1.
        places: (points,) Gauss points of an element, in [0, 1], ascending.
    """

    def __init__(self, scene, rod, breaks, places):
        count, points = len(breaks) - 1, len(places)
        fixed = [*(x.s / rod.length for x in scene.stations(rod)), *np.divide(rod.breaks, rod.length), 0.0, 1.0]
        edges = np.unique(np.abs(np.subtract.outer(fixed, breaks)).argmin(axis=1))
        self._jumps = edges[1:-1]  # elements that begin at one
        at = (breaks[:-1, None] + np.diff(breaks)[:, None] * places).ravel()
        self._near, self._coefficients = [], []
        for begin, end in zip(edges[:-1], edges[1:], strict=True):
            for k in range(begin, end):
                own, h = np.arange(k * points, (k + 1) * points), breaks[k + 1] - breaks[k]
                before = _apart(at, range(own[0], begin * points - 1, -1), points, h)
                after = _apart(at, range(own[-1], end * points), points, h)
                few = min(points // 2, len(before))
                after = after[: points - few]
                near = np.array([*before[: points - len(after)][::-1], *own, *after])
                x, size = (at[near] - breaks[k]) / h, len(near)
                middle, half = (x[0] + x[-1]) / 2, (x[-1] - x[0]) / 2 or 1.0
                powers = np.linalg.inv(np.vander((x - middle) / half, increasing=True))
                # of polynomials in x, from those in (x - middle)/half
                shift = np.zeros((size, size))
                for j in range(size):
                    shift[j, : j + 1] = polypow((-middle / half, 1 / half), j)
                self._near.append(np.pad(near, (0, 2 * points - size), mode="edge"))
                self._coefficients.append(np.pad(shift.T @ powers, ((0, 2 * points - size), (0, 2 * points - size))))
        self._near, self._coefficients = np.array(self._near), np.array(self._coefficients)
        self._inside, self._count = np.concatenate([[0.0], places, [1.0]]), count

    def _polynomials(self, t):
        """(.., elements, powers, 3) coefficients of the polynomials of directions t (.., elements, points, 3)."""
        return self._coefficients @ t.reshape(*t.shape[:-3], -1, 3)[..., self._near, :]

    def along(self, t):
        """The turning, rad, from the start to the begin, the Gauss points and the end of every element, (.., elements,
        points + 2), of the directions at the Gauss points, (.., elements, points, 3); and a function from changes of
        the directions, one or, where the first dimension is 1, several, to those of the turning."""
        c = self._polynomials(t)
        k = c[..., 1:, :] * np.arange(1, c.shape[-2])[:, None]
        bend = _least(k)[..., None]
        ends = np.sort(np.concatenate([np.broadcast_to(self._inside, (*bend.shape[:-1], len(self._inside))), bend], -1))
        sizes = np.diff(ends)
        x = ends[..., :-1, None] + sizes[..., None] * _POINTS
        powers = np.vander(x.ravel(), k.shape[-2], increasing=True).reshape(*x.shape[:-2], -1, k.shape[-2])
        rate = powers @ k
        size = np.linalg.norm(rate, axis=-1)
        weights = (sizes[..., None] * _WEIGHTS).reshape(size.shape)
        which = np.arange(len(self._inside)) + (bend < self._inside)  # among the ends
        away = self._steps(c)
        far = np.linalg.norm(away, axis=-1)

        def up_to(rates, angles):
            parts = (weights * rates).reshape(*rates.shape[:-1], sizes.shape[-1], -1).sum(axis=-1)
            inside = np.cumsum(np.concatenate([np.zeros((*parts.shape[:-1], 1)), parts], axis=-1), axis=-1)
            passed = np.zeros(inside.shape[:-1])
            passed[..., 1:] = np.cumsum(inside[..., :-1, -1], axis=-1)
            for j, begin in enumerate(self._jumps):
                passed[..., begin:] += angles[..., j, None]
            return passed[..., None] + np.take_along_axis(inside, which, axis=-1)

        def change(dt):
            d = self._polynomials(dt)
            rates = powers @ (d[..., 1:, :] * np.arange(1, d.shape[-2])[:, None])
            moved = (self._steps(d) * away).sum(axis=-1) / np.maximum(far * np.sqrt(1 - far**2 / 4), _TINY)
            return up_to((rates * rate).sum(axis=-1) / np.maximum(size, _TINY), moved)

        return up_to(size, 2 * np.arcsin(np.minimum(far / 2, 1.0))), change

    def bends_back(self, t, friction):
        """(..,) whether |t'| vanishes inside an element, so that T'' jumps there, of t as in `along`."""
        c = self._polynomials(t)
        k = c[..., 1:, :] * np.arange(1, c.shape[-2])[:, None]
        place = _least(k)
        x = np.concatenate([np.broadcast_to(_SAMPLES, (*place.shape, len(_SAMPLES))), place[..., None]], axis=-1)
        size = np.linalg.norm(np.vander(x.ravel(), k.shape[-2], increasing=True).reshape(*x.shape, -1) @ k, axis=-1)
        largest = size.max(axis=-1)
        inside = np.abs(place - 0.5) < 0.5 - _AT_END
        return (inside & (size[..., -1] < _KINK * largest) & (friction * largest > _SLIGHT)).any(axis=-1)

    def _steps(self, c):
        """(.., jumps, 3) changes of the direction at the jumps."""
        return c[..., self._jumps, 0, :] - c[..., self._jumps - 1, :, :].sum(axis=-2)

    def left(self, t, friction, from_start):
        """The share of the tension that friction leaves, as `along` gives the turning, and its function of changes;
        from_start: whether the thread is pulled at the start of the rod."""
        turned, change = self.along(t)

        def way(values):
            return values if from_start else values[..., -1:, -1:] - values

        share = np.exp(-friction * way(turned))
        return share, lambda dt: -friction * share * way(change(dt))


class Slipped(NamedTuple):
    """Cells of a thread, from its pulled end on: their tensions and their lengths without tension, (n,); ways (n,):
    whether thread passes at the begin of each, 1 towards the pulled end, -1 back, 0 where it sticks; change: a function
    from changes (.., n) of the sizes and of the angles to those of the tensions."""

    tensions: np.ndarray
    material: np.ndarray
    ways: np.ndarray
    change: object


def slipped(sizes, material, angles, pull, stiffness, ways):
    """The `Slipped` cells of a thread that is held at its other end.

    A cell of the size l with thread of the length a without tension has the tension EA (l/a - 1), or none. Which ends
    slip is found by active sets: cells between two ends that stick share their thread, with tensions of known ratios.
    All wrong ends change at once; after some rounds, which may come back to the same sets, a random half of them.

    Args:
        sizes, material: (n,) of the cells, and the lengths without tension before.
        angles: (n,) friction times turning, from the pulled end to the first cell, then between cells.
        pull: the tension at the pulled end. stiffness: EA. ways: (n,) to begin with.

    Returns:
        Slipped; None where no state was found.
    """
    free, grow, ways = angles <= _SMOOTH, np.exp(angles) * (1 + _ABOVE), np.where(angles <= _SMOOTH, 1, ways)
    random = None
    for tried in range(_ROUNDS):
        tensions, now, change = _between(sizes, material, angles, pull, stiffness, ways)
        passed = np.cumsum((material - now)[::-1])[::-1]
        before = np.concatenate([[pull], tensions[:-1]])
        slips = (before > tensions * grow) * 1 - (tensions > before * grow)
        wanted = np.where(free, 1, np.where(ways == 0, slips, np.where(passed * ways < -_ABOVE * sizes, 0, ways)))
        wrong = np.flatnonzero(wanted != ways)
        if not len(wrong):
            return Slipped(tensions, now, ways, change)
        which = wrong
        if tried >= _TOGETHER:
            random = random or np.random.default_rng(0)
            which = wrong[random.random(len(wrong)) < 0.5]
        ways = ways.copy()
        ways[which] = wanted[which]
    return None


def _between(sizes, material, angles, pull, stiffness, ways):
    """Tensions, lengths without tension, and the function of changes of `Slipped`, for given ways."""
    heads = np.flatnonzero(ways == 0)  # first cells of those that share their thread
    group, first = np.cumsum(ways == 0), heads[0] if len(heads) else len(sizes)
    inside = slice(first, None)

    def ratios(angles):
        """Logarithms of the tensions over that of the first cell that shares its thread, or over the pull."""
        fallen = -np.cumsum(ways * angles, axis=-1)
        return fallen - np.where(group > 0, fallen[..., np.concatenate([[0], heads])[group]], 0.0)

    def total(values):
        """(.., groups) sums of values (.., cells from `first` on)."""
        return np.add.reduceat(values, heads - first, axis=-1)

    r, of_cell = np.exp(ratios(angles)), group[inside] - 1
    tensions, now = pull * r, material.copy()
    if len(heads):
        own, ratio, there = sizes[inside], r[inside], total(material[inside])
        tau = np.zeros(len(heads))
        for _ in range(_FOUND):  # Newton's, of convex functions that fall, from the left
            left = stiffness * own / (stiffness + tau[of_cell] * ratio)
            step = (total(left) - there) / total(left * ratio / (stiffness + tau[of_cell] * ratio))
            tau = np.maximum(tau + step, 0.0)
            if ((np.abs(step) <= _ABOVE * tau) | (tau == 0)).all():
                break
        tensions[inside] = tau[of_cell] * ratio
    taut = np.concatenate([np.ones(first, dtype=bool), tensions[inside] > 0])
    now[taut] = stiffness * sizes[taut] / (stiffness + tensions[taut])

    def change(of_sizes, of_angles):
        moved = ratios(of_angles) * tensions
        if len(heads):
            soft = stiffness / (stiffness + tensions[inside])
            gained = of_sizes[..., inside] * soft - own * soft / (stiffness + tensions[inside]) * moved[..., inside]
            rise = total(gained) / total(own * soft * ratio / (stiffness + tensions[inside]))
            moved[..., inside] += np.where(taut[inside], rise[..., of_cell] * ratio, 0.0)
        return moved

    return tensions, now, change


def _apart(at, which, most, h):
    """Up to `most` of the indices `which` of places `at`, each some share of h beyond the last one, from the first one:
    directions of elements far shorter than h tell no slope over h."""
    found, last = [], which[0]
    for i in which:
        if abs(at[i] - at[last]) > _BESIDE * h:
            found.append(i)
            last = i
        if len(found) == most:
            break
    return found


def _least(k):
    """(..,) where in [0, 1] the size of polynomials k (.., powers, 3) is least."""

    def at(x, order=0):
        c = k
        for _ in range(order):
            c = c[..., 1:, :] * np.arange(1, c.shape[-2])[:, None]
        return x[..., None] ** np.arange(c.shape[-2]) @ c

    sampled = np.linalg.norm(np.vander(_SAMPLES, k.shape[-2], increasing=True) @ k, axis=-1)
    x = _SAMPLES[np.argmin(sampled, axis=-1)]
    low, high = np.maximum(x - _SAMPLES[1], 0.0), np.minimum(x + _SAMPLES[1], 1.0)
    for _ in range(_ITERATIONS):  # Gauss and Newton's: quadratic where the size vanishes
        a, b = (at(x[..., None], order)[..., 0, :] for order in (0, 1))
        x = np.clip(x - (a * b).sum(axis=-1) / np.maximum((b * b).sum(axis=-1), _TINY), low, high)
    return x
