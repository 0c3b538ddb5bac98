"""A string in its hole, cut into pieces where a property jumps; stresses in its sections; its rings.

Rings are bits and stabilisers, which touch at a place. A soft string lies on the wall with its weight everywhere. A
stiff one rests on its rings: they carry the load of the spans beside them, on a larger radius; and two rings close to
each other pry, one on the low and one on the high side, where a longer span beside them bends the string between them.
"""

import math
from collections import namedtuple
from itertools import pairwise

import numpy as np

from cosserat_fenicsx.checks import instance, number, warn
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.parts import per_scene
from cosserat_fenicsx.units import inch
from cosserat_fenicsx.well.components import DrillString, weight_in_mud
from cosserat_fenicsx.well.hole import Borehole, Mud
from cosserat_fenicsx.well.operations import Operation

#: Arrays over the components of a string, from the bit up; NaN where unknown. EI (N m^2), EA (N), GJ
#: (N m^2), poisson; outer, inner: radii of the body (m).
Sections = namedtuple("Sections", "EI EA GJ poisson outer inner")


def sections_of(components):
    """The `Sections` of components."""
    found = np.full((len(components), 6), np.nan)
    for row, part in zip(found, components, strict=True):
        S = part.stiffness
        if S is not None and S.matrix is None:
            row[:3] = min(S.bending), S.axial, S.torsion
        if part.outer_diameter is not None:
            row[3:] = part.material.nu, part.outer_diameter / 2, part.inner_diameter / 2
    return Sections(*found.T)


def areas(sections):
    """Of the bore and of the outer circle, m^2."""
    return np.pi * sections.inner**2, np.pi * sections.outer**2


def true_tension(sections, tension, outside, inside):
    """The force in the wall of the pipe, N, from the effective tension and the pressures (Pa)."""
    bore, whole = areas(sections)
    return tension + inside * bore - outside * whole


def stretch(sections, tension, outside, inside):
    """Strain along the pipe: of the true tension and the pressures, or, areas unknown, of the effective tension."""
    bore, whole = areas(sections)
    pressures = 2 * sections.poisson * (inside * bore - outside * whole)
    force = true_tension(sections, tension, outside, inside) - pressures
    return np.where(np.isnan(force), tension, force) / sections.EA


def von_mises(sections, true_tension, torque, moment, outside, inside):
    """(4, ...) von Mises stress of the body, Pa, at the outer surface on the two sides of bending, that in tension
    first, and so at the inner surface: of tension, bending, torsion and pressures (Lame)."""
    bore, whole = areas(sections)
    area = whole - bore
    second = np.pi / 4 * (sections.outer**4 - sections.inner**4)
    axial = true_tension / area
    mean = (inside * bore - outside * whole) / area
    rises = (inside - outside) * whole * bore / (np.pi * area)
    found = []
    for radius in (sections.outer, sections.inner):
        with np.errstate(divide="ignore", invalid="ignore"):
            differs = np.where(radius > 0, rises / radius**2, 0.0)
        hoop, radial, shear = mean + differs, mean - differs, torque * radius / (2 * second)
        for side in (1, -1):
            along = axial + side * moment * radius / second
            squares = (along - hoop) ** 2 + (hoop - radial) ** 2 + (radial - along) ** 2
            found.append(np.sqrt(squares / 2 + 3 * shear**2))
    return np.array(np.broadcast_arrays(*found))


#: Of a place: measured depth s (m), clearance (m), radius of contact (m), radius of the body beside it (m).
Ring = namedtuple("Ring", "s clearance radius body")
#: Of the string between two rings: its length, m; load, N/m; the moment (N m) at a ring that clamps it, the angle at
#: one that does not; its load on a ring, N.
_Span = namedtuple("_Span", "length load moment angle carried")

# A beam under its load q that is clamped at a ring, and touches the wall, lower by d, with no curvature: it spans
# (72 EI d/q)^(1/4) = l and bends with q l^2/6 at the ring, which carries 2/3 of q l. With a hinge at the ring it turns
# there by less than q l^3/(24 EI), as a beam between two hinges does.
_SPAN, _MOMENT, _CARRIED, _TURN = 72.0, 1 / 6, 2 / 3, 1 / 24
# Safety factor of moments, which are sums of sizes; cap on the factor by which compression enlarges bending; distance
# from a ring within which the string affects it, m; spans below the last length (m) count as absent.
_CAUTION, _ENLARGED, _REACH, _NONE = 1.5, 5.0, 60.0, 1e-9


