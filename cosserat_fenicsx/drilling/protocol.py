"""Interface between string models and the time loop, names of the recorded series, and what models in C share.

x runs along the string from the top drive down. Angles and rotation are positive in the sense of drilling, the torque M
(N m) is positive where it drives what is below. Displacements u and velocities v are positive downwards, from the
hanging equilibrium; tension is positive. Models of torsion alone record NaN for axial quantities.

In the steady motion that a scene may start with, all of the string turns at the drive's speed and moves at the hook's.
The forces of wall, mud and bit at these
velocities twist and compress the string. The normal force at the wall depends on the tension, so it is iterated.
"""

from functools import cached_property
from typing import Any

import numpy as np

from cosserat_fenicsx.algebra.building import Pointers
from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.joints import steady_speeds
from cosserat_fenicsx.drilling.laws import SOURCES
from cosserat_fenicsx.drilling.linear_control import arrays_of, check_answer, check_late, steady_control
from cosserat_fenicsx.drilling.signals import means
from cosserat_fenicsx.drilling.top_drive import Sample, Sampler
from cosserat_fenicsx.errors import NotConverged

#: Recorded at the end of every step. drive_speed, bit_speed: rad/s; drive_angle, bit_angle: rad; surface_torque: M at
#: the top, torque_on_bit: against the rotation of the bit, N m; hook_load, weight_on_bit: N; bit_velocity: m/s,
#: bit_advance: m, downwards; impulse_on_bit: sum of all impacts on rigid rock since the start, N s, not contained in
#: weight_on_bit; motor_speed: of a mud motor's rotor against its housing, rad/s, 0 without one. Of several motors it is
#: the sum, and columns after the LEDGER have those of each, from the top down.
SERIES = (
    "drive_speed", "drive_angle", "surface_torque", "bit_speed", "bit_angle", "torque_on_bit", "hook_load",
    "bit_velocity", "bit_advance", "weight_on_bit", "impulse_on_bit", "motor_speed",
)  # fmt: skip
#: Energies and, since the start, works and losses, J, of the string above the rock with drive and bit. Up to the loss
#: of the scheme: kinetic + strain = work_of_drive + work_of_hook + work_of_weight + work_of_tools -
#: lost_at_bit - lost_at_wall - lost_in_mud. work_of_tools is done by motors (torque times speed) and oscillation tools;
#: work_of_drive is done by the torque that the control asks for; lost_in_mud is that of dampers, too.
LEDGER = (
    "kinetic", "strain", "work_of_drive", "work_of_hook", "work_of_weight", "work_of_tools", "lost_at_bit",
    "lost_at_wall", "lost_in_mud",
)  # fmt: skip
#: Along the string, at `StringModel.depths`. angle: rad; speed: rad/s; torque: N m; displacement: m; velocity: m/s;
#: tension: N; sticking: 1 where the wall holds the string, 0 where it slips or is free.
PROFILE = ("angle", "speed", "torque", "displacement", "velocity", "tension", "sticking")


def columns(scene) -> int:
    """How many columns rows have, the time in the first one."""
    return 1 + len(SERIES) + len(LEDGER) + (len(scene.motors) if len(scene.motors) > 1 else 0)


