"""The cache of compiled code heals itself, and code that another user may have written is not loaded."""

import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import ufl

import cosserat_fenicsx as cf
from cosserat_fenicsx import code_cache, compat
from cosserat_fenicsx.compat import compiling

pytestmark = pytest.mark.serial
ROOT = Path(__file__).parent.parent
PROGRAM = "from test_code_cache import product; print(product())"
OTHER = 12345
as_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files to other users")


def product():
    """2 times 3, by a compiled expression."""
    with compiling():
        a = ufl.Constant(compat.interval_domain(), shape=(2,))
        (add,) = compat.on_rows([a[0] * a[1]])
    found = np.zeros((1, 1))
    add(np.array([[2.0, 3.0]]), found)
    return found[0, 0]


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "fenics"


@pytest.fixture
def compiler(tmp_path, monkeypatch):
    """A compiler that writes a line to the file `log` beside it, and then waits for half a second."""
    script, log = tmp_path / "cc", tmp_path / "log"
    script.write_text(f'#!/bin/sh\necho >> "{log}"\nsleep 0.5\nexec {os.environ.get("CC", "cc")} "$@"\n')
    script.chmod(0o755)
    monkeypatch.setenv("CC", str(script))
    return log


def started():
    paths = {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests")])}
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, encoding="utf-8", env={**os.environ, **paths}
    )


def kinds(folder):
    return sorted(file.name.removeprefix(file.name.split(".")[0]) for file in folder.iterdir())


WHOLE = sorted([".c", ".c.cached", code_cache.SUFFIX])


def test_a_killed_process_leaves_nothing_that_others_wait_for(cache, compiler):
    process = started()
    while not compiler.exists():
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert kinds(cache) != WHOLE
    began = time.monotonic()
    assert product() == 6 and time.monotonic() - began < 10  # dolfinx would wait so long, and then give up
    assert kinds(cache) == WHOLE


def test_of_several_processes_one_compiles(cache, compiler):
    processes = [started() for _ in range(3)]
    assert [process.communicate()[0] for process in processes] == ["6.0\n"] * 3
    assert compiler.read_text() == "\n\n"  # compiled once, and linked once
    assert kinds(cache) == WHOLE


def foreign(file):
    os.chown(file, OTHER, -1)


def shared(file):
    file.chmod(0o664)


def cut(file, kept):
    content = file.read_bytes()
    file.unlink()  # this process runs the code that is in it
    file.write_bytes(content[:kept])


def emptied(file):
    cut(file, 0)


def shortened(file):
    cut(file, -2000)


@pytest.mark.parametrize("damage", [Path.unlink, emptied, shortened, shared, pytest.param(foreign, marks=as_root)])
def test_files_that_cannot_be_used_are_made_anew(cache, damage):
    """Whatever stands beside them; also where FFCx of another release has begun the file."""
    assert product() == 6
    (file,) = cache.glob(f"*{code_cache.SUFFIX}")
    good = file.read_bytes()
    damage(file)
    (cache / file.name).with_name(file.name.split(".")[0] + ".c.cached").unlink()
    assert product() == 6
    assert file.read_bytes()[:-5000] == good[:-5000] and code_cache.why_unsafe(file) is None
    assert kinds(cache) == WHOLE


def test_nobody_else_may_write_there(cache):
    before = os.umask(0)
    try:
        product()
    finally:
        os.umask(before)
    assert not any(file.stat().st_mode & (stat.S_IWGRP | stat.S_IWOTH) for file in (cache, *cache.iterdir()))


@pytest.mark.parametrize("damage", [lambda path: path.chmod(0o777), pytest.param(foreign, marks=as_root)])
def test_a_folder_of_others_is_not_used(cache, damage):
    cache.mkdir()
    damage(cache)
    code_cache._say.cache_clear()
    with pytest.warns(RuntimeWarning, match=f"{cache} is not used, because it (belongs to another|can be written)"):
        assert product() == 6
    own = cache.with_name(f"fenics-{os.geteuid()}")
    assert not list(cache.iterdir()) and kinds(own) == WHOLE
    damage(own)
    with pytest.raises(cf.InstallationError, match=f"{own}, which .*: set XDG_CACHE_HOME"):
        product()


def test_the_command_line_says_so_without_the_place_in_the_code(cache):
    """Also after FFCx has been imported, which sends all warnings of a program to its log."""
    cache.mkdir(0o770)
    cache.chmod(0o770)
    code = (
        "import warnings\nfrom cosserat_fenicsx.cli.say import warnings_in_words\nfrom cosserat_fenicsx import "
        "code_cache\nwith warnings_in_words():\n    import cosserat_fenicsx.compat\n    code_cache.folder()"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, encoding="utf-8", cwd=ROOT)
    assert done.stderr == (
        f"cosserat: warning: the cache of compiled code {cache} is not used, because it can be written to by others; "
        f"{cache}-{os.geteuid()} takes its place (`chmod go-w {cache}` ends this)\n"
    )


def test_a_relative_path_is_ignored(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    for given in ("", "here", "./here"):
        monkeypatch.setenv("XDG_CACHE_HOME", given)
        assert code_cache.folder() == tmp_path / ".cache" / "fenics"
