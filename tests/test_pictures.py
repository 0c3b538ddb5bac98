"""Pictures: what is drawn where, labels, shapes of modes, films, the interactive file."""

import csv
import itertools
import pickle
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import COMM, column, refused
from test_requests import Terminal

import cosserat_fenicsx as cf
from cosserat_fenicsx import interrupts, progress
from cosserat_fenicsx.cli import main as cli
from cosserat_fenicsx.pictures.charts import asked
from cosserat_fenicsx.pictures.drawing import (
    colour_of,
    default_colour,
    known,
    peak_of,
    quantity,
    seen,
    thickening,
    too_small,
)
from cosserat_fenicsx.pictures.plot import _spread, tangled
from cosserat_fenicsx.pictures.shapes import Drawn
from cosserat_fenicsx.pictures.signs import Resting, has_sign, loads_of, signs_of, without_sign
from cosserat_fenicsx.pictures.view import Labels, View, _width, axes_of, seen_moving, view_of

STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)


@pytest.fixture(scope="module")
def solved():
    return cf.solve(column()[1], [0.3, 0.9, 1.5], elements=4)


def values(path, name, k=2):
    return colour_of(name, known(path)).of(path.fields(k))


def test_colours_are_the_fields(solved):
    P, fields = cf.euler_load(solved.scene.rods[0]), solved.fields(2)
    np.testing.assert_allclose(values(solved, "n.z"), -1.5 * P, rtol=1e-6)
    np.testing.assert_allclose(values(solved, "n"), 1.5 * P, rtol=1e-6)
    for name in ("n.3", "tension"):
        np.testing.assert_allclose(values(solved, name), -1.5 * P * fields["d3"][:, 2], rtol=1e-6)
    np.testing.assert_allclose(values(solved, "shear_force"), 1.5 * P * np.abs(fields["d3"][:, 0]), atol=1e-6 * P)
    np.testing.assert_allclose(values(solved, "curvature.2"), fields["curvature"][:, 1])
    assert peak_of(solved, colour_of("m.3"), [values(solved, "m.3")]) == 0, "rounding has no colour"


def bars(section, force, *, length=10.0, supports=cf.Clamp):
    """Two parallel rods, clamped at their starts, with a force on each end, at its load factor 1."""
    rods = [cf.Rod(cf.Line((0, y, 0), (length, y, 0)), section, STEEL, name=f"r{y}") for y in (0, 1)]
    return cf.solve(
        cf.Scene(rods, [supports(rod.start) for rod in rods], [cf.Force(rod.end, force) for rod in rods]),
        [0.0, 1.0], elements=8,
    )  # fmt: skip


@pytest.mark.serial
def test_what_matters_colours_the_rods(solved):
    """Euler's load is the bound between regimes of a beam; a cable is at 100/pi^2 = 10.1 times pi^2 EI/L^2."""
    thin, EI = cf.Circle(0.01), 210e9 * np.pi * 0.01**4 / 64
    assert default_colour(solved, [0, 1, 2]) == "bending_moment"
    for share, name in ((0.9, "bending_moment"), (1.1, "tension")):
        N = share * EI / 0.1**2 / 10.0**2
        assert default_colour(bars(thin, (N, 0, 0.02 * N)), [0, 1]) == name, "the energy of bending is larger in both"
    assert default_colour(bars(cf.Circle(0.2), (-1e4, 0, 0)), [1]) == "tension", "a strut: all energy is axial"
    pressed = bars(cf.Circle(0.2), (-1e5, 0, 300.0))  # a fifth of the energy is that of bending
    assert default_colour(pressed, [0, 1]) == "tension" and default_colour(pressed, [1]) == "bending_moment"
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), thin, STEEL)
    twisted = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Moment(rod.end, (1.0, 0.5, 0))])
    path = cf.solve(twisted, [0.0, 0.1], elements=4)
    assert default_colour(path, [0, 1]) == "twisting_moment" and default_colour(path, [0]) == "bending_moment"


@pytest.mark.serial
def test_the_colour_bar_names_its_field(solved):
    """Tension alone is coloured from zero; an unknown name lists those that there are."""
    for asked_for, said in ((None, "bending moment (MN m)"), ("tension", "tension (kN)"), ("strain.3", "stretch")):
        plotter = solved.plot(color=asked_for)
        (title,) = plotter.scalar_bars.keys()
        plotter.close()
        assert " ".join(title.split()) == said
    tension = colour_of("tension")
    for array, signed in (([0.0, 3.0], False), ([-1e-9, 3.0], False), ([-0.1, 3.0], True), ([-3.0, -1.0], True)):
        assert seen(tension, [np.array(array)], 3.0).signed == signed
    assert seen(tension, [np.zeros(2)], 0.0).signed and not seen(colour_of("shear_force"), [np.ones(2)], 1.0).signed
    for more, words in (({"color": "bendng_moment"}, "plot.color = 'bendng_moment'.* shear_force, displacement"),
                        ({"color": "bendng_moment"}, "did you mean 'bending_moment'?"),
                        ({"color": "velocity"}, "'velocity'"), ({"units": "metric"}, "units")):  # fmt: skip
        with pytest.raises(cf.SceneError, match=words):
            solved.plot(**more)


