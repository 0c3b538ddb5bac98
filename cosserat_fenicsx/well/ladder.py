"""Which model is enough: how far the soft string may be from the rod in contact, and why.

The soft string lies on the axis. A string with a clearance changes the wall where the load turns round, and where the
hole's curvature jumps by dk the string leaves one side and reaches the other, at a distance d, after turning by
sqrt(2 d dk): over that angle it touches nothing. The friction that is missed there is mu T sqrt(2 d dk): on a build
section of radius R that is T mu sqrt(4 r/R), 485, 1540 and 3220 N for clearances r of 1, 10 and 44 mm where the rod in
contact differs by 426, 1343 and 2776 N. Bending stiffness changes the friction by mu EI dk^2, and a snake adds at most
half the wall force of a helix. These are sums of sizes: differences of opposite signs do not cancel.
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
    load, turn = np.abs(chain.drag), chain.turn
    EI = np.nan_to_num(sections.EI[pieces.component[chain.origin]])
    clearance = (pieces.hole - pieces.radius)[chain.origin]
    bottom = pieces.bottom[-1] - np.concatenate([[0.0], np.cumsum(chain.length)])
    k, to_wall = _curvatures(path, bottom[:-1] - chain.length / 2), _to_wall(path, chain, solved, bottom)
    jump = np.linalg.norm(np.diff(k, axis=0), axis=1)
    offset = clearance[:, None] * to_wall
    away = np.linalg.norm(np.diff(offset, axis=0), axis=1)
    cuts = np.abs(solved.tension[1:, 0]) * np.sqrt(2 * away * jump)
    stiff = np.minimum(EI[1:], EI[:-1]) * jump**2
    F = np.maximum(-solved.tension[:, middle], 0.0)
    side = np.hypot(chain.curvature * -F + chain.weight * chain.n, chain.weight * chain.b)
    with np.errstate(divide="ignore", invalid="ignore"):
        snakes = (F > criteria.snake_load(EI, clearance, chain.weight, side)) & (clearance > 1e-9) & ~solved.helical
        extra = np.where(snakes & (EI > 0), criteria.helix_side(EI, clearance, F) / 2 * chain.length, 0.0)
    return tuple(
        ModelError(float(share[1:] @ cuts), float(share[1:] @ stiff), float(share @ extra)) for share in (load, turn)
    )


def _curvatures(path, md):
    return path.curvature(np.clip(md, 0.0, path.length))


def _to_wall(path, chain, solved, ends):
    """(n, 3) directions in which pieces press the wall in their middles; zero where they press nothing."""
    middle = len(solved.at) // 2
    md = np.clip(ends[:-1] - chain.length * solved.at[middle], 0.0, path.length)
    t, k = path.tangent(md), path.curvature(md)
    down = np.array([0.0, 0.0, 1.0])
    q = solved.tension[:, middle, None] * k + chain.weight[:, None] * (down - t * t[:, 2:])
    size = np.linalg.norm(q, axis=1)[:, None]
    return q / np.where(size > 0, size, 1.0)


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
