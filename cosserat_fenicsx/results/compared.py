"""Quantities with error estimates, the sizes that errors are relative to, and the differences of two meshes."""

import itertools
from collections import namedtuple
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.numerics import once_each
from cosserat_fenicsx.parts import per_scene


def in_turn(sizes):
    """Slices of parts of these sizes, one after another."""
    return tuple(itertools.starmap(slice, itertools.pairwise(np.cumsum([0, *sizes]).tolist())))


@lru_cache(maxsize=32)
def cells_of(layout):
    """For every rod the slice of its elements, numbered over all rods."""
    return in_turn(layout.counts)


@lru_cache(maxsize=32)
def cell_nodes(layout, degree):
    """For every rod (elements, degree + 1) the nodes of its elements, and their slice, numbered over all rods."""
    rows, nodes = in_turn(degree * count + 1 for count in layout.counts), all_cell_nodes(layout, degree)
    return [(nodes[cells], x) for cells, x in zip(cells_of(layout), rows, strict=True)]


@lru_cache(maxsize=32)
def all_cell_nodes(layout, degree):
    """(elements, degree + 1) the nodes of the elements of all rods one after another."""
    rods = np.repeat(np.arange(len(layout.counts)), layout.counts)
    return (degree * np.arange(len(rods)) + rods)[:, None] + np.arange(degree + 1)


@lru_cache(maxsize=256)
def located(layout, rule, i, x):
    """The element of the i-th rod and the basis functions (degree + 1,) of an `ElementRule` at x in [0, 1]."""
    cells, basis = rule.locate_all(layout.breaks[i], np.array([x]))
    return int(cells[0]), basis[0]


class Compared(NamedTuple):
    """Where two meshes are compared: at the nodes of every element of the coarse one and half way between them.

    inside: (places per element, nodes per element) weights of a coarse element's nodes, the same in all elements;
    cells (places,), weights (places, nodes per element): of the fine elements, on the same side of a jump.
    """

    inside: np.ndarray
    cells: np.ndarray
    weights: np.ndarray


# Distance from the end of an element, over its length, at which a place surely belongs to it.
_INWARDS = 1e-6


@lru_cache(maxsize=16)
def compared(coarse, fine, rule):
    """`Compared` for two `Layout`s with elements of the same `ElementRule`."""
    local = halfway(rule.nodes)
    near = np.clip(local, _INWARDS, 1 - _INWARDS)
    found, xs, sures = [], coarse.inside(local), coarse.inside(near)

    def of_pair(i):
        breaks = fine.breaks[i]
        cells, _ = rule.locate_all(breaks, sures[i].ravel())
        of_cells = (xs[i].ravel() - breaks[cells]) / np.diff(breaks)[cells]
        return cells, rule.basis(np.clip(of_cells, 0.0, 1.0))

    for (cells, weights), of_rod in zip(_by_pair(of_pair, coarse, fine), cells_of(fine), strict=True):
        found.append((of_rod.start + cells, weights))
    return Compared(rule.basis(local), *map(np.concatenate, zip(*found, strict=True)))


@lru_cache(maxsize=16)
def transferred(coarse, fine, rule):
    """Interpolation of a state on another mesh: of all its nodes the nodes around them on the coarse mesh with their
    weights, and of all its Gauss points the coarse elements with the weights of their Gauss points."""
    at_nodes, at_gauss = [], []
    xs, insides, of_rods = fine.node_s(rule.nodes), fine.inside(rule.gauss), cell_nodes(coarse, len(rule.nodes) - 1)

    def of_pair(i):
        breaks = coarse.breaks[i]
        return rule.locate_all(breaks, xs[i]), rule.locate_all(breaks, insides[i].ravel(), rule.between_gauss)

    for i, ((cells, weights), (of_gauss, at)) in enumerate(_by_pair(of_pair, coarse, fine)):
        at_nodes.append((of_rods[i][0][cells], weights))
        at_gauss.append((cells_of(coarse)[i].start + of_gauss, at))
    return [tuple(map(np.concatenate, zip(*found, strict=True))) for found in (at_nodes, at_gauss)]


def _by_pair(of_pair, coarse, fine):
    """`of_pair(i)` for every rod, found once for rods whose elements end at the same shares of the length."""
    return once_each([(a.tobytes(), b.tobytes()) for a, b in zip(coarse.breaks, fine.breaks, strict=True)], of_pair)


def halfway(places):
    """Coordinates in ascending order with the midpoints of their intervals."""
    return np.sort(np.concatenate([places, (places[:-1] + places[1:]) / 2]))


