"""Stresses of sections, by Saint-Venant's theory of tension, bending, torsion and flexure.

Shear stresses are exact for long rods, inside the section and on its outline: torsion and flexure of a rectangle by
their series (Timoshenko & Goodier, Theory of Elasticity, 3rd ed., articles 109 and 124), flexure of circle and tube by
Love's solution (Mathematical Theory of Elasticity, 4th ed., article 230). They are of the same theory as Cowper's shear
factors. Stresses are per area of the reference; the small effect of the curvature of a curved rod on its section is
left out, and so are stresses near point loads and supports.
"""

import functools
from collections import namedtuple

import numpy as np

from cosserat_fenicsx.quantities import span_in_words


class Stress(namedtuple("Stress", "von_mises axial_max axial_min")):
    """Stresses at sections (...), Pa. von_mises: the largest of the section, sqrt(sigma^2 + 3 tau^2); axial_max,
    axial_min: the largest and the smallest normal stress sigma of the section, tension positive. `print` shows the
    first and the last."""

    __slots__ = ()

    def __str__(self):
        return ", ".join(f"{name} {span_in_words(np.ravel(x), 'Pa')}" for name, x in self._asdict().items())


# Newton iterations for the largest von Mises stress around a circle; intervals along the radius.
_ITERATIONS, _RINGS = 6, 8
# Forces and moments per block: their stresses at all fibres fit into the processor's cache.
_BLOCK = 256
# Sample intervals per side of a rectangle, extra samples near each corner, stride of the samples inside.
_INTERVALS, _NEAR, _INSIDE = 24, 12, 3
# Terms of the series of a rectangle.
_TERMS = 300


