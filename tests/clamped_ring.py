"""Zajac's ring (J. Appl. Mech. 29 (1962) 136): the twist at which a straight rod, bent to a ring, leaves its plane.

The rod of a round section and of length 2 pi R is bent to a circle and one end is turned about the tangent; both ends
are clamped at the same place. The linear problem about the plane ring is shot from one end to the other.
"""

import numpy as np
from clamped_rod import STEP, cross, matrix
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar


def singular_values(twist, torsion):
    """Singular values of the derivative of (closure, rotation of the end) by (n, m) at the start; R = EI = 1, GJ =
    torsion; rad.

    One of them is always 0: a ring of round section can rotate about its tangent everywhere without a change of energy.
    """
    tau = twist / (2 * np.pi)
    y = np.zeros((13, 6), complex)
    y[3] = 1.0
    # starts at 0 along x, curved about z: n = GJ tau e_z balances the torque GJ tau d3, whose direction changes along
    # the ring
    y[7:10] = np.array([0, 0, torsion * tau])[:, None]
    y[10:13] = np.array([torsion * tau, 0, 1.0])[:, None]
    y[7:13] += 1j * STEP * np.eye(6)
    compliance = np.array([1 / torsion, 1.0, 1.0])[:, None]

    def slope(_, flat):
        v = flat.reshape(13, 6)
        q, n, m = v[3:7], v[7:10], v[10:13]
        T = matrix(q)  # columns d3, d1, d2
        u = compliance * np.einsum("kji,jk->ik", T, m)
        w = np.einsum("kij,jk->ik", T, u)
        d3 = T[:, :, 0].T
        q_s = 0.5 * np.concatenate([-(w * q[1:]).sum(axis=0)[None], q[0] * w + cross(w, q[1:])])
        return np.concatenate([d3, q_s, 0 * n, -cross(d3, n)]).ravel()

    done = solve_ivp(slope, (0, 2 * np.pi), y.ravel(), method="DOP853", rtol=1e-13, atol=1e-13, max_step=0.1)
    y = done.y[:, -1].reshape(13, 6)
    q, dq = y[3:7, 0].real, y[3:7].imag / STEP
    turned = 2 * (q[0] * dq[1:] - np.outer(q[1:], dq[0]) + np.cross(q[1:, None], dq[1:], axis=0))
    assert np.abs(y[:3].real).max() < 1e-9, "the plane ring is no equilibrium"
    return np.linalg.svd(np.vstack([y[:3].imag / STEP, turned]), compute_uv=False)[::-1]


def critical_twist(torsion, first, last, count=40):
    """The first twist between two, in rad, at which a second singular value vanishes."""
    twists = np.linspace(first, last, count)
    sizes = [singular_values(t, torsion)[1] for t in twists]
    for a, low, b, x, y, z in zip(twists, twists[1:], twists[2:], sizes, sizes[1:], sizes[2:], strict=False):
        if y < x and y < z:
            found = minimize_scalar(
                lambda t: singular_values(t, torsion)[1], bracket=(a, low, b), tol=1e-10, method="golden"
            )
            if found.fun < 1e-6:
                return found.x
    raise RuntimeError("no critical twist there")
