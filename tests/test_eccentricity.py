"""Mass centres off the axis of rods: free motions, weight, natural modes, input, and what is refused."""

import numpy as np
import pytest
from moving_scenes import drift

import cosserat_fenicsx as cf
from cosserat_fenicsx.numerics import directors
from cosserat_fenicsx.parts import from_data, to_data

pytestmark = pytest.mark.serial

SOFT = cf.Stiffness((1e5, 1e5), 1e5, (1e3, 1e3), 1e3, mass=2.0, inertia=(0.1, 0.15, 0.2))
STIFF = cf.Stiffness((1e8, 1e8), 1e8, (1e7, 1e7), 1e7, mass=2.0, inertia=(0.1, 0.15, 0.2))
LINE, OFFSET = cf.Line((0, 0, 0), (1, 2, 2)), (0.1, -0.05)
ARM = LINE.frame(0.0) @ [*OFFSET, 0]
#: scheme: (drifts of linear and of angular momentum, of the energy) over 2 s of a flexible rod with steps of 0.01 s
KEPT = {
    "momentum": (1e-10, 1e-10, 1e-6),
    "triple-jump": (1e-10, 1e-10, 1e-6),
    "energy": (1e-10, 1e-3, 1e-10),
    "generalised-alpha": (1e-4, 1e-3, 1e-3),
}


def flying(section, line=LINE, eccentricity=OFFSET):
    """A free rod that tumbles about the origin, which moves."""
    rod = cf.Rod(line, section, eccentricity=eccentricity)
    return rod, cf.Scene([rod], velocities=[cf.InitialVelocity(rod, (1, 0.5, 0.2), (1, 2, -1.5), about=(0, 0, 0))])


@pytest.mark.parametrize("scheme", KEPT)
def test_a_stiff_rod_moves_as_one_along_its_mass_centres(scheme):
    """Its axis is free to be anywhere: a rod along the line of the mass centres, without eccentricity, moves alike."""
    line = cf.Line(ARM, ARM + [1, 2, 2])
    (rod, scene), (centred, other) = flying(STIFF), flying(STIFF, line, None)
    one, two = (
        cf.simulate(x, 1, dt=0.005, elements=1, degree=2, scheme=scheme, model="spatial", save_every=0.5)
        for x in (scene, other)
    )
    apart = 1e-5 if scheme == "generalised-alpha" else 2e-7
    for name in ("linear_momentum", "angular_momentum", "kinetic"):
        a, b = getattr(one, name), getattr(two, name)
        np.testing.assert_allclose(a[0], b[0], rtol=1e-12)
        np.testing.assert_allclose(a, b, rtol=0, atol=apart * np.abs(a).max())
    mass_centre = one.position(rod.end) + directors(one.rotation(rod.end)) @ ARM
    np.testing.assert_allclose(mass_centre, two.position(centred.end), atol=apart)
    np.testing.assert_allclose(one.rotation(rod.end), two.rotation(centred.end), atol=apart)


@pytest.mark.parametrize("scheme", KEPT)
def test_what_each_scheme_keeps(scheme):
    _, scene = flying(SOFT)
    history = cf.simulate(scene, 2, dt=0.01, elements=4, degree=2, scheme=scheme, save_every=0.1)
    p, L, E = KEPT[scheme]
    assert drift(history.linear_momentum) < p and drift(history.angular_momentum) < L
    assert np.ptp(history.energy) < E * history.energy[0]
    spin, to_end = np.array([1, 2, -1.5]), np.array([1, 2, 2])
    velocity = np.array([1, 0.5, 0.2]) + np.cross(spin, ARM + to_end / 2)  # of the mass centre
    np.testing.assert_allclose(history.linear_momentum[0], 3 * 2 * velocity, rtol=1e-12)


@pytest.mark.parametrize("scheme", ["momentum", "energy", "generalised-alpha"])
def test_a_spin_about_the_mass_centre_is_of_second_order(scheme):
    """The axis circles about the line of the mass centres, with the rate 3 rad/s."""
    rod = cf.Rod(LINE, STIFF, eccentricity=OFFSET)
    axis, spin = np.array([1, 2, 2]) / 3, 3.0
    scene = cf.Scene([rod], velocities=[cf.InitialVelocity(rod, angular=spin * axis, about=ARM)])
    across = np.cross(axis, ARM)
    exact = ARM - np.cos(spin * 2) * ARM - np.sin(spin * 2) * across
    off = []
    for dt in (0.02, 0.01):
        history = cf.simulate(scene, 2, dt=dt, elements=1, degree=2, scheme=scheme, save_every=2)
        off.append(np.linalg.norm(history.position(rod.start)[-1] - exact))
    assert off[1] < 1e-3 and off[0] / off[1] == pytest.approx(4, rel=0.1)


