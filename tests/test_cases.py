"""Many cases of a scene, `compile`: each equals `solve` of the same scene, or went there."""

import dataclasses
import pickle

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.errors import Interrupted
from cosserat_fenicsx.ranks import apart
from cosserat_fenicsx.scene.parameters import laws_with, parameter_of, scene_with
from cosserat_fenicsx.statics import cases, pair

STEEL = cf.Material(E=2e11, nu=0.3, density=7800.0)


def column(*loads, force=(3.0, 0.0, -20.0), length=1.0):
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, length)), cf.Circle(0.01), STEEL, name="column")
    loads = [make(rod) for make in loads] or [cf.Force(rod.end, force)]
    return cf.Scene([rod], supports=[cf.Clamp(rod.start)], loads=loads)


def elbow():
    post = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Rectangle(0.012, 0.008), STEEL, name="post")
    arm = cf.Rod(cf.Line((0, 0, 1), (1, 0, 1)), cf.Tube(0.02, 0.016), STEEL, name="column")
    return cf.Scene([post, arm], [cf.Clamp(post.start)], [cf.Force(arm.end, (0.0, 2.0, -4.0))],
                    joints=[cf.Joint(post.end, arm.start)])  # fmt: skip


ASKED = [("displacement", "column.end", 0), ("position", "column.end", 2), ("rotation_angle", "column.end"),
         ("force", "column.start", 2), ("moment", "column.start", 1)]  # fmt: skip
SCENES = {
    "planar": (
        column(),
        ["rods.column.section.diameter", "rods.column.material.E", "loads[0].force[0]", "loads[0].force[2]"],
    ),  # fmt: skip
    "spatial": (
        column(lambda rod: cf.Force(rod.end, (2.0, 0.0, -9.0)), lambda rod: cf.Force(rod.at(0.5), (0, 3.0, 0))),
        ["materials[0].nu", "loads[0].force[1]", "rods[0].section.diameter"],
    ),  # fmt: skip
    "turned plane": (column(force=(2.0, 3.0, -9.0)), ["loads[0].force[1]"]),
    "follower": (
        column(lambda rod: cf.FollowerForce(rod.end, (2.0, 0.0, -5.0))),
        ["loads[0].force[0]", "rods.column.section.diameter"],
    ),  # fmt: skip
    "along": (
        column(lambda rod: cf.LineForce(rod, (4.0, 1.0, 0.0)), lambda rod: cf.Moment(rod.end, (0, 2.0, 0))),
        ["loads[0].force[0]", "loads[1].moment[1]"],
    ),  # fmt: skip
    "weight": (
        column(lambda rod: cf.Weight((0, 0, -9.81)), lambda rod: cf.Force(rod.end, (1.0, 0, 0))),
        ["materials[0].density", "loads[1].force[0]"],
    ),  # fmt: skip
    "length": (column(), ["rods.column.curve.end[2]", "loads[0].force[0]"]),
    "frame": (elbow(), ["rods.post.section.width", "rods.column.section.inner_diameter", "loads[0].force[2]"]),
}


def spread(scene, over, count, share=0.05, seed=1):
    parameters = [parameter_of(scene, name) for name in over]
    sizes = share * np.array([x.size for x in parameters])
    return np.array([x.value for x in parameters]) + sizes * np.random.default_rng(seed).uniform(
        -1, 1, (count, len(over))
    )


