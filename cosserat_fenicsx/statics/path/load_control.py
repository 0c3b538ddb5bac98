"""Continuation in the load factor: adaptive steps, predictors, and checks against changes of branch.

A slender rod has several equilibria under one load, and Newton's method from the straight state often converges to an
unstable one (the eccentric column jumps to the opposite side in one step at eta = 1.1). So a step is accepted only if
Newton's method converged near the predictor, not against its direction, and if no new negative mode appeared. A
negative mode that appears in steps of a thousandth of the way too is one of the path, which has lost its stability.

`Sweep` advances in C (algebra/sweep.c) as long as every step is accepted at once, or halved.
"""

import math
from collections import namedtuple
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.algebra.building import Pointers, undisturbed
from cosserat_fenicsx.algebra.newton import petsc
from cosserat_fenicsx.checks import number, refuse
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.statics.path.track import EASY, FAR, HARD, INTENDED, NOTHING, PathPoint, Track, growth_of, through
from cosserat_fenicsx.statics.problem import CHANGE

#: Distance from the predictor (rad, rod lengths) below which direction and length of a step are not checked.
SLIGHT = 1e-3
#: Distance from the predictor, over the predicted increment, above which a step may have jumped over a limit point.
LEAP = 1.0
#: Number of rejected steps from the first point after which the step is limited by the stiffness there.
FIRST_REJECTIONS = 3
# Largest distance from the predictor, over the step's length, at which the number of negative modes may change; the
# second once steps are below a thousandth of the way: the path is smooth there, so that it crosses a bifurcation
# without a change of branch.
_SMOOTH, _NEAR = 0.01, 0.3
# The same distance below which such a change is accepted although no event explains it.
_EXPECTED = 1e-4


