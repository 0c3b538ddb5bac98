"""Critical points between two neighbouring points of a path (limit points, bifurcations), and a requested load factor.

At a limit point the load factor has an extremum, and the null vector of the tangent is the direction of the path. At a
bifurcation the load factor is monotonic, and the null vector is another motion. A change in the number of negative
modes indicates a critical point. But the second variation that is counted has bounded stiffnesses, and under loads
without a potential it is the symmetric part of the tangent alone. So an event is listed only if the stiffness of the
tangent against the mode changes its sign between the two points and is negligible at the point that is located.

The segment of the path between two neighbouring points is a `Chord`. The coordinate of a point of the segment is its
projection on the chord, 0 at the point a and 1 at b. The point at a coordinate is found by Newton's method in the plane
perpendicular to the chord there, which works at limit points too.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.numerics import lagrange
from cosserat_fenicsx.statics.path.track import PathPoint, bends, between, through


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
        """(coordinate, `PathPoint`) at a coordinate, or beside it by a singular tangent; None without convergence."""
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
        """A coordinate where the count of negative modes is not monotonic, or None. Sets `dips`, `varies`."""
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


@dataclass(frozen=True)
class Tolerances:
    """Settings that distinguish events from each other, and from rounding."""

    # Two eigenvalues vanish at the same point where one is below this times its size at the ends of the chord while the
    # other vanishes.
    same: float = 1e-5
    most: int = 25  # iterations for a requested load factor
    singular: float = 1e-5  # largest residual of an event, see `Crossing`
    alike: float = 0.7  # smallest cosine of the null vectors of one event that was found twice
    one_place: float = 1e-2  # largest difference of its coordinates on the chord
    level: float = 1e-10  # relative difference of two load factors that may be rounding
    # Largest change of the logarithm of the bordered tangent's determinant within a step without a bifurcation.
    bordered: float = math.log(30.0)


_TOLERANCES = Tolerances()

#: Why a step is shortened, in words.
UNEXPLAINED = "the number of negative modes does not change as the located critical points require"
NEARLY = "two modes are almost neutral at once"
EXCHANGED = "a negative mode is exchanged for another one"
ASIDE = "the path turns away just before the tangent becomes singular"


@dataclass(frozen=True, eq=False)
class Crossing:
    """A limit point or bifurcation that was located: its `PathPoint`, interpolated between its neighbours, and place on
    the chord (0 to 1).

    direction: a change of the owned unknowns: the tangent of the path at a limit point, the mode at a bifurcation;
    residual: see `Event`; null: (nodes, 6) the null vector, see `BorderedNewton.response`; partner: the direction of a
    second mode at the same load factor, or None.
    """

    kind: str
    point: PathPoint
    place: float
    direction: np.ndarray
    residual: float
    null: np.ndarray
    partner: np.ndarray | None = None


class Lost(Exception):
    """A step is too long to resolve the critical points within it; share: of the step to keep; reason: in words."""

    def __init__(self, share, reason="the critical points within a step could not be resolved"):
        super().__init__(reason)
        self.share, self.reason = share, reason


class Locator:
    """Finds limit points, bifurcations and requested load factors between two points of a `Track`."""

    def __init__(self, track):
        self.track = track

    def between(self, a, b, load_factor, weight, *, probe=True, explained=True, short=False):
        """(landing, crossings) between two `PathPoint`s, the track at a: the first `PathPoint` with the load factor
        after a, or None; the `Crossing`s up to there, in the order of the path.

        weight: of the load factor in the metric; probe: whether to check for negative modes that appear and vanish
        between them; explained: whether their number must change as the critical points require; short: whether the
        step is too short to lead to another path unnoticed. Raises Lost where one of these checks fails, or the point
        to land on was not found. Without `probe` a is the bifurcation where the path was left: rounding decides the
        number of negative modes there, and no bifurcation is looked for, which would be the same one.
        """
        chord = Chord(self.track, a, b, weight, short=short)
        place = chord.comes_and_goes() if probe else None
        if place is not None:
            raise Lost(place)
        limits = self.limits(chord)
        ends = [(0.0, a), *((limit.place, limit.point) for limit in limits), (1.0, b)]
        landing = place = None
        for (low, before), (high, after) in itertools.pairwise(ends):
            lands = after.load_factor == load_factor
            if lands or (before.load_factor - load_factor) * (after.load_factor - load_factor) < 0:
                place, landing = self._land(chord, low, high, before, after, load_factor)
                break
        crossings = self.crossings(chord, limits) if probe else limits
        if probe and explained and not self._explained(a, b, crossings):
            raise Lost(0.5, UNEXPLAINED)
        located = sum(crossing.kind == "bifurcation" for crossing in crossings)
        if probe and not short and ((chord.dips and located < 2) or (not located and _near_bifurcation(a, b))):
            raise Lost(0.5, NEARLY)
        if chord.varies and not short and not self.track.keeps_modes(a, b):
            raise Lost(0.5, EXCHANGED)
        if landing is not None:
            crossings = [crossing for crossing in crossings if crossing.place <= place]
        return landing, crossings

    def _explained(self, a, b, crossings):
        """Whether two points agree with the critical points between them: the load factor turns at a limit point alone,
        and elsewhere changes in the direction of the path. Each critical point changes the number of negative modes by
        one, unless the loads have no potential."""
        limits = [crossing.point for crossing in crossings if crossing.kind == "limit"]
        if (a.rise * b.rise < 0) != bool(limits):
            return False
        parts = [(a, limits[0], a.rise), (limits[0], b, b.rise)] if limits else [(a, b, a.rise)]
        for begin, end, rise in parts:
            rounding = _TOLERANCES.level * abs(end.load_factor)
            if (end.load_factor - begin.load_factor) * math.copysign(1.0, rise) < -rounding:
                return False
        return self.counts_agree(a, b, crossings)

    def counts_agree(self, a, b, crossings):
        """Whether the numbers of negative modes of two points agree with the critical points between them."""
        counts = a.negative_modes, b.negative_modes
        if min(counts) < 0 or self.track.without_potential:
            return True
        change = abs(counts[1] - counts[0])
        return change <= len(crossings) and (len(crossings) - change) % 2 == 0

    def crossings(self, chord, limits=None):
        """All `Crossing`s of a `Chord`, in order; limits: its limit points where they are known. Raises Lost where a
        bifurcation was located and the path does not pass."""
        limits = self.limits(chord) if limits is None else limits
        found = [*limits, *self.bifurcations(chord, limits)]
        return _in_order([crossing for crossing in found if crossing.residual <= _TOLERANCES.singular])

    def limits(self, chord):
        """[the `Crossing` at the extremum of the load factor], whatever its residual; empty without one. Raises Lost
        where it was located and the path does not pass."""
        (_, a), (_, b) = chord.known[0], chord.known[-1]
        if a.rise * b.rise >= 0:
            return []
        place = chord.root(lambda point: point.rise)
        if not chord.passes(place, turning=True):
            raise Lost(0.5, ASIDE)
        direction = chord.neighbours(place)[0].along
        return self._singular("limit", chord, place, [direction])

    def bifurcations(self, chord, limits=()):
        """The `Crossing`s where the tangent becomes singular away from limit points. Raises Lost where the path does
        not pass one: an imperfect structure turns away before it, and the chord leads from its path to another one."""
        counts = [point.negative_modes for _, point in (chord.known[0], chord.known[-1])]
        if min(counts) < 0:  # singular to rounding at one of the two
            return []
        held = self.track.problem.tensions
        candidates = self._by_tangent if self.track.without_potential else self._softest if held else self._by_count
        found = []
        for near, point, modes in candidates(chord, sorted(counts), limits):
            if not modes:  # rounding hides them
                continue
            motion = self.track.motion_at(point, modes[0])
            place = chord.root(lambda at, v=motion: self.track.response(at.numbers, at.load_factor, v)[0], near)
            if place is not None:
                here = self._singular("bifurcation", chord, place, modes)
                here = [x for x in here if x.residual <= _TOLERANCES.singular and not self._known(x, (*limits, *found))]
                if here and not chord.passes(place, turning=False):
                    raise Lost(0.5, ASIDE)
                found += here
        return _in_order(found)

    def _known(self, crossing, others):
        """Whether one of other `Crossing`s has the same null vector at the same point."""
        near = [other for other in others if abs(other.place - crossing.place) < _TOLERANCES.one_place]
        return any(abs(self.track.bordered.work(other.null, crossing.null)) > _TOLERANCES.alike for other in near)

    def _by_count(self, chord, counts, limits):
        """(coordinate, `PathPoint`, modes) of eigenvalues that change their sign, without those of limit points."""
        first, last = counts
        if last - first == len(limits):
            return []
        found, j = [], first
        while j < last:
            place, point, together = self._vanishing(chord, j, last)
            found.append((place, point, together, j))
            j += together
        for limit in limits:  # the nearest zero of an eigenvalue is that of the limit point
            if found:
                found.remove(min(found, key=lambda item: abs(item[0] - limit.place)))
        return [(place, point, self._modes(chord, place, point, *more)) for place, point, *more in found]

    def _by_tangent(self, chord, counts, limits):
        """(None, `PathPoint`, [mode]) for each negative mode at one end: under loads without a potential the tangent
        can be singular only where its symmetric part is indefinite."""
        if not counts[-1]:
            return []
        end = self._at_softer_end(chord)
        return [(None, end, [mode]) for mode in self.track.stability.whole.modes(counts[-1], side=-1)]

    def _at_softer_end(self, chord):
        """The `PathPoint` of the end with more negative modes, to which the problem is put."""
        end = max(chord.known[0][1], chord.known[-1][1], key=lambda point: point.negative_modes)
        self.track.put(end.numbers, end.load_factor)
        return end

    def _softest(self, chord, counts, limits):
        """As `_by_tangent`, with given lengths of tendons: the motions resisted least where negative modes are more."""
        first, last = counts
        if last - first == len(limits):
            return []
        end = self._at_softer_end(chord)
        return [(None, end, [mode]) for mode in self.track.bordered.softest(last - first)]

    def _singular(self, kind, chord, place, directions):
        """The `Crossing`s at a coordinate, one for each direction (a change of the unknowns, owned entries)."""
        track, found = self.track, []
        numbers, load_factor = chord.guess(place)
        before, after = chord.neighbours(place)
        point = PathPoint(load_factor, numbers, min(before.negative_modes, after.negative_modes), 0)
        partners = directions[::-1] if len(directions) == 2 else [None] * len(directions)
        for direction, partner in zip(directions, partners, strict=True):
            motion = track.motion_at(before, direction)
            at_rest, _ = track.response(track.origin.numbers, track.origin.load_factor, motion)
            resistance, null = track.response(numbers, load_factor, motion)
            residual = abs(resistance / at_rest) if at_rest else math.inf
            found.append(Crossing(kind, point, place, direction, residual, null, partner))
        return found

    def _modes(self, chord, place, point, together, j):
        """The modes whose eigenvalues, from the j-th on, change sign at a coordinate.

        In a structure with a very soft member other eigenvalues may be as close to zero. Then the mode is taken from
        the nearest point where its eigenvalue is negative by the count and by the factors that give modes, which
        differ by rounding next to a singular point.
        """
        track, stability = self.track, self.track.stability.whole
        track.put(point.numbers, point.load_factor)
        modes = stability.modes(together)
        if together > 1:
            return modes
        for _, unstable in sorted(chord.known, key=lambda known: abs(known[0] - place)):
            if unstable.negative_modes != j + 1:
                continue
            track.put(unstable.numbers, unstable.load_factor)
            if stability.factor() <= j:
                continue
            negative = stability.modes(1, side=-1)
            if not modes or not negative:
                return modes or negative
            alike = 0.25 * track.square(negative[0]) * track.square(modes[0])
            return negative if track.product(negative[0], modes[0]) ** 2 < alike else modes
        return modes

    def _vanishing(self, chord, j, last):
        """Where the j-th eigenvalue vanishes: (coordinate, `PathPoint`, how many before `last` vanish there)."""
        track = self.track

        def eigenvalue(point, j=j):
            track.put(point.numbers, point.load_factor)
            return track.stability.whole.eigenvalue(j)

        place = chord.root(eigenvalue)
        place = 0.5 if place is None else place  # rounding hides the change of sign
        numbers, load_factor = chord.guess(place)
        negative = min(point.negative_modes for _, point in (chord.known[0], chord.known[-1]))
        point = PathPoint(load_factor, numbers, negative, 0)
        together = 1
        while j + together < last:
            ends = max(abs(eigenvalue(end, j + together)) for _, end in (chord.known[0], chord.known[-1]))
            if abs(eigenvalue(point, j + together)) > _TOLERANCES.same * ends:
                break
            together += 1
        return place, point, together

    def _land(self, chord, low, high, before, after, load_factor):
        """(coordinate, `PathPoint`) at a load factor between two coordinates, by Newton's method."""
        track = self.track
        for _ in range(_TOLERANCES.most):
            place = zero_of(lambda at: chord.load_factor(at) - load_factor, low, high)
            predicted, _ = chord.guess(place)
            solved = track.at_load(predicted, load_factor)
            if solved.converged:
                numbers = track.problem.numbers()
                ends = track.distance(before.numbers, after.numbers)
                if track.distance(numbers, predicted) <= 0.2 * ends:
                    return place, track.point(solved)
            found = chord.at(place)
            if found is None:
                break
            place, point = found
            if point.load_factor == load_factor:
                return place, point
            if (point.load_factor - load_factor) * (after.load_factor - load_factor) < 0:
                low, before = place, point
            else:
                high, after = place, point
        raise Lost(0.5)


def _near_bifurcation(a, b):
    """Whether a bifurcation is close to one of two points: the determinant of the tangent bordered with the path's
    direction, which is the tangent's over the rise of the load factor, changes much; at limit points it is regular."""
    if not a.rise or not b.rise:
        return False
    change = b.logarithm - a.logarithm - math.log(abs(b.rise / a.rise))
    return abs(change) > _TOLERANCES.bordered  # not where it is unknown


def _in_order(crossings):
    return sorted(crossings, key=lambda crossing: crossing.place)
