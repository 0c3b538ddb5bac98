"""Computing time of a long pipe in motion at the wall of a hole, by parts.

    python demos/evidence/wall_in_motion.py            medians of 3 runs of 0.3 s; writes out/wall_in_motion.md
    python demos/evidence/wall_in_motion.py --quick    one run of a few steps

A drill-pipe of 5 km, 800 P2 elements, in a straight hole with an inclination of 60 degrees, steps of 2 ms. All of its
1601 nodes may touch the wall. It lies on the low side of the hole and begins to turn and slide; or it falls on it and
bounces. Forms are compiled before. The parts are timed apart, at the state at rest; the rest is what an iteration takes
beyond a residual and a substitution: contact, its share of tangents, and what a step takes once.
"""

import statistics

import numpy as np
from harness import HEADS, command, in_words, judged, table, timed, write

import cosserat_fenicsx as cf
from cosserat_fenicsx.dynamics.simulate import solvers_of
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.ranks import communicator

LENGTH, BEGINS, INCLINATION = 5000.0, 100.0, 60.0  # m, m, degrees
RADIUS, BORE, CLEARANCE, STIFFNESS, FRICTION, SPIN = 0.0635, 0.1086, 0.04445, 1e7, 0.25, 10.0  # m, N/m^2, 1/s
DT, ELEMENTS, DEGREE, GRAVITY = 0.002, 800, 2, 9.81  # s, m/s^2
#: height from which it falls, m
KINDS = {"lies, turns and slides": 0.0, "falls and bounces": 0.003}
ASKED, REPEATS = 3.0, 20  # processor seconds a simulated second; of parts


def pipe(height, length=LENGTH):
    """The scene of the pipe at a height (m) above the wall on the low side."""
    path = cf.well.WellPath.from_survey([0, length + 2 * BEGINS], [INCLINATION] * 2, [0, 0], length_unit="m")
    steel = cf.Material(E=206e9, nu=0.3, density=7850.0)
    section = cf.Tube(2 * RADIUS, BORE)
    along = path.tangent(BEGINS)
    low = np.array([0, 0, 1.0]) - along[2] * along
    weight = section.stiffness(steel).mass * GRAVITY * np.linalg.norm(low)
    off = (CLEARANCE + weight / STIFFNESS - height) * low / np.linalg.norm(low)
    rod = cf.Rod(
        cf.Line(path.position(BEGINS) + off, path.position(BEGINS + length) + off), section, steel, name="pipe"
    )
    wall = cf.well.HoleWall(
        rod, path, RADIUS + CLEARANCE, RADIUS, stiffness=STIFFNESS, friction=FRICTION, begins=BEGINS
    )
    turning = cf.InitialVelocity(rod, angular=SPIN * along, about=tuple(rod.curve.position(0.0)))
    return cf.Scene([rod], [], [wall, cf.Weight((0, 0, GRAVITY))], velocities=[turning])


def parts(scene, elements):
    """Median processor times (us) of a residual, a fresh tangent and a substitution, on the scene at rest."""
    layout = Layout.of(scene, elements)
    with solvers_of(scene.over(DT), layout, DEGREE, "momentum", 1.0, communicator(None), "spatial") as (problem, _):
        problem.begin_step(0.0, DT)
        found = problem.numbering.vector()
        tasks = (
            lambda: problem.function(problem.x, problem.b), problem.factor, lambda: problem.solve(problem.b, found),
        )  # fmt: skip
        return [1e6 * statistics.median(timed(task)[1] for _ in range(REPEATS)) for task in tasks]


def measure(height, runs, duration, length, elements):
    """(median processor time (s) of a simulated second, the `History`)."""
    scene = pipe(height, length)
    settings = {"dt": DT, "elements": elements, "degree": DEGREE, "save_every": duration / 4, "progress": False}
    cf.simulate(scene, 2 * DT, **settings)
    seconds = []
    for _ in range(runs):
        history, spent = timed(lambda: cf.simulate(scene, duration, **settings))
        seconds.append(spent / duration)
    return statistics.median(seconds), history


def main(runs=3, duration=0.3, length=LENGTH, elements=ELEMENTS, out="out"):
    """Print the tables and write them to out/wall_in_motion.md. Returns {kind: (processor seconds a simulated second,
    History)}."""
    found = {kind: measure(height, runs, duration, length, elements) for kind, height in KINDS.items()}
    residual, tangent, substitution = parts(pipe(0.0, length), elements)
    rows, split = [], []
    for kind, (seconds, history) in found.items():
        count = history.iterations.sum()
        off = np.abs(history.balance).max() / np.abs(history.work).max()
        rows.append((kind, f"{count / history.steps[-1]:.1f}", f"{off:.0e}", judged(seconds, ASKED, ".2f")))
        rest = 1e6 * seconds * duration / count - residual - substitution
        split.append((kind, *(f"{x:.0f}" for x in (residual, substitution, rest, tangent))))
    lines = [
        f"{in_words()}. Medians of {runs} run(s) of {duration:g} s, steps of {1e3 * DT:g} ms, {elements} P{DEGREE} "
        f"elements on {length:g} m; processor seconds a simulated second.",
        "",
        *table(f"pipe | iterations a step | energy balance over work | s | {HEADS}", rows),
        "",
        *table("pipe | residual (us) | substitution | rest of an iteration | a fresh tangent", split),
    ]
    print(write("wall_in_motion", lines, out))
    return found


if __name__ == "__main__":
    command(__doc__, main, {"runs": 1, "duration": 0.02, "length": 250.0, "elements": 40})
