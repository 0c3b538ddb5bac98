"""Supports and joints on a layout: where they act, their constraint equations, and the reactions of clamped points.

Every equation c = 0 is a function of the position and the rotation of one or two nodes (forms/ties.py); its multiplier
lambda is the reaction. Derivatives are by small displacements and small inertial rotations, which every model maps to
its own unknowns. A clamped point has no equation in the solver: its reaction follows from the balance of `Clamps`."""

from copy import copy
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import ufl
from mpi4py import MPI

from cosserat_fenicsx import compat
from cosserat_fenicsx.compat import compiling
from cosserat_fenicsx.forms import ties as eq
from cosserat_fenicsx.models.formulation import resultant_at_rest
from cosserat_fenicsx.scene.planes import independent_in
from cosserat_fenicsx.scene.signals import at, signals_of
from cosserat_fenicsx.scene.supports import AngleTie, PositionTie


@dataclass(frozen=True)
class Connections:
    """Which nodes have unknowns and which constraint equations are added; vertices are (rod index, element end).

    clamped: vertices without unknowns; leaders: pairs (vertex, leader): rigidly joined vertices and the one whose
    unknowns they share; ties: (kind, vertex of a, vertex of b or None) of all scalar equations of supports and joints,
    in the scene's order; equations: indices of the ties that are added: in a plane only independent ones that constrain
    motions in it.
    """

    clamped: tuple
    leaders: tuple
    ties: tuple
    equations: tuple

    @classmethod
    def of(cls, scene, layout, plane=None):
        """The connections of a scene, in space or in its plane."""
        leader = {}

        def find(vertex):
            while vertex in leader:
                vertex = leader[vertex]
            return vertex

        for joint in scene.joints:
            if joint.rigid:
                one, other = find(layout.vertex(scene, joint.first)), find(layout.vertex(scene, joint.second))
                if one != other:
                    leader[max(one, other)] = min(one, other)
        clamped = sorted({find(layout.vertex(scene, x.station)) for x in scene.supports if x.clamps})
        kinds = tuple(
            (type(tie).__name__, *(None if x is None else find(layout.vertex(scene, x)) for x in (tie.a, tie.b)))
            for tie in ties_of(scene)
        )
        equations = tuple(range(len(kinds))) if plane is None else independent_in(plane, ties_of(scene))
        return cls(tuple(clamped), tuple((vertex, find(vertex)) for vertex in sorted(leader)), kinds, equations)

    @property
    def tied(self):
        """Vertices in constraint equations, each once."""
        return tuple(dict.fromkeys(x for _, a, b in self.ties for x in (a, b) if x is not None))

    @cached_property
    def pattern(self):
        """The `TiePattern` of all ties on the vertices `tied`."""
        place = {vertex: i for i, vertex in enumerate(self.tied)}
        return TiePattern([(place[a], -1 if b is None else place[b]) for _, a, b in self.ties], len(place))


def ties_of(scene, t=0.0):
    """All scalar constraint equations of supports and joints that are not clamps or rigid joints, at a time (s)."""
    held = [*scene.supports, *(joint for joint in scene.joints if not joint.rigid)]
    return [tie for item in held for tie in at(item, t).ties()]


