"""Obstacles that rods touch: planes, cylinders and spheres, with Coulomb friction, and the wall of a straight hole.

Each is a gap function (forms/contact.py) with its data; pressure, friction, refusals, contacts in results and pictures
follow from it.
"""

from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Annotated

import numpy as np

from cosserat_fenicsx.actions.walls import ContactLaw, Pressing, across, held_across
from cosserat_fenicsx.checks import Numbers, refuse
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.forms import contact
from cosserat_fenicsx.parts import AngularVelocity, Friction, Length, Several, UnitVector, WallStiffness, at_least
from cosserat_fenicsx.scene import action
from cosserat_fenicsx.scene.action import LineAction
from cosserat_fenicsx.scene.rod import Rod, RodOrName
from cosserat_fenicsx.scene.signals import Signal, at

# Stiffness of the surface against slip over that against penetration: a stiffer one makes sticking parts of a rod
# alternate in the short boundary layers that a stiff surface has.
_STICKS = 1e-2
# Samples along a rod; tolerance of its gap at rest, relative to its length.
_SAMPLES, _NOTHING = 257, 1e-9

# Angles around a cylinder or a sphere in a picture, rad.
_CIRCLE = np.linspace(0, 2 * np.pi, 33)

_Point = Annotated[Numbers, Several("length")]


@cache
def _work_of(surface, size, rough, pressure, motion):
    """The virtual work of an obstacle with a gap function of `size` data, with friction or with a law of pressure;
    motion: of a surface that moves in itself, see `contact.shifted`, or None."""

    def work(point, test, *data):
        shape, rest = data[:size], data[size:]
        if rough:
            rest, _, carried = _carried(rest, motion)
            return contact.rough_work(point, test, surface, shape, *rest, **carried)
        return contact.obstacle_work(point, test, surface, shape, *rest, pressure=pressure)

    law = "rough" if rough else pressure.__qualname__
    work.__qualname__ = f"{surface.__name__}, {law}{', moving' if motion else ''}"  # orders the terms
    return work


@cache
def _evolution_of(surface, size, motion):
    def evolve(point, *data):
        rest, now, carried = _carried(data[size:], motion)
        *known, force = contact.remembered(point, surface, data[:size], *rest, **carried)
        return [*known, *now, force]

    return evolve


def _carried(data, motion):
    """Data of friction without those of a moving surface; a list of how far it is; and its motion since then."""
    if motion is None:
        return data, [], {}
    arm, stiffness, friction, now, stick, moved, turned, before, held = data
    return (arm, stiffness, friction, stick, moved, turned, held), [now], {"carried": (motion, now - before)}


@dataclass(frozen=True)
class _Uniform:
    """A motion of a surface: its speed times the time, a tuple."""

    speed: tuple

    jumps, straight = (), True

    def __call__(self, t):
        return tuple(t * x for x in self.speed)


