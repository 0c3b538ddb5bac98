"""A string in its hole in space, by pyvista, with radii and clearance enlarged."""

import math
from pathlib import Path

import numpy as np

from cosserat_fenicsx.checks import number, positive
from cosserat_fenicsx.pictures.charts import unit_of
from cosserat_fenicsx.pictures.drawing import colour_bar, load_pyvista, stage
from cosserat_fenicsx.pictures.plot import deliver
from cosserat_fenicsx.pictures.view import Axis, Labels, View, draw_axes, round_step, text_of
from cosserat_fenicsx.ranks import world
from cosserat_fenicsx.well.charts import (
    AT_POINTS, DEPTH, SIDE_FORCE, SIDES, depths_between, points_between, rows_between, shoes_between, title_of,
    usual_side_force,
)  # fmt: skip

# Height of the drawing and bounds of its width, pixels.
_HEIGHT, _WIDTHS = 1000, (560, 1300)
# Margins, pixels: left (numbers of depths), right (colour bar), top (title), bottom (names of axes).
_MARGINS = (290, 280, 170, 180)
# Bounds of a width that is asked for, pixels.
_LEAST, _MOST = 300, 4000
# Maximum intervals between the numbers of the longest axis.
_INTERVALS = 6


def draw_in_space(answer, file, enlarge, between, units, width=None):
    """See `TorqueAndDrag.plot_3d`."""
    if width is not None:
        width = number("plot_3d", "width", width, f"{_LEAST} to {_MOST} (pixels)", lambda x: _LEAST <= x <= _MOST)
    if enlarge is not None:
        positive("plot_3d", "enlarge", enlarge, "-")
    ends = depths_between("plot_3d", between, answer.depth)
    deliver(world(), Path(file), lambda: _draw(answer, enlarge, width, *ends), units)


def _draw(answer, enlarge, width, top, bottom):
    pyvista = load_pyvista()
    md = _places(answer.md, top, bottom)
    axis, radius = _picture(answer.hole.path.position(md)), answer.hole.at(md, "diameter") / 2
    whole = (top, bottom) == (0.0, answer.depth)
    size = float(np.ptp(axis, axis=0).max())
    if enlarge is None:
        shown = (0.015 if whole else 0.045) * size  # radius of the hole in the picture
        enlarge = max(1.0, float(f"{shown / radius.max():.1g}"))
    axes = axes_of(axis, enlarge * radius.max())
    view, scale = _view_of(axis, axes, width)
    plotter = stage(pyvista, view.window, smooth=None)
    tubes = enlarge * radius.max() > view.pixel
    if not tubes:  # of lines, parts shorter than pixels would be drawn as dots
        way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(axis, axis=0), axis=1)))
        some = np.unique(np.searchsorted(way, np.append(np.arange(0.0, way[-1], 3 * view.pixel), way[-1])))
        md, axis, radius = md[some], axis[some], radius[some]
    # what is shorter than the hole is wide in the picture would be a lump there
    half = enlarge * radius.max() * (3 if whole else answer.model != "rod")
    line = axis + enlarge * _picture(_mean(md, answer, answer.offset, half))
    thick = enlarge * (radius - _mean(md, answer, answer.clearance, half))
    _add_string(plotter, pyvista, answer, md, line, np.maximum(thick, 0.0), tubes, scale * _MARGINS[1])
    if tubes:
        _add_hole(plotter, pyvista, answer, md, axis, enlarge * radius)
    beside = enlarge * radius[:, None]
    beside = [axis + share * beside * way for share in (-1, -0.5, 0.5, 1) for way in (view.above, view.right)]
    surface = top == 0 and axes[2].high == axis[:, 2].max()
    outlines = _add_surroundings(plotter, pyvista, axes, axis, surface)
    labels = Labels(view, [axis, *beside])
    labels.keep_off(outlines)
    wide, high = view.window
    labels.reserve((wide - 0.85 * scale * _MARGINS[1], 0.15 * high), (wide, 0.85 * high))
    _add_title(plotter, answer, enlarge, title_of(answer, top, bottom), labels)
    draw_axes(plotter, pyvista, axes, view, labels, _font(view.window))
    _add_directions(axes, view, labels)
    _add_names(plotter, pyvista, answer, labels, view, (md, axis, line, enlarge * radius), (top, bottom))
    labels.draw(plotter, pyvista)
    view.place(plotter)
    return plotter


def _places(md, top, bottom):
    """Measured depths that are shown, m: from top to bottom, those of the answer and some between."""
    found = np.unique(np.concatenate([md[(md > top) & (md < bottom)], np.linspace(top, bottom, 400)]))
    return found[np.unique(np.linspace(0, len(found) - 1, min(len(found), 20000)).astype(int))]


def _at(md, answer, values):
    """Values (n,) or (n, 3) at the answer's depths, at other ones."""
    columns = [np.interp(md, answer.md, column) for column in np.atleast_2d(values.T)]
    return np.stack(columns, axis=-1) if values.ndim > 1 else columns[0]


