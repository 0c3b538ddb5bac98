"""Rods that touch each other in motion: invariants, closed forms of impacts, refusals, and that none passes through
another."""

import math
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from ended_motions import Stopped, stop_at
from moving_scenes import drift

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
#: masses, kg; lengths, m; radius, m; distance of the surfaces at the start, m
MASSES, LENGTHS, RADIUS, APART = (0.5, 0.8), (0.6, 0.9), 0.005, 2e-4
#: N/m^2, and that of a point over the depth^1.5
STIFFNESS = 1e8
POINT = 4 / 3 * STIFFNESS * math.sqrt(4 * RADIUS)


def bars(d=(0.0, 0.0), speed=1.0, stiffness=STIFFNESS, bending=1e6, turning=1e-12, **contact):
    """Two bars that cross at a right angle; the upper one falls at a speed on the lower one, at distances d from both
    middles."""
    rods = []
    for name, m, L, e, along in zip("ab", MASSES, LENGTHS, d, np.eye(3)[:2], strict=True):
        section = cf.Stiffness(
            (1e8, 1e8), 1e8, (bending,) * 2, bending, mass=m / L, inertia=(turning, turning, 2 * turning)
        )
        middle = np.array((0, 0, 2 * RADIUS + APART)) * (name == "a") - e * along
        curve = cf.Line(tuple(middle - L / 2 * along), tuple(middle + L / 2 * along))
        rods.append(cf.Rod(curve, section, name=name))
    touch = cf.RodContact(radius=RADIUS, stiffness=stiffness, **contact)
    return cf.Scene(rods, [], [touch], velocities=[cf.InitialVelocity(rods[0], linear=(0, 0, -speed))])


def test_a_motion_does_not_begin_where_rods_press_each_other():
    """The elastic surfaces of a motion would have no force where the hard ones of an equilibrium do not overlap."""
    from test_rod_contact import crossing

    path = cf.solve(crossing(), [1e-4, 0.1], elements=4)
    moving = replace(path.scene, loads=[cf.RodContact(radius=0.01, stiffness=1e7, friction=0.2)])
    with pytest.raises(cf.SceneError, match=r"rods press each other there by .* N on hard surfaces, and a motion on"):
        cf.simulate(moving, 1e-3, dt=1e-4, start=path, elements=4)


def middles(history, quantity):
    return [getattr(history, quantity)(rod.at(rod.length / 2))[-1] for rod in history.scene.rods]


@pytest.mark.parametrize("scheme", ["momentum", "energy"])
def test_bars_that_cross(scheme, truth):
    """Bars of motions in the truths, after an impact off their middles: 0.2835820895522388 and 0.44776119402985076 m/s,
    2.388059701492537 and 1.9900497512437811 rad/s. They turn while they touch, and the contact slides."""
    history = cf.simulate(bars((0.1, 0.3)), 3e-3, dt=5e-5, scheme=scheme, elements=1, degree=2)
    assert np.ptp(history.linear_momentum, axis=0).max() < 1e-10 * MASSES[0]
    assert np.ptp(history.angular_momentum, axis=0).max() < 1e-10
    assert np.abs(history.balance).max() < 1e-8 * history.kinetic[0]
    assert abs(history.work[-1]) < 1e-7 * history.kinetic[0] < 0.01 * abs(history.work.min())
    truth(f"bars that cross, speeds, {scheme}", [-v[2] for v in middles(history, "velocity")],
          [0.2835820895522388, 0.44776119402985076], 1e-3, most=5e-4)  # fmt: skip
    a, b = middles(history, "angular_velocity")
    truth(f"bars that cross, spins, {scheme}", [-a[1], -b[0]], [2.388059701492537, 1.9900497512437811], 1e-3, most=5e-4)


def test_an_impact_takes_as_long_as_that_of_balls():
    """Hertz: with the force K p^1.5 masses m1, m2 touch for 2.943 p/v, p = (5 m v^2/(4 K))^(2/5), 1/m = 1/m1 + 1/m2."""
    history = cf.simulate(bars(), 3e-3, dt=3e-5, elements=1, degree=2)
    deepest = (5 * MASSES[0] * MASSES[1] / sum(MASSES) / (4 * POINT)) ** 0.4
    gap = np.subtract(*(history.position(rod.at(rod.length / 2))[:, 2] for rod in history.scene.rods)) - 2 * RADIUS
    assert -gap.min() == pytest.approx(deepest, rel=2e-3)
    assert history.times[gap < 0][[0, -1]] @ (-1, 1) == pytest.approx(2.9433 * deepest, rel=2e-2)


