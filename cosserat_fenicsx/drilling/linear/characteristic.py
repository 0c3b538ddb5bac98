"""Characteristic equations of a string that drills steadily: their roots s are growth rates and frequencies.

Where the torque on bit depends on its speed alone, with the slope kappa = dT/dom:

    Jb s + kappa + Z(s) = 0,        Z the torsional impedance of string and drive from the bit up.

Where the bit cuts, at the rotation Om and the rate of penetration V, with n blades and the delay tau = 2 pi/(n Om):

    (s Za(s) + ka E) (s Zt(s) - kt rho E) + ka kt rho E^2 = 0,   E = 1 - exp(-s tau),  rho = V/Om,

which is s Za Zt + E (ka Zt - kt rho Za) = 0, Za and Zt with the mass and the inertia of the bit, ka and kt weight and
torque per depth of cut. Axially, a bit on rock of the stiffness k that it does not drill adds k/s to Z, and one on
rigid rock stands. All are written without denominators.

`Steady` makes them from a scene; `box_up_to` is the searched part of the complex plane.

`WallDashpots`: the friction at the wall of a string that slips steadily is dashpots along and around the hole.
The friction of a normal force N per length is mu(v) N against the slip v of the surface, a vector along and around. The
string slips by r Om around, or by V along. Small motions v along and om around then meet the force and the torque per
length

    mu/(r Om) N v     and    r^2 mu' N om          of a string that rotates,
    mu' N v           and    r^2 mu/V N om         of one that slides without rotation,

mu' = dmu/dv, which is negative where the friction falls. Over the inertia they are drag rates, constant in pieces.
"""

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import brentq

from cosserat_fenicsx.checks import number, refuse
from cosserat_fenicsx.drilling.bit_laws import Cutting
from cosserat_fenicsx.drilling.joints import steady_speeds
from cosserat_fenicsx.drilling.laws import refuse_several_speeds
from cosserat_fenicsx.drilling.linear.impedances import Guide, axial, torsional
from cosserat_fenicsx.drilling.linear.roots import Box
from cosserat_fenicsx.drilling.signals import doubt_speed
from cosserat_fenicsx.drilling.wall_friction import law_of, loads_between, scene_pieces
from cosserat_fenicsx.parts import Number, Values, at_least, positive


# Cells along the whole string; change of the load within a piece, over the largest one; sliding over slip around, above
# which small motions along and around are not told apart, and above which that is said.
_CELLS, _SAME, _APART, _SAID = 300, 0.02, 0.2, 0.03


