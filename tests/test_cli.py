"""The command line: output, exit codes, signals, motions, and no tracebacks."""

import csv
import io
import math
import os
import pty
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import computing, refused

import cosserat_fenicsx as cf
from cosserat_fenicsx import interrupts
from cosserat_fenicsx.cli import explain
from cosserat_fenicsx.cli import main as cli
from cosserat_fenicsx.dynamics.start import before
from cosserat_fenicsx.scene.signals import Triangle

pytestmark = pytest.mark.serial
ROOT = Path(__file__).parent.parent
DEMO = ROOT / "demos" / "eccentric_cantilever.toml"
MOTIONS = DEMO.parent / "motions"
FLIGHT = MOTIONS / "flying_spaghetti_3d.toml"
SHORT = ("--duration", "1", "--dt", "0.05")


def python(*words, **more):
    """Python in another process, at the top of the checkout."""
    return subprocess.run(
        [sys.executable, *map(str, words)], **({"capture_output": True, "encoding": "utf-8", "cwd": ROOT} | more)
    )


def cosserat(*arguments, **environment):
    return python("-m", "cosserat_fenicsx.cli.main", *arguments, env={**os.environ, **environment})


@pytest.fixture
def here(capsys, monkeypatch):
    """The command line in this process: exit code, stdout, stderr."""
    monkeypatch.setattr(interrupts, "listen", lambda: None)  # signals belong to pytest

    def command(*arguments):
        try:
            code = cli.main([str(x) for x in arguments])
        except SystemExit as end:  # of the parser of arguments
            code = end.code
        return code, *capsys.readouterr()

    return command


def test_help_and_version_load_nothing_heavy():
    heavy = "{'numpy', 'dolfinx', 'petsc4py', 'mpi4py', 'pyvista'}"
    loaded = python("-c", f"import sys, cosserat_fenicsx.cli.main; print({heavy} & set(sys.modules))")
    assert loaded.stdout.strip() == "set()", loaded.stderr
    help_ = cosserat("--help")
    assert help_.returncode == 0 and "run" in help_.stdout and "explain" in help_.stdout
    assert cosserat("--version").stdout.startswith("cosserat_fenicsx 0.")


@pytest.mark.parametrize("arguments", [["run", "--help"], ["explain", DEMO], None])
def test_a_reader_that_has_enough_ends_no_command(arguments):
    """Such as `head`: the pipe is closed before the first line. A script ends as Python does (None): PETSc takes the
    signal of a closed pipe, and would abort MPI."""
    script = ["-c", "import cosserat_fenicsx.compat; print(1, flush=True)"]
    reading, writing = os.pipe()
    os.close(reading)
    done = python(*(["-m", "cosserat_fenicsx", *arguments] if arguments else script), capture_output=False,
                  stdout=writing, stderr=subprocess.PIPE)  # fmt: skip
    os.close(writing)
    if arguments:
        assert (done.returncode, done.stderr) == (0, "")
    else:
        assert "BrokenPipeError" in done.stderr and "PETSC" not in done.stderr


def test_run_prints_a_table_and_writes_files(tmp_path, here):
    out = tmp_path / "new" / "out"
    code, said, trouble = here("run", DEMO, "--load-factors", "0.5,0.9", "-o", out)
    assert (code, trouble) == (0, "")
    assert "2.20061545" in said and "est. error" in said
    names = {"path.xdmf", "path.h5", "path.csv", "result.h5", "rods.png", "rods.html"}
    assert {f.name for f in out.iterdir()} == names
    assert cf.read_path(out / "result.h5").load_factors.tolist() == [0.5, 0.9]
    rows = list(csv.DictReader((out / "path.csv").open()))
    assert [row["load factor"] for row in rows] == ["0.5", "0.9"]
    assert float(rows[1]["column.end displacement (m) x"]) == pytest.approx(2.200615447827733, rel=1e-8)


