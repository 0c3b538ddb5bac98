"""Damping of rods: viscosity of the material (Kelvin-Voigt), and a drag in proportion to the momentum."""

import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import Numbers, number, refuse, store


@dataclass(frozen=True)
class Damping:
    """Damping of a rod.

    Kelvin-Voigt: to n and m are added Kt v_t and Jt u_t, the rates of the material strains, eqs. (2)-(3). A mode of a
    beam with the angular frequency omega decays as exp(-time omega^2 t/2). Drag: every section feels the force and the
    moment -drag times its momentum and its angular momentum; modes decay as exp(-drag t/2).

    Args:
        time: s; Kt and Jt are `time` times the stiffnesses, and so are the couplings of a `Stiffness.matrix`.
        drag: 1/s.
        Kt: (GAt1, GAt2, EAt), N s, instead of `time` times K.
        Jt: (EIt1, EIt2, GJt), N m^2 s, instead of `time` times J; where either is given, rates of stretch and shear
            cause no moment and rates of bending and torsion no force.

    Raises:
        SceneError: a number below zero, or not three of them.
    """

    time: float = 0.0
    drag: float = 0.0
    Kt: tuple | None = None
    Jt: tuple | None = None

    def __post_init__(self):
        for field, unit in (("time", "s"), ("drag", "1/s")):
            store(self, **{field: _not_negative(self, field, getattr(self, field), unit)})
        for field, unit in (("Kt", "N s"), ("Jt", "N m^2 s")):
            values = getattr(self, field)
            if values is None:
                continue
            if not isinstance(values, tuple | list) or len(values) != 3:
                refuse(self, field, values, f"three numbers, along or about d_1, d_2 and d_3 ({unit})")
            store(self, **{field: tuple(_not_negative(self, field, value, unit) for value in values)})

    @classmethod
    def ratio(cls, ratio: float, frequencies: Numbers) -> "Damping":
        """The damping with a given damping ratio drag/(2 omega) + time omega/2 at two frequencies.

        Args:
            ratio: of the damping to the critical one, in [0, 1).
            frequencies: two, Hz; the ratio is smaller between them and larger outside.

        Raises:
            SceneError: a value outside its range.
        """
        ratio = number("Damping.ratio", "ratio", ratio, "a number from 0 to below 1", lambda x: 0 <= x < 1)
        if not isinstance(frequencies, tuple | list) or len(frequencies) != 2:
            refuse("Damping.ratio", "frequencies", frequencies, "two frequencies (Hz)")
        one, two = (
            2 * math.pi * number("Damping.ratio", "frequencies", f, "positive numbers (Hz)", lambda x: 0 < x < math.inf)
            for f in frequencies
        )
        return cls(time=2 * ratio / (one + two), drag=2 * ratio * one * two / (one + two))

    @property
    def sizes(self):
        """All its numbers, zero where nothing is damped."""
        return (self.time, self.drag, *(self.Kt or ()), *(self.Jt or ()))

    def viscosity(self, stiffnesses):
        """The viscosities as `Stiffnesses` (times s), from the elastic ones."""
        Kt, Jt = (
            self.time * values if given is None else np.broadcast_to(given, values.shape)
            for values, given in ((stiffnesses.K, self.Kt), (stiffnesses.J, self.Jt))
        )
        matrix = stiffnesses.matrix
        if matrix is not None:
            matrix = self.time * matrix
            for given, part in ((self.Kt, slice(0, 3)), (self.Jt, slice(3, 6))):
                if given is not None:
                    matrix[..., part, :] = matrix[..., :, part] = 0.0
                    matrix[..., part, part] = np.diag(given)
        return stiffnesses._replace(K=Kt, J=Jt, matrix=matrix)


def _not_negative(owner, field, value, unit):
    return number(owner, field, value, f"a number that is not negative ({unit})", lambda x: 0 <= x < math.inf)
