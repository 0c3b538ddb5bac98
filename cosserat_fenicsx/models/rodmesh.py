"""The mesh of a scene's rods, and the maps between arc length, dolfinx's degrees of freedom and the solver's unknowns.

Rods are numbered in the order of the scene, the elements and nodes of each from its start to its end ("the scene's
order"); dolfinx renumbers them, may reverse elements, and distributes them over the ranks. The `slot` of a node is its
number in the scene's order.

Clamped nodes have no unknowns, rigidly joined nodes share theirs, and every constraint equation has a multiplier. Rods
are separate chains of the mesh, because dolfinx does not support branching interval meshes in all versions. A rank's
part of the solver's vector contains its free nodes, node by node, then its other unknowns (of elements), then, on the
last rank, the multipliers."""

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from cosserat_fenicsx import compat
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.numerics import once_each
from cosserat_fenicsx.parts import per_scene
from cosserat_fenicsx.scene.curves import positions_along

#: Largest number of elements of all rods together.
MOST_ELEMENTS = 100_000
# Memory per element, GB, of degree 4 in space.
_GIGABYTES = 1e-4


@dataclass(frozen=True, eq=False)
class Layout:
    """How many elements each rod has and where their ends lie; breaks: of every rod, over its length, from 0 to 1."""

    breaks: tuple

    @classmethod
    def of(cls, scene, elements):
        """`elements` per rod, more where supports, loads, joints, kinks need it; a SceneError for too many in all."""
        return _equal(scene, elements)

    def finer(self, scene, factor):
        """The layout with `factor` times as many elements, rounded up in every piece; ratios of lengths stay."""
        return _finer(scene, self, factor)

    def resized(self, scene, wanted):
        """The layout with every element replaced by another number of elements; wanted: for every rod (elements,),
        which may be fractional: the sum over a piece is rounded up."""

        def divide(rod, start, end):
            breaks, first, last = self._piece(rod, start, end)
            so_far = np.concatenate([[0.0], np.cumsum(wanted[rod][first:last])])
            count = math.ceil(so_far[-1] - 1e-9)
            return np.interp(np.linspace(0, so_far[-1], count + 1), so_far, breaks)

        return self._of_pieces(scene, divide, self._with(wanted))

    def with_short_ends(self, scene, longest):
        """The layout whose pieces have short elements at their ends, by repeated halving of the end elements; longest:
        for every rod (elements,) the largest length of each at the end of a piece, over the rod's length."""

        def divide(rod, start, end):
            breaks, first, last = self._piece(rod, start, end)
            halvings = [
                max(0, math.ceil(math.log2(size / most) - 1e-9))
                for size, most in zip(np.diff(breaks)[[0, -1]], longest[rod][[first, last - 1]], strict=True)
            ]
            if last == first + 1 and any(halvings):
                breaks = np.array([start, (start + end) / 2, end])
                halvings = [max(0, number - 1) for number in halvings]
            near, far = (0.5 ** np.arange(number, 0, -1) for number in halvings)
            before = start + near * (breaks[1] - start)
            after = end - far[::-1] * (end - breaks[-2])
            return np.concatenate([[start], before, breaks[1:-1], after, [end]])

        return self._of_pieces(scene, divide, self._with(longest))

    def pieces(self, scene):
        """For every rod the slices of its elements between neighbouring prescribed element ends."""
        fixed = _fixed_ends(scene)

        def slices(i):
            ends = np.searchsorted(self.breaks[i], fixed[i])
            return [slice(a, b) for a, b in itertools.pairwise(ends.tolist())]

        return once_each(zip(self.keys, fixed, strict=True), slices)

    @cached_property
    def keys(self):
        """A key that is equal for rods whose elements end at the same fractions of their lengths."""
        return [b.tobytes() for b in self.breaks]

    def _with(self, numbers):
        return [(key, x.tobytes()) for key, x in zip(self.keys, numbers, strict=True)]

    def _piece(self, rod, start, end):
        """The element ends of a piece, and the numbers of its first element and of the one after its last."""
        first, last = np.searchsorted(self.breaks[rod], [start, end])
        return self.breaks[rod][first : last + 1], int(first), int(last)

    @classmethod
    def _of_pieces(cls, scene, divide, keys):
        """The layout with the element ends `divide(rod index, start, end)` of every piece; equal for equal keys."""
        fixed = _fixed_ends(scene)

        def breaks(i):
            pieces = [divide(i, a, b)[:-1] for a, b in itertools.pairwise(fixed[i])]
            return np.concatenate([*pieces, [1.0]])

        return cls(tuple(once_each(zip(keys, fixed, strict=True), breaks)))

    def fits(self, scene):
        """Whether elements end where supports, loads, joints and kinks of a scene need it."""
        places = zip(_fixed_ends(scene), self.breaks, strict=True)
        return all(np.abs(np.subtract.outer(ends, breaks)).min(axis=1).max() <= 1e-9 for ends, breaks in places)

    @cached_property
    def counts(self):
        """Elements of each rod."""
        return tuple(len(b) - 1 for b in self.breaks)

    def vertex(self, scene, station):
        """(rod index, element end) of a station of the layout's scene."""
        rod = scene.number(station.rod)
        if station.s in (0.0, station.rod.length):
            return rod, len(self.breaks[rod]) - 1 if station.s else 0
        return rod, int(np.argmin(np.abs(self.breaks[rod] - station.s / station.rod.length)))

    def sizes(self, scene):
        """Length of every element, m, rods one after another."""
        return self.shares * np.repeat(scene.lengths, self.counts)

    @cached_property
    def shares(self):
        """(elements,) length of every element over that of its rod, rods one after another."""
        return np.concatenate(once_each(self.keys, lambda i: np.diff(self.breaks[i])))

    def inside(self, x):
        """(elements, len(x)) arc length over rod length of places x in [0, 1] of every element, for each rod."""
        return once_each(self.keys, lambda i: self.breaks[i][:-1, None] + np.diff(self.breaks[i])[:, None] * x)

    def node_s(self, nodes):
        """Arc length over rod length of every node of each rod, for reference nodes sorted in [0, 1]."""
        return once_each(self.keys, lambda i: self.nodes_of(i, nodes))

    def nodes_of(self, i, nodes):
        """`node_s` of the i-th rod alone."""
        b = self.breaks[i]
        return np.append((b[:-1, None] + np.diff(b)[:, None] * nodes[:-1]).ravel(), 1.0)

    def at_rest(self, scene, nodes):
        """(N, 3) positions at rest of the nodes of all rods, for `node_s`, m, from the origin of their structure."""
        of_rods = self.node_s(nodes)
        counts = [len(x) for x in of_rods]
        positions = positions_along([rod.curve for rod in scene.rods], np.concatenate(of_rods), counts)
        return positions - np.repeat(scene.origins, counts, axis=0)


