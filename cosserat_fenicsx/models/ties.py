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
from cosserat_fenicsx.forms import ties as eq
from cosserat_fenicsx.models.compiling import compiling
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
        self._nodes, self._length = np.array(nodes), length
        self._all, self._count = np.arange(len(ties))[:, None], len(reference)
        self._data = np.zeros((len(ties), eq.COUNT))
        rest = np.append(reference, [_GROUND[:3]], axis=0)
        self._data[:, eq.PLACES["place"]] = rest[self._nodes[:, 0]] - rest[self._nodes[:, 1]]
        self._take(ties)
        # ties of the same two nodes stand together: where they begin, and the places of both nodes in rows of the
        # displacements and rotations of all nodes and the ground
        pairs = self._nodes % (self._count + 1)
        self._first = np.flatnonzero(np.append(True, (pairs[1:] != pairs[:-1]).any(axis=1)))
        places = (6 * pairs[self._first, :, None] + np.arange(6)).reshape(-1, 12)
        self._places = [np.ix_(x, x) for x in places]

    def _take(self, ties):
        for row, tie in zip(self._data, ties, strict=True):
            for name, value in _numbers(tie, self._length).items():
                row[eq.PLACES[name]] = value

    def with_numbers_of(self, ties):
        """The same equations with other data, those of prescribed motions at another time."""
        other = copy(self)
        other._data = self._data.copy()
        other._take(ties)
        return other

    def _rows(self, rq, eta, multipliers):
        """What the kernels take, see `forms.ties.PLACES`."""
        rows, motion = self._data.copy(), np.empty((self._count + 1, 7))
        motion[:-1], motion[-1] = rq, _GROUND
        rows[:, : eq.MOTION] = motion[self._nodes].reshape(-1, eq.MOTION)
        rows[:, -2], rows[:, -1] = eta, multipliers
        return rows

    def evaluate(self, rq, eta):
        """Values at (r, q) (tied nodes, 7) and a load factor.

        Returns:
            c (ties,); gradients (ties, tied nodes, 6) over (displacement, rotation), which are also the reactions per
            unit of multiplier.
        """
        found, gradient = np.zeros((len(self._data), 13)), np.zeros((len(self._data), self._count + 1, 6))
        _kernels()[0](self._rows(rq, eta, 0.0), found)
        gradient[self._all, self._nodes] = found[:, 1:].reshape(-1, 2, 6)
        return found[:, 0], gradient[:, :-1]

    def change(self, rq, eta, multipliers):
        """The tangent of the reactions, (tied nodes, 6, tied nodes, 6), at (r, q) (tied nodes, 7), a load factor and
        multipliers (ties,)."""
        found, total = np.zeros((len(self._data), 12, 12)), np.zeros((6 * self._count + 6, 6 * self._count + 6))
        _kernels()[1](self._rows(rq, eta, multipliers), found)
        for place, block in zip(self._places, np.add.reduceat(found, self._first), strict=True):
            total[place] += block
        return total[:-6, :-6].reshape(self._count, 6, self._count, 6)


def _numbers(tie, length):
    """The data of a tie of `cosserat_fenicsx.scene.ties` by their names in forms/ties.py."""
    if isinstance(tie, PositionTie):
        return {"n": tie.direction, "rate": tie.rate / length}
    if isinstance(tie, AngleTie):
        return {"t": tie.t, "w": tie.w}
    angle = float(np.linalg.norm(tie.rotation))
    return {"axis": tie.axis, "angle": angle, "about": np.divide(tie.rotation, angle or 1.0)}
