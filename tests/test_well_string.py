"""Strings and holes: dimensions, standard sizes, scene files, resultants of the wall's forces, refusals."""

import inspect
import json
import math
import pickle
import re
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from assembly import assembly
from reference_wells import in_build_section

import cosserat_fenicsx as cf
from cosserat_fenicsx.cli.main import main
from cosserat_fenicsx.quantities import DIMENSIONS, in_si
from cosserat_fenicsx.numerics import lobatto_weights
from cosserat_fenicsx.parts import arguments_of, members
from cosserat_fenicsx.well.components import StringPart, standard_sizes
from cosserat_fenicsx.well.operations import Operation
from cosserat_fenicsx.well.rod.resultants import contacts_along
from cosserat_fenicsx.well.rod.rod_in_hole import solve_in_hole
from cosserat_fenicsx.well.scenefile import DepthSweepSettings, StrengthSettings, TorqueAndDragSettings, WellScene

pytestmark = pytest.mark.serial
PATH = cf.well.WellPath.from_survey([0, 600, 1200, 2500], [0, 0, 50, 50], [0, 0, 120, 120])
HOLE = cf.well.Borehole(
    PATH, [cf.well.HoleSection(1500, 0.2224, 0.2, "casing"), cf.well.HoleSection(2500, 0.2159, 0.3, "open hole")]
)
PIPE = cf.well.DrillPipe(size="5 in 19.50 lb/ft")
ASSEMBLY = [
    cf.well.Collar(90, "NC46-65"),
    cf.well.Stabiliser(1.5, 0.2127, 0.165, 0.07),
    cf.well.HeavyWeight(120, "5 in"),
]
STRING = cf.well.DrillString([cf.well.Bit(0.2159), *ASSEMBLY, PIPE])
MUD = cf.well.Mud(1200.0)
#: A string by numbers, with the stiffness of a 5 in drill pipe.
STIFF = cf.Stiffness((1e9, 1e9), 7e8, (1228200.0, 1228200.0), 9.4e5)


def drag(operation, hole=HOLE, string=STRING, **settings):
    return cf.well.torque_and_drag(hole, string, operation, **{"mud": MUD, "model": "soft", **settings})


def vertical(length=1000.0, diameter=0.2159, friction=0.0):
    return cf.well.Borehole(
        cf.well.WellPath.from_survey([0, length], [0, 0], [0, 0]), [cf.well.HoleSection(length, diameter, friction)]
    )


@pytest.mark.once
def test_standard_sizes():
    assert PIPE.outer_diameter == 0.127 and pytest.approx(0.0809625) == PIPE.contact_radius
    assert pytest.approx(20.89 * cf.units.lb_per_ft) == PIPE.mass
    assert min(PIPE.stiffness.bending) == pytest.approx(1228200, rel=2e-4)
    assert cf.well.DrillPipe(size="5 19.5") == cf.well.DrillPipe(size='5" 19.50 lb/ft')
    for name, kind in ((name, kind) for kind, known in standard_sizes().items() if kind != "Casing" for name in known):
        part = getattr(cf.well, kind)(100.0, name)
        plain = 7850 * math.pi / 4 * (part.outer_diameter**2 - part.inner_diameter**2)
        assert plain * (1 - 1e-12) <= part.mass < 1.35 * plain and part.inner_diameter < part.outer_diameter
        if kind == "DrillPipe":  # upsets and joints add a tenth or so
            assert part.mass < 1.23 * plain
    with pytest.raises(cf.SceneError, match="known of this diameter: 5 in 19.50 lb/ft, 5 in 25.60 lb/ft"):
        cf.well.DrillPipe(size="5 in 19.60 lb/ft")
    other = cf.well.DrillPipe(size="5 in 19.50 lb/ft", outer_diameter=0.13)
    assert other.mass == pytest.approx(7850 * math.pi / 4 * (0.13**2 - other.inner_diameter**2))


@pytest.mark.once
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


@pytest.mark.once
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


@pytest.mark.once
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
    alike = drag(cf.well.TripOut(), hole=HOLE.with_friction(0.3))  # contacts add up to the friction
    assert sum(force for _, _, force, _ in alike.contacts) == pytest.approx(alike.drag / 0.3, rel=1e-9)
    slide = drag(cf.well.Sliding(60e3))
    assert slide.tension[-1] == -60e3
    assert np.interp(slide.neutral_point, slide.md, slide.tension) == pytest.approx(0, abs=10)
    text = str(slide)
    assert "sliding, bit at 2500 m" in text and "heavy-weight" in text and "NOT ENOUGH" in text
    shallow = drag(cf.well.TripOut(), depth=800.0)
    assert shallow.md[-1] == 800.0 and shallow.hook_load < out.hook_load


@pytest.mark.once
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


