"""The mesh that the search for one that is fine enough begins with."""

import numpy as np

from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.scene.curves import Line

#: Elements per rod of the first mesh, where the mesh is not given.
FIRST_ELEMENTS = 4
# Where a section is a function of s: most elements of the first mesh, and how well it must integrate 1/EI.
_FINEST_FIRST, _SEEN = 256, 1e-3
# Chord over arc of a quarter of an element, on an average: that of an arc of one radian.
_STRAIGHT = 0.958


def first_layout(scene, degree):
    """The first mesh: as fine as the turns of a curve and a section that changes by a function of s ask for, so that nothing
    falls between its points."""
    layout = Layout.of(scene, FIRST_ELEMENTS)
    while max(layout.counts) < _FINEST_FIRST and not all(
        _sees(rod, breaks, degree) for rod, breaks in zip(scene.rods, layout.breaks, strict=True)
    ):
        layout = layout.finer(scene, 2)
    return layout


def _sees(rod, breaks, degree):
    """Whether the quarters of elements are next to straight, and Gauss points on elements integrate the flexibilities 1/EI as
    well as many more points do: of a section that changes, or that turns about the curve."""
    quarters = (breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(4) / 4).ravel()
    chords = np.diff(rod.curve.position(np.append(quarters, 1.0) * rod.length), axis=0)
    if np.linalg.norm(chords, axis=1).sum() < _STRAIGHT * rod.length:
        return False
    low, high = rod.profile.range
    twisted = not isinstance(rod.curve, Line) and low.J[0] != high.J[1]
    if rod.profile.uniform and not twisted:
        return True
    x, weights = np.polynomial.legendre.leggauss(degree)
    finer = max(8, _FINEST_FIRST // (len(breaks) - 1))

    def integrals(ends):
        s = ends[:-1, None] + np.diff(ends)[:, None] * (x + 1) / 2
        flexible = 1 / rod.stiffness_at(s.ravel() * rod.length).J[:, :2]
        if twisted:  # as tensors of inertial components
            across = rod.curve.frame(s.ravel() * rod.length)[:, :, :2]
            flexible = np.einsum("kai,ki,kbi->kab", across, flexible, across)
        return np.einsum("g,cgi,c->ci", weights / 2, flexible.reshape(*s.shape, -1), np.diff(ends))

    steps = np.arange(finer) / finer
    fine_ends = np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * steps).ravel(), 1.0)
    fine = integrals(fine_ends).reshape(len(breaks) - 1, finer, -1).sum(axis=1)
    return bool((np.abs(integrals(breaks) - fine).sum(axis=0) <= _SEEN * np.abs(fine).sum(axis=0).max()).all())
