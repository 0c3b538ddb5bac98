"""Quaternions q = (q_a, q_b, q_c, q_d), scalar first: the algebra behind the paper's eqs. (4)-(6)."""

import ufl

# Where sin(angle/2)^2 is below this, the series of the rotation vector is exact to rounding.
_SMALL = 1e-4


def vector_part(q):
    """(q_b, q_c, q_d)."""
    return ufl.as_vector([q[1], q[2], q[3]])


def conjugate_product(p, q):
    """Vector part of conj(p) q."""
    return p[0] * vector_part(q) - q[0] * vector_part(p) - ufl.cross(vector_part(p), vector_part(q))


def directors(q):
    """The directors d_1, d_2, d_3 of eq. (6) as columns: |q|^2 times a rotation."""
    a, b, c, d = q[0], q[1], q[2], q[3]
    return ufl.as_matrix(
        [
            [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
        ]
    )


def turned(q, dq):
    """The derivative of the directors at q in the direction dq, linear in each."""

    def of(i, j):
        return q[i] * dq[j] + q[j] * dq[i]

    a, b, c, d = range(4)
    diagonal = [[of(a, a), of(b, b), -of(c, c), -of(d, d)], [of(a, a), -of(b, b), of(c, c), -of(d, d)],
                [of(a, a), -of(b, b), -of(c, c), of(d, d)]]  # fmt: skip
    first, second, third = (sum(terms) for terms in diagonal)
    return ufl.as_matrix(
        [
            [first, 2 * (of(b, c) - of(a, d)), 2 * (of(b, d) + of(a, c))],
            [2 * (of(b, c) + of(a, d)), second, 2 * (of(c, d) - of(a, b))],
            [2 * (of(b, d) - of(a, c)), 2 * (of(c, d) + of(a, b)), third],
        ]
    )


def rotation_matrix(q):
    """R(q): the directors of q/|q|, a rotation for every q but zero."""
    return directors(q) / ufl.dot(q, q)


def rotation_vector(q):
    """The rotation vector of q, inertial, for angles between -2 pi and 2 pi: 2 acos(q_a/|q|) along (q_b, q_c, q_d)."""
    v = vector_part(q)
    square, size = ufl.dot(v, v), ufl.sqrt(ufl.dot(q, q))
    sine = ufl.sqrt(ufl.max_value(square / size**2, _SMALL))
    cosine = q[0] / size
    # near the identity: asin(x)/x = 1 + x^2/6 + 3 x^4/40 + 15 x^6/336
    x = square / size**2
    series = 2 * (1 + x / 6 + 3 * x**2 / 40 + 15 * x**3 / 336)
    closed = 2 * ufl.acos(ufl.max_value(ufl.min_value(cosine, 1 - _SMALL / 4), -1 + _SMALL / 4)) / sine
    return ufl.conditional(ufl.And(ufl.lt(x, _SMALL), ufl.gt(cosine, 0)), series, closed) / size * v


def curvature(q, q_s):
    """Curvature and twist u of eqs. (4)-(5), material: 2 vec(conj(q) q') times |q|^2."""
    return 2 * conjugate_product(q, q_s)


def small_rotation(dq, q):
    """The small inertial rotation 2 vec(dq conj(q))/|q|^2 of a change dq of q."""
    return 2 * product_conjugate(dq, q) / ufl.dot(q, q)


def small_rotation_s(dq, dq_s, q, q_s):
    """The derivative of `small_rotation` along the rod."""
    change = product_conjugate(dq_s, q) + product_conjugate(dq, q_s)
    squared = ufl.dot(q, q)
    return 2 * (change - 2 * ufl.dot(q, q_s) / squared * product_conjugate(dq, q)) / squared


def product_conjugate(p, q):
    """Vector part of p conj(q)."""
    v, w = vector_part(p), vector_part(q)
    return q[0] * v - p[0] * w - ufl.cross(v, w)
