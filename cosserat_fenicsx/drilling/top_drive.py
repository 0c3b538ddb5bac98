"""The top drive: its speed, its inertia and its control; and the hook.

A drive with the speed om and the inertia I hands the torque M down to the string; Om is the speed asked for:

    Stiff      om = Om
    PI         I om' = Kp (Om - om) + Ki int (Om - om) dt - M
    ZTorque    om = Om - H (M - M0)/Z, H a filter and a delay; it and `LinearControl` are those of linear_control.py
    Matched    M = M0 + Z (Om - om): it absorbs the waves of a string of the impedance Z
    Motor      I om' = M0 - c om - M: a given torque

`DriveControl` is the family of controls; `SampledControl` is for those of your own, called once a sample.
"""

import math
from dataclasses import dataclass, field
from typing import Annotated, Literal, NamedTuple

import numpy as np

from cosserat_fenicsx.checks import call, finite_array, number, refuse
from cosserat_fenicsx.checks import positive as positive_number
from cosserat_fenicsx.drilling.signals import ScalarSignal, doubt_speed
from cosserat_fenicsx.parts import (
    AngularVelocity,
    ForceSize,
    Inertia,
    InTime,
    Number,
    Part,
    Speed,
    Stiffness,
    Time,
    Torque,
    TorsionalDamping,
    at_least,
    positive,
)
from cosserat_fenicsx.quantities import LARGEST
from cosserat_fenicsx.well.operations import doubt_block_speed

#: Kp over the impedance of the string by the rules for `PI` controls in `linear.frequencies`.
RULES = {"SoftTorque": 1.0, "SoftSpeed": 4.0}
_GAINS = "a gain: SoftTorque(pipe), SoftSpeed(string) choose them, or give Kp and Ki"


class StateSpace(NamedTuple):
    """x' = A x + B u, y = C x + D u with u = (Om - om, M - level): y is the torque of the drive (N m), or, of a control
    `of_speed`, its speed less Om (rad/s). A level (N m) of None is the torque of a steady start, 0 from rest."""

    A: tuple
    B: tuple
    C: tuple
    D: tuple
    of_speed: bool = False
    level: float | None = 0.0


class Gains(NamedTuple):
    """A control as models take it: the drive turns at the speed Om asked for where it is rigid, or feels the torque
    given + Kp (Om - om) + Ki int (Om - om) dt, N m; or a `StateSpace` in the place of all that."""

    rigid: bool = False
    given: float = 0.0
    Kp: float = 0.0
    Ki: float = 0.0
    linear: StateSpace | None = None


class DriveControl(Part, family="control of a drive", homes=("cosserat_fenicsx.drilling.linear_control",)):
    """Base of the controls of a top drive.

    Attributes:
        sampled: whether it is a `SampledControl`, called once a sample; the gains of others say all.
    """

    # s by which it acts late: in motions those of a `StateSpace`, in the linear theory all.
    late = 0.0
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
            refuse(drive, "speed", None, "the speed asked for (rad/s), such as '60 rpm'")


