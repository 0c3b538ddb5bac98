"""Bent and stabilised assemblies against numbers of an independent beam with small offsets and without shear: side
force and tilt of the bit, forces on stabilisers, where the string lies down, rates of build."""

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.choose import chosen
from cosserat_fenicsx.well.components import StringPart

pytestmark = pytest.mark.serial
well = cf.well
KNOWN = json.loads((Path(__file__).parent / "reference" / "bent_assemblies.json").read_text(encoding="utf-8"))
HOLE, BLADE = 0.2159, 0.2  # diameter, and length of a stabiliser, m


@dataclass(frozen=True)
class Ring(StringPart):
    """A stabiliser without shear."""

    length: float
    stiffness: cf.Stiffness
    weight: float
    contact_radius: float
    outer_diameter: float
    name: str = "ring"

    touches, inner_diameter, mass, material = "middle", 0.0, None, cf.Material(206e9, 0.3, 7850.0)


@dataclass(frozen=True)
class End(Ring):
    """A bit without shear."""

    touches = "bottom"


def assembly(given):
    """The string of a case, of components without shear."""
    (length, *lower), (_, *upper) = given["parts"]
    body, bend = HOLE - 2 * given["wall"], given["bend"]

    def pieces(start, end):
        for low, high, (EI, weight) in ((0.0, length, lower), (length, math.inf, upper)):
            a, b = max(start, low), min(end, high)
            if b > a:
                bent = {"bend": bend[1], "bend_at": bend[0] - a} if bend and a < bend[0] < b else {}
                size = None if b == math.inf else b - a
                yield well.Component(size, rigid(EI), weight, body / 2, "motor" if bent else "collar", **bent)

    parts, at = [End(BLADE, rigid(lower[0]), lower[1], HOLE / 2, body)], BLADE
    for s, clearance in given["stabilisers"]:
        EI, weight = lower if s < length else upper
        parts += [*pieces(at, s - BLADE / 2), Ring(BLADE, rigid(EI), weight, HOLE / 2 - clearance, body)]
        at = s + BLADE / 2
    return well.DrillString([*parts, *pieces(at, math.inf)])


def rigid(EI):
    return cf.Stiffness((math.inf, math.inf), 4e9, (EI, EI), EI / 1.3)


def straight(length, inclination=40.0, friction=0.0):
    path = well.WellPath.from_survey([0, length], [inclination] * 2, [0, 0])
    return well.Borehole(path, well.HoleSection(length, HOLE, friction))


def turned(string, face):
    return well.DrillString([replace(x, tool_face=face) if x.bend else x for x in string.components])


@pytest.mark.parametrize("case", KNOWN, ids=lambda case: case["name"])
def test_the_rod_of_an_assembly(case, truth):
    given, known, name = case["input"], case["straight hole"], case["name"]
    answer = well.torque_and_drag(straight(60.0), assembly(given), well.Sliding(given["WOB"]), model="rod")
    size = abs(known["side force"])
    truth(f"{name}, rod: side force of the bit", answer.bit_side_force, [known["side force"], 0.0], 1e-3, of=size)
    assert answer.bit_tilt == pytest.approx([known["tilt"], 0.0], abs=1e-6)
    *_, tangency = [x for x in answer.contacts if x.at_point and x.top < 60.0 - given["stabilisers"][-1][0] - 1.0]
    truth(f"{name}, rod: place of tangency (m)", tangency.top, 60.0 - known["tangency"], 1e-2, of=1.0)
    truth(f"{name}, rod: force at tangency", tangency.force, known["force at tangency"], 1e-3)
    on_blades = [x.force for x in answer.contacts if x.at_point and tangency.top < x.top < 59.9]
    truth(f"{name}, rod: forces on stabilisers", on_blades[::-1], [force for _, force in known["stabilisers"]], 1e-3)


def test_a_bend_to_any_side():
    given = KNOWN[0]["input"]
    right, left = (
        well.torque_and_drag(straight(60.0), turned(assembly(given), x), well.Sliding(given["WOB"]), model="rod")
        for x in (90.0, 270.0)
    )
    assert right.bit_side_force[1] > 3e4 and right.bit_tilt[1] < 0
    assert left.bit_side_force == pytest.approx(right.bit_side_force * (1, -1), rel=1e-3)
    assert any("points its lower end 90.00 deg clockwise" in line for line in right.why)


def test_a_bend_decides_for_the_rod_and_is_missed_where_there_is_none():
    given = KNOWN[0]["input"]
    string, hole = assembly(given), straight(60.0, friction=0.2)
    sliding = well.torque_and_drag(hole, string, well.Sliding(given["WOB"]))
    assert sliding.model == "rod" and sliding.enough
    soft = well.torque_and_drag(hole, string, well.Sliding(given["WOB"]), model="soft")
    assert not soft.enough and np.isnan(soft.bit_tilt).all() and "THE BEND of motor IS NOT IN IT" in soft.details()
    readings = [well.RigMeasurement(x, well.TripOut(), 1e3 * x) for x in (40.0, 50.0, 60.0)]
    with pytest.warns(cf.SceneWarning, match="the bend of motor is not in the soft string"):
        well.calibrate_friction(hole, string, readings)
    turning = well.torque_and_drag(hole, string, well.RotaryDrilling(given["WOB"], 2e3), model="rod")
    assert "ONE MOMENT of a turn" in turning.summary()


