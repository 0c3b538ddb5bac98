"""Tendons: threads along a rod, guided by its sections, that are tightened or shortened to move it.

A tendon runs through the points r + R a(s), a = R_R p(s), and has the tension T all along. Its energy is T times its
length, whose variation is a force T t and a moment R a x T t in every section, t the direction of the tendon. It is
anchored at both ends of the rod. What bends the rod also holds the tendon: one in the axis of a straight rod does not
make it buckle, whatever its tension. With friction the tension falls along the tendon (`turning`), the virtual work is
the same, and there is no energy.

And what changes the strains of a rod without stress: muscles, heat, growth, and pretension. They are no loads but a
part of the law: the strain energy is that of (v - v_0, u - u_0), with v_0 and u_0 of the sections without stress.
Stability, modes, motions and derivatives follow from the law.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from cosserat_fenicsx.checks import Numbers, NumbersInTime, refuse
from cosserat_fenicsx.kinds import Number
from cosserat_fenicsx.numerics import PLACES
from cosserat_fenicsx.parts import ForceSize, Friction, FunctionAlong, Length, Several, at_least, positive
from cosserat_fenicsx.scene import action
from cosserat_fenicsx.scene.action import LineAction
from cosserat_fenicsx.scene.loads import Load
from cosserat_fenicsx.scene.rod import RodOrName
from cosserat_fenicsx.scene.signals import AlongPieces, VectorInTime, at, values_of

# Step of differences along the rod, over its length.
_STEP = 5e-4


@dataclass(frozen=True)
class Helical(FunctionAlong):
    """The offset of a tendon that winds around the axis of a rod, from d_1 towards d_2.

    Args:
        radius: its distance from the axis, m.
        pitch: arc length of one turn, m; negative to wind the other way.
        start: angle from d_1 at the start of the rod, rad.

    Raises:
        SceneError: a radius that is not positive, a pitch of zero, numbers that are not finite.
    """

    radius: Length
    pitch: Annotated[float, Number("length")]
    start: Annotated[float, Number("rotation")] = 0.0
    breaks = kinks = ()

    def validate(self):
        if self.pitch == 0:
            refuse(self, "pitch", self.pitch, "the arc length of one turn (m), not zero")

    def __call__(self, s):
        """(n, 3) at arc lengths s (n,), m."""
        angle = 2 * math.pi * np.asarray(s, dtype=float) / self.pitch + self.start
        return self.radius * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)

    def check(self, length):
        """It fits any length."""


@dataclass(frozen=True)
class Tendon(Load, LineAction):
    """A tendon along a whole rod, with a given tension or of a given length.

    The contact force of the rod does not include it: a rod pulled by a tendon alone has the contact force -T t, and its
    supports have no reaction.

    Args:
        rod: the rod.
        offset: where the tendon runs in the section, m from the axis along d_1 and d_2: two numbers; or `Helical`,
            `Along` or `AlongTable` with three components, along d_1, d_2, d_3.
        tension: N, not negative; or a function of time.
        shortening: instead of a tension, how much shorter the tendon gets, m, from its length in the reference at the
            load factor 0; negative to slacken it; or a function of time. In `solve`, `modes`, derivatives of states,
            and motions. A tendon does not push: where it would, its tension is zero, and it is shorter along the rod
            than its length.
        axial: of a tendon of given length or with friction, its stiffness EA, N; None where it does not stretch, in
            equilibria alone.
        friction: its coefficient of Coulomb friction with the rod, of a tendon of given tension. In `solve` it slides
            towards its pulled end, where it has its tension; the tension falls with exp(-friction times the angle by
            which the tendon turns, rad) on the way to the other end. A path on which it would slide back is refused. In
            `simulate` it slides both ways, or sticks. In `modes` it sticks where it has a tension.
        pulled: "start" or "end" of the rod: where it is pulled, which matters with friction alone.
        jumps: times where a function of time is not smooth, s.
        permanent: whether it acts in full, before all that the load factor multiplies.

    Raises:
        SceneError: not a rod, numbers that are not finite, a negative tension or friction, an offset that jumps, both
            or none of tension and shortening, or a tendon of given length that is permanent or has friction.
    """

    rod: RodOrName
    offset: Annotated[Numbers | FunctionAlong, VectorInTime(Several("length", 2), (FunctionAlong,), functions=False)]
    tension: (
        Annotated[ForceSize | Callable[[float], float], VectorInTime(Number("force", at_least(0, "a tension")))] | None
    ) = None
    jumps: Numbers = ()
    permanent: bool = False
    shortening: Annotated[float | Callable[[float], float], VectorInTime(Number("length"))] | None = None
    axial: Annotated[float, Number("force", positive())] | None = None
    friction: Friction = 0.0
    pulled: Literal["start", "end"] = "start"

    work, is_thread, traits = "tendon", True, action.IN_PLANE

    def validate(self):
        if isinstance(self.offset, AlongPieces):
            refuse(self, "offset", self.offset, "a function without jumps, Along or AlongTable")
        if (self.tension is None) == (self.shortening is None):
            refuse(self, "tension", self.tension, "either tension (N) or shortening (m)")
        if self.axial is not None and not (self.shortens or self.rough):
            refuse(self, "axial", self.axial, "None, since the tension is given, without friction")
        if self.permanent and self.shortens:
            refuse(self, "permanent", True, "False: the load factor multiplies a shortening")
        if self.friction and self.shortens:
            refuse(self, "friction", self.friction, "0 for a tendon of given length, or a given tension")

    @property
    def shortens(self):
        """See `Action`."""
        return self.shortening is not None

    @property
    def scaled(self):
        """See `Action`."""
        return not (self.permanent or self.shortens)

    @property
    def follows(self):
        """See `Action`."""
        return self.rough

    @property
    def rough(self):
        """See `Action`."""
        return self.friction > 0

    def data(self, rod, s):
        s = np.asarray(s, dtype=float)
        tension = np.full(s.shape, 0.0 if self.shortens else float(np.reshape(self.tension, -1)[0]))
        return (
            action.scalar(tension, "N"),
            action.vector(self._arm(rod, s), "m"),
            action.vector(self._slope(rod, s), "1"),
        )

    def left_of(self, length, t, load_factor):
        """Length without tension, m, at a time (s), of one that has a `length` where nothing is wound up; a SceneError
        where there is none."""
        short = load_factor * _number(at(self, t).shortening)
        if short >= length:
            when = f", at the time t = {t:g} s" if t else ""
            refuse(self, "shortening", short, f"less than the length of the tendon, {length:.6g} m{when}")
        return length - short

    def _arm(self, rod, s):
        """(n, 3) R_R p: from the axis to the tendon, inertial in the reference, m."""
        offset = values_of(self.offset, s) if self._winds else (*self.offset, 0.0)
        return np.einsum("kij,kj->ki", rod.curve.frame(s), np.broadcast_to(offset, (len(s), 3)))

    def _slope(self, rod, s):
        """(n, 3) (R_R p)', by the polynomials through places near s between the same two kinks."""
        kinks = {x for x in (*self.breaks(rod), *self.kinks(rod), *rod.curve.breaks) if 0 < x < rod.length}
        edges = np.array([0.0, *sorted(kinks), rod.length])
        piece = np.clip(np.searchsorted(edges, s, side="right") - 1, 0, len(edges) - 2)
        low, high = edges[piece], edges[piece + 1]
        step = np.minimum(_STEP * rod.length, (high - low) / (2 * max(PLACES)))
        middle = np.clip(s, low + max(PLACES) * step, high - max(PLACES) * step)
        x, powers = ((s - middle) / step)[:, None], np.arange(1, len(PLACES))
        weights = (powers * x ** (powers - 1)) @ np.linalg.inv(np.vander(PLACES, increasing=True))[1:]
        # without the part that is constant: its rounding over the step would be no smooth function of the offset
        arms = np.array([self._arm(rod, middle + place * step) for place in PLACES])
        return np.einsum("kp,pki->ki", weights, arms - self._arm(rod, middle)) / step[:, None]

    @property
    def _winds(self):
        return isinstance(self.offset, FunctionAlong)

    def breaks(self, rod):
        if not self._winds:
            return ()
        return (*self.offset.breaks, *(self.offset.kinks if self.rough else ()))  # where it turns, its tension falls

    def kinks(self, rod):
        return tuple(self.offset.kinks) if self._winds and not self.rough else ()


