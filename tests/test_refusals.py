"""Files and arguments that are refused in words: surveys, polylines, names, numbers; users' files stay."""

import copy
import csv
import math
import os
import pickle
import re
import subprocess
import sys
import tomllib
import warnings
import zipfile
from pathlib import Path

import meshio
import numpy as np
import pytest
from conftest import refused, refuses

import cosserat_fenicsx as cf
from cosserat_fenicsx import checks
from cosserat_fenicsx.cli.explain import explain
from cosserat_fenicsx.cli.main import main
from cosserat_fenicsx.results.result import plain_text
from cosserat_fenicsx.storage.mark import mark_of
from cosserat_fenicsx.drilling.scenefile import DrillingScene
from cosserat_fenicsx.parts import from_data
from cosserat_fenicsx.well.scenefile import WellScene

pytestmark = pytest.mark.serial
DEMOS = Path(__file__).parent.parent / "demos"
WELL = """
[well]
{survey}
sections = [{{ to = 1000.0, diameter = 0.2159, friction = 0.25 }}]
[string]
components = [ {{ type = "Component", {more}weight = {weight}, contact_radius = 0.0635 }} ]
[[operations]]
type = "TripOut"
weight = {on_bit}
"""
DRILLING = """
[string]
components = [
    { type = "Collar", size = "NC46-65", length = 300.0 },
    { type = "HeavyWeight", size = "5 in", length = 300.0 },
    { type = "DrillPipe", size = "5 in 19.50 lb/ft", length = 300.0 },
]
[drive]
speed = "60 rpm"
[simulate]
duration = 5.0
dt = 1.0
"""
STATIONS = "stations = [[0, 0, 0], [1000, 30, 0]]"


def written(folder, survey=STATIONS, more="", weight=241.0, on_bit=0.0):
    file = folder / "well.toml"
    file.write_text(WELL.format(survey=survey, more=more, weight=weight, on_bit=on_bit), encoding="utf-8")
    return str(file)


SURVEYS = {
    "not of one column each": ('survey = "s.csv"\ncolumns = ["MD", ["Inc"], "Azi"]', "MD,Inc,Azi\n0,0,0\n1000,0,0\n",
                               r"inc = \['Inc'\]: expected the name of a column"),
    "a column twice": ('survey = "s.csv"', "MD,MD,Inc,Azi\n0,0,0,0\n1000,2000,10,0\n",
                       "columns 1 and 2 are both named 'md'"),
    "a column in two units": ('survey = "s.csv"', "MD (m),MD (ft),Inc,Azi\n0,0,0,0\n1000,3281,10,0\n",
                              r"both named 'md' \(MD \(m\), MD \(ft\)\): expected one, or that columns"),
    "two usual names": ('survey = "s.csv"', "Depth MD,Measured Depth,Inc,Azi\n0,0,0,0\n1,2,3,4\n",
                        "no column 'md' in Depth MD, Measured Depth"),
    "one column for two": ('survey = "s.csv"\ncolumns = ["MD", "Inc", "Inc"]', "MD,Inc,Azi\n0,0,0\n1000,0,0\n",
                           "expected three columns, each of another name"),
    "a long field": ('survey = "s.csv"', "MD,Inc,Azi," + "x" * 200_000 + "\n0,0,0,\n",
                     "line 1 is no row of a .csv file"),
    "a number of Python's": ('survey = "s.csv"', "MD,Inc,Azi\n0,0,0\n10_00,10,0\n",
                             "line 3, '10_00,10,0': expected num"),
    "from the bottom up": ('survey = "s.csv"', "MD,Inc,Azi\n1000,10,0\n500,5,0\n0,0,0\n",
                           r"md\[1\] = 500.0: expected more than the station before, 1000 m, from the surface down"),
    "an endless device": ('survey = "/dev/zero"', "", "/dev/zero: no plain file: expected a survey as .csv"),
    "a folder": ('survey = "."', "", "Is a directory"),
    "a null character": (r'survey = "s\u0000.csv"', "", "cannot be read .*null"),
    "a sheet of text": ('survey = "s.csv"\nsheet = "A"', "", "sheet = 'A': expected an .xlsx file as survey"),
}  # fmt: skip


@pytest.mark.parametrize("case", SURVEYS)
def test_surveys(case, tmp_path):
    survey, text, words = SURVEYS[case]
    (tmp_path / "s.csv").write_text(text, encoding="utf-8")
    with pytest.raises(cf.SceneError, match=words):
        cf.read(written(tmp_path, survey))


