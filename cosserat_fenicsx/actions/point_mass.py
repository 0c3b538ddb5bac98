"""A rigid body that is fixed to a station."""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.annotations import Numbers
from cosserat_fenicsx.checks import number, positive, refuse, store
from cosserat_fenicsx.scene.action import PointAction
from cosserat_fenicsx.scene.rod import Station, StationOrName, is_known


@dataclass(frozen=True)
class PointMass(PointAction):
    """A mass, and moments of inertia, at a station, in motions and natural modes; a `Weight` acts on it too.

    Args:
        station: where; the body's centre of mass lies on the centreline.
        mass: kg.
        moments: moments of inertia about d_1, d_2, d_3, kg m^2; one number for a body with the same about every axis.

    Raises:
        SceneError: not a station, or numbers that are not positive (moments: negative).
    """

    station: StationOrName
    mass: float
    moments: float | Numbers = 0.0

    work, scaled = None, False

    def __post_init__(self):
        is_known(self, "station", Station)
        store(self, mass=positive(self, "mass", self.mass, "kg"))
        given = np.atleast_1d(self.moments)
        if given.shape not in ((1,), (3,)):
            refuse(self, "moments", self.moments, "one number, or three about d_1, d_2, d_3 (kg m^2)")
        moments = [
            number(self, "moments", x, "numbers from 0 on (kg m^2)", lambda x: 0 <= x < np.inf) for x in given.tolist()
        ]
        store(self, moments=tuple(moments * (3 // len(moments))))

    def inertia(self, rod):
        """See `Action`."""
        return self.mass, np.array(self.moments)
