"""Published problems of drill-strings in motion: natural frequencies, stick-slip, its cures, bits that cut, whirl."""

import math

import numpy as np
from curves import curve
from problem import Row, problem
from scipy.optimize import brentq
from whirling_collar import ARM, CLEARANCE, LENGTH, MESH, rolling

import cosserat_fenicsx as cf

INCH, FOOT, POUND, PSI, RPM = 0.0254, 0.3048, 4.4482216152605, 6894.757293168, math.pi / 30
#: Steel of 490 lb/ft^3 with E = 30e6 psi and G = 12e6 psi.
STEEL = cf.Material(E=30e6 * PSI, nu=0.25, density=490 * 0.45359237 / FOOT**3)


def tubes(*sections, material=STEEL):
    """A `DrillString` of sections (length in m, outer and inner diameter in m) from the top down."""
    return cf.well.DrillString(
        [cf.well.DrillPipe(length, None, outer, inner, material=material) for length, outer, inner in sections],
        order="top down",
    )


@problem(
    "Torsional frequencies of a drill pipe with a collar",
    "drilling",
    "W. T. Thomson, Theory of Vibration with Applications, example 9.3-3: 2.41 and 7.93 rad/s",
    "5000 ft of pipe, 4 1/2 x 3.83 in (J = 0.00094 ft^4), above 120 ft of collar as a disk of 29.3 lb ft s^2; "
    "G = 12e6 psi, 490 lb/ft^3",
    "The collar as a rod of 7 5/8 x 2 in, as Thomson describes it, gives the second row.",
)
def thomson_pipe_and_collar():
    J, slug = 0.00094 * FOOT**4, POUND * FOOT  # m^4; lbf ft s^2 in kg m^2
    pipe, collar = (5000 * FOOT, 4.5 * INCH, 3.83 * INCH), (120 * FOOT, 7.625 * INCH, 2 * INCH)
    section = cf.Stiffness(
        (1e9, 1e9),
        1e9,
        (1e6, 1e6),
        STEEL.G * J,
        mass=25.0,
        inertia=(STEEL.density * J / 2, STEEL.density * J / 2, STEEL.density * J),
    )
    disk = cf.drilling.BitOnRock(cf.drilling.Stribeck(0.0, 0.0), inertia=29.3 * slug)
    as_printed = cf.well.DrillString([cf.well.Component(pipe[0], section, 100.0, 0.06)])
    rows, printed = [], np.array([2.41, 7.93])
    for name, string, bit, allowed, because in (
        ("collar as a disk", as_printed, disk, 0.011, "roots from a table, 0.470 for 0.4695"),
        ("collar as a rod", tubes(pipe, collar), None, 0.015, "rounded areas; the collar twists"),
    ):
        scene = cf.drilling.Drilling(string, cf.drilling.TopDrive(0.0), bit)
        found = 2 * math.pi * cf.drilling.natural_frequencies(scene, 2)
        rows.append(Row(f"frequencies, {name}, rad/s", printed, found, 1e-11, allowed, because))
    return rows, cf.drilling.campbell(scene, 20.0, up_to=4.0).plot


@problem(
    "Critical rotary speeds of drill pipe",
    "drilling",
    "API RP 7G, section on critical rotary speeds, as printed in the Homco Technical Data Handbook and by "
    "www.drillingformulas.com/critical-rpm-to-avoid-excessive-vibration",
    "joint of 32 ft, 4 x 3.5 in, between pinned tool joints: 172 rpm; string of 10 000 ft, along its axis: 258 000/L "
    "rpm",
    "The printed constant 258 000 is that of waves of 17 200 ft/s; in steel of 30e6 psi and 490 lb/ft^3 they have "
    "16 840 ft/s. The source says that the first one is accurate within 15 %.",
)
def api_critical_speeds():
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 32 * FOOT)), cf.Tube(4 * INCH, 3.5 * INCH), STEEL)
    pins = [cf.Pin(rod.start), *(cf.Roller(rod.end, axis) for axis in ((1, 0, 0), (0, 1, 0)))]
    bent = cf.modes(cf.Scene([rod], pins, [cf.Spring(rod.start, rotational=1e-3)]), 3, tol=1e-3)
    scene = cf.drilling.Drilling(tubes((10000 * FOOT, 5 * INCH, 4.276 * INCH)), cf.drilling.TopDrive(0.0))
    along = 60 * cf.drilling.natural_frequencies(scene, 1, "free", "axial")[0]
    lateral = 60 * bent.frequencies[-1]
    rows = [
        Row("joint between tool joints, rpm", 172.0, lateral, 1e-3 * lateral, 1.0, "digits printed; 4 760 000"),
        Row("string of 10 000 ft along its axis, rpm", 25.8, along, 1e-10, 0.03 * 25.8, "speed of sound"),
    ]
    return rows, lambda file: bent.plot(file, [1])


