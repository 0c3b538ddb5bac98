"""Overhead of `solve` over the dolfinx and PETSc calls that it makes: a sweep of 31 points, eta = 0.05 .. 1.5.

    python demos/evidence/overhead.py            medians of 15 alternating runs, processor time
    python demos/evidence/overhead.py --quick    one run each, to check that both give the same digits

The bare loop takes the same predicted starts and Newton iterations: residual and tangent assembled, KLU, the update of
the carried contact force. The stability count (one more assembly and factorisation per point) is an addition of the
package; the loop is timed without it and with it.
"""

import numpy as np
from cantilever import column
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from harness import command, in_turns, table, write
from petsc4py import PETSc

import cosserat_fenicsx as cf
from cosserat_fenicsx import compat
from cosserat_fenicsx.statics.problem import solvers_of

ETAS = np.linspace(0.05, 1.5, 31)
MESHES = ((2, 8), (3, 8), (3, 4))  # degree, elements


class BareLoop:
    """The bare calls, on the model that `solve` has compiled, with a separate matrix and vectors."""

    def __init__(self, model, path):
        self.model, self.iterations = model, path.iterations
        forms = model.forms
        # of one part each, since no load depends on the state
        (self.residual_form,), (self.tangent,), ((self.second,),) = (
            forms.residual, forms.tangent, forms.second_variations
        )  # fmt: skip
        self.A, self.K = fem_petsc.create_matrix(self.tangent), fem_petsc.create_matrix(self.second)
        self.K.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self.b, self.x = fem_petsc.assemble_vector(self.residual_form), self.A.createVecRight()
        self.dead = self.b.duplicate()
        for form in forms.dead:
            fem_petsc.assemble_vector(self.dead, form)
        (node,) = np.flatnonzero(model.slots == 0).astype(np.int32)  # the clamped one
        self.clamped = model.nodal[node]
        self.dead.array_w[self.clamped] = 0
        self.held = [fem.dirichletbc(fem.Function(model.space), np.array([node]))]
        self.held_rotations = [fem.dirichletbc(fem.Function(model.variation_spaces[0]), np.array([node]))]
        self.ksp = PETSc.KSP().create()
        self.ksp.setType("preonly")
        self.ksp.getPC().setType("lu")
        self.ksp.getPC().setFactorSolverType("klu")
        self.ksp.setOperators(self.A)
        self.pc = PETSc.PC().create()
        self.pc.setType("cholesky")
        self.pc.setFactorOrdering("nd")

    def residual(self, eta):
        with self.b.localForm() as numbers:
            numbers.set(0.0)
        fem_petsc.assemble_vector(self.b, self.residual_form)
        self.b.axpy(-eta, self.dead)
        self.b.array_w[self.clamped] = 0.0

    def run(self, scene, layout, *, stability):
        """The sweep; returns the tip's position at every point."""
        model, forms = self.model, self.model.forms
        model.load(scene, layout)
        (n,) = model.carried
        U, before, step = model.state.x.array, model.before.x.array, model.step.x.array
        known = [(0.0, U.copy(), n.x.array.copy())]
        tips = []
        for eta, iterations in zip(ETAS, self.iterations, strict=True):
            weights = [np.prod([(eta - b[0]) / (a[0] - b[0]) for b in known if b is not a]) for a in known]
            U[:] = sum(w * a[1] for w, a in zip(weights, known, strict=True))
            n.x.array[:] = sum(w * a[2] for w, a in zip(weights, known, strict=True))
            self.residual(eta)
            for _ in range(iterations):
                self.A.zeroEntries()
                fem_petsc.assemble_matrix(self.A, self.tangent, bcs=self.held)
                self.A.assemble()
                self.ksp.setOperators(self.A)
                self.ksp.solve(self.b, self.x)
                before[:] = U
                step[:] = -self.x.array
                n.x.array[:] = compat.evaluate(forms.advance, model.mesh, model._local_cells).ravel()
                U += step
                self.residual(eta)
            if stability:
                self.K.zeroEntries()
                fem_petsc.assemble_matrix(self.K, self.second, bcs=self.held_rotations)
                self.K.assemble()
                self.pc.setOperators(self.K)
                self.pc.setUp()
                self.pc.getFactorMatrix().getInertia()
            known = [*known[-2:], (eta, U.copy(), n.x.array.copy())]
            tips.append(U[model.nodal[np.argmax(model.slots), :3]].copy())
        return np.array(tips)


def compare(degree, elements, runs):
    """Median processor times (s) of `solve`, of the bare loop, and of that with the stability count; medians of the
    ratios of the first to the others in each run; the largest difference (m); Newton iterations."""
    rod, scene = column()

    def public():
        return cf.solve(scene, ETAS, degree=degree, elements=elements, model="spatial")

    path = public()
    with solvers_of(scene, path.layout, degree=degree) as (problem, _, _):
        bare = BareLoop(problem.model, path)
        layout = path.layout
        tips = bare.run(scene, layout, stability=False)
        difference = np.abs(tips * path.scales.length + rod.curve.position(0.0) - path.position(rod.end)).max()
        tasks = (
            public,
            lambda: bare.run(scene, layout, stability=False),
            lambda: bare.run(scene, layout, stability=True),
        )
        times = in_turns(tasks, runs)
        ratios = np.median(times[:, :1] / times[:, 1:], axis=0)
        return np.median(times, axis=0), ratios, difference, int(path.iterations.sum())


def main(runs=15, out="out"):
    """Print the table and write it to out/overhead.md. Returns Ratios to the bare loop, ratios to the one with the
    stability count, differences (m), one per mesh."""
    rows, results = [], []
    for degree, elements in MESHES:
        seconds, ratios, difference, newton = compare(degree, elements, runs)
        public, bare, stable = (f"{1e3 * s:.1f}" for s in seconds)
        rows.append((f"P{degree}, {elements}", newton, public, bare, f"{ratios[0]:.2f}", stable, f"{ratios[1]:.2f}"))
        results.append((*ratios, difference))
    about = f"{compat.version()}; medians of {runs} run(s), processor time, one process."
    heads = "degree, elements | Newton iterations | `cf.solve` (ms) | bare loop (ms) | ratio"
    heads += " | bare loop with stability count (ms) | ratio"
    print(write("overhead", [about, "", *table(heads, rows)], out))
    return np.array(results).T


if __name__ == "__main__":
    command(__doc__, main, {"runs": 1})
