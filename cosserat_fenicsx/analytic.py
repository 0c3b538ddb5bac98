"""Closed forms and high-precision references for a straight cantilever in a plane, independent of the solver.

The rod lies along z, clamped at s = 0, and bends in the x-z plane; theta turns z towards x (about y). Section 3 of the
paper compresses it by a dead tip force F = eta P_cr, P_cr = pi^2 EI/(2L)^2, with a tip moment M = F e: `secant_delta`
for small deflections, `elastica` by elliptic integrals, `reissner` with extension and shear. The last is a case of
`planar_tip` (any dead tip force and moment), as is `transverse_tip_force`. All follow the branch that starts unloaded.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import elliprd, elliprf, roots_legendre

from cosserat_fenicsx.checks import finite_array, instance, number, positive, refuse, stiffness, vector
from cosserat_fenicsx.errors import NotConverged


@dataclass(frozen=True, eq=False)
class Tip:
    """The motion of the tip; floats, or arrays of the shape of the load factors. Inertial components.

    Attributes:
        delta: transverse displacement along x, m.
        shortening: axial displacement towards the clamp (along -z), m.
        tip_rotation: theta at the tip, rad, continuous beyond pi.
    """

    delta: float | np.ndarray
    shortening: float | np.ndarray
    tip_rotation: float | np.ndarray


def secant_delta(eta, eccentricity):
    """Eq. (8) of the paper, the secant formula of small deflections: delta = e (sec(pi/2 sqrt(eta)) - 1).

    Args:
        eta: F/P_cr, a number or an array.
        eccentricity: e, m.

    Returns:
        delta, m: infinite at eta = 1, nan beyond, where the formula does not hold.

    Raises:
        SceneError: a negative or infinite eta, an eccentricity that is not positive.
    """
    eta = _load_factors("secant_delta", "eta", eta)
    e = positive("secant_delta", "eccentricity", eccentricity, "m")
    angle = np.pi / 2 * np.sqrt(np.where(eta < 1, eta, 0.0))
    delta = e * 2 * np.sin(angle / 2) ** 2 / np.cos(angle)  # sec - 1 without cancellation
    return np.where(eta < 1, delta, np.where(eta == 1, np.inf, np.nan))[()]


def elastica(eta, eccentricity, length):
    """The inextensible, unshearable rod under the constant tip moment M = F e, by elliptic integrals.

    Args:
        eta: F/P_cr, a number or an array.
        eccentricity: e, m.
        length: L, m.

    Returns:
        A `Tip`, to about 1e-14 for e/L >= 1e-2 (near eta = 1 the problem itself loses (e/L)^(-2/3) in accuracy).

    Raises:
        SceneError: a negative or infinite eta, a length that is not positive, or a tip that would turn by 2 pi or more
            (only where (e/L) sqrt(eta) > 4/pi), where the branch may turn back in eta (`reissner` follows it further).
    """
    eta = _load_factors("elastica", "eta", eta)
    e = positive("elastica", "eccentricity", eccentricity, "m")
    L = positive("elastica", "length", length, "m")
    return _as_tip([_elastica(math.pi / 2 * math.sqrt(value), e / L) for value in eta.flat], eta.shape, L)


def _elastica(p, ratio):
    """(delta/L, shortening/L, rotation) of the elastica: p = L sqrt(F/EI), ratio = e/L.

    EI theta'' = -F sin(theta) integrates to (L theta')^2 = 4 p^2 (k^2 - sin(theta/2)^2). At the tip L theta' = p^2 e/L
    = 2 p h and S, C = sin, cos(theta_L/2): k^2 = h^2 + S^2; at the clamp L theta' = 2 p k. Since theta' > 0 throughout,
    p = F(phi, k) with k sin(phi) = S, and the shortening is (2/p)(F - E). In Carlson's symmetric integrals (DLMF 19.25)
    F = S R_F and F - E = k^2 S^3 R_D/3, both of (h^2, k^2 C^2, k^2): regular through k = 1, where the pendulum of the
    kinetic analogy changes from oscillation to rotation. Beyond theta_L = pi they are twice the complete integrals less
    those of the remainder. Moments about the clamp, EI theta'(0) = M + F delta, give delta/L = 2 (k - h)/p
    = 2 S^2/(p (k + h)).
    """
    if p == 0:
        return 0.0, 0.0, 0.0
    h = p * ratio / 2

    def integrals(theta):
        """F and F - E of the rod whose tip has turned by theta."""
        S, C = math.sin(theta / 2), math.cos(theta / 2)
        k2 = h * h + S * S
        args = h * h, k2 * C * C, k2
        F, F_minus_E = S * elliprf(*args), k2 * S**3 * elliprd(*args) / 3
        if theta <= math.pi:
            return F, F_minus_E
        if h + C <= 0:  # k <= 1: theta turns back before it reaches this angle, however long the rod is
            return math.inf, math.inf
        half = (h - C) * (h + C), 0.0, k2  # k^2 - 1 first
        return 2 * elliprf(*half) - F, 2 * k2 * elliprd(*half) / 3 - F_minus_E

    # F rises with theta from 0, to infinity where h < 1 and to F(2 pi) otherwise.
    if integrals(2 * math.pi)[0] <= p:
        eta = (2 * p / math.pi) ** 2
        refuse("elastica", "eccentricity / length", ratio, f"less: at eta = {eta:g} the tip turns by 2 pi or more")
    theta = brentq(lambda x: min(integrals(x)[0], 2 * p) - p, 0, 2 * math.pi, xtol=1e-300, rtol=1e-15, maxiter=2000)
    F, F_minus_E = integrals(theta)
    if theta > math.pi / 2:  # here rounding of theta affects F much more than E, and F = p is known exactly
        F_minus_E += p - F
    S = math.sin(theta / 2)
    return 2 * S * S / (p * (math.hypot(h, S) + h)), 2 * F_minus_E / p, theta


def reissner(eta, eccentricity, length, *, bending, axial, shear, arm=False):
    """The extensible, shearable rod: N = EA (v_3 - 1), Q = GA v_1, M = EI theta' in the moving frame.

    After Reissner, Z. angew. Math. Phys. 23 (1972) 795, doi:10.1007/BF01602645.

    Args:
        eta: F/P_cr, a number or an array.
        eccentricity: e, m.
        length: L, m.
        bending: EI, N m^2.
        axial, shear: EA and GA with the shear factor in it, N; infinity is allowed.
        arm: False for the constant tip moment F e (`Moment`); True for the force on a rigid arm of length e that turns
            with the tip section, M = F e cos(theta_L) (`EccentricForce`).

    Returns and raises: see `planar_tip`.
    """
    eta = _load_factors("reissner", "eta", eta)
    e = positive("reissner", "eccentricity", eccentricity, "m")
    L = positive("reissner", "length", length, "m")
    P = math.pi**2 * positive("reissner", "bending", bending, "N m^2") / (2 * L) ** 2
    instance("reissner", "arm", arm, bool, "True or False")
    load = {"arm": e} if arm else {"moment": P * e}
    return planar_tip(eta, L, bending=bending, axial=axial, shear=shear, force=(0.0, -P), **load)


def transverse_tip_force(load, length=1.0):
    """The inextensible, unshearable cantilever under a dead transverse tip force P.

    After Mattiasson, Int. J. Numer. Methods Eng. 17 (1981) 145, doi:10.1002/nme.1620170113.

    Args:
        load: P L^2/EI, a number or an array.
        length: L, m; the default 1 gives w/L and u/L.

    Returns and raises: see `planar_tip`; w is delta, u is shortening.
    """
    load = _load_factors("transverse_tip_force", "load", load)
    L = positive("transverse_tip_force", "length", length, "m")
    return planar_tip(load, L, bending=L * L, force=(1.0, 0.0))


def planar_tip(load_factors, length, *, bending, axial=math.inf, shear=math.inf, force=(0.0, 0.0), moment=0.0, arm=0.0):
    """Tip of the planar Reissner rod under a dead tip force and moment, followed from the unloaded state.

    Args:
        load_factors: multiply force and moment; a number or an array in any order, none negative.
        length: L, m.
        bending: EI, N m^2.
        axial, shear: EA and GA with the shear factor in it, N; infinity is allowed.
        force: (F_x, F_z), N, inertial; F_z < 0 compresses.
        moment: M about y, N m; M > 0 moves the tip towards x.
        arm: the force acts at this offset along d_1 of the tip section, m.

    Returns:
        A `Tip` (of the tip section's centre, not of the arm's end), to about 1e-13.

    Raises:
        SceneError: a value outside its range.
        NotConverged: the branch ends, turns back or loses its stability in the plane before a requested load.
    """
    where = "planar_tip"
    factors = _load_factors(where, "load_factors", load_factors)
    L = positive(where, "length", length, "m")
    EI = positive(where, "bending", bending, "N m^2")
    EA, GA = stiffness(where, "axial", axial, "N"), stiffness(where, "shear", shear, "N")
    f_x, f_z = (component * L**2 / EI for component in vector(where, "force", force, "N", size=2))
    M = number(where, "moment", moment, "a finite number (N m)", math.isfinite) * L / EI
    a = number(where, "arm", arm, "a finite number (m)", math.isfinite) / L
    rod = _Rod(f_x, f_z, M, a, EI / EA / L**2, EI / GA / L**2)
    distinct, back = np.unique(factors, return_inverse=True)
    tips = np.array(list(rod.follow(distinct))).reshape(-1, 3)[back.ravel()]
    return _as_tip(tips, factors.shape, L)


@cache
def _gauss(n):
    """The n-stage Gauss method on [0, 1]: nodes, weights (n,), and (n, n) to integrals and Legendre's terms."""
    x, w = roots_legendre(n)
    P = np.polynomial.legendre.legvander(x, n)
    j = np.arange(n)
    coefficients = (j[:, None] + 0.5) * P[:, :n].T * w
    # The integral of P_j from -1 is (P_{j+1} - P_{j-1})/(2j+1).
    integrals = np.column_stack([x + 1, (P[:, 2:] - P[:, :-2]) / (2 * j[1:] + 1)])
    return (x + 1) / 2, w / 2, integrals @ coefficients / 2, coefficients


class _Rod:
    """The rod in units of L and EI/L^2; unknown: kappa = theta' at the nodes of one step of the Gauss method, order 2n.

    The contact force is the tip force, so N = f_x sin(theta) + f_z cos(theta), Q = f_x cos(theta) - f_z sin(theta) and
    r' = (1 + N/EA) d_3 + Q/GA d_1; hence m' = -(r' x n)_y = -Q (1 + (1/EA - 1/GA) N). With theta = int_0^s kappa and
    kappa = m(1) - int_s^1 m' this is an integral equation of the second kind, well conditioned for every n, EA and GA.
    """

    def __init__(self, f_x, f_z, moment, arm, axial, shear):
        self.f_x, self.f_z, self.moment, self.arm, self.axial, self.shear = f_x, f_z, moment, arm, axial, shear

    def strains(self, theta):
        """sin, cos, N and Q of one unit of load at the angles theta."""
        s, c = np.sin(theta), np.cos(theta)
        return s, c, self.f_x * s + self.f_z * c, self.f_x * c - self.f_z * s

    def newton(self, load, kappa):
        """(kappa, d kappa/d load) where Newton's method converges to a state that is stable in the plane, else None."""
        _, w, A, _ = _gauss(len(kappa))
        rest = w - A  # integrals from each node to 1
        stretch, last = load * (self.axial - self.shear), False
        for _ in range(12):
            _, _, N, Q = self.strains(A @ kappa)
            _, _, N_tip, Q_tip = self.strains(w @ kappa)
            moment = self.moment - self.arm * N_tip  # a d_1 x f, about y
            residual = kappa - load * moment - load * (rest @ (Q * (1 + stretch * N)))
            slope = load * (N * (1 + stretch * N) - stretch * Q * Q)
            jacobian = np.eye(len(kappa)) + rest @ (slope[:, None] * A) + load * self.arm * Q_tip * w
            by_load = -moment - rest @ (Q * (1 + 2 * stretch * N))
            try:
                step, tangent = np.linalg.solve(jacobian, np.column_stack([residual, by_load])).T
            except np.linalg.LinAlgError:
                return None
            if last:  # the determinant is 1 without load and changes sign where one mode loses its stability
                return (kappa - step, -tangent) if np.linalg.slogdet(jacobian)[0] > 0 else None
            kappa = kappa - step
            last = np.abs(step).max() <= 1e-9 * np.abs(kappa).max()
        return None

    def follow(self, loads):
        """(delta, shortening, rotation) at the ascending loads, by predictor and corrector from the unloaded state."""
        load, kappa, step = 0.0, np.zeros(32), math.inf
        tangent = self.newton(load, kappa)[1]
        for target in loads:
            while load < target:
                trial = min(load + step, target)
                predicted = kappa + (trial - load) * tangent
                found = self.newton(trial, predicted)
                # A state far from its prediction may lie on another branch, although Newton's method converged.
                if found is None or np.abs(found[0] - predicted).max() > 0.3 * np.abs(found[0]).max():
                    step = (trial - load) / 2
                    if step < 1e-9 * target:
                        raise NotConverged(f"planar_tip: the branch ends or turns back at load factor {load:.9g}")
                    continue
                step = max(step, 2 * (trial - load))
                load, (kappa, tangent) = trial, self.resolve(trial, *found)
            yield self.tip(load, kappa)

    def resolve(self, load, kappa, tangent):
        """The same state with as many nodes as resolve it: the last Legendre coefficients are small."""
        while True:
            _, _, A, coefficients = _gauss(len(kappa))
            s, c, _, _ = self.strains(A @ kappa)
            size = np.abs(kappa).max() or 1.0
            if np.abs(coefficients[-3:] @ np.column_stack([kappa / size, s, c])).max() < 1e-10:
                return kappa, tangent
            nodes = _gauss(2 * len(kappa))[0]
            finer = np.polynomial.legendre.legval(2 * nodes - 1, coefficients @ kappa)
            found = self.newton(load, finer) if len(nodes) <= 1024 else None
            if found is None:
                raise NotConverged(f"planar_tip: 1024 nodes do not resolve the rod at load factor {load:.9g}")
            kappa, tangent = found

    def tip(self, load, kappa):
        """(delta, shortening, rotation); 1 - z' is written without cancellation."""
        _, w, A, _ = _gauss(len(kappa))
        s, c, N, Q = self.strains(A @ kappa)
        stretch, slip = load * self.axial * N, load * self.shear * Q
        shortening = w @ (2 * np.sin(A @ kappa / 2) ** 2 - stretch * c + slip * s)
        return w @ ((1 + stretch) * s + slip * c), shortening, w @ kappa


def _load_factors(owner, field, value):
    """A float array of finite numbers, none negative."""
    expected = "finite numbers, none negative"
    array = finite_array(owner, field, value, expected)
    if (array < 0).any():
        refuse(owner, field, value, expected)
    return array


def _as_tip(tips, shape, length):
    """A `Tip` from rows of (delta/L, shortening/L, rotation)."""
    columns = np.array(tips, dtype=float).reshape(*shape, 3)
    return Tip(columns[..., 0] * length, columns[..., 1] * length, columns[..., 2].copy()[()])
