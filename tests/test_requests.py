"""How computations end: refused requests, Ctrl-C, ranks that fail, full disks, freed memory; their progress."""

import contextlib
import gc
import io
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
import tracemalloc
import warnings
import weakref
from pathlib import Path

import pytest
from conftest import COMM, column, computing

import cosserat_fenicsx as cf
from cosserat_fenicsx import progress
from cosserat_fenicsx.algebra.pool import ProblemPool
from cosserat_fenicsx.dynamics import simulate as of_motions
from cosserat_fenicsx.models.rodmesh import RodMesh
from cosserat_fenicsx.ranks import on_first
from cosserat_fenicsx.statics import problem as of_equilibria
from cosserat_fenicsx.statics import small_motions

ROOT = Path(__file__).parent.parent
DEMO = ROOT / "demos" / "eccentric_cantilever.toml"


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize(("command", "number"), [(["buckling", "--elements", "4000"], signal.SIGINT),
                                                 (["modes"], signal.SIGTERM)])  # fmt: skip
def test_long_eigenproblems_end_soon_after_a_signal(command, number, tmp_path):
    """The column under its force alone, which has more load factors than under the moment of an eccentric one."""
    file = tmp_path / "column.toml"
    file.write_text(DEMO.read_text(encoding="utf-8").rpartition("[[loads]]")[0], encoding="utf-8")
    arguments = [sys.executable, "-m", "cosserat_fenicsx", *command, str(file), "--count", "3000"]
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", cwd=ROOT)
    computing(process)
    time.sleep(1.5)
    assert process.poll() is None, "it takes minutes"
    process.send_signal(number)
    out, err = process.communicate(timeout=15)
    # A line of progress comes first where the machine is busy.
    assert (process.returncode, out) == (130, "") and err.splitlines()[-1].startswith("cosserat: interrupted")


