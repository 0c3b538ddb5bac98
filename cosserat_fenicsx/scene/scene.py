"""A scene: rods, joints, supports and actions, independent of solvers and meshes; and plausibility checks of its
numbers."""

import contextlib
import copy
import dataclasses
from collections import Counter, namedtuple
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np

from cosserat_fenicsx.checks import instance, refuse, store, warn
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.parts import Items, Object, Part, concerning
from cosserat_fenicsx.scene.action import Action, describe, part_in_words, powers, some_of
from cosserat_fenicsx.scene.curves import Line, Spline
from cosserat_fenicsx.scene.planes import bent_weakly, find_plane
from cosserat_fenicsx.scene.profiles import Stiffnesses
from cosserat_fenicsx.scene.rod import Rod, Station, StationOrName, station_named, with_names
from cosserat_fenicsx.scene.rolled import Profile
from cosserat_fenicsx.scene.sections import Circle, Rectangle, Tube, sizes_across
from cosserat_fenicsx.scene.signals import at, sample_times, signals_of
from cosserat_fenicsx.scene.stages import Places, Stage, legs_of, named_stages, scene_of
from cosserat_fenicsx.scene.statical import Groups, check_held_once, touching
from cosserat_fenicsx.scene.supports import Clamp, InitialVelocity, Joint, Support

# Largest load over the largest EA, and over EI/L^2 where a rod's EA is infinite: beyond, rounding errors dominate.
_MOST_STRAIN, _MOST_BENDING = 1e6, 1e15
# Largest load over EA of metals and other stiff materials, with a Young's modulus (Pa) from which on they are; and of
# materials whose modulus is doubted.
_MOST_OF_STIFF, _STIFF, _MOST_OF_SOFT = 0.5, 1e9, 10.0
# Largest prescribed displacement over the longest rod, and largest prescribed rotation, rad.
_MOST_MOTION = 1e6
# Bending stiffnesses about two axes that differ by less are those of a round or a square section.
_ALIKE = 1e-9
# Samples of a distributed load along a rod.
_SAMPLES = 9
# Young's moduli below this, Pa, are probably mistakes in units; of materials of these densities, kg/m^3, below this.
_SOFTEST, _RUBBER, _SOFTEST_RUBBER = 1e6, (900.0, 1500.0), 1e4
# Densities, kg/m^3, and moduli, Pa, of steel and cast iron; rolled profiles are of these. And of metals, in g/cm^3.
_STEEL, METAL, _GRAMS = (7000.0, 8200.0), (5e10, 5e11), (1.5, 25.0)
_WAY_OUT = " (a Stiffness in its place is not doubted)"
_ROUNDING = "beyond which rounding errors dominate"
_UNITS = 'are the units SI (N, m, Pa; steel has 210e9, or "210 GPa")'

#: share: the size over the largest one allowed; scaled: whether the load factor multiplies it; words: text that gives
#: the load or support and its size; most: the largest size allowed, as text.
Magnitude = namedtuple("Magnitude", "share scaled words most")


def magnitudes(scene, doubts=True):
    """The `Magnitude`s of the loads and prescribed motions of a scene; doubts: whether a Young's modulus is doubted."""
    length = max(rod.length for rod in scene.rods)
    K, J = ([float(getattr(rod.profile.range[1], name).max()) for rod in scene.rods] for name in "KJ")
    limits = [_doubted(rod) if doubts else ("", _MOST_STRAIN) for rod in scene.rods]
    most, k = max((size * strain, k) for k, (size, (_, strain)) in enumerate(zip(K, limits, strict=True)))
    doubt, strain = limits[k]
    why = f"{f'where {doubt}' if doubt else 'beyond which no such material is elastic'}{_WAY_OUT}"
    limit, why = f"{strain:g} EA", why if strain < _MOST_STRAIN else _ROUNDING
    # the arm by which a moment strains a section as much as a force does, where strains are bounded
    lever = np.sqrt(J[k] / K[k]) if strain <= _MOST_OF_STIFF and np.isfinite(most) else length
    if np.isinf(most):
        most = _MOST_BENDING * max(J) / length**2
        limit, why = f"{_MOST_BENDING:g} EI/L^2", _ROUNDING
    found = []
    for load in scene.loads:
        if load.scaled or load.permanent:
            sizes = [(0.0, 0.0), *(_sizes(now, scene) for now in _sampled(load, scene.horizon))]
            force, moment = np.max(sizes, axis=0)
            if moment / lever > force:
                size, arm, times, unit = moment, lever, f" times {lever:.3g} m", "N m"
            else:
                size, arm, times, unit = force, 1.0, "", "N"
            told = f"{limit}{times} = {most * arm:.3g} {unit}, {why}"
            found.append(Magnitude(size / (most * arm), load.scaled, f"{describe(load)}: {size:.3g} {unit}", told))
    for support in scene.supports:
        for name, most, unit in (("displacement", _MOST_MOTION * length, "m"), ("rotation", _MOST_MOTION, "rad")):
            moves = [getattr(now, name, None) for now in _sampled(support, scene.horizon)]
            size = max((float(np.linalg.norm(move)) for move in moves if move is not None), default=0.0)
            words = f"{describe(support)}: a {name} of {size:.3g} {unit}"
            found.append(Magnitude(size / most, True, words, f"{most:.3g} {unit}, {_ROUNDING}"))
    return tuple(found)


