"""Paths of one scene on two meshes: how far apart they are, what that says of the finer one's error, and one from the other."""

from collections import namedtuple

import numpy as np

# Positions differ by this much from rounding alone (lengths), at rest too, where nothing is displaced.
_ROUNDING = 1e-14
# Differences between element ends over those at the ends.
_AHEAD, _FAR_AHEAD = 4, 30
# Least share of the difference of two meshes over the error that is left, where elements lock.
_LOCKED = 0.05
# A point whose leading coefficients are smaller than this times another's says something else of the error.
_SMOOTHER = 0.1
# Points that are displaced by less than this times the most displaced one say nothing.
_SEEN = 1e-3


def estimate_error(fine, coarse, before=None):
    """Estimate the error of a path from the same points on the mesh of elements twice as long; sets `fine.error`.

    The difference of the positions, at the coarse nodes and between them, over a share of the gain in accuracy that one
    more halving brings (2^(p + 1) between the nodes): a quarter of what was seen from the difference `before` to this one, not
    more than 2^(p - 1); where there was none before, a quarter or a sixteenth of 2^(p + 1), and that only if element ends, whose
    order is 2 p, are seen to be far ahead, or ahead, of what lies between them: an order must be seen before it is counted on. A
    spline or a section that is a function of s may hide its order, and counts as ahead at most. Where hardly
    anything is displaced (a shaft in torsion), relative to the turning of the sections, or to a billionth of the
    length. Without a contact force of its own (formulation 'displacement') a slender rod's answer also feels the
    residual's rounding.

    Returns:
        (n,) the differences relative to the largest displacements, to be the `before` of the next halving; and the order of the
        error in h that this counts on, 1 to p.
    """
    p = fine.degree
    relative, difference, at_ends = _differences(fine, coarse)
    seen = np.inf if before is None else before / np.maximum(relative, 1e-300)
    if fine.formulation == "multiplier":  # it locks: what is left may be many times what one more halving brings
        gain = np.clip(seen - 1, _LOCKED, 1) if before is not None else _LOCKED
    elif before is None:
        ahead, far = difference > _AHEAD * at_ends, difference > _FAR_AHEAD * at_ends
        uniform = all(rod.uniform for rod in fine.scene.rods)
        gain = np.where(far & uniform, 2.0 ** (p - 1), np.where(ahead, max(1.0, 2.0 ** (p - 3)), 1.0))
    else:
        gain = np.clip((seen - 1) / 4, 1, 2 ** max(p - 1, 0))
    fine.set_error(relative / gain)
    return relative, float(np.clip(1 + np.log2(np.min(gain)), 1, p))


def carry_error(fine, coarse, factor, order, before=None):
    """Set the error of a path from that of the same points on a mesh of elements less than twice as long.

    It is the coarser mesh's times what is left of it at the order that was counted on there, but one to two times what the
    difference of the two says at the order that is seen in the differences, less one: the coarser mesh's may be overrated.

    Args:
        factor: elements over those of the coarser mesh.
        order: of the error in h, as `estimate_error` of the coarser mesh counted on.
        before: the relative differences by which that was halved to, where it was.

    Returns:
        (n,) the differences relative to the largest displacements.
    """
    relative, *_ = _differences(fine, coarse)
    seen = (
        order
        if before is None
        else np.clip(np.log2(np.maximum(before, 1e-300) / np.maximum(relative, 1e-300)) - 1, order, fine.degree)
    )
    left = factor**-seen
    told = relative * left / (1 - left)
    fine.set_error(np.clip(coarse.error * factor**-order, told, 2 * told))
    return relative


def _differences(fine, coarse):
    """`_apart` over the largest displacements, and as it is."""
    sizes = _sizes(fine)
    difference, at_ends = _apart(fine, coarse, sizes.turning)
    return np.maximum(difference - _ROUNDING, 0.0) / sizes.largest, difference, at_ends


