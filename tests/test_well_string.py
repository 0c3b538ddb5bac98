"""Strings and holes: dimensions, buoyancy, standard sizes, states along the string, and input that is refused."""

import math
import warnings

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.well.components import standard_sizes

pytestmark = pytest.mark.serial
PATH = cf.well.WellPath.from_survey([0, 600, 1200, 2500], [0, 0, 50, 50], [0, 0, 120, 120])
HOLE = cf.well.Borehole(
    PATH, [cf.well.HoleSection(1500, 0.2224, 0.2, "casing"), cf.well.HoleSection(2500, 0.2159, 0.3, "open hole")]
)
PIPE = cf.well.DrillPipe(size="5 in 19.50 lb/ft")
STRING = cf.well.DrillString(
    [
        cf.well.Bit(0.2159),
        cf.well.Collar(90, "NC46-65"),
        cf.well.Stabiliser(1.5, 0.2127, 0.165, 0.07),
        cf.well.HeavyWeight(120, "5 in"),
        PIPE,
    ]
)
MUD = cf.well.Mud(1200.0)
#: A string by numbers, with the stiffness of a 5 in drill pipe.
STIFF = cf.Stiffness((1e9, 1e9), 7e8, (1228200.0, 1228200.0), 9.4e5)


def drag(operation, hole=HOLE, string=STRING, **settings):
    return cf.well.torque_and_drag(hole, string, operation, **{"mud": MUD, "model": "soft", **settings})


def vertical(length=1000.0, diameter=0.2159, friction=0.0):
    return cf.well.Borehole(
        cf.well.WellPath.from_survey([0, length], [0, 0], [0, 0]), [cf.well.HoleSection(length, diameter, friction)]
    )


def test_standard_sizes():
    assert PIPE.outer_diameter == 0.127 and pytest.approx(0.0809625) == PIPE.contact_radius
    assert pytest.approx(20.89 * cf.units.lb_per_ft) == PIPE.mass
    assert min(PIPE.stiffness.bending) == pytest.approx(1228200, rel=2e-4)
    assert cf.well.DrillPipe(size="5 19.5") == cf.well.DrillPipe(size='5" 19.50 lb/ft')
    for name, kind in ((name, kind) for kind, known in standard_sizes().items() for name in known):
        part = getattr(cf.well, kind)(100.0, name)
        plain = 7850 * math.pi / 4 * (part.outer_diameter**2 - part.inner_diameter**2)
        assert plain * (1 - 1e-12) <= part.mass < 1.35 * plain and part.inner_diameter < part.outer_diameter
        if kind == "DrillPipe":  # upsets and joints add a tenth or so
            assert part.mass < 1.23 * plain
    with pytest.raises(cf.SceneError, match="did you mean '5 in 19.50 lb/ft'"):
        cf.well.DrillPipe(size="5 in 19.60 lb/ft")
    other = cf.well.DrillPipe(size="5 in 19.50 lb/ft", outer_diameter=0.13)
    assert other.mass == pytest.approx(7850 * math.pi / 4 * (0.13**2 - other.inner_diameter**2))


def test_buoyancy():
    """Hook load of a string at rest in a vertical hole: weight in air less that of the displaced mud; the true tension
    at its open lower end is the pressure on its end."""
    hole = vertical()
    for density, inside in ((0.0, None), (1200.0, None), (1500.0, 1100.0)):
        answer = drag(cf.well.Static(), hole, cf.well.DrillString([PIPE]), mud=cf.well.Mud(density, inside))
        bore, steel = math.pi / 4 * PIPE.inner_diameter**2, PIPE.mass / 7850
        fluid = density * (steel + bore) - (density if inside is None else inside) * bore
        assert answer.hook_load == pytest.approx((PIPE.mass - fluid) * 9.80665 * 1000, rel=1e-12)
        outer = math.pi / 4 * PIPE.outer_diameter**2
        depths = 9.80665 * 1000 * (density if inside is None else inside) * bore - 9.80665 * 1000 * density * outer
        assert answer.true_tension[-1] == pytest.approx(depths, abs=1e-6)
        assert answer.true_tension[0] == answer.tension[0]  # no pressure at the surface


