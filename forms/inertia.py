"""The inertia terms of eq. (1), and a time step that conserves linear and angular momentum.

q rotates the reference configuration; vectors that rotate with a section therefore have components along the inertial
axes before that rotation ("reference components"): the angular velocity Om = 2 vec(conj(q) q_t) and the inertia of a
section, I_R = R_R diag(Jrho) R_R^T.

A step goes from `before` to `after` in the time h, with the trapezoidal rule for the velocities of the nodes,
r_t1 = 2 (r_1 - r_0)/h - r_t0 and the same for q. Stress is that of the averaged strains on the directors of the
averaged configuration, `middle`. With a constant vector a, the test functions phi_r = a, and phi_r = a x r_m with
phi = a, then give the exact balances of linear and angular momentum, whatever the directors, since
r_m x (r_t1 - r_t0) = (r x r_t)_1 - (r x r_t)_0.
"""

from collections import namedtuple

import ufl
from cosserat_fenicsx.forms import law
from cosserat_fenicsx.forms.equilibrium import balance, frame, strains
from cosserat_fenicsx.forms.rotation import conjugate_product, directors

#: At the points where inertia is integrated: rho A; I_R about the mass centre as a matrix; the mass centre a from the
#: axis in reference components, None on the axis (forms/eccentric.py); and the tangent at rest times the square root of
#: a mass that is part of rho A and does not move along it, None without one.
Inertia = namedtuple("Inertia", "mass I_R offset lateral", defaults=(None, None))


def lateral(direction, a, b):
    """Correction of the virtual work mass a . b where a mass does not move along a fixed `direction`, see `Inertia`."""
    return 0 if direction is None else -ufl.dot(direction, a) * ufl.dot(direction, b)


def angular_velocity(q, q_t):
    """Om = 2 vec(conj(q) q_t), reference components."""
    return 2 * conjugate_product(q, q_t)


def angular_momentum(q, q_t, inertia):
    """kappa per length, R I_R Om, inertial."""
    return directors(q) * (inertia.I_R * angular_velocity(q, q_t))


def rate_of_angular_momentum(R, Om, Om_t, inertia):
    """The rate of kappa = R I_R Om per length, inertial."""
    return R * (inertia.I_R * Om_t + ufl.cross(Om, inertia.I_R * Om))


def momentum(r_t, kappa, inertia, test):
    """Momenta times test functions, per unit length: rho A r_t . phi_r + kappa . phi. From r_tt and the rate of kappa
    instead: the virtual work of inertia."""
    both = inertia.mass * ufl.dot(r_t, test.phi_r) + ufl.dot(kappa, test.phi)
    return both + lateral(inertia.lateral, r_t, test.phi_r)


def kinetic_energy(r_t, Om, inertia):
    """Kinetic energy per unit length."""
    return (inertia.mass * ufl.dot(r_t, r_t) + ufl.dot(Om, inertia.I_R * Om) + lateral(inertia.lateral, r_t, r_t)) / 2


def strain_energy(motion, section):
    """Strain energy per unit length."""
    return law.energy(section.law, *strains(motion, section))


def averaged_stress(before, after, middle, section, viscosity, h, test):
    """The stress terms of eq. (1) over a step: elastic for the average strains of both ends, viscous for their
    differences over h."""
    T, ends = frame(middle, section), list(zip(strains(before, section), strains(after, section), strict=True))
    averages, rates = [(b + a) / 2 for b, a in ends], [(a - b) / h for b, a in ends]
    return balance(*(T * a for a in law.damped(section.law, viscosity, averages, rates)), middle, test)


def viscous_loss(before, after, section, viscosity, h):
    """Energy that Kelvin-Voigt damping dissipates in a step, per unit length."""
    ends = zip(strains(before, section), strains(after, section), strict=True)
    return h * law.power(viscosity, *((a - b) / h for b, a in ends))


def contact(motion, section, viscosity, rate):
    """(n, m) by the law and its viscous terms, inertial; `rate(a)` is the time derivative of an expression."""
    T, both = frame(motion, section), strains(motion, section)
    return tuple(T * a for a in law.damped(section.law, viscosity, both, [rate(a) for a in both]))
