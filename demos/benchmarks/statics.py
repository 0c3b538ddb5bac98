"""Published problems of statics: straight rods that bend far, and the cable."""

import math

import numpy as np
from gallery import SCENES, cable
from problem import Row, problem
from scipy.special import ellipk

import cosserat_fenicsx as cf
from cosserat_fenicsx import analytic

RIGID = {"shear": (np.inf, np.inf), "axial": np.inf}
STRONG = "tol = 1e-8"
X_AXIS = cf.Line((0, 0, 0), (1.0, 0, 0), d1=(0, 1, 0))


def held(rod, *loads):
    """A rod clamped at its start."""
    return cf.Scene([rod], [cf.Clamp(rod.start)], loads)


def moved(path, k=slice(None)):
    """Estimated errors of displacements at points of a path, m."""
    return (path.errors.position * path.largest_displacement())[k]


def turned(path, k=slice(None)):
    """Estimated errors of rotations at points of a path, rad; of sections that turn by less than half a turn."""
    return (path.errors.rotation * np.abs(path.rotation_angle(path.scene.rods[-1].end)))[k]


@problem(
    "Elastica: cantilever with a force across its tip",
    "statics",
    "K. Mattiasson, Int. J. Numer. Methods Eng. 17 (1981) 145, doi:10.1002/nme.1620170113, table 1",
    "L = 1 m, EI = 1 N m^2, inextensible, unshearable; dead force P L^2/EI = 1, 2, 5, 7, 10",
)
def elastica():
    rod = cf.Rod(X_AXIS, cf.Stiffness(**RIGID, bending=(1.0, 1.0), torsion=1.0))
    path = cf.solve(held(rod, cf.Force(rod.end, (0, 0, 1.0))), [1.0, 2.0, 5.0, 7.0, 10.0], tol=1e-8)
    tip, because = path.displacement(rod.end), "digits printed"
    across, along = [0.30172, 0.49346, 0.71379, 0.76737, 0.81061], [0.05643, 0.16064, 0.38763, 0.47293, 0.55500]
    exact = [0.4613519497, 0.7817498316, 1.2153681176, 1.3349598575, 1.4302855388]
    rows = [
        Row("deflection w/L", np.array(across), tip[:, 2], moved(path), 5.1e-6, because),
        Row("shortening u/L", np.array(along), -tip[:, 0], moved(path), 5.1e-6, because),
        Row("angle of the tip, rad (elliptic integrals)", np.array(exact), path.rotation_angle(rod.end), turned(path),
            2e-9, STRONG),
    ]  # fmt: skip
    return rows, path.plot


@problem(
    "Roll-up of a straight rod to a circle",
    "statics",
    "L. Euler, De curvis elasticis (1744): M = EI/R; J. C. Simo & L. Vu-Quoc, Comput. Methods Appl. Mech. Eng. 58 "
    "(1986) 79, doi:10.1016/0045-7825(86)90079-4",
    "L = 1 m, EI = 2 N m^2, EA = GA = 200 N; end moment 2 pi k EI/L with k = 1/2, 1, 2",
)
def roll_up():
    rod = cf.Rod(X_AXIS, cf.Stiffness((200.0, 200.0), 200.0, (2.0, 2.0), 2.0))
    path = cf.solve(held(rod, cf.Moment(rod.end, (0, 0, 4 * np.pi))), [0.5, 1.0, 2.0], tol=1e-8)
    exact = np.array([[0, 2 / np.pi, 0], [0, 0, 0], [0, 0, 0]])
    tip = path.position(rod.end)
    error = np.repeat(moved(path)[:, None], 3, axis=1)
    rows = [Row("tip (x, y, z) at k = 1/2, 1, 2, m", exact.ravel(), tip.ravel(), error.ravel(), 1e-8, "tol = 1e-8")]
    return rows, path.plot


@problem(
    "Unrolling of a circular cantilever",
    "statics",
    "A. Ibrahimbegovic, Comput. Methods Appl. Mech. Eng. 122 (1995) 11, doi:10.1016/0045-7825(95)00724-F, example 1; "
    "printed: ten curved 3-node elements",
    "circle of circumference 10, E = 1200, nu = 0, unit square; end moments 10 pi and 20 pi against its curvature",
    "Printed beside the exact (0, 6.366, -3.141) and (10, 0, -6.283): its ten straight elements find (-0.158, 6.159, "
    "-3.090) and (9.663, 0.497, -6.180).",
)
def unrolling():
    R = 10 / (2 * np.pi)
    rod = cf.Rod(cf.Arc((0, R, 0), (0, 0, 0), 2 * np.pi), cf.Stiffness((600.0, 600.0), 1200.0, (100.0, 100.0), 100.0))
    path = cf.solve(held(rod, cf.Moment(rod.end, (0, 0, -10 * np.pi))), [1.0, 2.0])
    tip, because = path.displacement(rod.end), "ten elements"
    rows = [
        Row("along x, half unrolled and straight", np.array([-0.004, 9.998]), tip[:, 0], moved(path), 6e-3, because),
        Row("along y, the same", np.array([6.364, 0.017]), tip[:, 1], moved(path), 0.018, because),
        Row("the same, exact", np.array([0, 20 / np.pi, 10.0, 0]), tip[:, :2].ravel(), moved(path).repeat(2), 1e-5,
            "tol = 1e-6"),
    ]  # fmt: skip
    return rows, path.plot