@problem(
    "Natural frequencies of pipe and collars",
    "drilling",
    "J. J. Bailey & I. Finnie, J. Eng. Ind. 82 (1960) 122, doi:10.1115/1.3663017: tan(w L1/c) tan(w L2/c) = Z1/Z2; as "
    "a torsional pendulum: J. F. Brett, SPE Drilling Eng. 7 (1992) 168, doi:10.2118/21943-PA",
    "3000 m of 5 x 4.276 in pipe, 200 m of 6 1/2 x 2 1/4 in collars; held at the surface, free below",
    "The pendulum has the spring of the pipe and the inertia of the collars and a third of the pipe's.",
)
def bailey_finnie():
    sections = (3000.0, 5 * INCH, 4.276 * INCH), (200.0, 6.5 * INCH, 2.25 * INCH)
    scene = cf.drilling.Drilling(tubes(*sections), cf.drilling.TopDrive(0.0))
    pipe, collars = scene.segments
    rows = []
    for kind in ("torsion", "axial"):
        name = {"torsion": "torsional", "axial": "axial"}[kind]
        Z1, Z2 = (getattr(part, f"{name}_impedance") for part in (pipe, collars))
        t1, t2 = (part.length / getattr(part, f"{name}_speed") for part in (pipe, collars))

        def equation(w, Z1=Z1, Z2=Z2, t1=t1, t2=t2):
            return Z2 * math.sin(w * t1) * math.sin(w * t2) - Z1 * math.cos(w * t1) * math.cos(w * t2)

        grid = np.linspace(1e-3, 40.0, 4000)
        signs = [equation(w) for w in grid]
        exact = [
            brentq(equation, a, b) / (2 * math.pi)
            for a, b, x, y in zip(grid, grid[1:], signs, signs[1:], strict=False)
            if x * y < 0
        ][:5]
        found = cf.drilling.natural_frequencies(scene, 5, "free", kind)
        rows.append(Row(f"{name} frequencies 1 to 5, Hz", np.array(exact), found, 1e-12, 1e-9, "closed form"))
        if kind == "torsion":
            inertia = collars.rhoJ * collars.length + pipe.rhoJ * pipe.length / 3
            pendulum = math.sqrt(pipe.GJ / pipe.length / inertia) / (2 * math.pi)
            rows.append(Row("torsional pendulum, Hz", pendulum, found[0], 1e-12, 0.03 * pendulum, "an approximation"))
    answer = cf.drilling.campbell(scene, 20.0, up_to=4.0)
    return rows, answer.plot


@problem(
    "Collars that a three-cone bit shakes",
    "drilling",
    "D. W. Dareing & B. J. Livesay, J. Eng. Ind. 90 (1968) 671; D. W. Dareing, Drill Collar Length Is a Major Factor "
    "in Vibration Control, J. Petr. Technol. 36 (1984): waves in a bar with a free upper end, 3 Om = (k + 1/2) pi c/L",
    "600 ft of 8 x 3 in collars below a pipe of no stiffness; bit lifted three times a revolution by 1/8 in",
    "Weight on bit Z w a tan(w L/c) with w = 3 Om.",
)
def shaken_collars():
    lobes, a, length = 3, INCH / 8, 600 * FOOT
    bit = cf.drilling.BitOnRock(cf.drilling.Lobes(lobes, a), weight=150e3)
    scene = cf.drilling.Drilling(
        tubes((length, 8 * INCH, 3 * INCH)), cf.drilling.TopDrive(1.0), bit, hook=cf.drilling.Hook(1.0)
    )
    (part,) = scene.segments
    travel = part.length / part.axial_speed
    critical = (np.arange(3) + 0.5) * math.pi / travel / lobes / RPM
    found = cf.drilling.campbell(scene, 800 * RPM, up_to=80.0).critical_speeds()["axial", "3 x (lobes)"][:3] / RPM
    speeds = np.array([60.0, 100.0, 180.0, 250.0])
    bounce = cf.drilling.bit_bounce(scene, np.linspace(40.0, 250.0, 421) * RPM)
    force = [cf.drilling.bit_bounce(scene, [x * RPM]).amplitude[0] for x in speeds]
    w = lobes * speeds * RPM
    exact = np.abs(part.axial_impedance * w * a * np.tan(w * travel))
    rows = [
        Row("critical speeds, rpm", critical, found, 1e-9, 1e-4, "hook of 1 N/m"),
        Row("weight on bit at 60, 100, 180 and 250 rpm, N", exact, np.array(force), 1e-6, 1.0, "hook of 1 N/m"),
    ]
    return rows, bounce.plot