@pytest.mark.serial
def test_tangled_shapes_stand_side_by_side():
    """A spring and its pulled shape cover disjoint columns of the picture, and its axes belong to the first."""
    spring = cf.Rod(cf.Helix((0, 0, 0), (0.05, 0, 0), turns=4, pitch=0.02), cf.Circle(0.004), STEEL)
    scene = cf.Scene([spring], [cf.Clamp(spring.start)], [cf.Force(spring.end, (0, 0, 5.0))])
    path = cf.solve(scene, [0.0, 1.0], elements=32)
    lines = [[path.centreline(k)] for k in (0, 1)]
    _, right, above, _ = view_of(np.ptp(np.concatenate([line for (line,) in lines]), axis=0))
    assert tangled(lines, right, above) and not tangled(lines[:1], right, above)
    assert not tangled([lines[0], [lines[1][0] + 0.2 * right]], right, above)
    for wish, gap in ((None, True), (False, False)):
        image, _ = drawn(path.plot(side_by_side=wish))
        coloured = (np.ptp(image[150:800, 250:1080], axis=2) > 60).any(axis=0)
        first, last = np.flatnonzero(coloured)[[0, -1]]
        assert (not coloured[first:last].all()) == gap


@pytest.mark.serial
def test_few_points_are_all_drawn_and_the_end_of_every_stage():
    rod, scene = column()
    assert _spread(cf.solve(scene, [0.5, 0.9, 1.0, 1.5], elements=2), 5) == [0, 1, 2, 3]
    snow, wind = cf.Force(rod.end, (0, 0, -1.0)), cf.Force(rod.end, (1e3, 0, 0))
    scene = cf.Scene([rod], scene.supports, [cf.Weight()], stages=[cf.Stage([snow]), cf.Stage([wind], name="wind")])
    path = cf.solve(scene, elements=2)
    ends = [k for k in range(len(path)) if path.load_factors[k] == 1]
    assert len(path) > 9 and {*ends} < {*_spread(path, 5)} and len(_spread(path, 5)) <= 5
    assert _spread(path, 2) == [ends[0], ends[2]] and _spread(path, 1) == ends[2:]


@pytest.mark.serial
def test_signs_of_a_flat_section_have_its_mean_width():
    deck = [cf.Rod(cf.Line((x, 0, 0), (x + 10, 0, 0)), cf.Rectangle(1.2, 0.1), STEEL, name=f"x{x}") for x in (0, 10)]
    joint = cf.Joint(deck[0].end, deck[1].start, (0, 1, 0))
    scene = cf.Scene(deck, [cf.Clamp(deck[0].start), cf.Hinge(deck[1].end, (0, 1, 0))], [], [joint])
    shape, everywhere = Resting(dict.fromkeys(deck, np.hypot(0.6, 0.05))), np.array([[0.0, 0, 0], [20, 0, 0]])
    symbols = signs_of(pytest.importorskip("pyvista"), scene, [shape], everywhere, np.array([20.0, 20, 20]))
    across = np.ptp(np.concatenate([mesh.points for mesh in symbols._meshes["released joints"]]), axis=0)
    mean = np.sqrt(1.2 * 0.1)
    assert across == pytest.approx([1.7 * mean, 0.9 * 0.048 * 20, 1.7 * mean], rel=0.01)


@pytest.mark.serial
def test_labels_have_room_for_their_letters():
    """A stage that has ended is called by its name alone."""
    vtk = pytest.importorskip("vtk")
    font, box = vtk.vtkTextProperty(), [0, 0, 0, 0]
    font.SetFontSize(100)
    font.SetFontFamilyToArial()
    for text in ("erection", "snow on one side", "maintenance crane", "wind: 0.65", "150 N/m", "WIND QUICK JIB (10)"):
        vtk.vtkTextRenderer.GetInstance().GetBoundingBox(font, text, box, 72)
        assert 0.85 < (box[1] - box[0]) / (100 * _width(text)) < 1.0, text
    rod = column()[0]
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [], stages=[cf.Stage([cf.Weight()], name="snow")])
    path = cf.solve(scene, elements=2)
    assert [path.label(k) for k in (-3, -1)] == ["snow: 0.3", "snow"]


