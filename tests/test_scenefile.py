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