class StringModel(Pointers):
    """Base of string models in C. A model starts at the time 0 and advances by steps of `dt`.

    Attributes:
        name: of the model, such as "torsion". why: sentences on the choice and on approximations.
        dt: s. steps: done. depths: (m,) measured depths of the nodes, m. counts: dict of counters: halved steps,
            iterations of Newton's method.
    """

    name: str
    why: tuple[str, ...]
    dt: float
    depths: np.ndarray
    counts: dict[str, int]
    # Message of a step that fails, with {time}; names of the arrays that change in a step.
    _failure: str
    _changing: tuple[str, ...]

    def __init__(self):
        super().__init__(*SOURCES)
        self.steps, self._laws, self._samplers, self._kept = 0, [], {}, {}

    def _array(self, record, name, values):
        """Give C's record a copy of an array, which is kept by its name."""
        whole = np.asarray(values).dtype.kind in "ib"
        array = self._kept[name] = np.array(values, dtype=np.int32 if whole else float, order="C")
        setattr(record, name, (self.integers if whole else self.doubles)(array))

    def _put_curve(self, curve, motor, flow=None):
        """Give C the torque of a motor with curves over its speed, less that at rest; returns arrays C does not own."""
        if not motor.curves:
            return None
        law = motor.law if flow is None else motor.law_at(flow)
        shape = law.c.T.copy()
        shape[:, 3] -= law(0.0)
        arrays = np.ascontiguousarray(law.x), np.ascontiguousarray(shape)
        curve.knots, curve.cubics = map(self.doubles, arrays)
        curve.count = len(shape)
        return arrays

    def _put_curves(self, motor, flows):
        """(curves for C at the flows (m^3/s) of steps, their arrays) of a motor whose flow changes; None for others."""
        if not motor.curves or not callable(motor.flow):
            return self._ffi.NULL, None
        each = self._ffi.new("curve[]", len(flows))
        return each, [self._put_curve(one, motor, float(flow)) for one, flow in zip(each, flows, strict=True)]

    def _sample_torque(self, drive, top, first=0.0):
        """Take samples of a drive's control; `first`: torque (N m) or speed (rad/s) before its first command acts."""
        control, self._top = drive.control, top
        if control.sampled:
            name = "speed" if control.of_speed else "torque"
            self._samplers["drive"] = Sampler(control, name, self.dt, drive.signal(), first)
            self._given()

    @cached_property
    def _gains(self):
        """The `Gains` of the drive's control; None of one that is sampled."""
        scene, control = self.scene, self.scene.drive.control
        Z = None if scene.discs else scene.segments[0].torsional_impedance
        return None if control.sampled else control.gains(Z)

    def _set_linear(self, record, drive, space, impedance):
        """Fill C's record of a linear control for steps of `dt`; impedance (N m s/rad): None above a body."""
        check_late(drive.control, space, impedance, self.scene.discs is not None)
        A, B, C, D = arrays_of(space)
        n, late = len(A), round(drive.control.late / self.dt)
        record.used, record.size, record.late = 1, n, late
        record.of_speed, record.level, record.step = space.of_speed, space.level or 0.0, self.dt
        for name, values in (("A", A), ("B", B), ("C", C), ("D", D), ("state", np.zeros(n)), ("mean", np.zeros(n)),
                             ("waiting", np.zeros(late + 1)), ("work", np.zeros((n, 2 * n)))):  # fmt: skip
            self._array(record, name, values)
        if not late:
            own, answer = (D + self.dt / 2 * C @ np.linalg.solve(np.eye(n) - self.dt / 2 * A, B)).tolist()
            if not space.of_speed:
                check_answer(drive.control, answer, self.dt)
            elif impedance is not None and answer > 0 and impedance - (1 + own) / answer < 0:
                refuse("simulate", "dt", self.dt, "a shorter step (s): in this one the speed of the drive rises with "
                       "the torque on it; or model='axial and torsional'")  # fmt: skip

    def _settle_linear(self, record, drive, space, torque):
        """The state of a linear control in steady rotation under a torque (N m)."""
        record.level, self._kept["state"][:], self._kept["waiting"][:] = steady_control(drive.control, space, torque)

    def _weights(self, first, steps):
        """For C: the mean weight on bit of steps (N), where it is a function of time."""
        bit = self.scene.bit
        if bit is None or not bit.varies:
            return self._ffi.NULL
        found = means(bit.signal(), first, steps, self.dt)
        if (low := found.min()) < 0:
            t = (first + int(found.argmin())) * self.dt
            refuse(bit, "weight", low, f"a weight on bit that is not negative (N), at t = {t:g} s")
        if found.max() > 1.01 * bit.most:
            refuse(bit, "weight", found.max(), "a weight on bit (N) whose largest value does not hide in a short peak: "
                   "a signal with `jumps` where it is not smooth")  # fmt: skip
        return self._ffi.from_buffer("double[]", found)

    def _given(self):
        """Give C the torque that a sampled control of the drive commands."""
        sampler = self._samplers.get("drive")
        if sampler and not self.scene.drive.control.of_speed:
            self._top.given = sampler.command

    @property
    def time(self) -> float:
        """s."""
        return self.steps * self.dt

    def advance(self, steps: int) -> np.ndarray:
        """Do up to `steps` steps.

        Returns:
            (n, `columns`): the time and the values of SERIES and LEDGER at the end of each.

        Raises:
            NotConverged: a step fails however short it is; `rows` of the exception holds the steps before.
        """
        start, last, samplers = self.steps, self.steps + steps, self._samplers.values()
        rows, failed = np.empty((steps, columns(self.scene))), False
        while self.steps < last and not failed:
            for sampler in samplers:
                sampler.at(self.steps, self._seen)
            self._given()
            end = min(last, *(self.steps + sampler.left(self.steps) for sampler in samplers), last)
            self._record(end - self.steps, rows[self.steps - start :])
            failed = self.steps < end
        rows = rows[: self.steps - start]
        rows[:, 0] = np.arange(start + 1, self.steps + 1) * self.dt
        for law in self._laws:
            law.raise_failure()
        if failed:
            problem = NotConverged(f"{self.name}: {self._failure.format(time=self.time)}")
            problem.rows = rows
            raise problem
        return rows

    def _seen(self) -> Sample:
        """Inputs of sampled controls, except the speed asked for."""
        raise NotImplementedError

    def _record(self, steps, rows):
        """Do up to `steps` steps, count them, and write their `rows`, see `advance`, except the times."""
        raise NotImplementedError

    def profile(self) -> np.ndarray:
        """(len(PROFILE), m) along the string, now."""
        raise NotImplementedError

    @property
    def _remembered(self):
        """Names of the arrays that change in a step."""
        return (*self._changing, *(("state", "waiting") if "state" in self._kept else ()))

    def memory(self) -> dict[str, Any]:
        """All that later steps depend on, arrays and numbers, such that `recall` leads to the same digits."""
        found = {name: self._kept[name].copy() for name in self._remembered}
        found |= {f"sampled_{name}": sampler.memory() for name, sampler in self._samplers.items()}
        return found

    def recall(self, memory: dict[str, Any]) -> None:
        """Restore the result of `memory`."""
        for name in self._remembered:
            self._kept[name][:] = memory[name]
        for name, sampler in self._samplers.items():
            sampler.recall(memory[f"sampled_{name}"])
        self._given()


