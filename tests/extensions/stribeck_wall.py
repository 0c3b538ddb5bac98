"""A law of friction at the wall: Stribeck's curve, boundary friction that gives way to a film with drag."""

import math
from dataclasses import dataclass

from cosserat_fenicsx.drilling import FrictionLaw
from cosserat_fenicsx.parts import Friction, Rate, Speed


@dataclass(frozen=True)
class StribeckCurve(FrictionLaw):
    """kinetic + (static - kinetic) exp(-(slip/speed)^2) + viscous slip.

    Args:
        static, kinetic: coefficients of friction. speed: m/s. viscous: s/m.
    """

    static: Friction
    kinetic: Friction
    speed: Speed
    viscous: Rate = 0.0

    def coefficient(self, slip):
        boundary = (self.static - self.kinetic) * math.exp(-((slip / self.speed) ** 2))
        return self.kinetic + boundary + self.viscous * slip
