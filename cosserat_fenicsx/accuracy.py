"""Paths of one scene on two meshes: how far apart they are, what that says of the finer one's error, and one from the other."""

import numpy as np

# Positions differ by this much from rounding alone (lengths), at rest too, where nothing is displaced.
_ROUNDING = 1e-14


def estimate_error(fine, coarse, before=None):
    """Estimate the error of a path from the same points on the mesh of elements twice as long; sets `fine.error`.

    The difference of the positions, at the coarse nodes and between them, over a share of the gain in accuracy that one
    more halving brings (2^(p + 1) between the nodes): a quarter of what was seen from the difference `before` to this one, not
    more than 2^(p - 1); where there was none before, a sixteenth of 2^(p + 1), and that only if element ends, whose order is 2 p, are
    seen to be ahead of what lies between them: an order must be seen before it is counted on. Where hardly
    anything is displaced (a shaft in torsion), relative to the turning of the sections, or to a billionth of the
    length. Without a contact force of its own (formulation 'displacement') a slender rod's answer also feels the
    residual's rounding.

    Returns:
        (n,) the differences relative to the largest displacements, to be the `before` of the next halving.
    """
    difference, at_ends, largest = (np.zeros(len(fine)) for _ in range(3))
    for i, rod in enumerate(fine.scene.rods):
        nodes = coarse.layout.node_s(coarse.rule.nodes)[i]
        x = np.sort(np.concatenate([nodes, (nodes[:-1] + nodes[1:]) / 2]))
        ends = np.isin(x, coarse.layout.breaks[i])
        moved = coarse.motion(rod, x)
        off = np.linalg.norm(moved[:, :, :3] - fine.motion(rod, x)[:, :, :3], axis=2)
        difference = np.maximum(difference, off.max(axis=1))
        at_ends = np.maximum(at_ends, off[:, ends].max(axis=1))
        # |R - 1| = sqrt(8) |sin(angle/2)|
        turned = np.sqrt(8) * np.linalg.norm(moved[:, :, 4:], axis=2).max(axis=1) * _gyration(rod) / fine.scales.length
        largest = np.maximum(largest, np.maximum(np.linalg.norm(moved[:, :, :3], axis=2).max(axis=1), turned))
    relative, p = np.maximum(difference - _ROUNDING, 0.0) / np.maximum(largest, 1e-9), fine.degree
    if before is None:
        gain = np.where(difference > 4 * at_ends, max(1.0, 2.0 ** (p - 3)), 1.0)
    else:
        gain = np.clip((before / np.maximum(relative, 1e-300) - 1) / 4, 1, 2 ** max(p - 1, 0))
    fine.set_error(relative / gain)
    return relative


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
