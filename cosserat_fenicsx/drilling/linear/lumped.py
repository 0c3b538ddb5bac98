"""The bit that cuts on a string of one mass and one disc: Richard, Germay & Detournay, J. Sound Vib. 305 (2007) 432.

In their units (time sqrt(I/C) of the disc I on the torsional spring C, length 2 C/(epsilon a^2)):

    u'' + 2 za wa u' + wa^2 u = -psi n (d - d0),    phi'' + 2 zt phi' + phi = -n (d - d0)

with the depth of cut d of a blade, d0 the steady one at the rotation om0 and the rate of penetration v0, and the
characteristic equation, with E = 1 - exp(-2 pi s/(n om0)) and rho = v0/om0,

    (s^2 + 2 za wa s + wa^2 + n psi E)(s^2 + 2 zt s + 1 - n rho E) + n^2 psi rho E^2 = 0.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.optimize import brentq

from cosserat_fenicsx.checks import positive, refuse
from cosserat_fenicsx.drilling.linear.roots import Box, all_roots
from cosserat_fenicsx.parts import Number, Part, Ratio, at_least

NotNegative = Annotated[float, Number(limits=at_least(0))]


@dataclass(frozen=True)
class LumpedCutting(Part):
    """The lumped model in its own units, see the head of its file.

    Args:
        psi: ratio of axial to torsional stiffness of the cut over those of the string, zeta epsilon a I/(M C).
        blades: n. penetration: v0; 0 for the axial motion alone.
        axial_frequency, axial_damping: wa and za; 0 for a mass without spring, as in the paper.
        torsional_damping: zt.

    Raises:
        SceneError: numbers out of range.
    """

    psi: Ratio
    blades: Annotated[int, Number(limits=at_least(1, "a number of blades"), whole=True)]
    penetration: NotNegative = 0.0
    axial_frequency: NotNegative = 0.0
    axial_damping: NotNegative = 0.0
    torsional_damping: NotNegative = 0.0

    def roots(self, rotation: float, up_to: float | None = None) -> np.ndarray:
        """All roots with Re s > -1 at a rotation om0.

        Args:
            up_to: largest imaginary part; None for that beyond which no root can grow.

        Returns:
            (m,) complex of Im s >= 0, the fastest growing one first. The root 0 of a string whose axial position is
            arbitrary (wa = 0) is left out.

        Raises:
            SceneError: a rotation that is not positive. NotConverged: roots are missing from their count.
        """
        rotation = positive("LumpedCutting", "rotation", rotation, "number")
        n, rho = self.blades, self.penetration / rotation
        # on the right |E| <= 2: no root is farther from 0 than where |s|^2 outweighs all the rest
        reach = 2 + 2 * self.axial_damping * self.axial_frequency + 2 * self.torsional_damping + self.axial_frequency
        reach += math.sqrt(2 * n * self.psi) + math.sqrt(2 * n * rho) + 1
        up_to = reach if up_to is None else positive("LumpedCutting", "up_to", up_to, "number")
        spacing = min(1.0, n * rotation)
        roots, _ = all_roots(self._equation(rotation), Box(-1.0, reach, 0.0, up_to), spacing)
        roots = roots[np.abs(roots) > 1e-9]
        return roots[np.argsort(-roots.real, kind="stable")]

    def limits(self, low: float, high: float, points: int = 40) -> np.ndarray:
        """Rotations between `low` and `high` where the number of growing roots changes, ascending.

        Args:
            points: at which the roots are counted in between; two changes between neighbours would be missed.

        Raises:
            SceneError: an empty range. NotConverged: roots are missing from their count.
        """
        low, high = positive("LumpedCutting", "low", low, "number"), positive("LumpedCutting", "high", high, "number")
        if low >= high:
            refuse("LumpedCutting", "high", high, f"more than low, {low:g}")

        def growth(rotation, nth):
            roots = self.roots(rotation)
            return float(roots.real[nth]) if nth < len(roots) else -1.0

        rotations = np.geomspace(low, high, points)
        spectra = [self.roots(x) for x in rotations]
        found = []
        for k in range(points - 1):
            before, after = (int((s.real > 0).sum()) for s in spectra[k : k + 2])
            if before != after:
                nth = min(before, after)  # in the order of growth
                found.append(brentq(growth, *rotations[k : k + 2], (nth,), xtol=1e-13))
        return np.array(found)

    def _equation(self, rotation):
        n, psi, rho, tau = self.blades, self.psi, self.penetration / rotation, 2 * math.pi / (self.blades * rotation)
        wa, za, zt = self.axial_frequency, self.axial_damping, self.torsional_damping

        def f(s):
            with np.errstate(over="ignore"):
                decayed = np.exp(-s * tau)
            E, dE = 1 - decayed, tau * decayed
            axial, daxial = s**2 + 2 * za * wa * s + wa**2, 2 * s + 2 * za * wa
            if rho == 0.0:
                return axial + n * psi * E, daxial + n * psi * dE
            torsional, dtorsional = s**2 + 2 * zt * s + 1, 2 * s + 2 * zt
            cut, dcut = n * (psi * torsional - rho * axial), n * (psi * dtorsional - rho * daxial)  # E^2 drops out
            return axial * torsional + E * cut, daxial * torsional + axial * dtorsional + dE * cut + E * dcut

        return f
