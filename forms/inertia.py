"""The momentum terms of eq. (1), rho A r'' and the rate of kappa, and the step in time that conserves them.

q turns the reference frame; what it turns is therefore written with reference components, along the inertial axes at
rest: the angular velocity Om = 2 vec(conj(q) q_t) and the inertia of a section, I_R = R_R diag(Jrho) R_R^T.

A step goes from `before` to `after` in the time h, with the trapezoidal rule for the velocities of the nodes,
r_t1 = 2 (r_1 - r_0)/h - r_t0 and the same for q. Stress is that of the averaged strains on the directors of the
averaged configuration, `middle`. Tested with a x r_m and a constant a the step then gives the exact balances of linear and
angular momentum, since the sum over the step of r_m x (r_t1 - r_t0) is that of (r x r_t)_1 - (r x r_t)_0, whatever the
directors do.
"""

from collections import namedtuple

import ufl
from cosserat_fenicsx.forms.equilibrium import (
    balance,
    bending_and_torsion,
    frame,
    scaled,
    stretch_and_shear,
)
from cosserat_fenicsx.forms.rotation import conjugate_product, directors

#: rho A, and I_R as a matrix, at the points where inertia is integrated.
Inertia = namedtuple("Inertia", "mass I_R")
#: Kelvin-Voigt stiffness: Kt = (GAt1, GAt2, EAt), Jt = (EIt1, EIt2, GJt), for the rates of the material strains.
Viscosity = namedtuple("Viscosity", "Kt Jt")


def angular_velocity(q, q_t):
    """Om = 2 vec(conj(q) q_t), reference components."""
    return 2 * conjugate_product(q, q_t)


def angular_momentum(q, q_t, inertia):
    """kappa per length, R I_R Om, inertial."""
    return directors(q) * (inertia.I_R * angular_velocity(q, q_t))


def momentum(r_t, kappa, inertia, test):
    """Momenta per length, tested: rho A r_t . phi_r + kappa . phi."""
    return inertia.mass * ufl.dot(r_t, test.phi_r) + ufl.dot(kappa, test.phi)


def kinetic_energy(r_t, Om, inertia):
    """Per length."""
    return (inertia.mass * ufl.dot(r_t, r_t) + ufl.dot(Om, inertia.I_R * Om)) / 2


def strain_energy(motion, section):
    """Per length."""
    e, u = stretch_and_shear(motion, section), bending_and_torsion(motion, section)
    return (ufl.dot(e, scaled(section.K, e)) + ufl.dot(u, scaled(section.J, u))) / 2


def averaged_stress(before, after, middle, section, viscosity, h, test):
    """The stress terms of eq. (1) over a step: strains of both ends averaged, and their differences over h damped."""
    T = frame(middle, section)
    n, m = (
        T * (scaled(K, (b + a) / 2) + scaled(Kt, (a - b) / h))
        for K, Kt, b, a in (
            (section.K, viscosity.Kt, stretch_and_shear(before, section), stretch_and_shear(after, section)),
            (section.J, viscosity.Jt, bending_and_torsion(before, section), bending_and_torsion(after, section)),
        )
    )
    return balance(n, m, middle, test)


def viscous_loss(before, after, section, viscosity, h):
    """What Kelvin-Voigt damping takes in a step, per length."""
    total = 0
    for Kt, strain in ((viscosity.Kt, stretch_and_shear), (viscosity.Jt, bending_and_torsion)):
        rate = (strain(after, section) - strain(before, section)) / h
        total += h * ufl.dot(rate, scaled(Kt, rate))
    return total


def contact(motion, section, viscosity, rate):
    """(n, m), eqs. (2)-(3) with their viscous terms, inertial; `rate(a)` is the time derivative of an expression."""
    T, e, u = frame(motion, section), stretch_and_shear(motion, section), bending_and_torsion(motion, section)
    return T * (scaled(section.K, e) + scaled(viscosity.Kt, rate(e))), T * (
        scaled(section.J, u) + scaled(viscosity.Jt, rate(u))
    )