@pytest.mark.serial
def test_ticks_are_round_and_free_of_rounding():
    """In the units that are asked for."""

    def texts(low, high):
        points = np.array([[low, -1e-17, 0.0], [high, 1e-17, 0.0]])
        x, y, _ = axes_of(points)
        assert y.ticks == ()
        return x.name, [text for _, text in x.ticks]

    assert texts(-0.3, 0.3) == ("x (m)", ["-0.3", "-0.2", "-0.1", "0.0", "0.1", "0.2", "0.3"])
    assert texts(0.0, 1e-6) == ("x (µm)", ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"])
    assert texts(1e6, 1e6 + 10) == ("x (m)", ["1000000", "1000002", "1000004", "1000006", "1000008", "1000010"])
    assert texts(0, 4e5) == ("x (km)", ["0", "100", "200", "300", "400"])
    assert quantity(3.04e-16, "N m") == "304 aN m" and quantity(1e3, "N") == "1 kN"
    assert quantity(0.02, "1/m") == "0.02 1/m" and quantity(4448.2216, "N") == "4.45 kN"
    with asked(units="field"):
        assert texts(0.0, 30.48) == ("x (ft)", ["0", "20", "40", "60", "80", "100"])
        assert axes_of(np.array([[0.0, 0, 0], [30.48, 0, 1.0]]))[0].ticks[-1][0] == pytest.approx(30.48)
        assert quantity(4448.2216, "N") == "1 klbf" and quantity(0.02, "1/m") == "0.0061 1/ft"
    with asked(units="N,mm"):
        assert quantity(4448.2216, "N") == "4448 N" and quantity(2e4, "N m") == "20000 N m"
        moved = SimpleNamespace(largest_displacement=lambda: np.array([0.0, 0.19]), axis="load factor", label=str)
        assert too_small(moved, [1], 100.0, 1.0) == ["displacements are at most 190 mm: magnify=10"]


VIEW = View.of(np.array([[0.0, 0, 0], [10, 0, 5]]), np.array([10.0, 0, 5]), (700, 500))


@pytest.mark.serial
def test_labels_keep_off_each_other_and_off_the_edge():
    labels = Labels(VIEW, [np.linspace(0, 10, 50)[:, None] * [1.0, 0, 0]])
    placed = [labels.near(f"label {i}", np.array([10.0, 0, 0]), np.array([1.0, 0, 0]), size=20) for i in range(60)]
    assert 8 < sum(placed) < 60 and len(labels.left_out) == 60 - sum(placed)
    boxes = labels.boxes
    assert len(boxes) == sum(placed)
    assert all(x0 > 0 and y0 > 0 and x1 < 700 and y1 < 500 for x0, y0, x1, y1 in boxes)
    for a, b in itertools.combinations(boxes, 2):
        assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]


@pytest.mark.serial
@pytest.mark.parametrize("seed", [9, 11])
def test_lines_to_labels_do_not_cross(seed):
    """Fourteen labels along a string, on both sides."""
    way, random = np.array([0.7, 0, -0.7]), np.random.default_rng(seed)
    string = np.linspace(0, 10, 50)[:, None] * way
    labels = Labels(View.of(string, np.ptp(string, axis=0), (1100, 1000)), [string])
    for x in random.uniform(2, 10, 14):
        assert labels.near(f"2.5 kN at {x:.1f} m", x * way, np.array([1.0, 0, 1]) * random.choice([-1, 1]), size=30)
    for (a, b), (c, d) in itertools.combinations(np.array(labels._leaders), 2):
        ways = np.column_stack([b - a, c - d])
        if abs(np.linalg.det(ways)) > 1e-6:  # not parallel
            shares = np.linalg.solve(ways, c - a)
            assert not ((shares > 0) & (shares < 1)).all()


@pytest.mark.serial
def test_labels_of_the_lower_end_keep_off_the_string():
    """Five long ones where there is no room beside the end: farther away, not over the string."""
    way = np.array([0.7, 0, -0.7])
    string = np.linspace(0, 10, 400)[:, None] * way
    view = View.of(string, np.ptp(string, axis=0), (1100, 1000))
    labels, pixels = Labels(view, [string]), view.pixels(string)
    labels.reserve((pixels[-1, 0] + 60, 0), (1100, 1000))
    for x in (10.0, 9.9, 9.7, 9.6, 9.5):
        assert labels.near(f"0.914 klbf at {x + 4921:.1f} ft", x * way, np.array([1.0, 0, 1]), size=30)
    for x0, y0, x1, y1 in labels.boxes[1:]:
        assert not ((pixels > (x0, y0)) & (pixels < (x1, y1))).all(axis=1).any()


@pytest.mark.serial
def test_numbers_of_an_axis_are_even():
    """Every n-th one, from that on which leaves most room where another label stands at an end."""
    ticks = [(f"{k:.3f}", np.array([2.0 * k, 0, 0])) for k in range(6)]
    for size, taken, kept in ((10, None, [text for text, _ in ticks]), (32, None, ["0.000", "2.000", "4.000"]),
                              (32, ticks[0], ["1.000", "3.000", "5.000"])):  # fmt: skip
        labels = Labels(VIEW)
        if taken:
            labels.fix("x", [(taken[1], (0.0, 0.0))], size=size)
        before = len(labels.boxes)
        labels.evenly(ticks, size=size, away=(0, 0))
        assert [text for text, *_ in labels._texts[before:]] == kept
    last = VIEW.pixels(ticks[-1][1])  # beside a key of signs there is room for the last one
    labels = Labels(VIEW)
    labels.reserve((last[0] + 25, 0), VIEW.window)
    labels.evenly(ticks, size=10, away=(0, 0))
    assert len(labels._texts) == len(ticks)


