"""A roller-cone bit on a rock with lobes, as the lower end of a string: the rock lifts the bit as it turns.

The rock is rigid or a spring; it pushes and does not pull. Its face below the bit is at u = -amplitude sin(count Phi),
downwards positive, at the angle Phi by which the bit is expected to have turned since the start at the end of the step.
"""

import math

import numpy as np

from cosserat_fenicsx.drilling.axial_torsional.end_condition import EndForce
from cosserat_fenicsx.drilling.bit_laws import Lobes


class LobedEnd:
    """An `EndCondition` for `Lobes`.

    Args:
        law: `Lobes`. angle, turning: of the bit at the start, rad and rad/s.
    """

    def __init__(self, law: Lobes, angle: float = 0.0, turning: float = 0.0):
        self.law, self._start, self._before = law, float(angle), float(turning)

    def begin(self, model, h: float) -> EndForce:
        """See `EndCondition`."""
        (_, angle), (_, turning) = model.bit_state()
        faster, self._before = turning - self._before, float(turning)
        phase = self.law.count * (angle - self._start + h * (turning + faster / 2))
        face = -self.law.amplitude * math.sin(phase)
        moving = -self.law.amplitude * self.law.count * (turning + faster) * math.cos(phase)
        return EndForce(np.zeros(2), np.zeros((2, 2)), torque=None, rock=(face, moving))

    def commit(self, model, h: float) -> None:
        """See `EndCondition`."""

    def memory(self) -> dict:
        """See `EndCondition`."""
        return {"before": self._before}

    def recall(self, memory: dict) -> None:
        """See `EndCondition`."""
        self._before = float(memory["before"])
