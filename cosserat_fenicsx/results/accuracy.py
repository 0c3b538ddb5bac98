"""Comparison of a path on two meshes: error estimates, and transfer of its points to another mesh."""

from collections import namedtuple

import numpy as np

from cosserat_fenicsx.results.places import cell_nodes, compared, transferred
from cosserat_fenicsx.results.result import resting

#: Largest number of points of a path that are all sample points.
FEW = 3
# Differences of positions up to this are rounding alone, in units of the scales' length; not zero in an undisplaced
# state.
_ROUNDING = 1e-14
# Ratios of the largest difference to that at the element ends, above which the superconvergence of the ends is evident.
_AHEAD, _FAR_AHEAD = 4, 30
# Safety of the assumed gain in accuracy, and that of differences below which convergence is asymptotic.
_SAFETY, _SAFETY_BELOW, _ASYMPTOTIC = 4, 2, 1e-3
# Error of the finer of two meshes over its estimate that is assumed for the estimate of the coarser one; factor from an
# assumed gain in accuracy to the likely one.
_CAUTION, _LIKELY = 2, 1.5
# Exponents of an error as a function of what indicates it, below and above what is known.
_BELOW, _ABOVE = 0.7, 1.4
# Factor of an error that is interpolated over leading coefficients, as a power of their ratio to those of the nearest
# sample point; the largest one.
_WIDENED, _WIDEST = 0.5, 2.0
# Largest ratio of the leading coefficients of sample points without another one between them.
_APART = 10.0
# Ratio of leading coefficients below which a second, smoother point is sampled, since its error may converge otherwise.
_SMOOTHER = 0.1
# Points with displacements below this times the largest one of the path are not sampled for their smoothness.
_SEEN = 1e-3


def estimate_error(fine, coarse, before=None):
    """Estimate the error of a path from the same points on the mesh of elements twice as long; sets `fine.error`.

    The error is the difference of the positions, at the coarse nodes and half way between them, over an assumed gain in
    accuracy. The gain of a halving is asymptotically 2^(p + 1) between the nodes. Only a part of it is assumed, a
    quarter, or a half where the differences are small, and only where the differences confirm it:
    - with the differences `before` of the previous halving: that part of (their ratio to the present ones - 1), at
      least 1;
    - without: that part if the element ends, whose order is 2 p, are much more accurate than the rest, 2^(p - 3) if
      they are moderately more accurate, else 1. Splines and sections that are functions of s may reduce the order: for
      these at most 2^(p - 3).

    Differences are relative to the largest displacement; where sections mainly rotate (a shaft in torsion), to their
    rotation times the radius of gyration; at least to 1e-9 of the length.

    Returns:
        (n,) the relative differences, which are `before` in the next halving; and (n,) the assumed gains.
    """
    p = fine.degree
    relative, difference, at_ends = _differences(fine, coarse)
    part = np.where(relative < _ASYMPTOTIC, 1 / _SAFETY_BELOW, 1 / _SAFETY)
    if before is None:
        ahead, far = difference > _AHEAD * at_ends, difference > _FAR_AHEAD * at_ends
        uniform = all(rod.uniform for rod in fine.scene.rods)
        gain = np.where(far & uniform, part * 2.0 ** (p + 1), np.where(ahead, max(1.0, 2.0 ** (p - 3)), 1.0))
    else:
        seen = before / np.maximum(relative, 1e-300)
        gain = np.clip(part * (seen - 1), 1, part * 2.0 ** (p + 1))
    fine.set_error(relative / gain)
    return relative, gain


def error_before(apart, gain):
    """(n,) the estimated errors of the coarse mesh of `estimate_error`, from what it returned: the differences and a
    multiple of the errors of the fine mesh; infinite where nothing confirms that the meshes converge."""
    return np.where(gain > 1, (1 + _CAUTION / gain) * apart, np.inf)


def order_of(gain, p):
    """The order of the error in h that the gains (n,) of a halving are those of."""
    return float(np.clip(np.log2(_LIKELY * np.min(gain)), 1, p + 0.5))


