"""Charts, maps and films of a drill-string in motion, and charts of its stability, by matplotlib."""

import math
from dataclasses import replace

import numpy as np

from cosserat_fenicsx.checks import finite_array, positive, refuse
from cosserat_fenicsx.drilling.protocol import LEDGER
from cosserat_fenicsx.drilling.stick_slip import AT_REST, SPEED, TORQUE, WEIGHT, alias, turns
from cosserat_fenicsx.drilling.top_drive import PI, Hook
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.pictures.animation import MOST_FRAMES, check_name, frame_rate, record
from cosserat_fenicsx.pictures.charts import (
    COLOURS,
    STYLES,
    asked,
    chosen_unit,
    draw_chart,
    empty_figure,
    ledger,
    legend,
    logarithmic,
    room_for,
    scale,
    stacked,
    unit_of,
)
from cosserat_fenicsx.quantities import Quantity
from cosserat_fenicsx.ranks import on_first, world

_FORCE = Quantity("force", unit="N", shown="kN")
_DEPTH = Quantity("measured depth", unit="m", shown="m", dimension="length")
#: {name: (quantity, whether it has values of either sign)} of what maps show.
MAPPED = {
    "speed": (Quantity("speed of rotation", unit="rad/s", shown="rpm"), False),
    "torque": (TORQUE, True),
    "angle": (Quantity("turns"), False),
    "tension": (Quantity("tension", unit="N", shown="kN"), True),
    "displacement": (Quantity("displacement downwards", unit="m", shown="mm", dimension="diameter"), True),
    "velocity": (Quantity("velocity downwards", unit="m/s"), True),
}
DRIVE, BIT = "tab:blue", "tab:red"
# Most bands of a chart of a long run; about the most times at which the motion of the block is looked at.
_BANDS, _SOME = 400, 2000


def times_between(where, times, between):
    """The slice of ascending times (s) between two of them; all for None. Raises SceneError: fewer than two times in
    it, or `between` is not two ascending times."""
    if len(times) < 2:
        raise SceneError(f"{where}: expected a motion with at least two times, this one has {len(times)}")
    if between is None:
        return slice(None)
    ends = finite_array(where, "between", between, "two times (s), such as (60, 120)")
    if ends.shape != (2,) or not ends[0] < ends[1]:
        refuse(where, "between", between, "two times (s), ascending")
    rows = slice(*np.searchsorted(times, ends + [-1e-9, 1e-9]))
    if rows.stop - rows.start < 2:
        refuse(where, "between", between, f"times of the motion, which ends at {times[-1]:g} s")
    return rows


def bands(times, line, count):
    """(middles, least, largest, mean) of a line in `count` intervals of about equal numbers of rows."""
    edges = np.linspace(0, len(times), count + 1).astype(int)
    first, last, numbers = edges[:-1], edges[1:] - 1, np.diff(edges)
    least, largest, total = (each.reduceat(line, first) for each in (np.minimum, np.maximum, np.add))
    return (times[first] + times[last]) / 2, least, largest, total / numbers


def advance_unit(metres):
    """(unit, factor from m) of a displacement: mm up to a metre."""
    return ("m", 1.0) if np.nan_to_num(np.abs(metres)).max(initial=0.0) >= 1 else ("mm", 1e3)


def swings(values):
    """How often values oscillate, about: half the crossings of the middle of their range."""
    above = values > (np.nanmin(values) + np.nanmax(values)) / 2
    return int((above[1:] != above[:-1]).sum()) // 2


def chatter(values):
    """How often values oscillate by a notable share of their range: half the times that they turn back so far."""
    steps = np.diff(values[np.isfinite(values)])
    turns = np.flatnonzero(steps[1:] * steps[:-1] < 0) + 1
    sizes = np.abs(np.diff(values[turns]))
    return int((sizes > _NOTABLE * (np.nanmax(values) - np.nanmin(values))).sum()) // 2


def lower_end(history):
    """The name of what is at the lower end: a string off bottom has no bit on rock."""
    return "lower end" if history.scene.bit is None else "bit"


