"""An independent reference for spatial scenes: the strong form of one straight, clamped rod, by shooting.

By scipy's DOP853 at 1e-12 on (r, q, n, m) with the laws (2)-(3), in SI units.
"""

import numpy as np
from clamped_rod import cross
from clamped_rod import matrix as matrices
from scipy.integrate import solve_ivp
from scipy.optimize import root


def matrix(q):
    """The rotation matrix of one quaternion (4,)."""
    return matrices(q[:, None])[0]


def shoot(length, frame, K, J, density, loads, steps=10):
    """The rod at full load, reached in a number of load steps.

    Args:
        length: m; frame: [d1 d2 d3] at rest; K, J: stiffnesses (GA1, GA2, EA), (EI1, EI2, GJ).
        density: dead force per length (3,).
        loads: list of (s, force (3,), moment (3,), arm (a1, a2)), dead, at s in (0, length].

    Returns:
        A function s -> dict(r, q, n, m, strain, curvature), r from the clamp; at a load the values before it.
    """
    K, J, density = np.array(K), np.array(J), np.array(density)
    breaks = sorted({0.0, length} | {load[0] for load in loads})
    n0 = sum((np.array(F) for _, F, _, _ in loads), np.zeros(3)) + density * length
    unit = J[0] / length  # of the moment that is shot for

    def slope(s, y, eta):
        T = matrix(y[3:7]) @ frame
        r_s = T @ ([0, 0, 1] + T.T @ y[7:10] / K)
        w = T @ (T.T @ y[10:13] / J)  # inertial curvature of q
        q = y[3:7]
        q_s = 0.5 * (q[0] * w + cross(w, q[1:]))
        return np.concatenate([r_s, [-0.5 * w @ q[1:]], q_s, -eta * density, -cross(r_s, y[7:10])])

    def jumps(s, y, eta):
        n, m = np.zeros(3), np.zeros(3)
        for at, F, M, arm in loads:
            if at == s:
                n += F
                m += M + np.cross(matrix(y[3:7]) @ frame @ [*arm, 0.0], F)
        return eta * n, eta * m

    def integrate(m0, eta, tol=1e-12, dense=False):
        y, pieces = np.r_[0, 0, 0, 1, 0, 0, 0, eta * n0, m0 * unit], []
        for a, b in zip(breaks[:-1], breaks[1:], strict=True):
            piece = solve_ivp(
                slope, (a, b), y, args=(eta,), method="DOP853", rtol=tol, atol=tol, dense_output=dense
            )
            pieces.append(piece)
            y = piece.y[:, -1].copy()
            n, m = jumps(b, y, eta)
            y[7:10] -= n
            y[10:13] -= m
        return y, pieces

    m0 = before = np.zeros(3)
    for eta in np.linspace(0, 1, steps + 1)[1:]:
        tol = 1e-12 if eta == 1 else 1e-7  # steps before the last only lead to it
        more = {"xtol": tol, "eps": 10 * tol}
        found = root(lambda x: integrate(x, eta, tol)[0][10:13] / unit, 2 * m0 - before, options=more)  # noqa: B023
        assert np.abs(found.fun).max() < 1e4 * tol, found
        m0, before = found.x, m0
    _, pieces = integrate(m0, 1.0, dense=True)

    def at(s):
        piece = next(p for p in pieces if s <= p.t[-1])
        y = piece.sol(s)
        T = matrix(y[3:7]) @ frame
        return dict(r=y[:3], q=y[3:7], n=y[7:10], m=y[10:13], strain=T.T @ y[7:10] / K, curvature=T.T @ y[10:13] / J)

    return at
