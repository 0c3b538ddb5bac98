"""Friction at the wall for small motions of a string that slips steadily: dashpots along and around the hole.

The friction of a normal force N per length is mu(v) N against the slip v of the surface, a vector along and around. The
string slips by r Om around, or by V along. Small motions v along and om around then meet the force and the torque per
length

    mu/(r Om) N v     and    r^2 mu' N om          of a string that rotates,
    mu' N v           and    r^2 mu/V N om         of one that slides without rotation,

mu' = dmu/dv, which is negative where the friction falls. Over the inertia they are drag rates, constant in pieces.
"""

import itertools
from functools import cached_property

import numpy as np

from cosserat_fenicsx.checks import refuse
from cosserat_fenicsx.drilling.wall_friction import law_of, loads_between, scene_pieces

# Cells along the whole string; change of the load within a piece, over the largest one; sliding over slip around, above
# which small motions along and around are not told apart, and above which that is said.
_CELLS, _SAME, _APART, _SAID = 300, 0.02, 0.2, 0.03


class WallDashpots:
    """The dashpots of a `Drilling` with a hole, under its static weight on bit."""

    def __init__(self, scene):
        self.scene, (self._law, self._of_rotation, _) = scene, law_of(scene.friction)

    @cached_property
    def pieces(self):
        """[[(length, load, radius)]] of the pieces in each segment: m, N/m for a coefficient of 1, contact radius m."""
        scene, pieces = self.scene, scene_pieces(self.scene)
        ends = np.cumsum([0.0, *(x.length for x in scene.segments)])
        even = np.linspace(0.0, pieces.bottom[-1], _CELLS + 1)
        cuts = np.unique(np.concatenate([even, pieces.bottom]))
        cuts = np.concatenate([[0.0], cuts[1:][np.diff(cuts) > 1e-6 * cuts[-1]]])
        middle, load, radius = loads_between(scene, pieces, cuts)
        lengths = np.diff(cuts)
        load, segment = load / lengths, np.clip(np.searchsorted(ends, middle) - 1, 0, len(ends) - 2)
        most, found = load.max(initial=0.0), [[] for _ in scene.segments]
        start = 0
        for k in range(1, len(load) + 1):
            group = load[start : k + 1]
            if k == len(load) or segment[k] != segment[start] or np.ptp(group) > _SAME * most:
                length = lengths[start:k].sum()
                mean = float(lengths[start:k] @ load[start:k] / length)
                found[segment[start]].append((float(length), mean, float(radius[start])))
                start = k
        return found

    def rates(self, speed, sliding, of_bit=None):
        """[[(length, torsional, axial rate)]] of the pieces in each segment (m, 1/s), at a speed of rotation (rad/s)
        and along the hole (m/s); of_bit: speed of what turns with the bit below a motor.

        Raises:
            SceneError: the string is at rest, or it slides and rotates at once.
        """
        law, found = self._law, []
        above = len(self.scene.segments) - len(self.scene.turned)
        for k, (segment, pieces) in enumerate(zip(self.scene.segments, self.pieces, strict=True)):
            row, turning = [], speed if k < above else of_bit
            for length, load, radius in pieces:
                around, along = self._dashpots(law, turning, abs(sliding), radius) if load else (0.0, 0.0)
                row.append((length, load * around / segment.rhoJ, load * along / segment.rhoA))
            found.append(row)
        return found

    def torque_below(self, speed: float) -> float:
        """On what turns with the bit below a motor, at a speed of rotation above 0 (rad/s), N m."""
        found, above = 0.0, len(self.scene.segments) - len(self.scene.turned)
        for length, load, radius in itertools.chain.from_iterable(self.pieces[above:]):
            found += length * load * radius * float(self._law(speed if self._of_rotation else radius * speed))
        return found

    def _dashpots(self, law, speed, sliding, radius):
        """(r^2 N s/m, N s/m) of a normal force of 1 N."""
        slip = radius * speed
        if slip == 0 and sliding == 0:
            refuse(self.scene, "drive.speed", speed, "a string that rotates or slides: at rest friction holds it, and "
                   "small motions do not move it")  # fmt: skip
        if slip == 0:
            if self._of_rotation:
                refuse(self.scene, "friction", self.scene.friction, "a friction over the slip for a string that slides "
                       "without rotation (of_rotation=False)")  # fmt: skip
            return radius**2 * float(law(sliding)) / sliding, law.slope(sliding)
        if sliding > _APART * slip:
            refuse(self.scene, "hook.speed", sliding, f"at most {_APART:g} of the speed of the surface around, "
                   f"{slip:.4g} m/s, or a string that does not rotate: else friction "
                   "couples torsion and axial motion")  # fmt: skip
        if self._of_rotation:
            return radius * law.slope(speed), float(law(speed)) / slip
        return radius**2 * law.slope(slip), float(law(slip)) / slip

    def caution(self, speed, sliding):
        """A sentence on sliding beside the rotation, or ""."""
        slips = [radius * speed for pieces in self.pieces for _, load, radius in pieces if load]
        if not slips or not speed or abs(sliding) <= _SAID * min(slips):
            return ""
        share = 100 * (abs(sliding) / min(slips)) ** 2
        return f"friction at the wall is that of rotation alone: sliding changes it by about {share:.2g} %"
