"""Mesh refinement of a path until the difference of two successive meshes estimates an error below the tolerance.

A path is traced again on coarse meshes; once it is resolved, its points on a finer mesh follow by Newton's method from
those of the coarser one. A few sample points determine the mesh, on which all points are then computed at once; where
that is the mesh on which the path was traced, it is not computed again.
"""

import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.errors import Interrupted, NotConverged
from cosserat_fenicsx.results.accuracy import (
    carry_error,
    compare,
    contact_edges,
    error_before,
    estimate_error,
    hardest,
    of_path,
    order_of,
    resolves,
    spread_error,
    winding_lengths,
)
from cosserat_fenicsx.results.compared import NAMES, POSITION
from cosserat_fenicsx.results.contacts import Passes, check_passes
from cosserat_fenicsx.results.records import find_again, keep_confirmed, lost_at
from cosserat_fenicsx.statics.meshes import (
    MOST_MOVES,
    balanced,
    halved,
    loose_edges,
    plainly_resolved,
    resolving,
    with_edges,
    with_layers,
    with_turns,
)
from cosserat_fenicsx.statics.problem import Promoted


@dataclass(frozen=True)
class Refinement:
    """Settings of the mesh refinement."""

    most_elements: int = 1024  # of one rod
    # Positions that differ by less on two meshes, relative to the largest displacement, are on the same branch: the
    # points on the finer mesh may start from those on the coarser one.
    resolved: float = 1e-2
    quarters: int = 4  # refinement factors are multiples of one over this, so that scenes share compiled meshes
    aim: float = 0.8  # the error aimed at, over the tolerance
    located: float = 1e-6  # smallest tolerance of the load factors of events on two meshes
    for_events: int = 2  # most finer meshes that are solved for events alone
    few_new: int = 4  # events that a mesh may have in addition to those of the one before, which a finer one may clear
    most_lost: int = 2  # finer meshes on which a path with events is not found again, before it is given up
    most_balancings: int = 4  # times that the error is equidistributed over the elements
    cheap: int = 800  # unknowns, of all points together, that are cheaper to solve than another mesh is to make


_REFINEMENT = Refinement()

#: see `Refinement.resolved`
RESOLVED = _REFINEMENT.resolved


class _TooCoarse(Exception):
    """The path on a coarse first mesh is not plain, see `_plain`."""


