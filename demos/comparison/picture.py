"""The chart of Figure 3: the whole path, and the part below eta = 1 where the models part."""

from pathlib import Path

import numpy as np
from comparison.column import Column
from comparison.curves import MANY

from cosserat_fenicsx import analytic

_GREEN = ("#98d594", "#4daf4a", "#1b7837")


def draw(data, file):
    """Draw the curves of figure3.json into `file`."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 7), layout="constrained")
    whole, near = figure.subplots(1, 2, width_ratios=(1, 1))
    for axes in (whole, near):
        _curves(axes, data["curves"])
        axes.set(xlabel=r"load factor $\eta = F/P_{cr}$ (-)", ylabel=r"transverse displacement of the tip $\delta$ (m)")
        axes.grid(alpha=0.3)
        axes.axvline(1.0, color="tab:red", lw=0.8, alpha=0.5)
    whole.set(xlim=(0, 2), ylim=(0, 18), title="The whole path, to twice the critical load")
    near.set(xlim=(0, 1.02), ylim=(0, 3), title="Below the critical load, where the models part")
    whole.annotate("pole of eq. (8)", (1.0, 17), (0.985, 17.1), ha="right", color="tab:red", fontsize=9)
    _limit_points(near, data["curves"]["mcre"]["elements"])
    _box(whole)
    figure.suptitle("Eccentrically compressed column: steel, 20 m, diameter 0.2 m, eccentricity e = L/100, clamped below, free above")
    figure.legend(*whole.get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    Path(file).parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)


def _curves(axes, curves):
    below = np.linspace(0, 0.9999, 2000)
    eq_8 = analytic.secant_delta(below, Column().eccentricity)
    axes.plot(*_from_zero(curves["mixed"]), color="tab:blue", lw=2, label="Cosserat rod, mixed; constant moment F e")
    axes.plot(curves["displacement"]["eta"][::2], curves["displacement"]["delta"][::2], "o", mfc="none", mec="tab:blue", ms=8,
              label="Cosserat rod, displacement, eq. (1); constant moment")  # fmt: skip
    axes.plot(curves["corotational"]["eta"], curves["corotational"]["delta"], "x", color="black", ms=6,
              label=f"co-rotational Timoshenko beam, {curves['corotational']['elements']} elements; constant moment")  # fmt: skip
    axes.plot(*_from_zero(curves["arm"]), color="tab:orange", lw=2, label="Cosserat rod, mixed; force on a turning arm")
    axes.plot(curves["solid"]["eta"], curves["solid"]["delta"], "s", mfc="none", mec="tab:orange", ms=6,
              label="3D elasticity; eccentric dead traction (turning arm)")  # fmt: skip
    axes.plot(below, eq_8, color="tab:red", ls="--", label="secant formula, eq. (8), up to its pole")
    for colour, name in zip(_GREEN, ("1", "2", str(MANY)), strict=True):
        branch = curves["mcre"]["elements"][name]
        stable = np.array(branch["negative_modes"]) == 0
        turn = int(stable.sum())
        top = branch["limit_point"]
        words = f"MCRE, a reconstruction, {name} element{'s' if name != '1' else ''}; limit point"
        axes.plot([*branch["eta"][:turn], top["eta"]], [*branch["delta"][:turn], top["delta"]], color=colour, lw=2, label=words)
        axes.plot([top["eta"], *branch["eta"][turn:]], [top["delta"], *branch["delta"][turn:]], color=colour, lw=1.2, ls=":")
        axes.plot(top["eta"], top["delta"], "*", color=colour, mec="black", ms=12, zorder=5)


def _from_zero(curve):
    return [0.0, *curve["eta"]], [0.0, *curve["delta"]]


def _limit_points(axes, found):
    """Numbers at the stars."""
    for name, place in (("1", (0.02, 0.62)), ("2", (0.16, 0.95)), (str(MANY), (0.32, 1.35))):
        top = found[name]["limit_point"]
        words = f"limit point, {name} element{'s' if name != '1' else ''}:\n" rf"$\eta$ = {top['eta']:.3f}, $\delta$ = {top['delta']:.2f} m"
        axes.annotate(words, (top["eta"], top["delta"]), place, fontsize=9, arrowprops={"arrowstyle": "->", "lw": 0.8})


def _box(axes):
    """Where the other panel looks."""
    axes.plot([0, 1.02, 1.02], [3, 3, 0], color="grey", lw=0.8)
    axes.annotate("enlarged on the right", (0.03, 3.2), color="grey", fontsize=9)
