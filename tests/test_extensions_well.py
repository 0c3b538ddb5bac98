"""An operation that is defined outside the package, in one file of tests/extensions."""

import json

import numpy as np
import pytest
from extensions.pull_rotating import PullRotating

import cosserat_fenicsx as cf
from cosserat_fenicsx.parts import from_data, to_data

pytestmark = pytest.mark.serial
PATH = cf.well.WellPath.from_survey([0, 600, 1200, 2500], [0, 0, 50, 50], [0, 0, 120, 120])
HOLE = cf.well.Borehole(PATH, cf.well.HoleSection(2500, "8.5 in", 0.3))
STRING = cf.well.DrillString([cf.well.Collar(90, "NC46-65"), cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
MUD = cf.well.Mud("10 ppg")
OPERATION = PullRotating("20 klbf", "2 m/min", "40 rpm")
FILE = """use = ["extensions.pull_rotating"]

[well]
stations = [[0, 0, 0], [600, 0, 0], [1200, 50, 120], [2500, 50, 120]]
sections = [{ to = 2500, diameter = "8.5 in", friction = 0.3 }]

[string]
components = [
    { type = "Collar", size = "NC46-65", length = 90 },
    { type = "DrillPipe", size = "5 in 19.50 lb/ft" },
]

[mud]
density = "10 ppg"

[[operations]]
type = "PullRotating"
overpull = "20 klbf"
speed = "2 m/min"
rpm = 40

[torque_and_drag]
model = "soft"
"""


def test_an_operation():
    """The answer is that of `BackReam` with a weight on bit below zero."""
    answer = cf.well.torque_and_drag(HOLE, STRING, OPERATION, mud=MUD, model="soft")
    same = cf.well.BackReam(OPERATION.speed, OPERATION.rpm, weight=-OPERATION.overpull)
    expected = cf.well.torque_and_drag(HOLE, STRING, same, mud=MUD, model="soft")
    assert (answer.hook_load, answer.surface_torque) == (expected.hook_load, expected.surface_torque)
    assert OPERATION.overpull == 20 * cf.units.kip and OPERATION.name == "pull rotating"
    assert "pull rotating" in repr(answer) and "pull rotating" in str(answer)
    rate = answer.sensitivity("operation.torque", "surface_torque")
    assert rate.derivatives["operation.torque"] == pytest.approx(1.0)
    with pytest.raises(cf.SceneError, match=r"PullRotating.overpull = -1: expected a pull \(N\), positive"):
        PullRotating(-1, 0.1, 40)


def test_its_sweep_is_kept_and_drawn(tmp_path):
    """Another overpull is another sweep; the folder holds whole objects."""
    given = {"mud": MUD, "model": "soft", "folder": tmp_path / "sweep", "progress": False}
    first = cf.well.depth_sweep(HOLE, STRING, [OPERATION], [1000.0, 2500.0], **given)
    rows = given["folder"] / "rows.0.jsonl"
    lines = rows.read_bytes().splitlines(keepends=True)
    rows.write_bytes(b"".join(lines[:-1]))  # as a run that was ended leaves it
    again = cf.well.depth_sweep(HOLE, STRING, [OPERATION], [1000.0, 2500.0], **given)
    np.testing.assert_array_equal(again.hook_load, first.hook_load)
    assert rows.read_bytes() == b"".join(lines)
    with pytest.raises(cf.SceneError, match="holds another sweep"):
        cf.well.depth_sweep(HOLE, STRING, [PullRotating(1e5, 0.1, 40)], [1000.0, 2500.0], **given)
    figure = first.plot()
    assert any("pull rotating" in text.get_text() for axes in figure.axes for text in axes.get_legend().get_texts())


def test_its_scene_file(tmp_path):
    """The answer is that in Python; a scene that is written reads back equal; a wrong key is refused with its line."""
    file = tmp_path / "well.toml"
    file.write_text(FILE, encoding="utf-8")
    scene = cf.read(file)
    assert scene.operations == (OPERATION,)
    (answer,) = scene.run()
    expected = cf.well.torque_and_drag(HOLE, STRING, OPERATION, mud=MUD, model="soft")
    assert answer.hook_load == pytest.approx(expected.hook_load, rel=1e-12)
    data = json.loads(json.dumps(to_data(scene)))
    assert data["use"] == ["extensions.pull_rotating"] and to_data(from_data(type(scene), data)) == data
    file.write_text(FILE.replace("overpull", "overpul"), encoding="utf-8")
    with pytest.raises(cf.SceneError, match=r"line 18, column 1.*overpul.*did you mean 'overpull'"):
        cf.read(file)
