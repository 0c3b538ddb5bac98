"""Published problems of strings in wells: surveys, torque and drag, buckling, and contact."""

import math

import numpy as np
from conduit import FRICTION, pulled_cable
from curves import curve
from problem import Row, problem
from scipy.integrate import trapezoid

import cosserat_fenicsx as cf
from cosserat_fenicsx.well.rod.rod_in_hole import solve_in_hole

INCH, FOOT, POUND, PSI = 0.0254, 0.3048, 4.4482216152605, 6894.757293168
KLBF = 1e3 * POUND
#: 5 in drill pipe, 19.5 lb/ft, in an 8 1/2 in hole with mud of 10 lb/gal: bending stiffness (N m^2), weight (N/m),
#: clearance and contact radius (m), and its `Stiffness`.
EI, WEIGHT, CLEARANCE, RADIUS = 1228200.0, 241.13, 0.04445, 0.0635
PIPE = cf.Stiffness((1.35359e8, 1.35359e8), 7.03868e8, (EI, EI), 9.4e5)


def straight(length, inclination, clearance, friction=0.0, radius=RADIUS):
    """A straight hole (lengths in m, inclination in degrees)."""
    path = cf.well.WellPath.from_survey([0, length], [inclination] * 2, [0, 0])
    return cf.well.Borehole(path, cf.well.HoleSection(length, 2 * (radius + clearance), friction))


@problem(
    "Position of a survey station by minimum curvature",
    "wells",
    "N. J. Lapeyrouse, Formulas and Calculations for Drilling, Production and Workover (2nd ed., 2002); printed in "
    "www.drillingformulas.com/minimum-curvature-method",
    "stations at 3500 ft (15 degrees, azimuth 20) and 3600 ft (25 degrees, azimuth 45)",
    "The ratio factor is printed as 1.00408; by its formula it is 1.00428, which the coordinates agree with.",
)
def minimum_curvature():
    above = 1000 * FOOT  # a first station, from which the axis goes straight to the first one that is given
    well = cf.well.WellPath.from_survey([0, above, above + 100 * FOOT], [15, 15, 25], [20, 20, 45])
    moved = (well.position(well.length) - well.position(above)) / FOOT
    rows = [
        Row(
            "north, east, true vertical depth, ft",
            np.array([27.22, 19.45, 94.01]),
            moved,
            1e-12,
            6e-3,
            "digits printed",
        ),
        Row("dogleg, rad", 0.22605, well.dogleg[-1], 0.0, 6e-6, "digits printed"),
    ]
    hole = cf.well.Borehole(well, cf.well.HoleSection(well.length, 8.5 * INCH, 0.2))
    answer = cf.well.torque_and_drag(
        hole, cf.well.DrillString([cf.well.Component(None, PIPE, WEIGHT, RADIUS)]), cf.well.Static(), model="soft"
    )
    return rows, answer.plot_3d


@problem(
    "Free length of a stuck pipe by its stretch",
    "wells",
    "N. J. Lapeyrouse, Formulas and Calculations for Drilling, Production and Workover (2nd ed., 2002): 735 294 e W/F; "
    "www.netwasgroup.us/formulas-calculations/determine-free-point-constant-fpc.html and "
    "www.drillingformulas.com/tag/stuck-depth",
    "5 in x 4.276 in pipe, pulled by 30 000 lbf more: 24 in; 3 1/2 in x 2.992 in tubing, by 25 000 lbf: 20 in",
)
def free_point():
    steel, rows = cf.Material(E=30e6 * PSI, nu=0.3, density=7849.0), []
    for size, bore, pull, stretch, printed in ((5.0, 4.276, 30.0, 24.0, 10547.0), (3.5, 2.992, 25.0, 20.0, 5180.0)):
        string = cf.well.DrillString([cf.well.DrillPipe(None, None, size * INCH, bore * INCH, material=steel)])
        hole, mud = straight(printed * FOOT, 0.0, 0.05), cf.well.Mud(1200.0)
        one, more = (
            cf.well.torque_and_drag(hole, string, cf.well.TripOut(weight=-F * KLBF), mud=mud, model="soft")
            for F in (10.0, 10.0 + pull)
        )
        found = printed * stretch * INCH / (more.stretch - one.stretch)
        rows.append(
            Row(
                f"free length of {size:g} in pipe, ft",
                printed,
                found,
                1e-8 * printed,
                3e-4 * printed,
                "digits printed; area W/3.4",
            )
        )
    return rows, more.plot


