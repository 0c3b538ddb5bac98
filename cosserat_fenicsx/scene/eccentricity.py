"""Mass centres that lie off the axis of a rod: one offset for all sections, offsets in pieces, or a function."""

from collections.abc import Callable, Sequence

import numpy as np

from cosserat_fenicsx.checks import Numbers, call, refuse, vector
from cosserat_fenicsx.scene.pieces import checked_pieces

#: What `Rod.eccentricity` may be.
OffsetOfLength = Callable[[float], Numbers]
Offset = Numbers | OffsetOfLength | Sequence[tuple[float | None, Numbers | OffsetOfLength]]

_EXPECTED = (
    "(a1, a2) along d_1 and d_2 (m), a function from arc length to it, or pieces (s_end, (a1, a2) or function), the "
    "last to the rod's length"
)
_SAMPLES = 33


class MassCentre:
    """The offset of the mass centre of the sections of a rod from its axis, along d_1 and d_2.

    Args:
        owner: the rod: its name for error messages, and its `length`.
        given: as `Rod.eccentricity`, not None.

    Attributes:
        given: the same in a normal form: (a1, a2), a function, or a tuple of pieces.
        breaks: arc lengths inside the rod where it may jump, m.
        largest: the largest distance from the axis, m (of a function: of samples).

    Raises:
        SceneError: none of these, offsets that are not two finite numbers, or ends that do not ascend to the length.
    """

    def __init__(self, owner, given):
        self._where, self._length = f"Rod '{owner.name}'", owner.length
        pieces = self._pieces(given)
        self._ends, self._offsets = zip(*pieces, strict=True)
        self.given = pieces if _has_pieces(given) else pieces[0][1]
        self.breaks = self._ends[:-1]
        s = np.linspace(0, owner.length, _SAMPLES)
        sampled = np.concatenate([self.at(s, side) for side in ("left", "right")])
        self.largest = float(np.linalg.norm(sampled, axis=1).max())

    def at(self, s, side="right"):
        """(..., 3) offsets along d_1, d_2, d_3 at arc lengths s (...), m; `side` as for `Rod.stiffness_at`."""
        s = np.asarray(s, dtype=float)
        within = 1e-9 * self._length * (1 if side == "left" else -1)
        index = np.searchsorted(np.add(self.breaks, within), s, side=side)
        offsets = np.zeros((*s.shape, 3))
        for k, offset in enumerate(self._offsets):
            here = index == k
            if callable(offset):
                values = [self._of(offset, float(x)) for x in s[here]]
                offsets[here, :2] = np.reshape(values, (-1, 2))
            else:
                offsets[here, :2] = offset
        return offsets

    def _pieces(self, given):
        if not _has_pieces(given):
            return ((self._length, self._checked(given, "eccentricity")),)
        pieces = checked_pieces(self._where, "eccentricity", given, self._length, "(a1, a2)")
        return tuple((end, self._checked(x, f"eccentricity[{i}]")) for i, (end, x) in enumerate(pieces))

    def _checked(self, offset, field):
        if callable(offset):
            return offset
        if not isinstance(offset, list | tuple | np.ndarray):
            refuse(self._where, field, offset, _EXPECTED)
        return vector(self._where, field, offset, "m", size=2)

    def _of(self, function, s):
        given = call(function, s, f"{self._where}.eccentricity", f" at s = {s:g} m")
        return vector(self._where, f"eccentricity({s:g})", given, "m", size=2)


def mass_centre_of(rod):
    """The `MassCentre` of a rod, or None where it is on the axis everywhere."""
    if rod.eccentricity is None:
        return None
    found = MassCentre(rod, rod.eccentricity)
    return found if found.largest or any(map(callable, found._offsets)) else None


def _has_pieces(given):
    """Whether it is a list of pieces rather than one offset."""
    return isinstance(given, list | tuple) and bool(given) and all(isinstance(x, list | tuple) for x in given)
