"""Forces and moments at clamped points, from which reactions follow: a clamped point has no equation in the solver."""

import numpy as np

from cosserat_fenicsx import compat
from cosserat_fenicsx.models.traits import resultant_at_rest
from cosserat_fenicsx.scene.signals import signals_of


class Clamps:
    """The clamped points of a model, in the order of `Connections.clamped`. Rods joined rigidly there share one point.

    Forces and moments are inertial and dimensionless.

    Args:
        model: a `RodModel`.
    """

    def __init__(self, model):
        links, self._model = model.signature.connections, model
        self.count = len(links.clamped)
        self._points = {vertex: i for i, vertex in enumerate(links.clamped)}
        self._points |= {vertex: self._points[leader] for vertex, leader in links.leaders if leader in self._points}
        self._find_elements()

    def _find_elements(self):
        """Find this rank's elements at clamped points: their local numbers, the end (0 or 1) and the point of each."""
        model, found = self._model, []
        rods, counts = model.rods, model.signature.counts
        first = np.concatenate([[0], np.cumsum(counts)])
        owned = {int(cell): i for i, cell in enumerate(rods.cells[: model.mesh.topology.index_map(1).size_local])}
        for (rod, vertex), point in self._points.items():
            for inner, end in ((vertex - 1, 1), (vertex, 0)):
                if 0 <= inner < counts[rod] and first[rod] + inner in owned:
                    found.append((owned[first[rod] + inner], end, point))
        self._cells, self._ends, self._of_point = np.array(found, dtype=np.int32).reshape(-1, 3).T.copy()

    def load(self):
        """Take the data of the model's scene."""
        scene, layout = self._model.scene, self._model.layout
        here = [(x, layout.vertex(scene, x.station)) for x in scene.actions if x.station is not None]
        here = [(action, self._points[vertex]) for action, vertex in here if vertex in self._points]
        self._moving = [(action, point) for action, point in here if signals_of(action)]
        self._fixed = [self._sum((x for x in here if not signals_of(x[0]) and x[0].scaled is scaled), 0.0)
                       for scaled in (True, False)]  # fmt: skip
        self._unloaded = not here
        self._maps = None

    def loads(self, load_factor, t=0.0):
        """(points, 6) force and moment of the actions at clamped stations, at the time t (s)."""
        scaled, full = self._fixed
        if self._unloaded:
            return full
        total = load_factor * scaled + full
        for moving in self._moving:
            total = total + (load_factor if moving[0].scaled else 1.0) * self._sum([moving], t)
        return total

    def _sum(self, actions, t):
        scene, scales, total = self._model.scene, self._model.scales, np.zeros((self.count, 6))
        for action, point in actions:
            total[point] += resultant_at_rest(action, scene, t) / np.repeat([scales.force, scales.moment], 3)
        return total

    def of_step(self):
        """(points, 6) force and moment that balance the stress of a step and the actions along rods, see
        `moving_forms.virtual_work_of_step`; on all ranks."""
        model, total = self._model, np.zeros((self.count, 6))
        if self._maps is None:
            self._maps = self._from_expressions()
        for expression, numbers in self._maps:
            total += (numbers @ compat.evaluate(expression, model.mesh, self._cells).ravel()).reshape(-1, 6)
        return model.comm.allreduce(total) if model.comm.size > 1 else total

    def _from_expressions(self):
        """[(expression, matrix)]: `of_step` is the sum of each matrix times the values of its expression on the
        elements at clamped points."""
        model, rule = self._model, self._model.rule
        if not len(self._cells):
            return []
        here, ends = model.rods.cells[self._cells], self._ends * model.signature.degree
        h, turned = (model.layout.sizes(model.scene) / model.scales.length)[here], model.rods.reversed[self._cells]
        value = rule.weights * rule.basis(rule.gauss)[:, ends].T * h[:, None]
        slope = rule.weights * rule.slopes[:, ends].T
        maps = [(model.forms.of_step, self._map(np.stack([value, slope], axis=2), turned))]
        if model.forms.of_step_at_nodes is not None:
            at_end = (ends[:, None] == np.arange(len(model.nodes))) * rule.lobatto * h[:, None]
            maps.append((model.forms.of_step_at_nodes, self._map(at_end[:, :, None], turned)))
        return maps

    def _map(self, weights, turned):
        """The matrix to (clamped points, 6), inertial, from values (elements, points, parts, force or moment, 3) along
        the model's axes, which are summed with weights (elements, points, parts)."""
        weights[turned] = weights[turned][:, ::-1]
        to_point = self._of_point == np.arange(self.count)[:, None]
        axes = self._model.axes.T
        matrix = np.einsum("kc,cgp,fe,xi->kfxcgpei", to_point, weights, np.eye(2), axes)
        return matrix.reshape(6 * self.count, -1)
