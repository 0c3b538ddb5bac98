"""The exact rod in three wells: Newton steps, processor time, and estimated errors beside true ones.

    python demos/evidence/rods_in_wells.py           every operation; medians of 5 runs; writes out/rods_in_wells.md
    python demos/evidence/rods_in_wells.py --quick   one operation in one well and in a random one, one run

A uniform string in well P (turn and horizontal), Volve 15/9-F-12 and ISCWSA standard well 2, coefficient of friction
0.25, in every operation; drilling and sliding once more with the bit centred in the hole. Each is solved at the default
settings, on elements of 2 m, and on elements of about half a metre in a wall of 1e11 N/m^2, whose hook load and
torque count as true. A broomstick is 40 depths of the bit by `depth_sweep`. Times are processor times on one thread,
forms compiled. The ratio, which depends less on the machine, is the time on elements of 2 m over that of as many
solutions with banded matrices of the same sizes (LAPACK's gbsv) as there were Newton steps.

Three operations each in 40 random wells of tests/random_wells.py with assemblies of a bit and stabilisers are timed
as `torque_and_drag` chooses the model; and small pipe that slides in a horizontal hole beyond its helical buckling
load, by model="rod", until it has an answer or says that it finds none.
"""

import json
import statistics
import sys
import warnings
from pathlib import Path

import numpy as np
from harness import HEADS, command, in_words, judged, table, timed, write
from scipy.linalg import solve_banded

import cosserat_fenicsx as cf
from cosserat_fenicsx.well.rod.rod_in_hole import solve_in_hole

TESTS = Path(__file__).resolve().parents[2] / "tests"
SURVEYS = TESTS / "reference" / "wells.json"
WELLS = ("P", "F-12", "ISCWSA 2")
WEIGHT, RADIUS, CLEARANCE, FRICTION, BIT = 241.13, 0.0635, 0.04445, 0.25, 0.1  # N/m, m
STIFFNESS = cf.Stiffness((1.35359e8, 1.35359e8), 7.03868e8, (1228200.0, 1228200.0), 9.4e5)
ON_BIT, TORQUE, SPEED, RPM = 50e3, 3e3, 0.2, 60.0  # N, N m, m/s, 1/min
#: (operation, whether the bit is centred)
CASES = (
    (cf.well.TripOut(), False),
    (cf.well.TripIn(), False),
    (cf.well.RotateOffBottom(), False),
    (cf.well.Ream(SPEED, RPM), False),
    (cf.well.BackReam(SPEED, RPM), False),
    (cf.well.Static(), False),
    (cf.well.Sliding(ON_BIT), False),
    (cf.well.RotaryDrilling(ON_BIT, TORQUE), False),
    (cf.well.Sliding(ON_BIT), True),
    (cf.well.RotaryDrilling(ON_BIT, TORQUE), True),
)
FINE, STIFF, LENGTH = 8192, 1e11, 2.0  # elements and N/m^2, of what counts as true; m, of an element
BEFORE = 4  # elements over those of the mesh before, where their number is asked for
DEPTHS, SHALLOWEST = 40, 0.2  # of a broomstick; over the deepest
#: At most: Newton steps; s at default settings and on elements of 2 m; s of a broomstick; error of the hook load.
STEPS, DEFAULT, AT_2M, BROOM, ERROR = 55, 0.3, 1.0, 20.0, 1e-5
#: Random wells with assemblies; at most, s: median and largest of their operations, and of a string that slides.
MANY, MEDIAN, LONGEST, ENDS = 40, 1.0, 3.0, 10.0
#: Pipe (outer and inner diameter, tool joint, m; mass, kg/m), diameter of the hole, m, and length of its horizontal, m.
SMALL = {
    "coiled tubing 2 in": ((0.0508, 0.0429, 0.0508, 5.5), 0.1556, 500),
    "coiled tubing 2 3/8 in": ((0.0603, 0.0507, 0.0603, 7.0), 0.1556, 1500),
    "drill pipe 2 7/8 in": ((0.0730, 0.0546, 0.1016, 16.2), 0.1556, 1500),
    "drill pipe 5 in": ((0.1270, 0.1086, 0.1651, 31.1), 0.2159, 3000),
}
WEIGHTS = (10e3, 30e3, 80e3)  # N, on bit
FORMS = {"elements": "d", "steps": "d", "seconds": ".2f", "errors": ".0e", "estimates": ".0e"}
UNKNOWNS, BAND = 7, 27  # of a node; on each side of the diagonal, P3