def velocity_of_block(history, times):
    """(n,) m/s, downwards positive, of the travelling block at times (s)."""
    signal = (history.scene.hook or Hook()).signal()
    return np.full(len(times), -signal(0.0)) if signal.constant else -np.array([signal(float(t)) for t in times])


def is_axial(history):
    """Whether the model has motion along the axis."""
    return not np.isnan(history.bit_velocity).all()


def moves_along(history):
    """Whether axial motion is of more interest than rotation: nothing turns, or the block moves up and down."""
    if not is_axial(history):
        return False
    block = velocity_of_block(history, _some(history.times))
    return not turns(history) or block.min() < 0 < block.max()


def _some(times):
    return times[:: 1 + len(times) // _SOME]


def title_of(history):
    """Model, drive, block and bit, for titles; gains that no rule chose over the impedance of the string."""
    bit, words = history.scene.bit, []
    if turns(history) or not is_axial(history):
        words.append(_words_on_drive(history.scene))
    block = velocity_of_block(history, _some(history.times))
    if is_axial(history) and block.any():
        steady = np.ptp(block) < 1e-9 * np.abs(block).max()
        unit, size = chosen_unit("m/s") or ("m/s", 1.0)
        way, fastest = "down" if block[0] > 0 else "up", f"{np.abs(block).max() / size:.4g} {unit}"
        words.append(f"block {way} at {fastest}" if steady else f"block moves at up to {fastest}")
    words.append("off bottom" if bit is None else f"{type(bit.law).__name__} bit")
    if bit is not None and bit.weight:
        unit, size = unit_of(WEIGHT)
        words.append(
            f"up to {bit.most / size:.4g} {unit} on bit" if bit.varies else f"{bit.weight / size:.4g} {unit} on bit"
        )
    return f"{history.model}: {', '.join(words)}"


def _words_on_drive(scene):
    drive = scene.drive
    control = type(drive.control).__name__
    if isinstance(drive.control, PI) and drive.control.rule:
        control = drive.control.rule
    elif isinstance(drive.control, PI):
        Kp = drive.control.Kp
        impedance = None if scene.discs else scene.segments[0].torsional_impedance
        told = f"{Kp / impedance:.3g} impedances" if impedance else f"{Kp:.4g} N m s/rad"
        control = f"{control} (Kp = {told})"
    rpm, size = unit_of(SPEED)
    asked = f" at {drive.signal()(0.0) / size:.4g} {rpm}" if drive.signal().constant and drive.speed is not None else ""
    return f"{control} drive{asked}"


def _panels(history, rows):
    """[(quantity, [(values, label, colour)])] of panels over time, without what stays zero or is unknown."""
    lower = lower_end(history)

    def line(name, label, colour):
        return getattr(history, name)[rows], label, colour

    advance = line("bit_advance", None, BIT)
    shown = advance_unit(advance[0])[0]
    panels = [
        (SPEED, [line("drive_speed", "drive", DRIVE), line("bit_speed", lower, BIT)]),
        (TORQUE, [line("surface_torque", "at the surface", DRIVE), line("torque_on_bit", "on bit", BIT)]),
        (Quantity("motor's own speed", unit="rad/s", shown="rpm"), [line("motor_speed", None, BIT)]),
        (Quantity("pressure over motor", unit="Pa", shown="bar"), [line("pressure", None, DRIVE)]),
        (_FORCE, [line("hook_load", "hook load", DRIVE), line("weight_on_bit", "weight on bit", BIT)]),
        (Quantity("impulse", unit="N s"), [line("impulse_on_bit", "impacts on rigid rock, their sum", BIT)]),
        (Quantity(f"advance of the {lower}", unit="m", shown=shown, dimension="length"), [advance]),
    ]
    if is_axial(history):
        block = velocity_of_block(history, history.times[rows]), "of the block", DRIVE
        panels.append((MAPPED["velocity"][0], [block, line("bit_velocity", f"of the {lower}", BIT)]))
    panels = [(quantity, [line for line in lines if np.nan_to_num(line[0]).any()]) for quantity, lines in panels]
    return [(quantity, lines) for quantity, lines in panels if lines]


#: Colours of the ledger; styles by the beginnings of its names.
_COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:olive", "tab:cyan", "tab:red", "tab:brown", "tab:purple",
            "tab:gray")  # fmt: skip
