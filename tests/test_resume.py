"""Motions written to a folder: whatever ends them, they are continued to the same digits."""

import errno
import gc
import os
import resource
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from ended_motions import CASES, SMALL, Stopped, assert_same, part_of, rows, run, stop_at
from moving_scenes import flying_in_space
from test_schemes import everything

import cosserat_fenicsx as cf
from cosserat_fenicsx.dynamics import time_loop
from cosserat_fenicsx.dynamics.schemes import SCHEMES
from cosserat_fenicsx.results.records import Instant
from cosserat_fenicsx.storage import files
from cosserat_fenicsx.storage.store import Store

pytestmark = pytest.mark.serial
PARTS = ("stepper", "schemes", "step_problem", "contact", "pace")
SOLVERS = tuple(f"cosserat_fenicsx.dynamics.{name}" for name in PARTS)


@pytest.mark.parametrize(("case", "apart"), [*((case, 0.02) for case in CASES), ("fixed", 0.0), ("adaptive", 1e9)])
def test_it_goes_on_to_the_same_digits(case, apart, tmp_path, monkeypatch, never_ended):
    """With some checkpoints, one at every step, and one at the start alone."""
    scene = part_of(case, tmp_path / "part", monkeypatch, step=25, apart=apart)
    before = rows(tmp_path / "part").copy()
    cf.simulate(scene, 0.05, dt=0.05, **SMALL)  # the pooled solver now has another tangent
    history = cf.resume(tmp_path / "part", scene)
    assert_same(tmp_path / "part", never_ended(case))
    assert 0 < len(before) < len(history)
    assert rows(tmp_path / "part")[: len(before)].tobytes() == before.tobytes()
    assert history.times[-1] == CASES[case][1] and history.why == cf.read_history(never_ended(case), scene).why


@pytest.mark.parametrize("scheme", SCHEMES)
def test_everything_that_steps_depend_on_is_remembered(scheme, tmp_path, monkeypatch):
    """A smooth motion, where tangents are reused for many steps: all
    numbers in the solvers are those of an uninterrupted run."""
    section = cf.Stiffness((1e6, 1e6), 1e6, (1e3, 1e3), 1e3, mass=1.0, inertia=(1, 1, 2))
    rod = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), section)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, cf.signals.Sine((0, 0, 3.0), 0.05))])
    write, over, kept, motions = files.write_checkpoint, time_loop.TimeLoop.over, [], []

    def write_and_keep(file, *given):
        write(file, *given)
        kept.append(file.read_bytes())

    def over_and_keep(self, *more):
        motions.append(self)
        return over(self, *more)

    monkeypatch.setattr(time_loop.TimeLoop, "over", over_and_keep)
    monkeypatch.setattr(files, "write_checkpoint", write_and_keep)
    monkeypatch.setattr(Store, "APART", 0.0)
    monkeypatch.setattr(Store, "SELDOM", 0)
    asked = {"dt": 0.02, "scheme": scheme, "elements": 24, "degree": 2}
    cf.simulate(scene, 0.8, folder=tmp_path / "whole", **asked)
    expected = numbers_held(motions[-1])
    monkeypatch.setattr(files, "write_checkpoint", write)
    for k in (20, 30, 36, 38, 39):
        shutil.copytree(tmp_path / "whole", tmp_path / f"from {k}")
        (tmp_path / f"from {k}" / "checkpoint.npz").write_bytes(kept[k])
        cf.simulate(scene, 0.1, **asked)
        cf.resume(tmp_path / f"from {k}", scene)
        assert numbers_held(motions[-1]) == expected
        assert_same(tmp_path / f"from {k}", tmp_path / "whole")


def numbers_held(thing, before=""):
    """All numbers in the solvers of a motion, by attribute names."""
    found = {}
    for name, value in vars(thing).items():
        if isinstance(value, bool | int | float):
            found[before + name] = value
        elif hasattr(value, "__dict__") and type(value).__module__.startswith(SOLVERS):
            if name != "problem" or not before:
                found |= numbers_held(value, f"{before}{name}.")
    return found


