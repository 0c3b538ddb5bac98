"""Actions that depend on the state: closed forms, fluids, the protocol, memory, and traits found from UFL."""

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import ufl
from conftest import refuses

import cosserat_fenicsx as cf
from cosserat_fenicsx.actions.fluids import AddedMass, LinearDrag
from cosserat_fenicsx.forms import contact
from cosserat_fenicsx.models.formulation import found_traits, traits_of
from cosserat_fenicsx.scene import action

EI, RHO = 1.0, 1.0
SECTION = cf.Stiffness(shear=(1e6, 1e6), axial=1e6, bending=(EI, EI), torsion=0.8, mass=RHO, inertia=(1e-8, 1e-8, 2e-8))
ROD = cf.Rod(cf.Line((0, 0, 0), (1.0, 0, 0)), SECTION, name="beam")


def test_a_beam_on_an_elastic_bed():
    """Hetenyi, Beams on Elastic Foundation (1946): the deflection of a long beam under a force P at its middle is
    P lambda/(2 k) there, lambda = (k/4EI)^(1/4), and its moment P/(4 lambda)."""
    k, P, L = 4.0 * 1e4, 1e-3, 4.0
    lam = (k / (4 * EI)) ** 0.25
    rod = cf.Rod(cf.Line((-L / 2, 0, 0), (L / 2, 0, 0)), SECTION)
    beds = {cf.Foundation(rod, k): ("planar", "spatial"), cf.Foundation(rod, k, direction=(0, 0, 1)): ("planar",)}
    for bed, models in beds.items():  # the far end, twenty decay lengths away, may be clamped
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], [bed, cf.Force(rod.at(L / 2), (0, 0, P))])
        for model in models:
            path = cf.solve(scene, [1.0], elements=32, model=model)
            w, m = path.displacement(rod.at(L / 2))[0, 2], path.moment(rod.at(L / 2))[0, 1]
            assert w == pytest.approx(P * lam / (2 * k), rel=2e-4), model  # shear: EI lambda^2/GA
            assert abs(m) == pytest.approx(P / (4 * lam), rel=2e-4)
            assert abs(path.moment(rod.at(L / 2 + math.pi / (4 * lam)))[0, 1]) < 1e-3 * abs(m)  # changes its sign there
            # foundation and clamp together carry the load: the contact force jumps by P at the middle
            jump = path.force(rod.at(L / 2 + 1e-9))[0, 2] - path.force(rod.at(L / 2))[0, 2]
            assert jump == pytest.approx(-P, rel=1e-6)
    assert cf.solve(scene, [1.0], elements=4).model == "planar"


@pytest.mark.serial
def test_springs_hold_a_rod_and_each_model_agrees():
    """A nearly rigid rod on a rotational and a lateral spring; for a
    rigid one c theta + k L sin(theta) L cos(theta) = M."""
    stiff = cf.Stiffness(shear=(1e7, 1e7), axial=1e7, bending=(1e6, 1e6), torsion=1e6, mass=1.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (1.0, 0, 0)), stiff)
    c, k, M = 3.0, 2.0, 6.0
    scene = cf.Scene([rod], [cf.Pin(rod.start)],
                     [cf.Spring(rod.start, rotational=c), cf.Spring(rod.end, k, direction=(0, 0, 1)),
                                                  cf.Moment(rod.end, (0, -M, 0))])  # fmt: skip
    found = {}
    for model in ("planar", "spatial"):
        path = cf.solve(scene, [1.0], elements=2, model=model)
        theta = path.rotation_angle(rod.end)[0]
        found[model] = theta
        assert c * theta + k * math.sin(theta) * math.cos(theta) == pytest.approx(
            M, rel=1e-4
        )  # the rod itself bends a little
        assert path.negative_modes[-1] == 0
    assert found["planar"] == pytest.approx(found["spatial"], abs=1e-8)
    assert found["planar"] > math.pi / 2


@pytest.mark.serial
def test_a_spring_beyond_half_a_turn():
    """The moment of a rotational spring stays proportional to the angle beyond pi, in every model."""
    stiff = cf.Stiffness(shear=(1e7, 1e7), axial=1e7, bending=(1e6, 1e6), torsion=1e6)
    rod = cf.Rod(cf.Line((0, 0, 0), (1.0, 0, 0)), stiff)
    scene = cf.Scene(
        [rod], [cf.Pin(rod.start)], [cf.Spring(rod.start, rotational=2.0), cf.FollowerMoment(rod.start, (0, 9.0, 0))]
    )
    for model in ("planar", "spatial"):
        path = cf.solve(scene, [1.0], elements=1, degree=2, model=model)
        assert path.rotation_angle(rod.end)[0] == pytest.approx(4.5, abs=1e-9), model


def rayleigh(ratio):
    """First root b of 1 + cosh b cos b = ratio b (sin b cosh b - cos b sinh b): a cantilever with a mass at its end."""
    from scipy.optimize import brentq

    def f(b):
        return 1 + math.cosh(b) * math.cos(b) - ratio * b * (math.sin(b) * math.cosh(b) - math.cos(b) * math.sinh(b))

    return brentq(f, 1e-3, 1.8751040687)


