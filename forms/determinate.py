"""Eq. (1) where statics alone gives the contact force: one clamp on every tree of rods, and dead forces.

n' + f = 0 and n = F at free ends then fix n(s) per unit of the load factor, whatever the motion. r' follows from it by
the law (2) read backwards, and the rotation is the only unknown: theta in a plane, q in space. Tests have phi_r = 0.
The form is symmetric where no moment is without potential, the derivative of an energy from which r is eliminated as a
minimum: its negative squares are those of the whole.
"""

from collections import namedtuple

import ufl
from cosserat_fenicsx.forms.equilibrium import balance, contact_moment, tangent_of_force, turned_moment, turned_tangent
from cosserat_fenicsx.forms.rotation import vector_part

#: Virtual rotation and its derivative, no virtual displacement; phi_qa tests |q| = 1 where the unknown is q.
Tests = namedtuple("Tests", "phi_r phi phi_r_s phi_s phi_qa", defaults=(0,))
_NONE = ufl.as_vector([0, 0, 0])


def tests_of(phi, phi_s):
    """Test functions from a virtual rotation (inertial) and its derivative."""
    return Tests(_NONE, phi, _NONE, phi_s)


def quaternion_tests_of(phi, phi_s):
    """Test functions from the four components (phi_qa, phi_qb, phi_qc, phi_qd), as in the spatial rung."""
    return Tests(_NONE, vector_part(phi), _NONE, vector_part(phi_s), phi[0])


def bound(n, motion, section):
    """The motion with the r' that the contact force n asks for."""
    return motion._replace(r_s=tangent_of_force(n, motion, section))


def moments(n, motion, section, test, ds):
    """(m, phi') - (r' x n, phi), the balance of moments with n known."""
    return ds(balance(n, contact_moment(motion, section), bound(n, motion, section), test))


def second_variation(n, motion, section, test, direction):
    """The change of `moments` in a direction of small inertial rotation; see `equilibrium.second_variation`."""
    dr_s = turned_tangent(n, motion, section, direction.phi)
    dm = turned_moment(motion, section, direction)
    return ufl.dot(dm, test.phi_s) - ufl.dot(ufl.cross(dr_s, n), test.phi)
