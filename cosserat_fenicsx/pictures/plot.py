"""Pictures of the rods in space by pyvista (off-screen), deformed or before anything is solved; shapes that would be
tangled in one place are drawn beside each other."""

import itertools
import re
import textwrap
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosserat_fenicsx.checks import positive
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.new_files import replaced
from cosserat_fenicsx.pictures.charts import asked
from cosserat_fenicsx.pictures.drawing import (
    add_bodies,
    add_lines,
    add_tubes,
    at_rest,
    body_of,
    colour_of,
    default_colour,
    frame,
    known,
    letters,
    load_pyvista,
    peak_of,
    places,
    seen,
    stage,
    surface_of,
    swept,
    thickening,
    thicker,
    together,
    too_small,
)
from cosserat_fenicsx.pictures.signs import Deformed, Resting, signs_of, span_of, without_sign
from cosserat_fenicsx.pictures.view import Labels, axes_of, plain, seen_moving, view_of
from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.ranks import communicator, on_first

# Letters per line of the title; width and height of a picture, pixels; height of a line over that of its letters.
_TITLE_WIDTH, _WINDOW, _LINE = 60, (1400, 1000), 1.3
# Least lower and upper end of the colour bar, with its title, as shares of the height.
_BAR = (0.25, 0.75)
# Least and largest height of a picture, pixels.
_HEIGHTS = 740, 1000
# Height that labels above a drawing have, over that of letters.
_ABOVE = 2.6
# Sizes of names in a scene of many rods over those of other letters.
_SMALLER = 0.7
# Maximum number of rods that are named in the picture of a scene; maximum number of names in larger letters.
_NAMED, _FEW = 40, 8
_AT_REST = "#9db4cc"
# Distance of shapes, over the extent of a rod, below which they have one label.
_AT_ONE = 0.015
# Intervals on the longest axis, at most, around the first of shapes that are side by side.
_TICKS_APART = 4


def rods(path, file=None, points=None, magnify=1.0, color=None, side_by_side=None, units="SI"):
    """See `RodResult.plot`."""
    if len(path) == 0:
        raise SceneError("the path has no point to draw")
    positive("plot", "magnify", magnify, "-")
    if color is not None:
        colour_of(color, known(path))
    return deliver(path.comm, file, lambda: _draw(path, points, magnify, color, side_by_side), units)


def scene(scene, file=None, units="SI"):
    """See `Scene.plot`."""
    return deliver(communicator(), file, lambda: _draw_scene(scene), units)


def deliver(comm, file, draw, units="SI"):
    """The plotter that `draw()` returns where `file` is None, else a .png of it, written by rank 0; in these units."""
    units = Units(units)

    def drawn():
        with asked(units=units):
            return draw()

    if file is None:
        return drawn()
    file = Path(file)
    if file.suffix != ".png":
        raise SceneError(f"{file}: expected a name that ends in .png")
    on_first(comm, lambda: _save(drawn, file))
    return None


def _save(draw, file):
    plotter = draw()
    try:
        with replaced(file) as fresh:
            plotter.screenshot(str(fresh))
    finally:
        plotter.close()


