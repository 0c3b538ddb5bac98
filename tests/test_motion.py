"""Motions from the literature (tests/moving_scenes.py), conservation, order in time, supports, starts."""

import numpy as np
import pytest
from moving_scenes import SPAGHETTI, drift, flying_in_a_plane, flying_in_space, right_angle, spaghetti

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
SECTION = cf.Stiffness((1e5, 1e5), 1e5, (1e3, 1e3), 1e3, mass=2.0, inertia=(0.1, 0.1, 0.2))


def test_momenta_and_energy_of_free_flight():
    _, scene = flying_in_space()
    history = cf.simulate(scene, 10, dt=0.05, elements=8, degree=2)
    free = history.times > 5 - 1e-9
    assert drift(history.linear_momentum[free]) < 1e-11
    assert drift(history.angular_momentum[free]) < 1e-11
    assert np.ptp(history.energy[free]) < 2e-4 * history.energy[-1]
    assert history.steps[-1] == 200 and history.times[100] == 5.0
    # T/10 over a triangle of 5 s: an impulse of 50 N s
    np.testing.assert_allclose(history.linear_momentum[-1], [50, 0, 0], atol=1e-10)


def test_impulses_of_scenes_that_share_a_compiled_problem():
    """Loads that vary, stay, begin late and end: nothing is kept of a step, or of a scene, that another one changes."""
    loads = {
        (50.0, 0, 0): cf.signals.Triangle((20, 0, 0), 0, 2.5, 5),
        (0, 18.0, 0): (0, 3, 0),
        (0, 0, 8.0): cf.signals.Step((0, 0, 4), 1, 3),
        (12.0, 0, -6.0): lambda t: (2.0, 0, -1),
        (0, 0, 0): (0, 0, 0),
        (25.0, 0, 0): cf.signals.Triangle((10, 0, 0), 0, 2.5, 5),
    }
    for impulse, force in loads.items():
        _, scene = spaghetti(lambda rod, force=force: cf.Force(rod.start, force))
        history = cf.simulate(scene, 6, dt=0.1, elements=4, degree=2, model="spatial", save_every=6)
        np.testing.assert_allclose(history.linear_momentum[-1], impulse, atol=1e-10)


def test_flight_in_space_ends_where_it_should():
    """Within 1e-2 m of 32 P2 elements with dt 0.0025."""
    rod, scene = flying_in_space()
    history = cf.simulate(scene, 10, dt=0.0125, save_every=5)
    assert history.times.tolist() == [0, 5, 10]
    np.testing.assert_allclose(history.position(rod.start)[-1], [40.6910, 0.1578, -3.0316], atol=2e-3)
    np.testing.assert_allclose(history.position(rod.end)[-1], [40.4784, 8.5541, 1.6810], atol=2e-3)
    assert history.energy[1] == pytest.approx(773.823, rel=1e-5)


def test_flight_in_a_plane_ends_where_it_should():
    """The loads jump and excite fast waves: agreement to 0.03 is expected; the plane is never left."""
    rod, scene = flying_in_a_plane()
    history = cf.simulate(scene, 15, dt=0.02, save_every=15)
    np.testing.assert_allclose(history.position(rod.start)[-1], [25.61, 2.97, 0], atol=0.03)
    np.testing.assert_allclose(history.position(rod.end)[-1], [35.365, 5.147, 0], atol=0.03)


def test_right_angle_cantilever():
    arm, scene = right_angle()
    history = cf.simulate(scene, 10, dt=0.025)
    np.testing.assert_allclose(history.position(arm.end)[-1], [10.0048, 8.0299, 4.4631], atol=2e-3)
    loaded = np.flatnonzero(history.times == 2.0)[0]
    assert history.energy[loaded] == pytest.approx(114.87, rel=1e-4)
    assert np.abs(history.balance).max() < 1e-4 * history.energy[-1]


def test_adaptive_steps_keep_their_promise():
    rod, scene = flying_in_space()
    history = cf.simulate(scene, 10, tol=1e-3)
    for station, expected in ((rod.start, [40.6910, 0.1578, -3.0316]), (rod.end, [40.4784, 8.5541, 1.6810])):
        assert np.linalg.norm(history.position(station)[-1] - expected) < 1e-3 * rod.length
    assert {2.5, 5.0} <= set(history.times) and np.diff(history.times).max() > 5 * np.diff(history.times).min()
    assert np.diff(history.times).min() > 0 and len(history) == history.steps[-1] + 1
    assert history.steps[-1] < 800  # 600 equal steps are as accurate


