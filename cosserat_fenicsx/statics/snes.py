"""PETSc SNES on a `Problem`: full Newton steps, stopped on the increment and the residual together.

Residual norms alone converge falsely (slender rods have a round-off floor in |F| that grows with EA L^2/EI), and
PETSc's default line search cripples eq. (1); so the line search is `basic` and the test is this file's own.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from petsc4py import PETSc

from cosserat_fenicsx.algebra import linear
from cosserat_fenicsx.errors import NotConverged

#: Newton stops when the error that remains after a step, by its contraction, is below this (root mean square, units L, 1).
INCREMENT = 1e-11
_HUGE = 1e3
#: PETSc's code for an error in an external package: KLU met a singular tangent.
EXTERNAL = 76
_Reason = PETSc.SNES.ConvergedReason
#: Why SNES stopped.
WORDS = {
    _Reason.CONVERGED_SNORM_RELATIVE: "converged",
    _Reason.DIVERGED_MAX_IT: "Newton's iterations ran out",
    _Reason.DIVERGED_DTOL: "Newton's steps grew without bound",
    _Reason.DIVERGED_FNORM_NAN: "the residual is not a number",
    _Reason.DIVERGED_LINEAR_SOLVE: "the tangent is singular",
}


@dataclass(frozen=True)
class Solved:
    """Outcome of one Newton solve: whether it converged, its iterations, and why it stopped, in words."""

    converged: bool
    iterations: int
    reason: str


def take_full_steps(snes):
    """Newton's steps as they are: the line search `basic`, which petsc4py 3.18 cannot reach but by an option."""
    option, options = f"cosserat_{id(snes):x}_snes_linesearch_type", PETSc.Options()
    snes.setOptionsPrefix(option.removesuffix("snes_linesearch_type"))
    options[option] = "basic"
    snes.setFromOptions()
    options.delValue(option)


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
        self._prepare(snes.getKSP())
        take_full_steps(snes)

    def _start_over(self):
        """A new PC after an error in the middle of a solution: PETSc counts those it has begun and not ended, up to two."""
        pc = PETSc.PC().create(self.problem.A.comm)
        pc.setOperators(self.problem.A)
        self._factor(pc)
        self.snes.getKSP().setPC(pc)

    def _prepare(self, ksp):
        linear.solve_with_tangent(ksp, self.problem.model.tangent)
        self._factor(ksp.getPC())

    def _factor(self, pc):
        """What solves with the tangent."""
        linear.factor_tangent(pc, self.problem.A, self.problem.model.tangent)

    @cached_property
    def bordered(self):
        """Newton's method for the same problem with the load factor as one more unknown; made when first needed."""
        return BorderedNewton(self.problem)

    def allow(self, iterations):
        """Give up beyond this number of iterations."""
        self.max_iterations = iterations
        self.snes.setTolerances(max_it=iterations + 1)  # the test below is the one that stops

    def solve(self):
        """Newton from the problem's x (and carried fields) at the model's load factor; x and the state follow.

        Returns:
            Solved. Where it has not converged, x is no equilibrium, and the state may be elsewhere.
        """
        problem = self.problem
        self._steps = []
        if self._carries:
            self._before[:] = self._now
        try:
            self.snes.solve(None, problem.x)
            reason = self.snes.getConvergedReason()
        except PETSc.Error as problem_of_petsc:
            if problem_of_petsc.ierr != EXTERNAL:
                raise
            self._start_over()
            reason = _Reason.DIVERGED_LINEAR_SOLVE
        if reason > 0:  # the residual was asked for at x last: the state is there
            self._advance()
        return Solved(reason > 0, len(self._steps), WORDS.get(reason, f"PETSc's reason {reason}"))

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
        balanced = residual <= 1e-6 * (1 + abs(problem.load_factor) * problem.load_norm) + problem.model.round_off
        if balanced and (step <= INCREMENT or self._little_is_left()):
            return _Reason.CONVERGED_SNORM_RELATIVE
        if iteration >= self.max_iterations:
            return _Reason.DIVERGED_MAX_IT
        return _Reason.CONVERGED_ITERATING

    def _little_is_left(self):
        """Whether the error after the last step is below INCREMENT, if steps go on contracting as they did, c; or far below, if
        they contract as Newton's do, by c^2, of which only a tenth is counted on; and nothing on a slender rod, whose tangent
        rounding makes inexact for soft motions. Without a contact force of its own a rod's steps come in pairs, one that bends
        and one that takes back the stretch of it: c is that of pairs then, since a small step beat says nothing."""
        model = self.problem.model
        beat = 1 if model.carries_force else 2
        if len(self._steps) < 2 * beat:
            return False
        before, step = max(self._steps[-2 * beat : -beat]), max(self._steps[-beat:])
        c = step / before
        newton = 1.0 if model.shape.slender and model.carries_force else min(1.0, 100 * c)
        return c < 0.9 and step * c * newton <= INCREMENT * (1 - c)

    def _motion(self, step):
        """Size of a step's motion alone: contact forces and reactions have another scale, and rounding of their own."""
        if not self._others:
            return step
        moved = self.snes.getSolutionUpdate().array_r[: self._motions]
        return math.sqrt(self.problem.model.comm.allreduce(float(moved @ moved)))


