"""Scene files of strings in wells: what they say, units, refusals, the command line, the demos."""

import re
import sys
from pathlib import Path

import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.cli.main import main
from cosserat_fenicsx.well.field_units import in_si

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


def test_what_a_file_says():
    scene = cf.read_well(VOLVE)
    assert scene.hole.path.length == 3438 and len(scene.hole.path.md) == 74
    assert scene.hole.sections[1] == cf.HoleSection(3438.0, 8.5 * cf.units.inch, 0.30, "open hole")
    assert scene.mud == cf.Mud(10.2 * cf.units.ppg)
    assert scene.string.components[1] == cf.Collar(90.0, "NC46-65") and len(scene.sweep["depths"]) == 20
    assert scene.operations[2].torque == pytest.approx(3500 * cf.units.ft_lbf) and scene.operations[2].weight == 80e3
    by_hand = cf.torque_and_drag(scene.hole, scene.string, cf.TripOut(), mud=scene.mud, **scene.settings)
    assert scene.answers()[0].hook_load == by_hand.hook_load


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
    ],
)
def test_field_units(text, dimension, value):
    assert in_si("x", text, dimension) == pytest.approx(value, rel=1e-7)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"Bit", diameter = "8.5 in"', '"Bit", diameter = "8.5 inches"', "inches"),
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
        ("count = 20", "", "'count' is missing"),
        ("tol = 2e-2", "tol = 2e-2\nelements = 4", "unknown key 'elements'"),
    ],
)
def test_files_that_are_refused(old, new, words, tmp_path):
    text = VOLVE.read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "well.toml").write_text(text.replace(old, new), encoding="utf-8")
    (tmp_path / "volve_f12.csv").write_text(VOLVE.with_suffix(".csv").read_text(encoding="utf-8"), encoding="utf-8")
    with pytest.raises(cf.SceneError, match=words):
        cf.read_well(tmp_path / "well.toml").answers()


def test_the_command_line(tmp_path, capsys):
    assert main(["explain", str(VOLVE)]) == 0
    told = capsys.readouterr().out
    assert "largest inclination 53.43 degrees" in told and "String, drill pipe: md 0 to 3227.7 m" in told
    assert main(["run", str(VOLVE), "-o", str(tmp_path), "--no-picture", "--tol", "1e-3", "--model", "soft"]) == 0
    told = capsys.readouterr().out
    assert "asked for 0.001: NOT ENOUGH" in told and "rotary drilling, friction" not in told.splitlines()[0]
    names = {"depth_sweep.csv", *(f"{name}{end}.csv" for name in ("trip_out", "trip_in", "rotary_drilling")
                                  for end in ("", "_contacts"))}  # fmt: skip
    assert {file.name for file in tmp_path.iterdir()} == names == set(re.findall(r"\w+\.csv", told))
    rows = (tmp_path / "trip_out.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0].startswith("md (m),north (m)") and rows[-1].startswith("3438,-346.4")
    assert main(["run", str(VOLVE), "--elements", "4"]) == 2
    assert "--elements is for rods" in capsys.readouterr().err


@pytest.mark.slow
def test_the_command_line_draws(tmp_path):
    pytest.importorskip("pyvista")
    assert main(["run", str(DEMOS / "wells" / "lock_up.toml"), "-o", str(tmp_path)]) == 0
    assert {file.name for file in tmp_path.glob("*.png")} == {"trip_in.png", "trip_in_3d.png", "depth_sweep.png"}
