"""Continuation of an equilibrium path: load control where it works, else arc length; on request onto a branch.

Arc length passes limit points, snap-through and snap-back. The unknowns are (x, eta); the corrector stays in the plane
through the predictor, perpendicular to the predicted step (pseudo-arc-length: Keller, in: Applications of Bifurcation
Theory, 1977, 359). The metric of arc length sums (r, q) and eta with a weight such that both count equally where the
path is stiffest so far; elsewhere (r, q) dominate, so that the path is smooth in its arc length at limit points too.
"""

import itertools
import math
from dataclasses import dataclass, replace
from functools import cached_property

from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.numerics import lagrange
from cosserat_fenicsx.statics.path.events import UNEXPLAINED, Chord, Locator, Lost
from cosserat_fenicsx.statics.path.load_control import Continuation, StepControl, Sweep
from cosserat_fenicsx.statics.path.track import LIMITS, NEAR, Track, bends, between, step_control, through

#: Control parameters of the continuation, see `solve`.
CONTROLS = ("auto", "load", "arc")
_PATIENCE = 4  # rejected steps of load control after which arc length takes over
_RECORDED = 2.0  # largest growth after the first step where steps are results
_TRIES = 8  # largest number of halvings of the first step onto a branch


def standing(problem, newton, stability, load_factor):
    """The `Track` of a loaded problem at a load factor, reached by load control, or NotConverged."""
    follower = Follower(problem, newton, stability, StepControl(), control="load")
    follower.begin([load_factor])
    if load_factor and not follower.to(load_factor):
        raise NotConverged(f"no equilibrium was found at the load factor {load_factor:g}: {follower.track.failure}")
    return follower.track


