"""Threads with friction (`Action.rough`) on a model's mesh: their tensions at the Gauss points follow the state."""

import numpy as np

from cosserat_fenicsx.numerics import conjugate_product
from cosserat_fenicsx.turning import Turning

# Step of complex differences, which have no rounding error.
_STEP = 1e-30


class SlidingThread:
    """A thread with friction of a loaded spatial `RodModel`.

    Args:
        model: the model. term, action, rod: its `Term`, and the thread and its rod. rows, cells: (n,) of the local
            Gauss points: rows of the term's values, and local elements; n is 0 where this rank has none.

    Attributes:
        ends: (elements + 1,) ends of the rod's elements, m.
        tensions: (elements, points) at the Gauss points of all elements of the rod, dimensionless, at factors 1.
    """

    def __init__(self, model, term, action, rod, rows, cells):
        rods, layout, number = model.rods, model.layout, model.scene.number(rod)
        self._model, self._term, self.action, self._rule = model, term, action, model.rule
        points = len(model.rule.gauss)
        self._cells = cells.reshape(-1, points)[:, 0]
        self._rows, backwards = rows.reshape(-1, points), rods.reversed[self._cells]
        self._rows[backwards] = self._rows[backwards][:, ::-1]  # in the order of the rod
        nodes = model.cell_nodes[self._cells][:, np.argsort(model.node_order)]
        nodes[backwards] = nodes[backwards][:, ::-1]
        self._nodes, self._place = model.nodal[nodes][..., :7], rods.cell_inner[self._cells]
        self._owned = self._cells < len(model._owned_cells)
        breaks = layout.breaks[number]
        self.ends = breaks * rod.length
        self._sizes = np.diff(breaks)[:, None] * rod.length / model.scales.length
        self._turning = Turning(model.scene, rod, breaks, model.rule.gauss)
        self._arms = [array[self._rows] for array in term._arrays[1:]]
        self._full = float(np.reshape(action.tension, -1)[0]) / model.scales.force

    def _along(self, w):
        """(elements here, points, 3) derivative of the thread's points along the rod, of unknowns w, dimensionless."""
        h = self._sizes[self._place][..., None]
        here, slope = self._rule.at_gauss @ w[self._nodes], self._rule.slopes @ w[self._nodes] / h
        a, a_s = self._arms
        q, q_s = here[..., 3:], slope[..., 3:]
        squared = (q * q).sum(axis=-1, keepdims=True)
        b, w, v = a_s + np.cross(2 * conjugate_product(q, q_s) / squared, a), q[..., :1], q[..., 1:]
        turned = (2 * w * w / squared - 1) * b + 2 * (
            (v * b).sum(axis=-1, keepdims=True) * v + w * np.cross(v, b)
        ) / squared
        return slope[..., :3] + turned

    def _directions(self, w):
        along = self._along(w)
        return along / np.sqrt((along * along).sum(axis=-1, keepdims=True))

    def _everywhere(self, values):
        """(elements, ..) of the whole rod, on all ranks."""
        found = np.zeros((len(self._sizes), *values.shape[1:]))
        found[self._place[self._owned]] = values[self._owned]
        comm = self._model.comm
        return comm.allreduce(found) if comm.size > 1 else found

    def refresh(self):
        """Take the tensions of the model's state."""
        state = self._model.state.x.array
        t = self._everywhere(self._directions(state))
        share, self._change = self._turning.left(t, self.action.friction, self.action.pulled == "start")
        self.tensions = self._full * share[:, 1:-1]
        self.put(self.tensions)

    def put(self, values):
        """Set the tensions at the Gauss points (elements, points), dimensionless."""
        self._term._arrays[0][self._rows, 0] = values[self._place]

    def change(self, change):
        """(elements, points) changes of the tensions with a change of the model's state array, from the last
        `refresh`."""
        moved = self._directions(self._model.state.x.array + 1j * _STEP * change).imag / _STEP
        return self._full * self._change(self._everywhere(moved))[:, 1:-1]

    def left(self):
        """(elements + 1,) lengths of the thread from the ends of elements to that which is not pulled, of the state,
        dimensionless."""
        rates = np.linalg.norm(self._everywhere(self._along(self._model.state.x.array)), axis=-1)
        lengths = np.concatenate([[0.0], np.cumsum(rates @ self._rule.weights * self._sizes[:, 0])])
        return lengths[-1] - lengths if self.action.pulled == "start" else lengths
