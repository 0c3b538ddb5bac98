"""Wall clock of a Newton step on one, two and four ranks, with the spatial model at 1e5 and 1e6 unknowns.

    python demos/evidence/ranks.py            runs itself under mpirun, on an idle machine; writes out/ranks.md
    python demos/evidence/ranks.py --quick    7000 unknowns, one round

The cantilever and the step of scaling.py. Numbers of ranks take turns; results are medians over all rounds. More ranks
than the machine has cores show only whether the digits are the same.
"""

import os
import shutil
import time
from pathlib import Path

import numpy as np
from harness import HEADS, apart, command, in_words, judged, table, write
from mpi4py import MPI
from scaling import from_rest, loaded

SIZES, QUICK = (3600, 35715), (256,)  # elements of degree 4: 28 unknowns each
RANKS = (1, 2, 4)
ROUNDS = 3
ASKED = 1 / 1.6  # at most, the time of two ranks over that of one


def measure(elements):
    """Unknowns, times (s) of Newton steps, and the displacement of the tip after a step, over the length."""
    with loaded(elements) as (problem, newton, _):
        model, comm = problem.model, problem.model.comm
        step = from_rest(problem, newton, time.perf_counter, comm.Barrier)
        seconds = [comm.allreduce(step(), MPI.MAX) for _ in range(max(3, min(50, 40000 // elements)))]
        moved, _ = model.snapshot()
        return model.unknowns, seconds, moved[-1][:3].tolist()


def under_mpirun(ranks, elements):
    """The result of `measure` on a number of ranks."""
    program = "/usr/bin/mpirun" if Path("/usr/bin/mpirun").exists() else shutil.which("mpirun")
    # not bound to cores: one of them may be busy with something else, and the other ranks would wait
    words = [program, "--oversubscribe", "--bind-to", "none", "-n", str(ranks)]
    return apart(__file__, elements, words)


def main(sizes=SIZES, rounds=ROUNDS, out="out", ranks=RANKS):
    """Print the table, write it to out/ranks.md. Returns [(unknowns, {ranks: median time (s)}, largest difference of
    the tip's displacement, relative)]."""
    lines = [
        f"{in_words()}. Wall clock, medians of {rounds} run(s) in turn; at the start {os.getloadavg()[0]:.1f}"
        " other processes were running.",
        "",
    ]
    rows, found = [], []
    for elements in sizes:
        seconds, tips = {n: [] for n in ranks}, {}
        for _ in range(rounds):
            for n in ranks:
                unknowns, times, tips[n] = under_mpirun(n, elements)
                seconds[n] += times
        medians = {n: float(np.median(times)) for n, times in seconds.items()}
        one = np.array(tips[1])
        apart = max(float(np.abs(np.array(tip) - one).max() / np.abs(one).max()) for tip in tips.values())
        told = [f"{1e3 * s:.1f}" for s in medians.values()]
        rows.append((unknowns, *told, f"{apart:.0e}", judged(medians[2] / medians[1], ASKED)))
        found.append((unknowns, medians, apart))
    heads = " | ".join(f"{n} rank{'s' * (n > 1)} (ms)" for n in ranks)
    heads = f"unknowns | {heads} | digits: largest difference of the tip | two over one | {HEADS}"
    print(write("ranks", [*lines, *table(heads, rows)], out))
    return found


if __name__ == "__main__":
    command(__doc__, main, {"sizes": QUICK, "rounds": 1}, one=measure)
