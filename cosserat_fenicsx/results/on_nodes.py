"""What all results with numbers at the nodes of a scene's rods have in common."""

from cosserat_fenicsx.errors import SceneError


class OnNodes:
    """A result on a mesh: it has the `scene`, the `elements` of each rod and their `degree`."""

    def _rows(self, rod=None):
        """(index of a rod, default the first; slice of its nodes among those of all rods).

        Raises:
            SceneError: it is no rod of the scene.
        """
        rods = self.scene.rods
        if rod is not None and rod not in rods:
            raise SceneError(
                f"{rod!r} is no rod of this result's scene: expected one of {', '.join(x.name for x in rods)}"
            )
        i = 0 if rod is None else rods.index(rod)
        first = sum(n * self.degree + 1 for n in self.elements[:i])
        return i, slice(first, first + self.elements[i] * self.degree + 1)
