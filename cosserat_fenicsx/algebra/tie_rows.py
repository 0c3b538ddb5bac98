"""The constraint equations of supports and joints, in the rows and columns of a solver's matrix."""

import numpy as np
from petsc4py import PETSc

#: Penalty stiffness that replaces a constraint in the second variation, over the stiffness of the elements there.
_HELD = 1e3
#: A diverging Newton step may overflow: the residual is then not a number, which stops SNES; numpy need not warn.
_WILD = {"invalid": "ignore", "over": "ignore"}


class TieRows:
    """Constraint equations of one problem; all ranks evaluate them.

    Args:
        model: its `rows_of_tied`, `ties`, `held_forces`, `tied_motion`, `tie_maps`, `rows_turn` and `tied_at_rest` are
            used.
        numbering: the problem's `Numbering`.

    Attributes:
        rows: (tied nodes, block) solver's numbers, -1 where clamped.
        seen: the tied nodes' unknowns and the multipliers of all equations, as of the last call of `see`.
        share: in motion, where in the step reactions act: 0 at its start, 1 at its end, where the equations hold.
    """

    share = 1.0

    def __init__(self, model, numbering):
        self.model, self.numbering = model, numbering
        self.rows = model.rows_of_tied.astype(PETSc.IntType)
        # PETSc skips rows numbered -1 in a matrix, but in a vector it would write in front of the array
        self._free = np.flatnonzero(self.rows >= 0)
        self._free_rows = self.rows.ravel()[self._free]
        self._here = numbering.comm.rank == numbering.comm.size - 1
        links = model.signature.connections
        self._added, self._count = np.array(links.equations, dtype=np.intp), len(links.ties)
        # for every added equation: what multiplies its reaction at both stations, the ground has none
        signs = [(-1.0, 0.0 if links.ties[i][2] is None else -1.0) for i in self._added]
        self._signs = np.array(signs).reshape(-1, 2)  # in a plane no equation may be added
        count = numbering.multipliers
        self._multipliers = (numbering.first_multiplier + np.arange(count)).astype(PETSc.IntType)
        wanted = np.concatenate([self._free_rows, self._multipliers])
        first, end = numbering.first, numbering.first + numbering.size
        self._mine = np.flatnonzero((wanted >= first) & (wanted < end))
        self._mine_rows = wanted[self._mine] - first
        self._scatter = None
        if numbering.comm.size > 1:
            index = PETSc.IS().createGeneral(wanted, comm=PETSc.COMM_SELF)
            self._work, self._x = PETSc.Vec().createSeq(len(wanted)), numbering.vector()
            self._scatter = PETSc.Scatter().create(self._x, index, self._work, None)
        self.seen, self._constant_rows = None, (None, None)

    def see(self, x):
        """Copy the tied nodes' unknowns and the multipliers from this rank's part of a vector."""
        free = len(self._free)
        if self._scatter:
            self._x.array_w[:] = x
            self._scatter.scatter(self._x, self._work, False, PETSc.ScatterMode.FORWARD)
            values = self._work.array_r
        else:
            values = x[self._mine_rows]
        nodal, multipliers = self.model.tied_at_rest.copy(), np.zeros(self._count)
        nodal.reshape(-1)[self._free] = values[:free]
        multipliers[self._added] = values[free:]
        self.seen = nodal, multipliers
        self._forget()

    def _forget(self):
        """What was evaluated is of another state."""
        self._values = self._change = (None, None)

    @property
    def ties(self):
        """The `Ties` that are evaluated."""
        return self.model.ties

    def _evaluate(self, eta):
        """Values and gradients of all equations, see `Ties.evaluate`; once for residual and tangent."""
        if self._values[0] != eta:
            self._values = eta, self.ties.evaluate(self.model.tied_motion(self.seen[0]), eta)
        return self._values[1]

    def _acting(self):
        """The tied nodes' unknowns where reactions act."""
        return self.seen[0]

    def _gradients(self, eta):
        """Gradients of all equations where reactions act."""
        return self._evaluate(eta)[1]

    def put(self, x, multipliers):
        """Set the multipliers in a vector."""
        if self._here:
            x.setValues(self._multipliers, multipliers[self._added])
        x.assemble()

    def everywhere(self):
        """The multipliers as of the last call of `see`, on all ranks."""
        return self.seen[1]

    def forces(self, eta):
        """See `Equations.tie_forces`; at the state of the last call of `see`."""
        found, added = np.zeros((self._count, 2, 6)), self._added
        signed = self._signs * self.seen[1][added, None]
        found[added] = self.model.held_forces(self._gradients(eta)[added] * signed[..., None])
        return found

    def gradients(self):
        """(ties, tied nodes, 6) gradients of all equations by (displacement, rotation), on all ranks."""
        return self.ties.on_nodes(self._evaluate(0.0)[1])

    @np.errstate(**_WILD)
    def residual_blocks(self, eta):
        """The reactions in the rows of the nodes (all of `rows`, one after the other), and the values of the equations
        that are added."""
        return self._blocks(eta)

    def _blocks(self, eta):
        reactions = self.ties.reactions(self._gradients(eta), self.seen[1])
        return (self._rows_of_forces() @ reactions[:, :, None]).ravel(), self._evaluate(eta)[0][self._added]

    def _rows_of_forces(self):
        """The second of the model's `tie_maps`; the same for all states of a scene unless `rows_turn`."""
        scene, rows = self._constant_rows
        if self.model.rows_turn or scene is not self.model.scene:
            rows = self.model.tie_maps(self.seen[0])[1]
            self._constant_rows = self.model.scene, rows
        return rows

    @np.errstate(**_WILD)
    def tangent_blocks(self, eta):
        """Derivatives of `residual_blocks`: of the reactions by the nodes and by the multipliers, and of the equations
        by the nodes."""
        (nodal, multipliers), acting, ties, model = self.seen, self._acting(), self.ties, self.model
        change, gradients = ties.change(model.tied_motion(acting), eta, multipliers), self._gradients(eta)
        (trial, test), added = model.tie_maps(acting), ties.on_nodes(gradients)[self._added]
        of_nodes = reactions_by_nodes(test, change, self.share * trial)
        reactions = reactions_by_multipliers(test, added)
        if model.rows_turn:
            places = np.arange(len(of_nodes)).reshape(len(nodal), -1)
            turned = self.share * model.turned_reactions(acting, ties.reactions(gradients, multipliers))
            of_nodes[places[:, :, None], places[:, None, :]] += turned
        if acting is not nodal:
            (trial, _), added = model.tie_maps(nodal), ties.on_nodes(self._evaluate(eta)[1])[self._added]
        return of_nodes, reactions, by_nodes(added, trial)

    def add_residual(self, b, eta):
        """Add the reactions to the rows of the nodes, and the constraint equations in the rows of the multipliers, in
        this rank's part of a vector."""
        forces, c = self.residual_blocks(eta)
        np.add.at(b, self._mine_rows, np.concatenate([forces[self._free], c])[self._mine])

    def second_variation(self, axes, eta):
        """The geometric stiffness of the reactions, whose directions change with the nodes.

        All equations contribute, in the plane and out of it, also those that a plane model does not need.

        Args:
            axes: (block, 6) the (displacement, rotation) of each of the unknowns of a node.

        Returns:
            (tied nodes * block, the same).
        """
        change = self._symmetric_change(eta)
        size = len(change) * len(axes)
        return (axes @ (change @ axes.T).reshape(len(change), 6, -1)).reshape(size, size)

    def springs(self, axes, eta, resistance):
        """Penalty springs that replace all constraint equations; arguments and result as of `second_variation`.

        Args:
            resistance: (tied nodes * block,) stiffness of the elements against these motions of the nodes.
        """
        gradient, stiffness = self._springs(axes, eta, resistance)
        return gradient.T @ (stiffness[:, None] * gradient)

    def energies_of_springs(self, axes, eta, resistance, motions):
        """(m,) the quadratic form of `springs` along motions of the tied nodes (m, tied nodes * block): sums of squares
        of what the equations forbid, which rounding of the matrix would hide."""
        gradient, stiffness = self._springs(axes, eta, resistance)
        return np.square(motions @ gradient.T) @ stiffness

    def _springs(self, axes, eta, resistance):
        """Gradients (ties, tied nodes * block) of all equations, and stiffnesses (ties,) of their springs."""
        gradient = (self.ties.on_nodes(self._evaluate(eta)[1]) @ axes.T).reshape(-1, len(resistance))
        return gradient, _HELD * (gradient * gradient * resistance).max(axis=1)

    def _symmetric_change(self, eta):
        """The symmetric part of the derivative of the reactions, (tied nodes, 6, tied nodes, 6); evaluated once for all
        parts of the second variation."""
        if self._change[0] != eta:
            nodal, multipliers = self.seen
            change = self.ties.change(self.model.tied_motion(nodal), eta, multipliers)
            self._change = eta, 0.5 * (change + change.transpose(2, 3, 0, 1))
        return self._change[1]


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
