"""The unknowns where rods meet, in one small sparse system that every rank solves as a whole."""

import numpy as np

# Pivots and eigenvalues of a matrix with a diagonal of ones that are zero to rounding.
_ROUNDING = 1e-14


class Interface:
    """The system of the unknowns that `Elimination` leaves, with the constraint equations.

    Args:
        elimination: the `Elimination`.
        tied: (tied nodes, block) numbers of the unknowns in constraint equations, -1 where clamped.
        multipliers: number of constraint equations.
    """

    def __init__(self, elimination, tied, multipliers=0):
        self._elimination, self._size = elimination, elimination.unknowns
        known = elimination.interface
        nodes = np.where(tied.ravel() >= 0, np.searchsorted(known, tied.ravel()), -1)
        #: places of the tied nodes' unknowns, -1 where clamped, and those of the multipliers
        self.nodes, self.multipliers = nodes, len(known) - multipliers + np.arange(multipliers)
        grids = [elimination.places, np.tile(np.arange(self._size), (2, 1))]
        for rows, columns in ((nodes, nodes), (nodes, self.multipliers), (self.multipliers, nodes)):
            grids.append(np.stack([np.repeat(rows, len(columns)), np.tile(columns, len(rows))]))
        self._diagonal = np.zeros(self._size)
        rows, columns = np.concatenate(grids, axis=1)
        self._here = (rows >= 0) & (columns >= 0)
        keys, self._entry = np.unique(columns[self._here] * self._size + rows[self._here], return_inverse=True)
        self._indices = (keys % self._size).astype(np.int32)
        self._starts = np.searchsorted(keys // max(1, self._size), np.arange(self._size + 1)).astype(np.int32)
        self._solve = self._values = None

    def matrix(self, of_nodes, reactions=None, equations=None):
        """The sum of all ranks' condensed matrices and of the derivatives of the reactions by nodes and by multipliers,
        and of the equations by nodes: arrays over the tied nodes' unknowns, clamped ones included, and multipliers."""
        parts = [self._elimination.all_condensed(), self._diagonal]
        parts += [part.ravel() for part in (of_nodes, reactions, equations) if part is not None]
        values = np.concatenate(parts)
        here = self._here[: len(values)]
        entries = self._entry[: np.count_nonzero(here)]
        return self._with(np.bincount(entries, values[here], minlength=len(self._indices)))

    def _with(self, values):
        from scipy.sparse import csc_matrix  # slow to import, and a single rod has no interface

        return csc_matrix((values, self._indices, self._starts), shape=(self._size, self._size))

    def factor(self, *derivatives):
        """Factors of `matrix`; False where it is singular."""
        return self._factor(self.matrix(*derivatives))

    def _factor(self, matrix):
        from scipy.sparse.linalg import splu

        self._values = matrix.data
        if not self._size:
            self._solve = np.copy
            return True
        try:
            self._solve = splu(matrix).solve if np.isfinite(matrix.data).all() else None
        except RuntimeError:  # SuperLU: exactly singular
            self._solve = None
        return self._solve is not None

    def memory(self):
        """The entries of the last matrix."""
        return self._values

    def recall(self, memory):
        """Factorise the matrix whose entries `memory` returned."""
        self._factor(self._with(memory))

    def solve(self, b):
        """(unknowns,) the solution for a right-hand side, from the last factors."""
        return self._solve(b)


def signs(matrix):
    """(negative, zero) numbers of eigenvalues of a sparse symmetric matrix, from LDL^T factors."""
    from scipy.sparse import diags
    from scipy.sparse.linalg import splu

    if not matrix.shape[0]:
        return 0, 0
    size = np.sqrt(np.abs(matrix.diagonal()))
    scale = diags(1 / np.where(size > 0, size, 1.0))  # which leaves the signs, whatever the units of the unknowns
    matrix = (scale @ matrix @ scale).tocsc()
    try:
        factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        pivots = factors.U.diagonal()
        if (factors.perm_r == factors.perm_c).all() and np.abs(pivots).min() > _ROUNDING:
            return int((pivots < 0).sum()), 0
    except RuntimeError:
        pass
    values = np.linalg.eigvalsh(matrix.toarray())
    zero = np.abs(values) <= _ROUNDING
    return int((values[~zero] < 0).sum()), int(zero.sum())
