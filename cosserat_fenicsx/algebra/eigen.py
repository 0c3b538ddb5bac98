"""Assembled matrices: their eigenvalues by SLEPc, which no other file imports, and the direct solver for each kind."""

import math
import threading
import weakref
from pathlib import Path

import numpy as np
from petsc4py import PETSc
from slepc4py import SLEPc

from cosserat_fenicsx.interrupts import obey

_TOLERANCE = 1e-12
# Tolerance for eigenvalues of unsymmetric pencils; and the relative distance from the real axis, and from the matching
# eigenvalue of the transposed pencil, below which an eigenvalue counts as real and as genuine. Ill-conditioned ones
# exceed it.
_UNSYMMETRIC, _REAL = 1e-10, 1e-5
# Largest dimension of the projected problem, because its dense solution cannot be interrupted.
_PROJECTED = 400
# Tolerance where eigenvalues of the other sign may lie much nearer to zero: their rounding limits the accuracy.
_COARSE = 1e-9
# Fewest unknowns of a matrix whose factors are kept for later ones; the relative residual of a solution with factors of
# an earlier matrix, also where Newton's method corrects what it leaves, and in a step by the tangent of the one before,
# which is taken only where it hardly moves; and the iterations that cost less than new factors.
_KEPT, _REUSED, _CORRECTED, _SLIGHT, _MOST_REUSES = 2000, 1e-10, 1e-7, 1e-2, 12
# % extra memory for fill-in, too little of which fails without a message, where pivots are exchanged and where not; and
# the smallest pivot of a matrix with a diagonal of ones that is positive definite beyond doubt.
_EXCHANGE, _NO_EXCHANGE, _SURELY = 200, 20, 1e-9
# MUMPS's errors of matrices that are singular, by their pattern or by their numbers.
_SINGULAR = (-6, -10)


class _Inverse:
    """The inverse of a factored matrix as a matrix and a preconditioner; signals are handled where SLEPc calls it."""

    def __init__(self, pc):
        self._pc = pc

    def mult(self, mat, x, y):
        """PETSc's name for y = K^-1 x."""
        obey()
        self._pc.apply(x, y)

    def apply(self, pc, x, y):
        """PETSc's name for the same as a preconditioner."""
        self.mult(None, x, y)


def nearest_zero(K, pc, count, side=0):
    """Eigenvalues of a symmetric matrix K next to zero, from an existing factorisation, a PC: (values (n,), PETSc
    vectors of unit norm), nearest first, n <= count; side: 1 for positive ones, -1 for negative ones, 0 for both."""
    inverse = PETSc.Mat().createPython(K.getSizes(), _Inverse(pc), comm=K.comm)
    inverse.setUp()
    solver = SLEPc.EPS().create(K.comm)
    solver.setOperators(inverse)
    which = SLEPc.EPS.Which
    where = {0: which.LARGEST_MAGNITUDE, 1: which.LARGEST_REAL, -1: which.SMALLEST_REAL}[side]
    tolerance = _COARSE if side else _TOLERANCE
    values, vectors = _solve(solver, SLEPc.EPS.ProblemType.HEP, where, count, K, tolerance=tolerance)
    return 1 / values, vectors


def largest_of_pencil(A, B, count, least):
    """The largest eigenvalues nu > least > 0 of A x = nu B x, A symmetric, B symmetric and positive definite: (values
    (n,), vectors), the largest first, n <= count; smaller ones than `least` may be among them.

    How many are above `least` is counted first, by Sylvester's law of inertia: an iteration that looks for more of them
    would continue among the others, which may lie close together.
    """
    if A.norm() == 0:
        return np.empty(0), []
    A, B, scale = _balanced(A, B)
    B.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    count = min(count, _above(A, B, least))
    if not count:
        return np.empty(0), []
    solver, pc = _of_pencil(A, B, factor_second_variation)
    values, vectors = _solve(solver, SLEPc.EPS.ProblemType.GHEP, SLEPc.EPS.Which.LARGEST_REAL, count, A)
    pc.destroy()
    return values, _in_units(vectors, scale)


