"""Scene files of strings in wells: what they say, units, refusals, the command line, the demos."""

import inspect
import math
import re
import sys
from pathlib import Path

import pytest
from assembly import assembly

import cosserat_fenicsx as cf
from cosserat_fenicsx.cli.main import main
from cosserat_fenicsx.dimensions import DIMENSIONS, in_si
from cosserat_fenicsx.parts import arguments_of, members
from cosserat_fenicsx.well.components import StringPart, standard_sizes
from cosserat_fenicsx.well.operations import Operation
from cosserat_fenicsx.well.scenefile import DepthSweepSettings, TorqueAndDragSettings, WellScene

pytestmark = pytest.mark.serial
DEMOS = Path(__file__).parent.parent / "demos"
VOLVE = DEMOS / "wells" / "volve_f12.toml"


@pytest.fixture
def demos_on_the_path(monkeypatch):
    monkeypatch.setattr(sys, "path", [str(DEMOS), *sys.path])


def test_the_demos_give_their_numbers(demos_on_the_path, capsys):
    import wells
    from known_numbers import deviation

    assert {demo.__name__ for demo in wells.WELLS} == {file.stem for file in (DEMOS / "wells").glob("*.toml")}
    for check in wells.main(out=None):
        assert deviation(check) <= check.allowed, check
    assert "Strings in wells" in capsys.readouterr().out


def test_the_assembly_by_its_strong_form(demos_on_the_path):
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


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
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
    ],
)
def test_field_units(text, dimension, value):
    assert in_si("x", text, dimension) == pytest.approx(value, rel=1e-7)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"Bit", diameter = "8.5 in"', '"Bit", diameter = "8.5 yards"', "yards"),
        ("weight = 80e3", 'weight = "8 tons"', "expected tf, 1000 kgf, or kN or klbf: there are several tons"),
        ('survey = "volve_f12.csv"', "survey = volve", "a number with its unit, stand in quotes"),
        (
            'survey = "volve_f12.csv"',
            'survey = "volve_f12.csv"\nlength_unit = "yd"',
            "length_unit = 'yd': known: cm, f",
        ),
        (
            '"Bit", diameter = "8.5 in"',
            '"Bit", diameter = "8.5 ppg"',
            "ppg is a unit of density, expected one of length",
        ),
        (
            '"Bit", diameter = "8.5 in"',
            '"Bit", diameter = "8.5"',
            "expected a unit after the number, or the number without quotes",
        ),
        ('density = "10.2 ppg"', "density = -3", "mud: Mud.density = -3"),
        ('[mud]\ndensity = "10.2 ppg"', "", "mud = None: expected Mud"),
        ('type = "TripIn"', 'type = "TripDown"', "operations.1..type = 'TripDown': did you mean 'TripIn'"),
        ("weight = 80e3\n", "", "operations.2. .RotaryDrilling.: 'weight' is missing"),
        ("friction = 0.20", "friction = 0.20, mu = 1", "unknown key 'mu'"),
        ("[string]", "[strings]", "unknown key 'strings', did you mean 'string'"),
        ('survey = "volve_f12.csv"', 'survey = "none.csv"', "cannot be read"),
        (", count = 20", "", "'count' is missing"),
        ("{ from = 300.0, to = 3438.0, count = 20 }", "3000", r"depth_sweep.depths = 3000: expected a list, each"),
        ("to = 3438.0, count", 'to = "11400 ft", count', "depth = 3474.72 m: expected a measured depth in the hole"),
        ("tol = 2e-2", 'tol = "1 %"', "torque_and_drag.tol = '1 %': expected a finite number"),
        ("tol = 2e-2", 'model = "stiff"', "torque_and_drag.model = 'stiff': expected 'auto'"),
        ("tol = 2e-2", 'model = "rod"\ntorque_convention = "johancsik"', "the law that the rod in contact follows"),
        ("tol = 2e-2", 'torque_convention = "api"', "expected 'coulomb' or 'johancsik'"),
        ("friction = [0.1, 0.2, 0.3]", "friction = [[0.1, 0.2, 0.3]]", "a number, or 2, one for each section"),
        ('"Bit", diameter = "8.5 in"', '"Bit", diameter = "8.75 in"', "bit: 0.22225 m wide"),
        ("[string]", '[string]\norder = "top down"', "bit, fills up; where the list .* order='bit up'"),
        ("tol = 2e-2", "tol = 2e-2\nelements = 4", "unknown key 'elements'"),
    ],
)
def test_files_that_are_refused(old, new, words, tmp_path):
    text = VOLVE.read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "well.toml").write_text(text.replace(old, new), encoding="utf-8")
    (tmp_path / "volve_f12.csv").write_text(VOLVE.with_suffix(".csv").read_text(encoding="utf-8"), encoding="utf-8")
    with pytest.raises(cf.SceneError, match=words):
        cf.read(tmp_path / "well.toml")


