"""Contact forces and moments at the nodes from the values at the Gauss points, by the equilibrium of each element."""

from functools import lru_cache

import numpy as np

from cosserat_fenicsx.numerics import product_conjugate
from cosserat_fenicsx.results.places import all_cell_nodes


def element_contact(path, records):
    """(n, elements, p + 1, 6) n and m (dimensionless, inertial) of `Records` at the nodes of every element.

    At the element ends they follow from the element's weak form with the shape functions of its ends as test functions,
    which is as accurate as the nodal positions (order 2p). At the nodes between they are interpolated by the polynomial
    through both ends and the Gauss points. Virtual rotations are those of the formulation, see `Path.galerkin`.
    """
    rule, p, fields = path.rule, path.degree, records.gauss_fields
    h, cells = _elements(path.layout, path.scene, path.scales.length, p)
    n, r_s = fields[..., :3], fields[..., 6:]
    at_gauss, at_nodes = records.densities
    density = np.zeros_like(fields[..., :6]) if at_gauss is None else at_gauss.copy()
    density[..., 3:] += r_s[..., _NEXT] * n[..., _LAST] - r_s[..., _LAST] * n[..., _NEXT]
    along = np.matmul(rule.contact_from_fields, fields[..., :6])
    along += np.matmul(rule.contact_from_densities, density * h)
    if path.galerkin or at_nodes is not None:
        more = np.zeros((*along.shape[:2], 2, 6))
        if at_nodes is not None:
            more -= h * rule.lobatto[[0, p], None] * at_nodes[:, :, [0, p]]
        if path.galerkin:
            q, m = records.rq[:, :, 3:][:, cells], fields[..., 3:6]
            for i, end in enumerate((0, p)):
                grad, value = rule.weights * rule.slopes[:, end], rule.weights * rule.at_gauss[:, end]
                plain = np.matmul(grad, m) - h[..., 0] * np.matmul(value, density[..., 3:])
                more[:, :, i, 3:] += _tested_by_turning(q, end, rule, h, m, density[..., 3:]) - plain
        along += np.matmul(rule.from_ends_and_gauss[:, [0, -1]] * [-1, 1], more)
    return along


# Components in cyclic order.
_NEXT, _LAST = [1, 2, 0], [2, 0, 1]


@lru_cache(maxsize=32)
def _elements(layout, scene, length, p):
    """Of all rods one after another: (elements, 1, 1) lengths, and (elements, p + 1) the nodes of each."""
    return layout.sizes(scene)[:, None, None] / length, all_cell_nodes(layout, p)


def _tested_by_turning(q, end, rule, h, m, density):
    """(n, elements, 3) work-conjugate moments of small rotations of one end, where virtual rotations are changes of q.

    A small rotation theta of the end alone changes q_h by N theta q_end/2, which is the virtual rotation
    N vec(theta c) with c = q_end conj(q_h)/|q_h|^2 and N the shape function of the end.

    Args:
        q: (n, elements, p + 1, 4) at the nodes; end: index of the end among them.
        h: (elements, 1, 1) lengths; m: (n, elements, points, 3) moments at the Gauss points.
        density: (n, elements, points, 3) r' x n and moments per length.
    """
    basis = rule.at_gauss
    inside, slope = basis @ q, rule.slopes @ q / h
    squared = np.einsum("...i,...i", inside, inside)[..., None]
    at_end = np.broadcast_to(q[:, :, end, None], inside.shape)
    c = product_conjugate(at_end, inside) / squared
    c_s = (product_conjugate(at_end, slope) - 2 * np.einsum("...i,...i", inside, slope)[..., None] * c) / squared
    N, N_s = basis[:, end, None], rule.slopes[:, end, None] / h
    tested = N_s * _turned(c, m) + N * (_turned(c_s, m) - _turned(c, density))
    return h[..., 0] * np.matmul(rule.weights, tested)


def _turned(c, a):
    """The transpose of the map theta -> vec(theta c), applied to vectors a."""
    return c[..., :1] * a + np.cross(c[..., 1:], a)


def at_nodes(values):
    """(nodes, k) from values at the nodes of every element of a rod (elements, p + 1, k); at shared nodes those of the
    element before."""
    return np.concatenate([values[:1, 0], values[:, 1:].reshape(-1, values.shape[2])])
