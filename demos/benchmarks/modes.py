"""Published problems of free vibration: beams, columns, cables, rings, blades, frames, a drill-string.

The mesh is refined until two meshes agree (`cf.modes`); the estimate is that of the result.
"""

import math

import numpy as np
from curves import charted
from problem import Row, problem
from scipy.optimize import brentq
from scipy.special import jn_zeros

import cosserat_fenicsx as cf

X_AXIS = cf.Line((0, 0, 0), (1, 0, 0))  # 1 m, d1 along y and d2 along z


def uniform(EI=(1.0, 1.0), mass=1.0, stiff=1e7, torsion=1e4, inertia=1e-8):
    """A section that neither shears nor stretches noticeably, without noticeable rotary inertia."""
    return cf.Stiffness((stiff, stiff), stiff, EI, torsion, mass=mass, inertia=(inertia,) * 3)


def swinging(found, axis):
    """The numbers of the modes that move mainly along x (0), y (1) or z (2), without those that only twist."""
    sizes = [np.abs(found.mode(k)).max(axis=0) for k in range(len(found))]
    return [k for k, size in enumerate(sizes) if size[axis] > 0.05 and np.argmax(size) == axis]


def compared(quantity, published, found, which, allowed, because, factor=1.0):
    """A `Row` of the frequencies of these modes, `factor` times those in Hz; `allowed` is relative."""
    ours = factor * found.frequencies[which]
    published = np.asarray(published)
    return Row(quantity, published, ours, ours * found.error[which] / 2, allowed * published, because)


def pictured(found):
    """Draws the first modes of a result."""
    return lambda file: found.plot(file)


def roots(function, upto, count, start=1e-3, pieces=2000):
    """The first `count` zeros of a function between `start` and `upto`."""
    grid = np.linspace(start, upto, pieces)
    values = np.array([function(x) for x in grid])
    places = np.flatnonzero(values[:-1] * values[1:] < 0)[:count]
    return np.array([brentq(function, grid[i], grid[i + 1], xtol=1e-13) for i in places])


@problem(
    "Clamped-free and free-free beam",
    "motion",
    "Euler-Bernoulli: cos(x) cosh(x) = -1 and +1; Rayleigh, The Theory of Sound (1877), chapter VIII",
    "L = 1 m, EI = 1 N m^2, 1 kg/m; GA and EA 1e7 N, no rotary inertia",
)
def slender_beams():
    factor, rows = 2 * math.pi, []
    for name, held, sign in (("clamped-free", True, 1), ("free-free", False, -1)):
        rod = cf.Rod(X_AXIS, uniform((1e4, 1.0)))
        found = cf.modes(cf.Scene([rod], [cf.Clamp(rod.start)] if held else []), 4 if held else 9, tol=1e-5)
        exact = roots(lambda x, sign=sign: math.cos(x) + sign / math.cosh(x), 12.0, 4 if held else 3, 1.0) ** 2
        rows.append(
            compared(f"{name}, rad/s", exact, found, swinging(found, 1)[-len(exact) :], 1e-4, "GA is finite", factor)
        )
    return rows, lambda file: found.plot(file, which=swinging(found, 1)[-3:])


def huang(EI, GA, mass, J, guess):
    """The circular frequency of a Timoshenko cantilever of 1 m next to a guess: the determinant of its solutions."""

    def determinant(omega):
        a, b = mass * omega**2 / GA, J * omega**2 / EI
        mean, root = (a + b) / 2, math.sqrt(((a - b) / 2) ** 2 + mass * omega**2 / EI)
        p, q = math.sqrt(root - mean), math.sqrt(root + mean)
        # w = cosh(p s), sinh(p s), cos(q s), sin(q s); theta = (w'' + a w)/w' of each
        up, down = (p**2 + a) / p, (q**2 - a) / q
        cp, sp, cq, sq = math.cosh(p), math.sinh(p), math.cos(q), math.sin(q)
        rows = [
            [1, 0, 1, 0],
            [0, up, 0, down],
            [up * p * cp, up * p * sp, -down * q * cq, -down * q * sq],
            [p * sp - up * sp, p * cp - up * cp, -q * sq + down * sq, q * cq - down * cq],
        ]
        return np.linalg.det(rows)

    return brentq(determinant, 0.97 * guess, 1.03 * guess, xtol=1e-13 * guess, rtol=1e-14)


