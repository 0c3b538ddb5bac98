"""Motors and oscillation tools in strings, against independent truths and closed forms."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling import (
    BitLaw,
    BitOnRock,
    Cutting,
    Drilling,
    Hook,
    Matched,
    Stribeck,
    TopDrive,
    ViscousDrag,
)
from cosserat_fenicsx.drilling.joints import Parting, fastest_rotor
from cosserat_fenicsx.drilling.linear.characteristic import Steady
from cosserat_fenicsx.well import Bit, Collar, Component, DrillString, MotorCurve, MudMotor, OscillationTool

pytestmark = [pytest.mark.serial, pytest.mark.once]
TRUTHS = json.loads((Path(__file__).parent / "reference" / "tools.json").read_text(encoding="utf-8"))
STEEL = cf.Material(E=206e9, nu=0.3, density=7850.0)
MOTOR, VISCOUS, PULLED = TRUTHS.values()
GIVEN, KNOWN = MOTOR["input"], MOTOR["truth"]
STEADY, STEPS, SLOPES = (next(KNOWN[x] for x in KNOWN if x.startswith(y)) for y in ("steady", "flow steps", "eigen"))


@dataclass(frozen=True)
class Rising(BitLaw):
    """A torque that rises evenly with the speed."""

    first: float
    slope: float

    def torque(self, speed, weight):
        return self.first + self.slope * speed


@dataclass(frozen=True, kw_only=True)
class Lumped(MudMotor):
    """A motor whose housing is the inertia of the truth, all but rigid."""

    @property
    def torsion(self):
        return 3e10, GIVEN["J1"] / self.length


@dataclass(frozen=True)
class Switched:
    """A flow that changes at once."""

    first: float
    second: float
    at: float

    @property
    def jumps(self):
        return (self.at,)

    def __call__(self, t):
        return self.first if t < self.at else self.second


def motor(kind=MudMotor, **more):
    given = {"displacement": GIVEN["V"], "leakage": GIVEN["leak"], "lost_torque": GIVEN["Tf"], "flow": GIVEN["Q"]}
    return kind(**{"length": 1.0, "outer_diameter": "6 3/4 in", **given, **more})


def pipe(length, EA=701023457.1261743, rhoA=26.71375795359451):
    stiffness = cf.Stiffness(shear=(1e9, 1e9), axial=EA, bending=(1e6, 1e6), torsion=941162.1464157262, mass=rhoA,
                             inertia=(0.05, 0.05, 0.09324815246769404))  # fmt: skip
    return Component(length, stiffness, 200.0, 0.08)


def above(*below, length=20.0, law=None, **more):
    """A stiff drive that turns a pipe with what is below."""
    law = law or Rising(GIVEN["T0"], GIVEN["b"])
    return Drilling(
        DrillString([*below, pipe(length)]), **{"drive": TopDrive(GIVEN["Om"]), "bit": BitOnRock(law), **more}
    )


def test_power_curve(truth):
    tool = motor()
    torque, speed, bit, pressure, power, efficiency = STEADY
    truth("mud motor: no-load speed, stall torque, slope", [tool.speed(0.0), tool.stall_torque(), tool.slope],
          [KNOWN["no-load speed (rad/s)"], KNOWN["stall torque (N m)"],
           KNOWN["slope of torque over speed (N m s/rad)"]], 1e-12)  # fmt: skip
    curve = cf.well.power_curve(tool, [0.02, GIVEN["Q"]])
    at = [np.interp(torque, curve.torque[41:], x[41:]) for x in (curve.speed, curve.pressure)]
    truth("mud motor: speed and pressure under torque", at, [speed, pressure], 1e-12)
    assert GIVEN["Q"] * pressure == pytest.approx(power)
    assert torque * speed / power == pytest.approx(efficiency)
    assert (curve.speed[[40, -1]] == pytest.approx(0, abs=1e-12)) and "stalls at 11.89 kN m" in str(curve)


@pytest.mark.parametrize(("model", "dt"), [("torsion", 2e-4), ("axial and torsional", 4e-4)])
def test_flow_that_steps(model, dt, truth):
    """Two bodies below a matched drive, from steady drilling at 8 s on; the books are balanced."""
    scene = above(motor(Lumped, flow=Switched(GIVEN["Q"], GIVEN["Q2"], 8.0), rotor_inertia=GIVEN["J2"]),
                  drive=TopDrive(GIVEN["Om"], control=Matched(torque=STEADY[0])))  # fmt: skip
    found = cf.drilling.simulate(scene, 10.05, model=model, dt=dt, progress=False)
    rows = np.array(STEPS)
    when, mean = 8.0 + rows[:, 0], found.mean_times
    bit = np.interp(when, found.times if model == "torsion" else mean, found.bit_speed)
    speed, pressure = (np.interp(when, mean, x) for x in (found.motor_speed, found.pressure))
    torque = pressure * scene.motor.per_radian - GIVEN["Tf"]
    got = np.column_stack([bit - speed, bit, torque, pressure])
    truth(f"mud motor, flow steps, {model}: speeds, torque, pressure", got, rows[:, 1:], 1e-3)
    assert abs(found.balance[-1]) < 1e-6 * found.work_of_drive[-1] and not found.stalled[found.times > 0.1].any()


@pytest.mark.parametrize(("model", "damped"), [("torsion", 0.0), ("torsion", 1e-5), ("axial and torsional", 0.0)])
def test_steady_start(model, damped):
    """Nothing changes, and the bit is faster by the motor's speed under its torque."""
    scene = above(Bit(0.2), motor(damping_time=damped), start="steady", drag=ViscousDrag(torsion=0.5))
    found = cf.drilling.simulate(scene, 0.5, model=model, progress=False)
    assert np.ptp(found.bit_speed) < 1e-9 and np.ptp(found.surface_torque) < 1e-6
    below = 0.5 * sum(x.rhoJ * x.length for x in scene.turned) * found.bit_speed[0]
    assert found.motor_speed[0] == pytest.approx(scene.motor.speed(found.torque_on_bit[0] + below), rel=1e-9)
    assert np.abs(np.diff(found.torque[-1][1:-1])).max() < 20.0  # by drag alone