WATCHED = """
import os, sys
from cosserat_fenicsx.cli.main import main

class Watch:
    def find_spec(self, name, path=None, target=None):
        if name in ("pyvista", "matplotlib"):
            print(f"{name} is imported beside", *sorted(os.listdir(out)), flush=True)

scene, out = sys.argv[1:]
sys.meta_path.insert(0, Watch())
for more in (["--no-picture"], []):
    print(main(["run", scene, "--load-factors", "0.5", "--elements", "4", "-o", out, *more]))
    print("loaded:", sorted({named} & set(sys.modules)))
"""
#: Slow to import, and not needed by a run of rods without pictures; h5py writes result.h5.
UNUSED = {"pyvista", "vtkmodules", "matplotlib", "meshio", "scipy", "pandas", "xarray", "IPython", "PIL",
          "cosserat_fenicsx.well", "cosserat_fenicsx.drilling", "cosserat_fenicsx.dynamics"}  # fmt: skip


def test_tables_and_files_wait_for_no_library_of_pictures(tmp_path):
    """Without pictures none is imported, nor others that have nothing to do; else once all other files are written."""
    done = python("-c", WATCHED.replace("{named}", str(UNUSED)), DEMO, tmp_path, check=True)
    lines = [line for line in done.stdout.splitlines() if line.startswith(("written", "loaded", "pyvista", "matplot"))]
    files = ["path.csv", "path.h5", "path.xdmf", "result.h5"]
    assert lines[:3] == [
        f"written to {tmp_path}/: path.csv, path.xdmf, path.h5, result.h5",
        "loaded: []",
        f"written to {tmp_path}/: path.csv, path.xdmf, path.h5, result.h5, rods.html",
    ]
    assert lines[3] == f"pyvista is imported beside {' '.join([*files, 'rods.html'])}"
    assert lines[-2] == f"written to {tmp_path}/: rods.png" and "'pyvista'" in lines[-1]


def test_the_table_shows_a_station_and_the_reaction(here):
    """Reactions against the equilibrium of the whole column: the force, and its moment about the foot."""
    code, said, trouble = here("run", DEMO, "--load-factors", "0.9", "--station", "column@10")
    assert code == 0 and "rotation: of column@10." in said, trouble
    P = 0.9 * cf.euler_load(cf.read(DEMO).scene.rods[0])
    force, moment = re.search(r"Clamp at column.start exerts \((.*?)\) N and \((.*?)\) N m", said).groups()
    assert [float(x) for x in force.split(", ")] == pytest.approx([0, 0, P], rel=1e-5)
    assert [float(x) for x in moment.split(", ")] == pytest.approx([0, -P * (0.2 + 2.200615447827733), 0], rel=1e-5)
    assert re.search(r"bending moment [\d.e+]+ N m \(column.start, load factor 0.9\)", said)
    code, said, _ = here("run", DEMO, "--load-factors", "0:0.9", "--elements", "8", "--degree", "3")
    assert code == 0 and "unknown" in said and "2.2006154" in said, "the solver chooses the steps of a range"


def test_pictures_are_asked_for(tmp_path, here):
    """Options for points and magnification; the picture suggests a magnification where displacements are invisible."""
    from cosserat_fenicsx.pictures.charts import asked
    from cosserat_fenicsx.pictures.drawing import too_small

    look = ("--at", "0.01,0.03", "--magnify", "500")
    code, _, trouble = here("run", DEMO, "--load-factors", "0.01,0.02,0.03", "-o", tmp_path, *look)
    assert code == 0 and (tmp_path / "rods.png").stat().st_size > 10_000, trouble
    path = cf.solve(cf.read(DEMO).scene, [0.01, 0.02, 0.03])
    assert too_small(path, [0, 2], 20.0, 1.0) == ["displacements are at most 0.0076 m: magnify=100"]
    assert too_small(path, [0, 2], 20.0, 100.0) == []
    assert " m here, 0.0076 m at load factor 0.03" in too_small(path, [0], 20.0, 1.0)[0]
    with asked(units={"length": "mm"}):
        assert too_small(path, [0, 2], 20.0, 1.0) == ["displacements are at most 7.6 mm: magnify=100"]


