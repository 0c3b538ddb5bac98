"""A step in time that conserves energy: rates of quadratic directors, tested with changes of q.

The directors R(q) of eq. (6) are homogeneous and quadratic in q, so that R(q_1) - R(q_0) is the derivative of R at the
average q_m in the direction q_1 - q_0, exactly. Strains that are products of R, r', q and q' as they stand change over
a step by what their averages resist, and rotational energy is that of the rates W of R, E = tr(I_R)/2 - I_R, by the
trapezoidal rule. Tested with (r_1 - r_0, q_1 - q_0) the step is the balance of energy, to the last digit. |q| = 1 is
held at the nodes, where tests are perpendicular to q_m: so it does no work.
"""

from collections import namedtuple

import ufl
from cosserat_fenicsx.forms.equilibrium import scaled
from cosserat_fenicsx.forms.rotation import conjugate_product, directors

#: r', q and q' of a configuration.
Line = namedtuple("Line", "r_s q q_s")
#: Tests: delta r and delta q, and their derivatives.
Tests = namedtuple("Tests", "r q r_s q_s")


def stretch_and_shear(line, section):
    """v - v_R with the directors as they stand, material."""
    return section.R_R.T * (directors(line.q).T * line.r_s) - section.v_R


def bending_and_torsion(line, section):
    """u - u_R with q as it stands, material."""
    return section.R_R.T * (2 * conjugate_product(line.q, line.q_s))


def turned(q, dq):
    """The derivative of the directors at q in the direction dq, linear in each."""

    def of(i, j):
        return q[i] * dq[j] + q[j] * dq[i]

    a, b, c, d = range(4)
    diagonal = [[of(a, a), of(b, b), -of(c, c), -of(d, d)], [of(a, a), -of(b, b), of(c, c), -of(d, d)],
                [of(a, a), -of(b, b), -of(c, c), of(d, d)]]  # fmt: skip
    first, second, third = (sum(terms) for terms in diagonal)
    return ufl.as_matrix(
        [
            [first, 2 * (of(b, c) - of(a, d)), 2 * (of(b, d) + of(a, c))],
            [2 * (of(b, c) + of(a, d)), second, 2 * (of(c, d) - of(a, b))],
            [2 * (of(b, d) - of(a, c)), 2 * (of(c, d) + of(a, b)), third],
        ]
    )


def euler_tensor(I_R):
    """E = tr(I_R)/2 - I_R, by which rotational energy is (W E : W)/2."""
    return ufl.tr(I_R) / 2 * ufl.Identity(3) - I_R


def kinetic_energy(r_t, W, inertia):
    """Per length."""
    return (inertia.mass * ufl.dot(r_t, r_t) + ufl.inner(W * euler_tensor(inertia.I_R), W)) / 2


def rate_work(rate, W_rate, q_m, inertia, test):
    """Rates of r_t and W, or velocities that drag resists, tested: rho A rate . delta r + (W_rate E) : delta R."""
    turning = ufl.inner(W_rate * euler_tensor(inertia.I_R), turned(q_m, test.q))
    return inertia.mass * ufl.dot(rate, test.r) + turning


def angular_momentum(q, W, inertia):
    """Per length, inertial: the axial vector of W E R^T twice, sum over a, b of E_ab R_a x W_b."""
    B = directors(q) * euler_tensor(inertia.I_R) * W.T
    return ufl.as_vector([B[1, 2] - B[2, 1], B[2, 0] - B[0, 2], B[0, 1] - B[1, 0]])


def stress_work(before, after, section, viscosity, h, test):
    """Averaged stress on the change of strain that a test amounts to."""
    r_m, q_m, q_ms = ((b + a) / 2 for b, a in zip(before, after, strict=True))
    mean = (directors(before.q) + directors(after.q)) / 2
    de = section.R_R.T * (mean.T * test.r_s + turned(q_m, test.q).T * r_m)
    du = section.R_R.T * (2 * (conjugate_product(test.q, q_ms) + conjugate_product(q_m, test.q_s)))
    total = 0
    for K, Kt, strain, change in (
        (section.K, viscosity.Kt, stretch_and_shear, de),
        (section.J, viscosity.Jt, bending_and_torsion, du),
    ):
        b, a = strain(before, section), strain(after, section)
        total += ufl.dot(scaled(K, (b + a) / 2) + scaled(Kt, (a - b) / h), change)
    return total


def strain_energy(line, section):
    """Per length."""
    e, u = stretch_and_shear(line, section), bending_and_torsion(line, section)
    return (ufl.dot(e, scaled(section.K, e)) + ufl.dot(u, scaled(section.J, u))) / 2


def viscous_loss(before, after, section, viscosity, h):
    """What Kelvin-Voigt damping takes in a step, per length."""
    total = 0
    for Kt, strain in ((viscosity.Kt, stretch_and_shear), (viscosity.Jt, bending_and_torsion)):
        change = strain(after, section) - strain(before, section)
        total += ufl.dot(change, scaled(Kt, change)) / h
    return total
