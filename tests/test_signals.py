"""Signals at any moment, and a terminal that is closed: words, exit code 130, what is done is kept."""

import os
import pty
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.serial
ROOT = Path(__file__).parent.parent
DEMO = ROOT / "demos" / "eccentric_cantilever.toml"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("module", ["cosserat_fenicsx.cli.options", "dolfinx"])
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
    command = [sys.executable, "-c", code, "explain", str(DEMO)]
    done = subprocess.run(
        command, capture_output=True, encoding="utf-8", cwd=ROOT,
        preexec_fn=lambda: signal.signal(number, signal.SIG_DFL),  # these tests may run under nohup
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "cosserat: interrupted\n")


@pytest.mark.slow
def test_a_terminal_that_is_closed(tmp_path):
    """The path so far is written, although nothing can be printed any more."""
    head, _, _ = DEMO.read_text(encoding="utf-8").partition("[solve]")
    scene = tmp_path / "scene.toml"
    factors = [k / 20000 for k in range(1, 20000)]
    scene.write_text(f"{head}[solve]\nload_factors = {factors}\nelements = 64\nmodel = 'spatial'\n", encoding="utf-8")
    process, terminal = pty.fork()
    if not process:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
        os.chdir(ROOT)
        command = [sys.executable, "-m", "cosserat_fenicsx", "run", str(scene), "-o", str(tmp_path), "--no-picture"]
        os.execv(sys.executable, command)
    os.read(terminal, 100)  # the progress bar appears
    time.sleep(0.2)
    os.close(terminal)
    _, status = os.waitpid(process, 0)
    assert os.waitstatus_to_exitcode(status) == 130
    assert {"path.csv", "path.xdmf", "path.h5"} <= {file.name for file in tmp_path.iterdir()}
