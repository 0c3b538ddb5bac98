"""Sweeps over depths and their folder, friction from measurements, and what a soft string leaves out."""

import contextlib
import json
import math
import os
import signal
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import random_wells
import ufl
from reference_wells import well
from scipy.special import ai_zeros

import cosserat_fenicsx as cf
from cosserat_fenicsx.actions.walls import TubeWall
from cosserat_fenicsx.algebra.newton import LimitedNewton
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.scene import action
from cosserat_fenicsx.statics.problem import solvers_of
from cosserat_fenicsx.well import sweep as module
from cosserat_fenicsx.well.in_space import axes_of
from cosserat_fenicsx.well.rod import rod_in_hole
from cosserat_fenicsx.well.rod.rod_in_hole import solve_in_hole

pytestmark = pytest.mark.serial
PATH = cf.well.WellPath.from_survey([0, 600, 1200, 1800, 2500], [0, 0, 50, 60, 85], [0, 0, 120, 150, 150])
HOLE = cf.well.Borehole(
    PATH, [cf.well.HoleSection(1500, 0.2224, 0.2, "casing"), cf.well.HoleSection(2500, 0.2159, 0.3, "open hole")]
)
STRING = cf.well.DrillString(
    [cf.well.Bit(0.2159), cf.well.Collar(90, "NC46-65"), cf.well.DrillPipe(size="5 in 19.50 lb/ft")]
)
MUD = cf.well.Mud(1200.0)
OPERATIONS = cf.well.TripOut(), cf.well.TripIn(), cf.well.RotateOffBottom()
DEPTHS = np.linspace(800, 2500, 5)


def sweep(depths=DEPTHS, **settings):
    given = {"mud": MUD, "model": "soft", "friction": [0.1, [0.2, 0.4]], **settings}
    return cf.well.depth_sweep(HOLE, STRING, OPERATIONS, depths, **given)


@pytest.mark.once
def test_a_sweep_is_its_answers():
    found = sweep()
    assert found.hook_load.shape == (3, 2, 5) and len(found) == 30 and found.done.all()
    hole = HOLE.with_friction([0.2, 0.4])
    for i, operation in enumerate(OPERATIONS):
        answer = cf.well.torque_and_drag(hole, STRING, operation, mud=MUD, depth=DEPTHS[3], model="soft")
        assert found.hook_load[i, 1, 3] == answer.hook_load and found.surface_torque[i, 1, 3] == answer.surface_torque
    assert (found.hook_load[0] > found.hook_load[2]).all() and (found.hook_load[2] > found.hook_load[1]).all()
    assert "of 15; to_dataframe() has all)" in str(sweep(np.linspace(800, 2500, 15))) and "has all" not in str(found)
    assert found.label(1, 1) == "trip in, friction 0.2, 0.4" and f"{found.hook_load[1, 1, 2] / 1e3:.2f}" in str(found)


def test_a_depth_without_an_answer_is_a_row_that_says_so(monkeypatch, tmp_path):
    """No equilibrium leaves no number; one that is not as accurate as asked leaves its number and its error."""
    pytest.importorskip("matplotlib")
    solve, calls = rod_in_hole.solve_in_hole, []

    def fails(path, lengths, *args, **named):
        calls.append(round(sum(lengths)))
        if calls[-1] == 800:
            raise cf.NotConverged("the contact alternates")
        found = solve(path, lengths, *args, **{**named, "tol": 1e-3})
        if calls[-1] == 1200:
            raise rod_in_hole.NotAccurate(found, 1e-4)
        return found

    monkeypatch.setattr(rod_in_hole, "solve_in_hole", fails)
    given = HOLE, STRING, cf.well.TripOut(), [800.0, 1200.0, 1600.0]
    for _ in range(2):  # solved, and read from the file
        found = cf.well.depth_sweep(*given, mud=MUD, model="rod", folder=tmp_path / "sweep")
        assert calls == [800, 1200, 1600] and len(found) == 3 and found.done.all()
        assert np.isnan(found.hook_load[0, 0]).tolist() == [True, False, False]
        assert sorted(found.notes) == [(0, 0, 0), (0, 0, 1)]
        assert "trip out, bit at 800 m: the contact alternates" in str(found)
        assert f"the estimated error of the rod in contact is {found.values['error'][0, 0, 1]:.1e}" in found.noted(1)[0]
    found.write(tmp_path / "sweep.csv")
    rows = (tmp_path / "sweep.csv").read_text(encoding="utf-8").splitlines()
    assert ',,,"trip out, bit at 800 m: the contact alternates; model=' in rows[1] and rows[3].endswith(",rod,")
    hook = found.plot().axes[0]
    assert [text.get_text() for text in hook.get_legend().get_texts()] == ["trip out", "locks up, or no answer"]
    assert [list(line.get_ydata()) for line in hook.lines if line.get_marker() == "X"] == [[800.0], []]
    either = cf.well.depth_sweep(*given[:3], [800.0], mud=MUD)
    both = cf.well.depth_sweep(HOLE, STRING, cf.well.RotateOffBottom(), [400.0, 1200.0], mud=MUD, tol=1e-3)
    assert both.models[0, 0].tolist() == ["soft", "rod"] and "│ soft" in str(both) and "│ rod" in str(both)
    assert np.isfinite(either.hook_load).all() and "soft string; NOT ENOUGH for tol = 0.0001 in the" in str(either)
    assert "and not solved: the contact alternates" in str(either)


