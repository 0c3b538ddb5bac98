"""The virtual work of every load: one function a kind, work per unit of the load factor.

A point load is an integral over cells with one quadrature point on each cell end (`Points`): its coefficient is zero
everywhere but at the loaded end of one cell, so that it counts once, in parallel and at branching points too.
"""

from collections import namedtuple

import ufl
from cosserat_fenicsx.forms.rotation import rotation_matrix

#: Virtual displacement phi_r and virtual rotation phi, both inertial.
Test = namedtuple("Test", "phi_r phi")


def force(F, test, q):
    """Dead force F (inertial)."""
    return ufl.dot(F, test.phi_r)


def moment(M, test, q):
    """Dead moment M (inertial)."""
    return ufl.dot(M, test.phi)


def eccentric_force(F, arm, test, q):
    """Dead force F at the end of a rigid arm that turns with the section; `arm` is inertial, at rest."""
    return ufl.dot(F, test.phi_r) + ufl.dot(ufl.cross(rotation_matrix(q) * arm, F), test.phi)


def line_force(f, test, q):
    """Dead force f (inertial) per unit of reference arc length."""
    return ufl.dot(f, test.phi_r)


def line_moment(mu, test, q):
    """Dead moment mu (inertial) per unit of reference arc length."""
    return ufl.dot(mu, test.phi)


def follower_force(F, test, q):
    """Force that turns with the section; F is inertial, at rest."""
    return ufl.dot(rotation_matrix(q) * F, test.phi_r)


def follower_moment(M, test, q):
    """Moment that turns with the section; M is inertial, at rest."""
    return ufl.dot(rotation_matrix(q) * M, test.phi)
