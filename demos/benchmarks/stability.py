"""Published problems of stability: columns, frames, strips, and rods under torque."""

import math
from dataclasses import dataclass

import numpy as np
from curves import curve
from gallery import SCENES
from problem import Row, problem
from scipy.optimize import brentq
from statics import RIGID, held

import cosserat_fenicsx as cf
from cosserat_fenicsx.parts import ForcePerLength
from cosserat_fenicsx.scene.action import vector
from cosserat_fenicsx.scene.rod import RodOrName

UPRIGHT = cf.Line((0, 0, 0), (0, 0, 1.0), d1=(1, 0, 0))
TIMOSHENKO = "S. P. Timoshenko & J. M. Gere, Theory of Elastic Stability (2nd ed., 1961)"


def guided(station, turning=True):
    """Supports of a column's end that may move along z alone; turning: whether it may turn."""
    sides = [cf.Roller(station, (1, 0, 0)), cf.Roller(station, (0, 1, 0))]
    return sides if turning else [*sides, cf.Prescribed(station, rotation=(0, 0, 0))]


def critical(quantity, published, found, allowed, because, k=0):
    """A `Row` of a load factor of linear buckling; `allowed` is relative."""
    ours = found.load_factors[k]
    return Row(quantity, published, ours, ours * found.error[k], allowed * published, because)


def event(quantity, published, path, allowed, because, k=0):
    """A `Row` of a limit point or a bifurcation of a path; `allowed` is relative."""
    ours = path.events[k].load_factor
    return Row(quantity, published, ours, abs(ours) * path.events[k].error, abs(allowed * published), because)


def mode_of(found):
    """Draws the first mode."""
    return lambda file: found.plot(file, [0])


@problem(
    "Columns with four kinds of ends",
    "stability",
    f"L. Euler 1744 and 1757; {TIMOSHENKO}, chapter 2: P L^2/EI = pi^2/4, pi^2, 20.19, 4 pi^2",
    "L = 1 m, EI = 1 N m^2, inextensible: clamped and free; hinged twice; clamped and hinged; clamped twice",
)
def euler_columns():
    rod = cf.Rod(UPRIGHT, cf.Stiffness(**RIGID, bending=(1.0, 4.0), torsion=1.0))
    propped = brentq(lambda x: math.tan(x) - x, 4.4, 4.6) ** 2
    hinge, load, rows = cf.Hinge(rod.start, (1, 0, 0)), cf.Force(rod.end, (0, 0, -1.0)), []
    for name, supports, exact in (
        ("clamped and free", [cf.Clamp(rod.start)], math.pi**2 / 4),
        ("hinged twice", [hinge, *guided(rod.end)], math.pi**2),
        ("clamped and hinged, tan x = x", [cf.Clamp(rod.start), *guided(rod.end)], propped),
        ("clamped twice", [cf.Clamp(rod.start), *guided(rod.end, turning=False)], 4 * math.pi**2),
    ):
        found = cf.buckling(cf.Scene([rod], supports, [load]), tol=1e-6)
        rows.append(critical(f"P L^2/EI, {name}", exact, found, 1e-6, "tol = 1e-6"))
    return rows, mode_of(found)


