"""Motions from the literature, in a plane, with loads that start late; their input and what is refused."""

import math

import numpy as np
import pytest
from conftest import refused, refuses
from moving_scenes import SPAGHETTI, drift, flying_in_a_plane, flying_in_space, right_angle, spaghetti
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk

import cosserat_fenicsx as cf
from cosserat_fenicsx.dynamics.pace import Adaptive, Resolution

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
        (50.0, 0, 0): cf.signals.Triangle((20, 0, 0), 0, 2.5, 5), (0, 18.0, 0): (0, 3, 0),
        (0, 0, 8.0): cf.signals.Step((0, 0, 4), 1, 3), (12.0, 0, -6.0): lambda t: (2.0, 0, -1), (0, 0, 0): (0, 0, 0),
        (25.0, 0, 0): cf.signals.Triangle((10, 0, 0), 0, 2.5, 5),
    }  # fmt: skip
    for impulse, force in loads.items():
        _, scene = spaghetti(lambda rod, force=force: cf.Force(rod.start, force))
        history = cf.simulate(scene, 6, dt=0.1, elements=4, degree=2, model="spatial", save_every=6)
        np.testing.assert_allclose(history.linear_momentum[-1], impulse, atol=1e-10)


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


def test_the_error_of_a_motion_is_estimated_on_request(tmp_path):
    """Of the pendulum above, by elliptic functions, with fixed and with adaptive steps: three times the error, as for
    steps of second order; it is saved, and what is apart is NaN where another motion ends."""
    stiff = cf.Stiffness((1e8, 1e8), 1e8, (1e7, 1e7), 1e7, mass=2.0, inertia=(1e-3, 1e-3, 2e-3))
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), stiff)
    omega = np.sqrt(2 * 2 * 9.81 / (2 * 2**3 / 3 + 1e-3 * 2))  # m L g L/2 over m L^3/3 and the sections' own inertia
    scene = cf.Scene([rod], [cf.Hinge(rod.start, (0, 1, 0))], [cf.Weight((0, 0, -9.81))])
    for asked in ({"dt": 0.02}, {"dt": 0.02, "save_every": 0.02}, {"tol": 1e-3, "save_every": 0.1}):
        history = cf.simulate(scene, 1.0, elements=2, degree=2, estimate=True, **asked)
        angle = 2 * np.arcsin(np.sqrt(0.5) * ellipj(ellipk(0.5) - omega * history.times, 0.5)[0])
        exact = 2 * np.stack([np.sin(angle), 0 * angle, -np.cos(angle)], axis=1)
        error = np.linalg.norm(history.position(rod.end) - exact, axis=1)
        assert 2.5 < history.error.max() / error.max() < 3.5
        assert "Positions have an estimated error of at most" in str(history)
    history.save(tmp_path / "swing.h5")
    np.testing.assert_array_equal(cf.read_result(tmp_path / "swing.h5").error, history.error)
    assert history.to_dict()["error"] is history.error and len(history[3:5].error) == 2
    short = cf.simulate(scene, 0.5, elements=1, degree=3, dt=0.02)
    assert "error of positions was not estimated" in str(short) and "error" not in short.quantities
    apart = history.apart(short)
    assert np.isnan(apart[6:]).all() and 0 < apart[1:6].max() < 2e-2 and short.apart(short).max() < 1e-14
    for wrong in ({"elements": 1}, {"folder": tmp_path / "kept"}, {"estimate": 1}):
        with pytest.raises(cf.SceneError, match=r"simulate.estimate = "):
            cf.simulate(scene, 0.5, **{"estimate": True, **wrong})
    with pytest.raises(cf.SceneError, match="rods of the same names"):
        history.apart(cf.simulate(spaghetti()[1], 0.01, dt=0.01))


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


BLADE = cf.Stiffness((2e4, 3e4), 1e5, (50, 900), 1e3, mass=2.0, inertia=(0.01, 0.2, 0.21))


def both(scene, **settings):
    return [cf.simulate(scene, 1.0, dt=0.01, degree=2, model=model, **settings) for model in ("planar", "spatial")]


def blade(d1):
    return cf.Rod(cf.Line((0, 0, 0), (2, 0, 1), d1=d1), BLADE, name="blade", damping=cf.Damping(time=1e-4, drag=0.1))