@pytest.mark.once
@pytest.mark.parametrize(("do", "words"), [
    (lambda: cf.well.DrillPipe(size="5 in 19.50 lb/ft", length=-4),
     r"DrillPipe.length = -4: expected a positive number"),
    (lambda: cf.well.Component(10.0, contact_radius=0.06), "component without weight"),
    (lambda: cf.well.DrillPipe(100.0), "outer_diameter = None: expected a diameter"),
    (lambda: cf.well.DrillPipe(outer_diameter=0.1, inner_diameter=0.12), "inner_diameter"),
    (lambda: cf.well.DrillPipe(size="5 in 19.50 lb/ft", tool_joint=0.1), "at least the body's diameter"),
    (lambda: cf.well.HoleSection(100, 0.2, -0.1),
     "HoleSection.friction = -0.1: expected a coefficient of friction from 0"),
    (lambda: cf.well.Borehole(PATH, [cf.well.HoleSection(900, 0.2, 0), cf.well.HoleSection(800, 0.2, 0)]),
     "more than 900 m"),
    (lambda: cf.well.Mud(-5), "Mud.density = -5"),
    (lambda: cf.well.DrillString([PIPE, cf.well.Bit(0.2159)]), "component, bit, fills up; .* order='top down'"),
    (lambda: cf.well.DrillString([PIPE], order="upwards"), "'bit up' or 'top down'"),
    (lambda: cf.well.DrillString(["pipe"]), r"components\[0\] = .*: expected Component\(...\), DrillPipe\(...\)"),
    (lambda: cf.well.Stabiliser(1.5, 0.2, 0.25, 0.07),
     "Stabiliser.diameter = 0.2: expected across the blades, at least"),
    (lambda: cf.well.DrillPipe("5 in 19.50 lb/ft"),
     r"length, then the name of a size, as in DrillPipe\('300 ft', '5 in 19.50 lb/ft'\), or up to the surface"),
    (lambda: cf.well.Collar("NC46-65", "300 ft"), r"as in Collar\('300 ft', 'NC46-65'\)$"),
    (lambda: cf.well.DrillPipe('5" 20'), r"known of this diameter: 5 in 19.50 lb/ft, 5 in 25.60 lb/ft$"),
    (lambda: cf.well.DrillPipe(size='5-1/2" 24#'), "known of this diameter: 5 1/2 in 24.70 lb/ft, 5 1/2 in 21.90"),
    (lambda: cf.well.HeavyWeight("5 in", "600 ft"), r"as in HeavyWeight\('600 ft', '5 in'\)$"),
    (lambda: cf.well.Collar("-300 ft", "NC46-65"), r"length = '-300 ft' \(-91.44 m\): expected a positive number"),
    (lambda: cf.well.Mud("-10 ppg"), r"Mud.density = '-10 ppg' \(-1198.264\d* kg/m\^3\): expected"),
    (lambda: drag(cf.well.TripOut(), depth="9000 psi"), "psi is a unit of pressure"),
    (lambda: drag(cf.well.TripOut(), depth="-9000 ft"), r"depth = '-9000 ft' \(-2743.2 m\): expected"),
    (lambda: HOLE.with_friction([0.2] * (len(HOLE.sections) - 1) + [7]),
     "friction from 0 to 5, in the section that ends at 2500 m"),
    (lambda: cf.well.Ream(0.1, 0), "Ream.rpm = 0"),
    (lambda: cf.well.RotaryDrilling(math.nan, 0), "RotaryDrilling.weight"),
    (lambda: drag(cf.well.TripOut(), mud=None), "mud = None: expected Mud"),
    (lambda: drag(cf.well.TripOut(), depth=2500.004), "depth = 2500.004 m"),
    (lambda: drag(cf.well.TripOut(), depth=2600), "hole, which ends at 2500 m"),
    (lambda: drag(cf.well.TripOut(), depth=100), "above the surface at the depth 100 m"),
    (lambda: drag(cf.well.TripOut(), string=cf.well.DrillString([cf.well.Collar(90, "NC46-65")])),
     "ends 2410 m below the surface"),
    (lambda: drag(cf.well.TripOut(), string=cf.well.DrillString([cf.well.Collar(3000, "NC46-65")])),
     "500 m above the surface"),
    (lambda: drag(cf.well.TripOut(), hole=cf.well.Borehole(PATH, cf.well.HoleSection(2500, 0.15, 0))),
     r"bit: 0.2159 m \(8.5 in\) wide at md = .* the hole there, 0.15 m \(5.9055 in\)"),
    (lambda: drag(cf.well.TripOut(), model="rod?"), "torque_and_drag.model = 'rod.'"),
    (lambda: drag(cf.well.TripOut(), torque_convention="none"), "'coulomb' or 'johancsik'"),
    (lambda: drag(cf.well.TripOut), "expected an operation, such as TripOut"),
    (lambda: drag(cf.well.TripOut(), tol=0), "tol = 0"),
    (lambda: drag(cf.well.TripOut()).critical_load("Euler"), "He-Kyllingstad or Lubinski"),
    (lambda: in_si("x", "-12 KN/m", "force per length"), "did you mean 'kN/m'"),
    (lambda: in_si("x", "1 minute", "time"), "did you mean 'min'"),
    (lambda: in_si("x", "5 Nmm", "moment"), "expected a known unit"),  # 'Nm' is a thousand times as large
    (lambda: in_si("x", "2 mile", "length"), "expected a known unit"),
])  # fmt: skip
def test_what_is_refused(do, words):
    with pytest.raises(cf.SceneError, match=words):
        do()


