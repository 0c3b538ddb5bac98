"""The piece of a path between two neighbouring points, interpolated and searched.

Places between the points a (0) and b (1) are counted by the projection on the chord; a point at a place is found by
Newton in the plane there, which does not mind where the load factor turns.
"""

import itertools
import math

import numpy as np

from cosserat_fenicsx.statics.track import through

# Relative accuracy of the load factor at which a search ends, and most points tried for it.
_FINE, _MOST = 1e-8, 25
# Places where a long step is looked into for modes that come and go on it.
_PROBES = (1 / 3, 2 / 3)
# Every so many tries the bracket of a root is halved, whatever the polynomial says.
_OFTEN = 6
# Places nearer to one another than this tell nothing new.
_APART = 1e-5
# How far beyond the ends a zero is looked for, and how far beside a place another will do.
_BEYOND = 3.0
_ASIDE = (0.0, 1e-3, -1e-3, 1e-2, -1e-2)


class Chord:
    """The piece of a path between two points, with the points found on it so far.

    Args:
        track: the `Track`, which stands at a.
        a, b: the `Point`s.
        weight: of the load factor in the metric.
    """

    def __init__(self, track, a, b, weight):
        self.track, self._weight = track, weight
        self.known = [(0.0, a), (1.0, b)]
        self.normal, self.change = b.numbers[0] - a.numbers[0], b.load_factor - a.load_factor
        self._before = {}
        if len(track.history) > 1:  # the point before a, for the curvature
            point = track.history[-2]
            moved, change = point.numbers[0] - a.numbers[0], point.load_factor - a.load_factor
            place = (track.product(moved, self.normal) + weight * change * self.change) / (
                track.product(self.normal, self.normal) + weight * self.change**2
            )
            if -5 < place < -0.2:
                self._before = {place: point}

    @classmethod
    def balanced(cls, track, a, b):
        """With the weight by which the unknowns and the load factor go equally far."""
        moved, change = b.numbers[0] - a.numbers[0], b.load_factor - a.load_factor
        return cls(track, a, b, (track.square(moved) / change**2 if change else 0.0) or 1.0)

    def _near(self, place):
        """Up to four known places nearest to a place, and their points."""
        known = {**self._before, **dict(self.known)}
        places = _nearest(known, place)
        return places, [known[at] for at in places]

    def guess(self, place):
        """(numbers, load factor) at a place by the polynomial through the points next to it."""
        places, points = self._near(place)
        return through(points, places, place)

    def load_factor(self, place):
        """The guess's load factor alone."""
        places, points = self._near(place)
        weights = [math.prod((place - b) / (a - b) for b in places if b != a) for a in places]
        return float(np.dot(weights, [point.load_factor for point in points]))

    def at(self, place):
        """A known place at or next to a place, and the path's `Point` there; None where Newton fails.

        Very near to where the tangent is singular the bordered solves lose their digits: a little aside is as good.
        """
        for aside in _ASIDE:
            point = self._point(place + aside)
            if point is not None:
                return place + aside, point
        return None

    def _point(self, place):
        track = self.track
        solved = track.on_plane(*self.guess(place), self.normal, self._weight * self.change)
        if not solved.converged:
            return None
        slope = track.slope_found()
        point = track.point(solved)
        track.aim(point, slope, self.normal, self.change, self._weight)
        self.known = sorted([*self.known, (place, point)], key=lambda item: item[0])
        return point

    def comes_and_goes(self):
        """A place where negative modes differ from those at both ends or change to and fro, judged by interpolated
        states; None where they do not."""
        track = self.track
        counts = [self.known[0][1].negative_modes]
        for place in _PROBES:
            track.put(*self.guess(place))
            counts.append(track.stability.count(neutral=track.neutral is not None))
        counts.append(self.known[-1][1].negative_modes)
        changes = np.diff(counts)
        if min(counts) < 0 or (changes >= 0).all() or (changes <= 0).all():
            return None
        return _PROBES[int(np.flatnonzero(changes)[0])]

    def neighbours(self, place):
        """The known points next to a place on its two sides."""
        low = [point for at, point in self.known if at <= place]
        high = [point for at, point in self.known if at > place]
        return (low or high)[-1], (high or low)[0]

    def polish(self, place, value):
        """The place near another, perhaps beyond the ends, where a function of the path's points vanishes; None where it
        does not. Its values need not be of one sign on either side of the ends."""
        known = dict(self.known)
        values = {at: value(known[at]) for at in _nearest(known, place)}
        estimate = None
        for _ in range(_MOST):
            place = _next(values, place)
            if place is None or not -_BEYOND < place < 1 + _BEYOND:
                return None
            eta = self.load_factor(place)
            settled = estimate is not None and abs(eta - estimate) <= _FINE * max(abs(eta), abs(self.change))
            if settled or min(abs(place - at) for at in values) < _APART:
                return place
            estimate = eta
            found = self.at(place)
            if found is None:
                return None
            values[found[0]] = value(found[1])
        return None

    def root(self, value):
        """The place where a function of the path's points changes its sign, as it does between the ends.

        The polynomial through the nearest values, and those on either side of the change, is solved for it, until two
        answers for the load factor agree. The last is not solved for: there the tangent would be singular. An answer
        next to a known place is believed if the sign changes right beside it; where it does not, as before a kink, and
        now and then where answers do not settle, the bracket is halved.
        """
        values = {at: value(point) for at, point in self.known}
        low, high = 0.0, 1.0
        place, estimate, halve = 0.5, None, False
        for k in range(1, _MOST):
            places = _nearest(values, place, always=(low, high))
            place = _zero(places, [values[at] for at in places], low, high)
            eta = self.load_factor(place)
            settled = estimate is not None and abs(eta - estimate) <= _FINE * max(abs(eta), abs(self.change))
            known = min(abs(place - at) for at in values) < _APART
            if settled or (known and high - low < 4 * _APART):
                break
            estimate, look = eta, place
            if halve or k % _OFTEN == 0:
                look, halve = (low + high) / 2, False
            elif known:
                look, halve = place + math.copysign(2 * _APART, low + high - 2 * place), True
            found = self.at(look)
            if found is None:
                break
            values[found[0]] = value(found[1])
            if values[found[0]] == 0 or not math.isfinite(values[found[0]]):  # singular to the last digit
                break
            if values[found[0]] * values[low] > 0:
                low = max(low, found[0])
            else:
                high = min(high, found[0])
            halve = halve and high - low > 4 * _APART
        return place


