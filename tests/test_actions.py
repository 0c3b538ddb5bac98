"""Actions that depend on the state: closed forms for each kind, and the traits that the protocol finds."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

import cosserat_fenicsx as cf

EI, RHO = 1.0, 1.0
SECTION = cf.Stiffness(shear=(1e6, 1e6), axial=1e6, bending=(EI, EI), torsion=0.8, mass=RHO, inertia=(1e-8, 1e-8, 2e-8))
ROD = cf.Rod(cf.Line((0, 0, 0), (1.0, 0, 0)), SECTION, name="beam")


def test_a_beam_on_an_elastic_bed():
    """Hetenyi, Beams on Elastic Foundation (1946): the deflection of a long beam under a force P at its middle is
    P lambda/(2 k) there, lambda = (k/4EI)^(1/4), and its moment P/(4 lambda)."""
    k, P, L = 4.0 * 1e4, 1e-3, 4.0
    lam = (k / (4 * EI)) ** 0.25
    rod = cf.Rod(cf.Line((-L / 2, 0, 0), (L / 2, 0, 0)), SECTION)
    beds = {"alike": cf.Foundation(rod, k), "upwards": cf.Foundation(rod, k, direction=(0, 0, 1))}
    for name, bed in beds.items():  # the far end, twenty decay lengths away, may be clamped
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], [bed, cf.Force(rod.at(L / 2), (0, 0, P))])
        for model in ("planar", "spatial"):
            path = cf.solve(scene, [1.0], elements=32, model=model)
            w, m = path.displacement(rod.at(L / 2))[0, 2], path.moment(rod.at(L / 2))[0, 1]
            assert w == pytest.approx(P * lam / (2 * k), rel=2e-4), name  # shear: EI lambda^2/GA
            assert abs(m) == pytest.approx(P / (4 * lam), rel=2e-4)
            assert abs(path.moment(rod.at(L / 2 + math.pi / (4 * lam)))[0, 1]) < 1e-3 * abs(m)  # changes its sign there
            # foundation and clamp together carry the load: the contact force jumps by P at the middle
            jump = path.force(rod.at(L / 2 + 1e-9))[0, 2] - path.force(rod.at(L / 2))[0, 2]
            assert jump == pytest.approx(-P, rel=1e-6)
    assert cf.solve(scene, [1.0], elements=4).model == "planar"


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


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0])
def test_a_mass_at_the_end_of_a_cantilever(ratio):
    scene = cf.Scene([ROD], [cf.Clamp(ROD.start)], [cf.PointMass(ROD.end, ratio * RHO)])
    omega = 2 * math.pi * cf.modes(scene, 2, elements=4).frequencies
    assert omega[0] == pytest.approx(rayleigh(ratio) ** 2, rel=1e-5)  # shear and rotary inertia: 3 EI/GA
    # the whole weight is on the clamp
    heavy = cf.Scene([ROD], scene.supports, [*scene.loads, cf.Weight((0, 0, -1e-2))])
    path = cf.solve(heavy, [1.0], elements=4)
    np.testing.assert_allclose(path.force(ROD.start)[0], (0, 0, -1e-2 * (1 + ratio) * RHO), atol=1e-9)


def test_a_body_that_turns():
    """A stiff shaft with a disc: the torsional mode of a cantilever whose end has the moment J, omega^2 = GJ/(L J)."""
    J = 0.05
    scene = cf.Scene([ROD], [cf.Clamp(ROD.start)], [cf.PointMass(ROD.end, 1e-9, (1e-9, 1e-9, J))])
    omega = 2 * math.pi * cf.modes(scene, 4, elements=4).frequencies
    assert np.abs(omega / math.sqrt(0.8 / J) - 1).min() < 1e-6


def test_a_rod_outside_its_wall_is_refused():
    for point, along, words in (
        ((0, 0, 0), (0, 0, 1), "at s = 1 m by 0.95 m"), ((0, 0, 0.2), (1, 0, 0), "at s = 0 m by 0.15 m"),
    ):  # fmt: skip
        with pytest.raises(cf.SceneError, match=f"lies outside it at rest, {words}: expected a point"):
            cf.Wall(ROD, point, along, 0.05)


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


@pytest.mark.parametrize("scheme", ["momentum", "generalised-alpha"])
@pytest.mark.parametrize("model", ["planar", "spatial"])
def test_a_dashpot_stops_a_free_rod(scheme, model):
    """A rod that moves along its axis against a dashpot b, v = v_0
    exp(-b t/m); and one that spins in its plane against d."""
    b = 3.0
    velocity = cf.InitialVelocity(ROD, linear=(1.0, 0, 0))
    scene = cf.Scene([ROD], loads=[cf.Dashpot(ROD.at(0.5), b)], velocities=[velocity])
    options = {"dt": 2e-3, "elements": 2, "degree": 2, "save_every": 0.25, "scheme": scheme, "model": model}
    history = cf.simulate(scene, 0.5, **options)
    total = history.linear_momentum[:, 0]
    np.testing.assert_allclose(total, np.exp(-b * history.times), rtol=2e-2)  # axial waves travel in it
    spin = cf.InitialVelocity(ROD, angular=(0, 0, 1.0), about=(0.5, 0, 0))
    scene = cf.Scene([ROD], loads=[cf.Dashpot(ROD.at(0.5), rotational=0.4)], velocities=[spin])
    history = cf.simulate(scene, 0.05, **{**options, "save_every": 0.05})
    assert history.angular_momentum[-1, 2] < 0.95 * history.angular_momentum[0, 2]


TANGENCY = json.loads((Path(__file__).parent / "reference" / "b_bha_tangency.json").read_text(encoding="utf-8"))


def wall_forces(path):
    """Forces on the nodes of all elements of the only rod, along -y, N, and their arc lengths, m."""
    (rod,) = path.scene.rods
    sizes = np.diff(path.layout.breaks[0]) * rod.length
    density = -path._records[0].densities[1][:, :, 1] * path.scales.force / path.scales.length
    places = path.layout.inside(path.rule.nodes)[0] * rod.length
    return (density * path.rule.lobatto * sizes[:, None]).ravel(), places.ravel()


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
