"""A drag bit that cuts, as the lower end of a string: depth of cut with the delay of a part of a revolution.

The law of Richard, Germay & Detournay, see `bit_laws.Cutting` and `RockSurface`. In a step from t to t + h the depth of
cut is that at its middle,

    d = u + h/2 w - S,    S = S(Phi - 2 pi/n) at the angle Phi that the bit is expected to have there,

with the unknown mean velocity w. The weight on bit n zeta epsilon a d is linear in it. The torque n epsilon a^2 d/2,
with the velocity that is expected for w, acts against the rotation, and holds a bit at rest up to that size. Where d
would be negative the bit is above the rock, and free. Wear flats bear all or nothing as the bit moves down or up, and
anything between at rest.
"""

import math

import numpy as np

from cosserat_fenicsx.drilling.axial_torsional.end_condition import EndForce
from cosserat_fenicsx.drilling.bit_laws import Cutting
from cosserat_fenicsx.drilling.rock_surface import RockSurface

_SLOWING = 0.3  # of the mean speed in a step


class CuttingEnd:
    """An `EndCondition`.

    Args:
        law: a `Cutting`. weight: static weight on bit, N, that the string starts with; 0 for a bit that just touches.
        place: (2,) of the bit at the start, m downwards and rad. motion: (2,) its velocities there, m/s and rad/s, of
            steady drilling; zeros at rest.
    """

    def __init__(self, law: Cutting, weight: float, place: np.ndarray, motion: np.ndarray):
        self.law, wear = law, law.wear
        self._flats = 0.0 if wear is None else law.a * wear.length * wear.stress
        self._rubbing = 0.0 if wear is None else wear.geometry * wear.friction * law.a / 2
        rate, turning = float(motion[0]), float(motion[1])
        slope = max(rate, 0.0) / turning if turning > 0 else 0.0  # a bit that is pulled up leaves no rock
        cut = 2 * math.pi / law.blades * slope
        if turning <= 0:
            cut = max(weight - self._flats, 0.0) / law.axial_stiffness
        self.rock = RockSurface(law.blades, float(place[1]), float(place[0]), slope, cut)
        self._before = np.array(motion, dtype=float)  # velocities at the start of the last step
        self._bears = self._flats if rate > 0 else min(weight, self._flats)  # what the wear flats bore in it

    def steady_forces(self, rate: float, speed: float) -> tuple[float, float]:
        """Weight (N) and torque (N m) on bit at a steady rate of penetration (m/s) and speed (rad/s)."""
        cut = 2 * math.pi / self.law.blades * max(rate, 0.0) / speed
        flats = self._flats if rate > 0 else 0.0
        return self.law.axial_stiffness * cut + flats, self.law.torsional_stiffness * cut + self._rubbing * flats

    def begin(self, model, h: float) -> EndForce:
        """See `EndCondition`."""
        self._at, velocity = model.bit_state()
        w = velocity + (velocity - self._before) / 2
        self._before = velocity
        rock, _ = self.rock.under(self._at[1] + h / 2 * w[1])
        self._gap = self._at[0] - rock
        cut = self._gap + h / 2 * w[0]
        if cut <= 0:
            return EndForce(np.zeros(2), np.zeros((2, 2)))
        stiffness = self.law.axial_stiffness
        force = np.array([stiffness * self._gap + self._flats / 2, 0.0])
        tangent = np.array([[stiffness * h / 2, 0.0], [0.0, 0.0]])
        torque = self.law.torsional_stiffness * cut + self._rubbing * self._bears
        return EndForce(force, tangent, torque, self._flats / 2)

    def commit(self, model, h: float) -> None:
        """See `EndCondition`."""
        (u, angle), (v, turning) = model.bit_state()
        moved, turned = u - self._at[0], angle - self._at[1]
        borne = model.weight_on_bit - self.law.axial_stiffness * max(self._gap + moved / 2, 0.0)
        self._bears = min(max(borne, 0.0), self._flats)
        if turned > 0:
            # where the bit nearly stops, its velocities tell nothing about the slope of the rock
            slope = v / turning if turning * h > _SLOWING * turned else moved / turned
            self.rock.pass_over(float(angle), float(u), float(slope))

    def memory(self) -> dict:
        """See `EndCondition`."""
        return {"rock": self.rock.memory(), "before": self._before.copy(), "bears": self._bears}

    def recall(self, memory: dict) -> None:
        """See `EndCondition`."""
        self.rock.recall(memory["rock"])
        self._before, self._bears = memory["before"].copy(), float(memory["bears"])
