"""Where a solution needs short elements: in boundary layers of bending, and where two meshes differ most."""

import numpy as np

from cosserat_fenicsx.numerics import conjugate_product, directors
from cosserat_fenicsx.results.compared import POSITION, halfway

# Largest length of an element next to a support, load or kink, over the length of the boundary layer there.
_COARSE = 4.0
# Largest number of nodes in contact that pressure is extrapolated from.
_EXTRAPOLATED = 4


def layer_lengths(scene, scales, layout, rule, n):
    """Lengths sqrt(EI/|n|) of the boundary layers in which bending decays next to a support or a load.

    Args:
        scales: units of n; layout, rule: of the mesh.
        n: (states, elements, points, 3) contact forces at the Gauss points, dimensionless, all rods one after another.

    Returns:
        For every rod (elements,), over the length of the rod; None where all elements are shorter than these.
    """
    force = np.sqrt(3) * np.abs(n).max(initial=0.0) * scales.force
    if all(
        force * (np.diff(breaks).max() * rod.length / _COARSE) ** 2 <= rod.profile.range[0].J[:2].min()
        for rod, breaks in zip(scene.rods, layout.breaks, strict=True)
    ):
        return None
    lengths, first = [], 0
    largest = np.sqrt(np.square(n).sum(axis=3).max(axis=(0, 2))) * scales.force
    for rod, x in zip(scene.rods, layout.inside(rule.gauss), strict=True):
        forces = largest[first : first + len(x)]
        first += len(x)
        bending = rod.stiffness_at(x.ravel() * rod.length).J[:, :2].min(axis=1).reshape(x.shape).min(axis=1)
        lengths.append(np.sqrt(bending / np.maximum(forces, 1e-300)) / rod.length)
    return lengths


def of_path(path):
    """`layer_lengths` of the largest contact forces over all points of a path."""
    n = path._stacked("gauss_fields")[..., :3]
    return layer_lengths(path.scene, path.scales, path.layout, path.rule, n)


def winding_lengths(path):
    """Lengths 1/k for the wave numbers k with which rods under moments buckle, as in cos(k s).

    Under a torque T that is k = T/EI (Greenhill 1883), under a moment M about the stiff axis
    k^2 = (M^2/EI GJ) (1 - EI/EI_max) (1 - GJ/EI_max), with the smaller EI (Michell 1899, Prandtl 1899).

    Returns:
        For every rod (elements,), over the length of the rod, of the largest moments over all points of a path.
    """
    fields, scale = path._stacked("gauss_fields"), path.scales.moment
    m, d3 = fields[..., 3:6], fields[..., 6:] / np.linalg.norm(fields[..., 6:], axis=-1, keepdims=True)
    torque = np.einsum("...i,...i", m, d3)
    bending = np.linalg.norm(m - torque[..., None] * d3, axis=-1)
    torque, bending = (scale * np.abs(x).max(axis=(0, 2)) for x in (torque, bending))
    lengths, first = [], 0
    for rod, breaks in zip(path.scene.rods, path.layout.breaks, strict=True):
        *flexural, torsional = rod.profile.range[0].J
        soft, stiff = sorted(flexural)
        tilting = max(0.0, (1 - soft / stiff) * (1 - torsional / stiff)) / (soft * torsional)
        here = slice(first, first := first + len(breaks) - 1)
        k = np.maximum(torque[here] / soft, np.sqrt(tilting) * bending[here])
        lengths.append(1 / np.maximum(k * rod.length, 1e-300))
    return lengths


def turns_of(path, most):
    """For every rod (elements,): the largest angle, rad, by which the moments at the Gauss points turn sections along
    an element, relative to the rest state, at any point of a path; None where none is larger than `most`."""
    m = path._stacked("gauss_fields")[..., 3:6]
    of_rods = list(zip(path.scene.rods, path.layout.breaks, strict=True))
    softness = [path.scales.moment * rod.length / rod.profile.range[0].J.min() for rod, _ in of_rods]
    largest = max(np.diff(breaks).max() * soft for (_, breaks), soft in zip(of_rods, softness, strict=True))
    if np.sqrt(3) * np.abs(m).max(initial=0.0) * largest <= most:
        return None
    m = (np.linalg.norm(m, axis=3) @ path.rule.weights).max(axis=0)
    found, first = [], 0
    for (_, breaks), soft in zip(of_rods, softness, strict=True):
        cells = slice(first, first := first + len(breaks) - 1)
        found.append(m[cells] * np.diff(breaks) * soft)
    return found if max(turns.max() for turns in found) > most else None


def contact_edges(path):
    """For every rod the places where contact with a wall begins or ends, over its length, ascending, at all points of a
    path; None where the scene has no walls. The pressure is extrapolated from the last nodes in contact."""
    if not any(action.presses for action in path.scene.actions):
        return None
    pressures = np.linalg.norm(path._stacked("densities")[1][..., :3], axis=3)
    found = []
    for i, x in enumerate(path.layout.node_s(path.rule.nodes)):
        of_rod = pressures[:, path._cells(i)]
        nodal = np.concatenate([of_rod[:, :, :-1].reshape(len(path), -1), of_rod[:, -1:, -1]], axis=1)
        edges = []
        for p in nodal:
            touching = p > 0
            for k in np.flatnonzero(touching[1:] != touching[:-1]).tolist():
                last, step = (k, -1) if touching[k] else (k + 1, 1)
                edges.append(_vanishes(x, p, last, step, x[last - step]))
        found.append(np.unique(edges))
    return found


