"""The command line: output, exit codes, no tracebacks."""

import csv
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
ROOT = Path(__file__).parent.parent
DEMO = ROOT / "demos" / "eccentric_cantilever.toml"


def cosserat(*arguments, **environment):
    """Run the command line in a separate process."""
    return subprocess.run(
        [sys.executable, "-m", "cosserat_fenicsx.cli.main", *map(str, arguments)],
        capture_output=True,
        encoding="utf-8",
        cwd=ROOT,
        env={**os.environ, **environment},
    )


def test_help_and_version_load_nothing_heavy():
    code = (
        "import sys, cosserat_fenicsx.cli.main; print({'numpy', 'dolfinx', 'petsc4py', 'mpi4py', 'pyvista'} &"
        " set(sys.modules))"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert loaded.stdout.strip() == "set()", loaded.stderr
    help_ = cosserat("--help")
    assert help_.returncode == 0 and "run" in help_.stdout and "explain" in help_.stdout
    assert cosserat("--version").stdout.startswith("cosserat_fenicsx 0.")


@pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"], ["schema"], ["explain", DEMO]])
def test_a_reader_that_has_enough_ends_no_command(arguments):
    """Such as `head`: the pipe is closed before the first line."""
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "cosserat_fenicsx", *map(str, arguments)]
    done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, text=True, cwd=ROOT)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")


def test_run_prints_a_table_and_writes_files(tmp_path):
    out = tmp_path / "new" / "out"
    done = cosserat("run", DEMO, "--load-factors", "0.5,0.9", "-o", out)
    assert done.returncode == 0, done.stderr
    assert "2.20061545" in done.stdout and "est. error" in done.stdout
    names = {"path.xdmf", "path.h5", "path.csv", "result.h5", "rods.png", "rods.html"}
    assert {f.name for f in out.iterdir()} == names
    assert cf.read_path(out / "result.h5").load_factors.tolist() == [0.5, 0.9]
    rows = list(csv.DictReader((out / "path.csv").open()))
    assert [row["load factor"] for row in rows] == ["0.5", "0.9"]
    assert float(rows[1]["column.end displacement (m) x"]) == pytest.approx(2.200615447827733, rel=1e-8)
    assert done.stderr == ""


def test_the_table_shows_a_station_and_the_reaction():
    """Reactions against the equilibrium of the whole column: the force, and its moment about the foot."""
    from cosserat_fenicsx import euler_load

    done = cosserat("run", DEMO, "--load-factors", "0.9", "--station", "column@10")
    assert done.returncode == 0 and "rotation: of column@10." in done.stdout, done.stderr
    P = 0.9 * euler_load(cf.read(DEMO).scene.rods[0])
    force, moment = re.search(r"Clamp at column.start exerts \((.*?)\) N and \((.*?)\) N m", done.stdout).groups()
    assert [float(x) for x in force.split(", ")] == pytest.approx([0, 0, P], rel=1e-5)
    assert [float(x) for x in moment.split(", ")] == pytest.approx([0, -P * (0.2 + 2.200615447827733), 0], rel=1e-5)
    assert re.search(r"bending moment [\d.e+]+ N m \(column.start, load factor 0.9\)", done.stdout)
    assert "'colum', did you mean 'column'?" in cosserat("run", DEMO, "--station", "colum.end").stderr


def test_pictures_are_asked_for(tmp_path):
    """Options for points and magnification; the picture suggests a magnification where displacements are invisible."""
    from cosserat_fenicsx import solve
    from cosserat_fenicsx.pictures import plot

    look = ("--at", "0.01,0.03", "--magnify", "500")
    done = cosserat("run", DEMO, "--load-factors", "0.01,0.02,0.03", "-o", tmp_path, *look)
    assert done.returncode == 0 and (tmp_path / "rods.png").stat().st_size > 10_000, done.stderr
    scene = cf.read(DEMO).scene
    path = solve(scene, [0.01, 0.02, 0.03])
    assert (
        plot._small(path, [0, 2], 20.0, 1.0)
        == "displacements are at most 0.0076 m, magnify=100 (--magnify 100) shows them"
    )
    assert plot._small(path, [0, 2], 20.0, 100.0) == ""
    refused = cosserat("run", DEMO, "--load-factors", "0.01", "-o", tmp_path, "--magnify", "-2")
    assert refused.returncode == 2 and "plot.magnify = -2.0" in refused.stderr


