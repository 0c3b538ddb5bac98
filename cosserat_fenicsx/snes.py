"""PETSc SNES on a `Problem`: full Newton steps, stopped on the increment and the residual together.

Residual norms alone converge falsely (slender rods have a round-off floor in |F| that grows with EA L^2/EI), and
PETSc's default line search cripples eq. (1); so the line search is `basic` and the test is this file's own.
"""

import math
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from cosserat_fenicsx import linear

#: Newton stops when the error that remains after a step, by its contraction, is below this (root mean square, units L, 1).
INCREMENT = 1e-11
_HUGE = 1e3
# PETSc's code for an error in an external package: KLU met a singular tangent.
_EXTERNAL = 76
_Reason = PETSc.SNES.ConvergedReason


@dataclass(frozen=True)
class Solved:
    """Outcome of one Newton solve: whether it converged, its iterations, and why it stopped, in words."""

    converged: bool
    iterations: int
    reason: str


class Newton:
    """Newton's method for one problem.

    Args:
        problem: a `Problem`.
    """

    def __init__(self, problem):
        self.problem = problem
        model = problem.model
        numbering = model.numbering
        self._motions = numbering.nodes * numbering.block
        motions = model.comm.allreduce(self._motions)
        self._others, self._root = motions < model.unknowns, math.sqrt(motions)
        self._carries = bool(model.carried)
        self._now, self._before, self._step = (f.x.array for f in (model.state, model.before, model.step))
        self.snes = snes = PETSc.SNES().create(model.comm)
        snes.setType("newtonls")
        snes.setFunction(problem.function, problem.b)
        snes.setJacobian(problem.jacobian, problem.A)
        if self._carries:
            snes.setUpdate(self._carry)
        snes.setConvergenceTest(self._test)
        ksp = snes.getKSP()
        ksp.setType("preonly")
        linear.factor_tangent(ksp.getPC(), problem.A, model.tangent)
        # petsc4py 3.18 cannot reach the line search but by an option.
        option, options = f"cosserat_{id(self):x}_snes_linesearch_type", PETSc.Options()
        snes.setOptionsPrefix(option.removesuffix("snes_linesearch_type"))
        options[option] = "basic"
        snes.setFromOptions()
        options.delValue(option)

    def allow(self, iterations):
        """Give up beyond this number of iterations."""
        self.max_iterations = iterations
        self.snes.setTolerances(max_it=iterations + 1)  # the test below is the one that stops

    def solve(self):
        """Newton from the problem's x (and carried fields) at the model's load factor; x and the state follow.

        Returns:
            Solved. Where it has not converged, x is no equilibrium.
        """
        problem = self.problem
        self._steps = []
        x = problem.x
        problem.set_state(x)
        self._before[:] = self._now
        try:
            self.snes.solve(None, x)
            reason = self.snes.getConvergedReason()
        except PETSc.Error as problem_of_petsc:
            if problem_of_petsc.ierr != _EXTERNAL:
                raise
            reason = _Reason.DIVERGED_LINEAR_SOLVE
        problem.set_state(x)
        if reason > 0:
            self._advance()
        return Solved(reason > 0, len(self._steps), _WORDS.get(reason, f"PETSc's reason {reason}"))

    def _carry(self, snes, iteration):
        if iteration > 0:
            self._advance()

    def _advance(self):
        """Carry n over the step from `before` to the state."""
        if self._carries:
            np.subtract(self._now, self._before, out=self._step)
            self.problem.model.advance()
            self._before[:] = self._now

    def _test(self, snes, iteration, norms):
        _, step, residual = norms
        if not math.isfinite(residual):
            return _Reason.DIVERGED_FNORM_NAN
        if iteration == 0:
            return _Reason.CONVERGED_ITERATING
        problem = self.problem
        step = self._motion(step) / self._root
        self._steps.append(step)
        if not step < _HUGE:
            return _Reason.DIVERGED_DTOL
        contraction = step / self._steps[-2] if iteration > 1 else 1.0
        remaining = step * contraction / (1 - contraction) if contraction < 0.9 else step
        balanced = residual <= 1e-6 * (1 + abs(problem.load_factor) * problem.load_norm) + problem.model.round_off
        if balanced and (remaining <= INCREMENT or step <= INCREMENT):
            return _Reason.CONVERGED_SNORM_RELATIVE
        if iteration >= self.max_iterations:
            return _Reason.DIVERGED_MAX_IT
        return _Reason.CONVERGED_ITERATING

    def _motion(self, step):
        """Size of a step's motion alone: contact forces and reactions have another scale, and rounding of their own."""
        if not self._others:
            return step
        moved = self.snes.getSolutionUpdate().array_r[: self._motions]
        return math.sqrt(self.problem.model.comm.allreduce(float(moved @ moved)))


_WORDS = {
    _Reason.CONVERGED_SNORM_RELATIVE: "converged",
    _Reason.DIVERGED_MAX_IT: "Newton's iterations ran out",
    _Reason.DIVERGED_DTOL: "Newton's steps grew without bound",
    _Reason.DIVERGED_FNORM_NAN: "the residual is not a number",
    _Reason.DIVERGED_LINEAR_SOLVE: "the tangent is singular",
}
