"""Drill-strings in motion: which model and why, histories, charts, scene files, and what is refused."""

import inspect
import json
import math
import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fake_string import Pendulum, scene, use

import cosserat_fenicsx as cf
from cosserat_fenicsx.cli.main import main
from cosserat_fenicsx.quantities import DIMENSIONS
from cosserat_fenicsx.drilling.bit_laws import BitLaw
from cosserat_fenicsx.drilling.charts import advance_unit
from cosserat_fenicsx.drilling.choose import BOTH, TORSION, chosen
from cosserat_fenicsx.drilling.charts import Stage
from cosserat_fenicsx.drilling.history import DrillingHistory
from cosserat_fenicsx.drilling.protocol import LEDGER, PROFILE, SERIES
from cosserat_fenicsx.drilling.scenefile import DrillingScene, SimulateDrilling, StabilityMap
from cosserat_fenicsx.drilling.stick_slip import cycle_of
from cosserat_fenicsx.drilling.top_drive import DriveControl
from cosserat_fenicsx.parts import arguments_of, from_data, members, to_data

pytestmark = [pytest.mark.serial, pytest.mark.once]
STRAIGHT = cf.well.WellPath.from_survey([0, 2000], [0, 0], [0, 0])
BENT = cf.well.WellPath.from_survey([0, 500, 1100, 3500], [0, 0, 60, 60], [0, 0, 0, 0])
MUD = cf.well.Mud(1200.0)


def hole(path, friction=0.2):
    return cf.well.Borehole(path, [cf.well.HoleSection(path.length, 0.2159, friction)])


def bit():
    return cf.drilling.BitOnRock(cf.drilling.Stribeck(0.8, 0.5, 3.0, radius=0.1), weight=80e3)


@pytest.mark.parametrize(("changed", "model", "words"), [
    ({}, TORSION, "nothing moves along the axis$"),
    ({"bit": bit()}, TORSION, "nothing moves along the axis, and the weight on bit stays as it is"),
    ({"bit": bit(), "hole": hole(BENT), "mud": MUD, "depth": 2000.0}, TORSION, "and the weight on bit stays as it is"),
    ({"bit": cf.drilling.BitOnRock(cf.drilling.Cutting(0.1, 60e6, 0.6, 4))}, BOTH,
     "the torque on bit follows the depth of cut"),
    ({"bit": cf.drilling.BitOnRock(cf.drilling.Lobes(3, 2e-3), weight=80e3)}, BOTH,
     "the lobes of the rock lift the bit"),
    ({"bit": None, "hook": cf.drilling.Hook(speed=0.3)}, BOTH, "the hook moves"),
    ({"bit": None, "hook": cf.drilling.Hook(speed=cf.signals.Ramp((0.3,)))}, BOTH, "the hook moves"),
    ({"hook": cf.drilling.Hook(stiffness=5e6)}, TORSION, "nothing moves along the axis"),
    ({"string": cf.drilling.Discs((9.0, 4.0), (7.0,))}, TORSION, "turn alone"),
    ({"string": cf.drilling.Discs((9.0, 4.0), (7.0,), masses=(1.0, 1.0), axial_stiffnesses=(1.0,))}, BOTH,
     "have masses"),
])  # fmt: skip
def test_the_cheapest_model_that_is_asked_for(changed, model, words):
    found, why = chosen(scene(**changed))
    assert found == model
    assert re.search(words, why[0]), why


def test_what_is_asked_for_is_taken_and_told():
    assert chosen(scene(), BOTH) == (BOTH, ["axial and torsional: as asked"])
    moving = scene(bit=None, hook=cf.drilling.Hook(speed=0.3))
    assert chosen(moving, TORSION)[1][1].startswith("APPROXIMATE: torsion alone leaves out the axial motion")
    with pytest.raises(cf.SceneError, match="or 'auto', since with Cutting the torque on bit follows"):
        chosen(scene(bit=cf.drilling.BitOnRock(cf.drilling.Cutting(0.1, 60e6, 0.6, 4))), TORSION)
    with pytest.raises(cf.SceneError, match="expected 'torsion' or 'auto': discs without masses turn alone"):
        chosen(scene(string=cf.drilling.Discs((9.0, 4.0), (7.0,))), BOTH)


