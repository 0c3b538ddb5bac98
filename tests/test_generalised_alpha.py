"""Generalised-alpha: the linear theory step by step, order 2, consistent starts, rigid motions, ledger."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from moving_scenes import drift, flying_in_space
from test_action_protocol import FREE, Lookup
from test_schemes import smooth

import cosserat_fenicsx as cf
from cosserat_fenicsx.dynamics.stepper import Stepper

pytestmark = pytest.mark.serial
SCHEME = "generalised-alpha"
STIFF = cf.Stiffness((1e5, 1e5), 1e5, (1e3, 1e3), 1e3, mass=2.0, inertia=(0.1, 0.1, 0.2))


def oscillator(omega, tau, v, steps, rho):
    """u'' = -omega^2 (u + tau u') from u = 0, u' = v: rows (u, u') after the steps, by the published scheme.

    The initial acceleration is that of an implicit step of a tenth of the first; b - a is scaled with the step.
    """
    m, f = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
    gamma = 0.5 - m + f
    beta = (gamma + 0.5) ** 2 / 4
    first = steps[0] / 10
    a = b = -(omega**2) * (first + tau) * v / (1 + omega**2 * (first**2 / 2 + tau * first))
    u, rows, before = 0.0, [], steps[0]
    for h in steps:
        b = a + h / before * (b - a)
        ahead_u, ahead_v = u + h * v + h**2 * (0.5 - beta) * b, v + h * (1 - gamma) * b
        # (1 - m) b1 + m b = (1 - f) a1 + f a, with a1 = -omega^2 (u1 + tau v1)
        known = f * a - m * b - (1 - f) * omega**2 * (ahead_u + tau * ahead_v)
        b = known / (1 - m + (1 - f) * omega**2 * h * (beta * h + tau * gamma))
        u, v = ahead_u + beta * h**2 * b, ahead_v + gamma * h * b
        a, before = -(omega**2) * (u + tau * v), h
        rows.append((u, v))
    return np.array(rows)


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("omega_h", [0.15, 3.0, 100.0])
def test_a_mode_is_what_linear_theory_says(rho, omega_h):
    """Axial and torsional vibration of one element with the mass at its nodes, damped, with steps of two lengths."""
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), STIFF)
    omegas = {"planar": np.sqrt(2 * 1e5 / (2.0 * 2**2)), "spatial": np.sqrt(2 * 1e3 / (0.2 * 2**2))}
    for model, omega in omegas.items():
        h = omega_h / omega
        damped = cf.Rod(rod.curve, STIFF, damping=cf.Damping(time=0.02 / omega))
        small = 1e-4 * omega
        turn = model == "spatial"
        push = cf.InitialVelocity(damped, **{"angular" if turn else "linear": lambda s, v=small: (v * s / 2, 0, 0)})
        scene = cf.Scene([damped], [cf.Clamp(damped.start)], velocities=[push])
        history = cf.simulate(scene, 32 * h, dt=h, save_every=28 * h, elements=1, degree=1, scheme=SCHEME, rho_inf=rho,
                              model=model)  # fmt: skip
        assert history.steps[-1] == 32
        every = cf.simulate(scene, 28 * h, dt=h, elements=1, degree=1, scheme=SCHEME, rho_inf=rho, model=model)
        for found, steps in ((history, [h] * 32), (every, [h] * 28)):
            expected = oscillator(omega, 0.02 / omega, small, steps, rho)
            rate = (found.angular_velocity if turn else found.velocity)(damped.end)[:, 0]
            moved = 2 * found.rotation(damped.end)[:, 1] if turn else found.displacement(damped.end)[:, 0]
            rows = expected[np.searchsorted(np.cumsum(steps), found.times[1:] - h / 2)]
            sizes = np.abs(expected).max(axis=0)
            assert np.abs(moved[1:] - rows[:, 0]).max() < 1e-6 * sizes[0], model
            assert np.abs(rate[1:] - rows[:, 1]).max() < 1e-6 * sizes[1], model


def test_the_spectral_radius_at_high_frequency_is_rho_inf():
    """The spectral radius of the scheme above; resolved motions are hardly damped."""
    for rho in (0.5, 0.8, 1.0):
        high, low = (np.abs(oscillator(w, 0.0, 1.0, [1.0] * 600, rho)[:, 1]) for w in (1e6, 2 * np.pi / 100))
        shrunk = (high[580:].max() / high[480:500].max()) ** 0.01
        assert shrunk == pytest.approx(rho, rel=1e-2), rho
        assert low[500:].max() > 0.995, rho


@pytest.mark.parametrize("rho", [0.3, 0.8, 1.0])
def test_order_in_time(rho):
    rod, scene = smooth()
    runs = [
        cf.simulate(scene, 2, dt=2 / n, elements=2, degree=2, scheme=SCHEME, rho_inf=rho, save_every=2)
        for n in (160, 320, 640)
    ]
    for query in ("position", "rotation", "velocity", "angular_velocity"):
        ends = [getattr(run, query)(rod.end)[-1] for run in runs]
        gaps = [np.linalg.norm(a - b) for a, b in itertools.pairwise(ends)]
        assert np.log2(gaps[0] / gaps[1]) == pytest.approx(2, abs=0.15), (query, gaps)


def test_the_ledger_of_all_that_there_is_closes_with_the_order_two(monkeypatch):
    """With joints, damping, drag, a prescribed motion and follower loads."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent.parent / "demos" / "evidence"))
    import orders

    b, scene = orders.chain()
    runs = [cf.simulate(scene, 2, dt=2 / n, elements=2, degree=2, scheme=SCHEME, save_every=0.5) for n in (40, 80, 160)]
    for name in ("balance", "dissipated", "work"):
        found = [getattr(run, name)[1:] for run in runs]
        gaps = [np.linalg.norm(x - y) for x, y in itertools.pairwise(found)]
        assert np.log2(gaps[0] / gaps[1]) == pytest.approx(2, abs=0.15), (name, gaps)
    assert np.abs(runs[-1].balance).max() < 1e-3 * runs[-1].work[-1]
    other = cf.simulate(scene, 2, dt=1 / 80, elements=2, degree=2, save_every=0.5)
    np.testing.assert_allclose(runs[-1].position(b.end)[-1], other.position(b.end)[-1], atol=2e-3)
    np.testing.assert_allclose(runs[-1].work, other.work, atol=2e-3 * other.work[-1])
    np.testing.assert_allclose(runs[-1].dissipated, other.dissipated, atol=2e-3 * other.dissipated[-1])


def test_what_is_dissipated_numerically_is_in_the_balance():
    """A sudden axial force makes a stiff rod vibrate; half of the
    energy is lost in the end, without physical damping."""
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), STIFF)
    scene = cf.Scene([rod], loads=[cf.Force(rod.end, cf.signals.Step((1e3, 0, 0), end=0.001))])
    history = cf.simulate(scene, 1, dt=0.01, elements=4, degree=2, scheme=SCHEME, rho_inf=0.5)
    late = history.times >= 0.1
    rigid = history.linear_momentum[-1, 0] ** 2 / (2 * 4.0)
    assert history.linear_momentum[-1, 0] == pytest.approx(1.0, rel=1e-9) and not history.dissipated.any()
    np.testing.assert_allclose(history.energy[-1], rigid, rtol=1e-9)
    assert history.balance[-1] == pytest.approx(rigid - history.work[-1], rel=1e-9) and history.balance[-1] < 0
    assert (np.diff(history.balance[late]) <= 1e-12).all()


