"""Newton's method for a step in time: full steps with a tangent that is kept while it serves, over many steps of time.

An iteration with a kept tangent is one residual and one back-substitution, a tenth of one with a fresh tangent.
PETSc's SNES would ask for one more residual a step, and for norms that are not looked at: a tenth of the time.

Only the increments of the nodes' unknowns are tested: contact forces and reactions have rounding of their own, and the
residual of a stiff rod has a floor.
"""

import math

from petsc4py import PETSc

from cosserat_fenicsx import linear
from cosserat_fenicsx.snes import EXTERNAL, Solved

#: Newton stops when what remains after an increment, by its contraction, is below this (root mean square, units L, 1)
#: times h over the unit of time, for velocities, and with them momenta, are off by so much over h. Rounding may leave
#: more: where increments below the second number shrink no more, that is the end.
INCREMENT, ROUNDING = 1e-12, 1e-10
# A kept tangent is made anew where increments shrink by less than the first number, and after a step of more
# iterations than the second; the larger the system, the more iterations a tangent costs.
_SMALL_SYSTEM, _LARGE_SYSTEM, _LARGE = (0.05, 4), (0.3, 8), 400
_MOST, _HUGE = 15, 10.0


class StepNewton:
    """Newton's method for the steps of one problem.

    Args:
        problem: a `StepProblem`.
    """

    def __init__(self, problem):
        self.problem = problem
        numbering = problem.numbering
        self._motions = numbering.nodes * numbering.block
        self._comm = problem.model.comm
        motions = self._comm.allreduce(self._motions)
        self._root = math.sqrt(motions)
        self._slow, self._many = _LARGE_SYSTEM if motions > _LARGE else _SMALL_SYSTEM
        self._step = numbering.vector()
        self._begin()

    def _begin(self):
        self._ksp = ksp = PETSc.KSP().create(self._comm)
        ksp.setType("preonly")  # Newton's iterations bring back the digits that a factorisation loses
        ksp.setOperators(self.problem.A)
        linear.factor_tangent(ksp.getPC(), self.problem.A, self.problem.tangent)

    def solve(self, guess):
        """Newton from local numbers of the state, with the tangent at hand, and with a fresh one where that fails.

        Returns:
            Solved.
        """
        kept = not self.problem.fresh
        solved = self._attempt(guess)
        if solved.converged or not kept:
            return solved
        self.problem.fresh = True
        again = self._attempt(guess)
        return Solved(again.converged, solved.iterations + again.iterations, again.reason)

    def _attempt(self, guess):
        problem, steps, found = self.problem, [], None
        problem.guess(guess)
        while found is None:
            problem.function(None, problem.x, problem.b)
            if not self._solve():
                found = "the tangent is singular"
                break
            problem.x.axpy(-1.0, self._step)
            found = self._outcome(steps)
        problem.set_state(problem.x)
        converged = found == "converged"
        if not converged or len(steps) > self._many:
            problem.fresh = True
        return Solved(converged, len(steps), found)

    def _solve(self):
        """The increment for the residual; False where the tangent is singular."""
        problem, ksp = self.problem, self._ksp
        if problem.fresh:
            problem.jacobian(None, problem.x, problem.A, problem.A)
            ksp.setOperators(problem.A)
        try:
            ksp.solve(problem.b, self._step)
        except PETSc.Error as error:  # PETSc counts solutions begun and not ended, up to two
            if error.ierr != EXTERNAL:
                raise
            self._begin()
            return False
        return ksp.getConvergedReason() >= 0

    def _outcome(self, steps):
        """Why Newton stops after the last increment, in words; None where it goes on."""
        moved = self._step.array_r[: self._motions]
        step = math.sqrt(self._comm.allreduce(float(moved @ moved))) / self._root
        steps.append(step)
        if not math.isfinite(step):
            return "the residual is not a number"
        if step > _HUGE:
            return "Newton's steps grew without bound"
        rate = step / steps[-2] if len(steps) > 1 else 1.0
        enough = INCREMENT * min(1.0, abs(self.problem.h))
        if (
            step <= enough
            or (rate < 0.9 and step * rate / (1 - rate) <= enough)
            or (step <= ROUNDING and rate > 0.5 and len(steps) > 1)
        ):
            return "converged"
        if len(steps) >= _MOST:
            return "Newton's iterations ran out"
        self.problem.fresh = rate > self._slow and len(steps) > 1
        return None
