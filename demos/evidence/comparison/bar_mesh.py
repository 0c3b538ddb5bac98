"""Second-order hexahedra of half a circular bar: the half y >= 0 of a disc, swept along z."""

import numpy as np

_BLOCK = 0.45  # half width of the square block in the middle, in radii


def half_disc(radius, refinement=1):
    """Nine-node quadrilaterals of the half disc y >= 0, a block in the middle and a ring around it, with `refinement`
    along an eighth of the circle: points (n, 2), the first of them the centre; cells (m, 3, 3), indices by position
    (first, second direction). The ring's outer nodes lie on a circle whose radius is a little larger, by less than
    4e-4, so that the second moment of the area between the quadratic arcs is that of the circle."""
    halves = 2 * refinement
    span = np.linspace(-1, 1, 2 * halves + 1)
    block = _BLOCK * np.stack(np.meshgrid(span, np.linspace(0, 1, halves + 1), indexing="ij"), axis=-1)
    rim = np.concatenate([block[-1], block[::-1, -1][1:], block[0, ::-1][1:]])  # from angle 0 to pi
    angle = np.linspace(0, np.pi, len(rim))
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    way = np.linspace(0, 1, halves + 1)[:, None, None]
    ring = ((1 - way) * rim + way * circle)[:, ::-1]
    points, cells = _joined([block, ring])
    points[np.abs(points) < 1e-12] = 0.0
    _, second = moments(points, cells)
    return radius * points * (np.pi / 8 / second) ** 0.25, cells


def _joined(grids):
    """Points and nine-node cells of several grids (i, j, 2) of nodes; points that coincide become one."""
    every = np.vstack([np.zeros((1, 2)), *(grid.reshape(-1, 2) for grid in grids)])
    _, first, inverse = np.unique(np.round(every, 9), axis=0, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))  # numbered in the order of occurrence: the centre is the first
    number, cells, start = rank[inverse.ravel()], [], 1
    for grid in grids:
        index = number[start : start + grid.shape[0] * grid.shape[1]].reshape(grid.shape[:2])
        start += index.size
        cells += [
            index[i : i + 3, j : j + 3] for i in range(0, len(index) - 1, 2) for j in range(0, index.shape[1] - 1, 2)
        ]
    return every[np.sort(first)], np.array(cells)


def moments(points, cells):
    """Area of the nine-node quadrilaterals, and the second moment about the y axis, the integral of x^2."""
    x, w = np.polynomial.legendre.leggauss(4)
    shape = np.array([x * (x - 1) / 2, 1 - x * x, x * (x + 1) / 2])
    slope = np.array([x - 0.5, -2 * x, x + 0.5])
    nodes = points[cells]
    at = np.einsum("cijk,ip,jq->cpqk", nodes, shape, shape)
    d1, d2 = np.einsum("cijk,ip,jq->cpqk", nodes, slope, shape), np.einsum("cijk,ip,jq->cpqk", nodes, shape, slope)
    weight = np.abs(d1[..., 0] * d2[..., 1] - d1[..., 1] * d2[..., 0]) * w[:, None] * w
    return weight.sum(), (weight * at[..., 0] ** 2).sum()


def swept(points, cells, z):
    """Second-order hexahedra from nine-node quadrilaterals. points (n, 2), cells (m, 3, 3): of the section; z: the ends
    of the elements along the bar. Returns points (n * (2 len(z) - 1), 3), section by section; cells (m * (len(z) - 1),
    3, 3, 3)."""
    levels = np.sort(np.concatenate([z, (z[:-1] + z[1:]) / 2]))
    solid = np.concatenate([np.column_stack([points, np.full(len(points), level)]) for level in levels])
    layers = len(points) * (2 * np.arange(len(z) - 1)[:, None] + np.arange(3))
    return solid, (cells[None, :, :, :, None] + layers[:, None, None, None, :]).reshape(-1, 3, 3, 3)
