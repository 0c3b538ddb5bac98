"""Whirl: orbits of sections in holes, steady rotation, demos, and rods whose mass centre is off their axis."""

import pickle

import numpy as np
import pytest
from eccentric_collar import AMPLITUDES, FIRST_CONTACT, Collar
from eccentric_collar import CLEARANCE as COLLAR_CLEARANCE
from moving_scenes import drift
from rolling_collar import ARM, AXIS, CLEARANCE, COLLAR, LENGTH, rolling
from scipy.optimize import brentq

import cosserat_fenicsx as cf
from cosserat_fenicsx.actions.centrifugal import Centrifugal
from cosserat_fenicsx.actions.fluids import AddedMass, LinearDrag
from cosserat_fenicsx.actions.walls import HoleWall
from cosserat_fenicsx.numerics import directors
from cosserat_fenicsx.parts import from_data, to_data
from cosserat_fenicsx.pictures.motion_charts import campbell_figure, spectra
from cosserat_fenicsx.results.whirl import Orbit, whirl_of

pytestmark = pytest.mark.serial
SPIN = 100 * np.pi / 30


def circles(times, *parts, spin=SPIN, normal=None):
    """The `Orbit` of a sum of circles (radius m, rate rad/s)."""
    z = sum(radius * np.exp(1j * rate * times) for radius, rate in parts)
    v = sum(1j * rate * radius * np.exp(1j * rate * times) for radius, rate in parts)
    full = np.ones(len(times))
    normal = np.zeros(len(times)) if normal is None else normal
    plane = [np.column_stack([x.real, x.imag]) for x in (z, v)]
    return Orbit(times, *plane, CLEARANCE * full, spin * full, ARM, normal)


@pytest.mark.parametrize("spin", [SPIN, -SPIN])
@pytest.mark.parametrize("rate", [SPIN, -40.3, 0.7])
def test_a_circle_saved_as_seldom_as_can_be(spin, rate):
    """Half a turn and more between two times: the velocities tell how many turns."""
    found = whirl_of(circles(np.linspace(0, 10, 41), (0.02, rate), spin=spin))
    assert found.rate == pytest.approx(rate * np.sign(spin), rel=1e-12) and found.resolved
    assert found.ratio == pytest.approx(rate / spin, rel=1e-12)
    assert found.direction == ("forward" if rate * spin > 0 else "backward")
    assert (found.radius, found.largest) == (pytest.approx(0.02), pytest.approx(0.02))
    assert found.rolling == pytest.approx(-ARM / 0.02)


def test_the_larger_of_two_circles_decides():
    """The mean rate of a sum of circles is that of the larger one, over whole beats."""
    beat = 2 * np.pi / (SPIN + 40.0)
    orbit = circles(np.linspace(0, 20 * beat, 4001), (0.012, -40.0), (0.009, SPIN))
    assert whirl_of(orbit).rate == pytest.approx(-40.0, rel=1e-9)


def test_where_it_passes_through_the_axis_no_angle_is_counted():
    """A spiral from the axis outwards: before it leaves the axis rounding has an angle of its own."""
    times = np.linspace(0, 4, 2001)
    orbit = circles(times, (0.02, -30.0))
    grows = np.clip(times - 1.0, 0.0, 1.0)
    noise = 1e-9 * np.random.default_rng(0).standard_normal((2, len(times), 2))
    position, velocity = orbit.position * grows[:, None] + noise[0], orbit.velocity * grows[:, None] + noise[1]
    found = whirl_of(Orbit(**{**vars(orbit), "position": position, "velocity": velocity}))
    assert found.rate == pytest.approx(-30.0, rel=1e-3) and found.resolved
    still = whirl_of(Orbit(**{**vars(orbit), "position": noise[0], "velocity": noise[1]}))
    assert still.direction == "none" and "no whirl" in str(still)


def test_what_is_saved_too_seldom_says_so():
    """Loops that velocities at two times do not tell."""
    found = whirl_of(circles(np.linspace(0, 10, 101), (0.012, -40.0), (0.009, 35.0)))
    assert not found.resolved and "saved too seldom" in str(found)


def test_contact_is_a_share_of_the_time():
    times = np.linspace(0, 1, 11)
    normal = np.r_[np.nan, 0, 0, 1e3, 3e3, 5e3, 0, 0, 0, 0, 0]
    found = whirl_of(circles(times, (0.02, -40.0), normal=normal))
    assert found.contact == pytest.approx(0.3) and found.force == (1e3, 3e3, 5e3)
    assert "in contact 30 % of the time, normal force 1 to 5 kN, mean 3 kN" in str(found)


