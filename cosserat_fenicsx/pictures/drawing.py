"""Shared by pictures and films: surfaces of rods and their colours, a field of a result as one number per section; axes
with units, and the camera.
"""

import math
import os
import textwrap
from dataclasses import dataclass, replace

import numpy as np

from cosserat_fenicsx.errors import LibraryMissing, SceneError, nearest
from cosserat_fenicsx.pictures.charts import chosen_unit, sentence
from cosserat_fenicsx.pictures.view import Labels, View, axes_of, draw_axes, round_step
from cosserat_fenicsx.quantities import as_text
from cosserat_fenicsx.scene.sections import Circle, Material


_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"), (1e-12, "p"),
             (1e-15, "f"), (1e-18, "a"))  # fmt: skip
# First letters of the units that take such a prefix (1/m does not).
_PREFIXED = ("N", "m", "Pa", "rad")
# Maximum intervals between the numbers of the colour bar.
_BAR = 6
# Width of a picture over the size of its letters; maximum letters of a line over the colour bar.
_LETTERS, _BAR_LETTERS = 40, 12
# Largest letters of one of several drawings side by side, pixels.
_PANEL_LETTERS = 24
# Maximum intervals between ticks of the longest axis.
_TICKS = 6
# Maximum digits after the point; smaller numbers are written with a power of ten.
_MOST_DIGITS = 3
#: Smallest visible displacement as a share of the extent of the drawing.
VISIBLE = 0.01
_WALL = "peru"
# Minimum drawn radius over the extent of the drawing; the picture says which rods are enlarged.
_SMALLEST_RADIUS = 1 / 120
_FEW_RODS = 10  # most rods that are enlarged to it
# Half the least thickness of flat sections, and their largest radius for its sake, over that of round ones.
_FLAT, _BROAD = 0.35, 5.0
# Pieces of a drawn rod: at most, at least, and of all rods together where these are many.
_PIECES, _FEWEST_PIECES, _ALL_PIECES = 200, 12, 12_000


