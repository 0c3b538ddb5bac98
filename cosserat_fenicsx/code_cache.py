"""The folder of compiled code: which one it is, whose its files are, and one process at a time that makes a file of it.

Whoever can write to a file there runs code in the name of whoever loads it. So the folder and its files must belong to
the user, and nobody else may write to them; other files are not loaded.

A file is made in a folder of its own and moved to its place when it is complete, so a process that is killed meanwhile
leaves no incomplete file that others would load or wait for.

Compiled code depends on the processor's `instructions`, flags of the C compiler.
"""

import contextlib
import fcntl
import functools
import hashlib
import importlib.machinery
import importlib.util
import os
import shlex
import shutil
import stat
import tempfile
import time
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import FunctionType

from cosserat_fenicsx.checks import warn
from cosserat_fenicsx.errors import CacheWarning, InstallationError

#: How the name of a compiled module ends.
SUFFIX = importlib.machinery.EXTENSION_SUFFIXES[0]
_DIGEST = hashlib.sha256
_DIGEST_SIZE = _DIGEST().digest_size
# Longest time (s) to wait for another process that makes the same file; then it is made twice, which does no harm.
_PATIENCE = 300
_OTHERS_MAY_WRITE = stat.S_IWGRP | stat.S_IWOTH
_WRITABLE = "can be written to by others"
# When this process began to import the package.
_BEGAN = time.time()


def folder():
    """The folder of compiled forms, and of our own C, whether it exists or not: dolfinx's, or one of the user's own
    beside it where that belongs to another user or others may write to it.

    Raises:
        InstallationError: neither of them belongs to the user alone.
    """
    given = Path(os.environ.get("XDG_CACHE_HOME") or "")
    # a relative one is to be ignored, says its standard
    base = given if given.is_absolute() else Path.home() / ".cache"
    shared, own = base / "fenics", base / f"fenics-{os.geteuid()}"
    problem = why_unsafe(shared)
    if problem is None:
        return shared
    if why_unsafe(own) is not None:
        raise InstallationError(
            f"compiled code would be loaded from {shared}, which {problem}, or from {own}, which {why_unsafe(own)}: "
            "set XDG_CACHE_HOME to a folder that is yours alone"
        )
    end = f" (`chmod go-w {shared}` ends this)" if problem == _WRITABLE else ""
    _say(f"the cache of compiled code {shared} is not used, because it {problem}; {own} takes its place{end}")
    return own


@functools.cache
def _say(words):
    warn(words, CacheWarning)


def more_flags():
    """Flags for the C compiler from the environment's COSSERAT_FENICSX_CFLAGS, after all others."""
    return shlex.split(os.environ.get("COSSERAT_FENICSX_CFLAGS", ""))


def why_unsafe(path):
    """Why code in a folder or a file may be another user's, in words; None if it is the user's own, or is not there."""
    try:
        found = path.stat() if path.is_dir() else path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return None
    if found.st_uid != os.geteuid():
        return f"belongs to another user (number {found.st_uid})"
    return _WRITABLE if found.st_mode & _OTHERS_MAY_WRITE else None


def make(path):
    """Make a folder, and those around it, for the user alone."""
    if not path.is_dir():
        make(path.parent)
        path.mkdir(mode=0o700, exist_ok=True)


@contextlib.contextmanager
def alone_with(name):
    """One process at a time makes the file `name` of the folder, in a new folder of its own, which is given; folders
    that ended processes have left are removed. The lock ends with its process, however that ends; where the file system
    has no locks, several processes may make the same file."""
    place = folder()
    make(place)
    with _locked(place / f"{name}.lock") as alone:
        if alone:
            for left in place.glob(f"{name}.part-*"):
                shutil.rmtree(left, ignore_errors=True)
        with tempfile.TemporaryDirectory(dir=place, prefix=f"{name}.part-", ignore_cleanup_errors=True) as part:
            yield Path(part)


