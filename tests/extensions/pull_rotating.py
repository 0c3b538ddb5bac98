"""An operation: the string is pulled out slowly with an overpull while it rotates, to free it."""

import math
from dataclasses import dataclass
from typing import Annotated

from cosserat_fenicsx.parts import ForceSize, Rotation, Speed, positive
from cosserat_fenicsx.well.operations import Operation


@dataclass(frozen=True)
class PullRotating(Operation):
    """Pulled up while rotating.

    Args:
        overpull: pull on the lower end, N. speed: upwards, m/s. rpm: revolutions per minute.
    """

    overpull: Annotated[ForceSize, positive("a pull")]
    speed: Annotated[Speed, positive()]
    rpm: Rotation

    weight = property(lambda self: -self.overpull)

    def direction(self, radius):
        around = self.rpm * math.pi / 30 * radius
        size = math.hypot(self.speed, around)
        return self.speed / size, around / size
