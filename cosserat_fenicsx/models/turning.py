"""Rates of the directors of the nodes, carried from step to step by the trapezoidal rule."""

import numpy as np
from dolfinx import fem

from cosserat_fenicsx import compat
from cosserat_fenicsx.quaternions import directors


class Turning:
    """Mixin of moving spatial models; it must come first among the bases.

    Attributes:
        turning: rates of the directors R(q) of the nodes at the beginning of a step, (3 x 3) row by row.
    """

    def _motion_fields(self):
        super()._motion_fields()
        element = compat.lagrange(self.mesh, self.signature.degree, 9)
        self.turning = fem.Function(compat.function_space(self.mesh, element))

    def load(self, scene, layout):
        """See `Moving`."""
        super().load(scene, layout)
        self.turning.x.array[:] = 0.0

    def set_velocity(self, linear, angular):
        """See `Moving`."""
        super().set_velocity(linear, angular)
        R = directors(self.state.x.array[self._nodal[:, 3:]])
        self.turning.x.array[:] = np.cross(angular[self._slots][:, :, None], R, axis=1).ravel()

    @property
    def ends(self):
        """See `Moving`."""
        return *super().ends, self.turning

    @property
    def rate_arrays(self):
        """See `Moving`."""
        return *super().rate_arrays, self.turning.x.array

    def accept(self, h):
        """See `Moving`."""
        super().accept(h)
        places = self._nodal[:, 3:]
        R, before = (directors(f.x.array[places]) for f in (self.state, self.start))
        W = self.turning.x.array.reshape(-1, 3, 3)
        W[:] = 2 / h * (R - before) - W