@per_scene
def _equal(scene, elements):
    most = MOST_ELEMENTS // len(scene.rods)
    if elements > most:
        gigabytes = elements * len(scene.rods) * _GIGABYTES
        raise SceneError(
            f"elements = {elements} on {len(scene.rods)} rod(s) may take {gigabytes:.2g} GB of memory: "
            f"expected at most {most} per rod. "
            "A rod rarely needs more than 100; for the accuracy of a path leave `elements` out and ask for a `tol`."
        )

    def equal(rod, start, end):
        return np.linspace(start, end, max(1, round(elements * (end - start))) + 1)

    return Layout._of_pieces(scene, equal, [None] * len(scene.rods))


@per_scene
def _finer(scene, layout, factor):
    return layout.resized(scene, [np.full(count, float(factor)) for count in layout.counts])


@per_scene
def _fixed_ends(scene):
    """The element ends of every rod, over its length, that supports, loads, joints and kinks prescribe."""
    found = []
    for rod in scene.rods:
        stations = {station.s / rod.length for station in scene.stations(rod)}
        stations |= {s / rod.length for s in rod.breaks}
        ends = [0.0]
        for x in sorted(stations | {1.0}):  # nearly coincident stations share an element end
            if x - ends[-1] > 1e-9:
                ends.append(x)
        ends[-1] = 1.0
        found.append(tuple(ends))
    return found


def same_places(scene, other):
    """Whether what needs element ends lies at the same shares of the rods' lengths in two scenes with the same rods;
    places where the points of a spline lie are left out: nothing jumps there."""

    def places(rod, of):
        offsets = rod.mass_centre.breaks if rod.mass_centre else ()
        return np.sort([*(x.s for x in of.stations(rod)), *rod.profile.breaks, *offsets]) / rod.length

    found = [(places(a, scene), places(b, other)) for a, b in zip(scene.rods, other.rods, strict=True)]
    return all(a.shape == b.shape and np.allclose(a, b, rtol=0, atol=1e-10) for a, b in found)


