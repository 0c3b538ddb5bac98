"""A drill-string in motion that is written to a folder: whatever ends it, it goes on to the same digits."""

import errno
import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fake_string import scene, use

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling import folder as storage
from cosserat_fenicsx.drilling import time_loop
from cosserat_fenicsx.drilling.as_data import from_data, to_data

pytestmark = pytest.mark.serial


def bytes_of(folder):
    return [(folder / name).read_bytes() for name in ("series.f64", "profiles.f64")]


@pytest.mark.parametrize("step", [3, 500, 1999, 2999])
def test_kill_9(step, tmp_path, monkeypatch):
    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); import fake_string as t;"
        f" t.kill_in({str(tmp_path / 'killed')!r}, {step})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8")
    assert done.returncode == -signal.SIGKILL, done.stderr
    use(monkeypatch)
    whole = cf.simulate_drilling(scene(), 30.0, folder=tmp_path / "whole")
    assert len(cf.read_drilling(tmp_path / "killed")) <= step
    with open(tmp_path / "killed" / "series.f64", "ab") as stream:
        stream.write(b"part of a row")  # as by a machine that stopped
    again = cf.resume_drilling(tmp_path / "killed")
    assert bytes_of(tmp_path / "killed") == bytes_of(tmp_path / "whole")
    for name in ("times", "bit_speed", "work_of_drive", "speed", "sticking", "profile_times"):
        assert np.array_equal(getattr(again, name), getattr(whole, name)), name
    assert again.why == whole.why and again.counts == whole.counts


def test_a_motion_goes_on_for_longer(tmp_path, monkeypatch):
    use(monkeypatch)
    cf.simulate_drilling(scene(), 40.0, folder=tmp_path / "whole", profile_every=0.5)
    cf.simulate_drilling(scene(), 25.0, folder=tmp_path / "part", profile_every=0.5)
    assert len(cf.resume_drilling(tmp_path / "part", duration=40.0)) == 4000
    assert bytes_of(tmp_path / "part") == bytes_of(tmp_path / "whole")
    assert len(cf.resume_drilling(tmp_path / "part")) == 4000  # complete
    with pytest.raises(cf.SceneError, match="duration = 30.0: expected at least 40 s, the last one asked for"):
        cf.resume_drilling(tmp_path / "part", duration=30.0)


def test_a_damaged_checkpoint_costs_time_alone(tmp_path, monkeypatch):
    use(monkeypatch)
    cf.simulate_drilling(scene(), 10.0, folder=tmp_path / "one")
    before = bytes_of(tmp_path / "one")
    (tmp_path / "one" / "checkpoint.npz").write_bytes(b"no archive")
    cf.resume_drilling(tmp_path / "one")
    assert bytes_of(tmp_path / "one") == before


def test_folders_that_are_refused(tmp_path, monkeypatch):
    use(monkeypatch)
    cf.simulate_drilling(scene(), 1.0, folder=tmp_path / "one")
    with pytest.raises(cf.SceneError, match=r"it holds a motion already: .*resume_drilling"):
        cf.simulate_drilling(scene(), 1.0, folder=tmp_path / "one")
    with pytest.raises(cf.SceneError, match=r"not the one of the motion: Drilling.drive.speed is 7.*where .* 6.28"):
        cf.resume_drilling(tmp_path / "one", scene(drive=cf.TopDrive(7.0)))
    with pytest.raises(cf.SceneError, match="no motion of a drill-string was found there"):
        cf.read_drilling(tmp_path / "none")
    head = json.loads((tmp_path / "one" / "drilling.json").read_text(encoding="utf-8"))
    for changed, words in (({"depths": "deep"}, r"damaged \(depths\)"), ({"format": 99}, "its format is 99")):
        (tmp_path / "one" / "drilling.json").write_text(json.dumps({**head, **changed}), encoding="utf-8")
        with pytest.raises(cf.SceneError, match=words):
            cf.read_drilling(tmp_path / "one")


