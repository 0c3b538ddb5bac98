"""Newton's method on a `Problem`: PETSc's SNES with full steps, stopped on the increment and the residual together.

A test of the residual norm alone is unreliable (on slender rods the rounding error of |F| grows with EA L^2/EI), and
PETSc's default line search impairs convergence on eq. (1); so the line search is `basic` and the convergence test is
that of newton.c, which takes the same steps without SNES in sweeps over load factors. `LimitedNewton` takes single
steps of limited length, for states far from the solution.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from cosserat_fenicsx.algebra.building import Pointers
from cosserat_fenicsx.algebra.elimination import ZERO_PIVOT
from cosserat_fenicsx.errors import NotConverged

#: Newton stops when the increment, or the remaining error estimated from the contraction, is below this (root mean
#: square over the nodal unknowns, positions in units of L).
INCREMENT = 1e-11
# Inverse iterations for the motions that are resisted least.
_INVERSE = 30
_Reason = PETSc.SNES.ConvergedReason
# SNES's reasons for the verdicts in chain.h.
_REASONS = (
    _Reason.CONVERGED_ITERATING, _Reason.CONVERGED_SNORM_RELATIVE, _Reason.DIVERGED_LINEAR_SOLVE,
    _Reason.DIVERGED_DTOL, _Reason.DIVERGED_DTOL, _Reason.DIVERGED_MAX_IT,
)  # fmt: skip
#: The verdicts in words, of SNES and of time steps.
WORDS = (
    "", "converged", "the tangent is singular", "the residual is not a number", "Newton's steps grew without bound",
    "Newton's iterations ran out",
)  # fmt: skip


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


class Newton(Pointers):
    """Newton's method for one problem, by SNES.

    Args:
        problem: a `Problem`.
    """

    def __init__(self, problem):
        super().__init__()
        self.problem = problem
        model, numbering, comm = problem.model, problem.numbering, problem.model.comm
        self.c = newton = self._ffi.new("newton *")
        newton.problem, newton.nodes, newton.block = problem.c, numbering.nodes, numbering.block
        newton.motion = numbering.block - model.multipliers
        newton.root = math.sqrt(comm.allreduce(numbering.nodes * newton.motion))
        newton.increment, newton.period = INCREMENT, 1 if model.carries_force else 2
        newton.contracts = not (model.signature.slender and model.carries_force)
        self._step = numbering.vector()
        newton.b, newton.change = (self.doubles(vector.array_w) for vector in (problem.b, self._step))
        self.snes = snes = PETSc.SNES().create(comm)
        snes.setType("newtonls")
        matrix = PETSc.Mat().create(comm)  # SNES wants one; only its inverse is ever applied
        matrix.setSizes(((numbering.size, numbering.total),) * 2)
        matrix.setType("shell")
        matrix.setUp()
        snes.setFunction(self._residual, problem.b)
        snes.setJacobian(self._tangent, matrix)
        snes.setConvergenceTest(self._judge)
        snes.getKSP().setType("preonly")
        pc = snes.getKSP().getPC()
        pc.setType("python")
        pc.setPythonContext(self)
        take_full_steps(snes)

    def _residual(self, snes, x, b):
        self.problem.function(x, b)

    def _tangent(self, snes, x, matrix, _):
        if self.c.iterations > 0:
            self.problem.advance()
        self.c.keeps = 0  # paths of arc length ask for the tangent at the last step
        self.problem.factor()

    def _judge(self, snes, iterations, norms):
        """PETSc calls this after every evaluation of the residual."""
        failed = self._lib.judge_residual(self.c, self.c.b, self.c.change if iterations else self._ffi.NULL)
        self.problem._done(failed)
        return _REASONS[self.c.verdict]

    def apply(self, pc, residual, step):
        """PETSc calls this to compute the step, which it subtracts from x."""
        by_load = self._direction()
        if self.problem.tensions:
            self.problem.tensions.take(by_load=by_load)
        step.array_w[:] = self._step.array_r

    def _direction(self):
        """Find the step; returns the change of the load factor in it."""
        with self.problem.corrected():
            self.problem.solve(self.problem.b, self._step)
        return 0.0

    @cached_property
    def bordered(self):
        """Newton's method for the same problem with the load factor as an additional unknown; made at first use."""
        return BorderedNewton(self.problem)

    def allow(self, iterations):
        """Set the largest number of iterations."""
        if iterations != self.c.most:
            self.c.most = iterations
            self.snes.setTolerances(max_it=iterations + 1)  # newton.c stops before SNES's own limit

    def _take_loads(self):
        """Set the limits of the residual's norm."""
        problem = self.problem
        self.c.loads, self.c.rounding = abs(problem.load_factor) * problem.load_norm, problem.model.round_off

    def solve(self):
        """Newton from the problem's x (and carried fields) at the model's load factor; x and the state follow.

        Returns:
            Solved. If it has not converged, x is not an equilibrium, and the state may differ from x.
        """
        problem, newton = self.problem, self.c
        self._take_loads()
        self._lib.begin_newton(newton)
        self.snes.solve(None, problem.x)
        verdict = newton.verdict
        if verdict == self._lib.CONVERGED:  # the residual was last evaluated at x, so the state agrees with it
            problem.advance()
        elif problem.c.singular:
            verdict = self._lib.SINGULAR
        elif verdict == self._lib.ITERATING:  # PETSc stops by itself where the residual is not a number
            verdict = self._lib.NOT_A_NUMBER
        return Solved(verdict == self._lib.CONVERGED, newton.iterations, WORDS[verdict])


