"""The viscous part of contact forces and moments at the nodes of a rod in motion."""

import numpy as np

from cosserat_fenicsx.numerics import directors, product_conjugate
from cosserat_fenicsx.results.recovery import at_nodes


def viscous_contact(history, which, rod):
    """n and m (n, nodes, 3) of Kelvin-Voigt damping in several states, N and N m, material; at a jump of the section
    those of the element before.

    Args:
        history: a `History`; which: indices of states (n,); rod: a rod with a `Damping`.
    """
    s = history.layout.node_s(history.rule.nodes)[history._rows(rod)[0]] * rod.length
    law = rod.damping.viscosity(rod.stiffness_at(s, "left"))
    rates = np.array([_strain_rates(history, history._records[k], rod) for k in which])
    return law.contact(rates[..., :3], rates[..., 3:])


def _strain_rates(history, record, rod):
    """(nodes, 6) rates of the material strains v and u, 1/s and 1/(m s), extrapolated from the Gauss points.

    v_t = R^T (r_t' - w x r') and u_t = R^T w', with the angular velocity w = 2 vec(q_t conj(q))/|q|^2 of the
    interpolated q, as in the models.
    """
    i, rows = history._rows(rod)
    rule, breaks, cells = history.rule, history.layout.breaks[i], history._cells(i)
    h = np.diff(breaks)[:, None, None] * rod.length / history.scales.length
    nodes = np.arange(len(h))[:, None] * history.degree + np.arange(history.degree + 1)
    q, velocity, spin = np.split(np.hstack([record.rq[rows, 3:], record.rates[rows]])[nodes], [4, 7], axis=-1)
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
