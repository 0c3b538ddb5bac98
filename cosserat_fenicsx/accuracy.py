"""Paths of one scene on two meshes: how far apart they are, what that says of the finer one's error, and one from the other."""

import numpy as np

# Positions differ by this much from rounding alone (lengths), at rest too, where nothing is displaced.
_ROUNDING = 1e-14
# Differences between element ends over those at the ends.
_AHEAD, _FAR_AHEAD = 4, 30
# A point whose leading coefficients are smaller than this times another's says something else of the error.
_SMOOTHER = 0.1


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
        (n,) the differences relative to the largest displacements, to be the `before` of the next halving.
    """
    difference, at_ends = np.zeros(len(fine)), np.zeros(len(fine))
    for i, rod in enumerate(fine.scene.rods):
        nodes = coarse.layout.node_s(coarse.rule.nodes)[i]
        x = np.sort(np.concatenate([nodes, (nodes[:-1] + nodes[1:]) / 2]))
        ends = np.isin(x, coarse.layout.breaks[i])
        off = np.linalg.norm(coarse.motion(rod, x)[:, :, :3] - fine.motion(rod, x)[:, :, :3], axis=2)
        difference = np.maximum(difference, off.max(axis=1))
        at_ends = np.maximum(at_ends, off[:, ends].max(axis=1))
    relative, p = np.maximum(difference - _ROUNDING, 0.0) / _sizes(fine)[0], fine.degree
    if before is None:
        ahead, far = difference > _AHEAD * at_ends, difference > _FAR_AHEAD * at_ends
        uniform = all(rod.uniform for rod in fine.scene.rods)
        gain = np.where(far & uniform, 2.0 ** (p - 1), np.where(ahead, max(1.0, 2.0 ** (p - 3)), 1.0))
    else:
        gain = np.clip((before / np.maximum(relative, 1e-300) - 1) / 4, 1, 2 ** max(p - 1, 0))
    fine.set_error(relative / gain)
    return relative


def hardest(path, most=3):
    """A few points of a path that tell how fine a mesh all of it needs: the one that is least like a polynomial of lower degree,
    the most displaced one, the last, and the one that is most like it where that says something else. All of them where they
    are few or the path has events.

    Returns:
        (Path of these points, their indices).
    """
    if len(path) <= most or path.events:  # events have to be found again on every mesh
        return path, np.arange(len(path))
    sizes, rough = _sizes(path)
    which = {int(np.argmax(rough / sizes)), int(np.argmax(sizes)), len(path) - 1}
    if rough.min() < _SMOOTHER * rough.max():
        which.add(int(np.argmin(rough)))
    which = np.array(sorted(which))
    return path.at_points(which), which


def spread_error(path, few):
    """Set `path.error` from that of a few of its points on the same mesh, see `hardest`: between element ends it grows with the
    leading coefficients of the elements' polynomials, by a power that the few tell."""
    sizes, rough = _sizes(path)
    sizes_of_few, rough_of_few = _sizes(few)
    order = np.argsort(rough_of_few)
    known, errors = (
        rough_of_few[order] + _ROUNDING,
        np.maximum.accumulate((few.error * sizes_of_few)[order] + _ROUNDING),
    )
    rough = rough + _ROUNDING
    within = np.clip(rough, known[0], known[-1])
    error = np.exp(np.interp(np.log(within), np.log(known), np.log(errors))) * rough / within
    path.set_error(error / sizes)


def _sizes(path):
    """What errors are relative to, and the largest leading coefficient of an element's displacement: (points,) both, lengths."""
    largest, leading, p = np.full(len(path), 1e-9), np.zeros(len(path)), path.degree
    for i, rod in enumerate(path.scene.rods):
        moved = path.motion(rod, path.layout.node_s(path.rule.nodes)[i])
        # |R - 1| = sqrt(8) |sin(angle/2)|
        turned = np.sqrt(8) * np.linalg.norm(moved[:, :, 4:], axis=2).max(axis=1) * _gyration(rod) / path.scales.length
        largest = np.maximum(largest, np.maximum(np.linalg.norm(moved[:, :, :3], axis=2).max(axis=1), turned))
        elements = p * np.arange(path.elements[i])[:, None] + np.arange(p + 1)
        of_degree_p = np.einsum("j,kcji->kci", path.rule.leading, moved[:, elements, :3])
        leading = np.maximum(leading, np.linalg.norm(of_degree_p, axis=2).max(axis=1))
    return largest, leading


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
