"""Eq. (1) at the end of a step in time, with the accelerations of the nodes there.

Angular velocities Om and their rates have components in the reference frame, as in `inertia`. The rotation of a section
over a step is the rotation vector theta with q_1 = q_0 exp(theta), so that a rotation at constant Om is exact for any
length of the step.
"""

import ufl
from cosserat_fenicsx.forms import equilibrium, law
from cosserat_fenicsx.forms.equilibrium import balance, frame
from cosserat_fenicsx.forms.rotation import conjugate_product

# Where tan(|theta|/2)^2 is below this, the series is exact to rounding.
_SMALL = 1e-4


def rotation_vector(q0, q1):
    """theta in reference components with q1 = q0 exp(theta), |theta| < pi, for q0 and q1 of any length."""
    t = conjugate_product(q0, q1) / ufl.dot(q0, q1)  # tan(|theta|/2) along theta
    y = ufl.dot(t, t)
    large = ufl.sqrt(ufl.max_value(y, _SMALL))
    series = 1 - y / 3 + y**2 / 5 - y**3 / 7
    return 2 * ufl.conditional(ufl.lt(y, _SMALL), series, ufl.atan(large) / large) * t


def strains(motion, section):
    """The six material strains v - v_0 and u - u_0."""
    e, k = equilibrium.strains(motion, section)
    return ufl.as_vector([*e, *k])


def stress(motion, section, viscosity, rates, test):
    """Virtual work of n and m in eq. (1), with the viscous terms of the law for given rates of the six strains."""
    T, both = frame(motion, section), equilibrium.strains(motion, section)
    rates = [ufl.as_vector([rates[k + i] for i in range(3)]) for k in (0, 3)]
    return balance(*(T * a for a in law.damped(section.law, viscosity, both, rates)), motion, test)
