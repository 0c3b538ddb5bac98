"""A motion in four panels: shapes over time; a curve; what is stored; works and losses."""

from collections import namedtuple
from functools import partial

import numpy as np

from cosserat_fenicsx.pictures.charts import draw_both, draw_chart, draw_energies, empty_figure, legend, room_for
from cosserat_fenicsx.pictures.motion_charts import energies_of

#: The first panel: axes ("xy", "xz" or "xyz"), the station whose track is drawn, the last time (s) or None, and whether
#: the axes have different scales.
Shapes = namedtuple("Shapes", "axes station until stretched", defaults=(None, False))
#: The second panel: axes with units, and lines (label, x, y[, style]).
Curve = namedtuple("Curve", "xlabel ylabel lines")
# Number of superposed shapes; extent, m, below which an axis is in mm; width, inches, for panels beside each other;
# width over the other extents of shapes that have a row of their own.
_SHAPES, _SMALL, _BESIDE, _WIDE = 16, 0.05, 7.0, 2.0


def draw(history, file, shapes, curve):
    """Write the picture of a `History`.

    Args:
        history: a `History`.
        file: a .png.
        shapes: see `Shapes`; curve: see `Curve`.
    """
    draw_both(partial(draw_chart, lambda: figure_of(history, shapes, curve)), file, history.comm)


def figure_of(history, shapes, curve):
    """The Figure."""
    stored, done = energies_of(history)
    count = 3 if any(values.any() for _, values, *_ in done) else 2
    narrow, flat, drawn = room_for(11) < _BESIDE, len(shapes.axes) == 2, _lines_of(history, shapes)
    width, *others = drawn.extent
    wide = not narrow and not shapes.stretched and width > _WIDE * max(others)
    if narrow and flat:
        figure = empty_figure(11, 4.2 + 2.2 * count)
        grid = figure.add_gridspec(1 + count, 1, height_ratios=[4.2] + [2.2] * count)
        first, *places = (grid[i] for i in range(1 + count))
    elif wide and flat:
        figure = empty_figure(11, 6.6)
        grid = figure.add_gridspec(2, count, height_ratios=(3.6, 2.4))
        first, *places = (grid[0, :], *(grid[1, i] for i in range(count)))
    else:
        figure = empty_figure(11, 4.2 + 2.2 * count if narrow else 5.6 if wide else 7.0)
        first, second = (figure.add_gridspec(2, 1, height_ratios=(4.2, 2.2 * count)) if narrow else
                         figure.add_gridspec(1, 2, width_ratios=(1.2, 1)))  # fmt: skip
        grid = second.subgridspec(count, 1)
        places = [grid[i] for i in range(count)]
    figure.suptitle(history.scene.title)
    _draw_shapes(figure, first, shapes, drawn, wide)
    above, *below = map(figure.add_subplot, places)
    for label, x, y, *style in curve.lines:
        above.plot(x, y, *style, label=label, lw=1.2)
    above.set(xlabel=curve.xlabel, ylabel=curve.ylabel)
    legend(above)
    draw_energies(below, history.times, stored, done)
    for panel in below:
        panel.set_xlabel("time (s)")
    return figure


#: What the first panel shows: colours over time, [(time, points (101, 3))] of shapes, the track (times, 3), the numbers
#: of the axes and the extent along each, m.
Drawn = namedtuple("Drawn", "colours lines way picked extent")


def _lines_of(history, shapes):
    """The `Drawn` of a history."""
    from matplotlib import cm
    from matplotlib.colors import Normalize

    end = history.times[-1] if shapes.until is None else min(shapes.until, history.times[-1])
    picked = ["xyz".index(axis) for axis in shapes.axes]
    rows = [int(np.argmin(np.abs(history.times - t))) for t in np.linspace(0.0, end, _SHAPES)]
    sampled = [(k, history.sample(k, rod, np.linspace(0, 1, 101))[0]) for k in rows for rod in history.scene.rods]
    lines, way = [(history.times[k], line) for k, line in sampled], history.position(shapes.station)
    way = way[history.times <= end]
    extent = np.ptp(np.concatenate([way, *(line for _, line in lines)]), axis=0)[picked]
    return Drawn(cm.ScalarMappable(Normalize(0.0, end), "viridis"), lines, way, picked, extent)


def _draw_shapes(figure, place, shapes, drawn, wide):
    from matplotlib.ticker import MaxNLocator

    colours, lines, way, picked, extent = drawn
    flat = len(picked) == 2
    axes = figure.add_subplot(place, projection=None if flat else "3d", **({} if flat else {"computed_zorder": False}))
    units = [("mm", 1e-3) if size < _SMALL else ("m", 1.0) for size in extent]
    sizes = np.array([size for _, size in units])
    for t, line in lines:
        axes.plot(*(line[:, picked] / sizes).T, color=colours.to_rgba(t), lw=2)
    axes.plot(*(way[:, picked] / sizes).T, color="black", lw=0.7, alpha=0.7, label=f"track of {shapes.station}")
    named = zip("xyz", shapes.axes, units, strict=False)
    axes.set(**{f"{name}label": f"{axis} ({unit})" for name, axis, (unit, _) in named})
    if flat and not shapes.stretched:
        axes.set_aspect("equal")
    if not flat:
        ranges = np.ptp([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()], axis=1)
        box = np.array([1.6, 1.0, 1.0]) if shapes.stretched else ranges * sizes
        long = box.max() / np.sort(box)[1]
        zoom = 0.9 if long < 2 or figure.get_figwidth() > _BESIDE else 1.1
        axes.set_box_aspect(box, zoom=zoom)
        axes.set_in_layout(False)  # matplotlib does not know where labels in space will be
        for axis, share in zip((axes.xaxis, axes.yaxis, axes.zaxis), box / box.max(), strict=True):
            axis.labelpad = 5.0 * long * share
            axis.set_major_locator(MaxNLocator(max(2, round(4 * share))))
    legend(axes)
    bar = {"location": "right", "pad": 0.02} if wide and flat else {"location": "bottom", "pad": 0.08 if flat else 0.12}
    figure.colorbar(colours, ax=axes, label="time of the shape (s)", shrink=0.8, **bar)
