"""Derivatives of queries of a path by numbers of its scene: closed forms, and differences of solutions."""

import numpy as np
import pytest
from conftest import column

import cosserat_fenicsx as cf
from cosserat_fenicsx.numerics import PLACES, derivative

pytestmark = pytest.mark.serial
E, DIAMETER, LOAD = "rods.column.material.E", "rods.column.section.diameter", "loads[0].force[2]"


def differenced(solved, query, value, step=2e-3):
    """The derivative by differences of solutions, of eighth order."""
    step *= abs(value) or 1.0
    return derivative([np.asarray(query(solved(value + k * step))) for k in PLACES], step)[0]


def agrees(found, name, reference, tol=1e-6):
    size = np.abs(reference).max()
    assert size > 0
    assert np.abs(found[name] - reference).max() <= tol * size
    assert found.error[name].max() <= tol * size


def tip(path):
    return path.displacement("column.end")[:, 0]


def test_small_loads_have_the_powers_of_beam_theory():
    """A small force moves the tip of a cantilever by F L^3/(3 EI), a small moment by M L^2/(2 EI)."""
    steel = cf.Material(E=210e9, nu=0.3)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Stiffness(
        shear=(np.inf, np.inf), axial=np.inf, bending=(1e6, 1e6), torsion=1e6), name="column")  # fmt: skip
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (1e-3, 0, 0))]), [1.0])
    found = path.sensitivity(tip, ["loads[0].force[0]", "rods.column.section.bending[1]", "rods.column.curve.end[2]"])
    assert [found.relative(name)[0] for name in found] == pytest.approx([1, -1, 3], rel=1e-9)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(0.02), steel, name="column")
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Moment(rod.end, (0, 1e-3, 0))]), [1.0])
    found = path.sensitivity(tip, [E, DIAMETER, "loads[0].moment[1]"])
    assert [found.relative(name)[0] for name in found] == pytest.approx([-1, -4, 1], rel=1e-9)


@pytest.mark.parametrize("model", ["determinate", "planar", "spatial"])
def test_eccentric_cantilever(model):
    """Figure 3's column, 0.11 L of deflection: every query by E, diameter and load, as by differences of solutions."""
    given = {"model": model, "elements": 8}

    def scene(*, E=210e9, diameter=0.2, load=1.0):
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(diameter), cf.Material(E=E, nu=0.3), name="column")
        P = 101.7e3
        return cf.Scene([rod], [cf.Clamp(rod.start)],
                        [cf.Force(rod.end, (0, 0, -P * load)), cf.Moment(rod.end, (0, 0.2 * P, 0))])  # fmt: skip

    path = cf.solve(scene(), [0.5, 0.9], **given)
    assert path.model == model
    queries = (
        tip,
        lambda path: path.rotation("column.end"),
        lambda path: path.moment("column@7.0"),
        lambda path: path.reaction("column.start")[1],
    )
    for query in queries:
        found = path.sensitivity(query, [E, DIAMETER, LOAD])
        for name, field, value in ((E, "E", 210e9), (DIAMETER, "diameter", 0.2), (LOAD, "load", 1.0)):
            by = differenced(lambda x: cf.solve(scene(**{field: x}), [0.5, 0.9], **given), query, value)
            agrees(found, name, by / (-101.7e3 if field == "load" else 1.0))


def solid(scene_of, value, name, query, **given):
    """Derivatives as those by differences of solutions."""
    path = cf.solve(scene_of(value), [0.5, 1.0], **given)
    agrees(path.sensitivity(query, [name]), name, differenced(
        lambda x: cf.solve(scene_of(x), [0.5, 1.0], **given), query, value))  # fmt: skip
    return path


def test_foundation_spring_wall_and_prescribed_motion():
    def rod():
        return cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(0.2), cf.Material(E=210e9, nu=0.3), name="column")

    def resting(kind):
        def scene(value):
            column = rod()
            return cf.Scene([column], [cf.Clamp(column.start)],
                            [cf.Force(column.end, (5e4, 0, -1e5)), kind(column, value)])  # fmt: skip

        return scene

    for kind, value in (
        (lambda column, k: cf.Foundation(column, k), 2e3),
        (lambda column, k: cf.Spring(column.end, k), 1e4),
        (lambda column, k: cf.Wall(column, (0, 0, 0), (0, 0, 1), clearance=0.5, stiffness=k), 1e4),
    ):
        solid(resting(kind), value, "loads[1].stiffness", tip, elements=8)

    def held(u):
        column = rod()
        supports = [cf.Clamp(column.start), cf.Prescribed(column.end, displacement=(u, 0, -0.5))]
        return cf.Scene([column], supports)

    solid(held, 3.0, "supports[1].displacement[0]", lambda path: path.reaction("column.end")[0], elements=6)


