"""A path of a scene with another value of a number, to first order: what queries are differentiated with."""

from cosserat_fenicsx.results.path import Path


class PerturbedPath(Path):
    """States of a scene that differs slightly from that of another path; it takes the stations, rods and supports of
    that path's scene for its own."""

    @classmethod
    def beside(cls, path, model):
        """An empty one for the scene that a model was loaded with, beside `path`."""
        found = cls.of(model)
        found._given, found.comm = path, path.comm
        return found

    def station(self, station):
        """See `Result`: its own station at the same share of the rod's length."""
        scene = self.scene
        if not isinstance(station, str) and getattr(station, "rod", None) in scene.rods:
            return station
        known = self._given.station(station)
        rod, share = self.rod(known.rod), known.s / known.rod.length
        return rod.end if share == 1 else rod.at(share * rod.length)

    def rod(self, rod=None):
        """See `OnNodes`."""
        if rod in self.scene.rods:
            return rod
        return self.scene.rods[self._given.scene.rods.index(self._given.rod(rod))]

    def reaction(self, support):
        """See `Reactions`."""
        if support not in self.scene.supports:
            found = [self.scene.supports[i] for i in self._given.scene.supports_of(support)]
            parts = [super(PerturbedPath, self).reaction(x) for x in found]
            return tuple(sum(part) for part in zip(*parts, strict=True))
        return super().reaction(support)
