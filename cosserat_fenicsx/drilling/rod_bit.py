"""A bit at a rod's end in motions: `BitAtEnd`, by the laws of `bit_laws`, on the compliance of the moving rod.

In a step of the length h the end advances by x_a along the bit's direction and turns by x_t about the rod's axis. By
the tangent of the rods both follow from the weight on bit N and the torque T: x = x_free - C (N, T). With the mean
velocities w = x/h the law is the `EndForce` of the step, f + D w, and set-valued parts: wear flats or a spring of rock,
which pushes and does not pull, and friction, which holds the bit at rest. The linear part is eliminated first; the
others are solved exactly, one after the other, until they agree. Nothing here is a law of its own.
"""

import copy
import math
from dataclasses import dataclass

import numpy as np
import ufl

from cosserat_fenicsx.checks import instance, refuse
from cosserat_fenicsx.drilling.bit_laws import BitOnRock, EndForce
from cosserat_fenicsx.drilling.laws import Resistance
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.parts import UnitVector
from cosserat_fenicsx.scene.action import PointAction, scalar, vector
from cosserat_fenicsx.scene.rod import Station, StationOrName, is_known

# Sweeps over thrust and torque, and their relative change that ends them; iterations for a speed, and likewise.
_SWEEPS, _SAME, _ITERATIONS, _SMALL = 50, 1e-13, 100, 1e-14
# Speed (rad/s) at which a law is taken that drops at once.
_CREEP = 1e-6


@dataclass(frozen=True)
class BitAtEnd(PointAction):
    """A bit on rock at a rod's end: its weight on bit along a direction, and its torque about the rod's axis d3.

    The law is that of the `BitOnRock`, as for other models of strings: friction that sticks or slips within a step,
    blades that cut with a delay, wear flats, lobes, rock that gives way. Under a law of the torque alone, on rock that
    does not give way, the weight on bit is constant. At rest it exerts the static weight. In `simulate` alone does the
    rest act, in the spatial model. It is not multiplied by the load factor. What the bit takes from the rod is counted
    as dissipated in the energy balance; what rock of a stiffness stores too, until it gives it back.
    `history.far_end(action)` has the mean velocity, weight, rotation and torque on bit between saved states.

    Args:
        station: `rod.start` or `rod.end`; the rock lies beyond.
        bit: a `BitOnRock`. Its inertia is about the axis, kg m^2, and its mass moves with the end in all directions,
            kg; the `Damping.drag` of the rod does not act on them along the direction and about the axis.
        direction: into the rock, inertial; None for the tangent of the rod at rest.

    Raises:
        SceneError: not an end of a rod; lobes on rock that does not give way; a weight on bit over time.
    """

    station: StationOrName
    bit: BitOnRock
    direction: UnitVector | None = None

    scaled, resists = False, True
    traits = {"dead": True, "known_force": True, "rates": False, "turns": True, "flat": False}

    def validate(self):
        instance(self, "bit", self.bit, BitOnRock, "a BitOnRock")
        if is_known(self, "station", Station) and self.station.s not in (0.0, self.station.rod.length):
            refuse(self, "station", self.station, "an end of the rod, rod.start or rod.end")
        if self.bit.varies:
            refuse(self.bit, "weight", self.bit.weight, "a number (N): it does not change in motions of a rod")
        law = self.bit.law
        if law.lifts and not law.drills and math.isinf(self.bit.rock_stiffness):
            refuse(self.bit, "rock_stiffness", math.inf, f"a stiffness (N/m) below a rod: {law.lifts}, and no impulses "
                   "stop the end of a rod")  # fmt: skip

    def axis(self) -> np.ndarray:
        """(3,) the axis of the rod at rest, into the rock, inertial."""
        tangent = self.station.rod.curve.frame(self.station.s)[:, 2]
        return tangent if self.station.s > 0 else -tangent

    def down(self) -> np.ndarray:
        """(3,) the direction of the weight on bit, into the rock, inertial."""
        return self.axis() if self.direction is None else np.array(self.direction)

    #: in a motion: the thrust that acts as a load, N; the law has it all
    acting = None

    def data(self, rod, s):
        thrust = self.bit.weight or 0.0 if self.acting is None else self.acting
        return vector(self.down(), "1"), scalar(thrust, "N")

    @staticmethod
    def work(point, test, down, thrust):
        return -thrust * ufl.dot(down, test.phi_r)

    def inertia(self, rod):
        bit = self.bit
        return (bit.mass, np.array([0.0, 0.0, bit.inertia])) if bit.mass or bit.inertia else None

    def delayed(self):
        return _InMotion(self)


