"""Finer and finer meshes until two of them agree: a path is traced until it is well resolved, and corrected from there on.

How fine is found out at a few of its points; then all of them go to that mesh at once.
"""

import math

import numpy as np

from cosserat_fenicsx.errors import Interrupted, NotConverged
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.results.accuracy import carry_error, estimate_error, hardest, spread_error

_MOST_ELEMENTS = 1024
# Two meshes that agree to this, relative to the largest displacement, are on one branch: the finer may start from the coarser.
_RESOLVED = 1e-2
# Meshes differ by multiples of this factor, so that scenes share compiled ones; the last is aimed at this share of what is allowed.
_QUARTERS, _AIM = 4, 0.8
# Fewer unknowns than this at all points together cost less than another loading of the mesh.
_CHEAP = 800


def refine(trace, correct, scene, layout, tol, degree):
    """A path whose estimated error is at most `tol`.

    Args:
        trace: (layout, path or None) -> path, stepping from the unloaded state, over the points of the path that is given.
        correct: (layout, path) -> the points of the path on this mesh, starting from them; None where that will not do.
        scene: what lies on the meshes; layout: the first mesh.
        tol: relative to the largest displacement.
        degree: for the words of a refusal.

    Raises:
        NotConverged: two meshes in a row cannot be solved, or the accuracy is not reached.
    """
    search = _Search(trace, correct, tol, degree)
    try:
        while True:
            found = search.on(layout)
            if found is not None:
                return found
            layout = layout.finer(scene, search.factor())
    except Interrupted as stop:  # what is complete on a coarser mesh is worth more than a part on a finer one
        raise Interrupted(stop.path if search.whole is None else search.whole) from None


class _Search:
    """Where the search for a mesh stands.

    Attributes:
        whole: all points of the path on the last mesh that all were found on, or None.
    """

    def __init__(self, trace, correct, tol, degree):
        self._trace, self._correct, self._tol, self._degree = trace, correct, tol, degree
        self.whole = self._few = self._which = None  # `_few`: points that are looked at, on the last mesh
        self._apart, self._apart_of_whole = None, None  # their differences to the mesh before, and of all points
        self._level, self._level_of_whole = -1, -2
        # Of the error in h, as it is counted on; elements over those of the mesh before.
        self._order, self._factor = 1.0, 2.0
        self._failed, self._best = False, math.inf

    def on(self, layout):
        """Look at the next mesh; a path that is accurate, or None."""
        self._level += 1
        elements = max(layout.counts)
        try:
            found = self._found_on(layout)
        except NotConverged:
            if self._failed or elements >= _MOST_ELEMENTS:
                raise
            self._failed, self._few, self._apart = True, None, None
            return None
        self._failed = False
        if found.rounding > self._tol:  # which grows with the number of elements
            raise NotConverged(_rounding_hides(self._tol, found.rounding, elements, found.formulation), found)
        if np.isfinite(found.error).all():
            reached = float(found.error.max())
            if reached <= self._tol and found is self.whole:
                return found
            if elements >= _MOST_ELEMENTS or (reached > self._best and self._best < 1e-8):
                if found is not self.whole:
                    found = self._all_points(layout, found)
                raise NotConverged(
                    _not_accurate(self._tol, min(reached, self._best), elements, self._degree, found), found
                )
            self._best = min(self._best, reached)
        if found is self.whole:
            if len(found) * found.unknowns <= _CHEAP:
                self._few, self._which = found, np.arange(len(found))
            else:
                self._few, self._which = hardest(found)
            self._apart = None if self._apart_of_whole is None else self._apart_of_whole[self._which]
        return None

    def factor(self):
        """How many times as many elements the next mesh has: two, or fewer where these will do, by the order that was counted on."""
        if self._factor < 2:
            self._apart = self._apart_of_whole = None  # of halvings alone
        self._factor = 2.0
        if self._few is not None and np.isfinite(self._few.error).all() and self._few.error.max() > self._tol:
            needed = (self._few.error.max() / (_AIM * self._tol)) ** (1 / self._order)
            self._factor = min(2.0, math.ceil(_QUARTERS * needed) / _QUARTERS)
        return self._factor

    def _found_on(self, layout):
        """The points that are looked at, or all, on a mesh, with their errors where these are known."""
        few = None if self._few is None else self._correct(layout, self._few)
        apart = None if few is None else self._judge(few, self._few, self._apart)
        if few is None or apart.max() > _RESOLVED:
            whole, apart = self._trace(layout, self.whole), None
            if self._level == self._level_of_whole + 1:
                apart = self._judge(whole, self.whole, self._apart_of_whole)
            return self._keep(whole, apart)
        if len(few) == len(self.whole):
            return self._keep(few, apart)
        self._few, self._apart = few, apart
        return self._all_points(layout, few) if few.error.max() <= self._tol else few

    def _judge(self, fine, coarse, before):
        """Set the errors of points on a mesh from those on the mesh before; how far these are apart."""
        if self._factor < 2:
            return carry_error(fine, coarse, self._factor, self._order, before)
        apart, self._order = estimate_error(fine, coarse, before)
        return apart

    def _keep(self, whole, apart):
        self.whole, self._apart_of_whole, self._level_of_whole = whole, apart, self._level
        return whole

    def _all_points(self, layout, few):
        """All points on a mesh where a few of them are known."""
        others = np.ones(len(self.whole), dtype=bool)
        others[self._which] = False
        rest = self._correct(layout, self.whole.at_points(np.flatnonzero(others)))
        whole = self._trace(layout, self.whole) if rest is None else few.with_points(rest, others)
        spread_error(whole, few, self._which, self.whole)
        return self._keep(whole, None)


