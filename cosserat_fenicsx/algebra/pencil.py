"""Eigenvalues of matrices with held x = 0; every rank solves all of it.

The lowest of K x = lambda M x, with their multiplicity; and those of lambda^2 M + lambda C + K, real matrices of any
symmetry, in the upper half plane.
"""

from collections import namedtuple

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs, splu

from cosserat_fenicsx.algebra import eigen
from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.interrupts import interruptible, obey
from cosserat_fenicsx.numerics import svd

# Eigenvalues below this fraction of the shift are not resolved: the solver returns combinations of their vectors.
_BLURRED = 1e-5
# Values of x^T K x below this times a bound on their rounding error count as zero; typical errors are a fifth of it.
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
    """(equations, size) gradients by all unknowns from those by (tied nodes, block), of the unknowns `tied`."""
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
        # The iteration leaves parts along stiff motions, which a large K squares into errors above those of rounding.
        vectors = np.array([factored.applied(x) for x in vectors.T]).T
        vectors, _ = np.linalg.qr(vectors - known @ (known.T @ vectors))
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
    """L^T A L as a matrix: M = L L^T, A the block of x of [[K - shift M, held^T], [held, 0]]^-1; 1/(lambda - shift)."""

    def __init__(self, matrix, L, size):
        self._L, self._size, self._pc = L, size, eigen.constrained_factors(matrix, _NO_PIVOT)
        self._force, self._moved = self._pc.getOperators()[0].createVecs()

    @property
    def negative(self):
        """The number of negative eigenvalues of the matrix."""
        return self._pc.getFactorMatrix().getInertia()[0]

    def mult(self, mat, x, y):
        """PETSc's name for y = L^T A L x."""
        y.array_w[:] = self.applied(x.array_r)

    def applied(self, x):
        """L^T A L x of an array."""
        obey()
        self._force.array_w[:] = 0.0
        self._force.array_w[: self._size] = self._L @ x
        self._pc.apply(self._force, self._moved)
        return self._L.T @ self._moved.array_r[: self._size]

    def free(self):
        """Free the factors."""
        self._pc.destroy()


# Tolerances of the iteration, and of the one that looks for eigenvalues that it has missed.
_TOLERANCE, _ROUGH = 1e-12, 1e-2
# Restarts of an iteration; and the share of the wanted distance in which a rough eigenvalue counts as missed.
_RESTARTS, _BESIDE = 40, 0.99
# Largest number of shifts that are tried, and of looks for missed eigenvalues.
_SHIFTS, _LOOKS = 12, 20
# Size of an eigenvalue that is as good as none, in units of frequency; and squares of those of free motions over the
# rounding of K.
_LOW, _FREE = 1e-3, 4.0
# A real shift is this many times the smallest size of an eigenvalue, within these bounds.
_SHIFT, _BOUNDS = 0.5, (0.02, 5.0)
# Eigenvalues with a smaller relative difference are treated as one multiple eigenvalue.
_ALIKE = 1e-5
# Relative difference of eigenvalues that is rounding; and of vectors of real ones.
_EQUAL, _NO_PART = 1e-8, 1e-6
# Imaginary parts below this times the size of an eigenvalue are rounding.
_REAL, _NEARLY_REAL = 1e-9, 1e-5
# Singular values of the vectors of free motions, relative, that are not rounding.
_SAME_MOTION = 1e-3

#: Eigenvalues (n,), right eigenvectors (size, n), and typical absolute rounding errors (n,) of the eigenvalues.
Found = namedtuple("Found", "values vectors rounding")


