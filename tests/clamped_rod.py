"""One rod of any reference shape, clamped at s = 0, under dead loads: its strong form, shot; its negative modes.

Dead loads make n(s) known, so the unknowns are (r, q, m). Independent of the package. The solver is bvp.py.

Stability: the number of conjugate points (Morse's index theorem) of the symmetric part of the second variation, which
for forces is the number of negative modes of the energy.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp

STEP = 1e-30  # of the complex derivatives: exact to round-off
START = np.r_[0, 0, 0, 1, 0, 0, 0].astype(float)  # r and q at the clamp


class NoTruth(Exception):
    """The strong form was not solved to the requested accuracy."""


def matrix(q):
    """Rotation matrices (k, 3, 3) of quaternions (4, k), homogeneous of degree zero."""
    a, b, c, d = q
    rows = [
        [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
    ]
    return np.moveaxis(np.array(rows), -1, 0) / (a * a + b * b + c * c + d * d)[:, None, None]


def cross(a, b):
    """a x b of arrays (3, k) or (3, 1); numpy.cross takes longer than the rest of the right-hand side."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def apply(A, v):
    return np.matmul(A, v.T[:, :, None])[:, :, 0].T


@dataclass(frozen=True)
class Problem:
    """One clamped rod under dead loads; SI units, inertial components.

    frame(s): [d1R d2R d3R] for arrays s (n,) as (n, 3, 3); K, J: (GA1, GA2, EA), (EI1, EI2, GJ), constant (numpy.inf
    allowed in K) or functions of s (n,) to (n, 3); arm: (a1, a2), where the end force acts, along d1 and d2 of the end.
    """

    length: float
    frame: object
    K: object
    J: object
    force: tuple = (0, 0, 0)
    moment: tuple = (0, 0, 0)
    arm: tuple = (0, 0)
    line_force: tuple = (0, 0, 0)
    line_moment: tuple = (0, 0, 0)
    units: dict = field(init=False, repr=False)
    dimensionless: dict = field(init=False, repr=False)  # the loads, in units of EI = min(EI1, EI2) at s = 0, and L

    def __post_init__(self):
        J0 = self.J(np.zeros(1))[0] if callable(self.J) else self.J
        EI = float(min(J0[:2]))
        L = self.length
        force = EI / L**2
        object.__setattr__(self, "units", dict(EI=EI, force=force, moment=EI / L))
        scaled = dict(
            F=np.array(self.force, float) / force,
            f=np.array(self.line_force, float) * L / force,
            M=np.array(self.moment, float) / (EI / L),
            mu=np.array(self.line_moment, float) * L * L / EI,
            arm=np.array([*self.arm, 0.0]) / L,
        )
        object.__setattr__(self, "dimensionless", scaled)

    @property
    def conservative(self):
        """Dead moments have no potential in space."""
        return not (np.any(self.dimensionless["M"]) or np.any(self.dimensionless["mu"]))

    def compliance(self, x):
        """1/K and 1/J in units of EI and L, (3, n)."""
        K = self.K(x * self.length) if callable(self.K) else np.array([self.K])
        J = self.J(x * self.length) if callable(self.J) else np.array([self.J])
        return self.units["force"] / np.array(K, float).T, self.units["EI"] / np.array(J, float).T

    def slope(self, x, y, eta):
        """d(r, q, m)/dx, x = s/L, for y (10, k); x (1,) or (k,), eta a number or (k,)."""
        p, q, m = self.dimensionless, y[3:7], y[7:10]
        T = matrix(q) @ self.frame(x * self.length)
        Tt = np.swapaxes(T, 1, 2)
        shear, bend = self.compliance(x)
        n = eta * (p["F"][:, None] + p["f"][:, None] * (1 - x))
        strain = shear * apply(Tt, n + 0 * m)
        strain[2] += 1
        r_x = apply(T, strain)
        w = apply(T, bend * apply(Tt, m))
        q_x = 0.5 * np.concatenate([-(w * q[1:]).sum(axis=0)[None], q[0] * w + cross(w, q[1:])])
        return np.concatenate([r_x, q_x, -cross(r_x, n) - eta * p["mu"][:, None]])

    def end_moment(self, q, eta):
        """m(L) that the loads give, for end rotations q (4, k)."""
        p = self.dimensionless
        T = matrix(q) @ self.frame(np.array([self.length]))
        return eta * (p["M"][:, None] + cross(apply(T, p["arm"][:, None] + 0 * q[:3]), p["F"][:, None] + 0 * q[:3]))

    def shoot(self, y, eta, rtol, backwards=False, dense=False):
        """All columns of y (10, k) at once from one end to the other."""
        shape, span = y.shape, ((1.0, 0.0) if backwards else (0.0, 1.0))
        eta = np.asarray(eta)

        def slope(x, flat):
            return self.slope(np.array([x]), flat.reshape(shape), eta).ravel()

        # step size bounded for the complex derivatives: they are too small to influence the error control
        how = dict(method="DOP853", rtol=rtol, atol=rtol, max_step=1 / 12, dense_output=dense)
        done = solve_ivp(slope, span, y.ravel(), **how)
        if not done.success:
            raise NoTruth(done.message)
        return done

    def misfit(self, z, rtol):
        """End condition (3,) and its derivative (3, 4) with respect to z = (clamp moment, load factor)."""
        y = np.zeros((10, 4), complex)
        y[:7] = START[:, None]
        y[7:10] = z[:3, None] + 1j * STEP * np.eye(3, 4)
        eta = z[3] + 1j * STEP * np.eye(4)[3]
        y = self.shoot(y, eta, rtol).y[:, -1].reshape(10, 4)
        G = y[7:10] - self.end_moment(y[3:7], eta)
        return G[:, 0].real, G.imag / STEP


