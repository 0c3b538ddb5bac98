"""Shapes of buckling and of natural vibrations: files, pictures, films, and the command line that writes them."""

import csv
import pickle

import numpy as np
import pytest
from conftest import COMM, column
from test_progress import Terminal

import cosserat_fenicsx as cf
from cosserat_fenicsx import interrupts, progress
from cosserat_fenicsx.cli import main as cli
from cosserat_fenicsx.pictures.shapes import Drawn

# Pinned at both ends, weak about x: Euler's column with the critical load pi^2, and a mass of 1 kg/m.
PINNED = """
title = "A [/red] column"

[[rods]]
name = "rod[bold]"
curve = { type = "Line", start = [0, 0, 0], end = [0, 0, 1], d1 = [1, 0, 0] }
section = { type = "Stiffness", shear = [1e7, 1e7], axial = 1e7, bending = [1.0, 50.0], torsion = 10.0, mass = 1.0, \
inertia = [1e-6, 1e-6, 2e-6] }

[[supports]]
type = "Hinge"
station = "rod[bold].start"
axis = [1, 0, 0]

[[supports]]
type = "Roller"
station = "rod[bold].end"
normal = [0, 1, 0]

[[supports]]
type = "Roller"
station = "rod[bold].end"
normal = [1, 0, 0]

[[loads]]
type = "Force"
station = "rod[bold].end"
force = [0, 0, -1.0]
"""


@pytest.fixture
def command(tmp_path, monkeypatch):
    """Runs a command on the pinned column; returns the exit code."""
    monkeypatch.setattr(interrupts, "listen", lambda: None)  # signals belong to pytest
    (tmp_path / "scene.toml").write_text(PINNED, encoding="utf-8")
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
@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("buckling", "--tol", "2"), 2, "tol = 2.0: expected"),
        (("modes", "--tol", "-1"), 2, "modes.tol = -1.0: expected a number from 1e-12 to below 1"),
        (("modes", "--degree", "5"), 2, "degree = 5: expected 1, 2, 3 or 4"),
        (("buckling", "--elements", "0"), 2, "elements = 0"),
        (("modes", "--load-factor", "nan"), 2, "modes.load_factor = nan"),
        (("buckling", "-o", __file__), 2, "output folder"),
        (("buckling", "--load-factor", "12"), 1, "unstable at the load factor 12"),
    ],
)
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
    for refused in (lambda: found.write(tmp_path_all / "none.xdmf"), found.plot):
        with pytest.raises(cf.SceneError, match="there is no mode to show"):
            refused()


def test_the_words_of_a_result(bent):
    _, _, found = bent
    assert repr(found).startswith("<Modes: 0.2")
    assert "Hz, squares with error not estimated, at the load factor 0.5" in repr(found)
    buckled = cf.buckling(column(eccentricity=0.0)[1], elements=4)
    assert repr(buckled).startswith("<Buckling: critical load factors 0.9999")
    assert "<td>0</td><td>0.99995" in buckled._repr_html_()
    assert found.label(0).endswith(" Hz") and buckled.label(0) == "critical load factor 0.99995"


def test_equal_eigenvalues_are_combined_along_axes():
    """Of a round column: the first of each pair moves along x, the second along y, in both kinds of results."""
    rod, scene = column(eccentricity=0.0)
    for found in (cf.modes(scene, 4, elements=4), cf.buckling(scene, 4, elements=4)):
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
    with pytest.raises(cf.SceneError, match="the ending '.xyzzy' is not known"):
        found.write(tmp_path_all / "one.xyzzy")


def test_unknown_modes_are_refused(bent, tmp_path_all):
    _, _, found = bent
    words = r"Modes.k = {}: expected the number of a mode, from 0 to 2"
    film = tmp_path_all / "film.gif"
    for k, ask in ((3, found.mode), (-4, found.turns), (1.0, found.mode)):
        with pytest.raises(cf.SceneError, match=words.format(k)):
            ask(k)
    with pytest.raises(cf.SceneError, match="plot.which = 2: expected a list of the numbers of one to 6 modes"):
        found.plot(film.with_suffix(".png"), 2)
    for ask in (lambda: found.animate(film, 7), lambda: found.plot(film.with_suffix(".png"), [7])):
        with pytest.raises(cf.SceneError, match=words.format(7)):
            ask()
    for more, said in (({"cycles": 0}, "animate.cycles = 0"), ({"seconds": 0}, "animate.seconds = 0"),
                       ({"amplitude": -1}, "animate.amplitude = -1"), ({"fps": 1e9}, "animate.fps"),
                       ({"seconds": 60, "cycles": 10}, "at most 10000 frames, not 15000")):  # fmt: skip
        with pytest.raises(cf.SceneError, match=said):
            found.animate(film, **more)
    assert not film.exists()


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


def test_a_twist_is_drawn_by_its_rotation():
    strip = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), cf.Rectangle(0.2, 0.02), cf.Material(E=210e9, density=7850.0))
    rollers = [cf.Roller(strip.end, axis) for axis in ((0, 1, 0), (0, 0, 1))]
    found = cf.modes(cf.Scene([strip], [cf.Clamp(strip.start), *rollers]), 4, elements=4)
    (k,) = (k for k in range(4) if found.twists(k))
    assert found.farthest(k) == (None, None)
    assert Drawn(found, k, 0.1).note == "largest rotation drawn as 45 degrees"


@pytest.mark.serial
def test_a_film_swings_to_both_sides(tmp_path):
    """The frame in the middle is the mirror image of the first; the one at a quarter is the equilibrium."""
    from PIL import Image

    _, scene = column(eccentricity=0.0)
    cf.modes(scene, 1, elements=4).animate(tmp_path / "mode.gif", fps=4, size=(320, 240))
    with Image.open(tmp_path / "mode.gif") as film:
        assert film.n_frames == 8
        frames = []
        for i in (0, 2, 4):
            film.seek(i)
            picture = np.asarray(film.convert("RGB")).astype(int)
            frames.append(np.ptp(picture, axis=2) > 40)  # the coloured rod
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
    assert (mirrored & middle).sum() > 0.7 * middle.sum()


@pytest.mark.serial
def test_picture(bent, tmp_path):
    """A panel for each mode, none of them empty."""
    from matplotlib.image import imread

    _, _, found = bent
    found.plot(tmp_path / "modes.png")
    image = imread(tmp_path / "modes.png")[70:, :, :3]
    vivid = np.ptp(image, axis=2) > 0.15
    for panel in np.split(vivid, 3, axis=1):
        assert 1e-3 < panel.mean() < 0.2


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