@dataclass(frozen=True)
class StepControl:
    """How the load factor is stepped between the requested values.

    Args:
        first: first step of the load factor; None for a tenth of the way to the farthest requested value. Where it is
            rejected a few times, it is limited by the tangent stiffness at the first point.
        smallest: smallest step over the farthest requested value, in (0, 1); the continuation fails where a smaller
            one would be needed. Where the structure is very soft at the first point, smaller steps are allowed.
        largest: largest step of the load factor; None for no bound.
        adaptive: False takes each requested value in one step, without checks of the branch; the negative modes of the
            points are counted all the same.
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
        for name in ("max_iterations", "most_steps"):
            value = getattr(self, name)
            left_open = name == "max_iterations" and value is None
            if not left_open and (not isinstance(value, int) or isinstance(value, bool) or value < 1):
                refuse(self, name, value, "a whole number above zero")


class Continuation:
    """Advances a track by load control.

    Args:
        track: a `Track`.
        control: a `StepControl`.
        watch: called as watch(a, b, plain) with the two points of a step, before b is accepted, and whether b is where
            the path was expected although the number of negative modes changes; False ends the continuation at a, None
            rejects the step.

    Attributes:
        step: the next step of the load factor; None where it is still to be chosen.
        smallest: the smallest step of the load factor that is tried.
        rejections: number of steps that were rejected just before the next call of `to`.
    """

    def __init__(self, track: Track, control: StepControl, watch=None):
        self.track, self.control, self._watch = track, control, watch
        self.step, self._shrink, self.smallest, self.rejections = None, 0.5, 0.0, 0

    def begin(self, way):
        """Choose the step where none is known; `way`: see `to`."""
        self.step = self.step or self.control.first or way / 10
        self.smallest = self.control.smallest * way

    def to(self, target, way, *, on_step=None, patience=None, once=False):
        """Advance to the load factor `target`, which is reached exactly.

        Args:
            target: load factor.
            way: range of the load factor over the whole path, to which steps are relative.
            on_step: called with every accepted `PathPoint`.
            patience: number of rejected steps, without two successive accepted ones between, after which to stop;
                None to go on to the `StepControl`'s smallest step.
            once: whether to return after the first accepted step.

        Returns:
            bool: False where too many steps were rejected, the steps became too small or `watch` returned False; the
            track's `failure` gives the reason, and its state is that of `here`.
        """
        control, track = self.control, self.track
        if not control.adaptive:
            return self._attempt(target, guard=False, on_step=on_step)
        self.begin(way)
        self._refused, rejections, last_accepted, first = False, self.rejections, False, len(track.history) == 1
        self.rejections = 0
        while track.here.load_factor != target:
            left = target - track.here.load_factor
            step = min(self.step, control.largest or np.inf)
            if abs(left) <= min(1.2 * step, control.largest or np.inf):
                goal = target
            elif abs(left) < 2 * step:
                goal = track.here.load_factor + left / 2
            else:
                goal = track.here.load_factor + np.copysign(step, left)
            taken = abs(goal - track.here.load_factor)
            # A new negative mode counts as one of the path itself once the step is this small.
            if self._attempt(goal, guard=taken > 1e-3 * way, on_step=on_step):
                rejections, last_accepted, first = 0 if last_accepted else rejections, True, False
                if once:
                    return True
            else:
                rejections, last_accepted = rejections + 1, False
                self.step = taken * self._shrink
                if first and rejections >= FIRST_REJECTIONS:
                    rejections, first, linear = 0, False, self._linear_step()
                    self.step, self.smallest = min(self.step, linear), min(self.smallest, control.smallest * linear)
                if self._refused or self.step < self.smallest or rejections >= (patience or math.inf):
                    self.step = None
                    return False
        return True

    def _linear_step(self):
        """The step of the load factor that moves or rotates the linearised structure by INTENDED; infinite where its
        tangent is singular.

        The first step must be of that order where the structure is very soft, as a straight wire is against bending.
        """
        track = self.track
        try:
            moved = track.model.largest(track.slope())
        except NotConverged:
            return math.inf
        return INTENDED / moved if moved else math.inf

    def _attempt(self, eta, *, guard, on_step):
        """One step: predictor, corrector, checks. Accepts it (True) or restores the last point (False)."""
        obey()
        track, adaptive = self.track, self.control.adaptive
        here = track.here
        predicted = self._predict(eta) if adaptive else here.numbers
        solved = track.at_load(predicted, eta)
        self._shrink = 0.5
        if not solved.converged:
            return track.restore()
        numbers = track.problem.numbers()
        off = track.distance(numbers, predicted)
        if adaptive and off > SLIGHT and not self._near(numbers, predicted, off, eta):
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
        taken = abs(eta - here.load_factor)
        track.keep(point)
        if adaptive:
            growth = growth_of(off, min(len(track.history) - 1, 3), solved.iterations)
            self.step = max(self.step, taken * growth) if growth >= 1 else taken * growth
        if on_step:
            on_step(point)
        return True

    def _smooth(self, found, predicted, share):
        """Whether the corrected point is closer to the predictor than a share of the step's length."""
        track = self.track
        move, off = found - track.here.numbers[0], found - predicted
        return track.product(off, off) <= share**2 * track.product(move, move) + NOTHING**2

    def _near(self, found, predicted, off, eta):
        """Whether a step whose corrected point differs from the predictor is still one along the path.

        Args:
            found, predicted: numbers of the corrected point and of the predictor; off: their distance.
            eta: load factor of the step.
        """
        track = self.track
        if off > FAR:
            track.failure = "the equilibrium jumped away from the path"
            self._shrink = min(max((INTENDED / off) ** (1 / len(track.history)), 0.1), 0.5)
            return False
        here = track.here.numbers
        move, increment = found[0] - here[0], predicted[0] - here[0]
        size = track.product(increment, increment)
        if len(track.history) > 1:
            # The mirrored branch of a nearly perfect pitchfork is stable about a section's stiff axis, so that neither
            # the distance nor the number of negative modes reveals it.
            if track.product(move, increment) <= 0 < size:
                track.failure = "the equilibrium lies opposite to the direction of the path"
                return False
            if track.product(move - increment, move - increment) <= LEAP**2 * size:
                return True
        if self._jumped(move, eta - track.here.load_factor):
            track.failure = "the equilibrium jumped away from the path's direction"
            return False
        return True

    def _jumped(self, move, change):
        """Whether a step is longer than twice the mean slope of its two ends times the change of the load factor.

        Then it has jumped over a limit point to another part of the path.
        """
        track = self.track
        end, eta = track.problem.numbers(), track.problem.load_factor
        slopes = track.slope()
        track.restore()
        slopes += track.slope()
        track.put(end, eta)
        return track.product(slopes, slopes) * change**2 < track.product(move, move)

    def _predict(self, eta):
        """Predictor: numbers at eta by the polynomial through the last points (constant, secant, quadratic)."""
        known = self.track.history
        places = [point.load_factor for point in known]
        if len(set(places)) < len(places):  # the path returned to a load factor: use its last point there
            latest = dict(zip(places, known, strict=True))
            places, known = list(latest), list(latest.values())
        return through(known, places, eta)[0]


# Seconds after which C returns, so that Ctrl-C is obeyed; load factors recorded between two returns.
_SECONDS, _ROOM = 0.05, 64
_DONE, _LEFT, _LATER, _FULL = range(4)

#: Recorded points: load factors, unknowns (k, unknowns), values of the fields (k, elements, n) or None, iterations
#: since the point before, and steps so far.
Swept = namedtuple("Swept", "load_factors x fields iterations steps")


