"""PETSc SNES on a step in time: full Newton steps with a tangent that is kept while it serves.

Only the increments of the nodes' unknowns are tested: contact forces and reactions have rounding of their own, and the
residual of a stiff rod has a floor.
"""

import math

from petsc4py import PETSc

from cosserat_fenicsx import linear
from cosserat_fenicsx.snes import EXTERNAL, WORDS, Solved, take_full_steps

#: Newton stops when what remains after an increment, by its contraction, is below this (root mean square, units L, 1)
#: times h over the unit of time, for velocities, and with them momenta, are off by so much over h. Rounding may leave
#: more: where increments below the second number shrink no more, that is the end.
INCREMENT, ROUNDING = 1e-12, 1e-10
# A kept tangent is made anew where increments shrink by less than the first number, and after a step of more
# iterations than the second; the larger the system, the more iterations a tangent costs.
_SMALL_SYSTEM, _LARGE_SYSTEM, _LARGE = (0.05, 4), (0.3, 8), 400
_MOST, _HUGE = 15, 10.0
_Reason = PETSc.SNES.ConvergedReason


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
        self.snes = snes = PETSc.SNES().create(self._comm)
        snes.setType("newtonls")
        snes.setFunction(problem.function, problem.b)
        snes.setJacobian(problem.jacobian, problem.A)
        snes.setConvergenceTest(self._test)
        snes.setTolerances(max_it=_MOST + 1)
        ksp = snes.getKSP()
        ksp.setType("preonly")
        linear.factor_tangent(ksp.getPC(), problem.A)
        take_full_steps(snes)

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
        problem, self._steps = self.problem, []
        problem.guess(guess)
        try:
            self.snes.solve(None, problem.x)
            reason = self.snes.getConvergedReason()
        except PETSc.Error as found:
            if found.ierr != EXTERNAL:
                raise
            pc = PETSc.PC().create(problem.A.comm)  # PETSc counts solutions begun and not ended, up to two
            pc.setOperators(problem.A)
            linear.factor_tangent(pc, problem.A)
            self.snes.getKSP().setPC(pc)
            reason = _Reason.DIVERGED_LINEAR_SOLVE
        problem.set_state(problem.x)
        if reason <= 0 or len(self._steps) > self._many:
            problem.fresh = True
        return Solved(reason > 0, len(self._steps), WORDS.get(reason, "converged"))

    def _test(self, snes, iteration, norms):
        if not math.isfinite(norms[2]):
            return _Reason.DIVERGED_FNORM_NAN
        if iteration == 0:
            return _Reason.CONVERGED_ITERATING
        moved = snes.getSolutionUpdate().array_r[: self._motions]
        step = math.sqrt(self._comm.allreduce(float(moved @ moved))) / self._root
        self._steps.append(step)
        if not step < _HUGE:
            return _Reason.DIVERGED_DTOL
        rate = step / self._steps[-2] if iteration > 1 else 1.0
        enough = INCREMENT * min(1.0, abs(self.problem.h))
        if (
            step <= enough
            or (rate < 0.9 and step * rate / (1 - rate) <= enough)
            or (step <= ROUNDING and rate > 0.5 and iteration > 1)
        ):
            return _Reason.CONVERGED_SNORM_RELATIVE
        if iteration >= _MOST:
            return _Reason.DIVERGED_MAX_IT
        self.problem.fresh = rate > self._slow and iteration > 1
        return _Reason.CONVERGED_ITERATING
