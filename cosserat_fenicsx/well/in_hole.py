"""The answer of the exact rod in its hole: what the string bears, where it touches, and how well that is known."""

from functools import cached_property

import numpy as np

from cosserat_fenicsx.quaternions import directors
from cosserat_fenicsx.results.recovery import at_nodes
from cosserat_fenicsx.well.resultants import contacts_along
from cosserat_fenicsx.well.string_scene import bending_of, is_round

# Errors of the finer mesh over changes from one mesh to the next, whose signs alternate: what covered 97 random wells,
# but for the wall force of one buckled string.
_OF_CHANGE = {"hook_load": 3.0, "surface_torque": 4.0, "wall_force": 6.0}
# Smallest scales that errors are relative to: of the hook load, over the string's weight; of the torque, over that of
# the wall's forces at the string's surface.
_LEAST_LOAD, _LEAST_TORQUE = 1e-3, 1e-3
# Elements of up to so many lengths of the layer in the wall resolve a concentrated force: forces on longer ones were
# found to be off by a factor of up to three, most of those on shorter ones by less than 5 %.
_RESOLVES = 10.0
# Distances from the axis below this share of the clearance have no direction.
_CENTRED = 1e-9


class InHole:
    """A string at rest in its hole, or slipping along it; arrays are over the nodes along the string, from the top.

    Attributes:
        path: a `Path` with the rod's state as its only point, for all that a `Path` offers; scene: its `Scene`.
        s: arc length from the top, m. md: measured depth of the closest point of the hole's axis, m.
        position: (n, 3), m. offset: (n, 3) from the hole's axis, m; distance: its size. standoff: 1 on the axis, 0
            where it touches. node_length: the weights of integrals along the string, m.
        side: direction of the rod from the axis, rad, from the high side of the hole, clockwise looking down the hole
            (from the first axis, north, where it is vertical).
        tension: effective, N. torque: N m, that the upper part exerts in the sense of clockwise rotation on the lower.
        bending_moment: N m. side_force: of the wall on the rod, per length, N/m; node_force: the same per node, N.
        hook_load: of the held end, along the hole, N; surface_torque: N m; reaction: (3,) N and (3,) N m there.
        wall_force: sum of all forces of the wall and of the rings, across the rod, without friction, N.
        ring_forces: (rings, 3) on the string, with friction, N.
        contacts: [`Contact`] resultants, from the top down, see `contacts_along`. distributed_force: `side_force`
            without the peaks of those that are concentrated, N/m: its integral and these are the `wall_force`. rough:
            the concentrated ones that the mesh does not resolve, which may be off by a factor of three.
        stretch: m, twist: rad, of the string by tension and torque, from the true stiffness (NaN where a section has
            none); an `extensible` string has them in its state.
        errors: {"hook_load": N, "surface_torque": N m, "wall_force": N}, estimated; error: the largest relative one of
            the first two, that of the torque only where the string turns.
        of_stiffness: largest relative change of these quantities from a wall softer by ten, a part of the errors.
        balance: N, between the reaction and the sum of all other forces.
        negative_modes: number of negative eigenvalues of the second variation without friction, -1 where it is
            singular. Where it is not 0, the string would buckle, or buckle otherwise, but for friction.
        steps: Newton steps, on this mesh and on those before.
    """

    def __init__(self, string, path):
        self._string, self.path, self.scene = string, path, path.scene
        self.steps, self.negative_modes = int(path.iterations[0]), int(path.negative_modes[0])
        self.errors, self.error, self._by_stiffness, self.of_stiffness = {}, np.inf, {}, np.inf

    # -- along the string --------------------------------------------------------------------------------------------

    @cached_property
    def s(self):
        """(n,) m."""
        return self.path.layout.node_s(self.path.rule.nodes)[0] * self._string.rod.length

    @property
    def _record(self):
        return self.path._records[0]

    @cached_property
    def position(self):
        """(n, 3) m."""
        return self._record.rq[:, :3] * self.path.scales.length + self.scene.origin(self._string.rod)

    @cached_property
    def _near(self):
        return self._string.path.nearest(self.position, self.s)

    @property
    def md(self):
        """(n,) m."""
        return self._near.md

    @cached_property
    def offset(self):
        """(n, 3) from the axis to the rod, across the hole, m."""
        away = self.position - self._near.position
        return away - (away * self._near.tangent).sum(axis=1)[:, None] * self._near.tangent

    @cached_property
    def distance(self):
        """(n,) m."""
        return np.linalg.norm(self.offset, axis=1)

    @cached_property
    def _outward(self):
        """(n, 3) unit vectors from the axis to the rod; zero where it is centred."""
        clear = self.distance > _CENTRED * self._string.clearance
        return np.where(clear[:, None], self.offset / np.where(clear, self.distance, 1.0)[:, None], 0.0)

    @cached_property
    def standoff(self):
        """(n,) the part of the clearance that is left."""
        return 1 - self.distance / self._string.wall.sizes(self.s, self.md)[0]

    @cached_property
    def side(self):
        """(n,) rad."""
        t = self._near.tangent
        high = t[:, 2:] * t - (0.0, 0.0, 1.0)
        vertical = np.linalg.norm(high, axis=1) < 1e-9
        high[vertical] = np.array([1.0, 0.0, 0.0]) - t[vertical, :1] * t[vertical]
        right = np.cross(t, high)
        return np.arctan2((self._outward * right).sum(axis=1), (self._outward * high).sum(axis=1))

    @cached_property
    def _contact(self):
        """(elements, nodes, 6) n and m, N and N m, inertial."""
        return self.path._contact[0] * np.repeat([self.path.scales.force, self.path.scales.moment], 3)

    @cached_property
    def _along(self):
        """(n, 3) tangents of the rod: its third director."""
        q = self._record.rq[:, 3:7]
        q = q / np.linalg.norm(q, axis=1, keepdims=True)
        return directors(q) @ self._string.rod.curve.frame(np.zeros(1))[0, :, 2]

    def _component(self, part):
        return (at_nodes(self._contact[..., part]) * self._along).sum(axis=1)

    @cached_property
    def tension(self):
        """(n,) N."""
        return self._component(slice(3))

    @cached_property
    def torque(self):
        """(n,) N m."""
        return -self._component(slice(3, 6))

    @cached_property
    def bending_moment(self):
        """(n,) N m."""
        m = at_nodes(self._contact[..., 3:])
        return np.linalg.norm(m + self.torque[:, None] * self._along, axis=1)

    # -- the wall ----------------------------------------------------------------------------------------------------

    @property
    def _nodes(self):
        """(elements, nodes) the nodes of each element."""
        degree = self.path.degree
        return np.arange(self.path.elements[0])[:, None] * degree + np.arange(degree + 1)

    @cached_property
    def _of_nodes(self):
        """(elements, nodes) lengths that the nodes stand for, m."""
        return self.path.layout.sizes(self.scene)[:, None] * self.path.rule.lobatto

    @cached_property
    def _wall_density(self):
        """(elements, nodes, 3) force of the wall per length, friction included, N/m."""
        return self._record.densities[1][..., :3] * self.path.scales.force / self.path.scales.length

    @cached_property
    def element_pressures(self):
        """(elements, nodes) force of the wall across the rod, per length, N/m."""
        return 0.0 - (self._wall_density * self._outward[self._nodes]).sum(axis=2)

    @cached_property
    def side_force(self):
        """(n,) N/m."""
        return at_nodes(self.element_pressures[..., None])[:, 0]

    def _summed(self, values):
        """(n, ..) sums over the elements at every node of values (elements, nodes, ..)."""
        p, found = self.path.degree, np.zeros((len(self.s), *values.shape[2:]))
        for j in range(p + 1):
            found[j : len(found) - p + j : p] += values[:, j]
        return found

    @cached_property
    def node_length(self):
        """(n,) lengths that the nodes stand for, m: the weights of integrals along the string."""
        return self._summed(self._of_nodes)

    @cached_property
    def node_force(self):
        """(n,) N."""
        return self._summed(self.element_pressures * self._of_nodes)

    @cached_property
    def ring_forces(self):
        """(rings, 3) N: the jump of the contact force, which no other load at the station shares."""
        found = np.empty((len(self._string.rings), 3))
        for i, ring in enumerate(self._string.rings):
            _, vertex = self.path.layout.vertex(self.scene, ring.station)
            after = self._contact[vertex, 0, :3] if vertex < len(self._contact) else self._string.bottom
            found[i] = self._contact[vertex - 1, -1, :3] - after
        return found

    @cached_property
    def _across_rings(self):
        """[N] forces of the rings across the rod, without friction."""
        return [
            float(np.linalg.norm(force) / np.hypot(1.0, ring.friction * np.hypot(*ring.slip[0][1])))
            for ring, force in zip(self._string.rings, self.ring_forces, strict=True)
        ]

    @cached_property
    def wall_force(self):
        """N."""
        return float(self.node_force.sum() + sum(self._across_rings))

    def _layer(self, of):
        """Length of the layer in the wall of the stiffest (`max`) or softest (`min`) section, m."""
        EI = of(bending_of(section) for section in self._string.sections)
        return (4 * EI / self._string.wall.stiffness) ** 0.25

    @cached_property
    def _resultants(self):
        """See `contacts_along`."""
        rings = [(ring.station.s, force) for ring, force in zip(self._string.rings, self._across_rings, strict=True)]
        s, side = self.s[self._nodes], self.side[self._nodes]
        return contacts_along(s, self._of_nodes, self.element_pressures, side, self._layer(max), rings)

    @property
    def contacts(self):
        """[`Contact`]."""
        return self._resultants[0]

    @property
    def rough(self):
        """[`Contact`] on elements too long for it."""
        at_rings, ends = [ring.station.s for ring in self._string.rings], self.s[:: self.path.degree]
        points = [x for x in self.contacts if x.start == x.end and x.start not in at_rings]
        i = np.clip(np.searchsorted(ends, [x.start for x in points]), 1, len(ends) - 1)
        return [x for x, h in zip(points, ends[i] - ends[i - 1], strict=True) if h > _RESOLVES * self._layer(min)]

    @cached_property
    def distributed_force(self):
        """(n,) N/m."""
        return self._summed(self._resultants[1] * self._of_nodes) / self.node_length

    # -- the ends ----------------------------------------------------------------------------------------------------

    @cached_property
    def reaction(self):
        """Force (3,), N, and moment (3,), N m, on the held end."""
        force, moment = self.path.reaction(self._string.support)
        return force[0], moment[0]

    @property
    def hook_load(self):
        """N."""
        return float(-self.reaction[0] @ self._near.tangent[0])

    @property
    def surface_torque(self):
        """N m."""
        return float(self.reaction[1] @ self._near.tangent[0])

    @cached_property
    def balance(self):
        """N."""
        string = self._string
        weight = np.array([0.0, 0.0, np.diff(string.ends, prepend=0.0) @ string.weight])
        wall = (self._wall_density * self._of_nodes[..., None]).sum(axis=(0, 1)) + self.ring_forces.sum(axis=0)
        return float(np.linalg.norm(self.reaction[0] + weight + string.bottom + wall))

    @property
    def scale(self):
        """Size of the forces that are balanced, N."""
        string = self._string
        weight = np.diff(string.ends, prepend=0.0) @ string.weight
        return self.wall_force + weight + float(np.linalg.norm(string.bottom))

    # -- what the equilibrium leaves out -----------------------------------------------------------------------------

    def _integral(self, values, of_section):
        """Integral over the string of values at the nodes over a stiffness of the sections."""
        at = np.minimum(np.searchsorted(self._string.ends, self.s, side="left"), len(self._string.ends) - 1)
        found = np.array([np.nan if x.matrix is not None else of_section(x) for x in self._string.sections])
        return float((self.node_length * values / found[at]).sum())

    @property
    def stretch(self):
        """m."""
        return self._integral(self.tension, lambda x: x.axial)

    @property
    def twist(self):
        """rad."""
        return self._integral(self.torque, lambda x: x.torsion if is_round(x) else np.nan)

    # -- errors ------------------------------------------------------------------------------------------------------

    def compare(self, coarse, softer=None):
        """Estimate the errors.

        Args:
            coarse: the `InHole` on the mesh before, or None. softer: that of a wall softer by ten on the same mesh, or
                None where that of the mesh before counts.
        """
        turns = self._string.turns
        weight = np.diff(self._string.ends, prepend=0.0) @ self._string.weight
        arm = max(radius for _, radius in self._string.wall.contact_radius)
        least = _LEAST_LOAD * weight
        wall = max(self.wall_force, least)
        scales = {
            "hook_load": max(abs(self.hook_load), least),
            "surface_torque": max(abs(self.surface_torque), _LEAST_TORQUE * arm * wall),
            "wall_force": wall,
        }
        if softer is not None:
            self._by_stiffness = {name: abs(getattr(self, name) - getattr(softer, name)) for name in scales}
        elif coarse is not None:
            self._by_stiffness = coarse._by_stiffness
        counted = [name for name in scales if turns or name != "surface_torque"]
        if self._by_stiffness:
            self.of_stiffness = max(self._by_stiffness[name] / scales[name] for name in counted)
        changes = dict.fromkeys(scales, np.inf)
        if coarse is not None:
            changes = {name: abs(getattr(self, name) - getattr(coarse, name)) / scales[name] for name in scales}
        largest = max(changes[name] for name in counted)  # a single quantity may change little by chance
        for name, scale in scales.items():
            rounding = self.balance * (arm if name == "surface_torque" else 1.0)
            change = _OF_CHANGE[name] * max(largest, changes[name]) * scale
            self.errors[name] = change + self._by_stiffness.get(name, np.inf) + rounding
        of_load, of_torque = (self.errors[name] / scales[name] for name in ("hook_load", "surface_torque"))
        self.error = max(of_load, of_torque) if turns else of_load
        if coarse is not None:
            self.steps = int(self.path.iterations[0]) + coarse.steps

    def __repr__(self):
        elements = self.path.elements[0]
        return f"<InHole: hook load {self.hook_load:.6g} N, {elements} elements, {self.steps} Newton steps>"
