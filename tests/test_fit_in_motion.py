"""Numbers of a drill-string in motion from readings: a known fit, outliers and gaps, files of rigs, refusals."""

from pathlib import Path

import numpy as np
import pytest

import cosserat_fenicsx as cf

pytestmark = [pytest.mark.serial, pytest.mark.once]
READ = Path(__file__).parent / "reference" / "fit_readings.csv"  # made by another program, see the truth
NOISE = {"drive_speed": 0.05, "surface_torque": 100.0}
RANGES = {"bit.law.static": (4e3, 9e3), "bit.law.dynamic": (1e3, 4.9e3), "bit.law.speed": (1.0, 6.0)}
TRUE, BOUNDS = np.array([6500.0, 4200.0, 3.0]), np.array([31.360931702, 13.130335999, 0.178761845])
OWN = np.array([6475.133124814, 4188.235368836, 3.131017122])  # of Gauss-Newton in the other program


def scene():
    drive = cf.drilling.TopDrive(7.0, 2900.0, cf.drilling.PI(1500.0, 1200.0))
    discs = cf.drilling.Discs((1e-3, 350.0), (470.0,), drags=(0.0, 20.0))
    return cf.drilling.Drilling(discs, drive, cf.drilling.BitOnRock(cf.drilling.Stribeck(5000.0, 3000.0, 2.0)))


def test_a_stribeck_bit_as_another_program_fits_it(truth):
    readings = cf.drilling.Readings.from_csv(READ, NOISE)
    fit = cf.drilling.fit(scene(), readings, RANGES, dt=2e-3)
    truth("fit of a Stribeck bit, true numbers, over Cramer and Rao's bounds", fit.values, TRUE, 3.0, of=BOUNDS)
    truth("fit of a Stribeck bit, standard errors", fit.standard_error, BOUNDS, 0.1)
    assert np.abs(fit.values - OWN).max() < 1e-2 and fit.misfit == pytest.approx(0.99, abs=0.01)
    assert fit.correlation[0, 2] == pytest.approx(-0.9948, abs=2e-3) and not fit.doubts
    assert (fit.derivative_error > 0).all() and (fit.derivative_error < 1e-2).all()
    assert fit.scene.bit.law.static == fit.values[0] and "bit.law.speed and bit.law.static (-0.99" in str(fit)


def test_outliers_gaps_and_a_clock_that_is_behind(tmp_path):
    """As rigs write them: units in the second row, in kN m and rpm, -999.25 for nothing, rows that are missing."""
    t, speed, torque = np.loadtxt(READ, delimiter=",", skiprows=1)[:300].T
    torque[[100, 250]] += 8e3
    speed[120:150] = -999.25 * cf.units.rpm
    file = tmp_path / "rig.csv"
    rows = [f"{a - 0.5:.1f},{b / cf.units.rpm:.9g},{c / 1e3:.9g}" for a, b, c in zip(t, speed, torque, strict=True)]
    rows[200] = rows[200].rsplit(",", 1)[0] + ","
    del rows[60:63]
    file.write_text("\n".join(["Time,Surface RPM,TQ", "s,rpm,kN.m", *rows]))
    readings = cf.drilling.Readings.from_csv(file, NOISE)
    assert (
        np.isnan(readings.values["drive_speed"]).sum() == 30 and np.isnan(readings.values["surface_torque"]).sum() == 1
    )
    known = {name: RANGES[name] for name in ("bit.law.static", "bit.law.dynamic")}
    right = cf.drilling.Drilling(
        scene().string, scene().drive, cf.drilling.BitOnRock(cf.drilling.Stribeck(6.2e3, 4e3, 3.0))
    )
    with pytest.warns(cf.SceneWarning, match="left out: 2 readings of surface_torque .* at t = 9.6, 24.6 s"):
        fit = cf.drilling.fit(right, readings, known, dt=5e-3, clock=None)
    assert fit.clock == pytest.approx(0.5, abs=0.01) and fit.names[-1] == "clock" and 0.9 < fit.misfit < 1.1
    assert (np.abs(fit.values[:2] - TRUE[:2]) < 3.5 * fit.standard_error[:2]).all()
    assert fit.left_out["surface_torque"] == pytest.approx([9.6, 24.6])
    at_readings = np.interp(readings.times + fit.clock, fit.history.times, fit.history.drive_speed)
    np.testing.assert_array_equal(fit.computed("drive_speed"), at_readings)
    panels = fit.plot().axes
    assert [line.get_label() for line in panels[1].lines] == ["read", "read, left out", "with the numbers found"]


