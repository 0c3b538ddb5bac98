"""Scene files of drill-strings in motion: what they say, units, refusals, the command line."""

import inspect
import math
import re
from pathlib import Path

import pytest
from fake_string import use

import cosserat_fenicsx as cf
from cosserat_fenicsx.cli.main import main
from cosserat_fenicsx.dimensions import DIMENSIONS
from cosserat_fenicsx.drilling.bit_laws import BitLaw
from cosserat_fenicsx.drilling.scenefile import DrillingScene, SimulateDrilling, StabilityMap
from cosserat_fenicsx.drilling.top_drive import DriveControl
from cosserat_fenicsx.parts import arguments_of, members

pytestmark = [pytest.mark.serial, pytest.mark.once]
ROOT = Path(__file__).parent.parent
FILE = """
title = "Drilling in an inclined hole"

[well]
stations = [[0, 0, 0], [500, 0, 0], [1600, 60, 0], [2500, 60, 0]]
sections = [{ to = 2500.0, diameter = "12 1/4 in", friction = 0.2 }]

[string]
components = [{ type = "Collar", size = "NC56-80", length = 200.0 }, { type = "DrillPipe", size = "5 in 19.50 lb/ft" }]

[mud]
density = "10 ppg"

[drive]
speed = { type = "Ramp", value = "60 rpm", start = 1.0, end = "10 s" }
inertia = 2900.0
control = { type = "SoftSpeed" }

[bit]
weight = "80 kN"
inertia = 50.0
law = { type = "Stribeck", static = "6 kN m", dynamic = "4 kN m", speed = "30 rpm" }

[hook]
stiffness = "5 MN/m"
speed = { type = "Table", times = ["0 s", 5.0], values = ["0 m/s", "10 m/h"] }

[wall_friction]
static = 0.3
kinetic = 0.2
speed = "10 rpm"
of_rotation = true

[drag]
torsion = 0.1
axial = 0.2

[simulate]
duration = "1 min"
dt = "10 ms"

[stability]
speeds = { from = "40 rpm", to = "160 rpm", count = 4 }
weights = ["20 kN", 60e3]
"""


def read(tmp_path, text):
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    return cf.read(tmp_path / "scene.toml")


def test_what_a_file_says(tmp_path):
    found = read(tmp_path, FILE)
    scene, rpm = found.scene, cf.units.rpm
    assert found.title == "Drilling in an inclined hole" and found.settings == {"duration": 60.0, "dt": 0.01}
    assert scene.drive.speed == cf.signals.Ramp((60 * rpm,), 1.0, 10.0)
    assert scene.drive.control.Kp == pytest.approx(4 * scene.segments[0].torsional_impedance)
    assert scene.bit == cf.drilling.BitOnRock(cf.drilling.Stribeck(6e3, 4e3, 30 * rpm), 80e3, 50.0)
    assert scene.hook.stiffness == 5e6 and scene.hook.speed(5.0) == pytest.approx((10 / 3600,))
    assert scene.friction == cf.drilling.WallFriction(0.3, 0.2, 10 * rpm, of_rotation=True)
    assert scene.drag == cf.drilling.ViscousDrag(0.1, 0.2) and scene.mud.density == pytest.approx(1198.264273)
    assert scene.bit_depth == 2500.0 and scene.hole.sections[0].diameter == pytest.approx(0.31115)
    assert found.speeds == pytest.approx([40 * rpm, 80 * rpm, 120 * rpm, 160 * rpm]) and found.weights == (20e3, 60e3)


def test_discs(tmp_path):
    drive = "[drive]\ncontrol = { type = 'Motor', torque = 8e3 }"
    scene = read(tmp_path, f"[discs]\ninertias = [930.0, 2782.0]\nstiffnesses = [700.0]\n{drive}").scene
    assert scene.string == cf.drilling.Discs((930.0, 2782.0), (700.0,)) and scene.drive == cf.drilling.TopDrive(
        control=cf.drilling.Motor(8e3)
    )


LAW = "law = { type = 'Cutting', a = '0.108 m', epsilon = '60 MPa', zeta = 0.6, blades = 4, wear = { stress = '60 MPa', length = 0.011, friction = 0.6 } }"  # noqa: E501


