"""The package's own units: L, EI/L^2 and EI/L of the longest rod, so that one tolerance serves every scene."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Scales:
    """Units of length (m), force (N) and moment (N m)."""

    length: float
    force: float
    moment: float

    @classmethod
    def of(cls, scene):
        """Scales of the longest rod of a scene."""
        rod = max(scene.rods, key=lambda rod: rod.length)
        EI, L = float(rod.profile.range[1].J[:2].max()), rod.length
        return cls(L, EI / L**2, EI / L)

    def of_unit(self, unit):
        """The scale of a load's vector by the name of its unit."""
        return {
            "force": self.force,
            "moment": self.moment,
            "length": self.length,
            "force per length": self.force / self.length,
        }[unit]
