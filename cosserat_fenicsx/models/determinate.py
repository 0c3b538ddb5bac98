"""The determinate models: unknown theta in a plane, q in space, in P_p; statics gives n, and r follows."""

import numpy as np
from dolfinx import cpp

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import determinate as eq
from cosserat_fenicsx.forms import planar, spatial
from cosserat_fenicsx.forms.point import NONE, Point
from cosserat_fenicsx.forms.rotation import rotation_matrix, rotation_vector
from cosserat_fenicsx.models.base import RodModel
from cosserat_fenicsx.models.compiled import along, compile_static
from cosserat_fenicsx.models.spatial import PlaneModel, in_space
from cosserat_fenicsx.models.rod_data import gauss_function, spread
from cosserat_fenicsx.numerics import conjugate_product, directors


class Tree:
    """The rods of a `Signature`, which are trees with one clamped point and rigid joints alone, from their clamps
    outwards; cell_nodes: (elements, p + 1) nodes of every element, the scene's order."""

    def __init__(self, signature, rods):
        self._p = p = signature.degree
        self._first_cell, self._first_node = rods.first_cells, rods.first_nodes(p)
        rod = np.repeat(np.arange(len(rods.counts)), rods.counts)
        self.cell_nodes = (np.arange(self._first_cell[-1]) * p + rod)[:, None] + np.arange(p + 1)
        self._order = self._walk(signature.connections)

    def _walk(self, links):
        """[(rod, its element end towards the clamp, the node of the previous rod there, or None)], clamps first."""
        points = {vertex: {vertex} for vertex in links.clamped}
        for vertex, leader in links.leaders:
            points.setdefault(leader, {leader}).add(vertex)
        order, waiting, seen = [], [(clamp, None) for clamp in links.clamped], set()
        while waiting:
            point, before = waiting.pop(0)
            for rod, entry in sorted(points[point]):
                if rod in seen:
                    continue
                seen.add(rod)
                order.append((rod, entry, before))
                for other, members in points.items():
                    here = [vertex for which, vertex in members if which == rod]
                    if other != point and here:
                        waiting.append((other, self._node(rod, here[0])))
        return order

    def _node(self, rod, vertex):
        return int(self._first_node[rod] + vertex * self._p)

    def _rods(self, order):
        """For every rod: nodes and elements (slices), its element end towards the clamp, the previous rod's node."""
        for rod, entry, before in order:
            nodes = slice(self._first_node[rod], self._first_node[rod + 1])
            yield nodes, slice(self._first_cell[rod], self._first_cell[rod + 1]), entry, before

    def forces(self, nodal, rule):
        """(elements, points, d) the contact force at the Gauss points that balances dead forces (N, d) on the nodes:
        solves the discrete balance (n, l_i') = f_i for all nodes of an element except the one towards the clamp; at its
        other end acts the sum of all forces beyond it."""
        p, nodal = self._p, nodal.copy()
        gradient = rule.weights * rule.slopes.T  # (p + 1, points)
        n = np.empty((len(self.cell_nodes), len(rule.gauss), nodal.shape[1]))
        for nodes, cells, entry, before in self._rods(reversed(self._order)):
            f, mine = nodal[nodes], n[cells]
            ends, inner = f[::p], f[:-1].reshape(-1, p, f.shape[1])[:, 1:]
            sums = inner.sum(axis=1)
            carried = np.cumsum((ends[:0:-1] + np.pad(sums[:0:-1], ((1, 0), (0, 0)))), axis=0)[::-1]
            beyond = np.concatenate([inner, carried[:, None]], axis=1)
            carried = np.cumsum(ends[:-1] + np.pad(sums[:-1], ((1, 0), (0, 0))), axis=0)
            behind = np.concatenate([carried[:, None], inner], axis=1)
            mine[entry:] = np.linalg.solve(gradient[1:], beyond[entry:])
            mine[:entry] = np.linalg.solve(gradient[:-1], behind[:entry])
            if before is not None:
                nodal[before] += f.sum(axis=0)
        return n

    def positions(self, tangents, rest, rule):
        """(k, N, d) positions of all nodes from `tangents` (k, elements, points, d), r' at the Gauss points times the
        length of its element; rest: (N, d) positions at rest, where the clamps stay."""
        within = rule.from_slopes @ tangents
        r = np.empty((len(tangents), *rest.shape))
        for nodes, cells, entry, before in self._rods(self._order):
            steps = within[:, cells]
            ends = np.concatenate([np.zeros_like(steps[:, :1, 0]), np.cumsum(steps[:, :, -1], axis=1)], axis=1)
            at = r[:, before] if before is not None else rest[nodes.start + entry * self._p]
            ends += (at - ends[:, entry])[:, None]
            r[:, nodes][:, :-1] = (ends[:, :-1, None] + steps[:, :, :-1]).reshape(len(r), -1, rest.shape[1])
            r[:, nodes.stop - 1] = ends[:, -1]
        return r