@pytest.fixture(scope="module")
def collar():
    """(rod, wall, history) of the collar that rolls backward at 100 rpm."""
    rod, scene, start, _ = rolling(SPIN, 1e10, 0.3)
    return rod, scene.loads[0], cf.simulate(scene, 0.1, dt=1e-3, start=start, elements=8, degree=2)


def test_a_rolling_collar(collar):
    rod, wall, history = collar
    middle = rod.at(LENGTH / 2)
    orbit, found = history.orbit(middle, wall), history.whirl(middle, since=0.02)
    x, y, _ = history.position(middle).T
    np.testing.assert_allclose(orbit.position, np.column_stack([x, y]), atol=1e-12)
    np.testing.assert_allclose(orbit.clearance, CLEARANCE)
    assert found.ratio == pytest.approx(COLLAR["rolling_ratio"], rel=3e-3)
    assert found.contact == pytest.approx(1)
    assert found.force[1] == pytest.approx(COLLAR["rolling_force"], rel=0.02)
    sent = pickle.loads(pickle.dumps(found))
    assert sent == found and sent.orbit.place == orbit.place and str(sent) == str(found)
    seldom = history.at_points(range(0, 101, 20)).whirl(middle)
    assert seldom.rate == pytest.approx(history.whirl(middle).rate, rel=1e-9)
    assert "backward whirl at -40." in str(found) and "rolling without slip: -3.85" in str(found)


def test_seen_from_the_high_side():
    """In a hole that leads east and up, south is to the right."""
    path = cf.well.WellPath.from_survey([0, 20], [100, 100], [90, 90])
    rod = cf.Rod(cf.Line(path.position(5.0), path.position(6.0)), cf.Circle(0.17), cf.Material(206e9, density=7850.0))
    wall = HoleWall(rod, path, 0.108, 0.085, begins=5.0)
    up = np.array([0, np.cos(np.radians(100)), -np.sin(np.radians(100))])
    velocity = cf.InitialVelocity(rod, linear=0.01 * up + [-0.02, 0, 0] + 0.3 * path.tangent(5.0))
    scene = cf.Scene([rod], loads=[wall], velocities=[velocity])
    orbit = cf.simulate(scene, 0.1, dt=0.01, elements=1, degree=2).orbit(rod.start)
    assert not orbit.vertical
    np.testing.assert_allclose(orbit.position[-1], [0.001, 0.002], rtol=1e-9)
    np.testing.assert_allclose(orbit.velocity, 11 * [[0.01, 0.02]], rtol=1e-9)


def test_charts_have_their_units(collar, tmp_path):
    pytest.importorskip("matplotlib")
    rod, wall, history = collar
    middle = rod.at(LENGTH / 2)
    axes = history.plot_orbit(middle, wall).axes
    assert [axes[0].get_xlabel(), axes[0].get_ylabel()] == ["towards east (mm)", "towards north (mm)"]
    assert axes[1].get_ylabel() == "time (s)"
    np.testing.assert_allclose(np.hypot(*axes[0].lines[0].get_data()), 1e3 * CLEARANCE)
    radius, rates, force = history.plot_whirl(middle).axes
    assert "(mm)" in radius.get_ylabel() and "(rpm)" in rates.get_ylabel() and "(kN)" in force.get_ylabel()
    assert force.get_xlabel() == "time (s)"
    assert rates.lines[0].get_ydata() == pytest.approx(-385.2, rel=0.01)
    history.plot_orbit(middle, wall, tmp_path / "orbit.png")
    assert (tmp_path / "orbit.png").stat().st_size > 10_000


def test_a_campbell_diagram_has_what_whirls(collar):
    pytest.importorskip("matplotlib")
    rod, _, history = collar
    times = np.linspace(0, 24, 6001)
    spin = 2.0 + 0.5 * times
    angle = 2.0 * times + 0.25 * times**2
    z = 0.01 * np.exp(1j * angle) + 0.004 * np.exp(-30j * times)
    orbit = circles(times, (0.01, 1.0))
    orbit = Orbit(**{**vars(orbit), "position": np.column_stack([z.real, z.imag]), "spin": spin})
    _, amplitude, speed, rates = spectra(orbit)
    forward, backward = rates > -20, rates < -20
    resolution = 2 * np.pi / 1.92
    np.testing.assert_allclose(rates[forward][np.argmax(amplitude[:, forward], axis=1)], speed, atol=resolution / 2)
    np.testing.assert_allclose(rates[backward][np.argmax(amplitude[:, backward], axis=1)], -30, atol=resolution / 4)
    np.testing.assert_allclose(amplitude[:, backward].max(axis=1), 0.004, rtol=0.05)
    above, below, bar = campbell_figure(orbit).axes
    assert below.get_xlabel() == "speed of rotation (rpm)" and "(rpm)" in below.get_ylabel()
    assert "(mm)" in above.get_ylabel() and "(dB of" in bar.get_ylabel()


