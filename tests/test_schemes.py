"""Time integration schemes: conserved quantities, orders, and energy balances."""

import itertools

import numpy as np
import pytest
from moving_scenes import drift, flying_in_space

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
SECTION = cf.Stiffness((1e5, 1e5), 1e5, (1e3, 1e3), 1e3, mass=2.0, inertia=(0.1, 0.1, 0.2))


def smooth():
    """A free rod, so soft that the steps resolve its waves, which begins to bend while it tumbles."""
    soft = cf.Stiffness((100, 100), 100, (500, 500), 500, mass=1.0, inertia=(10, 10, 20))
    rod = cf.Rod(cf.Line((6, 0, 0), (0, 8, 0)), soft)
    tangent, spin, out = np.array([-0.6, 0.8, 0]), np.array([0.2, 0.1, 0.3]), np.array([0, 0, 1.0])

    def bump(x):
        return 128 * x**4 * (1 - x) ** 4, 512 * x**3 * (1 - x) ** 3 * (1 - 2 * x) / rod.length

    def linear(s):
        return np.cross(spin, s * tangent) + bump(s / rod.length)[0] * out

    def angular(s):
        return spin + np.cross(tangent, bump(s / rod.length)[1] * out)

    return rod, cf.Scene([rod], velocities=[cf.InitialVelocity(rod, linear, angular)])


@pytest.mark.parametrize(("scheme", "order"), [("momentum", 2), ("energy", 2), ("triple-jump", 4)])
def test_order_in_time(scheme, order):
    rod, scene = smooth()
    ends = [
        cf.simulate(scene, 2, dt=2 / n, elements=2, degree=2, scheme=scheme, save_every=2).position(rod.end)[-1]
        for n in (80, 160, 320)
    ]
    gaps = [np.linalg.norm(a - b) for a, b in itertools.pairwise(ends)]
    orders = np.log2(np.divide(gaps[:-1], gaps[1:]))
    assert orders[-1] == pytest.approx(order, abs=0.1 * order), (gaps, orders)


def test_energy_is_exact_and_ends_agree():
    rod, scene = flying_in_space()
    history = cf.simulate(scene, 10, dt=0.05, elements=8, degree=2, scheme="energy")
    free = history.times > 5 - 1e-9
    assert drift(history.energy[free]) < 1e-10 and drift(history.linear_momentum[free]) < 1e-11
    assert drift(history.angular_momentum[free]) < 1e-3
    assert np.abs(history.balance).max() < 1e-9 * history.energy[-1]
    fine = cf.simulate(scene, 10, dt=0.0125, save_every=10, scheme="energy")
    np.testing.assert_allclose(fine.position(rod.start)[-1], [40.6910, 0.1578, -3.0316], atol=1e-2)
    np.testing.assert_allclose(fine.position(rod.end)[-1], [40.4784, 8.5541, 1.6810], atol=1e-2)


def everything():
    """A scene with damping and drag, a hinge, a ball joint, weight, follower loads and loads that depend on time."""
    a = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), SECTION, name="a", damping=cf.Damping(time=1e-3, drag=0.1))
    b = cf.Rod(cf.Line((2, 0, 0), (2, 1, 1)), SECTION, name="b")
    loads = [
        cf.Weight(),
        cf.FollowerForce(b.end, cf.signals.Ramp((20, 30, 0))),
        cf.EccentricForce(b.end, cf.signals.Sine((0, 0, 3), 0.5), (0.1, 0.1)),
        cf.LineMoment(a, cf.signals.Ramp((0, 2, 0))),
    ]
    return b, cf.Scene([a, b], [cf.Hinge(a.start, (0, 1, 0))], loads, [cf.Joint(a.end, b.start, "all")])


def test_the_ledger_closes_whatever_there_is():
    """To rounding with `energy`, with order 2 by default; both schemes give the same motion."""
    b, scene = everything()
    exact = cf.simulate(scene, 1, dt=0.01, elements=4, degree=2, scheme="energy")
    assert np.abs(exact.balance).max() < 1e-9 * exact.energy.max()
    runs = [cf.simulate(scene, 1, dt=dt, elements=4, degree=2) for dt in (0.01, 0.005)]
    coarse, fine = (np.abs(run.balance).max() for run in runs)
    assert coarse / fine == pytest.approx(4, rel=0.3)
    assert fine < 1e-3 * runs[1].energy.max() and runs[1].dissipated[-1] > 0
    np.testing.assert_allclose(runs[1].position(b.end)[-1], exact.position(b.end)[-1], atol=2e-2)


def test_a_run_does_not_depend_on_the_one_before():
    """Statistics on reused tangents are reset: results are identical,
    whatever was computed with the same forms before."""
    rod, scene = flying_in_space()
    settings = {"elements": 8, "degree": 2, "save_every": 2}
    first = cf.simulate(scene, 2, dt=0.05, **settings).position(rod.end)
    cf.simulate(scene, 7, dt=0.1, **settings)
    assert (cf.simulate(scene, 2, dt=0.05, **settings).position(rod.end) == first).all()


def test_what_a_scheme_cannot_do_is_said():
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), SECTION, damping=cf.Damping(drag=1))
    with pytest.raises(cf.SceneError, match="'triple-jump' has no error estimate: expected dt"):
        cf.simulate(cf.Scene([rod]), 1, scheme="triple-jump")
    with pytest.raises(cf.SceneError, match="steps back in time: expected rods without damping"):
        cf.simulate(cf.Scene([rod]), 1, dt=0.1, scheme="triple-jump")


def test_the_energy_scheme_adapts_its_steps_too():
    rod, scene = flying_in_space()
    history = cf.simulate(scene, 5, tol=1e-2, scheme="energy")
    fine = cf.simulate(scene, 5, tol=1e-3, scheme="energy")
    assert len(fine) > 1.5 * len(history)
    assert np.linalg.norm(history.position(rod.end)[-1] - fine.position(rod.end)[-1]) < 1e-2 * rod.length