class WallDashpots:
    """The dashpots of a `Drilling` with a hole, under its static weight on bit."""

    def __init__(self, scene):
        self.scene, (self._law, self._of_rotation, _) = scene, law_of(scene.friction)

    @cached_property
    def pieces(self):
        """[[(length, load, radius)]] of the pieces in each segment: m, N/m for a coefficient of 1, contact radius m."""
        scene, pieces = self.scene, scene_pieces(self.scene)
        ends = np.cumsum([0.0, *(x.length for x in scene.segments)])
        even = np.linspace(0.0, pieces.bottom[-1], _CELLS + 1)
        cuts = np.unique(np.concatenate([even, pieces.bottom]))
        cuts = np.concatenate([[0.0], cuts[1:][np.diff(cuts) > 1e-6 * cuts[-1]]])
        middle, load, radius = loads_between(scene, pieces, cuts)
        lengths = np.diff(cuts)
        load, segment = load / lengths, np.clip(np.searchsorted(ends, middle) - 1, 0, len(ends) - 2)
        most, found = load.max(initial=0.0), [[] for _ in scene.segments]
        start = 0
        for k in range(1, len(load) + 1):
            group = load[start : k + 1]
            if k == len(load) or segment[k] != segment[start] or np.ptp(group) > _SAME * most:
                length = lengths[start:k].sum()
                mean = float(lengths[start:k] @ load[start:k] / length)
                found[segment[start]].append((float(length), mean, float(radius[start])))
                start = k
        return found

    def rates(self, speeds, sliding):
        """[[(length, torsional, axial rate)]] of the pieces in each segment (m, 1/s), at speeds of rotation of what is
        above and below each motor (rad/s), and along the hole (m/s).

        Raises:
            SceneError: the string is at rest, or it slides and rotates at once.
        """
        law, found, turns = self._law, [], np.asarray(speeds)[self.scene.motors_above].tolist()
        for segment, pieces, turning in zip(self.scene.segments, self.pieces, turns, strict=True):
            row = []
            for length, load, radius in pieces:
                around, along = self._dashpots(law, turning, abs(sliding), radius) if load else (0.0, 0.0)
                row.append((length, load * around / segment.rhoJ, load * along / segment.rhoA))
            found.append(row)
        return found

    def torque_on(self, part: int, speed: float) -> float:
        """On what is below as many motors as `part`, at its speed of rotation, not 0 (rad/s), N m."""
        found, size = 0.0, abs(speed)
        here = itertools.compress(self.pieces, self.scene.motors_above == part)
        for length, load, radius in itertools.chain.from_iterable(here):
            found += length * load * radius * float(self._law(size if self._of_rotation else radius * size))
        return math.copysign(found, speed)

    def _dashpots(self, law, speed, sliding, radius):
        """(r^2 N s/m, N s/m) of a normal force of 1 N."""
        slip = radius * speed
        if slip == 0 and sliding == 0:
            refuse(self.scene, "drive.speed", speed, "a string that rotates or slides: at rest friction holds it, and "
                   "small motions do not move it")  # fmt: skip
        if slip == 0:
            if self._of_rotation:
                refuse(self.scene, "friction", self.scene.friction, "a friction over the slip for a string that slides "
                       "without rotation (of_rotation=False)")  # fmt: skip
            return radius**2 * float(law(sliding)) / sliding, law.slope(sliding)
        if sliding > _APART * slip:
            refuse(self.scene, "hook.speed", sliding, f"at most {_APART:g} of the speed of the surface around, "
                   f"{slip:.4g} m/s, or a string that does not rotate: else friction "
                   "couples torsion and axial motion")  # fmt: skip
        if self._of_rotation:
            return radius * law.slope(speed), float(law(speed)) / slip
        return radius**2 * law.slope(slip), float(law(slip)) / slip

    def caution(self, speed, sliding):
        """A sentence on sliding beside the rotation, or ""."""
        slips = [radius * speed for pieces in self.pieces for _, load, radius in pieces if load]
        if not slips or not speed or abs(sliding) <= _SAID * min(slips):
            return ""
        share = 100 * (abs(sliding) / min(slips)) ** 2
        return f"friction at the wall is that of rotation alone: sliding changes it by about {share:.2g} %"


class Characteristic:
    """Base of characteristic functions, see roots.py.

    Attributes:
        guides: the waveguides that move. delay: of the function, s. fastest: a growth rate that no root reaches, 1/s.
    """

    delay = 0.0

    @property
    def travel(self):
        """Travel time of waves from the top to the bit, of all guides together, s."""
        return sum(guide.travel for guide in self.guides)

    @property
    def spacing(self):
        """Typical distance of roots along the imaginary axis, rad/s."""
        return 2 * math.pi / (2 * self.travel + self.delay)

    @property
    def exponents(self):
        """See roots.py."""
        travel = self.travel
        return -travel - self.delay, travel

    def motion(self, s):
        """Relative motion of the bit in each guide: rotation, and axial velocity where there is some."""
        raise NotImplementedError

    def below(self, s):
        """The impedance of bit and rock at the lower end of each guide, at s (n,); infinite where the bit stands."""
        raise NotImplementedError

    def _fastest(self, excess):
        """The growth (1/s) beyond which a function of it stays above 0."""
        start, step = max(guide.drive for guide in self.guides), self.spacing
        low, high = start + 1e-9 * step, start + step
        if excess(low) >= 0:
            return low
        while excess(high) < 0:
            low, high = high, start + 2 * (high - start)
        return brentq(excess, low, high)