def test_stretch_twist_and_stress_of_a_hanging_pipe():
    tube = cf.well.DrillPipe(outer_diameter=0.127, inner_diameter=0.1)
    area, w = math.pi / 4 * (0.127**2 - 0.1**2), tube.mass * 9.80665
    answer = drag(cf.well.RotaryDrilling(-1e5, 5e3), vertical(), cf.well.DrillString([tube]), mud=cf.well.Mud(0.0))
    assert answer.stretch == pytest.approx((1e5 * 1000 + w * 1000**2 / 2) / (206.8e9 * area), rel=1e-12)
    second = math.pi / 64 * (0.127**4 - 0.1**4)
    assert answer.twist == pytest.approx(5e3 * 1000 / (206.8e9 / 2.6 * 2 * second), rel=1e-12)
    axial, shear = (1e5 + w * 1000) / area, 5e3 * 0.0635 / (2 * second)
    assert answer.von_mises[0] == pytest.approx(math.sqrt(axial**2 + 3 * shear**2), rel=1e-12)
    # a pressure that is the same inside and outside does not add to the stress of the effective tension
    wet = drag(cf.well.Static(), vertical(), cf.well.DrillString([tube]))
    assert wet.von_mises == pytest.approx(np.abs(wet.tension) / area, rel=1e-9, abs=1e-3)


def test_the_state_along_the_string():
    out, turn = drag(cf.well.TripOut()), drag(cf.well.RotateOffBottom())
    assert (np.diff(out.md) >= 0).all() and out.md[0] == 0 and out.md[-1] == 2500
    assert out.hook_load == out.tension[0] > turn.hook_load > drag(cf.well.TripIn()).hook_load
    in_build = (out.md > 700) & (out.md < 1100)
    assert np.cos(out.contact_side[in_build]) == pytest.approx(1)  # tension lifts the string to the high side
    assert np.cos(out.contact_side[out.md > 1250]) == pytest.approx(-1)
    assert [side for *_, side in out.contacts] == ["high", "low"]
    # turning clockwise, seen from above, a pipe on the low side climbs towards the right: from 180 to 180 - atan(mu)
    assert np.degrees(turn.contact_side[-1]) == pytest.approx(180 - math.degrees(math.atan(0.3)))
    EI = 206.8e9 * math.pi / 64 * (PIPE.outer_diameter**4 - PIPE.inner_diameter**4)
    assert out.bending_moment[in_build] == pytest.approx(EI * math.radians(50) / 600)
    assert (out.component[0], out.component[-1]) == (4, 0) and out.clearance[-1] == 0
    slide = drag(cf.well.Sliding(60e3))
    assert slide.tension[-1] == -60e3 and np.interp(slide.neutral_point, slide.md, slide.tension) == pytest.approx(
        0, abs=10
    )
    text = str(slide)
    assert "sliding, bit at 2500 m" in text and "heavy-weight" in text and "NOT ENOUGH" in text
    shallow = drag(cf.well.TripOut(), depth=800.0)
    assert shallow.md[-1] == 800.0 and shallow.hook_load < out.hook_load


@pytest.mark.parametrize(("weight", "where"), [(200e3, 1800.0), (100e3, 1900.0), (123.4e3, 1876.6), (450e3, 800.0)])
def test_neutral_point_on_a_joint_and_on_a_point_of_the_answer(weight, where):
    """Tension that vanishes where the string is cut, in the middle of a piece, and between."""
    collars = cf.well.Component(200.0, weight=1000.0, contact_radius=0.08)
    string = cf.well.DrillString([collars, cf.well.Component(weight=250.0, contact_radius=0.0635)])
    answer = cf.well.torque_and_drag(vertical(2000.0), string, cf.well.RotaryDrilling(weight, 0.0))
    assert answer.neutral_points == pytest.approx([where], rel=1e-12)


def test_the_soft_string_says_what_it_leaves_out():
    answer = drag(cf.well.TripOut(), tol=1e-4)
    assert not answer.enough and any("NOT ENOUGH" in line for line in answer.why)
    assert drag(cf.well.TripOut(), model="auto", tol=0.05).enough
    straight = cf.well.WellPath.from_survey([0, 1000], [30, 30], [0, 0])
    string = cf.well.DrillString([cf.well.Component(None, STIFF, 241.13, 0.0635)])
    hole = cf.well.Borehole(straight, [cf.well.HoleSection(1000, 0.2159, 0.3)])
    assert cf.well.torque_and_drag(hole, string, cf.well.TripOut()).enough  # nothing turns: the models agree


