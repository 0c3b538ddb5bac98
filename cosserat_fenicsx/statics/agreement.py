"""Mesh refinement of eigenvalues, until two successive meshes agree."""

import math

import numpy as np

from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.statics.grading import with_layers


def until_two_meshes_agree(scene, on_mesh, apart, tol, *, first, most, elements, degree, advice, progress, gains=False):
    """Solve on successively halved meshes until the results of two of them agree.

    Args:
        scene: the scene.
        on_mesh: a function of a layout that returns a tuple: the numbers to compare (n,), the lengths of boundary
            layers (see `grading.layers_of`) or None, and further results.
        apart: (the numbers, those of the mesh before) -> relative differences (n,).
        tol: largest relative difference.
        first, most: elements per rod of the first mesh and of the last; elements: those of a given mesh, or None.
        degree, advice: for error messages.
        progress: a `MeshProgress`.
        gains: whether the error is estimated by the gain of a halving, of order 2 p, instead of by the difference of
            two meshes, which is larger. Without rounding errors among the numbers alone.

    Returns:
        (what `on_mesh` returned, estimated relative errors (n,) or NaN, layout).

    Raises:
        NotConverged: the accuracy is not reached, or two meshes in a row cannot be solved.
    """
    layout, coarse, best, worse = Layout.of(scene, elements or first), None, math.inf, 0
    failed = False  # whether the last mesh could not be solved
    before = coarse_layout = None  # relative differences of the halving before; the mesh of `coarse`
    while True:
        obey()
        progress.on(max(layout.counts), best)
        try:
            found = on_mesh(layout)
        except NotConverged:
            if elements or failed or max(layout.counts) >= most:
                raise
            failed, coarse, before, layout = True, None, None, layout.finer(scene, 2)
            continue
        failed = False
        numbers, lengths = found[:2]
        error = np.full(len(numbers), np.nan)
        layered = None if elements else with_layers(scene, layout, lengths)
        if layered is not None:
            coarse, before, layout = None, None, layered
            continue
        if coarse is not None and len(coarse) != len(numbers) and max(layout.counts) >= most:
            raise NotConverged(
                f"two meshes differ in how many were found: {len(coarse)} on the coarser one, {len(numbers)} with "
                f"{max(layout.counts)} elements of degree {degree} per rod. Ask for fewer."
            )
        if coarse is not None and len(coarse) == len(numbers):
            error = apart(numbers, coarse)
            reached = error.max(initial=0.0)
            # Differences may grow once before they converge; growth twice in a row is rounding.
            worse = worse + 1 if reached > max(tol, best) else 0
            if worse == 2 or (reached > tol and max(layout.counts) >= most):
                raise NotConverged(
                    f"the accuracy tol = {tol:g} was not reached with {max(layout.counts)} elements of degree {degree} "
                    f"per rod: the estimated error stays at {min(reached, best):.2g}. Ask for {advice}."
                )
            best = min(best, reached)
        if elements or (best <= tol and not gains):
            return found, error, layout
        if best <= tol:
            if before is None:
                before = _difference_before(scene, on_mesh, apart, coarse, coarse_layout)
            return found, error if before is None else error / _gain(before, error, degree), layout
        before = None if np.isnan(error).any() or not len(error) else error
        coarse, coarse_layout, layout = numbers, layout, layout.finer(scene, 2)


def _difference_before(scene, on_mesh, apart, numbers, layout):
    """Relative differences (n,) of the numbers on a mesh to those on one with half as many elements; None where that
    one is too coarse to be solved or to have as many."""
    try:
        coarse = on_mesh(layout.finer(scene, 0.5))[0]
    except NotConverged:
        return None
    return apart(numbers, coarse) if len(coarse) == len(numbers) else None


def _gain(before, error, degree):
    """(n,) the assumed gain in accuracy of a halving, from the differences of two halvings.

    Eigenvalues converge with the order 2 p, a gain of 2^(2 p); a part of the gain that is observed is assumed.
    """
    return np.clip((before / np.maximum(error, 1e-300) - 1) / 4, 1, 2.0 ** (2 * degree - 2))
