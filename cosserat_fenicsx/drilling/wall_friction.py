"""Friction between the string and the wall of its hole, while it moves and while it sticks."""

import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import number, positive, refuse, store


@dataclass(frozen=True)
class WallFriction:
    """Coefficient mu = kinetic + (static - kinetic) exp(-v/speed) of the slip v, anything up to the static one at rest.

    The friction is a vector against the slip (V, r om) of the surface, along and around the hole. Static and kinetic
    are either coefficients for the whole hole, or factors on those of its sections (`of_hole=True`).

    Args:
        static, kinetic: coefficients, 0 to 5, static at least kinetic; or factors.
        speed: decay of the static part: slip in m/s, or rotation in rad/s (`of_rotation=True`); None where static and
            kinetic are the same, or for a friction that drops to the kinetic one at once.
        of_rotation: `speed` is that of rotation, slip over contact radius.
        of_hole: static and kinetic are factors on the friction of the sections of the hole.

    Raises:
        SceneError: friction below zero, or a static friction below the kinetic one.
    """

    static: float
    kinetic: float | None = None
    speed: float | None = None
    of_rotation: bool = False
    of_hole: bool = False

    def __post_init__(self):
        if self.kinetic is None:
            store(self, kinetic=self.static)
        for field in ("static", "kinetic"):
            value = number(self, field, getattr(self, field), "a coefficient of friction from 0 to 5",
                           lambda x: 0 <= x <= 5)  # fmt: skip
            store(self, **{field: value})
        if self.static < self.kinetic:
            refuse(self, "static", self.static, f"at least the kinetic one, {self.kinetic:g}")
        if self.speed is not None:
            store(self, speed=positive(self, "speed", self.speed, "rad/s" if self.of_rotation else "m/s"))

    @property
    def decays(self) -> bool:
        """Whether the coefficient depends on the slip."""
        return self.static > self.kinetic


def coefficients(friction: WallFriction | None, of_hole: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Static and kinetic coefficients (n,) where those of the hole's sections are `of_hole` (n,); without a friction of
    the scene both are these."""
    if friction is None:
        return of_hole.copy(), of_hole.copy()
    factor = of_hole if friction.of_hole else np.ones_like(of_hole)
    return friction.static * factor, friction.kinetic * factor


@dataclass(frozen=True)
class ViscousDrag:
    """Drag of the mud along the string: a torque per length rate rho J om, a force per length rate rho A v.

    Args:
        torsion, axial: rates, 1/s; in the lowest modes waves decay like exp(-rate t/2).

    Raises:
        SceneError: negative rates.
    """

    torsion: float = 0.0
    axial: float = 0.0

    def __post_init__(self):
        for field in ("torsion", "axial"):
            store(self, **{field: number(self, field, getattr(self, field), "a rate (1/s), not negative",
                                         lambda x: 0 <= x < math.inf)})  # fmt: skip
