"""Files of the user's own stay as they are; tables are safe to open; pictures without their libraries are left out."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.cli.main import main
from cosserat_fenicsx.results.result import plain_text

pytestmark = pytest.mark.serial
ROOT = Path(__file__).parent.parent
SURVEY = "MD,Inc,Azi\n0,0,0\n1000,30,0\n"
WELL = """
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
POINTS = "0,0,0\n0,0,1\n0,0,2\n"


@pytest.mark.parametrize("name", ["trip_out.csv", "trip_out_contacts.csv", "depth_sweep.csv", "sub/../trip_out.csv"])
def test_a_survey_is_not_replaced(name, tmp_path, capsys):
    (tmp_path / "sub").mkdir()
    (tmp_path / name).write_text(SURVEY)
    (tmp_path / "well.toml").write_text(WELL.format(survey=name))
    assert main(["run", str(tmp_path / "well.toml"), "-o", str(tmp_path), "--no-picture"]) == 2
    assert f"{Path(name).name} would replace the file of that name" in capsys.readouterr().err
    assert (tmp_path / name).read_text() == SURVEY
    assert main(["run", str(tmp_path / "well.toml"), "-o", str(tmp_path / "out"), "--no-picture"]) == 0


@pytest.mark.parametrize("command", ["run", "buckling", "modes"])
def test_points_of_a_rod_are_not_replaced(command, tmp_path, capsys):
    name = {"run": "path.csv"}.get(command, f"{command}.csv")
    (tmp_path / name).write_text(POINTS)
    (tmp_path / "rod.toml").write_text(ROD.format(points=name))
    assert main([command, str(tmp_path / "rod.toml"), "-o", str(tmp_path)]) == 2
    assert f"{name} would replace" in capsys.readouterr().err and (tmp_path / name).read_text() == POINTS


def cells(file):
    with open(file, newline="", encoding="utf-8") as stream:
        return [cell for row in csv.reader(stream) for cell in row]


def test_texts_of_tables_are_no_formulas(tmp_path):
    for text in ("=1+2", "+1", "-1", "@SUM(1)", "\tx", "\rx"):
        assert plain_text(text) == f"'{text}"
    assert plain_text("a=b") == "a=b" and plain_text("") == ""
    (tmp_path / "s.csv").write_text(SURVEY)
    (tmp_path / "well.toml").write_text(WELL.format(survey="s.csv"))
    assert main(["run", str(tmp_path / "well.toml"), "-o", str(tmp_path / "out"), "--no-picture"]) == 0
    found = cells(tmp_path / "out" / "trip_out.csv") + cells(tmp_path / "out" / "depth_sweep.csv")
    assert "'=1+2" in found and "=1+2" not in found
    (tmp_path / "p.csv").write_text(POINTS)
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
    (tmp_path / "in.csv").write_text(SURVEY if kind == "well" else POINTS)
    text = WELL.format(survey="in.csv") if kind == "well" else ROD.format(points="in.csv")
    (tmp_path / "scene.toml").write_text(text)
    done = subprocess.run([sys.executable, "-c", WITHOUT, tmp_path / "scene.toml", tmp_path / "out"], check=False,
                          capture_output=True, encoding="utf-8", cwd=ROOT)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / table).exists() and not (tmp_path / "out" / picture).exists()
    assert table in done.stdout and picture not in done.stdout
    assert picture in done.stderr and "pip install 'cosserat-fenicsx[pictures]'" in done.stderr
