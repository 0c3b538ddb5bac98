"""Controls that are called once a sample, linear ones, laws of the bit and autodrillers against independent truths."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling import (
    Autodriller,
    BitOnRock,
    Discs,
    Drilling,
    Hook,
    Karnopp,
    Matched,
    RateLaw,
    Rational,
    SampledControl,
    Stribeck,
    TableLaw,
    TopDrive,
    TorqueOverTime,
)
from cosserat_fenicsx.drilling.choose import chosen
from cosserat_fenicsx.parts import Time, Torque, TorsionalDamping, TorsionalStiffness

pytestmark = [pytest.mark.serial, pytest.mark.once]
STEEL = cf.Material(E=206e9, nu=0.3, density=7850.0)
TRUTHS = json.loads((Path(__file__).parent / "reference" / "controls.json").read_text())


def pipe(length):
    """5 in pipe of the impedance 296.25 N m s/rad."""
    return cf.well.DrillString([cf.well.Collar(length, None, 0.127, 0.10861, material=STEEL)])


@dataclass(frozen=True)
class Held(SampledControl):
    """A PI control whose integral is summed at samples, with the torque that it begins with."""

    Kp: TorsionalDamping
    Ki: TorsionalStiffness
    faster: float = 0.0
    first: Torque = 0.0
    sample: Time = 0.05
    delay: Time = 0.0

    def begin(self):
        return (0.0,)

    def torque(self, state, now):
        error = now.asked + self.faster - now.speed
        state = state + error * self.sample
        return self.first + self.Kp * error + self.Ki * state[0], state

    def gains(self, impedance):
        return cf.drilling.Gains(Kp=self.Kp, Ki=self.Ki)


def steady(string, drive, torque, inertia=0.0):
    bit = BitOnRock(Stribeck(torque, torque), inertia=inertia)
    return Drilling(string, drive, bit, start="steady")


def at(history, times, *series):
    """Rows over the times (s) of series at the ends of steps, or means of their own times."""
    return np.column_stack([np.interp(times, when, values) for when, values in series])


@pytest.mark.parametrize("name", [name for name in TRUTHS if "two inertias" in name])
def test_sampled_on_two_inertias(name, truth):
    given, known = TRUTHS[name]["input"], TRUTHS[name]["truth"]
    begin = given["T0"] + given["c2"] * given["Om"]
    control = Held(given["Kp"], given["Ki"], given["dOm"], begin, given["Ts"], given["late"] * given["Ts"])
    discs = Discs((900.0, given["I2"]), (given["k"],), drags=(0.0, given["c2"]))
    scene = steady(discs, TopDrive(given["Om"], given["I1"] - 900.0, control), given["T0"])
    found = cf.drilling.simulate(scene, given["duration"], dt=given["Ts"] / 20, progress=False)
    twist = found.drive_angle - found.bit_angle
    rows = np.array(known["rows: t, drive speed, disc speed, spring torque"])
    expected = rows[:, 1:]
    found = at(found, rows[:, 0], *((found.times, x) for x in (found.drive_speed, found.bit_speed, given["k"] * twist)))
    truth(f"{name}, speeds and torque", found, expected, 1e-4)


def test_sampled_on_waves(truth):
    known = TRUTHS["sampled PI, uniform string of waves, 2T = m Ts"]
    given, known = known["input"], known["truth"]
    control = Held(given["Kp"], given["Ki"], given["dOm"], given["T0"], given["Ts"])
    scene = steady(pipe(given["L"]), TopDrive(given["Om"], given["I"], control), given["T0"])
    found = cf.drilling.simulate(scene, given["duration"] + 0.1, dt=given["Ts"] / 160, progress=False)
    rows = np.array(known["rows: t, drive speed, surface torque"])
    got = at(found, rows[:, 0], (found.times, found.drive_speed), (found.mean_times, found.surface_torque))
    truth("sampled PI, waves, speed and torque", got, rows[:, 1:], 1e-4)


def found_by(name):
    """The motion of a stick-slip truth, above a matched impedance, from rest or steady as its code has it."""
    given = TRUTHS[name]["input"]
    law = {
        "Coulomb": lambda: Karnopp(given["a"], given["b"]),
        "Stribeck": lambda: Stribeck(given["a"], given["b"], given["c_law"]),
        "rational": lambda: Rational(given["a"], given["b"]),
    }[given["law"]]()
    control = Matched(given["drive impedance over Z"] * given["Z"])
    bit = BitOnRock(law, inertia=given["I"])
    scene = Drilling(pipe(given["L"]), TopDrive(given["Om"], control=control), bit)
    return cf.drilling.simulate(
        scene, given["duration"], elements=1000 if given["law"] == "Coulomb" else 600, progress=False
    )


@pytest.mark.parametrize("name", [name for name in TRUTHS if name.startswith("stick-slip, ")])
def test_stick_slip_of_waves(name, truth):
    known, found = TRUTHS[name]["truth"], found_by(name).stick_slip()
    truth(f"{name}, period and peak", [found.period, found.peak], [known["period"], known["peak"]], 1e-4)


def test_stick_slip_of_one_disc(truth):
    known = TRUTHS["stick-slip of one disc, drop at once, exact cycle"]
    given, known = known["input"], known["truth"]
    discs = Discs((1.0, given["J"]), (given["k"],), drags=(0.0, given["c"]))
    scene = Drilling(discs, TopDrive(given["Om"]), BitOnRock(Karnopp(given["Ts"], given["Td"])))
    found = cf.drilling.simulate(scene, 60.0, dt=1e-3, progress=False).stick_slip()
    cycle = [known["period"], known["largest speed of the disc"]]
    truth("stick-slip of one disc, period and peak", [found.period, found.peak], cycle, 1e-4)


def test_autodriller(truth):
    """Weight by the hook, to a thousandth of the weight asked for."""
    given, known = TRUTHS["autodriller"]["input"], TRUTHS["autodriller"]["truth"]
    rows = np.array(known["waves: t, weight at the hook, hook speed"])
    control = Autodriller(given["Ws"], given["Kp"], given["Ki"])
    bit = BitOnRock(RateLaw(given["c"]))
    scene = Drilling(pipe(given["L"]), TopDrive(0.0), bit, hook=Hook(autodriller=control))
    found = cf.drilling.simulate(scene, 200.1, elements=100, save_every=0.05, progress=False)
    weight = scene.segments[0].weight * given["L"] - found.hook_load
    told = np.interp(rows[:, 0], found.mean_times, weight)
    truth("autodriller on waves, weight over that asked for", told, rows[:, 1], 1e-3, of=given["Ws"])


def test_a_bit_that_drills_is_free_where_it_moved_up_in_the_mean():
    """At the ends of steps its velocity swings around the mean one: that once freed it in every other step."""
    end, found, state = RateLaw(14e6, 2e3).end(4e4, None, None), [], np.zeros((2, 2))
    model = SimpleNamespace(bit_state=lambda: state)
    for place, velocity in ((1.0, -9.0), (2.0, 9.0), (1.0, 3.0), (1.0, 0.0)):
        found.append(end.begin(model, 1e-3).tangent[0, 0])
        state[:, 0] = place, velocity
        end.commit(model, 1e-3)
    assert found == [14e6, 14e6, 14e6, 0.0]


@pytest.mark.parametrize(("law", "on_bit", "driller"), [
    (RateLaw(18e6), None, Autodriller("2 MN", 1e-8)),
    (RateLaw(18e6), None, Autodriller(cf.signals.Ramp((2e6,), end=5.0), 1e-8)),
    (Stribeck(0.6, 0.4, 3.0, radius=0.1), cf.signals.Ramp((2e6,), end=5.0), None),
])  # fmt: skip
def test_a_weight_on_bit_above_that_of_the_string_is_told(law, on_bit, driller):
    scene = Drilling(pipe(1000.0), TopDrive(6.0), BitOnRock(law, on_bit), hook=driller and Hook(autodriller=driller))
    assert any("2000 kN, is more than the string weighs" in x for x in chosen(scene)[1])
    at_most = driller and Hook(autodriller=replace(driller, weight=1e5))
    light = replace(scene, bit=BitOnRock(law, on_bit and 1e5), hook=at_most)
    assert not any("than the string weighs" in x for x in chosen(light)[1])


def test_a_steady_start_below_an_autodriller_has_no_weight_on_bit():
    """The block stands still at the start: a bit that drills by its weight would give way at once."""
    scene = Drilling(pipe(500.0), TopDrive(6.0), BitOnRock(RateLaw(18e6, 2e3)),
                     hook=Hook(autodriller=Autodriller(1e4, 2e-7)), start="steady")  # fmt: skip
    assert np.ptp(cf.drilling.simulate(scene, 0.1, progress=False).bit_speed) < 1e-9
    with pytest.raises(cf.SceneError, match="start = 'steady': expected a bit without a weight, BitOnRock"):
        cf.drilling.simulate(replace(scene, bit=replace(scene.bit, weight=1e4)), 0.1, progress=False)


def test_small_motions_leave_an_autodriller_out():
    hook = Hook(autodriller=Autodriller(100e3, 2e-8))
    scene = Drilling(pipe(1000.0), TopDrive(12.0), BitOnRock(Stribeck(5e3, 3e3, 3.0), 100e3), hook=hook)
    (caution,) = cf.drilling.stability(scene, [12.0], modes=1).cautions
    assert "the autodriller is left out" in caution
    (caution,) = cf.drilling.frequency_response(scene, [0.1, 0.2]).cautions
    assert "the autodriller is left out" in caution


@dataclass(frozen=True)
class Broken(Held):
    """Returns something else from 0.1 s on."""

    found: object = None

    def torque(self, state, now):
        return (0.0, state) if now.time < 0.09 else self.found


@pytest.mark.parametrize(("found", "words"), [
    ((float("nan"), (0.0,)), "Broken.torque = nan: expected a finite number at t = 0.1 s"),
    (3e3, "Broken.torque = 3000.0: expected the torque and the new state at t = 0.1 s"),
    ((3e3, (0.0, 1.0)), "expected a state of 1 numbers at t = 0.1 s, as begin returned"),
    ((3e3, (float("inf"),)), "Broken.torque = .*: expected a state of finite numbers"),
])  # fmt: skip
def test_a_control_that_breaks_is_refused_where_it_does(found, words):
    scene = steady(pipe(1000.0), TopDrive(6.0, 2900.0, Broken(1e3, 1e3, found=found)), 0.0)
    with pytest.raises(cf.SceneError, match=words):
        cf.drilling.simulate(replace(scene, start="rest"), 1.0, dt=0.01)


def test_torque_over_time():
    """On an inertia alone the speed is the integral of the torque."""
    control = TorqueOverTime(cf.signals.Ramp((2e3,), end=2.0))
    scene = Drilling(Discs((100.0, 100.0), (1e5,)), TopDrive(None, 800.0, control))
    found = cf.drilling.simulate(scene, 4.0, progress=False)
    assert (found.drive_speed[-1] * 900 + found.bit_speed[-1] * 100) == pytest.approx(6e3, rel=1e-6)


@pytest.mark.parametrize(("make", "words"), [
    (lambda: TableLaw((0.0, 2.0, 1.0), (3e3, 2e3, 1e3)), "TableLaw.speeds = .*begin at 0 and ascend"),
    (lambda: TableLaw((0.0, 2.0), (3e3, -2e3)), "TableLaw.torques"),
    (lambda: Rational(0.0, 2.0), "Rational.peak = 0"),
    (lambda: Autodriller(1e5), "Autodriller.Kp = 0.0"),
    (lambda: Autodriller(), "Autodriller.weight = None"),
    (lambda: Autodriller(1e5, 1e-8, limits=(0.1, 0.0)), "Autodriller.limits"),
    (lambda: Hook(speed=0.1, autodriller=Autodriller(rate=0.01)), "Hook.speed = 0.1: expected 0 beside"),
])  # fmt: skip
def test_refused_by_name(make, words):
    with pytest.raises(cf.SceneError, match=words):
        make()


def test_samples_shorter_than_two_steps_are_refused():
    scene = Drilling(pipe(1000.0), TopDrive(6.0, 2900.0, Held(1e3, 1e3, sample=0.01)))
    with pytest.raises(cf.SceneError, match="Held.sample = 0.01: expected at least two steps"):
        cf.drilling.simulate(scene, 1.0, dt=0.008)


def test_a_table_is_met_by_its_curve(tmp_path):
    """Close to the law that it samples; stored and resumed with an autodriller and a delayed control."""
    speeds = np.linspace(0.0, 40.0, 400) ** 1.5 / 40**0.5
    law = Stribeck(6e3, 4e3, 3.0)
    table = TableLaw(tuple(speeds), tuple(law.torque(x, 0.0) for x in speeds))
    scene = Drilling(pipe(1000.0), TopDrive(6.0, 2900.0, Held(1e3, 1e3, delay=0.07)), BitOnRock(table, inertia=350.0))
    whole = cf.drilling.simulate(scene, 6.0, progress=False)
    smooth = replace(scene, bit=replace(scene.bit, law=law))
    expected = cf.drilling.simulate(smooth, 6.0, progress=False)
    assert np.abs(whole.bit_speed - expected.bit_speed).max() < 0.02
    cf.drilling.simulate(scene, 3.333, folder=tmp_path / "run", progress=False)
    np.testing.assert_array_equal(cf.resume(tmp_path / "run", scene, duration=6.0).rows, whole.rows)
    drilled = Drilling(
        pipe(500.0),
        TopDrive(6.0),
        BitOnRock(RateLaw(18e6, "2 kN m")),
        hook=Hook(autodriller=Autodriller("10 kN", 2e-7)),
    )
    whole = cf.drilling.simulate(drilled, 2.0, progress=False)
    cf.drilling.simulate(drilled, 1.01, folder=tmp_path / "down", progress=False)
    np.testing.assert_array_equal(cf.resume(tmp_path / "down", duration=2.0).rows, whole.rows)


def test_in_a_scene_file(tmp_path):
    """All of them are known to a process that has read nothing else."""
    file = Path(__file__).parent.parent / "demos" / "strings" / "autodriller.toml"
    text = file.read_text(encoding="utf-8")
    assert cf.read(file).scene.hook.autodriller == Autodriller(1e5, 2e-8, 2e-9, sample=0.05)
    for law, expected in (
        ('{ type = "Rational", peak = "6 kN m", speed = "2 rad/s" }', Rational(6e3, 2.0)),
        ('{ type = "TableLaw", speeds = [0.0, 2.0], torques = ["6 kN m", "4 kN m"] }', TableLaw((0, 2), (6e3, 4e3))),
    ):
        line = next(x for x in text.splitlines() if x.startswith("law"))
        (tmp_path / "scene.toml").write_text(text.replace(line, f"law = {law}"), encoding="utf-8")
        assert cf.read(tmp_path / "scene.toml").scene.bit.law == expected
