"""Charts of torque and drag over the measured depth, which runs downwards, by matplotlib; and the lower end of a string
in its hole from the side, where depth runs to the right and the high side of the hole is up."""

import numpy as np

from cosserat_fenicsx.checks import finite_array, refuse
from cosserat_fenicsx.pictures.charts import (
    COLOURS,
    GREY,
    SMALL,
    STYLES,
    beside,
    empty_figure,
    legend,
    scale,
    unit_of,
)
from cosserat_fenicsx.pictures.view import round_step
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.well import criteria
from cosserat_fenicsx.well.components import Bit, Stabiliser
from cosserat_fenicsx.well.contacts import VERTICAL, high_side, name_of_side, quantile, stretches

#: Colours of the sides of the hole, the same in all pictures.
SIDES = {"low": "tab:blue", "high": "tab:red", "left": "tab:green", "right": "tab:orange", "wall": "dimgray"}


def depths_between(where, between, depth):
    """(top, bottom), m, of the depths that a picture shows, at most from 0 to the depth of the bit. Raises SceneError:
    they are not two depths of the string, the upper one first."""
    if between is None:
        return 0.0, float(depth)
    ends = finite_array(where, "between", between, "two measured depths (m), such as (3000, 3400)")
    if ends.shape != (2,) or not 0 <= ends[0] < min(ends[1], depth):
        refuse(where, "between", between, f"two measured depths of the string, from 0 to {depth:.10g} m, ascending")
    return float(ends[0]), float(min(ends[1], depth))


def rows_between(md, top, bottom):
    """A slice of ascending depths that holds those from top to bottom, and one more at each end."""
    first, last = np.searchsorted(md, (top, bottom), side="left"), np.searchsorted(md, (top, bottom), side="right")
    return slice(max(0, int(first[0]) - 1), int(last[1]) + 1)


def sides_along(answer):
    """(n,) names of the sides that the string touches at `md`, see `SIDES`; "" where it touches none."""
    names = np.array([name_of_side(side) for side in answer.contact_side])
    vertical = (answer.inclination < VERTICAL) & (answer.side_force > 0)
    return np.where(np.isfinite(answer.contact_side) | vertical, names, "")


def points_between(answer, top, bottom):
    """[(md, force, side)] of the wall's forces at points, m and N."""
    at = [contact for contact in answer.contacts if contact.at_point and top <= contact.top <= bottom]
    return [(contact.top, contact.force, contact.side) for contact in at]


def usual_side_force(answer, force, md):
    """N/m, up to which axes and colours reach, of a regular side force (n,) at depths (n,): of the rod less than the
    largest where some short part of it has much more, such as what is left of a peak."""
    known = np.isfinite(force)
    most = float(force[known].max(initial=0.0))
    if answer.model != "rod" or not most > 0:
        return most
    return min(most, 1.5 * quantile(force[known], np.gradient(md)[known], 0.995))


_HOOK = Quantity("hook load", unit="N", shown="kN")
_SURFACE = Quantity("surface torque", unit="N m", shown="kN m")
_BIT_DEPTH = Quantity("measured depth of the bit", unit="m", shown="m", dimension="length")
DEPTH = Quantity("measured depth", unit="m", shown="m", dimension="length")


def over_depth(widths, quantity):
    """A Figure, panels of widths (inches) over the depth, downwards, and the unit of lengths with its size."""
    figure, panels, rows = beside(widths, 7.5)
    panels[0].invert_yaxis()
    for row in rows:
        row[0].set_ylabel(scale(quantity)[0])
    return figure, panels, *unit_of(quantity)