@problem(
    "Stick-slip of a torsional pendulum",
    "drilling",
    "A. Kyllingstad & G. W. Halsey, SPE Drilling Eng. 3 (1988) 369, doi:10.2118/16659-PA: one degree of freedom, "
    "friction that drops at once",
    "473 N m/rad, 374 kg m^2, 60 rpm; static torque 8 kN m, 6 kN m in slip",
)
def pendulum():
    k, J, speed, static, slip = 473.0, 374.0, 60 * RPM, 8e3, 6e3
    discs = cf.drilling.Discs((1.0, J), (k,))
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(static, slip))
    scene = cf.drilling.Drilling(discs, cf.drilling.TopDrive(speed), bit)
    history = cf.drilling.simulate(scene, 60.0, dt=2e-3, check=True)
    cycle, errors = history.stick_slip(since=20.0), history.errors
    w, a = math.sqrt(k / J), (static - slip) / k  # frequency; how far the drive turns while the bit rests
    slips, rests = 2 / w * (math.pi - math.atan(a * w / speed)), 2 * a / speed
    rest, peak = rests / (slips + rests), speed + w * math.hypot(a, speed / w)
    steps = "steps of 2 ms"
    rows = [
        Row("period, s", slips + rests, cycle.period, errors.period, 4e-3, steps),
        Row("share of the time at rest", rest, cycle.stuck, errors.period / cycle.period, 1e-3, steps),
        Row("largest bit speed, rad/s", peak, cycle.peak, errors.peak, 2e-2, steps),
    ]
    return rows, lambda file: history.plot(file, (20.0, 40.0))


@problem(
    "Four discs: speed at which steady rotation loses stability, and limit cycles",
    "drilling",
    "E. M. Navarro-Lopez & D. Cortes, J. Sound Vib. 307 (2007) 152, doi:10.1016/j.jsv.2007.06.037; data as in "
    "github.com/alwaysuu/active-control-for-drill-string-systems",
    "930, 2782, 750 and 472 kg m^2 on springs and dampers; weight on bit 53.0 and 97.3 kN, motor torque 6 and 10 kN m",
    "No printed number of theirs was at hand: the speeds are those at which an eigenvalue of their equations crosses "
    "the imaginary axis; the limit cycle is that of an event-driven Runge-Kutta integration with tight tolerances.",
)
def navarro_lopez():
    J, k, c = (930.0, 2782.25, 750.0, 471.9698), (698.063, 1080.0, 907.48), (139.6126, 190.0, 181.49)
    radius, static, dynamic, decay, drags = 0.155575, 0.8, 0.5, 0.9, (425.0, 0.0, 0.0, 50.0)
    law = cf.drilling.Stribeck(static, dynamic, 1 / decay, radius=radius)
    chain = np.diff(np.eye(4), axis=0)  # relative speeds of neighbours
    rows = []
    for weight, torque, starts, peak in (
        (53018.0, 6e3, [175.026249, 181.822701, 188.619154, 195.415607], 5.092853190),
        (97347.0, 10e3, [167.506348, 175.812006, 184.118502, 192.425637], 6.694376635),
    ):

        def growth(speed, weight=weight):
            slope = -weight * radius * (static - dynamic) * decay * math.exp(-decay * speed)
            damping = chain.T @ np.diag(c) @ chain + np.diag(drags) + np.diag([0, 0, 0, slope])
            below = np.hstack([-chain.T @ np.diag(k), -damping]) / np.array(J)[:, None]
            matrix = np.vstack([np.hstack([np.zeros((3, 3)), chain]), below])
            return np.linalg.eigvals(matrix).real.max()

        discs, bit = cf.drilling.Discs(J, k, c, drags), cf.drilling.BitOnRock(law, weight=weight)
        motor = cf.drilling.Drilling(discs, cf.drilling.TopDrive(control=cf.drilling.Motor(torque)), bit)
        least, exact = cf.drilling.limit_speed(motor), brentq(growth, 0.5, 6.0)
        history = cf.drilling.simulate(motor, 200.0, dt=2.5e-3, check=True)
        cycle, at, steps = history.stick_slip(since=120.0), f"{weight / 1e3:.3g} kN", "steps of 2.5 ms"
        rows += [
            Row(f"{at}: least stable speed, rad/s", exact, least, 1e-9, 1e-6, "eigenvalues of their equations"),
            Row(f"{at}: the bit starts at, s", np.array(starts), cycle.starts[-4:], 2.5e-3, 0.01, steps),
            Row(f"{at}: largest bit speed, rad/s", peak, cycle.peak, history.errors.peak, 5e-3, steps),
        ]
    return rows, history.plot_phase