@pytest.mark.serial
def test_labels_that_are_close_are_all_drawn():
    """VTK would leave one of these out."""
    pyvista = pytest.importorskip("pyvista")
    labels = Labels(VIEW)
    for text, x in (("1.3 (unstable)", 6.0), ("1.85", 3.5)):
        assert labels.near(text, np.array([x, 0, 2.5]), np.array([0.0, 0, 1]), size=20)
    plotter = pyvista.Plotter(off_screen=True, window_size=VIEW.window)
    labels.draw(plotter, pyvista)
    VIEW.place(plotter)
    dark = plotter.screenshot(return_img=True).max(axis=2) < 128
    plotter.close()
    for x0, y0, x1, y1 in np.array(labels.boxes).astype(int):
        assert dark[500 - y1 : 500 - y0, x0:x1].sum() > 20


@pytest.mark.serial
def test_loads_are_read_by_their_units():
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), cf.Circle(0.05), STEEL, name="r")
    loads = [
        cf.EccentricForce(rod.end, (0, 0, -5), (0.1, 0.2)),
        cf.FollowerMoment(rod.end, (0, 3, 0)),
        cf.LineForce(rod, cf.signals.Along(lambda s: (0, 0, -s))),
        cf.Weight(permanent=True),
        cf.Spring(rod.at(1.0), 10.0, direction=(0, 0, 1)),
        cf.PointMass(rod.end, 2.0),
        cf.Foundation(rod, 5.0),
        cf.Force(rod.end, cf.signals.Step((0, 7, 0), start=0.25)),
    ]
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], loads)
    kinds = [loads_of(load, scene, 2.0 if load.scaled else 1.0, time=0.0) for load in loads]
    assert [[mark.kind for mark in found] for found in kinds] == [
        ["force"], ["moment"], ["line force"], ["line force"], ["spring"], ["mass"], [], [],
    ]  # fmt: skip
    force, moment, line, weight = (found[0] for found in kinds[:4])
    np.testing.assert_allclose(force.vector, [0, 0, -10])
    np.testing.assert_allclose(force.arm, rod.curve.frame(2.0) @ [0.1, 0.2, 0])
    assert moment.turns and not force.turns and weight.rod is None
    np.testing.assert_allclose(line.vector[:, 2], -2 * np.linspace(0, 2, 33))
    np.testing.assert_allclose(weight.vector[0, 2], -9.81 * 7850 * np.pi * 0.05**2 / 4)  # not times the load factor
    (largest,) = loads_of(loads[-1], scene, 1.0)
    np.testing.assert_allclose(largest.vector, [0, 7, 0])
    assert [load for load in loads if not has_sign(load, scene)] == [loads[6]]


def colours_near(image, colour, place, reach):
    """How many pixels of a colour (r, g, b) lie within `reach` pixels of a place (from the lower left corner)."""
    rows, columns = np.nonzero(np.abs(image - np.array(colour)).max(axis=2) < 40)
    return int((np.hypot(columns - place[0], len(image) - rows - place[1]) < reach).sum())


def drawn(plotter):
    image = plotter.screenshot(return_img=True).astype(int)
    camera = plotter.camera
    towards = np.subtract(camera.position, camera.focal_point)
    towards /= np.linalg.norm(towards)
    right = np.cross(camera.up, towards)
    window = tuple(plotter.window_size)
    view = View(
        towards, right, np.cross(towards, right), None, np.array(camera.focal_point), camera.parallel_scale, window
    )
    plotter.close()
    return image, view


@pytest.mark.serial
def test_an_arrow_points_where_the_force_does():
    """The arrow lies above the rod where the force pushes it down, and below where it pushes it up."""
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), cf.Circle(0.05), STEEL, name="r")
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.at(s), (0, 0, f)) for s, f in ((0.5, 5), (1.5, -5))])
    image, view = drawn(scene.plot())
    red, grey = (235, 40, 40), (100, 115, 132)
    for s, there in ((0.5, -0.1), (1.5, 0.1)):
        assert colours_near(image, red, view.pixels([s, 0, there]), 12) > 40
        assert colours_near(image, red, view.pixels([s, 0, -there]), 12) == 0
    assert colours_near(image, grey, view.pixels([-0.02, 0, 0.05]), 10) > 40, "the clamp, at the start"


@pytest.mark.serial
def test_tubes_are_drawn_around_their_rods():
    """With their true clearance, 0.05 m, around rods that are drawn thicker; not where displacements are magnified."""
    rod = cf.Rod(cf.Line((0.5, 0, 0), (3.5, 0, 0)), cf.Circle(0.02), STEEL, name="r")
    axis = cf.well.WellPath.from_survey([0, 4], [90, 90], [0, 0])
    walls = [
        cf.well.TubeWall(rod, axis, 0.06, 0.01, begins=0.5),
        cf.well.TubeRing(rod.at(1.5), axis, 0.02, 0.03, begins=0.5),
    ]
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, 1.0)), *walls])
    path = cf.solve(scene, [1.0], elements=2)
    for plotter in (scene.plot(), path.plot(points=[0])):
        tube, ring = (mesh for mesh in plotter.meshes if "radius" in mesh.point_data)
        thick = 3.0 / 120
        np.testing.assert_allclose(tube.bounds, [0.5, 3.5, *2 * (-0.05 - thick, 0.05 + thick)], rtol=1e-3)
        np.testing.assert_allclose(ring.bounds[:4], [1.95, 2.05, -0.02 - thick, 0.02 + thick], rtol=1e-3)
        plotter.close()
    plotter = path.plot(points=[0], magnify=2.0)
    assert not [mesh for mesh in plotter.meshes if "radius" in mesh.point_data]
    plotter.close()
    assert without_sign(scene, True) == "" and without_sign(scene, False).startswith("TubeWall on r")