def sweep_figure(sweep):
    """Hook load and surface torque over the depth of the bit, with marks where there is no answer."""
    turns = any(operation.direction(1.0)[1] for operation in sweep.operations)
    figure, panels, _, length = over_depth([5.0, 5.0] if turns else [6.5], _BIT_DEPTH)
    (hook_label, force), (torque_label, moment) = scale(_HOOK), scale(_SURFACE)
    depths, (low, high) = sweep.depths / length, _usual_range(sweep.hook_load / force)
    by_rod = sweep.models == "rod"
    both = (by_rod.any(), (np.isfinite(sweep.hook_load) & ~by_rod).any()) == (True, True)
    marker = "." if len(depths) < 30 else None
    apart = min(len(sweep.operations), len(sweep.friction)) > 1
    styles = [{"linestyle": STYLES[j % len(STYLES)], "linewidth": 1.2 * (1 + j // len(STYLES))}
              for j in range(len(sweep.friction))]  # fmt: skip
    for i, operation in enumerate(sweep.operations):
        for j, style in enumerate(styles):
            style = {**style, "color": COLOURS[i % len(COLOURS)]}
            drawn = {**style, "label": None if apart else sweep.label(i, j), "marker": marker}
            hook = sweep.hook_load[i, j] / force
            shown = [(panels[0], np.where((hook < low) | (hook > high), np.nan, hook))]
            if turns and operation.direction(1.0)[1]:
                shown.append((panels[1], sweep.surface_torque[i, j] / moment))
            for panel, loads in shown:
                panel.plot(loads, depths, **drawn)
                if both:
                    here = by_rod[i, j]
                    panel.plot(loads[here], depths[here], "s", color=style["color"], markersize=7, fillstyle="none")
            _without_answer(panels[0], sweep, i, j, (low, high), style["color"])
    if apart:  # colours are operations, styles of lines coefficients of friction
        for i, operation in enumerate(sweep.operations):
            panels[0].plot([], [], marker=marker, color=COLOURS[i % len(COLOURS)], label=operation.name)
        for j, style in enumerate(styles):
            panels[0].plot([], [], **style, color=GREY, label=sweep.friction_in_words(j))
    panels[0].set_xlabel(hook_label)
    if turns:
        panels[1].set_xlabel(torque_label)
    if both:
        panels[0].plot([], [], "s", color=GREY, markersize=7, fillstyle="none", label="by the exact rod, others soft")
    mark, hook = {"color": GREY, "linestyle": "none"}, sweep.hook_load / force
    if ((hook < low) | (hook > high)).any():
        panels[0].plot([], [], "<" if (hook < low).any() else ">", **mark, label="load beyond the axis")
    if (sweep.done & np.isnan(hook)).any():
        panels[0].plot([], [], "X", **mark, label="locks up, or no answer")
    legend(*panels)
    part = "" if sweep.done.all() else f", {len(sweep)} of {sweep.done.size} answers so far"
    what = "Hook load and torque" if turns else "Hook load"
    figure.suptitle(f"{what} over the depth of the bit{part}")
    return figure


def _usual_range(loads):
    """Ends of the axis of loads, which a string before lock-up may exceed by far; infinite where all are usual."""
    known = np.abs(loads[np.isfinite(loads)])
    most = 10 * np.median(known) if len(known) else np.inf
    if known.max(initial=0.0) <= most:
        return -np.inf, np.inf
    usual = loads[np.isfinite(loads) & (np.abs(loads) <= most)]
    room = 0.15 * np.ptp(usual)
    return min(usual.min(), 0.0) - room, max(usual.max(), 0.0) + room


def _without_answer(axes, sweep, i, j, limits, colour):
    """Marks where a line's loads are beyond the axis, and where it has none."""
    force, length = unit_of(_HOOK)[1], unit_of(_BIT_DEPTH)[1]
    loads, depths = sweep.hook_load[i, j] / force, sweep.depths / length
    if np.isfinite(limits).all():
        axes.set_xlim(*limits)
    for k in np.flatnonzero((loads < limits[0]) | (loads > limits[1])):
        end, mark = (limits[0], "<") if loads[k] < limits[0] else (limits[1], ">")
        axes.plot(end, depths[k], mark, color=colour, clip_on=False)
    shown = None
    for k in np.argsort(depths):
        if np.isfinite(loads[k]):
            shown = np.clip(loads[k], *limits)
        elif sweep.done[i, j, k]:
            # below the load at the depth before
            at = {"transform": axes.get_yaxis_transform()} if shown is None else {}
            axes.plot(0.02 if shown is None else shown, depths[k], "X", color=colour, clip_on=False, **at)


def fit_figure(fit):
    """Measured loads and those computed with the coefficients found, over the depth of the bit."""
    rows = list(zip(fit._readings, fit.residuals, strict=True))
    quantities = {"hook_load": _HOOK, "surface_torque": _SURFACE}
    queries = list(dict.fromkeys(reading.query for reading, _ in rows))
    operations = list(dict.fromkeys(m.operation for m in fit.measurements))
    figure, panels, unit, length = over_depth([5.0, 5.0] if len(queries) > 1 else [6.5], _BIT_DEPTH)
    weight_unit, weight = unit_of(_HOOK)
    for panel, query in zip(panels, queries, strict=True):
        heading, size = scale(quantities[query])
        panel.set_xlabel(heading)
        for i, operation in enumerate(operations):
            shown = sorted((x.at.depth, x.value, x.sd, x.value - residual * x.sd) for x, residual in rows
                           if x.query == query and x.at.operation == operation)  # fmt: skip
            if shown:
                depth, measured, sd, computed = np.array(shown).T / np.array([[length], [size], [size], [size]])
                on_bit = f", {operation.weight / weight:.4g} {weight_unit} on bit" if operation.weight else ""
                colour = COLOURS[i % len(COLOURS)]
                panel.errorbar(measured, depth, xerr=sd, fmt="o", markersize=5, color=colour,
                               label=f"{operation.name}{on_bit}")  # fmt: skip
                panel.plot(computed, depth, "-x", linewidth=1, color=colour)
        out = [(x.value / size, x.at.depth / length) for (x, _), kept in zip(rows, fit.kept, strict=True)
               if x.query == query and not kept]  # fmt: skip
        if out:
            panel.plot(*np.transpose(out), "o", color="white", markersize=3, markeredgecolor="black", label="left out",
                       zorder=5)  # fmt: skip
        panel.plot([], [], "-x", color=GREY, linewidth=1, label="computed")
    legend(*panels, title="measured, with standard deviations", title_fontsize=8)
    told = [
        f"{section.name or f'to {section.to / length:g} {unit}'} {mu:.3f} ({low:.3f} to {high:.3f})"
        for section, mu, (low, high) in zip(fit.hole.sections, fit.friction, fit.interval, strict=True)
    ]
    block = f", block {fit.block_weight / weight:.1f} {weight_unit}" if fit.block_weight else ""
    figure.suptitle(f"Friction: {', '.join(told)}\nmisfit {fit.misfit:.3g}{block}")
    return figure


# Smallest ranges of the axes: side force (N/m), forces at points and moment (N, N m).
_LEAST_SIDE, _LEAST = 1.0, 100.0
# Least range of the axis of torque, of the largest one: it does not enlarge what the solution leaves.
_LEAST_SHARE = 0.1
# Most forces at points with numbers.
_LABELS = 20
_ACROSS = Quantity("across", unit="m", shown="mm", dimension="diameter")
_TENSION = Quantity("tension", unit="N", shown="kN")
_TORQUE = Quantity("torque", unit="N m", shown="kN m")
_BENDING = Quantity("bending moment", unit="N m", shown="kN m")
SIDE_FORCE = Quantity("side force per length", unit="N/m", shown="N/m", dimension="force per length")
AT_POINTS = Quantity("forces at points", unit="N", shown="kN")
# Stretches that are buckled: colours and names.
_BUCKLED = {criteria.SNAKE: ("gold", "sinusoidal buckling"), criteria.HELIX: ("tab:pink", "helical buckling")}
_PARTS = ("0.55", "0.75")


def answer_figure(answer, between=None):
    """The string in the hole; tension with the loads of buckling; torque where there is some; side force per length,
    and at points where there are such forces; bending moment where it is known; see `TorqueAndDrag.plot`."""
    top, bottom = depths_between("plot", between, answer.depth)
    points = points_between(answer, top, bottom)
    noise = answer.quantities["torque"].noise
    turns = np.abs(answer.torque).max() > noise
    bends = np.nanmax(answer.bending_moment, initial=0.0) > 0
    draws = [string_in_hole, _tension, *([_torque] if turns else []), _side_force]
    draws += [*([_at_points] if points else []), *([_bending] if bends else [])]
    widths = [2.7 * {string_in_hole: 0.8, _at_points: 1.15}.get(drawn, 1.0) for drawn in draws]
    figure, panels, _, length = over_depth(widths, DEPTH)
    room = 0.01 * (bottom - top)
    panels[0].set_ylim((bottom + room) / length, (top - room) / length)
    rows = rows_between(answer.md, top, bottom)
    for panel, drawn in zip(panels, draws, strict=True):
        drawn(panel, answer, rows, answer.md[rows] / length)
        for state, (colour, name) in _BUCKLED.items():
            for a, b in stretches(answer.md / length, _to_next(answer.buckling == state)):
                panel.axhspan(a, b, color=colour, alpha=0.25, linewidth=0, label=name)
    for depth, name in shoes_between(answer, top, bottom):
        _shoe(panels, depth / length, name)
    legend(*panels)
    (force_unit, force), (moment_unit, moment) = unit_of(_HOOK), unit_of(_SURFACE)
    surface_torque = answer.surface_torque if abs(answer.surface_torque) > noise else 0.0
    figure.suptitle(
        f"{title_of(answer, top, bottom)}\n"
        f"hook load {_rounded(answer.hook_load / force)} {force_unit}, "
        f"surface torque {_rounded(surface_torque / moment)} {moment_unit}"
    )
    return figure


def _rounded(number):
    """Text: four significant digits; 0 where these begin behind the third decimal."""
    number = float(f"{number:.4g}") if abs(number) >= 1e-3 else 0.0
    return f"{number:.0f}" if abs(number) >= 1e4 else f"{number:.4g}"


def title_of(answer, top, bottom):
    """Text: the operation, the depth of the bit, the model and the measured depths (m) that are shown."""
    unit, size = unit_of(DEPTH)
    part = "" if (top, bottom) == (0.0, answer.depth) else f", from {top / size:g} to {bottom / size:g} {unit}"
    return f"{answer.operation.name}, bit at {answer.depth / size:g} {unit}, {answer.words}{part}"


def shoes_between(answer, top, bottom):
    """[(md, text)] of the ends of sections of the hole, m."""
    unit, size = unit_of(DEPTH)
    return [(section.to, f"{section.name or 'section'} ends, {section.to / size:g} {unit}")
            for section in answer.hole.sections[:-1] if top < section.to < bottom]  # fmt: skip


def _shoe(panels, depth, words):
    """A line where a section of the hole ends, with its name."""
    for panel in panels:
        panel.axhline(depth, color="tab:brown", linewidth=0.9, linestyle=(0, (6, 3)))
    panels[1].annotate(
        words, (0.02, depth), (0, 2), fontsize=SMALL, xycoords=panels[1].get_yaxis_transform(),
        textcoords="offset points", color="tab:brown", va="bottom",
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5}, zorder=4,
    )  # fmt: skip


def _to_next(where):
    """True at the place after each stretch too, which the stretch reaches to in a picture."""
    return where | np.append(False, where[:-1])


def string_in_hole(panel, answer, rows, depth):
    """The string in the hole, seen across its plane of high and low side, or across north where it is vertical."""
    unit, size = unit_of(_ACROSS)
    md, hole = answer.md[rows], answer.hole.at(answer.md[rows], "diameter") / 2 / size
    length = unit_of(DEPTH)[1]
    high = high_side(answer.hole.path.tangent(md))
    vertical = not high.any()
    across = answer.offset[rows][:, 0] if vertical else (answer.offset[rows] * high).sum(axis=1)
    panel.fill_betweenx(depth, -hole, hole, color="bisque", linewidth=0)
    for wall in (-hole, hole):
        panel.plot(wall, depth, color="tab:brown")
    most, (bottom, top) = float(hole.max()), panel.get_ylim()
    names, middles = [], []
    for k, place in enumerate(answer.laid):
        a, b = max(place.top / length, top), min(place.bottom / length, bottom)
        if b <= a:
            continue
        at = np.unique(np.concatenate([[a, b], depth[(depth > a) & (depth < b)]]))
        x, radius = np.interp(at, depth, across) / size, place.component.contact_radius / size
        panel.fill_betweenx(at, x - radius, x + radius, facecolor=_PARTS[k % 2], edgecolor="black", linewidth=0.5)
        names.append(place.component.name)
        middles.append((a + b) / 2)
    panel.set_xlim(-1.1 * most, 4.2 * most)
    for y, middle, name in zip(_apart(middles, panel), middles, names, strict=True):
        panel.plot([0.8 * most, 1.35 * most], [middle, y], color=GREY, linewidth=0.5)
        panel.text(1.4 * most, y, name, fontsize=SMALL, va="center", clip_on=True)
    panel.set_xticks([-most, 0, most], [f"{x:.3g}" for x in (-most, 0, most)], fontsize=SMALL)
    panel.set_xlabel(f"south ← → north ({unit})" if vertical else f"low side ← → high side ({unit})")
    panel.grid(visible=False)


def _apart(places, panel):
    """Depths of labels near places, ascending or descending, so far apart that they can be read."""
    (bottom, top), order = panel.get_ylim(), np.argsort(places, kind="stable")
    height = 72 * panel.figure.get_figheight() * panel.get_subplotspec().get_position(panel.figure).height
    line = 1.5 * SMALL / height * (bottom - top)
    found = np.array(places, dtype=float)[order]
    steps = line * np.arange(len(found))
    found = np.maximum.accumulate(found - steps) + steps
    found[-1:] = np.minimum(found[-1:], bottom - line / 2)
    result = np.empty(len(found))
    result[order] = np.minimum.accumulate((found - steps)[::-1])[::-1] + steps
    return result


def _tension(panel, answer, rows, depth):
    heading, size = scale(_TENSION)
    tension = answer.tension[rows]
    panel.plot(tension / size, depth, color="black", label="effective tension")
    if np.isfinite(answer.true_tension).any():
        panel.plot(answer.true_tension[rows] / size, depth, color=GREY, linestyle="--", label="true tension")
    low = min(tension.min(), 0.0) * 1.5 - 0.1 * np.abs(answer.tension).max()
    # what decides for the state: in a vertical hole Lubinski's load, which is the greater one there
    inclined = (answer.inclination > VERTICAL) | (answer.dogleg_severity > 0)  # without a wall force: Lubinski's alone
    in_hole = np.where(inclined, answer.critical_load("He-Kyllingstad"), 0.0)
    critical = -np.maximum(in_hole, answer.critical_load("Lubinski"))[rows]
    far = critical <= low
    critical = np.where(far, np.nan, critical)  # beyond the range that is shown
    if np.isfinite(critical).any():
        label = "tension at which it buckles (He-Kyllingstad, Lubinski)"
        label += ", elsewhere it is farther left" if far.any() else ""
        panel.plot(critical / size, depth, color="tab:orange", label=label)
    panel.axvline(0.0, color="black", linewidth=0.6)
    panel.set_xlabel(heading)


def _torque(panel, answer, rows, depth):
    heading, size = scale(_TORQUE)
    torque = answer.torque[rows]
    torque = np.where(np.abs(torque) > answer.quantities["torque"].noise, torque, 0.0) / size
    panel.plot(torque, depth, color="black")
    room = max(0.0, _LEAST_SHARE * np.abs(answer.torque).max() / size - np.ptp(torque)) / 2
    panel.set_xlim(*np.array([torque.min() - room, torque.max() + room]) + np.ptp(torque) * np.array([-0.05, 0.05]))
    panel.set_xlabel(f"{heading}\nconvention: {answer.torque_convention}")


def _bending(panel, answer, rows, depth):
    (heading, size), moment = scale(_BENDING), answer.bending_moment[rows]
    panel.plot(moment / size, depth, color="black")
    panel.set_xlim(0.0, max(1.05 * np.nanmax(moment, initial=0.0), _LEAST) / size)
    panel.set_xlabel(heading)


def _side_force(panel, answer, rows, depth):
    """Per length, without the peaks by which the rod has forces at points."""
    heading, size = scale(SIDE_FORCE)
    unit = unit_of(SIDE_FORCE)[0]
    force, sides = answer.distributed_force[rows], sides_along(answer)[rows]
    for side, colour in SIDES.items():
        if (sides == side).any():
            panel.fill_betweenx(depth, 0.0, force / size, where=_to_next(sides == side) & np.isfinite(force),
                                color=colour, alpha=0.35, linewidth=0, label=_words(side))  # fmt: skip
    panel.plot(force / size, depth, color="black", linewidth=1.0)
    most = np.nanmax(force, initial=0.0)
    shown = usual_side_force(answer, force, answer.md[rows])
    panel.set_xlim(0.0, max(1.05 * shown, _LEAST_SIDE) / size)
    cut = f"\ncut off: up to {most / size:.3g} {unit}" if most > 1.05 * shown else ""
    panel.set_xlabel(f"{heading}{cut}")
    if not most > 0:
        panel.text(0.5, 0.5, "none", ha="center", transform=panel.transAxes, color=GREY)


def _words(side):
    return "wall of a vertical hole" if side == "wall" else f"on the {side} side"


def _at_points(panel, answer, *_):
    """Forces at points, with their numbers beside them."""
    (heading, size), unit = scale(AT_POINTS), unit_of(AT_POINTS)[0]
    length_unit, length = unit_of(DEPTH)
    bottom, top = panel.get_ylim()
    points = [(md / length, force / size, side)
              for md, force, side in points_between(answer, top * length, bottom * length)]  # fmt: skip
    most = max(max(force for _, force, _ in points), _LEAST / size)
    for side, colour in SIDES.items():
        here = np.array([(depth, force) for depth, force, name in points if name == side]).reshape(-1, 2)
        if len(here):
            panel.hlines(here[:, 0], 0.0, here[:, 1], color=colour, linewidth=1.2)
            panel.plot(here[:, 1], here[:, 0], "o", color=colour, markersize=3.5, label=_words(side))
    numbered = sorted(sorted(points, key=lambda point: -point[1])[:_LABELS])
    places = [depth for depth, *_ in numbered]
    for y, (depth, force, side) in zip(_apart(places, panel), numbered, strict=True):
        panel.plot([force, 1.12 * most, 1.2 * most], [depth, y, y], color=GREY, linewidth=0.4)
        panel.text(1.22 * most, y, f"{force:.3g} {unit}, {depth:.5g} {length_unit}", fontsize=SMALL, va="center",
                   color=SIDES[side], bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.3})  # fmt: skip
    panel.set_xlim(0.0, 2.5 * most)
    panel.set_xticks(np.arange(0.0, most, round_step(most, 3)))
    more = f"\nthe {_LABELS} largest numbered" if len(points) > _LABELS else ""
    panel.set_xlabel(f"{heading}{more}")


