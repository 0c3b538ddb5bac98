"""Rods that touch each other in motion: invariants, closed forms of impacts, refusals, and that none passes through
another."""

import math
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


def bars(d=(0.0, 0.0), speed=1.0, stiffness=STIFFNESS, bending=1e6, **contact):
    """Two bars that cross at a right angle; the upper one falls at a speed on the lower one, at distances d from both
    middles."""
    rods = []
    for name, m, L, e, along in zip("ab", MASSES, LENGTHS, d, np.eye(3)[:2], strict=True):
        section = cf.Stiffness((1e8, 1e8), 1e8, (bending,) * 2, bending, mass=m / L, inertia=(1e-12, 1e-12, 2e-12))
        middle = np.array((0, 0, 2 * RADIUS + APART)) * (name == "a") - e * along
        curve = cf.Line(tuple(middle - L / 2 * along), tuple(middle + L / 2 * along))
        rods.append(cf.Rod(curve, section, name=name))
    touch = cf.RodContact(radius=RADIUS, stiffness=stiffness, **contact)
    return cf.Scene(rods, [], [touch], velocities=[cf.InitialVelocity(rods[0], linear=(0, 0, -speed))])


def middles(history, quantity):
    return [getattr(history, quantity)(rod.at(rod.length / 2))[-1] for rod in history.scene.rods]


@pytest.mark.parametrize("scheme", ["momentum", "energy"])
def test_bars_that_cross(scheme, truth):
    """Bars of motions in the truths, after an impact off their middles: 0.2835820895522388 and 0.44776119402985076 m/s,
    2.388059701492537 and 1.9900497512437811 rad/s. They turn while they touch, and the contact slides."""
    history = cf.simulate(bars((0.1, 0.3)), 3e-3, dt=3e-5, scheme=scheme, elements=1, degree=2)
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
    history = cf.simulate(bars(), 3e-3, dt=2e-5, elements=1, degree=2)
    deepest = (5 * MASSES[0] * MASSES[1] / sum(MASSES) / (4 * POINT)) ** 0.4
    gap = np.subtract(*(history.position(rod.at(rod.length / 2))[:, 2] for rod in history.scene.rods)) - 2 * RADIUS
    assert -gap.min() == pytest.approx(deepest, rel=2e-3)
    assert history.times[gap < 0][[0, -1]] @ (-1, 1) == pytest.approx(2.9433 * deepest, rel=2e-2)


def test_damping_takes_what_hunt_and_crossley_say():
    """Restitution 1 - (2/3) damping v for small ones, whatever the power of the law; the loss is booked."""
    damping = 0.03
    history = cf.simulate(bars(damping=damping), 3e-3, dt=3e-5, elements=1, degree=2)
    a, b = middles(history, "velocity")
    assert 1 - (a - b)[2] == pytest.approx(2 / 3 * damping, rel=0.03)
    assert history.dissipated[-1] == pytest.approx(history.kinetic[0] - history.kinetic[-1], rel=1e-4)
    assert np.abs(history.balance).max() < 1e-8 * history.kinetic[0]


def test_rods_side_by_side_hit_each_other_along_a_line():
    """They keep momenta and energy, and the first one all but stops."""
    section = cf.Stiffness((1e7,) * 2, 1e7, (1e3,) * 2, 1e3, mass=1.0, inertia=(1e-6, 1e-6, 2e-6))
    upper = cf.Rod(cf.Line((-0.17, 0, 2 * RADIUS + 1e-4), (0.23, 0, 2 * RADIUS + 1e-4)), section, name="upper")
    lower = cf.Rod(cf.Line((-0.2, 0, 0), (0.2, 0, 0)), section, name="lower")
    touch, falls = cf.RodContact(radius=RADIUS, stiffness=1e7), cf.InitialVelocity(upper, linear=(0, 0, -0.5))
    history = cf.simulate(
        cf.Scene([upper, lower], [], [touch], velocities=[falls]), 3e-3, dt=5e-5, elements=4, degree=2
    )
    assert np.ptp(history.linear_momentum, axis=0).max() < 2e-11
    assert np.ptp(history.angular_momentum, axis=0).max() < 1e-11
    assert np.abs(history.balance).max() < 1e-8 * history.kinetic[0] < 0.1 * abs(history.work.min())
    assert history[int(np.argmin(history.work))].contacts(touch).line.any()
    np.testing.assert_allclose([v[2] for v in middles(history, "velocity")], (0, -0.5), atol=0.02)


def test_what_motions_need():
    with pytest.raises(cf.SceneError, match=r"expected one process, and a RodContact.stiffness \(N/m\^2\)"):
        cf.simulate(bars(stiffness=None), 1.0)
    with pytest.raises(cf.SceneError, match="0 without a stiffness"):
        cf.RodContact(damping=0.1)
    with pytest.raises(cf.SceneError, match="triple-jump"):
        cf.simulate(bars(), 1e-3, dt=1e-4, scheme="triple-jump", elements=1)


def test_a_surface_that_is_too_soft():
    with pytest.raises(
        cf.NotConverged, match=r"rod 'a' at s = .* enters rod 'b' .*its stiffness is too small"
    ) as found:
        cf.simulate(bars(stiffness=1e4), 0.1, dt=1e-3, elements=1, degree=2)
    assert len(found.value.path)


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


def test_it_goes_on_from_its_folder(monkeypatch, tmp_path):
    """A motion that is continued while rods touch has the same digits; forces of contacts are read from its states."""
    settings = {"dt": 5e-5, "elements": 1, "degree": 2}
    whole = cf.simulate(bars((0.1, 0.3)), 1e-3, **settings)
    stop_at(monkeypatch, 12, 0)
    with pytest.raises(Stopped):
        cf.simulate(bars((0.1, 0.3)), 1e-3, folder=tmp_path / "bars", **settings)
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
