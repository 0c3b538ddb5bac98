"""Meshes of the automatic refinement: the first one, graded ones, and halved ones until two of them agree.

Graded meshes have short elements in boundary layers, and element lengths that equidistribute the error.
"""

import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.errors import NotConverged, SceneError
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.progress import MeshProgress
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.formulation import traits_of
from cosserat_fenicsx.parts import FunctionAlong, per_scene
from cosserat_fenicsx.results.accuracy import (
    LONGEST_IN_LAYER,
    element_differences,
    expected_differences,
    layer_lengths,
    leading_coefficients,
    turns_of,
    unresolved,
)
from cosserat_fenicsx.results.compared import cells_of
from cosserat_fenicsx.results.contacts import Passes
from cosserat_fenicsx.scene.action import without_stress
from cosserat_fenicsx.scene.curves import Line
from cosserat_fenicsx.scene.signals import sample_times

#: Elements per rod of the first mesh, where the mesh is not given.
FIRST_ELEMENTS = 4


@dataclass(frozen=True)
class FirstMesh:
    """Settings of the first mesh: what it has to resolve, and how large it may be."""

    # Where sections or loads are functions of s: relative accuracy of the integrals of the flexibilities 1/EI and of
    # the loads.
    integrated: float = 1e-3
    sampled: int = 256  # intervals per rod of the quadrature that the integrals are compared with
    shortest: int = 1024  # the rod's length over the shortest element
    turns: float = 2.5  # angle (rad) by which an element may turn, where rods turn by many radians
    many_turns: float = 6.3  # smallest angle (rad) of a rod that turns by many radians
    most_for_turns: int = 512  # elements of such a rod
    in_law: float = 1.0  # angle (rad) by which an element may turn without stress
    inside: tuple = (0.01, 0.25, 0.5, 0.75, 0.99)  # places in an element where that is sampled
    large: float = 0.1  # share of the largest quadrature error above which an element is halved
    # Smallest mean ratio of chord to arc over a part of an element (see `resolving`), as of an arc of one radian.
    straight: float = 0.958
    bending: float = 4.0  # wave number of the displacement of a straight rod that bends by a radian, over its length
    most: int = 3  # elements per unit of the wave number
    many_rods: int = 32  # fewest rods of a frame in which each is assumed to bend by little: one element of each
    samples: int = 257  # places at which the direction of a rod's axis is compared
    estimated: float = 1.5  # difference of two meshes over the true error, about
    gained: float = 0.25  # share of the gain of a halving that is assumed for the finer mesh


_FIRST = FirstMesh()


@per_scene
def meshes_for(scene, degree, tol, many):
    """The first mesh for a tolerance; and, where it is coarser than usual, the usual one, else None; many: whether the
    path has so many points that the first mesh should suffice for them."""
    usual = first_layout(scene, degree)
    if not 1 <= degree <= 4 or not all(rod.uniform for rod in scene.rods) or not _acts_evenly(scene):
        return usual, None
    wanted = (tol if many else _FIRST.gained * 2 ** (degree + 1) * tol) / _FIRST.estimated
    waves = _FIRST.bending + _turning(scene)
    # the best polynomial for a wave is off by (waves/2n)^(p + 1)/((p + 1)! 2^p) of its amplitude, that by 1/waves
    elements = waves / 2 * (wanted * waves * math.factorial(degree + 1) * 2**degree) ** (-1 / (degree + 1))
    if len(scene.rods) >= _FIRST.many_rods:
        elements = 1
    layout = first_layout(scene, degree, math.ceil(min(max(elements, 1), _FIRST.most * waves)))
    if elements <= FIRST_ELEMENTS and any(a > b for a, b in zip(layout.counts, usual.counts, strict=True)):
        return usual, None  # which asks less of curves
    coarser = any(a < b for a, b in zip(layout.counts, usual.counts, strict=True))
    return layout, usual if coarser else None


