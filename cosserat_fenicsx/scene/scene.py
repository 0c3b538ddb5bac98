"""A scene: rods, what joins and holds them and what acts on them. Knows no solver and no mesh."""

import copy
from dataclasses import dataclass
from functools import cached_property

from cosserat_fenicsx.checks import instance
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.scene.initial import InitialVelocity
from cosserat_fenicsx.scene.joints import Joint
from cosserat_fenicsx.scene.loads import LOADS
from cosserat_fenicsx.scene.planes import find_plane
from cosserat_fenicsx.scene.rod import Rod, station_named
from cosserat_fenicsx.scene.signals import signals_of
from cosserat_fenicsx.scene.statical import check_held_once, touching
from cosserat_fenicsx.scene.supports import SUPPORTS

# Young's moduli below this, Pa, are those of gels, or slips of units.
_GEL = 1e6


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything a solver needs to know.

    Args:
        rods: the rods.
        supports: `Clamp`, `Pin`, `Hinge`, `Roller`, `Prescribed`.
        loads: `Force`, `Moment`, `EccentricForce`, `FollowerForce`, `FollowerMoment`, `LineForce`, `LineMoment`,
            `Weight`; all are multiplied by the load factor.
        joints: `Joint`s between stations that touch; rods without one stand by themselves.
        velocities: `InitialVelocity`s, at most one a rod; rods without one start at rest. For motions alone.
        title: for tables and pictures.

    Raises:
        SceneError: an empty or inconsistent scene, or one that is held twice. (A mechanism may move: statics refuses
            it.)
    """

    rods: tuple
    supports: tuple = ()
    loads: tuple = ()
    joints: tuple = ()
    title: str = ""
    velocities: tuple = ()

    #: s: for how long what depends on time is looked at beforehand
    horizon = 1.0

    def __post_init__(self):
        for field in ("rods", "supports", "loads", "joints", "velocities"):
            value = getattr(self, field)
            if not isinstance(value, list | tuple):
                raise SceneError(f"Scene.{field} = {value!r}: expected a list")
            object.__setattr__(self, field, tuple(value))
        if not self.rods:
            raise SceneError("Scene.rods is empty: expected at least one Rod")
        for i, rod in enumerate(self.rods):
            instance("Scene", f"rods[{i}]", rod, Rod, "a Rod")
        names = [rod.name for rod in self.rods]
        for name in names:
            if names.count(name) > 1:
                raise SceneError(f"Scene.rods: {names.count(name)} rods are named '{name}': expected one each")
        for i, support in enumerate(self.supports):
            instance("Scene", f"supports[{i}]", support, SUPPORTS, "a support such as Clamp(rod.start)")
            self._check_rod(f"supports[{i}]", support.station, support.station.rod)
        for i, joint in enumerate(self.joints):
            instance("Scene", f"joints[{i}]", joint, Joint, "a Joint(one.end, other.start)")
            for end in (joint.first, joint.second):
                self._check_rod(f"joints[{i}]", end, end.rod)
        for i, load in enumerate(self.loads):
            self._check_load(f"loads[{i}]", load)
        for i, velocity in enumerate(self.velocities):
            instance("Scene", f"velocities[{i}]", velocity, InitialVelocity, "an InitialVelocity(rod)")
            self._check_rod(f"velocities[{i}]", velocity.rod, velocity.rod)
            if velocity.rod in [other.rod for other in self.velocities[:i]]:
                raise SceneError(
                    f"Scene.velocities[{i}] is the second of rod '{velocity.rod.name}': expected one a rod"
                )
        check_held_once(self)
        object.__setattr__(self, "_leaders", self._find_leaders())

    def _check_load(self, field, load):
        if not hasattr(load, "work") or isinstance(load, type):
            instance("Scene", field, load, LOADS, "a load such as Force(rod.end, (0, 0, -1))")
        if load.station is not None:
            self._check_rod(field, load.station, load.station.rod)
            return
        if hasattr(load, "rod"):
            self._check_rod(field, load.rod, load.rod)
        for rod in self.rods:
            if load.acts_on(rod):
                load.check_rod(rod)

    def _check_rod(self, field, place, rod):
        if rod not in self.rods:
            raise SceneError(
                f"Scene.{field} acts at {place}, a station of a rod that is not in the scene: "
                f"expected one of {', '.join(rod.name for rod in self.rods)}"
            )

    def _find_leaders(self):
        """For every rod the first rod of the structure it is joined to."""
        leaders = {rod: rod for rod in self.rods}

        def find(rod):
            while leaders[rod] is not rod:
                rod = leaders[rod]
            return rod

        for joint in self.joints:
            one, other = sorted((find(joint.first.rod), find(joint.second.rod)), key=self.rods.index)
            leaders[other] = one
        return {rod: find(rod) for rod in self.rods}

    def leader(self, rod):
        """The first rod of the structure that a rod belongs to."""
        return self._leaders[rod]

    def origin(self, rod):
        """(3,) m: where the structure that a rod belongs to starts. Solvers count positions from there, so that digits
        are not lost on where a structure stands."""
        return self._leaders[rod].curve.position(0.0)

    def over(self, duration):
        """The same scene, looked at beforehand for so long (s)."""
        scene = copy.copy(self)
        scene.__dict__.pop("flatness", None)
        object.__setattr__(scene, "horizon", duration)
        return scene

    @cached_property
    def flatness(self):
        """(the `Plane` that everything keeps to, "") or (None, what leaves it, in words)."""
        return find_plane(self)

    @property
    def plane(self):
        """The `Plane` that everything keeps to, or None."""
        return self.flatness[0]

    @property
    def moving(self):
        """Its loads and supports that depend on time."""
        return [item for item in (*self.loads, *self.supports) if signals_of(item)]

    def line_loads(self, rod):
        """The loads that act along a rod."""
        return [load for load in self.loads if load.station is None and load.acts_on(rod)]

    def stations(self, rod):
        """All stations of a rod that supports, loads and joints name."""
        named = [x.station for x in (*self.supports, *self.loads) if x.station is not None]
        named += [end for joint in self.joints for end in (joint.first, joint.second)]
        return [station for station in named if station.rod is rod]

    @property
    def cautions(self):
        """What a user of any answer should know, in sentences."""
        return [*self.doubts, *self._following()]

    @cached_property
    def doubts(self):
        """What looks like a slip in the scene, in sentences."""
        return (*self._softness(), *self._thickness(), *self._unjoined())

    @property
    def follows(self):
        """Whether a load turns with its rod, so that it has no potential."""
        return bool(self._followers)

    @property
    def _followers(self):
        return [load for load in self.loads if getattr(load, "follows", False)]

    def _softness(self):
        """Young's moduli that may be in other units."""
        soft = {rod.material.E for rod in self.rods if rod.material is not None and rod.material.E < _GEL}
        return [
            f"E = {E:g} Pa is softer than rubber: are the units SI (N, m, Pa; steel has 210e9)?" for E in sorted(soft)
        ]

    def _thickness(self):
        """Sections that may be in other units."""
        for rod in self.rods:
            section = rod.section_at(0.0)
            across = max(getattr(section, name, 0.0) for name in ("diameter", "outer_diameter", "width", "height"))
            if across >= rod.length:
                yield f"rod '{rod.name}' is {across:g} m across and {rod.length:g} m long: are all lengths in m?"

    def _unjoined(self):
        """Ends of different structures at one point, where not both are held."""
        held, told = [support.station for support in self.supports], []
        for end, other in touching(self):
            if not (end in held and other in held) and (other, end) not in told:
                told.append((end, other))
                yield f"{end} and {other} lie at one point and are not joined: if they should be, add Joint({end}, {other})"

    def _following(self):
        if not self.follows:
            return []
        kinds = " and ".join(dict.fromkeys(type(load).__name__ for load in self._followers))
        return [
            f"{kinds}: a follower load has no potential, so negative modes, which are those of the tangent's symmetric part, do not "
            "decide on stability: an equilibrium that has some may be stable (Beck's column from pi^2 to 20.05 EI/L^2), one that has "
            "none may flutter, which statics cannot see; only dynamics can tell"
        ]

    def station(self, name):
        """The station 'rod.start', 'rod.end' or 'rod@s', s in m, as scene files name it.

        Raises:
            SceneError: there is none of that name.
        """
        return station_named("station", name, {rod.name: rod for rod in self.rods})

    def rod(self, name):
        """The rod of that name.

        Raises:
            SceneError: there is none of that name.
        """
        for rod in self.rods:
            if rod.name == name:
                return rod
        raise SceneError(f"no rod is named {name!r}, {nearest(name, [rod.name for rod in self.rods])}")
