"""Base of the implicit one-step schemes (velocities by the trapezoidal rule), and Newton's method for a step."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cosserat_fenicsx.algebra.building import module
from cosserat_fenicsx.algebra.newton import WORDS, Solved
from cosserat_fenicsx.dynamics.start import drive
from cosserat_fenicsx.numerics import lagrange

# Stride of the four states of the error estimate, which averages out small, unresolved vibrations.
_STRIDE = 8
#: Weight of rotations (rad) in error norms, relative to positions over the unit of length.
ROTATION_WEIGHT = 0.1


class Stepper:
    """A scheme with the `StepProblem` that it solves; made once for a signature, used for every scene of it.

    Attributes:
        order: of the global error in the step h.
        forms: the name of the discretisation that its models must have; problem_class: the class of its `StepProblem`.
        kinks_persist: whether velocities alternate from step to step without decay after a kink of a prescribed motion.
        adapts: whether `error` holds, so that steps can be chosen by it.
        rho_inf: spectral radius at infinite frequency where that can be set, else None.
        impulse_error: error of a load's impulse over steps h, divided by h^2 times the change of the load's rate; here
            loads are evaluated at mid-step.
        error_ratio: local error over that of the trapezoidal rule, as measured.
        work, dissipated: work of loads and supports, and energy dissipated by damping, since `begin`; dimensionless.
    """

    forms: str
    problem_class: type
    order, adapts, rho_inf, kinks_persist, impulse_error, error_ratio = 2, True, None, True, 1 / 24, 1.0

    def __init__(self, problem):
        self.problem, self._newton = problem, StepNewton(problem)
        model = problem.model
        self._comm = model.comm
        self._state, self._start, self._velocity = (f.x.array for f in (model.state, model.start, model.velocity))
        self._rates = (*model.rate_arrays, *model.actions.memory)

    def begin(self):
        """Start a motion from the current state of the problem's model."""
        self._h = None
        self._newton.forget()
        self.work = self.dissipated = 0.0
        self.problem.model.delays.begin()
        self.jump()

    def jump(self):
        """Forget earlier states: accelerations or velocities jump at the current time."""
        self._guesses = None  # those of the last step, where they are known
        self._past = []  # of the last steps: (h, state, rates, (work, dissipated)) at their starts

    def drive(self, t):
        """`start.drive` at t (s); the change of kinetic energy counts as work of the supports."""
        kinetic, _ = self.problem.energies()
        self._guesses = None
        drive(self.problem.model, t)
        self.work += self.problem.energies()[0] - kinetic

    def kink(self):
        """The slope of a load, and so the rate of the acceleration, jumps at the current time; predictors may stay."""

    def step(self, t, h):
        """Step from the time t to t + h, s: `Solved`. Where it has converged, the problem's x and the model's state and
        velocity are those of t + h; otherwise they are as they were at t."""
        problem, delays = self.problem, self.problem.model.delays
        if h > delays.longest:
            return Solved(False, 0, f"it is longer than the {delays.longest:.3g} s that an action allows")
        if self._h is None or abs(h - self._h) > 1e-9 * abs(h):
            problem.fresh, self._h = True, h
        problem.begin_step(t, h)
        unit = problem.h
        guesses = self._predicted(unit)
        solved = self._newton.solve(guesses)
        if solved.converged and problem.rods_touching and (why := problem.rods_touching.objection()):
            solved = Solved(False, solved.iterations, why)
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
        problem.accept()
        return solved

    def _predicted(self, h):
        """Predictors of the state at the end of the step: of several orders, the best one in the last step first."""
        known, last = self._past[-3:], self._guesses
        steps = [step for step, *_ in known[-2:]]
        self._guesses = guesses = _extrapolated(h, self._start, self._velocity, steps, [x[2][0] for x in known[-2:]])
        if len(known) < 3:
            return guesses[::-1]
        if last is None:
            (h2, _, rates2, _), (h1, _, rates1, _), (h0, state, rates, _) = known
            last = _extrapolated(h0, state, rates[0], [h2, h1], [rates2[0], rates1[0]])
        errors = np.array([change @ change for change in last - self._start])
        order = np.argsort(self._comm.allreduce(errors) if self._comm.size > 1 else errors)
        return [guesses[k] for k in order]

    def error(self, early=False):
        """Estimated local error of the last step, of positions (over the unit of length) and rotations (rad over 10).

        h^3/12 times the third derivative of the cubic through four states, the last one the current; None where too few
        steps have been made since the start or a jump. With `early` few steps suffice; fast waves, which they do not
        average out, then count too. Differences of velocities are left out, which such waves dominate.
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
        """Difference between the end of the last step and the predictor, in the norm of `error`."""
        return self.problem.model.largest_of(self._state - self._predictor, ROTATION_WEIGHT)

    def moved(self):
        """Largest displacement of a node in the last step, over all ranks, dimensionless."""
        return self.problem.model.largest_of(self._state - self._past[-1][1], 0.0)

    def undo(self):
        """Return to the state before the last step."""
        _, state, rates, (self.work, self.dissipated) = self._past.pop()
        self._guesses = None
        self._state[:] = state
        for now, before in zip(self._rates, rates, strict=True):
            now[:] = before
        self.problem.model.delays.undo()
        self.problem.begin_again()

    def memory(self):
        """All data, besides the scene and the time, that later steps depend on: arrays, numbers, and dicts of them, the
        problem's own included (`StepProblem.memory`): a motion continued from it has the same digits."""
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
        """Restore what `memory` returned, after `begin`, on the same scene."""
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
    """(orders, n) extrapolations of the state by a step h: of order 1, and one more for each step before."""
    return _weights(h, *steps) @ np.array([state, velocity, *velocities[::-1]])