class TiePattern:
    """The pairs of tied nodes that constraint equations (ties) connect; ends: (a, b) of every tie as indices into
    `count` tied nodes; b = -1 for the ground. Blocks of a matrix are stored pair by pair, (pairs, rows of a node,
    columns of a node); all others are zero.

    first, second: (pairs,) the nodes of a pair's rows and columns; every node has a pair with itself: own (nodes,);
    mirrored: (pairs,) the pair with the two nodes exchanged; pairs: (ties, 2, 2) that of two ends of a tie, -1 with the
    ground.
    """

    def __init__(self, ends, count):
        self.ends, self.count = np.array(ends, dtype=np.int64).reshape(-1, 2), count
        keys = self.ends[:, :, None] * count + self.ends[:, None, :]
        here = (self.ends[:, :, None] >= 0) & (self.ends[:, None, :] >= 0)
        own = np.arange(count) * (count + 1)
        known = np.unique(np.concatenate([keys[here], own]))
        self.first, self.second = np.divmod(known, max(count, 1))
        self.own = np.searchsorted(known, own)
        self.mirrored = np.searchsorted(known, self.second * count + self.first)
        self.pairs = np.where(here, np.searchsorted(known, keys), -1)
        self._nodes = self.ends % (count + 1)  # the ground comes last

    def on_nodes(self, values, ties=None):
        """(ties, nodes, n) from values (ties, 2, n) by their ends; ties: the indices of those, or all."""
        found = np.zeros((len(values), self.count + 1, values.shape[2]))
        nodes = self._nodes if ties is None else self._nodes[ties]
        np.add.at(found, (np.arange(len(values))[:, None], nodes), values)
        return found[:, :-1]

    def of_ends(self, values):
        """(ties, 2, ...) values of the ends of every tie, from (nodes, ...); zero for the ground."""
        return np.concatenate([values, np.zeros((1, *values.shape[1:]))])[self.ends]

    def full(self, blocks):
        """(nodes * n, nodes * n) the whole matrix from blocks (pairs, n, n)."""
        matrix = np.zeros((self.count, blocks.shape[1], self.count, blocks.shape[2]))
        matrix[self.first, :, self.second] = blocks
        return matrix.reshape(self.count * blocks.shape[1], -1)

    def energy(self, blocks, motions):
        """(k,) v^T A v of motions v (k, nodes, n)."""
        return np.einsum("kpi,pij,kpj->k", motions[:, self.first], blocks, motions[:, self.second])

    def places(self, rows, equations):
        """Rows and columns in a matrix of what ties fill: (2, pairs * n * n) of blocks (pairs, n, n); rows (added * 2 *
        n,) of the ends' unknowns, -1 for the ground; and for each of them its equation. rows: (nodes, n) the numbers of
        the nodes' unknowns, -1 where clamped; equations: (added,) indices of the ties that are equations, which follow
        the nodes in this order with numbers from 0."""
        n = rows.shape[1]
        i, j = rows[self.first][:, :, None], rows[self.second][:, None, :]
        blocks = np.stack([np.broadcast_to(x, (len(self.first), n, n)).ravel() for x in (i, j)])
        of_ends = np.append(rows, np.full((1, n), -1), axis=0)[self.ends[equations]]
        return blocks, of_ends.ravel(), np.repeat(np.arange(len(equations)), 2 * n)

    def widths(self, n):
        """(nodes * n,) how many columns ties fill in the rows of the nodes' unknowns, n a node."""
        return np.repeat(np.bincount(self.first, minlength=self.count) * n, n)


_GROUND = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


@compat.rank_0_first
@cache
def _kernels():
    """The compiled `forms.ties.derivatives`, which are the same for all scenes and models."""
    return compat.on_rows(eq.derivatives(ufl.Constant(compat.interval_domain(), shape=(eq.COUNT,))))


class Ties:
    """The ties of a scene (`scene.supports`), dimensionless, with the `TiePattern` of the tied nodes; reference: (tied
    nodes, 3) positions at rest; length: unit of length, m; comm: of the ranks that make them together.

    numbers: (ties, n) data of all equations, see forms/ties.py; turning: indices of those whose gradients change;
    addresses: of the kernels of a row of these (`forms.ties.derivatives`); changing: where in it load factor and
    multiplier are.
    """

    changing = eq.PLACES["load_factor"].start, eq.PLACES["multiplier"].start

    def __init__(self, ties, pattern, reference, length, comm=MPI.COMM_SELF):
        with compiling():
            self._add_values, add_changes = _kernels(comm)
        self.addresses = self._add_values.address, add_changes.address
        self._length, self.pattern = length, pattern
        self._nodes = pattern.ends % (len(reference) + 1)  # the ground last
        rest = np.append(reference, [_GROUND[:3]], axis=0)
        # motions and load factor are of the last evaluation
        self.numbers, self._motion = np.zeros((len(ties), eq.COUNT)), np.tile(_GROUND, (len(rest), 1))
        self._at_rest = np.subtract(*rest[self._nodes.T])
        self._take(ties)
        self.turning = np.array([i for i, tie in enumerate(ties) if not isinstance(tie, PositionTie)], dtype=np.intp)

    def _take(self, ties):
        self.numbers[:, eq.PLACES["place"]] = self._at_rest
        for row, tie in zip(self.numbers, ties, strict=True):
            if isinstance(tie, PositionTie):
                row[eq.PLACES["place"]] += tie.offset / self._length * np.asarray(tie.direction)
            for name, value in _numbers(tie, self._length).items():
                row[eq.PLACES[name]] = value

    def with_numbers_of(self, ties):
        """The same equations with other data, those of prescribed motions at another time."""
        other = copy(self)
        other.numbers = self.numbers.copy()
        other._take(ties)
        return other

    def _see(self, rq, load_factor):
        self._motion[:-1] = rq
        self.numbers[:, : eq.MOTION] = self._motion.take(self._nodes, axis=0).reshape(-1, eq.MOTION)
        self.numbers[:, eq.PLACES["load_factor"]] = load_factor

    def evaluate(self, rq, load_factor):
        """(c (ties,); gradients (ties, 2, 6) over (displacement, rotation) of the nodes a and b, or the ground, which
        are also the reactions per unit of multiplier) at (r, q) (tied nodes, 7) and a load factor."""
        found = np.zeros((len(self.numbers), 13))
        self._see(rq, load_factor)
        self._add_values(self.numbers, found)
        return found[:, 0], found[:, 1:].reshape(-1, 2, 6)