class BorderedNewton(Newton):
    """Newton's method for (x, eta): equilibrium, and a plane <normal, x - x_0> + weight (eta - eta_0) = 0.

    SNES solves for x alone. Where it applies the tangent's inverse, the bordered system is solved by block elimination
    (Keller, in: Applications of Bifurcation Theory, 1977, 359): with the tangent A, A d1 = R and A d2 = dR/deta the
    step is -(d1 + d2 deta), and the plane gives deta. The load factor eta is updated with x, so that SNES's next
    residual and tangent are those of the new (x, eta). Products with `normal` are the model's inner products over all
    ranks, so that all ranks have the same load factor.

    Where a motion is neutral (a buckled round column may rotate about its axis) the tangent is singular along the whole
    path; the component of each step along this null vector is removed.
    """

    def __init__(self, problem):
        super().__init__(problem)
        self.neutral = None
        self._slope, self._free, self._force = (problem.numbering.vector() for _ in range(3))

    @property
    def neutral(self):
        """(owned unknowns,) the neutral motion, or None; the tangent is then singular to rounding, yet solved."""
        return self._neutral

    @neutral.setter
    def neutral(self, motion):
        self._neutral = motion
        self.problem.elimination.c.zero_pivot = ZERO_PIVOT if motion is None else 0.0

    def stay_in_plane(self, normal, weight, neutral=None):
        """Solve from now on in the plane through the problem's x and load factor, of a normal (owned unknowns,), None
        to keep the load factor fixed, and the load factor's weight; neutral: (owned unknowns,) a neutral motion, or
        None."""
        self._normal, self._weight, self.neutral = normal, weight, neutral
        self._x0, self._load_factor0 = self.problem.x.array_r.copy(), self.problem.load_factor

    def _direction(self):
        problem, inner, step = self.problem, self.problem.model.inner, self._step
        problem.solve(problem.b, step)
        problem.solve(problem.load_derivative(problem.x), self._slope)
        if self.neutral is not None:
            self._leave_out_neutral(step)
        if self._normal is None:
            return 0.0
        load_factor, normal = problem.load_factor, self._normal
        off = problem.x.array_r - self._x0 - step.array_r
        left = inner(normal, off) + self._weight * (load_factor - self._load_factor0)
        rise = inner(normal, self._slope.array_r) - self._weight
        change = left / rise if rise else math.inf
        step.axpy(change, self._slope)
        if math.isfinite(change):
            problem.set_load_factor(load_factor + change)
            self._take_loads()
        return change

    def _leave_out_neutral(self, step):
        """Remove the neutral motion from the step and from dx/d load_factor, and update it by inverse iteration."""
        inner, motion = self.problem.model.inner, self.neutral
        self._force.array_w[:] = motion
        self.problem.solve(self._force, self._free)
        free = self._free.array_r
        size = inner(motion, free)
        for vector in (step, self._slope):
            vector.axpy(-inner(motion, vector.array_r) / size, self._free)
        self.neutral = free / math.copysign(math.sqrt(inner(free, free)), size)

    @property
    def slope(self):
        """(owned unknowns,) dx/d load_factor at the last step of the last solve."""
        return -self._slope.array_r

    def motion_of(self, change):
        """(nodes, 6) displacements and inertial rotations of this rank's nodes for a change of the unknowns (owned
        unknowns,) at the problem's x, normalised to unit norm over all ranks."""
        displacements, _ = self._tie_maps()
        motion = (displacements @ self._by_nodes(change)[..., None])[..., 0]
        return motion / math.sqrt(self.work(motion, motion) or 1.0)

    def response(self, motion):
        """The linear response at the problem's x and load factor to nodal forces proportional to a motion v (nodes, 6),
        see `motion_of`: (1/(v S^-1 v), S^-1 v of unit norm) with S the tangent in displacements and rotations, with the
        true stiffnesses; (0.0, v) where it is exactly singular. The first is an eigenvalue where v is an eigenvector,
        and changes sign through zero where the tangent becomes singular with a null vector not orthogonal to v."""
        displacements, rows = self._tie_maps()
        self._force.set(0.0)
        self._by_nodes(self._force.array_w)[:] = (rows @ motion[..., None])[..., 0]
        # where the tangent is singular to rounding, the response is the null vector
        if not self._solved_here(self._force, self._free, zero_pivot=0.0):
            return 0.0, motion
        moved = (displacements @ self._by_nodes(self._free.array_r)[..., None])[..., 0]
        work, size = self.work(motion, moved), math.sqrt(self.work(moved, moved))
        return (1 / work if work else math.inf), moved / (size or 1.0)

    def softest(self, count):
        """The changes of the unknowns (owned entries) of the `count` motions that the tangent at the problem's x and
        load factor resists least, by inverse iteration."""
        numbers, nodes = np.random.default_rng(self.problem.model.comm.rank), self.problem.model.numbering.nodes
        motions, changes = list(numbers.standard_normal((count, nodes, 6))), [None] * count
        for _ in range(_INVERSE):
            for i in range(count):
                _, motion = self.response(motions[i])
                change = self._free.array_r.copy()
                for other, by in zip(motions[:i], changes[:i], strict=True):
                    share = self.work(motion, other)
                    motion, change = motion - share * other, change - share * by
                size = math.sqrt(self.work(motion, motion))
                motions[i], changes[i] = motion / size, change / size
        return changes

    def _tie_maps(self):
        return self.problem.model.tie_maps(self._by_nodes(self.problem.x.array_r))

    def _by_nodes(self, numbers):
        numbering = self.problem.model.numbering
        return numbers[: numbering.nodes * numbering.block].reshape(-1, numbering.block)

    def work(self, a, b):
        """Inner product of two motions of the nodes, over all ranks."""
        return self.problem.model.comm.allreduce(float(np.vdot(a, b)))

    def _solved_here(self, force, motion, zero_pivot=None):
        """motion = A^-1 force at the problem's x and load factor; False where A is singular."""
        problem, chain = self.problem, self.problem.elimination.c
        before = chain.zero_pivot
        chain.zero_pivot = before if zero_pivot is None else zero_pivot
        problem.function(problem.x, problem.b)
        problem.factor()
        chain.zero_pivot = before
        return problem.solve(force, motion) and math.isfinite(motion.norm())

    def slope_here(self, neutral=None):
        """(owned unknowns,) dx/d load_factor here; NotConverged where the tangent is singular."""
        problem, self.neutral = self.problem, neutral
        if not self._solved_here(problem.load_derivative(problem.x), self._slope):
            raise NotConverged(
                f"the tangent is singular at the load factor {problem.load_factor:.6g}: the path branches there, "
                "or something is not determined, such as the axial force of an inextensible rod between two supports"
            )
        if neutral is not None:
            self._leave_out_neutral(self._slope)
        return self.slope