@pytest.mark.once
@pytest.mark.parametrize("case", KNOWN, ids=lambda case: case["name"])
def test_rates_of_build(case):
    given, truth = case["input"], case["straight hole"]
    found = well.build_rate(straight(200.0), assembly(given), well.Sliding(given["WOB"]), anisotropy=given["I_b"])
    assert found.bit_side_force == pytest.approx(truth["side force"], rel=1e-4)
    assert found.bit_tilt == pytest.approx(truth["tilt"], abs=1e-7)
    assert found.contacts[-1] == pytest.approx((truth["tangency"], -truth["force at tangency"]), rel=1e-5)
    assert [-force for _, force in found.contacts[:-1]] == pytest.approx([x for _, x in truth["stabilisers"]], rel=1e-3)
    for name, rate in case["rates"].items():
        if rate is not None:
            assert found.of(name) == pytest.approx(rate, abs=math.radians(0.001) / 30), name
    # the other program knows no contact of the body below a stabiliser, with which the pendulum's side force vanishes
    assert np.isnan(found.of("three-point")) == (given["bend"] is None) and np.isfinite(found.rate[:3]).all()
    assert ("three-point: it is about an assembly with one bend" in found.summary()) == (given["bend"] is None)


def in_circle(curvature, length=60.0):
    md = np.array([0.0, length / 2, length])
    path = well.WellPath.from_survey(md, 40 - np.degrees(curvature) * (length - md), [0, 0, 0])
    return well.Borehole(path, well.HoleSection(length, HOLE, 0.0))


@pytest.mark.parametrize(("case", "criterion"), [(0, "side force"), (0, "tilt"), (3, "side force")])
def test_the_rod_in_a_hole_of_that_rate(case, criterion):
    given = KNOWN[case]["input"]
    string, operation = assembly(given), well.Sliding(given["WOB"])
    found = well.build_rate(straight(200.0), string, operation)
    rod = well.torque_and_drag(in_circle(found.of(criterion)), string, operation, model="rod")
    if criterion == "tilt":
        assert rod.bit_tilt[0] == pytest.approx(0.0, abs=3e-6)
    else:
        slope = np.abs(np.gradient(found.side_force, found.curvature)).max()
        assert rod.bit_side_force[0] == pytest.approx(0.0, abs=math.radians(0.02) / 30 * slope)


@pytest.mark.slow
def test_shear_and_a_drop_with_the_bend_turned_over():
    tube = {"outer_diameter": 0.1714, "inner_diameter": 0.0762}
    parts = [well.Bit(HOLE), well.Collar(0.8, **tube), well.Stabiliser(0.4, 0.2143, **tube)]
    parts += [well.Collar(6.0, bend=1.0, bend_at=0.7, **tube), well.Collar(**tube)]
    string, mud = well.DrillString(parts), well.Mud(1200.0)
    for face in (0.0, 180.0):
        given = {"string": turned(string, face), "operation": well.Sliding(80e3), "mud": mud}
        found = well.build_rate(straight(80.0), **given)
        rod = well.torque_and_drag(straight(80.0), **given, model="rod")
        assert found.bit_side_force == pytest.approx(rod.bit_side_force[0], rel=1e-3)
        assert found.bit_tilt == pytest.approx(rod.bit_tilt[0], abs=2e-6)
        assert (found.of("three-point") > 0) == (found.of("law") > 0) == (face == 0)


def test_rates_of_build_as_files_and_pictures(tmp_path_all):
    found = well.build_rate(straight(200.0), assembly(KNOWN[0]["input"]), well.Sliding(80e3))
    found.save(tmp_path_all / "rates.h5")
    assert cf.read_result(tmp_path_all / "rates.h5").summary() == found.summary()
    found.write(tmp_path_all / "rates.csv", units="field")
    assert "rate of build (deg/100ft)" in (tmp_path_all / "rates.csv").read_text(encoding="utf-8")
    figure = found.plot(units="field")
    (legend,) = [panel.get_legend() for panel in figure.axes if panel.get_legend()]
    assert f"side force: {found.of('side force') / cf.units.deg_per_100ft:.2f} deg/100ft" in {
        text.get_text() for text in legend.get_texts()
    }


def plain(**changed):
    """Arguments of `build_rate` of a bit and collars."""
    collar = {"length": 7.5, "size": "NC46-65"}
    parts = [well.Bit(HOLE), well.Collar(**(collar | changed.pop("motor", {}))), well.Collar(size="NC46-65")]
    return {"hole": straight(200.0), "string": well.DrillString(parts), "operation": well.Sliding(80e3),
            "mud": well.Mud(1200.0)} | changed  # fmt: skip


