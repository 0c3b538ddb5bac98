"""The scheme with exact energy and linear momentum; angular momentum to second order (forms/energy.py).

The test functions of the form are variations of (r, q). At every node the variation of q is that by a small rotation
phi, delta q = phi q_m/2 with q_m the mean of q over the step, which is perpendicular to q_m. So three equations belong
to the rotation, |q| = 1 is the fourth equation of the node and needs no multiplier, and loads and supports act as in
the other schemes.
"""

import numpy as np
from petsc4py import PETSc

from cosserat_fenicsx.algebra.packed import Packed
from cosserat_fenicsx.dynamics.steppers.one_step import OneStep
from cosserat_fenicsx.dynamics.steppers.step_problem import StepProblem

_ADD = PETSc.InsertMode.ADD_VALUES
_SAME = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN


class TurnedStepProblem(StepProblem):
    """See `StepProblem`: the rows of q of every node are transformed to those of a rotation, and |q|^2 = 1 is added."""

    def __init__(self, model):
        super().__init__(model)
        numbering, forms = self.numbering, model.forms
        self._nodes = nodes = numbering.nodes
        self._raw, size, first = self.A, numbering.size, numbering.first
        counts = np.ones(size, dtype=PETSc.IntType)
        counts[: 7 * nodes] = 4
        counts[: 7 * nodes].reshape(-1, 7)[:, :3] = 1
        self._rows = np.concatenate([[0], np.cumsum(counts)]).astype(PETSc.IntType)
        node = first + 7 * np.arange(nodes)[:, None]
        q_columns = np.tile(node + np.arange(3, 7), (1, 4))
        columns = np.concatenate([node + np.arange(3), q_columns], axis=1).ravel()
        self._columns = np.concatenate([columns, first + np.arange(7 * nodes, size)]).astype(PETSc.IntType)
        self._turn = PETSc.Mat().createAIJ(((size, numbering.total),) * 2, nnz=4, comm=numbering.comm)
        self._fill(self._turn, np.zeros((nodes, 4, 4)), 1.0)
        Packed(forms.tangent, ()).add_to_matrix(self._raw)
        if self.ties:
            self.ties.make_room(self._raw)
        self._raw.assemble()
        self.A = self._turn.matMult(self._raw)
        self._live_tangent = None
        if forms.live_tangent is not None:
            self._live_matrix = numbering.matrix(model.cell_dofs, np.empty(0, dtype=np.int64))

    def _kind(self):
        return "general"  # PETSc does not store a product of matrices in blocks

    def _ends(self):
        return (*super()._ends(), self.model.turning)

    def _fill(self, matrix, blocks, others, mode=PETSc.InsertMode.INSERT_VALUES):
        """Put blocks (nodes, 4, 4) at the rows and columns of q of the nodes, `others` on the rest of the diagonal."""
        values = np.concatenate([np.full((len(blocks), 3), others), blocks.reshape(-1, 16)], axis=1).ravel()
        rest = np.full(self.numbering.size - 7 * self._nodes, others)
        matrix.setValuesCSR(self._rows, self._columns, np.concatenate([values, rest]), mode)
        matrix.assemble()

    def _pack(self):
        super()._pack()
        self._live_tangent = self._packed_within(self.model.forms.live_tangent)

    def _of_nodes(self, x):
        """(nodes, 4) q of the free nodes of this rank."""
        return x.array_r[: 7 * self._nodes].reshape(-1, 7)[:, 3:]

    def begin_step(self, t, h):
        """See `StepProblem`."""
        self._q_start = self._of_nodes(self.x).copy()
        super().begin_step(t, h)
        self._known.set(0.0)
        self._known.axpy(1.0, self._loads)

    def _put_stresses(self, x, b):
        """See `StepProblem`."""
        self._assemble(self._residual, b)
        q = self._of_nodes(x)
        rows = b.array_w[: 7 * self._nodes].reshape(-1, 7)[:, 3:]
        self._of_q, self._middle, self._q = rows.copy(), (self._q_start + q) / 2, q.copy()
        rows[:, 1:] = np.einsum("nij,nj->ni", _turning(self._middle), self._of_q)
        rows[:, 0] = np.einsum("ni,ni->n", q, q) - 1
        if self._live:
            self._assemble(self._live, self._vector)
            b.axpy(-1.0, self._vector)

    def jacobian(self, snes, x, A, P):
        """See `StepProblem`."""
        if not self.fresh:
            return
        self.fresh = False
        self._raw.zeroEntries()
        self._tangent.catch_up()
        self._tangent.add_to_matrix(self._raw)
        self._raw.assemble()
        blocks = np.zeros((self._nodes, 4, 4))
        blocks[:, 1:] = _turning(self._middle)
        self._fill(self._turn, blocks, 1.0)
        self._turn.matMult(self._raw, result=P)
        blocks[:, 0] = 2 * self._q
        blocks[:, 1:] = _turning_of(self._of_q)
        self._fill(P, blocks, 0.0, _ADD)
        if self._live_tangent:
            self._live_matrix.zeroEntries()
            self._live_tangent.catch_up()
            self._live_tangent.add_to_matrix(self._live_matrix)
            self._live_matrix.assemble()
            P.axpy(-1.0, self._live_matrix, _SAME)
        if self.ties:
            self.ties.add_tangent(P, self.load_factor)
        P.assemble()


def _turning(q):
    """(nodes, 3, 4): maps residuals of q to those of a rotation: the transpose of phi -> phi q/2."""
    v = q[:, 1:]
    turning = np.zeros((len(q), 3, 4))
    turning[:, :, 0] = -v
    turning[:, [0, 1, 2], [1, 2, 3]] = q[:, :1]
    turning[:, 0, 2], turning[:, 0, 3] = -v[:, 2], v[:, 1]
    turning[:, 1, 1], turning[:, 1, 3] = v[:, 2], -v[:, 0]
    turning[:, 2, 1], turning[:, 2, 2] = -v[:, 1], v[:, 0]
    return turning / 2


def _turning_of(R):
    """(nodes, 3, 4): the derivative of `_turning`((q_0 + q)/2) R with respect to q, for residuals R (nodes, 4) of q."""
    v = R[:, 1:]
    change = np.zeros((len(R), 3, 4))
    change[:, :, 0] = v
    change[:, [0, 1, 2], [1, 2, 3]] = -R[:, :1]
    change[:, 0, 2], change[:, 0, 3] = v[:, 2], -v[:, 1]
    change[:, 1, 1], change[:, 1, 3] = -v[:, 2], v[:, 0]
    change[:, 2, 1], change[:, 2, 2] = v[:, 1], -v[:, 0]
    return change / 4


class Energy(OneStep):
    """See `protocol.Stepper`."""

    forms, problem_class = "energy", TurnedStepProblem
    error_ratio = 4.0  # the error is larger since averaged directors are shorter than one