@pytest.mark.parametrize("d1", [(0, 1, 0), (1, 0, -2)])
def test_the_plane_is_as_space(d1):
    """About either axis of the section; with damping, a hinge, follower loads and loads that depend on time."""
    rod = blade(d1)
    tip = cf.EccentricForce(rod.end, cf.signals.Ramp((3, 0, -9)), (0.0, 0.1) if d1[1] else (0.1, 0.0))
    loads = [cf.Weight(), tip, cf.FollowerForce(rod.at(1.0), (3.0, 0, 2.0) if not d1[1] else (0, 3.0, 2.0))]
    spin = cf.InitialVelocity(rod, angular=(0, 1.5, 0))
    scene = cf.Scene([rod], [cf.Hinge(rod.start, (0, 1, 0))], loads, velocities=[spin])
    planar, spatial = both(scene, elements=16)
    assert planar.model == "planar" and planar.unknowns < 0.5 * spatial.unknowns
    for query in ("position", "velocity", "rotation", "angular_velocity", "force", "moment"):
        a, b = (getattr(h, query)(rod.at(1.5)) for h in (planar, spatial))
        assert np.abs(a - b).max() < 1e-3 * np.abs(b).max(), query
    for name in ("kinetic", "strain", "work", "dissipated", "linear_momentum", "angular_momentum"):
        a, b = (getattr(h, name) for h in (planar, spatial))
        assert np.abs(a - b).max() < 1e-3 * np.abs(b).max(), name


def test_a_plane_flight():
    _, scene = flying_in_a_plane()
    history = cf.simulate(scene, 5, dt=0.025)
    free = history.times >= 2.5
    assert history.model == "planar" and history.why[0] == "the whole scene moves in the x-y plane"
    assert drift(history.linear_momentum[free]) < 1e-11 and drift(history.angular_momentum[free]) < 1e-11
    assert np.ptp(history.energy[free]) < 2e-3 * history.energy[-1]
    fast = cf.simulate(scene, 2.5, dt=0.025, scheme="triple-jump")
    assert fast.model == "planar"


def test_a_driven_root_and_a_static_start():
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), BLADE)
    drive = cf.Prescribed(rod.start, displacement=(0, 0, 0), rotation=lambda t: (0, 0, t**2), jumps=())
    planar, spatial = both(cf.Scene([rod], [drive]), elements=8)
    np.testing.assert_allclose(planar.position(rod.end)[-1], spatial.position(rod.end)[-1], atol=1e-3)
    assert planar.work[-1] == pytest.approx(spatial.work[-1], rel=1e-3)
    loaded = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 5, 0))])
    path = cf.solve(loaded, [1.0], elements=4, degree=2, model="planar")
    still = cf.simulate(loaded, 0.2, dt=0.01, start=path, elements=4, degree=2)
    assert still.model == "planar" and np.ptp(still.position(rod.end), axis=0).max() < 1e-11


def test_the_choice_of_the_model():
    _, scene = flying_in_space()
    rod, flat = flying_in_a_plane()
    assert cf.simulate(scene, 0.1, dt=0.1).model == "spatial"
    assert cf.simulate(flat, 0.1, dt=0.1, scheme="energy").model == "spatial"
    out = cf.Scene([rod], velocities=[cf.InitialVelocity(rod, (0, 0, 1), (0, 0, 1))], loads=flat.loads)
    assert cf.simulate(out, 0.1, dt=0.1).why[0] == "the start leaves the plane of the rods"
    # too short for the sampling before the motion
    kick = cf.Force(rod.end, lambda t: (1, 0, 1.0 if 0.4499 < t < 0.4501 else 0))
    for given, more, words in (
        (scene, {"model": "planar"},
         "model = 'planar': loads[1] (Moment at spaghetti.start) does not turn in the plane"),
        (flat, {"scheme": "energy", "model": "planar"}, "the scheme 'energy' has no planar model"),
        (flat, {"model": "plane"}, "model = 'plane': did you mean 'planar'"),
        (cf.Scene([rod], loads=[*flat.loads, kick]), {"dt": 0.3},
         "Force at spaghetti.end leaves the plane at t = 0.45 s: expected model = 'spatial'"),
    ):  # fmt: skip
        with refused(words):
            cf.simulate(given, 0.6 if "dt" in more else 0.1, **{"dt": 0.1, **more})


