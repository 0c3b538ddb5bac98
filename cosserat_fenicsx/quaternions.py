"""Unit quaternions in numpy, scalar first; for UFL see forms/rotation.py."""

import numpy as np


def directors(q):
    """(k, 3, 3) rotation matrices of unit quaternions (k, 4), eq. (6); the columns are d_1, d_2, d_3."""
    a, b, c, d = q.T
    return np.array(
        [
            [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
        ]
    ).transpose(2, 0, 1)


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
