"""The uniform parts of a string, waveguides of axial and torsional waves; or `Discs`, a few rigid bodies on springs."""

import math
from dataclasses import dataclass
from typing import Annotated

from cosserat_fenicsx.checks import refuse, store
from cosserat_fenicsx.parts import Damping, Inertia, Mass, Number, Part, TorsionalDamping, TorsionalStiffness, positive


@dataclass(frozen=True)
class Segment:
    """A uniform part of a string.

    Attributes:
        length: m. GJ, rhoJ: torsional stiffness, N m^2, and polar inertia per length, kg m, with tool joints, see
            `StringPart.torsion`. EA: N. rhoA: kg/m, with tool joints. radius: of contact, m. weight: in mud, N/m.
        name: of the component. damping_time: of Kelvin and Voigt, s.
    """

    length: float
    GJ: float
    rhoJ: float
    EA: float
    rhoA: float
    radius: float
    weight: float
    name: str
    damping_time: float = 0.0

    @property
    def torsional_speed(self) -> float:
        """Of waves, sqrt(G/rho) without tool joints, m/s."""
        return math.sqrt(self.GJ / self.rhoJ)

    @property
    def torsional_impedance(self) -> float:
        """J sqrt(G rho) without tool joints, N m s/rad."""
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
    """The `Segment` of a component in its place (`Laid`) with a weight in mud (N/m).

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
    return Segment(place.bottom - place.top, *part.torsion, stiffness.axial, mass, part.contact_radius, weight,
                   part.name, part.damping_time)  # fmt: skip


@dataclass(frozen=True)
class Discs(Part):
    """Discs from the top drive down to the bit, joined by springs and dampers in torsion, and, with masses, axially.

    The first disc is the top drive's own inertia (beside that of `TopDrive`), the last the bit's.

    Args:
        inertias: (n,) kg m^2. stiffnesses: (n - 1,) N m/rad between neighbours.
        dampings: (n - 1,) N m s/rad between neighbours; None for none.
        drags: (n,) N m s/rad between a disc and the hole; None for none.
        masses: (n,) kg; None where discs turn alone. Their weight is left out, in tensions too.
        axial_stiffnesses, axial_dampings, axial_drags: as in torsion, N/m, N s/m, N s/m.

    Raises:
        SceneError: numbers that are not positive, or lists whose lengths do not fit.
    """

    inertias: tuple[Annotated[Inertia, positive()], ...]
    stiffnesses: tuple[Annotated[TorsionalStiffness, positive()], ...]
    dampings: tuple[TorsionalDamping, ...] | None = None
    drags: tuple[TorsionalDamping, ...] | None = None
    masses: tuple[Annotated[Mass, positive()], ...] | None = None
    axial_stiffnesses: tuple[Annotated[float, Number("stiffness", positive())], ...] | None = None
    axial_dampings: tuple[Damping, ...] | None = None
    axial_drags: tuple[Damping, ...] | None = None

    def validate(self):
        n = len(self.inertias)
        if n < 2:
            refuse(self, "inertias", self.inertias, "at least two (kg m^2)")
        sizes = {"stiffnesses": n - 1, "dampings": n - 1, "drags": n}
        axial = {"masses": n} | {f"axial_{name}": size for name, size in sizes.items()}
        for field, size in (sizes | axial).items():
            given = getattr(self, field)
            if field in axial and self.masses is None:
                if given is not None:
                    refuse(self, field, given, "None for discs without masses")
                continue
            if given is None and field.endswith(("dampings", "drags")):
                given = (0.0,) * size
            if given is None or len(given) != size:
                refuse(self, field, given, f"{size} numbers, with {n} discs")
            store(self, **{field: given})
