"""What pictures and films share: rods as tubes of their sections, axes with units, where the camera stands."""

import math
import os
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.materials import Material
from cosserat_fenicsx.scene.sections import Circle

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"))
# A rod thinner than this part of the picture is drawn thicker, and the picture says so.
_THINNEST = 1 / 120


def load_pyvista():
    """The module pyvista, ready to draw without a screen.

    Raises:
        SceneError: it is missing, or what it needs of the system.
    """
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


def prefix(value):
    """(scale, SI prefix) to write a value with."""
    return next(((s, p) for s, p in _PREFIXES if abs(value) >= s), (1.0, ""))


@dataclass(frozen=True)
class Body:
    """A deformed rod: centreline (n, 3), directors (n, 3, 3), outline (n, corners, 2), radius, bending moment (n,)."""

    line: np.ndarray
    directors: np.ndarray
    outline: np.ndarray
    radius: float
    moment: np.ndarray


def at_rest(scene):
    """[(201, 3) m] the centrelines of the reference."""
    return [rod.curve.position(np.linspace(0, rod.length, 201)) for rod in scene.rods]


def swept(path, k, rod, magnify, pieces=200):
    """The `Body` of a rod at point k of a path."""
    x = np.linspace(0, 1, pieces + 1)
    line, directors = path.sample(k, rod, x)
    fields = path.fields(k, rod)
    moment = np.interp(x, fields["s"] / rod.length, fields["bending_moment"])
    return body_of(rod, x, line, directors, moment, magnify)


def body_of(rod, x, line, directors, moment, magnify=1.0):
    """The `Body` of a rod whose centreline (n, 3) m, directors (n, 3, 3) and bending moment (n,) N m are known at arc
    lengths x (n,) over its length."""
    reference = rod.curve.position(x * rod.length)
    outline = _outlines(rod, x * rod.length)
    radius = float(np.linalg.norm(outline, axis=2).max())
    return Body(reference + magnify * (line - reference), directors, outline, radius, moment)


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


def thickening(body, size):
    """How many times its size the section of a `Body` is drawn in a picture of that size, m."""
    return max(1.0, size * _THINNEST / body.radius)


def points_of(body, factor):
    """(n corners, 3) m: where the outline goes, thickened by a factor."""
    points = body.line[:, None] + factor * np.einsum("nij,ncj->nci", body.directors[:, :, :2], body.outline)
    return points.reshape(-1, 3)


def add_body(plotter, pyvista, body, factor, peak, moving=False):
    """Draw the surface that the outline of a `Body` sweeps, closed at both ends, coloured by bending moment up to
    `peak`, N m; returns the mesh. Its points may be moved afterwards where it was asked to be `moving`."""
    corners = body.outline.shape[1]
    rings = np.arange(len(body.line) * corners).reshape(-1, corners)
    right = np.roll(rings, -1, axis=1)
    quads = np.stack([rings[:-1], right[:-1], right[1:], rings[1:]], axis=-1).reshape(-1, 4)
    faces = np.column_stack([np.full(len(quads), 4), quads]).ravel()
    caps = np.concatenate([[corners, *rings[0][::-1]], [corners, *rings[-1]]])
    surface = pyvista.PolyData(points_of(body, factor), np.concatenate([faces, caps]))
    scale, unit = prefix(peak)
    font = round(plotter.window_size[0] / 70)
    surface["moment"] = np.repeat(body.moment / scale, corners)
    plotter.add_mesh(
        surface,
        scalars="moment",
        cmap="viridis",
        clim=(0, peak / scale or 1),
        smooth_shading=not moving,
        split_sharp_edges=not moving,
        scalar_bar_args={
            "title": f"bending moment ({unit}N m)\n",
            "color": "black",
            "vertical": True,
            "position_x": 0.86,
            "position_y": 0.2,
            "height": 0.6,
            "width": 0.05,
            "fmt": "%.3g",
            "title_font_size": font,
            "label_font_size": font,
        },
    )
    return surface


def frame(plotter, everywhere):
    """Axes with units around points (n, 3) m, and the camera that holds them all."""
    span = np.ptp(everywhere, axis=0)
    bounds, counts = _bounds(everywhere, float(span.max()))
    plotter.show_bounds(
        bounds=bounds, xtitle="x (m)", ytitle="y (m)", ztitle="z (m)", color="black", font_size=8,
        location="outer", fmt="%.4g", use_3d_text=False, **counts,
    )  # fmt: skip
    _aim(plotter, np.reshape(bounds, (3, 2)), span)


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


def view_of(span):
    """Where the camera looks from (3,), what is right and above in the picture, and what is up in space, for a drawing
    of this span (3,)."""
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
    return view, right, np.cross(view, right), up


def _aim(plotter, bounds, span):
    """Look across the plane of a plane scene, from a corner otherwise, and leave room for labels, title and bar."""
    view, right, above, up = view_of(span)
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
