"""The documentation's tables of accuracy, on the eccentric cantilever in space (model "spatial"), in Markdown.

python demos/evidence/accuracy.py            writes out/accuracy.md and prints it
python demos/evidence/accuracy.py --quick    two meshes and two slendernesses
"""

import math
import platform

import harness
import numpy as np
from cantilever import ECCENTRICITY, L, column, exact
from harness import command, table, write

import cosserat_fenicsx as cf
from cosserat_fenicsx import analytic, compat

ETAS = (0.9, 1.5)
SLENDER = ((2, 8), (3, 8), (4, 8), (4, 64))  # degree, elements


def relative_errors(rod, scene, truth, **arguments):
    """|delta/exact - 1| at ETAS, and Newton's iterations; None where the path stops."""
    try:
        path = cf.solve(scene, list(ETAS), model="spatial", **arguments)
    except cf.NotConverged:
        return None
    return np.abs(path.displacement(rod.end)[:, 0] / truth - 1), int(path.iterations.sum())


def orders(meshes):
    """Errors of delta by formulation, degree and mesh, and the last observed order above round-off."""
    rod, scene = column()
    truth = exact(rod, np.array(ETAS)).delta
    for formulation in ("mixed", "displacement", "multiplier"):
        for degree in (1, 2, 3, 4):
            found = [
                relative_errors(rod, scene, truth, formulation=formulation, degree=degree, elements=n) for n in meshes
            ]
            errors = np.array([f[0] if f else (np.nan, np.nan) for f in found])
            cells = [f"{e[0]:.1e}, {e[1]:.1e}" if f else "stops" for e, f in zip(errors, found, strict=True)]
            rates = [_last_order(errors[:, i], meshes) for i in range(len(ETAS))]
            newton = ", ".join(str(f[1]) if f else "-" for f in found)
            yield formulation, f"P{degree}", *cells, ", ".join(rates), newton


def _last_order(errors, meshes):
    seen = [i for i in range(1, len(meshes)) if errors[i] > 2e-13]
    if not seen:
        return "round-off"
    return f"{harness.orders(errors, meshes)[seen[-1] - 1]:.1f}"


def slenderness(ratios):
    """Errors of delta at eta = 0.9, 1.5, mixed, against the exact rod of the same slenderness, and iterations."""
    for ratio in ratios:
        rod, scene = column(diameter=L / ratio if math.isfinite(ratio) else 0.2, rigid=math.isinf(ratio))
        k = rod.stiffness
        truth = analytic.reissner(
            np.array(ETAS), ECCENTRICITY, L, bending=k.bending[1], axial=k.axial, shear=k.shear[0]
        ).delta
        found = [relative_errors(rod, scene, truth, degree=p, elements=n) for p, n in SLENDER]
        name = f"{ratio:g}" if math.isfinite(ratio) else "EA = GA = infinity"
        cells = [f"{f[0][0]:.1e}, {f[0][1]:.1e}" if f else "stops" for f in found]
        newton = ", ".join(str(f[1]) if f else "-" for f in found)
        yield name, *cells, newton


def newton_work():
    """Iterations of paths whose steps the solver chooses, rejected steps included, P4 at 8 elements."""
    rod, scene = column()
    for far in (1.5, 4.0, 9.0):
        path = cf.solve(scene, (0.0, far), elements=8, model="spatial")
        yield f"eccentric cantilever, eta = 0 to {far:g}", len(path), path.iterations.sum()


def main(quick=False, out="out"):
    """Write and print the tables; returns the text."""
    meshes = (4, 8) if quick else (4, 8, 16, 32)
    of_meshes, of_slender = (" | ".join(f"{words}{n} elements" for words, n in pairs) for pairs in (
        [("", n) for n in meshes], [(f"P{p}, ", n) for p, n in SLENDER]))  # fmt: skip
    lines = [
        f"{compat.version()}, {platform.machine()}.",
        "",
        "Relative error of delta at eta = 0.9, 1.5 against the exact rod:",
        "",
        *table(f"formulation | degree | {of_meshes} | observed order | Newton iterations", orders(meshes)),
        "",
        "Slenderness:",
        "",
        *table(f"L/d | {of_slender} | Newton iterations",
               slenderness((1e2, np.inf) if quick else (1e2, 1e3, 1e4, 1e5, np.inf))),
        "",
        *table("path, mixed | points | Newton iterations", newton_work()),
    ]  # fmt: skip
    text = write("accuracy", lines, out)
    print(text)
    return text


if __name__ == "__main__":
    command(__doc__, main, {"quick": True})
