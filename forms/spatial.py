"""Eq. (1) of the paper, static part, on the centreline r and the quaternion q.

Strong form: n' + f = 0, m' + r' x n + mu = 0, |q| = 1, with the laws (2)-(3) for material components,
n = T K (v - v_R), m = T J (u - u_R), T = R(q) R_R.
Three formulations share the two balances below and differ in what carries n and in how |q| = 1 is held.
`ds(a)` is the integral of a over the rod by p Gauss points an element, `ds_node(a)` the one with the nodes as points.
"""

from collections import namedtuple

import ufl
from cosserat_fenicsx.forms.loads import Test
from cosserat_fenicsx.forms.rotation import (
    curvature,
    directors,
    rotation_matrix,
    small_rotation,
    turned_by,
    vector_part,
)

#: r, q and their derivatives along the rod. `q_node` is q under another name, for rules of its own (compat.alias).
State = namedtuple("State", "r q r_s q_s q_node")
#: Virtual displacement phi_r, virtual rotation phi, test function phi_qa of the constraint, and the derivatives.
Tests = namedtuple("Tests", "phi_r phi phi_qa phi_r_s phi_s")
#: Material stiffness K = (GA1, GA2, EA), its inverse, J = (EI1, EI2, GJ), the reference frame R_R = [d_1R d_2R d_3R], and
#: the reference strain v_R: (0, 0, 1) up to the interpolation of a curved reference.
Section = namedtuple("Section", "K K_inv J R_R v_R")


def scaled(D, a):
    """diag(D) a for a diagonal given as a vector."""
    return ufl.as_vector([D[i] * a[i] for i in range(3)])


def frame(state, section):
    """T = [d_1 d_2 d_3], the current directors as columns."""
    return rotation_matrix(state.q) * section.R_R


def stretch_and_shear(state, section):
    """Material strain v - v_R = T^T r' - v_R, eq. (4)."""
    return frame(state, section).T * state.r_s - section.v_R


def bending_and_torsion(state, section):
    """Material strain u - u_R; the reference curvature drops out because q is relative to the reference."""
    return section.R_R.T * curvature(state.q, state.q_s) / ufl.dot(state.q, state.q)


def contact_force(state, section):
    """n = T K (v - v_R), eq. (2), inertial."""
    return frame(state, section) * scaled(section.K, stretch_and_shear(state, section))


def contact_moment(state, section):
    """m = T J (u - u_R), eq. (3), inertial."""
    return frame(state, section) * scaled(section.J, bending_and_torsion(state, section))


def compatibility(n, state, section):
    """r' - T (v_R + K^-1 T^T n): zero where the contact force n and the motion agree."""
    T = frame(state, section)
    return state.r_s - T * (section.v_R + scaled(section.K_inv, T.T * n))


def balance(n, m, state, test):
    """Left side of eq. (1): (n, phi_r') + (m, phi') - (r' x n, phi)."""
    return ufl.dot(n, test.phi_r_s) + ufl.dot(m, test.phi_s) - ufl.dot(ufl.cross(state.r_s, n), test.phi)


def unit_quaternion(state, test):
    """(|q|^2 - 1, phi_qa), to be integrated at the nodes: every nodal q is then a rotation, for any supports."""
    return (ufl.dot(state.q_node, state.q_node) - 1) * test.phi_qa


def displacement(state, section, test, ds, ds_node):
    """Eq. (1) to the letter, n from eq. (2)."""
    n, m = contact_force(state, section), contact_moment(state, section)
    return ds(balance(n, m, state, test)) + ds_node(unit_quaternion(state, test))


def mixed(n, state, section, test, phi_n, ds, ds_node):
    """Eq. (1) with the contact force n (inertial) as a field of its own: finite for infinite stiffness."""
    m = contact_moment(state, section)
    return (
        ds(balance(n, m, state, test))
        + ds(ufl.dot(compatibility(n, state, section), phi_n))
        + ds_node(unit_quaternion(state, test))
    )


