"""Bent and stabilised assemblies against numbers of an independent beam with small offsets and without shear: side
force and tilt of the bit, forces on stabilisers, where the string lies down, rates of build."""

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.well.components import StringPart

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
def test_the_rod_of_an_assembly(case):
    given, truth = case["input"], case["straight hole"]
    answer = well.torque_and_drag(straight(60.0), assembly(given), well.Sliding(given["WOB"]), model="rod")
    assert answer.bit_side_force == pytest.approx([truth["side force"], 0.0], rel=1e-3, abs=1e-3)
    assert answer.bit_tilt == pytest.approx([truth["tilt"], 0.0], abs=1e-6)
    *_, tangency = [x for x in answer.contacts if x.at_point and x.top < 60.0 - given["stabilisers"][-1][0] - 1.0]
    assert tangency.top == pytest.approx(60.0 - truth["tangency"], abs=1e-2)
    assert tangency.force == pytest.approx(truth["force at tangency"], rel=1e-3)
    on_blades = [x.force for x in answer.contacts if x.at_point and tangency.top < x.top < 59.9]
    assert on_blades[::-1] == pytest.approx([force for _, force in truth["stabilisers"]], rel=1e-3)


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
    turning = well.torque_and_drag(hole, string, well.RotaryDrilling(given["WOB"], 2e3), model="rod")
    assert "ONE MOMENT of a turn" in turning.summary()


@pytest.mark.parametrize(("given", "words"), [
    ({"bend": 6.0, "bend_at": 2.0}, "a bend (degrees) from 0 to 5"),
    ({"bend": 1.0}, "Collar.bend_at = None: expected its distance (m) from the lower end, between 0 and the length"),
    ({"bend": 1.0, "bend_at": 8.0}, "Collar.bend_at = 8"),
    ({"bend": 1.0, "bend_at": 2.0, "length": None}, "a component with a length"),
    ({"tool_face": 10.0}, "Collar.tool_face = 10.0: expected a bend, too"),
    ({"bend": 1.0, "bend_at": 2.0, "tool_face": 400.0}, "an angle from the high side (degrees)"),
])  # fmt: skip
def test_bends_that_are_refused(given, words):
    with pytest.raises(cf.SceneError) as refused:
        well.Collar(**{"length": 7.5, "size": "NC46-65", **given})
    assert words in str(refused.value)
