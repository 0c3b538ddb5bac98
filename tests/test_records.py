"""Points that are added to a path one by one and many at once make the same path."""

import numpy as np
import pytest
from conftest import column

import cosserat_fenicsx as cf
from cosserat_fenicsx.results.records import Records
from cosserat_fenicsx.statics.path.follower import Follower

pytestmark = pytest.mark.serial


@pytest.mark.parametrize("model", ["determinate", "planar", "spatial"])
def test_one_by_one_and_many_at_once(model, monkeypatch):
    rod, scene = column()
    etas, given, append = [0.2, 0.4, 0.6, 0.8, 1.0], [], cf.Path.append
    monkeypatch.setattr(Follower, "sweeps", False)
    monkeypatch.setattr(cf.Path, "append", lambda path, record: (given.append(record), append(path, record)))
    single = cf.solve(scene, etas, model=model, elements=3)
    mixed = single.at_points([])
    append(mixed, given[0])
    mixed.extend(Records.of(given[1:3]))
    assert mixed.load_factors.tolist() == etas[:3] and mixed.position(rod.end).shape == (3, 3)
    mixed.extend(Records.of(given[3:4]))
    append(mixed, given[4])
    for found in (mixed, mixed.at_points(range(5)), mixed[3:].with_points(mixed[:3], np.arange(5) < 3)):
        assert len(found) == 5
        for name in ("load_factors", "negative_modes", "iterations", "steps"):
            np.testing.assert_array_equal(getattr(found, name), getattr(single, name))
        for query in ("position", "rotation", "force", "moment"):
            np.testing.assert_array_equal(getattr(found, query)(rod.at(7.0)), getattr(single, query)(rod.at(7.0)))
        np.testing.assert_array_equal(found.reaction(rod.start), single.reaction(rod.start))