@pytest.mark.parametrize("model", ["torsion", "axial and torsional"])
def test_a_motor_that_stalls(model):
    """A bit that holds more than the motor: the string turns its rotor backwards, which is told."""
    scene = above(Bit(0.2), motor(), law=Stribeck(30e3, 29e3), drag=ViscousDrag(torsion=2.0))
    found = cf.drilling.simulate(scene, 3.0, model=model, dt=3e-4, progress=False)
    assert (found.bit_speed == 0).all() and found.stalled[-1]
    assert found.motor_speed[-1] == pytest.approx(-GIVEN["Om"], rel=1e-3)
    assert "THE MOTOR STALLS from t = " in str(found) and "where it sticks the motor stalls" in " ".join(found.why)
    with pytest.raises(cf.SceneError, match="mud motor: it stalls"):
        cf.drilling.simulate(replace(scene, start="steady"), 1.0, model=model)


# Of a maker's chart, at two flows: speeds of the rotor and torques on the bit.
CHART = [MotorCurve(q, [k * x for x in (9.2, 8.6, 7, 4, 0)], [k * x for x in (0, 3e3, 6.5e3, 9e3, 10e3)])
         for q, k in ((0.02, 0.4), (0.04, 1.0))]  # fmt: skip


@pytest.mark.parametrize(("model", "dt"), [("torsion", 2e-4), ("axial and torsional", 4e-4)])
def test_a_motor_by_its_chart(model, dt):
    """A linear law of the bit meets the curve at one of its points; a curve of two points is the linear motor; and the
    same that the line does where it stalls."""
    charted = {"leakage": None, "curves": CHART}
    for flow, k in ((GIVEN["Q"], 1.0), (0.03, 0.7)):  # halfway: the mean of both
        tool = motor(**charted, flow=flow)
        speed, torque = 7 * k, 6.5e3 * k
        scene = above(tool, law=Rising(torque - 20 * (GIVEN["Om"] + speed), 20.0), start="steady")
        found = cf.drilling.simulate(scene, 0.3, model=model, dt=dt, progress=False)
        assert found.motor_speed == pytest.approx(speed, rel=1e-9) and found.torque_on_bit == pytest.approx(torque)
        assert found.pressure[-1] == pytest.approx((torque + GIVEN["Tf"]) / tool.per_radian)
        settled = cf.drilling.simulate(replace(scene, start="rest"), 9.0, model=model, dt=dt, progress=False)
        assert settled.motor_speed[-1] == pytest.approx(speed, rel=1e-3)
        assert abs(settled.balance[-1]) < 1e-6 * settled.work_of_drive[-1]
    line = motor()
    ends = MotorCurve(GIVEN["Q"], [line.speed(0.0), 0.0], pressures=[0.0, line.stall_torque() / line.per_radian])
    for law in (Rising(GIVEN["T0"], GIVEN["b"]), Stribeck(30e3, 29e3)):
        rows = [
            cf.drilling.simulate(above(x, law=law, drag=ViscousDrag(torsion=2.0)), 1.0, model=model, dt=dt)
            for x in (line, motor(leakage=None, curves=[ends]))
        ]
        assert rows[0].motor_speed == pytest.approx(rows[1].motor_speed, rel=1e-9, abs=1e-9)
    assert rows[1].stalled[-1] and "THE MOTOR STALLS" in str(rows[1])


@pytest.mark.parametrize(("model", "settled"), [("torsion", 1.2), ("axial and torsional", 2.5)])
def test_a_motor_by_its_chart_whose_flow_changes(model, settled):
    """From its steady state at one flow to that at another; by charts of the linear motor as that one, step by step."""
    ramp = cf.signals.Table((0.0, 0.1, 0.3), (GIVEN["Q"], GIVEN["Q"], 0.03))
    law, drag = Rising(1e3, 200.0), ViscousDrag(torsion=40.0)

    def moved(tool, until):
        scene = above(tool, law=law, drag=drag, start="steady")
        return cf.drilling.simulate(scene, until, model=model, dt=4e-4, progress=False)

    found = moved(motor(leakage=None, curves=CHART, flow=ramp), settled)
    still = moved(motor(leakage=None, curves=CHART, flow=0.03), 0.01)
    for name, near in (("motor_speed", 1e-9), ("pressure", 1e-8), ("torque_on_bit", 1e-9)):  # which the curve amplifies
        assert getattr(found, name)[-1] == pytest.approx(getattr(still, name)[0], rel=near), name
    assert found.motor_speed[0] > 1.2 * still.motor_speed[0]
    assert abs(found.balance[-1]) < 1e-6 * found.work_of_tools[-1]
    line, charts = motor(flow=ramp), []
    for q in (0.03, 0.035, GIVEN["Q"]):
        ends = replace(line, flow=q)
        charts.append(MotorCurve(q, [ends.speed(0.0), 0.0], [0.0, ends.stall_torque()]))
    rows = [moved(x, 0.35) for x in (line, motor(leakage=None, curves=charts, flow=ramp))]
    assert rows[1].motor_speed == pytest.approx(rows[0].motor_speed, rel=1e-7)


