"""Charts by matplotlib, of a motion: its energies; a section in its hole: orbit, whirl and Campbell diagram; and of
modes along a path, or over the rate of a steady rotation."""

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.pictures.charts import (
    COLOURS,
    GREY,
    empty_figure,
    ledger,
    legend,
    room_for,
    scale,
    stacked,
    unit_of,
)
from cosserat_fenicsx.quantities import Quantity

_STORED = (("kinetic", "kinetic", "tab:blue", "-"), ("strain", "strain", "tab:orange", "-"))
_DONE = (("work", "work of loads and supports", "tab:green", "-"), ("dissipated", "dissipated", "tab:red", "--"))
_DISTANCE = Quantity("distance from the axis of the hole", unit="m", shown="mm", dimension="diameter")
_RATE = Quantity("rate, forward in the direction of the spin", unit="rad/s", shown="rpm")
_OF_AXIS = Quantity("rate of the section's axis, forward positive", unit="rad/s", shown="rpm")
_SPEED = Quantity("speed of rotation", unit="rad/s", shown="rpm")
_NORMAL = Quantity("normal force of the wall on a node", unit="N", dimension="force")
# Window of the mean rates in the chart, as a share of the duration: single impacts do not show.
_WINDOW = 0.01
# The rate of rolling is drawn where the mean radius is above this share of the clearance.
_NEAR_WALL = 0.95
# A run-up changes the speed by more than this share of the largest.
_CONSTANT = 0.05
# Spectra: minimum number of times; shortest and longest window, as shares of the duration; overlapping windows at a
# time; floor of amplitudes over the largest; values of the transform per independent one.
_LEAST, _SHORTEST, _LONGEST, _OVERLAP, _FLOOR, _FINER = 200, 1 / 40, 1 / 4, 8, 1e-3, 4


def _refuse_short(result, what):
    """Refuse a motion or an orbit with fewer than two times; `what`: the chart, in words."""
    if len(result) < 2:
        raise SceneError(f"chart of {what}: expected a history with at least two times")


def energy_figure(history):
    """See `History.plot_energy`."""
    _refuse_short(history, "energies")
    title = f"{history.scene.title or 'Motion'}: energy, scheme {history.scheme}"
    return ledger(history.times, *energies_of(history), history.balance, title)


def energies_of(history):
    """Curves of stored energies, and of works and losses."""
    return [[(label, getattr(history, name), *style) for name, label, *style in curves] for curves in (_STORED, _DONE)]


def orbit_figure(orbit):
    """See `Orbit.plot`."""
    _refuse_short(orbit, "orbit")
    from matplotlib.collections import LineCollection

    figure = empty_figure(7.5, 0.83 * room_for(7.5))
    axes = figure.subplots()
    unit, size = unit_of(_DISTANCE)
    up, right = (orbit.position / size).T
    points = np.column_stack([right, up])
    lines = LineCollection(np.stack([points[:-1], points[1:]], axis=1), array=orbit.times[1:], cmap="viridis", lw=1.0,
                           zorder=3)  # fmt: skip
    axes.add_collection(lines)
    angle = np.linspace(0, 2 * np.pi, 361)
    clearances = sorted({float(x) / size for x in (orbit.clearance.min(), orbit.clearance.max())})
    for radius, style, label in zip(clearances, ("-", "--"), ("clearance", "largest clearance"), strict=False):
        axes.plot(radius * np.sin(angle), radius * np.cos(angle), style, color="peru", lw=4, alpha=0.5, label=label)
    axes.plot(0, 0, "+", color=GREY, label="axis of the hole")
    reach = 1.08 * max(float(orbit.clearance.max()), float(orbit.radius.max())) / size
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    names = ("towards east", "towards north") if orbit.vertical else ("to the right", "towards the high side")
    axes.set(**{f"{axis}label": f"{name} ({unit})" for axis, name in zip("xy", names, strict=True)})
    legend(axes)
    figure.colorbar(lines, ax=axes, label="time (s)")
    figure.suptitle("{}: orbit of {}, seen down the hole".format(*orbit.place))
    return figure