SLACK = cf.Rod(
    cf.Line((0, 0, 0), (1, 0, 0)), cf.Stiffness((1e3, 1e3), 1e3, (10, 10), 10, mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
)


@pytest.mark.parametrize(
    "signal",
    [cf.signals.Ramp((0, 0, 2.0), 50, 50.5), lambda t: (0, 0, 1 + np.tanh(4 * (t - 50)))],
    ids=["ramp", "tanh"],
)
def test_what_sets_in_after_a_rest_is_seen(signal):
    section = cf.Stiffness((1e6, 1e6), 1e6, (100, 100), 100, mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
    rod = cf.Rod(cf.Line((0, 0, 0), (5, 0, 0)), section)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, signal)])
    found, fine = cf.simulate(scene, 55.0, tol=1e-3), cf.simulate(scene, 55.0, dt=0.02)
    there = np.array([np.interp(found.times, fine.times, x) for x in fine.position(rod.end).T]).T
    assert np.linalg.norm(found.position(rod.end) - there, axis=1).max() < 1e-3 * rod.length
    assert np.diff(found.times).max() > 0.5  # long steps where nothing happens


@pytest.mark.parametrize("scheme", ["momentum", "energy"])
@pytest.mark.parametrize("start", [0.0, 0.2])
def test_kinks_of_a_prescribed_motion(scheme, start):
    """The driven end has the prescribed speed; a sudden change of its momentum counts as work of the support."""
    section = cf.Stiffness((1e4, 1e4), 1e4, (50, 50), 50, mass=1.0, inertia=(1e-2, 1e-2, 2e-2))
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), section)
    drive = cf.signals.Ramp((0, 0, 0.5), start, 1.0)
    scene = cf.Scene([rod], [cf.Prescribed(rod.start, displacement=drive, rotation=(0, 0, 0))])
    history = cf.simulate(scene, 1.5, dt=0.01, scheme=scheme, elements=4, degree=2)
    t = history.times
    moving = (t > start + 1e-9) & (t < 1 + 1e-9) | (
        (t == 0) & (start == 0)
    )  # at a kink the velocity is the one before it
    expected = np.where(moving, 0.5 / (1 - start), 0.0)
    np.testing.assert_allclose(history.velocity(rod.start)[:, 2], expected, atol=1e-8)
    assert np.abs(history.balance).max() < (1e-10 if scheme == "energy" else 1e-3) * history.energy.max()
    assert ("starts with a speed" in " ".join(history.why)) == (start == 0)


@pytest.mark.parametrize("scheme", ["momentum", "generalised-alpha"])
@pytest.mark.parametrize("function", [False, True], ids=["Sine", "callable"])
def test_what_swings_fast_and_moves_little_is_not_taken_for_a_constant(scheme, function):
    """A free rod under A w^2 cos(wt) per unit of mass moves by A (1 -
    cos(wt)), too little for the error estimate to notice."""
    A, f, duration, tol = 1e-4, 1.0, 50.0, 1e-3
    w = 2 * np.pi * f
    load = cf.signals.Sine((0, A * w**2, 0), f, phase=np.pi / 2)
    load = cf.LineForce(SLACK, (lambda t: (0, A * w**2 * np.cos(w * t), 0)) if function else load)
    history = cf.simulate(
        cf.Scene([SLACK], [], [load]), duration, tol=tol, scheme=scheme, elements=1, degree=2, save_every=duration / 9.7
    )
    exact = A * (1 - np.cos(w * history.times))
    assert np.abs(history.displacement(SLACK.end)[:, 1] - exact).max() < tol * SLACK.length
    assert history.steps[-1] < 40 * f * duration


def test_a_load_that_moves_nothing_costs_no_steps():
    scene = cf.Scene([SLACK], [], [cf.Force(SLACK.end, cf.signals.Sine((0, 1e-9, 0), 20.0))])
    assert cf.simulate(scene, 20.0, elements=1, degree=2).steps[-1] < 250


@pytest.mark.parametrize("signal", [cf.signals.Sine((0, 1.0, 0), 2.0), lambda t: (0, np.sin(4 * np.pi * t), 0), None])
def test_a_fixed_step_that_does_not_follow_a_load_is_told(signal):
    """Straight signals (None) are followed."""
    straight = [cf.Force(SLACK.end, cf.signals.Triangle((0, 0.01, 0), 0.13, 0.2, 0.31)),
                cf.Moment(SLACK.end, cf.signals.Step((0, 0, 0.01), 0.4))]  # fmt: skip
    scene = cf.Scene([SLACK], [cf.Clamp(SLACK.start)], [cf.Force(SLACK.end, signal)] if signal else straight)
    for steps in (1, 6, 14):
        why = " ".join(cf.simulate(scene, 1.0, dt=0.5 / steps, elements=1, degree=2).why)
        assert ("Force.force changes faster" in why) == (signal is not None and steps < 14)
        assert signal or "faster than steps" not in why