_SIDE_FORCE = Quantity("side force of the bit", unit="N", shown="kN")
_TILT = Quantity("tilt of the bit", unit="rad", shown="deg", dimension="angle")
_BUILDS = Quantity("curvature of the hole, > 0 builds", unit="rad/m", shown="deg/30m", dimension="angle per length")


def build_figure(found):
    """Side force and tilt of the bit over the curvature of the hole, and the rates of build; see `BuildRate.plot`."""
    figure = empty_figure(9, 6.5)
    panels = figure.subplots(2, sharex=True)
    (along, curvature), unit = scale(_BUILDS), unit_of(_BUILDS)[0]
    told = [(name, rate / curvature, colour) for name, rate, colour in
            zip(found.criterion, found.rate, COLOURS, strict=False) if np.isfinite(rate)]  # fmt: skip
    for panel, quantity, values in zip(panels, (_SIDE_FORCE, _TILT), (found.side_force, found.tilt), strict=True):
        label, size = scale(quantity)
        panel.plot(found.curvature / curvature, values / size, color="black", linewidth=1.5)
        panel.axhline(0.0, color=GREY, linewidth=0.8)
        panel.axvline(0.0, color=GREY, linewidth=0.8)
        panel.set_ylabel(f"{label}\n> 0: to the high side")
        for name, rate, colour in told:
            panel.axvline(rate, color=colour, linewidth=1.5, linestyle="--", label=f"{name}: {rate:.2f} {unit}")
    panels[1].set_xlabel(along)
    legend(panels[0], title="rate of build by")
    thrust_unit, thrust = unit_of(_HOOK)
    figure.suptitle(
        f"Rates of build: weight on bit {found.assembly.thrust / thrust:.4g} {thrust_unit}, inclination "
        f"{np.degrees(found.assembly.inclination):.4g} deg, anisotropy {found.anisotropy:g}"
    )
    return figure