def test_the_ends_of_a_chart():
    """Between two flows it is steepest where it ends; from the torque of a stall on it is straight, however flat."""
    pair = [MotorCurve(0.03, [7, 6, 0], [0, 3e3, 6e3]), MotorCurve(0.04, [9, 8, 0], [0, 3.1e3, 7e3])]
    tool = motor(leakage=None, curves=pair, flow=0.035)
    speeds = np.linspace(0, 1.5 * tool.speed(0.0), 10001)
    slopes = -np.diff(tool.law(speeds)) / np.diff(speeds)
    assert tool.slope >= slopes.max() and tool.slope == pytest.approx(slopes.max(), rel=1e-2)
    flat = motor(leakage=None, curves=[MotorCurve(GIVEN["Q"], [9, 8, 0], [0, 9999.0, 1e4])])
    assert flat.speed(2e4) == pytest.approx(-8 * (1e4 - 2 * GIVEN["Tf"]), rel=1e-9)


def test_steps_resolve_a_rotor_whose_flow_rises_smoothly():
    """It is slow at the start, and a function of time tells no times at which its flow is largest."""
    slow, fast = (
        above(motor(leakage=None, curves=CHART, flow=flow))
        for flow in (0.02, lambda t: 0.03 - 0.01 * np.cos(2 * np.pi * t))
    )
    assert fastest_rotor(slow) == pytest.approx(0.4 * 9.2) and fastest_rotor(fast) == pytest.approx(9.2, rel=1e-3)


def test_small_motions_take_the_slope_of_a_motors_curve():
    """As that of the linear motor with this slope, at the same speed of the bit."""
    tool = motor(leakage=None, curves=CHART)
    scene = above(tool, law=Rising(6.5e3 - 20 * (GIVEN["Om"] + 7), 20.0), length=1000.0)
    slope = tool.slope_at(7.0)
    line = motor(leakage=tool.per_radian**2 / slope, flow=(6.5e3 + GIVEN["Tf"] + 7 * slope) / slope * tool.per_radian)
    both = scene, replace(scene, string=DrillString([line, pipe(1000.0)]))
    growth, same = (cf.drilling.stability(x, [GIVEN["Om"]], up_to=2.0).growth for x in both)
    critical, alike = (cf.drilling.critical_slopes(x, 2.0, GIVEN["Om"])[1] for x in both)
    assert critical == pytest.approx(alike, rel=1e-6)
    assert growth == pytest.approx(same, rel=1e-8) and tool.least_slope < slope < tool.slope


@pytest.mark.parametrize("model", ["torsion", "axial and torsional"])
def test_pumps_that_stop_and_start(model):
    """Without flow friction holds the rotor; where the bit takes more, it turns backwards against friction and leakage.
    The pumps start again, and all is as before."""
    flow = cf.signals.Table((0.0, 0.2, 0.4, 1.4, 1.5), (GIVEN["Q"], GIVEN["Q"], 0.0, 0.0, GIVEN["Q"]))
    tool = motor(flow=flow)
    for law in (Rising(100.0, 10.0), Rising(GIVEN["T0"], GIVEN["b"])):
        scene = above(tool, law=law, start="steady")
        found = cf.drilling.simulate(scene, 3.0, model=model, dt=1e-3, progress=False)
        off, backwards = np.searchsorted(found.times, 1.39), law.first > GIVEN["Tf"]
        speed = (tool.slope * GIVEN["Om"] + GIVEN["Tf"] - law.first) / (tool.slope + law.slope) - GIVEN["Om"]
        assert found.motor_speed[off] == pytest.approx(speed if backwards else 0.0, rel=1e-4, abs=1e-12)
        assert found.bit_speed[off] == pytest.approx(GIVEN["Om"] + found.motor_speed[off], rel=5e-3)
        assert found.bit_speed[-1] == pytest.approx(found.bit_speed[0], rel=1e-4) and not found.stalled[off]
        assert abs(found.balance[-1]) < 1e-6 * found.work_of_drive[-1]
    torques, speeds = np.array([-400.0, 200.0, 400.0]), np.array([100.0, 0.0, -100.0]) / tool.slope
    assert tool.speed(torques, 0.0) == pytest.approx(speeds)


@pytest.mark.parametrize("model", ["torsion", "axial and torsional"])
def test_resumed_to_the_same_digits(model, tmp_path):
    flow = cf.signals.Table((0.0, 0.1, 0.2), (0.04, 0.04, 0.03))
    shaker = OscillationTool(2.0, outer_diameter=0.127, spring=5e6, frequency=16.0, stroke=5e-3, start=0.05)
    scene = above(Bit(0.2), motor(flow=flow), Collar(2.0, "NC46-65"), shaker)
    whole = cf.drilling.simulate(scene, 0.3, model=model, dt=2e-4, progress=False)
    cf.drilling.simulate(scene, 0.15, model=model, dt=2e-4, folder=tmp_path / "run", progress=False)
    np.testing.assert_array_equal(cf.resume(tmp_path / "run", duration=0.3).rows, whole.rows)
    assert (whole.hook_load.std() > 1e3) == (model != "torsion") and abs(whole.balance[-1]) < 1e-6 * whole.kinetic.max()