def refine(trace, correct, bar, scene, layout, tol, bound, degree, usual=None):
    """A path whose estimated errors are at most `tol`, relative, from the first mesh on; bound: the user's criteria
    among those that it bounds; bar: the `Progress`.

    trace: (layout, path or None) -> path followed from the unloaded state, through the points of the given path;
    correct: (layout, path) -> its points corrected on this mesh, None where that fails; usual: for a first mesh coarser
    than usual, the mesh to start again with unless the path is plain, see `_plain`. Raises NotConverged where two
    meshes in a row cannot be solved or the accuracy is not reached, Promoted where the path leaves the plane.
    """
    search = _Search(trace, correct, bar, scene, tol, bound, degree, usual)
    try:
        while True:
            try:
                found = search.on(layout)
            except _TooCoarse:
                layout, search = usual, _Search(trace, correct, bar, scene, tol, bound, degree, None)
                continue
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
    """State of the search for a mesh; whole: the last complete path; accurate: that whose events still differ."""

    def __init__(self, trace, correct, bar, scene, tol, bound, degree, usual):
        self._trace, self._correct, self._bar = trace, correct, bar
        self._scene, self._tol, self._degree = scene, tol, degree
        self._presses = scene.has_walls or any(action.rough for action in scene.actions)
        self._rubs = any(action.finds_friction for action in scene.actions)
        self._usual, self._next = usual, None  # `_next`: the next mesh and its refinement factor, where it is known
        self.whole = self._few = self._which = None  # `_few`: sample points on the last mesh; `_which`: their indices
        self._apart, self._apart_of_whole = None, None  # their differences to the mesh before, and those of all points
        self._level, self._level_of_whole = -1, -2
        self._plain = False  # whether the complete path is, see `_plain`, and its mesh resolves it
        # Assumed orders of the errors in h; refinement factor over the mesh before, None where meshes are not nested.
        self._order, self._factor = np.ones(len(NAMES) + len(bound)), 2.0
        self._failed, self._promoted, self._best = False, None, math.inf
        self.accurate, self._meshes_for_events, self._lost_events = None, _REFINEMENT.for_events, []
        # numbers of events that were not on the mesh before: of the last mesh, and of that before
        self._new_events = math.inf, math.inf
        self._halved = None  # sample points on this mesh and on the one before, if this one halves its elements
        self._error_before = None  # errors of the latter
        self._layered = None  # the next mesh where the last one does not resolve the boundary layers
        self._balancings = self._moved = self._lost = 0

    def on(self, layout):
        """Solve on the next mesh; the path where it is accurate, else None."""
        self._level += 1
        self._bar.on_mesh()
        elements = max(layout.counts)
        try:
            found = self._found_on(layout)
            if self._scene.has_obstacles:
                check_passes(found, self._tol)
        except (NotConverged, Promoted) as problem:
            if self._usual is not None:
                raise _TooCoarse from None
            promoted = isinstance(problem, Promoted)
            again = problem.agrees(self._promoted) if promoted else self._failed and not isinstance(problem, Passes)
            # a mesh for events alone need not be solved: those that two meshes agree on are known
            if again or self.accurate is not None or elements >= _REFINEMENT.most_elements:
                raise
            self._lost += self.whole is not None and bool(self.whole.events) and not promoted
            if self._lost >= _REFINEMENT.most_lost:
                raise NotConverged(_lost(self._tol, self.whole, problem), self.whole) from None
            self._promoted, self._failed = (problem, self._failed) if promoted else (self._promoted, True)
            self._few = self._apart = self._halved = None
            return None
        self._failed = False
        if found is self.whole and self._level_of_whole < self._level:
            return self.confirmed(found)
        resolved = plainly_resolved(found)
        layers = None if resolved else of_path(found)
        if found is self.whole:
            self._plain = _plain(found) and (resolved or _resolves(found, layers))
            if self._usual is not None and not self._plain:
                raise _TooCoarse
        self._layered = None
        if not resolved:
            self._layered = with_layers(self._scene, found.layout, layers) or with_turns(self._scene, found)
        if self._layered is None and self._scene.has_walls and self._moved < MOST_MOVES:
            self._layered = with_edges(self._scene, found.layout, contact_edges(found))
            self._moved += self._layered is not None
        if found.rounding > self._tol:  # refinement would increase it
            raise NotConverged(_rounding_hides(self._tol, found.rounding, elements, found.formulation), found)
        if np.isfinite(found.worst).all():
            reached = float(found.worst.max())
            if reached <= self._tol and found is self.whole and self._layered is None:
                agree = all(event.error <= max(self._tol, _REFINEMENT.located) for event in found.events)
                new, before = self._new_events
                endless = new > max(_REFINEMENT.few_new, before / 2)  # a finer mesh would have new ones, too
                if agree or endless or elements >= _REFINEMENT.most_elements or not self._meshes_for_events:
                    return self.confirmed(found)
                self.accurate, self._meshes_for_events = found, self._meshes_for_events - 1
            elif elements >= _REFINEMENT.most_elements or (reached > self._best and self._best < 1e-8):
                if found is not self.whole:
                    found = self._all_points(layout, found)
                raise NotConverged(_not_accurate(self._tol, reached, self._best, elements, self._degree, found), found)
            self._best = min(self._best, reached)
        if found is self.whole:
            self._few, self._which = hardest(found)
            self._apart = None if self._apart_of_whole is None else self._apart_of_whole[:, self._which]
        return None

    def confirmed(self, path):
        """A path without events that were found on one mesh alone, and without bounds that rounding exceeds."""
        by_rounding = path.rounding_errors.max(axis=1, initial=0.0)
        hidden = [name for name in path.bounded if by_rounding[path.judged.index(name)] > self._tol]
        if hidden:
            path.bounded = tuple(name for name in path.bounded if name not in hidden)
            if not self._scene.idle:  # else all that is found is rounding
                path.why.extend(_rounding_leaves(self._tol, name, path) for name in hidden)
        keep_confirmed(path, max(self._tol, _REFINEMENT.located), self._lost_events if path is self.whole else [])
        return path

    def next_after(self, layout):
        """The next mesh: one that resolves the boundary layers or equidistributes the error where the last one does
        not; else one with twice as many elements, or as many as the order of the error requires."""
        if self._next is not None:
            (following, self._factor), self._next = self._next, None
            return following
        if self._factor != 2:
            self._apart = self._apart_of_whole = None  # only halvings give differences that show an order
        layered, self._layered = self._layered, None
        if layered is not None:
            return self._restarted(layered)
        self._moved = 0
        known = self._few is not None and np.isfinite(self._few.worst).all() and self._few.worst.max() > self._tol
        self._factor = 2.0
        if known:
            above = float(self._few.worst.max()) / (_REFINEMENT.aim * self._tol)
            if self._halved is not None and self._balancings < _REFINEMENT.most_balancings:
                even = balanced(*self._halved, above)
                if even is not None:
                    self._balancings += 1
                    return self._restarted(resolving(self._scene, even, self._degree))
            self._factor = 2.0 if self._presses else self._factor_for(self._few)
        elif self._few is not None and not self._presses:
            return halved(self._few, _REFINEMENT.aim * self._tol)
        return layout.finer(self._scene, self._factor)

    def _restarted(self, layout):
        """A mesh that is not nested in the one before; errors and differences so far are discarded."""
        self._factor = self._apart = self._apart_of_whole = None
        self._best = math.inf
        return layout

    def _found_on(self, layout):
        """The sample points, or all points, on a mesh with known errors; all on the mesh before where it suffices."""
        few = None if self._few is None else self._correct(layout, self._few)
        apart = None if few is None else self._judge(few, self._few, self._apart)
        if few is None or apart[POSITION].max() > _REFINEMENT.resolved:
            if self._usual is not None and self.whole is not None:
                raise _TooCoarse
            whole, apart = self._trace(layout, self.whole), None
            if self._level == self._level_of_whole + 1:
                apart = self._judge(whole, self.whole, self._apart_of_whole)
            return self._keep(whole, apart)
        self._usual = None
        if len(few) == len(self.whole):
            return self._keep(few, apart)
        coarse, self._few, self._apart = self._few, few, apart
        traced = self._level == self._level_of_whole + 1  # all points are known on the mesh before
        if self._error_before is not None and (self._plain or not traced):
            coarse.set_errors(self._error_before)
            judged = coarse
            if coarse.worst.max() <= self._tol:
                if traced:
                    spread_error(self.whole, coarse, self._which)
                judged = self.whole if traced else self._all_points(coarse.layout, coarse)
                if judged.worst.max() <= self._tol:
                    return judged
            if (
                few.worst.max() <= self._tol
                and max(layout.counts) < _REFINEMENT.most_elements
                and self._saves(few, judged)
            ):
                self._few, self._apart = coarse, None
                return few
        return self._all_points(layout, few) if few.worst.max() <= self._tol else few

    def _factor_for(self, path):
        """The refinement factor, at most 2, for the intended errors of a path."""
        above = path.by_mesh.max(axis=1) / (_REFINEMENT.aim * self._tol)
        wanted = min(2.0, float((above ** (1 / self._order))[path.bounds].max()))
        return math.ceil(_REFINEMENT.quarters * wanted) / _REFINEMENT.quarters

    def _saves(self, few, coarse):
        """Whether a mesh between those of two paths suffices and is cheaper for all points; it becomes the next one."""
        if self._presses:  # only halvings keep element ends at the edges of contact, and show what kinks cost
            return False
        factor = self._factor_for(coarse)
        others = len(self.whole) - len(few)
        if few.unknowns * ((2 - factor) / 2 * others - factor / 2 * len(few)) <= _REFINEMENT.cheap:
            return False
        self._next = coarse.layout.finer(self._scene, factor), factor
        return True

    def _judge(self, fine, coarse, before):
        """Set the errors of points from their differences (4, points) to the mesh before, and return these."""
        self._halved = self._error_before = None
        if self._factor is None:
            return compare(fine, coarse)
        if self._factor < 2:
            return carry_error(fine, coarse, self._factor, self._order, before)
        # edges of slip move through elements from state to state
        smooth = not (self._rubs or self._scene.has_walls and loose_edges(fine.layout, contact_edges(fine)))
        apart, gain = estimate_error(fine, coarse, before, smooth=smooth)
        self._halved, self._order = (fine, coarse), order_of(gain, fine.degree)
        if np.divide(fine.layout.counts, coarse.layout.counts).max() <= 2:  # else the coarse mesh is not fine enough
            self._error_before = error_before(apart, gain)
        return apart

    def _keep(self, whole, apart):
        if self.whole is not None:
            self._lost_events = find_again(whole, self.whole)
            self._new_events = sum(np.isnan(event.error) for event in whole.events), self._new_events[0]
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


