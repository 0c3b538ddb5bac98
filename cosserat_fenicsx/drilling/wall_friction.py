"""Friction between the string and the wall of its hole: laws, and the wall force of a string that only rotates.

`PipeFriction` is that of the pipe above a rod, at the nodes where its waves meet. There the push f of the waves along
the hole and their torque g r move the surface, over the impedances A and B r^2, by (f - F)/A along the hole and (g -
G)/B around it. The friction (F, G) is a vector against this slip, of at most the size L = mu N: all of (f, g) where
that is no larger, else it has the size L, and with one number x

    F = f/(1 + A x),  G = g/(1 + B x),  slip = L x.

The inverse of its size is almost linear in x: Newton's method takes a few steps (as in More & Sorensen, SIAM J. Sci.
Stat. Comput. 4 (1983) 553). The wall bears what is across the hole, the part of the friction around it too: with q for
the load across, N^2 + G^2 = q^2. The tension in q, the direction of the friction in N and the slip in mu are those of
the step before, so that a step has one solution.
"""

from collections import namedtuple
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from cosserat_fenicsx.checks import refuse, store
from cosserat_fenicsx.drilling.laws import Resistance, by_method
from cosserat_fenicsx.drilling.signals import doubt_decay
from cosserat_fenicsx.numerics import gauss
from cosserat_fenicsx.parts import Friction, Kind, Number, Part, Rate, positive
from cosserat_fenicsx.well.hole import Mud
from cosserat_fenicsx.well.operations import RotaryDrilling, RotateOffBottom
from cosserat_fenicsx.well.pieces import pieces_of
from cosserat_fenicsx.well.softstring import chain_of


class FrictionLaw(Part, family="law of friction at the wall"):
    """Base of the laws of friction between string and wall, a vector against the slip of the surface.

    A law of your own is a frozen dataclass with a method `coefficient(slip)`: the coefficient of friction at a slip
    from 0 on (m/s), at 0 the largest one at rest.

    Attributes:
        of_rotation: the slip that `coefficient` gets is the speed of rotation, rad/s.
        of_hole: `coefficient` is a factor on the friction of the sections of the hole.
    """

    of_rotation, of_hole = False, False

    def coefficient(self, slip: float) -> float:
        """See the class."""
        raise NotImplementedError(f"{type(self).__name__}.coefficient(slip) is missing")

    @property
    def resistance(self) -> Resistance:
        """The coefficient over the slip.

        Raises:
            SceneError: `coefficient` fails, or its values are no numbers from 0 on.
        """
        return by_method(self, "coefficient")

    @property
    def decays(self) -> bool:
        """Whether the coefficient falls with the slip."""
        return self.resistance.steepest > 0 or self.resistance.drops


@dataclass(frozen=True)
class WallFriction(FrictionLaw):
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
        if self.kinetic is None:
            store(self, kinetic=self.static)
        if self.static < self.kinetic:
            refuse(self, "static", self.static, f"at least the kinetic one, {self.kinetic:g}")
        if self.speed is not None:
            kind = Number("angular velocity" if self.of_rotation else "speed", positive())
            store(self, speed=kind.check(self, "speed", self.speed))
            doubt_decay(self, self.speed, *(() if self.of_rotation else (5.0, "m/s")))

    def coefficient(self, slip: float) -> float:
        return float(self.resistance(slip)) if slip > 0 else self.static

    @property
    def resistance(self) -> Resistance:
        return Resistance(self.static, self.kinetic, self.speed or 0.0, drops=self.static > self.kinetic)


def law_of(friction: FrictionLaw | None) -> tuple[Resistance, bool, bool]:
    """(resistance, of_rotation, of_hole) of a law; for None the friction of the hole, at rest and in motion."""
    if friction is None:
        return Resistance(1.0, 1.0), False, True
    return friction.resistance, friction.of_rotation, friction.of_hole


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


#: (n,) over nodes. grip: torque of a coefficient of friction of 1, N m. reach: argument of the law of friction (slip or
#: rotation) over the speed of rotation, m or 1.
Wall = namedtuple("Wall", "grip reach")
_RULE = gauss(4)


def static_weight(scene) -> float:
    """The static weight on bit of a `Drilling`, N; 0 without one."""
    return 0.0 if scene.bit is None else scene.bit.resting or 0.0


class _Drills(RotaryDrilling):
    """The effect of a bit, about which messages use the bit's own names."""

    def validate(self):
        pass


