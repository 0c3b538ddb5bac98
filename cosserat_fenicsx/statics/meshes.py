"""Meshes of the automatic refinement: the first one, graded ones, and halved ones until two of them agree.

Graded meshes have short elements in boundary layers, and element lengths that equidistribute the error.
"""

import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.traits import traits_of
from cosserat_fenicsx.parts import FunctionAlong
from cosserat_fenicsx.remember import per_scene
from cosserat_fenicsx.results.accuracy import (
    contact_edges,
    element_differences,
    layer_lengths,
    leading_coefficients,
    turns_of,
    unresolved,
)
from cosserat_fenicsx.scene.curves import Line

#: Elements per rod of the first mesh, where the mesh is not given.
FIRST_ELEMENTS = 4


@dataclass(frozen=True)
class FirstMesh:
    """What the first mesh has to resolve, and how large it may be.

    Attributes:
        integrated, sampled, shortest: where sections or loads are functions of s: the relative accuracy with which it
            must integrate the flexibilities 1/EI and the loads, and the rod's length over the longest step of the
            quadrature that it is compared with, and over the shortest element.
        turns, many_turns, most_for_turns: angle (rad) by which an element may turn, where rods turn by more than the
            second; most elements of a rod that are made for that.
        large: elements are halved where their quadrature error exceeds this share of the largest one.
        straight: smallest mean ratio of chord to arc over a quarter of an element, or over an element where the mesh is
            coarser than usual: that of a circular arc of one radian.
        bending, most: wave number of the displacement of a straight rod that bends by about a radian, over its length;
            most elements per unit of it.
        samples: places at which the direction of a rod's axis is compared.
        estimated, gained: error of a mesh that is estimated by its difference from another one over the true error,
            about; and the part of the gain in accuracy of a halving that is assumed for the error of the finer mesh.
    """

    integrated: float = 1e-3
    sampled: int = 256
    shortest: int = 1024
    turns: float = 2.5
    many_turns: float = 6.3
    most_for_turns: int = 512
    large: float = 0.1
    straight: float = 0.958
    bending: float = 4.0
    most: int = 3
    samples: int = 257
    estimated: float = 1.5
    gained: float = 0.25


_FIRST = FirstMesh()


def meshes_for(scene, degree, tol, many):
    """The first mesh for a tolerance; and, where it is coarser than usual, the usual one, else None.

    Args:
        many: whether the path has so many points that those on the first mesh should suffice; else these are all
            computed on one of elements half as long too.
    """
    usual = first_layout(scene, degree)
    if not 1 <= degree <= 4 or not all(rod.uniform for rod in scene.rods) or not _acts_evenly(scene):
        return usual, None
    wanted = (tol if many else _FIRST.gained * 2 ** (degree + 1) * tol) / _FIRST.estimated
    waves = _FIRST.bending + _turning(scene)
    # the best polynomial for a wave is off by (waves/2n)^(p + 1)/((p + 1)! 2^p) of its amplitude, that by 1/waves
    elements = waves / 2 * (wanted * waves * math.factorial(degree + 1) * 2**degree) ** (-1 / (degree + 1))
    layout = first_layout(scene, degree, math.ceil(min(max(elements, 1), _FIRST.most * waves)))
    if elements <= FIRST_ELEMENTS and any(a > b for a, b in zip(layout.counts, usual.counts, strict=True)):
        return usual, None  # which asks less of curves
    coarser = any(a < b for a, b in zip(layout.counts, usual.counts, strict=True))
    return layout, usual if coarser else None


