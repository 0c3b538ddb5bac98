"""The constraint equations of supports and joints, in the rows and columns of a solver's matrix."""

import numpy as np
from petsc4py import PETSc

#: Penalty stiffness that replaces a constraint in the second variation, over the stiffness of the elements there.
_HELD = 1e3
#: A diverging Newton step may overflow: the residual is then not a number, which stops it; numpy need not warn.
_WILD = {"invalid": "ignore", "over": "ignore"}


class TieRows:
    """Constraint equations of one problem, by its model and `Numbering`; all ranks evaluate them.

    rows: (tied nodes, block) solver's numbers, -1 where clamped; seen: the tied nodes' unknowns and the multipliers of
    all equations, as of the last call of `see`; share: in motion, where in the step reactions act: 0 at its start, 1 at
    its end, where the equations hold.
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
        self._pattern = links.pattern
        self._added, self._count = np.array(links.equations, dtype=np.intp), len(links.ties)
        # factors of each added equation's reaction at its two stations; 0 where the second one is the ground
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
        """Discard what was evaluated at another state."""
        self._values = self._change = (None, None)

    @property
    def ties(self):
        """The `Ties` that are evaluated."""
        return self.model.ties

    def _evaluate(self, load_factor):
        """Values and gradients of all equations, see `Ties.evaluate`; once for residual and tangent."""
        if self._values[0] != load_factor:
            self._values = load_factor, self.ties.evaluate(self.model.tied_motion(self.seen[0]), load_factor)
        return self._values[1]

    def _acting(self):
        """The tied nodes' unknowns where reactions act."""
        return self.seen[0]

    def _gradients(self, load_factor):
        """Gradients of all equations where reactions act."""
        return self._evaluate(load_factor)[1]

    def put(self, x, multipliers):
        """Set the multipliers in a vector."""
        if self._here:
            x.setValues(self._multipliers, multipliers[self._added])
        x.assemble()

    def everywhere(self):
        """The multipliers as of the last call of `see`, on all ranks."""
        return self.seen[1]

    def forces(self, load_factor):
        """See `Equations.tie_forces`; at the state of the last call of `see`."""
        found, added = np.zeros((self._count, 2, 6)), self._added
        signed = self._signs * self.seen[1][added, None]
        found[added] = self.model.held_forces(self._gradients(load_factor)[added] * signed[..., None])
        return found

    def gradients(self):
        """(ties, tied nodes, 6) gradients of all equations by (displacement, rotation), on all ranks."""
        return self._pattern.on_nodes(self._evaluate(0.0)[1])

    @np.errstate(**_WILD)
    def residual_blocks(self, load_factor):
        """The reactions in the rows of the nodes (all of `rows` in turn), and the values of the equations added."""
        return self._blocks(load_factor)

    def _blocks(self, load_factor):
        reactions = self.ties.reactions(self._gradients(load_factor), self.seen[1])
        return (self._rows_of_forces() @ reactions[:, :, None]).ravel(), self._evaluate(load_factor)[0][self._added]

    def _rows_of_forces(self):
        """The second of the model's `tie_maps`; the same for all states of a scene unless `rows_turn`."""
        scene, rows = self._constant_rows
        if self.model.rows_turn or scene is not self.model.scene:
            rows = self.model.tie_maps(self.seen[0])[1]
            self._constant_rows = self.model.scene, rows
        return rows

    @np.errstate(**_WILD)
    def tangent_blocks(self, load_factor):
        """Derivatives of `residual_blocks`, in blocks of few nodes each: of the reactions by the nodes, (pairs, block,
        block) of the `TiePattern`; of the reactions at both ends of every equation by its multiplier, (equations, 2,
        block); and of the equations by the same unknowns."""
        (nodal, multipliers), acting, ties, model = self.seen, self._acting(), self.ties, self.model
        change = ties.change(model.tied_motion(acting), load_factor, multipliers)
        gradients = self._gradients(load_factor)
        (trial, test), added, pattern = self._maps(acting), gradients[self._added], self._pattern
        of_nodes = test[pattern.first] @ change @ (self.share * trial)[pattern.second]
        reactions = (pattern.of_ends(test)[self._added] @ added[..., None])[..., 0]
        if model.rows_turn:
            turned = self.share * model.turned_reactions(acting, ties.reactions(gradients, multipliers))
            of_nodes[pattern.own] += turned
        if acting is not nodal:
            (trial, _), added = self._maps(nodal), self._evaluate(load_factor)[1][self._added]
        return of_nodes, reactions, (added[..., None, :] @ pattern.of_ends(trial)[self._added])[..., 0, :]

    def _maps(self, values):
        """The model's `tie_maps`, for every node where one serves all."""
        return [np.broadcast_to(part, (len(values), *part.shape[1:])) for part in self.model.tie_maps(values)]

    def add_residual(self, b, load_factor):
        """Add reactions and constraint equations to the rows of nodes and multipliers in this rank's vector."""
        forces, c = self.residual_blocks(load_factor)
        np.add.at(b, self._mine_rows, np.concatenate([forces[self._free], c])[self._mine])

    def second_variation(self, axes, load_factor):
        """(pairs, block, block) of the `TiePattern`: the geometric stiffness of the reactions, whose directions change
        with the nodes, of all equations, also those that a plane model does not need; axes: (block, 6) the
        (displacement, rotation) of each of the unknowns of a node."""
        return axes @ self._symmetric_change(load_factor) @ axes.T

    def springs(self, axes, load_factor, resistance):
        """Penalty springs that replace all constraint equations, as `second_variation`; resistance: (tied nodes *
        block,) stiffness of the elements against these motions of the nodes."""
        gradient, stiffness = self._springs(axes, load_factor, resistance)
        return self._pattern.sums(np.einsum("t,tia,tjb->tiajb", stiffness, gradient, gradient))

    def energies_of_springs(self, axes, load_factor, resistance, motions):
        """(m,) the quadratic form of `springs` along motions of the tied nodes (m, nodes, block): sums of squares of
        what the equations forbid, which rounding of the matrix would hide."""
        gradient, stiffness = self._springs(axes, load_factor, resistance)
        of_ends = np.stack([self._pattern.of_ends(motion) for motion in motions])
        return np.square(np.einsum("tia,mtia->mt", gradient, of_ends)) @ stiffness

    def _springs(self, axes, load_factor, resistance):
        """Gradients (ties, 2, block) of all equations by the motions of their ends, and their springs' stiffnesses."""
        gradient = self._evaluate(load_factor)[1] @ axes.T
        of_ends = self._pattern.of_ends(resistance.reshape(-1, len(axes)))
        return gradient, _HELD * (gradient * gradient * of_ends).max(axis=(1, 2))

    def diagonal(self, blocks):
        """(tied nodes * block,) the diagonal of what `second_variation` returned."""
        return np.einsum("nii->ni", blocks[self._pattern.own]).ravel()

    def energy(self, blocks, motions):
        """(k,) v^T A v of blocks A as of `second_variation` and motions v of the tied nodes (k, nodes, block)."""
        return self._pattern.energy(blocks, motions)

    def add_to_matrix(self, A, rows, blocks):
        """Add what `second_variation` returned to a matrix on rank 0; rows: (tied nodes, block), -1 where clamped."""
        rows, pattern = rows.astype(PETSc.IntType), self._pattern
        for i, j, values in zip(rows[pattern.first], rows[pattern.second], blocks, strict=True):
            A.setValues(i, j, values, PETSc.InsertMode.ADD_VALUES)

    def _symmetric_change(self, load_factor):
        """The symmetric part of the derivative of the reactions, (pairs, 6, 6); evaluated once for all parts."""
        if self._change[0] != load_factor:
            nodal, multipliers = self.seen
            change = self.ties.change(self.model.tied_motion(nodal), load_factor, multipliers)
            self._change = load_factor, 0.5 * (change + change[self._pattern.mirrored].swapaxes(1, 2))
        return self._change[1]
