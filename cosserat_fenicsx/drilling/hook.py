"""The hook that holds the string."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from cosserat_fenicsx.checks import number, store
from cosserat_fenicsx.drilling.signals import ScalarSignal


@dataclass(frozen=True)
class Hook:
    """The travelling block with its lines.

    Args:
        stiffness: of lines and derrick, N/m; infinity for a rigid one.
        speed: of the block, m/s, upwards positive: a number, from the start on, or a function of time.

    Raises:
        SceneError: a stiffness that is not positive, or a speed that is no number.
    """

    stiffness: float = math.inf
    speed: float | Callable[[float], float] = 0.0

    def __post_init__(self):
        store(self, stiffness=number(self, "stiffness", self.stiffness, "a positive number or infinity (N/m)",
                                     lambda x: x > 0))  # fmt: skip
        self.signal()

    def signal(self) -> ScalarSignal:
        """The speed of the block at every time, m/s."""
        return ScalarSignal(self, "speed", self.speed, "m/s")