def test_explain(here):
    """The explained size is the solved size."""
    code, said, trouble = here("explain", DEMO)
    assert code == 0, trouble
    for words in (
        "length 20 m", "Clamp at column.start", "tol = 1e-06", "24 determinate, 72 planar, 168 spatial",
        "Model: determinate (the angle theta along the rods alone): all rods and loads lie in the x-z plane; one clamp "
        "and",
    ):  # fmt: skip
        assert words in said
    for options in ({"model": "spatial"}, {"formulation": "mixed"}, {"formulation": "multiplier"}):
        ((name, value),) = options.items()
        path = cf.solve(cf.read(DEMO).scene, [0.01], elements=3, **options)
        assert f" {path.unknowns} unknowns" in here("explain", DEMO, "--elements", "3", f"--{name}", value)[1]
    assert here("explain", DEMO) == here("explain", DEMO, "--static")
    code, said, _ = here("explain", FLIGHT, *SHORT, "--elements", "3", "--scheme", "energy")
    assert code == 0 and "Motion: 1 s" in said and "Scheme: energy" in said
    history = cf.simulate(cf.read(FLIGHT).scene, 0.1, dt=0.05, elements=3, scheme="energy")
    assert f" {history.unknowns} unknowns" in said


def test_not_converged_is_exit_code_1_with_the_partial_path(tmp_path, here):
    """Load control does not pass the limit point of Lee's frame."""
    more = ("--elements", "2", "-o", tmp_path, "--no-picture", "--control", "load")
    code, said, trouble = here("run", Path(DEMO).parent / "lees_frame.toml", "--load-factors", "0.5,5", *more)
    assert code == 1 and "no equilibrium was found beyond the load factor" in trouble
    assert "0.5" in said and (tmp_path / "path.xdmf").is_file()


@pytest.mark.parametrize("arguments, words", [
    (("run", "nowhere.toml"), "nowhere.toml: cannot be read"),
    (("run", DEMO, "--load-factors", "1:2:3"), "expected A:B"),
    (("run", DEMO, "--load-factors", "a"), "load factors 'a'"),
    (("run", DEMO, "--tol", "-1"), "tol = -1.0"),
    (("run", DEMO, "--formulation", "mixt"), "did you mean 'mixed'?"),
    (("run", DEMO, "--station", "colum.end"), "'colum', did you mean 'column'?"),
    (("run", DEMO, "-o", DEMO), "eccentric_cantilever.toml"),
    (("run", DEMO, "--load-factors", "0.01", "-o", "{tmp}", "--magnify", "-2"), "plot.magnify = -2.0"),
    (("explain", DEMO, "--degree", "9"), "degree = 9"),
    (("explode",), "invalid choice"),
    (("expl",), "did you mean 'explain'?"),
    (("plot",), "`cosserat run SCENE -o DIR` draws pictures"),
    ((), "usage"),
    (("run", FLIGHT, "--load-factors", "0:1"), "--load-factors is for an equilibrium path"),
    (("run", DEMO, "--dt", "0.1"), "--dt is for a motion, and this scene is an equilibrium path"),
    (("run", FLIGHT, "--static"),
     "depends on time, which a static analysis excludes: expected a vector, a function of the arc length"),
    (("run", "--animate", FLIGHT), "put the scene before --animate"),
    (("run", FLIGHT, "--animate"), "expected a motion, and -o DIR"),
    (("run", FLIGHT, "--animate", "a.avi", "-o", "{tmp}"), "expected a name that ends in .gif or .mp4"),
    (("run", FLIGHT, "--animate", "b/a.gif", "-o", "{tmp}"), "expected a name without folders"),
    (("run", FLIGHT, "--at", "x", "-o", "{tmp}"), "--at x: expected A,B,..."),
    (("run", FLIGHT, "--duration", "-1"), "simulate.duration = -1.0"),
    (("run", DEMO, "--folder", "{tmp}/b"), "--folder is for a motion"),
    (("resume", "{tmp}/b"), "no motion was found there"),
    (("explain", FLIGHT, "--scheme", "momentun"), "did you mean 'momentum'?"),
    (("explain", DEMO, "--duration", "nan"), "simulate.duration = nan"),
    (("explain", FLIGHT, "--elements", "0"), "simulate.elements = 0"),
])  # fmt: skip
def test_bad_input_is_exit_code_2_without_a_traceback(arguments, words, tmp_path, here):
    code, said, trouble = here(*(str(x).format(tmp=tmp_path) for x in arguments))
    assert code == 2 and words in trouble + said and "Traceback" not in trouble, trouble


