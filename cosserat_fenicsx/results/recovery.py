"""Contact forces and moments at the nodes from the values at the Gauss points, by the equilibrium of each element."""

from functools import lru_cache

import numpy as np

from cosserat_fenicsx.numerics import directors, product_conjugate
from cosserat_fenicsx.results.compared import all_cell_nodes, cell_nodes


def element_contact(path, records, carried=0.0):
    """(n, elements, p + 1, 6) n and m (dimensionless, inertial) of `Records` at the nodes of every element: those of
    the rods, and `carried`, what threads along them carry at the Gauss points (results/threads.py).

    At the element ends they follow from the element's weak form with the shape functions of its ends as test functions,
    which is as accurate as the nodal positions (order 2p). At the nodes between they are interpolated by the polynomial
    through both ends and the Gauss points. Virtual rotations are those of the formulation, see `Path.galerkin`.
    """
    rule, p, r_s = path.rule, path.degree, records["gauss_fields"][..., 6:]
    h, cells = _elements(path.layout, path.scene, path.scales.length, p)
    fields = records["gauss_fields"][..., :6] + carried
    n = fields[..., :3]
    at_gauss, at_nodes = records["densities"]
    density = np.zeros_like(fields) if at_gauss is None else at_gauss.copy()
    density[..., 3:] += r_s[..., _NEXT] * n[..., _LAST] - r_s[..., _LAST] * n[..., _NEXT]
    along = np.matmul(rule.contact_from_fields, fields)
    along += np.matmul(rule.contact_from_densities, density * h)
    if path.galerkin or at_nodes is not None:
        more = np.zeros((*along.shape[:2], 2, 6))
        if at_nodes is not None:
            more -= h * rule.lobatto[[0, p], None] * at_nodes[:, :, [0, p]]
        if path.galerkin:
            q, m = records["rq"][:, :, 3:][:, cells], fields[..., 3:]
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
    """(nodes, k) from values at the nodes of every element of a rod (elements, p + 1, k); at shared nodes the values of
    the element before."""
    return np.concatenate([values[:1, 0], values[:, 1:].reshape(-1, values.shape[2])])


def viscous_contact(history, which, rod):
    """n and m (n, nodes, 3) of Kelvin-Voigt damping of a rod in several states of a `History`, N and N m, material; at
    a jump of the section the values of the element before."""
    s = history.layout.nodes_of(history._rows(rod)[0], history.rule.nodes) * rod.length
    law = rod.damping.viscosity(rod.stiffness_at(s, "left"))
    rates = np.array([_strain_rates(history, history._records[k], rod) for k in which])
    return law.contact(rates[..., :3], rates[..., 3:])


def _strain_rates(history, record, rod):
    """(nodes, 6) rates of the material strains v and u, 1/s and 1/(m s), extrapolated from the Gauss points: v_t = R^T
    (r_t' - w x r') and u_t = R^T w', with the angular velocity w = 2 vec(q_t conj(q))/|q|^2 of the interpolated q, as
    in the models."""
    i, _ = history._rows(rod)
    rule, breaks, cells = history.rule, history.layout.breaks[i], history._cells(i)
    h = np.diff(breaks)[:, None, None] * rod.length / history.scales.length
    nodes, _ = cell_nodes(history.layout, history.degree)[i]
    q, velocity, spin = record.rq[nodes, 3:], record.rates[nodes, :3], record.rates[nodes, 3:]
    zero = np.zeros_like(spin[..., :1])
    q_t = product_conjugate(np.concatenate([zero, spin], axis=-1), q * [1, -1, -1, -1]) / 2
    (p, p_t), (p_s, p_ts) = ([values @ x for x in (q, q_t)] for values in (rule.basis(rule.gauss), rule.slopes / h))
    squared = np.einsum("...i,...i", p, p)[..., None]
    w = _turning(p_t, p) / squared
    along = 2 * np.einsum("...i,...i", p, p_s)[..., None] / squared
    w_s = (_turning(p_ts, p) + _turning(p_t, p_s)) / squared - along * w
    v_t = rule.slopes @ velocity / h - np.cross(w, record.gauss_fields[cells, :, 6:])
    s = (breaks[:-1, None] + np.diff(breaks)[:, None] * rule.gauss) * rod.length
    d = directors((p / np.sqrt(squared)).reshape(-1, 4)) @ rod.curve.frame(s.ravel())
    units = history.time_unit, history.time_unit * history.scales.length
    found = [
        np.einsum("kij,ki->kj", d, x.reshape(-1, 3)).reshape(x.shape) / unit
        for x, unit in zip((v_t, w_s), units, strict=True)
    ]
    return at_nodes(rule.between_gauss(rule.nodes) @ np.concatenate(found, axis=-1))


def _turning(p, q):
    return 2 * product_conjugate(p, q)[..., 1:]
