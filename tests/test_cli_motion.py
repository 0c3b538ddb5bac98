"""Motions on the command line, and in scene files: table, files, explanations, refusals."""

import csv
import math
import re

import numpy as np
import pytest
from test_cli import DEMO

import cosserat_fenicsx as cf
from cosserat_fenicsx import interrupts
from cosserat_fenicsx.cli import explain
from cosserat_fenicsx.cli import main as cli
from cosserat_fenicsx.dynamics.start import before
from cosserat_fenicsx.scene.signals import Triangle

pytestmark = pytest.mark.serial
MOTIONS = DEMO.parent / "motions"
FLIGHT = MOTIONS / "flying_spaghetti_3d.toml"
SHORT = ("--duration", "1", "--dt", "0.05")


@pytest.fixture
def cosserat(capsys, monkeypatch):
    """The command line in this process: exit code, stdout, stderr."""
    monkeypatch.setattr(interrupts, "listen", lambda: None)  # signals belong to pytest

    def command(*arguments):
        code = cli.main([str(x) for x in arguments])
        return code, *capsys.readouterr()

    return command


def test_run_of_a_motion(tmp_path, cosserat):
    """Table, files and film; the numbers are those of `simulate`."""
    from PIL import Image

    film = ("--animate", "--speed", "5")
    code, said, trouble = cosserat("run", FLIGHT, *SHORT, "-o", tmp_path, *film, "--at", "0,1", "--save-every", "0.1")
    assert code == 0 and trouble == ""
    assert {f.name for f in tmp_path.iterdir()} == {
        "motion.xdmf", "motion.h5", "motion.csv", "result.h5", "rods.png", "rods.html", "energy.png", "motion.gif",
    }  # fmt: skip
    assert all(f.stat().st_size > 3000 for f in tmp_path.iterdir()), sorted(tmp_path.iterdir())
    found = cf.read(FLIGHT)
    scene, settings = found.scene, found.motion
    history = cf.simulate(scene, **{**settings, "duration": 1.0, "dt": 0.05, "save_every": 0.1})
    end = history.position(scene.rods[0].start)[-1]
    np.testing.assert_array_equal(cf.read_history(tmp_path / "result.h5").position("spaghetti.start")[-1], end)
    assert f"spaghetti.start at ({', '.join(f'{x:.6g}' for x in end)}) m" in said
    assert "20 steps, 11 times" in said and "balance" in said and "spatial model:" in said
    with (tmp_path / "motion.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 11 and float(rows[-1]["time (s)"]) == 1
    assert float(rows[-1]["spaghetti.start displacement (m) x"]) == pytest.approx(end[0] - 6, rel=1e-12)
    assert float(rows[-1]["spaghetti.end velocity (m/s) y"]) == history.velocity(scene.rods[0].end)[-1, 1]
    assert float(rows[-1]["work (J)"]) == history.work[-1]
    with Image.open(tmp_path / "motion.gif") as film:
        assert film.info["duration"] == 40 and film.n_frames == 6


def test_the_table_picks_rows_and_the_csv_keeps_all(tmp_path):
    scene = cf.read(FLIGHT).scene
    history = cf.simulate(scene, 1, dt=0.01, elements=2, degree=2)
    text = history.details()
    assert "21 of 101 times" in text and len(re.findall(r"^│", text, re.MULTILINE)) == 21
    assert "speed: of spaghetti@2.5." in history.details(station="spaghetti@2.5")
    history.write(tmp_path / "a.csv", station="spaghetti@2.5")
    lines = (tmp_path / "a.csv").read_text().splitlines()
    assert len(lines) == 102 and "spaghetti@2.5 velocity (m/s) x" in lines[0]
    middle = scene.rods[0].at(2.5)
    for query in ("position", "velocity", "angular_velocity", "moment"):
        assert np.array_equal(getattr(history, query)("spaghetti@2.5"), getattr(history, query)(middle))
    with pytest.raises(cf.SceneError, match="no rod is named 'spagheti', did you mean 'spaghetti'"):
        history.position("spagheti@2.5")


def test_a_motion_that_is_written_as_it_goes(tmp_path, cosserat):
    """`--folder` and `resume` give the table of an uninterrupted run."""
    options = ("--dt", "0.05", "--elements", "2", "--degree", "2")
    assert cosserat("run", FLIGHT, "--duration", "0.5", *options, "--folder", tmp_path / "a")[0] == 0
    code, said, trouble = cosserat("resume", tmp_path / "a", "--duration", "1", "--at", "7", "-o", tmp_path / "out")
    assert code == 0 and trouble == "cosserat: --at 7 lies beyond 0 .. 1; the nearest is drawn\n"
    _, whole, _ = cosserat("run", FLIGHT, "--duration", "1", *options)
    assert said.startswith(whole) and (tmp_path / "out" / "rods.png").is_file()
    for arguments, words in (
        (("run", DEMO, "--folder", tmp_path / "b"), "--folder is for a motion"),
        (("resume", tmp_path / "b"), "no motion was found there"),
        (("resume", tmp_path / "a", "--duration", "0.2"), "at least 1 s"),
    ):
        code, _, trouble = cosserat(*arguments)
        assert code == 2 and words in trouble, trouble


def test_a_load_that_fails_late_leaves_what_was_reached(tmp_path, cosserat, monkeypatch):
    late = Triangle.__call__
    monkeypatch.setattr(Triangle, "__call__", lambda self, t: late(self, t) if t < 0.5 else (math.nan,) * 3)
    file = DEMO.parent / "motions" / "flying_spaghetti_3d.toml"
    code, table, said = cosserat("run", file, "--model", "spatial", *SHORT, "-o", tmp_path, "--no-picture")
    assert code == 2 and "at the time t = 0.525 s, of the Force at" in said
    assert "0.5" in table and len((tmp_path / "motion.csv").read_text().splitlines()) > 10


def test_a_scene_behind_animate(capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(["run", "--animate", str(FLIGHT)])
    assert end.value.code == 2 and "put the scene before --animate" in capsys.readouterr().err


WORDS = {
    "flying_spaghetti_2d": ("Motion: 15 s. Steps of 0.02 s, halved where one fails. Every step is saved.",
                            "by Step, steps end at t = 0, 2.5 s",
                            "0 support(s): none", "Start: the reference, free of stress, at rest.", "75 unknowns",
                            "Model: planar"),
    "damped_column": ("Kelvin-Voigt damping, 0.03 s times",
                      "equilibrium at load factor 1 (Force at column.end, constant), at rest; "
                      "then the loads are removed"),
    "released_column": ("(Force at column.end, Moment at column.end, as they are just before t = 0)",
                        "then the load factor is 1.1"),
    "whirling_shaft": ("a drag of 10 1/s times the momentum", "rotation by RunUp, steps end at t = 0, 6 s",
                       "Model: spatial"),
}  # fmt: skip


@pytest.mark.parametrize("name", WORDS)
def test_explain(name):
    found = cf.read(MOTIONS / f"{name}.toml")
    scene, settings = found.scene, found.motion
    told = explain.explain_motion(scene, settings)
    for words in WORDS[name]:
        assert words in told, told


def test_explained_is_what_is_done(cosserat):
    code, said, _ = cosserat("explain", FLIGHT, *SHORT, "--elements", "3", "--scheme", "energy")
    assert code == 0 and "Motion: 1 s" in said and "Scheme: energy" in said
    scene = cf.read(FLIGHT).scene
    history = cf.simulate(scene, 0.1, dt=0.05, elements=3, scheme="energy")
    assert f" {history.unknowns} unknowns" in said
    assert cosserat("explain", DEMO) == cosserat("explain", DEMO, "--static")


@pytest.mark.parametrize(
    "arguments, words",
    [
        (("run", FLIGHT, "--load-factors", "0:1"), "--load-factors is for an equilibrium path"),
        (("run", DEMO, "--dt", "0.1"), "--dt is for a motion, and this scene is an equilibrium path"),
        (
            ("run", FLIGHT, "--static"),
            "depends on time, which a static analysis excludes: expected a vector, a function of the arc length",
        ),
        (("run", FLIGHT, "--animate"), "expected a motion, and -o DIR"),
        (("run", FLIGHT, "--animate", "a.avi", "-o", "{tmp}"), "expected a name that ends in .gif or .mp4"),
        (("run", FLIGHT, "--animate", "b/a.gif", "-o", "{tmp}"), "expected a name without folders"),
        (("run", FLIGHT, "--at", "x", "-o", "{tmp}"), "--at x: expected A,B,..."),
        (("run", FLIGHT, "--duration", "-1"), "simulate.duration = -1.0"),
        (("explain", FLIGHT, "--scheme", "momentun"), "did you mean 'momentum'?"),
        (("explain", DEMO, "--duration", "nan"), "simulate.duration = nan"),
        (("explain", FLIGHT, "--elements", "0"), "simulate.elements = 0"),
    ],
)
def test_refused(arguments, words, tmp_path, cosserat):
    code, _, trouble = cosserat(*(str(x).format(tmp=tmp_path) for x in arguments))
    assert code == 2 and words in trouble, trouble


def test_damping_by_a_ratio(tmp_path):
    def damped(by):
        text = (MOTIONS / "damped_column.toml").read_text()
        assert text.count("damping = ") == 1
        file = tmp_path / "scene.toml"
        file.write_text(re.sub("damping = .*", f"damping = {by}", text))
        return cf.read(file).scene.rods[0].damping

    assert damped("{ ratio = 0.02, frequencies = [1, 10] }") == cf.Damping.ratio(0.02, (1.0, 10.0))
    for by, words in (("{ ratio = 0.02 }", "'frequencies' is missing"),
                      ("{ ratio = 2, frequencies = [1, 2] }", "damping: Damping.ratio"),
                      ("{ ratio = 0.1, frequencies = [1, 2], time = 1 }", "unknown key 'time'")):  # fmt: skip
        with pytest.raises(cf.SceneError) as refusal:
            damped(by)
        assert words in str(refusal.value)


TABLES = {
    "[simulate]\ndt = 0.1": "[simulate]: 'duration' is missing",
    "[simulate]\nduration = 1\nduratoin = 2": "[simulate]: unknown key 'duratoin'",
    "[simulate]\nduration = 'long'": "simulate.duration = 'long': expected a number",
    "[simulate]\nduration = 1\nelements = 2.5": "simulate.elements = 2.5: expected a whole number",
}


@pytest.mark.parametrize("table", TABLES)
def test_tables_that_are_refused(table, tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(DEMO.read_text() + table)
    with pytest.raises(cf.SceneError) as refusal:
        cf.read(file)
    assert TABLES[table] in str(refusal.value)


def test_a_static_scene_has_no_motion_and_may_be_given_one(cosserat):
    assert cf.read(DEMO).motion == {}
    code, said, _ = cosserat("run", DEMO, "--duration", "0.5", "--dt", "0.05", "--start", "0.5", "--elements", "2")
    assert code == 0 and "10 steps, 11 times" in said
    last = [line for line in said.splitlines() if line.startswith("│")][-1].split("│")
    assert float(last[5]) < 1e-6, "under constant loads an equilibrium stays"


def test_what_a_start_takes_from_loads_in_time():
    """Loads just before t = 0: a Step from 0 on does not act yet, one up to 0 still acts and is then released."""
    section = cf.Stiffness((1e5, 1e5), 1e5, (1e3, 1e3), 1e3, mass=2.0, inertia=(0.1, 0.1, 0.2))
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), section)
    v = (0.0, 0.0, -5.0)

    def scene(signal):
        return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, signal)])

    for signal, factor in ((cf.signals.Step(v), 0), (cf.signals.Step(v, -1, 0), 1), (cf.signals.Ramp(v), 0),
                           (cf.signals.Ramp(v, -1, 1), 0.5),
                           (cf.signals.Table((0, 1), (v, v)), 1)):  # fmt: skip
        np.testing.assert_allclose(before(scene(signal)).loads[0].force, np.multiply(factor, v))
    released = cf.simulate(scene(cf.signals.Step(v, -1, 0)), 0.2, dt=0.01, start=2.0, elements=2, degree=2)
    path = cf.solve(scene(v), [2.0], elements=2, degree=2, model="planar")
    np.testing.assert_allclose(released.position(rod.end)[0], path.position(rod.end)[0], atol=1e-12)
    assert (
        released.kinetic[-1] > 0.1 * released.strain[0] and np.abs(released.balance).max() < 1e-3 * released.strain[0]
    )
    still = cf.simulate(scene(v), 0.2, dt=0.01, start=2.0, elements=2, degree=2)
    assert np.ptp(still.position(rod.end), axis=0).max() < 1e-12 and still.kinetic.max() < 1e-20


def test_a_run_up():
    """Its acceleration is continuous, and its angle is the integral of its speed."""
    run = cf.signals.RunUp((0, 0, 6.0), 1.0, 16.0)
    t = np.linspace(0, 20, 20001)
    angle = np.array([run(x)[2] for x in t])
    speed = np.gradient(angle, t)
    assert run(0.5) == (0, 0, 0) and angle[-1] == pytest.approx(6 * (20 - 1 - 7.5), rel=1e-12)
    assert speed[t > 16.01] == pytest.approx(6) and np.diff(speed).min() > -1e-9
    assert np.abs(np.gradient(speed, t))[(np.abs(t - 1) < 0.05) | (np.abs(t - 16) < 0.05)].max() < 1e-3
    assert run.jumps == (1.0, 16.0)