@pytest.mark.parametrize("damping", [None, cf.Damping(time=2e-3, drag=0.5)], ids=["undamped", "damped"])
def test_steps_of_generalised_alpha_recover_where_a_motion_is_prescribed(damping):
    """A velocity error of a longer step at the driven end must not cause large accelerations in a shorter one."""
    section = cf.Stiffness((5e3, 5e3), 1e4, (50, 50), 40, mass=1.0, inertia=(0.01, 0.01, 0.02))
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 1, 0)), section, damping=damping)
    drive = cf.Prescribed(rod.start, displacement=lambda t: (0.05 * np.sin(4.4 * t) ** 3, 0, 0), rotation=(0, 0, 0))
    scene = cf.Scene([rod], [drive])
    asked = {"scheme": "generalised-alpha", "elements": 4, "degree": 2, "save_every": 0.1}
    found, fine = cf.simulate(scene, 2.0, tol=1e-3, **asked), cf.simulate(scene, 2.0, dt=5e-3, **asked)
    assert found.steps[-1] < 700
    assert np.linalg.norm(found.position(rod.end) - fine.position(rod.end), axis=1).max() < 1e-3


def test_steps_that_stay_tiny_end_in_words(monkeypatch):
    """A load with random values at all times, which no step resolves."""
    noise = cf.LineForce(SLACK, lambda t: (0, np.sin(1e9 * t), 0))
    monkeypatch.setattr(Adaptive, "_MANY", 300)
    with pytest.raises(cf.NotConverged, match="steps stay as short as .*jumps") as caught:
        cf.simulate(cf.Scene([SLACK], [], [noise]), 10.0, elements=1, degree=2, save_every=1.0)
    assert len(caught.value.path) > 1


def test_what_steps_have_seen_of_loads_is_remembered():
    """A motion continued from a checkpoint takes the same steps."""
    load = cf.Force(SLACK.end, lambda t: (0, np.exp(-((t - 3.3) ** 2) * 100), 0), jumps=(6.0,))
    first, second = (Resolution(cf.Scene([SLACK], [], [load]), 10.0, 1e-3, 1.0, 1 / 24) for _ in range(2))
    for t in (0.5, 3.2, 3.25):
        first.longest(t, 0.1)
    second.recall(first.memory())
    steps = [first.longest(t, 0.1) for t in (3.3, 3.5, 7.0)]
    assert steps == [second.longest(t, 0.1) for t in (3.3, 3.5, 7.0)]
    assert steps[0] < 0.1


ROD = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), SECTION, name="rod")
FREE = cf.Scene([ROD])
LATE_NAN = cf.Scene([ROD], loads=[cf.Force(ROD.end, lambda t: (0, 0, 1 if t < 0.05 else math.nan))])


def sections(**more):
    return cf.Stiffness(
        **{**dict(shear=(1, 1), axial=1, bending=(1, 1), torsion=1, mass=1.0, inertia=(1, 1, 1)), **more}
    )


def moving(*velocities, supports=(), joints=(), rods=(ROD,)):
    return cf.simulate(cf.Scene(rods, supports, joints=joints, velocities=velocities), 0.1, dt=0.1)


