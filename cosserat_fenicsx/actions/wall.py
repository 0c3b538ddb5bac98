"""The wall of a straight hole, without friction."""

from dataclasses import dataclass

import numpy as np
import ufl

from cosserat_fenicsx.annotations import Numbers
from cosserat_fenicsx.checks import direction, positive, store, vector
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene import action
from cosserat_fenicsx.scene.action import LineAction
from cosserat_fenicsx.scene.rod import Rod, RodOrName, is_known

# Places along a rod, and share of its length by which it may lie outside the clearance at rest, for rounding.
_SAMPLES, _OUTSIDE = 257, 1e-9
# Distances from the axis below this fraction of the clearance are replaced by it: the radial direction is undefined on
# the axis, and there is no contact there.
_ON_AXIS = 1e-6


@dataclass(frozen=True)
class Wall(LineAction):
    """A frictionless cylindrical wall that confines a rod's centreline by a penalty: a force kp max(rho - clearance, 0)
    per unit of reference length towards the straight axis, rho the distance from it.

    It is integrated with the nodes as quadrature points, which resolves contact pressures best. It is not multiplied by
    the load factor. The pressure has a kink where contact begins: meshes that `solve` refines have element ends there,
    for up to a dozen places in all points of a path; more of them take many elements. A softer wall is easier to solve.

    Args:
        rod: the rod.
        point: a point of the axis, m, inertial; direction: that of the axis.
        clearance: radius of the hole minus that of the rod, m.
        stiffness: kp, N/m^2. The penetration is the force per unit length over kp; rock and steel have 1e9 and more.

    Raises:
        SceneError: not a rod, no direction, numbers that are not positive, or a rod that lies outside the wall at rest.
    """

    rod: RodOrName
    point: Numbers
    direction: Numbers
    clearance: float
    stiffness: float = 1e9

    scaled, at_nodes, presses = False, True, True

    def __post_init__(self):
        store(
            self, point=vector(self, "point", self.point, "m"), direction=direction(self, "direction", self.direction)
        )
        store(self, clearance=positive(self, "clearance", self.clearance, "m"))
        store(self, stiffness=positive(self, "stiffness", self.stiffness, "N/m^2"))
        if is_known(self, "rod", Rod):
            self._check_inside()

    def _check_inside(self):
        s = np.linspace(0.0, self.rod.length, _SAMPLES)
        away = self.rod.curve.position(s) - self.point
        rho = np.linalg.norm(away - np.outer(away @ self.direction, self.direction), axis=1)
        worst = int(np.argmax(rho))
        if rho[worst] > self.clearance + _OUTSIDE * self.rod.length:
            raise SceneError(
                f"Wall: rod '{self.rod.name}' lies outside it at rest, at s = {s[worst]:.6g} m by "
                f"{rho[worst] - self.clearance:.4g} m: expected a point and a direction of the axis, and a clearance, "
                "such that all of the rod is inside"
            )

    def data(self, rod, s):
        """See `Action`."""
        axis = action.vector(self.point, "m from origin"), action.vector(self.direction, "1")
        return (*axis, action.scalar(self.clearance, "m"), action.scalar(self.stiffness, "N/m^2"))

    def holds(self, scene):
        """See `Action`: it confines the rod across the axis."""
        across = np.linalg.svd(np.array([self.direction]))[2][1:]
        return [(station, np.r_[row, 0, 0, 0]) for station in (self.rod.start, self.rod.end) for row in across]

    @staticmethod
    def work(point, test, a, t, clearance, kp):
        """See `Action`."""
        d = point.r - a
        away = d - ufl.dot(d, t) * t
        rho = ufl.sqrt(ufl.max_value(ufl.dot(away, away), (_ON_AXIS * clearance) ** 2))
        pressure = kp * ufl.max_value(rho - clearance, 0)
        return -pressure / rho * ufl.dot(away, test.phi_r)
