"""The constraint equations of supports and joints: their values, their reactions and the tangent of both.

Every equation c = 0 is a function of the position and the rotation of one or two nodes (forms/ties.py); its multiplier
lambda is the reaction. Derivatives are by small displacements and small inertial rotations, which every model maps to
its own unknowns.
"""

from copy import copy
from functools import cache

import numpy as np
import ufl
from mpi4py import MPI

from cosserat_fenicsx import compat
from cosserat_fenicsx.compiling import compiling
from cosserat_fenicsx.forms import ties as eq
from cosserat_fenicsx.scene.ties import AngleTie, PositionTie

_GROUND = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


@compat.rank_0_first
@cache
def _kernels():
    """The compiled `forms.ties.derivatives`, which are the same for all scenes and models."""
    return compat.on_rows(eq.derivatives(ufl.Constant(compat.interval_domain(), shape=(eq.COUNT,))))


class Ties:
    """The ties of a scene, dimensionless.

    Args:
        ties: those of the scene (`cosserat_fenicsx.scene.ties`).
        pattern: the `TiePattern` of the tied nodes.
        reference: (tied nodes, 3) positions at rest.
        length: unit of length, m.
        comm: of the ranks that make them together.
    """

    def __init__(self, ties, pattern, reference, length, comm=MPI.COMM_SELF):
        with compiling():
            self._add_values, self._add_changes = _kernels(comm)
        self._length, self.pattern = length, pattern
        self._nodes = pattern.ends % (len(reference) + 1)  # the ground last
        rest = np.append(reference, [_GROUND[:3]], axis=0)
        # what the kernels take, see forms/ties.py; motions, load factor and multipliers are of the last evaluation
        self._rows, self._motion = np.zeros((len(ties), eq.COUNT)), np.tile(_GROUND, (len(rest), 1))
        self._rows[:, eq.PLACES["place"]] = np.subtract(*rest[self._nodes.T])
        self._take(ties)
        self._turning = np.array([i for i, tie in enumerate(ties) if not isinstance(tie, PositionTie)], dtype=np.intp)

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

    def _see(self, rq, eta):
        self._motion[:-1] = rq
        self._rows[:, : eq.MOTION] = self._motion.take(self._nodes, axis=0).reshape(-1, eq.MOTION)
        self._rows[:, -2] = eta

    def evaluate(self, rq, eta):
        """Values at (r, q) (tied nodes, 7) and a load factor.

        Returns:
            c (ties,); gradients (ties, 2, 6) over (displacement, rotation) of the nodes a and b, or the ground, which
            are also the reactions per unit of multiplier.
        """
        found = np.zeros((len(self._rows), 13))
        self._see(rq, eta)
        self._add_values(self._rows, found)
        return found[:, 0], found[:, 1:].reshape(-1, 2, 6)

    def on_nodes(self, gradients):
        """(ties, tied nodes, 6) from gradients (ties, 2, 6)."""
        return self.pattern.on_nodes(gradients)

    def reactions(self, gradients, multipliers):
        """(tied nodes, 6) forces and moments, sums over the ties, from gradients (ties, 2, 6)."""
        return self.pattern.by_nodes(multipliers[:, None, None] * gradients)

    def change(self, rq, eta, multipliers):
        """The tangent of the reactions, (pairs, 6, 6) of the pattern, at (r, q) (tied nodes, 7), a load factor and
        multipliers (ties,)."""
        found = np.zeros((len(self._turning), 144))
        self._see(rq, eta)
        self._rows[:, -1] = multipliers
        self._add_changes(self._rows[self._turning], found)
        return self.pattern.sums(found.reshape(-1, 2, 6, 2, 6), self._turning)


def _numbers(tie, length):
    """The data of a tie of `cosserat_fenicsx.scene.ties` by their names in forms/ties.py."""
    if isinstance(tie, PositionTie):
        return {"n": tie.direction, "rate": tie.rate / length}
    if isinstance(tie, AngleTie):
        return {"t": tie.t, "w": tie.w}
    angle = float(np.linalg.norm(tie.rotation))
    return {"axis": tie.axis, "angle": angle, "about": np.divide(tie.rotation, angle or 1.0)}