def test_laws_inside_laws(tmp_path):
    law = read(tmp_path, re.sub("law = .*", LAW, FILE)).scene.bit.law
    assert law == cf.drilling.Cutting(0.108, 60e6, 0.6, 4, cf.drilling.Wear(60e6, 0.011, 0.6))
    lobes = "law = { type = 'Lobes', count = 3, amplitude = '2 mm', law = { static = 4e3, dynamic = 4e3 } }"
    assert read(tmp_path, re.sub("law = .*", lobes, FILE)).scene.bit.law == cf.drilling.Lobes(
        3, 2e-3, cf.drilling.Stribeck(4e3, 4e3)
    )


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[drive]", "[drives]", r"unknown key 'drives', did you mean 'drive'"),
        ("inertia = 2900.0\n", "", r"TopDrive.inertia = 0.0: expected the drive's own .* for SoftSpeed"),
        ('"SoftSpeed"', '"SoftSpeeds"', r"drive.control.type = 'SoftSpeeds': did you mean 'SoftSpeed'"),
        ('{ type = "SoftSpeed" }', '{ type = "PI", Kp = 3.0 }', r"drive.control: PI.Ki = None: expected a gain: SoftT"),
        ('static = "6 kN m"', 'static = "6 kN"', r"bit.law: Stribeck.static = '6 kN': kN is a unit of force"),
        ('static = "6 kN m"', "static = 3e3", r"bit.law: Stribeck.static = 3000.0: expected at least the dynamic one"),
        ('"Stribeck"', '"Stribek"', r"bit.law.type = 'Stribek': did you mean 'Stribeck'"),
        ("static = 0.3", "static = -0.3", r"wall_friction: WallFriction.static = -0.3: expected a coefficient"),
        ("torsion = 0.1", "torsional = 0.1", r"drag .ViscousDrag.: unknown key 'torsional', did you mean 'torsion'"),
        ('type = "Ramp"', 'type = "Slope"', r"drive.speed.type = 'Slope': known: .*Ramp"),
        ('"10 s"', '"0.5 s"', r"drive.speed: Ramp.end = 0.5: expected a time after 1 s"),
        ('duration = "1 min"', 'duration = "1 minute"', r"simulate.duration = '1 minute': did you mean 'min'"),
        ('duration = "1 min"', "duration = 0.0", r"simulate.duration = 0.0: expected a positive number"),
        ('dt = "10 ms"', "tol = 1e-3", r"\[simulate\]: unknown key 'tol'"),
        ('dt = "10 ms"', 'model = "rod"', r"simulate.model = 'rod'"),
        ("count = 4", "count = 0", r"stability.speeds.count = 0: expected how many from 2"),
        ("[string]", "[discs]\ninertias = [1.0, 2.0]\nstiffnesses = [3.0]\n[string]", "either .string. or .discs."),
    ],
)
def test_files_that_are_refused(old, new, words, tmp_path):
    assert old in FILE
    with pytest.raises(cf.SceneError, match=words) as refused:
        read(tmp_path, FILE.replace(old, new))
    assert str(refused.value).startswith(str(tmp_path / "scene.toml"))


def test_the_command_line(tmp_path, capsys, monkeypatch):
    pytest.importorskip("matplotlib")
    use(monkeypatch)
    file = ROOT / "demos" / "strings" / "stick_slip.toml"
    assert (
        main(["run", str(file), "--duration", "20", "-o", str(tmp_path / "out"), "--folder", str(tmp_path / "run")])
        == 0
    )
    told = capsys.readouterr().out
    assert told.startswith("Stick-slip of 3000 m") and "bit (rpm)" in told
    names = {"drilling.csv", "drilling.png", "phase.png", "energy.png", "map.png"}
    assert {file.name for file in (tmp_path / "out").iterdir()} == names == set(re.findall(r"\w+\.(?:csv|png)", told))
    assert main(["resume", str(tmp_path / "run"), "--duration", "30"]) == 0
    assert len(cf.read(tmp_path / "run")) == 3000
    for option, value in (("--tol", "1e-3"), ("--degree", "2"), ("--scheme", "energy")):
        assert main(["run", str(file), option, value]) == 2
        assert f"{option} is for rods" in capsys.readouterr().err
    assert main(["run", str(file), "--dt", "1.0"]) == 2 and "a step of at most" in capsys.readouterr().err
    use(monkeypatch, fails_at=500)
    assert main(["run", str(file)]) == 1
    caught = capsys.readouterr()
    assert "the step at t = 5 s fails" in caught.err and "bit (rpm)" in caught.out
    use(monkeypatch, stops_at=500)
    assert main(["run", str(file), "--folder", str(tmp_path / "stopped")]) == 130
    assert f"cosserat resume {tmp_path / 'stopped'}` continues" in capsys.readouterr().err


