"""Loads and supports in stages: what each stage ramps, releases and leaves, and the scene of a stage.

A stage is solved as a scene of its own that starts from a state. What stages before have applied is permanent there; a
support holds its station where it is, or moves it on from there; a released support is replaced by its reaction, and
what is released is ramped down. So one load factor moves at a time, and all that is known of scenes serves a stage too.
"""

import copy
import dataclasses
import math
from collections import namedtuple
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosserat_fenicsx.checks import instance, refuse, store
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.numerics import directors
from cosserat_fenicsx.parts import Part
from cosserat_fenicsx.scene.action import Action, describe
from cosserat_fenicsx.scene.loads import Force, Moment
from cosserat_fenicsx.scene.rod import Station, station_named, with_names
from cosserat_fenicsx.scene.supports import (
    AngleTie,
    PositionTie,
    Support,
    TurnTie,
    same_place,
    turned,
)

# Components of a reaction below this share of it are rounding.
_ROUNDING = 1e-13


@dataclass(frozen=True, eq=False)
class Stage(Part):
    """A stage of a `Scene`: what it names is ramped by its load factor, all that came before stays.

    Args:
        loads: are applied, times the load factor of the stage. A `permanent` one is ramped, too.
        supports: hold their stations from here on, where these are at the begin of the stage; a `Prescribed` motion
            goes on from there, and replaces an earlier one of the same station.
        release: loads and supports of the scene or of stages before, which are ramped down to zero at the load factor
            1: each as it was given, a station or its name for all supports there, or its place, "supports[0]",
            "loads[1]", "stages[0].loads[0]".
        load_factors: as for `solve`; in a file a text such as "0:1", or a list. The last one stays for the stages
            after; it is 1 where a support is released and a stage follows.
        name: for messages.

    Raises:
        SceneError: nothing is named; a load or a support twice, or what is not there (raised by `Scene`).
    """

    loads: Sequence[Action] = ()
    supports: Sequence[Support] = ()
    release: Any = ()
    load_factors: Any = (0.0, 1.0)
    name: str = ""

    def validate(self):
        if isinstance(self.load_factors, str):
            store(self, load_factors=load_factors_in(self.load_factors))
        given = self.release
        store(self, release=tuple(given) if isinstance(given, list | tuple) else (given,))
        for item in self.release:
            if not isinstance(item, str | Action | Support | Station):
                refuse(self, "release", item, 'loads, supports, stations, or texts such as "rod.end" or "loads[0]"')
        if not (self.loads or self.supports or self.release):
            refuse(self, "loads", (), "a load, a support or a release: a stage without any changes nothing")

    def arguments(self):
        factors = self.load_factors
        text = ":".join(map(repr, factors)) if isinstance(factors, tuple) and len(factors) == 2 else factors
        return super().arguments() | {"load_factors": text}


def load_factors_in(text):
    """The load factors of a text: "0:1" is a tuple (0.0, 1.0), "0.5,1" a list [0.5, 1.0], see `solve`."""
    separator = ":" if ":" in text else ","
    try:
        values = [float(part) for part in text.split(separator)]
    except ValueError:
        values = []
    if not values or (separator == ":" and len(values) != 2):
        raise SceneError(f"load factors '{text}': expected A:B (in steps of the solver) or A,B,... (reached exactly)")
    return tuple(values) if separator == ":" else values


#: A load or a support by its place in the scene, "stages[0].loads[1]". value: a load's amplitude; of a support whether
#: it is "fixed" as in the reference, "held" where the station is, or "moving" on from there.
Named = namedtuple("Named", "place item value")