def _draw(path, points, magnify, color, side_by_side):
    pyvista = load_pyvista()
    most = 5 if len(path.scene.rods) <= _NAMED else 1
    shown = _spread(path, most) if points is None else [range(len(path))[k] for k in points]
    plotter = stage(pyvista, _WINDOW, "ssaa")
    resting = at_rest(path.scene)
    colour = colour_of(color or default_colour(path, shown), known(path))
    bodies = {(k, rod): swept(path, k, rod, magnify, colour) for k in shown for rod in path.scene.rods}
    everywhere = np.concatenate([*resting, *(body.line for body in bodies.values())])
    size = float(np.ptp(everywhere, axis=0).max())
    factors = {key: thickening(body, size, len(path.scene.rods)) for key, body in bodies.items()}
    if points is None and _coincide(bodies, shown, factors):  # they would hide each other's colours
        shown = shown[-1:]
        bodies, factors = ({key: of[key] for key in of if key[0] == shown[0]} for of in (bodies, factors))
        everywhere = np.concatenate([*resting, *(body.line for body in bodies.values())])
    span = span_of(path.scene, [Deformed(path, k, {}, magnify, 0.0) for k in shown], everywhere)
    still = dict(zip(path.scene.rods, resting, strict=True))
    span = seen_moving(span, np.concatenate([body.line - still[rod] for (_, rod), body in bodies.items()]))
    moved, apart = dict.fromkeys(shown, np.zeros(3)), _apart(path.scene, shown, bodies, everywhere, span, side_by_side)
    small = too_small(path, shown, size, magnify)
    if apart:
        moved, (*_, up) = apart, view_of(span)
        everywhere = around([bodies[shown[0], rod].line for rod in path.scene.rods], everywhere, up)
        bodies = {(k, rod): replace(body, line=body.line + moved[k]) for (k, rod), body in bodies.items()}
        size = float(np.ptp(np.concatenate([body.line for body in bodies.values()]), axis=0).max())
        factors = {key: thickening(body, size, len(path.scene.rods)) for key, body in bodies.items()}
    values = [body.values for body in bodies.values()]
    peak = peak_of(path, colour, values)
    colour = seen(colour, values, peak)
    radii = {rod: factors[shown[-1], rod] * bodies[shown[-1], rod].radius for rod in path.scene.rods}
    add_bodies(plotter, pyvista, [*bodies.values()], [*map(factors.get, bodies)], peak, colour)
    if not apart:
        add_lines(plotter, pyvista, resting)
    if magnify == 1:  # elsewhere rods would leave their tubes
        add_tubes(plotter, pyvista, path.scene, radii)
    lines = [line for key, body in bodies.items() for line in _outline(body, factors[key], span)]
    shapes = [Deformed(path, k, radii, magnify, moved[k]) for k in shown]
    symbols = signs_of(
        pyvista, path.scene, shapes, np.concatenate([everywhere, *(body.line for body in bodies.values())]), span
    )
    title = _title(path, shown, magnify, small, apart, factors.values())
    _finish(plotter, pyvista, everywhere, symbols, lines, title,
            lambda labels: _label(labels, path, shown, bodies, span, apart, letters(plotter)),
            _TICKS_APART if apart else 6)  # fmt: skip
    return plotter


def _apart(scene, shown, bodies, everywhere, span, wish):
    """{k: vector (3,), m} by which shapes are moved apart, the second one out of the axes around the first; everywhere:
    points (n, 3), m, of all shapes; wish: bool, or None for where they are tangled."""
    shapes, (_, right, above, up) = [[bodies[k, rod].line for rod in scene.rods] for k in shown], view_of(span)
    if wish is None:
        wish = all(load.tube() is None for load in scene.loads) and tangled(shapes, right, above)
    if not wish or len(shown) == 1:
        return {}
    axes = axes_of(around(shapes[0], everywhere, up), _TICKS_APART)
    box = np.array([*itertools.product(*((axis.low, axis.high) for axis in axes))]) @ right
    return dict(zip(shown, shifts(shapes, right, box), strict=True))


def _outline(body, factor, span):
    """The centreline of a `Body` and its edges in the picture, (n, 3) m each, which labels keep off."""
    _, right, above, _ = view_of(span)
    edge = factor * body.radius
    return [body.line, *(body.line + sign * edge * way for sign in (-1, 1) for way in (right, above))]