@lru_cache(maxsize=8)
def _weights(h, *steps):
    """Weights of the state and of the velocities, the current one first, in `_extrapolated`."""
    times = [0.0, *-np.cumsum(steps[::-1])]
    weights = np.zeros((len(times), 1 + len(times)))
    weights[:, 0], weights[:, 1] = 1.0, h / 2
    for order in range(1, 1 + len(times)):
        weights[order - 1, 1 : 1 + order] += h / 2 * np.array(lagrange(times[:order], h))
    return weights


@dataclass(frozen=True)
class Iteration:
    """When Newton's method for a time step stops, and when it takes a new tangent (`stepping` in C)."""

    # Allowed remaining error over the motion in the step (root mean square, units L, 1), which is the relative error of
    # velocities and momenta, estimated from the contraction of the increments; and the same, absolute: rounding.
    increment: float = 1e-12
    smallest: float = 2e-16
    rounding: float = 1e-10  # increments below it that no longer shrink have converged, too: rounding of a stiff rod
    of_noise: float = 1.0  # at a wall, errors below this multiple of such increments in earlier steps are allowed
    rate: float = 3e-4  # contraction of increments with a new tangent, as measured
    # Cost of a new tangent, in iterations: as measured, 1.3 in a plane, 5 in space, 8 with constraint equations. From 1
    # to 8 the time of a motion varies by a few per cent.
    price: float = 2.0
    diverged: float = 10.0  # dimensionless increment that is taken as divergence
    most: int = 15  # iterations


ITERATION = Iteration()
# Factor on `increment` and `smallest` where nodes may touch walls: remaining errors do not cancel from step to step
# there, and would add up to 1e-8 of the energy in 10 000.
_WITH_CONTACT = 0.03
# Number of steps with a new tangent each, after a tangent that was useful for one step only.
_STEPS_WITH_NEW_TANGENTS = 8


class StepNewton:
    """Newton's method for the steps of one `StepProblem`: full increments, one factorised tangent for many steps.

    An iteration with an old tangent costs one residual and one back-substitution: on a fine mesh a tenth of one with a
    new tangent. (Broyden's updates of the old tangent need as many iterations, and each costs more.)

    Convergence is tested on the increments of the nodal unknowns alone: contact forces and reactions have larger
    rounding errors, and the residual of a stiff rod cannot fall below its rounding.
    """

    def __init__(self, problem):
        self.problem = problem
        numbering = problem.numbering
        self._motions = numbering.nodes * numbering.block  # nodal unknowns of this rank
        motions = problem.model.comm.allreduce(self._motions)
        self._start = np.zeros(self._motions)
        self._converged = module()[1].CONVERGED
        self._c = problem.stepping(self._start, motions=self._motions, root=math.sqrt(motions), **vars(ITERATION))
        self.forget()

    def forget(self):
        """Discard the tangent and the statistics of its reuse, as before the first step."""
        self.problem.fresh = True
        # cost of the tangent and its iterations; steps it has served; steps left that start with a new tangent
        self._spent, self._served, self._anew, self._c.noise = 0.0, 0, 0, 0.0

    def solve(self, guesses):
        """Newton's method from the first guess with the current tangent; where that fails, from every guess with a new
        one. Guesses are local arrays of the state, the best first: extrapolations of large rotations can fail."""
        kept, share = not self.problem.fresh, _WITH_CONTACT if self.problem.touching else 1.0
        self._c.increment, self._c.smallest = share * ITERATION.increment, share * ITERATION.smallest
        self._start[:] = self.problem.x.array_r[: self._motions]
        iterations = 0
        for guess in [guesses[0], *guesses] if kept else guesses:
            solved = self._attempt(guess)
            iterations += solved.iterations
            if solved.converged:
                break
            self.problem.fresh = True
        return Solved(solved.converged, iterations, solved.reason)

    def _attempt(self, guess):
        problem, c = self.problem, self._c
        lived, began_fresh = self._served, problem.fresh
        c.fresh, c.spent, c.served = began_fresh, self._spent, self._served
        problem.guess(guess)
        problem.iterate(c)
        converged, found = c.verdict == self._converged, WORDS[c.verdict]
        if converged and problem.model.turned_over():
            converged, found = False, "a section turned by half a turn or more in one step"
        if converged and problem.contact and problem.contact.broken:
            converged, found = False, "the forces of a wall do not follow from the motion"
        iterations = c.iterations
        self._spent, self._served = c.spent + iterations, c.served + 1
        if self._served == 1 and lived == 1 and not began_fresh:  # the last tangent served for one step only
            self._anew = _STEPS_WITH_NEW_TANGENTS
        # a new tangent, too, where this step took more iterations than the mean cost per step of the current one
        problem.fresh = not converged or self._anew > 0 or iterations * self._served > self._spent
        self._anew -= problem.fresh and self._anew > 0
        return Solved(converged, iterations, found)

    def memory(self):
        """The statistics that decide when iterations stop and when the tangent is renewed, see `Stepper.memory`."""
        return {"spent": self._spent, "served": self._served, "anew": self._anew, "noise": self._c.noise}

    def recall(self, memory):
        self._spent, self._served, self._anew = memory["spent"], memory["served"], memory["anew"]
        self._c.noise = memory["noise"]