@problem(
    "A bit that cuts: least speed at which axial vibrations decay",
    "drilling",
    "T. Richard, C. Germay & E. Detournay, J. Sound Vib. 305 (2007) 432: 2 sqrt(2 psi/n) of axial motion alone",
    "four blades, psi = 13.9, in their units; without damping; and with a rate of penetration of 0.5, an axial spring "
    "and dampers",
    "The second number is not theirs: the delay equation was solved by collocation, independently of this package.",
)
def cutting_bit():
    psi, blades = 13.9, 4
    exact = 2 * math.sqrt(2 * psi / blades)
    (found,) = cf.drilling.LumpedCutting(psi, blades).limits(3.0, 12.0)
    coupled = cf.drilling.LumpedCutting(psi, blades, 0.5, 2.0, 0.1, 0.02)
    rows = [
        Row("least stable rotation, axial motion alone", exact, found, 1e-9, 1e-9, "closed form"),
        Row(
            "the same with torsion, springs and dampers",
            5.215775798890863,
            coupled.limits(2.0, 12.0)[0],
            1e-9,
            1e-8,
            "collocation of the delay equation",
        ),
    ]
    speeds = np.linspace(2.0, 8.0, 61)
    growth = [max(root.real for root in coupled.roots(x)) for x in speeds]
    return rows, lambda file: curve(
        file,
        {"": (speeds, growth)},
        "rotation, in units of the lowest frequency",
        "largest growth rate, in the same units",
    )


@problem(
    "A top drive with the impedance of the pipe returns no wave",
    "drilling",
    "G. W. Halsey, A. Kyllingstad & A. Kylling, SPE 18049 (1988), doi:10.2118/18049-MS; R. W. Tucker & C. Wang, J. "
    "Sound Vib. 224 (1999) 101 and 123",
    "3000 m of 5 x 4.276 in pipe without losses, turned from rest at 90 rpm, torque on bit 1 kN m",
    "Bit speed Om - T/Z from the first wave on; a stiff drive hands down 2 Z Om first, then alternates.",
)
def matched_drive():
    torque, speed, found = 1e3, 90 * RPM, {}
    for name, control in (("matched", cf.drilling.Matched()), ("stiff", cf.drilling.Stiff())):
        scene = cf.drilling.Drilling(
            tubes((3000.0, 5 * INCH, 4.276 * INCH)),
            cf.drilling.TopDrive(speed, control=control),
            cf.drilling.BitOnRock(cf.drilling.Stribeck(torque, torque)),
        )
        found[name] = cf.drilling.simulate(scene, 30.0)
    (part,) = scene.segments
    late = found["matched"].times > 1.05 * part.length / part.torsional_speed
    bit = {name: history.bit_speed[late] for name, history in found.items()}
    steady = speed - torque / part.torsional_impedance
    rows = [
        Row(
            "matched: bit speed, least and largest, rad/s",
            np.array([steady, steady]),
            np.array([bit["matched"].min(), bit["matched"].max()]),
            1e-9,
            1e-6,
            "closed form",
        ),
        Row("stiff: largest bit speed, rad/s", speed + steady, bit["stiff"].max(), 1e-9, 1e-6, "closed form"),
        Row("stiff: least bit speed, rad/s", speed - steady, bit["stiff"].min(), 1e-9, 1e-6, "closed form"),
    ]
    return rows, lambda file: found["matched"].plot(file, (0.0, 10.0))


