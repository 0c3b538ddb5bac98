"""The map of whirl over speed and friction, from a rolling start, by simulations on all ranks, beside the theory.

python demos/whirl_map.py                         6 x 6 cases; writes out/whirl/map.png
mpirun -n 2 python demos/whirl_map.py             on two ranks
python demos/whirl_map.py --quick                 1 x 2 cases, without a picture

Every case starts as a collar that rolls backward round its hole, held by a ring in its middle. Where friction is below
what steady rolling takes, it slips, slows down and leaves the wall; with time its unbalance alone is left, forward.
"""

import argparse
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
from known_numbers import Check, report, verdict
from mpi4py import MPI
from whirling_collar import LENGTH, MESH, least_friction, rolling

import cosserat_fenicsx as cf
from cosserat_fenicsx.pictures.charts import draw_both, draw_chart, empty_figure, legend

SPEEDS = [rpm * cf.units.rpm for rpm in (40, 60, 80, 100, 120, 150)]
FRICTIONS = [0.02, 0.03, 0.045, 0.07, 0.12, 0.3]
#: Durations, s; a ratio within the share ROLLS of that without slip is rolling; within the share NEAR of the least
#: friction nothing is said: the theory knows no unbalance, and near the limit rolling dies out slowly.
DURATION, AT_END, ROLLS, NEAR = 2.5, 0.5, 0.02, 0.3


def whirled(speed, friction, duration):
    """Ratio of whirl to spin, that of rolling at the same radius, and share of time in contact, at the end of a motion
    that starts rolling at a speed (rad/s) and takes a duration (s)."""
    collar, _, scene, start = rolling(speed, friction, duration)
    history = cf.simulate(scene, duration, dt=1e-3, save_every=5e-3, start=start, **MESH)
    found = history.whirl(collar.at(LENGTH / 2), since=duration - AT_END)
    rolls = found.contact > 0.5 and abs(found.ratio / found.rolling - 1) < ROLLS
    return {"ratio": found.ratio, "contact": found.contact, "rolls": float(rolls)}


def main(quick=False, out="out/whirl"):
    """Compute the map.

    Args:
        quick: one speed and two friction coefficients, 1.5 s of each, without a picture.

    Returns:
        [Check].
    """
    speeds, frictions, duration = (SPEEDS[1:2], [0.02, 0.3], 1.5) if quick else (SPEEDS, FRICTIONS, DURATION)
    began = time.perf_counter()
    study = cf.study(whirled, {"speed": speeds, "friction": frictions, "duration": [duration]})
    took = time.perf_counter() - began
    ratio, rolls = (np.reshape([result[name] for result in study.results], (len(speeds), len(frictions)))
                    for name in ("ratio", "rolls"))  # fmt: skip
    excess = np.array(frictions) / np.array([[least_friction(speed)] for speed in speeds])
    checks = [
        Check("cases that roll without the friction for it", int((rolls[excess < 1 - NEAR] > 0).sum()), 0, 0, "beam"),
        Check("cases with friction enough that do not roll", int((rolls[excess > 1 + NEAR] == 0).sum()), 0, 0, "beam"),
    ]
    if MPI.COMM_WORLD.rank == 0:
        print(report(f"{ratio.size} simulations and the theory", [("map", "spatial", check) for check in checks]))
        print(f"{ratio.size} simulations of {duration:g} s on {MPI.COMM_WORLD.size} rank(s): {took:.1f} s; rolling "
              f"backward in {int(rolls.sum())}, forward already in {int((ratio > 0).sum())}")  # fmt: skip
        if not quick:
            draw_both(partial(draw_chart, lambda: picture(ratio, rolls > 0, speeds, frictions)), Path(out) / "map.png")
    return checks


def picture(ratio, rolls, speeds, frictions):
    """Draw the ratio of whirl to spin over speed and friction, and the friction that rolling takes."""
    figure = empty_figure(8.5, 5.5)
    panel = figure.subplots()
    x, y = np.divide(speeds, cf.units.rpm), np.arange(len(frictions))
    drawn = panel.pcolormesh(np.arange(len(x)), y, ratio.T, shading="nearest", cmap="RdBu", vmin=-4.0, vmax=4.0)
    figure.colorbar(drawn, ax=panel, label="rate of whirl over spin at the end (1), backward negative")
    i, j = np.nonzero(rolls)
    panel.plot(i, j, "ko", label="rolls backward without slip")
    fine = np.linspace(0, len(x) - 1, 201)
    least = [least_friction(speed) for speed in np.interp(fine, np.arange(len(x)), speeds)]
    place = np.interp(np.log(least), np.log(frictions), y, left=np.nan, right=np.nan)
    panel.plot(fine, place, color="black", lw=1.4, label="least friction of rolling, without unbalance")
    panel.set_xticks(np.arange(len(x)), [f"{value:.0f}" for value in x])
    panel.set_yticks(y, [f"{value:g}" for value in frictions])
    panel.set(xlabel="speed of the drive (rpm)", ylabel="friction coefficient (1)")
    panel.set_ylim(y[0] - 0.5, y[-1] + 0.5)
    legend(panel)
    panel.grid(visible=False)
    return figure


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="1 x 2 cases, without a picture")
    sys.exit(verdict(main(parser.parse_args().quick)))