@pytest.mark.slow
def test_a_sweep_by_the_rod_is_stopped_and_goes_on(monkeypatch, tmp_path):
    """The signal comes while C asks for the wall's data in a Newton step, as most of them do."""
    given = HOLE, STRING, cf.well.TripOut(), [800.0, 1200.0, 1600.0]
    file, nearest, calls = tmp_path / "sweep", cf.well.WellPath.nearest, []

    def stops(self, *args):
        if (file / "rows.0.jsonl").exists():  # the first answer
            calls.append(1)
            if len(calls) == 60:
                os.kill(os.getpid(), signal.SIGINT)
        return nearest(self, *args)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # not that of the command line
    with monkeypatch.context() as patch, contextlib.ExitStack() as stack:
        stack.callback(signal.signal, signal.SIGINT, before)
        patch.setattr(cf.well.WellPath, "nearest", stops)
        with pytest.raises(cf.Interrupted, match="after 1 answer, which .* they are kept in .*sweep") as stop:
            cf.well.depth_sweep(*given, mud=MUD, model="rod", folder=file)
    assert np.isfinite(stop.value.path.hook_load[0, 0]).tolist() == [True, False, False]
    with pytest.raises(cf.SceneError, match="resume.duration = 9.0: expected None, since .* holds a sweep"):
        cf.resume(file, duration=9.0)
    found = cf.well.depth_sweep(*given, mud=MUD, model="rod", folder=file)
    assert (found.hook_load == cf.well.depth_sweep(*given, mud=MUD, model="rod").hook_load).all()
    assert not found.notes
    assert np.isnan(found.values["model_error"]).all() and (found.values["error"] <= 1e-4).all()


@pytest.mark.once
@pytest.mark.parametrize(("depths", "words"), [
    ([1000, 2600], "hole, which ends at 2500 m"), ([], "at least one measured depth"),
    ([60, 50], "above the surface at the depth 50 m"),
    (["3000 psi"], r"depths\[0\] = '3000 psi': psi is a unit of pressure"),
])  # fmt: skip
def test_depths_that_do_not_fit_are_refused_first(depths, words):
    with pytest.raises(cf.SceneError, match=words):
        cf.well.depth_sweep(HOLE, STRING, OPERATIONS, depths, mud=MUD)


@pytest.mark.once
def test_depths_at_which_heavy_pipe_stands_out_are_left_out(tmp_path):
    given, settings = (HOLE, STRING, OPERATIONS[:2]), {"mud": MUD, "model": "soft", "folder": tmp_path / "sweep"}
    least = STRING.least_depth
    swept = cf.well.depth_sweep(*given, [least / 2, least, 1000], **settings)
    assert np.isnan(swept.hook_load[0, 0]).tolist() == [True, True, False] and swept.done.all()
    note = f"left out, since the string is {least:.6g} m long below its drill pipe"
    assert swept.noted() == [f"bit at {x:g} m: {note}" for x in (least / 2, least)]
    again = cf.resume(tmp_path / "sweep")
    assert again.noted() == swept.noted() and again.hook_load[0, 0, 2] == swept.hook_load[0, 0, 2]


@pytest.mark.once
def test_depths_as_text():
    given = {"mud": MUD, "model": "soft"}
    swept = cf.well.depth_sweep(HOLE, STRING, [cf.well.TripOut()], ["3000 ft", 1828.8], **given)
    np.testing.assert_allclose(swept.depths, [914.4, 1828.8], rtol=1e-12)
    alone = cf.well.depth_sweep(HOLE, STRING, cf.well.TripOut(), "3000 ft", **given)
    assert alone.hook_load.shape == (1, 1, 1) and alone.hook_load[0, 0, 0] == swept.hook_load[0, 0, 0]
    with pytest.raises(cf.SceneError, match="known of this diameter: 5 in 19.50 lb/ft, 5 in 25.60 lb/ft"):
        cf.well.DrillPipe(size="5 in 20 lb/ft")


@pytest.mark.once
def test_lock_up_in_a_sweep_is_told():
    stiff = cf.Stiffness((1e9, 1e9), 7e8, (348950.0,) * 2, 9.4e5)
    string = cf.well.DrillString([cf.well.Component(None, stiff, 16.6, 0.05)])
    path = cf.well.WellPath.from_survey([0, 12000], [90, 90], [0, 0])
    hole = cf.well.Borehole(path, [cf.well.HoleSection(12000, 2 * (0.05 + 0.041), 0.3)])
    found = cf.well.depth_sweep(hole, string, cf.well.TripIn(), [5000, 9687, 11000], model="buckled")
    assert np.isfinite(found.hook_load[0, 0, :2]).all() and np.isnan(found.hook_load[0, 0, 2])
    assert found.values["locked"][0, 0, 2] == pytest.approx(11000 - 9688.9, abs=1) and found.done.all()
    assert "locks up at md = 1311" in str(found) and found.models[0, 0].tolist() == ["buckled"] * 2 + [""]
    assert "bit at 9687 m: BEYOND WHAT ANY PIPE CARRIES" in str(found)
    notes = found.columns("field")["notes"]
    assert "bit at 36089.2 ft: locks up at md = 4301.5 ft" in found.summary("field") and "4301.5 ft" in notes[2]


def measured(noise, block=0.0):
    """Readings with normal errors of standard deviation `noise`, of the hole's friction 0.2 and 0.3."""
    rng, found = np.random.default_rng(3), []
    for operation in OPERATIONS:
        for depth in (900, 1300, 1700, 2100, 2500):
            answer = cf.well.torque_and_drag(HOLE, STRING, operation, mud=MUD, depth=depth, model="soft")
            hook = answer.hook_load + block + noise * 10e3 * rng.normal()
            torque = answer.surface_torque + noise * 500 * rng.normal() if operation.slip[1] else None
            found.append(cf.well.RigMeasurement(depth, operation, hook, torque))
    return found


