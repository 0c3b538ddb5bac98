"""Continuation in the arc length of the path: past limit points, through snap-through and snap-back.

The unknowns are (x, eta); the corrector stays in the plane through the predictor, perpendicular to the predicted step
(pseudo-arc-length: Keller, in: Applications of Bifurcation Theory, 1977, 359). The metric of arc length sums (r, q) and
eta with a weight such that both count equally where the path is stiffest so far; elsewhere (r, q) dominate, so that the
path is smooth in its arc length at limit points too.
"""

import itertools
import math
from dataclasses import dataclass

from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.numerics import lagrange
from cosserat_fenicsx.statics.path.events import UNEXPLAINED, Lost
from cosserat_fenicsx.statics.path.track import LIMITS, bends, between, step_control, through


@dataclass(frozen=True)
class Steps:
    """Settings of steps of arc length, and of what is recognised on the way."""

    bend: float = 0.4  # largest distance of the corrected point from the predictor, over the length of the step
    # The same where the number of negative modes changes without a limit point: the step may have changed to another
    # branch.
    sure: float = 0.1
    # A closed path: largest distance over the step's length at which a step passes the path's first point, and at which
    # the path itself passes it there.
    beside: float = 0.1
    same: float = 1e-4
    # A step is on the path whatever the number of negative modes: largest length, over that of the path from the
    # unloaded state, and largest turn (rad).
    short: float = 3e-3
    straight: float = 0.05
    met: float = 1e-7  # largest relative difference of the load factors of one limit point; its root for the states
    excuses: int = 4  # plain steps whose negative modes change without an event, before these are no longer compared
    first: float = 0.02  # smallest first step, over the length of the path from the unloaded state


_STEPS = Steps()

_CLOSED = "the path is closed: it returned to an earlier point without reaching that load factor"
# A path that has begun at the unloaded state returns to an earlier point only after passing that state again.
_CHANGED = (
    "the path has changed to another branch: it returned to an earlier point without passing the unloaded state "
    "(smaller steps, by StepControl(largest=...), may stay on the path)"
)


def plain(track, a, b, weight, scale):
    """Whether a step between two points with tangents is so short and straight that it cannot have changed to another
    path; scale: the length of the path from the unloaded state."""
    found = bends(track, a, b, weight)
    return found.length < _STEPS.short * scale and found.turn < _STEPS.straight and found.corner < _STEPS.straight / 10


