"""Stability of an equilibrium by the number of negative eigenvalues of the second variation in (r, theta).

The variations (r, theta) keep |q| = 1, so that a stable state has no negative eigenvalue, whatever the formulation. A
dead moment in space is not conservative and makes the tangent unsymmetric; the eigenvalues of its symmetric part are
counted. In a plane model the second variation decouples into motions in the plane and motions out of it.
"""

import contextlib
import math
from functools import cached_property

import numpy as np
from petsc4py import PETSc

from cosserat_fenicsx.algebra import eigen
from cosserat_fenicsx.algebra.building import Packed, Pointers
from cosserat_fenicsx.algebra.elimination import condensed
from cosserat_fenicsx.algebra.equations import COUNT, Called

_ROUNDING = np.finfo(float).eps
_LARGEST_ROW = PETSc.NormType.NORM_INFINITY


class NegativeModes(Called):
    """Counts the negative eigenvalues of the second variation at the state of a `Problem`; sideways, logarithm: of the
    last count, those of motions out of the plane (0 in space), and of the absolute value of the determinant (NaN with a
    neutral motion)."""

    def __init__(self, problem):
        super().__init__()
        self._tensions = problem.tensions
        self.parts = [Part(problem, i) for i in range(len(problem.model.second_variations))]
        self.sideways, self._sideways, self.logarithm = 0, self._ffi.new("int *"), math.nan
        self.c = variation = self._ffi.new("second_variation *")
        variation.parts, variation.self = len(self.parts), self._handle
        variation.hooked = any(part.interface for part in self.parts)
        for k, part in enumerate(self.parts):
            variation.form[k], variation.chain[k] = part.form.c, part.elimination.c
            variation.sideways[k] = part.variation.sideways
            variation.system[k] = part.interface and part.interface.dense or self._ffi.NULL
            variation.tied[k] = part.tied or self._ffi.NULL
        variation.tie_load_factor = self.doubles(problem.load_factor_array)
        if problem.interface and problem.model.name == "spatial" and not problem.model.rows_turn:
            problem.interface.begin_with(self.whole.interface, problem.model.small_motion_maps, self.count)

    def _answer(self, what, a, b):
        self.parts[what - COUNT].complete()

    def load(self):
        """Take the numbers of the scene that the model was loaded with."""
        for part in self.parts:
            part.lacking = None
            part.load()

    @property
    def whole(self):
        """The only part of a spatial model, which computes eigenvalues and modes."""
        (part,) = self.parts
        return part

    def count(self, *, neutral=False):
        """Number of negative eigenvalues at the problem's state, or -1 where the second variation is singular to
        rounding; `neutral`: without the eigenvalue nearest zero, of a motion that leaves the energy unchanged."""
        self.logarithm = math.nan
        if neutral:
            return self.whole.count_without_neutral()
        found = self._lib.negative_modes(self.c, self._sideways)
        self.raise_failure()
        self.sideways, self.logarithm = self._sideways[0], self.c.logarithm
        if self._tensions and found >= 0:
            held, logarithm = self._tensions.pivots()
            self.logarithm += logarithm
            return found - held
        return found


def add_to(K, more):
    """Add a sparse matrix of scipy, the same on all ranks, or None, to one of PETSc."""
    if more is not None and K.comm.rank == 0:
        more = more.tocoo()
        for i, j, value in zip(more.row.tolist(), more.col.tolist(), more.data.tolist(), strict=True):
            K.setValue(i, j, value, addv=PETSc.InsertMode.ADD_VALUES)
    K.assemble()


# Ratio of the bending stiffnesses of the thickest and the thinnest rod from which on the second variation is scaled.
_ALIKE = 1e3


