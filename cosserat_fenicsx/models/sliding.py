"""Threads with friction (`Action.rough`) on a model's mesh: their tensions at the Gauss points follow the state."""

import numpy as np

from cosserat_fenicsx.numerics import conjugate_product
from cosserat_fenicsx.scene.signals import at
from cosserat_fenicsx.turning import Turning, slipped

# Step of complex differences, which have no rounding error.
_STEP = 1e-30


class SlidingThread:
    """A thread with friction of a loaded spatial `RodModel`. It slides towards its pulled end, or, once `let_stick` was
    called, sticks and slips as `turning.slipped` says, with the Gauss points of the elements as cells.

    Args:
        model: the model. term, action, rod: its `Term`, and the thread and its rod. rows, cells: (n,) of the local
            Gauss points: rows of the term's values, and local elements; n is 0 where this rank has none.

    Attributes:
        ends: (elements + 1,) ends of the rod's elements, m.
        tensions: (elements, points) at the Gauss points of all elements of the rod, dimensionless, at factors 1.
        held: of one that may stick, its lengths without tension and its ways before, see `slipped`; None of one that
            slides.
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
        self._from_start, self.held, self._put = action.pulled == "start", None, None
        self.pull(0.0)

    def pull(self, t):
        """Take the tension of the pulled end at a time (s)."""
        self._full = float(np.reshape(at(self.action, t).tension, -1)[0]) / self._model.scales.force

    def _strained(self, w):
        """(.., elements here, points, 3) derivative of the thread's points along the rod, of unknowns w (.., n),
        dimensionless; and a function that gives their arms from the axis, and the derivatives of these."""
        h = self._sizes[self._place][..., None]
        here, slope = self._rule.at_gauss @ w[..., self._nodes], self._rule.slopes @ w[..., self._nodes] / h
        a, a_s = self._arms
        q, q_s = here[..., 3:], slope[..., 3:]
        squared = (q * q).sum(axis=-1, keepdims=True)
        w, v = q[..., :1], q[..., 1:]

        def turned(b):
            return (2 * w * w / squared - 1) * b + 2 * (
                (v * b).sum(axis=-1, keepdims=True) * v + w * np.cross(v, b)
            ) / squared

        moving = turned(a_s + np.cross(2 * conjugate_product(q, q_s) / squared, a))
        return slope[..., :3] + moving, lambda: (turned(a), moving)

    def _everywhere(self, values):
        """(elements, ..) of the whole rod, on all ranks."""
        found = np.zeros((len(self._sizes), *values.shape[1:]))
        found[self._place[self._owned]] = values[self._owned]
        comm = self._model.comm
        return comm.allreduce(found) if comm.size > 1 else found

    def _shape(self):
        """(elements, points) sizes and (.., 3) directions of the thread's derivative at the model's state."""
        along = self._everywhere(self._strained(self._model.state.x.array)[0])
        rates = np.linalg.norm(along, axis=-1)
        return rates, along / rates[..., None]

    def refresh(self):
        """Take the tensions of the model's state."""
        if self._put is not None:
            return self.put(self._put)
        rates, self._t = self._shape()
        if self.held is None:
            share, change = self._turning.left(self._t[None], self.action.friction, self._from_start)
            self.tensions = self._full * share[0, :, 1:-1]
            self._change = lambda dt, _: self._full * change(dt)[..., 1:-1]
        else:
            self._found, turn = self._slipped(rates, self._t)
            self.tensions = self._of_cells(self._found.tensions)
            self._change = lambda dt, rates: self._of_cells(
                self._found.change(self._cells_of(rates * self._widths), self._angles(turn(dt)))
            )
        self.put(self.tensions)

    def put(self, values):
        """Set the tensions at the Gauss points (elements, points), dimensionless."""
        self._term._arrays[0][self._rows, 0] = values[self._place]

    def keep(self, values):
        """Let `refresh` set these tensions, until it is called with None."""
        self._put = values

    def change(self, change):
        """(k, elements, points) changes of the tensions with k changes (k, n) of the model's state array, from the last
        `refresh`."""
        along = self._strained(self._model.state.x.array + 1j * _STEP * change)[0]
        size = np.sqrt((along * along).sum(axis=-1, keepdims=True))
        moved = np.concatenate([along / size, size], axis=-1).imag / _STEP
        moved = self._everywhere(moved.swapaxes(0, 1)).swapaxes(0, 1)
        return self._change(moved[..., :3], moved[..., 3])

    def left(self):
        """(elements + 1,) lengths of the thread from the ends of elements to that which is not pulled, of the state,
        dimensionless."""
        lengths = np.concatenate([[0.0], np.cumsum((self._shape()[0] * self._widths).sum(axis=-1))])
        return lengths[-1] - lengths if self._from_start else lengths

    # -- of one that sticks or slips -------------------------------------------------------------------------------

    @property
    def _widths(self):
        return self._rule.weights * self._sizes

    def _cells_of(self, values):
        """(.., cells) values (.., elements, points) from the pulled end on."""
        found = values.reshape(*values.shape[:-2], -1)
        return found if self._from_start else found[..., ::-1]

    def _of_cells(self, values):
        found = values if self._from_start else values[..., ::-1]
        return found.reshape(*values.shape[:-1], len(self._sizes), -1)

    def _angles(self, turned):
        """(.., cells) see `slipped`, of the turning (.., elements, points + 2)."""
        way = turned if self._from_start else turned[..., -1:, -1:] - turned
        return self.action.friction * np.diff(self._cells_of(way[..., 1:-1]), prepend=0.0)

    def _slipped(self, rates, t):
        turned, turn = self._turning.along(t[None])
        sizes = self._cells_of(rates * self._widths)
        found = slipped(sizes, self.held[0], self._angles(turned)[0], self._full, self._stiffness, self.held[1])
        if found is None:  # a step with it is not found either
            found = self._found._replace(tensions=np.full_like(sizes, np.nan))
        return found, turn

    def let_stick(self, pull, factor):
        """Let it stick and slip from the model's state on, which it has slid to with the `pull` (N); factor: of its
        tensions."""
        rates, t = self._shape()
        force = self._model.scales.force * factor
        self._stiffness = self.action.axial / force
        share, _ = self._turning.left(t, self.action.friction, self._from_start)
        tensions = self._cells_of(pull / force * share[:, 1:-1])
        material = self._cells_of(rates * self._widths) / (1 + tensions / self._stiffness)
        self.held = material, np.ones(len(material), dtype=int)

    def accept(self):
        """Accept what has slipped at the last `refresh`."""
        self.held = self._found.material, self._found.ways

    def here(self, t):
        """(elements, points) tensions at the model's state, at a time (s) and factors 1; nothing is accepted."""
        before = self._full
        self.pull(t)
        found = self._of_cells(self._slipped(*self._shape())[0].tensions)
        self._full = before
        return found

    def stuck(self, factor):
        """(elements, n, n) stiffness of one that sticks, by displacements and inertial rotations of all nodes of each
        element, dimensionless, at the last `refresh`; factor: of its tensions."""
        along, more = self._strained(self._model.state.x.array)
        rates = np.linalg.norm(along, axis=-1)
        t, (arm, moving), h = along / rates[..., None], more(), self._sizes[self._place][..., None]
        basis, slopes = self._rule.at_gauss[:, :, None], (self._rule.slopes / h)[..., None]
        of_r, of_turn = slopes * t[:, :, None], slopes * np.cross(arm, t)[:, :, None]
        rows = np.concatenate([of_r, of_turn + basis * np.cross(moving, t)[:, :, None]], axis=-1)
        rows = rows.reshape(*rows.shape[:2], -1)
        tensions, stiffness = factor * self.tensions[self._place], self.action.axial / self._model.scales.force
        weights = (tensions > 0) * (stiffness + tensions) / rates * self._widths[self._place]
        return self._everywhere(np.einsum("eg,egi,egj->eij", weights, rows, rows))
