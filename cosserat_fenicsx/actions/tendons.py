"""Tendons: threads along a rod, guided by its sections without friction, that are tightened or shortened to move it.

A tendon runs through the points r + R a(s), a = R_R p(s), and has the tension T all along. Its energy is T times its
length, whose variation is a force T t and a moment R a x T t in every section, t the direction of the tendon. It is
anchored at both ends of the rod. What bends the rod also holds the tendon: one in the axis of a straight rod does not
make it buckle, whatever its tension.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from cosserat_fenicsx.checks import Numbers, refuse
from cosserat_fenicsx.kinds import Number
from cosserat_fenicsx.numerics import PLACES
from cosserat_fenicsx.parts import ForceSize, FunctionAlong, Length, Several, at_least, positive
from cosserat_fenicsx.scene import action
from cosserat_fenicsx.scene.action import LineAction
from cosserat_fenicsx.scene.loads import Load
from cosserat_fenicsx.scene.rod import RodOrName
from cosserat_fenicsx.scene.signals import AlongPieces, VectorInTime, values_of

# Step of differences along the rod, over its length.
_STEP = 5e-4


@dataclass(frozen=True)
class Helical(FunctionAlong):
    """The offset of a tendon that winds around the axis of a rod, from d_1 towards d_2.

    Args:
        radius: its distance from the axis, m.
        pitch: arc length of one turn, m; negative to wind the other way.
        start: angle from d_1 at the start of the rod, rad.

    Raises:
        SceneError: a radius that is not positive, a pitch of zero, numbers that are not finite.
    """

    radius: Length
    pitch: Annotated[float, Number("length")]
    start: Annotated[float, Number("rotation")] = 0.0
    breaks = kinks = ()

    def validate(self):
        if self.pitch == 0:
            refuse(self, "pitch", self.pitch, "the arc length of one turn (m), not zero")

    def __call__(self, s):
        """(n, 3) at arc lengths s (n,), m."""
        angle = 2 * math.pi * np.asarray(s, dtype=float) / self.pitch + self.start
        return self.radius * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)

    def check(self, length):
        """It fits any length."""


@dataclass(frozen=True)
class Tendon(Load, LineAction):
    """A tendon along a whole rod, with a given tension or of a given length, and without friction.

    The contact force of the rod does not include it: a rod pulled by a tendon alone has the contact force -T t, and its
    supports have no reaction.

    Args:
        rod: the rod.
        offset: where the tendon runs in the section, m from the axis along d_1 and d_2: two numbers; or `Helical`,
            `Along` or `AlongTable` with three components, along d_1, d_2, d_3.
        tension: N, not negative; or a function of time.
        shortening: instead of a tension, how much shorter the tendon gets, m, from its length in the reference at the
            load factor 0; negative to slacken it. In `solve` alone. A tendon does not push: where it would, its tension
            is zero, and it is shorter along the rod than its length.
        axial: of a tendon of given length, its stiffness EA, N; None where it does not stretch.
        jumps: times where a function of time is not smooth, s.
        permanent: whether it acts in full, before all that the load factor multiplies.

    Raises:
        SceneError: not a rod, numbers that are not finite, a negative tension, an offset that jumps, both or none
            of tension and shortening, or a tendon of given length that is permanent.
    """

    rod: RodOrName
    offset: Annotated[Numbers | FunctionAlong, VectorInTime(Several("length", 2), (FunctionAlong,), functions=False)]
    tension: (
        Annotated[ForceSize | Callable[[float], float], VectorInTime(Number("force", at_least(0, "a tension")))] | None
    ) = None
    jumps: Numbers = ()
    permanent: bool = False
    shortening: Annotated[float, Number("length")] | None = None
    axial: Annotated[float, Number("force", positive())] | None = None

    work, is_thread = "tendon", True
    traits = dict(dead=False, known_force=False, rates=False, turns=True, flat=True)

    def validate(self):
        if isinstance(self.offset, AlongPieces):
            refuse(self, "offset", self.offset, "a function without jumps, Along or AlongTable")
        if (self.tension is None) == (self.shortening is None):
            refuse(self, "tension", self.tension, "either tension (N) or shortening (m)")
        if self.axial is not None and not self.shortens:
            refuse(self, "axial", self.axial, "None, since the tension is given")
        if self.permanent and self.shortens:
            refuse(self, "permanent", True, "False: the load factor multiplies a shortening")

    @property
    def shortens(self):
        """See `Action`."""
        return self.shortening is not None

    @property
    def scaled(self):
        """See `Action`."""
        return not (self.permanent or self.shortens)

    def data(self, rod, s):
        s = np.asarray(s, dtype=float)
        tension = np.full(s.shape, 0.0 if self.shortens else float(np.reshape(self.tension, -1)[0]))
        return (
            action.scalar(tension, "N"),
            action.vector(self._arm(rod, s), "m"),
            action.vector(self._slope(rod, s), "1"),
        )

    def _arm(self, rod, s):
        """(n, 3) R_R p: from the axis to the tendon, inertial in the reference, m."""
        offset = values_of(self.offset, s) if self._winds else (*self.offset, 0.0)
        return np.einsum("kij,kj->ki", rod.curve.frame(s), np.broadcast_to(offset, (len(s), 3)))

    def _slope(self, rod, s):
        """(n, 3) (R_R p)', by the polynomials through places near s between the same two kinks."""
        kinks = {x for x in (*self.breaks(rod), *self.kinks(rod), *rod.curve.breaks) if 0 < x < rod.length}
        edges = np.array([0.0, *sorted(kinks), rod.length])
        piece = np.clip(np.searchsorted(edges, s, side="right") - 1, 0, len(edges) - 2)
        low, high = edges[piece], edges[piece + 1]
        step = np.minimum(_STEP * rod.length, (high - low) / (2 * max(PLACES)))
        middle = np.clip(s, low + max(PLACES) * step, high - max(PLACES) * step)
        x, powers = ((s - middle) / step)[:, None], np.arange(1, len(PLACES))
        weights = (powers * x ** (powers - 1)) @ np.linalg.inv(np.vander(PLACES, increasing=True))[1:]
        # without the part that is constant: its rounding over the step would be no smooth function of the offset
        arms = [self._arm(rod, middle + place * step) - self._arm(rod, middle) for place in PLACES]
        return np.einsum("kp,pki->ki", weights, arms) / step[:, None]

    @property
    def _winds(self):
        return isinstance(self.offset, FunctionAlong)

    def breaks(self, rod):
        return tuple(self.offset.breaks) if self._winds else ()

    def kinks(self, rod):
        return tuple(self.offset.kinks) if self._winds else ()