class Fibres:
    """Sample points of a section, and the stresses there per unit of force and moment.

    Args:
        normal: (points, 3) normal stress per contact force along d_3 (1/m^2), and per moment about d_1 and d_2 (1/m^3).
        shear: (2, points, 3) shear stress along two directions at right angles, per contact force along d_1 and d_2
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
        sigma = rows[:, 2:5] @ self.normal.T
        most, least = sigma.max(axis=1), sigma.min(axis=1)
        square = np.square(sigma, out=sigma)
        for direction in self.shear:
            tau = rows[:, [0, 1, 5]] @ direction.T
            square += 3 * np.square(tau, out=tau)
        return np.array([np.sqrt(square.max(axis=1)), most, least])


def round_stress(outer, inner, nu, force, moment):
    """The `Stress` of a tube (radii outer, inner, m) or, with `inner` = 0, of a circle, under force and moment (...,
    3), N and N m, along d_1, d_2, d_3. Von Mises stresses are taken on rings from the inner radius, or the centre, to
    the outer one; of a circle they may be larger by 0.3 % between them.

    At the angle theta from d_1 and the radius r, sigma = n_3/A + r (m_1 sin theta - m_2 cos theta)/I, tau_theta = r
    m_3/J + c (n_2 cos theta - n_1 sin theta)/I and tau_r = e (n_1 cos theta + n_2 sin theta)/I.
    """
    A, I = np.pi * (outer**2 - inner**2), np.pi * (outer**4 - inner**4) / 4
    n, m = force[..., None], moment[..., None]  # the last axis: rings
    r = np.linspace(inner, outer, _RINGS + 1)
    bore = (outer * inner / r) ** 2 if inner else 0.0
    c = ((3 + 2 * nu) * (outer**2 + inner**2 + bore) - (1 - 2 * nu) * r**2) / (8 * (1 + nu))
    e = (3 + 2 * nu) * (outer**2 + inner**2 - bore - r**2) / (8 * (1 + nu))
    sigma = n[..., 2, :] / A, -m[..., 1, :] * (r / I), m[..., 0, :] * (r / I)
    around = m[..., 2, :] * (r / (2 * I)), n[..., 1, :] * (c / I), -n[..., 0, :] * (c / I)
    outwards = 0.0, n[..., 0, :] * (e / I), n[..., 1, :] * (e / I)
    bending = np.hypot(moment[..., 0], moment[..., 1]) * (outer / I)
    axial = force[..., 2] / A
    return Stress(_largest_around(sigma, around, outwards).max(axis=-1), axial + bending, axial - bending)


def _largest_around(sigma, *taus):
    """The maximum over theta of sqrt(sigma^2 + 3 sum of tau^2), each given by its mean and factors of cos and sin. The
    square is c + a cos x + b cos(2 (x - y)) with a, b >= 0, x from the largest place of the first wave and y, in
    [-pi/2, pi/2], the nearest largest place of the second one. Its only maximum from 0 to y is the largest of all."""
    mean, first_cos, first_sin, second_cos, second_sin = sum(
        factor
        * np.array(np.broadcast_arrays(p * p + (q * q + r * r) / 2, 2 * p * q, 2 * p * r, (q * q - r * r) / 2, q * r))
        for factor, (p, q, r) in ((1.0, sigma), *((3.0, tau) for tau in taus))
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


@functools.lru_cache(maxsize=512)  # all nodes of a tapering rod
def rectangle_fibres(width, height, nu, torsion):
    """The `Fibres` of a rectangle (width, height along d_1 and d_2, m; torsion: Saint-Venant's constant, m^4): corners,
    points on all sides, denser near the corners, and points inside. Between them von Mises stresses may be larger by
    0.7 % (sides of 1:1 to 1:300, nu from 0 to 0.49), commonly 0.1 %."""
    a, b = width / 2, height / 2
    A, I1, I2 = 4 * a * b, 4 * a * b**3 / 3, 4 * b * a**3 / 3
    (x, x_inside), (y, y_inside) = _places(a, min(a, b)), _places(b, min(a, b))
    if a <= b:
        shear = _shear(a, b, nu, x, y)
    else:  # mirrored, which reverses torsion
        shear = _shear(b, a, nu, y, x)[[1, 0, 2]][:, ::-1].swapaxes(2, 3) * np.array([1, 1, -1])[:, None, None, None]
    kept = (np.abs(x) == a)[:, None] | (np.abs(y) == b) | (x_inside[:, None] & y_inside)
    shear = np.moveaxis(shear[:, :, kept], 0, -1) / [I2, I1, torsion]
    x, y = (values[kept] for values in np.meshgrid(x, y, indexing="ij"))
    return Fibres(np.column_stack([np.full_like(x, 1 / A), y / I1, -x / I2]), shear)


def _places(a, short):
    """Coordinates from -a to a, denser over the length 5 `short` at the ends, and whether points inside have them."""
    corner = 1 - 5 * short / a * np.linspace(0, 1, _NEAR + 1)[1:] ** 1.5
    half = np.unique(np.round(np.concatenate([np.linspace(0, 1, _INTERVALS // 2 + 1), corner[corner > 0]]), 9))
    inside = np.arange(1 - len(half), len(half)) % _INSIDE == 0
    return a * np.concatenate([-half[:0:-1], half]), inside


def _shear(a, b, nu, x, y):
    """Shear stresses of a rectangle |x| <= a, |y| <= b with a <= b, at all pairs of x and y, (3, 2, x, y): per force
    along x, times the second moment of area for its bending (m^2); the same for a force along y; per moment, times the
    torsion constant (m); of each the components along x and y. The series are those with hyperbolic functions of y,
    which converge fast save at the short sides."""
    n, poisson = np.arange(1, _TERMS + 1), nu / (1 + nu)
    sign, odd = -((-1.0) ** n), 2 * n - 1
    # odd waves: 1 at x = 0; whole waves: zero slope at x = a
    p, q = odd * np.pi / (2 * a), n * np.pi / a
    (sin, cos), (sin_whole, cos_whole) = ((np.sin(np.outer(x, k)), np.cos(np.outer(x, k))) for k in (p, q))
    grow, even, sinh_b = _hyperbolic(p, y, b)
    grow_whole, even_whole, _ = _hyperbolic(q, y, b)
    across = 2 * b / a * sign / p**2, 2 * a * sign / (q * a) ** 2 * a, 4 / a * sign / p**2
    x, y = x[:, None], y[None, :]
    along_x = (
        (1 - poisson) * (a**2 - x**2) / 2 + poisson * (cos * across[0]) @ (even / sinh_b),
        poisson * ((sin * across[0]) @ (grow / sinh_b) - x * y),
    )
    along_y = (
        -poisson * (sin_whole * across[1]) @ grow_whole,
        (b**2 - y**2) / 2 + poisson * ((cos_whole * across[1]) @ even_whole - (a**2 - 3 * x**2) / 6),
    )
    twist = -(cos * across[2]) @ grow, 2 * x - (sin * across[2]) @ even
    found = np.array([along_x, along_y, twist])
    found[:, 1, :, np.abs(y[0]) == b] = 0.0  # where the series converge slowly
    return found


def _hyperbolic(k, y, b):
    """sinh(k y)/cosh(k b), cosh(k y)/cosh(k b) (waves, places) for |y| <= b, however large; and tanh(k b)."""
    k = k[:, None]
    decay, far = np.exp(k * (np.abs(y) - b)) / (1 + np.exp(-2 * k * b)), np.exp(-2 * k * np.abs(y))
    return np.sign(y) * decay * (1 - far), decay * (1 + far), np.tanh(k * b)
