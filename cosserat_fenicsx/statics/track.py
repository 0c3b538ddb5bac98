"""Where a solver stands on an equilibrium path: its last points, and the ways of getting from them to another."""

import math
from dataclasses import dataclass, field

import numpy as np

from cosserat_fenicsx.statics.snes import Newton
from cosserat_fenicsx.statics.stability import NegativeModes

#: A step may turn a section or move a point by this much away from its prediction (rad, rod lengths); the next step
#: aims at a fifth of it.
FAR, AIM = 0.5, 0.1
#: Less than this is no motion but rounding: an inextensible column stands still until it buckles.
NOTHING = 1e-8
# Newton iterations beyond which the next step does not grow, and is halved.
_EASY, _HARD = 5, 9


@dataclass(eq=False)
class Point:
    """A converged point of a path.

    Attributes:
        load_factor: eta.
        numbers: see `Problem.numbers`; the first are the owned unknowns.
        negative_modes: see `NegativeModes.count`.
        iterations: Newton iterations that it took.
        rise: d eta/d arc, positive where the load factor grows along the path; None where it was not computed.
        along: owned numbers of dx/d arc, likewise.
    """

    load_factor: float
    numbers: list = field(repr=False)
    negative_modes: int
    iterations: int
    rise: float | None = None
    along: np.ndarray | None = field(default=None, repr=False)


class Track:
    """The state of a loaded problem on its path.

    Args:
        problem: a loaded `Problem`.
        newton, stability: the problem's solvers, made once for its shape.
        max_iterations: Newton iterations allowed in a step.
        from_rest: whether the path begins at the unloaded state, where the problem is.

    Attributes:
        history: the last points, at most three.
        iterations: Newton iterations so far, those of rejected steps too.
        failure: why the last step was rejected, in words.
        neutral: owned numbers of a motion that changes nothing (a buckled round column turns about its axis), or None.
    """

    def __init__(self, problem, newton: Newton, stability: NegativeModes, max_iterations, *, from_rest=True):
        self.problem, self.model = problem, problem.model
        self.newton, self.stability, self.max_iterations = newton, stability, max_iterations
        self.iterations, self.failure, self.neutral = 0, "", None
        self.origin = Point(0.0, self.problem.numbers(), stability.count(), 0) if from_rest else None
        self.history = [self.origin] if from_rest else []

    @property
    def here(self):
        """The last accepted point."""
        return self.history[-1]

    def keep(self, point):
        """Accept a point."""
        self.history = [*self.history[-2:], point]

    def put(self, numbers, load_factor):
        """Go to a state, which need not be an equilibrium."""
        self.problem.set_load_factor(load_factor)
        self.problem.put(numbers)

    def restore(self):
        """Back to the last accepted point; False, for a step that failed."""
        self.put(self.here.numbers, self.here.load_factor)
        return False

    # -- equilibria --------------------------------------------------------------------------------------------------

    def at_load(self, numbers, eta):
        """Newton from `numbers` at a fixed load factor; the `Solved`, whose failure is noted."""
        if self.neutral is not None:
            return self.on_plane(numbers, eta, None, 0.0)
        self.put(numbers, eta)
        return self._solve(self.newton)

    def on_plane(self, numbers, eta, normal, weight):
        """Newton from (numbers, eta) for (x, eta) in the plane through them: <normal, dx> + weight d eta = 0."""
        self.put(numbers, eta)
        self.newton.bordered.aim(normal, weight, self.neutral)
        solved = self._solve(self.newton.bordered)
        if solved.converged:
            self.neutral = self.newton.bordered.neutral
        return solved

    def _solve(self, newton):
        newton.allow(self.max_iterations)
        solved = newton.solve()
        self.iterations += solved.iterations
        if not solved.converged:
            self.failure = solved.reason
        return solved

    def slope(self):
        """Owned numbers of dx/d eta at the state."""
        return self.newton.bordered.slope_here(self.neutral)

    def slope_found(self):
        """Owned numbers of dx/d eta at the point that `on_plane` has found."""
        return self.newton.bordered.slope

    def point(self, solved):
        """The state as a `Point`, with its negative modes."""
        negative = self.stability.count(neutral=self.neutral is not None)
        return Point(self.problem.load_factor, self.problem.numbers(), negative, solved.iterations)

    def aim(self, point, slope, moved, change, weight):
        """Give a point its tangent from dx/d eta, in the direction of a move along the path.

        Args:
            point: a `Point`.
            slope: dx/d eta there.
            moved, change: of the unknowns and of the load factor.
            weight: of the load factor in the metric.
        """
        along = self.product(slope, moved) + weight * change
        size = math.sqrt(self.product(slope, slope) + weight)
        point.rise = math.copysign(1.0, along) / size
        point.along = point.rise * slope

    # -- between and beyond points -------------------------------------------------------------------------------------

    def distance(self, a, b):
        """Largest difference of r (lengths) and of the rotation (rad, about twice that of q), over all ranks."""
        return self.model.largest(a[0] - b[0])

    def square(self, a):
        """`product` with itself; zero where that is rounding alone."""
        square = self.product(a, a)
        return square if square > NOTHING**2 else 0.0

    def product(self, a, b):
        """Inner product of two changes (numbers, load factor) without the load factor's part."""
        return self.model.inner(a, b)


def through(points, places, at):
    """The polynomial through points at their places (numbers along the path), evaluated.

    Args:
        points: up to four `Point`s.
        places: a number for each, all different.
        at: where.

    Returns:
        (numbers, load factor).
    """
    weights = []  # Lagrange's
    for a in places:
        weight = 1.0
        for b in places:
            if b != a:
                weight *= (at - b) / (a - b)
        weights.append(weight)
    numbers = [weights[0] * values for values in points[0].numbers]
    for weight, point in zip(weights[1:], points[1:], strict=True):
        for total, values in zip(numbers, point.numbers, strict=True):
            total += weight * values
    return numbers, float(np.dot(weights, [point.load_factor for point in points]))


def growth_of(off, order, iterations):
    """How much longer the next step may be than one that was `off` a prediction of that order, as a factor."""
    growth = min(max((AIM / max(off, 1e-12)) ** (1 / order), 0.5), 2.0)
    if iterations >= _HARD:
        return 0.5
    return min(growth, 1.0) if iterations > _EASY else growth
