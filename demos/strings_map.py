"""The map of stick-slip over speed and weight on bit, by simulations on all ranks, beside the growth of modes.

python demos/strings_map.py                            20 x 20 cases; writes to out/strings/
mpirun -n 2 python demos/strings_map.py                on two ranks
python demos/strings_map.py --quick                    5 x 5 cases, without a picture

Every case starts from rest. Where a mode of the steady rotation grows, the bit must not come to a steady rotation. The
other way round it may stick and slip where no mode grows: small disturbances die out there, large ones do not.
"""

import argparse
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
from known_numbers import Check, report, verdict
from mpi4py import MPI

import cosserat_fenicsx as cf
from cosserat_fenicsx.pictures.charts import draw_both, draw_chart, empty_figure, legend

FOUND = cf.read(Path(__file__).parent / "strings" / "stability_map.toml")
#: A bit whose speed has this severity at the end does not rotate steadily; modes that grow faster than this (1/s) have
#: grown out of rounding by then.
OSCILLATES, FAST = 0.05, 0.05
RPM = 30 / np.pi


def drilled(speed, weight):
    """Severity, period and share of time at rest of the bit in the last quarter, from rest at a speed (rad/s) and a
    weight on bit (N)."""
    history = cf.drilling.simulate(FOUND.scene.with_case(speed, weight), FOUND.settings["duration"])
    cycle = history.stick_slip(since=0.75 * FOUND.settings["duration"])
    return {"severity": cycle.severity, "period": cycle.period, "stuck": cycle.stuck}


def picture(severity, growth, speeds, weights):
    """Draw the severity of stick-slip, and the limits of the modes that grow."""
    figure = empty_figure(8.5, 5.5)
    panel = figure.subplots()
    x, y = np.multiply(speeds, RPM), np.divide(weights, 1e3)
    drawn = panel.pcolormesh(x, y, severity.T, shading="nearest", cmap="viridis", vmin=0.0)
    figure.colorbar(drawn, ax=panel, label="severity: half the range of the bit's speed over the drive's (1)")
    for k in np.flatnonzero((growth > 0).any(axis=(0, 1))):
        values = np.nan_to_num(growth[:, :, k], nan=-1.0).T
        if (values < 0).any():
            panel.contour(x, y, values, levels=[0.0], colors="white", linewidths=1.2)
    panel.plot([], [], color="white", label="left of each line one more mode grows (linear theory)")
    legend(panel, facecolor="0.4", labelcolor="white", frameon=True)
    panel.set(xlabel="speed (rpm)", ylabel="weight on bit (kN)")
    figure.suptitle(f"Stick-slip after {FOUND.settings['duration']:g} s from rest, {severity.size} simulations")
    panel.grid(visible=False)
    return figure


def main(quick=False, out="out/strings"):
    """Compute the map.

    Args:
        quick: every fifth speed and weight alone, without a picture.

    Returns:
        [Check].
    """
    speeds, weights = (values[2::4] if quick else values for values in (FOUND.speeds, FOUND.weights))
    began = time.perf_counter()
    study = cf.study(drilled, {"speed": list(speeds), "weight": list(weights)})
    took = time.perf_counter() - began
    severity, stuck = (np.reshape([result[name] for result in study.results], (len(speeds), len(weights)))
                       for name in ("severity", "stuck"))  # fmt: skip
    growth = cf.drilling.stability(FOUND.scene, speeds, weights).growth
    grows, moves = np.nanmax(growth, axis=2) > FAST, severity > OSCILLATES
    checks = [
        Check(
            "cases where a mode grows and the bit rotates steadily", int((grows & ~moves).sum()), 0, 0, "linear theory"
        ),
        Check(
            "cases where a mode grows and the bit never rests", int((grows & (stuck == 0)).sum()), 0, 0, "stiff drive"
        ),
    ]
    if MPI.COMM_WORLD.rank == 0:
        rows = [("stability_map", "torsion", check) for check in checks]
        print(report(f"{severity.size} simulations and the linear theory", rows))
        print(f"{severity.size} simulations of {FOUND.settings['duration']:g} s on {MPI.COMM_WORLD.size} rank(s): "
              f"{took:.1f} s; the bit oscillates in {moves.sum()}, a mode grows in {grows.sum()}")  # fmt: skip
        if not quick:
            draw_both(partial(draw_chart, lambda: picture(severity, growth, speeds, weights)),
                      Path(out) / "stability_map.png")  # fmt: skip
    return checks


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="5 x 5 cases, without a picture")
    sys.exit(verdict(main(parser.parse_args().quick)))