# Factor on the zero pivot beside a stiff wall, where pivots of a slender rod are small.
_SMALLER = 1e-2


@dataclass(frozen=True)
class Step:
    """A Newton step: its largest displacement (in the model's unit of length) and rotation (rad) of a node before it
    was limited, and the share of it that was taken."""

    moved: float
    turned: float
    share: float


class LimitedNewton:
    """Newton steps of limited length, from the state of a `Problem`, for states far from the solution, such as a rod
    pressed against a wall; longest, widest: displacement of a node in a step, in the model's unit of length, and its
    rotation, rad; before_step: called before every `step`.

    The contact force that is carried at the Gauss points takes the same share of its step as the motion. A tangent that
    is singular to rounding is used nevertheless, because pivots of a slender rod beside a stiff wall are as small; the
    caller must check the result by its balance.
    """

    def __init__(self, problem, longest, widest, before_step=None):
        self._problem, self._longest, self._widest, self.iterations = problem, longest, widest, 0
        self._before_step = before_step
        self._change = problem.numbering.vector()
        self._carried = [function.x.array for function in problem.model.carried]

    def step(self, share=1.0):
        """Take one step, or a share of it; None where the tangent is singular or the residual is not a number."""
        if self._before_step:
            self._before_step()
        self._residual()
        self._factor()
        return self.take(share) if self._direction() else None

    def _direction(self):
        """Find the change that a full step subtracts from the unknowns; False where the tangent is singular."""
        return self._problem.solve(self._problem.b, self._change)

    def take(self, share=1.0):
        """Take a share of the last change; None where that is not a number."""
        problem, x = self._problem, self._problem.x
        moved, turned = problem.model.sizes(self._change.array_r)
        if not math.isfinite(moved + turned):
            return None
        share = min(share, self._longest / moved if moved else 1.0, self._widest / turned if turned else 1.0)
        before = [carried.copy() for carried in self._carried]
        problem.model.before.x.array[:] = problem.model.state.x.array
        x.axpy(-1.0, self._change)
        problem.set_state(x)
        problem.advance()
        if problem.tensions:
            problem.tensions.take(share)
        if share < 1.0:
            for carried, old in zip(self._carried, before, strict=True):
                carried[:] = old + share * (carried - old)
            x.axpy(1.0 - share, self._change)
            problem.set_state(x)
        self.iterations += 1
        return Step(moved, turned, share)

    def imbalance(self):
        """The largest residual force of a node at the state, in the model's unit of force."""
        model = self._problem.model
        self._residual()
        local = np.abs(model.motion_in(self._problem.b.array_r)[:, : model.moves]).max(initial=0.0)
        return float(model.comm.allreduce(local, op=MPI.MAX)) if model.comm.size > 1 else float(local)

    def _factor(self):
        """Factors of the tangent; where it is singular to rounding, with smaller pivots."""
        problem, chain = self._problem, self._problem.elimination.c
        problem.factor()
        if problem.c.singular:
            usual, chain.zero_pivot = chain.zero_pivot, _SMALLER * chain.zero_pivot
            problem.factor()
            chain.zero_pivot = usual

    def _residual(self):
        self._problem.function(self._problem.x, self._problem.b)
