"""Tables of long paths, prescribed motions in words, and sections of scene files with an offset."""

import re

import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.results.screen import ROWS
from cosserat_fenicsx.scene.describe import actions_in_words

pytestmark = pytest.mark.serial
STIFF = cf.Stiffness((1e4, 1e4), 1e4, (10.0, 20.0), 5.0)


def arm():
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), STIFF, name="arm")
    return cf.Scene([rod], [cf.Clamp("arm.start")], [cf.Force("arm.end", (0, 0, -1.0))])


def rows_of(path):
    return re.findall(r"^[│|] *([\d.]+) [│|]", path.details(), flags=re.M)


def test_a_long_table_leaves_out_its_middle():
    path = cf.solve(arm(), [(k + 1) / 60 for k in range(60)], elements=1, degree=2)
    path.events = [cf.Event("limit", 0.5, None, after=29)]
    rows = [row for row in rows_of(path) if row.strip(".")]
    assert len(rows) == ROWS + 2 and {"0.5", "0.516667"} < set(rows) and (rows[0], rows[-1]) == ("0.0166667", "1")
    table = path.details()
    assert table.count("...") == 2 * 8  # two gaps, in every column
    assert "42 of 60 points: path.csv has all (-o DIR; path.write('path.csv') in Python)." in table
    short = path[:ROWS]
    assert len(rows_of(short)) == ROWS and "points: path.csv" not in short.details()


def test_prescribed_motions_are_told_with_the_loads():
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), STIFF, name="arm")
    scene = cf.Scene([rod], [cf.Clamp("arm.start"), cf.Prescribed("arm.end", displacement=(0, 0, 0.1))])
    assert actions_in_words(scene) == "Prescribed motions, times the load factor: Prescribed at arm.end."


SCENE = """
[[rods]]
name = "arm"
curve = { type = "Line", start = [0, 0, 0], end = [1, 0, 0] }
section = { type = "Stiffness", shear = [1e4, 1e4], axial = 1e4, bending = [10, 20], torsion = 5, GIVEN }
"""


def test_an_offset_in_a_scene_file(tmp_path):
    file = tmp_path / "arm.toml"
    file.write_text(SCENE.replace("GIVEN", "centroid = [0.01, 0], angle = 0.2, mass = 3.0"))
    (rod,) = cf.read(file).scene.rods
    assert rod.section == cf.Stiffness.offset((1e4, 1e4), 1e4, (10, 20), 5, centroid=(0.01, 0), angle=0.2, mass=3.0)
    for given, words in (
        ("centre = [0.01, 0], angle = 0.2", "unknown key 'centre', did you mean 'centroid'?"),
        ("centroid = 0.1", "rods[0].section: Stiffness.offset.centroid = 0.1: expected 2 finite numbers (m)"),
    ):
        file.write_text(SCENE.replace("GIVEN", given))
        with pytest.raises(cf.SceneError) as refusal:
            cf.read(file)
        assert words in str(refusal.value)
    file.write_text(SCENE.replace("GIVEN", "angle = 0.1").replace(" torsion = 5,", ""))
    with pytest.raises(cf.SceneError, match="'torsion' is missing"):
        cf.read(file)
