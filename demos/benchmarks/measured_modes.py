"""Vibrations of published test cases: those of NAFEMS, a measured blade, a drill-string."""

import math
from itertools import pairwise

import numpy as np
from curves import charted
from modes import compared, pictured, swinging
from problem import Row, problem

import cosserat_fenicsx as cf

STEEL = cf.Material(200e9, 0.3, density=8000.0)  # of the cases of NAFEMS
SELECTED = "Abbassian, Dawswell & Knowles, Selected Benchmarks for Natural Frequency Analysis, NAFEMS 1987"


def rigid(start, end, name, stiffness):
    """An arm that is much stiffer (N, N m^2) and lighter than the steel beams of the cases, 0.2 m thick in pictures."""
    square = [(0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1), (0.1, -0.1)]
    k = stiffness
    section = cf.Stiffness((k, k), k, (k, k), k, mass=1e-3, inertia=(1e-3,) * 3, outline=square)
    return cf.Rod(cf.Line(start, end), section, name=name)


@problem(
    "Pin-ended double cross (NAFEMS FV2)",
    "motion",
    f"{SELECTED}, test 2; input as in the OptiStruct verification manual, OS-V 0400",
    "eight arms of 5 m, 125 mm square, E 200 GPa, 8000 kg/m^3, in one plane, pinned at their outer ends",
)
def double_cross():
    angles = np.arange(8) * math.pi / 4
    arms = [cf.Rod(cf.Line((0, 0, 0), (5 * math.cos(a), 5 * math.sin(a), 0)), cf.Rectangle(0.125, 0.125), STEEL,
                   name=f"arm {k}") for k, a in enumerate(angles)]  # fmt: skip
    joints = [cf.Joint(arms[0].start, arm.start) for arm in arms[1:]]
    flat = [cf.Foundation(arm, 1e12, (0, 0, 1)) for arm in arms]  # modes across the plane become fast
    found = cf.modes(cf.Scene(arms, [cf.Hinge(arm.end, (0, 0, 1)) for arm in arms], flat, joints), 16)
    published = [11.336, 17.709, 17.709, 45.345, 57.390, 57.390]
    because = "closed form of slender arms: 1.2 % by shear and rotary inertia in the last modes"
    row = compared("modes 1, 2 and 3, 4 to 8, 9, 10 and 11, 12 to 16 in the plane, Hz", published, found,
                   [0, 1, 3, 8, 9, 11], 1.3e-2, because)  # fmt: skip
    return [row], pictured(found)


@problem(
    "Free square frame (NAFEMS, test 3)",
    "motion",
    f"{SELECTED}, test 3; input as in the verification problems of SolidWorks Simulation",
    "four beams of 10 m, 250 mm square, E 200 GPa, nu = 0.3, 8000 kg/m^3, in one plane, free",
)
def square_frame():
    corners = [(0, 0, 0), (10, 0, 0), (10, 10, 0), (0, 10, 0), (0, 0, 0)]
    beams = [cf.Rod(cf.Line(a, b), cf.Rectangle(0.25, 0.25), STEEL, name=f"from {a[:2]}") for a, b in pairwise(corners)]
    joints = [cf.Joint(beams[k].end, beams[(k + 1) % 4].start) for k in range(4)]
    flat = [cf.Foundation(beam, 1e12, (0, 0, 1)) for beam in beams]  # modes across the plane become fast
    found = cf.modes(cf.Scene(beams, [], flat, joints), 11)
    published = [3.261, 5.668, 11.136, 12.849, 24.570, 28.695]
    because = "published without shear and rotary inertia"
    shown = [3, 4, 5, 7, 8, 9]
    quantity = "modes 4, 5, 6 and 7, 8, 9, 10 and 11 in the plane, Hz"
    row = compared(quantity, published, found, shown, 1e-2, because)
    return [row], lambda file: found.plot(file, which=shown)