@problem(
    "Thick beams, pinned and clamped",
    "motion",
    "Timoshenko, Phil. Mag. 41 (1921) 744, doi:10.1080/14786442108636264; Huang, J. Appl. Mech. 28 (1961) 579: "
    "frequency equations",
    "pinned: height L/10, nu = 0.3, shear factor 5/6; clamped-free: EI 2, GA 3e4, 1.5 kg/m, rotary inertia 1e-4 kg m",
)
def timoshenko_beams():
    height, nu = 0.1, 0.3
    rod = cf.Rod(X_AXIS, cf.Rectangle(5 * height, height, shear_factor=5 / 6), cf.Material(1e6, nu, 1.0))
    pinned = cf.modes(cf.Scene([rod], [cf.Hinge(rod.start, (0, 1, 0)), cf.Roller(rod.end, (0, 0, 1))]), 9)
    k, found, exact = rod.stiffness, pinned, []
    for n in (1, 2, 3):  # omega^4 rho A rho I/(GA EI) - omega^2 (rho A/EI + b^2 (rho A/GA + rho I/EI)) + b^4 = 0
        b, GA, EI, J = n * math.pi, k.shear[1], k.bending[0], k.inertia[0]
        squares = np.roots([k.mass * J / GA / EI, -(k.mass / EI + b**2 * (k.mass / GA + J / EI)), b**4])
        exact.append(math.sqrt(squares.min()))
    flat = swinging(found, 2)[:3]
    rows = [compared("pinned, rad/s", exact, found, flat, 1e-6, "estimate of the mesh", 2 * math.pi)]
    EI, GA, mass, J = 2.0, 3e4, 1.5, 1e-4
    rod = cf.Rod(X_AXIS, cf.Stiffness((GA, GA), 1e5, (50.0, EI), 1e2, mass=mass, inertia=(1e-2, J, 1e-2)))
    found = cf.modes(cf.Scene([rod], [cf.Clamp(rod.start)]), 8)
    soft = swinging(found, 1)[:4]
    slender = np.array([1.8751041, 4.6940911, 7.8547574, 10.9955407]) ** 2 * math.sqrt(EI / mass)
    exact = [huang(EI, GA, mass, J, guess) for guess in slender]
    rows.append(compared("clamped-free, rad/s", exact, found, soft, 1e-6, "estimate of the mesh", 2 * math.pi))
    return rows, pictured(found)


@problem(
    "Column under its load",
    "motion",
    "omega^2 = omega_0^2 (1 - P/P_cr): Timoshenko, Vibration Problems in Engineering (1928)",
    "pinned column of 1 m, EI = 1 N m^2, 1 kg/m, loads of 0 to 1.3 P_cr",
)
def column_under_load():
    rod = cf.Rod(X_AXIS, cf.Stiffness((1e6, 1e6), 1e6, (50.0, 1.0), 10.0, mass=1.0, inertia=(1e-4, 1e-6, 1e-4)))
    supports = [cf.Hinge(rod.start, (0, 0, 1)), cf.Roller(rod.end, (0, 1, 0))]
    scene = cf.Scene([rod], supports, [cf.Force(rod.end, (-(math.pi**2), 0, 0))])
    loads = np.array([0.0, 0.3, 0.6, 0.9, 1.3])
    found = [cf.modes(scene, 1, load_factor=eta) for eta in loads]
    squares = np.array([x.squares[0] for x in found]) / math.pi**4
    errors = np.abs(squares) * [x.error[0] for x in found]
    row = Row("omega^2/omega_0^2, loads of 0, 0.3, 0.6, 0.9, 1.3 P_cr, -", 1 - loads, squares, errors, 3e-5,
              "GA, EA and rotary inertia are finite")  # fmt: skip
    unstable = Row("number of negative modes", (loads > 1).astype(float),
                   np.array([float(x.negative_modes) for x in found]), 0.0, 0.1, "whole numbers")  # fmt: skip
    lines = [("1 - P/P_cr", loads, 1 - loads, "k--"), ("found", loads, squares, "o")]
    return [row, unstable], charted(
        "load over critical load (-)", "square of the frequency over that at rest (-)", lines
    )


