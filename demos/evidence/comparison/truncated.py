"""The truncated energy to which the MCRE converges under refinement, in a plane; a reconstruction.

The MCRE (Liu, Cao, Rosing, Wang & Richardson, Int. J. Solids Struct. 44 (2007) 7785) keeps an element's energy to
fourth order in displacements and rotations that are measured from the undeformed frame. Here: the rod's exact strains
v_3 - 1 = (1 + u') cos(phi) + w' sin(phi) - 1 and v_1 = w' cos(phi) - (1 + u') sin(phi), squared and truncated after
that order. The result is not objective: a rigid rotation by phi has the energy -EA phi^6/8 and terms of higher order.

u is the axial, w the transverse displacement, phi the rotation; _s is d/ds. Material stiffness EA, GA, EI.
"""


def stretch_squared(u_s, w_s, phi):
    """(v_3 - 1)^2 to fourth order."""
    bow = w_s * phi - phi**2 / 2
    return u_s**2 + 2 * u_s * bow + bow**2 - u_s**2 * phi**2


def shear_squared(u_s, w_s, phi):
    """v_1^2 to fourth order."""
    gamma = w_s - phi
    return gamma**2 - 2 * gamma * u_s * phi + u_s**2 * phi**2 + 2 * gamma * (phi**3 / 6 - w_s * phi**2 / 2)


def energy(u_s, w_s, phi, phi_s, EA, GA, EI):
    """W = (EA g_1 + GA g_2 + EI phi'^2)/2 per unit of reference length."""
    return (EA * stretch_squared(u_s, w_s, phi) + GA * shear_squared(u_s, w_s, phi) + EI * phi_s**2) / 2