def test_workbooks_that_are_refused(tmp_path, monkeypatch):
    with zipfile.ZipFile(tmp_path / "s.xlsx", "w") as book:
        book.writestr("sheet", "1")
    with pytest.raises(cf.SceneError, match=r"s.xlsx: a workbook or another archive: .* save the sheet as .csv"):
        cf.well.WellPath.from_csv(tmp_path / "s.xlsx")
    scene = written(tmp_path, 'survey = "s.xlsx"')
    with monkeypatch.context() as without:
        without.setitem(sys.modules, "openpyxl", None)
        with pytest.raises(cf.InstallationError, match=r"saved as .csv instead, needs openpyxl, .*fenicsx\[data\]"):
            cf.read(scene)
    openpyxl = pytest.importorskip("openpyxl")
    with pytest.raises(cf.SceneError, match=r"s.xlsx: expected a workbook that openpyxl reads"):
        cf.read(scene)
    book = openpyxl.Workbook()
    book.active.append(["MD", "Inc", "Azi"])
    book.active.append([0, 0, "none"])
    book.save(tmp_path / "s.xlsx")
    with pytest.raises(cf.SceneError, match=r"s.xlsx: line 2, .*expected numbers in MD, Inc, Azi"):
        cf.read(scene)
    with pytest.raises(cf.SceneError, match=r"no sheet 'Shet': did you mean 'Sheet'"):
        cf.well.WellPath.from_xlsx(tmp_path / "s.xlsx", "Shet")
    book.active.append([0, 0, 0, "x" * 30_000])  # a large text, well compressed
    book.save(tmp_path / "s.xlsx")
    for bound, words in ((20_000, "text in a sheet"), (200, "s.xlsx: larger than")):
        monkeypatch.setattr(checks, "MOST_TEXT", bound)
        with pytest.raises(cf.SceneError, match=words):
            cf.well.WellPath.from_xlsx(tmp_path / "s.xlsx")


def test_files_that_no_reader_takes(tmp_path, monkeypatch):
    """Devices, endless numbers, files of unbounded size; a unit says which of two columns is meant."""
    os.symlink("/dev/zero", tmp_path / "points.csv")
    (tmp_path / "s.toml").write_text(f"a = {'9' * 5000}\n", encoding="utf-8")
    (tmp_path / "long.csv").write_text("MD,Inc,Azi\n" + "0,0,0\n" * 100, encoding="utf-8")
    (tmp_path / "s.csv").write_text("MD (m),MD (ft),Inc,Azi\n0,0,0,0\n1000,3281,10,0\n", encoding="utf-8")
    for name, length in (("md (m)", 1000.0), ("MD  (FT)", 3281 * 0.3048)):
        assert cf.well.WellPath.from_csv(tmp_path / "s.csv", md=name).length == pytest.approx(length)
    monkeypatch.setattr(checks, "MOST_TEXT", 500)
    for read, file, words in (
        (cf.read, "/dev/zero", "/dev/zero"), (cf.Spline, "/dev/zero", "/dev/zero"),
        (cf.signals.AlongTable, "/dev/zero", "/dev/zero"),
        (cf.Spline, tmp_path / "points.csv", "points.csv': no plain file"),
        (cf.well.WellPath.from_csv, tmp_path / "long.csv", "long.csv: larger than .* MiB: expected a survey"),
    ):  # fmt: skip
        with pytest.raises(cf.SceneError, match=words):
            read(file)
    monkeypatch.undo()
    for name, words in (("a.py", "a Python program"), ("b.csv", 'points = "b.csv" of a Spline')):
        (tmp_path / name).write_text("from a\n")
        with pytest.raises(cf.SceneError, match=words):
            cf.read(tmp_path / name)
    with pytest.raises(cf.SceneError, match="s.toml: not valid TOML: .*digits"):
        cf.read(tmp_path / "s.toml")
    with pytest.raises(TypeError, match="os.PathLike object"):
        cf.read(3)


def test_too_little_memory_in_words(monkeypatch, capsys):
    def explain(options):
        raise MemoryError("Unable to allocate 153. MiB for an array")

    monkeypatch.setattr("cosserat_fenicsx.cli.main._of_a_scene", explain)
    assert main(["explain", "scene.toml"]) == 2
    assert capsys.readouterr().err.startswith("cosserat: not enough memory (Unable to allocate 153. MiB for an array)")


def test_scenes_may_come_from_a_pipe():
    """As from `cosserat explain <(make_scene)`, but not without end."""
    text = (DEMOS / "eccentric_cantilever.toml").read_text(encoding="utf-8")
    code = "import cosserat_fenicsx as cf; print(cf.read('/dev/stdin').scene.title)"
    done = subprocess.run([sys.executable, "-c", code], input=text, capture_output=True, encoding="utf-8", check=True)
    assert done.stdout.strip() == tomllib.loads(text).get("title", "")


@pytest.mark.parametrize(("given", "words"), [
    ({"more": 'name = ["drill pipe"], '}, r"Component.name = \['drill pipe'\]: expected a text"),
    ({"weight": 6e300}, r"Component.weight = 6e\+300: expected a number from -1e\+06 to 1e\+06 \(N/m\)"),
    ({"on_bit": 6e303}, r"TripOut.weight = 6e\+303: expected a finite number \(N\), of at most 1e\+10 N"),
    ({"on_bit": -1e11}, "of at most 1e"),
    ({"on_bit": '"25,000 lbs"'}, "TripOut.weight = '25,000 lbs': expected a number without commas"),
    ({"more": "length = 1e7, "},
     r"Component.length = 10000000.0: expected a positive number \(m\), of at most 1e\+06 m"),
])  # fmt: skip
def test_wells(given, words, tmp_path, capsys):
    file = written(tmp_path, **given)
    with pytest.raises(cf.SceneError, match=words):
        cf.read(file)
    assert main(["run", file]) == 2 and capsys.readouterr().err.startswith("cosserat: ")


