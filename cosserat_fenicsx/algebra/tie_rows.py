"""The constraint equations of supports and joints, in the rows and columns of a solver's matrix."""

import numpy as np
from petsc4py import PETSc

_ADD = PETSc.InsertMode.ADD_VALUES
#: Penalty stiffness that replaces a constraint in the second variation, over the stiffness of the elements there.
_HELD = 1e3
#: A diverging Newton step may overflow: the residual is then not a number, which stops SNES; numpy need not warn.
_WILD = {"invalid": "ignore", "over": "ignore"}


class TieRows:
    """Constraint equations of one problem; the last rank evaluates them.

    Args:
        model: its `rows_of_tied`, `ties`, `held_forces`, `tied_motion`, `tie_maps` and `tied_at_rest` are used.
        numbering: the problem's `Numbering`.

    Attributes:
        rows: (tied nodes, block) solver's numbers, -1 where clamped.
        seen: the tied nodes' unknowns and the multipliers, as of the last call of `see`; on the last rank.
    """

    def __init__(self, model, numbering):
        self.model, self.numbering = model, numbering
        self.rows = model.rows_of_tied.astype(PETSc.IntType)
        # PETSc skips rows numbered -1 in a matrix, but in a vector it would write in front of the array
        self._free = np.flatnonzero(self.rows >= 0)
        self._free_rows = self.rows.ravel()[self._free]
        self._here = numbering.comm.rank == numbering.comm.size - 1
        links = model.signature.connections
        self._added, self._all = tuple(links.equations), tuple(range(len(links.ties)))
        self._which = np.array(self._added, dtype=np.intp)
        place = {vertex: i for i, vertex in enumerate(links.tied)}
        stations = np.array([(place[a], place.get(b, -1)) for _, a, b in links.ties]).reshape(-1, 2)
        # for every added equation: its row and its two stations in the gradients, and the sign of its reaction
        rows, ends = np.arange(len(self._added))[:, None], stations[self._which]
        self._exerted = rows, ends, np.where(ends >= 0, -1.0, 0.0)
        count = numbering.multipliers
        self._multipliers = (numbering.first_multiplier + np.arange(count)).astype(PETSc.IntType)
        wanted = np.concatenate([self.rows[self.rows >= 0], self._multipliers]) if self._here else []
        index = PETSc.IS().createGeneral(np.asarray(wanted, dtype=PETSc.IntType), comm=PETSc.COMM_SELF)
        self._work = PETSc.Vec().createSeq(len(wanted))
        self._scatter = PETSc.Scatter().create(numbering.vector(), index, self._work, None)
        self.seen = None

    def see(self, x):
        """Copy the tied nodes' unknowns and the multipliers from a vector."""
        self._scatter.scatter(x, self._work, False, PETSc.ScatterMode.FORWARD)
        if self._here:
            values, nodal = self._work.array_r, self.model.tied_at_rest.copy()
            free = np.count_nonzero(self.rows >= 0)
            nodal[self.rows >= 0] = values[:free]
            multipliers = np.zeros(len(self._all))
            multipliers[list(self._added)] = values[free:]
            self.seen, self._added_values, self._all_values = (nodal, multipliers), (None, None), (None, None)

    def _evaluate(self, eta):
        """Values and derivatives of the equations that are added, evaluated once for residual and tangent."""
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
        """The multipliers as of the last call of `see`, on all ranks."""
        comm = self.numbering.comm
        if comm.size == 1:
            return self.seen[1]
        return comm.bcast(self.seen[1] if self._here else None, root=comm.size - 1)

    def forces(self, eta):
        """See `Equations.tie_forces`; at the state of the last call of `see`."""
        comm, found = self.numbering.comm, None
        if self._here:
            found, (rows, ends, signs) = np.zeros((len(self._all), 2, 6)), self._exerted
            _, gradient, _ = self._evaluate(eta)
            forces = gradient[rows, ends] * (signs * self.seen[1][self._which, None])[..., None]
            found[self._which] = self.model.held_forces(forces)
        return comm.bcast(found, root=comm.size - 1) if comm.size > 1 else found

    def gradients(self):
        """(ties, tied nodes, 6) gradients of all equations by (displacement, rotation), on all ranks."""
        comm, found = self.numbering.comm, None
        if self._here:
            nodal, multipliers = self.seen
            _, found, _ = self.model.ties.evaluate(self.model.tied_motion(nodal), 0.0, multipliers)
        return comm.bcast(found, root=comm.size - 1)

    @np.errstate(**_WILD)
    def add_residual(self, b, eta):
        """Add the reactions to the rows of the nodes, and the constraint equations in the rows of the multipliers."""
        if self._here:
            nodal, multipliers = self.seen
            c, gradient, _ = self._evaluate(eta)
            _, test = self.model.tie_maps(nodal)
            reactions = np.tensordot(multipliers[list(self._added)], gradient, 1)
            b.setValues(self._free_rows, (test @ reactions[:, :, None]).ravel()[self._free], _ADD)
            b.setValues(self._multipliers, c, _ADD)
        b.assemble()

    @np.errstate(**_WILD)
    def tangent_blocks(self, eta):
        """The derivative of `add_residual` on the last rank, see `Interface.matrix`."""
        return self._derivatives(eta) if self._here else None

    def _derivatives(self, eta):
        """Derivatives of the reactions by nodes and by multipliers, and of the equations by nodes, as matrices."""
        _, gradient, change = self._evaluate(eta)
        nodal, multipliers = self.seen
        trial, test = self.model.tie_maps(nodal)
        of_nodes = reactions_by_nodes(test, change, trial)
        if self.model.rows_turn:
            reactions = np.tensordot(multipliers[list(self._added)], gradient, 1)
            places = np.arange(len(of_nodes)).reshape(len(nodal), -1)
            of_nodes[places[:, :, None], places[:, None, :]] += self.model.turned_reactions(nodal, reactions)
        return of_nodes, reactions_by_multipliers(test, gradient), by_nodes(gradient, trial)

    def second_variation(self, axes, eta):
        """The geometric stiffness of the reactions, whose directions change with the nodes, on the last rank.

        All equations contribute, in the plane and out of it, also those that a plane model does not need.

        Args:
            axes: (block, 6) the (displacement, rotation) of each of the unknowns of a node.

        Returns:
            (tied nodes * block, the same).
        """
        if not self._here:
            return None
        _, change = self._of_all(eta)
        size = len(change) * len(axes)
        return (axes @ (change @ axes.T).reshape(len(change), 6, -1)).reshape(size, size)

    def springs(self, axes, eta, resistance):
        """Penalty springs that replace all constraint equations; arguments and result as of `second_variation`.

        Args:
            resistance: (tied nodes * block,) stiffness of the elements against these motions of the nodes.
        """
        if not self._here:
            return None
        gradient = (self._of_all(eta)[0] @ axes.T).reshape(-1, len(resistance))
        stiffness = _HELD * (gradient * gradient * resistance).max(axis=1, keepdims=True)
        return gradient.T @ (stiffness * gradient)

    def _of_all(self, eta):
        """Gradients (ties, tied nodes, 6) of all equations, and the symmetric part of the derivative of their
        reactions, (tied nodes, 6, tied nodes, 6); evaluated once for all parts of the second variation."""
        if self._all_values[0] != eta:
            nodal, multipliers = self.seen
            _, gradient, change = self.model.ties.evaluate(self.model.tied_motion(nodal), eta, multipliers, self._all)
            self._all_values = eta, (gradient, 0.5 * (change + change.transpose(2, 3, 0, 1)))
        return self._all_values[1]


def reactions_by_nodes(test, change, trial):
    """The reactions' derivatives, (tied nodes, 6, tied nodes, 6), in rows and columns of the nodes; see
    `RodModel.tie_maps`."""
    count, size = len(change), len(change) * test.shape[1]
    turned = (test @ change.reshape(count, 6, -1)).reshape(size, count, 6)
    return (turned.swapaxes(0, 1) @ trial).swapaxes(0, 1).reshape(size, -1)


def reactions_by_multipliers(test, gradient):
    """Gradients (ties, tied nodes, 6) as columns on the rows of the nodes."""
    # sizes in full, since there may be no ties; one map may serve all nodes
    return (test @ gradient.transpose(1, 2, 0)).reshape(gradient.shape[1] * test.shape[1], len(gradient))


def by_nodes(gradient, trial):
    """Gradients (ties, tied nodes, 6) as rows on the columns of the nodes."""
    return (gradient.swapaxes(0, 1) @ trial).swapaxes(0, 1).reshape(len(gradient), gradient.shape[1] * trial.shape[2])
