"""Fluids in columns: buoyancy, true tension, pressures, against closed forms and against one fluid."""

import numpy as np
import pytest

import cosserat_fenicsx as cf

pytestmark = [pytest.mark.serial, pytest.mark.once]
W, G = cf.well, 9.80665
PIPE = W.DrillPipe(outer_diameter=0.127, inner_diameter=0.1086)
COLLAR = W.Collar(200.0, outer_diameter=0.1651, inner_diameter=0.0714)
TWO = [(1300.0, 1200.0), (3000.0, 1600.0)], 1100.0
THREE = [(700.0, 1200.0), (1300.0, 1500.0), (3000.0, 1900.0)], [(1200.0, 1000.0), (2300.0, 1600.0), (3000.0, 1100.0)]


def hole_of(md, inclinations, friction=0.0):
    path = W.WellPath.from_survey(md, inclinations, [0] * len(md), True)
    return W.Borehole(path, [W.HoleSection(md[-1], 0.25, friction)])


def pressure(fluids, path, md):
    """Pa, of columns [(lower end, density)] on top of each other."""
    columns = fluids if isinstance(fluids, list) else [(np.inf, fluids)]
    ends = np.clip([0.0, *(end for end, _ in columns[:-1]), np.inf], 0.0, md)
    depths = [path.position(end)[2] for end in ends]
    return G * float(np.diff(depths) @ [density for _, density in columns])


def circle(diameter):
    return np.pi / 4 * diameter**2


@pytest.mark.parametrize("outside, inside", [TWO, THREE])
def test_true_tension_is_the_weight_of_the_steel_and_the_pressures_on_ends_and_shoulders(outside, inside, truth):
    """Neither buoyancy nor effective tension is in the closed form."""
    hole = hole_of([0, 1000, 1500, 3000], [0, 0, 60, 60])
    string, mud = W.DrillString([COLLAR, PIPE]), W.Mud(outside, inside=inside)
    answer = W.torque_and_drag(hole, string, W.Static(), mud=mud, model="soft")
    path, shoulder, bit = hole.path, 2800.0, 3000.0
    below, above = ((circle(x.outer_diameter), circle(x.inner_diameter)) for x in (COLLAR, PIPE))
    at_bit, at_shoulder = ([pressure(x, path, md) for x in (outside, inside)] for md in (bit, shoulder))
    tension = at_bit[1] * below[1] - at_bit[0] * below[0]  # a closed lower end
    truth("fluids in columns: true tension at the bit, of the pressures there", answer.true_tension[-1], tension, 1e-10)
    tension += COLLAR.mass * G * (path.position(bit)[2] - path.position(shoulder)[2])
    tension += at_shoulder[0] * (below[0] - above[0]) - at_shoulder[1] * (below[1] - above[1])
    tension += PIPE.mass * G * path.position(shoulder)[2]
    # no pressure acts at the surface
    truth("fluids in columns: hook load, of steel and pressures on its ends", answer.hook_load, tension, 1e-10)
    assert answer.true_tension[0] == answer.hook_load
    # effective tension does not jump where a fluid or a section does; pressures of burst and collapse
    jump = np.diff(answer.tension)[np.diff(answer.md) == 0]
    assert len(jump) >= len(mud.interfaces) and np.abs(jump).max() < 1e-9 * tension
    i = int(np.searchsorted(answer.md, 2000.0))
    more = [pressure(x, path, answer.md[i]) for x in (inside, outside)]
    use, pipe = answer.utilisation("E75"), W.PipeStrength(PIPE, "E75")
    assert use.burst[i] == pytest.approx(max(more[0] - more[1], 0.0) / pipe.burst, rel=1e-10)
    slender = 2 * PIPE.outer_diameter / (PIPE.outer_diameter - PIPE.inner_diameter)
    excess = more[1] - (1 - 2 / slender) * more[0]
    assert use.collapse[i] == pytest.approx(excess / pipe.collapse(answer.tension[i]), rel=1e-10)


def slanted(mud, model, friction=0.25, **more):
    """A pipe pulled out of a straight hole, and the closed form of its hook load."""
    hole, slope = hole_of([0, 300], [50, 50], friction), np.radians(50.0)
    answer = W.torque_and_drag(hole, W.DrillString([PIPE]), W.TripOut(), mud=mud, model=model, **more)
    ends = np.unique([0.0, *mud.interfaces, 300.0])
    outside, inside = mud.densities((ends[1:] + ends[:-1]) / 2)
    bore, whole = circle(PIPE.inner_diameter), circle(PIPE.outer_diameter)
    weight = G * (PIPE.mass + inside * bore - outside * whole) @ np.diff(ends)
    return answer, weight * (np.cos(slope) + friction * np.sin(slope))


def test_friction_counts_the_weight_in_each_fluid():
    fluids = [[(80.0, 1000.0), (250.0, 2000.0), (300.0, 1400.0)], [(170.0, 1000.0), (300.0, 1500.0)]]
    answer, exact = slanted(W.Mud(*fluids), "soft")
    assert answer.hook_load == pytest.approx(exact, rel=1e-10)
    # the rod comes to the wall below the surface, on whose axis it hangs: without friction it bears the same
    rod, exact = slanted(W.Mud(*fluids), "rod", 0.0, tol=1e-3)
    assert rod.hook_load == pytest.approx(exact, rel=1e-10) and abs(rod.drag) < 1e-3 * exact
    assert rod.true_tension[0] == pytest.approx(rod.hook_load, rel=1e-12)
    with pytest.raises(cf.SceneError, match="'mud.density' of a string: it is rows of depth .* one density"):
        answer.uncertainty({"mud.density": 20.0})


