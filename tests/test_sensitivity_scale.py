"""Parameters whose value does not tell how large a change of them is large, and those that move elements."""

import math

import numpy as np
import pytest

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial


def tip(path):
    return path.displacement("mast.end")[:, 0]


def mast(x=0.0, lean=0.0, at=None, section=None):
    rod = cf.Rod(cf.Line((x, 0, 0), (x + lean, 0, 20.0)), section or cf.Circle(0.2), cf.Material(E=210e9, nu=0.3),
                 name="mast")  # fmt: skip
    return cf.Scene(
        [rod],
        [cf.Clamp(rod.start)],
        [cf.Force(rod.at(at) if at else rod.end, (20e3, 0, -60e3)), cf.Foundation(rod, 500.0)],
    )


def by_end(scene):
    found = cf.solve(scene, [1.0], elements=4).sensitivity(tip, ["rods.mast.curve.end[0]"])
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
        path.sensitivity(tip, [cf.Parameter("lean", 0.0, lambda x: mast(lean=20 * math.tanh(x)), scale=100.0)])
    found = path.sensitivity(tip, [cf.Parameter("lean", 0.0, lambda x: mast(lean=20 * math.tanh(x)), scale=1.0)])
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
        solved(0.0, None).sensitivity(tip, [name])
    found = solved(0.0).sensitivity(tip, [name])[name]
    assert found == pytest.approx((tip(solved(0.01)) - tip(solved(-0.01))) / 0.02, rel=1e-5)


def test_parameters_that_move_elements_are_refused():
    path = cf.solve(mast(at=10.0), [1.0], elements=4)
    stepped = [(8.0, cf.Circle(0.2)), (None, cf.Circle(0.1))]
    for path, name in (
        (path, "loads[0].station.s"), (path, cf.Parameter("place", 10.0, lambda s: mast(at=s))),
        (cf.solve(mast(section=stepped), [1.0], elements=4), "rods.mast.curve.end[2]"),
    ):  # fmt: skip
        with pytest.raises(cf.SceneError, match="moves a load, support, joint or end of a section"):
            path.sensitivity(tip, [name])


def test_diameters_of_a_thin_tube():
    """EI has the power four of both diameters."""
    outer, inner, names = 0.1, 0.0999, [f"rods.mast.section.{side}_diameter" for side in ("outer", "inner")]
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Tube(outer, inner), cf.Material(E=210e9, nu=0.3), name="mast")
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Moment(rod.end, (0, 1e-3, 0))]), [1.0], elements=4)
    found, power = path.sensitivity(tip, names), 4 / (outer**4 - inner**4)
    assert [found.relative(name)[0] for name in names] == pytest.approx([-power * outer**4, power * inner**4], rel=1e-6)


def test_a_number_that_two_rods_share_counts_once():
    steel = cf.Material(E=210e9, nu=0.3)
    lower = cf.Rod(cf.Line((0, 0, 0), (0, 0, 5.0)), cf.Circle(0.2), steel, name="lower")
    upper = cf.Rod(cf.Line((0, 0, 5.0), (0, 0, 8.0)), cf.Circle(0.1), steel, name="mast")
    joint = [cf.Joint(lower.end, upper.start)]
    path = cf.solve(cf.Scene([lower, upper], [cf.Clamp(lower.start)], [cf.Force(upper.end, (1e3, 0, 0))], joint), [1.0])
    names = [f"rods.{name}.material.E" for name in ("lower", "mast")]
    with pytest.raises(cf.SceneError, match="is the same number of the scene as 'rods.lower.material.E'"):
        path.uncertainty(dict.fromkeys(names, 1e9), tip)
    assert path.sensitivity(tip, names[1:]).relative(names[1]) == pytest.approx(-1.0, rel=1e-3)


@pytest.mark.parametrize(
    "rho", [[[1, 0.9, 0.9], [0.9, 1, -0.9], [0.9, -0.9, 1]], [[1, 2], [3]], np.full((3, 3), np.nan)]
)
def test_what_is_no_correlation_is_refused(rho):
    found = cf.Sensitivity(
        np.ones(1), *({name: np.ones(1) for name in "abc"} for _ in range(3)), dict.fromkeys("abc", "")
    )
    with pytest.raises(cf.SceneError, match="correlation"):
        found.uncertainty(dict.fromkeys("abc", 1.0), rho)
    assert found.uncertainty(dict.fromkeys("abc", 1.0), np.ones((3, 3))).standard_deviation == pytest.approx([3.0])
