"""Numerical tools that all rooms share: Gauss's rules, the polynomials of an element, quaternions, differences.

Quaternions are unit quaternions in numpy, scalar first; for UFL see forms/rotation.py. Differences are central, of
eighth order, of data that Python computes from numbers; results of iterations are never differenced.
"""

import math
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre


class Gauss(NamedTuple):
    """Points (n,), weights (n,), and matrices from the values at the points to the coefficients of the Legendre series
    through them, (n, n), and of its integral from -1, (n + 1, n)."""

    points: np.ndarray
    weights: np.ndarray
    series: np.ndarray
    integral: np.ndarray


@cache
def gauss(n):
    """The `Gauss` rule of n points."""
    points, weights = legendre.leggauss(n)
    # By inversion: discrete orthogonality with Gauss weights loses two digits to the rounding of the points.
    series = np.linalg.inv(legendre.legvander(points, n - 1))
    return Gauss(points, weights, series, legendre.legint(series, lbnd=-1, axis=0))


def lobatto_weights(nodes):
    """Weights (n,) of the quadrature rule on [0, 1] whose points are the nodes (n,)."""
    return np.linalg.solve(np.vander(nodes, increasing=True).T, 1 / np.arange(1, len(nodes) + 1))


# Halvings of the interval in which a jump is looked for, the share of the range of the values that is one, and the
# share of the values below which their range is rounding.
_HALVINGS, _JUMP, _CONSTANT = 32, 1e-3, 1e-9


def jump_of(function, low, high, *, alike=False, samples=129):
    """Where a function s (n,) -> (n, m) jumps in [low, high]; None where it is continuous, as far as samples tell.
    alike: whether its numbers have one unit, and the largest range of them is the scale of all."""
    s = np.linspace(low, high, samples)
    values = np.asarray(function(s), dtype=float)
    values = np.where(np.isfinite(values).all(axis=0), values, 0.0)
    ranges = np.ptp(values, axis=0)
    ranges = np.full_like(ranges, ranges.max()) if alike else ranges
    varies = ranges > _CONSTANT * np.abs(values).max(axis=0)
    if not varies.any():
        return None
    changes = np.diff(values[:, varies], axis=0) / ranges[varies]
    beside = np.pad(changes, ((1, 1), (0, 0)), mode="reflect")
    k = int(np.argmax(np.abs(changes - (beside[:-2] + beside[2:]) / 2).max(axis=1)))
    ends, found = s[k : k + 2], values[k : k + 2]
    for _ in range(_HALVINGS):
        middle = ends.mean(keepdims=True)
        points, at = np.insert(ends, 1, middle), np.insert(found, 1, np.asarray(function(middle)), axis=0)
        rises = np.abs(np.diff(at[:, varies], axis=0) / ranges[varies]).max(axis=1)
        half = slice(0, 2) if rises[0] > rises[1] else slice(1, 3)
        ends, found = points[half], at[half]
    return float(ends[1]) if rises.max() > _JUMP else None