def _above(A, B, least):
    """How many eigenvalues of the symmetric pencil A x = nu B x are above `least` > 0."""
    matrix = A.copy()
    matrix.aypx(-1 / least, B)  # B - A/least
    pc = constrained_factors(matrix)
    negative = pc.getFactorMatrix().getInertia()[0]
    pc.destroy()
    return negative


def _balanced(A, B):
    """(D A D, D B D, D) with the D of `balance` of B."""
    A, B, scale = A.copy(), B.copy(), balance(B)
    for matrix in (A, B):
        matrix.diagonalScale(scale, scale)
    return A, B, scale


def balance(K):
    """The diagonal D > 0, a vector, that makes the diagonal of D K D about 1.

    The unknowns of thick and of thin rods then count alike, whatever their units: PETSc's Cholesky factorisation takes
    small pivots for zero, and Krylov spaces find large eigenvalues slowly. D holds powers of two, so that nothing is
    rounded.
    """
    scale = K.getDiagonal()
    sizes = np.abs(scale.array_r)
    scale.array_w[:] = np.exp2(np.round(-0.5 * np.log2(np.where(sizes > 0, sizes, 1.0))))
    return scale


def _in_units(vectors, scale):
    """Eigenvectors D y, of unit norm, of those y of the balanced pencil."""
    for vector in vectors:
        vector.pointwiseMult(vector, scale)
        vector.normalize()
    return vectors


def real_of_pencil(A, B, count):
    """Real positive eigenvalues nu of A x = nu B x, both unsymmetric, among the `count` of the largest magnitude:
    (values (n,), PETSc vectors of unit norm), the largest first. Those of a non-normal pencil may be artefacts of
    rounding, which differ between the pencil and its transpose, and are discarded."""
    A, B, scale = _balanced(A, B)
    (values, vectors), (others, _) = (
        _unsymmetric(a, b, count) for a, b in ((A, B), (A.copy().transpose(), B.copy().transpose()))
    )
    off = [max(abs(value.imag), np.abs(others - value).min(initial=np.inf)) for value in values]
    real = [k for k, value in enumerate(values) if off[k] <= _REAL * value.real]
    real.sort(key=lambda k: -values[k].real)
    return values[real].real, _in_units([vectors[k] for k in real], scale)


def _unsymmetric(A, B, count):
    """(values (n,), complex; real or imaginary parts of eigenvectors) of the eigenvalues of largest magnitude."""
    solver, pc = _of_pencil(A, B, factor_general)
    which = SLEPc.EPS.Which.LARGEST_MAGNITUDE
    found = _solve(solver, SLEPc.EPS.ProblemType.GNHEP, which, count, A, tolerance=_UNSYMMETRIC)
    pc.destroy()
    return found


def _of_pencil(A, B, factor):
    """An eigensolver of A x = nu B x, and the PC with the factors of B that it applies."""
    solver = SLEPc.EPS().create(A.comm)
    solver.setOperators(A, B)
    pc = PETSc.PC().create(A.comm)
    pc.setOperators(B)
    factor(pc, B)
    pc.setUp()
    ksp = solver.getST().getKSP()
    ksp.setType("preonly")
    ksp.getPC().setType("python")
    ksp.getPC().setPythonContext(_Inverse(pc))
    return solver, pc


