"""Laws between bit and rock.

`BitLaw` is the family, and its base class the interface. `Stribeck`: a torque that falls with the speed, set-valued at
rest. `Cutting`: a drag bit that cuts. `Lobes`: a roller-cone bit on rock with a wavy face. `EndCondition` is the
interface of laws with a memory to the model by elements; `CuttingEnd` and `LobedEnd` implement it.

The rock below a drag bit: n equal blades follow each other at angles of 2 pi/n. All move alike, so one function is
enough: S(Phi), the depth of the rock that the first blade leaves at its angle Phi. A blade at the depth U and the angle
Phi meets the rock that the one before it left at Phi - 2 pi/n. Its depth of cut is

    d = U - S(Phi - 2 pi/n),        S(Phi) = max(U, S(Phi - 2 pi/n)).

Where the bit never leaves the rock, S = U, and d = U(t) - U(t - tau) with the delay tau that Richard, Germay &
Detournay define by Phi(t) - Phi(t - tau) = 2 pi/n (J. Sound Vib. 305 (2007) 432, doi:10.1016/j.jsv.2007.04.015). Where
it has left the rock, the older surface remains, however many blades pass over it.

In a step from t to t + h the depth of cut is taken at the middle, d = u + h/2 w - S, with S at the angle predicted for
it and the unknown mean velocity w. The weight on bit n zeta epsilon a d is linear in w. The torque n epsilon a^2 d/2,
at the predicted w, acts against the rotation, and holds a bit at rest up to that size. Where d would be negative the
bit is above the rock, and free. Wear flats bear all or nothing as the bit moves down or up, and anything between at
rest.

The face of the rock below a bit on lobes is at u = -amplitude sin(count Phi), downwards positive, with the angle Phi
since the start predicted for the end of the step. The rock is rigid or a spring; it pushes and does not pull.
"""

import math
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np

