"""A bit law: the static torque within a band of speeds, the dynamic one beyond."""

from dataclasses import dataclass

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling import BitLaw
from cosserat_fenicsx.parts import AngularVelocity, Torque


@dataclass(frozen=True)
class HeldInBand(BitLaw):
    """A torque that drops when the bit leaves a band of slow speeds.

    Args:
        static, dynamic: N m. band: rad/s.

    Raises:
        SceneError: a static torque below the dynamic one.
    """

    static: Torque
    dynamic: Torque
    band: AngularVelocity = 0.01

    def validate(self):
        if self.static < self.dynamic:
            refuse(self, "static", self.static, f"at least the dynamic one, {self.dynamic:g}")

    def torque(self, speed, weight):
        return self.dynamic if speed > self.band else self.static
