"""Eq. (1) where statics alone gives the contact force: one clamp on every tree of rods, and dead forces.

n' + f = 0 and n = F at free ends then determine n(s) per unit of the load factor, for any configuration. r' follows
from n by the inverse law, and the rotation is the only unknown: theta in a plane, q in space. Test functions have phi_r
= 0. The tangent is symmetric if every moment has a potential. It is then the second variation of the energy minimised
over r, and has as many negative eigenvalues as that of the full energy.
"""

import ufl
from cosserat_fenicsx.forms.equilibrium import (
    VirtualMotion,
    balance,
    contact_moment,
    tangent_of_force,
    turned_moment,
    turned_tangent,
)
from cosserat_fenicsx.forms.rotation import vector_part

_NONE = ufl.as_vector([0, 0, 0])


def tests_of(phi, phi_s):
    """Test functions from a virtual rotation (inertial) and its derivative."""
    return VirtualMotion(_NONE, phi, _NONE, phi_s)


def quaternion_tests_of(phi, phi_s):
    """Test functions from the four components (phi_qa, phi_qb, phi_qc, phi_qd), as in the spatial model."""
    return VirtualMotion(_NONE, vector_part(phi), _NONE, vector_part(phi_s), phi[0])


def bound(n, motion, section):
    """The motion with r' computed from the contact force n by the inverse law."""
    return motion._replace(r_s=tangent_of_force(n, motion, section))


def moments(n, motion, section, test, ds):
    """(m, phi') - (r' x n, phi), the weak balance of moments with n known."""
    return ds(balance(n, contact_moment(n, motion, section), bound(n, motion, section), test))


def second_variation(n, motion, section, test, direction):
    """The change of `moments` in a direction of small inertial rotation; see `equilibrium.second_variation`."""
    dr_s = turned_tangent(n, motion, section, direction)
    dm = turned_moment(n, motion, section, direction)
    return ufl.dot(dm, test.phi_s) - ufl.dot(ufl.cross(dr_s, n), test.phi)