def test_small_motions_see_a_dashpot(truth):
    """The two bodies' own rates, below a matched drive; a bit that falls with the speed."""
    scene = above(motor(Lumped, rotor_inertia=GIVEN["J2"]), drive=TopDrive(GIVEN["Om"], control=Matched()))
    equation = Steady(scene)
    f = equation.equation(equation.parameters(GIVEN["Om"], None))
    s = np.array(SLOPES, dtype=complex)
    for _ in range(20):
        value, slope = f(s)
        s = s - value / slope
    truth("mud motor: rates of small motions", s.real, SLOPES, 1e-4)
    falling = replace(scene, bit=BitOnRock(Stribeck(*GIVEN["stribeck"])))
    bit, torque, decays = next(x for y, x in KNOWN.items() if y.startswith("with a Stribeck"))[0]
    found = cf.drilling.stability(falling, [GIVEN["Om"]], up_to=1.0)
    assert (not found.unstable(0)) == decays
    truth("mud motor: speed of a Stribeck bit", equation.__class__(falling).speed_of_bit(GIVEN["Om"], None), bit, 1e-9)


def test_the_wall_slows_what_turns_with_the_bit():
    """In a horizontal hole by weight times friction."""
    path = cf.well.WellPath.from_survey([0, 400], [90, 90], [0, 0], degrees=True)
    hole = cf.well.Borehole(path, cf.well.HoleSection(400.0, "8 1/2 in", 0.3))
    scene = above(Collar(90.0, "NC46-65"), motor(), length=309.0, hole=hole, mud=cf.well.Mud(0.0))
    below, bit = scene.segments[-1], Steady(scene).speed_of_bit(GIVEN["Om"], None)
    wall = 0.3 * below.weight * below.length * scene.laid[0].component.contact_radius
    torque = scene.motor.stall_torque() - scene.motor.slope * (bit - GIVEN["Om"])
    assert torque == pytest.approx(GIVEN["T0"] + GIVEN["b"] * bit + wall, rel=1e-6) and wall > 800


def test_a_bit_that_cuts_below_a_motor():
    """It turns at the speed of string and motor: the steady state stays, and its delay follows that speed."""
    cutting = BitOnRock(Cutting(0.108, 60e6, 0.6, 4), 60e3)
    scene = above(Bit(0.2159), motor(), bit=cutting, start="steady")
    found = cf.drilling.simulate(scene, 0.05, progress=False)
    bit = GIVEN["Om"] + scene.motor.speed(found.torque_on_bit[0])
    assert found.bit_speed[0] == pytest.approx(bit, rel=1e-9) and np.ptp(found.bit_speed) < 1e-6
    steady = Steady(scene)
    f = steady.equation(steady.parameters(GIVEN["Om"], 60e3))
    assert f.delay == pytest.approx(2 * np.pi / 4 / bit) and f.penetration == pytest.approx(cutting.law.rate(60e3, bit))


def shaken(f):
    """The string of the truth with viscous drag, shaken at a frequency."""
    given = VISCOUS["input"]
    tool = OscillationTool(2.0, outer_diameter=0.127, inner_diameter=0.10861, material=STEEL, spring=given["k"],
                           force=given["F"], frequency=f)  # fmt: skip
    (length, *_), (short, *_), (low, EA, rhoA, rate) = *given["above"], *given["below"]
    string = DrillString([pipe(low, EA, rhoA), pipe(short), tool, pipe(length - 2.0)])
    return Drilling(string, TopDrive(0.0), drag=ViscousDrag(axial=rate))


def test_tool_with_viscous_drag(truth):
    """By exact waves, and one of the motions by elements, once its start has died down by exp(-0.4 t): hook load,
    velocity of the lower end, power."""
    rows, force = VISCOUS["truth"], VISCOUS["input"]["F"]
    answer = cf.drilling.frequency_response(shaken(1.0), [row["f"] for row in rows], kind="axial", speed=0.0)
    ends = [answer.transfer("tool force", x) for x in ("hook load", "bit velocity")]
    known = [[row[f"{x} amplitude"] for row in rows] for x in ("hook load", "lower end velocity")]
    truth("oscillation tool, viscous drag, by waves: hook load, lower end", np.abs(ends) * force, known, 1e-6)
    (row, *_), f = rows, rows[0]["f"]
    found = cf.drilling.simulate(shaken(f), 24.0, dt=1e-3, elements=320, progress=False)
    late = found.mean_times > 22.0
    waves = np.exp(2j * np.pi * f * found.mean_times[late])
    waves = np.column_stack([np.ones_like(waves.real), waves.real, waves.imag])
    got = [np.hypot(*np.linalg.lstsq(waves, x[late], rcond=None)[0][1:]) for x in (found.hook_load, found.bit_velocity)]
    start = np.searchsorted(found.times, 22.0)
    power = np.diff(found.work_of_tools[[start, -1]]) / np.diff(found.times[[start, -1]])
    truth("oscillation tool, viscous drag, in motion at 5 Hz: hook load, lower end, power", [*got, *power],
          [row[x] for x in ("hook load amplitude", "lower end velocity amplitude", "mean power fed in (W)")],
          1e-3)  # fmt: skip