@problem(
    "The block takes up a string at once: waves along the axis",
    "drilling",
    "waves in bars: S. P. Timoshenko & J. N. Goodier, Theory of Elasticity, section on longitudinal impact: F = Z v; "
    "reflection at a change of section (Z2 - Z1)/(Z2 + Z1)",
    "3000 m of 5 x 4.276 in pipe, 200 m of 6 1/2 x 2 1/4 in collars, taken up at once with 1 m/s",
)
def block_stops():
    scene = cf.drilling.Drilling(
        tubes((3000.0, 5 * INCH, 4.276 * INCH), (200.0, 6.5 * INCH, 2.25 * INCH)),
        cf.drilling.TopDrive(0.0),
        hook=cf.drilling.Hook(speed=1.0),
    )
    pipe, collars = scene.segments
    first, second = pipe.axial_impedance, collars.axial_impedance
    back, weight = 2 * pipe.length / pipe.axial_speed, sum(part.weight * part.length for part in scene.segments)
    found = []
    for elements in (500, 1000):
        history = cf.drilling.simulate(scene, 1.3, dt=0.5 / elements, elements=elements)
        t, load = history.times, history.hook_load - weight
        spans = (0.1, back - 0.02), (back + 0.02, back + 0.07)
        found.append(np.array([load[(t > start) & (t < end)].mean() for start, end in spans]) / 1e3)
    exact = np.array([first, first * (1 + 2 * (second - first) / (second + first))]) / 1e3
    error = np.abs(found[1] - found[0])
    row = Row("hook load beyond the weight, until 1.17 s and then, kN", exact, found[1], error, 1.0, "ringing of jumps")
    return [row], history.plot


@problem(
    "A string that rotates off bottom in an inclined well",
    "drilling",
    "U. J. F. Aarsnes & R. J. Shor, J. Petr. Sci. Eng. 163 (2018) 712, eq. (27) and fig. 8; preprint and MATLAB files: "
    "github.com/Open-Source-Drilling-Community/Aarsnes-and-Shor-Torsional-Model",
    "2270 m of 146.5 x 123 mm pipe, 230 m of collars; well A of the paper: frequency; well B of its files (vertical to "
    "500 m, 60 degrees from 1600 m on), friction 0.3: break-off torque",
    "Their break-off torque counts the weight alone. The soft string counts the tension in the build section, which "
    "presses the pipe onto its high side: 12 % more. Below the bend both agree.",
)
def off_bottom():
    def mean(lengths, values):
        return lengths @ values / lengths.sum()

    def collars(lengths, outer, inner):
        lengths, outer, inner = map(np.array, (lengths, outer, inner))
        areas, moments = np.pi / 4 * (outer**2 - inner**2), np.pi / 32 * (outer**4 - inner**4)
        return mean(lengths, areas), mean(lengths, moments), mean(lengths, outer / 2)

    def component(length, area, J, radius, G):
        inertia = 7850 * J / 2, 7850 * J / 2, 7850 * J
        section = cf.Stiffness((1e9, 1e9), 2e11 * area, (1e6, 1e6), G * J, mass=7850 * area, inertia=inertia)
        return cf.well.Component(length, section, 7850 * 9.81 * area, radius)

    ((area, J, _), radius) = collars([1.0], [0.146529], [0.123024]), 0.146529 / 2
    pipe = component(2270.0, area, J, radius, 61e9)
    well_a = collars(
        [19.08, 10.24, 57.24, 9.75, 95.4, 38.75],
        [0.150167, 0.206375, 0.150167, 0.206248, 0.150167, 0.222392],
        [0.096799, 0.0762, 0.096799, 0.06985, 0.096799, 0.095964],
    )
    well_b = collars(
        [48.7, 114.8, 56.7, 38.88], [0.150473, 0.187322, 0.20955, 0.24728], [0.096207, 0.098912, 0.071438, 0.123391]
    )
    string = cf.well.DrillString([pipe, component(230.0, *well_a, 67e9)], order="top down")
    (frequency,) = cf.drilling.natural_frequencies(cf.drilling.Drilling(string, cf.drilling.TopDrive(0.0)), 1)
    md = np.array([0, 500, *np.arange(520, 1601, 20), 2500.0])
    path = cf.well.WellPath.from_survey(md, np.interp(md, [500, 1600], [0, 60]), 0 * md)
    string = cf.well.DrillString([pipe, component(230.0, *well_b, 67e9)], order="top down")
    answer = cf.well.torque_and_drag(
        cf.well.Borehole(path, cf.well.HoleSection(2500, 0.311, 0.3)),
        string,
        cf.well.RotateOffBottom(),
        model="soft",
        torque_convention="johancsik",
    )
    below = answer.torque[np.abs(answer.md - 1600).argmin()]
    straight = (
        0.3
        * math.sin(math.pi / 3)
        * sum(
            part.weight * part.contact_radius * length
            for part, length in zip(string.components, (230.0, 670.0), strict=True)
        )
    )
    rows = [
        Row("lowest frequency, Hz", 0.22, frequency, 1e-12, 0.01, "read off a Bode diagram"),
        Row("torque below 1600 m, N m", straight, below, 1e-6 * below, 1e-4 * below, "closed form"),
        Row("break-off torque, N m", 19531.0, answer.surface_torque, 1e-3, 2500.0, "tension in the bend"),
    ]
    return rows, answer.plot


