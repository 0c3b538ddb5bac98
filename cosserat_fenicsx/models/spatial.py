"""The spatial rung: r and q in P_p, three formulations of eq. (1), dimensionless."""

import numpy as np

from cosserat_fenicsx import compat
from cosserat_fenicsx.models.base import RodModel
from cosserat_fenicsx.models.spatial_forms import compile_forms
from cosserat_fenicsx.quaternions import small_rotation


class SpatialModel(RodModel):
    """Any scene."""

    name, components, moves, turn = "spatial", 7, 3, 2.0
    variations = ((6, False),)

    def _elements(self, degree):
        if self.shape.variant == "multiplier":
            return [compat.lagrange(self.mesh, 1, 1)]
        return super()._elements(degree)

    def _compile(self, spaces):
        return compile_forms(self, *spaces, *(self.carried or (None,)))

    def _at_rest(self):
        return np.column_stack([self.reference, np.tile([1.0, 0, 0, 0], (len(self.reference), 1))])

    def _variation_axes(self):
        return (np.eye(6),)

    def tied_motion(self, values):
        """See `RodModel`."""
        return values

    def tie_maps(self, values):
        """See `RodModel`."""
        trial, test = np.zeros((len(values), 6, 7)), np.zeros((len(values), 7, 6))
        trial[:, :3, :3] = test[:, :3, :3] = np.eye(3)
        test[:, 4:, 3:] = np.eye(3)
        for k, node in enumerate(values):
            trial[k, 3:, 3:] = small_rotation(node[3:])
        return trial, test

    def expansion(self):
        """See `RodModel`."""
        return lambda load_factors, nodal, gauss: (nodal, gauss)
