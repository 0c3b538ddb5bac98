"""Data along a rod that have kinks inside elements, replaced by the nearest polynomials on each element.

Gauss points may miss a narrow peak. The polynomial of degree p - 1 that is nearest in the mean square has the same
integrals against polynomials of degree p - 1, the total and the moment of a load among them, and its values at the p
Gauss points are integrals against the Lagrange polynomials through these points, which are orthogonal.
"""

import numpy as np

# Quadrature on an interval between kinks: exact for data that are linear there, up to p = 4.
_PLACES, _WEIGHTS = np.polynomial.legendre.leggauss(3)


def nearest_polynomials(action, rod, s, starts, lengths):
    """The action's `Datum`s at the Gauss points, with values of the nearest polynomials.

    Args:
        action, rod: an action along the rod.
        s: (elements * p,) arc lengths of the Gauss points, element by element, m.
        starts, lengths: (elements,), m.
    """
    given = action.data(rod, s)
    if not len(starts):
        return given
    p = len(s) // len(starts)
    at_gauss = (s.reshape(-1, p) - starts[:, None]) / lengths[:, None]
    order = np.argsort(starts)
    ends = np.concatenate([starts, starts + lengths, action.kinks(rod)])
    edges = np.unique(ends[(ends >= starts.min()) & (ends <= (starts + lengths).max())])
    middles, sizes = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    owner = order[np.searchsorted(starts[order], middles, side="right") - 1]
    inside = middles < starts[owner] + lengths[owner]  # a rank need not own neighbouring elements
    owner, middles, sizes = owner[inside], middles[inside], sizes[inside]
    places = middles[:, None] + sizes[:, None] * _PLACES / 2
    local = (places - starts[owner][:, None]) / lengths[owner][:, None]
    basis = np.ones((*local.shape, p))
    for q in range(p):
        for other in set(range(p)) - {q}:
            x_q, x_other = at_gauss[owner, q, None], at_gauss[owner, other, None]
            basis[:, :, q] *= (local - x_other) / (x_q - x_other)
    weights = (sizes / lengths[owner])[:, None] * _WEIGHTS / 2
    gauss = np.polynomial.legendre.leggauss(p)[1] / 2  # symmetric: reversed elements have the same
    found = []
    for datum, sampled in zip(given, action.data(rod, places.ravel()), strict=True):
        if len(np.reshape(datum.value, (-1, datum.size))) != len(s):  # a constant
            found.append(datum)
            continue
        values = np.zeros((len(starts), p, datum.size))
        parts = np.einsum("kg,kgq,kgi->kqi", weights, basis, sampled.value.reshape(*local.shape, datum.size))
        np.add.at(values, owner, parts)
        found.append(datum._replace(value=(values / gauss[:, None]).reshape(-1, datum.size)))
    return tuple(found)
