"""Continuation in the load factor: adaptive steps, predictors, and checks against changes of branch.

A slender rod has several equilibria under one load, and Newton's method from the straight state often converges to an
unstable one (the eccentric column jumps to the opposite side in one step at eta = 1.1). So a step is accepted only if
Newton's method converged near the predictor, not against its direction, and if no new negative mode appeared. A
negative mode that appears in steps of a thousandth of the path too is one of the path, which has lost its stability.

`Sweep` advances in C (algebra/sweep.c) as long as every step is accepted at once, or halved.
"""

import itertools
import math
from collections import namedtuple
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.algebra.building import Pointers
from cosserat_fenicsx.checks import number, refuse, whole
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.statics.path.track import LIMITS, NOTHING, PathPoint, Track, step_control, through
from cosserat_fenicsx.statics.problem import CHANGE

_FIRST_REJECTIONS = 3  # rejected steps from the first point after which the stiffness there limits the step
# Largest distance from the predictor, over the step's length, at which the number of negative modes may change; the
# second in steps below a thousandth of the reach, in which a smooth path crosses a bifurcation without a change of
# branch.
_SMOOTH, _NEAR = 0.01, 0.3
# The same distance below which such a change is accepted although no event explains it.
_EXPECTED = 1e-4
# Why a step is rejected, by the result of `judge_step` in C.
_REASONS = {
    "TOO_FAR": "the equilibrium jumped away from the path",
    "OPPOSITE": "the equilibrium lies opposite to the direction of the path",
    "UNSURE": "the equilibrium jumped away from the path's direction",
}
_ENDLESS = 2**30


@dataclass(frozen=True)
class StepControl:
    """How the load factor is stepped between the requested values.

    Args:
        first: first step of the load factor; None for a tenth of the way to the farthest requested value, or up to the
            first one where many rods respond nearly linearly. Where it is rejected a few times, it is limited by the
            tangent stiffness at the first point.
        smallest: smallest step over the farthest requested value, in (0, 1); the continuation fails where a smaller
            one would be needed. Where the structure is very soft at the first point, smaller steps are allowed.
        largest: largest step of the load factor; None for no bound.
        adaptive: False takes each requested value in one step, without checks of the branch; negative modes are
            counted nevertheless.
        max_iterations: Newton iterations allowed in a step; None for 10, or 30 for the formulation "displacement",
            which needs more of them.
        most_steps: steps of arc length allowed for one requested load factor, which may lie far along the path, or not
            on it at all.

    Raises:
        SceneError: a value outside its range.
    """

    first: float | None = None
    smallest: float = 1e-6
    largest: float | None = None
    adaptive: bool = True
    max_iterations: int | None = None
    most_steps: int = 1000

    def __post_init__(self):
        for name in ("first", "largest"):
            if getattr(self, name) is not None:
                number(self, name, getattr(self, name), "a positive load factor", lambda x: 0 < x < np.inf)
        number(self, "smallest", self.smallest, "a number in (0, 1)", lambda x: 0 < x < 1)
        if not isinstance(self.adaptive, bool):
            refuse(self, "adaptive", self.adaptive, "True or False")
        whole(self, "max_iterations", 1 if self.max_iterations is None else self.max_iterations)
        whole(self, "most_steps", self.most_steps)


