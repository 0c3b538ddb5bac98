"""Newton's method for a time step: full increments, with a factorised tangent that is reused over many time steps.

An iteration with an old tangent costs one residual and one back-substitution: on a fine mesh a tenth of one with a new
tangent. PETSc's SNES would evaluate one more residual per step, and norms that are not used. (Broyden's updates of the
old tangent were tried: they need as many iterations, and each costs more.)

Convergence is tested on the increments of the nodal unknowns alone: contact forces and reactions have larger rounding
errors, and the residual of a stiff rod cannot fall below its rounding.
"""

import math

from cosserat_fenicsx.algebra.newton import Solved

#: Newton's method stops when the remaining error, estimated from the contraction of the increments, is below the first
#: number times the motion in the step (root mean square, units L, 1), since that is the relative error of velocities
#: and momenta; or below the second, the rounding of positions. The rounding of a stiff rod may be larger: increments
#: below the third that no longer shrink have converged, too.
INCREMENT, SMALLEST, ROUNDING = 1e-12, 2e-16, 1e-10
# Contraction of increments with a new tangent, as measured.
_NEW_TANGENT_RATE = 3e-4
# Number of steps with a new tangent each, after a tangent that was useful for one step only.
_STEPS_WITH_NEW_TANGENTS = 8
# Iterations, and dimensionless increment, that are taken as divergence.
_MOST_ITERATIONS, _DIVERGED = 15, 10.0


class StepNewton:
    """Newton's method for the steps of one problem.

    Args:
        problem: a `StepProblem`.
    """

    def __init__(self, problem):
        self.problem = problem
        numbering = problem.numbering
        self._motions = numbering.nodes * numbering.block  # nodal unknowns of this rank
        self._comm = problem.model.comm
        motions = self._comm.allreduce(self._motions)
        self._root = math.sqrt(motions)
        self._price = motions / (80 + 0.2 * motions)  # cost of a new tangent, in iterations, as measured
        self._step = numbering.vector()
        self.forget()

    def forget(self):
        """Discard the tangent and the statistics of its reuse, as before the first step."""
        self.problem.fresh = True
        # cost of the tangent and its iterations; steps it has served; steps left that start with a new tangent
        self._spent = self._served = self._anew = 0

    def solve(self, guesses):
        """Newton's method from the first guess with the current tangent; where that fails, from every guess with a new
        one.

        Args:
            guesses: predictors of the state, local arrays, the best first. Extrapolations of large rotations can fail.

        Returns:
            Solved.
        """
        kept = not self.problem.fresh
        start = self.problem.x.array_r[: self._motions].copy()
        iterations = 0
        for guess in [guesses[0], *guesses] if kept else guesses:
            solved = self._attempt(guess, start)
            iterations += solved.iterations
            if solved.converged:
                break
            self.problem.fresh = True
        return Solved(solved.converged, iterations, solved.reason)

    def _attempt(self, guess, start):
        problem, found, steps = self.problem, None, []
        lived, began_fresh = self._served, problem.fresh
        problem.guess(guess)
        self._enough = max(SMALLEST, INCREMENT * self._size(problem.x.array_r[: self._motions] - start))
        while found is None:
            problem.function(problem.x, problem.b)
            if not self._solve():
                found = "the tangent is singular"
                break
            problem.x.axpy(-1.0, self._step)
            found = self._outcome(steps)
        problem.set_state(problem.x)
        if found == "converged" and problem.model.turned_over():
            found = "a section turned by half a turn or more in one step"
        converged = found == "converged"
        self._spent, self._served = self._spent + len(steps), self._served + 1
        if self._served == 1 and lived == 1 and not began_fresh:  # the last tangent served for one step only
            self._anew = _STEPS_WITH_NEW_TANGENTS
        # a new tangent, too, where this step took more iterations than the mean cost per step of the current one
        problem.fresh = not converged or self._anew > 0 or len(steps) * self._served > self._spent
        self._anew -= problem.fresh and self._anew > 0
        return Solved(converged, len(steps), found)

    def _size(self, moved):
        """The root mean square of nodal unknowns over all ranks."""
        square = float(moved @ moved)
        return math.sqrt(self._comm.allreduce(square) if self._comm.size > 1 else square) / self._root

    def _solve(self):
        """Solve for the increment; False where the tangent is singular."""
        problem = self.problem
        if problem.fresh:
            problem.factor()
            self._spent, self._served = self._price, 0
        return problem.solve(problem.b, self._step)

    def _outcome(self, steps):
        """Why the iteration stops after the last increment, in words; None where it continues."""
        step = self._size(self._step.array_r[: self._motions])
        steps.append(step)
        if not math.isfinite(step):
            return "the residual is not a number"
        if step > _DIVERGED:
            return "Newton's steps grew without bound"
        rate = step / steps[-2] if len(steps) > 1 else 1.0
        if (
            step <= self._enough
            or (rate < 0.9 and step * rate / (1 - rate) <= self._enough)
            or (step <= ROUNDING and rate > 0.5 and len(steps) > 1)
        ):
            return "converged"
        if len(steps) >= _MOST_ITERATIONS:
            return "Newton's iterations ran out"
        if len(steps) > 1:
            left = math.log(self._enough / step)
            with_new = self._price + left / math.log(_NEW_TANGENT_RATE)  # cost until convergence, in iterations
            self.problem.fresh = rate > 0.9 or left / math.log(rate) > with_new
        return None

    def memory(self):
        """The statistics that decide when the tangent is renewed, see `Stepper.memory`."""
        return {"spent": self._spent, "served": self._served, "anew": self._anew}

    def recall(self, memory):
        """Restore what `memory` returned."""
        self._spent, self._served, self._anew = memory["spent"], memory["served"], memory["anew"]