def well(name):
    """The `Borehole` of a reference well."""
    stations = json.loads(SURVEYS.read_text(encoding="utf-8"))[name]["stations_md_inc_azi"]
    path = cf.well.WellPath.from_survey(*np.transpose(stations))
    return cf.well.Borehole(path, cf.well.HoleSection(path.length, 2 * (RADIUS + CLEARANCE), FRICTION))


def solved(hole, operation, centred, elements=None, **settings):
    """The `InHole` of the rod, at the default settings or on a fixed number of elements."""
    end = hole.length
    return solve_in_hole(
        hole.path, [end], STIFFNESS, WEIGHT, RADIUS, radius=RADIUS + CLEARANCE, friction=FRICTION,
        slip=operation.direction(RADIUS), bottom_tension=-operation.weight, bottom_torque=operation.torque,
        rings=[(end, 0.0, BIT)] if centred else [], elements=elements, progress=False, **settings,
    )  # fmt: skip


def yardstick(elements):
    """Processor time, s, of a solution with a banded matrix of the size of the rod's, without regard to its values."""
    n = UNKNOWNS * (3 * elements + 1)
    bands = np.ones((2 * BAND + 1, n))
    bands[BAND] = 100.0
    return timed(lambda: solve_banded((BAND, BAND), bands, np.ones(n)))[1]


