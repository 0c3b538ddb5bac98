"""Continuation in the load factor: adaptive steps, predictors, and a watch on the branch.

A slender rod has several equilibria under one load, and Newton from the straight state finds the unstable ones
readily (the eccentric column jumps to the far side in one step at eta = 1.1). So a step is accepted only if Newton
converged to somewhere near the prediction and not against its direction, and if no new negative mode appeared; where
one persists down to a thousandth of the way, the path itself has lost its stability, and its points say so.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from cosserat_fenicsx.checks import number, refuse
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.snes import Newton
from cosserat_fenicsx.stability import NegativeModes

# A step may turn a section or move a point by this much away from its prediction (rad, rod lengths); the next step
# aims at a fifth of it.
_FAR = 0.5
_AIM = 0.1
# A step that is off its prediction by less than this may have any direction.
_SLIGHT = 1e-3
# Newton iterations beyond which the next step does not grow, and is halved.
_EASY, _HARD = 5, 9


@dataclass(frozen=True)
class StepControl:
    """How the load factor is stepped between the requested values.

    Args:
        first: first step of the load factor; None for a tenth of the way to the farthest requested value.
        smallest: a step that has to be smaller than this times the way gives up; in (0, 1).
        largest: no step is larger; None for no bound.
        adaptive: False takes each requested value in one step, whatever it converges to; unstable points still say so.
        max_iterations: Newton iterations allowed in a step; None for 10 (mixed) or 30 (the other formulations, whose
            Newton paths are longer).

    Raises:
        SceneError: a value outside its range.
    """

    first: float | None = None
    smallest: float = 1e-6
    largest: float | None = None
    adaptive: bool = True
    max_iterations: int | None = None

    def __post_init__(self):
        for name in ("first", "largest"):
            if getattr(self, name) is not None:
                number(self, name, getattr(self, name), "a positive load factor", lambda x: 0 < x < np.inf)
        number(self, "smallest", self.smallest, "a number in (0, 1)", lambda x: 0 < x < 1)
        if not isinstance(self.adaptive, bool):
            refuse(self, "adaptive", self.adaptive, "True or False")
        if self.max_iterations is not None and (not isinstance(self.max_iterations, int) or self.max_iterations < 1):
            refuse(self, "max_iterations", self.max_iterations, "a whole number above zero")


@dataclass(eq=False)
class Point:
    """A converged point: load factor, unknowns and carried fields (`Problem.numbers`), stability and work."""

    load_factor: float
    numbers: list = field(repr=False)
    negative_modes: int
    iterations: int


class Continuation:
    """Steps a loaded problem from its unloaded state.

    Args:
        problem: a loaded `Problem`.
        newton, stability: the problem's solvers, made once for its shape.
        control: a `StepControl`.

    Attributes:
        iterations: Newton iterations so far, those of rejected steps too.
        failure: why the last step was rejected, in words.
    """

    def __init__(self, problem, newton: Newton, stability: NegativeModes, control: StepControl):
        self.problem, self.model = problem, problem.model
        self.newton, self.stability, self.control = newton, stability, control
        newton.allow(control.max_iterations or (10 if self.model.carries_force else 30))
        self.iterations, self._step, self._shrink = 0, None, 0.5
        self.failure = ""
        self._history = [Point(0.0, problem.numbers(), stability.count(), 0)]

    @property
    def here(self):
        """The last accepted point."""
        return self._history[-1]

    def to(self, target, way, *, on_step=None):
        """Step to the load factor `target`, landing on it exactly.

        Args:
            target: load factor.
            way: size of the whole path, which steps are measured against.
            on_step: called with every accepted `Point`.

        Returns:
            bool: False where the steps became too small; `failure` says why, and the state is that of `here`.
        """
        control = self.control
        if not control.adaptive:
            return self._attempt(target, guard=False, on_step=on_step)
        self._step = self._step or control.first or way / 10
        while self.here.load_factor != target:
            left = target - self.here.load_factor
            step = min(self._step, control.largest or np.inf)
            if abs(left) <= min(1.2 * step, control.largest or np.inf):
                goal = target
            elif abs(left) < 2 * step:
                goal = self.here.load_factor + left / 2
            else:
                goal = self.here.load_factor + np.copysign(step, left)
            smallest = control.smallest * way
            taken = abs(goal - self.here.load_factor)
            # A new negative mode is believed once the step that meets it is this small.
            if not self._attempt(goal, guard=taken > 1e-3 * way, on_step=on_step):
                self._step = taken * self._shrink
                if self._step < smallest:
                    return False
        return True

    def _attempt(self, eta, *, guard, on_step):
        """One step: predict, correct, judge. Accepts it (True) or restores the last point (False)."""
        obey()
        here = self.here
        predicted = self._predict(eta) if self.control.adaptive else here.numbers
        self.problem.put(predicted)
        self.problem.set_load_factor(eta)
        solved = self.newton.solve()
        self.iterations += solved.iterations
        self._shrink = 0.5
        if not solved.converged:
            self.failure = solved.reason
            return self._restore()
        numbers = self.problem.numbers()
        off = self._distance(numbers[0], predicted[0])
        adaptive = self.control.adaptive
        if adaptive and off > _FAR:
            self.failure = "the equilibrium jumped away from the path"
            self._shrink = float(np.clip((_AIM / off) ** (1 / len(self._history)), 0.1, 0.5))
            return self._restore()
        if adaptive and off > _SLIGHT and len(self._history) > 1 and self._turned_back(numbers[0], predicted[0]):
            self.failure = "the equilibrium lies on the other side of the path's direction"
            return self._restore()
        negative = self.stability.count()
        if adaptive and guard and negative != here.negative_modes:
            self.failure = "the step crossed a point where stability changes"
            return self._restore()
        taken = abs(eta - here.load_factor)
        point = Point(eta, numbers, negative, solved.iterations)
        self._history = [*self._history[-2:], point]
        if adaptive:
            order = min(len(self._history) - 1, 3)  # of the prediction this step was judged by
            growth = float(np.clip((_AIM / max(off, 1e-12)) ** (1 / order), 0.5, 2.0))
            if solved.iterations >= _HARD:
                growth = 0.5
            elif solved.iterations > _EASY:
                growth = min(growth, 1.0)
            self._step = max(self._step, taken * growth) if growth >= 1 else taken * growth
        if on_step:
            on_step(point)
        return True

    def _predict(self, eta):
        """Numbers at eta by the polynomial through the last points (constant, secant, quadratic)."""
        latest = {p.load_factor: p for p in self._history}  # one each, where the path came back to a load factor
        known = sorted(latest.values(), key=self._history.index)
        etas = [p.load_factor for p in known]
        weights = [math.prod((eta - b) / (a - b) for b in etas if b != a) for a in etas]  # Lagrange's
        predicted = [weights[-1] * numbers for numbers in known[-1].numbers]
        for weight, point in zip(weights[:-1], known[:-1], strict=True):
            for total, numbers in zip(predicted, point.numbers, strict=True):
                total += weight * numbers
        return predicted

    def _distance(self, a, b):
        """Largest difference of r (lengths) and of the rotation (rad, about twice that of q), over all ranks."""
        return self.model.largest(a - b)

    def _turned_back(self, found, predicted):
        """Whether a step went against its prediction: the mirrored branch of a nearly perfect pitchfork is stable about
        a section's stiff axis, so that neither the distance nor the count of negative modes gives it away."""
        here = self.here.numbers[0]
        foreseen = predicted - here
        return self.model.inner(found - here, foreseen) <= 0 < self.model.inner(foreseen, foreseen)

    def _restore(self):
        self.problem.put(self.here.numbers)
        self.problem.set_load_factor(self.here.load_factor)
        return False