def test_a_step_longer_than_all_parts(tmp_path, capsys):
    """Refused for the rotation in it; where the drive is slow, the string is one part of the same travel time."""
    file = tmp_path / "motion.toml"
    file.write_text(DRILLING, encoding="utf-8")
    assert main(["run", str(file)]) == 2
    assert "expected a step of at most 0.0531 s" in capsys.readouterr().err
    scene = cf.read(file).scene
    slow = cf.drilling.Drilling(scene.string, cf.drilling.TopDrive(1.0))
    coarse, fine = (cf.drilling.simulate(slow, 2.0, dt=dt, progress=False) for dt in (1.0, 1e-3))
    assert coarse.dt < 0.1 and coarse.bit_speed[-1] == pytest.approx(fine.bit_speed[-1], abs=0.5)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: cf.Circle(radius=0.1), "Circle has no argument 'radius': did you mean 'diameter'"),
    (lambda: cf.drilling.Cutting(radius=0.1), "Cutting has no argument 'radius': did you mean 'a'"),
    (lambda: cf.solve(None, load_factor=[1.0]), "solve has no argument 'load_factor': did you mean 'load_factors'"),
    (lambda: cf.Material(E=1.0, rho=3.0), "Material has no argument 'rho': did you mean 'density'"),
    (lambda: cf.well.DrillPipe(spacing=9.0), "DrillPipe has no argument 'spacing': did you mean 'joint_spacing'"),
    (lambda: cf.well.Borehole(None, None, None),
     r"arguments: expected Borehole\(path, sections, wall_stiffness=...\)"),
    (lambda: cf.well.TripOut(wieght=3.0), "TripOut has no argument 'wieght': did you mean 'weight'"),
    (lambda: cf.Circle(),
     r"Circle: missing a required argument: 'diameter': expected Circle\(diameter, shear_factor=...\)"),
    (lambda: cf.Circle(1.0, 2.0, 3.0), "Circle: too many positional arguments: expected"),
])  # fmt: skip
def test_arguments_that_there_are_not(call, words):
    with pytest.raises(TypeError, match=words):
        call()


def test_public_functions_are_those_of_their_modules():
    """For pickle, and for what a study knows a task by."""
    assert pickle.loads(pickle.dumps(cf.euler_load)) is cf.euler_load
    told = mark_of(cf.euler_load)
    assert told[": function"] == "cosserat_fenicsx.scene.rod.euler_load" and told != mark_of(cf.solve)
    assert told[": code"] == mark_of(cf.euler_load.__wrapped__)[": code"]
    again = pickle.loads(pickle.dumps(cf.Circle(0.1)))
    assert again == cf.Circle(0.1) and copy.copy(again) == again


@pytest.mark.parametrize("call", [
    lambda: cf.well.HoleSection(10.0, 20.0, 0.1), lambda: cf.well.Mud(1.2), lambda: cf.well.TripIn(weight=3.0),
    lambda: cf.well.Ream(0.1, 5.0),
])  # fmt: skip
def test_warnings_are_of_the_line_that_calls(call):
    with pytest.warns(cf.SceneWarning) as told:
        call()
    assert [warning.filename for warning in told] == [__file__]


POINTS = np.array([(0, 0, 0), (1.0, 0.2, 0.1), (1.8, 1.1, 0.7), (2.0, 2.3, 0.4)])


@pytest.mark.parametrize("header", ["", "x (m), y (m), z (m)\n", "\ufeffx,y,z\n"])
def test_csv(header, tmp_path):
    file = tmp_path / "survey.csv"
    file.write_text(header + "\n".join(",".join(map(repr, row)) for row in POINTS.tolist()) + "\n\n", encoding="utf-8")
    for name in (file, str(file)):
        assert cf.Spline(name) == cf.Spline(POINTS)


@pytest.mark.parametrize("suffix", ["vtk", "vtu", "xdmf"])
def test_mesh_files(suffix, tmp_path):
    """Line cells in any order and direction, and a point that belongs to none; of second order; a ring."""
    file = tmp_path / f"line.{suffix}"
    order = np.array([4, 1, 0, 2])  # where each point of the line is stored
    stored = np.full((5, 3), 9.0)
    stored[order] = POINTS
    meshio.write(file, meshio.Mesh(stored, [("line", order[[[2, 1], [0, 1], [3, 2]]])]))
    assert cf.Spline(file) == cf.Spline(POINTS)  # from point 4, whose line starts there
    x = np.linspace(0, 1, 5)
    points = np.column_stack([x, x**2, 0 * x])
    meshio.write(tmp_path / "quadratic.vtu", meshio.Mesh(points, [("line3", [[0, 2, 1], [2, 4, 3]])]))
    assert cf.Spline(tmp_path / "quadratic.vtu") == cf.Spline(points)
    meshio.write(file, meshio.Mesh(POINTS, [("line", [[0, 1], [1, 2], [2, 3], [3, 0]])]))
    assert cf.Spline(file, closed=True) == cf.Spline(POINTS, closed=True)
    with refused("two ends, or closed = true for this ring"):
        cf.Spline(file)