def _doubted(rod):
    """Why a rod's Young's modulus may be in wrong units, or "", and the largest load over EA that is plausible then."""
    if rod.material is None:
        return "", _MOST_STRAIN
    E, density = rod.material.E, rod.material.density
    metal = f"of a material of {density:g} kg/m^3" if _STEEL[0] <= (density or 0) <= _STEEL[1] else ""
    if isinstance(rod.section_at(0.0), Profile):
        metal = metal or "of a rolled profile"
    if metal and not METAL[0] <= E <= METAL[1]:
        low = E < METAL[0]
        told = f"E = {E:g} Pa {metal} is {'less' if low else 'more'} than that of steel or cast iron"
        return told, _MOST_OF_STIFF if low else _MOST_STRAIN
    if E < (_SOFTEST_RUBBER if _RUBBER[0] <= (density or 0) <= _RUBBER[1] else _SOFTEST):
        return f"E = {E:g} Pa is softer than most rubbers", _MOST_OF_SOFT
    return "", _MOST_OF_STIFF if E >= _STIFF else _MOST_STRAIN


def _sampled(item, until):
    """A load or a support at sample times up to `until`, s, without those at which a function of time fails."""
    for t in sample_times(item, until):
        with contextlib.suppress(SceneError):
            yield at(item, t)


def _sizes(load, scene):
    """The largest force (N) and the largest moment (N m) of a load; loads per length are multiplied by that of the rod.
    Coefficients of rates, as of drag, are no loads."""
    force, moment = 0.0, 0.0
    for rod in scene.rods_of(load):
        s = np.zeros(1) if load.station is not None else np.linspace(0.0, rod.length, _SAMPLES)
        for datum in load.data(rod, s):
            is_force, lengths, times = powers(datum.unit)
            if is_force and not times:
                size = abs(load.amplitude) * float(np.linalg.norm(np.atleast_2d(datum.value), axis=-1).max())
                if lengths > 0:
                    moment = max(moment, size * rod.length ** (1 - lengths))
                else:
                    force = max(force, size / rod.length**lengths)
    return force, moment


def check_magnitudes(scene, load_factor, doubts=True):
    """Refuse (SceneError) loads and prescribed motions so large that rounding errors would dominate; doubts: or that a
    Young's modulus must be in wrong units."""
    for share, scaled, words, most in scene.magnitudes if doubts else magnitudes(scene, doubts):
        factor = abs(load_factor) if scaled else 1.0
        if share * factor > 1:
            times = f" times the load factor {factor:g}" if factor != 1 else ""
            raise SceneError(f"{words}{times}: expected at most {most}: {_UNITS}?")


def check_tensions(scene, load_factors, leg=None):
    """Refuse (SceneError) load factors, of a `Leg` or a scene without stages, that give a thread negative tension."""
    for load in scene.all_loads:
        given = not load.shortens or (leg and leg.releases(load))
        for factor in load_factors if load.is_thread and given else ():
            share = leg.share_of(load, factor) if leg else factor if load.scaled else 1.0
            if share < 0:
                raise SceneError(
                    f"load factor {factor:g}: the tension of {describe(load)} would be {share:g} times the given one: "
                    "expected load factors at which no tendon is pressed"
                )


