"""The chart of Figure 3: the whole path, the part below eta = 1, and the differences of the models."""

import numpy as np
from harness import drawn

from comparison.column import Column
from comparison.curves import MANY, exact
from cosserat_fenicsx import analytic
from cosserat_fenicsx.pictures.charts import SMALL, empty_figure, room_for

_GREEN = {"1": "#98d594", "2": "#4daf4a", str(MANY): "#1b7837"}
# Width, inches, for panels beside each other.
_BESIDE = 7.0
_ETA = r"load factor $\eta = F/P_{cr}$ (-)"


def draw(data, file):
    """Draw the curves of figure3.json into `file`."""
    drawn(lambda: _figure(data["curves"]), file)


def _figure(curves):
    wide = room_for(13) > _BESIDE
    figure = empty_figure(13, 7.0 if wide else 13.5)
    panels = figure.subplot_mosaic(
        [["whole", "near"], ["whole", "apart"]] if wide else [["whole"], ["near"], ["apart"]]
    )
    whole, near, apart = panels["whole"], panels["near"], panels["apart"]
    for axes in (whole, near):
        _curves(axes, curves)
        axes.set(xlabel=_ETA, ylabel=r"transverse displacement of the tip $\delta$ (m)")
    whole.set(xlim=(0, 2), ylim=(0, 18), title="The whole path, to twice the critical load")
    near.set(xlim=(0, 1), ylim=(0, 2.5), title="Below the critical load, where the models part")
    _differences(apart, curves)
    for axes in panels.values():
        axes.axvline(1.0, color="tab:red", lw=0.8, alpha=0.5)
    whole.text(0.94, 17.1, "pole of eq. (8)", ha="right", color="tab:red", fontsize=SMALL)
    whole.plot([0, 1, 1], [2.5, 2.5, 0], color="grey", lw=0.8)
    enlarged = f"enlarged {'on the right' if wide else 'below'}"
    whole.text(0.03, 2.7, enlarged, color="grey", fontsize=SMALL)
    _limit_points(near, curves["mcre"]["elements"])
    figure.suptitle(
        "Eccentrically compressed column: steel, 20 m, diameter 0.2 m, eccentricity e = L/100, clamped below, free"
        " above"
    )
    shown = zip(whole.get_legend_handles_labels(), apart.get_legend_handles_labels(), strict=True)
    handles, names = (first + second for first, second in shown)
    figure.legend(handles, names, loc="outside lower center", ncols=2 if wide else 1, frameon=False)
    return figure


def _curves(axes, curves):
    """delta of every model."""
    below = np.linspace(0, 0.9999, 2000)
    beam, eq_8 = curves["corotational"], analytic.secant_delta(below, Column().eccentricity)
    axes.plot(*_from_zero(curves["mixed"]), color="tab:blue", lw=2, label="Cosserat rod, mixed: constant moment F e")
    axes.plot(curves["displacement"]["eta"][::2], curves["displacement"]["delta"][::2], "o", mfc="none", mec="tab:blue",
              ms=8,
              label="Cosserat rod, eq. (1), displacement: constant moment")  # fmt: skip
    axes.plot(
        beam["eta"],
        beam["delta"],
        "kx",
        ms=6,
        label=f"co-rotational beam, {beam['elements']} elements: constant moment",
    )
    axes.plot(*_from_zero(curves["arm"]), color="tab:orange", lw=2, label="Cosserat rod, mixed: force on a turning arm")
    axes.plot(curves["solid"]["eta"], curves["solid"]["delta"], "s", mfc="none", mec="tab:orange", ms=6,
              label="3D elasticity: eccentric dead traction, a turning arm")  # fmt: skip
    axes.plot(below, eq_8, color="tab:red", ls="--", label="secant formula, eq. (8), up to its pole")
    for name, colour in _GREEN.items():
        top, eta, delta, turn = _branch(curves, name)
        words = f"MCRE, a reconstruction: {_elements(name)}; star: limit point"
        axes.plot(eta[: turn + 1], delta[: turn + 1], color=colour, lw=2, label=words)
        axes.plot(eta[turn:], delta[turn:], color=colour, lw=1.2, ls=":")
        axes.plot(top["eta"], top["delta"], "*", color=colour, mec="black", ms=12, zorder=5)


def _differences(axes, curves):
    """Difference of every model from the exact rod under the same load, in percent."""
    below, beam = np.linspace(0.02, 0.999, 400), curves["corotational"]
    solid, finer, clamped = curves["solid"], curves["solid"]["finer"], curves["solid_clamped"]
    open_square = {"mfc": "none", "mec": "tab:orange"}
    for eta, delta, arm, mark, look in (
        (below, analytic.secant_delta(below, Column().eccentricity), False, "--", {"color": "tab:red"}),
        (beam["eta"], beam["delta"], False, "kx", {}),
        (solid["eta"], solid["delta"], True, "s",
         {**open_square, "label": f"3D elasticity, {solid['along']} elements along (the curve)"}),
        (finer["eta"], finer["delta"], True, "s",
         {"color": "tab:orange", "label": f"3D elasticity, {finer['along']} elements along: less of the mesh's error"}),
        (clamped["eta"], clamped["delta"], True, "D",
         {"color": "tab:orange", "label": "3D elasticity with the foot's face fixed altogether"}),
    ):  # fmt: skip
        axes.semilogy(eta, _percent(delta, exact(eta, arm=arm)), mark, ms=6, **look)
    for name, colour in _GREEN.items():
        _, eta, delta, turn = _branch(curves, name)
        axes.semilogy(eta[1 : turn + 1], _percent(delta[1 : turn + 1], exact(eta[1 : turn + 1])), color=colour, lw=2)
    rods = 100 * max(curves[name]["error"] for name in ("mixed", "displacement", "arm"))
    axes.set(xlim=(0, 2), ylim=(3e-5, 100), xlabel=_ETA, ylabel=r"|difference| of $\delta$ (%)")
    axes.set_title(
        f"Difference from the exact rod under the same load\n(the Cosserat rod here: {rods:.0e} %, below the chart)"
    )


def _branch(curves, name):
    """(limit point, eta, delta, index of the limit point in them) of the MCRE's branch."""
    found = curves["mcre"]["elements"][name]
    top, turn = found["limit_point"], found["negative_modes"].index(1)
    return top, np.insert(found["eta"], turn, top["eta"]), np.insert(found["delta"], turn, top["delta"]), turn


def _percent(delta, truth):
    return 100 * np.abs(np.asarray(delta) / truth - 1)


def _from_zero(curve):
    return [0.0, *curve["eta"]], [0.0, *curve["delta"]]


def _elements(name):
    return "1 element" if name == "1" else f"{name} elements"


def _limit_points(axes, found):
    """Label the limit points (stars) with numbers."""
    for name, place in (("1", (0.03, 0.72)), ("2", (0.17, 1.15)), (str(MANY), (0.33, 1.6))):
        top = found[name]["limit_point"]
        words = f"limit point, {_elements(name)}:\n" rf"$\eta$ = {top['eta']:.3f}, $\delta$ = {top['delta']:.2f} m"
        axes.annotate(
            words, (top["eta"], top["delta"]), place, fontsize=SMALL, arrowprops={"arrowstyle": "->", "lw": 0.8}
        )
