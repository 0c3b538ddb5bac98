"""Which blocks of a matrix over the tied nodes constraint equations fill: few of them where there are many nodes."""

import numpy as np


class TiePattern:
    """The pairs of tied nodes that constraint equations (ties) connect.

    Blocks of a matrix are stored pair by pair, (pairs, rows of a node, columns of a node); all others are zero.

    Args:
        ends: (a, b) of every tie as indices into the tied nodes; b = -1 for the ground.
        count: number of the tied nodes.

    Attributes:
        ends: the same as an array (ties, 2).
        first, second: (pairs,) the nodes of a pair's rows and columns; every node has a pair with itself.
        own: (nodes,) the pair of every node with itself.
        mirrored: (pairs,) the pair with the two nodes exchanged.
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
        # the pair of two ends of a tie; one more for the ground
        self._of_ends = np.where(here, np.searchsorted(known, keys), len(known))
        self._nodes, self._flat = self.ends % (count + 1), {}  # the ground comes last

    def sums(self, blocks, ties=None):
        """(pairs, n, n) sums over ties, from (ties, 2, n, 2, n) by their ends; ties: the indices of those, or all."""
        n, pairs = blocks.shape[-1], self._of_ends if ties is None else self._of_ends[ties]
        key = "pairs", n, None if ties is None else ties.tobytes()
        return self._summed(key, pairs, blocks.swapaxes(2, 3), len(self.first), n * n).reshape(-1, n, n)

    def by_nodes(self, values):
        """(nodes, n) sums over ties, from (ties, 2, n) by their ends."""
        n = values.shape[2]
        return self._summed(("nodes", n), self._nodes, values, self.count, n)

    def _summed(self, key, places, values, count, size):
        """(count, size) sums of values (*places.shape, ...), of that size, without those at the place `count`."""
        if key not in self._flat:
            self._flat[key] = (places[..., None] * size + np.arange(size)).ravel()
        found = np.bincount(self._flat[key], values.ravel(), minlength=(count + 1) * size)
        return found[: count * size].reshape(count, size)

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
        """Rows and columns in a matrix of what ties fill.

        Args:
            rows: (nodes, n) the numbers of the nodes' unknowns, -1 where these are clamped.
            equations: (added,) indices of the ties that are equations; those follow the nodes in the order of
                `equations` with numbers from 0.

        Returns:
            (2, pairs * n * n) of blocks (pairs, n, n); rows (added * 2 * n,) of the ends' unknowns, -1 for the ground;
            and for each of them its equation.
        """
        n = rows.shape[1]
        i, j = rows[self.first][:, :, None], rows[self.second][:, None, :]
        blocks = np.stack([np.broadcast_to(x, (len(self.first), n, n)).ravel() for x in (i, j)])
        of_ends = np.append(rows, np.full((1, n), -1), axis=0)[self.ends[equations]]
        return blocks, of_ends.ravel(), np.repeat(np.arange(len(equations)), 2 * n)

    def widths(self, n):
        """(nodes * n,) how many columns ties fill in the rows of the nodes' unknowns, n a node."""
        return np.repeat(np.bincount(self.first, minlength=self.count) * n, n)
