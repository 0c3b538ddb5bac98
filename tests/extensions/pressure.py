"""A load: a pressure that stays across a rod as it bends."""

from dataclasses import dataclass

import ufl

import cosserat_fenicsx as cf
from cosserat_fenicsx.parts import ForcePerLength
from cosserat_fenicsx.scene.action import vector
from cosserat_fenicsx.scene.rod import RodOrName


@dataclass(frozen=True)
class AcrossRod(cf.LineAction):
    """A force per length along the director d_1, which turns with the rod.

    Args:
        rod: the rod.
        pressure: N/m.
    """

    rod: RodOrName
    pressure: ForcePerLength

    follows = True

    def data(self, rod, s):
        return (vector(self.pressure * rod.curve.frame(s)[:, :, 0], "N/m"),)

    @staticmethod
    def work(point, test, f):
        return ufl.dot(point.R * f, test.phi_r)
