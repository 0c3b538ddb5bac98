"""Newton's method by hand on dolfinx and PETSc with this package's forms, with one common choice at a time that the
package avoids.

As in a short script: assemble, fix the clamp's rows, solve by PETSc's SNES. The rows may be scaled to N and N m first.
"""

from contextlib import ExitStack
from types import SimpleNamespace

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import equilibrium
from cosserat_fenicsx.forms import spatial as eq
from cosserat_fenicsx.models.rod_data import as_matrix, law_of
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.statics.problem import solvers_of
from trials import problems
from trials.cells import NO_ROTATION, Answer, Method, NotForIt, Stopped
from trials.own import against_steps

_CLAMPED = (0, 1, 2, 3, 4, 5, 6)


class Loop:
    """SNES on a clamped rod's forms; predict: start from the secant through the last two states; weak: see
    `weakly_unit`; held: components of the clamped node that are fixed, in the order r, q; line_search: PETSc's name,
    None for its default; solver: for LU: "klu", or "petsc", which does not pivot; relative: tolerance on the residual,
    None to stop on the increment, by 1e-11; in_si: whether the rows of the residual are in N, N m and m."""

    def __init__(self, problem, *, held=_CLAMPED, line_search="basic", solver="klu", relative=None, in_si=False,
                 formulation="displacement", degree=2, points=None, elements=8, predict=False, weak=False):  # fmt: skip
        _, scene = problems.scene_of(problem)
        layout = Layout.of(scene, elements)
        self._lease = ExitStack()  # never closed: the problem is not returned to the pool
        lent = solvers_of(scene, layout, formulation=formulation, degree=degree, points=points)
        loaded, _, _ = self._lease.enter_context(lent)
        self.problem, self.model = problem, loaded.model
        self.forms = weakly_unit(self.model) if weak else self.model.forms
        forms, nodal, slots = self.model.forms, self.model.nodal, self.model.slots
        (clamp,), (self._tip,) = nodal[slots == 0], nodal[slots == slots.max(), :3]
        self.held = clamp[list(held)].astype(np.int32)
        self.A, self.b = fem_petsc.create_matrix(forms.tangent[0]), fem_petsc.assemble_vector(forms.residual[0])
        self.dead = self.b.duplicate()
        for form in forms.dead:
            fem_petsc.assemble_vector(self.dead, form)
        self.x = self.A.createVecRight()
        self.x.array_w[:] = self._at_rest = self.model.state.x.array.copy()
        scales = self.model.scales
        self.rows = np.ones(len(self._at_rest))
        if in_si:
            for components, unit in (((0, 1, 2), scales.force), ((3,), scales.length), ((4, 5, 6), scales.moment)):
                self.rows[nodal[:, components]] = unit
        self.known, self.predict = [(0.0, self._at_rest)], predict
        self.snes = self._solver(line_search, solver, relative)

    def _solver(self, line_search, solver, relative):
        snes = PETSc.SNES().create(self.A.comm)
        snes.setFunction(self._function, self.b)
        snes.setJacobian(self._jacobian, self.A)
        ksp = snes.getKSP()
        ksp.setType("preonly")
        ksp.getPC().setType("lu")
        ksp.getPC().setFactorSolverType(solver)
        prefix, options = f"bare_{id(self):x}_", PETSc.Options()
        snes.setOptionsPrefix(prefix)
        wanted = {"snes_divergence_tolerance": 1e30, **({"snes_linesearch_type": line_search} if line_search else {})}
        for name, value in wanted.items():
            options[prefix + name] = value
        snes.setFromOptions()
        for name in wanted:
            options.delValue(prefix + name)
        if relative is None:
            snes.setTolerances(rtol=0, atol=0, stol=0, max_it=60)
            snes.setConvergenceTest(self._test)
        else:
            snes.setTolerances(rtol=relative, atol=0, stol=0, max_it=60)
        return snes

    def _function(self, snes, x, b):
        self.model.state.x.array[:] = x.array_r
        with b.localForm() as numbers:
            numbers.set(0.0)
        for form in self.forms.residual:
            fem_petsc.assemble_vector(b, form)
        b.axpy(-self.eta, self.dead)
        b.array_w[:] *= self.rows
        b.array_w[self.held] = x.array_r[self.held] - self._at_rest[self.held]

    def _jacobian(self, snes, x, A, P):
        P.zeroEntries()
        for form in self.forms.tangent:
            fem_petsc.assemble_matrix(P, form)
        P.assemble()
        rows = P.createVecLeft()
        rows.array_w[:] = self.rows
        P.diagonalScale(rows)
        P.zeroRows(self.held, 1.0)

    def _test(self, snes, iteration, norms):
        _, step, residual = norms
        reason = PETSc.SNES.ConvergedReason
        if not np.isfinite(residual):
            return compat.RESIDUAL_NOT_A_NUMBER
        if iteration and step <= 1e-11 * np.sqrt(len(self._at_rest)):
            return reason.CONVERGED_SNORM_RELATIVE
        return reason.DIVERGED_MAX_IT if iteration >= 60 else reason.CONVERGED_ITERATING

    def to(self, eta):
        """Newton's method from the current state to a load factor; the tip's displacement, (3,) m, or Stopped."""
        self.eta = eta
        self.known.append(None)
        if self.predict and len(self.known) > 2:
            (a, xa), (b, xb) = self.known[-3:-1]
            self.x.array_w[:] = xb + (eta - b) / (b - a) * (xb - xa)
        try:
            self.snes.solve(None, self.x)
            reason = self.snes.getConvergedReason()
        except PETSc.Error as error:
            raise Stopped(f"PETSc's error {error.ierr}") from None
        if reason < 0:
            raise Stopped(f"SNES: reason {reason} after {self.snes.getIterationNumber()} iterations", 0.0)
        self.known[-1] = (eta, self.x.array_r.copy())
        moved = self.x.array_r[self._tip] - self._at_rest[self._tip]
        return moved * self.problem["length"]

    def off_rotation(self):
        """| |q| - 1 | at the clamp."""
        (clamp,) = self.model.nodal[self.model.slots == 0]
        return float(abs(np.linalg.norm(self.x.array_r[clamp[3:7]]) - 1))