@pytest.mark.parametrize("model", ["planar", "spatial"])
def test_starts_and_jumps_are_consistent(model):
    """Under a constant force accelerations are exact from the first step
    on, and so are free fall and the flight after it."""
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), STIFF)
    scene = cf.Scene([rod], loads=[cf.LineForce(rod, cf.signals.Step((0, 0, 4.0), end=0.5))])
    history = cf.simulate(scene, 1, dt=0.07, elements=2, degree=2, scheme=SCHEME, model=model)
    t = history.times
    np.testing.assert_allclose(history.position(rod.end)[:, 2], np.where(t < 0.5, t**2, t - 0.25), atol=1e-11)
    assert np.abs(history.balance).max() < 1e-11


def test_from_a_static_point_nothing_moves_and_kinks_of_a_drive_do_no_harm():
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), STIFF)
    hinged = [cf.Hinge(rod.start, (0, 1, 0)), cf.Pin(rod.end)]
    loaded = cf.Scene([rod], hinged, [cf.Force(rod.at(1.0), (0, 100, -300))])
    path = cf.solve(loaded, [1.0], elements=4, degree=2, model="spatial")
    still = cf.simulate(loaded, 0.2, dt=0.01, start=path, elements=4, degree=2, scheme=SCHEME)
    assert np.ptp(still.position(rod.at(1.0)), axis=0).max() < 1e-11
    kinked = cf.Prescribed(
        rod.start, displacement=cf.signals.Table((0, 0.5, 1), ((0, 0, 0), (0, 0, 0), (0, 0, 0.5))), rotation=(0, 0, 0)
    )
    history = cf.simulate(cf.Scene([rod], [kinked]), 1, dt=0.01, elements=4, degree=2, scheme=SCHEME)
    assert np.abs(history.position(rod.start)[:, 2] - np.maximum(history.times - 0.5, 0)).max() < 1e-12
    assert history.velocity(rod.start)[-1, 2] == pytest.approx(1.0, abs=1e-3)  # 0.8^50 of the vibration remains
    assert np.abs(history.velocity(rod.end)).max() < 4


