"""Newton's method for a time step: full increments, with a factorised tangent that is reused over many time steps.

An iteration with an old tangent costs one residual and one back-substitution: on a fine mesh a tenth of one with a new
tangent. PETSc's SNES would evaluate one more residual per step, and norms that are not used. (Broyden's updates of the
old tangent were tried: they need as many iterations, and each costs more.)

Convergence is tested on the increments of the nodal unknowns alone: contact forces and reactions have larger rounding
errors, and the residual of a stiff rod cannot fall below its rounding.
"""

import math

import numpy as np

from cosserat_fenicsx.algebra.newton import Solved

#: Newton's method stops when the remaining error, estimated from the contraction of the increments, is below the first
#: number times the motion in the step (root mean square, units L, 1), since that is the relative error of velocities
#: and momenta; or below the second, the rounding of positions. The rounding of a stiff rod may be larger: increments
#: below the third that no longer shrink have converged, too.
INCREMENT, SMALLEST, ROUNDING = 1e-12, 2e-16, 1e-10
# Times the first two where nodes may touch walls: the errors that are left there do not cancel from step to step, and
# would add up to 1e-8 of the energy in 10 000.
_WITH_CONTACT = 0.03
# Contraction of increments with a new tangent, as measured.
_NEW_TANGENT_RATE = 3e-4
# Cost of a new tangent, in iterations. Measured: from 1.3 in a plane to 5 in space, and 8 with constraint equations;
# from 1 to 8 the time of a motion varies by a few per cent.
_PRICE = 2.0
# Number of steps with a new tangent each, after a tangent that was useful for one step only.
_STEPS_WITH_NEW_TANGENTS = 8
# Iterations, and dimensionless increment, that are taken as divergence.
_MOST_ITERATIONS, _DIVERGED = 15, 10.0


# Why the iteration stopped: `stepping.outcome` in newton.c.
_CONVERGED = 1
_OUTCOMES = (
    "", "converged", "the tangent is singular", "the residual is not a number", "Newton's steps grew without bound",
    "Newton's iterations ran out",
)  # fmt: skip


class StepNewton:
    """Newton's method for the steps of one problem.

    Args:
        problem: a `StepProblem`.
    """

    def __init__(self, problem):
        self.problem = problem
        numbering = problem.numbering
        self._motions = numbering.nodes * numbering.block  # nodal unknowns of this rank
        motions = problem.model.comm.allreduce(self._motions)
        self._start = np.zeros(self._motions)
        self._c = problem.stepping(
            self._start, motions=self._motions, root=math.sqrt(motions), increment=INCREMENT, smallest=SMALLEST,
            rounding=ROUNDING, rate=_NEW_TANGENT_RATE, price=_PRICE, diverged=_DIVERGED, most=_MOST_ITERATIONS,
        )  # fmt: skip
        self.forget()

    def forget(self):
        """Discard the tangent and the statistics of its reuse, as before the first step."""
        self.problem.fresh = True
        # cost of the tangent and its iterations; steps it has served; steps left that start with a new tangent
        self._spent, self._served, self._anew = 0.0, 0, 0

    def solve(self, guesses):
        """Newton's method from the first guess with the current tangent; where that fails, from every guess with a new
        one.

        Args:
            guesses: predictors of the state, local arrays, the best first. Extrapolations of large rotations can fail.

        Returns:
            Solved.
        """
        kept, share = not self.problem.fresh, _WITH_CONTACT if self.problem.contact else 1.0
        self._c.increment, self._c.smallest = share * INCREMENT, share * SMALLEST
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
        converged, found = c.outcome == _CONVERGED, _OUTCOMES[c.outcome]
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
        """The statistics that decide when the tangent is renewed, see `Stepper.memory`."""
        return {"spent": self._spent, "served": self._served, "anew": self._anew}

    def recall(self, memory):
        """Restore what `memory` returned."""
        self._spent, self._served, self._anew = memory["spent"], memory["served"], memory["anew"]