def test_the_command_line(tmp_path, capsys):
    assert main(["explain", str(VOLVE)]) == 0
    told = capsys.readouterr().out
    assert "largest inclination 53.43 degrees" in told and "String, drill pipe: md 0 to 3227.7 m" in told
    assert main(["run", str(VOLVE), "-o", str(tmp_path), "--no-picture", "--tol", "1e-3", "--model", "soft"]) == 0
    told = capsys.readouterr().out
    assert "NOT ENOUGH for tol = 0.001: " in told and "rotary drilling, friction" not in told.splitlines()[0]
    names = {"depth_sweep.csv", *(f"{name}{end}.csv" for name in ("trip_out", "trip_in", "rotary_drilling")
                                  for end in ("", "_contacts"))}  # fmt: skip
    assert {file.name for file in tmp_path.iterdir()} == names == set(re.findall(r"\w+\.csv", told))
    rows = (tmp_path / "trip_out.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0].startswith("md (m),north (m)") and rows[-1].startswith("3438.0,-346.4")
    for option, value in (("--elements", "4"), ("--color", "tension")):
        assert main(["run", str(VOLVE), option, value]) == 2
        assert f"{option} is for rods" in capsys.readouterr().err
    assert main(["explain", str(VOLVE), "--model", "stiff"]) == 2
    text = VOLVE.read_text(encoding="utf-8")
    (tmp_path / "no_well.toml").write_text(text[text.index("[string]") :], encoding="utf-8")
    assert main(["run", str(tmp_path / "no_well.toml")]) == 2 and "[well] is missing" in capsys.readouterr().err


def test_doubts_are_said_once_and_without_code(tmp_path, capsys):
    stations = (
        "[well]\nstations = [[0, 0, 0], ['1 km', 0, 0], [3281, 30, 0]]\nsections = [{ to = 1000, diameter = 0.2159, "
    )
    rest = "friction = 0.2 }]\n[string]\ncomponents = [{ type = 'DrillPipe', size = '5 19.5' }]\n[mud]\ndensity = 10\n"
    operation = "[[operations]]\ntype = 'RotaryDrilling'\nweight = 60\ntorque = 5\n[torque_and_drag]\nmodel = 'soft'\n"
    (tmp_path / "well.toml").write_text(stations + rest + operation, encoding="utf-8")
    assert main(["run", str(tmp_path / "well.toml")]) == 0
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 4 and all(line.startswith("cosserat: warning: ") for line in told)
    for words in ("survey ends at 3281 m and the sections at 1000 m.*3.28 times as deep", "hardly that of a mud",
                  "RotaryDrilling.weight = 60 N is hardly", "RotaryDrilling.torque = 5 N m is hardly"):  # fmt: skip
        assert re.search(words, "\n".join(told)), words


def test_the_reference_has_every_key_unit_and_size():
    page = (DEMOS.parent / "docs" / "well_files.md").read_text(encoding="utf-8")
    told = set(re.findall(r"`([^`]+)`", re.sub(r"```.*?```", "", page, flags=re.S)))
    classes = [cls for family in (StringPart, Operation) for cls in members(family).values()]
    classes = [cls for cls in classes if cls.__module__.startswith("cosserat_fenicsx.")]
    assert {cls.__name__ for cls in classes} <= told
    arguments = {
        name for cls in (*classes, cf.well.Mud, cf.well.HoleSection) for name in inspect.signature(cls).parameters
    }
    holes = {key for make in cf.well.Borehole.constructors() for key in arguments_of(make)} - {"path"}
    keys = holes | {key for cls in (DepthSweepSettings, TorqueAndDragSettings) for key in arguments_of(cls)}
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
