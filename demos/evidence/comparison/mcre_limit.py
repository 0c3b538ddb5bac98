"""The truncated energy (truncated.py), to which the reconstructed MCRE converges, discretised with dolfinx."""

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

from comparison import truncated
from comparison.column import CRITICAL, Column
from cosserat_fenicsx import compat


def assembled(form, free):
    """A bilinear form as a sparse matrix of scipy, of the unknowns `free`."""
    A = fem_petsc.assemble_matrix(form)
    A.assemble()
    start, column, values = A.getValuesCSR()
    matrix = csr_matrix((values, column, start), shape=A.size)[free][:, free]
    A.destroy()
    return matrix


def assembled_vector(form):
    """A linear form as an array."""
    vector = fem_petsc.assemble_vector(form)
    values = vector.array.copy()
    vector.destroy()
    return values


def unit_mesh(elements):
    """The interval [0, 1] in equal elements."""
    ends = np.column_stack([np.arange(elements), np.arange(1, elements + 1)]).astype(np.int64)
    return compat.create_interval_mesh(MPI.COMM_SELF, ends, np.linspace(0, 1, elements + 1)[:, None])[0]


class TruncatedColumn:
    """The column as a problem of `follow`: (u, w, phi) in P_degree, clamped at s = 0, in units of L and EI/L^2, with
    degree Gauss points an element, which keeps thin rods from locking."""

    def __init__(self, elements=32, degree=4, column=None):
        self.column = column = column or Column()
        axial, shear, eccentricity = column.relative
        mesh = unit_mesh(elements)
        space = compat.function_space(mesh, compat.lagrange(mesh, degree, 3))
        self._U = fem.Function(space)
        (u_s, w_s, phi_s), phi = (self._U[i].dx(0) for i in range(3)), self._U[2]
        stiffness = [fem.Constant(mesh, value) for value in (axial, shear, 1.0)]
        ds = ufl.dx(domain=mesh, metadata={"quadrature_degree": 2 * degree - 1})
        first = ufl.derivative(truncated.energy(u_s, w_s, phi, phi_s, *stiffness) * ds, self._U)
        with compat.quiet_compiler():
            self._first, self._second = fem.form(first), fem.form(ufl.derivative(first, self._U))
        s = space.tabulate_dof_coordinates()[:, 0]
        clamped, self._tip = 3 * np.argmin(s) + np.arange(3), 3 * np.argmax(s) + np.arange(3)
        self._free = np.setdiff1d(np.arange(len(self._U.x.array)), clamped)
        self.size = len(self._free)
        load = np.zeros(len(self._U.x.array))
        load[self._tip] = -CRITICAL, 0.0, CRITICAL * eccentricity
        self._load = load[self._free]

    def residual(self, x, eta):
        """Internal minus external forces."""
        self._U.x.array[self._free] = x
        return assembled_vector(self._first)[self._free] - eta * self._load

    def load(self, x):
        """Tip force and constant tip moment at eta = 1."""
        return self._load

    def linearise(self, x, eta, before):
        """Solve with the tangent."""
        return splu(self._tangent(x).tocsc()).solve

    def negative_modes(self, x, eta):
        """Negative eigenvalues of the tangent."""
        return int((np.linalg.eigvalsh(self._tangent(x).toarray()) < 0).sum())

    def tip(self, x):
        """(delta, shortening, rotation) of the tip: m, m, rad."""
        self._U.x.array[self._free] = x
        u, w, phi = self._U.x.array[self._tip]
        return w * self.column.length, -u * self.column.length, phi

    def _tangent(self, x):
        self._U.x.array[self._free] = x
        return assembled(self._second, self._free)