def _nearest(places, place, always=()):
    """Up to four places nearest to a place and apart from one another, beside those that are to be there always."""
    chosen = list(always)
    for at in sorted(places, key=lambda at: abs(at - place)):
        if len(chosen) < 4 + len(always) and all(abs(at - other) >= _APART for other in chosen):
            chosen.append(at)
    return chosen


def _next(values, place):
    """Where a function should vanish by its values: between two of different sign, else by the secant of the two least;
    None where it grows towards both sides."""
    ordered = sorted(values)
    pairs = [(a, b) for a, b in itertools.pairwise(ordered) if values[a] * values[b] <= 0]
    if pairs:
        low, high = min(pairs, key=lambda pair: abs(pair[0] + pair[1] - 2 * place))
        places = _nearest(values, (low + high) / 2)
        return _zero(places, [values[at] for at in places], low, high)
    (u, a), (v, b) = sorted(values.items(), key=lambda item: abs(item[1]))[:2]
    return u - a * (v - u) / (b - a) if a != b else None


def zero_of(function, low, high):
    """A zero between two places; the nearer end where rounding or the polynomial hide the change of sign."""
    a, b = function(low), function(high)
    if a * b > 0:
        return low if abs(a) < abs(b) else high
    from scipy.optimize import brentq  # a quarter of a second that most runs need not wait for

    return brentq(function, low, high, xtol=1e-15)


def _zero(places, values, low, high):
    """Where the polynomial through values changes its sign between two places."""

    def polynomial(at):
        return float(sum(v * math.prod((at - b) / (a - b) for b in places if b != a)
                         for a, v in zip(places, values, strict=True)))  # fmt: skip

    return zero_of(polynomial, low, high)