def test_out_of_the_plane_it_takes_the_spatial_model():
    """The load keeps its plane and the parameter leaves it: the sideways tip, of a determinate and a planar path."""

    def scene(force):
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(0.2), cf.Material(E=210e9, nu=0.3), name="column")
        return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (5e4, force, -1e5))])

    for model in ("determinate", "planar"):
        path = cf.solve(scene(0.0), [0.5, 1.0], model=model, elements=6)
        found = path.sensitivity(lambda path: path.displacement("column.end")[:, 1], ["loads[0].force[1]"])
        sideways = [
            cf.solve(scene(force), [0.5, 1.0], elements=6).displacement("column.end")[:, 1] for force in (-1e3, 1e3)
        ]
        rough = (sideways[1] - sideways[0]) / 2e3
        assert found["loads[0].force[1]"] == pytest.approx(rough, rel=1e-3)


def test_the_length_scales_curve_stations_and_mesh():
    """A parameter by a function: a column held at both ends, loaded in the middle."""

    def scene(L):
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, L)), cf.Circle(0.2), cf.Material(E=210e9, nu=0.3), name="column")
        return cf.Scene([rod], [cf.Clamp(rod.start), cf.Pin(rod.end)], [cf.Force(rod.at(L / 2), (1e5, 0, 0))])

    def middle(path):
        return path.displacement(path.rod().at(path.rod().length / 2))[:, 0]

    path = solid(scene, 20.0, "rods.column.curve.end[2]", middle, elements=6)
    found = path.sensitivity(middle, [cf.Parameter("length", 20.0, scene, "m")])
    assert found["length"] == pytest.approx(path.sensitivity(middle, ["rods[0].curve.end[2]"])["rods[0].curve.end[2]"])


def test_stations_and_supports_of_the_scene_that_was_given():
    rod, scene = column()
    path = cf.solve(scene, [0.5], elements=4)
    one = path.sensitivity(lambda path: path.position(rod.end), [E])[E]
    assert one == pytest.approx(path.sensitivity(lambda path: path.position("column.end"), [E])[E], rel=1e-12)
    by_support, by_name = (
        path.sensitivity(lambda path: path.reaction(which)[1], [E])[E] for which in (scene.supports[0], rod.start)
    )
    assert by_support == pytest.approx(by_name, rel=1e-12)
    again = cf.solve(scene, [0.5], elements=4)
    assert np.array_equal(again.position(rod.end), path.position(rod.end))  # the solvers are as they were


def test_uncertainty_adds_up():
    _, scene = column()
    path = cf.solve(scene, [0.3, 0.9], elements=4)
    given = {E: 5e9, DIAMETER: 1e-3, LOAD: 1e3}
    found, slopes = path.uncertainty(given, tip), path.sensitivity(tip, given)
    parts = np.array([slopes[name] * given[name] for name in given])
    assert found.standard_deviation == pytest.approx(np.sqrt((parts**2).sum(axis=0)), rel=1e-12)
    assert sum(found.shares.values()) == pytest.approx(1.0)
    assert f"% from {E} +- 5e+09 Pa" in str(found)
    assert str(slopes).startswith("tip = ") and ", the last of 2\n" in str(slopes)
    assert str(path.sensitivity(lambda path: 1.0, [E])).startswith("value = 1\n")
    together = path.uncertainty(given, tip, correlation=np.ones((3, 3)))
    assert together.standard_deviation == pytest.approx(np.abs(parts.sum(axis=0)), rel=1e-9)
    with pytest.raises(cf.SceneError, match="ones on its diagonal"):
        path.uncertainty(given, tip, correlation=np.eye(2))
    with pytest.raises(cf.SceneError, match="0 or more"):
        path.uncertainty({E: -1.0}, tip)


