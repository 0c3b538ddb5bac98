"""The lower end of a string where more than friction acts: bits that cut, and rock with lobes.

`EndCondition` is the protocol, `CuttingEnd` and `LobedEnd` fulfil it.

The rock below a drag bit: how deep it is cut at every angle, which the next blade meets. n equal blades follow each
other at angles of 2 pi/n. All move alike, so one function is enough: S(Phi), the depth of the rock left behind at the
angle Phi of the first blade. A blade at the depth U and the angle Phi meets the rock that the one before it left at Phi
- 2 pi/n: its depth of cut is

    d = U - S(Phi - 2 pi/n),        S(Phi) = max(U, S(Phi - 2 pi/n)).

Where the bit never leaves the rock, S = U, and d = U(t) - U(t - tau) with the delay tau that Richard, Germay &
Detournay define by Phi(t) - Phi(t - tau) = 2 pi/n (J. Sound Vib. 305 (2007) 432, doi:10.1016/j.jsv.2007.04.015). Where
it has left the rock, the older surface remains, however many blades pass over it.

A drag bit that cuts. The law of Richard, Germay & Detournay, see `bit_laws.Cutting` and `RockSurface`. In a step from t
to t + h the depth of cut is that at its middle,

    d = u + h/2 w - S,    S = S(Phi - 2 pi/n) at the angle Phi that the bit is expected to have there,

with the unknown mean velocity w. The weight on bit n zeta epsilon a d is linear in it. The torque n epsilon a^2 d/2,
with the velocity that is expected for w, acts against the rotation, and holds a bit at rest up to that size. Where d
would be negative the bit is above the rock, and free. Wear flats bear all or nothing as the bit moves down or up, and
anything between at rest.

A roller-cone bit on a rock with lobes: the rock lifts the bit as it turns. The rock is rigid or a spring; it pushes and
does not pull. Its face below the bit is at u = -amplitude sin(count Phi), downwards positive, at the angle Phi by which
the bit is expected to have turned since the start at the end of the step.
"""

import math
from bisect import bisect_right
from typing import Any, NamedTuple, Protocol

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.bit_laws import Cutting, Lobes
from cosserat_fenicsx.drilling.single_valued import stribeck_of


class EndForce(NamedTuple):
    """What the rock does to the bit in a step: a linear part and set-valued ones.

    Attributes:
        force: (2,) weight on bit (N) and torque on bit (N m) of a bit at rest.
        tangent: (2, 2) their derivatives by the mean velocities of the step, downwards (m/s) and of rotation (rad/s).
        torque: N m, against the rotation, and anything up to that at rest; None for that of the bit's Stribeck law.
        flats: N, half of what wear flats bear: their force is flats above the given one where the bit moves down, flats
            below it where it moves up, and anything between at rest.
        rock: None, or place (m below that at the start) and velocity (m/s, downwards), at the end of the step, of the
            face of a rigid rock, which pushes but does not pull.
    """

    force: np.ndarray
    tangent: np.ndarray
    torque: float | None = 0.0
    flats: float = 0.0
    rock: tuple[float, float] | None = None


class EndCondition(Protocol):
    """The force of the rock on the bit, told at the begin of every step.

    A step that does not converge is done in halves with the same numbers. The model calls `memory` and `recall` with
    its own.
    """

    def begin(self, model, h: float) -> EndForce:
        """The force in the coming step of the length h (s), from the state of the model at its begin."""

    def commit(self, model, h: float) -> None:
        """The step has been done."""

    def memory(self) -> dict[str, Any]:
        """All that later steps depend on."""

    def recall(self, memory: dict[str, Any]) -> None:
        """Restore what `memory` returned."""


_SHORTEST = 1e-9  # rad; shorter rotations add no place to the surface