@pytest.mark.once
def test_friction_from_measurements():
    exact = cf.well.calibrate_friction(HOLE.with_friction(0.5), STRING, measured(0.0), mud=MUD)
    assert exact.friction == pytest.approx([0.2, 0.3], abs=1e-7) and exact.misfit < 1e-4
    noisy = cf.well.calibrate_friction(HOLE.with_friction(0.0), STRING, measured(1.0), mud=MUD)
    assert ((noisy.interval[:, 0] < [0.2, 0.3]) & ([0.2, 0.3] < noisy.interval[:, 1])).all()
    assert 0.5 < noisy.misfit < 1.5 and (np.diff(noisy.interval) < 0.2).all() and (np.diff(noisy.interval) > 1e-3).all()
    assert "open hole" in str(noisy) and noisy.hole.sections[1].friction == noisy.friction[1]
    pytest.importorskip("matplotlib")
    hook = noisy.plot().axes[0]
    computed = np.concatenate([line.get_xdata() for line in hook.lines if line.get_marker() == "x"])
    loads = [m.hook_load for m in noisy.measurements if m.hook_load is not None]
    off = [m.hook_load_sd for m in noisy.measurements if m.hook_load is not None] * noisy.residuals[: len(loads)]
    assert np.sort(computed) == pytest.approx(np.sort(np.array(loads) - off) / 1e3)
    assumed = "(assumed where none is given)"
    assert f"deviations: 10 kN of hook loads {assumed} and 500 N m of surface torques {assumed}." in " ".join(
        str(noisy).split()
    )
    assert f"2.248 klbf of hook loads {assumed} and 368.8 ft-lbf of" in " ".join(noisy.summary("field").split())
    block = cf.well.calibrate_friction(HOLE, STRING, measured(0.0, 250e3), mud=MUD, block_weight=None)
    assert block.block_weight == pytest.approx(250e3, rel=1e-6) and block.friction == pytest.approx(
        [0.2, 0.3], abs=1e-6
    )
    given = cf.well.calibrate_friction(HOLE, STRING, measured(0.0, 250e3), mud=MUD, block_weight="250 kN")
    assert given.block_weight == 250e3 and given.friction == pytest.approx([0.2, 0.3], abs=1e-6)


@pytest.mark.once
@pytest.mark.parametrize(("wrong", "words"), [
    (lambda m: (m.operation, m.hook_load + 150e3), "with block_weight=None it is .*weigh 1(49|50)"),
    (lambda m: (m.operation, m.hook_load / 1e3), "the hook loads are .*e-0. times those computed: expected N"),
    (lambda m: ({"trip out": OPERATIONS[1], "trip in": OPERATIONS[0]}.get(m.operation.name, m.operation), m.hook_load),
     "at the depth 900 m the hook load out is below that in: are they swapped"),
])  # fmt: skip
def test_readings_that_do_not_fit_are_doubted(wrong, words):
    readings = [m for m in measured(0.1) if m.torque is None and m.depth in (900, 1700, 2500)]
    changed = [cf.well.RigMeasurement(m.depth, *wrong(m)) for m in readings]
    with pytest.warns(cf.SceneWarning, match=words):
        found = cf.well.calibrate_friction(HOLE, STRING, changed, mud=MUD)
    assert f"DOUBTFUL: misfit {found.misfit:.3g} where 1" in str(found)


@pytest.mark.once
def test_a_wrong_weight_of_the_string_is_not_taken_for_friction():
    """Friction makes hook loads up and down differ, and leaves that of a string that rotates: another mud does not."""
    exact, kinds = measured(0.2), {"rotate off bottom": OPERATIONS[2:], "trip in": OPERATIONS[:2]}
    for name, operations in kinds.items():
        readings = [m for m in exact if m.operation in operations]
        right = cf.well.calibrate_friction(HOLE, STRING, readings, mud=MUD)
        assert not right.doubts and right.weight_change[0] < 0 < right.weight_change[1] < 0.01, name
        with pytest.warns(cf.SceneWarning, match="trend that friction cannot make.*check the mud weight"):
            wrong = cf.well.calibrate_friction(HOLE, STRING, readings, mud=cf.well.Mud(1440.0))
        assert wrong.misfit < 1.5 and "DOUBTFUL: the residuals have a trend" in str(wrong)
        found = float(wrong.doubts[0].partition("as in mud of ")[2].split()[0])
        assert found == pytest.approx(1200, abs=25)
        assert ("RotateOffBottom, are 14.3 kN above" in wrong.doubts[0]) == (name == "rotate off bottom")
    assert "in place of 12.02 ppg" in " ".join(wrong.summary("field").split())
    with pytest.warns(cf.SceneWarning, match=r"trend .* with \+29.8 kN on block and top drive"):
        cf.well.calibrate_friction(HOLE, STRING, measured(0.2, 30e3), mud=MUD)
    out = cf.well.calibrate_friction(HOLE, STRING, exact[:5], mud=MUD)
    assert "do not tell a wrong weight of the string in mud from friction" in str(out).replace("\n", " ")


@pytest.mark.once
def test_the_interval_covers_as_often_as_it_says():
    """Of a linear problem with the same solver: a rotating string, whose torque is nearly linear in the friction."""
    rng, hits = np.random.default_rng(8), 0
    torques = {
        depth: cf.well.torque_and_drag(
            HOLE, STRING, cf.well.RotateOffBottom(), mud=MUD, depth=depth, model="soft"
        ).surface_torque
        for depth in (800.0, 1400.0, 2000.0, 2500.0)
    }
    for _ in range(40):
        readings = [
            cf.well.RigMeasurement(depth, cf.well.RotateOffBottom(), None, torque + 300 * rng.normal(), torque_sd=300)
            for depth, torque in torques.items()
        ]
        fit = cf.well.calibrate_friction(HOLE, STRING, readings, mud=MUD, confidence=0.5)
        assert "Standard deviations: 300 N m of surface torques." in str(fit)
        hits += int(fit.interval[0, 0] < 0.2 < fit.interval[0, 1])
    assert 11 <= hits <= 29  # 20 with a standard deviation of 3.2


