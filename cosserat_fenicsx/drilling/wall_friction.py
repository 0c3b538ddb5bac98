"""Friction between the string and the wall of its hole, while it moves and while it sticks."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from cosserat_fenicsx.checks import refuse, store
from cosserat_fenicsx.parts import Friction, Kind, Number, Part, Rate, positive


@dataclass(frozen=True)
class WallFriction(Part):
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

    static: Friction
    kinetic: Friction | None = None
    speed: Annotated[float, Kind()] | None = None
    of_rotation: bool = False
    of_hole: bool = False

    def validate(self):
        """See `Part`."""
        if self.kinetic is None:
            store(self, kinetic=self.static)
        if self.static < self.kinetic:
            refuse(self, "static", self.static, f"at least the kinetic one, {self.kinetic:g}")
        if self.speed is not None:
            kind = Number("angular velocity" if self.of_rotation else "speed", positive())
            store(self, speed=kind.check(self, "speed", self.speed))

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
class ViscousDrag(Part):
    """Drag of the mud along the string: a torque per length rate rho J om, a force per length rate rho A v.

    Args:
        torsion, axial: rates, 1/s; in the lowest modes waves decay like exp(-rate t/2).

    Raises:
        SceneError: negative rates.
    """

    torsion: Rate = 0.0
    axial: Rate = 0.0