class SampledControl(DriveControl):
    """Base of controls of your own that are called once a sample, for a torque T held constant in between, as in
    I om' = T - M, or for a speed, which the drive reaches linearly until the next sample.

    Derive a frozen dataclass from it, and write `torque` or `speed`. The steps of a motion divide `sample`. Such
    controls act in `simulate`; where a scene has other uses for the drive, such as `stability`, they are refused,
    unless the class has a method `gains` with the control of continuous time which it stands for: there it is late by
    half a sample and by the delay.

    Attributes:
        sample: s from sample to sample. delay: s from a sample to the moment when its command acts, rounded to whole
            steps. Both also as fields of the dataclass.
    """

    sample, delay, sampled = 0.01, 0.0, True

    def begin(self) -> tuple[float, ...]:
        """The state of the control at the start, numbers; checkpoints hold it. Nothing unless you write another."""
        return ()

    def torque(self, state: np.ndarray, now: "Sample") -> tuple[float, np.ndarray]:
        """The torque of the drive until the next sample, N m, and the new state."""
        raise NotImplementedError(f"{type(self).__name__}.torque(state, now) or .speed(state, now) is missing")

    def speed(self, state: np.ndarray, now: "Sample") -> tuple[float, np.ndarray]:
        """In place of `torque`: the speed of the drive at the next sample, rad/s, and the new state."""
        raise NotImplementedError

    @property
    def of_speed(self) -> bool:
        """Whether the class commands the speed."""
        return type(self).speed is not SampledControl.speed

    @property
    def late(self) -> float:
        return self.sample / 2 + self.delay

    @property
    def _needs_inertia(self):
        return "" if self.of_speed else "a sampled control"

    def gains(self, impedance):
        refuse("TopDrive", "control", self, "Stiff(), PI(Kp, Ki), Matched() or Motor(torque) here: a control that is "
               f"called once a sample acts in drilling.simulate, unless {type(self).__name__} has gains")  # fmt: skip


@dataclass(frozen=True)
class TorqueOverTime(SampledControl):
    """A motor whose torque is a function of time, held over every sample at its value in the middle.

    Args:
        values: N m, such as a `Ramp` or a `Table`. sample: s.

    Raises:
        SceneError: a torque that is not finite; a speed asked for beside it.
    """

    values: InTime[Torque]
    sample: Annotated[Time, positive()] = 0.01

    def torque(self, state, now):
        return ScalarSignal(self, "values", self.values, "N m")(now.time + self.sample / 2), state

    def check(self, drive):
        super().check(drive)
        if drive.speed is not None:
            refuse(drive, "speed", drive.speed, "None: a motor of given torque has no speed asked for")


class Sample(NamedTuple):
    """Inputs of a sampled control.

    Attributes:
        time: s. asked, speed: speed asked for and speed of the drive, rad/s. angle: of the drive, rad.
        torque: handed down to the string, N m. hook_load: N. weight: by the hook, the hanging weight of the string at
            rest less the hook load, N. block_speed: m/s, downwards. NaN along the axis for torsion alone.
    """

    time: float
    asked: float
    speed: float
    angle: float
    torque: float
    hook_load: float = math.nan
    weight: float = math.nan
    block_speed: float = math.nan


