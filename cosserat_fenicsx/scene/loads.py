"""Loads: forces and moments at points and along rods, and weight; all scaled by the load factor, unless `permanent`.

The force or moment of a load is a vector, or a function of time (`signals`) with `jumps` where it is not smooth; that
of a distributed load may be a function of the arc length (`along`). Virtual works: forms/loads.py.
"""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import Numbers, NumbersInTime, instance, refuse, store, vector
from cosserat_fenicsx.parts import FunctionAlong
from cosserat_fenicsx.scene import action
from cosserat_fenicsx.scene.action import LineAction, PointAction
from cosserat_fenicsx.scene.rod import Rod, RodOrName, Station, StationOrName, is_known
from cosserat_fenicsx.scene.signals import (
    along_or_vector,
    breaks_of,
    kinks_of,
    values_of,
    vector_or_signal,
)


@dataclass(frozen=True)
class _WeightOffAxis(LineAction):
    """The moment R a x rho A g per unit of reference length about the axis of an eccentric rod; `Weight` adds it.

    Args:
        rod: a rod with an eccentricity.
        gravity, permanent: as those of the `Weight`, whose force it leaves out.
    """

    rod: Rod
    gravity: Numbers
    permanent: bool = False

    work = "moment_on_arm"

    @property
    def scaled(self):
        """See `Action`."""
        return not self.permanent

    def data(self, rod, s):
        force = rod.stiffness_at(s).mass[..., None] * np.asarray(self.gravity)
        arm = np.einsum("...ij,...j->...i", rod.curve.frame(s), rod.mass_centre.at(s))
        return action.vector(force, "N/m"), action.vector(arm, "m")


class Load:
    """An action scaled by the load factor, or, if `permanent`, applied before; must be the first base of a class."""

    permanent = False

    @property
    def scaled(self):
        """See `Action`."""
        return not self.permanent

    def _check_permanent(self):
        instance(self, "permanent", self.permanent, bool, "True or False")


class PointLoad(Load, PointAction):
    """A load at a station."""

    def _check(self, field, unit):
        is_known(self, "station", Station)
        store(self, **{field: vector_or_signal(self, field, getattr(self, field), unit, self.jumps)})
        self._check_permanent()

    def _turned(self, rod, a):
        """Inertial components of the vector with the material components a, in the reference."""
        return rod.curve.frame(self.station.s) @ np.asarray(a)


@dataclass(frozen=True)
class Force(PointLoad):
    """A dead point force.

    Args:
        station: where it acts.
        force: N, inertial; it keeps its direction.
        permanent: whether it is applied in full, before all loads that the load factor multiplies.

    Raises:
        SceneError: not a station, or not three finite numbers nor a function of time.
    """

    station: StationOrName
    force: NumbersInTime
    jumps: Numbers = ()
    permanent: bool = False

    work = "force"

    def __post_init__(self):
        self._check("force", "N")

    def data(self, rod, s):
        return (action.vector(self.force, "N"),)


@dataclass(frozen=True)
class Moment(PointLoad):
    """A dead point moment.

    Args:
        station: where it acts.
        moment: N m, inertial; it keeps its direction.
        permanent: whether it is applied in full, before all loads that the load factor multiplies.

    Raises:
        SceneError: not a station, or not three finite numbers nor a function of time.
    """

    station: StationOrName
    moment: NumbersInTime
    jumps: Numbers = ()
    permanent: bool = False

    work = "moment"

    def __post_init__(self):
        self._check("moment", "N m")

    def data(self, rod, s):
        return (action.vector(self.moment, "N m"),)


@dataclass(frozen=True)
class EccentricForce(PointLoad):
    """A dead point force at the end of a rigid arm that turns with the section.

    Args:
        station: where the arm sits.
        force: N, inertial.
        offset: (a1, a2), the arm along d_1 and d_2, m.
        permanent: whether it is applied in full, before all loads that the load factor multiplies.

    Raises:
        SceneError: not a station, or numbers that are not finite.
    """

    station: StationOrName
    force: NumbersInTime
    offset: Numbers
    jumps: Numbers = ()
    permanent: bool = False

    work = "eccentric_force"

    def __post_init__(self):
        self._check("force", "N")
        store(self, offset=vector(self, "offset", self.offset, "m", size=2))

    def data(self, rod, s):
        return (action.vector(self.force, "N"), action.vector(self._turned(rod, [*self.offset, 0.0]), "m"))


@dataclass(frozen=True)
class FollowerForce(PointLoad):
    """A point force that turns with the section.

    Args:
        station: where it acts.
        force: N, material: along d_1, d_2, d_3 of the moving section.
        permanent: whether it is applied in full, before all loads that the load factor multiplies.

    Raises:
        SceneError: not a station, or not three finite numbers nor a function of time.
    """

    station: StationOrName
    force: NumbersInTime
    jumps: Numbers = ()
    permanent: bool = False

    work, follows = "follower_force", True

    def __post_init__(self):
        self._check("force", "N")

    def data(self, rod, s):
        return (action.vector(self._turned(rod, self.force), "N"),)


