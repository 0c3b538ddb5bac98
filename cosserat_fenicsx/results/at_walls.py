"""Forces of walls on the nodes of rods in motion."""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import refuse


@dataclass(frozen=True, eq=False)
class WallForces:
    """Forces of a wall on m nodes at n states of a motion, N.

    Attributes:
        s: (m,) arc length of the nodes, m; of all rods that the wall acts along, one after another.
        normal: (n, m) towards the axis of the hole.
        around: (n, m) friction round the axis, by a right-handed rotation about its tangent.
        along: (n, m) friction along the axis.
    """

    s: np.ndarray
    normal: np.ndarray
    around: np.ndarray
    along: np.ndarray


def wall_forces(history, wall):
    """See `History.wall_forces`."""
    scene, first = history.scene, 0
    touched = [action for action in scene.actions if action.touches]
    if not any(wall is other for other in touched):
        refuse("wall_forces", "wall", wall, "a wall of the scene that acts in motions, such as a HoleWall")
    for other in touched:
        s = np.concatenate([_nodes(history, other, i, rod) for i, rod in enumerate(scene.rods)])
        if other is wall:
            found = history.scales.force * history._stacked("wall_forces")[:, first : first + len(s)]
            return WallForces(s, *np.moveaxis(found, 2, 0))
        first += len(s)


def _nodes(history, wall, i, rod):
    """(m,) arc lengths of the nodes of a rod, the i-th, that may touch a wall."""
    if wall.station is not None:
        return np.full(int(wall.station.rod is rod), wall.station.s)
    return history.layout.node_s(history.rule.nodes)[i] * rod.length if wall.acts_on(rod) else np.empty(0)
