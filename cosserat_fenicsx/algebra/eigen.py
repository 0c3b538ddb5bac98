"""Eigenvalues by SLEPc: the only file that knows it."""

import numpy as np
from petsc4py import PETSc
from scipy import sparse
from scipy.sparse.linalg import splu
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
    which = {0: "LARGEST_MAGNITUDE", 1: "LARGEST_REAL", -1: "SMALLEST_REAL"}[side]
    values, vectors = _solve(solver, SLEPc.EPS.ProblemType.HEP, getattr(SLEPc.EPS.Which, which), count, K, _COARSE if side else _TOLERANCE)
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


def lowest_of_constrained(K, M, held, count, shift=-1.0):
    """Eigenvalues of K x = lambda M x with held x = 0, next to `shift`; each rank solves all of it.

    With M = L L^T in blocks these are those of L^T A L, A the part of the inverse of [[K - shift M, held^T],
    [held, 0]] that belongs to x: 1/(lambda - shift).

    Args:
        K: symmetric, sparse, of scipy; M: symmetric and positive definite, of diagonal blocks (scipy's bsr_matrix).
        held: (equations, size), dense.

    Returns:
        (values (n,), vectors (size, n)), n <= count.
    """
    size, equations = K.shape[0], len(held)
    L = M.copy()
    L.data = np.linalg.cholesky(M.data)
    held = sparse.csr_matrix(held)
    factors = splu(
        sparse.bmat([[K - shift * M, held.T], [held, None]] if equations else [[K - shift * M]], format="csc")
    )
    inverse = PETSc.Mat().createPython([size, size], _Congruent(factors, L, size + equations), comm=PETSc.COMM_SELF)
    inverse.setUp()
    solver = SLEPc.EPS().create(PETSc.COMM_SELF)
    solver.setOperators(inverse)
    count = min(count, size - equations)
    values, vectors = _solve(solver, SLEPc.EPS.ProblemType.HEP, SLEPc.EPS.Which.LARGEST_MAGNITUDE, count, inverse)
    blocks = np.array([v.array_r for v in vectors]).reshape(len(vectors), *M.data.shape[:2], 1)
    return shift + 1 / values, np.linalg.solve(L.data.transpose(0, 2, 1), blocks).reshape(len(vectors), size).T


class _Congruent:
    """L^T A L as a matrix, see `lowest_of_constrained`."""

    def __init__(self, factors, L, size):
        self._factors, self._L, self._size = factors, L, size

    def mult(self, mat, x, y):
        """PETSc's name for y = L^T A L x."""
        force = np.zeros(self._size)
        force[: len(x.array_r)] = self._L @ x.array_r
        y.array_w[:] = self._L.T @ self._factors.solve(force)[: len(x.array_r)]


def _solve(solver, kind, which, count, like, tolerance=_TOLERANCE):
    solver.setProblemType(kind)
    solver.setWhichEigenpairs(which)
    size = like.getSize()[0]
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
