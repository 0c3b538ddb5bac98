"""Derivatives of queries and of critical loads by numbers of a scene: closed forms, differences, scales."""

import math
from functools import cache, partial

import numpy as np
import pytest
from conftest import column
from path_scenes import shallow_arch

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
    """A small force moves the tip of a cantilever by F L^3/(3 EI), a small moment by M L^2/(2 EI); EI of a thin tube
    has the power four of both diameters."""
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
    outer, inner, names = 0.1, 0.0999, [f"rods.column.section.{side}_diameter" for side in ("outer", "inner")]
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Tube(outer, inner), steel, name="column")
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Moment(rod.end, (0, 1e-3, 0))]), [1.0], elements=4)
    found, power = path.sensitivity(tip, names), 4 / (outer**4 - inner**4)
    assert [found.relative(name)[0] for name in names] == pytest.approx([-power * outer**4, power * inner**4], rel=1e-6)


@pytest.mark.parametrize("model", ["determinate", "planar", "spatial"])
def test_eccentric_cantilever(model):
    """Figure 3's column, 0.11 L of deflection: every query by E, diameter and load, as by differences of solutions."""
    given = {"model": model, "elements": 8}

    def scene(*, E=210e9, diameter=0.2, load=1.0):
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(diameter), cf.Material(E=E, nu=0.3), name="column")
        P = 101.7e3
        return cf.Scene([rod], [cf.Clamp(rod.start)],
                        [cf.Force(rod.end, (0, 0, -P * load)), cf.Moment(rod.end, (0, 0.2 * P, 0))])  # fmt: skip

    @cache
    def solved(field, value):
        return cf.solve(scene(**{field: value}), [0.5, 0.9], **given)

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
            by = differenced(partial(solved, field), query, value)
            agrees(found, name, by / (-101.7e3 if field == "load" else 1.0))


def solid(scene_of, value, name, query, **given):
    """Derivatives as those by differences of solutions."""
    path = cf.solve(scene_of(value), [0.5, 1.0], **given)
    agrees(path.sensitivity(query, [name]), name, differenced(
        lambda x: cf.solve(scene_of(x), [0.5, 1.0], **given), query, value))  # fmt: skip
    return path


def test_foundation_spring_wall_prescribed_motion_and_forces_across():
    """A parameter may leave the plane of the scene: the sideways tip, of a determinate and a planar path."""

    def scene(*loads, push=0.0, moved=()):
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(0.2), cf.Material(E=210e9, nu=0.3), name="column")
        forces = [] if moved else [cf.Force(rod.end, (5e4, push, -1e5)), *(load(rod) for load in loads)]
        return cf.Scene([rod], [cf.Clamp(rod.start), *(cf.Prescribed(rod.end, displacement=u) for u in moved)], forces)

    for kind, value in (
        (lambda column, k: cf.Foundation(column, k), 2e3),
        (lambda column, k: cf.Spring(column.end, k), 1e4),
        (lambda column, k: cf.Wall(column, (0, 0, 0), (0, 0, 1), clearance=0.5, stiffness=k), 1e4),
    ):
        solid(lambda k, kind=kind: scene(lambda rod: kind(rod, k)), value, "loads[1].stiffness", tip, elements=8)
    solid(lambda u: scene(moved=[(u, 0, -0.5)]), 3.0, "supports[1].displacement[0]",
          lambda path: path.reaction("column.end")[0], elements=6)  # fmt: skip

    def sideways(path):
        return path.displacement("column.end")[:, 1]

    low, high = (sideways(cf.solve(scene(push=push), [0.5, 1.0], elements=6)) for push in (-1e3, 1e3))
    for model in ("determinate", "planar"):
        path = cf.solve(scene(), [0.5, 1.0], model=model, elements=6)
        found = path.sensitivity(sideways, ["loads[0].force[1]"])
        assert found["loads[0].force[1]"] == pytest.approx((high - low) / 2e3, rel=1e-3)


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


@pytest.mark.slow
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
    for rho in ([[1, 0.9, 0.9], [0.9, 1, -0.9], [0.9, -0.9, 1]], [[1, 2], [3]], np.full((3, 3), np.nan), np.eye(2)):
        with pytest.raises(cf.SceneError, match="correlation"):
            path.uncertainty(given, tip, correlation=rho)
    with pytest.raises(cf.SceneError, match="ones on its diagonal"):
        path.uncertainty(given, tip, correlation=np.eye(2))
    with pytest.raises(cf.SceneError, match="0 or more"):
        path.uncertainty({E: -1.0}, tip)


