"""Charts of a section in its hole, by matplotlib: its orbit; radius, rates and contact force over time."""

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.pictures.figures import draw_chart, empty_figure

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