def _draw_scene(scene):
    pyvista = load_pyvista()
    plotter = stage(pyvista, _WINDOW, "ssaa")
    everywhere = np.concatenate(at_rest(scene))
    size, radii, factors, surfaces = float(np.ptp(everywhere, axis=0).max()), {}, [], []
    x = places(len(scene.rods))
    for rod in scene.rods:
        line, directors = rod.curve.position(x * rod.length), rod.curve.frame(x * rod.length)
        body = body_of(rod, x, line, directors, np.zeros(len(x)))
        factors.append(thickening(body, size, len(scene.rods)))
        radii[rod] = factors[-1] * body.radius
        surfaces.append(surface_of(pyvista, body, factors[-1]))
    plotter.add_mesh(together(surfaces), color=_AT_REST, split_sharp_edges=True, smooth_shading=True)
    add_tubes(plotter, pyvista, scene, radii)
    shapes = [Resting(radii)]
    symbols = signs_of(pyvista, scene, shapes, everywhere, span_of(scene, shapes, everywhere))
    named = len(scene.rods) <= _NAMED
    title = scene.title or "Scene"
    if any(load.scaled for load in scene.loads):
        title += ": loads at load factor 1"
    notes = _noted(
        *thicker(factors), "" if named else f"{len(scene.rods)} rods, not named",
        "with the loads and supports of all its stages" if scene.stages else "", _undrawn(scene, True),
    )  # fmt: skip
    _finish(plotter, pyvista, everywhere, symbols, at_rest(scene), [title, *notes],
            lambda labels: _name(labels, scene, letters(plotter)) if named else None)  # fmt: skip
    return plotter


def _finish(plotter, pyvista, everywhere, symbols, lines, title, label, most=6):
    """Draw signs, axes, labels, key and title, and place the camera; lines: centrelines that labels keep off."""
    symbols.draw(plotter)
    font = letters(plotter)
    lettered = [line for text in title for line in _even(text)]
    over = font * _LINE * (len(lettered) + 0.5)

    def prepared(view):
        (width, height), labels = view.window, Labels(view, [*lines, *symbols.covers])
        labels.reserve((0, height - over), (width, height))
        labels.reserve((0.79 * width, 0), (width, 0.85 * height))
        return labels

    view, labels = frame(plotter, everywhere, more=symbols.points, labels=prepared, span=symbols.span,
                         title=over + _ABOVE * font, most=most, heights=_HEIGHTS)  # fmt: skip
    label(labels)
    for text, point, towards, colour in symbols.grouped_texts():
        labels.near(text, point, towards, size=font, colour=colour)
    labels.draw(plotter, pyvista)
    if labels.left_out:
        left_out = f"(no room for {len(labels.left_out)} labels: "
        lettered.append(f"{left_out}{textwrap.shorten(', '.join(labels.left_out), _TITLE_WIDTH - len(left_out) - 1)})")
    for bar in plotter.scalar_bars.values():  # above the key
        low = max(_BAR[0], _LINE * font * (len(symbols.groups) + 0.7) / view.window[1])
        bar.SetPosition(bar.GetPosition()[0], low)
        bar.SetHeight(min(_BAR[1], 1 - over / view.window[1]) - low)
    for i, (words, colour) in enumerate(reversed(symbols.groups.items())):
        place = 0.79 * view.window[0], _LINE * font * (i + 0.2)
        plotter.add_text(words, position=place, color=colour, font_size=font / 2)
    plotter.add_text(plain("\n".join(lettered)), position="upper_edge", color="black", font_size=font / 2)


def _even(text):
    """The lines of a text, none of which is much shorter than the others, and in which numbers keep their units."""
    text = re.sub(r"(?<=\d) (?=[a-zA-Z]{1,3}\b)", "\N{NO-BREAK SPACE}", text)
    lines = textwrap.wrap(text, _TITLE_WIDTH)
    while len(lines) > 1 and len(narrower := textwrap.wrap(text, max(map(len, lines)) - 1)) == len(lines):
        lines = narrower
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in lines]