def carry_error(fine, coarse, factor, order, before=None):
    """Set the error of a path from that of the same points on a mesh of elements less than twice as long.

    It is the coarser mesh's error reduced by the assumed order, limited to one to two times the Richardson estimate
    from the difference of the two meshes, since the coarser mesh's error may be overestimated. The Richardson estimate
    uses the observed order minus one.

    Args:
        factor: number of elements over that of the coarser mesh.
        order: of the error in h, see `order_of`.
        before: relative differences of the coarser mesh from the one before, where its elements were halved; or None.

    Returns:
        (n,) the differences relative to the largest displacements.
    """
    relative, *_ = _differences(fine, coarse)
    seen = (
        order
        if before is None
        else np.clip(
            np.log2(np.maximum(before, 1e-300) / np.maximum(relative, 1e-300)) - 1, order, max(order, fine.degree)
        )
    )
    reduction = factor**-seen
    estimate = relative * reduction / (1 - reduction)
    fine.set_error(np.clip(coarse.error * factor**-order, estimate, 2 * estimate))
    return relative


def compare(fine, coarse):
    """(n,) differences of the same points on two meshes, relative to the largest displacements.

    They are no error estimate where the meshes are not nested.
    """
    return _differences(fine, coarse)[0]


def _differences(fine, coarse):
    """(n,) relative differences, then the two results of `_apart`."""
    sizes = fine._reference
    difference, at_ends = _apart(fine, coarse, sizes.turning)
    return _above_rounding(difference) / sizes.largest, difference, at_ends


def _above_rounding(difference):
    return np.where(difference > _ROUNDING, difference, 0.0)


def hardest(path):
    """Sample points that determine the mesh that a path needs.

    They are the point with the largest error (of every rod the one with the largest relative leading coefficients where
    errors are unknown), the most displaced one, the last, the smoothest (smallest leading coefficients) where it is
    much smoother, and then one between. All points where these are few or the path has events.

    Returns:
        (Path of these points, their indices).
    """
    if len(path) <= FEW or path.events:  # events have to be located on every mesh
        return path, np.arange(len(path))
    sizes, of_rods = path._reference.largest, path._roughness
    known, rough = np.isfinite(path.error).all(), of_rods.max(axis=0)
    worst = np.argmax(path.error[None] if known else of_rods / sizes, axis=1)
    which = {*worst.tolist(), int(np.argmax(sizes)), len(path) - 1}
    seen = np.flatnonzero(sizes >= _SEEN * sizes.max())
    if rough[seen].min() < _SMOOTHER * rough.max():
        which.add(int(seen[np.argmin(rough[seen])]))
    told = np.log(np.maximum(rough, 1e-300))
    ends = np.array([min(told[list(which)]), max(told[list(which)])])
    if np.ptp(ends) > np.log(_APART):
        which.add(int(np.argmin(np.abs(told - ends.mean()))))
    which = np.array(sorted(which))
    return path.at_points(which), which


def spread_error(path, few, which, coarse=None):
    """Set `path.error` from the errors of its sample points on the same mesh.

    The errors of the other points are interpolated over what indicates them, logarithmically: the differences from the
    same points on a coarser mesh, or the leading coefficients. In the second case they are increased the more, the
    farther these are from those of the sample points, by themselves or relative to the displacements.

    Args:
        few: the sample points, with their errors; which: their indices.
        coarse: the whole path on a coarser mesh, or None.
    """
    sizes, turning = path._reference
    told = path._roughness.max(axis=0) if coarse is None else _above_rounding(_apart(path, coarse, turning)[0])
    known, errors = told[which], few.error * sizes[which]
    relative = np.log(np.maximum(told / sizes, 1e-300))
    usable = (known > 100 * _ROUNDING) & (errors > 0)
    error = np.zeros(len(path)) if coarse is None else told.copy()
    if usable.any():
        order = np.argsort(known[usable])
        known, errors = np.log(known[usable][order]), np.log(np.maximum.accumulate(errors[usable][order]))
        told = np.log(np.maximum(told, 1e-300))
        beyond = _BELOW * np.minimum(told - known[0], 0) + _ABOVE * np.maximum(told - known[-1], 0)
        if coarse is None:
            unlike = np.minimum(
                np.abs(told[:, None] - known).min(axis=1),
                np.abs(relative[:, None] - relative[which][usable]).min(axis=1),
            )
            beyond += np.minimum(_WIDENED * unlike, np.log(_WIDEST))
        error = np.exp(np.interp(told, known, errors) + beyond)
    error /= sizes
    error[which] = few.error
    path.set_error(error)


