"""The drilling fluid."""

import math
from dataclasses import dataclass
from typing import ClassVar

from cosserat_fenicsx.actions.fluids import AddedMass, LinearDrag
from cosserat_fenicsx.checks import number, positive, refuse, store, warn
from cosserat_fenicsx.scene.rod import Rod
from cosserat_fenicsx.scene.sections import Circle, Tube

# Densities (kg/m^3) between these are neither a gas's nor a liquid's, and no mud is heavier than the last.
_NO_FLUID, _HEAVIEST = (5.0, 300.0), 2700.0


@dataclass(frozen=True)
class Mud:
    """The fluid in the hole and in the string, at rest.

    Args:
        density: kg/m^3; 0 for air.
        inside: that in the string, kg/m^3; None for the same.
        added_mass: C_a, for motions: the mass of the fluid around that moves with the string, over the mass that the
            string displaces: 1 far from walls, 1.5 to 3 in a hole. None leaves it and the mud inside out.
        drag: lateral drag on the axis, for motions: force per length and speed, N s/m^2; None for none.

    Raises:
        SceneError: a number that is negative or not finite.
    """

    density: float
    inside: float | None = None
    added_mass: float | None = None
    drag: float | None = None

    #: m/s^2, standard.
    gravity: ClassVar[float] = 9.80665

    def __post_init__(self):
        store(self, inside=self.density if self.inside is None else self.inside)
        for field in ("density", "inside"):
            value = number(self, field, getattr(self, field), "a density (kg/m^3), not negative",
                           lambda x: 0 <= x < math.inf)  # fmt: skip
            store(self, **{field: value})
        for field, what in (("added_mass", "a coefficient"), ("drag", "a coefficient (N s/m^2)")):
            if getattr(self, field) is not None:
                value = number(self, field, getattr(self, field), f"{what}, not negative, or None",
                               lambda x: 0 <= x < math.inf)  # fmt: skip
                store(self, **{field: value})
        if _NO_FLUID[0] < self.density < _NO_FLUID[1] or 0.5 < self.density < 3 or self.density > _HEAVIEST:
            warn(
                f"Mud.density = {self.density:g} kg/m^3 is hardly that of a mud: 1.2 g/cm^3 are 1200, 10 pounds per US "
                "gallon 10 * units.ppg = 1198"
            )

    def along(self, rod: Rod, outer: float | None = None, inner: float | None = None) -> tuple:
        """What the mud does to a moving rod: an `AddedMass`, across the rod alone, and a `LinearDrag`, as far as they
        are not zero.

        Args:
            rod: the rod.
            outer, inner: diameters, m, of the rod and of its bore (0 without one); None for those of its sections.

        Raises:
            SceneError: a diameter that is not positive, or not given where a section is neither `Circle` nor `Tube`.
        """
        actions = []
        if self.added_mass is not None:
            pieces = [(end, *self._diameters(rod, section, outer, inner)) for end, section in rod.profile.pieces]
            across = [(end, self._moving(*both)) for end, *both in pieces]
            if any(mass for _, mass in across):
                actions.append(AddedMass(rod, across if len(across) > 1 else across[0][1]))
        if self.drag:
            actions.append(LinearDrag(rod, self.drag))
        return tuple(actions)

    def _moving(self, outer, inner):
        return math.pi / 4 * (self.added_mass * self.density * outer**2 + self.inside * inner**2)

    def _diameters(self, rod, section, outer, inner):
        if isinstance(section, Circle):
            own = section.diameter, 0.0
        else:
            own = (section.outer_diameter, section.inner_diameter) if isinstance(section, Tube) else (None, 0.0)
        if outer is None and own[0] is None:
            refuse("Mud.along", "outer", None, f"the diameter of rod '{rod.name}' (m), which its section does not give")
        outer = own[0] if outer is None else positive("Mud.along", "outer", outer, "m")
        inner = own[1] if inner is None else number("Mud.along", "inner", inner, "a diameter from 0 on (m)",
                                                    lambda x: 0 <= x < math.inf)  # fmt: skip
        return outer, inner