@pytest.mark.serial
@pytest.mark.parametrize("lean", [(0, 0, 1), (1, 0, 0), (1, -2, 2)])
def test_supports_touch_what_they_hold(lean):
    """The sign of a pin reaches into the rod, whether this stands on it, lies on it or leans, seen from a corner."""
    pyvista = pytest.importorskip("pyvista")
    rod = cf.Rod(cf.Line((0, 0, 0), lean), cf.Circle(0.04), STEEL)
    scene = cf.Scene([rod], [cf.Pin(rod.start)], [])
    symbols = signs_of(pyvista, scene, [Resting({rod: 0.02})], np.array([[0, 0, 0], lean]), np.ones(3))
    tangent = np.array(lean) / np.linalg.norm(lean)
    along = symbols.points @ tangent
    across = np.linalg.norm(symbols.points - along[:, None] * tangent, axis=1)
    assert ((along > -1e-9) & (along < 0.02) & (across < 0.02)).any()


@pytest.mark.serial
def test_a_scene_of_twenty_rods_stays_inside_its_picture():
    rods, loads = [], []
    for i in range(20):
        x, z = 4.0 * (i % 5), 3.0 * (i // 5)
        rods.append(cf.Rod(cf.Line((x, 0, z), (x + 3, 0, z)), cf.Circle(0.1), STEEL, name=f"a rather long name {i}"))
        loads += [cf.LineForce(rods[-1], (0, 0, -30e3)), cf.Force(rods[-1].end, (40e3, 0, 0))]
    plotter = cf.Scene(rods, [cf.Clamp(rod.start) for rod in rods], loads, title="T" * 300).plot()
    image, _ = drawn(plotter)
    edge = np.concatenate([image[:, :3], image[:, -3:]], axis=1)
    assert (edge == 255).all() and (image[-3:] == 255).all(), "nothing is cut"


@pytest.mark.serial
def test_a_scene_is_drawn_without_a_solver(tmp_path):
    code = (
        "import sys, cosserat_fenicsx as cf; rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Circle(0.1), "
        "cf.Material(1e9)); cf.Scene([rod], [cf.Clamp(rod.start)]).plot(sys.argv[1]); "
        "print({'dolfinx', 'ufl', 'petsc4py'} & set(sys.modules))"
    )
    file = tmp_path / "new" / "scene.png"
    done = subprocess.run([sys.executable, "-c", code, str(file)], capture_output=True, encoding="utf-8",
                          cwd=Path(__file__).parent.parent)  # fmt: skip
    assert done.stdout.strip() == "set()" and file.stat().st_size > 10_000, done.stderr


def test_one_rank_writes_the_scene(tmp_path_all):
    _, scene = column()
    scene.plot(tmp_path_all / "scene.png")
    COMM.barrier()
    assert (tmp_path_all / "scene.png").stat().st_size > 10_000
    with pytest.raises(cf.SceneError, match=r"scene.pdf: expected a name that ends in \.png"):
        scene.plot(tmp_path_all / "scene.pdf")


def pinned():
    """Pinned at both ends, weak about x: Euler's column with the critical load pi^2, and a mass of 1 kg/m."""
    section = cf.Stiffness((1e7, 1e7), 1e7, (1.0, 50.0), 10.0, mass=1.0, inertia=(1e-6, 1e-6, 2e-6))
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1), d1=(1, 0, 0)), section, name="rod[bold]")
    supports = [cf.Hinge(rod.start, (1, 0, 0)), *(cf.Roller(rod.end, across) for across in ((0, 1, 0), (1, 0, 0)))]
    return cf.Scene([rod], supports, [cf.Force(rod.end, (0, 0, -1.0))], title="A [/red] column")


@pytest.fixture
def command(tmp_path, monkeypatch):
    """Runs a command on the pinned column; returns the exit code."""
    monkeypatch.setattr(interrupts, "listen", lambda: None)  # signals belong to pytest
    cf.write(pinned(), tmp_path / "scene.toml")
    return lambda name, *more: cli.main([name, str(tmp_path / "scene.toml"), *map(str, more)])


@pytest.fixture(scope="module")
def bent():
    """A bent column at load factor 0.5, and its modes there."""
    rod, scene = column()
    return rod, scene, cf.modes(scene, 3, load_factor=0.5, elements=4)