class Obstacle(Pressing, LineAction):
    """Base of obstacles: what rods do not penetrate.

    Attributes:
        surface: the gap function; `shape` its data; `beside` the same in numbers.
        contact_radius: of the rods' surfaces, m; None where it is that of their round sections.
        friction: the coefficient.
        motion, carried: of a surface that moves in itself: see `contact.shifted`, and how far, a function of time.
    """

    scaled, at_nodes, presses, surface, motion, carried = False, True, True, None, None, None

    #: See `Action.gaps`.
    largest_step = np.inf

    def acts_on(self, rod):
        return self.rod is None or self.rod is rod

    def validate(self):
        if self.law is not None and self.friction:
            refuse(self, "friction", self.friction, "0 with a law of pressure")
        self._check_motion()
        if isinstance(self.rod, Rod):
            self.check_rod(self.rod)

    @property
    def smooth(self):
        """See `Action`."""
        without = {"friction": 0.0, "stick": None, "velocity": None, "spin": 0.0}
        return replace(self, **{field.name: without[field.name] for field in fields(self) if field.name in without})

    def _check_motion(self):
        """Set `carried` of a surface that moves in itself."""

    def _moves(self, field, unit, speed):
        if not self.friction:
            refuse(self, field, getattr(self, field), "0 without friction, by which alone a moving surface acts")
        motion = _Uniform(tuple(map(float, speed)))
        object.__setattr__(self, "carried", Signal(type(self).__name__, field, unit, motion, (), len(motion.speed)))

    def shape(self):
        """The data of the gap function, a tuple of `Datum`."""
        raise NotImplementedError

    def beside(self, points):
        """(n,) distances of points (n, 3) from the surface, m, and (n, 3) unit normals there, towards the free side."""
        raise NotImplementedError

    def radius_of(self, rod, s):
        """(n,) radius of a rod's surface at arc lengths s (n,), m."""
        if self.contact_radius is not None:
            return np.full(len(s), self.contact_radius)
        alike = s[:1] if rod.profile.constant else s
        return np.resize([rod.section_at(x).round_radius or np.nan for x in alike.tolist()], len(s))

    def gaps(self, rod, s, points):
        """(n,) gaps between a rod's surface and the obstacle, m, where its points at arc lengths s are at `points`, and
        (n, 3) unit normals."""
        distance, normal = self.beside(points)
        return distance - self.radius_of(rod, s), normal

    def first_contact(self, rod, s, points):
        """See `Action`."""
        return *self.gaps(rod, s, points), self.begins_with(self.stiffness), self.sticks if self.friction else 0.0

    def _at_rest(self, rod):
        s = np.linspace(0.0, rod.length, _SAMPLES)
        return s, *self.gaps(rod, s, rod.curve.position(s))

    def check_rod(self, rod):
        """See `Action`: refuse a rod whose radius is not known, or that overlaps the obstacle at rest."""
        s, gap, _ = self._at_rest(rod)
        if np.isnan(gap).any():
            raise SceneError(
                f"{type(self).__name__}.contact_radius is missing: the section of rod '{rod.name}' is not round at "
                f"s = {s[np.isnan(gap)][0]:.6g} m, expected the radius of its surface (m), or a Circle or Tube"
            )
        k = int(np.argmin(gap))
        if gap[k] < -_NOTHING * rod.length:
            raise SceneError(
                f"{type(self).__name__}: rod '{rod.name}' lies beyond its surface at rest, at s = {s[k]:.6g} m by "
                f"{-gap[k]:.4g} m: "
                f"expected {self._expected}"
            )

    _expected = "a rod that touches it at most; the gap is between its surface, at the contact radius, and the obstacle"

    def data(self, rod, s):
        sizes = action.scalar(self.radius_of(rod, s), "m"), action.scalar(self.stiffness, "N/m^2")
        if not self.friction:
            return *self.shape(), *sizes, *self._law_data()
        far = () if self.carried is None else (self._far(self.carried),)
        return *self.shape(), *sizes, action.scalar(self.friction, "1"), *far, action.scalar(self.sticks, "N/m^2")

    def _far(self, moved):
        """The `Datum` of how far the surface has moved."""
        return action.vector(moved, "m") if len(moved) == 3 else action.scalar(moved[0], "1")

    @property
    def sticks(self):
        """Friction force per length over the elastic slip in motions, N/m^2."""
        return self.stiffness * _STICKS if self.stick is None else self.stick

    @property
    def memory(self):
        """See `Action`: of friction."""
        if not self.friction:
            return ()
        moved, turned, held = (action.vector(np.zeros(3), unit) for unit in ("m", "1", "N/m"))
        far = () if self.carried is None else (self._far(np.zeros_like(at(self, 0.0).carried)),)
        return moved, turned, *far, held

    @property
    def finds_friction(self):
        """See `Action`."""
        return bool(self.friction)

    @property
    def evolve(self):
        """See `Action`."""
        return _evolution_of(self.surface, len(self.shape()), self._motion) if self.friction else None

    @property
    def _motion(self):
        return None if self.carried is None else self.motion

    @property
    def work(self):
        """See `Action`."""
        pressure = contact.linear if self.law is None else type(self.law).pressure
        return _work_of(self.surface, len(self.shape()), bool(self.friction), pressure, self._motion)

    def holds(self, scene):
        """See `Action`: rods that lie on it, as long as they do."""
        found = []
        for rod in scene.rods_of(self):
            s, gap, normal = self._at_rest(rod)
            touching = np.flatnonzero(gap <= _NOTHING * rod.length)
            for k in sorted({*touching[[0, len(touching) // 2, -1]].tolist()}) if len(touching) else ():
                rows = np.eye(3) if self.friction else normal[k][None]
                found += [(rod.at(float(s[k])), np.r_[row, 0, 0, 0]) for row in rows]
        return found


def _vertex(s, gap, k):
    """The place of the smallest gap by the parabola through three samples."""
    before, here, after = gap[k - 1 : k + 2]
    return float(s[k] + (s[k + 1] - s[k]) * (before - after) / (2 * (before - 2 * here + after)))


@dataclass(frozen=True)
class Plane(Obstacle):
    """A plane that rods rest on, such as a table or the seabed, with Coulomb friction.

    It acts at the nodes of the mesh on the rods' surfaces: a pressure along the normal, `stiffness` times the depth of
    penetration (per unit of reference length), and friction with its moment about the centreline. It is not multiplied
    by the load factor. A rod that touches at rest is held there from the start.

    Friction depends on the path: the surface sticks until the friction force reaches `friction` times the pressure.
    Loads are then applied in their order, and steps of the load factor must be short enough to follow the slip.

    Args:
        point: a point of the plane, m, inertial.
        normal: towards the side where rods are, inertial.
        friction: coefficient of friction.
        stiffness: N/m^2: the penetration is the force per length over it.
        stick: N/m^2, of what sticks: in motions the elastic slip is the friction force per length over it; equilibria
            have none, and it is what stability and modes see there. None for `stiffness`/100.
        rod: the rod that it acts on; None for all rods of the scene.
        contact_radius: of the rods' surfaces, m; None for that of their sections, which are `Circle` or `Tube`.
        law: None, or a `ContactLaw` in place of the pressure in proportion to the penetration, without friction.
        velocity: of a belt, in the plane, m/s, inertial: in motions, from their start on.

    Raises:
        SceneError: no normal, numbers outside their range, no contact radius known, a rod that overlaps it at rest, or
            a velocity out of the plane or without friction.
    """

    point: _Point
    normal: UnitVector
    friction: Friction = 0.0
    stiffness: WallStiffness = 1e8
    stick: WallStiffness | None = None
    rod: RodOrName | None = None
    contact_radius: Annotated[Length, at_least(0)] | None = None
    law: ContactLaw | None = None
    velocity: Annotated[Numbers, Several("speed")] | None = None

    surface, motion, traits = staticmethod(contact.plane), staticmethod(contact.shifted), action.IN_PLANE

    def _check_motion(self):
        if self.velocity is not None and any(self.velocity):
            if abs(np.dot(self.velocity, self.normal)) > _NOTHING * np.linalg.norm(self.velocity):
                refuse(self, "velocity", self.velocity, "a velocity in the plane, perpendicular to its normal")
            self._moves("velocity", "m", self.velocity)

    def shape(self):
        return action.vector(self.point, "m from origin"), action.vector(self.normal, "1")

    def beside(self, points):
        return (points - self.point) @ self.normal, np.broadcast_to(self.normal, points.shape)

    def drawn(self, low, high):
        middle, size = (low + high) / 2, np.linalg.norm(high - low) / 2
        middle = middle - (middle - self.point) @ self.normal * np.array(self.normal)
        first, second = across(self.normal)
        ends = size * np.array((-1.0, 1.0))
        return middle + ends[:, None, None] * first + ends[:, None] * second


class _Round(Obstacle):
    """Obstacles around a point or an axis."""

    @property
    def largest_step(self):
        """See `Action.gaps`."""
        return np.inf if self.inside else self.radius

    def breaks(self, rod):
        """See `Action`: where the rod is nearest at rest, so that a node is there."""
        s, gap, _ = self._at_rest(rod)
        step = _NOTHING * rod.length
        nearest = (gap[1:-1] < gap[:-2] - step) & (gap[1:-1] < gap[2:] - step)
        return () if self.inside else tuple(_vertex(s, gap, k) for k in np.flatnonzero(nearest) + 1)

    def beside(self, points):
        away = self._away(points)
        size = np.linalg.norm(away, axis=1)
        sign = -1.0 if self.inside else 1.0
        return sign * (size - self.radius), sign * away / np.maximum(size, np.finfo(float).tiny)[:, None]


@dataclass(frozen=True)
class Sphere(_Round):
    """A sphere that rods stay outside of, with Coulomb friction; see `Plane`.

    Args:
        point: its centre, m, inertial.
        radius: m.
        friction, stiffness, stick, rod, contact_radius, law: see `Plane`.

    Raises:
        SceneError: numbers outside their range, no contact radius known, or a rod that overlaps it at rest.
    """

    point: _Point
    radius: Length
    friction: Friction = 0.0
    stiffness: WallStiffness = 1e8
    stick: WallStiffness | None = None
    rod: RodOrName | None = None
    contact_radius: Annotated[Length, at_least(0)] | None = None
    law: ContactLaw | None = None

    surface, inside, traits = staticmethod(contact.sphere), False, action.IN_PLANE

    def shape(self):
        return action.vector(self.point, "m from origin"), action.scalar(self.radius, "m")

    def _away(self, points):
        return points - self.point

    def drawn(self, low, high):
        polar = np.linspace(0, np.pi, len(_CIRCLE) // 2 + 1)[:, None, None]
        first, second = across((0.0, 0.0, 1.0))
        around = np.cos(_CIRCLE)[:, None] * first + np.sin(_CIRCLE)[:, None] * second
        return self.point + self.radius * (np.sin(polar) * around + np.cos(polar) * np.array((0, 0, 1.0)))


class _Cylindrical(_Round):
    """Obstacles around the straight axis through `point` along `direction`."""

    def shape(self):
        axis = action.vector(self.point, "m from origin"), action.vector(self.direction, self._unit_of_axis)
        return *axis, action.scalar(self.radius, "m")

    _unit_of_axis = "1"

    def _away(self, points):
        away = points - self.point
        return away - np.outer(away @ self.direction, self.direction)

    def drawn(self, low, high):
        axis, size = np.array(self.direction), np.linalg.norm(high - low) / 2
        along = ((low + high) / 2 - self.point) @ axis + size * np.array((-1.0, 1.0))
        first, second = across(self.direction)
        around = np.cos(_CIRCLE)[:, None] * first + np.sin(_CIRCLE)[:, None] * second
        return self.point + along[:, None, None] * axis + self.radius * around


@dataclass(frozen=True)
class Cylinder(_Cylindrical):
    """An infinite circular cylinder that rods stay outside of, or inside, with Coulomb friction; see `Plane`.

    Args:
        point: a point of its axis, m, inertial; direction: of the axis.
        radius: m.
        friction: coefficient of friction.
        inside: whether rods are inside.
        stiffness, stick, rod, contact_radius, law: see `Plane`.
        spin: of a drum about its axis, rad/s, right-handed about `direction`: in motions, from their start on.

    Raises:
        SceneError: no direction, numbers outside their range, no contact radius known, a rod that overlaps it at rest,
            or a spin without friction.
    """

    point: _Point
    direction: UnitVector
    radius: Length
    friction: Friction = 0.0
    inside: bool = False
    stiffness: WallStiffness = 1e8
    stick: WallStiffness | None = None
    rod: RodOrName | None = None
    contact_radius: Annotated[Length, at_least(0)] | None = None
    law: ContactLaw | None = None
    spin: AngularVelocity = 0.0

    _unit_of_axis, traits = "axis", action.IN_PLANE

    def _check_motion(self):
        if self.spin:
            self._moves("spin", "rad", (-self.spin if self.inside else self.spin,))

    motion = staticmethod(contact.turned)

    @property
    def surface(self):
        """The gap function."""
        return contact.hole if self.inside else contact.cylinder


@dataclass(frozen=True)
class Wall(_Cylindrical):
    """A frictionless cylindrical wall that confines a rod's centreline by a penalty: a force kp max(rho - clearance, 0)
    per unit of reference length towards the straight axis, rho the distance from it.

    It is integrated with the nodes as quadrature points, which resolves contact pressures best. It is not multiplied by
    the load factor. The pressure has a kink where contact begins: meshes that `solve` refines have element ends there,
    for up to a dozen places in all points of a path; more of them take many elements. A softer wall is easier to solve.

    Args:
        rod: the rod.
        point: a point of the axis, m, inertial; direction: of the axis.
        clearance: radius of the hole minus that of the rod, m.
        stiffness: kp, N/m^2. The penetration is the force per unit length over kp; rock and steel have 1e9 and more.
        law: None, or a `ContactLaw` in place of the pressure in proportion to the penetration.

    Raises:
        SceneError: not a rod, no direction, numbers that are not positive, or a rod that lies outside the wall at rest.
    """

    rod: RodOrName
    point: _Point
    direction: UnitVector
    clearance: Length
    stiffness: WallStiffness = 1e9
    law: ContactLaw | None = None

    surface, inside, friction, contact_radius = staticmethod(contact.hole), True, 0.0, 0.0
    drawn = LineAction.drawn
    radius = property(lambda self: self.clearance)
    _expected = "a point and a direction of the axis, and a clearance, such that all of the rod is inside"

    def holds(self, scene):
        return held_across(self.rod.start, self.direction) + held_across(self.rod.end, self.direction)
