"""Tools in a string: a positive-displacement motor, with its power curve, and an oscillation tool.

A motor with the displacement V a revolution, v = V/(2 pi), whose seals leak by `leak` times the pressure p over it,
takes the flow Q at the speed om of its rotor against its housing, and hands the torque T down to the bit:

    Q = v om + leak p,     T = v p - T_lost,     so     T = v Q/leak - T_lost - c om,     c = v^2/leak.

The housing bears -T. For small motions about any speed the motor is a dashpot c between housing and bit. T_lost is the
friction of the rotor, against its rotation: it changes its sign with that of om, and holds the rotor where T is within
T_lost of v Q/leak. Above that the string turns the rotor backwards, and the motor pumps; without flow, too.

A maker's chart replaces the line by a `MotorCurve` at each of some flows: T + T_lost, over the speed, is a monotone
cubic through its points, and a straight line beyond them.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from scipy.interpolate import PchipInterpolator, PPoly
from scipy.optimize import brentq

from cosserat_fenicsx.checks import call, instance, number, refuse, store, warn
from cosserat_fenicsx.parts import (
    ForceSize,
    Frequency,
    InTime,
    Inertia,
    Length,
    Number,
    Part,
    Time,
    Torque,
    Values,
    at_least,
    positive,
)
from cosserat_fenicsx.pictures.charts import COLOURS, legend, scale, stacked, unit_of
from cosserat_fenicsx.quantities import Quantity, Units
from cosserat_fenicsx.results.result import Charted, by_name
from cosserat_fenicsx.results.screen import InWords
from cosserat_fenicsx.well.components import Collar, DrillString


# Inner diameter of a housing over the outer one, where it is not given.
_BORE = 0.6
# Laws of a motor at so many flows are kept.
_KEPT = 4096
# Larger ones than tools have: displacement a revolution (m^3), flow (m^3/s), stroke (m).
_MOST_A_TURN, _MOST_FLOW, _LONGEST_STROKE = 0.2, 0.2, 0.1
# Relative difference up to which flows are the same; time (s) up to which smooth ones are compared.
_SAME_FLOW, _MINUTE = 1e-3, 60.0


def _doubt_size(owner, field, value, most, unit, such):
    """Warn of a value above the most that tools have, which is probably in another unit; `such`: a text with one."""
    if value > most:
        warn(
            f"{type(owner).__name__}.{field} = {value:g} {unit} is more than tools have, {most:g} {unit} at most: "
            f"values in other units are texts, such as '{such}'"
        )


class _Tool(InWords, Collar):
    """Base of tools: components like collars, by their diameters."""

    _called = "tool"

    def _refuse_size_as_length(self):
        """There are no standard sizes: a text is a length."""

    def validate(self):
        """Refuse a size, and a tool that fills up to the surface; fill in the inner diameter."""
        name = type(self).__name__
        if self.size is not None:
            refuse(self, "size", self.size, f"outer_diameter= and inner_diameter= (m): there are no standard {name}s")
        if self.length is None:
            refuse(self, "length", None, f"a length (m): a {name} does not fill up to the surface")
        if self.inner_diameter is None and self.outer_diameter is not None:
            store(self, inner_diameter=_BORE * self.outer_diameter)
        super().validate()

    def sentences(self, units: Units):
        """On its sizes and on what it does, in some units."""
        yield from DrillString((self,)).sentences(units)
        yield self.sentence(units)


@dataclass(frozen=True)
class MotorCurve(Part):
    """The curve of a maker's chart for a motor at one flow, from no load to stall.

    Args:
        flow: m^3/s. speeds: of the rotor, rad/s, falling to 0, where the motor stalls.
        torques: on the bit at these speeds, N m, rising from 0.
        pressures: in place of the torques, Pa: over the motor, less the pressure without load, rising from 0; the
            torque is displacement/(2 pi) times them.

    Raises:
        SceneError: fewer than two points, speeds that do not fall to 0, others that do not rise from 0, or torques and
            pressures, or neither.
    """

    flow: Annotated[float, Number("flow", positive("the flow of a curve"))]
    speeds: Annotated[tuple[float, ...], Values(Number("angular velocity", at_least(0)))]
    torques: Annotated[tuple[float, ...], Values(Number("moment", at_least(0)))] | None = None
    pressures: Annotated[tuple[float, ...], Values(Number("pressure", at_least(0)))] | None = None

    def validate(self):
        """Refuse a table that is no curve from no load to stall."""
        if (self.torques is None) == (self.pressures is None):
            refuse(self, "torques", self.torques, "either torques (N m) or pressures (Pa), one for each speed")
        if len(self.speeds) < 2 or self.speeds[-1] != 0 or not (np.diff(self.speeds) < 0).all():
            refuse(self, "speeds", self.speeds, "two speeds or more (rad/s), which fall from that without load to 0, "
                   "where it stalls")  # fmt: skip
        name = "torques" if self.pressures is None else "pressures"
        load = getattr(self, name)
        if len(load) != len(self.speeds) or load[0] != 0 or not (np.diff(load) > 0).all():
            refuse(self, name, load, f"{len(self.speeds)} {name}, one for each speed, which rise from 0")


@dataclass(frozen=True, kw_only=True)
class MudMotor(_Tool):
    """A positive-displacement motor, which turns what is below it in the string against its housing.

    What is below it (its drive shaft, a `Bit`) and its rotor turn with the bit, all above with the string. Along the
    axis, and in torque and drag, it is a collar; `bend` is that of its housing.

    Args:
        length, outer_diameter, inner_diameter, mass, material, name, damping_time, bend, bend_at, tool_face: as of
            `Collar`, but inner_diameter None for 0.6 of the outer one.
        displacement: V, m^3 a revolution of the rotor against the housing.
        leakage: flow past the seals per pressure over the motor, m^3/(s Pa); None with curves.
        curves: a `MotorCurve` or several, of ascending flow, in place of the leakage: monotone cubics between their
            points; at flows between two curves by speeds and torques between theirs at the same share of the torque
            that stalls. The flow then stays within those of the curves.
        lost_torque: T_lost, N m, of the torque that the pressure makes; the torques of curves are those less it.
        flow: Q, m^3/s: a number, or a function of time, such as a `Table`, for `drilling.simulate`; 0 where the pumps
            stand: then friction holds the rotor up to T_lost, and beyond it turns and pumps, as without a valve.
        rotor_inertia: kg m^2, of rotor and drive shaft; None for a steel cylinder of half the inner diameter.

    Raises:
        SceneError: as of `Collar`; numbers that are not positive; a negative flow; leakage and curves, or neither; a
            flow outside those of the curves; a speed above that of the flow without any leakage. Sizes that no
            motor has, such as litres without their unit, are taken with a warning.
    """

    displacement: Annotated[float, Number("volume", positive("a displacement a revolution"))]
    leakage: Annotated[float, Number(limits=positive("a leakage (m^3/(s Pa)), about 1e-8"))] | None = None
    curves: tuple[MotorCurve, ...] = ()
    lost_torque: Annotated[Torque, at_least(0)] = 0.0
    flow: InTime[Annotated[float, Number("flow", at_least(0, "a flow through the motor"))]]
    rotor_inertia: Annotated[Inertia, positive()] | None = None

    _called = "mud motor"

    def validate(self):
        """Refuse a motor that has no torque; fill in the inertia of the rotor."""
        super().validate()
        _doubt_size(self, "displacement", self.displacement, _MOST_A_TURN, "m^3", "26.8 l")
        if self.rotor_inertia is None:
            density, radius = self.material.density, self.inner_diameter / 4
            store(self, rotor_inertia=density * math.pi / 2 * radius**4 * self.length)
        times = (0.0, *getattr(self.flow, "jumps", ()))
        flows = [self.flow_at(t) for t in times]
        _doubt_size(self, "flow", max(flows), _MOST_FLOW, "m^3/s", "2400 l/min")
        if (self.leakage is None) != bool(self.curves):
            refuse(self, "leakage", self.leakage, "either a leakage (m^3/(s Pa)), about 1e-8, or curves")
        if self.curves:
            self._check_curves(flows)

    def _check_curves(self, flows):
        known = [curve.flow for curve in self.curves]
        if not (np.diff(known) > 0).all():
            refuse(self, "curves", known, "one MotorCurve for each flow, of ascending flow (m^3/s)")
        for curve in self.curves:
            most = curve.flow / self.per_radian
            if curve.speeds[0] > most * (1 + 1e-6):
                refuse(self, "curves", curve.speeds[0], f"a speed without load of at most {most:.5g} rad/s, which "
                       f"{curve.flow:.4g} m^3/s give without any leakage: flow over displacement/(2 pi)")  # fmt: skip
        for flow in flows:
            self.law_at(flow)  # refuses a flow outside the curves

    @property
    def per_radian(self) -> float:
        """v, m^3/rad."""
        return self.displacement / (2 * math.pi)

    @property
    def slope(self) -> float:
        """c = v^2/leak, by which the torque falls with the speed, N m s/rad; of curves where they fall most."""
        return float(-self._slopes.min()) if self.curves else self.per_radian**2 / self.leakage

    @property
    def least_slope(self) -> float:
        """The same of curves where they fall least."""
        return float(max(-self._slopes.max(), 0.0)) if self.curves else self.slope

    def slope_at(self, speed: float) -> float:
        """The same at a speed of the rotor, rad/s."""
        return float(-self.law.derivative()(speed)) if self.curves else self.slope

    @property
    def law(self) -> PPoly | None:
        """T + T_lost of a motor with curves over the speed of its rotor, N m over rad/s, at its own flow at the start;
        or None."""
        return self.law_at(self.flow_at(0.0)) if self.curves else None

    @cached_property
    def _slopes(self):
        """The slopes of the law's cubics at their ends and extremes; of all curves where the flow changes."""
        flows, found = [x.flow for x in self.curves] if callable(self.flow) else [self.flow], []
        for law in map(self.law_at, flows):
            (a, b, c, _), width = law.c, np.diff(law.x)
            inside = np.clip(-b / np.where(a == 0, np.inf, 3 * a), 0, width)
            found += [(3 * a * x + 2 * b) * x + c for x in (0, inside, width)]
        return np.concatenate(found)

    @cached_property
    def _charts(self):
        """[(largest load, N m, speeds over the share of it)] of the curves."""
        loads = [np.array(x.torques or np.array(x.pressures) * self.per_radian) for x in self.curves]
        return [(load[-1], PchipInterpolator(load / load[-1], x.speeds))
                for x, load in zip(self.curves, loads, strict=True)]  # fmt: skip

    @cached_property
    def _laws(self):
        """{flow: `law_at` that flow}, of the last ones asked for."""
        return {}

    def law_at(self, flow: float) -> PPoly:
        """`law` at a flow, m^3/s, within those of the curves."""
        if flow not in self._laws:
            if len(self._laws) >= _KEPT:
                self._laws.clear()
            self._laws[flow] = self._law(flow)
        return self._laws[flow]

    def _law(self, flow):
        flows = [curve.flow for curve in self.curves]
        if not flows[0] * (1 - 1e-9) <= flow <= flows[-1] * (1 + 1e-9):
            refuse(
                self, "flow", flow, f"a flow of the curves, {flows[0]:.4g} to {flows[-1]:.4g} m^3/s, or further curves"
            )
        k = min(max(int(np.searchsorted(flows, flow)), 1), max(len(flows) - 1, 1))
        near = self._charts[k - 1 : k + 1]
        share = (flow - flows[k - 1]) / (flows[k] - flows[k - 1]) if len(near) > 1 else 0.0
        kept = [(part, *x) for part, x in zip((1 - share, share), near, strict=False) if abs(part) > 1e-9]
        at = np.unique(np.concatenate([speeds.x for *_, speeds in kept]).round(12))
        if len(kept) == 1:
            kept = [(1.0, *kept[0][1:])]
        torque = at * sum(part * most for part, most, _ in kept)
        speed = sum(part * speeds(at) for part, _, speeds in kept)
        om, T = speed[::-1], torque[::-1] + self.lost_torque
        ends = om[-1] * np.array([-1, 1])
        straight = [(T[1] - T[0]) / (om[1] - om[0]), (T[-1] - T[-2]) / (om[-1] - om[-2])]
        cubics = PchipInterpolator(om, T)
        left, right = (
            [[0], [0], [slope], [value]]
            for slope, value in zip(straight, (T[0] + straight[0] * ends[0], T[-1]), strict=True)
        )
        return PPoly(np.hstack([left, cubics.c, right]), np.concatenate([ends[:1], om, om[-1:] + ends[1:]]))

    def flow_at(self, t: float) -> float:
        """The flow at a time (s), m^3/s.

        Raises:
            SceneError: no number from 0 on.
        """
        flow, where = self.flow, " at t = {:g} s"
        if callable(flow):
            flow = np.ravel(call(flow, t, "MudMotor.flow", where)).tolist()
            flow = flow[0] if len(flow) == 1 else flow
        return number(self, "flow", flow, f"a flow (m^3/s){where.format(t)}, from 0 on", lambda x: 0 <= x < math.inf)

    def sentence(self, units: Units) -> str:
        """On its flow, speed and torque at the start, in some units."""
        flow = units.told(self.flow_at(0.0), "m^3/s", form=".4g", shown="l/min")
        speed = units.told(self.speed(0.0), "rad/s", form=".4g", shown="rpm")
        torque = units.told(self.stall_torque(), "N m", form=".4g", shown="kN m")
        if self.stall_torque() <= 0:
            return f"Tool, {self.name}: it stands at the start, with {flow}."
        return f"Tool, {self.name}: {flow} turn it at {speed} without load, it stalls at {torque}."

    def _flow(self, flow):
        return self.flow_at(0.0) if flow is None else flow

    def driven(self, flow: Any = None) -> Any:
        """The torque of the pressure on a rotor at rest, v Q/leak, N m; `flow` as of `stall_torque`."""
        return (
            self._by_flow(flow, lambda law: law(0.0))
            if self.curves
            else self.per_radian * self._flow(flow) / self.leakage
        )

    def _by_flow(self, flow, function, *values):
        """A function of the `law` at flows and of other values, for numbers and arrays."""
        flows, *values = np.broadcast_arrays(self._flow(flow), *values)
        found = np.empty(flows.shape)
        for one in np.unique(flows):
            law, at = self.law_at(one), flows == one
            found[at] = function(law, *(x[at] for x in values))
        return found if found.ndim else float(found)

    def torque(self, speed: float) -> float:
        """On the bit at a speed (rad/s) of the rotor, from 0 on, at its flow at the start, N m."""
        return float(self.law(speed) if self.curves else self.driven() - self.slope * speed) - self.lost_torque

    def stall_torque(self, flow: float | None = None) -> float:
        """The largest torque at which the motor turns, N m; below 0 where its flow does not turn it without load.

        Args:
            flow: m^3/s; None for its own, at the start.
        """
        return self.driven(flow) - self.lost_torque

    def speed(self, torque: Any, flow: float | None = None) -> Any:
        """Speed of the rotor against the housing, rad/s, under torques on the bit (N m, a number or an array); from the
        stall torque on 0 while friction holds it, and below 0 beyond. `flow` as of `stall_torque`."""
        if self.curves:
            return self._by_flow(flow, self._speed, torque)
        turns = self.driven(flow) - torque
        return (turns - np.clip(turns, -self.lost_torque, self.lost_torque)) / self.slope

    def pressure(self, torque: Any, flow: float | None = None) -> Any:
        """Pressure over the motor, Pa, see `speed`."""
        return self.pressure_at(self.speed(torque, flow), flow)

    def pressure_at(self, speed: Any, flow: Any = None) -> Any:
        """The same over speeds of the rotor, rad/s."""
        if self.curves:
            return self._by_flow(flow, lambda law, x: law(x), speed) / self.per_radian
        return (self._flow(flow) - self.per_radian * speed) / self.leakage

    def _speed(self, law, torques):
        turns, lost = law(0.0) - torques, self.lost_torque
        wanted = torques + np.clip(turns, -lost, lost)  # T + T_lost, or where friction holds that at rest
        ends = law.x[[0, -1]]
        most, least = loads = law(ends)
        straight = ends + (wanted[:, None] - loads) / law.c[2, [0, -1]]
        return np.array(
            [om[0] if T >= most else om[1] if T <= least
             else brentq(lambda om, T=T: law(om) - T, *ends, xtol=1e-13, rtol=1e-14)
             for T, om in zip(wanted, straight, strict=True)]
        )  # fmt: skip

    def stands(self, torque: float) -> bool:
        """Whether it neither turns nor stalls under a torque (N m): there is none, as on a trip without flow."""
        return torque == 0 and self.stall_torque() <= 0

    def running(self, owner: str, torque: float) -> float:
        """The speed under a steady torque on bit (N m), rad/s.

        Raises:
            SceneError: the torque is above the stall torque.
        """
        stall = self.stall_torque()
        if torque >= stall:
            refuse(owner, "torque", torque, f"below the torque at which {self.name} stalls, {stall:.5g} N m at "
                   f"{self.flow_at(0.0):.4g} m^3/s: less weight on bit, more flow or another motor")  # fmt: skip
        return float(self.speed(torque))


