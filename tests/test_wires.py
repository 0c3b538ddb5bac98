"""Taut wires under their weight: very soft in bending, under loads that are large multiples of EI/L^2."""

import numpy as np
import pytest
from conftest import column
from scipy.optimize import brentq

import cosserat_fenicsx as cf

STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)


def wire(diameter, move, length=110.0):
    """A steel wire under its weight, whose end is moved towards its start by `move`, m."""
    rod = cf.Rod(cf.Line((0, 0, 0), (length, 0, 0)), cf.Circle(diameter), STEEL)
    supports = [cf.Hinge(rod.start, (0, 1, 0)), cf.Prescribed(rod.end, displacement=(-move, 0, 0))]
    return rod, cf.Scene([rod], supports, [cf.Weight()])


@pytest.mark.parametrize(("diameter", "move"), [(0.005, 10.0), (0.005, 1.0), (0.001, 10.0)])
def test_a_wire_drawn_straight(diameter, move):
    """Its sag is that of an elastic catenary, up to the effect of EI, with the default steps."""
    rod, scene = wire(diameter, move)
    path = cf.solve(scene, [1.0], tol=1e-5)
    w, EA = 9.81 * rod.stiffness.mass, rod.stiffness.axial
    half = lambda H: 55 * H / EA + H / w * np.arcsinh(55 * w / H)  # noqa: E731
    H = brentq(lambda H: 2 * half(H) - 110 + move, 1e-3 * w, 1e5 * w)
    sag = w * 55**2 / (2 * EA) + H / w * (np.hypot(1, 55 * w / H) - 1)
    assert path.stable.all() and path.displacement(rod.at(55.0))[0, 2] == pytest.approx(-sag, rel=5e-5)


@pytest.mark.parametrize("control", ["load", "arc"])
def test_what_is_advised_helps(control):
    """The first step must be smaller than allowed; and there is no warning about the units."""
    _, scene = wire(0.005, 10.0)
    steps = cf.StepControl(smallest=0.5)
    with pytest.raises(cf.NotConverged) as refused:
        cf.solve(scene, [1.0], model="spatial", elements=16, steps=steps, control=control)
    assert "units" not in str(refused.value)
    if control == "arc":
        assert "Try control='auto'" in str(refused.value)
        return
    assert "by steps=StepControl(smallest=0.0005)" in str(refused.value)
    path = cf.solve(scene, [1.0], model="spatial", elements=16, steps=cf.StepControl(smallest=0.0005), control=control)
    assert path.stable.all()


@pytest.mark.serial
def test_loads_beyond_ea_are_asked_about():
    _, scene = column()
    with pytest.raises(cf.NotConverged, match="times EA there, which no rod bears: are the units those of SI"):
        cf.solve(scene, [1e9], elements=2)