@pytest.mark.once
@pytest.mark.parametrize(("given", "words"), [
    ({"hook_load": 250}, "RigMeasurement.hook_load, at most = 250 N is hardly a hook load of a string"),
    ({"torque": 12.5}, "RigMeasurement.torque, at most = 12.5 N m is hardly a torque of a string"),
])  # fmt: skip
def test_readings_in_other_units_are_doubted(given, words):
    readings = [cf.well.RigMeasurement(depth, cf.well.BackReam(0.2, 60), **given) for depth in (2300.0, 2400.0, 2500.0)]
    with pytest.warns(cf.SceneWarning, match=words):
        cf.well.calibrate_friction(HOLE, STRING, readings, mud=MUD)


@pytest.mark.once
def test_measurements_that_are_refused():
    one = cf.well.RigMeasurement(1400.0, cf.well.TripOut(), 1e6)
    with pytest.raises(cf.SceneError, match="psi is a unit of pressure"):
        cf.well.calibrate_friction(HOLE, STRING, [one] * 3, mud=MUD, block_weight="60 psi")
    with pytest.raises(cf.SceneError, match="2 readings for 2 unknowns"):
        cf.well.calibrate_friction(HOLE, STRING, [one, one], mud=MUD)
    with pytest.raises(cf.SceneError, match=r"no reading depends on friction of section 2 \(to 2500 m\)"):
        cf.well.calibrate_friction(
            HOLE, STRING, [one, one, cf.well.RigMeasurement(900, cf.well.TripIn(), 9e5)], mud=MUD
        )
    with pytest.raises(cf.SceneError, match="hook_load = None"):
        cf.well.RigMeasurement(1400.0, cf.well.TripOut())


