"""Stability of an equilibrium by the number of negative eigenvalues of the second variation in (r, theta).

The variations (r, theta) keep |q| = 1, so that a stable state has no negative eigenvalue, whatever the formulation. A
dead moment in space is not conservative and makes the tangent unsymmetric; the eigenvalues of its symmetric part are
counted. In a plane model the second variation decouples into motions in the plane and motions out of it.
"""

import numpy as np
from petsc4py import PETSc

from cosserat_fenicsx.algebra import eigen, linear
from cosserat_fenicsx.algebra.packed import Packed

_ROUNDING = np.finfo(float).eps
_LARGEST_ROW = PETSc.NormType.NORM_INFINITY


class NegativeModes:
    """Counts the negative eigenvalues of the second variation at a problem's state.

    Args:
        problem: a `Problem`; its model carries the second variation, in parts.

    Attributes:
        parts: the `Part`s of the second variation.
        sideways: of the last count, the number of negative eigenvalues of motions out of the plane; 0 in space.
    """

    def __init__(self, problem):
        self.parts = [Part(problem, i) for i in range(len(problem.model.second_variations))]
        self.sideways = 0

    def load(self):
        """Take the numbers of the scene that the model was loaded with."""
        for part in self.parts:
            part.load()

    @property
    def whole(self):
        """The only part of a spatial model, which computes eigenvalues and modes."""
        (part,) = self.parts
        return part

    def count(self, *, neutral=False):
        """Number of negative eigenvalues at the problem's state and load factor.

        Args:
            neutral: whether the eigenvalue nearest zero belongs to a neutral motion (one that leaves the energy as it
                is) and is not counted.

        Returns:
            int, or -1 where the second variation is singular to rounding.
        """
        counts = [part.count(neutral=neutral) for part in self.parts]
        self.sideways = sum(n for n, part in zip(counts, self.parts, strict=True) if part.variation.sideways and n > 0)
        return -1 if -1 in counts else sum(counts)


class Part:
    """A diagonal block of the second variation, decoupled from the other blocks.

    Args:
        problem: a `Problem`.
        index: of the part among its model's `second_variations`.

    Attributes:
        variation: the model's `SecondVariation`.
        K: its matrix; pc: a PETSc preconditioner with the factorisation of K.
    """

    def __init__(self, problem, index):
        self.problem, self.model, self._index = problem, problem.model, index
        self.variation = variation = self.model.second_variations[index]
        tied = variation.tied
        self.K = variation.numbering.matrix(variation.cell_dofs, tied[tied >= 0])
        self.K.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        first, end = self.K.getOwnershipRange()
        self._tied_here = np.flatnonzero((tied.ravel() >= first) & (tied.ravel() < end))
        self._tied_rows = tied.ravel()[self._tied_here] - first
        self._diagonal = self.K.createVecLeft()
        actions = self.model.actions
        moving = (self.model.state, *self.model.carried, *actions.refreshed, *actions.memory_functions)
        self._form = Packed(variation.form, moving)
        self.pc = PETSc.PC().create(self.model.comm)
        linear.factor_second_variation(self.pc, self.K)

    def load(self):
        """Take the numbers of the scene that the model was loaded with."""
        self.variation = self.model.second_variations[self._index]
        self._form.refresh()

    def assemble(self, *, stress_alone=False):
        """The second variation at the problem's state and load factor, in K.

        Args:
            stress_alone: geometric stiffness alone, without the stiffness of sections, supports and joints.
        """
        problem, variation = self.problem, self.variation
        self.K.zeroEntries()
        if stress_alone:
            with self.model.stress_alone():
                self._form.add_to_matrix(self.K)
        else:
            self._form.add_to_matrix(self.K)
        ties, (tied, axes) = problem.ties, (variation.tied, variation.axes)
        if ties:
            ties.add_second_variation(self.K, tied, axes, problem.eta)
        self.K.assemble()
        if ties and not stress_alone:
            ties.add_springs(self.K, tied, axes, problem.eta, self._resistance())
            self.K.assemble()

    def _resistance(self):
        """(tied nodes, block) absolute diagonal entries of K at the nodes with constraints, summed over all ranks."""
        self.K.getDiagonal(self._diagonal)
        found = np.zeros(self.variation.tied.shape)
        found.ravel()[self._tied_here] = np.abs(self._diagonal.array_r[self._tied_rows])
        return self.model.comm.allreduce(found) if self.model.comm.size > 1 else found

    def count(self, *, neutral=False):
        """See `NegativeModes.count`."""
        self.assemble()
        self.pc.setOperators(self.K)
        self.pc.setUp()
        negative, zero, _ = self.pc.getFactorMatrix().getInertia()
        self._negative, self._zero, self._shift = negative, zero, 0.0
        if neutral:
            return negative - int(not zero and self._nearest(1)[0][0] < 0)
        return -1 if zero else negative

    def _nearest(self, count, side=0):
        """(eigenvalues nearest zero, their eigenvectors) at the state of the last count; side: 1, -1 or 0 for both."""
        if self._zero:  # MUMPS drops null pivots from solutions; shifting all eigenvalues leaves the eigenvectors
            self._zero, self._shift = 0, 10 * _ROUNDING * self.K.norm(_LARGEST_ROW)
            self.K.shift(self._shift)
            self.pc.setOperators(self.K)
            self.pc.setUp()
        values, vectors = eigen.nearest_zero(self.K, self.pc, count, side)
        return values - self._shift, vectors

    def is_neutral(self):
        """Whether the eigenvalue nearest zero vanishes to rounding at the problem's state, that of the last count."""
        values, _ = self._nearest(2)
        return abs(values[0]) < 1e-3 * abs(values[-1]) and abs(values[0]) < 30 * _ROUNDING * self.K.norm(_LARGEST_ROW)

    def eigenvalue(self, j):
        """The j-th eigenvalue of the second variation at the problem's state, from 0 in ascending order.

        Only eigenvalues near zero are cheap: all those between it and zero are computed.
        """
        self.count()
        above = j - self._negative  # 0: the smallest positive one, -1: the negative one nearest zero
        needed, side = (1 + above, 1) if above >= 0 else (-above, -1)
        values = self._nearest(needed, side)[0]
        found = np.sort(np.abs(values[values * side >= 0]))
        if len(found) >= needed:
            return float(side * found[needed - 1])
        return float(self._nearest(1)[0][0])  # zero to rounding: factorisation and eigensolver differ in its sign

    def modes(self, count, side=0):
        """The modes of the eigenvalues nearest zero, oriented by `oriented`.

        Args:
            count: number of modes.
            side: 1 or -1 for positive or negative eigenvalues alone; 0 for both.

        Returns:
            Changes of the unknowns, arrays over the entries that this rank owns.
        """
        self.count()
        return oriented(self.model, self._nearest(count, side)[1])


