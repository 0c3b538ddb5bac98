"""The moment of the weight of a rod whose mass centre lies off its axis."""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import Numbers
from cosserat_fenicsx.scene.action import LineAction, vector
from cosserat_fenicsx.scene.rod import Rod


@dataclass(frozen=True)
class WeightOffAxis(LineAction):
    """The moment R a x rho A g per unit of reference length about the axis of an eccentric rod; `Weight` adds it.

    Args:
        rod: a rod with an eccentricity.
        gravity, permanent: as those of the `Weight`, whose force it leaves out.
    """

    rod: Rod
    gravity: Numbers
    permanent: bool = False

    work = "moment_on_arm"

    @property
    def scaled(self):
        """See `Action`."""
        return not self.permanent

    def data(self, rod, s):
        """See `Action`."""
        force = rod.stiffness_at(s).mass[..., None] * np.asarray(self.gravity)
        arm = np.einsum("...ij,...j->...i", rod.curve.frame(s), rod.mass_centre.at(s))
        return vector(force, "N/m"), vector(arm, "m")
