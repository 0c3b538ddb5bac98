"""Rods in holes, drawn with their distances from the axis of the hole enlarged."""

from dataclasses import replace

import numpy as np

from cosserat_fenicsx.checks import positive, refuse
from cosserat_fenicsx.pictures.drawing import add_wall


class Enlarged:
    """What enlarges the clearance of rods in the holes of a scene, for pictures.

    Args:
        scene: the scene; where: the name of the function that is called, for messages.
        factor: of the distance between the axis of the hole and that of a rod. Rods without a wall stay as they are.

    Raises:
        SceneError: no positive number; or none of the rods is in a hole, and the factor is not 1.
    """

    def __init__(self, scene, factor, where):
        self.factor = positive(where, "enlarge", factor, "-")
        self._walls = {}
        for wall in (action for action in scene.loads if action.touches):
            for rod in scene.rods:
                if wall.acts_on(rod) if wall.station is None else wall.station.rod is rod:
                    self._walls.setdefault(rod, wall)
        self._scene = scene
        if self.factor != 1 and not self._walls:
            refuse(where, "enlarge", factor, "1, since no rod is in a hole with a wall of motions, such as a HoleWall")

    def bodies(self, bodies, x):
        """The `Body` of every rod with its line moved away from the axis of its hole; x: (n,) the arc lengths over the
        rod's length."""
        if self.factor == 1:
            return bodies
        return [self._moved(rod, body, x) for rod, body in zip(self._scene.rods, bodies, strict=True)]

    def _moved(self, rod, body, x):
        wall = self._walls.get(rod)
        if wall is None:
            return body
        s = np.asarray(x) * rod.length
        axis = wall.path.nearest(body.line, s + wall.begins).position
        return replace(body, line=axis + self.factor * (body.line - axis))

    def add_holes(self, plotter, pyvista, radii):
        """Draw the walls, translucent, around rods with these radii (m), in the order of the scene."""
        drawn = dict(zip(self._scene.rods, radii, strict=True))
        for load in self._scene.loads:
            if (tube := load.tube()) is not None:
                rod = load.rod if load.station is None else load.station.rod
                add_wall(plotter, pyvista, tube[0], self.factor * tube[1] + drawn[rod])

    @property
    def note(self):
        """A line for the picture, or none."""
        return [f"distances from the axis of the hole enlarged {self.factor:g} times"] if self.factor != 1 else []
