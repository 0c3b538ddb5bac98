"""Comparison of a path on two meshes: error estimates, and transfer of its points to another mesh."""

from collections import namedtuple

import numpy as np

# Differences of positions due to rounding alone, in units of the scales' length; not zero in an undisplaced state.
_ROUNDING = 1e-14
# Ratios of the largest difference to that at the element ends, above which the superconvergence of the ends is evident.
_AHEAD, _FAR_AHEAD = 4, 30
# Ratio of leading coefficients below which a second, smoother point is sampled, since its error may converge otherwise.
_SMOOTHER = 0.1
# Points with displacements below this times the largest one of the path are not sampled for their smoothness.
_SEEN = 1e-3


def estimate_error(fine, coarse, before=None):
    """Estimate the error of a path from the same points on the mesh of elements twice as long; sets `fine.error`.

    The error is the difference of the positions, at the coarse nodes and half way between them, over an assumed gain in
    accuracy. The gain of a halving is asymptotically 2^(p + 1) between the nodes. Only a part of it is assumed, and
    only where the differences confirm it:
    - with the differences `before` of the previous halving: (their ratio to the present ones - 1)/4, between 1 and
      2^(p - 1);
    - without: 2^(p - 1) or 2^(p - 3) if the element ends, whose order is 2 p, are much or moderately more accurate than
      the rest, else 1. Splines and sections that are functions of s may reduce the order: for these at most 2^(p - 3).

    Differences are relative to the largest displacement; where sections mainly rotate (a shaft in torsion), to their
    rotation times the radius of gyration; at least to 1e-9 of the length.

    Returns:
        (n,) the relative differences, which are `before` in the next halving; and the assumed order of the error in h,
        1 to p.
    """
    p = fine.degree
    relative, difference, at_ends = _differences(fine, coarse)
    seen = np.inf if before is None else before / np.maximum(relative, 1e-300)
    if before is None:
        ahead, far = difference > _AHEAD * at_ends, difference > _FAR_AHEAD * at_ends
        uniform = all(rod.uniform for rod in fine.scene.rods)
        gain = np.where(far & uniform, 2.0 ** (p - 1), np.where(ahead, max(1.0, 2.0 ** (p - 3)), 1.0))
    else:
        gain = np.clip((seen - 1) / 4, 1, 2 ** max(p - 1, 0))
    fine.set_error(relative / gain)
    return relative, float(np.clip(1 + np.log2(np.min(gain)), 1, p))


def carry_error(fine, coarse, factor, order, before=None):
    """Set the error of a path from that of the same points on a mesh of elements less than twice as long.

    It is the coarser mesh's error reduced by the assumed order, limited to one to two times the Richardson estimate
    from the difference of the two meshes, since the coarser mesh's error may be overestimated. The Richardson estimate
    uses the observed order minus one.

    Args:
        factor: number of elements over that of the coarser mesh.
        order: of the error in h, as assumed by `estimate_error` on the coarser mesh.
        before: relative differences of the coarser mesh from the one before, where its elements were halved; or None.

    Returns:
        (n,) the differences relative to the largest displacements.
    """
    relative, *_ = _differences(fine, coarse)
    seen = (
        order
        if before is None
        else np.clip(np.log2(np.maximum(before, 1e-300) / np.maximum(relative, 1e-300)) - 1, order, fine.degree)
    )
    reduction = factor**-seen
    estimate = relative * reduction / (1 - reduction)
    fine.set_error(np.clip(coarse.error * factor**-order, estimate, 2 * estimate))
    return relative


def compare(fine, coarse):
    """(n,) differences of the same points on two meshes, relative to the largest displacements.

    They are no error estimate where the meshes are not nested.
    """
    return _differences(fine, coarse)[0]


def _differences(fine, coarse):
    """(n,) relative differences, then the two results of `_apart`."""
    sizes = sizes_of(fine)
    difference, at_ends = _apart(fine, coarse, sizes.turning)
    return np.maximum(difference - _ROUNDING, 0.0) / sizes.largest, difference, at_ends


def hardest(path, most=3):
    """Sample points that determine the mesh that a path needs.

    They are the point with the largest error (the largest relative leading coefficients where errors are unknown), the
    most displaced one, the last, and the smoothest (smallest leading coefficients) where it is much smoother. All
    points where these are few or the path has events.

    Returns:
        (Path of these points, their indices).
    """
    if len(path) <= most or path.events:  # events have to be located on every mesh
        return path, np.arange(len(path))
    sizes, rough, _ = sizes_of(path)
    known = np.isfinite(path.error).all()
    which = {int(np.argmax(path.error if known else rough / sizes)), int(np.argmax(sizes)), len(path) - 1}
    seen = np.flatnonzero(sizes >= _SEEN * sizes.max())
    if rough[seen].min() < _SMOOTHER * rough.max():
        which.add(int(seen[np.argmin(rough[seen])]))
    which = np.array(sorted(which))
    return path.at_points(which), which


