"""What lies between two neighbouring points of a path: limit points, bifurcations, a requested load factor.

Places between the points a (0) and b (1) are counted by the projection on the chord; a point at a place is found by
Newton in the plane there, which does not mind where the load factor turns.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from cosserat_fenicsx.track import Point, through

#: Relative accuracy of the load factor at which the search for a limit point or a bifurcation ends.
_FINE = 1e-8
_MOST = 25
# Places nearer to one another than this tell nothing new.
_APART = 1e-5
# Eigenvalues vanish together where one is this small over its size at the ends of the chord when the other vanishes.
_SAME = 1e-5


@dataclass(frozen=True, eq=False)
class Crossing:
    """A limit point or bifurcation that was located.

    Attributes:
        kind: "limit" or "bifurcation".
        point: the `Point`, interpolated between its neighbours.
        place: between the points before (0) and after (1).
        direction: owned numbers of a change of the unknowns: the path's own at a limit point, the mode's at a bifurcation.
        partner: the direction of a second mode of the same load factor; None where there is none.
    """

    kind: str
    point: Point
    place: float
    direction: np.ndarray
    partner: np.ndarray | None = None


class Lost(Exception):
    """A requested load factor lies between two points, and Newton does not find it: the points are too far apart."""


class Chord:
    """The piece of a path between two points, with the points found on it so far.

    Args:
        track: the `Track`.
        a, b: the `Point`s.
        weight: of the load factor in the metric.
    """

    def __init__(self, track, a, b, weight):
        self.track, self._weight = track, weight
        self.known = [(0.0, a), (1.0, b)]
        self.normal, self.change = b.numbers[0] - a.numbers[0], b.load_factor - a.load_factor

    @classmethod
    def balanced(cls, track, a, b):
        """With the weight by which the unknowns and the load factor go equally far."""
        moved, change = b.numbers[0] - a.numbers[0], b.load_factor - a.load_factor
        return cls(track, a, b, (track.product(moved, moved) / change**2 if change else 0.0) or 1.0)

    def near(self, place):
        """Up to four known places nearest to a place, and their points."""
        known = dict(self.known)
        places = _nearest(known, place)
        return places, [known[at] for at in places]

    def guess(self, place):
        """(numbers, load factor) at a place by the polynomial through the points next to it."""
        places, points = self.near(place)
        return through(points, places, place)

    def load_factor(self, place):
        """The guess's load factor alone."""
        places, points = self.near(place)
        weights = [math.prod((place - b) / (a - b) for b in places if b != a) for a in places]
        return float(np.dot(weights, [point.load_factor for point in points]))

    def at(self, place):
        """The path's `Point` at a place, added to what is known; None where Newton fails."""
        track = self.track
        solved = track.on_plane(*self.guess(place), self.normal, self._weight * self.change)
        if not solved.converged:
            return None
        slope = track.slope_found()
        point = track.point(solved)
        track.aim(point, slope, self.normal, self.change, self._weight)
        self.known = sorted([*self.known, (place, point)], key=lambda item: item[0])
        return point


