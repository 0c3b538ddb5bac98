"""Compiled code: the C of the package, the cache that heals itself, and what goes wrong, in words."""

import errno
import os
import signal
import stat
import subprocess
import sys
import threading
import time
from functools import partial, wraps
from pathlib import Path

import numpy as np
import pytest
import ufl
from conftest import column

import cosserat_fenicsx as cf
from cosserat_fenicsx import code_cache, compat
from cosserat_fenicsx.actions.obstacles import _work_of
from cosserat_fenicsx.algebra import building
from cosserat_fenicsx.code_cache import folder
from cosserat_fenicsx.compat import compiling
from cosserat_fenicsx.forms import loads
from cosserat_fenicsx.forms.contact import linear, plane, sphere
from cosserat_fenicsx.models.formulation import Mixed, Multiplier

pytestmark = pytest.mark.serial
HEADER = """#ifndef SMALL_H
#define SMALL_H
typedef struct { double a, b; } pair;
double product(const pair *given);
#if 0
extern "Python" double change(double x);
#endif
#endif
"""
CODE = """#include "small.h"
static double change(double x);
int zero = 0;
double product(const pair *given) { return change(given->a * given->b) + KERNEL_ARGUMENTS + zero; }
"""


@pytest.fixture
def source(tmp_path, monkeypatch):
    """A small C file with its header, and an empty cache beside it."""
    (tmp_path / "small.h").write_text(HEADER)
    (tmp_path / "small.c").write_text(CODE)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    building.module.cache_clear()
    return tmp_path / "small.c"


def works(module):
    ffi, lib = module
    ffi.def_extern(name="change")(lambda x: -x)
    return lib.product(ffi.new("pair *", [2.0, 3.0])) == compat.KERNEL_ARGUMENTS - 6.0