def _apart(fine, coarse, turning):
    """Largest distances of the positions on two meshes, dimensionless: over all places, and over element ends alone.

    Both (points,). Where sections mainly rotate (`_Sizes.turning`), differences of rotations count too, times the
    radius of gyration.
    """
    there, here, ends = compared(coarse.layout, fine.layout, coarse.rule)
    off = np.linalg.norm(there.of(coarse._moved) - here.of(fine._moved), axis=2)
    if turning.any():
        turned = np.linalg.norm(_unit(there.of(coarse._turned)) - _unit(here.of(fine._turned)), axis=2)
        for rod, part in zip(fine.scene.rods, there.rods, strict=True):
            turned[:, part] *= 2 * _gyration(rod) / fine.scales.length
        off = np.maximum(off, turning[:, None] * turned)
    return off.max(axis=1), off[:, ends].max(axis=1)


def _unit(q):
    return q / np.linalg.norm(q, axis=2, keepdims=True)


_Sizes = namedtuple("_Sizes", "largest turning")


def sizes_of(path):
    """Reference sizes of the points of a path, a `_Sizes` of arrays (points,).

    largest: the displacement that errors are relative to, dimensionless; turning: whether it comes from rotations times
    the radius of gyration.
    """
    moved, vectors = np.linalg.norm(path._moved, axis=2).max(axis=1), _unit(path._turned)[:, :, 1:]
    # |R - 1| = sqrt(8) |sin(angle/2)|
    angle, turned = np.sqrt(8) * np.linalg.norm(vectors, axis=2), np.zeros(len(path))
    for rod, (_, rows) in zip(path.scene.rods, cell_nodes(path.layout, path.degree), strict=True):
        turned = np.maximum(turned, angle[:, rows].max(axis=1) * _gyration(rod) / path.scales.length)
    moved = np.maximum(moved, 1e-9)
    return _Sizes(np.maximum(moved, turned), turned > moved)


def leading_of(path):
    """(rods, points) the largest leading coefficient of an element's displacement, dimensionless."""
    return np.array([found.max(axis=1) for found in leading_coefficients(path)])


def leading_coefficients(path):
    """For every rod (points, elements): sizes of the leading coefficients of the displacement, dimensionless."""
    return [
        np.linalg.norm(np.einsum("j,kcji->kci", path.rule.leading, path._moved[:, nodes]), axis=2)
        for nodes, _ in cell_nodes(path.layout, path.degree)
    ]


def on_mesh(path, layout):
    """The points of a path interpolated to another mesh, as initial guesses.

    Returns:
        (r, q) at the nodes (points, N, 7) and n at the Gauss points (points, elements, Gauss points per element, 3),
        dimensionless, inertial.
    """
    rule, n = path.rule, path._stacked("gauss_fields")[..., :3]
    places, at_gauss = transferred(path.layout, layout, rule)
    rest = resting(path.scene, layout, rule) / path.scales.length
    rq = np.concatenate([places.of(path._moved) + rest, _unit(places.of(path._turned))], axis=2)
    forces, first = [], 0
    for breaks, (cells, weights) in zip(path.layout.breaks, at_gauss, strict=True):
        found = np.einsum("kj,pkjc->pkc", weights, n[:, first + cells])
        forces.append(found.reshape(len(n), -1, len(rule.gauss), 3))
        first += len(breaks) - 1
    return rq, np.concatenate(forces, axis=1)


def _gyration(rod):
    """Largest radius of gyration sqrt(EI/EA) of a rod, m; 0 where EA is infinite."""
    low, high = rod.profile.range
    return float(np.sqrt(high.J[:2].max() / low.K[2]))
