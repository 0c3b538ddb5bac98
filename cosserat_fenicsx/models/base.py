"""The base of all models: units, mesh, unknowns, data of a scene, and what solvers evaluate."""

from collections import namedtuple
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from cosserat_fenicsx import compat
from cosserat_fenicsx.algebra.building import Mesh
from cosserat_fenicsx.compat import compiling
from cosserat_fenicsx.forms.equilibrium import Section
from cosserat_fenicsx.forms.law import stiffness_for
from cosserat_fenicsx.models.action_terms import ActionTerms, Densities
from cosserat_fenicsx.models.compiled import compile_evolutions, compile_static, threads_of
from cosserat_fenicsx.models.connections import Clamps, Ties, ties_of
from cosserat_fenicsx.models.rod_data import (
    as_matrix,
    bending_lengths,
    bounded,
    fill_fields,
    gauss_function,
    rod_data,
    rod_fields,
    stretch_values,
)
from cosserat_fenicsx.models.rodmesh import Gather, Numbering, RodMesh
from cosserat_fenicsx.numerics import ElementRule
from cosserat_fenicsx.scene.action import powers


@dataclass(frozen=True)
class Scales:
    """Units of length (m), force (N), moment (N m): L, EI/L^2, EI/L of the longest rod: one tolerance suits all."""

    length: float
    force: float
    moment: float

    @classmethod
    def of(cls, scene, EI=None):
        """Scales of the longest rod of a scene; EI (N m^2) instead of that rod's largest."""
        rod = max(scene.rods, key=lambda rod: rod.length)
        EI, L = EI or float(rod.profile.range[1].J[:2].max()), rod.length
        return cls(L, EI / L**2, EI / L)

    def of_unit(self, unit, time=1.0):
        """The scale of a unit of `scene.action`, for a unit of time (s)."""
        force, length, times = powers(unit)
        return self.force**force * self.length**length * time**times


#: One part of the second variation, decoupled from the others: its compiled form, its `Numbering`, the local degrees of
#: freedom of every element of this rank, the rows of the tied nodes (see `RodModel.rows_of_tied`), the inertial
#: (displacement, rotation) of each component, (block, 6); and whether they leave the plane of a planar model.
SecondVariation = namedtuple("SecondVariation", "form numbering cell_dofs tied axes sideways")


