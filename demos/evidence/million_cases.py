"""A million cases of stick-slip on a thousand cores, on paper: what it costs and what ends first, from measured parts.

    python demos/evidence/million_cases.py            100 000 cases in the parent, two minutes
    python demos/evidence/million_cases.py --quick    2000 cases

Measured: a case (120 s of drilling, the map of demos/strings_map.py), the start of a process, and what a case costs the
parent of a study over an executor: processor time, memory, and bytes in its folder. The parent is measured with cases
that return what those of the map do, and compute nothing. Writes to out/: million_cases.md.
"""

import resource
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from harness import apart, command, in_words, table, timed, whole_process, write

import cosserat_fenicsx as cf

CASES, CORES, JOBS = 10**6, 1000, 1000
DEMOS = Path(__file__).resolve().parents[1]
_FIRST = "import sys; sys.path.insert(0, {demos!r}); import strings_map; strings_map.drilled(6.0, 5e4)"


def nothing(speed, weight):
    """What `drilled` of demos/strings_map.py returns, at no cost."""
    return {"severity": speed / 3, "period": weight / 3, "stuck": 1 / 3}


def case(samples):
    """Processor times (s) of cases over the map, compiled code at hand."""
    sys.path.insert(0, str(DEMOS))
    import strings_map

    corners = [(speed, weight) for speed in np.linspace(4.0, 16.0, samples) for weight in (2e4, 1e5)]
    strings_map.drilled(*corners[0])
    return [timed(lambda corner=corner: strings_map.drilled(*corner))[1] for corner in corners]


def start():
    """(processor time, wall-clock time) of a process until the end of its first case, s, compiled code at hand."""
    return whole_process([sys.executable, "-c", _FIRST.format(demos=str(DEMOS))])[2:]


def parent(count):
    """Of a study of `count` cases, for each case: {"seconds" and "reading": processor time of the parent, and of
    reading the folder again; "memory" and "stored": bytes of the parent and in the folder}; and its number of
    "files"."""
    cases = {"speed": [1.0], "weight": [float(k) for k in range(count)]}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "kept"
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            cf.study(nothing, {"speed": [1.0], "weight": [2.0]}, executor=pool)
            before = _memory()
            first, seconds = timed(lambda: cf.study(nothing, cases, executor=pool, folder=folder, progress=False))
            memory = _memory() - before
        again, reading = timed(lambda: cf.study(nothing, cases, folder=folder, progress=False))
        if again.results != first.results:
            raise RuntimeError("the folder holds other results than those of the study")
        stored = sum(file.stat().st_size for file in folder.iterdir())
        files = len(list(folder.iterdir()))
    return {"seconds": seconds / count, "memory": memory / count, "reading": reading / count,
            "stored": stored / count, "files": files}  # fmt: skip


def _memory():
    """Bytes that this process has now."""
    return int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1]) * resource.getpagesize()


def main(count=100_000, samples=10, out="out"):
    """Print the table, write it to out/million_cases.md; returns what was measured."""
    each, (busy, wall) = float(np.median(case(samples))), start()
    found = {"case": each, "start": busy, "wall": wall, **apart(__file__, count)}
    hours, ideal = CASES * each / 3600, CASES * each / CORES
    rate, part = 1 / found["seconds"], CASES // JOBS
    measured = [
        ("a case: 120 s of stick-slip, processor time", f"{1e3 * each:.0f} ms"),
        ("a new process to the end of its first case, processor time and wall clock", f"{busy:.1f} s, {wall:.1f} s"),
        (f"the parent, of {count} cases, processor time a case", f"{1e3 * found['seconds']:.2f} ms"),
        ("its memory a case", f"{found['memory'] / 1e3:.1f} kB"),
        (f"its folder a case, in {found['files']} files", f"{found['stored']:.0f} bytes"),
        ("reading the folder again, a case", f"{1e3 * found['reading']:.3f} ms"),
    ]
    paper = [
        ("processor time of all cases", f"{hours:.0f} h", f"{hours:.0f} h"),
        ("if nothing else took time, on all cores", f"{ideal:.0f} s", f"{ideal:.0f} s"),
        ("processes that start", f"{CORES} x {busy:.1f} s", f"{JOBS} x {busy:.1f} s"),
        ("cases that the parent hands out and stores", f"{rate:.0f} a second", "each its own"),
        ("cores that it keeps busy", f"{rate * each:.0f}", f"{CORES}"),
        ("wall clock, at least", f"{max(ideal, CASES * found['seconds']) + wall:.0f} s",
         f"{part * (each + found['seconds']) + wall:.0f} s"),
        ("memory of its cases in the parent, or in a job", f"{CASES * found['memory'] / 1e9:.1f} GB",
         f"{part * found['memory'] / 1e6:.0f} MB"),
        ("folders, files", f"1, {found['files']}", f"{JOBS}, {JOBS * found['files']}"),
        ("bytes in all folders", f"{CASES * found['stored'] / 1e6:.0f} MB", f"{CASES * found['stored'] / 1e6:.0f} MB"),
        ("reading all of it", f"{CASES * found['reading']:.0f} s", f"{CASES * found['reading']:.0f} s"),
    ]  # fmt: skip
    lines = [f"{in_words()}. Processor time, one process.", "", *table("measured | ", measured), ""]
    heads = f"{CASES} cases on {CORES} cores, on paper | one study over an executor | an array of {JOBS} jobs"
    print(write("million_cases", [*lines, *table(heads, paper)], out))
    return found


if __name__ == "__main__":
    command(__doc__, main, {"count": 2000, "samples": 2}, one=parent)
