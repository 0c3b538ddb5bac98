"""Supports of rods, joints between them, their initial velocities, and what a body in motion imposes on rods.

A support either removes all unknowns of a station (`clamps`) or defines scalar constraints there (`ties`); no model
or solver refers to a support by name.

A vessel, a shaking table or a robot's flange is recorded as three displacements and three angles over time. A support
on it moves by the displacement of its own point, which the angles change where it is off the body's reference point.
"""

import math
from collections import namedtuple
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Annotated, Literal

import numpy as np

from cosserat_fenicsx.checks import Numbers, NumbersInTime, Rows, direction, refuse, store, vector
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.parts import FileName, FunctionOfTime, Limits, Number, Part, Several, UnitVector
from cosserat_fenicsx.scene.rod import RodOrName, Station, StationOrName
from cosserat_fenicsx.scene.signals import VectorInTime, at, read_table, vector_at


#: direction . (r_a - r_b) = its value in the reference + offset + rate times the load factor (m).
PositionTie = namedtuple("PositionTie", "a b direction rate offset", defaults=(0.0,))
#: The direction t, fixed to the section at a, stays normal to w, fixed to the section at b.
AngleTie = namedtuple("AngleTie", "a b t w")
#: The rotation of the section at a is the load factor times `rotation` (rad, a rotation vector), after that by the
#: quaternion `start`, about one `axis`.
TurnTie = namedtuple("TurnTie", "a b axis rotation start", defaults=((1.0, 0.0, 0.0, 0.0),))

AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def same_place(a, b=None, displacement=(0.0, 0.0, 0.0)):
    """Three ties that hold a at b, or at its reference position plus the load factor times a displacement."""
    return tuple(PositionTie(a, b, axis, rate) for axis, rate in zip(AXES, displacement, strict=True))


def same_axis(a, b, axis):
    """Two ties that let a rotate relative to b about `axis` (a unit vector) alone."""
    across = AXES[min(range(3), key=lambda i: abs(axis[i]))]
    t1 = _unit(_cross(axis, across))
    return AngleTie(a, b, t1, tuple(axis)), AngleTie(a, b, _unit(_cross(axis, t1)), tuple(axis))


def turned(a, rotation):
    """Three ties that hold the rotation of the section at a to the load factor times `rotation`."""
    return tuple(TurnTie(a, None, axis, tuple(rotation)) for axis in AXES)


def _cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _unit(a):
    size = sum(x * x for x in a) ** 0.5
    return tuple(x / size for x in a)


class Support(Part, family="support"):
    """Base of supports; `moves`: whether it moves its station with the load factor."""

    clamps, moves = False, False


@dataclass(frozen=True)
class Clamp(Support):
    """Position and rotation of a station are held as they are in the reference.

    Raises:
        SceneError: not a station.
    """

    station: StationOrName

    clamps = True

    def ties(self):
        """No constraints: the station has no unknowns left."""
        return ()


@dataclass(frozen=True)
class Pin(Support):
    """The position of a station is held; it may turn about every axis.

    Raises:
        SceneError: not a station.
    """

    station: StationOrName

    def ties(self):
        """The scalar constraints."""
        return same_place(self.station)


@dataclass(frozen=True)
class Hinge(Support):
    """The position of a station is held; it may turn about one axis, which is fixed in space.

    Args:
        station: where.
        axis: direction of the axis, inertial.

    Raises:
        SceneError: not a station, or an axis that is no direction.
    """

    station: StationOrName
    axis: UnitVector

    def ties(self):
        """The scalar constraints."""
        return (*same_place(self.station), *same_axis(self.station, None, self.axis))


@dataclass(frozen=True)
class Roller(Support):
    """A station stays in a plane; it may move along the plane and turn about every axis.

    Args:
        station: where.
        normal: direction of the plane's normal, inertial.

    Raises:
        SceneError: not a station, or a normal that is no direction.
    """

    station: StationOrName
    normal: UnitVector

    def ties(self):
        """The scalar constraints."""
        return (PositionTie(self.station, None, self.normal, 0.0),)


@dataclass(frozen=True)
class Prescribed(Support):
    """A station is moved in proportion to the load factor; displacement or rotation is free where None.

    Both motions may be functions of time (`signals`), with `jumps` where these are not smooth.

    Args:
        station: where.
        displacement: at load factor 1, m, inertial.
        rotation: rotation vector at load factor 1, rad; the section is rotated by the load factor times it.
        frame: of `rotation`: "inertial"; or "section", about d_1, d_2, d_3 of the section as it is in the reference or,
            in a `Stage`, at the begin of it.

    Raises:
        SceneError: not a station, numbers that are not finite, or neither of the two.
    """

    station: StationOrName
    displacement: Annotated[NumbersInTime, VectorInTime(Several("length"))] | None = None
    rotation: Annotated[NumbersInTime, VectorInTime(Several("angle"))] | None = None
    jumps: Numbers = ()
    frame: Literal["inertial", "section"] = "inertial"

    moves = True

    def validate(self):
        if self.displacement is None and self.rotation is None:
            refuse(self, "displacement", None, "a displacement (m) or a rotation (rad), or both")

    def ties(self):
        """The scalar constraints; at the time 0 where the motion depends on time."""
        now = at(self, 0.0)
        moved = () if now.displacement is None else same_place(self.station, None, now.displacement)
        if now.rotation is None:
            return moved
        if self.frame == "section":
            place = self.station
            return (*moved, *turned(place, place.rod.curve.frame(place.s) @ np.asarray(now.rotation)))
        return (*moved, *turned(self.station, now.rotation))


