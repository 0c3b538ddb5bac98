"""Finer and finer meshes until two of them agree: a path is traced until it is well resolved, and corrected from there on."""

import math

from cosserat_fenicsx.accuracy import estimate_error
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
    coarse = like = before = None
    failed, best = False, math.inf
    while True:
        elements = max(layout.counts)
        try:
            fine = None if coarse is None else correct(layout, coarse)
            if fine is not None and estimate_error(fine, coarse, before).max() > _RESOLVED:
                fine = None
            if fine is None:
                fine = trace(layout, like)
        except NotConverged:
            if failed or elements >= _MOST_ELEMENTS:
                raise
            failed, coarse, before = True, None, None
        else:
            failed, like = False, fine
            if coarse is not None:
                before = estimate_error(fine, coarse, before)
                reached = float(fine.error.max())
                if reached <= tol:
                    return fine
                if elements >= _MOST_ELEMENTS or (reached > best and best < 1e-8):
                    raise NotConverged(_not_accurate(tol, min(reached, best), elements, degree), fine)
                best = min(best, reached)
            coarse = fine
        layout = layout.split(2)


def _not_accurate(tol, reached, elements, degree):
    advice = "a larger tol" if degree == 4 else "a larger tol, or degree 4"
    return (
        f"the accuracy tol = {tol:g} was not reached with {elements} elements of degree {degree} per rod: "
        f"the estimated error stays at {reached:.2g}. Ask for {advice}."
    )
