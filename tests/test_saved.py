"""Results in one file: the same digits after reading, other programs can read it, and what is refused."""

import json
import shutil

import numpy as np
import pytest
from conftest import COMM, column
from moving_scenes import SPAGHETTI

import cosserat_fenicsx as cf

OF_PATH = (
    "load_factors",
    "negative_modes",
    "stable",
    "error",
    "conservative",
    "control",
    "left",
    "rounding",
    "galerkin",
)
OF_HISTORY = ("times", "steps", "kinetic", "strain", "work", "dissipated", "balance", "linear_momentum",
              "angular_momentum", "scheme", "time_unit")  # fmt: skip


def frame():
    """A path of two joined rods, in their plane, with a clamp, a roller, pieces of sections and loads along."""
    steel = cf.Material(210e9, 0.3, 7850.0)
    post = cf.Rod(
        cf.Line((0, 0, 0), (0, 0, 3)), [(1.0, cf.Tube(0.1, 0.08)), (3.0, cf.Circle(0.05))], steel, name="post"
    )
    arm = cf.Rod(cf.Arc((0, 0, 2), (0, 0, 3), 1.0, axis=(0, 1, 0)), cf.Rectangle(0.05, 0.1), steel, name="an/arm")
    loads = [
        cf.Force(arm.end, (500.0, 0, -900.0)),
        cf.LineForce(arm, (0, 0, -100.0), permanent=True),
        cf.Spring(arm.end, 300.0),
    ]
    supports = [cf.Clamp(post.start), cf.Roller(post.at(1.5), (1, 0, 0))]
    return cf.Scene([post, arm], supports, loads, [cf.Joint(post.end, arm.start)], title="a <b> & \u03b1")


