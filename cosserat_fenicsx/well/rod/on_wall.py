"""The forces of the wall on a rod in its hole: at its nodes, along its elements, at rings, and as resultants."""

from functools import cached_property

import numpy as np

from cosserat_fenicsx.well.contacts import ROUGH
from cosserat_fenicsx.well.rod.resultants import contacts_along, with_errors
from cosserat_fenicsx.well.rod.smoothed import along_elements

# Forces below this part of the largest one are none.
_ROUNDING = 1e-10


class OnWall:
    """The part of `InHole`, whose attributes are described there, that is about the wall."""

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
        return self._smoothed(self.element_pressures)

    def _smoothed(self, pressures):
        """(n,) N/m, from pressures (elements, nodes), see `side_force`."""
        sizes = self._of_nodes.sum(axis=1)
        means = (pressures * self._of_nodes).sum(axis=1) / sizes
        return self._averaged(along_elements(means, sizes, self.path.rule.nodes)[..., None])[:, 0]

    def _summed(self, values):
        """(n, ..) sums over the elements at every node of values (elements, nodes, ..)."""
        p, found = self.path.degree, np.zeros((len(self.s), *values.shape[2:]))
        for j in range(p + 1):
            found[j : len(found) - p + j : p] += values[:, j]
        return found

    def _averaged(self, values):
        """(n, k) from values of each element at its nodes (elements, nodes, k): where two elements meet, means by the
        lengths that the node stands for in them, so that integrals stay what they are."""
        return self._summed(values * self._of_nodes[..., None]) / self.node_length[:, None]

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
        found = np.empty((len(self.string.rings), 3))
        for i, ring in enumerate(self.string.rings):
            _, vertex = self.path.layout.vertex(self.scene, ring.station)
            after = self._contact[vertex, 0, :3] if vertex < len(self._contact) else self.string.bottom
            found[i] = self._contact[vertex - 1, -1, :3] - after
        return found

    @cached_property
    def _ring_pressures(self):
        """(rings,) N: across the hole, without friction; what is left of rounding where a ring does not touch."""
        friction = [ring.friction * np.hypot(*ring.slip[0][1]) for ring in self.string.rings]
        return np.linalg.norm(self.ring_forces, axis=1) / np.hypot(1.0, friction)

    @cached_property
    def wall_force(self):
        """N."""
        return float(self.node_force.sum() + self._ring_pressures.sum())

    @cached_property
    def _layer(self):
        """(elements,) length of the layer in the wall, m."""
        ends = self.s[:: self.path.degree]
        EI = self.string.bending[self.string.section_at((ends[1:] + ends[:-1]) / 2)]
        return (4 * EI / self.wall_stiffness) ** 0.25

    @cached_property
    def _kinks(self):
        """Arc lengths at which the pressure of what lies on the wall may jump: stations of the survey, ends of sections
        of the string and of the hole, m."""
        string, length = self.string, float(self.string.ends[-1])
        stations = np.interp(string.path.md, self.md, self.s, left=np.nan, right=np.nan)
        found = np.concatenate([stations, string.ends[:-1], list(string.wall.breaks(string.rod))])
        return np.unique(found[(found > 0) & (found < length)])

    @cached_property
    def _resultants(self):
        """See `contacts_along`."""
        rings = [
            (ring.station.s, force)
            for ring, force, pressed in zip(self.string.rings, self._ring_pressures, self._pressed, strict=True)
            if pressed
        ]
        s, side = self.s[self._nodes], self.side[self._nodes]
        return contacts_along(s, self._of_nodes, self.element_pressures, side, self._layer, rings, self._kinks)

    @cached_property
    def contacts(self):
        """[`Contact`], without those of rounding size; errors of forces at points with what the mesh before tells
        of them, see `with_errors`."""
        largest = max((x.force for x in self._resultants[0]), default=0.0)
        known = [x for x in self._resultants[0] if x.force > _ROUNDING * largest]
        other = self._mesh_before
        reach = other and 2 * float(other._layer.max()) + float(np.ptp(other.s[other._nodes], axis=1).max())
        rings = [ring.station.s for ring in self.string.rings]
        return with_errors(known, other and other._resultants[0], reach, self._layer_at, rings)

    def _layer_at(self, s):
        return self._layer[np.clip(np.searchsorted(self.s[:: self.path.degree], s) - 1, 0, len(self._layer) - 1)]

    @property
    def rough(self):
        """[`Contact`] at points whose error is above `ROUGH` of the force."""
        return [x for x in self.contacts if x.start == x.end and x.error > ROUGH * x.force]

    @cached_property
    def distributed_force(self):
        """(n,) N/m."""
        return self._smoothed(self._resultants[1])
