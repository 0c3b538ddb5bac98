"""Error estimates of a path from two meshes, transfer of its points to another mesh, and where a solution needs short
elements: in boundary layers of bending, and where two meshes differ most."""

import math

import numpy as np

from cosserat_fenicsx.numerics import conjugate_product, directors
from cosserat_fenicsx.results.compared import (
    FORCE,
    MOMENT,
    NAMES,
    POSITION,
    ROTATION,
    ROUNDING,
    cells_of,
    differences,
    halfway,
    transferred,
)
from cosserat_fenicsx.results.recovery import Threads
from cosserat_fenicsx.results.rods import resting

#: Largest number of points of a path that are all sample points.
FEW = 3
# Ratios of the largest difference to the one at element ends, above which the ends clearly superconverge.
AHEAD, FAR_AHEAD = 4, 30
# The same ratio, below which the error of the element ends dominates.
OF_ENDS = 2
# Safety factors of the assumed gain: usual, and for relative differences below the third number (asymptotic range).
SAFETY, SAFETY_BELOW, ASYMPTOTIC = 4, 2, 1e-3
# Assumed error over the difference of two meshes where a kink lies inside elements; divisor of the gain where it lies
# at their ends.
_ROUGH, _NEARLY = 2.0, 4.0
# Assumed error of the finer mesh over its estimate, in the estimate of the coarser one; likely over assumed gain.
_CAUTION, _LIKELY = 2, 1.5
# Element lengths of a rod within this ratio count as equal.
_UNEQUAL = 1.9
# Safety factors of interpolated errors: of n, and of all others.
_BETWEEN_FORCES, _BETWEEN = 2.0, 1.25
# Samples whose leading coefficients differ by more than this factor get another one between them.
_APART = 10.0
# A point smoother than the roughest by this ratio of leading coefficients is sampled too: it may converge differently.
_SMOOTHER = 0.1
# Least displacement, over the largest of the path, of a point that is sampled for its smoothness.
_SEEN = 1e-3


def estimate_error(fine, coarse, before=None, *, smooth=True):
    """Estimate the errors of a path from the same points on the mesh of elements twice as long; sets `fine.errors`.

    An error is the difference of the two meshes, see `compared.differences`, over an assumed gain in accuracy. The gain
    of a halving is asymptotically 2^(p + 1) between the element ends. Only a part of it is assumed, a quarter, or a
    half where the differences are small, and only where the differences confirm it:
    - with the differences `before` of the previous halving: that part of (their ratio to the present ones - 1), at
      least 1;
    - without: that part if the element ends, whose order is 2 p, are much more accurate than the rest, 2^(p - 3) if
      they are moderately more accurate, else 1. Splines and sections that are functions of s may reduce the order: for
      these at most 2^(p - 3). A quarter at most where that does not hold for every quantity, and on elements of
      unequal length, as in boundary layers.

    Where a rod has more than twice as many elements, what halved ones would leave of its differences is meant, see
    `compared.differences`.

    Each quantity is judged by itself, relative to its own size, see `compared.sizes_of`: the four of the package, then
    further criteria (see `compared.Criterion`), which add rows to all (4, n) arrays.

    Friction along a thread leaves the ends of elements no more accurate than the rest. Where it bends back inside an
    element, n and m have second derivatives that jump, and no gain is assumed for them.

    Args:
        smooth: of scenes with walls: False where an edge of contact or of slip lies inside elements. No gain is assumed
            then, and the error is taken to be twice the difference, since two meshes may err in the same direction.
            Otherwise a quarter of the gain, since the edges are found to some accuracy alone.

    Returns:
        (4, n) the relative differences, which are `before` in the next halving; and (4, n) the assumed gains.
    """
    p = fine.degree
    _, difference, at_ends, shared = _differences(fine, coarse)
    relative = shared / fine._reference.sizes
    part = np.where(relative < ASYMPTOTIC, 1 / SAFETY_BELOW, 1 / SAFETY)
    slides = any(action.rough for action in fine.scene.actions)
    if before is None:
        ahead, far = difference > AHEAD * at_ends, difference > FAR_AHEAD * at_ends
        if slides:
            ahead |= relative < ASYMPTOTIC
        # n is constant where no loads act along rods, so that the ends cause all of its error
        far[FORCE] |= far[:FORCE].all(axis=0) & (difference[FORCE] <= OF_ENDS * at_ends[FORCE])
        sure = (far | (relative == 0))[: len(NAMES)].all(axis=0) & equal_elements(fine.layout)
        part = np.where(sure, part, 1 / SAFETY)
        if min(coarse.layout.counts) == 1:  # rotations gain less in the first halving
            part[ROTATION] = 1 / SAFETY
        uniform = all(rod.uniform for rod in fine.scene.rods)
        gain = np.where(far & uniform, part * 2.0 ** (p + 1), np.where(ahead, max(1.0, 2.0 ** (p - 3)), 1.0))
    else:
        seen = before / np.maximum(relative, 1e-300)
        gain = np.clip(part * (seen - 1), 1, part * 2.0 ** (p + 1))
    if fine.scene.has_walls:
        gain = np.maximum(gain / _NEARLY, 1.0) if smooth else np.full_like(gain, 1 / _ROUGH)
    if slides and (bends := Threads(fine).bend_back()).any():
        gain[:FORCE, bends] = np.maximum(gain[:FORCE, bends] / _NEARLY, 1.0)
        gain[FORCE:, bends] = 1.0
    gain[relative == 0] = 2.0 ** (p + 1) / SAFETY_BELOW
    fine.set_errors(relative / gain)
    return relative, gain


