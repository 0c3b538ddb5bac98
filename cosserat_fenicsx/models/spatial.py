"""The spatial rung: r and q in P_p, three formulations of eq. (1), dimensionless."""

import numbers
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from cosserat_fenicsx import compat
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.forms import loads as virtual_work
from cosserat_fenicsx.models.rodmesh import Gather, RodMesh
from cosserat_fenicsx.models.scales import Scales
from cosserat_fenicsx.models.spatial_forms import compile_forms

FORMULATIONS = ("mixed", "displacement", "multiplier")

# Bounds EA and GA where only the sign of the second variation is asked for, in EI/L^2, by variant: more would drown
# the bending of slender rods and the weak modes of thin blades in rounding; this shifts a critical load by 1e-5 or less.
_STIFF = {"condensed": 1e6, "field": 1e5}


@dataclass(frozen=True)
class Shape:
    """What decides which code is compiled and which mesh is made; equal shapes share one model.

    Attributes:
        counts: elements of each rod.
        degree: p of r and q.
        variant: "condensed" or "field" (both formulation "mixed"), "displacement" or "multiplier".
        points: Gauss points of an element.
        terms: the kinds of loads, (function of forms.loads, "point" or "line", number of vectors), each as often as
            loads of that kind share an element end.
    """

    counts: tuple
    degree: int
    variant: str
    points: int
    terms: tuple

    @classmethod
    def of(cls, scene, layout, *, formulation, degree, points=None):
        """The shape of a scene on a layout.

        Raises:
            SceneError: an unknown formulation, a degree outside 1..4, or an infinite stiffness where the
                formulation cannot take it.
        """
        if formulation not in FORMULATIONS:
            raise SceneError(f"formulation = {formulation!r}: {nearest(formulation, FORMULATIONS)}")
        if isinstance(degree, bool) or not isinstance(degree, numbers.Integral) or not 1 <= degree <= 4:
            raise SceneError(f"degree = {degree!r}: expected 1, 2, 3 or 4")
        if points is not None and (
            isinstance(points, bool) or not isinstance(points, numbers.Integral) or not 1 <= points <= 12
        ):
            raise SceneError(f"gauss_points = {points!r}: expected a whole number from 1 to 12")
        infinite = any(np.isinf([*rod.stiffness.shear, rod.stiffness.axial]).any() for rod in scene.rods)
        if infinite and formulation != "mixed":
            raise SceneError(
                f"formulation = '{formulation}' cannot take an infinite stiffness: expected 'mixed', "
                "which carries the contact force as an unknown"
            )
        if formulation == "multiplier" and points is None:
            points = degree + 2  # CG1 for lambda needs full quadrature (and then locks)
        # On a fine mesh of a very slender rod rounding in the condensed tangent reaches the bending stiffness itself.
        drowned = _rounding(scene, layout, degree) > 1.0
        variant = {"mixed": "field" if infinite or drowned else "condensed"}.get(formulation, formulation)
        terms = tuple(key for key, _ in _place_loads(scene, layout))
        return cls(layout.counts, degree, variant, points or degree, terms)


def _rounding(scene, layout, degree):
    """Rounding of the stiffest entries of a condensed tangent over the bending stiffness of a node's spacing."""
    return max(
        np.finfo(float).eps * max(*rod.stiffness.shear, rod.stiffness.axial) * rod.length**2 / min(rod.stiffness.bending)
        * (cells * degree) ** 2
        for rod, cells in zip(scene.rods, layout.counts, strict=True)
    )  # fmt: skip


def _place_loads(scene, layout):
    """Load terms: [(key, [(load, rod index, vertex or None)])], loads of a kind sharing a term where they can."""
    terms = []
    for load in scene.loads:
        work = getattr(virtual_work, load.work) if isinstance(load.work, str) else load.work
        places = (
            [layout.vertex(scene, load.station)]
            if load.station is not None
            else [(rod, None) for rod in range(len(scene.rods))]
        )
        place = "point" if load.station is not None else "line"
        key = (work, place, len(load.vectors(scene.rods[places[0][0]])))
        for known, members in terms:
            if known == key and not {at for _, at in members} & set(places):
                break
        else:
            members = []
            terms.append((key, members))
        members.extend((load, at) for at in places)
    return sorted(terms, key=lambda term: (term[0][0].__name__, term[0][1]))


