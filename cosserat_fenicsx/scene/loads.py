"""Loads: forces and moments at points and along rods, and weight; all scaled by the load factor, unless `permanent`.

The force or moment of a load is a vector, or a function of time (`signals`) with `jumps` where it is not smooth; that
of a distributed load may be a function of the arc length (`along`). Virtual works: forms/loads.py.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from cosserat_fenicsx.checks import Numbers, NumbersInTime
from cosserat_fenicsx.parts import FunctionAlong, Several
from cosserat_fenicsx.scene import action
from cosserat_fenicsx.scene.action import LineAction, PointAction
from cosserat_fenicsx.scene.rod import Rod, RodOrName, StationOrName, mass_arm, require_inertia
from cosserat_fenicsx.scene.signals import VectorInTime, values_of

_ForceInTime = Annotated[NumbersInTime, VectorInTime(Several("force"))]
_MomentInTime = Annotated[NumbersInTime, VectorInTime(Several("moment"))]


class Load:
    """An action scaled by the load factor, or, if `permanent`, applied before; must be the first base of a class."""

    permanent = False

    @property
    def scaled(self):
        """See `Action`."""
        return not self.permanent


@dataclass(frozen=True)
class _WeightOffAxis(Load, LineAction):
    """The moment R a x rho A g per reference length of a rod with an eccentricity; `Weight` applies the force."""

    rod: Rod
    gravity: Numbers
    permanent: bool = False

    work = "moment_on_arm"

    def data(self, rod, s):
        force = rod.stiffness_at(s).mass[..., None] * np.asarray(self.gravity)
        return action.vector(force, "N/m"), action.vector(mass_arm(rod, s), "m")


class PointLoad(Load, PointAction):
    """A load at a station: the vector in the field `_vector`, inertial."""

    def data(self, rod, s):
        return (action.vector(getattr(self, self._vector), self._unit),)


class FollowerLoad(PointLoad):
    """A point load that turns with the section: the vector in the field `_vector`, material."""

    follows = True

    def data(self, rod, s):
        return (action.vector(_turned(self.station, getattr(self, self._vector)), self._unit),)


def _turned(station, a):
    """Inertial components of the vector with the material components a, in the reference."""
    return station.rod.curve.frame(station.s) @ np.asarray(a)


@dataclass(frozen=True)
class Force(PointLoad):
    """A dead point force.

    Args:
        station: where it acts.
        force: N, inertial; it keeps its direction.
        permanent: whether it is applied in full, before all loads that the load factor multiplies.

    Raises:
        SceneError: not a station, or not three finite numbers nor a function of time.
    """

    station: StationOrName
    force: _ForceInTime
    jumps: Numbers = ()
    permanent: bool = False

    work, _vector, _unit = "force", "force", "N"


@dataclass(frozen=True)
class Moment(PointLoad):
    """A dead point moment.

    Args:
        station: where it acts.
        moment: N m, inertial; it keeps its direction.
        permanent: whether it is applied in full, before all loads that the load factor multiplies.

    Raises:
        SceneError: not a station, or not three finite numbers nor a function of time.
    """

    station: StationOrName
    moment: _MomentInTime
    jumps: Numbers = ()
    permanent: bool = False

    work, _vector, _unit = "moment", "moment", "N m"


@dataclass(frozen=True)
class EccentricForce(PointLoad):
    """A dead point force at the end of a rigid arm that turns with the section.

    Args:
        station: where the arm sits.
        force: N, inertial.
        offset: (a1, a2), the arm along d_1 and d_2, m.
        permanent: whether it is applied in full, before all loads that the load factor multiplies.

    Raises:
        SceneError: not a station, or numbers that are not finite.
    """

    station: StationOrName
    force: _ForceInTime
    offset: Annotated[Numbers, Several("diameter", 2)]
    jumps: Numbers = ()
    permanent: bool = False

    work = "eccentric_force"

    def data(self, rod, s):
        return (action.vector(self.force, "N"), action.vector(_turned(self.station, [*self.offset, 0.0]), "m"))


@dataclass(frozen=True)
class FollowerForce(FollowerLoad):
    """A point force that turns with the section.

    Args:
        station: where it acts.
        force: N, material: along d_1, d_2, d_3 of the moving section.
        permanent: whether it is applied in full, before all loads that the load factor multiplies.

    Raises:
        SceneError: not a station, or not three finite numbers nor a function of time.
    """

    station: StationOrName
    force: _ForceInTime
    jumps: Numbers = ()
    permanent: bool = False

    work, _vector, _unit = "follower_force", "force", "N"


@dataclass(frozen=True)
class FollowerMoment(FollowerLoad):
    """A point moment that turns with the section.

    Args:
        station: where it acts.
        moment: N m, material: about d_1, d_2, d_3 of the moving section.
        permanent: whether it is applied in full, before all loads that the load factor multiplies.

    Raises:
        SceneError: not a station, or not three finite numbers nor a function of time.
    """

    station: StationOrName
    moment: _MomentInTime
    jumps: Numbers = ()
    permanent: bool = False

    work, _vector, _unit = "follower_moment", "moment", "N m"


@dataclass(frozen=True)
class Weight(Load, LineAction):
    """The weight of all rods and point masses of the scene; of a rod, rho A g per unit of reference length, which acts
    at its mass centre (`Rod.eccentricity`).

    Args:
        gravity: m/s^2, inertial.
        permanent: whether it is applied in full, before all loads that the load factor multiplies.

    Raises:
        SceneError: not three finite numbers; a rod without mass (raised by `Scene`).
    """

    gravity: Annotated[Numbers, Several("acceleration")] = (0.0, 0.0, -9.81)
    permanent: bool = False

    work, rod = "force", None

    def check_rod(self, rod):
        require_inertia(rod, "Weight", ("mass",))

    def acts_on(self, rod):
        """All rods have weight."""
        return True

    def data(self, rod, s):
        return (action.vector(rod.stiffness_at(s).mass[..., None] * np.asarray(self.gravity), "N/m"),)

    def companions(self, scene):
        """The weights of the point masses, and the moments of the weight of eccentric rods about their axes."""
        masses = [(x, x.inertia(x.station.rod)) for x in scene.loads if x.station is not None]
        weights = tuple(
            Force(x.station, tuple(found[0] * g for g in self.gravity), permanent=self.permanent)
            for x, found in masses
            if found is not None
        )
        offset = [rod for rod in scene.rods if rod.mass_centre]
        return (*weights, *(_WeightOffAxis(rod, self.gravity, self.permanent) for rod in offset))


class AlongRod:
    """An action along a rod with a vector, in the field `_vector`, that may be a function of the arc length."""

    def breaks(self, rod):
        return getattr(getattr(self, self._vector), "breaks", ())

    def kinks(self, rod):
        return getattr(getattr(self, self._vector), "kinks", ())


class LineLoad(Load, AlongRod, LineAction):
    """A dead load along a rod, per unit of reference length: the vector in the field `_vector`, inertial."""

    def data(self, rod, s):
        return (action.vector(values_of(getattr(self, self._vector), s), self._unit),)


@dataclass(frozen=True)
class LineForce(LineLoad):
    """A dead force along a rod, per unit of reference length.

    Args:
        rod: the rod.
        force: N/m, inertial: three numbers, a function of time, or `Along`, `AlongTable`, `AlongPieces` where it
            changes along the rod.
        permanent: whether it is applied in full, before all loads that the load factor multiplies.

    Raises:
        SceneError: not a rod, or not three finite numbers nor a function.
    """

    rod: RodOrName
    force: Annotated[NumbersInTime | FunctionAlong, VectorInTime(Several("force per length"), (FunctionAlong,))]
    jumps: Numbers = ()
    permanent: bool = False

    work, _vector, _unit = "force", "force", "N/m"


@dataclass(frozen=True)
class LineMoment(LineLoad):
    """A dead moment along a rod, per unit of reference length.

    Args:
        rod: the rod.
        moment: N m/m, inertial; given as the force of a `LineForce`.
        permanent: whether it is applied in full, before all loads that the load factor multiplies.

    Raises:
        SceneError: not a rod, or not three finite numbers nor a function.
    """

    rod: RodOrName
    moment: Annotated[NumbersInTime | FunctionAlong, VectorInTime(Several(unit="N m/m"), (FunctionAlong,))]
    jumps: Numbers = ()
    permanent: bool = False

    work, _vector, _unit = "moment", "moment", "N m/m"
