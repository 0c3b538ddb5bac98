"""The model of a string by elements: torsion alone, axial and torsional motion together, or discs.

Method: linear elements, the implicit midpoint rule, and set-valued laws of wall and bit, which hold or slip within a
step: Newton's method on their proximal maps with the mean velocities of the step as unknowns (elements.c). Friction at
the wall is a vector against the slip (V, r om), of a normal force per length by the soft string, the norm of
T k n + w (e - (e.t) t), with the tension at the begin of the step. What is held in a step is at rest at its end. Steps
that fail are halved. Energies and works balance to rounding and to the tolerance of Newton's method: the rule keeps
quadratic energies, and works are those of the step's own forces.
"""

import math

import numpy as np
from scipy.optimize import brentq

from cosserat_fenicsx.checks import number, positive, refuse
from cosserat_fenicsx.drilling.chain import chain_of, fewest_in_period, unresolved, usual_step
from cosserat_fenicsx.drilling.joints import speeds_of_parts
from cosserat_fenicsx.drilling.laws import InC, check_bit
from cosserat_fenicsx.drilling.linear_control import step_for
from cosserat_fenicsx.drilling.protocol import (
    StringModel,
    check_rock,
    check_steady,
    follows_the_bit,
    steady_speed_of_bit,
    steady_state,
    steady_velocities,
)
from cosserat_fenicsx.drilling.signals import ScalarSignal, intervals
from cosserat_fenicsx.drilling.top_drive import Hook, Sample, Sampler, divided
from cosserat_fenicsx.drilling.wall_friction import law_of, static_weight
from cosserat_fenicsx.errors import SceneError

_TRIALS = 30
# Speeds at which a steady bit below a motor is looked for.
_SPEEDS = 60
_ELEMENTS = 1_000_000
_SUMS = ("drive", "hook", "tools", "bit", "wall", "mud")
_BIT = ("weight", "torque", "share", "impulse", "slowed", "slowing", "floor", "sinking", "face")


