"""Model error of the soft string: by how much the rod in contact may differ from it, and why.

The soft string lies on the axis. With a clearance, a string changes sides where its load turns round, and spans the
hole between without touching it; the friction that is missed there is mu times

- T sqrt(2 d dk) where the hole's curvature jumps by dk: a string that leaves a wall tangentially reaches the other
  side, at a distance d, after that angle. On a build section of radius R it is T sqrt(4 r/R) for a clearance r.
- (2 d q T)^(1/2) below the surface, where the rod hangs on the axis, and comes to the wall farther down; and as much as
  it spans there by its bending stiffness.
- the load on the span with which it bridges a wider part of the hole, times the difference of friction there.
- (6 d T)^(2/3) q'^(1/3) where the load changes its sign within a bend, with the rate q': the span on which it moves
  the string by d.

A string on the low side also hangs lower by r sin(inclination), and is moved along the hole by r times the angle of its
bends, since its way there is longer or shorter than the axis; its weight feels both. Where the hole bends at an end at
which the string is held on the axis, it leaves the axis at the angle a = k (x + sqrt(x^2 + 2 d/k)), x = sqrt(EI/T),
which takes T a^2/2 from its tension. Bending stiffness changes the friction by mu EI dk^2, and more where
the moment EI k jumps by more than the load beside it can take. Bits and stabilisers bear
the load of their spans on a larger radius, and pry, see `prying`. A snake adds at most half the wall force of a helix;
its friction makes the string a helix farther down, and the helix multiplies it on the way up: the string is solved
again with a helix wherever there may be one. A helix is pressed on the wall by its own force alone, on average, and not
by its load as well, as is usually reckoned. These are sums of sizes: differences of opposite signs do not cancel.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cosserat_fenicsx.well import criteria
from cosserat_fenicsx.well.buckled import LockUp, earliest_helix, growth
from cosserat_fenicsx.well.pieces import free_span, prying
from cosserat_fenicsx.well.softstring import Chain


@dataclass(frozen=True)
class _Estimate:
    """Settings of the estimate."""

    # Safety factor of the effects of the clearance: on 240 random strings the difference from the rod was up to 1.2
    # times their sum of sizes.
    caution: float = 1.25
    fine: int = 512  # sample points on a piece in the search for snakes
    short: float = 3.0  # length of components whose own bending stiffness does not count, m
    nearest: float = 0.3  # least distance of a pair of forces, m


_SET = _Estimate()


class ModelError(NamedTuple):
    """Effects that the soft string neglects, on the hook load (N), or on the torque (N m) of a rotating string."""

    clearance: float
    bending: float
    blades_and_bit: float
    snake: float

    @property
    def total(self):
        return sum(self)


def model_errors(path, pieces, soft, solved, sections, rings=()):
    """`ModelError` of the hook load and of the surface torque.

    Args:
        soft, solved: the `Solved` without and with buckling. rings: [`Ring`] from the bit up.

    Returns:
        infinite parts for snakes with which the string may lock up.
    """
    chain = solved.chain
    groups = np.flatnonzero(np.diff(chain.origin, prepend=-1))  # the first part of each piece, from below
    load, turn, EI = np.abs(chain.drag), chain.turn, np.nan_to_num(sections.EI[pieces.component[chain.origin]])
    clearance = (pieces.hole - pieces.radius)[chain.origin]
    missed, stiff = (np.zeros(len(load)) for _ in range(2))
    missed[groups] = _turns(chain, solved, groups, clearance[groups])
    jumps, stiffer = _jumps(path, pieces, solved.tension[groups[1:], 0], EI[groups])
    missed[groups[1:]] += jumps
    missed[groups] += _edges(pieces, solved, groups, EI[groups])
    missed[groups[-1]] += _hung(chain, solved, clearance[-1], EI[-1])
    missed *= _SET.caution
    stiff[groups[1:]] = stiffer
    stiff[groups] += _levers(path, pieces, solved, groups, EI[groups], clearance[groups])
    extra = _snakes(chain, solved, EI, clearance)
    grown = growth(solved, pieces, sections)
    pried, arms = _at_rings(chain, solved, pieces.bottom[-1], clearance, EI, rings)
    parts = (missed, stiff, pried, extra)
    hook, torque = ([float(share @ (part * grown)) for part in parts] for share in (load, turn))
    hook[0] += _lower(pieces) + _at_ends(pieces, solved, sections)
    torque[2] += float(turn @ arms)
    if extra.any() or solved.helical.any():
        hook[3], torque[3] = map(max, _earlier(soft, solved, pieces, sections), (hook[3], torque[3]))
    return ModelError(*hook), ModelError(*torque)


def _earlier(soft, solved, pieces, sections):
    """By how much hook load and surface torque change where snakes are helices: their friction makes the string a helix
    farther down, and the helix multiplies it on the way up."""
    try:
        early = earliest_helix(soft, pieces, sections)
    except LockUp:
        return np.inf, np.inf if solved.chain.turn.any() else 0.0
    return [abs(float(getattr(early, x)[-1, -1] - getattr(solved, x)[-1, -1])) for x in ("tension", "torque")]


def _snakes(chain, solved, EI, clearance):
    """Half the wall force (N) of a helix, of the snakes in pieces (a snake may be a small part of a long piece); and
    the load across of the helices, since the mean wall force of a helix with gravity is r F^2/(4 EI) alone."""
    extra = np.zeros(len(EI))
    fine = (np.arange(_SET.fine) + 0.5) / _SET.fine
    compressed = (solved.tension.min(axis=1) < 0) & (clearance > 1e-9) & (EI > 0)
    for i in np.flatnonzero(compressed | solved.helical):
        F = np.maximum(-np.interp(fine, solved.at, solved.tension[i]), 0.0)
        side = np.interp(fine, solved.at, solved.side[i]) * chain.climb[i]
        helix = criteria.helix_side(EI[i], clearance[i], F)
        if solved.helical[i]:
            more = side - helix
        else:
            more = np.where(F > criteria.snake_load(EI[i], clearance[i], chain.weight[i], side), helix / 2, 0.0)
        extra[i] = np.mean(more) * chain.length[i]
    return extra


def _at_rings(chain, solved, depth, clearance, EI, rings):
    """Wall force (N) of bits and stabilisers that pry; and the part of the load of their spans (N) that turns on their
    larger radius."""
    ends = depth - np.append(0.0, np.cumsum(chain.length))  # measured depths, from the lower end up
    largest = np.array([solved.side.max(axis=1) * chain.climb, np.maximum(-solved.tension.min(axis=1), 0.0),
                        chain.curvature, clearance, EI])  # fmt: skip

    def along(a, b):
        return largest[:, (ends[:-1] > a + 1e-9) & (ends[1:] < b - 1e-9)].max(axis=1, initial=0.0)

    pried, arms = np.zeros(len(chain.length)), np.zeros(len(chain.length))
    for ring, pries, carries in zip(rings, *prying(rings, depth, along), strict=True):
        i = int(np.clip(np.searchsorted(-ends, -ring.s) - 1, 0, len(chain.length) - 1))
        pried[i] += pries
        arms[i] += carries * max(1 - ring.body / ring.radius, 0.0)
    return pried, arms


def _lower(pieces):
    """Weight (N) that hangs lower or higher where the string leans on the wall: where it changes, and at the end."""
    clearance = pieces.hole - pieces.radius
    lean = clearance * np.sqrt(np.maximum(1 - pieces.t**2, 0.0))
    moved = np.cumsum(clearance * pieces.curvature * (pieces.bottom - pieces.top)) * np.abs(pieces.t)
    return float(np.abs(np.diff(pieces.weight, append=0.0)) @ (lean + moved))


def _at_ends(pieces, solved, sections):
    """Tension (N) that is lost where the string leaves the axis, at both ends."""
    lost = 0.0
    for at, tension in ((0, abs(solved.tension[-1, -1])), (-1, abs(solved.tension[0, 0]))):
        k, EI = pieces.curvature[at], np.nan_to_num(sections.EI[pieces.component[at]])
        clearance = (pieces.hole - pieces.radius)[at]
        # T a^2/2 without the divisions by k and by T
        lost += k * (np.sqrt(EI * k) + np.sqrt(EI * k + 2 * clearance * tension)) ** 2 / 2
    return float(lost)


def _turns(chain, solved, groups, clearance):
    """Wall force (N) that is missed within pieces whose load turns to the other side."""
    last = np.append(groups[1:], len(chain.length)) - 1
    length = np.add.reduceat(chain.length, groups)
    part = Chain(*(array[groups] for array in chain))
    q = [
        np.stack([part.curvature * T + part.weight * n, part.weight * part.b])
        for n, T in ((part.n, solved.tension[groups, 0]), (part.down(length)[1], solved.tension[last, -1]))
    ]
    way = np.linalg.norm(_unit(q[1], 0) - _unit(q[0], 0), axis=0)
    rate = np.linalg.norm(q[1] - q[0], axis=0) / length
    T = np.maximum(np.abs(solved.tension[groups, 0]), np.abs(solved.tension[last, -1]))
    return np.where(way > 1, (6 * way * clearance * T) ** (2 / 3) * rate ** (1 / 3), 0.0)  # others slide along the wall


def _spanned(q, T, d, EI, length):
    """The load (N) on the span by which a string under a load q (N/m) comes to a wall at a distance d (m), by its
    tension T (N) and its bending stiffness; at most that on the length (m) there is."""
    return min(np.sqrt(2 * d * q * T) + q * free_span(EI, d, q), q * length)


def _hung(chain, solved, clearance, EI):
    """Wall force (N) that is missed below the surface, where the rod hangs on the axis and comes to the wall farther
    down."""
    q, T = solved.side[-1, -1] * chain.climb[-1], max(solved.tension[-1, -1], 0.0)
    return _spanned(q, T, clearance, EI, chain.length.sum())


def _edges(pieces, solved, groups, EI):
    """Wall force (N) that is missed in pieces, from below, where friction changes with the diameter: the string spans a
    part of what is wider, and loads the edge, on the friction there."""
    found, up = np.zeros(len(groups)), slice(None, None, -1)
    mu, hole = pieces.friction[up], pieces.hole[up]
    length, q = (pieces.bottom - pieces.top)[up], solved.side[groups].max(axis=1) * solved.chain.climb[groups]
    T = np.abs(solved.tension[groups, 0])
    for j in np.flatnonzero((mu[1:] != mu[:-1]) & (hole[1:] != hole[:-1])):
        wide, more = (max(j, j + 1, key=of.__getitem__) for of in (hole, mu))
        less = min(mu[j], mu[j + 1])
        load = _spanned(q[wide], T[wide], abs(hole[j] - hole[j + 1]), EI[wide], length[wide])
        found[more] += load * (1 - less / mu[more])
    return found


def _levers(path, pieces, solved, groups, EI, clearance):
    """Wall force (N) that is missed at the lower ends of pieces, from below, where EI k jumps: the string takes the
    moment by a pair of forces at a distance of sqrt(8 d/k), where they exceed the load there."""
    md, n = pieces.bottom[::-1], len(groups)
    wide = np.maximum(np.append(EI[1:], 0.0), np.append(0.0, EI[:-1]))  # of neighbours
    EI = np.where(pieces.bottom[::-1] - pieces.top[::-1] < _SET.short, np.minimum(EI, wide), EI) if n > 1 else EI
    above, below = _beside(path, md)
    moment = np.linalg.norm(EI[:, None] * above - np.append(0.0, EI[:-1])[:, None] * below, axis=1)
    known = (moment > 0) & (EI > 0)
    moment, stiff = np.where(known, moment, 0.0), np.where(known, EI, 1.0)
    apart = np.maximum(np.sqrt(8 * clearance * stiff / np.where(known, moment, 1.0)), _SET.nearest)
    return np.maximum(2 * moment / apart - solved.side[groups, 0] * solved.chain.climb[groups] * apart, 0.0)


def _jumps(path, pieces, tension, EI):
    """Wall force (N) that is missed where pieces meet, from below, and EI dk^2 (N m)."""
    md, up = pieces.bottom[:-1], slice(None, None, -1)
    t, down = path.tangent(md), np.array([0.0, 0.0, 1.0])
    k = _beside(path, md)
    offsets = []
    for i, curvature in ((slice(None, -1), k[0]), (slice(1, None), k[1])):
        q = tension[up, None] * curvature + pieces.weight[i, None] * (down - t * t[:, 2:])
        offsets.append((pieces.hole - pieces.radius)[i, None] * _unit(q, 1))
    jump, away = np.linalg.norm(k[1] - k[0], axis=1), np.linalg.norm(offsets[1] - offsets[0], axis=1)
    return np.abs(tension) * np.sqrt(2 * away * jump)[up], np.minimum(EI[1:], EI[:-1]) * jump[up] ** 2


def _beside(path, md):
    """Curvature vectors just above and below measured depths."""
    return path.curvature(np.maximum(md - 1e-6, 0.0)), path.curvature(md)


def _unit(vectors, axis):
    """Vectors over their lengths; zero stays zero."""
    size = np.linalg.norm(vectors, axis=axis, keepdims=True)
    return vectors / np.where(size > 0, size, 1.0)
