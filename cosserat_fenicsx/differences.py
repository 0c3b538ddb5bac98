"""How far two paths of one scene, on two meshes, are apart."""

import numpy as np


def compare(fine, coarse):
    """Paths of the same load factors, the rods of the coarse one sampled at its nodes and between them.

    Returns:
        (n,) m, the largest difference of the positions at every point; and (n,) m, what it is measured against: the
        largest displacement; where hardly anything is displaced (a shaft in torsion) the turning of the sections, or a
        billionth of the length.
    """
    difference = np.zeros(len(fine))
    largest = np.full(len(fine), 1e-9 * fine.scales.length)
    for rod, nodes in zip(fine.scene.rods, coarse.node_places(), strict=True):
        x = np.sort(np.concatenate([nodes, (nodes[:-1] + nodes[1:]) / 2]))
        a, frames = coarse.sample(slice(None), rod, x)
        b, _ = fine.sample(slice(None), rod, x)
        moved = np.linalg.norm(a - rod.curve.position(x * rod.length), axis=2).max(axis=1)
        turned = np.linalg.norm(frames - rod.curve.frame(x * rod.length), axis=(2, 3)).max(axis=1)
        difference = np.maximum(difference, np.linalg.norm(a - b, axis=2).max(axis=1))
        largest = np.maximum(np.maximum(largest, moved), turned * _gyration(rod))
    return difference, largest


def _gyration(rod):
    """Largest radius of gyration sqrt(EI/EA) of a rod, m; 0 where EA is infinite."""
    low, high = rod.profile.range
    return float(np.sqrt(high.J[:2].max() / low.K[2]))