class Part(Pointers):
    """A diagonal block of the second variation, decoupled from the others: one of its model's `second_variations`.

    Attributes:
        variation: the model's `SecondVariation`; form: its `Packed` form.
        elimination, interface: for counts; the latter None where nothing is to be added.
        tied: the C structure `tied_variation` of supports and joints that are no clamps, or None.

    Eigenvalues and eigenvectors y are those of D K D, with the D of `eigen.balance` at the first state of a scene whose
    sections differ much, else of K: as many of them are negative, and D y is the null vector where one vanishes. Those
    of K would be far apart where rods of very different sections meet, and the small negative ones beside them would
    not be found.
    """

    _scale = None

    def __init__(self, problem, index):
        super().__init__()
        self.problem, self.model, self._index = problem, problem.model, index
        self.variation = variation = self.model.second_variations[index]
        self.form = Packed(variation.form, self.model.changing, self.model.constants, symmetric=True)
        self.elimination, self.interface = condensed(
            self.model, variation.numbering, variation.cell_dofs, variation.tied, factors=False
        )
        self.tied = self._tie() if problem.ties else None
        #: of scipy: what is added to K, which counts do not know
        self.lacking = None

    def _tie(self):
        axes, pattern = self.variation.axes, self.model.signature.connections.pattern
        size, count = len(axes), pattern.count
        self._axes, self._blocks = np.array(axes, dtype=float), np.zeros((len(pattern.first), size, size))
        self._resistance, stiffness = np.zeros(count * size), np.zeros(len(pattern.ends))
        tied = self._ffi.new("tied_variation *")
        tied.ties, tied.size, tied.places = self.problem.ties.c, size, self.integers(self.interface.nodes)
        for name, array in (
            ("axes", self._axes), ("blocks", self._blocks), ("resistance", self._resistance), ("stiffness", stiffness),
        ):  # fmt: skip
            setattr(tied, name, self.doubles(array))
        return tied

    @property
    def resistance(self):
        """(tied unknowns,) the last scales of the springs in place of supports and joints, None without these."""
        return self._resistance.copy() if self.tied else None

    def load(self):
        """Take the numbers of the scene that the model was loaded with."""
        self.variation, self._scale = self.model.second_variations[self._index], None
        self.form.refresh()
        if self.tied:
            self._axes[:] = self.variation.axes

    @cached_property
    def K(self):
        """The matrix, assembled at its first use: for eigenvalues and modes."""
        variation = self.variation
        K = variation.numbering.matrix(variation.cell_dofs, variation.tied, self.model.signature.connections.pattern)
        K.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return K

    @cached_property
    def pc(self):
        """A PETSc preconditioner with the factorisation of K."""
        pc = PETSc.PC().create(self.model.comm)
        eigen.factor_second_variation(pc, self.K)
        return pc

    def assemble(self, *, stress_alone=False):
        """Assemble the second variation at the problem's state and load factor in K; `stress_alone`: the geometric
        stiffness, without the stiffness of sections, supports and joints."""
        self.K.zeroEntries()
        with self.model.stress_alone() if stress_alone else contextlib.nullcontext():
            self.form.add_to_matrix(self.K)
        if self.problem.ties:
            if not stress_alone:
                self.elimination.count(self.form)  # for the diagonal that springs are scaled by
            of_ties = self._of_ties(stress_alone)
            if self.model.comm.rank == 0:
                self.problem.ties.add_to_matrix(self.K, self.variation.tied, of_ties)
        add_to(self.K, None if stress_alone else self.lacking)

    def _of_ties(self, stress_alone=False):
        """The part of ties, see `TieRows.second_variation`, after a count of pivots, with springs in their place."""
        problem, comm, diagonal = self.problem, self.model.comm, self.elimination.diagonal
        if stress_alone:
            return problem.ties.second_variation(self.variation.axes, problem.tie_load_factor)
        if comm.size > 1:
            diagonal = comm.allreduce(diagonal)
        diagonal = self._ffi.from_buffer("double[]", diagonal)
        self._lib.hold_variation(self.tied, problem.tie_load_factor, diagonal)
        return self._blocks

    def complete(self):
        """Complete the numbers of negative and zero pivots, which C has counted along this rank's rods."""
        comm, chain = self.model.comm, self.elimination.c
        found = np.array([chain.negative, chain.zero, chain.logarithm])
        if comm.size > 1:
            found = comm.allreduce(found)
        if self.interface:
            of_ties = self._of_ties() if self.problem.ties else np.empty(0)
            found = found + self.interface.signs(of_ties)
        chain.negative, chain.zero, chain.logarithm = int(found[0]), int(found[1]), found[2]

    def count_without_neutral(self):
        return self.factor() - int(not self._zero and self._nearest(1)[0][0] < 0)

    def factor(self):
        """Assemble D K D at the problem's state and factorise it; its number of negative eigenvalues, by the factors
        that give eigenvalues and modes."""
        self.assemble()
        self._scale = self._scale or self._balance()
        self.K.diagonalScale(self._scale, self._scale)
        self.pc.setOperators(self.K)
        self.pc.setUp()
        negative, self._zero, _ = self.pc.getFactorMatrix().getInertia()
        self._shift = 0.0
        return negative

    def _balance(self):
        """D: ones where the sections bend about alike."""
        sizes = self.model.section.J.max(axis=-1)
        sizes = sizes[np.isfinite(sizes) & (sizes > 0)]
        scale = eigen.balance(self.K)
        if not len(sizes) or sizes.max() < _ALIKE * sizes.min():
            scale.set(1.0)
        return scale

    def _nearest(self, count, side=0):
        """(eigenvalues nearest zero, their eigenvectors) of D K D as last factorised; side: 1, -1 or 0 for both."""
        if self._zero:  # MUMPS drops null pivots from solutions
            self._shift_from_zero()
        try:
            values, vectors = eigen.nearest_zero(self.K, self.pc, count, side)
        except (PETSc.Error, SystemError):  # recent releases refuse factors with a pivot that is almost zero
            if self._shift:
                raise
            self._shift_from_zero()
            values, vectors = eigen.nearest_zero(self.K, self.pc, count, side)
        return values - self._shift, vectors

    def _shift_from_zero(self):
        """Shift all eigenvalues by their rounding, which leaves the eigenvectors."""
        self._zero, self._shift = 0, 10 * _ROUNDING * self.K.norm(_LARGEST_ROW)
        self.K.shift(self._shift)
        self.pc.setOperators(self.K)
        self.pc.setUp()

    def is_neutral(self):
        """Whether the eigenvalue nearest zero vanishes to rounding at the problem's state."""
        self.factor()
        values, _ = self._nearest(2)
        return abs(values[0]) < 1e-3 * abs(values[-1]) and abs(values[0]) < 30 * _ROUNDING * self.K.norm(_LARGEST_ROW)

    def eigenvalue(self, j):
        """The j-th eigenvalue, from 0 in ascending order; all between it and zero are computed."""
        above = j - self.factor()  # 0: the smallest positive one, -1: the negative one nearest zero
        needed, side = (1 + above, 1) if above >= 0 else (-above, -1)
        values = self._nearest(needed, side)[0]
        found = np.sort(np.abs(values[values * side >= 0]))
        if len(found) >= needed:
            return float(side * found[needed - 1])
        return float(self._nearest(1)[0][0])  # zero to rounding: factorisation and eigensolver differ in its sign

    def negative_space(self, count):
        """Orthonormal eigenvectors y of the `count` negative eigenvalues at the problem's state, (owned entries,
        count); None where the eigensolver finds another number."""
        if self.factor() != count:
            return None
        values, vectors = self._nearest(count, -1)
        if (values < 0).sum() != count:
            return None
        return np.array([vector.array_r.copy() for vector in vectors]).T

    def modes(self, count, side=0):
        """The `oriented` modes of the eigenvalues nearest zero, changes of the unknowns (owned entries); side: 1 or -1
        for positive or negative eigenvalues alone, 0 for both."""
        self.factor()
        vectors = self._nearest(count, side)[1]
        for vector in vectors:
            vector.pointwiseMult(vector, self._scale)
        return oriented(self.model, vectors)