def _vanishes(x, p, last, step, beyond):
    """Where a pressure p at nodes x vanishes between x[last] and `beyond`, from the nodes in contact; `step`: to the
    next one of these."""
    nodes = [last]
    while len(nodes) < _EXTRAPOLATED and 0 <= nodes[-1] + step < len(x) and p[nodes[-1] + step] > 0:
        nodes.append(nodes[-1] + step)
    unit = beyond - x[last]
    places = (x[nodes] - x[last]) / unit  # 0 at the last node in contact, 1 beyond
    fitted = np.polynomial.Polynomial.fit(places, p[nodes], len(nodes) - 1, domain=[-1, 1], window=[-1, 1])
    roots = [z.real for z in fitted.roots() if abs(z.imag) < 1e-9 and 0 <= z.real <= 1] if len(nodes) > 1 else []
    return x[last] + unit * (min(roots) if roots else 0.5)


def unresolved(scene, layout, lengths):
    """Whether elements at the ends of pieces (see `rodmesh`) are too long for boundary layers there."""
    for breaks, pieces, layers in zip(layout.breaks, layout.pieces(scene), lengths, strict=True):
        sizes = np.diff(breaks)
        at_ends = np.unique([k for piece in pieces for k in (piece.start, piece.stop - 1)])
        if (sizes[at_ends] > _COARSE * layers[at_ends]).any():
            return True
    return False


def resolves(layout, lengths):
    """Whether all elements are short enough for the boundary layers in them; `lengths` as `layer_lengths` returns."""
    return lengths is None or all(
        (np.diff(breaks) <= _COARSE * layers).all() for breaks, layers in zip(layout.breaks, lengths, strict=True)
    )


def element_differences(fine, coarse):
    """The contribution of each element to the difference of the positions on two meshes.

    It is the largest of three: the difference within the element, relative to the line between its ends; that of the
    relative displacement of its ends; and that of their relative rotation times a lever arm. The lever arm is the
    length over which the rest of the rod follows this rotation: the rod's length, or sqrt(EI/|n|) under tension.

    Args:
        fine, coarse: Paths with the same points; every element of `fine` lies within one of `coarse`.

    Returns:
        For every rod (elements of the coarse mesh,): maximum over all points, relative to the largest displacement of
        each point.
    """
    sizes = fine._reference.sizes[POSITION]
    n = coarse._stacked("gauss_fields")[..., :3]
    forces = np.sqrt(np.square(n).sum(axis=3).max(axis=2))
    found, first, p, scales = [], 0, fine.degree, fine.scales
    for i, rod in enumerate(fine.scene.rods):
        nodes, count = coarse.layout.node_s(coarse.rule.nodes)[i], coarse.elements[i]
        x = halfway(nodes)
        moved = [path.motion(rod, x) for path in (coarse, fine)]
        inside = 2 * p * np.arange(count)[:, None] + np.arange(2 * p + 1)
        off = (moved[0] - moved[1])[:, inside, :3]
        along = halfway(coarse.rule.nodes)[:, None]
        off -= off[:, :, :1] * (1 - along) + off[:, :, -1:] * along
        ends = x[:: 2 * p]
        rest = rod.curve.position(ends * rod.length) / scales.length
        deformed = [_deformation(m[:, :: 2 * p], rest) for m in moved]
        past, turned = (np.linalg.norm(a - b, axis=2) for a, b in zip(*deformed, strict=True))
        bending = rod.profile.range[1].J[:2].max() / (scales.moment * scales.length)
        lever = 1 / np.sqrt((scales.length / rod.length) ** 2 + forces[:, first : first + count] / bending)
        first += count
        differences = np.maximum(np.linalg.norm(off, axis=3).max(axis=2), np.maximum(past, lever * turned))
        found.append((differences / sizes[:, None]).max(axis=0))
    return found


def _deformation(motion, rest):
    """Relative displacements of the two ends of elements, in the mean frame of both ends, and their relative rotations.

    Args:
        motion: (points, ends, 7) displacements and unit quaternions; rest: (ends, 3) reference positions.

    Returns:
        Two arrays (points, elements, 3), the second twice the vector parts of quaternions.
    """
    q = motion[:, :, 3:]
    half_way = (q[:, :-1] + q[:, 1:]).reshape(-1, 4)
    frames = directors(half_way / np.linalg.norm(half_way, axis=1, keepdims=True)).reshape(len(q), -1, 3, 3)
    past = np.einsum("kcij,kci->kcj", frames, np.diff(motion[:, :, :3] + rest, axis=1))
    return past, 2 * conjugate_product(q[:, :-1], q[:, 1:])
