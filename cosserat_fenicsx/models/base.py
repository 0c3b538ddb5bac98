"""What all rungs share: the mesh, the numbering of unknowns, the numbers of a scene, and what solvers ask for."""

import math
from collections import namedtuple

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from cosserat_fenicsx import compat
from cosserat_fenicsx.element import ElementRule
from cosserat_fenicsx.models.connections import ties_of
from cosserat_fenicsx.models.load_terms import LoadTerms
from cosserat_fenicsx.models.numbering import Numbering
from cosserat_fenicsx.models.rod_data import bounded, fill_fields, gauss_function, rod_data, rod_fields
from cosserat_fenicsx.models.rodmesh import Gather, RodMesh
from cosserat_fenicsx.models.scales import Scales
from cosserat_fenicsx.models.ties import Ties

#: One part of the second variation, which decouples from the others: its compiled form, its `Numbering`, the local
#: numbers of every element of this rank, the numbers of the tied nodes (see `RodModel.rows_of_tied`), what its
#: components are as (displacement, rotation), (block, 6), inertial; and whether they leave the plane of a planar rung.
SecondVariation = namedtuple("SecondVariation", "form numbering cell_dofs tied axes sideways")


class RodModel:
    """Spaces, data and forms of one `Shape`; `load` fills in the numbers of a scene. A rung fills in the rest.

    Attributes:
        state: dolfinx's unknowns (those of the nodes, and what the variant adds), a Function; clamped nodes included.
        before, step: the state before a Newton step and the step, for `advance`.
        carried: Functions advanced beside the unknowns: n at the Gauss points (condensed variant), or ().
        carries_force: whether n is more than a function of the motion.
        takes_motions: whether `set_motion` is known.
        load_factor: the Constant eta.
        forms: the `CompiledForms`.
        numbering: the solver's unknowns.
        second_variations: the `SecondVariation`s whose negative squares add up; those in (displacement, rotation) of
            the scene that is loaded have its axes.
        variation_spaces: the spaces of their forms.
        ties: the `Ties` of the scene, or None.
        scales: the `Scales` of the scene that is loaded.
        axes: (3, 3) rows: the inertial directions that vectors have components along.
        load_norm: size of the loads that are not in `forms.dead`, at load factor 1.
        round_off: what rounding alone leaves of the residual's norm.
        tangent: what factors it, see `linear.factor_tangent`.
        unknowns: their number, over all ranks.
    """

    #: of a rung: its name, the unknowns of a node, how many of them are displacements, and what a change of one of the
    #: others turns a section by, rad.
    name, components, moves, turn = "", 0, 0, 1.0
    #: numbers a Gauss point has for the reference frame and the reference strain, and for the contact force.
    frame_size, strain_size, force_size = 9, 3, 3
    #: components of a node in each second variation, and whether these leave the plane.
    variations = ()
    tangent = "general"
    load_norm = 0.0

    def __init__(self, comm, shape):
        self.comm, self.shape, self.axes = comm, shape, np.eye(3)
        with compat.quiet_compiler():
            self._build()

    # -- what a rung fills in ----------------------------------------------------------------------------------------

    def _elements(self, degree):
        """Elements beside the nodal one."""
        if self.shape.variant == "field":
            return [compat.lagrange(self.mesh, degree - 1, self.force_size, discontinuous=True)]
        return []

    def _compile(self, spaces):
        """The `CompiledForms`; `spaces` of the second variations."""
        raise NotImplementedError

    def _section_data(self, data):
        """`RodData` as the rung's forms read it."""
        return data

    def _at_rest(self):
        """(N, components) unknowns of all nodes in the reference configuration, the scene's order."""
        raise NotImplementedError

    def _variation_axes(self):
        """`SecondVariation.axes` of each."""
        raise NotImplementedError

    def tied_motion(self, values):
        """(r, q), (nodes, 7), inertial, from the unknowns of tied nodes, (nodes, components)."""
        raise NotImplementedError

    def tie_maps(self, values):
        """For added equations: from changes of a tied node's unknowns to (displacement, rotation),
        (nodes, 6, components), and from (force, moment) to the node's rows, (nodes, components, 6); one for all nodes where
        these are alike."""
        raise NotImplementedError

    def unknowns_of(self, rq):
        """The nodes' unknowns (.., N, components) of (r, q) (.., N, 7), the scene's order."""
        raise NotImplementedError

    def expansion(self):
        """A function from load factors (k,) and snapshots' arrays, stacked, to (r, q) (k, N, 7) and (n, m, r')
        (k, cells, points, 9), dimensionless, inertial. It holds for the scene that is loaded now, also after another
        one is."""
        raise NotImplementedError

    def _without_saddle(self):
        """What factors the tangent where it has no saddle point to pivot for."""
        return "general" if self.shape.slender or self.comm.size > 1 else "blocks"

    # -- building ----------------------------------------------------------------------------------------------------

    def _build(self):
        shape, p = self.shape, self.shape.degree
        self.rods = RodMesh(self.comm, shape.counts)
        self.mesh = self.rods.mesh
        element = compat.lagrange(self.mesh, p, self.components)
        self.nodal_space = self.space = compat.function_space(self.mesh, element)
        others = self._elements(p)
        if others:
            self.space = compat.function_space(self.mesh, compat.mixed(element, *others))
            self._force_nodes = compat.element_nodes(compat.function_space(self.mesh, others[0]))
        spaces = self.variation_spaces = [
            compat.function_space(self.mesh, compat.lagrange(self.mesh, p, size)) for size, _ in self.variations
        ]
        self.state, self.before, self.step = (fem.Function(self.space) for _ in range(3))
        self.load_factor = fem.Constant(self.mesh, np.float64(0))
        self._number()
        self.data = rod_fields(self.mesh, shape.points, self.frame_size, self.strain_size)
        self._loads = LoadTerms(self.rods, shape)
        self.terms = self._loads.terms
        condensed = shape.variant == "condensed"
        self.carried = (gauss_function(self.mesh, shape.points, self.force_size),) if condensed else ()
        for function in self.carried:
            self._carried_values = function.x.array.reshape(-1, self.force_size)
            self._carried_nodes = compat.cell_nodes(function.function_space).ravel()
        self.carries_force = shape.variant not in ("displacement", "multiplier")
        self.takes_motions = shape.variant != "multiplier"
        self.forms = self._compile(spaces)
        if self.tangent == "general" and self.space is self.nodal_space and not self.numbering.multipliers:
            self.tangent = self._without_saddle()
        self.rule = ElementRule(self.nodes, self.forms.gauss, self.forms.weights)
        self._prepare_variations(spaces)

    def _number(self):
        p, rods, links = self.shape.degree, self.rods, self.shape.connections
        V, size = self.nodal_space, self.components
        self.nodes = np.sort(compat.element_nodes(V))
        self._slots = slots = rods.slots(V, p)
        nodal = np.arange(size * len(slots)).reshape(-1, size)  # node, component -> index into state.x.array
        self._cell_nodes = cell_nodes = compat.cell_nodes(V)
        if self.space is not V:
            nodal[cell_nodes] = compat.cell_nodes(self.space)[:, : size * (p + 1)].reshape(-1, p + 1, size)
        self._nodal, self._owned_nodes = nodal, V.dofmap.index_map.size_local
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
        self._held = slots, clamped, leaders
        self.tied_slots = np.array([slot(x) for x in links.tied], dtype=np.int64)
        self.numbering = Numbering(self.space, nodal, self._owned_nodes, *self._held, len(links.equations))
        others = compat.cell_nodes(self.space)[:owned_cells, size * (p + 1) :] if self.space is not V else None
        of_nodes = nodal[cell_nodes[:owned_cells]].reshape(owned_cells, size * (p + 1))
        self.cell_dofs = of_nodes if others is None else np.concatenate([of_nodes, others], axis=1)
        self.unknowns = self.numbering.total - self.numbering.idle

    def _prepare_variations(self, spaces):
        self._variations = []
        owned = len(self._owned_cells)
        for form, space, (size, sideways) in zip(self.forms.second_variations, spaces, self.variations, strict=True):
            dofs = np.arange(size * len(self._slots)).reshape(-1, size)
            numbering = Numbering(space, dofs, self._owned_nodes, *self._held)
            cell_dofs = dofs[self._cell_nodes[:owned]].reshape(owned, size * (self.shape.degree + 1))
            tied = self._rows_of_tied(numbering, dofs)
            self._variations.append(SecondVariation(form, numbering, cell_dofs, tied, None, sideways))

    @property
    def second_variations(self):
        """See the class."""
        axes = self._variation_axes()
        return [part._replace(axes=a) for part, a in zip(self._variations, axes, strict=True)]

    @property
    def rows_of_tied(self):
        """(tied nodes, components) solver's numbers of the nodes that added equations speak of, on all ranks; -1 where
        clamped."""
        return self._rows_of_tied(self.numbering, self._nodal)

    @property
    def rows_of_nodes(self):
        """(N, block) numbers of all nodes in the second variation (of a rung with one part), the scene's order, on all
        ranks; -1 where clamped."""
        (part,) = self._variations
        dofs = np.arange(part.numbering.block * len(self._slots)).reshape(-1, part.numbering.block)
        rows = np.empty((self._gather_nodes.total, part.numbering.block), dtype=np.int64)
        for slots, numbers in self.comm.allgather((self._slots, part.numbering.rows[dofs])):
            rows[slots] = numbers
        return rows

    def _rows_of_tied(self, numbering, dofs):
        here = {int(s): numbering.rows[dofs[i]] for i, s in enumerate(self._slots) if s in self.tied_slots}
        everywhere = {}
        for part in self.comm.allgather(here):
            everywhere.update(part)
        return np.array([everywhere[s] for s in self.tied_slots.tolist()], dtype=np.int64).reshape(-1, numbering.block)

    # -- the numbers of a scene --------------------------------------------------------------------------------------

    def load(self, scene, layout):
        """Take the numbers of a scene of this shape; the state becomes its reference configuration."""
        self.scene, self.layout, self.scales = scene, layout, Scales.of(scene)
        scales, rods = self.scales, self.rods
        rods.place([b * rod.length / scales.length for rod, b in zip(scene.rods, layout.breaks, strict=True)])
        self.axes = np.array(scene.plane.axes) if self.shape.flat else np.eye(3)
        self.reference = np.concatenate([
            (rod.curve.position(x * rod.length) - scene.origin(rod)) / scales.length
            for rod, x in zip(scene.rods, layout.node_s(self.nodes), strict=True)
        ])  # fmt: skip
        self.section = self._section_data(rod_data(scene, layout, scales, self.rule, self.reference))
        sizes = layout.sizes(scene) / scales.length
        lengths = np.repeat([rod.length / scales.length for rod in scene.rods], layout.counts)
        stiff = bounded(self.section, self.shape.variant, sizes, lengths)
        fill_fields(self.data, rods, self.section, stiff)
        self.round_off = self._round_off(sizes)
        self._loads.fill(scene, layout, scales, self.rule, self.axes)
        self._rest = self._at_rest()
        self.rest()
        self.tied_at_rest = self._rest[self.tied_slots]
        self._tie()
        self._local_stiffness(stiff, sizes)

    def rest(self):
        """The state becomes the reference configuration of the scene."""
        x = self.state.x.array
        x[:] = 0
        x[self._nodal] = self._rest[self._slots]
        for function in self.carried:
            function.x.array[:] = 0

    def _local_stiffness(self, stiff, sizes):
        """What one element resists a displacement and a rotation of each tied node with, (tied nodes, 6)."""
        links, first = self.shape.connections, self.layout.first_cells
        bend, K = self.section.J.max(axis=(1, 2)), stiff.max(axis=(1, 2))
        self.tied_stiffness = np.zeros((len(links.tied), 6))
        for k, vertex in enumerate(links.tied):
            for rod, v in (vertex, *(other for other, leader in links.leaders if leader == vertex)):
                for cell in {first[rod] + max(v - 1, 0), first[rod] + min(v, self.shape.counts[rod] - 1)}:
                    h = sizes[cell]
                    local = [K[cell] / h + 12 * bend[cell] / h**3] * 3 + [bend[cell] / h + K[cell] * h] * 3
                    self.tied_stiffness[k] = np.maximum(self.tied_stiffness[k], local)

    def _round_off(self, sizes):
        """|F| cannot fall below its own rounding: strains are differences of r over a node's spacing."""
        stiffest = self.section.K[np.isfinite(self.section.K)].max(initial=0.0)
        return 4 * np.finfo(float).eps * stiffest * self.shape.degree / sizes.min() * np.sqrt(self.unknowns)

    def _tie(self):
        links = self.shape.connections
        place = {vertex: i for i, vertex in enumerate(links.tied)}
        nodes = [(place[a], -1 if b is None else place[b]) for _, a, b in links.ties]
        reference = self.reference[self.tied_slots]
        self.ties = Ties(ties_of(self.scene), nodes, reference, self.scales.length) if nodes else None

    def set_motion(self, values, n):
        """Something to start from, in the scene's order: the nodes' unknowns (N, components), and n at the Gauss points
        (elements, points, 3), inertial, where the variant keeps it."""
        self.state.x.array[self._nodal] = values[self._slots]
        n = n @ self.axes[: self.force_size].T
        for function in self.carried:
            self.rods.fill(function, n)
        if self.shape.variant == "field":
            p, x = self.shape.degree, self._force_nodes
            dofs = compat.cell_nodes(self.space)[:, self.components * (p + 1) :]
            for reverse in (False, True):
                cells = np.flatnonzero(self.rods.reversed == reverse)
                along = self.rule.between_gauss(1 - x if reverse else x)
                values = np.einsum("jg,cgi->cji", along, n[self.rods.cells[cells]])
                self.state.x.array[dofs[cells]] = values.reshape(len(cells), self.force_size * p)

    # -- what solvers and results ask for ----------------------------------------------------------------------------

    def advance(self):
        """Advance the carried fields by `step` from `before`; both must hold their ghosts."""
        if self.carried:
            values = compat.evaluate(self.forms.advance, self.mesh, self._local_cells)
            self._carried_values[self._carried_nodes] = values.reshape(-1, self.force_size)

    def largest(self, change):
        """Largest move (rod lengths) or turn (rad) in a change of this rank's part of the solver's vector."""
        squares, moves = np.square(self._of_nodes(change).reshape(-1, self.components)), self.moves
        turned = squares[:, moves:].sum(axis=1).max(initial=0)
        moved = squares[:, :moves].sum(axis=1).max(initial=0) if moves else 0.0
        local = math.sqrt(max(moved, self.turn**2 * turned))
        return self.comm.allreduce(local, op=MPI.MAX) if self.comm.size > 1 else local

    def inner(self, a, b):
        """Inner product of two changes of the nodes' unknowns over all nodes and ranks."""
        local = float(self._of_nodes(a) @ self._of_nodes(b))
        return self.comm.allreduce(local) if self.comm.size > 1 else local

    def _of_nodes(self, change):
        """The nodes' part of this rank's part of the solver's vector, node by node."""
        return change[: self.components * self.numbering.nodes]

    def snapshot(self):
        """What `expansion` needs: the nodes' unknowns (N, components), and what the Gauss points know
        (cells, points, k), or None; the scene's order, all ranks, dimensionless."""
        nodal = self._gather_nodes(self.state.x.array[self._nodal[: self._owned_nodes]])
        if self.forms.fields is None:
            return nodal, None
        points, size = len(self.forms.gauss), self.forms.fields_size
        values = compat.evaluate(self.forms.fields, self.mesh, self._owned_cells)
        values = values.reshape(len(self._owned_cells), points, size)
        reverse = self.rods.reversed[: len(values)]
        values[reverse] = values[reverse][:, ::-1]
        return nodal, self._gather_cells(values.reshape(len(values), points * size)).reshape(-1, points, size)