@pytest.mark.serial
@pytest.mark.parametrize("name", SCENES)
def test_cases_equal_solve(name, monkeypatch):
    scene, over = SCENES[name]
    in_lock_step = name in ("planar", "spatial", "follower")
    monkeypatch.setattr(cases, "_SERVED", 1 if in_lock_step else np.inf)
    # in lock step four of them, with steps of different number, and then two
    compiled, values = cf.compile(scene, over, ASKED), spread(scene, over, 6, share=0.3 if in_lock_step else 0.05)
    assert compiled.model, compiled.why
    loaded_each = name in ("length", "turned plane")
    assert any(("loading every case" if loaded_each else "linear map") in line for line in compiled.why), compiled.why
    found, alone = compiled.batch(values), [compiled(row).values for row in values]
    assert bool(compiled._pair._lock_step) == in_lock_step
    assert not found.by_solve.any() and not found.failures
    for k in (0, 2):
        path = cf.solve(scene_with(scene, over, values[k]), [1.0])
        wanted, errors = compiled._asked(path, 0)
        sizes = np.maximum(np.abs(wanted), np.repeat([path.largest_displacement()[0], 1, 1, 1], [2, 1, 1, 1]) * 1e-1)
        # n and m to 1e-12 or to their rounding, which other units change
        most = 1e-12 + path.rounding_errors[[0, 0, 1, 2, 3], 0]
        assert (np.abs(found.values[k] - wanted) < most * sizes).all(), (found.values[k] - wanted, sizes)
        assert path.error[0] > 1e-12 and (found.errors[k][:2] > 0).all()
        np.testing.assert_allclose(found.errors[k], errors, rtol=1e-2, atol=1e-9 * np.abs(wanted).max())
    assert (np.abs(found.values - alone) < 2 * most * sizes).all()  # both are rounded


@pytest.mark.serial
def test_what_is_not_decided_goes_to_solve_and_says_so():
    scene = column(force=(1.0, 0.0, -20.0))
    compiled = cf.compile(scene, ["loads[0].force[2]", "rods[0].section.diameter"], ASKED[:1], tol=1e-8)
    critical = cf.euler_load(scene.rods[0])
    found = compiled.batch([[-20.0, 0.01], [-3.0 * critical, 0.01], [-20.0, -0.01]])
    assert found.by_solve.tolist() == [False, True, True]
    assert "diameter" in found.failures[2] and np.isnan(found.values[2]).all()
    alone = cf.solve(scene_with(scene, compiled.names, [-3.0 * critical, 0.01]), [1.0], tol=1e-8)
    assert found.values[1, 0] == pytest.approx(alone.displacement("column.end")[0, 0], rel=1e-12)
    light = scene_with(scene, compiled.names, [-1e-7, 0.01])
    wanted = cf.solve(light, [1.0], tol=1e-8).displacement("column.end")[0, 0]
    assert compiled([-1e-7, 0.01]).values[0] == pytest.approx(wanted, rel=1e-12)
    with pytest.raises(cf.SceneError, match="diameter"):
        compiled([-20.0, -0.01])


@pytest.mark.serial
def test_numbers_that_a_part_refuses_are_refused():
    """A negative mass, a rod that shrinks to nothing; numbers that are 0 or refused one after the other are taken."""
    weighed = column(lambda rod: cf.Weight(), lambda rod: cf.PointMass(rod.end, 0.3), lambda rod: cf.Growth(rod, 1.01))
    compiled = cf.compile(weighed, ["loads[1].mass", "loads[2].factor"], [("force", "column.start", 2)])
    found = compiled.batch([[0.3, 1.01], [-0.1, 1.01], [0.3, -0.5]] + 3 * [[0.2, 1.02]])
    assert sorted(found.failures) == [1, 2] and "mass" in found.failures[1] and np.isfinite(found.values[[0, 3]]).all()
    tube = dataclasses.replace(column().rods[0], section=cf.Tube(0.02, 0.016))
    wider = scene_with(cf.Scene([tube]), [f"rods[0].section.{x}_diameter" for x in ("inner", "outer")], [0.03, 0.04])
    assert wider.rods[0].section == cf.Tube(0.04, 0.03)
    names = [f"rods[0].section.{x}_diameter" for x in ("inner", "outer")]  # both at once: one alone is refused
    _, J = laws_with(cf.Scene([tube]), [parameter_of(cf.Scene([tube]), x) for x in names], np.array([[0.03, 0.04]]))
    assert J[0, 0] == pytest.approx(wider.rods[0].profile.range[0].J, rel=1e-14)
    compiled = cf.compile(column(force=(1.0, 0, 0)), ["loads[0].force[0]", "loads[0].force[2]"], ASKED[:1])
    assert np.isfinite(compiled.batch([[0.0, -100.0], [1.0, -400.0], [0.0, -400.0]]).values).all()
    for bad in ([["x", 1.0]], [1.0, 2.0], [[1.0]], [[1.0, np.nan]]):
        with pytest.raises(cf.SceneError, match="rows of finite numbers"):
            compiled.batch(bad)
    with pytest.raises(cf.SceneError, match="query is empty"):
        cf.compile(column(), "loads[0].force[0]", [])


