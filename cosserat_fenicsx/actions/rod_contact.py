"""Rods that touch each other and themselves. Nearest points and their derivatives are in strands.py; the laws are
solved in statics/touching.py."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.parts import Friction, Length, Number, WallStiffness, at_least
from cosserat_fenicsx.scene.action import IN_SPACE, LineAction
from cosserat_fenicsx.strands import Apart, closest_segments, overlap

# Length of the sides of the polygons that are compared at rest, over the radius; most sides of a rod; depth over the
# radius that is rounding.
_SIDE, _MOST, _NOTHING = 0.25, 4000, 1e-7


class Surface:
    """The elastic surfaces of rods, dimensionless: the force F = c p^n of a contact at the depth p, see `RodContact`.
    stiffness, damping: of `RodContact`; radii: of the elements of `Strands`; shares: (nodes,) of the rods' length."""

    # Change of a depth, relative to it, below which the mean force of a step is that in its middle.
    _SAME = 1e-5

    def __init__(self, stiffness, damping, radii, shares):
        self._stiffness, self.damping, self._radii, self._shares = stiffness, damping, radii, shares

    def law(self, touches):
        """(c, n), (m,) each, of some `Touches`."""
        point = touches.node < 0
        both = self._radii[touches.element].sum(axis=1)
        c = np.where(point, 4 / 3 * np.sqrt(2 * both), self._shares[touches.node])
        return self._stiffness * c, np.where(point, 1.5, 1.0)

    @staticmethod
    def energy(law, depth):
        """(m,) stored energies."""
        c, n = law
        return c / (n + 1) * np.maximum(depth, 0) ** (n + 1)

    @staticmethod
    def force(law, depth):
        """(m,) elastic forces, and their derivatives by the depth."""
        c, n = law
        depth = np.maximum(depth, 0)
        return c * depth**n, np.where(depth > 0, c * n * depth ** (n - 1), 0.0)

    def mean_force(self, law, before, after):
        """(m,) elastic force in a step between two depths whose work is the change of the stored energy exactly (a
        discrete gradient: Gonzalez, J. Nonlinear Sci. 6 (1996) 449), and its derivative by the depth after."""
        change = after - before
        same = np.abs(change) <= self._SAME * np.maximum(np.maximum(before, after), 0)
        safe = np.where(same | (change == 0), 1.0, change)
        middle, slope = self.force(law, (before + after) / 2)
        mean = np.where(same, middle, (self.energy(law, after) - self.energy(law, before)) / safe)
        return mean, np.where(same, slope / 2, (self.force(law, after)[0] - mean) / safe)


