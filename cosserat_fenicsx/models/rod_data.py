"""The data of a scene's rods: law, reference frame and strain at the Gauss points, mass and inertia at the nodes.

K are the principal values of the stiffness A against stretch and shear, J those of the stiffness S against bending and
torsion where there is no contact force, see forms/law.py. Diagonal sections need no more; where a section of the scene
couples strains, the principal axes of A and S and the coupling G are stored too.

At a jump of mass or inertia each element has the value of its side."""

from collections import namedtuple

import numpy as np
import ufl
from dolfinx import fem

from cosserat_fenicsx import compat
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.forms.law import CoupledLaw, DiagonalLaw
from cosserat_fenicsx.numerics import lobatto_weights, once_each
from cosserat_fenicsx.scene.curves import frames_along
from cosserat_fenicsx.scene.rod import require_inertia

#: Arrays (.., 3) K and J, which may be infinite in K; and (.., 3, 3), or None where all sections are diagonal: the
#: principal axes of A and of S as columns, and G. Dimensionless.
LawData = namedtuple("LawData", "K J A_axes S_axes G", defaults=(None, None, None))


def law_data(along, scales, *, coupled):
    """The `LawData` of `Stiffnesses` in units of `scales`; coupled: whether full matrices, even of diagonal ones."""
    force, length = scales.force, scales.length
    K, J = along.K / force, along.J / (force * length**2)
    if not coupled:
        return LawData(K, J)
    if along.matrix is None:
        axes = np.broadcast_to(np.eye(3), (*K.shape, 3))
        return LawData(K, J, axes, axes, np.zeros(axes.shape))
    M = along.matrix / force
    B, D = M[..., :3, 3:] / length, M[..., 3:, 3:] / length**2
    K, A_axes = np.linalg.eigh(M[..., :3, :3])
    with np.errstate(divide="ignore"):
        K_inv = np.where(K > 0, 1 / K, 0.0)  # a viscosity may be zero
    G = spread(K_inv, A_axes) @ B
    S = D - np.swapaxes(B, -1, -2) @ G
    J, S_axes = np.linalg.eigh((S + np.swapaxes(S, -1, -2)) / 2)
    return LawData(K, J, A_axes, S_axes, G)


def spread(values, axes):
    """(.., 3, 3) the symmetric matrices with these principal values and axes."""
    return (axes * values[..., None, :]) @ np.swapaxes(axes, -1, -2)


def turned(data, P):
    """`LawData` (or what has its fields) with components along other axes: a becomes P a, P (.., 3, 3)."""
    G = P @ data.G @ np.swapaxes(P, -1, -2)
    return data._replace(A_axes=P @ data.A_axes, S_axes=P @ data.S_axes, G=G)


def field_values(data, stiff):
    """Values of the Functions K, K_inv, K_stiff, J and G, (elements, points, k), of `LawData`: diagonals, or matrices
    row by row; stiff: the bounded K for the second variation."""
    finite = np.where(np.isinf(data.K), 0.0, data.K)
    K, K_inv, K_stiff = (stretch_values(data, values) for values in (finite, 1 / data.K, stiff))
    return K, K_inv, K_stiff, _numbers(data.J, data.S_axes), _rows(data.G)


def stretch_values(data, K):
    """Values of the Function of a stretch and shear stiffness with the principal values K."""
    return _numbers(K, data.A_axes)


def viscous_values(data):
    """Values of the Functions of a viscous law, in the order of `law_of`; the inverse is None."""
    return stretch_values(data, data.K), None, _numbers(data.J, data.S_axes), _rows(data.G)


def _numbers(values, axes):
    return values if axes is None else _rows(spread(values, axes))


def _rows(matrix):
    return None if matrix is None else matrix.reshape(*matrix.shape[:-2], 9)


def law_of(K, K_inv, J, G):
    """The law used in forms, from Functions filled by `field_values`; G is None where it is diagonal."""
    if G is None:
        return DiagonalLaw(K, K_inv, J)
    return CoupledLaw(*(a if a is None else as_matrix(a) for a in (K, K_inv, J, G)))


def as_matrix(a):
    """The 3 x 3 matrix of nine numbers, row by row."""
    return ufl.as_matrix([[a[3 * i + j] for j in range(3)] for i in range(3)])


# EA and GA are bounded in the second variation, of which only the signs of the eigenvalues matter: with larger values,
# rounding errors would exceed the eigenvalues of bending of slender rods and of weak modes of thin blades. The bound is
# `ContactForce.stiff` times EI/L^2, with L from `bending_lengths`. A bound of B EI/L^2 changes the critical load of a
# mode with n half waves relatively by about (n pi)^2/B. Therefore it is up to _HIGHER times higher where rounding
# permits: at most _ROOM times the bending stiffness about the weak axis times (element length over rod length)^2. Forms
# raise it with the contact force (`law.stiffness_for`). Where rods of a structure hold each other, as thin guys hold a
# mast, the stiffest of them decides: its bound holds for all, up to _MOST_ROOM in place of _ROOM.
_HIGHER, _ROOM, _MOST_ROOM = 100.0, 1e10, 1e13