def test_one_reading_far_off_does_not_move_the_friction():
    """150 kN off, it moved a coefficient by a quarter."""
    path = cf.well.WellPath.from_survey([0, 500, 1100, 2600], [0, 0, 40, 40], [0, 0, 30, 30])
    hole = cf.well.Borehole(path, [cf.well.HoleSection(2600.0, "8.5 in", friction=0.25)])
    string, rng = cf.well.DrillString([cf.well.DrillPipe(size="5 in 19.50 lb/ft")]), np.random.default_rng(2)
    read = []
    for depth in (1200, 1700, 2100, 2600):
        for operation in (cf.well.TripOut(), cf.well.TripIn()):
            load = cf.well.torque_and_drag(hole, string, operation, mud=cf.well.Mud(1200.0), depth=depth, model="soft")
            read.append(cf.well.RigMeasurement(depth, operation, load.hook_load + 3e3 * rng.normal()))
    clean = cf.well.calibrate_friction(hole, string, read, mud=cf.well.Mud(1200.0))
    off = [*read[:-1], cf.well.RigMeasurement(2600, cf.well.TripIn(), read[-1].hook_load + 150e3)]
    with pytest.warns(cf.SceneWarning, match=r"left out: the hook load \d+ N of trip in at 2600 m, \+1"):
        found = cf.well.calibrate_friction(hole, string, off, mud=cf.well.Mud(1200.0))
    assert found.kept.sum() == len(read) - 1 and found.friction == pytest.approx(clean.friction, abs=3e-3)
    words = " ".join(found.details(units="field").split())
    assert "klbf of trip in at 8530 ft" in words and "left out" in [x.get_label() for x in found.plot().axes[0].lines]
    with pytest.warns(cf.SceneWarning, match="misfit"):
        moved = cf.well.calibrate_friction(hole, string, off, mud=cf.well.Mud(1200.0), leave_out=False)
    assert abs(moved.friction[0] - clean.friction[0]) > 0.02


@pytest.mark.parametrize(("text", "words"), [
    ("time (s),RPM\n1,2\n2,3", "column 'rpm' has no unit"),
    ("time (s),RPM (furlong)\n1,2\n2,3", "unit 'furlong'"),
    ("time (s),RPM (rpm)\n1,2\n1,3", "line 3: expected times that ascend"),
    ("time (s),RPM (rpm)\n1,2\n2,three", "line 3: 'three': expected a number"),
    ("RPM (rpm),TQ (N m)\n1,2\n2,3", "no column is named 'time'"),
    ("time (s),gas (rpm)\n1,2\n2,3", "none of the columns 'time', 'gas' is a quantity"),
])  # fmt: skip
def test_files_that_are_refused(tmp_path, text, words):
    (tmp_path / "rig.csv").write_text(text)
    with pytest.raises(cf.SceneError, match=words):
        cf.drilling.Readings.from_csv(tmp_path / "rig.csv", NOISE)


@pytest.mark.parametrize(("name", "value", "words"), [
    ("drive_speed", 120.0, "1146 rev/min"), ("surface_torque", 12.0, "hardly a torque of a drive"),
    ("hook_load", 900.0, "hardly a hook load"), ("weight_on_bit", 25.0, "hardly a weight on bit"),
])  # fmt: skip
def test_readings_in_other_units_are_doubted(name, value, words):
    with pytest.warns(cf.SceneWarning, match=words):
        cf.drilling.Readings([0.0, 1.0, 2.0], {name: [value, np.nan, 0.0]}, {name: 1.0})


@pytest.mark.parametrize(("unknowns", "words"), [
    ({"bit.low.static": (1.0, 2.0)}, "did you mean 'law'"),
    ({"bit.law.static": (9e3, 4e3)}, "ascending"),
    ({"string.axial_drags": (0.0, 1.0)}, "expected the name of a number"),
    ({"string.inertias[0]": (1e-3, 2e-3)}, r"no reading depends on string.inertias\[0\]"),
])  # fmt: skip
def test_unknowns_that_are_refused(unknowns, words):
    t = np.linspace(0.1, 2.0, 20)
    readings = cf.drilling.Readings(t, {"drive_speed": 3 * t}, {"drive_speed": 0.05})
    with pytest.raises(cf.SceneError, match=words):
        cf.drilling.fit(scene(), readings, unknowns, dt=1e-2)


