"""The vectors that a matrix with few entries in each row maps to zero."""

import numpy as np

# Singular values below this, over the largest, are zero.
_RANK_TOLERANCE = 1e-9
# Largest number of columns of a matrix that is decomposed as a dense one.
_DENSE = 150
# Shift of the normal matrix over its largest diagonal entry: well above rounding, which is some 1e-16.
_SHIFT = 1e-12
# The smallest singular values are all found once one beyond them is found that is larger than this, over the largest.
_GAP = 1e-4
# Vectors that are iterated first, and by how many times more where these do not reach the gap.
_BLOCK, _GROWTH = 8, 8
# An iteration damps what belongs to singular values beyond the gap to _SHIFT / _GAP**2 of its size.
_ITERATIONS = 5
#: More vectors than this are not searched for in a matrix of more than `_DENSE` columns.
MOST = 64


def null_space(row, column, value, shape):
    """An orthonormal basis of the vectors that a matrix maps to zero.

    A small matrix is decomposed into singular values. Of others the right singular vectors of the smallest singular
    values are found by iterations with the inverse of A^T A + shift I on a block of vectors V, and the singular values
    are those of A V: forming A^T A loses half of the digits of these, A V does not. The block grows until it holds all
    singular values below `_GAP`, so that one that is small but not zero is told from zero as in a dense decomposition.

    Args:
        row, column, value: the entries; those at the same place are added.
        shape: (rows, columns).

    Returns:
        (n, k) the basis, and whether it is complete: a matrix that is not small may have more than `MOST` such vectors.
    """
    size = shape[1]
    if size <= _DENSE:
        matrix = np.zeros(shape)
        np.add.at(matrix, (row, column), value)
        _, sizes, right = np.linalg.svd(matrix, full_matrices=shape[0] < size)
        return right[np.count_nonzero(sizes > _RANK_TOLERANCE * sizes.max(initial=0)) :].T, True
    from scipy.sparse import csc_matrix, identity  # slow to import, and few scenes need it
    from scipy.sparse.linalg import splu

    matrix = csc_matrix((value, (row, column)), shape=shape)
    normal = (matrix.T @ matrix).tocsc()
    largest = np.sqrt(normal.diagonal().max()) or 1.0  # norm of a column, at most the largest singular value
    shifted = normal + _SHIFT * largest**2 * identity(size, format="csc")
    symmetric = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    factors = splu(shifted.tocsc(), **symmetric)
    rng, count = np.random.default_rng(1), _BLOCK
    while True:
        count = min(count, size)
        vectors = rng.standard_normal((size, count))
        for _ in range(_ITERATIONS):
            vectors = np.linalg.qr(factors.solve(vectors))[0]
        triangle = np.linalg.qr(matrix @ vectors, mode="r")
        _, sizes, right = np.linalg.svd(triangle)
        sizes = np.append(sizes, np.zeros(count - len(sizes)))
        zero = sizes <= _RANK_TOLERANCE * largest
        if sizes[0] > _GAP * largest or count == size:
            return vectors @ right[zero].T, True
        if count >= MOST and zero.any():
            return vectors @ right[zero].T, False
        count *= _GROWTH