@pytest.mark.serial
@pytest.mark.parametrize("waiting, words", [("patience", "; it ends after the step at work"), ("nullcontext", "\n")])
def test_of_two_signals_the_first_is_told(waiting, words):
    """The second one ends the process before the work has ended, or while it is being ended."""
    code = f"""
import os, signal, time
from contextlib import nullcontext
from cosserat_fenicsx.interrupts import listen, patience
listen()
try:
    with {waiting}():
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.02)
finally:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(10)"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8", timeout=60, cwd=ROOT)
    assert done.returncode == -signal.SIGINT and done.stderr.startswith(f"cosserat: interrupted{words}")
    assert done.stderr.count("interrupted") == 1


@pytest.mark.serial
def test_a_thread_that_waits_is_interrupted(monkeypatch):
    """At once, although the thread goes on; an exception in the thread is raised in the caller."""
    from cosserat_fenicsx import interrupts

    assert interrupts.interruptible(lambda: 7) == 7
    with pytest.raises(ZeroDivisionError):
        interrupts.interruptible(lambda: 1 / 0)
    monkeypatch.setattr(interrupts, "_asked", True)
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        interrupts.interruptible(lambda: time.sleep(5))
    assert time.monotonic() - began < 2


def motions(scene, **more):
    return cf.simulate(scene, 1.0, dt=0.1, **more)


@pytest.mark.serial
@pytest.mark.parametrize("work", [cf.buckling, cf.modes, motions, lambda scene, **more: cf.solve(scene, [1.0], **more)])
def test_too_many_elements_are_refused_before_the_work(work):
    """With a message, and without allocating memory for all elements."""
    _, scene = column()
    tracemalloc.start()
    with pytest.raises(cf.SceneError, match="elements = 1000000000 on 1 rod.* expected at most 100000 per rod"):
        work(scene, elements=1_000_000_000)
    assert tracemalloc.get_traced_memory()[1] < 1e8
    tracemalloc.stop()
    with pytest.raises(cf.SceneError, match="degree = 1000000000: expected 1, 2, 3 or 4"):
        work(scene, degree=1_000_000_000)


@pytest.mark.serial
@pytest.mark.parametrize("more", [(), ("--duration", "1")])
@pytest.mark.parametrize("command", ["run", "explain"])
def test_the_command_line_refuses_both(command, more, tmp_path, capsys, monkeypatch):
    from cosserat_fenicsx import interrupts
    from cosserat_fenicsx.cli import main as cli

    monkeypatch.setattr(interrupts, "listen", lambda: None)  # signals belong to pytest
    assert cli.main([command, str(DEMO), "--elements", "1000000000", *more]) == 2
    assert "expected at most 100000 per rod" in capsys.readouterr().err
    file = tmp_path / "scene.toml"
    scene = re.sub(r"force = \[.*\]", "force = [0, 0, 1e30]", DEMO.read_text(encoding="utf-8"))
    file.write_text(scene, encoding="utf-8")
    assert cli.main([command, str(file), *more]) == 2
    words = "Force at column.end: 1e.30 N.* expected at most 0.5 EA = 3.3e.09 N.*units"
    assert re.search(words, capsys.readouterr().err)


@pytest.mark.serial
def test_enormous_loads_and_motions_are_refused_before_the_work():
    steel = cf.Material(E=210e9, nu=0.3, density=7850.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(0.2), steel)
    clamp, big = cf.Clamp(rod.start), (0, 0, 1e30)
    small = cf.Force(rod.end, (0, 0, 1.0))
    for supports, load, words in (
        ([clamp], cf.Force(rod.end, big), "Force at .*: 1e.30 N: expected at most (0.5 EA = 3.3e.09|1e.06 EA = 6)"),
        ([clamp], cf.FollowerMoment(rod.end, big),
         r"FollowerMoment at .*: 1e.30 N m: expected at most (0.5 EA times 0.05|1e.06 EA times 20) m = .* N m"),
        ([clamp], cf.LineForce(rod, big), "LineForce on .*: 2e.31 N"),
        ([clamp], cf.Weight((0, 0, 1e30)), "Weight: "),
        ([clamp], cf.Force(rod.end, big, permanent=True), "Force at .*: 1e.30 N"),
        ([clamp, cf.Prescribed(rod.end, displacement=big)], small, "displacement of 1e.30 m: expected at most 2e.07 m"),
        ([clamp, cf.Prescribed(rod.end, rotation=big)], small, "a rotation of 1e.30 rad: expected at most 1e.06 rad"),
    ):
        scene = cf.Scene([rod], supports, [load])
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for work in (
                lambda: cf.solve(scene, [0.5, 1.0]), lambda: cf.modes(scene, load_factor=1.0),
                lambda: cf.buckling(scene), lambda: cf.simulate(scene, 1.0),
            ):  # fmt: skip
                with pytest.raises(cf.SceneError, match=words):
                    work()
    with pytest.raises(cf.SceneError, match="1 N times the load factor 1e.16: expected"):
        cf.solve(cf.Scene([rod], [clamp], [small]), [1e16])
    bent = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness((1e5, 1e5), float("inf"), (1.0, 1.0), 1.0))
    with pytest.raises(cf.SceneError, match="expected at most 1e.15 EI/L.2 = 1e.15 N"):
        cf.solve(cf.Scene([bent], [cf.Clamp(bent.start)], [cf.Force(bent.end, big)]), [1.0])


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize("wanted, seen", [(True, True), (False, False), (None, False)])
def test_lines(wanted, seen, capsys):
    _, scene = column()
    cf.solve(scene, [0.5, 1.0], elements=4, progress=wanted)
    text = capsys.readouterr().err
    assert ("determinate, 16 unknowns: load factor" in text) == (seen and COMM.rank == 0)


def test_bar_in_a_terminal(monkeypatch):
    """A name such as that of a film is no markup."""
    screen = Terminal()
    monkeypatch.setattr(progress.sys, "stderr", screen)
    monkeypatch.setattr(progress, "_PATIENCE", 0.0)
    cf.solve(column()[1], [0.5, 1.0], elements=4)
    with progress.Progress([2.0], True, COMM) as bar:
        bar.start("a [/red] film [bold].gif")
        bar.reached(1.0)
    for words in ("16 unknowns", "a [/red] film [bold].gif"):
        assert (words in screen.getvalue()) == (COMM.rank == 0)


CODE = """
import sys
from mpi4py import MPI
from cosserat_fenicsx import compat, cli, errors
from cosserat_fenicsx.cli import main, output
from cosserat_fenicsx.statics import solve as statics
output._PATIENCE = 0.5
def solve(*scene, **settings):
    if MPI.COMM_WORLD.rank in {ranks}:
        raise {problem}
    MPI.COMM_WORLD.barrier()