def test_tool_that_halves_the_pull(truth):
    given = PULLED["input"]
    path = cf.well.WellPath.from_survey([0, given["L"]], [90, 90], [0, 0], degrees=True)
    hole = cf.well.Borehole(path, cf.well.HoleSection(given["L"], 0.2159, given["friction"]))
    tool = OscillationTool(2.0, outer_diameter=0.127, inner_diameter=0.10861, material=STEEL, spring=given["k"],
                           force=given["F"], frequency=given["f"], start=2.0)  # fmt: skip
    string = DrillString([pipe(given["L"] - given["tool_at"]), tool, pipe(given["tool_at"] - 2.0)])
    scene = Drilling(string, TopDrive(0.0), hole=hole, hook=Hook(speed=given["V"]), mud=cf.well.Mud(1850.0))
    found = cf.drilling.simulate(scene, 13.0, elements=250, progress=False)
    pull = found.mean("hook_load", periods=128, frequency=given["f"])
    truth("oscillation tool, Coulomb friction: mean pull", pull, PULLED["truth"]["mean pull with the tool"], 1e-2)
    with pytest.raises(cf.SceneError, match="mean.periods"):
        found.mean("hook_load", 10000, 16.0)
    with pytest.raises(cf.SceneError, match="mean.periods = 8.5: expected a whole number from 1"):
        found.mean("hook_load", 8.5, 16.0)


@pytest.mark.parametrize(("make", "words"), [
    (lambda: motor(flow=-0.01), "MudMotor.flow = -0.01: expected a flow through the motor"),
    (lambda: motor(flow=cf.signals.Table([0, 5, 10], [(0.04,), (-0.01,), (0.04,)])),
     "^MudMotor.flow = -0.01: expected a flow .* at t = 5 s, from 0 on$"),
    (lambda: cf.drilling.simulate(above(motor(flow=lambda t: GIVEN["Q"] * (1 - t / 0.3))), 1.0),
     "^MudMotor.flow = -.*: expected a flow .* from 0 on$"),
    (lambda: cf.drilling.simulate(above(motor(flow=1e-4), start="steady"), 1.0), "mud motor: it stalls"),
    (lambda: cf.well.power_curve(motor(), ["6 l/min"]), "power_curve.flows = 0.0001: .*turns the motor without load"),
    (lambda: motor(flow=cf.signals.Ramp((2400,))), "MudMotor.flow = 2400.0: .*at most 10 m"),
    (lambda: motor(flow=lambda t: [1.0, 2.0]), r"MudMotor.flow = \[1.0, 2.0\]: expected a flow"),
    (lambda: cf.well.power_curve(motor(), []), r"power_curve.flows = \[\]: expected a flow"),
    (lambda: motor(size="6 3/4 in"), "MudMotor.size"),
    (lambda: motor(length=None), "MudMotor.length"),
    (lambda: motor(leakage=0.0), "MudMotor.leakage"),
    (lambda: motor(curves=CHART), "MudMotor.leakage = .*: expected either a leakage"),
    (lambda: motor(leakage=None, curves=CHART, flow=0.05), "MudMotor.flow = 0.05: .*, 0.02 to 0.04 m.3/s"),
    (lambda: motor(leakage=None, curves=CHART, flow=Switched(0.04, 0.01, 1.0)), "MudMotor.flow = 0.01: .*0.02 to"),
    (lambda: motor(leakage=None, curves=CHART[::-1]), "MudMotor.curves = .*of ascending flow"),
    (lambda: motor(leakage=None, curves=[MotorCurve(0.04, [10.0, 0.0], [0.0, 1e4])]), "at most 9.37.* without any"),
    (lambda: MotorCurve(0.04, [9.0, 7.0, 8.0, 0.0], [0.0, 1e3, 2e3, 3e3]), "MotorCurve.speeds = .*which fall .* to 0"),
    (lambda: MotorCurve(0.04, [9.0, 0.0], [1e3, 3e3]), "MotorCurve.torques = .*: expected 2 torques, .*rise from 0"),
    (lambda: MotorCurve(0.04, [9.0, 0.0]), "either torques .N m. or pressures"),
    (lambda: above(motor(), bit=None), "Drilling.bit = None: expected a BitOnRock below mud motor"),
    (lambda: OscillationTool(2.0, outer_diameter=0.127, spring=1e6, frequency=16.0), "either a force"),
    (lambda: above(OscillationTool(2.0, outer_diameter=0.127, spring=1e6, frequency=16.0, force=1e4)),
     "component below"),
    (lambda: above(motor(), motor(flow=0.03)), "MudMotor.flow = 0.03: expected the flow of mud motor, 0.04 m.3/s at t"),
    (lambda: above(motor(flow=Switched(0.04, 0.03, 2.0)), motor(flow=lambda t: 0.04)), "MudMotor.flow = 0.04: .*0.03 "),
    (lambda: above(motor(), hole=straight(0, 21.0)), "Drilling.mud = None: expected a Mud .*since mud motor is"),
    (lambda: cf.drilling.mixed_scene(above(Collar(9.0, "NC46-65"), motor()), 10.0), "without OscillationTool, and"),
    (lambda: cf.drilling.natural_frequencies(above(motor()), 2, "fixed"), "lets the string turn"),
])  # fmt: skip
def test_refused_by_name(make, words):
    with pytest.raises(cf.SceneError, match=words):
        make()


@pytest.mark.parametrize(("make", "words"), [
    (lambda: motor(displacement=26.8), "MudMotor.displacement = 26.8 m.3 is more than tools have.*'26.8 l'"),
    (lambda: motor(flow=2.4), "MudMotor.flow = 2.4 m.3/s is more than tools have.*'2400 l/min'"),
    (lambda: motor(flow=cf.signals.Table([0, 9], [(2.4,), (0.04,)])), "MudMotor.flow = 2.4 m.3/s is more than"),
    (lambda: OscillationTool(2.0, outer_diameter=0.127, spring=5e6, frequency=16.0, stroke=5.0),
     "OscillationTool.stroke = 5 m is more than tools have.*'5 mm'"),
])  # fmt: skip
def test_sizes_that_no_tool_has_are_doubted(make, words):
    with pytest.warns(cf.SceneWarning, match=words):
        make()