@pytest.mark.serial
@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0])
def test_a_mass_at_the_end_of_a_cantilever(ratio):
    scene = cf.Scene([ROD], [cf.Clamp(ROD.start)], [cf.PointMass(ROD.end, ratio * RHO)])
    omega = 2 * math.pi * cf.modes(scene, 2, elements=4).frequencies
    assert omega[0] == pytest.approx(rayleigh(ratio) ** 2, rel=1e-5)  # shear and rotary inertia: 3 EI/GA
    # the whole weight is on the clamp
    heavy = cf.Scene([ROD], scene.supports, [*scene.loads, cf.Weight((0, 0, -1e-2))])
    path = cf.solve(heavy, [1.0], elements=4)
    np.testing.assert_allclose(path.force(ROD.start)[0], (0, 0, -1e-2 * (1 + ratio) * RHO), atol=1e-9)


@pytest.mark.serial
def test_a_body_that_turns():
    """A stiff shaft with a disc: the torsional mode of a cantilever whose end has the moment J, omega^2 = GJ/(L J)."""
    J = 0.05
    scene = cf.Scene([ROD], [cf.Clamp(ROD.start)], [cf.PointMass(ROD.end, 1e-9, (1e-9, 1e-9, J))])
    omega = 2 * math.pi * cf.modes(scene, 4, elements=4).frequencies
    assert np.abs(omega / math.sqrt(0.8 / J) - 1).min() < 1e-6


@pytest.mark.serial
@pytest.mark.parametrize("scheme", ["momentum", "energy", "generalised-alpha"])
def test_a_falling_rod_reaches_its_terminal_speed(scheme):
    """A level rod that falls through a fluid: v' = g - (c/rho) v^2, so v = v_t tanh(g t/v_t), v_t = sqrt(rho g/c)."""
    g, c = 2.0, 8.0
    scene = cf.Scene([ROD], loads=[cf.Weight((0, 0, -g)), cf.Drag(ROD, normal=c)])
    terminal = math.sqrt(RHO * g / c)
    history = cf.simulate(scene, 0.5, dt=0.005, elements=1, degree=2, scheme=scheme, save_every=0.25)
    np.testing.assert_allclose(
        history.velocity(ROD.end)[:, 2], -terminal * np.tanh(g / terminal * history.times), rtol=2e-4, atol=1e-12
    )
    history = cf.simulate(scene, 4.0, dt=0.02, elements=1, degree=2, scheme=scheme, save_every=4.0)
    assert history.velocity(ROD.end)[-1, 2] == pytest.approx(-terminal, rel=1e-6)
    assert np.abs(history.balance).max() < 1e-3 * history.work.max() or scheme == "generalised-alpha"


@pytest.mark.serial
@pytest.mark.parametrize("scheme", ["momentum", "generalised-alpha"])
@pytest.mark.parametrize("model", ["planar", "spatial"])
def test_a_dashpot_stops_a_free_rod(scheme, model):
    """A rod that moves along its axis against a dashpot b, v = v_0
    exp(-b t/m); and one that spins in its plane against d."""
    b = 3.0
    velocity = cf.InitialVelocity(ROD, linear=(1.0, 0, 0), angular=(0, 0, 1e-2), about=(0.5, 0, 0))
    scene = cf.Scene([ROD], loads=[cf.Dashpot(ROD.at(0.5), b, rotational=0.4)], velocities=[velocity])
    history = cf.simulate(scene, 0.5, dt=2e-3, elements=2, degree=2, save_every=0.05, scheme=scheme, model=model)
    total = history.linear_momentum[:, 0]
    np.testing.assert_allclose(total, np.exp(-b * history.times), rtol=2e-2)  # axial waves travel in it
    assert history.angular_momentum[1, 2] < 0.95 * history.angular_momentum[0, 2]


TANGENCY = json.loads((Path(__file__).parent / "reference" / "b_bha_tangency.json").read_text(encoding="utf-8"))


def wall_forces(path):
    """Forces on the nodes of all elements of the only rod, along -y, N, and their arc lengths, m."""
    (rod,) = path.scene.rods
    sizes = np.diff(path.layout.breaks[0]) * rod.length
    density = -path._records[0].densities[1][:, :, 1] * path.scales.force / path.scales.length
    places = path.layout.inside(path.rule.nodes)[0] * rod.length
    return (density * path.rule.lobatto * sizes[:, None]).ravel(), places.ravel()


