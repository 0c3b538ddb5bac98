"""The drag of a fluid."""

from dataclasses import dataclass

import ufl

from cosserat_fenicsx.actions.directed import store_coefficients
from cosserat_fenicsx.annotations import Numbers
from cosserat_fenicsx.checks import store, vector
from cosserat_fenicsx.scene import action
from cosserat_fenicsx.scene.action import LineAction
from cosserat_fenicsx.scene.along import FunctionAlong, along_or_vector, breaks_of, kinks_of, values_of
from cosserat_fenicsx.scene.loads import Load
from cosserat_fenicsx.scene.rod import Rod, RodOrName, is_known

# |w| is replaced by this constant at smaller speeds (in units of speed), so that it is differentiable at w = 0.
_STILL = 1e-12


@dataclass(frozen=True)
class Drag(Load, LineAction):
    """Quadratic drag of a fluid per unit of reference length: ``-c_n |w_n| w_n - c_t |w_t| w_t``.

    w is the velocity of the rod relative to the fluid, w_t its part along the tangent and w_n that across it (Morison's
    equation, independence principle).

    In a current it also acts on a rod at rest. Like a load it is multiplied by the load factor, unless it is
    `permanent`. The energy it dissipates is counted as work of the loads in the energy balance of a motion.

    Args:
        rod: the rod.
        normal: c_n = density C_D diameter/2, N s^2/m^3.
        tangential: c_t, likewise.
        current: velocity of the fluid, m/s, inertial: three numbers, or `Along`, `AlongTable`, `AlongPieces`.
        permanent: whether it acts in full, not multiplied by the load factor.

    Raises:
        SceneError: not a rod, negative coefficients or both 0, or a current that is no velocity.
    """

    rod: RodOrName
    normal: float
    tangential: float = 0.0
    current: Numbers | FunctionAlong = (0.0, 0.0, 0.0)
    permanent: bool = False

    jumps, follows = (), True

    def __post_init__(self):
        is_known(self, "rod", Rod)
        units = dict.fromkeys(("normal", "tangential"), "N s^2/m^3")
        store_coefficients(self, units, "a coefficient (N s^2/m^3)")
        if along_or_vector(self, "current", self.current, self.rod) is None:
            store(self, current=vector(self, "current", self.current, "m/s"))
        self._check_permanent()

    def data(self, rod, s):
        """See `Action`."""
        coefficients = (action.scalar(c, "N s^2/m^3") for c in (self.normal, self.tangential))
        return (*coefficients, action.vector(values_of(self.current, s), "m/s"))

    def breaks(self, rod):
        """See `Action`."""
        return breaks_of(self.current)

    def kinks(self, rod):
        """See `Action`."""
        return kinks_of(self.current)

    @staticmethod
    def work(point, test, c_n, c_t, current):
        """See `Action`."""
        w, d3 = point.r_t - current, point.directors[:, 2]
        along = ufl.dot(w, d3) * d3
        across = w - along

        def size(a):
            return ufl.sqrt(ufl.max_value(ufl.dot(a, a), _STILL**2))

        return -ufl.dot(c_n * size(across) * across + c_t * size(along) * along, test.phi_r)