LINES = {
    "branch": ([("line", [[0, 1], [1, 2], [1, 3]])], "three or more lines meet at node 1"),
    "two pieces": ([("line", [[0, 1], [2, 3]])], "a single polyline, but its lines form several"),
    "line and ring": ([("line", [[0, 1], [2, 3], [3, 4], [4, 2]])], "a single polyline, but its lines form several"),
    "no line": ([("triangle", [[0, 1, 2]])], "a file with line cells"),
}


@pytest.mark.parametrize("case", LINES)
def test_refused_lines(case, tmp_path):
    cells, words = LINES[case]
    meshio.write(tmp_path / "lines.vtk", meshio.Mesh(np.vstack([POINTS, [[5, 5, 5]]]), cells))
    with pytest.raises(cf.SceneError, match=f"lines.vtk.*{words}"):
        cf.Spline(tmp_path / "lines.vtk")


FILES = {
    "missing.csv": (None, "missing.csv': cannot be read (No such file or directory): expected points as .csv"),
    "missing.vtk": (None, "expected a file that exists"),
    "two.csv": ("0,0,0\n1,2\n", "three numbers in line 2, which is '1,2'"),
    "words.csv": ("x,y,z\n0,0,0\na,b,c\n", "three numbers in line 3"),
    "header.csv": ("x,y,z\n", "two points or more"),
    "nan.csv": ("0,0,0\nnan,0,0\n", "Spline.points[1] = (nan, 0.0, 0.0): expected finite numbers"),
    "garbage.vtu": ("no mesh", "a mesh file that meshio reads"),
    "garbage.vtk": ("no mesh", "a mesh file that meshio reads"),
    "line.unheardof": ("0,0,0", "a mesh file that meshio reads"),
}


@pytest.mark.parametrize("name", FILES)
def test_refused_files(name, tmp_path, capfd):
    text, words = FILES[name]
    if text is not None:
        (tmp_path / name).write_text(text)
    with refused(words):
        cf.Spline(tmp_path / name)
    assert capfd.readouterr() == ("", "")


REFUSED = {
    "a stiffness beyond sense": (lambda: cf.Stiffness((1.0, 1.0), 1e200, (1.0, 1.0), 1.0),
                                 "expected a positive number or infinity (N), of at most 1e+60 N"),
    "an inertia beyond sense": (lambda: cf.drilling.TopDrive(6.0, 1e12, cf.drilling.PI(1.0, 1.0)),
                                "TopDrive.inertia = 1000000000000.0: expected"),
    "its bound": (lambda: cf.drilling.TopDrive(6.0, 1e12, cf.drilling.PI(1.0, 1.0)), ", of at most 1e+10 kg m^2"),
    "spline of one point": (lambda: cf.Spline([(0, 0, 0)]), "expected two points or more"),
    "spline of no point": (lambda: cf.Spline([]), "expected points of three numbers"),
    "spline in a plane": (lambda: cf.Spline([(0, 0), (1, 1)]), "expected points of three numbers"),
    "spline of ragged points": (lambda: cf.Spline([(0, 0, 0), (1, 1)]), "expected points of three numbers"),
    "spline of words": (lambda: cf.Spline([("a", "b", "c")]), "expected points of three numbers"),
    "spline of a number": (lambda: cf.Spline(3.0), "expected points of three numbers"),
    "spline, NaN": (lambda: cf.Spline([(0, 0, 0), (1, math.nan, 0)]),
                    "Spline.points[1] = (1.0, nan, 0.0): expected finite numbers"),
    "spline, nearly": (lambda: cf.Spline([(0, 0, 0), (1, 0, 0), (1 + 1e-9, 0, 0), (2, 0, 1)]),
                       "Spline.points[2] = (1.000000001, 0.0, 0.0): expected a point apart"),
    "spline, repeated": (lambda: cf.Spline([(0, 0, 0), (1, 1, 0), (1, 1, 0)]),
                         "Spline.points[2] = (1.0, 1.0, 0.0): expected a point apart"),
    "spline, one point twice": (lambda: cf.Spline([(1, 1, 0), (1, 1, 0)], closed=False), "Spline.points[1]"),
    "closed spline of two": (lambda: cf.Spline([(0, 0, 0), (1, 0, 0), (0, 0, 0)], closed=True),
                             "expected three points or more"),
    "spline that turns back": (lambda: cf.Spline([(0, 0, 0), (1, 0, 0), (0, 0, 0)]), "a cusp at (1, 0, 0) m"),
    "spline that turns back inside": (lambda: cf.Spline([(0, 0, 0), (1, 0, 0), (0.4, 0, 0)]), "a cusp at (1."),
    "closed and flat": (lambda: cf.Spline([(0, 0, 0), (1, 0, 0), (3, 0, 0)], closed=True), "a cusp"),
    "spline, d1": (lambda: cf.Spline([(0, 0, 0), (1, 0, 0)], d1=(1, 0, 0)), "Spline.d1"),
    "spline, closed": (lambda: cf.Spline(POINTS, closed="yes"), "Spline.closed = 'yes'"),
}  # fmt: skip


test_refused_points = refuses(REFUSED)


SCENE = """
[[rods]]
name = "rod"
curve = {curve}
section = {section}
material = {{ E = 210e9, density = 7850 }}
[[supports]]
type = "Clamp"
station = "rod.start"
[[loads]]
type = "Weight"
"""
CIRCLE = '{ type = "Circle", diameter = 0.2 }'