@problem(
    "Column that shears: springs and latticed columns",
    "stability",
    "J. A. Haringx, Philips Res. Rep. 3 (1948) 401: P (1 + P/GA) = P_E; F. Engesser 1891: P = P_E/(1 + P_E/GA)",
    "clamped and free, L = 1 m, EI = 1 N m^2, GA = 20 N and 2 N, incompressible",
    "Two theories of one century. This package's shear force acts along the turned section, which is Haringx's: his "
    "loads come out, and Engesser's are lower by 1.1 % and by 23 %.",
)
def sheared_columns():
    rows, euler = [], math.pi**2 / 4
    for GA in (20.0, 2.0):
        rod = cf.Rod(UPRIGHT, cf.Stiffness((GA, GA), np.inf, (1.0, 4.0), 1.0))
        path = cf.solve(held(rod, cf.Force(rod.end, (0, 0, -1.0))), (0.0, 1.3 * euler), model="spatial")
        haringx, engesser = GA / 2 * (math.sqrt(1 + 4 * euler / GA) - 1), euler / (1 + euler / GA)
        rows.append(event(f"P, N, GA = {GA:g} N, Haringx", haringx, path, 2e-6, "located to 1e-6"))
        rows.append(event(f"the same, Engesser, GA = {GA:g} N", engesser, path, 0.4, "another theory of shear"))
    GA = np.linspace(1.5, 21.0, 200)
    lines = {
        "Haringx": (GA, GA / 2 * (np.sqrt(1 + 4 * euler / GA) - 1)),
        "Engesser": (GA, euler / (1 + euler / GA)),
        "here": ([20.0, 2.0], [rows[0].ours, rows[2].ours]),
    }
    return rows, lambda file: curve(file, lines, "shear stiffness GA (N)", "critical load (N)")


@problem(
    "Column under its own weight",
    "stability",
    "A. G. Greenhill, Proc. Camb. Philos. Soc. 4 (1881) 65: q L^3/EI = 7.8373, root of J_(-1/3)",
    "clamped at its foot, L = 1 m, EI = 1 and 1.5 N m^2 about its two axes, inextensible",
)
def self_weight():
    rod = cf.Rod(UPRIGHT, cf.Stiffness(**RIGID, bending=(1.0, 1.5), torsion=0.5, mass=1 / 9.81))
    found = cf.buckling(held(rod, cf.Weight()), 2, tol=1e-6)
    exact, because = 7.837347438943484, "tol = 1e-6"
    rows = [
        critical("q L^3/EI about the weak axis", exact, found, 1e-6, because),
        critical("the same about the other, times 1.5", 1.5 * exact, found, 1e-6, because, 1),
    ]
    return rows, mode_of(found)


@problem(
    "Cantilever strip that turns over",
    "stability",
    f"L. Prandtl 1899; {TIMOSHENKO}, section 6.3: P L^2/sqrt(EI GJ) = 4.013, root of J_(-1/4)",
    "L = 1 m, EI = 1 N m^2 sideways, GJ = 0.7 N m^2, the other bending stiffness 1e4 N m^2, force across the tip",
    "The formula has an infinite bending stiffness in the plane of the load; 1e4 raises the load by 5e-5.",
)
def lateral_buckling():
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), cf.Stiffness(**RIGID, bending=(1e4, 1.0), torsion=0.7))
    found = cf.buckling(held(rod, cf.Force(rod.end, (0, math.sqrt(0.7), 0))), tol=1e-6)
    path = cf.solve(held(rod, cf.Force(rod.end, (0, math.sqrt(0.7), 0))), (0.0, 4.5))
    exact, because = 4.012599343578902, "bending in the plane"
    rows = [
        critical("P L^2/sqrt(EI GJ), linear", exact, found, 1e-4, because),
        event("the same, bifurcation of the path", exact, path, 2e-4, because),
    ]
    return rows, mode_of(found)


