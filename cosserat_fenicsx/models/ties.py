"""The constraint equations of supports and joints: their values, their reactions and the tangent of both.

Every equation c = 0 is a function of the position and the rotation of one or two nodes; its multiplier lambda is the
reaction. Derivatives are by small displacements and small inertial rotations, which every model maps to its own
unknowns.
"""

from functools import lru_cache

import numpy as np

from cosserat_fenicsx.quaternions import cross, directors, skew
from cosserat_fenicsx.scene.ties import AngleTie, PositionTie


class Ties:
    """The ties of a scene, dimensionless.

    Args:
        ties: those of the scene (`cosserat_fenicsx.scene.ties`).
        nodes: (a, b) of every tie as indices into the tied nodes; b = -1 for the ground.
        reference: (tied nodes, 3) positions at rest.
        length: unit of length, m.
    """

    def __init__(self, ties, nodes, reference, length):
        self._ties, self._nodes, self._reference, self._length = ties, np.array(nodes), reference, length
        self._kinds = lru_cache(maxsize=None)(self._sorted)

    def _sorted(self, which):
        """{kind of tie: (indices in `which`, nodes a and b, fields as arrays)}; and the constant gradients."""
        ties, kinds = [self._ties[i] for i in which], {}
        nodes = self._nodes[list(which)]
        for kind in {type(tie) for tie in ties}:
            at = np.array([i for i, tie in enumerate(ties) if type(tie) is kind])
            fields = [np.array([getattr(ties[i], name) for i in at], dtype=float) for name in kind._fields[2:]]
            kinds[kind] = (at, nodes[at, 0], nodes[at, 1], *fields)
        constant = np.zeros((len(ties), len(self._reference), 6))
        if PositionTie in kinds:
            at, a, b, n, _ = kinds[PositionTie]
            constant[at, a, :3] = n
            far = b >= 0
            constant[at[far], b[far], :3] -= n[far]
        return kinds, constant

    def with_numbers_of(self, ties):
        """The same equations with other data, those of prescribed motions at another time."""
        return Ties(ties, self._nodes, self._reference, self._length)

    def evaluate(self, rq, eta, multipliers, which=None):
        """Values and derivatives at (r, q) (tied nodes, 7) and a load factor.

        Args:
            which: tuple of the indices of the equations to evaluate, None for all; multipliers: theirs.

        Returns:
            c (ties,); gradients (ties, tied nodes, 6) over (displacement, rotation), which are also the reactions per
            unit of multiplier; tangent of the reactions (tied nodes, 6, tied nodes, 6).
        """
        which = tuple(range(len(self._ties))) if which is None else which
        kinds, constant = self._kinds(which)
        count, gradient = len(rq), constant.copy()
        c, tangent = np.zeros(len(which)), np.zeros((count, 6, count, 6))
        for kind, parts in kinds.items():
            if kind is PositionTie:
                at, _, _, _, rate = parts
                c[at] = gradient[at, :, :3].reshape(len(at), -1) @ (rq[:, :3] - self._reference).ravel()
                c[at] -= eta / self._length * rate
            else:
                add = self._angles if kind is AngleTie else self._turns
                add(parts, rq[:, 3:], eta, multipliers, c, gradient, tangent)
        return c, gradient, tangent

    @staticmethod
    def _angles(parts, q, eta, multipliers, c, gradient, tangent):
        at, a, b, t, w = parts
        turn = np.empty((len(q) + 1, 3, 3))
        turn[:-1], turn[-1] = directors(q / np.sqrt((q * q).sum(axis=1, keepdims=True))), np.eye(3)  # the ground last
        u, v = (turn[a] @ t[:, :, None])[..., 0], (turn[b] @ w[:, :, None])[..., 0]
        c[at], moment = (u * v).sum(axis=1), cross(u, v)
        gradient[at, a, 3:] = moment
        # d(u x v) by the rotations of a and of b; u x (v x theta) = (v u^T - (u.v) I)^T theta
        by_a = multipliers[at, None, None] * (u[:, :, None] * v[:, None, :] - c[at, None, None] * np.eye(3))
        for i, k in enumerate(a):
            tangent[k, 3:, k, 3:] += by_a[i]
        for i in np.flatnonzero(b >= 0):
            k, far = a[i], b[i]
            gradient[at[i], far, 3:] -= moment[i]
            tangent[k, 3:, far, 3:] -= by_a[i].T
            tangent[far, 3:, k, 3:] -= by_a[i]
            tangent[far, 3:, far, 3:] += by_a[i].T

    @staticmethod
    def _turns(parts, q, eta, multipliers, c, gradient, tangent):
        at, a, _, axis, rotation = parts
        angle = np.sqrt((rotation * rotation).sum(axis=1))
        half = 0.5 * eta * angle
        p0, p = np.cos(half), (np.sin(half) / np.where(angle, angle, 1.0))[:, None] * rotation
        q0, qv = q[a, 0], q[a, 1:]
        s0 = q0 * p0 + (qv * p).sum(axis=1)  # s = q conj(p)
        s = qv * p0[:, None] - q0[:, None] * p - cross(qv, p)
        along = (axis * s).sum(axis=1)
        c[at] = 2 * along
        gradient[at, a, 3:] = s0[:, None] * axis + cross(s, axis)
        change = s[:, :, None] * axis[:, None, :] - axis[:, :, None] * s[:, None, :] - along[:, None, None] * np.eye(3)
        for i, k in enumerate(a):
            tangent[k, 3:, k, 3:] += 0.5 * multipliers[at[i]] * (change[i] - s0[i] * skew(axis[i]))