def rings_of(laid, hole):
    """[`Ring`] of components in their places, from the bit up: bits, stabilisers and centralisers."""
    return [
        _ring(place, place.bottom - x, hole) for place in laid for x in place.component.rings(place.bottom - place.top)
    ]


def _ring(place, s, hole):
    radius = place.component.contact_radius
    clearance = max(0.0, float(hole.at(s, "diameter")) / 2 - radius)
    body = place.component.body_radius if place.component.touches is None else place.component.outer_diameter / 2
    return Ring(s, clearance, radius, body)


def bend_of(place):
    """Of a bent component in its place: (md (m), angle (rad), side (rad clockwise from the hole's high side))."""
    part = place.component
    return place.bottom - part.bend_at, math.radians(part.bend), math.radians(part.tool_face)


def free_span(EI, d, q):
    """Length (m) that a beam of bending stiffness EI (N m^2) under a load q (N/m) spans from where it is clamped to a
    wall that is lower by d (m); 0 without a load."""
    return (_SPAN * EI * d / q) ** 0.25 if q > 0 else 0.0


def prying(rings, depth, along):
    """Effects that a soft string neglects at its rings, as sums of absolute values. rings: [`Ring`] from the bit up.
    depth: of the string's end, m. along: function of two measured depths (m) that gives the largest load across (N/m),
    compression (N), curvature (1/m), clearance (m) and EI (N m^2) of the string between them. Returns (rings,) sum of
    the forces by which each pries, N; (rings,) load that it takes from the body, N."""
    if not rings:
        return np.zeros(0), np.zeros(0)
    places = [depth, *(ring.s for ring in rings), 0.0]
    clear = [0.0, *(ring.clearance for ring in rings), 0.0]
    spans = [_span(a - b, along(max(b, a - _REACH), a), max(pair))
             for (a, b), pair in zip(pairwise(places), pairwise(clear), strict=True)]  # fmt: skip
    pries, carries = np.zeros(len(rings)), np.array([a.carried + b.carried for a, b in pairwise(spans)])
    for i, (below, here, above) in enumerate(zip(spans, spans[1:-1], spans[2:], strict=False)):
        angle = max(below.angle, above.angle)
        free = (rings[i].clearance + rings[i + 1].clearance) / here.length  # the angle that the clearances leave
        if angle > free:
            pair = _CAUTION * (below.moment + above.moment) * (1 - free / angle) / here.length
            pries[i : i + 2] += max(0.0, pair - here.load * here.length / 2)
    return pries, carries


def _span(length, largest, clearance):
    """The `_Span` of a length of string beside a ring with a clearance."""
    q, compression, curvature, room, EI = largest
    if not EI > 0 or not q > 0 or length < _NONE:
        return _Span(length, q, 0.0, 0.0, q * length / 2)
    free = free_span(EI, room + clearance, q)
    short = min(length, free)
    larger = min(1 / max(1 - compression * short**2 / (np.pi**2 * EI), 1e-9), _ENLARGED)
    angle = larger * q * short**3 * _TURN / EI + curvature * short / 2
    return _Span(
        length, q, larger * q * short**2 * _MOMENT + EI * curvature, angle, q * min(length / 2, _CARRIED * free)
    )


#: Arrays over pieces, from the surface down. top, bottom: measured depths (m); component: index from the bit up;
#: weight: in mud (N/m); friction; radius: of contact (m); hole: its radius (m); axial, around: (c, e) of the slip
#: direction; t, n: downward components of tangent and normal at the bottom, b: of the binormal (constant); curvature:
#: its size (1/m).
Pieces = namedtuple("Pieces", "top bottom component weight friction radius hole axial around t n b curvature")


