"""The C code of this folder: compiled once a machine, at first use, and kept beside dolfinx's compiled forms.

Only a C compiler and Python's headers are needed, which dolfinx needs as well.
"""

import contextlib
import ctypes
import fcntl
import functools
import hashlib
import importlib.machinery
import importlib.util
import os
import shlex
import subprocess
import sysconfig
import tempfile
from pathlib import Path

import cffi
import numpy as np
from petsc4py import PETSc

from cosserat_fenicsx import compat
from cosserat_fenicsx.compiling import cache, compiling
from cosserat_fenicsx.processor import instructions

SOURCES = tuple(Path(__file__).with_name(name) for name in ("chain.c", "newton.c", "sweep.c", "contact.c"))
# What -ffast-math would add hides numbers that are not finite, and changes sums. Python's own -fwrapv slows loops down.
_FLAGS = ("-O3", "-fno-math-errno", "-ffp-contract=fast", "-fno-wrapv", "-fopenmp-simd", "-fvisibility=hidden", "-g0")
_DIGEST = hashlib.sha256
_DIGEST_SIZE = _DIGEST().digest_size


@functools.cache
def module(*sources):
    """cffi's (ffi, lib) of C files, by default those of this folder, and the header of the first one, which must only
    declare; lines with # are for C alone.

    C finds the number of arguments of FFCx's kernels as KERNEL_ARGUMENTS, and PETSc's integers as PetscInt. Processes
    that come at the same time wait for the one that compiles; a file that is damaged or belongs to another system is
    made anew.

    Raises:
        InstallationError: there is no C compiler that works, or the cache cannot be used.
    """
    with compiling():
        flags = [*_FLAGS, *instructions(), f"-DKERNEL_ARGUMENTS={compat.KERNEL_ARGUMENTS}"]
        flags.append(f"-DPetscInt=int{8 * np.dtype(PETSc.IntType).itemsize}_t")
        sources = sources or SOURCES
        suffix = importlib.machinery.EXTENSION_SUFFIXES[0]
        header = sources[0].with_suffix(".h")
        contents = [file.read_bytes() for file in (*sources, header)]
        key = _DIGEST(repr((contents, flags, suffix, cffi.__version__)).encode())
        name = f"cosserat_{sources[0].stem}_{key.hexdigest()[:20]}"
        file = cache().absolute() / (name + suffix)
        with contextlib.suppress(FileNotFoundError, ImportError):
            return _load(name, file)
        file.parent.mkdir(parents=True, exist_ok=True)
        with _alone_in(file.parent):
            with contextlib.suppress(FileNotFoundError, ImportError):
                return _load(name, file)
            _build(name, file, sources, header, flags)
            return _load(name, file)


def undisturbed(name, *pointers):
    """Call a C function of this folder that calls PETSc, which is not made for threads: unlike cffi, without letting
    other threads of Python run meanwhile."""
    ffi, lib = module()
    address = int(ffi.cast("intptr_t", ffi.addressof(lib, name)))
    function = ctypes.PYFUNCTYPE(ctypes.c_int, *[ctypes.c_void_p] * len(pointers))(address)
    return function(*(int(ffi.cast("intptr_t", pointer)) for pointer in pointers))


@contextlib.contextmanager
def _alone_in(folder):
    """A lock on a folder, where the file system has locks; elsewhere the last process that compiles wins."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def _build(name, file, sources, header, flags):
    from cffi import recompiler  # rarely needed, and slow to import

    declarations = header.read_text(encoding="utf-8").splitlines()
    builder = cffi.FFI()
    builder.cdef("\n".join(line for line in declarations if not line.startswith("#")))
    with tempfile.TemporaryDirectory(dir=file.parent, prefix=name) as folder:
        glue, made = Path(folder) / "module.c", Path(folder) / "module.so"
        code = "".join(f'#include "{source.absolute()}"\n' for source in sources)
        recompiler.make_c_source(builder, name, code, str(glue))
        headers = sysconfig.get_path("include"), sysconfig.get_path("platinclude")
        command = [*_linker(), "-fPIC", *(f"-I{path}" for path in headers), *flags, str(glue), "-o", str(made), "-lm"]
        try:
            done = subprocess.run(
                command, stdin=subprocess.DEVNULL, capture_output=True, encoding="utf-8", errors="replace"
            )
        except OSError as problem:
            raise cffi.VerificationError(str(problem)) from problem
        if done.returncode:
            lines = done.stderr.strip().splitlines() or [f"{command[0]}: exit code {done.returncode}"]
            told = (line for line in lines if "error" in line or "failed" in line)  # ld's words come before gcc's
            raise cffi.VerificationError(next(told, lines[0]))
        with open(made, "r+b") as binary:
            digest = _DIGEST(binary.read()).digest()
            binary.write(digest)
            binary.flush()
            os.fsync(binary.fileno())
        made.replace(file)


def _linker():
    """The command that makes a module of Python's; the environment's CC replaces its compiler, as everywhere."""
    words, compiler = (sysconfig.get_config_var(name) for name in ("LDSHARED", "CC"))
    if os.environ.get("CC") and words.startswith(compiler):
        words = os.environ["CC"] + words[len(compiler) :]
    return shlex.split(words)


def _load(name, file):
    # The system's loader maps what is there, and the process ends where a part is missing: hence a digest at the end.
    content = file.read_bytes()
    if _DIGEST(content[:-_DIGEST_SIZE]).digest() != content[-_DIGEST_SIZE:]:
        raise ImportError(f"{file} is damaged")
    spec = importlib.util.spec_from_file_location(name, file)
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made.ffi, made.lib