def carried_force_tangent(n_k, state, section, test, ds, ds_node, derivative):
    """Tangent of `mixed` with n condensed at the quadrature points, where n_k is carried from step to step.

    Mixed-integration-point Newton (Magisano, Leonetti & Garcea, CMAME 313 (2017) 986). `derivative(a)` is the
    derivative of a form or an expression in the direction of the trial function.
    """
    m = contact_moment(state, section)
    frozen = ds(balance(n_k, m, state, test)) + ds_node(unit_quaternion(state, test))
    dn = _force_of(derivative(compatibility(n_k, state, section)), state, section)
    return derivative(frozen) + ds(ufl.dot(dn, test.phi_r_s) - ufl.dot(ufl.cross(state.r_s, dn), test.phi))


def carried_force_update(n_k, state, section, derivative):
    """n_k+1 = n_k + C (g + dg[step]) with g = `compatibility` and C = T K T^T, at the state before the step."""
    g = compatibility(n_k, state, section)
    return n_k + _force_of(g + derivative(g), state, section)


def _force_of(g, state, section):
    """C g, C = T K T^T."""
    T = frame(state, section)
    return T * scaled(section.K, T.T * g)


def multiplier(lam, lam_test, state, section, ds, derivative):
    """First variation of the energy with a field lambda that holds |q|^2 = 1 (directors of eq. (6) as they stand).

    For comparison only: it locks, and most spaces for lambda make the tangent singular (README, Formulations).
    """
    q = state.q
    _, v, u = _as_they_stand(state, section)
    energy = (ufl.dot(v, scaled(section.K, v)) + ufl.dot(u, scaled(section.J, u))) / 2
    constraint = ufl.dot(q, q) - 1
    return derivative(ds(energy)) + derivative(ds(lam * constraint)) + ds(constraint * lam_test)


def multiplier_contact(state, section):
    """Contact force and moment of the multiplier form, inertial."""
    T, v, u = _as_they_stand(state, section)
    return T * scaled(section.K, v), T * scaled(section.J, u)


def _as_they_stand(state, section):
    """Directors of eq. (6) and the strains of eqs. (4)-(5) without a division by |q|^2."""
    T = directors(state.q) * section.R_R
    return T, T.T * state.r_s - section.v_R, section.R_R.T * curvature(state.q, state.q_s)


def stability_direction(dr, theta, q):
    """A motion (dr, dq) that keeps |q|: the direction in which the second variation is taken."""
    dq = turned_by(theta, q)
    return ufl.as_vector([dr[0], dr[1], dr[2], dq[0], dq[1], dq[2], dq[3]])


def tests_of(phi, phi_s):
    """The test functions of eq. (1) from the seven components (phi_r, phi_qa, phi_qb, phi_qc, phi_qd)."""
    return Tests(_first(phi), vector_part(_last(phi)), phi[3], _first(phi_s), vector_part(_last(phi_s)))


def rotation_tests_of(psi, psi_s):
    """Test functions of a symmetric tangent: (phi_r, phi) alone, no constraint."""
    return Tests(_first(psi), ufl.as_vector([psi[3], psi[4], psi[5]]), 0, _first(psi_s),
                 ufl.as_vector([psi_s[3], psi_s[4], psi_s[5]]))  # fmt: skip


def variation_tests_of(w, q):
    """Virtual displacement and rotation of a variation w = (delta r, delta q), for loads in the multiplier form."""
    return Test(_first(w), small_rotation(_last(w), q))


def state_of(U, U_s, U_node):
    """r and q out of the seven components (r, q)."""
    return State(_first(U), _last(U), _first(U_s), _last(U_s), _last(U_node))


def _first(w):
    return ufl.as_vector([w[0], w[1], w[2]])


def _last(w):
    return ufl.as_vector([w[3], w[4], w[5], w[6]])
