"""Many cases of one scene: `compile` beside `solve`, processor time a case, and whether the digits are the same.

python demos/evidence/cases.py            medians of 5 alternating runs
python demos/evidence/cases.py --quick    few cases, to check the digits
"""

import numpy as np
from harness import command, in_turns, table, write

import cosserat_fenicsx as cf
from cosserat_fenicsx import compat
from cosserat_fenicsx.scene.parameters import parameter_of, scene_with

OVER = ["rods.column.section.diameter", "rods.column.material.E", "loads[0].force[0]", "loads[0].force[2]"]
ASKED = [("displacement", "column.end", 0), ("moment", "column.start", 1)]
SPREAD = 0.05  # of every number, relative


def column(sideways):
    """A slender column under a dead force at its end, and half way up another one out of its plane where not 0."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Circle(0.01), cf.Material(E=2e11, nu=0.3), name="column")
    loads = [cf.Force(rod.end, (3.0, 0.0, -20.0))]
    if sideways:
        loads.append(cf.Force(rod.at(0.5), (0.0, sideways, 0.0)))
    return cf.Scene([rod], [cf.Clamp(rod.start)], loads)


def measured(scene, over, *, cases, calls, runs):
    """(seconds a case of `batch`, of a call, of `solve`; cases that went to `solve`; largest relative difference)."""
    compiled = cf.compile(scene, over, ASKED)
    base = np.array([parameter_of(scene, name).value for name in over])
    values = base * (1 + SPREAD * np.random.default_rng(0).uniform(-1, 1, (cases, len(over))))
    scenes = [scene_with(scene, over, row) for row in values[:calls]]
    paths = [cf.solve(each, [1.0]) for each in scenes]
    wanted = np.array([[p.displacement("column.end")[0, 0], p.moment("column.start")[0, 1]] for p in paths])
    found = compiled.batch(values)

    def by_solve():
        for row in values[:calls]:
            cf.solve(scene_with(scene, over, row), [1.0])

    tasks = (lambda: compiled.batch(values), lambda: [compiled(row) for row in values[:calls]], by_solve)
    spent = np.median(in_turns(tasks, runs), axis=0) / [cases, calls, calls]
    return *spent, int(found.by_solve.sum()), float(np.abs(found.values[:calls] / wanted - 1).max())


def main(cases=2048, calls=100, runs=5, out="out"):
    """Print the table and write it to out/cases.md. Returns (largest relative difference from `solve`, cases that went
    to it) of every row."""
    rows, results = [], []
    for name, scene, over in (
        ("planar column, four numbers", column(0.0), OVER),
        ("planar column, two forces", column(0.0), OVER[2:]),
        ("spatial column, two forces", column(2.0), OVER[2:]),
        ("planar column, its length", column(0.0), ["rods.column.curve.end[2]"]),
    ):
        *spent, left, apart = measured(scene, over, cases=cases, calls=calls, runs=runs)
        rows.append((name, *(f"{1 / each:.0f}" for each in spent), left, f"{apart:.0e}"))
        results.append((apart, left))
    about = f"{compat.version()}; medians of {runs} run(s), processor time, one process, {cases} cases."
    heads = "scene, what changes | `batch`, cases/s | a call, cases/s | `solve`, cases/s | left to `solve` | differs by"
    print(write("cases", [about, "", *table(heads, rows)], out))
    return results


if __name__ == "__main__":
    command(__doc__, main, {"cases": 64, "calls": 4, "runs": 1})