def equal_elements(layout):
    """Whether the elements of every rod are about as long as each other, but for pieces."""
    first = [cells.start for cells in cells_of(layout)]
    longest, shortest = (bound.reduceat(layout.shares, first) for bound in (np.maximum, np.minimum))
    return bool((longest <= _UNEQUAL * shortest).all())


def error_before(apart, gain):
    """(4, n) the estimated errors of the coarse mesh from the differences and gains of `estimate_error`; infinite where
    nothing confirms that the meshes converge."""
    return np.where(gain > 1, (1 + _CAUTION / gain) * apart, np.inf)


def order_of(gain, p):
    """(4,) orders in h of the errors, from the gains (4, n) of a halving."""
    return np.minimum(np.maximum(np.log2(_LIKELY * gain.min(axis=1)), 1), p + 0.5)


def carry_error(fine, coarse, factor, order, before=None):
    """Set the errors of a path from the errors of the same points on a mesh of elements less than twice as long, by the
    ratio `factor` of their numbers; returns the differences (4, n) relative to the sizes. order: (4,) of the errors in
    h, see `order_of`; before: relative differences of the coarser mesh from the one before, where its elements were
    halved; or None.

    They are the coarser mesh's errors reduced by the assumed orders, limited to one to two times the Richardson
    estimate from the difference of the two meshes (by the observed order minus one), since the coarser mesh's errors
    may be overestimated.
    """
    relative, *_ = _differences(fine, coarse)
    order = order[:, None]
    seen = order
    if before is not None:
        observed = np.log2(np.maximum(before, 1e-300) / np.maximum(relative, 1e-300)) - 1
        seen = np.clip(observed, order, np.maximum(order, fine.degree))
    reduction = factor**-seen
    estimate = relative * reduction / (1 - reduction)
    fine.set_errors(np.clip(coarse.by_mesh * factor**-order, estimate, 2 * estimate))
    return relative


def compare(fine, coarse):
    """(4, n) differences of points on two meshes, relative to the sizes: no error estimate if these are not nested."""
    return _differences(fine, coarse)[0]


def _differences(fine, coarse):
    """(4, n) relative differences, then the results of `compared.differences`."""
    found = differences(fine, coarse)
    return found[0] / fine._reference.sizes, *found


