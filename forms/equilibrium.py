"""Eq. (1) of the paper, static part, whatever carries the rotation: every rung is this on a `Motion` of its own.

Strong form: n' + f = 0, m' + r' x n + mu = 0, with the laws (2)-(3) for material components,
n = T K (v - v_R), m = T J (u - u_R), T = R R_R. The contact force n may be a quantity of its own: a field of unknowns,
values carried from step to step, or known from statics.
`ds(a)` is the integral of a over the rod by p Gauss points an element.
"""

from collections import namedtuple

import ufl

#: What eq. (1) sees of a motion: r', the rotation R from the reference, and the axial vector of R^T R', R_R (u - u_R).
Motion = namedtuple("Motion", "r_s R curvature")
#: Material stiffness K = (GA1, GA2, EA), its inverse, J = (EI1, EI2, GJ), the reference frame R_R = [d_1R d_2R d_3R]
#: and the reference strain v_R = R_R^T r_R', which is (0, 0, 1) on the curve itself; vectors and a matrix of UFL.
Section = namedtuple("Section", "K K_inv J R_R v_R")


def scaled(D, a):
    """diag(D) a for a diagonal given as a vector."""
    return ufl.as_vector([D[i] * a[i] for i in range(3)])


def frame(motion, section):
    """T = [d_1 d_2 d_3], the current directors as columns."""
    return motion.R * section.R_R


def stretch_and_shear(motion, section):
    """Material strain v - v_R = T^T r' - v_R, eq. (4)."""
    return frame(motion, section).T * motion.r_s - section.v_R


def bending_and_torsion(motion, section):
    """Material strain u - u_R; the reference curvature drops out because R is relative to the reference."""
    return section.R_R.T * motion.curvature


def contact_force(motion, section):
    """n = T K (v - v_R), eq. (2), inertial."""
    return frame(motion, section) * scaled(section.K, stretch_and_shear(motion, section))


def contact_moment(motion, section):
    """m = T J (u - u_R), eq. (3), inertial."""
    return frame(motion, section) * scaled(section.J, bending_and_torsion(motion, section))


def tangent_of_force(n, motion, section):
    """The r' = T (v_R + K^-1 T^T n) that goes with a contact force n: the law (2) read backwards, inertial."""
    T = frame(motion, section)
    return T * (section.v_R + scaled(section.K_inv, T.T * n))


def compatibility(n, motion, section):
    """r' - T (v_R + K^-1 T^T n): zero where the contact force n and the motion agree."""
    return motion.r_s - tangent_of_force(n, motion, section)


def balance(n, m, motion, test):
    """Left side of eq. (1): (n, phi_r') + (m, phi') - (r' x n, phi)."""
    return ufl.dot(n, test.phi_r_s) + ufl.dot(m, test.phi_s) - ufl.dot(ufl.cross(motion.r_s, n), test.phi)


def displacement(motion, section, test, ds):
    """Eq. (1) to the letter, n from eq. (2)."""
    return ds(balance(contact_force(motion, section), contact_moment(motion, section), motion, test))


def mixed(n, motion, section, test, phi_n, ds):
    """Eq. (1) with the contact force n (inertial) as a field of its own: finite for infinite stiffness."""
    m = contact_moment(motion, section)
    return ds(balance(n, m, motion, test)) + ds(ufl.dot(compatibility(n, motion, section), phi_n))


def carried_force_tangent(n_k, motion, section, test, ds, derivative):
    """Tangent of `mixed` with n condensed at the quadrature points, where n_k is carried from step to step.

    Mixed-integration-point Newton (Magisano, Leonetti & Garcea, CMAME 313 (2017) 986). `derivative(a)` is the
    derivative of a form or an expression in the direction of the trial function.
    """
    frozen = ds(balance(n_k, contact_moment(motion, section), motion, test))
    dn = _force_of(derivative(compatibility(n_k, motion, section)), motion, section)
    return derivative(frozen) + ds(ufl.dot(dn, test.phi_r_s) - ufl.dot(ufl.cross(motion.r_s, dn), test.phi))


def carried_force_update(n_k, motion, section, derivative):
    """n_k+1 = n_k + C (g + dg[step]) with g = `compatibility` and C = T K T^T, at the motion before the step."""
    g = compatibility(n_k, motion, section)
    return n_k + _force_of(g + derivative(g), motion, section)


def second_variation(n, motion, section, test, direction, stiffness=1):
    """The change of `balance` in a direction (phi_r_s, phi, phi_s) of small displacement and inertial rotation phi.

    Symmetric in test and direction but for what a moment without potential leaves; K and K_inv need not be each
    other's inverse. With d = phi: dR = d x R, d(curvature) = R^T d', so that dm = d x m + T J T^T d' and
    dn = d x n + T K T^T (dr' - d x T (v_R + K^-1 T^T n)). `stiffness` multiplies K and J in the changes: with 0 what is
    left is that of the contact force and moment alone, as they turn.
    """
    g = direction.phi_r_s - ufl.cross(direction.phi, tangent_of_force(n, motion, section))
    dn = ufl.cross(direction.phi, n) + stiffness * _force_of(g, motion, section)
    dm = turned_moment(motion, section, direction, stiffness)
    change = ufl.cross(direction.phi_r_s, n) + ufl.cross(motion.r_s, dn)
    return ufl.dot(dn, test.phi_r_s) + ufl.dot(dm, test.phi_s) - ufl.dot(change, test.phi)


def turned_tangent(n, motion, section, phi):
    """The change of `tangent_of_force` under a small inertial rotation phi, n held."""
    T = frame(motion, section)
    turned_n = scaled(section.K_inv, T.T * ufl.cross(phi, n))
    return ufl.cross(phi, tangent_of_force(n, motion, section)) - T * turned_n


def turned_moment(motion, section, direction, stiffness=1):
    """The change of `contact_moment` under a small inertial rotation; `stiffness` as of `second_variation`."""
    T = frame(motion, section)
    bent = T * scaled(section.J, T.T * direction.phi_s)
    return ufl.cross(direction.phi, contact_moment(motion, section)) + stiffness * bent


def load_variation(work, test, R, phi):
    """The change of a load's virtual work `work(test, R)` under a small inertial rotation phi."""
    turning = ufl.variable(R)
    change = [ufl.cross(phi, R[:, j]) for j in range(3)]
    slope = ufl.diff(work(test, turning), turning)
    return sum(slope[i, j] * change[j][i] for i in range(3) for j in range(3))


def _force_of(g, motion, section):
    """C g, C = T K T^T."""
    T = frame(motion, section)
    return T * scaled(section.K, T.T * g)