_NONE = (0.0, 0.0, 0.0)
# Samples along a rod.
_SAMPLES = 257


class InLaw(Load, LineAction):
    """Base of what changes the strains of sections without stress, along a `rod`.

    A class of your own is a frozen dataclass with a field `rod` and a method `without_stress`.
    """

    work, in_law = None, True

    def without_stress(self, rod, s):
        """Stress-free strains of sections at arc lengths s (n,), m, beyond the reference: curvature and twist
        u_0 - u_R, 1/m, and strain v_0 - v_R, material, (3,) or (n, 3) each."""
        raise NotImplementedError

    def data(self, rod, s):
        frames = rod.curve.frame(np.asarray(s, dtype=float))
        found = (self.amplitude * np.asarray(a) for a in self.without_stress(rod, s))
        k, e = (np.einsum("...ij,...j->...i", frames, a) for a in found)
        return action.vector(k, "rad/m"), action.vector(e, "1")


@dataclass(frozen=True)
class Actuation(InLaw):
    """Curvature, twist and strain without stress, beyond those of the reference: of muscles, layers that swell, ...

    A free rod takes this shape without force or moment; one that is held is stressed by the difference. The energy per
    length is that of the section's stiffness for (v - v_0, u - u_0).

    Args:
        rod: the rod.
        curvature: u_0 - u_R, 1/m, material: bending about d_1 and d_2, and twist about d_3. Three numbers, a function
            of time, or `Along`, `AlongTable`, `AlongPieces` where it changes along the rod; jumps are ends of pieces.
        strain: v_0 - v_R, material: shear along d_1 and d_2, and stretch; given as `curvature`.
        jumps: times where a function of time is not smooth, s.
        permanent: whether it acts in full, before all that the load factor multiplies.

    Raises:
        SceneError: not a rod, not three finite numbers nor a function, a stretch of -1 or less, a function of the arc
            length that jumps, or neither curvature nor strain.
    """

    rod: RodOrName
    curvature: Annotated[NumbersInTime | FunctionAlong, VectorInTime(Several("curvature"), (FunctionAlong,))] = _NONE
    strain: Annotated[NumbersInTime | FunctionAlong, VectorInTime(Several(), (FunctionAlong,))] = _NONE
    jumps: Numbers = ()
    permanent: bool = False

    def validate(self):
        if self.curvature == _NONE and self.strain == _NONE:
            refuse(self, "curvature", self.curvature, "a curvature or a strain that is not zero")
        _check_stretch(self, "strain", self.strain)

    def without_stress(self, rod, s):
        return values_of(self.curvature, s), values_of(self.strain, s)

    @property
    def _along(self):
        return [x for x in (self.curvature, self.strain) if isinstance(x, FunctionAlong)]

    def breaks(self, rod):
        return tuple(s for function in self._along for s in function.breaks)

    def kinks(self, rod):
        return tuple(s for function in self._along for s in function.kinks)

    def check_rod(self, rod):
        for field in ("curvature", "strain"):
            function = getattr(self, field)
            if isinstance(function, FunctionAlong):
                _check_stretch(self, field, function(np.linspace(0.0, rod.length, _SAMPLES)))


