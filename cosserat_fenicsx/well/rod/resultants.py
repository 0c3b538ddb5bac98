"""The forces of the wall on a rod in its hole: at its nodes, along its elements, at rings, and as resultants.

Resultants are forces where contact begins or ends, and pressure between.

The pressure of an elastic wall of stiffness k replaces a concentrated force P by a peak as narrow as the layer in the
wall, lam = (4 EI/k)^(1/4), and the rod leaves the wall some way beyond it. The moments of the pressure hardly change:
from its integral and first moment over a length that holds the peak follow the force and its place, where the regular
pressure inside is known.

The peak is a pivot, too: behind it the rod rises from the wall with the slope 0.1352 P lam^2/EI, and falls back under
the regular pressure q over a length of about g = (3.245 P lam^2/q)^(1/3). Up to g of about 5 lam it stays on the wall;
beyond, the contact splits, and the peak, taken for itself, holds P + 3/4 q g: up to 10 % too much, and in a stiffer
wall less by k^(-1/6) only. So the length that holds the peak is 2 g at least, and a peak and what follows are one
contact where the gap between them is shorter than that.

At a small kink of the wall the rod hardly leaves it: there the excess over the regular pressure is a force.
"""

from collections import namedtuple
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.well.contacts import quantile

#: A resultant of the wall on the rod: from one arc length to another, m (equal for a concentrated force); force, N; the
#: side on which it touches, rad, see `InHole.side`; and the error of a concentrated force, N.
Contact = namedtuple("Contact", "start end force side error", defaults=(np.nan,))


@dataclass(frozen=True)
class _Resultants:
    """Settings by which peaks of the pressure become forces. Lengths are multiples of the layer in the wall, lam, of
    the rise behind a peak, g (see the head of the module), or of the part of a contact that holds a peak."""

    layers: float = 4.0  # least length that holds a peak, in lam
    nodes: int = 8  # and in nodes of the mesh
    roomy: float = 2.5  # where there is room, this multiple of it
    far: float = 14.0  # and this many lam
    beside: float = 1.0  # length that gives the regular pressure beside a peak, over the length that holds the peak
    apart: float = 1.0  # largest gap, in lam, between contacts that count as one
    between: int = 4  # the same in nodes: on coarse meshes nodes touch by turns
    rises: float = 3.245  # g^3 q/(P lam^2)
    split: float = 2.0  # length in g that holds a peak behind which the rod rises
    excess: float = 0.75  # force in such a peak beyond P, over q g
    rounds: int = 6  # most iterations for the length that holds a peak
    same: float = 1.001  # factor to which that length is found
    shorter: float = 0.8  # the error of a force is its difference with a length shorter or longer by this factor
    caution: float = 2.0  # safety factor of a force's change by other lengths
    left: float = 0.25  # remaining share of a force's change from the coarser mesh
    soft: float = 2.5  # change of a force due to the wall's softness, over (lam / free span)^2
    least: float = 0.05  # smallest force at an end of a contact, over the regular pressure on the length of the peak
    peak: float = 0.2  # smallest force inside a contact, over the regular pressure on lam


_SET = _Resultants()


