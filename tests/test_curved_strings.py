"""Rods of drill-strings in bent holes, in motion from their equilibria at rest, below pipe with friction at the wall."""

import numpy as np
import pytest
from torsion_scenes import part

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
MESH = {"elements": 20, "degree": 2}


def well(length=300.0, turn=0.0, build=5.0):
    """Vertical for 100 m, then it builds 5 degrees every 30 m up to 40, and turns."""
    md = np.arange(0.0, length + 1, 10.0)
    pieces = np.clip((md - 100.0) / 30.0, 0.0, None)
    return cf.well.WellPath.from_survey(md, np.clip(build * pieces, 0.0, 40.0), turn * pieces, degrees=True)


def drilling(drive, *, friction=0.25, path=None, bit=None, parts=None, drag=None, hole=0.2159, **more):
    path = path or well(turn=3.0)
    collars, pipe = part(60.0, 0.1651, 0.05715, weight=1200.0), part(path.length - 60.0, 0.127, 0.10861, weight=250.0)
    section = cf.well.HoleSection(path.length, hole, friction)
    return cf.drilling.Drilling(
        cf.well.DrillString(parts or (collars, pipe)),
        cf.drilling.TopDrive(drive),
        bit,
        cf.well.Borehole(path, section, wall_stiffness=1e8),
        drag=drag and cf.drilling.ViscousDrag(drag, drag),
        **more,
    )


def imbalance(history):
    change = history.energy - history.work + history.dissipated
    return np.abs(change - change[0]).max() / max(history.energy.max(), history.dissipated.max())


@pytest.mark.parametrize("depth", [200.0, 25.0])
def test_at_rest_in_a_bent_hole_nothing_moves(depth):
    """The assembly, and the whole string, with the friction of the wall, which is not needed: to 1e-12 m."""
    mixed = cf.drilling.mixed_scene(drilling(0.0), depth)
    start = mixed.rest(**MESH)
    assert start.stable[0]
    history = cf.simulate(mixed.scene, 0.02, dt=2e-3, **MESH, start=start)
    for s in (1.0, 30.0, 60.0, 99.0):
        place = history.position(mixed.rod.at(s))
        assert np.abs(place - place[0]).max() < 1e-11
    assert history.kinetic.max() < 1e-9 * history.strain[0] and imbalance(history) < 1e-10
    pull = history.force(mixed.rod.start) @ mixed.above.down()
    assert pull == pytest.approx(mixed.above.tension, rel=1e-3)
