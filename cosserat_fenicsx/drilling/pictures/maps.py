"""A quantity along a drill-string over time and depth, by matplotlib: depth runs downwards."""

import numpy as np

from cosserat_fenicsx.drilling.pictures.shown import SHOWN, alias, times_between, title_of, turns
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.pictures.figures import draw_chart, empty_figure
from cosserat_fenicsx.ranks import world

# At most so many depths are drawn; the colour of places that stick.
_DEPTHS, _STICKS = 500, "0.8"
# Part of the height in which a bit at rest is marked.
_BIT = 0.03


def draw_map(history, file, what=None, between=None):
    """See `DrillingHistory.plot_map`."""
    if what is None:
        what = "speed" if turns(history) else "velocity"
    if not isinstance(what, str) or what not in SHOWN:
        raise SceneError(f"plot_map.what = {what!r}: {nearest(what, SHOWN)}")
    rows = times_between("plot_map", history.profile_times, between)
    if np.isnan(getattr(history, what)).all():
        raise SceneError(
            f"plot_map.what = {what!r}: the {history.model} model has none: expected model='axial and torsional'"
        )
    return draw_chart(lambda: _map(history, rows, what), file, world())


def _map(history, rows, what):
    words, unit, factor, signed = SHOWN[what]
    places = np.unique(np.linspace(0, len(history.depths) - 1, _DEPTHS).astype(int))
    t, depths = history.profile_times[rows], history.depths[places]
    values = getattr(history, what)[rows][:, places].T * factor
    sticks = history.sticking[rows][:, places].T
    figure = empty_figure(10, 5.5)
    panel = figure.subplots()
    most, least = float(np.nanmax(values)), float(np.nanmin(values))
    signed = signed or least < -0.25 * most
    limits = (-max(most, -least), max(most, -least)) if signed else (min(least, 0.0), most)
    limits = limits if limits[1] > limits[0] else (0.0, 1.0)
    colours = panel.pcolormesh(t, depths, values, shading="nearest", cmap="coolwarm" if signed else "viridis",
                               vmin=limits[0], vmax=limits[1], rasterized=True)  # fmt: skip
    figure.colorbar(colours, ax=panel, label=f"{words} ({unit})")
    told = ""
    if sticks.any():
        from matplotlib.colors import ListedColormap

        panel.pcolormesh(t, depths, np.where(sticks, 1.0, np.nan), shading="nearest", cmap=ListedColormap([_STICKS]),
                         rasterized=True)  # fmt: skip
        told = "; grey: held by friction"
        if sticks[-1].any():  # a row of the map is too thin to be seen
            panel.fill_between(t, 0, _BIT, where=sticks[-1], transform=panel.get_xaxis_transform(), step="mid",
                               color=_STICKS, edgecolor="0.3", linewidth=0.3)  # fmt: skip
            told += " (at the lower edge: the bit)"
    panel.set(xlabel="time (s)", ylabel="measured depth (m)", ylim=(depths[-1], depths[0]), xlim=(t[0], t[-1]))
    caution = alias(history)
    told += f"\n{caution}" if caution else ""
    panel.set_title(f"{title_of(history)}{told}", fontsize=8 if caution else 11)
    return figure