def spread_error(path, few, which, coarse):
    """Set `path.error` from the errors of its sample points on the same mesh.

    The errors of the other points are interpolated over their differences from the same points on a coarser mesh:
    logarithmically between neighbouring sample points, in proportion outside the range of these.

    Args:
        few: the sample points, with their errors; which: their indices.
        coarse: the whole path on a coarser mesh.
    """
    sizes, _, turning = sizes_of(path)
    apart = np.maximum(_apart(path, coarse, turning)[0] - _ROUNDING, 0.0)
    known, errors = apart[which], few.error * sizes[which]
    usable = (known > 100 * _ROUNDING) & (errors > 0)
    error = apart.copy()
    if usable.any():
        order = np.argsort(known[usable])
        known, errors = known[usable][order], np.maximum.accumulate(errors[usable][order])
        within = np.clip(apart, known[0], known[-1])
        error *= np.exp(np.interp(np.log(within), np.log(known), np.log(errors))) / within
    error /= sizes
    error[which] = few.error
    path.set_error(error)


def _apart(fine, coarse, turning):
    """Largest distances of the positions on two meshes, dimensionless: over all places, and over element ends alone.

    Both (points,). Where sections mainly rotate (`_Sizes.turning`), differences of rotations count too, times the
    radius of gyration.
    """
    difference, at_ends = np.zeros(len(fine)), np.zeros(len(fine))
    for i, rod in enumerate(fine.scene.rods):
        nodes = coarse.layout.node_s(coarse.rule.nodes)[i]
        x = halfway(nodes)
        ends = np.isin(x, coarse.layout.breaks[i])
        off = coarse.motion(rod, x) - fine.motion(rod, x)
        radius = 2 * _gyration(rod) / fine.scales.length
        turned = turning[:, None] * radius * np.linalg.norm(off[:, :, 3:], axis=2)
        off = np.maximum(np.linalg.norm(off[:, :, :3], axis=2), turned)
        difference = np.maximum(difference, off.max(axis=1))
        at_ends = np.maximum(at_ends, off[:, ends].max(axis=1))
    return difference, at_ends


def halfway(places):
    """Coordinates in ascending order with the midpoints of their intervals."""
    return np.sort(np.concatenate([places, (places[:-1] + places[1:]) / 2]))


_Sizes = namedtuple("_Sizes", "largest leading turning")


def sizes_of(path):
    """Reference sizes of the points of a path, a `_Sizes` of arrays (points,).

    largest: the displacement that errors are relative to; leading: the largest leading coefficient of an element's
    displacement, both dimensionless; turning: whether `largest` comes from rotations times the radius of gyration.
    """
    moved, turned = np.full(len(path), 1e-9), np.zeros(len(path))
    leading = np.zeros(len(path))
    for i, rod in enumerate(path.scene.rods):
        motion = path.motion(rod, path.layout.node_s(path.rule.nodes)[i])
        # |R - 1| = sqrt(8) |sin(angle/2)|
        angle = np.sqrt(8) * np.linalg.norm(motion[:, :, 4:], axis=2).max(axis=1)
        turned = np.maximum(turned, angle * _gyration(rod) / path.scales.length)
        moved = np.maximum(moved, np.linalg.norm(motion[:, :, :3], axis=2).max(axis=1))
        leading = np.maximum(leading, _of_degree_p(path, motion).max(axis=1))
    return _Sizes(np.maximum(moved, turned), leading, turned > moved)


def leading_coefficients(path):
    """For every rod (points, elements): sizes of the leading coefficients of the displacement, dimensionless."""
    nodes = path.layout.node_s(path.rule.nodes)
    return [_of_degree_p(path, path.motion(rod, x)) for rod, x in zip(path.scene.rods, nodes, strict=True)]


def _of_degree_p(path, motion):
    """(points, elements) sizes of the displacement's coefficients of degree p, from the motion of a rod's nodes."""
    p = path.degree
    elements = p * np.arange((motion.shape[1] - 1) // p)[:, None] + np.arange(p + 1)
    of_degree_p = np.einsum("j,kcji->kci", path.rule.leading, motion[:, elements, :3])
    return np.linalg.norm(of_degree_p, axis=2)


def on_mesh(path, layout):
    """The points of a path interpolated to another mesh, as initial guesses.

    Returns:
        (r, q) at the nodes (points, N, 7) and n at the Gauss points (points, elements, Gauss points per element, 3),
        dimensionless, inertial.
    """
    rule, scene = path.rule, path.scene
    n = path._stacked("gauss_fields")[..., :3]
    motions, forces, first = [], [], 0
    for i, rod in enumerate(scene.rods):
        x, inside, breaks = layout.node_s(rule.nodes)[i], layout.inside(rule.gauss)[i], path.layout.breaks[i]
        motion = path.motion(rod, x)
        motion[:, :, :3] += (rod.curve.position(x * rod.length) - scene.origin(rod)) / path.scales.length
        motions.append(motion)
        cells, weights = rule.locate_all(breaks, inside.ravel(), rule.between_gauss)
        forces.append(np.einsum("kj,pkjc->pkc", weights, n[:, first + cells]).reshape(-1, *inside.shape, 3))
        first += len(breaks) - 1
    return np.concatenate(motions, axis=1), np.concatenate(forces, axis=1)


def _gyration(rod):
    """Largest radius of gyration sqrt(EI/EA) of a rod, m; 0 where EA is infinite."""
    low, high = rod.profile.range
    return float(np.sqrt(high.J[:2].max() / low.K[2]))