def weakly_unit(model):
    """Residual and tangent of eq. (1) with |q|^2 = 1 integrated at the Gauss points of the other terms."""
    U, data = model.state, model.data
    w, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
    section = equilibrium.Section(law_of(data.K, data.K_inv, data.J, data.G), as_matrix(data.R_R), data.v_R)
    rule = ufl.dx(domain=model.mesh, metadata={"quadrature_degree": 2 * model.signature.points - 1})

    def ds(a):
        return a * rule

    state, test = eq.state_of(U, U.dx(0), U), eq.tests_of(w, w.dx(0))
    residual = equilibrium.displacement(state, section, test, ds) + ds(eq.unit_quaternion(state, test))
    with compat.quiet_compiler():
        return SimpleNamespace(
            residual=(fem.form(residual),),
            tangent=(fem.form(ufl.derivative(residual, U, trial)),),
            dead=model.forms.dead,
        )


class Bare(Method):
    """See `cells.Method`."""

    key, title = "bare", "bare loop on\ndolfinx, PETSc"
    what = (
        "a short loop on PETSc's SNES over this package's own form of eq. (1), degree 2, 8 elements, one habit at a"
        " time that the package avoids; no count of negative modes"
    )

    def solve(self, problem, jump=False):
        """Only problems with `jump`; for all others the answer would be this package's."""
        if not jump:
            raise NotForIt("the package's own equations: only jumps and loops are its matter")
        tip = Loop(problem, line_search="basic").to(problem["load_factors"][0])
        return Answer(tip[None], "", "no count of negative modes")

    def numerics(self, key):
        """(problem, answer, number, unit); see `catalogue`."""
        infinite = key == "lu"
        problem = problems.column([0.9], 1e3 if key == "residual" else 1e2, infinite=infinite)
        options, etas, note = {
            "residual": ({"relative": 1e-6, "in_si": True, "predict": True}, (0.3, 0.6, 0.9),
                         "rtol 1e-6, three steps with a secant predictor"),
            "line_search": ({"line_search": None}, (0.9,), ""),
            "clamp": (
                {"held": (0, 1, 2, 4, 5, 6), "weak": True}, (0.1, 0.3, 0.5, 0.7, 0.9),
                "|q| = 1 weakly, in five steps: q_a of the clamp drifts; where |q| = 1 is asked for at the nodes, as "
                "this package does, it stays",
            ),
            "lu": ({"solver": "petsc", "formulation": "mixed"}, (0.9,), ""),
            "quadrature": ({"points": 3, "elements": 4}, (0.9,), "4 elements of degree 2, 3 Gauss points"),
        }[key]  # fmt: skip
        loop = Loop(problem, **options)
        tips = [loop.to(eta) for eta in etas]
        answer = Answer(tips[-1][None], "", note)
        if key == "clamp":
            return problem, answer, loop.off_rotation(), NO_ROTATION
        if key != "line_search":
            return problem, answer, None, ""
        same = {"model": "spatial", "formulation": "displacement", "degree": 2}
        return problem, against_steps(problem, answer, **same), loop.snes.getIterationNumber(), "Newton iterations"
