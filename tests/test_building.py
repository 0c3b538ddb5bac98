"""The C of the package is compiled and loaded on each release of dolfinx; what goes wrong is told in one sentence."""

import os
import threading
import time

import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx import compat
from cosserat_fenicsx.algebra import building
from cosserat_fenicsx.code_cache import folder

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
PetscInt zero = 0;
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


@pytest.mark.parametrize(
    ("compiler", "words"),
    [
        ("/no/compiler", "No such file.*/no/compiler'.*apt install gcc python3-dev.*no CC set to another"),
        ("false", r"\(false: exit code 1\).*apt install gcc"),
        ("cc -include missing.h", r"\(.*fatal error: missing.h: No such file.*\).*apt install gcc"),
    ],
)
def test_no_compiler(source, monkeypatch, compiler, words):
    monkeypatch.setenv("CC", compiler)
    with pytest.raises(cf.InstallationError, match=words) as told:
        building.module(source)
    assert "\n" not in str(told.value) and not list(folder().iterdir())


def test_no_cache(source, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    with pytest.raises(cf.InstallationError, match="/dev/null/fenics .*Not a directory.* set XDG_CACHE_HOME"):
        building.module(source)
