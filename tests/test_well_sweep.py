"""Sweeps over depths, that are kept and gone on with; friction from measurements; charts."""

import contextlib
import os
import signal

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.well import sweep as module
from cosserat_fenicsx.well.rod import rod_in_hole

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


def sweep(**settings):
    given = {"mud": MUD, "model": "soft", "friction": [0.1, [0.2, 0.4]], **settings}
    return cf.well.depth_sweep(HOLE, STRING, OPERATIONS, DEPTHS, **given)


def test_a_sweep_is_its_answers():
    found = sweep()
    assert found.hook_load.shape == (3, 2, 5) and len(found) == 30 and found.done.all()
    hole = HOLE.with_friction([0.2, 0.4])
    for i, operation in enumerate(OPERATIONS):
        answer = cf.well.torque_and_drag(hole, STRING, operation, mud=MUD, depth=DEPTHS[3], model="soft")
        assert found.hook_load[i, 1, 3] == answer.hook_load and found.surface_torque[i, 1, 3] == answer.surface_torque
    assert (found.hook_load[0] > found.hook_load[2]).all() and (found.hook_load[2] > found.hook_load[1]).all()
    assert found.label(1, 1) == "trip in, friction 0.2, 0.4" and f"{found.hook_load[1, 1, 2] / 1e3:.2f}" in str(found)
    assert cf.well.depth_sweep(HOLE, STRING, cf.well.TripOut(), 2000.0, mud=MUD, model="soft").hook_load.shape == (
        1,
        1,
        1,
    )


def test_a_sweep_goes_on_where_it_was_broken_off(tmp_path, monkeypatch):
    file, asked = tmp_path / "sweep", []

    def counted(*args, **named):
        asked.append(named["depth"])
        if len(asked) == 12:
            raise KeyboardInterrupt
        return cf.well.torque_and_drag(*args, **named)

    monkeypatch.setattr(module, "torque_and_drag", counted)
    with pytest.raises(cf.Interrupted, match="after 11 answers") as stop:
        sweep(folder=file)
    assert len(stop.value.path) == 11 and np.isfinite(stop.value.path.hook_load).sum() == 11
    with (file / "rows.0.jsonl").open("a") as stream:
        stream.write("[0, 0, 3, 1.5")  # as by a machine that stopped
    again = sweep(folder=file)
    assert len(asked) == 12 + 19 and len(again) == 30
    assert (again.hook_load == sweep().hook_load).all()
    asked.clear()
    assert (sweep(folder=file).surface_torque == again.surface_torque).all() and not asked
    with pytest.raises(cf.SceneError, match="holds another sweep"):
        sweep(folder=file, tol=1e-3)


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
        assert np.isnan(found.hook_load[0, 0]).tolist() == [True, False, False] and sorted(found.notes) == [
            (0, 0, 0),
            (0, 0, 1),
        ]
        assert "trip out, bit at 800 m: the contact alternates" in str(found)
        assert f"the estimated error of the rod in contact is {found.values['error'][0, 0, 1]:.1e}" in found.noted(1)[0]
    found.write(tmp_path / "sweep.csv")
    rows = (tmp_path / "sweep.csv").read_text(encoding="utf-8").splitlines()
    assert rows[1].endswith(',,,"trip out, bit at 800 m: the contact alternates"') and rows[3].endswith(",rod,")
    hook = found.plot().axes[0]
    assert [text.get_text() for text in hook.get_legend().get_texts()] == ["trip out", "locks up, or no answer"]
    assert [list(line.get_ydata()) for line in hook.lines if line.get_marker() == "X"] == [[800.0], []]
    either = cf.well.depth_sweep(*given[:3], [800.0], mud=MUD)
    both = cf.well.depth_sweep(HOLE, STRING, cf.well.RotateOffBottom(), [400.0, 1200.0], mud=MUD, tol=1e-3)
    assert both.models[0, 0].tolist() == ["soft", "rod"] and "│ soft" in str(both) and "│ rod" in str(both)
    assert np.isfinite(either.hook_load).all() and "soft string; NOT ENOUGH for tol = 0.0001 in the" in str(either)
    assert "and not solved: the contact alternates" in str(either)


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
    found = cf.well.depth_sweep(*given, mud=MUD, model="rod", folder=file)
    assert (found.hook_load == cf.well.depth_sweep(*given, mud=MUD, model="rod").hook_load).all()
    assert not found.notes
    assert np.isnan(found.values["model_error"]).all() and (found.values["error"] <= 1e-4).all()