def _title(path, shown, magnify, small, apart, factors):
    """The lines of the title: the points shown, and notes in parentheses."""
    some = "" if len(shown) == len(path) else f" ({len(shown)} of {len(path)} states)"
    stages = itertools.groupby((path.label(k).rpartition(": ") for k in shown), lambda parts: "".join(parts[:2]))
    values = "; ".join(stage + ", ".join(value for *_, value in of_stage) for stage, of_stage in stages)
    title = f"{path.scene.title or 'Deformed rods'}:"
    several = "s" if len(shown) > 1 else ""
    shapes = f"shape{several} at {path.axis}{several} {values}{some}"
    lines = [f"{title} {shapes}"] if len(title) + len(shapes) < _TITLE_WIDTH else [title, shapes]
    magnified = f"displacements magnified {magnify:g} times" if magnify != 1 else ""
    beside = "shapes side by side, the axes beside the first" if apart else ""
    return [*lines, *_noted(magnified, *small, beside, *thicker(factors), _undrawn(path.scene, magnify == 1))]


def _noted(*notes):
    """Notes under a title as one text in parentheses, without those that are empty."""
    told = "; ".join(filter(None, notes))
    return [f"({told})"] if told else []


def _undrawn(scene, tubes):
    words = without_sign(scene, tubes)
    return f"not drawn: {textwrap.shorten(words, _TITLE_WIDTH, placeholder=' ...')}" if words else ""


def _spread(path, most):
    """Indices of up to `most` points of a path: the last one of each stage, and others evenly spaced by how far the
    rods' ends moved; of one, the last."""
    if len(path) <= most or most == 1:
        return [*range(len(path))][-most:]
    last = [*np.flatnonzero(np.diff(getattr(path, "stage", [0]))).tolist(), len(path) - 1]
    if len(last) >= most:
        return [last[i] for i in np.linspace(0, len(last) - 1, most).round().astype(int)]
    ends = np.hstack([path.position(rod.end) for rod in path.scene.rods])
    # a small fictitious motion spaces the points evenly by index where the ends do not move
    ends = np.hstack([ends, 1e-6 * path.scales.length * np.arange(len(path))[:, None]])
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(ends, axis=0), axis=1)))
    wanted = np.linspace(0, way[-1], most)
    found = {int(np.argmin(np.abs(way - w))) for w in wanted}
    for k in {*last} - found:
        found.remove(min(found - {*last}, key=lambda i: abs(way[i] - way[k])))
        found.add(k)
    return sorted(found)


def _coincide(bodies, shown, factors):
    """Whether the shapes lie nowhere farther apart than the sections, as they are drawn, are thick."""
    rods = {rod for _, rod in bodies}
    apart = max(np.ptp([bodies[k, rod].line for k in shown], axis=0).max() for rod in rods)
    return apart < 2 * max(factors[key] * body.radius for key, body in bodies.items())


def _label(labels, path, shown, bodies, span, apart, font):
    """Label each shape where shapes lie farthest apart, at the end of another rod, or above those side by side."""
    rods = path.scene.rods
    if len(shown) == 1:
        return
    if apart:
        _, right, above, _ = view_of(span)
        for k in shown:
            line = np.concatenate([bodies[k, rod].line for rod in rods])
            middle = (line @ right).max() / 2 + (line @ right).min() / 2 - line.mean(axis=0) @ right
            top = (line @ above).max() - line.mean(axis=0) @ above
            labels.near(path.label(k), line.mean(axis=0) + middle * right + top * above, above, size=font)
        return
    size = max(np.ptp(body.line) for body in bodies.values())
    spread = [np.ptp([bodies[k, rod].line for k in shown], axis=0).max(axis=1) for rod in rods]
    rod = max(range(len(rods)), key=lambda i: (round(spread[i].max() / size, 6), -i))
    place = len(spread[rod]) - 1 - int(np.argmax(spread[rod][::-1]))  # the last one of equal maxima, nearest to the end
    middle = np.mean([bodies[k, rods[rod]].line[place] for k in shown], axis=0)
    at_one = []  # lists of shapes that have one place there
    for k in reversed(shown):
        here = bodies[k, rods[rod]].line[place]
        near = (x for x in at_one if np.linalg.norm(here - bodies[x[0], rods[rod]].line[place]) < _AT_ONE * size)
        if (same := next(near, None)) is None:
            at_one.append(same := [])
        same.append(k)
    for k, *others in at_one:
        body = bodies[k, rods[rod]]
        end = 1 if place == len(body.line) - 1 else -1 if place == 0 else 0
        towards = _beyond(body.directors[place, :, 2], end)
        if not end and (body.line[place] - middle) @ towards < 0:
            towards = -towards  # off the other shapes
        labels.near(", ".join(map(path.label, sorted([k, *others]))), body.line[place], towards, size=font)


