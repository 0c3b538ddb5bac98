"""Base class of results with values at the nodes of a scene's rods."""

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.rod import Rod, RodOrName


class OnNodes:
    """A result on a mesh; subclasses have the `scene`, the `elements` of each rod and their `degree`."""

    def rod(self, rod: RodOrName | None = None) -> Rod:
        """A rod of the scene, given as a `Rod` or by its name; default the first.

        Raises:
            SceneError: the scene has no such rod.
        """
        if isinstance(rod, str):
            return self.scene.rod(rod)
        rods = self.scene.rods
        if rod is not None and rod not in rods:
            known = ", ".join(x.name for x in rods)
            raise SceneError(f"{rod!r} is not a rod of this result's scene: expected one of {known}")
        return rods[0] if rod is None else rod

    def _rows(self, rod=None):
        """(index of a rod, slice of its nodes among those of all rods)."""
        i = self.scene.rods.index(self.rod(rod))
        first = sum(n * self.degree + 1 for n in self.elements[:i])
        return i, slice(first, first + self.elements[i] * self.degree + 1)
