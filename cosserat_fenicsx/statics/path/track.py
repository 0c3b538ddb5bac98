"""The points of a continuation on an equilibrium path, and the correctors that find the next one."""

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.algebra.building import module
from cosserat_fenicsx.algebra.newton import LimitedNewton, Newton
from cosserat_fenicsx.numerics import lagrange
from cosserat_fenicsx.statics.settling import converge
from cosserat_fenicsx.statics.stability import NegativeModes

# Smallest cosine of the angle between the negative modes of two neighbouring points.
_SAME_MODE = 0.5
#: Largest motion of a point that is corrected from another mesh or stage (rad, rod lengths).
NEAR = 0.1
# Step (rod lengths) below which Newton's full steps take over from shares of them.
_SETTLED = 1e-10
# Stiffness of obstacles over their own, in turn; tried where Newton's method does not converge.
_STAGES = ((1.0,), (1e-4, 1e-3, 1e-2, 1e-1, 1.0))
# Friction of obstacles: the elastic slip (rod lengths) that is none; most iterations; the factor by which the stiffness
# against slip grows, and at most; Newton's iterations up to which the same places stick; the slip over that of a
# failure below which the stiffness grows again; the largest factor by which a slip that falls is extrapolated.
_STUCK, _MOST_STUCK, _STIFFER, _STIFFEST, _SAME, _CLOSER, _FALLS = 1e-11, 60, 10.0, 1e3, 2, 0.1, 0.99
#: Motions below this are rounding (rad, rod lengths).
NOTHING = 1e-8


@dataclass(frozen=True)
class Limits:
    """Which steps of a continuation are accepted, and how long the next one is (`step_control` in C)."""

    far: float = 0.5  # largest distance of a corrected point from the predictor (rad, rod lengths)
    intended: float = 0.1  # the distance that step control aims at
    slight: float = 1e-3  # the distance below which direction and length of a step are not checked
    leap: float = 1.0  # distance over the predicted increment above which a limit point may have been jumped over
    easy: int = 5  # Newton iterations of a step beyond which the next one does not grow,
    hard: int = 9  # and from which on it is halved
    linear: float = (
        0.05  # sizes of Newton's later steps over the first one's, up to which a path begins nearly linearly
    )
    first: float = (
        4.0  # largest growth after such a first step, where it is not one that was halved; later steps double
    )


LIMITS = Limits()


def step_control(**numbers):
    """C's (library, `step_control` with these numbers): the decisions of step control, in C's sweep and in Python."""
    ffi, lib = module()
    return lib, ffi.new("step_control *", {**vars(LIMITS), **numbers})


@dataclass(eq=False)
class PathPoint:
    """A converged point of a path: load factor (eta in the formulas below), `numbers` of the `Problem` and
    `negative_modes`.

    iterations: Newton's, of its solution; rise, along: d eta/d arc and the owned entries of dx/d arc; logarithm: see
    `NegativeModes`; space: see `Part.negative_space`. These four are None or NaN until they are computed. touches: see
    `RodContacts.memory`; None without them.
    """

    load_factor: float
    numbers: list = field(repr=False)
    negative_modes: int
    iterations: int
    rise: float | None = None
    along: np.ndarray | None = field(default=None, repr=False)
    logarithm: float = math.nan
    space: np.ndarray | None = field(default=None, repr=False)
    touches: tuple | None = field(default=None, repr=False)


