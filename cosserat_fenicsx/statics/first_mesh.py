"""The first mesh of the automatic refinement."""

import math

import numpy as np

from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.traits import traits_of
from cosserat_fenicsx.remember import per_scene
from cosserat_fenicsx.scene.curves import Line

#: Elements per rod of the first mesh, where the mesh is not given.
FIRST_ELEMENTS = 4
# Where a section is a function of s: the rod's length over the shortest element of the first mesh, and the relative
# accuracy with which that mesh must integrate the flexibilities 1/EI.
_FINEST_FIRST, _FLEXIBILITY_TOLERANCE = 256, 1e-3
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
    """The first mesh of so many elements per rod or more.

    It resolves the curvature of the axis and a section that is a function of s, a local change of which then cannot be
    missed by the quadrature points. Where a section changes in a part of a rod, elements are short only there.
    """
    layout, parts = Layout.of(scene, elements), 4 if elements >= FIRST_ELEMENTS else 1
    while True:
        too_long = [
            _too_long(rod, breaks, degree, parts) for rod, breaks in zip(scene.rods, layout.breaks, strict=True)
        ]
        if not any(marked.any() for marked in too_long):
            return layout
        layout = layout.resized(scene, [np.where(marked, 2.0, 1.0) for marked in too_long])


def _too_long(rod, breaks, degree, parts):
    """(elements,) of bool: the elements to be halved.

    All of them until so many equal parts of them are almost straight. Then, where the section changes along the rod or
    twists about a curved axis, those in which the Gauss points do not integrate the flexibilities 1/EI, compared with a
    fine quadrature.
    """
    none = np.zeros(len(breaks) - 1, dtype=bool)
    long_enough = np.diff(breaks) > 1.01 / _FINEST_FIRST
    ends = (breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(parts) / parts).ravel()
    chords = np.diff(rod.curve.position(np.append(ends, 1.0) * rod.length), axis=0)
    if np.linalg.norm(chords, axis=1).sum() < _STRAIGHT * rod.length:
        return long_enough
    low, high = rod.profile.range
    twisted = not isinstance(rod.curve, Line) and (low.J[0] != high.J[1] or rod.profile.coupled)
    if rod.profile.uniform and not twisted:
        return none
    x, weights = np.polynomial.legendre.leggauss(degree)

    def integrals(starts, sizes):
        s = starts[:, None] + sizes[:, None] * (x + 1) / 2
        flexible = rod.stiffness_at(s.ravel() * rod.length).flexibility
        if twisted:  # as tensors of inertial components
            across = rod.curve.frame(s.ravel() * rod.length)[:, :, :2]
            flexible = np.einsum("kai,kij,kbj->kab", across, flexible, across)
        return np.einsum("g,cgi,c->ci", weights / 2, flexible.reshape(*s.shape, -1), sizes)

    counts = np.maximum(8, np.ceil(_FINEST_FIRST * np.diff(breaks) - 1e-9).astype(int))
    owner = np.repeat(np.arange(len(counts)), counts)
    sizes = (np.diff(breaks) / counts)[owner]
    inner = np.arange(len(owner)) - np.concatenate([[0], np.cumsum(counts)])[owner]
    parts = integrals(breaks[owner] + inner * sizes, sizes)
    fine = np.zeros((len(counts), parts.shape[1]))
    np.add.at(fine, owner, parts)
    error = np.abs(integrals(breaks[:-1], np.diff(breaks)) - fine)
    if (error.sum(axis=0) <= _FLEXIBILITY_TOLERANCE * np.abs(fine).sum(axis=0).max()).all():
        return none
    error = error.max(axis=1)
    return long_enough & (error > _LARGE * error.max())
