"""Copies and pickles of paths and histories; a pickle contains no communicator and no function of a model."""

import copy
import math
import pickle

import numpy as np
import pytest
from conftest import COMM, column
from moving_scenes import SPAGHETTI

import cosserat_fenicsx as cf

PATH = ("load_factors", "iterations", "negative_modes", "stable", "error", "along_axis")
HISTORY = ("times", "steps", "iterations", "kinetic", "strain", "work", "dissipated", "balance", "linear_momentum",
           "angular_momentum", "along_axis")  # fmt: skip


def swinging(force=cf.signals.Sine((0, 0, 2.0), 0.5)):
    rod = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), SPAGHETTI, name="rod")
    return rod, cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, force)])


def moved(scene, **more):
    return cf.simulate(scene, 0.2, dt=0.05, elements=3, degree=2, **more)


def assert_same(one, other, names, station):
    assert len(one) == len(other) > 1 and repr(one) == repr(other)
    for name in names:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    for query in ("position", "rotation", "force", "moment"):
        np.testing.assert_array_equal(getattr(one, query)(station), getattr(other, query)(station), err_msg=query)
    for k in (0, -1):
        fields = other.fields(k)
        for name, values in one.fields(k).items():
            np.testing.assert_array_equal(values, fields[name], err_msg=name)


@pytest.mark.parametrize("model", ["determinate", "planar", "spatial"])
def test_path(model):
    """Also during the computation: a copy made in `until` is complete, and the path continues."""
    rod, scene = column()
    seen = []

    def keep(path):
        seen.append((copy.deepcopy(path), pickle.loads(pickle.dumps(path)), len(path)))

    path = cf.solve(scene, (0.0, 0.9), elements=4, model=model, until=keep)
    for copied, loaded, count in seen:
        assert len(copied) == len(loaded) == count
        at = [copied.displacement(rod.end), loaded.displacement("column.end")]
        np.testing.assert_array_equal(at, [path.displacement(rod.end)[:count]] * 2)
    for other in (copy.copy(path), copy.deepcopy(path), pickle.loads(pickle.dumps(path))):
        assert_same(path, other, PATH, "column.end")
    loaded = pickle.loads(pickle.dumps(path))
    assert loaded.comm.size == 1 and path.comm.size == copy.deepcopy(path).comm.size == COMM.size
    assert loaded.scene is not scene and copy.deepcopy(path).scene is scene
    assert len(loaded.at_points([1, 2])) == 2
    np.testing.assert_array_equal(cf.solve(loaded.scene, [0.3], elements=4).force("column.end"),
                                  cf.solve(scene, [0.3], elements=4).force("column.end"))  # fmt: skip


def test_a_copy_is_apart():
    rod, scene = column()
    path = cf.solve(scene, [0.3, 0.6], elements=4)
    before = path.position(rod.end)
    other = copy.deepcopy(path)
    other._records[0].rq[:] = 0.0
    other.events.append("something")
    np.testing.assert_array_equal(path.position(rod.end), before)
    assert not path.events


def test_history():
    rod, scene = swinging()
    history = moved(scene)
    for other in (copy.copy(history), copy.deepcopy(history), pickle.loads(pickle.dumps(history))):
        assert_same(history, other, HISTORY, "rod.end")
        np.testing.assert_array_equal(other.velocity("rod.end"), history.velocity(rod.end))
    assert not isinstance(history, cf.Path) and not hasattr(history, "load_factors")


@pytest.mark.serial
def test_a_stored_history_goes_by_its_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rod, scene = swinging()
    history = moved(scene, folder="motion")
    text = pickle.dumps(history)
    monkeypatch.chdir("/")
    for other in (copy.copy(history), copy.deepcopy(history), pickle.loads(text)):
        assert_same(history, other, HISTORY, "rod.end")
        assert_same(history.at_points([0, 3]), pickle.loads(pickle.dumps(other.at_points([0, 3]))), HISTORY, "rod.end")
    (tmp_path / "motion" / "instants.npy").unlink()
    with pytest.raises(cf.SceneError, match="instants.npy: expected the 5 saved states of a motion"):
        pickle.loads(text)


@pytest.mark.serial
def test_files_of_what_was_pickled(tmp_path):
    for solved in (cf.solve(column()[1], [0.3, 0.6], elements=4), moved(swinging()[1])):
        path = pickle.loads(pickle.dumps(solved))
        path.write(tmp_path / "path.xdmf")
        path.write(tmp_path / "point.vtu", 1)
        assert (tmp_path / "path.xdmf").stat().st_size > 0 and (tmp_path / "point.vtu").stat().st_size > 0


def test_what_cannot_be_pickled_is_named():
    """A deep copy does not need to pickle."""
    _, scene = swinging(lambda t: (0, 0, math.sin(t)))
    history = moved(scene)
    with pytest.raises(pickle.PicklingError, match=r"a History cannot be pickled .* loads\[0\] \(Force at rod.end\)"):
        pickle.dumps(history)
    assert_same(history, copy.deepcopy(history), HISTORY, "rod.end")
    steel = cf.Material(E=210e9, nu=0.3, density=7850.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), lambda s: cf.Circle(0.02 + 0.01 * s), steel, name="cone")
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (1, 0, 0))]), [1.0], elements=2)
    with pytest.raises(pickle.PicklingError, match=r"a Path cannot be pickled .* rods\[0\] \(cone\)"):
        pickle.dumps(path)
    assert len(copy.deepcopy(path)) == 1


def test_a_history_is_no_start():
    """It is refused, because its velocities would be lost silently."""
    _, scene = swinging()
    with pytest.raises(cf.SceneError, match="expected a load factor, a Path"):
        moved(scene, start=moved(scene))