def until_two_meshes_agree(scene, on_mesh, apart, tol, *, first, most, elements, degree, advice):
    """Numbers that two meshes in a row agree on.

    Args:
        scene: what lies on the meshes.
        on_mesh: a layout -> a tuple, the numbers (n,) in front.
        apart: (the numbers, those of the mesh before) -> relative differences (n,).
        tol: how far these may be apart.
        first, most: elements per rod of the first mesh and of the last; elements: those of the only one, or None.
        degree, advice: for the words of a refusal.

    Returns:
        (what `on_mesh` gave, differences (n,) or NaN, layout).

    Raises:
        NotConverged: the accuracy is not reached.
    """
    layout, coarse, best = Layout.of(scene, elements or first), None, math.inf
    while True:
        found = on_mesh(layout)
        error = np.full(len(found[0]), np.nan)
        if coarse is not None and len(coarse) == len(found[0]):
            error = apart(found[0], coarse)
            reached = error.max(initial=0.0)
            if reached > max(tol, best) or (reached > tol and max(layout.counts) >= most):
                raise NotConverged(
                    f"the accuracy tol = {tol:g} was not reached with {max(layout.counts)} elements of degree {degree} per rod: the "
                    f"estimated error stays at {min(reached, best):.2g}. Ask for {advice}."
                )
            best = reached
        if elements or best <= tol:
            return found, error, layout
        coarse, layout = found[0], layout.finer(scene, 2)


def _rounding_hides(tol, rounding, elements, formulation):
    return (
        f"the accuracy tol = {tol:g} is out of reach of the formulation {formulation!r} on rods as slender as these: rounding alone may cost "
        f"{rounding:.2g} with {elements} elements per rod. Ask for the formulation 'mixed', or a larger tol."
    )


def _not_accurate(tol, reached, elements, degree, path):
    advice = "a larger tol" if degree == 4 else "a larger tol, or degree 4"
    if path.scene.doubts:
        advice = f"{advice}, but first: {'; '.join(path.scene.doubts)}"
    return (
        f"the accuracy tol = {tol:g} was not reached with {elements} elements of degree {degree} per rod: "
        f"the estimated error stays at {reached:.2g}. Ask for {advice}."
    )
