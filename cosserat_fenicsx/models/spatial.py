"""The spatial rung: r and q in P_p, three formulations of eq. (1), dimensionless."""

import contextlib

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from cosserat_fenicsx import compat
from cosserat_fenicsx.element import ElementRule
from cosserat_fenicsx.models.connections import ties_of
from cosserat_fenicsx.models.numbering import Numbering
from cosserat_fenicsx.models.rod_data import fill_fields, gauss_function, rod_data, rod_fields
from cosserat_fenicsx.models.rodmesh import Gather, RodMesh
from cosserat_fenicsx.models.scales import Scales
from cosserat_fenicsx.models.shape import place_loads
from cosserat_fenicsx.models.spatial_forms import compile_forms
from cosserat_fenicsx.models.ties import Ties
from cosserat_fenicsx.quaternions import small_rotation


class SpatialModel:
    """Spaces, data and forms of one `Shape`; `load` fills in the numbers of a scene.

    Attributes:
        state: dolfinx's unknowns (r, q, and what the variant adds), a Function; clamped nodes included.
        before, step: the state before a Newton step and the step, for `advance`.
        carried: Functions advanced beside the unknowns: n at the Gauss points (condensed variant), or ().
        carries_force: whether n is more than a function of (r, q).
        takes_motions: whether `set_motion` can start it from what another mesh found.
        load_factor: the Constant eta.
        forms: the `CompiledForms`.
        numbering, variation_numbering: the solver's unknowns, and those of the second variation in (r, theta).
        ties: the `Ties` of the scene, or None.
        scales: the `Scales` of the scene that is loaded.
        round_off: what rounding alone leaves of the residual's norm.
        unknowns: their number, over all ranks.
    """

    name = "spatial"

    def __init__(self, comm, shape):
        self.comm, self.shape = comm, shape
        with compat.quiet_compiler():
            self._build()

    def _build(self):
        shape, p = self.shape, self.shape.degree
        self.rods = RodMesh(self.comm, shape.counts)
        self.mesh = self.rods.mesh
        lagrange = compat.lagrange(self.mesh, p, 7)
        V7 = compat.function_space(self.mesh, lagrange)
        self.space = V7
        if shape.variant == "field":
            force = compat.lagrange(self.mesh, p - 1, 3, discontinuous=True)
            self.space = compat.function_space(self.mesh, compat.mixed(lagrange, force))
            self._force_nodes = compat.element_nodes(compat.function_space(self.mesh, force))
            self._force_dofs = compat.cell_nodes(self.space)[:, 7 * (p + 1) :]
        elif shape.variant == "multiplier":
            self.space = compat.function_space(self.mesh, compat.mixed(lagrange, compat.lagrange(self.mesh, 1, 1)))
        self.rotations = compat.function_space(self.mesh, compat.lagrange(self.mesh, p, 6))
        self.state, self.before, self.step = (fem.Function(self.space) for _ in range(3))
        self.load_factor = fem.Constant(self.mesh, np.float64(0))
        self._number(V7)
        self.data = rod_fields(self.mesh, shape.points)
        self.terms = [(work, place, [self._load_function(place) for _ in range(n)]) for work, place, n in shape.terms]
        self.carried = (gauss_function(self.mesh, shape.points, 3),) if shape.variant == "condensed" else ()
        for function in self.carried:
            self._carried_values = function.x.array.reshape(-1, 3)
            self._carried_nodes = compat.cell_nodes(function.function_space).ravel()
        self.carries_force = shape.variant in ("condensed", "field")
        self.takes_motions = shape.variant != "multiplier"
        self.forms = compile_forms(self, self.rotations, *(self.carried or (None,)))
        self.rule = ElementRule(self.nodes, self.forms.gauss, self.forms.weights)

    def _load_function(self, place):
        if place == "line":
            return gauss_function(self.mesh, self.shape.points, 3)
        return fem.Function(compat.function_space(self.mesh, compat.lagrange(self.mesh, 1, 3, discontinuous=True)))

    def _number(self, V7):
        p, rods, links = self.shape.degree, self.rods, self.shape.connections
        self.nodes = np.sort(compat.element_nodes(V7))
        self._slots = slots = rods.slots(V7, p)
        rq = np.arange(7 * len(slots)).reshape(-1, 7)  # node, component -> index into state.x.array
        cell_nodes = compat.cell_nodes(V7)
        if self.space is not V7:
            rq[cell_nodes] = compat.cell_nodes(self.space)[:, : 7 * (p + 1)].reshape(-1, p + 1, 7)
        self._rq, self._owned_nodes = rq, V7.dofmap.index_map.size_local
        owned_cells = self.mesh.topology.index_map(1).size_local
        self._owned_cells = np.arange(owned_cells, dtype=np.int32)
        self._local_cells = np.arange(len(rods.cells), dtype=np.int32)
        cells = sum(rods.counts)
        self._gather_nodes = Gather(self.comm, slots[: self._owned_nodes], cells * p + len(rods.counts))
        self._gather_cells = Gather(self.comm, rods.cells[:owned_cells], cells)
        first = np.concatenate([[0], np.cumsum(np.asarray(rods.counts) * p + 1)])

        def slot(vertex):
            return int(first[vertex[0]] + vertex[1] * p)

        clamped = {slot(x) for x in links.clamped}
        leaders = {slot(a): slot(b) for a, b in links.leaders}
        self.tied_slots = np.array([slot(x) for x in links.tied], dtype=np.int64)
        self.numbering = Numbering(self.space, rq, self._owned_nodes, slots, clamped, leaders, len(links.ties))
        theta = np.arange(6 * len(slots)).reshape(-1, 6)
        self.variation_numbering = Numbering(self.rotations, theta, self._owned_nodes, slots, clamped, leaders)
        others = compat.cell_nodes(self.space)[:owned_cells, 7 * (p + 1) :] if self.space is not V7 else None
        of_nodes = rq[cell_nodes[:owned_cells]].reshape(owned_cells, 7 * (p + 1))
        self.cell_dofs = of_nodes if others is None else np.concatenate([of_nodes, others], axis=1)
        self.variation_cell_dofs = theta[cell_nodes[:owned_cells]].reshape(owned_cells, 6 * (p + 1))
        self.unknowns = self.numbering.total - self.numbering.idle

    def rows_of_tied(self, numbering):
        """(tied nodes, block) solver's numbers of the nodes that added equations speak of, on all ranks; -1: clamped."""
        dofs = self._rq if numbering is self.numbering else np.arange(6 * len(self._slots)).reshape(-1, 6)
        here = {int(s): numbering.rows[dofs[i]] for i, s in enumerate(self._slots) if s in self.tied_slots}
        everywhere = {}
        for part in self.comm.allgather(here):
            everywhere.update(part)
        return np.array([everywhere[s] for s in self.tied_slots.tolist()]).reshape(-1, numbering.block)

    # -- the numbers of a scene --------------------------------------------------------------------------------------

    def load(self, scene, layout):
        """Take the numbers of a scene of this shape; the state becomes its reference configuration."""
        self.scene, self.layout, self.scales = scene, layout, Scales.of(scene)
        scales, rods = self.scales, self.rods
        rods.place([b * rod.length / scales.length for rod, b in zip(scene.rods, layout.breaks, strict=True)])
        self.reference = np.concatenate([
            (rod.curve.position(x * rod.length) - scene.origin(rod)) / scales.length
            for rod, x in zip(scene.rods, layout.node_s(self.nodes), strict=True)
        ])  # fmt: skip
        data = rod_data(scene, layout, scales, self.rule, self.reference)
        fill_fields(self.data, rods, data, self.shape.variant)
        # |F| cannot fall below its own rounding: strains are differences of r over a node's spacing
        sizes = layout.sizes(scene) / scales.length
        stiffest = data.K[np.isfinite(data.K)].max(initial=0.0)
        self.round_off = 4 * np.finfo(float).eps * stiffest * self.shape.degree / sizes.min() * np.sqrt(self.unknowns)
        self._fill_loads(sizes)
        x = self.state.x.array
        x[:] = 0
        x[self._rq[:, :3]] = self.reference[self._slots]
        x[self._rq[:, 3]] = 1
        for function in self.carried:
            function.x.array[:] = 0
        self._tie()

    def _fill_loads(self, sizes):
        for (_, members), (_, place, functions) in zip(place_loads(self.scene, self.layout), self.terms, strict=True):
            if place == "line":
                self.rods.fill(functions[0], self._densities(members))
                continue
            for function in functions:
                function.x.array[:] = 0
            for load, (rod, vertex) in members:
                vectors = load.vectors(self.scene.rods[rod])
                for function, (value, unit) in zip(functions, vectors, strict=True):
                    self._at_end(function, rod, vertex, np.asarray(value) / self.scales.of_unit(unit), unit, sizes)

    def _densities(self, members):
        """(elements, points, 3) of a line load's term, dimensionless."""
        inside = self.layout.inside(self.rule.gauss)
        parts = [np.zeros((*x.shape, 3)) for x in inside]
        for load, (rod, _) in members:
            s = inside[rod].ravel() * self.scene.rods[rod].length
            density = load.density(self.scene.rods[rod], s) / self.scales.of_unit(load.unit)
            parts[rod] += density.reshape(parts[rod].shape)
        return np.concatenate(parts)

    def _at_end(self, function, rod, vertex, value, unit, sizes):
        """Put a point value on the one element that answers for an element end."""
        inner = min(vertex, self.shape.counts[rod] - 1)
        cell = np.flatnonzero((self.rods.cell_rod == rod) & (self.rods.cell_inner == inner))
        if len(cell) == 0:
            return
        end = int(vertex > inner) ^ int(self.rods.reversed[cell[0]])
        dof = compat.cell_nodes(function.function_space)[cell[0], end]
        # the rule at the ends weighs each by half the element; arms are geometry, not densities
        density = value if unit == "length" else value * 2 / sizes[self.rods.cells[cell[0]]]
        function.x.array.reshape(-1, 3)[dof] = density

    def _tie(self):
        links = self.shape.connections
        place = {vertex: i for i, vertex in enumerate(links.tied)}
        nodes = [(place[a], -1 if b is None else place[b]) for _, a, b in links.ties]
        reference = self.reference[self.tied_slots]
        self.ties = Ties(ties_of(self.scene), nodes, reference, self.scales.length) if nodes else None
        self.tied_reference = np.column_stack([reference, np.tile([1.0, 0, 0, 0], (len(reference), 1))])

    def set_motion(self, rq, n):
        """Take (r, q) at the nodes (N, 7) and n at the Gauss points (elements, points, 3), in the scene's order."""
        self.state.x.array[self._rq] = rq[self._slots]
        for function in self.carried:
            self.rods.fill(function, n)
        if self.shape.variant == "field":
            for reverse in (False, True):
                cells = np.flatnonzero(self.rods.reversed == reverse)
                along = self.rule.between_gauss(1 - self._force_nodes if reverse else self._force_nodes)
                values = np.einsum("jg,cgi->cji", along, n[self.rods.cells[cells]])
                self.state.x.array[self._force_dofs[cells]] = values.reshape(len(cells), 3 * self.shape.degree)

    # -- what solvers and results ask for ----------------------------------------------------------------------------

    def tie_maps(self, rq):
        """For added equations: from changes of a tied node's unknowns to (displacement, rotation), (nodes, 6, 7), and
        from (force, moment) to the node's rows, (nodes, 7, 6)."""
        trial, test = np.zeros((len(rq), 6, 7)), np.zeros((len(rq), 7, 6))
        trial[:, :3, :3] = test[:, :3, :3] = np.eye(3)
        test[:, 4:, 3:] = np.eye(3)
        for k, node in enumerate(rq):
            trial[k, 3:, 3:] = small_rotation(node[3:])
        return trial, test

    @contextlib.contextmanager
    def stress_alone(self):
        """Within it the second variation has no stiffness against stretch and shear: its change along a path is then
        that of the contact force and moment, and of the load, but not of the directions of the stiffness."""
        stiff = self.data.K_stiff.x.array
        kept = stiff.copy()
        stiff[:] = 0
        try:
            yield
        finally:
            stiff[:] = kept

    def advance(self):
        """Advance the carried fields by `step` from `before`; both must hold their ghosts."""
        if self.carried:
            values = compat.evaluate(self.forms.advance, self.mesh, self._local_cells)
            self._carried_values[self._carried_nodes] = values.reshape(-1, 3)

    def largest(self, change):
        """Largest move (rod lengths) or turn (rad) in a change of this rank's part of the solver's vector."""
        rq = self._nodal(change)
        moved, turned = np.einsum("ij,ij->i", rq[:, :3], rq[:, :3]), np.einsum("ij,ij->i", rq[:, 3:], rq[:, 3:])
        local = max(moved.max(initial=0), 4 * turned.max(initial=0)) ** 0.5
        return self.comm.allreduce(local, op=MPI.MAX) if self.comm.size > 1 else local

    def inner(self, a, b):
        """Inner product of two changes of (r, q) over all nodes and ranks."""
        local = float(np.einsum("ij,ij->", self._nodal(a), self._nodal(b)))
        return self.comm.allreduce(local) if self.comm.size > 1 else local

    def _nodal(self, change):
        """(free nodes, 7) of this rank's part of the solver's vector."""
        return change[: 7 * self.numbering.nodes].reshape(-1, 7)

    def shape_of(self, change):
        """(N, 3) displacements in a change of this rank's part of the solver's vector at all nodes, the scene's order,
        all ranks."""
        vector, local = self.numbering.vector(), np.zeros_like(self.state.x.array)
        vector.array_w[:] = change
        self.numbering.to_local(vector, local)
        return self._gather_nodes(local[self._rq[: self._owned_nodes, :3]])

    def change_of(self, motion):
        """This rank's part of the change of the solver's vector that a vector (r, theta) of the second variation's
        numbering stands for, at the state."""
        state = self.state.x.array
        moved, change = np.zeros(6 * len(self._rq)), np.zeros_like(state)
        self.variation_numbering.to_local(motion, moved)
        moved, q = moved.reshape(-1, 6), state[self._rq[:, 3:]]
        theta = moved[:, 3:]
        change[self._rq[:, :3]] = moved[:, :3]
        change[self._rq[:, 3]] = -np.einsum("ij,ij->i", theta, q[:, 1:]) / 2
        change[self._rq[:, 4:]] = (q[:, :1] * theta + np.cross(theta, q[:, 1:])) / 2
        vector = self.numbering.vector()
        self.numbering.from_local(change, vector)
        return vector.array_r.copy()

    def snapshot(self):
        """(r, q) at the nodes (N, 7) and (n, m, r') at the Gauss points (cells, points, 9), the scene's order, all
        ranks; dimensionless, inertial."""
        rq = self._gather_nodes(self.state.x.array[self._rq[: self._owned_nodes]])
        values = compat.evaluate(self.forms.fields, self.mesh, self._owned_cells)
        points = len(self.forms.gauss)
        values = values.reshape(-1, points, 9)
        reverse = self.rods.reversed[: len(values)]
        values[reverse] = values[reverse][:, ::-1]
        return rq, self._gather_cells(values.reshape(len(values), points * 9)).reshape(-1, points, 9)