def _check_stretch(owner, field, values):
    """Refuse strains by which an element of length vanishes; functions are checked at samples."""
    if field == "strain" and not callable(values) and np.min(np.asarray(values)[..., 2]) <= -1:
        refuse(owner, field, values, "a stretch above -1, at which a rod has no length left")


@dataclass(frozen=True)
class Thermal(InLaw):
    """The expansion of a rod by a change of temperature, and its bending by one that varies across the section.

    Args:
        rod: the rod.
        alpha: coefficient of thermal expansion, 1/K.
        dT: change of the temperature on the axis, K; or a function of time.
        gradient: its derivatives along d_1 and d_2, K/m.
        jumps: times where a function of time is not smooth, s.
        permanent: whether it acts in full, before all that the load factor multiplies.

    Raises:
        SceneError: not a rod, numbers that are not finite, or a change of length by -1 or less.
    """

    rod: RodOrName
    alpha: float
    dT: Annotated[float | Callable[[float], float], VectorInTime(Number())]
    gradient: Annotated[Numbers, Several(size=2)] = (0.0, 0.0)
    jumps: Numbers = ()
    permanent: bool = False

    def validate(self):
        if not callable(self.dT) and self.alpha * self.dT <= -1:
            refuse(self, "dT", self.dT, "alpha dT above -1, at which a rod has no length left")

    def without_stress(self, rod, s):
        along_1, along_2 = self.gradient
        k = (self.alpha * along_2, -self.alpha * along_1, 0.0)
        return k, (0.0, 0.0, self.alpha * _number(self.dT))