statics.solve = solve
sys.exit(main.main(["run", {scene!r}]))
"""


@pytest.mark.serial
@pytest.mark.skipif(shutil.which("mpirun") is None, reason="needs mpirun")
@pytest.mark.parametrize(
    ("ranks", "problem", "said", "exit_code"),
    [
        ({1}, "MemoryError('no room')", "cosserat: rank 1 of 2 alone: MemoryError: no room\n", 1),
        ({0, 1}, "errors.SceneError('no scene')", "cosserat: no scene\n", 2),
    ],
)
def test_all_ranks_end(ranks, problem, said, exit_code):
    code = CODE.format(ranks=ranks, problem=problem, scene=str(ROOT / "demos" / "eccentric_cantilever.toml"))
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("OMPI_COMM", "PMIX", "ORTE"))}
    done = subprocess.run(
        ["mpirun", "--oversubscribe", "-n", "2", sys.executable, "-c", code],
        capture_output=True, encoding="utf-8", cwd=ROOT, timeout=60, env=clean,
    )  # fmt: skip
    assert done.returncode == exit_code, done.stderr
    assert done.stderr.count("cosserat: ") == 1 and said in done.stderr
    assert "Traceback" not in done.stderr


class Odd(Exception):
    """An exception that cannot be sent to other ranks."""

    def __init__(self, one, two):
        super().__init__(f"{one} and {two}")


@pytest.mark.parametrize(("problem", "other"), [
    (OSError(28, "full", "file"), OSError), (Odd(1, 2), RuntimeError), (MemoryError("x"), MemoryError),
])  # fmt: skip
def test_what_the_first_rank_raises_for_all_is_raised_by_all(problem, other):
    def fails():
        raise problem

    expected = type(problem) if COMM.rank == 0 else other
    with pytest.raises(expected) as raised:
        on_first(COMM, fails)
    assert str(problem) in str(raised.value)


def test_a_writer_that_fails_for_any_reason_fails_on_all_ranks(tmp_path_all, monkeypatch):
    from cosserat_fenicsx.results import xdmf

    def fails(*given):
        raise ValueError("odd")

    monkeypatch.setattr(xdmf, "meshes_of", fails)
    path = cf.solve(column()[1], [0.1], elements=2)
    with pytest.raises(ValueError, match="odd"):
        path.write(tmp_path_all / "path.xdmf")
    COMM.barrier()
    assert not list(tmp_path_all.iterdir())


#: Bytes that fit.
ROOM = 2000


@pytest.fixture(scope="module")
def results():
    _, scene = column()
    return {
        "path": cf.solve(scene, [0.1 * k for k in range(1, 20)], elements=4),
        "motion": cf.simulate(scene, 0.05, dt=0.002, elements=4, degree=2),
    }


@contextlib.contextmanager
def full_disk():
    """For as short as possible: pytest's own output may be a file that is longer."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


FILES = {
    "path.xdmf": lambda of, file: of["path"].write(file),
    "path.csv": lambda of, file: of["path"].write(file),
    "path.vtu": lambda of, file: of["path"].write(file),
    "rods.png": lambda of, file: of["path"].plot(file),
    "energy.pdf": lambda of, file: of["motion"].plot_energy(file),
    "film.gif": lambda of, file: of["motion"].animate(file, fps=4, speed=0.05, size=(320, 240)),
}


@pytest.mark.parametrize(
    "name", [name if name[:4] == "path" else pytest.param(name, marks=pytest.mark.serial) for name in FILES]
)
def test_a_full_disk(name, results, tmp_path_all):
    if COMM.rank == 0:
        (tmp_path_all / name).write_text("old")
    COMM.barrier()
    told = "it cannot be written .File too large.: make room there"
    with pytest.raises(OSError, match=told) as refusal, full_disk():
        FILES[name](results, tmp_path_all / name)
    assert Path(refusal.value.filename).parent == tmp_path_all
    COMM.barrier()
    assert [file.name for file in tmp_path_all.iterdir()] == [name] and (tmp_path_all / name).read_text() == "old"


