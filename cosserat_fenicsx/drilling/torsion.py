"""Torsion alone of a string in its hole, by its waves.

In a uniform part with the impedance Z the waves P = M + Z om and Q = M - Z om travel unchanged, P down and Q up (M
torque, om speed of rotation). All cells take one step dt, in which every wave is constant: a cell holds one of each. At
a node the waves P from above and Q from below meet its drag, friction and inertia, with the mean speed om over the
step:

    P - Q - (Z_above + Z_below) om = drag om + T(om) + I om',    T(om) the law of friction of wall or bit

which is one equation with one answer where the slope of T is nowhere steeper than the impedances; drive and bit have
inertias, by the implicit midpoint rule. Waves, inertias and works fulfil the balance of energy to rounding. Cells are
exact; drag and friction are gathered at nodes, of the second order in dt where nothing begins to stick or to slip.
Waves of even and of odd steps meet at inertias alone: recorded speeds and torques are means over two steps.

The cells: every one is passed by waves in the same time, a step. A uniform part of the travel time t and the impedance
Z has the inertia Z t and the compliance t/Z. Parts that are too short for a cell are joined with a piece of their
neighbour to a uniform part of the same inertia and compliance. Where a travel time is no whole number of steps, one
cell of the part is longer, by the all-pass filter of first order whose delay is exact at low frequencies: J. P. Thiran,
IEEE Trans. Circuit Theory 18 (1971) 659, doi:10.1109/TCT.1971.1083363. It keeps energy, and the error of its travel
time is at most 0.16 dt (omega dt)^2.
"""

import math
from collections import namedtuple
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import instance, positive, refuse
from cosserat_fenicsx.drilling.laws import InC, check_bit
from cosserat_fenicsx.drilling.linear_control import step_for
from cosserat_fenicsx.drilling.protocol import (
    PROFILE,
    StringModel,
    check_steady,
    steady_speed_of_bit,
    steady_velocities,
)
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.drilling.signals import means
from cosserat_fenicsx.drilling.top_drive import Sample, divided
from cosserat_fenicsx.drilling.wall_friction import law_of, loads_between, scene_pieces, wall_of
from cosserat_fenicsx.well.components import DrillString


@dataclass(frozen=True)
class _Settings:
    """Settings of cells and steps of torsional waves."""

    exact: float = 1e-9  # misfit of a travel time to whole steps that is rounding, steps
    misfit: float = 0.01  # misfit that is reported, steps
    shortest: float = 1.5  # travel time of a part with its own cells, steps
    least_step: float = 0.75  # shortest step tried so that travel times fit, over the given one
    narrower: float = 0.9  # step over the longest one for which a law of friction has one answer
    cells: int = 300  # default number
    fewest: int = 40
    length: float = 5.0  # least length of a cell by default, m
    most: float = 1e5  # cells


_SET = _Settings()
#: A uniform part: travel time (s), impedance (N m s/rad), measured depths of its ends (m).
Part = namedtuple("Part", "time impedance top bottom")
#: dt: s. depths: (n + 1,) of the nodes, m. impedance, time: (n,) of the cells. turn: (n,) coefficients of the filters,
#: 0 where there is none. joined: number of parts that were too short. unfit: largest misfit of a travel time, steps.
Cells = namedtuple("Cells", "dt depths impedance time turn joined unfit")


def cells_of(segments, dt, period=None):
    """The `Cells` of `Segment`s for a step of dt (s), or the next shorter one that fits times and period (s) better."""
    parts, top = [], 0.0
    for segment in segments:
        bottom = top + segment.length
        part = Part(segment.length / segment.torsional_speed, segment.torsional_impedance, top, bottom)
        same = parts and math.isclose(parts[-1].impedance, part.impedance, rel_tol=1e-12)
        speeds = [(x.bottom - x.top) / x.time for x in (parts[-1], part)] if same else [0.0, 1.0]
        if math.isclose(*speeds, rel_tol=1e-12):
            part = Part(parts[-1].time + part.time, part.impedance, parts.pop().top, bottom)
        parts.append(part)
        top = bottom
    dt = min(dt, math.fsum(part.time for part in parts) / 4)
    dt = _step([part.time for part in parts], dt, period)
    parts, joined = _long_enough(parts, dt)
    depths, impedance, time, turn = [0.0], [], [], []
    unfit = 0.0
    for part in parts:
        delays, coefficient = _delays(part.time / dt)
        unfit = max(unfit, abs(part.time / dt - round(part.time / dt)))
        ends = part.top + (part.bottom - part.top) * np.cumsum(delays) / math.fsum(delays)
        depths.extend(ends[:-1].tolist() + [part.bottom])
        impedance.extend([part.impedance] * len(delays))
        time.extend(delays * dt)
        turn.extend(np.where(delays == delays.max(), coefficient, 0.0))
    return Cells(dt, *(np.array(x) for x in (depths, impedance, time, turn)), joined, unfit)


