"""The data of the column of the paper's section 3, and the results of a comparison model."""

import math
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Column:
    """A clamped circular column (m, Pa) under a dead axial tip force F = eta P_cr of an eccentricity; shear_factor: of
    the rods; None is 6(1 + nu)/(7 + 6 nu); arm: False for the constant tip moment F e, True for the force on a rigid
    arm that turns with the tip section."""

    length: float = 20.0
    diameter: float = 0.2
    eccentricity: float = 0.2
    E: float = 210e9
    nu: float = 0.3
    shear_factor: float | None = None
    arm: bool = False

    @property
    def axial(self):
        """EA, N."""
        return self.E * math.pi * self.diameter**2 / 4

    @property
    def bending(self):
        """EI, N m^2."""
        return self.E * math.pi * self.diameter**4 / 64

    @property
    def shear(self):
        """GA with the shear factor in it, N."""
        factor = self.shear_factor or 6 * (1 + self.nu) / (7 + 6 * self.nu)
        return factor * self.axial / (2 * (1 + self.nu))

    @property
    def relative(self):
        """(EA, GA) in units of EI/L^2, and e in units of L."""
        unit = self.bending / self.length**2
        return self.axial / unit, self.shear / unit, self.eccentricity / self.length


#: The load at eta = 1 in units of EI/L^2: P_cr = pi^2 EI/(2L)^2.
CRITICAL = math.pi**2 / 4


@dataclass
class Curve:
    """Tip of one model along its path, one entry per point reached: F/P_cr; its displacements across, and along towards
    the clamp, m; rotation, rad, nan where the model has none; Newton iterations since the previous point, rejected
    steps included; negative eigenvalues of the tangent; and why the path stopped before the last load factor, or ""."""

    eta: np.ndarray
    delta: np.ndarray
    shortening: np.ndarray
    rotation: np.ndarray
    iterations: np.ndarray
    negative_modes: np.ndarray
    stopped: str = ""

    @classmethod
    def of(cls, problem, points, stopped=""):
        """The curve through points of `follow` of a problem that knows `tip(x)`, in m, m, rad."""
        tips = np.array([problem.tip(p.x) for p in points]).reshape(-1, 3)
        return cls(
            np.array([p.eta for p in points]),
            *tips.T,
            np.array([p.iterations for p in points], dtype=int),
            np.array([p.negative_modes for p in points], dtype=int),
            stopped,
        )


@dataclass(frozen=True)
class LimitPoint:
    """A load factor that the path cannot exceed, and the tip there (m, rad)."""

    eta: float
    delta: float
    shortening: float
    rotation: float
    x: np.ndarray = field(repr=False)
