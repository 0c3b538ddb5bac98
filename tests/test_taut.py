"""The number of negative modes of rods under high tension, or far beyond their first critical load."""

import numpy as np
import pytest
from plane_scenes import STEEL

import cosserat_fenicsx as cf

# L = EI = 1
STIFF, SMALL = 1e13, 0.8
ONE_STEP = cf.StepControl(adaptive=False)
RUNGS = [("determinate", False), ("planar", False), ("planar", True), ("spatial", False), ("spatial", True)]


def straight(force, guided=False, *, K=STIFF, direction=(0.6, 0, 0.8), shear=STIFF):
    """A rod of length and bending stiffness 1, clamped at its start; its
    loaded end is free, or guided in the direction of the load."""
    rod = cf.Rod(cf.Line((0, 0, 0), direction), cf.Stiffness((shear, shear), K, (1, 1), SMALL), name="rod")
    x, y, z = direction
    supports = [cf.Clamp(rod.start)]
    if guided:
        supports += [cf.Roller(rod.end, (z, 0, -x)), cf.Roller(rod.end, np.cross((z, 0, -x), direction))]
    return cf.Scene([rod], supports, [cf.Force(rod.end, force * np.array(direction))])


def counts(scene, forces, **options):
    return cf.solve(scene, forces, steps=ONE_STEP, **options).negative_modes.tolist()


def critical_below(force, guided):
    """The number of critical loads x^2 below a force, each counted
    twice: cos x = 0 for a free end, otherwise tan x = x."""
    x, k = np.sqrt(force), np.arange(1, 1000)
    roots = (k - 0.5) * np.pi
    if guided:
        roots = (k + 0.5) * np.pi
        for _ in range(50):
            roots = k * np.pi + np.arctan(roots)
    return 2 * np.count_nonzero(roots < x)


@pytest.mark.parametrize("elements, degree", [(8, 4), (64, 2), (512, 1)])
@pytest.mark.parametrize("model, guided", RUNGS)
def test_tension_makes_no_negative_modes(model, guided, elements, degree):
    forces = [-10.0, 0.0, 1.0, 1e3, 1e6, 1e8, 1e10]
    assert counts(straight(1.0, guided), forces, model=model, elements=elements, degree=degree) == [
        critical_below(10.0, guided), 0, 0, 0, 0, 0, 0,
    ]  # fmt: skip


@pytest.mark.parametrize("model, guided", RUNGS)
def test_compression_makes_as_many_as_there_are_critical_loads_below(model, guided):
    """Half way between two critical loads, on a mesh where these were
    shifted by up to a quarter with a tighter bound of K."""
    roots = np.pi * (np.array([10, 159]) + 0.5 * guided)
    expected = [critical_below(x**2, guided) for x in roots]
    assert expected == [20, 318]
    assert counts(straight(-1.0, guided), list(roots**2), model=model, elements=256) == expected


@pytest.mark.serial
def test_degrees_and_the_finest_mesh_at_a_million():
    x = 318 * np.pi
    assert counts(straight(-1.0), [x**2], model="spatial", elements=512) == [636]
    for degree in (2, 3):
        assert counts(straight(1.0), [1e5, 1e10], model="spatial", elements=512, degree=degree) == [0, 0]


@pytest.mark.serial
@pytest.mark.parametrize("model", ["planar", "spatial"])
def test_infinite_stiffness(model):
    scene = straight(1.0, True, K=np.inf, shear=np.inf)
    assert counts(scene, [-1e3, 1e5, 1e10], model=model, elements=64) == [critical_below(1e3, True), 0, 0]


@pytest.mark.serial
def test_displacement_form():
    """On a rod so slender that with the true stiffnesses rounding errors would exceed the bending stiffness."""
    scene = straight(1.0, direction=(0, 0, 1.0))
    forces = [-10.0, 1.0, 1e3, 1e6]
    assert counts(scene, forces, model="spatial", formulation="displacement", elements=512) == [2, 0, 0, 0]


@pytest.mark.serial
def test_true_instability_of_a_soft_rod_stays():
    """Under a tension N > GA (1 + N/EA) the sections of a shear-flexible rod rotate: a real instability."""
    scene = straight(1.0, K=1e6, shear=1e5)
    threshold = 1 / (1 / 1e5 - 1 / 1e6)
    for model in ("determinate", "planar", "spatial"):
        below, above = counts(scene, [0.9 * threshold, 1.1 * threshold], model=model, elements=8)
        assert below == 0 < above, model


