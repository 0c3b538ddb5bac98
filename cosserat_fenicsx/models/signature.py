"""The cheapest model that is valid for a scene, with its reasons as text; and the properties of a scene that determine
the compiled code and the mesh."""

import numbers
from collections import Counter, namedtuple
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.models.connections import Connections
from cosserat_fenicsx.models.formulation import KNOWN, Formulation, formulation_of, traits_of, work_of
from cosserat_fenicsx.parts import per_scene
from cosserat_fenicsx.scene.action import describe
from cosserat_fenicsx.scene.signals import at


#: (unknowns of a node, components of the contact force) by the model's name and whether it is planar.
_SIZES = {
    ("spatial", False): (7, 3),
    ("planar", True): (3, 2),
    ("determinate", True): (1, 0),
    ("determinate", False): (4, 0),
}
# Value of `_rounding` above which rods are slender, see `Signature.slender`.
_SLENDER = 1e-4


@dataclass(frozen=True)
class Signature:
    """Key of the compiled code and the mesh; scenes with equal signatures can use the same model.

    Attributes:
        model: "spatial", "planar" or "determinate".
        flat: whether the model is planar; "determinate" exists in a plane and in space.
        counts: elements of each rod.
        degree: polynomial degree p of the nodal unknowns.
        formulation: the `Formulation`.
        points: Gauss points per element.
        terms: the `TermKind`s of the actions; a kind is repeated for actions that act at the same place.
        connections: where supports and joints act.
        slender: whether rounding makes Newton's tangent inexact for motions of low stiffness, see `error_is_small` in
            algebra/newton.c.
        coupled: whether a section couples strains, so that the law is one of full matrices.
        eccentric: whether a rod's mass centre lies off its axis, which changes the inertia terms of a motion.
        lateral: whether a mass moves across a rod alone (`Action.lateral`), which adds to them.
    """

    model: str
    flat: bool
    counts: tuple
    degree: int
    formulation: Formulation
    points: int
    terms: tuple
    connections: Connections
    slender: bool
    coupled: bool
    eccentric: bool
    lateral: bool

    @classmethod
    def of(cls, scene, layout, *, formulation, degree, points=None, model="spatial"):
        """The signature of a scene on a layout, for an admissible model, or a SceneError: an unknown formulation (a
        `Formulation` or its name), a degree outside 1..4, or an infinite stiffness that the formulation does not allow.
        """
        return _signature(scene, layout, formulation, degree, points, model)

    @classmethod
    def _found(cls, scene, layout, formulation, degree, points, model):
        formulation = formulation_of(formulation)
        if isinstance(degree, bool) or not isinstance(degree, numbers.Integral) or not 1 <= degree <= 4:
            raise SceneError(f"degree = {degree!r}: expected 1, 2, 3 or 4")
        if points is not None and (
            isinstance(points, bool) or not isinstance(points, numbers.Integral) or not 1 <= points <= 12
        ):
            raise SceneError(f"gauss_points = {points!r}: expected a whole number from 1 to 12")
        infinite = bool(np.isinf(scene.extremes[1].K).any())
        # On a fine mesh of a very slender rod, rounding errors of the condensed tangent reach the bending stiffness.
        rounding = _rounding(scene, layout, degree)
        formulation = formulation.for_stiffness(infinite, rounding)
        if model == "determinate":
            formulation = replace(formulation, force=KNOWN)
        terms = tuple(kind for kind, _ in place_actions(scene, layout))
        plane = None if model == "spatial" else scene.plane
        connections = Connections.of(scene, layout, plane)
        counts, slender = layout.counts, rounding > _SLENDER
        coupled = any(rod.profile.coupled for rod in scene.rods)
        return cls(
            model, plane is not None, counts, degree, formulation, points or degree, terms, connections, slender,
            coupled, any(rod.mass_centre for rod in scene.rods), any(load.lateral for load in scene.loads),
        )  # fmt: skip

    @property
    def lives_along_rods(self):
        """Whether a distributed action, or the tension of a thread, depends on the state."""
        given = (kind.dead or kind.thread and not (kind.finds_tension or kind.slides) for kind in self.terms)
        return not all(known or kind.place == "point" for known, kind in zip(given, self.terms, strict=True))

    @cached_property
    def unknowns(self):
        """Number of unknowns, without making a mesh."""
        cells, links = sum(self.counts), self.connections
        nodes = cells * self.degree + len(self.counts) - len(links.clamped) - len(links.leaders)
        node, force = _SIZES[self.model, self.flat]
        if self.model == "spatial":
            node += self.formulation.multipliers
        others = force * self.degree * cells if self.formulation.force.unknown else 0
        return node * nodes + others + len(links.equations)


