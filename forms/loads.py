"""The virtual work of every load: one function a kind, work per unit of the load factor, the same on every rung.

The vectors come first, then the test functions and R, the rotation of the section from its reference: a material
vector is given by its inertial components at rest, and R turns it. Where the contact force is known from statics there
is no virtual displacement: phi_r is zero, and so is the work of a dead force.
A point load is an integral over cells with one quadrature point on each cell end (`Points`): its coefficient is zero
everywhere but at the loaded end of one cell, so that it counts once, in parallel and at branching points too.
"""

from collections import namedtuple

import ufl

#: Virtual displacement phi_r and virtual rotation phi, both inertial.
Test = namedtuple("Test", "phi_r phi")


def force(F, test, R):
    """Dead force F (inertial)."""
    return ufl.dot(F, test.phi_r)


def moment(M, test, R):
    """Dead moment M (inertial)."""
    return ufl.dot(M, test.phi)


def eccentric_force(F, arm, test, R):
    """Dead force F at the end of a rigid arm that turns with the section; `arm` is inertial, at rest."""
    return ufl.dot(F, test.phi_r) + ufl.dot(ufl.cross(R * arm, F), test.phi)


def line_force(f, test, R):
    """Dead force f (inertial) per unit of reference arc length."""
    return ufl.dot(f, test.phi_r)


def line_moment(mu, test, R):
    """Dead moment mu (inertial) per unit of reference arc length."""
    return ufl.dot(mu, test.phi)


def follower_force(F, test, R):
    """Force that turns with the section; F is inertial, at rest."""
    return ufl.dot(R * F, test.phi_r)


def follower_moment(M, test, R):
    """Moment that turns with the section; M is inertial, at rest."""
    return ufl.dot(R * M, test.phi)