@per_scene
def resolving_turns(scene, layout, largest):
    """A mesh with elements that turn by little where prescribed rotations or moments turn a rod by many radians, at the
    largest load factor in size; None where `layout` is one. (A P4 element that turns by more than half a turn has
    equilibria of its own.)"""
    turns, moments = {}, {}
    for x in (*scene.supports, *scene.loads):
        if x.station is not None:
            rod = x.station.rod
            turns[rod] = max(turns.get(rod, 0.0), _size(getattr(x, "rotation", None)))
            moments[rod] = moments.get(rod, 0.0) + _size(getattr(x, "moment", None))
    wanted = [np.ones(count) for count in layout.counts]
    for rod in turns:
        turn = largest * max(turns[rod], moments[rod] * rod.length / rod.profile.range[0].J.min())
        if turn > _FIRST.many_turns:
            i = scene.number(rod)
            sizes, most = np.diff(layout.breaks[i]), _FIRST.most_for_turns / len(layout.breaks[i])
            wanted[i] = np.maximum(1.0, np.minimum(turn / _FIRST.turns * sizes, most))
    return layout.resized(scene, wanted) if max(map(np.max, wanted)) > 1 else None


def turning_in_law(scene, layout, load_factors, elements=None):
    """The mesh, with elements that turn by at most a radian without stress (`Action.in_law`), for load factors; a
    SceneError where those of a given mesh (`elements`) turn by more, or a rod has no length left without stress."""
    if not scene.acts_in_law:
        return layout
    times = {t for action in scene.loads if action.in_law for t in sample_times(action, scene.horizon)}
    reach, wanted = (min(load_factors), max(load_factors)), []
    largest = max(map(abs, reach))
    for rod, breaks in zip(scene.rods, layout.breaks, strict=True):
        s = rod.length * (breaks[:-1, None] + np.diff(breaks)[:, None] * _FIRST.inside)
        parts = np.array([without_stress(scene, rod, s.ravel(), t) for t in times])
        full, scaled = parts[:, :, 1, :, 2].transpose(1, 0, 2)
        for factor in (0.0, *reach):
            if (shortest := 1 + (full + factor * scaled).min()) <= 0:
                raise SceneError(
                    f"rod '{rod.name}' has {shortest:.3g} of its length left without stress at the load factor "
                    f"{factor:g}, by what acts in its law (Growth, Thermal, Actuation, Pretension): expected more than "
                    "0"
                )
        sizes = np.linalg.norm(parts[:, :, 0], axis=3).max(axis=0).reshape(2, *s.shape).max(axis=2)
        turns = (sizes[0] + largest * sizes[1]) * np.diff(breaks) * rod.length
        if elements and turns.max() > _FIRST.in_law:
            raise SceneError(
                f"elements = {elements}: without stress one of rod '{rod.name}' would turn by {turns.max():.3g} rad: "
                f"expected at most {_FIRST.in_law:g} rad, elements = {math.ceil(elements * turns.max())} or more"
            )
        wanted.append(np.maximum(1.0, np.ceil(turns / _FIRST.in_law - 1e-9)))
    return layout.resized(scene, wanted) if max(map(np.max, wanted)) > 1 else layout


def _size(vector):
    """The length of a vector; 0 for None and functions of time."""
    try:
        return float(np.linalg.norm(np.asarray(vector, dtype=float))) if vector is not None else 0.0
    except (TypeError, ValueError):
        return 0.0


@per_scene
def _acts_evenly(scene):
    """Whether loads along rods are constant: no functions, and nothing that depends on the motion."""
    return all(
        action.station is not None
        or (
            type(action).__module__.startswith("cosserat_fenicsx.")
            and not any(map(callable, vars(action).values()))
            and traits_of(action, scene.rods).dead
        )
        for action in (*scene.actions, *scene.all_loads)
    )


@per_scene
def _turning(scene):
    """The largest total turn of the axis of a rod, rad."""
    curved = [rod for rod in scene.rods if not isinstance(rod.curve, Line)]
    tangents = (rod.curve.frame(np.linspace(0, rod.length, _FIRST.samples))[:, :, 2] for rod in curved)
    turned = (2 * np.arcsin(np.linalg.norm(np.diff(t, axis=0), axis=1) / 2).sum() for t in tangents)
    return float(max(turned, default=0.0))