@problem(
    "Forward whirl of an unbalanced collar",
    "drilling",
    "J. D. Jansen, J. Sound Vib. 147 (1991) 115; J. K. Vandiver, J. W. Nicholson & R.-J. Shyu, SPE Drilling Eng. 5 "
    "(1990) 282, doi:10.2118/18652-PA: synchronous whirl, here of the whole beam: EI d4w/dx4 = m Om^2 (w + e)",
    "12 m of 171.4 x 71.4 mm collar between pinned ends, in mud that moves with it; mass centre of the steel 12.7 mm "
    "off the axis",
    "The rod shears, and stretches where it bends by 51 mm; the formula does not.",
)
def forward_whirl():
    length, outer, inner, e = 12.0, 0.1714, 0.0714, 0.0127
    steel = cf.Material(206e9, 206e9 / 2 / 79.3e9 - 1, density=7850.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, length)), cf.Tube(outer, inner), steel, eccentricity=(e, 0.0))
    mud, mass = 51.8744, 7850.0 * math.pi / 4 * (outer**2 - inner**2)
    stiff, half = 206e9 * math.pi / 64 * (outer**4 - inner**4), length / 2
    held = [cf.Pin(rod.start), *(cf.Roller(rod.end, axis) for axis in ((1, 0, 0), (0, 1, 0)))]
    loads = [cf.AddedMass(rod, mud), cf.Spring(rod.start, rotational=1e-3)]
    critical = (math.pi / length) ** 2 * math.sqrt(stiff / (mass + mud))

    def exact(share):
        b = ((mass + mud) * (share * critical) ** 2 / stiff) ** 0.25
        return 1e3 * e * mass / (mass + mud) * ((1 / np.cos(b * half) + 1 / np.cosh(b * half)) / 2 - 1)

    shares, rows = np.array([0.3, 0.5, 0.7, 0.9, 1.3, 2.0]), []
    for share in shares:
        turning = cf.Scene([rod], held, [*loads, cf.Centrifugal((0, 0, share * critical))])
        coarse, x = (
            1e3 * cf.solve(turning, [1.0], elements=n, degree=2, model="spatial").displacement(rod.at(half))[-1, 0]
            for n in (8, 16)
        )
        name = f"deflection at {share:g} of the critical speed, mm"
        rows.append(Row(name, exact(share), x, abs(x - coarse), 2e-3 * abs(x), "shear; stretching"))
    fine = np.linspace(0.05, 2.2, 400)
    beam = np.where(np.abs(fine - 1) > 0.08, exact(fine), np.nan)
    return rows, lambda file: curve(
        file,
        {"beam": (fine, beam), "rod": (shares, [row.ours for row in rows])},
        "speed over critical speed (134.1 rpm)",
        "deflection of the middle (mm)",
    )


@problem(
    "Backward whirl of a collar that rolls round its hole",
    "drilling",
    "J. K. Vandiver, J. W. Nicholson & R.-J. Shyu, SPE Drilling Eng. 5 (1990) 282, doi:10.2118/18652-PA; J. D. Jansen, "
    "J. Sound Vib. 147 (1991) 115: rate of whirl over that of rotation -D/(D_hole - D) without slip",
    "the collar of the forward whirl, at 100 rpm in a hole of 215.9 mm, friction 0.5",
)
def backward_whirl():
    collar, ring, scene, start = rolling(100 * RPM, 0.5, 1.2)
    found = []
    for dt in (2e-3, 1e-3):
        history = cf.simulate(scene, 1.2, dt=dt, save_every=2e-3, start=start, **MESH)
        found.append(history.whirl(collar.at(LENGTH / 2), since=0.2).ratio)
    error = abs(found[1] - found[0])
    row = Row("rate of whirl over that of rotation", -ARM / CLEARANCE, found[1], error, 0.01, "elastic wall; torsion")
    return [row], lambda file: history.plot_orbit(collar.at(LENGTH / 2), ring, file)