def _numbers(tie, length):
    """The data of a tie of `cosserat_fenicsx.scene.supports` by their names in forms/ties.py."""
    if isinstance(tie, PositionTie):
        return {"n": tie.direction, "rate": tie.rate / length}
    if isinstance(tie, AngleTie):
        return {"t": tie.t, "w": tie.w}
    angle = float(np.linalg.norm(tie.rotation))
    about = np.divide(tie.rotation, angle or 1.0)
    return {"axis": tie.axis, "angle": angle, "about": about, "start": tie.start}


class Clamps:
    """The clamped points of a `RodModel`, in the order of `Connections.clamped`; rods joined rigidly there share one
    point. Forces and moments are inertial and dimensionless."""

    def __init__(self, model):
        links, self._model = model.signature.connections, model
        self.count = len(links.clamped)
        self._points = {vertex: i for i, vertex in enumerate(links.clamped)}
        self._points |= {vertex: self._points[leader] for vertex, leader in links.leaders if leader in self._points}
        self._find_elements()

    def _find_elements(self):
        """Find this rank's elements at clamped points: their local numbers, the end (0 or 1) and the point of each."""
        model, found = self._model, []
        rods, counts = model.rods, model.signature.counts
        first = rods.first_cells
        owned = {int(cell): i for i, cell in enumerate(rods.cells[: model.mesh.topology.index_map(1).size_local])}
        for (rod, vertex), point in self._points.items():
            for inner, end in ((vertex - 1, 1), (vertex, 0)):
                if 0 <= inner < counts[rod] and first[rod] + inner in owned:
                    found.append((owned[first[rod] + inner], end, point))
        self._cells, self._ends, self._of_point = np.array(found, dtype=np.int32).reshape(-1, 3).T.copy()

    def load(self):
        """Take the data of the model's scene."""
        scene, layout = self._model.scene, self._model.layout
        here = [(x, layout.vertex(scene, x.station)) for x in scene.actions if x.station is not None]
        here = [(action, self._points[vertex]) for action, vertex in here if vertex in self._points]
        self._moving = [(action, point) for action, point in here if signals_of(action)]
        self._fixed = [self._sum((x for x in here if not signals_of(x[0]) and x[0].scaled is scaled), 0.0)
                       for scaled in (True, False)]  # fmt: skip
        self._unloaded = not here
        self._maps = None

    def loads(self, load_factor, t=0.0):
        """(points, 6) force and moment of the actions at clamped stations, at the time t (s)."""
        scaled, full = self._fixed
        if self._unloaded:
            return full
        total = load_factor * scaled + full
        for moving in self._moving:
            total = total + (load_factor if moving[0].scaled else 1.0) * self._sum([moving], t)
        return total

    def _sum(self, actions, t):
        scene, scales, total = self._model.scene, self._model.scales, np.zeros((self.count, 6))
        for action, point in actions:
            total[point] += resultant_at_rest(action, scene, t) / np.repeat([scales.force, scales.moment], 3)
        return total

    def of_step(self):
        """(points, 6) what balances the stress of a step and the actions, see `virtual_work_of_step`; all ranks."""
        model, total = self._model, np.zeros((self.count, 6))
        if self._maps is None:
            self._maps = self._from_expressions()
        for expression, numbers in self._maps:
            total += (numbers @ compat.evaluate(expression, model.mesh, self._cells).ravel()).reshape(-1, 6)
        return model.comm.allreduce(total) if model.comm.size > 1 else total

    def _from_expressions(self):
        """[(expression, matrix)]: `of_step` is the sum of matrices times values on the elements at clamped points."""
        model, rule = self._model, self._model.rule
        if not len(self._cells):
            return []
        here, ends = model.rods.cells[self._cells], self._ends * model.signature.degree
        h, turned = (model.layout.sizes(model.scene) / model.scales.length)[here], model.rods.reversed[self._cells]
        value = rule.weights * rule.basis(rule.gauss)[:, ends].T * h[:, None]
        slope = rule.weights * rule.slopes[:, ends].T
        maps = [(model.forms.of_step, self._map(np.stack([value, slope], axis=2), turned))]
        if model.forms.of_step_at_nodes is not None:
            at_end = (ends[:, None] == np.arange(len(model.nodes))) * rule.lobatto * h[:, None]
            maps.append((model.forms.of_step_at_nodes, self._map(at_end[:, :, None], turned)))
        return maps

    def _map(self, weights, turned):
        """The matrix to (clamped points, 6), inertial, from weighted values (elements, points, parts, 2, 3)."""
        weights[turned] = weights[turned][:, ::-1]
        to_point = self._of_point == np.arange(self.count)[:, None]
        axes = self._model.axes.T
        matrix = np.einsum("kc,cgp,fe,xi->kfxcgpei", to_point, weights, np.eye(2), axes)
        return matrix.reshape(6 * self.count, -1)
