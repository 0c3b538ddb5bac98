"""Shared by pictures and films: surfaces of rods, axes with units, and the camera."""

import math
import os
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.materials import Material
from cosserat_fenicsx.scene.sections import Circle

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"))
# Rods whose radius is below this share of the extent of the drawing are drawn thicker, and the picture says so.
_SMALLEST_RADIUS = 1 / 120


def load_pyvista():
    """The module pyvista, ready to draw without a screen.

    Raises:
        SceneError: pyvista or a system library that it needs is missing.
    """
    # EGL draws without a screen; without this VTK would try X first and print warnings.
    if not os.environ.get("DISPLAY"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    try:
        import pyvista
        import pyvista.plotting  # loads VTK's windows and the system's libraries, which may be missing
    except ImportError as missing:
        raise SceneError(
            f"pictures need pyvista ({missing}): pip install 'cosserat-fenicsx[pictures]', and on Debian "
            "apt install libegl1 libgl1 libxrender1"
        ) from None
    return pyvista


def prefix(value):
    """(scale, SI prefix) that suit a value."""
    return next(((s, p) for s, p in _PREFIXES if abs(value) >= s), (1.0, ""))


@dataclass(frozen=True)
class Body:
    """A deformed rod: centreline (n, 3) m, directors (n, 3, 3), outline (n, corners, 2) m, radius m, bending moment
    (n,) N m."""

    line: np.ndarray
    directors: np.ndarray
    outline: np.ndarray
    radius: float
    moment: np.ndarray


def at_rest(scene):
    """The centrelines of all rods in the reference, a list of (201, 3), m."""
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
    """(n, corners, 2) corners of the sections at arc lengths s (n,), m; all are resampled to the largest number of
    corners."""
    sections = [rod.section_at(s[0])] * len(s) if rod.profile.constant else [rod.section_at(x, "left") for x in s]
    given = [section.stiffness(rod.material).outline for section in sections]
    drawn = [np.array(x or Circle(0.02 * rod.length).stiffness(Material(E=1.0)).outline) for x in given]
    most = max(map(len, drawn))
    return np.array([outline if len(outline) == most else _resampled(outline, most) for outline in drawn])


def _resampled(outline, corners):
    """A closed polygon resampled to another number of corners, evenly spaced along it."""
    closed = np.concatenate([outline, outline[:1]])
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.linspace(0, way[-1], corners, endpoint=False)
    return np.column_stack([np.interp(at, way, closed[:, i]) for i in range(2)])


def thickening(body, size):
    """The factor that the section of a `Body` is enlarged by in a drawing of extent `size`, m."""
    return max(1.0, size * _SMALLEST_RADIUS / body.radius)


def points_of(body, factor):
    """(n * corners, 3) points of the surface of a `Body`, m, its sections enlarged by a factor."""
    points = body.line[:, None] + factor * np.einsum("nij,ncj->nci", body.directors[:, :, :2], body.outline)
    return points.reshape(-1, 3)


def add_body(plotter, pyvista, body, factor, peak, moving=False):
    """Draw the surface of a `Body`, closed at both ends, coloured by bending moment from 0 to `peak`, N m.

    Returns:
        The mesh; its points may be changed later where `moving`.
    """
    corners = body.outline.shape[1]
    rings = np.arange(len(body.line) * corners).reshape(-1, corners)
    right = np.roll(rings, -1, axis=1)
    quads = np.stack([rings[:-1], right[:-1], right[1:], rings[1:]], axis=-1).reshape(-1, 4)
    faces = np.column_stack([np.full(len(quads), 4), quads]).ravel()
    caps = np.concatenate([[corners, *rings[0][::-1]], [corners, *rings[-1]]])
    surface = pyvista.PolyData(points_of(body, factor), np.concatenate([faces, caps]))
    surface = surface.triangulate()  # the caps of an I section are not convex
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
    """Draw axes with units around points (n, 3), m, and place the camera so that it shows them all."""
    span = np.ptp(everywhere, axis=0)
    bounds, counts = _bounds(everywhere, float(span.max()))
    plotter.show_bounds(
        bounds=bounds, xtitle="x (m)", ytitle="y (m)", ztitle="z (m)", color="black", font_size=8,
        location="outer", fmt="%.4g", use_3d_text=False, **counts,
    )  # fmt: skip
    _place_camera(plotter, np.reshape(bounds, (3, 2)), span)


def _bounds(points, size):
    """Round limits of the axes, and the number of labels on each."""
    step = 10 ** math.floor(math.log10(size / 5))
    step *= next(f for f in (1, 2, 5, 10) if size / (f * step) <= 6)
    low, high = step * np.floor(points.min(axis=0) / step + 1e-9), step * np.ceil(points.max(axis=0) / step - 1e-9)
    counts = np.round((high - low) / step).astype(int) + 1
    flat = counts == 1
    low, high = low - 0.03 * size * flat, high + 0.03 * size * flat
    labels = {f"n_{axis}labels": int(max(n, 2)) for axis, n in zip("xyz", counts, strict=True)}
    return tuple(np.column_stack([low, high]).ravel()), labels


def view_of(span):
    """Directions for a drawing whose extents along x, y and z are `span` (3,).

    Returns:
        Unit vectors (3,): to the camera, to the right and upwards in the picture; and the upward direction in space.
    """
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


def _place_camera(plotter, bounds, span):
    """View a plane scene along its normal, others from a corner, with margins for labels, title and colour bar."""
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