def check_steady(scene) -> None:
    """Refuse a scene whose drive has no steady speed of its own: a motor, no integral part, or at rest."""
    drive = scene.drive
    gains = None if drive.speed is None or drive.control.sampled else drive.control.gains(1.0)
    sampled = drive.speed is not None and drive.control.sampled
    if not sampled and (gains is None or not (gains.rigid or gains.Ki > 0 or gains.linear)):
        refuse("Drilling", "start", "steady", "'rest' with this drive: only Stiff(), PI(Kp, Ki) with Ki above 0, and "
               "linear controls have the speed asked for in steady rotation")  # fmt: skip
    speed = drive.signal()(0.0)
    if not speed > 0:
        refuse("Drilling", "start", "steady", "'rest' where the drive does not turn at the start, or a speed above 0")


def check_rock(scene) -> None:
    """Refuse a hook that moves a string with axial motion whose bit stands on rock without drilling.

    Raises:
        SceneError: the hook moves, and the bit stands on such rock; or an autodriller is to put a weight on a bit that
            drills and has one already.
    """
    bit, (down, _) = scene.bit, steady_velocities(scene)
    driller = scene.hook is not None and scene.hook.autodriller is not None
    if driller and bit is not None and bit.law.drills and bit.weight is not None:
        refuse("Drilling", "start", "steady", "a bit without a weight, BitOnRock(weight=None), which the autodriller "
               "puts on it; or 'rest': the block of an autodriller stands still at the start, and the bit drills by "
               "its weight")  # fmt: skip
    if down and bit is not None and bit.weight is not None and not bit.law.drills:
        refuse("Drilling", "start", "steady", f"'rest' with a hook that moves at {-down:g} m/s: the rock below a bit "
               "with a weight is not drilled and does not give way, unless its law is Cutting(...)")  # fmt: skip