def checked_depth(owner, hole, string, operation, mud, depth, such="TripOut()"):
    """The measured depth (m) of the lower end of a string, by default the bottom of its hole; a SceneError for
    arguments of wrong types; owner, such: the function and an example of its operations, in messages."""
    instance(owner, "hole", hole, Borehole, "a Borehole")
    instance(owner, "string", string, DrillString, "a DrillString")
    instance(owner, "operation", operation, Operation, f"an operation, such as {such}")
    instance(owner, "mud", mud, (Mud, type(None)), "Mud(density), or None where weights are in mud")
    depth = hole.length if depth is None else depth
    return number(owner, "depth", depth, "a measured depth (m), positive", lambda x: x > 0)


def within(what, hole, depth):
    """Refuse a measured depth (m) outside a hole; what: it, in messages."""
    if not 0 < depth <= hole.length * (1 + 1e-12):
        found, feet = hole.path.depth_told(depth, most=hole.length)
        told = hole.path.told(
            f"expected a measured depth in the hole, which ends at {hole.length:.10g} m "
            f"(survey {hole.path.length:.10g} m, sections {hole.sections[-1].to:.10g} m)"
        )
        raise SceneError(f"{what} = {found}: {told}{feet}")


def pieces_of(hole, string, operation, mud, depth):
    """The `Pieces` of a string whose lower end is at a measured depth (m), and its components in their places. Raises
    SceneError: a string that does not fit the hole: too long, too short, too wide, or a hole that ends above it."""
    pieces, laid, floats = _in_place(hole, string, mud, depth)
    if mud is not None:
        mud.doubt_depths(hole, depth)
    for sentence in floats:
        warn(sentence)
    slip = np.array([operation.direction(place.component.contact_radius) for place in laid])[pieces.component]
    return pieces._replace(axial=slip[:, 0], around=slip[:, 1]), laid


@per_scene
def _in_place(hole, string, mud, depth):
    """What `pieces_of` returns, as far as it does not depend on the operation; and sentences on what floats."""
    within("torque_and_drag: depth", hole, depth)
    laid = string.laid(depth, hole.path.told)
    ends = [place.top for place in laid]
    interfaces = [] if mud is None else mud.interfaces
    cuts = np.concatenate([hole.path.md, ends, [section.to for section in hole.sections], interfaces, [depth]])
    cuts = np.unique(cuts[(cuts >= 0) & (cuts <= depth)])
    cuts = cuts[np.diff(cuts, prepend=-1.0) > 1e-9]  # m; rounding of lengths that add up to a station
    cuts[-1] = depth
    top, bottom = cuts[:-1], cuts[1:]
    middle = (top + bottom) / 2
    component = np.searchsorted(-np.array(ends), -middle)
    weight, floats = np.empty_like(middle), []
    for i, place in enumerate(laid):
        here = component == i
        weight[here] = weight_in_mud(place.component, mud, middle[here])
        if (weight[here] < 0).any():
            floats.append(f"{place.component.name} floats: it weighs {weight[here].min():g} N/m in mud")
    radii = np.array([place.component.contact_radius for place in laid])
    _check_widths(hole, laid)
    section = np.searchsorted(hole.path.md, middle) - 1
    return Pieces(
        top, bottom, component, weight, hole.at(middle, "friction"), radii[component],
        hole.at(middle, "diameter") / 2, None, None, *_downward(hole.path, section, bottom),
    ), laid, floats  # fmt: skip


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


def down_along(t, n, angle):
    """Downward components of tangent and normal of arcs, turned by an angle (rad) up the hole."""
    cos, sin = np.cos(angle), np.sin(angle)
    return t * cos - n * sin, n * cos + t * sin


def _across(diameter):
    return f"{diameter:g} m ({diameter / inch:.5g} in)"


def _check_widths(hole, laid):
    above = 0.0
    for section in hole.sections:
        for place in laid:
            wide = 2 * place.component.contact_radius
            if place.bottom > above and place.top < section.to and wide > section.diameter * (1 + 1e-9):
                where = f"{max(above, place.top):g} to {min(section.to, place.bottom):g} m"
                raise SceneError(
                    f"{place.component.name}: {_across(wide)} wide at md = {hole.path.told(where)}: expected at most "
                    f"the diameter of the hole there, {_across(section.diameter)}"
                )
        above = section.to
