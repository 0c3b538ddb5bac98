"""Contact forces and moments at the nodes from the values at the Gauss points, by the equilibrium of each element."""

import numpy as np

from cosserat_fenicsx.quaternions import product_conjugate


def element_contact(path, record):
    """(elements, p + 1, 6) n and m (dimensionless, inertial) of one record at the nodes of every element.

    At the element ends they follow from the element's weak form with the shape functions of its ends as test functions,
    which is as accurate as the nodal positions (order 2p). At the nodes between they are interpolated by the polynomial
    through both ends and the Gauss points. Virtual rotations are those of the formulation, see `Path.galerkin`.
    """
    rule, scales, p = path.rule, path.scales, path.degree
    basis, lobatto = rule.at_gauss, rule.lobatto
    result, cell0, node0 = [], 0, 0
    for rod, breaks in zip(path.scene.rods, path.layout.breaks, strict=True):
        cells = len(breaks) - 1
        n, m, r_s = np.split(record.gauss_fields[cell0 : cell0 + cells], 3, axis=2)
        cell0 += cells
        h = np.diff(breaks) * rod.length / scales.length
        at_gauss, at_nodes = (None if x is None else x[cell0 - cells : cell0] for x in record.densities)
        density = np.concatenate([np.zeros_like(n), np.cross(r_s, n)], axis=2)
        if at_gauss is not None:
            density += at_gauss
        q = record.rq[node0 + p * np.arange(cells)[:, None] + np.arange(p + 1), 3:]
        node0 += cells * p + 1
        ends = []
        for end, sign in ((0, -1), (p, 1)):
            grad, value = rule.weights * rule.slopes[:, end], rule.weights * basis[:, end]
            contact = np.einsum("g,cgi->ci", grad, np.concatenate([n, m], axis=2))
            contact -= h[:, None] * np.einsum("g,cgi->ci", value, density)
            if path.galerkin:
                contact[:, 3:] = _tested_by_turning(q, end, rule, h, m, density[..., 3:])
            if at_nodes is not None:
                contact -= (h * lobatto[end])[:, None] * at_nodes[:, end]
            ends.append(sign * contact)
        along = np.concatenate([ends[0][:, None], np.concatenate([n, m], axis=2), ends[1][:, None]], axis=1)
        result.append(np.einsum("jg,cgi->cji", rule.from_ends_and_gauss, along))
    return np.concatenate(result)


def _tested_by_turning(q, end, rule, h, m, density):
    """(elements, 3) work-conjugate moments of small rotations of one end, where virtual rotations are changes of q.

    A small rotation theta of the end alone changes q_h by N theta q_end/2, which is the virtual rotation
    N vec(theta c) with c = q_end conj(q_h)/|q_h|^2 and N the shape function of the end.

    Args:
        q: (elements, p + 1, 4) at the nodes; end: index of the end among them.
        h: (elements,) lengths; m: (elements, points, 3) moments at the Gauss points.
        density: (elements, points, 3) r' x n and moments per length.
    """
    basis = rule.at_gauss
    inside, slope = basis @ q, rule.slopes @ q / h[:, None, None]
    squared = np.einsum("cgi,cgi->cg", inside, inside)[..., None]
    at_end = np.broadcast_to(q[:, end, None], inside.shape)
    c = product_conjugate(at_end, inside) / squared
    c_s = (product_conjugate(at_end, slope) - 2 * np.einsum("cgi,cgi->cg", inside, slope)[..., None] * c) / squared
    N, N_s = basis[:, end, None], rule.slopes[:, end, None] / h[:, None, None]
    tested = N_s * _turned(c, m) + N * (_turned(c_s, m) - _turned(c, density))
    return h[:, None] * np.einsum("g,cgi->ci", rule.weights, tested)


def _turned(c, a):
    """The transpose of the map theta -> vec(theta c), applied to vectors a."""
    return c[..., :1] * a + np.cross(c[..., 1:], a)


def at_nodes(values):
    """(nodes, k) from values at the nodes of every element of a rod (elements, p + 1, k); at shared nodes those of the
    element before."""
    return np.concatenate([values[:1, 0], values[:, 1:].reshape(-1, values.shape[2])])
