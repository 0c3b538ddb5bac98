"""Numbers that may depend on time: the speed of a drive, the speed of the hook."""

import math
import numbers

import numpy as np

from cosserat_fenicsx import units
from cosserat_fenicsx.checks import call, number, refuse, warn

# Speeds of rotation (rad/s) above this are revolutions a minute by all appearance: 300 rev/min are 31.4 rad/s.
_FAST = 32.0


def doubt_speed(owner: object, field: str, speed: float) -> None:
    """Warn of a speed of a drive (rad/s) that looks like revolutions a minute.

    Args:
        owner: whose number it is, or the name of the function.
    """
    if abs(speed) > _FAST:
        name = owner if isinstance(owner, str) else type(owner).__name__
        warn(
            f"{name}.{field} = {speed:g} rad/s are {speed / units.rpm:.0f} rev/min, faster than drives turn a string: "
            f"{speed:g} rev/min are {speed:g} * units.rpm = {speed * units.rpm:.4g} rad/s, '{speed:g} rpm' in a scene "
            "file"
        )


class ScalarSignal:
    """A number at every time (s), from a number or from a function of time.

    Attributes:
        jumps: times where it is not smooth, s; time steps end there.
        constant: whether it is a number.
    """

    def __init__(self, owner, field, value, unit):
        self._where, self.unit = f"{type(owner).__name__}.{field}", unit
        self.constant = isinstance(value, numbers.Real) and not isinstance(value, bool)
        if self.constant:
            value = number(owner, field, value, f"a finite number ({unit})", math.isfinite)
        elif not callable(value):
            refuse(owner, field, value, f"a number ({unit}) or a function of time that gives one")
        self._value, self.jumps = value, tuple(sorted(float(t) for t in getattr(value, "jumps", ())))

    def __call__(self, t: float) -> float:
        if self.constant:
            return self._value
        given = call(self._value, t, self._where, f" at t = {t:g} s")
        found = np.asarray(given, dtype=float).reshape(-1) if np.size(given) == 1 else np.array([np.nan])
        if not np.isfinite(found).all():
            refuse(self._where.split(".")[0], self._where.split(".")[1], given, f"a finite number ({self.unit}) at "
                   f"t = {t:g} s")  # fmt: skip
        return float(found[0])

    def jump(self, t: float) -> float:
        """The height of the jump at a time, from the values just before and just after it."""
        if self.constant:
            return 0.0
        near = 1e-9 * max(1.0, abs(t))
        return self(t + near) - self(t - near)
