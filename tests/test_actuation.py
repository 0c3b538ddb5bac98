"""Strains without stress: muscles, heat, growth and pretension, as a part of the law.

The values are of shooting with independent code, to 11 digits, where nothing else is said.
"""

from math import inf

import numpy as np
import pytest
from conftest import refuses

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
EI, GJ, EA, GA = 0.02, 0.016, 5000.0, 3000.0
HELIX, SPIRAL = (8.0, 0.0, 5.0), cf.signals.Along(lambda s: (0.0, 30.0 * s, 0.0))
FORCE = (0.05, -0.03, -0.1)


def rod_of(length=0.3, section=cf.Stiffness(shear=(GA, GA), axial=EA, bending=(EI, EI), torsion=GJ)):
    return cf.Rod(cf.Line((0, 0, 0), (0, 0, length)), section, name="rod")


ROD = rod_of()


def cantilever(*loads, rod=ROD):
    return cf.Scene([rod], [cf.Clamp(rod.start)], loads)


def held(*loads, rod=ROD):
    return cf.Scene([rod], [cf.Clamp(rod.start), cf.Clamp(rod.end)], loads)


BENT = {
    "helix": (HELIX, (), (0.120234932606, -0.175452231122, 0.10762410783), "spatial"),
    "helix under a force": (
        HELIX, [cf.Force(ROD.end, FORCE)], (0.126820314619, -0.175265697497, 0.0755589146386), "spatial"),
    "spiral of Cornu": (SPIRAL, (), (0.118413201463, 0.0, 0.249748932811), "planar"),
}  # fmt: skip
HOW = {"displacement": {"formulation": "displacement", "degree": 4}, "multiplier": {"formulation": "multiplier"}}


@pytest.mark.parametrize(("name", "how"), [*((name, {}) for name in BENT), *(("helix", how) for how in HOW.values()),
                                           ("helix under a force", HOW["multiplier"])], ids=str)  # fmt: skip
def test_a_muscle_bends_and_twists(name, how, truth):
    curvature, loads, tip, model = BENT[name]
    scene = cantilever(cf.Actuation(ROD, curvature=curvature), *loads)
    path = cf.solve(scene, [1.0], tol=1e-7, **how)
    assert path.model == model
    truth(f"actuation: {name}, end (m)", path.position(ROD.end)[-1], tip, 1e-8, of=1.0)
    if not loads:
        assert np.abs(path.fields(-1)["moment"]).max() < 1e-6 * EI * 8 and np.abs(path.force(ROD.start)).max() < 1e-5


def test_bimetal_strip(truth):
    """Timoshenko, J. Opt. Soc. Am. 11 (1925) 233, with twice the modulus and 1.5 times the thickness of the other."""
    n, m, h, of_strip = 2.0, 1.5, 1e-3, 8e-6 * 100.0
    k = 6 * of_strip * (1 + m) ** 2 / (h * (3 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1 / (m * n))))
    strip = rod_of(0.1)
    path = cf.solve(cantilever(cf.Actuation(strip, curvature=(0, k, 0)), rod=strip), [1.0], tol=1e-9)
    tip = 0.005153021547173833, 0, 0.09982275587737727
    truth("actuation: bimetal strip, end (m)", path.position(strip.end)[-1], tip, 1e-8, of=1.0, most=1e-10)
    fields = path.fields(-1)
    assert fields["curvature"][:, 1] == pytest.approx(k, rel=1e-9) and np.abs(fields["moment"]).max() < 1e-10


@pytest.mark.parametrize("model", ["planar", "spatial"])
def test_a_heated_bar_between_walls(model, truth):
    """N = -EA alpha dT at once, also where no node moves; and it buckles at P (1 + P/GA) = 4 pi^2 EI/L^2."""
    scene = held(cf.Thermal(ROD, alpha=1e-5, dT=100.0))
    path = cf.solve(scene, [0.5, 1.0], model=model, elements=1)
    assert path.force(ROD.end)[:, 2] == pytest.approx([-2.5, -5.0], rel=1e-10)
    assert path.fields(-1)["strain"][:, 2] == pytest.approx(0.0, abs=1e-12)
    if model == "spatial":
        Euler = 4 * np.pi**2 * EI / 0.3**2
        critical = GA / 2 * (np.sqrt(1 + 4 * Euler / GA) - 1) / EA / 1e-3
        found = cf.solve(scene, (0, 2.0), model=model, tol=1e-9)
        events = [event.load_factor for event in found.events]
        truth("actuation: heated bar, load factors at which it buckles", events, [critical] * 2, 1e-8)
        derivatives = found.sensitivity(found.events[0], ["loads[0].dT", "rods.rod.section.axial"]).derivatives
        assert derivatives["loads[0].dT"] == pytest.approx(-critical / 100.0, rel=1e-6)
        assert derivatives["rods.rod.section.axial"] == pytest.approx(-critical / EA, rel=1e-6)
        assert critical * 1e-3 == pytest.approx(0.0017494951160363704, rel=1e-14)
        linear = cf.buckling(scene, 2, tol=1e-4)
        assert (np.abs(linear.load_factors / critical - 1) <= linear.error).all()