def test_damping_takes_what_hunt_and_crossley_say():
    """Restitution 1 - (2/3) damping v for small ones, whatever the power of the law; the loss is booked."""
    damping = 0.03
    history = cf.simulate(bars(damping=damping), 3e-3, dt=5e-5, elements=1, degree=2)
    a, b = middles(history, "velocity")
    assert 1 - (a - b)[2] == pytest.approx(2 / 3 * damping, rel=0.03)
    assert history.dissipated[-1] == pytest.approx(history.kinetic[0] - history.kinetic[-1], rel=1e-4)
    assert np.abs(history.balance).max() < 1e-8 * history.kinetic[0]


@pytest.mark.parametrize(("friction", "spin"), [(0.0, 0.0), (0.3, 20.0), (0.02, 100.0)], ids=["", "sticks", "slides"])
def test_rods_side_by_side_hit_each_other_along_a_line(friction, spin):
    """They keep momenta and energy, and the first one all but stops. The slip r w of a rod that spins ends where
    friction can take it, J (2/m + 2 r^2/I) with its impulse J; else J is mu times that of the normal force."""
    m, turning, falls = 1.0, 2e-6, -0.5
    section = cf.Stiffness((1e7,) * 2, 1e7, (1e3,) * 2, 1e3, mass=m, inertia=(turning / 2, turning / 2, turning))
    upper = cf.Rod(cf.Line((-0.17, 0, 2 * RADIUS + 1e-4), (0.23, 0, 2 * RADIUS + 1e-4)), section, name="upper")
    lower = cf.Rod(cf.Line((-0.2, 0, 0), (0.2, 0, 0)), section, name="lower")
    touch = cf.RodContact(radius=RADIUS, stiffness=1e7, friction=friction)
    start = cf.InitialVelocity(upper, linear=(0, 0, falls), angular=(spin, 0, 0))
    history = cf.simulate(
        cf.Scene([upper, lower], [], [touch], velocities=[start]), 3e-3, dt=5e-5, elements=4, degree=2
    )
    assert np.ptp(history.linear_momentum, axis=0).max() < 2e-11
    assert np.ptp(history.angular_momentum, axis=0).max() < 1e-11
    assert np.abs(history.balance).max() < (1e-7 if spin else 1e-8) * history.kinetic[0] < 0.1 * abs(history.work.min())
    assert history[int(np.argmin(history.work))].contacts(touch).line.any()
    impulse = min(friction * m * abs(falls), RADIUS * spin / (2 / m + 2 * RADIUS**2 / turning))
    np.testing.assert_allclose([v[2] for v in middles(history, "velocity")], (0, falls), atol=0.02)
    np.testing.assert_allclose([w[0] for w in middles(history, "angular_velocity")],
                               (spin - RADIUS * impulse / turning, -RADIUS * impulse / turning), rtol=0.04)  # fmt: skip


def test_what_motions_need():
    with pytest.raises(cf.SceneError, match=r"expected one process, and a RodContact.stiffness \(N/m\^2\)"):
        cf.simulate(bars(stiffness=None), 1.0)
    with pytest.raises(cf.SceneError, match="0 without a stiffness"):
        cf.RodContact(damping=0.1)
    with pytest.raises(cf.SceneError, match="triple-jump"):
        cf.simulate(bars(), 1e-3, dt=1e-4, scheme="triple-jump", elements=1)


def test_a_surface_that_is_too_soft():
    with pytest.raises(
        cf.NotConverged, match=r"rod 'a' at s = .* overlaps rod 'b' .*its stiffness is too small"
    ) as found:
        cf.simulate(bars(stiffness=1e4), 0.1, dt=1e-3, elements=1, degree=2)
    assert len(found.value.path)


#: kg, m, m/s^2, coefficient of friction
MASS, ROLLER, GRAVITY, FRICTION = 0.2, 0.01, 9.81, 0.3


