"""Pictures: the deformed rods in space by pyvista (off-screen), a path as a chart by matplotlib."""

import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosserat_fenicsx.checks import positive
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.materials import Material
from cosserat_fenicsx.ranks import on_first
from cosserat_fenicsx.sections import Circle

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"))
# A rod thinner than this part of the picture is drawn thicker, and the picture says so.
_THINNEST = 1 / 120


def rods(path, file=None, points=None, magnify=1.0):
    """The deformed rods at some points of a path, coloured by bending moment, with the reference as a grey line.

    Args:
        path: a `Path` with at least one point.
        file: where to write a .png (rank 0 writes); None returns the plotter.
        points: indices of the points to show; None for up to five, evenly spread.
        magnify: displacements are drawn this many times their size.

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
    file.parent.mkdir(parents=True, exist_ok=True)
    with open(file, "wb"):
        pass  # an unwritable place is said here, plainly
    plotter.screenshot(str(file))
    plotter.close()


def _draw(path, points, magnify):
    pyvista = _pyvista()
    shown = _spread(path) if points is None else [range(len(path))[k] for k in points]
    plotter = pyvista.Plotter(off_screen=True, window_size=(1400, 1000))
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    at_rest = [rod.curve.position(np.linspace(0, rod.length, 201)) for rod in path.scene.rods]
    bodies = {(k, rod): _swept(path, k, rod, magnify) for k in shown for rod in path.scene.rods}
    everywhere = np.concatenate([*at_rest, *(body.line for body in bodies.values())])
    span = everywhere.max(axis=0) - everywhere.min(axis=0)
    size = float(span.max())
    peak = max(body.moment.max() for body in bodies.values())
    scale, prefix = _prefix(peak)
    thicker = set()
    for body in bodies.values():
        factor = max(1.0, size * _THINNEST / body.radius)
        if factor > 1:
            thicker.add(f"{factor:.2g}")
        plotter.add_mesh(
            _surface(pyvista, body, factor, scale),
            scalars="moment",
            cmap="viridis",
            clim=(0, peak / scale or 1),
            smooth_shading=True,
            split_sharp_edges=True,
            scalar_bar_args={
                "title": f"bending moment ({prefix}N m)",
                "color": "black",
                "vertical": True,
                "position_x": 0.86,
                "position_y": 0.2,
                "height": 0.6,
                "width": 0.05,
                "fmt": "%.3g",
                "title_font_size": 20,
                "label_font_size": 20,
            },
        )
    for line in at_rest:
        plotter.add_mesh(pyvista.lines_from_points(line), color="grey", line_width=2)
    _label(plotter, path, shown, bodies, size)
    bounds, counts = _bounds(everywhere, size)
    plotter.show_bounds(
        bounds=bounds, xtitle="x (m)", ytitle="y (m)", ztitle="z (m)", color="black", font_size=8,
        location="outer", fmt="%.4g", use_3d_text=False, **counts,
    )  # fmt: skip
    plotter.add_text(_note(path, shown, thicker, magnify), position="upper_edge", color="black", font_size=12)
    _aim(plotter, np.reshape(bounds, (3, 2)), span)
    return plotter


def _note(path, shown, thicker, magnify):
    """The title: what is shown, and what is not to scale."""
    which = (
        f"shapes by {path.axis}" if len(shown) == len(path) else f"shapes at {len(shown)} of {len(path)} {path.axis}s"
    )
    parts = [f"{path.scene.title or 'Deformed rods'}: {which}"]
    if magnify != 1:
        parts.append(f"displacements magnified {magnify:g} times")
    if thicker:
        parts.append(f"sections drawn {' and '.join(sorted(thicker))} times their size")
    return parts[0] + (f"\n({', '.join(parts[1:])})" if parts[1:] else "")


@dataclass(frozen=True)
class _Body:
    """A deformed rod: centreline (n, 3), directors (n, 3, 3), outline (n, corners, 2), radius, bending moment (n,)."""

    line: np.ndarray
    directors: np.ndarray
    outline: np.ndarray
    radius: float
    moment: np.ndarray


def _swept(path, k, rod, magnify, pieces=200):
    x = np.linspace(0, 1, pieces + 1)
    line, directors = path.sample(k, rod, x)
    reference = rod.curve.position(x * rod.length)
    fields = path.fields(k, rod)
    outline = _outlines(rod, x * rod.length)
    moment = np.interp(x, fields["s"] / rod.length, fields["bending_moment"])
    radius = float(np.linalg.norm(outline, axis=2).max())
    return _Body(reference + magnify * (line - reference), directors, outline, radius, moment)


def _outlines(rod, s):
    """(n, corners, 2) corners of the section at arc lengths s, m; all get as many as the richest."""
    sections = [rod.section_at(s[0])] * len(s) if rod.profile.constant else [rod.section_at(x, "left") for x in s]
    given = [section.stiffness(rod.material).outline for section in sections]
    drawn = [np.array(x or Circle(0.02 * rod.length).stiffness(Material(E=1.0)).outline) for x in given]
    most = max(map(len, drawn))
    return np.array([outline if len(outline) == most else _resampled(outline, most) for outline in drawn])


def _resampled(outline, corners):
    """A closed polygon with another number of corners, evenly along it."""
    closed = np.concatenate([outline, outline[:1]])
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.linspace(0, way[-1], corners, endpoint=False)
    return np.column_stack([np.interp(at, way, closed[:, i]) for i in range(2)])


def _surface(pyvista, body, factor, scale):
    """The surface that the outline sweeps, closed at both ends."""
    corners = body.outline.shape[1]
    points = body.line[:, None] + factor * np.einsum("nij,ncj->nci", body.directors[:, :, :2], body.outline)
    rings = np.arange(len(body.line) * corners).reshape(-1, corners)
    right = np.roll(rings, -1, axis=1)
    quads = np.stack([rings[:-1], right[:-1], right[1:], rings[1:]], axis=-1).reshape(-1, 4)
    faces = np.column_stack([np.full(len(quads), 4), quads]).ravel()
    caps = np.concatenate([[corners, *rings[0][::-1]], [corners, *rings[-1]]])
    surface = pyvista.PolyData(points.reshape(-1, 3), np.concatenate([faces, caps]))
    surface["moment"] = np.repeat(body.moment / scale, corners)
    return surface


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
    Path(file).parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=150)


def _pyvista():
    # EGL draws without a screen; VTK would try X first and complain.
    if not os.environ.get("DISPLAY"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    try:
        import pyvista
        import pyvista.plotting  # loads VTK's windows, and so the system's libraries
    except ImportError as missing:
        raise SceneError(
            f"pictures need pyvista ({missing}): pip install 'cosserat-fenicsx[pictures]', and on Debian "
            "apt install libegl1 libgl1 libxrender1"
        ) from None
    return pyvista


def _spread(path, most=5):
    """Up to five points, evenly spread along the way of the rods' ends."""
    ends = np.hstack([path.position(rod.end) for rod in path.scene.rods])
    ends = np.hstack([ends, 1e-6 * path.scales.length * np.arange(len(path))[:, None]])  # a way even where none moves
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(ends, axis=0), axis=1)))
    wanted = np.linspace(0, way[-1], most)
    return sorted({int(np.argmin(np.abs(way - w))) for w in wanted})