def _plain(path):
    """Whether a coarse mesh suffices where it resolves the solution: load control, no events, no negative modes."""
    return path.control == "load" and not path.events and not path.negative_modes.any()


def _resolves(path, layers):
    """Whether elements are shorter than boundary layers and half-waves of buckling."""
    return resolves(path.layout, layers) and resolves(path.layout, winding_lengths(path))


def _rounding_leaves(tol, name, path):
    which, unit = NAMES.index(name), {"force": "N", "moment": "N m"}[name]
    size = path._reference.rounding[which].max() * getattr(path.scales, name)
    return (
        f"rounding leaves an error of up to {size:.2g} {unit} in the contact {name}s, "
        f"{path.rounding_errors[which].max():.2g} of the largest, more than tol = {tol:g}, which bounds the rest: "
        f"see errors.{name}"
    )


def _rounding_hides(tol, rounding, elements, formulation):
    return (
        f"the accuracy tol = {tol:g} is out of reach of the formulation {formulation!r} on rods as slender as these: "
        f"rounding errors alone may amount to {rounding:.2g} with {elements} elements per rod. Ask for the formulation "
        "'mixed', or a larger tol."
    )


def _lost(tol, path, problem):
    return (
        f"the accuracy tol = {tol:g} was not reached: finer meshes do not follow the path that coarser ones follow "
        f"({problem}). {lost_at(path)}. The exception's `path` holds the path of a coarser mesh."
    )


def _not_accurate(tol, reached, best, elements, degree, path):
    advice = "a larger tol" if degree == 4 else "a larger tol, or degree 4"
    if any(action.at_nodes for action in path.scene.actions):
        advice += " (the pressure at a wall has kinks, which meshes resolve slowly), or a softer wall"
    if any(action.memory for action in path.scene.actions):
        advice += ", or give elements in place of tol: friction moves the edges of contact from step to step"
    if path.scene.doubts:
        advice = f"{advice}, but first: {'; '.join(path.scene.doubts)}"
    stays = f"is {reached:.2g}, and was {best:.2g} on a coarser mesh" if reached > best else f"stays at {reached:.2g}"
    if reached <= tol:
        stays = f"is {reached:.2g}, but elements do not end yet where contact begins, or a layer is"
    return (
        f"the accuracy tol = {tol:g} was not reached with {elements} elements of degree {degree} per rod: "
        f"the estimated error {stays}. Ask for {advice}."
    )
