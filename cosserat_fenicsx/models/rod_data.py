"""The data of a scene's rods at the Gauss points: their law, reference frame and reference strain."""

from collections import namedtuple

import numpy as np
from dolfinx import fem

from cosserat_fenicsx import compat
from cosserat_fenicsx.models.laws import LawData, field_values, law_data

# EA and GA are bounded in the second variation, of which only the signs of the eigenvalues matter: with larger values,
# rounding errors would exceed the eigenvalues of bending of slender rods and of weak modes of thin blades. The bound is
# `ContactForce.stiff` times EI/L^2, with L from `bending_lengths`. A bound of B EI/L^2 changes the critical load of a
# mode with n half waves relatively by about (n pi)^2/B. Therefore it is up to _HIGHER times higher where rounding
# permits: at most _ROOM times the bending stiffness about the weak axis times (element length over rod length)^2. Forms
# raise it with the contact force (`law.stiffness_for`).
_HIGHER, _ROOM = 100.0, 1e10

#: Arrays (elements, points, k) in the scene's order, dimensionless: the fields of `LawData`, frames R_R (3 x 3) and
#: strains v_R.
RodData = namedtuple("RodData", (*LawData._fields, "R_R", "v_R"))


def rod_data(scene, layout, scales, rule, reference, *, coupled):
    """Law and reference at the Gauss points.

    The reference strain is that of the interpolated curve, so that the discrete rod is free of stress at rest; it
    differs from (0, 0, 1) by the interpolation error, which does not reduce the order of convergence.

    Args:
        rule: the `ElementRule`; reference: (nodes, 3) positions at rest over the unit of length.
        coupled: whether the law couples strains.
    """
    parts, first = [], 0
    for rod, breaks, x in zip(scene.rods, layout.breaks, layout.inside(rule.gauss), strict=True):
        s, shape = x.ravel() * rod.length, x.shape
        along, frames = rod.stiffness_at(s.reshape(shape)), rod.curve.frame(s).reshape(*shape, 3, 3)
        p, cells = len(rule.nodes) - 1, len(breaks) - 1
        nodes = reference[first + p * np.arange(cells)[:, None] + np.arange(p + 1)]
        first += p * cells + 1
        h = np.diff(breaks) * rod.length / scales.length
        r_s = np.einsum("gj,cji->cgi", rule.slopes, nodes) / h[:, None, None]
        parts.append(RodData(
            *law_data(along, scales, coupled=coupled),
            frames.reshape(*shape, 9),
            np.einsum("cgij,cgi->cgj", frames, r_s),
        ))  # fmt: skip
    return joined(parts)


def joined(parts):
    """One named tuple of arrays from those of all rods."""
    fields = (None if field[0] is None else np.concatenate(field) for field in zip(*parts, strict=True))
    return type(parts[0])(*fields)


#: The same as dolfinx Functions, see `laws.field_values`; K_inv is zero where K is infinite, K_stiff is bounded. In a
#: plane R_R is the tangent.
RodFields = namedtuple("RodFields", "K K_inv K_stiff J G R_R v_R")


def gauss_function(mesh, points, size):
    """A Function of `size` components at the Gauss points of every element."""
    return fem.Function(compat.function_space(mesh, compat.at_quadrature_points(mesh, 2 * points - 1, size)))


def rod_fields(mesh, points, frame, strain, *, coupled):
    """Empty `RodFields` with `frame` components of R_R and `strain` of v_R, for a coupled or diagonal law."""
    law = (9,) * 5 if coupled else (3, 3, 3, 3, 0)
    return RodFields(*(gauss_function(mesh, points, size) if size else None for size in (*law, frame, strain)))


def bending_lengths(data, lengths, counts):
    """(elements,) length scale of bending of each rod: its length, or the length of one radian of its arc if shorter.

    The compliances of a coil of radius R due to bending and to shear are proportional to R^2/EI and 1/K, whatever the
    length L of its wire: with K bounded by 1e6 EI/L^2 a spring of 40 turns would be 6 % too soft.
    """
    tangents, scales = np.split(data.R_R[:, :, 2::3], np.cumsum(counts)[:-1]), []
    for length, along in zip(lengths, tangents, strict=True):
        along = along.reshape(-1, 3)
        turned = np.arccos(np.clip(np.einsum("ki,ki->k", along[1:], along[:-1]), -1.0, 1.0)).sum()
        scales.append(length / max(1.0, turned))
    return np.repeat(scales, counts)


def bounded(data, stiff, sizes, lengths):
    """The bounded K of the second variation; sizes of elements and `bending_lengths`, (elements,)."""
    strong, weak = (bend(data.J, axis=2, keepdims=True) for bend in (np.max, np.min))
    lengths, sizes = lengths[:, None, None], sizes[:, None, None]
    least = stiff * strong / lengths**2
    room = _ROOM * weak * sizes**2 / lengths**4
    return np.minimum(data.K, np.maximum(least, np.minimum(_HIGHER * least, room)))


def fill_fields(fields, rods, data, stiff):
    """Put `RodData` and the bounded K into `RodFields`."""
    for function, array in zip(fields, (*field_values(data, stiff), data.R_R, data.v_R), strict=True):
        if function is not None:
            rods.fill(function, array)
