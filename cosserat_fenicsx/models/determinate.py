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
from cosserat_fenicsx.models.spatial import PlaneModel
from cosserat_fenicsx.models.rod_data import gauss_function, spread


class Tree:
    """The rods of a `Signature`, which are trees with one clamped point and rigid joints alone, from their clamps
    outwards; order: (rods, 3) rod, its element end towards the clamp, the node of the previous rod there or -1."""

    def __init__(self, signature, rods):
        self._p, self._first_cell = signature.degree, rods.first_cells
        self._first_node = rods.first_nodes(self._p)
        self.order = np.array(self._walk(signature.connections))

    def _walk(self, links):
        """The rows of `order`, clamps first."""
        points = {vertex: {vertex} for vertex in links.clamped}
        for vertex, leader in links.leaders:
            points.setdefault(leader, {leader}).add(vertex)
        order, waiting, seen = [], [(clamp, -1) for clamp in links.clamped], set()
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

    def forces(self, nodal, rule):
        """(elements, points, d) the contact force at the Gauss points that balances dead forces (N, d) on the nodes:
        solves the discrete balance (n, l_i') = f_i for all nodes of an element except the one towards the clamp; at its
        other end acts the sum of all forces beyond it."""
        p, nodal = self._p, nodal.copy()
        gradient = rule.weights * rule.slopes.T  # (p + 1, points)
        n = np.empty((self._first_cell[-1], len(rule.gauss), nodal.shape[1]))
        for rod, entry, before in self.order[::-1].tolist():
            f = nodal[self._first_node[rod] : self._first_node[rod + 1]]
            mine = n[self._first_cell[rod] : self._first_cell[rod + 1]]
            ends, inner = f[::p], f[:-1].reshape(-1, p, f.shape[1])[:, 1:]
            sums = inner.sum(axis=1)
            carried = np.cumsum((ends[:0:-1] + np.pad(sums[:0:-1], ((1, 0), (0, 0)))), axis=0)[::-1]
            beyond = np.concatenate([inner, carried[:, None]], axis=1)
            carried = np.cumsum(ends[:-1] + np.pad(sums[:-1], ((1, 0), (0, 0))), axis=0)
            behind = np.concatenate([carried[:, None], inner], axis=1)
            mine[entry:] = np.linalg.solve(gradient[1:], beyond[entry:])
            mine[:entry] = np.linalg.solve(gradient[:-1], behind[:entry])
            if before >= 0:
                nodal[before] += f.sum(axis=0)
        return n


class _KnownForce(RodModel):
    """Scenes whose rods are trees, each held by one clamp alone, under dead forces."""

    name = "determinate"

    def _compile(self, spaces):
        self.displacements = compat.function_space(self.mesh, compat.lagrange(self.mesh, self.signature.degree, 3))
        self._force = gauss_function(self.mesh, self.signature.points, self.force_size)
        lasting = any(kind.scaled != "load" for kind in self.signature.terms)
        self._permanent = gauss_function(self.mesh, self.signature.points, self.force_size) if lasting else None
        self.tree = Tree(self.signature, self.rods)
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
        lasts = self._permanent is not None
        self._lasting = self._take(self.forms.permanent_force, self._permanent) if lasts else None

    def _mesh_in_c(self):
        mesh, data = super()._mesh_in_c(), self.section
        law = {"K": data.K, "J": data.J}
        if data.G is not None:
            law = {"coupled": np.stack([spread(1 / data.K, data.A_axes), data.G, spread(data.J, data.S_axes)], axis=2)}
        sizes = self.layout.sizes(self.scene) / self.scales.length
        mesh.keep(sizes=sizes, R_R=data.R_R, v_R=data.v_R, known=self._known, lasting=self._lasting, **law)
        mesh.c.order = mesh.integers(self.tree.order)
        return mesh

    def _take(self, forms, function):
        """The contact force at the Gauss points that balances dead forces; also stored in a Function."""
        nodal = self._nodal_forces(forms)
        self.load_norm += float(np.linalg.norm(nodal))
        self.nodal_forces.append(nodal)
        known = self.tree.forces(nodal, self.rule)
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


class DeterminateInPlane(_KnownForce, PlaneModel):
    """Theta alone."""

    kind, components, moves, turn = "IN_PLANE", 1, 0, 1.0
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


class DeterminateInSpace(_KnownForce):
    """The quaternion q alone."""

    kind, components, moves, turn = "IN_SPACE", 4, 0, 2.0
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
