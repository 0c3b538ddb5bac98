"""Motions, strings, wells and derivatives on several ranks: one writes, and an error on one ends all."""

import errno
import os

import numpy as np
import pytest
from conftest import COMM
from ended_motions import Stopped, stop_at
from fake_string import scene
from moving_scenes import right_angle
from test_obstacles import pulled_bar

import cosserat_fenicsx as cf
from cosserat_fenicsx.storage.store import Store

pytestmark = pytest.mark.ranks
ASKED = {"duration": 2, "dt": 0.05, "elements": 4, "degree": 2}


def test_it_goes_on(tmp_path_all, monkeypatch):
    arm, scene = right_angle()
    whole = cf.simulate(scene, **ASKED)
    stop_at(monkeypatch, 25, 0.02)
    with pytest.raises(Stopped):
        cf.simulate(scene, **ASKED, folder=tmp_path_all / "motion")
    history = cf.resume(tmp_path_all / "motion")
    assert len(history) == len(whole) == 41
    tip = history.scene.rods[1].end
    np.testing.assert_allclose(history.position(tip), whole.position(arm.end), atol=1e-9)
    np.testing.assert_allclose(history.energy, whole.energy, rtol=1e-9)
    assert history.comm.allreduce(len(cf.read_history(tmp_path_all / "motion"))) == 41 * COMM.size


def test_a_full_disk_ends_all_ranks(tmp_path_all, monkeypatch):
    """Only rank 0 writes, and only half of a state."""
    pwrite, written = os.pwrite, []

    def until_full(file, data, place):
        written.append(len(data))
        if len(written) == 30:
            return pwrite(file, data[: len(data) // 2], place)
        if len(written) > 30:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return pwrite(file, data, place)

    _, scene = right_angle()
    monkeypatch.setattr(os, "pwrite", until_full)
    with pytest.raises(cf.NotStored, match="No space left on device") as stop:
        cf.simulate(scene, **ASKED, folder=tmp_path_all / "motion")
    saved = len(stop.value.path)
    assert saved == 14 == len(np.load(tmp_path_all / "motion" / "instants.npy", mmap_mode="r"))
    monkeypatch.setattr(os, "pwrite", pwrite)
    COMM.barrier()
    assert len(cf.resume(tmp_path_all / "motion")) == 41


def test_a_folder_that_cannot_be_made_is_said_on_all_ranks(tmp_path_all):
    if COMM.rank == 0:
        (tmp_path_all / "file").write_text("")
    COMM.barrier()
    with pytest.raises(cf.SceneError, match="expected a folder that can be written to"):
        cf.simulate(right_angle()[1], **ASKED, folder=tmp_path_all / "file")


def test_ranks_share_a_folder(tmp_path_all, monkeypatch):
    monkeypatch.setattr(Store, "APART", 0.0)
    monkeypatch.setattr(Store, "SELDOM", 0)
    given = scene(bit=cf.drilling.BitOnRock(cf.drilling.Stribeck(6e3, 4e3, 3.0), inertia=50.0))
    history = cf.drilling.simulate(given, 10.0, folder=tmp_path_all / "one", profile_every=1.0)
    alone = cf.drilling.simulate(given, 15.0, profile_every=1.0)
    assert np.array_equal(history.rows, alone.rows[: len(history)], equal_nan=True)
    again = cf.resume(tmp_path_all / "one", duration=15.0)
    assert np.array_equal(again.rows, alone.rows, equal_nan=True) and np.array_equal(again.speed, alone.speed)
    history.write(tmp_path_all / "out.csv")
    history.plot(tmp_path_all / "out.png")
    assert (tmp_path_all / "out.csv").stat().st_size > 10_000 and (tmp_path_all / "out.png").exists()


def test_a_sweep_is_kept_by_one_rank_and_goes_on_for_all(tmp_path_all):
    path = cf.well.WellPath.from_survey([0, 600, 1200, 2500], [0, 0, 50, 50], [0, 0, 120, 120])
    hole = cf.well.Borehole(path, cf.well.HoleSection(2500.0, 0.2159, 0.25))
    string, file = cf.well.DrillString([cf.well.DrillPipe(size="5 in 19.50 lb/ft")]), tmp_path_all / "sweep"
    settings = {"mud": cf.well.Mud(1200.0), "model": "soft", "folder": file}
    found = cf.well.depth_sweep(hole, string, cf.well.TripOut(), [1000.0, 2500.0], **settings)
    COMM.barrier()
    assert len((file / "rows.0.jsonl").read_text(encoding="utf-8").splitlines()) == 2
    again = cf.well.depth_sweep(hole, string, cf.well.TripOut(), [1000.0, 2500.0], **settings)
    answer = cf.well.torque_and_drag(hole, string, cf.well.TripOut(), mud=cf.well.Mud(1200.0), model="soft")
    loads = np.array(COMM.allgather([found.hook_load[0, 0, 1], again.hook_load[0, 0, 1], answer.hook_load]))
    assert (loads == loads[0, 0]).all()
    answer.write(tmp_path_all / "answer.csv")
    with pytest.raises(cf.SceneError, match="holds another sweep"):
        cf.well.depth_sweep(hole, string, cf.well.TripIn(), [1000.0], **settings)
    COMM.barrier()
    rows = (tmp_path_all / "answer.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == len(answer.md) + 1


E, DIAMETER = "rods.column.material.E", "rods.column.section.diameter"


def column(*loads):
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(0.2), cf.Material(E=210e9, nu=0.3), name="column")
    return cf.Scene([rod], [cf.Clamp(rod.start)], [load(rod) for load in loads])


@pytest.mark.parametrize("model", ["determinate", "planar", "spatial"])
def test_a_bent_column(model):
    """m = EI kappa: a moment bends to an arc, whose angle is M L/EI."""
    path = cf.solve(column(lambda rod: cf.Moment(rod.end, (0, 1e6, 0))), [1.0], model=model, elements=6)
    found = path.sensitivity(lambda path: path.rotation_angle("column.end"), [E, DIAMETER, "loads[0].moment[1]"])
    assert found.value == pytest.approx(1e6 * 20 / (210e9 * np.pi * 0.2**4 / 64), rel=1e-8)
    assert [found.relative(name)[0] for name in found] == pytest.approx([-1, -4, 1], rel=1e-8)


def test_critical_loads():
    scene = column(lambda rod: cf.Force(rod.end, (0, 0, -1e5)))
    found = cf.buckling(scene, 2, elements=6).sensitivity([E])
    assert found.relative(E) == pytest.approx([1.0, 1.0], rel=1e-8)
    path = cf.solve(scene, (0.0, 5.0), model="spatial", elements=6)
    assert path.sensitivity(path.events[0], [E]).relative(E) == pytest.approx(1.0, rel=1e-8)


def test_friction_of_an_obstacle_at_rest():
    """A bar that is pulled over a rough plane and released, with the closed form of one process."""
    scene, _, w, mu, EA, F = pulled_bar()
    path = cf.solve(scene, [1.0, 0.0], elements=16, model="planar", steps=cf.StepControl(adaptive=False))
    moved = F**2 / (2 * EA * mu * w)
    assert path.displacement(scene.rods[0].end)[:, 0] == pytest.approx([moved, moved / 2], rel=1e-7)
