"""Pictures: the deformed rods in space by pyvista (off-screen), charts of curves by matplotlib."""

import math
import textwrap
from pathlib import Path

import numpy as np

from cosserat_fenicsx.checks import positive
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.pictures.drawing import add_body, at_rest, frame, load_pyvista, swept, thickening, view_of
from cosserat_fenicsx.pictures.figures import save
from cosserat_fenicsx.ranks import on_first
from cosserat_fenicsx.results.beside import replaced

# As shares of the extent of the drawing: height of a label, width of a letter, smallest visible displacement.
_LABEL_HEIGHT, _LETTER_WIDTH, _VISIBLE = 0.035, 0.016, 0.01
# Letters per line of the title.
_TITLE_WIDTH = 88


def rods(path, file=None, points=None, magnify=1.0):
    """The deformed rods at some points of a path, coloured by bending moment, with the reference as a grey line.

    Args:
        path: a `Path` with at least one point.
        file: where to write a .png (rank 0 writes); None returns the plotter.
        points: indices of the points to show; None for up to five, evenly spread.
        magnify: factor on displacements.

    Returns:
        The pyvista Plotter where `file` is None.

    Raises:
        SceneError: an empty path, a file that is no .png, or pyvista is missing.
        OSError: the file cannot be written.
    """
    if len(path) == 0:
        raise SceneError("the path has no point to draw")
    positive("plot", "magnify", magnify, "-")
    if file is None:
        return _draw(path, points, magnify)
    file = Path(file)
    if file.suffix != ".png":
        raise SceneError(f"{file}: expected a name that ends in .png")
    on_first(path.comm, lambda: _save(_draw(path, points, magnify), file))
    return None


def _save(plotter, file):
    try:
        with replaced(file) as fresh:
            plotter.screenshot(str(fresh))
    finally:
        plotter.close()


def _draw(path, points, magnify):
    pyvista = load_pyvista()
    shown = _spread(path) if points is None else [range(len(path))[k] for k in points]
    plotter = pyvista.Plotter(off_screen=True, window_size=(1400, 1000))
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    resting = at_rest(path.scene)
    bodies = {(k, rod): swept(path, k, rod, magnify) for k in shown for rod in path.scene.rods}
    everywhere = np.concatenate([*resting, *(body.line for body in bodies.values())])
    size = float(np.ptp(everywhere, axis=0).max())
    peak = max(body.moment.max() for body in bodies.values())
    thicker = set()
    for body in bodies.values():
        factor = thickening(body, size)
        if factor > 1:
            thicker.add(f"{float(f'{factor:.2g}'):g}")
        add_body(plotter, pyvista, body, factor, peak)
    for line in resting:
        plotter.add_mesh(pyvista.lines_from_points(line), color="grey", line_width=2)
    _label(plotter, path, shown, bodies, np.ptp(everywhere, axis=0))
    note = _note(path, shown, thicker, magnify, _small(path, shown, size, magnify))
    plotter.add_text(note, position="upper_edge", color="black", font_size=12)
    frame(plotter, everywhere)
    return plotter


def _small(path, shown, size, magnify):
    """A note where displacements are too small to be seen, with a factor that shows them; else empty."""
    largest = max(
        np.linalg.norm(path.fields(k, rod)["displacement"], axis=1).max() for k in shown for rod in path.scene.rods
    )
    if magnify * largest > _VISIBLE * size or largest < 1e-12 * size:
        return ""
    decade = 10.0 ** math.floor(math.log10(0.1 * size / largest))
    return f"displacements are at most {largest:.2g} m, magnify={decade:g} (--magnify {decade:g}) shows them"


