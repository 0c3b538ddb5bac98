"""Eq. (1) of the paper on P2 functions (r, q, lambda), dolfinx and SNES by hand: eccentric cantilever, L = EI = 1."""

import numpy as np
import ufl
from dolfinx import fem, mesh
from dolfinx.fem.petsc import assemble_matrix, assemble_vector, create_matrix
from mpi4py import MPI
from petsc4py.PETSc import SNES, InsertMode, Options, ScatterMode, Sys, Vec

from cosserat_fenicsx import analytic, compat
from cosserat_fenicsx.forms import equilibrium, law, spatial

e, EA, GA, GJ = 0.01, 16 * 100.0**2, 3 * 16 * 100.0**2 / (7 + 6 * 0.3), 1 / (1 + 0.3)  # circle, L/d = 100, nu = 0.3


def main(elements=8, load_factors=np.linspace(0.025, 2.0, 80)):
    """Continue in eta = F/P_cr with secants as predictors; yields (eta, SNES iterations, delta/L)."""
    line = mesh.create_unit_interval(MPI.COMM_WORLD, elements)
    V = compat.function_space(line, compat.lagrange(line, 2, 8))
    U, phi, eta, nodes = fem.Function(V), ufl.TestFunction(V), fem.Constant(line, 0.0), V.dofmap.index_map.size_local
    D = [GA, GA, EA], [1 / GA, 1 / GA, 1 / EA], [1, 1, GJ]  # K, its inverse and J of eqs. (2)-(3)
    section = equilibrium.Section(law.DiagonalLaw(*map(ufl.as_vector, D)), ufl.Identity(3), ufl.as_vector([0, 0, 1]))
    state = spatial.state_of(U, U.dx(0), U)
    test = spatial.variations_of(phi, phi.dx(0), state.q, state.q_s)
    simpson = {"quadrature_points": ((1.0,), (0.5,), (0.0,)), "quadrature_weights": (1 / 6, 2 / 3, 1 / 6)}
    at_nodes = ufl.dx(metadata={"quadrature_rule": "custom", "quadrature_degree": 3, **simpson})
    F = equilibrium.displacement(state, section, test, lambda a: a * ufl.dx(metadata={"quadrature_degree": 3}))
    F += spatial.multiplier(U[7], phi[7], state.q, phi) * at_nodes
    F += eta * np.pi**2 / 4 * (test.phi_r[2] - e * test.phi[1]) * ufl.ds  # at the tip; the foot's rows are not used
    with compat.quiet_compiler():
        residual, tangent = fem.form(F), fem.form(ufl.derivative(F, U))
    foot, tip = (fem.locate_dofs_geometrical(V, lambda x, s=s: np.isclose(x[0], s)) for s in (0, 1))
    clamp = fem.dirichletbc(np.array([0, 0, 0, 1.0, 0, 0, 0, 0]), foot, V)  # r = 0, q = 1, lambda = 0
    clamped = (8 * foot[foot < nodes, None] + np.arange(8)).ravel()
    U.interpolate(lambda x: np.stack([0 * x[0], 0 * x[0], x[0], 1 + 0 * x[0], *np.zeros((4, x.shape[1]))]))

    def function(snes, x, b):
        U.x.array[: 8 * nodes] = x.array_r
        U.x.scatter_forward()
        assembled = assemble_vector(residual)
        assembled.ghostUpdate(addv=InsertMode.ADD, mode=ScatterMode.REVERSE)
        b.array = assembled.array_r
        b.array[clamped] = 0  # no step changes the values of the clamp, which are those of the start

    def jacobian(snes, x, A, _):
        A.zeroEntries()
        assemble_matrix(A, tangent, bcs=[clamp])
        A.assemble()

    snes = SNES().create(line.comm)
    snes.setFunction(function, assemble_vector(residual))
    snes.setJacobian(jacobian, create_matrix(tangent))
    snes.setOptionsPrefix("bare_")
    newton = "snes_linesearch_type=basic snes_rtol=0 snes_stol=1e-11 snes_atol=1e-8 snes_error_if_not_converged=true"
    for option in f"{newton} ksp_type=preonly pc_type=lu pc_factor_mat_solver_type=mumps".split():
        Options("bare_").setValue(*option.split("="))
    snes.setFromOptions()
    x = now = Vec().createWithArray(U.x.array[: 8 * nodes].copy(), comm=line.comm)
    for eta.value in load_factors:
        now, before = x.copy(), now
        x.array = 2 * now.array - before.array
        snes.solve(None, x)
        yield float(eta.value), snes.getIterationNumber(), line.comm.allreduce(U.x.array[8 * tip[tip < nodes]].sum())


if __name__ == "__main__":
    for eta, iterations, delta in list(main())[3::4]:
        exact = analytic.reissner(eta, e, 1.0, bending=1.0, axial=EA, shear=GA).delta
        Sys.Print(f"eta {eta:.2f}: {iterations:2} SNES iterations, delta/L {delta:.8f}, exact {exact:.8f}")