@per_scene
def first_layout(scene, degree, elements=FIRST_ELEMENTS):
    """The first mesh, of at least `elements` elements per rod."""
    return resolving(scene, Layout.of(scene, elements), degree, 4 if elements >= FIRST_ELEMENTS else 1)


def resolving(scene, layout, degree, parts=4):
    """The mesh, refined locally where it does not resolve the curvature of the axis (sampled at `parts` equal parts of
    an element), or sections and loads that are functions of s, whose local changes quadrature points may miss."""
    along = {}
    for action in scene.actions:
        loads = [value for value in vars(action).values() if isinstance(value, FunctionAlong)]
        if loads and getattr(action, "rod", None) is not None:
            along.setdefault(action.rod, []).extend(loads)
    varying = {i: _varying(rod, along.get(rod, ())) for i, rod in enumerate(scene.rods)}
    varying = {i: found for i, found in varying.items() if found or not isinstance(scene.rods[i].curve, Line)}
    while varying:
        wanted = [np.ones(count) for count in layout.counts]
        for i, functions in varying.items():
            wanted[i] += _too_long(scene.rods[i], functions, layout.breaks[i], degree, parts)
        if max(map(np.max, wanted)) == 1:
            break
        layout = layout.resized(scene, wanted)
    return layout


def _varying(rod, loads):
    """Functions, of (n,) arc lengths over the rod's length, that vary along a rod, also of `loads`, values (n, m)."""
    functions = [lambda s, value=value: value(s * rod.length) for value in loads]
    twisted = False
    if not isinstance(rod.curve, Line):
        low, high = rod.profile.range
        twisted = low.J[0] != high.J[1] or rod.profile.coupled
    if rod.profile.uniform and not twisted:
        return functions

    def flexibilities(s):
        flexible = rod.stiffness_at(s * rod.length).flexibility
        if twisted:  # as tensors of inertial components
            across = rod.curve.frame(s * rod.length)[:, :, :2]
            flexible = np.einsum("kai,kij,kbj->kab", across, flexible, across)
        return flexible.reshape(len(s), -1)

    return [*functions, flexibilities]


def _too_long(rod, functions, breaks, degree, parts):
    """(elements,) of bool: to be halved, until `parts` of each are straight and Gauss points integrate functions."""
    long_enough = np.diff(breaks) > 1.01 / _FIRST.shortest
    ends = (breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(parts) / parts).ravel()
    chords = np.diff(rod.curve.position(np.append(ends, 1.0) * rod.length), axis=0)
    if np.linalg.norm(chords, axis=1).sum() < _FIRST.straight * rod.length:
        return long_enough
    marked = np.zeros(len(breaks) - 1, dtype=bool)
    for values in functions:
        marked |= _unresolved(values, breaks, degree)
    return long_enough & marked


def _unresolved(values, breaks, degree):
    """(elements,) of bool: where most of the error of the integral of a function arises, if that is too large."""
    x, weights = np.polynomial.legendre.leggauss(degree)

    def integrals(counts):
        """(elements, m) by `counts` equal parts of each element."""
        owner = np.repeat(np.arange(len(counts)), counts)
        sizes = (np.diff(breaks) / counts)[owner]
        inner = np.arange(len(owner)) - np.concatenate([[0], np.cumsum(counts)])[owner]
        s = (breaks[owner] + inner * sizes)[:, None] + sizes[:, None] * (x + 1) / 2
        parts = np.einsum("g,cgi,c->ci", weights / 2, values(s.ravel()).reshape(*s.shape, -1), sizes)
        found = np.zeros((len(counts), parts.shape[1]))
        np.add.at(found, owner, parts)
        return found

    whole = np.ones(len(breaks) - 1, dtype=int)
    fine = integrals(np.maximum(8, np.ceil(_FIRST.sampled * np.diff(breaks) - 1e-9).astype(int)))
    # of whole elements and of parts: one of these may agree by chance
    error = np.max([np.abs(integrals(parts * whole) - fine) for parts in (1, 2, 3)], axis=0)
    if (error.sum(axis=0) <= _FIRST.integrated * np.abs(fine).sum(axis=0).max()).all():
        return np.zeros(len(whole), dtype=bool)
    error = error.max(axis=1)
    return error > _FIRST.large * error.max()