def measure(hole, operation, centred, runs, fine):
    """What one operation takes and how far it is off, as a dict: load (N, the true one) and, for the default settings
    and for elements of 2 m in turn, the lists steps, elements, seconds, errors and estimates (of the hook load,
    relative) and covered (whether hook load and, where the string turns, torque differ from the true ones by no more
    than estimated); ratio."""
    counts = (None, round(hole.length / LENGTH))
    true = solved(hole, operation, centred, fine, wall_stiffness=STIFF)
    found = [solved(hole, operation, centred, count) for count in counts]  # compiles
    seconds, ratios = [[], []], []
    for _ in range(runs):
        for count, times in zip(counts, seconds, strict=True):
            times.append(timed(lambda count=count: solved(hole, operation, centred, count))[1])
        last = int(found[1].path.iterations[0])  # the others are on the mesh before
        solutions = last * yardstick(counts[1]) + (found[1].steps - last) * yardstick(counts[1] // BEFORE)
        ratios.append(seconds[1][-1] / solutions)
    names = ("hook_load", "surface_torque") if operation.slip[1] or operation.torque else ("hook_load",)
    return {
        "load": true.hook_load,
        "steps": [answer.steps for answer in found],
        "elements": [answer.path.elements[0] for answer in found],
        "seconds": [statistics.median(times) for times in seconds],
        "ratio": statistics.median(ratios),
        "errors": [abs(answer.hook_load / true.hook_load - 1) for answer in found],
        "estimates": [answer.errors["hook_load"] / abs(answer.hook_load) for answer in found],
        "covered": [all(abs(getattr(answer, name) - getattr(true, name)) <= answer.errors[name] for name in names)
                    for answer in found],
    }  # fmt: skip


def broomstick(hole, operation, depths):
    """Processor time, s, of a sweep over a number of depths of the bit, and the largest estimated error in it."""
    pipe = cf.well.DrillString([cf.well.Component(None, STIFFNESS, WEIGHT, RADIUS, name="pipe")])
    where = np.linspace(SHALLOWEST, 1.0, depths) * hole.length
    sweep, seconds = timed(lambda: cf.well.depth_sweep(hole, pipe, operation, where, model="rod", progress=False))
    return seconds, float(sweep.values["error"].max())


def spent(*asked, **settings):
    """Processor time, s, of a `torque_and_drag`, and its model, or "none" where it raises."""

    def task():
        try:
            return cf.well.torque_and_drag(*asked, progress=False, **settings).model
        except (cf.SceneError, cf.NotConverged):
            return "none"

    return timed(task)[::-1]


def random_operations(count):
    """`spent` of each operation in a number of random wells with assemblies."""
    sys.path.append(str(TESTS))
    import random_wells

    found, seed = [], 0
    with warnings.catch_warnings(action="ignore", category=cf.SceneWarning):
        while count:
            drawn, seed = random_wells.draw(seed), seed + 3  # of these every third has a bit
            if any(isinstance(part, cf.well.Stabiliser) for part in drawn.string.components):
                given, count = {"mud": drawn.mud, "depth": drawn.depth}, count - 1
                found += [spent(drawn.hole, drawn.string, operation, **given) for operation in drawn.operations]
    return found


def slides(names):
    """[(name, weight on bit, *`spent`)] of small pipe in a horizontal hole."""
    for name in names:
        (outer, inner, joint, mass), diameter, length = SMALL[name]
        path = cf.well.WellPath.from_survey([0, 1000, 1900, 1900 + length], [0, 0, 90, 90], [0] * 4)
        pipe = cf.well.DrillPipe(outer_diameter=outer, inner_diameter=inner, tool_joint=joint, mass=mass)
        hole = cf.well.Borehole(path, cf.well.HoleSection(path.length, diameter, FRICTION))
        for weight in WEIGHTS:
            asked = hole, cf.well.DrillString([pipe]), cf.well.Sliding(weight)
            yield name, weight, *spent(*asked, mud=cf.well.Mud(1200.0), model="rod")


def lines(rows, sweeps, operations, slid, runs, depths):
    """The tables as Markdown."""
    yield (
        f"{in_words()}. Medians of {runs} run(s); in each cell first at the default settings, then on elements "
        f"of {LENGTH:g} m. Asked: at most {STEPS} Newton steps, {DEFAULT:g} s and {AT_2M:g} s, hook load to {ERROR:g}."
    )
    yield ""
    cells = []
    for name, what, found in rows:
        elements, steps, seconds, errors, estimates = (
            ", ".join(format(number, form) for number in found[key]) for key, form in FORMS.items()
        )
        cells.append((name, what, elements, steps, seconds, f"{found['ratio']:.1f}", f"{found['load']:.1f}", errors,
                      estimates, missed(found)))  # fmt: skip
    heads = "well | operation | elements | Newton steps | s | ratio | hook load (N) | its relative error | estimated"
    yield from table(f"{heads} | missed", cells)
    yield ""
    yield f"Broomsticks of {depths} depths, asked at most {BROOM:g} s:"
    yield ""
    cells = [(name, what, f"{seconds:.1f}", f"{error:.0e}") for name, what, seconds, error in sweeps]
    yield from table("well | operation | s | largest estimated error", cells)
    yield ""
    seconds, models = zip(*operations, strict=True)
    told = ", ".join(f"{models.count(x)} {x}" for x in dict.fromkeys(models))
    yield f"{len(seconds)} operations in random wells with assemblies; the models that answered: {told}."
    yield ""
    cells = [("median", judged(statistics.median(seconds), MEDIAN, ".2f"))]
    cells += [("largest", judged(max(seconds), LONGEST, ".2f"))]
    yield from table(f"processor time | s | {HEADS}", cells)
    if slid:
        yield ""
        yield "Sliding in a horizontal hole, by model='rod':"
        yield ""
        cells = [(name, f"{w / 1e3:g}", model, judged(s, ENDS, ".1f")) for name, w, s, model in slid]
        yield from table(f"pipe | weight on bit (kN) | answer | s | {HEADS}", cells)


def missed(found):
    """Which of the numbers asked for are missed, as text."""
    default, at_2m = found["seconds"]
    wrong = {
        "steps": max(found["steps"]) > STEPS,
        "s": default > DEFAULT or at_2m > AT_2M,
        "error": found["errors"][1] > ERROR,
        "ESTIMATE": not all(found["covered"]),
    }
    return ", ".join(name for name, value in wrong.items() if value)


def main(quick=False, out="out"):
    """Print the tables and write them to out/rods_in_wells.md. Returns [(well, operation, what `measure` found)],
    [(well, operation, s, largest estimated error)], and [(s, model)] of the operations in random wells."""
    runs, fine, depths = (1, 512, 1) if quick else (5, FINE, DEPTHS)
    rows, sweeps = [], []
    for name in WELLS[:1] if quick else WELLS:
        hole = well(name)
        for operation, centred in CASES[1:2] if quick else CASES:
            what = operation.name + (", bit centred" if centred else "")
            rows.append((name, what, measure(hole, operation, centred, runs, fine)))
        for operation, _ in CASES[:1] if quick else CASES[:3]:
            sweeps.append((name, operation.name, *broomstick(hole, operation, depths)))
    operations, slid = random_operations(1 if quick else MANY), [*slides(() if quick else SMALL)]
    print(write("rods_in_wells", lines(rows, sweeps, operations, slid, runs, depths), out))
    return rows, sweeps, operations


if __name__ == "__main__":
    command(__doc__, main, {"quick": True})