@pytest.mark.serial
def test_buckling_of_a_pinned_column_leaves_the_program(command, tmp_path, capsys):
    """pi^2 and 4 pi^2, sin(pi z) and sin(2 pi z); rotations are the slopes, -dy/dz about x."""
    import meshio
    import pyvista

    out = tmp_path / "new" / "out"
    assert command("buckling", "--count", 2, "--tol", "1e-6", "-o", out) == 0
    said = capsys.readouterr().out
    assert "A [/red] column" in said and "rod[bold]@0.5" in said and "no static bifurcation below 9.869" in said
    assert {file.name for file in out.iterdir()} == {f"buckling.{kind}" for kind in ("csv", "xdmf", "h5", "png")}
    rows = list(csv.DictReader((out / "buckling.csv").open(encoding="utf-8")))
    critical = [float(row["critical load factor"]) for row in rows]
    assert critical == pytest.approx([np.pi**2, 4 * np.pi**2], rel=1e-5)
    assert all(0 < float(row["estimated relative error"]) <= 1e-6 for row in rows)
    with meshio.xdmf.TimeSeriesReader(out / "buckling.xdmf") as reader:
        points, _ = reader.read_points_cells()
        z = points[:, 2]
        for k in range(reader.num_steps):
            time, data, _ = reader.read_data(k)
            sign = np.sign(data["displacement"][1, 1])
            wave = (k + 1) * np.pi
            assert time == k and set(data) == {"displacement", "rotation", "position", "arc_length", "rod"}
            np.testing.assert_allclose(data["displacement"][:, 1] * sign, np.sin(wave * z), atol=2e-3)
            np.testing.assert_allclose(data["rotation"][:, 0] * sign, -wave * np.cos(wave * z), atol=6e-3 * wave)
            np.testing.assert_allclose(data["position"], points)
    seen = pyvista.get_reader(str(out / "buckling.xdmf"))
    assert seen.time_values == [0, 1]
    seen.set_active_time_value(1)
    warped = seen.read().warp_by_vector("displacement", factor=0.1)
    assert np.abs(warped.points[:, 1]).max() == pytest.approx(0.1, rel=1e-3)


@pytest.mark.serial
def test_modes_of_a_pinned_column_by_the_command_line(command, tmp_path, capsys):
    """f = pi/2 sqrt(1 - P/P_cr) and periods, unloaded and loaded; with a given mesh there is no error estimate."""
    for eta in (0.0, 5.0):
        assert command("modes", "--count", 1, "--load-factor", eta, "-o", tmp_path, "--no-picture") == 0
        (row,) = csv.DictReader((tmp_path / "modes.csv").open(encoding="utf-8"))
        frequency = np.pi / 2 * np.sqrt(1 - eta / np.pi**2)
        assert float(row["frequency (Hz)"]) == pytest.approx(frequency, rel=1e-4)
        assert float(row["period (s)"]) == pytest.approx(1 / frequency, rel=1e-4)
    assert not (tmp_path / "modes.png").exists()
    assert f"load factor {eta:g} has no negative mode (stable)" in capsys.readouterr().out
    assert command("modes", "--count", 1, "--elements", 3, "--degree", 2) == 0
    said = capsys.readouterr().out
    assert "error not estimated" in said and "degree 2, 3 elements" in said
    assert command("modes", "--count", 2, "--load-factor", 15, "--elements", 3) == 0
    assert "has 1 negative mode(s) (unstable)" in capsys.readouterr().out


@pytest.mark.serial
@pytest.mark.parametrize(("arguments", "code", "words"), [
    (("buckling", "--tol", "2"), 2, "tol = 2.0: expected"),
    (("modes", "--tol", "-1"), 2, "modes.tol = -1.0: expected a number from 1e-12 to below 1"),
    (("modes", "--degree", "5"), 2, "degree = 5: expected 1, 2, 3 or 4"),
    (("buckling", "--elements", "0"), 2, "elements = 0"),
    (("modes", "--load-factor", "nan"), 2, "modes.load_factor = nan"),
    (("buckling", "-o", __file__), 2, "output folder"),
    (("buckling", "--load-factor", "12"), 1, "unstable at the load factor 12"),
])  # fmt: skip
def test_refused_by_the_command_line(arguments, code, words, command, capsys):
    assert command(*arguments) == code
    assert words in capsys.readouterr().err


@pytest.mark.serial
def test_ctrl_c_between_two_files(command, tmp_path, capsys, monkeypatch):
    """What is written is complete, and is said."""
    from cosserat_fenicsx.cli import output

    def obey():
        if (tmp_path / "modes.csv").exists():
            raise KeyboardInterrupt

    monkeypatch.setattr(output, "obey", obey)
    assert command("modes", "--elements", 3, "-o", tmp_path) == 130
    told = capsys.readouterr()
    assert "frequency (Hz)" in told.out and f"written to {tmp_path}/: modes.csv\n" in told.out
    assert "interrupted; what is not written yet is left out" in told.err
    assert not (tmp_path / "modes.xdmf").exists()


def test_nothing_found_is_written_as_such(tmp_path_all):
    rod, _ = column()
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, 1.0))])
    found = cf.buckling(scene, elements=4)
    assert len(found) == 0 and "no critical load factor up to" in repr(found)
    found.write(tmp_path_all / "none.csv")
    COMM.barrier()
    assert len((tmp_path_all / "none.csv").read_text(encoding="utf-8").splitlines()) == 1
    for show in (lambda: found.write(tmp_path_all / "none.xdmf"), found.plot):
        with refused("there is no mode to show"):
            show()