def test_drag_slows_the_mass_centre_alone():
    """The drag of `Damping`, 0.5 1/s, takes a share of all momenta: p = p(0) exp(-0.5 t), L likewise."""
    rod = cf.Rod(LINE, STIFF, damping=cf.Damping(drag=0.5), eccentricity=OFFSET)
    scene = cf.Scene([rod], velocities=[cf.InitialVelocity(rod, (1, 0.5, 0.2), (1, 2, -1.5), about=(0, 0, 0))])
    for scheme in ("momentum", "energy", "generalised-alpha"):
        history = cf.simulate(scene, 1, dt=0.01, elements=1, degree=2, scheme=scheme, save_every=1)
        p, L = history.linear_momentum, history.angular_momentum
        np.testing.assert_allclose(p[1], p[0] * np.exp(-0.5), rtol=1e-4)
        np.testing.assert_allclose(L[1], L[0] * np.exp(-0.5), rtol=1e-3, atol=1e-3)
        assert abs(history.balance[-1]) < 1e-3 * history.energy[0]


def test_a_prescribed_rotation_does_work():
    """The root turns with up to 1 turn per second, whose rate jumps: the energy is the work of the support, to h^2."""
    rod, gaps = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), SOFT, eccentricity=OFFSET), []

    def turn(t):
        return (0, 0, 2 * np.pi * max(t - 0.5, 0.0))

    for dt in (0.01, 0.005):
        driven = cf.Prescribed(rod.start, displacement=(0, 0, 0), rotation=turn, jumps=(0.5,))
        history = cf.simulate(cf.Scene([rod], [driven]), 2, dt=dt, elements=4, degree=2)
        gaps.append(np.abs(history.balance).max() / history.energy[-1])
    assert gaps[1] < 1e-3 and gaps[0] / gaps[1] == pytest.approx(4, rel=0.1)


def test_weight_acts_at_the_mass_centre():
    """Sideways it twists: the torque at the clamp is rho A g a L, in pieces that of each; upwards it does not."""
    section = cf.Stiffness((1e8, 1e8), 1e8, (1e7, 1e7), 1e6, mass=3.0)
    line, torque = cf.Line((0, 0, 0), (2, 0, 0)), 3 * 9.81
    for given, expected, model in (
        ((0.2, 0.0), 0.4, "spatial"),
        ([(0.5, (0.2, 0.0)), (None, (-0.1, 0.0))], 0.1 - 0.15, "spatial"),
        (lambda s: (0.1 * s, 0.0), 0.2, "spatial"),
        ((0.0, 0.2), 0.0, "planar"),
    ):
        rod = cf.Rod(line, section, eccentricity=given)  # d_1 is along y
        path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Weight()]), [1.0])
        assert path.model == model
        np.testing.assert_allclose(path.moment(rod.start)[0, 0], -torque * expected, atol=1e-5)
        np.testing.assert_allclose(path.moment(rod.start)[0, 1], torque * 2, rtol=1e-6)
    why = cf.solve(cf.Scene([cf.Rod(line, section, eccentricity=(0.1, 0), name="x")],
                            [cf.Clamp("x.start")], [cf.Weight()]), [1.0]).why  # fmt: skip
    assert "the mass centre of rod 'x' lies off the plane (Rod.eccentricity)" in " ".join(why)


def test_a_pendulum_of_an_eccentric_rod():
    """On a hinge along its axis it hangs by its mass centre: omega^2 = m g a/(J + m a^2) for small angles."""
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), STIFF, eccentricity=(0.0, -0.1))
    scene = cf.Scene([rod], [cf.Hinge(rod.start, (1, 0, 0))], [cf.Weight()],
                     velocities=[cf.InitialVelocity(rod, angular=(0.01, 0, 0))])  # fmt: skip
    omega = np.sqrt(2.0 * 9.81 * 0.1 / (0.2 + 2.0 * 0.1**2))
    found = cf.modes(scene, 1, load_factor=1.0, elements=2, degree=2)
    assert 2 * np.pi * found.frequencies[0] == pytest.approx(omega, rel=1e-4)
    bent = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Weight()]), [1.0], elements=2, degree=2)
    half = np.pi / omega
    for scheme in ("momentum", "energy", "generalised-alpha"):
        history = cf.simulate(scene, half, dt=half / 200, elements=2, degree=2, scheme=scheme, start=bent)
        assert history.angular_velocity(rod.end)[-1, 0] == pytest.approx(-0.01, rel=1e-3)
        assert np.abs(history.balance).max() < 1e-3 * history.kinetic[0]


