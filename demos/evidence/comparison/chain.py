"""A chain of two-node planar elements, (u, w, theta) at every node, clamped at the first: banded Newton systems.

u is axial (along z), w transverse (along x), in units of L; forces in EI/L^2. An element law takes nodal unknowns
(n, 6) and gives the gradient (n, 6) and the Hessian (n, 6, 6) of the elements' energies; `law_of(length)` returns it.
"""

import numpy as np
from scipy.linalg import eigvals_banded, solve_banded

from comparison.column import CRITICAL, Column, Curve
from comparison.follow import Stopped, follow
from cosserat_fenicsx.checks import refuse

_BAND = 5  # the half bandwidth of node-by-node numbering


class Chain:
    """A column of equal elements as a problem of `follow`; unknowns: (u, w, theta) of the free nodes."""

    def __init__(self, column, elements, law_of):
        if not isinstance(elements, int | np.integer) or elements < 1:
            refuse("Chain", "elements", elements, "a whole number above zero")
        self.column, self.elements, self.law = column, elements, law_of(1 / elements)
        self.size = 3 * elements
        self.base = np.zeros(3)  # displacement and rotation of the clamp
        self._e = column.relative[2]

    def residual(self, x, eta):
        """Internal minus external forces."""
        gradient, _ = self.law(self._nodal(x))
        internal = gradient[:, 3:].copy()
        internal[:-1] += gradient[1:, :3]
        return internal.ravel() - eta * self.load(x)

    def load(self, x):
        """Tip force and moment at eta = 1."""
        f = np.zeros(self.size)
        f[-3] = -CRITICAL
        f[-1] = CRITICAL * self._e * (np.cos(x[-1]) if self.column.arm else 1.0)
        return f

    def linearise(self, x, eta, before):
        """Solve with the tangent, by elimination with row exchanges within the band."""
        band = self._tangent(x, eta)
        return lambda b: solve_banded((_BAND, _BAND), band, b)

    def negative_modes(self, x, eta):
        """Negative eigenvalues of the symmetric tangent."""
        lower = self._tangent(x, eta)[_BAND:]
        if not np.isfinite(lower).all():
            return self.size
        # scaled to a unit diagonal, which leaves the count unchanged and reduces the range of the eigenvalues
        scale = 1 / np.sqrt(np.abs(lower[0]) + 1e-300)
        scaled = np.array([row * scale * np.roll(scale, -k) for k, row in enumerate(lower)])
        return int((eigvals_banded(scaled, lower=True) < 0).sum())

    def tip(self, x):
        """(delta, shortening, rotation) of the tip: m, m, rad."""
        u, w, theta = x[-3:]
        return w * self.column.length, -u * self.column.length, theta

    def _nodal(self, x):
        nodes = np.vstack([self.base, x.reshape(-1, 3)])
        return np.hstack([nodes[:-1], nodes[1:]])

    def _tangent(self, x, eta):
        """K as scipy's general band: K[i, j] at [5 + i - j, j]."""
        _, hessian = self.law(self._nodal(x))
        band = np.zeros((2 * _BAND + 1, self.size))
        for i in range(3):
            for j in range(3):
                band[_BAND + i - j, j::3] = hessian[:, 3 + i, 3 + j]
                band[_BAND + i - j, j:-3:3] += hessian[1:, i, j]
                band[_BAND + i - j - 3, 3 + j :: 3] = hessian[1:, i, 3 + j]
                band[_BAND + i - j + 3, j:-3:3] = hessian[1:, 3 + i, j]
        if self.column.arm:
            band[_BAND, -1] += eta * CRITICAL * self._e * np.sin(x[-1])
        return band


def of(law):
    """(problem, solve) of columns whose elements have a law(length, EA, GA), in units of EI/L^2.

    problem(elements, column=None): a `Chain` of equal elements, of the paper's column by default. solve(etas, elements,
    column=None, adaptive=True): its `Curve` under load control through ascending load factors F/P_cr; `stopped` gives
    the reason if it ends early. adaptive: False takes each load factor in one step and accepts any state that Newton's
    method converges to. Raises SceneError: a number of elements that is not whole and positive, load factors that are
    no numbers or descend.
    """

    def problem(elements, column=None):
        column = column or Column()
        axial, shear, _ = column.relative
        return Chain(column, elements, lambda length: law(length, axial, shear))

    def solve(etas, elements, *, column=None, adaptive=True):
        chain, points, stopped = problem(elements, column), [], ""
        try:
            points.extend(follow(chain, etas, adaptive=adaptive))
        except Stopped as why:
            stopped = str(why)
        return Curve.of(chain, points, stopped)

    return problem, solve
