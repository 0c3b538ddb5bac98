"""Shapes of a structure that would be tangled in one place are drawn beside each other."""

import itertools

import numpy as np

# Crossings in the picture, on average of two shapes, from which on shapes are tangled.
_TANGLED = 4
# Lines in which crossings are counted, of one shape, and the fewest of one rod; gap between shapes over the widest.
_PIECES, _FEWEST, _GAP = 600, 8, 0.18


def tangled(shapes, right, above):
    """Whether shapes cross each other so often in the picture that they cannot be told apart.

    Args:
        shapes: of each shape the list of the centrelines of its rods, (n, 3), m.
        right, above: unit vectors (3,) of the picture.
    """
    flat = [_segments(lines, np.column_stack([right, above])) for lines in shapes]
    pairs = list(itertools.combinations(flat, 2))
    return bool(pairs) and sum(itertools.starmap(_crossings, pairs)) >= _TANGLED * len(pairs)


def _segments(lines, axes):
    """Starts and vectors, (n, 2) each, of straight pieces of lines in the picture."""
    pieces = max(_FEWEST, _PIECES // len(lines))
    some = [line[np.linspace(0, len(line) - 1, min(pieces + 1, len(line))).astype(int)] @ axes for line in lines]
    return np.concatenate([line[:-1] for line in some]), np.concatenate([np.diff(line, axis=0) for line in some])


def _crossings(one, other):
    """How many pieces of one shape cross pieces of the other."""
    (p, u), (q, v) = one, other
    apart = q[None] - p[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):  # parallel pieces
        scale = _cross(u[:, None], v[None])
        shares = _cross(apart, v[None]) / scale, _cross(apart, u[:, None]) / scale
    return int(np.logical_and(*((share > 0) & (share < 1) for share in shares)).sum())


def _cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def shifts(shapes, right):
    """Vectors (3,), m, that bring shapes beside each other, from the left to the right; the first one stays."""
    along = [np.concatenate(lines) @ right for lines in shapes]
    gap, edge, found = _GAP * max(map(np.ptp, along)), along[0].min(), []
    for places in along:
        found.append((edge - places.min()) * right)
        edge += np.ptp(places) + gap
    return found


def around(lines, points, up):
    """Points (n, 3), m: those of the lines of one shape, and at its place the heights of all points along `up`, an axis
    of space."""
    first, axis = np.concatenate(lines), int(np.argmax(np.abs(up)))
    ends = np.repeat(first.mean(axis=0)[None], 2, axis=0)
    ends[:, axis] = points[:, axis].min(), points[:, axis].max()
    return np.concatenate([first, ends])