@problem(
    "Right-angle frame under a force in its plane",
    "stability",
    "J. H. Argyris et al., Comput. Methods Appl. Mech. Eng. 20 (1979) 105; J. C. Simo & L. Vu-Quoc, 58 (1986) 79; "
    "EXUDYN, TestModels/rightAngleFrame.py (public): 1.088 N",
    "legs of 0.24 m, strip of 30 x 0.6 mm, E = 71.24 GPa, nu = 0.31, J = h w^3/3, clamped foot, force at the tip",
    "EXUDYN's file tells of very bad convergence of its ANCF beam and none of its geometrically exact beam. Reversed, "
    "the critical force is 0.680 N.",
)
def right_angle_frame():
    E, h, w, leg = 71.24e9, 30e-3, 0.6e-3, 0.24
    G, A = E / 2.62, 30e-3 * 0.6e-3
    section = cf.Stiffness((G * A, G * A), E * A, (E * w * h**3 / 12, E * h * w**3 / 12), G * h * w**3 / 3)
    rows = []
    for name, sign, published in (("", 1, 1.088), (", reversed", -1, 0.680)):
        first = cf.Rod(cf.Line((0, 0, 0), (leg, 0, 0), d1=(0, 0, 1)), section, name="first")
        second = cf.Rod(cf.Line((leg, 0, 0), (leg, -leg, 0), d1=(0, 0, 1)), section, name="second")
        load = cf.Force(second.end, (sign, 0, 0))
        scene = cf.Scene([first, second], [cf.Clamp(first.start)], [load], [cf.Joint(first.end, second.start)])
        path = cf.solve(scene, (0.0, 1.4 * published))
        rows.append(event(f"critical force{name}, N", published, path, 1e-3, "digits printed"))
    return rows, mode_of(cf.buckling(scene))


@problem(
    "Clamped rod under tension and twist",
    "stability",
    "A. G. Greenhill, Proc. Inst. Mech. Eng. 34 (1883) 182; determinant as in jakeryderv/cosseratbench, "
    "experiments/twist.py (public): M L/B = 2.861 pi without tension",
    "L = 1 m, round, bending stiffness B = 1 N m^2, GJ = 0.7 N m^2, inextensible; T L^2/B = 0, 1, 10, 30; one end "
    "turned",
    "cosseratbench measures 0.978, 0.989, 0.991 of it with 25, 50, 100 elements of PyElastica; MuJoCo diverges beyond "
    "5 rad.",
)
def tension_and_twist():
    exact, GJ, turn = (2.861 * math.pi, 9.134730088936223, 10.428856439276949, 13.113499752996033), 0.7, 20.0
    rod, rows = cf.Rod(UPRIGHT, cf.Stiffness(**RIGID, bending=(1.0, 1.0), torsion=GJ)), []
    for T, moment in zip((0.0, 1.0, 10.0, 30.0), exact, strict=True):
        supports = [cf.Clamp(rod.start), *guided(rod.end), cf.Prescribed(rod.end, rotation=(0, 0, turn))]
        loads = [cf.Force(rod.end, (0, 0, T), permanent=True)] if T else []
        path = cf.solve(cf.Scene([rod], supports, loads), (0.0, 1.1 * moment / GJ / turn), elements=8)
        finer = cf.solve(cf.Scene([rod], supports, loads), (0.0, 1.1 * moment / GJ / turn), elements=12)
        found, other = (GJ * turn * x.events[0].load_factor for x in (path, finer))
        because, allowed = ("located to 1e-6", 2e-6) if T else ("digits printed", 2e-4)
        rows.append(Row(f"M L/B at T L^2/B = {T:g}", moment, other, abs(other - found) + 1e-6 * found, allowed * moment,
                        because))  # fmt: skip
    T, moments = np.linspace(1.0, 32.0, 200), [row.ours for row in rows]
    lines = {"long rod, 2 sqrt(B T)": (T, 2 * np.sqrt(T)), "here": ([0.0, 1.0, 10.0, 30.0], moments)}
    return rows, lambda file: curve(file, lines, "tension T L^2/B (1)", "critical torque M L/B (1)")