class _InMotion:
    """The law of a `BitAtEnd` in a motion, see `Action.delayed` and `Action.resists`, and what an `EndCondition` sees
    of a string.

    Attributes:
        down, axis: (3,) inertial, of the thrust, and of the rotation at rest. held: whether it was held along and about
            them in the last step.
    """

    longest = math.inf

    def __init__(self, action):
        bit, damping = action.bit, action.station.rod.damping
        self._bit, self.down, self.axis = bit, action.down(), action.axis()
        self._spring = bit.rock_stiffness if math.isfinite(bit.rock_stiffness) else 0.0
        # the drag of the rod acts on mass and inertia of the bit too: it is taken off
        self._drag = np.array([bit.mass, bit.inertia]) * (damping.drag if damping else 0.0)
        own = bit.law.resistance(bit.weight)
        self._fall = own.steepest if own is not None else 0.0

    def begin(self, motion):
        turning = motion.angular_velocity @ (motion.R @ self.axis)
        self._place, self._mean = np.zeros(2), np.array([motion.velocity @ self.down, turning])
        self._before, self._lengths = self._mean.copy(), (0.0, 0.0)
        steady = self._mean if self._mean[0] > 0 else np.zeros(2)
        self._end = self._bit.law.end(self._bit.weight or 0.0, self._place, steady)
        self._bears, self._face = np.array([self._bit.weight or 0.0, 0.0]), 0.0
        self.held = False, turning == 0
        self._pending = self._kept = None

    # -- what an `EndCondition` sees of a string -----------------------------------------------------------------------

    def bit_state(self):
        """(2, 2): place (m downwards, rad) and velocity at the end of the last step, by the means of two steps: a node
        that stops may swing about its mean velocity from step to step."""
        before, last = self._lengths
        slope = (self._mean - self._before) / (before + last) if last else np.zeros(2)
        return np.array([self._place, self._mean + last * slope])

    @property
    def weight_on_bit(self):
        """In the last step, N."""
        return float(self._bears[0])

    # -- a step --------------------------------------------------------------------------------------------------------

    def at(self, t):
        return {"acting": 0.0}

    def _settle(self):
        """Let the law take the last step, which is not undone any more."""
        if self._pending is not None:
            self._end, self._pending = self._pending, None
            self._end.commit(self, self._lengths[1])

    def start(self, h):
        """Begin a step of the length h (s)."""
        self._settle()
        self._h, self._step, self._next = h, None, copy.copy(self._end)
        given = EndForce(np.zeros(2), np.zeros((2, 2)), None) if self._next is None else self._next.begin(self, h)
        weight, law = self._bit.weight or 0.0, self._bit.law
        force = np.array(given.force, dtype=float)
        face, sinks = (self._face, 0.0) if given.rock is None else (given.rock[0], given.rock[0] - self._face)
        self._next_face = face
        # of a spring of rock: its force where the end stays, and its stiffness against the motion of the step
        self._rock = None
        if self._spring:
            self._rock = self._spring * (self._place[0] - face + sinks / 2) + weight, self._spring / 2
        elif not law.drills:
            force[0] += weight
        self._given, self._flats, self._tangent = force, given.flats, np.array(given.tangent, dtype=float)
        self._friction = self._of_friction(given.torque)

    def _of_friction(self, torque):
        """The `Resistance` of the step: a torque (N m), or by the law with the last weight; None without friction."""
        law, weight = self._bit.law, float(self._bears[0])
        if torque is not None:
            return Resistance(torque, torque) if torque > 0 else None
        stands = weight > 0 or not (self._spring or law.needs_weight)
        found = law.resistance(self._bit.weight) if stands else None
        if found is None or not law.needs_weight:
            return found
        if found.function is None:
            return law.resistance(weight)
        fall = self._fall * max(1.0, weight / self._bit.weight)
        return Resistance(law.torque(0.0, weight), law.torque(_CREEP, weight), 0.0,
                          lambda speed: law.torque(speed, weight), fall, found.drops)  # fmt: skip

    def forces(self, free, compliance):
        """(2,) thrust (N) and torque (N m) on the end against its motion in the step.

        Args:
            free: (2,) its motion without them, m along `down` and rad about the axis that points into the rock.
            compliance: (2, 2) by how much of it forces take off.

        Raises:
            SceneError: a torque that falls more steeply with the speed than the rod can follow.
        """
        h, linear = self._h, self._tangent - np.diag(self._drag)
        own = np.linalg.inv(np.eye(2) + compliance @ linear / h)
        x, C = own @ (free - compliance @ self._given), own @ compliance
        laws = np.zeros(2)
        for _ in range(_SWEEPS):  # what is left of a difference moves the next iteration of the step
            before = laws.copy()
            laws[0] = self._thrust(x[0] - C[0, 1] * laws[1], C[0, 0])
            laws[1], held = self._torque(x[1] - C[1, 0] * laws[0], C[1, 1])
            if (np.abs(laws - before) <= _SAME * np.abs(laws)).all():
                break
        moved = x - C @ laws
        force = self._given + linear @ moved / h + laws
        self._step = moved, force + self._drag * moved / h, (self._rock is None and abs(laws[0]) < self._flats, held)
        return force

    def _thrust(self, free, C):
        """The set-valued part of the thrust: of wear flats, or of a spring of rock."""
        if self._rock is not None:
            still, stiffness = self._rock
            return max((still + stiffness * free) / (1 + C * stiffness), 0.0)
        return min(max(free / C, -self._flats), self._flats)

    def _torque(self, free, C):
        """The torque of friction, and whether it holds the bit."""
        law, h, size = self._friction, self._h, abs(free)
        if law is None:
            return 0.0, False
        # a torque that drops at once holds by the static one only while the bit has not slipped
        drops = law.decay == 0 and law.function is None
        if size <= C * (law.still if self.held[1] or not drops else law.slipping):
            return free / C, True
        if law.steepest * C >= h:
            raise SceneError(
                f"BitOnRock.law: in steps of {h:.3g} s its torque falls faster with the speed than the rod can follow, "
                "and several speeds are possible: expected a shorter dt, or an inertia of the bit"
            )
        low, high = 0.0, size / h
        speed = high
        for _ in range(_ITERATIONS):
            torque = float(law(speed))
            off = speed * h + C * torque - size
            low, high = (low, speed) if off > 0 else (speed, high)
            last, speed = speed, speed - off / (h + C * law.slope(speed))
            if not low <= speed <= high:
                speed = (low + high) / 2
            if abs(speed - last) <= _SMALL * last:
                break
        return math.copysign(float(law(speed)), free), False

    def accept(self, t, h, motion):
        self._kept = (self._place, self._mean, self._before, self._lengths, self._bears, self.held, self._face)
        moved, self._bears, self.held = self._step
        self._place, self._face = self._place + moved, self._next_face
        self._before, self._mean, self._lengths = self._mean, moved / h, (self._lengths[1], h)
        self._pending = self._next

    def undo(self):
        self._place, self._mean, self._before, self._lengths, self._bears, self.held, self._face = self._kept
        self._pending = None

    def far_end(self):
        return np.array([self._mean[0], self._bears[0], self._mean[1], self._bears[1]])

    def memory(self):
        self._settle()
        numbers = np.array([*self._place, *self._mean, *self._before, *self._lengths, *self._bears, self._face])
        found = {"numbers": numbers, "held": np.array(self.held)}
        if self._end is not None and (end := self._end.memory()):
            found["end"] = end
        return found

    def recall(self, memory):
        numbers = memory["numbers"]
        self._place, self._mean, self._before, lengths, self._bears = numbers[:10].reshape(5, 2).copy()
        self._lengths, self._face, self.held = (
            tuple(lengths.tolist()),
            float(numbers[10]),
            tuple(memory["held"].tolist()),
        )
        self._pending = None
        if "end" in memory:
            self._end.recall(memory["end"])