#: Arrays (elements, points, k) in the scene's order, dimensionless: the fields of `LawData`, frames R_R (3 x 3) and
#: strains v_R.
RodData = namedtuple("RodData", (*LawData._fields, "R_R", "v_R"))


def rod_data(scene, layout, scales, rule, reference, *, coupled):
    """Law and reference at the Gauss points.

    The reference strain is that of the interpolated curve, so that the discrete rod is free of stress at rest; it
    differs from (0, 0, 1) by the interpolation error, which does not reduce the order of convergence. rule: the
    `ElementRule`; reference: (nodes, 3) positions at rest over the unit of length; coupled: whether the law couples
    strains."""
    xs, counts = layout.inside(rule.gauss), np.array(layout.counts)

    def law_of_rod(i):
        rod = scene.rods[i]
        return law_data(rod.stiffness_at(xs[i] * rod.length), scales, coupled=coupled)

    law = joined(once_each([(rod.profile.alike, count) for rod, count in zip(scene.rods, layout.counts, strict=True)],
                           law_of_rod))  # fmt: skip
    x, points = np.concatenate(xs), len(rule.gauss)
    frames = frames_along([rod.curve for rod in scene.rods], x.ravel(), counts * points).reshape(*x.shape, 3, 3)
    p = len(rule.nodes) - 1
    first = p * np.arange(counts.sum()) + np.repeat(np.arange(len(counts)), counts)
    h = layout.sizes(scene) / scales.length
    r_s = np.einsum("gj,cji->cgi", rule.slopes, reference[first[:, None] + np.arange(p + 1)]) / h[:, None, None]
    return RodData(*law, frames.reshape(*frames.shape[:2], 9), np.einsum("cgij,cgi->cgj", frames, r_s))


def joined(parts):
    """Concatenate the named tuples of arrays of all rods."""
    fields = (None if field[0] is None else np.concatenate(field) for field in zip(*parts, strict=True))
    return type(parts[0])(*fields)


#: The same as dolfinx Functions, see `field_values`; K_inv is zero where K is infinite, K_stiff is bounded. In a
#: plane R_R is the tangent.
class RodFields(namedtuple("RodFields", "K K_inv K_stiff J G R_R v_R")):
    """The fields of `RodData` as Functions, see above."""

    @property
    def law(self):
        """The law used in forms."""
        return law_of(self.K, self.K_inv, self.J, self.G)

    def stiff_law(self, n):
        """The law of the second variation at a contact force n: bounded stiffnesses, raised where n requires it."""
        return law_of(self.K_stiff, self.K_inv, self.J, self.G).raised(ufl.sqrt(ufl.dot(n, n)))


def gauss_function(mesh, points, size):
    """A Function of `size` components at the Gauss points of every element."""
    return fem.Function(compat.function_space(mesh, compat.at_quadrature_points(mesh, 2 * points - 1, size)))


def element_function(mesh, degree, size):
    """A Function of `size` components at the nodes of every element, where neighbours may have different values."""
    return fem.Function(compat.function_space(mesh, compat.lagrange(mesh, degree, size, discontinuous=True)))


def rod_fields(mesh, points, frame, strain, *, coupled):
    """Empty `RodFields` with `frame` components of R_R and `strain` of v_R, for a coupled or diagonal law."""
    law = (9,) * 5 if coupled else (3, 3, 3, 3, 0)
    return RodFields(*(gauss_function(mesh, points, size) if size else None for size in (*law, frame, strain)))


def bending_lengths(data, lengths, counts):
    """(elements,) length scale of bending of each rod: its length, or the length of one radian of its arc if shorter.
    (The compliances of a coil of radius R due to bending and to shear are proportional to R^2/EI and 1/K, whatever the
    length L of its wire: with K bounded by 1e6 EI/L^2 a spring of 40 turns would be 6 % too soft.)"""
    tangents = data.R_R[:, :, 2::3]
    along, first = tangents.reshape(-1, 3), np.cumsum([0, *counts[:-1]]) * tangents.shape[1]
    turned = np.append(0.0, np.arccos(np.clip(np.einsum("ki,ki->k", along[1:], along[:-1]), -1.0, 1.0)))
    turned[first] = 0.0
    return np.repeat(lengths / np.maximum(1.0, np.add.reduceat(turned, first)), counts)


