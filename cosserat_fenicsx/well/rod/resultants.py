"""Where a rod touches its wall, as resultants: forces where contact begins or ends, and pressure between.

The pressure of an elastic wall replaces a concentrated force by a narrow peak, and the rod leaves the wall some way
beyond it. The moments of the pressure hardly change: from its integral and first moment over a length that holds the
peak follow the force and its place, where the regular pressure inside is known.

At a small kink of the wall the rod does not leave it, or hardly: there what is above the regular pressure is a force.
"""

from collections import namedtuple

import numpy as np

#: A resultant of the wall on the rod: from one arc length to another, m (equal for a concentrated force); force, N; and
#: the side on which it touches, rad, see `InHole.side`.
Contact = namedtuple("Contact", "start end force side")

# Lengths of the layer in an elastic wall, or nodes of the mesh, that hold a peak: at least, and where there is room.
_LAYERS, _NODES, _ROOMY = 4.0, 8, 2.5
# The regular pressure beside a peak is that of so many such lengths.
_BESIDE = 1.0
# Contacts are one where the gap between them is below so many lengths of the layer, or has no more than so many nodes:
# nodes touch by turns where the mesh is coarse.
_APART, _BETWEEN = 1.0, 4
# A force below this times the regular pressure on the peak's length is none; inside a contact, on the layer's length.
_NONE, _PEAK = 0.05, 0.2


def contacts_along(s, sizes, pressure, side, layer, rings=()):
    """Resultants of a wall along a rod.

    Args:
        s: (elements, nodes) arc lengths of the nodes of each element, m; sizes: lengths that they stand for in it.
        pressure: N/m, zero where it does not touch; side: rad, likewise.
        layer: (4 EI/stiffness)^(1/4), the length of a layer in the wall, m.
        rings: [(s, force)] of forces at stations.

    Returns:
        the `Contact`s, from the rod's start on; and (elements, nodes) the pressure without the peaks of concentrated
        forces, N/m: its integral and these forces are the sum of all forces.
    """
    element, shape = np.repeat(np.arange(len(s)), s.shape[1]), s.shape
    s, sizes, pressure, side = (np.ravel(a) for a in (s, sizes, pressure, side))
    found = [Contact(x, x, float(force), float(side[np.argmin(np.abs(s - x))])) for x, force in rings if force > 0]
    regular = np.zeros(len(s))
    for first, last in _groups(s, pressure, side, layer):
        group = slice(first, last + 1)
        contacts, regular[group] = _resultants(*(a[group] for a in (s, sizes, pressure, side, element)), layer)
        found.extend(contacts)
    return sorted(found), regular.reshape(shape)


def _groups(s, pressure, side, layer):
    """(first, last) nodes of each contact."""
    touching = np.flatnonzero(pressure > 0)
    if not len(touching):
        return
    apart = (np.diff(s[touching]) > _APART * layer) & (np.diff(touching) > _BETWEEN)
    turned = np.cos(np.diff(side[touching])) < 0
    ends = np.flatnonzero(apart | turned)
    for a, b in zip(np.append(0, ends + 1), np.append(ends, len(touching) - 1), strict=True):
        yield touching[a], touching[b]


