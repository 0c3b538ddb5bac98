"""What one rank of the command line raises alone ends all of them; what all raise is said once."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import COMM, column

import cosserat_fenicsx as cf
from cosserat_fenicsx.ranks import on_first

ROOT = Path(__file__).parent.parent
CODE = """
import sys
from mpi4py import MPI
from cosserat_fenicsx import compat, cli, errors
from cosserat_fenicsx.cli import main, say
from cosserat_fenicsx.statics import solve as statics
say._PATIENCE = 0.5
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


@pytest.mark.parametrize(
    ("problem", "other"),
    [(OSError(28, "full", "file"), OSError), (Odd(1, 2), RuntimeError), (MemoryError("x"), MemoryError)],
)
def test_what_the_first_rank_raises_for_all_is_raised_by_all(problem, other):
    def fails():
        raise problem

    expected = type(problem) if COMM.rank == 0 else other
    with pytest.raises(expected) as raised:
        on_first(COMM, fails)
    assert str(problem) in str(raised.value)


def test_a_writer_that_fails_for_any_reason_fails_on_all_ranks(tmp_path_all, monkeypatch):
    from cosserat_fenicsx.results.export import xdmf

    def fails(*given):
        raise ValueError("odd")

    monkeypatch.setattr(xdmf, "meshes_of", fails)
    path = cf.solve(column()[1], [0.1], elements=2)
    with pytest.raises(ValueError, match="odd"):
        path.write(tmp_path_all / "path.xdmf")
    COMM.barrier()
    assert not list(tmp_path_all.iterdir())