@contextlib.contextmanager
def _locked(file):
    """Whether this process is the only one with a lock on the file, which is made, and removed at the end."""
    end, pause, alone = time.monotonic() + _PATIENCE, 1e-3, None
    while alone is None:
        handle = os.open(file, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with contextlib.suppress(FileNotFoundError):  # the one before may have removed the file that is locked now
                alone = True if os.path.samestat(os.fstat(handle), file.stat()) else None
        except BlockingIOError:
            alone = False if time.monotonic() > end else None
            time.sleep(pause)
            pause = min(0.1, 2 * pause)
        except OSError:
            alone = False  # a file system without locks
        if alone is None:
            os.close(handle)
    try:
        yield alone
    finally:
        if alone:
            file.unlink(missing_ok=True)
        os.close(handle)


def install(made, *beside):
    """Move a compiled module that is complete to its place in the folder, after the files that belong to it."""
    with open(made, "r+b") as binary:
        digest = _DIGEST(binary.read()).digest()
        binary.write(digest)
        binary.flush()
        os.fsync(binary.fileno())
    for file in (*beside, made):
        file.chmod(file.stat().st_mode & ~_OTHERS_MAY_WRITE)
        file.replace(folder() / file.name)


def load(name):
    """The compiled module of this name, or None: it must be complete, the user's own, and of this system."""
    with contextlib.suppress(ImportError):
        if read(name + SUFFIX) is not None:
            spec = importlib.util.spec_from_file_location(name, folder() / (name + SUFFIX))
            made = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(made)
            return made
    return None


def read(name):
    """The content of a file of the folder that `install` has put there, or None: it must be complete and the user's
    own. Loading a truncated module would end the process: hence a digest at the end of each file."""
    file = folder() / name
    if why_unsafe(file) is None:
        with contextlib.suppress(FileNotFoundError):
            content = file.read_bytes()
            if _DIGEST(content[:-_DIGEST_SIZE]).digest() == content[-_DIGEST_SIZE:]:
                return content[:-_DIGEST_SIZE]
    return None


def kept(name):
    """What `keep` has put in the folder by a name of `name_of`, or None."""
    with contextlib.suppress(OSError):
        return name and read(name)


def keep(name, content):
    """Put a file with this content in the folder; where that cannot be done, it is left."""
    with contextlib.suppress(OSError):
        make(folder())
        with tempfile.TemporaryDirectory(dir=folder(), prefix=f"{name}.part-", ignore_cleanup_errors=True) as part:
            made = Path(part, name)
            made.write_bytes(content)
            install(made)


def name_of(what, *given):
    """A name for `keep` of what follows from values and from the package's code, which is the same in every process;
    None where it cannot be known whether that has changed: classes or functions of others are among the values, or
    files were changed meanwhile."""
    try:
        key = repr((_own_code(), *map(_words, given)))
    except (LookupError, OSError, ValueError, RecursionError):
        return None
    return f"cosserat_{what}_{_DIGEST(key.encode()).hexdigest()[:32]}"


def _words(value):
    if value is None or isinstance(value, str | int | float):
        return repr(value)
    if isinstance(value, tuple):
        return [_words(type(value)) if type(value) is not tuple else "", *map(_words, value)]
    if isinstance(value, FunctionType):  # its names may have been changed
        code, held = value.__code__, [cell.cell_contents for cell in value.__closure__ or ()]
        parts = value.__globals__.get("__name__", ""), code.co_name, code.co_firstlineno
        return [_own(*parts), *map(_words, (*held, value.__defaults__, *(value.__kwdefaults__ or {}).values()))]
    if isinstance(value, type):
        return _own(value.__module__, value.__qualname__)
    if is_dataclass(value):
        return [_words(type(value)), *(_words(getattr(value, field.name)) for field in fields(value))]
    raise LookupError(value)


def _own(module, name, line=""):
    if module.split(".")[0] != __package__ or "<" in name:
        raise LookupError(name)
    return f"{module}.{name} {line}"


def _own_code():
    """A digest of the package's files of Python. Raises LookupError: one is newer than what may have been imported."""
    files, digest = _own_files()
    if any(file.stat().st_mtime > _BEGAN for file in files):
        raise LookupError
    return digest


@functools.cache
def _own_files():
    places = Path(__file__).parent, *importlib.util.find_spec(f"{__package__}.forms").submodule_search_locations
    files = sorted({file for place in places for file in Path(place).rglob("*.py")})
    return files, _DIGEST(b"".join(_DIGEST(file.read_bytes()).digest() for file in files)).hexdigest()


# The instructions of the level x86-64-v3 (most processors since 2013), as Linux names them.
_LEVEL_3 = {"avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe", "xsave"}


@functools.cache
def instructions():
    """Flags that let the compiler use the instructions of this processor; none for unknown processors.

    They belong to the key of whatever is kept on disk: computers of different age may share a home directory.
    """
    with contextlib.suppress(OSError), open("/proc/cpuinfo", encoding="ascii", errors="replace") as lines:
        for line in lines:
            if line.startswith("flags"):
                return ("-march=x86-64-v3",) if _LEVEL_3 <= set(line.split()) else ()
    return ()
