"""The equations that supports and joints add, in the rows and columns of a solver's matrix."""

import numpy as np
from petsc4py import PETSc

_ADD = PETSc.InsertMode.ADD_VALUES
#: Stiffness that holds an added equation where only the sign of the second variation is asked for, over that of an element.
_HELD = 1e3
#: A step of Newton's may be wild: its residual is no number then, and SNES stops there without numpy's warnings.
_WILD = {"invalid": "ignore", "over": "ignore"}


class TieRows:
    """Added equations of one problem; the last rank does their work.

    Args:
        model: its `rows_of_tied`, `ties`, `tied_motion`, `tie_maps` and `tied_at_rest` are used.
        numbering: the problem's `Numbering`.

    Attributes:
        rows: (tied nodes, block) solver's numbers, -1 where clamped.
        seen: the tied nodes' unknowns and the multipliers as last seen; on the last rank.
    """

    def __init__(self, model, numbering):
        self.model, self.numbering = model, numbering
        self.rows = model.rows_of_tied.astype(PETSc.IntType)
        self._here = numbering.comm.rank == numbering.comm.size - 1
        links = model.shape.connections
        self._added, self._all = tuple(links.equations), tuple(range(len(links.ties)))
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
            values, nodal = self._work.array_r, self.model.tied_at_rest.copy()
            free = np.count_nonzero(self.rows >= 0)
            nodal[self.rows >= 0] = values[:free]
            multipliers = np.zeros(len(self._all))
            multipliers[list(self._added)] = values[free:]
            self.seen, self._added_values = (nodal, multipliers), (None, None)

    def _evaluate(self, eta):
        """Those that are added, once for residual and tangent."""
        if self._added_values[0] != eta:
            nodal, multipliers = self.seen
            rq = self.model.tied_motion(nodal)
            self._added_values = eta, self.model.ties.evaluate(rq, eta, multipliers[list(self._added)], self._added)
        return self._added_values[1]

    def put(self, x, multipliers):
        """Set the multipliers in a vector."""
        if self._here:
            x.setValues(self._multipliers, multipliers[list(self._added)])
        x.assemble()

    def everywhere(self):
        """The multipliers as last seen, on all ranks."""
        comm = self.numbering.comm
        return comm.bcast(self.seen[1] if self._here else None, root=comm.size - 1)

    def gradients(self):
        """(ties, tied nodes, 6) of all equations where the nodes are, over (displacement, rotation), on all ranks."""
        comm, found = self.numbering.comm, None
        if self._here:
            nodal, multipliers = self.seen
            _, found, _ = self.model.ties.evaluate(self.model.tied_motion(nodal), 0.0, multipliers)
        return comm.bcast(found, root=comm.size - 1)

    @np.errstate(**_WILD)
    def add_residual(self, b, eta):
        """Add reactions to the rows of the nodes, and the equations in rows of their own."""
        if self._here:
            nodal, multipliers = self.seen
            c, gradient, _ = self._evaluate(eta)
            _, test = self.model.tie_maps(nodal)
            reactions = (multipliers[list(self._added)] @ gradient.reshape(len(c), -1)).reshape(-1, 6)
            b.setValues(self.rows.ravel(), (test @ reactions[:, :, None]).ravel(), _ADD)
            b.setValues(self._multipliers, c, _ADD)
        b.assemble()

    @np.errstate(**_WILD)
    def add_tangent(self, A, eta):
        """Add the derivative of `add_residual`."""
        if not self._here:
            return
        of_nodes, reactions, equations = self._derivatives(eta)
        nodes = self.rows.ravel()
        # in C's order: petsc4py takes the numbers as they lie in memory
        A.setValues(nodes, nodes, np.ascontiguousarray(of_nodes), _ADD)
        A.setValues(nodes, self._multipliers, np.ascontiguousarray(reactions), _ADD)
        A.setValues(self._multipliers, nodes, np.ascontiguousarray(equations), _ADD)
        for rows, value in ((self._multipliers, 0.0), (self._idle, 1.0)):
            for i in rows:
                A.setValue(i, i, value, _ADD)

    def _derivatives(self, eta):
        """Of the reactions by the nodes and by the multipliers, and of the equations by the nodes, as matrices."""
        _, gradient, change = self._evaluate(eta)
        trial, test = self.model.tie_maps(self.seen[0])
        return (
            reactions_by_nodes(test, change, trial),
            reactions_by_multipliers(test, gradient),
            by_nodes(gradient, trial),
        )

    def add_second_variation(self, K, rows, axes, eta, *, held=True):
        """Add what the equations mean for stability: held motions become stiff, reactions turn with the nodes.

        All of them count, in the plane and out of it, also those that need no equation in a plane.

        Args:
            rows: (tied nodes, block) numbers in K.
            axes: (block, 6) what K's unknowns are as (displacement, rotation).
            held: False for the second alone.
        """
        if not self._here:
            return
        nodal, multipliers = self.seen
        _, gradient, change = self.model.ties.evaluate(self.model.tied_motion(nodal), eta, multipliers, self._all)
        local = np.max(gradient**2 * self.model.tied_stiffness, axis=(1, 2))
        gradient = (gradient @ axes.T).reshape(len(gradient), -1)
        change = (axes @ (change @ axes.T).reshape(len(rows), 6, -1)).reshape(rows.size, rows.size)
        nodes = rows.ravel().astype(PETSc.IntType)
        held_by = _HELD * held * gradient.T @ (local[:, None] * gradient)
        K.setValues(nodes, nodes, np.ascontiguousarray(held_by + 0.5 * (change + change.T)), _ADD)


def reactions_by_nodes(test, change, trial):
    """The reactions' derivatives, (tied nodes, 6, tied nodes, 6), in rows and columns of the nodes; see `RodModel.tie_maps`."""
    count, size = len(change), len(change) * test.shape[1]
    turned = (test @ change.reshape(count, 6, -1)).reshape(size, count, 6)
    return (turned.swapaxes(0, 1) @ trial).swapaxes(0, 1).reshape(size, -1)


def reactions_by_multipliers(test, gradient):
    """Gradients (ties, tied nodes, 6) as columns on the rows of the nodes."""
    return (test @ gradient.transpose(1, 2, 0)).reshape(-1, len(gradient))


def by_nodes(gradient, trial):
    """Gradients (ties, tied nodes, 6) as rows on the columns of the nodes."""
    return (gradient.swapaxes(0, 1) @ trial).swapaxes(0, 1).reshape(len(gradient), -1)
