"""The lower end of a string in its hole, seen from the side: the hole's wall, bodies, blades and bit, and the forces of
the wall. Depth runs to the right, the high side of the hole is up; across the hole lengths are in mm."""

import numpy as np

from cosserat_fenicsx.checks import positive
from cosserat_fenicsx.pictures.figures import draw_chart, empty_figure
from cosserat_fenicsx.ranks import world
from cosserat_fenicsx.well.components import Bit, Stabiliser
from cosserat_fenicsx.well.contacts import high_side

_ROCK, _BODY, _BLADES, _BIT, _FORCE = "#e4d3bd", "#9db4cc", "#5f7f9f", "#4d5b6b", "tab:red"
# Length of the longest arrow, heights of the names, in turn, and of the picture's edges, over the width of the hole.
_ARROW, _NAMES, _LOW, _HIGH = 0.35, (1.1, 1.32), 1.1, 1.6
# Forces below this share of the largest one have no arrow.
_LITTLE = 0.01


def draw_from_side(answer, file, length):
    """See `RodInContact.plot_from_side`."""
    if length is not None:
        positive("plot_from_side", "length", length, "m")
    return draw_chart(lambda: side_figure(answer, length), file, world())


def side_figure(answer, length=None):
    """The Figure."""
    top = max(0.0, answer.depth - (length or answer.depth))
    figure = empty_figure(11, 5.5)
    axes = figure.subplots()
    md = np.linspace(top, answer.depth, 801)
    wall = 1e3 * answer.hole.at(md, "diameter") / 2
    width = 2 * wall.max()
    for sign in (1, -1):
        axes.fill_between(md, sign * wall, sign * _HIGH * width, color=_ROCK, linewidth=0)
        axes.plot(md, sign * wall, color="black", linewidth=1.0)
    axes.axhline(0.0, color="gray", linewidth=0.6, linestyle=(0, (8, 4)))
    high = 1e3 * np.interp(md, answer.md, _towards_high_side(answer))
    for i, place in enumerate(answer.laid):
        if place.bottom > top:
            _draw_component(axes, place, md, high, _NAMES[i % 2] * width)
    _draw_forces(axes, answer, top, width)
    pad = 0.025 * (answer.depth - top)
    axes.set(xlim=(top - pad, answer.depth + 2 * pad), ylim=(-_LOW * width, _HIGH * width))
    axes.set(xlabel="measured depth (m)", ylabel="from the hole's axis towards its high side (mm)")
    operation = answer.operation
    figure.suptitle(
        f"{operation.name}, weight on bit {operation.weight / 1e3:g} kN, bit at {answer.depth:g} m: the string in its "
        "hole from the side, forces of the wall on it"
    )
    return figure


def _towards_high_side(answer):
    """(n,) distance of the string from the hole's axis towards the high side (north, where there is none), m."""
    high = high_side(answer.hole.path.tangent(answer.md))
    high[~high.any(axis=1)] = (1.0, 0.0, 0.0)
    return (answer.offset * high).sum(axis=1)


def _draw_component(axes, place, md, high, name):
    """Its body along the string, blades or a bit over it, and its name at a height (mm)."""
    part, here = place.component, (md >= place.top) & (md <= place.bottom)
    at = np.concatenate([[max(place.top, md[0])], md[here], [place.bottom]])
    middle = np.interp(at, md, high)
    body = 1e3 * (part.outer_diameter / 2 if part.outer_diameter else part.contact_radius)
    axes.fill_between(at, middle - body, middle + body, color=_BODY, linewidth=0)
    if isinstance(part, Bit | Stabiliser):
        blades = 1e3 * part.contact_radius
        colour = _BIT if isinstance(part, Bit) else _BLADES
        for sign in (1, -1):
            axes.fill_between(at, middle + sign * body, middle + sign * blades, color=colour, linewidth=0)
    axes.plot([at[0], at[0]], [middle[0], name], color="gray", linewidth=0.6)
    axes.text((at[0] + at[-1]) / 2, name, part.name, ha="center", va="bottom", fontsize=9, color="#333333")


def _draw_forces(axes, answer, top, width):
    """Arrows of the forces at points, from the wall to the string, and lines where it lies on the wall."""
    shown = [(start, end, force, side) for start, end, force, side in answer.contacts if end >= top and force > 0]
    points = [contact for contact in shown if contact[0] == contact[1] and contact[3] in ("high", "low")]
    most = max((force for _, _, force, _ in points), default=0.0)
    for start, end, force, side in shown:
        sign = 1 if side == "high" else -1
        wall = 1e3 * sign * float(answer.hole.at((start + end) / 2, "diameter")) / 2
        if start < end:
            axes.plot([max(start, top), end], [wall, wall], color=_FORCE, linewidth=3, solid_capstyle="butt")
            words, at = f"{force / 1e3:.3g} kN from {start:.1f} to {end:.1f} m", (max(start, top) + end) / 2
            if side in ("high", "low"):
                axes.text(at, wall + sign * 0.05 * width, words, ha="center", va="bottom" if sign > 0 else "top",
                          fontsize=8, color=_FORCE)  # fmt: skip
        elif side in ("high", "low") and force > _LITTLE * most:
            tail = wall + sign * _ARROW * width * max(force / most, 0.3)
            axes.annotate("", (start, wall), (start, tail), arrowprops={"arrowstyle": "-|>", "color": _FORCE, "lw": 2})
            axes.text(start, tail + sign * 0.02 * width, f"{force / 1e3:.2f} kN", ha="center",
                      va="bottom" if sign > 0 else "top", fontsize=9, color=_FORCE)  # fmt: skip