class RockSurface:
    """S(Phi) at the places where steps ended, between them by cubic Hermite interpolation.

    Args:
        blades: n. angle, depth: of the bit at the start, rad and m.
        slope: dS/dPhi of the rock that is there before the bit has turned, m/rad: advance over rotation of steady
            drilling, or 0 for a flat face.
        cut: depth of cut at the start, m: that of steady drilling is 2 pi slope/n.
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
        """Leave the rock that a blade leaves which has come to an angle (rad) and depth (m), and return its depth of
        cut there (m), negative above the rock.

        Args:
            slope: rate of penetration over speed of rotation there, m/rad.
        """
        old, old_slope = self.under(angle)
        cuts = depth >= old
        if angle > self._angles[-1] + _SHORTEST:
            self._angles.append(angle)
            self._depths.append(depth if cuts else old)
            self._slopes.append(slope if cuts else old_slope)
            while self._angles[self._first + 1] < angle - self.pitch:
                self._first += 1
            if self._first > 4096:  # forget what no blade meets any more, now and then
                for kept in (self._angles, self._depths, self._slopes):
                    del kept[: self._first]
                self._first = 0
        return depth - old

    def memory(self) -> dict:
        """Everything, as arrays."""
        return {
            "angles": np.array(self._angles), "depths": np.array(self._depths), "slopes": np.array(self._slopes),
            "first": self._first,
        }  # fmt: skip

    def recall(self, memory: dict) -> None:
        """Restore what `memory` returned."""
        self._angles, self._depths, self._slopes = (memory[name].tolist() for name in ("angles", "depths", "slopes"))
        self._first = int(memory["first"])


_SLOWING = 0.3  # of the mean speed in a step


class CuttingEnd:
    """An `EndCondition`.

    Args:
        law: a `Cutting`. weight: static weight on bit, N, that the string starts with; 0 for a bit that just touches.
        place: (2,) of the bit at the start, m downwards and rad. motion: (2,) its velocities there, m/s and rad/s, of
            steady drilling; zeros at rest.
    """

    def __init__(self, law: Cutting, weight: float, place: np.ndarray, motion: np.ndarray):
        self.law, wear = law, law.wear
        self._flats = 0.0 if wear is None else law.a * wear.length * wear.stress
        self._rubbing = 0.0 if wear is None else wear.geometry * wear.friction * law.a / 2
        rate, turning = float(motion[0]), float(motion[1])
        slope = max(rate, 0.0) / turning if turning > 0 else 0.0  # a bit that is pulled up leaves no rock
        cut = 2 * math.pi / law.blades * slope
        if turning <= 0:
            cut = max(weight - self._flats, 0.0) / law.axial_stiffness
        self.rock = RockSurface(law.blades, float(place[1]), float(place[0]), slope, cut)
        self._before = np.array(motion, dtype=float)  # velocities at the start of the last step
        self._bears = self._flats if rate > 0 else min(weight, self._flats)  # what the wear flats bore in it

    def steady_forces(self, rate: float, speed: float) -> tuple[float, float]:
        """Weight (N) and torque (N m) on bit at a steady rate of penetration (m/s) and speed (rad/s)."""
        cut = 2 * math.pi / self.law.blades * max(rate, 0.0) / speed
        flats = self._flats if rate > 0 else 0.0
        return self.law.axial_stiffness * cut + flats, self.law.torsional_stiffness * cut + self._rubbing * flats

    def begin(self, model, h: float) -> EndForce:
        """See `EndCondition`."""
        self._at, velocity = model.bit_state()
        w = velocity + (velocity - self._before) / 2
        self._before = velocity
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
        """See `EndCondition`."""
        (u, angle), (v, turning) = model.bit_state()
        moved, turned = u - self._at[0], angle - self._at[1]
        borne = model.weight_on_bit - self.law.axial_stiffness * max(self._gap + moved / 2, 0.0)
        self._bears = min(max(borne, 0.0), self._flats)
        if turned > 0:
            # where the bit nearly stops, its velocities tell nothing about the slope of the rock
            slope = v / turning if turning * h > _SLOWING * turned else moved / turned
            self.rock.pass_over(float(angle), float(u), float(slope))

    def memory(self) -> dict:
        """See `EndCondition`."""
        return {"rock": self.rock.memory(), "before": self._before.copy(), "bears": self._bears}

    def recall(self, memory: dict) -> None:
        """See `EndCondition`."""
        self.rock.recall(memory["rock"])
        self._before, self._bears = memory["before"].copy(), float(memory["bears"])


class LobedEnd:
    """An `EndCondition` for `Lobes`.

    Args:
        law: `Lobes`. angle, turning: of the bit at the start, rad and rad/s.
    """

    def __init__(self, law: Lobes, angle: float = 0.0, turning: float = 0.0):
        self.law, self._start, self._before = law, float(angle), float(turning)

    def begin(self, model, h: float) -> EndForce:
        """See `EndCondition`."""
        (_, angle), (_, turning) = model.bit_state()
        faster, self._before = turning - self._before, float(turning)
        phase = self.law.count * (angle - self._start + h * (turning + faster / 2))
        face = -self.law.amplitude * math.sin(phase)
        moving = -self.law.amplitude * self.law.count * (turning + faster) * math.cos(phase)
        return EndForce(np.zeros(2), np.zeros((2, 2)), torque=None, rock=(face, moving))

    def commit(self, model, h: float) -> None:
        """See `EndCondition`."""

    def memory(self) -> dict:
        """See `EndCondition`."""
        return {"before": self._before}

    def recall(self, memory: dict) -> None:
        """See `EndCondition`."""
        self._before = float(memory["before"])


def end_of(bit, place, motion, axial):
    """An `EndCondition`, or None.

    Args:
        bit: a `BitOnRock` or None. place: of the bit at the start, m and rad; motion: (2,) its velocities there.
        axial: whether the model has axial motion.

    Raises:
        SceneError: a bit that cuts, without axial motion.
    """
    law = None if bit is None else bit.law
    if isinstance(law, Cutting):
        if not axial:
            refuse("BitOnRock", "law", law, "a Stribeck, for torsion alone: the torque of Cutting follows the depth of "
                   "cut; model='axial and torsional'")  # fmt: skip
        return CuttingEnd(law, bit.weight or 0.0, place, motion)
    return LobedEnd(law, place[1], motion[1]) if isinstance(law, Lobes) and axial else None


def forces_of(bit, motion):
    """(2,) weight (N) and torque (N m) on bit in steady motion: (2,) m/s downwards and rad/s."""
    if bit is None:
        return np.zeros(2)
    if isinstance(bit.law, Cutting):
        return np.array(CuttingEnd(bit.law, 0.0, np.zeros(2), motion).steady_forces(*motion))
    weight, law = bit.weight or 0.0, stribeck_of(bit.law)
    if law is None:
        return np.array([weight, 0.0])
    still, slipping = law.torques(weight)
    falling = math.exp(-motion[1] / law.speed) if law.speed else 0.0
    return np.array([weight, slipping + (still - slipping) * falling])
