"""The uniform parts of a string, as a guide of axial and torsional waves; or `Discs`, a few rigid bodies on springs."""

import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import finite_array, refuse, store
from cosserat_fenicsx.parts import Part


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


@dataclass(frozen=True)
class Discs(Part):
    """Discs from the top drive down to the bit, joined by springs and dampers in torsion, and, with masses, axially.

    The first disc is the top drive's own inertia (beside that of `TopDrive`), the last the bit's.

    Args:
        inertias: (n,) kg m^2. stiffnesses: (n - 1,) N m/rad between neighbours.
        dampings: (n - 1,) N m s/rad between neighbours; None for none.
        drags: (n,) N m s/rad between a disc and the hole; None for none.
        masses: (n,) kg; None where discs turn alone. Their weight is left out: tensions are those beside it.
        axial_stiffnesses, axial_dampings, axial_drags: as the others, N/m, N s/m, N s/m.

    Raises:
        SceneError: numbers that are not positive, or lists whose lengths do not fit.
    """

    inertias: tuple[float, ...]
    stiffnesses: tuple[float, ...]
    dampings: tuple[float, ...] | None = None
    drags: tuple[float, ...] | None = None
    masses: tuple[float, ...] | None = None
    axial_stiffnesses: tuple[float, ...] | None = None
    axial_dampings: tuple[float, ...] | None = None
    axial_drags: tuple[float, ...] | None = None

    def __post_init__(self):
        n = finite_array(self, "inertias", self.inertias, "at least two positive numbers (kg m^2)").size
        if n < 2:
            refuse(self, "inertias", self.inertias, "at least two (kg m^2)")
        self._check(
            {"inertias": n, "stiffnesses": n - 1, "dampings": n - 1, "drags": n}, ("kg m^2", "N m/rad", "N m s/rad")
        )
        axial = {"masses": n, "axial_stiffnesses": n - 1, "axial_dampings": n - 1, "axial_drags": n}
        if self.masses is not None:
            self._check(axial, ("kg", "N/m", "N s/m"))
        for field in axial:
            if self.masses is None and getattr(self, field) is not None:
                refuse(self, field, getattr(self, field), "None for discs without masses")

    def _check(self, sizes, units):
        for (field, size), unit in zip(sizes.items(), (*units, units[-1]), strict=True):
            given = getattr(self, field)
            least = 0.0 if field.endswith(("dampings", "drags")) else math.ulp(0.0)
            if given is None and least == 0.0:
                given = np.zeros(size)
            expected = f"{size} numbers ({unit}), {'not negative' if least == 0.0 else 'positive'}"
            array = finite_array(self, field, given, expected)
            if array.shape != (size,) or (array < least).any():
                refuse(self, field, given, expected)
            store(self, **{field: tuple(array.tolist())})
