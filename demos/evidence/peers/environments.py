"""A separate Python environment for every peer, made once in the user's cache folder, with fixed releases."""

import hashlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
#: What pip installs; CalculiX comes from Debian.
PINNED = {
    "Exudyn": ("exudyn==1.13.6", "numpy==2.4.6"),
    "OpenSeesPy": ("openseespy==3.7.1.2",),
    "PyElastica": ("pyelastica==1.0.0", "numba==0.68.1", "numpy==2.4.6"),
    "welleng": ("welleng==0.30.0",),
    "torque-drag": ("torque-drag==0.1.1",),
}
SCRIPTS = {
    "cosserat_fenicsx": "own_rod.py",
    "Exudyn": "exudyn_rod.py",
    "OpenSeesPy": "opensees_rod.py",
    "PyElastica": "elastica_rod.py",
    "CalculiX": "calculix_rod.py",
    "welleng": "welleng_string.py",
    "torque-drag": "torque_drag_string.py",
}
OWN = "cosserat_fenicsx"


class Missing(Exception):
    """A peer that is not installed; the message says why."""


def cache():
    """The folder of the environments."""
    given = os.environ.get("XDG_CACHE_HOME")
    return (Path(given) if given else Path.home() / ".cache") / "cosserat_fenicsx" / "peers"


def command(peer, install=True):
    """The command that starts a peer's process; a missing environment is made first.

    Args:
        peer: a key of SCRIPTS.
        install: whether to install it from the network.

    Raises:
        Missing: the peer is not installed and cannot be.
    """
    script = str(HERE / SCRIPTS[peer])
    if peer == OWN:
        return [sys.executable, script]
    if peer == "CalculiX":
        return [sys.executable, script, str(_calculix(install))]
    folder = cache() / f"{peer}-{_short(PINNED[peer])}"
    if not (folder / "ready").exists():
        _only_if(install, peer)
        base = "/usr/bin/python3" if Path("/usr/bin/python3").exists() else sys.executable
        _run(base, "-m", "venv", "--clear", folder)
        _run(folder / "bin" / "python", "-m", "pip", "install", "--disable-pip-version-check", *PINNED[peer])
        (folder / "ready").touch()
    return [str(folder / "bin" / "python"), script]


def surroundings(peer):
    """Environment variables of a peer's process: one thread, no other packages."""
    given = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    given |= {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
    if peer == OWN:
        given["PYTHONPATH"] = str(ROOT)
    if peer == "Exudyn":
        given["EXUDYN_MODULE"] = "fast"  # its build without range checks
    if peer == "CalculiX":
        libraries = {str(file.parent) for file in (cache() / "CalculiX").rglob("*.so.*")}
        given["LD_LIBRARY_PATH"] = ":".join([*sorted(libraries), os.environ.get("LD_LIBRARY_PATH", "")])
    return {**given, "PYTHONNOUSERSITE": "1", "MPLBACKEND": "Agg"}


def fingerprint(peer):
    """Hash of the files that a peer's samples depend on: its script and, for this package, the package."""
    files = [HERE / name for name in (SCRIPTS[peer], "speak.py", "problems.py", "motions.py")]
    files += [file for file in [HERE / SCRIPTS[peer].replace("_rod", "_motion")] if file.exists()]
    if peer == OWN:
        folders = ROOT / "cosserat_fenicsx", ROOT / "forms"
        files += sorted(file for folder in folders for end in ("*.py", "*.c", "*.h") for file in folder.rglob(end))
    return _short(file.read_text(encoding="utf-8") for file in files)


def _calculix(install):
    """Debian's program, unpacked into the cache with missing libraries, without root."""
    folder = cache() / "CalculiX"
    program = folder / "usr" / "bin" / "ccx"
    if (folder / "ready").exists():
        return program if program.exists() else Path(shutil.which("ccx") or program)
    _only_if(install, "CalculiX")
    if shutil.which("apt-get") is None:
        raise Missing("no apt-get here: install CalculiX by hand, as `ccx`")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    wanted = _run("apt-get", "install", "--simulate", "--no-install-recommends", "calculix-ccx")
    packages = re.findall(r"^Inst (\S+)", wanted, re.MULTILINE)
    if packages:
        _run("apt-get", "download", *packages, cwd=folder)
        for archive in folder.glob("*.deb"):
            _run("dpkg-deb", "--extract", archive, folder)
    elif shutil.which("ccx") is None:
        raise Missing("apt-get names nothing to install, and there is no ccx")
    (folder / "ready").touch()
    return program if packages else Path(shutil.which("ccx"))


def _only_if(install, peer):
    if not install:
        raise Missing(f"{peer} is not installed yet: `make work-precision` installs it")


def _run(*words, cwd=None):
    told = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True, "cwd": cwd}
    try:
        done = subprocess.run([str(word) for word in words], timeout=600, check=False, **told)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise Missing(f"{words[0]}: {error}") from None
    if done.returncode:
        last = [line for line in done.stdout.splitlines() if line.strip()][-1:] or ["no message"]
        raise Missing(f"{' '.join(map(str, words[:4]))} ... failed: {last[0][:200]}")
    return done.stdout


def _short(words):
    return hashlib.sha256("\n".join(words).encode()).hexdigest()[:10]