@pytest.mark.once
@pytest.mark.parametrize(("given", "words"), [
    (lambda: plain(operation=well.TripOut()), "an operation with weight on bit"),
    (lambda: plain(anisotropy=-0.1), "a number from 0 to 10"),
    (lambda: plain(motor={"bend": 1.0, "bend_at": 2.0, "tool_face": 90.0}), "expected 0 or 180 for build_rate"),
    (lambda: plain(string=well.DrillString([well.Collar(size="NC46-65")])), "the lowest component is collar"),
    (lambda: plain(hole=straight(9.0)), "does not lie down on the wall within 9 m"),
    (lambda: plain(hole=straight(200.0, inclination=0.0)), "less weight on bit"),
    (lambda: plain(string=well.DrillString([well.Bit(HOLE), well.Component(None, None, 900.0, 0.08)])),
     "expected that of a round section"),
])  # fmt: skip
def test_rates_that_are_refused(given, words):
    with pytest.raises((cf.SceneError, cf.NotConverged)) as refused:
        well.build_rate(**given())
    assert words in str(refused.value)


SCENE = Path(__file__).parents[1] / "demos" / "wells" / "bent_motor.toml"


@pytest.mark.once
def test_the_scene_of_a_bent_motor(tmp_path):
    scene = cf.read(SCENE)
    found = scene.builds(scene.operations[0])
    assert np.degrees(found.rate) * 30 == pytest.approx([10.318, -2.0716, 9.813, 7.075], abs=2e-3)
    # of the heavy-weight pipe above, which then hardly lies on its wall
    assert "no equilibrium was found in 7 of 25 holes that were tried" in found.summary()
    assert "Rates of build by several criteria, anisotropy 0.1" in scene.details("field")
    again = tmp_path / "again.toml"
    again.write_text(SCENE.read_text(encoding="utf-8").replace("18 klbf", "0 klbf"), encoding="utf-8")
    with pytest.raises(cf.SceneError, match=r"build_rate.operations = 'none with weight on bit'"):
        cf.read(again)


@pytest.mark.once
def test_motions_leave_a_bend_out_or_refuse_it():
    motor = well.Collar(7.5, "NC46-65", name="motor", bend=1.0, bend_at=2.0)
    string, drive = well.DrillString([motor, well.DrillPipe(size="5 in 19.50 lb/ft")]), cf.drilling.TopDrive(6.0)
    motion = cf.drilling.Drilling(string, drive, depth=300.0)
    assert any("the bend of motor is left out" in line for line in chosen(motion)[1])
    with pytest.raises(cf.SceneError, match="None in mixed_scene, whose rod is straight"):
        cf.drilling.mixed_scene(motion)


@pytest.mark.once
@pytest.mark.parametrize(("given", "words"), [
    ({"bend": 6.0, "bend_at": 2.0}, "a bend (degrees) from 0 to 5"),
    ({"bend": 1.0}, "Collar.bend_at = None: expected its distance (m) from the lower end, between 0 and the length"),
    ({"bend": 1.0, "bend_at": 8.0}, "Collar.bend_at = 8"),
    ({"bend": 1.0, "bend_at": 2.0, "length": None}, "a component with a length"),
    ({"tool_face": 10.0}, "Collar.tool_face = 10.0: expected a bend, too"),
    ({"bend": 1.0, "bend_at": 2.0, "tool_face": 400.0}, "an angle (degrees, 0 the high side, 90 right) from -360"),
])  # fmt: skip
def test_bends_that_are_refused(given, words):
    with pytest.raises(cf.SceneError) as refused:
        well.Collar(**{"length": 7.5, "size": "NC46-65", **given})
    assert words in str(refused.value)


def test_rates_of_a_long_pendulum_change_smoothly_with_the_weight_on_bit():
    """Nodes that begin and cease to touch in turn ended half of these without a rate, and one with a wrong one."""
    hole = well.Borehole(well.WellPath.from_survey([0, 900], [45, 45], [0, 0]), well.HoleSection(900, "8.5 in", 0.25))
    collar = {"outer_diameter": "6.75 in", "inner_diameter": "2.8125 in"}
    string = well.DrillString([
        well.Bit("8.5 in"), well.Collar(18.288, **collar), well.Stabiliser(1.524, "8.46875 in", "6.75 in", "2.8125 in"),
        well.Collar(60.96, **collar), well.DrillPipe(outer_diameter=0.127, inner_diameter=0.0762),
    ])  # fmt: skip
    weights = np.arange(22, 39, 4) * cf.units.kip
    rates = [well.build_rate(hole, string, well.Sliding(x), mud=well.Mud(1198.0)).rate[:3] for x in weights]
    assert (np.abs(np.diff(rates, 2, axis=0)) < 0.25 * np.abs(np.diff(rates, axis=0)[1:])).all()