def contacts_along(s, sizes, pressure, side, layer, rings=(), kinks=()):
    """Resultants of a wall along a rod.

    Args:
        s: (elements, nodes) arc lengths of the nodes of each element, m; sizes: lengths that they stand for in it.
        pressure: N/m, zero where it does not touch; side: rad, likewise.
        layer: (4 EI/stiffness)^(1/4), the length of a layer in the wall, m: of each element, or one for all.
        rings: [(s, force)] of forces at stations.
        kinks: ascending arc lengths at which the regular pressure may jump, such as stations of the hole's survey and
            ends of sections, m.

    Returns:
        the `Contact`s, from the rod's start on; and (elements, nodes) the pressure without the peaks of concentrated
        forces, N/m: its integral and these forces are the sum of all forces. The error of a force is by a shorter
        length that holds its peak; where an end, a ring or a kink is nearer than the length that should, it is 3/4 q g,
        see above, at least.
    """
    shape, (s, sizes, pressure, side) = s.shape, (np.ravel(a) for a in (s, sizes, pressure, side))
    element, layer = np.repeat(np.arange(shape[0]), shape[1]), np.repeat(np.broadcast_to(layer, shape[0]), shape[1])
    along = _Along(s, sizes, pressure, side, element, layer)
    kinks = np.sort(np.concatenate([np.asarray(kinks, dtype=float), [x for x, _ in rings]]))
    found = [Contact(x, x, float(force), float(side[np.argmin(np.abs(s - x))]), 0.0)
             for x, force in rings if force > 0]  # fmt: skip
    regular = np.zeros(len(s))
    for group in _joined(along, list(_groups(along)), kinks):
        part = slice(group.first, group.last + 1)
        contacts, regular[part] = _resultants(_Along(*(a[part] for a in along)), group, kinks)
        found.extend(contacts)
    return sorted(found), regular.reshape(shape)


def with_errors(contacts, coarser, reach, layer, rings=()):
    """The `Contact`s with estimated errors of the forces at points from those in a rigid wall, N.

    The larger of the change with the length that holds the peak and of the remaining change from the coarser mesh, plus
    the remaining effect of the wall's softness: 2.5 times the square of the layer over the free span beside the force,
    of a ring over the distance to the next part of the wall, since other rings do not give way. The factors fit forces
    of reference strings and of a few wells; they are no bounds, and most errors are at most a tenth of them.

    Args:
        contacts: from `contacts_along`; coarser: those on the coarser mesh, or None without one. reach: distance in
            which the same force is looked for there, m; a force without one may be off by itself. layer: function of
            the arc length. rings: their arc lengths, m.
    """
    found = []
    for i, x in enumerate(contacts):
        if x.start != x.end:
            found.append(x)
            continue
        rigid = set(rings) if x.start in rings else ()
        before, after = ([y for y in part if y.start != y.end or y.start not in rigid]
                         for part in (contacts[:i], contacts[i + 1 :]))  # fmt: skip
        gaps = [x.start - (before[-1].end if before else 0.0), after[0].start - x.end if after else np.inf]
        lam = float(layer(x.start))
        soft = _SET.soft * (lam / min((gap for gap in gaps if gap > lam), default=np.inf)) ** 2
        change = x.force
        if coarser is not None:
            near = [y for y in coarser if y.start == y.end and np.cos(y.side - x.side) > 0]
            nearest = min(near, key=lambda y: abs(y.start - x.start), default=None)
            if nearest and abs(nearest.start - x.start) < reach:
                change = _SET.left * abs(nearest.force - x.force)
        found.append(x._replace(error=min(x.force, max(_SET.caution * x.error, change) + soft * x.force)))
    return found


#: Arrays over the nodes, see `contacts_along`, with the number of the element.
_Along = namedtuple("_Along", "s sizes pressure side element layer")
#: Nodes of one contact, the first and the last; the `_Peak`s that have split from its two ends, or None; how far peaks
#: that have split are off if they are taken for themselves, N.
_Group = namedtuple("_Group", "first last split error", defaults=((None, None), 0.0))


def _groups(along):
    """(first, last) nodes of each stretch without a gap."""
    touching = np.flatnonzero(along.pressure > 0)
    if not len(touching):
        return
    apart = (np.diff(along.s[touching]) > _SET.apart * along.layer[touching[1:]]) & (np.diff(touching) > _SET.between)
    turned = np.cos(np.diff(along.side[touching])) < 0
    ends = np.flatnonzero(apart | turned)
    for a, b in zip(np.append(0, ends + 1), np.append(ends, len(touching) - 1), strict=True):
        yield touching[a], touching[b]


