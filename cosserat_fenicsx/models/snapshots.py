"""What a model keeps of a state for results: copies of the nodes' unknowns, and of fields at the Gauss points."""

import numpy as np

from cosserat_fenicsx import compat


class Snapshots:
    """Mixin of `RodModel`."""

    def snapshot(self):
        """The input of `expansion`: the nodes' unknowns (N, components), and the fields at the Gauss points (cells,
        points, k) or None; in the scene's order, on all ranks, dimensionless."""
        nodal = self._gather_nodes(self.state.x.array[self._nodal[: self._owned_nodes]])
        if self.forms.fields is None:
            return nodal, None
        return nodal, self.gathered(self.forms.fields, len(self.forms.gauss), self.forms.fields_size)

    def snapshots(self, x, fields):
        """`snapshot` at several states of one process: from its unknowns (k, unknowns), and the values of the fields
        (k, elements, n) or None."""
        numbering = self.numbering
        state = np.tile(self._rest_state, (len(x), 1))
        state[:, numbering.free] = x[:, numbering.of_free]
        nodal = np.empty((len(x), *self._nodal.shape))
        nodal[:, self._slots] = state[:, self._nodal]
        if fields is None:
            return nodal, None
        values = fields.reshape(*fields.shape[:2], len(self.forms.gauss), -1).copy()
        values[:, self.rods.reversed] = values[:, self.rods.reversed][:, :, ::-1]
        found = np.empty_like(values)
        found[:, self.rods.cells] = values
        return nodal, found

    def gathered(self, expression, points, size):
        """(elements, points, size) values of a compiled expression, in the scene's order, on all ranks."""
        owned = len(self._owned_cells)
        values = compat.evaluate(expression, self.mesh, self._owned_cells).reshape(owned, points, size)
        reverse = self.rods.reversed[:owned]
        values[reverse] = values[reverse][:, ::-1]
        return self._gather_cells(values.reshape(owned, points * size)).reshape(-1, points, size)