def largest_of_operator(operator, size, count, known):
    """Eigenvalues of the largest magnitude of a symmetric operator with `mult(mat, x, y)`, on this rank alone: (values
    (n,), vectors (size, n) of unit norm), the largest first, n <= count; known: (size, k) eigenvectors of unit norm,
    which are excluded."""
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
    projected = min(size, max(2 * count, count + 15), _PROJECTED)
    solver.setDimensions(count, min(size, max(2 * count, count + 15), count + projected), projected)
    solver.setTolerances(tolerance, 500)
    start = like.createVecRight()
    first, last = start.getOwnershipRange()
    start.array_w[:] = 1 + np.sin(np.arange(first, last) + 1.0)  # the same in every run and on any number of ranks
    solver.setInitialSpace([start])
    try:
        solver.solve()
    except (KeyboardInterrupt, PETSc.Error, SystemError):
        solver.incRef()  # destroying an interrupted solver would raise an error
        obey()  # recent petsc4py replaces an exception of a callback by its own, and slepc4py 3.25 that by SystemError
        raise
    found = min(solver.getConverged(), count)
    values, vectors = np.zeros(found, dtype=complex), []
    for i in range(found):
        parts = like.createVecRight(), like.createVecRight()
        values[i] = solver.getEigenpair(i, *parts)
        vector = parts[int(values[i].imag < 0)]  # real part for one of a conjugate pair, imaginary part for the other
        vector.normalize()
        vectors.append(vector)
    solver.destroy()
    return (values if kind == SLEPc.EPS.ProblemType.GNHEP else values.real), vectors


def factor_general(pc, A):
    """Set an LU factorisation with pivoting over the whole matrix."""
    pc.setType("lu")
    if A.comm.size > 1:
        _mumps(pc, A)
    else:
        pc.setFactorSolverType("klu")


def factor_second_variation(pc, K):
    """Set a factorisation that gives the inertia of the matrix, i.e. its number of negative eigenvalues."""
    if K.comm.size == 1:
        pc.setType("cholesky")
        pc.setFactorOrdering("nd")
    else:
        _factor_constrained(pc, K)


def constrained_factors(matrix, null=0.0):
    """A PC with the factors of a symmetric matrix (of PETSc, or scipy's csr on this rank alone) whose diagonal may be
    zero because of constraint equations; null: pivots below this count as zero; 0.0 for a threshold of rounding,
    relative to the largest row."""
    A = matrix
    if not isinstance(matrix, PETSc.Mat):
        parts = matrix.indptr.astype(PETSc.IntType), matrix.indices.astype(PETSc.IntType), matrix.data
        A = PETSc.Mat().createAIJ(matrix.shape, csr=parts, comm=PETSc.COMM_SELF)
    A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    pc = PETSc.PC().create(A.comm)
    _factor_constrained(pc, A, null)
    pc.setUp()
    if A is not matrix:
        A.destroy()  # the PC keeps it
    return pc


def reference_blas():
    """Whether this process has loaded netlib's reference BLAS, which is slow; False where the system does not say."""
    try:
        return "/blas/libblas.so" in Path("/proc/self/maps").read_text(encoding="utf-8")
    except OSError:
        return False


