"""Steady rotation of a whole scene about a fixed axis: the inertia of its rods in the rotating frame."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import ufl

from cosserat_fenicsx.checks import Numbers, refuse
from cosserat_fenicsx.parts import Several
from cosserat_fenicsx.scene import action
from cosserat_fenicsx.scene.action import LineAction, PointAction
from cosserat_fenicsx.scene.rod import Rod, Station, mass_arm, require_inertia
from cosserat_fenicsx.scene.supports import InitialVelocity

# Samples along a rod, and the sine of the angle below which it has the direction of the axis.
_SAMPLES, _SAME = 33, 1e-6


@dataclass(frozen=True)
class Centrifugal(LineAction):
    """The inertia of a rotation at a constant rate about a fixed axis, on all rods and masses of a scene, for `solve`.

    Equilibria are relative ones: the rods rotate about the axis without changing their shape, such as a shaft in
    synchronous forward whirl. A motion without this action keeps that rotation if it starts there, by
    `simulate(start=path)` and `velocities`. Supports and loads must be the same in every position of that rotation.

    It acts in full, except for the unbalance of eccentric rods, which the load factor multiplies: a straight shaft on
    the axis is thus led to its whirl above critical speeds, too. There some modes are negative, since the potential of
    the rotating frame does not show stability by gyroscopic moments.

    Args:
        rate: the angular velocity, rad/s, inertial, along the axis.
        through: a point of the axis, m.

    Raises:
        SceneError: not three finite numbers, or no rotation; a rod without mass or inertia (raised by `Scene`); a rod
            across the axis with an `AddedMass` that is not `axial` (raised by `solve`).
    """

    rate: Annotated[Numbers, Several("angular velocity")]
    through: Annotated[Numbers, Several("length")] = (0.0, 0.0, 0.0)

    rod, work, scaled, of_inertia = None, None, False, True

    def validate(self):
        if not any(self.rate):
            refuse(self, "rate", self.rate, "an angular velocity that is not zero")

    def acts_on(self, rod):
        """All rods rotate."""
        return True

    def check_rod(self, rod):
        require_inertia(rod, "Centrifugal")

    def velocities(self, rods):
        """The velocities of the rotation, an `InitialVelocity` for each of the rods."""
        return tuple(InitialVelocity(rod, angular=self.rate, about=self.through) for rod in rods)

    def companions(self, scene):
        """Its actions on rods, on their unbalance, and on point masses."""
        along = [x for x in scene.loads if x.station is None]
        for load in along:
            if load.lateral and not self._is_along(load.rod):
                refuse("Centrifugal", "rate", self.rate, f"one along rod '{load.rod.name}', or AddedMass(axial=True)")
        rods = [_OfRod(rod, self, tuple(x for x in along if x.acts_on(rod))) for rod in scene.rods]
        unbalance = [_OfUnbalance(rod, self) for rod in scene.rods if rod.mass_centre]
        fixed = [x for x in scene.loads if x.station is not None and x.inertia(x.station.rod) is not None]
        return *rods, *unbalance, *(_OfPoint(x.station, self, x) for x in fixed)

    def _is_along(self, rod):
        tangents = rod.curve.frame(np.linspace(0, rod.length, _SAMPLES))[..., 2]
        across = np.linalg.norm(np.cross(tangents, self.rate), axis=1)
        return across.max() <= _SAME * np.linalg.norm(self.rate)


def turning(point, test, mass, J1, J2, J3, rate, through):
    """Virtual work of -m w x (w x r) and of the rate -w x (I w) of the angular momentum about the mass centre."""
    force = -mass * ufl.cross(rate, ufl.cross(rate, point.r - through))
    axes = [point.directors[:, i] for i in range(3)]
    spin = sum(J * ufl.dot(rate, d) * d for J, d in zip((J1, J2, J3), axes, strict=True))
    return ufl.dot(force, test.phi_r) - ufl.dot(ufl.cross(rate, spin), test.phi)


def unbalanced(point, test, mass, arm, rate, through):
    """Addition to `turning` for a mass centre at the end of an arm, inertial in the reference."""
    z = point.R * arm
    more = -mass * ufl.cross(rate, ufl.cross(rate, z))
    whole = more - mass * ufl.cross(rate, ufl.cross(rate, point.r - through))
    return ufl.dot(more, test.phi_r) + ufl.dot(ufl.cross(z, whole), test.phi)


def _turning_data(mass, J, of, units):
    numbers = (mass, *np.moveaxis(np.asarray(J), -1, 0))
    return (
        *(action.scalar(x, unit) for x, unit in zip(numbers, (units[0], *[units[1]] * 3), strict=True)),
        action.vector(of.rate, "rad/s"),
        action.vector(of.through, "m from origin"),
    )


@dataclass(frozen=True)
class _OfRod(LineAction):
    """On the rod, and on the masses along it, as if all were on the axis; at the nodes, as the inertia of motions."""

    rod: Rod
    of: Centrifugal
    along: tuple

    called, at_nodes, scaled, work = "Centrifugal", True, False, staticmethod(turning)

    def data(self, rod, s):
        found = rod.stiffness_at(s)
        added = [x.added_mass(rod, s, "right") for x in self.along]
        mass = found.mass + sum(both[0] for both in added if both is not None)
        return _turning_data(mass, found.inertia, self.of, ("kg/m", "kg m"))


@dataclass(frozen=True)
class _OfUnbalance(LineAction):
    """The additional inertia of an eccentric rod."""

    rod: Rod
    of: Centrifugal

    called, at_nodes, work = "Centrifugal", True, staticmethod(unbalanced)

    def data(self, rod, s):
        return (
            action.scalar(rod.stiffness_at(s).mass, "kg/m"),
            action.vector(mass_arm(rod, s), "m"),
            action.vector(self.of.rate, "rad/s"),
            action.vector(self.of.through, "m from origin"),
        )


@dataclass(frozen=True)
class _OfPoint(PointAction):
    """On a point mass."""

    station: Station
    of: Centrifugal
    body: PointAction

    called, scaled, work = "Centrifugal", False, staticmethod(turning)

    def data(self, rod, s):
        return _turning_data(*self.body.inertia(rod), self.of, ("kg", "kg m^2"))