def resolving_turns(scene, layout, largest):
    """A mesh whose elements turn by little where rotations that are prescribed at a rod, or the moments on it, turn it
    by many radians; None where `layout` is one.

    On others the path itself may be lost: a P4 element that turns by more than half a turn has equilibria of its own.

    Args:
        largest: the largest load factor, in size.
    """
    wanted = []
    for rod, breaks in zip(scene.rods, layout.breaks, strict=True):
        here = [x for x in (*scene.supports, *scene.loads) if getattr(getattr(x, "station", None), "rod", None) is rod]
        turn = max((_size(getattr(x, "rotation", None)) for x in here), default=0.0)
        moment = sum(_size(getattr(x, "moment", None)) for x in here)
        turn = largest * max(turn, moment * rod.length / rod.profile.range[0].J.min())
        turn = turn if turn > _FIRST.many_turns else 0.0
        wanted.append(
            np.maximum(1.0, np.minimum(turn / _FIRST.turns * np.diff(breaks), _FIRST.most_for_turns / len(breaks)))
        )
    return layout.resized(scene, wanted) if max(map(np.max, wanted)) > 1 else None


def _size(vector):
    """The size of a vector; 0 of what is none, such as a function of time."""
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
        for action in scene.actions
    )


@per_scene
def _turning(scene):
    """The largest angle by which the direction of a rod's axis turns in all along it, rad."""
    tangents = (rod.curve.frame(np.linspace(0, rod.length, _FIRST.samples))[:, :, 2] for rod in scene.rods)
    return float(max(2 * np.arcsin(np.linalg.norm(np.diff(t, axis=0), axis=1) / 2).sum() for t in tangents))


@per_scene
def first_layout(scene, degree, elements=FIRST_ELEMENTS):
    """The first mesh of so many elements per rod or more."""
    return resolving(scene, Layout.of(scene, elements), degree, 4 if elements >= FIRST_ELEMENTS else 1)


def resolving(scene, layout, degree, parts=4):
    """A mesh, finer where it has to be, that resolves what is given along the rods.

    That is the curvature of the axis, by so many equal parts of an element, and sections and loads that are functions
    of s, a local change of which then cannot be missed by the quadrature points. Where these change in a part of a rod,
    elements are short only there.
    """
    varying = [_varying(scene, rod) for rod in scene.rods]
    while True:
        too_long = [
            _too_long(rod, functions, breaks, degree, parts)
            for rod, functions, breaks in zip(scene.rods, varying, layout.breaks, strict=True)
        ]
        if not any(marked.any() for marked in too_long):
            return layout
        layout = layout.resized(scene, [np.where(marked, 2.0, 1.0) for marked in too_long])


def _varying(scene, rod):
    """Functions, of (n,) arc lengths over the rod's length, that vary along a rod, with values (n, m)."""
    loads = [value for action in scene.actions if getattr(action, "rod", None) is rod
             for value in vars(action).values() if isinstance(value, FunctionAlong)]  # fmt: skip
    functions = [lambda s, value=value: value(s * rod.length) for value in loads]
    low, high = rod.profile.range
    twisted = not isinstance(rod.curve, Line) and (low.J[0] != high.J[1] or rod.profile.coupled)
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
    """(elements,) of bool: the elements to be halved.

    All of them until so many equal parts of them are almost straight. Then those in which the Gauss points do not
    integrate the functions, compared with a fine quadrature.
    """
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
    """(elements,) of bool: where most of the error of the integral of (n,) arc lengths -> (n, m) arises, if that is too
    large."""
    x, weights = np.polynomial.legendre.leggauss(degree)

    def integrals(counts):
        """(elements, m) by so many equal parts of each element."""
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
    """How long the elements of graded meshes are.

    Attributes:
        resolved: largest length of an element next to a support, load or kink, over the length of the boundary layer
            there.
        shortest: smallest length of an element over that of its rod.
        turned: largest angle (rad) by which an element of high degree may turn relative to its rest state.
        beside, most_edges: largest distance of an edge of contact from the end of an element, over its length; most
            edges of one rod that elements end at.
        worth, many: a mesh is graded only if that needs less than this share of the elements of uniform refinement, and
            uniform refinement needs at least so many elements.
        fewest, most: bounds of the number of elements that replace one element.
    """

    resolved: float = 2.0
    shortest: float = 1e-6
    turned: float = 2.0
    beside: float = 3e-4
    most_edges: int = 12
    worth: float = 0.5
    many: int = 32
    fewest: float = 0.5
    most: float = 4.0