def bounded(data, stiff, sizes, lengths, structures):
    """The bounded K of the second variation, by sizes of elements, `bending_lengths`, and their structures' numbers."""
    strong, weak = (bend(data.J, axis=2, keepdims=True) for bend in (np.max, np.min))
    lengths, sizes = lengths[:, None, None], sizes[:, None, None]
    least = stiff * strong / lengths**2
    stiffest = np.zeros(structures.max() + 1)
    np.maximum.at(stiffest, structures, least.max(axis=(1, 2)))
    room = weak * sizes**2 / lengths**4
    alone = np.maximum(least, np.minimum(_HIGHER * least, _ROOM * room))
    joined = np.minimum(stiffest[structures][:, None, None], _MOST_ROOM * room)
    return np.minimum(data.K, np.maximum(alone, joined))


def fill_fields(fields, rods, data, stiff):
    """Put `RodData` and the bounded K into `RodFields`."""
    for function, array in zip(fields, (*field_values(data, stiff), data.R_R, data.v_R), strict=True):
        if function is not None:
            rods.fill(function, array)


def check_inertia(scene):
    """A SceneError for a rod without mass or inertia, or for an action that stands for inertia."""
    for i, load in enumerate(scene.loads):
        if load.of_inertia:
            raise SceneError(
                f"Scene.loads[{i}] ({type(load).__name__}) stands for the inertia of a motion: expected a scene "
                "without it, which may start from an equilibrium with it (simulate(start=path), Scene.velocities)"
            )
    for rod in scene.rods:
        require_inertia(rod, "a motion")


#: At the nodes of every element, (elements, p + 1, ..): mass, kg/m; Jrho about d_1, d_2, d_3 (3,), kg m; frames at rest
#: (3, 3); offset of the mass centre (3,), m, and the moment of inertia that it adds (3, 3), kg m, inertial at rest; and
#: tangents at rest times the square root of the mass, kg/m, that does not move along them (3,).
NodalInertia = namedtuple("NodalInertia", "mass J frames offset apart lateral")


def nodal_inertia(scene, layout, nodes):
    """The `NodalInertia` of a scene; point masses are added to one of the adjacent elements. The mass of a rod lies at
    the offset a, masses that move with its axis lie on it: together a mass m at the offset a m_rod/m, and a moment of
    inertia m_rod (m - m_rod)/m (a.a - a a) in addition to that of the section."""
    parts, weights = [], lobatto_weights(nodes)
    for i, (rod, x) in enumerate(zip(scene.rods, layout.inside(nodes), strict=True)):
        s = x * rod.length
        along, frames = _by_side(rod.stiffness_at, s), rod.curve.frame(s.ravel()).reshape(*s.shape, 3, 3)
        own, J = (_pick(*(getattr(side, name) for side in along)) for name in ("mass", "inertia"))
        added = list(_added(scene, rod, s))
        mass = own + sum(across for across, _ in added)
        for action in scene.loads:
            body = action.inertia(rod) if action.station is not None and action.station.rod is rod else None
            if body is not None:  # divided by the node's quadrature weight, which multiplies it again
                vertex = layout.vertex(scene, action.station)[1]
                cell = min(vertex, layout.counts[i] - 1)
                at = cell, -1 if vertex > cell else 0
                length = weights[at[1]] * (layout.breaks[i][cell + 1] - layout.breaks[i][cell]) * rod.length
                mass[at] += body[0] / length
                J[at] += body[1] / length
        offset = _pick(*_by_side(rod.mass_centre.at, s)) if rod.mass_centre else np.zeros((*s.shape, 3))
        arm = np.einsum("...ij,...j->...i", frames, offset)
        squares = np.einsum("...i,...i->...", arm, arm)[..., None, None] * np.eye(3)
        apart = (own * (mass - own) / mass)[..., None, None] * (squares - arm[..., :, None] * arm[..., None, :])
        left_out = sum((across - along for across, along in added), np.zeros(s.shape))
        tangents = np.sqrt(left_out)[..., None] * frames[..., 2]
        parts.append(NodalInertia(mass, J, frames, arm * (own / mass)[..., None], apart, tangents))
    return joined(parts)


def _added(scene, rod, s):
    """(across, along) masses that move with the axis, each (elements, p + 1), of every action along a rod."""
    for action in scene.loads:
        if action.station is None and action.acts_on(rod):
            after, before = _by_side(lambda s, side, action=action: action.added_mass(rod, s, side), s)
            if after is not None:
                yield tuple(_pick(a, b) for a, b in zip(after, before, strict=True))


def _by_side(function, s):
    """Values at the nodes of elements as limits from above, and from below."""
    return tuple(function(s, side) for side in ("right", "left"))


def _pick(after, before):
    """At the first node of every element the limit from above, at all others that from below."""
    first = np.arange(after.shape[1]) == 0
    return np.where(first.reshape(-1, *(1,) * (after.ndim - 2)), after, before)
