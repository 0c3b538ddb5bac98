"""Valid and invalid points of splines, from arrays and files, and all curves in scene files."""

import math

import meshio
import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.cli.explain import explain

pytestmark = pytest.mark.serial  # independent of ranks

POINTS = np.array([(0, 0, 0), (1.0, 0.2, 0.1), (1.8, 1.1, 0.7), (2.0, 2.3, 0.4)])


@pytest.mark.parametrize("header", ["", "x (m), y (m), z (m)\n", "\ufeffx,y,z\n"])
def test_csv(header, tmp_path):
    file = tmp_path / "survey.csv"
    file.write_text(header + "\n".join(",".join(map(repr, row)) for row in POINTS.tolist()) + "\n\n", encoding="utf-8")
    for name in (file, str(file)):
        assert cf.Spline(name) == cf.Spline(POINTS)


@pytest.mark.parametrize("suffix", ["vtk", "vtu", "xdmf"])
def test_mesh_files(suffix, tmp_path):
    """Line cells in any order and direction, and a point that belongs to none."""
    file = tmp_path / f"line.{suffix}"
    order = np.array([4, 1, 0, 2])  # where each point of the line is stored
    stored = np.full((5, 3), 9.0)
    stored[order] = POINTS
    meshio.write(file, meshio.Mesh(stored, [("line", order[[[2, 1], [0, 1], [3, 2]]])]))
    assert cf.Spline(file) == cf.Spline(POINTS)  # from point 4, whose line starts there


def test_quadratic_lines(tmp_path):
    file = tmp_path / "line.vtu"
    x = np.linspace(0, 1, 5)
    points = np.column_stack([x, x**2, 0 * x])
    meshio.write(file, meshio.Mesh(points, [("line3", [[0, 2, 1], [2, 4, 3]])]))
    assert cf.Spline(file) == cf.Spline(points)


def test_a_ring_from_a_file(tmp_path):
    file = tmp_path / "ring.vtk"
    meshio.write(file, meshio.Mesh(POINTS, [("line", [[0, 1], [1, 2], [2, 3], [3, 0]])]))
    assert cf.Spline(file, closed=True) == cf.Spline(POINTS, closed=True)
    with pytest.raises(cf.SceneError, match="two ends, or closed = true for this ring"):
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
    file = tmp_path / "lines.vtk"
    meshio.write(file, meshio.Mesh(np.vstack([POINTS, [[5, 5, 5]]]), cells))
    with pytest.raises(cf.SceneError) as refusal:
        cf.Spline(file)
    assert words in str(refusal.value) and "lines.vtk" in str(refusal.value)


FILES = {
    "missing.csv": (None, "expected a text file that can be read"),
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
    with pytest.raises(cf.SceneError) as refusal:
        cf.Spline(tmp_path / name)
    assert words in str(refusal.value)
    assert capfd.readouterr() == ("", "")


REFUSED = {
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


@pytest.mark.parametrize("case", REFUSED)
def test_refused_points(case):
    make, words = REFUSED[case]
    with pytest.raises(cf.SceneError) as refusal:
        make()
    assert words in str(refusal.value)


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


def read(tmp_path, curve=None, section=CIRCLE):
    (tmp_path / "scene.toml").write_text(
        SCENE.format(curve=curve or '{ type = "Line", start = [0, 0, 0], end = [8, 0, 0] }', section=section)
    )
    scene = cf.read(tmp_path / "scene.toml").scene
    return scene


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


def test_a_file_that_a_scene_misses(tmp_path):
    with pytest.raises(cf.SceneError, match=r"line 4, column 28: rods\[0\].curve: Spline.points = '.*nowhere"):
        read(tmp_path, curve='{ type = "Spline", points = "nowhere.csv" }')
    with pytest.raises(cf.SceneError, match="unknown key 'centr', did you mean 'centre'?"):
        read(tmp_path, curve='{ type = "Arc", centr = [0, 0, 0], start = [2, 0, 0], angle = 1.5 }')


def test_pieces_in_a_scene_file(tmp_path):
    thick = '{ to = 5, type = "Circle", diameter = 0.2 }'
    for last in ('{ type = "Tube", outer_diameter = 0.1, inner_diameter = 0.05 }',
                 '{ to = 8.0, type = "Tube", outer_diameter = 0.1, inner_diameter = 0.05 }'):  # fmt: skip
        scene = read(tmp_path, section=f"[{thick}, {last}]")
        rod = scene.rods[0]
        assert rod.breaks == (5.0,) and rod.section_at(6.0) == cf.Tube(0.1, 0.05)
        words = (
            "Circle (diameter 0.2 m) up to s = 5 m, then Tube (outer_diameter 0.1 m, inner_diameter 0.05 m) up to s"
            " = 8 m"
        )
        assert words in explain(scene, [1.0], {})
    EI = [210e9 * math.pi * (0.1**4 - 0.05**4) / 64, 210e9 * math.pi * 0.2**4 / 64]
    assert f"EI = {EI[0]:.4g} to {EI[1]:.4g}, " in explain(scene, [1.0], {})
    refused = {
        f"[{CIRCLE}, {CIRCLE}]": r"rods\[0\].section\[0\]: 'to' is missing",
        f"[{thick}, {{ to = 7, diameter = 0.1, type = 'Circle' }}]": (
            r"section\[1\].to = 7: expected the rod's length 8 m"
        ),
        "[]": "at least one piece",
        "[3]": r"section\[0\] = 3: expected a piece",
    }
    for section, words in refused.items():
        with pytest.raises(cf.SceneError, match=words):
            read(tmp_path, section=section)