@dataclass(frozen=True)
class Alone(Characteristic):
    """The function B + kappa w + k w/s at the bit of a string that only turns, or only moves along its axis.

    Attributes:
        kappa: N m s/rad, negative where the torque falls with the speed. rock: k, N/m, infinite for rigid rock.
    """

    guide: Guide
    kappa: float = 0.0
    rock: float = 0.0

    def __call__(self, s):
        w, B, dw, dB = self.guide.bit(s)
        if math.isinf(self.rock):
            return w, dw
        B, dB = B + self.kappa * w, dB + self.kappa * dw
        return (s * B + self.rock * w, B + s * dB + self.rock * dw) if self.rock else (B, dB)

    @property
    def fastest(self):
        # drive, string and rock only take energy, but for friction that falls: Re Z > 0 for Re s > `Guide.drive`. So
        # x Jb < -kappa for the growth x, and more where the lowest part resists
        guide = self.guide
        if math.isinf(self.rock):
            return guide.drive + self.spacing / 2
        inertia = guide.inertia + (guide.parts[-1].inertia if guide.parts[-1].travel == 0 else 0.0)
        fastest = self._fastest(lambda x: x * inertia + guide.least(x) + self.kappa)
        return 1.5 * fastest + self.spacing / 2

    @property
    def guides(self):
        return (self.guide,)

    def motion(self, s):
        return (1.0 + 0j,)

    def below(self, s):
        if math.isinf(self.rock):
            return (np.full_like(s, math.inf),)
        return (self.guide.inertia * s + self.kappa + self.rock / s,)


@dataclass(frozen=True)
class Regenerative(Characteristic):
    """The function of a bit that cuts: rotation Om (rad/s), rate of penetration V (m/s), see the head of this file.

    Attributes:
        ka: N/m; kt: N; blades: n.
    """

    torsion: Guide
    axial: Guide
    ka: float
    kt: float
    blades: int
    speed: float
    penetration: float

    @property
    def delay(self):
        return 2 * math.pi / (self.blades * self.speed)

    def _memory(self, s):
        """q E/s, q times its derivative, and q = exp(tau min(Re s, 0)), with which nothing overflows."""
        tau = self.delay
        x = s * tau
        small = np.abs(x) < 1e-2
        y = np.where(small, 1.0, x)
        size = np.exp(np.minimum(x.real, 0.0))
        decayed, q = np.exp(-1j * y.imag - np.maximum(y.real, 0.0)), np.exp(np.minimum(y.real, 0.0))
        series = 1 - x / 2 * (1 - x / 3 * (1 - x / 4 * (1 - x / 5 * (1 - x / 6 * (1 - x / 7)))))
        value = np.where(small, size * series, (q - decayed) / y)
        series = -1 / 2 + x / 3 * (1 - 3 * x / 8 * (1 - 4 * x / 15 * (1 - 5 * x / 24 * (1 - 6 * x / 35))))
        slope = np.where(small, size * series, (decayed * (1 + y) - q) / y**2)
        return tau * value, tau**2 * slope, size

    def __call__(self, s):
        om, T, dom, dT = self.torsion.bit(s)
        v, A, dv, dA = self.axial.bit(s)
        e, de, q = self._memory(s)
        ka, kt = self.ka, self.kt * self.penetration / self.speed
        cut, dcut = ka * v * T - kt * om * A, ka * (dv * T + v * dT) - kt * (dom * A + om * dA)
        return q * A * T + e * cut, q * (dA * T + A * dT) + de * cut + e * dcut

    @property
    def fastest(self):
        # s = -E (ka/Za - kt rho/Zt), where E is below 2 and Za and Zt, for a growth x, are at least `least` + m x,
        # see `Alone.fastest`
        rho = self.penetration / self.speed

        def excess(x):
            least = [y.least(x) + y.inertia * x for y in self.guides]
            return x - 2 * (self.kt * rho / least[0] + self.ka / least[1])

        return 1.2 * self._fastest(excess)

    @property
    def guides(self):
        return self.torsion, self.axial

    def motion(self, s):
        at = np.array([s], dtype=complex)
        (om, T, *_), (v, A, *_), (e, _, q) = self.torsion.bit(at), self.axial.bit(at), self._memory(at)
        rho = self.penetration / self.speed
        # per unit of rotation, from the better conditioned one of both equations
        axial, torsional = q * A / v + self.ka * e, q * T / om - self.kt * rho * e
        if abs(axial[0]) > abs(self.ka * e[0]) * 1e-6:
            return 1.0 + 0j, complex(self.ka * e[0] * rho / axial[0])
        return 1.0 + 0j, complex(-torsional[0] / (self.kt * e[0]))

    def below(self, s):
        e, _, q = self._memory(s)
        e, rho = e / q, self.penetration / self.speed
        # torque and weight by one motion, with the other one that follows from it
        (om, T, *_), (v, A, *_) = self.torsion.bit(s), self.axial.bit(s)
        turned = self.kt * rho * e * A / (A + self.ka * e * v)
        moved = self.ka * e * T / (T - self.kt * rho * e * om)
        return self.torsion.inertia * s - turned, self.axial.inertia * s + moved


