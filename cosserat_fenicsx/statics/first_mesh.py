"""The first mesh of the automatic refinement."""

import numpy as np

from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.remember import per_scene
from cosserat_fenicsx.scene.curves import Line

#: Elements per rod of the first mesh, where the mesh is not given.
FIRST_ELEMENTS = 4
# Where a section is a function of s: the rod's length over the shortest element of the first mesh, and the relative
# accuracy with which that mesh must integrate the flexibilities 1/EI.
_FINEST_FIRST, _FLEXIBILITY_TOLERANCE = 256, 1e-3
# Elements are halved where their quadrature error exceeds this share of the largest one.
_LARGE = 0.1
# Smallest mean ratio of chord to arc over a quarter of an element: that of a circular arc of one radian.
_STRAIGHT = 0.958


@per_scene
def first_layout(scene, degree):
    """The first mesh, fine enough to resolve the curvature of the axis and a section that is a function of s.

    A local change of the section then cannot be missed by the quadrature points. Where a section changes in a part of
    a rod, elements are short only there.
    """
    layout = Layout.of(scene, FIRST_ELEMENTS)
    while True:
        too_long = [_too_long(rod, breaks, degree) for rod, breaks in zip(scene.rods, layout.breaks, strict=True)]
        if not any(marked.any() for marked in too_long):
            return layout
        layout = layout.resized(scene, [np.where(marked, 2.0, 1.0) for marked in too_long])


def _too_long(rod, breaks, degree):
    """(elements,) of bool: the elements to be halved.

    All of them until their quarters are almost straight. Then, where the section changes along the rod or twists about
    a curved axis, those in which the Gauss points do not integrate the flexibilities 1/EI, compared with a fine
    quadrature.
    """
    none = np.zeros(len(breaks) - 1, dtype=bool)
    long_enough = np.diff(breaks) > 1.01 / _FINEST_FIRST
    quarters = (breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(4) / 4).ravel()
    chords = np.diff(rod.curve.position(np.append(quarters, 1.0) * rod.length), axis=0)
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