@dataclass(frozen=True)
class Grading:
    """Settings of the elements of graded meshes."""

    # Largest length of an element next to a support, load or kink, over the length of the boundary layer there.
    resolved: float = 2.0
    shortest: float = 1e-6  # smallest length of such an element, over its rod's
    turned: float = 2.0  # largest angle (rad) by which an element of high degree may turn relative to its rest state
    beside: float = 3e-4  # largest distance of an edge of contact from the end of an element, over its length
    most_edges: int = 12  # edges of one rod that elements end at
    # A mesh is graded only where it needs less than this share of the elements of uniform refinement.
    worth: float = 0.5
    many: int = 32  # fewest elements of uniform refinement for which a mesh is graded
    fewest: float = 0.5  # least number of elements that replace one element
    most: float = 4.0  # largest number of elements that replace one element


_GRADING = Grading()
#: Times that element ends are moved to the edges of contact, before elements are halved.
MOST_MOVES = 3
# Moments at Gauss points may be smaller than those at the ends of a rod, by less than this factor.
_SURELY = 0.5


def layers_of(model):
    """`layer_lengths` at the state of a model in space."""
    _, fields = model.snapshot()
    return layer_lengths(model.scene, model.scales, model.layout, model.rule, fields[None, :, :, :3])


def with_layers(scene, layout, lengths):
    """The layout with elements that resolve boundary layers at the ends of its pieces; None where it resolves them.
    `lengths` are those of `results.accuracy.layer_lengths`."""
    if lengths is None:
        return None
    lengths = [np.maximum(layers, _GRADING.shortest) for layers in lengths]
    if not unresolved(scene, layout, lengths):
        return None
    return layout.with_short_ends(scene, [_GRADING.resolved * layers for layers in lengths])


def with_turns(scene, path):
    """The layout whose elements turn by little between their ends; None where all do. An element that turns by more
    than half a turn may have another number of turns than the rod, which finer meshes inherit."""
    most = min(_GRADING.turned, path.degree / 2)
    turns = turns_of(path, most)
    if turns is None:
        return None
    return path.layout.resized(scene, [np.maximum(1.0, np.ceil(found / most)) for found in turns])


def surely_resolved(scene, layout, degree):
    """(longest element l, m; most): bounds with which the mesh surely resolves boundary layers, half-waves of buckling
    and turns, without a look at its elements: |n| (l/LONGEST_IN_LAYER)^2 is at most the least EI, and |m| l at most
    `most` times the least of EI and GJ; nor do moments then turn a rod by many radians."""
    longest = layout.sizes(scene).max()
    most = min(_GRADING.turned, degree / 2)
    applied = 2 * sum(hasattr(load, "moment") for load in scene.loads)
    if applied:
        most = min(most, _SURELY * _FIRST.many_turns / (applied * scene.lengths.max() / longest))
    return longest, most


def plainly_resolved(path):
    """Whether the mesh of a path surely resolves boundary layers, half-waves of buckling and turns in all its points,
    by bounds that need no look at its elements."""
    scene, scales = path.scene, path.scales
    force, moment, mean = path._reference.largest * (scales.force, scales.moment, scales.moment)
    J, longest = scene.extremes[0].J, path.layout.sizes(scene).max()
    least, bending = J.min(), J[:, :2].min()
    flat = path.model != "spatial" and scene.plane is not None and not any(rod.profile.coupled for rod in scene.rods)
    turn = mean * longest / (bending if flat else least)
    layers = force * (longest / LONGEST_IN_LAYER) ** 2 <= bending
    twisted = moment * longest <= LONGEST_IN_LAYER * least
    return layers and twisted and turn <= min(_GRADING.turned, path.degree / 2)