def without_autodriller(scene):
    """[A caution] where an autodriller moves the block, which the linear theory leaves out."""
    moved = scene.hook is not None and scene.hook.autodriller is not None
    return ["the autodriller is left out: the block is taken to keep its speed"] if moved else []


class Steady:
    """Steady rotations of a scene at any speed and weight.

    Args:
        kind: "axial" for the axial motion of a string whose bit does not cut, else "torsion"; a bit that cuts couples
            both.

    Attributes:
        guide: the `Guide` without friction at the wall.

    Raises:
        SceneError: discs with a bit that cuts, or that move along their axis; a hook whose speed depends on time.
    """

    def __init__(self, scene, kind="torsion"):
        if scene.bit is not None and scene.bit.varies:
            refuse(
                scene.bit, "weight", scene.bit.weight, "a number (N) for the linear theory: scene.with_case(weight=...)"
            )
        self.scene, self.kind = scene, kind
        self.law = scene.bit.law if scene.bit else None
        self.cuts = self.law is not None and self.law.drills
        if self.cuts and not isinstance(self.law, Cutting):
            refuse("BitOnRock", "law", self.law, "Cutting(...), or a law of the torque over the speed, in the linear "
                   "theory")  # fmt: skip
        self.guide = torsional(scene) if kind == "torsion" else axial(scene)
        if self.cuts:
            axial(scene)  # refuses discs
        self._walls, self._guides = {}, {}

    def walls(self, weight):
        """The `WallDashpots` under a weight (N) or None; None without a hole."""
        if self.scene.hole is None:
            return None
        if weight not in self._walls:
            self._walls[weight] = WallDashpots(self.scene if weight is None else self.scene.with_case(weight=weight))
        return self._walls[weight]

    def guides(self, speed, weight):
        """(torsional, axial) `Guide` at a speed (rad/s) and weight (N) or None, without what does not move.

        Raises:
            SceneError: friction holds the string; it slides and rotates at once.
        """
        walls = self.walls(weight)
        motors = self.scene.motors
        curved = any(x.curves for x in motors)
        if walls is None and not curved:
            speed = weight = None
        if (speed, weight) not in self._guides:
            speeds = self._speeds(speed, weight) if curved or walls and motors else np.array([speed])
            damping = [x.slope_at(om) for x, om in zip(motors, np.diff(speeds), strict=True)] if curved else None
            rates, scene = walls and walls.rates(speeds, self.sliding), self.scene
            turns, moves = self.cuts or self.kind == "torsion", self.cuts or self.kind == "axial"
            found = turns and torsional(scene, rates, damping), moves and axial(scene, rates)
            self._guides = {(speed, weight): tuple(x for x in found if x)}  # of the last case alone
        return self._guides[speed, weight]

    @property
    def sliding(self):
        """Speed along the hole, m/s; 0 for a bit that cuts: it is far slower than the surface around."""
        hook = None if self.cuts else self.scene.hook
        if hook is None or self.scene.hole is None:
            return 0.0
        if not hook.signal().constant:
            refuse(self.scene, "hook.speed", hook.speed, "a speed that does not depend on time, for steady motion")
        return hook.signal()(0.0)

    def parameters(self, speed, weight):
        """Parameters of the equation, for a weight (N) or None: the slope kappa, or the rate of penetration of a bit
        that cuts; speed; weight or NaN.

        Raises:
            SceneError: a weight that is missing, or borne by wear flats; a torque that falls too fast; a string at rest
                with a bit.
        """
        rest = np.nan if weight is None else weight
        if speed == 0 and self.law is not None and self.kind == "torsion":
            refuse(self.scene, "drive.speed", speed, "above 0 (rad/s): the rock holds a bit at rest")
        if self.cuts:
            return np.array([self._penetration(speed, weight), speed, rest])
        if self.law is None or self.kind == "axial":
            return np.array([0.0, speed, rest])
        if self.law.needs_weight and weight is None:
            refuse(self.scene.bit, "weight", None, "the weight on bit (N), which the law needs")
        law = self.law.resistance(weight)
        turning = self.speed_of_bit(speed, weight)
        kappa = 0.0 if law is None else law.slope(turning)
        if not self.scene.discs:
            at = f" at {speed:.4g} rad/s" + (f" under {weight / 1e3:.4g} kN" if weight is not None else "")
            refuse_several_speeds(kappa, self.guide.impedance, self.guide.inertia, at)
        return np.array([kappa, speed, rest])

    def speed_of_bit(self, speed, weight):
        """rad/s: motors turn it faster than the string.

        Raises:
            SceneError: a motor stalls.
        """
        return float(self._speeds(speed, weight)[-1])

    def _speeds(self, speed, weight):
        """(motors + 1,) of what is above and below each motor, rad/s."""
        scene = self.scene if weight is None else self.scene.with_case(weight=weight)
        down, walls = self._penetration(speed, None) if self.cuts and weight is None else None, self.walls(weight)
        return steady_speeds(scene, speed, down, walls and walls.torque_on)

    def _penetration(self, speed, weight):
        """V from the weight on bit less the load of wear flats; or from the speed of the hook."""
        if weight is None:
            hook = self.scene.hook
            rate = -hook.signal()(0.0) if hook is not None and hook.signal().constant else 0.0
            if not rate > 0:
                refuse(self.scene.bit, "weight", None, "the weight on bit (N), or a Hook whose speed (m/s) is a "
                       "negative number: that of the block downwards")  # fmt: skip
            return rate
        return self.law.rate(weight, self.speed_of_bit(speed, weight))

    def equation(self, parameters):
        """The characteristic function of `parameters`."""
        first, speed, weight = map(float, parameters)
        guides = self.guides(speed, or_none(weight))
        if self.cuts:
            stiffnesses = self.law.axial_stiffness, self.law.torsional_stiffness
            turning = self.speed_of_bit(speed, or_none(weight))
            return Regenerative(*guides, *stiffnesses, self.law.blades, turning, first)
        if self.kind == "axial":
            bit = self.scene.bit
            return Alone(*guides, rock=0.0 if bit is None or or_none(weight) is None else bit.rock_stiffness)
        return Alone(*guides, first)