def on_rails(loads=(), **velocity):
    """A solid, stiff rod of the radius ROLLER along x, that lies with its weight on two clamped rods along y."""
    turning = MASS / 0.4 * ROLLER**2 / 4
    section = cf.Stiffness((1e6,) * 2, 1e6, (1e4,) * 2, 1e4, mass=MASS / 0.4, inertia=(turning, turning, 2 * turning))
    rails = [cf.Rod(cf.Line((x, -0.1, 0), (x, 0.3, 0)), section, name=name) for name, x in (("a", -0.1), ("b", 0.1))]
    rod = cf.Rod(cf.Line((-0.2, 0, 2 * ROLLER), (0.2, 0, 2 * ROLLER)), section, name="rod")
    touch = cf.RodContact(radius=ROLLER, stiffness=1e7, damping=50.0, friction=FRICTION)
    weight = cf.Force(rod.at(0.2), (0, 0, -MASS * GRAVITY))
    held = [cf.Clamp(end) for rail in rails for end in (rail.start, rail.end)]
    loads = [load(rod) for load in loads]
    return cf.Scene([*rails, rod], held, [touch, weight, *loads], velocities=[cf.InitialVelocity(rod, **velocity)])


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "spin"), [(0.6, 0.0), (0.0, -60.0)], ids=["slides", "spins"])
def test_a_rod_that_slides_or_spins_begins_to_roll(speed, spin):
    """Angular momentum about the surface that it rolls on stays: v = (2 v0 - r w0)/3; in sliding the speed changes by
    mu g t. What friction takes is what is missing."""
    scene = on_rails(linear=(0, speed, 0), angular=(spin, 0, 0))
    history = cf.simulate(scene, 0.08, dt=1e-3, elements=1, degree=2)
    middle = scene.rods[2].at(0.2)
    v, w = (getattr(history, name)(middle) for name in ("velocity", "angular_velocity"))
    rolls = (2 * speed - ROLLER * spin) / 3
    assert v[-8:, 1].mean() == pytest.approx(rolls, rel=4e-3)
    assert -ROLLER * w[-8:, 0].mean() == pytest.approx(rolls, rel=4e-3)
    half = int(np.argmin(np.abs(history.times - abs(rolls - speed) / (FRICTION * GRAVITY) / 2)))
    assert v[half, 1] - speed == pytest.approx(math.copysign(FRICTION * GRAVITY, rolls - speed) * history.times[half],
                                               rel=0.02)  # fmt: skip
    assert np.diff(history.dissipated).min() >= 0
    assert np.abs(history.balance).max() < 2e-6 * history.kinetic[0]
    lost = MASS * (speed + ROLLER * spin) ** 2 / 6  # that of slip
    assert history.dissipated[-1] == pytest.approx(lost, rel=0.02)


@pytest.mark.slow
def test_a_rod_sticks_below_the_friction_cone_and_slides_above():
    """Pulled along its axis by a force that grows to twice friction: it does not creep before, and then moves as
    c (t - t1)^3/6 with the rate c of the force over the mass, which begins to pull when its share is mu."""
    rate = 2 * FRICTION * GRAVITY / 0.2  # m/s^3
    pull = lambda rod: cf.Force(rod.start, lambda t: (MASS * rate * t, 0, 0))  # noqa: E731
    scene = on_rails([pull])
    history = cf.simulate(scene, 0.2, dt=1e-3, elements=1, degree=2)
    x = history.position(scene.rods[2].at(0.2))[:, 0]
    holds = (history.times > 0.045) & (history.times < 0.095)
    assert np.ptp(x[holds]) < 2e-7  # it is tilted by the pull and the depths of both contacts
    assert x[-1] - x[holds][-1] == pytest.approx(rate * 0.1**3 / 6, rel=0.01)


@pytest.mark.slow
def test_a_rod_slides_to_rest(truth):
    """v^2/(2 mu g) along its axis, of motions in the truths with other numbers."""
    scene = on_rails(linear=(0.5, 0, 0))
    history = cf.simulate(scene, 0.2, dt=1e-3, elements=1, degree=2)
    x = history.position(scene.rods[2].at(0.2))[:, 0]
    truth("a rod that slides to rest on others, its way", x[-1] - x[0], 0.5**2 / (2 * FRICTION * GRAVITY), 2e-3)
    assert history.kinetic[-1] < 1e-5 * history.kinetic[0]  # it rests


@pytest.mark.parametrize("scheme", ["momentum", "energy", "generalised-alpha"])
def test_friction_between_free_rods(scheme):
    """It is equal and opposite at one point of space, and takes energy that is booked."""
    scene = bars((0.1, 0.3), friction=0.4, turning=1e-5)
    scene = cf.Scene(scene.rods, [], scene.loads, velocities=[
        cf.InitialVelocity(scene.rods[0], linear=(0.5, -0.3, -1.0), angular=(20.0, 0, 3.0))])  # fmt: skip
    history = cf.simulate(scene, 3e-3, dt=5e-5, scheme=scheme, elements=1, degree=2)
    exact = scheme != "generalised-alpha"
    assert np.ptp(history.linear_momentum, axis=0).max() < (1e-10 if exact else 1e-4) * MASSES[0]
    assert np.ptp(history.angular_momentum, axis=0).max() < {"momentum": 1e-10, "energy": 1e-6}.get(scheme, 1e-4)
    assert np.abs(history.balance).max() < (1e-8 if exact else 2e-2) * history.kinetic[0]
    assert np.diff(history.dissipated).min() >= 0
    assert history.dissipated[-1] > 0.02 * history.kinetic[0]