@dataclass(frozen=True, eq=False)
class Leg:
    """The loads and supports of a stage.

    Attributes:
        stage: its index among the stages of the scene; -1 for the scene's own loads.
        load_factors: as for `solve`; None for those that `solve` is given.
        standing: the loads that are there, `Named` by the amplitudes that stages before have reached.
        ramped: those times the load factor; released ones with the opposite of what they have in `standing`.
        supports: `Named`.
        released: the released supports, indices into `supports` of the leg before.
        words: its name in messages; name: that of its stage, which may be empty.
    """

    stage: int
    load_factors: Any
    standing: tuple
    ramped: tuple
    supports: tuple
    released: tuple = ()
    words: str = "the scene's own loads"
    name: str = ""

    @property
    def label(self):
        """Its name in pictures and tables."""
        return "own loads" if self.stage < 0 else self.name or f"stage {self.stage}"

    @property
    def last(self):
        """The load factor at its end; `solve` sees to it that the scene's own loads end at 1."""
        return float(np.ravel(self.load_factors if self.load_factors is not None else 1.0)[-1])

    def share_of(self, load, factor):
        """The factor of a load where the load factor of the stage has this value; 0 where it does not act."""
        found = [[x.value for x in part if x.item is load] for part in (self.standing, self.ramped)]
        return sum(found[0]) + factor * sum(found[1])

    @property
    def depends_on_state(self):
        """Whether its scene depends on the state at its begin."""
        moved = any(x.value != "fixed" for x in self.supports)
        return bool(self.released) or moved or any(x.item.shortens for x in (*self.standing, *self.ramped))

    def releases(self, load):
        """Whether it ramps down a load of a stage before."""
        return all(any(x.item is load for x in part) for part in (self.standing, self.ramped))


def refuse_stages(owner, scene):
    """Refuse (SceneError) a scene with stages where a function, `owner`, would leave them out."""
    if scene.stages:
        raise SceneError(
            f"Scene.stages: {owner} does not support stages: expected `solve`, whose path.events show where a stage "
            "loses its stability (also beyond its loads, Stage(load_factors=(0, 5))), path.part(stage).modes() for "
            "vibrations, or the scene without stages, dataclasses.replace(scene, stages=())"
        )


def named_stages(scene, known):
    """A scene's stages with stations for names, released things by place; `known`: its `Places`, added to."""
    found = []
    for i, stage in enumerate(scene.stages):
        instance("Scene", f"stages[{i}]", stage, Stage, "a Stage")
        where, parts = f"Scene.stages[{i}]", {}
        for field in ("loads", "supports"):
            items = enumerate(getattr(stage, field))
            parts[field] = [with_names(f"{where}.{field}[{j}]", x, scene._by_name) for j, x in items]
            for j, item in enumerate(parts[field]):
                scene._check_places(f"stages[{i}].{field}[{j}]", item)
        released = [place for x in stage.release for place in known.of(where, x)]
        if twice := {place for place in released if released.count(place) > 1}:
            raise SceneError(f"{where}.release names {', '.join(sorted(twice))} twice: expected it once")
        for field in ("loads", "supports"):
            known.add(f"stages[{i}].{field}", getattr(stage, field), parts[field], where)
        found.append(dataclasses.replace(stage, **parts, release=tuple(released)))
    return tuple(found)


class Places:
    """{place: a load or a support} of a scene and of its stages so far."""

    def __init__(self, scene):
        self._scene, self._known = scene, {}
        self.add("loads", scene._given_loads, scene.loads, "Scene")
        self.add("supports", scene._given, scene.supports, "Scene")

    def add(self, field, given, items, where):
        """Enter loads or supports, as they were given and with stations in place of names."""
        for j, pair in enumerate(zip(given, items, strict=True)):
            twice = [place for place, others in self._known.items() if any(x is y for x in pair for y in others)]
            if twice:
                raise SceneError(
                    f"{where}: {field}[{j}], {describe(pair[1])}, is {twice[0]} already: expected each load and "
                    "support in one place; what a stage applies stays until one releases it"
                )
            self._known[f"{field}[{j}]"] = pair

    def of_item(self, item):
        """The places of a load or a support, as it was given or as it is listed."""
        return [place for place, pair in self._known.items() if any(item is x for x in pair)]

    def of(self, where, item):
        """The places of what is released."""
        if isinstance(item, str) and item not in self._known and "[" not in item:
            item = station_named(f"{where}.release", item, self._scene._by_name)
        if isinstance(item, Station):
            found = [place for place, (_, x) in self._known.items() if isinstance(x, Support) and x.station == item]
        else:
            found = [item] if isinstance(item, str) and item in self._known else self.of_item(item)
        if not found:
            words = item if isinstance(item, str | Station) else describe(item)
            raise SceneError(
                f"{where}.release names {words}, which is not there: expected a load or a support of the scene or of "
                f"a stage before: {', '.join(self._known) or 'there is none'}"
            )
        return found