def test_tools_print_with_units():
    given = MudMotor(7.5, outer_diameter="6 3/4 in", displacement="26.8 l", leakage=1.4e-8, flow="2400 l/min")
    lines = str(given).splitlines()
    assert lines[0].startswith("String, mud motor: length 7.5 m, ") and "kg/m in air" in lines[0]
    assert "2400 l/min turn it at 89.55 rpm without load, it stalls at 12.19 kN m" in " ".join(lines)
    assert "gpm" in given.summary("field")


def test_friction_below_a_motor_is_told():
    """What torsion alone leaves out is the difference of both models."""
    path = cf.well.WellPath.from_survey([0, 31], [90, 90], [0, 0], degrees=True)
    hole = cf.well.Borehole(path, cf.well.HoleSection(31.0, 0.2159, 0.3))
    scene = above(Collar(10.0, "NC46-65"), motor(), hole=hole, mud=cf.well.Mud(1200.0), start="steady")
    torsion, both = (
        cf.drilling.simulate(scene, 0.01, model=x, progress=False) for x in ("torsion", "axial and torsional")
    )
    told = next(x for x in torsion.why if "below mud motor, about" in x)
    torque = float(told.split("about ")[1].split()[0])
    left_out = (torsion.motor_speed[-1] - both.motor_speed[-1]) * scene.motor.slope
    assert left_out + GIVEN["b"] * (torsion.bit_speed[-1] - both.bit_speed[-1]) == pytest.approx(torque, rel=0.1)


def test_static_motor_is_told_and_refused():
    path = cf.well.WellPath.from_survey([0, 20], [0, 0], [0, 0], degrees=True)
    hole = cf.well.Borehole(path, cf.well.HoleSection(20.0, 0.2159, 0.2))
    string = DrillString([motor(), pipe(19.0)])

    def answer(torque):
        operation = cf.well.Sliding(10e3, torque)
        return cf.well.torque_and_drag(hole, string, operation, mud=cf.well.Mud(1200.0), model="soft")

    assert "turns the bit by 64.73 rpm beside the string's rotation" in str(answer(STEADY[0]).why)
    with pytest.raises(
        cf.SceneError, match="Sliding.torque = 12000.0: expected below the torque at which mud motor stalls"
    ):
        answer(12e3)


def test_a_motor_that_stands_in_a_hole():
    """A trip without flow, and motions whose pumps start or whose bit stalls the motor."""
    path = cf.well.WellPath.from_survey([0, 20], [0.7, 0.7], [0, 0], degrees=False)
    well = {"hole": cf.well.Borehole(path, cf.well.HoleSection(20.0, 0.2159, 0.2)), "mud": cf.well.Mud(1200.0)}
    still = DrillString([motor(flow=0.0), pipe(19.0)])
    answer = cf.well.torque_and_drag(well["hole"], still, cf.well.TripOut(), mud=well["mud"], model="soft")
    assert "mud motor: stands, since its flow does not turn it" in answer.why
    for flow, law in ((cf.signals.Ramp(GIVEN["Q"], 0.0, 0.05), None), (GIVEN["Q"], Rising(2e4, 150.0))):
        scene = above(motor(flow=flow), length=19.0, law=law, **well)
        found = cf.drilling.simulate(scene, 0.5, model="torsion", progress=False)
        assert (found.motor_speed[-1] > 1) == (law is None) and "the motor stalls" in " ".join(found.why)


def test_scene_files():
    for name in ("mud_motor", "oscillation_tool"):
        scene = cf.read(Path(__file__).parent.parent / "demos" / "strings" / f"{name}.toml").scene
        assert cf.drilling.choose.chosen(scene)[0] == ("torsion" if scene.motor else "axial and torsional")
        assert scene.joints


def below(hole, start="rest", mud=None, law=None, weight=None):
    """A string with collars below a motor in a hole, at 6 rad/s."""
    string = DrillString([Collar(100.0, "NC46-65"), motor(), Collar(None, "NC46-65")])
    bit = BitOnRock(law or Stribeck(2000.0, 2000.0), weight=weight, inertia=50.0)
    return Drilling(string, TopDrive(6.0), bit, hole=hole, start=start, mud=mud or cf.well.Mud(1200.0))


def straight(inclination, length, friction=0.3):
    path = cf.well.WellPath.from_survey([0, length], [inclination] * 2, [0, 0])
    return cf.well.Borehole(path, cf.well.HoleSection(to=length, diameter="12.25 in", friction=friction))


def test_fluids_that_cut_components_leave_the_motor_in_its_place():
    cut = below(straight(0, 1000.0), mud=cf.well.Mud([(300, 1000), (600, 1200), (985.5, 1300), (1000, 1400)]))
    assert [part.length for part in cut.turned] == pytest.approx([85.5, 14.5]) and len(cut.segments) == 6
    assert cut.segments[cut.joints[0].segment].length == 1.0


def test_the_wall_holds_what_turns_with_the_bit_of_a_steady_start():
    """The bit keeps its speed; dashpots of the wall below the motor are those of the bit's speed."""
    scene = below(straight(80, 1500.0), start="steady")
    history = cf.drilling.simulate(scene, 3.0, model="axial and torsional")
    assert np.ptp(history.bit_speed) < 1e-6 and np.ptp(history.surface_torque) < 1e-3
    assert history.bit_speed[0] == pytest.approx(Steady(scene, "torsion").speed_of_bit(6.0, None), rel=1e-3)
    rates = Steady(scene, "axial").walls(None).rates([6.0, 12.0], 0.0)
    assert rates[-1][0][2] == pytest.approx(rates[0][0][2] / 2, rel=1e-2)


