"""Charts of the strength of a string, and of the fluids around it and in it, over the measured depth, which runs
downwards, by matplotlib."""

import numpy as np

from cosserat_fenicsx.pictures.charts import COLOURS, GREY, legend, scale, unit_of
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.well.charts import DEPTH, depths_between, over_depth, rows_between, string_in_hole, title_of

_SHARE = Quantity("share of the limit", unit="1")
_TENSION = Quantity("effective tension", unit="N", shown="kN")
_DOGLEG = Quantity("dogleg", unit="rad/m", shown="deg/30m")
_PRESSURE = Quantity("pressure", unit="Pa", shown="MPa")
_DENSITY = Quantity("density", unit="kg/m^3")
_BENDING = Quantity("bending stress", unit="Pa", shown="MPa")
# The shares that are drawn, with their names; the first in black.
_SHARES = {"von_mises": "von Mises", "tension": "tension", "torsion": "torsion", "collapse": "collapse",
           "burst": "burst"}  # fmt: skip
# Doglegs are shown up to this many times the hole's largest.
_FAR = 3.0


def utilisation_figure(use, between=None):
    """The string in its hole, shares of limits, tension, bending stress and doglegs; see `Utilisation.plot`."""
    answer = use.answer
    top, bottom = depths_between("plot", between, answer.depth)
    rotating = np.isfinite(use.allowed_dogleg).any()
    draws = [_shares, _tension, _bending, *([_doglegs] if rotating else [])]
    figure, panels, _, length = over_depth([2.0, 2.9, 2.4, 2.4, 2.4][: 1 + len(draws)], DEPTH)
    rows, room = rows_between(use.md, top, bottom), 0.01 * (bottom - top)
    depth = use.md[rows] / length
    panels[0].set_ylim((bottom + room) / length, (top - room) / length)
    string_in_hole(panels[0], answer, rows, depth)
    for panel, drawn in zip(panels[1:], draws, strict=True):
        drawn(panel, use, rows, depth)
    legend(*panels)
    unit, size = unit_of(DEPTH)
    told = f"largest utilisation {use.largest:.3g} (von Mises), at {use.worst_at / size:.5g} {unit}"
    figure.suptitle(f"Strength: {title_of(answer, top, bottom)}\n{told}")
    return figure


def _shares(panel, use, rows, depth):
    for i, (name, label) in enumerate(_SHARES.items()):
        values = getattr(use, name)[rows]
        if np.nanmax(values, initial=0.0) > 1e-3:
            look = {"color": "black", "linewidth": 2.0} if i == 0 else {"color": COLOURS[i - 1]}
            panel.plot(values, depth, label=label, **look)
    most = max(1.15, 1.1 * min(np.nanmax(use.von_mises[rows], initial=0.0), 3.0))
    panel.axvspan(1.0, most, color="tab:red", alpha=0.15, linewidth=0, label="beyond the limit")
    panel.set_xlim(0.0, most)
    panel.set_xlabel(_SHARE.heading())


def _tension(panel, use, rows, depth):
    heading, size = scale(_TENSION)
    tension, torque = use.answer.tension[rows], use.answer.torque
    limit = use._of(lambda strength, here: strength.tension_at(torque[here]))[rows]
    panel.plot(tension / size, depth, color="black", label="effective tension")
    panel.plot(limit / size, depth, color="tab:red", label="at yield, with the torque")
    panel.axvline(0.0, color="black", linewidth=0.6)
    panel.set_xlim(right=1.15 * max(np.nanmin(limit), tension.max()) / size)
    panel.set_xlabel(heading)


def _bending(panel, use, rows, depth):
    heading, size = scale(_BENDING)
    fatigue = use._of(lambda strength, here: strength.fatigue_stress(use.answer.tension[here]))[rows]
    panel.plot(use.bending_stress[rows] / size, depth, color="black", label="bending stress")
    if np.isfinite(fatigue).any():
        panel.plot(fatigue / size, depth, color="tab:orange", label="fatigue limit of drill pipe that rotates")
    panel.set_xlim(left=0.0)
    panel.set_xlabel(heading)


def _doglegs(panel, use, rows, depth):
    heading, size = scale(_DOGLEG)
    hole, allowed = use.dogleg_severity[rows] / size, use.allowed_dogleg[rows] / size
    panel.plot(hole, depth, color=GREY, linewidth=1.5, label="dogleg of the hole")
    panel.plot(allowed, depth, color="tab:orange", linestyle="--", label="allowed dogleg (fatigue)")
    most = max(np.nanmax(hole, initial=0.0), np.nanmin(allowed) if np.isfinite(allowed).any() else 0.0)
    panel.set_xlim(0.0, _FAR * most if most > 0 else None)
    panel.set_xlabel(heading)


def pressures_figure(answer, between=None):
    """Fluids, pressures and tensions along a string; see `TorqueAndDrag.plot_pressures`."""
    top, bottom = depths_between("plot_pressures", between, answer.depth)
    figure, panels, _, length = over_depth([2.4, 2.7, 2.7], DEPTH)
    rows, room = rows_between(answer.md, top, bottom), 0.01 * (bottom - top)
    panels[0].set_ylim((bottom + room) / length, (top - room) / length)
    ends = np.array([top, *(x for x in answer.mud.interfaces if top < x < bottom), bottom])
    densities = answer.mud.densities((ends[1:] + ends[:-1]) / 2)
    _fluids(panels[0], ends / length, densities)
    for panel, quantity, lines in (
        (panels[1], _PRESSURE, {"in the string": answer.pressure_inside, "around it": answer.pressure_outside}),
        (panels[2], _TENSION, {"effective tension": answer.tension, "true tension": answer.true_tension}),
    ):
        heading, size = scale(quantity)
        # the second one is dashed, so that both are seen where they are equal
        styles = {"color": "black"}, {"color": "tab:blue", "linestyle": (0, (4, 4)), "linewidth": 2.2}
        for (name, values), style in zip(lines.items(), styles, strict=True):
            panel.plot(values[rows] / size, answer.md[rows] / length, label=name, **style)
        for end in ends[1:-1] / length:
            panel.axhline(end, color=GREY, linewidth=0.6, linestyle=(0, (6, 3)))
        panel.set_xlabel(heading.replace("effective tension", "tension"))
    panels[2].axvline(0.0, color="black", linewidth=0.6)
    legend(*panels)
    figure.suptitle(f"Fluids: {title_of(answer, top, bottom)}")
    return figure


def _fluids(panel, ends, densities):
    """Columns of fluid: around the string at both sides of those in it, darker the heavier, with their densities."""
    unit, size = unit_of(_DENSITY)
    low, high = densities.min(), densities.max()
    for (left, right), column in (((0, 1), densities[0]), ((1, 2), densities[1])):
        starts = np.flatnonzero(np.diff(column, prepend=np.nan) != 0)
        for i, j in zip(starts, [*starts[1:], len(column)], strict=True):
            shade = 0.15 + 0.5 * (column[i] - low) / (high - low or 1.0)
            panel.fill_between([left, right], ends[i], ends[j], color=COLOURS[0], alpha=shade, linewidth=0)
            panel.text((left + right) / 2, (ends[i] + ends[j]) / 2, f"{column[i] / size:.4g}", ha="center", va="center")
    panel.axvline(1.0, color="black", linewidth=2.0)
    panel.set_xlim(0, 2)
    panel.set_xticks([0.5, 1.5], ["around", "inside"])
    panel.set_xlabel(f"density of the fluid ({unit})")
    panel.grid(visible=False)