_signature = per_scene(Signature._found)


def _rounding(scene, layout, degree):
    """Rounding error of the largest entries of the condensed tangent over the bending stiffness at nodal spacing."""
    low, high = scene.extremes
    slender = high.K.max(axis=1) * scene.lengths**2 / low.J[:, :2].min(axis=1)
    return float(np.finfo(float).eps * (slender * (np.array(layout.counts) * degree) ** 2).max())


class TermKind(namedtuple("TermKind", "work place sizes memory scaled evolve refreshed dead thread")):
    """A kind of action: its virtual work, where it is integrated ("point", "line" at Gauss points, "node", or "law" for
    a part of the law, without work), the sizes of its data and of its memory, its factor ("load" factor, "permanent"
    factor, or 1: "full"), its `Action.evolve`, whether its data depend on the position, whether it is independent of
    the state (`traits.Traits`), and whether it is a thread (`Action.is_thread`)."""

    __slots__ = ()

    @property
    def at_gauss(self):
        """Whether its data are those at the Gauss points."""
        return self.place in ("line", "law")

    @property
    def finds_tension(self):
        """Whether it is a thread of given length (`Action.shortens`), whose tension is found."""
        return self.thread and self.scaled == "full"

    @property
    def slides(self):
        """Whether it is a thread with friction (`Action.rough`)."""
        return self.thread and self.refreshed


@per_scene
def _acting(scene):
    """[(action, its `TermKind`, index of its rod or, of one along rods, indices)] of actions with a virtual work."""
    found = []
    for action in scene.actions:
        work = work_of(action)
        if work is None and not action.in_law:
            continue
        if action.station is not None:
            rods, place = scene.number(action.station.rod), "point"
        else:
            rods = [scene.number(rod) for rod in scene.rods_of(action)]
            place = "law" if action.in_law else "node" if action.at_nodes else "line"
        data = at(action, 0.0).data(scene.rods[rods if place == "point" else rods[0]], np.zeros(1))
        scaled = "load" if action.scaled else "permanent" if action.permanent else "full"
        sizes, memory = (tuple(datum.size for datum in data) for data in (data, action.memory))
        refreshed, dead = action.refreshed is not None or action.rough, traits_of(action, scene.rods).dead
        kind = TermKind(work, place, sizes, memory, scaled, action.evolve, refreshed, dead, action.is_thread)
        found.append((action, kind, rods))
    return found


def place_actions(scene, layout):
    """Terms of the actions: [(`TermKind`, [(action, rod index, vertex or None)])]. Actions of one kind share a term if
    they act at different places, or in the law, where their data add up."""
    terms, taken = [], []
    for action, kind, rods in _acting(scene):
        at_station = kind.place == "point"
        places = [layout.vertex(scene, action.station)] if at_station else [(rod, None) for rod in rods]
        for (known, members), there in zip(terms, taken, strict=True):
            if known == kind and (kind.place == "law" or there.isdisjoint(places)):
                break
        else:
            members, there = [], set()
            terms.append((kind, members))
            taken.append(there)
        members.extend((action, *where) for where in places)
        there.update(places)
    return sorted(terms, key=lambda term: (getattr(term[0].work, "__qualname__", ""), term[0].place, term[0].scaled))


#: The models from the cheapest to the most general.
RUNGS = ("determinate", "planar", "spatial")
MODELS = ("auto", *RUNGS)


@dataclass(frozen=True)
class Choice:
    """A model for a scene, and sentences that say why this one, and why not a cheaper one; promoted: whether a planar
    solution that becomes unstable, in or out of its plane, is to be solved again in space."""

    model: str
    why: list = field(default_factory=list)
    promoted: bool = False

    def in_space(self, reason):
        """The choice of the spatial model after a planar solution was found to be unstable."""
        return Choice("spatial", [f"promoted from the {self.model} model: {reason}"])


