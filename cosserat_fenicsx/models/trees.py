"""Trees of rods with one clamp: contact forces by summation towards it, positions by integration from it."""

import numpy as np


class Tree:
    """The rods of a signature, in order from their clamps outwards.

    Args:
        signature: a `Signature` whose rods are trees, each with one clamped point and rigid joints alone.

    Attributes:
        cell_nodes: (elements, p + 1) nodes of every element, the scene's order.
    """

    def __init__(self, signature):
        self._p, self._counts = signature.degree, signature.counts
        p = signature.degree
        self._first_cell = np.concatenate([[0], np.cumsum(signature.counts)])
        self._first_node = self._first_cell * p + np.arange(len(signature.counts) + 1)
        rod = np.repeat(np.arange(len(signature.counts)), signature.counts)
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
        """The contact force at the Gauss points that balances dead forces.

        Solves the discrete balance (n, l_i') = f_i for all nodes of an element except the one towards the clamp; at its
        other end acts the sum of all forces beyond it.

        Args:
            nodal: (N, d) forces on the nodes; rule: the `ElementRule`.

        Returns:
            (elements, points, d).
        """
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
        """Positions of all nodes from r' at the Gauss points.

        Args:
            tangents: (k, elements, points, d) r' times the length of its element.
            rest: (N, d) positions at rest, where the clamps stay.
            rule: the `ElementRule`.

        Returns:
            (k, N, d).
        """
        within = np.einsum("jg,kcgi->kcji", rule.from_slopes, tangents)
        r = np.empty((len(tangents), *rest.shape))
        for nodes, cells, entry, before in self._rods(self._order):
            steps = within[:, cells]
            ends = np.concatenate([np.zeros_like(steps[:, :1, 0]), np.cumsum(steps[:, :, -1], axis=1)], axis=1)
            at = r[:, before] if before is not None else rest[nodes.start + entry * self._p]
            ends += (at - ends[:, entry])[:, None]
            r[:, nodes][:, :-1] = (ends[:, :-1, None] + steps[:, :, :-1]).reshape(len(r), -1, rest.shape[1])
            r[:, nodes.stop - 1] = ends[:, -1]
        return r
