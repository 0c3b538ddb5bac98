"""A fluid around rods: its drag, and the mass that moves with them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import ufl

from cosserat_fenicsx.actions.springs import require_one
from cosserat_fenicsx.checks import Numbers, number, positive, refuse, store
from cosserat_fenicsx.parts import DampingPerLength, FunctionAlong, QuadraticDrag, Several
from cosserat_fenicsx.scene import action
from cosserat_fenicsx.scene.action import LineAction, scalar
from cosserat_fenicsx.scene.loads import AlongRod, Load
from cosserat_fenicsx.scene.profiles import checked_pieces, piece_at
from cosserat_fenicsx.scene.rod import Rod, RodOrName
from cosserat_fenicsx.scene.signals import VectorInTime, values_of


@dataclass(frozen=True)
class AddedMass(LineAction):
    """Mass per unit of reference length that moves with the axis of a rod, in motions and natural modes: of the fluid
    around it and inside it.

    It has no weight (buoyancy carries it), no rotational inertia and no unbalance: its centre is on the axis also where
    the rod is eccentric. By default it does not move along the tangent that the rod has at rest. This suits
    rods that stay near their line at rest, such as in a hole; other rods need `axial=True`. (Only then is the angular
    momentum of a free motion constant.)

    Args:
        rod: the rod.
        mass: kg/m; of a round rod of diameter D across its axis C_a rho pi D^2/4, with C_a = 1 far from walls; or
            pieces (s_end, kg/m), the last to the rod's length or None for it.
        axial: whether it moves in all directions.

    Raises:
        SceneError: not a rod, a mass that is not positive (of a piece: negative), or pieces that do not ascend to the
            rod's length.
    """

    rod: RodOrName
    mass: float | Sequence[tuple[float | None, float]]
    axial: bool = False

    work, scaled = None, False

    def validate(self):
        if not isinstance(self.mass, list | tuple):
            store(self, mass=positive(self, "mass", self.mass, "kg/m"))
            return
        if not self.mass:
            refuse(self, "mass", self.mass, "at least one piece (s_end, kg/m)")
        if isinstance(self.rod, Rod):  # `Scene` looks a name up, and makes it again
            pieces = checked_pieces("AddedMass", "mass", self.mass, self.rod.length, "kg/m")
            store(self, mass=tuple((s, self._checked(i, mass)) for i, (s, mass) in enumerate(pieces)))

    def _checked(self, i, mass):
        return number(self, f"mass[{i}]", mass, "a mass from 0 on (kg/m)", lambda x: 0 <= x < np.inf)

    @property
    def lateral(self):
        return not self.axial

    def breaks(self, rod):
        return tuple(s for s, _ in self._pieces[:-1])

    def added_mass(self, rod, s, side):
        ends, masses = zip(*self._pieces, strict=True)
        across = np.array(masses)[piece_at(ends[:-1], s, side, rod.length)]
        return across, across if self.axial else np.zeros_like(across)

    @property
    def _pieces(self):
        return self.mass if isinstance(self.mass, tuple) else ((self.rod.length, self.mass),)


# |w| is replaced by this constant at smaller speeds (in units of speed), so that it is differentiable at w = 0.
_STILL = 1e-12
_Current = Annotated[Numbers | FunctionAlong, VectorInTime(Several("speed"), (FunctionAlong,), functions=False)]


@dataclass(frozen=True)
class Drag(Load, AlongRod, LineAction):
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
    normal: QuadraticDrag
    tangential: QuadraticDrag = 0.0
    current: _Current = (0.0, 0.0, 0.0)
    permanent: bool = False

    jumps, follows, _vector = (), True, "current"

    def validate(self):
        require_one(self, ("normal", "tangential"), "a coefficient (N s^2/m^3)")

    def data(self, rod, s):
        coefficients = (action.scalar(c, "N s^2/m^3") for c in (self.normal, self.tangential))
        return (*coefficients, action.vector(values_of(self.current, s), "m/s"))

    @staticmethod
    def work(point, test, c_n, c_t, current):
        w, d3 = point.r_t - current, point.directors[:, 2]
        along = ufl.dot(w, d3) * d3
        across = w - along

        def size(a):
            return ufl.sqrt(ufl.max_value(ufl.dot(a, a), _STILL**2))

        return -ufl.dot(c_n * size(across) * across + c_t * size(along) * along, test.phi_r)


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
    normal: DampingPerLength
    tangential: DampingPerLength = 0.0

    scaled = False

    def validate(self):
        require_one(self, ("normal", "tangential"), "a coefficient (N s/m^2)")

    def data(self, rod, s):
        return scalar(self.normal, "N s/m^2"), scalar(self.tangential, "N s/m^2")

    @staticmethod
    def work(point, test, c_n, c_t):
        v, d3 = point.r_t, point.directors[:, 2]
        along = ufl.dot(v, d3) * d3
        return -ufl.dot(c_n * (v - along) + c_t * along, test.phi_r)