def hardest(path):
    """(Path, indices) of sample points that determine the mesh that a path needs: those with the largest errors (of
    every rod those with the largest leading coefficients of displacements and of rotations, relative to their sizes,
    where errors are unknown), the most displaced one, the last, the smoothest (smallest leading coefficients) where it
    is much smoother, and then one between. All points where these are few or the path has events."""
    if len(path) <= FEW or path.events:  # events have to be located on every mesh
        return path, np.arange(len(path))
    sizes, of_rods = path._reference.sizes, path._roughness
    moved = sizes[POSITION]
    known = path.by_mesh is not None and np.isfinite(path.worst).all()
    indicator = path.by_mesh[path.bounds] if known else (of_rods / sizes[:2, None]).reshape(-1, len(path))
    which = {*np.argmax(indicator, axis=1).tolist(), int(np.argmax(moved)), len(path) - 1}
    seen, rough = np.flatnonzero(moved >= _SEEN * moved.max()), of_rods[0].max(axis=0)
    if rough[seen].min() < _SMOOTHER * rough.max():
        which.add(int(seen[np.argmin(rough[seen])]))
    indicator = np.log(np.maximum(rough, 1e-300))
    known = indicator[list(which)].tolist()
    if max(known) - min(known) > math.log(_APART):
        which.add(int(np.argmin(np.abs(indicator - (min(known) + max(known)) / 2))))
    which = np.array(sorted(which))
    return path.at_points(which), which


def spread_error(path, few, which, coarse=None):
    """Set the errors of a path from the errors of its sample points (few, of the indices `which`) on the same mesh.

    They are interpolated logarithmically over an indicator: the differences from the same points on a coarser mesh (the
    whole path there, or None), or the leading coefficients (of displacements for positions, of rotations for the rest).
    Leading coefficients far from all samples, absolutely or relative to the sizes, increase the error.
    """
    sizes = path._reference.sizes
    if coarse is not None:
        indicator = differences(path, coarse)[0]
    else:
        indicator = path._roughness.max(axis=1)[[POSITION] + [ROTATION] * (len(sizes) - 1)]
    between = np.full(len(sizes), _BETWEEN)
    between[FORCE] = _BETWEEN_FORCES
    found, work, samples = np.empty(sizes.shape), np.empty((3, len(which))), which.astype(np.int32)
    given = indicator, sizes, few.by_mesh, between, coarse is not None
    path._mesh.call("spread_errors", *found.shape, len(which), samples, *given, work, found)
    least = _as_positions(found * sizes, few.by_mesh * sizes[:, which], which) / sizes[ROTATION]
    found[ROTATION] = np.maximum(found[ROTATION], least)
    found[:, which] = few.by_mesh
    path.set_errors(found)


def _as_positions(found, known, which):
    """(n,) lower bounds of errors of rotations by those of positions: differences vanish where signs change."""
    usable = (known[[POSITION, ROTATION]] > ROUNDING).all(axis=0)
    if not usable.any():
        return np.zeros(found.shape[1])
    ratios = np.log(known[ROTATION, usable] / known[POSITION, usable])
    return found[POSITION] * np.exp(np.interp(np.arange(found.shape[1]), which[usable], ratios))


def leading_of(path):
    """(2, rods, points) the largest leading coefficient of an element's displacement, and twice that of q."""
    first = [cells.start for cells in cells_of(path.layout)]
    found = np.maximum.reduceat(leading_coefficients(path), first, axis=2).swapaxes(1, 2)
    found[1] *= 2
    return found


def leading_coefficients(path):
    """(2, points, elements) sizes of the leading coefficients of displacements and of q in all elements."""
    found, mesh = np.empty((2, len(path), sum(path.elements))), path._mesh
    mesh.call("find_leading", mesh.c, len(path), path._motion, found)
    return found


