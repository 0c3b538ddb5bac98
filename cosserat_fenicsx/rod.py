"""A rod: a curve, a section and a material; and the stations on it that everything else refers to."""

import itertools
import math
from collections import namedtuple
from dataclasses import dataclass, field

import numpy as np

from cosserat_fenicsx.checks import instance, number, refuse, store
from cosserat_fenicsx.curves import CURVES
from cosserat_fenicsx.materials import Material
from cosserat_fenicsx.sections import SECTIONS, Stiffness

#: Stiffnesses along a rod: K (n, 3), J (n, 3), mass (n,) or None.
Along = namedtuple("Along", "K J mass")

_unnamed = itertools.count(1)


@dataclass(frozen=True, eq=False)
class Rod:
    """A slender body with its reference centreline, stress-free as drawn.

    Args:
        curve: the reference centreline (`Line`).
        section: `Circle`, `Tube`, `Rectangle` or `Stiffness`.
        material: a `Material`; not needed with `Stiffness`.
        name: how messages, files and scene files call it.

    Raises:
        SceneError: a part of the wrong kind, or a missing material.
    """

    curve: object
    section: object
    material: Material | None = None
    name: str | None = None
    stiffness: Stiffness = field(init=False, repr=False)

    def __post_init__(self):
        if self.name is None:
            store(self, name=f"rod{next(_unnamed)}")
        instance(self, "name", self.name, str, "a string")
        instance(self, "curve", self.curve, CURVES, "a curve such as Line(start, end)")
        instance(self, "section", self.section, SECTIONS, "a section such as Circle(diameter)")
        if self.material is None and not isinstance(self.section, Stiffness):
            refuse(self, "material", None, f"a Material, which a {type(self.section).__name__} section needs")
        if self.material is not None:
            instance(self, "material", self.material, Material, "a Material")
        store(self, stiffness=self.section.stiffness(self.material))

    @property
    def length(self):
        """Reference arc length, m."""
        return self.curve.length

    @property
    def breaks(self):
        """Interior arc lengths where the curve or the section is not smooth, m."""
        return ()

    def stiffness_at(self, s):
        k, n = self.stiffness, len(s)
        return Along(
            np.tile([*k.shear, k.axial], (n, 1)),
            np.tile([*k.bending, k.torsion], (n, 1)),
            None if k.mass is None else np.full(n, k.mass),
        )

    @property
    def start(self):
        """The station at s = 0."""
        return Station(self, 0.0)

    @property
    def end(self):
        """The station at s = length."""
        return Station(self, self.length)

    def at(self, s):
        """The station at reference arc length s, m, in [0, length]."""
        L = self.length
        s = number(self, "at(s)", s, f"an arc length in [0, {L:g}] m", lambda s: -1e-12 * L <= s <= L * (1 + 1e-12))
        return Station(self, min(max(s, 0.0), L))


@dataclass(frozen=True)
class Station:
    """A point of a rod by its reference arc length s, m; made by `rod.start`, `rod.end`, `rod.at(s)`."""

    rod: Rod
    s: float

    def __str__(self):
        if math.isclose(self.s, self.rod.length, rel_tol=1e-12):
            return f"{self.rod.name}.end"
        return f"{self.rod.name}.start" if self.s == 0 else f"{self.rod.name}@{self.s:g}"

    __repr__ = __str__


def euler_load(rod):
    """Critical load P_cr = pi^2 EI/(2L)^2 of the cantilever column, N, with the smaller bending stiffness."""
    return math.pi**2 * min(rod.stiffness.bending) / (2 * rod.length) ** 2
