"""Where a string touches the wall, and how much each stretch on one side carries."""

import math
from typing import NamedTuple, Self

import numpy as np

from cosserat_fenicsx.well.softstring import UP_TO

#: Forces at points are rough where their estimated error is above this part of them.
ROUGH = 5e-3
#: Inclinations (rad) below this have no high side.
VERTICAL = 1e-9
_SIDES = ("high", "right", "low", "left")


class _Stretch(NamedTuple):
    top: float
    bottom: float
    force: float
    side: str


class WallContact(_Stretch):
    """Where a string touches the wall, and how much it bears there: a tuple (top, bottom, force, side).

    Attributes:
        top, bottom: measured depths, m; equal for a force at a point.
        force: on the wall, across the hole, N: of the whole stretch.
        side: "high", "right", "low" or "left", looking down the hole; "wall" where it is vertical.
        error: estimated, of a force at a point from that in a rigid wall, N; NaN of a stretch.
    """

    error: float = math.nan

    def __new__(cls, top: float, bottom: float, force: float, side: str, error: float = math.nan) -> Self:
        made = super().__new__(cls, top, bottom, force, side)
        made.error = error
        return made

    @property
    def at_point(self) -> bool:
        """Whether it is a concentrated force: of a stabiliser or the bit, or where the string leaves the wall."""
        return self.top == self.bottom


def side_in_space(tangents, outward):
    """(n,) angles of directions across the hole (n, 3), rad clockwise from its high side, looking down it; from the
    first axis, north, where it is vertical. tangents: (n, 3) of the hole's axis."""
    high = high_side(tangents, north=True)
    right = np.cross(tangents, high)
    return np.arctan2((outward * right).sum(axis=1), (outward * high).sum(axis=1))


def high_side(tangents, north=False):
    """(n, 3) unit vectors to the high side by tangents (n, 3); where it is vertical zero, or to the north."""
    high = tangents * tangents[:, 2:] - (0.0, 0.0, 1.0)
    size = np.linalg.norm(high, axis=1, keepdims=True)
    vertical = np.array([1.0, 0.0, 0.0]) - tangents[:, :1] * tangents if north else 0.0
    return np.where(size > 1e-9, high / np.where(size > 1e-9, size, 1.0), vertical)


def stretches(md, where):
    """[(from, to)] depths of the stretches on which a condition (n,) holds, those without length left out."""
    ends = np.flatnonzero(np.diff(where, prepend=False, append=False)).reshape(-1, 2) - (0, 1)
    return [(float(md[a]), float(md[b])) for a, b in ends if md[b] > md[a]]


def sides_of(pieces, solved, climbing):
    """(n, m) angles of contact at the places of a `Solved`, rad clockwise from the high side; see `TorqueAndDrag`."""
    chain = solved.chain
    rows = chain.columns
    n, b = rows.down(rows.length * solved.at)[1], rows.b
    load, aside = rows.curvature * solved.tension + rows.weight * n, rows.weight * b
    # high side -(n, b), and to its right -(-b, n), in the plane of normal and binormal
    side = np.arctan2(load * b - aside * n, -(load * n + aside * b))
    if climbing:
        side = side - np.arctan(pieces.around * pieces.friction)[chain.origin, None]
    leans = np.hypot(n, b) > 1e-9
    side = np.where(leans & (solved.side > 0), side % (2 * np.pi), np.nan)
    for end, beside in ((0, 1), (-1, -2)):  # a bend that starts vertically presses to one side from its first point on
        side[:, end] = np.where(leans[:, end], side[:, end], side[:, beside])
    return side


def quantile(values, weights, share):
    """The value (n,) below which a share of the weights (n,) lies."""
    order = np.argsort(values)
    up_to = np.cumsum(weights[order])
    return float(values[order[min(np.searchsorted(up_to, share * up_to[-1]), len(order) - 1)]])


def name_of_side(side):
    """The name of a side by its angle (rad clockwise from the high side), "wall" for NaN."""
    return _SIDES[round(side / (np.pi / 2)) % 4] if np.isfinite(side) else "wall"


def side_force_up_to(solved):
    """(n, m) force of the wall (N) from the lower end up to the places of a `Solved`."""
    within = (solved.side @ UP_TO.T) * solved.chain.length[:, None]
    return np.cumsum(within[:, -1:], axis=0) - within[:, -1:] + within


def contacts_of(md, side_force, side, up_to):
    """The `WallContact`s, see `TorqueAndDrag.contacts`; up_to: (n,) integral of the side force over the depth, N."""
    quadrant = np.where(side_force > 0, 4, 5)
    touched = np.isfinite(side)
    quadrant[touched] = np.round(side[touched] / (np.pi / 2)) % 4
    ends = np.flatnonzero(np.diff(quadrant)) + 1
    found = []
    for stretch in np.split(np.arange(len(md)), ends):
        kind = int(quadrant[stretch[0]])
        # a stretch that ends inside a piece reaches to the next point
        last = min(stretch[-1] + 1, len(md) - 1)
        points = np.append(stretch, last) if last > stretch[-1] else stretch
        force = up_to[points[-1]] - up_to[points[0]]
        if kind < 5 and md[points[-1]] > md[points[0]]:
            name = (*_SIDES, "wall")[kind]
            found.append(WallContact(float(md[points[0]]), float(md[points[-1]]), float(force), name))
    return found
