"""Charts of a motion, by matplotlib: its energies; a section in its hole: orbit, whirl and Campbell diagram.

All take a file (.png, .pdf or another format of matplotlib, which rank 0 writes; None returns the Figure), and `look`:
the width and the units of `charts.draw_chart`.
"""

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.pictures.charts import (
    GREY,
    draw_chart,
    empty_figure,
    ledger,
    legend,
    room_for,
    scale,
    stacked,
    unit_of,
)
from cosserat_fenicsx.quantities import Quantity

_CURVES = (
    ("kinetic", "kinetic", "tab:blue", "-"),
    ("strain", "strain", "tab:orange", "-"),
    ("energy", "kinetic + strain", "black", "-"),
    ("work", "work of loads and supports", "tab:green", "--"),
    ("dissipated", "dissipated", "tab:red", "--"),
)
_DISTANCE = Quantity("distance from the axis of the hole", unit="m", shown="mm", dimension="diameter")
_RATE = Quantity("rate, forward in the direction of the spin", unit="rad/s", shown="rpm")
_OF_AXIS = Quantity("rate of the section's axis, forward positive", unit="rad/s", shown="rpm")
_SPEED = Quantity("speed of rotation", unit="rad/s", shown="rpm")
_NORMAL = Quantity("normal force of the wall on a node", unit="N", dimension="force")
# Shares of the duration over which rates are taken in the chart, so that it shows no single impacts.
_WINDOW = 0.01
# The rate of rolling is drawn where the mean radius is above this share of the clearance.
_NEAR_WALL = 0.95
# A run-up changes the speed by more than this share of the largest.
_CONSTANT = 0.05
# Least number of times; shares of the duration that a window has at least and at most; windows that overlap at a time;
# amplitudes below this share of the largest are not told apart; values of the transform per independent one.
_LEAST, _SHORTEST, _LONGEST, _OVERLAP, _FLOOR, _FINER = 200, 1 / 40, 1 / 4, 8, 1e-3, 4


def draw_energy(history, file=None, **look):
    """Draw the energies of a `History` over time above, and the error of the energy balance below.

    Raises:
        SceneError: fewer than two times, an unknown ending, or matplotlib is missing.
        OSError: the file cannot be written.
    """
    _check(history, "energies")
    curves = [(label, getattr(history, name), *style) for name, label, *style in _CURVES]
    title = f"{_title(history)}: energy, scheme {history.scheme}"
    return draw_chart(lambda: ledger(history.times, curves, history.balance, title), file, history.comm, **look)


def draw_orbit(history, orbit, station, file=None, **look):
    """Draw the way of a section's axis as seen down the hole, coloured by time, in the circle of the clearance.

    Args:
        history: the `History`; orbit: an `Orbit` of it at `station`.

    Raises:
        SceneError: fewer than two times, an unknown ending, or matplotlib is missing.
        OSError: the file cannot be written.
    """
    _check(history, "orbit")
    return draw_chart(lambda: _orbit(history, orbit, station), file, history.comm, **look)


def _orbit(history, orbit, station):
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
    figure.suptitle(f"{_title(history)}: orbit of {station}, seen down the hole")
    return figure


def draw_whirl(history, orbit, station, file=None, **look):
    """Draw radius, rates of whirl and spin, and the normal force of the wall over time.

    Args and raises as of `draw_orbit`.
    """
    _check(history, "whirl")
    return draw_chart(lambda: _whirl(history, orbit, station), file, history.comm, **look)


def _whirl(history, orbit, station):
    t = orbit.times
    figure, (above, middle, below) = stacked(10, (2.4, 2.4, 2.4))
    heading, size = scale(_DISTANCE)
    above.plot(t, orbit.radius / size, color="tab:blue", lw=0.9, label="radius")
    above.plot(t, orbit.clearance / size, color="peru", lw=1.6, label="clearance")
    above.set_ylabel(heading)
    at, rate, spin, radius = rates(orbit)
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
    figure.suptitle(f"{_title(history)}: whirl of {station}")
    return figure


def rates(orbit, windows=round(1 / _WINDOW)):
    """Rates of an `Orbit` in parts of its duration.

    Returns:
        at, rate, spin, radius: (m,) middle (s), rate of whirl (rad/s, forward positive; NaN where the section has no
        angle), spin (its size, rad/s) and mean radius (m) of up to `windows` parts.
    """
    edges = np.unique(np.linspace(0, len(orbit.times) - 1, min(windows, len(orbit.times) - 1) + 1).astype(int))
    lengths, steps, turns = np.diff(orbit.times), orbit.steps, orbit.turns
    first = edges[:-1]

    def whole(values):
        return np.add.reduceat(values, first)

    counted, duration = whole(lengths * turns), whole(lengths)
    rate = np.divide(whole(steps), counted, out=np.full(len(first), np.nan), where=counted > duration / 2)
    spin, radius = (whole(lengths * (x[1:] + x[:-1]) / 2) / duration for x in (orbit.spin, orbit.radius))
    at = (orbit.times[edges[1:]] + orbit.times[first]) / 2
    return at, rate * np.where(spin < 0, -1.0, 1.0), np.abs(spin), radius


def draw_campbell(history, orbit, station, file=None, *, reach=None, **look):
    """Draw the amplitude of whirl over the speed of rotation above, and below, the spectrum over that speed: rates of
    rotation of the section's axis, forward (positive) and backward, with lines for the speed of rotation itself,
    forward and backward, and for rolling without slip.

    Args:
        history: the `History`; orbit: an `Orbit` of it at `station`.
        reach: largest rate, rad/s; None for what contains the rolling or twice the rotation.

    Raises:
        SceneError: the speed of rotation hardly changes, too few times, an unknown ending, or matplotlib is missing.
        OSError: the file cannot be written.
    """
    speed = np.abs(orbit.spin)
    if len(orbit.times) < _LEAST:
        raise SceneError(f"Campbell diagram: expected a motion with at least {_LEAST} times, not {len(history)}")
    if np.ptp(speed) < _CONSTANT * speed.max() or speed.max() == 0:
        raise SceneError(
            f"Campbell diagram: expected a run-up; the spin of {station} is {speed.min():.4g} to {speed.max():.4g} "
            "rad/s all the time: see History.plot_whirl"
        )
    return draw_chart(lambda: _campbell(history, orbit, station, reach), file, history.comm, **look)


def _campbell(history, orbit, station, reach):
    at, amplitude, speed, rates = spectra(orbit)
    order = np.argsort(speed)
    touches = np.nan_to_num(orbit.normal).any()
    rolling = orbit.contact_radius / float(orbit.clearance.min())
    reach = reach or (1.25 * rolling if touches else 2.5) * float(speed.max())
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
    figure.suptitle(f"{_title(history)}: run-up, {station}")
    return figure


def spectra(orbit):
    """Spectra of an `Orbit` in overlapping windows of its duration.

    Their length T is that in which a rate that grows with the spin, by a in a unit of time, changes by as much as
    T resolves: a T = 2 pi/T.

    Returns:
        at (m,): middles, s; amplitude (m, k): radius of a circle at each rate, m; speed (m,): size of the mean spin,
        rad/s; rates (k,): ascending, rad/s, positive in the direction of the spin.
    """
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


def _check(history, what):
    if len(history) < 2:
        raise SceneError(f"chart of {what}: expected a history with at least two times")


def _title(history):
    return history.scene.title or "Motion"
