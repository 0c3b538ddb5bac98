"""What may act on the bit in place of a law of friction: bits that cut and rock with lobes plug into the model here."""

from typing import Any, NamedTuple, Protocol

import numpy as np


class EndForce(NamedTuple):
    """What the rock does to the bit in a step: a linear part and set-valued ones.

    Attributes:
        force: (2,) weight on bit (N) and torque on bit (N m) of a bit at rest.
        tangent: (2, 2) their derivatives by the mean velocities of the step, downwards (m/s) and of rotation (rad/s).
        torque: N m, against the rotation, and anything up to that at rest; None for that of the bit's Stribeck law.
        flats: N, half of what wear flats bear: their force is flats above the given one where the bit moves down, flats
            below it where it moves up, and anything between at rest.
        rock: None, or place (m below that at the start) and velocity (m/s, downwards), at the end of the step, of the
            face of a rigid rock, which pushes but does not pull.
    """

    force: np.ndarray
    tangent: np.ndarray
    torque: float | None = 0.0
    flats: float = 0.0
    rock: tuple[float, float] | None = None


class EndCondition(Protocol):
    """The force of the rock on the bit, told at the begin of every step.

    A step that does not converge is done in halves with the same numbers. The model calls `memory` and `recall` with
    its own.
    """

    def begin(self, model, h: float) -> EndForce:
        """The force in the coming step of the length h (s), from the state of the model at its begin."""

    def commit(self, model, h: float) -> None:
        """The step has been done."""

    def memory(self) -> dict[str, Any]:
        """All that later steps depend on."""

    def recall(self, memory: dict[str, Any]) -> None:
        """Restore what `memory` returned."""
