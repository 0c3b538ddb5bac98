"""The units L, EI/L^2 and EI/L of the longest rod, so that one tolerance suits every scene."""

from dataclasses import dataclass

from cosserat_fenicsx.scene.action import powers


@dataclass(frozen=True)
class Scales:
    """Units of length (m), force (N) and moment (N m)."""

    length: float
    force: float
    moment: float

    @classmethod
    def of(cls, scene, EI=None):
        """Scales of the longest rod of a scene; EI (N m^2) instead of that rod's largest."""
        rod = max(scene.rods, key=lambda rod: rod.length)
        EI, L = EI or float(rod.profile.range[1].J[:2].max()), rod.length
        return cls(L, EI / L**2, EI / L)

    def of_unit(self, unit, time=1.0):
        """The scale of a unit of `scene.action`, for a unit of time (s)."""
        force, length, times = powers(unit)
        return self.force**force * self.length**length * time**times
