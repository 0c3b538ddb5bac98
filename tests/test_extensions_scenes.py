"""Scene files: read and written by the classes of their parts, also by those of users; and their JSON Schema."""

import json
import tomllib
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from extensions.gust import Gust

import cosserat_fenicsx as cf
from cosserat_fenicsx.cli.main import main
from cosserat_fenicsx.files.read import from_tables, schema_of_files
from cosserat_fenicsx.files.toml import place_of, places
from cosserat_fenicsx.parts import from_data, to_data

pytestmark = pytest.mark.serial
DEMOS = Path(__file__).parent.parent / "demos"
FILES = sorted(DEMOS.glob("**/*.toml"))
MAST = """use = ["extensions.gust"]

[[rods]]
name = "mast"
curve = { type = "Line", start = [0, 0, 0], end = [0, 0, "20 ft"] }
section = { type = "Tube", outer_diameter = "4 in", inner_diameter = "3 in" }
material = { E = "210 GPa", density = "7.85 g/cm^3" }

[[supports]]
type = "Clamp"
station = "mast.start"

[[loads]]
type = "Gust"
rod = "mast"
strength = "2 kN/m"
height = "10 m"

[solve]
load_factors = [0.5, 1.0]
elements = 4
"""


@pytest.fixture
def mast(tmp_path):
    file = tmp_path / "mast.toml"
    file.write_text(MAST, encoding="utf-8")
    return file


def test_a_load_of_ones_own(mast, tmp_path):
    found = cf.read(mast)
    (rod,), (load,) = found.scene.rods, found.scene.loads
    assert load == Gust(rod, 2000.0) and rod.length == pytest.approx(6.096)
    path = found.run()
    by_hand = cf.Scene([rod], [cf.Clamp(rod.start)], [Gust(rod, "2 kN/m")])
    assert np.array_equal(path.position(rod.end), cf.solve(by_hand, [0.5, 1.0], elements=4).position(rod.end))
    force, _ = path.reaction(rod.start)
    # the integral of 2000 (z/10)^(1/7) over the mast
    assert -force[-1][0] == pytest.approx(2000 * 10 / (8 / 7) * 0.6096 ** (8 / 7), rel=1e-3)
    path.save(tmp_path / "path.h5")
    assert cf.read_path(tmp_path / "path.h5").position("mast.end") == pytest.approx(path.position("mast.end"), abs=0)


def test_a_motion_with_it_goes_on(mast, tmp_path):
    scene = cf.read(mast).scene
    whole = cf.simulate(scene, 0.04, dt=0.01, elements=2)
    cf.simulate(scene, 0.02, dt=0.01, elements=2, folder=tmp_path / "run")
    again = cf.resume(tmp_path / "run", duration=0.04)
    assert np.array_equal(again.position("mast.end"), whole.position("mast.end"))


def test_it_is_written_and_refused_by_its_fields(mast, tmp_path):
    found = cf.read(mast)
    data = to_data(found.scene)
    assert data["use"] == ["extensions.gust"] and data["loads"][0]["power"] == 1 / 7
    cf.write(found, tmp_path / "again.toml")
    assert to_data(cf.read(tmp_path / "again.toml")) == to_data(found)
    for old, new, words in (
        ("2 kN/m", "2 kN", r"line 16, column 1: loads\[0\]: Gust.strength = '2 kN': kN is a unit of force"),
        ('height = "10 m"', "power = 2", r"line 17, column 1: loads\[0\]: Gust.power = 2: expected a number from 0 to"),
        ("height =", "hight =", r"line 17, column 1: loads\[0\] \(Gust\): unknown key 'hight', did you mean 'height'"),
        ('"Gust"', '"Gusts"', r"line 14, column 1: loads\[0\].type = 'Gusts': did you mean 'Gust'"),
        ("extensions.gust", "extensions.gusts", r"line 1, column 8: use\[0\] = 'extensions.gusts': cannot be imported"),
        ("[solve]", "[solved]", r"line 19, column 1: the file: unknown key 'solved', did you mean 'solve'"),
        ("[[supports]]", "[solve]\n[[supports]]", r"line 20, column 1: \[solve\] is given twice, first at line 9,"),
    ):
        assert old in MAST
        mast.write_text(MAST.replace(old, new), encoding="utf-8")
        with pytest.raises(cf.SceneError, match=words):
            cf.read(mast)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_scene_written_reads_back_equal(file, tmp_path):
    jsonschema = pytest.importorskip("jsonschema")
    known = jsonschema.Draft202012Validator(SCHEMA)
    tables = tomllib.loads(file.read_text(encoding="utf-8"))
    known.validate(tables)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cf.SceneWarning)
        found = cf.read(file)
        cf.write(found, tmp_path / "again.toml")
        again = cf.read(tmp_path / "again.toml")
    assert type(again) is type(found) and to_data(again) == to_data(found)
    assert to_data(from_data(type(found), json.loads(json.dumps(to_data(found))))) == to_data(found)
    known.validate(tomllib.loads((tmp_path / "again.toml").read_text(encoding="utf-8")))