def hardest(path, most=3):
    """A few points of a path that tell how fine a mesh all of it needs: the one with the largest error, or, where that is not known, the
    one that is least like a polynomial of lower degree; the most displaced one, the last, and the one that is most like such a
    polynomial where that says something else. All of them where they are few or the path has events.

    Returns:
        (Path of these points, their indices).
    """
    if len(path) <= most or path.events:  # events have to be found again on every mesh
        return path, np.arange(len(path))
    sizes, rough, _ = _sizes(path)
    known = np.isfinite(path.error).all()
    which = {int(np.argmax(path.error if known else rough / sizes)), int(np.argmax(sizes)), len(path) - 1}
    seen = np.flatnonzero(sizes >= _SEEN * sizes.max())
    if rough[seen].min() < _SMOOTHER * rough.max():
        which.add(int(seen[np.argmin(rough[seen])]))
    which = np.array(sorted(which))
    return path.at_points(which), which


def spread_error(path, few, which, coarse):
    """Set `path.error` from that of a few of its points on the same mesh.

    The others' errors follow from how far they are from the same points on the coarse mesh that they were first found on: by the
    power law through the few that lie next in this, in proportion beyond them.

    Args:
        few: some points of the path, with their errors; which: their indices.
        coarse: the whole path on a coarser mesh.
    """
    sizes, _, turning = _sizes(path)
    apart = np.maximum(_apart(path, coarse, turning)[0] - _ROUNDING, 0.0)
    known, errors = apart[which], few.error * sizes[which]
    told = (known > 100 * _ROUNDING) & (errors > 0)
    error = apart.copy()
    if told.any():
        order = np.argsort(known[told])
        known, errors = known[told][order], np.maximum.accumulate(errors[told][order])
        within = np.clip(apart, known[0], known[-1])
        error *= np.exp(np.interp(np.log(within), np.log(known), np.log(errors))) / within
    error /= sizes
    error[which] = few.error
    path.set_error(error)


def _apart(fine, coarse, turning):
    """Largest distances of the positions on two meshes, at all places and at element ends alone: (points,) both, lengths. Where
    sections turn more than they move (`_Sizes.turning`), positions are those off the axis too, at the radius of gyration."""
    difference, at_ends = np.zeros(len(fine)), np.zeros(len(fine))
    for i, rod in enumerate(fine.scene.rods):
        nodes = coarse.layout.node_s(coarse.rule.nodes)[i]
        x = np.sort(np.concatenate([nodes, (nodes[:-1] + nodes[1:]) / 2]))
        ends = np.isin(x, coarse.layout.breaks[i])
        off = coarse.motion(rod, x) - fine.motion(rod, x)
        radius = 2 * _gyration(rod) / fine.scales.length
        turned = turning[:, None] * radius * np.linalg.norm(off[:, :, 3:], axis=2)
        off = np.maximum(np.linalg.norm(off[:, :, :3], axis=2), turned)
        difference = np.maximum(difference, off.max(axis=1))
        at_ends = np.maximum(at_ends, off[:, ends].max(axis=1))
    return difference, at_ends


_Sizes = namedtuple("_Sizes", "largest leading turning")


def _sizes(path):
    """What errors are relative to, the largest leading coefficient of an element's displacement, both lengths, and whether the
    turning of the sections is the larger part of the first; (points,) each."""
    moved, turned = np.full(len(path), 1e-9), np.zeros(len(path))
    leading, p = np.zeros(len(path)), path.degree
    for i, rod in enumerate(path.scene.rods):
        motion = path.motion(rod, path.layout.node_s(path.rule.nodes)[i])
        # |R - 1| = sqrt(8) |sin(angle/2)|
        angle = np.sqrt(8) * np.linalg.norm(motion[:, :, 4:], axis=2).max(axis=1)
        turned = np.maximum(turned, angle * _gyration(rod) / path.scales.length)
        moved = np.maximum(moved, np.linalg.norm(motion[:, :, :3], axis=2).max(axis=1))
        elements = p * np.arange(path.elements[i])[:, None] + np.arange(p + 1)
        of_degree_p = np.einsum("j,kcji->kci", path.rule.leading, motion[:, elements, :3])
        leading = np.maximum(leading, np.linalg.norm(of_degree_p, axis=2).max(axis=1))
    return _Sizes(np.maximum(moved, turned), leading, turned > moved)


def on_mesh(path, layout):
    """The points of a path on another mesh, as something to start from.

    Returns:
        (r, q) at the nodes (points, N, 7) and n at the Gauss points (points, elements, points of one, 3), dimensionless,
        inertial.
    """
    rule, scene = path.rule, path.scene
    n = np.array([record.gauss_fields[:, :, :3] for record in path])
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