class Track:
    """The state of a loaded problem on its path; max_iterations: Newton iterations allowed in a step.

    origin: the first `PathPoint`, from `begin_here` on; history: the last points, at most three; iterations, steps: so
    far, those of rejected steps included, and accepted ones; failure: why the last step was rejected, in words;
    touching: the problem's `RodContacts`, or None;
    neutral: owned entries of a motion that leaves the energy unchanged (of a buckled round column about its axis), or
    None.
    """

    def __init__(self, problem, newton: Newton, stability: NegativeModes, max_iterations):
        self.problem, self.model = problem, problem.model
        self.newton, self.stability, self.max_iterations = newton, stability, max_iterations
        self.iterations, self.steps, self.failure, self.neutral = 0, 0, "", None
        self.origin, self.history = None, []
        actions = self.model.scene.actions
        self._touches, self.touching = self.model.scene.has_walls, problem.touching
        longest = min((action.largest_step for action in actions if action.gaps is not None), default=math.inf)
        self._longest = longest / self.model.scales.length

    def begin_here(self):
        """Begin the path at the problem's state and load factor."""
        if self.problem.sliding:
            self.problem.sliding.accept()
        self.origin = PathPoint(self.problem.load_factor, self.problem.numbers(), self._negative_modes(), 0)
        self.origin.touches = self.touching and self.touching.memory
        self.history = [self.origin]

    @property
    def watches_steps(self):
        """Whether steps must be so short that no rod passes through an obstacle unseen."""
        return self._longest < math.inf

    @property
    def here(self):
        return self.history[-1]

    def keep(self, point):
        """Accept the problem's state as a point of the path; path-dependent loads update their history variables."""
        self.problem.commit()
        if self.problem.sliding:
            self.problem.sliding.accept()
        self.steps += 1
        self.history = [*self.history[-2:], point]

    def put(self, numbers, load_factor):
        """Set the problem's state, which need not be an equilibrium, and load factor."""
        self.problem.set_load_factor(load_factor)
        self.problem.put(numbers)

    def restore(self):
        """Return to the last accepted point. Always False, the result of a rejected step."""
        if self.touching:
            self.touching.recall(self.here.touches)
        self.model.actions.forget_friction()
        self.put(self.here.numbers, self.here.load_factor)
        return False

    # -- equilibria --------------------------------------------------------------------------------------------------

    def at_load(self, numbers, load_factor):
        """Newton's method from `numbers` at a fixed load factor; returns a `Solved` and sets `failure`."""
        if self.neutral is not None:
            return self.on_plane(numbers, load_factor, None, 0.0)
        if self.touching:
            self.touching.recall(self.here.touches)
            solved = self.touching.solve(numbers, load_factor, self.here.numbers)
            self.iterations += solved.iterations
            self.failure = "" if solved.converged else solved.reason
            return solved
        self.model.actions.forget_friction()
        self.put(numbers, load_factor)
        solved = self._solve(self.newton)
        if not solved.converged and self._touches:
            solved = self._by_shares(numbers, load_factor, solved)
        return self._stuck(solved) if solved.converged and self.model.actions.sticking else solved

    def _stuck(self, solved):
        """Friction by which surfaces stick without an elastic slip, from a state with one; a `Solved`.

        By the method of multipliers: the friction found with a stiffness against slip is where the next iteration
        starts. It stays as it is where a surface that sticks has not slipped since the last accepted state and one that
        slips has friction at its bound against the slip: the equations of Alart & Curnier (`touching.rubbing`). The
        stiffness grows while Newton's method sees the same places stick, and falls where it fails.
        """
        problem, actions, first = self.problem, self.model.actions, solved.iterations
        terms = actions.sticking
        share, slip, refused, alike = 1.0, math.inf, math.inf, 0
        for _ in range(_MOST_STUCK):
            before, held, last = problem.numbers(), actions.friction, slip
            slip = self.model.comm.allreduce(max(term.find_friction() for term in terms), op=MPI.MAX)
            if slip < _STUCK:
                break
            if alike > 1 and slip < last:  # friction changes by a geometric series: its sum
                alike, factor = 0, min(slip / last, _FALLS)
                for term, friction in zip(terms, held, strict=True):
                    term.held[:] += factor / (1 - factor) * (term.held - friction)
            if solved.iterations <= _SAME and slip < _CLOSER * refused and share < _STIFFEST:
                share, alike = share * _STIFFER, 0
            problem.stiffen(share)
            problem.put(before)
            solved = self._solve(self.newton)
            alike = alike + 1 if solved.iterations <= _SAME else 0
            if not solved.converged:
                if share <= 1.0:
                    break
                actions.friction = held
                share, refused, slip, alike = share / _STIFFER, slip, last, 0
                problem.stiffen(share)
                problem.put(before)
        problem.stiffen(1.0)
        if slip < _STUCK:  # what the stiffness has left of the balance of forces
            return replace(self._solve(self.newton), iterations=first)  # those by which steps grow
        self.failure = "friction has not settled"
        return replace(solved, converged=False, reason=self.failure)

    def _by_shares(self, numbers, load_factor, failed):
        """Newton's method with shares of steps where contacts alternate, then softer obstacles; full steps end it."""
        limited, unsolved = LimitedNewton(self.problem, LIMITS.far, LIMITS.far), ""
        for stages in _STAGES:
            self.put(numbers, load_factor)
            for share in stages:
                self.problem.soften(share)
                unsolved = converge(limited, _SETTLED)
                if unsolved:
                    break
            else:
                break
        self.problem.soften(1.0)
        self.iterations += limited.iterations
        if unsolved:
            return failed
        solved = self._solve(self.newton)
        return replace(solved, iterations=solved.iterations + limited.iterations)

    def on_plane(self, numbers, load_factor, normal, weight):
        """Newton's method for (numbers, eta) in the plane <normal, dx> + weight d eta = 0; returns a `Solved`."""
        self.put(numbers, load_factor)
        self.bordered.stay_in_plane(normal, weight, self.neutral)
        solved = self._solve(self.bordered)
        if solved.converged:
            self.neutral = self.bordered.neutral
        return solved

    def _solve(self, newton):
        newton.allow(self.max_iterations)
        solved = newton.solve()
        self.iterations += solved.iterations
        if solved.converged and self.watches_steps and self.history:
            moved, _ = self.model.sizes(self.problem.numbers()[0] - self.here.numbers[0])
            if moved > self._longest:
                solved = replace(solved, converged=False, reason="a rod moved farther at once than an obstacle is wide")
        tensions = self.problem.tensions
        if not solved.converged and tensions and tensions.undetermined:
            why = (
                "the tensions of tendons that do not stretch are not determined: give some of them a stiffness, axial="
            )
            solved = replace(solved, reason=why)
        if not solved.converged:
            self.failure = solved.reason
        return solved

    @property
    def bordered(self):
        """The `BorderedNewton` of the problem; its `slope` is dx/d eta at the point that `on_plane` has found."""
        return self.newton.bordered

    def slope(self):
        """Owned entries of dx/d eta at the state."""
        return self.bordered.slope_here(self.neutral)

    def point(self, solved):
        """The state as a `PathPoint`, with its negative modes."""
        negative = self._negative_modes(neutral=self.neutral is not None)
        point = PathPoint(self.problem.load_factor, self.problem.numbers(), negative, solved.iterations)
        point.logarithm, point.touches = self.stability.logarithm, self.touching and self.touching.memory
        return point

    def _negative_modes(self, *, neutral=False):
        """See `NegativeModes.count`; of rods that touch, of motions in which they remain in contact."""
        found = self.stability.count(neutral=neutral)
        if not self.touching or found < 0:
            return found
        if self.touching.removed is None:
            return self.touching.negative_modes(self.stability.whole)
        return found + self.touching.removed

    def set_tangent(self, point, slope, step, weight):
        """Set the unit tangent of a `PathPoint` from dx/d eta, oriented along a step (dx, d eta)."""
        onward = slope, 1.0
        along, size = self.dot(onward, step, weight), math.sqrt(self.dot(onward, onward, weight))
        point.rise = math.copysign(1.0, along) / size
        point.along = point.rise * slope

    def keeps_modes(self, a, b):
        """Whether the negative modes of one of two points are among those of the other; where two eigenvalues change
        their signs in opposite directions, a mode is exchanged for another one."""
        shared = min(a.negative_modes, b.negative_modes)
        if shared < 1 or self.neutral is not None:
            return True
        for point in (a, b):
            if point.space is None:
                self.put(point.numbers, point.load_factor)
                point.space = self.stability.whole.negative_space(point.negative_modes)
            if point.space is None:
                return True
        overlap = self.model.comm.allreduce(a.space.T @ b.space)
        return bool(np.linalg.svd(overlap, compute_uv=False)[shared - 1] >= _SAME_MODE)

    # -- where the tangent is singular ---------------------------------------------------------------------------------

    def motion_at(self, point, change):
        """`BorderedNewton.motion_of` a change of the unknowns at a `PathPoint`, without its neutral component."""
        self.put(point.numbers, point.load_factor)
        motion = self.bordered.motion_of(change)
        if self.neutral is None:
            return motion
        neutral = self.bordered.motion_of(self.neutral)
        return motion - self.bordered.work(motion, neutral) * neutral

    def response(self, numbers, load_factor, motion):
        """(stiffness of the tangent at a state against a motion, null vector): see `BorderedNewton.response`."""
        self.put(numbers, load_factor)
        return self.bordered.response(motion)

    @property
    def without_potential(self):
        """Whether the tangent is unsymmetric; then the negative modes are those of its symmetric part."""
        return self.model.scene.follows

    # -- between and beyond points -------------------------------------------------------------------------------------

    def distance(self, a, b):
        """Largest difference of r (lengths) and of the rotation (rad, about twice that of q), over all ranks."""
        return self.model.largest(a[0] - b[0])

    def square(self, a):
        """`product` of a change with itself; zero below rounding."""
        square = self.product(a, a)
        return square if square > NOTHING**2 else 0.0

    def balance(self, moved, change):
        """The weight by which a step (dx, d eta) has equal shares of unknowns and load factor; 0 without one."""
        return self.square(moved) / change**2 if change else 0.0

    def product(self, a, b):
        """Inner product of two changes of the unknowns (owned entries), over all ranks."""
        return self.model.inner(a, b)

    def dot(self, a, b, weight):
        """Inner product of two steps (dx, d eta) in the metric of arc length; weight: of the load factor."""
        return self.product(a[0], b[0]) + weight * a[1] * b[1]

    def length(self, step, weight):
        """The length of a step, see `dot`."""
        return math.sqrt(self.dot(step, step, weight))