def test_where_a_load_bends_steps_stay_and_where_it_jumps_they_begin_anew():
    _, scene = spaghetti(
        lambda rod: cf.Force(rod.start, cf.signals.Table((0, 1, 1.5, 2), [(0, 0, 0), (9, 0, 0), (9, 5, 0), (0, 5, 0)]))
    )
    steps = np.diff(cf.simulate(scene, 2, tol=1e-3, elements=4, degree=2).times)
    after = np.cumsum(steps)[:-1].searchsorted([1 - 1e-9, 1.5 - 1e-9])
    assert (steps[after + 1] > 0.2 * steps[after]).all()
    _, scene = spaghetti(lambda rod: cf.Force(rod.start, cf.signals.Step((9, 0, 0), 0, 1)))
    steps = np.diff(cf.simulate(scene, 2, tol=1e-3, elements=4, degree=2).times)
    after = np.cumsum(steps).searchsorted(1 - 1e-9)
    assert steps[after + 1] < 0.3 * steps[after]


def test_a_step_that_fails_is_halved():
    """The stiff thin rod: some steps of 0.04 s fail and are halved; momenta are conserved."""
    section = cf.Stiffness((1e6, 1e6), 1e6, (100, 100), 100, mass=1.0, inertia=(1e-4, 1e-4, 2e-4))
    rod = cf.Rod(cf.Line((6, 0, 0), (0, 8, 0)), section)
    pulls = [
        cf.Force(rod.start, cf.signals.Step((8, 0, 3), end=1)),
        cf.Force(rod.end, cf.signals.Step((0, 6, -5), end=1)),
    ]
    history = cf.simulate(cf.Scene([rod], loads=pulls), 60, dt=0.04, elements=4, degree=2, save_every=1)
    assert history.steps[-1] > 1500
    free = history.times >= 1
    assert drift(history.linear_momentum[free]) < 1e-9 and drift(history.angular_momentum[free]) < 1e-8
    assert np.ptp(history.energy[free]) < 1e-3 * history.energy[-1]


def test_a_rigid_spin_stays_rigid_and_keeps_its_time():
    """About the tangent: no strains, and after a turn everything is
    where it was, up to the phase error of the scheme."""
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 2, 2)), SECTION)
    axis = np.array([1, 2, 2]) / 3
    spin = cf.InitialVelocity(rod, linear=(0.5, 0, 0), angular=2 * np.pi * axis)
    history = cf.simulate(cf.Scene([rod], velocities=[spin]), 1, dt=0.002, elements=1, degree=2)
    q = history.rotation(rod.end)[-1]
    assert abs(q[0]) == pytest.approx(1, abs=1e-6)
    assert history.strain.max() < 1e-15
    np.testing.assert_allclose(history.displacement(rod.end)[-1], [0.5, 0, 0], atol=1e-12)
    np.testing.assert_allclose(history.angular_velocity(rod.end)[-1], 2 * np.pi * axis, rtol=1e-4)
    np.testing.assert_allclose(history.angular_velocity(rod.end, material=True)[-1], [0, 0, 2 * np.pi], atol=1e-3)
    assert history.kinetic[0] == pytest.approx(0.5 * 3 * (2.0 * 0.25 + 0.2 * (2 * np.pi) ** 2))


def test_joints_keep_momenta():
    """A free chain with a ball joint, and one with a hinge that moves with it."""
    a = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), SECTION, name="a")
    b = cf.Rod(cf.Line((2, 0, 0), (2, 1, 1)), SECTION, name="b")
    for release, turn in (("all", (1, 2, 3)), ((0, 1, 0), (0, 2, 0))):
        moving = [cf.InitialVelocity(a, (1, 2, 0)), cf.InitialVelocity(b, (1, 2, 0), turn)]
        scene = cf.Scene([a, b], joints=[cf.Joint(a.end, b.start, release)], velocities=moving)
        history = cf.simulate(scene, 2, dt=0.01, elements=4, degree=2)
        assert drift(history.linear_momentum) < 1e-11 and drift(history.angular_momentum) < 1e-10
        assert np.ptp(history.energy) < 1e-5 * history.energy[0]
        assert np.abs(history.position(a.end) - history.position(b.start)).max() < 1e-12


def test_a_pendulum_books_what_its_weight_does():
    """A stiff rod on a hinge, released from the horizontal, phi'' = -3 g/(2 L) sin(phi); the energy balance holds."""
    rod = cf.Rod(
        cf.Line((0, 0, 0), (2, 0, 0)),
        cf.Stiffness((1e8, 1e8), 1e8, (1e7, 1e7), 1e7, mass=2.0, inertia=(1e-3, 1e-3, 2e-3)),
    )
    scene = cf.Scene([rod], [cf.Hinge(rod.start, (0, 1, 0))], [cf.Weight((0, 0, -9.81))])
    lowest = 1.8540746773013719 * np.sqrt(2 / (1.5 * 9.81))  # a quarter period, K(1/sqrt(2)) sqrt(2 L/(3 g)), s
    history = cf.simulate(scene, lowest, dt=lowest / 100, elements=1, degree=2)
    np.testing.assert_allclose(history.position(rod.end)[-1], [0, 0, -2], atol=2e-3)
    assert history.kinetic[-1] == pytest.approx(2 * 2.0 * 9.81 * 1, rel=1e-3)
    assert history.work[-1] == pytest.approx(2 * 2.0 * 9.81 * 1, rel=1e-3)
    assert np.abs(history.balance).max() < 1e-6 * history.work[-1]


