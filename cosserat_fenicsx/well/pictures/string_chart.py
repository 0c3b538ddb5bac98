"""The chart of an answer: what the string carries over the measured depth, which runs downwards, by matplotlib."""

import numpy as np

from cosserat_fenicsx.pictures.axes import round_step
from cosserat_fenicsx.pictures.figures import draw_chart
from cosserat_fenicsx.ranks import world
from cosserat_fenicsx.well import criteria
from cosserat_fenicsx.well.contacts import high_side, stretches
from cosserat_fenicsx.well.pictures.charts import depth_axes
from cosserat_fenicsx.well.pictures.shown import (
    SIDES,
    VERTICAL,
    depths_between,
    points_between,
    rows_between,
    sides_along,
    usual_side_force,
)

# A torque below this part of the largest tension times the contact radius is not drawn.
_LITTLE = 1e-4
# Smallest ranges of the axes: side force (N/m), forces at points and moment (kN, kN m).
_LEAST_SIDE, _LEAST = 1.0, 0.1
# Most forces at points with numbers; distance of labels over the height of a panel.
_LABELS, _LINE = 20, 0.0235
_GREY = "0.45"
# Stretches that are buckled: colours and names.
_BUCKLED = {criteria.SNAKE: ("gold", "sinusoidal buckling"), criteria.HELIX: ("tab:pink", "helical buckling")}
_PARTS = ("0.55", "0.75")


def draw_answer(answer, file, between=None):
    """See `TorqueAndDrag.plot`."""
    ends = depths_between("plot", between, answer.depth)
    return draw_chart(lambda: answer_figure(answer, *ends), file, world())


def answer_figure(answer, top, bottom):
    """The string in the hole; tension with the loads of buckling; torque where there is some; side force per length,
    and at points where there are such forces; bending moment where it is known: from one measured depth (m) to another.
    """
    points = points_between(answer, top, bottom)
    turns = np.abs(answer.torque).max() > _LITTLE * np.abs(answer.tension).max() * answer.pieces.radius.max()
    bends = np.nanmax(answer.bending_moment, initial=0.0) > 0
    draws = [_string, _tension, *([_torque] if turns else []), _side_force]
    draws += [*([_at_points] if points else []), *([_bending] if bends else [])]
    widths = [{_string: 0.8, _at_points: 1.15}.get(drawn, 1.0) for drawn in draws]
    figure, axes = depth_axes(2.7 * sum(widths), width_ratios=widths)
    axes[0].set_ylim(bottom + 0.01 * (bottom - top), top - 0.01 * (bottom - top))
    rows = rows_between(answer.md, top, bottom)
    for panel, drawn in zip(axes, draws, strict=True):
        drawn(panel, answer, rows)
        _stretches(panel, answer)
    _shoes(axes, answer, top, bottom)
    _legend(axes)
    part = "" if (top, bottom) == (0.0, answer.depth) else f", from {top:g} to {bottom:g} m"
    figure.suptitle(
        f"{answer.operation.name}, bit at {answer.depth:g} m, {answer.words}{part}\nhook load "
        f"{answer.hook_load / 1e3:.1f} kN, surface torque {round(answer.surface_torque / 1e3, 2) + 0.0:.2f} kN m"
    )
    return figure


def _shoes(axes, answer, top, bottom):
    """Lines where the sections of the hole end, with their names."""
    for section in answer.hole.sections[:-1]:
        if top < section.to < bottom:
            for panel in axes:
                panel.axhline(section.to, color="tab:brown", linewidth=0.9, linestyle=(0, (6, 3)))
            axes[1].annotate(
                f"{section.name or 'section'} ends, {section.to:g} m", (0.02, section.to), (0, 2), fontsize=7,
                xycoords=axes[1].get_yaxis_transform(), textcoords="offset points", color="tab:brown", va="bottom",
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5}, zorder=4,
            )  # fmt: skip


