"""Derivatives by numbers of a scene on any number of processes: powers that are known."""

import numpy as np
import pytest

import cosserat_fenicsx as cf

pytestmark = pytest.mark.ranks

E, DIAMETER = "rods.column.material.E", "rods.column.section.diameter"


def column(*loads):
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(0.2), cf.Material(E=210e9, nu=0.3), name="column")
    return cf.Scene([rod], [cf.Clamp(rod.start)], [load(rod) for load in loads])


@pytest.mark.parametrize("model", ["determinate", "planar", "spatial"])
def test_a_bent_column(model):
    """m = EI kappa: a moment bends to an arc, whose angle is M L/EI."""
    path = cf.solve(column(lambda rod: cf.Moment(rod.end, (0, 1e6, 0))), [1.0], model=model, elements=6)
    found = path.sensitivity(lambda path: path.rotation_angle("column.end"), [E, DIAMETER, "loads[0].moment[1]"])
    assert found.value == pytest.approx(1e6 * 20 / (210e9 * np.pi * 0.2**4 / 64), rel=1e-8)
    assert [found.relative(name)[0] for name in found] == pytest.approx([-1, -4, 1], rel=1e-8)


def test_critical_loads():
    scene = column(lambda rod: cf.Force(rod.end, (0, 0, -1e5)))
    found = cf.buckling(scene, 2, elements=6).sensitivity([E])
    assert found.relative(E) == pytest.approx([1.0, 1.0], rel=1e-8)
    path = cf.solve(scene, (0.0, 5.0), model="spatial", elements=6)
    assert path.sensitivity(path.events[0], [E]).relative(E) == pytest.approx(1.0, rel=1e-8)