_ROCK, _BODY, _BLADES, _BIT, _FORCE = "#e4d3bd", "#9db4cc", "#5f7f9f", "#4d5b6b", "tab:red"
# Length of the longest arrow, heights of the names, in turn, and of the picture's edges, over the width of the hole.
_ARROW, _NAMES, _LOW, _HIGH = 0.35, (1.1, 1.32), 1.1, 1.6
_TOWARDS_HIGH_SIDE = Quantity("from the hole's axis towards its high side", unit="m", shown="mm", dimension="diameter")


def side_figure(answer, length=None):
    """The lower end from the side, see `TorqueAndDrag.plot_from_side`."""
    top = max(0.0, answer.depth - (length or answer.depth))
    figure = empty_figure(11, 5.5)
    axes = figure.subplots()
    (along, metre), (across, size) = scale(DEPTH), scale(_TOWARDS_HIGH_SIDE)
    md = np.linspace(top, answer.depth, 801)
    wall, at = answer.hole.at(md, "diameter") / 2 / size, md / metre
    width = 2 * wall.max()
    for sign in (1, -1):
        axes.fill_between(at, sign * wall, sign * _HIGH * width, color=_ROCK, linewidth=0)
        axes.plot(at, sign * wall, color="black", linewidth=1.0)
    axes.axhline(0.0, color="gray", linewidth=0.6, linestyle=(0, (8, 4)))
    pad = 0.025 * (answer.depth - top)
    axes.set(xlim=((top - pad) / metre, (answer.depth + 2 * pad) / metre), ylim=(-_LOW * width, _HIGH * width))
    axes.set(xlabel=along, ylabel=across)
    towards_high_side = (answer.offset * high_side(answer.hole.path.tangent(answer.md), north=True)).sum(axis=1)
    high = np.interp(md, answer.md, towards_high_side)
    for i, place in enumerate(answer.laid):
        if place.bottom > top:
            _draw_component(axes, place, md, high, _NAMES[i % 2] * width)
    _draw_forces(axes, answer, top, width)
    (unit, _), (weight_unit, weight) = unit_of(DEPTH), unit_of(_HOOK)
    operation = answer.operation
    figure.suptitle(
        f"{operation.name}, weight on bit {operation.weight / weight:.4g} {weight_unit}, bit at "
        f"{answer.depth / metre:g} {unit}: the string in its hole from the side, forces of the wall on it"
    )
    return figure


