"""Films: constant frame rate, time scale in the title, reproducible bytes, messages where something is missing."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import refused
from moving_scenes import flying_in_space

import cosserat_fenicsx as cf
from cosserat_fenicsx.pictures import animation, drawing
from cosserat_fenicsx.pictures.animation import Between
from cosserat_fenicsx.pictures.drawing import EVERY

pytestmark = pytest.mark.serial
SMALL = {"size": (320, 240), "fps": 4, "speed": 1}


@pytest.fixture(scope="module")
def flight():
    """The end of the flight in space, every step saved."""
    return cf.simulate(flying_in_space()[1], 2, tol=1e-3)


def test_between_saved_states_the_error_is_of_third_order():
    """With half as many saved states the error is eight times as large, compared with all steps."""
    rod, scene = flying_in_space()
    every, x, errors = cf.simulate(scene, 2, dt=0.0125), np.linspace(0, 1, 11), []
    for often in (0.1, 0.05):
        between = Between(cf.simulate(scene, 2, dt=0.0125, save_every=often), EVERY["bending_moment"])
        assert between.smooth == 1
        bodies = [between.bodies(t, x)[0] for t in every.times]
        shapes = [every.sample(k, rod, x) for k in range(len(every))]
        errors.append(max(np.abs(body.line - line).max() for body, (line, _) in zip(bodies, shapes, strict=True)))
        assert max(np.abs(body.directors - d).max() for body, (_, d) in zip(bodies, shapes, strict=True)) < 4e-4
    assert errors[0] < 3e-5 and errors[0] / errors[1] == pytest.approx(8, rel=0.1)


@pytest.mark.slow
def test_saved_too_seldom_is_straight_and_says_so(tmp_path):
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), cf.Circle(0.02), cf.Material(200e9, density=7800.0))
    spin = cf.InitialVelocity(rod, angular=(0, 0, 2 * np.pi))
    history = cf.simulate(cf.Scene([rod], velocities=[spin]), 2, dt=0.01, elements=1, degree=2, save_every=0.4)
    between = Between(history, EVERY["bending_moment"])
    assert between.smooth == 0
    lines = [between.bodies(t, np.array([0.0, 1.0]))[0].line for t in np.linspace(0, 2, 81)]
    assert max(np.linalg.norm(line[1] - line[0]) for line in lines) < 1.001, "cubics would swing out"
    history.animate(tmp_path / "spin.gif", **{**SMALL, "fps": 2})


def test_films_are_in_the_chosen_units(flight, tmp_path, monkeypatch):
    titles = []
    monkeypatch.setattr(animation, "record", lambda make, *given: titles.extend(make()._plotter.scalar_bars.keys()))
    flight.animate(tmp_path / "a.gif", color="displacement", units="ft", **SMALL)
    assert "(ft)" in titles[0]


@pytest.mark.slow
def test_gif_and_mp4(flight, tmp_path):
    from PIL import Image

    for name in ("a.gif", "b.gif"):
        flight.animate(tmp_path / name, **SMALL)
    assert (tmp_path / "a.gif").read_bytes() == (tmp_path / "b.gif").read_bytes()
    with Image.open(tmp_path / "a.gif") as film:
        assert film.size == (320, 240) and film.n_frames == 9 and film.info["duration"] == 250
        first = np.asarray(film.convert("RGB")).astype(int)
        film.seek(8)
        last = np.asarray(film.convert("RGB")).astype(int)
    assert (first[0, 0] == 255).all() and np.abs(first - last).max() > 50
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    flight.animate(tmp_path / "a.mp4", **SMALL)
    about = next(ffmpeg.read_frames(str(tmp_path / "a.mp4")))
    assert about["size"] == (320, 240) and about["fps"] == 4 and about["duration"] == pytest.approx(9 / 4, abs=0.1)
    assert len(list(ffmpeg.read_frames(str(tmp_path / "a.mp4")))) - 1 == 9


def test_time_scales():
    assert [animation._round_speed(d) for d in (10.0, 4.0, 60.0, 1000.0, 0.5, 0.003)] == [
        pytest.approx(x) for x in (1, 1, 20, 200, 0.1, 1e-3)
    ]
    times = animation._times(0.0, 1.03, 1.0, 10)
    np.testing.assert_allclose(np.diff(times)[:-1], 0.1)
    assert times[-1] == 1.03 and len(times) == 12


REFUSED = {
    "ending": ("a.avi", {}, "a.avi: expected a name that ends in .gif or .mp4"),
    "fps": ("a.gif", {"fps": 0}, "animate.fps = 0: expected a number from 1 to 100"),
    "speed": ("a.gif", {"speed": -1}, "animate.speed = -1"),
    "frames": ("a.gif", {"speed": 1e-6}, "at most 10000 frames, not 50000000"),
    "size": ("a.gif", {"size": (3, 3)}, "animate.size = 3: expected (width, height)"),
    "odd": ("a.gif", {"size": (321, 240)}, "animate.size = 321"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(flight, case, tmp_path):
    name, more, words = REFUSED[case]
    with refused(words):
        flight.animate(tmp_path / name, **more)
    assert not (tmp_path / name).exists()


def test_what_is_missing_is_said(flight, tmp_path, monkeypatch):
    """And an ffmpeg that fails is quoted."""
    script = tmp_path / "ffmpeg"
    script.write_text("#!/bin/sh\necho 'no room left' >&2\nexit 1\n")
    script.chmod(0o755)
    with monkeypatch.context() as patch, pytest.raises(OSError, match="ffmpeg could not write the film: no room left"):
        patch.setattr(animation, "_ffmpeg", lambda: str(script))
        flight.animate(tmp_path / "a.mp4", **SMALL)
    for name, library, words in (
        ("a.mp4", "imageio_ffmpeg", "need ffmpeg: pip install 'cosserat-fenicsx[films]', or apt install ffmpeg"),
        ("a.gif", "PIL", "need Pillow"),
    ):
        monkeypatch.setitem(sys.modules, library, None)
        monkeypatch.setenv("PATH", "")
        with refused(words):
            flight.animate(tmp_path / name)


def test_ctrl_c_ends_the_film(flight, tmp_path, monkeypatch):
    """The file contains the frames drawn so far."""
    from PIL import Image

    drawn, at = [], animation._Stage.at
    monkeypatch.setattr(animation._Stage, "at", lambda self, t: drawn.append(t) or at(self, t))

    def obey():
        if len(drawn) > 12:
            raise KeyboardInterrupt

    monkeypatch.setattr(animation, "obey", obey)
    with pytest.raises(KeyboardInterrupt):
        flight.animate(tmp_path / "a.gif", **SMALL)
    with Image.open(tmp_path / "a.gif") as film:
        assert 2 < film.n_frames < 9


def test_nothing_is_loaded_before_it_is_needed():
    code = (
        "import sys, cosserat_fenicsx.pictures.animation; print({'pyvista', 'PIL', 'imageio_ffmpeg', 'matplotlib'} &"
        " set(sys.modules))"
    )
    root = Path(__file__).parent.parent
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8", cwd=root)
    assert done.stdout.strip() == "set()", done.stderr


def test_the_mesh_of_all_rods_moves_with_their_values():
    """As one that is made anew; values are over the size of their unit."""
    pyvista, made, x = drawing.load_pyvista(), [], np.linspace(0, 1, 3)
    for height in (0.0, 0.5):
        lines = [cf.Line((i, 0, height), (i, 2, height)) for i in range(2)]
        rods = [cf.Rod(line, cf.Circle(0.1), cf.Material(E=1e9)) for line in lines]
        made.append([drawing.body_of(rod, x, rod.curve.position(2 * x), rod.curve.frame(2 * x), 4 * x + height)
                     for rod in rods])  # fmt: skip
    mesh, new = (drawing.coloured(pyvista, bodies, [1.0, 3.0], 2.0) for bodies in made)
    assert mesh["value"].max() == 2.0 and np.ptp(mesh.points[:, 2]) == pytest.approx(0.3, rel=1e-6)
    drawing.move(mesh, made[1], [1.0, 3.0], 2.0)
    assert np.array_equal(mesh.points, new.points) and np.array_equal(mesh["value"], new["value"])