@problem(
    "Pulling through a build section",
    "wells",
    "B. S. Aadnoy & K. Andersen, J. Petr. Sci. Eng. 32 (2001) 53, doi:10.1016/S0920-4105(01)00147-4; M. C. Sheppard, "
    "C. Wick & T. Burgess, SPE Drilling Eng. 2 (1987) 344, doi:10.2118/15463-PA",
    "arc of 400 m radius, inclination 0 to 60, 20 to 100 and 70 to 10 degrees; 241.13 N/m, friction 0.3, 900 kN below",
)
def build_section():
    radius, mu, pull, rows = 400.0, 0.3, 900e3, []
    for angles in ((0.0, 60.0), (20.0, 100.0), (70.0, 10.0)):
        i1, i2 = np.radians(angles)
        sign = 1 if i2 > i1 else -1
        path = cf.well.WellPath.from_survey([0, radius * abs(i2 - i1)], angles, [350, 350])
        hole = cf.well.Borehole(path, cf.well.HoleSection(path.length, 0.2159, mu))
        string = cf.well.DrillString([cf.well.Component(weight=WEIGHT, contact_radius=RADIUS)])
        answer = cf.well.torque_and_drag(hole, string, cf.well.TripOut(weight=-pull), model="soft", tol=1e-10)
        m, R = sign * mu, sign * radius  # a drop is a build whose curvature and side of the wall have the other sign
        A, B = -WEIGHT * R * (1 - m**2) / (1 + m**2), -2 * m * WEIGHT * R / (1 + m**2)
        C = (pull - A * math.sin(i2) - B * math.cos(i2)) * math.exp(m * i2)
        exact = A * math.sin(i1) + B * math.cos(i1) + C * math.exp(-m * i1)
        rows.append(
            Row(
                f"hook load, {angles[0]:g} to {angles[1]:g} degrees, N",
                exact,
                answer.hook_load,
                answer.error * pull,
                1e-4,
                "closed form",
            )
        )
    return rows, answer.plot


@problem(
    "A cable pulled round a bend: the capstan",
    "wells",
    "capstan equation exp(mu angle): L. Euler, Mem. Acad. Sci. Berlin 18 (1762) 265; J. A. Eytelwein, Handbuch der "
    "Statik fester Koerper (1808)",
    "cable of 12 mm, E = 2 GPa, in a conduit of 32 mm with a bend of 90 degrees and 1 m radius, friction 0.3",
    "The equation is that of a string without bending stiffness, which counts by EI/(T R^2) = 0.2 % here; the wall "
    "gives way by 1 mm.",
)
def capstan():
    path, near, far = pulled_cable()
    low, high = np.linalg.norm([near, far], axis=1)
    angle, error = math.acos(-near @ far / (low * high)), path.errors.force[-1] * high / low
    row = Row("ratio of the tensions at its ends", math.exp(FRICTION * angle), high / low, error, 1.5e-3, "stiffness")
    return [row], lambda file: path.plot(file, [1], color="tension")