@pytest.mark.parametrize(("case", "step"), [("adaptive", 25), ("plane", 100)])
def test_kill_9(case, step, tmp_path, never_ended):
    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); import ended_motions as t;"
        f" t.kill_in(*{(case, step, str(tmp_path / 'killed'))!r})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8")
    assert done.returncode == -signal.SIGKILL, done.stderr
    scene = CASES[case][0]()[1]
    seen = cf.read_history(tmp_path / "killed", scene)
    whole = cf.read_history(never_ended(case), scene)
    assert 0 < len(seen) < len(whole) and (seen.times == whole.times[: len(seen)]).all()
    cf.resume(tmp_path / "killed", scene)
    assert_same(tmp_path / "killed", never_ended(case))
    assert len(seen) < len(whole)  # a history read before does not grow


def test_a_stored_history_answers_as_one_in_memory(tmp_path):
    rod, scene = everything()
    stored = cf.simulate(scene, 0.2, dt=0.01, folder=tmp_path / "motion", **SMALL)
    kept = cf.simulate(scene, 0.2, dt=0.01, **SMALL)
    again = cf.read_history(tmp_path / "motion")
    twin = next(x for x in again.scene.rods if x.name == rod.name)
    assert repr(stored) == repr(kept) == repr(again)
    for name in ("times", "steps", "iterations", "kinetic", "strain", "energy", "work", "dissipated", "balance",
                 "linear_momentum", "angular_momentum", "along_axis"):  # fmt: skip
        for history in (stored, again):
            assert (getattr(history, name) == getattr(kept, name)).all(), name
    for name in ("position", "displacement", "rotation", "rotation_angle", "force", "moment", "velocity",
                 "angular_velocity"):  # fmt: skip
        expected = getattr(kept, name)(rod.at(0.7))
        assert (getattr(stored, name)(rod.at(0.7)) == expected).all(), name
        assert (getattr(again, name)(twin.at(0.7)) == expected).all(), name
    for name, values in kept.fields(7, rod).items():
        assert (stored.fields(7, rod)[name] == values).all() and (again.fields(7, twin)[name] == values).all(), name
    assert (stored.largest_displacement() == kept.largest_displacement()).all()
    assert (stored.at_points([3, 5]).position(rod.end) == kept.position(rod.end)[[3, 5]]).all()
    for history, name in ((kept, "kept"), (again, "again")):
        history.write(tmp_path / f"{name}.xdmf")
    assert (tmp_path / "kept.xdmf").read_text().replace("kept", "again") == (tmp_path / "again.xdmf").read_text()
    again.plot_energy(tmp_path / "energy.png")
    assert (tmp_path / "energy.png").stat().st_size > 10000


def test_neither_tol_nor_dt(tmp_path):
    """The default tolerance; a folder may be prolonged."""
    _, scene = flying_in_space()
    history = cf.simulate(scene, 0.02, folder=tmp_path / "flight", elements=1, degree=2)
    assert (cf.read_history(tmp_path / "flight").times == history.times).all()
    assert cf.resume(tmp_path / "flight", duration=0.04).times[-1] == 0.04


def test_none_of_its_states_stays_in_memory(tmp_path):
    def instants():
        gc.collect()
        return sum(type(x) is Instant for x in gc.get_objects())

    before = instants()
    history = run("adaptive", tmp_path / "motion")
    assert len(history) > 30 and instants() <= before
    history.position(history.scene.rods[0].end)
    assert instants() <= before and isinstance(history._all_rq, np.memmap)


