"""Operations: the direction in which a string slips along the wall, and the loads on its lower end.

(c, e) = (V, omega R)/sqrt(V^2 + (omega R)^2), V upwards, R the contact radius: c is the part of the friction that acts
along the string (+1 where it moves up), e the part that acts around it.

An operation of one's own is a frozen dataclass derived from `Operation`. Its fields are its arguments; from `weight`,
`torque` and `direction` follow the answer, and from its class name its name in tables, charts and scene files.
"""

import math
import re
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from cosserat_fenicsx import units
from cosserat_fenicsx.checks import warn
from cosserat_fenicsx.parts import ForceSize, Part, Rotation, Speed, Torque, positive

# Weights (N) and torques (N m) on bit, and hook loads (N), below these are probably in other units.
_DOUBTFUL = {"weight": (500.0, "N"), "torque": (50.0, "N m"), "hook load": (5000.0, "N")}
# Revolutions per minute below this are probably rad/s: 80 rev/min are 8.4 rad/s.
_SLOW = 20.0
# Torques (N m) above this break any drill pipe: the largest ones yield at 200 kN m.
_STRONGEST = 5e5
# Speeds of the block (m/s) above this are probably in other units: strings are run at up to 2 m/s.
_FASTEST_BLOCK = 5.0


def doubt_load(called, value, what, more="", of="bit"):
    """Warn of a "weight" or "torque" on bit (N, N m), or of the drive, or a "hook load" of a string, that is probably
    in another unit; `called`: its name in the warning, which ends with `more`."""
    least, unit = _DOUBTFUL[what]
    if 0 < abs(value) < least:
        place = "on bit" if of == "bit" else f"of a {of}"
        such = "5 kN m are 5e3 or '5 kN m', 4000 ft-lbf" if what == "torque" else "25 kN are 25e3 or '25 kN', 25 klbf"
        text = "'4000 ft-lbf'" if what == "torque" else "'25 klbf'"
        warn(f"{called} = {value:g} {unit} is hardly a {what} {place}: {such} {text}{more}")


def doubt_block_speed(owner: object, field: str, speed: float) -> None:
    """Warn of a speed of the block (m/s) that looks like metres an hour, or feet a minute."""
    if abs(speed) > _FASTEST_BLOCK:
        warn(
            f"{type(owner).__name__}.{field} = {speed:g} m/s is faster than blocks move: {speed:g} m/h are "
            f"{speed:g} / 3600 = {speed / 3600:.3g} m/s, '{speed:g} m/h' in a scene file; {speed:g} ft/min are "
            f"{speed * units.foot / 60:.3g} m/s"
        )


class Operation(Part, family="operation"):
    """Base of operations with a string.

    Attributes:
        name: in tables and charts: the class name as words, such as "trip out".
        slip: the signs of (c, e).
        pressed: the sign of its weight on bit, of which another one is asked about; 0 for any.
        weight: on bit, N: the thrust in the string at its lower end; below 0 a pull (overpull, a stuck tool).
        torque: on bit, N m, against the rotation.
    """

    name: ClassVar[str] = ""
    slip: ClassVar[tuple[float, float]] = (0.0, 0.0)
    pressed: ClassVar[int] = 0

    weight = torque = 0.0

    def __init_subclass__(cls, **more):
        super().__init_subclass__(**more)
        cls.name = re.sub(r"(?<=.)([A-Z])", r" \1", cls.__name__).lower()

    def validate(self):
        """Warn of a weight or a torque on bit that probably has another unit or the other sign."""
        called = type(self).__name__
        for name in ("weight", "torque"):
            doubt_load(f"{called}.{name}", getattr(self, name), name)
        if self.pressed * self.weight < 0:
            does, way = (("drills", "positive") if self.pressed > 0 else ("moves up", "negative, a pull"))
            warn(f"{called}.weight = {self.weight:g} N has the other sign than that of a string that {does}: weight "
                 f"on bit is positive where the string presses on the bottom; expected it {way}, or 0")  # fmt: skip
        if self.torque < 0:
            warn(f"{called}.torque = {self.torque:g} N m drives the string: what is against the rotation, and the "
                 "reaction of a motor, are positive")  # fmt: skip
        if abs(self.torque) > _STRONGEST:
            warn(f"{called}.torque = {self.torque:g} N m is more than any drill pipe carries, {_STRONGEST:g} N m: 4000 "
                 "ft-lbf are '4000 ft-lbf', 4 kN m are '4 kN m'")  # fmt: skip

    def direction(self, radius: float) -> tuple[float, float]:
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

    weight: ForceSize = 0.0
    torque: Torque = 0.0


@dataclass(frozen=True)
class TripOut(_Plain):
    """Pulled out without rotation."""

    slip, pressed = (1.0, 0.0), -1


@dataclass(frozen=True)
class TripIn(_Plain):
    """Run in without rotation."""

    slip = (-1.0, 0.0)


@dataclass(frozen=True)
class RotateOffBottom(_Plain):
    """Rotated without axial motion, the bit free."""

    slip = (0.0, 1.0)


@dataclass(frozen=True)
class RotaryDrilling(Operation):
    """Drilling with the string rotating; its axial speed is negligible.

    Args:
        weight: on bit, N. torque: on bit, N m.

    Raises:
        SceneError: numbers that are not finite.
    """

    weight: ForceSize = field()
    torque: Torque = field()

    slip, pressed = (0.0, 1.0), 1


@dataclass(frozen=True)
class Sliding(Operation):
    """Drilling with a motor, the string sliding down without rotation.

    Args:
        weight: on bit, N.
        torque: of the motor's reaction, N m, twisting the string all the way up.

    Raises:
        SceneError: numbers that are not finite.
    """

    weight: ForceSize = field()
    torque: Torque = 0.0

    slip, pressed = (-1.0, 0.0), 1


@dataclass(frozen=True)
class _Reaming(Operation):
    """Base of moving along the hole while rotating.

    Args:
        speed: along the hole, m/s, positive. rpm: revolutions per minute, positive; below 20, which look like rad/s,
            a `SceneWarning` says so.
        weight, torque: on bit, N and N m.
    """

    speed: Annotated[Speed, positive()]
    rpm: Rotation
    weight: ForceSize = 0.0
    torque: Torque = 0.0

    def validate(self):
        super().validate()
        doubt_block_speed(self, "speed", self.speed)
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

    slip = (-1.0, 1.0)


@dataclass(frozen=True)
class BackReam(_Reaming):
    __doc__ = f"Moving up while rotating.\n{(_Reaming.__doc__ or '').partition(chr(10))[2]}"

    slip = (1.0, 1.0)


@dataclass(frozen=True)
class Static(_Plain):
    """Held at rest. Friction at rest depends on what was done before; it is left out."""