@problem(
    "Critical weight on bit in a vertical hole",
    "wells",
    "A. Lubinski, Drilling and Production Practice (1950) 178, API-50-178: 1.94 and 3.75; the free lower end: "
    "first zero of Ai', NIST Digital Library of Mathematical Functions, table 9.9.1",
    "hanging pipe of length 8 (EI/w)^(1/3), hinged at its upper end, pushed up at the lower one, hinged or free",
    "The loads of hinged ends fall with the length: 2.23, 1.94, 1.82 and 4.62, 4.10, 3.99 at 4, 8 and 12 (EI/w)^(1/3), "
    "as Airy functions give them too; no length has both printed numbers. They come from a power series, whose terms "
    "become large in long strings, as J. C. Cunha (2004) noted.",
)
def lubinski_critical():
    unit, length, loads = (EI * WEIGHT**2) ** (1 / 3), 8 * (EI / WEIGHT) ** (1 / 3), {}
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, -length)), cf.Stiffness((math.inf,) * 2, math.inf, (EI, EI), EI))
    given = [
        cf.LineForce(rod, (0, 0, -WEIGHT), permanent=True),
        cf.Force(rod.end, (0, 0, unit)),
        cf.Spring(rod.start, rotational=1e-3),
    ]  # which only stops the free rotation about its axis
    hinged = [cf.Roller(rod.end, axis) for axis in ((1, 0, 0), (0, 1, 0))]
    for ends, held in (("hinged", [cf.Pin(rod.start), *hinged]), ("free", [cf.Clamp(rod.start)])):
        loads[ends] = cf.buckling(cf.Scene([rod], held, given), 4)
    first, _, second, _ = loads["hinged"].load_factors
    of = "length of the string"
    rows = [
        Row("first order, (EI w^2)^(1/3)", 1.94, first, 1e-5, 5e-3, of),
        Row("second order, (EI w^2)^(1/3)", 3.75, second, 1e-5, 0.36, f"{of}; power series"),
        Row("free lower end, (EI w^2)^(1/3)", 1.0187929716, loads["free"].load_factors[0], 1e-5, 1e-5, "long string"),
    ]
    return rows, loads["hinged"].plot


@problem(
    "Tubing of which 20 000 lbf are slacked off on a packer: a helix",
    "wells",
    "A. Lubinski, W. S. Althouse & J. L. Logan, J. Petr. Technol. 14 (1962) 655, doi:10.2118/178-PA: 49.7 in; wall "
    "force r F^2/(4 EI): R. F. Mitchell, SPE Drilling Eng. 1 (1986) 457, doi:10.2118/13064-PA",
    "10 000 ft of 2 7/8 in 6.5 lb/ft tubing in 7 in 32 lb/ft casing, clearance 1.61 in, oil of 30 degrees API inside "
    "and outside: 0.484 lbf/in; A = 1.812 in^2, I = 1.611 in^4, E = 30e6 psi",
    "Only the lower 1102 m, of which 1050 m are compressed, are solved as a rod; above them Hooke's law is added.",
)
def lubinski_packer():
    pipe = cf.Tube(2.875 * INCH, 2.441 * INCH).stiffness(cf.Material(E=30e6 * PSI, nu=0.3))
    stiff, F, weight = pipe.bending[0], 20 * KLBF, 0.484 * POUND / INCH
    r, body, long = 1.61 * INCH, 2.875 / 2 * INCH, 1.05 * 20 * KLBF / weight
    path = cf.well.WellPath.from_survey([0, long + 10], [0, 0], [0, 0])
    found = []
    for elements, degree in ((2048, 2), (1536, 3)):
        answer = solve_in_hole(
            path,
            [long],
            pipe,
            weight,
            body,
            helix=True,
            radius=body + r,
            bottom_tension=-F,
            rings=[(long, 0.0, body)],
            elements=elements,
            degree=degree,
        )
        s, wound = answer.s, (answer.s > long - 0.95 * F / weight) & (answer.s < long - 20.0)
        helix = np.ptp(s) - np.ptp(answer.position[:, 2])
        hooke = F * 10000 * FOOT / pipe.axial
        turns = np.ptp(np.unwrap(answer.side[wound])) / (2 * math.pi)
        wall = answer.side_force[wound] @ np.gradient(s[wound])
        found.append(np.array([(hooke + helix) / INCH, turns, wall / POUND]))
    thrust = np.clip(F - weight * (long - s[wound]), 0, None)
    formulas = [
        trapezoid(np.sqrt(thrust / (2 * stiff)), s[wound]) / (2 * math.pi),
        trapezoid(r * thrust**2 / (4 * stiff), s[wound]) / POUND,
    ]
    ours, errors = found[1], np.abs(found[1] - found[0])
    told = [
        ("shortening, in", 49.7, 0.06, "digits printed"),
        ("turns from 50 m below the neutral point on", formulas[0], 1e-3 * formulas[0], "small slopes; shear"),
        ("force of the wall there, lbf", formulas[1], 3e-3 * formulas[1], "small slopes; shear"),
    ]
    rows = [
        Row(name, printed, found, error, allowed, because)
        for (name, printed, allowed, because), found, error in zip(told, ours, errors, strict=True)
    ]
    lower = s > long - 100.0
    return rows, lambda file: curve(
        file, {"": (long - s[lower], 1e3 * answer.position[lower, 0])}, "above the packer (m)", "north of the axis (mm)"
    )


