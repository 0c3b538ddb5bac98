"""The cheapest model that is enough for a scene, and why, in plain sentences."""

from dataclasses import dataclass, field

from cosserat_fenicsx.errors import SceneError, nearest

#: From the cheapest to the one that takes any scene.
RUNGS = ("determinate", "planar", "spatial")
MODELS = ("auto", *RUNGS)
#: Works of loads whose force statics knows beforehand.
_DEAD = {"force", "moment", "eccentric_force", "line_force", "line_moment"}


@dataclass(frozen=True)
class Choice:
    """A model for a scene.

    Attributes:
        model: "determinate", "planar" or "spatial".
        why: sentences that say why this one, and why not a cheaper one.
        promoted: whether a plane answer that loses its stability, sideways or not, is to be solved again in space.
    """

    model: str
    why: list = field(default_factory=list)
    promoted: bool = False

    def in_space(self, reason):
        """The choice after a plane answer was found not to be enough."""
        return Choice("spatial", [f"promoted from the {self.model} model: {reason}"])


def choose(scene, *, model="auto", formulation="mixed", degree=4, points=None, follows=False):
    """The `Choice` for a scene.

    Args:
        scene: a `Scene`.
        model: "auto", or the model that is asked for.
        formulation, degree, points: as `solve` takes them.
        follows: whether arc length or a branch was asked for.

    Raises:
        SceneError: an unknown model, or one that the scene does not fit, saying why.
    """
    if model not in MODELS:
        raise SceneError(f"model = {model!r}: {nearest(model, MODELS)}")
    if model == "spatial":
        return Choice("spatial", ["the spatial model was asked for; it takes any scene"])
    obstacles = {
        name: "arc length and branches are followed in space alone" if follows else
        _obstacle(name, scene, formulation, degree, points)
        for name in ("determinate", "planar")
    }  # fmt: skip
    if model != "auto":
        if obstacles[model]:
            raise SceneError(f"model = '{model}' is not possible: {obstacles[model]}; expected 'auto' or 'spatial'")
        return Choice(model, [f"the {model} model was asked for", *_reasons(model, scene)])
    for name, obstacle in obstacles.items():
        if not obstacle:
            why = _reasons(name, scene)
            if name == "planar":
                why.append(f"determinate is not possible: {obstacles['determinate']}")
            return Choice(name, why, promoted=True)
    if obstacles["determinate"] == obstacles["planar"]:
        return Choice("spatial", [f"planar is not possible: {obstacles['planar']}", "the spatial rod takes any scene"])
    return Choice("spatial", [*(f"{name} is not possible: {why}" for name, why in obstacles.items())])


def fitting(scene, *, formulation="mixed", degree=4, points=None):
    """The models that a scene fits, from the cheapest on."""
    return [name for name in RUNGS if not _obstacle(name, scene, formulation, degree, points)]


def _obstacle(name, scene, formulation, degree, points):
    """Why a scene does not fit a model; or nothing."""
    if name == "spatial":
        return ""
    if formulation != "mixed":
        return f"the formulation '{formulation}' is known to the spatial model alone"
    if name == "planar":
        return scene.flatness[1]
    if points is not None and points != degree:
        return f"it takes as many Gauss points as the degree, {degree}, and {points} were asked for"
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
    structures = {}
    for rod in scene.rods:
        structures.setdefault(scene.leader(rod), []).append(rod)
    for rods in structures.values():
        clamps = sum(x.station.rod in rods for x in scene.supports)
        joints = sum(x.first.rod in rods for x in scene.joints)
        if clamps > 1:
            return (
                f"statics alone does not give the contact force of rod '{rods[0].name}', which is held {clamps} times"
            )
        if joints >= len(rods):
            return f"statics alone does not give the contact force of rod '{rods[0].name}', which closes a ring"
    return ""


def _live(scene):
    """Which load statics does not know beforehand; or nothing."""
    for i, load in enumerate(scene.loads):
        if load.work not in _DEAD:
            how = "turns with the rod" if isinstance(load.work, str) else "is of a kind of its own"
            return f"load {i + 1}, a {type(load).__name__}, {how}, so that statics does not know it beforehand"
    return ""


def _reasons(name, scene):
    """Why a scene fits a model, and what keeps it out of a plane."""
    plane, obstacle = scene.flatness
    where = f"planar is not possible: {obstacle}" if plane is None else f"all rods and loads lie in {plane.words}"
    if name == "planar":
        return [where]
    clamp = "one clamp" if len(scene.supports) == 1 else f"one clamp on each of {len(scene.supports)} structures"
    known = f"{clamp} and dead loads: statics gives the contact force"
    return [known, where] if plane is None else [where, known]


def force_in_words(variant, formulation):
    """What becomes of the contact force in a variant of a model (`Shape.variant`)."""
    return {
        "condensed": "the contact force is carried at the Gauss points (formulation 'mixed')",
        "field": "a stiffness is infinite or next to it, so the contact force is an unknown (formulation 'mixed')",
        "known": "the contact force is known beforehand (formulation 'mixed')",
    }.get(variant, f"formulation '{formulation}' was asked for")