@pytest.mark.serial
def test_a_case_without_a_fast_way():
    hinged = column(lambda rod: cf.Force(rod.at(0.5), (1.0, 0, 0)))
    hinged = dataclasses.replace(hinged, supports=[*hinged.supports, cf.Pin(hinged.rods[0].end)])
    compiled = cf.compile(hinged, "loads[0].force[0]", [("displacement", "column@0.5", 0)])
    assert not compiled.model and "constraint equations" in compiled.why[0]
    found = compiled([2.0])
    assert found.by_solve
    assert (
        found.values[0] == cf.solve(scene_with(hinged, compiled.names, [2.0]), [1.0]).displacement("column@0.5")[0, 0]
    )


@pytest.mark.serial
def test_it_says_what_it_expects():
    scene = column()
    for over, query, words in (
        (["rods[0].section.diametre"], ASKED, "diameter"),
        ([], ASKED, "over is empty"),
        (["loads[0].force[0]"], [("displacment", "column.end", 0)], "displacement"),
        (["loads[0].force[0]"], [("force", "column.end")], "component"),
        (["materials[0].E", "rods[0].material.E"], ASKED, "same number"),
    ):
        with pytest.raises(cf.SceneError, match=words):
            cf.compile(scene, over, query)
    with pytest.raises(cf.SceneError, match="finite"):
        cf.compile(scene, ["loads[0].force[0]"], ASKED).batch([[np.nan]])


@pytest.mark.serial
def test_ctrl_c_leaves_it_usable(monkeypatch):
    compiled = cf.compile(column(), ["loads[0].force[0]"], ASKED[:1])
    before = compiled([2.0]).values

    def stop():
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(pair, "obey", stop)
        with pytest.raises((KeyboardInterrupt, Interrupted)):
            compiled.batch([[1.0], [2.5]])
    np.testing.assert_array_equal(compiled([2.0]).values, before)


@pytest.mark.ranks
def test_each_rank_alone():
    scene = column()
    with apart():
        found = cf.compile(scene, ["loads[0].force[0]"], ASKED[:1]).batch([[2.0], [3.0]])
    assert not found.by_solve.any()
    assert found.values[1, 0] == pytest.approx(cf.solve(scene, [1.0]).displacement("column.end")[0, 0], rel=1e-12)


@pytest.mark.serial
def test_a_study_of_a_compiled_scene(tmp_path):
    """The numbers of `batch`, with names, units and failures, again from the folder; other names are refused."""
    compiled = cf.compile(column(), ["loads[0].force[0]", "rods[0].section.diameter"], ASKED[:2])
    cases = {"loads[0].force[0]": [1.0, 2.0], "rods[0].section.diameter": [0.01, -1.0]}
    found = cf.study(compiled, cases, folder=tmp_path)
    expected = compiled.batch([[1.0, 0.01], [1.0, -1.0], [2.0, 0.01], [2.0, -1.0]])
    for k in (0, 2):
        assert list(found.results[k].values()) == [*expected.values[k], *expected.errors[k]]
    assert [found.why(k) for k in (1, 3)] == [expected.failures[k] for k in (1, 3)]
    assert found.units["error of position column.end z"] == "m" and found.units["loads[0].force[0]"] == "N"
    assert "displacement column.end x" in found.results[0]
    again = cf.study(compiled, cases, folder=tmp_path)
    assert again.results == found.results and (again.seconds[::2] == found.seconds[::2]).all()
    assert pickle.loads(pickle.dumps(compiled.task())).many(found.cases[:1]) == [found.results[0]]
    with pytest.raises(cf.SceneError, match="compiled over"):
        cf.study(compiled, {"force": [1.0]})
