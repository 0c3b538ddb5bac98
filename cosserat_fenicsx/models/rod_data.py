"""What forms need to know of a scene's rods at the Gauss points: stiffness, reference frame and reference strain."""

from collections import namedtuple

import numpy as np
from dolfinx import fem

from cosserat_fenicsx import compat
from cosserat_fenicsx.checks import refuse

# EA and GA are bounded where only the sign of the second variation is asked for: more would drown the bending of slender
# rods and the weak modes of thin blades in rounding. In EI/L^2 of each rod, by variant: what bends in n half waves has its critical
# load shifted by about (n pi)^2 over the bound, so it is a hundred times higher where rounding leaves room: below the bending
# stiffness about the weak axis by _ROOM times (element over rod)^2.
_STIFF = {"condensed": 1e6, "field": 1e5}
_HIGHER, _ROOM = 100.0, 1e10

#: Arrays (elements, points, k) in the scene's order, dimensionless: K, J, frames R_R (3 x 3) and strains v_R.
RodData = namedtuple("RodData", "K J R_R v_R")


def rod_data(scene, layout, scales, rule, reference):
    """Stiffness and reference at the Gauss points.

    The reference strain is that of the interpolated curve, so that the discrete rod is free of stress at rest; it
    differs from (0, 0, 1) by the interpolation error, which costs no order.

    Args:
        rule: the `ElementRule`; reference: (nodes, 3) positions at rest over the unit of length.
    """
    parts, first = [], 0
    for rod, breaks, x in zip(scene.rods, layout.breaks, layout.inside(rule.gauss), strict=True):
        s, shape = x.ravel() * rod.length, x.shape
        along, frames = rod.stiffness_at(s), rod.curve.frame(s).reshape(*shape, 3, 3)
        p, cells = len(rule.nodes) - 1, len(breaks) - 1
        nodes = reference[first + p * np.arange(cells)[:, None] + np.arange(p + 1)]
        first += p * cells + 1
        h = np.diff(breaks) * rod.length / scales.length
        r_s = np.einsum("gj,cji->cgi", rule.slopes, nodes) / h[:, None, None]
        parts.append(RodData(
            along.K.reshape(*shape, 3) / scales.force,
            along.J.reshape(*shape, 3) / (scales.moment * scales.length),
            frames.reshape(*shape, 9),
            np.einsum("cgij,cgi->cgj", frames, r_s),
        ))  # fmt: skip
    return RodData(*(np.concatenate(fields) for fields in zip(*parts, strict=True)))


#: The same as dolfinx Functions; K_inv is zero where K is infinite, K_stiff is bounded. In a plane R_R is the tangent.
RodFields = namedtuple("RodFields", "K K_inv K_stiff J R_R v_R")


def gauss_function(mesh, points, size):
    """A Function of `size` components at the Gauss points of every element."""
    return fem.Function(compat.function_space(mesh, compat.at_quadrature_points(mesh, 2 * points - 1, size)))


def rod_fields(mesh, points, frame, strain):
    """Empty `RodFields` on a mesh, with so many numbers for R_R and for v_R."""
    return RodFields(*(gauss_function(mesh, points, size) for size in (3, 3, 3, 3, frame, strain)))


def bounded(data, variant, sizes, lengths):
    """K where only the sign of the second variation is asked for; sizes of the elements and lengths of their rods, (elements,)."""
    strong, weak = (bend(data.J, axis=2, keepdims=True) for bend in (np.max, np.min))
    lengths, sizes = lengths[:, None, None], sizes[:, None, None]
    least = _STIFF.get(variant, np.inf) * strong / lengths**2
    room = _ROOM * weak * sizes**2 / lengths**4
    return np.minimum(data.K, np.maximum(least, np.minimum(_HIGHER * least, room)))


def fill_fields(fields, rods, data, stiff):
    """Put `RodData` and the bounded K into `RodFields`."""
    finite = np.where(np.isinf(data.K), 0.0, data.K)
    values = RodFields(finite, 1 / data.K, stiff, data.J, data.R_R, data.v_R)
    for function, array in zip(fields, values, strict=True):
        rods.fill(function, array)


def check_inertia(scene):
    """Refuse a rod that cannot move.

    Raises:
        SceneError: a rod without mass or inertia.
    """
    for rod in scene.rods:
        low = rod.profile.range[0]
        for field, value in (("mass", low.mass), ("inertia", low.inertia)):
            if value is None:
                owner, name = ("Stiffness", field) if rod.material is None else ("Material", "density")
                refuse(f"Rod '{rod.name}': {owner}", name, None, "a value, which a motion needs")


def nodal_inertia(scene, layout, nodes):
    """At the nodes of every element, in the scene's order: mass (elements, p + 1), kg/m, Jrho about d_1, d_2, d_3
    (elements, p + 1, 3), kg m, and frames at rest (elements, p + 1, 3, 3); on a jump each element has its own side."""
    parts = []
    for rod, x in zip(scene.rods, layout.inside(nodes), strict=True):
        s = x * rod.length
        after, before = rod.stiffness_at(s, "right"), rod.stiffness_at(s, "left")
        first = np.arange(s.shape[1]) == 0
        mass, J = np.where(first, after.mass, before.mass), np.where(first[:, None], after.inertia, before.inertia)
        parts.append((mass, J, rod.curve.frame(s.ravel()).reshape(*s.shape, 3, 3)))
    return tuple(np.concatenate(part) for part in zip(*parts, strict=True))
