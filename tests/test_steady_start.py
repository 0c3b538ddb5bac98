"""Strings that start in steady rotation: nothing changes, and the torque is that of torque and drag."""

import numpy as np
import pytest
from axial_scenes import column

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.elements import AxialTorsional
from cosserat_fenicsx.drilling.torsion import TorsionWaves

pytestmark = [pytest.mark.serial, pytest.mark.once]
LAW = cf.drilling.Stribeck(6000.0, 4000.0, 3.0)
SPEED = 100 * cf.units.rpm


def drilling(drive=None, start="steady", **more):
    path = cf.well.WellPath.from_survey([0, 500, 1100, 2600], [0, 0, 40, 40], [30, 30, 30, 30])
    hole = cf.well.Borehole(path, cf.well.HoleSection(2600.0, 0.2159, 0.25))
    string = cf.well.DrillString([cf.well.Collar(90.0, "NC46-65"), cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
    drive = drive or cf.drilling.TopDrive(SPEED, 2900.0, cf.drilling.PI(38e3, 1e5))
    return cf.drilling.Drilling(string, drive, hole=hole, mud=cf.well.Mud(1200.0), start=start, **more)


@pytest.mark.parametrize("drive", [None, cf.drilling.TopDrive(SPEED)], ids=["PI", "stiff"])
@pytest.mark.parametrize(
    "model",
    [
        lambda x: TorsionWaves(x, 0.011),
        lambda x: AxialTorsional(x, 0.01, 100),
        lambda x: AxialTorsional(x, 0.01, 100, axial=False),
    ],
)
def test_nothing_changes(model, drive):
    scene = drilling(
        drive,
        bit=cf.drilling.BitOnRock(LAW, weight=50e3, inertia=50.0),
        drag=cf.drilling.ViscousDrag(0.3, 0.3),
        friction=cf.drilling.WallFriction(0.25, 0.2, 0.5),
    )
    rows = model(scene).advance(300)
    for name in ("bit_speed", "drive_speed", "surface_torque", "torque_on_bit"):
        assert np.abs(column(rows, name) / column(rows, name)[0] - 1).max() < 1e-8, name
    assert column(rows, "bit_speed")[0] == pytest.approx(SPEED, rel=1e-9)
    assert column(rows, "torque_on_bit")[0] == pytest.approx(4000 + 2000 * np.exp(-SPEED / 3), rel=1e-9)


@pytest.mark.parametrize("model", ["torsion", "axial and torsional"])
def test_the_books_begin_with_the_energy_of_the_start(model):
    history = cf.drilling.simulate(
        drilling(bit=cf.drilling.BitOnRock(LAW, weight=50e3, inertia=50.0)), 5.0, model=model
    )
    assert np.abs(history.balance).max() < 1e-9 * history.work_of_drive[-1] and history.kinetic[0] > 1e3
    assert any("steady" in sentence for sentence in history.why)


@pytest.mark.parametrize("model", [lambda x: TorsionWaves(x, 0.002), lambda x: AxialTorsional(x, 0.002, 600)])
def test_surface_torque_is_that_of_torque_and_drag(model):
    scene = drilling()
    soft = cf.well.torque_and_drag(
        scene.hole,
        scene.string,
        cf.well.RotateOffBottom(),
        mud=scene.mud,
        model="soft",
        tol=1e-8,
        torque_convention="johancsik",
    )
    assert column(model(scene).advance(1), "surface_torque")[0] == pytest.approx(soft.surface_torque, rel=2e-3)


@pytest.mark.parametrize(
    "drive",
    [
        cf.drilling.TopDrive(control=cf.drilling.Motor(5e3)),
        cf.drilling.TopDrive(SPEED, 0.0, cf.drilling.Matched()),
        cf.drilling.TopDrive(0.0),
        cf.drilling.TopDrive(cf.signals.RunUp((SPEED,), end=5.0)),
    ],
)
@pytest.mark.parametrize("model", [TorsionWaves, AxialTorsional])
def test_a_drive_without_a_steady_speed_is_refused(model, drive):
    with pytest.raises(cf.SceneError, match="Drilling.start = 'steady': expected 'rest'"):
        model(drilling(drive))
