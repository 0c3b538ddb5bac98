"""Charts of a motion, by matplotlib: its energies; a section in its hole: orbit, whirl and Campbell diagram."""

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.pictures.charts import draw_chart, empty_figure

_CURVES = (
    ("kinetic", "kinetic", "tab:blue", "-"),
    ("strain", "strain", "tab:orange", "-"),
    ("energy", "kinetic + strain", "black", "-"),
    ("work", "work of loads and supports", "tab:green", "--"),
    ("dissipated", "dissipated", "tab:red", "--"),
)


def draw_energy(history, file=None):
    """Draw the energies of a `History` over time above, and the error of the energy balance below.

    Args:
        history: with at least two times.
        file: .png, .pdf or another format of matplotlib (rank 0 writes); None returns the Figure.

    Raises:
        SceneError: fewer than two times, an unknown ending, or matplotlib is missing.
        OSError: the file cannot be written.
    """
    if len(history) < 2:
        raise SceneError("chart of energies: expected a history with at least two times")
    return draw_chart(lambda: _energy(history), file, history.comm)


def _energy(history):
    figure = empty_figure(11, 6)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    for name, label, colour, style in _CURVES:
        values = getattr(history, name)
        if np.abs(values).max() > 0:
            above.plot(history.times, values, style, color=colour, label=label)
    above.set_ylabel("energy (J)")
    above.set_title(f"{history.scene.title or 'Motion'}: energy, scheme {history.scheme}")
    above.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)  # beside the axes, not over the curves
    below.plot(history.times, history.balance, color="black")
    below.set_ylabel("not accounted\nfor (J)")
    below.set_xlabel("time (s)")
    for axes in (above, below):
        axes.grid(alpha=0.3)
    return figure


_RPM, _MM, _KILO = 30 / np.pi, 1e3, 1e-3
# Shares of the duration over which rates are taken in the chart, so that it shows no single impacts.
_WINDOW = 0.01
# The rate of rolling is drawn where the mean radius is above this share of the clearance.
_NEAR_WALL = 0.95
_GREY = "0.45"


def draw_orbit(history, orbit, station, file=None):
    """Draw the way of a section's axis as seen down the hole, coloured by time, in the circle of the clearance.

    Args:
        history: the `History`; orbit: an `Orbit` of it at `station`.
        file: .png, .pdf or another format of matplotlib (rank 0 writes); None returns the Figure.

    Raises:
        SceneError: fewer than two times, an unknown ending, or matplotlib is missing.
        OSError: the file cannot be written.
    """
    _check(history, "orbit")
    return draw_chart(lambda: _orbit(history, orbit, station), file, history.comm)


def _orbit(history, orbit, station):
    from matplotlib.collections import LineCollection

    figure = empty_figure(7.5, 6.2)
    axes = figure.subplots()
    up, right = (orbit.position * _MM).T
    points = np.column_stack([right, up])
    lines = LineCollection(np.stack([points[:-1], points[1:]], axis=1), array=orbit.times[1:], cmap="viridis", lw=1.0,
                           zorder=3)  # fmt: skip
    axes.add_collection(lines)
    angle = np.linspace(0, 2 * np.pi, 361)
    for size, style, label in zip(
        sorted({float(x) for x in (orbit.clearance.min(), orbit.clearance.max())}),
        ("-", "--"),
        ("clearance", "largest clearance"),
        strict=False,
    ):
        axes.plot(
            size * _MM * np.sin(angle), size * _MM * np.cos(angle), style, color="peru", lw=4, alpha=0.5, label=label
        )
    axes.plot(0, 0, "+", color=_GREY, label="axis of the hole")
    reach = 1.08 * _MM * max(float(orbit.clearance.max()), float(orbit.radius.max()))
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    names = ("towards east", "towards north") if orbit.vertical else ("to the right", "towards the high side")
    axes.set(**{f"{axis}label": f"{name} (mm)" for axis, name in zip("xy", names, strict=True)})
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    figure.colorbar(lines, ax=axes, label="time (s)")
    figure.suptitle(f"{_title(history)}: orbit of {station}, seen down the hole")
    return figure


def draw_whirl(history, orbit, station, file=None):
    """Draw radius, rates of whirl and spin, and the normal force of the wall over time.

    Args and raises as of `draw_orbit`.
    """
    _check(history, "whirl")
    return draw_chart(lambda: _whirl(history, orbit, station), file, history.comm)