# Places along a rod at which tendons are compared with its surface.
_ALONG_TENDON = 33
# Solid bars of metal that are thicker, m, are probably given in mm.
_THICKEST = 1.5
# Rolled profiles that are longer, over their heights, are probably given in mm.
_LONGEST = 500
# Share of a tube's outer diameter below which its inner one is doubted.
_SMALL_BORE = 0.2
# Warnings of one kind that are listed.
_TOLD = 5
_PARTS = {
    "supports": (Support, "a support such as Clamp(rod.start)"),
    "joints": (Joint, "a Joint(one.end, other.start)"),
    "loads": (Action, "a load such as Force(rod.end, (0, 0, -1)), or another Action"),
    "velocities": (InitialVelocity, "an InitialVelocity(rod)"),
}


def _where_it_belongs(item):
    """The list of a scene that takes an item, in words; "" where none does."""
    field = next((name for name, (kind, _) in _PARTS.items() if isinstance(item, kind)), None)
    return f"; {part_in_words(item)} belongs in {field}=, Scene(rods, supports, loads, joints)" if field else ""


@dataclass(frozen=True, eq=False)
class Scene(Part):
    """The complete input of a solver.

    Args:
        rods: the rods.
        supports: `Clamp`, `Pin`, `Hinge`, `Roller`, `Prescribed`.
        loads: actions on the rods: `Force`, `Moment`, `EccentricForce`, `FollowerForce`, `FollowerMoment`, `LineForce`,
            `LineMoment`, `Weight`, which are multiplied by the load factor or `permanent`; `Spring`, `Foundation`,
            `Dashpot`, `Drag`, `PointMass`, `Wall`; `Actuation`, `Thermal`, `Growth`, `Pretension`; or an `Action` of
            your own.
        joints: each a `Joint` between stations that touch; rods without a joint are independent of each other.
        velocities: each an `InitialVelocity`, at most one per rod; rods without one start at rest. For motions only.
        stages: each a `Stage`, which starts from where the scene's own loads and the stages before have led. For
            `solve` only.
        title: for tables and pictures.

    Raises:
        SceneError: an empty or inconsistent scene, or redundant supports or joints. (Mechanisms are allowed in motions;
            statics refuses them.)
    """

    rods: Annotated[Sequence[Rod], Items(Object((Rod,)))]
    supports: Sequence[Support] = ()
    loads: Sequence[Action] = ()
    joints: Sequence[Joint] = ()
    title: str = dataclasses.field(default="", compare=False)
    velocities: Sequence[InitialVelocity] = ()
    stages: Sequence[Stage] = ()

    #: time (s) up to which functions of time are sampled, see `over`
    horizon = 1.0
    #: {name: Material} of the scene file it was read from
    materials = {}
    #: of the scene of one stage: the scene with all
    _whole = None

    def __post_init__(self):
        for field in ("rods", "supports", "loads", "joints", "velocities", "stages"):
            value = getattr(self, field)
            if not isinstance(value, list | tuple):
                raise SceneError(f"Scene.{field} = {value!r}: expected a list")
            store(self, **{field: tuple(value)})
        if not self.rods:
            raise SceneError("Scene.rods is empty: expected at least one Rod")
        for i, rod in enumerate(self.rods):
            instance("Scene", f"rods[{i}]", rod, Rod, "a Rod")
        for name, count in Counter(rod.name for rod in self.rods).items():
            if count > 1:
                raise SceneError(f"Scene.rods: {count} rods are named '{name}': expected one each")
        by_name, numbers = {rod.name: rod for rod in self.rods}, {rod: i for i, rod in enumerate(self.rods)}
        store(self, _by_name=by_name, _numbers=numbers, _given=self.supports, _given_loads=self.loads)
        for field in _PARTS:
            items = []
            for i, x in enumerate(getattr(self, field)):
                with concerning(field, i):
                    items.append(with_names(f"Scene.{field}[{i}]", x, by_name))
            store(self, **{field: tuple(items)})
        for field, (kind, expected) in _PARTS.items():
            for i, item in enumerate(getattr(self, field)):
                if not isinstance(item, kind):
                    refuse("Scene", f"{field}[{i}]", item, f"{expected}{_where_it_belongs(item)}")
                self._check_places(f"{field}[{i}]", item)
        first = {}
        for i, velocity in enumerate(self.velocities):
            if first.setdefault(velocity.rod, i) != i:
                raise SceneError(
                    f"Scene.velocities[{i}] is the second of rod '{velocity.rod.name}': expected one a rod"
                )
        check_held_once(self)
        store(self, _leaders=self._find_leaders())
        for load in self.all_loads:
            load.check_scene(self)
        if self.stages:
            store(self, _places=Places(self))
            store(self, stages=named_stages(self, self._places))
            store(self, _of_legs={leg.stage: scene_of(self, leg) for leg in self.legs})

    def __repr__(self):
        counts = (f"{len(getattr(self, part))} {part}" for part in ("supports", "loads", "joints"))
        rods = some_of(rod.name for rod in self.rods)
        return f"<Scene{f' {self.title!r}' if self.title else ''}: rods {rods}; {', '.join(counts)}>"

    def _check_places(self, field, item):
        station, rod = getattr(item, "station", None), getattr(item, "rod", None)
        if station is not None:
            instance("Scene", f"{field}.station", station, Station, "a station such as rod.end")
        places = (item.first, item.second) if isinstance(item, Joint) else (station or rod,)
        for place in filter(None, places):
            if (rod := getattr(place, "rod", place)) not in self._numbers:
                if rod.name in self._by_name:
                    what = f"the station by name, '{place}'" if isinstance(place, Station) else f"it as '{rod.name}'"
                    raise SceneError(
                        f"Scene.{field} acts at {place}, of another rod that is named '{rod.name}' too (of another "
                        f"scene, or made anew): expected a rod of this scene; give {what}, or take both from one scene"
                    )
                raise SceneError(
                    f"Scene.{field} acts at {place}, a station of a rod that is not in the scene: "
                    f"expected one of {some_of(rod.name for rod in self.rods)}"
                )
        if isinstance(item, Action) and station is None:
            for rod in self.rods_of(item):
                item.check_rod(rod)

    def _find_leaders(self):
        """For every rod the first rod of its structure: the rods connected by joints, directly or indirectly."""
        joined = Groups()
        for joint in self.joints:
            joined.join(self._numbers[joint.first.rod], self._numbers[joint.second.rod])
        return {rod: self.rods[joined.leader(i)] for i, rod in enumerate(self.rods)}

    def number(self, rod: Rod) -> int:
        """The place of a rod of the scene in `rods`."""
        return self._numbers[rod]

    def rods_of(self, action: Action) -> Sequence[Rod]:
        """The rods that an action acts on or along."""
        if action.station is not None:
            return (action.station.rod,)
        if type(action).acts_on is Action.acts_on:  # the one rod that it names
            return (action.rod,) if action.rod in self._numbers else ()
        return tuple(rod for rod in self.rods if action.acts_on(rod))

    def leader(self, rod: Rod) -> Rod:
        """The first rod of the structure that a rod belongs to."""
        return self._leaders[rod]

    def origin(self, rod: Rod) -> np.ndarray:
        """The start of the structure that a rod belongs to, (3,), m.

        Solvers take positions relative to it, so that a large distance from the inertial origin costs no accuracy.
        """
        return self._leaders[rod].curve.position(0.0)

    @cached_property
    def origins(self):
        """(rods, 3) the `origin` of every rod."""
        known = {leader: leader.curve.position(0.0) for leader in set(self._leaders.values())}
        return np.array([known[self._leaders[rod]] for rod in self.rods])

    def over(self, duration):
        """A copy of the scene whose `horizon` is the duration (s)."""
        scene = copy.copy(self)
        for name in ("flatness", "magnitudes"):
            scene.__dict__.pop(name, None)
        store(scene, horizon=duration)
        return scene

    @cached_property
    def extremes(self):
        """The least and the largest stiffnesses of every rod: two `Stiffnesses` with K and J (rods, 3) alone."""
        ranges = zip(*(rod.profile.range for rod in self.rods), strict=True)
        return tuple(Stiffnesses(*(np.array([getattr(x, name) for x in bound]) for name in "KJ"), None, None)
                     for bound in ranges)  # fmt: skip

    @cached_property
    def lengths(self):
        """(rods,) m."""
        return np.array([rod.length for rod in self.rods])

    @cached_property
    def flatness(self):
        """(the `Plane` of a plane scene, "") or (None, why the scene is not plane), see `find_plane`."""
        return find_plane(self)

    @cached_property
    def magnitudes(self):
        """The `Magnitude`s of its loads and prescribed motions, see `magnitudes.check_magnitudes`."""
        return magnitudes(self)

    @property
    def plane(self):
        """The `Plane` of a plane scene, or None."""
        return self.flatness[0]

    @property
    def moving(self):
        """The loads and supports that depend on time."""
        return [item for item in (*self.loads, *self.supports) if signals_of(item)]

    @cached_property
    def actions(self):
        """The loads, and the actions that they add (`Action.companions`)."""
        companions = []
        for load in self.loads:
            for other in load.companions(self):
                if load.amplitude != other.amplitude:
                    store(other, amplitude=load.amplitude)
                companions.append(other)
        return (*self.loads, *companions)

    @cached_property
    def legs(self):
        """See `stages.legs_of`."""
        return legs_of(self)

    @property
    def whole(self):
        """The scene with all stages, of the scene of one."""
        return self._whole or self

    def of_leg(self, leg, end=None):
        """See `stages.scene_of`; without a state the same scene for every call."""
        return self._of_legs[leg.stage] if end is None or not leg.depends_on_state else scene_of(self, leg, end)

    @property
    def all_supports(self):
        """Its own supports, then those of its stages."""
        return (*self.supports, *(support for stage in self.stages for support in stage.supports))

    @property
    def all_loads(self):
        """Its own loads, then those of its stages."""
        return (*self.loads, *(load for stage in self.stages for load in stage.loads))

    def stations(self, rod):
        """All stations of a rod that supports, loads and joints refer to, and those where its loads are not smooth, in
        any stage."""
        named, along = self.whole._named
        breaks = {s for load in along.get(rod, ()) for s in load.breaks(rod)}
        return [*named.get(rod, ()), *(rod.at(s) for s in sorted(breaks) if 0 < s < rod.length)]

    @cached_property
    def _named(self):
        """{rod: its stations that supports, loads and joints refer to}, and {rod: the loads along it}."""
        named, along = {}, {}
        stations = [x.station for x in (*self.all_supports, *self.all_loads) if x.station is not None]
        for station in (*stations, *(end for joint in self.joints for end in (joint.first, joint.second))):
            named.setdefault(station.rod, []).append(station)
        for load in self.all_loads:
            for rod in self.rods_of(load) if load.station is None else ():
                along.setdefault(rod, []).append(load)
        return named, along

    @property
    def cautions(self) -> list[str]:
        """Warnings that belong to every result, a list of sentences."""
        return [*self.doubts, *self._following(), *self._outside()]

    @cached_property
    def by_default(self):
        """A sentence on sections whose weak and strong axes nobody turned, in a list; [] where there are none."""
        bending = self.extremes[1].J
        unlike = np.abs(bending[:, 0] - bending[:, 1]) > _ALIKE * bending[:, 0]
        rods = [self.rods[i] for i in np.flatnonzero(unlike)]
        names = [f"'{rod.name}'" for rod in rods if isinstance(rod.curve, (Line, Spline)) and rod.curve.d1 is None]
        told = "sections that are not round stand upright by default, with d1 level (of vertical rods along x) and d2, "
        told += f"along heights and webs, across it: {some_of(names)}; `d1=` of the curve or of frame turns them"
        return [told] if names else []

    @cached_property
    def doubts(self):
        """Warnings about probable mistakes in the scene, sentences."""
        return (*self._softness(), *self._thickness(), *self._turned(), *self._unjoined(), *self.idle)

    @cached_property
    def idle(self):
        """A warning about loads that move nothing, in a list, where all of them act on clamps."""
        held = {str(x.station) for x in self.all_supports if isinstance(x, Clamp)}
        if not self.all_loads or len(held) < len(self.all_supports) or self.velocities:
            return []
        if not all(load.station is not None and str(load.station) in held for load in self.all_loads):
            return []
        return [f"{describe(load)} acts on a clamp and moves nothing" for load in self.all_loads[:_TOLD]]

    def warn(self):
        """Raise a `SceneWarning` for each of `doubts`, on behalf of the caller of the function that calls this."""
        for doubt in self.doubts:
            warn(doubt)

    @cached_property
    def has_obstacles(self):
        """Whether there is an obstacle that rods may touch, see `Action.gaps`."""
        return any(load.gaps is not None for load in self.all_loads)

    @cached_property
    def has_walls(self):
        """Whether an action presses on the parts of rods that touch it alone, see `Action.presses`."""
        return any(action.presses for action in self.actions)

    @cached_property
    def rod_contact(self):
        """The action that keeps rods from passing through each other, see `Action.rods_touch`; or None."""
        return next((load for load in self.all_loads if load.rods_touch), None)

    @cached_property
    def has_threads(self):
        """Whether a thread runs along a rod, see `Action.is_thread`."""
        return any(load.is_thread for load in self.all_loads)

    @cached_property
    def acts_in_law(self):
        """Whether an action is part of the law, see `Action.in_law`."""
        return any(action.in_law for action in self.all_loads)

    @property
    def follows(self):
        """Whether there are follower loads, which have no potential."""
        return bool(self._followers)

    @property
    def _followers(self):
        return [load for load in self.all_loads if load.follows]

    def _softness(self):
        """Warnings about Young's moduli and densities that may be in wrong units."""
        asked = {doubt: rod.material.E for rod in self.rods if (doubt := _doubted(rod)[0])}
        told = [f"{doubt}: {_UNITS}?" for doubt in sorted(asked, key=asked.get)]
        light = {rod.material.density for rod in self.rods if rod.material and METAL[0] <= rod.material.E <= METAL[1]}
        return told + [
            f"a density of {rho:g} kg/m^3 with E of a metal: is it in g/cm^3 or t/m^3, which are 1000 kg/m^3?"
            for rho in sorted(filter(None, light)) if _GRAMS[0] <= rho <= _GRAMS[1]
        ]  # fmt: skip

    def _thickness(self):
        """Warnings about dimensions that may be in wrong units."""
        long = []
        for rod in self.rods:
            section = rod.section_at(0.0)
            if isinstance(section, Profile) and rod.length > _LONGEST * section.height:
                long.append((rod.length, f"'{rod.name}' of {section.name}"))
            across = max(sizes_across(section), default=0.0)
            size = "rod '{}' is {:g} m across and {:g} m long"
            if isinstance(section, Tube) and section.inner_diameter < _SMALL_BORE * section.outer_diameter:
                inner, outer = section.inner_diameter, section.outer_diameter
                yield (
                    f"the tube of rod '{rod.name}' has a wall of {(outer - inner) / 2:g} m: its second number is the "
                    f"inner diameter; a wall of {inner:g} m is Tube({outer:g}, {outer - 2 * inner:g})"
                )
            if across >= rod.length:
                yield f"{size.format(rod.name, across, rod.length)}: are all lengths in m?"
            elif across > _THICKEST and isinstance(section, Circle | Rectangle):
                if rod.material is not None and METAL[0] <= rod.material.E <= METAL[1]:
                    size = size.format(rod.name, across, rod.length)
                    yield f'{size}, of solid metal: are all lengths in m (or texts, such as "20 mm")?'
        if long:
            more = f" (one of {len(long)} such rods)" if len(long) > 1 else ""
            length, what = max(long)
            yield f"rod {what} is {length:g} m long{more}: are all lengths in m (of a mesh in mm: scale = 0.001)?"

    def _turned(self):
        """A warning about rolled profiles that stand across the plane of the scene because nobody turned them."""
        rods, plane = bent_weakly(self)
        if rods:
            names = some_of(f"'{rod.name}'" for rod in rods)
            d1 = ", ".join(f"{x:.4g}" for x in np.round(plane.axes[2], 12) + 0.0)
            yield (
                f"rolled profiles bend about their weaker axis in {plane.words}: {names}: d1 = ({d1}) of the curve "
                "puts their webs into the plane; any d1 that you give ends this warning"
            )

    def _unjoined(self):
        """Warnings about ends of rods that lie on other rods and are not joined there; where rods touch each other,
        about two ends alone."""
        told = {}
        for end, other, apart in touching(self):
            at_ends = other.s in (0, other.rod.length)
            if (other, end) in told or (self.rod_contact and not at_ends):
                continue
            if at_ends:
                found, them = f"{end} and {other} lie at one point and are not joined", "they"
            else:
                found, them = f"{end} lies on rod '{other.rod.name}' and is not joined to it", "it"
            move = ""
            if apart > 1e-9 * max(end.rod.length, other.rod.length):
                place = ", ".join(f"{x:.6g}" for x in other.rod.curve.position(other.s) + 0.0)
                found = f"{end} is {apart:.3g} m from {other}, less than either measures across, and not joined to it"
                them, move = "it", f"move it to ({place}) and "
            told[end, other] = f"{found}: if {them} should be, {move}add Joint({end}, {other.full_name})"
        most = _TOLD if len(told) > _TOLD + 1 else len(told)
        yield from [*told.values()][:most]
        if len(told) > most:
            yield f"{len(told) - most} more ends of rods lie on other rods and are not joined to them"

    def _following(self):
        if not self.follows:
            return []
        found = {}  # each sentence once
        for load in self._followers:
            if load.rough:
                found[
                    f"{describe(load)}: friction has no potential, and acts as while the tendon slides towards the "
                    f"{load.pulled} of the rod: negative modes are those at the tensions as they are, and do not "
                    "decide on stability"
                ] = None
        kinds = " and ".join(dict.fromkeys(type(load).__name__ for load in self._followers if not load.rough))
        if not kinds:
            return [*found]
        return [
            *found,
            f"{kinds}: a follower load has no potential, so negative modes, which are those of the tangent's symmetric "
            "part, do not decide on stability: an equilibrium with some may be stable (Beck's column from pi^2 to "
            "20.05 EI/L^2), one with none may flutter, which only dynamics can show",
        ]

    def _outside(self):
        """Sentences on tendons that run outside their rods."""
        for load in self.all_loads:
            if not load.is_thread:
                continue
            s = np.linspace(0, load.rod.length, _ALONG_TENDON)
            _, arms, _ = at(load, 0.0).data(load.rod, s)
            arms = np.linalg.norm(arms.value, axis=1)
            radii = [load.rod.section_at(x).round_radius or np.inf for x in s.tolist()]
            far = int(np.argmax(arms / radii))
            if arms[far] > (1 + 1e-9) * radii[far]:
                yield (
                    f"{describe(load)} runs {arms[far]:.3g} m from the axis at {load.rod.at(s[far])}, outside the rod "
                    f"of radius {radii[far]:.3g} m there: discs or guides have to hold it"
                )

    def plot(self, file=None, *, units="SI"):
        """Picture of the rods at rest with their names, supports, joints and loads (at load factor 1).

        Args:
            file: a .png; None returns the pyvista plotter.
            units: "SI", "field", or a dict of units by dimensions, such as {"force": "klbf"}.

        Raises:
            SceneError: a file that is no .png, or pyvista is missing.
        """
        from cosserat_fenicsx.pictures import plot

        return plot.scene(self, file, units)

    def station(self, name: str) -> Station:
        """The station 'rod.start', 'rod.end' or 'rod@s', s in m, as scene files name it.

        Raises:
            SceneError: there is none of that name.
        """
        return station_named("station", name, self._by_name)

    def places_of(self, item):
        """The places, such as "stages[0].supports[1]", of a load or a support of a scene with stages."""
        return self._places.of_item(item)

    def supports_of(self, which: Support | StationOrName) -> list[int]:
        """Indices of the supports meant by `which`.

        Args:
            which: one of `supports`, as it was given or as it is listed; or a station or its name, for all that act
                there.

        Raises:
            SceneError: there is none.
        """
        if isinstance(which, str):
            which = self.station(which)
        if isinstance(which, Station):
            found = [i for i, x in enumerate(self.supports) if x.station == which]
        else:
            found = [i for i, x in enumerate(self.supports) if x is which or self._given[i] is which]
        if not found:
            known = ", ".join(map(describe, self.supports)) or "none"
            what = which if isinstance(which, Station) else f"this {type(which).__name__}"
            raise SceneError(
                f"{what} is no support of this scene: expected one of its `supports` ({known}), or a station of one"
            )
        return found

    def rod(self, name: str) -> Rod:
        """The rod of that name.

        Raises:
            SceneError: there is none of that name.
        """
        if not isinstance(name, str) or name not in self._by_name:
            raise SceneError(f"no rod is named {name!r}, {nearest(name, self._by_name)}")
        return self._by_name[name]