@dataclass(frozen=True)
class RodContact(LineAction):
    """Rods that do not pass through each other or themselves, with Coulomb friction.

    It stands among the loads, once in a scene, and is not multiplied by the load factor. Where strands cross at more
    than 11.5 degrees they touch in one point, between the nearest points of both centrelines; otherwise, and where they
    wind around each other, along a line, at the nodes of the strand with the shorter elements. Ends of rods are
    hemispheres.

    In `solve` surfaces are hard, without `stiffness`. Friction depends on the path there: load factors are taken in
    their order, and a contact does not slip from one accepted state to the next, or friction is at its bound and
    against the slip between them; a contact that is new in a state has friction from the next one on.

    In `simulate` they have a `stiffness` k: the force of surfaces that overlap by a depth p is ``k p`` per length along
    a line, and in a point ``(4/3) k sqrt(2 (r1 + r2)) p^1.5``, which the line's law gives for straight rods that cross
    at a right angle. Both are multiplied by ``1 + damping p'``, and are never adhesion (Hunt & Crossley 1975,
    doi:10.1115/1.3423596). Friction acts on the surfaces, with a moment about the centrelines.

    Args:
        radius: of the rods' surfaces, m; None for that of their sections, which are `Circle` or `Tube`.
        pairs: names of two rods each that may touch, one name twice for a rod that may touch itself; None for all.
        itself: whether rods may touch themselves, where `pairs` is None.
        exclude: arc length next to a point, or to a joint, within which rods do not touch, m; None for pi times the
            radius: on less, a rod cannot bend back onto itself without folding its surface.
        stiffness: N/m^2, in motions; None for the hard surfaces of equilibria.
        damping: s/m, over the speed at which surfaces approach.
        friction: coefficient of Coulomb friction; surfaces that stick do not slip at all.

    Raises:
        SceneError: no radius known, or none that is the same all along a rod; one above the radius of curvature at
            rest; a pair of rods that are not in the scene; rods that overlap at rest.
    """

    radius: Annotated[Length, at_least(0)] | None = None
    pairs: tuple[tuple[str, ...], ...] | None = None
    itself: bool = True
    exclude: Length | None = None
    stiffness: WallStiffness | None = None
    damping: Annotated[float, Number(limits=at_least(0))] = 0.0
    friction: Friction = 0.0

    rod, work, scaled, rods_touch = None, None, False, True
    traits = IN_SPACE

    def validate(self):
        if self.radius == 0:
            refuse(self, "radius", self.radius, "a positive length, m")
        for pair in self.pairs or ():
            if len(pair) != 2:
                refuse(self, "pairs", self.pairs, "two names of rods each")
        if self.damping and self.stiffness is None:
            refuse(self, "damping", self.damping, "0 without a stiffness, since hard surfaces have none")

    def acts_on(self, rod):
        return self.pairs is None or any(rod.name in pair for pair in self.pairs)

    def radius_of(self, rod):
        """The radius of a rod's surface, m."""
        if self.radius is not None:
            return self.radius
        found = {rod.section_at(x).round_radius for x in np.linspace(0, rod.length, 9).tolist()}
        if None in found or len(found) > 1:
            raise SceneError(
                f"RodContact.radius is missing: the section of rod '{rod.name}' is not "
                f"{'round' if None in found else 'the same along it'}, expected the radius of its surface (m), or one "
                "Circle or Tube"
            )
        return found.pop()

    def apart(self, scene):
        """The `Apart` of a scene, in m."""
        rods = scene.rods
        allowed = np.full((len(rods), len(rods)), self.pairs is None)
        if self.pairs is None:
            allowed[np.diag_indices(len(rods))] = self.itself
        for pair in self.pairs or ():
            a, b = (scene.number(scene.rod(name)) for name in pair)
            allowed[a, b] = allowed[b, a] = True
        exclude = [
            math.pi * self.radius_of(rod) if self.exclude is None and self.acts_on(rod) else self.exclude or 0.0
            for rod in rods
        ]
        joints = [(scene.number(x.first.rod), x.first.s, scene.number(x.second.rod), x.second.s) for x in scene.joints]
        return Apart(joints, exclude, allowed)

    def surface(self, strands, weights, scales, time):
        """The `Surface` of `Strands`, in the units of a model; weights: of the quadrature rule at an element's nodes;
        time: the unit of time, s."""
        stiffness = self.stiffness * scales.length**2 / scales.force
        shares = np.zeros(strands.cells.max() + 1)
        np.add.at(shares, strands.cells, strands.sizes[:, None] * weights)
        return Surface(stiffness, self.damping * scales.length / time, strands.radii, shares)

    def polygons(self, rods, at):
        """Points (n, 3), m, the rods (n,), arc lengths and radii there, of polygons as fine as rods are thick; at: a
        function (rod, arc lengths (k,)) -> (k, 3) points."""
        found = []
        for i, rod in enumerate(rods):
            if not self.acts_on(rod):
                continue
            radius = self.radius_of(rod)
            s = np.linspace(0, rod.length, 2 + min(_MOST, math.ceil(rod.length / (_SIDE * radius))))
            found.append((at(rod, s), np.full(len(s), i), s, np.full(len(s), radius)))
        return [np.concatenate(part) for part in zip(*found, strict=True)]

    def check_scene(self, scene):
        """See `Action`."""
        if sum(load.rods_touch for load in scene.all_loads) > 1:
            raise SceneError("Scene.loads: expected one RodContact, with the `pairs` of all rods that touch")
        names = [rod.name for rod in scene.rods]
        for name in {name for pair in self.pairs or () for name in pair} - set(names):
            raise SceneError(f"RodContact.pairs: no rod is named {name!r}, {nearest(name, names)}")
        for rod in scene.rods_of(self):
            s = np.linspace(0, rod.length, 257)
            turns = np.linalg.norm(np.diff(rod.curve.frame(s)[..., 2], axis=0), axis=1) / (s[1] - s[0])
            if turns.max() * self.radius_of(rod) > 1:
                raise SceneError(
                    f"RodContact: the radius of rod '{rod.name}', {self.radius_of(rod):g} m, is larger than its radius "
                    f"of curvature at rest, {1 / turns.max():.4g} m: its surface overlaps itself"
                )
        points = self.polygons(scene.rods, lambda rod, s: rod.curve.position(s))
        found = closest_segments(*points, self.apart(scene), 0.0)
        if why := overlap(scene.rods, found, _NOTHING * points[3].min()):
            raise SceneError(
                f"RodContact: {why} at rest: expected rods that touch at most, which are farther apart by that; "
                "`exclude` is the arc length next to a point, or to a joint, within which rods do not touch"
            )
