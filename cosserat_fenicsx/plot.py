"""Pictures: the deformed rods in space by pyvista (off-screen), a path as a chart by matplotlib."""

import math
import os
from pathlib import Path

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.ranks import on_first

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"))
# A rod thinner than this part of the picture is drawn thicker, and the picture says so.
_THINNEST = 1 / 120


def rods(path, file=None, points=None):
    """The deformed rods at some points of a path, coloured by bending moment, with the reference as a grey line.

    Args:
        path: a `Path` with at least one point.
        file: where to write a .png (rank 0 writes); None returns the plotter.
        points: indices of the points to show; None for up to five, evenly spread.

    Returns:
        The pyvista Plotter where `file` is None.

    Raises:
        SceneError: an empty path, or pyvista is missing.
        OSError: the file cannot be written.
    """
    if len(path) == 0:
        raise SceneError("the path has no point to draw")
    if file is None:
        return _draw(path, points)
    on_first(path.comm, lambda: _save(_draw(path, points), Path(file)))
    return None


def _save(plotter, file):
    file.parent.mkdir(parents=True, exist_ok=True)
    with open(file, "wb"):
        pass  # an unwritable place is said here, plainly
    plotter.screenshot(str(file))
    plotter.close()


def _draw(path, points):
    pyvista = _pyvista()
    shown = _spread(path) if points is None else list(points)
    plotter = pyvista.Plotter(off_screen=True, window_size=(1400, 1000))
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    fields = {(k, rod): path.fields(k, rod) for k in shown for rod in path.scene.rods}
    everywhere = np.concatenate([f["position"] for f in fields.values()]
                                + [f["position"] - f["displacement"] for f in fields.values()])  # fmt: skip
    span = everywhere.max(axis=0) - everywhere.min(axis=0)
    size = float(span.max())
    peak = max(f["bending_moment"].max() for f in fields.values())
    scale, prefix = _prefix(peak)
    thicker = set()
    for (k, rod), f in fields.items():
        radius, factor = _radius(rod, size)
        if factor > 1:
            thicker.add(f"{factor:.1f}x" if factor < 10 else f"{factor:.0f}x")
        tube = _tube(pyvista, path, k, rod, radius)
        tube["moment"] = tube["moment"] / scale
        plotter.add_mesh(
            tube,
            scalars="moment",
            cmap="viridis",
            clim=(0, peak / scale or 1),
            smooth_shading=True,
            scalar_bar_args={
                "title": f"bending moment ({prefix}N m)",
                "color": "black",
                "vertical": True,
                "position_x": 0.87,
                "position_y": 0.2,
                "height": 0.6,
                "width": 0.06,
                "fmt": "%.3g",
                "title_font_size": 22,
                "label_font_size": 20,
            },
        )
    for rod in path.scene.rods:
        f = fields[shown[0], rod]
        plotter.add_mesh(pyvista.lines_from_points(f["position"] - f["displacement"]), color="grey", line_width=2)
    _label(plotter, path, shown, size)
    bounds, counts = _bounds(everywhere, size)
    plotter.show_bounds(
        bounds=bounds, xtitle="x (m)", ytitle="y (m)", ztitle="z (m)", color="black", font_size=14,
        location="outer", fmt="%.4g", **counts,
    )  # fmt: skip
    note = f"{path.scene.title or 'Deformed rods'}: shape by load factor"
    if thicker:
        note += f" (tubes drawn {', '.join(sorted(thicker))} thicker)"
    plotter.add_text(note, position="upper_edge", color="black", font_size=13)
    _aim(plotter, everywhere, span)
    return plotter


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
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(ends, axis=0), axis=1)))
    wanted = np.linspace(0, way[-1], most)
    return sorted({int(np.argmin(np.abs(way - w))) for w in wanted})


def _prefix(value):
    return next(((s, p) for s, p in _PREFIXES if abs(value) >= s), (1.0, ""))


def _radius(rod, size):
    """(drawn radius, how many times the real one)."""
    least = size * _THINNEST
    real = rod.stiffness.radius or least
    return (real, 1.0) if real >= least else (least, least / real)


def _tube(pyvista, path, k, rod, radius):
    """A smooth tube through points of the element polynomials."""
    x = np.linspace(0, 1, 201)
    line = pyvista.lines_from_points(path.sample(k, rod, x))
    f = path.fields(k, rod)
    line["moment"] = np.interp(x, f["s"] / rod.length, f["bending_moment"])
    return line.tube(radius=radius, n_sides=24)


def _label(plotter, path, shown, size):
    """Load factor, and a word where a point is unstable, beyond the end of the first rod."""
    rod = path.scene.rods[0]
    for k in shown:
        f = path.fields(k, rod)
        text = f"{path.load_factors[k]:.3g}" + ("" if path.stable[k] else " (unstable)")
        plotter.add_point_labels(
            [f["position"][-1] + 0.03 * size * f["d3"][-1]], [text], font_size=20, text_color="black", shape=None,
            show_points=False, always_visible=True, bold=False, justification_horizontal="center",
            justification_vertical="center",
        )  # fmt: skip


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


def _aim(plotter, points, span):
    """Look across the plane of a plane scene, from a corner otherwise."""
    thin = int(np.argmin(span))
    centre = (points.max(axis=0) + points.min(axis=0)) / 2
    if span[thin] < 0.05 * span.max():
        view = np.zeros(3)
        view[thin] = -1.0 if thin == 1 else 1.0
        up = (0, 0, 1) if thin != 2 else (0, 1, 0)
        plotter.enable_parallel_projection()
    else:
        view, up = np.array([1.0, -1.6, 0.8]), (0, 0, 1)
    reach = 2.2 * float(np.linalg.norm(span))
    plotter.camera.focal_point = tuple(centre)
    plotter.camera.position = tuple(centre + reach * view / math.sqrt(view @ view))
    plotter.camera.up = up
    plotter.reset_camera()
    plotter.camera.zoom(1.1)
