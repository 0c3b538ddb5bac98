"""The top drive: its speed, its inertia, and how it is controlled.

A drive with the speed om and the inertia I hands the torque M down to the string; Om is the speed asked for:

    Stiff      om = Om
    PI         I om' = Kp (Om - om) + Ki int (Om - om) dt - M
    Matched    M = M0 + Z (Om - om): it swallows the waves of a string of the impedance Z
    Motor      I om' = M0 - c om - M: a torque that is given
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from cosserat_fenicsx.checks import instance, number, positive, refuse, store
from cosserat_fenicsx.drilling.signals import ScalarSignal, doubt_speed

#: Rules that choose the gains of a `PI` control, and its Kp over the impedance of the string: see `linear.tuned`.
RULES = {"SoftTorque": 1.0, "SoftSpeed": 4.0}


@dataclass(frozen=True)
class Stiff:
    """The drive turns at the speed asked for, whatever the torque."""


@dataclass(frozen=True)
class PI:
    """A proportional and integral control of the speed.

    Args:
        Kp: torque per difference of speeds, N m s/rad.
        Ki: torque per difference of angles, N m/rad; 0 for none.
        rule: name of the rule that chose the gains, "SoftTorque" or "SoftSpeed", which set it themselves; None for
            gains that were given. Controls with the same gains are equal, whatever the rule.

    Raises:
        SceneError: gains that are missing, negative or not finite, or a Kp of zero; an unknown rule.
    """

    Kp: float | None = None
    Ki: float | None = None
    rule: str | None = field(default=None, compare=False)

    def __post_init__(self):
        if self.rule is not None and not (isinstance(self.rule, str) and self.rule in RULES):
            refuse(self, "rule", self.rule, " or ".join(map(repr, RULES)) + ", or None")
        gains = "a gain: SoftTorque(pipe), SoftSpeed(string) choose them, or give Kp and Ki"
        for name, unit in (("Kp", "N m s/rad"), ("Ki", "N m/rad")):
            value = getattr(self, name)
            if value is None:
                refuse(self, name, value, f"{gains} ({unit})")
            value = number(self, name, value, f"{gains}, not negative ({unit})", lambda x: 0 <= x < math.inf)
            store(self, **{name: value})
        if self.Kp == 0:
            refuse(self, "Kp", 0.0, f"{gains}; without Kp the speed oscillates for ever")

    def __repr__(self):
        rule = f", rule={self.rule!r}" if self.rule else ""
        return f"PI(Kp={self.Kp!r}, Ki={self.Ki!r}{rule})"


@dataclass(frozen=True)
class Matched:
    """A drive that reflects no waves: M = torque + impedance (Om - om), without inertia.

    Args:
        impedance: N m s/rad; None for that of the uppermost section of the string, J sqrt(G rho).
        torque: M0, N m, that it hands down at the speed asked for.

    Raises:
        SceneError: an impedance that is not positive, or a torque that is not finite.
    """

    impedance: float | None = None
    torque: float = 0.0

    def __post_init__(self):
        if self.impedance is not None:
            store(self, impedance=positive(self, "impedance", self.impedance, "N m s/rad"))
        store(self, torque=number(self, "torque", self.torque, "a finite number (N m)", math.isfinite))


@dataclass(frozen=True)
class Motor:
    """A motor of constant torque, whatever the speed.

    Args:
        torque: N m.
        drag: c, N m s/rad, of the drive's bearings.

    Raises:
        SceneError: a torque that is not finite, or a negative drag.
    """

    torque: float
    drag: float = 0.0

    def __post_init__(self):
        store(self, torque=number(self, "torque", self.torque, "a finite number (N m)", math.isfinite))
        store(self, drag=number(self, "drag", self.drag, "a number (N m s/rad), not negative",
                                lambda x: 0 <= x < math.inf))  # fmt: skip


CONTROLS = (Stiff, PI, Matched, Motor)


@dataclass(frozen=True)
class TopDrive:
    """What turns the string.

    Args:
        speed: asked for, rad/s (`60 * units.rpm`): a number, from the start on, or a function of time, such as
            `Ramp(...)` or `Table(...)`, whose attribute `jumps` holds the times where it is not smooth. None for a
            `Motor`. Numbers above 32, at the start or at a jump, look like revolutions a minute: they are taken, with a
            warning.
        inertia: of the drive, at the string's speed, kg m^2.
        control: `Stiff()`, `PI(Kp, Ki)`, `Matched()` or `Motor(torque)`.

    Raises:
        SceneError: a control that is unknown or lacks an inertia or a speed that it needs, or a number out of range.
    """

    speed: float | Callable[[float], float] | None = None
    inertia: float = 0.0
    control: Stiff | PI | Matched | Motor = Stiff()

    def __post_init__(self):
        instance(self, "control", self.control, CONTROLS, "Stiff(), PI(Kp, Ki), Matched() or Motor(torque)")
        store(self, inertia=number(self, "inertia", self.inertia, "a number (kg m^2), not negative",
                                   lambda x: 0 <= x < math.inf))  # fmt: skip
        if isinstance(self.control, PI) and self.inertia == 0:
            refuse(self, "inertia", 0.0, "that of the drive (kg m^2), about 2000 to 4000, for a PI control")
        if isinstance(self.control, Matched) and self.inertia > 0:
            refuse(self, "inertia", self.inertia, "0: a matched drive has none, PI(Kp, Ki) is one with inertia")
        if isinstance(self.control, Motor):
            if self.speed is not None:
                refuse(self, "speed", self.speed, "None: a motor of given torque has no speed asked for")
        elif self.speed is None:
            refuse(self, "speed", None, "the speed asked for (rad/s), such as 60 * units.rpm")
        else:
            signal = self.signal()
            doubt_speed(self, "speed", max((signal(t) for t in (0.0, *signal.jumps)), key=abs))

    def signal(self) -> ScalarSignal:
        """The speed asked for at every time, rad/s."""
        return ScalarSignal(self, "speed", 0.0 if self.speed is None else self.speed, "rad/s")
