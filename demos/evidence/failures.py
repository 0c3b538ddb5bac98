"""Where methods fail: a table of methods and trials, each cell a number and a verdict (`make failures`).

    python demos/evidence/failures.py            at most 15 minutes; writes out/failures.json, .md and .png
    python demos/evidence/failures.py --quick    this package and the comparison models, fewer steps; under two minutes
    python demos/evidence/failures.py --fresh    from the start, without results of an earlier run

An interrupted run keeps its cells; the same command continues from them. Programs that are not installed are shown as
such: `make work-precision` installs them.
"""

import hashlib
import sys
from pathlib import Path

from harness import command, record, resumed, save
from mpi4py import MPI
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from trials import catalogue, methods, picture, programs, table
from trials.cells import MISSING, SILENT, Cell

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]


def begun(file, quick, fresh):
    """The data of failures.json: without cells, or with those of an interrupted run."""
    data = {"complete": False, "quick": quick, "machine": record(), "sources": _fingerprint(), "seed": None,
            "programs": {}, "methods": [], "trials": [], "cells": {}}  # fmt: skip
    before = resumed(file, data, ["quick", "sources"], fresh)
    if before:
        kept = {key: cell for key, cell in before["cells"].items() if cell["verdict"] != MISSING}
        data |= {"cells": kept, "programs": before["programs"]}
        print(f"{len(kept)} cells kept", file=sys.stderr)
    return data


def _fingerprint():
    """Hash of all files that the cells depend on."""
    folders = [ROOT / "cosserat_fenicsx", ROOT / "forms", *(HERE / name for name in ("trials", "comparison", "peers"))]
    files = sorted(file for folder in folders for file in folder.rglob("*.py"))
    drawn = {HERE / "trials" / name for name in ("table.py", "picture.py")}
    return hashlib.sha256(b"".join(file.read_bytes() for file in files if file not in drawn)).hexdigest()[:16]


def compute(file, data, columns, rows):
    """Compute all missing cells; the file is rewritten after every cell."""
    data["methods"], data["trials"] = [method.key for method in columns], [trial.key for trial in rows]
    todo = [(trial, method) for method in columns for trial in rows if f"{trial.key}/{method.key}" not in data["cells"]]
    words = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    console = Console(stderr=True)
    with Progress(*words, console=console) as bar:
        task = bar.add_task("failures", total=len(todo))
        for trial, method in todo:
            name = method.title.replace("\n", " ")
            bar.update(task, description=f"{name}: {trial.title.splitlines()[0]}")
            cell = methods.cell(trial, method)
            data["cells"][f"{trial.key}/{method.key}"] = cell.plain()
            if getattr(method, "versions", None):
                data["programs"][method.key] = method.versions
            save(file, data)
            bar.advance(task)
            if not console.is_terminal and trial is rows[-1]:
                print(f"{name}: done", file=sys.stderr, flush=True)
    data["complete"] = True
    save(file, data)


def main(out="out", quick=False, fresh=False):
    """Compute, write and draw. Returns The dict that failures.json holds."""
    if MPI.COMM_WORLD.size > 1:
        sys.exit("failures.py: expected one process, not several: the cells follow each other")
    stem = "failures_quick" if quick else "failures"
    columns = [method for method in methods.METHODS if not quick or method not in programs.PROGRAMS]
    rows = catalogue.QUICK if quick else catalogue.TRIALS
    out = Path(out)
    file = out / f"{stem}.json"
    data = begun(file, quick, fresh)
    try:
        compute(file, data, columns, rows)
    finally:
        for program in programs.PROGRAMS:
            program.end()
    words = table.text(data)
    (out / f"{stem}.md").write_text(words + "\n", encoding="utf-8")
    picture.draw(data, out / f"{stem}.png")
    print(words)
    silent = [key for key, cell in data["cells"].items() if Cell.of(cell).verdict == SILENT]
    print(
        f"\n{len(data['cells'])} cells, {len(silent)} silently wrong; written to {out}/: {stem}.png, {stem}.md,"
        f" {stem}.json",
        file=sys.stderr,
    )
    return data


if __name__ == "__main__":
    command(__doc__, main, {"quick": True}, fresh=True)