@pytest.mark.once
def test_charts(tmp_path):
    pytest.importorskip("matplotlib")
    found = sweep()
    figure = found.plot()
    assert [axes.get_xlabel() for axes in figure.axes] == ["hook load (kN)", "surface torque (kN m)"]
    lines = [line for line in figure.axes[0].lines if len(line.get_xdata())]
    assert len(lines) == 6 and figure.axes[0].get_ylim() == pytest.approx((2585, 715))
    told = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert told == ["trip out", "trip in", "rotate off bottom", "friction 0.1", "friction 0.2, 0.4"]
    styles = {(line.get_color(), line.get_linestyle()) for line in lines}
    assert len(styles) == 6 and len({colour for colour, _ in styles}) == 3
    answer = cf.well.torque_and_drag(HOLE, STRING, cf.well.Sliding(1e5), mud=MUD, model="buckled")
    with pytest.raises(cf.SceneError, match="ends in .csv"):
        answer.write(tmp_path / "answer.xlsx")
    answer.plot(tmp_path / "answer.png")
    assert (tmp_path / "answer.png").stat().st_size > 20000
    with pytest.raises(cf.SceneError, match="expected a name that ends in"):
        found.plot(tmp_path / "sweep.doc")
    found.write(tmp_path / "sweep.csv")
    rows = (tmp_path / "sweep.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 6 and rows[0].startswith('depth (m),"trip out, friction 0.1: hook load (N)"')
    assert ": model" in rows[0] and "soft" in rows[1] and "model: soft" in str(found)
    assert float(rows[5].split(",")[1]) == pytest.approx(found.hook_load[0, 0, 4])
    pytest.importorskip("pandas")
    along = answer.to_dataframe()
    assert (along["side force (N/m)"] == answer.side_force).all() and along["component"].iloc[-1] == "bit"
    assert (found.to_dataframe()["trip in, friction 0.1: hook load (N)"] == found.hook_load[1, 0]).all()


@pytest.mark.once
def test_torques_below_their_error_are_shown_as_none():
    """A string that slides with the torque of a motor, and one that is tripped: what the rod leaves of a torque is not
    enlarged by an axis, and the friction of a string that rotates off bottom is none."""
    pytest.importorskip("matplotlib")
    answer = cf.well.torque_and_drag(HOLE, STRING, cf.well.Sliding(1e5, torque=2e3), mud=MUD, model="soft")
    torque = answer.solved.torque
    solved = answer.solved._replace(torque=torque + 0.05 * np.sin(np.arange(torque.size)).reshape(torque.shape))
    panel = replace(answer, solved=solved).plot(units="field").axes[2]
    panel.figure.canvas.draw()
    low, high = panel.get_xlim()
    assert high - low > 100 and low < 2e3 / cf.units.ft_lbf < high and not panel.xaxis.get_offset_text().get_text()
    tripped = cf.well.torque_and_drag(HOLE, STRING, cf.well.TripOut(), mud=MUD, model="soft")
    noisy = replace(tripped, solved=tripped.solved._replace(torque=0.05 + 0 * tripped.solved.torque))
    assert "surface torque 0 ft-lbf" in " ".join(noisy.plot(units="field")._suptitle.get_text().split())
    assert "surface torque 0 ft-lbf" in noisy.summary("field") and "torque (" not in noisy.summary("field")
    off = cf.well.torque_and_drag(HOLE, STRING, cf.well.RotateOffBottom(), mud=MUD, model="soft")
    off = replace(off, error=1e-4, solved=off.solved._replace(tension=off.solved.tension * (1 + 5e-5)))
    assert off.drag > 10 and "(no drag)" in off.summary("field")


@pytest.mark.once
def test_the_chart_of_a_sweep_marks_lock_up_and_thrusts_beyond_all_others():
    pytest.importorskip("matplotlib")
    loads = np.array([[[-1e5, -2e5, -3e5, -7e7, np.nan]], [[2e5, 3e5, np.nan, np.nan, np.nan]]])
    values = {name: np.full(loads.shape, np.nan) for name in module.KEPT}
    values |= {"hook_load": loads, "surface_torque": 0 * loads}
    values["locked"][0, 0, 4] = 90.0
    values["model"][0, 0], values["model"][1, 0] = 0, 2  # soft, rod
    operations, depths = (cf.well.TripIn(), cf.well.RotateOffBottom()), np.arange(1e3, 6e3, 1e3)
    found = cf.well.DepthSweep(operations, depths, (None,), values, {(0, 0, 4): "locks up"})
    hook, torque = found.plot().axes
    marks = {line.get_marker(): list(line.get_ydata()) for line in hook.lines if len(line.get_ydata())}
    assert not hook.texts and marks["<"] == [4000.0] and marks["X"] == [5000.0] and marks["."] == list(depths)
    assert -1e3 < hook.get_xlim()[0] < -300 and 300 < hook.get_xlim()[1] < 1e3
    told = [text.get_text() for text in hook.get_legend().get_texts()]
    assert told == ["trip in", "rotate off bottom", "by the exact rod, others soft", "load beyond the axis",
                    "locks up, or no answer"]  # fmt: skip
    assert hook.figure.get_suptitle().endswith("7 of 10 answers so far") and len(torque.lines) == 2


@pytest.mark.once
def test_the_largest_error_of_a_sweep_names_its_quantity_and_place():
    """Over the largest load of the sweep: 60 % of a torque of 10 N m are nothing beside 10 kN m."""
    values = {name: np.full((2, 1, 3), 1e-3) for name in module.KEPT}
    values["hook_load"][:], values["surface_torque"][:] = 5e5, (1e4, 1e4, 10.0)
    values["torque_left_out"][1, 0] = 100.0, 50.0, 6.0
    operations, depths = (cf.well.TripIn(), cf.well.RotateOffBottom()), np.array([1e3, 2e3, 5409.0])
    for worst, told in ((2.5e4, "at most 25 kN, 5 % of the largest one"), (np.inf, "without a bound, since it may")):
        values["hook_left_out"][0, 0, 1] = worst
        *_, hook, torque = list(cf.well.DepthSweep(operations, depths, (None,), values, {})._answer(Units()))[:-1]
        assert hook.startswith(f"hook load: what the model leaves out is {told}") and "(trip in, bit at 2000 m)" in hook
        assert torque.startswith("surface torque") and "100 N m, 1 % of the largest one (rotate off" in torque


@pytest.mark.once
def test_axes_in_space_have_two_numbers_or_none():
    """Across the hole, whose radius is enlarged, none; of a short extent a finer step than of the others."""
    along = np.linspace(0, 1, 50)[:, None]
    vertical = along * (0.0, 0.0, -500.0)
    east, north, depth = axes_of(vertical, 7.5)
    assert (east.name, east.ticks, north.ticks) == ("east", (), ()) and depth.name == "depth (m)"
    assert [text for _, text in depth.ticks] == ["500", "400", "300", "200", "100", "0"]
    for lean in (8.0, 20.0, 33.0, 60.0, 77.0, 110.0, 400.0):
        axes = axes_of(vertical + along * (lean, 0.0, 0.0) + (310.0, 0.0, 0.0), 7.5)
        assert 2 <= len(axes[0].ticks) <= 8 and axes[0].name == "east (m)"
        assert all(axes[0].low <= x <= axes[0].high and float(text) == x for x, text in axes[0].ticks)


@pytest.mark.slow
def test_the_string_in_its_hole_in_space(tmp_path):
    pytest.importorskip("pyvista")
    image = pytest.importorskip("matplotlib.image")
    answer = cf.well.torque_and_drag(HOLE, STRING, cf.well.TripOut(), mud=MUD, model="soft")
    for how in ({}, {"enlarge": 1}, {"between": (2400, 2500)}):
        answer.plot_3d(tmp_path / "hole.png", **how)
        pixels = image.imread(tmp_path / "hole.png")[:, :-280, :3]  # without the colour bar
        extents = np.ptp(np.argwhere(np.ptp(pixels, axis=2) > 0.15), axis=0)
        assert (extents > 0.5 * np.array(pixels.shape[:2])).any()  # the string crosses the page, however thin it is
    with pytest.raises(cf.SceneError, match="ends in .png"):
        answer.plot_3d(tmp_path / "hole.jpg")
    with pytest.raises(cf.SceneError, match="plot_3d.between"):
        answer.plot_3d(tmp_path / "hole.png", between=(2600, 2700))


BUILD = cf.well.WellPath.from_survey([0, 500, 1000], [0, 0, 30], [0, 0, 0])
PIPE = cf.well.DrillPipe(size="5 in 19.50 lb/ft")
TWO_DEPTHS = [600.0, 800.0, 1000.0]


def hole(**given):
    return cf.well.Borehole(BUILD, cf.well.HoleSection(1000.0, 0.2159, 0.2), **given)


def swept(file, **given):
    given = {"hole": hole(), "string": cf.well.DrillString([PIPE]), "mud": cf.well.Mud(1200.0), "model": "soft"} | given
    return cf.well.depth_sweep(operations=[cf.well.TripOut()], depths=TWO_DEPTHS, folder=file, progress=False, **given)


@pytest.mark.once
def test_every_part_of_the_hole_is_compared(tmp_path):
    """Also what only the rod depends on: hook loads by two stiffnesses of the wall differ by 1 %."""
    file = tmp_path / "sweep"
    swept(file, hole=hole(wall_stiffness=1e10))
    with pytest.raises(cf.SceneError, match=r"another folder: hole.wall_stiffness is 1.*, where the sweep has 1000"):
        swept(file, hole=hole(wall_stiffness=1e5))
    for name, other in {
        "string": cf.well.DrillString([cf.well.Collar(50.0, "NC46-65"), PIPE]),
        "mud": cf.well.Mud(1201.0),
        "friction": [0.3],
        "torque_convention": "fixed",
    }.items():
        given = {"hole": hole(wall_stiffness=1e10), name: other}
        with pytest.raises(cf.SceneError, match="holds another sweep|torque_convention") as refusal:
            swept(file, **given)
        assert name in str(refusal.value)
    assert (swept(file, hole=hole(wall_stiffness=1e10)).hook_load == swept(None).hook_load).all()


@dataclass(frozen=True)
class Own(cf.well.Component):
    """A component of the user's own, with a field that the package does not know."""

    maker: str = ""


@pytest.mark.once
def test_components_of_the_users_own_are_compared_by_all_their_fields(tmp_path):
    strings = [cf.well.DrillString([Own(None, None, 200.0, 0.0635, maker=maker)]) for maker in ("one", "other")]
    swept(tmp_path / "sweep", string=strings[0], mud=None)
    with pytest.raises(cf.SceneError, match="string.components.*maker is 'other', where the sweep has 'one'"):
        swept(tmp_path / "sweep", string=strings[1], mud=None)


STIFF = cf.Stiffness((1e9, 1e9), 7e8, (1228200.0, 1228200.0), 9.4e5)
LONG_STRING = cf.well.DrillString([cf.well.Component(None, STIFF, 241.13, 0.0635)])

#: Well, operation, clearance (m), hook load of the rod in contact less that of the soft string (N): finite elements in
#: space with a penalty, on 2 m elements.
IN_SPACE = [
    ("P", cf.well.TripOut(), 0.001, -426), ("P", cf.well.TripOut(), 0.010, -1343),
    ("P", cf.well.TripOut(), 0.04445, -2776), ("P", cf.well.TripIn(), 0.04445, 316),
    ("P", cf.well.RotateOffBottom(), 0.04445, 7), ("F-12", cf.well.TripOut(), 0.04445, -7705),
    ("F-12", cf.well.TripIn(), 0.04445, 4554), ("ISCWSA 2", cf.well.TripOut(), 0.04445, -3575),
]  # fmt: skip
#: Radius of the build section (m), its end (degrees), straight hole below (m), pull at the bottom (N), operation,
#: friction, hook loads of the stiff and of the soft string (N): by shooting.
PLANE = [
    (100.0, 40.0, 40.0, 150e3, cf.well.TripOut, 0.3, 215232.69479833, 216392.47901719),
    (100.0, 40.0, 40.0, 150e3, cf.well.TripIn, 0.3, 147221.08801421, 146483.90087545),
    (100.0, 40.0, 40.0, 150e3, cf.well.Static, 0.3, 177717.66167666, 177710.78949514),
    (200.0, 50.0, 1000.0, 0.0, cf.well.TripOut, 0.3, 312052.92537158, 313898.00773871),
    (200.0, 50.0, 1000.0, 0.0, cf.well.TripIn, 0.3, 119200.52736823, 118617.76502673),
]


def soft(path, clearance, operation, mu):
    hole = cf.well.Borehole(path, cf.well.HoleSection(path.length, 2 * (0.0635 + clearance), mu))
    return cf.well.torque_and_drag(hole, LONG_STRING, operation, model="soft", tol=1e-9)


@pytest.mark.once
@pytest.mark.parametrize(("name", "operation", "clearance", "differs"), IN_SPACE)
def test_the_difference_of_whole_wells_is_covered(name, operation, clearance, differs):
    answer = soft(well(name), clearance, operation, 0.25)
    told = answer.model_error * abs(answer.tension).max()
    assert abs(differs) <= told
    if operation.slip[0]:
        assert told < 6 * abs(differs)  # and not by far too much


@pytest.mark.once
@pytest.mark.parametrize(("radius", "angle", "below", "pull", "operation", "mu", "stiff", "flexible"), PLANE)
def test_build_sections(radius, angle, below, pull, operation, mu, stiff, flexible):
    arc = radius * math.radians(angle)
    path = cf.well.WellPath.from_survey([0, 20, 20 + arc, 20 + arc + below], [0, 0, angle, angle], [0, 0, 0, 0])
    answer = soft(path, 0.04445, operation(weight=-pull), mu)
    assert answer.hook_load == pytest.approx(flexible, rel=1e-10)
    told = answer.model_error * abs(answer.tension).max()
    assert abs(stiff - flexible) <= told < 8 * abs(stiff - flexible)


@pytest.mark.once
@pytest.mark.parametrize(("md", "inc", "differs"), [
    ([0, 200, 600], [0, 40, 40], -103.52), ([0, 300], [0, 60], -110.03), ([0, 100, 400], [30, 30, 70], -13.84),
])  # fmt: skip
def test_a_bend_at_an_end_takes_from_the_tension(md, inc, differs):
    """Without friction, with a pull of 300 kN; the rod in contact on 1024 elements."""
    answer = soft(cf.well.WellPath.from_survey(md, inc, [20] * len(md)), 0.04445, cf.well.Static(-300e3), 0.25)
    assert abs(differs) <= answer.model_error * answer.tension.max() < 6 * abs(differs)


@pytest.mark.once
def test_torque_of_rotating_strings_is_covered():
    """The rod in contact gives 0.54 and 3.4 % less torque than the soft string by Coulomb's law."""
    for name, less in (("P", 0.0054), ("F-12", 0.034)):
        assert less <= soft(well(name), 0.04445, cf.well.RotateOffBottom(), 0.25).model_error < 4 * less


@pytest.mark.once
def test_a_snake_that_is_a_small_part_of_a_piece():
    """Above the helix of a vertical string: mu times the wall force of a helix that goes on to its top, by hand."""
    EI, weight, radius, friction = 1228200.0, 241.13, 0.0635, 0.3
    stiffness = cf.Stiffness((1e9, 1e9), 7e8, (EI, EI), 9.4e5)
    path = cf.well.WellPath.from_survey([0, 3000], [0, 0], [0, 0])
    hole = cf.well.Borehole(path, [cf.well.HoleSection(3000, 0.2159, friction)])
    string = cf.well.DrillString([cf.well.Component(None, stiffness, weight, radius)])
    answer = cf.well.torque_and_drag(hole, string, cf.well.Sliding(60e3))
    most, least = (factor * math.cbrt(EI * weight**2) for factor in (5.55, 0.14))
    snake = friction * (0.10795 - radius) * (most**3 - least**3) / (12 * EI * weight)
    assert answer.helical.any() and answer.model_error * 662.6e3 == pytest.approx(snake, rel=0.05)


@pytest.mark.once
@pytest.mark.parametrize("length", [3500.0, 4000.0, 4500.0, 4800.0, 5000.0])
def test_snakes_that_a_helix_above_multiplies(length):
    """A string pushed into a horizontal hole whose snake has half the wall force of a helix, in closed form: near
    lock-up this changes the hook load to a multiple."""
    EI, w, r, mu = 2063790.0, 315.0, 0.041, 0.3
    snake = 2 * math.sqrt(EI * w / r)
    thrust, place = snake, snake / (mu * w)
    for part, end in ((0.5, math.sqrt(2) * snake), (1.0, math.inf)):
        k = math.sqrt(part * r / (4 * EI * w))
        angle = min(math.atan(k * end), math.atan(k * thrust) + mu * w * k * (length - place))
        place += (angle - math.atan(k * thrust)) / (mu * w * k)
        thrust = math.tan(angle) / k if angle < math.pi / 2 - 1e-12 else math.inf
    level = cf.well.WellPath.from_survey([0, 6000], [90, 90], [0, 0])
    hole = cf.well.Borehole(level, [cf.well.HoleSection(6000, 2 * (0.064 + r), mu)])
    string = cf.well.DrillString([cf.well.Component(None, cf.Stiffness((1e9, 1e9), 2.6e9, (EI, EI), 1.59e6), w, 0.064)])
    for model in ("soft", "buckled"):
        answer = cf.well.torque_and_drag(hole, string, cf.well.TripIn(), depth=length, model=model)
        told = answer.model_error * abs(answer.tension).max()
        assert thrust + answer.hook_load <= told and not answer.enough
        if length < 4600:
            assert told < 4 * abs(thrust + answer.hook_load)
        else:
            assert math.isinf(told) and "may lock up" in str(answer)


@pytest.mark.once
def test_tension_beyond_what_a_pipe_carries_is_told():
    path = cf.well.WellPath.from_survey([0, 1000], [0, 0], [0, 0])
    hole = cf.well.Borehole(path, [cf.well.HoleSection(1000, 0.2159, 0.3)])
    for weight, told in ((-6e6, False), (-8e6, True)):
        answer = cf.well.torque_and_drag(hole, LONG_STRING, cf.well.TripOut(weight=weight), model="soft")
        assert ("BEYOND WHAT ANY PIPE CARRIES" in str(answer)) == told


@pytest.mark.slow
def test_a_random_well():
    """`make random-wells` compares 100 of them; here the rod's answer in one."""
    drawn = random_wells.draw(2)
    for operation in drawn.operations[:1]:
        said, _, _, errors = random_wells.compare(drawn, operation)
        assert said == "rod" and len(errors) == 3 and all(true <= told for told, true in errors.values())


EI, W, R, KP = 1228200.0, 241.13, 0.04445, 1e9
#: Wave number of the snake, and the load at which it begins.
K, F_SNAKE = (W / (EI * R)) ** 0.25, 2 * math.sqrt(EI * W / R)


@pytest.mark.parametrize("length", [1000.0, 8050.0])  # w L^3/EI = 2e5 and 1e8
def test_a_hanging_string_is_stable_until_its_lower_end_buckles(length):
    """Pushed up by F at its free end: EI theta'' = (w x - F) theta, theta'(0) = 0, so that Ai' has a zero there."""
    pipe = cf.Stiffness((1.35e8, 1.35e8), 7e8, (EI, EI), 1e6)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, -length)), pipe)
    critical = -ai_zeros(1)[1][0] * (W**2 * EI) ** (1 / 3)
    for share, negative in ((0.0, 0), (0.995, 0), (1.005, 2)):
        push = [cf.Force(rod.end, (0, 0, share * critical))] if share else []
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.LineForce(rod, (0, 0, -W)), *push])
        steps = cf.StepControl(adaptive=False)
        path = cf.solve(scene, [1.0], model="spatial", elements=int(length / 12), degree=3, steps=steps)
        assert path.negative_modes.tolist() == [negative]


