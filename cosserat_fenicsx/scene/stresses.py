"""Stresses on the outline of sections, by Saint-Venant's theory of tension, bending, torsion and flexure.

Shear stresses are exact for long rods: torsion and flexure of a rectangle by their series (Timoshenko & Goodier, Theory
of Elasticity, 3rd ed., articles 109 and 124), flexure of circle and tube by Love's solution (Mathematical Theory of
Elasticity, 4th ed., article 230). They are of the same theory as Cowper's shear factors. Stresses are per area of the
reference; the small effect of the curvature of a curved rod on its section is left out, and so are stresses near point
loads and supports.
"""

import functools
from collections import namedtuple

import numpy as np

#: Stresses at sections (...), Pa. von_mises: the largest on the outline, sqrt(sigma^2 + 3 tau^2); axial_max, axial_min:
#: the largest and the smallest normal stress sigma of the section, tension positive.
Stress = namedtuple("Stress", "von_mises axial_max axial_min")

# Iterations of Newton's method for the largest von Mises stress around a circle.
_ITERATIONS = 6
# Rows of forces and moments whose stresses at all fibres are in the processor's cache.
_BLOCK = 512
# Intervals of every side of a rectangle, and terms of its series.
_INTERVALS, _TERMS = 24, 300


class Fibres:
    """Places on the outline of a section, and the stresses there per force and moment.

    Args:
        normal: (places, 3) normal stress per contact force along d_3 (1/m^2), and per moment about d_1 and d_2 (1/m^3).
        shear: (places, 3) shear stress along the outline, counterclockwise, per contact force along d_1 and d_2
            (1/m^2), and per moment about d_3 (1/m^3).
    """

    def __init__(self, normal, shear):
        self.normal, self.shear = np.asarray(normal), np.asarray(shear)

    def stress(self, force, moment):
        """The `Stress` for contact forces (..., 3), N, and moments (..., 3), N m, along d_1, d_2, d_3."""
        shape, rows = force.shape[:-1], np.concatenate([force, moment], axis=-1).reshape(-1, 6)
        parts = [self._stress(rows[first : first + _BLOCK]) for first in range(0, max(len(rows), 1), _BLOCK)]
        return Stress(*np.concatenate(parts, axis=1).reshape(3, *shape))

    def _stress(self, rows):
        sigma, tau = rows[:, 2:5] @ self.normal.T, rows[:, [0, 1, 5]] @ self.shear.T
        most, least = sigma.max(axis=1), sigma.min(axis=1)
        return np.array([np.sqrt((np.square(sigma, out=sigma) + 3 * np.square(tau, out=tau)).max(axis=1)), most, least])


def round_stress(outer, inner, nu, force, moment):
    """The `Stress` of a tube or, with `inner` = 0, of a circle, on its outer circumference.

    At the angle theta from d_1, sigma = n_3/A + R (m_1 sin theta - m_2 cos theta)/I, and
    tau = R m_3/J + c (n_2 cos theta - n_1 sin theta)/I.

    Args:
        outer, inner: radii, m; nu: Poisson's ratio.
        force, moment: (..., 3), N and N m, along d_1, d_2, d_3.
    """
    A, I = np.pi * (outer**2 - inner**2), np.pi * (outer**4 - inner**4) / 4
    c = ((3 + 2 * nu) * inner**2 + (1 + 2 * nu) * outer**2) / (4 * (1 + nu))
    n, m = force, moment
    sigma = n[..., 2] / A, -m[..., 1] * (outer / I), m[..., 0] * (outer / I)
    tau = m[..., 2] * (outer / (2 * I)), n[..., 1] * (c / I), -n[..., 0] * (c / I)
    bending = np.hypot(sigma[1], sigma[2])
    return Stress(_largest_around(sigma, tau), sigma[0] + bending, sigma[0] - bending)