def check_flows(motors):
    """Refuse `MudMotor`s of one string with different flows, which are compared at times up to the last one at which a
    flow is not smooth, or a minute."""
    for motor, other in pairwise(motors):
        if motor.flow == other.flow:
            continue
        jumps = [0.0, *(t for x in (motor, other) for t in getattr(x.flow, "jumps", ()))]
        changes = callable(motor.flow) or callable(other.flow)
        for t in [*jumps, *(max(*jumps, _MINUTE) * (np.arange(99) * 0.618 % 1)).tolist()] if changes else [0.0]:
            flow, expected = motor.flow_at(t), other.flow_at(t)
            if not math.isclose(flow, expected, rel_tol=_SAME_FLOW, abs_tol=1e-9):
                refuse(motor, "flow", flow, f"the flow of {other.name}, {expected:.4g} m^3/s at t = {t:.3g} s, since "
                       "the mud flows through all motors of a string; what passes a rotor by is leakage")  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class OscillationTool(_Tool):
    """A tool that shakes the string along its axis, to reduce the friction at the wall: a spring, and a pair of forces
    that drive its lower end down and what is above up, F sin(2 pi f (t - start)).

    It shakes at its lower end; torsion passes through it. In torque and drag it is a collar.

    Args:
        length, outer_diameter, inner_diameter, mass, material, name, damping_time: as of `MudMotor`.
        spring: k, N/m, of the spring that holds both sides together.
        frequency: f, Hz. force: F, N, from the pressure pulses of a valve, say.
        stroke: in place of the force, m: by how much it moves either way where nothing resists, F = k stroke.
        start: s, from which time on it works.

    Raises:
        SceneError: as of `Collar`; numbers that are not positive, or force and stroke, or neither. A stroke that no
            tool has is taken with a warning.
    """

    spring: Annotated[float, Number("stiffness", positive("the stiffness of its spring"))]
    frequency: Annotated[Frequency, positive()]
    force: Annotated[ForceSize, positive()] | None = None
    stroke: Length | None = None
    start: Annotated[Time, at_least(0)] = 0.0

    _called = "oscillation tool"

    def validate(self):
        """Refuse force and stroke, or neither; the force from the stroke."""
        super().validate()
        if (self.force is None) == (self.stroke is None):
            refuse(self, "force", self.force, "either a force (N) or a stroke (m)")
        if self.force is None:
            _doubt_size(self, "stroke", self.stroke, _LONGEST_STROKE, "m", "5 mm")
            store(self, force=self.spring * self.stroke, stroke=None)

    def sentence(self, units: Units) -> str:
        """On its force and frequency, in some units."""
        force, spring = (units.told(*x, form=".4g") for x in ((self.force, "N"), (self.spring, "N/m")))
        return f"Tool, {self.name}: a force of {force} at {self.frequency:.4g} Hz beside a spring of {spring}."

    @property
    def jumps(self) -> tuple[float, ...]:
        """Times (s) at which the force is not smooth."""
        return (self.start,) if self.start else ()

    def __call__(self, t: float) -> float:
        """The force that drives both sides apart at a time (s), N."""
        return self.force * math.sin(2 * math.pi * self.frequency * (t - self.start)) if t > self.start else 0.0


