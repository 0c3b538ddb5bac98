"""Where a rod touches its wall, as resultants: forces where contact begins or ends, and pressure between.

The pressure of an elastic wall replaces a concentrated force by a narrow peak, and the rod leaves the wall some way
beyond it. The moments of the pressure hardly change: from its integral and first moment over a length that holds the
peak follow the force and its place, where the regular pressure inside is known.
"""

from collections import namedtuple

import numpy as np

#: A resultant of the wall on the rod: from one arc length to another, m (equal for a concentrated force); force, N; and
#: the side on which it touches, rad, see `InHole.side`.
Contact = namedtuple("Contact", "start end force side")

# Lengths of the layer in an elastic wall, or nodes of the mesh, that hold a peak: at least, and where there is room.
_LAYERS, _NODES, _ROOMY = 4.0, 8, 2.5
# The regular pressure beside a peak is that of so many such lengths; contacts closer than this part of one are one.
_BESIDE, _APART = 1.0, 0.7
# A force below this times the regular pressure on the peak's length is none.
_NONE = 0.05


def contacts_along(s, sizes, pressure, side, layer, rings=()):
    """The `Contact`s along a rod, from its start on.

    Args:
        s: (elements, nodes) arc lengths of the nodes of each element, m; sizes: lengths that they stand for in it.
        pressure: N/m, zero where it does not touch; side: rad, likewise.
        layer: (4 EI/stiffness)^(1/4), the length of a layer in the wall, m.
        rings: [(s, force)] of forces at stations.
    """
    element = np.repeat(np.arange(len(s)), s.shape[1])
    s, sizes, pressure, side = (np.ravel(a) for a in (s, sizes, pressure, side))
    found = [Contact(x, x, float(force), float(side[np.argmin(np.abs(s - x))])) for x, force in rings if force > 0]
    for first, last in _groups(s, pressure, side, layer):
        found.extend(_resultants(*(a[first : last + 1] for a in (s, sizes, pressure, side, element)), layer))
    return sorted(found)


def _groups(s, pressure, side, layer):
    """(first, last) nodes of each contact."""
    touching = np.flatnonzero(pressure > 0)
    if not len(touching):
        return
    gaps = np.diff(s[touching])
    local = np.array([_APART * _width(s, i, layer) for i in touching[:-1]])
    turned = np.cos(np.diff(side[touching])) < 0
    ends = np.flatnonzero((gaps > local) | turned)
    for a, b in zip(np.append(0, ends + 1), np.append(ends, len(touching) - 1), strict=True):
        yield touching[a], touching[b]


def _width(s, i, layer):
    """Shortest length that holds a peak at node i, m."""
    before, after = max(0, i - _NODES // 2), min(len(s) - 1, i + _NODES // 2)
    return max(_LAYERS * layer, s[after] - s[before])


def _resultants(s, sizes, pressure, side, element, layer):
    """The `Contact`s of one group: the forces at its two ends, and the pressure between."""
    total, mean = float((pressure * sizes).sum()), _mean_side(side, pressure * sizes)
    widths = [_width(s, i, layer) for i in (0, len(s) - 1)]
    room = (s[-1] - s[0]) / ((1 + _BESIDE) * sum(widths))
    if room < 1:
        middle = float((pressure * sizes * s).sum() / total)
        short = s[-1] - s[0] <= max(widths)
        return [Contact(middle, middle, total, mean)] if short else [Contact(float(s[0]), float(s[-1]), total, mean)]
    widths = [min(room, _ROOMY) * width for width in widths]
    forces = []
    for x, width, sign in ((s - s[0], widths[0], 1), (s[-1] - s, widths[1], -1)):
        near = ~np.isin(element, element[x > width])  # whole elements
        forces.append(_force_at_end(x, sizes, pressure, near, width))
        if forces[-1]:
            place, force = forces[-1]
            start = float(s[0] + place if sign > 0 else s[-1] - place)
            forces[-1] = Contact(start, start, force, _mean_side(side[near], (pressure * sizes)[near]))
    ends = [x for x in forces if x]
    begin, end = (float(x.start) if x else float(edge) for x, edge in zip(forces, (s[0], s[-1]), strict=True))
    return [*ends, Contact(begin, end, total - sum(x.force for x in ends), mean)]


def _force_at_end(x, sizes, pressure, near, width):
    """(place, force) of the force at x = 0, near which a contact begins that goes on to larger x; None without one.

    With the regular pressure p0 + p1 x of the part beside the peak, the moments of the pressure up to b are those of
    the force P at a and of the regular pressure from a to b, which is an end of elements.
    """
    beside = (x > width) & (x <= (1 + _BESIDE) * width)
    if np.count_nonzero(beside) < 3 or not near.any():
        return None
    p1, p0 = np.polyfit(x[beside], pressure[beside], 1, w=np.sqrt(sizes[beside]))
    b = x[near].max(initial=0.0)
    whole = (pressure * sizes)[near]
    M0, M1 = whole.sum(), (whole * x[near]).sum()

    def left_over(a):
        """First moment about a of what the regular pressure leaves, for the force at a."""
        return M1 - a * M0 - _moment(p0, p1, b, a) + _moment(p0, p1, a, a)

    places = np.linspace(-width, b, 401)
    values = left_over(places)
    change = np.flatnonzero(values[:-1] * values[1:] <= 0)
    if not len(change):
        return None
    k = change[0]
    a = places[k] + (places[k + 1] - places[k]) * values[k] / (values[k] - values[k + 1] or 1.0)
    force = M0 - (p0 * (b - a) + p1 * (b * b - a * a) / 2)
    return (float(a), float(force)) if force > _NONE * abs(p0) * width else None


def _moment(p0, p1, x, a):
    """Integral of (p0 + p1 x)(x - a)."""
    return p0 * (x * x / 2 - a * x) + p1 * (x**3 / 3 - a * x * x / 2)


def _mean_side(side, weights):
    return float(np.arctan2((np.sin(side) * weights).sum(), (np.cos(side) * weights).sum()))
