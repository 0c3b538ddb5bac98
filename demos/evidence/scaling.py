"""Processor time and memory of a Newton step against the number of unknowns, 1e2 .. 1e6, with the spatial model.

    python demos/evidence/scaling.py             to 1e6 unknowns; writes out/scaling.md
    python demos/evidence/scaling.py --quick     to 1e4

Each size runs in a separate process: a thick cantilever under a small transverse force, degree 4, one Newton step
(residual, tangent, factorisation, solution, update of n) repeated from rest, and one count of negative modes; medians.

A second table has complex modes: six of a shaft that turns, with damping and a dashpot. A third has a step at 8
elements beside that of the cheapest rod there is, in plain C (floor.c), and its parts.
"""

import os
import resource
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from cantilever import column
from harness import HEADS, apart, command, judged, table, timed, write

import cosserat_fenicsx as cf
from cosserat_fenicsx import compat
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.statics.problem import solvers_of

SIZES = (4, 16, 64, 256, 1024, 4096, 16384, 35715)  # elements of degree 4: 28 unknowns each
QUICK = SIZES[:5]
DEGREE = 4
LOAD = 1e-6  # load factor
EXPONENT, MILLION, FLOOR = 1.05, 0.5, 5.0  # asked at most: exponent; s; times the time of floor.c
#: Elements of degree 4 for complex modes, and the processor time (s) asked at most.
COMPLEX = ((360, 0.5), (3572, 8.0))
FEW = 8  # elements of the third table
KINDS = (("determinate", 1), ("planar", 1), ("spatial", 1), ("determinate", 4), ("planar", 4), ("spatial", 4))


def loaded(elements, degree=DEGREE, model="spatial"):
    """Context manager: the problem of the cantilever, its Newton solver for single steps, and its stability count."""
    _, scene = column()
    return solvers_of(scene, Layout.of(scene, elements), degree=degree, model=model)


def from_rest(problem, newton, clock=time.process_time, meet=lambda: None):
    """A function that puts the problem at rest, takes one Newton step in C, as along a path, and returns its seconds by
    a clock; meet: called before it is taken, where several ranks take part."""
    newton.allow(1)
    start, ffi, lib = problem.numbers(), newton._ffi, newton._lib
    # `alone` holds addresses only: the function below keeps the sweep
    sweep = ffi.new("sweep *", {"newton": newton.c, "x": newton.doubles(problem.x.array_w)})
    alone, takes_part = ffi.new("group *", {"count": 1, "sweep": [sweep]}), ffi.new("int *")

    def step():
        problem.put(start)
        problem.set_load_factor(LOAD)
        newton.c.loads, newton.c.rounding, takes_part[0] = LOAD * problem.load_norm, problem.model.round_off, 1
        meet()
        took = timed(lambda: lib.equilibrate(alone, takes_part), clock)[1]
        problem.raise_failure()
        assert sweep.newton == newton.c and takes_part[0] and newton.c.iterations == 1, "no step was taken"
        return took

    return step


def measure(elements):
    """Unknowns, times (s) of a Newton step and of a count of negative modes, largest memory of this process (MB)."""
    with loaded(elements) as (problem, newton, stability):
        step = from_rest(problem, newton)
        times = [(step(), timed(stability.count)[1]) for _ in range(max(5, min(100, 20000 // elements)))]
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        return problem.model.unknowns, *np.median(times, axis=0).tolist(), memory


def parts(model, degree, runs):
    """Times (s) at FEW elements: a whole step; its two residuals; tangent and factors; solution; without the rest of
    it, which is the convergence test and the update of n."""
    with loaded(FEW, degree, model) as (problem, newton, _):
        step = from_rest(problem, newton)
        step()
        lib, c, x = problem._lib, problem.c, newton.doubles(problem.x.array_w)
        calls = (
            lambda: lib.residual(c, x, newton.c.b),
            lambda: lib.tangent(c),
            lambda: lib.solve(c, newton.c.b, newton.c.change),
            lambda: lib.begin_newton(newton.c),
        )
        tasks = step, *(lambda task=task: timed(task)[1] for task in calls)
        found = np.median([[task() for task in tasks] for _ in range(runs)], axis=0)
        return (found[:-1] - found[-1]) * (1, 2, 1, 1)  # without the time of taking the time and of a call


def kernels(model, degree, runs):
    """Time (s) of FFCx's kernels alone for the tangents of FEW elements; of 16 times as many, since calls take time."""
    with loaded(16 * FEW, degree, model) as (problem, _, _):
        return float(np.median([timed(problem.tangent_form.matrices)[1] for _ in range(runs)])) / 16


def complex_modes(elements):
    """Processor time (s) of six complex modes of a shaft that turns."""
    section = cf.Stiffness((1e3, 1e3), 1e3, (1.0, 1.3), 1.0, mass=1.0, inertia=(1e-4, 1e-4, 2e-4))
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), section, name="shaft", damping=cf.Damping(time=1e-3))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Dashpot(rod.end, 2.0), cf.Centrifugal((2.0, 0, 0))])
    return timed(lambda: cf.modes(scene, 6, elements=elements, degree=DEGREE))[1]


