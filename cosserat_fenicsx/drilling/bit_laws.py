"""What acts between bit and rock.

`Stribeck`: a torque that falls with the speed, set-valued at rest. `Cutting`: the depth of cut of Richard, Germay &
Detournay, J. Sound Vib. 305 (2007) 432, doi:10.1016/j.jsv.2007.04.015, with the delay of the part of a revolution from
blade to blade. `Lobes`: a rock whose face is wavy.
"""

import math
from dataclasses import dataclass
from typing import Annotated

from cosserat_fenicsx.checks import refuse, warn
from cosserat_fenicsx.parts import (
    AngularVelocity,
    ForceSize,
    Inertia,
    Length,
    Mass,
    Number,
    Part,
    Pressure,
    Ratio,
    Stiffness,
    Torque,
    at_least,
    positive,
)

# Depths (m) beyond this to which a weight presses a bit are those of a stiffness in other units by all appearance.
_DEEP = 0.1


class BitLaw(Part, family="bit law"):
    """Base of the laws of what acts between bit and rock."""


@dataclass(frozen=True)
class Stribeck(BitLaw):
    """Torque on bit T = T_d + (T_s - T_d) exp(-om/speed) against the rotation om, anything up to T_s at rest.

    Args:
        static, dynamic: T_s and T_d, N m; with a `radius` coefficients of friction: then the torque is coefficient
            times weight on bit times radius.
        speed: decay of the static part, rad/s; None where static and dynamic are the same, or for a torque that drops
            to the dynamic one at once (Coulomb).
        radius: m, see above.

    Raises:
        SceneError: numbers that are negative, a static torque below the dynamic one.
    """

    static: Annotated[Torque, at_least(0)]
    dynamic: Annotated[Torque, at_least(0)]
    speed: Annotated[AngularVelocity, positive()] | None = None
    radius: Length | None = None

    def validate(self):
        """See `Part`."""
        if self.static < self.dynamic:
            refuse(self, "static", self.static, f"at least the dynamic one, {self.dynamic:g}")

    def torques(self, weight: float) -> tuple[float, float]:
        """Static and dynamic torque (N m) under a weight on bit (N)."""
        factor = 1.0 if self.radius is None else weight * self.radius
        return self.static * factor, self.dynamic * factor


@dataclass(frozen=True)
class Wear(Part):
    """Wear flats of a bit: they rub while the bit is pressed on the rock.

    Args:
        stress: contact stress below the flats, Pa. length: of the flats of all blades together, m.
        friction: coefficient. geometry: gamma, which distributes the flats over the radius; 1 is uniform.

    Raises:
        SceneError: numbers that are not positive.
    """

    stress: Pressure
    length: Length
    friction: Ratio
    geometry: Ratio = 1.0


@dataclass(frozen=True)
class Cutting(BitLaw):
    """A drag bit that cuts: weight n zeta epsilon a d and torque n epsilon a^2 d/2 for the depth of cut d of a blade.

    d = U(t) - U(t - tau), U the depth of the bit; within the delay tau the bit turns by 2 pi/n. Wear flats add the
    weight a l sigma and the torque gamma mu a/2 times that weight. Rotation of a positive sign
    cuts; backwards the blades slide over rock that stays, so that a string that is turned so does not drill.

    Args:
        a: radius of the bit, m. epsilon: intrinsic specific energy, Pa. zeta: ratio of vertical to horizontal force.
        blades: n. wear: a `Wear`, or None for a sharp bit.

    Raises:
        SceneError: numbers that are not positive.
    """

    a: Length
    epsilon: Pressure
    zeta: Ratio
    blades: Annotated[int, Number(limits=at_least(1, "a number of blades"), whole=True)]
    wear: Wear | None = None

    @property
    def axial_stiffness(self) -> float:
        """Weight on bit per depth of cut of a blade, n zeta epsilon a, N/m."""
        return self.blades * self.zeta * self.epsilon * self.a

    @property
    def torsional_stiffness(self) -> float:
        """Torque on bit per depth of cut of a blade, n epsilon a^2/2, N."""
        return self.blades * self.epsilon * self.a**2 / 2


@dataclass(frozen=True)
class Lobes(BitLaw):
    """A face of the rock that lifts a roller-cone bit: by amplitude sin(count theta), theta the angle by which the bit
    has turned since the start.

    Args:
        count: lobes in a revolution; three for tricone bits. amplitude: m.
        law: torque on bit, a `Stribeck`, or None.

    Raises:
        SceneError: numbers that are not positive.
    """

    count: Annotated[int, Number(limits=at_least(1, "a number of lobes"), whole=True)]
    amplitude: Length
    law: Stribeck | None = None


@dataclass(frozen=True)
class BitOnRock(Part):
    """The bit at work, at the lower end of the string.

    Args:
        law: `Stribeck(...)`, `Cutting(...)` or `Lobes(...)`.
        weight: static weight on bit, N. None where the law needs none, or where the speed of drilling decides it.
        inertia: of the bit and what turns with it beyond the string's sections, kg m^2.
        mass: the same for axial motion, kg.
        rock_stiffness: of the rock below a bit with a weight, N/m: weight on bit per depth by which the bit presses
            into the rock, which pushes it back but does not pull. Infinite for rigid rock, where a bit that comes down
            is stopped by an impulse and not by a force. What the rock stores counts as lost at the bit until it gives
            it back. `Cutting` has the depth of cut in the place of this stiffness.

    Raises:
        SceneError: an unknown law, a weight that is missing, or a negative number; a stiffness of rock beside
            `Cutting`, or without a weight.
    """

    law: BitLaw
    weight: Annotated[ForceSize, positive()] | None = None
    inertia: Inertia = 0.0
    mass: Mass = 0.0
    rock_stiffness: Stiffness = math.inf

    def validate(self):
        """See `Part`."""
        if isinstance(self.law, Cutting) and self.rock_stiffness < math.inf:
            refuse(self, "rock_stiffness", self.rock_stiffness, "infinity: Cutting has a depth of cut in its place")
        if self.weight is None and self.rock_stiffness < math.inf:
            refuse(self, "weight", None, "the weight on bit (N), where the rock has a stiffness")
        if self.weight is not None:
            pressed = self.weight / self.rock_stiffness
            if pressed > _DEEP:
                warn(
                    f"BitOnRock.rock_stiffness = {self.rock_stiffness:g} N/m: {self.weight:g} N press the bit by "
                    f"{pressed:g} m into the rock; 60 kN/mm are 60e6"
                )
        elif isinstance(self.law, Lobes) or getattr(self.law, "radius", None) is not None:
            refuse(self, "weight", None, "the weight on bit (N), which the law needs")
