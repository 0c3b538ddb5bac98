"""Which model is enough: how far the soft string may be from the rod in contact, and why.

The soft string lies on the axis. With a clearance, a string changes sides where its load turns round, and spans the
hole between without touching it; the friction that is missed there is mu times

- T sqrt(2 d dk) where the hole's curvature jumps by dk: a string that leaves a wall tangentially reaches the other
  side, at a distance d, after that angle. On a build section of radius R it is T sqrt(4 r/R) for a clearance r.
- (6 d T)^(2/3) q'^(1/3) where the load changes its sign within a bend, with the rate q': the span on which it moves
  the string by d.

A string on the low side also hangs lower by r sin(inclination), which its weight feels. Bending stiffness changes the
friction by mu EI dk^2, and a snake adds at most half the wall force of a helix. These are sums of sizes: differences of
opposite signs do not cancel.
"""

from typing import NamedTuple

import numpy as np

from cosserat_fenicsx.well import criteria


class ModelError(NamedTuple):
    """What the soft string leaves out, in hook load (N), or in surface torque (N m) where it rotates."""

    clearance: float
    bending: float
    snake: float

    @property
    def total(self):
        return sum(self)


def model_errors(path, pieces, solved, sections):
    """`ModelError` of the hook load and of the surface torque.

    Args:
        path: a `WellPath`; pieces, solved: see `softstring`; sections: `Sections` of the components.
    """
    chain, middle = solved.chain, len(solved.at) // 2
    groups = np.flatnonzero(np.diff(chain.origin, prepend=-1))  # the first part of each piece, from below
    load, turn, EI = np.abs(chain.drag), chain.turn, np.nan_to_num(sections.EI[pieces.component[chain.origin]])
    clearance = (pieces.hole - pieces.radius)[chain.origin]
    missed, stiff = (np.zeros(len(load)) for _ in range(2))
    missed[groups] = _turns(chain, solved, groups, clearance[groups])
    jumps, stiffer = _jumps(path, pieces, solved.tension[groups[1:], 0], EI[groups])
    missed[groups[1:]] += jumps
    stiff[groups[1:]] = stiffer
    F = np.maximum(-solved.tension[:, middle], 0.0)
    side = np.hypot(chain.curvature * -F + chain.weight * chain.n, chain.weight * chain.b)
    with np.errstate(divide="ignore", invalid="ignore"):
        snakes = (F > criteria.snake_load(EI, clearance, chain.weight, side)) & (clearance > 1e-9) & ~solved.helical
        extra = np.where(snakes & (EI > 0), criteria.helix_side(EI, clearance, F) / 2 * chain.length, 0.0)
    hook, torque = ([float(share @ part) for part in (missed, stiff, extra)] for share in (load, turn))
    hook[0] += _lower(pieces)
    return ModelError(*hook), ModelError(*torque)


def _lower(pieces):
    """Weight (N) that hangs lower or higher where the string leans on the wall: where it changes, and at the end."""
    lean = (pieces.hole - pieces.radius) * np.sqrt(np.maximum(1 - pieces.t**2, 0.0))
    return float(np.abs(np.diff(pieces.weight, append=0.0)) @ lean)


def _turns(chain, solved, groups, clearance):
    """Wall force (N) that is missed within pieces whose load turns to the other side."""
    last = np.append(groups[1:], len(chain.length)) - 1
    length = np.add.reduceat(chain.length, groups)
    angle = chain.curvature[groups] * length
    lower, upper = chain.n[groups], chain.n[groups] * np.cos(angle) + chain.t[groups] * np.sin(angle)
    q = [
        np.stack([chain.curvature[groups] * T + chain.weight[groups] * n, chain.weight[groups] * chain.b[groups]])
        for n, T in ((lower, solved.tension[groups, 0]), (upper, solved.tension[last, -1]))
    ]
    way = np.linalg.norm(_unit(q[1], 0) - _unit(q[0], 0), axis=0)
    rate = np.linalg.norm(q[1] - q[0], axis=0) / length
    T = np.maximum(np.abs(solved.tension[groups, 0]), np.abs(solved.tension[last, -1]))
    return np.where(way > 1, (6 * way * clearance * T) ** (2 / 3) * rate ** (1 / 3), 0.0)  # others slide along the wall


def _jumps(path, pieces, tension, EI):
    """Wall force (N) that is missed where pieces meet, from below, and EI dk^2 (N m)."""
    md, up = pieces.bottom[:-1], slice(None, None, -1)
    t, down = path.tangent(md), np.array([0.0, 0.0, 1.0])
    k = path.curvature(np.maximum(md - 1e-6, 0.0)), path.curvature(md)  # above and below
    offsets = []
    for i, curvature in ((slice(None, -1), k[0]), (slice(1, None), k[1])):
        q = tension[up, None] * curvature + pieces.weight[i, None] * (down - t * t[:, 2:])
        offsets.append((pieces.hole - pieces.radius)[i, None] * _unit(q, 1))
    jump, away = np.linalg.norm(k[1] - k[0], axis=1), np.linalg.norm(offsets[1] - offsets[0], axis=1)
    return np.abs(tension) * np.sqrt(2 * away * jump)[up], np.minimum(EI[1:], EI[:-1]) * jump[up] ** 2


def _unit(vectors, axis):
    """Vectors over their lengths; zero stays zero."""
    size = np.linalg.norm(vectors, axis=axis, keepdims=True)
    return vectors / np.where(size > 0, size, 1.0)


def reasons(used, asked, soft, solved, sections, left_out, scales, tol):
    """Sentences on the model: what decided for it, and what it leaves out.

    Args:
        used, asked: names of models; soft, solved: the `Solved` without and with buckling; sections: `Sections`;
        left_out: `ModelError` of hook load and torque; scales: the largest tension and torque; tol: asked for.
    """
    lines = []
    if asked != "auto":
        lines.append(f"model = '{asked}' as asked")
    if np.isnan(sections.EI).any():
        lines.append("bending stiffness is not known for all components: these are taken as not buckled")
    if solved.helical.any():
        change = float(solved.tension[-1, -1] - soft.tension[-1, -1])
        length = solved.chain.length[solved.helical].sum()
        lines.append(
            f"helically buckled over {length:.4g} m: the wall force of the helix changes the hook load of the soft "
            f"string by {change:+.4g} N"
        )
    elif asked == "auto":
        lines.append("no helical buckling")
    for what, unit, parts, scale in zip(("hook load", "surface torque"), ("N", "N m"), left_out, scales, strict=True):
        share = parts.total / scale if scale > 0 else 0.0
        if share <= 1e-9:
            continue
        of = ", ".join(f"{name} {value:.3g}" for name, value in parts._asdict().items() if value > 1e-3 * parts.total)
        lines.append(f"{what}: the rod in contact may differ by {parts.total:.3g} {unit}, {share:.1e} ({of})")
        if share > tol:
            lines.append(
                f"NOT ENOUGH for tol = {tol:g} in the {what}: it needs the exact rod in contact, which is stiff and "
                "has a clearance"
            )
    return tuple(lines)