@per_scene
def choose(scene, *, model="auto", formulation=None, degree=4, points=None, follows=False):
    """The `Choice` for a scene.

    Args:
        scene: a `Scene`.
        model: "auto", or the name of the model to use.
        formulation: the `Formulation`; None for one that all models have.
        degree, points: as `solve` takes them.
        follows: whether arc-length continuation or a branch was requested.

    Raises:
        SceneError: an unknown model, or one that is not valid for the scene, with the reason.
    """
    if model not in MODELS:
        raise SceneError(f"model = {model!r}: {nearest(model, MODELS)}")
    if model == "spatial":
        return Choice("spatial", ["the spatial model was requested; it is valid for any scene"])
    obstacles = {
        name: "arc length and branches are followed in space alone" if follows else
        _obstacle(name, scene, formulation, degree, points)
        for name in ("determinate", "planar")
    }  # fmt: skip
    if model != "auto":
        if obstacles[model]:
            raise SceneError(f"model = '{model}' is not possible: {obstacles[model]}; expected 'auto' or 'spatial'")
        return Choice(model, [f"the {model} model was requested", *_reasons(model, scene)])
    for name, obstacle in obstacles.items():
        if not obstacle:
            why = _reasons(name, scene)
            if name == "planar":
                why.append(f"the determinate model is not possible: {obstacles['determinate']}")
            return Choice(name, why, promoted=True)
    if obstacles["determinate"] == obstacles["planar"]:
        return Choice(
            "spatial", [f"planar is not possible: {obstacles['planar']}", "the spatial model is valid for any scene"]
        )
    return Choice("spatial", [*(f"{name} is not possible: {why}" for name, why in obstacles.items())])


def fitting(scene, *, formulation=None, degree=4, points=None):
    """The models that are valid for a scene, the cheapest first."""
    return [name for name in RUNGS if not _obstacle(name, scene, formulation, degree, points)]


def _obstacle(name, scene, formulation, degree, points):
    """Why a model is not valid for a scene; "" if it is."""
    if name == "spatial":
        return ""
    if formulation is not None and name not in formulation.models:
        return f"the formulation '{formulation.name}' exists only in the {' and '.join(formulation.models)} model"
    if name == "planar":
        return not_flat(scene)
    if points is not None and points != degree:
        return f"it needs as many Gauss points as the degree, {degree}, not {points}"
    return _not_a_tree(scene) or _live(scene)


def _not_a_tree(scene):
    """Why statics alone does not give the internal force of a scene."""
    for what, holders in (
        ("support", [x for x in scene.supports if not x.clamps]),
        ("joint", [x for x in scene.joints if not x.rigid]),
    ):
        for holder in holders:
            where = holder.station if what == "support" else f"{holder.first} with {holder.second}"
            return f"statics alone does not give the internal force, because of the {type(holder).__name__} at {where}"
    clamps = Counter(scene.leader(x.station.rod) for x in scene.supports)
    joints = Counter(scene.leader(x.first.rod) for x in scene.joints)
    structures = {}
    for rod in scene.rods:
        structures.setdefault(scene.leader(rod), []).append(rod)
    for rods in structures.values():
        held = clamps[rods[0]]
        if held > 1:
            return f"statics alone does not give the internal force of rod '{rods[0].name}', which is held {held} times"
        if joints[rods[0]] >= len(rods):
            return f"statics alone does not give the internal force of rod '{rods[0].name}', which closes a ring"
    return ""


def _live(scene):
    """Which load depends on the solution, so that statics alone does not give n; "" if none."""
    for i, load in enumerate(scene.actions):
        traits = traits_of(load, scene.rods)
        if not traits.turns:
            return _names_components(i, load)
        if load.in_law:
            return f"loads[{i}], {describe(load)}, changes the strains without stress, which the model does not know"
        known = traits.dead or (traits.known_force and load.station is not None)
        if not known or load.refreshed is not None:
            how = "turns with the rod" if load.follows else "depends on the motion"
            added = i >= len(scene.loads)  # `Action.companions`
            load_and_why = f"{describe(load) if added else f'loads[{i}], a {type(load).__name__},'} {how}"
            return f"{load_and_why}, so that statics alone does not give the internal force"
    return ""


def _names_components(i, load):
    return (
        f"loads[{i}], a {type(load).__name__}, has a virtual work that names components: "
        "expected one that takes its directions as vectors of its data"
    )


def not_flat(scene):
    """Why the planar model is not valid for a scene; "" if it is."""
    plane, obstacle = scene.flatness
    if plane is None:
        return obstacle
    for i, load in enumerate(scene.actions):
        traits = traits_of(load, scene.rods)
        if not traits.turns:
            return _names_components(i, load)
        if not traits.flat:
            return f"loads[{i}], a {type(load).__name__}, may drive the rods out of their plane"
        if load.rough:
            return f"loads[{i}], a {type(load).__name__}, has friction, which only the spatial model knows"
    return ""


def _reasons(name, scene):
    """Why a model is valid for a scene, and why the planar one is not."""
    plane, obstacle = scene.flatness
    where = f"planar is not possible: {obstacle}" if plane is None else f"all rods and loads lie in {plane.words}"
    if name == "planar":
        return [where]
    clamp = "one clamp" if len(scene.supports) == 1 else f"one clamp on each of {len(scene.supports)} structures"
    known = f"{clamp} and dead loads: statics gives the internal force"
    return [known, where] if plane is None else [where, known]
