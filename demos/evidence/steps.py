"""Computing time of a step of a motion, on many elements and on few, and what a hinge adds to it.

    python demos/evidence/steps.py            medians of 7 runs, processor time; writes out/steps.md
    python demos/evidence/steps.py --quick    one short run of each

Many: a hanging drill-pipe of 1 km, moved up and down, 200 P2 elements, steps of 5 ms. Few: a rod under a short push, 8
P2 elements, steps of 10 ms; clamped, hinged at its start, or with a rotating joint in its middle.

Forms are compiled and the initial equilibrium is computed before; the time is that of the whole call of `simulate`,
with the energy balance and the state saved every second.
"""

import statistics

from harness import HEADS, command, in_words, judged, table, timed, write

import cosserat_fenicsx as cf

ELEMENTS, DEGREE, DT = 200, 2, 0.005
#: (model, scheme)
KINDS = (("spatial", "momentum"), ("planar", "momentum"), ("spatial", "energy"))
HELD = ("clamp", "hinge", "rotating joint")
FEW, STEP = 8, 0.01  # elements; s
ASKED = 0.5  # ms, at most, of a step on few elements


def pipe():
    """The pipe (5 in x 4.276 in), its scene, and the initial equilibrium, by the model's name."""
    steel = cf.Material(E=210e9, nu=0.3, density=7850.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1000.0)), cf.Tube(0.127, 0.1086), steel, name="pipe")
    held, weight = [cf.Clamp(rod.end)], cf.Weight((0, 0, -9.81))
    pull = cf.Force(rod.start, cf.signals.Sine((300.0, 0, 0), 0.2))

    def hanging(model):
        return cf.solve(cf.Scene([rod], held, [weight]), [1.0], elements=ELEMENTS, degree=DEGREE, model=model)

    return rod, cf.Scene([rod], held, [weight, pull]), hanging


def measure(model, scheme, runs, duration):
    """Median processor time (s) per simulated second, iterations per step, and the last `History`."""
    _, scene, hanging = pipe()
    settings = {"dt": DT, "elements": ELEMENTS, "degree": DEGREE, "model": model, "scheme": scheme, "save_every": 1.0}
    start, seconds = hanging(model), []
    cf.simulate(scene, 2 * DT, start=start, **settings)
    for _ in range(runs):
        history, spent = timed(lambda: cf.simulate(scene, duration, start=start, **settings))
        seconds.append(spent / duration)
    return statistics.median(seconds), history.iterations.sum() / history.steps[-1], history


def pushed(held):
    """The scene of a rod of 10 m (as in the flying spaghetti) with a push on its end, and the station of the end."""
    section = cf.Stiffness((1e4, 1e4), 1e4, (500, 500), 500, mass=1.0, inertia=(10, 10, 20))
    half = cf.Rod(cf.Line((0, 0, 0), (5, 0, 0)), section, name="first half")
    rest = cf.Rod(cf.Line((5, 0, 0), (10, 0, 0)), section, name="second half")
    whole = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), section, name="rod")
    rods = [half, rest] if held == "rotating joint" else [whole]
    joints = [cf.Joint(half.end, rest.start, release=(0, 0, 1))] if held == "rotating joint" else []
    support = cf.Hinge(whole.start, (0, 0, 1)) if held == "hinge" else cf.Clamp(rods[0].start)
    push = cf.Force(rods[-1].end, cf.signals.Triangle((0, 20, 5), 0, 1, 2))
    return cf.Scene(rods, [support], [push], joints), rods[-1].end


def compare(runs, duration):
    """[(milliseconds of a step, iterations a step, place of the end at last)], one of each of HELD, by turns."""
    scenes = {held: pushed(held) for held in HELD}
    seconds, found = {held: [] for held in HELD}, {}
    for run in range(runs + 1):  # the first compiles
        for held, (scene, _) in scenes.items():
            elements = FEW // len(scene.rods)
            settings = {"dt": STEP, "elements": elements, "degree": DEGREE, "model": "spatial"}
            found[held], spent = timed(lambda scene=scene, given=settings: cf.simulate(scene, duration, **given))
            if run:
                seconds[held].append(spent)
    return [
        (1e3 * statistics.median(seconds[held]) / history.steps[-1], history.iterations.sum() / history.steps[-1],
         history.position(scenes[held][1])[-1])
        for held, history in found.items()
    ]  # fmt: skip


def main(runs=7, duration=5.0, out="out"):
    """Print the tables and write them to out/steps.md. Returns [(seconds, iterations, History)], one of each kind; and
    what `compare` found."""
    rows, found = [], []
    for model, scheme in KINDS:
        seconds, iterations, history = measure(model, scheme, runs, duration)
        rows.append((model, scheme, history.unknowns, f"{iterations:.1f}", f"{seconds:.3f}"))
        found.append((seconds, iterations, history))
    few = compare(runs, min(duration, 2.0))
    held = [(name, f"{iterations:.1f}", judged(milliseconds, ASKED, ".2f"))
            for name, (milliseconds, iterations, _) in zip(HELD, few, strict=True)]  # fmt: skip
    lines = [
        f"{in_words()}. Medians of {runs} run(s) of {duration:g} s, steps of {1e3 * DT:g} ms, {ELEMENTS} P{DEGREE} "
        "elements.",
        "",
        *table("model | scheme | unknowns | iterations a step | processor seconds a simulated second", rows),
        "",
        f"{FEW} P{DEGREE} elements in space, steps of {1e3 * STEP:g} ms:",
        "",
        *table(f"held by | iterations a step | ms a step | {HEADS}", held),
    ]
    print(write("steps", lines, out))
    return found, few


if __name__ == "__main__":
    command(__doc__, main, {"runs": 1, "duration": 0.2})