OTHER = cf.Rod(cf.Line((2, 0, 0), (3, 0, 0)), SECTION, name="other")
REFUSED = {
    "negative mass": (lambda: sections(mass=-1.0), "Stiffness.mass = -1.0: expected a positive number (kg/m)"),
    "negative inertia": (lambda: sections(inertia=(1, -1, 1)), "Stiffness.inertia = -1"),
    "two inertias": (lambda: sections(inertia=(1, 1)), "Stiffness.inertia = (1, 1): expected three numbers"),
    "no scene": (lambda: cf.simulate(ROD, 1.0), "simulate.scene = "),
    "duration": (lambda: cf.simulate(FREE, 0.0), "simulate.duration = 0.0: expected a positive number (s)"),
    "NaN duration": (lambda: cf.simulate(FREE, math.nan), "simulate.duration = nan"),
    "dt": (lambda: cf.simulate(FREE, 1.0, dt=-0.1), "simulate.dt = -0.1: expected a positive number (s)"),
    "tol": (lambda: cf.simulate(FREE, 1.0, tol=2), "simulate.tol = 2"),
    "dt and tol": (lambda: cf.simulate(FREE, 1.0, dt=0.1, tol=1e-3), "expected one of them"),
    "save_every": (lambda: cf.simulate(FREE, 1.0, save_every=0), "simulate.save_every = 0"),
    "scheme": (lambda: cf.simulate(FREE, 1.0, scheme="momentun"), "scheme = 'momentun': did you mean 'momentum'?"),
    "elements": (lambda: cf.simulate(FREE, 1.0, elements=0), "simulate.elements = 0"),
    "start": (lambda: cf.simulate(FREE, 1.0, start="a"), "simulate.start = 'a': expected a load factor, a Path"),
    "start at 0": (lambda: cf.simulate(FREE, 1.0, start=0),
                   "simulate.start = 0: expected a load factor that is finite and not 0"),
    "start of nothing": (lambda: cf.simulate(FREE, 1.0, start=3), "Scene.loads is empty"),
    "run-up": (lambda: cf.signals.RunUp((1, 0, 0), 2.0, 1.0), "RunUp.end = 1.0: expected a time after 2 s"),
    "no mass": (lambda: moving(rods=[cf.Rod(ROD.curve, sections(mass=None), name="a")]), "'a': Stiffness.mass = None"),
    "no inertia": (lambda: moving(rods=[cf.Rod(ROD.curve, sections(inertia=None), name="a")]),
                   "Stiffness.inertia = None"),
    "no density": (lambda: moving(rods=[cf.Rod(ROD.curve, cf.Circle(0.1), cf.Material(1e9), name="a")]),
                   "Material.density"),
    "late NaN": (lambda: cf.simulate(LATE_NAN, 1.0, dt=0.02, model="spatial"), "numbers (N), at the time t = 0.05 s"),
    "two numbers": (lambda: cf.Moment(ROD.end, lambda t: (1, 2)),
                    "Moment.moment = (1, 2): expected 3 finite numbers (N m), at the time t = 0 s"),
    "jumps of a vector": (lambda: cf.Force(ROD.end, (1, 2, 3), jumps=(1,)), "Force.jumps = (1,): expected none"),
    "jumps": (lambda: cf.Force(ROD.end, cf.signals.Step((1, 2, 3)), jumps=("a",)), "Force.jumps = 'a'"),
    "ramp": (lambda: cf.signals.Ramp((1, 0, 0), 2.0, 1.0), "Ramp.end = 1.0: expected a time after 2 s"),
    "triangle": (lambda: cf.signals.Triangle((1, 0, 0), 0, 3, 2), "Triangle.end = 2"),
    "sine": (lambda: cf.signals.Sine((1, 0, 0), math.nan), "Sine.frequency = nan"),
    "table": (lambda: cf.signals.Table((0, 0), ((0, 0, 0), (1, 1, 1))), "Table.times = (0, 0): expected ascending"),
    "table rows": (lambda: cf.signals.Table((0, 1), ((0, 0, 0),)), "Table.values"),
    "ragged table": (lambda: cf.signals.Table((0, 1), ((0, 0, 0), 1.0)), "Table.values"),
    "against a clamp": (lambda: moving(cf.InitialVelocity(ROD, (1, 0, 0)), supports=[cf.Clamp(ROD.start)]),
                        "goes against supports[0] (Clamp"),
    "against a pin": (lambda: moving(cf.InitialVelocity(ROD, (1, 0, 0)), supports=[cf.Pin(ROD.end)]),
                      "goes against supports[0] (Pin"),
    "against a joint": (lambda: moving(cf.InitialVelocity(ROD, (1, 0, 0)), rods=[ROD, OTHER],
                                       joints=[cf.Joint(ROD.end, OTHER.start)]), "joints[0]"),
    "two velocities": (lambda: moving(cf.InitialVelocity(ROD), cf.InitialVelocity(ROD)), "the second of rod 'rod'"),
    "a velocity elsewhere": (lambda: moving(cf.InitialVelocity(OTHER)), "Scene.velocities[0] acts at"),
    "velocity of NaN": (lambda: moving(cf.InitialVelocity(ROD, lambda s: (0, 0, 1 / s if s else math.nan))),
                        "InitialVelocity.linear(0) = (0, 0, nan): expected 3 finite numbers (m/s)"),
    "about with a function": (lambda: cf.InitialVelocity(ROD, lambda s: (0, 0, 0), about=(0, 0, 0)),
                              "InitialVelocity.about"),
    "a support that jumps": (lambda: cf.simulate(cf.Scene([ROD], [cf.Prescribed(ROD.end, (0, 0, 1))]), 1.0),
                             "does not hold at the time 0"),
    "statics in time": (lambda: cf.solve(LATE_NAN, [1.0]),
                        "the Force depends on time, which a static analysis excludes"),
    "a step longer than the motion": (lambda: cf.simulate(FREE, 1.0, dt=50.0),
                                      "simulate.dt = 50.0: expected at most the duration, 1 s"),
    "a number for a vector": (lambda: cf.Force(FREE.rods[0].end, cf.signals.Sine(5.0, 2.0)),
                              "Force.force = (0.0,): expected 3 finite numbers (N)"),
    "no end of steps": (lambda: cf.simulate(FREE, 1.0, dt=1e-18),
                        "simulate: duration = 1 s and dt = 1e-18 s: expected at most 1e+09 steps"),
    "no end of states": (lambda: cf.simulate(FREE, 1.0, save_every=1e-12),
                         "save_every = 1e-12 s: expected at most 1e+06 saved states"),
    "no end": (lambda: cf.simulate(FREE, 1e308),
               "simulate.duration = 1e+308: expected a positive number (s), from 1e-30 to 1e30"),
    "no step": (lambda: cf.simulate(FREE, 1.0, dt=1e-300),
                "simulate.dt = 1e-300: expected a positive number (s), from"),
    "schemes": (lambda: cf.simulate(FREE, 1.0, scheme=["energy"]), "scheme = ['energy']: did you mean 'energy'?"),
    "true start": (lambda: cf.simulate(FREE, 1.0, start=True), "simulate.start = True: expected a load factor, a Path"),
    "infinite stiffness": (lambda: moving(rods=[cf.Rod(ROD.curve, sections(axial=math.inf), name="a")]),
                           "infinite axial or shear stiffness: expected finite ones, for a motion"),
}  # fmt: skip


