"""The circular bar itself as a three-dimensional St Venant-Kirchhoff solid: second-order hexahedra, on dolfinx.

One half of the bar, y >= 0, with the plane y = 0 as a plane of symmetry: it bends towards x only, as the planar rods
do. The end face carries the eccentric force as a dead traction, linear over the face, whose resultant is the force and
its moment about the centroid. The traction stays on its material points, which rotate with the face: the comparable
load of a rod is the force on an arm (`EccentricForce`), not the constant moment. Inside, lengths are in units of L and
stresses in units of EI/L^4, for the EI of the circle.
"""

import basix
import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dolfinx_mesh
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc
from scipy.interpolate import CubicSpline

from comparison import solid
from comparison.bar_mesh import half_disc, moments, swept
from comparison.column import CRITICAL, Column
from cosserat_fenicsx import compat
from cosserat_fenicsx.checks import refuse

_GAUSS_POINTS = {"quadrature_degree": 5}  # three in each direction


class SolidBar:
    """The bar as a problem of `follow`; unknowns: displacements of all nodes, in units of L; along: elements along the
    bar; refinement: elements along an eighth of the circle.

    clamp: "plane" keeps the foot's face plane (u_z = 0, its centre fixed) but lets it contract, as a rod's clamp fixes
    the position and direction of the section but not its shape; "face" fixes all of it, and the mesh is finer there.
    """

    def __init__(self, column=None, along=40, refinement=2, clamp="plane"):
        if clamp not in ("plane", "face"):
            refuse("SolidBar", "clamp", clamp, '"plane" or "face"')
        self.column, self.along = column or Column(), along
        column = self.column
        radius = column.diameter / column.length / 2
        points, quads = half_disc(radius, refinement)
        levels = np.linspace(0, 1, along + 1)
        if clamp == "face":  # the disturbance decays within a diameter
            levels = np.union1d(levels, 2 * radius * np.array([0.05, 0.125, 0.25, 0.5, 1.0]))
        x, cells = swept(points, quads, levels)
        self.elements = len(cells)
        nodes = np.rint(2 * _nodes_of_the_hexahedron()).astype(int)
        cells = cells[:, nodes[:, 0], nodes[:, 1], nodes[:, 2]]
        with compat.quiet_compiler():
            mesh = compat.create_solid_mesh(MPI.COMM_SELF, np.ascontiguousarray(cells, dtype=np.int64), x)
            space = compat.function_space(mesh, compat.lagrange(mesh, 2, 3))
        self._u, self._before = fem.Function(space), fem.Function(space)
        self.size = len(self._u.x.array)
        x = self._nodes = space.tabulate_dof_coordinates()
        self._tip = int(np.argmin(np.abs(x - (0, 0, 1)).sum(axis=1)))
        self._held = self._supports(space, x, clamp)
        self._compile(mesh, space, moments(points, quads))

    def _supports(self, space, x, clamp):
        """Boundary conditions, component by component."""
        foot, centre = np.abs(x[:, 2]) < 1e-9, np.abs(x[:, 0]) + np.abs(x[:, 1]) < 1e-9
        whole = foot if clamp == "face" else foot & centre
        fixed = {0: whole, 1: whole | (np.abs(x[:, 1]) < 1e-9), 2: foot}
        dofs = {i: (3 * np.flatnonzero(where) + i).astype(np.int32) for i, where in fixed.items()}
        self._fixed = np.concatenate(list(dofs.values()))
        return [fem.dirichletbc(PETSc.ScalarType(0), found, space.sub(i)) for i, found in dofs.items()]

    def _compile(self, mesh, space, section):
        area, inertia = section
        column = self.column
        E = column.E / (column.bending / column.length**4)
        lame = [
            fem.Constant(mesh, E * column.nu / (1 + column.nu) / (1 - 2 * column.nu)),
            fem.Constant(mesh, E / 2 / (1 + column.nu)),
        ]
        H, before = ufl.grad(self._u), ufl.grad(self._before)
        test, trial = ufl.TestFunction(space), ufl.TrialFunction(space)
        dx = ufl.dx(domain=mesh, metadata=_GAUSS_POINTS)
        end = dolfinx_mesh.locate_entities_boundary(mesh, 2, lambda x: np.abs(x[2] - 1) < 1e-9)
        ends = dolfinx_mesh.meshtags(mesh, 2, np.sort(end), np.ones(len(end), dtype=np.int32))
        face = ufl.ds(domain=mesh, subdomain_data=ends, metadata=_GAUSS_POINTS)(1)
        # half of the force acts on half of the bar
        face_data = [fem.Constant(mesh, v) for v in (2 * area, 2 * inertia, column.relative[2])]
        traction = -solid.eccentric_traction(ufl.SpatialCoordinate(mesh)[0], *face_data) * test[2] * face
        with compat.quiet_compiler():
            self._residual = fem.form(solid.virtual_work(H, ufl.grad(test), lame) * dx)
            self._tangent = fem.form(
                solid.carried_stress_tangent(H, before, ufl.grad(trial), ufl.grad(test), lame) * dx
            )
            self._traction = fem.form(traction)
        self._load = CRITICAL * self._assembled(self._traction)
        self._K = fem_petsc.create_matrix(self._tangent)
        self._K.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self._solver = _cholesky(self._K)

    def _assembled(self, form):
        vector = fem_petsc.assemble_vector(form)
        values = vector.array.copy()
        vector.destroy()
        values[self._fixed] = 0.0
        return values

    def residual(self, x, eta):
        """Internal minus external forces; zero where the displacement is held."""
        self._u.x.array[:] = x
        return self._assembled(self._residual) - eta * self._load

    def load(self, x):
        """The traction at eta = 1: dead."""
        return self._load

    def linearise(self, x, eta, before):
        """Solve with the tangent of the mixed-integration-point Newton method."""
        self._u.x.array[:], self._before.x.array[:] = x, before
        self._K.zeroEntries()
        fem_petsc.assemble_matrix(self._K, self._tangent, self._held)
        self._K.assemble()
        self._solver.setOperators(self._K)
        self._solver.setUp()
        return self._solve

    def _solve(self, b):
        columns = np.atleast_2d(b.T)
        right, answer = self._K.createVecs()
        found = np.empty_like(columns)
        for k, column in enumerate(columns):
            right.array[:] = column
            self._solver.solve(right, answer)
            found[k] = answer.array
        right.destroy(), answer.destroy()
        return found.reshape(b.T.shape).T

    def negative_modes(self, x, eta):
        """Negative eigenvalues of the last tangent that was factorised: the one before the last Newton step."""
        return self._solver.getPC().getFactorMatrix().getInertia()[0]

    def carried(self, coarser, x):
        """The state x of a bar with other elements along it and the same mesh of the section, by splines in z."""
        (theirs, levels), (mine, wanted) = coarser._fibres(), self._fibres()
        found = np.empty((len(mine), 3))
        fibres = x.reshape(-1, 3)[theirs].reshape(-1, len(levels), 3)
        found[mine] = CubicSpline(levels, fibres, axis=1)(wanted).reshape(-1, 3)
        return found.ravel()

    def _fibres(self):
        """(nodes, fibre by fibre along the bar; the z of a fibre's nodes)."""
        places = np.rint(1e9 * self._nodes).astype(np.int64)
        return np.lexsort(places.T[[2, 1, 0]]), np.unique(places[:, 2]) / 1e9

    def tip(self, x):
        """(delta, shortening, rotation) of the end face's centre: m, m, rad (of the line along x through it)."""
        return tuple(x[3 * self._tip : 3 * self._tip + 3][[0, 2]] * self.column.length * (1, -1)) + (np.nan,)


def _nodes_of_the_hexahedron():
    """Reference coordinates of the 27 nodes in basix' order."""
    cell, family = basix.CellType.hexahedron, basix.ElementFamily.P
    return np.asarray(basix.create_element(family, cell, 2, basix.LagrangeVariant.equispaced).points)


def _cholesky(A):
    """MUMPS' symmetric factorisation, which counts negative pivots."""
    solver = PETSc.KSP().create(A.comm)
    solver.setOperators(A)
    solver.setType("preonly")
    pc = solver.getPC()
    pc.setType("cholesky")
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    factor = pc.getFactorMatrix()
    factor.setMumpsIcntl(14, 200)  # % extra memory for fill-in: too little fails without a message
    factor.setMumpsIcntl(24, 1)  # null pivots are counted separately from negative ones
    return solver