def test_refusals_in_words():
    _, scene = column()
    path = cf.solve(scene, [0.5], elements=4)
    loaded, stepped = cf.solve(mast(at=10.0), [1.0], elements=4), [(8.0, cf.Circle(0.2)), (None, cf.Circle(0.1))]
    moves = "moves a load, support, joint or end of a section"
    for of, query, parameters, words in (
        *((path, tip, [name], words) for name, words in (
            ("rods.colum.material.E", "did you mean 'column'"),
            ("rods.column.section.diametre", "did you mean 'diameter'"),
            ("load[0].force[2]", "did you mean 'loads'"),
            ("loads[0].force", r"expected the name of a number, such as 'loads\[0\].force\[0\]'"),
            ("loads[7].force[2]", "2 items, numbered from 0"),
            ("supports[0]", "expected the name of a number"),
            (3.0, "expected a name"),
            (cf.Parameter("sign", 1.0, lambda value: column(diameter=value - 1)[1]), "its neighbourhood.*is refused"))),
        (path, "tip", [E], "expected a function of the path"),
        (path.at_points([]), tip, [E], "no converged point"),
        (loaded, tip_of, ["loads[0].station.s"], moves),
        (loaded, tip_of, [cf.Parameter("place", 10.0, lambda s: mast(at=s))], moves),
        (cf.solve(mast(section=stepped), [1.0], elements=4), tip_of, ["rods.mast.curve.end[2]"], moves),
    ):  # fmt: skip
        with pytest.raises(cf.SceneError, match=words):
            of.sensitivity(query, parameters)
    with pytest.raises(cf.SceneError, match="its value is 0"):
        cf.Parameter("none", 0.0, lambda value: scene)
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


def tip_of(path):
    return path.displacement("mast.end")[:, 0]


def mast(x=0.0, lean=0.0, at=None, section=None):
    curve, steel = cf.Line((x, 0, 0), (x + lean, 0, 20.0)), cf.Material(E=210e9, nu=0.3)
    rod = cf.Rod(curve, section or cf.Circle(0.2), steel, name="mast")
    force = cf.Force(rod.at(at) if at else rod.end, (20e3, 0, -60e3))
    return cf.Scene([rod], [cf.Clamp(rod.start)], [force, cf.Foundation(rod, 500.0)])


def by_end(scene):
    found = cf.solve(scene, [1.0], elements=4).sensitivity(tip_of, ["rods.mast.curve.end[0]"])
    return found["rods.mast.curve.end[0]"]


def test_derivatives_by_places_do_not_depend_on_the_origin():
    """Far from it, and where a coordinate is 0 but for rounding (the derivative is rounded by 1e-9 to 3e-9)."""
    here = by_end(mast())
    assert abs(here[0]) > 0.4
    assert by_end(mast(5e5)) == pytest.approx(here, rel=1e-7)
    assert by_end(mast(lean=20 * math.cos(math.pi / 2))) == pytest.approx(here, rel=1e-8)


def test_a_scene_that_changes_abruptly_is_refused():
    path = cf.solve(mast(), [1.0], elements=4)
    with pytest.raises(cf.SceneError, match="does not change smoothly up to 1.6 from it.*scale"):
        path.sensitivity(tip_of, [cf.Parameter("lean", 0.0, lambda x: mast(lean=20 * math.tanh(x)), scale=100.0)])
    found = path.sensitivity(tip_of, [cf.Parameter("lean", 0.0, lambda x: mast(lean=20 * math.tanh(x)), scale=1.0)])
    assert found["lean"] == pytest.approx(20 * by_end(mast()), rel=1e-9)


