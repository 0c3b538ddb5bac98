"""Motions from the literature: the flying spaghetti in space and in a plane, the right-angle cantilever."""

from dataclasses import replace

import numpy as np

import cosserat_fenicsx as cf

SPAGHETTI = cf.Stiffness((1e4, 1e4), 1e4, (500, 500), 500, mass=1.0, inertia=(10, 10, 20))


def spaghetti(*loads, **more):
    """A free rod from (6, 0, 0) to (0, 8, 0), after Simo & Vu-Quoc (1986, 1988); `loads` are made from it."""
    rod = cf.Rod(cf.Line((6, 0, 0), (0, 8, 0)), SPAGHETTI, name="spaghetti")
    return rod, cf.Scene([rod], loads=[make(rod) for make in loads], **more)


def flying_in_space():
    """Force (T/10, 0, 0) and moment (0, -T, -T/2) at the start, T a triangle of 200 at 2.5 s."""
    return spaghetti(
        lambda rod: cf.Force(rod.start, cf.signals.Triangle((20, 0, 0), 0, 2.5, 5)),
        lambda rod: cf.Moment(rod.start, cf.signals.Triangle((0, -200, -100), 0, 2.5, 5)),
    )


def flying_off_axis():
    """The same with its mass centre off the axis."""
    _, scene = flying_in_space()
    rod = cf.Rod(scene.rods[0].curve, SPAGHETTI, name="spaghetti", eccentricity=(0.3, -0.2))
    return rod, cf.Scene([rod], loads=[replace(load, station=rod.start) for load in scene.loads])


def flying_in_a_plane():
    """Force (8, 0, 0) and moment (0, 0, -80) at the start for 2.5 s."""
    return spaghetti(
        lambda rod: cf.Force(rod.start, lambda t: (8.0 if t < 2.5 else 0.0, 0, 0), jumps=(2.5,)),
        lambda rod: cf.Moment(rod.start, cf.signals.Step((0, 0, -80), end=2.5)),
    )


def right_angle():
    """Two legs of 10 m, clamped at the foot, a force out of their plane at the elbow (Simo & Vu-Quoc 1988)."""
    section = cf.Stiffness((1e6, 1e6), 1e6, (1e3, 1e3), 1e3, mass=1.0, inertia=(10, 10, 20))
    foot = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), section, name="foot")
    arm = cf.Rod(cf.Line((10, 0, 0), (10, 10, 0)), section, name="arm")
    load = cf.Force(foot.end, cf.signals.Triangle((0, 0, 50), 0, 1, 2))
    return arm, cf.Scene([foot, arm], [cf.Clamp(foot.start)], [load], [cf.Joint(foot.end, arm.start)])


def drift(values):
    """Largest change of rows (n, k) over their largest size."""
    return float(np.ptp(values, axis=0).max() / np.abs(values).max())
