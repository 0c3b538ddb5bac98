"""Under mpirun a rank that fails alone ends all ranks, which would wait for it for ever."""

import os
import pickle
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cosserat_fenicsx import ranks

pytestmark = [pytest.mark.serial, pytest.mark.skipif(shutil.which("mpirun") is None, reason="needs mpirun")]
ROOT = Path(__file__).parent.parent
BEGIN = """
import sys, threading, time
import cosserat_fenicsx as cf
from cosserat_fenicsx import ranks
assert "mpi4py" not in sys.modules
from mpi4py import MPI
ranks.PATIENCE = float(sys.argv[1])
rank, wait = MPI.COMM_WORLD.rank, MPI.COMM_WORLD.barrier
"""
SWEEP = """
pipe = cf.well.DrillPipe(size="5 in 19.50 lb/ft")
path = cf.well.WellPath.from_survey([0, 500, 1000], [0, 0, 30], [0, 0, 0])
hole = cf.well.Borehole(path, cf.well.HoleSection(1000.0, 0.2, 0.2))
given = hole, cf.well.DrillString([pipe]), cf.well.TripOut(), [1000.0]
if rank == 1:
    raise ValueError("one rank")
cf.well.depth_sweep(*given, mud=cf.well.Mud(1200.0), model="soft", folder="sweep")
"""
SOLVE = """
rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Circle(0.1), cf.Material(E=1e9, nu=0.3), name="rod")
scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -1.0))])
if rank == 1:
    raise ValueError("one rank")
cf.solve(scene, [1.0], elements=1)
"""
ALONE = "of 2 alone ended with"


def run(program, folder, patience):
    """(what `mpirun` returned, s)."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("OMPI_COMM", "PMIX", "ORTE"))}
    words, began = (
        ["mpirun", "--oversubscribe", "-n", "2", sys.executable, "-c", BEGIN + program, str(patience)],
        time.monotonic(),
    )
    done = subprocess.run(words, check=False, capture_output=True, encoding="utf-8", cwd=folder, timeout=60,
                          env={**clean, "PYTHONPATH": str(ROOT)})  # fmt: skip
    return done, time.monotonic() - began


@pytest.mark.parametrize(("program", "code", "said"), [
    (SWEEP, 1, "ValueError: one rank"),
    (SOLVE, 1, "ValueError: one rank"),
    ("rank == 1 and sys.exit(7)\nwait()", 7, "rank 1 of 2 alone ended with a failure"),
    ("rank == 0 and sys.exit('no input')\nwait()", 1, "no input\n"),
    ("rank == 1 and exit(7)\nwait()", 7, "rank 1 of 2 alone ended with a failure"),
    ("rank == 1 and threading.Thread(target=lambda: 1 / 0).start()\nrank == 0 and wait()", 1, "ZeroDivisionError"),
], ids=["depth_sweep", "solve", "exit", "exit with words", "exit of site", "thread"])  # fmt: skip
def test_one_rank_fails(program, code, said, tmp_path):
    done, seconds = run(program, tmp_path, 0.5)
    assert done.returncode == code and said in done.stderr and done.stderr.count(ALONE) == 1
    assert seconds < 20


@pytest.mark.parametrize(("program", "code", "said"), [
    ("raise ValueError('all of them')", 1, "all of them"),  # what ranks print before it may be mixed
    ("sys.exit(5)", 5, ""),
    ("time.sleep(2 * (rank == 0)); print('report' * (rank == 0)); sys.exit(0)", 0, "report"),
    ("try:\n    rank == 1 and sys.exit(3)\nexcept SystemExit as stop:\n    assert stop.code == 3\nwait()", 0, ""),
    ("try:\n    rank == 1 and 1 / 0\nexcept ArithmeticError:\n    wait()\nelse:\n    wait()", 0, ""),
], ids=["all raise", "all exit", "one ends early", "exit that is caught", "exception that is caught"])  # fmt: skip
def test_ranks_that_end_together_or_well_are_left_alone(program, code, said, tmp_path):
    done, _ = run(program, tmp_path, 10.0)  # as long as a loaded machine may need
    assert done.returncode == code and said in done.stdout + done.stderr and ALONE not in done.stderr


def test_one_process_is_not_watched():
    """Nor is MPI loaded by an import; each launcher is known by its variables."""
    code = "import sys, cosserat_fenicsx; print(sys.excepthook is sys.__excepthook__, 'mpi4py' in sys.modules)"
    clean = {name: value for name, value in os.environ.items() if name not in ranks.SIZES}
    for more, said in [({}, "True False"), *(({name: "2"}, "False False") for name in ranks.SIZES)]:
        done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, encoding="utf-8", cwd=ROOT,
                              env={**clean, **more})  # fmt: skip
        assert done.stdout.strip() == said, more


def test_what_exit_raises_is_what_python_raises():
    for status, code, arguments in (
        (None, None, ()), (3, 3, (3,)), ("words", "words", ("words",)), ((1, 2), (1, 2), (1, 2)),
    ):  # fmt: skip
        with pytest.raises(SystemExit) as stop:
            ranks._exit(status)
        try:
            sys.__dict__["exit"](status)
        except SystemExit as usual:
            assert stop.value.code == usual.code == code and stop.value.args == usual.args == arguments
        assert pickle.loads(pickle.dumps(stop.value)).args == arguments