def test_the_reference_has_every_key_and_unit():
    page = (ROOT / "docs" / "drilling_files.md").read_text(encoding="utf-8")
    told = set(re.findall(r"`([^`]+)`", re.sub(r"```.*?```", "", page, flags=re.S)))
    named = {
        name: cls for name, cls in (members(BitLaw) | members(DriveControl)).items() if name in cf.drilling.__all__
    }
    classes = (
        cf.drilling.TopDrive,
        *named.values(),
        cf.drilling.BitOnRock,
        cf.drilling.Wear,
        cf.drilling.Hook,
        cf.drilling.WallFriction,
        cf.drilling.ViscousDrag,
        cf.drilling.Discs,
    )
    assert named.keys() <= told
    arguments = {name for cls in classes for name in inspect.signature(cls).parameters}
    keys = {key for cls in (SimulateDrilling, StabilityMap) for key in arguments_of(cls)}
    keys |= {f"[{key}]" for key in arguments_of(DrillingScene)} - {"[title]", "[depth]", "[start]"}
    units = {unit for name in ("angular velocity", "time", "stiffness") for unit in DIMENSIONS[name].units}
    for expected in (arguments, keys, units):
        assert expected <= told, expected - told
    assert math.isclose(DIMENSIONS["angular velocity"].units["rpm"], math.pi / 30)


def refused(capsys, *arguments):
    assert main([str(x) for x in arguments]) == 2
    return capsys.readouterr().err


def test_mistakes_are_told_in_words_of_the_command_line(tmp_path, capsys, monkeypatch):
    use(monkeypatch)
    file = ROOT / "demos" / "strings" / "stick_slip.toml"
    text, other, folder = file.read_text(encoding="utf-8"), tmp_path / "other.toml", tmp_path / "run"
    other.write_text(text.replace("[drive]", "[topdrive]"), encoding="utf-8")
    assert "unknown key 'topdrive', did you mean 'drive'?" in refused(capsys, "run", other)
    for command in ("modes", "buckling"):
        assert f"cosserat {command} is for rods" in refused(capsys, command, file)
    assert "--static is for rods" in refused(capsys, "run", file, "--static")
    assert "there is no such folder" in refused(capsys, "resume", folder)
    assert main(["run", str(file), "--duration", "5", "--folder", str(folder)]) == 0
    assert f"`cosserat resume {folder}` continues it" in refused(capsys, "run", file, "--folder", folder)
    other.write_text(text.replace("60 rpm", "61 rpm"), encoding="utf-8")
    assert "the scene is not the one of the motion: " in refused(capsys, "run", other, "--folder", folder)
    use(monkeypatch, stops_at=500)
    assert main(["run", str(file)]) == 130
    told = capsys.readouterr().err
    assert told.startswith("cosserat: interrupted after ") and "(t = " in told and "with --folder DIR" in told


def test_explain_tells_what_may_be_mistaken(tmp_path, capsys):
    (tmp_path / "scene.toml").write_text(FILE, encoding="utf-8")
    assert main(["explain", str(tmp_path / "scene.toml")]) == 0
    told = capsys.readouterr().out
    for words in (
        "N/m in mud.",
        "Mud: 1198.26 kg/m^3, 10 ppg.",
        "to 2500 m, 0.31115 m wide, friction 0.2.",
        "Bit at md = 2500 m; largest inclination of the hole 60 degrees.",
        "Drive: 0 to 60 rpm, which depends on time, PI(",
        "its torque does not follow the weight: that takes coefficients and a radius",
        "Hook: 5e+06 N/m, the block moves upwards at 0 to 0.0027778 m/s.",
    ):
        assert words in told, words
    assert main(["explain", str(ROOT / "demos" / "strings" / "stopped_block.toml")]) == 0
    told = capsys.readouterr().out
    assert "N/m in air." in told and "Hole: none, no walls" in told and "friction at the wall" not in told.lower()
