"""The spatial model in motion, with the energy-conserving scheme."""

import numpy as np

from cosserat_fenicsx.models.conserving_forms import compile_conserving
from cosserat_fenicsx.models.moving import MovingSpatial, spun
from cosserat_fenicsx.models.turning import Turning
from cosserat_fenicsx.quaternions import directors


class ConservingSpatial(Turning, MovingSpatial):
    """See `MovingSpatial`; angular velocities are those of the directors' rates."""

    def _compile(self, spaces):
        self._motion_fields()
        return compile_conserving(self)

    def accept(self, h):
        """See `Moving`."""
        super().accept(h)
        nodal = self._nodal
        q = self.state.x.array[nodal[:, 3:]]
        omega = np.cross(directors(q), self.turning.x.array.reshape(-1, 3, 3), axis=1).sum(axis=2) / 2
        self.velocity.x.array[nodal[:, 3:]] = spun(q, omega)