@pytest.mark.parametrize("tension", [10.0, 1e6])
def test_a_column_between_taut_wires(tension):
    """The wires support its top rigidly in their plane, and out of it with 2 T/L and the bending of their ends."""
    column = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Stiffness((1e9, 1e9), 1e9, (1, 1), SMALL), name="column")
    thin = cf.Stiffness((1e9, 1e9), 1e9, (1e-3, 1e-3), 1e-3)
    wires = [cf.Rod(cf.Line((side, 0, 1), (0, 0, 1)), thin, name=f"wire {side}") for side in (-1, 1)]
    ends = [
        cf.Prescribed(wire.start, displacement=(side * tension / 1e9, 0, 0), rotation=(0, 0, 0))
        for wire, side in zip(wires, (-1, 1), strict=True)
    ]
    joints = [cf.Joint(wire.end, column.end, release="all") for wire in wires]
    spring = 2 * tension + 2 * np.sqrt(tension * 1e-3)
    supported = 4.493409458**2
    x = np.linspace(1.6, 4.4934095, 100001)
    beside = np.sin(x) - x * (1 - x**2 / spring) * np.cos(x)
    critical = x[np.flatnonzero(np.diff(np.sign(beside)))[0]] ** 2
    expected = {0.98 * critical: 0, (critical + supported) / 2: 1, 1.02 * supported: 2}
    if tension > 1e3:
        del expected[(critical + supported) / 2]  # here both coincide
    for model in ("planar", "spatial"):
        for force, modes in expected.items():
            load = cf.Force(column.end, (0, 0, -force))
            scene = cf.Scene([column, *wires], [cf.Clamp(column.start), *ends], [load], joints)
            assert counts(scene, [1.0], model=model, elements=16) == [modes], (model, force)


@pytest.mark.serial
@pytest.mark.parametrize("model, elements", [("determinate", 16), ("planar", 16), ("planar", 256), ("spatial", 16)])
def test_a_steel_wire_with_a_small_force_across(model, elements):
    """2 mm, 100 m, 500 N at its end and 1 N transverse: the path starts without tension."""
    wire = cf.Rod(cf.Line((0, 0, 0), (0, 0, 100.0)), cf.Circle(0.002), STEEL, name="wire")
    scene = cf.Scene([wire], [cf.Clamp(wire.start)], [cf.Force(wire.end, (1.0, 0, 500.0))])
    path = cf.solve(scene, [1.0], model=model, elements=elements)
    assert path.negative_modes.tolist() == [0]
    EA, EI = 210e9 * np.pi * 1e-6, 210e9 * np.pi * 1e-12 / 4
    straight_part = 100.0 * (1 + 500 / EA) - np.sqrt(EI / 500)
    assert path.displacement(wire.end)[0, 0] == pytest.approx(straight_part / 500, rel=2e-4)


@pytest.mark.serial
@pytest.mark.parametrize("slenderness", [1e4, 3e4])
def test_a_taut_wire_with_a_force_at_mid_span(slenderness):
    """Strained by 1e-3 between two clamps, then loaded by 1 N: the deflection of
    a beam under tension, including the strain due to the sag."""
    L = 0.002 * slenderness
    wire = cf.Rod(cf.Line((0, 0, 0), (L, 0, 0)), cf.Circle(0.002), STEEL, name="wire")
    ends = [cf.Clamp(wire.start), cf.Prescribed(wire.end, displacement=(1e-3 * L, 0, 0), rotation=(0, 0, 0))]
    path = cf.solve(cf.Scene([wire], ends, [cf.Force(wire.at(L / 2), (0, 0, -1.0))]), [1.0], tol=1e-5)
    assert path.model == "planar" and path.stable.all()
    EA, EI = 210e9 * np.pi * 1e-6, 210e9 * np.pi * 1e-12 / 4
    T = EA * (1e-3 + (0.5 / (EA * 1e-3)) ** 2 / 2)
    boundary = np.sqrt(EI / T)
    deflection = (L * (1 + 1e-3) - 4 * boundary) / (4 * T)
    assert path.displacement(wire.at(L / 2))[0, 2] == pytest.approx(-deflection, rel=2e-5)


@pytest.mark.serial
@pytest.mark.parametrize("diameter", [0.005, 0.001])
@pytest.mark.parametrize("held", ["hinged", "clamped"])
def test_a_wire_that_hangs_as_an_arc(diameter, held):
    """110 m between two points 100 m apart, a circular arc in the reference, close to a catenary under its weight. On
    the first mesh the thin one seems to buckle out of its plane."""
    angle = 1.0
    for _ in range(100):  # sin(a/2)/(a/2) = 100/110
        angle = 2 * np.sin(angle / 2) * 1.1
    R = 110.0 / angle
    wire = cf.Rod(
        cf.Arc((0, 0, 0), (-R * np.sin(angle / 2), 0, -R * np.cos(angle / 2)), angle, axis=(0, -1, 0)),
        cf.Circle(diameter), STEEL, name="wire",
    )  # fmt: skip
    hold = cf.Clamp if held == "clamped" else lambda end: cf.Hinge(end, (0, 1, 0))
    path = cf.solve(cf.Scene([wire], [hold(wire.start), hold(wire.end)], [cf.Weight()]), [1.0], tol=1e-3)
    assert path.model == "planar" and path.stable.all()
    c = 50.0
    for _ in range(200):  # parameter c of the catenary: 2 c sinh(50/c) = 110
        c = 50.0 / np.arcsinh(55.0 / c)
    sag = c * (np.cosh(50.0 / c) - 1)
    drop = path.position(wire.at(55.0))[0, 2] - path.position(wire.start)[0, 2]
    assert drop == pytest.approx(-sag, rel=2e-3)
