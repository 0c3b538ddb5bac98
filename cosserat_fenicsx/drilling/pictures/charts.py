"""Charts over time of a drill-string in motion, its phase portrait and its ledger of energy, by matplotlib."""

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.pictures.shown import (
    BIT,
    DRIVE,
    GREY,
    KILO,
    RPM,
    advance_unit,
    bands,
    swings,
    times_between,
    title_of,
    turns,
)
from cosserat_fenicsx.drilling.stick_slip import AT_REST
from cosserat_fenicsx.pictures.figures import draw_chart, empty_figure
from cosserat_fenicsx.ranks import world

#: Panels over time: (axis, ((attribute, factor, label, colour), ...)).
_PANELS = (
    ("speed (rpm)", (("drive_speed", RPM, "drive", DRIVE), ("bit_speed", RPM, "bit", BIT))),
    ("torque (kN m)", (("surface_torque", KILO, "at the surface", DRIVE), ("torque_on_bit", KILO, "on bit", BIT))),
    ("force (kN)", (("hook_load", KILO, "hook load", DRIVE), ("weight_on_bit", KILO, "weight on bit", BIT))),
    ("impulse (kN s)", (("impulse_on_bit", KILO, "impacts on rigid\nrock, their sum", BIT),)),
    ("bit advance (m)", (("bit_advance", 1.0, "bit advance", BIT),)),
)
#: (attribute, label, colour, style) of the ledger.
_LEDGER = (
    ("kinetic", "kinetic", "tab:blue", "-"),
    ("strain", "strain", "tab:orange", "-"),
    ("work_of_drive", "work of the drive", "tab:green", "--"),
    ("work_of_hook", "work of the hook", "tab:olive", "--"),
    ("work_of_weight", "work of the weight", "tab:cyan", "--"),
    ("lost_at_bit", "lost at the bit", "tab:red", ":"),
    ("lost_at_wall", "lost at the wall", "tab:brown", ":"),
    ("lost_in_mud", "lost in the mud", "tab:purple", ":"),
)
# A chart with more oscillations of the bit than this shows the bands between their extremes.
_SWINGS = 80
# Energies below this share of the largest are not drawn.
_LITTLE = 1e-9


def draw_over_time(history, file, between=None):
    """See `DrillingHistory.plot`."""
    rows = times_between("plot", history.times, between)
    return draw_chart(lambda: _over_time(history, rows), file, world())


def _over_time(history, rows):
    t = history.times[rows]
    panels = [(axis, [(getattr(history, name)[rows] * factor, *look) for name, factor, *look in lines])
              for axis, lines in _PANELS]  # fmt: skip
    panels = [(axis, [line for line in lines if np.nan_to_num(line[0]).any()]) for axis, lines in panels]
    panels = [_readable(*panel) for panel in panels if panel[1]]  # without what stays zero, or is unknown
    many = max(swings(history.bit_speed[rows]), swings(np.nan_to_num(history.bit_velocity[rows]))) > _SWINGS
    figure = empty_figure(10, 1.2 + 2.3 * len(panels))
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for panel, (axis, lines) in zip(axes, panels, strict=True):
        for values, label, colour in lines[::-1]:
            if many:
                middles, ((least, most),) = bands(t, values)
                panel.fill_between(middles, least, most, color=colour, label=label, alpha=0.4)
            else:
                panel.plot(t, values, color=colour, label=label, linewidth=1.1)
        panel.set_ylabel(axis)
        panel.grid(alpha=0.3)
        if panel is axes[0] and turns(history) and not many:
            lower = "bit" if history.scene.bit is not None else "lower end"
            _shade_rest(panel, t, history.bit_speed[rows], history.drive_speed[rows], f"{lower} at rest")
        if len(lines) > 1 or lines[0][1] not in axis:
            panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    axes[0].margins(x=0.0)
    axes[-1].set_xlabel("time (s)")
    figure.suptitle(title_of(history) + ("\nbands between the extremes of oscillations" if many else ""))
    return figure


def _readable(axis, lines):
    """The advance of a bit in mm, where it is short."""
    if "advance" not in axis:
        return axis, lines
    unit, factor = advance_unit(lines[0][0])
    return f"bit advance ({unit})", [(values * factor, *look) for values, *look in lines]


def _shade_rest(panel, t, bit, drive, label):
    """Grey where the bit is at rest."""
    level = AT_REST * max(float(np.abs(drive).mean()), 1e-3)
    at_rest = np.abs(bit) <= level
    if at_rest.any():
        panel.fill_between(t, 0, 1, where=at_rest, transform=panel.get_xaxis_transform(), color="0.88", linewidth=0,
                           zorder=0, label=label)  # fmt: skip


def draw_phase(history, file, since=None):
    """See `DrillingHistory.plot_phase`."""
    times_between("plot_phase", history.times, None)
    last = float(history.times[-1])
    since = last / 2 if since is None else since
    if not isinstance(since, int | float) or (history.times >= since).sum() < 2:
        refuse("plot_phase", "since", since, f"a time (s) before the end, {last:g} s")
    return draw_chart(lambda: _phase(history, since), file, world())


def _phase(history, since):
    rows = history.times >= since
    twist = history.drive_angle[rows] - history.bit_angle[rows]
    figure = empty_figure(6.5, 5.5)
    panel = figure.subplots()
    panel.plot(twist, history.bit_speed[rows] * RPM, color=BIT, linewidth=1.0, label="bit")
    panel.axhline(float(history.drive_speed[rows].mean()) * RPM, color=DRIVE, linewidth=1.0, label="drive, mean speed")
    panel.set(xlabel="twist between drive and bit (rad)", ylabel="bit speed (rpm)")
    panel.grid(alpha=0.3)
    panel.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False)
    figure.suptitle(f"{title_of(history)}\nfrom {since:.4g} to {history.times[-1]:.4g} s", fontsize=10)
    return figure


def draw_energy(history, file):
    """See `DrillingHistory.plot_energy`."""
    times_between("plot_energy", history.times, None)
    return draw_chart(lambda: _energy(history), file, world())


def _energy(history):
    figure = empty_figure(10, 6)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    values = {name: np.nan_to_num(getattr(history, name)) * KILO for name, *_ in _LEDGER}
    most = max(np.abs(x).max() for x in values.values())
    for name, label, colour, style in _LEDGER:
        if np.abs(values[name]).max() > _LITTLE * most:
            above.plot(history.times, values[name], style, color=colour, label=label)
    axial = not np.isnan(history.hook_load).all()
    above.set_ylabel("energy (kJ)" + ("; strain: less that\nof the string as it hangs at rest" if axial else ""))
    above.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    below.plot(history.times, history.balance * KILO, color=GREY)
    below.set_ylabel("not accounted\nfor (kJ)")
    below.set_xlabel("time (s)")
    for panel in (above, below):
        panel.grid(alpha=0.3)
        panel.margins(x=0.0)
    figure.suptitle(f"{title_of(history)}: energy")
    return figure
