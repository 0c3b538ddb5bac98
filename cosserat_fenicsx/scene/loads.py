"""What acts on a rod. All loads are multiplied by the load factor.

Force and moment of a load are vectors, or functions of time (`signals`) with `jumps` where these are not smooth;
vectors and densities are then asked of what `signals.at` makes of it.

A load says where it acts (`station`, or None for a line load), which function of `forms.loads` is its virtual work, and
the vectors that function takes, each with its unit. A point load gives them once (`vectors(rod)`); a line load says
which rods it acts on (`acts_on`) and gives a density along them (`density(rod, s)`, shape (n, 3)) of one `unit`. Nothing else in
the package knows a load by name.
"""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import instance, refuse, store, vector
from cosserat_fenicsx.scene.rod import Rod, Station
from cosserat_fenicsx.scene.signals import vector_or_signal


@dataclass(frozen=True)
class Force:
    """A dead point force.

    Args:
        station: where it acts.
        force: N, inertial; it keeps its direction.

    Raises:
        SceneError: not a station, or not three finite numbers nor a function of time.
    """

    station: Station
    force: object
    jumps: tuple = ()

    work = "force"

    def __post_init__(self):
        _check_station(self)
        store(self, force=vector_or_signal(self, "force", self.force, "N", self.jumps))

    def vectors(self, rod):
        """The vectors of the virtual work, with their units."""
        return ((self.force, "force"),)


@dataclass(frozen=True)
class Moment:
    """A dead point moment.

    Args:
        station: where it acts.
        moment: N m, inertial; it keeps its direction.

    Raises:
        SceneError: not a station, or not three finite numbers nor a function of time.
    """

    station: Station
    moment: object
    jumps: tuple = ()

    work = "moment"

    def __post_init__(self):
        _check_station(self)
        store(self, moment=vector_or_signal(self, "moment", self.moment, "N m", self.jumps))

    def vectors(self, rod):
        """The vectors of the virtual work, with their units."""
        return ((self.moment, "moment"),)


@dataclass(frozen=True)
class EccentricForce:
    """A dead point force at the end of a rigid arm that turns with the section.

    Args:
        station: where the arm sits.
        force: N, inertial.
        offset: (a1, a2), the arm along d_1 and d_2, m.

    Raises:
        SceneError: not a station, or numbers that are not finite.
    """

    station: Station
    force: object
    offset: tuple
    jumps: tuple = ()

    work = "eccentric_force"

    def __post_init__(self):
        _check_station(self)
        store(self, force=vector_or_signal(self, "force", self.force, "N", self.jumps))
        store(self, offset=vector(self, "offset", self.offset, "m", size=2))

    def vectors(self, rod):
        """The vectors of the virtual work, with their units."""
        arm = rod.curve.frame(self.station.s) @ np.array([*self.offset, 0.0])
        return ((self.force, "force"), (arm, "length"))


@dataclass(frozen=True)
class FollowerForce:
    """A point force that turns with the section.

    Args:
        station: where it acts.
        force: N, material: along d_1, d_2, d_3 of the moving section.

    Raises:
        SceneError: not a station, or not three finite numbers nor a function of time.
    """

    station: Station
    force: object
    jumps: tuple = ()

    work, follows = "follower_force", True

    def __post_init__(self):
        _check_station(self)
        store(self, force=vector_or_signal(self, "force", self.force, "N", self.jumps))

    def vectors(self, rod):
        """The vectors of the virtual work, with their units."""
        return ((rod.curve.frame(self.station.s) @ self.force, "force"),)


@dataclass(frozen=True)
class FollowerMoment:
    """A point moment that turns with the section.

    Args:
        station: where it acts.
        moment: N m, material: about d_1, d_2, d_3 of the moving section.

    Raises:
        SceneError: not a station, or not three finite numbers nor a function of time.
    """

    station: Station
    moment: object
    jumps: tuple = ()

    work, follows = "follower_moment", True

    def __post_init__(self):
        _check_station(self)
        store(self, moment=vector_or_signal(self, "moment", self.moment, "N m", self.jumps))

    def vectors(self, rod):
        """The vectors of the virtual work, with their units."""
        return ((rod.curve.frame(self.station.s) @ self.moment, "moment"),)


@dataclass(frozen=True)
class Weight:
    """The weight of every rod of the scene, rho A g per unit of reference length.

    Args:
        gravity: m/s^2, inertial.

    Raises:
        SceneError: not three finite numbers; a rod without mass (raised by `Scene`).
    """

    gravity: tuple = (0.0, 0.0, -9.81)

    work, unit = "line_force", "force per length"
    station = None

    def __post_init__(self):
        store(self, gravity=vector(self, "gravity", self.gravity, "m/s^2"))

    def check_rod(self, rod):
        """Refuse a rod without mass."""
        if rod.profile.range[0].mass is None:
            field = "Stiffness.mass" if rod.material is None else "Material.density"
            refuse(f"Rod '{rod.name}': {field.split('.')[0]}", field.split(".")[1], None, "a value, which Weight needs")

    def acts_on(self, rod):
        """All rods have weight."""
        return True

    def density(self, rod, s):
        """(n, 3) N/m, inertial, per unit of reference length at the arc lengths s (n,)."""
        return rod.stiffness_at(s).mass[..., None] * np.asarray(self.gravity)


@dataclass(frozen=True)
class LineForce:
    """A dead force along a rod, per unit of reference length.

    Args:
        rod: the rod.
        force: N/m, inertial.

    Raises:
        SceneError: not a rod, or not three finite numbers nor a function of time.
    """

    rod: Rod
    force: object
    jumps: tuple = ()

    work, unit = "line_force", "force per length"
    station = None

    def __post_init__(self):
        instance(self, "rod", self.rod, Rod, "a Rod")
        store(self, force=vector_or_signal(self, "force", self.force, "N/m", self.jumps))

    def check_rod(self, rod):
        """Any rod will do."""

    def acts_on(self, rod):
        """Its rod alone."""
        return rod is self.rod

    def density(self, rod, s):
        """(n, 3) N/m, inertial, at the arc lengths s (n,)."""
        return np.broadcast_to(self.force, (len(s), 3))


@dataclass(frozen=True)
class LineMoment:
    """A dead moment along a rod, per unit of reference length.

    Args:
        rod: the rod.
        moment: N m/m, inertial.

    Raises:
        SceneError: not a rod, or not three finite numbers nor a function of time.
    """

    rod: Rod
    moment: object
    jumps: tuple = ()

    work, unit = "line_moment", "force"
    station = None

    def __post_init__(self):
        instance(self, "rod", self.rod, Rod, "a Rod")
        store(self, moment=vector_or_signal(self, "moment", self.moment, "N m/m", self.jumps))

    def check_rod(self, rod):
        """Any rod will do."""

    def acts_on(self, rod):
        """Its rod alone."""
        return rod is self.rod

    def density(self, rod, s):
        """(n, 3) N m/m, inertial, at the arc lengths s (n,)."""
        return np.broadcast_to(self.moment, (len(s), 3))


def _check_station(load):
    instance(load, "station", load.station, Station, "a station such as rod.end")


#: Loads by the words of the scene file.
LOADS = (Force, Moment, EccentricForce, FollowerForce, FollowerMoment, LineForce, LineMoment, Weight)
