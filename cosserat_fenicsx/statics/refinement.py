"""Mesh refinement of a path until the difference of two successive meshes estimates an error below the tolerance.

A path is traced anew on coarse meshes; once it is resolved, its points on a finer mesh follow by Newton's method from
those of the coarser one. A few sample points determine the mesh, on which all points are then computed at once.
"""

import math

import numpy as np

from cosserat_fenicsx.errors import Interrupted, NotConverged
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.results.accuracy import carry_error, compare, estimate_error, hardest, spread_error
from cosserat_fenicsx.results.indicators import of_path
from cosserat_fenicsx.results.same_events import find_again, keep_confirmed
from cosserat_fenicsx.statics.grading import balanced, with_layers
from cosserat_fenicsx.statics.path.recorder import Promoted

_MOST_ELEMENTS = 1024
# Positions that differ by less than this on two meshes, relative to the largest displacement, are on the same branch:
# the points on the finer mesh may start from those on the coarser.
_RESOLVED = 1e-2
# Refinement factors are multiples of 1/4, so that scenes share compiled meshes; the error aimed at, over the tolerance.
_QUARTERS, _AIM = 4, 0.8
# Smallest tolerance of the load factors of events on two meshes; largest number of finer meshes that are solved for
# events alone, once the positions are accurate.
_LOCATED, _FOR_EVENTS = 1e-6, 2
# Largest number of times that the error is equidistributed over the elements.
_MOST_BALANCINGS = 4
# Paths with fewer unknowns than this at all points together are cheaper to solve than to sample.
_CHEAP = 800


def refine(trace, correct, scene, layout, tol, degree):
    """A path whose estimated error is at most `tol`.

    Args:
        trace: (layout, path or None) -> path followed from the unloaded state, through the points of the given path.
        correct: (layout, path) -> the points of the path on this mesh by Newton's method from those of the given path;
            None where that fails.
        scene: the scene; layout: the first mesh.
        tol: largest error of positions relative to the largest displacement.
        degree: of the elements, for error messages.

    Raises:
        NotConverged: two meshes in a row cannot be solved, or the accuracy is not reached.
        Promoted: the path leaves the plane; the spatial model is needed.
    """
    search = _Search(trace, correct, scene, tol, degree)
    try:
        while True:
            try:
                found = search.on(layout)
            except NotConverged:
                if search.accurate is None:
                    raise
                found = search.confirmed(search.accurate)
            if found is not None:
                return found
            layout = search.next_after(layout)
    except Interrupted as stop:  # a complete path on a coarser mesh is preferred to a partial one on a finer mesh
        raise Interrupted(stop.path if search.whole is None else search.whole) from None


