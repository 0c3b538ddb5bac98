"""Quaternions q = (q_a, q_b, q_c, q_d), scalar first: the algebra behind the paper's eqs. (4)-(6)."""

import ufl


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


def rotation_matrix(q):
    """R(q): the directors of q/|q|, a rotation for every q but zero."""
    return directors(q) / ufl.dot(q, q)


def curvature(q, q_s):
    """Curvature and twist u of eqs. (4)-(5), material: 2 vec(conj(q) q') times |q|^2."""
    return 2 * conjugate_product(q, q_s)


def small_rotation(dq, q):
    """The inertial rotation 2 vec(dq conj(q))/|q|^2 that a change dq of q amounts to."""
    v, dv = vector_part(q), vector_part(dq)
    return 2 * (q[0] * dv - dq[0] * v - ufl.cross(dv, v)) / ufl.dot(q, q)
