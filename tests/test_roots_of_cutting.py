"""Roots of a bit that cuts where the delay is long beside the time of a wave."""

import numpy as np
import pytest
from scipy.optimize import brentq
from torsion_scenes import string

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.chain import passing_time, time_of_impact
from cosserat_fenicsx.drilling.elements import AxialTorsional
from cosserat_fenicsx.drilling.linear.roots import LumpedCutting

pytestmark = [pytest.mark.serial, pytest.mark.once]

A, EPSILON, ZETA, BLADES, WEIGHT = 0.108, 60e6, 0.6, 4, 5e4


@pytest.mark.parametrize(("length", "speed", "up_to"), [(50.0, 3.0, 30.0), (300.0, 1.0, 10.0), (2000.0, 0.2, 1.0)])
@pytest.mark.parametrize("hook", [cf.drilling.Hook(), None], ids=["held", "load stays"])
def test_short_strings_and_slow_rotation(length, speed, up_to, hook):
    """Every root fulfils (s Za + ka E)(s Zt - kt rho E) + ka kt rho E^2 = 0 with Z coth(s L/c) of a uniform string;
    with Z tanh(s L/c) along the axis where the load of the hook stays the same."""
    bit = cf.drilling.BitOnRock(cf.drilling.Cutting(A, EPSILON, ZETA, BLADES), weight=WEIGHT, inertia=1.0, mass=10.0)
    scene = cf.drilling.Drilling(string((length, 0.127, 0.1)), cf.drilling.TopDrive(1.0), bit, hook=hook)
    roots = cf.drilling.stability(scene, [speed], up_to=up_to).roots[0, 0]
    (part,) = scene.segments
    ka, kt = BLADES * ZETA * EPSILON * A, BLADES * EPSILON * A**2 / 2
    rho, tau = WEIGHT / ka * BLADES / (2 * np.pi), 2 * np.pi / (BLADES * speed)
    s, E = roots, 1 - np.exp(-roots * tau)
    reflected = np.tanh(s * length / part.axial_speed)
    Za = part.axial_impedance * (1 / reflected if hook else reflected) + 10.0 * s
    Zt = part.torsional_impedance / np.tanh(s * length / part.torsional_speed) + 1.0 * s
    terms = s * Za * s * Zt, -s * Za * kt * rho * E, s * Zt * ka * E
    assert len(roots) > 4 and np.isfinite(roots).all()
    assert (np.abs(sum(terms)) < 1e-9 * np.max(np.abs(terms), axis=0)).all()


def test_the_lumped_bit_at_slow_rotation():
    lumped = LumpedCutting(13.9, 4, penetration=0.5, axial_damping=0.0, torsional_damping=0.1)
    roots = lumped.roots(0.05, up_to=2.0)
    rho, E = 0.5 / 0.05, 1 - np.exp(-roots * 2 * np.pi / (4 * 0.05))
    axial, torsional = roots**2, roots**2 + 0.2 * roots + 1
    terms = axial * torsional, 4 * 13.9 * E * torsional, -4 * rho * E * axial
    assert len(roots) > 4 and (np.abs(sum(terms)) < 1e-9 * np.max(np.abs(terms), axis=0)).all()


@pytest.mark.parametrize("penetration", [0.0, 0.5])
def test_the_slope_of_the_lumped_equation(penetration):
    """A wrong one would still give the roots, only later."""
    more = {"axial_frequency": 0.8, "axial_damping": 0.15, "torsional_damping": 0.1}
    equation = LumpedCutting(13.9, 4, penetration=penetration, **more)._equation(3.0)
    s, h = np.array([0.3 + 0.4j, -0.2 + 2j, 1.5 - 0.7j]), 1e-5
    (ahead, _), (behind, _) = equation(s + h), equation(s - h)
    np.testing.assert_allclose(equation(s)[1], (ahead - behind) / (2 * h), rtol=1e-8)


