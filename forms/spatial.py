"""Eq. (1) of the paper, static part, on the centreline r and the quaternion q: forms/equilibrium.py with |q| = 1 added.

|q| = 1 is either the equation of the fourth component of q, with small rotations as test functions of the others
(Petrov-Galerkin), or a constraint with a multiplier, with changes of q as test functions (Galerkin).
"""

from collections import namedtuple

import ufl
from cosserat_fenicsx.forms.equilibrium import VirtualMotion
from cosserat_fenicsx.forms.point import NONE, Point
from cosserat_fenicsx.forms.rotation import (
    curvature,
    rotation_matrix,
    rotation_vector,
    small_rotation,
    small_rotation_s,
    vector_part,
)

#: The `equilibrium.Motion` of r and q, and q itself. `q_node` is an alias of q for other quadrature rules
#: (compat.alias).
State = namedtuple("State", "r_s R curvature q q_s q_node")


def unit_quaternion(state, test):
    """(|q|^2 - 1, phi_qa), to be integrated at the nodes: every nodal q is then a unit quaternion, for any supports."""
    return (ufl.dot(state.q_node, state.q_node) - 1) * test.phi_qa


def parts_of(w):
    """(r, q) of seven components, and of the first seven where a multiplier follows; (r, theta) of six."""
    return ufl.as_vector([w[i] for i in range(3)]), ufl.as_vector([w[i] for i in range(3, min(len(w), 7))])


def multiplier(lam, lam_test, q, phi):
    """First variation of lambda (|q|^2 - 1) along phi, to be integrated at the nodes of r, q and lambda.

    The matching virtual motions are `variations_of`: eq. (1) is then the first variation of the energy of q/|q|. With p
    Gauss points for that energy this is a regular saddle-point problem of order 2p without locking; more points cause
    locking. Where q is prescribed, so is lambda.
    """
    return 2 * lam * ufl.dot(q, parts_of(phi)[1]) + (ufl.dot(q, q) - 1) * lam_test


def tests_of(phi, phi_s):
    """The test functions of eq. (1) from the seven components (phi_r, phi_qa, phi_qb, phi_qc, phi_qd)."""
    (phi_r, phi_q), (phi_r_s, phi_q_s) = parts_of(phi), parts_of(phi_s)
    return VirtualMotion(phi_r, vector_part(phi_q), phi_r_s, vector_part(phi_q_s), phi[3])


def rotation_tests_of(psi, psi_s):
    """Test functions of a symmetric tangent: (phi_r, phi), without the constraint."""
    return VirtualMotion(*parts_of(psi), *parts_of(psi_s))


def variations_of(w, w_s, q, q_s):
    """The `VirtualMotion` of a change w = (delta r, delta q) of (r, q)."""
    (dr, dq), (dr_s, dq_s) = parts_of(w), parts_of(w_s)
    return VirtualMotion(dr, small_rotation(dq, q), dr_s, small_rotation_s(dq, dq_s, q, q_s))


def state_of(U, U_s, U_node):
    """The motion of the seven components (r, q)."""
    r_s, q_s = parts_of(U_s)
    return motion_of(r_s, parts_of(U)[1], q_s, parts_of(U_node)[1])


def motion_of(r_s, q, q_s, q_node):
    """The motion of r and q."""
    return State(r_s, rotation_matrix(q), curvature(q, q_s) / ufl.dot(q, q), q, q_s, q_node)


def point_of(U, U_s, *, rest, frame, r_t=NONE, omega=NONE):
    """The `Point` of the seven components (r, q); arguments as in `Point`."""
    (r, q), (r_s, q_s) = parts_of(U), parts_of(U_s)
    return Point(
        r, r_s, rotation_matrix(q), rotation_vector(q), curvature=curvature(q, q_s) / ufl.dot(q, q),
        rest=rest, frame=frame, r_t=r_t, omega=omega,
    )  # fmt: skip


def velocities(U, U_t):
    """Velocity and angular velocity, inertial, of the seven components (r, q) with the rates U_t."""
    r_t, q_t = parts_of(U_t)
    return r_t, small_rotation(q_t, parts_of(U)[1])