_Drills.name = RotaryDrilling.name


def rotating(weight, torque=0.0):
    """The operation of a string that rotates under a weight on bit (N), or off bottom for none."""
    return _Drills(weight, torque) if weight > 0 else RotateOffBottom()


def scene_pieces(scene):
    """The `Pieces` of the string of a `Drilling` with a hole, rotating at its depth."""
    mud = Mud(0.0) if scene.mud is None else scene.mud
    return pieces_of(scene.hole, scene.string, rotating(static_weight(scene)), mud, scene.bit_depth)[0]


#: At measured depths of a soft string that rotates without axial motion: T, its tension by the weight in mud less the
#: weight on bit, N; curvature k of the hole, 1/m; weight along its normal and binormal, N/m.
Lateral = namedtuple("Lateral", "tension curvature normal binormal")


def lateral_load(pieces, weight, md):
    """The `Lateral` of a string with a weight on bit (N) at measured depths (m)."""
    chain = chain_of(pieces)
    below = np.cumsum(np.append(-weight, chain.weight * chain.height(chain.length)))
    i = np.minimum(np.searchsorted(pieces.bottom, md), len(pieces.bottom) - 1)
    u = pieces.bottom[i] - md
    i = len(pieces.bottom) - 1 - i  # a chain runs from the bit up
    here = type(chain)(*(x[i] for x in chain))
    tension = below[i] + here.weight * here.height(u)
    return Lateral(tension, here.curvature, here.weight * here.down(u)[1], here.weight * here.b)


def soft_string_force(pieces, weight, md):
    """Wall force per length (N/m) at measured depths (m) of a soft string that rotates without axial motion.

    |T k n + w (e - (e.t) t)|, see `well.softstring` and `Lateral`: friction acts across t alone.
    """
    load = lateral_load(pieces, weight, md)
    return np.hypot(load.curvature * load.tension + load.normal, load.binormal)


def points_between(cuts):
    """Gauss points (n, k) between cuts (n + 1,), and the lengths (n, k) for which they stand."""
    half = np.diff(cuts)[:, None] / 2
    return cuts[:-1, None] + half * (1 + _RULE.points), half * _RULE.weights


def loads_between(scene, pieces, cuts, normal_force=None):
    """(middle (m), friction of a coefficient of 1 (N), contact radius (m)) between cuts, measured depths (m) among
    which are those of the pieces; `normal_force` as in `wall_of`."""
    md, lengths = points_between(cuts)
    force = soft_string_force(pieces, static_weight(scene), md) if normal_force is None else normal_force(md)
    middle = md.mean(axis=1)
    at = np.minimum(np.searchsorted(pieces.bottom, middle), len(pieces.bottom) - 1)
    load = (force * lengths).sum(axis=1)
    if law_of(scene.friction)[2]:
        load = load * scene.hole.at(middle, "friction")
    return middle, load, pieces.radius[at]


def wall_of(scene, depths, normal_force=None):
    """The `Wall` of a `Drilling` at nodes (measured depths, m), each with half of the cells beside it. normal_force:
    function of measured depths that gives N/m, in place of the soft string."""
    size = len(depths)
    if scene.hole is None:
        return Wall(np.zeros(size), np.ones(size))
    pieces = scene_pieces(scene)
    middles = (depths[1:] + depths[:-1]) / 2
    inside = pieces.bottom[pieces.bottom < depths[-1]]
    middle, load, radius = loads_between(scene, pieces, np.unique([*depths, *middles, *inside]), normal_force)
    torque = load * radius
    node = np.searchsorted(middles, middle)
    _, of_rotation, _ = law_of(scene.friction)
    grip, force = np.bincount(node, torque, size), np.bincount(node, load, size)
    reach = np.ones(size) if of_rotation else np.divide(grip, force, out=np.ones(size), where=force > 0)
    if scene.bit is not None:  # one law a node: the wall beside the bit acts on the node above it
        grip[-2] += grip[-1]
        grip[-1] = 0.0
    return Wall(grip, reach)


_MOST, _ENOUGH = 60, 1e-13  # Newton steps; relative change of x that ends them