def test_blades_below_a_motor_need_steps_for_the_motors_speed_too():
    scene = below(straight(0, 500.0), law=cf.drilling.Lobes(3, 0.002), weight=2e4)
    fast = 6.0 + motor().speed(0.0)
    with pytest.raises(cf.SceneError, match=f"a step of at most {np.pi / 6 / fast:.3g} s"):
        cf.drilling.simulate(scene, 1.0, dt=np.pi / 6 / fast * 1.05)


@dataclass(frozen=True, kw_only=True)
class Light(MudMotor):
    """A motor whose housing is a small inertia, all but rigid."""

    @property
    def torsion(self):
        return 3e10, 60.0 / self.length


def two_motors(upper=None, lower=None):
    """Two motors below a matched drive; the lower one leaks more."""
    tools = motor(Light, **LOWER, **(lower or {})), motor(Light, rotor_inertia=8.0, **(upper or {}))
    return above(*tools, drive=TopDrive(GIVEN["Om"], control=Matched(torque=3000.0)), law=Rising(500.0, 400.0))


LOWER = {"leakage": 2.5e-8, "lost_torque": 200.0, "rotor_inertia": 12.0}


def three_bodies(scene):
    """(3, 3), (3, 2), (3,): d om/dt = A om + B flows + f of upper housing; upper rotor with lower housing; lower rotor
    with the bit, by the torques of motors that turn forwards."""
    up, low = scene.motors
    J = np.array([60.0, 60.0 + up.rotor_inertia, low.rotor_inertia])
    A, B, f = np.zeros((3, 3)), np.zeros((3, 2)), np.zeros(3)
    A[0, 0], f[0] = -GIVEN["Z"], 3000.0 + GIVEN["Z"] * GIVEN["Om"]
    A[2, 2], f[2] = -scene.bit.law.slope, -scene.bit.law.first
    for k, tool in enumerate((up, low)):
        for body, sign in ((k, -1), (k + 1, 1)):
            A[body, k] += sign * tool.slope
            A[body, k + 1] -= sign * tool.slope
            B[body, k] += sign * tool.per_radian / tool.leakage
            f[body] -= sign * tool.lost_torque
    return A / J[:, None], B / J[:, None], f / J


@pytest.mark.parametrize("model", ["torsion", "axial and torsional"])
def test_two_motors_as_three_bodies(model, tmp_path):
    """From their steady state the flow changes over time; own integration of three bodies; resumed to the byte."""
    ramp = cf.signals.Table((0.0, 2.0, 2.1), (GIVEN["Q"], GIVEN["Q"], 0.032))
    scene = two_motors({"flow": ramp}, {"flow": ramp})
    A, B, f = three_bodies(scene)
    start = np.linalg.solve(A, -f - B @ ([GIVEN["Q"]] * 2))
    true = solve_ivp(
        lambda t, om: A @ om + B @ [x.flow_at(t) for x in scene.motors] + f, (2.0, 2.3), start, method="Radau",
        rtol=1e-9, atol=1e-9, dense_output=True).sol  # fmt: skip
    found = cf.drilling.simulate(
        scene, 2.3, model=model, dt=5e-4, elements=12, save_every=0.005, folder=tmp_path / "run", progress=False
    )
    assert (
        found.model == model and (np.diff(true(2.3)) > 0).all() and abs(np.ptp([true(2.0), true(2.3)], 0)).min() > 0.1
    )
    times = found.mean_times
    late = times > 2.0
    got = np.column_stack([found.motor_speeds, found.bit_speed])[late]
    expected = np.vstack([np.diff(true(times[late]), axis=0), true(times[late])[2:]]).T
    assert got == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())
    assert found.motor_speed == pytest.approx(found.motor_speeds.sum(axis=1)) and not found.stalled[late].any()
    last = zip(scene.motors, got[-1, :2], strict=True)
    pressures = [x.pressure_at(speed, x.flow_at(times[-1])) for x, speed in last]
    assert found.pressures[-1] == pytest.approx(pressures) and found.pressure[-1] == pytest.approx(sum(pressures))
    assert abs(found.balance[-1]) < 1e-6 * found.work_of_tools[-1]
    cf.drilling.simulate(
        scene, 2.05, model=model, dt=5e-4, elements=12, save_every=0.005, folder=tmp_path / "part", progress=False
    )
    np.testing.assert_array_equal(cf.resume(tmp_path / "part", duration=2.3).rows, found.rows)
    assert str(found).count("Motor ") == 2


def test_small_motions_of_two_motors():
    """Rates and response of the three bodies below a matched drive."""
    scene = two_motors()
    A, _, _ = three_bodies(scene)
    steady = Steady(scene)
    f = steady.equation(steady.parameters(GIVEN["Om"], None))
    s = known = np.linalg.eigvals(A).astype(complex) * 1.0
    for _ in range(20):
        value, slope = f(s)
        s = s - value / slope
    assert s == pytest.approx(known, rel=2e-3)  # housings are all but rigid, and the pipe has no inertia there
    frequency = np.array([0.1, 0.5, 2.0])
    response = cf.drilling.frequency_response(scene, frequency)
    per = [np.linalg.solve(2j * np.pi * x * np.eye(3) - A, [0, 0, -1 / scene.bit_inertia])[2] for x in frequency]
    assert response.transfer("torque on bit", "bit speed") == pytest.approx(np.array(per), rel=2e-3)
    rows = cf.drilling.stability(scene, [GIVEN["Om"]], up_to=1.0)
    assert not rows.unstable(0)


