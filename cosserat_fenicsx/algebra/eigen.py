"""Eigenvalues by SLEPc: the only file that knows it."""

import numpy as np
from petsc4py import PETSc
from slepc4py import SLEPc

from cosserat_fenicsx.algebra import linear

_TOLERANCE = 1e-12
# Where eigenvalues of the other sign may lie much nearer to zero: their rounding is in those that are asked for.
_COARSE = 1e-9


class _Inverse:
    """The inverse of a factored matrix as a matrix."""

    def __init__(self, pc):
        self._pc = pc

    def mult(self, mat, x, y):
        """PETSc's name for y = K^-1 x."""
        self._pc.apply(x, y)


def nearest_zero(K, pc, count, side=0):
    """Eigenvalues of a symmetric matrix next to zero, by the factorisation that is at hand.

    Args:
        K: the matrix.
        pc: a PC that holds its factors.
        count: how many.
        side: 1 for positive ones, -1 for negative ones, 0 for both.

    Returns:
        (values (n,), vectors): nearest first, n <= count; PETSc vectors of length one.
    """
    inverse = PETSc.Mat().createPython(K.getSizes(), _Inverse(pc), comm=K.comm)
    inverse.setUp()
    solver = SLEPc.EPS().create(K.comm)
    solver.setOperators(inverse)
    which = SLEPc.EPS.Which
    where = {0: which.LARGEST_MAGNITUDE, 1: which.LARGEST_REAL, -1: which.SMALLEST_REAL}[side]
    tolerance = _COARSE if side else _TOLERANCE
    values, vectors = _solve(solver, SLEPc.EPS.ProblemType.HEP, where, count, K, tolerance=tolerance)
    return 1 / values, vectors


def largest_of_pencil(A, B, count):
    """The largest eigenvalues nu of A x = nu B x, A symmetric, B symmetric and positive definite.

    Returns:
        (values (n,), vectors), see `nearest_zero`; the largest first.
    """
    solver = SLEPc.EPS().create(A.comm)
    solver.setOperators(A, B)
    ksp = solver.getST().getKSP()
    ksp.setType("preonly")
    linear.factor_second_variation(ksp.getPC(), B)
    return _solve(solver, SLEPc.EPS.ProblemType.GHEP, SLEPc.EPS.Which.LARGEST_REAL, count, A)


def largest_of_operator(operator, size, count, known):
    """Eigenvalues of the largest magnitude of a symmetric operator, on this rank alone.

    Args:
        operator: has `mult(mat, x, y)`.
        size: of its vectors; count: how many are asked for.
        known: (size, k) eigenvectors of length one that are not looked for.

    Returns:
        (values (n,), vectors (size, n) of length one), the largest first, n <= count.
    """
    matrix = PETSc.Mat().createPython([size, size], operator, comm=PETSc.COMM_SELF)
    matrix.setUp()
    solver = SLEPc.EPS().create(PETSc.COMM_SELF)
    solver.setOperators(matrix)
    if known.shape[1]:
        solver.setDeflationSpace(
            [PETSc.Vec().createWithArray(column.copy(), comm=PETSc.COMM_SELF) for column in known.T]
        )
    room = size - known.shape[1]
    values, vectors = _solve(
        solver, SLEPc.EPS.ProblemType.HEP, SLEPc.EPS.Which.LARGEST_MAGNITUDE, count, matrix, room=room
    )
    return values, np.array([v.array_r for v in vectors]).reshape(len(vectors), size).T


def _solve(solver, kind, which, count, like, *, room=None, tolerance=_TOLERANCE):
    solver.setProblemType(kind)
    solver.setWhichEigenpairs(which)
    size = room or like.getSize()[0]
    count = min(count, size)
    solver.setDimensions(count, min(size, max(2 * count, count + 15)))
    solver.setTolerances(tolerance, 500)
    start = like.createVecRight()
    first, last = start.getOwnershipRange()
    start.array_w[:] = 1 + np.sin(np.arange(first, last) + 1.0)  # the same at every run and on any number of ranks
    solver.setInitialSpace([start])
    solver.solve()
    found = min(solver.getConverged(), count)
    values, vectors = [], []
    for i in range(found):
        vector = like.createVecRight()
        values.append(solver.getEigenpair(i, vector).real)
        vector.normalize()
        vectors.append(vector)
    solver.destroy()
    return np.array(values), vectors
