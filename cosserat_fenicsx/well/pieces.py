"""A string in its hole, cut where anything jumps: stations, components, friction."""

from collections import namedtuple

import numpy as np

from cosserat_fenicsx.checks import warn
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.well.components import weight_in_mud

#: Arrays over pieces, from the surface down. top, bottom: measured depths (m); component: index from the bit up;
#: weight: in mud (N/m); friction; radius: of contact (m); hole: its radius (m); axial, around: (c, e) of the slip
#: direction; t, n: downward components of tangent and normal at the bottom, b: of the binormal (constant); curvature:
#: its size (1/m).
Pieces = namedtuple("Pieces", "top bottom component weight friction radius hole axial around t n b curvature")


def pieces_of(hole, string, operation, mud, depth):
    """The `Pieces` of a string whose lower end is at a measured depth (m), and its components in their places.

    Raises:
        SceneError: a string that does not fit the hole: too long, too short, too wide, or a hole that ends above it.
    """
    if not 0 < depth <= hole.length * (1 + 1e-12):
        raise SceneError(
            f"torque_and_drag: depth = {depth:.10g} m: expected a measured depth in the hole, which ends at "
            f"{hole.length:.10g} m (survey {hole.path.length:.10g} m, sections {hole.sections[-1].to:.10g} m)"
        )
    laid = string.laid(depth)
    ends = [place.top for place in laid]
    cuts = np.concatenate([hole.path.md, ends, [section.to for section in hole.sections], [depth]])
    cuts = np.unique(cuts[(cuts >= 0) & (cuts <= depth)])
    cuts = cuts[np.diff(cuts, prepend=-1.0) > 1e-9]  # m; rounding of lengths that add up to a station
    cuts[-1] = depth
    top, bottom = cuts[:-1], cuts[1:]
    middle = (top + bottom) / 2
    component = np.searchsorted(-np.array(ends), -middle)
    weights = np.array([weight_in_mud(place.component, mud) for place in laid])
    for place, weight in zip(laid, weights, strict=True):
        if weight < 0:
            warn(f"{place.component.name} floats: it weighs {weight:g} N/m in mud")
    radii = np.array([place.component.contact_radius for place in laid])
    slip = np.array([operation.direction(radius) for radius in radii])
    _check_widths(hole, laid)
    section = np.searchsorted(hole.path.md, middle) - 1
    return Pieces(
        top, bottom, component, weights[component], hole.at(middle, "friction"), radii[component],
        hole.at(middle, "diameter") / 2, *slip[component].T, *_downward(hole.path, section, bottom),
    ), laid  # fmt: skip


def _downward(path, section, bottom):
    """Downward components of tangent, normal and binormal of arcs at their places, and their curvatures."""
    t, k = path.sections.tangent[section], path.sections.curvature[section]
    curvature = np.sqrt((k * k).sum(axis=-1))
    bent = curvature > 0
    normal = k / np.where(bent, curvature, 1.0)[:, None]
    angle = curvature * (bottom - path.sections.start[section])
    down = np.cos(angle) * t[:, 2] + np.sin(angle) * normal[:, 2]
    # a straight line's load is its weight across: the normal in the vertical plane
    across = np.where(bent, np.cos(angle) * normal[:, 2] - np.sin(angle) * t[:, 2], np.hypot(t[:, 0], t[:, 1]))
    binormal = t[:, 0] * normal[:, 1] - t[:, 1] * normal[:, 0]
    return down, across, binormal, curvature


def _check_widths(hole, laid):
    above = 0.0
    for section in hole.sections:
        for place in laid:
            wide = 2 * place.component.contact_radius
            if place.bottom > above and place.top < section.to and wide > section.diameter * (1 + 1e-9):
                raise SceneError(
                    f"{place.component.name}: {wide:g} m wide at md = {max(above, place.top):g} to "
                    f"{min(section.to, place.bottom):g} m: expected at most the diameter of the hole there, "
                    f"{section.diameter:g} m"
                )
        above = section.to