@problem(
    "Hanging chain",
    "motion",
    "D. Bernoulli (1733): zeros of J0, omega = j/2 sqrt(g/L); Lamb, Higher Mechanics (1920)",
    "1 m, 1 kg/m, EI = 1e-5 N m^2 (a chain has none), hinged at its top, under its weight",
)
def hanging_chain():
    section = cf.Stiffness((1e6, 1e6), 1e6, (1e-5, 1e-5), 1e-5, mass=1.0, inertia=(1e-9,) * 3)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, -1)), section, name="chain")
    scene = cf.Scene([rod], [cf.Hinge(rod.start, (0, 1, 0))], [cf.Weight(permanent=True)])
    found = cf.modes(scene, 6, tol=1e-4)
    because = "bending stiffness: grows with the mode"
    exact = jn_zeros(0, 3) / 2 * math.sqrt(9.80665)
    return [compared("rad/s", exact, found, swinging(found, 0)[:3], 2e-3, because, 2 * math.pi)], pictured(found)


@problem(
    "Taut cable that sags",
    "motion",
    "Irvine & Caughey, Proc. R. Soc. A 341 (1974) 299, doi:10.1098/rspa.1974.0189: tan(x/2) = x/2 - 4/lambda^2 (x/2)^3",
    "100 m, straight and unstretched at rest, 1 kg/m, EA = 24 T^3/(w L)^2 with T = 10 kN; it sags by 1.2 m",
)
def sagging_cable():
    L, weight, T = 100.0, 9.80665, 1e4
    EA = 24 * T**3 / (weight * L) ** 2
    section = cf.Stiffness((EA, EA), EA, (0.5, 0.5), 1e6, mass=1.0, inertia=(1e-4, 1e-4, 2e-4))
    rod = cf.Rod(cf.Line((0, 0, 0), (L, 0, 0)), section, name="cable")
    ends = [cf.Hinge(x, (0, 1, 0)) for x in (rod.start, rod.end)]
    scene = cf.Scene([rod], ends, [cf.Weight()])
    H = cf.solve(scene, [1.0], tol=1e-4).force(rod.at(L / 2))[-1, 0]
    found = cf.modes(scene, 7, tol=1e-4, load_factor=1.0)
    slack = (weight * L / H) ** 2 * EA / H  # lambda^2
    factor = 2 * L / math.sqrt(H)  # frequencies over that of a string, sqrt(H/m)/(2 L)
    symmetric = roots(lambda x: (x / 2 - 4 / slack * (x / 2) ** 3) * math.cos(x / 2) - math.sin(x / 2), 12.0, 2, 0.1)
    up = swinging(found, 2)[:3]
    because = "theory of small sag (here 1/82), without bending"
    rows = [
        compared("in its plane, over the string's", [symmetric[0] / math.pi, 2.0, symmetric[1] / math.pi],
                 found, up, 2e-3, because, factor),
        compared("out of its plane, over the string's", [1.0, 2.0], found, swinging(found, 1)[:2], 2e-3,
                 because, factor),
    ]  # fmt: skip
    return rows, pictured(found)