def oriented(model, vectors):
    """Modes of one eigenvalue as owned unknowns, combined by `orienting`, of the largest displacement 1."""
    if not vectors:  # the eigensolver has not converged
        return []
    modes = np.array([model.change_of(vector) for vector in vectors])
    shapes = np.array([model.shape_of(mode) for mode in modes])
    turn = orienting(shapes)
    modes, shapes = turn @ modes, np.tensordot(turn, shapes, 1)
    size = np.linalg.norm(shapes, axis=2).max(axis=1, initial=0)
    return [mode / (s or 1.0) for mode, s in zip(modes, size, strict=True)]


def orienting(shapes):
    """A unitary matrix (m, m) that makes the shapes (m, N, 3) of one eigenvalue independent of the eigensolver: the
    node with the largest displacement moves along the first inertial axis possible, in the positive direction, in the
    first shape alone; likewise for the remaining shapes. This fixes the sign of a single shape."""
    whole = np.eye(len(shapes))
    for k in range(len(shapes)):
        moved = np.einsum("mni,mni->n", shapes[k:], shapes[k:].conj()).real
        node = np.flatnonzero(moved >= (1 - 1e-6) * moved.max())[0]
        by = shapes[k:, node, :]  # (modes, axes)
        sizes = np.linalg.norm(by, axis=0)
        axis = np.flatnonzero(sizes >= 0.1 * sizes.max())[0]
        turn = np.eye(len(shapes), dtype=shapes.dtype)
        turn[k:, k:] = _towards(by[:, axis])
        whole, shapes = turn @ whole, np.tensordot(turn, shapes, 1)
    return whole