def follows_the_bit(scene) -> bool:
    """Whether the load of the hook stays the same, so that the string follows the bit, which drills by its weight."""
    bit = scene.bit
    return scene.hook is None and bit is not None and bit.weight is not None and bit.law.drills


def steady_velocities(scene) -> np.ndarray:
    """(2,) m/s downwards, rad/s; a SceneError for a bit whose weight its wear flats bear."""
    turning = scene.drive.signal()(0.0)
    if follows_the_bit(scene):
        return np.array([scene.bit.law.rate(scene.bit.weight, steady_speed_of_bit(scene)), turning])
    return np.array([_of_hook(scene), turning])


def steady_speed_of_bit(scene, down: float | None = None) -> float:
    """rad/s, of steady motion: that of the drive, and of motors.

    Args:
        down: velocity (m/s) of a bit that drills; None for that by its weight, or by the hook.

    Raises:
        SceneError: a motor stalls.
    """
    down = _of_hook(scene) if down is None and not follows_the_bit(scene) else down
    return float(steady_speeds(scene, scene.drive.signal()(0.0), down)[-1])


def _of_hook(scene):
    """m/s downwards."""
    return 0.0 if scene.hook is None else -scene.hook.signal()(0.0)


# Most iterations; relative change at which they end.
_ROUNDS, _SAME = 200, 1e-13


def steady_state(velocities, chain, limits, friction, bit, pairs=()):
    """Places of the nodes and forces on the top in steady motion.

    Args:
        velocities: (nodes, dofs). chain: the `Chain`.
        limits: (nodes, 3) of the places (nodes, dofs): largest friction at rest, in motion, contact radius.
        friction: the `Resistance` of the wall, and whether it is one over the rotation.
        bit: (dofs,) weight on bit less that at rest (N), torque on bit (N m).
        pairs: (element, unknown, force) of forces that drive its nodes apart, N or N m.

    Returns:
        x (nodes, dofs); (nodes, dofs) force along the string above each node: compression (N), torque (N m).

    Raises:
        NotConverged: friction and the tension that it causes increase each other without end.
    """
    n = velocities.shape[1]
    x = np.zeros_like(velocities)
    dragged = chain.drag * velocities
    dragged[:-1] += chain.drag_off * velocities[1:]
    dragged[1:] += chain.drag_off * velocities[:-1]
    for i, d, force in pairs:
        dragged[i, d] += force
        dragged[i + 1, d] -= force
    spring = np.where(chain.spring > 0, chain.spring, np.inf)
    down, turning = velocities[:, 0] if n == 2 else 0.0, velocities[:, -1]
    for _ in range(_ROUNDS):
        still, _, radius = limits(x).T
        around = radius * turning
        slip = np.hypot(down, around)
        braked = still > 0
        speed = np.abs(turning) if friction[1] else slip
        size = np.zeros_like(slip)
        size[braked] = still[braked] / friction[0].still * friction[0](speed[braked]) / slip[braked]
        resisting = dragged.copy()
        resisting[:, -1] += size * around * radius
        if n == 2:
            resisting[:, 0] += size * down
        resisting[-1] += bit
        below = np.cumsum(resisting[::-1], axis=0)[::-1]
        new = np.concatenate([np.zeros((1, n)), np.cumsum(-below[1:] / spring, axis=0)])
        change, x = np.abs(new - x).max(), new
        if change <= _SAME * np.abs(x).max():
            return x, below
    raise NotConverged("Drilling.start = 'steady': the friction grows by the tension that it makes: expected 'rest'")