def speed_of(owner, scene, speed=None):
    """The speed (rad/s) of the steady rotation: as given, or the one that the drive is asked for.

    Raises:
        SceneError: a negative speed; a drive without a speed of its own, or with one that depends on time.
    """
    if speed is not None:
        return number(owner, "speed", speed, "a number, not negative (rad/s)", lambda x: 0 <= x < math.inf)
    drive = scene.drive
    if drive.speed is None or not drive.signal().constant:
        refuse(owner, "speed", None, "the speed of the steady rotation (rad/s): that of the drive is not constant")
    return abs(drive.signal()(0.0))


def speeds_and_weights(owner, scene, speeds, weights):
    """Both as checked arrays; weights (1,) of NaN where there is none.

    Raises:
        SceneError: speeds or weights that are not positive, or weights without a bit.
    """
    speeds = numbers(owner, "speeds", speeds, "angular velocity", at_least(0) if scene.bit is None else positive())
    doubt_speed(owner, "speeds", float(speeds.max()))
    if weights is None:
        own = scene.bit.resting if scene.bit else None
        return speeds, np.array([np.nan if own is None else own])
    if scene.bit is None:
        refuse(scene, "bit", None, "a BitOnRock, whose weight is to change")
    return speeds, numbers(owner, "weights", weights, "force", positive())


def numbers(owner, field, values, dimension, limits):
    """(n,) numbers, given as one or several."""
    several = values if isinstance(values, dict) else list(values) if np.ndim(values) else [values]
    return np.array(Values(Number(dimension, limits)).check(owner, field, several))


def or_none(weight):
    """A weight, None for NaN."""
    return None if math.isnan(weight) else float(weight)


# Modes that decay by more than exp(-this) while a wave goes down the string once are not listed.
_DECAY = 4.0
# Nor are those that decay by more than this over the damping time of the string, where modes accumulate.
_OWN_RATE = 0.5


def box_up_to(steady, top):
    """The box of a characteristic function of a `Steady`, up to a frequency (rad/s)."""
    # damping of Kelvin and Voigt has all but a few modes decay by its own rate
    slowest = max((x.damping for x in steady.guide.parts if x.length), default=0.0)
    left = max(-_DECAY / steady.guide.travel, -_OWN_RATE / slowest if slowest else -math.inf)

    def box(f):
        # one of few, so that contours are those of other cases
        right, step = f.fastest, f.spacing / 2
        return Box(left, step * 1.4 ** math.ceil(math.log(right / step, 1.4)), 0.0, top)

    return box