def test_run_of_a_range_lets_the_solver_choose():
    done = cosserat("run", DEMO, "--load-factors", "0:0.9", "--elements", "8", "--degree", "3")
    assert done.returncode == 0 and "unknown" in done.stdout and "2.2006154" in done.stdout


def test_explain():
    told = cosserat("explain", DEMO)
    assert told.returncode == 0, told.stderr
    for words in (
        "length 20 m", "Clamp at column.start", "tol = 1e-06",
        "Model: determinate (the angle theta along the rods alone): all rods and loads lie in the x-z plane; one clamp "
        "and",
        "24 determinate, 72 planar, 168 spatial",
    ):  # fmt: skip
        assert words in told.stdout
    assert "168 unknowns" in cosserat("explain", DEMO, "--model", "spatial").stdout


def test_a_reader_that_has_enough_is_no_error():
    first = [sys.executable, "-m", "cosserat_fenicsx", "schema"]
    with subprocess.Popen(first, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT) as process:
        process.stdout.close()
        assert (process.wait(60), process.stderr.read()) == (0, b"")


def test_explained_size_is_the_solved_size():
    from cosserat_fenicsx import solve

    scene = cf.read(DEMO).scene
    for formulation in ("mixed", "multiplier"):
        told = cosserat("explain", DEMO, "--elements", "3", "--formulation", formulation).stdout
        path = solve(scene, [0.01], elements=3, formulation=formulation)
        assert f" {path.unknowns} unknowns" in told


def test_not_converged_is_exit_code_1_with_the_partial_path(tmp_path):
    """Two elements cannot carry a load a billion times the critical one."""
    done = cosserat("run", DEMO, "--load-factors", "0.5,1e9", "--elements", "2", "-o", tmp_path, "--no-picture")
    assert done.returncode == 1
    assert "no equilibrium was found beyond the load factor" in done.stderr
    assert "0.5" in done.stdout and (tmp_path / "path.xdmf").is_file()


@pytest.mark.parametrize(
    "arguments, words",
    [
        (("run", "nowhere.toml"), "nowhere.toml: cannot be read"),
        (("run", DEMO, "--load-factors", "1:2:3"), "expected A:B"),
        (("run", DEMO, "--load-factors", "a"), "load factors 'a'"),
        (("run", DEMO, "--tol", "-1"), "tol = -1.0"),
        (("run", DEMO, "--formulation", "mixt"), "did you mean 'mixed'?"),
        (("run", DEMO, "-o", DEMO), "eccentric_cantilever.toml"),
        (("explain", DEMO, "--degree", "9"), "degree = 9"),
        (("explode",), "invalid choice"),
        ((), "usage"),
    ],
)
def test_bad_input_is_exit_code_2_without_a_traceback(arguments, words):
    refused = cosserat(*arguments)
    assert refused.returncode == 2
    assert words in refused.stderr + refused.stdout
    assert "Traceback" not in refused.stderr


def test_unwritable_folder(tmp_path):
    (tmp_path / "file").write_text("")
    refused = cosserat("run", DEMO, "-o", tmp_path / "file" / "out")
    assert refused.returncode == 2 and "Not a directory" in refused.stderr and "Traceback" not in refused.stderr


def test_dolfinx_missing(tmp_path):
    """A dummy module that cannot be imported takes its place."""
    (tmp_path / "dolfinx.py").write_text("raise ImportError('No module named dolfinx')")
    refused = cosserat("run", DEMO, PYTHONPATH=str(tmp_path))
    assert refused.returncode == 2
    assert "dolfinx cannot be imported" in refused.stderr and "apt install python3-dolfinx" in refused.stderr
    assert "Traceback" not in refused.stderr


def test_petsc_for_complex_numbers():
    import numpy as np

    from cosserat_fenicsx.compat import require_real_scalars
    from cosserat_fenicsx.errors import InstallationError

    with pytest.raises(InstallationError, match="built for complex numbers"):
        require_real_scalars(np.complex128)


def test_a_second_process_compiles_nothing(tmp_path):
    """The names in the code cache must not depend on the forms compiled before."""
    counts = []
    for _ in range(2):
        done = cosserat(
            "run", DEMO, "--load-factors", "0.5", "--degree", "1", "--elements", "2", XDG_CACHE_HOME=str(tmp_path)
        )
        assert done.returncode == 0, done.stderr
        counts.append(len(list(tmp_path.rglob("*.so"))))
    assert counts[0] == counts[1] > 0


