"""Laws of the bit over its speed or its rate of penetration: a table, a rational curve, a drop, a straight line.

Models hold a bit at rest by its balance, and need no band of slow speeds: `Karnopp` is the drop at once that
`Stribeck(static, dynamic)` without a speed is, too.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from scipy.interpolate import PchipInterpolator

from cosserat_fenicsx.checks import finite_array, number, refuse
from cosserat_fenicsx.drilling.bit_laws import BitLaw, EndCondition, EndForce
from cosserat_fenicsx.drilling.laws import Resistance, Surface
from cosserat_fenicsx.parts import AngularVelocity, Number, Torque, Values, at_least, positive


class _Rows(Values):
    """A list of numbers, or of such lists."""

    def check(self, owner, field, value):
        if isinstance(value, list | tuple | np.ndarray) and len(value) and np.ndim(value[0]):
            return tuple(super(_Rows, self).check(owner, f"{field}[{i}]", row) for i, row in enumerate(value))
        return super().check(owner, field, value)

    def read(self, where, data, reading):
        return data

    def write(self, value, writing):
        return [super(_Rows, self).write(x, writing) if isinstance(x, tuple) else x for x in value]

    def schema(self, definitions):
        row = super().schema(definitions)
        return {"anyOf": [row, {"type": "array", "items": row}]}


@dataclass(frozen=True)
class TableLaw(BitLaw):
    """A torque on bit from a table, by monotone cubics over the speed, and over the weight,
    between its points, constant beyond the last speed.

    Args:
        speeds: ascending from 0 on, rad/s. torques: one for each, N m, not negative; the first one holds at rest. With
            weights a row of them for each weight.
        weights: on bit, ascending from 0 on, N; None for a torque that does not follow the weight.

    Raises:
        SceneError: speeds or weights that fall or do not begin at 0, negative torques, none that holds at rest; in a
            motion a weight on bit above the last one.
    """

    speeds: Annotated[tuple[float, ...], Values(Number("angular velocity", at_least(0)))]
    torques: Annotated[tuple, _Rows(Number("moment", at_least(0)))]
    weights: Annotated[tuple[float, ...], Values(Number("force", at_least(0)))] | None = None

    def validate(self):
        for name, unit in (("speeds", "rad/s"), ("weights", "N")):
            if (given := getattr(self, name)) is None:
                continue
            axis = finite_array(self, name, given, f"{name} ({unit})")
            if len(axis) < 2 or axis[0] != 0 or not (np.diff(axis) > 0).all():
                refuse(self, name, given, f"two {name} or more ({unit}), which begin at 0 and ascend")
        speeds, rows = len(self.speeds), self.torques if self.weights else (self.torques,)
        if any(np.ndim(row) != 1 or len(row) != speeds for row in rows) or len(rows) != len(self.weights or [0.0]):
            rows = f", in a row for each of the {len(self.weights)} weights" if self.weights else ""
            refuse(self, "torques", self.torques, f"one (N m) for each of the {speeds} speeds{rows}")
        if rows[-1][0] == 0:
            refuse(self, "torques", self.torques, "the largest torque at rest (N m), above 0, first")

    @property
    def needs_weight(self):
        return self.weights is not None

    @cached_property
    def _surface(self):
        loads = np.array(self.weights or [0.0])
        values = np.reshape(self.torques, (len(loads), len(self.speeds))).T
        rise = PchipInterpolator(loads, values, axis=1).derivative()(loads) if self.weights else np.zeros_like(values)
        splines = (PchipInterpolator(self.speeds, x) for x in (values, rise))
        return Surface(loads, *splines, np.array([values[0], rise[0]]))

    def torque(self, speed, weight):
        if self.weights and weight > self.weights[-1] * (1 + 1e-9):  # more than rounding
            refuse(self, "weights", self.weights, f"weights up to {weight:.6g} N at least, which the bit bears")
        return self._surface(speed, weight)

    def in_c(self, weight):
        return super().in_c(None)[0] if self.weights else None, self._surface


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


# The widest band of `Karnopp`, rad/s.
_BAND = 0.01


@dataclass(frozen=True)
class Karnopp(BitLaw):
    """Torque on bit by Karnopp: dynamic while it turns, anything up to static at rest.

    Programs with this law take speeds within a band for rest. Models of strings need none, and have the drop at once
    that the law is in the limit of a narrow band.

    Args:
        static, dynamic: N m. band: half its width, rad/s, at most 0.01: it has no further effect.

    Raises:
        SceneError: negative numbers, a static torque below the dynamic one, or a wider band.
    """

    static: Annotated[Torque, at_least(0)]
    dynamic: Annotated[Torque, at_least(0)]
    band: Annotated[AngularVelocity, at_least(0)] = 0.0

    def validate(self):
        if self.static < self.dynamic:
            refuse(self, "static", self.static, f"at least the dynamic one, {self.dynamic:g}")
        if self.band > _BAND:
            refuse(self, "band", self.band, f"at most {_BAND:g} rad/s, the limit of a narrow band; for a static torque "
                   "that fades over a range of speeds Stribeck(static, dynamic, speed)")  # fmt: skip

    def torque(self, speed, weight):
        return self.dynamic if speed > 0 else self.static

    def resistance(self, weight):
        return Resistance(self.static, self.dynamic)


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
    """The `EndCondition` of `RateLaw`: free after it moved up in the last step, by the mean velocity there."""

    def __init__(self, law):
        self._law, self._down, self._at = law, 0.0, 0.0

    def begin(self, model, h):
        self._at = float(model.bit_state()[0, 0])
        if self._down < 0:
            return EndForce(np.zeros(2), np.zeros((2, 2)))
        tangent = np.array([[self._law.resistance_to_rate, 0.0], [0.0, 0.0]])
        return EndForce(np.zeros(2), tangent, self._law.friction_torque)

    def commit(self, model, h):
        self._down = (float(model.bit_state()[0, 0]) - self._at) / h

    def memory(self):
        return {"down": self._down}

    def recall(self, memory):
        self._down = float(memory["down"])