class AxialTorsional(StringModel):
    """A string with axial and torsional motion, or with torsion alone.

    A string that starts at rest is in the tension of its weight in mud along the hole, without friction. A bit with a
    weight stands on a rock, rigid or of a stiffness, with the hook lowered until it bears that weight; without one the
    string hangs off bottom. The rock pushes the bit but does not pull it; the torque of a bit whose law has a `radius`
    follows the weight on bit of the step before. A bit that comes down on rigid rock is stopped by an impulse, which is
    recorded as such: the weight on bit, and the torque by it, leave it out. Recorded speeds, forces and torques are
    means over the last step, except speeds of discs, which hold for its end.

    Args:
        scene: a `Drilling`.
        dt: step, s; None for the time in which a wave of torsion passes an element, at most 0.01 s, and shorter where
            a falling law or a bit that cuts needs it; of discs a part of their shortest period.
        elements: about how many along the string, each component has one at least; None for as many as waves of torsion
            pass in a step, within 40 to 400 (4000 with a bit that cuts), or 250 without a step.
        axial: False for torsion alone.
        end: an `EndCondition` in place of the law's own, or None.

    Raises:
        SceneError: a bit law steeper than the impedance of the string without inertia at the bit; a step too long for a
            falling law of friction; a steady start that the drive does not have; torsion alone of a bit that cuts.
    """

    _changing = ("x", "v", "w", "force", "held")
    _failure = (
        "the step at t = {time:g} s does not converge however short it is made: expected a smoother signal, or laws "
        "that fall less steeply"
    )

    def __init__(self, scene, dt: float | None = None, elements: int | None = None, *, axial: bool = True, end=None):
        super().__init__()
        check_bit(scene)
        self.scene, self._given_end = scene, end
        self._axial = axial and not (scene.discs and scene.discs.masses is None)
        self.name = "axial and torsional" if self._axial else "torsion"
        if dt is not None:
            dt = positive("AxialTorsional", "dt", dt, "s")
        if elements is not None:
            expected = f"a number of elements from 2 to {_ELEMENTS}"
            number("AxialTorsional", "elements", elements, expected, lambda x: 2 <= x <= _ELEMENTS and x == int(x))
        self.dt = dt or usual_step(scene, elements, self._axial)
        if self._axial:
            fewest_in_period(scene, self.dt)
        controls = [scene.drive.control, scene.hook and self._axial and scene.hook.autodriller]
        periods = [divided(x, self.dt, dt is not None) for x in controls if x]
        period = min((x for x in periods if x), default=None)
        if dt is None and self._gains:
            self.dt = step_for(self._gains, self.dt)
        if period:
            self.dt = period / max(2, math.ceil(period / self.dt * (1 - 1e-9)))
            dt = dt and self.dt
        for _ in range(_TRIALS):
            self._set(elements)  # masses of elements depend on the step
            if self._lib.steepest(self._m, self.dt) > 0:
                break
            self.dt /= 2
        if dt is not None and self.dt < dt:
            raise SceneError(
                f"AxialTorsional.dt = {dt:g} s: expected at most about {self.dt:.3g} s: in longer steps the law of "
                "friction or of the bit falls more steeply than inertia and string allow, and the speed at the end of "
                "a step is not determined"
            )
        self._start()
        self._sample()
        self.why = tuple(self._reasons())

    def _set(self, elements):
        """The record of C for the present step."""
        scene = self.scene
        self._chain = chain_of(scene, self.dt, elements, self._axial)
        self.depths = self._chain.depths
        self._m = self._ffi.new("model *")
        self._kept, self._dofs = {}, 1 + self._axial
        self._set_chain()
        self._set_wall(scene.friction)
        self._set_bit(scene.bit)
        self._signals = [self._set_hook(scene.hook or Hook())] if self._axial else []
        self._signals.append(self._set_drive(scene.drive))
        self._set_joints()
        self._lib.limits(self._m)
        m, held = self._m, self._kept["held"]
        held[self._kept["limit"][:, 0] > 0] = 3 if self._axial else 2
        held[-1] |= 2 * m.bit.law + (m.bit.rock and not m.bit.stiffness)

    # -- the record of C -----------------------------------------------------------------------------------------------

    def _set_chain(self):
        m, chain, n = self._m, self._chain, self._dofs
        nodes = len(chain.depths)
        m.nodes, m.dofs, m.hanging_top = nodes, n, chain.hanging_top
        m.at_end = self.scene.discs is not None
        for name in ("mass", "mass_off", "drag", "drag_off", "spring", "hanging"):
            self._array(m, name, getattr(chain, name))
        for name in ("x", "v", "w", "force", "a", "o", "rho", "b", "y", "c"):
            self._array(m, name, np.zeros((nodes, n)))
        for name, width in (("limit", 3), ("q", 4), ("d", 3), ("guess", 2 * n)):
            self._array(m, name, np.zeros((nodes, width)))
        for name in ("mask", "broken", "held"):
            self._array(m, name, np.zeros(nodes, dtype=np.int32))

    def _set_wall(self, friction):
        m, wall = self._m, self._chain.wall
        m.pieces, m.fixed = len(wall.element), self._dofs == 1
        for name, values in vars(wall).items():
            self._array(m, name, values)
        self._wall, m.of_rotation, _ = law_of(friction)
        self._laws = [InC(self._ffi, self._wall)]
        self._laws[0].put(*(self._ffi.addressof(m[0], name) for name in ("wall", "curve")))

    def _set_bit(self, bit):
        m = self._m.bit
        if bit is None:
            return
        mass, m.weight = self._kept["mass"][-1], static_weight(self.scene)
        mass[-1] += self.scene.bit_inertia
        if self._axial:
            mass[0] += bit.mass
            m.mass, m.hanging = mass[0] if self._m.at_end else bit.mass, m.weight
        m.rock, m.share = self._axial and bit.weight is not None and not bit.law.drills, 1.0
        m.stiffness = bit.rock_stiffness if m.rock and np.isfinite(bit.rock_stiffness) else 0.0
        if bit.varies and self._axial:
            refuse(bit, "weight", bit.weight, "a number (N) with axial motion, in which block and string decide it: "
                   "Hook(speed=...), or an Autodriller whose weight is a function of time")  # fmt: skip
        law, m.over_time = bit.law.resistance(bit.most), bit.varies
        if bit.varies:
            m.weight = bit.most
        if law is not None:
            closed = law.function is None
            m.law, m.weighs = 1, bit.law.needs_weight
            per_weight = bit.law.resistance(1.0) if closed else law
            self._laws.append(InC(self._ffi, per_weight, *(() if closed else bit.law.in_c(bit.most))))
            self._laws[1].put(*(self._ffi.addressof(m, name) for name in ("given", "curve")))

    def _set_joints(self):
        """Tools that part the string: the pairs of forces, whose signals follow those of the top."""
        m, joints = self._m, self._chain.joints
        if len(joints) > self._lib.MOST_PAIRS:
            refuse("DrillString", "components", len(joints), f"at most {self._lib.MOST_PAIRS} tools that part it")
        m.pairs = len(joints)
        motors = [(p, end + 1, joint.tool) for p, (end, _, joint) in enumerate(joints) if joint.turns]
        m.shown = len(motors) if len(motors) > 1 else 0
        self._of_motors = [self._put_curve(m.drives[p], motor) for p, _, motor in motors]
        for _, node, motor in motors[:-1]:  # the lowest one's rotor is a part of the bit's inertia
            self._kept["mass"][node, -1] += motor.rotor_inertia
        for name, values in (("pair", [x[0] for x in joints]), ("pair_dof", [x[1] for x in joints])):
            self._array(m, name, np.array(values, dtype=np.int32))
        for name in ("damping", "lost"):
            name_in_c = "pair_slope" if name == "damping" else "pair_lost"
            self._array(m, name_in_c, np.array([getattr(joint, name) for *_, joint in joints], dtype=float))
        self._signals += [joint.force for *_, joint in joints]
        self._varying = [(p, joint.force) for p, (*_, joint) in enumerate(joints) if not joint.force.constant]
        self._rotors = [(p, joint) for p, (*_, joint) in enumerate(joints) if joint.turns]

    def _set_hook(self, hook):
        top, elastic = self._m.top[0], math.isfinite(hook.stiffness)
        top.rigid = not elastic and not follows_the_bit(self.scene)
        top.integral = hook.stiffness if elastic else 0.0
        return hook.signal()

    def _set_drive(self, drive):
        top = self._m.top[self._dofs - 1]
        top.inertia = drive.inertia
        self._kept["mass"][0, -1] += drive.inertia
        if drive.control.sampled:
            top.rigid = drive.control.of_speed
        else:
            top.rigid, top.given, top.proportional, top.integral, self._space = self._gains
            if self._space is not None:
                top.rigid = self._space.of_speed and drive.control.late > 0
                self._set_linear(self._m.control, drive, self._space, None)
        return drive.signal()

    # -- the start -----------------------------------------------------------------------------------------------------

    def _start(self):
        """The state at the time 0, and the end condition of the bit."""
        scene, axial, motion = self.scene, self._axial, np.zeros(2)
        self._set_end(motion)
        if scene.start == "steady":
            check_steady(scene)
            if axial:
                check_rock(scene)
            motion[:] = axial * steady_velocities(scene)[0], steady_speed_of_bit(scene)
            self._set_steady(motion)
            self._set_end(motion)

    def _sample(self):
        """Take samples for the controls of the drive and the hook."""
        turning, drive = self._dofs - 1, self.scene.drive
        top = self._m.top[turning]
        self._sample_torque(drive, top, float(self._kept["v"][0, -1]) if top.rigid else top.force)
        if top.rigid and drive.control.sampled:
            self._signals[turning] = self._samplers["drive"]
        hook = self.scene.hook
        if self._axial and hook is not None and hook.autodriller is not None:
            down = float(self._kept["v"][0, 0])
            self._samplers["hook"] = Sampler(
                hook.autodriller, "speed", self.dt, ScalarSignal(hook, "speed", 0.0, "m/s"), down
            )
            self._signals[0] = self._samplers["hook"]

    def _set_end(self, motion):
        """The memory of the bit's law, from the state now."""
        bit, axial = self.scene.bit, self._axial
        self.end = self._given_end
        if self.end is None and bit is not None and axial:
            self.end = bit.law.end(bit.weight or 0.0, self._kept["x"][-1], motion)
        elif bit is not None and bit.law.drills and not axial:
            refuse("BitOnRock", "law", bit.law, "a Stribeck or another law of the torque over the speed, for torsion "
                   f"alone: {bit.law.lifts}; model='axial and torsional'")  # fmt: skip

    def _set_steady(self, motion):
        """A steady start, see `steady_start`."""
        m, kept, unknowns, chain = self._m, self._kept, slice(2 - self._dofs, 2), self._chain
        ends = [end + 1 for end, _, joint in chain.joints if joint.turns]
        part = np.searchsorted(ends, np.arange(m.nodes), side="right")
        turning = float(steady_velocities(self.scene)[1])

        def limits(x):
            kept["x"][:] = x
            if not m.fixed:
                self._lib.limits(m)
            return kept["limit"]

        def found(down):
            of_bit = steady_speed_of_bit(self.scene, down if self._axial else None)

            def taken(motor, speeds):  # by the wall, too; with the part above at the same speed its damper is still
                speeds = np.where(np.arange(len(speeds)) > motor, speeds, speeds[motor + 1])
                return at(down, speeds, False)[3][ends[motor], -1]

            bears, velocities, x, below = at(
                down, speeds_of_parts(self.scene.motors, taken, turning, of_bit, _SPEEDS), True
            )
            return bears, velocities, x, below[0]

        def at(down, speeds, driven):
            bit = self.scene.bit
            motion[:] = down, speeds[-1]
            velocities = np.column_stack([np.full(m.nodes, down), speeds[part]])
            bears = np.zeros(2) if bit is None else bit.law.steady_forces(bit.resting or 0.0, motion)
            extra = (bears - [m.bit.hanging, 0.0])[unknowns]
            friction = self._wall, m.of_rotation
            rates = iter(np.diff(speeds))
            pairs = [(*place, joint.steady(next(rates) if joint.turns else 0.0)) for *place, joint in chain.joints
                     if driven or not joint.turns]  # fmt: skip
            return bears, velocities, *steady_state(velocities[:, unknowns], chain, limits, friction, extra, pairs)

        if self._axial and follows_the_bit(
            self.scene
        ):  # friction and drag of the string take a part of the weight on bit
            most = motion[0]
            motion[0] = brentq(lambda down: found(down)[3][0], 1e-9 * most, most * (1 + 1e-9), xtol=1e-15 * most)
        bears, velocities, x, above = found(motion[0])
        kept["x"][:], kept["v"][:], kept["w"][:], kept["held"][:] = x, *[velocities[:, unknowns]] * 2, 0
        m.bit.weight, m.bit.torque = m.bit.recorded = bears.tolist()
        for i, force in enumerate(above):
            top = m.top[i]
            top.force = force
            if not top.rigid and top.integral:
                top.error = force / top.integral
        if m.control.used:
            self._settle_linear(m.control, self.scene.drive, self._space, above[-1])

    # -- the protocol of string models ---------------------------------------------------------------------------------

    @property
    def counts(self) -> dict[str, int]:
        """Steps that were halved, iterations of Newton's method, and most of them in a step."""
        return {"halved": self._m.halved, "iterations": self._m.iterations, "most_iterations": self._m.most}

    def _seen(self):
        v, x, top = self._kept["v"][0], self._kept["x"][0], self._m.top
        axial = ()
        if self._axial:
            axial = self._m.hanging_top - top[0].force, static_weight(self.scene) + top[0].force, float(v[0])
        return Sample(self.time, 0.0, float(v[-1]), float(x[-1]), self._top.force, *axial)

    def _record(self, steps, rows):
        parts, start = intervals(self._signals, (self.steps, self.steps + steps), self.dt), self.steps
        if self._axial and "hook" not in self._samplers:
            parts[:, [1, 1 + len(self._signals)]] *= -1  # the hook's speed is positive upwards
        weights = self._weights(self.steps, steps)
        begin = [] if not self._varying else self._begin(parts)
        for p, force in self._varying:  # of forces the means, as they oscillate
            for column in (1 + self._dofs + p, 1 + self._dofs + p + len(self._signals)):
                parts[:, column] = _means(force, begin, parts)
        self._of_intervals = [
            (p, *self._put_curves(joint.tool, () if joint.force.constant else _means(joint.force.flow, begin, parts)))
            for p, joint in self._rotors
        ]
        for k, part in enumerate([parts] if self.end is None else parts[:, None]):
            for p, curves, _ in self._of_intervals:
                self._m.over[p] = curves + k if curves else curves
            if self.end is not None:
                self._take(self.end.begin(self, part[0, 0]))
            cast, out = self._ffi.cast, rows[self.steps - start :]
            now = weights + (self.steps - start) if weights else weights
            done = self._lib.advance_elements(
                self._m, len(part), cast("double *", part.ctypes.data), now, cast("double *", out.ctypes.data)
            )
            self.steps += int(part[:done, -1].sum())
            if done < len(part):
                return
            if self.end is not None:
                self.end.commit(self, part[0, 0])

    def _begin(self, parts):
        """Times at which the parts of steps begin, the same in whichever chunk they are done."""
        ends = parts[:-1, -1] == 1
        begin = (self.steps + np.cumsum([0, *ends])) * self.dt
        for k in np.flatnonzero(~ends):
            begin[k + 1] = begin[k] + parts[k, 0]
        return begin

    def _take(self, given):
        """The `EndForce` of the coming step."""
        bit = self._m.bit
        bit.force, bit.tangent, bit.flat = list(given.force), np.ravel(given.tangent).tolist(), given.flats
        if given.torque is not None:
            bit.law, bit.given.still, bit.given.slipping = given.torque > 0, given.torque, given.torque
        if given.rock is not None:
            bit.rock, (bit.floor, bit.sinking) = 1, given.rock

    def bit_state(self) -> np.ndarray:
        """(2, 2) place (m downwards, rad) and velocity of the bit at the end of the last step."""
        x, v = self._kept["x"][-1].tolist(), self._kept["v"][-1].tolist()
        unknown = [np.nan] * (2 - self._dofs)
        return np.array([unknown + x, unknown + v])

    @property
    def weight_on_bit(self) -> float:
        """In the last step, N, without the impulse of an impact on rigid rock."""
        return self._m.bit.recorded[0]

    def profile(self) -> np.ndarray:
        # the node of the bit sticks where the rock holds it
        m, n, kept = self._m, self._dofs, self._kept
        x, v = kept["x"], kept["v" if m.at_end else "w"]
        forces = np.diff(x, axis=0) * kept["spring"]
        for p, (end, d, joint) in enumerate(self._chain.joints):
            forces[end, d] += joint.damping * (kept["w"][end + 1, d] - kept["w"][end, d]) - m.applied[p]
        at = np.concatenate([forces[:1], (forces[:-1] + forces[1:]) / 2, forces[-1:]])
        torque, nothing = -at[:, -1], np.full(m.nodes, np.nan)
        torque[[0, -1]] = m.top[n - 1].force, m.bit.recorded[1]
        sticking = (kept["held"] & 2) / 2
        if not self._axial:
            return np.array([x[:, -1], v[:, -1], torque, nothing, nothing, nothing, sticking])
        hanging = kept["hanging"]
        tension = at[:, 0] + np.concatenate([hanging[:1], (hanging[:-1] + hanging[1:]) / 2, hanging[-1:]])
        tension[[0, -1]] = m.hanging_top - m.top[0].force, -m.bit.recorded[0]
        return np.array([x[:, 1], v[:, 1], torque, x[:, 0], v[:, 0], tension, sticking])

    def memory(self) -> dict:
        m = self._m
        found = super().memory()
        found["sums"] = np.array([getattr(m.sums, name) for name in _SUMS])
        found["ends"] = np.array([*((m.top[i].error, m.top[i].force) for i in (0, 1))]).ravel()
        found["bit"] = np.array([*(getattr(m.bit, name) for name in _BIT), *m.bit.recorded])
        found["counts"] = np.array([self.steps, m.halved, m.iterations, m.most])
        if self.end is not None and (memory := self.end.memory()):
            found["end"] = memory
        return found

    def recall(self, memory: dict) -> None:
        super().recall(memory)
        m = self._m
        for name, value in zip(_SUMS, memory["sums"], strict=True):
            setattr(m.sums, name, value)
        for i, (error, force) in enumerate(np.reshape(memory["ends"], (2, 2))):
            m.top[i].error, m.top[i].force = error, force
        for name, value in zip(_BIT, memory["bit"], strict=False):
            setattr(m.bit, name, value)
        m.bit.recorded = memory["bit"][len(_BIT) :].tolist()
        self.steps, m.halved, m.iterations, m.most = (int(x) for x in memory["counts"])
        if "end" in memory:
            self.end.recall(memory["end"])

    def _reasons(self):
        """Sentences on mesh, step, start and approximations."""
        scene, bit, wall = self.scene, self.scene.bit, self._m.pieces > 0
        yield f"{len(self.depths) - 1} elements, steps of {self.dt:.3g} s"
        drive = scene.drive
        if scene.start == "rest" and not scene.discs and drive.imposes_speed and drive.signal()(0.0) != 0:
            yield ("APPROXIMATE: a drive that has its speed at once sends a jump down the string, which oscillates "
                   "over some elements: peaks of torque may be a fifth too large, beyond `errors`; a Ramp of the "
                   "speed or an inertia of the drive avoids it")  # fmt: skip
        law = bit and bit.law.resistance(bit.most)
        if law is not None and law.steepest > 0 and scene.bit_inertia == 0 and not self._m.top[-1 + self._dofs].rigid:
            if drive.inertia == 0 and not scene.discs:
                yield ("APPROXIMATE: a torque that falls with the speed of a bit without inertia amplifies waves, and "
                       "those as short as an element are not absorbed by the drive, which absorbs longer ones: they "
                       "may grow, beyond `errors`; BitOnRock.inertia (kg m^2), or model='torsion'")  # fmt: skip
        if not self._axial:
            if wall:
                yield "friction at the wall by the tension at rest"
            return
        if wall:
            yield ("friction at the wall against axial and rotary slip together, normal force by the soft string from "
                   "the tension of the step before")  # fmt: skip
        if scene.start == "steady":
            yield "starts in steady motion, all of it at the speeds of drive and hook"
        elif bit is not None and bit.weight is not None:
            yield f"starts with {bit.weight:g} N on bit, without friction"
        else:
            yield "starts hanging off bottom, without friction"
        if bit is not None and bit.weight is not None and not bit.law.drills:
            yield from _of_rock(scene, self.depths, self.dt)
        elif bit is not None and bit.law.drills and not scene.discs and unresolved(scene, self.depths, self.dt):
            yield unresolved(scene, self.depths, self.dt)
        if follows_the_bit(scene):
            yield "without a Hook its load stays the same: the string follows the bit that drills"


def _means(signal, begin, parts):
    """Means of a signal over parts of steps, rows of which the first number is a length, s, and that begin at times."""
    return [signal.mean(t, t + length) for t, length in zip(begin, parts[:, 0], strict=True)]


def _of_rock(scene, depths, dt):
    """Sentences on the rock that a bit stands on."""
    if math.isinf(scene.bit.rock_stiffness):
        yield ("the rock does not give way: a bit that comes down on it is stopped by an impulse, which "
               "history.impulse_on_bit tells (N s) and weight_on_bit leaves out; with BitOnRock.rock_stiffness it is "
               "a force")  # fmt: skip
        return
    yield f"the rock below the bit is a spring of {scene.bit.rock_stiffness:.4g} N/m"
    approximate = unresolved(scene, depths, dt)
    if approximate:
        yield approximate
