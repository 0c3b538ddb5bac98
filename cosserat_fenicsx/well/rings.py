"""Bits and stabilisers, which touch at a place, and what they change of the forces of a soft string.

A soft string lies on the wall with its weight everywhere. A stiff one rests on its rings: bits and stabilisers carry
the load of the spans beside them, on a larger radius; and two rings close to each other pry, one on the low and one on
the high side, where a longer span beside them bends the string between them.
"""

from collections import namedtuple
from itertools import pairwise

import numpy as np

from cosserat_fenicsx.well.components import Bit, Stabiliser

#: Of a place: measured depth s (m), clearance (m), radius of contact (m), radius of the body beside it (m).
Ring = namedtuple("Ring", "s clearance radius body")
#: Of the string between two rings: its length, m; load, N/m; the moment (N m) at a ring that clamps it, the angle at
#: one that does not; what it loads a ring with, N.
_Span = namedtuple("_Span", "length load moment angle carried")

# A beam under its load q that is clamped at a ring, and touches the wall, lower by d, with no curvature: it spans
# (72 EI d/q)^(1/4) = l and bends with q l^2/6 at the ring, which carries 2/3 of q l. With a hinge at the ring it turns
# there by less than q l^3/(24 EI), which is that of a beam between two hinges.
_SPAN, _MOMENT, _CARRIED, _TURN = 72.0, 1 / 6, 2 / 3, 1 / 24
# Caution over moments, which are sums of sizes; the most by which compression enlarges bending; distance from a ring up
# to which the string matters to it, m.
_CAUTION, _ENLARGED, _REACH = 1.5, 5.0, 60.0
# Length of a span that there is none, m.
_NONE = 1e-9


def is_ring(component):
    """Whether a component touches at a place."""
    return isinstance(component, Bit | Stabiliser)


def ring_of(place, hole):
    """The `Ring` of a component in its place: a stabiliser touches in the middle of its length, a bit at its end."""
    s = place.bottom if isinstance(place.component, Bit) else (place.top + place.bottom) / 2
    radius = place.component.contact_radius
    clearance = max(0.0, float(hole.at(s, "diameter")) / 2 - radius)
    return Ring(s, clearance, radius, place.component.outer_diameter / 2)


def free_span(EI, d, q):
    """Length (m) that a beam of bending stiffness EI (N m^2) under a load q (N/m) spans from where it is clamped to a
    wall that is lower by d (m); 0 without a load."""
    return (_SPAN * EI * d / q) ** 0.25 if q > 0 else 0.0


def prying(rings, depth, along):
    """What a soft string leaves out at its rings, as sums of sizes.

    Args:
        rings: [`Ring`] from the bit up. depth: of the string's end, m. along: function of two measured depths (m) that
            gives the largest load across (N/m), compression (N), curvature (1/m), clearance (m) and EI (N m^2) of the
            string between them.

    Returns:
        (rings,) sum of the forces by which each pries, N; (rings,) load that it takes from the body, N.
    """
    if not rings:
        return np.zeros(0), np.zeros(0)
    places = [depth, *(ring.s for ring in rings), 0.0]
    clear = [0.0, *(ring.clearance for ring in rings), 0.0]
    spans = [_span(a - b, along(max(b, a - _REACH), a), max(pair))
             for (a, b), pair in zip(pairwise(places), pairwise(clear), strict=True)]  # fmt: skip
    pries, carries = np.zeros(len(rings)), np.array([a.carried + b.carried for a, b in pairwise(spans)])
    for i, (below, here, above) in enumerate(zip(spans, spans[1:-1], spans[2:], strict=False)):
        angle = max(below.angle, above.angle)
        free = (rings[i].clearance + rings[i + 1].clearance) / here.length  # the angle that the clearances leave
        if angle > free:
            pair = _CAUTION * (below.moment + above.moment) * (1 - free / angle) / here.length
            pries[i : i + 2] += max(0.0, pair - here.load * here.length / 2)
    return pries, carries


def _span(length, largest, clearance):
    """The `_Span` of so much string beside a ring with a clearance."""
    q, compression, curvature, room, EI = largest
    if not EI > 0 or not q > 0 or length < _NONE:
        return _Span(length, q, 0.0, 0.0, q * length / 2)
    free = free_span(EI, room + clearance, q)
    short = min(length, free)
    larger = min(1 / max(1 - compression * short**2 / (np.pi**2 * EI), 1e-9), _ENLARGED)
    angle = larger * q * short**3 * _TURN / EI + curvature * short / 2
    return _Span(
        length, q, larger * q * short**2 * _MOMENT + EI * curvature, angle, q * min(length / 2, _CARRIED * free)
    )
