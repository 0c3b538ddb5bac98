"""An energy-conserving time step: directors quadratic in q, test functions that are changes of q.

The directors R(q) of eq. (6) are homogeneous and quadratic in q, so that R(q_1) - R(q_0) is the derivative of R at the
average q_m in the direction q_1 - q_0, exactly. The strains are products of R, r', q and q' without normalisation;
their increments over a step are then linear in the increments of r and q with averaged coefficients. Rotational energy
is that of the rates W of R, with Euler's tensor E = tr(I_R)/2 - I_R, by the trapezoidal rule. With the test function
(r_1 - r_0, q_1 - q_0) the step is the balance of energy, exact to rounding. The constraint |q| = 1 is imposed at the
nodes, where test functions are perpendicular to q_m, so that it does no work.
"""

from collections import namedtuple

import ufl
from cosserat_fenicsx.forms import law
from cosserat_fenicsx.forms.inertia import lateral
from cosserat_fenicsx.forms.rotation import conjugate_product, directors, turned

#: r', q and q' of a configuration.
Configuration = namedtuple("Configuration", "r_s q q_s")
#: Test functions of the step: delta r and delta q, and their derivatives along the rod.
Variation = namedtuple("Variation", "r q r_s q_s")


def strains(line, section):
    """(v - v_0, u - u_0) with directors and q not normalised, material."""
    e = section.R_R.T * (directors(line.q).T * line.r_s) - section.v_0
    k = section.R_R.T * (2 * conjugate_product(line.q, line.q_s))
    return e, k if section.k_0 is None else k - section.k_0


def euler_tensor(I_R):
    """E = tr(I_R)/2 - I_R; rotational energy per unit length is (W E : W)/2."""
    return ufl.tr(I_R) / 2 * ufl.Identity(3) - I_R


def of_mass_centre(rate, W, inertia):
    """The rate of y = r + R a from the rates of r and R."""
    return rate if inertia.offset is None else rate + W * inertia.offset


def kinetic_energy(r_t, W, inertia):
    """Kinetic energy per unit length."""
    y_t = of_mass_centre(r_t, W, inertia)
    turning = ufl.inner(W * euler_tensor(inertia.I_R), W)
    return (inertia.mass * ufl.dot(y_t, y_t) + turning + lateral(inertia.lateral, r_t, r_t)) / 2


def rate_work(rate, W_rate, q_m, inertia, test):
    """Virtual work rho A rate . delta y + (W_rate E) : delta R of accelerations, or of velocities for drag; y is the
    mass centre, whose rate is that of r and R."""
    dR = turned(q_m, test.q)
    turning = ufl.inner(W_rate * euler_tensor(inertia.I_R), dR)
    moved = (of_mass_centre(a, B, inertia) for a, B in ((rate, W_rate), (test.r, dR)))
    return inertia.mass * ufl.dot(*moved) + turning + lateral(inertia.lateral, rate, test.r)


def angular_momentum(q, W, inertia):
    """Per length, inertial: twice the axial vector of W E R^T, the sum over a, b of E_ab R_a x W_b."""
    B = directors(q) * euler_tensor(inertia.I_R) * W.T
    return ufl.as_vector([B[1, 2] - B[2, 1], B[2, 0] - B[0, 2], B[0, 1] - B[1, 0]])


def stress_work(before, after, section, viscosity, h, test):
    """Virtual work of the averaged stress on the strain variation of the test function, per unit length."""
    r_m, q_m, q_ms = ((b + a) / 2 for b, a in zip(before, after, strict=True))
    mean = (directors(before.q) + directors(after.q)) / 2
    de = section.R_R.T * (mean.T * test.r_s + turned(q_m, test.q).T * r_m)
    du = section.R_R.T * (2 * (conjugate_product(test.q, q_ms) + conjugate_product(q_m, test.q_s)))
    ends = list(zip(strains(before, section), strains(after, section), strict=True))
    averages, rates = [(b + a) / 2 for b, a in ends], [(a - b) / h for b, a in ends]
    n, m = law.damped(section.law, viscosity, averages, rates)
    return ufl.dot(n, de) + ufl.dot(m, du)


def strain_energy(line, section):
    """Strain energy per unit length."""
    return law.energy(section.law, *strains(line, section))


def viscous_loss(before, after, section, viscosity, h):
    """Energy that Kelvin-Voigt damping dissipates in a step, per unit length."""
    ends = zip(strains(before, section), strains(after, section), strict=True)
    return law.power(viscosity, *(a - b for b, a in ends)) / h
