"""The nodes of a problem that may touch a wall: their unknowns, wherever they are, on all ranks."""

import numpy as np

from cosserat_fenicsx.numerics import small_rotations


class TouchingNodes:
    """Nodes of a moving model by their numbers in the scene; arrays over them are the same on all ranks.

    Args:
        problem: a `StepProblem`; slots: (n,) the scene's numbers of the nodes.
    """

    def __init__(self, problem, slots):
        model, numbering = problem.model, problem.numbering
        self._comm, self.count = model.comm, len(slots)
        mine = model.slots[: model.owned_nodes]
        order = np.argsort(mine)
        found = np.minimum(np.searchsorted(mine, slots, sorter=order), max(len(mine) - 1, 0))
        local = order[found] if len(mine) else np.zeros(len(slots), dtype=int)
        #: which of the nodes this rank owns, and their local degrees of freedom
        self._here = np.flatnonzero(mine[local] == slots) if len(mine) else np.empty(0, dtype=int)
        self._dofs = model.dofs_of_nodes[local[self._here]]
        rows = np.zeros((self.count, 7), dtype=np.int64)
        rows[self._here] = numbering.rows[self._dofs]
        rows = self._sum(rows)
        again = (rows[1:] == rows[:-1]).all(axis=1) & (rows[1:] >= 0).any(axis=1)
        #: (n,) number of the point that a node is: those that follow each other may be the same, as of two walls
        self.points = np.concatenate([[0], np.cumsum(~again)])
        #: entries (of nodes and components) whose unknowns are in this rank's part of the solver's vector
        self._mine = np.nonzero((rows >= numbering.first) & (rows < numbering.first + numbering.size))
        self._rows = rows[self._mine] - numbering.first
        self._clamped = rows < 0
        self._shared = len(np.unique(self._rows)) < len(self._rows)

    def _sum(self, values):
        return self._comm.allreduce(values) if self._comm.size > 1 else values

    def hold(self, state):
        """Take the unknowns of clamped nodes from local degrees of freedom."""
        self._fixed = np.where(self._clamped, self.of_local(state), 0.0)

    def of_local(self, numbers):
        """(n, 7) values of local degrees of freedom at the nodes."""
        values = np.zeros((self.count, 7))
        values[self._here] = numbers[self._dofs]
        return self._sum(values)

    def of_vector(self, *vectors):
        """(n, 7) values at the nodes of this rank's part of a solver's vector, or of the first one minus the second;
        zero where clamped."""
        values = np.zeros((self.count, 7))
        found = [vector[self._rows] for vector in vectors]
        values[self._mine] = found[0] if len(found) == 1 else found[0] - found[1]
        return self._sum(values)

    def unknowns(self, *vectors):
        """(n, 7) unknowns at the nodes, see `of_vector`."""
        return self.of_vector(*vectors) + self._fixed

    def subtract(self, forces, b):
        """Subtract forces and moments (n, 6) from this rank's part of a residual."""
        rows = np.zeros((self.count, 7))
        rows[:, :3], rows[:, 4:] = forces[:, :3], forces[:, 3:]
        if self._shared:
            np.subtract.at(b, self._rows, rows[self._mine])
        else:  # much faster
            b[self._rows] -= rows[self._mine]


def motion_between(before, after):
    """(n, 6) displacements and rotations from nodal unknowns (n, 7) to others, by the mean rotation: with them the work
    of a force and a moment in a step is exact."""
    change = after - before
    turned = small_rotations((before[:, 3:] + after[:, 3:]) / 2) @ change[:, 3:, None]
    return np.concatenate([change[:, :3], turned[..., 0]], axis=1)