def legs_of(scene):
    """The `Leg`s of a scene with stages, in order: of its own loads, where there are such, then of its stages; a
    SceneError where a stage releases what is gone, or not all of a support; or names what no load factor multiplies."""
    loads = [Named(f"loads[{i}]", x, 1.0) for i, x in enumerate(scene.loads)]
    always, ramped = ([x for x in loads if (x.item.scaled or x.item.shortens) is ramps] for ramps in (False, True))
    supports = [Named(f"supports[{i}]", x, "moving" if x.moves else "fixed") for i, x in enumerate(scene.supports)]
    legs, acts = [], bool(ramped) or any(x.value == "moving" for x in supports)
    changes = any(x.item.permanent for x in always) and (scene.stages[0].supports or scene.stages[0].release)
    if acts or changes:
        legs.append(Leg(-1, None if acts else [0.0], tuple(always), tuple(ramped), tuple(supports)))
    for i, stage in enumerate(scene.stages):
        words = f"stages[{i}]" + (f" ('{stage.name}')" if stage.name else "")
        if legs:
            always, supports = after(legs[-1])
        for j, load in enumerate(stage.loads):
            if not (load.scaled or load.permanent or load.shortens):
                raise SceneError(
                    f"{words}.loads[{j}]: a {type(load).__name__} is not multiplied by the load factor: expected a "
                    "load that is, such as a Force, and this one among the loads of the scene"
                )
        gone = dict.fromkeys(stage.release)
        there = {x.place: x for x in (*always, *supports)}
        for place in gone:
            if place not in there:
                raise SceneError(f"{words}.release: {place} has been released, or replaced, before")
        ramped = [Named(f"stages[{i}].loads[{j}]", x, 1.0) for j, x in enumerate(stage.loads)]
        ramped += [x._replace(value=-x.value) for x in always if x.place in gone]
        there = [x.item for x in always if x.place in gone]
        fixed = [x for x in there if not (x.scaled or x.permanent or x.shortens)]
        if fixed:
            raise SceneError(
                f"{words}.release: a {type(fixed[0]).__name__} is not multiplied by the load factor: expected a load "
                "that is, such as a Force"
            )
        released = tuple(j for j, x in enumerate(supports) if x.place in gone)
        kept = _taken_over([x for x in supports if x.place not in gone], stage.supports)
        begins = "moving" if legs else "fixed"  # every support is in place in the reference
        added = [Named(f"stages[{i}].supports[{j}]", x, begins if x.moves else "held" if legs else "fixed")
                 for j, x in enumerate(stage.supports)]  # fmt: skip
        legs.append(
            Leg(i, stage.load_factors, tuple(always), tuple(ramped), (*kept, *added), released, words, stage.name)
        )
    return legs


def after(leg):
    """The loads and supports, lists of `Named`, that a stage after this one finds. Raises SceneError: a part of the
    reaction of a released support, or of the tension of a released tendon of given length, is left."""
    lengths = any(x.item.shortens and leg.releases(x.item) for x in leg.ramped)
    if (leg.released or lengths) and leg.last != 1:
        raise SceneError(
            f"{leg.words}.load_factors end at {leg.last:g}, and a stage follows: expected 1 at the end, since a "
            f"{'support' if leg.released else 'tendon'} is released in full"
        )
    reached = {}
    for x in (*leg.standing, *(x._replace(value=leg.last * x.value) for x in leg.ramped)):
        reached[x.place] = x._replace(value=x.value + reached[x.place].value if x.place in reached else x.value)
    loads = [x for x in reached.values() if x.value]
    return loads, [x._replace(value="held" if x.item.moves else x.value) for x in leg.supports]


def _taken_over(supports, others):
    """Supports without the motions of stations that other supports prescribe anew."""
    kept = []
    for x in supports:
        anew = [y for y in others if y.moves and x.item.moves and y.station == x.item.station]
        left = {name: getattr(x.item, name) for name in ("displacement", "rotation")
                if anew and all(getattr(y, name) is None for y in anew)}  # fmt: skip
        if not anew:
            kept.append(x)
        elif any(value is not None for value in left.values()):
            given = {"displacement": None, "rotation": None} | left
            kept.append(x._replace(item=dataclasses.replace(x.item, **given)))
    return kept


