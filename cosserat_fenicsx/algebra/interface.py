"""The unknowns where rods meet, in one small system that every rank solves as a whole."""

import contextlib
import math

import numpy as np
from petsc4py import PETSc

from cosserat_fenicsx.algebra import linear
from cosserat_fenicsx.algebra.elimination import Elimination
from cosserat_fenicsx.algebra.pointers import Pointers

# Pivots and eigenvalues of a matrix with a diagonal of ones that are zero to rounding. Those of slender rods with
# hinges may be almost as small.
_ROUNDING = 1e-15
# Largest number of unknowns of a system that is solved as a dense one.
_DENSE = 150


def condensed(model, numbering, cell_dofs, tied, **options):
    """The `Elimination` along a model's rods, and the `Interface` that it leaves, or None where it leaves nothing.

    Args:
        numbering: the `Numbering` of the unknowns; cell_dofs: see `Elimination`, as for the options.
        tied: (tied nodes, block) numbers of the unknowns in constraint equations, -1 where clamped.
    """
    order = np.argsort(model.rods.cells[: len(cell_dofs)])
    elimination = Elimination(numbering, cell_dofs, order, tied.ravel(), **options)
    if not elimination.unknowns and numbering.comm.size == 1:
        return elimination, None
    links = model.signature.connections
    equations = links.equations if numbering.multipliers else ()
    return elimination, Interface(elimination, tied, links.pattern, equations)


class Interface:
    """The system of the unknowns that `Elimination` leaves, with the constraint equations.

    Args:
        elimination: the `Elimination`.
        tied: (tied nodes, block) numbers of the unknowns in constraint equations, -1 where clamped.
        pattern: the `TiePattern` of the tied nodes.
        equations: indices of the ties whose multipliers belong to the system.

    Attributes:
        nodes: places in the system of the tied nodes' unknowns, -1 where clamped.
    """

    def __init__(self, elimination, tied, pattern, equations=()):
        self._elimination, self._size = elimination, elimination.unknowns
        known = elimination.interface
        self.nodes = nodes = np.where(tied.ravel() >= 0, np.searchsorted(known, tied.ravel()), -1)
        of_nodes, ends, multipliers = pattern.places(nodes.reshape(tied.shape), np.array(equations, dtype=np.intp))
        multipliers = multipliers + (len(known) - len(equations))
        added = [np.stack(pair) for pair in ((ends, multipliers), (multipliers, ends))]
        rows, columns = np.concatenate([elimination.places, of_nodes, *added], axis=1)
        self._here = (rows >= 0) & (columns >= 0)
        self._dense = self._size <= _DENSE
        self._solver = _Dense(self._size) if self._dense else _Sparse(self._size)
        self._entry = self._solver.entries(rows[self._here], columns[self._here])

    def _values(self, of_nodes, *others):
        """The entries of the sum of all ranks' condensed matrices and of the constraint equations' derivatives.

        Args:
            of_nodes, others: derivatives of the reactions by nodes and by multipliers, and of the equations by nodes,
                as `TieRows.tangent_blocks` returns them; the last two only where multipliers belong to the system.
        """
        values = np.concatenate([self._elimination.all_condensed(), *(part.ravel() for part in (of_nodes, *others))])
        here = self._here[: len(values)]
        entries = self._entry[: np.count_nonzero(here)]
        return np.bincount(entries, values[here], minlength=self._solver.room)

    def factor(self, *derivatives):
        """Factors of the system, see `_values`; False where it is singular."""
        self._kept = self._values(*derivatives)
        return self._solver.factor(self._kept, self._elimination.c.zero_pivot)

    def memory(self):
        """The entries of the last matrix."""
        return self._kept

    def recall(self, memory):
        """Factorise the matrix whose entries `memory` returned."""
        self._kept = np.array(memory)
        self._solver.factor(self._kept, self._elimination.c.zero_pivot)

    def solve(self, b):
        """Replace a right-hand side (unknowns,) by the solution, from the last factors."""
        self._solver.solve(b)

    def signs(self, of_nodes):
        """(negative, zero) numbers of eigenvalues of the system, which is symmetric, and the logarithm of the product
        of the absolute values of those that are not zero (of large systems NaN where some are)."""
        return self._solver.signs(self._values(of_nodes))


