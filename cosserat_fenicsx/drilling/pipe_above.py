"""The pipe above a rod, up to the top drive and the hook, as a condition at the rod's end in motions.

Waves in its uniform parts, by d'Alembert's solution: forces of the past, delayed. In every part, with the torque M and
the speed om of its sections, M + Z om travels down and M - Z om up without change (axially: the thrust and the velocity
downwards). So the wave at the lower end of a part is known from the one at its upper end one travel time before, and
the force there is M = arriving - Z om: a dashpot and a known force.

Parts meet at nodes, where M may drop by a drag, and by friction at the wall of the hole (`PipeFriction`); at the
uppermost node a `TopEnd` reflects waves. Waves from the nodes
are stored as means over every time step, at the middle of the step, and read by Lagrange's interpolation with four of
them, which amplifies no wave where steps are even (Laakso et al., IEEE Signal Process. Mag. 13 (1996) 30).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
import ufl

from cosserat_fenicsx.checks import positive, refuse, store
from cosserat_fenicsx.drilling.joints import Parting
from cosserat_fenicsx.drilling.linear_control import arrays_of, check_answer, check_late
from cosserat_fenicsx.drilling.scene import Drilling, Segment, segment_of
from cosserat_fenicsx.drilling.signals import ScalarSignal
from cosserat_fenicsx.drilling.top_drive import DriveControl, Gains, Hook, Sample, Sampler, StateSpace, TopDrive
from cosserat_fenicsx.drilling.wall_friction import PipeFriction, ViscousDrag
from cosserat_fenicsx.parts import ForceSize
from cosserat_fenicsx.scene.action import PointAction, scalar, vector
from cosserat_fenicsx.scene.rod import Station, StationOrName, is_known
from cosserat_fenicsx.well.components import Laid, StringPart

# Drag and friction act at nodes, so many in the pipe (errors of 3e-4 at a rate of 0.3 per s in 3000 m), or one in each
# of these lengths (m) of a short one; of down to the second ones where a short part makes the steps shorter anyway.
_BEADS, _APART, _NEAREST = 64, 15.0, 4.0
# Parts of a sample to which the delay of a control is rounded.
_FINE = 1000


@dataclass(frozen=True)
class PipeAbove(PointAction):
    """The pipe between a rod's end and the top drive and hook: torsional and axial waves of the linear theory, exactly.

    The pipe lies in the direction of the rod at rest. Along it, it exerts a force on the rod's end; about the rod's own
    axis d3 there, it exerts a torque; across, it does nothing: hold the end by supports, as the wall of the hole does.
    Its force is a dashpot, the impedance of the pipe, and what left the end earlier and comes back from the top
    (`DelayLines`): with it the motion is as that of a rod of the whole length, without elements for the pipe. In the
    energy balance it counts as work of the loads. At rest it is the spring of the pipe between the rod and a held top.

    The steps are at most half the travel time of a wave through the shortest part of the pipe, and half the delay of a
    linear control; longer ones are halved.
    Only the schemes that step forwards can take it, and only the spatial model. A control that is called once a sample,
    of the drive or an autodriller of the hook, needs steps of one `dt` that its sample and its delay are multiples of.

    Args:
        station: `rod.start` or `rod.end`; the pipe continues from there, away from the rod.
        pipe: a `DrillPipe` or another component with a length (m), or a `drilling.segments.Segment`; or several of
            them, from the top down.
        drive: a `TopDrive`. Its speed is about the axis that points from the pipe into the rod.
        hook: a `Hook`; None for a rigid one at rest.
        tension: with which the pipe pulls at the rod's end in the reference, N: the weight of what hangs there.
        drag: a `ViscousDrag` of the pipe, as dashpots at 64 or more nodes, or every 15 m of a short pipe, closer where
            a part is short; it shortens the longest step; None for none.
        rubs: a `Drilling` with a hole, of whose string the pipe is the upper part: it rubs at the wall of the hole, at
            these nodes, with the friction of the `Drilling`, along and around the hole, see `pipe_friction`; None for
            a pipe without a wall. Curvature of the hole does nothing else to its waves.
        follows: whether the load of the hook stays as at the start, so that the string follows a bit that drills;
            without a hook.
        motors: (number of a part, `Joint` of a `MudMotor` at its lower end), the lowest part not among them, from the
            top down.
        at_rest: hook load and weight on bit in the reference, N, which controls that are called once a sample see.

    Raises:
        SceneError: a part of the wrong kind, a station inside the rod, or a number out of range.
    """

    station: StationOrName
    pipe: object
    drive: TopDrive
    hook: Hook | None = None
    tension: ForceSize = 0.0
    drag: ViscousDrag | None = None
    rubs: Drilling | None = None
    follows: bool = False
    at_rest: tuple[float, float] = (0.0, 0.0)
    motors: tuple = ()

    scaled = False

    def validate(self):
        if is_known(self, "station", Station) and self.station.s not in (0.0, self.station.rod.length):
            refuse(self, "station", self.station, "an end of the rod, rod.start or rod.end")
        given = self.pipe if isinstance(self.pipe, list | tuple) else (self.pipe,)
        if not given:
            refuse(self, "pipe", self.pipe, "at least one part")
        for part in given:
            if not isinstance(part, Segment | StringPart):
                refuse(self, "pipe", part, "parts of the pipe: DrillPipe, HeavyWeight, ..., or Segment")
            positive(part, "length", part.length, "m, of the pipe")
        if self.follows and self.hook is not None:
            refuse(self, "hook", self.hook, "None, where the load of the hook stays the same")
        store(self, pipe=tuple(given))
        store(self, _numbers=self._found_numbers())

    def _found_numbers(self):
        """Further numbers that the motion depends on, for the fingerprint of a scene; functions of time by samples."""
        hook, drag, control = self.hook or Hook(), self.drag or ViscousDrag(), self.drive.control
        gains = _gains(self.drive, self.segments[0].torsional_impedance)
        found = [x for part in self.segments for x in (part.length, part.GJ, part.rhoJ, part.EA, part.rhoA)]
        found += [
            drag.torsion, drag.axial, hook.stiffness, self.drive.inertia, *map(float, gains[:-1]),
        ]  # fmt: skip
        if gains.linear is not None:
            found += [*np.concatenate([x.ravel() for x in arrays_of(gains.linear)]), gains.linear.of_speed]
            found += [gains.linear.level or 0.0, *([control.late] if control.late else [])]
        signals = [self.drive.signal(), hook.signal()]
        for called in filter(None, (control if control.sampled else None, hook.autodriller)):
            given = (getattr(called, x.name) for x in fields(called))
            found += [y for x in given for y in np.ravel(x).tolist() if isinstance(y, int | float)]
        if hook.autodriller is not None:
            signals.append(hook.autodriller.signal())
        for part, joint in self.motors:
            tool = joint.tool
            found += [part, tool.per_radian, tool.slope, tool.lost_torque, tool.rotor_inertia]
            found += tool.law.c.ravel().tolist() if tool.curves else []
            signals.append(joint.force)
        for signal in signals:
            found += [signal(t) for t in (0.0, 1.0, 10.0)]
        return tuple(found)

    @property
    def segments(self) -> tuple[Segment, ...]:
        """The uniform parts, from the top down."""
        return tuple(
            part if isinstance(part, Segment) else segment_of(Laid(0.0, part.length, part), 0.0) for part in self.pipe
        )

    @property
    def _springs(self):
        """Stiffness of the pipe at rest between its lower end and a held top, N/m and N m/rad."""
        give = math.fsum(x.length / x.EA for x in self.segments) + 1 / (self.hook or Hook()).stiffness
        return 1 / give, 1 / math.fsum(x.length / x.GJ for x in self.segments)

    def down(self):
        """(3,) from the pipe into the rod, at rest, inertial."""
        tangent = self.station.rod.curve.frame(self.station.s)[:, 2]
        return tangent if self.station.s == 0 else -tangent

    #: in a motion: (thrust N, torque N m) at the moment, and damping (N s/m, N m s/rad), see `delayed`
    acting = None

    def data(self, rod, s):
        if self.acting is None:
            springs, forces, damping = self._springs, (-self.tension, 0.0), (0.0, 0.0)
        else:
            springs, (forces, damping) = (0.0, 0.0), self.acting
        values = zip((*forces, *damping, *springs), ("N", "N m", "N s/m", "N m s/rad", "N/m", "N m/rad"), strict=True)
        return (vector(self.down(), "1"), *(scalar(value, unit) for value, unit in values))

    def holds(self, scene):
        none = np.zeros(3)
        return [(self.station, np.r_[self.down(), none]), (self.station, np.r_[none, self.down()])]

    @staticmethod
    def work(point, test, down, thrust, torque, b, d, k, c):
        axis = point.R * down
        along = thrust - b * ufl.dot(point.r_t, down) - k * ufl.dot(point.u, down)
        about = torque - d * ufl.dot(point.omega, axis) - c * ufl.dot(point.theta, down)
        return along * ufl.dot(down, test.phi_r) + about * ufl.dot(axis, test.phi)

    def delayed(self):
        return _InMotion(self)


class _InMotion:
    """The `DelayLines` of a `PipeAbove` in a motion, see `Action.delayed`."""

    def __init__(self, pipe):
        self._pipe, self._down, drag = pipe, pipe.down(), pipe.drag or ViscousDrag()
        parts, lengths = pipe.segments, np.array([x.length for x in pipe.segments])
        rubs, whole, count = pipe.rubs, lengths.sum(), np.ones(len(parts), dtype=int)
        if rubs or drag.axial or drag.torsion:
            apart, least = whole / min(_BEADS, max(whole / _APART, 2.0)), 1 + bool(rubs and pipe.motors)
            apart = max(min(apart, lengths.min() / least), min(apart, _NEAREST))
            count = np.maximum(np.ceil(lengths / apart - 1e-9).astype(int), least)
        axial = [(x.axial_impedance, x.length / x.axial_speed) for x in parts]
        torsional = [(x.torsional_impedance, x.length / x.torsional_speed) for x in parts]
        hook, control = pipe.hook or Hook(), pipe.drive.control
        self._samplers = {}
        if control.sampled:
            name = "speed" if control.of_speed else "torque"
            self._samplers["drive"] = _sampler(control, name, pipe.drive.signal())
        if hook.autodriller is not None:
            self._samplers["hook"] = _sampler(hook.autodriller, "speed", ScalarSignal(hook, "speed", 0.0, "m/s"))
        ends = (
            TopEnd(None) if pipe.follows else _hook_end(hook, self._samplers.get("hook")),
            _drive_end(pipe.drive, parts[0].torsional_impedance, self._samplers.get("drive")),
        )
        rates = drag.axial, drag.torsion
        self._lines = [_lines(x, count, *more) for *more, x in zip(rates, ends, (axial, torsional), strict=True)]
        depths = np.append(0.0, np.cumsum(np.repeat(lengths / count, count)))
        #: motors, of which `far_end` has the speeds
        self.more = len(pipe.motors)
        partings = {int(count[: part + 1].sum()): Parting(x.tool, x.force) for part, x in pipe.motors}
        self._lines[1].part(partings)
        self._friction = PipeFriction(rubs, depths, partings) if rubs else None
        self._damping = tuple(line.dashpot for line in self._lines)
        samples = (x.sample / 2 for x in (control, hook.autodriller) if x and x.sampled)
        self.longest = min(*(line.longest for line in self._lines), *samples)

    def begin(self, motion):
        # the pipe starts in the equilibrium of its springs, with the motion of its end
        k, c = self._pipe._springs
        axial, torsional = self._lines
        thrust = -k * (motion.displacement @ self._down)
        axial.begin(motion.velocity @ self._down, thrust)
        torsional.begin(self._about(motion), -c * (motion.rotation @ self._down))
        if self._friction:
            self._friction.begin(thrust)
        for name, sampler in self._samplers.items():
            (speed, force), of_speed = self._lines[name == "drive"].at_top, sampler.of_speed
            sampler.start(speed if of_speed else force)
        self._sample(0.0)

    def _sample(self, t):
        """Let controls take the samples that are due at a time (s)."""
        self._before = {name: sampler.memory() for name, sampler in self._samplers.items()}
        (velocity, thrust), (_, torque) = (line.at_top for line in self._lines)
        (hook_load, weight), turning = self._pipe.at_rest, self._lines[1]
        seen = Sample(t, 0.0, turning.speed, turning.passed, torque, hook_load - thrust, weight + thrust, velocity)
        for sampler in self._samplers.values():
            sampler.reach(t, lambda: seen)

    def _about(self, motion):
        return motion.angular_velocity @ (motion.R @ self._down)

    def at(self, t):
        thrust, torque = (line.arriving(t) for line in self._lines)
        return {"acting": ((thrust - self._pipe.tension, torque), self._damping)}

    def accept(self, t, h, motion):
        held = (0.0, 0.0)
        if self._friction:
            (push, A), (torque, B) = (line.meeting(t, h) for line in self._lines)
            held = self._friction.holding(push, torque, A, B)
        speeds = motion.velocity @ self._down, self._about(motion)
        for line, speed, force in zip(self._lines, speeds, held, strict=True):
            line.advance(t, h, speed, force)
        if self._friction:
            self._friction.take(self._lines[0].inner)
        self._sample(t + h)

    def far_end(self):
        return np.concatenate([*(line.at_top for line in self._lines), self._lines[1].rates])

    @property
    def _parts(self):
        named = {"axial": self._lines[0], "torsional": self._lines[1]}
        return {**named, "friction": self._friction} if self._friction else named

    def undo(self):
        for part in self._parts.values():
            part.undo()
        for name, sampler in self._samplers.items():
            sampler.recall(self._before[name])

    def memory(self):
        return {name: part.memory() for name, part in (self._parts | self._samplers).items()}

    def recall(self, memory):
        for name, part in (self._parts | self._samplers).items():
            part.recall(memory[name])


def _lines(parts, pieces, rate, end):
    """The `DelayLines` of parts (impedance, travel time), cut into pieces, with a drag of a rate (1/s)."""
    impedance, time = (np.repeat(x, pieces) for x in np.transpose(parts))
    time = time / np.repeat(pieces, pieces)
    half = rate * impedance * time / 2  # of rate times the inertia of a piece
    return DelayLines(impedance, time, np.append(half, 0.0) + np.append(0.0, half), end)


def _sampler(control, name, asked):
    return Sampler(control, name, control.sample / _FINE, asked)


def _hook_end(hook, sampler):
    """The hook, whose autodriller, if it has one, commands the speed downwards by a `Sampler`."""
    mean, rigid = hook.signal().mean, math.isinf(hook.stiffness)
    down = sampler.mean if sampler else lambda start, end: -mean(start, end)
    return TopEnd(down, stiff=rigid, Ki=0.0 if rigid else hook.stiffness)


def _gains(drive, impedance):
    control = drive.control
    if control.sampled:
        return Gains(rigid=control.of_speed)
    gains = control.gains(impedance)
    check_late(control, gains.linear, impedance)
    return gains


def _drive_end(drive, impedance, sampler):
    rigid, given, Kp, Ki, linear = _gains(drive, impedance)
    asked = sampler if sampler and rigid else drive.signal()
    return TopEnd(asked.mean, stiff=rigid, inertia=drive.inertia, Kp=Kp, Ki=Ki, given=given,
                  control=drive.control, linear=linear, late=drive.control.late if linear else 0.0,
                  sampler=sampler)  # fmt: skip


# Samples of an interpolation; least travel time of a part over the step, so that all of them are known.
_SAMPLES, _LEAST = 4, 2.0
_EACH, _DIAGONAL = np.arange(_SAMPLES), np.eye(_SAMPLES)[:, :, None]
# Samples kept beyond those that may be read.
_SPARE = 512


@dataclass(frozen=True)
class TopEnd:
    """The upper end: I om' = Kp (Om - om) + Ki phi + M0 - M, phi' = Om - om; or om = Om where stiff; or by a linear
    control, see `linear_control`; or M = phi, the force of the start.

    Args:
        mean: function (start, end) of times (s) that gives the mean of the speed Om asked for; None for the force of
            the start. inertia: I. given: M0. linear: a `StateSpace` of the control, whose output acts `late` (s); None
            for Kp and Ki. sampler: of a control that is called once a sample, whose torque comes in the place of M0.
    """

    mean: Callable[[float, float], float] | None
    stiff: bool = False
    inertia: float = 0.0
    Kp: float = 0.0
    Ki: float = 0.0
    given: float = 0.0
    control: DriveControl | None = None
    linear: StateSpace | None = None
    late: float = 0.0
    sampler: Sampler | None = None

    def rest(self, speed, force):
        """(om, phi) at the beginning of a motion, for a speed and a force handed down; phi balances that force without
        a difference of speeds, where there is one. Of a linear control phi is its output, and its state follows, 0."""
        if self.mean is None:
            return speed, force
        if self.linear is not None:
            return speed, 0.0, *np.zeros(len(self.linear.A)).tolist()
        return speed, (force - self.given) / self.Ki if self.Ki else 0.0

    def step(self, state, start, end, impedance, wave, late=None):
        """The mean speed in a step from start to end (s), and the new state, by the implicit midpoint rule. state: see
        `rest`. impedance: of the string, with its drag. wave: M - Z om that arrives. late: the mean output of a linear
        control that acts now, None for that of the step itself."""
        h, (om, phi, *x) = end - start, state
        if self.mean is None:
            return (phi - wave) / impedance, state
        asked = self.mean(start, end)
        if self.linear is not None:
            return self._controlled(h, om, np.array(x), impedance, wave, asked, late)
        if self.stiff:
            return asked, (asked, 0.0)
        inert, turned = 2 * self.inertia / h, self.Ki * h / 2
        given = self.sampler.command if self.sampler else self.given
        push = inert * om + self.Ki * phi + given - wave + (self.Kp + turned) * asked
        mean = push / (inert + self.Kp + turned + impedance)
        return mean, (2 * mean - om, phi + h * (asked - mean))

    def _controlled(self, h, om, x, impedance, wave, asked, late):
        """`step` of a linear control: its mean output is y = c + d u, with the mean u = (Om - om, M)."""
        A, B, C, D = arrays_of(self.linear)
        half = np.linalg.inv(np.eye(len(x)) - h / 2 * A)
        c, d = C @ half @ x, D + h / 2 * C @ half @ B
        fixed, by_speed = c + d @ (asked, wave - (self.linear.level or 0.0)), d[1] * impedance - d[0]
        if late is not None:
            fixed, by_speed = late, 0.0
        if self.linear.of_speed:
            mean = (asked + fixed) / (1 - by_speed)
        else:
            if late is None:
                check_answer(self.control, d[1], h)
            inert = 2 * self.inertia / h
            mean = (inert * om + fixed - wave) / (inert + impedance - by_speed)
        u = np.array([asked - mean, wave + impedance * mean - (self.linear.level or 0.0)])
        x = 2 * half @ (x + h / 2 * B @ u) - x
        return mean, (2 * mean - om, float(c + d @ u), *x.tolist())


class DelayLines:
    """The torsional or the axial waves in parts from the top down. impedance, time: (n,) impedances and travel times
    (s) of the parts. drag: (n + 1,) force over speed at the nodes. top: a `TopEnd`."""

    def __init__(self, impedance, time, drag, top):
        self._Z, self._time, self._drag = (np.array(x, dtype=float) for x in (impedance, time, drag))
        self._top, self._parts = top, len(self._Z)
        # the output of a control that acts late is stored and read as waves are
        self._inertia = self._Z * self._time
        self._delays = np.append(np.tile(self._time, 2), [top.late] if top.late else [])
        #: longest step, s
        self.longest = self._delays.min() / _LEAST
        self.part({})

    def part(self, partings):
        """Part it at inner nodes: {number of the node: `Parting`}."""
        self._partings = partings
        self.begin(0.0, 0.0)

    @property
    def dashpot(self):
        """Force over speed at the lower end: the impedance of the lowest part, and drag."""
        return self._Z[-1] + self._drag[-1]

    def begin(self, speed, force):
        """Begin at the time 0, after a steady motion with a speed and a force handed down."""
        down, up = force + self._Z * speed, force - self._Z * speed
        self._first = np.concatenate([down, up, np.zeros(len(self._delays) - 2 * self._parts)])
        self._state = self._top.rest(speed, force)
        #: speed and force of the upper end, means over the last step, and the integral of the speed since the start
        self.at_top, self.passed = (speed, force), 0.0
        #: speeds of rotors, means over the last step; and of what is below them at its end
        self.rates, self._turning = np.zeros((2, len(self._partings)))
        self._turning += speed
        self._take(np.empty(0), np.empty((0, len(self._delays))))
        self._keep()

    def _keep(self):
        """Keep what `undo` restores."""
        self._before = self._state, self.at_top, self.passed, self.rates.copy(), self._turning.copy()

    @property
    def speed(self):
        """Of the upper end, at the end of the last step if a body is there, else its mean in it."""
        return self._state[0] if self._top.inertia and not self._top.stiff else self.at_top[0]

    def arriving(self, t):
        """The wave at the lower end at a time (s): the force there is this minus `dashpot` times its speed."""
        return float(self._delayed(t)[self._parts - 1])

    def _delayed(self, t):
        """(2 n,) waves at a time (s): from above at the lower ends of parts, then from below at their upper ends; then
        the output of a control that acts late, if there is one."""
        asked, count = t - self._delays, self._count
        if not count:
            return self._first
        if self._read[:2] == (t, count):  # a step asks for them several times
            return self._read[2]
        times = self._times[:count]
        first = np.clip(np.searchsorted(times, asked) - _SAMPLES // 2, 0, count - _SAMPLES)
        at = first + _EACH[:, None]
        known = times[at]
        factors = (asked - known) / (known[:, None] - known + _DIAGONAL)
        factors[_EACH, _EACH] = 1.0
        weights = factors.prod(axis=1)
        read = (weights * self._values[at, np.arange(len(asked))]).sum(axis=0)
        self._read = t, count, np.where(asked < times[0], self._first, read)
        return self._read[2]

    def _arrived(self, t, h):
        """Waves in the middle of a step from t to t + h (s), (n,) from above, (n,) from below; and the output of a
        control that acts then, or None."""
        if not self._count:  # before the start nothing changes; the spacing of the first step keeps impulses exact
            for k in range(-_SAMPLES, 0):
                self._append(t + (k + 0.5) * h, self._first)
        above, below, late = np.split(self._delayed(t + h / 2), [self._parts, 2 * self._parts])
        return above, below, float(late[0]) if len(late) else None

    def meeting(self, t, h):
        """(2, n - 1) at the inner nodes in a step from t to t + h (s): the push of the waves, and the impedance."""
        above, below, _ = self._arrived(t, h)
        return np.array([above[:-1] - below[1:], self._Z[:-1] + self._Z[1:] + self._drag[1:-1]])

    def advance(self, t, h, speed, held=0.0):
        """Accept a step from t to t + h (s) with this mean speed of the lower end; held: friction at inner nodes."""
        above, below, late = self._arrived(t, h)
        Z, speeds = self._Z, np.empty(self._parts + 1)
        self._keep()
        speeds[0], self._state = self._top.step(self._state, t, t + h, Z[0] + self._drag[0], below[0], late)
        speeds[1:-1] = (above[:-1] - below[1:] - held) / (Z[:-1] + Z[1:] + self._drag[1:-1])
        speeds[-1] = speed
        self.at_top = speeds[0], below[0] + (Z[0] + self._drag[0]) * speeds[0]
        self.passed += h * speeds[0]
        upper, lower = speeds[:-1].copy(), speeds[1:].copy()  # of the ends of parts
        for k, (node, parting) in enumerate(self._partings.items()):
            drag = self._drag[node] * self._inertia[node - 1 : node + 1] / self._inertia[node - 1 : node + 1].sum()
            sides = (above[node - 1], Z[node - 1] + drag[0]), (below[node], Z[node] + drag[1])
            lower[node - 1], self.rates[k], self._turning[k] = parting.meet(self._turning[k], t, t + h, *sides)
            upper[node] = lower[node - 1] + self.rates[k]
        #: forces at the inner nodes, means of both sides
        self.inner = (above[:-1] + below[1:] + (Z[1:] - Z[:-1]) * speeds[1:-1]) / 2
        waves = below + 2 * Z * upper, above - 2 * Z * lower
        self._append(t + h / 2, np.concatenate([*waves, [] if late is None else [self._state[1]]]))

    def _append(self, t, values):
        if self._count == len(self._times):
            read = np.searchsorted(self._times, self._times[-1] - self._delays.max())
            self._take(*(x[max(int(read) - 2 * _SAMPLES, 0) :] for x in (self._times, self._values)))
        self._times[self._count], self._values[self._count] = t, values
        self._count, self._read = self._count + 1, ()

    def _take(self, times, values):
        """Take samples, with room for at least as many."""
        self._count, self._read = (n := len(times)), ()
        self._times, self._values = np.zeros(2 * n + _SPARE), np.zeros((2 * n + _SPARE, len(self._delays)))
        self._times[:n], self._values[:n] = times, values

    def undo(self):
        """Take back the last step."""
        self._count -= 1
        self._state, self.at_top, self.passed, self.rates, self._turning = self._before

    def memory(self):
        """All that later steps depend on."""
        n = self._count
        arrays = {"times": self._times[:n], "values": self._values[:n], "first": self._first, "state": self._state,
                  "before": self._before[0], "top": [*self.at_top, self.passed]}  # fmt: skip
        arrays |= {"rotors": [self.rates, self._turning]} if self._partings else {}
        return {name: np.array(x) for name, x in arrays.items()}

    def recall(self, memory):
        """Restore the result of `memory`."""
        self._take(memory["times"], memory["values"])
        self._first = memory["first"].copy()
        *self.at_top, self.passed = memory["top"].tolist()
        if self._partings:
            self.rates, self._turning = memory["rotors"].copy()
        self._state, before = (tuple(memory[name].tolist()) for name in ("state", "before"))
        self._keep()
        self._before = before, *self._before[1:]
