"""The spatial model in motion, with the energy-conserving scheme."""

import numpy as np
from dolfinx import fem

from cosserat_fenicsx import compat
from cosserat_fenicsx.models.conserving_forms import compile_conserving
from cosserat_fenicsx.models.moving import MovingSpatial, spun
from cosserat_fenicsx.quaternions import directors


class ConservingSpatial(MovingSpatial):
    """See `MovingSpatial`.

    Attributes:
        turning: rates of the directors R(q) of the nodes at the beginning of a step, (3 x 3) row by row.
    """

    def _compile(self, spaces):
        self._motion_fields()
        element = compat.lagrange(self.mesh, self.signature.degree, 9)
        self.turning = fem.Function(compat.function_space(self.mesh, element))
        return compile_conserving(self)

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
    def rate_arrays(self):
        """See `Moving`."""
        return self.velocity.x.array, self.turning.x.array

    def accept(self, h):
        """See `Moving`."""
        super().accept(h)
        nodal = self._nodal
        q = self.state.x.array[nodal[:, 3:]]
        R, before = directors(q), directors(self.start.x.array[nodal[:, 3:]])
        W = self.turning.x.array.reshape(-1, 3, 3)
        W[:] = 2 / h * (R - before) - W
        omega = np.cross(R, W, axis=1).sum(axis=2) / 2
        self.velocity.x.array[nodal[:, 3:]] = spun(q, omega)