class Sampler:
    """A control that is called once a sample, in a motion in steps of dt (s); the speed that it commands over time.

    Args:
        control: a `SampledControl`, or another object with sample, delay, begin, and torque or speed.
        name: of its method, "torque" or "speed". first: the command before the first one acts, N m, rad/s or m/s.
        asked: the `ScalarSignal` of the speed asked for.

    Attributes:
        every: steps between samples. command: the one that acts. of_speed: whether it is a speed.
    """

    constant, jumps = False, ()

    def __init__(self, control, name, dt, asked, first=0.0):
        self._control, self._name, self._signal, self._dt = control, name, asked, dt
        self.every, self.of_speed = round(control.sample / dt), name == "speed"
        self._whole, self._after = divmod(round(control.delay / dt), self.every)
        self.start(first)

    def start(self, first: float) -> None:
        """Begin anew, with the command before the first one acts."""
        self.command, self._next = first, 0
        self._waiting, self._line = [], (0.0, first, 1.0, first)
        self._state = self._numbers("begin", self._control.begin())

    def left(self, step: int) -> int:
        """Steps from a step on to the next one at which a sample is taken or a command begins to act."""
        return min(self.every - step % self.every, self.every - (step - self._after) % self.every)

    def at(self, step: int, now) -> None:
        """Take a sample, and let a command act, as far as it is time; `now`: function that gives the `Sample` but for
        the speed asked for. Raises SceneError: the control fails, or returns no numbers."""
        if step % self.every == 0:
            self._waiting.append(self._take(now()._replace(asked=self._signal(step * self._dt))))
        if step % self.every == self._after and len(self._waiting) > self._whole:
            start = step * self._dt
            self._line = start, self(start), start + self.every * self._dt, self._waiting[0]
            self.command = self._waiting.pop(0)

    def reach(self, t: float, now) -> None:
        """Take what samples, and let what commands act, are due at a time (s) at which a step ends, in motions whose
        steps are not those of `dt`; `now` as of `at`. Raises SceneError: as of `at`; or one was due within the step."""
        while (late := t - self._next * self._dt) >= -1e-3 * self._dt:
            if late > 1e-3 * self._dt:
                where = f", at t = {self._next * self._dt:g} s"
                refuse(self._control, "sample", self._control.sample, "a sample (s), and a delay, that steps of one dt "
                       f"divide: here a step goes beyond one{where}; or another dt, without tol")  # fmt: skip
            self.at(self._next, now)
            self._next += self.left(self._next)

    def __call__(self, t: float) -> float:
        """The speed at a time (s), linear from one command to the next."""
        start, old, end, new = self._line
        return old + (new - old) * min(max((t - start) / (end - start), 0.0), 1.0)

    def mean(self, start: float, end: float) -> float:
        """Over a step."""
        return (self(start) + self(end)) / 2

    def _take(self, now):
        where = f" at t = {now.time:g} s"
        name = f"{type(self._control).__name__}.{self._name}"
        found = call(lambda state: getattr(self._control, self._name)(state, now), self._state.copy(), name, where)
        if not isinstance(found, tuple) or len(found) != 2:
            refuse(self._control, self._name, found, f"the {self._name} and the new state{where}")
        command, state = found
        array = isinstance(state, np.ndarray) and state.dtype == float and state.shape == self._state.shape
        if array and isinstance(command, float) and all(abs(x) <= LARGEST for x in (command, *state.tolist())):
            self._state = state.copy()  # at once: what follows takes as long as the motion
            return float(command)
        state = self._numbers(self._name, state)
        if state.shape != self._state.shape:
            refuse(self._control, self._name, found[1],
                   f"a state of {self._state.size} numbers{where}, as begin returned")  # fmt: skip
        self._state = state
        return number(self._control, self._name, found[0], f"a finite number{where}", math.isfinite)

    def _numbers(self, name, state):
        return finite_array(self._control, name, state, "a state of finite numbers").ravel().copy()

    def memory(self) -> dict:
        """All that later samples depend on."""
        now = {"state": self._state.copy(), "waiting": np.array(self._waiting), "line": np.array(self._line)}
        return now | {"command": self.command, "next": self._next}

    def recall(self, memory: dict) -> None:
        """Restore the result of `memory`."""
        self._state, self.command = memory["state"].copy(), float(memory["command"])
        self._waiting, self._line = memory["waiting"].tolist(), tuple(memory["line"].tolist())
        self._next = int(memory["next"])


def divided(control, dt: float, given: bool) -> float | None:
    """The sample (s) that steps of a motion divide, or the delay of a control of continuous time, if any. Raises
    SceneError: a step dt (s) that is `given` is longer than half of it, or the control has no such sample."""
    name = "sample" if control.sampled else "delay"
    if control.sampled:
        period = positive_number(control, "sample", control.sample, "s")
        number(control, "delay", control.delay, "a delay from 0 on (s)", lambda x: 0 <= x < math.inf)
    elif not (period := control.late):
        return None
    if given and period < 2 * dt * (1 - 1e-9):
        refuse(control, name, period, f"at least two steps: {2 * dt:g} s for dt = {dt:g} s, or a shorter dt")
    return period


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
        control: `Stiff()`, `PI(Kp, Ki)`, `Matched()`, `ZTorque()`, `Motor(torque)`, or another `DriveControl`.

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
        if self.control.sampled:
            return False
        rigid, *_, linear = self.control.gains(1.0)
        return rigid or (linear is not None and linear.of_speed and (self.control.late > 0 or not linear.D[1]))

    def signal(self) -> ScalarSignal:
        """The speed asked for at every time, rad/s."""
        return ScalarSignal(self, "speed", 0.0 if self.speed is None else self.speed, "rad/s")


