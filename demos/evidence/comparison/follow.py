"""The equilibrium path F(x, eta) = 0 of a comparison model: load control, arc length and limit points.

The attributes and methods of a problem, in its own dimensionless units:
    size                              number of unknowns; x = 0 is the unloaded state
    residual(x, eta)                  F, shape (size,)
    linearise(x, eta, before)         a function b -> K^-1 b for b of shape (size,) or (size, k), where K = dF/dx;
                                      `before` is the state before the last Newton step (most problems ignore it)
    load(x)                           -dF/deta, shape (size,)
    negative_modes(x, eta)            negative eigenvalues of K
    tip(x)                            (delta in m, shortening in m, rotation in rad)
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from cosserat_fenicsx.checks import refuse

TOLERANCE = 1e-10  # of the last step of Newton's method, relative to the state


@dataclass
class Point:
    """One equilibrium: load factor, unknowns, Newton iterations since the previous one, negative modes."""

    eta: float
    x: np.ndarray
    iterations: int = 0
    negative_modes: int = 0


class Stopped(Exception):
    """The path could not be followed further; the message says where and why."""


def newton(problem, x, eta, before=None, most=20, tolerance=TOLERANCE):
    """Newton's method at a fixed load factor from x. Returns (state, iterations), the state None where the method did
    not converge."""
    before = x if before is None else before
    for k in range(1, most + 1):
        try:
            step = -problem.linearise(x, eta, before)(problem.residual(x, eta))
        except np.linalg.LinAlgError:
            return None, k
        before, x = x, x + step
        size = np.abs(step).max()
        if not size < 10.0:  # ten lengths, or NaN
            return None, k
        if size <= tolerance * max(np.abs(x).max(), 1e-6):
            return x, k
    return None, most


def follow(problem, etas, *, adaptive=True, points=(), largest=0.25, tolerance=TOLERANCE):
    """Equilibria at the load factors `etas` under load control; an iterator of `Point`, from up to three earlier ones
    or the unloaded state; largest: step of the load factor; tolerance: of the last step, relative to the state.

    adaptive: False starts Newton's method at the last state, and accepts any state that it converges to; True
    extrapolates, and halves steps that fail, end far from their prediction or lose stability. Raises Stopped where no
    equilibrium was found that continues the path.
    """
    known = list(points) or [Point(0.0, np.zeros(problem.size))]
    etas = np.asarray(etas, dtype=float)
    if not np.isfinite(etas).all() or (adaptive and (np.diff([known[-1].eta, *etas]) < 0).any()):
        refuse("follow", "etas", etas.tolist(), "finite load factors, ascending from the one to start from")
    if adaptive:
        return _steps(problem, known, etas, largest, tolerance)
    return _jumps(problem, known[-1], etas, tolerance)


def _jumps(problem, last, etas, tolerance):
    """One run of Newton's method per load factor, each from the previous state."""
    for eta in etas:
        x, iterations = newton(problem, last.x, eta, tolerance=tolerance)
        if x is None:
            raise Stopped(f"Newton's method does not converge at the load factor {eta:.6g}")
        last = Point(float(eta), x, iterations, problem.negative_modes(x, eta))
        yield last


def _steps(problem, known, etas, largest, tolerance):
    """Adaptive steps that reach each load factor exactly."""
    step = largest
    for target in etas:
        work = 0
        while known[-1].eta < target:
            last = known[-1]
            # equal parts of the remaining distance, so that no tiny step remains before the target
            parts = max(math.ceil((target - last.eta) / step - 1e-9), 1)
            eta = float(target) if parts == 1 else last.eta + (target - last.eta) / parts
            start = _predicted(problem, known, eta)
            x, iterations = newton(problem, start, eta, last.x, tolerance=tolerance)
            work += iterations
            negative = problem.negative_modes(x, eta) if x is not None else 0
            if x is None or negative or np.abs(x - start).max() > 0.3 * np.abs(x).max():
                step = (eta - last.eta) / 2
                if step < 1e-5:
                    raise Stopped(_why(x, last.eta))
                continue
            if iterations <= 5:
                step = min(2 * step, largest)
            known = [*known[-2:], Point(eta, x, 0, negative)]
        yield replace(known[-1], iterations=work)


def _why(x, eta):
    """The message for a path that ends at the load factor eta."""
    found = "Newton's method does not converge" if x is None else "what Newton's method finds is not on the stable path"
    return f"{found} beyond the load factor {eta:.4f}: load control ends here"


