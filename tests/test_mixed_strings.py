"""Rods for the lower part of a string under the waves of its pipe: with a bit against the string models, in a hole."""

import math
from dataclasses import replace

import numpy as np
import pytest
from ended_motions import Stopped, stop_at
from torsion_scenes import COLLARS, LAW, PIPE, part

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial
SMALL = {"elements": 4, "degree": 2}


def drilling(law=LAW, *, drag=0.3, inertia=50.0, weight=None, **more):
    """Collars and pipe with a bit, under a drive that starts smoothly."""
    drive = cf.drilling.TopDrive(lambda t: math.pi * (1 - math.cos(math.pi * min(t, 1))))
    string = cf.well.DrillString((part(*COLLARS), part(*PIPE)))
    bit = None if law is None else cf.drilling.BitOnRock(law, weight=weight, inertia=inertia)
    return cf.drilling.Drilling(string, drive, bit, drag=cf.drilling.ViscousDrag(drag, drag), **more)


def mean_speeds(history, rod):
    """Times in the middle of steps, and the mean speeds over them of a vertical rod's lower end."""
    q = history.rotation(rod.end)
    turned = np.unwrap(2 * np.arctan2(q[:, 3], q[:, 0]))
    return (history.times[1:] + history.times[:-1]) / 2, np.diff(turned) / np.diff(history.times)


def imbalance(history):
    change = history.energy - history.work + history.dissipated
    return np.abs(change - change[0]).max() / history.energy.max()


@pytest.mark.slow
def test_stick_slip_of_the_bit_is_that_of_the_string():
    """The bit slips at 1.9 s, sticks again, and slips once more; its drag is not on the inertia of the bit."""
    string = drilling()
    mixed = cf.drilling.mixed_scene(string, 3000.0)
    history = cf.simulate(mixed.scene, 12.0, dt=0.005, **SMALL)
    whole = cf.drilling.simulate(string, 12.0, dt=5e-4, model="torsion")
    times, speed = mean_speeds(history, mixed.rod)
    off = np.abs(speed - np.interp(times, whole.times, whole.bit_speed))
    assert off[times < 4].max() < 2e-3 and off.max() < 2e-2
    assert speed.max() == pytest.approx(whole.bit_speed.max(), rel=1e-3)
    sticks = np.abs(speed) < 1e-9
    assert sticks[times < 1].all() and sticks[times > 5].any()
    assert imbalance(history) < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["energy", "generalised-alpha"])
def test_other_schemes_agree(scheme):
    mixed = cf.drilling.mixed_scene(drilling(), 3000.0)
    histories = [cf.simulate(mixed.scene, 3.0, dt=0.005, scheme=x, **SMALL) for x in ("momentum", scheme)]
    (_, one), (_, other) = (mean_speeds(history, mixed.rod) for history in histories)
    np.testing.assert_allclose(other, one, atol=0.02)


def test_a_torque_that_drops_at_once():
    """Coulomb: nothing moves until the static torque is reached; then Z om = 2 M_in - T_d."""
    law = cf.drilling.Stribeck(2000.0, 1000.0)
    mixed = cf.drilling.mixed_scene(drilling(law, drag=0.0, inertia=0.0), 3000.0)
    history = cf.simulate(mixed.scene, 3.0, dt=0.002, **SMALL)
    whole = cf.drilling.simulate(drilling(law, drag=0.0, inertia=0.0), 3.0, dt=2.5e-4, model="torsion")
    starts = [t[np.argmax(x > 1e-6)] for t, x in (mean_speeds(history, mixed.rod), (whole.times, whole.bit_speed))]
    assert starts[0] == pytest.approx(starts[1], abs=0.01)
    turned = [np.trapezoid(x, t) if hasattr(np, "trapezoid") else np.trapz(x, t)
              for t, x in (mean_speeds(history, mixed.rod), (whole.times, whole.bit_speed))]  # fmt: skip
    assert turned[0] == pytest.approx(turned[1], rel=5e-3)


def test_resume_gives_identical_digits(tmp_path, monkeypatch):
    """While the bit sticks, and while it slips."""
    mixed = cf.drilling.mixed_scene(drilling(), 3000.0)
    whole = cf.simulate(mixed.scene, 3.6, dt=0.01, **SMALL)
    stop_at(monkeypatch, 330, 0.0)
    with pytest.raises(Stopped):
        cf.simulate(mixed.scene, 3.6, dt=0.01, folder=tmp_path / "kept", **SMALL)
    history = cf.resume(tmp_path / "kept", mixed.scene)
    assert np.abs(mean_speeds(whole, mixed.rod)[1]).max() > 0.1
    for name in ("times", "energy", "work", "dissipated"):
        assert np.array_equal(getattr(history, name), getattr(whole, name))


def inclined(**more):
    path = cf.well.WellPath.from_survey([0, 3200], [0.5, 0.5], [0.3, 0.3], degrees=False)
    hole = cf.well.Borehole(path, cf.well.HoleSection(3200.0, 0.2159, 0.2), wall_stiffness=1e7)
    return drilling(None, hole=hole, **more)


def test_in_an_inclined_hole_it_lies_on_the_wall_and_hangs_in_the_pipe():
    """The pull of the pipe is the weight along the hole; the wall bears what is across; nothing moves at rest."""
    mixed = cf.drilling.mixed_scene(inclined(), 3000.0)
    weight = 200 * 100.0
    assert mixed.above.tension == pytest.approx(weight * math.cos(0.5), rel=1e-12)
    start = cf.solve(mixed.at_rest, [1.0], elements=10, degree=2)
    offset = start.displacement(mixed.rod.at(100.0))[0]
    assert np.linalg.norm(offset) == pytest.approx((0.2159 - 0.1651) / 2, rel=0.02) and offset[2] > 0
    assert np.abs(start.displacement(mixed.rod.start)).max() < 1e-5
    history = cf.simulate(mixed.scene, 0.2, dt=0.002, elements=10, degree=2, start=start)
    assert history.energy[0] > 0 and imbalance(history) < 1e-4
    assert np.abs(history.velocity(mixed.rod.at(100.0))).max() < 2e-3


def test_refusals():
    string = drilling()
    curved = cf.well.WellPath.from_survey([0, 3000, 3200], [0, 0, 0.5], [0, 0, 0], degrees=False)
    cutting = cf.drilling.Cutting(0.108, 60e6, 0.6, 4)
    for scene, depth, words in (
        (string, None, "depth = None: .*lowest DrillPipe"),
        (string, 3300.0, "depth = 3300.0: expected a depth within the string"),
        (
            drilling(None, hole=cf.well.Borehole(curved, cf.well.HoleSection(3200.0, 0.2159, 0.2))),
            3000.0,
            "turns by about",
        ),
        (replace(string, drag=cf.drilling.ViscousDrag(0.3)), 3000.0, "drag = .*the same rate"),
        (drilling(cutting, weight=1e4), 3000.0, "law = .*a Stribeck"),
    ):
        with pytest.raises(cf.SceneError, match=words):
            cf.drilling.mixed_scene(scene, depth)
    steep = cf.drilling.mixed_scene(drilling(cf.drilling.Stribeck(6000.0, 0.0, 0.1), inertia=0.0), 3000.0)
    with pytest.raises(cf.SceneError, match="falls faster with the speed than the rod can follow"):
        cf.simulate(steep.scene, 6.0, dt=0.01, **SMALL)
