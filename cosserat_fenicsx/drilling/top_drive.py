"""The top drive: its speed, its inertia and its control; and the hook.

A drive with the speed om and the inertia I hands the torque M down to the string; Om is the speed asked for:

    Stiff      om = Om
    PI         I om' = Kp (Om - om) + Ki int (Om - om) dt - M
    Matched    M = M0 + Z (Om - om): it absorbs the waves of a string of the impedance Z
    Motor      I om' = M0 - c om - M: a given torque

`DriveControl` is the family of controls; `SampledControl` is for those of your own, called once a sample.
"""

import math
from dataclasses import dataclass, field
from typing import Annotated, Literal, NamedTuple

import numpy as np

from cosserat_fenicsx.checks import call, finite_array, number, refuse
from cosserat_fenicsx.drilling.signals import ScalarSignal, doubt_speed
from cosserat_fenicsx.parts import (
    AngularVelocity,
    Inertia,
    InTime,
    Number,
    Part,
    Speed,
    Stiffness,
    Torque,
    TorsionalDamping,
    at_least,
    positive,
)

#: Kp over the impedance of the string by the rules for `PI` controls in `linear.frequencies`.
RULES = {"SoftTorque": 1.0, "SoftSpeed": 4.0}
_GAINS = "a gain: SoftTorque(pipe), SoftSpeed(string) choose them, or give Kp and Ki"


class Gains(NamedTuple):
    """A control as models take it: the drive turns at the speed Om asked for where it is rigid, or feels the torque
    given + Kp (Om - om) + Ki int (Om - om) dt, N m."""

    rigid: bool = False
    given: float = 0.0
    Kp: float = 0.0
    Ki: float = 0.0


class DriveControl(Part, family="control of a drive"):
    """Base of the controls of a top drive.

    Attributes:
        sampled: whether it is a `SampledControl`, called once a sample; the gains of others say all.
    """

    sampled = False
    # In words, a control that needs a drive with an inertia.
    _needs_inertia = ""

    def gains(self, impedance: float | None) -> Gains:
        """The control's `Gains` above a string of the impedance (N m s/rad) of its uppermost section, None for discs.

        Raises:
            SceneError: a control that has none, or needs an impedance.
        """
        raise NotImplementedError(f"{type(self).__name__}.gains(impedance) is missing")

    def check(self, drive: "TopDrive") -> None:
        """Refuse a drive that does not fit the control: by default one without a speed.

        Raises:
            SceneError: so it is.
        """
        if self._needs_inertia and drive.inertia == 0:
            refuse(drive, "inertia", 0.0, f"the drive's own (kg m^2), about 2000 to 4000, for {self._needs_inertia}")
        if drive.speed is None and not self.sampled:
            refuse(drive, "speed", None, "the speed asked for (rad/s), such as 60 * units.rpm")


class SampledControl(DriveControl):
    """Base of controls of your own that are called once a sample: I om' = T - M, with a constant torque T in between.

    Derive a frozen dataclass from it, and write `torque`. Samples take whole steps. Such controls act in
    `simulate`; where a scene has other uses for the drive, such as `stability`, they are refused, unless the
    class has a method `gains` with the control of continuous time which it stands for.

    Attributes:
        sample: s from sample to sample; also as a field of the dataclass.
    """

    sample, sampled, _needs_inertia = 0.01, True, "a sampled control"

    def begin(self) -> tuple[float, ...]:
        """The state of the control at the start, numbers; checkpoints hold it. Nothing unless you write another."""
        return ()

    def torque(self, state: np.ndarray, now: "Sample") -> tuple[float, np.ndarray]:
        """The torque of the drive until the next sample, N m, and the new state."""
        raise NotImplementedError(f"{type(self).__name__}.torque(state, now) is missing")

    def gains(self, impedance):
        refuse("TopDrive", "control", self, "Stiff(), PI(Kp, Ki), Matched() or Motor(torque) here: a control that is "
               f"called once a sample acts in drilling.simulate, unless {type(self).__name__} has gains")  # fmt: skip


class Sample(NamedTuple):
    """The input of a `SampledControl`: time (s), speed asked for and speed of the drive (rad/s), angle of the drive
    (rad), torque handed down to the string (N m)."""

    time: float
    asked: float
    speed: float
    angle: float
    torque: float


