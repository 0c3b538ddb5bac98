"""Eq. (1) at the end of a step in time, with the accelerations of the nodes there.

Angular velocities Om and their rates have reference components, as in `inertia`. What a step turns a section by is the
rotation vector theta with q_1 = q_0 exp(theta): so a rotation at constant Om is exact, however long the step.
"""

import ufl
from cosserat_fenicsx.forms.equilibrium import balance, bending_and_torsion, frame, stretch_and_shear
from cosserat_fenicsx.forms.rotation import conjugate_product

# Below this square of tan(|theta|/2) the series is exact to the last digit.
_SMALL = 1e-4


def rotation_vector(q0, q1):
    """theta, reference components, with q1 = q0 exp(theta) for |theta| < pi; the lengths of q0 and q1 do not matter."""
    t = conjugate_product(q0, q1) / ufl.dot(q0, q1)  # tan(|theta|/2) along theta
    y = ufl.dot(t, t)
    large = ufl.sqrt(ufl.max_value(y, _SMALL))
    series = 1 - y / 3 + y**2 / 5 - y**3 / 7
    return 2 * ufl.conditional(ufl.lt(y, _SMALL), series, ufl.atan(large) / large) * t


def rate_of_momentum(r_tt, Om, Om_t, R, inertia, test):
    """rho A r'' and the rate of kappa, per length, tested."""
    turned = inertia.I_R * Om_t + ufl.cross(Om, inertia.I_R * Om)
    return inertia.mass * ufl.dot(r_tt, test.phi_r) + ufl.dot(R * turned, test.phi)


def momentum(r_t, Om, R, inertia, test):
    """Momenta per length, tested."""
    return inertia.mass * ufl.dot(r_t, test.phi_r) + ufl.dot(R * (inertia.I_R * Om), test.phi)


def strains(motion, section):
    """The six material strains v - v_R and u - u_R."""
    return ufl.as_vector([*stretch_and_shear(motion, section), *bending_and_torsion(motion, section)])


def stress(motion, section, viscosity, rates, test):
    """The stress terms of eq. (1), eqs. (2)-(3) with their viscous terms for given rates of the six strains."""
    T, e = frame(motion, section), strains(motion, section)
    n, m = (
        T * ufl.as_vector([D[i] * e[k + i] + Dt[i] * rates[k + i] for i in range(3)])
        for k, D, Dt in ((0, section.K, viscosity.Kt), (3, section.J, viscosity.Jt))
    )
    return balance(n, m, motion, test)
