"""Friction of the pipe above a rod at the wall of its hole, at the nodes where its waves meet.

At a node the push f of the waves along the hole and their torque g r move the surface, over the impedances A and B r^2,
by (f - F)/A along the hole and (g - G)/B around it. The friction (F, G) is a vector against this slip, of at most the
size L = mu N: all of (f, g) where that is no larger, else it has the size L, and with one number x

    F = f/(1 + A x),  G = g/(1 + B x),  slip = L x.

The inverse of its size is almost linear in x: Newton's method takes a few steps (as in More & Sorensen, SIAM J. Sci.
Stat. Comput. 4 (1983) 553). The wall bears what is across the hole, the part of the friction around it too: with q for
the load across, N^2 + G^2 = q^2. The tension in q, the direction of the friction in N and the slip in mu are those of
the step before, so that a step has one solution.
"""

import numpy as np

from cosserat_fenicsx.drilling.wall_friction import lateral_load, law_of, points_between, scene_pieces, static_weight

_MOST, _ENOUGH = 60, 1e-13  # Newton steps; relative change of x that ends them


class PipeFriction:
    """Friction at the inner nodes of a pipe that is the upper part of the string of a `Drilling` with a hole.

    Args:
        scene: the `Drilling`. depths: (n + 2,) measured depths of the nodes, m; the wall beside an end acts at the
            node next to it.
    """

    def __init__(self, scene, depths):
        pieces, middles = scene_pieces(scene), (depths[1:] + depths[:-1]) / 2
        inside = pieces.bottom[pieces.bottom < depths[-1]]
        md, self._lengths = (x.ravel() for x in points_between(np.unique([*depths, *middles, *inside])))
        self._law, self._of_rotation, of_hole = law_of(scene.friction)
        self._of_hole = scene.hole.at(md, "friction") if of_hole else np.ones_like(md)
        self._load = lateral_load(pieces, static_weight(scene), md)
        self._count = len(depths) - 2
        self._node = np.clip(np.searchsorted(middles, md) - 1, 0, self._count - 1)
        radius = pieces.radius[np.minimum(np.searchsorted(pieces.bottom, md), len(pieces.bottom) - 1)]
        self._radius = self._summed(radius * self._lengths) / self._summed(self._lengths)
        self.begin(0.0)

    def _summed(self, values):
        return np.bincount(self._node, values, self._count)

    def begin(self, thrust):
        """Begin at rest, with a thrust (N) more than in the weight of the string."""
        rest = np.zeros(self._count)
        self._now = self._before = (rest, np.full(self._count, np.nan), rest + thrust)

    def holding(self, push, torque, axial, torsional):
        """(2, n) friction along the hole, N, and around it, N m, in a step; see the module for the arguments: f, g r, A
        and B r^2 of the inner nodes."""
        slip, around, thrust = self._now
        r = self._radius
        f, g, A, B = push, torque / r, axial, torsional / r**2
        size = np.hypot(f, g)
        some = np.where(size > 0, size, 1.0)
        limit = self._limit(slip, np.where(np.isnan(around), np.abs(g) / some, around), thrust)
        x = _shares(f, g, A, B, limit)
        F, G = f / (1 + A * x), g / (1 + B * x)
        found = np.hypot(F, G)
        self._before, around = self._now, np.where(found > 0, np.abs(G) / np.where(found > 0, found, 1.0), around)
        self._now = np.hypot((f - F) / A, (g - G) / B), around, thrust
        return np.array([F, G * r])

    def _limit(self, slip, around, thrust):
        """(n,) the largest friction at nodes, N."""
        law, load = self._law, self._load
        speed = slip / self._radius if self._of_rotation else slip
        coefficient = np.full(self._count, float(law.still))
        coefficient[speed > 0] = law(speed[speed > 0])
        mu = coefficient[self._node] * self._of_hole
        across = load.curvature * (load.tension - thrust[self._node]) + load.normal
        normal = np.hypot(across, load.binormal) / np.sqrt(1 + (mu * around[self._node]) ** 2)
        return self._summed(mu * normal * self._lengths)

    def take(self, thrust):
        """Take the thrust (n,) at the nodes in the step."""
        self._now = (*self._now[:2], thrust)

    def undo(self):
        """Take back the last step."""
        self._now = self._before

    def memory(self):
        """All that later steps depend on."""
        return {"now": np.array(self._now), "before": np.array(self._before)}

    def recall(self, memory):
        """Restore the result of `memory`."""
        self._now, self._before = (tuple(memory[name].copy()) for name in ("now", "before"))


def _shares(f, g, A, B, limit):
    """(n,) x, see the module; 0 where the node sticks."""
    size, x = np.hypot(f, g), np.zeros(len(f))
    at = np.flatnonzero((size > limit) & (limit > 0))
    x[limit <= 0] = np.inf
    f, g, A, B, size, limit = (values[at] for values in (f, g, A, B, size, limit))
    low, high = (size / limit - 1) / np.maximum(A, B), (size / limit - 1) / np.minimum(A, B)
    found = (low + high) / 2
    for _ in range(_MOST):
        along, round_ = f / (1 + A * found), g / (1 + B * found)
        now = np.hypot(along, round_)
        fall = (A * along**2 / (1 + A * found) + B * round_**2 / (1 + B * found)) / now
        high, low = np.where(now < limit, found, high), np.where(now < limit, low, found)
        step = np.clip(found + (1 / limit - 1 / now) * now**2 / fall, low, high)
        done = np.abs(step - found) <= _ENOUGH * found
        found = step
        if done.all():
            break
    x[at] = found
    return x