@dataclass(frozen=True)
class Level(cf.PointAction):
    """Holds the rotation of a station about the second axis, almost."""

    station: cf.PointAction

    scaled = False

    def data(self, rod, s):
        return action.vector((0, 1.0, 0), "1"), action.scalar(1e4 * EI, "N m/rad")

    @staticmethod
    def work(point, test, axis, c):
        return -c * ufl.dot(point.theta, axis) * ufl.dot(test.phi, axis)


@dataclass(frozen=True)
class FullWeight(cf.LineAction):
    """A weight that the load factor does not multiply."""

    rod: cf.Rod

    scaled, work = False, "force"

    def data(self, rod, s):
        return (action.vector(np.tile((0, 0, W), (len(s), 1)), "N/m"),)


def half_wave():
    """A rod of half a wave on the low side of a horizontal hole, its ends on the line where it lies, and its load."""
    length, low = math.pi / K, R + W / KP
    path = cf.well.WellPath.from_survey([0, length + 20], [90, 90], [0, 0])
    pipe = cf.Stiffness((math.inf, math.inf), math.inf, (EI, EI), 1e6)
    rod = cf.Rod(cf.Line((10, 0, low), (10 + length, 0, low)), pipe)
    wall = TubeWall(rod, path, radius=0.0635 + R, contact_radius=0.0635, stiffness=KP, begins=10.0)
    held = [cf.Hinge(rod.start, (0, 0, 1)), cf.Roller(rod.end, (0, 1, 0)), cf.Roller(rod.end, (0, 0, 1))]
    loads = [FullWeight(rod), cf.Force(rod.end, (-F_SNAKE, 0, 0)), wall, Level(rod.end)]
    return cf.Scene([rod], held, loads), rod, low