def test_modes_of_bending_and_torsion_are_coupled():
    """Between ends that hold the twist, w and phi are sines: (EI k^4, GJ k^2) against (m, m a; m a, J + m a^2)."""
    m, a, EI, GJ, L, J = 2.0, 0.15, 1e3, 4e2, 3.0, 0.03
    section = cf.Stiffness((1e9, 1e9), 1e9, (EI, 1e4 * EI), GJ, mass=m, inertia=(1e-7, 1e-7, J))
    rod = cf.Rod(cf.Line((0, 0, 0), (L, 0, 0)), section, eccentricity=(a, 0))
    d1 = rod.curve.frame(0.0)[:, 0]
    scene = cf.Scene([rod], [cf.Hinge(rod.start, d1), cf.Hinge(rod.end, d1)])
    exact = [
        np.linalg.eigvals(np.linalg.solve([[m, m * a], [m * a, J + m * a**2]], np.diag([EI * k**4, GJ * k**2]))).real
        for k in np.pi / L * np.arange(1, 5)
    ]
    found = cf.modes(scene, 4, elements=8)
    np.testing.assert_allclose((2 * np.pi * found.frequencies) ** 2, np.sort(np.ravel(exact))[:4], rtol=2e-5)


def test_models():
    """A motion in a plane takes the spatial model, and says why; an offset of zero changes nothing."""
    flat = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), SOFT, eccentricity=(0.0, 0.1))
    scene = cf.Scene([flat], [cf.Clamp(flat.start)], [cf.Weight()])
    history = cf.simulate(scene, 0.02, dt=0.01, elements=2, degree=2)
    assert history.model == "spatial" and "the planar model has no mass centre off the axis" in history.why[0]
    with pytest.raises(cf.SceneError, match=r"model = 'planar': the planar model has no mass centre off the axis"):
        cf.simulate(scene, 0.02, dt=0.01, model="planar")
    none = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), SOFT, eccentricity=(0.0, 0.0))
    assert none.eccentricity is None and none.mass_centre is None
    assert cf.simulate(cf.Scene([none], [cf.Clamp(none.start)], [cf.Weight()]), 0.02, dt=0.01).model == "planar"


@pytest.mark.parametrize(
    "given, words",
    [
        (0.1, r"Rod 'x'.eccentricity = 0.1: expected \(a1, a2\)"),
        ((0.1, 0.2, 0.0), "2 finite numbers"),
        ((0.1, np.nan), "2 finite numbers"),
        (
            [(1.0, (0.1, 0)), (0.5, (0, 0)), (None, (0, 0))],
            r"eccentricity\[1\].to = 0.5: expected an arc length above 1",
        ),
        ([(1.0, (0.1, 0)), (None, 0.2)], r"eccentricity\[1\] = 0.2"),
        (lambda s: s, r"eccentricity\(0\)"),
        (lambda s: 1 / 0, "raised ZeroDivisionError"),
        ([], r"eccentricity = \[\]"),
    ],
)
def test_what_is_refused(given, words):
    with pytest.raises(cf.SceneError, match=words):
        cf.Rod(LINE, SOFT, eccentricity=given, name="x")


def test_files_and_stored_motions(tmp_path):
    file = tmp_path / "shaft.toml"
    text = """
        [[rods]]
        name = "shaft"
        curve = { type = "Line", start = [0, 0, 0], end = [0, 0, 2] }
        section = { type = "Circle", diameter = 0.1 }
        material = { E = 210e9, nu = 0.3, density = 7850.0 }
        eccentricity = ECCENTRICITY
        [simulate]
        duration = 0.004
        dt = 0.001
        elements = 2
        degree = 2
    """
    file.write_text(text.replace("ECCENTRICITY", "[{ to = 0.5, offset = [0.01, 0.0] }, { offset = [0.0, 0.02] }]"))
    found = cf.read(file)
    scene, asked = found.scene, found.motion
    assert scene.rods[0].eccentricity == ((0.5, (0.01, 0.0)), (2.0, (0.0, 0.02)))
    again = from_data(cf.Scene, to_data(scene))
    assert scene.rods[0].breaks == (0.5,) and again.rods[0].eccentricity == scene.rods[0].eccentricity
    file.write_text(text.replace("ECCENTRICITY", "[{ offset = [0.01, 0.0] }, { offset = [0.0, 0.02] }]"))
    with pytest.raises(cf.SceneError, match=r"rods\[0\].eccentricity\[0\]: 'to' is missing"):
        cf.read(file)
    file.write_text(text.replace("ECCENTRICITY", "[0.01, 0.0]"))
    other = cf.read(file).scene
    cf.simulate(scene, **asked, folder=tmp_path / "motion")
    with pytest.raises(cf.SceneError, match=r"eccentricity is .* where the motion has"):
        cf.resume(tmp_path / "motion", other)
