"""Graded meshes: short elements in boundary layers, and element lengths that equidistribute the error."""

import math

import numpy as np

from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.results.accuracy import leading_coefficients
from cosserat_fenicsx.results.indicators import contact_edges, element_differences, layer_lengths, turns_of, unresolved

# Largest length of an element next to a support, load or kink, over the length of the boundary layer there.
_RESOLVED = 2.0
# Smallest length of an element over that of its rod.
_SHORTEST = 1e-6
# Largest angle by which an element of high degree may turn relative to its rest state, rad.
_TURNED = 2.0
# Largest distance of an edge of contact from the end of an element, over its length; most edges of one rod that
# elements end at.
_BESIDE, _MOST_EDGES = 3e-4, 12
# A mesh is graded only if that needs less than this share of the elements of uniform refinement, and uniform
# refinement needs at least so many elements.
_WORTH, _MANY = 0.5, 32
# Bounds of the number of elements that replace one element.
_FEWEST, _MOST = 0.5, 4.0


def layers_of(model):
    """`layer_lengths` at the state of a model in space."""
    _, fields = model.snapshot()
    return layer_lengths(model.scene, model.scales, model.layout, model.rule, fields[None, :, :, :3])


def with_layers(scene, layout, lengths):
    """The layout with elements that resolve boundary layers at the ends of its pieces; None where it resolves them.

    Args:
        lengths: what `results.indicators.layer_lengths` returns; None where no element is too long.
    """
    if lengths is None:
        return None
    lengths = [np.maximum(layers, _SHORTEST) for layers in lengths]
    if not unresolved(scene, layout, lengths):
        return None
    return layout.with_short_ends(scene, [_RESOLVED * layers for layers in lengths])


def with_turns(scene, path):
    """The layout whose elements turn by little between their ends; None where all do.

    An element that turns by more than half a turn may have another number of turns than the rod, and finer meshes
    repeat that.
    """
    most = min(_TURNED, path.degree / 2)
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
    if edges is None or not loose_edges(path, edges) or max(map(len, edges)) > _MOST_EDGES:
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
            elif abs(moved[near] - x) > _BESIDE * np.diff(layout.breaks[i]).min():
                more.append(x)
        breaks.append(np.sort(np.concatenate([moved, more])))
    return Layout(tuple(breaks))


def loose_edges(path, edges):
    """Whether an edge of contact (see `contact_edges`) is not at the end of an element."""
    for breaks, found in zip(path.layout.breaks, edges, strict=True):
        cells = np.clip(np.searchsorted(breaks, found) - 1, 0, len(breaks) - 2)
        off = np.minimum(np.abs(found - breaks[cells]), np.abs(found - breaks[cells + 1]))
        if (off > _BESIDE * np.diff(breaks)[cells]).any():
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
    if sum(fine.elements) * above ** (1 / order) < _MANY:
        return None
    rough = np.concatenate([found.max(axis=0) for found in leading_coefficients(fine, fine._moved)])
    if _even(rough ** (1 / coarse.degree)):
        return None
    differences = element_differences(fine, coarse)
    largest = max(found.max() for found in differences)
    if largest == 0:
        return None
    wanted = [(above * found / largest) ** (1 / order) for found in differences]
    wanted = [np.clip(number, _FEWEST, _MOST) for number in wanted]
    if _even(np.concatenate(wanted)):
        return None
    for number, pieces in zip(wanted, layout.pieces(coarse.scene), strict=True):
        for piece in pieces:
            total = number[piece].sum()
            number[piece] *= _round_up(total) / total
    return layout.resized(coarse.scene, wanted)


def _even(numbers):
    """Whether the mean of the numbers of elements is close to their maximum, so that grading saves little."""
    return numbers.mean() > _WORTH * numbers.max()


def _round_up(number):
    """The least of 1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20 ... not below a number, so that scenes share meshes."""
    step = 2 ** max(0, math.ceil(math.log2(number) - 1e-9) - 3)
    return step * math.ceil(number / step - 1e-9)