def _prefix(value):
    return next(((s, p) for s, p in _PREFIXES if abs(value) >= s), (1.0, ""))


def _label(plotter, path, shown, bodies, size):
    """Load factor, and a word where a point is unstable, where the shapes lie farthest apart; none over another."""
    rods = path.scene.rods
    spread = [np.ptp([bodies[k, rod].line for k in shown], axis=0).max(axis=1) for rod in rods]
    rod = max(range(len(rods)), key=lambda i: (round(spread[i].max() / size, 6), -i))
    place = len(spread[rod]) - 1 - int(np.argmax(spread[rod][::-1]))  # the last of equals: an end, not next to it
    last = place == len(spread[rod]) - 1
    placed = []
    for k in reversed(shown):
        body = bodies[k, rods[rod]]
        at = body.line[place] + 0.03 * size * (1 if last else 1.3) * _beyond(body.directors[place, :, 2], last)
        if any(np.linalg.norm(at - other) < 0.03 * size for other in placed):
            continue
        placed.append(at)
        text = path.label(k)
        plotter.add_point_labels(
            [at], [text], font_size=20, text_color="black", shape=None, show_points=False, always_visible=True, bold=False,
            justification_horizontal="center", justification_vertical="center",
        )  # fmt: skip


def _beyond(tangent, end):
    """Where a label goes: on along the tangent at an end; beside the rod elsewhere, upwards if that is possible."""
    if end:
        return tangent
    up = np.array([0.0, 0.0, 1.0]) if abs(tangent[2]) < 0.95 else np.array([1.0, 0.0, 0.0])
    across = up - (up @ tangent) * tangent
    return across / np.linalg.norm(across)


def _bounds(points, size):
    """Round limits of the axes, and how many labels each takes."""
    step = 10 ** math.floor(math.log10(size / 5))
    step *= next(f for f in (1, 2, 5, 10) if size / (f * step) <= 6)
    low, high = step * np.floor(points.min(axis=0) / step + 1e-9), step * np.ceil(points.max(axis=0) / step - 1e-9)
    counts = np.round((high - low) / step).astype(int) + 1
    flat = counts == 1
    low, high = low - 0.03 * size * flat, high + 0.03 * size * flat
    labels = {f"n_{axis}labels": int(max(n, 2)) for axis, n in zip("xyz", counts, strict=True)}
    return tuple(np.column_stack([low, high]).ravel()), labels


def _aim(plotter, bounds, span):
    """Look across the plane of a plane scene, from a corner otherwise, and leave room for labels, title and bar."""
    thin = int(np.argmin(span))
    if span[thin] < 0.05 * span.max():
        view = np.zeros(3)
        view[thin] = -1.0 if thin == 1 else 1.0
        up = np.array([0.0, 0.0, 1.0]) if thin != 2 else np.array([0.0, 1.0, 0.0])
    else:
        view, up = np.array([1.0, -1.6, 0.8]), np.array([0.0, 0.0, 1.0])
    view = view / np.linalg.norm(view)
    right = np.cross(up, view)
    right /= np.linalg.norm(right)
    above = np.cross(view, right)
    corners = np.array(np.meshgrid(*bounds)).reshape(3, -1).T
    across, high = corners @ right, corners @ above
    width, height = np.ptp(across), np.ptp(high)
    aspect = plotter.window_size[0] / plotter.window_size[1]
    # the drawing fills 62 % of the width, left of the bar, and 64 % of the height, between title and axis
    half = max(height / 0.64, width / (0.62 * aspect)) / 2
    centre = (across.max() + across.min()) / 2 * right + (high.max() + high.min()) / 2 * above
    focus = centre + 0.12 * half * aspect * right - 0.03 * half * above
    plotter.enable_parallel_projection()
    plotter.camera.focal_point = tuple(focus)
    plotter.camera.position = tuple(focus + 4 * (width + height) * view)
    plotter.camera.up = tuple(up)
    plotter.camera.parallel_scale = half
    plotter.reset_camera_clipping_range()