class QuadraticPencil:
    """(lambda^2 M + lambda C + K) x = 0, held x = 0, of scipy: K, C, M (size, size), real, sparse; M symmetric and
    positive definite; held (equations, size) of full rank."""

    def __init__(self, K, C, M, held):
        self.K, self.C, self.M, self.held = (sparse.csc_matrix(a) for a in (K, C, M, held))
        self.size = K.shape[0]
        #: number of eigenvalues, of both half planes
        self.count = 2 * (self.size - self.held.shape[0])
        self._symmetric = all(abs(a - a.T).max() <= 1e-12 * abs(a).max() for a in (self.K, self.C))
        self._K_sizes, self._start = abs(self.K), np.random.default_rng(0)

    def lowest(self, count):
        """The eigenvalues of the smallest size in the upper half plane, `Found`, ascending by size; NotConverged where
        some were not found. One real shift sigma > 0, where no eigenvalue of a stable structure is, serves for all: the
        eigenvalues within the distance rho of it are found, and none of a size below rho - sigma is missed."""
        shift, asked = _SHIFT * self._size_of_lowest(), count
        for _ in range(_SHIFTS):
            values, vectors = self._nearest(shift, asked, lambda values, shift: abs(values) + shift)
            moving = abs(values[~self._free(values, vectors)])
            if len(moving) and not _BOUNDS[0] < shift / moving.min() < _BOUNDS[1]:
                shift = _SHIFT * moving.min()
                continue
            found = self._polished(values, vectors, count, 0.0)
            if len(found.values) >= min(count, self.count // 2) or asked >= 2 * count:
                break
            asked = 2 * count  # pairs of zeros stand for one free motion each
        return found

    def _free(self, values, vectors):
        """(n,) whether eigenvalues are a free motion's: zero up to the root of K's rounding, as the work of K by it."""
        sizes = np.einsum("ik,ik->k", np.abs(vectors), self._K_sizes @ np.abs(vectors))
        masses = np.einsum("ik,ik->k", vectors.conj(), self.M @ vectors).real
        works = np.abs(np.einsum("ik,ik->k", vectors.conj(), self.K @ vectors))
        return np.maximum(np.abs(values) ** 2 * masses, works) <= _FREE * np.finfo(float).eps * sizes

    def _size_of_lowest(self):
        """About the smallest size of an eigenvalue, by inverse iteration."""
        factors, x = self._factors(_LOW), self._start.standard_normal(self.size)
        for _ in range(3):
            x = self._solved(factors, self.M @ x)
            x /= np.linalg.norm(x)
        return max(_LOW, np.sqrt(abs(x @ (self.K @ x)) / (x @ (self.M @ x))))

    def nearest(self, point, count):
        """The eigenvalues nearest a complex point, in the upper half plane, `Found`, ascending by the distance."""
        values, vectors = self._nearest(complex(point), count, lambda values, shift: abs(values - shift))
        return self._polished(values, vectors, count, point)

    # -- iteration ---------------------------------------------------------------------------------------------------

    def _factors(self, shift):
        """The factors of [[Q(shift), held^T], [held, 0]]."""
        obey()
        Q = shift**2 * self.M + shift * self.C + self.K
        if self.held.shape[0]:
            Q = sparse.bmat([[Q, self.held.T], [self.held, None]])
        return splu(Q.tocsc())

    def _solved(self, factors, b, trans="N"):
        """The block for x of the solution for a right-hand side (size, ...)."""
        obey()
        padded = np.concatenate([b, np.zeros((self.held.shape[0], *b.shape[1:]), b.dtype)])
        return factors.solve(padded, trans)[: self.size]

    def _nearest(self, shift, count, radius):
        """Eigenpairs within the distance from `shift` of `count` wanted ones, beside those found until none follows."""
        factors, n, kind = self._factors(shift), self.size, complex if isinstance(shift, complex) else float

        def applied(z):
            x, v = z[:n], z[n:]
            y = self._solved(factors, -(self.M @ (v + shift * x) + self.C @ x).astype(kind))
            return np.concatenate([y, shift * y + x])

        most = min(self.count, 2 * self.size - 2)
        wanted = min((2 if kind is float else 1) * count, most)
        basis, image, tolerance, reach = np.empty((2 * n, 0), kind), np.empty((2 * n, 0), kind), _TOLERANCE, np.inf
        for _ in range(_LOOKS):
            theta, vectors = self._largest(applied, basis, wanted, tolerance, kind)
            if basis.shape[1]:
                if len(theta) and 1 / np.abs(theta).max() > _BESIDE * reach:
                    break
                if tolerance != _TOLERANCE:
                    tolerance, wanted = _TOLERANCE, 2
                    continue
            basis = self._with(basis, vectors, kind)
            image = np.column_stack([image, *(applied(z)[:, None] for z in basis[:, image.shape[1] :].T)])
            theta, turn = np.linalg.eig(basis.conj().T @ image)
            values, z = shift + 1 / theta, basis @ turn
            upper = values.imag >= -_NEARLY_REAL * np.abs(values)  # rounding may make a pair of two real ones
            order = np.argsort(np.abs(values[upper] - (shift if kind is complex else 0)))
            values, z = values[upper][order], z[:, upper][:, order]
            if basis.shape[1] >= most:
                break
            reach, tolerance, wanted = radius(values[:count], shift).max(initial=0.0), _ROUGH, 2
            if len(values) < count:
                reach, tolerance, wanted = np.inf, _TOLERANCE, 2 * (count - len(values)) + 2
        else:
            raise NotConverged(
                "copies of repeated eigenvalues were not all found. Ask for fewer modes, or another number of elements."
            )
        return values, z[:n]

    def _largest(self, applied, basis, wanted, tolerance, kind):
        """Eigenvalues of the largest size, and vectors, of the operator beside an invariant subspace."""

        def beside(z):
            return z - basis @ (basis.conj().T @ z)

        size = 2 * self.size
        wanted = min(wanted, size - 2 - basis.shape[1])
        operator = LinearOperator((size, size), matvec=lambda z: beside(applied(z.astype(kind))), dtype=kind)
        first = beside(applied(self._start.standard_normal(size).astype(kind)))
        try:
            return eigs(
                operator, wanted, which="LM", v0=first, tol=tolerance, ncv=min(size, max(20, 2 * wanted + 16)),
                maxiter=_RESTARTS,
            )  # fmt: skip
        except ArpackNoConvergence as failed:
            if tolerance == _TOLERANCE and not len(failed.eigenvalues):
                raise NotConverged(
                    "the eigenvalues did not converge. Where a Kelvin-Voigt damping acts, they accumulate at -1/time: "
                    "ask for fewer modes, or for those near= a complex number (1/s)"
                ) from None
            return failed.eigenvalues, failed.eigenvectors

    @staticmethod
    def _with(basis, vectors, kind):
        """An orthonormal basis of one more vectors; of their real and imaginary parts, where it is real."""
        parts = vectors if kind is complex else np.column_stack([vectors.real, vectors.imag])
        for _ in range(2):
            parts = parts - basis @ (basis.conj().T @ parts)
        q, r, _ = linalg.qr(parts, mode="economic", pivoting=True)
        sizes = np.abs(np.diag(r))
        return np.column_stack([basis, q[:, sizes > 1e-8 * sizes.max(initial=0.0)]])

    # -- accuracy ----------------------------------------------------------------------------------------------------

    def _polished(self, values, vectors, count, point):
        """`Found` of the `count` eigenvalues nearest a point: by Rayleigh's quotients with left and right vectors."""
        left, found = np.ones(len(values), dtype=bool), []
        free = np.flatnonzero(self._free(values, vectors))
        if len(free):
            U, sizes, _ = svd(np.column_stack([vectors[:, free].real, vectors[:, free].imag]), False)
            found += [(0j, x.astype(complex), 0.0) for x in U.T[sizes > _SAME_MOTION * sizes[0]]]
            left[free] = False
        most = count + (len(found) if point else 0)  # free motions may be farther from the point than others
        while left.any() and len(found) < most:
            first = np.flatnonzero(left)[0]
            group = np.flatnonzero(left & (np.abs(values - values[first]) <= _ALIKE * np.abs(values[first])))
            found += self._of_group(values[group], vectors[:, group])
            left[group] = False
        found = sorted(found, key=lambda pair: abs(pair[0] - point))[:count]
        values, vectors, rounding = zip(*found, strict=True) if found else ((), np.empty((0, self.size)), ())
        return Found(np.array(values, dtype=complex), np.array(vectors).T, np.array(rounding))

    def _of_group(self, values, X):
        """[(value, vector, rounding error)] of one (multiple) eigenvalue."""
        middle = values.mean()
        X = _real_basis(X / np.linalg.norm(X, axis=0))
        Y = X.conj() if self._symmetric else self._left(middle, X)
        m, c, k = (Y.conj().T @ (a @ X) for a in (self.M, self.C, self.K))
        size, none = len(m), np.zeros_like(m)
        if size == 1:
            roots, turns = np.roots([m[0, 0], c[0, 0], k[0, 0]]), np.ones((1, 2))
        else:
            eye = np.eye(size)
            roots, turns = linalg.eig(np.block([[none, eye], [-k, -c]]), np.block([[eye, none], [none, m]]))
            turns = turns[:size]
        near = np.argsort(np.abs(roots - middle))[:size]
        if size > 1 and not np.iscomplexobj(X) and np.ptp(np.abs(roots[near])) <= _EQUAL * abs(middle):
            turns[:, near] = eye  # real vectors rather than any combinations of them
        weights = np.linalg.pinv(2 * middle * m + c)  # of left vectors, for unit slopes
        bound, found = np.abs(Y) @ np.abs(weights).T, []
        for j in near:
            x = X @ turns[:, j]
            x = x / np.linalg.norm(x)
            value = roots[j]
            scale = np.max(bound.T @ (self._K_sizes @ np.abs(x)))
            error = _SAFETY * _TYPICAL * np.finfo(float).eps * scale
            if abs(value.imag) <= max(_REAL * abs(value), error):
                value = complex(value.real)
            if value.imag >= 0:
                found.append((value, x, error))
        return found

    def _left(self, value, X):
        """Left eigenvectors, by inverse iteration with the transposed matrix next to the eigenvalue."""
        try:
            factors = self._factors(value * (1 + 1e-9))
        except RuntimeError:  # singular to rounding there
            factors = self._factors(value * (1 + 1e-6) + 1e-6 * _LOW)
        Y = X.conj()
        for _ in range(2):
            Y, _ = np.linalg.qr(self._solved(factors, Y.astype(complex), "H"))
        return Y


def _real_basis(X):
    """A real basis of the space of several vectors (size, m), where there is one; else the vectors."""
    if X.shape[1] == 1:
        return X
    U, sizes, _ = svd(np.column_stack([X.real, X.imag]), full_matrices=False)
    m = X.shape[1]
    return U[:, :m] if sizes[m] <= _NO_PART * sizes[0] else X