def with_edges(scene, layout, edges):
    """The layout with element ends, moved or new, where contact with walls begins and ends, for every rod the places
    over its length; None where all edges of contact are at element ends, or there are too many."""
    if edges is None or not loose_edges(layout, edges) or max(map(len, edges)) > _GRADING.most_edges:
        return None
    breaks = []
    for i, pieces in enumerate(layout.pieces(scene)):
        moved, taken = layout.breaks[i].copy(), {piece.start for piece in pieces} | {len(layout.breaks[i]) - 1}
        more = []
        for x in np.asarray(edges[i]).tolist():
            near = int(np.argmin(np.abs(layout.breaks[i] - x)))
            if near not in taken:
                moved[near] = x
                taken.add(near)
            elif abs(moved[near] - x) > _GRADING.beside * np.diff(layout.breaks[i]).min():
                more.append(x)
        breaks.append(np.sort(np.concatenate([moved, more])))
    return Layout(tuple(breaks))


def loose_edges(layout, edges):
    """Whether an edge of contact (see `contact_edges`) is not at the end of an element."""
    for breaks, found in zip(layout.breaks, edges, strict=True):
        cells = np.clip(np.searchsorted(breaks, found) - 1, 0, len(breaks) - 2)
        off = np.minimum(np.abs(found - breaks[cells]), np.abs(found - breaks[cells + 1]))
        if (off > _GRADING.beside * np.diff(breaks)[cells]).any():
            return True
    return False


def balanced(fine, coarse, above):
    """A layout that, with all elements halved, has the target error, equidistributed over the elements; None where
    uniform refinement does as well. The mesh of `fine` is that of `coarse` with all elements halved; above: the
    estimated error of `fine` over the target error."""
    layout, order = coarse.layout, coarse.degree + 1
    if sum(fine.elements) * above ** (1 / order) < _GRADING.many:
        return None
    rough = leading_coefficients(fine)[0].max(axis=0)
    if _even(rough ** (1 / coarse.degree)):
        return None
    differences = element_differences(fine, coarse)
    largest = max(found.max() for found in differences)
    if largest == 0:
        return None
    wanted = [(above * found / largest) ** (1 / order) for found in differences]
    wanted = [np.clip(number, _GRADING.fewest, _GRADING.most) for number in wanted]
    if _even(np.concatenate(wanted)):
        return None
    for number, pieces in zip(wanted, layout.pieces(coarse.scene), strict=True):
        for piece in pieces:
            total = number[piece].sum()
            number[piece] *= _round_up(total) / total
    return layout.resized(coarse.scene, wanted)


def halved(path, target):
    """The layout with all elements halved; in a frame of many rods, those of rods that bend most are cut into more, so
    that the error estimated from the two meshes may be expected to be below the target. path: a `Path` on the mesh,
    whose errors are unknown."""
    layout, scene, p = path.layout, path.scene, path.degree
    if len(scene.rods) < _FIRST.many_rods:
        return layout.finer(scene, 2.0)
    above = 2 * (expected_differences(path) / (2.0**p * target)) ** (1 / p)  # 2^p: the gain that is assumed at most
    of_rods = np.maximum.reduceat(above, [cells.start for cells in cells_of(layout)])
    of_rods = np.clip(np.ceil(of_rods), 2.0, _GRADING.most).tolist()
    if max(of_rods) == 2:
        return layout.finer(scene, 2.0)
    return layout.resized(scene, [np.full(count, x) for count, x in zip(layout.counts, of_rods, strict=True)])


def _even(numbers):
    """Whether the mean of the numbers of elements is close to their maximum, so that grading saves little."""
    return numbers.mean() > _GRADING.worth * numbers.max()


def _round_up(number):
    """The least of 1, 2, ... 8, 10, 12, 14, 16, 20 ... not below a number, so that scenes share meshes."""
    step = 2 ** max(0, math.ceil(math.log2(number) - 1e-9) - 3)
    return step * math.ceil(number / step - 1e-9)