def expected_differences(path):
    """(elements,) how far the positions and the moments of a path will differ from those on a finer mesh, relative, the
    largest of all points; about, by the leading coefficients of rotations and without loads along rods.

    A rotation that turns by the leading coefficient a moves the points of an element of length h by a h times a number
    of the polynomials, between the nodes; the contact force n times that is what moments are off by.
    """
    x, nodes = np.linspace(-1, 1, 101)[:, None], 2 * path.rule.nodes - 1
    between = np.abs(np.prod(x - nodes, axis=1)).max() / (2 * len(nodes))
    turned = 2 * leading_coefficients(path)[1]
    off = between * turned * path.layout.sizes(path.scene) / path.scales.length
    force = np.linalg.norm(path._stacked("gauss_fields")[..., :3], axis=3).max(axis=2)
    sizes = path._reference.sizes[..., None]
    return np.maximum(off / sizes[POSITION], force * off / sizes[MOMENT]).max(axis=0)


def on_mesh(path, layout):
    """The points of a path interpolated to another mesh, as initial guesses: (r, q) at the nodes (points, N, 7) and n
    at the Gauss points (points, elements, Gauss points per element, 3), dimensionless, inertial."""
    rule, n = path.rule, path._stacked("gauss_fields")[..., :3]
    (nodes, at_nodes), (cells, at_gauss) = transferred(path.layout, layout, rule)
    rq = (at_nodes[:, None] @ path._motion[:, nodes])[:, :, 0]
    rq[..., :3] += resting(path.scene, layout, rule) / path.scales.length
    rq[..., 3:] /= np.linalg.norm(rq[..., 3:], axis=2, keepdims=True)
    forces = (at_gauss[:, None] @ n[:, cells])[:, :, 0]
    return rq, forces.reshape(len(n), -1, len(rule.gauss), 3)


#: Largest length of an element next to a support, load or kink, over the length of the boundary layer there.
LONGEST_IN_LAYER = 4.0
# Largest number of nodes in contact that pressure is extrapolated from.
_EXTRAPOLATED = 4


def layer_lengths(scene, scales, layout, rule, n):
    """For every rod (elements,), over its length, the lengths sqrt(EI/|n|) of the boundary layers in which bending
    decays next to a support or a load; None where all elements are shorter. n: (states, elements, points, 3) at the
    Gauss points, dimensionless (by the scales), all rods one after another."""
    force = np.sqrt(3) * np.abs(n).max(initial=0.0) * scales.force
    softest = np.repeat(scene.extremes[0].J[:, :2].min(axis=1), layout.counts)
    if (force * (layout.sizes(scene) / LONGEST_IN_LAYER) ** 2 <= softest).all():
        return None
    largest = np.maximum(np.sqrt(np.square(n).sum(axis=3).max(axis=(0, 2))) * scales.force, 1e-300)
    lengths = []
    for rod, x, cells in zip(scene.rods, layout.inside(rule.gauss), cells_of(layout), strict=True):
        bending = rod.stiffness_at(x.ravel() * rod.length).J[:, :2].min(axis=1).reshape(x.shape).min(axis=1)
        lengths.append(np.sqrt(bending / largest[cells]) / rod.length)
    return lengths


def of_path(path):
    """`layer_lengths` of the largest contact forces over all points of a path."""
    n = path._stacked("gauss_fields")[..., :3]
    return layer_lengths(path.scene, path.scales, path.layout, path.rule, n)