@pytest.mark.slow
def test_ctrl_c_keeps_what_is_done(tmp_path):
    """SIGINT in the middle of a long list of load factors: table, files, exit code."""
    scene = tmp_path / "scene.toml"
    head, _, _ = DEMO.read_text(encoding="utf-8").partition("[solve]")
    scene.write_text(
        f"{head}[solve]\nload_factors = {[k / 5000 for k in range(1, 5000)]}\nelements = 64\nmodel = 'spatial'\n",
        encoding="utf-8",
    )
    command = [sys.executable, "-m", "cosserat_fenicsx", "run", str(scene), "-o", str(tmp_path), "--no-picture"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", cwd=ROOT)
    while "cosserat_chain" not in Path(f"/proc/{process.pid}/maps").read_text():  # nothing is left to compile then
        time.sleep(0.02)
    time.sleep(1)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130 and "interrupted after" in err and "Traceback" not in err
    assert "exception" not in err  # of which the command line has none
    assert "load factor" in out and (tmp_path / "path.csv").is_file() and (tmp_path / "path.xdmf").is_file()


@pytest.mark.parametrize("scene", sorted(DEMO.parent.glob("*.toml")), ids=lambda file: file.stem)
def test_every_demo_scene(scene, tmp_path):
    """explain, run and buckling; the bend and Lee's frame give the values stated in their files."""
    told = cosserat("explain", scene)
    assert told.returncode == 0 and "Model: " in told.stdout, told.stderr
    done = cosserat("run", scene, "--tol", "1e-4", "-o", tmp_path, "--no-picture")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "path.csv").is_file() and (tmp_path / "path.xdmf").is_file()
    if scene.stem == "bend_45":
        assert "-23.5602" in done.stdout and "53.4748" in done.stdout
    if scene.stem == "lees_frame":
        snapped = cosserat("run", scene, "--load-factors", "0:2", "--tol", "1e-4")
        assert "Limit point at the load factor 1.85465" in snapped.stdout, snapped.stdout
        assert (
            "Limit point at the load factor -0.9396" in snapped.stdout and "promoted from the planar" in snapped.stdout
        )


def test_buckling():
    done = cosserat("buckling", DEMO, "--count", "2")
    assert done.returncode == 0 and "critical load factor" in done.stdout, done.stderr


def test_modes(capsys):
    """Frequencies are those of `modes`; the table gives place and direction of the largest displacement."""
    from cosserat_fenicsx import modes
    from cosserat_fenicsx.cli import main as cli

    assert cli.main(["modes", str(DEMO), "--count", "2"]) == 0
    said = capsys.readouterr().out
    found = modes(cf.read(DEMO).scene, 2)
    rows = [line.split("│") for line in said.splitlines() if line.startswith("│")]
    assert [float(row[2]) for row in rows] == pytest.approx(found.frequencies, rel=1e-6)
    for row in rows:
        along = [float(x) for x in row[7:10]]
        assert "column.end" in row[6] and along[2] == 0 and np.hypot(*along[:2]) == pytest.approx(1, abs=0.01)


def test_soft_materials_are_asked_about(tmp_path, capsys):
    from cosserat_fenicsx.cli import main as cli

    file = tmp_path / "scene.toml"
    file.write_text(re.sub("E = .*", "E = 210000", DEMO.read_text()))
    cli.main(["run", str(file), "--load-factors", "1e-9"])
    assert "E = 210000 Pa is softer than most rubbers: are the units SI" in capsys.readouterr().err


TITLE = "a [/red] title [bold] :smile: \u00e9"


def test_titles_and_names_are_printed_as_they_are(tmp_path, monkeypatch):
    """No markup, no emoji; and ASCII where standard output knows nothing else."""
    import io

    from cosserat_fenicsx.cli import main as cli

    text = (
        DEMO.read_text(encoding="utf-8")
        .replace("Eccentrically compressed cantilever", TITLE)
        .replace("column", "rod[/red]")
    )
    file = tmp_path / "scene.toml"
    file.write_text(text, encoding="utf-8")
    for encoding, title in (("utf-8", TITLE), ("ascii", "[bold] :smile: \\xe9")):
        out = io.TextIOWrapper(io.BytesIO(), encoding=encoding, write_through=True)
        monkeypatch.setattr(sys, "stdout", out)
        assert cli.main(["run", str(file), "--load-factors", "0.1", "--elements", "4"]) == 0
        monkeypatch.undo()
        printed = out.buffer.getvalue().decode(encoding)
        assert title in printed and "rod[/red].end" in printed