def test_equal_eigenvalues_are_combined_along_axes():
    """Of a round column: the first of each pair moves along x, the second along y, in both kinds of results."""
    rod, scene = column(eccentricity=0.0)
    buckled = cf.buckling(scene, 4, elements=4)
    assert repr(buckled).startswith("<Buckling: critical load factors 0.9999")
    assert "<td>0</td><td>0.99995" in buckled._repr_html_()
    assert buckled.label(0) == "critical load factor 0.99995"
    for found in (cf.modes(scene, 4, elements=4), buckled):
        for k in range(4):
            moved = found.mode(k, rod)
            assert moved[:, k % 2].max() == pytest.approx(1, abs=1e-9)
            assert np.abs(np.delete(moved, k % 2, axis=1)).max() < 1e-6


def test_shapes_belong_to_their_equilibrium(bent, tmp_path_all):
    """The positions in files are those of `solve`; a pickle has all of it."""
    import meshio

    rod, scene, found = bent
    path = cf.solve(scene, [0.5], elements=4, model="spatial")
    np.testing.assert_allclose(found.equilibrium.position(rod), path.centreline(0), atol=1e-7)
    found.write(tmp_path_all / "one.vtu", 2)
    COMM.barrier()
    mesh = meshio.read(tmp_path_all / "one.vtu")
    np.testing.assert_allclose(mesh.points, path.centreline(0), atol=1e-7)
    np.testing.assert_array_equal(mesh.point_data["displacement"], found.mode(2))
    loaded = pickle.loads(pickle.dumps(found))
    assert repr(loaded) == repr(found) and loaded.comm.size == 1
    np.testing.assert_array_equal(loaded.mode(1, "column"), found.mode(1))
    assert repr(found).startswith("<Modes: 0.2") and found.label(0).endswith(" Hz")
    assert "Hz, eigenvalues with error not estimated, at the load factor 0.5" in repr(found)
    words, film, picture = (
        "Modes.k = {}: expected the number of a mode, from 0 to 2",
        "film.gif",
        tmp_path_all / "a.png",
    )
    film = tmp_path_all / film
    for ask, said in (
        (lambda: found.write(tmp_path_all / "one.xyzzy"), "the ending '.xyzzy' is not known"),
        (lambda: found.mode(3), words.format(3)), (lambda: found.turns(-4), words.format(-4)),
        (lambda: found.mode(1.0), words.format(1.0)), (lambda: found.animate(film, 7), words.format(7)),
        (lambda: found.plot(picture, [7]), words.format(7)),
        (lambda: found.plot(picture, 2), "plot.which = 2: expected a list of the numbers of one to 6 modes"),
        (lambda: found.animate(film, cycles=0), "animate.cycles = 0"),
        (lambda: found.animate(film, seconds=0), "animate.seconds = 0"),
        (lambda: found.animate(film, amplitude=-1), "animate.amplitude = -1"),
        (lambda: found.animate(film, fps=1e9), "animate.fps"),
        (lambda: found.animate(film, seconds=60, cycles=10), "at most 10000 frames, not 15000"),
    ):  # fmt: skip
        with refused(said):
            ask()
    assert not film.exists() and not picture.exists()


@pytest.mark.serial
def test_every_mode_has_its_panel(bent, tmp_path):
    from matplotlib.image import imread

    bent[2].plot(tmp_path / "modes.png")
    vivid = np.ptp(imread(tmp_path / "modes.png")[70:, :, :3], axis=2) > 0.08
    assert all(1e-3 < panel.mean() < 0.2 for panel in np.split(vivid, 3, axis=1))


@pytest.mark.serial
def test_a_shape_is_drawn_as_large_as_the_picture_says(bent):
    rod, _, found = bent
    shape = Drawn(found, 0, 0.1)
    (body,), (other,), (resting,) = shape.bodies(1), shape.bodies(-1), shape.bodies(0)
    size = np.ptp(shape.lines[0], axis=0).max()
    assert np.linalg.norm(body.line - resting.line, axis=1).max() == pytest.approx(0.1 * size, rel=1e-6)
    assert shape.note == "largest displacement drawn as 10 % of the structure's size"
    np.testing.assert_allclose(body.line + other.line, 2 * resting.line, atol=1e-12)
    tangent = np.gradient(body.line, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    assert np.einsum("ij,ij->i", tangent, body.directors[:, :, 2]).min() > 0.995, "sections stay across the line"
    np.testing.assert_allclose(np.linalg.det(body.directors), 1)


@pytest.mark.serial
def test_a_twist_is_drawn_by_its_rotation():
    strip = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), cf.Rectangle(0.2, 0.02), cf.Material(E=210e9, density=7850.0))
    rollers = [cf.Roller(strip.end, axis) for axis in ((0, 1, 0), (0, 0, 1))]
    found = cf.modes(cf.Scene([strip], [cf.Clamp(strip.start), *rollers]), 4, elements=4)
    (k,) = (k for k in range(4) if found.twists(k))
    assert found.farthest(k) == (None, None)
    assert Drawn(found, k, 0.1).note == "largest rotation drawn as 45 degrees"