def test_what_is_refused_in_words(collar):
    rod, wall, history = collar
    middle = rod.at(LENGTH / 2)
    other, heavy, turning = HoleWall(rod, AXIS, 0.108, ARM), Collar().rod, Centrifugal((0, 0, 3.0))
    bare = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Stiffness((1, 1), 1, (1, 1), 1, mass=1.0), name="bare")

    def about(*loads):
        return cf.Scene([heavy], [cf.Clamp(heavy.start)], loads)

    for asked, words in (
        (lambda: history.wall_forces(None), r"wall_forces.wall = None: expected a wall of the scene"),
        (lambda: history.orbit(middle, other), r"orbit.wall = .*expected a wall of the scene"),
        (lambda: history.orbit(rod.end, wall), r"orbit.station = .*expected a station that the wall is around"),
        (lambda: history.whirl(rod.end), "whirl.wall: expected one of the scene's walls .* 0 are around"),
        (lambda: history.whirl(middle, since=0.1), r"whirl.since = 0.1: expected a time \(s\), at most 0.099"),
        (lambda: history.whirl(middle, since="late"), "whirl.since = 'late': expected a number"),
        (lambda: history[0].whirl(middle), "whirl: expected a motion with at least two times"),
        (lambda: history[0].plot_orbit(middle), "expected a history with at least two times"),
        (lambda: history.plot_campbell(middle), "expected a motion with at least 200 times"),
        (lambda: campbell_figure(circles(np.linspace(0, 1, 500), (0.01, 1.0))), "expected a run-up"),
        (lambda: cf.simulate(about(turning), 1.0, dt=0.1),
         r"loads\[0\] \(Centrifugal\) stands for the inertia of a motion"),
        (lambda: cf.solve(about(Centrifugal((1.0, 0, 3.0)), AddedMass(heavy, 1.0)), [1.0]),
         r"expected one along rod 'collar', or AddedMass\(axial=True\)"),
        (lambda: cf.Scene([bare], loads=[turning]),
         "Rod 'bare': Stiffness.inertia = None: expected a value, which Centrifugal"),
        (lambda: Centrifugal((0, 0, 0)), "Centrifugal.rate = .*expected an angular velocity that is not zero"),
    ):  # fmt: skip
        with pytest.raises(cf.SceneError, match=words):
            asked()


def test_a_film_enlarges_the_clearance(collar, tmp_path):
    pytest.importorskip("pyvista")
    from cosserat_fenicsx.pictures.animation import Between, Enlarged
    from cosserat_fenicsx.pictures.drawing import EVERY

    rod, _, history = collar
    x = np.array([0.0, 0.5, 1.0])
    bodies = Between(history, EVERY["bending_moment"]).bodies(0.05, x)
    (moved,) = Enlarged(history.scene, 40.0, "animate").bodies(bodies, x)
    assert np.hypot(*moved.line[1, :2]) == pytest.approx(40 * np.hypot(*bodies[0].line[1, :2]), rel=1e-12)
    np.testing.assert_allclose(moved.line[:, 2], bodies[0].line[:, 2], atol=1e-12)
    history.animate(tmp_path / "a.gif", enlarge=40, fps=2, speed=0.05, size=(320, 240))
    assert (tmp_path / "a.gif").stat().st_size > 1000
    with pytest.raises(cf.SceneError, match="animate.enlarge = 0: expected a positive number"):
        history.animate(tmp_path / "b.gif", enlarge=0)
    free = cf.Scene([rod], velocities=[cf.InitialVelocity(rod, linear=(1, 0, 0))])
    with pytest.raises(cf.SceneError, match="enlarge = 2.0: expected 1, since no rod is in a hole"):
        Enlarged(free, 2.0, "animate")