def _stretches(panel, answer):
    for state, (colour, name) in _BUCKLED.items():
        for a, b in stretches(answer.md, _to_next(answer.buckling == state)):
            panel.axhspan(a, b, color=colour, alpha=0.25, linewidth=0, label=name)


def _to_next(where):
    """True at the place after each stretch too, which the stretch reaches to in a picture."""
    return where | np.append(False, where[:-1])


def _legend(axes):
    """One legend above each panel that has names; those that several panels have, once."""
    told = set()
    for panel in axes:
        handles = dict(zip(*panel.get_legend_handles_labels()[::-1], strict=True))
        new = {name: handle for name, handle in handles.items() if name not in told}
        told |= set(new)
        if new:
            panel.legend(new.values(), new.keys(), fontsize=7, loc="lower center", bbox_to_anchor=(0.5, 1.0),
                         frameon=False, borderaxespad=0.2)  # fmt: skip


def _string(panel, answer, rows):
    """The string in the hole, seen across its plane of high and low side, or across north where it is vertical."""
    md, hole = answer.md[rows], answer.hole.at(answer.md[rows], "diameter") / 2
    high = high_side(answer.hole.path.tangent(md))
    vertical = not high.any()
    across = answer.offset[rows][:, 0] if vertical else (answer.offset[rows] * high).sum(axis=1)
    panel.fill_betweenx(md, -1e3 * hole, 1e3 * hole, color="bisque", linewidth=0)
    panel.plot(-1e3 * hole, md, color="tab:brown", linewidth=1.2)
    panel.plot(1e3 * hole, md, color="tab:brown", linewidth=1.2)
    most, (bottom, top) = 1e3 * float(hole.max()), panel.get_ylim()
    names, middles = [], []
    for k, place in enumerate(answer.laid):
        a, b = max(place.top, top), min(place.bottom, bottom)
        if b <= a:
            continue
        at = np.unique(np.concatenate([[a, b], md[(md > a) & (md < b)]]))
        x, radius = 1e3 * np.interp(at, md, across), 1e3 * place.component.contact_radius
        panel.fill_betweenx(at, x - radius, x + radius, facecolor=_PARTS[k % 2], edgecolor="black", linewidth=0.5)
        names.append(place.component.name)
        middles.append((a + b) / 2)
    panel.set_xlim(-1.1 * most, 4.2 * most)
    for y, middle, name in zip(_apart(middles, panel), middles, names, strict=True):
        panel.plot([0.8 * most, 1.35 * most], [middle, y], color=_GREY, linewidth=0.5)
        panel.text(1.4 * most, y, name, fontsize=7, va="center", clip_on=True)
    panel.set_xticks([-round(most), 0, round(most)])
    panel.tick_params(axis="x", labelsize=7)
    panel.set_xlabel("south ← → north (mm)" if vertical else "low side ← → high side (mm)")
    panel.set_ylabel("measured depth (m)")
    panel.grid(visible=False)


def _apart(places, panel):
    """Depths of labels near places, ascending or descending, so far apart that they can be read."""
    (bottom, top), order = panel.get_ylim(), np.argsort(places, kind="stable")
    line = _LINE * (bottom - top)
    found = np.array(places, dtype=float)[order]
    for k in range(1, len(found)):
        found[k] = max(found[k], found[k - 1] + line)
    found[-1:] = np.minimum(found[-1:], bottom - line / 2)
    for k in range(len(found) - 1, 0, -1):
        found[k - 1] = min(found[k - 1], found[k] - line)
    result = np.empty(len(found))
    result[order] = found
    return result