@pytest.mark.parametrize("model", ["torsion", "axial and torsional"])
def test_steady_start_of_two_motors_with_curves(model):
    """In a hole with friction nothing changes, and each gives what the parts below it take; so in linear theory."""
    path = cf.well.WellPath.from_survey([0, 600], [60, 60], [0, 0], degrees=True)
    hole = cf.well.Borehole(path, cf.well.HoleSection(600.0, "8 1/2 in", 0.3))
    curved = motor(leakage=None, curves=CHART)
    scene = above(Bit(0.2), motor(**LOWER), Collar(40.0, "NC46-65"), curved, Collar(30.0, "NC46-65"),
                  length=527.7, hole=hole, mud=cf.well.Mud(0.0), start="steady",
                  drag=ViscousDrag(torsion=0.1))  # fmt: skip
    found = cf.drilling.simulate(scene, 0.3, model=model, progress=False)
    assert np.ptp(found.bit_speed) < 1e-8 and np.ptp(found.surface_torque) < 1e-5 and (found.motor_speeds > 1).all()
    linear = Steady(scene)._speeds(GIVEN["Om"], None)
    assert np.diff(linear) == pytest.approx(found.motor_speeds[0], rel=1e-4)
    taken = [tool.torque(om) for tool, om in zip(scene.motors, found.motor_speeds[0], strict=True)]
    between = taken[0] - taken[1]
    middle = [x for x, n in zip(scene.segments, scene.motors_above, strict=True) if n == 1]
    wall = 0.3 * sum(x.weight * np.sin(np.pi / 3) * x.length * x.radius for x in middle)
    drag = 0.1 * scene.inertias[1] * linear[1]
    assert between == pytest.approx(wall + drag, rel=2e-2) and wall > 300  # the wall acts on nodes


def test_limits_of_two_motors():
    """A second motor whose friction holds it is a collar; one that gives less than is taken stalls, which is told."""
    size = {"outer_diameter": "6 3/4 in", "inner_diameter": 0.1, "length": 5.0}
    stiff = motor(**{**size, "lost_torque": 1e6, "rotor_inertia": 1e-6})
    rows = []
    for upper in (stiff, Collar(**size)):
        scene = above(Bit(0.2), motor(), upper, law=Stribeck(5e3, 4e3, 3.0), drag=ViscousDrag(torsion=0.3))
        rows.append(cf.drilling.simulate(scene, 4.0, model="axial and torsional", dt=1e-3, elements=60))
    for name in ("bit_speed", "surface_torque"):
        first, second = (getattr(x, name) for x in rows)
        assert first == pytest.approx(second, abs=1e-4 * np.abs(second).max()), name
    weak = above(Bit(0.2), motor(), Collar(9.0, "NC46-65"), motor(leakage=1.4e-7), start="steady")
    with pytest.raises(cf.SceneError, match="mud motor: it stalls: with 0.04 m.3/s it gives less than 918"):
        cf.drilling.simulate(weak, 1.0)
    found = cf.drilling.simulate(replace(weak, start="rest"), 3.0, dt=1e-3, progress=False)
    assert found.stalls[-1].tolist() == [True, False] and found.stalled[-1]
    assert "THE MOTOR 1 FROM THE TOP STALLS" in str(found)


def test_motors_above_a_rod():
    """As of the string by elements: pipe and collars, two motors, and a rod of collars below."""
    ramp = cf.signals.Table((0.0, 0.04), (0.0, GIVEN["Q"]))
    # the lowest rotor, which strings by elements have at the bit, is light
    tools = motor(flow=ramp, leakage=2.5e-8, lost_torque=200.0), motor(flow=ramp, rotor_inertia=12.0)
    drive = TopDrive(cf.signals.Table((0.0, 0.04), (0.0, GIVEN["Om"])), 100.0, cf.drilling.PI(800.0, 500.0))
    collar, bit = Collar(30.0, "NC46-65"), BitOnRock(Rising(100.0, 150.0), inertia=20.0)
    scene = above(collar, tools[0], collar, tools[1], length=100.0, drive=drive, bit=bit, drag=ViscousDrag(0.2, 0.2))
    mixed = cf.drilling.mixed_scene(scene, 142.0)
    motion = cf.simulate(mixed.scene, 0.08, dt=5e-4, elements=3, degree=2, start=1.0, progress=False)
    found = mixed.as_drilling(motion)
    whole = cf.drilling.simulate(scene, 0.08, model="torsion", dt=1e-4, elements=800, progress=False)
    for name in ("bit_speed", "surface_torque", "motor_speeds"):
        true, values = (np.reshape(getattr(x, name), (len(x), -1)) for x in (whole, found))
        for own, other in zip(true.T, values.T, strict=True):
            off = np.interp(found.mean_times, whole.mean_times, own) - other
            errors = (
                np.array([np.sqrt(np.mean(off**2)), np.abs(off[found.mean_times > 1e-3]).max()]) / np.abs(own).max()
            )
            assert (errors < [1e-3, 4e-3]).all(), (name, errors)
    line, step = motor(), (3.0, 0.0, 1e-3, (2e3, 300.0), (1e3, 400.0))
    chart = MotorCurve(GIVEN["Q"], [line.speed(0.0), 0.0], [0.0, line.stall_torque()])
    both = [above(x).joints[0] for x in (line, motor(leakage=None, curves=[chart]))]
    one, same = (Parting(x.tool, x.force).meet(*step) for x in both)
    assert one == pytest.approx(same, rel=1e-9) and one[1] != 0
