"""The law of sections at the Gauss points: its data, the Functions that hold them, and the law used in forms.

K are the principal values of the stiffness A against stretch and shear, J those of the stiffness S against bending and
torsion where there is no contact force, see forms/law.py. Diagonal sections need no more; where a section of the scene
couples strains, the principal axes of A and S and the coupling G are stored too.
"""

from collections import namedtuple

import numpy as np
import ufl

from cosserat_fenicsx.forms.law import CoupledLaw, DiagonalLaw

#: Arrays (.., 3) K and J, which may be infinite in K; and (.., 3, 3), or None where all sections are diagonal: the
#: principal axes of A and of S as columns, and G. Dimensionless.
LawData = namedtuple("LawData", "K J A_axes S_axes G", defaults=(None, None, None))


def law_data(along, scales, *, coupled):
    """The `LawData` of `Stiffnesses`.

    Args:
        scales: anything with the units `force` and `length`.
        coupled: whether to return full matrices, also for diagonal sections.
    """
    force, length = scales.force, scales.length
    K, J = along.K / force, along.J / (force * length**2)
    if not coupled:
        return LawData(K, J)
    if along.matrix is None:
        axes = np.broadcast_to(np.eye(3), (*K.shape, 3))
        return LawData(K, J, axes, axes, np.zeros(axes.shape))
    M = along.matrix / force
    B, D = M[..., :3, 3:] / length, M[..., 3:, 3:] / length**2
    K, A_axes = np.linalg.eigh(M[..., :3, :3])
    with np.errstate(divide="ignore"):
        K_inv = np.where(K > 0, 1 / K, 0.0)  # a viscosity may be zero
    G = spread(K_inv, A_axes) @ B
    S = D - np.swapaxes(B, -1, -2) @ G
    J, S_axes = np.linalg.eigh((S + np.swapaxes(S, -1, -2)) / 2)
    return LawData(K, J, A_axes, S_axes, G)


def spread(values, axes):
    """(.., 3, 3) the symmetric matrices with these principal values and axes."""
    return (axes * values[..., None, :]) @ np.swapaxes(axes, -1, -2)


def turned(data, P):
    """`LawData` (or what has its fields) with components along other axes: a becomes P a, P (.., 3, 3)."""
    G = P @ data.G @ np.swapaxes(P, -1, -2)
    return data._replace(A_axes=P @ data.A_axes, S_axes=P @ data.S_axes, G=G)


def strain(data, n, k):
    """v - v_R (.., 3) where the contact force n is known, material."""
    if data.G is None:
        return n / data.K
    return _times(spread(1 / data.K, data.A_axes), n) - _times(data.G, k)


def moment(data, n, k):
    """m (.., 3) where the contact force n is known, material."""
    if data.G is None:
        return data.J * k
    return _times(np.swapaxes(data.G, -1, -2), n) + _times(spread(data.J, data.S_axes), k)


def _times(matrix, a):
    return np.einsum("...ij,...j->...i", matrix, a)


def field_values(data, stiff):
    """What the Functions K, K_inv, K_stiff, J and G hold, (elements, points, k) each: diagonals, or matrices row by
    row.

    Args:
        data: the `LawData`; stiff: the bounded K for the second variation.
    """
    finite = np.where(np.isinf(data.K), 0.0, data.K)
    K, K_inv, K_stiff = (stretch_values(data, values) for values in (finite, 1 / data.K, stiff))
    return K, K_inv, K_stiff, _numbers(data.J, data.S_axes), _rows(data.G)


def stretch_values(data, K):
    """Values of the Function of a stretch and shear stiffness with the principal values K."""
    return _numbers(K, data.A_axes)


def viscous_values(data):
    """Values of the Functions of a viscous law, in the order of `law_of`; the inverse is None."""
    return stretch_values(data, data.K), None, _numbers(data.J, data.S_axes), _rows(data.G)


def _numbers(values, axes):
    return values if axes is None else _rows(spread(values, axes))


def _rows(matrix):
    return None if matrix is None else matrix.reshape(*matrix.shape[:-2], 9)


def law_of(K, K_inv, J, G):
    """The law used in forms, from Functions filled by `field_values`; G is None where it is diagonal."""
    if G is None:
        return DiagonalLaw(K, K_inv, J)
    return CoupledLaw(*(a if a is None else as_matrix(a) for a in (K, K_inv, J, G)))


def stiff_enough(n, data):
    """The law of the second variation at a contact force n: bounded stiffnesses, raised where n requires it.

    Args:
        data: the `RodFields`.
    """
    return law_of(data.K_stiff, data.K_inv, data.J, data.G).raised(ufl.sqrt(ufl.dot(n, n)))


def as_matrix(a):
    """The 3 x 3 matrix of nine numbers, row by row."""
    return ufl.as_matrix([[a[3 * i + j] for j in range(3)] for i in range(3)])