class ElementRule:
    """Nodes (Lobatto's of P_p), Gauss points, weights and polynomials of one element on [0, 1], ascending."""

    def __init__(self, nodes, gauss, weights):
        order = np.argsort(gauss)
        self.nodes, self.gauss, self.weights = nodes, gauss[order], weights[order]
        self._derived = {}  # see `derivative`

    @cached_property
    def _to_coefficients(self):
        return np.linalg.inv(np.vander(2 * self.nodes - 1, increasing=True))

    def basis(self, x):
        """(len(x), p + 1) nodal basis functions at x in [0, 1]."""
        return np.vander(2 * np.asarray(x) - 1, len(self.nodes), increasing=True) @ self._to_coefficients

    def derivative(self, x, order):
        """(len(x), p + 1) derivatives of an order of the nodal basis at x in [0, 1]."""
        if order not in self._derived:
            k = np.arange(order, len(self.nodes))
            factor = np.prod([2.0 * (k - i) for i in range(order)], axis=0)
            self._derived[order] = factor[:, None] * self._to_coefficients[order:] if order else self._to_coefficients
        factors = self._derived[order]
        return np.vander(2 * np.asarray(x) - 1, len(factors), increasing=True) @ factors

    @cached_property
    def at_gauss(self):
        """(gauss, p + 1) nodal basis functions at the Gauss points."""
        return self.basis(self.gauss)

    @cached_property
    def lobatto(self):
        """(p + 1,) weights of the quadrature rule whose points are the nodes."""
        return lobatto_weights(self.nodes)

    @cached_property
    def leading(self):
        """(p + 1,) weights of the nodal values in the coefficient of x^p, x in [-1, 1]."""
        return self._to_coefficients[-1]

    @cached_property
    def slopes(self):
        """(gauss, p + 1) d/dx of the nodal basis at the Gauss points."""
        return self.derivative(self.gauss, 1)

    @cached_property
    def from_slopes(self):
        """(p + 1, gauss) from slopes at the p Gauss points to the values of their integral at the nodes."""
        count = len(self.gauss)
        powers = np.column_stack([(2 * self.nodes - 1) ** (k + 1) - (-1) ** (k + 1) for k in range(count)])
        return powers / (2 * np.arange(1, count + 1)) @ np.linalg.inv(np.vander(2 * self.gauss - 1, increasing=True))

    @cached_property
    def from_ends_and_gauss(self):
        """(p + 1, gauss + 2) matrix from values at 0, the Gauss points and 1 to the values at the nodes."""
        return _interpolating(np.concatenate([[0.0], self.gauss, [1.0]]), self.nodes)

    @cached_property
    def contact_from_fields(self):
        """(p + 1, gauss) matrix from n (or m) at the Gauss points to the part of it at the nodes that does not depend
        on the element's length, see `results.recovery`."""
        ends = self.weights * self.slopes[:, [0, -1]].T * [[-1], [1]]
        return self.from_ends_and_gauss @ np.concatenate([ends[:1], np.eye(len(self.gauss)), ends[1:]])

    @cached_property
    def contact_from_densities(self):
        """(p + 1, gauss) matrix from the force (or moment with r' x n) per length, times the element's length, at the
        Gauss points to the rest of n (or m) at the nodes."""
        ends = self.weights * self.at_gauss[:, [0, -1]].T * [[1], [-1]]
        return self.from_ends_and_gauss[:, [0, -1]] @ ends

    def between_gauss(self, x):
        """(len(x), gauss) Lagrange polynomials of the Gauss points, at x in [0, 1]."""
        return _interpolating(self.gauss, np.asarray(x))

    def locate_all(self, breaks, x, basis=None):
        """Elements (n,) and basis functions (n, p + 1) at x (n,) of a rod with element ends `breaks`."""
        cells = np.clip(np.searchsorted(breaks, x, side="left") - 1, 0, len(breaks) - 2)
        local = (x - breaks[cells]) / np.diff(breaks)[cells]
        return cells, (basis or self.basis)(np.clip(local, 0.0, 1.0))


def svd(matrix, full_matrices=True):
    """(U, singular values, V^T) as of `numpy.linalg.svd`, also where LAPACK's fast algorithm fails, as it does with
    OpenBLAS 0.3.34 for some matrices without a fault."""
    try:
        return np.linalg.svd(matrix, full_matrices)
    except np.linalg.LinAlgError:
        from scipy.linalg import svd as slower  # slow to import

        return slower(matrix, full_matrices, lapack_driver="gesvd")


def _interpolating(points, x):
    """(len(x), len(points)) Lagrange polynomials of points in [0, 1], at x."""
    points, x = 2 * points - 1, 2 * x - 1
    return np.vander(x, len(points), increasing=True) @ np.linalg.inv(np.vander(points, increasing=True))


def once_each(keys, make):
    """[make(i) of the i-th of these keys], made once for equal keys: most rods of a frame are alike."""
    found = {}
    return [found[key] if key in found else found.setdefault(key, make(i)) for i, key in enumerate(keys)]


def directors(q):
    """(k, 3, 3) rotation matrices of unit quaternions (k, 4), eq. (6); the columns are d_1, d_2, d_3."""
    a, b, c, d = q.T
    (aa, bb, cc, dd), (ab, ac, ad), e, f = q.T * q.T, 2 * a * q.T[1:], 2 * b, 2 * c
    bc, bd, cd = e * c, e * d, f * d
    R = np.empty((3, 3, len(q)))
    R[0, 1], R[0, 2], R[1, 0] = bc - ad, bd + ac, bc + ad
    R[1, 2], R[2, 0], R[2, 1] = cd - ab, bd - ac, cd + ab
    R[0, 0], R[1, 1], R[2, 2] = aa + bb - cc - dd, aa - bb + cc - dd, aa - bb - cc + dd
    return R.transpose(2, 0, 1)