@pytest.mark.parametrize("compression", AMPLITUDES)
def test_amplitudes_of_the_steady_whirl(compression):
    """Below the critical speed the heavy side is outside, above it inside."""
    collar = Collar(compression)
    for rpm, expected in AMPLITUDES[compression].items():
        path = collar.whirl(rpm)
        assert collar.deflection(path) == pytest.approx(expected, rel=1e-3)
        assert path.stable[-1] == (expected > 0)  # in the rotating frame, without gyroscopic moments
    if not compression:  # a hundredth of the eccentricity, where deflections do not stiffen the collar: the linear beam
        collar = Collar(share=0.01)
        for rpm, expected in AMPLITUDES[0.0].items():
            assert collar.deflection(collar.whirl(rpm, elements=16)) == pytest.approx(0.01 * expected, rel=1.5e-5)


def test_the_speed_of_first_contact():
    collar = Collar()
    found = brentq(lambda rpm: collar.deflection(collar.whirl(rpm)) - COLLAR_CLEARANCE, 105.0, 112.0, xtol=1e-2)
    assert found == pytest.approx(FIRST_CONTACT, rel=1e-3)


@pytest.mark.parametrize(
    "rpm, scheme, dt",
    [(93.88469896083186, "momentum", 2e-3), (174.35729807011631, "momentum", 2e-3), (268.2419970309482, "energy", 2e-3),
     (120.70889866392667, "generalised-alpha", 2e-3)],
)  # fmt: skip
def test_a_motion_keeps_the_steady_whirl(rpm, scheme, dt):
    """For half a second from the whirl on, with the speed of rotation, the momentum about its axis, and the energy."""
    collar = Collar()
    history = collar.motion(rpm, 0.5, dt, scheme)
    np.testing.assert_allclose(collar.deflections(history), abs(AMPLITUDES[0.0][rpm]), rtol=1e-3)
    x, y, _ = history.position(collar.middle).T
    rate = np.polyfit(history.times, np.unwrap(np.arctan2(y, x)), 1)[0]
    assert rate == pytest.approx(rpm * np.pi / 30, rel=5e-4)
    exact = 1e-4 if scheme == "generalised-alpha" else 1e-9
    assert drift(history.angular_momentum[:, 2:]) < exact
    assert np.abs(history.balance).max() < 10 * exact * history.energy[0]


@pytest.mark.parametrize("scheme", ["momentum", "energy", "generalised-alpha"])
def test_drag_acts_on_the_axis(scheme):
    """From the whirl on it takes the torque c w (integral of the squared deflection), and w times that of energy."""
    collar, rpm, c = Collar(), 93.88469896083186, 283.1
    rate = rpm * np.pi / 30
    s, weights = np.polynomial.legendre.leggauss(8)
    path = collar.whirl(rpm)
    squares = [path.displacement(collar.rod.at(6 * (1 + x)))[-1, 0] ** 2 for x in s]
    history = collar.motion(rpm, 0.004, 2e-4, scheme, more=[LinearDrag(collar.rod, c)])
    torque, slower = c * rate * 6 * weights @ squares, 0.004 * c / collar.mass
    taken = -np.diff(history.angular_momentum[[0, -1], 2])[0] / 0.004
    assert taken == pytest.approx(torque * (1 - slower / 2), rel=3e-4)
    assert -history.work[-1] / 0.004 == pytest.approx(torque * rate * (1 - slower), rel=3e-4)


def test_a_rod_about_one_end():
    """Spun about its clamped end: the tension is rho A w^2 (L^2 - s^2)/2, with a mass m at the end m w^2 L more; planar
    and spatial models agree."""
    section = cf.Stiffness((1e7, 1e7), 1e7, (1e3, 1e3), 1e3, mass=2.0, inertia=(1e-3, 1e-3, 2e-3))
    rod, w, L = cf.Rod(cf.Line((1, 1, 0), (3, 1, 0)), section), 5.0, 2.0
    loads = [Centrifugal((0, 0, w), through=(1, 1, 0)), cf.PointMass(rod.end, 0.5)]
    for model in ("auto", "spatial"):
        path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], loads), [1.0], model=model)
        for s in (0.0, 0.7, 1.5):
            expected = w**2 * (2.0 * (L**2 - s**2) / 2 + 0.5 * L)
            assert path.force(rod.at(s))[-1, 0] == pytest.approx(expected, rel=1e-4)
        assert path.model == ("planar" if model == "auto" else "spatial")


