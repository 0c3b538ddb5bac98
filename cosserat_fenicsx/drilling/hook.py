"""The hook that holds the string."""

import math
from dataclasses import dataclass

from cosserat_fenicsx.drilling.signals import ScalarSignal
from cosserat_fenicsx.parts import InTime, Part, Speed, Stiffness


@dataclass(frozen=True)
class Hook(Part):
    """The travelling block with its lines.

    Args:
        stiffness: of lines and derrick, N/m; infinity for a rigid one.
        speed: of the block, m/s, upwards positive: a number, from the start on, or a function of time.

    Raises:
        SceneError: a stiffness that is not positive, or a speed that is no number.
    """

    stiffness: Stiffness = math.inf
    speed: InTime[Speed] = 0.0

    def validate(self):
        """See `Part`."""
        self.signal()

    def signal(self) -> ScalarSignal:
        """The speed of the block at every time, m/s."""
        return ScalarSignal(self, "speed", self.speed, "m/s")
