"""An elastic foundation along a rod."""

from dataclasses import dataclass

import ufl

from cosserat_fenicsx.actions.directed import Directed
from cosserat_fenicsx.annotations import Numbers
from cosserat_fenicsx.checks import positive, store
from cosserat_fenicsx.scene.action import LineAction, scalar
from cosserat_fenicsx.scene.rod import Rod, RodOrName, is_known


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
    stiffness: float
    direction: Numbers | None = None

    scaled = False

    @property
    def works(self):
        """See `Directed`."""
        return alike, along

    def __post_init__(self):
        is_known(self, "rod", Rod)
        store(self, stiffness=positive(self, "stiffness", self.stiffness, "N/m^2"))
        self._store_direction()

    def data(self, rod, s):
        """See `Action`."""
        return self._with_direction(scalar(self.stiffness, "N/m^2"))

    def holds(self, scene):
        """See `Action`."""
        return [(self.rod.at(share * self.rod.length), row) for share in (0.0, 0.5, 1.0) for row in self._held()]


def alike(point, test, k):
    """Virtual work of -k u."""
    return -k * ufl.dot(point.u, test.phi_r)


def along(point, test, k, n):
    """Virtual work of -k (u.n) n."""
    return -k * ufl.dot(point.u, n) * ufl.dot(n, test.phi_r)