def _name(labels, scene, font):
    """Label the rods by their names, in the middle."""
    size = font if len(scene.rods) <= _FEW else round(_SMALLER * font)
    for rod in scene.rods:
        s = rod.length / 2
        labels.near(rod.name, rod.curve.position(s), _beyond(rod.curve.frame(s)[:, 2], 0), size=size)


def _beyond(tangent, end):
    """Unit vector (3,) from the rod to a label: along the tangent at its ends (-1, 1), else across, upwards."""
    if end:
        return end * tangent
    up = np.array([0.0, 0.0, 1.0]) if abs(tangent[2]) < 0.95 else np.array([1.0, 0.0, 0.0])
    across = up - (up @ tangent) * tangent
    return across / np.linalg.norm(across)


# Crossings in the picture, on average of two shapes, from which on shapes are tangled.
_TANGLED = 4
# Lines in which crossings are counted, of one shape, and the fewest of one rod; gap between shapes over the widest.
_PIECES, _FEWEST, _GAP = 600, 8, 0.18


def tangled(shapes, right, above):
    """Whether shapes cross each other so often in the picture that they cannot be distinguished. shapes: of each shape
    the list of the centrelines of its rods, (n, 3), m; right, above: unit vectors (3,) of the picture."""
    flat = [_segments(lines, np.column_stack([right, above])) for lines in shapes]
    pairs = list(itertools.combinations(flat, 2))
    return bool(pairs) and sum(itertools.starmap(_crossings, pairs)) >= _TANGLED * len(pairs)


def _segments(lines, axes):
    """Starts and vectors, (n, 2) each, of straight pieces of lines in the picture."""
    pieces = max(_FEWEST, _PIECES // len(lines))
    some = [line[np.linspace(0, len(line) - 1, min(pieces + 1, len(line))).astype(int)] @ axes for line in lines]
    return np.concatenate([line[:-1] for line in some]), np.concatenate([np.diff(line, axis=0) for line in some])


def _crossings(one, other):
    """How many pieces of one shape cross pieces of the other."""
    (p, u), (q, v) = one, other
    apart = q[None] - p[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):  # parallel pieces
        scale = _cross(u[:, None], v[None])
        shares = _cross(apart, v[None]) / scale, _cross(apart, u[:, None]) / scale
    return int(np.logical_and(*((share > 0) & (share < 1) for share in shares)).sum())


def _cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def shifts(shapes, right, box):
    """Vectors (3,), m, that bring shapes beside each other, from the left to the right; the first one stays, in a box
    with the corners `box` (8,), m, along that way."""
    along = [np.concatenate(lines) @ right for lines in shapes]
    along[0] = np.append(along[0], box)
    gap, edge, found = _GAP * max(map(np.ptp, along)), along[0].min(), []
    for ends in along:
        found.append((edge - ends.min()) * right)
        edge += np.ptp(ends) + gap
    return found


def around(lines, points, up):
    """Points (n, 3), m: of the lines of one shape, and at its place the heights of all points along the axis `up`."""
    first, axis = np.concatenate(lines), int(np.argmax(np.abs(up)))
    ends = np.repeat(first.mean(axis=0)[None], 2, axis=0)
    ends[:, axis] = points[:, axis].min(), points[:, axis].max()
    return np.concatenate([first, ends])
