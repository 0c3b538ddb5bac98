"""Eq. (1) of the paper in a plane, on the centreline r = (r_1, r_2) and the angle theta.

The plane is spanned by two inertial unit vectors e_1, e_2 and has the normal e_3 = e_1 x e_2. Vectors have components
in (e_1, e_2, e_3), so that the forms of `equilibrium` apply unchanged: components that vanish in a plane are UFL zeros
and cost nothing. theta is the rotation about e_3 from the reference. One principal axis of the section is the normal;
the directors are (a, e_3, t) with the tangent t and a = e_3 x t, and the law follows that order: J = (EI about a, EI
about e_3, GJ). A law that couples strains is admissible if it does not couple stretch, shear along a and bending about
e_3 to the other three.

Motions out of the plane, small displacements w along e_3 and small rotations about e_1 and e_2, decouple where all
loads lie in the plane (moments along e_3); a separate second variation decides their stability.
"""

import ufl
from cosserat_fenicsx.forms.equilibrium import Motion, Section, VirtualMotion
from cosserat_fenicsx.forms.point import NONE, Point


def in_plane(a):
    """The vector a_1 e_1 + a_2 e_2 from two components."""
    return ufl.as_vector([a[0], a[1], 0])


def along_normal(a):
    """The vector a e_3."""
    return ufl.as_vector([0, 0, a])


def rotation_matrix(theta):
    """The rotation by theta about e_3."""
    c, s = ufl.cos(theta), ufl.sin(theta)
    return ufl.as_matrix([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def section_of(law, t_R, v_R):
    """The section from a law in the order (a, e_3, t), the tangent t_R and the strain v_R = (shear, stretch).

    v_R is the strain of the interpolated reference curve, (0, 1) on the exact curve: the discrete reference is then
    free of stress.
    """
    R_R = ufl.as_matrix([[-t_R[1], 0, t_R[0]], [t_R[0], 0, t_R[1]], [0, 1, 0]])
    return Section(law, R_R, ufl.as_vector([v_R[0], 0, v_R[1]]))


def motion_of(r_s, theta, theta_s):
    """The motion of r and theta."""
    return Motion(in_plane(r_s), rotation_matrix(theta), along_normal(theta_s))


def point_of(U, U_s, *, rest, frame, r_t=NONE, omega=NONE):
    """The `Point` of the three components (r_1, r_2, theta), vectors in (e_1, e_2, e_3); arguments as in `Point`."""
    return Point(
        in_plane(U), in_plane(U_s), rotation_matrix(U[2]), along_normal(U[2]), curvature=along_normal(U_s[2]),
        rest=rest, frame=frame, r_t=r_t, omega=omega,
    )  # fmt: skip


def tests_of(phi, phi_s):
    """Test functions from the components (phi_1, phi_2, phi_theta)."""
    return VirtualMotion(in_plane(phi), along_normal(phi[2]), in_plane(phi_s), along_normal(phi_s[2]))


def sideways_tests_of(psi, psi_s):
    """Directions out of the plane from the components (w, phi_1, phi_2)."""
    return VirtualMotion(
        along_normal(psi[0]),
        ufl.as_vector([psi[1], psi[2], 0]),
        along_normal(psi_s[0]),
        ufl.as_vector([psi_s[1], psi_s[2], 0]),
    )