def whirl_figure(orbit):
    """See `Whirl.plot`."""
    _refuse_short(orbit, "whirl")
    t = orbit.times
    figure, (above, middle, below) = stacked(10, (2.4, 2.4, 2.4))
    heading, size = scale(_DISTANCE)
    above.plot(t, orbit.radius / size, color="tab:blue", lw=0.9, label="radius")
    above.plot(t, orbit.clearance / size, color="peru", lw=1.6, label="clearance")
    above.set_ylabel(heading)
    at, rate, spin, radius = orbit._means(round(1 / _WINDOW), 0.5)
    spin = np.abs(spin)
    heading, size = scale(_RATE)
    middle.plot(at, rate / size, color="tab:red", label="whirl")
    middle.plot(at, spin / size, color="tab:blue", label="spin")
    near = radius > _NEAR_WALL * orbit.clearance.min()
    if near.any():
        rolling = -orbit.contact_radius / np.maximum(radius, _NEAR_WALL * orbit.clearance.min()) * spin
        middle.plot(at, np.where(near, rolling, np.nan) / size, "--", color="black", lw=1.6,
                    label="rolling without slip")  # fmt: skip
    middle.set_ylabel(heading)
    heading, size = scale(_NORMAL, orbit.normal)
    below.plot(t, orbit.normal / size, color="tab:brown", lw=0.9)
    below.set(xlabel="time (s)", ylabel=heading)
    for axes in (above, below):
        axes.set_ylim(0.0, 1.05 * axes.get_ylim()[1])
    legend(above, middle)
    figure.suptitle("{}: whirl of {}".format(*orbit.place))
    return figure


def _check_run_up(orbit):
    speed = np.abs(orbit.spin)
    if len(orbit.times) < _LEAST:
        raise SceneError(f"Campbell diagram: expected a motion with at least {_LEAST} times, not {len(orbit)}")
    if np.ptp(speed) < _CONSTANT * speed.max() or speed.max() == 0:
        raise SceneError(
            f"Campbell diagram: expected a run-up; the spin of {orbit.place[1]} stays from {speed.min():.4g} to "
            f"{speed.max():.4g} rad/s: see History.plot_whirl"
        )


def campbell_figure(orbit):
    """Above, the amplitude of whirl over the speed of rotation; below, the spectrum over that speed: rates of the
    section's axis, forward (positive) and backward, with lines for the speed of rotation itself, forward and backward,
    and for rolling without slip."""
    _check_run_up(orbit)
    at, amplitude, speed, rates = spectra(orbit)
    order = np.argsort(speed)
    touches = np.nan_to_num(orbit.normal).any()
    rolling = orbit.contact_radius / float(orbit.clearance.min())
    reach = (1.25 * rolling if touches else 2.5) * float(speed.max())
    figure, (above, below) = stacked(9, (2.3, 4.6))
    (along, turning), (heading, size) = scale(_SPEED), scale(_DISTANCE)
    x = np.interp(orbit.times, at, speed) / turning
    ends = np.array([x.min(), x.max()])
    above.plot(x, orbit.radius / size, color="tab:blue", lw=0.7, label="radius")
    above.plot(ends, np.full(2, orbit.clearance.min()) / size, color="peru", lw=1.6, label="clearance")
    above.set_ylabel(heading)
    shown = np.abs(rates) <= reach
    level = 20 * np.log10(np.maximum(amplitude[order][:, shown] / amplitude.max(), _FLOOR))
    drawn = below.pcolormesh(
        speed[order] / turning, rates[shown] / turning, level.T, shading="nearest", cmap="Greys", rasterized=True
    )
    figure.colorbar(drawn, ax=below, label=f"amplitude (dB of {amplitude.max() / size:.3g} {unit_of(_DISTANCE)[0]})")
    lines = [(1, "rotation, forward", "tab:blue"), (-1, "rotation, backward", "tab:cyan")]
    lines += [(-rolling, "rolling without slip", "tab:red")] if touches else []
    for factor, label, colour in lines:
        below.plot(ends, factor * ends, "--", color=colour, label=label)
    most = reach if not touches else 2.5 * speed.max()
    below.set(xlabel=along, ylabel=scale(_OF_AXIS)[0], xlim=ends, ylim=(-reach / turning, most / turning))
    below.grid(visible=False)
    legend(above, below)
    figure.suptitle("{}: run-up, {}".format(*orbit.place))
    return figure