_GRADING = Grading()


def layers_of(model):
    """`layer_lengths` at the state of a model in space."""
    _, fields = model.snapshot()
    return layer_lengths(model.scene, model.scales, model.layout, model.rule, fields[None, :, :, :3])


def with_layers(scene, layout, lengths):
    """The layout with elements that resolve boundary layers at the ends of its pieces; None where it resolves them.

    Args:
        lengths: what `results.accuracy.layer_lengths` returns; None where no element is too long.
    """
    if lengths is None:
        return None
    lengths = [np.maximum(layers, _GRADING.shortest) for layers in lengths]
    if not unresolved(scene, layout, lengths):
        return None
    return layout.with_short_ends(scene, [_GRADING.resolved * layers for layers in lengths])


def with_turns(scene, path):
    """The layout whose elements turn by little between their ends; None where all do.

    An element that turns by more than half a turn may have another number of turns than the rod, and finer meshes
    repeat that.
    """
    most = min(_GRADING.turned, path.degree / 2)
    turns = turns_of(path, most)
    if turns is None:
        return None
    return path.layout.resized(scene, [np.maximum(1.0, np.ceil(found / most)) for found in turns])


def with_edges(scene, path):
    """The layout with element ends where contact with walls begins and ends at the points of a path.

    Near ends of elements are moved there; new ones are made where these are prescribed. None where all edges of contact
    are at element ends, or there are too many of them.
    """
    edges = contact_edges(path)
    if edges is None or not loose_edges(path, edges) or max(map(len, edges)) > _GRADING.most_edges:
        return None
    breaks, layout = [], path.layout
    for i, pieces in enumerate(layout.pieces(scene)):
        moved, taken = layout.breaks[i].copy(), {piece.start for piece in pieces} | {len(layout.breaks[i]) - 1}
        more = []
        for x in edges[i].tolist():
            near = int(np.argmin(np.abs(layout.breaks[i] - x)))
            if near not in taken:
                moved[near] = x
                taken.add(near)
            elif abs(moved[near] - x) > _GRADING.beside * np.diff(layout.breaks[i]).min():
                more.append(x)
        breaks.append(np.sort(np.concatenate([moved, more])))
    return Layout(tuple(breaks))


def loose_edges(path, edges):
    """Whether an edge of contact (see `contact_edges`) is not at the end of an element."""
    for breaks, found in zip(path.layout.breaks, edges, strict=True):
        cells = np.clip(np.searchsorted(breaks, found) - 1, 0, len(breaks) - 2)
        off = np.minimum(np.abs(found - breaks[cells]), np.abs(found - breaks[cells + 1]))
        if (off > _GRADING.beside * np.diff(breaks)[cells]).any():
            return True
    return False


def balanced(fine, coarse, above):
    """A layout that, with all elements halved, has the target error, equidistributed over the elements.

    None where uniform refinement does as well.

    Args:
        fine, coarse: Paths with the same points; the mesh of `fine` is that of `coarse` with all elements halved.
        above: the estimated error of `fine` over the target error.
    """
    layout, order = coarse.layout, coarse.degree + 1
    if sum(fine.elements) * above ** (1 / order) < _GRADING.many:
        return None
    rough = np.concatenate([found.max(axis=0) for found in leading_coefficients(fine, fine._motion[..., :3])])
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


def _even(numbers):
    """Whether the mean of the numbers of elements is close to their maximum, so that grading saves little."""
    return numbers.mean() > _GRADING.worth * numbers.max()


def _round_up(number):
    """The least of 1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20 ... not below a number, so that scenes share meshes."""
    step = 2 ** max(0, math.ceil(math.log2(number) - 1e-9) - 3)
    return step * math.ceil(number / step - 1e-9)


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