def _towards(a):
    """A unitary matrix whose first row is that of the conjugate of a/|a|."""
    size = np.linalg.norm(a)
    if not size:
        return np.eye(len(a))
    q, r = np.linalg.qr(np.column_stack([a / size, np.eye(len(a))]))
    d = np.where(np.diag(r) == 0, 1, np.diag(r))
    return (q * (d / np.abs(d))).conj().T


# Eigenvalues that differ by less than this, relative, are one multiple eigenvalue.
_SAME = 1e-6
# Largest displacement of a mode of pure twist, over its largest rotation, in the model's unit of length.
_TWIST = 1e-6


def shapes_of(vectors, values, rows, length):
    """(n, N, 6) displacements (m) and rotations (rad) of all nodes, of eigenvectors (n, size) in the numbering of the
    second variation, with their eigenvalues in order; rows: see `RodModel.rows_of_nodes`; length: the model's unit, m.

    The largest displacement of each shape is 1, or its largest rotation times `length` where nothing is displaced.
    Shapes of a multiple eigenvalue are combined by `orienting`.
    """
    found, first = np.zeros((len(vectors), *rows.shape)), 0
    if len(vectors):
        found = np.where(rows >= 0, np.asarray(vectors)[:, rows], 0.0)
    while first < len(found):
        same = int(np.count_nonzero(np.abs(values[first:] - values[first]) <= _SAME * abs(values[first])))
        group = found[first : first + same]
        moved, turned = np.abs(group[:, :, :3]).max(), np.abs(group[:, :, 3:]).max()
        part = slice(0, 3) if moved > _TWIST * turned else slice(3, 6)
        group[:] = np.tensordot(orienting(group[:, :, part]), group, 1)
        first += same
    for shape in found:
        moved, turned = (np.linalg.norm(shape[:, part], axis=1).max() for part in (slice(0, 3), slice(3, 6)))
        shape /= moved if moved > _TWIST * turned else turned
    found[:, :, 3:] /= length
    return found