@pytest.mark.parametrize(("readings", "words"), [
    ({"hook_load": np.full(20, 1e6)}, "readings of hook_load: the torsion model has none: expected model='axial and"),
    ({"drive_speed": np.append(1.0, np.full(19, np.nan))}, "1 readings for 1 unknowns: expected more"),
])  # fmt: skip
def test_readings_that_a_run_has_not_are_refused(readings, words):
    t = np.linspace(0.1, 2.0, 20)
    given = cf.drilling.Readings(t, readings, dict.fromkeys(readings, 1.0))
    with pytest.raises(cf.SceneError, match=words):
        cf.drilling.fit(scene(), given, {"bit.law.static": (4e3, 9e3)}, dt=1e-2)


FILE = """
title = "The law of a bit"
[discs]
inertias = [1e-3, 350.0]
stiffnesses = [470.0]
drags = [0.0, 20.0]
[drive]
speed = "7 rad/s"
inertia = 2900.0
control = { type = "PI", Kp = 1500.0, Ki = 1200.0 }
[bit]
law = { type = "Stribeck", static = "6.2 kN m", dynamic = "4.2 kN m", speed = "3 rad/s" }
[simulate]
dt = 0.01
[fit]
readings = "rig.csv"
noise = { drive_speed = 0.05, surface_torque = "100 N m" }
[[fit.unknowns]]
name = "bit.law.static"
least = "6 kN m"
largest = "7 kN m"
"""


def test_a_fit_in_a_scene_file(tmp_path):
    """Table and picture as the command line writes them, with the number that Python finds."""
    from cosserat_fenicsx.cli.main import main

    (tmp_path / "rig.csv").write_text("".join(READ.read_text().splitlines(keepends=True)[:301]))
    (tmp_path / "fit.toml").write_text(FILE)
    asked = cf.read(tmp_path / "fit.toml")
    told = " ".join(str(asked).split())
    assert "fit 600 readings of drive_speed (noise 0.05 rad/s), surface_torque (noise 100 N m); clock 0 s" in told
    assert "Unknown: bit.law.static between 6 kN m and 7 kN m, here 6.2 kN m" in told
    assert main(["run", str(tmp_path / "fit.toml"), "-o", str(tmp_path / "out")]) == 0
    readings = cf.drilling.Readings.from_csv(tmp_path / "rig.csv", NOISE)
    found = cf.drilling.fit(asked.scene, readings, {"bit.law.static": (6e3, 7e3)}, dt=0.01)
    names, row = (line.split(",") for line in (tmp_path / "out" / "fit.csv").read_text().splitlines()[:2])
    assert float(row[names.index("value")]) == pytest.approx(found.values[0], rel=1e-9)
    assert found.values == pytest.approx(TRUE[:1], rel=0.01) and (tmp_path / "out" / "fit.png").exists()
    cf.write(asked, tmp_path / "again.toml")
    assert cf.read(tmp_path / "again.toml").fit == asked.fit
    for old, new, words in (
        ('"rig.csv"', '"rag.csv"', "rag.csv: cannot be read"), ("bit.law.static", "bit.law.sta", "bit.law.sta"),
        ('"100 N m" }', '"100 N m" }\nclock = "5 min ago"', "clock = '5 min ago': did you mean"),
        ('"7 kN m"', '"5 kN m"', "ascending"), ("0.05", "-1.0", "noise.*above 0"), ('"100 N m"', '"100 N"', "unit"),
    ):  # fmt: skip
        (tmp_path / "wrong.toml").write_text(FILE.replace(old, new))
        with pytest.raises(cf.SceneError, match=f"line [0-9]+.*{words}"):
            cf.read(tmp_path / "wrong.toml")
    (tmp_path / "outside.toml").write_text(FILE.replace('"6.2 kN m"', '"12 kN m"'))
    with pytest.warns(cf.SceneWarning, match="bit.law.static = 12000 N m in the scene is outside its bounds, 6000 to"):
        cf.read(tmp_path / "outside.toml")
