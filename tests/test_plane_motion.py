"""Motions in a plane: the planar model gives the results of the
spatial one, and refuses scenes that leave the plane."""

import numpy as np
import pytest
from moving_scenes import drift, flying_in_a_plane, flying_in_space

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
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
    assert cf.simulate(scene, 0.1, dt=0.1).model == "spatial"
    with pytest.raises(
        cf.SceneError, match=r"model = 'planar': load 2 \(Moment at spaghetti.start\) does not turn in the plane"
    ):
        cf.simulate(scene, 0.1, dt=0.1, model="planar")
    rod, flat = flying_in_a_plane()
    assert cf.simulate(flat, 0.1, dt=0.1, scheme="energy").model == "spatial"
    with pytest.raises(cf.SceneError, match="the scheme 'energy' has no planar model"):
        cf.simulate(flat, 0.1, dt=0.1, scheme="energy", model="planar")
    with pytest.raises(cf.SceneError, match="model = 'plane': did you mean 'planar'"):
        cf.simulate(flat, 0.1, dt=0.1, model="plane")
    out = cf.Scene([rod], velocities=[cf.InitialVelocity(rod, (0, 0, 1), (0, 0, 1))], loads=flat.loads)
    assert cf.simulate(out, 0.1, dt=0.1).why[0] == "the start leaves the plane of the rods"
    kick = cf.Force(
        rod.end, lambda t: (1, 0, 1.0 if 0.4499 < t < 0.4501 else 0)
    )  # too short for the sampling before the motion
    with pytest.raises(
        cf.SceneError, match="Force at spaghetti.end leaves the plane at t = 0.45 s: expected model = 'spatial'"
    ):
        cf.simulate(cf.Scene([rod], loads=[*flat.loads, kick]), 0.6, dt=0.3)
