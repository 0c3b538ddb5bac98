"""Input that is refused in words: what is no file, names written as lists, numbers beyond sense, wrong arguments."""

import copy
import os
import pickle
import random
import subprocess
import sys
import tomllib
import warnings
import zipfile
from pathlib import Path

import pytest
from test_scene_fuzz import damaged

import cosserat_fenicsx as cf
from cosserat_fenicsx import checks
from cosserat_fenicsx.cli import drilling, well
from cosserat_fenicsx.cli.main import main
from cosserat_fenicsx.cli.options import parser
from cosserat_fenicsx.files.read import from_tables
from cosserat_fenicsx.storage.mark import mark_of

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
    "not of one column each": (
        'survey = "s.csv"\ncolumns = ["MD", ["Inc"], "Azi"]',
        "MD,Inc,Azi\n0,0,0\n1000,0,0\n",
        r"inc = \['Inc'\]: expected the name of a column",
    ),
    "a column twice": (
        'survey = "s.csv"',
        "MD,MD,Inc,Azi\n0,0,0,0\n1000,2000,10,0\n",
        "columns 1 and 2 are both named 'md'",
    ),
    "a column in two units": (
        'survey = "s.csv"',
        "MD (m),MD (ft),Inc,Azi\n0,0,0,0\n1000,3281,10,0\n",
        r"both named 'md' \(MD \(m\), MD \(ft\)\): expected one, or that columns",
    ),
    "two usual names": (
        'survey = "s.csv"',
        "Depth MD,Measured Depth,Inc,Azi\n0,0,0,0\n1,2,3,4\n",
        "no column 'md' in Depth MD, Measured Depth",
    ),
    "one column for two": (
        'survey = "s.csv"\ncolumns = ["MD", "Inc", "Inc"]',
        "MD,Inc,Azi\n0,0,0\n1000,0,0\n",
        "expected three columns, each of another name",
    ),
    "a long field": (
        'survey = "s.csv"',
        "MD,Inc,Azi," + "x" * 200_000 + "\n0,0,0,\n",
        "line 1 is no row of a .csv file",
    ),
    "a number of Python's": (
        'survey = "s.csv"',
        "MD,Inc,Azi\n0,0,0\n10_00,10,0\n",
        "line 3, '10_00,10,0': expected num",
    ),
    "an endless device": ('survey = "/dev/zero"', "", "/dev/zero: no plain file: expected a survey as .csv"),
    "a folder": ('survey = "."', "", "Is a directory"),
    "a null character": (r'survey = "s\u0000.csv"', "", "cannot be read .*null"),
    "a workbook": ('survey = "s.xlsx"', "", "s.xlsx: a workbook or another archive: .* save the sheet as .csv"),
}


@pytest.mark.parametrize("case", SURVEYS)
def test_surveys(case, tmp_path):
    survey, text, words = SURVEYS[case]
    (tmp_path / "s.csv").write_text(text, encoding="utf-8")
    with zipfile.ZipFile(tmp_path / "s.xlsx", "w") as book:
        book.writestr("sheet", "1")
    with pytest.raises(cf.SceneError, match=words):
        cf.read(written(tmp_path, survey))


def test_a_unit_says_which_of_two_columns(tmp_path):
    (tmp_path / "s.csv").write_text("MD (m),MD (ft),Inc,Azi\n0,0,0,0\n1000,3281,10,0\n", encoding="utf-8")
    for name, length in (("md (m)", 1000.0), ("MD  (FT)", 3281 * 0.3048)):
        assert cf.well.WellPath.from_csv(tmp_path / "s.csv", md=name).length == pytest.approx(length)


def test_files_of_bounded_size(tmp_path, monkeypatch):
    (tmp_path / "s.csv").write_text("MD,Inc,Azi\n" + "0,0,0\n" * 100, encoding="utf-8")
    monkeypatch.setattr(checks, "MOST_TEXT", 500)
    with pytest.raises(cf.SceneError, match=r"s.csv: larger than .* MiB: expected a survey"):
        cf.well.WellPath.from_csv(tmp_path / "s.csv")


def test_other_files_are_plain_ones_too(tmp_path):
    for read in (cf.read, lambda file: cf.Spline("/dev/zero"), cf.signals.AlongTable):
        with pytest.raises(cf.SceneError, match="/dev/zero"):
            read("/dev/zero")
    os.symlink("/dev/zero", tmp_path / "points.csv")
    with pytest.raises(cf.SceneError, match="points.csv: no plain file"):
        cf.Spline(tmp_path / "points.csv")