def winding_lengths(path):
    """For every rod (elements,), over its length, the lengths 1/k for the wave numbers k with which rods under moments
    buckle, as in cos(k s), of the largest moments over all points of a path.

    Under a torque T that is k = T/EI (Greenhill 1883), under a moment M about the stiff axis k^2 = (M^2/EI GJ) (1 -
    EI/EI_max) (1 - GJ/EI_max), with the smaller EI (Michell 1899, Prandtl 1899).
    """
    fields, scale = path._stacked("gauss_fields"), path.scales.moment
    m, d3 = fields[..., 3:6], fields[..., 6:] / np.linalg.norm(fields[..., 6:], axis=-1, keepdims=True)
    torque = np.einsum("...i,...i", m, d3)
    bending = np.linalg.norm(m - torque[..., None] * d3, axis=-1)
    torque, bending = (scale * np.abs(x).max(axis=(0, 2)) for x in (torque, bending))
    counts, least = path.layout.counts, path.scene.extremes[0].J
    soft, stiff, torsional = least[:, :2].min(axis=1), least[:, :2].max(axis=1), least[:, 2]
    tilting = np.maximum(0.0, (1 - soft / stiff) * (1 - torsional / stiff)) / (soft * torsional)
    soft, tilting, length = np.repeat([soft, tilting, path.scene.lengths], counts, axis=1)
    k = np.maximum(torque / soft, np.sqrt(tilting) * bending)
    return np.split(1 / np.maximum(k * length, 1e-300), np.cumsum(counts)[:-1])


def turns_of(path, most):
    """For every rod (elements,): the largest angle, rad, by which the moments at the Gauss points turn sections along
    an element, relative to the rest state, at any point of a path; None where none is larger than `most`."""
    m = path._stacked("gauss_fields")[..., 3:6] * path.scales.moment
    scene, layout = path.scene, path.layout
    steepest = (layout.sizes(scene) / np.repeat(scene.extremes[0].J.min(axis=1), layout.counts)).max()
    if np.sqrt(3) * np.abs(m).max(initial=0.0) * steepest <= most:
        return None
    found = []
    for rod, x, cells, breaks in zip(
        scene.rods, layout.inside(path.rule.gauss), cells_of(layout), layout.breaks, strict=True
    ):
        J, of_rod = rod.profile.range[0].J, m[:, cells]
        if rod.profile.coupled:  # J is about principal axes
            J = J.min()
        else:  # in the directors: a section may be far stiffer in bending than in torsion
            q = path.motion(rod, x.ravel())[..., 3:].reshape(-1, 4)
            frames = directors(q).reshape(len(of_rod), *x.shape, 3, 3) @ rod.curve.frame(x * rod.length)
            of_rod = np.einsum("...ij,...i", frames, of_rod)
        turned = (np.linalg.norm(of_rod / J, axis=3) @ path.rule.weights).max(axis=0)
        found.append(turned * np.diff(breaks) * rod.length)
    return found if max(turns.max() for turns in found) > most else None


def contact_edges(path):
    """For every rod the places where contact with a wall begins or ends, over its length, ascending, at all points of a
    path; None where the scene has no walls. The pressure is extrapolated from the last nodes in contact."""
    if not path.scene.has_walls:
        return None
    pressures = np.linalg.norm(path._stacked("densities")[1][..., :3], axis=3)
    found = []
    for i, x in enumerate(path.layout.node_s(path.rule.nodes)):
        of_rod = pressures[:, path._cells(i)]
        nodal = np.concatenate([of_rod[:, :, :-1].reshape(len(path), -1), of_rod[:, -1:, -1]], axis=1)
        edges = []
        for p in nodal:
            touching = p > 0
            for k in np.flatnonzero(touching[1:] != touching[:-1]).tolist():
                last, step = (k, -1) if touching[k] else (k + 1, 1)
                edges.append(_vanishes(x, p, last, step, x[last - step]))
        found.append(np.unique(edges))
    return found


def _vanishes(x, p, last, step, beyond):
    """Where a pressure p at nodes x vanishes between x[last] and `beyond`, from the nodes in contact, `step` apart."""
    nodes = [last]
    while len(nodes) < _EXTRAPOLATED and 0 <= nodes[-1] + step < len(x) and p[nodes[-1] + step] > 0:
        nodes.append(nodes[-1] + step)
    unit = beyond - x[last]
    places = (x[nodes] - x[last]) / unit  # 0 at the last node in contact, 1 beyond
    fitted = np.polynomial.Polynomial.fit(places, p[nodes], len(nodes) - 1, domain=[-1, 1], window=[-1, 1])
    roots = [z.real for z in fitted.roots() if abs(z.imag) < 1e-9 and 0 <= z.real <= 1] if len(nodes) > 1 else []
    return x[last] + unit * (min(roots) if roots else 0.5)


