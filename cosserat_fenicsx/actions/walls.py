"""Walls of curved tubes around rods, such as the wall of a borehole.

`TubeWall` and `TubeRing` have friction in a known direction of slip; `HoleWall` and `HoleRing`, in motions, set-valued
friction. Straight walls are obstacles (actions/obstacles.py).
"""

from collections import namedtuple
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated

import numpy as np

from cosserat_fenicsx.checks import Numbers, number, refuse, vector
from cosserat_fenicsx.forms.contact import wall_work
from cosserat_fenicsx.parts import (
    Items,
    Length,
    Limits,
    Number,
    Part,
    Several,
    Speed,
    Stiffness,
    WallStiffness,
    at_least,
    between,
    fields_of,
    positive,
)
from cosserat_fenicsx.scene import action
from cosserat_fenicsx.scene.action import LineAction, PointAction
from cosserat_fenicsx.scene.rod import Rod, RodOrName, StationOrName

# Half the length of the ramp that replaces a jump of radius or friction, over the smallest radius; upper bound, over
# the shortest piece.
_RAMP, _OF_PIECE = 0.05, 0.25
# How far beside a step of a rod's surface its radii are looked up, over the arc length.
_BESIDE = 1e-9
# Points along a tube in a picture.
_DRAWN = 201
# A depth at which the pressure of a law has its derivative at zero, m.
_SHALLOW = 1e-12


class ContactLaw(Part, family="contact law"):
    """Base of laws of contact: the pressure of a wall that a rod has penetrated.

    A law is a frozen dataclass with a static method ``pressure(depth, stiffness, *data)`` -> UFL: force per area of the
    wall (per length at a station) from the depth of penetration, from 0 on, the stiffness of the wall, and the data of
    the law.
    """

    def data(self):
        """The `Datum`s of the law: its fields."""
        kinds = fields_of(type(self)).items()
        return tuple(action.scalar(getattr(self, name), kind.unit or "1") for name, kind in kinds)


@cache
def _with_law(work, pressure):
    def of_law(point, test, *data):
        return work(point, test, *data, pressure=pressure)

    return of_law


class Pressing:
    """A wall whose pressure may have a `law`. `wall_work`: its virtual work, a function with the keyword `pressure`."""

    law = None

    @property
    def work(self):
        return self.wall_work if self.law is None else _with_law(self.wall_work, type(self.law).pressure)

    def _law_data(self):
        return () if self.law is None else self.law.data()

    def begins_with(self, stiffness):
        """The derivative of the pressure by the depth where contact begins, N/m^2."""
        if self.law is None:
            return stiffness
        numbers = [datum.value.item() for datum in self._law_data()]
        return float(type(self.law).pressure(_SHALLOW, stiffness, *numbers)) / _SHALLOW


@dataclass(frozen=True)
class Slip(Several):
    """The direction (c_a, c_r) of slip, a unit vector, or (0, 0)."""

    words = "a unit vector (c_a, c_r), or (0, 0)"

    def check(self, owner, field, value):
        slip = vector(owner, field, value, "1", 2)
        if any(slip) and abs(np.hypot(*slip) - 1) > 1e-9:
            refuse(owner, field, value, self.words)
        return slip


@dataclass(frozen=True)
class Pieces(Items):
    """((end, value), ...) with ascending ends, the last infinite, of one value of another kind or of pairs."""

    @property
    def words(self):
        return f"{self.inner.words}, or pairs (end, value)"

    def check(self, owner, field, value):
        if not isinstance(value, list | tuple) or not all(isinstance(x, list | tuple) for x in value):
            return ((np.inf, self.inner.check(owner, field, value)),)
        if not value or any(len(piece) != 2 for piece in value):
            refuse(owner, field, value, self.words)
        found, last = [], 0.0
        for end, x in value:
            last = number(owner, field, end, "ends (m) that ascend from above zero", lambda x, last=last: x > last)
            found.append((last, self.inner.check(owner, field, x)))
        return (*found[:-1], (np.inf, found[-1][1]))


_LENGTHS = Pieces(Number("length", positive()))


def value_at(given, x):
    """(n, ..) values of `Pieces` at x (n,); at an end the value of the piece before it."""
    if len(given) == 1:
        return np.full((*np.shape(x), *np.shape(given[0][1])), given[0][1])
    return np.array([value for _, value in given])[np.searchsorted([end for end, _ in given], x)]


def held_across(station, axis):
    """See `Action.holds`: a wall confines a rod across the axis (3,) of the wall."""
    return [(station, np.r_[row, 0, 0, 0]) for row in across(axis)]


def across(axis):
    """(2, 3) unit vectors normal to an axis (3,) and to each other."""
    return np.linalg.svd(np.reshape(axis, (1, 3)))[2][1:]