SCHEMA = schema_of_files()


def test_the_schema_refuses_what_the_reader_refuses(capsys):
    jsonschema = pytest.importorskip("jsonschema")
    assert main(["schema", "extensions.gust"]) == 0
    schema = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator.check_schema(schema)
    known = jsonschema.Draft202012Validator(schema)
    tables = tomllib.loads(MAST)
    known.validate(tables)
    for where, value in (
        (("rods", 0, "section", "outer_diameter"), -1.0), (("rods", 0, "section", "outer_diameter"), True),
        (("loads", 0, "type"), "Gusts"), (("loads", 0, "strength"), [1.0]), (("loads", 0, "power"), 2.0),
        (("supports", 0, "station"), 3), (("solve", "tolerance"), 1e-3), (("solve", "elements"), 2.5),
    ):  # fmt: skip
        changed = json.loads(json.dumps(tables))
        inner = changed
        for key in where[:-1]:
            inner = inner[key]
        inner[where[-1]] = value
        assert not known.is_valid(changed), where
        with pytest.raises(cf.SceneError):
            from_tables(changed, DEMOS)


def test_functions_written_in_python_are_refused(mast, tmp_path):
    found = cf.read(mast)
    force = cf.Force("mast.end", lambda t: (t, 0, 0))
    with pytest.raises(Exception, match=r"loads\[0\].force: a function written in Python cannot be stored as data"):
        cf.write(replace(found, loads=(force,)), tmp_path / "again.toml")


def test_functions_of_time_have_units():
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, "2 m")), cf.Circle("1 cm"), cf.Material("1 GPa"))
    force = cf.Force(rod.end, cf.signals.Ramp(("1 kN", 0, 0), end="2 s")).force
    assert force(1.0) == (500.0, 0.0, 0.0) and force.jumps == (0.0, 2.0)
    drive = cf.drilling.TopDrive(cf.signals.Table(["0 s", 10], ["0 rpm", "120 rpm"]))
    assert drive.signal()(5.0) == pytest.approx(60 * cf.units.rpm)
    assert cf.drilling.TopDrive(cf.signals.Ramp("60 rpm", end=5.0)).signal()(2.5) == pytest.approx(30 * cf.units.rpm)
    with pytest.raises(cf.SceneError, match="TopDrive.speed = '60 s': s is a unit of time"):
        cf.drilling.TopDrive(cf.signals.Ramp("60 s"))


def test_places_in_files():
    text = """# a comment with [brackets]
a.b = 1
"quoted key" = [1, { x = 2, "y z" = [
  3, # three
  4,
] }]
[[t]]
s = '''a
[no] = table'''
[[t]]
[t.u]
v = "]}#"
"""
    found = places(text)
    inner = [("quoted key", 1, "y z", 1), ("t", 1), ("t", 0, "s"), ("t", 1, "u", "v"), ("a", "b")]
    assert [place_of(text, where) for where in inner] == [(5, 3), (10, 1), (8, 1), (12, 1), (2, 1)]
    assert place_of(text, ("t", 0, "s", "further")) == (8, 1) and ("no",) not in found
    assert place_of(text, ("nowhere",)) is None
