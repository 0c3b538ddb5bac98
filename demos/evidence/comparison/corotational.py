"""A planar two-node co-rotational Timoshenko beam for large displacements, as in commercial packages.

Each element is a linear Timoshenko beam, exact in its nodes for bending and shear, in a frame that turns with the chord
(after Crisfield, Non-linear Finite Element Analysis of Solids and Structures 1, 1991, ch. 7). It converges with second
order to Reissner's rod, except for terms of the order of the square of the strains, here 1e-8.
"""

import numpy as np

from comparison.chain import Chain
from comparison.column import Column, Curve
from comparison.follow import Stopped, follow


def solve(etas, elements, *, column=None, adaptive=True):
    """The path of the co-rotational column under load control.

    Args:
        etas: load factors F/P_cr, ascending.
        elements: number of equal elements.
        column: `Column`; the paper's by default. `arm=True` puts the force on an arm that turns with the tip.
        adaptive: False takes each load factor in one step and accepts any state that Newton's method converges to.

    Returns:
        A `Curve`; `stopped` gives the reason if it ends early.

    Raises:
        SceneError: a number of elements that is not whole and positive, load factors that are no numbers or descend.
    """
    return chain_path(problem(elements, column), etas, adaptive)


def problem(elements, column=None):
    """The column as a problem of `follow`."""
    column = column or Column()
    axial, shear, _ = column.relative
    return Chain(column, elements, lambda length: lambda nodal: beam(nodal, length, axial, shear))


def chain_path(problem, etas, adaptive=True):
    """A `Curve` of a problem through `etas`, as far as load control goes."""
    points, stopped = [], ""
    try:
        points.extend(follow(problem, etas, adaptive=adaptive))
    except Stopped as why:
        stopped = str(why)
    return Curve.of(problem, points, stopped)


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
