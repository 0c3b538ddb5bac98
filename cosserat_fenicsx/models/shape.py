"""What of a scene decides which code is compiled and which mesh is made."""

import numbers
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.forms import loads as virtual_work
from cosserat_fenicsx.models.connections import Connections
from cosserat_fenicsx.scene.signals import at

#: Unknowns of a node, and numbers of a contact force, by the model's name and whether it is that of a plane.
_SIZES = {
    ("spatial", False): (7, 3),
    ("planar", True): (3, 2),
    ("determinate", True): (1, 0),
    ("determinate", False): (4, 0),
}
# What `_rounding` may be for a factorisation that pivots within nodes alone.
_ROOM_FOR_BLOCKS = 1e-4
FORMULATIONS = ("mixed", "displacement", "multiplier")


@dataclass(frozen=True)
class Shape:
    """What decides which code is compiled and which mesh is made; equal shapes share one model.

    Attributes:
        model: "spatial", "planar" or "determinate".
        flat: whether it is that of a plane; "determinate" exists in both.
        counts: elements of each rod.
        degree: p of the unknowns of the nodes.
        variant: "condensed" or "field" (both formulation "mixed"), "displacement" or "multiplier"; "known" where
            statics gives the contact force.
        points: Gauss points of an element.
        terms: the kinds of loads, (function of forms.loads, "point" or "line", number of vectors), each as often as
            loads of that kind share an element end.
        connections: where supports and joints act.
        slender: whether rounding leaves no room for a factorisation that pivots within nodes alone.
    """

    model: str
    flat: bool
    counts: tuple
    degree: int
    variant: str
    points: int
    terms: tuple
    connections: Connections
    slender: bool

    @classmethod
    def of(cls, scene, layout, *, formulation, degree, points=None, model="spatial"):
        """The shape of a scene on a layout, for a model that it fits.

        Raises:
            SceneError: an unknown formulation, a degree outside 1..4, or an infinite stiffness where the
                formulation cannot take it.
        """
        if formulation not in FORMULATIONS:
            raise SceneError(f"formulation = {formulation!r}: {nearest(formulation, FORMULATIONS)}")
        if isinstance(degree, bool) or not isinstance(degree, numbers.Integral) or not 1 <= degree <= 4:
            raise SceneError(f"degree = {degree!r}: expected 1, 2, 3 or 4")
        if points is not None and (
            isinstance(points, bool) or not isinstance(points, numbers.Integral) or not 1 <= points <= 12
        ):
            raise SceneError(f"gauss_points = {points!r}: expected a whole number from 1 to 12")
        infinite = any(np.isinf(rod.profile.range[1].K).any() for rod in scene.rods)
        if infinite and formulation != "mixed":
            raise SceneError(
                f"formulation = '{formulation}' cannot take an infinite stiffness: expected 'mixed', "
                "which carries the contact force as an unknown"
            )
        if formulation == "multiplier" and points is None:
            points = degree + 2  # CG1 for lambda needs full quadrature (and then locks)
        # On a fine mesh of a very slender rod rounding in the condensed tangent reaches the bending stiffness itself.
        rounding = _rounding(scene, layout, degree)
        variant = {"mixed": "field" if infinite or rounding > 1.0 else "condensed"}.get(formulation, formulation)
        if model == "determinate":
            variant = "known"
        terms = tuple(key for key, _ in place_loads(scene, layout))
        plane = None if model == "spatial" else scene.plane
        connections = Connections.of(scene, layout, plane)
        if connections.ties and formulation == "multiplier":
            raise SceneError("formulation = 'multiplier' knows clamps and rigid joints alone: expected 'mixed'")
        counts, slender = layout.counts, rounding > _ROOM_FOR_BLOCKS
        return cls(model, plane is not None, counts, degree, variant, points or degree, terms, connections, slender)

    @property
    def unknowns(self):
        """Number of unknowns, without making a mesh."""
        cells, links = sum(self.counts), self.connections
        nodes = cells * self.degree + len(self.counts) - len(links.clamped) - len(links.leaders)
        node, force = _SIZES[self.model, self.flat]
        others = {"field": force * self.degree * cells, "multiplier": cells + len(self.counts)}.get(self.variant, 0)
        return node * nodes + others + len(links.equations)


def _rounding(scene, layout, degree):
    """Rounding of the stiffest entries of a condensed tangent over the bending stiffness of a node's spacing."""
    return max(
        np.finfo(float).eps * rod.profile.range[1].K.max() * rod.length**2 / rod.profile.range[0].J[:2].min()
        * (cells * degree) ** 2
        for rod, cells in zip(scene.rods, layout.counts, strict=True)
    )  # fmt: skip


def place_loads(scene, layout):
    """Load terms: [(key, [(load, rod index, vertex or None)])], loads of a kind sharing a term where they can."""
    terms = []
    for load in scene.loads:
        work = getattr(virtual_work, load.work) if isinstance(load.work, str) else load.work
        if load.station is not None:
            places, place = [layout.vertex(scene, load.station)], "point"
            vectors = len(at(load, 0.0).vectors(load.station.rod))
        else:
            places = [(rod, None) for rod, which in enumerate(scene.rods) if load.acts_on(which)]
            place, vectors = "line", 1
        key = (work, place, vectors)
        for known, members in terms:
            if known == key and not {at for _, at in members} & set(places):
                break
        else:
            members = []
            terms.append((key, members))
        members.extend((load, at) for at in places)
    return sorted(terms, key=lambda term: (term[0][0].__name__, term[0][1]))