class RodModel:
    """Spaces, data and forms of one `Signature`; `load` fills in the data of a scene. Subclasses are the models.

    Attributes:
        state: Function of the unknowns (nodal, and of the formulation), clamped nodes included.
        before, step: the state before a Newton step and the step, for `advance`.
        carried: Functions updated after each Newton step together with the unknowns: n at the Gauss points, or ().
        carried_dofs: (local elements, n) places of an element's carried numbers.
        carries_force: whether n is not a function of the motion alone; force_is_unknown: whether it is a field of
            unknowns.
        force_nodes: reference coordinates of the nodes of n, where n is an unknown.
        load_factor: Constant, the factor of loads and prescribed motions; permanent_factor: Constant, the factor of
            permanent loads, 1 except while they are applied.
        actions: the `ActionTerms` with the data of all actions; densities: their `Densities`.
        forms: the `CompiledForms`.
        slots: (n,) the scene's number of every local node; the first `owned_nodes` belong to this rank.
        nodal: (n, components) local degrees of freedom of the local nodes.
        numbering: the solver's unknowns.
        second_variations: the `SecondVariation`s, whose numbers of negative eigenvalues add up; with the axes of the
            loaded scene.
        variation_spaces: the spaces of their forms.
        ties: the `Ties` of the scene, or None.
        scales: the `Scales` of the scene that is loaded.
        section: its `RodData`.
        bounded_K: the bounded K that the second variation uses, see `stiffen`.
        axes: (3, 3) rows: the inertial basis of the components of vectors.
        load_norm: size of the loads that are not in `forms.dead` and `forms.permanent`, at factors 1.
        round_off: bound on the rounding error of the residual's norm.
        unknowns: number of unknowns, over all ranks.
    """

    #: name of the model, unknowns per node, how many of them are displacements, the rotation of a section (rad) per
    #: unit change of the others, and how many of a node's last unknowns are multipliers.
    name, components, moves, turn, multipliers = "", 0, 0, 1.0, 0
    #: components per Gauss point of the reference frame, of the reference strain and of the contact force.
    frame_size, strain_size, force_size = 9, 3, 3
    #: of each second variation: the components of a node, whether they leave the plane, and the function from them to
    #: the `VirtualMotion`, None for the variation that is the tangent.
    variations = ()
    #: factor of the law in the second variation, see `SpatialModel.stress_alone`.
    stiffness = 1
    #: whether the map from reactions to a node's residual rows depends on the node's unknowns
    rows_turn = False
    load_norm = 0.0
    #: unit of time for velocities, s; not used in statics
    time = 1.0
    #: bending stiffness that defines the units, N m^2; None to take each scene's own
    EI = None
    #: of the determinate models, space of three components per node on which forces do work
    displacements = None
    #: a `DataDerivative` and an `EnergyOfMotion`, see `made_once`
    data_derivative = energy_of_motion = None
    #: see `compiled.together`
    given = None
    #: of the unknowns, in chain.h
    kind = ""

    def __init__(self, comm, signature):
        self.comm, self.signature, self.axes = comm, signature, np.eye(3)
        with compiling():
            self._build()

    # -- for subclasses to define ------------------------------------------------------------------------------------

    def _compile(self, spaces):
        """The `CompiledForms`; `spaces` of the second variations."""
        return compile_static(self, spaces)

    def _section_data(self, data):
        """`RodData` in the form that the model's forms use."""
        return data

    def cross_section(self):
        """The `equilibrium.Section` of the model's data without actions in the law, UFL; see `compiled.section_of`."""
        return Section(self.data.law, as_matrix(self.data.R_R), self.data.v_R)

    def motion_of(self, w, nodal):
        """The `equilibrium.Motion` of unknowns w; nodal: the same, or an alias for other quadrature rules."""
        raise NotImplementedError

    def tests_of(self, phi, motion):
        """The `VirtualMotion` of test functions phi of the unknowns at a motion."""
        raise NotImplementedError

    def point_of(self, w, w_t=None, *, rest, frame):
        """The `forms.point.Point` of unknowns w, with the rates w_t; rest, frame: see there."""
        raise NotImplementedError

    def constraint(self, motion, test, nodal, phi):
        """Terms added to eq. (1) at the nodes, or None; nodal, phi: unknowns of a node and their test functions."""
        return None

    def vector(self, a):
        """The vector, UFL, with the components a of the contact force."""
        return a if isinstance(a, ufl.core.expr.Expr) else ufl.as_vector(a)

    def components_of(self, n):
        """The components of a contact force that do not vanish identically in this model."""
        return n

    def fields_of(self, n, m, r_s):
        """The components of n, m and r' that do not vanish, for results; None where these follow from statics."""
        return ufl.as_vector([*n, *m, *r_s])

    def _at_rest(self):
        """(N, components) unknowns of all nodes in the reference configuration, in the scene's order."""
        raise NotImplementedError

    def _variation_axes(self):
        """`SecondVariation.axes` of each."""
        raise NotImplementedError

    def positions(self):
        """(n, 3) positions of the local nodes, inertial, from the origin of their structure."""
        raise NotImplementedError

    def tied_motion(self, values):
        """(r, q), (nodes, 7), inertial, from the unknowns of tied nodes, (nodes, components)."""
        raise NotImplementedError

    def turned_reactions(self, values, reactions):
        """(nodes, components, components) derivative of fixed reactions (nodes, 6), in a tied node's rows (`tie_maps`),
        by its unknowns; called where `rows_turn`."""
        raise NotImplementedError

    def tie_maps(self, values):
        """Matrices from changes of a tied node's unknowns to (displacement, rotation), (nodes, 6, components), and from
        (force, moment) to the node's rows, (nodes, components, 6); only one where all nodes have the same."""
        raise NotImplementedError

    def small_motion_maps(self, tangent):
        """How the inverse of the tangent (tangent: (nodes, components, components) its blocks on the diagonal) nearly
        follows from that of the second variation; of models in space whose nodes have no multipliers: matrices from the
        rows of a node to (force, moment); from its (displacement, rotation) to its unknowns; and from its rows to its
        unknowns for what is no motion."""
        raise NotImplementedError

    def held_forces(self, forces):
        """Forces and moments (.., 6), inertial, with zero for components that the model's equations do not contain."""
        return forces

    def unknowns_of(self, rq):
        """The nodes' unknowns (.., N, components) of (r, q) (.., N, 7), the scene's order."""
        raise NotImplementedError

    def expansion(self):
        """A function from load factors (k,) and stacked arrays of snapshots to (r, q) (k, N, 7) and (n, m, r') (k,
        cells, points, 9), dimensionless, inertial. It stays valid for the current scene after another is loaded."""
        if self._expanding is None:
            self._expanding = self._mesh_in_c()
        mesh, c = self._expanding, self._expanding.c

        def expand(load_factors, nodal, gauss):
            rq, fields = np.empty((*nodal.shape[:2], 7)), np.empty((len(nodal), c.elements, c.points, 9))
            mesh.call("expand_all", c, len(nodal), load_factors, nodal, gauss, rq, fields)
            return rq, fields

        return expand

    def _mesh_in_c(self):
        """The `Mesh` of the scene that is loaded, for `expansion`."""
        mesh = Mesh(self.layout.counts, self.rule, reference=self.reference, axes=self.axes)
        mesh.c.kind, mesh.c.components = getattr(mesh._lib, self.kind), self.components
        return mesh

    # -- building ----------------------------------------------------------------------------------------------------

    def _build(self):
        signature, p = self.signature, self.signature.degree
        self.rods = RodMesh(self.comm, signature.counts)
        self.mesh = self.rods.mesh
        element = compat.lagrange(self.mesh, p, self.components)
        self.nodal_space = self.space = compat.function_space(self.mesh, element)
        force = signature.formulation.force
        others = force.elements(self.mesh, p, self.force_size)
        if others:
            self.space = compat.function_space(self.mesh, compat.mixed(element, *others))
            self.force_nodes = compat.element_nodes(compat.function_space(self.mesh, others[0]))
        spaces = self.variation_spaces = [
            compat.function_space(self.mesh, compat.lagrange(self.mesh, p, size)) for size, *_ in self.variations
        ]
        self.state, self.before, self.step = (fem.Function(self.space) for _ in range(3))
        self.load_factor, self.permanent_factor = (fem.Constant(self.mesh, np.float64(x)) for x in (0, 1))
        self._number()
        self.data = rod_fields(
            self.mesh, signature.points, self.frame_size, self.strain_size, coupled=signature.coupled
        )
        self.actions, self.evolving, self.densities = ActionTerms(self.rods, signature, self.nodes), [], Densities()
        self.carried = (gauss_function(self.mesh, signature.points, self.force_size),) if force.carried else ()
        for function in self.carried:
            self.carried_dofs = compat.cell_dofs(function.function_space)
        self.carries_force, self.force_is_unknown = not force.of_motion, force.unknown
        self.forms = self._compile(spaces)
        compile_evolutions(self)
        self.rule = ElementRule(self.nodes, self.forms.gauss, self.forms.weights)
        self._prepare_variations(spaces)
        self.clamps = Clamps(self)

    def _number(self):
        p, rods, links = self.signature.degree, self.rods, self.signature.connections
        V, size = self.nodal_space, self.components
        self.nodes = np.sort(compat.element_nodes(V))
        self.slots = slots = rods.slots(V, p)
        #: (local elements, p + 1) local nodes in dolfinx's order, and the position of each along its element
        self.cell_nodes = compat.cell_nodes(V)
        self.node_order = np.argsort(np.argsort(compat.element_nodes(V)))
        dofs = compat.cell_dofs(self.space)  # nodal ones come first, node by node
        self.nodal, self.owned_nodes = np.empty((len(slots), size), dtype=np.int64), V.dofmap.index_map.size_local
        self.nodal[self.cell_nodes] = dofs[:, : size * (p + 1)].reshape(-1, p + 1, size)
        owned_cells = self.mesh.topology.index_map(1).size_local
        self.cell_dofs = dofs[:owned_cells]
        self._owned_cells = np.arange(owned_cells, dtype=np.int32)
        self._local_cells = np.arange(len(rods.cells), dtype=np.int32)
        cells = sum(rods.counts)
        self._gather_nodes = Gather(self.comm, slots[: self.owned_nodes], cells * p + len(rods.counts))
        self._gather_cells = Gather(self.comm, rods.cells[:owned_cells], cells)
        self._first_nodes = rods.first_nodes(p).tolist()
        slot = self.slot
        self._held = slots, {slot(x) for x in links.clamped}, {slot(a): slot(b) for a, b in links.leaders}
        self.tied_slots = np.array([slot(x) for x in links.tied], dtype=np.int64)
        self.numbering = Numbering(
            self.comm, self.space, self.nodal, self.owned_nodes, *self._held, len(links.equations)
        )
        self.unknowns = self.numbering.total

    #: see `compiled.threads_of`
    thread_forms = threads_of

    def slot(self, vertex):
        """The scene's number of the node at a vertex (rod index, element end)."""
        rod, end = vertex
        return self._first_nodes[rod] + int(end) * self.signature.degree

    def _prepare_variations(self, spaces):
        self._variations = []
        owned = len(self._owned_cells)
        for form, space, (size, sideways, _) in zip(self.forms.second_variations, spaces, self.variations, strict=True):
            dofs = np.arange(size * len(self.slots)).reshape(-1, size)
            numbering = Numbering(self.comm, space, dofs, self.owned_nodes, *self._held)
            cell_dofs = compat.cell_dofs(space)[:owned]
            tied = self._rows_everywhere(numbering, dofs)[self.tied_slots]
            self._variations.append(SecondVariation(form, numbering, cell_dofs, tied, None, sideways))

    @property
    def second_variations(self):
        """See the class."""
        axes = self._variation_axes()
        return [part._replace(axes=a) for part, a in zip(self._variations, axes, strict=True)]

    @property
    def rows_of_tied(self):
        """(tied nodes, components) rows in the solver's vector of the tied nodes, on all ranks; -1 where clamped."""
        return self._rows_everywhere(self.numbering, self.nodal)[self.tied_slots]

    @property
    def rows_of_nodes(self):
        """(N, block) rows of all nodes in the only second variation, scene's order, on all ranks; -1 where clamped."""
        (part,) = self._variations
        dofs = np.arange(part.numbering.block * len(self.slots)).reshape(-1, part.numbering.block)
        return self._rows_everywhere(part.numbering, dofs)

    def _rows_everywhere(self, numbering, dofs):
        """`rows_of_nodes` for any numbering; dofs: (local nodes, block) local degrees of freedom."""
        rows = np.empty((self._gather_nodes.total, numbering.block), dtype=np.int64)
        for slots, numbers in self.comm.allgather((self.slots, numbering.rows[dofs])):
            rows[slots] = numbers
        return rows

    # -- the numbers of a scene --------------------------------------------------------------------------------------

    def load(self, scene, layout):
        """Fill in the data of a scene of this signature; the state becomes its reference configuration."""
        self.scene, self.layout, self.scales, self._expanding = scene, layout, Scales.of(scene, self.EI), None
        scales, rods = self.scales, self.rods
        rods.place([b * rod.length / scales.length for rod, b in zip(scene.rods, layout.breaks, strict=True)])
        self.axes = np.array(scene.plane.axes) if self.signature.flat else np.eye(3)
        self.reference = layout.at_rest(scene, self.nodes) / scales.length
        data = rod_data(scene, layout, scales, self.rule, self.reference, coupled=self.signature.coupled)
        self._in_space = data
        self.section = self._section_data(data)
        sizes = layout.sizes(scene) / scales.length
        lengths = bending_lengths(data, [rod.length / scales.length for rod in scene.rods], layout.counts)
        self.structures = np.repeat([scene.number(scene.leader(rod)) for rod in scene.rods], layout.counts)
        stiff = self.signature.formulation.force.stiff
        self.bounded_K = bounded(self.section, stiff, sizes, lengths, self.structures)
        fill_fields(self.data, rods, self.section, self.bounded_K)
        self.round_off = float(self.round_off_of(self.section, sizes))
        self._rest = self._at_rest()
        self._rest_state = np.zeros_like(self.state.x.array)
        self._rest_state[self.nodal] = self._rest[self.slots]
        self.rest()
        self.actions.fill(self, self.time)
        self.densities.load(self)
        self.clamps.load()
        self.tied_at_rest = self._rest[self.tied_slots]
        self._tie()

    def stiffen(self, K):
        """Set the principal stiffnesses K (elements, points, 3) against stretch and shear in the second variation."""
        self.rods.fill(self.data.K_stiff, stretch_values(self.section, K))

    def rest(self):
        """The state becomes the reference configuration of the scene."""
        self.state.x.array[:] = self._rest_state
        for function in self.carried:
            function.x.array[:] = 0

    def round_off_of(self, section, sizes):
        """Bound on the rounding error of |F|: strains are differences of r over the spacing of the nodes; section:
        `RodData`, or of many scenes, K and J (n, elements, points, 3); sizes: of the elements."""
        stiffest = np.where(np.isfinite(section.K), section.K, 0.0).max(axis=(-3, -2, -1))
        return 4 * np.finfo(float).eps * stiffest * self.signature.degree / sizes.min() * np.sqrt(self.unknowns)

    def _tie(self):
        links, reference = self.signature.connections, self.reference[self.tied_slots]
        given = links.pattern, reference, self.scales.length, self.comm
        self.ties = Ties(ties_of(self.scene), *given) if links.ties else None

    def set_motion(self, values, n):
        """Set the initial guess, in the scene's order: the nodes' unknowns (N, components), and n at the Gauss points
        (elements, points, 3), inertial, used where n is carried or unknown."""
        self.state.x.array[self.nodal] = values[self.slots]
        self.put_force(n)

    def put_force(self, n):
        """Take n at the Gauss points, see `set_motion`."""
        self.signature.formulation.force.put(self, n @ self.axes[: self.force_size].T)

    # -- for solvers and results -------------------------------------------------------------------------------------

    @property
    def changing(self):
        """The Functions whose values change along a path."""
        actions = self.actions
        return (self.state, *self.carried, *actions.refreshed, *actions.tensions, *actions.memory_functions)

    @property
    def constants(self):
        """All Constants of the forms."""
        return [value for value in vars(self).values() if isinstance(value, fem.Constant)]

    def sizes(self, change):
        """Largest displacement (rod lengths) and rotation (rad) of a node of all ranks, in a change of the vector."""
        return self._largest_in(self.motion_in(change))

    def _largest_in(self, nodal):
        """`sizes` of changes of the nodes' unknowns (nodes, components)."""
        moved, turned = (np.square(x).sum(axis=1).max(initial=0.0) for x in np.split(nodal, [self.moves], axis=1))
        found = np.sqrt([moved, self.turn**2 * turned])
        if self.comm.size > 1:
            self.comm.Allreduce(MPI.IN_PLACE, found, op=MPI.MAX)
        return found.tolist()

    def largest(self, change):
        """The larger of the two `sizes`."""
        return max(self.sizes(change))

    def inner(self, a, b):
        """Inner product of two changes of the nodes' unknowns over all nodes and ranks."""
        local = float(np.vdot(self.motion_in(a), self.motion_in(b)))
        return self.comm.allreduce(local) if self.comm.size > 1 else local

    def motion_in(self, change):
        """(nodes, n) the unknowns without multipliers of this rank's nodes, from its part of the solver's vector."""
        nodal = change[: self.components * self.numbering.nodes].reshape(-1, self.components)
        return nodal[:, : self.components - self.multipliers]

    def snapshot(self):
        """The input of `expansion`: the nodes' unknowns (N, components), and the fields at the Gauss points (cells,
        points, k) or None; in the scene's order, on all ranks, dimensionless."""
        nodal = self._gather_nodes(self.state.x.array[self.nodal[: self.owned_nodes]])
        if self.forms.fields is None:
            return nodal, None
        return nodal, self.gathered(self.forms.fields, len(self.forms.gauss), self.forms.fields_size)

    def snapshots(self, x, fields):
        """`snapshot` at states of one process: from unknowns (k, unknowns), and fields (k, elements, n) or None."""
        numbering = self.numbering
        state = np.zeros((len(x), 1)) + self._rest_state
        state[:, numbering.free] = x[:, numbering.of_free]
        nodal = np.empty((len(x), *self.nodal.shape))
        nodal[:, self.slots] = state[:, self.nodal]
        if fields is None:
            return nodal, None
        values = fields.reshape(*fields.shape[:2], len(self.forms.gauss), -1).copy()
        values[:, self.rods.reversed] = values[:, self.rods.reversed][:, :, ::-1]
        found = np.empty_like(values)
        found[:, self.rods.cells] = values
        return nodal, found

    def gathered(self, expression, points, size):
        """(elements, points, size) values of a compiled expression, in the scene's order, on all ranks."""
        owned = len(self._owned_cells)
        values = compat.evaluate(expression, self.mesh, self._owned_cells).reshape(owned, points, size)
        reverse = self.rods.reversed[:owned]
        values[reverse] = values[reverse][:, ::-1]
        return self._gather_cells(values.reshape(owned, points * size)).reshape(-1, points, size)

    def bounded_stiffness(self):
        """K in the second variation at the state, (elements, points, 3), in the scene's order, on all ranks."""
        n = self.snapshot()[1][..., : self.force_size]
        return np.maximum(self.bounded_K, stiffness_for(np.linalg.norm(n, axis=2, keepdims=True), 1 / self.section.K))