def test_the_snake_begins_at_its_load_and_has_its_amplitude():
    """theta'''' - 6 theta'^2 theta'' + beta theta'' + sin theta = 0 with wave number 1: amplitudes 0.2708936 at beta =
    2.1 and 0.5486839 at 2.4, where its pressures over w are 0.639169 to 1.858649."""
    scene, rod, low = half_wave()
    layout = Layout.of(scene, 16)
    with solvers_of(scene, layout, degree=3) as (problem, _, stability):
        model = problem.model
        s = layout.node_s(model.nodes)[0] * rod.length
        for share, amplitude, negative in ((0.9999, 0, 0), (1.0001, 0, 1), (1.05, 0.27089361, 0), (1.2, 0.5486839, 0)):
            problem.set_load_factor(share)
            theta, slope = amplitude * np.sin(K * s), amplitude * K * np.cos(K * s)
            side, down = np.sin(theta), np.cos(theta)
            r = np.stack([s, low * side, low * (down - 1)], axis=1) / model.scales.length
            q = np.stack([np.ones_like(s), 0 * s, low * side * slope / 2, low * down * slope / 2], axis=1)
            rq = np.concatenate([r, q / np.linalg.norm(q, axis=1)[:, None]], axis=1)
            n = np.tile((-share * F_SNAKE / model.scales.force, 0.0, 0.0), (16, 3, 1))
            problem.begin_at(model.unknowns_of(rq), n, np.zeros_like(problem.multipliers()))
            newton = LimitedNewton(problem, 0.1, 0.1)
            assert min(newton.step().moved for _ in range(8)) < 1e-12
            y, z = (model.snapshot()[0][:, 1:3] * model.scales.length + (0.0, low)).T
            assert np.abs(np.arctan2(y, z)).max() == pytest.approx(amplitude, rel=2e-4, abs=1e-9)
            assert stability.count() == negative
        force = model.densities.here()[1][..., :3] * model.scales.force / model.scales.length / W
        pressure = np.linalg.norm(force, axis=2)[1:-1]  # at the ends supports share the load
        assert pressure.min() == pytest.approx(0.639169, rel=0.03)
        assert pressure.max() == pytest.approx(1.858649, rel=3e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["helix", "helix at 400 kN"])