def conjugate_product(p, q):
    """Vector parts (..., 3) of conj(p) q."""
    v, w = p[..., 1:], q[..., 1:]
    return p[..., :1] * w - q[..., :1] * v - np.cross(v, w)


def product_conjugate(p, q):
    """(..., 4) p conj(q)."""
    v, w = p[..., 1:], q[..., 1:]
    scalar = np.einsum("...i,...i", p, q)[..., None]
    return np.concatenate([scalar, q[..., :1] * v - p[..., :1] * w - np.cross(v, w)], axis=-1)


def cross(u, v):
    """(k, 3) cross products of rows; np.cross takes five times as long for few rows."""
    result = np.empty_like(u)
    result[:, 0] = u[:, 1] * v[:, 2] - u[:, 2] * v[:, 1]
    result[:, 1] = u[:, 2] * v[:, 0] - u[:, 0] * v[:, 2]
    result[:, 2] = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    return result


def spun(q, omega):
    """(.., 4) omega q/2: changes of q (.., 4) by small inertial rotations (.., 3), or rates by angular velocities."""
    v = q[..., 1:]
    scalar = -np.einsum("...i,...i->...", omega, v)[..., None]
    return np.concatenate([scalar, q[..., :1] * omega + np.cross(omega, v)], axis=-1) / 2


def small_rotations(q):
    """(.., 3, 4) matrices from changes dq of q (.., 4) to small inertial rotations 2 vec(dq conj(q))/|q|^2."""
    scaled = q * (2 / (q * q).sum(axis=-1, keepdims=True))
    return (scaled @ _SMALL_ROTATIONS).reshape(*q.shape[:-1], 3, 4)


#: (4, 12): q times this are the rows (-b, a, -d, c), (-c, d, a, -b), (-d, -c, b, a).
_SMALL_ROTATIONS = np.array(
    [
        [[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
        [[-1, 0, 0, 0], [0, 0, 0, -1], [0, 0, 1, 0]],
        [[0, 0, 0, 1], [-1, 0, 0, 0], [0, -1, 0, 0]],
        [[0, 0, -1, 0], [0, 1, 0, 0], [-1, 0, 0, 0]],
    ],
    dtype=float,
).reshape(4, 12)


def lagrange(places, at):
    """Weights of Lagrange's interpolation at `at` from values at different places."""
    return [math.prod([(at - b) / (a - b) for b in places if b != a]) for a in places]


#: Multiples of the step at which the function is evaluated.
PLACES = (-4, -3, -2, -1, 1, 2, 3, 4)
#: The usual step over the size of the number: for the power -4 of it, truncation and rounding are below 1e-13.
STEP = 4e-3
# Weights of f(k h) - f(-k h), k = 1 .. 4, of orders eight and six.
_EIGHT, _SIX = (4 / 5, -1 / 5, 4 / 105, -1 / 280), (3 / 4, -3 / 20, 1 / 60, 0.0)
# Largest relative error of the derivative of a smooth function, and relative rounding of the values.
_SMOOTH, _ROUNDING = 1e-6, 1e-9


def is_smooth(values, step, of_all=lambda sizes: sizes):
    """Whether the estimated error of `derivative` is small: that the step is short, and no jump is near; of_all: makes
    (3,) sizes the largest ones of all ranks, where these hold parts of the values."""
    sizes = of_all(np.array([np.abs(x).max(initial=0.0) for x in (*derivative(values, step), values)]))
    return sizes[1] <= _SMOOTH * sizes[0] + _ROUNDING * sizes[2] / step


def derivative(values, step):
    """The derivative of a function and an estimate of its error. values: those at `PLACES` times the step, arrays of
    one shape; step: a number. Returns (derivative, error), arrays: the error is the difference from a formula of sixth
    order, an upper bound where the step is small."""
    odd = [np.subtract(values[4 + k], values[3 - k]) for k in range(4)]
    eight, six = (sum(w * part for w, part in zip(weights, odd, strict=True)) / step for weights in (_EIGHT, _SIX))
    return eight, np.abs(eight - six)
