"""TOML scene files: the same scene as in Python, and error messages that name the key."""

from pathlib import Path

import numpy as np
import pytest
from conftest import column

import cosserat_fenicsx as cf

DEMO = Path(__file__).parent.parent / "demos" / "eccentric_cantilever.toml"


def test_the_file_gives_the_same_path_as_python():
    found = cf.read(DEMO)
    scene, settings = found.scene, found.settings
    rod, expected = column()
    assert scene.title and settings["tol"] == 1e-6
    a = cf.solve(scene, [0.9], elements=4).displacement(scene.rods[0].end)
    b = cf.solve(expected, [0.9], elements=4).displacement(rod.end)
    np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-12)


CHANGES = {
    "unknown key": ("diameter = 0.2", "diametre = 0.2",
                    "rods[0].section (Circle): unknown key 'diametre', did you mean 'diameter'?"),
    "unknown table": ("[[supports]]", "[[suports]]", "unknown key 'suports', did you mean 'supports'?"),
    "unknown type": ('type = "Clamp"', 'type = "Clmap"', "supports[0].type = 'Clmap'"),
    "unknown solve key": ("tol = 1e-6", "tolerance = 1e-6", "[solve]: unknown key 'tolerance', did you mean 'tol'?"),
    "type error": ("diameter = 0.2", 'diameter = "0.2"', "Circle.diameter = '0.2': expected a unit"),
    "type error in solve": ("tol = 1e-6", 'tol = "small"', "solve.tol = 'small': expected a finite number"),
    "missing key": (", diameter = 0.2", "", "'diameter' is missing"),
    "unknown station": ('station = "column.start"', 'station = "colum.start"',
                        "no rod is named 'colum', did you mean 'column'?"),
    "unknown place": ('station = "column.start"', 'station = "column.top"',
                      "expected 'rod.start', 'rod.end' or 'rod@s'"),
    "station is a number": ('station = "column.start"', "station = 3", "supports[0]: Clamp.station = 3"),
    "beyond the end": ('station = "column.start"', 'station = "column@21"', "expected an arc length in [0, 20] m"),
    "unknown material": ('material = "steel"', 'material = "steal"', "did you mean 'steel'?"),
    "no array": ("[[supports]]", "[supports]", "expected an array of tables, [[supports]]"),
    "not TOML": ("[[supports]]", "[[supports", "not valid TOML"),
    "vector": ("force = [0, 0, -101739.34535723379]", "force = [0, -1.0]",
               "Force.force = [0, -1.0]: expected 3 finite numbers (N)"),
    "title": ('title = "Eccentrically compressed cantilever"', "title = 3", "title = 3: expected a text"),
}  # fmt: skip


@pytest.mark.parametrize("case", CHANGES)
def test_refused(case, tmp_path):
    old, new, words = CHANGES[case]
    text = DEMO.read_text(encoding="utf-8")
    assert old in text
    file = tmp_path / "scene.toml"
    file.write_text(text.replace(old, new))
    with pytest.raises(cf.SceneError) as refusal:
        cf.read(file)
    assert words in str(refusal.value) and str(file) in str(refusal.value)


MOTION = f"""{DEMO.read_text(encoding="utf-8").partition("[solve]")[0]}[simulate]
duration = "1 s"
"""
WELL = """[well]
stations = [[0, 0, 0], [1000, 0, 0]]
sections = [{ to = 1000.0, diameter = "8.5 in", friction = 0.3 }]

[string]
components = [{ type = "DrillPipe", size = "5 in 19.50 lb/ft" }]

[mud]
density = "10 ppg"
"""
WELLS = WELL + """
[[operations]]
type = "TripIn"
"""
DRILLING = WELL + """
[drive]
speed = "60 rpm"
"""
FILES = {"rods": DEMO.read_text(encoding="utf-8"), "motion": MOTION, "well": WELLS, "drilling": DRILLING}
MISTAKES = [
    ("rods", 'station = "column.end"\nforce', 'sation = "column.end"\nforce',
     (21, 1, "'sation', did you mean 'station'")),
    ("rods", "diameter = 0.2", 'diameter = "0.2 psi"', (12, 30, "psi is a unit of pressure, expected one of length")),
    ("rods", "[solve]", "[solve]\n[solve]", (30, 1, "[solve] is given twice, first at line 29, column 1")),
    ("rods", "[[rods]]", "[rods]\n[[rods]]", (10, 1, "[[rods]] is given twice, first at line 9, column 1")),
    ("motion", "duration =", "durration =", (30, 1, "[simulate]: unknown key 'durration', did you mean 'duration'")),
    ("motion", '"1 s"', '"1 m"', (30, 1, "m is a unit of length, expected one of time")),
    ("motion", '"1 s"', '"1 s"\nduration = 2', (31, 1, "simulate.duration is given twice, first at line 30, column 1")),
    ("well", "friction", "fricton", (3, 49, "unknown key 'fricton', did you mean 'friction'")),
    ("well", "10 ppg", "10 psi", (9, 1, "psi is a unit of pressure, expected one of density")),
    ("well", "[mud]", "[well]\n[mud]", (8, 1, "[well] is given twice, first at line 1, column 1")),
    ("well", "to = 1000.0", "to = 1000.0, to = 1",
     (3, 28, "well.sections[0].to is given twice, first at line 3, column 15")),
    ("drilling", "speed =", "sped =", (12, 1, "drive (TopDrive): unknown key 'sped', did you mean 'speed'")),
    ("drilling", "60 rpm", "60 ft", (12, 1, "ft is a unit of length, expected one of angular velocity")),
    ("drilling", "[drive]", "[drive]\n[[drive]]", (12, 1, "[[drive]] is given twice, first at line 11, column 1")),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "old", "new", "expected"), MISTAKES)
def test_mistakes_are_refused_with_their_places(kind, old, new, expected, tmp_path):
    """An unknown key, a unit of another dimension and what is given twice, in every kind of scene file."""
    text, file = FILES[kind], tmp_path / "scene.toml"
    line, column, words = expected
    assert old in text
    file.write_text(text, encoding="utf-8")
    cf.read(file)
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(cf.SceneError) as refusal:
        cf.read(file)
    assert str(refusal.value).startswith(f"{file}, line {line}, column {column}: ") and words in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "line", "column"),
    [("[a\n", 1, 3), ("a = 1\n[a]\n[b\n", 2, 1), ("a = {}\n[a.b]\n", 2, 5), ("x = 5 m\n", 1, 7), ("[[a]]\n[a]", 2, 1)],
)
def test_what_is_no_toml_is_refused_with_its_place(text, line, column, tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(cf.SceneError) as refusal:
        cf.read(file)
    assert str(refusal.value).startswith(f"{file}, line {line}, column {column}: ")


def test_missing_file(tmp_path):
    with pytest.raises(cf.SceneError, match="nowhere.toml: cannot be read"):
        cf.read(tmp_path / "nowhere.toml")


def test_marks_and_encodings_of_editors(tmp_path):
    """A mark at the beginning of UTF-8 is skipped; other encodings are named."""
    text = DEMO.read_text(encoding="utf-8").replace("Eccentrically", "B\u00fcgel")
    (tmp_path / "marked.toml").write_text(text, encoding="utf-8-sig")
    assert cf.read(tmp_path / "marked.toml").scene.title.startswith("B\u00fcgel")
    (tmp_path / "latin.toml").write_text(text, encoding="latin-1")
    with pytest.raises(cf.SceneError, match="latin.toml: not UTF-8 .*: save it as UTF-8"):
        cf.read(tmp_path / "latin.toml")
