"""Maps of stability over speed and weight, the Campbell diagram, and bit bounce, by matplotlib."""

import math

import numpy as np

from cosserat_fenicsx.pictures.figures import draw_chart, empty_figure
from cosserat_fenicsx.ranks import world

_RPM, _KILO = 30 / math.pi, 1e3
#: Panels of a map, of the modes that grow fastest; lines of a chart over the speed.
_PANELS, _LINES = 6, 8
_COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple", "tab:brown", "tab:pink", "tab:gray")
_STYLES = ("-", "--", ":")


def draw_stability(answer, file, mode):
    """See `Stability.plot`."""
    grid = len(answer.weights) > 1 and len(answer.speeds) > 1
    return draw_chart(lambda: (_maps if grid else _lines)(answer, _modes(answer, mode)), file, world())


def draw_campbell(answer, file):
    """See `Campbell.plot`."""
    return draw_chart(lambda: _campbell(answer), file, world())


def draw_bounce(answer, file):
    """See `BitBounce.plot`."""
    return draw_chart(lambda: _bounce(answer), file, world())


def _modes(answer, mode):
    """Which modes are drawn, by frequency: one, those that grow fastest, or the least damped one where none grows."""
    if mode is not None:
        return [mode]
    fastest = np.nanmax(answer.growth, axis=(0, 1))
    order = [int(k) for k in np.argsort(-fastest)]
    most = _PANELS if len(answer.weights) > 1 else _LINES
    return sorted([k for k in order if fastest[k] > 0][:most] or order[:1])


def _named(answer, k):
    middle = np.nanmedian(answer.frequency[:, :, k])
    return f"mode {k}, {middle:.3g} Hz"


def _maps(answer, modes):
    from matplotlib.colors import SymLogNorm

    columns = min(3, len(modes))
    rows = math.ceil(len(modes) / columns)
    figure = empty_figure(1.0 + 3.4 * columns, 0.9 + 2.7 * rows)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    speeds, weights = np.argsort(answer.speeds), np.argsort(answer.weights)
    largest = max(float(np.nanmax(np.abs(answer.growth[:, :, modes]))), 1e-12)
    scale = SymLogNorm(largest / 30, vmin=-largest, vmax=largest)  # so that the sign is seen near the limit
    for panel, k in zip(axes.flat, modes, strict=False):
        growth = answer.growth[np.ix_(speeds, weights, [k])][:, :, 0].T
        x, y = answer.speeds[speeds] * _RPM, answer.weights[weights] / _KILO
        drawn = panel.pcolormesh(x, y, growth, cmap="coolwarm", norm=scale, shading="nearest")
        known = np.nan_to_num(growth, nan=-largest)
        if (known > 0).any() and (known < 0).any():
            panel.contour(x, y, known, levels=[0.0], colors="black", linewidths=1.2)
        panel.set_title(_named(answer, k), fontsize=10)
    for panel in axes.flat[len(modes) :]:
        panel.set_visible(False)
    for panel in axes[-1]:
        panel.set_xlabel("speed (rpm)")
    for panel in axes[:, 0]:
        panel.set_ylabel("weight on bit (kN)")
    figure.colorbar(drawn, ax=axes, label="growth (1/s); black: the limit")
    return figure


def _lines(answer, modes):
    figure = empty_figure(7.0, 4.2)
    panel = figure.subplots()
    by_speed = len(answer.weights) == 1
    x = answer.speeds * _RPM if by_speed else answer.weights / _KILO
    order = np.argsort(x)
    for n, k in enumerate(modes):
        growth = (answer.growth[:, 0, k] if by_speed else answer.growth[0, :, k])[order]
        look = {"color": _COLOURS[n % len(_COLOURS)], "linestyle": _STYLES[n % len(_STYLES)]}  # some lie on each other
        panel.plot(x[order], growth, **look, label=_named(answer, k))
    panel.axhline(0.0, color="black", linewidth=0.8)
    panel.set(xlabel="speed (rpm)" if by_speed else "weight on bit (kN)", ylabel="growth (1/s)")
    panel.grid(alpha=0.3)
    panel.legend(fontsize=8)
    return figure


def _campbell(answer):
    figure = empty_figure(7.0, 5.0)
    panel = figure.subplots()
    fastest = answer.fastest * _RPM
    for n, (kind, frequencies) in enumerate(answer.frequencies.items()):
        for i, frequency in enumerate(frequencies):
            label = f"{kind} (natural)" if i == 0 else None
            panel.plot([0, fastest], [frequency] * 2, color=_COLOURS[n], linewidth=0.9, label=label)
    for n, (name, times) in enumerate(answer.excitations.items()):
        panel.plot([0, fastest], [0, times * fastest / 60], "--", color="black", linewidth=1.0 + 0.6 * n, label=name)
    marked = [(speed * _RPM, answer.excitations[name] * speed / (2 * math.pi))
              for (_, name), speeds in answer.critical_speeds().items() for speed in speeds]  # fmt: skip
    marked = [(x, y) for x, y in marked if y <= answer.up_to]
    if marked:
        panel.plot(*zip(*marked, strict=True), "o", color="tab:red", markersize=4, label="critical speeds")
    panel.set(xlabel="speed (rpm)", ylabel="frequency (Hz)", xlim=(0, fastest), ylim=(0, answer.up_to))
    figure.legend(fontsize=8, loc="outside upper center", ncols=5)
    return figure


def _bounce(answer):
    figure = empty_figure(7.0, 4.2)
    panel = figure.subplots()
    order = np.argsort(answer.speeds)
    x, y = answer.speeds[order] * _RPM, answer.amplitude[order] / _KILO
    weight = answer.scene.bit.weight / _KILO
    panel.plot(x, y, color="tab:blue", label="amplitude of the weight on bit")
    panel.axhline(weight, color="black", linestyle="--", label="static weight on bit")
    panel.fill_between(x, 0, 1, where=y > weight, transform=panel.get_xaxis_transform(), color="tab:red", alpha=0.15,
                       label="the bit lifts off")  # fmt: skip
    panel.set(xlabel="speed (rpm)", ylabel="weight (kN)", yscale="log", xlim=(x[0], x[-1]))
    panel.grid(alpha=0.3)
    panel.legend(fontsize=8)
    return figure
