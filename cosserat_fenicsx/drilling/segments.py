"""The uniform parts of a string, as a guide of axial and torsional waves."""

import math
from dataclasses import dataclass

from cosserat_fenicsx.checks import refuse


@dataclass(frozen=True)
class Segment:
    """A uniform part of a string.

    Attributes:
        length: m. GJ: N m^2. rhoJ: polar inertia per length, kg m. EA: N. rhoA: kg/m. radius: of contact, m.
        weight: in mud, N/m. name: of the component.
    """

    length: float
    GJ: float
    rhoJ: float
    EA: float
    rhoA: float
    radius: float
    weight: float
    name: str

    @property
    def torsional_speed(self) -> float:
        """Of waves, sqrt(G/rho), m/s."""
        return math.sqrt(self.GJ / self.rhoJ)

    @property
    def torsional_impedance(self) -> float:
        """J sqrt(G rho), N m s/rad."""
        return math.sqrt(self.GJ * self.rhoJ)

    @property
    def axial_speed(self) -> float:
        """Of waves, sqrt(E/rho), m/s."""
        return math.sqrt(self.EA / self.rhoA)

    @property
    def axial_impedance(self) -> float:
        """A sqrt(E rho), N s/m."""
        return math.sqrt(self.EA * self.rhoA)


def segment_of(place, weight):
    """The `Segment` of a component in its place (`Laid`), of a weight in mud (N/m).

    Raises:
        SceneError: a component without stiffness, mass or inertia.
    """
    part = place.component
    stiffness = part.stiffness
    if stiffness is None:
        refuse(part, "stiffness", None, "a Stiffness with mass and inertia, for a motion")
    for field in ("mass", "inertia"):
        if getattr(stiffness, field) is None:
            refuse(part, f"stiffness.{field}", None, "the mass (kg/m) and inertia (kg m) of the section, for a motion")
    if math.isinf(stiffness.axial):
        refuse(part, "stiffness.axial", stiffness.axial, "a finite axial stiffness (N), for a motion")
    mass = stiffness.mass if part.mass is None else part.mass
    return Segment(
        place.bottom - place.top, stiffness.torsion, stiffness.inertia[2], stiffness.axial, mass, part.contact_radius,
        weight, part.name,
    )  # fmt: skip