class RodMesh:
    """A dolfinx mesh of intervals in reference arc length, one chain per rod, each starting at zero: derivatives and
    integrals on it are those along the rods, which may be curved; counts: elements of each rod."""

    def __init__(self, comm, counts):
        self.counts = counts
        #: (rods + 1,) the scene's number of each rod's first element, and the number of all
        self.first_cells = np.concatenate([[0], np.cumsum(counts)])
        first_vertex = self.first_nodes(1)
        rods = np.repeat(np.arange(len(counts)), counts)
        inner = np.arange(self.first_cells[-1]) - self.first_cells[rods]
        v0 = first_vertex[rods] + inner
        if comm.rank == 0:
            cells = np.column_stack([v0, v0 + 1]).astype(np.int64)
            x = np.arange(first_vertex[-1], dtype=float)[:, None]  # placed later, by `place`
        else:
            cells, x = np.empty((0, 2), dtype=np.int64), np.empty((0, 1))
        self.mesh, numbers = compat.create_interval_mesh(comm, cells, x)
        #: the scene's number of every local element, ghosts included; int64 also where a rank has none
        self.cells = np.asarray(numbers, dtype=np.int64)
        self.cell_rod, self.cell_inner = rods[self.cells], inner[self.cells]
        ends = compat.geometry_dofs(self.mesh)[: len(self.cells)]
        vertices = np.asarray(self.mesh.geometry.input_global_indices, dtype=np.int64)
        #: True where dolfinx orients an element from its end to its start
        self.reversed = vertices[ends[:, 0]] != v0[self.cells]
        self._vertex_rod = np.searchsorted(first_vertex[:-1], vertices, side="right") - 1
        self._vertex_inner = vertices - first_vertex[self._vertex_rod]

    def first_nodes(self, degree):
        """(rods + 1,) the scene's number of each rod's first node, for a degree, and the number of all."""
        return self.first_cells * degree + np.arange(len(self.first_cells))

    def place(self, ends):
        """Move the element ends to the arc lengths `ends`, one (n + 1,) array a rod (dimensionless)."""
        place = self.first_nodes(1)[self._vertex_rod] + self._vertex_inner
        self.mesh.geometry.x[:, 0] = np.concatenate(ends)[place]

    def fill(self, function, values, at_nodes=False):
        """Set a function at Gauss points, or at elements' nodes, from values (elements, points, k), scene's order."""
        local, space = values[self.cells], function.function_space
        local[self.reversed] = local[self.reversed][:, ::-1]
        if at_nodes:
            local = local[:, np.argsort(np.argsort(compat.element_nodes(space)))]
        function.x.array.reshape(-1, values.shape[2])[compat.cell_nodes(space)] = local

    def slots(self, space, degree):
        """(nodes,) the scene's number of every local node of a space of this degree."""
        order = np.argsort(np.argsort(compat.element_nodes(space)))
        along = np.where(self.reversed[:, None], degree - order[None, :], order[None, :])
        slots = self.first_nodes(degree)[self.cell_rod][:, None] + self.cell_inner[:, None] * degree + along
        node = compat.cell_nodes(space)[: len(self.cells)]
        local = space.dofmap.index_map
        of_node = np.empty(local.size_local + local.num_ghosts, dtype=np.int64)
        of_node[node] = slots
        return of_node


class Gather:
    """Collects values of owned entities from all ranks on every rank, in the scene's order."""

    def __init__(self, comm, slots, total):
        self._comm, self.total = comm, total
        self._slots = np.concatenate(comm.allgather(slots)) if comm.size > 1 else slots
        self._counts = np.array(comm.allgather(len(slots)))

    def __call__(self, values):
        """`values (owned, k)` -> (total, k)."""
        values = np.ascontiguousarray(values)
        result = np.empty((self.total, values.shape[1]))
        if self._comm.size > 1:
            everything = np.empty((self._counts.sum(), values.shape[1]))
            sizes = self._counts * values.shape[1]
            self._comm.Allgatherv(values, (everything, sizes))
            values = everything
        result[self._slots] = values
        return result


