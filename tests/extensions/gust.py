"""A load of one's own: a gust across a rod, which grows with the height above the ground."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import ufl

import cosserat_fenicsx as cf
from cosserat_fenicsx import parts
from cosserat_fenicsx.scene.action import vector


@dataclass(frozen=True)
class Gust(cf.LineAction):
    """A dead force per length, strength (z/height)^power along a direction.

    Args:
        rod: the rod. strength: N/m, at the height. height: m. power: of the profile. direction: inertial.
    """

    rod: cf.Rod
    strength: parts.ForcePerLength
    height: parts.Length = 10.0
    power: Annotated[float, parts.Number(limits=parts.between(0, 1))] = 1 / 7
    direction: parts.Vector = (1.0, 0.0, 0.0)

    def data(self, rod, s):
        size = self.strength * (np.maximum(rod.curve.position(s)[:, 2], 0) / self.height) ** self.power
        return (vector(size[:, None] * np.array(self.direction), "N/m"),)

    @staticmethod
    def work(point, test, force):
        return ufl.dot(force, test.phi_r)
