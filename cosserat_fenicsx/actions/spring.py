"""Elastic supports of a station."""

from dataclasses import dataclass

import numpy as np
import ufl

from cosserat_fenicsx.actions.directed import Directed, store_coefficients
from cosserat_fenicsx.actions.foundation import alike, along
from cosserat_fenicsx.annotations import Numbers
from cosserat_fenicsx.scene.action import PointAction, scalar
from cosserat_fenicsx.scene.rod import Station, StationOrName, is_known


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
    stiffness: float = 0.0
    rotational: float = 0.0
    direction: Numbers | None = None

    scaled = False

    @property
    def works(self):
        """See `Directed`."""
        return _alike, _along

    def __post_init__(self):
        is_known(self, "station", Station)
        units = {"stiffness": "N/m", "rotational": "N m/rad"}
        store_coefficients(self, units, "a stiffness (N/m), or a rotational one (N m/rad)")
        self._store_direction()

    def data(self, rod, s):
        """See `Action`."""
        return self._with_direction(scalar(self.stiffness, "N/m"), scalar(self.rotational, "N m/rad"))

    def holds(self, scene):
        """See `Action`."""
        rows = [*(self._held() if self.stiffness else ()), *(np.eye(6)[3:] if self.rotational else ())]
        return [(self.station, row) for row in rows]


def _turned(point, test, c):
    return -c * ufl.dot(point.theta, test.phi)


def _alike(point, test, k, c):
    return alike(point, test, k) + _turned(point, test, c)


def _along(point, test, k, c, n):
    return along(point, test, k, n) + _turned(point, test, c)