@problem(
    "Sinusoidal buckling on the low side of a horizontal hole, and the snake beyond it",
    "wells",
    "R. Dawson & P. R. Paslay, J. Petr. Technol. 36 (1984) 1734, doi:10.2118/11167-PA: F = 2 sqrt(EI w/r); equation of "
    "the snake: R. F. Mitchell, SPE Drill. & Compl. 12 (1997) 63",
    "5 in drill pipe, 19.5 lb/ft, in an 8 1/2 in hole with mud of 10 lb/gal, 300 m, no friction",
    "The amplitude is that of the wave that appears first, by Fourier series; the string in its hole "
    "of finite length chooses a wave number that is 0.03 % larger.",
)
def dawson_paslay():
    path, length = cf.well.WellPath.from_survey([0, 400], [90, 90], [0, 0]), 300.0
    formula = 2 * math.sqrt(EI * WEIGHT / CLEARANCE)
    given = {"radius": RADIUS + CLEARANCE, "rings": [(length, 0.0, 0.1)]}
    low, high = 0.98 * formula, 1.02 * formula
    while high - low > 1e-3 * formula:
        middle = (low + high) / 2
        answer = solve_in_hole(path, [length], PIPE, WEIGHT, RADIUS, bottom_tension=-middle, elements=512, **given)
        low, high = (middle, high) if answer.negative_modes == 0 else (low, middle)
    amplitudes = []
    for elements in (256, 512):
        snake = solve_in_hole(
            path, [length], PIPE, WEIGHT, RADIUS, bottom_tension=-1.2 * formula, helix=True, elements=elements, **given
        )
        inside = (snake.s > 60) & (snake.s < length - 60)
        _, y, z = snake.position[inside].T
        angle = np.degrees(np.arctan2(y, z))
        amplitudes.append(np.abs(angle).max())
    bracket, error = (high - low) / 2, abs(amplitudes[1] - amplitudes[0])
    rows = [
        Row("least load of a snake, N", formula, (low + high) / 2, bracket, 5e-3 * formula, "300 m; held ends"),
        Row("amplitude at 1.2 times the load, degrees", 31.43727, amplitudes[1], error, 0.15, "wave number; wall"),
    ]
    return rows, lambda file: curve(
        file,
        {"": (snake.s[inside], angle)},
        "along the string (m)",
        "angle from the low side (degrees)",
    )


@problem(
    "How far a pipe can be pushed into a horizontal hole: lock-up",
    "wells",
    "N. Wicks, B. L. Wardle & D. Pafitis, Int. J. Mech. Sci. 50 (2008) 538, doi:10.1016/j.ijmecsci.2007.08.005",
    "steel: EI = 2.064 MN m^2, 315 N/m; composite: EI = 349 kN m^2, 16.6 N/m; clearance 41 mm, friction 0.3",
    "Their helix has no weight, here it has: it rubs more, and locks up earlier. Their formula with the weight, "
    "integrated in closed form, gives 5409.1 m and 9688.9 m.",
)
def lock_up():
    rows = []
    for name, stiff, weight, printed, integrated in (
        ("steel", 2063790.0, 315.0, 5700.0, 5409.096127),
        ("composite", 348950.0, 16.6, 10100.0, 9688.906878),
    ):
        pipe = cf.well.Component(None, cf.Stiffness((1e9, 1e9), 2.6e9, (stiff, stiff), 1.6e6), weight, RADIUS)
        hole = straight(1.05 * printed, 90.0, 0.041, 0.3)
        depths = np.linspace(0.5, 1.05, 12) * printed
        sweep = cf.well.depth_sweep(hole, cf.well.DrillString([pipe]), cf.well.TripIn(), depths, model="buckled")
        length = depths[-1] - sweep.values["locked"][0, 0, -1]
        error = 5e-3  # the integration ends a little before the thrust is infinite
        rows += [
            Row(f"{name}: longest push, m", printed, length, error, 0.06 * printed, "weight of the helix"),
            Row(f"{name}: the same with weight, m", integrated, length, error, 0.01, "closed form"),
        ]
    return rows, sweep.plot


