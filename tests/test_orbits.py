"""Orbits and whirl of sections in their hole: closed forms, a rolling collar, charts, refusals."""

import pickle

import numpy as np
import pytest
from rolling_collar import ARM, AXIS, CLEARANCE, COLLAR, LENGTH, rolling

import cosserat_fenicsx as cf
from cosserat_fenicsx.actions.walls import HoleWall
from cosserat_fenicsx.pictures.motion_charts import draw_campbell, spectra
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
    above, below, bar = draw_campbell(orbit).axes
    assert below.get_xlabel() == "speed of rotation (rpm)" and "(rpm)" in below.get_ylabel()
    assert "(mm)" in above.get_ylabel() and "(dB of" in bar.get_ylabel()


def test_what_is_refused_in_words(collar):
    rod, wall, history = collar
    middle = rod.at(LENGTH / 2)
    other = HoleWall(rod, AXIS, 0.108, ARM)
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
        (lambda: draw_campbell(circles(np.linspace(0, 1, 500), (0.01, 1.0))), "expected a run-up"),
    ):
        with pytest.raises(cf.SceneError, match=words):
            asked()


def test_a_film_enlarges_the_clearance(collar, tmp_path):
    pytest.importorskip("pyvista")
    from cosserat_fenicsx.pictures.animation import Between, Enlarged

    rod, _, history = collar
    x = np.array([0.0, 0.5, 1.0])
    bodies = Between(history).bodies(0.05, x)
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