class _KnownForce(RodModel):
    """Scenes whose rods are trees, each held by one clamp alone, under dead forces."""

    name = "determinate"

    def _compile(self, spaces):
        self.displacements = compat.function_space(self.mesh, compat.lagrange(self.mesh, self.signature.degree, 3))
        self._force = gauss_function(self.mesh, self.signature.points, self.force_size)
        lasting = any(kind.scaled != "load" for kind in self.signature.terms)
        self._permanent = gauss_function(self.mesh, self.signature.points, self.force_size) if lasting else None
        self._tree = Tree(self.signature, self.rods)
        return compile_static(self, spaces)

    def known_force(self):
        """The components of the contact force at the load factors, UFL."""
        n = self.load_factor * self._force
        return n if self._permanent is None else n + self.permanent_factor * self._permanent

    def fields_of(self, n, m, r_s):
        return None

    def round_off_of(self, section, sizes):
        """See `RodModel`: the residual contains only moments here."""
        eps, p = np.finfo(float).eps, self.signature.degree
        J = section.J if self.signature.coupled else section.J[..., :2]
        return 4 * eps * J.max(axis=(-3, -2, -1)) * p / sizes.min() * np.sqrt(self.unknowns)

    def load(self, scene, layout):
        """See `RodModel`; statics gives the contact force."""
        super().load(scene, layout)
        self.load_norm, self.nodal_forces = 0.0, []
        self._known = self._take(self.forms.force, self._force)
        self._lasting = 0.0 if self._permanent is None else self._take(self.forms.permanent_force, self._permanent)

    def _take(self, forms, function):
        """The contact force at the Gauss points that balances dead forces; also stored in a Function."""
        nodal = self._nodal_forces(forms)
        self.load_norm += float(np.linalg.norm(nodal))
        self.nodal_forces.append(nodal)
        known = self._tree.forces(nodal, self.rule)
        self.rods.fill(function, known)
        return known

    def _nodal_forces(self, forms):
        """(N, d) nodal forces equivalent to the dead forces, in the scene's order, on all ranks."""
        total, local = np.zeros((len(self.reference), self.force_size)), np.zeros((len(self.slots), 3))
        for form in map(compat.kernel, forms):
            packed = cpp.fem.pack_constants(form), cpp.fem.pack_coefficients(form)
            cpp.fem.assemble_vector(local.reshape(-1), form, *packed)
        np.add.at(total, self.slots, local[:, : self.force_size])
        return self.comm.allreduce(total) if self.comm.size > 1 else total

    def _sizes(self):
        """(elements,) lengths."""
        return self.layout.sizes(self.scene) / self.scales.length


