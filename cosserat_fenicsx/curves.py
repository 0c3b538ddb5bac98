"""Reference centrelines with their frames R_R(s) = [d_1R d_2R d_3R]; d_3R is the tangent."""

from dataclasses import dataclass, field

import numpy as np

from cosserat_fenicsx.checks import refuse, store, vector


@dataclass(frozen=True)
class Line:
    """A straight line.

    Args:
        start, end: inertial points, m.
        d1: a vector whose part across the line gives d_1R; None for the horizontal across the line, d_2R being the
            one that points upwards (along z); a vertical line has d_1R = x.

    Raises:
        SceneError: points that coincide, or d1 along the line.
    """

    start: tuple
    end: tuple
    d1: tuple | None = None
    length: float = field(init=False)

    def __post_init__(self):
        store(self, start=vector(self, "start", self.start, "m"), end=vector(self, "end", self.end, "m"))
        chord = np.subtract(self.end, self.start)
        length = float(np.linalg.norm(chord))
        if not length > 1e-12 * max(np.abs(self.start).max(), np.abs(self.end).max()):
            refuse(self, "end", self.end, f"a point apart from start = {self.start}")
        d3 = chord / length
        if self.d1 is not None:
            store(self, d1=vector(self, "d1", self.d1, "direction"))
        d1 = np.asarray(_level_axis(d3) if self.d1 is None else self.d1)
        across = d1 - np.dot(d1, d3) * d3
        if np.linalg.norm(across) <= 1e-6 * np.linalg.norm(d1):
            refuse(self, "d1", self.d1, "a direction across the line")
        d1 = across / np.linalg.norm(across)
        store(self, length=length, _frame=np.column_stack([d1, np.cross(d3, d1), d3]))

    def position(self, s):
        """Inertial points at the arc lengths s (n,), m; shape (n, 3)."""
        x = np.asarray(s, dtype=float)[..., None] / self.length
        return (1 - x) * self.start + x * self.end

    def frame(self, s):
        """R_R at the arc lengths s (n,); shape (n, 3, 3), the directors as columns, inertial components."""
        return np.broadcast_to(self._frame, (*np.shape(s), 3, 3))


def _level_axis(t):
    """The horizontal direction across t that makes t x d1 point upwards; x for a vertical t."""
    across = np.cross([0.0, 0.0, 1.0], t)
    return across if np.linalg.norm(across) > 1e-6 else np.array([1.0, 0.0, 0.0])


#: Curves by the words of the scene file.
CURVES = (Line,)
