"""From what an element computes (nodal r, q; n, m at Gauss points) to values everywhere, by its own equilibrium."""

from functools import cached_property

import numpy as np


class ElementRule:
    """Nodes, Gauss points and polynomials of one element on [0, 1].

    Args:
        nodes: Lobatto nodes of P_p, ascending.
        gauss, weights: Gauss points and weights, ascending.
    """

    def __init__(self, nodes, gauss, weights):
        order = np.argsort(gauss)
        self.nodes, self.gauss, self.weights = nodes, gauss[order], weights[order]

    @cached_property
    def _to_coefficients(self):
        return np.linalg.inv(np.vander(2 * self.nodes - 1, increasing=True))

    def basis(self, x):
        """(len(x), p + 1) nodal basis functions at x in [0, 1]."""
        return np.vander(2 * np.asarray(x) - 1, len(self.nodes), increasing=True) @ self._to_coefficients

    @cached_property
    def slopes(self):
        """(gauss, p + 1) d/dx of the nodal basis at the Gauss points."""
        p = len(self.nodes) - 1
        x = 2 * self.gauss - 1
        powers = np.column_stack([np.zeros_like(x)] + [k * x ** (k - 1) for k in range(1, p + 1)])
        return 2 * powers @ self._to_coefficients

    @cached_property
    def from_ends_and_gauss(self):
        """(p + 1, gauss + 2): values at the nodes from values at 0, the Gauss points and 1."""
        support = 2 * np.concatenate([[0.0], self.gauss, [1.0]]) - 1
        vandermonde = np.vander(support, increasing=True)
        return np.vander(2 * self.nodes - 1, len(support), increasing=True) @ np.linalg.inv(vandermonde)

    def locate_all(self, breaks, x):
        """Element (n,) and basis functions (n, p + 1) at places x of a rod whose element ends are `breaks`."""
        cells = np.clip(np.searchsorted(breaks, x, side="left") - 1, 0, len(breaks) - 2)
        local = (x - breaks[cells]) / np.diff(breaks)[cells]
        return cells, self.basis(np.clip(local, 0.0, 1.0))

    def locate(self, breaks, x):
        """`locate_all` for one place."""
        cells, basis = self.locate_all(breaks, np.array([x]))
        return cells[0], basis[0]


def element_contact(path, record):
    """(elements, p + 1, 6) n and m (dimensionless, inertial) of one record at the nodes of every element.

    Element ends from the element's balance tested with its end functions, which is as accurate as the nodal positions
    (order 2p); the nodes between by the polynomial through both ends and the Gauss points.
    """
    rule, scales, p = path._rule, path.scales, path.degree
    basis = rule.basis(rule.gauss)
    result, cell0 = [], 0
    for rod, breaks in zip(path.scene.rods, path.layout.breaks, strict=True):
        cells = len(breaks) - 1
        n, m, r_s = np.split(record.gauss_fields[cell0 : cell0 + cells], 3, axis=2)
        cell0 += cells
        h = np.diff(breaks) * rod.length / scales.length
        s_gauss = (breaks[:-1, None] + np.diff(breaks)[:, None] * rule.gauss) * rod.length
        density = np.zeros((cells, len(rule.gauss), 3))
        for load in path.scene.loads:
            if load.station is None:
                density += load.density(rod, s_gauss) * (record.load_factor * scales.length / scales.force)
        ends = []
        for end, sign in ((0, -1), (p, 1)):
            grad, value = rule.weights * rule.slopes[:, end], rule.weights * basis[:, end]
            n_end = np.einsum("g,cgi->ci", grad, n) - h[:, None] * np.einsum("g,cgi->ci", value, density)
            m_end = np.einsum("g,cgi->ci", grad, m) - h[:, None] * np.einsum("g,cgi->ci", value, np.cross(r_s, n))
            ends.append(sign * np.concatenate([n_end, m_end], axis=1))
        along = np.concatenate([ends[0][:, None], np.concatenate([n, m], axis=2), ends[1][:, None]], axis=1)
        result.append(np.einsum("jg,cgi->cji", rule.from_ends_and_gauss, along))
    return np.concatenate(result)


def at_nodes(values):
    """(nodes, k) from values at the nodes of every element of a rod (elements, p + 1, k): those before a shared node."""
    return np.concatenate([values[:1, 0], values[:, 1:].reshape(-1, values.shape[2])])


def directors(q):
    """(k, 3, 3) rotation matrices of unit quaternions (k, 4), eq. (6); the columns are d_1, d_2, d_3."""
    a, b, c, d = q.T
    return np.array(
        [
            [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
        ]
    ).transpose(2, 0, 1)
