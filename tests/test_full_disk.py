"""Files on a full disk: an OSError in words, the old file as it was, nothing half written; and exit code 2."""

import contextlib
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import COMM, column

import cosserat_fenicsx as cf

ROOT = Path(__file__).parent.parent
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


@pytest.mark.parametrize("name", FILES)
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