class Sampler:
    """The `SampledControl` of a drive in a motion in steps of dt (s).

    Attributes:
        every: steps between samples. state: (n,).
    """

    def __init__(self, drive, dt):
        self._control, self._signal = control, _ = drive.control, drive.signal()
        self.every = max(1, round(control.sample / dt))
        self.state = self._numbers("begin", control.begin())

    def left(self, step: int) -> int:
        """Steps from a step on to the next sample after it."""
        return self.every - step % self.every

    def torque(self, time: float, speed: float, angle: float, torque: float) -> float:
        """Take a sample: the torque of the drive from now on, N m, see `Sample`.

        Raises:
            SceneError: the control fails, or returns no numbers.
        """
        now, where = Sample(time, self._signal(time), speed, angle, torque), f" at t = {time:g} s"
        name = f"{type(self._control).__name__}.torque"
        found = call(lambda state: self._control.torque(state, now), self.state.copy(), name, where)
        if not isinstance(found, tuple) or len(found) != 2:
            refuse(self._control, "torque", found, f"the torque (N m) and the new state{where}")
        state = self._numbers("torque", found[1])
        if state.shape != self.state.shape:
            refuse(self._control, "torque", found[1], f"a state of {self.state.size} numbers{where}, as begin returned")
        self.state = state
        return number(self._control, "torque", found[0], f"a finite number (N m){where}", math.isfinite)

    def _numbers(self, name, state):
        return finite_array(self._control, name, state, "a state of finite numbers").ravel().copy()


@dataclass(frozen=True)
class Stiff(DriveControl):
    """The drive turns at the speed asked for, whatever the torque."""

    def gains(self, impedance):
        return Gains(rigid=True)


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

    _needs_inertia = "a PI control"

    def validate(self):
        for name, unit in (("Kp", "N m s/rad"), ("Ki", "N m/rad")):
            if getattr(self, name) is None:
                refuse(self, name, None, f"{_GAINS} ({unit})")
        if self.Kp == 0:
            refuse(self, "Kp", 0.0, f"{_GAINS}; without Kp the speed oscillates without end")

    def gains(self, impedance):
        return Gains(Kp=self.Kp, Ki=self.Ki)

    def __repr__(self):
        rule = f", rule={self.rule!r}" if self.rule else ""
        return f"PI(Kp={self.Kp!r}, Ki={self.Ki!r}{rule})"


@dataclass(frozen=True)
class Matched(DriveControl):
    """A drive that reflects no waves: M = torque + impedance (Om - om), without inertia.

    Args:
        impedance: N m s/rad; None for the uppermost section of the string, J sqrt(G rho).
        torque: M0, N m, that it hands down at the speed asked for.

    Raises:
        SceneError: an impedance that is not positive, or a torque that is not finite.
    """

    impedance: Annotated[TorsionalDamping, positive()] | None = None
    torque: Torque = 0.0

    def gains(self, impedance):
        if self.impedance is None and impedance is None:
            refuse(self, "impedance", None, "an impedance (N m s/rad): Discs have none")
        return Gains(given=self.torque, Kp=self.impedance or impedance)

    def check(self, drive):
        if drive.inertia > 0:
            refuse(drive, "inertia", drive.inertia, "0: a matched drive has none, PI(Kp, Ki) is one with inertia")
        super().check(drive)


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

    def gains(self, impedance):
        return Gains(given=self.torque, Kp=self.drag)

    def check(self, drive):
        if drive.speed is not None:
            refuse(drive, "speed", drive.speed, "None: a motor of given torque has no speed asked for")


@dataclass(frozen=True)
class TopDrive(Part):
    """The top drive, which turns the string.

    Args:
        speed: asked for, rad/s (`60 * units.rpm`): a number, from the start on, or a function of time, such as
            `Ramp(...)` or `Table(...)`, whose attribute `jumps` holds the times where it is not smooth. None for a
            `Motor`. Numbers above 32, at the start or at a jump, look like revolutions a minute: they are taken, with a
            warning.
        inertia: of the drive, at the string's speed, kg m^2.
        control: `Stiff()`, `PI(Kp, Ki)`, `Matched()`, `Motor(torque)`, or another `DriveControl`.

    Raises:
        SceneError: a control that is unknown or lacks an inertia or a speed that it needs, or a number out of range.
    """

    speed: InTime[AngularVelocity] | None = None
    inertia: Inertia = 0.0
    control: DriveControl = Stiff()

    def validate(self):
        self.control.check(self)
        if self.speed is not None:
            signal = self.signal()
            doubt_speed(self, "speed", max((signal(t) for t in (0.0, *signal.jumps)), key=abs))

    @property
    def imposes_speed(self) -> bool:
        """Whether the string's upper end has the speed asked for, whatever the torque."""
        return not self.control.sampled and self.control.gains(1.0).rigid

    def signal(self) -> ScalarSignal:
        """The speed asked for at every time, rad/s."""
        return ScalarSignal(self, "speed", 0.0 if self.speed is None else self.speed, "rad/s")


@dataclass(frozen=True)
class Hook(Part):
    """The travelling block with its lines.

    Args:
        stiffness: of lines and derrick, N/m; infinity for a rigid one.
        speed: of the block, m/s, upwards positive: a number, from the start on, or a function of time.

    Raises:
        SceneError: a stiffness that is not positive, or a speed that is no number.
    """

    stiffness: Stiffness = math.inf
    speed: InTime[Speed] = 0.0

    def validate(self):
        self.signal()

    def signal(self) -> ScalarSignal:
        """The speed of the block at every time, m/s."""
        return ScalarSignal(self, "speed", self.speed, "m/s")
