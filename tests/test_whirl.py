"""Steady rotation as an equilibrium, and the forward whirl of an eccentric collar in mud, against exact beams."""

import numpy as np
import pytest
from eccentric_collar import AMPLITUDES, CLEARANCE, FIRST_CONTACT, Collar
from moving_scenes import drift
from scipy.optimize import brentq

import cosserat_fenicsx as cf
from cosserat_fenicsx.actions.centrifugal import Centrifugal
from cosserat_fenicsx.actions.fluids import AddedMass, LinearDrag

pytestmark = pytest.mark.serial


@pytest.mark.parametrize("compression", AMPLITUDES)
def test_amplitudes_of_the_steady_whirl(compression):
    """Below the critical speed the heavy side is outside, above it inside."""
    collar = Collar(compression)
    for rpm, expected in AMPLITUDES[compression].items():
        path = collar.whirl(rpm)
        assert collar.deflection(path) == pytest.approx(expected, rel=1e-3)
        assert path.stable[-1] == (expected > 0)  # in the rotating frame, without gyroscopic moments


def test_small_amplitudes_of_the_steady_whirl():
    """A hundredth of the eccentricity, where deflections do not stiffen the collar: the linear beam."""
    collar = Collar(share=0.01)
    for rpm, expected in AMPLITUDES[0.0].items():
        assert collar.deflection(collar.whirl(rpm, elements=16)) == pytest.approx(0.01 * expected, rel=1.5e-5)


def test_the_speed_of_first_contact():
    collar = Collar()
    found = brentq(lambda rpm: collar.deflection(collar.whirl(rpm)) - CLEARANCE, 105.0, 112.0, xtol=1e-2)
    assert found == pytest.approx(FIRST_CONTACT, rel=1e-3)


@pytest.mark.parametrize(
    "rpm, scheme, dt",
    [(93.88469896083186, "momentum", 2e-3), (174.35729807011631, "momentum", 2e-3), (268.2419970309482, "energy", 2e-3),
     (120.70889866392667, "generalised-alpha", 2e-3)],
)  # fmt: skip
def test_a_motion_keeps_the_steady_whirl(rpm, scheme, dt):
    """For one second from the whirl on, with the speed of rotation, the momentum about its axis, and the energy."""
    collar = Collar()
    history = collar.motion(rpm, 1.0, dt, scheme)
    np.testing.assert_allclose(collar.deflections(history), abs(AMPLITUDES[0.0][rpm]), rtol=1e-3)
    x, y, _ = history.position(collar.middle).T
    rate = np.polyfit(history.times, np.unwrap(np.arctan2(y, x)), 1)[0]
    assert rate == pytest.approx(rpm * np.pi / 30, rel=5e-4)
    exact = 1e-4 if scheme == "generalised-alpha" else 1e-9
    assert drift(history.angular_momentum[:, 2:]) < exact
    assert np.abs(history.balance).max() < 10 * exact * history.energy[0]


@pytest.mark.parametrize("scheme", ["momentum", "energy", "generalised-alpha"])
def test_drag_acts_on_the_axis(scheme):
    """From the whirl on it takes the torque c w (integral of the squared deflection), and w times that of energy."""
    collar, rpm, c = Collar(), 93.88469896083186, 283.1
    rate = rpm * np.pi / 30
    s, weights = np.polynomial.legendre.leggauss(8)
    path = collar.whirl(rpm)
    squares = [path.displacement(collar.rod.at(6 * (1 + x)))[-1, 0] ** 2 for x in s]
    history = collar.motion(rpm, 0.004, 2e-4, scheme, more=[LinearDrag(collar.rod, c)])
    torque, slower = c * rate * 6 * weights @ squares, 0.004 * c / collar.mass
    taken = -np.diff(history.angular_momentum[[0, -1], 2])[0] / 0.004
    assert taken == pytest.approx(torque * (1 - slower / 2), rel=3e-4)
    assert -history.work[-1] / 0.004 == pytest.approx(torque * rate * (1 - slower), rel=3e-4)


def test_a_rod_about_one_end():
    """Spun about its clamped end: the tension is rho A w^2 (L^2 - s^2)/2, with a mass m at the end m w^2 L more; planar
    and spatial models agree."""
    section = cf.Stiffness((1e7, 1e7), 1e7, (1e3, 1e3), 1e3, mass=2.0, inertia=(1e-3, 1e-3, 2e-3))
    rod, w, L = cf.Rod(cf.Line((1, 1, 0), (3, 1, 0)), section), 5.0, 2.0
    loads = [Centrifugal((0, 0, w), through=(1, 1, 0)), cf.PointMass(rod.end, 0.5)]
    for model in ("auto", "spatial"):
        path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], loads), [1.0], model=model)
        for s in (0.0, 0.7, 1.5):
            expected = w**2 * (2.0 * (L**2 - s**2) / 2 + 0.5 * L)
            assert path.force(rod.at(s))[-1, 0] == pytest.approx(expected, rel=1e-4)
        assert path.model == ("planar" if model == "auto" else "spatial")


def test_what_is_refused():
    collar = Collar()
    turning = Centrifugal((0, 0, 3.0))
    scene = cf.Scene([collar.rod], [cf.Clamp(collar.rod.start)], [turning])
    for asked in (lambda: cf.simulate(scene, 1.0, dt=0.1), lambda: cf.modes(scene)):
        with pytest.raises(cf.SceneError, match=r"loads\[0\] \(Centrifugal\) stands for the inertia of a motion"):
            asked()
    tilted = cf.Scene([collar.rod], [cf.Clamp(collar.rod.start)],
                      [Centrifugal((1.0, 0, 3.0)), AddedMass(collar.rod, 1.0)])  # fmt: skip
    with pytest.raises(cf.SceneError, match=r"expected one along rod 'collar', or AddedMass\(axial=True\)"):
        cf.solve(tilted, [1.0])
    bare = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Stiffness((1, 1), 1, (1, 1), 1, mass=1.0), name="bare")
    with pytest.raises(
        cf.SceneError, match="Rod 'bare': Stiffness.inertia = None: expected a value, which Centrifugal"
    ):
        cf.Scene([bare], loads=[turning])
    with pytest.raises(cf.SceneError, match="Centrifugal.rate = .*expected an angular velocity that is not zero"):
        Centrifugal((0, 0, 0))