@problem(
    "Eccentric column beyond its limit load",
    "statics",
    "A verification of the Cosserat rod implementation for drill-string dynamics under large displacement conditions, "
    "section 3 and eq. (8); strong form by shooting with 40 digits",
    "L = 20 m, round, d = 0.2 m, E = 210 GPa, nu = 0.3, dead force eta pi^2 EI/(2L)^2 and moment F e, e = 0.2 m",
    "Eq. (8), the secant formula, is of second order: 3.8 % too large at eta = 0.9, and infinite at 1.",
)
def eccentric_column():
    found = cf.read(SCENES / "eccentric_cantilever.toml")
    etas = [0.1, 0.5, 0.85, 0.9, 1.0, 1.5]
    path = cf.solve(found.scene, etas, tol=1e-8)
    delta, error = path.displacement("column.end")[:, 0], moved(path)
    exact = np.array([0.0274936056417, 0.2504165645190, 2.200615447828])
    formula = analytic.secant_delta(np.array(etas[:4]), 0.2)
    said = "second order: 3.8 % high at 0.9"
    rows = [
        Row("delta at eta = 0.1, 0.5, 0.9, strong form, m", exact, delta[[0, 1, 3]], error[[0, 1, 3]], 1e-8, STRONG),
        Row("the same at 0.1, 0.5, 0.85, 0.9, eq. (8), m", formula, delta[:4], error[:4], 0.04 * formula, said),
    ]
    return rows, path.plot


@problem(
    "Eccentric compression of a strut of a channel section",
    "statics",
    "S. Timoshenko, Strength of Materials I (1955), p. 263, problem 1; Ansys verification manual, VM14 (public in "
    "PyMAPDL examples)",
    "half length 60 in, channel 8 x 2.26 x 0.39 x 0.22 in, E = 30e6 psi, 4000 lb on the back of the web (0.6465 in)",
    "The secant formula gives 0.10877 in with these dimensions; the printed number has a rounded moment of inertia.",
)
def channel_strut():
    b, h, t, s, E, e, F = 2.26, 8.0, 0.39, 0.22, 30e6, 0.6465, 4000.0  # in, psi, lb
    A, web = 2 * b * t + s * (h - 2 * t), s * (h - 2 * t)
    centre = (b * b * t + web * s / 2) / A
    inertia = 2 * (t * b**3 / 12 + b * t * (b / 2 - centre) ** 2) + web * (s**2 / 12 + (centre - s / 2) ** 2)
    section = cf.Stiffness((E * A / 2.6,) * 2, E * A, (1e3 * E, E * inertia), 1e3 * E)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 60.0)), section, name="strut")
    path = cf.solve(held(rod, cf.EccentricForce(rod.end, (0, 0, -F), (e, 0.0))), [1.0])
    M = abs(path.moment(rod.start)[0, 1])
    sagged, bent = abs(path.displacement(rod.end)[0, 0]), M / inertia
    stresses = np.array([bent * (b - centre) - F / A, -bent * centre - F / A])
    rows = [
        Row("deflection, in", 0.1086, sagged, moved(path, 0), 2e-4, "rounded data"),
        Row("largest and least stress, psi", np.array([1803.63, -2394.53]), stresses,
            path.errors.moment[0] * bent * np.array([b - centre, centre]), 2.0, "rounded data"),
    ]  # fmt: skip
    return rows, lambda file: path.plot(file, magnify=50)


@problem(
    "Cantilever under its own weight",
    "statics",
    "MoorDyn, tests/beam.cpp (public): tip of the linear theory, w L^4/(8 EI)",
    "L = 10 m, EI = 1e7 N m^2, 100 kg/m, 9.80665 m/s^2",
    "MoorDyn accepts its own rod within 50 %.",
)
def heavy_cantilever():
    section = cf.Stiffness((1e10, 1e10), 1e10, (1e7, 1e7), 1e7, mass=100.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (10.0, 0, 0)), section)
    path = cf.solve(held(rod, cf.Weight((0, 0, -9.80665))), [1.0])
    sag = -path.displacement(rod.end)[0, 2]
    rows = [Row("deflection of the tip, m", 0.12258, sag, moved(path, 0), 2.5e-5, "linear theory")]
    return rows, lambda file: path.plot(file, magnify=10)


