"""Schemes of one implicit step, order 2: velocities by the trapezoidal rule, whatever the forms conserve."""

import numpy as np

from cosserat_fenicsx.dynamics.start import drive
from cosserat_fenicsx.dynamics.steppers.newton import StepNewton

# Error estimates look back over three times so many steps: what changes within a few steps is not resolved, but small.
_APART = 8
#: What an error of 1 rad counts as, in lengths.
TURNS = 0.1


class OneStep:
    """See `protocol.Stepper`."""

    order, adapts, rho_inf, keeps_kinks = 2, True, None, True
    missed = 1 / 24  # loads act as they are half way
    #: error of a step over that of the trapezoidal rule, as measured
    coarseness = 1.0

    def __init__(self, problem):
        self.problem, self._newton = problem, StepNewton(problem)
        model = problem.model
        self._comm = model.comm
        self._state, self._start, self._velocity = (f.x.array for f in (model.state, model.start, model.velocity))
        self._rates = model.rate_arrays

    def begin(self):
        """See `Stepper`."""
        self._h = None
        self._newton.forget()
        self.work = self.dissipated = 0.0
        self.jump()

    def jump(self):
        """See `Stepper`."""
        self._past = []  # (h, state before, rates before, work and dissipation before) of the last steps

    def drive(self, t):
        """See `Stepper`."""
        kinetic, _ = self.problem.energies()
        drive(self.problem.model, t)
        self.work += self.problem.energies()[0] - kinetic

    def bend(self):
        """See `Stepper`: no scheme of one step looks at what was before, but to begin Newton's method."""

    def step(self, t, h):
        """See `Stepper`."""
        problem = self.problem
        if self._h is None or abs(h - self._h) > 1e-9 * abs(h):
            problem.fresh, self._h = True, h
        problem.aim(t, h)
        unit = problem.h
        guesses = self._predicted(unit)
        solved = self._newton.solve(guesses)
        if not solved.converged:
            self._state[:] = self._start
            problem.begin()
            return solved
        self._past = [
            *self._past[1 - 3 * _APART :],
            (unit, self._start.copy(), [rate.copy() for rate in self._rates], (self.work, self.dissipated)),
        ]
        self._foretold = guesses[0]
        self.work += problem.work()
        self.dissipated += problem.dissipated()
        problem.model.accept(unit)
        return solved

    def _predicted(self, h):
        """States at the end of the step by extrapolations, the one first that would have foretold the last step best."""
        now = (h, self._start, self._velocity)
        known = [(step, state, rates[0]) for step, state, rates, _ in self._past[-3:]]
        guesses = _extrapolated([*known, now])
        if len(known) < 3:
            return guesses[::-1]
        missed = np.array([np.square(guess - self._start).sum() for guess in _extrapolated(known)])
        order = np.argsort(self._comm.allreduce(missed) if self._comm.size > 1 else missed)
        return [guesses[k] for k in order]

    def error(self, early=False):
        """See `Stepper`: h^3/12 times the third derivative of the cubic through four states, the last of them that of now.

        Positions alone, since velocities carry what fast waves leave; those are not resolved, and small.
        """
        apart = min(_APART, len(self._past) // 3) if early else _APART
        past = self._past[-3 * apart :]
        if not apart or len(past) < 3 * apart:
            return None
        steps = np.array([h for h, *_ in past])
        states = [state for _, state, *_ in past[::apart]] + [self._state]
        times = np.concatenate([[0.0], np.cumsum(steps)])[::apart]
        weights = [1 / np.prod([a - b for b in times if b != a]) for a in times]
        third = sum(w * x for w, x in zip(weights, states, strict=True))  # a sixth of the derivative
        return self.coarseness * 0.5 * steps[-1] ** 3 * self.problem.model.largest_of(third, TURNS)

    def surprise(self):
        """See `Stepper`."""
        return self.problem.model.largest_of(self._state - self._foretold, TURNS)

    def undo(self):
        """See `Stepper`."""
        _, state, rates, (self.work, self.dissipated) = self._past.pop()
        self._state[:] = state
        for now, before in zip(self._rates, rates, strict=True):
            now[:] = before
        self.problem.begin()

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
        }

    def recall(self, memory):
        """See `Stepper`."""
        self._h = None if np.isnan(memory["h"]) else memory["h"]
        self.work, self.dissipated = memory["books"].tolist()
        for i, rate in enumerate(self._rates):
            rate[:] = memory["rates"][str(i)]
        past = memory["past"]
        rates = zip(*past.get("rates", {}).values(), strict=True)
        books = map(tuple, past["books"].tolist())
        self._past = [
            (float(h), state.copy(), [rate.copy() for rate in kinds], book)
            for h, state, kinds, book in zip(past["steps"], past["states"], rates, books, strict=True)
        ]
        self.problem.recall(memory["problem"])
        self._newton.recall(memory["newton"])


def _numbered(arrays):
    return {str(i): array for i, array in enumerate(arrays)}


def _extrapolated(steps):
    """States at the end of the last of some steps (h, state and velocity at its beginning), by its velocity alone, and
    by the velocities of one and of two steps before too."""
    (h, state, velocity), *earlier = steps[::-1]
    guesses = [state + h * velocity]
    if earlier:
        (h1, _, velocity1), *earlier = earlier
        risen = (velocity - velocity1) / h1
        guesses.append(guesses[-1] + 0.5 * h**2 * risen)
        if earlier:
            h2, _, velocity2 = earlier[0]
            bent = (risen - (velocity1 - velocity2) / h2) / (h1 + h2)
            guesses.append(guesses[-1] + 0.5 * h**2 * (h + h1) * bent)
    return guesses