@dataclass(frozen=True)
class Joint(Part):
    """Two stations share their position and, unless released, their rotation.

    Args:
        first, second: stations at one point, of two rods, or the two ends of a closed one.
        release: None for a rigid joint; the axis of a hinge (inertial, in the reference), which moves with the rods;
            "all" for a ball joint.

    Raises:
        SceneError: not two stations, stations apart from each other, or a release that is none of these.
    """

    first: StationOrName
    second: StationOrName
    release: Numbers | str | None = None

    def validate(self):
        if isinstance(self.first, Station) and isinstance(self.second, Station):
            self._check_place()
        if isinstance(self.release, str):
            if self.release != "all":
                refuse(self, "release", self.release, "None, the direction of an axis, or 'all'")
        elif self.release is not None:
            store(self, release=direction(self, "release", self.release))

    def _check_place(self):
        if (self.first.rod, self.first.s) == (self.second.rod, self.second.s):
            refuse(self, "second", self.second, f"another station than first = {self.first}")
        a, b = (end.rod.curve.position(end.s).tolist() for end in (self.first, self.second))
        apart = math.dist(a, b)
        if apart > 1e-9 * max(self.first.rod.length, self.second.rod.length, *map(abs, a)):
            raise SceneError(
                f"Joint of {self.first} at ({_point(a)}) with {self.second} at ({_point(b)}): they are {apart:.3g} m "
                "apart: expected stations that touch"
            )

    @property
    def rigid(self):
        """Whether nothing is released."""
        return self.release is None

    def ties(self):
        """The scalar constraints of a joint that is not rigid."""
        held = same_place(self.first, self.second)
        return held if self.release == "all" else (*held, *same_axis(self.first, self.second, self.release))


def _point(x):
    return ", ".join(f"{value:.6g}" for value in x)


@dataclass(frozen=True, eq=False)
class InitialVelocity(Part):
    """Velocity of a rod at the time 0.

    Two vectors define a rigid motion: the point `about` has the velocity `linear`, and the rod rotates about it with
    `angular`. Where one of them is a function of the arc length, both are the velocities of each section itself.

    Args:
        rod: the rod.
        linear: m/s, inertial; or a function of arc length (m) that returns it.
        angular: rad/s, inertial; or a function of arc length (m) that returns it.
        about: m, the reference point of the rigid motion; None for the position of the rod's start at the time 0.

    Raises:
        SceneError: not a rod, not three finite numbers, or `about` without a rigid motion.
    """

    rod: RodOrName
    linear: Numbers | Callable[[float], Numbers] = (0.0, 0.0, 0.0)
    angular: Numbers | Callable[[float], Numbers] = (0.0, 0.0, 0.0)
    about: Annotated[Numbers, Several("length")] | None = None

    def validate(self):
        for field, unit in (("linear", "m/s"), ("angular", "rad/s")):
            if not callable(getattr(self, field)):
                store(self, **{field: vector(self, field, getattr(self, field), unit)})
        if self.about is not None and not self._rigid:
            refuse(self, "about", self.about, "None, since the velocity is a function of arc length")

    @property
    def _rigid(self):
        return not callable(self.linear) and not callable(self.angular)

    def at(self, s, position):
        """Velocities (n, 3), m/s, and angular velocities (n, 3), rad/s, inertial.

        Args:
            s: arc lengths (n,), m; position: of the rod there, (n, 3), m.

        Raises:
            SceneError: a function that does not return three finite numbers; says at which arc length.
        """
        linear, angular = self._along("linear", "m/s", s), self._along("angular", "rad/s", s)
        if self._rigid:
            about = position[0] if self.about is None else np.array(self.about)
            linear = linear + np.cross(angular, position - about)
        return linear, angular

    def _along(self, field, unit, s):
        value = getattr(self, field)
        if not callable(value):
            return np.tile(value, (len(s), 1))
        return np.array([vector_at(self, field, value, float(x), unit) for x in s])


_COLUMNS = "seven columns: time (s), three displacements (m), roll, pitch and yaw"


class _TableOrFile(FileName):
    """Rows of numbers, which its owner checks, or the name of a file."""

    words, class_ = "rows of numbers, or the name of a file", object


_Table = Annotated[Rows | str | PathLike[str], _TableOrFile()]
_Point = Annotated[tuple, Several("length")]
_FadeIn = Annotated[float, Number("time", Limits(0, what="a time"))]