def spectra(orbit):
    """Spectra of an `Orbit` in overlapping windows of its duration: at (m,): middles, s; amplitude (m, k): radius of a
    circle at each rate, m; speed (m,): size of the mean spin, rad/s; rates (k,): ascending, rad/s, positive in the
    direction of the spin. The windows' length T is that in which a rate that grows with the spin, by a in a unit of
    time, changes by as much as T resolves: a T = 2 pi/T."""
    count = len(orbit.times)
    t = np.linspace(orbit.times[0], orbit.times[-1], count)
    x, y = (np.interp(t, orbit.times, values) for values in orbit.position.T)
    spin = np.interp(t, orbit.times, orbit.spin)
    z = x + 1j * y * (-1.0 if spin.mean() < 0 else 1.0)
    best = np.sqrt(2 * np.pi / max(np.ptp(orbit.spin) * (t[-1] - t[0]), 1e-300))
    size = round(count * min(max(best, _SHORTEST), _LONGEST))
    window = np.hanning(size)
    starts = np.arange(0, count - size + 1, max(1, size // _OVERLAP))
    rows = starts[:, None] + np.arange(size)
    found = np.fft.fftshift(np.fft.fft(z[rows] * window, _FINER * size, axis=1), axes=1)
    rates = np.fft.fftshift(np.fft.fftfreq(_FINER * size, t[1] - t[0])) * 2 * np.pi
    return t[rows].mean(axis=1), np.abs(found) / window.sum(), np.abs(spin[rows].mean(axis=1)), rates


# The markers of unstable states, and the room above the highest frequency.
_UNSTABLE, _ROOM = {"marker": "x", "color": "tab:red", "ls": "", "label": "grows"}, 1.08


def modes_figure(found, seen, orders):
    """See `ModesAlong.plot`."""
    figure, (above, below) = stacked(7.5, (3.2, 1.8))
    known, over = found.quantities, found.value(found._over)
    quantity = known["frequency" if seen == "rotating" else "inertial_frequency"]
    frequencies, growth = quantity.of(found), known["growth_rate"].of(found)
    unsure = found.in_turn(np.array([x.unsure for x in found.modes]))
    growth = np.where(np.abs(growth) > unsure, growth, 0.0)
    along, size = scale(known[found._over], over)
    heading, of_frequency = scale(quantity, frequencies)
    grows = found.in_turn(np.array([np.isin(x.kind, ("flutter", "divergence")) for x in found.modes]))
    for k in range(frequencies.shape[1]):
        for axes, values in ((above, frequencies / of_frequency), (below, growth)):
            axes.plot(over / size, values[:, k], color=COLOURS[k % len(COLOURS)])
            axes.plot(over[grows[:, k]] / size, values[grows[:, k], k], **_UNSTABLE)
    top = _ROOM * np.nanmax(frequencies, initial=0.0) / of_frequency
    if found._over == "rate":
        for order in orders:
            above.plot(over / size, order * over / (2 * np.pi) / of_frequency, ":", color=GREY, lw=0.8)
            end = min(over[-1], 2 * np.pi * top * of_frequency / order)
            at = end / size, order * end / (2 * np.pi) / of_frequency
            above.annotate(f"{order} x", at, (-6, 2), textcoords="offset points", ha="right", va="bottom", color=GREY)
    above.set(ylabel=heading, ylim=(0, top or 1.0))
    below.set(ylabel=scale(known["growth_rate"], growth)[0], xlabel=along)
    handles, labels = above.get_legend_handles_labels()
    if grows.any():
        above.legend(handles[:1], labels[:1])
    figure.suptitle(f"{found.scene.title or 'Modes'}: {frequencies.shape[1]} modes" + (
        f", seen in the {seen} frame" if found.rotates else ""
    ))  # fmt: skip
    return figure
