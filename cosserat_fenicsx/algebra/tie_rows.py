"""The constraint equations of supports and joints, in the rows and columns of a solver's matrix."""

import numpy as np
from petsc4py import PETSc

from cosserat_fenicsx.algebra.building import Pointers

#: Penalty stiffness that replaces a constraint in the second variation, over the stiffness of the elements there.
_HELD = 1e3


class TieRows(Pointers):
    """Constraint equations of one problem, by its model and `Numbering`; all ranks evaluate them, in ties.c.

    rows: (tied nodes, block) solver's numbers, -1 where clamped; nodal, multipliers: (tied nodes, block), (ties,) the
    tied nodes' unknowns and the multipliers of all equations, as of the last state; share: in motion, where in the step
    reactions act: 0 at its start, 1 at its end, where the equations hold; c: the C structure `ties`.
    """

    share = 1.0

    def __init__(self, model, numbering, handle):
        super().__init__()
        self.model, self.numbering = model, numbering
        self.rows = model.rows_of_tied.astype(PETSc.IntType)
        # PETSc skips rows numbered -1 in a matrix, but in a vector it would write in front of the array
        self._free = np.flatnonzero(self.rows >= 0)
        self._here = numbering.comm.rank == numbering.comm.size - 1
        links = model.signature.connections
        self._pattern = links.pattern
        self._added, self._count = np.array(links.equations, dtype=np.intp), len(links.ties)
        # factors of each added equation's reaction at its two stations; 0 where the second one is the ground
        signs = [(-1.0, 0.0 if links.ties[i][2] is None else -1.0) for i in self._added]
        self._signs = np.array(signs).reshape(-1, 2)  # in a plane no equation may be added
        self._multipliers = (numbering.first_multiplier + np.arange(numbering.multipliers)).astype(PETSc.IntType)
        self._scatter = None
        if numbering.comm.size > 1:
            wanted = np.concatenate([self.rows.ravel()[self._free], self._multipliers])
            index = PETSc.IS().createGeneral(wanted, comm=PETSc.COMM_SELF)
            self._work, self._x = PETSc.Vec().createSeq(len(wanted)), numbering.vector()
            self._scatter = PETSc.Scatter().create(self._x, index, self._work, None)
        self._fill(handle)

    def _fill(self, handle):
        model, pattern, count, nodes = self.model, self._pattern, self._count, len(self.rows)
        block, pairs, added = model.components, len(pattern.first), len(self._added)
        self.c = ties = self._ffi.new("ties *")
        ties.count, ties.nodes, ties.pairs, ties.added, ties.block = count, nodes, pairs, added, block
        ties.plane, ties.share, ties.held = model.moves == 2, self.share, _HELD
        for name, array in (
            ("ends", pattern.ends), ("pair", pattern.pairs), ("first", pattern.first), ("second", pattern.second),
            ("mirrored", pattern.mirrored), ("own", pattern.own), ("equation", self._added),
            ("rows", self._of_rank(self.rows)), ("multiplier", self._of_rank(self._multipliers)),
        ):  # fmt: skip
            setattr(ties, name, self.integers(array))
        self.nodal, self.multipliers = np.zeros(self.rows.shape), np.zeros(count)
        self._start, self._shift, self._numbers = np.zeros(self.rows.shape), np.zeros(count), None
        self._at_rest, self._offset, self._axes = np.zeros(self.rows.shape), np.zeros((nodes, 3)), np.zeros((3, 3))
        self._test, self._turned = np.zeros((nodes, block, 6)), np.zeros((nodes, block, block))
        self._found, self._amid = np.zeros((2, count, 13))
        self._derivatives = np.zeros(pairs * block**2 + 4 * added * block)
        for name, array in (
            ("nodal", self.nodal), ("multipliers", self.multipliers), ("start", self._start), ("shift", self._shift),
            ("at_rest", self._at_rest), ("offset", self._offset), ("axes", self._axes),
            ("test", self._test), ("found", self._found), ("amid", self._amid), ("derivatives", self._derivatives),
            ("acting", np.zeros(self.rows.shape)), ("change", np.zeros((pairs, 6, 6))),
            ("forces", np.zeros((nodes, 6))),
        ):  # fmt: skip
            setattr(ties, name, self.doubles(array))
        if model.rows_turn:
            ties.self, ties.turned = handle, self.doubles(self._turned)

    def _of_rank(self, numbers):
        """The unknowns in this rank's part of a vector, -1 for others."""
        local = numbers - self.numbering.first
        return np.where((local >= 0) & (local < self.numbering.size), local, -1)

    def load(self):
        """Take the data of the scene that the model was loaded with."""
        model = self.model
        if self._numbers is None:
            self._take_kernels(model.ties)
        self._at_rest[:] = model.tied_at_rest
        self._test[:] = model.tie_maps(self._at_rest)[1]
        if self.c.plane:
            self._axes[:], self._offset[:] = model.axes, model.tied_off
        self.take(model.ties)

    def _take_kernels(self, equations):
        ties, self._numbers = self.c, np.zeros(equations.numbers.shape)
        ties.numbers, ties.width = self.doubles(self._numbers), self._numbers.shape[1]
        ties.turns, ties.turning = self.integers(equations.turning), len(equations.turning)
        ties.at_load_factor, ties.at_multiplier = equations.changing
        ties.value, ties.changes = (self._ffi.cast("void *", address) for address in equations.addresses)

    def take(self, ties):
        """Take the equations from the data of `Ties`."""
        self._numbers[:] = ties.numbers
        self._forget()

    def see(self, x):
        """Copy the tied nodes' unknowns and the multipliers from this rank's part of a vector."""
        if self._scatter is None:
            self._lib.see_ties(self.c, self._ffi.from_buffer("double[]", x))
            return
        self._x.array_w[:] = x
        self._scatter.scatter(self._x, self._work, False, PETSc.ScatterMode.FORWARD)
        free = len(self._free)
        self.nodal[:] = self._at_rest
        self.nodal.reshape(-1)[self._free] = self._work.array_r[:free]
        self.multipliers[self._added] = self._work.array_r[free:]
        self._forget()

    def _forget(self):
        """Discard what was evaluated at another state."""
        self.c.known = self.c.known_change = 0

    def find_maps(self, values, forces):
        """Set the rows of forces (nodes, 6) on nodes with unknowns (nodes, block), and their change by rotations."""
        self._test[:] = self.model.tie_maps(values)[1]
        self._turned[:] = self.model.turned_reactions(values, forces)

    def _gradients(self, load_factor):
        """(ties, 2, 6) gradients of all equations where reactions act."""
        self._lib.find_ties(self.c, load_factor)
        return self._amid[:, 1:].reshape(-1, 2, 6)

    def put_all(self, x, multipliers):
        """Set the multipliers (k, ties) in unknowns x (k, unknowns) of one process."""
        x[:, self._multipliers] = multipliers[:, self._added]

    def put(self, x, multipliers):
        """Set the multipliers in a vector."""
        if self._here:
            x.setValues(self._multipliers, multipliers[self._added])
        x.assemble()

    def everywhere(self):
        """The multipliers as of the last state, on all ranks."""
        return self.multipliers.copy()

    def forces(self, load_factor):
        """See `Equations.tie_forces`; at the last state."""
        return self._forces(self.multipliers, self._gradients(load_factor))

    def along(self, x, load_factors):
        """See `Equations.at_ties`."""
        multipliers, gradients = np.zeros((len(x), self._count)), np.zeros((len(x), self._count, 2, 6))
        for k, load_factor in enumerate(load_factors.tolist()):
            self.see(x[k])
            multipliers[k], gradients[k] = self.multipliers, self._gradients(load_factor)
        return multipliers, self._forces(multipliers, gradients)

    def _forces(self, multipliers, gradients):
        """(.., ties, 2, 6) forces at both ends of multipliers (.., ties) and gradients (.., ties, 2, 6)."""
        found, added = np.zeros(gradients.shape), self._added
        signed = self._signs * multipliers[..., added, None]
        found[..., added, :, :] = self.model.held_forces(gradients[..., added, :, :] * signed[..., None])
        return found

    def reactions(self, load_factor, multipliers):
        """(tied nodes, 6) forces and moments on the nodes, sums over the ties, with these multipliers (ties,)."""
        found = np.empty((len(self.rows), 6))
        self._lib.react(self.c, load_factor, *(self._ffi.from_buffer("double[]", x) for x in (multipliers, found)))
        return found

    def gradients(self):
        """(ties, tied nodes, 6) gradients of all equations by (displacement, rotation), on all ranks."""
        self._lib.find_ties(self.c, 0.0)
        return self._pattern.on_nodes(self._found[:, 1:].reshape(-1, 2, 6))

    def add_residual(self, b, load_factor):
        """Add reactions and constraint equations to the rows of nodes and multipliers in this rank's vector."""
        self._lib.add_ties(self.c, load_factor, self._ffi.from_buffer("double[]", b))

    def tangent_blocks(self, load_factor):
        """Derivatives of what `add_residual` adds, in blocks of few nodes each: of the reactions by the nodes, (pairs,
        block, block) of the `TiePattern`; of the reactions at both ends of every equation by its multiplier,
        (equations, 2, block); and of the equations by the same unknowns."""
        self._lib.differentiate_ties(self.c, load_factor)
        block, pairs, added = self.model.components, len(self._pattern.first), len(self._added)
        of_nodes, *of_ends = np.split(self._derivatives, [pairs * block**2, pairs * block**2 + 2 * added * block])
        return of_nodes.reshape(pairs, block, block), *(part.reshape(added, 2, block) for part in of_ends)

    def second_variation(self, axes, load_factor):
        """(pairs, block, block) of the `TiePattern`: the geometric stiffness of the reactions, whose directions change
        with the nodes, of all equations, also those that a plane model does not need; axes: (block, 6) the
        (displacement, rotation) of each of the unknowns of a node."""
        found = np.empty((len(self._pattern.first), len(axes), len(axes)))
        axes, found_c = (self._ffi.from_buffer("double[]", np.ascontiguousarray(part)) for part in (axes, found))
        self._lib.vary_ties(self.c, load_factor, axes, found.shape[1], found_c)
        return found

    def energies_of_springs(self, axes, load_factor, resistance, motions):
        """(m,) the quadratic form of springs in place of all equations (see `Variation`) along motions of the tied
        nodes (m, nodes, block): sums of squares of what the equations forbid, which rounding of the matrix would hide;
        resistance: (tied nodes * block,) stiffness of the elements against these motions of the nodes."""
        stiffness = np.empty(self._count)
        given = (self._ffi.from_buffer("double[]", np.ascontiguousarray(x)) for x in (axes, resistance, stiffness))
        axes_c, resistance, stiffness_c = given
        self._lib.spring_ties(self.c, load_factor, axes_c, len(axes), resistance, stiffness_c, self._ffi.NULL)
        gradient = self._found[:, 1:].reshape(-1, 2, 6) @ axes.T
        of_ends = np.stack([self._pattern.of_ends(motion) for motion in motions])
        return np.square(np.einsum("tia,mtia->mt", gradient, of_ends)) @ stiffness

    def energy(self, blocks, motions):
        """(k,) v^T A v of blocks A as of `second_variation` and motions v of the tied nodes (k, nodes, block)."""
        return self._pattern.energy(blocks, motions)

    def add_to_matrix(self, A, rows, blocks):
        """Add what `second_variation` returned to a matrix on rank 0; rows: (tied nodes, block), -1 where clamped."""
        rows, pattern = rows.astype(PETSc.IntType), self._pattern
        for i, j, values in zip(rows[pattern.first], rows[pattern.second], blocks, strict=True):
            A.setValues(i, j, values, PETSc.InsertMode.ADD_VALUES)