def test_depths_that_do_not_fit_are_refused_first():
    with pytest.raises(cf.SceneError, match="hole, which ends at 2500 m"):
        cf.well.depth_sweep(HOLE, STRING, OPERATIONS, [1000, 2600], mud=MUD)
    with pytest.raises(cf.SceneError, match="at least one measured depth"):
        cf.well.depth_sweep(HOLE, STRING, OPERATIONS, [], mud=MUD)
    with pytest.raises(cf.SceneError, match="above the surface at the depth 50 m"):
        cf.well.depth_sweep(HOLE, STRING, OPERATIONS, [1000, 50], mud=MUD)


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
    block = cf.well.calibrate_friction(HOLE, STRING, measured(0.0, 250e3), mud=MUD, block_weight=None)
    assert block.block_weight == pytest.approx(250e3, rel=1e-6) and block.friction == pytest.approx(
        [0.2, 0.3], abs=1e-6
    )


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda m: (m.operation, m.hook_load + 150e3), "with block_weight=None it is .*weigh 1(49|50)"),
        (lambda m: (m.operation, m.hook_load / 1e3), "the hook loads are .*e-0. times those computed: expected N"),
        (
            lambda m: (
                {"trip out": OPERATIONS[1], "trip in": OPERATIONS[0]}.get(m.operation.name, m.operation),
                m.hook_load,
            ),
            "at the depth 900 m the hook load out is below that in: are they swapped",
        ),
    ],
)
def test_readings_that_do_not_fit_are_doubted(wrong, words):
    readings = [m for m in measured(0.1) if m.torque is None and m.depth in (900, 1700, 2500)]
    changed = [cf.well.RigMeasurement(m.depth, *wrong(m)) for m in readings]
    with pytest.warns(cf.SceneWarning, match=words):
        found = cf.well.calibrate_friction(HOLE, STRING, changed, mud=MUD)
    assert f"DOUBTFUL: misfit {found.misfit:.3g} where 1" in str(found)


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
        hits += int(fit.interval[0, 0] < 0.2 < fit.interval[0, 1])
    assert 11 <= hits <= 29  # 20 with a standard deviation of 3.2


def test_measurements_that_are_refused():
    one = cf.well.RigMeasurement(1400.0, cf.well.TripOut(), 1e6)
    with pytest.raises(cf.SceneError, match="2 readings for 2 unknowns"):
        cf.well.calibrate_friction(HOLE, STRING, [one, one], mud=MUD)
    with pytest.raises(cf.SceneError, match=r"no reading depends on friction of section 2 \(to 2500 m\)"):
        cf.well.calibrate_friction(
            HOLE, STRING, [one, one, cf.well.RigMeasurement(900, cf.well.TripIn(), 9e5)], mud=MUD
        )
    with pytest.raises(cf.SceneError, match="hook_load = None"):
        cf.well.RigMeasurement(1400.0, cf.well.TripOut())


def test_charts(tmp_path):
    pytest.importorskip("matplotlib")
    found = sweep()
    figure = found.plot()
    assert [axes.get_xlabel() for axes in figure.axes] == ["hook load (kN)", "surface torque (kN m)"]
    assert len(figure.axes[0].lines) == 6 and figure.axes[0].get_ylim() == pytest.approx((2585, 715))
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


def test_tables_of_pandas():
    pytest.importorskip("pandas")
    answer, found = cf.well.torque_and_drag(HOLE, STRING, cf.well.TripOut(), mud=MUD, model="soft"), sweep()
    along = answer.to_dataframe()
    assert (along["side force (N/m)"] == answer.side_force).all() and along["component"].iloc[-1] == "bit"
    assert (found.to_dataframe()["trip in, friction 0.1: hook load (N)"] == found.hook_load[1, 0]).all()


