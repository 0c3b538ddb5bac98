"""Estimated errors by the step of strings in motion, and what the estimate compares."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from torsion_scenes import PIPE, SPEED, off_bottom, run, stick_slip, string

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.elements import AxialTorsional
from cosserat_fenicsx.drilling.stick_slip import cycle_of, step_errors
from cosserat_fenicsx.drilling.torsion import TorsionWaves

pytestmark = [pytest.mark.serial, pytest.mark.once]


def other(model, factor):
    return TorsionWaves(model.scene, factor * model.dt)


def test_a_rotation_to_the_left_is_the_mirror_image():
    models = [TorsionWaves(stick_slip(sign * 2 * np.pi), 20 / SPEED) for sign in (1, -1)]
    (right, ours), (left, theirs) = (
        (cycle_of(rows, 30), step_errors(m.dt, partial(other, m), rows, 30)) for m in models for rows in run(m, 60)[1:]
    )
    assert left == pytest.approx((right.period, right.peak, -right.largest_torque, -right.least_torque), rel=1e-12)
    assert theirs == pytest.approx((ours.period, ours.peak, ours.largest_torque, ours.least_torque), rel=1e-9)
    assert right.peak > 15 and ours.peak > 0


@pytest.mark.parametrize("model", ["torsion", "axial and torsional"])
def test_where_friction_allows_no_longer_step_a_shorter_one_is_compared(model):
    scene = replace(off_bottom()[0], friction=cf.drilling.WallFriction(0.3, 0.195, 0.05, of_rotation=True))
    errors = cf.drilling.simulate(scene, 9, model=model, check=True, progress=False).errors
    assert 0 < errors.peak < 5 and 0 < errors.largest_torque < 1000


def test_a_mesh_that_cannot_be_coarser_is_compared_with_a_finer_one():
    found = cf.drilling.simulate(
        stick_slip(), 60, model="axial and torsional", elements=2, check=True, progress=False
    )
    assert len(found.depths) == 4
    finer = cycle_of(run(AxialTorsional(stick_slip(), found.dt / 2, 6), 60)[1], 30)
    assert found.errors == pytest.approx(2 * np.abs(np.subtract(cycle_of(found.rows, 30), finer)), rel=1e-6)


def test_a_matched_drive_has_the_impedance_of_the_uppermost_component_however_short_it_is():
    """A short thin sub above a stub and pipe: within a cell with them it must not change the drive."""
    laid = string((5.0, 0.08, 0.03), (0.7, 0.25, 0.05), (2000.0, *PIPE[1:]))
    scene = cf.drilling.Drilling(laid, cf.drilling.TopDrive(6.0, control=cf.drilling.Matched()))
    Z = scene.segments[0].torsional_impedance
    told = replace(scene, drive=cf.drilling.TopDrive(6.0, control=cf.drilling.Matched(Z)))
    assert Z < 100
    rows, given = (run(TorsionWaves(x, 20 / SPEED), 10)[1] for x in (scene, told))
    assert np.array_equal(rows, given, equal_nan=True)


def test_a_refused_step_is_told_with_one_that_passes():
    scene = replace(off_bottom()[0], friction=cf.drilling.WallFriction(0.3, 0.195, 0.05, of_rotation=True))
    with pytest.raises(cf.SceneError, match=r"dt = 0.02 s: expected at most about (\S+) s") as refused:
        AxialTorsional(scene, 0.02, axial=False)
    told = float(str(refused.value).split("about ")[1].split()[0])
    assert told > 1e-3 and AxialTorsional(scene, told, axial=False).dt == told


CUTTING = cf.drilling.Cutting(a=0.108, epsilon=60e6, zeta=0.6, blades=4)


@pytest.mark.parametrize(
    ("law", "torque", "most"), [(cf.drilling.Stribeck(6e3, 4e3), 60e3, 1.0), (CUTTING, 9e3, np.pi / 8)]
)
def test_a_bit_below_a_motor_that_turns_too_far_in_a_step_is_refused(law, torque, most):
    """A motor has no speed asked for: the rotation in a step is known afterwards alone."""
    scene = cf.drilling.Drilling(
        string(PIPE),
        cf.drilling.TopDrive(inertia=100.0, control=cf.drilling.Motor(torque)),
        cf.drilling.BitOnRock(law, inertia=50.0),
        hook=cf.drilling.Hook(speed=0.0),
        drag=cf.drilling.ViscousDrag(0.1),
    )
    with pytest.raises(cf.NotConverged, match=r"the bit turns by .* rad in a step of .* expected a shorter dt") as stop:
        cf.drilling.simulate(scene, 60.0, dt=0.02, progress=False)
    history = stop.value.path
    assert len(history) > 10 and np.abs(history.bit_speed).max() * history.dt <= most
    assert len(cf.drilling.simulate(scene, float(history.times[-1]), dt=0.02, progress=False)) == len(history)