def test_functions_of_time_are_compared_by_their_values(tmp_path, monkeypatch):
    use(monkeypatch)

    def moving(factor):
        return scene(drive=cf.TopDrive(lambda t: factor * min(t, 5.0)))

    cf.simulate_drilling(moving(1.0), 2.0, folder=tmp_path / "one")
    with pytest.raises(cf.SceneError, match=r"expected the scene of .* a function written in Python cannot be stored"):
        cf.resume_drilling(tmp_path / "one")
    with pytest.raises(cf.SceneError, match=r"drive.speed.values is \["):
        cf.resume_drilling(tmp_path / "one", moving(1.001))
    assert len(cf.resume_drilling(tmp_path / "one", moving(1.0), duration=3.0)) == 300


def test_scenes_as_data():
    path = cf.WellPath.from_survey([0, 500, 1600, 2500], [0, 0, 60, 60], [0, 0, 0, 0])
    hole = cf.Borehole(path, [cf.HoleSection(2500.0, 0.311, 0.3)])
    string = cf.DrillString([cf.Collar(200.0, "NC56-80"), cf.DrillPipe(size="5 in 19.50 lb/ft")])
    whole = cf.Drilling(
        string, cf.TopDrive(cf.Ramp((4.0,), 0.0, 2.0), 2900.0, cf.PI(38e3, 1e5)),
        cf.BitOnRock(cf.Cutting(0.108, 60e6, 0.6, 4, cf.Wear(60e6, 0.011, 0.6)), inertia=41.0), hole,
        cf.Hook(5e6, 0.01), cf.Mud(1200.0), cf.WallFriction(0.3, 0.195, 1.5, of_rotation=True),
        cf.ViscousDrag(0.1, 0.2),
    )  # fmt: skip
    discs = cf.Drilling(cf.Discs((930.0, 2782.0), (700.0,)), cf.TopDrive(6.0), cf.BitOnRock(cf.Stribeck(3.0, 2.0, 1.0)))
    for given in (whole, discs, scene()):
        data = json.loads(json.dumps(to_data(given)))
        again = from_data(data)
        assert to_data(again) == to_data(given) and again.segments == given.segments if given is not discs else True
    with pytest.raises(cf.SceneError, match="no data of a Drilling"):
        from_data({"type": "Nothing"})


def test_checkpoints_are_seldom(tmp_path, monkeypatch):
    """A fiftieth of the time at most, and not more often than the limit."""
    use(monkeypatch)
    written, write = [], storage.checkpoints.write
    monkeypatch.setattr(storage.checkpoints, "write", lambda *args: (written.append(1), write(*args)))
    monkeypatch.setattr(time_loop, "CHUNK", 10)
    cf.simulate_drilling(scene(), 10.0, folder=tmp_path / "one")
    assert len(written) == 2  # at the first chunk and at the end


def test_one_process_at_a_time(tmp_path, monkeypatch):
    use(monkeypatch)
    cf.simulate_drilling(scene(), 1.0, folder=tmp_path / "one")
    busy = storage.DrillingFolder(tmp_path / "one").open()
    busy.hold()
    with pytest.raises(cf.SceneError, match="another process is at work on this motion"):
        cf.resume_drilling(tmp_path / "one", duration=2.0)
    busy.release()
    assert len(cf.resume_drilling(tmp_path / "one", duration=2.0)) == 200


def test_a_full_disk(tmp_path, monkeypatch):
    use(monkeypatch)

    def full(*args):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(storage.checkpoints, "write", full)
        with pytest.raises(cf.NotStored, match=r"No space left on device. Make room; .*resume_drilling\(") as stop:
            cf.simulate_drilling(scene(), 10.0, folder=tmp_path / "one")
    assert len(stop.value.path) > 0
    assert len(cf.resume_drilling(tmp_path / "one")) == 1000