def index(problem, z, rtol=1e-8):
    """Negative modes of the second variation at z: conjugate points, counted from the free end to the clamp.

    Rotations theta and moments p = dm - theta x m/2 are canonical on the rotation group. They define the unitary matrix
    W = (theta - i p)(theta + i p)^-1; a conjugate point is where it has the eigenvalue -1. At L only the symmetric part
    of the loads' stiffness enters (a dead moment has a skew part too).
    """
    y = np.zeros((10, 1))
    y[:7, 0], y[7:10, 0] = START, z[:3]
    end = problem.shoot(y, z[3], rtol).y[:, -1]
    q, m = end[3:7], end[7:10]

    def turned(theta):  # derivative of q by a rotation
        return 0.5 * np.r_[-theta @ q[1:], q[0] * theta + np.cross(theta, q[1:])]

    y = np.tile(end[:, None].astype(complex), 3)
    y[3:7] += 1j * STEP * np.array([turned(e) for e in np.eye(3)]).T
    p = problem.end_moment(y[3:7], z[3]).imag / STEP - 0.5 * np.cross(np.eye(3), m).T
    p = 0.5 * (p + p.T)
    y[7:10] = m[:, None] + 1j * STEP * (p + 0.5 * np.cross(np.eye(3), m).T)
    x = np.linspace(1, 0, 201 + int(50 * np.abs(z[:3]).max()))  # close enough to follow the phases
    state = problem.shoot(y, z[3], rtol, backwards=True, dense=True).sol(x).T.reshape(len(x), 10, 3)
    q, m, dq = state[:, 3:7, 0].real, state[:, 7:10, 0].real, state[:, 3:7].imag / STEP
    theta = 2 * (q[:, :1, None] * dq[:, 1:] - q[:, 1:, None] * dq[:, :1] + np.cross(q[:, 1:, None], dq[:, 1:], axis=1))
    p = state[:, 7:10].imag / STEP - 0.5 * np.cross(theta, m[:, :, None], axis=1)
    W = (theta - 1j * p) @ np.linalg.inv(theta + 1j * p)
    if np.abs(W @ np.swapaxes(W, 1, 2).conj() - np.eye(3)).max() > 1e-3:
        raise NoTruth("the fields of the second variation are not canonical")
    # the total rotation of the phases minus their final values: the rest passed through -1
    phases = np.angle(np.linalg.eigvals(W[[0, -1]])).sum(axis=1)
    turned = np.diff(np.unwrap(np.angle(np.linalg.det(W)))[[0, -1]])[0]
    count = (turned - np.diff(phases)[0]) / (2 * np.pi)
    if abs(count - round(count)) > 1e-3:
        raise NoTruth(f"{count} conjugate points")
    return abs(round(count))
