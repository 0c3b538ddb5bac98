"""Computing time of a simulated second: a hanging drill-pipe of 1 km, moved up and down, 200 P2 elements, steps of 5
ms.

    python demos/evidence/steps.py            medians of 7 runs of 5 s, processor time; writes out/steps.md
    python demos/evidence/steps.py --quick    one run of 0.2 s

Forms are compiled and the initial equilibrium is computed before; the time is that of the whole call of `simulate`,
with the energy balance and the state saved every second.
"""

import argparse
import statistics
import time
from pathlib import Path

from machine import in_words, record

import cosserat_fenicsx as cf

ELEMENTS, DEGREE, DT = 200, 2, 0.005
#: (model, scheme)
KINDS = (("spatial", "momentum"), ("planar", "momentum"), ("spatial", "energy"))


def pipe():
    """The pipe (5 in x 4.276 in), its scene, and the initial equilibrium, by the model's name."""
    steel = cf.Material(E=210e9, nu=0.3, density=7850.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1000.0)), cf.Tube(0.127, 0.1086), steel, name="pipe")
    held, weight = [cf.Clamp(rod.end)], cf.Weight((0, 0, -9.81))
    pull = cf.Force(rod.start, cf.Sine((300.0, 0, 0), 0.2))

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
        began = time.process_time()
        history = cf.simulate(scene, duration, start=start, **settings)
        seconds.append((time.process_time() - began) / duration)
    return statistics.median(seconds), history.iterations.sum() / history.steps[-1], history


def main(runs=7, duration=5.0, out="out"):
    """Print the table and write it to out/steps.md.

    Returns:
        [(seconds, iterations, History)], one of each kind.
    """
    lines = [
        (
            f"{in_words(record())}. Medians of {runs} run(s) of {duration:g} s, steps of {1e3 * DT:g} ms, {ELEMENTS}"
            f" P{DEGREE} elements."
        ),
        "",
        "| model | scheme | unknowns | iterations a step | processor seconds a simulated second |",
        "|---|---|---|---|---|",
    ]
    found = []
    for model, scheme in KINDS:
        seconds, iterations, history = measure(model, scheme, runs, duration)
        lines.append(f"| {model} | {scheme} | {history.unknowns} | {iterations:.1f} | {seconds:.3f} |")
        found.append((seconds, iterations, history))
    text = "\n".join(lines)
    Path(out).mkdir(parents=True, exist_ok=True)
    (Path(out) / "steps.md").write_text(text + "\n", encoding="utf-8")
    print(text)
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    main(*((1, 0.2) if parser.parse_args().quick else ()))