def test_the_chart_of_a_sweep_marks_lock_up_and_thrusts_beyond_all_others():
    pytest.importorskip("matplotlib")
    loads = np.array([[[-1e5, -2e5, -3e5, -7e7, np.nan]], [[2e5, 3e5, np.nan, np.nan, np.nan]]])
    values = {name: np.full(loads.shape, np.nan) for name in module.KEPT} | {
        "hook_load": loads,
        "surface_torque": 0 * loads,
    }
    values["locked"][0, 0, 4] = 90.0
    values["model"][0, 0], values["model"][1, 0] = 0, 2  # soft, rod
    operations, depths = (cf.well.TripIn(), cf.well.RotateOffBottom()), np.arange(1e3, 6e3, 1e3)
    found = cf.well.DepthSweep(operations, depths, (None,), values, {(0, 0, 4): "locks up"})
    hook, torque = found.plot().axes
    thrust, locked = (text.get_text() for text in hook.texts)
    assert thrust == "-70,000 kN, beyond the axis: close to lock-up"
    assert locked == "bit at 5000 m: locks up, from md = 90 m of the string on"
    assert -1e3 < hook.get_xlim()[0] < -300 and 300 < hook.get_xlim()[1] < 1e3
    told = [text.get_text() for text in hook.get_legend().get_texts()]
    assert told == ["trip in", "rotate off bottom", "by the exact rod, others soft", "locks up, or no answer"]
    assert hook.figure.get_suptitle().endswith("7 of 10 answers so far") and len(torque.lines) == 2


def test_notes_in_the_chart_of_a_sweep_do_not_cover_each_other():
    """Of lines that lock up at the same depth."""
    pytest.importorskip("matplotlib")
    values = {name: np.full((1, 3, 2), np.nan) for name in module.KEPT}
    values["hook_load"][0, :, 0], values["locked"][0, :, 1] = (1e5, 2e5, 3e5), (10.0, 20.0, 30.0)
    notes = {(0, j, 1): "locks up" for j in range(3)}
    (hook,) = cf.well.DepthSweep((cf.well.TripIn(),), np.array([1e3, 2e3]), (0.1, 0.2, 0.3), values, notes).plot().axes
    assert [text.xy[1] for text in hook.texts] == [2e3] * 3
    assert min(np.diff(sorted(text.xyann[1] for text in hook.texts))) > hook.texts[0].get_fontsize()


def test_the_largest_error_of_a_sweep_names_its_quantity_and_place():
    values = {name: np.full((2, 1, 3), 1e-3) for name in module.KEPT}
    values["model"][:] = 1
    operations, depths = (cf.well.TripIn(), cf.well.RotateOffBottom()), np.array([1e3, 2e3, 5409.0])
    for worst, told in ((0.5, "5e-01"), (np.inf, "without a bound: it may lock up")):
        values["model_error"][0, 0, 1] = worst
        last = list(cf.well.DepthSweep(operations, depths, (None,), values, {})._answer(Units()))[-2]
        assert "hook load and surface torque" in last and last.endswith(f"{told} (trip in, bit at 2000 m)")


@pytest.mark.slow
def test_the_string_in_its_hole_in_space(tmp_path):
    pytest.importorskip("pyvista")
    image = pytest.importorskip("matplotlib.image")
    answer = cf.well.torque_and_drag(HOLE, STRING, cf.well.TripOut(), mud=MUD, model="soft")
    for how in ({}, {"enlarge": 1}, {"between": (2400, 2500)}):
        answer.plot_3d(tmp_path / "hole.png", **how)
        pixels = image.imread(tmp_path / "hole.png")[:, :-230, :3]  # without the colour bar
        extents = np.ptp(np.argwhere(np.ptp(pixels, axis=2) > 0.15), axis=0)
        assert (extents > 0.5 * np.array(pixels.shape[:2])).any()  # the string crosses the page, however thin it is
    with pytest.raises(cf.SceneError, match="ends in .png"):
        answer.plot_3d(tmp_path / "hole.jpg")
    with pytest.raises(cf.SceneError, match="plot_3d.between"):
        answer.plot_3d(tmp_path / "hole.png", between=(2600, 2700))
