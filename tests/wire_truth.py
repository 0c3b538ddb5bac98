"""A reference for cables and taut wires in a plane: the strong form of one rod held at both ends, by scipy's solve_bvp.

Independent of the package. Collocation on a mesh that is graded towards the ends and the load, since shooting fails
where boundary layers of length sqrt(EI/T) are a small part of the rod.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_bvp
from scipy.optimize import brentq


@dataclass(frozen=True)
class Wire:
    """SI units. A straight rod along x, or an arc with both ends at one height, held at both ends, in the x-z plane.

    Attributes:
        length, EI, EA, GA: of the wire.
        sag: angle of the tangent at the start below the level, rad, where the wire is an arc; it is -sag at the end.
        weight: downwards, N/m.
        load: at mid-span, upwards, N.
        stretch: displacement of the end along x, m.
        clamped: at both ends, or pinned.
    """

    length: float
    EI: float
    EA: float
    GA: float = np.inf
    sag: float = 0.0
    weight: float = 0.0
    load: float = 0.0
    stretch: float = 0.0
    clamped: bool = True

    @property
    def span(self):
        return self.length * np.sinc(self.sag / np.pi)

    def solve(self, tension, tol=1e-7):
        """A function from arc lengths (n,) to positions (2, n) from the start.

        Args:
            tension: its approximate tension, N, for the units and the initial guess.
            tol: of solve_bvp's residuals; with 1e-7 the error of positions is about 1e-9 of the length.
        """
        half, unit = self.length / 2, tension
        layer = np.sqrt(self.EI / unit) / half
        curvature = 2 * self.sag / self.length * half

        def slope(_, y):
            out = []
            for x, z, theta, m, H, V in (y[:6], y[6:]):
                cos, sin = np.cos(theta), np.sin(theta)
                N, Q = H * cos + V * sin, V * cos - H * sin
                e, g = 1 + N * unit / self.EA, Q * unit / self.GA
                dx, dz = e * cos - g * sin, e * sin + g * cos
                downwards = np.full_like(x, self.weight * half / unit)
                out += [dx, dz, curvature + m / layer, (dz * H - dx * V) / layer, np.zeros_like(x), downwards]
            return np.array(out)

        def ends(a, b):
            first = a[2] + self.sag if self.clamped else a[3]
            last = b[8] - self.sag if self.clamped else b[9]
            joined = [b[i] - a[6 + i] for i in range(5)]
            return np.array([a[0], a[1], first, *joined, b[5] - a[11] - self.load / unit,
                             b[6] - (self.span + self.stretch) / half, b[7], last])  # fmt: skip

        near = np.concatenate([[0], np.geomspace(min(layer / 20, 0.01), 0.5, 150)])
        s = np.concatenate([near, 1 - near[-2::-1]])
        y = np.zeros((12, len(s)))
        for first in (0, 6):  # a parabola, and the effect of a load at mid-span
            x = (s + first / 6) * half
            rise = self.load * np.minimum(x, self.length - x) / 2 - self.weight * x * (self.length - x) / 2
            y[first] = x / half * (self.span + self.stretch) / self.length
            y[first + 1] = rise / tension / half
            y[first + 2] = y[first + 5] = np.gradient(y[first + 1], s)
            y[first + 4] = 1.0
        found = solve_bvp(slope, ends, s, y, tol=tol, bc_tol=1e-12, max_nodes=50000)
        if not found.success:
            raise RuntimeError(found.message)

        def positions(at):
            at = np.asarray(at) / half
            first, second = found.sol(np.clip(at, 0, 1)), found.sol(np.clip(at - 1, 0, 1))
            return half * np.where(at <= 1, first[:2], second[6:8])

        return positions


def natural_frequency(length, EI, EA, GA, mass, inertia, strain, k=1, clamped=True):
    """k-th angular frequency, rad/s, of a straight rod that is stretched between its supported ends.

    A zero of the determinant of the boundary conditions, from the four exponential solutions of the linearised
    equations with shear and rotary inertia; growing solutions are scaled at the far end.
    """
    N = EA * strain
    low = np.pi * k / length * np.sqrt(N / mass)

    def determinant(omega):
        A = np.array([
            [0, 1 + strain - N / GA, 1 / GA, 0],
            [0, 0, 0, 1 / EI],
            [-mass * omega**2, 0, 0, 0],
            [0, -inertia * omega**2, -(1 + strain), 0],
        ])  # fmt: skip
        A[3] += N * A[0]
        units = np.array([1.0, 1 / length, N / length, np.sqrt(N * EI) / length])  # of w, theta, V and M
        values, vectors = np.linalg.eig(A * units / units[:, None])
        decay, growth, *waves = np.argsort(values.real)[[0, 3, 1, 2]]
        wave = max(waves, key=lambda i: values[i].imag)
        rows = []
        for x in (0.0, length):
            columns = [(vectors[:, i] / vectors[1, i]).real * np.exp(values[i].real * (x - at))
                       for i, at in ((decay, 0.0), (growth, length))]  # fmt: skip
            along = vectors[:, wave] / vectors[0, wave] * np.exp(1j * values[wave].imag * x)
            columns += [along.real, along.imag]
            rows += [[c[0] for c in columns], [c[1 if clamped else 3] for c in columns]]
        rows = np.array(rows)
        return np.linalg.det(rows / np.abs(rows).max(axis=0))

    layer = np.sqrt(EI / N) / length
    trial = np.linspace(0.9 * low, low * (1 + 4 * layer + 20 * (k * layer) ** 2), 200)
    signs = np.sign([determinant(omega) for omega in trial])
    i = int(np.flatnonzero(signs[1:] != signs[:-1])[0])
    return brentq(determinant, trial[i], trial[i + 1], xtol=1e-13 * low)