@dataclass
class Stage:
    """Temporary changes of a wall by solvers: factors of its stiffness (`wall`, at most `most`), of a spring relative
    to that stiffness, and of its friction. The spring pulls to the axis, or to the positions at which it was anchored.
    """

    wall: float = 1.0
    most: float = np.inf
    spring: float = 0.0
    friction: float = 1.0
    anchor: np.ndarray | None = None
    last: np.ndarray | None = None

    def fasten(self):
        """Anchor the spring where the rod is."""
        self.anchor = self.last.copy()


class TubeAxis(Part, family="axis of a tube", homes=("cosserat_fenicsx.well.path",)):
    """Base of axes of tubes, with `nearest` as of `WellPath`, which scenes with walls store as data."""


class _Confined(Pressing):
    """Shared by walls along rods and at stations."""

    scaled, wall_work = False, staticmethod(wall_work)
    traits = action.IN_SPACE

    def data(self, rod, s):
        """See `Action`: as where the rod lies on the axis, to which the spring leads again."""
        self.stage.anchor = None
        return self.refreshed(rod, s, self.path.nearest(None, s + self.begins).position)

    def refreshed(self, rod, s, r):
        near = self.path.nearest(r, s + self.begins)
        clearance, arm, friction = self.sizes(s, near.md)
        stage, slip, kp = self.stage, self._slips(s), np.full(len(s), self.stiffness)
        anchor = near.position if stage.anchor is None else stage.anchor
        self._see(r)
        return (
            action.vector(near.position, "m from origin"),
            action.vector(near.tangent, "1"),
            action.vector(near.curvature, "1/m"),
            action.scalar(clearance, "m"),
            action.scalar(np.minimum(stage.wall, stage.most) * kp, self.unit),
            action.scalar(stage.spring * kp, self.unit),
            action.vector(anchor, "m from origin"),
            action.scalar(stage.friction * friction * slip[:, 0], "1"),
            action.scalar(stage.friction * friction * slip[:, 1], "1"),
            action.scalar(arm, "m"),
            *self._law_data(),
        )

    def _slips(self, s):
        return value_at(self.slip, s)

    def _see(self, r):
        self.stage.last = r