_STYLES = {"work": "--", "lost": ":"}
# A chart with more oscillations of the bit than this shows the bands between their extremes; oscillations that can be
# seen one by one.
_SWINGS, _SOME_SWINGS = 80, 20
# Share of the range of values by which they turn back where it is seen.
_NOTABLE = 0.02


def over_time_figure(history, between=None):
    """See `DrillingHistory.plot`."""
    rows = times_between("plot", history.times, between)
    t = history.times[rows]
    panels = _panels(history, rows)
    many = max(swings(history.bit_speed[rows]), swings(np.nan_to_num(history.bit_velocity[rows])))
    many = many if many > _SWINGS else 0
    fast = max(chatter(values) for _, lines in panels for values, *_ in lines)
    count, banded = min(_BANDS, max(many, fast) // 2), many or fast > _BANDS
    figure, axes = stacked(10, [2.3] * len(panels))
    for panel, (quantity, lines) in zip(axes, panels, strict=True):
        every = [values for values, *_ in lines]
        heading, size = scale(quantity, *every)
        for values, label, colour in lines[::-1]:
            if many or chatter(values) > _BANDS:
                middles, least, most, mean = bands(t, values / size, count)
                panel.fill_between(middles, least, most, color=colour, label=label, alpha=0.4, linewidth=0)
                panel.plot(middles, mean, color=colour, linewidth=1.1)
            else:
                panel.plot(t, values / size, color=colour, label=label, linewidth=1.1)
        panel.set_ylabel(heading)
        if quantity.label.startswith("motor") and history.stalled[rows].any():
            _shade(panel, t, history.stalled[rows], "motor stalled", "tab:red", 0.25)
        if panel is axes[0] and turns(history) and not banded:
            label = f"{lower_end(history)} at rest"
            _shade_rest(panel, t, history.bit_speed[rows], history.drive_speed[rows], label)
    legend(*axes)
    axes[-1].set_xlabel("time (s)")
    caution = history.stick_slip().caution.replace(" and nothing", "\nand nothing") if len(history) > 5 else ""
    text = ""
    if banded:
        some = f"between=({t[-1] - (t[-1] - t[0]) * _SOME_SWINGS / max(many, fast):.5g}, {t[-1]:.6g})"
        text = f"\nbands between the extremes of oscillations, lines: their means; single ones: {some}"
    figure.suptitle(title_of(history) + text + (f"\n{caution}" if caution else ""))
    return figure


def fit_figure(fit):
    """See `DrillingFit.plot`."""
    readings, quantities = fit.readings, fit.history.quantities
    times = np.linspace(readings.times[0], readings.times[-1], _SOME)
    figure, axes = stacked(10, [2.3] * len(readings.values))
    for panel, (name, values) in zip(axes, readings.values.items(), strict=True):
        heading, size = scale(quantities[name], values)
        far = np.isin(readings.times, fit.left_out[name])
        panel.plot(readings.times, np.where(far, np.nan, values) / size, ".", color="0.45", markersize=4, label="read")
        if far.any():
            panel.plot(readings.times[far], values[far] / size, "x", color=BIT, label="read, left out")
        panel.plot(times, fit.computed(name, times) / size, color=DRIVE, linewidth=1.1, label="with the numbers found")
        panel.set_ylabel(heading)
    legend(*axes)
    axes[-1].set_xlabel("time (s)")
    told = (f"{name.split('.', 1)[-1]} {x:.5g} ± {e:.2g} {unit}"
            for name, x, e, unit in zip(fit.names, fit.values, fit.standard_error, fit.units, strict=True))  # fmt: skip
    figure.suptitle(f"Fit: {', '.join(told)} (standard errors); misfit {fit.misfit:.3g}")
    return figure


def _shade_rest(panel, t, bit, drive, label):
    """Grey where the bit is at rest."""
    level = AT_REST * max(float(np.abs(drive).mean()), 1e-3)
    at_rest = np.abs(bit) <= level
    if at_rest.any():
        _shade(panel, t, at_rest, label, "0.88")


def _shade(panel, t, where, label, colour, alpha=1.0):
    panel.fill_between(t, 0, 1, where=where, transform=panel.get_xaxis_transform(), color=colour, linewidth=0,
                       zorder=0, label=label, alpha=alpha)  # fmt: skip


def phase_figure(history, since=None):
    """See `DrillingHistory.plot_phase`."""
    times_between("plot_phase", history.times, None)
    last = float(history.times[-1])
    since = last / 2 if since is None else since
    if not isinstance(since, int | float) or (history.times >= since).sum() < 2:
        refuse("plot_phase", "since", since, f"a time (s) before the end, {last:g} s")
    rows = history.times >= since
    twist = history.drive_angle[rows] - history.bit_angle[rows]
    figure = empty_figure(6.5, 5.5)
    panel = figure.subplots()
    lower = lower_end(history)
    heading, size = scale(replace(SPEED, label=f"speed of the {lower}"))
    panel.plot(twist, history.bit_speed[rows] / size, color=BIT, label=lower)
    panel.axhline(float(history.drive_speed[rows].mean()) / size, color=DRIVE, label="drive, mean speed")
    panel.set(xlabel=f"twist between drive and {lower} (rad)", ylabel=heading)
    legend(panel)
    figure.suptitle(f"{title_of(history)}\nfrom {since:.4g} to {last:.4g} s")
    return figure


def energy_figure(history):
    """See `DrillingHistory.plot_energy`."""
    times_between("plot_energy", history.times, None)
    curves = {}
    for name, colour in zip(LEDGER, _COLOURS, strict=True):
        label, style = name.replace("_", " ", 1).replace("_", " the "), _STYLES.get(name[:4], "-")
        curves[name] = label, np.nan_to_num(getattr(history, name)), colour, style
    stored = [curves.pop(name) for name in ("kinetic", "strain")]
    about = "; strain: less the energy of the string as it hangs at rest" if is_axial(history) else ""
    return ledger(history.times, stored, list(curves.values()), history.balance, f"{title_of(history)}: energy", about)


# Largest number of depths that are drawn; colour of places that stick.
_DEPTHS, _STICKS = 500, "0.8"
# Part of the height in which a bit at rest is marked.
_BIT = 0.03


def map_figure(history, what=None, between=None):
    """See `DrillingHistory.plot_map`."""
    if what is None:
        what = "velocity" if moves_along(history) else "speed"
    if not isinstance(what, str) or what not in MAPPED:
        raise SceneError(f"plot_map.what = {what!r}: {nearest(what, MAPPED)}")
    rows = times_between("plot_map", history.profile_times, between)
    if np.isnan(getattr(history, what)).all():
        raise SceneError(
            f"plot_map.what = {what!r}: the {history.model} model has none: expected model='axial and torsional'"
        )
    quantity, signed = MAPPED[what]
    places = np.unique(np.linspace(0, len(history.depths) - 1, _DEPTHS).astype(int))
    along, length = scale(_DEPTH)
    t, depths = history.profile_times[rows], history.depths[places] / length
    values = getattr(history, what)[rows][:, places].T
    values = values / (2 * np.pi) if what == "angle" else values
    heading, size = scale(quantity, values)
    values, sticks = values / size, history.sticking[rows][:, places].T
    figure = empty_figure(10, 5.5)
    panel = figure.subplots()
    most, least = float(np.nanmax(values)), float(np.nanmin(values))
    signed = signed or least < -0.25 * most
    limits = (-max(most, -least), max(most, -least)) if signed else (min(least, 0.0), most)
    limits = limits if limits[1] > limits[0] else (0.0, 1.0)
    colours = panel.pcolormesh(t, depths, values, shading="nearest", cmap="coolwarm" if signed else "viridis",
                               vmin=limits[0], vmax=limits[1], rasterized=True)  # fmt: skip
    figure.colorbar(colours, ax=panel, label=heading)
    text = ""
    if sticks.any():
        from matplotlib.colors import ListedColormap

        panel.pcolormesh(t, depths, np.where(sticks, 1.0, np.nan), shading="nearest", cmap=ListedColormap([_STICKS]),
                         rasterized=True)  # fmt: skip
        text = "; grey: held by friction"
        if sticks[-1].any():  # a row of the map is too thin to be seen
            panel.fill_between(t, 0, _BIT, where=sticks[-1], transform=panel.get_xaxis_transform(), step="mid",
                               color=_STICKS, edgecolor="0.3", linewidth=0.3)  # fmt: skip
            text += f" (at the lower edge: the {lower_end(history)})"
    panel.set(xlabel="time (s)", ylabel=along, ylim=(depths[-1], depths[0]), xlim=(t[0], t[-1]))
    panel.grid(visible=False)
    caution = alias(history)
    figure.suptitle(f"{title_of(history)}{text}" + (f"\n{caution}" if caution else ""))
    return figure


#: Panels of a map, of the modes that grow fastest; lines of a chart over the speed.
_MAPS, _LINES = 6, 8


def stability_figure(answer, mode=None):
    """See `Stability.plot`."""
    grid = len(answer.weights) > 1 and len(answer.speeds) > 1
    return (_maps if grid else _lines)(answer, _modes(answer, mode))


def _modes(answer, mode):
    """The modes to draw, by frequency: the given one, those that grow fastest, or the least damped where none grows."""
    if mode is not None:
        return [mode]
    fastest = np.nanmax(answer.growth, axis=(0, 1))
    order = [int(k) for k in np.argsort(-fastest)]
    most = _MAPS if len(answer.weights) > 1 else _LINES
    return sorted([k for k in order if fastest[k] > 0][:most] or order[:1])


def _named(answer, k):
    middle = np.nanmedian(answer.frequency[:, :, k])
    return f"mode {k}, {middle:.3g} Hz"


def _maps(answer, modes):
    from matplotlib.colors import SymLogNorm

    columns = max(1, min(2 if len(modes) in (2, 4) else 3, len(modes), int((room_for(11.2) - 1.0) / 3.0)))
    rows = math.ceil(len(modes) / columns)
    figure = empty_figure(1.0 + 3.4 * columns, 0.9 + 2.7 * rows)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    speeds, weights = np.argsort(answer.speeds), np.argsort(answer.weights)
    largest = max(float(np.nanmax(np.abs(answer.growth[:, :, modes]))), 1e-12)
    colours = SymLogNorm(largest / 30, vmin=-largest, vmax=largest)  # so that the sign is seen near the limit
    (along, turning), (across, pressing) = scale(SPEED), scale(WEIGHT, answer.weights)
    for panel, k in zip(axes.flat, modes, strict=False):
        growth = answer.growth[np.ix_(speeds, weights, [k])][:, :, 0].T
        x, y = answer.speeds[speeds] / turning, answer.weights[weights] / pressing
        drawn = panel.pcolormesh(x, y, growth, cmap="coolwarm", norm=colours, shading="nearest")
        known = np.nan_to_num(growth, nan=-largest)
        if (known > 0).any() and (known < 0).any():
            panel.contour(x, y, known, levels=[0.0], colors="black", linewidths=1.2)
        panel.set_title(_named(answer, k))
        panel.grid(visible=False)
    for panel in axes.flat[len(modes) :]:
        panel.set_visible(False)
    for panel in axes[-1]:
        panel.set_xlabel(along)
    for panel in axes[:, 0]:
        panel.set_ylabel(across)
    figure.colorbar(drawn, ax=axes, label="growth (1/s); black: the limit")
    figure.suptitle(_on_stability(answer))
    return figure


def _on_stability(answer):
    """A title: the kind of motion, the drive or the hook, and the bit."""
    scene, words = answer.scene, [f"Growth of small motions, {answer.kind}"]
    if answer.kind == "torsion":
        words.append(_words_on_drive(scene).partition(" at ")[0])
    words += [f"{type(scene.bit.law).__name__} bit"] if scene.bit is not None else ["off bottom"]
    return ", ".join(words)


def _lines(answer, modes):
    figure = empty_figure(7.0, 4.2)
    panel = figure.subplots()
    by_speed = len(answer.weights) == 1
    x = answer.speeds if by_speed else answer.weights
    heading, size = scale(SPEED if by_speed else WEIGHT, x)
    order = np.argsort(x)
    for n, k in enumerate(modes):
        growth = (answer.growth[:, 0, k] if by_speed else answer.growth[0, :, k])[order]
        style = {"color": COLOURS[n % len(COLOURS)], "linestyle": STYLES[n % len(STYLES)]}  # some lie on each other
        panel.plot(x[order] / size, growth, **style, label=_named(answer, k))
    panel.axhline(0.0, color="black", linewidth=0.8)
    panel.set(xlabel=heading, ylabel="growth (1/s)")
    legend(panel)
    figure.suptitle(_on_stability(answer))
    return figure


def campbell_figure(answer):
    """See `Campbell.plot`."""
    figure = empty_figure(7.0, 5.0)
    panel = figure.subplots()
    heading, size = scale(SPEED)
    fastest = answer.fastest / size
    for n, (kind, frequencies) in enumerate(answer.frequencies.items()):
        for i, frequency in enumerate(frequencies):
            label = f"{kind}, bit {answer.ends[kind]} (natural)" if i == 0 else None
            panel.plot([0, fastest], [frequency] * 2, color=COLOURS[n], linewidth=0.9, label=label)
    for n, (name, times) in enumerate(answer.excitations.items()):
        highest = times * answer.fastest / (2 * math.pi)
        panel.plot([0, fastest], [0, highest], "--", color="black", linewidth=1.0 + 0.6 * n, label=name)
    marked = [(speed / size, answer.excitations[name] * speed / (2 * math.pi))
              for (_, name), speeds in answer.critical_speeds().items() for speed in speeds]  # fmt: skip
    marked = [(x, y) for x, y in marked if y <= answer.up_to]
    if marked:
        panel.plot(*zip(*marked, strict=True), "o", color="tab:red", markersize=4, label="critical speeds")
    panel.set(xlabel=heading, ylabel="frequency (Hz)", xlim=(0, fastest), ylim=(0, answer.up_to))
    legend(panel)
    return figure


def bounce_figure(answer):
    """See `BitBounce.plot`."""
    figure = empty_figure(7.0, 4.2)
    panel = figure.subplots()
    order, weight = np.argsort(answer.speeds), answer.scene.bit.weight
    (along, turning), (across, pressing) = scale(SPEED), scale(WEIGHT, answer.amplitude, weight)
    x, y = answer.speeds[order] / turning, answer.amplitude[order] / pressing
    panel.plot(x, y, color="tab:blue", label="amplitude of the weight on bit")
    panel.axhline(weight / pressing, color="black", linestyle="--", label="static weight on bit")
    panel.fill_between(x, 0, 1, where=y > weight / pressing, transform=panel.get_xaxis_transform(), color="tab:red",
                       alpha=0.15, linewidth=0, label="the bit lifts off")  # fmt: skip
    panel.set(xlabel=along, ylabel=across, xlim=(x[0], x[-1]))
    logarithmic(panel)
    legend(panel)
    return figure


# Highest over lowest frequency from which the axis of unevenly spaced ones is logarithmic.
_DECADES = 20


def response_figure(answer):
    """See `FrequencyResponse.plot`."""
    above, surface, moved, source = answer.ends
    figure, panels = stacked(8, [2.1, 1.5, 2.1, 2.1])
    order = np.argsort(answer.frequency)
    f, torque = answer.frequency[order], answer.transfer(source, surface)[order]
    panels[0].plot(f, np.abs(torque), color=DRIVE, label=f"{surface} per {source}")
    panels[0].axhline(1.0, color="black", linewidth=0.8)
    panels[0].set_ylabel(f"{surface}\nper {source}")
    phase = np.degrees(np.angle(torque))
    turned = np.flatnonzero(np.abs(np.diff(phase)) > 180) + 1  # from -180 to 180 degrees
    panels[1].plot(np.insert(f, turned, np.nan), np.insert(phase, turned, np.nan), color=DRIVE)
    panels[1].set(ylabel="its phase\n(degrees)", yticks=[-180, -90, 0, 90, 180], ylim=(-190, 190))
    (turn, turning), (push, pushing) = map(unit_of, answer.shown)
    for name, colour in ((above, DRIVE), (moved, BIT)):
        size = np.abs(answer.transfer(source, name)[order]) / turning * pushing
        if size.any():
            panels[2].plot(f, size, color=colour, label=name)
    panels[2].set_ylabel(f"speed per {source}\n({turn} per {push})")
    unit = "N m s/rad" if answer.kind == "torsion" else "N s/m"
    panels[3].plot(f, np.abs(answer.impedance[order]), color="tab:green", label="string")
    if np.isfinite(answer.drive_impedance).any():
        drive = "drive" if answer.kind == "torsion" else "hook"
        panels[3].plot(f, np.abs(answer.drive_impedance[order]), "--", color="black", label=drive)
    panels[3].set_ylabel(f"impedance at the\nsurface ({unit})")
    for panel in (panels[0], *panels[2:]):
        logarithmic(panel)
    if f[-1] > _DECADES * f[0] and np.ptp(np.diff(f)) > 1e-6 * f[-1]:
        panels[-1].set_xscale("log")
    legend(panels[2], panels[3])
    panels[-1].set_xlabel("frequency (Hz)")
    rpm, size = unit_of(SPEED)
    at = f", {answer.speed / size:.4g} {rpm}" if answer.speed else ""
    drive = f", {_words_on_drive(answer.scene).partition(' at ')[0]}" if answer.kind == "torsion" else ""
    figure.suptitle(f"Response of the string in {answer.kind}{at}{drive}" + "".join(f"\n{x}" for x in answer.cautions))
    return figure


def hfto_figure(answer):
    """See `Hfto.plot`."""
    if not len(answer):
        raise SceneError("plot: expected at least one oscillation, this state keeps up none")
    figure, panels = stacked(8, [2.4, 2.4])
    growth = Quantity("growth", unit="1/s")
    shown = (growth, answer.growth, "growth while small", BIT), (TORQUE, answer.torque, "largest torque +-", DRIVE)
    for panel, (quantity, values, label, colour) in zip(panels, shown, strict=True):
        unit, size = unit_of(quantity, values)
        panel.vlines(answer.frequency, 0, values / size, color=colour, linewidth=0.9)
        panel.plot(answer.frequency, values / size, "o", color=colour, markersize=4)
        panel.set_ylabel(f"{label} ({unit})")
        panel.set_ylim(bottom=0)
    panels[-1].set_xlabel("frequency (Hz)")
    (rpm, size), largest = unit_of(SPEED), float(np.nan_to_num(answer.amplitude).max())
    figure.suptitle(f"Torsional oscillations that the bit keeps up, {answer.speed / size:.4g} {rpm}, "
                    f"its speed +- {largest / size:.4g} {rpm} at most")  # fmt: skip
    return figure


# Longest film, s, where no speed is asked for; pixels across the string and along it; dots per inch; bands along a
# string that moves along the axis.
_LONGEST, _ACROSS, _ALONG, _DPI, _IN_BANDS = 10.0, 60, 400, 100, 20


def film(history, file, speed=None, fps=25, progress=None, units="SI"):
    """See `DrillingHistory.animate`."""
    file = check_name(file)
    times_between("animate", history.profile_times, None)
    fps = frame_rate(file, fps)
    first, last = history.profile_times[[0, -1]]
    speed = max(1.0, (last - first) / _LONGEST) if speed is None else positive("animate", "speed", speed, "-")
    count = int(np.ceil((last - first) * fps / speed)) + 1
    if count > MOST_FRAMES:
        raise SceneError(
            f"animate.speed = {speed:g}: expected one that needs at most {MOST_FRAMES} frames, not {count}"
        )
    times = np.linspace(first, last, count)

    def drawn():
        with asked(units=units):  # titles change from frame to frame
            record(lambda: Stage(history, speed, units), file, times, fps, progress)

    on_first(world(), drawn)


class Stage:
    """The picture at a time; the constant parts are drawn once. The string is seen from the side: its nearer half has a
    bright stripe along it; where it moves along the axis, its bands move with it."""

    def __init__(self, history, speed, units="SI"):
        self._history, self._speed = history, speed
        self._along = moves_along(history)
        self._figure = draw_chart(lambda: self._constant_parts(history), units=units)
        self._figure.set_layout_engine("none")  # found once: it would take half of the time of each frame

    def _constant_parts(self, history):
        figure = empty_figure(9.6, 6.0)
        figure.set_dpi(_DPI)
        string, along, over = figure.subplots(1, 3, width_ratios=(0.35, 1.0, 2.0))
        top, bottom = history.depths[[0, -1]]
        self._places = np.linspace(top, bottom, _ALONG)
        self._across = np.arcsin(np.linspace(-1, 1, _ACROSS) * 0.999)  # round a string that is seen from the side
        if self._along:  # the largest displacement is drawn about as long as two bands
            self._band = (bottom - top) / _IN_BANDS
            largest = max(float(np.nanmax(np.abs(history.displacement))), 1e-9)
            self._enlarge = float(f"{max(1.0, 2 * self._band / largest):.1g}")
        depth, self._length = scale(_DEPTH)
        blank, box = np.zeros((_ALONG, _ACROSS)), (0, 1, bottom / self._length, top / self._length)
        self._stripes = string.imshow(blank, extent=box, aspect="auto", cmap="gray", vmin=-0.4, vmax=1.2)
        string.set(xticks=[], ylabel=depth, title="string")
        quantity = MAPPED["velocity" if self._along else "speed"][0]
        heading, self._size = scale(quantity)
        values = self._shown() / self._size
        (self._line,) = along.plot(values[0], history.depths / self._length, color="tab:purple")
        (self._held,) = along.plot([], [], ".", color="0.6", markersize=4, label="held by friction")
        low, high = float(min(np.nanmin(values), 0.0)), float(np.nanmax(values))
        room = 0.05 * max(high - low, 1.0 if not self._along else 1e-3)
        along.set(xlim=(low - room, high + room), ylim=box[2:], xlabel=heading, yticklabels=[])
        if history.sticking.any():
            legend(along)
        for at_ends, label, colour in self._over_time():
            over.plot(history.times, at_ends / self._size, color=colour, label=label, linewidth=1.0)
        over.set(xlabel="time (s)", ylabel=heading, xlim=(0, history.times[-1]))
        legend(over)
        self._now = over.axvline(0.0, color="black", linewidth=0.8)
        string.grid(visible=False)
        figure.suptitle(self._title(float(history.profile_times[0])))
        return figure

    def _shown(self):
        """(k, m) what is drawn along the string, and moves it."""
        return self._history.velocity if self._along else self._history.speed

    def _over_time(self):
        """[(values over time at an end, label, colour)]."""
        history, lower = self._history, lower_end(self._history)
        if self._along:
            block = velocity_of_block(history, history.times)
            return (block, "block", DRIVE), (history.bit_velocity, lower, BIT)
        return (history.drive_speed, "drive", DRIVE), (history.bit_speed, lower, BIT)

    def at(self, t):
        """(height, width, 3) the picture at t (s)."""
        history = self._history
        k = int(np.clip(np.searchsorted(history.profile_times, t) - 1, 0, len(history.profile_times) - 2))
        begin, end = history.profile_times[k : k + 2]
        share = (t - begin) / (end - begin)
        by = history.displacement * self._enlarge if self._along else history.angle
        moved, values = ((1 - share) * x[k] + share * x[k + 1] for x in (by, self._shown() / self._size))
        moved = np.interp(self._places, history.depths, moved)[:, None]
        if self._along:
            bright = np.cos(2 * math.pi / self._band * (self._places[:, None] - moved)) + 0 * self._across
        else:
            bright = np.cos(moved + self._across)
        self._stripes.set_data(np.cos(self._across) * np.where(bright > 0.0, 1.0, 0.25))
        self._line.set_xdata(values)
        held = history.sticking[k + round(share)]
        self._held.set_data(values[held], history.depths[held] / self._length)
        self._now.set_xdata([t, t])
        self._figure.suptitle(self._title(t))
        self._figure.canvas.draw()
        return np.asarray(self._figure.canvas.buffer_rgba())[..., :3].copy()

    def _title(self, t):
        pace = "real time" if self._speed == 1 else f"{self._speed:.3g} times faster than real"
        moved = f"; displacements drawn {self._enlarge:g} times their size" if self._along else ""
        return f"{title_of(self._history)}\nt = {t:.2f} s ({pace}){moved}"

    def close(self):
        """Nothing to free."""
