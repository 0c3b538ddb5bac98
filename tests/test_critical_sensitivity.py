"""Derivatives of critical loads: of linear buckling, of bifurcations and of limit points."""

import numpy as np
import pytest
from path_scenes import shallow_arch

import cosserat_fenicsx as cf
from cosserat_fenicsx.numerics import PLACES, derivative

pytestmark = pytest.mark.serial
E, DIAMETER, LOAD = "rods.column.material.E", "rods.column.section.diameter", "loads[0].force[2]"


def euler(*, E=210e9, diameter=0.2, length=20.0, loads=lambda rod: ()):
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, length)), cf.Circle(diameter), cf.Material(E=E, nu=0.3), name="column")
    return rod, cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -1e5)), *loads(rod)])


def test_buckling_loads_of_a_column():
    """P (1 + P/GA) = P_Euler: P is in proportion to E, nearly to d^4 and L^-2."""
    rod, scene = euler()
    found = cf.buckling(scene, 2).sensitivity([E, DIAMETER, LOAD, "rods.column.curve.end[2]"])
    P, GA = found.value[0] * 1e5, rod.stiffness.shear[0]
    x = P / GA / (1 + P / GA)
    exact = 1.0, (4 + 2 * x) / (1 + x), -1.0, -2 / (1 + x)
    for name, power in zip(found, exact, strict=True):
        assert found.relative(name) == pytest.approx([power] * 2, rel=1e-8)
        assert found.error[name] == pytest.approx(0, abs=1e-8 * abs(found[name]).max())
    spread = cf.buckling(scene).uncertainty({E: 0.02 * 210e9, DIAMETER: 0.01 * 0.2})
    assert spread.standard_deviation[0] / P * 1e5 == pytest.approx(np.hypot(0.02, 0.01 * exact[1]), rel=1e-6)


def test_a_foundation_carries_a_part_of_the_buckling_load():
    """Of a pinned column, P_cr = P_Euler + k (L/pi)^2 in its first mode without shear."""

    def scene(k):
        stiff = cf.Stiffness(shear=(np.inf,) * 2, axial=np.inf, bending=(1e6, 1e6), torsion=1e6)
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 10.0)), stiff, name="column")
        held = [cf.Hinge(rod.start, (0, 1, 0)), cf.Roller(rod.end, (1, 0, 0)), cf.Roller(rod.end, (0, 1, 0))]
        return cf.Scene([rod], held, [cf.Force(rod.end, (0, 0, -1e4)), cf.Foundation(rod, k, direction=(1, 0, 0)),
                                      cf.Foundation(rod, 10 * k, direction=(0, 1, 0))])  # fmt: skip

    found = cf.buckling(scene(1e3), elements=8).sensitivity(["loads[1].stiffness", "loads[2].stiffness"])
    assert found["loads[1].stiffness"][0] * 1e4 == pytest.approx((10 / np.pi) ** 2, rel=1e-5)
    assert abs(found["loads[2].stiffness"][0]) * 1e4 < 1e-5


def test_equal_buckling_loads_that_part_are_refused():
    stiff = cf.Stiffness(shear=(1e9, 1e9), axial=1e9, bending=(1e6, 1e6), torsion=1e6)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), stiff, name="column")
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -1e5))])
    with pytest.raises(cf.SceneError, match="it separates the critical load factors 0 and 1"):
        cf.buckling(scene, 2).sensitivity(["rods.column.section.bending[0]"])
    path = cf.solve(scene, (0.0, 1.0), model="spatial", elements=4)
    with pytest.raises(cf.SceneError, match="it separates the two bifurcations"):
        path.sensitivity(path.events[0], ["rods.column.section.bending[0]"])
    follower = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.FollowerForce(rod.end, (0, 0, -1e5))])
    with pytest.raises(cf.SceneError, match="have a potential"):
        cf.buckling(follower).sensitivity([LOAD])


def test_bifurcation_of_a_column():
    """P (1 + P/GA - P/EA) = P_Euler of the column that shortens and shears before it buckles."""
    rod, scene = euler()
    path = cf.solve(scene, (0.0, 5.0), model="spatial", elements=8)
    found = path.sensitivity(path.events[0], [E, DIAMETER, LOAD, "rods.column.curve.end[2]"])
    P = path.events[0].load_factor * 1e5
    y = P * (1 / rod.stiffness.shear[0] - 1 / rod.stiffness.axial)
    y /= 1 + y
    for name, power in zip(found, (1.0, (4 + 2 * y) / (1 + y), -1.0, -2 / (1 + y)), strict=True):
        assert found.relative(name) == pytest.approx(power, rel=1e-8)
    with pytest.raises(cf.SceneError, match="'loads.0..force.0.': it is an imperfection, with which the bifurcation disappears"):
        path.sensitivity(path.events[0], ["loads[0].force[0]"])
    again = cf.solve(scene, (0.0, 5.0), model="spatial", elements=8)
    with pytest.raises(cf.SceneError, match="the event does not belong to this path"):
        path.sensitivity(again.events[0], [E])
    spread = path.uncertainty({E: 0.02 * 210e9}, path.events[0])
    assert spread.standard_deviation == pytest.approx(0.02 * path.events[0].load_factor, rel=1e-8)


def arch(stiffness=1.0, radius=133.114):
    """`path_scenes.shallow_arch` with other stiffnesses, or another radius of the same span."""
    given = shallow_arch()[0].section
    scaled = {x: getattr(given, x) for x in ("shear", "axial", "bending", "torsion")}
    section = cf.Stiffness(**{x: tuple(stiffness * np.array(v)) if np.ndim(v) else stiffness * v
                              for x, v in scaled.items()})  # fmt: skip
    half = np.arcsin(17.0 / radius)
    curve = cf.Arc((17.0, -radius * np.cos(half), 0), (0, 0, 0), -2 * half, axis=(0, 0, 1), d1=(0, 0, 1))
    rod = cf.Rod(curve, section, name="arch")
    loads = [cf.Force(rod.at(rod.length / 2), (0, -1.0, 0))]
    return cf.Scene([rod], [cf.Clamp(rod.start), cf.Clamp(rod.end)], loads)


@pytest.mark.slow
def test_limit_points_and_bifurcations_of_an_arch():
    """All are in proportion to the stiffness; by the radius, as by differences of the first limit load."""
    given = {"elements": 8, "model": "spatial", "control": "arc"}
    path = cf.solve(arch(), (0.0, 40.0), **given)
    parameters = [cf.Parameter("stiffness", 1.0, arch), cf.Parameter("radius", 133.114, lambda r: arch(radius=r), "m")]
    assert [event.kind for event in path.events] == ["limit", "bifurcation", "bifurcation", "limit"]
    for event, tol in zip(path.events, (1e-7, 1e-5, 1e-6, 1e-7), strict=True):
        found = path.sensitivity(event, parameters)
        assert found["stiffness"] == pytest.approx(event.load_factor, rel=tol)
    step = 2e-3 * 133.114
    near = [cf.solve(arch(radius=133.114 + k * step), (0.0, 40.0), **given).events[0].load_factor for k in PLACES]
    by, _ = derivative(near, step)
    assert path.sensitivity(path.events[0], parameters)["radius"] == pytest.approx(by, rel=1e-6)