class PipeFriction:
    """Friction at the inner nodes of a pipe that is the upper part of the string of a `Drilling` with a hole. scene:
    the `Drilling`. depths: (n + 2,) measured depths of the nodes, m; the wall beside an end, or one of the nodes
    `parted`, acts at the node next to it, on the same side."""

    def __init__(self, scene, depths, parted=()):
        pieces, middles = scene_pieces(scene), (depths[1:] + depths[:-1]) / 2
        inside = pieces.bottom[pieces.bottom < depths[-1]]
        md, self._lengths = (x.ravel() for x in points_between(np.unique([*depths, *middles, *inside])))
        self._law, self._of_rotation, of_hole = law_of(scene.friction)
        self._of_hole = scene.hole.at(md, "friction") if of_hole else np.ones_like(md)
        self._load = lateral_load(pieces, static_weight(scene), md)
        self._count = len(depths) - 2
        self._node = np.clip(np.searchsorted(middles, md) - 1, 0, self._count - 1)
        for node in parted:
            at = self._node == node - 1
            self._node[at] += np.where(md[at] < depths[node], -1, 1)
        radius = pieces.radius[np.minimum(np.searchsorted(pieces.bottom, md), len(pieces.bottom) - 1)]
        lengths = self._summed(self._lengths)
        self._radius = np.where(
            lengths > 0, self._summed(radius * self._lengths) / np.where(lengths > 0, lengths, 1), 1
        )
        self.begin(0.0)

    def _summed(self, values):
        return np.bincount(self._node, values, self._count)

    def begin(self, thrust):
        """Begin at rest, with a thrust (N) more than in the weight of the string."""
        rest = np.zeros(self._count)
        self._now = self._before = (rest, np.full(self._count, np.nan), rest + thrust)

    def holding(self, push, torque, axial, torsional):
        """(2, n) friction along the hole, N, and around it, N m, in a step, by f, g r, A and B r^2."""
        slip, around, thrust = self._now
        r = self._radius
        f, g, A, B = push, torque / r, axial, torsional / r**2
        size = np.hypot(f, g)
        some = np.where(size > 0, size, 1.0)
        limit = self._limit(slip, np.where(np.isnan(around), np.abs(g) / some, around), thrust)
        x = _shares(f, g, A, B, limit)
        F, G = f / (1 + A * x), g / (1 + B * x)
        found = np.hypot(F, G)
        self._before, around = self._now, np.where(found > 0, np.abs(G) / np.where(found > 0, found, 1.0), around)
        self._now = np.hypot((f - F) / A, (g - G) / B), around, thrust
        return np.array([F, G * r])

    def _limit(self, slip, around, thrust):
        """(n,) the largest friction at nodes, N."""
        law, load = self._law, self._load
        speed = slip / self._radius if self._of_rotation else slip
        coefficient = np.full(self._count, float(law.still))
        coefficient[speed > 0] = law(speed[speed > 0])
        mu = coefficient[self._node] * self._of_hole
        across = load.curvature * (load.tension - thrust[self._node]) + load.normal
        normal = np.hypot(across, load.binormal) / np.sqrt(1 + (mu * around[self._node]) ** 2)
        return self._summed(mu * normal * self._lengths)

    def take(self, thrust):
        """Take the thrust (n,) at the nodes in the step."""
        self._now = (*self._now[:2], thrust)

    def undo(self):
        """Take back the last step."""
        self._now = self._before

    def memory(self):
        """All that later steps depend on."""
        return {"now": np.array(self._now), "before": np.array(self._before)}

    def recall(self, memory):
        """Restore the result of `memory`."""
        self._now, self._before = (tuple(memory[name].copy()) for name in ("now", "before"))


def _shares(f, g, A, B, limit):
    """(n,) x, see the module; 0 where the node sticks."""
    size, x = np.hypot(f, g), np.zeros(len(f))
    at = np.flatnonzero((size > limit) & (limit > 0))
    x[limit <= 0] = np.inf
    f, g, A, B, size, limit = (values[at] for values in (f, g, A, B, size, limit))
    low, high = (size / limit - 1) / np.maximum(A, B), (size / limit - 1) / np.minimum(A, B)
    found = (low + high) / 2
    for _ in range(_MOST):
        along, round_ = f / (1 + A * found), g / (1 + B * found)
        now = np.hypot(along, round_)
        fall = (A * along**2 / (1 + A * found) + B * round_**2 / (1 + B * found)) / now
        high, low = np.where(now < limit, found, high), np.where(now < limit, low, found)
        step = np.clip(found + (1 / limit - 1 / now) * now**2 / fall, low, high)
        done = np.abs(step - found) <= _ENOUGH * found
        found = step
        if done.all():
            break
    x[at] = found
    return x