def read(tmp_path, curve='{ type = "Line", start = [0, 0, 0], end = [8, 0, 0] }', section=CIRCLE):
    (tmp_path / "scene.toml").write_text(SCENE.format(curve=curve, section=section))
    return cf.read(tmp_path / "scene.toml").scene


TABLES = {
    '{ type = "Arc", centre = [0, 0, 0], start = [2, 0, 0], angle = 1.5, axis = [0, 1, 0] }':
        (cf.Arc((0, 0, 0), (2, 0, 0), 1.5, axis=(0, 1, 0)), "Arc (1.5 rad), length 3 m"),
    '{ type = "Helix", centre = [0, 0, 0], start = [2, 0, 0], turns = -3, pitch = 0.5 }':
        (cf.Helix((0, 0, 0), (2, 0, 0), -3, 0.5), "Helix (-3 turns), length"),
    '{ type = "UniformCurvature", length = 3, curvature = [0, 0.5, 0], frame = [0, 1, 0, 0] }':
        (cf.UniformCurvature(3, (0, 0.5, 0), frame=(0, 1, 0, 0)), "UniformCurvature (0, 0.5, 0 1/m), length 3 m"),
    '{ type = "Spline", points = [[0, 0, 0], [1, 0, 0], [1, 1, 1.5]], closed = true }':
        (cf.Spline([(0, 0, 0), (1, 0, 0), (1, 1, 1.5)], closed=True), "closed Spline through 3 points"),
    '{ type = "Spline", points = "lines/survey.csv" }': (cf.Spline(POINTS), "Spline through 4 points"),
}  # fmt: skip


@pytest.mark.parametrize("table", TABLES)
def test_curves_in_a_scene_file(table, tmp_path):
    (tmp_path / "lines").mkdir()
    np.savetxt(tmp_path / "lines" / "survey.csv", POINTS, delimiter=",", header="x,y,z", comments="")
    expected, words = TABLES[table]
    scene = read(tmp_path, curve=table)
    assert scene.rods[0].curve == expected
    assert words in explain(scene, [1.0], {})


def test_pieces_in_a_scene_file(tmp_path):
    thick = '{ to = 5, type = "Circle", diameter = 0.2 }'
    for last in ('{ type = "Tube", outer_diameter = 0.1, inner_diameter = 0.05 }',
                 '{ to = 8.0, type = "Tube", outer_diameter = 0.1, inner_diameter = 0.05 }'):  # fmt: skip
        scene = read(tmp_path, section=f"[{thick}, {last}]")
        rod = scene.rods[0]
        assert rod.breaks == (5.0,) and rod.section_at(6.0) == cf.Tube(0.1, 0.05)
        assert ("Circle (diameter 0.2 m) up to s = 5 m, then Tube (outer_diameter 0.1 m, inner_diameter 0.05 m) up to "
                "s = 8 m") in explain(scene, [1.0], {})  # fmt: skip
    cf.Stiffness((float("inf"),) * 2, float("inf"), (1e30, 1e30), 1e30)  # rods may be in units of their own
    EI = [210e9 * math.pi * (0.1**4 - 0.05**4) / 64, 210e9 * math.pi * 0.2**4 / 64]
    assert f"EI = {EI[0]:.4g} to {EI[1]:.4g}, " in explain(scene, [1.0], {})
    for section, words in {
        f"[{CIRCLE}, {CIRCLE}]": r"rods\[0\].section\[0\]: 'to' is missing",
        f"[{thick}, {{to = 7, type = 'Circle', diameter = 1 }}]": r"section\[1\].to = 7: expected the rod's length 8 m",
        "[]": "at least one piece",
        "[3]": r"section\[0\] = 3: expected a piece",
    }.items():
        with pytest.raises(cf.SceneError, match=words):
            read(tmp_path, section=section)
    for curve, words in (
        ('{ type = "Spline", points = "nowhere.csv" }',
         r"line 4, column 28: rods\[0\].curve: Spline.points = '.*nowhere"),
        ('{ type = "Arc", centr = [0, 0, 0], start = [2, 0, 0], angle = 1.5 }',
         "unknown key 'centr', did you mean 'centre'?"),
    ):  # fmt: skip
        with pytest.raises(cf.SceneError, match=words):
            read(tmp_path, curve=curve)


ROOT = Path(__file__).parent.parent
SURVEY = "MD,Inc,Azi\n0,0,0\n1000,30,0\n"
USERS_WELL = """
[well]
survey = "{survey}"
sections = [{{ to = 1000.0, diameter = 0.2159, friction = 0.25 }}]
[string]
components = [
    {{ type = "Component", name = "=1+2", length = 10.0, weight = 241.0, contact_radius = 0.0635 }},
    {{ type = "Component", name = "pipe", weight = 241.0, contact_radius = 0.0635 }},
]
[[operations]]
type = "TripOut"
[torque_and_drag]
model = "soft"
[depth_sweep]
depths = [900.0, 1000.0]
"""
ROD = """
[[rods]]
name = "=rod"
curve = {{ type = "Spline", points = "{points}" }}
section = {{ type = "Circle", diameter = 0.1 }}
material = {{ E = 1e9, nu = 0.3 }}
[[supports]]
type = "Clamp"
station = "=rod.start"
[[loads]]
type = "Force"
station = "=rod.end"
force = [0, -1.0, 0]
[solve]
load_factors = [1.0]
elements = 2
degree = 2
"""
USERS_POINTS = "0,0,0\n0,0,1\n0,0,2\n"


