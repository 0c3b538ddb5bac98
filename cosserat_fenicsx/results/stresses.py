"""Stresses of a result in its rods' sections."""

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.numerics import directors
from cosserat_fenicsx.results.on_nodes import OnNodes
from cosserat_fenicsx.scene.rod import StationOrName
from cosserat_fenicsx.scene.stresses import Stress

_SIDES = ("left", "right")


class Stresses(OnNodes):
    """Stresses from the contact forces and moments, where sections know their shape."""

    def stress(self, station: StationOrName, side: str | None = None) -> Stress:
        """Stresses of the section at a station, Pa; see `scene.stresses` for the theory.

        They are those of tension, bending, torsion and shear by Saint-Venant, per area of the reference. Where the
        section changes or a point load acts, the two sides of the station differ: by default each stress is the worse
        of both, and a side whose section has no shape is left out. In motions they include the stresses of damping.

        Args:
            station: a `Station` or its name.
            side: "left" for the side of smaller s, "right" for that of larger s; default the worse of both.

        Returns:
            `Stress` of arrays (n,): von_mises, the largest of the section, NaN for a `Profile`; axial_max and
            axial_min, the largest and the smallest normal stress of the section, tension positive.

        Raises:
            SceneError: no such station or side, or the section there is a `Stiffness`, whose shape is not known.
        """
        station = self.station(station)
        if side not in (None, *_SIDES):
            refuse(f"stress at {station}", "side", side, "'left', 'right', or None for the worse of both")
        profile, zero = station.rod.profile, np.zeros(3)
        sections = {where: profile.section(station.s, where) for where in ([side] if side else _SIDES)}
        shaped = [at for at, section in sections.items() if section.stresses(profile.material, zero, zero) is not None]
        if not shaped:
            kinds = " and ".join(sorted({type(section).__name__ for section in sections.values()}))
            raise SceneError(
                f"stress at {station}: the section there is a {kinds}, whose shape is not known: expected a Circle, "
                "a Tube, a Rectangle, a Profile or another section with a shape"
            )
        von_mises, most, least = zip(*(self._stress_on(station, where) for where in shaped), strict=True)
        return Stress(np.fmax.reduce(von_mises), np.fmax.reduce(most), np.fmin.reduce(least))

    def _stress_on(self, station, side):
        d = directors(self.rotation(station)) @ station.rod.curve.frame(station.s)
        contact = self._contact_at(station, side)
        n, m = contact[:, :3] * self.scales.force, contact[:, 3:] * self.scales.moment
        n, m = (np.einsum("kij,ki->kj", d, x)[:, None] for x in (n, m))
        return Stress(*(x[:, 0] for x in station.rod.profile.stresses(np.array([station.s]), side, n, m)))

    @property
    def knows_stresses(self) -> bool:
        """Whether a section of any rod knows its shape; else `fields` and files have no stresses."""
        return any(rod.profile.shaped for rod in self.scene.rods)