@pytest.mark.serial
@pytest.mark.parametrize("case", [1, 3])
def test_a_bottom_hole_assembly_lies_on_the_wall(case):
    """Pipe in a straight inclined hole: bit force and tangency length by
    an independent Kirchhoff rod at finite rotations."""
    given = TANGENCY[case]
    truth, r = given["exact_kirchhoff"], given["clearance"]
    inclination, L = math.radians(given["inclination_deg"]), 24.0
    pipe = cf.Stiffness(
        shear=(math.inf, math.inf), axial=math.inf, bending=(given["EI"], given["EI"]), torsion=given["EI"]
    )
    rod = cf.Rod(cf.Line((0, r, 0), (L, r, 0), d1=(0, 1, 0)), pipe)
    w = given["w"]
    gravity = np.array([-w * math.cos(inclination), w * math.sin(inclination), 0.0])
    supports = [cf.Prescribed(rod.start, displacement=(0, -r, 0)), cf.Roller(rod.end, (0, 1, 0)),
                cf.Roller(rod.end, (0, 0, 1)),
                cf.Prescribed(rod.end, rotation=(0, 0, 0))]  # fmt: skip
    top = given["WOB"] - w * math.cos(inclination) * L  # the axial thrust that remains at the top
    loads = [
        cf.LineForce(rod, tuple(gravity), permanent=True),
        cf.Force(rod.end, (-top, 0, 0), permanent=True),
        cf.Wall(rod, (0, 0, 0), (1, 0, 0), r, 1e10),
    ]
    path = cf.solve(cf.Scene([rod], supports, loads), [1.0], elements=96, degree=3)
    bit = path.force(rod.start)[0]
    assert abs(bit[1]) == pytest.approx(truth["bit_side_force"], rel=1e-4)
    assert abs(bit[0]) == pytest.approx(given["WOB"], rel=1e-6, abs=1e-3)
    # force and moment of the wall's pressure: the concentrated force P at a, then w sin(inc) per metre up to the top
    forces, places = wall_forces(path)
    forces, places = (
        np.append(forces, -path.force(rod.end)[0, 1]),
        np.append(places, L),
    )  # the roller also touches the wall
    # the end that does not rotate adds a moment to these forces
    q, F, S = w * math.sin(inclination), forces.sum(), forces @ places - abs(path.moment(rod.end)[0, 2])
    a = (-(F - q * L) + math.sqrt((F - q * L) ** 2 - 2 * q * (q * L**2 / 2 - S))) / q
    assert a == pytest.approx(truth["arc_length_to_tangency"], rel=1e-4)
    assert F - q * (L - a) == pytest.approx(truth["reaction_at_tangency"], rel=1e-4)
    assert path.position(rod.at(truth["arc_length_to_tangency"]))[0, 1] == pytest.approx(r, rel=1e-3)


@pytest.mark.serial
def test_a_column_on_an_elastic_bed_buckles_in_waves():
    """Timoshenko & Gere, Theory of Elastic Stability (1961), 2.10: P =
    pi^2 EI/L^2 (m^2 + k L^4/(m^2 pi^4 EI)), least over m."""
    k, slim = 16 * math.pi**4 * 0.9, cf.Stiffness((1e8, 1e8), 1e8, (EI, 100.0), 50.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (1.0, 0, 0)), slim)
    supports = [cf.Hinge(rod.start, (0, 1, 0)), cf.Roller(rod.end, (0, 0, 1)), cf.Roller(rod.end, (0, 1, 0))]
    scene = cf.Scene([rod], supports, [cf.Foundation(rod, k, direction=(0, 0, 1)), cf.Force(rod.end, (-1.0, 0, 0))])
    loads = sorted(math.pi**2 * (m**2 + k / (m**2 * math.pi**4)) for m in (1, 2, 3))
    found = cf.buckling(scene, 2)
    np.testing.assert_allclose(found.load_factors[0], loads[0], rtol=1e-5)
    path = cf.solve(scene, [0.98 * loads[0], 1.02 * loads[0]], model="spatial", elements=8)
    assert path.negative_modes.tolist() == [0, 1]


HEAVY = cf.Stiffness((1e8, 1e8), 1e8, (1e5, 1e5), 1e5, mass=2.0, inertia=(0.1, 0.15, 0.2))
BAR = cf.Rod(cf.Line((0, 0, 0), (1, 2, 2)), HEAVY, name="rod")
TANGENT, ACROSS = np.array([1, 2, 2]) / 3, np.array([2, 1, -2]) / 3
SCHEMES = ("momentum", "energy", "generalised-alpha")


@pytest.mark.serial
def test_across_and_along():
    """A force on a free rod: the acceleration is F/(m L) along it and F/((m + m_a) L) across it; the same in space
    where all mass is added to, which the next test has."""
    kinds = [(False, scheme, model) for scheme in SCHEMES for model in ("planar", "spatial")]
    kinds.remove((False, "energy", "planar"))
    for axial, scheme, model in [*kinds, (True, "momentum", "planar")]:
        loads = [AddedMass(BAR, 3.0, axial), cf.LineForce(BAR, 2.0 * TANGENT + 5.0 * ACROSS)]
        history = cf.simulate(
            cf.Scene([BAR], loads=loads), 1, dt=0.05, elements=2, degree=2, model=model, scheme=scheme
        )
        moved = history.displacement(BAR.at(1.5))[-1]
        expected = 2.0 / (5.0 if axial else 2.0) / 2 * TANGENT + 5.0 / 5.0 / 2 * ACROSS
        np.testing.assert_allclose(moved, expected, atol=2e-4)
        assert history.kinetic[-1] == pytest.approx(history.work[-1], rel=1e-3)
        p = history.linear_momentum[-1]
        np.testing.assert_allclose(p, 3 * (2.0 * TANGENT + 5.0 * ACROSS), rtol=1e-9)