@pytest.mark.parametrize("name", ["trip_out.csv", "trip_out_contacts.csv", "depth_sweep.csv", "sub/../trip_out.csv"])
def test_a_survey_is_not_replaced(name, tmp_path, capsys):
    (tmp_path / "sub").mkdir()
    (tmp_path / name).write_text(SURVEY)
    (tmp_path / "well.toml").write_text(USERS_WELL.format(survey=name))
    assert main(["run", str(tmp_path / "well.toml"), "-o", str(tmp_path), "--no-picture"]) == 2
    assert f"{Path(name).name} would replace the file of that name" in capsys.readouterr().err
    assert (tmp_path / name).read_text() == SURVEY
    assert main(["run", str(tmp_path / "well.toml"), "-o", str(tmp_path / "out"), "--no-picture"]) == 0


@pytest.mark.parametrize("command", ["run", "buckling", "modes"])
def test_points_of_a_rod_are_not_replaced(command, tmp_path, capsys):
    name = {"run": "path.csv"}.get(command, f"{command}.csv")
    (tmp_path / name).write_text(USERS_POINTS)
    (tmp_path / "rod.toml").write_text(ROD.format(points=name))
    assert main([command, str(tmp_path / "rod.toml"), "-o", str(tmp_path)]) == 2
    assert f"{name} would replace" in capsys.readouterr().err and (tmp_path / name).read_text() == USERS_POINTS


def cells(file):
    with open(file, newline="", encoding="utf-8") as stream:
        return [cell for row in csv.reader(stream) for cell in row]


def test_texts_of_tables_are_no_formulas(tmp_path):
    for text in ("=1+2", "+1", "-1", "@SUM(1)", "\tx", "\rx"):
        assert plain_text(text) == f"'{text}"
    assert plain_text("a=b") == "a=b" and plain_text("") == ""
    (tmp_path / "s.csv").write_text(SURVEY)
    (tmp_path / "well.toml").write_text(USERS_WELL.format(survey="s.csv"))
    assert main(["run", str(tmp_path / "well.toml"), "-o", str(tmp_path / "out"), "--no-picture"]) == 0
    found = cells(tmp_path / "out" / "trip_out.csv") + cells(tmp_path / "out" / "depth_sweep.csv")
    assert "'=1+2" in found and "=1+2" not in found
    (tmp_path / "p.csv").write_text(USERS_POINTS)
    (tmp_path / "rod.toml").write_text(ROD.format(points="p.csv"))
    assert main(["run", str(tmp_path / "rod.toml"), "-o", str(tmp_path / "out"), "--no-picture"]) == 0
    headings = cells(tmp_path / "out" / "path.csv")
    assert any(cell.startswith("-") for cell in headings)  # numbers stay as they are
    assert any(cell.startswith("'=rod.end displacement") for cell in headings)
    cf.read_path(tmp_path / "out" / "result.h5").write(tmp_path / "out" / "along.csv", 0)
    assert cells(tmp_path / "out" / "along.csv").count("'=rod") == 5


WITHOUT = """
import sys
for name in ("matplotlib", "pyvista"):
    sys.modules[name] = None
from cosserat_fenicsx.cli.main import main
sys.exit(main(["run", sys.argv[1], "-o", sys.argv[2]]))
"""


@pytest.mark.parametrize(("kind", "table", "picture"), [("well", "trip_out.csv", "trip_out_3d.png"),
                                                        ("rod", "path.csv", "rods.png")])  # fmt: skip
def test_pictures_without_their_libraries_are_left_out(kind, table, picture, tmp_path):
    (tmp_path / "in.csv").write_text(SURVEY if kind == "well" else USERS_POINTS)
    text = USERS_WELL.format(survey="in.csv") if kind == "well" else ROD.format(points="in.csv")
    (tmp_path / "scene.toml").write_text(text)
    done = subprocess.run([sys.executable, "-c", WITHOUT, tmp_path / "scene.toml", tmp_path / "out"], check=False,
                          capture_output=True, encoding="utf-8", cwd=ROOT)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / table).exists() and not (tmp_path / "out" / picture).exists()
    assert table in done.stdout and picture not in done.stdout
    assert picture in done.stderr and "pip install 'cosserat-fenicsx[pictures]'" in done.stderr


