"""The Campbell diagram of a section in its hole over a run-up, by matplotlib."""

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.pictures.figures import draw_chart, empty_figure

_RPM, _MM = 30 / np.pi, 1e3
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
    return draw_chart(lambda: _figure(history, orbit, station, reach), file, history.comm)


def _figure(history, orbit, station, reach):
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