@problem(
    "Cantilever with masses off its axis (NAFEMS FV4)",
    "motion",
    f"{SELECTED}, test 4; input as in the OptiStruct verification manual, OS-V 0410",
    "10 m, round, 0.5 m thick, E 200 GPa, nu = 0.3, 8000 kg/m^3; at its tip 10 t and 1 t, 2 m to either side",
)
def off_axis_masses():
    shaft = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), cf.Circle(0.5), STEEL, name="shaft")
    arms = [rigid((10, 0, 0), (10, y, 0), f"to y = {y} m", 1e12) for y in (2.0, -2.0)]
    masses = [cf.PointMass(arm.end, mass) for arm, mass in zip(arms, (1e4, 1e3), strict=True)]
    joints = [cf.Joint(shaft.end, arm.start) for arm in arms]
    found = cf.modes(cf.Scene([shaft, *arms], [cf.Clamp(shaft.start)], masses, joints), 6, tol=1e-4)
    published = [1.723, 1.727, 7.413, 9.972, 18.155, 26.957]
    because = "published without shear and rotary inertia of the shaft; arms stiff, not rigid"
    return [compared("Hz", published, found, list(range(6)), 1.2e-2, because)], pictured(found)


@problem(
    "Deep simply supported beam (NAFEMS FV5)",
    "motion",
    "NAFEMS benchmark FV5, issue 1 of 1989-01-09, closed form (caesarsystems.co.uk/NAFEMS_benchmarks/fv5.html)",
    "10 m, 2 m square, E 200 GPa, nu = 0.3, 8000 kg/m^3; x, y, z and twist held at one end, y and z at the other",
    "The page prints E = 210e3, its numbers are of 200 GPa. The issue of 1987 has 77.542 and 233.10 Hz in torsion, "
    "with the polar moment of area for the torsion constant, and 148.31 and 284.55 Hz in bending.",
)
def deep_beam():
    beam = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), cf.Rectangle(2.0, 2.0), STEEL, name="beam")
    arm = rigid((0, 0, 0), (0, 1, 0), "arm against twist", 1e14)
    supports = [cf.Pin(beam.start), *(cf.Roller(beam.end, x) for x in ((0, 1, 0), (0, 0, 1))),
                cf.Roller(arm.end, (0, 0, 1))]  # fmt: skip
    found = cf.modes(cf.Scene([beam, arm], supports, joints=[cf.Joint(beam.start, arm.start)]), 9)
    published = [42.650, 71.20, 125.00, 148.15, 213.61, 283.47]
    because = "digits printed; the arm against twist is stiff, not rigid"
    row = compared("modes 1 and 2, 3, 4, 5 and 6, 7, 8 and 9, Hz", published, found, shown := [0, 2, 3, 4, 6, 7], 4e-4,
                   because)  # fmt: skip
    return [row], lambda file: found.plot(file, which=shown)


@problem(
    "Ring of a round bar (NAFEMS, test 6)",
    "motion",
    f"{SELECTED}, test 6; reference values by Blevins' formulas, as quoted in FinEtoolsFlexStructures.jl, "
    "tutorials/circle_3d_modal_conv_tut.md",
    "free ring of 1 m radius, bar 0.1 m thick, E 200 GPa, nu = 0.3, 8000 kg/m^3",
    "The formulas have no shear: with it the frequencies are lower, by 2 % for n = 4.",
)
def thick_ring():
    ring = cf.Rod(cf.Arc((0, 0, 0), (1, 0, 0), 2 * math.pi), cf.Circle(0.1), STEEL, name="ring")
    found = cf.modes(cf.Scene([ring], joints=[cf.Joint(ring.end, ring.start)]), 18)
    published = [51.85, 53.38, 148.8, 151.0, 287.0, 289.5]
    because = "shear and rotary inertia, which the formulas leave out"
    row = compared(
        "pairs across the plane and in it, Hz", published, found, shown := list(range(6, 18, 2)), 2.1e-2, because
    )
    return [row], lambda file: found.plot(file, which=shown)


#: Measured flapping frequencies, Hz, by rpm: modes 1, 2 and 4 for tips swept by 0, 15, 30 and 45 degrees.
SWEPT = {
    0: ((1.4, 1.8, 1.7, 1.6), (10.3, 10.2, 10.4, 10.4), (27.7, 27.2, 26.6, 24.8)),
    500: ((10.2, 10.1, 10.2, 10.2), (25.2, 25.2, 23.7, 21.6), (47.0, 44.4, 39.3, 35.1)),
    750: ((14.8, 14.4, 14.9, 14.7), (36.1, 34.8, 30.7, 26.1), (62.9, 55.9, 48.6, 44.8)),
}