def test_a_line_that_becomes_vertical_needs_its_d1():
    """Without one its directors jump there by a right angle."""

    def tilted(lean, d1=(1, 0, 0)):
        rod = cf.Rod(cf.Line((0, 0, 0), (lean, 0, 20.0), d1), cf.Rectangle(0.2, 0.1), cf.Material(E=210e9, nu=0.3),
                     name="mast")  # fmt: skip
        return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (5e3, 5e3, -6e3))])

    def solved(lean, *d1):
        return cf.solve(tilted(lean, *d1), [1.0], elements=4, model="spatial")

    name = "rods.mast.curve.end[0]"
    with pytest.raises(cf.SceneError, match="and d1 for a Line that becomes vertical"):
        solved(0.0, None).sensitivity(tip_of, [name])
    found = solved(0.0).sensitivity(tip_of, [name])[name]
    assert found == pytest.approx((tip_of(solved(0.01)) - tip_of(solved(-0.01))) / 0.02, rel=1e-5)


def test_a_number_that_two_rods_share_counts_once():
    steel = cf.Material(E=210e9, nu=0.3)
    lower = cf.Rod(cf.Line((0, 0, 0), (0, 0, 5.0)), cf.Circle(0.2), steel, name="lower")
    upper = cf.Rod(cf.Line((0, 0, 5.0), (0, 0, 8.0)), cf.Circle(0.1), steel, name="mast")
    joint = [cf.Joint(lower.end, upper.start)]
    path = cf.solve(cf.Scene([lower, upper], [cf.Clamp(lower.start)], [cf.Force(upper.end, (1e3, 0, 0))], joint), [1.0])
    names = [f"rods.{name}.material.E" for name in ("lower", "mast")]
    with pytest.raises(cf.SceneError, match="is the same number of the scene as 'rods.lower.material.E'"):
        path.uncertainty(dict.fromkeys(names, 1e9), tip_of)
    assert path.sensitivity(tip_of, names[1:]).relative(names[1]) == pytest.approx(-1.0, rel=1e-3)


def euler(*, E=210e9, diameter=0.2, length=20.0, loads=lambda rod: ()):
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, length)), cf.Circle(diameter), cf.Material(E=E, nu=0.3), name="column")
    return rod, cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -1e5)), *loads(rod)])


def test_buckling_loads_of_a_column():
    """P (1 + P/GA) = P_Euler: P is in proportion to E, nearly to d^4 and L^-2."""
    rod, scene = euler()
    found = cf.buckling(scene, 2).sensitivity([E, DIAMETER, LOAD, "rods.column.curve.end[2]"])
    P, GA = found.value[0] * 1e5, rod.stiffness.shear[0]
    x = P / GA / (1 + P / GA)
    exact = 1.0, (4 + 2 * x) / (1 + x), -1.0, -2 / (1 + x)
    for name, power in zip(found, exact, strict=True):
        assert found.relative(name) == pytest.approx([power] * 2, rel=1e-8)
        assert found.error[name] == pytest.approx(0, abs=1e-8 * abs(found[name]).max())
    spread = cf.buckling(scene).uncertainty({E: 0.02 * 210e9, DIAMETER: 0.01 * 0.2})
    assert spread.standard_deviation[0] / P * 1e5 == pytest.approx(np.hypot(0.02, 0.01 * exact[1]), rel=1e-6)


def test_a_foundation_carries_a_part_of_the_buckling_load():
    """Of a pinned column, P_cr = P_Euler + k (L/pi)^2 in its first mode without shear."""

    def scene(k):
        stiff = cf.Stiffness(shear=(np.inf,) * 2, axial=np.inf, bending=(1e6, 1e6), torsion=1e6)
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 10.0)), stiff, name="column")
        held = [cf.Hinge(rod.start, (0, 1, 0)), cf.Roller(rod.end, (1, 0, 0)), cf.Roller(rod.end, (0, 1, 0))]
        return cf.Scene([rod], held, [cf.Force(rod.end, (0, 0, -1e4)), cf.Foundation(rod, k, direction=(1, 0, 0)),
                                      cf.Foundation(rod, 10 * k, direction=(0, 1, 0))])  # fmt: skip

    found = cf.buckling(scene(1e3), elements=8).sensitivity(["loads[1].stiffness", "loads[2].stiffness"])
    assert found["loads[1].stiffness"][0] * 1e4 == pytest.approx((10 / np.pi) ** 2, rel=1e-5)
    assert abs(found["loads[2].stiffness"][0]) * 1e4 < 1e-5