def _mean(md, answer, values, half):
    """The same, as means over the length `half` (m) on both sides."""
    if not half:
        return _at(md, answer, values)
    pieces = np.diff(answer.md)[:, None] * (values[1:] + values[:-1]).reshape(len(values) - 1, -1) / 2
    summed = np.concatenate([np.zeros((1, pieces.shape[1])), np.cumsum(pieces, axis=0)]).reshape(values.shape)
    low, high = np.maximum(md - half, answer.md[0]), np.minimum(md + half, answer.md[-1])
    return ((_at(high, answer, summed) - _at(low, answer, summed)).T / (high - low)).T


def _picture(rows):
    """North, east, down as x to the east, y to the north, z upwards."""
    return np.stack([rows[..., 1], rows[..., 0], -rows[..., 2]], axis=-1)


def axes_of(points, room):
    """Three `Axis` around points (n, 3), m, with room beside them: to the east, to the north, and depth."""
    low, high = points.min(axis=0) - room, points.max(axis=0) + room
    if low[2] + 10 * room < high[2]:  # not horizontal
        high[2] = points[:, 2].max()  # the surface
    thin = np.maximum(0.15 * (high - low).max() - (high - low), 0.0) * (1, 1, 0) / 2  # to a minimum aspect of the box
    low, high = low - thin, high + thin
    unit, size = unit_of(DEPTH)
    found = []
    for name, a, b, sign, way in zip(
        ("east", "north", "depth"), low, high, (1, 1, -1), np.ptp(points, axis=0), strict=True
    ):
        if way < room:  # across the hole, whose radius is enlarged: a direction without numbers
            found.append(Axis(name, float(a), float(b), ()))
            continue
        step = min(round_step(float((high - low).max()) / size, _INTERVALS), round_step(float(b - a) / size, 3)) * size
        while len(ticks := _between(a, b, step)) < 2:  # one number is no scale
            step = round_step(step / size, 2.5) * size  # the next smaller one
        texts = tuple((float(x), text_of(sign * x, step, size)) for x in ticks)
        found.append(Axis(f"{name} ({unit})", float(a), float(b), texts))
    return tuple(found)


def _between(low, high, step):
    """The multiples of a step from low to high."""
    return step * np.arange(math.ceil(low / step - 1e-6), math.floor(high / step + 1e-6) + 1)


def _view_of(points, axes, wanted):
    """The `View` as large as the drawing of a box needs, or as wanted (pixels); and how many times as large."""
    main = points[-1, :2] - points[0, :2]
    main = main if np.linalg.norm(main) > 1e-9 else np.array([1.0, 0.0])
    # across the main direction, whose end is at the right, turned and raised
    across, raised = math.atan2(main[1], main[0]) - math.pi / 2 + math.radians(25), math.radians(14)
    level = math.cos(raised)
    to_camera = np.array([math.cos(across) * level, math.sin(across) * level, math.sin(raised)])
    up = np.array([0.0, 0.0, 1.0])
    right = np.cross(up, to_camera)
    right /= np.linalg.norm(right)
    above = np.cross(to_camera, right)
    corners = np.array(np.meshgrid(*((axis.low, axis.high) for axis in axes))).reshape(3, -1).T
    wide, high = np.ptp(corners @ right), np.ptp(corners @ above)
    left, beside, over, below = _MARGINS
    width = float(np.clip(_HEIGHT * wide / high, *_WIDTHS))
    pixel = max(wide / width, high / _HEIGHT)
    height = max(high / pixel, _WIDTHS[0])
    window = round(width + left + beside), round(height + over + below)
    focus = corners.mean(axis=0) + pixel * ((beside - left) / 2 * right + (over - below) / 2 * above)
    scale = wanted / window[0] if wanted else 1.0
    larger = tuple(round(scale * x) for x in window)
    return View(to_camera, right, above, up, focus, pixel * window[1] / 2, larger), scale


def _add_string(plotter, pyvista, answer, md, line, radius, tube, beside):
    """As a tube, or as a line where a tube were thinner than a pixel; beside: pixels for the colour bar."""
    distributed = answer.distributed_force
    unit, size = unit_of(SIDE_FORCE)
    force, rows = _at(md, answer, distributed) / size, rows_between(answer.md, md[0], md[-1])
    string = pyvista.MultipleLines(line)
    string["side force"], string["radius"] = force, radius
    usual = usual_side_force(answer, distributed[rows], answer.md[rows]) / size or force.max(initial=0.0)
    font = _font(plotter.window_size)
    room = max(2, min(8, int(0.5 * plotter.window_size[1] / (2 * font))))
    step = round_step(usual, room) if usual > 0 else 1.0
    most = math.ceil(usual / step - 1e-9) * step or step
    labels = round(most / step) + 1
    width = plotter.window_size[0]
    more = "\n(more: yellow)" if force.max(initial=0.0) > most else ""
    box = 1 - 0.75 * beside / width, 0.2, 0.4 * beside / width, 0.5
    bar = colour_bar(f"side force\n({unit}){more}", font, labels, step, box)
    if tube:
        string = string.tube(scalars="radius", absolute=True, n_sides=24)
    shading = {"smooth_shading": tube, "lighting": tube, "line_width": 4}
    plotter.add_mesh(string, scalars="side force", cmap="viridis", clim=(0.0, most), **shading, scalar_bar_args=bar)


