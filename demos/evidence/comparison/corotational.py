"""A planar two-node co-rotational Timoshenko beam for large displacements, as in commercial packages.

Each element is a linear Timoshenko beam, exact in its nodes for bending and shear, in a frame that turns with the chord
(after Crisfield, Non-linear Finite Element Analysis of Solids and Structures 1, 1991, ch. 7). It converges with second
order to Reissner's rod, except for terms of the order of the square of the strains, here 1e-8.
"""

from functools import partial

import numpy as np

from comparison import chain


def law(length, axial, shear):
    """The law of elements, see `chain`."""
    return partial(beam, length=length, axial=axial, shear=shear)


problem, solve = chain.of(law)


def beam(nodal, length, axial, shear, bending=1.0):
    """Gradient and Hessian of the energy EA (l - l_0)^2/(2 l_0) + t^T K t/2, t the end rotations relative to the chord.

    Args:
        nodal: (n, 6) displacements and rotations (u, w, theta) of both ends.
        length: l_0 of every element.
        axial, shear, bending: EA, GA, EI.

    Returns:
        (n, 6), (n, 6, 6).
    """
    u_1, w_1, theta_1, u_2, w_2, theta_2 = nodal.T
    along, across = length + u_2 - u_1, w_2 - w_1
    chord = np.hypot(along, across)
    c, s, none = along / chord, across / chord, np.zeros(len(nodal))
    stretched = np.column_stack([-c, -s, none, c, s, none])  # d chord
    normal = np.column_stack([s, -c, none, -s, c, none])
    turned = normal / chord[:, None]  # d angle of the chord
    turns = [np.zeros(6), np.zeros(6)]
    turns[0][2] = turns[1][5] = 1.0
    turns = [unit - turned for unit in turns]

    flexible = 12 * bending / (shear * length**2)
    k = bending / length / (1 + flexible) * np.array([[4 + flexible, 2 - flexible], [2 - flexible, 4 + flexible]])
    angle = np.arctan2(across, along)
    t = np.column_stack([_wrapped(theta_1 - angle), _wrapped(theta_2 - angle)])
    force, moments = axial * (chord - length) / length, t @ k

    gradient = force[:, None] * stretched + moments[:, :1] * turns[0] + moments[:, 1:] * turns[1]
    hessian = axial / length * _outer(stretched, stretched)
    for i in range(2):
        for j in range(2):
            hessian += k[i, j] * _outer(turns[i], turns[j])
    hessian += (force / chord)[:, None, None] * _outer(normal, normal)
    turning = _outer(stretched, normal)
    hessian += (moments.sum(axis=1) / chord**2)[:, None, None] * (turning + turning.transpose(0, 2, 1))
    return gradient, hessian


def _wrapped(angle):
    """The same angle in [-pi, pi]."""
    return np.remainder(angle + np.pi, 2 * np.pi) - np.pi


def _outer(a, b):
    return a[:, :, None] * b[:, None, :]
