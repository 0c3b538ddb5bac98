"""The inertia of sections whose mass centre y = r + z, z = R a, lies off the axis r.

The linear momentum per length is p = rho A y_t, and the angular momentum about the axis z x p + kappa, with kappa that
about the mass centre. Besides their rates the balance of moments about the moving axis has r_t x p = -rho A z_t x r_t.
The momentum scheme carries the rates W of the directors R from step to step by the trapezoidal rule, W_1 = 2 (R_1 -
R_0)/h - W_0. That of y is then the same, and for a step

    (y_m - r_m) x (p_1 - p_0)/h = (z_1 x p_1 - z_0 x p_0)/h - rho A (z_1 - z_0)/h x (r_1 - r_0)/h,

so that both momenta are exact, as in forms/inertia.py with y in place of r.
"""

import ufl
from cosserat_fenicsx.forms.energy import turned
from cosserat_fenicsx.forms.inertia import lateral
from cosserat_fenicsx.forms.rotation import directors


def arm(q, inertia):
    """z = R a, for a unit quaternion."""
    return directors(q) * inertia.offset


def arm_rate(q, q_t, inertia):
    """z_t from the rates of q; with the average of two q and their difference over h that of two z over h, exactly."""
    return turned(q, q_t) * inertia.offset


def momentum(r_t, z, z_t, kappa, inertia, test):
    """Momenta times test functions, per unit length: p . phi_r + (z x p + kappa) . phi. From r_tt, z_tt and the
    rate of kappa instead: the virtual work of inertia."""
    p = inertia.mass * (r_t + z_t)
    both = ufl.dot(p, test.phi_r) + ufl.dot(ufl.cross(z, p) + kappa, test.phi)
    return both + lateral(inertia.lateral, r_t, test.phi_r)


def of_moving_axis(r_t, z_t, inertia, test):
    """The term r_t x p of the balance of moments times the test function, per unit length."""
    return inertia.mass * ufl.dot(ufl.cross(r_t, z_t), test.phi)


def kinetic_energy(r_t, z_t, Om, inertia):
    """Kinetic energy per unit length."""
    y_t = r_t + z_t
    return (inertia.mass * ufl.dot(y_t, y_t) + ufl.dot(Om, inertia.I_R * Om) + lateral(inertia.lateral, r_t, r_t)) / 2