def oriented(model, vectors):
    """Modes of one eigenvalue as changes of the unknowns (owned entries), combined as by `orienting`.

    The largest displacement of each is 1 (in the model's unit of length).
    """
    if not vectors:  # the eigensolver has not converged
        return []
    modes = np.array([model.change_of(vector) for vector in vectors])
    shapes = np.array([model.shape_of(mode) for mode in modes])
    turn = orienting(shapes)
    modes, shapes = turn @ modes, np.tensordot(turn, shapes, 1)
    size = np.linalg.norm(shapes, axis=2).max(axis=1, initial=0)
    return [mode / (s or 1.0) for mode, s in zip(modes, size, strict=True)]


def orienting(shapes):
    """An orthogonal matrix (m, m) to combine the shapes of one eigenvalue by, in a way independent of the eigensolver.

    The node with the largest displacement then moves along the first inertial axis possible, in the positive
    direction, in the first shape alone; likewise for the remaining shapes. A single shape gets its sign thereby.

    Args:
        shapes: (m, N, 3) displacements of all nodes.
    """
    whole = np.eye(len(shapes))
    for k in range(len(shapes)):
        moved = np.einsum("mni,mni->n", shapes[k:], shapes[k:])
        node = np.flatnonzero(moved >= (1 - 1e-6) * moved.max())[0]
        by = shapes[k:, node, :]  # (modes, axes)
        sizes = np.linalg.norm(by, axis=0)
        axis = np.flatnonzero(sizes >= 0.1 * sizes.max())[0]
        turn = np.eye(len(shapes))
        turn[k:, k:] = _towards(by[:, axis])
        whole, shapes = turn @ whole, np.tensordot(turn, shapes, 1)
    return whole


def _towards(a):
    """An orthogonal matrix whose first row is a/|a|."""
    size = np.linalg.norm(a)
    if not size:
        return np.eye(len(a))
    q, r = np.linalg.qr(np.column_stack([a / size, np.eye(len(a))]))
    return (q * np.sign(np.where(np.diag(r) == 0, 1, np.diag(r)))).T