def unresolved(scene, layout, lengths):
    """Whether elements at the ends of pieces (see `rodmesh`) are too long for boundary layers there."""
    for breaks, pieces, layers in zip(layout.breaks, layout.pieces(scene), lengths, strict=True):
        sizes = np.diff(breaks)
        at_ends = np.unique([k for piece in pieces for k in (piece.start, piece.stop - 1)])
        if (sizes[at_ends] > LONGEST_IN_LAYER * layers[at_ends]).any():
            return True
    return False


def resolves(layout, lengths):
    """Whether all elements are short enough for the boundary layers in them; `lengths` as `layer_lengths` returns."""
    return lengths is None or bool((layout.shares <= LONGEST_IN_LAYER * np.concatenate(lengths)).all())


def element_differences(fine, coarse):
    """For every rod (elements of the coarse mesh,) the contribution of each element to the difference of the positions
    of two Paths with the same points: maximum over all points, relative to the largest displacement of each. Every
    element of `fine` lies within one of `coarse`.

    It is the largest difference of three quantities: positions within the element, relative to the line between its
    ends; the relative displacement of its ends; their relative rotation times a lever arm, the length over which the
    rest of the rod follows this rotation: the rod's length, or sqrt(EI/|n|) under tension.
    """
    sizes = fine._reference.sizes[POSITION]
    n = coarse._stacked("gauss_fields")[..., :3]
    forces = np.sqrt(np.square(n).sum(axis=3).max(axis=2))
    found, p, scales = [], fine.degree, fine.scales
    of_rods = zip(fine.scene.rods, coarse.layout.node_s(coarse.rule.nodes), cells_of(coarse.layout), strict=True)
    for rod, nodes, cells in of_rods:
        x = halfway(nodes)
        moved = [path.motion(rod, x) for path in (coarse, fine)]
        inside = 2 * p * np.arange(cells.stop - cells.start)[:, None] + np.arange(2 * p + 1)
        off = (moved[0] - moved[1])[:, inside, :3]
        along = halfway(coarse.rule.nodes)[:, None]
        off -= off[:, :, :1] * (1 - along) + off[:, :, -1:] * along
        ends = x[:: 2 * p]
        rest = rod.curve.position(ends * rod.length) / scales.length
        deformed = [_deformation(m[:, :: 2 * p], rest) for m in moved]
        past, turned = (np.linalg.norm(a - b, axis=2) for a, b in zip(*deformed, strict=True))
        bending = rod.profile.range[1].J[:2].max() / (scales.moment * scales.length)
        lever = 1 / np.sqrt((scales.length / rod.length) ** 2 + forces[:, cells] / bending)
        differences = np.maximum(np.linalg.norm(off, axis=3).max(axis=2), np.maximum(past, lever * turned))
        found.append((differences / sizes[:, None]).max(axis=0))
    return found


def _deformation(motion, rest):
    """Relative displacements of the two ends of elements, in the mean frame of both ends, and twice the vector parts of
    the quaternions of their relative rotations, (points, elements, 3) each; motion: (points, ends, 7) displacements and
    unit quaternions; rest: (ends, 3) reference positions."""
    q = motion[:, :, 3:]
    half_way = (q[:, :-1] + q[:, 1:]).reshape(-1, 4)
    frames = directors(half_way / np.linalg.norm(half_way, axis=1, keepdims=True)).reshape(len(q), -1, 3, 3)
    past = np.einsum("kcij,kci->kcj", frames, np.diff(motion[:, :, :3] + rest, axis=1))
    return past, 2 * conjugate_product(q[:, :-1], q[:, 1:])
