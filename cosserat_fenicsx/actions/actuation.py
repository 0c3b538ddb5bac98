"""What changes the strains of a rod without stress: muscles, heat, growth, and pretension.

They are no loads but a part of the law: the strain energy is that of (v - v_0, u - u_0), with v_0 and u_0 of the
sections without stress. Stability, modes, motions and derivatives follow from the law.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from cosserat_fenicsx.checks import Numbers, NumbersInTime, refuse
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.kinds import Number
from cosserat_fenicsx.parts import ForceSize, FunctionAlong, Length, Several, positive
from cosserat_fenicsx.scene import action
from cosserat_fenicsx.scene.action import LineAction
from cosserat_fenicsx.scene.loads import Load
from cosserat_fenicsx.scene.rod import RodOrName
from cosserat_fenicsx.scene.signals import Along, VectorInTime, values_of

_NONE = (0.0, 0.0, 0.0)
# Search of jumps: samples along a rod, halvings of the interval with the largest difference, and the share of the
# range of the values by which they jump.
_SAMPLES, _HALVINGS, _JUMP = 257, 40, 1e-3


class InLaw(Load, LineAction):
    """Base of what changes the strains of sections without stress, along a `rod`.

    A class of your own is a frozen dataclass with a field `rod` and a method `without_stress`.
    """

    work, in_law = None, True

    def without_stress(self, rod, s):
        """What sections at arc lengths s (n,), m, have without stress beyond the reference: curvature and twist
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
            if isinstance(function, Along) and (s := _jump_of(function, rod.length)) is not None:
                raise SceneError(
                    f"Actuation.{field}: its function jumps at s = {s:.6g} m of rod '{rod.name}': expected "
                    "AlongPieces, at whose ends elements end"
                )


def _check_stretch(owner, field, values):
    """Refuse strains by which an element of length vanishes; functions are checked at samples."""
    if field == "strain" and not callable(values) and np.min(np.asarray(values)[..., 2]) <= -1:
        refuse(owner, field, values, "a stretch above -1, at which a rod has no length left")


def _jump_of(function, length):
    """Where a function of the arc length jumps in [0, length], m; None where it is continuous."""
    s = np.linspace(0.0, length, _SAMPLES)
    values = function(s)
    size = np.abs(values - values[0]).max()
    k = int(np.argmax(np.abs(np.diff(values, axis=0)).max(axis=1)))
    a, b = s[k], s[k + 1]
    for _ in range(_HALVINGS):
        x = (a + b) / 2
        at_a, at_x, at_b = function([a, x, b])
        a, b = (a, x) if np.abs(at_x - at_a).max() > np.abs(at_b - at_x).max() else (x, b)
    rise = np.abs(np.diff(function([a, b]), axis=0)).max()
    return float(b) if rise > _JUMP * size > 0 else None


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
            refuse(self, "force", self.force, f"a tension below EA of rod '{rod.name}', at which no length is left")

    def without_stress(self, rod, s):
        if self.force is None:
            return _NONE, (0.0, 0.0, self.rest_length / rod.length - 1)
        e, k = rod.stiffness_at(s, "left").strains(np.array((0.0, 0.0, self.force)), np.zeros(3))
        return -k, -e
