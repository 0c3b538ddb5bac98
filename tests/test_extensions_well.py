"""An operation that is defined outside the package, in one file of tests/extensions."""

import numpy as np
import pytest
from extensions.pull_rotating import PullRotating

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
PATH = cf.WellPath.from_survey([0, 600, 1200, 2500], [0, 0, 50, 50], [0, 0, 120, 120])
HOLE = cf.Borehole(PATH, cf.HoleSection(2500, "8.5 in", 0.3))
STRING = cf.DrillString([cf.Collar(90, "NC46-65"), cf.DrillPipe(size="5 in 19.50 lb/ft")])
MUD = cf.Mud("10 ppg")
OPERATION = PullRotating("20 klbf", "2 m/min", "40 rpm")


def test_an_operation():
    """The answer is that of `BackReam` with a weight on bit below zero."""
    answer = cf.torque_and_drag(HOLE, STRING, OPERATION, mud=MUD, model="soft")
    same = cf.BackReam(OPERATION.speed, OPERATION.rpm, weight=-OPERATION.overpull)
    expected = cf.torque_and_drag(HOLE, STRING, same, mud=MUD, model="soft")
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
    first = cf.depth_sweep(HOLE, STRING, [OPERATION], [1000.0, 2500.0], **given)
    rows = given["folder"] / "rows.0.jsonl"
    lines = rows.read_bytes().splitlines(keepends=True)
    rows.write_bytes(b"".join(lines[:-1]))  # as a run that was ended leaves it
    again = cf.depth_sweep(HOLE, STRING, [OPERATION], [1000.0, 2500.0], **given)
    np.testing.assert_array_equal(again.hook_load, first.hook_load)
    assert rows.read_bytes() == b"".join(lines)
    with pytest.raises(cf.SceneError, match="holds another sweep"):
        cf.depth_sweep(HOLE, STRING, [PullRotating(1e5, 0.1, 40)], [1000.0, 2500.0], **given)
    figure = first.plot()
    assert any("pull rotating" in text.get_text() for axes in figure.axes for text in axes.get_legend().get_texts())