@pytest.mark.parametrize("bits", [[], [cf.well.Bit("8.5 in", body_diameter="5 in", length=0.05)]])
def test_no_bounce_by_elements_that_are_too_long(bits):
    """A step of 0.1 % in the speed of 4.8 km of pipe: 1000 and 2000 elements agree that the weight on bit leaves 50 kN
    by 17 N at most within 5 s. With 250 the bit bounced, in waves as short as an element; with a short lowest element
    by velocities that alternate from step to step."""
    pipe = cf.well.DrillString([*bits, cf.well.Collar(4800.0, outer_diameter=0.127, inner_diameter=0.10861)])
    law = cf.drilling.Cutting(a=0.108, epsilon=60e6, zeta=0.6, blades=4)
    scene = cf.drilling.Drilling(
        pipe, cf.drilling.TopDrive(cf.signals.Table([0.0, 0.99, 1.0], [[10.0], [10.0], [10.01]])),
        cf.drilling.BitOnRock(law), hook=cf.drilling.Hook(speed=-law.rate(50e3, 10.0)), start="steady",
        drag=cf.drilling.ViscousDrag(torsion=0.3, axial=0.3),
    )  # fmt: skip
    motion = cf.drilling.simulate(scene, 5.0, progress=False)
    assert 3.0 < np.abs(motion.weight_on_bit - 50e3).max() < 20.0
    assert not any("APPROXIMATE" in why for why in motion.why)
    found = AxialTorsional(scene, elements=250)
    assert "too long for the bit, which answers within 0.0088 s" in found.why[-1]


@pytest.mark.parametrize(("lower", "mass"), [
    ([], 0.0), ([(2.0, 0.127), (3.0, 0.127)], 0.0), ([(0.3, 0.2)], 0.0), ([(0.3, 0.2), (1.5, 0.16)], 20.0),
    ([(0.3, 0.2)], 900.0), ([(0.05, 0.07)], 0.0),
])  # fmt: skip
def test_rock_stops_a_bit_as_the_string_behind_short_sections(lower, mass):
    """Closed form: m x'' + Z (x' - v) + k x = 0 after an impact at the speed v, with the mass of short sections below
    the pipe and the impedance of the pipe, until the speed is v/e; with Z of the lowest section a bit of 0.3 m answered
    ten times as late. What is cut into parts is still one."""
    parts = [cf.well.Collar(length, outer_diameter=d, inner_diameter=0.05) for length, d in lower]
    pipe = cf.well.Collar(2000.0, outer_diameter=0.127, inner_diameter=0.10861)
    alike = [(length, d) == (length, 0.127) for length, d in lower]
    parts = [cf.well.Collar(part.length, outer_diameter=0.127, inner_diameter=0.10861) if same else part
             for part, same in zip(parts, alike, strict=True)]  # fmt: skip
    k = 1e8
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(0.0, 0.0), WEIGHT, mass=mass, rock_stiffness=k)
    scene = cf.drilling.Drilling(cf.well.DrillString([*parts, pipe]), cf.drilling.TopDrive(10.0), bit)
    Z = scene.segments[0].axial_impedance
    m = mass + sum(x.rhoA * x.length for x, same in zip(scene.segments[:0:-1], alike, strict=True) if not same)
    if m == 0:
        assert time_of_impact(scene) == pytest.approx(Z / k, rel=1e-12)
        return
    roots = np.roots([m, Z, k])
    amplitudes = np.linalg.solve([[1, 1], roots], [-Z / k, 1.0])  # of z = x - Z v/k, v = 1
    stopped = brentq(lambda t: float((amplitudes * roots * np.exp(roots * t)).sum().real) - np.exp(-1), 0, 5 * Z / k)
    assert 0.6 * stopped < time_of_impact(scene) < 1.1 * stopped
    depths = np.array([0.0, 1000.0, *np.cumsum([x.length for x in scene.segments])])
    met = passing_time(scene, depths, time_of_impact(scene))
    assert met == pytest.approx(1000 / scene.segments[0].axial_speed)  # the pipe, not the short elements below it
