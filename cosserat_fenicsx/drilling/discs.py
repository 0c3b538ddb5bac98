"""A string of a few rigid discs on springs, the model of many papers on stick-slip."""

import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import finite_array, refuse, store


@dataclass(frozen=True)
class Discs:
    """Discs from the top drive down to the bit, joined by springs and dampers in torsion.

    The first disc is the top drive's own inertia (beside that of `TopDrive`), the last the bit's.

    Args:
        inertias: (n,) kg m^2. stiffnesses: (n - 1,) N m/rad between neighbours.
        dampings: (n - 1,) N m s/rad between neighbours; None for none.
        drags: (n,) N m s/rad between a disc and the hole; None for none.

    Raises:
        SceneError: numbers that are not positive, or lists whose lengths do not fit.
    """

    inertias: tuple[float, ...]
    stiffnesses: tuple[float, ...]
    dampings: tuple[float, ...] | None = None
    drags: tuple[float, ...] | None = None

    def __post_init__(self):
        n = finite_array(self, "inertias", self.inertias, "at least two positive numbers (kg m^2)").size
        if n < 2:
            refuse(self, "inertias", self.inertias, "at least two (kg m^2)")
        sizes = {"inertias": n, "stiffnesses": n - 1, "dampings": n - 1, "drags": n}
        units = {"inertias": "kg m^2", "stiffnesses": "N m/rad", "dampings": "N m s/rad", "drags": "N m s/rad"}
        for field, size in sizes.items():
            given = getattr(self, field)
            least = 0.0 if field in ("dampings", "drags") else math.ulp(0.0)
            if given is None and least == 0.0:
                given = np.zeros(size)
            expected = f"{size} numbers ({units[field]}), {'not negative' if least == 0.0 else 'positive'}"
            array = finite_array(self, field, given, expected)
            if array.shape != (size,) or (array < least).any():
                refuse(self, field, given, expected)
            store(self, **{field: tuple(array.tolist())})