@dataclass(frozen=True)
class TubeWall(_Confined, LineAction):
    """The wall of a tube with a curved axis around a rod: a pressure stiffness <a - clearance>, force per reference
    length, towards the axis, a the distance from it, and Coulomb friction of the pressure where the rod slips in a
    known direction.

    It is integrated with the nodes as quadrature points and is not multiplied by the load factor. The nearest point of
    the axis is found again in every Newton iteration. Beyond its ends the tube is straight.

    Args:
        rod: the rod.
        path: the axis of the tube, a `WellPath`, m, inertial.
        radius: of the tube, m; or pieces [(md_end, radius)] along the axis.
        contact_radius: of the rod's surface, m; or pieces [(s_end, radius)] along the rod.
        stiffness: of the wall, N/m^2: the penetration is the force per length over it.
        friction: friction coefficient; or pieces [(md_end, coefficient)] along the axis.
        slip: (c_a, c_r), the unit direction in which the rod's surface slips: c_a towards the start of the axis, c_r
            round the axis, by a right-handed rotation about its tangent; (0, 0) for none; or pieces [(s_end, slip)]
            along the rod.
        begins: measured depth near which the rod's start lies, m.
        has_arm: whether friction has a moment about the centreline; False where it acts on the centreline itself.
        law: None, or a `ContactLaw` in place of the pressure in proportion to the penetration.

    Raises:
        SceneError: numbers outside their range, a rod as wide as the tube, or a direction of slip without unit length.
    """

    rod: RodOrName
    path: TubeAxis
    radius: Annotated[float | Numbers, _LENGTHS]
    contact_radius: Annotated[float | Numbers, _LENGTHS]
    stiffness: WallStiffness = 1e9
    friction: Annotated[float | Numbers, Pieces(Number(limits=at_least(0)))] = 0.0
    slip: Annotated[Numbers, Pieces(Slip())] = (0.0, 0.0)
    begins: Annotated[Length, Limits()] = 0.0
    has_arm: bool = True
    law: ContactLaw | None = None
    stage: Stage = field(default_factory=Stage, init=False, repr=False, compare=False)

    at_nodes, presses, unit = True, True, "N/m^2"

    def validate(self):
        super().validate()
        if isinstance(self.rod, Rod):
            self._check_inside()

    def _check_inside(self):
        s, clearance = self._clearances()
        k = int(np.argmin(clearance))
        if not clearance[k] > 0:
            wide, narrow = value_at(self.contact_radius, s)[k], value_at(self.radius, s + self.begins)[k]
            expected = f"less than the radius of the tube, {narrow:g} m at s = {s[k]:.6g} m"
            refuse(self, "contact_radius", float(wide), expected)

    def _clearances(self):
        """In the middle of each part of equal sizes: arc length and clearance, m, of a rod on the axis."""
        ends = np.array([0.0, *self.breaks(self.rod), self.rod.length])
        s = (ends[1:] + ends[:-1]) / 2
        return s, value_at(self.radius, s + self.begins) - value_at(self.contact_radius, s)

    @property
    def clearance(self):
        """The smallest clearance, m."""
        return float(self._clearances()[1].min())

    def sizes(self, s, md):
        """(n,) clearance (m), radius of the surface where friction acts (m) and friction coefficient, at arc lengths s
        of the rod and measured depths md."""
        arm = value_at(self.contact_radius, s)
        clearance = self._smooth(self.radius, md) - arm
        return clearance, arm if self.has_arm else np.zeros_like(arm), self._smooth(self.friction, md)

    def _smooth(self, given, md):
        """(n,) values of `Pieces` along the axis, linear over a short length at jumps, where it would alternate."""
        if len(given) == 1:
            return np.full(len(md), given[0][1])
        ends, values = np.array([end for end, _ in given[:-1]]), np.array([value for _, value in given])
        half = _RAMP * min(radius for _, radius in self.radius)
        half = min(half, _OF_PIECE * np.diff(ends, prepend=0.0).min(initial=np.inf))
        knots = np.ravel(np.column_stack([ends - half, ends + half]))
        return np.interp(md, knots, np.repeat(values, 2)[1:-1])

    def breaks(self, rod):
        """See `Action`: element ends where sizes and coefficients jump."""
        along = [end - self.begins for given in (self.radius, self.friction) for end, _ in given[:-1]]
        along += [end for given in (self.contact_radius, self.slip) for end, _ in given[:-1]]
        return tuple(sorted({end for end in along if 0 < end < rod.length}))

    def first_contact(self, rod, s, points):
        """See `Action`."""
        near = self.path.nearest(points, s + self.begins)
        away = near.position - points
        size = np.linalg.norm(away, axis=1)
        normal = away / np.maximum(size, np.finfo(float).tiny)[:, None]
        stiffness = self.begins_with(min(self.stage.wall, self.stage.most) * self.stiffness)
        return self.sizes(s, near.md)[0] - size, normal, stiffness, 0.0

    def tube(self):
        s = np.linspace(0.0, self.rod.length, _DRAWN)
        md = s + self.begins
        return self.path.nearest(None, md).position, self.sizes(s, md)[0]

    def holds(self, scene):
        ends = self.rod.start, self.rod.end
        tangents = self.path.nearest(None, np.array([end.s for end in ends]) + self.begins).tangent
        return [row for end, tangent in zip(ends, tangents, strict=True) for row in held_across(end, tangent)]


@dataclass(frozen=True)
class TubeRing(_Confined, PointAction):
    """The wall of a tube at one station of a rod, such as a stabiliser or a bit; see `TubeWall`.

    Args:
        station: where.
        path: the axis of the tube, a `WellPath`.
        clearance: radius of the tube minus that of the ring, m; zero holds the station on the axis elastically.
        contact_radius: radius of the ring, m, the arm of its friction.
        stiffness: N/m.
        friction: friction coefficient.
        slip, begins, law: see `TubeWall`.

    Raises:
        SceneError: numbers outside their range.
    """

    station: StationOrName
    path: TubeAxis
    clearance: Annotated[Length, at_least(0)]
    contact_radius: Length
    stiffness: Annotated[Stiffness, positive()] = 1e9
    friction: Annotated[float, Number(limits=at_least(0))] = 0.0
    slip: Annotated[Numbers, Pieces(Slip())] = (0.0, 0.0)
    begins: Annotated[Length, Limits()] = 0.0
    law: ContactLaw | None = None
    stage: Stage = field(default_factory=Stage, init=False, repr=False, compare=False)

    unit = "N/m"

    def tube(self):
        """See `Action`: as long as it is wide."""
        radius = self.clearance + self.contact_radius
        md = self.station.s + self.begins + np.array([-radius, radius])
        return self.path.nearest(None, md).position, np.full(2, self.clearance)

    def sizes(self, s, md):
        return tuple(np.full(len(s), x) for x in (self.clearance, self.contact_radius, self.friction))

    @property
    def together(self):
        """See `Action`."""
        return None if self.law else (_Rings, id(self.path))


