"""Whether the package's C reads or writes out of bounds, or does what C leaves undefined, in any of the tests.

    python demos/evidence/sanitizers.py                  all serial tests that need no new process
    python demos/evidence/sanitizers.py tests/test_packed.py -k chain   these, with any arguments of pytest
    python demos/evidence/sanitizers.py --quick          one test, which uses the elimination along rods

The tests run on C that is compiled with gcc's -fsanitize=address,undefined; forms, which dolfinx generates, are
compiled as always and kept in out/sanitized. The first error ends pytest, and its report says where it is.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from cosserat_fenicsx import code_cache

ROOT = Path(__file__).resolve().parents[2]
#: memcpy(NULL, NULL, 0) is left out: compilers define it, as the next C standard does.
FLAGS = "-O1 -g -fsanitize=address,undefined -fno-sanitize=nonnull-attribute -fno-sanitize-recover=all"
QUICK = ("tests/test_packed.py",)
#: Tests that run other programs: these have the normal C, or none.
LEFT_OUT = ("site", "demos", "docs", "release", "ci", "evidence", "gallery", "rank_fails", "executors", "workers",
            "house")  # fmt: skip
#: The compiler of the tests: `COMPILER` with the flags for this package's modules alone, without the sanitizers' own
#: libraries loaded in it.
COMPILER = """#!/bin/sh
unset LD_PRELOAD
case "$*" in */module.c*) exec gcc "$@" {flags};; *) exec gcc "$@";; esac
"""


def linked(source, target):
    """A second name of a file, which nobody changes; a copy where the file system has none."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def environment(out):
    """What pytest runs in: the compiler above, and the compiled forms."""
    cache, compiler = out / "cache", out / "compiler"
    if not cache.is_dir() and code_cache.folder().is_dir():
        own = shutil.ignore_patterns("cosserat_*", "*.lock", "*.part-*")
        shutil.copytree(code_cache.folder(), cache / "fenics", ignore=own, copy_function=linked)
    for old in cache.glob("fenics/cosserat_*"):  # their names do not depend on the flags that the compiler below adds
        shutil.rmtree(old) if old.is_dir() else old.unlink()  # an interrupted compilation leaves a folder
    out.mkdir(parents=True, exist_ok=True)
    compiler.write_text(COMPILER.format(flags=FLAGS), encoding="utf-8")
    compiler.chmod(0o755)
    libraries = [
        subprocess.run(
            ["gcc", f"-print-file-name={name}.so"], capture_output=True, text=True, check=True
        ).stdout.strip()
        for name in ("libasan", "libubsan")
    ]
    return {
        **os.environ,
        "CC": str(compiler), "XDG_CACHE_HOME": str(cache), "LD_PRELOAD": " ".join(libraries),
        "ASAN_OPTIONS": "detect_leaks=0", "UBSAN_OPTIONS": "print_stacktrace=1", "PYTHONMALLOC": "malloc",
    }  # fmt: skip


def main(arguments, out=ROOT / "out" / "sanitized"):
    """pytest's exit code, and the reports of the sanitizers in words."""
    given = list(QUICK) if arguments == ["--quick"] else arguments
    if not given:
        files = sorted((ROOT / "tests").glob("test_*.py"))
        given = [str(file) for file in files if not any(name in file.stem for name in LEFT_OUT)]
    command = [sys.executable, "-m", "pytest", "-q", "-x", "--capture=sys", "-p", "no:cacheprovider", *given]
    done = subprocess.run(command, cwd=ROOT, env=environment(out), stderr=subprocess.PIPE, text=True, check=False)
    return done.returncode, done.stderr


if __name__ == "__main__":
    code, said = main(sys.argv[1:])
    print(said)
    if code < 0:
        print(f"Python ended by signal {-code}: an error above, or libraries of the sanitizers that do not fit it.")
    sys.exit(code)