@problem(
    "Lee's frame",
    "stability",
    "S.-L. Lee, F. S. Manuel & E. C. Rossow, J. Eng. Mech. Div. ASCE 94 (1968) 521; limit loads by shooting of the "
    "strong form",
    "as in demos/lees_frame.toml: two legs of 120, hinged feet, E = 7.2e6, A = 6, I = 2, nu = 0.3, dead load at 24 of "
    "the beam",
    "The loads depend on shear: 18556.7 and -9414.4 without, 18544.5 and -9392.5 with a shear factor of 5/6.",
)
def lees_frame():
    found = cf.read(SCENES / "lees_frame.toml")
    path = cf.solve(found.scene, (0.0, 2.0))
    rows = [
        event(f"{name} limit load, in 10 000", published, path, 2e-6, "located to 1e-6", k)
        for k, (name, published) in enumerate((("upper", 1.8546558740003853), ("lower", -0.9396142357173696)))
    ]
    down = -path.displacement("beam@24.0")[:, 2]
    lines = {"path": (down, path.load_factors), "limit loads": ([48.75105869, 58.22359460], [1.8546559, -0.9396142])}
    return rows, lambda file: curve(file, lines, "deflection under the load (in)", "load factor (1)")


@problem(
    "Deep arch, clamped and hinged",
    "stability",
    "D. A. DaDeppo & R. Schmidt, J. Appl. Mech. 42 (1975) 894, doi:10.1115/1.3423734: 897; A. Ibrahimbegovic, Comput. "
    "Methods Appl. Mech. Eng. 122 (1995) 11: 897.3",
    "R = 100 over 215 degrees, EI = 1e6, EA = GA = 1e8, dead force on the crown",
    "897 is of the inextensible elastica. Twenty straight 3-node elements find 906.",
)
def deep_arch():
    rows, half = [], math.radians(215 / 2)
    for name, stiff, published, allowed, because in (
        ("inextensible (1975)", np.inf, 897.0, 0.6, "digits printed"),
        ("EA = GA = 1e8, 20 elements (1995)", 1e8, 897.3, 0.6, "digits printed, coarse mesh"),
    ):
        start = (-100 * math.sin(half), 0, 100 * math.cos(half))
        section = cf.Stiffness((stiff, stiff), stiff, (1e8, 1e6), 1e8)
        rod = cf.Rod(cf.Arc((0, 0, 0), start, 2 * half, (0, 1, 0), d1=(1, 0, 0.01)), section)
        crown = rod.at(rod.length / 2)
        supports = [cf.Clamp(rod.start), cf.Hinge(rod.end, (0, 1, 0))]
        scene = cf.Scene([rod], supports, [cf.Force(crown, (0, 0, -1e3))])
        coarse, path = (cf.solve(scene, (0.0, 0.95), elements=elements) for elements in (10, 14))
        rough, ours = (1e3 * x.events[0].load_factor for x in (coarse, path))
        rows.append(Row(f"limit load, {name}", published, ours, abs(ours - rough) + 1e-6 * ours, allowed, because))
    lines = {name: (displaced, 1e3 * path.load_factors) for name, displaced in (
        ("down", -path.displacement(crown)[:, 2]), ("sideways", np.abs(path.displacement(crown)[:, 0])))}  # fmt: skip
    return rows, lambda file: curve(file, lines, "displacement of the crown (1)", "load (1)")


@problem(
    "Two bars that snap through",
    "stability",
    "R. von Mises, Z. Angew. Math. Mech. 3 (1923) 406: P = 2 EA (1 - cos^(2/3) a)^(3/2), a the angle of the bars",
    "bars over a span of 2 m, a = 20 degrees, EA = 1 N, hinged at all ends, too stiff to bend",
)
def two_bars():
    a, axis = math.radians(20), (0, 1, 0)
    stiff = cf.Stiffness((100.0, 100.0), 1.0, (100.0, 100.0), 100.0)
    top, feet = (0, 0, math.tan(a)), ((-1, 0, 0), (1, 0, 0))
    bars = [cf.Rod(cf.Line(foot, top), stiff, name=name) for foot, name in zip(feet, ("left", "right"), strict=True)]
    scene = cf.Scene(bars, [cf.Hinge(bar.start, axis) for bar in bars], [cf.Force(bars[0].end, (0, 0, -1.0))],
                     [cf.Joint(bars[0].end, bars[1].end, release=axis)])  # fmt: skip
    exact = 2 * (1 - math.cos(a) ** (2 / 3)) ** 1.5
    path = cf.solve(scene, (0.0, 2 * exact))
    rows = [event("limit load, N", exact, path, 2e-6, "located to 1e-6"),
            event("lower limit load, N", -exact, path, 2e-6, "located to 1e-6", 1)]  # fmt: skip
    down = -path.displacement(bars[0].end)[:, 2]
    places = math.tan(a) - math.tan(math.acos(math.cos(a) ** (1 / 3))) * np.array([1, -1])
    lines = {"path": (down, path.load_factors), "limit loads": (places, [exact, -exact])}
    return rows, lambda file: curve(file, lines, "deflection of the top (m)", "load (N)")