class Sweep(Pointers):
    """The continuation in C of one problem.

    Args:
        track: a `Track`; its problem must be serial.
        fields: the `PackedExpression` of what is recorded, or None.
    """

    def __init__(self, track, fields):
        super().__init__()
        self._track, self._fields = track, fields
        problem, model, ffi = track.problem, track.model, self._ffi
        self.c = sweep = ffi.new("sweep *")
        sweep.newton, sweep.stability = track.newton.c, track.stability.c
        setattr(sweep, "with", petsc())
        sweep.snes, sweep.x = (ffi.cast("void *", each.handle) for each in (track.newton.snes, problem.x))
        sweep.eta = self.doubles(problem.eta_array)
        unknowns, numbers = problem.numbering.size, problem.numbering.size + problem.c.carries
        sweep.numbers, sweep.moves, sweep.turn = numbers, model.moves, model.turn
        sweep.slight, sweep.far, sweep.intended = SLIGHT, FAR, INTENDED
        sweep.leap, sweep.easy, sweep.hard, sweep.patience = LEAP, EASY, HARD, _SECONDS
        sweep.change = CHANGE
        sweep.fields, sweep.room = fields.c if fields else ffi.NULL, _ROOM
        shape = (fields.elements, fields.size) if fields else (0,)
        self._points, work = np.zeros((3, numbers)), np.zeros((6, numbers))
        self._recorded = Swept(
            np.zeros(_ROOM), np.zeros((_ROOM, unknowns)), np.zeros((_ROOM, *shape)), *np.zeros((2, _ROOM), np.int32)
        )
        for name, array in (
            ("points", self._points), ("work", work), ("recorded_eta", self._recorded.load_factors),
            ("recorded", self._recorded.x), ("recorded_fields", self._recorded.fields),
        ):  # fmt: skip
            setattr(sweep, name, self.doubles(array))
        for name in ("iterations", "steps"):
            setattr(sweep, f"recorded_{name}", self.integers(getattr(self._recorded, name)))

    def along(self, targets, control, patience, *, every, counted):
        """Advance to load factors in turn until a step needs another decision than to be accepted or halved.

        Args:
            targets: load factors.
            control: the `Continuation`, whose step is taken and set.
            patience: number of rejected steps, without two successive accepted ones between, after which to stop.
            every: whether every step is recorded, or the targets alone.
            counted: Newton iterations since the last record.

        Yields:
            `Swept`, with a progress that Ctrl-C keeps; after the last one the track is at the last accepted point.

        Returns:
            (number of targets reached, iterations since the last record).
        """
        track, sweep = self._track, self.c
        targets = np.array(targets, dtype=float)
        known = track.history
        for at, point in zip(self._points, known, strict=False):
            at[:] = np.concatenate(point.numbers)
        for k, point in enumerate(known):
            sweep.etas[k] = point.load_factor
        sweep.known, sweep.negative, sweep.step = len(known), track.here.negative_modes, control.step
        sweep.smallest, sweep.rejections, sweep.accepted = control.smallest, 0, False
        sweep.allowed = min(patience, FIRST_REJECTIONS if len(known) == 1 else patience) - 1
        sweep.largest, sweep.loads = control.control.largest or np.inf, track.problem.load_norm
        sweep.targets, sweep.count, sweep.next = self.doubles(targets), len(targets), 0
        sweep.every, sweep.iterations, sweep.steps, sweep.records = every, counted, track.steps, 0
        track.newton.allow(track.max_iterations)
        track.newton.c.rounding = track.model.round_off
        while True:
            before = sweep.iterations
            why = undisturbed("run", sweep)
            k = sweep.records
            track.iterations += int(self._recorded.iterations[:k].sum()) + sweep.iterations - before
            sweep.records = 0
            self._follow()
            control.step, control.rejections = sweep.step, sweep.rejections
            if k:
                yield Swept(*(array[:k] if array.size else None for array in self._recorded))
            track.problem.raise_failure()
            track.stability.raise_failure()
            obey()
            if why in (_DONE, _LEFT):
                return sweep.next, sweep.iterations

    def _follow(self):
        """Let the track follow: its last points, number of steps and load factor."""
        track, sweep = self._track, self.c
        size, live = track.problem.numbering.size, [len(x) for x in track.here.numbers[1:]]
        if sweep.steps == track.steps:
            track.problem.set_load_factor(track.here.load_factor)
            return
        track.history = [
            PathPoint(sweep.etas[k], [part.copy() for part in np.split(self._points[k], np.cumsum([size, *live])[:-1])],
                      sweep.negative, 0)
            for k in range(sweep.known)
        ]  # fmt: skip
        track.steps = sweep.steps
        track.problem.set_load_factor(track.here.load_factor)
