"""Stability of an equilibrium by the negative squares of the second variation in (r, theta).

The form never leaves |q| = 1, so that a stable state has none, whatever the formulation. A dead moment in space is not
conservative and makes the tangent unsymmetric; its symmetric part in the rotation variables is what is counted. In a
plane the second variation falls into two parts, the motions in the plane and those out of it.
"""

import numpy as np
from petsc4py import PETSc

from cosserat_fenicsx.algebra import eigen, linear
from cosserat_fenicsx.algebra.packed import Packed

_ROUNDING = np.finfo(float).eps
_LARGEST_ROW = PETSc.NormType.NORM_INFINITY


class NegativeModes:
    """Counts negative squares at a problem's state.

    Args:
        problem: a `Problem`; its model carries the second variation, in parts.

    Attributes:
        parts: the `Part`s of the second variation.
        sideways: how many of the negative squares that were counted last lead out of the plane; 0 in space.
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
        """The one part of a rung in space; eigenvalues and modes are asked of it."""
        (part,) = self.parts
        return part

    def count(self, *, neutral=False):
        """Number of negative squares at the problem's state and load factor.

        Args:
            neutral: whether the eigenvalue next to zero is that of a motion that changes nothing, and does not count.

        Returns:
            int, or -1 where the second variation is singular to round-off.
        """
        counts = [part.count(neutral=neutral) for part in self.parts]
        self.sideways = sum(n for n, part in zip(counts, self.parts, strict=True) if part.variation.sideways and n > 0)
        return -1 if -1 in counts else sum(counts)


class Part:
    """A part of the second variation that decouples from the others.

    Args:
        problem: a `Problem`.
        index: of the part among its model's `second_variations`.

    Attributes:
        variation: the model's `SecondVariation`.
        K: its matrix; pc: the factorisation.
    """

    def __init__(self, problem, index):
        self.problem, self.model, self._index = problem, problem.model, index
        self.variation = variation = self.model.second_variations[index]
        tied = variation.tied
        self.K = variation.numbering.matrix(variation.cell_dofs, tied[tied >= 0])
        self.K.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self._form = Packed(variation.form, (self.model.state, *self.model.carried))
        self.pc = PETSc.PC().create(self.model.comm)
        linear.factor_second_variation(self.pc, self.K)

    def load(self):
        """Take the numbers of the scene that the model was loaded with."""
        self.variation = self.model.second_variations[self._index]
        self._form.refresh()

    def assemble(self, *, stress_alone=False):
        """The second variation at the problem's state and load factor, in K.

        Args:
            stress_alone: leave out what holds whatever the stress: the stiffness of sections, supports and joints.
        """
        problem, variation = self.problem, self.variation
        self.K.zeroEntries()
        if stress_alone:
            with self.model.stress_alone():
                self._form.add_to_matrix(self.K)
        else:
            self._form.add_to_matrix(self.K)
        if problem.ties:
            problem.ties.add_second_variation(
                self.K, variation.tied, variation.axes, problem.load_factor, held=not stress_alone
            )
        self.K.assemble()

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
        """Eigenvalues next to zero, on one side of it or both, and their vectors at the state that was counted last."""
        if self._zero:  # MUMPS leaves null pivots out of its solutions: the same vectors with all eigenvalues shifted
            self._zero, self._shift = 0, 10 * _ROUNDING * self.K.norm(_LARGEST_ROW)
            self.K.shift(self._shift)
            self.pc.setOperators(self.K)
            self.pc.setUp()
        values, vectors = eigen.nearest_zero(self.K, self.pc, count, side)
        return values - self._shift, vectors

    def is_neutral(self):
        """Whether the eigenvalue next to zero is zero to round-off at the problem's state, which was counted last."""
        values, _ = self._nearest(2)
        return abs(values[0]) < 1e-3 * abs(values[-1]) and abs(values[0]) < 30 * _ROUNDING * self.K.norm(_LARGEST_ROW)

    def eigenvalue(self, j):
        """The j-th eigenvalue of the second variation at the problem's state, counted from 0 in ascending order; for
        those next to zero."""
        self.count()
        above = j - self._negative  # 0: the smallest positive one, -1: the negative one next to zero
        needed, side = (1 + above, 1) if above >= 0 else (-above, -1)
        values = self._nearest(needed, side)[0]
        found = np.sort(np.abs(values[values * side >= 0]))
        if len(found) >= needed:
            return float(side * found[needed - 1])
        return float(self._nearest(1)[0][0])  # zero to round-off: the count says one sign, this another

    def modes(self, count, side=0):
        """The modes of the eigenvalues nearest zero, on one side of it or both, as changes of the unknowns (owned numbers),
        see `oriented`."""
        self.count()
        return oriented(self.model, self._nearest(count, side)[1])


def oriented(model, vectors):
    """Modes of one eigenvalue as changes of the unknowns (owned numbers), without the choice that eigensolvers leave.

    They are turned among themselves so that the node that they move farthest moves along the first inertial axis that
    it can move along, in the positive direction, by the first of them alone; and so on. A single mode gets its sign.
    The largest displacement of each is 1 (in the model's unit of length).
    """
    modes = np.array([model.change_of(vector) for vector in vectors])
    shapes = np.array([model.shape_of(mode) for mode in modes])
    for k in range(len(modes)):
        moved = np.einsum("mni,mni->n", shapes[k:], shapes[k:])
        node = np.flatnonzero(moved >= (1 - 1e-6) * moved.max())[0]
        by = shapes[k:, node, :]  # (modes, axes)
        sizes = np.linalg.norm(by, axis=0)
        axis = np.flatnonzero(sizes >= 0.1 * sizes.max())[0]
        turn = _towards(by[:, axis])
        modes[k:], shapes[k:] = turn @ modes[k:], np.tensordot(turn, shapes[k:], 1)
    size = np.linalg.norm(shapes, axis=2).max(axis=1, initial=0)
    return [mode / (s or 1.0) for mode, s in zip(modes, size, strict=True)]


def _towards(a):
    """An orthogonal matrix whose first row is a/|a|."""
    size = np.linalg.norm(a)
    if not size:
        return np.eye(len(a))
    q, r = np.linalg.qr(np.column_stack([a / size, np.eye(len(a))]))
    return (q * np.sign(np.where(np.diag(r) == 0, 1, np.diag(r)))).T
