"""The segment of a path between two neighbouring points, interpolated and searched.

The coordinate of a point of the segment is its projection on the chord, 0 at the point a and 1 at b. The point at a
coordinate is found by Newton's method in the plane perpendicular to the chord there, which works at limit points too.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.numerics import lagrange
from cosserat_fenicsx.statics.path.track import bends, between, through


@dataclass(frozen=True)
class Search:
    """Settings of the search for critical points along a chord."""

    fine: float = 1e-8  # relative accuracy of the load factor at which a search ends
    most: int = 25  # iterations of a search
    often: int = 6  # stride of the iterations that bisect the bracket of a root instead of interpolating
    # Coordinates at which a step is checked for negative modes that appear and vanish within it.
    probes: tuple[float, ...] = (1 / 3, 2 / 3)
    varies: float = 4.0  # largest change of the determinant within a step in which no eigenvalue comes close to zero
    # Largest imaginary part of the roots of a determinant that almost vanishes, and largest distance from the step,
    # over its length.
    nearly: float = 0.35
    # Distances on both sides of a critical point at which the path is solved for.
    beside: tuple[float, ...] = (1e-3, 1e-4)
    steep: float = 2.0  # largest length between these two points, over their distance along the chord
    # Largest distance of the direction between these two points from the mean of their tangents, over the angle between
    # the tangents: on a smooth path it is of second order in their distance, while points beside each other with
    # parallel tangents lie on two paths.
    astride: float = 0.1
    # How far they are beside each other by rounding, times their distance (rad, rod lengths): Newton's method loses
    # accuracy along the mode in inverse proportion to that distance.
    rounding: float = 1e-9
    apart: float = 1e-5  # smallest distance of the coordinates of two interpolation points
    # Offsets of the coordinate, tried in turn until Newton's method converges.
    aside: tuple[float, ...] = (0.0, 1e-3, -1e-3, 1e-2, -1e-2)


_SEARCH = Search()


class Chord:
    """The segment of a path between two `PathPoint`s, with the points computed on it so far; the `Track` stands at a.

    weight: of the load factor in the metric; short: whether it is too short to lead from one path to another unnoticed;
    dips: whether the determinant of the second variation almost vanishes between, more often than the number of
    negative modes changes (two eigenvalues that change their signs together, in opposite directions, change neither
    that number nor the determinant's sign); varies: whether the determinant changes by more than a factor of
    `_SEARCH.varies`.
    """

    dips = varies = False

    def __init__(self, track, a, b, weight, *, short=False):
        self.track, self._weight, self._short = track, weight, short
        self.known = [(0.0, a), (1.0, b)]
        self._step = self.normal, self.change = between(a, b)
        self.length = track.length(self._step, weight)
        self._before = {}
        if len(track.history) > 1:  # the point before a, for the curvature
            point = track.history[-2]
            place = track.dot(between(a, point), self._step, weight) / self.length**2
            if -5 < place < -0.2:
                self._before = {place: point}

    @classmethod
    def balanced(cls, track, a, b):
        """A `Chord` with the weight that gives the unknowns and the load factor equal shares in its length."""
        return cls(track, a, b, track.balance(*between(a, b)) or 1.0)

    def _near(self, place):
        """Up to four known coordinates nearest to a coordinate, and their points."""
        known = {**self._before, **dict(self.known)}
        places = _nearest(known, place)
        return places, [known[at] for at in places]

    def guess(self, place):
        """(numbers, load factor) at a coordinate by the polynomial through the nearest known points."""
        places, points = self._near(place)
        return through(points, places, place)

    def load_factor(self, place):
        places, points = self._near(place)
        return float(np.dot(lagrange(places, place), [point.load_factor for point in points]))

    def at(self, place):
        """(coordinate, `PathPoint`) of the path at a coordinate, or beside it where the tangent is almost singular;
        None where Newton's method fails."""
        for aside in _SEARCH.aside:
            point = self._point(place + aside)
            if point is not None:
                return place + aside, point
        return None

    def _point(self, place):
        track = self.track
        solved = track.on_plane(*self.guess(place), self.normal, self._weight * self.change)
        if not solved.converged:
            return None
        point = track.point(solved)
        track.set_tangent(point, track.bordered.slope, self._step, self._weight)
        self.known = sorted([*self.known, (place, point)], key=lambda item: item[0])
        return point

    def comes_and_goes(self):
        """A coordinate where the number of negative modes, counted at interpolated states, is not monotonic; None
        where it is. Sets `dips` and `varies`."""
        track, (_, a), (_, b) = self.track, self.known[0], self.known[-1]
        counts, logarithms = [a.negative_modes], [a.logarithm]
        for place in _SEARCH.probes:
            track.put(*self.guess(place))
            counts.append(track.stability.count(neutral=track.neutral is not None))
            logarithms.append(track.stability.logarithm)
        counts.append(b.negative_modes)
        logarithms.append(b.logarithm)
        self.dips = track.model.carries_force and _dips(counts, logarithms)
        self.varies = not max(logarithms) - min(logarithms) <= math.log(_SEARCH.varies)
        changes = np.diff(counts)
        if min(counts) < 0 or (changes >= 0).all() or (changes <= 0).all():
            return None
        return _SEARCH.probes[int(np.flatnonzero(changes)[0])]

    def passes(self, place, *, turning):
        """Whether the path passes smoothly through a coordinate, by points close to it on both sides; turning: whether
        the load factor has an extremum there. Where an imperfect structure turns away before the bifurcation of the
        perfect one, these lie on two paths, or on both sides of a limit point."""
        if self._short:  # points at these distances would differ by little more than rounding
            return True
        for apart in _SEARCH.beside:
            before, after = (self._point(place + aside) for aside in (-apart, apart))
            if before is None or after is None or (before.rise * after.rise < 0) != turning:
                continue
            steep = bends(self.track, before, after, self._weight)
            if steep.resolved and steep.length <= _SEARCH.steep * 2 * apart * self.length:
                return (steep.corner - _SEARCH.astride * steep.turn) * steep.length**2 <= _SEARCH.rounding
        return False

    def neighbours(self, place):
        """The nearest known points below and above a coordinate."""
        low = [point for at, point in self.known if at <= place]
        high = [point for at, point in self.known if at > place]
        return (low or high)[-1], (high or low)[0]

    def root(self, value, near=None):
        """The coordinate where a function of the path's `PathPoint`s changes its sign; None where it does not. near:
        its expected coordinate; then only the nearest known points and the ends are used.

        The root of the polynomial through the nearest values, among them those of the bracket, is iterated until two
        successive load factors agree. The equilibrium at the last root is not solved for, since its tangent would be
        singular. A root close to a known point is accepted if the sign changes within a narrow bracket there. Otherwise
        (next to a kink of the function), and every few iterations, the bracket is bisected.
        """
        known = dict(self.known)
        places = known if near is None else {0.0, 1.0, *_nearest(known, near)}
        values = {at: value(known[at]) for at in sorted(places)}
        changes = [(a, b) for a, b in itertools.pairwise(values) if values[a] * values[b] <= 0]
        if not changes:
            return None
        middle = 0.5 if near is None else near
        low, high = min(changes, key=lambda ends: abs(ends[0] + ends[1] - 2 * middle))
        place, estimate, halve = middle, None, False
        for k in range(1, _SEARCH.most):
            places = _nearest(values, place, always=(low, high))
            place = _zero(places, [values[at] for at in places], low, high)
            load_factor = self.load_factor(place)
            fine = _SEARCH.fine * max(abs(load_factor), abs(self.change))
            settled = estimate is not None and abs(load_factor - estimate) <= fine
            known = min(abs(place - at) for at in values) < _SEARCH.apart
            if settled or (known and high - low < 4 * _SEARCH.apart):
                break
            estimate, look = load_factor, place
            if halve or k % _SEARCH.often == 0:
                look, halve = (low + high) / 2, False
            elif known:
                look, halve = place + math.copysign(2 * _SEARCH.apart, low + high - 2 * place), True
            found = self.at(look)
            if found is None:
                break
            values[found[0]] = value(found[1])
            if values[found[0]] == 0 or not math.isfinite(values[found[0]]):  # the tangent is exactly singular
                break
            if values[found[0]] * values[low] > 0:
                low = max(low, found[0])
            else:
                high = min(high, found[0])
            halve = halve and high - low > 4 * _SEARCH.apart
        return place


def _nearest(places, place, always=()):
    """The coordinates `always`, and up to four others nearest to a coordinate, at least `apart` from one another."""
    chosen = list(always)
    for at in sorted(places, key=lambda at: abs(at - place)):
        if len(chosen) < 4 + len(always) and all(abs(at - other) >= _SEARCH.apart for other in chosen):
            chosen.append(at)
    return chosen


def _dips(counts, logarithms):
    """See `Chord.dips`; by the cubic through four values of the determinant, of given signs and logarithms."""
    if min(counts) < 0 or not np.isfinite(logarithms).all():
        return False
    values = (-1.0) ** np.array(counts) * np.exp(np.array(logarithms) - max(logarithms))
    roots = np.roots(np.polyfit([0.0, *_SEARCH.probes, 1.0], values, 3))
    near = roots[(np.abs(roots.real - 0.5) < 0.5 + _SEARCH.nearly) & (np.abs(roots.imag) < _SEARCH.nearly)]
    return len(near) > 1 + int((np.diff(np.sign(values)) != 0).sum())


def zero_of(function, low, high):
    """A zero of a function in [low, high]; the end with the smaller value where there is no change of sign."""
    a, b = function(low), function(high)
    if a * b > 0:
        return low if abs(a) < abs(b) else high
    from scipy.optimize import brentq  # imported here since it takes a quarter of a second and most runs do not need it

    return brentq(function, low, high, xtol=1e-15)


def _zero(places, values, low, high):
    """The root in [low, high] of the polynomial through values at coordinates."""
    return zero_of(lambda at: float(np.dot(lagrange(places, at), values)), low, high)