def test_equal_columns_are_one_fluid_to_the_last_digit():
    columns = W.Mud([(80.0, 1200.0), (300.0, 1200.0)], inside=[(100.0, 1200.0), (200.0, 1200.0)])
    assert columns == W.Mud(1200.0) and len(columns.interfaces) == 0
    one, same = (slanted(mud, "soft")[0] for mud in (W.Mud(1200.0), columns))
    assert np.array_equal(one.tension, same.tension) and np.array_equal(one.true_tension, same.true_tension)


@pytest.mark.parametrize("wrong, words", [
    ([(0.0, 1200.0), (900.0, 1500.0)], "from above 0"), ([(900.0, 1200.0), (900.0, 1500.0)], "ascend"),
    ([1200.0, 1500.0], "rows of measured depth"), ([(900.0, -1.0)], "not negative"), ([], "rows"),
    ([("900 ppg", 1200.0)], "length"),
])  # fmt: skip
def test_columns_are_refused_by_name(wrong, words):
    for field in ("density", "inside"):
        with pytest.raises(cf.SceneError, match=f"Mud.{field} = .*{words}"):
            W.Mud(**{"density": 1200.0, field: wrong})


@pytest.mark.parametrize("ends, words", [
    ((4000.0, 9000.0), "1557.74 kg/m.* begins at md = 4000 m, below the bottom of the hole at 2743.2 m"),
    ((1000.0, 9000.0), "3.28 times as deep as the hole"), (("5000 ft", "8000 ft"), "ends at md = 2438.4 m, above"),
])  # fmt: skip
def test_depths_of_columns_that_do_not_fit_the_hole_are_doubted(ends, words):
    hole, string = hole_of([0, 2743.2], [0, 0]), W.DrillString([PIPE])
    mud = W.Mud([(ends[0], "9 ppg"), (ends[1], "13 ppg")])
    with pytest.warns(cf.SceneWarning, match=f"Mud.density: .*{words}"):
        W.torque_and_drag(hole, string, W.Static(), mud=mud, model="soft")
    with pytest.warns(cf.SceneWarning, match=f"Mud.density: .*{words}"):
        cf.drilling.Drilling(string, cf.drilling.TopDrive(8.0), hole=hole, mud=mud)


def test_depths_of_columns_are_doubted_in_the_unit_of_the_survey():
    path = W.WellPath.from_survey([0, 9000], [0, 0], [0, 0], True, length_unit="ft")
    hole = W.Borehole(path, [W.HoleSection("9000 ft", "12.25 in", 0.2)])
    mud = W.Mud([("5000 ft", "9 ppg"), ("8000 ft", "13 ppg")])
    with pytest.warns(cf.SceneWarning, match="Mud.density: the last row ends at md = 8000 ft, above the lower end"):
        W.torque_and_drag(hole, W.DrillString([PIPE]), W.Static(), mud=mud, model="soft")


@pytest.mark.parametrize("flow", [{"flow_inside": -5e5}, {"flow_outside": [(0.0, "-30 psi"), (900.0, 0.0)]}])
def test_pressures_below_a_vacuum_are_refused(flow):
    with pytest.raises(cf.SceneError, match=f"Mud.{next(iter(flow))} = .*vacuum"):
        W.Mud(1200.0, **flow)


def test_columns_in_a_scene_file_and_in_motion(tmp_path):
    text = """
title = "Displacement by a spacer and a slurry"
[well]
stations = [[0, 0, 0], ["8000 ft", 0, 0]]
sections = [{ to = "8000 ft", casing = "9 5/8 in 47 lb/ft", friction = 0.2 }]
[string]
components = [{ type = "DrillPipe", size = "5 in 19.50 lb/ft" }]
[mud]
density = [["6000 ft", "10 ppg"], ["8000 ft", "12 ppg"]]
inside = [["2000 ft", "10 ppg"], ["4000 ft", "12 ppg"], ["8000 ft", "15.8 ppg"]]
[[operations]]
type = "Static"
"""
    (tmp_path / "scene.toml").write_text(text)
    scene = cf.read(tmp_path / "scene.toml")
    assert "1437.92 kg/m^3, 12 ppg below; inside the string" in " ".join(scene.mud.summary("field").split())
    cf.write(scene, tmp_path / "again.toml")
    assert cf.read(tmp_path / "again.toml").mud == scene.mud
    drive = cf.drilling.TopDrive(8.0)
    moved = cf.drilling.Drilling(scene.string, drive, hole=scene.hole, mud=scene.mud)
    hanging = sum(x.weight * x.length for x in moved.segments)
    assert len(moved.segments) == 4 and hanging == pytest.approx(scene.run()[0].hook_load, rel=1e-12)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Circle(0.1).stiffness(cf.Material(2e11, 0.3, 7850.0)))
    with pytest.raises(cf.SceneError, match="one fluid outside"):
        W.Mud([(10.0, 1200.0), (20.0, 1500.0)], added_mass=1.5).along(rod)