@problem(
    "Turning blade with a swept tip, measured",
    "motion",
    "Epps & Chandra, J. Am. Helicopter Soc. 41 (1996) 29, doi:10.4050/JAHS.41.29, as in GXBeam.jl, "
    "test/examples/rotating.jl",
    "31.5 in and a swept tip of 6 in, 1 x 0.063 in, E = 1.06e7 psi, nu = 0.325, 2.51e-4 lb s^2/in^4, root at 2.5 in",
    "In the rotating frame. Collocation of the intrinsic equations gives the same to 1e-5: what differs is the blade.",
)
def swept_tip():
    inch, psi = 0.0254, 6894.757
    aluminium = cf.Material(1.06e7 * psi, 0.325, density=2.51e-4 * psi / inch**2)
    rows, last = [], None
    for rpm, published in SWEPT.items():
        ours = []
        for angle in np.radians([0, 15, 30, 45]):
            points = inch * np.cumsum(
                [[2.5, 0, 0], [31.5, 0, 0], [6 * math.cos(angle), -6 * math.sin(angle), 0]], axis=0
            )
            rods = [cf.Rod(cf.Line(a, b), cf.Rectangle(inch, 0.063 * inch), aluminium, name=name)
                    for name, (a, b) in zip(("blade", "tip"), pairwise(points), strict=True)]  # fmt: skip
            turning = [cf.Centrifugal((0, 0, rpm * math.pi / 30))] if rpm else []
            scene = cf.Scene(rods, [cf.Clamp(rods[0].start)], turning, [cf.Joint(rods[0].end, rods[1].start)])
            last = cf.modes(scene, 6, tol=1e-4, damped=True)
            ours.append((last, swinging(last, 2)[:3]))
        for k, name in enumerate(("mode 1", "mode 2", "mode 4")):
            rows.append(measured(f"{name} at {rpm} rpm, Hz", published[k], ours, k))
    return rows, pictured(last)


def measured(quantity, published, results, k):
    """A `Row` of the k-th flapping mode of several results."""
    ours = np.array([found.frequencies[which[k]] for found, which in results])
    errors = np.array([found.error[which[k]] for found, which in results])
    published = np.array(published)
    allowed = np.maximum(0.1 * published, 1.0)
    return Row(quantity, published, ours, ours * errors, allowed, "measured; the limits of GXBeam's test")


@problem(
    "Torsion of drill pipe and collars",
    "motion",
    "Thomson, Theory of Vibration with Applications, example 9.3-3",
    "5000 ft of pipe of 4 1/2 x 3.83 in, below it 120 ft of collars of 7 5/8 x 2 in as a rigid disc; G = 12e6 psi, "
    "490 lb/ft^3; held at the top",
)
def drill_string_torsion():
    inch, G, density = 0.0254, 12e6 * 6894.757, 490 * 16.01846
    pipe = cf.Rod(cf.Line((0, 0, 0), (0, 0, -5000 * 12 * inch)), cf.Tube(4.5 * inch, 3.83 * inch),
                  cf.Material(2.5 * G, 0.25, density), name="pipe")  # fmt: skip
    polar = math.pi / 32 * ((7.625 * inch) ** 4 - (2 * inch) ** 4) * density * 120 * 12 * inch
    collars = cf.PointMass(pipe.end, 1.0, (1e-3, 1e-3, polar))
    scene = cf.Scene(
        [pipe], [cf.Clamp(pipe.start)], [cf.Foundation(pipe, 1e6), collars]
    )  # the bed holds all but torsion
    coarse, found = (cf.modes(scene, 2, elements=n) for n in (4, 8))
    ours = 2 * math.pi * found.frequencies
    errors = 2 * math.pi * np.abs(found.frequencies - coarse.frequencies)
    row = Row("rad/s", np.array([2.41, 7.93]), ours, errors, np.array([0.01, 0.02]),
              "the source rounds: 3.722/0.470 = 7.92 is printed as 7.93")  # fmt: skip
    s = np.linspace(0, pipe.length, 101)
    lines = [(f"{w:.4g} rad/s", s, found.equilibrium.between(pipe, s / pipe.length, found.turns(k, pipe))[:, 2], "-")
             for k, w in enumerate(ours)]  # fmt: skip
    return [row], charted("depth (m)", "rotation of the mode (-)", lines)