def _tension(panel, answer, rows):
    md, tension = answer.md[rows], answer.tension[rows]
    panel.plot(tension / 1e3, md, color="black", label="effective tension")
    if np.isfinite(answer.true_tension).any():
        panel.plot(answer.true_tension[rows] / 1e3, md, color=_GREY, linestyle="--", label="true tension")
    low = min(tension.min(), 0.0) * 1.5 - 0.1 * np.abs(answer.tension).max()
    # what decides for the state: in a vertical hole Lubinski's load, which is the greater one there
    inclined = (answer.inclination > VERTICAL) | (answer.dogleg_severity > 0)  # without a wall force: Lubinski's alone
    in_hole = np.where(inclined, answer.critical_load("He-Kyllingstad"), 0.0)
    critical = -np.maximum(in_hole, answer.critical_load("Lubinski"))[rows]
    far = critical <= low
    critical = np.where(far, np.nan, critical)  # a picture of what is near
    if np.isfinite(critical).any():
        label = "tension at which it buckles (He-Kyllingstad, Lubinski)"
        label += ", elsewhere it is farther left" if far.any() else ""
        panel.plot(
            critical / 1e3, md, color="tab:orange", label=label.replace(" (", "\n(").replace(", else", ",\nelse")
        )
    panel.axvline(0.0, color="black", linewidth=0.6)
    panel.set_xlabel("tension (kN)")


def _torque(panel, answer, rows):
    panel.plot(answer.torque[rows] / 1e3, answer.md[rows], color="black")
    panel.set_xlabel(f"torque (kN m)\nconvention: {answer.torque_convention}")


def _bending(panel, answer, rows):
    panel.plot(answer.bending_moment[rows] / 1e3, answer.md[rows], color="black")
    panel.set_xlim(0.0, max(1.05 * np.nanmax(answer.bending_moment[rows], initial=0.0) / 1e3, _LEAST))
    panel.set_xlabel("bending moment (kN m)")


def _side_force(panel, answer, rows):
    """Per length, without the peaks by which the rod has forces at points."""
    md, force = answer.md[rows], answer.distributed_force[rows]
    sides = sides_along(answer)[rows]
    for side, colour in SIDES.items():
        if (sides == side).any():
            panel.fill_betweenx(md, 0.0, force, where=_to_next(sides == side) & np.isfinite(force), color=colour,
                                alpha=0.35, linewidth=0, label=_words(side))  # fmt: skip
    panel.plot(force, md, color="black", linewidth=1.0)
    most = np.nanmax(force, initial=0.0)
    shown = usual_side_force(answer, force, md)
    panel.set_xlim(0.0, max(1.05 * shown, _LEAST_SIDE))
    cut = f"\ncut off: up to {most:.3g} N/m" if most > 1.05 * shown else ""
    panel.set_xlabel(f"side force per length (N/m){cut}")
    if not most > 0:
        panel.text(0.5, 0.5, "none", ha="center", transform=panel.transAxes, color=_GREY)


def _words(side):
    return "wall of a vertical hole" if side == "wall" else f"on the {side} side"


def _at_points(panel, answer, _):
    """Forces at points, with their numbers beside them."""
    bottom, top = panel.get_ylim()
    points = points_between(answer, top, bottom)
    most = max(max(force for _, force, _ in points) / 1e3, _LEAST)
    for side, colour in SIDES.items():
        here = np.array([(md, force / 1e3) for md, force, name in points if name == side]).reshape(-1, 2)
        if len(here):
            panel.hlines(here[:, 0], 0.0, here[:, 1], color=colour, linewidth=1.2)
            panel.plot(here[:, 1], here[:, 0], "o", color=colour, markersize=3.5, label=_words(side))
    numbered = sorted(sorted(points, key=lambda point: -point[1])[:_LABELS])
    places = [md for md, *_ in numbered]
    for y, (md, force, side) in zip(_apart(places, panel), numbered, strict=True):
        panel.plot([force / 1e3, 1.12 * most, 1.2 * most], [md, y, y], color=_GREY, linewidth=0.4)
        text = f"{force / 1e3:.3g} kN, {md:.5g} m"
        panel.text(1.22 * most, y, text, fontsize=7, va="center", color=SIDES[side],
                   bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.3})  # fmt: skip
    panel.set_xlim(0.0, 2.5 * most)
    panel.set_xticks(np.arange(0.0, most, round_step(most, 3)))
    more = f"\nthe {_LABELS} largest numbered" if len(points) > _LABELS else ""
    panel.set_xlabel(f"forces at points (kN){more}")
