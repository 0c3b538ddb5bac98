"""The viscous resistance of a fluid."""

from dataclasses import dataclass

import ufl

from cosserat_fenicsx.actions.directed import store_coefficients
from cosserat_fenicsx.scene.action import LineAction, scalar
from cosserat_fenicsx.scene.rod import Rod, RodOrName, is_known


@dataclass(frozen=True)
class LinearDrag(LineAction):
    """Linear drag of a fluid at rest on the axis of a rod, per unit of reference length: ``-c_n v_n - c_t v_t``.

    v_t is the part of the velocity of the axis along the tangent, v_n that across it. It is not multiplied by the load
    factor. The energy it dissipates is counted as work of the loads in the energy balance of a motion.

    Args:
        rod: the rod.
        normal: c_n, N s/m^2.
        tangential: c_t, N s/m^2.

    Raises:
        SceneError: not a rod, or coefficients that are negative or both 0.
    """

    rod: RodOrName
    normal: float
    tangential: float = 0.0

    scaled = False

    def __post_init__(self):
        is_known(self, "rod", Rod)
        units = dict.fromkeys(("normal", "tangential"), "N s/m^2")
        store_coefficients(self, units, "a coefficient (N s/m^2)")

    def data(self, rod, s):
        """See `Action`."""
        return scalar(self.normal, "N s/m^2"), scalar(self.tangential, "N s/m^2")

    @staticmethod
    def work(point, test, c_n, c_t):
        """See `Action`."""
        v, d3 = point.r_t, point.directors[:, 2]
        along = ufl.dot(v, d3) * d3
        return -ufl.dot(c_n * (v - along) + c_t * along, test.phi_r)
