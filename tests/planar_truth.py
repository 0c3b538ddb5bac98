"""A reference solution for frames and arches in a plane: the strong form by shooting leg by leg (DOP853) and arc
length.

Independent of the package; solve_bvp solves the same frame, all legs at once, as a check.
State y (4, k), one column for each direction of a complex derivative: x, y, theta (of the tangent, from x), m. Along a
leg n (2, k) is constant; a load F at its end takes F from it: n+ = n- - F. Any consistent units.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.optimize import brentq

STEP = 1e-30  # of the complex derivatives


@dataclass(frozen=True)
class Section:
    EI: float = 1.0
    EA: float = np.inf
    GA: float = np.inf


@dataclass(frozen=True)
class Leg:
    """length, rest curvature dtheta/ds, and what happens at its end: load (times the load factor), turn, hinge."""

    length: float
    curvature: float = 0.0
    load: tuple = (0.0, 0.0)
    turn: float = 0.0
    hinge: bool = False


@dataclass(frozen=True)
class Frame:
    """A chain of legs between two feet (x, y, theta), each clamped or pinned (theta is then the angle at rest)."""

    section: Section
    legs: tuple
    start: tuple
    end: tuple
    pinned: tuple = (False, False)

    def slope(self, leg, v, n):
        s, cos, sin, m = self.section, np.cos(v[2]), np.sin(v[2]), v[3]
        N, Q = n[0] * cos + n[1] * sin, n[1] * cos - n[0] * sin
        x, y = cos * (1 + N / s.EA) - sin * Q / s.GA, sin * (1 + N / s.EA) + cos * Q / s.GA
        return np.array([x, y, leg.curvature + m / s.EI, y * n[0] - x * n[1]])

    @property
    def unknowns(self):
        """n (2), the angle or moment of the first foot, one angle behind every hinge, and the load factor."""
        return 4 + sum(leg.hinge for leg in self.legs)

    def shoot(self, z, rtol=1e-13, dense=False):
        """Legs from foot to foot: residual (unknowns - 1, k), and the solutions of the legs."""
        n, zero = z[:2], 0 * z[0]
        y = np.array([zero + a for a in (*self.start, 0.0)])
        y[2 if self.pinned[0] else 3] += z[2]
        hinges, residual, solutions = iter(z[3:-1]), [], []
        for leg in self.legs:
            done = solve_ivp(
                lambda _, flat: self.slope(leg, flat.reshape(y.shape), n).ravel(),  # noqa: B023
                (0, leg.length),
                y.ravel(),
                method="DOP853",
                rtol=rtol,
                atol=rtol,
                max_step=abs(leg.length) / 12,  # for the complex derivatives, which do not influence the error control
                dense_output=dense,
            )
            solutions.append(done)
            y = done.y[:, -1].reshape(y.shape)
            if leg.hinge:
                residual.append(y[3].copy())
                y[2], y[3] = next(hinges), zero
            y[2] = y[2] + leg.turn
            n = n - np.array(leg.load)[:, None] * z[-1]
        last = y[3] if self.pinned[1] else y[2] - self.end[2]
        return np.array([*residual, y[0] - self.end[0], y[1] - self.end[1], last]), solutions

    def derivative(self, z, rtol=1e-13):
        k = len(z)
        out = self.shoot(np.c_[z[:, None] + 1j * STEP * np.eye(k), z.astype(complex)], rtol)[0]
        return out[:, -1].real, out[:, :-1].imag / STEP

    def correct(self, guess, normal, rtol=1e-13, limit=9):
        """Newton on residual = 0 and normal . (z - guess) = 0; (z, derivative) or None."""
        z = guess.copy()
        for _ in range(limit):
            G, D = self.derivative(z, rtol)
            step = np.linalg.solve(np.vstack([D, normal]), -np.r_[G, normal @ (z - guess)])
            z = z + step
            if not np.abs(z).max() < 1e6:
                return None
            if np.abs(step).max() < max(10 * rtol, 1e-12) * (1 + np.abs(z).max()):
                return z, D
        return None

    def move(self, point, ds, rtol=1e-13):
        found = self.correct(point.z + ds * point.t, point.t, rtol)
        if found is None:
            return None
        z, D = found
        t = np.linalg.svd(D)[2][-1]
        return Point(z, t * np.sign(t @ point.t), np.sign(np.linalg.det(D[:, :-1])))

    def follow(self, ds, until, most=400, rtol=1e-9):
        """Points of the path from the unloaded state, ds apart or less
        where it is curved, until until(point) is true."""
        z = np.zeros(self.unknowns)
        hinges = [sum(leg.turn for leg in self.legs[:i]) for i, leg in enumerate(self.legs) if leg.hinge]
        z[3:-1] = self.start[2] + np.array(hinges)
        D = self.derivative(z)[1]
        t = np.linalg.svd(D)[2][-1]
        points, step = [Point(z, t * np.sign(t[-1]), np.sign(np.linalg.det(D[:, :-1])))], ds
        while len(points) < most and not until(points[-1]):
            new = self.move(points[-1], step, rtol)
            if new is None or new.t @ points[-1].t < 0.9:
                step /= 2
                if step < 1e-7 * ds:
                    raise RuntimeError(f"the path stopped at {points[-1].z}")
                continue
            points.append(new)
            step = min(ds, 1.5 * step)
        return points

    def limits(self, points):
        """Where the load has a maximum or minimum along the path, to round-off."""
        found = []
        for a, b in pairwise(points):
            if a.t[-1] * b.t[-1] < 0:
                reach = (b.z - a.z) @ a.t
                ds = brentq(lambda d: self.move(a, d).t[-1], 0, reach, xtol=1e-11)  # noqa: B023
                found.append(self.move(a, ds))
        return found

    def at_load(self, points, load):
        """The first state of the path at a load factor."""
        for a, b in pairwise(points):
            if (a.z[-1] - load) * (b.z[-1] - load) <= 0 and a.z[-1] != b.z[-1]:
                guess = a.z + (b.z - a.z) * (load - a.z[-1]) / (b.z[-1] - a.z[-1])
                z, D = self.correct(guess, np.eye(len(guess))[-1])
                return Point(z, a.t, np.sign(np.linalg.det(D[:, :-1])))
        raise RuntimeError(f"the path does not come to {load}")

    def places(self, point, rtol=1e-13):
        """(x, y, theta, m) at the end of every leg, (legs, 4)."""
        _, solutions = self.shoot(point.z[:, None], rtol)
        return np.array([done.y[:, -1] for done in solutions])

    def collocate(self, point, leg, component, tol=1e-9):
        """The load factor by solve_bvp at which a component (0: x, 1: y) of the end of a leg is that of the point."""
        solutions = self.shoot(point.z[:, None], dense=True)[1]
        s = np.linspace(0, 1, 101)
        guess = np.vstack([done.sol(s * one.length) for done, one in zip(solutions, self.legs, strict=True)])
        held = guess[4 * leg + component, -1]

        def slope(_, y, p):
            out, n = [], p[:2]
            for i, one in enumerate(self.legs):
                out.append(one.length * self.slope(one, y[4 * i : 4 * i + 4], n))
                n = n - np.array(one.load) * p[2]
            return np.vstack(out)

        def ends(a, b, _):
            out = [*(a[:2] - self.start[:2]), a[3] if self.pinned[0] else a[2] - self.start[2]]
            for i, one in enumerate(self.legs[:-1]):
                before, after = b[4 * i : 4 * i + 4], a[4 * i + 4 : 4 * i + 8]
                out += [*(after[:2] - before[:2]), after[3] - before[3]]
                out.append(before[3] if one.hinge else after[2] - before[2] - one.turn)
            out += [*(b[-4:-2] - self.end[:2]), b[-1] if self.pinned[1] else b[-2] - self.end[2]]
            return np.array([*out, b[4 * leg + component] - held])

        p = np.r_[point.z[:2], point.z[-1]]
        found = solve_bvp(slope, ends, s, guess, p, tol=tol, bc_tol=1e-12, max_nodes=20000)
        if not found.success:
            raise RuntimeError(found.message)
        return found.p[2]


@dataclass
class Point:
    z: np.ndarray  # unknowns, the load factor last
    t: np.ndarray  # unit tangent of the path
    sign: float  # of the determinant of the derivative at a fixed load: it changes where the path loses or gains a mode
