"""What is done with a string: which way it slips along the wall, and what acts on its lower end.

(c, e) = (V, omega R)/sqrt(V^2 + (omega R)^2), V upwards, R the contact radius: c is the part of the friction that acts
along the string (+1 where it moves up), e the part that acts around it.
"""

import math
from dataclasses import dataclass
from typing import ClassVar

from cosserat_fenicsx import units
from cosserat_fenicsx.checks import number, positive, store, warn

# Weights (N) and torques (N m) on bit below these are numbers in other units by all appearance.
_HARDLY = {"weight": 500.0, "torque": 50.0}
# Revolutions per minute below this are rad/s by all appearance: 80 rev/min are 8.4 rad/s.
_SLOW = 20.0


class Operation:
    """Base: a name, and the signs of (c, e)."""

    name: ClassVar[str] = ""
    slip: ClassVar[tuple[float, float]] = (0.0, 0.0)

    def __post_init__(self):
        for field, unit in (("weight", "N"), ("torque", "N m")):
            value = number(self, field, getattr(self, field), f"a number ({unit})", math.isfinite)
            store(self, **{field: value})
            if 0 < abs(value) < _HARDLY[field]:
                warn(
                    f"{type(self).__name__}.{field} = {value:g} {unit} is hardly a {field} on bit: 25 kN are 25e3, 25 "
                    "klbf 25 * units.kip; 5 kN m are 5e3, 4000 ft-lbf 4000 * units.ft_lbf"
                )

    def direction(self, radius):
        """(c, e) for a contact radius (m)."""
        return self.slip


@dataclass(frozen=True)
class _Plain(Operation):
    """Base of operations without speeds.

    Args:
        weight: on bit, N: the thrust in the string at its lower end; below 0 a pull (overpull, a stuck tool).
        torque: on bit, N m, against the rotation.

    Raises:
        SceneError: numbers that are not finite.
    """

    weight: float = 0.0
    torque: float = 0.0


@dataclass(frozen=True)
class TripOut(_Plain):
    """Pulled out without rotation."""

    name, slip = "trip out", (1.0, 0.0)


@dataclass(frozen=True)
class TripIn(_Plain):
    """Run in without rotation."""

    name, slip = "trip in", (-1.0, 0.0)


@dataclass(frozen=True)
class RotateOffBottom(_Plain):
    """Rotated without axial motion, the bit free."""

    name, slip = "rotate off bottom", (0.0, 1.0)


@dataclass(frozen=True)
class RotaryDrilling(Operation):
    """Drilling with the string rotating; its axial speed is negligible.

    Args:
        weight: on bit, N. torque: on bit, N m.

    Raises:
        SceneError: numbers that are not finite.
    """

    weight: float
    torque: float

    name, slip = "rotary drilling", (0.0, 1.0)


@dataclass(frozen=True)
class Sliding(Operation):
    """Drilling with a motor, the string sliding down without rotation.

    Args:
        weight: on bit, N.
        torque: of the motor's reaction, N m, twisting the string all the way up.

    Raises:
        SceneError: numbers that are not finite.
    """

    weight: float
    torque: float = 0.0

    name, slip = "sliding", (-1.0, 0.0)


@dataclass(frozen=True)
class _Reaming(Operation):
    """Base of moving along the hole while rotating.

    Args:
        speed: along the hole, m/s, positive. rpm: revolutions per minute, positive; below 20, which look like rad/s,
            a `SceneWarning` says so.
        weight, torque: on bit, N and N m.
    """

    speed: float
    rpm: float
    weight: float = 0.0
    torque: float = 0.0

    def __post_init__(self):
        super().__post_init__()
        store(self, speed=positive(self, "speed", self.speed, "m/s"), rpm=positive(self, "rpm", self.rpm, "1/min"))
        if self.rpm < _SLOW:
            warn(
                f"{type(self).__name__}.rpm = {self.rpm:g} 1/min is hardly a rotation: it is in revolutions a minute, "
                "not in rad/s; 80 rev/min are 80, not 80 * units.rpm. "
                f"{self.rpm:g} rad/s are {self.rpm / units.rpm:g}"
            )

    def direction(self, radius):
        """(c, e) for a contact radius (m)."""
        up, around = self.slip[0] * self.speed, self.rpm * units.rpm * radius
        size = math.hypot(up, around)
        return up / size, around / size


@dataclass(frozen=True)
class Ream(_Reaming):
    __doc__ = f"Moving down while rotating.\n{(_Reaming.__doc__ or '').partition(chr(10))[2]}"

    name, slip = "ream", (-1.0, 1.0)


@dataclass(frozen=True)
class BackReam(_Reaming):
    __doc__ = f"Moving up while rotating.\n{(_Reaming.__doc__ or '').partition(chr(10))[2]}"

    name, slip = "back ream", (1.0, 1.0)


@dataclass(frozen=True)
class Static(_Plain):
    """Held at rest. Friction at rest depends on what was done before; it is left out."""

    name = "static"


#: The operations, for scene files.
OPERATIONS = (TripOut, TripIn, RotateOffBottom, RotaryDrilling, Sliding, Ream, BackReam, Static)