def _joined(along, groups, kinks):
    """[`_Group`]: stretches, and the peaks that have split from their ends with them."""
    peaks = {i: peak for i, group in enumerate(groups) if (peak := _peak_alone(along, *group))}
    split, errors = {}, {}
    for i, peak in peaks.items():
        beside = [j for j in (i - 1, i + 1) if 0 <= j < len(groups) and j not in peaks]
        near = [(j, found) for j in beside if (found := _behind(along, groups[i], peak, groups[j], kinks))]
        if len(near) == 1 and near[0][1].belongs:
            split[near[0][0], near[0][0] > i] = i
            errors[near[0][0]] = errors.get(near[0][0], 0.0) + near[0][1].excess
        elif near:
            errors[i] = sum(found.excess for _, found in near)
    for j, (first, last) in enumerate(groups):
        if j in peaks:
            if j not in split.values():
                yield _Group(first, last, error=errors.get(j, 0.0))
            continue
        before, after = split.get((j, True)), split.get((j, False))
        ends = first if before is None else groups[before][0], last if after is None else groups[after][1]
        yield _Group(*ends, tuple(i if i is None else peaks[i] for i in (before, after)), errors.get(j, 0.0))


#: A peak taken for itself: its force, N; its place, m; its first and its last node.
_Peak = namedtuple("_Peak", "force at first last")
#: The part of a contact behind a peak: whether it belongs to the peak, and its force that the peak then holds, N.
_Behind = namedtuple("_Behind", "belongs excess")


def _peak_alone(along, first, last):
    """The `_Peak` of a stretch that is no longer than one, else None."""
    s = along.s[first : last + 1]
    if s[-1] - s[0] > max(_width(along.s, i, along.layer) for i in (first, last)):
        return None
    weight = (along.pressure * along.sizes)[first : last + 1]
    return _Peak(float(weight.sum()), float(weight @ s / weight.sum()), first, last)


def _behind(along, here, peak, there, kinks):
    """The `_Behind` of a stretch near a peak, one contact where pressure from the force on balances them; or None."""
    before = there[1] < here[0]
    near, edge, outer = (there[1], here[0], here[1]) if before else (there[0], here[1], here[0])
    if np.cos(along.side[near] - along.side[edge]) < 0:
        return None
    stretch = slice(there[0], there[1] + 1)
    q = _median(along.pressure[stretch], along.sizes[stretch])
    g = _length(peak.force, along.layer[edge], q)
    if abs(along.s[near] - along.s[edge]) > _SET.split * g:
        return None
    gap = abs(along.s[near] - peak.at)
    force = peak.force - q * gap
    moved = q * gap**2 / 2 / force if force > 0 else np.inf
    low, high = sorted((along.s[near], peak.at))
    jumps = ((kinks > low - along.layer[edge]) & (kinks < high + along.layer[edge])).any()
    return _Behind(not jumps and moved <= abs(along.s[outer] - peak.at), _SET.excess * q * g)


def _length(force, layer, pressure):
    """g, see above, m."""
    return (_SET.rises * force * layer**2 / pressure) ** (1 / 3) if force > 0 and pressure > 0 else 0.0


