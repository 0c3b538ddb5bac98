"""Strings in wells under mpirun: every rank has the answer, rank 0 writes."""

import numpy as np
import pytest
from conftest import COMM

import cosserat_fenicsx as cf

pytestmark = pytest.mark.ranks


def test_a_sweep_is_kept_by_one_rank_and_goes_on_for_all(tmp_path_all):
    path = cf.well.WellPath.from_survey([0, 600, 1200, 2500], [0, 0, 50, 50], [0, 0, 120, 120])
    hole = cf.well.Borehole(path, cf.well.HoleSection(2500.0, 0.2159, 0.25))
    string, file = cf.well.DrillString([cf.well.DrillPipe(size="5 in 19.50 lb/ft")]), tmp_path_all / "sweep"
    settings = {"mud": cf.well.Mud(1200.0), "model": "soft", "folder": file}
    found = cf.well.depth_sweep(hole, string, cf.well.TripOut(), [1000.0, 2500.0], **settings)
    COMM.barrier()
    assert len((file / "rows.0.jsonl").read_text(encoding="utf-8").splitlines()) == 2
    again = cf.well.depth_sweep(hole, string, cf.well.TripOut(), [1000.0, 2500.0], **settings)
    answer = cf.well.torque_and_drag(hole, string, cf.well.TripOut(), mud=cf.well.Mud(1200.0), model="soft")
    loads = np.array(COMM.allgather([found.hook_load[0, 0, 1], again.hook_load[0, 0, 1], answer.hook_load]))
    assert (loads == loads[0, 0]).all()
    answer.write(tmp_path_all / "answer.csv")
    with pytest.raises(cf.SceneError, match="holds another sweep"):
        cf.well.depth_sweep(hole, string, cf.well.TripIn(), [1000.0], **settings)
    COMM.barrier()
    rows = (tmp_path_all / "answer.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == len(answer.md) + 1
