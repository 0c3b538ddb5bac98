"""The equations that supports and joints add, in the rows and columns of a solver's matrix."""

import numpy as np
from petsc4py import PETSc

_ADD = PETSc.InsertMode.ADD_VALUES
#: Stiffness that holds an added equation where only the sign of the second variation is asked for, in EI/L^2.
_HELD = 1e8


class TieRows:
    """Added equations of one problem; the last rank does their work.

    Args:
        model: its `rows_of_tied`, `ties`, `tie_maps` and `tied_reference` are used.
        numbering: the problem's `Numbering`.

    Attributes:
        rows: (tied nodes, block) solver's numbers, -1 where clamped.
        seen: (r, q) of the tied nodes and the multipliers as last seen; on the last rank.
    """

    def __init__(self, model, numbering):
        self.model, self.numbering = model, numbering
        self.rows = model.rows_of_tied(numbering).astype(PETSc.IntType)
        self._here = numbering.comm.rank == numbering.comm.size - 1
        count = numbering.multipliers
        self._multipliers = (numbering.first_multiplier + np.arange(count)).astype(PETSc.IntType)
        self._idle = (numbering.first_multiplier + count + np.arange(numbering.idle)).astype(PETSc.IntType)
        wanted = np.concatenate([self.rows[self.rows >= 0], self._multipliers]) if self._here else []
        index = PETSc.IS().createGeneral(np.asarray(wanted, dtype=PETSc.IntType), comm=PETSc.COMM_SELF)
        self._work = PETSc.Vec().createSeq(len(wanted))
        self._scatter = PETSc.Scatter().create(numbering.vector(), index, self._work, None)
        self.seen = None

    def see(self, x):
        """Take the tied nodes' values and the multipliers out of a vector."""
        self._scatter.scatter(x, self._work, False, PETSc.ScatterMode.FORWARD)
        if self._here:
            values, rq = self._work.array_r, self.model.tied_reference.copy()
            free = np.count_nonzero(self.rows >= 0)
            rq[self.rows >= 0] = values[:free]
            self.seen = rq, values[free:].copy()

    def put(self, x, multipliers):
        """Set the multipliers in a vector."""
        if self._here:
            x.setValues(self._multipliers, multipliers)
        x.assemble()

    def everywhere(self):
        """The multipliers as last seen, on all ranks."""
        comm = self.numbering.comm
        return comm.bcast(self.seen[1] if self._here else None, root=comm.size - 1)

    def add_residual(self, b, eta):
        """Add reactions to the rows of the nodes, and the equations in rows of their own."""
        if self._here:
            rq, multipliers = self.seen
            c, gradient, _ = self.model.ties.evaluate(rq, eta, multipliers)
            _, test = self.model.tie_maps(rq)
            reactions = np.einsum("kda,ika,i->kd", test, gradient, multipliers)
            b.setValues(self.rows.ravel(), reactions.ravel(), _ADD)
            b.setValues(self._multipliers, c, _ADD)
        b.assemble()

    def add_tangent(self, A, eta):
        """Add the derivative of `add_residual`."""
        if not self._here:
            return
        rq, multipliers = self.seen
        _, gradient, change = self.model.ties.evaluate(rq, eta, multipliers)
        trial, test = self.model.tie_maps(rq)
        nodes = self.rows.ravel()
        size = len(nodes)
        of_nodes = np.einsum("kda,kalb,lbe->kdle", test, change, trial).reshape(size, size)
        A.setValues(nodes, nodes, of_nodes, _ADD)
        reactions = np.einsum("kda,ika->kdi", test, gradient).reshape(size, -1)
        equations = np.einsum("ikb,kbe->ike", gradient, trial).reshape(-1, size)
        A.setValues(nodes, self._multipliers, reactions, _ADD)
        A.setValues(self._multipliers, nodes, equations, _ADD)
        for rows, value in ((self._multipliers, 0.0), (self._idle, 1.0)):
            for i in rows:
                A.setValue(i, i, value, _ADD)

    def add_second_variation(self, K, rows, eta, *, held=True):
        """Add what the equations mean for stability: held motions become stiff, reactions turn with the nodes.

        Args:
            rows: (tied nodes, 6) numbers in K of (displacement, rotation).
            held: False for the second alone.
        """
        if not self._here:
            return
        rq, multipliers = self.seen
        _, gradient, change = self.model.ties.evaluate(rq, eta, multipliers)
        size = 6 * len(rows)
        gradient, change = gradient.reshape(-1, size), change.reshape(size, size)
        nodes = rows.ravel().astype(PETSc.IntType)
        K.setValues(nodes, nodes, _HELD * held * gradient.T @ gradient + 0.5 * (change + change.T), _ADD)
