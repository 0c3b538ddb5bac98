"""Three-dimensional elasticity of the St Venant-Kirchhoff solid, at finite displacements, on the reference
configuration.

H = Grad(u), F = I + H, E = (F^T F - I)/2 (Green-Lagrange), S = lambda tr(E) I + 2 mu E (second Piola-Kirchhoff).
"""

import ufl


def green_lagrange(H):
    """E = (H + H^T + H^T H)/2."""
    return ufl.sym(H) + H.T * H / 2


def change(H, dH):
    """The variation of E for a variation dH of H: sym(F^T dH)."""
    return ufl.sym(dH + H.T * dH)


def stress(E, lame):
    """S for the Lame constants (lambda, mu)."""
    return lame[0] * ufl.tr(E) * ufl.Identity(3) + 2 * lame[1] * E


def virtual_work(H, test, lame):
    """S : dE, per unit of reference volume; `test` is Grad of the virtual displacement."""
    return ufl.inner(stress(green_lagrange(H), lame), change(H, test))


def carried_stress(H, before, lame):
    """The stress by linear extrapolation over the Newton step from `before` to H, S(before) + C : dE.

    E is quadratic in H, so that this is the stress of E minus half the square of the step.
    """
    step = H - before
    return stress(green_lagrange(H) - step.T * step / 2, lame)


def carried_stress_tangent(H, before, trial, test, lame):
    """Tangent of `virtual_work` with the carried stress in its geometric part: mixed-integration-point Newton.

    Magisano, Leonetti & Garcea, Int. J. Numer. Methods Eng. 109 (2017) 1237: the Newton iterates are those of a
    formulation with the stress as an additional unknown, the converged solution is that of the displacement
    formulation. With before = H it is Newton's method.
    """
    geometric = ufl.inner(carried_stress(H, before, lame), ufl.sym(trial.T * test))
    return ufl.inner(stress(change(H, trial), lame), change(H, test)) + geometric


def eccentric_traction(x, area, inertia, eccentricity):
    """Dead axial traction of unit force and of the moment `eccentricity` about the centroid, linear over the end face.
    x: coordinate across the face, from the centroid, in the direction of the eccentricity; area, inertia: of the
    face."""
    return 1 / area + eccentricity * x / inertia
