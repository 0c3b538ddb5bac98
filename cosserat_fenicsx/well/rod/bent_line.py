"""The reference line of a bent string: straight pieces at angles, with a frame that does not twist."""

from dataclasses import dataclass, field

import numpy as np

from cosserat_fenicsx.checks import store
from cosserat_fenicsx.numerics import directors
from cosserat_fenicsx.scene.curves import Curve, Line, exponential
from cosserat_fenicsx.well.contacts import high_side


@dataclass(frozen=True)
class _BentLine(Curve):
    """A line with kinks, whose frame jumps there.

    Args:
        line: the `Line` without them. places: ascending arc lengths of the kinks, m. turns: of each the rotation
            vector (rad) in components of the frame above it.
    """

    line: Line
    places: tuple[float, ...]
    turns: tuple[tuple[float, float, float], ...]
    length: float = field(init=False)

    uniform = True

    def __post_init__(self):
        frames = [self.line.frame(0.0)]
        for turn in self.turns:
            frames.append(frames[-1] @ exponential(np.array(turn)))
        frames, ends = np.array(frames), np.array([0.0, *self.places])
        corners = np.cumsum([np.zeros(3), *(np.diff(ends)[:, None] * frames[:-1, :, 2])], axis=0)
        store(self, length=self.line.length, _frames=frames, _ends=ends, _corners=corners)

    @property
    def breaks(self):
        return self.places

    @property
    def sides(self):
        """(kinks, 3) inertial unit vectors to the side that each kink bends the line to, across the piece above."""
        a, b, _ = np.array(self.turns).T
        local = np.column_stack([b, -a, np.zeros(len(a))]) / np.hypot(a, b)[:, None]
        return np.einsum("nij,nj->ni", self._frames[:-1], local)

    def _piece(self, s):
        """Indices of the pieces at arc lengths s (..); at a kink of the piece below it."""
        return np.searchsorted(self._ends, s, side="right").clip(min=1) - 1

    def position(self, s):
        """Inertial points at the arc lengths s (n,), m; shape (n, 3)."""
        s = np.asarray(s, dtype=float)
        at = self._piece(s)
        return self.line.start + self._corners[at] + (s - self._ends[at])[..., None] * self._frames[at, :, 2]

    def frame(self, s):
        """R_R at the arc lengths s (n,); shape (n, 3, 3), at a kink that below it."""
        return self._frames[self._piece(np.asarray(s, dtype=float))]

    def turned(self, s):
        """(n, 4) quaternions of the rotation from the first frame to that at s (n,); at a kink half of its own."""
        turns = self._frames @ self._frames[0].T
        trace = np.trace(turns, axis1=1, axis2=2)
        skew = turns - turns.transpose(0, 2, 1)  # bends are small: far from half a turn
        q = np.column_stack([1 + trace, skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]])
        q /= np.linalg.norm(q, axis=1, keepdims=True)
        above = np.searchsorted(self._ends, s, side="left").clip(min=1) - 1
        q = q[above] + q[self._piece(s)]
        return q / np.linalg.norm(q, axis=1, keepdims=True)


def bent_line(line, path, bends, carried):
    """The reference line of a string with `bends`, see `string_in`, that lies in the hole without twist.

    Args:
        line: the `Line` without bends. path: the `WellPath`. carried: function of tangents (n, 3) that gives the
            rotations without twist from the line's frame to them, (n, 4).
    """
    turns = []
    for s, angle, side in bends:
        near = path.nearest(None, np.append(path.md[path.md < s], s))
        frame = directors(carried(near.tangent)[-1:])[0] @ line.frame(0.0)
        high = high_side(near.tangent[-1:], north=True)[0]
        to = np.cos(side) * high + np.sin(side) * np.cross(near.tangent[-1], high)
        a, b, _ = frame.T @ to
        turns.append((-angle * b, angle * a, 0.0))  # d_3 x the side in which it is bent
    return _BentLine(line, tuple(float(s) for s, _, _ in bends), tuple(map(tuple, np.array(turns).tolist())))
