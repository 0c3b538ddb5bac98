"""The machine, the releases and the date that are recorded with measurements."""

import datetime
import os
import platform
from pathlib import Path

from cosserat_fenicsx import compat


def record():
    """The conditions of a measurement, as a dict of strings and numbers for JSON.

    Returns:
        date (UTC, ISO 8601), cpu (model), cores (that this process may use), platform, and the releases by the names
        dolfinx, petsc, numpy, python.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "cpu": _cpu(),
        "cores": cores,
        "platform": platform.platform(),
        **{name.lower(): release for name, release in map(str.split, compat.version().split(", "))},
    }


def in_words(found):
    """One line for the foot of a table or a chart."""
    return (
        f"dolfinx {found['dolfinx']}, PETSc {found['petsc']}, numpy {found['numpy']}, Python {found['python']}; "
        f"{found['cpu']}, {found['cores']} cores; {found['date'][:10]}"
    )


def _cpu():
    """The processor's name: Linux has it in /proc/cpuinfo."""
    listed = Path("/proc/cpuinfo")
    lines = listed.read_text(encoding="utf-8").splitlines() if listed.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
