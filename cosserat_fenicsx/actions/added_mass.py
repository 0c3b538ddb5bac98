"""The mass of a fluid that moves with the axis of a rod."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import instance, number, positive, refuse, store
from cosserat_fenicsx.scene.action import LineAction
from cosserat_fenicsx.scene.pieces import checked_pieces
from cosserat_fenicsx.scene.rod import Rod, RodOrName, is_known


@dataclass(frozen=True)
class AddedMass(LineAction):
    """Mass per unit of reference length that moves with the axis of a rod, in motions and natural modes: of the fluid
    around it and inside it.

    It has no weight (buoyancy carries it), no rotational inertia and no unbalance: its centre is on the axis also where
    the rod is eccentric. It does not move along the tangent that the rod has at rest, which suits rods that stay near
    their line at rest, such as in a hole; rods that do not need `axial`. (Only then is the angular momentum of a free
    motion constant.)

    Args:
        rod: the rod.
        mass: kg/m; of a round rod of diameter D across its axis C_a rho pi D^2/4, with C_a = 1 far from walls; or
            pieces (s_end, kg/m), the last to the rod's length or None for it.
        axial: whether it moves in all directions.

    Raises:
        SceneError: not a rod, a mass that is not positive (of a piece: negative), or pieces that do not ascend to the
            rod's length.
    """

    rod: RodOrName
    mass: float | Sequence[tuple[float | None, float]]
    axial: bool = False

    work, scaled = None, False

    def __post_init__(self):
        known = is_known(self, "rod", Rod)
        instance(self, "axial", self.axial, bool, "True or False")
        if not isinstance(self.mass, list | tuple):
            store(self, mass=positive(self, "mass", self.mass, "kg/m"))
            return
        if not self.mass:
            refuse(self, "mass", self.mass, "at least one piece (s_end, kg/m)")
        if known:  # `Scene` looks a name up, and makes it again
            pieces = checked_pieces("AddedMass", "mass", self.mass, self.rod.length, "kg/m")
            store(self, mass=tuple((s, self._checked(i, mass)) for i, (s, mass) in enumerate(pieces)))

    def _checked(self, i, mass):
        return number(self, f"mass[{i}]", mass, "a mass from 0 on (kg/m)", lambda x: 0 <= x < np.inf)

    @property
    def lateral(self):
        """See `Action`."""
        return not self.axial

    def breaks(self, rod):
        """See `Action`."""
        return tuple(s for s, _ in self._pieces[:-1])

    def added_mass(self, rod, s, side):
        """See `Action`."""
        ends, masses = zip(*self._pieces, strict=True)
        within = 1e-9 * rod.length * (1 if side == "left" else -1)
        across = np.array(masses)[np.searchsorted(np.add(ends[:-1], within), s, side=side)]
        return across, across if self.axial else np.zeros_like(across)

    @property
    def _pieces(self):
        return self.mass if isinstance(self.mass, tuple) else ((self.rod.length, self.mass),)
