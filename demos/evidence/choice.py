"""What the choice of `solve` costs: "auto" with its error bar against the best model, degree and mesh picked by hand.

    python demos/evidence/choice.py           every demo scene (about 3 minutes)
    python demos/evidence/choice.py --quick   one scene, few meshes

By hand: every model valid for the scene, degrees 2 to 4, and 1, 2, 3, 4, 6, 8 .. elements per rod. Their errors are
known from a fine mesh, so that the cheapest one below the tolerance can be picked, without an error estimate. Times are
processor times of `solve`, warm, medians of alternating runs. Errors are the largest of those that `tol` bounds for
"auto" (positions, rotations, contact forces and moments along the rods, relative to the sizes of `path.errors`).
"""

import platform
from pathlib import Path

import numpy as np
from harness import HEADS, command, in_turns, judged, table, timed, write

import cosserat_fenicsx as cf
from cosserat_fenicsx import compat
from cosserat_fenicsx.models.signature import fitting

SCENES = ("eccentric_cantilever", "bend_45", "lees_frame", "helical_spring", "riser", "tripod")
ASKED = 1.7  # at most, the time of "auto" over that of the best by hand
COUNTS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
_PLACES = np.linspace(0, 1, 102)[1:-1]  # contact forces jump at supports and loads, which stand at whole shares
# Meshes by hand whose first run takes this many times as long as the best so far are not run again.
_HOPELESS = 1.5


def states(path):
    """{quantity: (points, places of all rods, 3 or 4)}, dimensionless."""
    motion = np.concatenate([path.motion(rod, _PLACES) for rod in path.scene.rods], axis=1)
    stations = [rod.at(x * rod.length) for rod in path.scene.rods for x in _PLACES]
    force = np.stack([path.force(station) for station in stations], axis=1) / path.scales.force
    moment = np.stack([path.moment(station) for station in stations], axis=1) / path.scales.moment
    return {"position": motion[..., :3], "rotation": motion[..., 3:], "force": force, "moment": moment}


def error(path, truth, names):
    """Largest error of these quantities along the rods, over all points; truth: the path on a fine mesh, and its
    `states`."""
    (fine, expected), found = truth, states(path)
    errors = []
    for name, sizes in zip(expected, fine._reference.sizes, strict=False):
        off = found[name] - expected[name]
        squares = np.square(off).sum(axis=2)
        if name == "rotation":  # the angle: without the part along q, since interpolated q are no unit quaternions
            squares = 4 * np.maximum(squares - np.square((off * expected[name]).sum(axis=2)), 0.0)
        if name in names:
            errors.append((np.sqrt(squares.max(axis=1)) / sizes).max())
    return float(max(errors))


def compare(scene, etas, tol, runs, counts=COUNTS):
    """Rows (name, model, degree, elements, unknowns, seconds, error, estimate): "auto", then the best by hand; and the
    ratio of their times, the median of alternating runs."""

    def auto():
        return cf.solve(scene, etas, tol=tol)

    auto()  # warm
    chosen = auto()
    fine = 2 * max(max(chosen.elements), 16)
    truth = cf.solve(scene, etas, model=chosen.model, elements=fine, degree=4)
    truth, bounded = (truth, states(truth)), chosen.bounded
    best = None
    for model in fitting(scene):
        if chosen.model == "spatial" and model != "spatial":
            continue  # the planar model was promoted to the spatial one
        for degree in (2, 3, 4):
            for elements in counts:

                def by_hand(model=model, degree=degree, elements=elements):
                    return cf.solve(scene, etas, model=model, degree=degree, elements=elements, tol=tol)

                try:
                    path = by_hand()  # compiles
                except cf.NotConverged:
                    continue
                if error(path, truth, bounded) > tol:
                    continue
                seconds = timed(by_hand)[1]
                if best is None or seconds < _HOPELESS * best[0]:
                    seconds = min(seconds, *(timed(by_hand)[1] for _ in range(4)))
                if best is None or seconds < best[0]:
                    best = seconds, by_hand, path
                if seconds > _HOPELESS * best[0]:
                    break
    _, by_hand, path = best
    auto()  # again warm: the many meshes by hand may have displaced its problem from the pool
    samples = in_turns((auto, by_hand), runs)
    rows = [
        (name, p.model, p.degree, max(p.elements), p.unknowns, seconds, error(p, truth, bounded), float(p.error.max()))
        for name, p, seconds in zip(("auto", "best by hand"), (chosen, path), np.median(samples, axis=0), strict=True)
    ]
    return rows, float(np.median(samples[:, 0] / samples[:, 1]))


def load_factors_of(options):
    """The load factors of a scene file; a range in ten steps."""
    if isinstance(options, tuple):
        return np.linspace(*options, 11)[1:].tolist()
    return list(options)


def main(runs=9, out="out", scenes=SCENES, counts=COUNTS):
    """Print the table and write it to out/choice.md. Returns {scene: what `compare` found}."""
    cells, found = [], {}
    for name in scenes:
        given = cf.read(Path(__file__).parents[1] / f"{name}.toml")
        scene, options = given.scene, given.settings
        tol = options.get("tol", 1e-6)
        rows, ratio = found[name] = compare(scene, load_factors_of(options["load_factors"]), tol, runs, counts)
        for who, model, degree, elements, unknowns, seconds, off, estimate in rows:
            told = f"{estimate:.0e}" if np.isfinite(estimate) else "-"
            verdict = judged(ratio, ASKED) if who == "auto" else " | | "
            cells.append((name.replace("_", " "), f"{tol:.0e}", who, model, degree, elements, unknowns, f"{off:.0e}",
                          told, f"{1e3 * seconds:.2f}", verdict))  # fmt: skip
            print(*cells[-1], sep=" | ", flush=True)
    heads = "scene | tol | | model | degree | elements | unknowns | error | estimate | ms | auto over by hand"
    write("choice", [f"{compat.version()}, {platform.machine()}.", "", *table(f"{heads} | {HEADS}", cells)], out)
    return found


if __name__ == "__main__":
    command(__doc__, main, {"runs": 1, "scenes": SCENES[:1], "counts": (2, 4, 8)})