def until_two_meshes_agree(owner, scene, on_mesh, tol, *, most, elements, degree, advice, progress, comm, gains=None,
                          least=None, places=None):  # fmt: skip
    """Solve an eigenproblem on successively halved meshes until the results of two of them agree to `tol`, relative:
    (what `on_mesh` returned, estimated relative errors (n,) or NaN).

    on_mesh: of a layout, returns a tuple: the numbers to compare (n,), which may be complex, the lengths of boundary
    layers (see `layers_of`) or None, and further results. most: elements per rod of the last mesh; elements: those of a
    given mesh, or None. gains: where the error is estimated by the gain of a halving, of order 2 p, instead of by the
    difference of two meshes, which is larger: of what `on_mesh` returned, the largest gain that is assumed, as a power
    of 2. least: of what `on_mesh` returned, relative errors (n,) that two meshes may not show; places: the edges of
    contact, see `with_edges`. Raises NotConverged.
    """
    if comm.rank == 0:
        scene.warn()
    layout = turning_in_law(scene, Layout.of(scene, elements or FIRST_ELEMENTS), [1.0], elements)
    coarse, best, worse, moves = None, math.inf, 0, 0
    failed = False  # whether the last mesh could not be solved
    before = coarse_layout = None  # relative differences of the halving before; the mesh of `coarse`
    with MeshProgress(owner, tol, progress, comm) as bar:
        while True:
            obey()
            largest = max(layout.counts)
            bar.on(largest, best)
            try:
                found = on_mesh(layout)
            except NotConverged as problem:
                if elements or largest >= most or (failed and not isinstance(problem, Passes)):
                    raise
                failed, coarse, before, layout = True, None, None, layout.finer(scene, 2)
                continue
            failed, (numbers, lengths, *_) = False, found
            if elements:
                return found, np.full(len(numbers), np.nan)
            layered = with_layers(scene, layout, lengths)
            if layered is not None:
                coarse, before, layout = None, None, layered
                continue
            edges = places(found) if places else None
            moved = with_edges(scene, layout, edges) if moves < MOST_MOVES else None
            if moved is not None:
                layout, moves = moved, moves + 1
                continue
            moves = 0
            comparable = coarse is not None and len(coarse) == len(numbers)
            if coarse is not None and not comparable and largest >= most:
                raise NotConverged(
                    f"two meshes differ in how many were found: {len(coarse)} on the coarser one, {len(numbers)} with "
                    f"{largest} elements of degree {degree} per rod. Ask for fewer."
                )
            error = None
            if comparable:
                # an edge beside the end of its element has an error in proportion to the length of elements
                error = _apart(numbers, coarse) * (1 if edges is None else 2)
                hidden = 0.0 if least is None else least(found)
                reached = np.maximum(error, hidden).max(initial=0.0)
                # Differences may grow once before they converge; growth twice in a row is rounding.
                worse = worse + 1 if reached > max(tol, best) else 0
                if worse == 2 or (reached > tol and largest >= most):
                    raise NotConverged(
                        f"the accuracy tol = {tol:g} was not reached with {largest} elements of degree {degree} per "
                        f"rod: the estimated error stays at {min(reached, best):.2g}. Ask for {advice}."
                    )
                best = min(best, reached)
            if best <= tol:
                if gains is not None and edges is None:  # the place of an edge does not converge in the order p
                    if before is None:
                        before = _difference_before(scene, on_mesh, coarse, coarse_layout)
                    if before is not None:
                        error = error / _gain(before, error, gains(found))
                return found, np.maximum(error, hidden)
            before = error if comparable and len(error) else None
            coarse, coarse_layout, layout = numbers, layout, layout.finer(scene, 2)


def _apart(fine, coarse):
    """(n,) differences of numbers on two meshes, relative."""
    return np.abs(fine - coarse) / np.where(fine == 0, np.inf, np.abs(fine))


def _difference_before(scene, on_mesh, numbers, layout):
    """Relative differences (n,) of the numbers to those on half as many elements; None where that is too coarse."""
    try:
        coarse = on_mesh(layout.finer(scene, 0.5))[0]
    except NotConverged:
        return None
    return _apart(numbers, coarse) if len(coarse) == len(numbers) else None


def _gain(before, error, most):
    """(n,) assumed gain of accuracy by a halving: a part of that observed, at most the order's 2^most."""
    return np.clip((before / np.maximum(error, 1e-300) - 1) / 4, 1, max(1.0, 2.0**most))