def _draw_component(axes, place, md, high, name):
    """Its body along the string, blades or a bit over it, and its name at a height of the chart."""
    (_, metre), (_, size) = unit_of(DEPTH), unit_of(_TOWARDS_HIGH_SIDE)
    part, here = place.component, (md >= place.top) & (md <= place.bottom)
    at = np.concatenate([[max(place.top, md[0])], md[here], [place.bottom]])
    middle, at = np.interp(at, md, high) / size, at / metre
    body = (part.outer_diameter / 2 if part.outer_diameter else part.contact_radius) / size
    axes.fill_between(at, middle - body, middle + body, color=_BODY, linewidth=0)
    if isinstance(part, Bit | Stabiliser):
        blades, colour = part.contact_radius / size, _BIT if isinstance(part, Bit) else _BLADES
        for sign in (1, -1):
            axes.fill_between(at, middle + sign * body, middle + sign * blades, color=colour, linewidth=0)
    axes.plot([at[0], at[0]], [middle[0], name], color="gray", linewidth=0.6)
    called = f"{part.name},\nbent {part.bend:g} deg" if part.bend else part.name
    axes.text((at[0] + at[-1]) / 2, name, called, ha="center", va="bottom", color="#333333")


def _draw_forces(axes, answer, top, width):
    """Arrows of the forces at points, from the wall to the string, and lines where it lies on the wall."""
    (unit, force_size), (length_unit, metre) = unit_of(AT_POINTS), unit_of(DEPTH)
    shown = [contact for contact in answer.contacts if contact.bottom >= top and contact.force > 0]
    most = max((x.force for x in shown if x.at_point and x.side in ("high", "low")), default=0.0)
    for contact in shown:
        start, end, force, side = contact
        sign, told = 1 if side == "high" else -1, force / force_size
        wall = sign * float(answer.hole.at((start + end) / 2, "diameter")) / 2 / unit_of(_TOWARDS_HIGH_SIDE)[1]
        note = {"ha": "center", "va": "bottom" if sign > 0 else "top", "color": _FORCE}
        begin, end, at = max(start, top) / metre, end / metre, start / metre
        if not contact.at_point:
            axes.plot([begin, end], [wall, wall], color=_FORCE, linewidth=3, solid_capstyle="butt")
            words = f"{told:.3g} {unit} from\n{at:.1f} to {end:.1f} {length_unit}"
            if side in ("high", "low"):
                axes.text((begin + end) / 2, wall + sign * 0.05 * width, words, fontsize=SMALL, **note)
        elif side in ("high", "low") and force > 0.01 * most:
            tail = wall + sign * _ARROW * width * max(force / most, 0.3)
            axes.annotate("", (at, wall), (at, tail), arrowprops={"arrowstyle": "-|>", "color": _FORCE, "lw": 2})
            axes.text(at, tail + sign * 0.02 * width, f"{told:.2f} {unit}", **note)


_PRESSURE = Quantity("pressure", unit="Pa", shown="MPa")
_DENSITY = Quantity("density", unit="kg/m^3")


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
        panel.set_xlabel(heading)
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
