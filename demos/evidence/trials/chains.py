"""Figure 3's planar beams, the co-rotational one and the reconstructed MCRE, under the loads of the trials."""

from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace

import numpy as np
from comparison import corotational, mcre
from comparison import follow as path
from comparison.chain import Chain

from trials import problems
from trials.cells import Answer, Method, NotForIt, Stopped, load_factor_in

ELEMENTS = 64
#: In place of infinite stiffnesses, which a method does not support, in EI/L^2.
NEXT_TO_INFINITE = 1e10


class LoadedChain(Chain):
    """A chain along a line or arc under any tip load, in units of L, EI/L^2; law_of: (length, EA, GA) to a law."""

    def __init__(self, problem, elements, law_of):
        L = problem["length"]
        unit = problem["EI"] / L**2
        axial, shear = (min(problem[key] / unit, NEXT_TO_INFINITE) for key in ("EA", "GA"))
        column = SimpleNamespace(length=L, relative=(axial, shear, 0.0), arm=False)
        arc = L / problem["radius"] if problem["radius"] else 0.0
        size = 2 / arc * np.sin(arc / 2 / elements) * elements if arc else 1.0  # the chords' length
        super().__init__(column, elements, lambda length: law_of(length * size, axial, shear))
        self.angles = arc * (np.arange(elements) + 0.5) / elements
        self.force = np.array([*problem["force"][:2], problem["moment"][2] / L]) / unit
        self.follows = problem.get("follower", False)
        straight, self._size = self.law, size / elements
        self.law = lambda nodal: self._along(straight, nodal)

    def _along(self, law, nodal):
        """The law of elements along x, applied to elements at other angles, from which rotations are measured."""
        c, s = np.cos(self.angles), np.sin(self.angles)
        Q = np.zeros((len(nodal), 6, 6))
        for k in (0, 3):
            Q[:, k, k], Q[:, k, k + 1], Q[:, k + 1, k], Q[:, k + 1, k + 1] = c, s, -s, c
            Q[:, k + 2, k + 2] = 1.0
        gradient, hessian = law(np.einsum("nij,nj->ni", Q, nodal))
        return np.einsum("nji,nj->ni", Q, gradient), np.einsum("nji,njk,nkl->nil", Q, hessian, Q)

    def turn(self, angle):
        """Rotate clamp and loads about the clamp by an angle; returns a function that rotates a state likewise."""
        c, s = np.cos(angle), np.sin(angle)
        rotation = np.array([[c, -s], [s, c]])
        self.base = np.array([0.0, 0.0, angle])
        self.force = np.append(rotation @ self.force[:2], self.force[2])
        joints = self._size * np.cumsum(np.column_stack([np.cos(self.angles), np.sin(self.angles)]), axis=0)

        def along(x):
            nodes = x.reshape(-1, 3)
            moved = (joints + nodes[:, :2]) @ rotation.T - joints
            return np.column_stack([moved, nodes[:, 2] + angle]).ravel()

        return along

    def load(self, x):
        """Tip force and moment at load factor 1."""
        f = np.zeros(self.size)
        f[-3:] = self.force
        if self.follows:
            c, s = np.cos(x[-1]), np.sin(x[-1])
            f[-3:-1] = np.array([[c, -s], [s, c]]) @ self.force[:2]
        return f

    def _tangent(self, x, eta):
        band = super()._tangent(x, eta)
        if self.follows:  # dF/dtheta = e3 x F
            fx, fy = self.load(x)[-3:-1]
            band[5 - 2, -1] += eta * fy
            band[5 - 1, -1] -= eta * fx
        return band

    def negative_modes(self, x, eta):
        """Negative eigenvalues of the tangent; under follower loads of real ones of the unsymmetric tangent."""
        if not self.follows:
            return super().negative_modes(x, eta)
        found = np.linalg.eigvals(dense(self._tangent(x, eta)))
        return int(((found.real < 0) & (np.abs(found.imag) < 1e-9 * np.abs(found.real))).sum())

    def tip_moved(self, x):
        """(3,) m, displacement of the tip."""
        return np.array([*x[-3:-1], 0.0]) * self.column.length


def dense(band):
    """The matrix of scipy's general band of half width 5."""
    n = band.shape[1]
    i, j = np.indices((n, n))
    inside = np.abs(i - j) <= 5
    K = np.zeros((n, n))
    K[inside] = band[(5 + i - j)[inside], j[inside]]
    return K