def _add_hole(plotter, pyvista, answer, md, axis, radius):
    above = 0.0
    for section in answer.hole.sections:
        inside = (md >= above) & (md <= section.to)
        above = section.to
        if np.count_nonzero(inside) > 1:
            wall = pyvista.MultipleLines(axis[inside])
            wall["radius"] = radius[inside]
            wall = wall.tube(scalars="radius", absolute=True, n_sides=32)
            last = section is answer.hole.sections[-1]
            plotter.add_mesh(wall, color="peru" if last else "slategrey", opacity=0.2)


def _add_surroundings(plotter, pyvista, axes, axis, surface):
    """Draw the surface's outline and the well's shadow below; returns their lines (n, 3), m."""
    (x0, x1), (y0, y1), (low, high) = ((each.low, each.high) for each in axes)
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]])
    floor, outline = (np.column_stack([corners, np.full(5, z)]) for z in (low, high))
    lines = [floor]
    if surface:
        plotter.add_mesh(pyvista.lines_from_points(outline), color="darkseagreen", line_width=2)
        lines.append(outline)
    some = axis[np.unique(np.linspace(0, len(axis) - 1, 300).astype(int)), :2]
    if np.ptp(some, axis=0).max() > 0:
        shadow = np.column_stack([some, np.full(len(some), low)])
        plotter.add_mesh(pyvista.lines_from_points(shadow), color="silver", line_width=2)
        lines.append(shadow)
    return lines


def _add_directions(axes, view, labels):
    """Names of the directions across the hole, which have no numbers, behind the floor: the numbers are before it."""
    middle = np.array([(axes[0].low + axes[0].high) / 2, (axes[1].low + axes[1].high) / 2, axes[2].low])
    for i, names in enumerate((("west", "east"), ("south", "north"))):
        if not axes[i].ticks:
            ends = np.array([middle, middle])
            ends[:, i] = axes[i].low, axes[i].high
            k = int(np.argmax(view.pixels(ends)[:, 1]))
            labels.near(names[k], ends[k], ends[k] - middle, size=_font(view.window))


def _font(window):
    """Size of texts, pixels: they can be read where the picture is 400 pixels wide."""
    return round(window[0] / 42)


def _add_names(plotter, pyvista, answer, labels, view, lines, ends):
    """Spheres at forces at points, the largest with numbers; ends of sections; components of a part of the string."""
    md, axis, line, radius = lines
    font = _font(view.window)

    def at(depth, curve):
        return np.array([np.interp(depth, md, curve[:, i]) for i in range(3)])

    (unit, length), (force_unit, force_size) = unit_of(DEPTH), unit_of(AT_POINTS)
    points = points_between(answer, *ends)
    most = 3 if ends == (0.0, answer.depth) else 8
    told = sorted(points, key=lambda point: -point[1])[:most]
    for depth, force, side in points:  # labels down the string: their lines cross less
        centre, on = at(depth, axis), at(depth, line)
        size = max(0.35 * float(np.interp(depth, md, radius)), 4 * view.pixel)
        away = on - centre
        centre = on + away / (np.linalg.norm(away) or 1.0) * size
        plotter.add_mesh(pyvista.Sphere(radius=size, center=centre), color=SIDES[side].removeprefix("tab:"))
        if (depth, force, side) in told:
            text = f"{force / force_size:.3g} {force_unit} at {depth / length:.5g} {unit}"
            labels.near(text, centre, away, size=font)
    for depth, name in shoes_between(answer, *ends):
        labels.near(name, at(depth, axis), view.right, size=font, colour="saddlebrown")
    if ends != (0.0, answer.depth):
        for place in answer.laid:
            a, b = max(place.top, ends[0]), min(place.bottom, ends[1])
            if b > a:
                labels.near(place.component.name, at((a + b) / 2, axis), view.above, size=font, colour="dimgrey")


def _add_title(plotter, answer, enlarge, title, labels):
    """Two lines at the upper edge, which labels keep off."""
    how = f"radii and clearance {enlarge:g} times as large" if enlarge != 1 else "radii and clearance as they are"
    straight = "; its helix is drawn straight" if answer.model != "rod" and answer.helical.any() else ""
    lines, (width, height) = [title, how + straight], plotter.window_size
    wide = 0.62 * 2.2 * max(map(len, lines))  # pixels, of letters of the size 1
    size = round(min(0.45 * _font((width, height)), width / wide))
    plotter.add_text("\n".join(lines), font_size=size, color="black", position="upper_edge")
    labels.reserve((0, height - 2 * 2.2 * size), (width, height))