_AXES = ("point",)
_SPEED = Quantity("speed", "speed of the rotor", "rad/s", axes=_AXES, shown="rpm")
_TORQUE = Quantity("torque", "torque on bit", "N m", axes=_AXES, shown="kN m")
_PRESSURE = Quantity("pressure", "pressure over motor", "Pa", axes=_AXES, shown="bar")
_POWER = Quantity("power", "power at the bit", "W", axes=_AXES, shown="kW")
_FLOW = Quantity("flow", unit="m^3/s", axes=_AXES, shown="l/min")


@dataclass(frozen=True, eq=False, repr=False)
class PowerCurve(Charted):
    """Result of `power_curve`; `plot` draws speed, pressure and power over the torque on bit, a line for each flow, and
    where the motor stalls.

    Attributes:
        motor: the `MudMotor`. flow: (n,) m^3/s, of curves one after another. torque: (n,) on bit, N m, in each from 0
            to the stall torque. speed: (n,) of the rotor against the housing, rad/s. pressure: (n,) over the motor, Pa.
            power: (n,) torque times speed, W. efficiency: (n,) of flow times pressure.
    """

    motor: MudMotor
    flow: np.ndarray
    torque: np.ndarray

    axis = _rows_axis = "point"
    _over, _chart = "torque", "well.tools.power_figure"
    _quantities = by_name(_FLOW, _TORQUE, _SPEED, _PRESSURE, _POWER, Quantity("efficiency", axes=_AXES))

    @property
    def speed(self) -> np.ndarray:
        """(n,) rad/s."""
        return self.motor.speed(self.torque, self.flow)

    @property
    def pressure(self) -> np.ndarray:
        """(n,) Pa."""
        return self.motor.pressure(self.torque, self.flow)

    @property
    def power(self) -> np.ndarray:
        """(n,) W."""
        return self.torque * self.speed

    @property
    def efficiency(self) -> np.ndarray:
        """(n,) of flow times pressure."""
        return self.power / (self.flow * self.pressure)

    def __len__(self) -> int:
        return len(self.torque)

    def _about(self):
        return {"kind": "PowerCurve", "slope": self.motor.slope}

    def _answer(self, units):
        for flow in np.unique(self.flow):
            at = np.flatnonzero(self.flow == flow)
            best = at[self.power[at].argmax()]
            said = {name: f"{getattr(self, name)[k] / size:.4g} {unit}" for name, k in (
                ("flow", best), ("speed", at[0]), ("torque", at[-1]), ("power", best))
                for unit, size in [units.on_screen(self._quantities[name])]}  # fmt: skip
            yield (
                f"{said['flow']}: {said['speed']} without load, stalls at {said['torque']}; most power {said['power']}."
            )

    def __repr__(self):
        return f"<PowerCurve: {self.motor.name}, {len(np.unique(self.flow))} flows>"


