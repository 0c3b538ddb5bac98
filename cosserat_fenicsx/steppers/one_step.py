"""Schemes of one implicit step, order 2: velocities by the trapezoidal rule, whatever the forms conserve."""

import numpy as np

from cosserat_fenicsx.steppers.newton import StepNewton

# Error estimates look back over three times so many steps: what changes within a few steps is not resolved, but small.
_APART = 8
#: What an error of 1 rad counts as, in lengths.
TURNS = 0.1


class OneStep:
    """See `protocol.Stepper`."""

    order, adapts, rho_inf = 2, True, None

    def __init__(self, problem):
        self.problem, self._newton = problem, StepNewton(problem)
        model = problem.model
        self._state, self._start, self._velocity = (f.x.array for f in (model.state, model.start, model.velocity))
        self._rates = model.rate_arrays

    def begin(self):
        """See `Stepper`."""
        self._h = None
        self.work = self.dissipated = 0.0
        self.jump()

    def jump(self):
        """See `Stepper`."""
        self._past = []  # (h, state before, rates before, work and dissipation before) of the last steps

    def step(self, t, h):
        """See `Stepper`."""
        problem = self.problem
        if self._h is None or abs(h - self._h) > 1e-9 * abs(h):
            problem.fresh, self._h = True, h
        problem.aim(t, h)
        unit = problem.h
        solved = self._newton.solve(self._predicted(unit))
        if not solved.converged:
            self._state[:] = self._start
            problem.begin()
            return solved
        self._past = [
            *self._past[1 - 3 * _APART :],
            (unit, self._start.copy(), [rate.copy() for rate in self._rates], (self.work, self.dissipated)),
        ]
        self.work += problem.work()
        self.dissipated += problem.dissipated()
        problem.model.accept(unit)
        return solved

    def _predicted(self, h):
        """The state at the end of the step by the velocity at its beginning and the last acceleration."""
        ahead = h * self._velocity
        if self._past:
            before, _, (velocity, *_), _ = self._past[-1]
            ahead += 0.5 * h**2 / before * (self._velocity - velocity)
        return self._start + ahead

    def error(self):
        """See `Stepper`: h^3/12 times the third derivative of the cubic through the last four states.

        Positions alone, since velocities carry what fast waves leave; those are not resolved, and small.
        """
        if len(self._past) < 3 * _APART:
            return None
        steps = np.array([h for h, *_ in self._past])
        states = [state for _, state, *_ in self._past[::_APART]] + [self._state]
        times = np.concatenate([[0.0], np.cumsum(steps)])[::_APART]
        weights = [1 / np.prod([a - b for b in times if b != a]) for a in times]
        third = sum(w * x for w, x in zip(weights, states, strict=True))  # a sixth of the derivative
        return 0.5 * steps[-1] ** 3 * self.problem.model.largest_of(third, TURNS)

    def undo(self):
        """See `Stepper`."""
        _, state, rates, (self.work, self.dissipated) = self._past.pop()
        self._state[:] = state
        for now, before in zip(self._rates, rates, strict=True):
            now[:] = before
        self.problem.begin()