def test_what_cannot_be_used_is_said(tmp_path):
    """A dummy module that cannot be imported takes the place of dolfinx; PETSc for complex numbers."""
    from cosserat_fenicsx.compat import require_real_scalars

    (tmp_path / "dolfinx.py").write_text("raise ImportError('No module named dolfinx')")
    refused = cosserat("run", DEMO, PYTHONPATH=str(tmp_path))
    assert refused.returncode == 2 and "Traceback" not in refused.stderr
    assert "dolfinx cannot be imported" in refused.stderr and "apt install python3-dolfinx" in refused.stderr
    with pytest.raises(cf.InstallationError, match="built for complex numbers"):
        require_real_scalars(np.complex128)


def many_points(folder):
    """The file of a scene whose path takes far longer than a test."""
    head, _, _ = DEMO.read_text(encoding="utf-8").partition("[solve]")
    factors = [k / 20000 for k in range(1, 20000)]
    scene = folder / "scene.toml"
    scene.write_text(f"{head}[solve]\nload_factors = {factors}\nelements = 64\nmodel = 'spatial'\n", encoding="utf-8")
    return scene


def test_ctrl_c_keeps_what_is_done(tmp_path):
    """SIGINT in the middle of a long list of load factors: table, files, exit code."""
    words = ["run", str(many_points(tmp_path)), "-o", str(tmp_path), "--no-picture"]
    command = [sys.executable, "-m", "cosserat_fenicsx", *words]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", cwd=ROOT)
    computing(process)
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130 and "interrupted after" in err and "Traceback" not in err
    assert "exception" not in err  # of which the command line has none
    assert "load factor" in out and (tmp_path / "path.csv").is_file() and (tmp_path / "path.xdmf").is_file()


def test_a_terminal_that_is_closed(tmp_path):
    """The path so far is written, although nothing can be printed any more."""
    at_once = """
import sys
from cosserat_fenicsx import __main__, progress
progress._PATIENCE = 0.1
sys.exit(__main__.main())"""
    process, terminal = pty.fork()
    if not process:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
        os.chdir(ROOT)
        words = ["run", str(many_points(tmp_path)), "-o", str(tmp_path), "--no-picture"]
        os.execv(sys.executable, [sys.executable, "-c", at_once, *words])
    os.read(terminal, 100)  # the progress bar appears
    os.close(terminal)
    _, status = os.waitpid(process, 0)
    assert os.waitstatus_to_exitcode(status) == 130
    assert {"path.csv", "path.xdmf", "path.h5"} <= {file.name for file in tmp_path.iterdir()}


@pytest.mark.parametrize("scene", sorted(DEMO.parent.glob("*.toml")), ids=lambda file: file.stem)
def test_every_demo_scene(scene, tmp_path, here):
    """explain; and run the two whose files state values (test_gallery.py solves all of them)."""
    code, said, trouble = here("explain", scene)
    assert code == 0 and "Model: " in said, trouble
    if scene.stem not in ("bend_45", "lees_frame"):
        return
    code, said, trouble = here("run", scene, "--tol", "1e-4", "-o", tmp_path, "--no-picture")
    assert code == 0, trouble
    assert (tmp_path / "path.csv").is_file() and (tmp_path / "path.xdmf").is_file()
    if scene.stem == "bend_45":
        assert "-23.5602" in said and "53.4748" in said
    if scene.stem == "lees_frame":
        _, said, _ = here("run", scene, "--load-factors", "0:2", "--tol", "1e-4")
        for words in ("at the load factor 1.85465", "at the load factor -0.9396", "promoted from the planar"):
            assert words in said


def test_modes(here):
    """Frequencies are those of `modes`; the table gives place and direction of the largest displacement."""
    code, said, _ = here("modes", DEMO, "--count", "2", "--damped", "--near", "10j")
    assert code == 0 and "eigenvalues with" in said
    code, said, _ = here("modes", DEMO, "--count", "2")
    found = cf.modes(cf.read(DEMO).scene, 2)
    rows = [line.split("│") for line in said.splitlines() if line.startswith("│")]
    assert code == 0 and [float(row[2]) for row in rows] == pytest.approx(found.frequencies, rel=1e-6)
    for row in rows:
        along = [float(x) for x in row[-4:-1]]
        assert "column.end" in row[-5] and along[2] == 0 and np.hypot(*along[:2]) == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize("command", ["buckling", "modes", "run"])