class BorderedNewton(Newton):
    """Newton's method for (x, eta): equilibrium, and a plane <normal, x - x_0> + weight (eta - eta_0) = 0.

    SNES sees x alone. Where it solves with the tangent A, the bordered system is solved by block elimination (Keller,
    in: Applications of Bifurcation Theory, 1977, 359): with A d1 = R, A d2 = dR/deta the step is -(d1 + d2 deta), and
    the plane gives deta. The load factor is moved along, so that SNES's next residual and tangent are those of
    the new (x, eta). The products with `normal` are the model's, over all ranks, and so the load factor is one on all.

    Where a motion is neutral (a buckled round column may turn about its axis) the tangent is singular all along the path; no
    step is then taken along that motion, which the residual does not resist.
    """

    def _prepare(self, ksp):
        ksp.setType("preonly")
        self._factor(ksp.getPC())

    def _factor(self, pc):
        A, kind = self.problem.A, self.problem.model.tangent
        self._slope, self._free = A.createVecRight(), A.createVecRight()
        self._ksp = ksp = PETSc.KSP().create(A.comm)
        linear.solve_with_tangent(ksp, kind)
        linear.factor_tangent(ksp.getPC(), A, kind)
        ksp.setOperators(A)
        pc.setType("python")
        pc.setPythonContext(self)

    def aim(self, normal, weight, neutral=None):
        """Solve from now on in the plane through the problem's x and load factor.

        Args:
            normal: owned numbers of a change of the unknowns; None to hold the load factor.
            weight: of the load factor.
            neutral: owned numbers of a neutral motion, or None.
        """
        self._normal, self._weight, self.neutral = normal, weight, neutral
        self._x0, self._eta0 = self.problem.x.array_r.copy(), self.problem.load_factor

    def setUp(self, pc):
        """PETSc calls this when the tangent is new."""
        self._ksp.setOperators(*pc.getOperators())

    def apply(self, pc, residual, step):
        """PETSc calls this for the step, which it subtracts from x."""
        problem, inner = self.problem, self.problem.model.inner
        self._ksp.solve(residual, step)
        self._ksp.solve(problem.load_derivative(problem.x), self._slope)
        if self.neutral is not None:
            self._leave_out_neutral(step)
        if self._normal is None:
            return
        eta, normal = problem.load_factor, self._normal
        off = problem.x.array_r - self._x0 - step.array_r
        left = inner(normal, off) + self._weight * (eta - self._eta0)
        rise = inner(normal, self._slope.array_r) - self._weight
        change = left / rise if rise else math.inf
        step.axpy(change, self._slope)
        if math.isfinite(change):
            problem.set_load_factor(eta + change)

    def _leave_out_neutral(self, step):
        """Take the neutral motion out of the step and the slope, and bring it up to date by inverse iteration."""
        inner, motion = self.problem.model.inner, self.neutral
        force = self.problem.load_derivative(self.problem.x)
        force.array_w[:] = motion
        self._ksp.solve(force, self._free)
        free = self._free.array_r
        size = inner(motion, free)
        for vector in (step, self._slope):
            vector.axpy(-inner(motion, vector.array_r) / size, self._free)
        self.neutral = free / math.copysign(math.sqrt(inner(free, free)), size)

    @property
    def slope(self):
        """(owned numbers,) dx/d eta at the last step of the last solve."""
        return -self._slope.array_r

    def _factor_here(self):
        problem = self.problem
        problem.function(None, problem.x, problem.b)
        problem.jacobian(None, problem.x, problem.A, problem.A)
        self._ksp.setOperators(problem.A)

    def resistance(self, motion):
        """What the tangent at the problem's x and load factor resists a motion (owned numbers) with: 1/<motion, A^-1
        motion>, which changes its sign where the tangent becomes singular by that motion."""
        force = self.problem.load_derivative(self.problem.x)
        force.array_w[:] = motion
        if not self._solved_here(force, self._free):
            return 0.0  # singular to the last digit
        return 1 / self.problem.model.inner(motion, self._free.array_r)

    def _solved_here(self, force, motion):
        """motion = A^-1 force at the problem's x and load factor; False where A is singular."""
        self._factor_here()
        try:
            self._ksp.solve(force, motion)
        except PETSc.Error as found:  # KLU says it so, MUMPS by the reason
            if found.ierr != EXTERNAL:
                raise
            self._start_over()
            return False
        return self._ksp.getConvergedReason() >= 0 and math.isfinite(motion.norm())  # the factors by blocks do not say

    def slope_here(self, neutral=None):
        """(owned numbers,) dx/d eta at the problem's x and load factor, without the neutral motion.

        Raises:
            NotConverged: the tangent is singular.
        """
        problem = self.problem
        if not self._solved_here(problem.load_derivative(problem.x), self._slope):
            raise NotConverged(
                f"the tangent is singular at the load factor {problem.load_factor:.6g}: the path branches there, or something is not "
                "determined, such as the axial force of an inextensible rod between two supports"
            )
        self.neutral = neutral
        if neutral is not None:
            self._leave_out_neutral(self._slope)
        return self.slope
