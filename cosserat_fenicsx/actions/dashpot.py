"""Viscous dampers at a station."""

from dataclasses import dataclass

import ufl

from cosserat_fenicsx.actions.directed import Directed, store_coefficients
from cosserat_fenicsx.annotations import Numbers
from cosserat_fenicsx.scene.action import PointAction, scalar
from cosserat_fenicsx.scene.rod import Station, StationOrName, is_known


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
    damping: float = 0.0
    rotational: float = 0.0
    direction: Numbers | None = None

    scaled = False

    @property
    def works(self):
        """See `Directed`."""
        return _alike, _along

    def __post_init__(self):
        is_known(self, "station", Station)
        units = {"damping": "N s/m", "rotational": "N m s/rad"}
        store_coefficients(self, units, "a damping (N s/m), or a rotational one (N m s/rad)")
        self._store_direction()

    def data(self, rod, s):
        """See `Action`."""
        return self._with_direction(scalar(self.damping, "N s/m"), scalar(self.rotational, "N m s/rad"))


def _alike(point, test, b, d):
    return -b * ufl.dot(point.r_t, test.phi_r) - d * ufl.dot(point.omega, test.phi)


def _along(point, test, b, d, n):
    return -b * ufl.dot(point.r_t, n) * ufl.dot(n, test.phi_r) - d * ufl.dot(point.omega, test.phi)
