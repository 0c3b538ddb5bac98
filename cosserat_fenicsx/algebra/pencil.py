"""The lowest eigenvalues of K x = lambda M x with held x = 0, with their multiplicity; every rank solves all of it."""

import numpy as np
from scipy import sparse

from cosserat_fenicsx.algebra import eigen
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.interrupts import interruptible, obey

# Eigenvalues below this fraction of the shift are not resolved: the solver returns combinations of their vectors.
_BLURRED = 1e-5
# Values of x^T K x below this times a bound on their rounding error count as zero; errors reach a fifth of it.
_SAFETY, _TYPICAL = 2.0, 0.2
# Eigenvalues with a smaller relative difference are counted as one multiple eigenvalue.
_TOGETHER = 1e-6
# Relative distance of a shift from the missing eigenvalue that it is to find.
_NEXT = 0.05
# Pivots below this count as zero; those of rotation about the axis of a thin rod are very small, but not zero.
_NO_PIVOT = 1e-200
# Largest number of passes; each finds at least one more vector, or moves the shift nearer to unresolved ones.
_PASSES = 100
# A dense projected problem of more vectors than this takes seconds, and is made interruptible.
_MANY = 500


def on_every_rank(A):
    """A PETSc matrix as one of scipy, whole on every rank."""
    size, parts = A.getSize()[1], A.comm.tompi4py().allgather(A.getValuesCSR())
    return sparse.vstack([sparse.csr_matrix((v, j, i), shape=(len(i) - 1, size)) for i, j, v in parts])


def constraint_rows(gradients, tied, size):
    """(equations, size) gradients of constraint equations by all unknowns, from those by (tied nodes, block); tied:
    numbers of the unknowns, -1 where clamped."""
    held = np.zeros((len(gradients), size + 1))  # number -1 goes to the last column
    held[:, tied.ravel()] = gradients.reshape(len(gradients), tied.size)
    return held[:, :size]


class Pencil:
    """K x = lambda M x, held x = 0, of scipy: K symmetric, sparse; M symmetric and positive definite, block diagonal
    (bsr_matrix); held (equations, size) dense, of full rank."""

    def __init__(self, K, M, held):
        self._K, self._M, self._held = K, M, sparse.csr_matrix(held)
        self._K_sizes = abs(K)
        self._L = M.copy()
        self._L.data = np.linalg.cholesky(M.data)
        self.size = K.shape[0]
        #: number of eigenvalues
        self.count = self.size - len(held)

    def lowest(self, count):
        """The lowest eigenvalues, with their multiplicity: (values (n,) ascending, vectors (size, n), typical rounding
        errors (n,) of the values), n <= count; values that are zero to rounding are 0.0. NotConverged where some were
        not found.

        An eigensolver may miss copies of repeated eigenvalues, or eigenvalues that are small against the shift. The
        number of negative eigenvalues of K - lambda M is the number of eigenvalues below lambda (Sylvester's law of
        inertia); missing ones are located by bisection with this count.
        """
        count = min(count, self.count)
        values, vectors = np.empty(0), np.empty((self.size, 0))  # in the variables L^T x, orthonormal
        shift, asked = -1.0, count
        for _ in range(_PASSES):
            fresh, found = self._nearest(shift, asked, vectors)
            blurred = (np.abs(fresh) < _BLURRED * abs(shift)) & (fresh != 0)
            values, vectors = np.append(values, fresh[~blurred]), np.hstack([vectors, found[:, ~blurred]])
            if blurred.any():
                shift, asked = -np.abs(fresh[blurred]).max(), int(blurred.sum())
                continue
            order = np.argsort(values)
            values, vectors = values[order], vectors[:, order]
            if len(values) >= count:
                top = values[count - 1]
                bounds = self._rounding(vectors[:, :count])
                rounding = 10 * bounds.max()
                beyond = top + max(_TOGETHER * abs(top), rounding)
                missing = self._below(beyond) - np.count_nonzero(values < beyond)
                if missing <= 0:
                    return values[:count], self._unknowns(vectors[:, :count]), _TYPICAL * bounds
                asked = min(missing, count)  # the others may be as many as there are nodes, and need not be found
                shift = self._missing_next_to(values, beyond, rounding)
            else:
                asked = count - len(values)
        raise NotConverged(
            f"{len(values)} natural frequencies were found, and {asked} more below the highest of them not. "
            "Ask for fewer modes, or another number of elements."
        )

    def _nearest(self, shift, count, known):
        """Eigenvalues next to a shift, and their vectors, orthogonal to the known ones."""
        factored = _Factored(self._shifted(shift), self._L, self.size)
        _, vectors = eigen.largest_of_operator(factored, self.size, min(count, self.count - known.shape[1]), known)
        factored.free()
        x = self._unknowns(vectors)

        def projected():  # more accurate than 1/theta + shift, next to a large shift
            values, turn = np.linalg.eigh(x.T @ (self._K @ x))
            return values, vectors @ turn

        values, vectors = interruptible(projected) if vectors.shape[1] > _MANY else projected()
        return np.where(np.abs(values) <= self._rounding(vectors), 0.0, values), vectors

    def _rounding(self, vectors):
        """Bound on the rounding error of x^T K x for each of the vectors."""
        x = np.abs(self._unknowns(vectors))
        return _SAFETY * np.finfo(float).eps * np.einsum("ik,ik->k", x, self._K_sizes @ x)

    def _missing_next_to(self, values, beyond, rounding):
        """A shift next to the lowest eigenvalue below `beyond` that is missing in `values` (ascending)."""
        high, low = beyond, -abs(beyond)
        while self._below(low):
            low *= 8
        while high - low > max(_NEXT * max(abs(high), abs(low)), rounding):
            middle = (high + low) / 2
            if self._below(middle) > np.count_nonzero(values < middle):
                high = middle
            else:
                low = middle
        return low

    def _below(self, value):
        """How many eigenvalues are below a value."""
        factored = _Factored(self._shifted(value), self._L, self.size)
        negative = factored.negative
        factored.free()
        return negative - (self.size - self.count)  # every constraint adds one negative eigenvalue

    def _shifted(self, shift):
        """[[K - shift M, held^T], [held, 0]]"""
        inner = self._K - shift * self._M
        return sparse.bmat(
            [[inner, self._held.T], [self._held, None]] if self._held.shape[0] else [[inner]], format="csr"
        )

    def _unknowns(self, vectors):
        """x from vectors L^T x."""
        blocks = vectors.T.reshape(vectors.shape[1], *self._L.data.shape[:2], 1)
        return np.linalg.solve(self._L.data.transpose(0, 2, 1), blocks).reshape(vectors.shape[1], self.size).T


class _Factored:
    """L^T A L as a matrix, where M = L L^T and A is the block for x of the inverse of [[K - shift M, held^T], [held,
    0]]; its eigenvalues are 1/(lambda - shift)."""

    def __init__(self, matrix, L, size):
        self._L, self._size, self._pc = L, size, eigen.constrained_factors(matrix, _NO_PIVOT)
        self._force, self._moved = self._pc.getOperators()[0].createVecs()

    @property
    def negative(self):
        """The number of negative eigenvalues of the matrix."""
        return self._pc.getFactorMatrix().getInertia()[0]

    def mult(self, mat, x, y):
        """PETSc's name for y = L^T A L x."""
        obey()
        self._force.array_w[:] = 0.0
        self._force.array_w[: self._size] = self._L @ x.array_r
        self._pc.apply(self._force, self._moved)
        y.array_w[:] = self._L.T @ self._moved.array_r[: self._size]

    def free(self):
        """Free the factors."""
        self._pc.destroy()
