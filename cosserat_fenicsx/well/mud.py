"""The drilling fluid."""

import math
import warnings
from dataclasses import dataclass
from typing import ClassVar

from cosserat_fenicsx.checks import number, store
from cosserat_fenicsx.errors import SceneWarning

# Densities (kg/m^3) between these are neither a gas's nor a liquid's, and no mud is heavier than the last.
_NO_FLUID, _HEAVIEST = (5.0, 300.0), 2700.0


@dataclass(frozen=True)
class Mud:
    """The fluid in the hole and in the string, at rest.

    Args:
        density: kg/m^3; 0 for air.
        inside: that in the string, kg/m^3; None for the same.

    Raises:
        SceneError: a density that is negative or not finite.
    """

    density: float
    inside: float | None = None

    #: m/s^2, standard.
    gravity: ClassVar[float] = 9.80665

    def __post_init__(self):
        store(self, inside=self.density if self.inside is None else self.inside)
        for field in ("density", "inside"):
            value = number(self, field, getattr(self, field), "a density (kg/m^3), not negative",
                           lambda x: 0 <= x < math.inf)  # fmt: skip
            store(self, **{field: value})
        if _NO_FLUID[0] < self.density < _NO_FLUID[1] or 0.5 < self.density < 3 or self.density > _HEAVIEST:
            warnings.warn(
                f"Mud.density = {self.density:g} kg/m^3 is hardly that of a mud: 1.2 g/cm^3 are 1200, 10 pounds per US "
                "gallon 10 * units.ppg = 1198",
                SceneWarning,
                stacklevel=3,
            )
