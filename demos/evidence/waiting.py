"""Waiting times: whole processes from the start to the answer, with warm and with empty caches."""

import json
import math
import statistics
import sys
import tempfile
from pathlib import Path

from harness import whole_process
from peers.environments import OWN, ROOT, surroundings
from peers.problems import problems
from work_precision_table import answered, called, cheapest

SCENE = ROOT / "demos" / "eccentric_cantilever.toml"
RUNS = {"warm": 5, "cold": 3}
LIMIT, ENOUGH = 60.0, 15.0  # s: of a run; runs that have taken so long together are not repeated


def waits(started, rows):
    """[{who, what, caches, processor, wall, failed}], s.

    Here `cosserat run` on the paper's cantilever, to the printed table. For a peer its process, which imports, builds
    and solves the sweep (or the single answer, where it has none of the sweep) at an error below 1e-5, or 1e-3, or
    1e-2, the smallest that it reaches. Cold: with empty caches of compiled forms (here) or functions (numba); the
    others compile nothing and have no separate cold start.
    """
    found = []
    for name, peer in started.items():
        words, told, what = _job(name, peer, rows)
        if words is None:
            continue
        for caches in ("warm", "cold") if name in (OWN, "PyElastica") else ("warm",):
            measured = {"who": "cosserat run" if name == OWN else name, "what": what, "caches": caches}
            found.append({**measured, **_times(words, told, surroundings(name), caches)})
            print(f"whole process, {name}, {caches}: {statistics.median(found[-1]['wall'] or [0]):.2f} s", flush=True)
    return found


def _job(name, peer, rows):
    """Command, input and description of the whole process of a peer."""
    if name == OWN:
        return [sys.executable, "-m", "cosserat_fenicsx", "run", str(SCENE)], "", f"demos/{SCENE.name}, default tol"
    for problem in ("sweep", "single"):
        mine = [row for row in answered(rows, problem) if row["peer"] == name]
        if mine:
            best = next(filter(None, (cheapest(mine, error) for error in (1e-5, 1e-3, 1e-2, math.inf))))
            request = {"problem": problems()[problem], "configuration": best["configuration"], "warm": 0, "samples": 1}
            return peer.words, json.dumps(request) + "\n", f"{problem}: {called(best)}, error {best['error']:.0e}"
    return None, None, None


def _times(words, told, surrounding, caches):
    """Processor and wall-clock time of the runs of a command."""
    processor, wall = [], []
    with tempfile.TemporaryDirectory() as folder:
        for run in range(RUNS[caches] + (caches == "warm")):  # the first warm one fills the caches
            empty = {}
            if caches == "cold":
                place = Path(folder, str(run))
                place.mkdir()
                empty = {"XDG_CACHE_HOME": str(place), "NUMBA_CACHE_DIR": str(place)}
            said, code, *seconds = whole_process(words, told, LIMIT, env={**surrounding, **empty}, cwd=folder)
            if code or b'"failed"' in said:
                why = f"exit code {code}" if code else said.decode(errors="replace")[:100]
                return {"processor": [], "wall": [], "failed": why}
            if caches == "cold" or run:
                for times, spent in zip((processor, wall), seconds, strict=True):
                    times.append(spent)
            if sum(wall) > ENOUGH:
                break
    return {"processor": processor, "wall": wall, "failed": None}
