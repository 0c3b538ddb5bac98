"""Damping dissipates the exact energy, and none in a rigid motion."""

import math

import numpy as np
import pytest
from moving_scenes import drift

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
L = 2.0
SECTION = cf.Stiffness((1e5, 1e5), 1e5, (20.0, 20.0), 15.0, mass=2.0, inertia=(1e-4, 1e-4, 2e-4))
BEAM = 1.8751040687119611
MODES = {
    "axial": (math.pi / (2 * L) * math.sqrt(1e5 / 2), lambda s: (math.sin(math.pi * s / (2 * L)), 0, 0), None),
    "torsion": (math.pi / (2 * L) * math.sqrt(15 / 2e-4), None, lambda s: (math.sin(math.pi * s / (2 * L)), 0, 0)),
    "bending": (BEAM**2 * math.sqrt(20 / (2 * L**4)), lambda s: (0, cantilever(BEAM * s / L), 0),
                lambda s: (0, 0, slope(BEAM * s / L))),
}  # fmt: skip


def cantilever(x):
    k = (math.cosh(BEAM) + math.cos(BEAM)) / (math.sinh(BEAM) + math.sin(BEAM))
    return math.cosh(x) - math.cos(x) - k * (math.sinh(x) - math.sin(x))


def slope(x):
    k = (math.cosh(BEAM) + math.cos(BEAM)) / (math.sinh(BEAM) + math.sin(BEAM))
    return BEAM / L * (math.sinh(x) + math.sin(x) - k * (math.cosh(x) - math.cos(x)))


def decay(mode, damping):
    """Rate of the amplitude over ten periods, 40 steps each, 1/s."""
    omega, linear, angular = MODES[mode]
    rod = cf.Rod(cf.Line((0, 0, 0), (L, 0, 0)), SECTION, damping=damping)
    small = 1e-4 * omega

    def scaled(function):
        return (0.0, 0.0, 0.0) if function is None else lambda s: np.multiply(small, function(s))

    given = cf.InitialVelocity(rod, scaled(linear), scaled(angular))
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], velocities=[given])
    period = 2 * math.pi / omega
    history = cf.simulate(scene, 10 * period, dt=period / 40, elements=4, save_every=10 * period)
    assert history.dissipated[-1] == pytest.approx(history.energy[0] - history.energy[-1], rel=1e-4)
    return -math.log(history.energy[-1] / history.energy[0]) / (2 * history.times[-1])


@pytest.mark.parametrize("mode", MODES)
def test_modes_decay_as_theory_says(mode):
    omega = MODES[mode][0]
    time, drag = 0.02 / omega, 0.02 * omega
    assert decay(mode, cf.Damping(time=time)) == pytest.approx(time * omega**2 / 2, rel=1e-2)
    assert decay(mode, cf.Damping(drag=drag)) == pytest.approx(drag / 2, rel=1e-2)
    assert decay(mode, cf.Damping.ratio(0.01, (omega / 2 / math.pi, omega / math.pi))) == pytest.approx(
        0.01 * omega, rel=1e-2
    )


def test_a_section_may_have_its_own_viscosity():
    omega = MODES["torsion"][0]
    damping = cf.Damping(Kt=(0, 0, 0), Jt=(0, 0, 15 * 0.02 / omega))
    assert decay("torsion", damping) == pytest.approx(0.01 * omega, rel=1e-2)
    assert decay("axial", damping) == pytest.approx(0, abs=1e-9)


def test_a_rigid_spin_is_not_damped():
    """After the initial axial vibration has decayed: 20 turns without loss of energy."""
    rod = cf.Rod(cf.Line((0, 0, 0), (L, 0, 0)), SECTION, damping=cf.Damping(time=2e-3))
    scene = cf.Scene([rod], velocities=[cf.InitialVelocity(rod, angular=(0, 2 * math.pi, 0))])
    history = cf.simulate(scene, 25, dt=1 / 40, elements=2, save_every=1)
    late = history.times >= 5
    assert history.dissipated[-1] > 1e-6 * history.energy[-1]
    assert drift(history.angular_momentum) < 1e-9 and drift(history.energy[late]) < 1e-9
    assert history.dissipated[-1] - history.dissipated[late][0] < 1e-9 * history.energy[-1]


def test_drag_takes_momentum():
    rod = cf.Rod(cf.Line((0, 0, 0), (L, 0, 0)), SECTION, damping=cf.Damping(drag=0.5))
    scene = cf.Scene([rod], velocities=[cf.InitialVelocity(rod, (1, 2, 3))])
    history = cf.simulate(scene, 2, dt=0.01, elements=2)
    np.testing.assert_allclose(history.linear_momentum[-1], 4 * np.array([1, 2, 3]) / math.e, rtol=1e-5)


def test_refusals():
    for words, make in {
        "Damping.time = -1": lambda: cf.Damping(time=-1),
        "Damping.drag = nan": lambda: cf.Damping(drag=math.nan),
        "Damping.Jt = (1, 2): expected three numbers": lambda: cf.Damping(Jt=(1, 2)),
        "Damping.Kt = -1": lambda: cf.Damping(Kt=(0, -1, 0)),
        "Damping.ratio.frequencies = 0": lambda: cf.Damping.ratio(0.1, (0, 1)),
        "Damping.ratio.ratio = 1": lambda: cf.Damping.ratio(1, (1, 2)),
        "Rod.damping = 0.1: expected Damping(...)": lambda: cf.Rod(cf.Line((0, 0, 0), (L, 0, 0)), SECTION, damping=0.1),
    }.items():
        with pytest.raises(cf.SceneError) as refusal:
            make()
        assert words in str(refusal.value)


@pytest.mark.parametrize("damping", [cf.Damping(time=5e-3), cf.Damping(Kt=(1e3, 1e3, 2e3), Jt=(2.0, 0.5, 1.0))])
def test_curvatures_are_those_of_the_shape_and_not_moments_over_stiffness(damping):
    """The curvature along a cantilever in a plane sums up to the angle of its end, while damping adds to the moment."""
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), cf.Rectangle(0.01, 0.01), cf.Material(210e9, 0.3, 7850.0), name="rod",
                 damping=damping)  # fmt: skip
    loads = [cf.Force(rod.end, cf.signals.Ramp((0, 0, 1.0), 0, 0.05))]
    history = cf.simulate(cf.Scene([rod], [cf.Clamp(rod.start)], loads), 0.04, dt=2e-3, elements=3)
    fields = history.fields(-1)
    nodes = np.arange(3)[:, None] * history.degree + np.arange(history.degree + 1)

    def summed(curvature):
        return np.linalg.norm(curvature[nodes].swapaxes(1, 2) @ history.rule.lobatto, axis=1).sum() / 3

    angle = history.rotation_angle(rod.end)[-1]
    assert summed(fields["curvature"]) == pytest.approx(angle, rel=2e-3)
    assert summed(fields["moment"] / rod.stiffness.bending[0]) > 1.2 * angle
