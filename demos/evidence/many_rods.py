"""Processor time and memory of frames of many welded rods, built and solved from nothing with an error estimate.

    python demos/evidence/many_rods.py             63 to 10 080 rods, two minutes; writes out/many_rods.md
    python demos/evidence/many_rods.py --quick     63 and 240 rods

Lattices of storeys on a square grid of columns, under weight and wind at the top; two load factors, tol = 1e-6. Each
size runs in a process of its own. The time of the equations of the points, which most of it goes to, depends on the
BLAS that PETSc finds: the table names it.
"""

import re
import resource
import sys
from pathlib import Path

import numpy as np
from harness import HEADS, apart, command, in_words, judged, table, timed, write

import cosserat_fenicsx as cf

#: (columns along a side, storeys): 63 to 10 080 rods.
SIZES = ((3, 3), (4, 6), (5, 9), (9, 12), (11, 14), (14, 18))
EXPONENT, EACH = 1.1, 2.5  # asked at most: of the cost over the number of rods; ms a rod at 1000 rods
ALL, MEMORY = 15.0, 1500.0  # of 10 000 rods, s and MB


def lattice(columns, storeys):
    """The `Frame` of a building with a number of columns along each side, clamped at its feet."""
    number = np.arange(columns**2 * (storeys + 1)).reshape(storeys + 1, columns, columns)
    points = 3.0 * np.argwhere(number >= 0)[:, ::-1]
    pairs = [(number[:-1], number[1:]), (number[1:, :-1], number[1:, 1:]), (number[1:, :, :-1], number[1:, :, 1:])]
    edges = np.concatenate([np.column_stack([a.ravel(), b.ravel()]) for a, b in pairs])
    steel = cf.Material(E=210e9, nu=0.3, density=7850.0)
    return cf.frame(points, edges, cf.Tube(0.1, 0.08), steel, clamped=number[0].ravel())


def measure(size):
    """Of the size with this index: rods, s to build them, s of the first and of a second solution, error, MB."""
    frame, build = timed(lambda: lattice(*SIZES[size]))
    top = np.flatnonzero(frame.points[:, 2] == frame.points[:, 2].max()).tolist()
    scene, made = timed(lambda: frame.scene([cf.Force(frame.at(k), (2e3, 1e3, -2e4)) for k in top]))
    path, first = timed(lambda: cf.solve(scene, [0.5, 1.0], progress=False))
    _, second = timed(lambda: cf.solve(scene, [0.5, 1.0], progress=False))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return [len(frame), build + made, first, second, float(path.error.max()), memory]


def blas():
    """The file of the BLAS that this process has loaded."""
    loaded = re.findall(r"\S*/(lib(?:open)?blas\S*\.so\S*)", Path("/proc/self/maps").read_text(encoding="utf-8"))
    return ", ".join(sorted(set(loaded))) or "unknown"


def main(sizes=range(len(SIZES)), out="out"):
    """Print the table, write it to out/many_rods.md; returns its rows as an array."""
    rows = []
    for size in sizes:
        rows.append(apart(__file__, size))
        print(f"{rows[-1][0]:6.0f} rods: {rows[-1][2]:.2f} s", file=sys.stderr, flush=True)
    rows = np.array(rows)
    each = 1e3 * rows[:, 1:3].sum(axis=1) / rows[:, 0]
    heads = (
        "rods | building (s) | first solution (s) | a second one (s) | ms a rod in all | estimated error | memory (MB)"
    )
    lines = [f"{in_words()}; BLAS: {blas()}. Processor time, one process.", ""]
    cells = [(f"{n:.0f}", f"{b:.2f}", f"{a:.2f}", f"{c:.2f}", f"{ms:.2f}", f"{error:.1e}", f"{mb:.0f}")
             for (n, b, a, c, error, mb), ms in zip(rows, each, strict=True)]  # fmt: skip
    lines += [*table(heads, cells), ""]
    large = rows[:, 0] >= 240
    slope = np.polyfit(np.log(rows[large, 0]), np.log(rows[large, 1:3].sum(axis=1)), 1)[0] if large.sum() > 1 else None
    at_1000 = float(np.interp(1000.0, rows[:, 0], each)) if rows[-1, 0] >= 1000 else None
    most = rows[-1, [1, 2, 5]] if rows[-1, 0] >= 1e4 else [None] * 3
    asked = [("exponent of the time over the rods, from 240 on", judged(slope, EXPONENT, ".3f")),
             ("ms a rod, of 1000 rods", judged(at_1000, EACH, ".2f")),
             ("s, of 10 000 rods", judged(None if most[0] is None else most[0] + most[1], ALL, ".1f")),
             ("MB, of 10 000 rods", judged(most[2], MEMORY, ".0f"))]  # fmt: skip
    print(write("many_rods", [*lines, *table(f"asked | found | {HEADS}", asked)], out))
    return rows


if __name__ == "__main__":
    command(__doc__, main, {"sizes": (0, 1)}, one=measure)