def modes_table(sizes, runs=3):
    """Lines of the table of complex modes; the first run of all compiles."""
    complex_modes(FEW)
    rows = [(f"{28 * elements}", judged(float(np.median([complex_modes(elements) for _ in range(runs)])), most, ".2f"))
            for elements, most in sizes]  # fmt: skip
    yield from table(f"unknowns of complex modes | s | {HEADS}", rows)


def floor(steps, elements=FEW):
    """Time (s) of a step of floor.c, and the displacement of its end after one."""
    with tempfile.TemporaryDirectory() as folder:
        program, source = Path(folder, "floor"), Path(__file__).with_name("floor.c")
        words = [os.environ.get("CC", "cc"), "-O3", str(source), "-o", str(program), "-lm"]
        subprocess.run(words, check=True)
        words = [str(program), str(elements), str(steps)]
        told = [subprocess.run(words, capture_output=True, text=True, check=True).stdout.split() for _ in range(5)]
    microseconds, moved = np.median(np.array(told, dtype=float), axis=0)
    return 1e-6 * float(microseconds), float(moved)


def exponent(x, y):
    """The exponent in y = c x^exponent by least squares."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def sizes_table(rows):
    """Lines of the table of sizes, and of what is asked of it."""
    unknowns, step, count, _ = rows.T
    heads = "unknowns | Newton step (ms) | us an unknown | count of negative modes (ms) | memory (MB)"
    yield from table(heads, [(f"{n:.0f}", f"{1e3 * a:.3f}", f"{1e6 * a / n:.2f}", f"{1e3 * c:.3f}", f"{m:.0f}")
                             for n, a, c, m in rows])  # fmt: skip
    yield ""
    asked = [("exponent of the Newton step, least squares over all rows",
              judged(exponent(unknowns, step), EXPONENT, ".3f"))]  # fmt: skip
    if unknowns[-1] >= 1e6:
        asked.append((f"Newton step of {unknowns[-1]:.0f} unknowns (s)", judged(step[-1], MILLION, ".2f")))
    asked.append(("exponent of the count of negative modes", f"{exponent(unknowns, count):.3f}", "-", "-"))
    yield from table(f"asked | found | {HEADS}", asked)


def floor_table(runs):
    """Lines of the table of a step at few elements."""
    least, _ = floor(1000 * runs)
    yield (
        f"A Newton step at {FEW} elements beside that of the cheapest rod there is, planar, P1, in plain C"
        f" (demos/evidence/floor.c): {1e6 * least:.2f} us. The rest is the convergence test and the update"
        " of n, by difference: below zero where parts take longer in calls of their own."
    )
    yield ""
    heads = (
        "step (us) | two residuals | kernels of the tangent | its elimination | solution | the rest |"
        " over the rod in plain C"
    )
    rows = []
    for model, degree in KINDS:
        found, alone = parts(model, degree, runs), kernels(model, degree, runs)
        step, residuals, tangent, solution = found
        parted = step, residuals, alone, tangent - alone, solution, step - found[1:].sum()
        cells = [f"{1e6 * x:.1f}" for x in parted]
        over = found[0] / least
        in_plane = degree == 1 and model != "spatial"
        told = judged(over, FLOOR) if in_plane else f"{over:.3g} | - | -"
        rows.append((f"{model} P{degree}", *cells, told))
    yield from table(f"model | {heads} | {HEADS}", rows)


def main(sizes=SIZES, out="out", runs=300, of_modes=COMPLEX):
    """Print the tables, write them to out/scaling.md. Returns The rows (unknowns, step, count, memory) as an array."""
    rows = []
    for elements in sizes:
        rows.append(apart(__file__, elements))
        print(f"{rows[-1][0]:8d} unknowns: step {1e3 * rows[-1][1]:9.3f} ms", flush=True)
    rows = np.array(rows)
    about = f"{compat.version()}; medians, processor time, one process. Memory is the process's largest, all loaded."
    tables = [*sizes_table(rows), "", *modes_table(of_modes), "", *floor_table(runs)]
    print(write("scaling", [about, "", *tables], out))
    return rows


if __name__ == "__main__":
    command(__doc__, main, {"sizes": QUICK, "of_modes": COMPLEX[:1]}, one=measure)