@dataclass(frozen=True)
class _OfBody(FunctionOfTime):
    """Cubic splines through the rows of a table, which is held before the first and after the last row."""

    def validate(self):
        table = self.table
        if isinstance(table, str | PathLike):
            table = read_table(self, "table", table, 7, _COLUMNS)
        try:
            table = np.array(table, dtype=float)
        except (TypeError, ValueError):
            refuse(self, "table", self.table, f"numbers in {_COLUMNS}")
        if table.ndim != 2 or table.shape[1] != 7 or len(table) < 4 or not np.isfinite(table).all():
            refuse(self, "table", self.table, f"at least four rows of finite numbers in {_COLUMNS}")
        if not (np.diff(table[:, 0]) > 0).all():
            refuse(self, "table", self.table, "ascending times (s) in its first column")
        turn = 360.0 if self.degrees else 2 * np.pi
        table[:, 4:] = np.unwrap(table[:, 4:], axis=0, period=turn)  # headings that are kept within a turn
        if np.abs(np.diff(table[:, 4:], axis=0)).max() > turn / 4:
            refuse(self, "table", self.table, "angles that change by at most a quarter of a turn from row to row; "
                   "degrees = True where they are degrees")  # fmt: skip
        store(self, table=tuple(map(tuple, table.tolist())))

    @cached_property
    def _spline(self):
        from scipy.interpolate import CubicSpline

        table = np.array(self.table)
        if self.degrees:
            table[:, 4:] = np.radians(table[:, 4:])
        return CubicSpline(table[:, 0], table[:, 1:])

    @cached_property
    def _vectors(self):
        """(n, 3) rotation vectors of the rows, which change by less than half a turn from row to row."""
        found = [np.zeros(3)]
        for t in self._spline.x:
            found.append(_nearest(self._at(t)[1].as_rotvec(), found[-1]))
        return np.array(found[1:])

    def _at(self, t):
        """The displacement (3,) of the reference point, m, and the rotation, faded in."""
        from scipy.spatial.transform import Rotation

        times = self._spline.x
        x = min(max((t - times[0]) / self.fade_in, 0.0), 1.0) if self.fade_in else 1.0
        share = x**3 * (10 - 15 * x + 6 * x**2)  # smooth up to the acceleration
        values = share * self._spline(min(max(t, times[0]), times[-1]))
        return values[:3], Rotation.from_euler("ZYX", values[:2:-1])

    @property
    def jumps(self):
        """Where it is not smooth, s: at the ends of the table."""
        return self.table[0][0], self.table[-1][0]


@dataclass(frozen=True)
class BodyDisplacement(_OfBody):
    """The displacement, m, inertial, of a point of a rigid body whose six degrees of freedom a table holds over time.

    The body is turned by Rz(yaw) Ry(pitch) Rx(roll). Between the rows are cubic splines; before the first and after the
    last row it stays as it is there. For a `Prescribed` support, with `BodyRotation` of the same table.

    Args:
        table: (n, 7) rows of time (s), three displacements of the reference point (m, inertial), roll, pitch and yaw;
            or the name of a .csv file of these columns.
        degrees: whether the angles are degrees, not radians.
        point: the point in the reference position, m, as a rod's end that is held by the body.
        about: the reference point of the table, m, in the reference position.
        fade_in: over this time, s, from the first row on, the motion grows smoothly from none, so that it may begin
            from rest.

    Raises:
        SceneError: a file that cannot be read, other columns, fewer than four rows, times that do not ascend, or angles
            that change by more than a quarter of a turn from row to row.
    """

    table: _Table
    degrees: bool
    point: _Point
    about: _Point = (0.0, 0.0, 0.0)
    fade_in: _FadeIn = 0.0

    def __call__(self, t: float) -> tuple:
        """The displacement at t."""
        moved, turn = self._at(t)
        arm = np.subtract(self.point, self.about)
        return tuple((moved + turn.apply(arm) - arm).tolist())


@dataclass(frozen=True)
class BodyRotation(_OfBody):
    """The rotation vector, rad, inertial, of a rigid body whose six degrees of freedom a table holds over time.

    Args:
        table, degrees, fade_in: see `BodyDisplacement`.

    Raises:
        SceneError: as `BodyDisplacement`.
    """

    table: _Table
    degrees: bool
    fade_in: _FadeIn = 0.0

    def __call__(self, t: float) -> tuple:
        """The rotation vector at t, which is continuous: of more than half a turn where the body turns on."""
        near = [np.interp(t, self._spline.x, column) for column in self._vectors.T]
        return tuple(_nearest(self._at(t)[1].as_rotvec(), np.array(near)).tolist())


def _nearest(vector, other):
    """Of the rotation vectors of one rotation that which is nearest to another vector."""
    along = vector if np.linalg.norm(vector) > 1e-9 else other  # that of a whole turn has no axis of its own
    axis = along / max(np.linalg.norm(along), 1e-300)
    turns = np.round((other - vector) @ axis / (2 * np.pi))
    return vector + 2 * np.pi * turns * axis