class Criterion:
    """A quantity at the points of a path whose error, relative to its size, `tol` may bound.

    The criteria of the package compare fields anywhere along the rods, see `differences`; a subclass compares its
    `values`. From its definition on its `name` may be used in `bound` of `solve` and of scene files, and appears in
    `Path.errors`, tables and stored paths.

    Attributes:
        name: a Python name.
        words: the quantity in words, in the plural, such as "strain energies".
    """

    name = words = ""

    def __init_subclass__(cls, **options):
        super().__init_subclass__(**options)
        if not cls.name.isidentifier():
            raise TypeError(f"class {cls.__name__}: name = {cls.name!r}: expected a Python name")
        CRITERIA[cls.name] = cls

    def values(self, path):
        """(n,) or (n, k) numbers at the points of a path, by its queries; NaN of a stored criterion that is unknown."""
        return np.full(len(path), np.nan)

    def sizes(self, path):
        """(n,) what the errors are relative to, in the unit of the values: these themselves, but at least 1e-6 of the
        largest of the path."""
        sizes = _norms(self.values(path))
        return np.maximum(sizes, _AT_REST * sizes.max(initial=0.0))


#: The criteria by name; a subclass of `Criterion` enters itself.
CRITERIA = {}


class Position(Criterion):
    """Positions, over the largest displacement."""

    name, words = "position", "positions"


class Rotation(Criterion):
    """Rotations, over the largest one."""

    name, words = "rotation", "rotations"


class Force(Criterion):
    """Contact forces n, over the largest one."""

    name, words = "force", "forces"


class Moment(Criterion):
    """Contact moments m, over the largest one."""

    name, words = "moment", "moments"


#: Errors that are always estimated.
Errors = namedtuple("Errors", "position rotation force moment")
NAMES = Errors._fields
POSITION, ROTATION, FORCE, MOMENT = 0, 1, 2, 3


def criteria_of(bound):
    """(names of the criteria that `tol` bounds, the further `Criterion`s beyond those of the package), from names, or
    classes or objects of criteria; else a SceneError."""
    if isinstance(bound, str) or not isinstance(bound, Sequence) or not bound:
        raise SceneError(f"bound = {bound!r}: expected a list of some of {', '.join(map(repr, CRITERIA))}")
    found = {}
    for given in bound:
        if isinstance(given, str) and given not in CRITERIA:
            raise SceneError(f"bound: {given!r}: {nearest(given, CRITERIA)}")
        criterion = CRITERIA[given] if isinstance(given, str) else given
        criterion = criterion() if isinstance(criterion, type) else criterion
        if not isinstance(criterion, Criterion):
            raise SceneError(f"bound: {given!r}: expected a name or a Criterion")
        found[criterion.name] = criterion
    return tuple(found), tuple(criterion for name, criterion in found.items() if name not in NAMES)


def stored_criteria(names):
    """The `Criterion`s of a stored path by their names; of those that are unknown the names remain."""
    found = tuple(CRITERIA.get(name, Criterion)() for name in names)
    for name, criterion in zip(names, found, strict=True):
        criterion.name = name
    return found


def words_of(name):
    """A description of the quantity that a criterion compares."""
    return (name in CRITERIA and CRITERIA[name].words) or name


def _norms(values):
    return np.linalg.norm(np.reshape(values, (len(values), -1)), axis=1)


# Differences up to this are rounding alone; and the least size over the largest of the path: see algebra/compared.c.
ROUNDING, _AT_REST = 1e-14, 1e-6
# Rounding of n over the stiffness times the rounding of one difference of positions.
OF_FORCE = 4.0
_EPS = np.finfo(float).eps

#: sizes: (4, points) that the errors are relative to, dimensionless; turning: (points,) whether the size of positions
#: is a rotation times the radius of gyration; rounding: (4, points) errors by rounding alone, dimensionless; still:
#: (2, points) whether displacement and rotation vanish; largest: of all points the contact force, the moment and its
#: mean over an element, dimensionless.
Sizes = namedtuple("Sizes", "sizes turning rounding still largest")


@per_scene
def mesh_of(scene, scales, layout, rule, by_statics):
    """What C knows of the mesh of a result, as a `Mesh`; noise: (4, 1) see `Sizes.rounding`."""
    from cosserat_fenicsx.algebra.building import Mesh  # late: dolfinx is slow to import

    gyrations, length, noise = of_sections(scene, scales, layout, len(rule.nodes) - 1, by_statics)
    sizes = layout.sizes(scene) / scales.length
    mesh = Mesh(layout.counts, rule, sizes=sizes, gyrations=gyrations, limits=noise[2:, 0])
    mesh.c.length, mesh.noise = length, noise
    return mesh


@per_scene
def comparison_of(scene, scales, coarse, fine, rule, by_statics):
    """The `comparison` of chain.h of the meshes of two results, as `mesh_of`."""
    from cosserat_fenicsx.algebra.building import Pointers

    kept = Pointers()
    c = kept.c = kept._ffi.new("comparison *")
    kept.meshes = [mesh_of(scene, scales, layout, rule, by_statics) for layout in (coarse, fine)]
    c.coarse, c.fine = (mesh.c for mesh in kept.meshes)
    of_places(kept, c, compared(coarse, fine, rule))
    return kept


def of_places(kept, c, places):
    """Tell C's `comparison` of the places, a `Compared`; kept: the `Pointers`."""
    c.places, c.cells = len(places.inside), kept.integers(places.cells)
    c.inside, c.weights = (kept.doubles(np.ascontiguousarray(x)) for x in (places.inside, places.weights))


