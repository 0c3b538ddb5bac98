"""The rock below a drag bit: how deep it is cut at every angle, which the next blade meets.

n equal blades follow each other at angles of 2 pi/n. All move alike, so one function is enough: S(Phi), the depth of
the rock left behind at the angle Phi of the first blade. A blade at the depth U and the angle Phi meets the rock that
the one before it left at Phi - 2 pi/n: its depth of cut is

    d = U - S(Phi - 2 pi/n),        S(Phi) = max(U, S(Phi - 2 pi/n)).

Where the bit never leaves the rock, S = U, and d = U(t) - U(t - tau) with the delay tau that Richard, Germay &
Detournay define by Phi(t) - Phi(t - tau) = 2 pi/n (J. Sound Vib. 305 (2007) 432, doi:10.1016/j.jsv.2007.04.015). Where
it has left the rock, the older surface remains, however many blades pass over it.
"""

import math
from bisect import bisect_right

import numpy as np

_SHORTEST = 1e-9  # rad; shorter rotations add no place to the surface


class RockSurface:
    """S(Phi) at the places where steps ended, between them by cubic Hermite interpolation.

    Args:
        blades: n. angle, depth: of the bit at the start, rad and m.
        slope: dS/dPhi of the rock that is there before the bit has turned, m/rad: advance over rotation of steady
            drilling, or 0 for a flat face.
        cut: depth of cut at the start, m: that of steady drilling is 2 pi slope/n.
    """

    def __init__(self, blades: int, angle: float = 0.0, depth: float = 0.0, slope: float = 0.0, cut: float = 0.0):
        self.pitch = 2 * math.pi / blades
        behind = depth - cut
        self._angles = [angle - self.pitch, angle]
        self._depths = [behind, behind + slope * self.pitch]
        self._slopes = [slope, slope]
        self._first = 0  # earlier places are no longer met

    def under(self, angle: float) -> tuple[float, float]:
        """Depth (m) of the rock that a blade meets at an angle of the bit (rad), and its slope (m/rad)."""
        return self._at(angle - self.pitch)

    def _at(self, place):
        angles, depths, slopes = self._angles, self._depths, self._slopes
        if place <= angles[0]:
            return depths[0] + slopes[0] * (place - angles[0]), slopes[0]
        if place >= angles[-1]:
            return depths[-1] + slopes[-1] * (place - angles[-1]), slopes[-1]
        i = bisect_right(angles, place, self._first if angles[self._first] <= place else 0) - 1
        width = angles[i + 1] - angles[i]
        x = (place - angles[i]) / width
        rise, left, right = depths[i + 1] - depths[i], slopes[i] * width, slopes[i + 1] * width
        # the cubic with these values and slopes at both ends
        c2, c3 = 3 * rise - 2 * left - right, left + right - 2 * rise
        return depths[i] + x * (left + x * (c2 + x * c3)), (left + x * (2 * c2 + 3 * x * c3)) / width

    def pass_over(self, angle: float, depth: float, slope: float) -> float:
        """Leave the rock that a blade leaves which has come to an angle (rad) and depth (m), and return its depth of
        cut there (m), negative above the rock.

        Args:
            slope: rate of penetration over speed of rotation there, m/rad.
        """
        old, old_slope = self.under(angle)
        cuts = depth >= old
        if angle > self._angles[-1] + _SHORTEST:
            self._angles.append(angle)
            self._depths.append(depth if cuts else old)
            self._slopes.append(slope if cuts else old_slope)
            while self._angles[self._first + 1] < angle - self.pitch:
                self._first += 1
            if self._first > 4096:  # forget what no blade meets any more, now and then
                for kept in (self._angles, self._depths, self._slopes):
                    del kept[: self._first]
                self._first = 0
        return depth - old

    def memory(self) -> dict:
        """Everything, as arrays."""
        return {
            "angles": np.array(self._angles), "depths": np.array(self._depths), "slopes": np.array(self._slopes),
            "first": self._first,
        }  # fmt: skip

    def recall(self, memory: dict) -> None:
        """Restore what `memory` returned."""
        self._angles, self._depths, self._slopes = (memory[name].tolist() for name in ("angles", "depths", "slopes"))
        self._first = int(memory["first"])