class Continuation:
    """Advances a `Track` by load control; c: C's `step_control`, which a `Sweep` shares: its `step` is 0 until it is
    chosen.

    watch(a, b, plain) is called before the point b after a is accepted; plain: whether b is close to its predictor
    although the number of negative modes changes. False ends the continuation at a, None rejects the step. reach:
    largest size of the load factors of the path, to which steps are relative.
    """

    def __init__(self, track: Track, control: StepControl, watch=None, *, reach=1.0):
        self.track, self.control, self._watch, self.reach = track, control, watch, reach
        self._lib, self.c = step_control(largest=control.largest or math.inf)

    def begin(self):
        """Choose the step where none is known."""
        self.c.step = self.c.step or self.control.first or self.reach / 10
        self.c.smallest = self.control.smallest * self.reach

    def to(self, load_factor, *, on_step=None, patience=None, once=False):
        """Advance to a load factor, which is reached exactly; on_step: called with every accepted `PathPoint`;
        patience: rejected steps, without two successive accepted ones between, after which to stop; once: return after
        the first accepted step. False where too many steps were rejected, the steps became too small or `watch`
        returned False: the track's `failure` gives the reason, and its state is that of `here`."""
        control, track, c = self.control, self.track, self.c
        if not control.adaptive:
            return self._attempt(load_factor, guard=False, on_step=on_step)
        self.begin()
        self._refused, first = False, len(track.history) == 1
        c.patience, c.accepted = patience or _ENDLESS, False
        done = True
        while done and track.here.load_factor != load_factor:
            here = track.here.load_factor
            goal = self._lib.step_goal(c, here, load_factor)
            taken = abs(goal - here)
            # A new negative mode counts as one of the path itself once the step is this small.
            if self._attempt(goal, guard=taken > 1e-3 * self.reach, on_step=on_step):
                first = False
                if once:
                    break
                continue
            enough = self._lib.reject_step(c, taken)
            if first and c.rejections >= _FIRST_REJECTIONS:
                c.rejections, first, linear = 0, False, self._linear_step()
                c.step, c.smallest = min(c.step, linear), min(c.smallest, control.smallest * linear)
                enough = c.step < c.smallest
            if self._refused or enough:
                c.step, done = 0.0, False
        c.rejections = 0
        return done

    def _linear_step(self):
        """The step that moves the linearised structure as intended; infinite where the tangent is singular."""
        track = self.track
        try:
            moved = track.model.largest(track.slope())
        except NotConverged:
            return math.inf
        return LIMITS.intended / moved if moved else math.inf

    def _attempt(self, load_factor, *, guard, on_step):
        """One step: predictor, corrector, checks. Accepts it (True) or restores the last point (False)."""
        obey()
        track, adaptive = self.track, self.control.adaptive
        here = track.here
        predicted = self._predict(load_factor) if adaptive else here.numbers
        solved = track.at_load(predicted, load_factor)
        self.c.shrink = 0.5
        if not solved.converged:
            return track.restore()
        numbers = track.problem.numbers()
        off = track.distance(numbers, predicted)
        newton = track.newton.c  # its last solution is the whole step, unless contact needs more of them
        linear = solved.iterations == newton.iterations and self._lib.is_linear(self.c, newton, len(track.history))
        if adaptive and not self._near(numbers, predicted, off, load_factor, linear):
            return track.restore()
        point = track.point(solved)
        changed = point.negative_modes != here.negative_modes
        if adaptive and changed and not self._smooth(numbers[0], predicted[0], _SMOOTH if guard else _NEAR):
            track.failure = "the step crossed a point where stability changes"
            return track.restore()
        plain = changed and self._smooth(numbers[0], predicted[0], _EXPECTED)
        if adaptive and self._watch and not (onward := self._watch(here, point, plain)):
            self._refused = onward is False
            return track.restore()
        taken = abs(load_factor - here.load_factor)
        track.keep(point)
        if adaptive:
            growth = self._lib.step_growth(self.c, off, len(track.history) - 1, solved.iterations, linear)
            self._lib.accept_step(self.c, taken, growth)
        if on_step:
            on_step(point)
        return True

    def _smooth(self, found, predicted, share):
        """Whether the corrected point is closer to the predictor than a share of the step's length."""
        track = self.track
        move, off = found - track.here.numbers[0], found - predicted
        return track.product(off, off) <= share**2 * track.product(move, move) + NOTHING**2

    def _near(self, found, predicted, off, load_factor, linear):
        """Whether a step to a corrected point, at a distance `off` from the predictor, is one along the path; linear:
        see `is_linear` in C."""
        track = self.track
        here, sizes = track.here.numbers, (0.0, 0.0, 0.0)
        move, increment = found[0] - here[0], predicted[0] - here[0]
        if LIMITS.slight < off <= LIMITS.far:
            beside = move - increment
            sizes = [track.product(*pair) for pair in ((move, increment), (increment, increment), (beside, beside))]
        judged, lib = self._lib.judge_step(self.c, len(track.history), off, *sizes), self._lib
        if track.touching and judged != lib.TOO_FAR:  # a contact bends the path at once
            return True
        change = load_factor - track.here.load_factor
        if judged == lib.ACCEPTED or (judged == lib.UNSURE and (linear or not self._jumped(move, change))):
            return True
        track.failure = next(words for name, words in _REASONS.items() if getattr(lib, name) == judged)
        return False

    def _jumped(self, move, change):
        """Whether a step jumped over a limit point: it is twice as long as the mean slope of its ends makes it."""
        track, actions = self.track, self.track.model.actions
        end, load_factor, friction = track.problem.numbers(), track.problem.load_factor, actions.friction
        slopes = track.slope()
        track.restore()
        slopes += track.slope()
        actions.friction = friction
        track.put(end, load_factor)
        return track.product(slopes, slopes) * change**2 < track.product(move, move)

    def _predict(self, load_factor):
        """Predictor at a load factor: the polynomial through the last points."""
        known = self.track.history
        places = [point.load_factor for point in known]
        if len(set(places)) < len(places):  # the path returned to a load factor: use its last point there
            latest = dict(zip(places, known, strict=True))
            places, known = list(latest), list(latest.values())
        return through(known, places, load_factor)[0]


