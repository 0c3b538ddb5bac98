"""Scenes whose paths have limit points, with independently computed values of these."""

import numpy as np
from scipy.optimize import brentq

import cosserat_fenicsx as cf


def torsion_pendulum(torsion=1.0, offset=1.2):
    """A shaft twisted by a moment and by two opposite dead forces on arms that turn with its end: (rod, scene, load of
    a twist).

    GJ theta/L = eta (offset - sin(theta)): the shaft stays straight, the twist grows without bound, and the load factor
    oscillates.
    """
    section = cf.Stiffness(shear=(1e5, 1e5), axial=1e5, bending=(300.0, 300.0), torsion=torsion)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), section)
    loads = [cf.Moment(rod.end, (0, 0, offset))]
    loads += [cf.EccentricForce(rod.end, (sign, 0, 0), (0.5 * sign, 0)) for sign in (1.0, -1.0)]

    def load(theta):
        return torsion * theta / (offset - np.sin(theta))

    return rod, cf.Scene([rod], [cf.Clamp(rod.start)], loads), load


def pendulum_limits(load, offset=1.2):
    """The first two limit loads of the pendulum, where d load/d theta = 0."""
    return [
        load(brentq(lambda t: offset - np.sin(t) + t * np.cos(t), *ends, xtol=1e-14))
        for ends in ((1.6, 2.0), (4.0, 5.5))
    ]


#: Belytschko & Glaum's arch, its symmetric path by shooting of the strong form: limit points, and where the skew mode
#: appears and vanishes on the unstable part (load, N).
ARCH_LIMITS = (34.07283194209858, 14.274637425687207)
ARCH_BIFURCATIONS = (26.9394647, 21.8990593)


def shallow_arch():
    """Clamped circular arch of radius 133.114 and span 34 with a dead unit load on its crown: (rod, crown, scene)."""
    R, span, E, height = 133.114, 34.0, 1e7, 0.1875
    half, EI = np.arcsin(span / 2 / R), E * height**3 / 12
    section = cf.Stiffness(
        shear=(5 / 6 * E / 2 * height,) * 2, axial=E * height, bending=(EI, 30 * EI), torsion=10 * EI
    )
    curve = cf.Arc((span / 2, -R * np.cos(half), 0), (0, 0, 0), -2 * half, axis=(0, 0, 1), d1=(0, 0, 1))
    rod = cf.Rod(curve, section)
    crown = rod.at(rod.length / 2)
    return rod, crown, cf.Scene([rod], [cf.Clamp(rod.start), cf.Clamp(rod.end)], [cf.Force(crown, (0, -1.0, 0))])


#: Lee's frame with shear factor 1, by shooting of the strong form: limit loads, N.
LEE_LIMITS = (18546.6, -9396.2)


def lees_frame():
    """Lee's frame (Lee, Manuel & Rossow 1968) with a dead unit load: (loaded station, scene)."""
    E, A, inertia = 7.2e6, 6.0, 2.0
    G = E / 2.6
    section = cf.Stiffness((G * A, G * A), E * A, (10 * E * inertia, E * inertia), 10 * G * inertia)
    column = cf.Rod(cf.Line((0, 0, 0), (0, 120.0, 0), d1=(1, 0, 0)), section, name="column")
    beam = cf.Rod(cf.Line((0, 120.0, 0), (120.0, 120.0, 0), d1=(0, 1, 0)), section, name="beam")
    loaded, axis = beam.at(24.0), (0, 0, 1)
    supports = [cf.Hinge(column.start, axis), cf.Hinge(beam.end, axis)]
    scene = cf.Scene(
        [column, beam], supports, [cf.Force(loaded, (0, -1.0, 0))], joints=[cf.Joint(column.end, beam.start)]
    )
    return loaded, scene


def clamped_ring(out_of_plane):
    """A ring of radius 1, EI = 1, clamped at its foot, a dead unit load on its top: (top, scene)."""
    section = cf.Stiffness((1e5, 1e5), 1e5, (1.0, out_of_plane), out_of_plane)
    rod = cf.Rod(cf.Arc((0, 1.0, 0), (0, 0, 0), 2 * np.pi, axis=(0, 0, 1), d1=(0, 0, 1)), section)
    top = rod.at(rod.length / 2)
    return top, cf.Scene([rod], [cf.Clamp(rod.start), cf.Clamp(rod.end)], [cf.Force(top, (0, -1.0, 0))])