def test_doubts_come_once_and_first(command, tmp_path, here):
    text = DEMO.read_text(encoding="utf-8").replace("diameter = 0.2", "diameter = 16")
    (tmp_path / "thick.toml").write_text(text, encoding="utf-8")
    scene, words = cf.read(tmp_path / "thick.toml").scene, "rod 'column' is 16 m across and 20 m long"
    code, told, said = here(command, tmp_path / "thick.toml", "--elements", "2")
    assert code == 0 and said.count(words) == 1 and said.startswith(f"cosserat: warning: {words}")
    compute = {"buckling": cf.buckling, "modes": cf.modes, "run": cf.solve}[command]
    with pytest.warns(cf.SceneWarning, match=words):
        path = compute(scene, elements=2)
    if command == "run":
        assert str(path).startswith(f"First check: {words}") and f"First check: {words}" in told
        motion = cf.simulate(scene, 1e-5, dt=1e-5, elements=1, degree=2)
        assert str(motion).startswith("First check:") and motion.details().count(words) == 1


@pytest.mark.parametrize("command", ["buckling", "modes"])
def test_pictures_of_shapes_are_in_the_chosen_units(command, tmp_path, here, monkeypatch):
    from cosserat_fenicsx.pictures import drawing

    names, draw = set(), drawing.draw_axes
    monkeypatch.setattr(drawing, "draw_axes", lambda *given: names.update(x.name for x in given[2]) or draw(*given))
    code, _, said = here(command, DEMO, "--count", "1", "--elements", "2", "--units", "kN,mm", "-o", tmp_path)
    assert code == 0 and names == {"x (mm)", "y (mm)", "z (mm)"}, said
    assert here(command, DEMO, "--units", "mm,m")[::2] == (
        2, "cosserat: units = 'mm,m': 'mm' and a later one are units of the same kind: expected one of them (a dict of "
        "units by dimensions, or 'field', has lengths apart from diameters)\n"
    )  # fmt: skip


TITLE = "a [/red] title [bold] :smile: \u00e9"


def test_titles_and_names_are_printed_as_they_are(tmp_path, monkeypatch, here):
    """No markup, no emoji; and ASCII where standard output knows nothing else. Soft materials are asked about."""
    text = DEMO.read_text(encoding="utf-8").replace("Eccentrically compressed cantilever", TITLE)
    file = tmp_path / "scene.toml"
    file.write_text(text.replace("column", "rod[/red]"), encoding="utf-8")
    for encoding, title in (("utf-8", TITLE), ("ascii", "[bold] :smile: \\xe9")):
        out = io.TextIOWrapper(io.BytesIO(), encoding=encoding, write_through=True)
        monkeypatch.setattr(sys, "stdout", out)
        assert cli.main(["run", str(file), "--load-factors", "0.1", "--elements", "4"]) == 0
        monkeypatch.undo()
        printed = out.buffer.getvalue().decode(encoding)
        assert title in printed and "rod[/red].end" in printed
    file.write_text(re.sub("E = .*", "E = 210000", DEMO.read_text()))
    assert "than that of steel or cast iron: are the units SI" in here("run", file, "--load-factors", "1e-9")[2]


def test_run_of_a_motion(tmp_path, here):
    """Table, files and film; the numbers are those of `simulate`."""
    from PIL import Image

    film = ("--animate", "--speed", "5")
    code, said, trouble = here("run", FLIGHT, *SHORT, "-o", tmp_path, *film, "--at", "0,1", "--save-every", "0.1")
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


def test_a_motion_that_is_written_as_it_goes(tmp_path, here):
    """`--folder` and `resume` give the table of an uninterrupted run."""
    options = ("--dt", "0.05", "--elements", "2", "--degree", "2")
    assert here("run", FLIGHT, "--duration", "0.5", *options, "--folder", tmp_path / "a")[0] == 0
    code, said, trouble = here("resume", tmp_path / "a", "--duration", "1", "--at", "7", "-o", tmp_path / "out")
    assert code == 0 and trouble == "cosserat: --at 7 lies beyond 0 .. 1; the nearest is drawn\n"
    _, whole, _ = here("run", FLIGHT, "--duration", "1", *options)
    assert said.startswith(whole) and (tmp_path / "out" / "rods.png").is_file()
    code, _, trouble = here("resume", tmp_path / "a", "--duration", "0.2")
    assert code == 2 and "at least 1 s" in trouble, trouble


