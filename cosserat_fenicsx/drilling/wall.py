"""What holds the nodes of a string back at the wall of its hole, while it only rotates."""

from collections import namedtuple

import numpy as np

from cosserat_fenicsx.drilling.wall_friction import coefficients
from cosserat_fenicsx.numerics import gauss
from cosserat_fenicsx.well.hole import Mud
from cosserat_fenicsx.well.operations import RotaryDrilling, RotateOffBottom
from cosserat_fenicsx.well.pieces import pieces_of

#: Of the nodes, (n,) each. hold, slide: static and kinetic torque, N m; decay: of the difference, rad/s; 0: at once.
Wall = namedtuple("Wall", "hold slide decay")
_RULE = gauss(4)


def scene_pieces(scene):
    """The `Pieces` of the string of a `Drilling` with a hole, rotating at its depth."""
    weight = 0.0 if scene.bit is None else scene.bit.weight or 0.0
    operation = RotaryDrilling(weight, 0.0) if weight else RotateOffBottom()
    mud = Mud(0.0) if scene.mud is None else scene.mud
    return pieces_of(scene.hole, scene.string, operation, mud, scene.bit_depth)[0]


def soft_string_force(pieces, weight, md):
    """Wall force per length of a soft string that rotates and does not move along the hole, |T k n + w (e - (e.t) t)|.

    Args:
        pieces: the `Pieces` of the string. weight: on bit, N. md: (...) measured depths, m.

    Returns:
        (...) N/m. T is the effective tension, k and n curvature and normal of the hole, t its tangent, w the weight in
        mud, e downwards (softstring.py); friction acts across t alone, and T is that of the weight.
    """
    i = np.minimum(np.searchsorted(pieces.bottom, md), len(pieces.bottom) - 1)
    below = np.cumsum(_heavy(pieces, pieces.top, slice(None))[::-1])[::-1]
    below = np.append(below[1:], 0.0) - weight
    t, n, b, k, w = (x[i] for x in (pieces.t, pieces.n, pieces.b, pieces.curvature, pieces.weight))
    u = pieces.bottom[i] - md
    across = w * (n * np.cos(k * u) + t * np.sin(k * u))
    return np.hypot(k * (below[i] + _heavy(pieces, md, i)) + across, w * b)


def _heavy(pieces, md, i):
    """Weight along the hole of the pieces i below measured depths, N."""
    t, n, k, w = (x[i] for x in (pieces.t, pieces.n, pieces.curvature, pieces.weight))
    u = pieces.bottom[i] - md
    return w * (t * u * np.sinc(k * u / np.pi) - n * k * u**2 / 2 * np.sinc(k * u / 2 / np.pi) ** 2)


def wall_of(scene, depths, normal_force=None):
    """The `Wall` of a `Drilling`, at nodes of so many measured depths (m), each with half of its cells.

    Args:
        normal_force: N/m for an array of measured depths, in place of that of the soft string.
    """
    size = len(depths)
    if scene.hole is None:
        return Wall(*np.zeros((3, size)))
    pieces = scene_pieces(scene)
    weight = 0.0 if scene.bit is None else scene.bit.weight or 0.0
    middles = (depths[1:] + depths[:-1]) / 2
    inside = pieces.bottom[pieces.bottom < depths[-1]]
    cuts = np.unique(np.concatenate([depths, middles, inside]))
    half = np.diff(cuts)[:, None] / 2
    md = cuts[:-1, None] + half * (1 + _RULE.points)
    force = soft_string_force(pieces, weight, md) if normal_force is None else normal_force(md)
    middle = md.mean(axis=1)
    at = np.minimum(np.searchsorted(pieces.bottom, middle), len(pieces.bottom) - 1)
    load = (force * _RULE.weights).sum(axis=1) * half[:, 0]
    node = np.searchsorted(middles, middle)
    static, kinetic = coefficients(scene.friction, scene.hole.at(middle, "friction"))
    speed = None if scene.friction is None else scene.friction.speed
    torque = load * pieces.radius[at]
    hold, slide = (np.bincount(node, torque * x, size) for x in (static, kinetic))
    decay = np.zeros(size)
    if speed is not None:
        grip = np.bincount(node, load * static, size)
        radius = np.divide(hold, grip, out=np.ones(size), where=grip > 0)
        decay = np.full(size, speed) / (1.0 if scene.friction.of_rotation else radius)
    if scene.bit is not None:  # one law a node: the wall beside the bit acts on the node above it
        for x in (hold, slide):
            x[-2] += x[-1]
            x[-1] = 0.0
    return Wall(hold, slide, decay)