class RepeatedInertia:
    """Eigenvalues' signs of symmetric matrices of one pattern on this rank, with a diagonal of ones or zeros; the
    symbolic analysis is made once. Factors with pivots of two rows too are made from the first matrix on that is not
    surely positive definite. Arguments: see `RepeatedFactors` and `constrained_factors`. regular: whether there are
    factors, of a matrix without null pivots; counts: how many matrices there were. Problems and threads may share it,
    see `inertia_of`."""

    # without a __dict__, so that the pool, which takes one problem apart, leaves it to the others
    __slots__ = ("regular", "counts", "_definite", "_null", "_pattern", "_matrix", "_b", "_x", "_pc", "_scale", "_lock",
                 "__weakref__")  # fmt: skip

    def __init__(self, starts, columns, null):
        self.regular, self.counts, self._definite, self._null = False, 0, True, null
        self._lock = threading.Lock()
        self._pattern = starts.astype(PETSc.IntType), columns.astype(PETSc.IntType)
        size, entries = len(starts) - 1, np.ones(len(columns))
        self._matrix = PETSc.Mat().createAIJ((size, size), csr=(*self._pattern, entries), comm=PETSc.COMM_SELF)
        self._b, self._x = self._matrix.createVecs()
        self._matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self._begin()

    def _begin(self):
        """Factors to be, of a matrix that is positive definite or not."""
        self._matrix.setOption(PETSc.Mat.Option.SPD, self._definite)
        self._pc = PETSc.PC().create(PETSc.COMM_SELF)
        if self._definite:
            _factor_symmetric(self._pc, self._matrix, _NO_EXCHANGE)
        else:
            _factor_constrained(self._pc, self._matrix, self._null)

    def _factored(self):
        self._pc.setOperators(self._matrix)
        self._pc.setUp()
        factor = self._pc.getFactorMatrix()
        return factor, factor.getMumpsInfog(12), factor.getMumpsInfog(28)

    def of(self, values, scale):
        """(negative, zero) numbers of eigenvalues of the matrix of these entries, and the logarithm of the absolute
        value of its determinant, NaN where it is singular; scale: (rows,) what its rows and columns were multiplied by,
        for `solve`."""
        with self._lock:
            return self._of(values, scale)

    def _of(self, values, scale):
        self.regular, self._scale = False, scale
        self.counts += 1
        self._matrix.setValuesCSR(*self._pattern, values)
        self._matrix.assemble()
        factor, negative, zero = self._factored()
        if self._definite and (factor.getMumpsInfog(1) < 0 or negative or factor.getMumpsRinfog(19) < _SURELY):
            self._definite = False
            self._pc.destroy()
            self._begin()
            factor, negative, zero = self._factored()
        self.regular = factor.getMumpsInfog(1) >= 0 and not zero
        part, power = abs(factor.getMumpsRinfog(12)), factor.getMumpsInfog(34)  # the determinant: part times 2^power
        return negative, zero, math.log(part) + power * math.log(2) if part and not zero else math.nan

    def serves(self, starts, columns, null):
        """Whether matrices of a pattern are those that it was made for."""
        given = zip(self._pattern, (starts, columns), strict=True)
        return self._null == null and all(np.array_equal(own, other) for own, other in given)

    def solve(self, b):
        """The solution (rows,) of the last matrix, before it was scaled; only where it is `regular`."""
        with self._lock:
            self._b.array_w[:] = b * self._scale
            self._pc.apply(self._b, self._x)
            return self._x.array_r * self._scale


class _Last(threading.local):
    """The last `RepeatedInertia` of a thread, by a weak reference: its factors go with the last problem of it."""

    found = staticmethod(lambda: None)


_LAST = _Last()


def inertia_of(starts, columns, null):
    """The `RepeatedInertia` for a pattern, that of the last one where it is the same: the equations where rods meet are
    those of a coarser mesh, whose factors serve on a finer one."""
    found = _LAST.found()
    if found is None or not found.serves(starts, columns, null):
        found = RepeatedInertia(starts, columns, null)
        _LAST.found = weakref.ref(found)
    return found


def gmres(matrix, most):
    """PETSc's GMRES on this rank, of at most that many iterations, preconditioned from the right."""
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setType("gmres")
    ksp.setPCSide(PETSc.PC.Side.RIGHT)
    ksp.setTolerances(atol=0.0, max_it=most)
    ksp.setOperators(matrix)
    return ksp


