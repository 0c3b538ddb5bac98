"""What errors of a path are estimated of, what they are relative to, and how far two meshes differ in it."""

from collections import namedtuple
from functools import lru_cache

import numpy as np

from cosserat_fenicsx.remember import per_scene
from cosserat_fenicsx.results.places import cell_nodes, compared

#: Of the quantities that errors are estimated of: positions, rotations, contact forces n and contact moments m.
Errors = namedtuple("Errors", "position rotation force moment")
NAMES = Errors._fields
POSITION, ROTATION, FORCE = 0, 1, 2

# Differences of positions and of rotations up to this are rounding alone, in units of the scales' length and rad.
ROUNDING = 1e-14
# Sizes, in the scales' units, below which a quantity is taken to vanish; and the least moment over n times the length.
_NOTHING, _LEAST_MOMENT = 1e-9, 1e-9
# Least size of positions and of rotations over the largest of the path: unloaded states differ by rounding.
_AT_REST = 1e-6
# Moments up to this multiple of their rounding at all points of a path vanish, as those of straight bars do.
_VANISHING = 10.0
# Rounding of n over that of one difference of positions, times stiffness; differences of n and of m on two meshes up to
# this multiple of their rounding are rounding alone.
_OF_FORCE, _NOISE = 4.0, 2.0
_EPS = np.finfo(float).eps

#: sizes: (4, points) that the errors are relative to, dimensionless; turning: (points,) whether that of positions comes
#: from rotations times the radius of gyration; rounding: (4, points) errors by rounding alone, dimensionless.
Sizes = namedtuple("Sizes", "sizes turning rounding")


def sizes_of(path):
    """`Sizes` of the points of a path.

    positions: the largest displacement; where sections mainly rotate, their rotation times the radius of gyration.
    rotations: the largest rotation, in rad (2 sin of half of it), at least the displacement over the longest length.
    Both at least 1e-6 of those of the whole path.
    n: the largest |n|, at least the largest |m| over the longest length. m: the largest |m|, at least 1e-9 of |n| times
    that length; |n| times that length where m is rounding alone on the whole path.
    """
    gyrations, length = _of_scene(path.scene, path.scales)
    squares = np.add.reduceat(np.square(path._motion), (0, 3, 4), axis=2)
    moved = np.maximum(np.sqrt(squares[..., 0].max(axis=1)), _NOTHING)
    half = np.sqrt(np.maximum.reduceat(squares[..., 2], _first_nodes(path.layout, path.degree), axis=1))
    turned = np.sqrt(8) * (half * gyrations).max(axis=1)  # |R - 1| = sqrt(8) |sin(angle/2)|
    rotation = np.maximum(2 * half.max(axis=1), moved / length)
    squares = np.add.reduceat(np.square(path._stacked("gauss_fields")[..., :6]), (0, 3), axis=3)
    force, moment = np.sqrt(squares.max(axis=(1, 2))).T
    force = np.maximum(np.maximum(force, moment / length), _NOTHING)
    noise = np.array([0.0, 0.0, *_noise(path)])[:, None]
    least = 1.0 if (moment <= _VANISHING * noise[3]).all() else _LEAST_MOMENT
    moment = np.maximum(np.maximum(moment, least * length * force), _NOTHING)
    sizes = np.array([np.maximum(moved, turned), rotation, force, moment])
    sizes[:2] = np.maximum(sizes[:2], _AT_REST * sizes[:2].max(axis=1, initial=0.0)[:, None])
    return Sizes(sizes, turned > moved, np.broadcast_to(noise, sizes.shape))


@lru_cache(maxsize=32)
def _first_nodes(layout, degree):
    """The first node of every rod."""
    return [rows.start for _, rows in cell_nodes(layout, degree)]


@per_scene
def _of_scene(scene, scales):
    """(radii of gyration of the rods, the longest length), dimensionless."""
    return np.array([gyration(rod) for rod in scene.rods]) / scales.length, max(
        rod.length for rod in scene.rods
    ) / scales.length


def _noise(path):
    """Errors of n and of m by rounding, dimensionless.

    n is a stiffness times differences of positions over the spacing of the nodes, unless it follows from statics;
    m is that of rotations, and has a share of the moment of these n over the spacing of the nodes.
    """
    return _rounding(path.scene, path.scales, path.layout, path.degree, path.model == "determinate")


@per_scene
def _rounding(scene, scales, layout, p, by_statics):
    force = moment = 0.0
    for rod, breaks in zip(scene.rods, layout.breaks, strict=True):
        highest = rod.profile.range[1].K
        stiffness = 1.0 if by_statics else highest[np.isfinite(highest)].max(initial=0.0) / scales.force
        shortest = np.diff(breaks).min() * rod.length / scales.length
        force = max(force, _OF_FORCE * stiffness * p * p / shortest)
        moment = max(moment, p / shortest + stiffness * p / 2)
    return _EPS * force, _EPS * moment


def gyration(rod):
    """Largest radius of gyration sqrt(EI/EA) of a rod, m; 0 where EA is infinite."""
    low, high = rod.profile.range
    return float(np.sqrt(high.J[:2].max() / low.K[2]))


def differences(fine, coarse):
    """How far two meshes differ at the same points of a path.

    They are compared at the nodes of the coarse mesh and half way between them; n and m as queries find them, on both
    sides of a jump.

    Returns:
        Over all places, and over the ends of elements of the coarse mesh alone: (4, points), dimensionless, rotations
        in rad. Rounding counts as no difference.
    """
    sizes = fine._reference
    places = compared(coarse.layout, fine.layout, coarse.rule)
    here = np.einsum("xj,kxjc->kxc", places.weights, fine._in_elements[:, places.cells])
    off = np.matmul(places.inside, coarse._in_elements).reshape(here.shape) - here
    squares = np.add.reduceat(np.square(off), (0, 3, 7, 10), axis=2)
    # without the part along q, since interpolated q are no unit quaternions
    squares[..., 1] -= np.square(np.einsum("kxi,kxi->kx", off[..., 3:7], here[..., 3:7]))
    apart = np.sqrt(np.maximum(squares, 0.0))
    apart[..., 1] *= 2
    if sizes.turning.any():
        gyrations, _ = _of_scene(fine.scene, fine.scales)
        for radius, part in zip(gyrations, places.rods, strict=True):
            turned = np.where(sizes.turning[:, None], radius * apart[:, part, 1], 0.0)
            apart[:, part, 0] = np.maximum(apart[:, part, 0], turned)
    everywhere, at_ends = apart.max(axis=1).T, apart[:, places.ends].max(axis=1).T
    everywhere[everywhere <= np.maximum(ROUNDING, _NOISE * sizes.rounding)] = 0.0
    return everywhere, at_ends