@dataclass(frozen=True)
class _Placed(Support):
    """A support that holds its station where it was at the begin of a stage, or moves it on from there."""

    support: Support
    displacement_before: tuple
    rotation_before: tuple
    moves: bool

    called = property(lambda self: type(self.support).__name__)
    station = property(lambda self: self.support.station)
    displacement = property(lambda self: self.support.displacement if self.moves else None)
    rotation = property(lambda self: self.support.rotation if self.moves else None)

    def ties(self):
        support, moved, q = self.support, np.array(self.displacement_before), np.array(self.rotation_before)
        R = directors(q[None])[0]
        ties = (*same_place(self.station), *turned(self.station, (0.0, 0.0, 0.0))) if support.clamps else support.ties()
        found = []
        for tie in ties:
            if isinstance(tie, PositionTie):
                found.append(tie._replace(offset=float(moved @ tie.direction), rate=tie.rate if self.moves else 0.0))
            elif isinstance(tie, AngleTie):
                found.append(tie._replace(t=tuple(R.T @ tie.t)))
            elif isinstance(tie, TurnTie):
                rotation = (0.0, 0.0, 0.0) if not self.moves else tie.rotation
                if getattr(support, "frame", "inertial") == "section":
                    rotation = tuple(R @ rotation)
                found.append(tie._replace(rotation=rotation, start=tuple(q.tolist())))
        return tuple(found)


#: Attributes, beside their fields, of the loads of a leg's scene: see `Action`; given: the load of the stage.
OF_STAGE = ("amplitude", "scaled", "wound", "base", "begun", "given")


def scene_of(scene, leg, end=None):
    """The `Scene` of a leg; end: the path up to the end of the leg before, its last state alone, on a scene by this
    function; None where the leg begins in the reference, or to check the scene there."""
    loads = [_part(x, leg, end, permanent=True) for x in leg.standing]
    loads += [_part(x, leg, end, permanent=False) for x in leg.ramped]
    supports = [_placed(x, end) for x in leg.supports]
    for i in leg.released if end else ():
        loads += _reactions(end, i)
    try:
        found = type(scene)(scene.rods, supports, loads, scene.joints, title=scene.title)
    except SceneError as problem:
        raise SceneError(f"{leg.words}: {problem}") from None
    store(found, _whole=scene)  # so that elements end at the stations of all stages
    return found


def _part(named, leg, end, *, permanent):
    """A load with its amplitude, in full or times the load factor; end: see `scene_of`."""
    if named.item.shortens:
        before = [x for x in end.scene.loads if getattr(x, "given", None) is named.item] if end else []
        tension = float(end.tendon(before[0]).tension[-1]) if before else 0.0
        if not leg.releases(named.item):
            part = copy.copy(named.item)
            base = before[0].base if before else end and float(end.thread_length(part)[-1])
            wound = (named.value, 0.0) if permanent else (0.0, named.value)
            store(part, given=named.item, wound=wound, base=base, begun=tension)
            return part
        left = dataclasses.replace(named.item, shortening=None, axial=None, tension=tension)
        named = named._replace(item=left, value=1.0 if permanent else -1.0)
    load, full = named.item, not (named.item.scaled or named.item.permanent)
    if full or (named.value == 1 and load.permanent is permanent):
        return load
    part = copy.copy(load)
    store(part, amplitude=named.value, permanent=permanent)
    if part.scaled is permanent:
        store(part, scaled=not permanent)
    return part


def _placed(named, end):
    if named.value == "fixed" or end is None:
        return named.item
    station = named.item.station
    moved, q = (tuple(values[0].tolist()) for values in (end.displacement(station), end.rotation(station)))
    return _Placed(named.item, moved, q, named.value == "moving")


def _reactions(end, i):
    """Permanent loads that equal the reaction of the i-th support at the end of a path, and their opposites."""
    station = end.scene.supports[i].station
    force, moment = (values[0] for values in end.reaction(end.scene.supports[i]))
    least = _ROUNDING * math.hypot(np.linalg.norm(force) * station.rod.length, np.linalg.norm(moment))
    for kind, vector, small in ((Force, force, least / station.rod.length), (Moment, moment, least)):
        vector = np.where(np.abs(vector) > small, vector, 0.0)
        if vector.any():
            yield kind(station, tuple(vector.tolist()), permanent=True)
            yield kind(station, tuple((-vector).tolist()))