def test_a_prescribed_motion_does_work():
    """The root is rotated with up to 2 turns per second: the rod follows, and its energy is the work of the support."""
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), SECTION)

    def turn(t):
        return (0, 0, np.pi * t**2 if t < 2 else 4 * np.pi * (t - 1))

    scene = cf.Scene([rod], [cf.Prescribed(rod.start, displacement=(0, 0, 0), rotation=turn, jumps=(2,))])
    gaps = []
    for dt in (0.02, 0.01):
        history = cf.simulate(scene, 4, dt=dt, elements=4, degree=2)
        gaps.append(np.abs(history.balance).max() / history.energy[-1])
    np.testing.assert_allclose(history.angular_velocity(rod.start)[-1], [0, 0, 4 * np.pi], rtol=2e-3)
    assert gaps[1] < 1e-3 and gaps[0] / gaps[1] == pytest.approx(4, rel=0.1)


def test_from_a_static_point_nothing_moves_until_it_is_let_go():
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), SECTION)
    loads = [cf.Force(rod.end, (0, 100, -300)), cf.FollowerForce(rod.end, (50, 0, 0))]
    loaded = cf.Scene([rod], [cf.Clamp(rod.start)], loads)
    path = cf.solve(loaded, [0.5, 1.0], elements=4, degree=2, model="spatial")
    history = cf.simulate(loaded, 0.5, dt=0.01, start=path, elements=4, degree=2)
    np.testing.assert_allclose(history.position(rod.end), np.tile(path.position(rod.end)[1], (51, 1)), atol=1e-12)
    still = cf.simulate(loaded, 0.1, dt=0.01, start=(path, 0), load_factor=0.5, elements=4, degree=2)
    np.testing.assert_allclose(still.position(rod.end)[-1], path.position(rod.end)[0], atol=1e-12)
    free = cf.simulate(cf.Scene([rod], [cf.Clamp(rod.start)]), 0.5, dt=0.01, start=path, elements=4, degree=2)
    assert free.strain[0] == pytest.approx(history.strain[0], rel=1e-12) and free.kinetic.max() > 0.5 * free.strain[0]
    assert np.abs(free.balance).max() < 1e-2 * free.strain[0]


def test_velocities_along_a_rod():
    rod, _ = spaghetti()
    given = cf.InitialVelocity(rod, lambda s: (0, s, 0), lambda s: (0, 0, 1))
    history = cf.simulate(cf.Scene([rod], velocities=[given]), 0.01, dt=0.01)
    np.testing.assert_allclose(history.velocity(rod.at(2.5))[0], [0, 2.5, 0], atol=1e-12)
    np.testing.assert_allclose(history.angular_velocity(rod.at(2.5))[0], [0, 0, 1], atol=1e-12)
    about = cf.InitialVelocity(rod, angular=(0, 0, 2), about=(1, 1, 0))
    history = cf.simulate(cf.Scene([rod], velocities=[about]), 0.01, dt=0.01)
    np.testing.assert_allclose(history.velocity(rod.end)[0], [-14, -2, 0], atol=1e-12)
    assert history.kinetic[0] > 0 and SPAGHETTI.mass == 1


@pytest.mark.slow
def test_files_and_pictures(tmp_path):
    import meshio

    rod, scene = flying_in_space()
    history = cf.simulate(scene, 5, dt=0.1, save_every=1, elements=4)
    history.write(tmp_path / "flight.xdmf")
    with meshio.xdmf.TimeSeriesReader(tmp_path / "flight.xdmf") as reader:
        reader.read_points_cells()
        times, data = zip(*((t, data) for t, data, _ in map(reader.read_data, range(reader.num_steps))), strict=True)
    np.testing.assert_allclose(times, [0, 1, 2, 3, 4, 5])
    np.testing.assert_allclose(data[-1]["velocity"][0], history.velocity(rod.start)[-1], rtol=1e-12)
    np.testing.assert_allclose(data[-1]["angular_velocity"][-1], history.angular_velocity(rod.end)[-1], rtol=1e-12)
    history.plot(tmp_path / "flight.png")
    history.plot_energy(tmp_path / "energy.png")
    assert (tmp_path / "flight.png").stat().st_size > 10000 and (tmp_path / "energy.png").stat().st_size > 10000
    with pytest.raises(cf.SceneError, match="expected a name that ends in"):
        history.plot_energy(tmp_path / "energy.xyz")
