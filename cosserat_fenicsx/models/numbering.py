"""The map from dolfinx's degrees of freedom to the solver's unknowns.

Clamped nodes have no unknowns, rigidly joined nodes share theirs, and every constraint equation has a multiplier. Rods
are separate chains of the mesh, because dolfinx does not support branching interval meshes in all versions. A rank's
part of the solver's vector contains its free nodes, node by node, then its other unknowns (of elements), then, on the
last rank, the multipliers.
"""

import numpy as np
from dolfinx import fem
from petsc4py import PETSc


class Numbering:
    """The unknowns on one space.

    Args:
        comm: MPI communicator of the vectors and matrices: that of the caller and not the mesh's copy, on which nobody
            would free what PETSc puts aside.
        space: dolfinx's space; `node_dofs` (local nodes, block): its local degrees of freedom of every node.
        owned: number of the local nodes that this rank owns.
        slots: the scene's number of every local node.
        clamped, leaders: slots without unknowns, and {slot: the slot whose unknowns it shares}.
        multipliers: number of constraint equations.

    Attributes:
        nodes: free nodes of this rank.
        block: unknowns of a node.
        size: unknowns of this rank, total: of all ranks.
        rows: index in the solver's vector of every local degree of freedom of the space; -1 where clamped.
        free, of_free: local degrees of freedom with an index there, and that index.
        first_multiplier: index of the first multiplier.
    """

    def __init__(self, comm, space, node_dofs, owned, slots, clamped, leaders, multipliers=0):
        self.space, self.comm, self.block = space, comm, node_dofs.shape[1]
        dofmap = space.dofmap
        self._blocked = dofmap.index_map_bs > 1
        lead = np.array([leaders.get(slot, slot) for slot in slots.tolist()], dtype=np.int64)
        free = ~np.isin(lead, list(clamped))
        own = np.zeros(len(slots), dtype=bool)
        own[:owned] = (free & (lead == slots))[:owned]
        self.nodes = int(own.sum())
        # sizes of vectors and matrices in node blocks must be multiples of them
        self._blocked = self._blocked and not multipliers
        dofs = dofmap.index_map.size_local * dofmap.index_map_bs
        others = np.setdiff1d(np.arange(dofs), node_dofs[:owned].ravel())
        last = comm.rank == comm.size - 1
        self.multipliers = multipliers
        self.size = self.nodes * self.block + len(others) + multipliers * last
        sizes = comm.allgather(self.size)
        first, self.total = sum(sizes[: comm.rank]), sum(sizes)
        self.first, self.first_multiplier = first, self.total - multipliers
        rows = fem.Function(space)  # communicates the indices to the ranks that have them as ghosts
        numbers = rows.x.array
        numbers[:] = -1
        chain = np.flatnonzero(own)[np.argsort(slots[own])]  # along the rods
        numbers[node_dofs[chain]] = first + np.arange(self.nodes * self.block).reshape(-1, self.block)
        numbers[others] = first + self.nodes * self.block + np.arange(len(others))
        rows.x.scatter_forward()
        self.rows = rows.x.array.astype(PETSc.IntType)
        self._share(slots, lead, own, node_dofs, set(leaders.values()))
        self.rows[node_dofs[~free]] = -1
        self._connect(own.sum() != free[:owned].sum())

    def _share(self, slots, lead, own, node_dofs, leading):
        """Give every rank the indices of the nodes whose unknowns others share."""
        here = {int(slots[i]): self.rows[node_dofs[i]] for i in np.flatnonzero(own) if int(slots[i]) in leading}
        everywhere = {}
        for part in self.comm.allgather(here):
            everywhere.update(part)
        for i in np.flatnonzero(np.isin(lead, list(leading))):
            if int(lead[i]) in everywhere:
                self.rows[node_dofs[i]] = everywhere[int(lead[i])]

    def _connect(self, shared):
        """Prepare the transfer between the solver's vector and dolfinx's local degrees of freedom."""
        self.free = np.flatnonzero(self.rows >= 0)
        self.of_free = self.rows[self.free]
        mine = (self.of_free >= self.first) & (self.of_free < self.first + self.size)
        self._mine, self._of_mine = self.free[mine], self.of_free[mine] - self.first
        self._serial = self.comm.size == 1
        self._shared = shared
        if not self._serial:
            self._local = PETSc.Vec().createSeq(len(self.free))
            index = PETSc.IS().createGeneral(self.of_free, comm=PETSc.COMM_SELF)
            self._scatter = PETSc.Scatter().create(self.vector(), index, self._local, None)

    def vector(self):
        """A vector of the solver's unknowns."""
        vector = PETSc.Vec().create(self.comm)
        vector.setSizes((self.size, self.total), bsize=self.block if self._blocked else 1)
        vector.setUp()
        return vector

    def to_local(self, x, numbers):
        """Copy a solver's vector to dolfinx's local degrees of freedom, ghosts included, clamped ones excluded."""
        if self._serial:
            numbers[self.free] = x.array_r[self.of_free]
        else:
            self._scatter.scatter(x, self._local, False, PETSc.ScatterMode.FORWARD)
            numbers[self.free] = self._local.array_r

    def from_local(self, numbers, x):
        """Copy local degrees of freedom to a solver's vector; multipliers become zero."""
        array = x.array_w
        array[:] = 0.0
        array[self._of_mine] = numbers[self._mine]

    def add_up(self, numbers, b):
        """Sum local contributions, of all ranks and joined nodes, into a solver's vector."""
        if self._serial:
            array = b.array_w
            array[self.first_multiplier :] = 0.0
            if self._shared:
                array[:] = np.bincount(self.of_free, numbers[self.free], minlength=self.size)
            else:
                array[self.of_free] = numbers[self.free]
        else:
            b.set(0.0)
            self._local.array_w[:] = numbers[self.free]
            self._scatter.scatter(self._local, b, PETSc.InsertMode.ADD_VALUES, PETSc.ScatterMode.REVERSE)

    def matrix(self, cell_dofs, tied, pattern):
        """A matrix preallocated for all elements of this rank and for what ties add between nodes.

        Args:
            cell_dofs: (cells, dofs) local degrees of freedom of every element of this rank.
            tied: (tied nodes, block) indices (of any rank) of the unknowns in constraint equations, -1 where clamped;
                the same on all ranks.
            pattern: the `TiePattern` of the tied nodes.
        """
        A = PETSc.Mat().create(self.comm)
        A.setType("aij")
        A.setSizes(((self.size, self.total), (self.size, self.total)), bsize=self.block if self._blocked else 1)
        A.setPreallocationNNZ(self._room(cell_dofs, tied, pattern))
        if self._blocked:
            whole = self.rows.reshape(-1, self.block)[:, 0]
            blocks = np.where(whole >= 0, whole // self.block, -1).astype(PETSc.IntType)
            numbers = PETSc.LGMap().create(blocks, bsize=self.block, comm=self.comm)
        else:
            numbers = PETSc.LGMap().create(self.rows, comm=self.comm)
        A.setLGMap(numbers, numbers)
        # set on every rank: otherwise a rank without rows would make different collective calls
        A.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, True)
        return A

    def _room(self, cell_dofs, tied, pattern):
        """Upper bounds on the non-zeros of every row of this rank: in its own columns, and in those of other ranks."""
        count = np.zeros(len(self.rows))
        wide = np.count_nonzero(self.rows[cell_dofs] >= 0, axis=1)
        np.add.at(count, cell_dofs.ravel(), np.repeat(wide, cell_dofs.shape[1]))
        room = self.vector()
        if self._serial:
            room.array_w[:] = np.bincount(self.of_free, count[self.free], minlength=self.size)
        else:
            self.add_up(count, room)
        first, array = self.first, room.array_r.astype(PETSc.IntType)
        mine = (tied.ravel() >= first) & (tied.ravel() < first + self.size)
        array[tied.ravel()[mine] - first] += pattern.widths(tied.shape[1])[mine]
        return np.minimum(array, self.size), np.minimum(array, self.total - self.size)