@pytest.mark.parametrize("rate, model", [((0.38, 0.08, 0.88), "spatial"), ((0, 0.7, 0), "planar")])
def test_a_rotation_about_any_axis(rate, model):
    """The clamp bears the inertia m w x (w x (c - a)) of a stiff straight rod, in the plane of the rotation if it has
    one, and in space if the axis is oblique."""
    section = cf.Stiffness((1e7, 1e7), 1e7, (1e7, 1e7), 1e7, mass=2.0, inertia=(1e-3, 1e-3, 2e-3))
    rod, through = cf.Rod(cf.Line((0, 0, 0), (0.5, 0, 1)), section, name="blade"), np.array([0.3, 1.3 * rate[0], -0.2])
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [Centrifugal(rate, through=through)]), [1.0], elements=2)
    inertia = 2.0 * rod.length * np.cross(rate, np.cross(rate, np.array([0.25, 0, 0.5]) - through))
    assert path.force(rod.start)[-1] == pytest.approx(-inertia, rel=1e-6, abs=1e-6)
    assert path.model == model
    assert (model == "planar") == ("Centrifugal on blade points out of" not in " ".join(path.why))


def test_the_least_friction_of_rolling():
    """At 100 rpm that of the reference; at 30 rpm no wall is needed, which would have to pull."""
    from whirling_collar import least_friction

    assert least_friction(100 * np.pi / 30) == pytest.approx(COLLAR["rolling_friction"], rel=1e-6)
    assert least_friction(30 * np.pi / 30) == np.inf


@pytest.mark.slow
def test_a_collar_turns_from_forward_to_backward_whirl(capsys):
    import whirl
    from known_numbers import deviation

    for check in whirl.main(out=None, duration=6.1, run_up=3.0):
        assert deviation(check) <= check.allowed, check
    assert "backward whirl at -5" in capsys.readouterr().out


@pytest.mark.slow
def test_a_coarse_map_agrees_with_the_theory(capsys):
    import whirl_map
    from known_numbers import deviation

    assert all(deviation(check) == 0 for check in whirl_map.main(quick=True))
    told = capsys.readouterr().out
    assert "2 simulations of 1.5 s on 1 rank(s)" in told and "rolling backward in 1" in told


SOFT = cf.Stiffness((1e5, 1e5), 1e5, (1e3, 1e3), 1e3, mass=2.0, inertia=(0.1, 0.15, 0.2))
STIFF = cf.Stiffness((1e8, 1e8), 1e8, (1e7, 1e7), 1e7, mass=2.0, inertia=(0.1, 0.15, 0.2))
LINE, OFFSET = cf.Line((0, 0, 0), (1, 2, 2)), (0.1, -0.05)
OFF_AXIS = LINE.frame(0.0) @ [*OFFSET, 0]
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
    line = cf.Line(OFF_AXIS, OFF_AXIS + [1, 2, 2])
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
    mass_centre = one.position(rod.end) + directors(one.rotation(rod.end)) @ OFF_AXIS
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
    velocity = np.array([1, 0.5, 0.2]) + np.cross(spin, OFF_AXIS + to_end / 2)  # of the mass centre
    np.testing.assert_allclose(history.linear_momentum[0], 3 * 2 * velocity, rtol=1e-12)


@pytest.mark.parametrize("scheme", ["momentum", "energy", "generalised-alpha"])
def test_a_spin_about_the_mass_centre_is_of_second_order(scheme):
    """The axis circles about the line of the mass centres, with the rate 3 rad/s."""
    rod = cf.Rod(LINE, STIFF, eccentricity=OFFSET)
    axis, spin = np.array([1, 2, 2]) / 3, 3.0
    scene = cf.Scene([rod], velocities=[cf.InitialVelocity(rod, angular=spin * axis, about=OFF_AXIS)])
    across = np.cross(axis, OFF_AXIS)
    exact = OFF_AXIS - np.cos(spin * 2) * OFF_AXIS - np.sin(spin * 2) * across
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


@pytest.mark.parametrize("given, words", [
    (0.1, r"Rod 'x'.eccentricity = 0.1: expected \(a1, a2\)"),
    ((0.1, 0.2, 0.0), "2 finite numbers"),
    ((0.1, np.nan), "2 finite numbers"),
    ([(1.0, (0.1, 0)), (0.5, (0, 0)), (None, (0, 0))], r"eccentricity\[1\].to = 0.5: expected an arc length above 1"),
    ([(1.0, (0.1, 0)), (None, 0.2)], r"eccentricity\[1\] = 0.2"),
    (lambda s: s, r"eccentricity\(0\)"),
    (lambda s: 1 / 0, "raised ZeroDivisionError"),
    ([], r"eccentricity = \[\]"),
])  # fmt: skip
def test_eccentricity_what_is_refused(given, words):
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