class DeterminateInPlane(_KnownForce, PlaneModel):
    """Theta alone."""

    components, moves, turn = 1, 0, 1.0
    variations = ((1, False, None), (2, True, lambda w: eq.tests_of(planar.in_plane(w), planar.in_plane(along(w)))))

    def motion_of(self, w, nodal):
        return planar.motion_of((0, 0), w[0], along(w)[0])

    def tests_of(self, phi, motion):
        return eq.tests_of(planar.along_normal(phi[0]), planar.along_normal(along(phi)[0]))

    def point_of(self, w, w_t=None, *, rest, frame):
        return Point(None, None, planar.rotation_matrix(w[0]), planar.along_normal(w[0]), rest=rest, frame=frame)

    def _at_rest(self):
        return np.zeros((len(self.reference), 1))

    def _variation_axes(self):
        e1, e2, e3 = self.axes
        none = np.zeros(3)
        return np.array([[*none, *e3]]), np.array([[*none, *e1], [*none, *e2]])

    def unknowns_of(self, rq):
        return self._angles(rq)[..., None]

    def expansion(self):
        axes, offset, section = self.axes, self._out_of_plane(), self.section
        known, lasting, rule, tree, sizes = self._known, self._lasting, self.rule, self._tree, self._sizes()
        rest, basis = self.reference @ axes[:2].T, rule.at_gauss

        def expand(load_factors, nodal, gauss):
            theta = nodal[..., 0]
            inside = theta[:, tree.cell_nodes]
            turned, curvature = inside @ basis.T, inside @ rule.slopes.T / sizes[:, None]
            c, s = np.cos(turned), np.sin(turned)
            t1, t2 = section.R_R[..., 0], section.R_R[..., 1]
            t = np.empty((*turned.shape, 2))
            a, material, bent = np.empty_like(t), np.zeros((*turned.shape, 3)), np.zeros((*turned.shape, 3))
            t[..., 0], t[..., 1] = c * t1 - s * t2, s * t1 + c * t2
            a[..., 0], a[..., 1] = -t[..., 1], t[..., 0]
            n = load_factors[:, None, None, None] * known + lasting
            material[..., 0], material[..., 2] = (np.einsum("...i,...i", direction, n) for direction in (a, t))
            bent[..., 1] = curvature
            e = strain(section, material, bent)
            sheared, stretched = section.v_R[..., 0] + e[..., 0], section.v_R[..., 1] + e[..., 2]
            r_s = sheared[..., None] * a + stretched[..., None] * t
            r = tree.positions(r_s * sizes[:, None, None], rest, rule)
            return in_space(axes, offset, r, theta, n, moment(section, material, bent)[..., 1], r_s)

        return expand


class DeterminateInSpace(_KnownForce):
    """The quaternion q alone."""

    components, moves, turn = 4, 0, 2.0
    variations = ((3, False, lambda w: eq.tests_of(w, along(w))),)

    def motion_of(self, w, nodal):
        return spatial.motion_of(NONE, w, along(w), nodal)

    def tests_of(self, phi, motion):
        return eq.quaternion_tests_of(phi, along(phi))

    def point_of(self, w, w_t=None, *, rest, frame):
        return Point(None, None, rotation_matrix(w), rotation_vector(w), rest=rest, frame=frame)

    def constraint(self, motion, test, nodal, phi):
        return spatial.unit_quaternion(motion, test)

    def _at_rest(self):
        return np.tile([1.0, 0, 0, 0], (len(self.reference), 1))

    def _variation_axes(self):
        return (np.eye(6)[3:],)

    def unknowns_of(self, rq):
        return rq[..., 3:]

    def expansion(self):
        section, known, lasting = self.section, self._known, self._lasting
        rule, tree, sizes = self.rule, self._tree, self._sizes()
        rest, basis = self.reference, rule.at_gauss
        R_R = section.R_R.reshape(*section.v_R.shape, 3)

        def expand(load_factors, nodal, gauss):
            inside = nodal[:, tree.cell_nodes].swapaxes(2, 3)  # (k, elements, 4, p + 1)
            q = np.moveaxis(inside @ basis.T, 3, 2)
            q_s = np.moveaxis(inside @ rule.slopes.T, 3, 2) / sizes[:, None, None]
            squared = np.einsum("...i,...i", q, q)[..., None]
            R = directors((q / np.sqrt(squared)).reshape(-1, 4)).reshape(*q.shape[:-1], 3, 3)
            T = R @ R_R
            n = load_factors[:, None, None, None] * known + lasting
            curvature = np.einsum("...ij,...i", R_R, 2 * conjugate_product(q, q_s) / squared)
            material = np.einsum("...ij,...i", T, n)
            r_s = np.einsum("...ij,...j", T, section.v_R + strain(section, material, curvature))
            m = np.einsum("...ij,...j", T, moment(section, material, curvature))
            r = tree.positions(r_s * sizes[:, None, None], rest, rule)
            return np.concatenate([r, nodal], axis=-1), np.concatenate([n, m, r_s], axis=-1)

        return expand


def strain(data, n, k):
    """v - v_R (.., 3) where the contact force n is known, material."""
    if data.G is None:
        return n / data.K
    return _times(spread(1 / data.K, data.A_axes), n) - _times(data.G, k)


def moment(data, n, k):
    """m (.., 3) where the contact force n is known, material."""
    if data.G is None:
        return data.J * k
    return _times(np.swapaxes(data.G, -1, -2), n) + _times(spread(data.J, data.S_axes), k)


def _times(matrix, a):
    return np.einsum("...ij,...j->...i", matrix, a)
