"""Base of the implicit one-step schemes of order 2: velocities by the trapezoidal rule, whatever the forms conserve."""

from functools import lru_cache

import numpy as np

from cosserat_fenicsx.algebra.newton import Solved
from cosserat_fenicsx.dynamics.start import drive
from cosserat_fenicsx.dynamics.steppers.newton import StepNewton

# The error estimate takes four states, so many steps apart: this averages out unresolved, small vibrations.
_STRIDE = 8
#: Weight of rotations (rad) in error norms, relative to positions over the unit of length.
ROTATION_WEIGHT = 0.1


class OneStep:
    """See `protocol.Stepper`."""

    order, adapts, rho_inf, kinks_persist = 2, True, None, True
    impulse_error = 1 / 24  # loads are evaluated at mid-step
    #: local error over that of the trapezoidal rule, as measured
    error_ratio = 1.0

    def __init__(self, problem):
        self.problem, self._newton = problem, StepNewton(problem)
        model = problem.model
        self._comm = model.comm
        self._state, self._start, self._velocity = (f.x.array for f in (model.state, model.start, model.velocity))
        self._rates = (*model.rate_arrays, *model.actions.memory)

    def begin(self):
        """See `Stepper`."""
        self._h = None
        self._newton.forget()
        self.work = self.dissipated = 0.0
        self.problem.model.delays.begin()
        self.jump()

    def jump(self):
        """See `Stepper`."""
        self._guesses = None  # those of the last step, where they are known
        self._past = []  # of the last steps: (h, state, rates, (work, dissipated)) at their starts

    def drive(self, t):
        """See `Stepper`."""
        kinetic, _ = self.problem.energies()
        self._guesses = None
        drive(self.problem.model, t)
        self.work += self.problem.energies()[0] - kinetic

    def kink(self):
        """See `Stepper`: a one-step scheme takes earlier states for its predictor alone."""

    def step(self, t, h):
        """See `Stepper`."""
        problem, delays = self.problem, self.problem.model.delays
        if h > delays.longest:
            return Solved(False, 0, f"it is longer than the {delays.longest:.3g} s that an action allows")
        if self._h is None or abs(h - self._h) > 1e-9 * abs(h):
            problem.fresh, self._h = True, h
        problem.begin_step(t, h)
        unit = problem.h
        guesses = self._predicted(unit)
        solved = self._newton.solve(guesses)
        if not solved.converged:
            self._guesses = None
            self._state[:] = self._start
            problem.begin_again()
            return solved
        self._past = [
            *self._past[1 - 3 * _STRIDE :],
            (unit, self._start.copy(), [rate.copy() for rate in self._rates], (self.work, self.dissipated)),
        ]
        self._predictor = guesses[0]
        self.work += problem.work()
        self.dissipated += problem.dissipated()
        delays.accept(t, h)
        problem.model.accept(unit)
        problem.model.actions.commit()
        return solved

    def _predicted(self, h):
        """Predictors of the state at the end of the step: extrapolations of several orders.

        First comes the order whose extrapolation of the last step was closest to its result.
        """
        known, last = self._past[-3:], self._guesses
        steps = [step for step, *_ in known[-2:]]
        self._guesses = guesses = _extrapolated(h, self._start, self._velocity, steps, [x[2][0] for x in known[-2:]])
        if len(known) < 3:
            return guesses[::-1]
        if last is None:
            (h2, _, rates2, _), (h1, _, rates1, _), (h0, state, rates, _) = known
            last = _extrapolated(h0, state, rates[0], [h2, h1], [rates2[0], rates1[0]])
        off = last - self._start
        errors = np.array([change @ change for change in off])
        order = np.argsort(self._comm.allreduce(errors) if self._comm.size > 1 else errors)
        return guesses[order]

    def error(self, early=False):
        """See `Stepper`: h^3/12 times the third derivative of the cubic through four states, the last one the current.

        Only positions count: differences of velocities are dominated by fast waves, which are small and not resolved.
        """
        stride = min(_STRIDE, len(self._past) // 3) if early else _STRIDE
        past = self._past[-3 * stride :]
        if not stride or len(past) < 3 * stride:
            return None
        steps = np.array([h for h, *_ in past])
        states = [state for _, state, *_ in past[::stride]] + [self._state]
        times = np.concatenate([[0.0], np.cumsum(steps)])[::stride]
        weights = [1 / np.prod([a - b for b in times if b != a]) for a in times]
        third = sum(w * x for w, x in zip(weights, states, strict=True))  # a sixth of the derivative
        return self.error_ratio * 0.5 * steps[-1] ** 3 * self.problem.model.largest_of(third, ROTATION_WEIGHT)

    def prediction_error(self):
        """See `Stepper`."""
        return self.problem.model.largest_of(self._state - self._predictor, ROTATION_WEIGHT)

    def undo(self):
        """See `Stepper`."""
        _, state, rates, (self.work, self.dissipated) = self._past.pop()
        self._guesses = None
        self._state[:] = state
        for now, before in zip(self._rates, rates, strict=True):
            now[:] = before
        self.problem.model.delays.undo()
        self.problem.begin_again()

    def memory(self):
        """See `Stepper`."""
        past = self._past
        return {
            "h": np.nan if self._h is None else self._h,
            "books": np.array([self.work, self.dissipated]),
            "rates": _numbered(self._rates),
            "past": {
                "steps": np.array([h for h, *_ in past]),
                "states": np.array([state for _, state, *_ in past]),
                "rates": _numbered(np.array(kind) for kind in zip(*(rates for *_, rates, _ in past), strict=True)),
                "books": np.array([books for *_, books in past]),
            },
            "problem": self.problem.memory(),
            "newton": self._newton.memory(),
            "delays": self.problem.model.delays.memory(),
        }

    def recall(self, memory):
        """See `Stepper`."""
        self._h = None if np.isnan(memory["h"]) else memory["h"]
        self.work, self.dissipated = memory["books"].tolist()
        for i, rate in enumerate(self._rates):
            rate[:] = memory["rates"][str(i)]
        past, self._guesses = memory["past"], None
        rates = zip(*past.get("rates", {}).values(), strict=True)
        books = map(tuple, past["books"].tolist())
        self._past = [
            (float(h), state.copy(), [rate.copy() for rate in kinds], book)
            for h, state, kinds, book in zip(past["steps"], past["states"], rates, books, strict=True)
        ]
        self.problem.recall(memory["problem"])
        self._newton.recall(memory["newton"])
        self.problem.model.delays.recall(memory.get("delays", {}))


def _numbered(arrays):
    return {str(i): array for i, array in enumerate(arrays)}


def _extrapolated(h, state, velocity, steps, velocities):
    """(orders, n) extrapolations of the state by a step h, of order 1 and one more for each earlier step.

    Args:
        steps, velocities: lengths and initial velocities of up to two steps before, the last one last.
    """
    return _weights(h, *steps) @ np.array([state, velocity, *velocities[::-1]])


@lru_cache(maxsize=8)
def _weights(h, *steps):
    """Weights of the state and of the velocities, the current one first, in `_extrapolated`."""
    orders = 1 + len(steps)
    weights, square = np.zeros((orders, 1 + orders)), 0.5 * h * h
    weights[:, 0], weights[:, 1] = 1.0, h
    if steps:
        h1 = steps[-1]
        weights[1:, 1] += square / h1
        weights[1:, 2] = -square / h1
    if len(steps) == 2:
        h2 = steps[0]
        cubic = square * (h + h1) / (h1 + h2)  # times half the rate of the acceleration
        weights[2, 1:] += cubic / h1, -cubic / h1 - cubic / h2, cubic / h2
    return weights