def closest(history):
    """The smallest distance of two rods' centrelines in all states, by samples alone."""
    smallest = math.inf
    for k in range(len(history)):
        points = [history.sample(k, rod, np.linspace(0, 1, 300))[0] for rod in history.scene.rods]
        smallest = min(smallest, *(np.linalg.norm(p[:, None] - q, axis=2).min() for p, q in combinations(points, 2)))
    return smallest


def test_fast_rods_do_not_pass_through_each_other():
    """Steps of two diameters at 20 m/s are cut."""
    history = cf.simulate(bars((0.05, 0.0), speed=20.0, stiffness=2e9), 3e-3, dt=1e-3, elements=1, degree=2)
    above = np.subtract(*(history.position(rod.at(rod.length / 2 + d))[:, 2]
                          for rod, d in zip(history.scene.rods, (0.05, 0.0), strict=True)))  # fmt: skip
    assert above.min() > 0 and closest(history) > 1.5 * RADIUS
    assert drift(history.linear_momentum) < 1e-10


def test_no_rod_passes_through_another_in_motion(tangle):
    """Two to five rods at random angles and speeds fall on each other; the lowest is held, and friction is random. In
    each step all keep their distance, and the one above stays above, or the motion ends with two rods by name."""
    random, radius, count = np.random.default_rng(tangle), 0.01, 2 + tangle % 4
    section = cf.Stiffness((1e4, 1e4), 1e5, (2.0, 2.0), 1.5, mass=0.3, inertia=(1e-5, 1e-5, 2e-5))
    rods, velocities = [], []
    for k in range(count):
        angle = random.uniform(0.3, 1.2) + k * math.pi / count
        half = random.uniform(0.1, 0.2) * np.array([math.cos(angle), math.sin(angle), 0])
        middle = np.array([*random.uniform(-0.05, 0.05, 2), 2.1 * radius * k])
        rods.append(cf.Rod(cf.Line(tuple(middle - half), tuple(middle + half)), section, name=f"rod {k}"))
        falls = (*random.uniform(-1, 1, 2), -random.uniform(1, 3) * k)
        velocities += [cf.InitialVelocity(rods[-1], linear=falls)] if k else []
    touch = cf.RodContact(radius=radius, stiffness=3e8, friction=random.uniform(0, 0.8), damping=0.05)
    scene = cf.Scene(rods, [cf.Clamp(rods[0].start), cf.Clamp(rods[0].end)], [touch], velocities=velocities)
    try:
        history = cf.simulate(scene, 4e-3, dt=1e-4, elements=3, degree=2)
    except cf.NotConverged as failure:
        history = failure.path
        assert "rod 'rod " in str(failure)
    assert closest(history) > 1.5 * radius
    shapes = [history.sample(len(history) - 1, rod, np.linspace(0, 1, 300))[0] for rod in rods]
    for upper, p in enumerate(shapes):
        for q in shapes[:upper]:  # seen from above, where they cross
            apart = np.linalg.norm(p[:, None, :2] - q[:, :2], axis=2)
            i, j = np.unravel_index(apart.argmin(), apart.shape)
            assert apart[i, j] > 2.5e-3 or p[i, 2] > q[j, 2]


def test_it_goes_on_from_its_folder(monkeypatch, tmp_path):
    """A motion that is continued while rods touch has the same digits; forces of contacts are read from its states."""
    settings = {"dt": 5e-5, "elements": 1, "degree": 2}
    whole = cf.simulate(bars((0.1, 0.3), friction=0.3), 1e-3, **settings)
    stop_at(monkeypatch, 12, 0)
    with pytest.raises(Stopped):
        cf.simulate(bars((0.1, 0.3), friction=0.3), 1e-3, folder=tmp_path / "bars", **settings)
    stored = cf.resume(tmp_path / "bars")
    for rod, same in zip(whole.scene.rods, stored.scene.rods, strict=True):
        assert np.array_equal(whole.position(rod.end), stored.position(same.end))
    found, again = (motion[-1].contacts(motion.scene.loads[0]) for motion in (whole, stored))
    depth, (first, _) = -found.gap[0], whole.scene.rods
    assert found.force == pytest.approx(POINT * depth**1.5) == pytest.approx(again.force)
    np.testing.assert_allclose((found.s[0], found.other_s[0]), (0.4, 0.75), atol=1e-3)
    assert not found.line.any() and f"at the time {whole.times[-1]:.6g} s" in str(found)
    forces = whole.quantities["rod_force"].of(whole, first)
    np.testing.assert_allclose(forces[-1].sum(axis=0), -found.force[0] * found.normal[0], rtol=1e-9)
    assert not forces[0].any()