def buckled():
    """A column in space over its bifurcation."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Stiffness((1e4, 1e4), 1e5, (1.0, 2.0), 1.0), name="rod")
    return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -cf.euler_load(rod)))])


def swing(folder=None):
    rod = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), SPAGHETTI, name="rod", damping=cf.Damping(drag=0.1))
    loads = [cf.Force(rod.end, cf.signals.Sine((0, 0, 2.0), 0.5))]
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], loads)
    return cf.simulate(scene, 0.2, dt=0.05, elements=3, degree=2, folder=folder)


def assert_same(one, other, names):
    assert type(other) in (cf.Path, cf.History) and repr(one) == repr(other) and len(one) == len(other)
    assert one.comm.size == other.comm.size and list(one.why) == other.why and one.scene.title == other.scene.title
    for name in (*names, "iterations", "along_axis", "elements", "formulation"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    for rod in one.scene.rods:
        station = f"{rod.name}@{0.37 * rod.length}"
        for query in ("position", "rotation", "rotation_angle", "force", "moment"):
            np.testing.assert_array_equal(getattr(one, query)(station), getattr(other, query)(station), err_msg=query)
        for k in (0, -1):
            fields = other.fields(k, rod.name)
            for name, values in one.fields(k, rod).items():
                np.testing.assert_array_equal(values, fields[name], err_msg=name)
    for mine, theirs in zip(one.scene.supports, other.scene.supports, strict=True):
        np.testing.assert_array_equal(one.reaction(mine), other.reaction(theirs))
    largest = other.largest()
    for name, value in one.largest().items():
        assert (value.size, str(value.station), value.point) == (
            largest[name].size, str(largest[name].station), largest[name].point
        )  # fmt: skip


@pytest.mark.parametrize("solved", [
    lambda: cf.solve(frame(), [0.5, 1.0], elements=2),
    lambda: cf.solve(column()[1], [0.3, 0.6], tol=1e-4),
    lambda: cf.solve(buckled(), (0.5, 1.1), elements=4, model="spatial", branch=1),
])  # fmt: skip
def test_a_path_with_the_same_digits(solved, tmp_path_all):
    path = solved()
    path.save(tmp_path_all / "path.h5")
    again = cf.read_path(tmp_path_all / "path.h5")
    assert_same(path, again, OF_PATH)
    assert len(path.events) == len(again.events) == (1 if path.left else 0)
    for one, other in zip(path.events, again.events, strict=True):
        assert repr(one) == repr(other)
        np.testing.assert_array_equal(path.mode(one), again.mode(other, "rod"))


def test_a_history_with_the_same_digits(tmp_path_all):
    for history in (swing(), swing(tmp_path_all / "motion")):
        history.save(tmp_path_all / "motion.h5")
        again = cf.read_history(tmp_path_all / "motion.h5")
        assert_same(history, again, OF_HISTORY)
        for query in ("velocity", "angular_velocity"):
            np.testing.assert_array_equal(getattr(history, query)("rod.end"), getattr(again, query)("rod.end"))
    with pytest.raises(cf.SceneError, match="read_history.scene = .* expected None, since the file"):
        cf.read_history(tmp_path_all / "motion.h5", history.scene)


@pytest.mark.serial
def test_h5py_alone_reads_it(tmp_path):
    import h5py

    path = cf.solve(frame(), [0.5, 1.0], elements=2)
    path.save(tmp_path / "path.h5")
    assert [x.name for x in tmp_path.iterdir()] == ["path.h5"]
    with h5py.File(tmp_path / "path.h5") as store:
        assert store["load_factor"][:].tolist() == [0.5, 1.0]
        arm, expected = store["rods/an|arm"], path.fields(-1, "an/arm")
        assert arm.attrs["rod"] == "an/arm" and arm["moment"].attrs["units"] == "N m"
        assert arm["strain_component"].asstr()[:].tolist() == ["shear 1", "shear 2", "stretch"]
        for name, values in expected.items():
            np.testing.assert_allclose(arm[name][-1] if name != "s" else arm[name], values, rtol=1e-12, atol=1e-9)
        assert [dim.label for dim in arm["position"].dims] == ["point", "s", "component"]
        np.testing.assert_array_equal(store["reaction_force"][0], path.reaction(path.scene.supports[0])[0])
        assert json.loads(store["scene"].asstr()[()])["title"] == path.scene.title


@pytest.mark.serial
def test_damaged_and_foreign_files_are_refused(tmp_path):
    import h5py

    file = tmp_path / "path.h5"
    cf.solve(column()[1], [0.3], elements=2).save(file)

    def damaged(change):
        other = tmp_path / "other.h5"
        shutil.copy(file, other)
        with h5py.File(other, "r+") as store:
            change(store)
        return other

    def replace(store, name, value):
        crc = store[name].attrs["crc32"]
        del store[name]
        store[name] = value
        store[name].attrs["crc32"] = crc

    def swap_digit(store):
        values = store["solution/rq"][:]
        values[0, 1, 0] += 1e-15
        store["solution/rq"][...] = values

    def sparse(store):
        del store["solution/rq"]
        store.create_dataset("solution/rq", (10**6, 10**6, 7), float)

    whole = file.read_bytes()
    (tmp_path / "half.h5").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "text.h5").write_text("load factor, position\n")
    for name, expected in {"half.h5": "half.h5: it cannot be read", "text.h5": "text.h5: it cannot be read",
                           "none.h5": "none.h5: there is no such file"}.items():  # fmt: skip
        with pytest.raises(cf.SceneError, match=expected):
            cf.read_path(tmp_path / name)
    for change, expected in {
        swap_digit: "is damaged .*check sum of rq is wrong",
        sparse: "is damaged .*rq is neither a text nor an array",
        lambda store: replace(store, "scene", "{}"): "is damaged .*check sum of scene",
        lambda store: store.pop("solution/gauss"): "is damaged .*gauss",
        lambda store: store.attrs.update(version=99): "its format is 99, and this release reads up to 1",
        lambda store: store.attrs.update(format="another"): "it is of another program",
        lambda store: store.attrs.update(kind="History"): "it holds a History: expected a Path; read_result reads any",
    }.items():
        with pytest.raises(cf.SceneError, match=f"other.h5.*{expected}"):
            cf.read_path(damaged(change))
    for change, expected in {
        lambda store: store.attrs.update(version=99): "its format is 99, and this release reads up to 1",
        lambda store: store.attrs.update(format="another"): "it is of another program",
        lambda store: store.attrs.update(kind="Nothing"): "is damaged .*Nothing",
    }.items():
        with pytest.raises(cf.SceneError, match=f"other.h5.*{expected}"):
            cf.read_result(damaged(change))
    with pytest.raises(cf.SceneError, match="it holds a Path: expected a History; read_result reads any"):
        cf.read_history(file)


def test_scenes_with_code_are_not_saved(tmp_path_all):
    """An old file stays."""
    rod, scene = column(section=lambda s: cf.Circle(0.2 + 0.001 * s))
    file = tmp_path_all / "path.h5"
    if COMM.rank == 0:
        file.write_text("old")
    path = cf.solve(scene, [0.3], elements=2)
    with pytest.raises(cf.SceneError, match=r"path.h5: rods\[0\].section: a function written in Python cannot be"):
        path.save(file)
    with pytest.raises(cf.SceneError, match="save: expected a result with at least one load factor"):
        path.at_points([]).save(file)
    COMM.barrier()
    assert file.read_text() == "old"