def test_heat_across_the_section_bends():
    path = cf.solve(cantilever(cf.Thermal(ROD, alpha=1.2e-5, dT=100.0, gradient=(1e4, 5e3))), [1.0])
    assert path.fields(-1)["curvature"] == pytest.approx(np.tile([0.06, -0.12, 0.0], (len(path.fields(-1)["s"]), 1)))
    assert path.fields(-1)["strain"][:, 2] == pytest.approx(1.2e-3)


def test_growth_adds_up_over_pieces_and_actions():
    grown = cf.Actuation(ROD, strain=cf.signals.AlongPieces([(0.1, (0, 0, 0.5)), (0.2, (0.1, 0, 0.0))]))
    path = cf.solve(cantilever(grown, cf.Growth(ROD, 1.2, permanent=True)), [0.0, 1.0])
    assert path.position(ROD.end) == pytest.approx(np.array([(0, 0, 0.36), (0.01, 0, 0.41)]), abs=1e-9)
    assert all(np.abs(path.layout.breaks[0] - x).min() < 1e-12 for x in (1 / 3, 2 / 3))


def test_coupled_sections_and_infinite_stiffness():
    """The shape without stress is the same whatever the stiffness."""
    matrix = np.diag([GA, GA, EA, EI, EI, GJ])
    matrix[2, 4] = matrix[4, 2] = 3.0
    for section in (cf.Stiffness(matrix=matrix), cf.Stiffness((inf, inf), inf, (EI, EI), GJ)):
        rod = rod_of(section=section)
        muscle = cf.Actuation(rod, curvature=HELIX, strain=(0, 0, 0.1))
        path = cf.solve(cantilever(muscle, rod=rod), [1.0], tol=1e-8)
        assert path.position(rod.end)[-1] != pytest.approx((0.120234932606, -0.175452231122, 0.10762410783), abs=1e-3)
        assert np.abs(path.force(rod.start)[-1]).max() < 1e-5
        assert path.fields(-1)["strain"][:, 2] == pytest.approx(0.1, abs=1e-9)


def test_pretension():
    guy = cf.Pretension(ROD, force=100.0)
    path = cf.solve(held(guy, cf.Force(ROD.at(0.15), (0, 0, 8.0))), [0.0, 1.0])
    assert path.force(ROD.end)[:, 2] == pytest.approx([100.0, 96.0]) and path.force(ROD.start)[1, 2] == pytest.approx(
        104
    )
    short = cf.solve(held(cf.Pretension(ROD, rest_length=0.294, permanent=False)), [1.0])
    assert short.force(ROD.end)[0, 2] == pytest.approx(EA * 0.02)


def test_derivatives_by_what_has_no_stress():
    def deflection(tension):
        return held(cf.Pretension(ROD, force=tension), cf.Force(ROD.at(0.15), (1.0, 0, 0)))

    def of(path):
        return path.displacement(ROD.at(0.15))[-1, 0]

    found = cf.solve(deflection(10.0), [1.0], tol=1e-9).sensitivity(of, "loads[0].force")
    ahead, behind = (of(cf.solve(deflection(10.0 + h), [1.0], tol=1e-10)) for h in (1e-2, -1e-2))
    assert found.derivatives["loads[0].force"] == pytest.approx((ahead - behind) / 2e-2, rel=1e-4)


MOVING = cf.Stiffness(shear=(GA, GA), axial=EA, bending=(2.0, 2.0), torsion=1.6, mass=0.5, inertia=(1e-4, 1e-4, 2e-4))


@pytest.mark.slow
def test_the_work_of_a_muscle_in_motion():
    """It is the change of the strain energy, so that the balance closes; and what is slow follows the equilibria."""
    arm = rod_of(1.0, MOVING)
    loads = [
        cf.Actuation(arm, curvature=cf.signals.Sine((0.3, 1.0, 0.5), 2.0)),
        cf.Thermal(arm, 1e-5, cf.signals.Ramp(100.0, 0, 0.4)),
        cf.Growth(arm, lambda t: 1 + 0.1 * t),
    ]
    for scheme, exact in (("energy", 1e-11), ("generalised-alpha", 5e-3)):
        history = cf.simulate(cantilever(*loads, rod=arm), 0.2, dt=0.01, scheme=scheme, elements=2)
        assert np.abs(history.balance).max() < exact * history.work.max()
    slow = cf.Rod(arm.curve, MOVING, name="slow", damping=cf.Damping(drag=6.0))
    bent = cf.Actuation(slow, curvature=cf.signals.Ramp((0, 1.5, 0), 0, 8.0))
    history = cf.simulate(
        cantilever(bent, rod=slow), 10.0, dt=0.1, scheme="generalised-alpha", elements=2, model="spatial"
    )
    assert history.position(slow.end)[-1] == pytest.approx(((1 - np.cos(1.5)) / 1.5, 0, np.sin(1.5) / 1.5), abs=1e-4)
    assert history.fields(-1)["curvature"][:, 1] == pytest.approx(1.5, abs=1e-3)