class _Search:
    """State of the search for a mesh.

    Attributes:
        whole: the complete path on the last mesh on which all points were computed, or None.
        accurate: the last path with accurate positions whose events differ from those of the mesh before; or None.
    """

    def __init__(self, trace, correct, scene, tol, degree):
        self._trace, self._correct, self._scene, self._tol, self._degree = trace, correct, scene, tol, degree
        self.whole = self._few = self._which = None  # `_few`: sample points on the last mesh; `_which`: their indices
        self._apart, self._apart_of_whole = None, None  # their differences to the mesh before, and those of all points
        self._level, self._level_of_whole = -1, -2
        # Assumed order of the error in h; refinement factor over the mesh before, None where the meshes are not nested.
        self._order, self._factor = 1.0, 2.0
        self._failed, self._promoted, self._best = False, None, math.inf
        self.accurate, self._meshes_for_events, self._lost_events = None, _FOR_EVENTS, []
        self._halved = None  # sample points on this mesh and on the one before, if this one halves its elements
        self._layered = None  # the next mesh where the last one does not resolve the boundary layers
        self._balancings = 0

    def on(self, layout):
        """Solve on the next mesh; the path where it is accurate, else None."""
        self._level += 1
        elements = max(layout.counts)
        try:
            found = self._found_on(layout)
        except NotConverged:
            if self._failed or elements >= _MOST_ELEMENTS:
                raise
            self._failed, self._few, self._apart, self._halved = True, None, None, None
            return None
        except Promoted as found:
            if found.agrees(self._promoted) or elements >= _MOST_ELEMENTS:
                raise
            self._promoted, self._few, self._apart, self._halved = found, None, None, None
            return None
        self._failed = False
        self._layered = with_layers(self._scene, layout, of_path(found))
        if found.rounding > self._tol:  # refinement would increase it
            raise NotConverged(_rounding_hides(self._tol, found.rounding, elements, found.formulation), found)
        if np.isfinite(found.error).all():
            reached = float(found.error.max())
            if reached <= self._tol and found is self.whole and self._layered is None:
                if elements >= _MOST_ELEMENTS or self._events_agree(found) or not self._meshes_for_events:
                    return self.confirmed(found)
                self.accurate, self._meshes_for_events = found, self._meshes_for_events - 1
            elif elements >= _MOST_ELEMENTS or (reached > self._best and self._best < 1e-8):
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

    def _events_agree(self, path):
        return all(event.error <= max(self._tol, _LOCATED) for event in path.events)

    def confirmed(self, path):
        """A path without the events that were not found on two meshes."""
        keep_confirmed(path, max(self._tol, _LOCATED), self._lost_events if path is self.whole else [])
        return path

    def next_after(self, layout):
        """The next mesh.

        It resolves the boundary layers or equidistributes the error where the last mesh does not. Else it has twice as
        many elements, or fewer where these suffice by the assumed order of the error.
        """
        if self._factor != 2:
            self._apart = self._apart_of_whole = None  # only halvings give differences that show an order
        layered, self._layered = self._layered, None
        if layered is not None:
            return self._restarted(layered)
        known = self._few is not None and np.isfinite(self._few.error).all() and self._few.error.max() > self._tol
        self._factor = 2.0
        if known:
            above = float(self._few.error.max()) / (_AIM * self._tol)
            if self._halved is not None and self._balancings < _MOST_BALANCINGS:
                even = balanced(*self._halved, above)
                if even is not None:
                    self._balancings += 1
                    return self._restarted(even)
            self._factor = min(2.0, math.ceil(_QUARTERS * above ** (1 / self._order)) / _QUARTERS)
        return layout.finer(self._scene, self._factor)

    def _restarted(self, layout):
        """A mesh that is not nested in the one before; errors and differences so far are discarded."""
        self._factor = self._apart = self._apart_of_whole = None
        self._best = math.inf
        return layout

    def _found_on(self, layout):
        """The sample points, or all points, on a mesh, with their errors where these are known."""
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
        """Set the errors of points from their differences (points,) to the mesh before, and return these."""
        self._halved = None
        if self._factor is None:
            return compare(fine, coarse)
        if self._factor < 2:
            return carry_error(fine, coarse, self._factor, self._order, before)
        apart, self._order = estimate_error(fine, coarse, before)
        self._halved = fine, coarse
        return apart

    def _keep(self, whole, apart):
        if self.whole is not None:
            self._lost_events = find_again(whole, self.whole)
        self.whole, self._apart_of_whole, self._level_of_whole = whole, apart, self._level
        return whole

    def _all_points(self, layout, few):
        """All points on a mesh where the sample points are known."""
        others = np.ones(len(self.whole), dtype=bool)
        others[self._which] = False
        rest = self._correct(layout, self.whole.at_points(np.flatnonzero(others)))
        whole = self._trace(layout, self.whole) if rest is None else few.with_points(rest, others)
        spread_error(whole, few, self._which, self.whole)
        return self._keep(whole, None)


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
        NotConverged: the accuracy is not reached.
    """
    layout, coarse, best, worse = Layout.of(scene, elements or first), None, math.inf, 0
    before = coarse_layout = None  # relative differences of the halving before; the mesh of `coarse`
    while True:
        obey()
        progress.on(max(layout.counts), best)
        found = on_mesh(layout)
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


def _rounding_hides(tol, rounding, elements, formulation):
    return (
        f"the accuracy tol = {tol:g} is out of reach of the formulation {formulation!r} on rods as slender as these: "
        f"rounding errors alone may amount to {rounding:.2g} with {elements} elements per rod. Ask for the formulation "
        "'mixed', or a larger tol."
    )


def _not_accurate(tol, reached, elements, degree, path):
    advice = "a larger tol" if degree == 4 else "a larger tol, or degree 4"
    if any(action.at_nodes for action in path.scene.actions):
        advice += " (the pressure at a wall has kinks, which meshes resolve slowly), or a softer wall"
    if path.scene.doubts:
        advice = f"{advice}, but first: {'; '.join(path.scene.doubts)}"
    return (
        f"the accuracy tol = {tol:g} was not reached with {elements} elements of degree {degree} per rod: "
        f"the estimated error stays at {reached:.2g}. Ask for {advice}."
    )
