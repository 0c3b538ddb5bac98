"""Pictures: what is drawn where, colours by fields, ticks, and labels that do not overlap."""

import itertools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import COMM, column

import cosserat_fenicsx as cf
from cosserat_fenicsx.pictures.charts import asked
from cosserat_fenicsx.pictures.colours import colour_of, known, peak_of
from cosserat_fenicsx.pictures.drawing import quantity
from cosserat_fenicsx.pictures.signs import has_sign, loads_of, without_sign
from cosserat_fenicsx.pictures.view import Labels, View, axes_of

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


def test_an_unknown_colour_lists_the_names(solved):
    with pytest.raises(cf.SceneError) as refused:
        solved.plot(color="bendng_moment")
    told = str(refused.value)
    assert "plot.color = 'bendng_moment'" in told and "shear_force, displacement" in told
    assert "did you mean 'bending_moment'?" in told
    with pytest.raises(cf.SceneError, match="'velocity'"):  # a path has none
        solved.plot(color="velocity")


def test_ticks_are_round_and_free_of_rounding():
    def texts(low, high):
        points = np.array([[low, -1e-17, 0.0], [high, 1e-17, 0.0]])
        x, y, _ = axes_of(points)
        assert y.ticks == ()
        return x.name, [text for _, text in x.ticks]

    assert texts(-0.3, 0.3) == ("x (m)", ["-0.3", "-0.2", "-0.1", "0.0", "0.1", "0.2", "0.3"])
    assert texts(0.0, 1e-6) == ("x (µm)", ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"])
    assert texts(1e6, 1e6 + 10) == ("x (m)", ["1000000", "1000002", "1000004", "1000006", "1000008", "1000010"])
    assert texts(0, 4e5) == ("x (km)", ["0", "100", "200", "300", "400"])
    assert (
        quantity(3.04e-16, "N m") == "304 aN m" and quantity(1e3, "N") == "1 kN" and quantity(0.02, "1/m") == "0.02 1/m"
    )


def test_drawings_take_the_units_that_are_asked_for(solved):
    with asked(units="field"):
        x, _, z = axes_of(np.array([[0.0, 0, 0], [30.48, 0, 1.0]]))
        assert x.name == "x (ft)" and [text for _, text in x.ticks] == ["0", "20", "40", "60", "80", "100"]
        assert x.ticks[-1][0] == pytest.approx(30.48) and z.name == "z (ft)"
        assert quantity(4448.2216, "N") == "1 klbf" and quantity(0.02, "1/m") == "0.0061 1/ft"
    assert quantity(4448.2216, "N") == "4.45 kN"
    with pytest.raises(cf.SceneError, match="units"):
        solved.plot(units="metric")


def test_labels_keep_off_each_other_and_off_the_edge():
    line = np.column_stack([np.linspace(0, 10, 50), np.zeros(50), np.zeros(50)])
    view = View.of(np.array([[0.0, 0, 0], [10, 0, 5]]), np.array([10.0, 0, 5]), (700, 500))
    labels = Labels(view, [line])
    placed = [labels.near(f"label {i}", np.array([10.0, 0, 0]), np.array([1.0, 0, 0]), size=20) for i in range(60)]
    assert 8 < sum(placed) < 60 and len(labels.left_out) == 60 - sum(placed)
    boxes = labels.boxes
    assert len(boxes) == sum(placed)
    assert all(x0 > 0 and y0 > 0 and x1 < 700 and y1 < 500 for x0, y0, x1, y1 in boxes)
    for a, b in itertools.combinations(boxes, 2):
        assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]


@pytest.mark.serial
def test_labels_that_are_close_are_all_drawn():
    """VTK would leave one of these out."""
    pyvista = pytest.importorskip("pyvista")
    view = View.of(np.array([[0.0, 0, 0], [10, 0, 5]]), np.array([10.0, 0, 5]), (700, 500))
    labels = Labels(view)
    for text, x in (("1.3 (unstable)", 6.0), ("1.85", 3.5)):
        assert labels.near(text, np.array([x, 0, 2.5]), np.array([0.0, 0, 1]), size=20)
    plotter = pyvista.Plotter(off_screen=True, window_size=view.window)
    labels.draw(plotter, pyvista)
    view.place(plotter)
    dark = plotter.screenshot(return_img=True).max(axis=2) < 128
    plotter.close()
    for x0, y0, x1, y1 in np.array(labels.boxes).astype(int):
        assert dark[500 - y1 : 500 - y0, x0:x1].sum() > 20


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
    kinds = [loads_of(load, scene, factor=2.0, time=0.0) for load in loads]
    assert [[mark.kind for mark in found] for found in kinds] == [
        ["force"], ["moment"], ["line force"], ["line force"], ["spring"], ["mass"], [], [],
    ]  # fmt: skip
    force, moment, line, weight = (found[0] for found in kinds[:4])
    np.testing.assert_allclose(force.vector, [0, 0, -10])
    np.testing.assert_allclose(force.arm, rod.curve.frame(2.0) @ [0.1, 0.2, 0])
    assert moment.turns and not force.turns and weight.rod is None
    np.testing.assert_allclose(line.vector[:, 2], -2 * np.linspace(0, 2, 33))
    np.testing.assert_allclose(weight.vector[0, 2], -9.81 * 7850 * np.pi * 0.05**2 / 4)  # not times the load factor
    (largest,) = loads_of(loads[-1], scene)
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