test_refused = refuses(REFUSED)


def driven(**motion):
    return cf.Scene([ROD], [cf.Prescribed(ROD.start, **motion)], [cf.Force(ROD.end, cf.signals.Step((0, 1, 0), 0.5))])


@pytest.mark.parametrize("scheme", ["momentum", "energy", "triple-jump", "generalised-alpha"])
def test_a_support_that_jumps_is_refused(scheme):
    """The result would depend on the step size alone."""

    def jumping(t):
        return (0, 0, 0) if t < 0.5 else (0, 0.01 + 1e-3 * (t - 0.5), 0)

    sine, table = cf.signals.Sine((0, 0.02, 0), 1.0, math.pi / 2, 0.25), ((0, 0, 0), (0, 0.03, 0))
    for words, motion in {
        "displacement jumps at t = 0.5 s, by 0.05 m": {"displacement": cf.signals.Step((0, 0.05, 0), 0.5)},
        "rotation jumps at t = 1 s, by 0.3 rad": {"rotation": cf.signals.Step((0, 0, 0.3), 1.0)},
        "displacement jumps at t = 0.5 s, by 0.03 m": {"displacement": cf.signals.Table((0.5, 0.5 + 1e-12), table)},
        "displacement jumps at t = 0.25 s, by 0.02 m": {"displacement": sine},
        "displacement jumps at t = 0.5 s, by 0.01 m": {"displacement": jumping, "jumps": (0.25, 0.5)},
    }.items():
        told = rf"supports\[0\] \(Prescribed at rod.start\): its {words}: expected .* a Ramp or a RunUp"
        with pytest.raises(cf.SceneError, match=told):
            cf.simulate(driven(**motion), 1.0, dt=0.25, scheme=scheme)


