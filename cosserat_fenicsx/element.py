"""Nodes, Gauss points and polynomials of one element: numbers that models and results share."""

from functools import cached_property

import numpy as np


def lobatto_weights(nodes):
    """Weights (n,) of the quadrature rule on [0, 1] whose points are the nodes (n,)."""
    return np.linalg.solve(np.vander(nodes, increasing=True).T, 1 / np.arange(1, len(nodes) + 1))


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
    def at_gauss(self):
        """(gauss, p + 1) nodal basis functions at the Gauss points."""
        return self.basis(self.gauss)

    @cached_property
    def lobatto(self):
        """(p + 1,) weights of the quadrature rule whose points are the nodes."""
        return lobatto_weights(self.nodes)

    @property
    def leading(self):
        """(p + 1,) weights of the nodal values in the coefficient of x^p, x in [-1, 1]."""
        return self._to_coefficients[-1]

    @cached_property
    def slopes(self):
        """(gauss, p + 1) d/dx of the nodal basis at the Gauss points."""
        p = len(self.nodes) - 1
        x = 2 * self.gauss - 1
        powers = np.column_stack([np.zeros_like(x)] + [k * x ** (k - 1) for k in range(1, p + 1)])
        return 2 * powers @ self._to_coefficients

    @cached_property
    def from_slopes(self):
        """(p + 1, gauss) matrix from slopes at the Gauss points (p of them) to the values at the nodes of their
        integral."""
        count = len(self.gauss)
        powers = np.column_stack([(2 * self.nodes - 1) ** (k + 1) - (-1) ** (k + 1) for k in range(count)])
        return powers / (2 * np.arange(1, count + 1)) @ np.linalg.inv(np.vander(2 * self.gauss - 1, increasing=True))

    @cached_property
    def from_ends_and_gauss(self):
        """(p + 1, gauss + 2) matrix from values at 0, the Gauss points and 1 to the values at the nodes."""
        support = 2 * np.concatenate([[0.0], self.gauss, [1.0]]) - 1
        vandermonde = np.vander(support, increasing=True)
        return np.vander(2 * self.nodes - 1, len(support), increasing=True) @ np.linalg.inv(vandermonde)

    @cached_property
    def contact_from_fields(self):
        """(p + 1, gauss) matrix from n (or m) at the Gauss points to the part of it at the nodes that does not depend
        on the element's length, see `results.recovery`."""
        ends = self.weights * self.slopes[:, [0, -1]].T * [[-1], [1]]
        return self.from_ends_and_gauss @ np.concatenate([ends[:1], np.eye(len(self.gauss)), ends[1:]])

    @cached_property
    def contact_from_densities(self):
        """(p + 1, gauss) matrix from the force (or moment with r' x n) per length, times the element's length, at the
        Gauss points to the rest of n (or m) at the nodes."""
        ends = self.weights * self.at_gauss[:, [0, -1]].T * [[1], [-1]]
        return self.from_ends_and_gauss[:, [0, -1]] @ ends

    def between_gauss(self, x):
        """(len(x), gauss) Lagrange polynomials of the Gauss points, at x in [0, 1]."""
        points, x = 2 * self.gauss - 1, 2 * np.asarray(x) - 1
        size = len(points)
        return np.vander(x, size, increasing=True) @ np.linalg.inv(np.vander(points, size, increasing=True))

    def locate_all(self, breaks, x, basis=None):
        """The elements (n,) and basis functions (n, p + 1), or another `basis`, at points x (n,) of a rod whose
        elements end at `breaks`."""
        cells = np.clip(np.searchsorted(breaks, x, side="left") - 1, 0, len(breaks) - 2)
        local = (x - breaks[cells]) / np.diff(breaks)[cells]
        return cells, (basis or self.basis)(np.clip(local, 0.0, 1.0))

    def locate(self, breaks, x):
        """`locate_all` for one point."""
        cells, basis = self.locate_all(breaks, np.array([x]))
        return cells[0], basis[0]