@pytest.mark.serial
def test_an_eccentric_rod_with_masses_on_its_axis():
    """Free, with the added mass and a point mass on the axis: energy and momenta as of the single bodies, and kept."""
    rod = cf.Rod(BAR.curve, HEAVY, eccentricity=(0.1, -0.05))
    arm = rod.curve.frame(0.0) @ [0.1, -0.05, 0]
    v, w = np.array([1, 0.5, 0.2]), np.array([1, 2, -1.5])
    scene = cf.Scene([rod], loads=[AddedMass(rod, 3.0, axial=True), cf.PointMass(rod.end, 0.5, 0.01)],
                     velocities=[cf.InitialVelocity(rod, v, w, about=(0, 0, 0))])  # fmt: skip
    s, weights = np.polynomial.legendre.leggauss(4)
    places, weights = np.outer(1.5 * (1 + s), TANGENT), 1.5 * weights
    frame = rod.curve.frame(0.0)
    bodies = [(2.0 * k, y + arm, k * frame @ np.diag([0.1, 0.15, 0.2]) @ frame.T)
              for k, y in zip(weights, places, strict=True)]  # fmt: skip
    bodies += [(3.0 * k, y, np.zeros((3, 3))) for k, y in zip(weights, places, strict=True)]
    bodies += [(0.5, 3 * TANGENT, 0.01 * np.eye(3))]
    p = sum(m * (v + np.cross(w, y)) for m, y, _ in bodies)
    L = sum(m * np.cross(y, v + np.cross(w, y)) + J @ w for m, y, J in bodies)
    energy = sum(m * np.sum((v + np.cross(w, y)) ** 2) + w @ J @ w for m, y, J in bodies) / 2
    for scheme in SCHEMES:
        history = cf.simulate(scene, 0.2, dt=0.005, elements=2, degree=2, scheme=scheme)
        np.testing.assert_allclose(history.linear_momentum[0], p, rtol=1e-12)
        np.testing.assert_allclose(history.angular_momentum[0], L, rtol=1e-12)
        assert history.kinetic[0] == pytest.approx(energy, rel=1e-12)
        kept = 1e-10 if scheme == "momentum" else 2e-3
        np.testing.assert_allclose(history.angular_momentum, np.tile(L, (len(history), 1)), atol=kept * np.abs(L).max())


def test_frequencies_in_a_fluid():
    """Those of bending fall by sqrt(m/(m + m_a)), those along and about the axis stay."""
    section = cf.Stiffness((1e9, 1e9), 1e4, (1e3, 2e3), 3e3, mass=2.0, inertia=(1e-6, 1e-6, 0.5))
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 2)), section)
    found = [
        cf.modes(cf.Scene([rod], [cf.Clamp(rod.start)], loads), 4, elements=4).frequencies
        for loads in ([], [AddedMass(rod, [(0.5, 2.0), (None, 2.0)])], [AddedMass(rod, 2.0, axial=True)])
    ]
    axial, twist = np.sqrt(1e4 / 2) / 8, np.sqrt(3e3 / 0.5) / 8
    bending = found[0][:2]
    np.testing.assert_allclose(found[0][2:], [axial, twist], rtol=1e-4)
    np.testing.assert_allclose(found[1], [*bending / np.sqrt(2), axial, twist], rtol=1e-4)
    np.testing.assert_allclose(
        np.sort(found[2]), np.sort([*bending / np.sqrt(2), axial / np.sqrt(2), twist]), rtol=1e-4
    )


@pytest.mark.serial
def test_drag_stops_a_rod():
    """m v' = -c v, across and along."""
    v = 2.0 * TANGENT + 5.0 * ACROSS
    scene = cf.Scene([BAR], loads=[LinearDrag(BAR, 4.0, 1.0)], velocities=[cf.InitialVelocity(BAR, v)])
    for scheme in SCHEMES:
        history = cf.simulate(scene, 0.5, dt=0.01, elements=2, degree=2, scheme=scheme)
        expected = 2.0 * np.exp(-1.0 * 0.5 / 2) * TANGENT + 5.0 * np.exp(-4.0 * 0.5 / 2) * ACROSS
        np.testing.assert_allclose(history.velocity(BAR.end)[-1], expected, atol=1e-4)
        assert np.abs(history.balance).max() < 1e-3 * history.energy[0]


@pytest.mark.serial
def test_the_mud_around_a_collar():
    steel = cf.Material(206e9, 0.3, density=7850.0)
    line, mud = cf.Line((0, 0, 0), (0, 0, 12)), cf.well.Mud(1200.0, added_mass=1.7, drag=283.0)
    tube = cf.Rod(line, cf.Tube(0.1714, 0.0714), steel)
    mass, drag = mud.along(tube)
    assert mass.mass == pytest.approx(47.06972748986194 + 4.804714105288387, rel=1e-12) and mass.lateral
    assert (drag.normal, drag.tangential) == (283.0, 0.0)
    pieces = cf.Rod(line, [(5.0, cf.Tube(0.1714, 0.0714)), (None, cf.Circle(0.1))], steel)
    ends, masses = zip(*mud.along(pieces)[0].mass, strict=True)
    assert ends == (5.0, 12.0) and masses == pytest.approx([mass.mass, 1.7 * 1200 * np.pi / 4 * 0.01])
    bare = cf.Rod(line, HEAVY, name="bare")
    assert mud.along(bare, 0.1714, 0.0714)[0].mass == pytest.approx(mass.mass)
    assert cf.well.Mud(1200.0).along(tube) == ()
    with pytest.raises(cf.SceneError, match=r"Mud.along.outer = None: expected the diameter of rod 'bare'"):
        mud.along(bare)


