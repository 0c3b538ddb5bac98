"""The choice of the cheapest model that is valid for a scene, with its reasons as text."""

from collections import Counter
from dataclasses import dataclass, field

from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.models.traits import traits_of
from cosserat_fenicsx.parts import per_scene
from cosserat_fenicsx.scene.action import describe

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
                why.append(f"determinate is not possible: {obstacles['determinate']}")
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
    """Why statics alone does not give the contact force of a scene."""
    for what, holders in (
        ("support", [x for x in scene.supports if not x.clamps]),
        ("joint", [x for x in scene.joints if not x.rigid]),
    ):
        for holder in holders:
            where = holder.station if what == "support" else f"{holder.first} with {holder.second}"
            return f"statics alone does not give the contact force, because of the {type(holder).__name__} at {where}"
    clamps = Counter(scene.leader(x.station.rod) for x in scene.supports)
    joints = Counter(scene.leader(x.first.rod) for x in scene.joints)
    structures = {}
    for rod in scene.rods:
        structures.setdefault(scene.leader(rod), []).append(rod)
    for rods in structures.values():
        held = clamps[rods[0]]
        if held > 1:
            return f"statics alone does not give the contact force of rod '{rods[0].name}', which is held {held} times"
        if joints[rods[0]] >= len(rods):
            return f"statics alone does not give the contact force of rod '{rods[0].name}', which closes a ring"
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
            return f"{load_and_why}, so that statics alone does not give the contact force"
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
    return ""


def _reasons(name, scene):
    """Why a model is valid for a scene, and why the planar one is not."""
    plane, obstacle = scene.flatness
    where = f"planar is not possible: {obstacle}" if plane is None else f"all rods and loads lie in {plane.words}"
    if name == "planar":
        return [where]
    clamp = "one clamp" if len(scene.supports) == 1 else f"one clamp on each of {len(scene.supports)} structures"
    known = f"{clamp} and dead loads: statics gives the contact force"
    return [known, where] if plane is None else [where, known]