@pytest.mark.serial
def test_a_twist_is_drawn_as_such_where_another_rod_holds_it():
    """The arm's end moves a little: the picture showed nothing but the arm."""
    steel, k = cf.Material(E=200e9, nu=0.3, density=8000.0), 1e14
    beam = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), cf.Rectangle(2.0, 2.0), steel, name="beam")
    arm = cf.Rod(
        cf.Line((0, 0, 0), (0, 1, 0)), cf.Stiffness((k, k), k, (k, k), k, mass=1e-3, inertia=(1e-3,) * 3), name="arm"
    )
    supports = [cf.Pin(beam.start), *(cf.Roller(beam.end, x) for x in ((0, 1, 0), (0, 0, 1))),
                cf.Roller(arm.end, (0, 0, 1))]  # fmt: skip
    found = cf.modes(cf.Scene([beam, arm], supports, joints=[cf.Joint(beam.start, arm.start)]), 3, elements=2)
    drawn = [Drawn(found, k, 0.1) for k in range(3)]
    assert [shape.by_turning for shape in drawn] == [False, False, True] and not found.twists(2)
    assert drawn[2].note == "largest rotation drawn as 45 degrees"


def test_flat_sections_are_seen_from_the_side():
    """Half the thickness over the extent; round sections are as they were."""
    round_, flat = (SimpleNamespace(outline=np.array([[(-a, -b), (a, -b), (a, b), (-a, b)]]), radius=np.hypot(a, b))
                    for a, b in ((1e-3, 1e-3), (1e-2, 5e-4)))  # fmt: skip
    assert thickening(round_, 1.0) * round_.radius == pytest.approx(1 / 120)
    assert 1 / 600 < thickening(flat, 1.0) * 5e-4 < 1 / 120 and thickening(flat, 1e-3) == 1.0


@pytest.mark.serial
def test_a_film_swings_to_both_sides(tmp_path):
    """The frame in the middle is the mirror image of the first; the one at a quarter is the equilibrium."""
    from PIL import Image
    from scipy import ndimage

    _, scene = column(eccentricity=0.0)
    pair = cf.modes(scene, 2, elements=4)  # of equal frequencies: the first is along x
    pair.animate(tmp_path / "mode.gif", 0, fps=4, size=(320, 240))
    with Image.open(tmp_path / "mode.gif") as film:
        assert film.n_frames == 8
        frames = []
        for i in (0, 2, 4):
            film.seek(i)
            picture = np.asarray(film.convert("RGB")).astype(int)
            frames.append(np.ptp(picture, axis=2) > 20)  # the coloured rod
    first, still, middle = frames
    centre = np.flatnonzero(still.any(axis=0)).mean()
    assert first.any() and not (first == middle).all()
    rows, columns = np.nonzero(first)
    tip = columns[rows == rows.min()].mean()
    other_rows, other_columns = np.nonzero(middle)
    opposite = other_columns[other_rows == other_rows.min()].mean()
    assert abs(tip - centre) > 5 and tip + opposite == pytest.approx(2 * centre, abs=1.5)
    mirrored = np.zeros_like(first)
    mirrored[rows, np.clip(np.round(2 * centre - columns).astype(int), 0, 319)] = True
    # The centre is known to a pixel, and what smooths edges is another in each VTK. A rod is 3 to 4 pixels wide.
    around = np.ones((3, 3))
    assert (ndimage.binary_dilation(mirrored, around) & middle).sum() > 0.95 * middle.sum()
    assert (mirrored & ndimage.binary_dilation(middle, around)).sum() > 0.95 * mirrored.sum()


@pytest.mark.serial
def test_progress_tells_meshes_and_the_time(capsys, monkeypatch):
    _, scene = column()
    cf.modes(scene, progress=True)
    assert capsys.readouterr().err.splitlines()[0] == "modes: 4 elements per rod, 0 s"
    monkeypatch.setattr(progress, "_LINE_EVERY", 1e-3)
    cf.buckling(scene)
    assert "buckling: " in capsys.readouterr().err
    cf.buckling(scene, progress=False)
    assert capsys.readouterr().err == ""
    screen = Terminal()
    monkeypatch.setattr(progress.sys, "stderr", screen)
    cf.buckling(scene, progress=True)
    assert " buckling" in screen.getvalue() and screen.getvalue().endswith("\x1b[2K"), "the line is removed at the end"


def test_motions_across_a_plane_are_seen_from_a_corner():
    span = np.array([4.0, 0.0, 3.0])
    assert (seen_moving(span, np.array([[0.0, 1e-3, 0.0]])) == 4.0).all()
    for moved in ([[1e-3, 0.0, 1e-3]], [[1e-3, 5e-5, 0.0]], [[0.0, 1e-10, 0.0]]):
        assert seen_moving(span, np.array(moved)) is span