REFUSED = {
    "a coefficient": (lambda: cf.well.Mud(1200.0, added_mass=-1.0),
                      "Mud.added_mass = -1.0: expected a coefficient, not negative"),
    "drag": (lambda: cf.well.Mud(1200.0, drag=np.inf), "Mud.drag = inf"),
    "mass": (lambda: AddedMass(BAR, 0.0), "AddedMass.mass = 0.0: expected a positive number"),
    "pieces": (lambda: AddedMass(BAR, [(1.0, 2.0), (0.5, 1.0)]), "AddedMass.mass[1].to"),
    "a piece": (lambda: AddedMass(BAR, [(1.0, -2.0), (None, 1.0)]), "AddedMass.mass[0] = -2.0"),
    "axial": (lambda: AddedMass(BAR, 1.0, axial=1), "AddedMass.axial = 1"),
    "normal": (lambda: LinearDrag(BAR, 0.0), "LinearDrag.normal = 0.0"),
    **{f"a wall {i}": (lambda given=given: cf.Wall(ROD, *given, 0.05), f"lies beyond its surface at rest, {words}")
       for i, (given, words) in enumerate(((((0, 0, 0), (0, 0, 1)), "at s = 1 m by 0.95 m: expected a point"),
                                           (((0, 0, 0.2), (1, 0, 0)), "at s = 0 m by 0.15 m: expected a point")))},
}  # fmt: skip


test_what_is_refused = pytest.mark.serial(refuses(REFUSED))


SLIM = cf.Stiffness((1e6, 1e6), 1e6, (1.0, 1.0), 0.8, mass=1.0, inertia=(1e-8, 1e-8, 2e-8))
BEAM = cf.Rod(cf.Line((0, 0, 0), (1.0, 0, 0)), SLIM, name="beam")


@pytest.mark.serial
def test_permanent_loads_come_first():
    """Weight first, then the end force: the path begins under the
    weight, and ends where both applied together would."""
    weight = cf.LineForce(BEAM, (0, 0, -2.0), permanent=True)
    scene = cf.Scene([BEAM], [cf.Clamp(BEAM.start)], [weight, cf.Force(BEAM.end, (0, 1.5, 1.0))])
    both = cf.Scene(
        [BEAM], [cf.Clamp(BEAM.start)], [cf.LineForce(BEAM, (0, 0, -2.0)), cf.Force(BEAM.end, (0, 1.5, 1.0))]
    )
    alone = cf.Scene([BEAM], [cf.Clamp(BEAM.start)], [cf.LineForce(BEAM, (0, 0, -2.0))])
    for options in ({"elements": 4}, {"tol": 1e-6}, {"elements": 4, "model": "spatial"}):
        path = cf.solve(scene, [0.0, 1.0], **options)
        together = cf.solve(both, [1.0], **options).displacement(BEAM.end)[-1]
        np.testing.assert_allclose(path.displacement(BEAM.end)[1], together, atol=2e-7)
        np.testing.assert_allclose(
            path.displacement(BEAM.end)[0], cf.solve(alone, [1.0], **options).displacement(BEAM.end)[0], atol=2e-7
        )
        np.testing.assert_allclose(path.force(BEAM.start), [(0, 0, -2.0), (0, 1.5, -1.0)], atol=1e-7)
    assert path.model == "spatial" and "determinate" in cf.solve(scene, [1.0]).model


@pytest.mark.serial
def test_loads_that_change_along_a_rod(tmp_path):
    """A triangular load q s/L on a cantilever: 11 q L^4/(120 EI), by a function, a table, a file; and pieces."""
    q = 1e-3
    (tmp_path / "load.csv").write_text(f"# s, fx, fy, fz\n0, 0, 0, 0\n1.0, 0, 0, {q}\n")
    kinds = [
        cf.signals.Along(lambda s: (0, 0, q * s)),
        cf.signals.AlongTable([0, 1.0], [(0, 0, 0), (0, 0, q)]),
        cf.signals.AlongTable(tmp_path / "load.csv"),
    ]
    for force in kinds:
        path = cf.solve(cf.Scene([BEAM], [cf.Clamp(BEAM.start)], [cf.LineForce(BEAM, force)]), [1.0], elements=2)
        assert path.displacement(BEAM.end)[0, 2] == pytest.approx(11 * q / 120, rel=1e-5)
        np.testing.assert_allclose(path.force(BEAM.at(0.5))[0, 2], q * (1 - 0.25) / 2, rtol=1e-9)
    half = cf.LineForce(BEAM, cf.signals.AlongPieces([(0.3, (0, 0, 0)), (0.7, (0, 0, q))]))
    path = cf.solve(cf.Scene([BEAM], [cf.Clamp(BEAM.start)], [half]), [1.0], elements=2)
    assert path.moment(BEAM.start)[0, 1] == pytest.approx(-q * 0.4 * 0.5, rel=1e-9)
    for bad in (lambda: cf.signals.Along(3), lambda: cf.signals.AlongTable([1, 0], [(0, 0, 0)] * 2),
                lambda: cf.signals.AlongPieces([(0.0, (0, 0, 1))]),
                lambda: cf.signals.AlongTable("no.csv"),
                lambda: cf.LineForce(BEAM, cf.signals.Along(lambda s: 1 / 0))):  # fmt: skip
        with pytest.raises(cf.SceneError):
            bad()