class RepeatedFactors:
    """Solves with sparse matrices of one pattern on this rank, by LU factors; its symbolic analysis is made once.

    Factors of a large matrix are kept while the matrices change little: they precondition GMRES, until it needs so many
    iterations that new factors are cheaper. starts (rows + 1,), columns (entries,): the pattern, by rows. near: None,
    or what nearly is the inverse, taken instead of the first factors: `take(values)` the entries of a matrix, whether
    it is known; `apply(pc, b, x)` of PETSc's vectors; and `leave()`, called where GMRES does not converge with it.
    """

    def __init__(self, starts, columns, near=None):
        size = len(starts) - 1
        self._pattern = starts.astype(PETSc.IntType), columns.astype(PETSc.IntType)
        entries = *self._pattern, np.ones(len(columns))
        self._matrix = PETSc.Mat().createAIJ((size, size), csr=entries, comm=PETSc.COMM_SELF)
        self._b, self._x = self._matrix.createVecs()
        self._keeps, self._old, self._ksp = size >= _KEPT, None, None  # `_old`: are the factors of an earlier matrix?
        self._near, self._by_near = near if self._keeps else None, None
        if self._near:
            self._by_near = gmres(self._matrix, _MOST_REUSES)
            self._by_near.getPC().setType("python")
            self._by_near.getPC().setPythonContext(near)

    def _begin(self):
        """A solver without factors; one that failed keeps its error."""
        if self._ksp is not None:
            self._ksp.destroy()
        self._ksp = gmres(self._matrix, _MOST_REUSES)
        self._pc = self._ksp.getPC()
        self._pc.setType("lu")
        self._factor = _mumps(self._pc, self._matrix)

    def factor(self, values):
        """Take the matrix of these entries (entries,); False where it is found to be singular."""
        self._matrix.setValuesCSR(*self._pattern, values)
        self._matrix.assemble()
        self._solved = False
        if self._old is not None:
            self._old = True
        self._taken = bool(self._near) and self._near.take(values)
        return self._taken or (self._keeps and bool(self._old)) or self._renewed()

    def _renewed(self):
        if self._ksp is None:  # made at first use, with the memory for factors
            self._begin()
        self._pc.setReusePreconditioner(False)
        self._pc.setOperators(self._matrix)
        self._pc.setUp()
        self._pc.setReusePreconditioner(True)
        failure = self._factor.getMumpsInfog(1)
        self._old = False if failure >= 0 else None
        if failure < 0:
            self._begin()
        if failure < 0 and failure not in _SINGULAR:
            raise MemoryError(f"MUMPS cannot factorise the equations where rods meet (its error {failure})")
        return failure >= 0

    def solve(self, b, corrected=False):
        """The solution (rows,) for a right-hand side; not a number where the matrix is singular after all. corrected:
        whether Newton's method corrects what it leaves, once or by a second solution with this matrix."""
        limit = (_SLIGHT if self._solved else _CORRECTED) if corrected else _REUSED
        self._solved = True

        def found(ksp):
            ksp.setTolerances(rtol=limit)
            ksp.solve(self._b, self._x)
            return ksp.getConvergedReason() > 0

        self._b.array_w[:] = b
        if self._taken:
            if found(self._by_near):
                return self._x.array_r
            self._near.leave()
            self._taken = False
            if self._old is None and not self._renewed():
                return np.full(len(b), np.nan)
        if self._old:
            if found(self._ksp):
                return self._x.array_r
            if not self._renewed():
                return np.full(len(b), np.nan)
        self._pc.apply(self._b, self._x)
        return self._x.array_r

    def destroy(self):
        """Free the memory, which PETSc may keep otherwise."""
        for part in (self._ksp, self._matrix, self._b, self._x):
            if part is not None:
                part.destroy()


def _factor_symmetric(pc, K, more=_EXCHANGE):
    pc.setType("cholesky")
    factor = _mumps(pc, K, more)
    factor.setMumpsIcntl(13, 1)  # root front not distributed: otherwise some negative pivots are not counted
    factor.setMumpsIcntl(6, 0)  # no search for a large diagonal, which fails where a row is zero
    factor.setMumpsIcntl(33, 1)  # the determinant
    return factor


def _factor_constrained(pc, K, null=0.0):
    factor = _factor_symmetric(pc, K)
    factor.setMumpsIcntl(24, 1)  # null pivots are counted separately
    factor.setMumpsCntl(3, -null)


def _mumps(pc, A, more=_EXCHANGE):
    pc.setOperators(A)
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    factor = pc.getFactorMatrix()
    factor.setMumpsIcntl(14, more)
    return factor
