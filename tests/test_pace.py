"""What sets in late, at once or with a kink: adaptive steps see it, and driven stations move as they are driven."""

import numpy as np
import pytest

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial


@pytest.mark.parametrize(
    "signal", [cf.Ramp((0, 0, 2.0), 50, 50.5), lambda t: (0, 0, 1 + np.tanh(4 * (t - 50)))], ids=["ramp", "tanh"]
)
def test_what_sets_in_after_a_rest_is_seen(signal):
    section = cf.Stiffness((1e6, 1e6), 1e6, (100, 100), 100, mass=1.0, inertia=(1e-3, 1e-3, 2e-3))
    rod = cf.Rod(cf.Line((0, 0, 0), (5, 0, 0)), section)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, signal)])
    found, fine = cf.simulate(scene, 55.0, tol=1e-3), cf.simulate(scene, 55.0, dt=0.02)
    there = np.array([np.interp(found.times, fine.times, x) for x in fine.position(rod.end).T]).T
    assert np.linalg.norm(found.position(rod.end) - there, axis=1).max() < 1e-3 * rod.length
    assert np.diff(found.times).max() > 0.5  # nothing is resolved where nothing happens


@pytest.mark.parametrize("scheme", ["momentum", "energy"])
@pytest.mark.parametrize("start", [0.0, 0.2])
def test_kinks_of_a_prescribed_motion(scheme, start):
    """The driven end has the speed of its motion; what changes its momentum at once is work of the support."""
    section = cf.Stiffness((1e4, 1e4), 1e4, (50, 50), 50, mass=1.0, inertia=(1e-2, 1e-2, 2e-2))
    rod = cf.Rod(cf.Line((0, 0, 0), (2, 0, 0)), section)
    drive = cf.Ramp((0, 0, 0.5), start, 1.0)
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