def test_a_full_disk_is_said_and_costs_nothing(tmp_path, never_ended):
    """A limit of the file size ends the writing in the middle of a state."""
    whole = cf.read_history(never_ended("adaptive"))
    size = rows(never_ended("adaptive")).dtype.itemsize
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(20.5 * size), hard))
    try:
        with pytest.raises(
            cf.NotStored, match=r"cannot be written: File too large. Make room; \d+ times of the motion are kept"
        ) as stop:
            run("adaptive", tmp_path / "part")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    saved = len(stop.value.path)
    assert 0 < saved <= 20 and (stop.value.path.times == whole.times[:saved]).all()
    assert len(rows(tmp_path / "part")) == saved
    cf.resume(tmp_path / "part")
    assert_same(tmp_path / "part", never_ended("adaptive"))


def test_a_checkpoint_that_cannot_be_written_leaves_the_one_before(tmp_path, monkeypatch, never_ended):
    replace, done = os.replace, []

    def full(source, target):
        done.append(target)
        if len(done) > 5:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        replace(source, target)

    monkeypatch.setattr(os, "replace", full)
    monkeypatch.setattr(Store, "APART", 0.0)
    monkeypatch.setattr(Store, "SELDOM", 0)
    with pytest.raises(cf.NotStored, match="No space left on device"):
        run("fixed", tmp_path / "part")
    monkeypatch.setattr(os, "replace", replace)
    assert sorted(x.name for x in (tmp_path / "part").iterdir()) == sorted(
        x.name for x in never_ended("fixed").iterdir()
    )
    cf.resume(tmp_path / "part")
    assert_same(tmp_path / "part", never_ended("fixed"))


def test_a_complete_motion_stays_as_it_is_and_may_be_prolonged(tmp_path, monkeypatch, never_ended):
    """Steps of 0.05 s: the extended motion equals one of that duration from the start."""
    scene = flying_in_space()[1]
    short = cf.simulate(scene, 2, dt=0.05, folder=tmp_path / "short", **SMALL)
    stamps = {file.name: file.stat().st_mtime_ns for file in (tmp_path / "short").iterdir()}
    again = cf.resume(tmp_path / "short")
    assert repr(again) == repr(short) and (again.energy == short.energy).all()
    assert {file.name: file.stat().st_mtime_ns for file in (tmp_path / "short").iterdir()} == stamps
    stop_at(monkeypatch, 20, 0.0)
    with pytest.raises(Stopped):
        cf.resume(tmp_path / "short", duration=5)
    longer = cf.resume(tmp_path / "short")
    whole = cf.read_history(never_ended("fixed"))
    np.testing.assert_allclose(longer.times, whole.times, rtol=1e-14)
    np.testing.assert_allclose(longer._all_rq, whole._all_rq, atol=1e-11)
    with pytest.raises(cf.SceneError, match="at least 5 s"):
        cf.resume(tmp_path / "short", duration=3)


def test_ctrl_c_and_a_lost_motion_keep_what_is_done(tmp_path, monkeypatch, never_ended):
    def interrupt():
        if len(rows(tmp_path / "motion")) == 12:
            raise KeyboardInterrupt

    monkeypatch.setattr(time_loop, "obey", interrupt)
    with pytest.raises(cf.Interrupted) as stop:
        run("fixed", tmp_path / "motion")
    assert len(stop.value.path) == 12 and stop.value.path.folder == tmp_path / "motion"
    monkeypatch.undo()
    cf.resume(tmp_path / "motion")
    assert_same(tmp_path / "motion", never_ended("fixed"))
    rod, _ = flying_in_space()
    torn = cf.Scene([rod], loads=[cf.Force(rod.end, cf.signals.Step((1e9, 0, 0), start=0.2))])
    with pytest.raises(cf.NotConverged) as lost:
        cf.simulate(torn, 1, dt=0.05, folder=tmp_path / "torn", **SMALL)
    times = lost.value.path.times
    with pytest.raises(cf.NotConverged) as again:
        cf.resume(tmp_path / "torn")
    assert 0.2 < times[-1] < 1 and (again.value.path.times == times).all()