@pytest.mark.parametrize(("file", "old", "new", "line"), [
    ("wells/volve_f12", "length = 90.0", "length = 9000.0", r"\[string\].*: DrillString: collar reaches"),
    ("wells/volve_f12", '"Bit", diameter = "8.5 in"', '"Bit", diameter = 0.45', r"\[string\].*: bit: "),
    ("wells/volve_f12", "friction = [0.1, 0.2, 0.3]", "friction = [[0.1]]", "friction = .*: Borehole.friction = "),
    ("wells/volve_f12", 'model = "soft"', 'model = "sift"', r"\[depth_sweep\].*: torque_and_drag.model = 'sift'"),
    ("wells/assembly", 'model = "rod"', "depth = 900.0", "depth = .*: torque_and_drag: depth = 900 m"),
    ("strings/stick_slip", "[simulate]", "[wall_friction]\nstatic = 1\n[simulate]", r"\[wall.*: Drilling.friction = "),
    ("strings/stick_slip", "[simulate]", "[simulate]\nsave_every = 300.0", "save_every = .*: simulate.save_every = "),
    ("strings/four_discs", "[simulate]", "[mud]\ndensity = 1e3\n[simulate]", r"\[mud\].*: Drilling.mud = "),
    ("tripod", 'second = "three.end"', 'second = "three.start"', "second.*: Joint of one.end"),
    ("tripod", 'station = "three.start"', 'station = "one.start"', "Hinge.*: Scene: supports"),
    ("tripod", "[solve]", "[[loads]]\ntype = 'Force'\nstation = 'four.end'\nforce = [1, 0, 0]\n[solve]",
     "four.*: Scene.loads.2..station = 'four.end'"),
])  # fmt: skip
def test_errors_of_a_whole_scene_have_the_line_of_their_table(tmp_path, file, old, new, line):
    """The line that the message gives, or one of the two after it, has the words that the message is about."""
    text = (DEMOS / f"{file}.toml").read_text(encoding="utf-8")
    assert text.count(old) == 1
    text = text.replace(old, new).replace('survey = "', f'survey = "{DEMOS / "wells"}/')
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    with pytest.raises(cf.SceneError, match=r"scene\.toml, line \d+, column 1: ") as refused:
        cf.read(tmp_path / "scene.toml")
    number = int(re.search(r"line (\d+)", str(refused.value))[1])
    here, message = " ".join(text.splitlines()[number - 1 : number + 2]), str(refused.value).partition("column 1")[2]
    assert re.search(line, f"{here} {message}"), (here, message)


@pytest.mark.once
def test_depths_and_frictions_that_are_probably_in_other_units_are_told_as_typed(tmp_path):
    path = cf.well.WellPath.from_survey(["0 ft", "10000 ft"], [0, 0], [0, 0])
    hole = cf.well.Borehole(path, cf.well.HoleSection("10000 ft", "8.5 in", 0.2))
    string = cf.well.DrillString([cf.well.Component(weight=241.13, contact_radius=0.0635)])
    ends = r"expected a measured depth in the hole, which ends at 10000 ft \(survey 10000 ft, sections 10000 ft\)"
    for depth, words in (
        (9000, r"9000 m \(29528 ft\): {}; if these are feet, write '9000 ft'$"),
        (40000, r"40000 m \(131234 ft\): {}$"),
        ("11000 ft", "11000 ft: {}$"),
    ):
        with pytest.raises(cf.SceneError, match="^torque_and_drag: depth = " + words.format(ends)):
            cf.well.torque_and_drag(hole, string, cf.well.TripOut(), depth=depth)
    with pytest.raises(cf.SceneError, match=r"^depth_sweep: depths\[3\] = 10000 m \(32808 ft\): .*write '10000 ft'$"):
        cf.well.depth_sweep(hole, string, [cf.well.TripOut()], range(1000, 10001, 3000))
    words = r"to = 10000 ft: expected more than 6000 m \(19685 ft\), the section above; if .* feet, write '6000 ft'$"
    with pytest.raises(cf.SceneError, match=words):
        cf.well.Borehole(path, [cf.well.HoleSection(to, "8.5 in", 0.2) for to in (6000, "10000 ft")])
    volve = DEMOS / "wells" / "volve_f12.toml"
    text = volve.read_text(encoding="utf-8").replace("to = 3438.0, count", "to = 11000, count")
    (tmp_path / "well.toml").write_text(text, encoding="utf-8")
    (tmp_path / "volve_f12.csv").write_bytes(volve.with_suffix(".csv").read_bytes())
    words = r"line \d+, column \d+: depth_sweep: depths\[19\] = 11000 m: .*write '11000 ft'$"
    with pytest.raises(cf.SceneError, match=words):
        cf.read(tmp_path / "well.toml")
    words = "coefficient of friction from 0 to 5, in the section that ends at 10000 ft; 25 percent are 0.25$"
    with pytest.raises(cf.SceneError, match=words):
        cf.well.HoleSection("10000 ft", "8.5 in", 25)
    with pytest.raises(cf.SceneError, match=words):
        hole.with_friction(25)


def test_names_of_the_trade_and_sizes_lead_to_those_known():
    for name, other in (("Stabilizer", "Stabiliser"), ("HWDP", "HeavyWeight")):
        with pytest.raises(AttributeError, match=f"no attribute '{name}': did you mean '{other}'"):
            getattr(cf.well, name)
    with pytest.raises(cf.SceneError, match="size = '6 3/4 in': known of this diameter: NC50-67;"):
        cf.well.Collar(90, "6 3/4 in")
    with pytest.raises(cf.SceneError, match=r"NC46-65 \(6.5 x 2.812 in\)"):
        cf.well.Collar(90, "XX")
    with pytest.raises(cf.SceneError, match="tool_face = 'high': expected an angle .degrees, 0 the high side"):
        cf.well.Collar(30, "NC46-65", bend=1.5, bend_at=2, tool_face="high")