@dataclass(frozen=True)
class Autodriller(Part):
    """A control of the block that holds the weight on bit: it goes down at Kp (W - w) + Ki int (W - w) dt, w the
    hanging weight of the string less the hook load, within limits, at which the integral stops.

    It is called once a sample, and the block reaches the speed linearly until the next one.

    Args:
        weight: W, N; None for a block that goes down at the `rate` alone. It may be a function of time.
        Kp, Ki: m/(s N) and m/(s^2 N).
        limits: of the speed of the block downwards, m/s. rate: a lower upper limit, of the rate of penetration, m/s.
        sample: s.

    Raises:
        SceneError: neither weight nor rate, a weight without gains, or limits that do not ascend.
    """

    weight: InTime[Annotated[ForceSize, positive()]] | None = None
    Kp: Annotated[float, Number(limits=at_least(0))] = 0.0
    Ki: Annotated[float, Number(limits=at_least(0))] = 0.0
    limits: tuple[Speed, ...] = (0.0, 0.02)
    rate: Annotated[Speed, positive()] | None = None
    sample: Annotated[Time, positive()] = 0.02

    delay, sampled = 0.0, True

    def validate(self):
        if self.weight is None and self.rate is None:
            refuse(self, "weight", None, "the weight on bit to hold (N), or a rate (m/s)")
        if self.weight is not None and not self.Kp + self.Ki > 0:
            refuse(self, "Kp", self.Kp, "Kp (m/(s N)), Ki (m/(s^2 N)) or both above 0, about 1e-8 and 1e-9")
        if len(self.limits) != 2 or not self.limits[0] < self.limits[1]:
            refuse(self, "limits", self.limits, "the least and the largest speed of the block downwards (m/s)")
        doubt_block_speed(self, "limits", max(*self.limits, self.rate or 0.0, key=abs))

    def signal(self) -> ScalarSignal:
        """The weight to hold at every time, N; 0 without one."""
        return ScalarSignal(self, "weight", self.weight or 0.0, "N")

    def begin(self):
        """The integral, m/s."""
        return (0.0,)

    def speed(self, state, now):
        """The speed of the block downwards at the next sample, m/s, and the new integral."""
        low, high = self.limits[0], min(self.limits[1], self.rate or math.inf)
        if self.weight is None:
            return high, state
        asked_for = self.signal()(now.time) if callable(self.weight) else self.weight  # at every sample
        error = asked_for - now.weight
        more = self.Ki * self.sample * error
        asked = self.Kp * error + float(state[0]) + more
        stops = (asked > high and more > 0) or (asked < low and more < 0)
        return min(max(asked, low), high), state + (0.0 if stops else more)


@dataclass(frozen=True)
class Hook(Part):
    """The travelling block with its lines.

    Args:
        stiffness: of lines and derrick, N/m; infinity for a rigid one.
        speed: of the block, m/s, upwards positive: a number, from the start on, or a function of time. Above 5 m/s, at
            the start or at a jump, it is taken with a warning.
        autodriller: an `Autodriller`, which moves the block in place of a speed.

    Raises:
        SceneError: a stiffness that is not positive, a speed that is no number, or a speed beside an autodriller.
    """

    stiffness: Stiffness = math.inf
    speed: InTime[Speed] = 0.0
    autodriller: Autodriller | None = None

    def validate(self):
        signal = self.signal()
        if not (signal.constant and signal(0.0) == 0) and self.autodriller is not None:
            refuse(self, "speed", self.speed, "0 beside an autodriller, which moves the block")
        doubt_block_speed(self, "speed", max((signal(t) for t in (0.0, *signal.jumps)), key=abs))

    def signal(self) -> ScalarSignal:
        """The speed of the block at every time, m/s."""
        return ScalarSignal(self, "speed", self.speed, "m/s")
