"""Rotations and frames in numpy: the frame at the start of a curve, and curves of constant curvature."""

import math

import numpy as np

from cosserat_fenicsx.checks import refuse

# Taylor coefficients of (theta - sin theta)/theta^3 in theta^2, used below theta = 1, where the closed form cancels.
_SERIES = np.array([(-1) ** k / math.factorial(2 * k + 3) for k in range(9)])


def start_frame(owner, d3, default):
    """The frame [d1 d2 d3] of a unit tangent, (3, 3).

    Args:
        owner: the curve; the component of `owner.d1` normal to the tangent gives the direction of d1.
        default: the direction that is used where `owner.d1` is None.

    Raises:
        SceneError: d1 along the tangent.
    """
    given = np.asarray(default if owner.d1 is None else owner.d1, dtype=float)
    across = given - np.dot(given, d3) * d3
    if np.linalg.norm(across) <= 1e-6 * np.linalg.norm(given):
        refuse(owner, "d1", owner.d1, "a direction across the tangent at the start")
    d1 = across / np.linalg.norm(across)
    d1 = d1 - np.dot(d1, d3) * d3  # twice, against cancellation where `given` is almost along the tangent
    d1 /= np.linalg.norm(d1)
    return np.column_stack([d1, np.cross(d3, d1), d3])


def level_axis(t):
    """The horizontal direction d1 normal to t such that t x d1 points upwards (along z); x for a vertical t."""
    across = np.cross([0.0, 0.0, 1.0], t)
    return across if np.linalg.norm(across) > 1e-6 else np.array([1.0, 0.0, 0.0])


def exponential(w):
    """Rotations by the rotation vectors w (..., 3): (..., 3, 3), orthonormal to round-off (Rodrigues' formula)."""
    first, second, _ = _factors(w)
    W = _skew(w)
    return np.eye(3) + first[..., None, None] * W + second[..., None, None] * (W @ W)


def carried(w):
    """The integral of exponential(t w) (0, 0, 1) over t in [0, 1], (..., 3): the chord of a curve of unit length."""
    _, second, third = _factors(w)
    e3 = np.array([0.0, 0.0, 1.0])
    once = np.cross(w, e3)
    return e3 + second[..., None] * once + third[..., None] * np.cross(w, once)


def _factors(w):
    """sin(x)/x, (1 - cos x)/x^2 and (x - sin x)/x^3 of the lengths x of w, without cancellation."""
    x = np.linalg.norm(w, axis=-1)
    first, half = np.sinc(x / np.pi), np.sinc(x / (2 * np.pi))
    small = x < 1
    series = np.polynomial.polynomial.polyval(np.where(small, x, 0.0) ** 2, _SERIES)
    return first, half**2 / 2, np.where(small, series, (1 - first) / np.where(small, 1.0, x) ** 2)


def _skew(w):
    """The skew matrices of w (..., 3): skew(w) v = w x v, (..., 3, 3)."""
    a, b, c = np.moveaxis(w, -1, 0)
    zero = np.zeros_like(a)
    return np.stack([zero, -c, b, c, zero, -a, -b, a, zero], axis=-1).reshape(*np.shape(w)[:-1], 3, 3)


def rotation(q):
    """The rotation matrix (3, 3) of a unit quaternion, scalar first."""
    V = _skew(np.asarray(q[1:]))
    return np.eye(3) + 2 * q[0] * V + 2 * V @ V
