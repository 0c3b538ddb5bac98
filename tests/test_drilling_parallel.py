"""Drill-strings in motion on several ranks: each computes the same motion, and one writes."""

import numpy as np
import pytest
from fake_string import scene

import cosserat_fenicsx as cf
from cosserat_fenicsx.storage.store import Store

pytestmark = pytest.mark.ranks


def test_ranks_share_a_folder(tmp_path_all, monkeypatch):
    monkeypatch.setattr(Store, "APART", 0.0)
    monkeypatch.setattr(Store, "SELDOM", 0)
    given = scene(bit=cf.drilling.BitOnRock(cf.drilling.Stribeck(6e3, 4e3, 3.0), inertia=50.0))
    history = cf.drilling.simulate(given, 10.0, folder=tmp_path_all / "one", profile_every=1.0)
    alone = cf.drilling.simulate(given, 15.0, profile_every=1.0)
    assert np.array_equal(history.rows, alone.rows[: len(history)], equal_nan=True)
    again = cf.resume(tmp_path_all / "one", duration=15.0)
    assert np.array_equal(again.rows, alone.rows, equal_nan=True) and np.array_equal(again.speed, alone.speed)
    history.write(tmp_path_all / "out.csv")
    history.plot(tmp_path_all / "out.png")
    assert (tmp_path_all / "out.csv").stat().st_size > 10_000 and (tmp_path_all / "out.png").exists()
