"""From what an element computes (nodal r, q; n, m at Gauss points) to values everywhere, by its own equilibrium."""

import numpy as np


def element_contact(path, record):
    """(elements, p + 1, 6) n and m (dimensionless, inertial) of one record at the nodes of every element.

    Element ends from the element's balance tested with its end functions, which is as accurate as the nodal positions
    (order 2p); the nodes between by the polynomial through both ends and the Gauss points.
    """
    rule, scales, p = path.rule, path.scales, path.degree
    basis = rule.basis(rule.gauss)
    result, cell0 = [], 0
    for rod, breaks in zip(path.scene.rods, path.layout.breaks, strict=True):
        cells = len(breaks) - 1
        n, m, r_s = np.split(record.gauss_fields[cell0 : cell0 + cells], 3, axis=2)
        cell0 += cells
        h = np.diff(breaks) * rod.length / scales.length
        s = (breaks[:-1, None] + np.diff(breaks)[:, None] * rule.gauss) * rod.length
        f, mu = (record.load_factor * x for x in _line_densities(path.scene, rod, s, scales))
        ends = []
        for end, sign in ((0, -1), (p, 1)):
            grad, value = rule.weights * rule.slopes[:, end], rule.weights * basis[:, end]
            n_end = np.einsum("g,cgi->ci", grad, n) - h[:, None] * np.einsum("g,cgi->ci", value, f)
            m_end = np.einsum("g,cgi->ci", grad, m) - h[:, None] * np.einsum("g,cgi->ci", value, np.cross(r_s, n) + mu)
            ends.append(sign * np.concatenate([n_end, m_end], axis=1))
        along = np.concatenate([ends[0][:, None], np.concatenate([n, m], axis=2), ends[1][:, None]], axis=1)
        result.append(np.einsum("jg,cgi->cji", rule.from_ends_and_gauss, along))
    return np.concatenate(result)


def _line_densities(scene, rod, s, scales):
    """Force and moment per length, (elements, points, 3) each, dimensionless, at arc lengths s (elements, points), m."""
    both = {"force per length": np.zeros((*s.shape, 3)), "force": np.zeros((*s.shape, 3))}
    for load in scene.line_loads(rod):
        both[load.unit] += load.density(rod, s.ravel()).reshape(*s.shape, 3) / scales.of_unit(load.unit)
    return both["force per length"], both["force"]


def at_nodes(values):
    """(nodes, k) from values at the nodes of every element of a rod (elements, p + 1, k): those before a shared node."""
    return np.concatenate([values[:1, 0], values[:, 1:].reshape(-1, values.shape[2])])