def test_refusals_in_words():
    _, scene = column()
    path = cf.solve(scene, [0.5], elements=4)
    for name, words in (
        ("rods.colum.material.E", "did you mean 'column'"),
        ("rods.column.section.diametre", "did you mean 'diameter'"),
        ("load[0].force[2]", "did you mean 'loads'"),
        ("loads[0].force", r"expected the name of a number, such as 'loads\[0\].force\[0\]'"),
        ("loads[7].force[2]", "2 items, numbered from 0"),
        ("supports[0]", "expected the name of a number"),
        (3.0, "expected a name"),
    ):
        with pytest.raises(cf.SceneError, match=words):
            path.sensitivity(tip, [name])
    with pytest.raises(cf.SceneError, match="expected a function of the path"):
        path.sensitivity("tip", [E])
    with pytest.raises(cf.SceneError, match="no converged point"):
        path.at_points([]).sensitivity(tip, [E])
    with pytest.raises(cf.SceneError, match="its value is 0"):
        cf.Parameter("none", 0.0, lambda value: scene)
    with pytest.raises(cf.SceneError, match="its neighbourhood.*is refused"):
        path.sensitivity(tip, [cf.Parameter("sign", 1.0, lambda value: column(diameter=value - 1)[1])])
    with pytest.raises(cf.SceneError, match="did you mean"):
        path.sensitivity(tip, [E])["rods.column.material.nu"]


def test_a_neutral_motion_has_no_derivative():
    """A round column that has buckled is free to turn about its axis."""
    rod, _ = column()
    P = cf.euler_load(rod)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -P))])
    path = cf.solve(scene, (0.0, 1.2), model="spatial", elements=4, branch=1)
    with pytest.raises(cf.NotConverged, match="no derivative"):
        path.sensitivity(tip, [E])


def test_materials_of_a_scene_file_have_names(tmp_path):
    """A material that two rods share changes for both, by whatever name."""
    (tmp_path / "scene.toml").write_text("""
        title = "two rods"
        [materials.steel]
        E = 210e9
        [[rods]]
        name = "column"
        curve = {type = "Line", start = [0, 0, 0], end = [0, 0, 10]}
        section = {type = "Circle", diameter = 0.2}
        material = "steel"
        [[rods]]
        name = "arm"
        curve = {type = "Line", start = [0, 0, 10], end = [5, 0, 10]}
        section = {type = "Circle", diameter = 0.1}
        material = "steel"
        [[supports]]
        type = "Clamp"
        station = "column.start"
        [[joints]]
        first = "column.end"
        second = "arm.start"
        [[loads]]
        type = "Force"
        station = "arm.end"
        force = [0, 0, -2e3]
        """)
    scene = cf.read(tmp_path / "scene.toml").scene
    path = cf.solve(scene, [1.0], elements=4)
    names = ["materials.steel.E", "materials[0].E", "rods.arm.material.E", "loads[0].force[2]"]
    found = path.sensitivity(lambda path: path.rotation("arm.end")[:, 2], names)
    by_load = found.relative(names[-1])
    assert [found.relative(name)[0] for name in names] == pytest.approx([-by_load[0]] * 3 + [by_load[0]], rel=1e-9)
    with pytest.raises(cf.SceneError, match="did you mean 'steel'"):
        path.sensitivity(tip, ["materials.stel.E"])
    with pytest.raises(cf.SceneError, match="lengths of rods over that of the longest"):
        path.sensitivity(tip, ["rods.arm.curve.end[0]"])


@pytest.mark.slow
def test_a_cable_that_is_pulled_through_a_conduit():
    """The force at its end by the friction and the stiffness of the wall, whose axis turns with the position."""
    axis = cf.well.WellPath.from_survey([0, np.pi / 2], [90, 90], [0, 90])

    def scene(stiffness=1e6, friction=0.3):
        material = cf.Material(E=2e9, nu=0.4)
        cable = cf.Rod(cf.Arc((0, 1, 0), (0, 0, 0), np.pi / 2), cf.Circle(0.012), material, name="cable")
        wall = cf.well.TubeWall(cable, axis, radius=0.016, contact_radius=0.006, stiffness=stiffness, friction=friction,
                           slip=(-1.0, 0.0), has_arm=False)  # fmt: skip
        pulled = cf.Prescribed(cable.end, displacement=(0.0, 0.03, 0.0))
        return cf.Scene([cable], [cf.Clamp(cable.start), pulled], [wall])

    def pull(path):
        return path.reaction("cable.end")[0][:, 1]

    names = {"loads[0].stiffness": ("stiffness", 1e6), "loads[0].friction": ("friction", 0.3)}
    path = cf.solve(scene(), [1.0], elements=12)
    found = path.sensitivity(pull, names)
    for name, (field, value) in names.items():
        by = differenced(lambda x: cf.solve(scene(**{field: x}), [1.0], elements=12), pull, value, step=5e-4)
        agrees(found, name, by, tol=1e-7)