class Numbering:
    """The unknowns on one of dolfinx's spaces; comm: the caller's, not the mesh's copy, on which objects that PETSc
    puts aside would never be freed.

    node_dofs: (local nodes, block) local degrees of freedom; owned: number of the local nodes that this rank owns;
    slots: the scene's number of every local node; clamped, leaders: slots without unknowns, and {slot: the slot whose
    unknowns it shares}; multipliers: number of constraint equations, of which the first is first_multiplier.

    nodes: free nodes of this rank, of `block` unknowns each; size, total: unknowns of this rank, of all; rows: index in
    the solver's vector of every local degree of freedom of the space, -1 where clamped; free, of_free: local degrees of
    freedom with an index there, and that index.
    """

    def __init__(self, comm, space, node_dofs, owned, slots, clamped, leaders, multipliers=0):
        self.space, self.comm, self.block = space, comm, node_dofs.shape[1]
        dofmap = space.dofmap
        self._blocked = dofmap.index_map_bs > 1
        followers, leads = np.array([*leaders.items()], dtype=np.int64).reshape(-1, 2).T
        leader = np.arange(max(x.max(initial=-1) for x in (slots, followers, leads)) + 1)
        leader[followers] = leads
        lead, leading = leader[slots], np.zeros(len(leader), dtype=bool)
        leading[leads] = True
        free = ~np.isin(lead, list(clamped))
        own = np.zeros(len(slots), dtype=bool)
        own[:owned] = (free & (lead == slots))[:owned]
        self.nodes = int(own.sum())
        # sizes of vectors and matrices in node blocks must be multiples of them
        self._blocked = self._blocked and not multipliers
        dofs = dofmap.index_map.size_local * dofmap.index_map_bs
        other = np.ones(dofs, dtype=bool)
        other[node_dofs[:owned].ravel()] = False
        others = np.flatnonzero(other)
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
        self._share(slots, lead, own, node_dofs, leading)
        self.rows[node_dofs[~free]] = -1
        self._connect(own.sum() != free[:owned].sum())

    def _share(self, slots, lead, own, node_dofs, leading):
        """Give every rank the indices of the nodes whose unknowns others share."""
        here = np.flatnonzero(own & leading[slots])
        shared = self.comm.allgather((slots[here], self.rows[node_dofs[here]]))
        at, rows = (np.concatenate(parts) for parts in zip(*shared, strict=True))
        place = np.full(len(leading), -1)
        place[at] = np.arange(len(at))
        follows = np.flatnonzero(leading[lead] & (place[lead] >= 0))
        self.rows[node_dofs[follows]] = rows[place[lead[follows]]]

    def _connect(self, shared):
        """Prepare the transfer between the solver's vector and dolfinx's local degrees of freedom."""
        self.free = np.flatnonzero(self.rows >= 0)
        self.of_free = self.rows[self.free]
        mine = (self.of_free >= self.first) & (self.of_free < self.first + self.size)
        #: of this rank's unknowns, those of constraint equations left out, a local degree of freedom of each
        self._from = np.zeros(
            self.size if self.first + self.size < self.total else self.first_multiplier - self.first, int
        )
        self._from[self.of_free[mine] - self.first] = self.free[mine]
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
        array, count = x.array_w, len(self._from)
        np.take(numbers, self._from, out=array[:count], mode="clip")
        array[count:] = 0.0

    def add_up(self, numbers, b):
        """Sum local contributions, of all ranks and joined nodes, into a solver's vector."""
        if self._serial and not self._shared:
            self.from_local(numbers, b)
        elif self._serial:
            b.array_w[:] = np.bincount(self.of_free, numbers[self.free], minlength=self.size)
        else:
            b.set(0.0)
            self._local.array_w[:] = numbers[self.free]
            self._scatter.scatter(self._local, b, PETSc.InsertMode.ADD_VALUES, PETSc.ScatterMode.REVERSE)

    def matrix(self, cell_dofs, tied, pattern):
        """A matrix preallocated for all elements of this rank (cell_dofs: (cells, dofs) local degrees of freedom) and
        for what ties of a `TiePattern` add between nodes; tied: (tied nodes, block) indices (of any rank) of the
        unknowns in constraint equations, -1 where clamped; the same on all ranks."""
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