def test_a_load_that_fails_late_leaves_what_was_reached(tmp_path, here, monkeypatch):
    late = Triangle.__call__
    monkeypatch.setattr(Triangle, "__call__", lambda self, t: late(self, t) if t < 0.5 else (math.nan,) * 3)
    code, table, said = here("run", FLIGHT, "--model", "spatial", *SHORT, "-o", tmp_path, "--no-picture")
    assert code == 2 and "at the time t = 0.525 s, of the Force at" in said
    assert "0.5" in table and len((tmp_path / "motion.csv").read_text().splitlines()) > 10


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
def test_explain_a_motion(name):
    found = cf.read(MOTIONS / f"{name}.toml")
    told = explain.explain_motion(found.scene, found.motion)
    assert all(words in told for words in WORDS[name]), told


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
        with refused(words):
            damped(by)


def test_a_static_scene_has_no_motion_and_may_be_given_one(here):
    assert cf.read(DEMO).motion == {}
    code, said, _ = here("run", DEMO, "--duration", "0.5", "--dt", "0.05", "--start", "0.5", "--elements", "2")
    assert code == 0 and "10 steps, 11 times" in said
    last = [line for line in said.splitlines() if line.startswith("│")][-1].split("│")
    assert float(last[5]) < 1e-6, "under constant loads an equilibrium stays"


def test_what_a_start_takes_from_loads_in_time():
    """Loads just before t = 0: a Step from 0 on does not act yet, one up to 0 still acts and is then released."""
    section = cf.Stiffness((1e5, 1e5), 1e5, (1e3, 1e3), 1e3, mass=2.0, inertia=(0.1, 0.1, 0.2))
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), section)
    v = (0.0, 0.0, -5.0)

    def scene(force):
        return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, force)])

    step, ramp = cf.signals.Step, cf.signals.Ramp
    for force, factor in ((step(v), 0), (step(v, -1, 0), 1), (ramp(v), 0), (ramp(v, -1, 1), 0.5),
                          (cf.signals.Table((0, 1), (v, v)), 1)):  # fmt: skip
        np.testing.assert_allclose(before(scene(force)).loads[0].force, np.multiply(factor, v))
    released = cf.simulate(scene(cf.signals.Step(v, -1, 0)), 0.2, dt=0.01, start=2.0, elements=2, degree=2)
    path = cf.solve(scene(v), [2.0], elements=2, degree=2, model="planar")
    np.testing.assert_allclose(released.position(rod.end)[0], path.position(rod.end)[0], atol=1e-12)
    assert released.kinetic[-1] > 0.1 * released.strain[0]
    assert np.abs(released.balance).max() < 1e-3 * released.strain[0]
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


@pytest.mark.parametrize(
    ("number", "module"), [(signal.SIGINT, "cosserat_fenicsx.cli.main"), (signal.SIGTERM, "dolfinx")]
)
def test_while_modules_are_imported(number, module):
    code = f"""
import os, sys
class Hook:
    def find_spec(name, *more):
        if name == {module!r}:
            os.kill(os.getpid(), {int(number)})
sys.meta_path.insert(0, Hook)
from cosserat_fenicsx.__main__ import main
sys.exit(main())"""
    unhidden = lambda: signal.signal(number, signal.SIG_DFL)  # noqa: E731 - these tests may run under nohup
    done = python("-c", code, "explain", DEMO, preexec_fn=unhidden)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "cosserat: interrupted\n")


@pytest.mark.serial
def test_units_by_name(tmp_path, capsys):
    """In what is printed and in .csv files, of a string in a well."""
    from cosserat_fenicsx.cli.main import main

    file = ROOT / "demos" / "wells" / "volve_f12.toml"
    words = ["run", str(file), "-o", str(tmp_path), "--no-picture", "--model", "soft", "--units", "kN,mm"]
    assert main(words) == 0
    told, scene = capsys.readouterr().out, cf.read(file)
    hook = scene.answer(scene.operations[0]).hook_load
    assert f"hook load {hook / 1e3:.6g} kN" in told and "trip out, bit at 3.438e+06 mm" in told
    names, *_, last = (tmp_path / "trip_out.csv").read_text(encoding="utf-8").splitlines()
    assert names.startswith("measured depth (mm),north (mm)") and "effective tension (kN)" in names
    assert float(last.split(",")[0]) == pytest.approx(3438e3)