@pytest.mark.serial
def test_a_device_is_written_to_as_it_is(results, tmp_path):
    """And not replaced by a file."""
    (tmp_path / "path.csv").symlink_to("/dev/full")
    with pytest.raises(OSError, match="No space left on device"):
        results["path"].write(tmp_path / "path.csv")
    assert Path("/dev/full").is_char_device()


@pytest.mark.serial
def test_the_command_line_says_what_is_written_and_what_is_not(tmp_path):
    """The table comes all the same; what fits is kept."""
    code = (
        "import resource, sys; from cosserat_fenicsx import compat; from cosserat_fenicsx.cli.main import main\n"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({ROOM},) * 2); sys.exit(main(sys.argv[1:]))"
    )
    scene = ROOT / "demos" / "eccentric_cantilever.toml"
    command = [sys.executable, "-c", code, "run", scene, "--load-factors", "0.1", "--elements", "4", "-o", tmp_path]
    done = subprocess.run(list(map(str, command)), capture_output=True, encoding="utf-8", cwd=ROOT)
    assert done.returncode == 2 and "Traceback" not in done.stderr, done.stderr
    assert f"written to {tmp_path}/: path.csv\n" in done.stdout
    assert done.stderr == (
        f"cosserat: {tmp_path}/path.h5: it cannot be written (File too large): make room there, or choose another "
        "folder\n"
    )
    assert [file.name for file in tmp_path.iterdir()] == ["path.csv"]


KEPT = 2
WORK = {
    "solve": lambda scene, n: cf.solve(scene, [0.1], elements=n, degree=2, model="spatial"),
    "arc length": lambda scene, n: cf.solve(scene, (0, 0.1), elements=n, degree=2, model="spatial", control="arc"),
    "simulate": lambda scene, n: cf.simulate(scene, 0.002, dt=0.001, elements=n, degree=2),
    "buckling": lambda scene, n: cf.buckling(scene, 1, elements=n, degree=2),
    "modes": lambda scene, n: cf.modes(scene, 1, elements=n, degree=2),
}


def resident():
    """The memory of this process, MB."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096 / 1e6


@pytest.fixture
def small_cache(monkeypatch):
    pool = ProblemPool(most_idle=KEPT)
    for module in (of_equilibria, of_motions, small_motions):
        monkeypatch.setattr(module, "PROBLEMS", pool)


@pytest.fixture
def meshes(monkeypatch):
    """The meshes that are alive; the garbage collector sleeps."""
    alive, begin = weakref.WeakSet(), RodMesh.__init__
    monkeypatch.setattr(RodMesh, "__init__", lambda self, *given: alive.add(self) or begin(self, *given))
    gc.collect()
    gc.disable()
    yield alive
    gc.enable()


@pytest.mark.parametrize(
    "work", [work if work[0] == "s" else pytest.param(work, marks=pytest.mark.serial) for work in WORK]
)
def test_what_leaves_the_cache_is_freed_at_once(work, small_cache, meshes):
    _, scene = column()
    for n in range(2, 6):
        WORK[work](scene, n)
    assert len(meshes) <= KEPT


@pytest.mark.serial
def test_memory_does_not_grow(small_cache):
    """A solve that is not freed leaves about 1 MB."""
    _, scene = column()
    for n in range(32, 36):
        WORK["arc length"](scene, n)
    before = resident()
    for n in range(20, 32):
        WORK["arc length"](scene, n)
    assert resident() - before < 3


@pytest.mark.serial
def test_a_users_error_leaves_nothing(small_cache, meshes):
    """What was half way is not kept, and not left behind either."""
    _, scene = column()
    for n in range(2, 5):
        with pytest.raises(ZeroDivisionError):
            cf.solve(scene, (0, 0.1), elements=n, degree=2, until=lambda path: 1 / 0)
    assert not meshes