def test_a_whole_number_of_too_many_digits(tmp_path):
    (tmp_path / "s.toml").write_text(f"a = {'9' * 5000}\n", encoding="utf-8")
    with pytest.raises(cf.SceneError, match="s.toml: not valid TOML: .*digits"):
        cf.read(tmp_path / "s.toml")


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


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"more": 'name = ["drill pipe"], '}, r"Component.name = \['drill pipe'\]: expected a text"),
        ({"weight": 6e300}, r"Component.weight = 6e\+300: expected a number from -1e\+06 to 1e\+06 \(N/m\)"),
        ({"on_bit": 6e303}, r"TripOut.weight = 6e\+303: expected a finite number \(N\), of at most 1e\+10 N"),
        ({"on_bit": -1e11}, "of at most 1e"),
        (
            {"more": "length = 1e7, "},
            r"Component.length = 10000000.0: expected a positive number \(m\), of at most 1e\+06 m",
        ),
    ],
)
def test_wells(given, words, tmp_path, capsys):
    file = written(tmp_path, **given)
    with pytest.raises(cf.SceneError, match=words):
        cf.read(file)
    assert main(["run", file]) == 2 and capsys.readouterr().err.startswith("cosserat: ")


def test_numbers_beyond_sense():
    with pytest.raises(cf.SceneError, match=r"expected a positive number or infinity \(N\), of at most 1e\+60 N"):
        cf.Stiffness((1.0, 1.0), 1e200, (1.0, 1.0), 1.0)
    cf.Stiffness((float("inf"),) * 2, float("inf"), (1e30, 1e30), 1e30)  # rods may be in units of their own
    with pytest.raises(cf.SceneError, match=r"TopDrive.inertia = 1000000000000.0: .*, of at most 1e\+10 kg m\^2"):
        cf.drilling.TopDrive(6.0, 1e12, cf.drilling.PI(1.0, 1.0))


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


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: cf.Circle(radius=0.1), "Circle has no argument 'radius': did you mean 'diameter'"),
        (lambda: cf.solve(None, load_factor=[1.0]), "solve has no argument 'load_factor': did you mean 'load_factors'"),
        (lambda: cf.Material(E=1.0, rho=3.0), "Material has no argument 'rho': did you mean 'density'"),
        (lambda: cf.well.TripOut(wieght=3.0), "TripOut has no argument 'wieght': did you mean 'weight'"),
        (
            lambda: cf.Circle(),
            r"Circle: missing a required argument: 'diameter': expected Circle\(diameter, shear_factor=...\)",
        ),
        (lambda: cf.Circle(1.0, 2.0, 3.0), "Circle: too many positional arguments: expected"),
    ],
)
def test_arguments_that_there_are_not(call, words):
    with pytest.raises(TypeError, match=words):
        call()


def test_a_type_error_from_inside_stays():
    for read in (cf.read,):
        with pytest.raises(TypeError, match="os.PathLike object"):
            read(3)


def test_public_functions_are_those_of_their_modules():
    """For pickle, and for what a study knows a task by."""
    assert pickle.loads(pickle.dumps(cf.euler_load)) is cf.euler_load
    told = mark_of(cf.euler_load)
    assert told[": function"] == "cosserat_fenicsx.scene.rod.euler_load" and told != mark_of(cf.solve)
    assert told[": code"] == mark_of(cf.euler_load.__wrapped__)[": code"]
    again = pickle.loads(pickle.dumps(cf.Circle(0.1)))
    assert again == cf.Circle(0.1) and copy.copy(again) == again


def test_warnings_are_of_the_line_that_calls():
    for call in (
        lambda: cf.well.HoleSection(10.0, 20.0, 0.1),
        lambda: cf.well.Mud(1.2),
        lambda: cf.well.TripOut(weight=3.0),
        lambda: cf.well.Ream(0.1, 5.0),
    ):
        with pytest.warns(cf.SceneWarning) as told:
            call()
        assert [warning.filename for warning in told] == [__file__]


@pytest.mark.parametrize("seed", range(2))
def test_damaged_files_of_strings(seed):
    """Scene files of wells and of strings in motion: explained, or refused in words."""
    tables = {file: tomllib.loads(file.read_text(encoding="utf-8")) for file in sorted(DEMOS.glob("**/*.toml"))}
    kinds = [
        (drilling.explain, {file: x for file, x in tables.items() if "drive" in x}),
        (well.explain, {file: x for file, x in tables.items() if "well" in x and "drive" not in x}),
    ]
    chance, refused = random.Random(seed), 0
    commands = parser()
    for _ in range(60):
        for explain, known in kinds:
            file = chance.choice(list(known))
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                warnings.simplefilter("error", RuntimeWarning)
                try:
                    found = from_tables(damaged(known[file], chance), file.parent)
                    explain(commands.parse_args(["explain", str(file)]), found)
                except cf.SceneError as problem:
                    refused += 1
                    assert len(str(problem)) < 3000
    assert 40 < refused < 120