@pytest.mark.parametrize(
    ("do", "words"),
    [
        (
            lambda: cf.well.DrillPipe(size="5 in 19.50 lb/ft", length=-4),
            r"DrillPipe.length = -4: expected a positive number",
        ),
        (lambda: cf.well.Component(10.0, contact_radius=0.06), "component without weight"),
        (lambda: cf.well.DrillPipe(100.0), "outer_diameter = None: expected a diameter"),
        (lambda: cf.well.DrillPipe(outer_diameter=0.1, inner_diameter=0.12), "inner_diameter"),
        (lambda: cf.well.DrillPipe(size="5 in 19.50 lb/ft", tool_joint=0.1), "at least the body's diameter"),
        (
            lambda: cf.well.HoleSection(100, 0.2, -0.1),
            "HoleSection.friction = -0.1: expected a coefficient of friction from 0",
        ),
        (
            lambda: cf.well.Borehole(PATH, [cf.well.HoleSection(900, 0.2, 0), cf.well.HoleSection(800, 0.2, 0)]),
            "more than 900 m",
        ),
        (lambda: cf.well.Mud(-5), "Mud.density = -5"),
        (lambda: cf.well.DrillString([PIPE, cf.well.Bit(0.2159)]), "component, bit, fills up; .* order='top down'"),
        (lambda: cf.well.DrillString([PIPE], order="upwards"), "'bit up' or 'top down'"),
        (lambda: cf.well.DrillString(["pipe"]), r"components\[0\] = .*: expected Component\(...\), DrillPipe\(...\)"),
        (
            lambda: cf.well.Stabiliser(1.5, 0.2, 0.25, 0.07),
            "Stabiliser.diameter = 0.2: expected across the blades, at least",
        ),
        (lambda: cf.well.Ream(0.1, 0), "Ream.rpm = 0"),
        (lambda: cf.well.RotaryDrilling(math.nan, 0), "RotaryDrilling.weight"),
        (lambda: drag(cf.well.TripOut(), mud=None), "mud = None: expected Mud"),
        (lambda: drag(cf.well.TripOut(), depth=2500.004), "depth = 2500.004 m"),
        (lambda: drag(cf.well.TripOut(), depth=2600), "hole, which ends at 2500 m"),
        (lambda: drag(cf.well.TripOut(), depth=100), "above the surface at the depth 100 m"),
        (
            lambda: drag(cf.well.TripOut(), string=cf.well.DrillString([cf.well.Collar(90, "NC46-65")])),
            "ends 2410 m below the surface",
        ),
        (
            lambda: drag(cf.well.TripOut(), string=cf.well.DrillString([cf.well.Collar(3000, "NC46-65")])),
            "500 m above the surface",
        ),
        (
            lambda: drag(cf.well.TripOut(), hole=cf.well.Borehole(PATH, cf.well.HoleSection(2500, 0.15, 0))),
            "bit: 0.2159 m wide",
        ),
        (lambda: drag(cf.well.TripOut(), model="rod?"), "torque_and_drag.model = 'rod.'"),
        (lambda: drag(cf.well.TripOut(), torque_convention="none"), "'coulomb' or 'johancsik'"),
        (lambda: drag(cf.well.TripOut), "expected an operation, such as TripOut"),
        (lambda: drag(cf.well.TripOut(), tol=0), "tol = 0"),
        (lambda: drag(cf.well.TripOut()).critical_load("Euler"), "He-Kyllingstad or Lubinski"),
    ],
)
def test_what_is_refused(do, words):
    with pytest.raises(cf.SceneError, match=words):
        do()


def test_a_rotation_in_radians_per_second_is_doubted():
    for operation in (cf.well.Ream, cf.well.BackReam):
        words = rf"{operation.__name__}.rpm = 8.37758 .* revolutions a minute, not in rad/s.* 8.37758 rad/s are 80$"
        with pytest.warns(cf.SceneWarning, match=words):
            operation(0.15, 80 * cf.units.rpm)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cf.well.Ream(0.15, 20)


def test_a_density_in_other_units_is_doubted():
    for density in (1.2, 10.2):
        with pytest.warns(cf.SceneWarning, match="hardly that of a mud"):
            cf.well.Mud(density)


def test_dimensions_in_other_units_are_warned_of():
    with pytest.warns(cf.SceneWarning, match="wider than holes are"):
        cf.well.HoleSection(100.0, 8.5, 0.2)
    with pytest.warns(cf.SceneWarning, match="hardly that of a mud"):
        cf.well.Mud(9000.0)
    hollow = cf.well.DrillString([cf.well.Component(None, weight=-20.0, contact_radius=0.06)])
    with pytest.warns(cf.SceneWarning, match="floats: it weighs -20 N/m"):
        cf.well.torque_and_drag(HOLE, hollow, cf.well.TripIn(), model="soft")


def test_contacts_add_up_to_the_friction():
    out = drag(cf.well.TripOut(), hole=HOLE.with_friction(0.3))
    assert sum(force for _, _, force, _ in out.contacts) == pytest.approx(out.drag / 0.3, rel=1e-9)
