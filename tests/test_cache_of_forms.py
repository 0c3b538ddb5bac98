"""A cache of compiled forms that cannot be used, or no compiler: words that say what to set."""

import errno
import os

import pytest
from conftest import column

import cosserat_fenicsx as cf
from cosserat_fenicsx.compat import compiling

pytestmark = pytest.mark.serial


class VerificationError(Exception):
    """Stands for that of cffi."""


@pytest.mark.parametrize(
    ("problem", "words"),
    [
        (
            OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)),
            "No space left on device.*: make room there.*XDG_CACHE_HOME",
        ),
        (ImportError("lib.so: file too short"), "file too short.*remove what is damaged.*XDG_CACHE_HOME"),
        (RuntimeError("Failed just-in-time compilation of form: [Errno 30] Read-only"), "XDG_CACHE_HOME"),
        (VerificationError("CompileError: command 'cc' failed\nmore"), r"command 'cc' failed\).*apt install gcc"),
    ],
)
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
