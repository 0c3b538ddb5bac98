"""The inertia terms of eq. (1), and a time step that conserves linear and angular momentum.

q rotates the reference configuration; vectors that rotate with a section therefore have components along the inertial
axes before that rotation ("reference components"): the angular velocity Om = 2 vec(conj(q) q_t) and the inertia of a
section, I_R = R_R diag(Jrho) R_R^T.

A step goes from `before` to `after` in the time h, with the trapezoidal rule for the velocities of the nodes,
r_t1 = 2 (r_1 - r_0)/h - r_t0 and the same for q. Stress is that of the averaged strains on the directors of the
averaged configuration, `middle`. With a constant vector a, the test functions phi_r = a, and phi_r = a x r_m with
phi = a, then give the exact balances of linear and angular momentum, whatever the directors, since
r_m x (r_t1 - r_t0) = (r x r_t)_1 - (r x r_t)_0.

Where the mass centre y = r + z, z = R a, lies off the axis r, the linear momentum per length is p = rho A y_t, and the
angular momentum about the axis z x p + kappa, with kappa that about the mass centre. Besides their rates the balance of
moments about the moving axis has r_t x p = -rho A z_t x r_t. The momentum scheme carries the rates W of the directors R
from step to step by the trapezoidal rule, W_1 = 2 (R_1 - R_0)/h - W_0. That of y is then the same, and for a step

    (y_m - r_m) x (p_1 - p_0)/h = (z_1 x p_1 - z_0 x p_0)/h - rho A (z_1 - z_0)/h x (r_1 - r_0)/h,

so that both momenta are exact, as above with y in place of r.
"""

from collections import namedtuple

import ufl
from cosserat_fenicsx.forms import law
from cosserat_fenicsx.forms.equilibrium import balance, frame, strains
from cosserat_fenicsx.forms.rotation import conjugate_product, directors, turned

#: At the points where inertia is integrated: rho A; I_R about the mass centre as a matrix; the mass centre a from the
#: axis in reference components, None on the axis; and the tangent at rest times the square root of
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


def arm(q, inertia):
    """z = R a, for a unit quaternion; None on the axis."""
    return None if inertia.offset is None else directors(q) * inertia.offset


def arm_rate(q, q_t, inertia):
    """z_t from the rates of q; with the average of two q and their difference over h that of two z over h, exactly."""
    return None if inertia.offset is None else turned(q, q_t) * inertia.offset


def momentum(r_t, kappa, inertia, test, z=None, z_t=None):
    """Momenta times test functions, per unit length: p . phi_r + (z x p + kappa) . phi. From r_tt, z_tt and the rate of
    kappa instead: the virtual work of inertia."""
    if z_t is None:
        both = inertia.mass * ufl.dot(r_t, test.phi_r) + ufl.dot(kappa, test.phi)
    else:
        p = inertia.mass * (r_t + z_t)
        both = ufl.dot(p, test.phi_r) + ufl.dot(ufl.cross(z, p) + kappa, test.phi)
    return both + lateral(inertia.lateral, r_t, test.phi_r)


def of_moving_axis(r_t, z_t, inertia, test):
    """The term r_t x p of the balance of moments times the test function, per unit length."""
    return inertia.mass * ufl.dot(ufl.cross(r_t, z_t), test.phi)


def kinetic_energy(r_t, Om, inertia, z_t=None):
    """Kinetic energy per unit length."""
    y_t = r_t if z_t is None else r_t + z_t
    return (inertia.mass * ufl.dot(y_t, y_t) + ufl.dot(Om, inertia.I_R * Om) + lateral(inertia.lateral, r_t, r_t)) / 2


def strain_energy(motion, section):
    """Strain energy per unit length."""
    return law.energy(section.law, *strains(motion, section))


def averaged_stress(before, after, middle, section, viscosity, h, test):
    """The stress terms of eq. (1) over a step: elastic for mean strains, viscous for differences over h."""
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
