"""Eq. (1) of the paper, static part, on the centreline r and the quaternion q: forms/equilibrium.py with |q| = 1 added.

Three formulations share the two balances and differ in what carries n and in how |q| = 1 is held.
`ds(a)` is the integral of a over the rod by p Gauss points an element, `ds_node(a)` the one with the nodes as points.
"""

from collections import namedtuple

import ufl
from cosserat_fenicsx.forms import equilibrium
from cosserat_fenicsx.forms.equilibrium import scaled
from cosserat_fenicsx.forms.loads import Test
from cosserat_fenicsx.forms.rotation import (
    curvature,
    directors,
    rotation_matrix,
    small_rotation,
    vector_part,
)

#: The `equilibrium.Motion` of r and q, and q itself. `q_node` is q by another name for other rules (compat.alias).
State = namedtuple("State", "r_s R curvature q q_s q_node")
#: Virtual displacement phi_r, virtual rotation phi, test function phi_qa of the constraint, and the derivatives.
Tests = namedtuple("Tests", "phi_r phi phi_qa phi_r_s phi_s")


def unit_quaternion(state, test):
    """(|q|^2 - 1, phi_qa), to be integrated at the nodes: every nodal q is then a rotation, for any supports."""
    return (ufl.dot(state.q_node, state.q_node) - 1) * test.phi_qa


def displacement(state, section, test, ds, ds_node):
    """Eq. (1) to the letter, n from eq. (2)."""
    return equilibrium.displacement(state, section, test, ds) + ds_node(unit_quaternion(state, test))


def mixed(n, state, section, test, phi_n, ds, ds_node):
    """Eq. (1) with the contact force n (inertial) as a field of its own: finite for infinite stiffness."""
    return equilibrium.mixed(n, state, section, test, phi_n, ds) + ds_node(unit_quaternion(state, test))


def carried_force_tangent(n_k, state, section, test, ds, ds_node, derivative):
    """`equilibrium.carried_force_tangent` and the constraint's."""
    tangent = equilibrium.carried_force_tangent(n_k, state, section, test, ds, derivative)
    return tangent + derivative(ds_node(unit_quaternion(state, test)))


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
    """The motion of the seven components (r, q)."""
    return motion_of(_first(U_s), _last(U), _last(U_s), _last(U_node))


def motion_of(r_s, q, q_s, q_node):
    """The motion of r and q."""
    return State(r_s, rotation_matrix(q), curvature(q, q_s) / ufl.dot(q, q), q, q_s, q_node)


def _first(w):
    return ufl.as_vector([w[0], w[1], w[2]])


def _last(w):
    return ufl.as_vector([w[3], w[4], w[5], w[6]])
