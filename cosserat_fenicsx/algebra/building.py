"""The C code of this folder: compiled once a machine, at first use, and kept beside dolfinx's compiled forms.

Only a C compiler and Python's headers are needed, which dolfinx needs as well.
"""

import contextlib
import functools
import hashlib
import os
import shlex
import subprocess
import sysconfig
import threading
from pathlib import Path

import cffi
import numpy as np

from cosserat_fenicsx import code_cache, compat
from cosserat_fenicsx.code_cache import instructions
from cosserat_fenicsx.compat import compiling

SOURCES = tuple(
    Path(__file__).with_name(f"{name}.c")
    for name in ("chain", "ties", "newton", "sweep", "compared", "contact", "pairs")
)
# What -ffast-math would add hides numbers that are not finite, and changes sums. Python's own -fwrapv slows loops down.
_FLAGS = ("-O3", "-fno-math-errno", "-ffp-contract=fast", "-fno-wrapv", "-fopenmp-simd", "-fvisibility=hidden", "-g0")


@functools.cache
def module(*sources):
    """cffi's (ffi, lib) of C files (default: this folder's) and the header of the first one, which must only declare;
    lines with # are for C alone.

    C finds the number of arguments of FFCx's kernels as KERNEL_ARGUMENTS. Processes that come at the same time wait for
    the one that compiles; a file that is damaged or belongs to another system is made again.

    Raises:
        InstallationError: there is no C compiler that works, or the cache cannot be used.
    """
    with compiling():
        name, *task = _task(sources or SOURCES)
        made = code_cache.load(name)
        if made is None:
            with code_cache.alone_with(name) as part:
                made = code_cache.load(name)
                if made is None:
                    code_cache.install(_build(name, part, *task))
                    made = code_cache.load(name)
        if made is None:
            raise ImportError(f"{name}: what was compiled cannot be loaded")
        return made.ffi, made.lib


@functools.cache
def begin():
    """Let a thread compile the files of this folder where they are not; the caller has forms compiled meanwhile.

    `module` reports any failure.
    """
    with contextlib.suppress(Exception):
        name, *task = _task(SOURCES)
        if not (code_cache.folder() / (name + code_cache.SUFFIX)).exists():
            threading.Thread(target=_compile, args=(name, *task), daemon=True).start()


def _compile(name, *task):
    # not within `compiling`, which changes what all threads share
    with contextlib.suppress(Exception), code_cache.alone_with(name) as part:
        code_cache.install(_build(name, part, *task))


def _task(sources):
    """Name of the module, files, header and flags."""
    flags = [*_FLAGS, *instructions(), f"-DKERNEL_ARGUMENTS={compat.KERNEL_ARGUMENTS}"]
    flags += code_cache.more_flags()
    header = sources[0].with_suffix(".h")
    contents = [file.read_bytes() for file in (*sources, header)]
    key = hashlib.sha256(repr((contents, flags, code_cache.SUFFIX, cffi.__version__)).encode())
    return f"cosserat_{sources[0].stem}_{key.hexdigest()[:20]}", sources, header, flags


def _build(name, folder, sources, header, flags):
    from cffi import recompiler  # rarely needed, and slow to import

    declarations = header.read_text(encoding="utf-8").splitlines()
    builder = cffi.FFI()
    builder.cdef("\n".join(line for line in declarations if not line.startswith("#")))
    glue, made = folder.absolute() / "module.c", folder.absolute() / (name + code_cache.SUFFIX)
    code = "".join(f'#include "{source.absolute()}"\n' for source in sources)
    recompiler.make_c_source(builder, name, code, str(glue))
    headers = sysconfig.get_path("include"), sysconfig.get_path("platinclude")
    command = [*_linker(), "-fPIC", *(f"-I{path}" for path in headers), *flags, str(glue), "-o", str(made), "-lm"]
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, encoding="utf-8", errors="replace", cwd=folder
        )
    except OSError as problem:
        raise cffi.VerificationError(str(problem)) from problem
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"{command[0]}: exit code {done.returncode}"]
        causes = (line for line in lines if "error" in line or "failed" in line)  # ld's come before gcc's
        raise cffi.VerificationError(next(causes, lines[0]))
    return made


def _linker():
    """The command that makes a module of Python's; the environment's CC replaces its compiler, as everywhere."""
    words, compiler = (sysconfig.get_config_var(name) for name in ("LDSHARED", "CC"))
    if os.environ.get("CC") and words.startswith(compiler):
        words = os.environ["CC"] + words[len(compiler) :]
    return shlex.split(words)


class Pointers:
    """Base of what gives C pointers to arrays: these are kept as long as the object. `sources`: see `module`."""

    def __init__(self, *sources):
        self._ffi, self._lib = module(*sources)
        self._arrays = []

    def doubles(self, array):
        """C's pointer to an array of floats."""
        self._arrays.append(array)
        return self._ffi.cast("double *", array.ctypes.data)

    def integers(self, array):
        """C's pointer to an array of 32-bit integers, which is copied if it is not one."""
        array = np.ascontiguousarray(array, dtype=np.int32)
        self._arrays.append(array)
        return self._ffi.cast("int *", array.ctypes.data)