def test_rigid_spins_are_exact_and_undamped():
    """The rotation vector of a step is h Om for any h; strain rates are computed from strains, and vanish."""
    damping, axis = cf.Damping(time=2e-3), np.array([1, 2, 2]) / 3
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 2, 2)), STIFF, damping=damping)
    spin = cf.InitialVelocity(rod, linear=(0.5, 0, 0), angular=2 * np.pi * axis)
    history = cf.simulate(cf.Scene([rod], velocities=[spin]), 1, dt=0.05, elements=1, degree=2, scheme=SCHEME)
    np.testing.assert_allclose(np.abs(history.rotation(rod.end)[-1]), [1, 0, 0, 0], atol=1e-10)
    np.testing.assert_allclose(history.angular_velocity(rod.end)[-1], 2 * np.pi * axis, rtol=1e-10)
    assert np.abs(history.balance).max() < 1e-9 and history.dissipated[-1] < 1e-12
    section = cf.Stiffness((1e5, 1e5), 1e5, (20.0, 20.0), 15.0, mass=2.0, inertia=(1e-4, 1e-4, 2e-4))
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), section, damping=damping)
    scene = cf.Scene([rod], velocities=[cf.InitialVelocity(rod, angular=(0, 2 * np.pi, 0))])
    history = cf.simulate(scene, 12, dt=1 / 40, elements=2, save_every=1, scheme=SCHEME)
    late = history.times >= 5
    assert history.dissipated[-1] - history.dissipated[late][0] < 1e-9 * history.energy[-1]
    assert drift(history.angular_momentum[late]) < 5e-4


def test_flight_in_space():
    """Within 5e-3 m of the references of tests/test_motion.py, and at tol 1e-3 within 1e-3 of the rod's length."""
    rod, scene = flying_in_space()
    fixed = cf.simulate(scene, 10, dt=0.0125, save_every=10, scheme=SCHEME)
    adaptive = cf.simulate(scene, 10, tol=1e-3, scheme=SCHEME, rho_inf=0.9)
    for station, expected in ((rod.start, [40.6910, 0.1578, -3.0316]), (rod.end, [40.4784, 8.5541, 1.6810])):
        assert np.linalg.norm(fixed.position(station)[-1] - expected) < 5e-3
        assert np.linalg.norm(adaptive.position(station)[-1] - expected) < 1e-3 * rod.length
    coarse = cf.simulate(scene, 10, dt=0.05, elements=8, degree=2, scheme=SCHEME, rho_inf=0.9)
    late = coarse.times > 5 - 1e-9
    assert drift(coarse.linear_momentum[late]) < 1e-11
    assert drift(coarse.energy[late]) < 1e-3 and drift(coarse.angular_momentum[late]) < 2e-3


@pytest.mark.parametrize("scheme", [SCHEME, "momentum", "energy"])
def test_a_step_by_half_a_turn_is_none(monkeypatch, scheme):
    """-q also satisfies |q| = 1: where Newton's method converges to it, the step counts as failed."""
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), STIFF)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], velocities=[cf.InitialVelocity(rod, angular=lambda s: (0, s, 0))])
    predicted, flips = Stepper._predicted, []

    def flipped(stepper, h):
        guesses = predicted(stepper, h)
        if len(stepper._past) == 3 and not flips:
            flips.append(h)
            tip = stepper.problem.model.nodal[-1, 3:]
            for guess in guesses:
                guess[tip] *= -1
        return guesses

    plain = cf.simulate(scene, 0.1, dt=0.01, elements=2, degree=2, model="spatial", scheme=scheme)
    monkeypatch.setattr(Stepper, "_predicted", flipped)
    halved = cf.simulate(scene, 0.1, dt=0.01, elements=2, degree=2, model="spatial", scheme=scheme)
    assert flips and halved.steps[-1] == 11
    np.testing.assert_allclose(halved.rotation(rod.end)[-1], plain.rotation(rod.end)[-1], atol=1e-3)


def test_refusals():
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), STIFF)
    scene = cf.Scene([rod])
    for words, settings in {
        "simulate.rho_inf = 0.8: expected None, since scheme = 'momentum' has no such parameter": {"rho_inf": 0.8},
        "simulate.rho_inf = 1.2: expected a number from 0 to 1": {"scheme": SCHEME, "rho_inf": 1.2},
        "simulate.rho_inf = -0.1": {"scheme": SCHEME, "rho_inf": -0.1},
        "simulate.rho_inf = '1'": {"scheme": SCHEME, "rho_inf": "1"},
        "did you mean 'generalised-alpha'?": {"scheme": "generalized-alpha"},
    }.items():
        with pytest.raises(cf.SceneError) as refusal:
            cf.simulate(scene, 1, dt=0.1, **settings)
        assert words in str(refusal.value)


def test_clamps_at_the_end_of_a_step_hold_against_data_of_that_moment():
    """Under generalised-alpha a bed whose force is evaluated from the position loads the clamp as the built-in one."""
    clamp, force, reactions = cf.Clamp(FREE.start), cf.Force(FREE.end, (0, 0, 1.0)), []
    asked = {"dt": 0.0025, "elements": 2, "degree": 2, "model": "spatial", "scheme": "generalised-alpha"}
    for bed in (Lookup, cf.Foundation):
        motion = cf.simulate(cf.Scene([FREE], [clamp], [force, bed(FREE, 3e4)]), 0.02, **asked)
        reactions.append(motion.reaction(clamp)[0][1:, 2])
    np.testing.assert_allclose(*reactions, rtol=1e-4)
