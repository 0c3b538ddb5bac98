"""The virtual work of every load: one function per kind, shared by all models.

Arguments: the point where it acts (`point.Point`), the virtual motion (`equilibrium.VirtualMotion`), and the load's
data. A vector that rotates with the section is given by its inertial components at rest, and R rotates it. The work is
that of the whole load at a point, or per unit length of a distributed one, at load factor 1. In the determinate models
there is no virtual displacement: phi_r is zero, and so is the work of a dead force.
"""

import ufl


def force(point, test, F):
    """Dead force F (inertial), at a point or per unit of reference arc length."""
    return ufl.dot(F, test.phi_r)


def moment(point, test, M):
    """Dead moment M (inertial), at a point or per unit of reference arc length."""
    return ufl.dot(M, test.phi)


def eccentric_force(point, test, F, arm):
    """Dead force F at the end of a rigid arm that turns with the section; `arm` is inertial, at rest."""
    return ufl.dot(F, test.phi_r) + ufl.dot(ufl.cross(point.R * arm, F), test.phi)


def moment_on_arm(point, test, F, arm):
    """The moment of the force of `eccentric_force` about the axis, without the force."""
    return ufl.dot(ufl.cross(point.R * arm, F), test.phi)


def follower_force(point, test, F):
    """Force that turns with the section; F is inertial, at rest."""
    return ufl.dot(point.R * F, test.phi_r)


def follower_moment(point, test, M):
    """Moment that turns with the section; M is inertial, at rest."""
    return ufl.dot(point.R * M, test.phi)


def tendon(point, test, T, a, a_s):
    """The tension T of a thread through the points r + R a, without friction: -T times the change of its length per
    unit of arc length. It is `equilibrium.balance` of the force T t and the moment R a x T t, t the thread's direction;
    `a` and its derivative a_s are inertial, at rest."""
    arm, arm_s, along = _thread(point, a, a_s)
    change = test.phi_r_s + ufl.cross(test.phi_s, arm) + ufl.cross(test.phi, arm_s)
    return -T * ufl.dot(along, change) / ufl.sqrt(ufl.dot(along, along))


def thread_stretch(point, a, a_s):
    """The length of the thread of `tendon` per unit of arc length."""
    _, _, along = _thread(point, a, a_s)
    return ufl.sqrt(ufl.dot(along, along))


def _thread(point, a, a_s):
    """R a, its derivative along the rod, and that of r + R a."""
    arm_s = point.R * (a_s + ufl.cross(point.curvature, a))
    return point.R * a, arm_s, point.r_s + arm_s