def _largest_around(sigma, tau):
    """The maximum over theta of sqrt(sigma^2 + 3 tau^2), each given by its mean and factors of cos and sin.

    The square is c + a cos x + b cos(2 (x - y)) with a, b >= 0, x from the largest place of the first wave and y, in
    [-pi/2, pi/2], the nearest largest place of the second one. Its only maximum from 0 to y is the largest of all.
    """
    mean, first_cos, first_sin, second_cos, second_sin = sum(
        factor * np.array([p * p + (q * q + r * r) / 2, 2 * p * q, 2 * p * r, (q * q - r * r) / 2, q * r])
        for factor, (p, q, r) in ((1.0, sigma), (3.0, tau))
    )
    a, b = np.hypot(first_cos, first_sin), np.hypot(second_cos, second_sin)
    y = np.arctan2(second_sin, second_cos) / 2 - np.arctan2(first_sin, first_cos)
    y -= np.pi * np.round(y / np.pi)
    y, x = np.abs(y), np.abs(y) * 4 * b / np.maximum(a + 4 * b, 1e-300)
    for _ in range(_ITERATIONS):
        slope = 2 * b * np.sin(2 * (y - x)) - a * np.sin(x)
        bend = a * np.cos(x) + 4 * b * np.cos(2 * (y - x))
        x = np.clip(x + slope / np.maximum(bend, 0.01 * (a + b) + 1e-300), 0.0, y)
    return np.sqrt(mean + a * np.cos(x) + b * np.cos(2 * (y - x)))


@functools.lru_cache(maxsize=64)
def rectangle_fibres(width, height, nu, torsion):
    """The `Fibres` of a rectangle: its corners and places of all sides. Between them von Mises stresses may be larger
    by 0.2 %.

    Args:
        width, height: along d_1 and d_2, m; nu: Poisson's ratio; torsion: Saint-Venant's constant, m^4.
    """
    a, b, along = width / 2, height / 2, np.linspace(-1, 1, _INTERVALS + 1)
    A, I1, I2 = 4 * a * b, 4 * a * b**3 / 3, 4 * b * a**3 / 3
    across, beside, twist = _side(a, b, nu, along)
    right = np.column_stack([across / I2, beside / I1, twist / torsion])
    across, beside, twist = _side(b, a, nu, along)
    top = np.column_stack([-beside / I2, -across / I1, twist / torsion])
    x = np.concatenate([np.full_like(along, a), a * along])
    y = np.concatenate([b * along, np.full_like(along, b)])
    normal = np.column_stack([np.full_like(x, 1 / A), y / I1, -x / I2])
    shear = np.concatenate([right, top])
    # stresses at opposite places, where x, y and the direction along the outline are reversed
    return Fibres(np.concatenate([normal, normal * [1, -1, -1]]), np.concatenate([shear, shear * [-1, -1, 1]]))


def _side(a, b, nu, along):
    """Shear stresses along the side x = a, towards positive y, of a rectangle |x| <= a, |y| <= b.

    Args:
        along: y/b.

    Returns:
        Three arrays: per force along x, times the second moment of area for its bending (m^2); the same for a force
        along y; per moment, times the torsion constant (m).
    """
    y, n = b * along, np.arange(1, _TERMS + 1)[:, None]
    poisson, odd = nu / (1 + nu), 2 * n - 1
    waves = (-1.0) ** n / n**2 * np.sin(n * np.pi * along) * np.tanh(n * np.pi * a / b)
    across = poisson * 2 * b**2 / np.pi**2 * waves.sum(axis=0)
    cosh = _cosh_ratio(n * np.pi * y / a, n * np.pi * b / a) / n**2
    beside = (b**2 - y**2) / 2 + poisson * a**2 * (1 / 3 - 2 / np.pi**2 * cosh.sum(axis=0))
    cosh = _cosh_ratio(odd * np.pi * y / (2 * a), odd * np.pi * b / (2 * a)) / odd**2
    twist = 2 * a - 16 * a / np.pi**2 * cosh.sum(axis=0)
    corner = np.abs(along) == 1  # no shear stress; the series converge slowly there
    return tuple(np.where(corner, 0.0, values) for values in (across, beside, twist))


def _cosh_ratio(x, at_end):
    """cosh(x)/cosh(at_end) for |x| <= at_end, however large."""
    return np.exp(np.abs(x) - at_end) * (1 + np.exp(-2 * np.abs(x))) / (1 + np.exp(-2 * at_end))
