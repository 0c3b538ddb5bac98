"""The added equations of supports and joints: their values, their reactions and the tangent of both.

Every equation c = 0 speaks of the position and the rotation of one or two nodes; its multiplier lambda is the reaction.
Written in small displacements and small inertial rotations, so that every rung can use them through its own unknowns.
"""

import numpy as np

from cosserat_fenicsx.quaternions import directors, skew
from cosserat_fenicsx.ties import AngleTie, PositionTie


class Ties:
    """The ties of a scene, dimensionless.

    Args:
        ties: the scene's (`cosserat_fenicsx.ties`).
        nodes: (a, b) of every tie as indices into the tied nodes; b = -1 for the ground.
        reference: (tied nodes, 3) positions at rest.
        length: unit of length, m.
    """

    def __init__(self, ties, nodes, reference, length):
        self._ties, self._nodes, self._reference, self._length = ties, nodes, reference, length

    def with_numbers_of(self, ties):
        """The same equations with other numbers, those of motions at another time."""
        return Ties(ties, self._nodes, self._reference, self._length)

    def evaluate(self, rq, eta, multipliers, which=None):
        """Values and derivatives at (r, q) (tied nodes, 7) and a load factor.

        Args:
            multipliers: of all ties; which: indices of those that are asked for, None for all.

        Returns:
            c (ties,); gradients (ties, tied nodes, 6) over (displacement, rotation), which are also the reactions per
            unit of multiplier; tangent of the reactions (tied nodes, 6, tied nodes, 6).
        """
        count = len(rq)
        r, q = rq[:, :3], rq[:, 3:]
        turn = directors(q / np.linalg.norm(q, axis=1, keepdims=True))
        which = range(len(self._ties)) if which is None else which
        c, gradient = np.zeros(len(which)), np.zeros((len(which), count, 6))
        tangent = np.zeros((count, 6, count, 6))
        for i, number in enumerate(which):
            tie, (a, b), lam = self._ties[number], self._nodes[number], multipliers[number]
            if isinstance(tie, PositionTie):
                n = np.asarray(tie.direction)
                moved = r[a] - self._reference[a]
                gradient[i, a, :3] = n
                if b >= 0:
                    moved = moved - (r[b] - self._reference[b])
                    gradient[i, b, :3] = -n
                c[i] = n @ moved - eta * tie.rate / self._length
            elif isinstance(tie, AngleTie):
                u = turn[a] @ tie.t
                v = np.asarray(tie.w) if b < 0 else turn[b] @ tie.w
                c[i], moment = u @ v, np.cross(u, v)
                ends = ((a, 1.0, skew(v) @ skew(u)),) + (() if b < 0 else ((b, -1.0, -skew(u) @ skew(v)),))
                for k, sign, _ in ends:
                    gradient[i, k, 3:] = sign * moment
                    for other, _, change in ends:  # d(u x v) by the rotation of `other`
                        tangent[k, 3:, other, 3:] += lam * sign * change
            else:
                half = 0.5 * eta * np.linalg.norm(tie.rotation)
                axis = np.asarray(tie.rotation) / (np.linalg.norm(tie.rotation) or 1.0)
                p0, p = np.cos(half), np.sin(half) * axis
                q0, qv = q[a, 0], q[a, 1:]
                s0, s = q0 * p0 + qv @ p, qv * p0 - q0 * p - np.cross(qv, p)  # q conj(p)
                e = np.asarray(tie.axis)
                c[i] = 2 * e @ s
                gradient[i, a, 3:] = s0 * e + np.cross(s, e)
        return c, gradient, tangent