@dataclass(frozen=True)
class Slider(cf.PointAction):
    """A spring k that slips at the force limit; its memory is the distance slipped (along x)."""

    station: object
    stiffness: float
    limit: float

    scaled = False
    memory = (action.scalar(0.0, "m"),)

    def data(self, rod, s):
        return (action.scalar(self.stiffness, "N/m"), action.scalar(self.limit, "N"), action.vector((1.0, 0, 0), "1"))

    @staticmethod
    def _force(point, k, limit, along, slipped):
        return ufl.max_value(ufl.min_value(k * (ufl.dot(point.u, along) - slipped), limit), -limit)

    @staticmethod
    def work(point, test, k, limit, along, slipped):
        return -Slider._force(point, k, limit, along, slipped) * ufl.dot(along, test.phi_r)

    @staticmethod
    def evolve(point, k, limit, along, slipped):
        return [ufl.dot(point.u, along) - Slider._force(point, k, limit, along, slipped) / k]


def test_an_action_that_remembers():
    """A rod and a slider in parallel under cyclic load: the hysteresis of
    an elastic, ideally plastic element in closed form."""
    EA, k, limit = 100.0, 50.0, 1.0
    rod = cf.Rod(cf.Line((0, 0, 0), (1.0, 0, 0)), cf.Stiffness((EA, EA), EA, (1.0, 1.0), 1.0, mass=1.0))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [Slider(rod.end, k, limit), cf.Force(rod.end, (4.0, 0, 0))])
    factors = [0.5, 1.0, 0.5, 0.0, -0.5, -1.0, 0.0, 1.0]
    slipped, expected = 0.0, []
    for eta in factors:
        F = 4.0 * eta
        u = (F + k * slipped) / (EA + k)
        for sign in (1, -1):
            if sign * k * (u - slipped) > limit:
                u = (F - sign * limit) / EA
                slipped = u - sign * limit / k
        expected.append(u)
    for options in ({"elements": 2}, {"tol": 1e-6}, {"elements": 2, "model": "spatial"}):
        path = cf.solve(scene, factors, **options)
        np.testing.assert_allclose(path.displacement(rod.end)[:, 0], expected, rtol=1e-9)
    assert abs(expected[3]) > 1e-3  # a displacement remains after unloading


@dataclass(frozen=True)
class RoundWall(cf.LineAction):
    """A wall around a circular axis, whose nearest point is computed at every iteration."""

    rod: object
    radius: float
    clearance: float
    stiffness: float

    scaled, at_nodes = False, True

    def data(self, rod, s):
        return self.refreshed(rod, s, rod.curve.position(s))

    def refreshed(self, rod, s, r):
        out = r / np.linalg.norm(r, axis=1, keepdims=True)
        return (
            action.vector(self.radius * out, "m from origin"),
            action.vector(np.cross((0, 1.0, 0), out), "1"),
            action.scalar(np.full(len(r), self.clearance), "m"),
            action.scalar(np.full(len(r), self.stiffness), "N/m^2"),
        )

    @staticmethod
    def work(point, test, axis, direction, clearance, stiffness):
        return contact.obstacle_work(point, test, contact.hole, (axis, direction, clearance), 0, stiffness)


@dataclass(frozen=True)
class Pressure(cf.LineAction):
    """A force that stays normal to a rod."""

    rod: object
    pressure: float

    follows = True
    work = staticmethod(lambda point, test, f: ufl.dot(point.R * f, test.phi_r))

    def data(self, rod, s):
        return (
            action.vector(
                self.pressure * rod.curve.position(s) / np.linalg.norm(rod.curve.position(s), axis=1)[:, None], "N/m"
            ),
        )


@pytest.mark.serial
def test_data_that_follow_the_position():
    """A quarter of a ring, expanded by a pressure p against a round
    wall: p - EA u/R^2 = kp (u - clearance) for u << R."""
    R, c, EA, p, kp = 10.0, 1e-4, 90.0, 1e-4, 2.0
    section = cf.Stiffness((50.0, 50.0), EA, (1.0, 1.0), 0.7)
    rod = cf.Rod(cf.Arc((0, 0, 0), (R, 0, 0), np.pi / 2, axis=(0, 1.0, 0)), section)
    guides = [
        guide
        for station, tangent in ((rod.start, (0, 0, 1.0)), (rod.end, (1.0, 0, 0)))
        for guide in (
            cf.Roller(station, tangent),
            cf.Roller(station, (0, 1.0, 0)),
            cf.Prescribed(station, rotation=(0, 0, 0)),
        )
    ]
    scene = cf.Scene([rod], guides, [Pressure(rod, p), RoundWall(rod, R, c, kp)])
    for model in ("planar", "spatial"):
        path = cf.solve(scene, [1.0], elements=8, model=model)
        u = (p + kp * c) / (kp + EA / R**2)
        assert u > c
        for s in (0.0, 0.3, 0.5):
            place = path.position(rod.at(s * rod.length))[0]
            assert np.linalg.norm(place) - R == pytest.approx(u, rel=1e-4)


