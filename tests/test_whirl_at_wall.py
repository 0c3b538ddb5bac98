"""Backward whirl of a collar against the wall of its hole: rolling, its threshold in friction, bouncing."""

import numpy as np
import pytest
from rolling_collar import ARM, AXIS, CLEARANCE, COLLAR, LENGTH, collar, rolling, whirl

import cosserat_fenicsx as cf
from cosserat_fenicsx.actions.walls import HoleWall

pytestmark = [pytest.mark.slow, pytest.mark.serial]
SPIN = 100 * np.pi / 30
MESH = {"elements": 8, "degree": 2}


@pytest.mark.parametrize(("stiffness", "dt", "scheme"), [
    (1e10, 1e-3, "momentum"), (1e10, 1e-3, "energy"), (1e10, 1e-3, "generalised-alpha"), (1e8, 2e-3, "momentum"),
])  # fmt: skip
def test_it_rolls_backward_without_slip(stiffness, dt, scheme):
    """The ratio of the rates is -contact radius/distance from the axis, which is the clearance for a rigid wall; no
    step is halved."""
    rod, scene, start, rate = rolling(SPIN, stiffness, 0.3)
    history = cf.simulate(scene, 0.6, dt=dt, scheme=scheme, start=start, **MESH)
    assert history.steps[-1] == len(history) - 1 == round(0.6 / dt)
    angle, radius, spin = whirl(history, rod)
    late = history.times > 0.2
    turning = np.polyfit(history.times[late], angle[late], 1)[0]
    assert turning / spin[late].mean() == pytest.approx(-ARM / radius[late].mean(), rel=1e-3)
    assert turning == pytest.approx(rate, rel=2e-3)
    if stiffness == 1e10:
        assert turning / spin[late].mean() == pytest.approx(COLLAR["rolling_ratio"], rel=1e-3)
        force = stiffness * (radius[late].mean() - CLEARANCE)
        assert force == pytest.approx(COLLAR["rolling_force"], rel=0.02)
    assert np.abs(history.balance[-1]) < 1e-5 * history.dissipated[-1] or scheme == "generalised-alpha"


@pytest.mark.parametrize(("share", "rolls"), [(0.95, False), (1.1, True)])
def test_rolling_needs_the_friction_that_theory_says(share, rolls):
    """From a rolling start: it keeps rolling, or slips all the time and slows down."""
    friction = share * COLLAR["rolling_friction"]
    rod, scene, start, rate = rolling(SPIN, 1e9, friction)
    history = cf.simulate(scene, 1.5, dt=1e-3, start=start, **MESH)
    angle, _, spin = whirl(history, rod)
    late = history.times > 1.2
    turning = np.polyfit(history.times[late], angle[late], 1)[0]
    if rolls:
        assert turning == pytest.approx(rate, rel=5e-3)
    else:
        assert turning > 0.97 * rate
        assert turning / spin[late].mean() > 0.97 * COLLAR["rolling_ratio"]


def test_the_energy_of_a_bouncing_collar_stays_for_thousands_of_steps():
    rod = collar(drag=0.0)
    wall = HoleWall(rod, AXIS, CLEARANCE + ARM, ARM, stiffness=1e8)

    def linear(s):
        return 0.8 * np.sin(np.pi * s / LENGTH), 0.2 * np.sin(np.pi * s / LENGTH), 0.0

    start = cf.InitialVelocity(rod, linear=linear, angular=lambda s: (0.0, 0.0, 0.0))
    scene = cf.Scene([rod], [cf.Pin(rod.start), cf.Pin(rod.end)], [wall], velocities=[start])
    history = cf.simulate(scene, 2.5, dt=1e-3, scheme="energy", save_every=0.05, **MESH)
    assert history.steps[-1] == 2500
    assert (-history.work).max() > 0.1 * history.kinetic[0]  # it touches
    assert np.abs(history.balance).max() < 1e-8 * history.kinetic[0]