def _predicted(problem, known, eta):
    """Extrapolation through the last three points, along the tangent if there is only one."""
    if len(known) == 1:
        last = known[0]
        return last.x + (eta - last.eta) * problem.linearise(last.x, last.eta, last.x)(problem.load(last.x))
    nodes = [p.eta for p in known]
    weights = [math.prod((eta - b) / (a - b) for b in nodes if b != a) for a in nodes]
    return sum(w * p.x for w, p in zip(weights, known, strict=True))


class Arc:
    """Steps along the arc length of (x, eta): they pass limit points, where K is singular but the bordered system is
    not.

    The arc length is sqrt(mean square of x / 0.05^2 + eta^2): a twentieth of L counts as much as a load factor of 1, so
    that steps resolve both the small displacements before a limit point and the load.
    """

    def __init__(self, problem):
        self.problem = problem
        self.origin = np.zeros(problem.size), 0.0
        self.tangent = self.tangent_at(*self.origin, (self.origin[0], 1.0))

    def product(self, a, b):
        """The inner product of two directions (dx, deta)."""
        return 400 * (a[0] @ b[0]) / len(a[0]) + a[1] * b[1]

    def tangent_at(self, x, eta, along):
        """Unit tangent (dx, deta) of the path, on the side of the direction `along`."""
        dx = self.problem.linearise(x, eta, x)(self.problem.load(x))
        raw = dx, 1.0
        size = math.copysign(math.sqrt(self.product(raw, raw)), self.product(raw, along))
        return dx / size, 1.0 / size

    def at(self, length, origin, tangent):
        """The point of the path at the projected distance `length` from
        `origin`; (None, iterations) where there is none."""
        (x0, eta0), (tx, teta) = origin, tangent
        x, eta, before = x0 + length * tx, eta0 + length * teta, x0
        for k in range(1, 16):
            right = np.column_stack([self.problem.residual(x, eta), self.problem.load(x)])
            dx, dx_eta = self.problem.linearise(x, eta, before)(right).T
            gap = self.product((x - x0, eta - eta0), tangent) - length
            deta = (self.product((dx, 0.0), tangent) - gap) / (self.product((dx_eta, 0.0), tangent) + teta)
            before, x, eta = x, x - dx + deta * dx_eta, eta + deta
            size = max(np.abs(x - before).max(), abs(deta))
            if not size < 10.0:
                return None, k
            if size <= TOLERANCE * max(np.abs(x).max(), 1.0):
                return (x, eta), k
        return None, 15

    def points(self, largest):
        """Endless iterator over the path from the unloaded state; yields
        (origin, tangent, length, point, its tangent)."""
        length = largest
        while True:
            found, iterations = self.at(length, self.origin, self.tangent)
            turned = self.tangent_at(*found, self.tangent) if found else None
            if found is None or self.product(turned, self.tangent) < 0.98:
                length /= 2
                if length < 1e-7 * largest:
                    raise Stopped(f"arc length cannot go on at the load factor {self.origin[1]:.4f}")
                continue
            yield self.origin, self.tangent, length, found, turned
            self.origin, self.tangent = found, turned
            length = min(2 * length, largest) if iterations <= 4 else length


def limit_point(problem, *, largest=0.02, beyond=10.0):
    """The first `Point` of the path where the load factor stops growing, to round-off of the arc length, or None where
    it passes `beyond` without one."""
    arc = Arc(problem)
    for origin, tangent, length, (_, eta), turned in arc.points(largest):
        if turned[1] <= 0:

            def growth(way, origin=origin, tangent=tangent):
                if way == 0:
                    return tangent[1]
                return arc.tangent_at(*arc.at(way, origin, tangent)[0], tangent)[1]

            way = brentq(growth, 0.0, length, xtol=1e-13, rtol=1e-13)
            x, eta = arc.at(way, origin, tangent)[0]
            return Point(eta, x)
        if eta > beyond:
            return None


def trace(problem, until, *, largest=0.02):
    """Points along the arc length from the unloaded state, past limit points, until until(eta, tip) is true."""
    found = [Point(0.0, np.zeros(problem.size))]
    for _, _, _, (x, eta), _ in Arc(problem).points(largest):
        found.append(Point(eta, x, 0, problem.negative_modes(x, eta)))
        if until(eta, problem.tip(x)):
            return found
