"""Where a scene's supports and joints act on a layout."""

from dataclasses import dataclass
from functools import cached_property

from cosserat_fenicsx.models.tie_pattern import TiePattern
from cosserat_fenicsx.scene.planes import independent_in
from cosserat_fenicsx.scene.signals import at


@dataclass(frozen=True)
class Connections:
    """Which nodes have unknowns and which constraint equations are added; vertices are (rod index, element end).

    Attributes:
        clamped: vertices without unknowns.
        leaders: pairs (vertex, leader): rigidly joined vertices and the one whose unknowns they share.
        ties: (kind, vertex of a, vertex of b or None) of all scalar equations of supports and joints, in the scene's
            order.
        equations: indices of the ties that are added: in a plane only independent ones that constrain motions in it.
    """

    clamped: tuple
    leaders: tuple
    ties: tuple
    equations: tuple

    @classmethod
    def of(cls, scene, layout, plane=None):
        """The connections of a scene, in space or in its plane."""
        leader = {}

        def find(vertex):
            while vertex in leader:
                vertex = leader[vertex]
            return vertex

        for joint in scene.joints:
            if joint.rigid:
                one, other = sorted(find(layout.vertex(scene, end)) for end in (joint.first, joint.second))
                if one != other:
                    leader[other] = one
        clamped = sorted({find(layout.vertex(scene, x.station)) for x in scene.supports if x.clamps})
        kinds = tuple(
            (type(tie).__name__, *(None if x is None else find(layout.vertex(scene, x)) for x in (tie.a, tie.b)))
            for tie in ties_of(scene)
        )
        equations = tuple(range(len(kinds))) if plane is None else independent_in(plane, ties_of(scene))
        return cls(tuple(clamped), tuple((vertex, find(vertex)) for vertex in sorted(leader)), kinds, equations)

    @property
    def tied(self):
        """Vertices in constraint equations, each once."""
        return tuple(dict.fromkeys(x for _, a, b in self.ties for x in (a, b) if x is not None))

    @cached_property
    def pattern(self):
        """The `TiePattern` of all ties on the vertices `tied`."""
        place = {vertex: i for i, vertex in enumerate(self.tied)}
        return TiePattern([(place[a], -1 if b is None else place[b]) for _, a, b in self.ties], len(place))


def ties_of(scene, t=0.0):
    """All scalar constraint equations of supports and joints that are not clamps or rigid joints, at a time (s)."""
    held = [*scene.supports, *(joint for joint in scene.joints if not joint.rigid)]
    return [tie for item in held for tie in at(item, t).ties()]
