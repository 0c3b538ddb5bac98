"""Finer and finer meshes until two of them agree: a path is traced until it is well resolved, and corrected from there on.

How fine is found out at a few of its points; then all of them go to that mesh at once.
"""

import math

import numpy as np

from cosserat_fenicsx.accuracy import estimate_error, hardest, spread_error
from cosserat_fenicsx.errors import NotConverged

_MOST_ELEMENTS = 1024
# Two meshes that agree to this, relative to the largest displacement, are on one branch: the finer may start from the coarser.
_RESOLVED = 1e-2


def refine(trace, correct, layout, tol, degree):
    """A path whose estimated error is at most `tol`.

    Args:
        trace: (layout, path or None) -> path, stepping from the unloaded state, over the points of the path that is given.
        correct: (layout, path) -> the points of the path on this mesh, starting from them; None where that will not do.
        layout: the first mesh.
        tol: relative to the largest displacement.
        degree: for the words of a refusal.

    Raises:
        NotConverged: two meshes in a row cannot be solved, or the accuracy is not reached.
    """
    whole = looked_at = before = which = (
        None  # all points, and those that are looked at, on the last mesh that they were found on
    )
    level, level_of_whole, apart_of_whole = 0, -1, None
    failed, best = False, math.inf
    while True:
        elements = max(layout.counts)
        try:
            fine = None if looked_at is None else correct(layout, looked_at)
            apart = None if fine is None else estimate_error(fine, looked_at, before)
            if fine is None or apart.max() > _RESOLVED:
                fine, coarse = trace(layout, whole), whole
                apart = estimate_error(fine, coarse, apart_of_whole) if level == level_of_whole + 1 > 0 else None
                whole, level_of_whole, apart_of_whole = fine, level, apart
            elif len(fine) == len(whole):
                whole, level_of_whole, apart_of_whole = fine, level, apart
            elif fine.error.max() <= tol:
                few, fine = fine, _all_points(correct, layout, whole, fine, which) or trace(layout, whole)
                spread_error(fine, few)
                whole, level_of_whole, apart_of_whole = fine, level, None
        except NotConverged:
            if failed or elements >= _MOST_ELEMENTS:
                raise
            failed, looked_at, before = True, None, None
        else:
            failed = False
            if apart is not None:
                reached = float(fine.error.max())
                if reached <= tol and fine is whole:
                    return fine
                if elements >= _MOST_ELEMENTS or (reached > best and best < 1e-8):
                    raise NotConverged(_not_accurate(tol, min(reached, best), elements, degree), whole)
                best = min(best, reached)
            if fine is whole:
                looked_at, which = hardest(whole)
                before = None if apart_of_whole is None else apart_of_whole[which]
            else:
                looked_at, before = fine, apart
        layout, level = layout.split(2), level + 1


def _all_points(correct, layout, whole, few, which):
    """The points of a path on a mesh where a few of them, `which`, were found; None where that will not do."""
    others = np.ones(len(whole), dtype=bool)
    others[which] = False
    rest = correct(layout, whole.at_points(np.flatnonzero(others)))
    return rest and few.with_points(rest, others)


def _not_accurate(tol, reached, elements, degree):
    advice = "a larger tol" if degree == 4 else "a larger tol, or degree 4"
    return (
        f"the accuracy tol = {tol:g} was not reached with {elements} elements of degree {degree} per rod: "
        f"the estimated error stays at {reached:.2g}. Ask for {advice}."
    )