class Locator:
    """Finds limit points, bifurcations and requested load factors between two points.

    Args:
        track: the `Track`.
    """

    def __init__(self, track):
        self.track = track

    def between(self, a, b, target, weight):
        """What lies between two points, in order.

        Returns:
            (landing, crossings): the first `Point` with the load factor `target` after a, or None; the `Crossing`s
            up to there.

        Raises:
            Lost: the landing failed.
        """
        chord = Chord(self.track, a, b, weight)
        crossings, ends = [], [(0.0, a), (1.0, b)]
        if a.rise * b.rise < 0:
            limit = self.limit(chord)
            crossings.append(limit)
            ends.insert(1, (limit.place, limit.point))
        landing = place = None
        for (low, before), (high, after) in itertools.pairwise(ends):
            if (before.load_factor - target) * (after.load_factor - target) < 0 or after.load_factor == target:
                place, landing = self._land(chord, low, high, before, after, target)
                break
        crossings += self.bifurcations(chord, crossings)
        crossings.sort(key=lambda crossing: crossing.place)
        if landing is not None:
            crossings = [crossing for crossing in crossings if crossing.place <= place]
        return landing, crossings

    def limit(self, chord):
        """The `Crossing` where the load factor turns."""
        place = self._root(chord, lambda point: point.rise)
        numbers, eta = chord.guess(place)
        (_, a), (_, b) = self._neighbours(chord, place)
        point = Point(eta, numbers, min(a.negative_modes, b.negative_modes), 0)
        return Crossing("limit", point, place, b.numbers[0] - a.numbers[0])

    def bifurcations(self, chord, limits=()):
        """The `Crossing`s where an eigenvalue of the second variation changes its sign and the load factor does not
        turn; those of limit points are left out."""
        track = self.track
        first, last = sorted(point.negative_modes for _, point in (chord.known[0], chord.known[-1]))
        if first < 0 or last - first == len(limits):  # singular to round-off at one of the two; or all explained
            return []
        found, j = [], first
        while j < last:
            place, point, together = self._vanishing(chord, j, last)
            found.append((place, point, together))
            j += together
        for limit in limits:  # the eigenvalue that vanishes at a limit point is the nearest
            if found:
                found.remove(min(found, key=lambda item: abs(item[0] - limit.place)))
        crossings = []
        for place, point, together in found:
            track.put(point.numbers, point.load_factor)
            modes = track.stability.modes(together)
            for i, mode in enumerate(modes):
                partner = modes[i - 1] if len(modes) == 2 else None
                crossings.append(Crossing("bifurcation", point, place, mode, partner))
        return crossings

    def _vanishing(self, chord, j, last):
        """(place, `Point`, number of eigenvalues that vanish there together) for the j-th eigenvalue, of those below `last`."""
        track = self.track

        def eigenvalue(point, j=j):
            track.put(point.numbers, point.load_factor)
            return track.stability.eigenvalue(j)

        place = self._root(chord, eigenvalue)
        numbers, eta = chord.guess(place)
        negative = min(point.negative_modes for _, point in (chord.known[0], chord.known[-1]))
        point = Point(eta, numbers, negative, 0)
        together = 1
        while j + together < last:
            ends = max(abs(eigenvalue(end, j + together)) for _, end in (chord.known[0], chord.known[-1]))
            if abs(eigenvalue(point, j + together)) > _SAME * ends:
                break
            together += 1
        return place, point, together

    def _neighbours(self, chord, place):
        """The known points next to a place on its two sides."""
        low = [item for item in chord.known if item[0] <= place]
        high = [item for item in chord.known if item[0] > place]
        return (low or high)[-1], (high or low)[0]

    def _root(self, chord, value):
        """The place where a function of the path's points changes its sign.

        The polynomial through the nearest values is solved for it, until two answers for the load factor agree. The
        last is not solved for: there the tangent would be singular.
        """
        values = {at: value(point) for at, point in chord.known}
        low, high = 0.0, 1.0
        place, estimate = 0.5, None
        for _ in range(_MOST):
            places = _nearest(values, place)
            place = _zero(places, [values[at] for at in places], low, high)
            eta = chord.load_factor(place)
            settled = estimate is not None and abs(eta - estimate) <= _FINE * max(abs(eta), abs(chord.change))
            if settled or min(abs(place - at) for at in values) < _APART:
                break
            estimate = eta
            point = chord.at(place)
            if point is None:
                break
            values[place] = value(point)
            if values[place] == 0:
                break
            if values[place] * values[low] > 0:
                low = place
            else:
                high = place
        return place

    def _land(self, chord, low, high, before, after, target):
        """(place, `Point`) of a requested load factor between two places: by Newton at that load factor."""
        track = self.track
        for _ in range(_MOST):
            place = _zero_of(lambda at: chord.load_factor(at) - target, low, high)
            predicted, _ = chord.guess(place)
            solved = track.at_load(predicted, target)
            if solved.converged:
                numbers = track.problem.numbers()
                ends = track.distance(before.numbers, after.numbers)
                if track.distance(numbers, predicted) <= 0.2 * ends:
                    return place, track.point(solved)
            point = chord.at(place)
            if point is None:
                break
            if point.load_factor == target:
                return place, point
            if (point.load_factor - target) * (after.load_factor - target) < 0:
                low, before = place, point
            else:
                high, after = place, point
        raise Lost


def _nearest(places, place):
    """Up to four places nearest to a place and apart from one another."""
    chosen = []
    for at in sorted(places, key=lambda at: abs(at - place)):
        if len(chosen) < 4 and all(abs(at - other) >= _APART for other in chosen):
            chosen.append(at)
    return chosen


def _zero_of(function, low, high):
    """A zero between two places; the nearer end where rounding or the polynomial hide the change of sign."""
    a, b = function(low), function(high)
    if a * b > 0:
        return low if abs(a) < abs(b) else high
    return brentq(function, low, high, xtol=1e-15)


def _zero(places, values, low, high):
    """Where the polynomial through values changes its sign between two places."""

    def polynomial(at):
        return float(sum(v * math.prod((at - b) / (a - b) for b in places if b != a)
                         for a, v in zip(places, values, strict=True)))  # fmt: skip

    return _zero_of(polynomial, low, high)
