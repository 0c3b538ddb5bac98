"""Stresses of a result on the outline of its rods' sections."""

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quaternions import directors
from cosserat_fenicsx.results.on_nodes import OnNodes
from cosserat_fenicsx.scene.rod import StationOrName
from cosserat_fenicsx.scene.stresses import Stress


class Stresses(OnNodes):
    """Stresses from the contact forces and moments, where sections know their shape."""

    def stress(self, station: StationOrName) -> Stress:
        """Stresses on the outline of the section at a station, Pa; see `scene.stresses` for the theory.

        They are those of tension, bending, torsion and shear by Saint-Venant, on the outer surface (of a tube: not on
        the inner one), per area of the reference. Sides of jumps as in `force`.

        Args:
            station: a `Station` or its name.

        Returns:
            `Stress` of arrays (n,): von_mises, the largest on the outline; axial_max and axial_min, the largest and the
            smallest normal stress of the section, tension positive.

        Raises:
            SceneError: no such station, or the section there is a `Stiffness`, whose shape is not known.
        """
        station = self.station(station)
        profile = station.rod.profile
        if profile.section(station.s, "left").stresses(profile.material, *np.zeros((2, 3))) is None:
            raise SceneError(
                f"stress at {station}: the section there is a Stiffness, whose shape is not known: expected a Circle, "
                "a Tube, a Rectangle or another section with a shape"
            )
        d = directors(self.rotation(station)) @ station.rod.curve.frame(station.s)
        n, m = (np.einsum("kij,ki->kj", d, x)[:, None] for x in (self.force(station), self.moment(station)))
        return Stress(*(x[:, 0] for x in profile.stresses(np.array([station.s]), "left", n, m)))

    @property
    def knows_stresses(self) -> bool:
        """Whether a section of any rod knows its shape; else `fields` and files have no stresses."""
        return any(rod.profile.shaped for rod in self.scene.rods)
