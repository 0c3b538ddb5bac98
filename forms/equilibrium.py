"""Eq. (1) of the paper, static part, for any parametrisation of the rotation: each model supplies its own `Motion`.

Strong form: n' + f = 0, m' + r' x n + mu = 0, with a law of forms/law.py for the material components, T^T n and T^T m
with T = R R_R, of the strains v - v_0 and u - u_0. v_0 and u_0 are those without stress: v_R and u_R of the reference,
and what actuation, heat or growth add to them. The contact force n may be independent of the motion: a field of
unknowns, values at the quadrature points updated from one Newton step to the next, or known from statics; m then
follows from n and u - u_R. `ds(a)` is the integral of a over the rod with p Gauss points per element.
"""

from collections import namedtuple

import ufl
from cosserat_fenicsx.forms import law

#: The configuration as eq. (1) needs it: r', the rotation R from the reference, and the axial vector of R^T R', which
#: is R_R (u - u_R).
Motion = namedtuple("Motion", "r_s R curvature")
#: Virtual displacement phi_r and virtual rotation phi, both inertial, and their derivatives along the rod; phi_qa is
#: the test function of |q| = 1 where the unknown is q. Derivatives that a term does not need may be None.
VirtualMotion = namedtuple("VirtualMotion", "phi_r phi phi_r_s phi_s phi_qa", defaults=(None, None, 0))
#: The law of forms/law.py, the reference frame R_R = [d_1R d_2R d_3R], and the strains without stress: v_0, which is
#: v_R = R_R^T r_R' where nothing acts in the law, (0, 0, 1) on the exact curve; and k_0 = u_0 - u_R, None there. UFL.
Section = namedtuple("Section", "law R_R v_0 k_0", defaults=(None,))


def frame(motion, section):
    """T = [d_1 d_2 d_3], the current directors as columns."""
    return motion.R * section.R_R


def stretch_and_shear(motion, section):
    """Material strain v - v_0 = T^T r' - v_0, eq. (4)."""
    return frame(motion, section).T * motion.r_s - section.v_0


def bending_and_torsion(motion, section):
    """Material strain u - u_0; the reference curvature drops out because R is relative to the reference."""
    k = section.R_R.T * motion.curvature
    return k if section.k_0 is None else k - section.k_0


def strains(motion, section):
    """(v - v_0, u - u_0), material."""
    return stretch_and_shear(motion, section), bending_and_torsion(motion, section)


def contact(motion, section):
    """(n, m) by the law, inertial."""
    T = frame(motion, section)
    return tuple(T * a for a in law.stress(section.law, *strains(motion, section)))


def contact_moment(n, motion, section):
    """The contact moment m where the contact force is n, inertial."""
    T = frame(motion, section)
    return T * section.law.moment(T.T * n, bending_and_torsion(motion, section))


def tangent_of_force(n, motion, section):
    """r' = T (v_0 + e) with the strain e = v - v_0 from the contact force n by the inverse law, inertial."""
    T = frame(motion, section)
    return T * (section.v_0 + section.law.strain(T.T * n, bending_and_torsion(motion, section)))


def compatibility(n, motion, section):
    """r' less `tangent_of_force`: zero where the contact force n and the motion agree."""
    return motion.r_s - tangent_of_force(n, motion, section)


def balance(n, m, motion, test):
    """Left side of eq. (1): (n, phi_r') + (m, phi') - (r' x n, phi)."""
    return ufl.dot(n, test.phi_r_s) + ufl.dot(m, test.phi_s) - ufl.dot(ufl.cross(motion.r_s, n), test.phi)


def displacement(motion, section, test, ds):
    """Eq. (1) with displacements and rotations as the only unknowns, n and m by the law."""
    return ds(balance(*contact(motion, section), motion, test))


def mixed(n, motion, section, test, phi_n, ds):
    """Eq. (1) with the contact force n (inertial) as an additional unknown field: regular for infinite stiffness."""
    m = contact_moment(n, motion, section)
    return ds(balance(n, m, motion, test)) + ds(ufl.dot(compatibility(n, motion, section), phi_n))


def carried_force_tangent(n_k, motion, section, test, ds, derivative):
    """Tangent of `mixed` with n condensed at the quadrature points; n_k is the value there at this Newton step.

    Mixed-integration-point Newton (Magisano, Leonetti & Garcea, CMAME 313 (2017) 986). `derivative(a)` is the
    derivative of a form or an expression in the direction of the trial function. With g = `compatibility` a Newton step
    changes the strain behind n by g + dg, and n and m by the law; the residual is therefore that of `displacement` for
    any n_k.
    """
    frozen = ds(balance(n_k, contact_moment(n_k, motion, section), motion, test))
    dn, dm = _stress_of(derivative(compatibility(n_k, motion, section)), motion, section)
    return derivative(frozen) + ds(balance(dn, dm, motion, test))


def carried_force_update(n_k, motion, section, derivative):
    """n_k+1 = n_k + T n(T^T (g + dg[step])), g = `compatibility`, n(e) the law, at the motion before the step."""
    g = compatibility(n_k, motion, section)
    return n_k + _stress_of(g + derivative(g), motion, section)[0]


def second_variation(n, motion, section, test, direction, stiffness=1):
    """The change of `balance` in a direction (phi_r_s, phi, phi_s) of small displacement and inertial rotation phi.

    Symmetric in test and direction, except for a term of moments without potential; the stiffness of the law need not
    be the inverse of its flexibility. With d = phi: dR = d x R and d(curvature) = R^T d', so that dn is d x n and dm is
    d x m, plus the law's response to the strain changes T^T (dr' - d x `tangent_of_force`) and T^T d'. `stiffness`
    multiplies this response; with 0 only the geometric stiffness of n and m remains.
    """
    T = frame(motion, section)
    g = direction.phi_r_s - ufl.cross(direction.phi, tangent_of_force(n, motion, section))
    strained, bent = (T * a for a in law.stress(section.law, T.T * g, T.T * direction.phi_s))
    dn = ufl.cross(direction.phi, n) + stiffness * strained
    dm = ufl.cross(direction.phi, contact_moment(n, motion, section)) + stiffness * bent
    change = ufl.cross(direction.phi_r_s, n) + ufl.cross(motion.r_s, dn)
    return ufl.dot(dn, test.phi_r_s) + ufl.dot(dm, test.phi_s) - ufl.dot(change, test.phi)


def turned_tangent(n, motion, section, direction):
    """The change of `tangent_of_force` under a small inertial rotation, n held."""
    T, phi = frame(motion, section), direction.phi
    relaxed = section.law.strain(T.T * ufl.cross(phi, n), -(T.T * direction.phi_s))
    return ufl.cross(phi, tangent_of_force(n, motion, section)) - T * relaxed


def turned_moment(n, motion, section, direction):
    """The change of `contact_moment` under a small inertial rotation, n held."""
    T, phi = frame(motion, section), direction.phi
    bent = section.law.moment(-(T.T * ufl.cross(phi, n)), T.T * direction.phi_s)
    return ufl.cross(phi, contact_moment(n, motion, section)) + T * bent


def _stress_of(g, motion, section):
    """The (n, m), inertial, of the strain T^T g without bending or torsion."""
    T = frame(motion, section)
    return tuple(T * a for a in law.stress(section.law, T.T * g, ufl.as_vector([0, 0, 0])))