class ArcLength:
    """Advances a `Track` in steps of arc length, by a `StepControl` and a `Locator`; `on_event` is called with every
    `Crossing`, and the continuation ends there where it returns True."""

    def __init__(self, track, control, locator, on_event):
        self.track, self.control, self._locator, self._on_event = track, control, locator, on_event
        self._step, self._branched = None, False
        self._lib, self._limits = step_control()
        # Whether the number of negative modes may change in the next step without critical points: the second variation
        # that is counted has bounded stiffnesses, so that this happens in plain steps, too. After a number of such
        # steps the number is no longer compared.
        self._excused, self._excuses = False, 0

    def to(self, load_factor, *, first=None, on_step=None):
        """Advance to the next point of the path with a load factor, solved at exactly that; first: the first
        `PathPoint` on a branch, which `Track.on_plane` has just found; on_step: called with every accepted `PathPoint`,
        the last one included. False where the steps became too small or too many: the track's `failure` gives the
        reason."""
        track = self.track
        if first is None:
            self._set_out(load_factor)
        else:
            self._branch_off(first)
        begin, steps, limits, home = first, 0, [], first is not None or self._branched
        self._branched = home
        for _ in range(self.control.most_steps):
            branching, point, first = first is not None, first or self._attempt(), None
            if point is not None:
                try:
                    landing, crossings = self._locator.between(
                        track.here, point, load_factor, self._weight,
                        probe=not branching, explained=not self._excused, short=not branching and self._plain(point),
                    )  # fmt: skip
                except Lost as lost:
                    track.failure = lost.reason
                    if branching:
                        return track.restore()
                    if lost.reason == UNEXPLAINED and self._plain(point):
                        self._excused, self._excuses = True, self._excuses + 1
                    else:
                        self._step = self._length(track.here, point)
                    point = self._shorten(lost.share)
            if point is None:
                if self._step < self.control.smallest * self._scale:
                    return False
                continue
            begin, steps = begin or point, steps + 1
            home = home or self._share(track.origin, track.here, point) is not None
            if steps > 3 and self._passes(begin, track.here, point):
                track.failure = _CLOSED if home else _CHANGED
                return track.restore()
            for crossing in crossings:
                if crossing.kind == "limit" and any(self._again(crossing, other) for other in limits):
                    track.failure = _CHANGED
                    return track.restore()
                limits += [crossing] * (crossing.kind == "limit")
                if self._on_event(crossing):
                    track.restore()
                    return True
            self._accept(landing or point, point)
            self._excused = self._excuses > _STEPS.excuses
            if on_step:
                on_step(track.here)
            if landing is not None:
                return True
        track.failure = f"{self.control.most_steps} steps of arc length did not reach it (StepControl.most_steps)"
        return track.restore()

    def _plain(self, point):
        """Whether a step is so short and straight that it cannot have changed to another path."""
        return plain(self.track, self.track.here, point, self._weight, self._scale)

    def _accept(self, point, end):
        """Accept a point, within the step from the last point to `end` or at its end."""
        track = self.track
        track.put(point.numbers, point.load_factor)
        if len(track.history) > 1 and self._length(track.here, point) < 0.05 * self._length(track.here, end):
            track.history.pop()  # the predictor interpolates, which needs points that are not too close
        track.keep(point)

    def _set_out(self, load_factor):
        """Choose weight, direction and first step at the last point."""
        track = self.track
        here = track.here
        track.restore()
        track.stability.count(neutral=track.neutral is not None)
        here.logarithm = track.stability.logarithm
        slope = track.slope()
        self._weigh(slope)
        if len(track.history) == 1:  # towards the load factor
            change = self.control.first or abs(load_factor - here.load_factor) / 10 or 0.1
            self._step = self._scale = change * track.length((slope, 1.0), self._weight)
            towards = 0 * slope, math.copysign(1.0, load_factor - here.load_factor)
            track.set_tangent(here, slope, towards, self._weight)
            return
        before = track.history[-2]
        track.set_tangent(here, slope, between(before, here), self._weight)
        last = self._length(before, here)
        self._scale = self._length(track.origin, here) or last
        self._step = min(max(last, _STEPS.first * self._scale), 0.1 * self._scale)

    def _branch_off(self, first):
        """Choose weight, direction and first step where the last point is a bifurcation."""
        track = self.track
        here, slope = track.here, track.bordered.slope
        self._weigh(slope)
        track.set_tangent(first, slope, between(here, first), self._weight)
        here.rise = 0.0
        self._step = self._scale = self._length(here, first)

    def _weigh(self, slope):
        track = self.track
        moved, change = between(track.origin, track.here)
        local = track.square(slope)
        self._weight = min(local, track.square(moved) / change**2) if change else local
        self._weight = self._weight or 1.0

    def _weigh_less(self):
        """Reduce the weight of the load factor where the path is stiffer than before; else it would dominate the
        metric, in which a limit point would be a sharp bend."""
        track = self.track
        here, weight = track.here, self._weight
        if not here.rise:
            return
        local = track.product(here.along, here.along) / here.rise**2
        if 0 < local < weight:
            shrunk = math.sqrt(2 * local / (local + weight))
            self._weight = local
            here.rise, here.along = here.rise / shrunk, here.along / shrunk
            self._step *= shrunk
            self._scale *= shrunk

    def _passes(self, place, a, b):
        """Whether the step from a to b passes through an earlier point of the path, in the path's direction there: the
        solution in the plane through that point, perpendicular to the path, must be the same state."""
        track, w = self.track, self._weight
        chord, tangent = between(a, b), (place.along, place.rise)
        onward = track.dot(tangent, chord, w)
        if onward <= 0 or self._share(place, a, b) is None:
            return False
        share = track.dot(tangent, between(a, place), w) / onward  # in the plane of the place
        guess = [u + share * (v - u) for u, v in zip(a.numbers, b.numbers, strict=True)]
        solved = track.on_plane(guess, a.load_factor + share * chord[1], place.along, w * place.rise)
        off = track.problem.numbers()[0] - place.numbers[0], track.problem.load_factor - place.load_factor
        same = solved.converged and track.length(off, w) <= _STEPS.same * track.length(chord, w)
        return same and track.point(solved).negative_modes == place.negative_modes

    def _share(self, place, a, b):
        """The share of the step from a to b after which it passes beside an earlier point; None where it does not."""
        track, w = self.track, self._weight
        chord, moved = between(a, b), between(a, place)
        size, along = track.dot(chord, chord, w), track.dot(moved, chord, w)
        beside = track.dot(moved, moved, w) - along**2 / size
        return along / size if 0 <= along < size and beside < (_STEPS.beside**2) * size else None

    def _again(self, limit, other):
        """Whether two limit points are the same one, passed in the same direction."""
        track, a, b = self.track, limit.point, other.point
        apart = track.distance(a.numbers, b.numbers)
        near = abs(a.load_factor - b.load_factor) <= _STEPS.met * max(abs(a.load_factor), abs(b.load_factor))
        return near and apart <= _STEPS.met**0.5 and track.product(limit.direction, other.direction) > 0

    def _length(self, a, b):
        return self.track.length(between(a, b), self._weight)

    def _predict(self, step):
        """Predictor (numbers, load factor) at the arc length `step` from the last point: a polynomial through the last
        points with the tangent at the last one; carried fields (n) without the tangent."""
        history = self.track.history
        here = history[-1]
        lengths = [self._length(a, b) for a, b in itertools.pairwise(history)]
        places = [-sum(lengths[i:]) for i in range(len(lengths))]
        numbers, _ = through(history, [*places, 0.0], step)
        numbers[0] = here.numbers[0] + step * here.along
        load_factor = here.load_factor + step * here.rise
        for weight, place, point in zip(lagrange(places, step), places, history, strict=False):
            weight *= (step / place) ** 2
            numbers[0] += weight * (point.numbers[0] - here.numbers[0] - place * here.along)
            load_factor += weight * (point.load_factor - here.load_factor - place * here.rise)
        return numbers, load_factor

    def _attempt(self):
        """One step: predictor, corrector, checks. A `PathPoint`, not yet accepted; None where the step is reduced."""
        obey()
        self._weigh_less()
        track = self.track
        here = track.here
        predicted, load_factor = self._predict(self._step)
        bound = self.control.largest
        if bound and abs(load_factor - here.load_factor) > bound:
            self._step *= 0.9 * bound / abs(load_factor - here.load_factor)
            predicted, load_factor = self._predict(self._step)
        increment = predicted[0] - here.numbers[0], load_factor - here.load_factor
        length = track.length(increment, self._weight)
        solved = track.on_plane(predicted, load_factor, increment[0], self._weight * increment[1])
        if not solved.converged:
            return self._shorten()
        numbers, found = track.problem.numbers(), track.problem.load_factor
        if bound and abs(found - here.load_factor) > bound:
            return self._shorten(0.9 * bound / abs(found - here.load_factor))
        off = track.distance(numbers, predicted)
        bend = track.length((numbers[0] - predicted[0], found - load_factor), self._weight) / length
        order = len(track.history) + 1
        if off > LIMITS.far or bend > _STEPS.bend:
            track.failure = "the path bends too sharply"
            return self._shorten()
        point = track.point(solved)
        track.set_tangent(point, track.bordered.slope, between(here, point), self._weight)
        if not bends(track, here, point, self._weight).resolved:
            track.failure = "the path bends too sharply"
            return self._shorten()
        if point.negative_modes != here.negative_modes and point.rise * here.rise > 0 and bend > _STEPS.sure:
            track.failure = "the step crossed a point where stability changes"
            return self._shorten()
        off = max(off, LIMITS.intended / _STEPS.sure * bend)
        growth = self._lib.step_growth(self._limits, off, order, solved.iterations)
        self._step = max(self._step, length * growth) if growth >= 1 else length * growth
        return point

    def _shorten(self, share=0.5):
        self._step *= share
        self.track.restore()