def load_pyvista():
    """The module pyvista, ready to draw without a screen; a SceneError where it or a system library is missing."""
    # EGL draws without a screen; without this VTK would try X first and print warnings.
    if not os.environ.get("DISPLAY"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    try:
        import pyvista
        import pyvista.plotting  # loads VTK's windows and the system's libraries, which may be missing
    except ImportError as missing:
        raise LibraryMissing(
            f"pictures need pyvista ({missing}): pip install 'cosserat-fenicsx[pictures]', and on Debian "
            "apt install libegl1 libgl1 libxrender1"
        ) from None
    return pyvista


def suited(value, unit="N m"):
    """(size, name) of the unit for a value in an SI unit: the requested unit, or the SI unit with a suitable prefix."""
    if chosen := chosen_unit(unit):
        return chosen[::-1]
    if not unit.startswith(_PREFIXED):
        return 1.0, unit
    size, letter = next(((s, p) for s, p in _PREFIXES if abs(value) >= s * (1 - 1e-9)), (1.0, ""))
    return size, f"{letter}{unit}"


def quantity(value, unit):
    """A value as text, to three digits, with its unit."""
    size, name = suited(value, unit)
    return f"{as_text(float(value / size), 3)} {name}"


def stage(pyvista, size, smooth="msaa", **panels):
    """An empty plotter of a size in pixels; smooth: how edges are, see `Plotter.enable_anti_aliasing`."""
    plotter = pyvista.Plotter(off_screen=True, window_size=size, **panels)
    plotter.set_background("white")
    if smooth:
        plotter.enable_anti_aliasing(smooth, **({"multi_samples": 8} if panels else {}))
    return plotter


def add_lines(plotter, pyvista, lines, color="grey"):
    """Draw lines (n, 3), m, such as rods at rest, as one mesh."""
    plotter.add_mesh(together([pyvista.lines_from_points(line) for line in lines]), color=color, line_width=2)


def thicker(factors):
    """A list of one note on the factors by which sections are enlarged; empty where none is."""
    told = sorted({f"{float(f'{factor:.2g}'):g}" for factor in factors if factor > 1} - {"1"}, key=float)
    if len(told) > 3:
        told = [f"{told[0]} to {told[-1]}"]
    return [f"sections drawn {' and '.join(told)} times their size"] if told else []


def too_small(path, shown, size, magnify):
    """A list of one note where the displacements at some points of a result could not be seen in a drawing of extent
    `size`, m, with a factor that shows them; empty where they can."""
    all_of_them = path.largest_displacement()
    largest = all_of_them[shown].max()
    if magnify * largest > VISIBLE * size or largest < 1e-12 * size:
        return []
    decade, k = 10.0 ** math.floor(math.log10(0.1 * size / largest)), int(all_of_them.argmax())
    others = f" here, {all_of_them[k]:.2g} m at {path.axis} {path.label(k)}" if all_of_them[k] > 2 * largest else ""
    return [sentence(f"displacements are at most {largest:.2g} m{others}: magnify={decade:g}")]


@dataclass(frozen=True)
class Body:
    """A deformed rod, in SI: centreline (n, 3), directors (n, 3, 3), outline (n, corners, 2), radius, values (n,)."""

    line: np.ndarray
    directors: np.ndarray
    outline: np.ndarray
    radius: float
    values: np.ndarray


def at_rest(scene):
    """The centrelines of all rods in the reference, a list of (n, 3), m."""
    x = places(len(scene.rods))
    return [rod.curve.position(x * rod.length) for rod in scene.rods]


def places(rods):
    """(n,) arc lengths over a rod's length at which its sections are drawn, by the number of rods."""
    return np.linspace(0, 1, max(_FEWEST_PIECES, min(_PIECES, _ALL_PIECES // rods)) + 1)


def swept(path, k, rod, magnify, colour):
    """The `Body` of a rod at point k of a path; `colour`: the `Colour` of its values."""
    x = places(len(path.scene.rods))
    line, directors = path.sample(k, rod, x)
    fields = path.fields(k, rod)
    values = np.interp(x, fields["s"] / rod.length, colour.of(fields))
    return body_of(rod, x, line, directors, values, magnify)


def body_of(rod, x, line, directors, values, magnify=1.0):
    """The `Body` of a rod from centreline (n, 3) m, directors and values (n,) at arc lengths x (n,) over its length."""
    reference = rod.curve.position(x * rod.length)
    outline = outlines(rod, x * rod.length)
    radius = float(np.linalg.norm(outline, axis=2).max())
    return Body(reference + magnify * (line - reference), directors, outline, radius, values)


def outlines(rod, s):
    """(n, corners, 2) corners of the sections at arc lengths s (n,), m, all resampled to the largest number."""
    if rod.profile.constant and len(s) > 1:
        return np.repeat(outlines(rod, s[:1]), len(s), axis=0)
    sections = [rod.section_at(x, "left") for x in s]
    given = [section.stiffness(rod.material).outline for section in sections]
    drawn = [np.array(x or Circle(0.02 * rod.length).stiffness(Material(E=1.0)).outline) for x in given]
    most = max(map(len, drawn))
    return np.array([outline if len(outline) == most else _resampled(outline, most) for outline in drawn])


def girth(station):
    """Half the mean width of a section over its largest radius: 1 of a round one, less of a flat one."""
    (outline,) = outlines(station.rod, np.array([station.s]))
    return float(np.sqrt(np.ptp(outline, axis=0).prod()) / np.linalg.norm(outline, axis=1).max() / 2)


def _resampled(outline, corners):
    """A closed polygon resampled to another number of corners, evenly spaced along it."""
    closed = np.concatenate([outline, outline[:1]])
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.linspace(0, way[-1], corners, endpoint=False)
    return np.column_stack([np.interp(at, way, closed[:, i]) for i in range(2)])


def thickening(body, size, rods=1):
    """The factor by which the sections of a `Body` are enlarged in a drawing of extent `size`, m, with a number of
    rods: less where they would hide each other, more where they are flat, and could not be seen from the side."""
    smallest = size * _SMALLEST_RADIUS / max(1.0, math.sqrt(rods / _FEW_RODS))
    thin = float(np.ptp(body.outline, axis=1).min()) / 2
    return max(1.0, smallest / body.radius, min(_FLAT * smallest / thin, _BROAD * smallest / body.radius))


def points_of(body, factor):
    """(n * corners, 3) points of the surface of a `Body`, m, its sections enlarged by a factor."""
    points = body.line[:, None] + factor * np.einsum("nij,ncj->nci", body.directors[:, :, :2], body.outline)
    return points.reshape(-1, 3)


def surface_of(pyvista, body, factor):
    """The surface of a `Body` as a mesh, closed at both ends, its sections enlarged by a factor."""
    corners = body.outline.shape[1]
    rings = np.arange(len(body.line) * corners).reshape(-1, corners)
    right = np.roll(rings, -1, axis=1)
    quads = np.stack([rings[:-1], right[:-1], right[1:], rings[1:]], axis=-1).reshape(-1, 4)
    faces = np.column_stack([np.full(len(quads), 4), quads]).ravel()
    caps = np.concatenate([[corners, *rings[0][::-1]], [corners, *rings[-1]]])
    surface = pyvista.PolyData(points_of(body, factor), np.concatenate([faces, caps]))
    return surface.triangulate()  # the caps of an I section are not convex


def together(surfaces):
    """Several surfaces as one, which is drawn as fast as one of them."""
    return surfaces[0].append_polydata(*surfaces[1:]) if len(surfaces) > 1 else surfaces[0]


def coloured(pyvista, bodies, factors, scale=1.0):
    """The surfaces of `Body`s as one mesh, values over `scale` as "value"; factors: of each, see `surface_of`."""
    surface = together([surface_of(pyvista, body, factor) for body, factor in zip(bodies, factors, strict=True)])
    surface["value"] = _at_points(bodies, scale)
    return surface


def _at_points(bodies, scale):
    return np.concatenate([np.repeat(body.values / scale, body.outline.shape[1]) for body in bodies])


def add_bodies(plotter, pyvista, bodies, factors, peak, colour, moving=False):
    """Draw the surfaces of `Body`s, closed at both ends, coloured by their values, as one mesh, which is returned;
    factors: of each, what enlarges its sections; peak: the largest size of the values in the picture, which the colours
    reach up to; moving: whether the mesh's points will be changed."""
    scale, name = suited(peak, colour.unit)
    step = round_step((2 if colour.signed else 1) * peak / scale or 1.0, _BAR)
    low, high = colour.limits(math.ceil(peak / scale / step - 1e-9) * step)
    unit = "zero" if peak == 0 else "" if colour.unit == "1" else f"({name})"
    words = "\n".join(filter(None, [*textwrap.wrap(colour.words, _BAR_LETTERS), unit]))
    surface = coloured(pyvista, bodies, factors, scale)
    plotter.add_mesh(
        surface,
        scalars="value",
        cmap=colour.map,
        clim=(low, high),
        smooth_shading=not moving,
        split_sharp_edges=not moving,
        scalar_bar_args=colour_bar(
            words, letters(plotter), round((high - low) / step) + 1 if peak else 0, step, (0.86, 0.25, 0.05, 0.5)
        ),
    )
    return surface


def colour_bar(title, font, numbers, step, box):
    """The arguments of pyvista for an upright bar of colours; font: pixels; numbers: how many there are, multiples of a
    round step; box: (x, y, width, height), shares of the picture."""
    x, y, width, height = box
    place = {"position_x": x, "position_y": y, "width": width, "height": height, "vertical": True}
    fonts = {"title_font_size": font, "label_font_size": font, "color": "black"}
    return {"title": f"{title}\n", "n_labels": numbers, "fmt": _format(step), **place, **fonts}


def move(surface, bodies, factors, scale=1.0):
    """Move a mesh of `coloured` to where its `Body`s are now, with their values."""
    surface.points[:] = np.concatenate([points_of(*each) for each in zip(bodies, factors, strict=True)])
    surface["value"][:] = _at_points(bodies, scale)
    surface.GetPoints().Modified()
    surface.GetPointData().GetScalars().Modified()


def add_tubes(plotter, pyvista, scene, radii, enlarged=1.0):
    """Draw the tubes that rods are in, and obstacles, translucent; radii: {rod: the radius that it is drawn with, m};
    enlarged: factor of the clearances around them."""
    low, high = np.reshape(plotter.bounds, (3, 2)).T
    for load in scene.loads:
        if (points := load.drawn(low, high)) is not None:
            surface = pyvista.StructuredGrid(*np.moveaxis(points, 2, 0))
            plotter.add_mesh(surface, color=_WALL, opacity=0.2)
            if surface.n_cells == 1:  # a plane, which may be seen edge on
                plotter.add_mesh(surface.extract_all_edges(), color=_WALL, line_width=3)
        if (tube := load.tube()) is not None:
            axis, clearance = tube
            rod = load.rod if load.station is None else load.station.rod
            wall = pyvista.MultipleLines(axis)
            wall["radius"] = enlarged * clearance + radii[rod]
            surface = wall.tube(scalars="radius", absolute=True, n_sides=24, capping=False)
            plotter.add_mesh(surface, color=_WALL, opacity=0.2)


def _format(step):
    """How multiples of a round step are written."""
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    return f"%.{digits}f" if digits <= _MOST_DIGITS else "%.3g"


def letters(plotter):
    """The size of texts in pixels: they can be read where the picture is 400 pixels wide."""
    return max(10, round(plotter.window_size[0] / _LETTERS))


def frame(
    plotter, everywhere, panel=False, *, more=None, labels=None, span=None, title=None, most=_TICKS, heights=None
):
    """Place the camera so that it shows points (n, 3), m, and draw axes with units around them.

    Args:
        panel: whether it is one of several drawings side by side, without a colour bar.
        more: further points of the picture, m, such as arrows.
        span: (3,) the extents that decide on the view, see `view.view_of`; None for the extents of the points.
        labels: a function of the `View` that makes the `Labels` of the drawing; None for labels of the axes alone.
        title: the height kept free for the title, pixels; None for a share of the window's.
        most: the maximum number of intervals between ticks on the longest axis.
        heights: bounds of the height of the window, pixels, which is made as high as the drawing; None to keep it.

    Returns:
        The `View` and the `Labels`, which are still to be drawn if they were given.
    """
    axes = axes_of(everywhere, most)
    corners = np.array(np.meshgrid(*((axis.low, axis.high) for axis in axes))).reshape(3, -1).T
    shown = corners if more is None else np.concatenate([corners, more])
    span = np.ptp(everywhere, axis=0) if span is None else span
    if heights is not None:
        width = plotter.window_size[0]
        plotter.window_size = width, round(float(np.clip(View.height(shown, span, width, title), *heights)))
    left, bottom, right, top = plotter.renderer.viewport  # the whole window, or a panel of it
    window = plotter.window_size[0] * (right - left), plotter.window_size[1] * (top - bottom)
    view = View.of(shown, span, window, panel, title)
    texts = labels(view) if labels else Labels(view)
    font = min(_PANEL_LETTERS, round(window[0] / 28)) if panel else letters(plotter)
    draw_axes(plotter, load_pyvista(), axes, view, texts, font, () if more is None else more)
    if labels is None:
        texts.draw(plotter, load_pyvista())
    view.place(plotter)
    return view, texts


#: Colours from the smallest to the largest value: of sizes (viridis), and of values of either sign (coolwarm).
MAPS = {
    "viridis": ("#440154", "#482475", "#414487", "#355f8d", "#2a788e", "#21918c", "#22a884", "#44bf70", "#7ad151",
                "#bddf26", "#fde725"),
    "coolwarm": ("#3b4cc0", "#6282ea", "#8db0fe", "#b8d0f9", "#dddddd", "#f5c4ad", "#f49a7b", "#de604d", "#b40426"),
}  # fmt: skip

# Fields of `Result.fields`: words, unit, and frames of their components: "xyz", inertial, or "123", along d1, d2, d3.
_VECTORS = {
    "displacement": ("displacement", "m", ("xyz",)),
    "force": ("contact force", "N", ("xyz", "123")),
    "moment": ("contact moment", "N m", ("xyz", "123")),
    "strain": ("strain", "1", ("123",)),
    "curvature": ("curvature", "1/m", ("123",)),
    "velocity": ("velocity", "m/s", ("xyz",)),
    "angular_velocity": ("angular velocity", "rad/s", ("xyz",)),
}
# Fields whose components are along d1, d2, d3 already.
_MATERIAL = ("strain", "curvature")
_SHORT = {"n": "force", "m": "moment"}
_ALIASES = {"tension": "n.3", "twisting_moment": "m.3"}
# Words, unit, and whether there are values of either sign.
_SCALARS = {
    "bending_moment": ("bending moment", "N m", False),
    "von_mises": ("von Mises stress", "Pa", False),
    "axial_max": ("largest axial stress", "Pa", True),
    "axial_min": ("smallest axial stress", "Pa", True),
}
_WORDS = {
    "force.3": "tension",
    "moment.3": "twisting moment",
    "strain.1": "shear strain along d1",
    "strain.2": "shear strain along d2",
    "strain.3": "stretch",
    "curvature.1": "bending about d1",
    "curvature.2": "bending about d2",
    "curvature.3": "twist",
}
# Values below this share of the scene's force, moment or length are rounding.
_ROUNDING = 1e-11
# Negative values of at most this share of the largest size are taken for zero.
_UNSIGNED = 1e-6


@dataclass(frozen=True)
class Colour:
    """A field that rods are coloured by, by a user's name; words, unit: on the colour bar; field: of `Result.fields`
    that it is computed from, by `of`, a function from their dict to one number per node; signed: whether it has either
    sign."""

    name: str
    words: str
    unit: str
    field: str
    signed: bool
    of: object

    @property
    def map(self):
        """The name of its colours, see `MAPS`."""
        return "coolwarm" if self.signed else "viridis"

    def limits(self, peak):
        """The smallest and the largest value of the colours; `peak`: the largest size of all values."""
        top = peak or 1.0
        return (-top if self.signed else 0.0), top


def _every():
    """{name: `Colour`} of all that rods can be coloured by."""
    every = {
        name: Colour(name, words, unit, name, signed, lambda f, name=name: f[name])
        for name, (words, unit, signed) in _SCALARS.items()
    }
    every["shear_force"] = Colour("shear_force", "shear force", "N", "force", False, _shear)
    for name in (*_VECTORS, *_SHORT):
        field = _SHORT.get(name, name)
        words, unit, frames = _VECTORS[field]
        every[name] = Colour(name, words, unit, field, False, lambda f, field=field: np.linalg.norm(f[field], axis=1))
        for part in "".join(frames):
            told = _WORDS.get(f"{field}.{part}", f"{words} along {part if part in 'xyz' else f'd{part}'}")
            every[f"{name}.{part}"] = Colour(f"{name}.{part}", told, unit, field, True, _component(field, part))
    every.update({name: replace(every[other], name=name) for name, other in _ALIASES.items()})
    return every


def _component(field, part):
    """A function from the dict of `Result.fields` to a component of a vector."""
    if part in "xyz" or field in _MATERIAL:
        i = ("xyz" if part in "xyz" else "123").index(part)
        return lambda f: f[field][:, i]
    return lambda f: np.einsum("ni,ni->n", f[field], f[f"d{part}"])


def _shear(fields):
    """The size of the contact force across the tangent."""
    return np.hypot(*(np.einsum("ni,ni->n", fields["force"], fields[d]) for d in ("d1", "d2")))


#: {name: `Colour`} of all that rods can be coloured by.
EVERY = _every()


def known(path):
    """{name: `Colour`} of all that the rods of a path or a motion can be coloured by."""
    given = path.fields(0)
    return {name: colour for name, colour in EVERY.items() if colour.field in given}


def colour_of(name, among=EVERY, where="plot"):
    """The `Colour` of that name among some; a SceneError with the names, and `where`, where there is none."""
    if isinstance(name, str) and name in among:
        return among[name]
    plain = ", ".join(x for x in among if "." not in x)
    hint = nearest(name, among)
    hint = f"; {hint}" if hint.startswith("did") else ""
    raise SceneError(
        f"{where}.color = {name!r}: expected {plain}, or a component such as n.x or n.3 (x, y, z: inertial; 1, 2, 3: "
        f"along d1, d2, d3, which strain and curvature have alone){hint}"
    )


def seen(colour, values, peak):
    """The `Colour` for arrays of values up to `peak`: where none is negative, its colours begin at 0."""
    least = min(float(np.nan_to_num(array).min()) for array in values)
    return replace(colour, signed=colour.signed and not (peak and least >= -_UNSIGNED * peak))


def peak_of(path, colour, values):
    """The largest size of a list of arrays of values, 0 where it is rounding; NaN where there is no value. Raises
    SceneError: there is none anywhere."""
    if all(np.isnan(array).all() for array in values):
        raise SceneError(
            f"color: {colour.words} is not known of any rod in the picture (stresses need sections with a shape, and "
            "rolled profiles have normal ones alone): choose another one, such as bending_moment"
        )
    peak = max(float(np.nan_to_num(np.abs(array)).max()) for array in values)
    scale = {"N": path.scales.force, "N m": path.scales.moment, "m": path.scales.length}.get(colour.unit, 0.0)
    return peak if peak > _ROUNDING * scale else 0.0


# sqrt(EI/N) over the length below which a rod is a cable; share of the rods' whole length above which a picture is one
# of cables.
_CABLE, _MOST = 0.1, 0.5
# Components of forces and strains along d1, d2, d3, and whether they are the moment and the curvature; the first field
# is taken where nothing is strained.
_PARTS = {
    "bending_moment": ((0, 1), True),
    "twisting_moment": ((2,), True),
    "tension": ((2,), False),
    "shear_force": ((0, 1), False),
}
# Least share by which the energy of a resultant without variation counts.
_LEAST = 0.1
# States whose fields are looked at.
_SAMPLES = 20


def default_colour(result, shown):
    """The name of the field by which the rods of a path or a motion are coloured where none is asked for: "tension" of
    cables, else the resultant whose strain energy times its variation is largest, of all rods and states `shown`.

    A rod in tension N resists loads across it by N where sqrt(EI/N), the distance from its ends over which bending
    decays, is much shorter than the rod: it is a cable, and its tension matters, whatever bends it near its ends.
    Elsewhere that resultant matters which stores most strain energy, unless it is nearly the same everywhere and would
    show one colour: each energy counts in proportion to the range of the values over their largest size.
    """
    shown = [shown[i] for i in np.unique(np.linspace(0, len(shown) - 1, min(len(shown), _SAMPLES)).astype(int))]
    energies, ranges = dict.fromkeys(_PARTS, 0.0), {name: [np.inf, -np.inf] for name in _PARTS}
    cables, whole = 0.0, 0.0
    for rod in result.scene.rods:
        fields = result.fields_at(shown, rod)
        frame = np.stack([fields["d1"], fields["d2"], fields["d3"]], axis=-2)
        n, m = (np.einsum("ksij,ksj->ksi", frame, fields[name]) for name in ("force", "moment"))
        for name, (parts, turns) in _PARTS.items():
            stored = (m * fields["curvature"] if turns else n * fields["strain"])[..., parts].sum(axis=-1) / 2
            energies[name] += _integral(fields["s"], stored).sum()
            values = (m if turns else n)[..., parts]
            values = values[..., 0] if len(parts) == 1 else np.linalg.norm(values, axis=-1)
            ranges[name] = [min(ranges[name][0], values.min()), max(ranges[name][1], values.max())]
        tension = _integral(fields["s"], n[..., 2]).max() / rod.length
        stiffness = rod.stiffness_at(fields["s"], "left").J[..., :2].max()
        cables += rod.length if tension > 0 and stiffness < tension * (_CABLE * rod.length) ** 2 else 0.0
        whole += rod.length
    if cables > _MOST * whole:
        return "tension"
    return max(energies, key=lambda name: energies[name] * _variation(*ranges[name]))


def _variation(low, high):
    """The range of values from `low` to `high` over their largest size, from `_LEAST` to 1."""
    return float(np.clip((high - low) / (max(abs(low), abs(high)) or 1.0), _LEAST, 1.0))


def _integral(s, values):
    """(k,) integrals over s (n,) of values (k, n) by the trapezoidal rule."""
    return (values[:, 1:] + values[:, :-1]) @ np.diff(s) / 2