def between(a, b):
    """The step (dx, d eta) from a `PathPoint` to another one."""
    return b.numbers[0] - a.numbers[0], b.load_factor - a.load_factor


def through(points, places, at):
    """(numbers, load factor) by Lagrange interpolation of up to four `PathPoint`s, `places` their coordinates."""
    weights = lagrange(places, at)
    numbers = [weights[0] * values for values in points[0].numbers]
    for weight, point in zip(weights[1:], points[1:], strict=True):
        for total, values in zip(numbers, point.numbers, strict=True):
            total += weight * values
    return numbers, float(np.dot(weights, [point.load_factor for point in points]))


@dataclass(frozen=True)
class Bends:
    """How much a step between two points of a path turns: the angle between the tangents at the two ends, rad; the
    distance of its direction from their mean, all of unit length (the corner: zero on a line and on a circle); its
    length; and the largest values of both in a step that follows the path."""

    turn: float
    corner: float
    length: float
    most_turn: ClassVar[float] = 0.9
    most_corner: ClassVar[float] = 0.12

    @property
    def resolved(self):
        """Whether the step is short enough to follow the path."""
        return self.turn <= self.most_turn and self.corner <= self.most_corner


def bends(track, a, b, weight):
    """The `Bends` of a step between two points with tangents; weight: of the load factor in the metric."""

    def cosine(u, v):
        return track.dot(u, v, weight) / math.sqrt(track.dot(u, u, weight) * track.dot(v, v, weight))

    chord = between(a, b)
    begin, end = (a.along, a.rise), (b.along, b.rise)
    turn = math.acos(min(max(cosine(begin, end), -1.0), 1.0))
    mean = math.sqrt(max(2 + 2 * math.cos(turn), 1e-30))
    along = (cosine(begin, chord) + cosine(end, chord)) / mean
    return Bends(turn, math.sqrt(max(2 - 2 * along, 0.0)), track.length(chord, weight))