@problem(
    "Portal frames that sway",
    "stability",
    f"{TIMOSHENKO}, section 2.12: hinged feet k h tan(k h) = 6, clamped feet k h/tan(k h) = -6 (for equal lengths and "
    "EI)",
    "columns and beam of 1 m, EI = 1 N m^2, inextensible; one load on each column",
)
def portal_frames():
    section = cf.Stiffness(**RIGID, bending=(1.0, 1.0), torsion=1.0)
    axis, rows = (0, 1, 0), []
    left = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), section, name="left")
    beam = cf.Rod(cf.Line((0, 0, 1), (1, 0, 1)), section, name="beam")
    right = cf.Rod(cf.Line((1, 0, 0), (1, 0, 1)), section, name="right")
    joints = [cf.Joint(left.end, beam.start), cf.Joint(beam.end, right.end)]
    loads = [cf.Force(rod.end, (0, 0, -1.0)) for rod in (left, right)]
    flat = [cf.Roller(rod.end, axis) for rod in (left, right)]
    for name, feet, exact in (
        ("hinged", [cf.Hinge(rod.start, axis) for rod in (left, right)], brentq(lambda x: x * math.tan(x) - 6, 1, 1.5)),
        ("clamped", [cf.Clamp(rod.start) for rod in (left, right)], brentq(lambda x: x + 6 * math.tan(x), 2, 3)),
    ):
        found = cf.buckling(cf.Scene([left, beam, right], [*feet, *flat], loads, joints), tol=1e-6)
        rows.append(critical(f"P h^2/EI, {name} feet", exact**2, found, 1e-6, "tol = 1e-6"))
    return rows, mode_of(found)


@problem(
    "Stepped column",
    "stability",
    f"{TIMOSHENKO}, section 2.14: tan(k1 l1) tan(k2 l2) = k1/k2",
    "clamped and free, lower half EI = 4 N m^2, upper half 1 N m^2, L = 1 m, inextensible",
)
def stepped_column():
    lower, upper = (cf.Stiffness(**RIGID, bending=(EI, 10 * EI), torsion=EI) for EI in (4.0, 1.0))
    rod = cf.Rod(UPRIGHT, [(0.5, lower), (None, upper)])
    exact = brentq(lambda P: math.tan(math.sqrt(P / 4) / 2) * math.tan(math.sqrt(P) / 2) - 2, 2, 8)
    found = cf.buckling(held(rod, cf.Force(rod.end, (0, 0, -1.0))), tol=1e-6)
    return [critical("P, N", exact, found, 1e-6, "tol = 1e-6")], mode_of(found)