def test_a_support_that_bends_and_a_load_that_jumps_are_taken():
    back = cf.signals.Table((0, 0.5, 0.6), ((0, 0, 0), (0, 0.05, 0), (0, 0, 0)))

    def run_up(t):
        """Small values have the rounding error of 1 - cos; it is not defined after the end."""
        assert t <= 1
        return (0, max(0.0, t - 0.25) ** 2 / 2 + (math.cos(max(0.0, t - 0.25)) - 1), 0)

    ramp, smooth = (kind((0, 1e-3, 0), 0.25, 0.5) for kind in (cf.signals.Ramp, cf.signals.RunUp))
    for motion, more in ((run_up, {"jumps": (0.25, 1.0)}), (back, {}), (ramp, {}), (smooth, {})):
        assert cf.simulate(driven(displacement=motion, **more), 1.0, dt=0.25, elements=1, degree=2).times[-1] == 1.0


def raising(t):
    return (0, 1 / (1.0 if t < 0.5 else 0), 0)


def no_number(t):
    return (0, 1.0 if t < 0.5 else math.nan, 0)


@pytest.mark.parametrize("force", [raising, no_number])
def test_a_function_of_time_that_fails_late_leaves_the_history(force):
    """And the message names the load and the time."""
    scene = cf.Scene([ROD], loads=[cf.Force(ROD.start, (0, 1, 0)), cf.Force(ROD.end, force)])
    how = {"dt": 0.1, "model": "spatial", "elements": 1, "degree": 2}
    with pytest.raises(cf.SceneError, match=r"at the time t = 0.55 s, of the Force at rod.end") as failure:
        cf.simulate(scene, 1.0, **how)
    np.testing.assert_allclose(failure.value.path.times, [0, 0.1, 0.2, 0.3, 0.4, 0.5])
    if force is raising:
        assert "Force.force: its function raised ZeroDivisionError (" in str(failure.value)
        assert isinstance(failure.value.__cause__, ZeroDivisionError)


def test_functions_of_time():
    v = (2.0, 0, -4.0)
    cases = {
        cf.signals.Step(v, 1.0, 2.0): ({0.9: 0, 1.0: 1, 1.9: 1, 2.0: 0}, (1, 2)),
        cf.signals.Step(v): ({-1: 0, 0: 1, 99: 1}, (0,)),
        cf.signals.Ramp(v, 1, 3): ({1: 0, 2: 0.5, 3: 1, 4: 1}, (1, 3)),
        cf.signals.Triangle(v, 0, 1, 3): ({0.5: 0.5, 1: 1, 2: 0.5, 3: 0, 4: 0, -1: 0}, (0, 1, 3)),
        cf.signals.Sine(v, 0.25, start=1): ({0: 0, 1: 0, 2: 1, 4: -1}, (1,)),
        cf.signals.Table((0, 2), ((0, 0, 0), v)): ({-1: 0, 1: 0.5, 3: 1}, (0, 2)),
    }
    for signal, (values, jumps) in cases.items():
        for t, factor in values.items():
            np.testing.assert_allclose(signal(t), np.multiply(factor, v), atol=1e-12)
        assert signal.jumps == jumps


def test_steps_land_on_jumps_and_on_saved_times():
    load = cf.Force(ROD.end, lambda t: (0, 0, 1.0 if t < 0.37 else 0.0), jumps=(0.37,))
    scene = cf.Scene([ROD], loads=[load])
    history = cf.simulate(scene, 1.0, dt=0.1, elements=2, degree=2)
    assert 0.37 in history.times and history.times[-1] == 1.0 and np.diff(history.times).max() < 0.1 + 1e-12
    np.testing.assert_allclose(history.linear_momentum[-1], [0, 0, 0.37], atol=1e-12)
    saved = cf.simulate(scene, 1.0, dt=0.1, save_every=0.3, elements=2, degree=2)
    np.testing.assert_allclose(saved.times, [0, 0.3, 0.6, 0.9, 1.0])
    line = cf.Scene([ROD], loads=[cf.LineForce(ROD, cf.signals.Ramp((0, 3, 0), 0, 1))])
    pushed = cf.simulate(line, 2.0, dt=0.1, elements=2, degree=2)
    np.testing.assert_allclose(pushed.linear_momentum[-1], [0, 3 * 2 * 1.5, 0], atol=1e-10)
    assert repr(pushed).startswith("<History: 21 times, t = 0 .. 2 s, planar, 15 unknowns")


