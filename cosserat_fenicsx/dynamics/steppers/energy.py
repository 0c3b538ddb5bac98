"""The scheme with exact energy and linear momentum; angular momentum to second order (forms/energy.py).

The test functions of the form are variations of (r, q). At every node the variation of q is that by a small rotation
phi, delta q = phi q_m/2 with q_m the mean of q over the step, which is perpendicular to q_m. So three equations belong
to the rotation, |q| = 1 is the fourth equation of the node and needs no multiplier, and loads and supports act as in
the other schemes.
"""

import numpy as np

from cosserat_fenicsx.algebra.equations import MATRICES, RESIDUAL
from cosserat_fenicsx.dynamics.steppers.one_step import OneStep
from cosserat_fenicsx.dynamics.steppers.step_problem import StepProblem


class TurnedStepProblem(StepProblem):
    """See `StepProblem`: the rows of q of every node are transformed to those of a rotation, and |q|^2 = 1 is added."""

    changes = RESIDUAL | MATRICES

    def __init__(self, model):
        super().__init__(model)
        self._q_of_elements = model.cell_dofs.reshape(len(model.cell_dofs), model.cell_dofs.shape[1] // 7, 7)[:, :, 3:]
        self._of_q = np.zeros(len(self._state))
        # a node's own terms are shared among all elements that meet there
        meeting = np.zeros(len(self._state))
        np.add.at(meeting, self._q_of_elements.ravel(), 1.0)
        self.numbering.add_up(meeting, self._vector)
        self.numbering.to_local(self._vector, meeting)
        self._share = 1 / np.maximum(1.0, meeting[self._q_of_elements[..., :1]])

    def _pack(self):
        super()._pack()
        self._live_tangent = self._pack_form(self.model.forms.live_tangent)

    def _of_nodes(self, x):
        """(nodes, 4) q of the free nodes of this rank."""
        nodes = self.numbering.nodes
        return x[: 7 * nodes].reshape(-1, 7)[:, 3:]

    def begin_step(self, t, h):
        """See `StepProblem`."""
        self._q_start = self._of_nodes(self.x.array_r).copy()
        super().begin_step(t, h)
        self._known.set(0.0)
        self._known.axpy(1.0, self._loads)

    def _change_residual(self, x, b):
        q, rows = self._of_nodes(x), self._of_nodes(b)
        self._vector_of_x.array_w[:] = b
        self.numbering.to_local(self._vector_of_x, self._of_q)
        of_q = rows.copy()
        rows[:, 1:] = np.einsum("nij,nj->ni", _turning((self._q_start + q) / 2), of_q)
        rows[:, 0] = np.einsum("ni,ni->n", q, q) - 1
        if self._live:
            self._assemble(self._live, self._vector)
            b += self._vector.array_r
        super()._change_residual(x, b)

    def _change_matrices(self):
        places, share = self._q_of_elements, self._share
        q, start = self._state[places], self._start[places]  # (elements, nodes, 4)
        elements, nodes, width = *places.shape[:2], 7 * places.shape[1]
        rows = self.matrices.reshape(elements, nodes, 7, width)
        turned = _turning(((start + q) / 2).reshape(-1, 4)).reshape(elements, nodes, 3, 4)
        rows[:, :, 4:] = turned @ rows[:, :, 3:]
        rows[:, :, 3] = 0.0
        own = _turning_of(self._of_q[places].reshape(-1, 4)).reshape(elements, nodes, 3, 4)
        for k in range(nodes):
            columns = slice(7 * k + 3, 7 * k + 7)
            rows[:, k, 3, columns] += 2 * q[:, k] * share[:, k]
            rows[:, k, 4:, columns] += own[:, k] * share[:, k, :, None]
        if self._live_tangent:
            self.matrices += self._live_tangent.matrices()


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
