"""What a first run of each kind of scene takes where nothing is compiled yet, and the next run.

    python demos/evidence/first_runs.py            medians of 3 runs with an empty cache, and of the runs after them
    python demos/evidence/first_runs.py --quick    one scene, once

Processor time holds that of the C compiler; wall-clock time is that of the whole process, from its start to the table.
Another checkout is measured by `--package FOLDER`.
"""

import os
import statistics
import sys
import tempfile
from pathlib import Path

from harness import command, table, whole_process, write

from cosserat_fenicsx import compat

ROOT = Path(__file__).resolve().parents[2]
RUNS = {
    "a column in a plane": ("run", "eccentric_cantilever.toml"),
    "a frame with limit points": ("run", "lees_frame.toml"),
    "a bend in space": ("run", "bend_45.toml"),
    "linear buckling": ("buckling", "eccentric_cantilever.toml"),
    "natural modes": ("modes", "tripod.toml"),
    "a motion in a plane": ("run", "motions/released_column.toml"),
    "a motion in space": ("run", "motions/right_angle_cantilever.toml"),
    "torque and drag, soft string": ("run", "wells/volve_f12.toml"),
    "torque and drag, exact rod": ("run", "wells/assembly.toml"),
    "stick-slip": ("run", "strings/stick_slip.toml"),
}


def run(command, cache, package):
    """Processor time and wall-clock time (s) of `cosserat COMMAND SCENE` with this folder as cache."""
    words = [sys.executable, "-m", "cosserat_fenicsx", command[0], str(ROOT / "demos" / command[1])]
    surrounding = {**os.environ, "XDG_CACHE_HOME": str(cache), "PYTHONPATH": str(package)}
    _, code, processor, wall = whole_process(words, env=surrounding, cwd=cache)
    if code:
        raise SystemExit(f"{' '.join(words[1:])}: expected exit code 0, not {code}")
    return processor, wall


def first_and_next(command, package):
    """(processor time, wall-clock time) of a first run and of the next one, s, and the number of compiled files."""
    with tempfile.TemporaryDirectory() as cache:
        first, following = ((*run(command, Path(cache), package), _compiled(cache)) for _ in range(2))
        if first[2] != following[2]:
            raise SystemExit(f"{command[0]}: the next process compiles {following[2] - first[2]} files again")
        return first[:2], following[:2], first[2]


def _compiled(cache):
    return len(list(Path(cache, "fenics").glob("*.so")))


def main(runs=3, out="out", kinds=tuple(RUNS), package=ROOT):
    """Print the table and write it to out/first_runs.md. Returns {kind: (first, next, compiled files)}, times
    (processor, wall-clock) in s."""
    rows, found = [], {}
    for kind in kinds:
        measured = [first_and_next(RUNS[kind], package) for _ in range(runs)]
        times = [[statistics.median(one[i][j] for one in measured) for j in range(2)] for i in range(2)]
        found[kind] = *times, measured[0][2]
        rows.append((kind, measured[0][2], *(f"{value:.1f}" for pair in times for value in pair)))
        print(*rows[-1], sep=" | ", file=sys.stderr, flush=True)
    about = f"{compat.version()}; medians of {runs} run(s); processor time, and wall-clock time on "
    about += f"{os.cpu_count()} cores."
    heads = "scene | compiled files | first: processor (s) | wall clock (s) | next: processor (s) | wall clock (s)"
    print(write("first_runs", [about, "", *table(heads, rows)], out))
    return found


if __name__ == "__main__":
    os.environ.pop("COSSERAT_FENICSX_CFLAGS", None)
    command(__doc__, main, {"runs": 1, "kinds": list(RUNS)[:1]},
            package={"default": ROOT, "help": "a checkout of the package; default this one"})  # fmt: skip