def _note(path, shown, thicker, magnify, small):
    """The title: the points shown, and what is not to scale."""
    some = "" if len(shown) == len(path) else f" (of {len(path)})"
    values = ", ".join(path.label(k) for k in shown)
    title = f"{path.scene.title or 'Deformed rods'}:"
    shapes = f"shapes at {path.axis}{'s' if len(shown) > 1 else ''} {values}{some}"
    lines = [f"{title} {shapes}"] if len(title) + len(shapes) < _TITLE_WIDTH else [title, shapes]
    if magnify != 1:
        lines.append(f"(displacements magnified {magnify:g} times)")
    if small:
        lines.append(f"({small})")
    if thicker:
        lines.append(f"(sections drawn {' and '.join(sorted(thicker))} times their size)")
    return "\n".join(textwrap.fill(line, _TITLE_WIDTH) for line in lines)


def chart(file, curves, *, xlabel, ylabel, title, ylim=None):
    """A chart of several curves.

    Args:
        file: where to write it; under mpirun, call it on one rank.
        curves: list of (x, y, label, dict of matplotlib's line properties).
        xlabel, ylabel, title: words, with units.
        ylim: limits of the ordinate.

    Raises:
        SceneError: matplotlib is missing.
        OSError: the file cannot be written.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as missing:
        raise SceneError(f"charts need matplotlib ({missing}): pip install 'cosserat-fenicsx[pictures]'") from None
    figure = Figure(figsize=(8, 5.5), layout="constrained")
    axes = figure.add_subplot()
    for x, y, label, style in curves:
        axes.plot(x, y, label=label, **style)
    axes.set(xlabel=xlabel, ylabel=ylabel, title=title, ylim=ylim)
    axes.grid(alpha=0.3)
    axes.legend()
    save(figure, file)


def _spread(path, most=5):
    """Indices of up to `most` points of a path, evenly spaced by the distance that the rods' ends have moved."""
    ends = np.hstack([path.position(rod.end) for rod in path.scene.rods])
    # a small fictitious motion spaces the points evenly by index where the ends do not move
    ends = np.hstack([ends, 1e-6 * path.scales.length * np.arange(len(path))[:, None]])
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(ends, axis=0), axis=1)))
    wanted = np.linspace(0, way[-1], most)
    return sorted({int(np.argmin(np.abs(way - w))) for w in wanted})


def _label(plotter, path, shown, bodies, span):
    """Label each shape (`path.label`) at the place where the shapes lie farthest apart; labels that overlap are left
    out."""
    rods, size = path.scene.rods, float(span.max())
    _, right, above, _ = view_of(span)
    spread = [np.ptp([bodies[k, rod].line for k in shown], axis=0).max(axis=1) for rod in rods]
    rod = max(range(len(rods)), key=lambda i: (round(spread[i].max() / size, 6), -i))
    place = len(spread[rod]) - 1 - int(np.argmax(spread[rod][::-1]))  # the last one of equal maxima, nearest to the end
    end = 1 if place == len(spread[rod]) - 1 else -1 if place == 0 else 0
    placed = []
    for k in reversed(shown):
        body = bodies[k, rods[rod]]
        at = body.line[place] + 0.03 * size * (1 if end else 1.3) * _beyond(body.directors[place, :, 2], end)
        text = path.label(k)
        across, high = at @ right / size, at @ above / size
        if any(
            abs(high - y) < _LABEL_HEIGHT and abs(across - x) < _LETTER_WIDTH * (len(text) + n) / 2
            for x, y, n in placed
        ):
            continue
        placed.append((across, high, len(text)))
        plotter.add_point_labels(
            [at], [text], font_size=20, text_color="black", shape=None, show_points=False, always_visible=True,
            bold=False, justification_horizontal="center", justification_vertical="center",
        )  # fmt: skip


def _beyond(tangent, end):
    """Unit vector (3,) from the rod to a label: along the tangent beyond the end (1) or before the start (-1) of a rod;
    across the rod elsewhere (0), upwards where possible."""
    if end:
        return end * tangent
    up = np.array([0.0, 0.0, 1.0]) if abs(tangent[2]) < 0.95 else np.array([1.0, 0.0, 0.0])
    across = up - (up @ tangent) * tangent
    return across / np.linalg.norm(across)
