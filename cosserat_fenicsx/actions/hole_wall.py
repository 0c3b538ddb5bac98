"""The wall of a hole around rods in motion: contact at the nodes, with set-valued friction."""

from collections import namedtuple
from dataclasses import dataclass, field

import numpy as np

from cosserat_fenicsx.actions.tube_wall import TubeRing, TubeWall
from cosserat_fenicsx.annotations import Numbers
from cosserat_fenicsx.checks import number, store

#: Of a tube, near points of a rod: measured depth (n,), m; point of the axis (n, 3), m, inertial; unit tangent (n, 3);
#: clearance (n,), m; radius of the rod's surface where friction acts (n,), m; friction coefficient (n,).
Around = namedtuple("Around", "md position tangent clearance arm friction")


class _InMotion:
    """What walls of motions share."""

    touches, work, refreshed = True, None, None

    def _check(self, unit):
        super()._check(unit)
        expected = "a number of zero or more (s/m)"
        store(self, damping=number(self, "damping", self.damping, expected, lambda x: 0 <= x < np.inf))

    def data(self, rod, s):
        """See `Action`."""
        return ()

    def tube_around(self, s, points, md):
        """See `Action.touches`."""
        near = self.path.nearest(points, md)
        return Around(near.md, near.position, near.tangent, *self.sizes(s, near.md))


@dataclass(frozen=True)
class HoleWall(_InMotion, TubeWall):
    """The wall of a hole around a rod in motion: the normal force of a spring, with damping, and Coulomb friction.

    It acts at the nodes of the mesh, on the share of the rod's length that belongs to a node. The normal force of a
    node with the penetration p is ``stiffness p (1 + damping p')`` per length, never adhesion (Hunt & Crossley 1975,
    doi:10.1115/1.3423596). Friction is set-valued: a node sticks as long as a force of at most `friction` times the
    normal force can keep it so, else it slips and the force opposes the slip. Slip is that of the rod's surface where
    it touches: along the axis, and round it with the spin of the rod; its force acts there, and so has a moment about
    the centreline.

    In `simulate` alone; for an equilibrium take a `TubeWall`, which may be that of another scene with the same rods,
    given as `start`. It is not multiplied by the load factor. Its stored energy is counted as work, with its sign
    changed, and what friction and damping dissipate as dissipated, in the energy balance of a motion.

    Args:
        rod: the rod.
        path: the axis of the hole, a `WellPath`, m, inertial.
        radius: of the hole, m; or pieces [(md_end, radius)] along the axis.
        contact_radius: of the rod's surface, m; or pieces [(s_end, radius)] along the rod.
        stiffness: of the wall, N/m^2: the penetration is the force per length over it.
        friction: friction coefficient; or pieces [(md_end, coefficient)] along the axis.
        begins: measured depth near which the rod's start lies, m.
        damping: s/m, over the speed of penetration.

    Raises:
        SceneError: numbers outside their range, or a rod as wide as the hole.
    """

    slip: Numbers = field(default=(0.0, 0.0), init=False, repr=False, compare=False)
    has_arm: bool = field(default=True, init=False, repr=False, compare=False)
    damping: float = 0.0


@dataclass(frozen=True)
class HoleRing(_InMotion, TubeRing):
    """The wall of a hole around one station of a rod in motion, such as a stabiliser; see `HoleWall`.

    Args:
        station: where.
        path: the axis of the hole, a `WellPath`.
        clearance: radius of the hole minus that of the ring, m.
        contact_radius: radius of the ring, m, the arm of its friction.
        stiffness: N/m.
        friction: friction coefficient.
        begins, damping: see `HoleWall`.

    Raises:
        SceneError: numbers outside their range.
    """

    slip: Numbers = field(default=(0.0, 0.0), init=False, repr=False, compare=False)
    damping: float = 0.0
