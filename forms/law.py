"""The constitutive law of a section: its contact force and moment from its six strains, and back.

All components are material: the strains e = v - v_0 and k = u - u_0 from those without stress (forms/equilibrium.py),
the contact force n and the contact moment m. A law is three linear functions, which apply to values of strain and
stress and to their changes alike:

    force(e, k)    n from the strains
    moment(n, k)   m from n and k
    strain(n, k)   e from n and k

The last two are the law partly inverted, as the mixed formulation and the determinate models need it.
"""

from collections import namedtuple

import ufl

# Where only the signs of the second variation's eigenvalues matter, the stiffness against stretch and shear may be
# bounded from above; the bound is at least this times the contact force.
_STIFF_OVER_FORCE = 1e4
# Contact forces below this, in EI/L^2, are treated as this value.
_NO_FORCE = 1e-6


def stiffness_for(force, K_inv):
    """The smallest K that may replace the true one in a second variation at a contact force of this size without
    changing the signs of its eigenvalues: c |n|, in series with the true stiffness and so never above it. Takes numbers
    or UFL.

    Along a straight rod with the axial force N, w its displacement across and phi its rotation, the second variation is
    K g^2 + 2 N g phi + N phi^2 with g = w' - phi. After elimination of g it is that of the axial force N (1 - N/K): it
    is indefinite under a tension N > K, and a compression |N| is overestimated by the relative amount 1/c.
    """
    raised = _STIFF_OVER_FORCE * force
    return raised / (1 + raised * K_inv)


def scaled(D, a):
    """diag(D) a, the diagonal D given as a vector."""
    return ufl.as_vector([D[i] * a[i] for i in range(3)])


class DiagonalLaw(namedtuple("DiagonalLaw", "K K_inv J")):
    """Eqs. (2)-(3): n = K e and m = J k, with K = (GA1, GA2, EA), its inverse, and J = (EI1, EI2, GJ), vectors of UFL.

    K_inv is zero where K is infinite.
    """

    def force(self, e, k):
        """n of the strains."""
        return scaled(self.K, e)

    def moment(self, n, k):
        """m where n is known."""
        return scaled(self.J, k)

    def strain(self, n, k):
        """e where n is known."""
        return scaled(self.K_inv, n)

    def raised(self, force):
        """The law with K raised to at least `stiffness_for` a contact force of this size."""
        pairs = zip(range(3), [stiffness_for(force, self.K_inv[i]) for i in range(3)], strict=True)
        return self._replace(K=ufl.as_vector([ufl.max_value(self.K[i], least) for i, least in pairs]))


class CoupledLaw(namedtuple("CoupledLaw", "A A_inv S G")):
    """(n, m) = [[A, B], [B^T, D]] (e, k), by 3 x 3 matrices of UFL.

    With G = A^-1 B and the Schur complement S = D - B^T A^-1 B it reads n = A (e + G k) and m = G^T n + S k: -G k is
    the strain of a section that is bent and twisted without a contact force, and S its bending and torsional stiffness
    then. With this choice A alone needs to be bounded where only the signs of the second variation's eigenvalues
    matter.
    """

    def force(self, e, k):
        """n of the strains."""
        return self.A * (e + self.G * k)

    def moment(self, n, k):
        """m where n is known."""
        return self.G.T * n + self.S * k

    def strain(self, n, k):
        """e where n is known."""
        return self.A_inv * n - self.G * k

    def raised(self, force):
        """The law with A replaced by its `stiffness_for` this contact force c |n|, where c |n| > tr(A)/3."""
        least = _STIFF_OVER_FORCE * ufl.max_value(force, _NO_FORCE)
        in_series = ufl.inv(self.A_inv + ufl.Identity(3) / least)
        higher = ufl.gt(3 * least, ufl.tr(self.A))
        rows = [[ufl.conditional(higher, in_series[i, j], self.A[i, j]) for j in range(3)] for i in range(3)]
        return self._replace(A=ufl.as_matrix(rows))


def stress(law, e, k):
    """(n, m) of the strains."""
    n = law.force(e, k)
    return n, law.moment(n, k)


def energy(law, e, k):
    """Strain energy per length."""
    return power(law, e, k) / 2


def power(law, e, k):
    """e . n + k . m per unit length: of strain rates, the power that a viscous law dissipates."""
    n, m = stress(law, e, k)
    return ufl.dot(e, n) + ufl.dot(k, m)


def damped(law, viscosity, strains, rates):
    """(n, m): the elastic law of the strains (e, k) plus the viscous law (Kelvin-Voigt) of their rates."""
    return tuple(a + b for a, b in zip(stress(law, *strains), stress(viscosity, *rates), strict=True))