@problem(
    "Friction of a helix in a vertical hole",
    "wells",
    "R. F. Mitchell, SPE Drilling Eng. 1 (1986) 457, doi:10.2118/13064-PA: dF/dz = w - mu r F^2/(4 EI)",
    "5 in drill pipe pushed down, 50 kN at the top, friction 0.25; 300, 1000 and 2500 m; limit 326.5 kN",
)
def helix_friction():
    mu = 0.25
    limit = 2 * math.sqrt(EI * WEIGHT / (mu * CLEARANCE))
    rate, exact, found = WEIGHT / limit, [], []
    for length in (300.0, 1000.0, 2500.0):
        below = limit * math.tanh(rate * length + math.atanh(50e3 / limit))
        string = cf.well.DrillString([cf.well.Component(None, PIPE, WEIGHT, RADIUS)])
        answer = cf.well.torque_and_drag(
            straight(length, 0.0, CLEARANCE, mu), string, cf.well.Sliding(below), model="buckled", tol=1e-9
        )
        exact.append(50e3)
        found.append(-answer.hook_load)
    exact, found, error = np.array(exact), np.array(found), answer.error * limit
    rows = [Row("thrust at the top, for that below, N", exact, found, error, 1.0, "closed form")]
    return rows, answer.plot


@problem(
    "Side force on bit of a slick assembly",
    "wells",
    "A. Lubinski & H. B. Woods, Drilling and Production Practice (1953) 222; without thrust it is a beam that comes to "
    "lie on its support: L^4 = 24 EI r/q, S = q L/2, q = w sin(inclination)",
    "collars in a straight hole: EI = 17 MN m^2, 2050 N/m, clearance 50.8 mm; no weight on bit; 90 and 10 degrees",
    "At 10 degrees the collars hang: their tension, which the formula leaves out, holds them nearer to the axis.",
)
def slick_assembly():
    stiff, weight, r, length, rows = 1.7e7, 2050.0, 0.0508, 80.0, []
    part = cf.Stiffness((1e12,) * 2, 1e12, (stiff,) * 2, stiff)
    for inclination, allowed, because in ((90.0, 3e-3, "small slopes"), (10.0, 0.02, "tension of the collars")):
        bit = cf.well.Bit(2 * (0.1 + r), length=1e-3, body_diameter=0.2, mass=weight / 9.81)
        string = cf.well.DrillString([bit, cf.well.Component(None, part, weight, 0.1)])
        answer = cf.well.torque_and_drag(
            straight(length + 20, inclination, r, 0.0, 0.1),
            string,
            cf.well.Static(),
            mud=cf.well.Mud(1e-3),
            depth=length,
            model="rod",
        )
        *_, tangency, force = (x for x in answer.contacts if x.at_point)
        q = weight * math.sin(math.radians(inclination))
        exact = (24 * stiff * r / q) ** 0.25
        rows += [
            Row(
                f"{inclination:g} degrees: from bit to tangency, m",
                exact,
                length - tangency.top,
                2e-3,
                allowed * exact,
                because,
            ),
            Row(
                f"{inclination:g} degrees: side force on bit, N",
                q * exact / 2,
                force.force,
                force.error,
                allowed * q * exact / 2,
                because,
            ),
        ]
    return rows, lambda file: answer.plot_from_side(file, 40.0)
