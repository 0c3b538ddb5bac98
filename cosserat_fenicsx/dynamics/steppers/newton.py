"""Newton's method for a step in time: full steps with a tangent that is kept while it serves, over many steps of time.

An iteration with a kept tangent is one residual and one back-substitution, a tenth of one with a fresh tangent on a fine
mesh. PETSc's SNES would ask for one more residual a step, and for norms that are not looked at. (Broyden's updates of
the kept tangent were tried: as many iterations, and dearer ones.)

Only the increments of the nodes' unknowns are tested: contact forces and reactions have rounding of their own, and the
residual of a stiff rod has a floor.
"""

import math

from petsc4py import PETSc

from cosserat_fenicsx.algebra import linear
from cosserat_fenicsx.statics.snes import EXTERNAL, Solved

#: Newton stops when what remains after an increment, by its contraction, is below the first number times the motion in the
#: step (root mean square, units L, 1), for velocities, and with them momenta, are off by so much; or below the second,
#: the rounding of positions. A stiff rod's may be larger: where increments below the third shrink no more, that is the end.
INCREMENT, SMALLEST, ROUNDING = 1e-12, 2e-16, 1e-10
# What increments shrink by with a fresh tangent.
_FRESH = 3e-4
# For so many steps each begins with a fresh tangent after one that did not outlive its step.
_ANEW = 8
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
        self._price = motions / (50 + 0.055 * motions)  # of a tangent, in iterations, as measured
        self._step = numbering.vector()
        self._make_ksp()
        self.forget()

    def forget(self):
        """Go on as if nothing had been solved so far: with a fresh tangent, and without what was learnt of kept ones."""
        self.problem.fresh = True
        self._spent = self._served = self._anew = 0

    def _make_ksp(self):
        self._ksp = ksp = PETSc.KSP().create(self._comm)
        ksp.setType("preonly")  # Newton's iterations bring back the digits that a factorisation loses
        ksp.setOperators(self.problem.A)
        linear.factor_tangent(ksp.getPC(), self.problem.A, self.problem.tangent)

    def solve(self, guesses):
        """Newton from local numbers of the state, with the tangent at hand, and with a fresh one where that fails, also from the
        other guesses: sections that turn far in a step are hard to foretell.

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
            problem.function(None, problem.x, problem.b)
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
        if self._served == 1 and lived == 1 and not began_fresh:  # the tangent did not outlive its step
            self._anew = _ANEW
        # anew, too, where this step cost more than the average so far
        problem.fresh = not converged or self._anew > 0 or len(steps) * self._served > self._spent
        self._anew -= problem.fresh and self._anew > 0
        return Solved(converged, len(steps), found)

    def _size(self, moved):
        square = float(moved @ moved)
        return math.sqrt(self._comm.allreduce(square) if self._comm.size > 1 else square) / self._root

    def _solve(self):
        """The increment for the residual; False where the tangent is singular."""
        problem, ksp = self.problem, self._ksp
        if problem.fresh:
            problem.jacobian(None, problem.x, problem.A, problem.A)
            ksp.setOperators(problem.A)
            self._spent, self._served = self._price, 0
        try:
            ksp.solve(problem.b, self._step)
        except PETSc.Error as error:  # PETSc counts solutions begun and not ended, up to two
            if error.ierr != EXTERNAL:
                raise
            self._make_ksp()
            return False
        return ksp.getConvergedReason() >= 0

    def _outcome(self, steps):
        """Why Newton stops after the last increment, in words; None where it goes on."""
        step = self._size(self._step.array_r[: self._motions])
        steps.append(step)
        if not math.isfinite(step):
            return "the residual is not a number"
        if step > _HUGE:
            return "Newton's steps grew without bound"
        rate = step / steps[-2] if len(steps) > 1 else 1.0
        if (
            step <= self._enough
            or (rate < 0.9 and step * rate / (1 - rate) <= self._enough)
            or (step <= ROUNDING and rate > 0.5 and len(steps) > 1)
        ):
            return "converged"
        if len(steps) >= _MOST:
            return "Newton's iterations ran out"
        if len(steps) > 1:
            left = math.log(self._enough / step)
            self.problem.fresh = rate > 0.9 or left / math.log(rate) > self._price + left / math.log(_FRESH)
        return None

    def memory(self):
        """What decides when the kept tangent is made anew, see `Stepper.memory`."""
        return {"spent": self._spent, "served": self._served, "anew": self._anew}

    def recall(self, memory):
        """Take back what `memory` gave."""
        self._spent, self._served, self._anew = memory["spent"], memory["served"], memory["anew"]