@pytest.mark.once
def test_a_rotation_in_radians_per_second_and_a_friction_above_1_are_doubted():
    for operation in (cf.well.Ream, cf.well.BackReam):
        words = rf"{operation.__name__}.rpm = 8.37758 .* revolutions a minute, not in rad/s.* 8.37758 rad/s are 80$"
        with pytest.warns(cf.SceneWarning, match=words):
            operation(0.15, 80 * cf.units.rpm)
    with pytest.warns(cf.SceneWarning, match=r"HoleSection.friction = 3 is more than the wall of a well has"):
        cf.well.HoleSection(1000.0, 0.2159, 3.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cf.well.Ream(0.15, 20)
        cf.well.HoleSection(1000.0, 0.2159, 0.6)


@pytest.mark.once
def test_weight_on_bit_without_torque_or_bit_is_told():
    without = cf.well.DrillString([cf.well.Collar(90, "NC46-65"), cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
    for string, torque, told in (
        (STRING, 4e3, (False, False)),
        (STRING, 0.0, (True, False)),
        (without, 0.0, (True, True)),
    ):
        words = str(drag(cf.well.RotaryDrilling(8e4, torque), string=string, model="soft"))
        assert ("No bit torque given" in words, "No Bit in the string" in words) == told
    assert "bit torque" not in str(drag(cf.well.TripOut(), model="soft"))


@pytest.mark.once
def test_dimensions_in_other_units_are_warned_of():
    for field, make in {
        "HoleSection.diameter": lambda: cf.well.HoleSection(100.0, 8.5, 0.2),
        "Bit.diameter": lambda: cf.well.Bit(8.5),
        "Collar.outer_diameter": lambda: cf.well.Collar(90.0, outer_diameter=6.5, inner_diameter=0.07),
        "DrillPipe.tool_joint": lambda: cf.well.DrillPipe(size="5 in 19.50 lb/ft", tool_joint=6.5),
    }.items():
        with pytest.warns(cf.SceneWarning, match=rf"{field} = [68].5 m is wider than holes are: is it in inches"):
            make()
    for density in (1.2, 10.2, 9000.0):
        with pytest.warns(cf.SceneWarning, match="hardly that of a mud"):
            cf.well.Mud(density)
    hollow = cf.well.DrillString([cf.well.Component(None, weight=-20.0, contact_radius=0.06)])
    with pytest.warns(cf.SceneWarning, match="floats: it weighs -20 N/m"):
        cf.well.torque_and_drag(HOLE, hollow, cf.well.TripIn(), model="soft")


DEMOS = Path(__file__).parent.parent / "demos"
VOLVE = DEMOS / "wells" / "volve_f12.toml"
RODS = DEMOS / "eccentric_cantilever.toml"


@pytest.mark.slow
def test_the_demos_give_their_numbers(capsys):
    import wells
    from known_numbers import deviation

    assert {demo.__name__ for demo in wells.WELLS} == {file.stem for file in (DEMOS / "wells").glob("*.toml")}
    for check in wells.main(out=None):
        assert deviation(check) <= check.allowed, check
    assert "Strings in wells" in capsys.readouterr().out


def test_the_assembly_by_its_strong_form():
    """Collocation gives the numbers that the demo expects."""
    import wells

    scene = cf.read(DEMOS / "wells" / "assembly.toml")
    forces, tilt, lying = assembly(scene)
    held, bit, collars = wells.assembly(scene, scene.run(), None, None)
    assert forces[:3] == pytest.approx(held.expected, abs=1e-3) and math.degrees(tilt) == pytest.approx(bit.expected)
    assert lying == pytest.approx(collars.expected, abs=1e-4)


def test_what_a_file_says():
    scene = cf.read(VOLVE)
    assert scene.hole.path.length == 3438 and len(scene.hole.path.md) == 74
    assert scene.hole.sections[1] == cf.well.HoleSection(3438.0, 8.5 * cf.units.inch, 0.30, "open hole")
    assert scene.mud == cf.well.Mud(10.2 * cf.units.ppg)
    assert scene.string.components[1] == cf.well.Collar(90.0, "NC46-65") and len(scene.sweep["depths"]) == 20
    assert scene.operations[2].torque == pytest.approx(3500 * cf.units.ft_lbf) and scene.operations[2].weight == 80e3
    by_hand = cf.well.torque_and_drag(scene.hole, scene.string, cf.well.TripOut(), mud=scene.mud, **scene.settings)
    assert scene.run()[0].hook_load == by_hand.hook_load


@pytest.mark.once
@pytest.mark.parametrize(("text", "dimension", "value"), [
    ("5 in", "length", 0.127),
    ('9.625"', "length", 0.244475),
    ("10000 ft", "length", 3048.0),
    ("10 ppg", "density", 1198.264273),
    ("1.2 sg", "density", 1200.0),
    ("-20klbf", "force", -88964.43230521),
    ("12 kft-lbf", "moment", 16269.815397),
    ("19.5 lb/ft", "mass per length", 29.0191969),
    ("60 ft/min", "speed", 0.3048),
    ("120 rpm", "rotation", 120.0),
    ("3 deg/100ft", "angle per length", 0.001717843752),
    ("8 1/2 in", "length", 0.2159),
    ("9-5/8 in", "length", 0.244475),
    ('3/4"', "length", 0.01905),
    ("10 lb/gal", "density", 1198.264273),
    ("12 klb-ft", "moment", 16269.815397),
    ("20 klbs", "force", 88964.43230521),
    ("12 lb/ft", "force per length", 175.1268324),
    ("12 lb/ft", "mass per length", 17.8579673),
    ("800 N/mm", "stiffness", 8e5),
    ("1800 lpm", "flow", 0.03),
])  # fmt: skip
def test_field_units(text, dimension, value):
    assert in_si("x", text, dimension) == pytest.approx(value, rel=1e-7)


@pytest.mark.once
@pytest.mark.parametrize(("old", "new", "words"), [
    ('"Bit", diameter = "8.5 in"', '"Bit", diameter = "8.5 yards"', "yards"),
    ("weight = 80e3", 'weight = "8 tons"', "expected tf, 1000 kgf, or kN or klbf: there are several tons"),
    ('survey = "volve_f12.csv"', "survey = volve", "a number with its unit, stand in quotes"),
    ('survey = "volve_f12.csv"', 'survey = "volve_f12.csv"\nlength_unit = "yd"', "length_unit = 'yd': known: cm, f"),
    ('"Bit", diameter = "8.5 in"', '"Bit", diameter = "8.5 ppg"', "ppg is a unit of density, expected one of length"),
    ('"Bit", diameter = "8.5 in"', '"Bit", diameter = "8.5"',
     "expected a unit after the number, or the number without quotes"),
    ('density = "10.2 ppg"', "density = -3", "mud: Mud.density = -3"),
    ('[mud]\ndensity = "10.2 ppg"', "", "mud = None: expected Mud"),
    ('type = "TripIn"', 'type = "TripDown"', "operations.1..type = 'TripDown': did you mean 'TripIn'"),
    ("weight = 80e3\n", "", "operations.2. .RotaryDrilling.: 'weight' is missing"),
    ("friction = 0.20", "friction = 0.20, mu = 1", "unknown key 'mu'"),
    ("[string]", "[strings]", "unknown key 'strings', did you mean 'string'"),
    ('survey = "volve_f12.csv"', 'survey = "none.csv"', "cannot be read"),
    (", count = 20", "", "'count' is missing"),
    ("{ from = 300.0, to = 3438.0, count = 20 }", "3000", r"depth_sweep.depths = 3000: expected a list, each"),
    ("to = 3438.0, count", 'to = "11400 ft", count', "depths.19. = 3474.72 m: expected a measured depth in the hole"),
    ("tol = 2e-2", 'tol = "1 %"', "torque_and_drag.tol = '1 %': expected a finite number"),
    ("tol = 2e-2", 'model = "stiff"', "torque_and_drag.model = 'stiff': expected 'auto'"),
    ("tol = 2e-2", 'model = "rod"\ntorque_convention = "johancsik"', "the law that the rod in contact follows"),
    ("tol = 2e-2", 'torque_convention = "api"', "expected 'coulomb' or 'johancsik'"),
    ("friction = [0.1, 0.2, 0.3]", "friction = [[0.1, 0.2, 0.3]]", "a number, or 2, one for each section"),
    ('"Bit", diameter = "8.5 in"', '"Bit", diameter = "8.75 in"', "bit: 0.22225 m .8.75 in. wide"),
    ("[string]", '[string]\norder = "top down"', "bit, fills up; where the list .* order='bit up'"),
    ("tol = 2e-2", "tol = 2e-2\nelements = 4", "unknown key 'elements'"),
])  # fmt: skip
def test_files_that_are_refused(old, new, words, tmp_path):
    text = VOLVE.read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "well.toml").write_text(text.replace(old, new), encoding="utf-8")
    (tmp_path / "volve_f12.csv").write_text(VOLVE.with_suffix(".csv").read_text(encoding="utf-8"), encoding="utf-8")
    with pytest.raises(cf.SceneError, match=words):
        cf.read(tmp_path / "well.toml")


@pytest.mark.once
def test_the_command_line(tmp_path, capsys):
    assert main(["explain", str(VOLVE)]) == 0
    told = capsys.readouterr().out
    assert "largest inclination 53.43 degrees" in told and "String, drill pipe: md 0 to 3227.7 m" in told
    assert main(["run", str(VOLVE), "-o", str(tmp_path), "--no-picture", "--tol", "1e-3", "--model", "soft"]) == 0
    told = capsys.readouterr().out
    together = told.partition("surface loads of all operations")[2]
    assert [name in together for name in ("trip out", "trip in", "rotary drilling", "utilisation")] == [True] * 3 + [
        False
    ]
    assert "NOT ENOUGH for tol = 0.001: " in told and "rotary drilling, friction" not in told.splitlines()[0]
    names = {"depth_sweep.csv", *(f"{name}{end}.csv" for name in ("trip_out", "trip_in", "rotary_drilling")
                                  for end in ("", "_contacts"))}  # fmt: skip
    assert {file.name for file in tmp_path.iterdir()} == names == set(re.findall(r"\w+\.csv", told))
    rows = (tmp_path / "trip_out.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0].startswith("measured depth (m),north (m)") and rows[-1].startswith("3438.0,-346.4")
    for option, value in (("--elements", "4"), ("--color", "tension")):
        assert main(["run", str(VOLVE), option, value]) == 2
        assert f"{option} is for rods" in capsys.readouterr().err
    assert main(["explain", str(VOLVE), "--model", "stiff"]) == 2
    text = VOLVE.read_text(encoding="utf-8")
    (tmp_path / "no_well.toml").write_text(text[text.index("[string]") :], encoding="utf-8")
    assert main(["run", str(tmp_path / "no_well.toml")]) == 2 and "[well] is missing" in capsys.readouterr().err


@pytest.mark.once
def test_the_command_line_in_field_units(tmp_path, capsys):
    assert main(["explain", str(VOLVE), "--units", "field"]) == 0
    told = capsys.readouterr().out
    assert "Hole, open hole: to 11279.5 ft, 8.5 in wide, friction 0.3." in told
    assert "String, bit: md 11278.5 to 11279.5 ft, 79.89 lbf/ft in mud, 8.5 in wide where it touches the wall" in told
    assert "rotary drilling, on bit 17.9847 klbf and 3500 ft-lbf." in told
    soft = ["run", str(VOLVE), "-o", str(tmp_path), "--no-picture", "--model", "soft"]
    assert main([*soft, "--units", "field"]) == 0
    told, found = capsys.readouterr().out, cf.read(VOLVE)
    hook = found.answer(found.operations[0]).hook_load / cf.units.kip
    assert f"hook load {hook:.6g} klbf" in told and "trip out, bit at 11279.5 ft" in told and "kN" not in told
    rows = (tmp_path / "trip_out.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0].startswith("measured depth (ft),north (ft)")
    assert float(rows[-1].split(",")[0]) == pytest.approx(3438 / 0.3048)
    assert "hook load (klbf)" in (tmp_path / "depth_sweep.csv").read_text(encoding="utf-8").splitlines()[0]
    refused = (VOLVE, "run", "ft,ell", "'ell' is none"), (RODS, "run", "ell", "'ell'"), (RODS, "explain", "kN", "in SI")
    for file, command, word, words in refused:
        assert main([command, str(file), "--units", word]) == 2 and words in capsys.readouterr().err


@pytest.mark.once
def test_holes_and_strings_are_printed_with_units():
    """By the sentences of `cosserat explain`, in the units asked for, on a screen of 100 columns and 30 rows."""
    found = cf.read(VOLVE)
    hole, string = found.hole.details().splitlines(), found.string.details().splitlines()
    assert hole[0].startswith("Well: 74 stations to md = 3438 m, which is north -346.44 m") and len(hole) == 3
    assert hole[2] == "Hole, open hole: to 3438 m, 0.2159 m wide, friction 0.3."
    assert string[1].startswith("String, collar: length 90 m, 136.59 kg/m in air, 0.1651 m wide where it touches")
    given = cf.well.DrillString([cf.well.Component(None, None, 241.13, 0.0635, name="pipe")])
    assert given.details() == ("String, pipe: up to the surface, 241.13 N/m in mud, 0.127 m wide where it touches the "
                               "wall, stiffness not known.")  # fmt: skip
    drilling = cf.read(DEMOS / "strings" / "tuned_drive.toml")
    for part in (found, found.hole, found.string, drilling, drilling.scene):
        field = part.summary(units="field")
        assert not re.search(r"\d (k?N|m|N/m|k?N m|MN m\^2|rad/s)\b", field) and str(part) == part.summary()
        assert all(len(text.splitlines()) <= 30 and max(map(len, text.splitlines())) <= 100
                   for text in (field, part.summary()))  # fmt: skip
    assert "Ki 3115.71 ft-lbf/rad" in drilling.summary("field") and "EI = 4.28e+08 lbf in^2" in found.summary("field")
    many = cf.well.DrillString([cf.well.DrillPipe(10.0, "5 19.5")] * 40)
    assert str(many).endswith("... more by `details()`") and len(many.details().splitlines()) == 40
    with pytest.raises(cf.SceneError, match="expected 'SI', 'field' or a dict"):
        found.summary("metric")


@pytest.mark.once
def test_doubts_are_said_once_and_without_code(tmp_path):
    """In a process that imports dolfinx, whose FFCx would send them to a log, while they are said."""
    stations = (
        "[well]\nstations = [[0, 0, 0], ['1 km', 0, 0], [3281, 30, 0]]\nsections = [{ to = 1000, diameter = 0.2159, "
    )
    rest = "friction = 0.2 }]\n[string]\ncomponents = [{ type = 'DrillPipe', size = '5 19.5' }]\n[mud]\ndensity = 10\n"
    operation = "[[operations]]\ntype = 'RotaryDrilling'\nweight = 60\ntorque = 5\n[torque_and_drag]\nmodel = 'soft'\n"
    (tmp_path / "well.toml").write_text(stations + rest + operation, encoding="utf-8")
    command = [sys.executable, "-m", "cosserat_fenicsx", "run", "well.toml"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, encoding="utf-8", check=True)
    told = done.stderr.splitlines()
    assert len(told) == 4 and all(line.startswith("cosserat: warning: ") for line in told)
    for words in ("survey ends at 3281 m and the sections at 1000 m.*3.28 times as deep", "hardly that of a mud",
                  "RotaryDrilling.weight = 60 N is hardly", "RotaryDrilling.torque = 5 N m is hardly"):  # fmt: skip
        assert re.search(words, "\n".join(told)), words


@pytest.mark.once
def test_the_reference_has_every_key_unit_and_size():
    page = (DEMOS.parent / "docs" / "well_files.md").read_text(encoding="utf-8")
    told = set(re.findall(r"`([^`]+)`", re.sub(r"```.*?```", "", page, flags=re.S)))
    classes = [cls for family in (StringPart, Operation) for cls in members(family).values()]
    classes = [cls for cls in classes if cls.__module__.startswith("cosserat_fenicsx.")]
    assert {cls.__name__ for cls in classes} <= told
    parts = (*classes, cf.well.Mud, cf.well.HoleSection)
    arguments = {name for cls in parts for name in inspect.signature(cls).parameters}
    holes = {key for make in cf.well.Borehole.constructors() for key in arguments_of(make)} - {"path"}
    settings = (DepthSweepSettings, StrengthSettings, TorqueAndDragSettings)
    keys = holes | {key for cls in settings for key in arguments_of(cls)}
    keys |= {f"[{key}]" for key in arguments_of(WellScene)} - {"[title]", "[operations]"}
    names = ("length", "force", "moment", "density", "mass per length", "force per length", "speed", "rotation")
    units = {unit for name in (*names, "pressure") for unit in DIMENSIONS[name].units}
    sizes = {name for known in standard_sizes().values() for name in known}
    for expected in (arguments, keys, units, sizes):
        assert expected <= told, expected - told


@pytest.mark.slow
def test_the_command_line_draws(tmp_path):
    pytest.importorskip("pyvista")
    assert main(["run", str(DEMOS / "wells" / "lock_up.toml"), "-o", str(tmp_path)]) == 0
    assert {file.name for file in tmp_path.glob("*.png")} == {"trip_in.png", "trip_in_3d.png", "depth_sweep.png"}


KNOWN = json.loads((Path(__file__).parent / "reference" / "rod_in_hole.json").read_text(encoding="utf-8"))
LAYER = 0.25


def points_of(answer):
    return [contact for contact in answer.contacts if contact[0] == contact[1]]


def is_balanced(answer):
    """Whether forces at points and the distributed force are the wall's force, and so are all contacts."""
    solved = answer.solved
    distributed = float(answer.distributed_force @ solved.node_length)
    sums = sum(force for _, _, force, _ in points_of(answer)) + distributed, sum(x.force for x in solved.contacts)
    return sums == pytest.approx((solved.wall_force,) * 2, rel=1e-9)


@pytest.mark.parametrize("case", KNOWN["stiff build"], ids=lambda case: case["name"])
def test_a_build_section_through_the_public_face(case):
    given, alpha, found = case["input"], case["input"]["alpha"], in_build_section(case)
    lift = case["rod_length"] - given["D"] + case["lift_off_d_below_arc_end"]
    points = points_of(found)
    assert [md for md, *_ in points] == pytest.approx([case["free_span_2"], lift - case["free_span_1"], lift], abs=0.06)
    assert [x[2] for x in points] == pytest.approx([case[f"point_force_{k}"] for k in (3, 2, 1)], rel=1e-3)
    assert [x[3] for x in points] == ["high", "high", "low"] and is_balanced(found)
    assert not found.solved.rough and "ROUGH" not in str(found)
    for point, k in zip(points, (3, 2, 1), strict=True):
        assert abs(point.force - case[f"point_force_{k}"]) < point.error < 5e-3 * point.force
    assert all(np.isnan(x.error) for x in found.contacts if not x.at_point)
    assert pickle.loads(pickle.dumps(point)).error == point.error and len(point) == 4
    # what is left is smooth: the pressure of an arc and of a straight hole, without a trace of the peaks
    assert found.side_force.max() > 6 * found.distributed_force.max()
    lying = given["w"] * math.sin(math.radians(alpha))
    below = (found.md > lift + 0.15) & (found.md < case["rod_length"] - 1)
    assert found.distributed_force[below] == pytest.approx(lying, rel=0.01)


@pytest.mark.parametrize("case", KNOWN["bottom-hole assembly"][:2], ids=["free", "thrust"])
def test_an_assembly_through_the_public_face(case):
    exact, length, r = case["exact_kirchhoff"], 60.0, 0.1
    path = cf.well.WellPath.from_survey([0, length + 20], [case["inclination_deg"]] * 2, [0, 0])
    wide = 2 * (r + case["clearance"])
    stiff = cf.Stiffness((1e12,) * 2, 1e12, (case["EI"],) * 2, case["EI"])
    bit = cf.well.Bit(wide, length=1e-3, body_diameter=2 * r, mass=case["w"] / 9.81)
    string = cf.well.DrillString([bit, cf.well.Component(None, stiff, case["w"], r)])
    hole, given = cf.well.Borehole(path, cf.well.HoleSection(length + 20, wide, 0.0)), {"depth": length, "model": "rod"}
    found = cf.well.torque_and_drag(hole, string, cf.well.Static(weight=case["WOB"]), mud=cf.well.Mud(1e-3), **given)
    *_, tangency, at_bit = points_of(found)
    assert length - tangency[0] == pytest.approx(exact["arc_length_to_tangency"], abs=1e-3)
    assert tangency[2] == pytest.approx(exact["reaction_at_tangency"], rel=1e-4)
    assert at_bit[2] == pytest.approx(exact["bit_side_force"], rel=1e-4) and is_balanced(found)


#: A slick assembly at 3 degrees with 250 kN, of small slopes (a beam without a mesh): EI, weight, clearance, distance
#: from the bit to the tangency, and force there.
SLICK = (1.7e7, 2050.0, 0.0508, 17.919140838675947, 1639.0117496314479)


@pytest.mark.parametrize("tol", [1e-4, 1e-6])
def test_a_force_behind_which_the_string_rises(tol):
    """In a stiff wall the contact splits behind it: the force is not that of the first part alone, 8 % more."""
    *_, at, force = SLICK
    solved = pressed(3.0, tol=tol)
    *_, tangency, at_bit = (x for x in solved.contacts if x.start == x.end)
    assert 120.0 - tangency.start == pytest.approx(at, abs=2e-3)
    assert abs(tangency.force - force) < min(tangency.error, 5e-4 * force) and tangency.error < 5e-3 * force
    assert at_bit.force == pytest.approx(283.51, rel=5e-3) and not solved.rough


#: An assembly at 88 degrees with 250 kN and three stabilisers: distances from the bit and clearances, m; forces at the
#: lower stabiliser and at the bit (a beam of small slopes in a rigid wall, 6000 elements).
STABILISED = ((29.0, 0.003), (11.0, 0.003), (2.0, 0.0016)), (3536.43, 4185.51)


def test_forces_of_rings_next_to_each_other():
    """No wall is between them whose softness would count: the next wall is 18 m away."""
    rings, forces = STABILISED
    solved = pressed(88.0, rings)
    *_, stabiliser, at_bit = (x for x in solved.contacts if x.start == x.end)
    for found, force in zip((stabiliser, at_bit), forces, strict=True):
        assert abs(found.force - force) < found.error < 5e-3 * force and found not in solved.rough


@pytest.mark.parametrize("case", KNOWN["stiff build"][:2], ids=lambda case: case["name"])
def test_a_smaller_tol_makes_forces_at_points_more_accurate(case):
    """The wall is made stiffer, and the contact splits behind the forces."""
    given, alpha = case["input"], math.radians(case["input"]["alpha"])
    md = np.cumsum([0, given["h"], given["R"] * alpha, given["D"] + 50.0])
    path = cf.well.WellPath.from_survey(md, np.degrees([0, 0, alpha, alpha]), [0, 0, 0, 0])
    solved = solve_in_hole(
        path, [case["rod_length"]], cf.Stiffness((1e12,) * 2, 1e12, (given["EI"],) * 2, given["EI"]), given["w"], 0.06,
        radius=0.06 + given["r"], friction=given["mu"], slip=(float(given["c"]), 0.0), bottom_tension=given["T0"],
        hinge=(0, 1, 0), has_arm=False, wall_stiffness=1e12, elements=2048,
    )  # fmt: skip
    points = [x for x in solved.contacts if x.start == x.end]
    for point, k in zip(points, (3, 2, 1), strict=True):
        exact = case[f"point_force_{k}"]
        assert abs(point.force - exact) < min(2e-4 * exact, 3 * point.error) and point.error < 2e-2 * exact


def test_a_force_near_the_end_of_its_contact_says_so():
    """The part that is left behind it is shorter than what its peak and the rise behind it need."""
    solved, force = pressed(3.0, length=60.0), SLICK[-1]
    tangency = [x for x in solved.contacts if x.start == x.end][-2]
    assert tangency in solved.rough and abs(tangency.force - force) < tangency.error < force


def pressed(inclination, rings=(), length=120.0, **more):
    """An assembly by numbers in a straight hole, with 250 kN and rings (distance from the bit, clearance)."""
    EI, weight, clearance, *_ = SLICK
    path = cf.well.WellPath.from_survey([0, 140], np.radians([inclination] * 2), [0, 0], degrees=False)
    rings = [*((length - d, room, 0.1) for d, room in rings), (length, 0.0, 0.1)]
    stiff, given = cf.Stiffness((1e12,) * 2, 1e12, (EI, EI), EI), {"bottom_tension": -250e3, "rings": rings}
    return solve_in_hole(path, [length], stiff, weight, 0.1, radius=0.1 + clearance, **given, **more)


def wall(pressure, start=20.0, end=60.0, h=0.3):
    """What `contacts_along` finds of a pressure as a function of the arc length, and the sum of the pressure."""
    nodes = np.array([0.0, 0.5 - math.sqrt(0.05), 0.5 + math.sqrt(0.05), 1.0])
    ends = 20 + h * np.arange(-4, round((end - 20) / h) + 4)
    s = ends[:-1, None] + h * nodes
    sizes = np.broadcast_to(h * lobatto_weights(nodes), s.shape)
    p = np.where((s >= start) & (s <= end), pressure(s), 0.0)
    contacts, regular = contacts_along(s, sizes, p, np.zeros(s.shape), LAYER)
    return contacts, s, regular, sizes, float((p * sizes).sum())


def bump(s, at, force):
    """The pressure of an elastic wall on a beam that is pressed against it by a force at a point."""
    x = np.abs(s - at) / LAYER
    return force / (2 * LAYER) * np.exp(-x) * (np.cos(x) + np.sin(x))


@pytest.mark.once
def test_a_peak_inside_a_contact_is_a_force():
    """A peak on a pressure that grows and jumps; that the wall is elastic makes it 7 % larger than the force."""
    contacts, s, regular, sizes, total = wall(lambda s: 300 + 4 * (s - 20) + 200 * (s > 50) + bump(s, 35.0, 400.0))
    (point,) = (x for x in contacts if x.start == x.end)
    assert point.start == pytest.approx(35.0, abs=0.02) and point.force == pytest.approx(400, rel=0.1)
    inside = (s > 21) & (s < 59)
    assert np.abs(regular - 300 - 4 * (s - 20) - 200 * (s > 50))[inside].max() < 60
    assert point.force + (regular * sizes).sum() == pytest.approx(total, rel=1e-12)
    assert sum(x.force for x in contacts) == pytest.approx(total, rel=1e-12)


@pytest.mark.once
@pytest.mark.parametrize("h", [0.1, 2.4], ids=["the gap is seen", "a coarse mesh"])
def test_the_edge_of_a_wider_part_presses_alone(h):
    """A force at the edge, a gap, and pressure beyond it: the moments tell them apart where the mesh does not."""
    contacts, s, regular, sizes, total = wall(
        lambda s: np.where(s < 20.01, 100.0 / h, np.where(s < 22.2, 0.0, 5.0)), h=h, start=19.999, end=57.5
    )
    given = 100.0 / h * sizes[np.isclose(s, 20.0)].sum()
    edge, between, *_ = contacts
    assert edge.start == pytest.approx(20.0, abs=1e-9) and edge.force == pytest.approx(given, rel=0.05)
    assert between.start == pytest.approx(22.2, abs=0.25) and (regular < 8).all()
    points = sum(x.force for x in contacts if x.start == x.end)
    assert points + (regular * sizes).sum() == pytest.approx(total, rel=1e-12)


@pytest.mark.once
def test_a_force_that_is_small_beside_the_pressure():
    """At the end of a contact."""
    contacts, s, regular, sizes, total = wall(lambda s: 500 + bump(s, 60.0, 600.0), h=0.1)
    between, end = contacts
    assert end.force + (regular * sizes).sum() == pytest.approx(total, rel=1e-12)
    assert end.start == pytest.approx(60, abs=0.2) and 300 < end.force < 400


def test_forces_that_the_mesh_does_not_resolve_are_told():
    """Those of a mesh that is fine enough for a rough hook load."""
    path = cf.well.WellPath.from_survey([0, 400, 1000, 2000], [0, 0, 60, 60], [0, 0, 40, 40])
    stiff = cf.Stiffness((1.35e8,) * 2, 7e8, (1228200.0,) * 2, 9.4e5)
    string = cf.well.DrillString([cf.well.Component(None, stiff, 241.13, 0.0635)])
    found = cf.well.torque_and_drag(
        cf.well.Borehole(path, cf.well.HoleSection(2000, 0.216, 0.25)), string, cf.well.TripIn(), model="rod", tol=5e-2
    )
    rough = found.solved.rough
    assert rough and "are ROUGH" in found.details() and is_balanced(found)
    assert {x.start for x in rough} <= {x.start for x in found.solved.contacts if x.start == x.end}


def test_forces_with_errors_as_large_are_left_out_and_titles_have_four_digits():
    pytest.importorskip("matplotlib")
    scene = cf.read(VOLVE)
    found = scene.answer(scene.operations[2])
    told, wide = found.details(), [x for x in found.contacts if x.bottom > 3227.69 and x.error >= x.force]
    assert f"left out: {len(wide)} of forces at points" in told and len(wide) > 0
    assert f"own estimated errors, {found.error:.0e}" in told and f"{wide[0].force / 1e3:.4g}" not in told
    figure = found.plot(between=(3000, 3400), units="field")
    hook, torque = found.hook_load / cf.units.kip, found.surface_torque / cf.units.ft_lbf
    assert f"hook load {hook:.4g} klbf, surface torque {torque / 100:.0f}00 ft-lbf" in figure.get_suptitle()
    ticks = [float(x.get_text().replace("\N{MINUS SIGN}", "-")) for x in figure.axes[0].get_xticklabels()]
    assert torque > 1e4 and ticks == [-4.25, 0, 4.25]


@pytest.mark.once
def test_resultants_of_any_pressure_add_up():
    """Of rough pressures with gaps and jumps, on elements of any length, in layers of any length."""
    rng, nodes = np.random.default_rng(0), np.array([0.0, 0.5 - math.sqrt(0.05), 0.5 + math.sqrt(0.05), 1.0])
    found = 0
    for _ in range(100):
        count = int(rng.integers(1, 200))
        h = np.full(count, 10 ** rng.uniform(-2, 1)) * rng.uniform(0.5, 1.5, count)
        s = np.cumsum(h)[:, None] + h[:, None] * (nodes - 1)
        sizes = h[:, None] * lobatto_weights(nodes)
        values = np.repeat(np.maximum(rng.normal(rng.uniform(-1, 1), 1, 3 * count + 1), 0), rng.integers(1, 9))
        pressure = (values[: 3 * count + 1] * rng.uniform(0.5, 1.5, 3 * count + 1))[
            np.arange(count)[:, None] * 3 + np.arange(4)
        ]
        contacts, regular = contacts_along(s, sizes, pressure, np.zeros(s.shape), 10 ** rng.uniform(-1.5, 0.5))
        points, total = [x.force for x in contacts if x.start == x.end], (pressure * sizes).sum()
        assert sum(x.force for x in contacts) == pytest.approx(total, rel=1e-12)
        assert sum(points) + (regular * sizes).sum() == pytest.approx(total, rel=1e-12) and regular.min() >= 0
        assert all(x.force > -1e-12 * total and x.start <= x.end for x in contacts)
        found += len(points)
    assert found > 100


def test_torque_does_not_alternate_at_the_edge_of_a_collar():
    """The wall's force is concentrated there: torque falls by its friction, and all the way down."""
    path = cf.well.WellPath.from_survey([0, 100, 300, 500], [0, 0, 40, 40], [20, 20, 20, 20])
    string = cf.well.DrillString(
        [cf.well.Collar(60, outer_diameter=0.2, inner_diameter=0.07), cf.well.DrillPipe(size="5 in 19.50 lb/ft")]
    )
    where = cf.well.Borehole(path, cf.well.HoleSection(500.0, 0.2159, 0.25))
    found = cf.well.torque_and_drag(
        where, string, cf.well.RotateOffBottom(), mud=cf.well.Mud(1200.0), model="rod", tol=1e-5
    )
    assert np.diff(found.torque).max() < 5e-3 * found.surface_torque
    assert found.torque[0] == pytest.approx(found.surface_torque, rel=1e-9)