class Follower:
    """Advances along the path from one requested load factor to the next; control: "auto", "load" or "arc"; branch: 1
    or -1 to leave the path at the first bifurcation, 0 to stay; on_event: called with every `Crossing`.

    fork: the `Crossing` at which the path is left for a branch, once it is located; left: whether it was left; used:
    "arc" once arc length was used, else "load".
    """

    def __init__(self, problem, newton, stability, steps, *, control="auto", branch=0, on_event=None):
        most = steps.max_iterations or (10 if problem.model.carries_force else 30)
        self.track = Track(problem, newton, stability, most)
        self._steps, self._control, self._on_event = steps, control, on_event
        self._branch = self._sign = branch
        self._load = Continuation(self.track, steps, self._watch)
        self._auto = control == "auto" and steps.adaptive
        self.fork, self.left, self.used = None, False, "load"

    @cached_property
    def locator(self):
        return Locator(self.track)

    @cached_property
    def _arc(self):
        return ArcLength(self.track, self._steps, self.locator, self._meet)

    @property
    def smallest(self):
        """The smallest step of the load factor that was allowed."""
        return self._load.c.smallest

    def begin(self, load_factors, start=None, *, recorded=True):
        """Begin the path over these load factors: apply the permanent loads in steps, and solve at load factor 0, from
        the reference or from a state there (`start`, arguments of `Problem.begin_at`); recorded: whether steps between
        them are results. Raises NotConverged."""
        problem, track = self.track.problem, self.track
        self._load.c.first = _RECORDED if recorded else LIMITS.first
        self._load.reach = float(max(map(abs, load_factors))) or 1.0
        if start is not None:
            return self._begin_at(start)
        track.begin_here()
        if problem.begins:
            steps = replace(self._steps, first=None, largest=None, adaptive=True)
            if not Continuation(track, steps).to(1.0):
                softer = ", softer walls or obstacles" * any(x.at_nodes for x in problem.model.scene.actions)
                raise NotConverged(
                    f"no equilibrium under the permanent loads was found beyond {track.here.load_factor:.3g} of them: "
                    f"{track.failure}. Are the units those of SI (N, m, Pa), and do supports hold every rod? Otherwise "
                    f"try more elements{softer}, or loads that are not permanent"
                )
            problem.end_beginning()
            track.begin_here()
        if any(kind.scaled == "full" for kind in problem.model.signature.terms):
            if not track.at_load(track.here.numbers, 0.0).converged:
                raise NotConverged(f"no equilibrium was found at the load factor 0: {track.failure}")
            track.begin_here()

    def _begin_at(self, start):
        """Begin at a state under all permanent loads, at the load factor 0."""
        problem, track = self.track.problem, self.track
        if problem.begins:
            problem.end_beginning()
        problem.begin_at(*start)
        numbers = problem.numbers()
        solved = track.at_load(numbers, 0.0)
        if not solved.converged or track.distance(problem.numbers(), numbers) > NEAR:
            reason = "the nearest equilibrium is another one" if solved.converged else track.failure
            raise NotConverged(
                f"no equilibrium was found next to the last one of the stage before: {reason}. Where that one may turn "
                "or move freely, as a buckled round column may about its axis, a support or a small load decides"
            )
        track.begin_here()

    def to(self, load_factor, *, on_step=None, once=False):
        """Advance to a load factor, which is reached exactly; on_step: called with every accepted `PathPoint`; once:
        return after the first accepted step of load control. False where the path could not be continued:
        `track.failure` gives the reason, and the state is that of `track.here`."""
        track, here = self.track, self.track.here
        done = self._advance(load_factor, on_step, once)
        if self.fork and not self.left:
            self.left, self._branch, self.used = True, 0, "arc"
            first = self._onto(self.fork)
            if first is not None:
                done = self._arc.to(load_factor, first=first, on_step=on_step)
        if not done and self._auto and track.here is here:  # arc length made no step: load control down to its smallest
            return self._load.to(load_factor, on_step=on_step)
        if done and self.used == "arc" and len(track.history) > 1:
            before, here = track.history[-2:]
            self._load.c.step = abs(here.load_factor - before.load_factor)
        return done

    @property
    def in_c(self):
        """Whether points may be found in C (`Sweep`): by one process, without Python code between them."""
        model = self.track.model
        return model.comm.size == 1 and not (model.actions.memory or model.signature.lives_along_rods)

    @property
    def sweeps(self):
        """Whether the next steps may be taken in C: load control alone."""
        track = self.track
        unsure = track.here.negative_modes and track.without_potential
        return (
            self.in_c and self._steps.adaptive and self._control != "arc" and track.neutral is None
            and not (unsure or track.watches_steps or track.touching)
        )  # fmt: skip

    def sweep(self, load_factors, *, every, counted):
        """`Sweep.along` from the last point, after `begin`."""
        self._load.begin()
        return self.points.along(self.track, load_factors, self._load, _PATIENCE, every=every, counted=counted)

    @property
    def points(self):
        """The `Sweep` of the problem, which keeps it."""
        problem = self.track.problem
        if problem.sweep is None:
            problem.sweep = Sweep(self.track, problem.fields)
        return problem.sweep

    def to_fork(self, load_factor):
        """Advance towards a load factor up to the first bifurcation; whether one was found."""
        self._advance(load_factor, None)
        return self.fork is not None

    def _advance(self, load_factor, on_step, once=False):
        """Advance to the load factor; False where the path fails or is to be left for a branch before."""
        if self._control != "arc":
            patience = _PATIENCE if self._auto else None
            done = self._load.to(load_factor, on_step=on_step, patience=patience, once=once)
            if done or not self._auto or (self.fork and not self.left):
                return done
        self.used = "arc"
        return self._arc.to(load_factor, on_step=on_step)

    def _meet(self, crossing):
        """Report a `Crossing`; True where the path is to be left there."""
        if self._on_event:
            self._on_event(crossing)
        if self._branch and crossing.kind == "bifurcation":
            self.fork = crossing
        return self.fork is not None and not self.left

    def _watch(self, a, b, plain):
        """Report bifurcations in a step of load control; False to leave the path there, None where it is too long."""
        looks = a.negative_modes != b.negative_modes or (b.negative_modes > 0 and self.track.without_potential)
        if not (looks and (self._on_event or self._branch)):
            return True
        try:
            crossings = self.locator.bifurcations(Chord.balanced(self.track, a, b))
        except Lost as lost:
            self.track.failure = lost.reason
            return None
        if self._auto and not plain and not self.locator.counts_agree(a, b, crossings):
            self.track.failure = UNEXPLAINED  # arc length finds out whether the path has turned
            return None
        self.track.put(b.numbers, b.load_factor)
        return not any(self._meet(crossing) for crossing in crossings)

    def _onto(self, fork):
        """The first `PathPoint` on the branch at a bifurcation, corrected across the mode; None where none is found."""
        track = self.track
        base = fork.point
        track.history = [base]
        size = LIMITS.intended / track.model.largest(fork.direction)
        for _ in range(_TRIES):
            guess = [values.copy() for values in base.numbers]
            guess[0] += self._sign * size * fork.direction
            solved = track.on_plane(guess, base.load_factor, fork.direction, 0.0)
            if solved.converged:
                numbers = track.problem.numbers()
                if track.distance(numbers, guess) < 0.5 * track.distance(guess, base.numbers):
                    point = track.point(solved)
                    if fork.partner is not None and track.stability.whole.is_neutral():
                        track.neutral = fork.partner
                        point.negative_modes = track.stability.count(neutral=True)
                    return point
            size /= 2
        track.failure = "no branch was found at the bifurcation"
        track.restore()
        return None


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
        """Reduce the weight of the load factor where the path is stiffer: limit points would be sharp bends."""
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
        """Whether the step from a to b passes an earlier point: the solution in the plane there is the same state."""
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
        """(numbers, load factor) at the arc length `step` from the last point, by a polynomial with its tangent."""
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
        growth = self._lib.step_growth(self._limits, off, order, solved.iterations, False)
        self._step = max(self._step, length * growth) if growth >= 1 else length * growth
        return point

    def _shorten(self, share=0.5):
        self._step *= share
        self.track.restore()
