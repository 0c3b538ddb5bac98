"""The constraint equations of supports and joints: their values, their reactions and the tangent of both.

Every equation c = 0 is a function of the position and the rotation of one or two nodes (forms/ties.py); its multiplier
lambda is the reaction. Derivatives are by small displacements and small inertial rotations, which every model maps to
its own unknowns.
"""

from copy import copy
from functools import cache

import numpy as np
import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.compiling import compiling
from cosserat_fenicsx.forms import ties as eq
from cosserat_fenicsx.scene.ties import AngleTie, PositionTie

_GROUND = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


@cache
def _kernels():
    """The compiled `forms.ties.derivatives`; the same for all scenes and models."""
    with compiling():
        return [compat.on_rows(x) for x in eq.derivatives(ufl.Constant(compat.interval_domain(), shape=(eq.COUNT,)))]


class Ties:
    """The ties of a scene, dimensionless.

    Args:
        ties: those of the scene (`cosserat_fenicsx.scene.ties`).
        nodes: (a, b) of every tie as indices into the tied nodes; b = -1 for the ground.
        reference: (tied nodes, 3) positions at rest.
        length: unit of length, m.
    """

    def __init__(self, ties, nodes, reference, length):
        self._length, self._count = length, len(reference)
        self._nodes = np.array(nodes) % (self._count + 1)  # the ground last
        rest = np.append(reference, [_GROUND[:3]], axis=0)
        # what the kernels take, see forms/ties.py; motions, load factor and multipliers are of the last evaluation
        self._rows, self._motion = np.zeros((len(ties), eq.COUNT)), np.tile(_GROUND, (len(rest), 1))
        self._rows[:, eq.PLACES["place"]] = np.subtract(*rest[self._nodes.T])
        self._take(ties)
        self._ends = (np.arange(self._count)[:, None] == self._nodes.ravel()).astype(float)
        # ties of the same two nodes stand together: where they begin, and the places of both nodes in rows of the
        # displacements and rotations of all nodes and the ground
        self._first = np.flatnonzero(np.append(True, (self._nodes[1:] != self._nodes[:-1]).any(axis=1)))
        places = (6 * self._nodes[self._first, :, None] + np.arange(6)).reshape(-1, 12)
        self._places = [np.ix_(x, x) for x in places]

    def _take(self, ties):
        for row, tie in zip(self._rows, ties, strict=True):
            for name, value in _numbers(tie, self._length).items():
                row[eq.PLACES[name]] = value

    def with_numbers_of(self, ties):
        """The same equations with other data, those of prescribed motions at another time."""
        other = copy(self)
        other._rows = self._rows.copy()
        other._take(ties)
        return other

    def _run(self, kernel, rq, eta, size):
        """(ties, size) results of a kernel."""
        found, rows, motion = np.zeros((len(self._rows), size)), self._rows, self._motion
        motion[:-1] = rq
        rows[:, : eq.MOTION] = motion.take(self._nodes, axis=0).reshape(-1, eq.MOTION)
        rows[:, -2] = eta
        kernel(rows, found)
        return found

    def evaluate(self, rq, eta):
        """Values at (r, q) (tied nodes, 7) and a load factor.

        Returns:
            c (ties,); gradients (ties, 2, 6) over (displacement, rotation) of the nodes a and b, or the ground, which
            are also the reactions per unit of multiplier.
        """
        found = self._run(_kernels()[0], rq, eta, 13)
        return found[:, 0], found[:, 1:].reshape(-1, 2, 6)

    def on_nodes(self, gradients):
        """(ties, tied nodes, 6) from gradients (ties, 2, 6)."""
        found, ties = np.zeros((len(self._rows), self._count + 1, 6)), np.arange(len(self._rows))
        for i in range(2):  # a and b may be one node
            found[ties, self._nodes[:, i]] += gradients[:, i]
        return found[:, :-1]

    def reactions(self, gradients, multipliers):
        """(tied nodes, 6) forces and moments, sums over the ties, from gradients (ties, 2, 6)."""
        return self._ends @ (multipliers[:, None, None] * gradients).reshape(-1, 6)

    def change(self, rq, eta, multipliers):
        """The tangent of the reactions, (tied nodes, 6, tied nodes, 6), at (r, q) (tied nodes, 7), a load factor and
        multipliers (ties,)."""
        self._rows[:, -1] = multipliers
        found, total = self._run(_kernels()[1], rq, eta, 144), np.zeros((6 * self._count + 6, 6 * self._count + 6))
        for place, block in zip(self._places, np.add.reduceat(found, self._first), strict=True):
            total[place] += block.reshape(12, 12)
        return total[:-6, :-6].reshape(self._count, 6, self._count, 6)


def _numbers(tie, length):
    """The data of a tie of `cosserat_fenicsx.scene.ties` by their names in forms/ties.py."""
    if isinstance(tie, PositionTie):
        return {"n": tie.direction, "rate": tie.rate / length}
    if isinstance(tie, AngleTie):
        return {"t": tie.t, "w": tie.w}
    angle = float(np.linalg.norm(tie.rotation))
    return {"axis": tie.axis, "angle": angle, "about": np.divide(tie.rotation, angle or 1.0)}
