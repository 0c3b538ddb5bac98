"""Supports of rods.

A support either removes all unknowns of a station (`clamps`) or defines scalar constraints there (`ties`); no model
or solver refers to a support by name.
"""

from dataclasses import dataclass

from cosserat_fenicsx.checks import Numbers, NumbersInTime, direction, refuse, store
from cosserat_fenicsx.scene import ties
from cosserat_fenicsx.scene.rod import Station, StationOrName, is_known
from cosserat_fenicsx.scene.signals import at, vector_or_signal


@dataclass(frozen=True)
class Clamp:
    """Position and rotation of a station are held as they are in the reference.

    Raises:
        SceneError: not a station.
    """

    station: StationOrName

    clamps = True

    def __post_init__(self):
        is_known(self, "station", Station)

    def ties(self):
        """No constraints: the station has no unknowns left."""
        return ()


@dataclass(frozen=True)
class Pin:
    """The position of a station is held; it may turn about every axis.

    Raises:
        SceneError: not a station.
    """

    station: StationOrName

    clamps = False

    def __post_init__(self):
        is_known(self, "station", Station)

    def ties(self):
        """The scalar constraints."""
        return ties.same_place(self.station)


@dataclass(frozen=True)
class Hinge:
    """The position of a station is held; it may turn about one axis, which is fixed in space.

    Args:
        station: where.
        axis: direction of the axis, inertial.

    Raises:
        SceneError: not a station, or an axis that is no direction.
    """

    station: StationOrName
    axis: Numbers

    clamps = False

    def __post_init__(self):
        is_known(self, "station", Station)
        store(self, axis=direction(self, "axis", self.axis))

    def ties(self):
        """The scalar constraints."""
        return (*ties.same_place(self.station), *ties.same_axis(self.station, None, self.axis))


@dataclass(frozen=True)
class Roller:
    """A station stays in a plane; it may move along the plane and turn about every axis.

    Args:
        station: where.
        normal: direction of the plane's normal, inertial.

    Raises:
        SceneError: not a station, or a normal that is no direction.
    """

    station: StationOrName
    normal: Numbers

    clamps = False

    def __post_init__(self):
        is_known(self, "station", Station)
        store(self, normal=direction(self, "normal", self.normal))

    def ties(self):
        """The scalar constraints."""
        return (ties.PositionTie(self.station, None, self.normal, 0.0),)


@dataclass(frozen=True)
class Prescribed:
    """A station is moved in proportion to the load factor; displacement or rotation is free where None.

    Both motions may be functions of time (`signals`), with `jumps` where these are not smooth.

    Args:
        station: where.
        displacement: at load factor 1, m, inertial.
        rotation: rotation vector at load factor 1, rad, inertial; the section is rotated by the load factor times it.

    Raises:
        SceneError: not a station, numbers that are not finite, or neither of the two.
    """

    station: StationOrName
    displacement: NumbersInTime | None = None
    rotation: NumbersInTime | None = None
    jumps: Numbers = ()

    clamps = False

    def __post_init__(self):
        is_known(self, "station", Station)
        if self.displacement is None and self.rotation is None:
            refuse(self, "displacement", None, "a displacement (m) or a rotation (rad), or both")
        given = [("displacement", self.displacement, "m"), ("rotation", self.rotation, "rad")]
        moving = any(callable(value) for _, value, _ in given)
        for field, value, unit in given:
            if value is not None:
                jumps = () if moving and not callable(value) else self.jumps
                store(self, **{field: vector_or_signal(self, field, value, unit, jumps)})

    def ties(self):
        """The scalar constraints; at the time 0 where the motion depends on time."""
        now = at(self, 0.0)
        moved = () if now.displacement is None else ties.same_place(self.station, None, now.displacement)
        return moved if now.rotation is None else (*moved, *ties.turned(self.station, now.rotation))


#: Supports that scene files know.
SUPPORTS = (Clamp, Pin, Hinge, Roller, Prescribed)
Support = Clamp | Pin | Hinge | Roller | Prescribed
