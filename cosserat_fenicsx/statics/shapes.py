"""Shapes of eigenvectors of the second variation as motions of all nodes, oriented and scaled alike for all uses."""

import numpy as np

from cosserat_fenicsx.statics.stability import orienting

# Eigenvalues that differ by less than this, relative, are one multiple eigenvalue.
_SAME = 1e-6
# Largest displacement of a mode of pure twist, over its largest rotation, in the model's unit of length.
_TWIST = 1e-6


def shapes_of(vectors, values, rows, length):
    """Shapes of eigenvectors.

    Args:
        vectors: (n, size) eigenvectors in the numbering of the second variation.
        values: (n,) their eigenvalues, in order.
        rows: (N, 6) rows of all nodes, -1 where clamped, see `RodModel.rows_of_nodes`.
        length: the model's unit of length, m.

    Returns:
        (n, N, 6) displacements (m) and rotations (rad) of all nodes: the largest displacement of each shape has length
        1, or its largest rotation times `length` where nothing is displaced. Those of a multiple eigenvalue are
        combined as by `orienting`.
    """
    found, first = np.zeros((len(vectors), *rows.shape)), 0
    if len(vectors):
        found = np.where(rows >= 0, np.asarray(vectors)[:, rows], 0.0)
    while first < len(found):
        same = int(np.count_nonzero(np.abs(values[first:] - values[first]) <= _SAME * abs(values[first])))
        group = found[first : first + same]
        moved, turned = np.abs(group[:, :, :3]).max(), np.abs(group[:, :, 3:]).max()
        part = slice(0, 3) if moved > _TWIST * turned else slice(3, 6)
        group[:] = np.tensordot(orienting(group[:, :, part]), group, 1)
        first += same
    for shape in found:
        moved, turned = (np.linalg.norm(shape[:, part], axis=1).max() for part in (slice(0, 3), slice(3, 6)))
        shape /= moved if moved > _TWIST * turned else turned
    found[:, :, 3:] /= length
    return found
