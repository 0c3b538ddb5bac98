"""Axes of drawings: round limits, and ticks as texts in a suitable unit of length."""

import itertools
import math
from dataclasses import dataclass

import numpy as np

_UNITS = ((2e4, 1e3, "km"), (0.05, 1.0, "m"), (5e-5, 1e-3, "mm"), (5e-8, 1e-6, "µm"), (0.0, 1e-9, "nm"))
# At most this many intervals between ticks on the longest axis; a flat axis extends by this share of the longest.
_INTERVALS, _FLAT = 6, 0.03
# Pixels: length of a tick, shortest axis that is labelled, distance of the axes from the box, for signs of supports.
_TICK, _SEEN, _ASIDE = 8, 20, 26


@dataclass(frozen=True)
class Axis:
    """An axis of the box around a drawing.

    Attributes:
        name: with the unit; low, high: m; ticks: (position in m, text), none where the drawing is flat.
    """

    name: str
    low: float
    high: float
    ticks: tuple


def axes_of(points):
    """The three `Axis` of a drawing of points (n, 3), m."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low).max())
    scale, unit = next((scale, unit) for least, scale, unit in _UNITS if size >= least)
    step = round_step(size, _INTERVALS)
    first, last = np.floor(low / step + 1e-9), np.ceil(high / step - 1e-9)
    return tuple(
        _axis(f"{name} ({unit})", int(a), int(b), step, scale, size) if b > a else _flat(f"{name} ({unit})", x, size)
        for name, a, b, x in zip("xyz", first, last, (low + high) / 2, strict=True)
    )


def _axis(name, first, last, step, scale, size):
    return Axis(
        name,
        first * step,
        last * step,
        tuple((k * step, text_of(k * step, step, scale)) for k in range(first, last + 1)),
    )


def _flat(name, middle, size):
    return Axis(name, middle - _FLAT * size, middle + _FLAT * size, ())


def draw_axes(plotter, pyvista, axes, view, labels):
    """Draw the edges of the box that carry ticks, outside in the picture: z at the left, x and y below; and the floor
    of a box that is not flat.

    Args:
        axes: three `Axis`. view: the `View`. labels: the `Labels` that its texts join.
    """
    font = max(9, round(view.window[1] / 55))
    corner = {(i, end): getattr(axes[i], end) for i in range(3) for end in ("low", "high")}
    lines = []
    middle = view.pixels([(axis.low + axis.high) / 2 for axis in axes])
    names = []
    for i, axis in enumerate(axes):
        if not axis.ticks:
            continue
        j, k = (i + 1) % 3, (i + 2) % 3
        edges = []
        for ends in itertools.product(("low", "high"), repeat=2):
            edge = np.empty((2, 3))
            edge[:, i], edge[:, j], edge[:, k] = (axis.low, axis.high), corner[j, ends[0]], corner[k, ends[1]]
            edges.append(edge)
        x, y = np.moveaxis(view.pixels(edges).mean(axis=1), -1, 0)
        edge = edges[int(np.argmin(x if i == 2 else y + 1e-3 * x))]
        along = np.diff(view.pixels(edge), axis=0)[0]
        if np.linalg.norm(along) < _SEEN:  # the view is along this axis
            continue
        out = np.array([along[1], -along[0]]) / np.linalg.norm(along)
        out *= np.sign(out @ (view.pixels(edge).mean(axis=0) - middle)) or 1.0
        edge = edge + view.offset(*(_ASIDE * out))
        lines.append(edge)
        longest = max(len(text) for _, text in axis.ticks)
        room = font * (0.28 * longest * abs(out[0]) + 0.55 * abs(out[1]))
        for value, text in axis.ticks:
            point = edge[0].copy()
            point[i] = value
            lines.append(np.array([point, point + view.offset(*(-_TICK * out))]))
            labels.fix(text, point, size=font, away=(font / 2 + room) * out)
        away = (font / 2 + 2 * room + font * (0.35 * len(axis.name) * abs(out[0]) + abs(out[1]))) * out
        names.append((axis.name, edge.mean(axis=0), away))
    for name, point, away in names:
        labels.fix(name, point, size=font, away=away)
    if np.abs(view.to_camera).max() < 1:  # seen obliquely
        (x0, x1), (y0, y1), z = *((axis.low, axis.high) for axis in axes[:2]), axes[2].low
        floor = np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z], [x0, y0, z]])
        plotter.add_mesh(pyvista.lines_from_points(floor), color="lightgrey", line_width=1)
    for line in lines:
        plotter.add_mesh(pyvista.Line(*line), color="dimgrey", line_width=1)


def round_step(size, most):
    """The least of 1, 2 and 5 times a power of ten that divides `size` into at most `most` intervals."""
    decade = 10.0 ** math.floor(math.log10(size / most))
    return next(f * decade for f in (1, 2, 5, 10) if size / (f * decade) <= most * (1 + 1e-9))


def text_of(value, step, scale=1.0):
    """A tick's value, a multiple of `step`, in a unit of size `scale`, with the digits that the step needs."""
    digits = max(0, -math.floor(math.log10(step / scale) + 1e-9))
    text = f"{value / scale:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0 else text
