"""A contact law: a wall whose stiffness grows with the depth of penetration."""

from dataclasses import dataclass

from cosserat_fenicsx.actions.walls import ContactLaw
from cosserat_fenicsx.parts import Length


@dataclass(frozen=True)
class Hardening(ContactLaw):
    """k d (1 + d/doubling) at the depth d.

    Args:
        doubling: depth at which the pressure is twice that of a linear wall, m.
    """

    doubling: Length

    @staticmethod
    def pressure(depth, stiffness, doubling):
        return stiffness * depth * (1 + depth / doubling)