@problem(
    "Cable of 103 m over 100 m",
    "statics",
    "H. M. Irvine, Cable Structures (1981): elastic catenary",
    "as in demos/cable.toml: steel rope with its bending stiffness, pinned between two points, under its weight",
    "The catenary has no bending stiffness; that of the rope lifts the middle by about EI w/H^2.",
)
def hanging_cable():
    found = cf.read(SCENES / "cable.toml")
    path = cf.solve(found.scene, [1.0])
    check = cable(path)
    rows = [Row("sag, m", check.expected, float(check.found), moved(path, 0), check.allowed, "bending stiffness")]
    return rows, lambda file: path.plot(file, color="tension")


#: Axial and shear stiffness: the place (x, y) and the angle of the tip under the four loads, by quadrature.
FOLLOWER = {
    (np.inf, np.inf): (
        (0.935645669480692, 0.32064199467501253, 0.4958846424226547),
        (0.7673621915346397, 0.5738390625609318, 0.9682388025171631),
        (0.17227787539915096, 0.7806901427781027, 2.098157239940928),
        (-0.09212318118936946, 0.5469832645937337, 2.992714816235361),
    ),
    (400.0, 100.0): (
        (0.9319876524046942, 0.32989552590066806, 0.4961831565181062),
        (0.753902837872126, 0.5880274286900784, 0.9703297317867079),
        (0.1309096876218342, 0.7676897973720263, 2.1130084540021694),
        (-0.10204921753205468, 0.4679105607689557, 3.0089743246527023),
    ),
}


@problem(
    "Cantilever with a force that follows its tip",
    "statics",
    "J. H. Argyris & Sp. Symeonidis, Comput. Methods Appl. Mech. Eng. 26 (1981) 75, doi:10.1016/0045-7825(81)90131-6; "
    "numbers by quadrature of the elastica",
    "L = 1 m, EI = 1 N m^2, inextensible, or EA = 400 N, GA = 100 N; force across the tip, P L^2/EI = 1, 2, 5, 10",
    "The article shows curves, of the inextensible rod. A static equilibrium may flutter before.",
)
def follower_force():
    rows, because = [], "tol = 1e-8"
    for (EA, GA), truth in FOLLOWER.items():
        rod = cf.Rod(X_AXIS, cf.Stiffness((GA, GA), EA, (1.0, 1.0), 1.0))
        path = cf.solve(held(rod, cf.FollowerForce(rod.end, (1.0, 0, 0))), [1.0, 2.0, 5.0, 10.0], tol=1e-8)
        exact, name = np.array(truth), "inextensible" if np.isinf(EA) else "EA = 400 N"
        tip = path.position(rod.end)[:, :2].ravel()
        rows += [
            Row(f"tip (x, y), {name}, m", exact[:, :2].ravel(), tip, moved(path).repeat(2), 1e-8, because),
            Row(
                f"angle of the tip, {name}, rad", exact[:, 2], path.rotation_angle(rod.end), turned(path), 1e-8, because
            ),
        ]
    return rows, path.plot


@problem(
    "Buckled bar: the elastica beyond Euler's load",
    "statics",
    "S. P. Timoshenko & J. M. Gere, Theory of Elastic Stability (2nd ed., 1961), table 2-4; Ansys verification manual, "
    "VM136",
    "L = 1 m, EI = 1 N m^2, inextensible, clamped and free; loads at which the tip turns by 20 to 176 degrees",
    "The loads that are solved for are those of the elliptic integrals. The printed loads are cut, not rounded, and "
    "up to 0.0013 below them (2.541 for 2.5423 at 140 degrees); so are some of the printed coordinates.",
)
def buckled_bar():
    angles = np.array([20.0, 40.0, 60.0, 80.0, 100.0, 120.0, 140.0, 160.0, 176.0])
    loads = (2 / np.pi * ellipk(np.sin(np.radians(angles) / 2) ** 2)) ** 2
    x = np.array([0.970, 0.881, 0.741, 0.560, 0.349, 0.123, -0.107, -0.340, -0.577])
    y = np.array([0.220, 0.422, 0.593, 0.719, 0.792, 0.803, 0.750, 0.625, 0.421])
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness(**RIGID, bending=(4.0, 1.0), torsion=1.0))
    path = cf.solve(held(rod, cf.Force(rod.end, (0, 0, -(math.pi**2) / 4))), list(loads), branch=1)
    tip, error = path.position(rod.end), moved(path)
    because = "digits printed, some of which are cut"
    rows = [
        Row("height of the tip over L", x, tip[:, 2], error, 7e-4, because),
        Row("deflection of the tip over L", y, np.abs(tip[:, 0]), error, 6e-4, because),
        Row("angle of the tip, degrees", angles, np.degrees(path.rotation_angle(rod.end)), np.degrees(turned(path)),
            1e-3, "tol = 1e-6"),
    ]  # fmt: skip
    return rows, lambda file: path.plot(file, [0, 1, 3, 5, 7, 8])