class _Dense(Pointers):
    """A system as a dense matrix, row by row."""

    def __init__(self, size):
        super().__init__()
        self._size, self.room = size, size * size
        self._factors, self._scale, self._work = np.zeros(size * size), np.zeros(size), np.zeros(size)
        self._order = np.zeros((2, size), dtype=np.int32)
        self._double = [self.doubles(array) for array in (self._factors, self._scale, self._work)]
        self._int = [self.integers(array) for array in self._order]

    def entries(self, rows, columns):
        return rows * self._size + columns

    def factor(self, values, zero):
        self._factors[:] = values
        return not self._lib.factor_dense(self._double[0], self._size, *self._int, zero, *self._double[1:])

    def solve(self, b):
        factors, scale, work = self._double
        self._lib.solve_dense(factors, self._size, *self._int, scale, self._ffi.from_buffer("double[]", b), work)

    def signs(self, values):
        matrix = values.reshape(self._size, self._size)
        scale = _scale(np.diag(matrix))
        matrix = scale[:, None] * matrix * scale
        units = 2 * float(np.log(scale).sum())
        with contextlib.suppress(np.linalg.LinAlgError):
            # of small eigenvalues it tells the sign more accurately than their values do
            factor = np.linalg.cholesky(matrix)
            return 0, 0, 2 * float(np.log(np.diag(factor)).sum()) - units
        values = np.linalg.eigvalsh(matrix)
        zero = np.abs(values) <= _ROUNDING
        logarithm = float(np.log(np.abs(values[~zero])).sum()) - units
        return int((values[~zero] < 0).sum()), int(zero.sum()), logarithm


class _Sparse:
    """A system by its columns."""

    def __init__(self, size):
        self._size = size

    def entries(self, rows, columns):
        """Where the entries at rows and columns are added."""
        each = np.arange(self._size)  # a diagonal of zeros is part of the pattern
        keys, entry = np.unique(np.append(columns, each) * self._size + np.append(rows, each), return_inverse=True)
        self._indices, self.room = (keys % self._size).astype(np.int32), len(keys)
        self._starts = np.searchsorted(keys // self._size, np.arange(self._size + 1)).astype(np.int32)
        return entry[: len(rows)]

    def _matrix(self, values):
        from scipy.sparse import csc_matrix  # slow to import, and few scenes need it

        return csc_matrix((values, self._indices, self._starts), shape=(self._size, self._size))

    def factor(self, values, zero):
        from scipy.sparse.linalg import splu

        try:
            self._solve = splu(self._matrix(values)).solve if np.isfinite(values).all() else None
        except RuntimeError:  # SuperLU: exactly singular
            self._solve = None
        return self._solve is not None

    def solve(self, b):
        b[:] = self._solve(b)

    def signs(self, values):
        from scipy.sparse import diags
        from scipy.sparse.linalg import splu

        matrix = self._matrix(values)
        scale = diags(_scale(matrix.diagonal()))
        matrix = (scale @ matrix @ scale).tocsc()
        try:
            factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
            pivots = factors.U.diagonal()
            if (factors.perm_r == factors.perm_c).all() and np.abs(pivots).min() > _ROUNDING:
                logarithm = float(np.log(np.abs(pivots)).sum() - 2 * np.log(scale.diagonal()).sum())
                return int((pivots < 0).sum()), 0, logarithm
        except RuntimeError:
            pass
        negative, zero, logarithm = _inertia(matrix.tocsr())
        return negative, zero, logarithm - 2 * float(np.log(scale.diagonal()).sum())


def _inertia(matrix):
    """(negative, zero) numbers of eigenvalues of a symmetric scipy matrix, by factors with pivots of two rows too, and
    the logarithm of the absolute value of its determinant, NaN where it is singular."""
    matrix.sort_indices()
    parts = matrix.indptr.astype(PETSc.IntType), matrix.indices.astype(PETSc.IntType), matrix.data
    A, pc = PETSc.Mat().createAIJ(matrix.shape, csr=parts, comm=PETSc.COMM_SELF), PETSc.PC().create(PETSc.COMM_SELF)
    A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    pc.setOperators(A)
    linear.factor_constrained(pc, A, _ROUNDING)
    pc.getFactorMatrix().setMumpsIcntl(33, 1)  # the determinant, RINFOG(12) times 2 to the power INFOG(34)
    pc.setUp()
    factor = pc.getFactorMatrix()
    negative, zero, _ = factor.getInertia()
    part, power = abs(factor.getMumpsRinfog(12)), factor.getMumpsInfog(34)
    pc.destroy()
    A.destroy()
    return negative, zero, math.log(part) + power * math.log(2) if part and not zero else math.nan


def _scale(diagonal):
    """Factors that make the diagonal ones, which leaves the signs, whatever the units of the unknowns."""
    size = np.sqrt(np.abs(diagonal))
    return 1 / np.where(size > 0, size, 1.0)