from cosserat_fenicsx.checks import doubt_width, refuse, warn
from cosserat_fenicsx.drilling.laws import Resistance, by_method, checked, hashable, surface_of, tabulated
from cosserat_fenicsx.drilling.signals import ScalarSignal, doubt_decay
from cosserat_fenicsx.parts import (
    AngularVelocity,
    ForceSize,
    Inertia,
    InTime,
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

# Weights on bit up to this many static ones are tabulated.
_TABULATED = 4.0
# Static penetration (m) above which the rock stiffness is probably given in other units.
_DEEP = 0.1
# Shortest rotation (rad) that adds a point to the surface of the rock.
_SHORTEST_TURN = 1e-9
# A bit below this share of its mean speed in a step nearly stops.
_SLOWING = 0.3


class BitLaw(Part, family="bit law"):
    """Base of the laws between bit and rock.

    A law of friction of your own is a frozen dataclass with a method `torque(speed, weight)`: the torque (N m) against
    a rotation of the bit at a speed from 0 on (rad/s), at 0 the largest one that holds it at rest, under a weight on
    bit (N).

    Attributes:
        needs_weight: whether the torque follows the weight on bit: `BitOnRock` then asks for one, and `torque` gets the
            present one; other laws get NaN.
        drills: whether the bit drills by its weight, so that its torque follows from the axial motion.
        lifts: why the law asks for axial motion, a few words; "" where it does not.
        repeats: (how many a revolution, of what), such as (3, "lobes"); None for a bit that is the same all around.
        axial_stiffness: weight on bit per depth of cut, N/m; infinite of a bit that does not cut.
    """

    needs_weight, drills, lifts, repeats, axial_stiffness = False, False, "", None, math.inf

    def torque(self, speed: float, weight: float) -> float:
        """N m at a speed (rad/s) and weight on bit (N)."""
        raise NotImplementedError(f"{type(self).__name__}.torque(speed, weight) is missing")

    def resistance(self, weight: float | None) -> Resistance | None:
        """The torque against the rotation under a weight on bit (N), or None where it does not follow from that alone.

        Raises:
            SceneError: `torque` fails, or its values are no numbers from 0 on.
        """
        return by_method(self, "torque", weight if self.needs_weight else math.nan)

    def in_c(self, weight: float | None):
        """(function, surface) for C where `resistance` has a function, under a static weight on bit (N): the torque as
        a function of speed and weight, which C calls, and its `Surface`, which C takes in its place; (None, None) for
        a smooth torque of the speed alone, which is tabulated."""
        surface = None
        if not self.needs_weight:
            if tabulated(self.resistance(None)) is not None:
                return None, None
        elif weight and hashable(self):
            surface = surface_of(self, "torque", _TABULATED * weight)
        return lambda speed, weight: checked(self, "torque", weight if self.needs_weight else math.nan)(speed), surface

    def end(self, weight: float, place: np.ndarray, motion: np.ndarray) -> "EndCondition | None":
        """The memory of the law in a motion by elements, None where it has none.

        Args:
            weight: static weight on bit, N. place: (2,) of the bit at the start, m downwards and rad. motion: (2,)
                velocities of steady drilling at the start, m/s and rad/s; zeros at rest.
        """

    def steady_forces(self, weight: float, motion: np.ndarray) -> np.ndarray:
        """(2,) weight (N) and torque (N m) on bit in steady motion: (2,) m/s downwards and rad/s."""
        law = self.resistance(weight)
        return np.array([weight, 0.0 if law is None else float(law(motion[1]))])


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
        if self.static < self.dynamic:
            refuse(self, "static", self.static, f"at least the dynamic one, {self.dynamic:g}")
        if self.radius is not None:
            doubt_width(self, "radius")
        doubt_decay(self, self.speed)

    def __post_init__(self):
        for name in ("static", "dynamic") if self.radius is not None else ():
            if isinstance(given := getattr(self, name), str):
                refuse(self, name, given, "a coefficient of friction, a number without a unit, beside a radius; a "
                       "torque (N m) has no radius beside it")  # fmt: skip
        super().__post_init__()

    @property
    def needs_weight(self) -> bool:
        return self.radius is not None

    def in_words(self, units):
        if self.radius is None:
            return super().in_words(units)
        speed = f", speed {units.told(self.speed, 'rad/s')}" if self.speed else ""
        radius = units.told(self.radius, "m", "diameter", ".5g")
        return f"Stribeck(static {self.static:g}, dynamic {self.dynamic:g}{speed}, radius {radius})"

    def torque(self, speed: float, weight: float) -> float:
        law = self.resistance(weight)
        return float(law(speed)) if speed > 0 else law.still

    def resistance(self, weight: float | None) -> Resistance:
        factor = 1.0 if self.radius is None else weight * self.radius
        return Resistance(self.static * factor, self.dynamic * factor, self.speed or 0.0)


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
    cuts; backwards the blades slide over the rock, and the string does not drill.

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

    drills, lifts = True, "the torque on bit follows the depth of cut"

    @property
    def repeats(self) -> tuple[int, str]:
        return self.blades, "blades"

    def resistance(self, weight):
        return None

    def end(self, weight, place, motion):
        return CuttingEnd(self, weight, place, motion)

    def steady_forces(self, weight, motion):
        return np.array(CuttingEnd(self, 0.0, np.zeros(2), motion).steady_forces(*motion))

    def rate(self, weight: float, turning: float) -> float:
        """Rate of penetration (m/s) under a weight on bit (N), at a speed of rotation (rad/s).

        Raises:
            SceneError: a weight that the wear flats bear.
        """
        if weight <= self.idle:
            refuse("BitOnRock", "weight", weight, f"more than the wear flats carry, {self.idle:.6g} N")
        return (weight - self.idle) / self.axial_stiffness * self.blades * turning / (2 * math.pi)

    @property
    def idle(self) -> float:
        """Weight that the wear flats bear while the bit moves down, N."""
        return self.a * self.wear.length * self.wear.stress if self.wear else 0.0

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
        law: torque on bit, a `Stribeck` or another law of the torque alone, or None.

    Raises:
        SceneError: numbers that are not positive.
    """

    count: Annotated[int, Number(limits=at_least(1, "a number of lobes"), whole=True)]
    amplitude: Length
    law: Stribeck | BitLaw | None = None

    lifts = "the lobes of the rock lift the bit"

    def validate(self):
        if self.law is not None and self.law.lifts:
            refuse(self, "law", self.law, "a law of the torque alone, such as Stribeck(...), or None")

    @property
    def needs_weight(self) -> bool:
        return self.law is not None and self.law.needs_weight

    @property
    def repeats(self) -> tuple[int, str]:
        return self.count, "lobes"

    def resistance(self, weight):
        return self.law and self.law.resistance(weight)

    def in_c(self, weight):
        return self.law.in_c(weight) if self.law else (None, None)

    def end(self, weight, place, motion):
        return LobedEnd(self, place[1], motion[1])


@dataclass(frozen=True)
class BitOnRock(Part):
    """The bit at work, at the lower end of the string.

    Args:
        law: `Stribeck(...)`, `Cutting(...)`, `Lobes(...)`, or another `BitLaw`.
        weight: static weight on bit, N. None where the law needs none, or where the speed of drilling decides it. It
            may be a function of time, such as a `Ramp` or a `Table`, in motions of torsion alone and for a law that
            follows it; along the axis the motion of the block decides.
        inertia: of the bit beyond the string's sections, kg m^2.
        mass: the same for axial motion, kg.
        rock_stiffness: of the rock below a bit with a weight, N/m: weight on bit per depth by which the bit presses
            into the rock, which pushes it back but does not pull. Infinite for rigid rock, where a bit that comes down
            is stopped by an impulse and not by a force. Energy stored in the rock counts as lost at the bit until it is
            returned. `Cutting` has the depth of cut in the place of this stiffness.

    Raises:
        SceneError: an unknown law, a weight that is missing, or a negative number; a stiffness of rock beside
            `Cutting`, or without a weight; a weight over time for a law that does not follow it.
    """

    law: BitLaw
    weight: InTime[Annotated[ForceSize, at_least(0, "a weight on bit")]] | None = None
    inertia: Inertia = 0.0
    mass: Mass = 0.0
    rock_stiffness: Stiffness = math.inf

    def validate(self):
        if self.law.drills and self.rock_stiffness < math.inf:
            name = type(self.law).__name__
            refuse(self, "rock_stiffness", self.rock_stiffness, f"infinity: {name} has a depth of cut in its place")
        if self.weight is None and self.rock_stiffness < math.inf:
            refuse(self, "weight", None, "the weight on bit (N), where the rock has a stiffness")
        if self.varies:
            if not self.law.needs_weight or self.law.lifts or self.rock_stiffness < math.inf:
                refuse(self, "weight", self.weight, "a number (N): over time it acts where the torque alone follows "
                       "it, as that of Stribeck(..., radius=) and TableLaw(..., weights=)")  # fmt: skip
            signal = self.signal()
            for t in (0.0, *signal.jumps):
                if not signal(t) >= 0:
                    refuse(self, "weight", signal(t), f"a weight on bit that is not negative (N), at t = {t:g} s")
            if not self.most > 0:
                refuse(self, "weight", self.weight, "a weight on bit above 0 (N) at some time, or None for a bit off "
                       "the rock")  # fmt: skip
        elif self.weight is not None:
            if self.weight == 0:
                refuse(self, "weight", 0.0, "a weight on bit above 0 (N), or None for a bit off the rock")
            pressed = self.weight / self.rock_stiffness
            if pressed > _DEEP:
                warn(
                    f"BitOnRock.rock_stiffness = {self.rock_stiffness:g} N/m: {self.weight:g} N press the bit by "
                    f"{pressed:g} m into the rock; 60 kN/mm are 60e6"
                )
        elif self.law.needs_weight or (self.law.lifts and not self.law.drills):
            refuse(self, "weight", None, "the weight on bit (N), which the law needs")

    @property
    def varies(self) -> bool:
        """Whether the weight on bit is a function of time."""
        return callable(self.weight)

    def signal(self) -> ScalarSignal:
        """The weight on bit at every time, N."""
        return ScalarSignal(self, "weight", self.weight or 0.0, "N")

    @property
    def resting(self) -> float | None:
        """The static weight on bit at the start, N, or None."""
        return self.signal()(0.0) if self.varies else self.weight

    @cached_property
    def most(self) -> float | None:
        """The largest static weight on bit, see `ScalarSignal.largest`, N, or None."""
        return self.signal().largest if self.varies else self.weight


class EndForce(NamedTuple):
    """The force of the rock on the bit in a step: a linear part and set-valued ones.

    Attributes:
        force: (2,) weight on bit (N) and torque on bit (N m) of a bit at rest.
        tangent: (2, 2) their derivatives by the mean velocities of the step, downwards (m/s) and of rotation (rad/s).
        torque: N m, against the rotation, and anything up to it at rest; None for the bit's own law of friction.
        flats: N, half of what wear flats bear: their force is flats above the given one where the bit moves down, flats
            below it where it moves up, and anything between at rest.
        rock: None, or place (m below the start) and velocity (m/s, downwards) of the face of a rigid rock at the end of
            the step.
    """

    force: np.ndarray
    tangent: np.ndarray
    torque: float | None = 0.0
    flats: float = 0.0
    rock: tuple[float, float] | None = None


class EndCondition:
    """The force of the rock on the bit, given at the begin of every step.

    A step that does not converge is done in halves with the same numbers. The model calls `memory` and `recall` with
    its own.
    """

    def begin(self, model, h: float) -> EndForce:
        """The force in the coming step of the length h (s), from the state of the model at its begin."""
        raise NotImplementedError

    def commit(self, model, h: float) -> None:
        """Accept the step: called once at its end."""

    def memory(self) -> dict[str, Any]:
        """All that later steps depend on."""
        raise NotImplementedError

    def recall(self, memory: dict[str, Any]) -> None:
        """Restore the result of `memory`."""
        raise NotImplementedError


class RockSurface:
    """S(Phi) at the places where steps ended, between them by cubic Hermite interpolation.

    Args:
        blades: n. angle, depth: of the bit at the start, rad and m.
        slope: initial dS/dPhi, m/rad: advance over rotation of steady drilling, or 0 for a flat face.
        cut: depth of cut at the start, m; 2 pi slope/n in steady drilling.
    """

    def __init__(self, blades: int, angle: float = 0.0, depth: float = 0.0, slope: float = 0.0, cut: float = 0.0):
        self.pitch = 2 * math.pi / blades
        behind = depth - cut
        self._angles = [angle - self.pitch, angle]
        self._depths = [behind, behind + slope * self.pitch]
        self._slopes = [slope, slope]
        self._first = 0  # earlier places are no longer met

    def under(self, angle: float) -> tuple[float, float]:
        """Depth (m) of the rock that a blade meets at an angle of the bit (rad), and its slope (m/rad)."""
        return self._at(angle - self.pitch)

    def _at(self, place):
        angles, depths, slopes = self._angles, self._depths, self._slopes
        if place <= angles[0]:
            return depths[0] + slopes[0] * (place - angles[0]), slopes[0]
        if place >= angles[-1]:
            return depths[-1] + slopes[-1] * (place - angles[-1]), slopes[-1]
        i = bisect_right(angles, place, self._first if angles[self._first] <= place else 0) - 1
        width = angles[i + 1] - angles[i]
        x = (place - angles[i]) / width
        rise, left, right = depths[i + 1] - depths[i], slopes[i] * width, slopes[i + 1] * width
        # the cubic with these values and slopes at both ends
        c2, c3 = 3 * rise - 2 * left - right, left + right - 2 * rise
        return depths[i] + x * (left + x * (c2 + x * c3)), (left + x * (2 * c2 + 3 * x * c3)) / width

    def pass_over(self, angle: float, depth: float, slope: float) -> float:
        """Move a blade to an angle (rad) and depth (m), at a slope (m/rad, rate of penetration over speed of rotation):
        the rock behind it is cut. Returns the depth of cut there (m), negative above the rock."""
        old, old_slope = self.under(angle)
        cuts = depth >= old
        if angle > self._angles[-1] + _SHORTEST_TURN:
            self._angles.append(angle)
            self._depths.append(depth if cuts else old)
            self._slopes.append(slope if cuts else old_slope)
            while self._angles[self._first + 1] < angle - self.pitch:
                self._first += 1
            if self._first > 4096:  # forget rock that no blade meets any more, now and then
                for kept in (self._angles, self._depths, self._slopes):
                    del kept[: self._first]
                self._first = 0
        return depth - old

    def memory(self) -> dict:
        """The surface, as arrays."""
        arrays = {name: np.array(getattr(self, f"_{name}")) for name in ("angles", "depths", "slopes")}
        return arrays | {"first": self._first}

    def recall(self, memory: dict) -> None:
        """Restore the result of `memory`."""
        self._angles, self._depths, self._slopes = (memory[name].tolist() for name in ("angles", "depths", "slopes"))
        self._first = int(memory["first"])


class CuttingEnd(EndCondition):
    """The `EndCondition` of `Cutting`; see `BitLaw.end`. A weight of 0 stands for a bit that just touches."""

    def __init__(self, law: Cutting, weight: float, place: np.ndarray, motion: np.ndarray):
        self.law, wear = law, law.wear
        self._flats = law.idle
        self._rubbing = 0.0 if wear is None else wear.geometry * wear.friction * law.a / 2
        rate, turning = float(motion[0]), float(motion[1])
        slope = max(rate, 0.0) / turning if turning > 0 else 0.0  # a bit that is pulled up leaves no rock
        cut = 2 * math.pi / law.blades * slope
        if turning <= 0:
            cut = max(weight - self._flats, 0.0) / law.axial_stiffness
        self.rock = RockSurface(law.blades, float(place[1]), float(place[0]), slope, cut)
        # Mean velocities of the last step and of the one before. Velocities at the ends of steps alternate where a
        # short lowest element vibrates faster than steps resolve, and so would the rock, and the depth of cut.
        self._mean = self._before = np.array(motion, dtype=float)
        self._bears = (
            self._flats if rate > 0 else min(weight, self._flats)
        )  # force of the wear flats during the last step

    def steady_forces(self, rate: float, speed: float) -> tuple[float, float]:
        """Weight (N) and torque (N m) on bit at a steady rate of penetration (m/s) and speed (rad/s)."""
        cut = 2 * math.pi / self.law.blades * max(rate, 0.0) / speed
        flats = self._flats if rate > 0 else 0.0
        return self.law.axial_stiffness * cut + flats, self.law.torsional_stiffness * cut + self._rubbing * flats

    def begin(self, model, h: float) -> EndForce:
        self._at, _ = model.bit_state()
        w = 2 * self._mean - self._before
        rock, _ = self.rock.under(self._at[1] + h / 2 * w[1])
        self._gap = self._at[0] - rock
        cut = self._gap + h / 2 * w[0]
        if cut <= 0:
            return EndForce(np.zeros(2), np.zeros((2, 2)))
        stiffness = self.law.axial_stiffness
        force = np.array([stiffness * self._gap + self._flats / 2, 0.0])
        tangent = np.array([[stiffness * h / 2, 0.0], [0.0, 0.0]])
        torque = self.law.torsional_stiffness * cut + self._rubbing * self._bears
        return EndForce(force, tangent, torque, self._flats / 2)

    def commit(self, model, h: float) -> None:
        (u, angle), _ = model.bit_state()
        moved, turned = u - self._at[0], angle - self._at[1]
        self._before, self._mean = self._mean, np.array([moved, turned]) / h
        v, turning = (3 * self._mean - self._before) / 2  # at the end of the step
        borne = model.weight_on_bit - self.law.axial_stiffness * max(self._gap + moved / 2, 0.0)
        self._bears = min(max(borne, 0.0), self._flats)
        if turned > 0:
            # where the bit nearly stops, its velocities tell nothing about the slope of the rock
            slope = v / turning if turning * h > _SLOWING * turned else moved / turned
            self.rock.pass_over(float(angle), float(u), float(slope))

    def memory(self) -> dict:
        return {"rock": self.rock.memory(), "means": np.array([self._mean, self._before]), "bears": self._bears}

    def recall(self, memory: dict) -> None:
        self.rock.recall(memory["rock"])
        (self._mean, self._before), self._bears = memory["means"].copy(), float(memory["bears"])


class LobedEnd(EndCondition):
    """The `EndCondition` of `Lobes`: the angle (rad) and the rotation (rad/s) of the bit at the start."""

    def __init__(self, law: Lobes, angle: float, turning: float):
        self.law, self._start, self._before = law, float(angle), float(turning)

    def begin(self, model, h: float) -> EndForce:
        (_, angle), (_, turning) = model.bit_state()
        faster, self._before = turning - self._before, float(turning)
        phase = self.law.count * (angle - self._start + h * (turning + faster / 2))
        face = -self.law.amplitude * math.sin(phase)
        moving = -self.law.amplitude * self.law.count * (turning + faster) * math.cos(phase)
        return EndForce(np.zeros(2), np.zeros((2, 2)), torque=None, rock=(face, moving))

    def memory(self):
        return {"before": self._before}

    def recall(self, memory: dict) -> None:
        self._before = float(memory["before"])