class Guided:
    """A chain whose tip moves along y only and does not rotate, as a problem of `follow`."""

    def __init__(self, chain):
        self.chain, self.size = chain, chain.size - 2
        self._kept = np.append(np.arange(chain.size - 3), chain.size - 2)

    def whole(self, x):
        full = np.zeros(self.chain.size)
        full[self._kept] = x
        return full

    def residual(self, x, eta):
        return self.chain.residual(self.whole(x), eta)[self._kept]

    def load(self, x):
        return self.chain.load(self.whole(x))[self._kept]

    def _matrix(self, x, eta):
        return dense(self.chain._tangent(self.whole(x), eta))[np.ix_(self._kept, self._kept)]

    def linearise(self, x, eta, before):
        return partial(np.linalg.solve, self._matrix(x, eta))

    def negative_modes(self, x, eta):
        return int((np.linalg.eigvalsh(self._matrix(x, eta)) < 0).sum())


@dataclass(frozen=True)
class ChainMethod(Method):
    """See `cells.Method`; law_of: see `LoadedChain`."""

    key: str
    title: str
    what: str
    law_of: object
    spatial, turn = False, (0.0, 0.0, 1.2)

    def solve(self, problem, jump=False):
        """An `Answer` under load control."""
        if not problems.in_a_plane(problem):
            raise NotForIt("it knows a plane alone")
        chain = LoadedChain(problem, _elements(problem), self.law_of)
        if "history" in problem:
            return self._in_stages(chain, problem["history"])
        model = Guided(chain) if problem.get("guided") else chain
        points, stopped = [], None
        try:
            points.extend(path.follow(model, problem["load_factors"], adaptive=not jump))
        except path.Stopped as why:
            stopped = str(why)
        if stopped:
            raise Stopped(stopped, 0.0 if jump else load_factor_in(stopped))
        if "turn" in problem:
            return self._turned(chain, points[-1], problem["turn"][2])
        x = [point.x if model is chain else model.whole(point.x) for point in points]
        negative = max(point.negative_modes for point in points)
        work = sum(point.iterations for point in points)
        stable = np.array([point.negative_modes == 0 for point in points])
        tips = np.array([chain.tip_moved(each) for each in x])
        return Answer(tips, _said(negative), f"{chain.elements} elements", (), work, stable)

    def _turned(self, chain, point, angle):
        """The end of the path, rotated with clamp and loads in parts of the angle, and solved again after each part."""
        x, parts = point.x, 12
        for _ in range(parts):
            base = chain.base[2]
            x = chain.turn(angle / parts)(x)
            chain.base[2] = base + angle / parts
            found, _ = path.newton(chain, x, point.eta)
            if found is None:
                raise Stopped(
                    f"Newton's method does not converge when all is turned by {chain.base[2]:.3g} rad", np.nan
                )
            x = found
        return Answer(chain.tip_moved(x)[None], _said(chain.negative_modes(x, point.eta)))

    def _in_stages(self, chain, history):
        whole, x, before = chain.force.copy(), np.zeros(chain.size), (0.0, 0.0)
        for stage in history:
            for part in (0.25, 0.5, 0.75, 1.0):
                factors = (1 - part) * np.array(before) + part * np.array(stage)
                chain.force = whole * factors[[0, 0, 1]]
                found, _ = path.newton(chain, x, 1.0)
                if found is None:
                    raise Stopped(
                        f"Newton's method does not converge at force {factors[0]:g}, moment {factors[1]:g}",
                        min(factors),
                    )
                x = found
            before = stage
        return Answer(chain.tip_moved(x)[None], _said(chain.negative_modes(x, 1.0)))

    def numerics(self, key):
        if key != "residual":
            return super().numerics(key)
        problem = problems.column([0.9], 1e3)
        chain = LoadedChain(problem, ELEMENTS, self.law_of)
        try:
            (point,) = path.follow(chain, problem["load_factors"])
        except path.Stopped as why:
            raise Stopped(why, load_factor_in(why)) from None
        further = point.x - chain.linearise(point.x, point.eta, point.x)(chain.residual(point.x, point.eta))
        ratio = problems.column_truth(problem)[0, 1] / chain.tip_moved(further)[1]
        tip = ratio * chain.tip_moved(point.x)[None]
        return problem, Answer(tip, note="against one more iteration on the same mesh"), None, ""


def _said(negative):
    """The warning of a number of negative modes."""
    return f"unstable, {negative} negative modes" if negative else ""


def _elements(problem):
    """Number of elements: few in trials of locking, and where unsymmetric eigenvalues are computed."""
    few = 8 if problem.get("coarse") else 16 if problem.get("follower") else ELEMENTS
    return few * problem.get("finer", 1)


CHAINS = (
    ChainMethod("corotational", "co-rotational\nbeam",
                f"Figure 3's planar two-node co-rotational Timoshenko beam, {ELEMENTS} elements, load control, halving "
                "steps", corotational.law),
    ChainMethod("mcre", "MCRE (re-\nconstruction)",
                f"Figure 3's reconstruction of the Modified Cosserat Rod Element: truncated rotations, {ELEMENTS} "
                "elements", mcre.law),
)  # fmt: skip