@dataclass(frozen=True)
class FollowerMoment(PointLoad):
    """A point moment that turns with the section.

    Args:
        station: where it acts.
        moment: N m, material: about d_1, d_2, d_3 of the moving section.
        permanent: whether it is applied in full, before all loads that the load factor multiplies.

    Raises:
        SceneError: not a station, or not three finite numbers nor a function of time.
    """

    station: StationOrName
    moment: NumbersInTime
    jumps: Numbers = ()
    permanent: bool = False

    work, follows = "follower_moment", True

    def __post_init__(self):
        self._check("moment", "N m")

    def data(self, rod, s):
        return (action.vector(self._turned(rod, self.moment), "N m"),)


@dataclass(frozen=True)
class Weight(Load, LineAction):
    """The weight of all rods and point masses of the scene; of a rod, rho A g per unit of reference length, which acts
    at its mass centre (`Rod.eccentricity`).

    Args:
        gravity: m/s^2, inertial.
        permanent: whether it is applied in full, before all loads that the load factor multiplies.

    Raises:
        SceneError: not three finite numbers; a rod without mass (raised by `Scene`).
    """

    gravity: Numbers = (0.0, 0.0, -9.81)
    permanent: bool = False

    work, rod = "force", None

    def __post_init__(self):
        store(self, gravity=vector(self, "gravity", self.gravity, "m/s^2"))
        self._check_permanent()

    def check_rod(self, rod):
        """Refuse a rod without mass."""
        if rod.profile.range[0].mass is None:
            field = "Stiffness.mass" if rod.material is None else "Material.density"
            refuse(f"Rod '{rod.name}': {field.split('.')[0]}", field.split(".")[1], None, "a value, which Weight needs")

    def acts_on(self, rod):
        """All rods have weight."""
        return True

    def data(self, rod, s):
        return (action.vector(rod.stiffness_at(s).mass[..., None] * np.asarray(self.gravity), "N/m"),)

    def companions(self, scene):
        """The weights of the point masses, and the moments of that of eccentric rods about their axes."""
        masses = [(x, x.inertia(x.station.rod)) for x in scene.loads if x.station is not None]
        weights = tuple(
            Force(x.station, tuple(found[0] * g for g in self.gravity), permanent=self.permanent)
            for x, found in masses
            if found is not None
        )
        offset = [rod for rod in scene.rods if rod.mass_centre]
        return (*weights, *(_WeightOffAxis(rod, self.gravity, self.permanent) for rod in offset))


class LineLoad(Load, LineAction):
    """A dead load along a rod, per unit of reference length."""

    def _check(self, field, unit):
        is_known(self, "rod", Rod)
        given = along_or_vector(self, field, getattr(self, field), self.rod)
        if given is None:
            given = vector_or_signal(self, field, getattr(self, field), unit, self.jumps)
        store(self, **{field: given})
        self._check_permanent()


@dataclass(frozen=True)
class LineForce(LineLoad):
    """A dead force along a rod, per unit of reference length.

    Args:
        rod: the rod.
        force: N/m, inertial: three numbers, a function of time, or `Along`, `AlongTable`, `AlongPieces` where it
            changes along the rod.
        permanent: whether it is applied in full, before all loads that the load factor multiplies.

    Raises:
        SceneError: not a rod, or not three finite numbers nor a function.
    """

    rod: RodOrName
    force: NumbersInTime | FunctionAlong
    jumps: Numbers = ()
    permanent: bool = False

    work = "force"

    def __post_init__(self):
        self._check("force", "N/m")

    def data(self, rod, s):
        return (action.vector(values_of(self.force, s), "N/m"),)

    def breaks(self, rod):
        return breaks_of(self.force)

    def kinks(self, rod):
        return kinks_of(self.force)


@dataclass(frozen=True)
class LineMoment(LineLoad):
    """A dead moment along a rod, per unit of reference length.

    Args:
        rod: the rod.
        moment: N m/m, inertial; given as the force of a `LineForce`.
        permanent: whether it is applied in full, before all loads that the load factor multiplies.

    Raises:
        SceneError: not a rod, or not three finite numbers nor a function.
    """

    rod: RodOrName
    moment: NumbersInTime | FunctionAlong
    jumps: Numbers = ()
    permanent: bool = False

    work = "moment"

    def __post_init__(self):
        self._check("moment", "N m/m")

    def data(self, rod, s):
        return (action.vector(values_of(self.moment, s), "N m/m"),)

    def breaks(self, rod):
        return breaks_of(self.moment)

    def kinks(self, rod):
        return kinks_of(self.moment)