def _width(s, i, layer):
    """Shortest length that holds a peak at node i, m."""
    before, after = max(0, i - _NODES // 2), min(len(s) - 1, i + _NODES // 2)
    return max(_LAYERS * layer, s[after] - s[before])


def _resultants(s, sizes, pressure, side, element, layer):
    """The `Contact`s of one group, the forces at its two ends and the pressure between; and (n,) its regular pressure.
    Where the group is too short to tell them apart, its regular pressure is its mean, or zero where it is one force."""
    weight = pressure * sizes
    total, mean = float(weight.sum()), _mean_side(side, weight)
    widths = [_width(s, i, layer) for i in (0, len(s) - 1)]
    room = (s[-1] - s[0]) / ((1 + _BESIDE) * sum(widths))
    if room < 1:
        if s[-1] - s[0] <= max(widths):
            middle = float((weight * s).sum() / total)
            return [Contact(middle, middle, total, mean)], np.zeros(len(s))
        return [Contact(float(s[0]), float(s[-1]), total, mean)], np.full(len(s), total / sizes.sum())
    widths = [min(room, _ROOMY) * width for width in widths]
    forces, ends, regular, inside = [], [float(s[0]), float(s[-1])], pressure.copy(), np.ones(len(s), dtype=bool)
    for i, (x, width, sign) in enumerate(((s - s[0], widths[0], 1), (s[-1] - s, widths[1], -1))):
        near = ~np.isin(element, element[x > width])  # whole elements
        found = _force_at_end(x, sizes, pressure, near, width)
        inside[near] = False
        if found is None:
            continue
        place, begins, force, line = found
        within = np.where(x[near] >= begins, np.maximum(line(x[near]), 0.0), 0.0)
        if not within.any():
            continue
        at = ends[i] + sign * place
        ends[i] += sign * begins
        forces.append(Contact(at, at, force, _mean_side(side[near], weight[near])))
        regular[near] = within * (weight[near].sum() - force) / (within @ sizes[near])
    for peak, level in _peaks(s, sizes, pressure, inside, layer):
        excess = (pressure[peak] - level) * sizes[peak]
        at, force = float(excess @ s[peak] / excess.sum()), float(excess.sum())
        forces.append(Contact(at, at, force, _mean_side(side[peak], excess)))
        regular[peak] = level
    return [*forces, Contact(*ends, total - sum(x.force for x in forces), mean)], regular


def _peaks(s, sizes, pressure, inside, layer):
    """(slice of nodes, regular pressure) of each peak inside a contact, such as at a kink of the hole's axis too small
    for the rod to leave the wall; only where the mesh resolves the layer: on coarse ones nodes touch by turns."""
    longest = _ROOMY * _LAYERS * layer
    rises = np.diff(pressure, prepend=np.inf, append=np.inf)
    tops = np.flatnonzero(inside & (rises[:-1] > 0) & (rises[1:] <= 0))
    until = 0  # the end of the peak before
    for i in tops:
        if i < until or s[min(i + _NODES // 2, len(s) - 1)] - s[max(i - _NODES // 2, 0)] > longest:
            continue
        beside = [(s > s[i] - longest) & (s < s[i]), (s > s[i]) & (s < s[i] + longest)]
        level = max(_median(pressure[part], sizes[part]) for part in beside)
        lower = np.flatnonzero(pressure <= level)
        k = np.searchsorted(lower, i)
        if pressure[i] <= level or not 0 < k < len(lower):
            continue
        first, last = max(lower[k - 1] + 1, until), lower[k]  # the nodes above the regular pressure
        excess = (pressure[first:last] - level) @ sizes[first:last]
        if inside[first:last].all() and s[last] - s[first] < longest and excess > _PEAK * level * layer:
            until = last
            yield slice(first, last), level


def _median(values, weights):
    order = np.argsort(values)
    up_to = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(up_to, up_to[-1] / 2)]) if len(values) else 0.0


def _force_at_end(x, sizes, pressure, near, width):
    """(place of the force, where the regular pressure begins, force, regular pressure as a function of x) of the force
    at x = 0, near which a contact begins that goes on to larger x; None without one.

    With the regular pressure p0 + p1 x of the part beside the peak, the moments of the pressure up to b, an end of
    elements, are those of the force P at a and of the regular pressure from a to b. Where there is no such place, since
    the rod leaves the wall beyond the edge of a wider part, those of P at 0 and of the pressure from a place c on.
    """
    beside = (x > width) & (x <= (1 + _BESIDE) * width)
    if np.count_nonzero(beside) < 3 or not near.any():
        return None
    line = np.polynomial.Polynomial(np.polyfit(x[beside], pressure[beside], 1, w=np.sqrt(sizes[beside]))[::-1])
    b = x[near].max(initial=0.0)
    whole = (pressure * sizes)[near]
    M0, M1 = whole.sum(), (whole * x[near]).sum()
    places = np.linspace(-width, b, 401)
    sum_from, moment_from = (line.integ()(b) - line.integ()(places), _moments(line, b) - _moments(line, places))
    left_over = M1 - places * M0 - (moment_from - places * sum_from)  # about the place; its slope is minus the force
    k = np.flatnonzero((left_over[:-1] >= 0) & (left_over[1:] < 0))
    at_edge = not len(k)
    if at_edge:
        left_over = moment_from - M1
        k = np.flatnonzero((left_over[:-1] >= 0) & (left_over[1:] < 0) & (places[:-1] >= 0))
        if not len(k):
            return None
    i = k[0]
    begins = float(places[i] + (places[i + 1] - places[i]) * left_over[i] / (left_over[i] - left_over[i + 1]))
    force = float(M0 - (line.integ()(b) - line.integ()(begins)))
    if not _NONE * abs(line(0.0)) * width < force < M0:
        return None
    return 0.0 if at_edge else begins, begins, force, line


def _moments(line, x):
    """Integral of x times the line, up to x."""
    return (line * np.polynomial.Polynomial([0.0, 1.0])).integ()(x)


def _mean_side(side, weights):
    return float(np.arctan2((np.sin(side) * weights).sum(), (np.cos(side) * weights).sum()))
