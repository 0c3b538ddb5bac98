"""Springs, elastic beds, dashpots and point masses."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import ufl

from cosserat_fenicsx.checks import Numbers, number, refuse, store
from cosserat_fenicsx.parts import (
    Damping,
    Mass,
    Stiffness,
    TorsionalDamping,
    TorsionalStiffness,
    UnitVector,
    WallStiffness,
    at_least,
    positive,
)
from cosserat_fenicsx.scene.action import LineAction, PointAction, scalar, vector
from cosserat_fenicsx.scene.rod import RodOrName, StationOrName


def require_one(action, fields, expected):
    """Refuse an action whose coefficients in these fields are all 0."""
    if not any(getattr(action, field) for field in fields):
        refuse(action, fields[0], 0.0, expected)


class Directed:
    """An action with a field `direction`: None where it resists motions in every direction, or the only one, inertial.

    Attributes:
        works: the virtual works without a direction and with one, the latter with the direction as its last datum.
    """

    @property
    def work(self):
        everywhere, directed = self.works
        return everywhere if self.direction is None else directed

    def _with_direction(self, *data):
        return data if self.direction is None else (*data, vector(self.direction, "1"))

    def _held(self):
        """The displacements that it resists: rows (6,) over (displacement, small rotation), inertial."""
        return np.eye(6)[:3] if self.direction is None else [np.r_[self.direction, 0, 0, 0]]


def alike(point, test, k):
    """Virtual work of -k u."""
    return -k * ufl.dot(point.u, test.phi_r)


def along(point, test, k, n):
    """Virtual work of -k (u.n) n."""
    return -k * ufl.dot(point.u, n) * ufl.dot(n, test.phi_r)


def _turned(point, test, c):
    return -c * ufl.dot(point.theta, test.phi)


def _sprung(point, test, k, c):
    return alike(point, test, k) + _turned(point, test, c)


def _sprung_along(point, test, k, c, n):
    return along(point, test, k, n) + _turned(point, test, c)


def _resisted(point, test, b, d):
    return -b * ufl.dot(point.r_t, test.phi_r) - d * ufl.dot(point.omega, test.phi)


def _resisted_along(point, test, b, d, n):
    return -b * ufl.dot(point.r_t, n) * ufl.dot(n, test.phi_r) - d * ufl.dot(point.omega, test.phi)


@dataclass(frozen=True)
class Foundation(Directed, LineAction):
    """An elastic (Winkler) foundation bonded to a rod: a force -k u per unit of reference length, u the displacement
    from the reference.

    It exerts no force in the reference configuration, and is not multiplied by the load factor.

    Args:
        rod: the rod.
        stiffness: k, N/m^2.
        direction: None where k resists displacements in every direction; or the only direction that it resists,
            inertial.

    Raises:
        SceneError: not a rod, a stiffness that is not positive, or no direction.
    """

    rod: RodOrName
    stiffness: WallStiffness
    direction: UnitVector | None = None

    scaled, works = False, (alike, along)

    def data(self, rod, s):
        return self._with_direction(scalar(self.stiffness, "N/m^2"))

    def holds(self, scene):
        return [(self.rod.at(share * self.rod.length), row) for share in (0.0, 0.5, 1.0) for row in self._held()]


@dataclass(frozen=True)
class Spring(Directed, PointAction):
    """A linear spring between a station and its reference position, and a rotational spring: the force -k u and the
    moment -c theta, with the displacement u and the rotation vector theta from the reference (in space below a full
    turn).

    It exerts no force in the reference configuration, and is not multiplied by the load factor.

    Args:
        station: where.
        stiffness: k, N/m; 0 for none.
        rotational: c, N m/rad, the same about every axis; 0 for none.
        direction: None where k resists displacements in every direction; or the only direction that it resists,
            inertial.

    Raises:
        SceneError: not a station, stiffnesses that are negative or both 0, or no direction.
    """

    station: StationOrName
    stiffness: Annotated[Stiffness, at_least(0)] = 0.0
    rotational: TorsionalStiffness = 0.0
    direction: UnitVector | None = None

    scaled, works = False, (_sprung, _sprung_along)

    def validate(self):
        require_one(self, ("stiffness", "rotational"), "a stiffness (N/m), or a rotational one (N m/rad)")

    def data(self, rod, s):
        return self._with_direction(scalar(self.stiffness, "N/m"), scalar(self.rotational, "N m/rad"))

    def holds(self, scene):
        rows = [*(self._held() if self.stiffness else ()), *(np.eye(6)[3:] if self.rotational else ())]
        return [(self.station, row) for row in rows]


@dataclass(frozen=True)
class Dashpot(Directed, PointAction):
    """A linear dashpot between a station and the ground: the force -b v and the moment -d omega, zero in statics.

    The energy it dissipates is counted as work of the loads in the energy balance of a motion. It is not multiplied by
    the load factor.

    Args:
        station: where.
        damping: b, N s/m; 0 for none.
        rotational: d, N m s/rad; 0 for none.
        direction: None where b resists velocities in every direction; or the only direction that it resists, inertial.

    Raises:
        SceneError: not a station, numbers that are negative or both 0, or no direction.
    """

    station: StationOrName
    damping: Damping = 0.0
    rotational: TorsionalDamping = 0.0
    direction: UnitVector | None = None

    scaled, works = False, (_resisted, _resisted_along)

    def validate(self):
        require_one(self, ("damping", "rotational"), "a damping (N s/m), or a rotational one (N m s/rad)")

    def data(self, rod, s):
        return self._with_direction(scalar(self.damping, "N s/m"), scalar(self.rotational, "N m s/rad"))


@dataclass(frozen=True)
class PointMass(PointAction):
    """A mass, and moments of inertia, at a station, in motions and natural modes; a `Weight` acts on it too.

    Args:
        station: where; the body's centre of mass lies on the centreline.
        mass: kg.
        moments: moments of inertia about d_1, d_2, d_3, kg m^2; one number for a body with the same about every axis.

    Raises:
        SceneError: not a station, or numbers that are not positive (moments: negative).
    """

    station: StationOrName
    mass: Annotated[Mass, positive()]
    moments: float | Numbers = 0.0

    work, scaled = None, False

    def validate(self):
        given = np.atleast_1d(self.moments)
        if given.shape not in ((1,), (3,)):
            refuse(self, "moments", self.moments, "one number, or three about d_1, d_2, d_3 (kg m^2)")
        moments = [
            number(self, "moments", x, "numbers from 0 on (kg m^2)", lambda x: 0 <= x < np.inf) for x in given.tolist()
        ]
        store(self, moments=tuple(moments * (3 // len(moments))))

    def inertia(self, rod):
        return self.mass, np.array(self.moments)