def test_the_c_of_the_package_is_built(monkeypatch, tmp_path):
    """By a thread that was begun before it is asked for, and only once."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("COSSERAT_FENICSX_CFLAGS", "-O0")  # it is not run
    real, builders = building._build, []
    monkeypatch.setattr(building, "_build", lambda *task: builders.append(threading.current_thread()) or real(*task))
    building.begin.__wrapped__()
    while not builders:
        time.sleep(0.01)
    ffi, lib = building.module.__wrapped__()
    assert len(builders) == 1 and builders[0] is not threading.main_thread()
    (file,) = folder().iterdir()
    assert file.name.startswith("cosserat_chain_") and callable(lib.eliminate) and ffi.sizeof("kernel") > 0


def test_c_is_compiled_once_and_in_silence(source, monkeypatch, capfd):
    made = building.module(source)
    (file,) = folder().iterdir()  # and nothing else
    monkeypatch.setenv("CC", "/no/compiler")
    assert building.module(source) is made and works(made)
    building.module.cache_clear()
    assert works(building.module(source))  # loaded, not compiled
    assert capfd.readouterr() == ("", "")
    source.write_text(CODE + "\n")
    building.module.cache_clear()
    with pytest.raises(cf.InstallationError, match="/no/compiler"):
        building.module(source)
    assert list(folder().iterdir()) == [file]


@pytest.mark.parametrize("kept", [0.0, 0.5, 0.99])
def test_a_damaged_file_is_made_anew(source, monkeypatch, kept):
    building.module(source)
    (file,) = folder().iterdir()
    content = file.read_bytes()
    monkeypatch.setenv("XDG_CACHE_HOME", str(source.parent / "other"))  # Python loads nothing twice from one place
    folder().mkdir(parents=True)
    damaged = folder() / file.name
    damaged.write_bytes(content[: int(kept * len(content))])
    building.module.cache_clear()
    assert works(building.module(source)) and len(damaged.read_bytes()) == len(content)


def test_one_of_many_compiles(source, monkeypatch):
    compiler, log = source.parent / "cc", source.parent / "log"
    compiler.write_text(f'#!/bin/sh\necho >> "{log}"\nsleep 0.2\nexec {os.environ.get("CC", "cc")} "$@"\n')
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", f"{compiler} -DUNUSED")
    made = []
    threads = [threading.Thread(target=lambda: made.append(building.module.__wrapped__(source))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) == 4 and all(map(works, made)) and log.read_text() == "\n"


@pytest.mark.parametrize(("compiler", "words"), [
    ("/no/compiler", "No such file.*/no/compiler'.*apt install gcc python3-dev.*no CC set to another"),
    ("false", r"\(false: exit code 1\).*apt install gcc"),
    ("cc -include missing.h", r"\(.*fatal error: missing.h: No such file.*\).*apt install gcc"),
])  # fmt: skip
def test_no_compiler(source, monkeypatch, compiler, words):
    monkeypatch.setenv("CC", compiler)
    with pytest.raises(cf.InstallationError, match=words) as told:
        building.module(source)
    assert "\n" not in str(told.value) and not list(folder().iterdir())


def test_no_cache(source, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    with pytest.raises(cf.InstallationError, match="/dev/null/fenics .*Not a directory.* set XDG_CACHE_HOME"):
        building.module(source)


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
        "import warnings\nfrom cosserat_fenicsx.cli.output import warnings_in_words\nfrom cosserat_fenicsx import "
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


class VerificationError(Exception):
    """Stands for that of cffi."""


@pytest.mark.parametrize(("problem", "words"), [
    (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), "No space left on device.*: make room there.*XDG_CACHE_HOME"),
    (ImportError("lib.so: file too short"), "file too short.*remove what is damaged.*XDG_CACHE_HOME"),
    (RuntimeError("Failed just-in-time compilation of form: [Errno 30] Read-only"), "XDG_CACHE_HOME"),
    (VerificationError("CompileError: command 'cc' failed\nmore"), r"command 'cc' failed\).*apt install gcc"),
])  # fmt: skip
def test_words(problem, words):
    with pytest.raises(cf.InstallationError, match=words), compiling():
        raise problem


def test_other_errors_stay():
    for problem in (ZeroDivisionError(), RuntimeError("else"), cf.SceneError("words")):
        with pytest.raises(type(problem)) as raised, compiling():
            raise problem
        assert raised.value is problem


def test_a_cache_that_cannot_be_made(monkeypatch):
    """A mesh that no other test uses is compiled for anew, or loaded."""
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    monkeypatch.setattr("dolfinx.jit.get_parameters", _in_dev_null, raising=False)
    monkeypatch.setattr("dolfinx.jit.get_options", _in_dev_null, raising=False)
    with pytest.raises(cf.InstallationError, match="/dev/null/fenics .*Not a directory.* set XDG_CACHE_HOME"):
        cf.solve(column()[1], [0.1], elements=37, degree=1)


def _in_dev_null(given=None):
    from dolfinx import jit

    known = getattr(jit, "DOLFINX_DEFAULT_JIT_PARAMETERS", None) or jit.DOLFINX_DEFAULT_JIT_OPTIONS
    return {name: value for name, (value, _) in known.items()} | {"cache_dir": "/dev/null/fenics"} | (given or {})


def test_what_is_kept_has_a_name_that_tells_what_it_follows_from(monkeypatch, tmp_path):
    """None where a class or a function is not the package's, or its files are newer than the process."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))

    class Own(Mixed):
        pass

    kinds = [(Mixed(), 1), (Mixed(), 2), (Multiplier(), 1), (cf.Force, 1), (loads.force, "a"), (loads.moment, "a")]
    names = [compat.name_of("kind", *kind) for kind in kinds]
    assert len({*names}) == len(kinds) and None not in names
    assert names == [compat.name_of("kind", *kind) for kind in kinds]
    def disguised(surface):
        return _work_of(surface, 2, False, linear, None)  # has a name of the package's

    assert None not in [compat.name_of("kind", disguised(shape)) for shape in (plane, sphere)]
    wrapped = wraps(loads.force)(lambda *x: 0)
    others = [Own, Own(), lambda: 1, column, np.float64, np.zeros(1), partial(loads.force), [1], {}, wrapped]
    for other in (*others, disguised(column)):
        assert compat.name_of("kind", ("a", other)) is None
    code_cache.keep(names[0], b"content")
    assert code_cache.kept(names[0]) == b"content" and code_cache.kept(names[1]) is None
    (folder() / names[0]).write_bytes(b"content, changed by something that knows of no digest at the end")
    assert code_cache.kept(names[0]) is None
    monkeypatch.setattr(code_cache, "_BEGAN", 0.0)
    assert compat.name_of("kind", *kinds[0]) is None