def _width(s, i, layer):
    """Shortest length that holds a peak at node i, m."""
    before, after = max(0, i - _SET.nodes // 2), min(len(s) - 1, i + _SET.nodes // 2)
    return max(_SET.layers * layer[i], s[after] - s[before])


def _resultants(along, group, kinks):
    """The `Contact`s of a group: forces at its ends, the pressure between; and (n,) its regular pressure."""
    s, sizes, pressure, side, element, layer = along
    weight = pressure * sizes
    total, mean = float(weight.sum()), _mean_side(side, weight)
    widths = [_width(s, i, layer) for i in (0, len(s) - 1)]
    room = (s[-1] - s[0]) / ((1 + _SET.beside) * sum(widths))
    if room < 1:
        if s[-1] - s[0] <= max(widths):
            middle = float((weight * s).sum() / total)
            return [Contact(middle, middle, total, mean, group.error)], np.zeros(len(s))
        return [Contact(float(s[0]), float(s[-1]), total, mean)], np.full(len(s), total / sizes.sum())
    far = [max(_SET.roomy, _SET.far * layer[i] / widths[i]) for i in (0, -1)]
    usual, taken = [min(room, x) * width for x, width in zip(far, widths, strict=True)], widths.copy()
    forces, ends, regular, inside = [], [float(s[0]), float(s[-1])], pressure.copy(), np.ones(len(s), dtype=bool)
    for i, (x, sign) in enumerate(((s - s[0], 1), (s[-1] - s, -1))):
        bound = (s[-1] - s[0]) / (1 + _SET.beside) - taken[1 - i]
        jumps = np.sort(sign * (kinks - (s[0], s[-1])[i]))
        found = _at_end(x, along, widths[i], min(usual[i], bound), bound, jumps[jumps > layer[-i]])
        taken[i] = found.width if found else min(usual[i], bound)
        near = ~np.isin(element, element[x > taken[i]])  # whole elements
        inside[near] = False
        if found is None:
            if peak := group.split[i]:
                forces.append(Contact(peak.at, peak.at, peak.force, mean, group.error))
                alone = slice(peak.first - group.first, peak.last + 1 - group.first)
                regular[alone], inside[alone] = 0.0, False
            continue
        within = np.where(x[near] >= found.begins, np.maximum(found.line(x[near]), 0.0), 0.0)
        if not within.any():
            continue
        at = ends[i] + sign * found.place
        ends[i] += sign * found.begins
        forces.append(Contact(at, at, found.force, _mean_side(side[near], weight[near]), found.error))
        regular[near] = within * (weight[near].sum() - found.force) / (within @ sizes[near])
    for peak, level in _peaks(s, sizes, pressure, inside, layer):
        excess = (pressure[peak] - level) * sizes[peak]
        at, force = float(excess @ s[peak] / excess.sum()), float(excess.sum())
        error = min(force, 2 * _SET.excess * level * _length(force, layer[peak.start], level))
        forces.append(Contact(at, at, force, _mean_side(side[peak], excess), error))
        regular[peak] = level
    return [*forces, Contact(*ends, total - sum(x.force for x in forces), mean)], regular


def _peaks(s, sizes, pressure, inside, layer):
    """(slice of nodes, regular pressure) of each peak inside a contact, such as at a kink of the hole's axis too small
    for the rod to leave the wall; only where the mesh resolves the layer: on coarse ones nodes touch by turns."""
    rises = np.diff(pressure, prepend=np.inf, append=np.inf)
    tops = np.flatnonzero(inside & (rises[:-1] > 0) & (rises[1:] <= 0))
    until = 0  # the end of the peak before
    for i in tops:
        longest = _SET.roomy * _SET.layers * layer[i]
        if i < until or s[min(i + _SET.nodes // 2, len(s) - 1)] - s[max(i - _SET.nodes // 2, 0)] > longest:
            continue
        beside = [(s > s[i] - longest) & (s < s[i]), (s > s[i]) & (s < s[i] + longest)]
        level = max(_median(pressure[part], sizes[part]) for part in beside)
        lower = np.flatnonzero(pressure <= level)
        k = np.searchsorted(lower, i)
        if pressure[i] <= level or not 0 < k < len(lower):
            continue
        first, last = max(lower[k - 1] + 1, until), lower[k]  # the nodes above the regular pressure
        excess = (pressure[first:last] - level) @ sizes[first:last]
        if inside[first:last].all() and s[last] - s[first] < longest and excess > _SET.peak * level * layer[i]:
            until = last
            yield slice(first, last), level


def _median(values, weights):
    return quantile(values, weights, 0.5) if len(values) else 0.0


#: A force at the end of a contact: see `_force_at_end`; the length that holds its peak, m; its error, N.
_AtEnd = namedtuple("_AtEnd", "place begins force line width error")


def _at_end(x, along, shortest, usual, bound, jumps):
    """The `_AtEnd` of the force at x = 0, or None, by lengths that may hold the peak; `jumps`: places of kinks."""
    jump = jumps[0] if len(jumps) and jumps[0] > 0 else np.inf
    width = usual if jump >= (1 + _SET.beside) * usual else max(shortest, jump / (1 + _SET.beside))
    found = _force_at_end(x, along, width)
    if found is None:
        return None
    for _ in range(_SET.rounds):
        place, _, force, line = found
        q = max(float(line(width)), 0.0)
        g = _length(force, along.layer[np.argmin(np.abs(x - place))], q)
        wanted = place + _SET.split * g
        longer = min(wanted, bound)
        again = _force_at_end(x, along, longer) if longer > _SET.same * width else None
        if again is None:
            break
        found, width = again, longer
    room = min((1 + _SET.beside) * bound, jump) >= (1 + _SET.beside) * width / _SET.shorter
    longer = room and wanted > _SET.shorter * width
    other = _force_at_end(x, along, width / _SET.shorter if longer else _SET.shorter * width)
    error = abs(other[2] - force) if other else force
    if wanted > _SET.same * width or jump < (1 + _SET.beside) * width:
        error = max(error, min(force, _SET.excess * q * g))
    return _AtEnd(*found, width, error)


def _force_at_end(x, along, width):
    """(place of the force, where the regular pressure begins, force, regular pressure as a function of x) of the force
    at x = 0, near which a contact begins that continues to larger x; None without one.

    With the regular pressure p0 + p1 x of the part beside the peak, the moments of the pressure up to b, an end of
    elements, are those of the force P at a and of the regular pressure from a to b. Where there is no such place, since
    the rod leaves the wall beyond the edge of a wider part, those of P at 0 and of the pressure from a place c on.
    """
    sizes, pressure = along.sizes, along.pressure
    near = ~np.isin(along.element, along.element[x > width])  # whole elements
    beside = (x > width) & (x <= (1 + _SET.beside) * width)
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
    if not _SET.least * abs(line(0.0)) * width < force < M0:
        return None
    return 0.0 if at_edge else begins, begins, force, line


def _moments(line, x):
    """Integral of x times the line, up to x."""
    return (line * np.polynomial.Polynomial([0.0, 1.0])).integ()(x)


def _mean_side(side, weights):
    return float(np.arctan2((np.sin(side) * weights).sum(), (np.cos(side) * weights).sum()))


#: Share of the string's length on which differences between two meshes are below the reported errors; beside
#: concentrated forces they are larger.
MOSTLY = 0.95


def along_elements(mean, sizes, nodes):
    """(elements, nodes) values that have the mean of each element, and a slope from the means of its neighbours.

    The slope is the smaller one of those to the two neighbours, and none at a peak (B. van Leer, J. Comput. Phys. 32
    (1979) 101, doi:10.1016/0021-9991(79)90145-1), so that no value is beyond the neighbours' means. mean, sizes:
    (elements,) means, and lengths of the elements, m. nodes: in an element, from 0 to 1."""
    steps = np.diff(mean) / ((sizes[1:] + sizes[:-1]) / 2)
    before, after = np.append(steps[:1], steps), np.append(steps, steps[-1:])
    slope = np.where(before * after > 0, np.sign(before) * np.minimum(abs(before), abs(after)), 0.0)
    if len(mean) < 2:
        slope = np.zeros(1)
    return np.maximum(mean[:, None] + (slope * sizes)[:, None] * (nodes - 0.5), min(0.0, mean.min()))


def apart_mostly(here, there, lengths):
    """The difference of two arrays that `MOSTLY` of the length is below; lengths: those that the places stand for."""
    return quantile(np.abs(here - there), lengths, MOSTLY)