def test_the_helix_of_a_thrust(name):
    """A weightless rod with finite EA and GA in a frictionless cylinder: a Cosserat helix in the middle."""
    case = json.loads((Path(__file__).parent / "reference" / "rod_in_hole.json").read_text(encoding="utf-8"))[name]
    length, radius = 250.0, case["r"]
    path = cf.well.WellPath.from_survey([0, length + 10], [0, 0], [0, 0])
    pipe = cf.Stiffness((case["GA"],) * 2, case["EA"], (case["EI"],) * 2, case["EI"])
    answer = solve_in_hole(
        path, [length], pipe, 1e-6, 0.05, radius=0.05 + radius, rings=[(length, 0.0, 0.05)],
        bottom_tension=-case["F"], extensible=True, helix=True, tol=1e-3,
    )  # fmt: skip
    middle = (answer.s > 0.35 * length) & (answer.s < 0.65 * length)
    turns = np.polyfit(answer.s[middle], np.unwrap(answer.side[middle]), 1)[0]
    assert abs(turns) == pytest.approx(case["turn_rate"], rel=1e-6) and answer.negative_modes == 0
    assert answer.side_force[middle] == pytest.approx(case["contact_per_reference_length"], rel=1e-4)
    s, z = answer.s[middle], answer.position[middle, 2]
    shortening = 1 - (z[-1] - z[0]) / (s[-1] - s[0])
    assert shortening == pytest.approx(case["shortening"], rel=3e-5)  # the wall gives way


@pytest.mark.slow
@pytest.mark.parametrize(("inclination", "operation"), [(45, cf.well.Static(250e3)), (60, cf.well.Sliding(240e3))])
def test_a_string_in_a_plane_hole_leaves_the_plane_where_it_would_buckle(inclination, operation):
    """Straight, and beyond the load of a snake: in the plane Newton's method keeps the symmetry."""
    path = cf.well.WellPath.from_survey([0, 300, 650], [inclination] * 3, [0, 0, 0])
    hole = cf.well.Borehole(path, cf.well.HoleSection(650.0, 0.2159, 0.2))
    string = cf.well.DrillString([cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
    found = cf.well.torque_and_drag(hole, string, operation, mud=cf.well.Mud(1200.0), depth=600.0, model="rod")
    assert found.solved.negative_modes == 0 and found.enough and any("begun as a helix" in line for line in found.why)
    assert np.abs(found.offset[:, 1]).max() > 0.01
