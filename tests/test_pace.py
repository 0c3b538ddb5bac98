"""Loads and prescribed motions that start late, suddenly or with a kink are resolved by adaptive steps."""

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.dynamics.pace import Adaptive, Resolution

pytestmark = pytest.mark.serial


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
    section = cf.Stiffness((1e3, 1e3), 1e3, (10, 10), 10, mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), section)
    load = cf.signals.Sine((0, A * w**2, 0), f, phase=np.pi / 2)
    load = cf.LineForce(rod, (lambda t: (0, A * w**2 * np.cos(w * t), 0)) if function else load)
    history = cf.simulate(
        cf.Scene([rod], [], [load]), duration, tol=tol, scheme=scheme, elements=1, degree=2, save_every=duration / 9.7
    )
    exact = A * (1 - np.cos(w * history.times))
    assert np.abs(history.displacement(rod.end)[:, 1] - exact).max() < tol * rod.length
    assert history.steps[-1] < 40 * f * duration


def test_a_load_that_moves_nothing_costs_no_steps():
    section = cf.Stiffness((1e3, 1e3), 1e3, (10, 10), 10, mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), section)
    scene = cf.Scene([rod], [], [cf.Force(rod.end, cf.signals.Sine((0, 1e-9, 0), 20.0))])
    assert cf.simulate(scene, 20.0, elements=1, degree=2).steps[-1] < 250


@pytest.mark.parametrize("signal", [cf.signals.Sine((0, 1.0, 0), 2.0), lambda t: (0, np.sin(4 * np.pi * t), 0)])
def test_a_fixed_step_that_does_not_follow_a_load_is_told(signal):
    section = cf.Stiffness((1e3, 1e3), 1e3, (10, 10), 10, mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), section)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, signal)])
    told = {
        steps: "Force.force changes faster"
        in " ".join(cf.simulate(scene, 1.0, dt=0.5 / steps, elements=1, degree=2).why)
        for steps in (1, 6, 14)
    }
    assert told == {1: True, 6: True, 14: False}


def test_straight_signals_are_not_told():
    section = cf.Stiffness((1e3, 1e3), 1e3, (10, 10), 10, mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), section)
    loads = [
        cf.Force(rod.end, cf.signals.Triangle((0, 0.01, 0), 0.13, 0.2, 0.31)),
        cf.Moment(rod.end, cf.signals.Step((0, 0, 0.01), 0.4)),
    ]
    history = cf.simulate(cf.Scene([rod], [cf.Clamp(rod.start)], loads), 0.5, dt=0.1, elements=1, degree=2)
    assert "faster than steps" not in " ".join(history.why)


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
    section = cf.Stiffness((1e3, 1e3), 1e3, (10, 10), 10, mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), section)
    noise = cf.LineForce(rod, lambda t: (0, np.sin(1e9 * t), 0))
    monkeypatch.setattr(Adaptive, "_MANY", 300)
    with pytest.raises(cf.NotConverged, match="steps stay as short as .*jumps") as caught:
        cf.simulate(cf.Scene([rod], [], [noise]), 10.0, elements=1, degree=2, save_every=1.0)
    assert len(caught.value.path) > 1


def test_what_steps_have_seen_of_loads_is_remembered():
    """A motion continued from a checkpoint takes the same steps."""
    section = cf.Stiffness((1e3, 1e3), 1e3, (10, 10), 10, mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), section)
    load = cf.Force(rod.end, lambda t: (0, np.exp(-((t - 3.3) ** 2) * 100), 0), jumps=(6.0,))
    first, second = (Resolution(cf.Scene([rod], [], [load]), 10.0, 1e-3, 1.0, 1 / 24) for _ in range(2))
    for t in (0.5, 3.2, 3.25):
        first.longest(t, 0.1)
    second.recall(first.memory())
    steps = [first.longest(t, 0.1) for t in (3.3, 3.5, 7.0)]
    assert steps == [second.longest(t, 0.1) for t in (3.3, 3.5, 7.0)]
    assert steps[0] < 0.1