# Seconds after which C returns, so that Ctrl-C is obeyed; most load factors recorded between two returns, and numbers.
_SECONDS, _ROOM, _NUMBERS = 0.05, 64, 2**20

#: Recorded points: load factors, unknowns (k, unknowns), values of the fields (k, elements, n) or None, iterations
#: since the point before, and steps so far.
Swept = namedtuple("Swept", "load_factors x fields iterations steps")


class Sweep(Pointers):
    """Points of a path in C, of one process: by continuation, or corrected from a coarser mesh; the `Track` may serve
    other tracks of its problem later; fields: the recorded `PackedExpression`, or None."""

    def __init__(self, track, fields):
        super().__init__()
        problem, model, ffi = track.problem, track.model, self._ffi
        self._problem, self._stability = problem, track.stability
        self.c = sweep = ffi.new("sweep *")
        sweep.newton, sweep.stability = track.newton.c, track.stability.c
        sweep.x, sweep.load_factor = self.doubles(problem.x.array_w), self.doubles(problem.load_factor_array)
        unknowns, numbers = problem.numbering.size, problem.numbering.size + problem.c.carries
        sweep.numbers, sweep.moves, sweep.turn = numbers, model.moves, model.turn
        sweep.change, sweep.patience = CHANGE, _SECONDS
        shape = (fields.elements, fields.size) if fields else (0,)
        sweep.fields = fields.c if fields else ffi.NULL
        sweep.room = room = max(1, min(_ROOM, _NUMBERS // (unknowns + math.prod(shape))))
        self._points, work = np.empty((3, numbers)), np.empty((6, numbers))  # most of a large one may stay unused
        self._recorded = Swept(
            np.zeros(room), np.empty((room, unknowns)), np.empty((room, *shape)), *np.zeros((2, room), np.int32)
        )
        for name, array in (
            ("points", self._points), ("work", work), ("recorded_load_factors", self._recorded.load_factors),
            ("recorded", self._recorded.x), ("recorded_fields", self._recorded.fields),
        ):  # fmt: skip
            setattr(sweep, name, self.doubles(array))
        for name in ("iterations", "steps"):
            setattr(sweep, f"recorded_{name}", self.integers(getattr(self._recorded, name)))

    def along(self, track, load_factors, control, patience, *, every, counted):
        """Advance to load factors in turn while C can decide on steps by accepting or halving them. Yields `Swept`,
        with a progress that Ctrl-C keeps; after the last one the track is at the last accepted point. Returns (number
        of load factors reached, iterations since the last record).

        control: the `Continuation`, whose step control is shared; patience: see `Continuation.to`; every: whether every
        step is recorded, or these load factors alone; counted: Newton iterations since the last record.
        """
        sweep, known = self.c, track.history
        for at, point in zip(self._points, known, strict=False):
            at[:] = np.concatenate(point.numbers)
        for k, point in enumerate(known):
            sweep.known_load_factors[k] = point.load_factor
        sweep.known, sweep.negative = len(known), track.here.negative_modes
        sweep.control, control.c.rejections, control.c.accepted = control.c, 0, False
        control.c.patience = min(patience, _FIRST_REJECTIONS if len(known) == 1 else patience) - 1
        sweep.every = every
        interface = self._problem.interface
        if len(known) == 1 and not every and control.control.first is None and interface and not interface.dense:
            # Where it is accepted it saves a point and the count of its negative modes, with factors of a large system.
            control.c.usual, control.c.step = control.c.step, control.reach
        for why, swept in self._calls(track, load_factors, counted, lambda: self._lib.run(sweep)):
            self._follow(track)
            if swept:
                yield swept
            self._check()
            if why in (self._lib.DONE, self._lib.LEFT):
                return sweep.next, sweep.iterations

    def corrected(self, track, starts, load_factors, negative_modes, near):
        """Yields `Swept`: the points at load factors, each by Newton's method from its start on this mesh; None where a
        point is not found, and nothing more. starts: (n, numbers) see `Problem.numbers`; negative_modes: (n,) that each
        must have; near: largest motion between start and point (lengths, rad)."""
        starts, expected = np.ascontiguousarray(starts), np.array(negative_modes, dtype=np.int32)
        pointers = self._ffi.from_buffer("double[]", starts), self._ffi.from_buffer("int[]", expected)
        for why, swept in self._calls(track, load_factors, 0, lambda: self._lib.correct(self.c, *pointers, near)):
            track.steps = self.c.steps
            self._check()
            if swept:
                yield swept
            if why == self._lib.LEFT:
                yield None
            if why in (self._lib.DONE, self._lib.LEFT):
                return

    def _calls(self, track, load_factors, counted, call):
        """Call C without end; yields why it has returned, and a `Swept` or None."""
        load_factors, sweep = np.array(load_factors, dtype=float), self.c
        sweep.load_factors = self._ffi.from_buffer("double[]", load_factors)
        sweep.count, sweep.next, sweep.records = len(load_factors), 0, 0
        sweep.loads, sweep.iterations, sweep.steps = track.problem.load_norm, counted, track.steps
        track.newton.allow(track.max_iterations)
        track.newton.c.rounding = track.model.round_off
        while True:
            before = sweep.iterations
            with self._problem.corrected():
                why = call()
            k = sweep.records
            track.iterations += int(self._recorded.iterations[:k].sum()) + sweep.iterations - before
            sweep.records = 0
            yield why, Swept(*(array[:k] if array.size else None for array in self._recorded)) if k else None

    def _check(self):
        self._problem.raise_failure()
        self._stability.raise_failure()
        obey()

    def _follow(self, track):
        """Take C's last points, number of steps and load factor over to the track."""
        sweep = self.c
        if sweep.steps == track.steps:
            track.problem.set_load_factor(track.here.load_factor)
            return
        ends = [0, *itertools.accumulate(map(len, track.here.numbers))]
        track.history = [
            PathPoint(sweep.known_load_factors[k], [self._points[k, a:b].copy() for a, b in itertools.pairwise(ends)],
                      sweep.negative, 0)
            for k in range(sweep.known)
        ]  # fmt: skip
        track.steps = sweep.steps
        track.problem.set_load_factor(track.here.load_factor)