def _delays(steps):
    """Travel times of the cells of a part, in steps, and the coefficient of the filter of the longest one."""
    whole = round(steps)
    if abs(steps - whole) <= _SET.exact * max(1.0, steps):
        return np.ones(whole), 0.0
    short = math.floor(steps - _SET.shortest)
    delays, extra = np.ones(short + 1), steps - short - 1
    delays[short // 2] += extra
    return delays, (1 - extra) / (1 + extra)


def _step(times, dt, period=None):
    """The step from 0.75 dt to dt that best divides travel times (s), and the period (s) if there is one."""
    times = np.array([time for time in times if time >= _SET.shortest * dt])
    tried = [dt] if period is None else [period / math.ceil(period / dt * (1 - 1e-12))]
    for time in times if period is None else [period]:
        tried.append(
            time / np.arange(math.ceil(time / dt * (1 - 1e-12)), math.floor(time / (_SET.least_step * dt)) + 1)
        )
    tried = np.unique(np.concatenate([np.atleast_1d(x) for x in tried]))[::-1]
    steps = times[:, None] / tried
    off = np.abs(steps - np.round(steps)).max(axis=0, initial=0.0)  # of none where all are short
    return float(tried[np.argmax(off <= max(off.min(), _SET.exact) * (1 + 1e-6))])


def _fits(part, dt):
    steps = part.time / dt
    return steps >= _SET.shortest or abs(steps - 1) <= _SET.exact


def _joined(a, b):
    """The uniform part with the inertia and the compliance of two that follow each other."""
    inertia, compliance = a.impedance * a.time + b.impedance * b.time, a.time / a.impedance + b.time / b.impedance
    return Part(math.sqrt(inertia * compliance), math.sqrt(inertia / compliance), a.top, b.bottom)


def _cut(part, time, above):
    """A part in two, the upper one first; `time` is the travel time of one of them, `above` whether of the upper."""
    upper = time if above else part.time - time
    middle = part.top + (part.bottom - part.top) * upper / part.time
    return part._replace(time=upper, bottom=middle), part._replace(time=part.time - upper, top=middle)


def _long_enough(parts, dt):
    """Parts of which each has room for a cell, and how many had not."""
    parts, short = list(parts), sum(not _fits(part, dt) for part in parts)
    while len(parts) > 1 and (i := next((i for i, part in enumerate(parts) if not _fits(part, dt)), -1)) >= 0:
        j = max((j for j in (i - 1, i + 1) if 0 <= j < len(parts)), key=lambda j: parts[j].time)
        small, large = parts[i], parts[j]
        # a piece of the time x of the large part makes inertia times compliance (2 dt)^2
        half = (small.impedance / large.impedance + large.impedance / small.impedance) * small.time / 2
        x = math.sqrt(half**2 + 4 * dt**2 - small.time**2) - half
        left = Part(large.time - x, large.impedance, 0.0, 0.0)
        if not 0 < x < large.time or not _fits(left, dt):
            parts[min(i, j) : max(i, j) + 1] = [_joined(*parts[min(i, j) : max(i, j) + 1])]
        elif j > i:
            near, far = _cut(large, x, above=True)
            parts[i : j + 1] = [_joined(small, near), far]
        else:
            far, near = _cut(large, x, above=False)
            parts[j : i + 1] = [far, _joined(near, small)]
    return parts, short


# Numbers of C that change in a step.
_NUMBERS = ("bit_angle", "turned", "last_turned", "tools", "drive_speed", "integral", "bit_speed", "last_on_bit",
            "work", "at_bit", "at_wall", "in_mud", "iterations")  # fmt: skip


class TorsionWaves(StringModel):
    """Torsion alone of a `Drilling`.

    Recorded speeds and torques are means over the last two steps, except speeds of drives and bits with inertia.

    Args:
        scene: a `Drilling` with a `DrillString`; the bit's law one of the torque over the speed; of `Lobes` it takes
            the torque.
        dt: longest step, s; None for 300 cells. From three quarters of it on, the step is used for which the travel
            times of the parts are nearest to whole numbers of steps; a shorter one where a law of friction needs it.
        elements: least number of cells, or None.
        normal_force: function of measured depths (m) that gives the wall force per length (N/m), in place of the soft
            string without axial motion.

    Raises:
        SceneError: a scene that needs more than torsion, or a law of the bit that is steeper than the impedance of the
            string where the bit has no inertia.
    """

    name, _failure = "torsion", "a number was not finite at t = {time:.6g} s"
    _changing = ("down", "up", "down_kept", "up_kept", "speed", "angle", "torque", "moment", "last_speed",
                 "last_moment")  # fmt: skip

    def __init__(self, scene, dt=None, elements=None, *, normal_force=None):
        super().__init__()
        _check(scene)
        self.scene, self.normal_force = scene, normal_force
        self._law = None if scene.bit is None else scene.bit.law.resistance(scene.bit.most)
        self._wall = law_of(scene.friction)[0]
        _, drag = scene.drag_rates
        self._parts = scene.segments[: len(scene.segments) - len(scene.turned)]
        time = math.fsum(x.length / x.torsional_speed for x in self._parts)
        if dt is not None:
            dt = positive("TorsionWaves", "dt", dt, "s")
        if elements is not None:
            dt = min(time / positive("TorsionWaves", "elements", elements, "cells"), dt or math.inf)
        given = dt is not None
        asked = dt = dt or time / min(max(scene.bit_depth / _SET.length, _SET.fewest), _SET.cells)
        period = divided(scene.drive.control, dt, given)
        dt = min(dt, period / 2) if period else dt
        if self._gains and not given:
            dt = step_for(self._gains, dt)
        if time / dt > _SET.most:
            refuse(
                "TorsionWaves", "dt", dt, f"at least {1 / _SET.most:g} of the travel time of the string, {time:.4g} s"
            )
        factor, at_bit = 1.0, False
        while factor >= 1:
            if time / dt > _SET.most:
                if at_bit:
                    refuse("BitOnRock", "law", scene.bit.law, "a torque that falls more slowly with the speed, or a "
                           f"larger inertia of the bit than {scene.bit.inertia:g} kg m^2: with {_SET.most:g} cells the "
                           "speed of the bit is not determined")  # fmt: skip
                refuse("Drilling", "friction", scene.friction, "a friction that decays more slowly with the "
                       f"speed: with {_SET.most:g} cells the speed at every place is not determined")  # fmt: skip
            self.cells = cells = cells_of(self._parts, dt, period)
            self._set_nodes(drag)
            factor, at_bit = self._steepness()
            dt = cells.dt * min(_SET.narrower / factor if factor else 1.0, _SET.narrower)
        self.dt, self.depths = cells.dt, cells.depths
        self._signal = scene.drive.signal()
        self._driven = next((x.force for x in scene.joints if x.turns), None)
        self.why = tuple(self._reasons(asked))
        self._allocate()
        if scene.start == "steady":
            check_steady(scene)
            self._set_steady(float(steady_velocities(scene)[1]), steady_speed_of_bit(scene))
        else:
            self._sample_torque(scene.drive, self.c)

    def _set_nodes(self, drag):
        """Impedances beside nodes, drag and friction at nodes."""
        Z, half = self.cells.impedance, self.cells.impedance * self.cells.time / 2
        self._above, self._below = np.concatenate([[0.0], Z]), np.concatenate([Z, [0.0]])
        self._drag = drag * (np.concatenate([[0.0], half]) + np.concatenate([half, [0.0]]))
        self._grip, self._reach = wall_of(self.scene, self.cells.depths, self.normal_force)
        wall = self._wall
        self._hold, self._slide = wall.still * self._grip, wall.slipping * self._grip
        self._decay = np.where(self._grip > 0, wall.decay / self._reach, 0.0)
        if self._law is not None:
            self._hold[-1], self._slide[-1], self._decay[-1] = self._law.still, self._law.slipping, self._law.decay

    def _steepness(self):
        """The largest slope of a law of friction over its node's impedance, without jumps; whether it is the bit's."""
        slope = self._wall.steepest * self._grip * self._reach
        if self._law is not None:
            slope[-1] = self._law.steepest
        impedance = self._above + self._below + self._drag
        if self.scene.motor is not None:
            c = self.scene.motor.least_slope
            impedance[-1] *= c / (impedance[-1] + c)
        if self.scene.bit is not None:
            impedance[-1] += 2 * self._bit_inertia / self.cells.dt
        steep = slope / impedance
        return steep.max(), self.scene.bit is not None and int(steep.argmax()) == len(steep) - 1

    @property
    def _bit_inertia(self):
        """Of bit, rotor, and the parts below a motor, which turn as one body, kg m^2."""
        return self.scene.bit_inertia + self.scene.turned_inertia

    def _reasons(self, asked):
        cells, scene = self.cells, self.scene
        yield (
            f"torsion alone, by waves in {len(cells.time)} cells of {np.diff(cells.depths).max():.3g} m at most, "
            f"dt = {cells.dt:.4g} s"
        )
        if cells.joined:
            yield (
                f"{cells.joined} part{' is' if cells.joined == 1 else 's are'} shorter than 1.5 cells, and joined with "
                "pieces of the neighbours, with the same inertia and compliance"
            )
        if cells.unfit > _SET.misfit:
            yield (
                f"travel times of parts differ from whole numbers of steps by up to {cells.unfit:.2g} steps: the rest "
                "is made up by filters that are exact for slow waves; jumps are smeared over some steps"
            )
        if cells.dt < asked / 2:
            yield f"dt is less than the {asked:.4g} s asked for, or the law of friction would have several answers"
        if scene.motor is not None:
            yield f"what is below {scene.motor.name} turns as one body of {self._bit_inertia:.4g} kg m^2"
            yield from self._off_the_wall()
        if scene.start == "steady":
            yield "starts in steady rotation at the speed of the drive"
        if scene.hole is not None and self.normal_force is None:
            yield "wall force of the soft string without axial motion: tension by the weight alone"
        if scene.hook is not None and (scene.hook.speed != 0 or math.isfinite(scene.hook.stiffness)):
            yield "the hook is left out: torsion alone knows no axial motion"

    def _off_the_wall(self):
        """A sentence on the friction of the wall on what is below a motor, which is left out."""
        scene, top = self.scene, self.depths[-1]
        if scene.hole is None or not scene.turned:
            return
        pieces = scene_pieces(scene)
        cuts = np.append(top, pieces.bottom[pieces.bottom > top * (1 + 1e-9)])
        _, load, radius = loads_between(scene, pieces, cuts, self.normal_force)
        if (torque := self._wall.kinetic * float(load @ radius)) > 0:
            yield (
                f"APPROXIMATE: the friction of the wall on what is below {scene.motor.name}, about {torque:.3g} N m, "
                "is left out; the axial and torsional model has it"
            )

    def _allocate(self):
        cells, scene, n = self.cells, self.scene, len(self.cells.time)
        filtered = np.flatnonzero(cells.time > 1.25 * cells.dt).astype(np.int32)
        self.c = c = self._ffi.new("waves *")
        c.cells, c.filters, c.dt = n, len(filtered), self.dt
        for name, array in (
            ("filtered", filtered), ("above", self._above), ("below", self._below), ("turn", cells.turn[filtered]),
            ("share", self.dt / (4 * cells.impedance)), ("drag", self._drag), ("hold", self._hold),
            ("slide", self._slide), ("decay", self._decay), ("grip", self._grip), ("reach", self._reach),
        ):  # fmt: skip
            self._array(c, name, array)
        sizes = {"down": n, "up": n, "down_kept": len(filtered), "up_kept": len(filtered)}
        for name in self._changing:
            self._array(c, name, np.zeros(sizes.get(name, n + 1)))
        drive, bit = scene.drive, scene.bit
        c.bit, c.drive_inertia = bit is not None, drive.inertia
        if drive.control.sampled:
            c.stiff = drive.control.of_speed
        else:
            c.stiff, c.given, c.Kp, c.Ki, linear = self._gains
            if linear is not None:
                c.stiff = linear.of_speed and drive.control.late > 0
                self._set_linear(c.control, drive, linear, scene.segments[0].torsional_impedance)
        c.bit_inertia = self._bit_inertia
        if scene.motor is not None:
            c.slope, c.lost = scene.motor.slope, scene.motor.lost_torque
            self._of_motor = self._put_curve(c.motor, scene.motor)
            c.dragged = scene.drag_rates[1] * scene.turned_inertia
        self._laws = [InC(self._ffi, self._wall)]
        self._laws[0].fill(c.wall)
        if self._law is not None and self._law.function is not None:
            self._laws.append(InC(self._ffi, self._law, *bit.law.in_c(bit.most)))
            self._laws[1].fill(c.rock)
            c.load = bit.resting or 0.0
        elif self._law is not None and bit.varies:
            c.per_weight = [self._law.still / bit.most, self._law.slipping / bit.most]

    def _set_steady(self, speed, of_bit):
        """A steady start at the speeds (rad/s) of drive and bit, twisted by friction and drag."""
        cells, now, c = self.cells, self._kept, self.c
        law = np.where(self._hold > 0, self._grip * self._wall(speed * self._reach), 0.0)
        if self._law is not None:
            law[-1] = self.scene.bit.law.resistance(self.scene.bit.resting)(of_bit)
        resisting = law + self._drag * speed
        resisting[-1] += c.dragged * of_bit
        above = np.cumsum(resisting[::-1])[::-1]  # handed down to the nodes
        torque, Z = above[1:], cells.impedance
        now["down"][:], now["up"][:] = torque + Z * speed, torque - Z * speed
        filtered = now["filtered"]
        kept = np.sqrt((1 - cells.turn) / (1 + cells.turn))[filtered]  # of what passes a filter unchanged
        now["down_kept"][:], now["up_kept"][:] = kept * now["down"][filtered], kept * now["up"][filtered]
        now["speed"][:] = now["last_speed"][:] = speed
        now["torque"][:], now["moment"][:], now["last_moment"][:] = law, above, above
        now["angle"][1:] = -np.cumsum(torque * cells.time / Z)
        c.drive_speed, c.bit_speed, c.bit_angle = speed, of_bit, now["angle"][-1]
        c.turned = c.last_turned = of_bit - speed
        c.last_on_bit = law[-1]
        c.integral = above[0] / c.Ki if c.Ki else 0.0
        if c.control.used:
            self._settle_linear(c.control, self.scene.drive, self._gains.linear, float(above[0]))
        self._sample_torque(self.scene.drive, c, speed if c.stiff else above[0])

    @property
    def counts(self):
        """Iterations of Newton's method, of all nodes together; no step is ever halved."""
        return {"halved": 0, "iterations": int(self.c.iterations)}

    def _seen(self):
        now = self._kept
        return Sample(self.time, 0.0, self.c.drive_speed, float(now["angle"][0]), float(now["moment"][0]))

    def _record(self, steps, rows):
        dt, buffer = self.dt, self._ffi.from_buffer
        signal = self._samplers["drive"] if self.scene.drive.control.sampled and self.c.stiff else self._signal
        speeds = means(signal, self.steps, steps, dt)
        if self._driven is not None:
            driven = means(self._driven, self.steps, steps, dt)
            self.c.driven = buffer("double[]", driven)
            flows = () if self._driven.constant else means(self._driven.flow, self.steps, steps, dt)
            self.c.motors, _ = self._of_steps = self._put_curves(self.scene.motor, flows)  # which C does not own
        rows = buffer("double[]", rows, require_writable=True)
        self.steps += self._lib.advance_waves(
            self.c, steps, buffer("double[]", speeds), self._weights(self.steps, steps), rows
        )

    def profile(self) -> np.ndarray:
        # speeds and torques are means over the last two steps; a bit that sticks counts, too
        found = np.full((len(PROFILE), len(self.depths)), np.nan)
        now = self._kept
        speed, torque = ((now[f"last_{name}"] + now[name]) / 2 for name in ("speed", "moment"))
        sticking = (self._hold > 0) & (now["last_speed"] == 0) & (now["speed"] == 0)
        if self._driven is not None:
            sticking[-1] = self.c.bit_speed == 0
        for name, values in (("angle", now["angle"]), ("speed", speed), ("torque", torque), ("sticking", sticking)):
            found[PROFILE.index(name)] = values
        return found

    def memory(self) -> dict:
        numbers = {name: getattr(self.c, name) for name in _NUMBERS}
        return {"steps": self.steps} | numbers | super().memory()

    def recall(self, memory: dict) -> None:
        super().recall(memory)
        for name in _NUMBERS:
            setattr(self.c, name, memory[name])
        self.steps = int(memory["steps"])


def _check(scene):
    instance("TorsionWaves", "scene", scene, Drilling, "a Drilling")
    instance("TorsionWaves", "scene.string", scene.string, DrillString, "a DrillString; discs have no waves")
    if scene.bit is not None and scene.bit.law.drills:
        refuse("TorsionWaves", "scene.bit.law", scene.bit.law, "a Stribeck law, or another one of the torque over the "
               "speed: torsion alone has no depth of cut")  # fmt: skip
    if len(scene.motors) > 1:
        refuse("TorsionWaves", "scene.string", [x.name for x in scene.motors], "one MudMotor: AxialTorsional(scene, "
               "axial=False) has several")  # fmt: skip
    check_bit(scene)
