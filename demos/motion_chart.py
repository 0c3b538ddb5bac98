"""A motion in three panels: shapes over time, a curve, energies."""

from collections import namedtuple
from pathlib import Path

import numpy as np

from cosserat_fenicsx.pictures.charts import draw_chart, empty_figure, legend

#: The first panel: axes ("xy", "xz" or "xyz"), the station whose track is drawn, the last time (s) or None, and whether
#: the axes have different scales.
Shapes = namedtuple("Shapes", "axes station until stretched", defaults=(None, False))
#: The second panel: axes with units, and lines (label, x, y[, style]).
Curve = namedtuple("Curve", "xlabel ylabel lines")
# Number of superposed shapes.
_SHAPES = 16


def draw(history, file, shapes, curve):
    """Write the picture of a `History`.

    Args:
        history: a `History`.
        file: a .png.
        shapes: see `Shapes`; curve: see `Curve`.
    """
    Path(file).parent.mkdir(parents=True, exist_ok=True)
    draw_chart(lambda: _figure(history, shapes, curve), file, history.comm)


def _figure(history, shapes, curve):
    figure = empty_figure(14, 6.5)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.4, 1))
    figure.suptitle(history.scene.title)
    _draw_shapes(figure, grid[:, 0], history, shapes)
    above, below = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
    for label, x, y, *style in curve.lines:
        above.plot(x, y, *style, label=label, lw=1.2)
    above.set(xlabel=curve.xlabel, ylabel=curve.ylabel)
    for name, colour in (
        ("kinetic", "tab:blue"),
        ("strain", "tab:orange"),
        ("energy", "black"),
        ("work", "tab:green"),
        ("dissipated", "tab:red"),
    ):
        values = getattr(history, name)
        if np.abs(values).max() > 0:
            label = "kinetic + strain" if name == "energy" else name
            below.plot(
                history.times,
                values,
                "--" if name in ("work", "dissipated") else "-",
                color=colour,
                label=label,
                lw=1.2,
            )
    below.set(xlabel="time (s)", ylabel="energy (J)")
    for axes in (above, below):
        legend(axes)
    return figure


def _draw_shapes(figure, place, history, shapes):
    from matplotlib import cm
    from matplotlib.colors import Normalize
    from matplotlib.ticker import MaxNLocator

    end = history.times[-1] if shapes.until is None else min(shapes.until, history.times[-1])
    picked = ["xyz".index(axis) for axis in shapes.axes]
    flat = len(picked) == 2
    axes = figure.add_subplot(place, projection=None if flat else "3d", **({} if flat else {"computed_zorder": False}))
    colours = cm.ScalarMappable(Normalize(0.0, end), "viridis")
    for t in np.linspace(0.0, end, _SHAPES):
        k = int(np.argmin(np.abs(history.times - t)))
        for rod in history.scene.rods:
            line, _ = history.sample(k, rod, np.linspace(0, 1, 101))
            axes.plot(*line[:, picked].T, color=colours.to_rgba(history.times[k]), lw=2)
    way = history.position(shapes.station)[history.times <= end]
    axes.plot(*way[:, picked].T, color="black", lw=0.7, alpha=0.7, label=f"way of {shapes.station}")
    axes.set(**{f"{name}label": f"{axis} (m)" for name, axis in zip("xyz", shapes.axes, strict=False)})
    if flat and not shapes.stretched:
        axes.set_aspect("equal")
    if not flat:
        ranges = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
        axes.set_box_aspect(np.ptp(ranges, axis=1), zoom=1.1)
        for axis, size in zip((axes.xaxis, axes.yaxis, axes.zaxis), np.ptp(ranges, axis=1), strict=True):
            axis.set_major_locator(MaxNLocator(max(2, round(6 * size / np.ptp(ranges, axis=1).max()))))
    legend(axes)
    figure.colorbar(
        colours,
        ax=axes,
        label="time of the shape (s)",
        shrink=0.7,
        location="left" if flat else "bottom",
        pad=0.02 if flat else 0.08,
    )