@pytest.mark.parametrize(("T", "GA"), [(0.0, 1e4), (10.0, inf)])
def test_frequencies_of_a_guy(T, GA):
    """m omega^2 = EI k^4/(1 + EI k^2/GA) + T k^2 with k = pi/L, of a hinged rod without rotary inertia, and without
    shear where it is tightened."""
    guy = rod_of(2.0, cf.Stiffness((GA, GA), EA, (EI, EI), GJ, mass=0.5, inertia=(1e-12, 1e-12, 1e-12)))
    hinges = [cf.Hinge(end, (0, 1.0, 0)) for end in (guy.start, guy.end)]
    k = np.pi / 2.0
    acting = [cf.Pretension(guy, force=T, permanent=True)] if T else []
    modes = cf.modes(cf.Scene([guy], hinges, acting), 1)
    wanted = (EI * k**4 / (1 + EI * k**2 / GA) + T * k**2) / 0.5
    assert (2 * np.pi * modes.frequencies[0]) ** 2 == pytest.approx(wanted, rel=1e-7)


def bent(curvature=(0, 0, 0), strain=(0, 0, 0)):
    return cantilever(cf.Actuation(ROD, curvature=curvature, strain=strain))


RIGID = cf.Stiffness((inf, inf), inf, (1, 1), 1)
REFUSED = {
    "nothing": (lambda: cf.Actuation(ROD), "expected a curvature or a strain that is not zero"),
    "not finite": (lambda: cf.Actuation(ROD, curvature=(0, np.nan, 0)), "Actuation.curvature"),
    "no length": (lambda: cf.Actuation(ROD, strain=(0, 0, -1.0)), "expected a stretch above -1"),
    "no length in a piece": (lambda: bent(strain=cf.signals.AlongPieces([(0.1, (0, 0, -2.0))])),
                             "a stretch above -1"),
    "a jump": (lambda: bent(cf.signals.Along(lambda s: (0, 1.0 * (s > 0.1234567), 0))),
               "jumps at s = 0.123457 m: expected AlongPieces"),
    "both": (lambda: cf.Pretension(ROD, 3.0, 0.2), "either force"),
    "inextensible": (lambda: held(cf.Pretension("rod", 3.0), rod=rod_of(section=RIGID)),
                     "expected rest_length, since rod 'rod' cannot stretch"),
    "too tight": (lambda: held(cf.Pretension(ROD, 5000.0)), "a tension below EA"),
    "cold": (lambda: cf.Thermal(ROD, 1e-2, -100.0), "alpha dT above -1"),
    "shrunk": (lambda: cf.Growth(ROD, 0.0), "Growth.factor"),
    "out of the plane": (lambda: cf.solve(bent(HELIX), model="planar"),
                         "loads[0] (Actuation on rod) points out of the plane"),
    "too few elements": (
        lambda: cf.solve(bent(HELIX), [1.0], elements=2),
        "elements = 2: without stress one of rod 'rod' would turn by 1.42 rad: expected at most 1 rad, elements = 3"),
    "statics gives n": (lambda: cf.solve(cantilever(cf.Growth(ROD, 1.1)), model="determinate"),
                        "changes the strains without stress"),
}  # fmt: skip


test_refused = refuses(REFUSED)


@pytest.mark.parametrize(("acting", "load_factor"), [
    (lambda rod: [cf.Growth(rod, 0.5), cf.Growth(rod, 0.4)], 1.0),
    (lambda rod: [cf.Growth(rod, 0.5)], 2.5),
    (lambda rod: [cf.Pretension(rod, rest_length=0.1), cf.Growth(rod, 0.3)], 1.0),
])  # fmt: skip
def test_a_rod_without_length_is_refused(acting, load_factor):
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 0.3)), cf.Stiffness((3e3, 3e3), 5e3, (0.02, 0.02), 0.016), name="rod")
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [*acting(rod), cf.Force(rod.end, (0.01, 0, 0))])
    with pytest.raises(cf.SceneError, match="of its length left without stress"):
        cf.solve(scene, [load_factor])
