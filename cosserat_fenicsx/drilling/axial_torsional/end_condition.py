"""What may act on the bit beside a law of friction: where bits that cut plug into the model."""

from typing import Any, Protocol

import numpy as np


class EndCondition(Protocol):
    """The force of the rock on the bit, given at the begin of every step and linear in the bit's mean velocities in it.

    Beside the force, the bit may stand on a rigid rock: `begin` then calls `model.set_rock`. A step that does not
    converge is done in halves with the same numbers. The model calls `memory` and `recall` with its own.
    """

    def begin(self, model, h: float) -> tuple[np.ndarray, np.ndarray]:
        """The force on the bit in the coming step of the length h (s), from the state of the model at its begin.

        Returns:
            (2,): weight on bit (N) and torque on bit (N m), for a bit at rest; (2, 2): their derivatives with respect
            to the mean velocities, downwards (m/s) and of rotation (rad/s).
        """

    def commit(self, model, h: float) -> None:
        """The step has been done."""

    def memory(self) -> dict[str, Any]:
        """All that later steps depend on."""

    def recall(self, memory: dict[str, Any]) -> None:
        """Restore what `memory` returned."""