@dataclass(frozen=True)
class Growth(InLaw):
    """Growth, swelling or shrinking of a rod along its axis.

    Args:
        rod: the rod.
        factor: the length without stress over that of the reference; or a function of time. The load factor, if it is
            not permanent, multiplies factor - 1.
        jumps: times where a function of time is not smooth, s.
        permanent: whether it acts in full, before all that the load factor multiplies.

    Raises:
        SceneError: not a rod, or a factor that is not positive.
    """

    rod: RodOrName
    factor: Annotated[float | Callable[[float], float], VectorInTime(Number(limits=positive()))]
    jumps: Numbers = ()
    permanent: bool = False

    def without_stress(self, rod, s):
        return _NONE, (0.0, 0.0, _number(self.factor) - 1)


def _number(value):
    """The number of a field that may have been a function of time, which gives tuples."""
    return float(np.reshape(value, -1)[0])


@dataclass(frozen=True)
class Pretension(InLaw):
    """A rod that is shorter without stress than in the reference: a guy, a cable or a tie that is tightened.

    Args:
        rod: the rod.
        force: the tension of the rod in its reference shape, N. Held there by rigid supports it has this tension; other
            structures yield, and the tension is what remains.
        rest_length: instead of a force the length without stress, m.
        permanent: whether it acts in full, before all that the load factor multiplies.

    Raises:
        SceneError: not a rod, both or none of force and rest_length, a force that leaves no length, or a force of a rod
            that cannot stretch (raised by `Scene`).
    """

    rod: RodOrName
    force: ForceSize | None = None
    rest_length: Length | None = None
    permanent: bool = True

    def validate(self):
        if (self.force is None) == (self.rest_length is None):
            refuse(self, "force", self.force, "either force (N) or rest_length (m)")

    def check_rod(self, rod):
        if self.force is None:
            return
        stretch = self.without_stress(rod, np.linspace(0.0, rod.length, _SAMPLES))[1][..., 2]
        if self.force and not np.all(stretch):
            refuse(self, "force", self.force, f"rest_length, since rod '{rod.name}' cannot stretch")
        if np.min(stretch) <= -1:
            most = -self.force / np.min(stretch)
            words = f"a tension below EA = {most:.4g} N of rod '{rod.name}', at which no length is left; is its E in Pa"
            refuse(self, "force", self.force, words)

    def without_stress(self, rod, s):
        if self.force is None:
            return _NONE, (0.0, 0.0, self.rest_length / rod.length - 1)
        e, k = rod.stiffness_at(s, "left").strains(np.array((0.0, 0.0, self.force)), np.zeros(3))
        return -k, -e