def sizes_of(path):
    """`Sizes` of the points of a path.

    positions: the largest displacement; where sections mainly rotate, their rotation times the radius of gyration.
    rotations: the largest rotation, in rad (2 sin of half of it), at least the displacement over the longest length.
    Both at least 1e-6 of the largest of the whole path.
    n: the largest |n|, at least the largest |m| over the longest length. m: the largest |m|, at least 1e-9 of |n| times
    that length; |n| times that length where m is rounding alone on the whole path. Where actions change the strains
    without stress, m is at least the moment, and n 1e-9 of the force, that would hold the rods as in the reference.
    """
    mesh, count, held = path._mesh, len(path), None
    if path.scene.acts_in_law:

        def without(rod, s):
            return path._without_stress(range(len(path)), rod, s)

        held = held_by_law(path.scene, path.layout, path.rule, path.scales, without, count)
    sizes, largest = np.empty((len(NAMES), count)), np.empty(3)
    turning, still = np.empty(count, np.int32), np.empty((2, count), np.int32)
    given = path._motion, path._stacked("gauss_fields"), held
    mesh.call("measure", mesh.c, count, *given, sizes, turning, still, largest)
    noise = np.repeat(mesh.noise, count, axis=1)
    for criterion in path.criteria:
        own = np.maximum(criterion.sizes(path), 1e-300)
        sizes, noise = np.vstack([sizes, own]), np.vstack([noise, np.zeros(count)])
    return Sizes(sizes, turning, noise, still, largest)


def held_by_law(scene, layout, rule, scales, without, count):
    """(2, count) the largest force and moment, dimensionless, that would hold sections to their strains in the
    reference in `count` states; without infinite stiffnesses. without: function of a rod and arc lengths s (n,), m:
    what `action.without_stress` adds in every state, curvature and strain (count, 2, n, 3)."""
    sizes = np.zeros((2, count))
    for rod, x in zip(scene.rods, layout.node_s(rule.nodes), strict=True):
        along = rod.stiffness_at(x * rod.length)
        for k, strains in enumerate(without(rod, x * rod.length)):
            held = [np.linalg.norm(a, axis=1).max() for a in along.contact(strains[1], strains[0])]
            sizes[:, k] = np.maximum(sizes[:, k], np.array(held) / (scales.force, scales.moment))
    return sizes


def of_sections(scene, scales, layout, p, by_statics):
    """The radii of gyration of the rods, the longest length, and errors by rounding, (4, 1), of n and m."""
    (least, _), (K, J) = ((x.K / scales.force, x.J / (scales.force * scales.length**2)) for x in scene.extremes)
    gyrations, noise = rounding_of(least, K, J, shortest_of(scene, scales, layout), p, by_statics)
    return gyrations, scene.lengths.max() / scales.length, np.pad(noise[:, None], ((2, 0), (0, 0)))


def shortest_of(scene, scales, layout):
    """(rods,) the shortest element of every rod, dimensionless."""
    first = [cells.start for cells in cells_of(layout)]
    return np.minimum.reduceat(layout.sizes(scene), first) / scales.length


def rounding_of(least, K, J, shortest, p, by_statics):
    """Radii of gyration (.., rods), and errors of n and of m by rounding (2, ..), dimensionless, from the least K, and
    the largest K, J (.., rods, 3); shortest: elements (rods,). n is a stiffness times differences of positions over the
    spacing of the nodes, unless it follows from statics; m likewise of rotations, with a share of the moment of n over
    the spacing of the nodes."""
    stiffness = np.ones(K.shape[:-1]) if by_statics else np.where(np.isfinite(K), K, 0.0).max(axis=-1)
    gyrations = np.sqrt(J[..., :2].max(axis=-1) / least[..., 2])
    of_force, of_moment = OF_FORCE * stiffness * p * p / shortest, p / shortest + stiffness * p / 2
    return gyrations, _EPS * np.stack([of_force.max(axis=-1), of_moment.max(axis=-1)])


def differences(fine, coarse):
    """How far two meshes differ at the same points of a path.

    They are compared at the nodes of the coarse mesh and half way between them; n and m as queries find them, on both
    sides of a jump.

    Returns:
        Over all places; over the ends of elements of the coarse mesh alone; and over all places, but those inside the
        elements of rods with r > 2 times as many elements on the fine mesh multiplied by (2/r)^p, the share of their
        errors there that halved elements would have: (4, points), dimensionless, rotations in rad; then further
        criteria, in all. Differences within rounding are 0.
    """
    sizes, found = fine._reference, np.empty((3, len(NAMES), len(fine)))
    pair = comparison_of(fine.scene, fine.scales, coarse.layout, fine.layout, fine.rule, fine.model == "determinate")
    states = (x for path in (coarse, fine) for x in (path._motion, path._contact))
    pair.call("compare_all", pair.c, len(fine), *states, sizes.turning, sizes.still, found)
    for k, criterion in enumerate(fine.criteria, start=len(NAMES)):
        apart = _norms(criterion.values(fine) - criterion.values(coarse))
        apart[apart <= ROUNDING * sizes.sizes[k].max(initial=0.0)] = 0.0
        found = np.concatenate([found, np.tile(apart, (3, 1, 1))], axis=1)
    return found