@dataclass(frozen=True)
class Lookup(cf.LineAction):
    """A bed about the x axis, whose force is evaluated from the position."""

    rod: object
    stiffness: float

    scaled = False
    work = staticmethod(lambda point, test, f: ufl.dot(f, test.phi_r))

    def data(self, rod, s):
        return self.refreshed(rod, s, rod.curve.position(s))

    def refreshed(self, rod, s, r):
        return (action.vector(-self.stiffness * np.asarray(r) * (0, 1.0, 1.0), "N/m"),)


FREE = cf.Rod(
    cf.Line((0, 0, 0), (1.0, 0, 0)),
    cf.Stiffness((1e5, 1e5), 1e5, (1e3, 1e3), 1e3, mass=1.0, inertia=(1e-3, 1e-3, 2e-3)),
)


def slid(duration, k=100.0, limit=1.0, steps=100000):
    """Displacement of a mass of 1 kg at a slider, under 3 sin(2 pi t) N."""
    x = v = slipped = 0.0
    dt = duration / steps
    for i in range(steps):
        force = max(min(k * (x - slipped), limit), -limit)
        slipped = x - force / k
        v += dt * (3 * np.sin(2 * np.pi * i * dt) - force)
        x += dt * v
    return x


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize("scheme", ["momentum", "energy", "generalised-alpha"])
def test_memory_and_refreshed_data_in_motion(scheme):
    scene = cf.Scene(
        [FREE], [], [Slider(FREE.at(0.5), 100.0, 1.0), cf.Force(FREE.at(0.5), cf.signals.Sine((3.0, 0, 0), 1.0))]
    )
    exact = slid(2.0)
    for options in ({"tol": 1e-3}, {"dt": 0.005}):
        history = cf.simulate(scene, 2.0, scheme=scheme, elements=1, degree=2, **options)
        assert history.displacement(FREE.at(0.5))[-1, 0] == pytest.approx(exact, abs=1e-3 * abs(exact) + 5e-4)
    pushed = [cf.InitialVelocity(FREE, linear=(0, 0, 1.0))]
    history = cf.simulate(
        cf.Scene([FREE], [], [Lookup(FREE, 4.0)], velocities=pushed), 0.7, dt=0.005, scheme=scheme, elements=2
    )
    assert history.displacement(FREE.end)[-1, 2] == pytest.approx(np.sin(1.4) / 2, rel=3e-5)


@dataclass(frozen=True)
class LateDamper(cf.PointAction):
    """A force against the velocity at the end of the step before, which is its memory."""

    station: object
    damping: float

    scaled = False
    memory = (action.vector((0.0, 0, 0), "m/s"),)

    def data(self, rod, s):
        return (action.scalar(self.damping, "N s/m"),)

    @staticmethod
    def work(point, test, damping, before):
        return -damping * ufl.dot(before, test.phi_r)

    @staticmethod
    def evolve(point, damping, before):
        return [point.r_t]


@pytest.mark.serial
@pytest.mark.parametrize("scheme", ["momentum", "energy", "generalised-alpha"])
def test_a_memory_of_velocities(scheme):
    """A mass of 1 kg with v' = -c v: it comes to (1 - exp(-c))/c after 1 s, up to the delay of one step."""
    c, dt = 2.0, 0.001
    pushed = [cf.InitialVelocity(FREE, linear=(1.0, 0, 0))]
    scene = cf.Scene([FREE], [], [LateDamper(FREE.at(0.5), c)], velocities=pushed)
    history = cf.simulate(scene, 1.0, scheme=scheme, dt=dt, elements=1, degree=2)
    assert history.displacement(FREE.at(0.5))[-1, 0] == pytest.approx((1 - np.exp(-c)) / c, abs=2 * c * dt)


@pytest.mark.serial
def test_motions_without_a_place_for_memory():
    scene = cf.Scene([FREE], [], [Slider(FREE.end, 100.0, 1.0)])
    with pytest.raises(cf.SceneError, match="steps back in time: expected actions without memory"):
        cf.simulate(scene, 0.1, dt=0.05, scheme="triple-jump", elements=1)
    clamped = cf.Scene([FREE], [cf.Clamp(FREE.start)], [Slider(FREE.end, 100.0, 1.0), cf.Force(FREE.end, (1.0, 0, 0))])
    with pytest.raises(cf.SceneError, match="simulate.start: actions with a memory"):
        cf.simulate(clamped, 0.1, dt=0.05, start=1.0, elements=1)


@pytest.mark.serial
@pytest.mark.parametrize(("rows", "peak"), [(70, 56), (100, 81), (400, 201), (400, 324)])
def test_no_peak_of_a_long_table_is_missed(rows, peak):
    """It lies between all Gauss points of the first meshes; the tip moves by F a^2 (3 - a)/6, averaged over it."""
    s, values, F = np.linspace(0, 1, rows), np.zeros((rows, 3)), 1e-4
    values[peak, 2] = F * (rows - 1)
    a, variance = s[peak], 1 / (6 * (rows - 1) ** 2)
    tip = F * (3 * (a**2 + variance) - (a**3 + 3 * a * variance)) / 6
    section = cf.Stiffness((1e9, 1e9), 1e9, (1.0, 1.0), 1.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (1.0, 0, 0)), section)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.LineForce(rod, cf.signals.AlongTable(s, values))])
    for accuracy, options in ((1e-7, {"tol": 1e-4}), (3e-2, {"elements": 3, "degree": 2}),
                              (1e-4, {"elements": 3, "model": "spatial"})):  # fmt: skip
        path = cf.solve(scene, [1.0], **options)
        assert path.displacement(rod.end)[0, 2] == pytest.approx(tip, rel=accuracy)
        assert path.force(rod.start)[0, 2] == pytest.approx(F, rel=1e-6)


