"""Laws of the bit over its speed or its rate of penetration that are curves: a table, a rational one, a straight line.

A torque that drops at once when the bit leaves rest, Karnopp's law with a band that vanishes, is
`Stribeck(static, dynamic)` without a speed: models hold a bit at rest by its balance, and need no band of slow speeds.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from scipy.interpolate import PchipInterpolator

from cosserat_fenicsx.checks import finite_array, number, refuse
from cosserat_fenicsx.drilling.bit_laws import BitLaw, EndCondition, EndForce
from cosserat_fenicsx.drilling.laws import Resistance
from cosserat_fenicsx.parts import AngularVelocity, Number, Torque, Values, at_least, positive


@dataclass(frozen=True)
class TableLaw(BitLaw):
    """A torque on bit from a table, by monotone cubics between its points, constant beyond the last one.

    Args:
        speeds: ascending from 0 on, rad/s. torques: one for each, N m, not negative; the first one holds at rest.

    Raises:
        SceneError: speeds that fall or do not begin at 0, negative torques, none that holds at rest.
    """

    speeds: Annotated[tuple[float, ...], Values(Number("angular velocity", at_least(0)))]
    torques: Annotated[tuple[float, ...], Values(Number("moment", at_least(0)))]

    def validate(self):
        speeds = finite_array(self, "speeds", self.speeds, "speeds (rad/s)")
        if len(speeds) < 2 or speeds[0] != 0 or not (np.diff(speeds) > 0).all():
            refuse(self, "speeds", self.speeds, "two speeds or more (rad/s), which begin at 0 and ascend")
        if len(self.torques) != len(speeds):
            refuse(self, "torques", self.torques, f"one (N m) for each of the {len(speeds)} speeds")
        if self.torques[0] == 0:
            refuse(self, "torques", self.torques, "the largest torque at rest (N m), above 0, first")

    @cached_property
    def _curve(self):
        return PchipInterpolator(self.speeds, self.torques)

    def torque(self, speed, weight):
        return float(self._curve(min(speed, self.speeds[-1])))


@dataclass(frozen=True)
class Rational(BitLaw):
    """Torque on bit T = 2 peak speed om/(om^2 + speed^2), smooth through zero: the bit never sticks, and may turn back.

    Args:
        peak: largest torque, N m. speed: at which the torque is largest, rad/s.

    Raises:
        SceneError: numbers that are not positive.
    """

    peak: Annotated[Torque, positive()]
    speed: Annotated[AngularVelocity, positive()]

    def torque(self, speed, weight):
        return 2 * self.peak * self.speed * speed / (speed**2 + self.speed**2)

    def resistance(self, weight):
        # steepest at sqrt(3) times the speed
        return Resistance(
            0.0, 0.0, 0.0, lambda om: self.torque(om, math.nan), self.peak / (4 * self.speed), drops=False
        )


@dataclass(frozen=True)
class RateLaw(BitLaw):
    """A bit that drills in proportion to its weight: weight on bit = resistance times rate of penetration.

    Args:
        resistance_to_rate: N s/m. friction_torque: torque on bit while it drills, N m.

    Raises:
        SceneError: a resistance that is not positive, or a negative torque.
    """

    resistance_to_rate: Annotated[float, Number("damping", positive())]
    friction_torque: Annotated[Torque, at_least(0)] = 0.0

    drills, lifts = True, "the bit drills by its weight"

    def resistance(self, weight):
        return None

    def end(self, weight, place, motion):
        return _RateEnd(self)

    def steady_forces(self, weight, motion):
        return np.array([self.resistance_to_rate * max(motion[0], 0.0), self.friction_torque])

    def rate(self, weight, turning):
        return number(self, "weight", weight, "a weight on bit (N)", math.isfinite) / self.resistance_to_rate


class _RateEnd(EndCondition):
    """The `EndCondition` of `RateLaw`; it has no memory. A bit that moves up is free."""

    def __init__(self, law):
        self._law = law

    def begin(self, model, h):
        (_, _), (down, _) = model.bit_state()
        if down < 0:
            return EndForce(np.zeros(2), np.zeros((2, 2)))
        tangent = np.array([[self._law.resistance_to_rate, 0.0], [0.0, 0.0]])
        return EndForce(np.zeros(2), tangent, self._law.friction_torque)

    def memory(self):
        return {}