class _Rings(_Confined):
    """`TubeRing`s of one path as one wall, with a point of each."""

    unit = TubeRing.unit

    def __init__(self, rings):
        self._rings, self.path = rings, rings[0].path
        self.stiffness, self.begins = (np.array([getattr(x, name) for x in rings]) for name in ("stiffness", "begins"))
        self._all_slips = np.concatenate([value_at(ring.slip, [ring.station.s]) for ring in rings])
        self._sizes = np.concatenate([ring.sizes([ring.station.s], None) for ring in rings], axis=1)

    @property
    def stage(self):
        stages = [ring.stage for ring in self._rings]
        numbers = (np.array([getattr(x, name) for x in stages]) for name in ("wall", "most", "spring", "friction"))
        anchors = [stage.anchor for stage in stages if stage.anchor is not None]
        return Stage(*numbers, anchor=np.concatenate(anchors) if anchors else None)

    def sizes(self, s, md):
        return self._sizes

    def _slips(self, s):
        return self._all_slips

    def _see(self, r):
        for k, ring in enumerate(self._rings):
            ring.stage.last = r[k : k + 1]


#: A tube near points of a rod: measured depth (n,), m; point of the axis (n, 3), m, inertial; unit tangent (n, 3);
#: clearance (n,), m; radius of the rod's surface where friction acts (n,), m; friction coefficient (n,).
Around = namedtuple("Around", "md position tangent clearance arm friction")


@dataclass(frozen=True)
class _InMotion:
    """Shared by walls of motions."""

    slip: Numbers = field(default=((np.inf, (0.0, 0.0)),), init=False, repr=False, compare=False)
    law: None = field(default=None, init=False, repr=False, compare=False)
    damping: Annotated[float, Number(limits=at_least(0))] = 0.0
    kinetic: Annotated[float, Number(limits=between(0, 1))] = 1.0
    speed: Annotated[Speed, positive()] = 0.1

    touches, work, refreshed = True, None, None

    def data(self, rod, s):
        return ()

    def tube_around(self, s, points, md):
        near = self.path.nearest(points, md)
        return Around(near.md, near.position, near.tangent, *self.sizes(s, near.md))


@dataclass(frozen=True)
class HoleWall(_InMotion, TubeWall):
    """The wall of a hole around a rod in motion: the normal force of a spring, with damping, and Coulomb friction.

    It acts at the nodes of the mesh, on the share of the rod's length that belongs to a node. The normal force of a
    node with the penetration p is ``stiffness p (1 + damping p')`` per length, never adhesion (Hunt & Crossley 1975,
    doi:10.1115/1.3423596). Friction is set-valued: a node sticks as long as a force of at most `friction` times the
    normal force can keep it so, else it slips and the force opposes the slip. Slip is that of the rod's surface where
    it touches: along the axis, and round it with the spin of the rod; its force acts there, and so has a moment about
    the centreline.

    In `simulate` alone; for an equilibrium take a `TubeWall`, which may be that of another scene with the same rods,
    given as `start`. It is not multiplied by the load factor. Its stored energy is counted as work, with its sign
    changed, and what friction and damping dissipate as dissipated, in the energy balance of a motion.

    Args:
        rod: the rod.
        path: the axis of the hole, a `WellPath`, m, inertial.
        radius: of the hole, m; or pieces [(md_end, radius)] along the axis.
        contact_radius: of the rod's surface, m; or pieces [(s_end, radius)] along the rod.
        stiffness: of the wall, N/m^2: the penetration is the force per length over it.
        friction: friction coefficient; or pieces [(md_end, coefficient)] along the axis.
        begins: measured depth near which the rod's start lies, m.
        damping: s/m, over the speed of penetration.
        kinetic: friction in fast slip over that at rest; the coefficient is ``friction (kinetic + (1 - kinetic)
            exp(-v/speed))`` with the speed v of slip in the step before, so that a step has one solution.
        speed: m/s, see `kinetic`.

    Raises:
        SceneError: numbers outside their range, or a rod as wide as the hole.
    """

    has_arm: bool = field(default=True, init=False, repr=False, compare=False)

    def beside(self, s):
        above, below = s * (1 - _BESIDE), s * (1 + _BESIDE)
        step = value_at(self.contact_radius, below) - value_at(self.contact_radius, above)
        return np.where(step < 0, above, np.where(step > 0, below, s))


@dataclass(frozen=True)
class HoleRing(_InMotion, TubeRing):
    """The wall of a hole around one station of a rod in motion, such as a stabiliser; see `HoleWall`.

    Args:
        station: where.
        path: the axis of the hole, a `WellPath`.
        clearance: radius of the hole minus that of the ring, m.
        contact_radius: radius of the ring, m, the arm of its friction.
        stiffness: N/m.
        friction: friction coefficient.
        begins, damping, kinetic, speed: see `HoleWall`.

    Raises:
        SceneError: numbers outside their range.
    """
