"""The animation at the top of the README: the paper's column far past its limit load, eq. (8) beside it.

    python demos/animation.py                 # writes docs/pictures/column.gif (make animation)
    python demos/animation.py --quick out/    # few frames, into another folder

Every frame is an equilibrium from one call of `solve`, true to scale, coloured by bending moment. The chart has the
displacement of the tip, with the estimated relative error of each point, and the secant formula that is commonly used.
"""

import argparse
from pathlib import Path

import numpy as np
from eccentric_cantilever import DIAMETER, ECCENTRICITY, L, column

import cosserat_fenicsx as cf
from cosserat_fenicsx import analytic

#: The largest load factor; frames that show the path, and that wait at its end; frames per second; pixels an inch.
FAR, FRAMES, HOLD, FPS, DPI = 5.0, 72, 18, 18, 88
#: The most that the file may take (bytes).
MOST = 3e6


def even_load_factors(scene, rod, frames):
    """Load factors (frames,) from 0 to `FAR` between which what moves in shape and chart moves by equal distances."""
    path = cf.solve(scene, (0.0, FAR), tol=1e-4)
    steps = np.diff(np.column_stack([path.position(rod.end) / L, path.load_factors / 2]), axis=0)
    covered = np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=1))])
    return np.interp(np.linspace(0.0, covered[-1], frames), covered, path.load_factors)


def main(folder="docs/pictures", quick=False):
    """Write the animation; returns the path that it shows."""
    from matplotlib.animation import FuncAnimation, PillowWriter
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    rod, scene = column()
    frames = 8 if quick else FRAMES
    path = cf.solve(scene, even_load_factors(scene, rod, frames), tol=1e-6)
    eta, tip = path.load_factors, path.position(rod.end)
    delta = path.displacement(rod.end)[:, 0]
    states = [path.fields(k, rod) for k in range(len(path))]
    most = max(state["bending_moment"].max() for state in states) / 1e3  # kN m

    figure = Figure(figsize=(8.6, 4.6), dpi=DPI, layout="constrained")
    shape, chart = figure.subplots(1, 2, width_ratios=(1.0, 1.15))
    shape.set(aspect="equal", xlim=(-3.0, 0.9 * L), ylim=(-11.5, 1.12 * L), xlabel="x (m)", ylabel="z (m)")
    shape.plot([-1.5, 1.5], [0.0, 0.0], color="black", linewidth=3.0)
    shape.plot(tip[:, 0], tip[:, 2], color="0.8", linewidth=1.0, zorder=0)
    body = LineCollection([], cmap="viridis", linewidths=5.0, capstyle="round")
    body.set_clim(0.0, most)
    shape.add_collection(body)
    figure.colorbar(body, ax=shape, label="bending moment (kN m)", shrink=0.8)
    force = shape.annotate("", (0.0, 0.0), (0.0, 0.0), arrowprops={"arrowstyle": "-|>", "color": "tab:red", "lw": 1.8})

    below = np.linspace(0.0, 0.985, 300)
    secant = analytic.secant_delta(below, ECCENTRICITY)
    chart.plot(below, secant, color="0.5", linestyle="--", label="secant formula, eq. (8)")
    chart.plot(eta, delta, color="0.85", linewidth=1.0, zorder=0)
    (line,) = chart.plot([], [], color="tab:blue", linewidth=2.0, label="exact rod")
    (point,) = chart.plot([], [], "o", color="tab:red", markersize=7)
    chart.set(xlim=(0.0, FAR), ylim=(0.0, 1.12 * delta.max()))
    chart.set(xlabel="load factor, force over Euler's load", ylabel="displacement of the tip (m)")
    chart.legend(loc="lower right", frameon=False)
    says = figure.suptitle("load factor", fontsize=12)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # panels keep their places in all frames

    def draw(frame):
        k = min(frame, len(path) - 1)
        r = states[k]["position"][:, [0, 2]]
        moment = states[k]["bending_moment"] / 1e3
        body.set_segments(np.stack([r[:-1], r[1:]], axis=1))
        body.set_array((moment[:-1] + moment[1:]) / 2)
        force.xy, force.xyann = tip[k, [0, 2]], (tip[k, 0], tip[k, 2] + 0.7 * eta[k] + 0.3)
        line.set_data(eta[: k + 1], delta[: k + 1])
        point.set_data([eta[k]], [delta[k]])
        moved = f"load factor {eta[k]:.2f}: the tip moves {delta[k]:.5f} m sideways"
        says.set_text(f"{moved}, relative error about {path.error[k]:.0e}")

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "column.gif"
    FuncAnimation(figure, draw, frames + (0 if quick else HOLD)).save(file, PillowWriter(fps=FPS))
    size = file.stat().st_size
    if size > MOST:
        raise SystemExit(f"{file} takes {size / 1e6:.1f} MB, and {MOST / 1e6:g} MB are allowed")
    print(f"{file}: {len(path)} equilibria of a column of {L:g} m and {DIAMETER:g} m, {size / 1e6:.2f} MB")
    return path


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", default="docs/pictures", help="where to write column.gif")
    parser.add_argument("--quick", action="store_true", help="eight frames")
    main(**vars(parser.parse_args()))
