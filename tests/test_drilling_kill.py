"""Every model of a drill-string in motion is killed at any moment, and goes on to the same digits."""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import cosserat_fenicsx as cf

pytestmark = [pytest.mark.serial, pytest.mark.slow]
DURATION = 60.0


def scene_of(kind):
    """With a controller, with places that stick, and with axial motion; or discs."""
    if kind == "discs":
        law, drive = (
            cf.drilling.Stribeck(11e3, 6e3, 2.0),
            cf.drilling.TopDrive(6.0, 930.0, cf.drilling.PI(2000.0, 900.0)),
        )
        return cf.drilling.Drilling(
            cf.drilling.Discs((10.0, 2782.0, 750.0), (698.0, 1080.0)), drive, cf.drilling.BitOnRock(law)
        )
    path = cf.well.WellPath.from_survey([0, 500, 1100, 2000], [0, 0, 60, 60], [0, 0, 0, 0])
    hole = cf.well.Borehole(path, cf.well.HoleSection(2000.0, 0.2159, 0.25))
    string = cf.well.DrillString([cf.well.Collar(150.0, "NC46-65"), cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
    friction = cf.drilling.WallFriction(0.3, 0.2, 1.0, of_rotation=True)
    drive = cf.drilling.TopDrive(4.0, 2900.0, cf.drilling.SoftSpeed(string, 2900.0, depth=2000.0))
    hook = cf.drilling.Hook(speed=cf.signals.Sine((0.1,), 0.2)) if kind == "axial and torsional" else None
    return cf.drilling.Drilling(string, drive, None, hole, hook, cf.well.Mud(1200.0), friction)


def run_in(folder, kind):
    """In a process of its own: a motion that keeps its state as often as it can."""
    from cosserat_fenicsx.storage.store import Store

    Store.APART, Store.SELDOM = 0.0, 0
    cf.drilling.simulate(scene_of(kind), DURATION, folder=folder)


@pytest.mark.parametrize("kind", ["torsion", "axial and torsional", "discs"])
def test_kill_9(kind, tmp_path):
    place = tmp_path / "killed"
    code = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); import {Path(__file__).stem} as t;"
    process = subprocess.Popen([sys.executable, "-c", f"{code} t.run_in({str(place)!r}, {kind!r})"])
    until = time.monotonic() + 60
    while process.poll() is None and time.monotonic() < until:
        if (place / "series.npy").exists() and (place / "series.npy").stat().st_size > 2e5:
            break
        time.sleep(0.001)
    process.kill()
    process.wait()
    whole = cf.drilling.simulate(scene_of(kind), DURATION)
    assert 0 < len(cf.read(place)) < len(whole)
    again = cf.resume(place)
    assert np.array_equal(again.rows, whole.rows, equal_nan=True) and again.counts == whole.counts
    for name in ("profile_times", "angle", "speed", "torque", "tension", "sticking"):
        assert np.array_equal(getattr(again, name), getattr(whole, name), equal_nan=name != "sticking"), name
    if kind != "discs":
        assert whole.sticking.any() and not whole.sticking.all()