def power_figure(curve):
    """Speed, pressure and power over the torque on bit; see `PowerCurve`."""
    figure, axes = stacked(8, [2.2] * 3)
    heading, across = scale(_TORQUE, curve.torque)
    unit, size = unit_of(_FLOW)
    for panel, quantity in zip(axes, (_SPEED, _PRESSURE, _POWER), strict=True):
        values = getattr(curve, quantity.name)
        label, high = scale(quantity, values)
        for k, flow in enumerate(np.unique(curve.flow)):
            at, look = curve.flow == flow, {"color": COLOURS[k % len(COLOURS)]}
            panel.plot(curve.torque[at] / across, values[at] / high, label=f"{flow / size:.4g} {unit}", **look)
            panel.plot(
                curve.torque[at][-1] / across, values[at][-1] / high, "x", markersize=7, markeredgewidth=2, **look
            )
        panel.plot([], [], "x", color="black", label="stalls")
        panel.set(ylabel=label, ylim=(0, None), xlim=(0, 1.03 * curve.torque.max() / across))
    legend(*axes)
    axes[-1].set_xlabel(heading)
    figure.suptitle(f"{curve.motor.name}: the bit's torque slows it down, and stalls it")
    return figure


def power_curve(motor: MudMotor, flows: Any = None, points: int = 41) -> PowerCurve:
    """Speed, pressure, power and efficiency of a motor over the torque on bit, from none to where it stalls.

    Args:
        motor: a `MudMotor`. flows: m^3/s or text, such as "2400 l/min", one or several; None for the motor's own, at
            the start. points: torques of each.

    Raises:
        SceneError: no flow, or one at which the motor stalls without load.
    """
    instance("power_curve", "motor", motor, MudMotor, "a MudMotor")
    several = [motor.flow_at(0.0)] if flows is None else flows if isinstance(flows, list | tuple) else [flows]
    if not several:
        refuse("power_curve", "flows", flows, "a flow (m^3/s) or several, or None for the motor's own")
    flows = [replace(motor, flow=flow).flow_at(0.0) for flow in several]
    for flow in flows:
        if motor.stall_torque(flow) <= 0:
            refuse("power_curve", "flows", flow, "a flow (m^3/s) that turns the motor without load, above "
                   f"{motor.lost_torque * (motor.leakage or 0.0) / motor.per_radian:.3g}")  # fmt: skip
    torque = np.concatenate([np.linspace(0.0, motor.stall_torque(flow), points) for flow in flows])
    return PowerCurve(motor, np.repeat(flows, points), torque)