@pytest.mark.serial
def test_a_function_may_change_between_calls():
    size = [1e-3]
    scene = cf.Scene([BEAM], [cf.Clamp(BEAM.start)], [cf.LineForce(BEAM, cf.signals.Along(lambda s: (0, 0, size[0])))])
    first = cf.solve(scene, [1.0], elements=4).displacement(BEAM.end)[0, 2]
    size[0] = 2e-3
    assert cf.solve(scene, [1.0], elements=4).displacement(BEAM.end)[0, 2] == pytest.approx(2 * first, rel=1e-6)


@pytest.mark.serial
def test_what_ufl_tells():
    station = BEAM.end
    told = {
        cf.Force(station, (0, 0, 1)): (True, True, False, True),
        cf.Moment(station, (0, 1, 0)): (True, True, False, True),
        cf.EccentricForce(station, (0, 0, 1), (0.1, 0)): (False, True, False, True),
        cf.FollowerForce(station, (0, 0, 1)): (False, False, False, True),
        cf.FollowerMoment(station, (0, 0, 1)): (False, True, False, True),
        cf.LineForce(BEAM, (0, 0, 1)): (True, True, False, True),
        cf.Weight(): (True, True, False, True),
        cf.Foundation(BEAM, 1.0): (False, False, False, True),
        cf.Spring(station, 1.0, 1.0): (False, False, False, True),
        cf.Dashpot(station, 1.0): (False, False, True, True),
        cf.Drag(BEAM, 1.0): (False, False, True, True),
        cf.Wall(BEAM, (0, 0, 0), (1, 0, 0), 0.1): (False, False, False, True),
        cf.PointMass(station, 1.0): (True, True, False, True),
    }
    for load in (cf.Plane((0, 0, 0), (0, 0, 1), 0.1, velocity=(1, 0, 0)), cf.Sphere((0, 0, 0), 0.1),
                 cf.Cylinder((0, 0, 0), (0, 1, 0), 0.1)):  # fmt: skip
        assert traits_of(load, [BEAM]) == found_traits(load, [BEAM])
    for load, expected in told.items():
        traits = traits_of(load, [BEAM])
        assert (traits.dead, traits.known_force, traits.rates, traits.flat) == expected, load

    @dataclass(frozen=True)
    class Own(cf.PointAction):
        station: object
        work = staticmethod(lambda point, test, F: ufl.dot(F, test.phi_r))

        def data(self, rod, s):
            return (action.vector((0, 0, 1.0), "N"),)

    scene = cf.Scene([BEAM], [cf.Clamp(BEAM.start)], [Own(station)])
    assert cf.solve(scene, [0.1], elements=2).model == "determinate"  # a user-defined dead force is recognised as dead

    @dataclass(frozen=True)
    class Sideways(cf.PointAction):
        station: object
        work = staticmethod(lambda point, test: point.u[0] * test.phi_r[1] + 0.1 * test.phi_r[0])

    scene = cf.Scene([BEAM], [cf.Clamp(BEAM.start)], [Sideways(station), cf.Force(station, (0, 0, 0.1))])
    path = cf.solve(scene, [0.1], elements=2)
    assert path.model == "spatial" and any("Sideways" in why for why in path.why)
    assert not traits_of(Sideways(station), [BEAM]).turns


@pytest.mark.serial
def test_a_load_from_a_file_beside_its_scene(tmp_path):
    scene = cf.Scene([BEAM], [cf.Clamp(BEAM.start)], [cf.LineForce(BEAM, (0, 0, 1.0), permanent=True)])
    cf.write(scene, tmp_path / "scene.toml")
    text = (tmp_path / "scene.toml").read_text()
    (tmp_path / "load.csv").write_text("0, 0, 0, 0\n1.0, 0, 0, 1e-3\n")
    (tmp_path / "scene.toml").write_text(
        text.replace("[0.0, 0.0, 1.0]\npermanent", '{ type = "AlongTable", s = "load.csv" }\npermanent')
    )
    assert cf.read(tmp_path / "scene.toml").scene.loads[0].force == cf.signals.AlongTable(tmp_path / "load.csv")


@pytest.mark.serial
def test_units_of_data_are_what_their_names_say():
    """Powers of force, length and time: kg is N s^2/m."""
    base = {
        "1": (0, 0, 0),
        "axis": (0, 0, 0),
        "rad": (0, 0, 0),
        "N": (1, 0, 0),
        "m": (0, 1, 0),
        "s": (0, 0, 1),
        "kg": (1, -1, 2),
    }
    for unit, (*powers, _) in action._UNITS.items():
        over, _, under = unit.removesuffix(" from origin").partition("/")
        expected = np.zeros(3)
        for sign, words in ((1, over.split()), (-1, under.split())):
            for word in words:
                name, _, power = word.partition("^")
                expected += sign * int(power or 1) * np.array(base[name])
        assert powers == expected.tolist(), unit