class SpatialModel:
    """Spaces, data and forms of one `Shape`; `load` fills in the numbers of a scene.

    Attributes:
        state: the unknowns (r, q, and what the variant adds), a dolfinx Function.
        before, step: the state before a Newton step and the step, for `advance`.
        carried: Functions advanced beside the unknowns: n at the Gauss points (condensed variant), or ().
        carries_force: whether n is more than a function of (r, q).
        load_factor: the Constant eta.
        forms: the `CompiledForms`.
        fixed: local indices of the unknowns that supports hold.
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
        comm, shape = self.comm, self.shape
        self.rods = RodMesh(comm, shape.counts)
        self.mesh = self.rods.mesh
        p = shape.degree
        lagrange = compat.lagrange(self.mesh, p, 7)
        V7 = compat.function_space(self.mesh, lagrange)
        self.space = V7
        if shape.variant == "field":
            force = compat.lagrange(self.mesh, p - 1, 3, discontinuous=True)
            self.space = compat.function_space(self.mesh, compat.mixed(lagrange, force))
        elif shape.variant == "multiplier":
            self.space = compat.function_space(self.mesh, compat.mixed(lagrange, compat.lagrange(self.mesh, 1, 1)))
        self.state, self.before, self.step = (fem.Function(self.space) for _ in range(3))
        self.load_factor = fem.Constant(self.mesh, np.float64(0))
        self._number(V7)
        self._make_data()
        rotations = compat.function_space(self.mesh, compat.lagrange(self.mesh, p, 6))
        carried_n = None
        if shape.variant == "condensed":
            points = compat.at_quadrature_points(self.mesh, 2 * shape.points - 1, 3)
            carried_n = fem.Function(compat.function_space(self.mesh, points))
            self._carried_values = carried_n.x.array.reshape(-1, 3)
            self._carried_nodes = compat.cell_nodes(carried_n.function_space).ravel()
        self.carried = () if carried_n is None else (carried_n,)
        self.carries_force = shape.variant in ("condensed", "field")
        self.forms = compile_forms(self, rotations, carried_n)
        self.rotations = rotations

    def _number(self, V7):
        p, rods = self.shape.degree, self.rods
        self.nodes = np.sort(compat.element_nodes(V7))
        self._slots = rods.slots(V7, p)
        self._rq = np.arange(7 * len(self._slots)).reshape(-1, 7)  # node, component -> index into state.x.array
        self._blocked = self.space is V7
        if not self._blocked:
            cell_dofs = compat.cell_nodes(self.space)[:, : 7 * (p + 1)]
            self._rq[compat.cell_nodes(V7)] = cell_dofs.reshape(-1, p + 1, 7)
        self._owned_nodes = V7.dofmap.index_map.size_local
        owned_cells = self.mesh.topology.index_map(1).size_local
        self._owned_cells = np.arange(owned_cells, dtype=np.int32)
        self._local_cells = np.arange(len(rods.cells), dtype=np.int32)
        cells = sum(rods.counts)
        self._gather_nodes = Gather(self.comm, self._slots[: self._owned_nodes], cells * p + len(rods.counts))
        self._gather_cells = Gather(self.comm, rods.cells[:owned_cells], cells)
        dofmap = self.space.dofmap
        self.unknowns = dofmap.index_map.size_global * dofmap.index_map_bs
        self.owned = dofmap.index_map.size_local * dofmap.index_map_bs

    def _make_data(self):
        def function(degree, size):
            element = compat.lagrange(self.mesh, degree, size, discontinuous=True)
            return fem.Function(compat.function_space(self.mesh, element))

        self.data = SimpleNamespace(
            tangent=function(0, 3),  # d/ds = tangent . grad
            stretch=function(0, 1),  # ds = stretch dx: arc over chord
            K=function(0, 3),
            K_inv=function(0, 3),
            K_stiff=function(0, 3),
            J=function(0, 3),
            R_R=function(0, 9),
        )
        self.terms = [
            (work, place, [function(1 if place == "point" else 0, 3) for _ in range(vectors)])
            for work, place, vectors in self.shape.terms
        ]

    # -- the numbers of a scene --------------------------------------------------------------------------------------

    def load(self, scene, layout):
        """Take the numbers of a scene of this shape; the state becomes its reference configuration."""
        self.scene, self.layout, self.scales = scene, layout, Scales.of(scene)
        scales, rods, data = self.scales, self.rods, self.data

        def position(rod, x):  # every rod counts from its own start: digits are not lost on where it stands
            return (rod.curve.position(x * rod.length) - rod.curve.position(0.0)) / scales.length

        ends = [position(rod, b) for rod, b in zip(scene.rods, layout.breaks, strict=True)]
        rods.place(ends)
        arc = [np.diff(b) * rod.length / scales.length for rod, b in zip(scene.rods, layout.breaks, strict=True)]
        chord = np.concatenate([np.diff(x, axis=0) for x in ends])[rods.cells]
        length = np.linalg.norm(chord, axis=1)
        stretch = np.concatenate(arc)[rods.cells] / length
        _fill(data.stretch, stretch[:, None])
        _fill(data.tangent, chord / (length * stretch)[:, None])
        K = np.array([[*rod.stiffness.shear, rod.stiffness.axial] for rod in scene.rods]) / scales.force
        J = np.array([[*rod.stiffness.bending, rod.stiffness.torsion] for rod in scene.rods])
        J = J / (scales.moment * scales.length)
        finite = np.where(np.isinf(K), 0.0, K)
        bound = _STIFF.get(self.shape.variant, np.inf) * J[:, :2].max(axis=1, keepdims=True)
        _fill(data.K, finite[rods.cell_rod])
        _fill(data.K_inv, (1 / K)[rods.cell_rod])
        _fill(data.K_stiff, np.minimum(K, bound)[rods.cell_rod])
        _fill(data.J, J[rods.cell_rod])
        # |F| cannot fall below its own rounding: strains are differences of r over a node's spacing
        spacing = max(self.shape.counts) * self.shape.degree
        self.round_off = 4 * np.finfo(float).eps * float(finite.max()) * spacing * np.sqrt(self.unknowns)
        mid = [rod.curve.frame((b[:-1] + b[1:]) / 2 * rod.length).reshape(-1, 9)
               for rod, b in zip(scene.rods, layout.breaks, strict=True)]  # fmt: skip
        _fill(data.R_R, np.concatenate(mid)[rods.cells])
        self._load_terms(length)
        self._set_reference(np.concatenate([position(rod, s) for rod, s in
                                            zip(scene.rods, layout.node_s(self.nodes), strict=True)]))  # fmt: skip
        self._fix()

    def _load_terms(self, chord):
        for (_, members), (_, place, functions) in zip(_place_loads(self.scene, self.layout), self.terms, strict=True):
            for function in functions:
                function.x.array[:] = 0
            for load, (rod, vertex) in members:
                vectors = load.vectors(self.scene.rods[rod])
                for function, (value, unit) in zip(functions, vectors, strict=True):
                    scaled = np.asarray(value) / self.scales.of_unit(unit)
                    if place == "line":
                        function.x.array.reshape(-1, 3)[self.rods.cell_rod == rod] = scaled
                    else:
                        self._at_end(function, rod, vertex, scaled, unit, chord)

    def _at_end(self, function, rod, vertex, value, unit, chord):
        """Put a point value on the one element that answers for an element end."""
        inner = min(vertex, self.shape.counts[rod] - 1)
        cell = np.flatnonzero((self.rods.cell_rod == rod) & (self.rods.cell_inner == inner))
        if len(cell) == 0:
            return
        end = int(vertex > inner) ^ int(self.rods.reversed[cell[0]])
        dof = compat.cell_nodes(function.function_space)[cell[0], end]
        # the rule at the ends weighs each by half the chord; arms are geometry, not densities
        density = value if unit == "length" else value * 2 / chord[cell[0]]
        function.x.array.reshape(-1, 3)[dof] = density

    def _set_reference(self, r):
        self.reference = r
        x = self.state.x.array
        x[:] = 0
        x[self._rq[:, :3]] = r[self._slots]
        x[self._rq[:, 3]] = 1
        for function in self.carried:
            function.x.array[:] = 0

    def _fix(self):
        p = self.shape.degree
        first = np.concatenate([[0], np.cumsum(np.asarray(self.shape.counts) * p + 1)])
        slots = []
        for support in self.scene.supports:
            rod, vertex = self.layout.vertex(self.scene, support.station)
            slots.append(first[rod] + vertex * p)
        held = np.flatnonzero(np.isin(self._slots, slots))
        self.fixed = np.sort(self._rq[held].ravel()).astype(np.int32)
        self.fixed_rotations = np.sort((held[:, None] * 6 + np.arange(6)).ravel()).astype(np.int32)

    # -- what solvers and results ask for ----------------------------------------------------------------------------

    def advance(self):
        """Advance the carried fields by `step` from `before`; both must hold their ghosts."""
        if self.carried:
            values = compat.evaluate(self.forms.advance, self.mesh, self._local_cells)
            self._carried_values[self._carried_nodes] = values.reshape(-1, 3)

    def largest(self, change):
        """Largest move (rod lengths) or turn (rad) in a change of the unknowns, over all ranks."""
        rq = change.reshape(-1, 7) if self._blocked else change[self._rq]
        moved, turned = np.einsum("ij,ij->i", rq[:, :3], rq[:, :3]), np.einsum("ij,ij->i", rq[:, 3:], rq[:, 3:])
        local = max(moved.max(initial=0), 4 * turned.max(initial=0)) ** 0.5
        return self.comm.allreduce(local, op=MPI.MAX) if self.comm.size > 1 else local

    def inner(self, a, b):
        """Inner product of two changes of (r, q) over all nodes and ranks."""
        rq = self._rq[: self._owned_nodes]
        local = float(np.einsum("ij,ij->", a[rq], b[rq]))
        return self.comm.allreduce(local) if self.comm.size > 1 else local

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


def _fill(function, values):
    """Set a cell-wise function from values (cells, components)."""
    cells = compat.cell_nodes(function.function_space)[:, 0]
    function.x.array.reshape(-1, values.shape[1])[cells] = values