def test_equal_buckling_loads_that_part_are_refused():
    stiff = cf.Stiffness(shear=(1e9, 1e9), axial=1e9, bending=(1e6, 1e6), torsion=1e6)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), stiff, name="column")
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -1e5))])
    with pytest.raises(cf.SceneError, match="it separates the critical load factors 0 and 1"):
        cf.buckling(scene, 2).sensitivity(["rods.column.section.bending[0]"])
    path = cf.solve(scene, (0.0, 1.0), model="spatial", elements=4)
    with pytest.raises(cf.SceneError, match="it separates the two bifurcations"):
        path.sensitivity(path.events[0], ["rods.column.section.bending[0]"])
    follower = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.FollowerForce(rod.end, (0, 0, -1e5))])
    with pytest.raises(cf.SceneError, match="have a potential"):
        cf.buckling(follower).sensitivity([LOAD])


def test_bifurcation_of_a_column():
    """P (1 + P/GA - P/EA) = P_Euler of the column that shortens and shears before it buckles."""
    rod, scene = euler()
    path = cf.solve(scene, (0.0, 5.0), model="spatial", elements=8)
    found = path.sensitivity(path.events[0], [E, DIAMETER, LOAD, "rods.column.curve.end[2]"])
    P = path.events[0].load_factor * 1e5
    y = P * (1 / rod.stiffness.shear[0] - 1 / rod.stiffness.axial)
    y /= 1 + y
    for name, power in zip(found, (1.0, (4 + 2 * y) / (1 + y), -1.0, -2 / (1 + y)), strict=True):
        assert found.relative(name) == pytest.approx(power, rel=1e-8)
    with pytest.raises(
        cf.SceneError, match="'loads.0..force.0.': it is an imperfection, with which the bifurcation disappears"
    ):
        path.sensitivity(path.events[0], ["loads[0].force[0]"])
    again = cf.solve(scene, (0.0, 5.0), model="spatial", elements=8)
    with pytest.raises(cf.SceneError, match="the event does not belong to this path"):
        path.sensitivity(again.events[0], [E])
    spread = path.uncertainty({E: 0.02 * 210e9}, path.events[0])
    assert spread.standard_deviation == pytest.approx(0.02 * path.events[0].load_factor, rel=1e-8)


def arch(stiffness=1.0, radius=133.114):
    """`path_scenes.shallow_arch` with other stiffnesses, or another radius of the same span."""
    given = shallow_arch()[0].section
    scaled = {x: getattr(given, x) for x in ("shear", "axial", "bending", "torsion")}
    section = cf.Stiffness(**{x: tuple(stiffness * np.array(v)) if np.ndim(v) else stiffness * v
                              for x, v in scaled.items()})  # fmt: skip
    half = np.arcsin(17.0 / radius)
    curve = cf.Arc((17.0, -radius * np.cos(half), 0), (0, 0, 0), -2 * half, axis=(0, 0, 1), d1=(0, 0, 1))
    rod = cf.Rod(curve, section, name="arch")
    loads = [cf.Force(rod.at(rod.length / 2), (0, -1.0, 0))]
    return cf.Scene([rod], [cf.Clamp(rod.start), cf.Clamp(rod.end)], loads)


@pytest.mark.slow
def test_limit_points_and_bifurcations_of_an_arch():
    """All are in proportion to the stiffness; by the radius, as by differences of the first limit load."""
    given = {"elements": 8, "model": "spatial", "control": "arc"}
    path = cf.solve(arch(), (0.0, 40.0), **given)
    parameters = [cf.Parameter("stiffness", 1.0, arch), cf.Parameter("radius", 133.114, lambda r: arch(radius=r), "m")]
    assert [event.kind for event in path.events] == ["limit", "bifurcation", "bifurcation", "limit"]
    for event, tol in zip(path.events, (1e-7, 1e-5, 1e-6, 1e-7), strict=True):
        found = path.sensitivity(event, parameters)
        assert found["stiffness"] == pytest.approx(event.load_factor, rel=tol)
    step = 2e-3 * 133.114
    near = [cf.solve(arch(radius=133.114 + k * step), (0.0, 40.0), **given).events[0].load_factor for k in PLACES]
    by, _ = derivative(near, step)
    assert path.sensitivity(path.events[0], parameters)["radius"] == pytest.approx(by, rel=1e-6)