def _whirl(history, orbit, station):
    t, figure = orbit.times, empty_figure(10, 8)
    above, middle, below = figure.subplots(3, 1, sharex=True)
    above.plot(t, orbit.radius * _MM, color="tab:blue", lw=0.9, label="radius")
    above.plot(t, orbit.clearance * _MM, color="peru", lw=1.6, label="clearance")
    above.set_ylabel("distance from the\naxis of the hole (mm)")
    at, rate, spin, radius = rates(orbit)
    middle.plot(at, rate * _RPM, color="tab:red", lw=1.2, label="whirl")
    middle.plot(at, spin * _RPM, color="tab:blue", lw=1.2, label="spin")
    near = radius > _NEAR_WALL * orbit.clearance.min()
    if near.any():
        rolling = -orbit.contact_radius / np.maximum(radius, _NEAR_WALL * orbit.clearance.min()) * spin
        middle.plot(
            at, np.where(near, rolling, np.nan) * _RPM, "--", color="black", lw=1.6, label="rolling\nwithout slip"
        )
    middle.set_ylabel("rate, forward in the\ndirection of the spin (rpm)")
    below.plot(t, orbit.normal * _KILO, color="tab:brown", lw=0.9)
    below.set_ylabel("normal force of the\nwall on a node (kN)")
    below.set_xlabel("time (s)")
    for axes in (above, middle, below):
        axes.grid(alpha=0.3)
        axes.margins(x=0.0)
    for axes in (above, below):
        axes.set_ylim(bottom=0.0)
    for axes in (above, middle):
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
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


def _check(history, what):
    if len(history) < 2:
        raise SceneError(f"chart of {what}: expected a history with at least two times")


def _title(history):
    return history.scene.title or "Motion"


# A run-up changes the speed by more than this share of the largest.
_CONSTANT = 0.05
# Least number of times; shares of the duration that a window has at least and at most; windows that overlap at a time;
# amplitudes below this share of the largest are not told apart; values of the transform per independent one.
_LEAST, _SHORTEST, _LONGEST, _OVERLAP, _FLOOR, _FINER = 200, 1 / 40, 1 / 4, 8, 1e-3, 4


def draw_campbell(history, orbit, station, file=None, *, reach=None):
    """Draw the amplitude of whirl over the speed of rotation above, and below, the spectrum over that speed: rates of
    rotation of the section's axis, forward (positive) and backward, with lines for the speed of rotation itself,
    forward and backward, and for rolling without slip.

    Args:
        history: the `History`; orbit: an `Orbit` of it at `station`.
        file: .png, .pdf or another format of matplotlib (rank 0 writes); None returns the Figure.
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
    return draw_chart(lambda: _campbell(history, orbit, station, reach), file, history.comm)


def _campbell(history, orbit, station, reach):
    at, amplitude, speed, rates = spectra(orbit)
    order = np.argsort(speed)
    touches = np.nan_to_num(orbit.normal).any()
    rolling = orbit.contact_radius / float(orbit.clearance.min())
    reach = reach or (1.25 * rolling if touches else 2.5) * float(speed.max())
    figure = empty_figure(9, 8)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1, 2))
    x = np.interp(orbit.times, at, speed) * _RPM
    ends = np.array([x.min(), x.max()])
    above.plot(x, orbit.radius * _MM, color="tab:blue", lw=0.7, label="radius")
    above.plot(ends, np.full(2, orbit.clearance.min()) * _MM, color="peru", lw=1.6, label="clearance")
    above.set_ylabel("distance from the\naxis of the hole (mm)")
    shown = np.abs(rates) <= reach
    level = 20 * np.log10(np.maximum(amplitude[order][:, shown] / amplitude.max(), _FLOOR))
    drawn = below.pcolormesh(
        speed[order] * _RPM, rates[shown] * _RPM, level.T, shading="nearest", cmap="Greys", rasterized=True
    )
    figure.colorbar(drawn, ax=below, label=f"amplitude (dB of {amplitude.max() * _MM:.3g} mm)")
    lines = [(1, "rotation, forward", "tab:blue"), (-1, "rotation, backward", "tab:cyan")]
    lines += [(-rolling, "rolling without slip", "tab:red")] if touches else []
    for factor, label, colour in lines:
        below.plot(ends, factor * ends, "--", color=colour, lw=1.2, label=label)
    below.set(xlabel="speed of rotation (rpm)", ylabel="rate of the section's axis,\nforward positive (rpm)")
    below.set(xlim=ends, ylim=(-reach * _RPM, (reach if not touches else 2.5 * speed.max()) * _RPM))
    above.grid(alpha=0.3)
    for axes in (above, below):
        axes.legend(frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    figure.suptitle(f"{history.scene.title or 'Motion'}: run-up, {station}")
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