@problem(
    "Column in an elastic bed",
    "stability",
    "M. Hetenyi, Beams on Elastic Foundation (1946): P = EI (n pi/L)^2 + k (L/(n pi))^2, the least over n",
    "hinged twice, L = 1 m, EI = 1 N m^2, k = 2000 N/m^2 sideways, inextensible: two half waves",
)
def column_in_a_bed():
    rod = cf.Rod(UPRIGHT, cf.Stiffness(**RIGID, bending=(1.0, 100.0), torsion=1.0))
    supports = [cf.Hinge(rod.start, (1, 0, 0)), *guided(rod.end)]
    bed = cf.Foundation(rod, 2000.0, (0, 1, 0))
    found = cf.buckling(cf.Scene([rod], supports, [cf.Force(rod.end, (0, 0, -1.0)), bed]), 2, tol=1e-5)
    exact = sorted((n * math.pi) ** 2 + 2000 / (n * math.pi) ** 2 for n in (1, 2, 3))
    rows = [
        critical(f"P, N, {name}", exact[k], found, 1e-5, "tol = 1e-5", k) for k, name in enumerate(("first", "second"))
    ]
    return rows, mode_of(found)


@dataclass(frozen=True)
class FluidPressure(cf.LineAction):
    """The pressure of a fluid outside, of a rod that is an arc about z: a force per length that stays normal to it."""

    rod: RodOrName
    pressure: ForcePerLength

    follows = True

    def data(self, rod, s):
        return (vector(self.pressure * np.cross([0, 0, 1.0], rod.curve.frame(s)[:, :, 2]), "N/m"),)

    @staticmethod
    def work(point, test, f):
        import ufl

        return ufl.dot(point.R * f, test.phi_r)


@problem(
    "Ring and arches under the pressure of a fluid",
    "stability",
    f"M. Levy 1884: p R^3/EI = 3; {TIMOSHENKO}, section 7.6: pi^2/a^2 - 1 for hinged arches of half angle a, k^2 - 1 "
    "with k tan a cot(k a) = 1 for clamped ones",
    "R = 1 m, EI = 1 N m^2, inextensible, in its plane; arches with a = 60 degrees",
    "The pressure follows the rod. On the ring and between fixed ends it has a potential, but the package makes no "
    "use of that: events of the path are located with the unsymmetric tangent.",
)
def fluid_pressure():
    section, axis, rows, a = cf.Stiffness(**RIGID, bending=(1.0, 100.0), torsion=100.0), (0, 0, 1), [], math.pi / 3

    def arc(start, angle, name):
        point = (math.cos(start), math.sin(start), 0)
        return cf.Rod(cf.Arc((0, 0, 0), point, angle, axis, d1=axis), section, name=name)

    one, two = halves = arc(0.0, math.pi, "one"), arc(math.pi, math.pi, "two")
    rod = arc(math.pi / 2 - a, 2 * a, "arch")
    k = brentq(lambda k: math.tan(a) * math.cos(k * a) - math.sin(k * a) / k, 3.5, 5.5)
    joints = [cf.Joint(one.end, two.start), cf.Joint(two.end, one.start)]
    for name, rods, supports, joined, exact in (
        ("ring", halves, [cf.Hinge(one.start, axis), cf.Roller(one.end, (0, 1, 0))], joints, 3.0),
        ("hinged arch", [rod], [cf.Hinge(rod.start, axis), cf.Hinge(rod.end, axis)], [], (math.pi / a) ** 2 - 1),
        ("clamped arch", [rod], [cf.Clamp(rod.start), cf.Clamp(rod.end)], [], k**2 - 1),
    ):
        scene = cf.Scene(rods, supports, [FluidPressure(x, 1.0) for x in rods], joined)
        rough, ours = (
            cf.solve(scene, (0.0, 1.1 * exact), model="spatial", elements=n).events[0].load_factor for n in (8, 12)
        )
        rows.append(
            Row(f"p R^3/EI, {name}", exact, ours, abs(ours - rough) + 1e-6 * ours, 2e-6 * exact, "located to 1e-6")
        )
        if len(rods) == 2:
            found = cf.buckling(scene, tol=1e-4)
            rows.append(critical("p R^3/EI, ring, linear", exact, found, 1e-4, "tol = 1e-4"))
    return rows, mode_of(found)
