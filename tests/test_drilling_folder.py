"""A drill-string in motion that is written to a folder: whatever ends it, it goes on to the same digits."""

import json

import pytest
from fake_string import scene, use

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling import time_loop
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.parts import from_data, to_data
from cosserat_fenicsx.storage import files

pytestmark = pytest.mark.serial


def bytes_of(folder):
    return [(folder / name).read_bytes() for name in ("series.npy", "profiles.npy")]


def test_a_motion_goes_on_for_longer(tmp_path, monkeypatch):
    use(monkeypatch)
    cf.drilling.simulate(scene(), 40.0, folder=tmp_path / "whole", profile_every=0.5)
    cf.drilling.simulate(scene(), 25.0, folder=tmp_path / "part", profile_every=0.5)
    assert len(cf.resume(tmp_path / "part", duration=40.0)) == 4000
    assert bytes_of(tmp_path / "part") == bytes_of(tmp_path / "whole")
    assert len(cf.resume(tmp_path / "part")) == 4000  # complete
    with pytest.raises(cf.SceneError, match="duration = 30.0: expected at least 40 s, the last one asked for"):
        cf.resume(tmp_path / "part", duration=30.0)


def test_folders_that_are_refused(tmp_path, monkeypatch):
    use(monkeypatch)
    cf.drilling.simulate(scene(), 1.0, folder=tmp_path / "one")
    with pytest.raises(cf.SceneError, match=r"it holds a motion of a drill-string already: .*resume"):
        cf.drilling.simulate(scene(), 1.0, folder=tmp_path / "one")
    with pytest.raises(cf.SceneError, match=r"not the one of the motion: Drilling.drive.speed is 7.*where .* 6.28"):
        cf.resume(tmp_path / "one", scene(drive=cf.drilling.TopDrive(7.0)))
    with pytest.raises(cf.SceneError, match="no motion was found there"):
        cf.resume(tmp_path / "none")


def test_functions_of_time_are_compared_by_their_values(tmp_path, monkeypatch):
    use(monkeypatch)

    def moving(factor):
        return scene(drive=cf.drilling.TopDrive(lambda t: factor * min(t, 5.0)))

    cf.drilling.simulate(moving(1.0), 2.0, folder=tmp_path / "one")
    with pytest.raises(cf.SceneError, match=r"expected the scene of .* a function written in Python cannot be stored"):
        cf.resume(tmp_path / "one")
    with pytest.raises(cf.SceneError, match=r"drive.speed at t = .* s is .*, where the motion has"):
        cf.resume(tmp_path / "one", moving(1.001))
    assert len(cf.resume(tmp_path / "one", moving(1.0), duration=3.0)) == 300


def test_scenes_as_data():
    path = cf.well.WellPath.from_survey([0, 500, 1600, 2500], [0, 0, 60, 60], [0, 0, 0, 0])
    hole = cf.well.Borehole(path, [cf.well.HoleSection(2500.0, 0.311, 0.3)])
    string = cf.well.DrillString([cf.well.Collar(200.0, "NC56-80"), cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
    whole = cf.drilling.Drilling(
        string,
        cf.drilling.TopDrive(cf.signals.Ramp((4.0,), 0.0, 2.0), 2900.0, cf.drilling.PI(38e3, 1e5)),
        cf.drilling.BitOnRock(
            cf.drilling.Cutting(0.108, 60e6, 0.6, 4, cf.drilling.Wear(60e6, 0.011, 0.6)), inertia=41.0
        ),
        hole,
        cf.drilling.Hook(5e6, 0.01),
        cf.well.Mud(1200.0),
        cf.drilling.WallFriction(0.3, 0.195, 1.5, of_rotation=True),
        cf.drilling.ViscousDrag(0.1, 0.2),
    )
    discs = cf.drilling.Drilling(
        cf.drilling.Discs((930.0, 2782.0), (700.0,)),
        cf.drilling.TopDrive(6.0),
        cf.drilling.BitOnRock(cf.drilling.Stribeck(3.0, 2.0, 1.0)),
    )
    for given in (whole, discs, scene()):
        data = json.loads(json.dumps(to_data(given)))
        again = from_data(Drilling, data)
        assert to_data(again) == to_data(given) and again.segments == given.segments if given is not discs else True
    with pytest.raises(cf.SceneError, match="no data of a Drilling"):
        from_data(Drilling, {"type": "Nothing"})


def test_checkpoints_are_seldom(tmp_path, monkeypatch):
    """A fiftieth of the time at most, and not more often than the limit."""
    use(monkeypatch)
    written, write = [], files.write_checkpoint
    monkeypatch.setattr(files, "write_checkpoint", lambda *args: (written.append(1), write(*args)))
    monkeypatch.setattr(time_loop, "CHUNK", 10)
    cf.drilling.simulate(scene(), 10.0, folder=tmp_path / "one")
    assert len(written) == 3  # at the start, which is kept twice, and at the end
