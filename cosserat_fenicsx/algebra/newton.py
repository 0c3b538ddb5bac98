"""PETSc SNES on a `Problem`: full Newton steps, stopped on the increment and the residual together.

A test of the residual norm alone is unreliable (on slender rods the rounding error of |F| grows with EA L^2/EI), and
PETSc's default line search impairs convergence on eq. (1); so the line search is `basic` and the convergence test is
defined here.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from petsc4py import PETSc

from cosserat_fenicsx.algebra import linear
from cosserat_fenicsx.compat import RESIDUAL_NOT_A_NUMBER
from cosserat_fenicsx.errors import NotConverged

#: Newton stops when the increment, or the remaining error estimated from the contraction, is below this (root mean
#: square over the nodal unknowns, positions in units of L).
INCREMENT = 1e-11
_HUGE = 1e3
#: PETSc's code for an error in an external package: KLU found a singular tangent.
EXTERNAL = 76
_Reason = PETSc.SNES.ConvergedReason
#: Why SNES stopped.
WORDS = {
    _Reason.CONVERGED_SNORM_RELATIVE: "converged",
    _Reason.DIVERGED_MAX_IT: "Newton's iterations ran out",
    _Reason.DIVERGED_DTOL: "Newton's steps grew without bound",
    RESIDUAL_NOT_A_NUMBER: "the residual is not a number",
    _Reason.DIVERGED_LINEAR_SOLVE: "the tangent is singular",
}


@dataclass(frozen=True)
class Solved:
    """Outcome of one Newton solve: whether it converged, its iterations, and the reason it stopped, as text."""

    converged: bool
    iterations: int
    reason: str


def take_full_steps(snes):
    """Take full Newton steps: the line search `basic`, which petsc4py 3.18 can set only through an option."""
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
        motions = model.comm.allreduce(model.motion_in(problem.x.array_r).size)
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
        """Replace the PC after an error inside a solve: PETSc allows only two solves that did not end."""
        pc = PETSc.PC().create(self.problem.A.comm)
        pc.setOperators(self.problem.A)
        self._factor(pc)
        self.snes.getKSP().setPC(pc)

    def _prepare(self, ksp):
        linear.solve_with_tangent(ksp, self.problem.model.tangent)
        self._factor(ksp.getPC())

    def _factor(self, pc):
        """Set the factorisation of the tangent."""
        linear.factor_tangent(pc, self.problem.A, self.problem.model.tangent)

    @cached_property
    def bordered(self):
        """Newton's method for the same problem with the load factor as an additional unknown; made at first use."""
        return BorderedNewton(self.problem)

    def allow(self, iterations):
        """Set the largest number of iterations."""
        self.max_iterations = iterations
        self.snes.setTolerances(max_it=iterations + 1)  # `_test` stops before SNES's own limit

    def solve(self):
        """Newton from the problem's x (and carried fields) at the model's load factor; x and the state follow.

        Returns:
            Solved. If it has not converged, x is not an equilibrium, and the state may differ from x.
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
        if reason > 0:  # the residual was last evaluated at x, so the state agrees with it
            self._advance()
        return Solved(reason > 0, len(self._steps), WORDS.get(reason, f"PETSc's reason {reason}"))

    def _carry(self, snes, iteration):
        if iteration > 0:
            self._advance()

    def _advance(self):
        """Update the contact force carried at the Gauss points by the Newton step from `before` to the state."""
        if self._carries:
            np.subtract(self._now, self._before, out=self._step)
            self.problem.model.advance()
            self._before[:] = self._now

    def _test(self, snes, iteration, norms):
        _, step, residual = norms
        if not math.isfinite(residual):
            return RESIDUAL_NOT_A_NUMBER
        if iteration == 0:
            return _Reason.CONVERGED_ITERATING
        problem = self.problem
        step = self._motion(step) / self._root
        self._steps.append(step)
        if not step < _HUGE:
            return _Reason.DIVERGED_DTOL
        balanced = residual <= 1e-6 * (1 + abs(problem.load_factor) * problem.load_norm) + problem.model.round_off
        if balanced and (step <= INCREMENT or self._remaining_error_is_small()):
            return _Reason.CONVERGED_SNORM_RELATIVE
        if iteration >= self.max_iterations:
            return _Reason.DIVERGED_MAX_IT
        return _Reason.CONVERGED_ITERATING

    def _remaining_error_is_small(self):
        """Whether the estimated error after the last step is below INCREMENT.

        With the ratio c of the last two steps the error is step * c/(1 - c) for linear convergence. Where convergence
        is quadratic the next ratio is c^2 or less; the estimate is then multiplied by min(1, 100 c), with a margin.
        That factor is not used for slender rods whose contact force is carried or unknown: rounding makes their tangent
        inexact for motions of low stiffness. Where n follows from the motion alone, Newton steps alternate between
        bending and the correction of the stretch that this causes; c is then the ratio of successive pairs of steps,
        because one small step does not imply convergence.
        """
        model = self.problem.model
        period = 1 if model.carries_force else 2
        if len(self._steps) < 2 * period:
            return False
        before, step = max(self._steps[-2 * period : -period]), max(self._steps[-period:])
        c = step / before
        newton = 1.0 if model.signature.slender and model.carries_force else min(1.0, 100 * c)
        return c < 0.9 and step * c * newton <= INCREMENT * (1 - c)

    def _motion(self, step):
        """Norm of the part of a step that is motion: forces and multipliers differ in scale and in rounding error."""
        if not self._others:
            return step
        model = self.problem.model
        moved = model.motion_in(self.snes.getSolutionUpdate().array_r)
        return math.sqrt(model.comm.allreduce(float(moved @ moved)))


class BorderedNewton(Newton):
    """Newton's method for (x, eta): equilibrium, and a plane <normal, x - x_0> + weight (eta - eta_0) = 0.

    SNES solves for x alone. Where it applies the tangent's inverse, the bordered system is solved by block elimination
    (Keller, in: Applications of Bifurcation Theory, 1977, 359): with the tangent A, A d1 = R and A d2 = dR/deta the
    step is -(d1 + d2 deta), and the plane gives deta. The load factor is updated with x, so that SNES's next residual
    and tangent are those of the new (x, eta). Products with `normal` are the model's inner products over all ranks, so
    that all ranks have the same load factor.

    Where a motion is neutral (a buckled round column may rotate about its axis) the tangent is singular along the whole
    path; the component of each step along this null vector is removed.
    """

    def _prepare(self, ksp):
        ksp.setType("preonly")
        self._factor(ksp.getPC())

    def _factor(self, pc):
        A, kind = self.problem.A, self.problem.model.tangent
        self._slope, self._free, self._force = (A.createVecRight() for _ in range(3))
        self._ksp = ksp = PETSc.KSP().create(A.comm)
        linear.solve_with_tangent(ksp, kind)
        linear.factor_tangent(ksp.getPC(), A, kind)
        ksp.setOperators(A)
        pc.setType("python")
        pc.setPythonContext(self)

    def stay_in_plane(self, normal, weight, neutral=None):
        """Solve from now on in the plane through the problem's x and load factor.

        Args:
            normal: (owned unknowns,) normal of the plane; None to keep the load factor fixed.
            weight: of the load factor.
            neutral: (owned unknowns,) a neutral motion, or None.
        """
        self._normal, self._weight, self.neutral = normal, weight, neutral
        self._x0, self._eta0 = self.problem.x.array_r.copy(), self.problem.load_factor

    def setUp(self, pc):
        """PETSc calls this when the tangent is new."""
        self._ksp.setOperators(*pc.getOperators())

    def apply(self, pc, residual, step):
        """PETSc calls this to compute the step, which it subtracts from x."""
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
        """Remove the neutral motion from the step and from dx/d eta, and update it by inverse iteration."""
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
        """(owned unknowns,) dx/d eta at the last step of the last solve."""
        return -self._slope.array_r

    def _factor_here(self):
        problem = self.problem
        problem.function(None, problem.x, problem.b)
        problem.jacobian(None, problem.x, problem.A, problem.A)
        self._ksp.setOperators(problem.A)

    def motion_of(self, change):
        """(nodes, 6) displacements and inertial rotations of this rank's nodes for a change of the unknowns (owned
        unknowns,) at the problem's x, normalised to unit norm over all ranks."""
        displacements, _ = self._tie_maps()
        motion = (displacements @ self._by_nodes(change)[..., None])[..., 0]
        return motion / math.sqrt(self.work(motion, motion) or 1.0)

    def response(self, motion):
        """The linear response at the problem's x and load factor to nodal forces proportional to a motion.

        Args:
            motion: v, (nodes, 6), see `motion_of`.

        Returns:
            (1/(v S^-1 v), S^-1 v of unit norm) with S the tangent in displacements and rotations, with the true
            stiffnesses. The first is an eigenvalue where v is an eigenvector, and changes sign through zero where the
            tangent becomes singular with a null vector not orthogonal to v. (0.0, v) where the tangent is singular to
            rounding.
        """
        displacements, rows = self._tie_maps()
        self._force.set(0.0)
        self._by_nodes(self._force.array_w)[:] = (rows @ motion[..., None])[..., 0]
        if not self._solved_here(self._force, self._free):
            return 0.0, motion
        moved = (displacements @ self._by_nodes(self._free.array_r)[..., None])[..., 0]
        work, size = self.work(motion, moved), math.sqrt(self.work(moved, moved))
        return (1 / work if work else math.inf), moved / (size or 1.0)

    def _tie_maps(self):
        return self.problem.model.tie_maps(self._by_nodes(self.problem.x.array_r))

    def _by_nodes(self, numbers):
        numbering = self.problem.model.numbering
        return numbers[: numbering.nodes * numbering.block].reshape(-1, numbering.block)

    def work(self, a, b):
        """Inner product of two motions of the nodes, over all ranks."""
        return self.problem.model.comm.allreduce(float(np.vdot(a, b)))

    def _solved_here(self, force, motion):
        """motion = A^-1 force at the problem's x and load factor; False where A is singular."""
        self._factor_here()
        try:
            self._ksp.solve(force, motion)
        except PETSc.Error as found:  # KLU reports a singular matrix by this error, MUMPS by the reason
            if found.ierr != EXTERNAL:
                raise
            self._start_over()
            return False
        # block factors report a singular matrix neither way, so the norm is tested too
        return self._ksp.getConvergedReason() >= 0 and math.isfinite(motion.norm())

    def slope_here(self, neutral=None):
        """(owned unknowns,) dx/d eta at the problem's x and load factor, without the neutral motion.

        Raises:
            NotConverged: the tangent is singular.
        """
        problem = self.problem
        if not self._solved_here(problem.load_derivative(problem.x), self._slope):
            raise NotConverged(
                f"the tangent is singular at the load factor {problem.load_factor:.6g}: the path branches there, "
                "or something is not determined, such as the axial force of an inextensible rod between two supports"
            )
        self.neutral = neutral
        if neutral is not None:
            self._leave_out_neutral(self._slope)
        return self.slope
