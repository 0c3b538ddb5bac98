"""Processor time and memory of a Newton step against the number of unknowns, 1e2 .. 1e6, with the spatial model.

    python demos/evidence/scaling.py             to 1e6 unknowns; writes out/scaling.md
    python demos/evidence/scaling.py --quick     to 1e4

Each size runs in a separate process: a thick cantilever under a small transverse force, degree 4, one Newton step
(residual, tangent, factorisation, solution, update of n) repeated from rest, and one count of negative modes; medians.
Small matrices are factored by node blocks, which is cheaper, large ones with full pivoting (`Signature.slender`):
exponents are given for each kind.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from cantilever import column

from cosserat_fenicsx import compat
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.statics import solvers

SIZES = (4, 16, 64, 256, 1024, 4096, 16384, 35700)  # elements of degree 4: 28 unknowns each
QUICK = SIZES[:5]
_DEGREE = 4


def measure(elements):
    """Number of unknowns, time of a Newton step (s), time of a count of negative modes (s), largest memory of this
    process (MB), and whether the tangent is factored by blocks."""
    _, scene = column()
    layout = Layout.of(scene, elements)
    with solvers.solvers_of(scene, layout, degree=_DEGREE) as (problem, newton, stability):
        newton.allow(1)
        start, steps, counts = problem.numbers(), [], []
        for _ in range(max(3, min(100, 20000 // elements))):
            problem.put(start)
            problem.set_load_factor(1e-6)
            began = time.process_time()
            newton.solve()
            steps.append(time.process_time() - began)
            began = time.process_time()
            stability.count()
            counts.append(time.process_time() - began)
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        return (
            problem.model.unknowns,
            float(np.median(steps)),
            float(np.median(counts)),
            memory,
            problem.tangent == "blocks",
        )


def exponent(x, y):
    """The exponent in y = c x^exponent by least squares; nan with fewer than two points with y > 0."""
    some = y > 0
    return float(np.polyfit(np.log(x[some]), np.log(y[some]), 1)[0]) if some.sum() > 1 else float("nan")


def main(sizes=SIZES, out="out"):
    """Print the table, write it to out/scaling.md.

    Returns:
        The rows (unknowns, step, count, memory, whether by blocks) as an array.
    """
    rows = []
    for elements in sizes:
        done = subprocess.run(
            [sys.executable, __file__, "--one", str(elements)], capture_output=True, text=True, check=True
        )
        rows.append(json.loads(done.stdout.splitlines()[-1]))
        print(f"{rows[-1][0]:8d} unknowns: step {1e3 * rows[-1][1]:9.3f} ms", flush=True)
    rows = np.array(rows)
    unknowns, step, count, memory, blocks = rows.T
    of_blocks = blocks.astype(bool)
    lines = [
        (
            f"{compat.version()}; medians, processor time, one process. Memory is the process's largest, everything"
            " loaded."
        ),
        "",
        "| unknowns | factored | Newton step (ms) | us an unknown | count of negative modes (ms) | memory (MB) |",
        "|---|---|---|---|---|---|",
        *(
            f"| {n:.0f} | {'by blocks' if b else 'pivoting'} | {1e3 * a:.3f} | {1e6 * a / n:.2f} | {1e3 * c:.3f} |"
            f" {m:.0f} |"
            for n, a, c, m, b in rows
        ),
        "",
        (
            f"Exponents, least squares: step by blocks {exponent(unknowns[of_blocks], step[of_blocks]):.3f}, pivoting "
            f"{exponent(unknowns[~of_blocks], step[~of_blocks]):.3f}, all rows {exponent(unknowns, step):.3f}; count "
            f"{exponent(unknowns, count):.3f}; memory above the smallest, pivoting "
            f"{exponent(unknowns[~of_blocks], memory[~of_blocks] - memory[0]):.3f}."
        ),
    ]
    text = "\n".join(lines)
    Path(out).mkdir(parents=True, exist_ok=True)
    (Path(out) / "scaling.md").write_text(text + "\n", encoding="utf-8")
    print(text)
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measure(options.one)))
    else:
        main(QUICK if options.quick else SIZES)