@problem(
    "Beam whose width falls exponentially",
    "motion",
    "Cranch & Adler, J. Appl. Mech. 23 (1956) 103; guide VPCS of AFNOR, SDLL10 (code_aster V2.02.010)",
    "1 m, clamped at both ends, EI and mass exp(-2 s) N m^2 and kg/m",
)
def tapered_beam():
    def section(s):
        size = math.exp(-2 * s)
        return uniform((1e3 * size, size), size, 1e7 * size, 1e4 * size, 1e-8 * size)

    def clamped(k):  # w = exp(s) f, (D^2 - 1)^2 f = k^2 f, f = f' = 0 at the ends
        r, p = math.sqrt(k - 1), math.sqrt(k + 1)
        return (2 * r * p * (1 / math.cosh(p) - math.cos(r)) + (p**2 - r**2) * math.sin(r) * math.tanh(p)) / k

    rod = cf.Rod(X_AXIS, section, name="beam")
    found = cf.modes(cf.Scene([rod], [cf.Clamp(rod.start), cf.Clamp(rod.end)]), 4)
    exact = roots(clamped, 250.0, 4, 5.0)
    return [compared("rad/s", exact, found, swinging(found, 1), 5e-5, "GA is finite", 2 * math.pi)], pictured(found)


#: Flapping frequencies of a uniform blade without a hub over sqrt(EI/(m L^4)), by its rate over the same.
BLADE = {
    0: (3.5160, 22.0345, 61.6972),
    3: (4.7973, 23.3203, 62.9850),
    6: (7.3604, 26.8091, 66.6839),
    9: (10.2257, 31.7705, 72.3867),
    12: (13.1702, 37.6031, 79.6145),
}


@problem(
    "Flapping blade on a turning hub",
    "motion",
    "Wright, Smith, Thresher & Wang, J. Appl. Mech. 49 (1982) 197, doi:10.1115/1.3161966, table for a uniform blade",
    "uniform clamped blade without hub radius, rates of 0 to 12 sqrt(EI/(m L^4))",
)
def flapping_blade():
    rod = cf.Rod(X_AXIS, uniform((1e5, 1.0), torsion=1e5), name="blade")  # flaps along y, the axis of rotation
    rows, lines = [], []
    for rate, published in BLADE.items():
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Centrifugal((0, rate, 0))] if rate else [])
        found = cf.modes(scene, 3, tol=1e-5)
        rows.append(compared(f"rate {rate}, 1st to 3rd flap, -", published, found, [0, 1, 2], 3e-5,
                             "digits printed; GA is finite", 2 * math.pi))  # fmt: skip
    for k in range(3):
        ours = [row.ours[k] for row in rows]
        lines += [(f"flap {k + 1}", list(BLADE), ours, "-"), (None, list(BLADE), [x[k] for x in BLADE.values()], "ko")]
    return rows, charted("rate over sqrt(EI/(m L^4)) (-)", "frequency over the same (-)", lines)


@problem(
    "Frequencies of a thin ring",
    "motion",
    "Hoppe, J. reine angew. Math. 73 (1871) 158: n (n^2 - 1)/sqrt(n^2 + 1) in its plane; Love, Mathematical Theory of "
    "Elasticity (1927), section 293: n (n^2 - 1)/sqrt(n^2 + 1 + nu) across it",
    "free ring of 1 m radius of a round bar of 2 mm, nu = 0.3; over sqrt(EI/(m R^4))",
)
def thin_ring():
    rod = cf.Rod(cf.Arc((0, 0, 0), (1, 0, 0), 2 * math.pi), cf.Circle(2e-3), cf.Material(200e9, 0.3, 8000.0), "ring")
    found = cf.modes(cf.Scene([rod], joints=[cf.Joint(rod.end, rod.start)]), 18, tol=1e-4)
    n = np.array([2.0, 3.0, 4.0])
    factor = 2 * math.pi * math.sqrt(rod.stiffness.mass / rod.stiffness.bending[0])
    across = [k for k in range(6, 18) if np.abs(found.mode(k)[:, 2]).max() > 0.5]
    within = [k for k in range(6, 18) if k not in across]
    rows = []
    for name, which, extra in (("in its plane", within, 1.0), ("across it", across, 1.3)):
        exact = n * (n**2 - 1) / np.sqrt(n**2 + extra)
        rows.append(compared(f"{name}, pairs with n = 2, 3, 4, -", exact, found, which[::2], 1e-4,
                             "the bar is 1/500 of the radius thick", factor))  # fmt: skip
    return rows, lambda file: found.plot(file, which=[6, 8, 10, 12, 14, 16])