def test_buckling_in_the_hole_is_told():
    """Pipe in a vertical hole under weight on bit: sinusoidal below the depth where the compression is Lubinski's
    load."""
    pipe = cf.well.DrillString([cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
    law, weight = cf.drilling.Stribeck(3000.0, 2000.0, 3.0), 20e3
    loaded = scene(string=pipe, bit=cf.drilling.BitOnRock(law, weight=weight), hole=hole(STRAIGHT, 0.0), mud=MUD)
    why = chosen(loaded)[1]
    assert len(why) == 2 and why[1].startswith("APPROXIMATE: the compression between md = ")
    assert "buckling in the hole (rotary drilling, 20 kN)" in why[1] and why[1].endswith("that takes a rod model")
    segment = loaded.segments[0]
    EI = loaded.laid[0].component.stiffness.bending[0]
    critical = 1.94 * np.cbrt(EI * segment.weight**2)
    top = 2000 - (weight - critical) / segment.weight
    told = float(why[1].split("md = ")[1].split(" ")[0])
    assert told == pytest.approx(top, abs=60)  # at the points of the soft string
    assert len(chosen(scene(string=pipe, hole=hole(BENT), mud=MUD))[1]) == 1  # rotates off bottom, in tension
    flat = cf.well.WellPath.from_survey([0, 500, 1100, 3500], [0, 0, 88, 88], [0, 0, 0, 0])
    lowered = scene(string=pipe, bit=None, hole=hole(flat, 0.4), mud=MUD, hook=cf.drilling.Hook(speed=-0.3))
    assert "(trip in, " in chosen(lowered)[1][1]


@pytest.mark.parametrize(("changed", "settings"), [
    ({"bit": cf.drilling.BitOnRock(cf.drilling.Stribeck(6e3, 4e3, 3.0), inertia=50.0)}, {}),
    ({"bit": None, "hook": cf.drilling.Hook(speed=0.2)}, {"elements": 40}),
    ({"string": cf.drilling.Discs((930.0, 2782.0), (700.0,))}, {}),
])  # fmt: skip
def test_every_model_moves_and_goes_on(changed, settings, tmp_path):
    """A longer motion of two parts has the digits of one; halving the step is reflected in the errors."""
    given = scene(**changed)
    whole = cf.drilling.simulate(given, 6.0, check=True, **settings)
    cf.drilling.simulate(given, 3.0, folder=tmp_path / "part", profile_every=6.0 / 400, **settings)
    again = cf.resume(tmp_path / "part", duration=6.0)
    assert np.array_equal(again.rows, whole.rows, equal_nan=True) and np.isfinite(whole.errors.peak)
    assert np.array_equal(again.angle, whole.angle) and again.sticking.shape == again.speed.shape
    with pytest.raises(cf.SceneError, match="duration = 3.0: expected at least 6 s, the last one asked for"):
        cf.resume(tmp_path / "part", duration=3.0)
    assert whole.times[-1] == pytest.approx(6.0, abs=whole.dt) and "Estimated errors by the step" in str(whole)


def test_rotation_alone_moves_nothing_along_the_axis():
    """Which is why torsion is enough for a torque that follows the weight on bit: both models agree."""
    string = cf.well.DrillString([cf.well.Collar(200.0, "NC46-65"), cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
    given = scene(
        string=string, bit=bit(), hole=hole(BENT), mud=MUD, drive=cf.drilling.TopDrive(cf.signals.Ramp((6.0,), end=2.0))
    )
    found, both = (cf.drilling.simulate(given, 30.0, model=name) for name in ("auto", BOTH))
    assert found.model == TORSION and both.model == BOTH
    assert (both.weight_on_bit == 80e3).all() and not both.bit_advance.any()
    assert found.surface_torque[-1] == pytest.approx(both.surface_torque[-1], rel=1e-2)
    assert found.bit_angle[-1] == pytest.approx(both.bit_angle[-1], rel=1e-2)


def test_elements_and_steps():
    drilled = scene(bit=cf.drilling.BitOnRock(cf.drilling.Stribeck(6e3, 4e3, 3.0), inertia=50.0))
    assert len(cf.drilling.simulate(drilled, 1.0, elements=80).depths) == 81
    with pytest.raises(cf.SceneError, match="elements = 80: expected None beside dt: waves of torsion"):
        cf.drilling.simulate(drilled, 1.0, elements=80, dt=0.01)
    with pytest.raises(cf.SceneError, match="elements = 8: expected None for Discs"):
        cf.drilling.simulate(scene(string=cf.drilling.Discs((9.0, 2.0), (7.0,)), bit=None), 1.0, elements=8)


def test_more_weight_on_bit_than_the_string_has_along_the_hole_is_told():
    """Upright in air the segments' own weight; at 60 degrees half of it."""
    heavy = cf.drilling.BitOnRock(cf.drilling.Stribeck(6e3, 4e3, 3.0), weight=1e8)
    given = scene(bit=heavy)
    weighs = sum(part.weight * part.length for part in given.segments)
    told = f"the string weighs along the hole, {weighs / 1e3:.4g} kN: the hook would have to push"
    assert told in "\n".join(chosen(given)[1])
    slanted = cf.well.WellPath.from_survey([0, 2000], [60, 60], [0, 0])
    given = scene(bit=heavy, hole=hole(slanted, 0.0), mud=MUD)
    weighs = sum(part.weight * part.length for part in given.segments) / 2
    assert f"along the hole, {weighs / 1e3:.4g} kN" in "\n".join(chosen(given)[1])
    assert not any("push" in line for line in chosen(scene(bit=bit(), string=long()))[1])


def long():
    return cf.well.DrillString([cf.well.Collar(300.0, outer_diameter=0.2032, inner_diameter=0.0714),
                           cf.well.DrillPipe(1700.0, size="5 in 19.50 lb/ft")])  # fmt: skip


def test_a_small_torque_that_follows_from_the_weight_is_no_mistake_in_units():
    law = cf.drilling.Stribeck(0.06, 0.05, 3.0, radius=0.1)
    inclined = scene(bit=cf.drilling.BitOnRock(law, weight=6e3), hole=hole(BENT), mud=MUD, depth=2000.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert chosen(inclined)[0] == TORSION
    hardly = r"The torque of Stribeck\(...\) = 5 N m is hardly a torque on bit"
    with pytest.warns(cf.SceneWarning, match=hardly) as said:  # without a hole too
        chosen(scene(bit=cf.drilling.BitOnRock(cf.drilling.Stribeck(5.0, 5.0))))
    assert len(said) == 1 and str(said[0].message).endswith("; coefficients of friction need radius= (m)")
    with pytest.warns(cf.SceneWarning, match="BitOnRock.weight = 60 N is hardly a weight on bit") as said:
        chosen(replace(inclined, bit=cf.drilling.BitOnRock(law, weight=60.0)))
    assert len(said) == 1
    with pytest.warns(cf.SceneWarning, match="Motor.torque = 5 N m is hardly a torque of a drive"):
        scene(drive=cf.drilling.TopDrive(control=cf.drilling.Motor(5.0)))
    with pytest.warns(cf.SceneWarning, match="Hook.speed = -30 m/s is faster than blocks move.*'-30 m/h'"):
        cf.drilling.Hook(speed=-30.0)


rpm = cf.units.rpm


@pytest.fixture
def history(monkeypatch):
    use(monkeypatch)
    return cf.drilling.simulate(scene(), 60.0)


def test_rows_are_those_of_the_model(history):
    model = Pendulum(scene(), 0.01)
    rows = model.advance(6000)
    for i, name in enumerate(("times", *SERIES, *LEDGER)):
        assert np.array_equal(getattr(history, name), rows[:, i], equal_nan=True), name
    assert len(history) == 6000 and history.times[-1] == 60.0 and history.model == "torsion"
    assert history.profile_times == pytest.approx(np.arange(1, 401) * 0.15) and history.speed.shape == (400, 5)
    assert (history.angle[-1] == model.profile()[0]).all() and history.sticking.dtype == bool
    assert history.sticking[:, -1].any() and not history.sticking[:, 0].any()


def test_rows_are_thinned(history, monkeypatch):
    coarse = cf.drilling.simulate(scene(), 60.0, save_every=0.05, profile_every=2.0)
    assert (coarse.bit_speed == history.bit_speed[4::5]).all() and len(coarse.profile_times) == 30
    assert (coarse.speed[2] == history.speed[39]).all()  # both at 6 s


def test_stick_slip(history):
    """Free swings about the drive's speed between two rests: the period of the pendulum in closed form."""
    found = history.stick_slip(since=15.0)
    J, k, Om, drop = 374.0, 473.0, 60 * rpm, 3000.0
    w = np.sqrt(k / J)
    a = drop / k  # the twist at release beyond that of the friction in motion
    swing = (2 * np.pi - 2 * np.arctan2(a * w, Om)) / w  # until the bit comes to rest
    assert found.period == pytest.approx(swing + 2 * a / Om, rel=1e-3)
    assert found.peak == pytest.approx(Om + np.hypot(Om, a * w), rel=1e-2)
    assert found.stuck == pytest.approx(2 * a / Om / found.period, abs=6e-3) and found.sticks
    reach = k * np.hypot(a, Om / w)
    assert found.torque == pytest.approx((drop - reach, drop + reach), abs=60) and found.severity > 1
    assert len(found.starts) == len(found.stops) and np.ptp(found.periods) < 0.03
    assert "stick-slip: period" in str(history) and "bit (rpm)" in str(history) and "hook load" not in str(history)
    with pytest.raises(cf.SceneError, match=r"stick_slip.since = 70: expected .* up to 60 s"):
        history.stick_slip(70.0)


def test_starts_and_stops_are_interpolated():
    from cosserat_fenicsx.drilling.stick_slip import crossings

    speed = np.array([0.0, 0.0, 2.0, 2.0, 0.0, 0.6, 0.4, 0.0, -4.0])  # it creeps at 5 s
    starts, stops = crossings(np.arange(9.0), speed, 0.5, 1.0)
    assert starts == pytest.approx([1.25, 7.125]) and stops == pytest.approx([3.75])


@pytest.mark.parametrize("sign", [1, -1])
def test_a_bit_that_swings_back_stops_once_a_period(sign):
    """6 + 10 sin(2 pi t/5): it turns against the drive for a time, and no sample is at rest."""
    rows = np.zeros((12000, 1 + len(SERIES) + len(LEDGER)))
    t = rows[:, 0] = 0.005 * np.arange(12000) + 0.0017
    rows[:, 1 + SERIES.index("drive_speed")] = 6.0 * sign
    rows[:, 1 + SERIES.index("bit_speed")] = sign * (6 + 10 * np.sin(2 * np.pi * t / 5))
    found = DrillingHistory(scene(), "torsion", (), 0.005, np.arange(2.0), rows).stick_slip()
    assert found.period == pytest.approx(5, rel=1e-4) and found.sticks and found.stuck == 0
    assert found.starts[0] % 5 == pytest.approx(5 - np.arcsin(0.6) * 5 / (2 * np.pi), abs=6e-3)


def test_balance(history):
    assert np.abs(history.balance).max() < 0.05 * history.work_of_drive[-1] and history.balance[-1] != 0


def test_tables_and_files(history, tmp_path):
    history.write(tmp_path / "out.csv")
    lines = (tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("time (s),drive speed (rad/s),drive angle (rad)") and "hook load" not in lines[0]
    assert len(lines) == 6001 and lines[-1].startswith("60.0,6.283185307179586,")
    with pytest.raises(cf.SceneError, match=r"ends in .csv or .nc"):
        history.write(tmp_path / "out.xlsx")
    pytest.importorskip("pandas")
    assert history.to_dataframe()["bit speed (rad/s)"].max() == history.bit_speed.max()
    xarray = pytest.importorskip("xarray")
    found = history.to_xarray()
    assert found.speed.dims == ("profile_time", "depth") and found.bit_speed.attrs["units"] == "rad/s"
    assert set(found) == {*SERIES, *LEDGER, *PROFILE, "balance", "pressure"}
    pytest.importorskip("h5netcdf")
    history.write(tmp_path / "out.nc")
    again = xarray.open_dataset(tmp_path / "out.nc", engine="h5netcdf")
    assert (again.bit_angle.values == history.bit_angle).all() and again.attrs["model"] == "torsion"


@pytest.mark.parametrize(("given", "words"), [
    ({"duration": -1.0}, r"simulate.duration = -1.0: expected a positive number \(s\)"),
    ({"dt": 0.0}, r"simulate.dt = 0.0: expected a positive number \(s\)"),
    ({"dt": 100.0}, r"simulate.dt = 100.0: expected at most the duration, 60 s"),
    ({"dt": 1e-8}, r"dt = 1e-08: expected at least 6e-07 s: 1e\+08 steps in 60 s"),
    ({"dt": 0.1}, r"dt = 0.1: expected a step of at most 0.0531 s, .* 1 rad in a step at 3 times the speed"),
    ({"duration": 3e5}, r"save_every = None: expected at least 0.015 s: 2e\+07 rows in 300000 s"),
    ({"save_every": 61.0}, r"save_every = 61.0: expected at most the duration"),
    ({"elements": 0}, r"elements = 0: expected how many along the string"),
    ({"model": "torsional"}, r"model = 'torsional': did you mean 'torsion'"),
    ({"scene": 3}, r"scene = 3: expected a Drilling"),
])  # fmt: skip
def test_what_is_refused(given, words, monkeypatch):
    use(monkeypatch)
    with pytest.raises(cf.SceneError, match=words):
        cf.drilling.simulate(**{"scene": scene(), "duration": 60.0, **given})


def test_jumps_in_speed_need_a_drive_that_follows(monkeypatch):
    use(monkeypatch)
    drive = cf.drilling.TopDrive(cf.signals.Step((6.0,), start=3.0))
    with pytest.raises(cf.SceneError, match=r"no jump, such as that of 6 rad/s at t = 3 s: no drive follows it"):
        cf.drilling.simulate(scene(drive=drive), 10.0)
    ramp = cf.drilling.TopDrive(cf.signals.Ramp((6.0,), start=1.0, end=3.0))
    assert cf.drilling.simulate(scene(drive=ramp), 10.0).drive_speed[-1] == 6.0


def test_a_failing_step_keeps_what_is_done(monkeypatch):
    use(monkeypatch, fails_at=1000)
    with pytest.raises(cf.NotConverged, match="the step at t = 10 s fails") as stop:
        cf.drilling.simulate(scene(), 60.0)
    assert 900 < len(stop.value.path) <= 1000 and "halved" in stop.value.path.counts


def test_ctrl_c_keeps_what_is_done(monkeypatch):
    use(monkeypatch, stops_at=2000)
    with pytest.raises(
        cf.Interrupted, match=r"interrupted after \d+ times, which the exception's `path` holds"
    ) as stop:
        cf.drilling.simulate(scene(), 60.0)
    history = stop.value.path
    assert 1700 < len(history) <= 2000 and history.stick_slip().sticks


def test_progress_is_told(monkeypatch, capsys):
    use(monkeypatch)
    cf.drilling.simulate(scene(), 20.0, progress=True)
    assert "torsion, 5 places: t (s) = " in capsys.readouterr().err


def test_histories_can_be_pickled(history):
    import pickle

    again = pickle.loads(pickle.dumps(history))
    assert (again.bit_speed == history.bit_speed).all() and repr(again) == repr(history)


def test_speeds_of_discs_are_those_at_the_end_of_a_step():
    """Two discs that a constant torque turns, in closed form; means over a step would be off by 3e-3 rad/s."""
    J, k, M = (2122.0, 374.0), 473.0, 1000.0
    drive = cf.drilling.TopDrive(control=cf.drilling.Motor(M))
    found = cf.drilling.simulate(
        cf.drilling.Drilling(cf.drilling.Discs(J, (k,)), drive), 10.0, dt=8e-3, profile_every=1.0
    )
    w = np.sqrt(k * sum(J) / (J[0] * J[1]))
    swing = M / J[0] / w * np.sin(w * found.times)
    for values, exact in ((found.drive_speed, J[1] * swing), (found.bit_speed, -J[0] * swing)):
        assert np.abs(values - (M * found.times + exact) / sum(J)).max() < 1e-4
    rows = np.searchsorted(found.times, found.profile_times - 1e-9)
    assert (found.speed[:, -1] == found.bit_speed[rows]).all()


@pytest.mark.parametrize("model", ["torsion", "axial and torsional"])
def test_what_is_a_mean_has_times_of_its_own(model):
    """Before anything comes back a string takes the torque Z om(t) from a drive: at mean_times to the second order."""
    pipe, off = cf.well.DrillPipe(3000.0, None, 0.127, 0.10861), []
    turned = cf.drilling.Drilling(
        cf.well.DrillString((pipe,)), cf.drilling.TopDrive(lambda t: 10 * np.sin(1.5 * t) ** 2)
    )
    Z = turned.segments[0].torsional_impedance
    for dt in (2e-2, 1e-2):
        found = cf.drilling.simulate(turned, 1.8, model=model, dt=dt)
        exact = Z * 10 * np.sin(1.5 * found.mean_times) ** 2
        off.append(np.abs(found.surface_torque - exact)[found.times > 0.1].max() / exact.max())
    assert off[0] < 2e-3 and off[1] < 0.3 * off[0], off


pytest.importorskip("matplotlib")


@pytest.fixture
def drawn(monkeypatch):
    use(monkeypatch)
    return cf.drilling.simulate(scene(), 30.0)


def curve(panel, label):
    return next(line for line in panel.lines if line.get_label() == label).get_ydata()


def test_over_time(drawn, tmp_path):
    speeds, torques = drawn.plot().axes
    assert curve(speeds, "bit") == pytest.approx(drawn.bit_speed / cf.units.rpm)
    assert curve(torques, "at the surface") == pytest.approx(drawn.surface_torque / 1e3)
    assert [panel.get_ylabel() for panel in (speeds, torques)] == ["speed (rpm)", "torque (kN m)"]
    assert torques.get_xlabel() == "time (s)"
    part = drawn.plot(between=(10.0, 20.0)).axes[0].lines[0].get_xdata()
    assert part[0] == pytest.approx(10.0) and part[-1] == pytest.approx(20.0)
    drawn.plot(tmp_path / "out.png")
    assert (tmp_path / "out.png").stat().st_size > 20_000


def test_the_map(drawn):
    panel, bar = drawn.plot_map().axes
    speeds, sticks, of_bit = panel.collections
    title = panel.figure.get_suptitle()
    assert np.asarray(speeds.get_array()).reshape(5, -1) == pytest.approx(drawn.speed.T / cf.units.rpm)
    assert np.ma.count(np.ma.masked_invalid(sticks.get_array())) == drawn.sticking.sum() > 0
    assert len(of_bit.get_paths()) > 1 and "(at the lower edge: the bit)" in title
    assert bar.get_ylabel() == "speed of rotation (rpm)" and panel.get_ylabel() == "measured depth (m)"
    assert panel.get_ylim() == (1000.0, 0.0) and "grey: held by friction" in title
    assert drawn.plot_map(what="angle").axes[1].get_ylabel() == "turns"
    with pytest.raises(cf.SceneError, match="the torsion model has none: expected model='axial and torsional'"):
        drawn.plot_map(what="tension")
    with pytest.raises(cf.SceneError, match="what = 'speeds': did you mean 'speed'"):
        drawn.plot_map(what="speeds")


def test_what_is_grey_is_told_and_the_drive_is_named(drawn):
    legend = [text.get_text() for text in drawn.plot().axes[0].get_legend().get_texts()]
    assert "bit at rest" in legend
    string, rpm = drawn.scene.string, cf.units.rpm
    drawn.scene = scene(
        drive=cf.drilling.TopDrive(60 * rpm, inertia=2900.0, control=cf.drilling.SoftSpeed(string, 2900.0))
    )
    assert "SoftSpeed drive at 60 rpm" in drawn.plot()._suptitle.get_text()
    Kp, weight = 2 * drawn.scene.segments[0].torsional_impedance, 25 * cf.units.kip
    drive = cf.drilling.TopDrive(60 * rpm, inertia=2900.0, control=cf.drilling.PI(Kp, 1e3))
    drawn.scene = scene(drive=drive, bit=replace(bit(), weight=weight))
    title = drawn.plot(units="field")._suptitle.get_text()
    assert "PI (Kp = 2 impedances) drive at 60 rpm" in title and title.endswith(", 25 klbf on bit")


def test_long_runs_show_bands_between_extremes(monkeypatch):
    use(monkeypatch)
    history = cf.drilling.simulate(scene(), 1000.0, dt=0.02, profile_every=10.0)
    speeds = history.plot().axes[0]
    means = [line.get_ydata().mean() * cf.units.rpm for line in speeds.lines]
    assert means == pytest.approx([history.bit_speed.mean(), history.drive_speed.mean()], rel=0.02)
    tops = [shape.get_paths()[0].vertices[:, 1].max() for shape in speeds.collections]
    assert len(tops) == 2 and max(tops) == pytest.approx(history.bit_speed.max() / cf.units.rpm)
    assert history.plot(between=(900.0, 930.0)).axes[0].lines
    words = f"profiles are 10 s apart, and the period of stick-slip is {history.stick_slip().period:.3g} s"
    title = history.plot_map().get_suptitle()
    assert words in " ".join(title.split()) and words[1:] in str(history)


def test_a_long_way_is_in_metres():
    assert advance_unit(np.array([np.nan, 0.2])) == ("mm", 1e3) and advance_unit(np.array([-3.0, 0.0])) == ("m", 1.0)


def test_phase_and_energy(drawn):
    (panel,) = drawn.plot_phase(since=10.0).axes
    assert panel.get_xlabel().endswith("(rad)") and panel.lines[0].get_xdata()[0] == pytest.approx(
        drawn.drive_angle[999] - drawn.bit_angle[999]
    )
    stored, done, below = drawn.plot_energy().axes
    assert [line.get_label() for line in stored.lines] == ["total", "kinetic", "strain"]
    assert {line.get_label() for line in done.lines} == {"work of the drive", "lost at the bit"}
    assert below.lines[0].get_ydata() == pytest.approx(drawn.balance) and below.get_ylabel().endswith("(J)")


@pytest.mark.parametrize("rpm", [0, 20])
def test_heave_is_drawn_along_the_axis(rpm, tmp_path):
    """Of a string off bottom, with and without rotation: velocities of block and lower end, in map and film too."""
    pipe = cf.well.DrillString([cf.well.DrillPipe(500.0, size="5 in 19.50 lb/ft")])
    hook = cf.drilling.Hook(speed=lambda t: 0.5 * np.cos(6.0 * t))  # upwards
    drilling = cf.drilling.Drilling(pipe, cf.drilling.TopDrive(rpm * cf.units.rpm), hook=hook)
    history = cf.drilling.simulate(drilling, 1.5, profile_every=0.1)
    panels = {panel.get_ylabel(): panel for panel in history.plot().axes}
    lines = {line.get_label(): line for line in panels["velocity downwards (m/s)"].lines}
    assert lines["of the block"].get_ydata() == pytest.approx(-0.5 * np.cos(6.0 * history.times))
    assert lines["of the lower end"].get_ydata() == pytest.approx(history.bit_velocity)
    written = [text.get_text() for panel in panels.values() if panel.get_legend() for text in panel.get_legend().texts]
    assert not any("bit" in text for text in [*written, *panels, history.plot().get_suptitle()])
    assert ("speed (rpm)" in panels) == (rpm > 0)
    assert history.plot_map().axes[1].get_ylabel() == "velocity downwards (m/s)"
    stage = Stage(history, 1.0)
    along, over = stage._figure.axes[1:]
    assert along.get_xlabel() == over.get_ylabel() == "velocity downwards (m/s)"
    pictures = [stage.at(t) for t in history.profile_times[[2, 8]]]
    bands = [picture[:, 100, 0] for picture in pictures]  # down the middle of the string
    assert (np.abs(np.diff(bands[0].astype(int))) > 40).sum() > 20 and (bands[0] != bands[1]).mean() > 0.02
    assert along.lines[0].get_xdata() == pytest.approx(history.velocity[8], abs=1e-9)


def test_charts_refused(drawn, tmp_path):
    for between, words in (((3, 1), "two times .s., ascending"), ((40, 50), "which ends at 30 s")):
        with pytest.raises(cf.SceneError, match=words):
            drawn.plot(between=between)
    with pytest.raises(cf.SceneError, match="since = 40.0: expected a time .s. before the end, 30 s"):
        drawn.plot_phase(since=40.0)
    with pytest.raises(cf.SceneError, match="expected a name that ends in"):
        drawn.plot(tmp_path / "out.docx")
    with pytest.raises(cf.SceneError, match=r"ends in .gif or .mp4"):
        drawn.animate(tmp_path / "out.avi")
    with pytest.raises(cf.SceneError, match="at most 10000 frames"):
        drawn.animate(tmp_path / "out.gif", speed=1e-3)


@pytest.mark.slow
def test_a_film(drawn, tmp_path):
    image = pytest.importorskip("PIL.Image")
    drawn.animate(tmp_path / "out.gif", speed=30.0, fps=5)
    film = image.open(tmp_path / "out.gif")
    assert film.n_frames == 6 and film.size == (960, 600)


ROOT = Path(__file__).parent.parent
FILE = """
title = "Drilling in an inclined hole"

[well]
stations = [[0, 0, 0], [500, 0, 0], [1600, 60, 0], [2500, 60, 0]]
sections = [{ to = 2500.0, diameter = "12 1/4 in", friction = 0.2 }]

[string]
components = [{ type = "Collar", size = "NC56-80", length = 200.0 }, { type = "DrillPipe", size = "5 in 19.50 lb/ft" }]

[mud]
density = "10 ppg"

[drive]
speed = { type = "Ramp", value = "60 rpm", start = 1.0, end = "10 s" }
inertia = 2900.0
control = { type = "SoftSpeed" }

[bit]
weight = "80 kN"
inertia = 50.0
law = { type = "Stribeck", static = "6 kN m", dynamic = "4 kN m", speed = "30 rpm" }

[hook]
stiffness = "5 MN/m"
speed = { type = "Table", times = ["0 s", 5.0], values = ["0 m/s", "10 m/h"] }

[wall_friction]
static = 0.3
kinetic = 0.2
speed = "10 rpm"
of_rotation = true

[drag]
torsion = 0.1
axial = 0.2

[simulate]
duration = "1 min"
dt = "10 ms"

[stability]
speeds = { from = "40 rpm", to = "160 rpm", count = 4 }
weights = ["20 kN", 60e3]
"""


def read(tmp_path, text):
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    return cf.read(tmp_path / "scene.toml")


def test_what_a_file_says(tmp_path):
    found = read(tmp_path, FILE)
    scene, rpm = found.scene, cf.units.rpm
    assert found.title == "Drilling in an inclined hole" and found.settings == {"duration": 60.0, "dt": 0.01}
    assert scene.drive.speed == cf.signals.Ramp((60 * rpm,), 1.0, 10.0)
    assert scene.drive.control.Kp == pytest.approx(4 * scene.segments[0].torsional_impedance)
    assert scene.bit == cf.drilling.BitOnRock(cf.drilling.Stribeck(6e3, 4e3, 30 * rpm), 80e3, 50.0)
    assert scene.hook.stiffness == 5e6 and scene.hook.speed(5.0) == pytest.approx((10 / 3600,))
    assert scene.friction == cf.drilling.WallFriction(0.3, 0.2, 10 * rpm, of_rotation=True)
    assert scene.drag == cf.drilling.ViscousDrag(0.1, 0.2) and scene.mud.density == pytest.approx(1198.264273)
    assert scene.bit_depth == 2500.0 and scene.hole.sections[0].diameter == pytest.approx(0.31115)
    assert found.speeds == pytest.approx([40 * rpm, 80 * rpm, 120 * rpm, 160 * rpm]) and found.weights == (20e3, 60e3)


def test_discs(tmp_path):
    drive = "[drive]\ncontrol = { type = 'Motor', torque = 8e3 }"
    scene = read(tmp_path, f"[discs]\ninertias = [930.0, 2782.0]\nstiffnesses = [700.0]\n{drive}").scene
    assert scene.string == cf.drilling.Discs((930.0, 2782.0), (700.0,)) and scene.drive == cf.drilling.TopDrive(
        control=cf.drilling.Motor(8e3)
    )


LAW = "law = { type = 'Cutting', a = '0.108 m', epsilon = '60 MPa', zeta = 0.6, blades = 4, wear = { stress = '60 MPa', length = 0.011, friction = 0.6 } }"  # noqa: E501


def test_laws_inside_laws(tmp_path):
    scene = read(tmp_path, re.sub("law = .*", LAW, FILE)).scene
    law, data = scene.bit.law, json.loads(json.dumps(to_data(scene)))
    assert to_data(from_data(type(scene), data)) == data
    assert law == cf.drilling.Cutting(0.108, 60e6, 0.6, 4, cf.drilling.Wear(60e6, 0.011, 0.6))
    lobes = "law = { type = 'Lobes', count = 3, amplitude = '2 mm', law = { static = 4e3, dynamic = 4e3 } }"
    found = read(tmp_path, re.sub("law = .*", f"{lobes}\nrock_stiffness = '40 MN/m'", FILE)).scene.bit
    law = cf.drilling.Lobes(3, 2e-3, cf.drilling.Stribeck(4e3, 4e3))
    assert found == cf.drilling.BitOnRock(law, 80e3, 50.0, rock_stiffness=4e7)


@pytest.mark.parametrize(("old", "new", "words"), [
    ("[drive]", "[drives]", r"unknown key 'drives', did you mean 'drive'"),
    ("inertia = 2900.0\n", "", r"TopDrive.inertia = 0.0: expected the drive's own .* for SoftSpeed"),
    ('"SoftSpeed"', '"SoftSpeeds"', r"drive.control.type = 'SoftSpeeds': did you mean 'SoftSpeed'"),
    ('{ type = "SoftSpeed" }', '{ type = "PI", Kp = 3.0 }', r"drive.control: PI.Ki = None: expected a gain: SoftT"),
    ('static = "6 kN m"', 'static = "6 kN"', r"bit.law: Stribeck.static = '6 kN': kN is a unit of force"),
    ('static = "6 kN m"', "static = 3e3", r"bit.law: Stribeck.static = 3000.0: expected at least the dynamic one"),
    ('"Stribeck"', '"Stribek"', r"bit.law.type = 'Stribek': did you mean 'Stribeck'"),
    ("static = 0.3", "static = -0.3", r"wall_friction: WallFriction.static = -0.3: expected a coefficient"),
    ("torsion = 0.1", "torsional = 0.1", r"drag .ViscousDrag.: unknown key 'torsional', did you mean 'torsion'"),
    ('type = "Ramp"', 'type = "Slope"', r"drive.speed.type = 'Slope': known: .*Ramp"),
    ('"10 s"', '"0.5 s"', r"drive.speed: Ramp.end = 0.5: expected a time after 1 s"),
    ('duration = "1 min"', 'duration = "1 minute"', r"simulate.duration = '1 minute': did you mean 'min'"),
    ('duration = "1 min"', "duration = 0.0", r"simulate.duration = 0.0: expected a positive number"),
    ('dt = "10 ms"', "tol = 1e-3", r"\[simulate\]: unknown key 'tol'"),
    ('dt = "10 ms"', 'model = "rod"', r"simulate.model = 'rod'"),
    ("count = 4", "count = 0", r"stability.speeds.count = 0: expected how many from 2"),
    ("[string]", "[discs]\ninertias = [1.0, 2.0]\nstiffnesses = [3.0]\n[string]", "either .string. or .discs."),
])  # fmt: skip
def test_files_that_are_refused(old, new, words, tmp_path):
    assert old in FILE
    with pytest.raises(cf.SceneError, match=words) as refused:
        read(tmp_path, FILE.replace(old, new))
    assert str(refused.value).startswith(str(tmp_path / "scene.toml"))


def test_the_command_line(tmp_path, capsys, monkeypatch):
    pytest.importorskip("matplotlib")
    use(monkeypatch)
    file = ROOT / "demos" / "strings" / "stick_slip.toml"
    assert (
        main(["run", str(file), "--duration", "20", "-o", str(tmp_path / "out"), "--folder", str(tmp_path / "run")])
        == 0
    )
    told = capsys.readouterr().out
    assert told.startswith("Stick-slip of 3000 m") and "bit (rpm)" in told
    names = {"drilling.csv", "drilling.png", "phase.png", "energy.png", "map.png"}
    assert {file.name for file in (tmp_path / "out").iterdir()} == names == set(re.findall(r"\w+\.(?:csv|png)", told))
    assert main(["resume", str(tmp_path / "run"), "--duration", "30"]) == 0
    assert len(cf.read(tmp_path / "run")) == 3000
    for option, value in (("--tol", "1e-3"), ("--degree", "2"), ("--scheme", "energy")):
        assert main(["run", str(file), option, value]) == 2
        assert f"{option} is for rods" in capsys.readouterr().err
    assert main(["run", str(file), "--dt", "1.0"]) == 2 and "a step of at most" in capsys.readouterr().err
    use(monkeypatch, fails_at=500)
    assert main(["run", str(file)]) == 1
    caught = capsys.readouterr()
    assert "the step at t = 5 s fails" in caught.err and "bit (rpm)" in caught.out
    use(monkeypatch, stops_at=500)
    assert main(["run", str(file), "--folder", str(tmp_path / "it stopped")]) == 130
    assert capsys.readouterr().err.count(f"`cosserat resume '{tmp_path / 'it stopped'}'`") == 1, "as a shell takes it"


def test_the_reference_has_every_key_and_unit():
    page = (ROOT / "docs" / "drilling_files.md").read_text(encoding="utf-8")
    told = set(re.findall(r"`([^`]+)`", re.sub(r"```.*?```", "", page, flags=re.S)))
    named = {
        name: cls for name, cls in (members(BitLaw) | members(DriveControl)).items() if name in cf.drilling.__all__
    }
    classes = (
        cf.drilling.TopDrive, *named.values(), cf.drilling.BitOnRock, cf.drilling.Wear, cf.drilling.Hook,
        cf.drilling.WallFriction, cf.drilling.ViscousDrag, cf.drilling.Discs,
    )  # fmt: skip
    assert named.keys() <= told
    arguments = {name for cls in classes for name in inspect.signature(cls).parameters}
    keys = {key for cls in (SimulateDrilling, StabilityMap) for key in arguments_of(cls)}
    keys |= {f"[{key}]" for key in arguments_of(DrillingScene)} - {"[title]", "[depth]", "[start]"}
    units = {
        unit for name in ("angular velocity", "time", "stiffness", "volume", "flow") for unit in DIMENSIONS[name].units
    }
    for expected in (arguments, keys, units):
        assert expected <= told, expected - told
    assert math.isclose(DIMENSIONS["angular velocity"].units["rpm"], math.pi / 30)


def refused(capsys, *arguments):
    assert main([str(x) for x in arguments]) == 2
    return capsys.readouterr().err


def test_mistakes_are_told_in_words_of_the_command_line(tmp_path, capsys, monkeypatch):
    use(monkeypatch)
    file = ROOT / "demos" / "strings" / "stick_slip.toml"
    text, other, folder = file.read_text(encoding="utf-8"), tmp_path / "other.toml", tmp_path / "run"
    other.write_text(text.replace("[drive]", "[topdrive]"), encoding="utf-8")
    assert "unknown key 'topdrive', did you mean 'drive'?" in refused(capsys, "run", other)
    for command in ("modes", "buckling"):
        assert f"cosserat {command} is for rods" in refused(capsys, command, file)
    assert "--static is for rods" in refused(capsys, "run", file, "--static")
    assert "there is no such folder" in refused(capsys, "resume", folder)
    assert main(["run", str(file), "--duration", "5", "--folder", str(folder)]) == 0
    assert f"`cosserat resume {folder}` continues it" in refused(capsys, "run", file, "--folder", folder)
    other.write_text(text.replace("60 rpm", "61 rpm"), encoding="utf-8")
    assert "the scene is not the one of the motion: " in refused(capsys, "run", other, "--folder", folder)
    use(monkeypatch, stops_at=500)
    assert main(["run", str(file)]) == 130
    told = capsys.readouterr().err
    assert told.startswith("cosserat: interrupted after ") and "(t = " in told and "with --folder DIR" in told


def test_explain_tells_what_may_be_mistaken(tmp_path, capsys):
    (tmp_path / "scene.toml").write_text(FILE, encoding="utf-8")
    assert main(["explain", str(tmp_path / "scene.toml")]) == 0
    told = capsys.readouterr().out
    for words in (
        "N/m in mud, impedance",
        "Mud: 1198.26 kg/m^3, 10 ppg.",
        "to 2500 m, 0.31115 m wide, friction 0.2.",
        "Bit at md = 2500 m; largest inclination of the hole 60 degrees.",
        "Drive: 0 rpm to 60 rpm, which depends on time, PI(",
        "its torque does not follow the weight: that takes coefficients and a radius",
        "Hook: 5000 kN/m, the block moves upwards at 0 m/s to 0.0027778 m/s, which depends on time.",
    ):
        assert words in told, words
    assert main(["explain", str(tmp_path / "scene.toml"), "--units", "field"]) == 0
    told = capsys.readouterr().out
    assert "to 8202.1 ft, 12.25 in wide, friction 0.2." in told and "ft-lbf s/rad in torsion" in told
    assert not re.search(r"\d (k?N|N m|m|m/s|N s/m|N m s/rad|kg m\^2|rad/s)\b", told), told
    assert main(["explain", str(ROOT / "demos" / "strings" / "stopped_block.toml")]) == 0
    told = capsys.readouterr().out
    assert "N/m in air, impedance" in told and "Hole: none, no walls" in told
    assert "friction at the wall" not in told.lower()


@pytest.mark.parametrize(("speeds", "starts"), [
    ([9, 9, 0, 9, 9, 0, 9], [2.5, 5.5]),  # slow in one row alone, before the first start and between two
    ([9, 9, 4, 9, 9, 0, 9], [5.5]),  # slowed down, but never to less than a tenth
])  # fmt: skip
def test_a_start_is_one_from_rest(speeds, starts):
    rows = np.zeros((len(speeds), 1 + len(SERIES)))
    rows[:, 0], rows[:, 1 + SERIES.index("bit_speed")] = np.arange(len(speeds)), speeds
    rows[:, 1 + SERIES.index("drive_speed")] = 9.0
    period = cycle_of(rows).period
    assert period == pytest.approx(np.diff(starts)[0]) if len(starts) > 1 else np.isnan(period)