PIPE = cf.well.DrillPipe(size="5 in 19.50 lb/ft")


@pytest.mark.parametrize(("make", "words"), [
    (lambda: cf.well.DrillPipe(size="5 in 19.50 lb/ft", mass=19.5), "less than its body weighs.*19.5 lb/ft are '19.5"),
    (lambda: cf.well.Ream(60, 60), "Ream.speed = 60 m/s is faster than blocks move"),
    (lambda: cf.well.DrillString([PIPE, cf.well.Bit(0.2)], order="top down"), ""),
    (lambda: cf.well.DrillString([cf.well.Collar(9.0, "NC46-65"), cf.well.Bit(0.2), PIPE]), "component 2 from below"),
    (lambda: cf.well.DrillString([cf.well.Bit(0.2), cf.well.Bit(0.2), PIPE]), "2 bits, of 3 components"),
    (lambda: cf.well.RotaryDrilling("25 klbf", "4000 kft-lbf"), "more than any drill pipe carries"),
    (lambda: cf.well.RotaryDrilling("25 klbf", "-4 kft-lbf"), "torque = -5423.27 N m drives the string"),
    (lambda: cf.well.RotaryDrilling("-25 klbf", 5e3), "expected it positive"),
    (lambda: cf.well.TripOut(weight="25 klbf"), "expected it negative, a pull"),
    (lambda: cf.well.Sliding("25 klbf", "4 kft-lbf"), ""), (lambda: cf.well.TripIn(weight="25 klbf"), ""),
    (lambda: cf.well.HoleSection(900.0, "9 5/8 in", 0.2, "casing"), "the outer diameter of casing.*casing='9 5/8 in"),
    (lambda: cf.well.HoleSection(900.0, "9 5/8 in", 0.2, "open hole"), ""),
    (lambda: cf.well.HoleSection(900.0, 216, 0.2), "is it in mm. 216 mm are '216 mm', or 0.216"),
    (lambda: cf.well.Mud(1200.0, flow_inside=3500), "3500 psi are '3500 psi'"),
    (lambda: cf.well.Centraliser(400, 0.2), "400 in are '400 in'"),
    (lambda: cf.drilling.Stribeck(0.8, 0.5, 3.0, radius=4.25), "Stribeck.radius = 4.25 m is wider than holes are"),
    (lambda: cf.well.WellPath.from_survey([0, 900, 2000], [130, 130, 150], [0, 0, 60]), "climbs .*swapped"),
    (lambda: cf.well.WellPath.from_survey([0, 900], [70, 112], [0, 0]), ""),  # a crossing under a river
])  # fmt: skip
def test_what_is_probably_a_mistake_is_asked_about(make, words):
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        make()
    assert len(told) == bool(words) and all(re.search(words, str(x.message)) for x in told)


@pytest.mark.parametrize(("make", "words"), [
    (lambda: cf.well.DrillPipe(size="5 7/8 in 23.40 lb/ft"), "nearest ones .*5 1/2 in .*6 5/8 in .*inner_diameter may"),
    (lambda: cf.drilling.Stribeck("6 kft-lbf", 0.5, 3.0, radius=0.1), "static = '6 kft-lbf': expected a coefficient"),
    (lambda: from_data(cf.well.Borehole, {"sections": [{"to": 9.0, "diameter": 0.2, "friction": 0.2}]}),
     "expected either survey, .* or stations"),
    (lambda: from_data(cf.well.DrillString, {"components": [{"type": "Jar"}]}), "did you mean 'Collar'"),
    (lambda: DrillingScene(cf.drilling.TopDrive(6.0), discs=cf.drilling.Discs((9.0, 2.0), (7.0,))).run(), "is asked"),
])  # fmt: skip
def test_refusals_say_what_to_do(make, words):
    with pytest.raises(cf.SceneError, match=words):
        make()


@pytest.mark.parametrize(("tvd", "asked"), [("2653.99", False), ("", False), ("2900", True)])
def test_vertical_depths_of_a_survey_are_compared(tvd, asked, tmp_path):
    file = tmp_path / "survey.csv"
    file.write_text(f"MD (ft),Inc (deg),Azi (deg),TVD (ft)\n0,0,0,0\n1000,0,0,1000\n3000,60,0,{tvd}\n")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        cf.well.WellPath.from_csv(file)
    assert ["differs by 246.01 ft" in str(x.message) for x in told] == [True] * asked


def test_a_survey_and_lengths_that_are_doubtful():
    with pytest.warns(cf.SceneWarning, match="turns by 34 degrees per 100 ft between md = 1000 and 1100 ft"):
        path = cf.well.WellPath.from_survey([0, 1000, 1100, 3000], [0, 0, 34, 34], [0] * 4, length_unit="ft")
    hole = cf.well.Borehole(path, cf.well.HoleSection("3000 ft", "8.5 in", 0.2))
    for length, asked in ((90.0, True), ("90.5 ft", False), ("29.25 ft", False)):
        string = cf.well.DrillString([cf.well.Collar(length, "NC46-65"), cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            WellScene(hole, string, (cf.well.TripOut(),), cf.well.Mud("10 ppg"))
        assert ["write '90 ft'" in str(x.message) for x in told] == [True] * asked
