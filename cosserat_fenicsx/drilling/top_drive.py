"""The top drive: its speed, its inertia, and how it is controlled.

A drive with the speed om and the inertia I hands the torque M down to the string; Om is the speed asked for:

    Stiff      om = Om
    PI         I om' = Kp (Om - om) + Ki int (Om - om) dt - M
    Matched    M = M0 + Z (Om - om): it swallows the waves of a string of the impedance Z
    Motor      I om' = M0 - c om - M: a torque that is given
"""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.signals import ScalarSignal, doubt_speed
from cosserat_fenicsx.parts import (
    AngularVelocity,
    Inertia,
    InTime,
    Number,
    Part,
    Torque,
    TorsionalDamping,
    at_least,
    positive,
)

#: Rules that choose the gains of a `PI` control, and its Kp over the impedance of the string: see `linear.tuned`.
RULES = {"SoftTorque": 1.0, "SoftSpeed": 4.0}


_GAINS = "a gain: SoftTorque(pipe), SoftSpeed(string) choose them, or give Kp and Ki"


class DriveControl(Part, family="control of a drive"):
    """Base of the controls of a top drive."""


@dataclass(frozen=True)
class Stiff(DriveControl):
    """The drive turns at the speed asked for, whatever the torque."""


@dataclass(frozen=True)
class PI(DriveControl):
    """A proportional and integral control of the speed.

    Args:
        Kp: torque per difference of speeds, N m s/rad.
        Ki: torque per difference of angles, N m/rad; 0 for none.
        rule: name of the rule that chose the gains, "SoftTorque" or "SoftSpeed", which set it themselves; None for
            gains that were given. Controls with the same gains are equal, whatever the rule.

    Raises:
        SceneError: gains that are missing, negative or not finite, or a Kp of zero; an unknown rule.
    """

    Kp: Annotated[float, Number("torsional damping", at_least(0, _GAINS))] | None = None
    Ki: Annotated[float, Number("torsional stiffness", at_least(0, _GAINS))] | None = None
    rule: Literal["SoftTorque", "SoftSpeed"] | None = field(default=None, compare=False)

    def validate(self):
        """See `Part`."""
        for name, unit in (("Kp", "N m s/rad"), ("Ki", "N m/rad")):
            if getattr(self, name) is None:
                refuse(self, name, None, f"{_GAINS} ({unit})")
        if self.Kp == 0:
            refuse(self, "Kp", 0.0, f"{_GAINS}; without Kp the speed oscillates for ever")

    def __repr__(self):
        rule = f", rule={self.rule!r}" if self.rule else ""
        return f"PI(Kp={self.Kp!r}, Ki={self.Ki!r}{rule})"


@dataclass(frozen=True)
class Matched(DriveControl):
    """A drive that reflects no waves: M = torque + impedance (Om - om), without inertia.

    Args:
        impedance: N m s/rad; None for that of the uppermost section of the string, J sqrt(G rho).
        torque: M0, N m, that it hands down at the speed asked for.

    Raises:
        SceneError: an impedance that is not positive, or a torque that is not finite.
    """

    impedance: Annotated[TorsionalDamping, positive()] | None = None
    torque: Torque = 0.0


@dataclass(frozen=True)
class Motor(DriveControl):
    """A motor of constant torque, whatever the speed.

    Args:
        torque: N m.
        drag: c, N m s/rad, of the drive's bearings.

    Raises:
        SceneError: a torque that is not finite, or a negative drag.
    """

    torque: Torque
    drag: TorsionalDamping = 0.0


@dataclass(frozen=True)
class TopDrive(Part):
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

    speed: InTime[AngularVelocity] | None = None
    inertia: Inertia = 0.0
    control: DriveControl = Stiff()

    def validate(self):
        """See `Part`."""
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