def test_a_motion_that_is_lost_keeps_what_it_had(monkeypatch):
    from cosserat_fenicsx.algebra.newton import Solved
    from cosserat_fenicsx.dynamics import time_loop
    from cosserat_fenicsx.dynamics.schemes import Momentum

    whole = Momentum.step

    def step(self, t, h):
        return whole(self, t, h) if t < 0.45 else Solved(False, 1, "Newton's iterations ran out")

    monkeypatch.setattr(Momentum, "step", step)
    monkeypatch.setattr(time_loop, "_HALVINGS", 2)
    with pytest.raises(cf.NotConverged, match="lost at t = 0.5 s, where a step of 0.025 s still fails") as lost:
        cf.simulate(FREE, 1.0, dt=0.1)
    np.testing.assert_allclose(lost.value.path.times, [0, 0.1, 0.2, 0.3, 0.4, 0.5])


def test_a_motion_may_start_under_permanent_loads_alone():
    weight = cf.Scene([ROD], [cf.Clamp(ROD.start)], [cf.LineForce(ROD, (0, 0, -1.0), permanent=True)])
    history = cf.simulate(weight, 0.2, dt=0.05, start=0.0, elements=2)
    assert np.ptp(history.displacement(ROD.end), axis=0).max() < 1e-12 < np.abs(history.displacement(ROD.end)).max()


def test_a_support_on_a_body_of_six_degrees_of_freedom(tmp_path):
    """Splines of the table's columns; off its reference point a point of the body moves by the arm that turns."""
    t = np.linspace(0, 8, 161)
    roll, heave = 5 * np.sin(t), 0.3 * np.cos(t)
    rows = np.column_stack([t, 0 * t, 0 * t, heave, roll, 0 * t, 90 + 0 * t])
    np.savetxt(tmp_path / "vessel.csv", rows, delimiter=",", header="t, x, y, z, roll, pitch, yaw")
    about, point = np.array([0, 0, 1.0]), np.array([0, 3.0, 1.0])
    moved = cf.signals.BodyDisplacement(tmp_path / "vessel.csv", True, point, about, fade_in=2.0)
    angle = np.radians(5 * np.sin(5.02))  # the arm along y is raised by the roll, then turned to -x by the yaw
    arm = [-3 * np.cos(angle), -3.0, 3 * np.sin(angle) + 0.3 * np.cos(5.02)]
    np.testing.assert_allclose(moved(5.02), arm, atol=1e-7)
    turned = cf.signals.BodyRotation(np.column_stack([rows[:, :4], np.radians(rows[:, 4:])]), False, fade_in=2.0)
    now = Rotation.from_rotvec(turned(5.02)).apply((0, 3, 0))
    np.testing.assert_allclose(now, np.subtract(arm, (0, -3, 0.3 * np.cos(5.02))), atol=1e-7)
    assert moved(0.0) == (0, 0, 0) and moved(-1.0) == (0, 0, 0) and moved(9.0) == moved(8.0)
    rod = cf.Rod(cf.Line(tuple(point), (2, 3, 1)), BLADE, name="arm")
    scene = cf.Scene([rod], [cf.Prescribed("arm.start", displacement=moved, rotation=turned)])
    cf.write(scene, tmp_path / "scene.toml")
    assert (
        cf.read(tmp_path / "scene.toml").scene.supports[0].displacement.function
        == scene.supports[0].displacement.function
    )
    history = cf.simulate(scene, 1.0, dt=0.05, elements=2)
    np.testing.assert_allclose(history.position(rod.start)[-1] - point, moved(1.0), atol=1e-12)
    heading = np.column_stack([t, np.zeros((161, 5)), (170 + 60 * t + 180) % 360 - 180])  # recorded within a turn
    vessel = cf.signals.BodyRotation(heading, True)
    for time in (0.1, 0.33, 2.0, 7.9):
        np.testing.assert_allclose(vessel(time), (0, 0, np.radians(170 + 60 * time)), atol=1e-9)
    rolled = cf.signals.BodyRotation(np.column_stack([t, 0 * rows[:, :3], 40 + 0 * t, -40 + 0 * t, 150 + 30 * t]), True)
    steps = np.diff([rolled(time) for time in np.linspace(0, 3, 301)], axis=0)
    assert np.linalg.norm(steps, axis=1).max() < 0.02
    for bad, words in (
        (rows[::-1], "ascending times"),
        (rows[:, :6], "seven columns"),
        (rows * np.where(rows[:1] == 90, -1, 1) ** np.arange(161)[:, None], "quarter of a turn"),
    ):
        with pytest.raises(cf.SceneError, match=words):
            cf.signals.BodyRotation(bad, True)
