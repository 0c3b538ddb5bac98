"""What lies between two neighbouring points of a path: limit points, bifurcations, a requested load factor."""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.statics.chord import Chord, zero_of
from cosserat_fenicsx.statics.track import Point

# Eigenvalues vanish together where one is this small over its size at the ends of the chord when the other vanishes.
_SAME = 1e-5
# Most points tried to land on a load factor.
_MOST = 25


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
    """Two points are too far apart for what lies between them: go no farther than the place, its argument."""


class Locator:
    """Finds limit points, bifurcations and requested load factors between two points.

    Args:
        track: the `Track`.
    """

    def __init__(self, track):
        self.track = track

    def between(self, a, b, target, weight, *, probe=True):
        """What lies between two points, in order.

        Args:
            a, b: the `Point`s; the track stands at a.
            target: load factor.
            weight: of the load factor in the metric.
            probe: look for modes that come and go between them.

        Returns:
            (landing, crossings): the first `Point` with the load factor `target` after a, or None; the `Crossing`s
            up to there.

        Raises:
            Lost: the landing failed, or negative modes come and go.
        """
        chord = Chord(self.track, a, b, weight)
        place = chord.comes_and_goes() if probe else None
        if place is not None:
            raise Lost(place)
        limits = self.limits(chord)
        ends = [(0.0, a), *((limit.place, limit.point) for limit in limits), (1.0, b)]
        landing = place = None
        for (low, before), (high, after) in itertools.pairwise(ends):
            if (before.load_factor - target) * (after.load_factor - target) < 0 or after.load_factor == target:
                place, landing = self._land(chord, low, high, before, after, target)
                break
        crossings = self.crossings(chord, limits)
        if landing is not None:
            crossings = [crossing for crossing in crossings if crossing.place <= place]
        return landing, crossings

    def crossings(self, chord, limits=None):
        """All `Crossing`s of a piece of path, in order; its limit points where they are known."""
        limits = self.limits(chord) if limits is None else limits
        return sorted([*limits, *self.bifurcations(chord, limits)], key=lambda crossing: crossing.place)

    def limits(self, chord):
        """The `Crossing` where the load factor turns, in a list that may be empty."""
        (_, a), (_, b) = chord.known[0], chord.known[-1]
        return [self.limit(chord)] if a.rise * b.rise < 0 else []

    def limit(self, chord):
        """The `Crossing` where the load factor turns."""
        place = chord.root(lambda point: point.rise)
        numbers, eta = chord.guess(place)
        a, b = chord.neighbours(place)
        point = Point(eta, numbers, min(a.negative_modes, b.negative_modes), 0)
        return Crossing("limit", point, place, a.along)

    def bifurcations(self, chord, limits=()):
        """The `Crossing`s where an eigenvalue of the second variation changes its sign and the load factor does not
        turn; those of limit points are left out."""
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
        return [crossing for item in found for crossing in self._singular(chord, *item)]

    def _singular(self, chord, place, point, together):
        """The `Crossing`s next to where eigenvalues of the second variation vanish: where the tangent itself is singular.

        The second variation is that of a rod of bounded stiffness, which shifts it slightly; and under loads that are not
        conservative its symmetric part may become indefinite where no other path crosses: then there is no crossing.
        """
        track = self.track
        modes = self._modes(chord, place, point, together)
        motion = modes[0] / math.sqrt(track.product(modes[0], modes[0]))

        def resistance(known):
            track.put(known.numbers, known.load_factor)
            return track.newton.bordered.resistance(motion)

        place = chord.polish(place, resistance)
        if place is None:
            return []
        numbers, eta = chord.guess(place)
        point = Point(eta, numbers, point.negative_modes, 0)
        partners = modes[::-1] if together == 2 else [None] * together
        return [
            Crossing("bifurcation", point, place, mode, partner) for mode, partner in zip(modes, partners, strict=True)
        ]

    def _modes(self, chord, place, point, together):
        """The modes that lose their stability there. Of a member that is far softer than the rest other modes may be as near to
        zero: then that of the point just behind, where it is negative."""
        track, stability = self.track, self.track.stability.whole
        track.put(point.numbers, point.load_factor)
        modes = stability.modes(together)
        behind = max(chord.neighbours(place), key=lambda known: known.negative_modes)
        if together == 1 and behind.negative_modes > point.negative_modes:
            track.put(behind.numbers, behind.load_factor)
            known = stability.modes(1, side=-1)
            if track.product(known[0], modes[0]) ** 2 < 0.25 * track.square(known[0]) * track.square(modes[0]):
                return known
        return modes

    def _vanishing(self, chord, j, last):
        """(place, `Point`, number of eigenvalues that vanish there together) for the j-th eigenvalue, of those below `last`."""
        track = self.track

        def eigenvalue(point, j=j):
            track.put(point.numbers, point.load_factor)
            return track.stability.whole.eigenvalue(j)

        place = chord.root(eigenvalue)
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

    def _land(self, chord, low, high, before, after, target):
        """(place, `Point`) of a requested load factor between two places: by Newton at that load factor."""
        track = self.track
        for _ in range(_MOST):
            place = zero_of(lambda at: chord.load_factor(at) - target, low, high)
            predicted, _ = chord.guess(place)
            solved = track.at_load(predicted, target)
            if solved.converged:
                numbers = track.problem.numbers()
                ends = track.distance(before.numbers, after.numbers)
                if track.distance(numbers, predicted) <= 0.2 * ends:
                    return place, track.point(solved)
            found = chord.at(place)
            if found is None:
                break
            place, point = found
            if point.load_factor == target:
                return place, point
            if (point.load_factor - target) * (after.load_factor - target) < 0:
                low, before = place, point
            else:
                high, after = place, point
        raise Lost(0.5)
