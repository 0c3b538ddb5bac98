"""Time saved by the cheapest valid model: every scene with every valid model, on the same mesh.

    python demos/evidence/rungs.py            medians of 9 alternating runs, processor time, warm
    python demos/evidence/rungs.py --quick    one run each, to check that the models agree

Times are those of `solve` and the query of the tip's position; ratios are to the spatial model in the same run. The
error is that of the tip, the largest over the path, relative to its displacement, against the exact rod
(`cosserat_fenicsx.analytic`) if available, otherwise against the spatial model on four times as many elements.
"""

import platform
from pathlib import Path

import numpy as np
from cantilever import column, exact
from harness import HEADS, command, in_turns, judged, share, table, write

import cosserat_fenicsx as cf
from cosserat_fenicsx import compat
from cosserat_fenicsx.models.signature import fitting

STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)
SWEEP = np.linspace(0.05, 1.5, 31)


def eccentric_cantilever():
    """The paper's column, 31 points."""
    rod, scene = column()
    delta = exact(rod, SWEEP).delta
    return scene, rod.end, SWEEP, lambda tip: np.abs(tip[:, 0] / delta - 1).max()


def elastica():
    """An inextensible, unshearable cantilever under a transverse tip force of up to 10 EI/L^2."""
    section = cf.Stiffness((np.inf, np.inf), np.inf, (1.0, 1.0), 1.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (1.0, 0, 0)), section, name="cantilever")
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, 10.0))])
    return scene, rod.end, np.linspace(0.1, 1, 10), None


def self_weight():
    """A steel wire of 3 m and 4 mm, clamped horizontally, under its weight."""
    rod = cf.Rod(cf.Line((0, 0, 0), (3.0, 0, 0)), cf.Circle(0.004), STEEL, name="wire")
    return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Weight()]), rod.end, np.linspace(0.1, 1, 10), None


def from_file(name, station, etas):
    """A scene of demos/ whose tip is at a station."""
    scene = cf.read(Path(__file__).parents[1] / f"{name}.toml").scene
    return scene, scene.station(station), etas, None


def bend():
    """The 45-degree bend (Bathe & Bolourchi, 1979), loaded out of its plane."""
    return from_file("bend_45", "bend.end", np.linspace(0.1, 1, 10))


def lee_frame():
    """Lee's frame (Lee, Manuel & Rossow, 1968) up to three quarters of its limit load."""
    return from_file("lees_frame", "beam@24.0", 1.854656 * np.linspace(0.075, 0.75, 10))


def spring():
    """A helix of three turns, stretched by a dead force."""
    rod = cf.Rod(cf.Helix((0, 0, 0), (0.05, 0, 0), 3, 0.03), cf.Circle(0.004), STEEL, name="spring")
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, 60.0))])
    return scene, rod.end, np.linspace(0.1, 1, 10), None


#: At most, the time of the automatic choice over that of the spatial model, both refined.
ASKED = {"eccentric_cantilever": 1 / 5, "elastica": 1 / 5}
#: Scene, and the meshes (degree, elements) to solve it on; None: refined to the default tolerance.
SCENES = (
    (eccentric_cantilever, ((4, 4), (4, 8), None)),
    (elastica, ((4, 8), None)),
    (self_weight, ((4, 16),)),
    (bend, ((4, 8),)),
    (lee_frame, ((4, 8), None)),
    (spring, ((4, 24),)),
)


def compare(draw, mesh, runs):
    """Rows (model, unknowns, median time (s), median ratio to spatial, error of the tip, estimated error), of every
    valid model; refined, of the automatic choice too."""
    scene, station, etas, error = draw()
    models = [*fitting(scene), *(["auto"] if mesh is None else [])]
    given = {} if mesh is None else dict(zip(("degree", "elements"), mesh, strict=True))

    def run(model):
        path = cf.solve(scene, etas, model=model, **given)
        return path, path.displacement(station)

    paths = {model: run(model) for model in models}
    if error is None:
        fine = 4 * max(paths["spatial"][0].elements)
        truth = cf.solve(scene, etas, model="spatial", elements=fine).displacement(station)

        def error(tip):
            return (np.linalg.norm(tip - truth, axis=1) / np.linalg.norm(truth, axis=1)).max()

    measured = in_turns([lambda model=model: run(model) for model in models], runs)
    times = dict(zip(models, measured.T, strict=True))
    return [
        (
            model,
            paths[model][0].unknowns,
            np.median(times[model]),
            np.median(times[model] / times["spatial"]),
            error(paths[model][1]),
            paths[model][0].error.max(),
        )
        for model in models
    ]


def main(runs=9, out="out", scenes=SCENES):
    """Print the table and write it to out/rungs.md. Returns {(scene, mesh): rows of `compare`}."""
    cells, found = [], {}
    for draw, meshes in scenes:
        for mesh in meshes:
            rows = found[draw.__name__, mesh] = compare(draw, mesh, runs)
            name = "refined" if mesh is None else f"P{mesh[0]}, {mesh[1]}"
            for model, unknowns, seconds, ratio, error, estimate in rows:
                told = f"{estimate:.0e}" if np.isfinite(estimate) else "-"
                most = ASKED.get(draw.__name__) if model == "auto" else None
                scene, verdict = (
                    draw.__name__.replace("_", " "),
                    judged(ratio, most) if most else (f"{share(ratio)} | - | -"),
                )
                cells.append((scene, name, model, unknowns, f"{error:.0e}", told, f"{1e3 * seconds:.2f}", verdict))
    heads = f"scene | mesh | model | unknowns | error of the tip | estimate | ms | over spatial | {HEADS}"
    print(write("rungs", [f"{compat.version()}, {platform.machine()}.", "", *table(heads, cells)], out))
    return found


if __name__ == "__main__":
    command(__doc__, main, {"runs": 1})
