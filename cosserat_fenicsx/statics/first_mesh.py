"""The first mesh of the automatic refinement, and what every mesh has to resolve."""

import math

import numpy as np

from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.traits import traits_of
from cosserat_fenicsx.remember import per_scene
from cosserat_fenicsx.scene.along import FUNCTIONS_ALONG
from cosserat_fenicsx.scene.curves import Line

#: Elements per rod of the first mesh, where the mesh is not given.
FIRST_ELEMENTS = 4
# Where sections or loads are functions of s: the relative accuracy with which the first mesh must integrate the
# flexibilities 1/EI and the loads, and the rod's length over the longest step of the quadrature that it is compared
# with, and over the shortest element.
_INTEGRATED, _SAMPLED, _SHORTEST = 1e-3, 256, 1024
# Angle, rad, by which an element of the first mesh may turn, where rods turn by more than the second; most elements of
# a rod that are made for that.
_TURNS, _MANY_TURNS, _MOST_FOR_TURNS = 2.5, 6.3, 512
# Elements are halved where their quadrature error exceeds this share of the largest one.
_LARGE = 0.1
# Smallest mean ratio of chord to arc over a quarter of an element, or over an element where the mesh is coarser than
# usual: that of a circular arc of one radian.
_STRAIGHT = 0.958
# Wave number of the displacement of a straight rod that bends by about a radian, over its length; most elements of the
# first mesh per unit of it.
_BENDING, _MOST = 4.0, 3
# Places at which the direction of a rod's axis is compared.
_SAMPLES = 257
# Error of a mesh that is estimated by its difference from another one over the true error, about; and the part of the
# gain in accuracy of a halving that is assumed for the error of the finer mesh.
_ESTIMATED, _GAINED = 1.5, 0.25


def meshes_for(scene, degree, tol, many):
    """The first mesh for a tolerance; and, where it is coarser than usual, the usual one, else None.

    Args:
        many: whether the path has so many points that those on the first mesh should suffice; else these are all
            computed on one of elements half as long too.
    """
    usual = first_layout(scene, degree)
    if not 1 <= degree <= 4 or not all(rod.uniform for rod in scene.rods) or not _acts_evenly(scene):
        return usual, None
    wanted = (tol if many else _GAINED * 2 ** (degree + 1) * tol) / _ESTIMATED
    waves = _BENDING + _turning(scene)
    # the best polynomial for a wave is off by (waves/2n)^(p + 1)/((p + 1)! 2^p) of its amplitude, that by 1/waves
    elements = waves / 2 * (wanted * waves * math.factorial(degree + 1) * 2**degree) ** (-1 / (degree + 1))
    layout = first_layout(scene, degree, math.ceil(min(max(elements, 1), _MOST * waves)))
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
        turn = turn if turn > _MANY_TURNS else 0.0
        wanted.append(np.maximum(1.0, np.minimum(turn / _TURNS * np.diff(breaks), _MOST_FOR_TURNS / len(breaks))))
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
    tangents = (rod.curve.frame(np.linspace(0, rod.length, _SAMPLES))[:, :, 2] for rod in scene.rods)
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
             for value in vars(action).values() if isinstance(value, FUNCTIONS_ALONG)]  # fmt: skip
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
    long_enough = np.diff(breaks) > 1.01 / _SHORTEST
    ends = (breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(parts) / parts).ravel()
    chords = np.diff(rod.curve.position(np.append(ends, 1.0) * rod.length), axis=0)
    if np.linalg.norm(chords, axis=1).sum() < _STRAIGHT * rod.length:
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
    fine = integrals(np.maximum(8, np.ceil(_SAMPLED * np.diff(breaks) - 1e-9).astype(int)))
    # of whole elements and of parts: one of these may agree by chance
    error = np.max([np.abs(integrals(parts * whole) - fine) for parts in (1, 2, 3)], axis=0)
    if (error.sum(axis=0) <= _INTEGRATED * np.abs(fine).sum(axis=0).max()).all():
        return np.zeros(len(whole), dtype=bool)
    error = error.max(axis=1)
    return error > _LARGE * error.max()
