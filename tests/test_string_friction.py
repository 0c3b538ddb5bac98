"""Friction as a vector against axial and rotary slip: closed forms of straight and curved wells, fronts, starts."""

import numpy as np
import pytest
from axial_scenes import IMPEDANCE, MU, SPEED, WEIGHT, column, hanging, in_a_well, unbalanced
from torsion_scenes import lying, off_bottom
from torsion_scenes import part as part_of

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.elements import AxialTorsional
from cosserat_fenicsx.drilling.protocol import PROFILE
from cosserat_fenicsx.drilling.stick_slip import cycle_of
from cosserat_fenicsx.drilling.torsion import TorsionWaves

pytestmark = [pytest.mark.serial, pytest.mark.once]
STRAIGHT = [0.0, 1500.0], [60.0, 60.0]
ACROSS = WEIGHT * np.sin(np.pi / 3)


def steady(model, seconds, last=5.0):
    """Rows of the last seconds of a motion from rest."""
    return model.advance(round(seconds / model.dt))[-round(last / model.dt) :]


@pytest.mark.parametrize(("speed", "load"), [(0.3, 209829.94485859264), (-0.3, 123172.36165217214)])
def test_pulled_and_turned_at_once(speed, load):
    """Friction mu w sin(inc) against the slip (V, r Om)."""
    model = AxialTorsional(in_a_well(*STRAIGHT, cf.drilling.Hook(speed=speed), 2 * np.pi), 0.0025, 100)
    rows = steady(model, 40)
    assert column(rows, "hook_load") == pytest.approx(load, rel=1e-6)
    assert column(rows, "surface_torque") == pytest.approx(3659.170460933915, rel=1e-6)
    assert model.counts["halved"] == 0 and unbalanced(rows) < 1e-10


def test_one_way_of_slip_alone():
    """Without a slip across it, friction does not calm what still swings: drag does, and adds what is known."""
    hanging_load, rate, rho_a, rho_j = 166501.15325538238, 0.5, 26.713757953594364, 0.0932481524676923
    rows = steady(
        AxialTorsional(
            in_a_well(*STRAIGHT, cf.drilling.Hook(speed=0.3), drag=cf.drilling.ViscousDrag(axial=rate)), 0.0025, 100
        ),
        60,
    )
    told = hanging_load + MU * ACROSS * 1500 + rate * rho_a * 0.3 * 1500
    load = column(rows, "hook_load")
    assert load.mean() == pytest.approx(told, rel=1e-6) and np.abs(load - told).max() < 1e-4 * told
    assert np.all(column(rows, "surface_torque") == 0)
    rows = steady(
        AxialTorsional(in_a_well(*STRAIGHT, turns=2 * np.pi, drag=cf.drilling.ViscousDrag(rate)), 0.0025, 100), 60
    )
    told = MU * ACROSS * 0.0635 * 1500 + rate * rho_j * 2 * np.pi * 1500
    assert column(rows, "surface_torque").mean() == pytest.approx(told, rel=1e-6)
    assert column(rows, "hook_load") == pytest.approx(hanging_load, rel=1e-9)


def test_through_a_build_section():
    """The soft string of an independent computation; of the second order in the mesh."""
    arc, errors = 314.15926535897927, []
    for elements in (60, 120):
        scene = in_a_well([0.0, arc, arc + 1500], [0.0, 60.0, 60.0], cf.drilling.Hook(speed=0.3), 2 * np.pi)
        rows = steady(AxialTorsional(scene, 0.01, elements), 60)
        load, torque = (column(rows, name).mean() for name in ("hook_load", "surface_torque"))
        errors.append((load / 301989.3437927205 - 1, torque / 6571.193644923769 - 1))
    coarse, fine = np.array(errors)
    assert np.abs(fine).max() < 2e-4 and np.all(coarse / fine > 3.5)


def test_pulled_from_rest():
    """Behind the front the pipe moves with V - f x/(2 Z), and the hook bears Z V + f c t/2 more."""
    V, f, Z, dt = 0.3, MU * ACROSS, IMPEDANCE[0], 0.00047
    model = AxialTorsional(in_a_well(*STRAIGHT, cf.drilling.Hook(speed=V)), dt, 600)
    start = model.profile()[PROFILE.index("tension"), 0]
    rows = model.advance(round(0.2 / dt))
    t, more = rows[:, 0] - dt / 2, column(rows, "hook_load") - start
    late = t > 0.03
    assert more[late] == pytest.approx(Z * V + f * SPEED * t[late] / 2, rel=4e-3)
    x, velocity = model.depths, -model.profile()[PROFILE.index("velocity")]
    behind = (x > 10) & (x < SPEED * t[-1] - 150)
    assert velocity[behind] == pytest.approx(V - f * x[behind] / 2 / Z, abs=0.01 * V)
    assert x[velocity > V / 4].max() == pytest.approx(SPEED * t[-1], rel=8e-3)
    held = model.profile()[PROFILE.index("sticking")]
    assert held[x > SPEED * t[-1] + 40].all() and not held[behind].any()


@pytest.mark.parametrize("axial", [False, True])
def test_a_front_of_torsion_stops_by_itself(axial):
    m, Om, Z, dt = 3.52427441057226, 2 * np.pi, 296.3752962822167, 0.0003
    model = AxialTorsional(lying(cf.drilling.TopDrive(Om)), dt, 3000, axial=axial)
    rows = model.advance(round(0.332 / dt))
    t, x = rows[:, 0] - dt / 2, model.depths
    assert x[model.profile()[PROFILE.index("angle")] > 1e-9].max() == pytest.approx(1056.7740703874679, rel=5e-3)
    late = t > 0.05
    assert column(rows, "surface_torque")[late] == pytest.approx(Z * Om + m * 3178.3503 * t[late] / 2, rel=5e-3)
    assert unbalanced(rows) < 1e-11 and model.counts["halved"] == 0


def test_a_lying_pipe_until_its_end_moves():
    rows = AxialTorsional(lying(cf.drilling.TopDrive(2 * np.pi)), 0.003).advance(3000)
    t, om = rows[:, 0], column(rows, "bit_speed")
    assert t[om != 0][0] == pytest.approx(2.725, rel=2e-3)
    assert column(rows, "surface_torque").max() == pytest.approx(12432.4, rel=1e-3)
    assert om.max() == pytest.approx(12.565, rel=2e-3) and unbalanced(rows) < 1e-11


class Slowly:
    """A turn forward within a time, and a quarter of a turn back within the same time."""

    def __init__(self, within):
        self.within, self.jumps = within, (within, 2 * within)

    def __call__(self, t):
        angle = 2 * np.pi if t < self.within else -np.pi / 2 if t < 2 * self.within else 0.0
        return angle / self.within * (1 - np.cos(2 * np.pi * t / self.within))


def test_a_pipe_turned_slowly_and_back():
    """M = sqrt(2 GJ m phi); back by dphi to l2 = sqrt(GJ dphi/m), and M = m l1 - 2 m l2."""
    m = 3.52427441057226
    model = AxialTorsional(lying(cf.drilling.TopDrive(Slowly(120.0))), 0.01, 250, axial=False)
    rows = model.advance(12000)
    x, angle = model.depths, model.profile()[0]
    slope, end = np.polyfit(x[x < 1700], np.sqrt(angle[x < 1700]), 1)
    assert -end / slope == pytest.approx(1832.702435380757, rel=1e-3)
    assert column(rows, "surface_torque")[-1] == pytest.approx(6458.946295205862, rel=2e-3)
    rows = model.advance(12000)
    assert column(rows, "surface_torque")[-1] == pytest.approx(1891.781570546069, abs=12)
    assert (6458.946 - column(rows, "surface_torque")[-1]) / 2 / m == pytest.approx(647.958, rel=3e-3)


def test_starts_off_bottom():
    """With the wall force without tension, as the reference has it; axial motion changes nothing."""
    found = []
    for axial in (False, True):
        model = AxialTorsional(off_bottom()[0], 0.005, axial=axial)
        model._kept["curvature"][:] = 0.0
        model._lib.limits(model._m)
        limit = model._kept["limit"]
        assert (limit[:, 0] * limit[:, 2]).sum() == pytest.approx(18077.89943213615, rel=1e-5)
        rows = model.advance(4800)
        t, om = rows[:, 0], column(rows, "bit_speed")
        half, starts, armed = 20 * cf.units.rpm, [], True
        for i in range(1, len(t)):
            if armed and om[i] > half:
                starts.append(t[i - 1] + (half - om[i - 1]) / (om[i] - om[i - 1]) * model.dt)
            armed = om[i] <= 0 or (armed and om[i] <= half)
        assert starts == pytest.approx([5.408, 10.78, 16.61, 22.49], rel=6e-3)
        assert model.counts["halved"] == 0 and unbalanced(rows) < 1e-11
        found.append(starts)
    assert found[0] == pytest.approx(found[1], abs=1e-6)


def test_two_methods_agree_on_torsion_in_a_curved_well():
    scene = off_bottom()[0]
    model = AxialTorsional(scene, 0.004, 300, axial=False)
    waves = TorsionWaves(scene, 0.0036)
    a, b = model.advance(2500), waves.advance(round(10 / waves.dt))
    limit = model._kept["limit"]
    assert (limit[:, 0] * limit[:, 2]).sum() == pytest.approx(waves._hold.sum(), rel=1e-4)
    assert cycle_of(a)[1:] == pytest.approx(cycle_of(b)[1:], rel=0.03, abs=50)
    assert column(a, "bit_angle")[-1] == pytest.approx(column(b, "bit_angle")[-1], rel=0.01)


def test_the_tension_at_rest_is_that_of_the_soft_string():
    scene = in_a_well([0.0, 400.0, 900.0, 1800.0], [0.0, 0.0, 50.0, 80.0])
    scene = cf.drilling.Drilling(
        scene.string, scene.drive, cf.drilling.BitOnRock(cf.drilling.Stribeck(0.0, 0.0), 40e3), scene.hole
    )
    model = AxialTorsional(scene, 0.01, 150)
    answer = cf.well.torque_and_drag(
        scene.hole.with_friction(0.0), scene.string, cf.well.RotaryDrilling(40e3, 0.0), model="soft"
    )
    hook = answer.hook_load if not callable(answer.hook_load) else answer.hook_load()
    row = model.advance(1)
    assert column(row, "hook_load")[0] == pytest.approx(hook, rel=1e-9)
    assert column(row, "weight_on_bit")[0] == pytest.approx(40e3, rel=1e-9)


def test_a_bit_that_is_lifted_off_the_rock():
    """The weight on bit falls by the stiffness of the string times the way of the hook, down to nothing; the torque
    of a law with a radius falls with it."""
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(0.5, 0.5, radius=0.1), 80e3, inertia=50.0)
    scene = hanging(
        cf.drilling.Hook(speed=0.005), cf.drilling.TopDrive(3.0), bit, 250.0, drag=cf.drilling.ViscousDrag(0.5, 0.5)
    )
    model = AxialTorsional(scene, 0.01, 100)
    rows = model.advance(10000)
    weight, torque = column(rows, "weight_on_bit"), column(rows, "torque_on_bit")
    compliance = sum(s.length / s.EA for s in scene.segments)
    pressed = (rows[:, 0] > 10) & (rows[:, 0] < 40)
    assert np.abs(weight - (80e3 - 0.005 * rows[:, 0] / compliance))[pressed].max() < 200
    assert weight.min() == 0 and np.all(weight[-2000:] == 0) and column(rows, "bit_advance")[-1] < -0.1
    assert torque[pressed] == pytest.approx(0.05 * weight[pressed], rel=0.01) and np.all(torque[-2000:] == 0)
    assert column(rows, "hook_load")[-1] == pytest.approx(250 * 3200, rel=1e-2)
    assert unbalanced(rows) < 1e-11


def test_falling_friction_of_a_long_string_needs_no_half_steps():
    """Where nothing moves along the axis, and where all does."""
    path = cf.well.WellPath.from_survey([0, 1000, 1500, 5000], [0, 0, 60, 60], np.zeros(4), degrees=True)
    parts = part_of(4800.0, 0.127, 0.10861, weight=220.0), part_of(200.0, 0.1651, 0.05715, weight=1200.0)
    pipe, hole = (
        cf.well.DrillString(parts, order="top down"),
        cf.well.Borehole(path, cf.well.HoleSection(5000, 0.2159, 0.3)),
    )
    for hook in (None, cf.drilling.Hook(5e6, 0.3)):
        scene = cf.drilling.Drilling(
            pipe,
            cf.drilling.TopDrive(8.0, 2900.0, cf.drilling.PI(1e4, 1e4)),
            hook=hook,
            hole=hole,
            friction=cf.drilling.WallFriction(1.0, 0.7, 1.0, of_rotation=True, of_hole=True),
            drag=cf.drilling.ViscousDrag(0.1, 0.1),
        )
        model = AxialTorsional(scene, 0.01, 250)
        rows = model.advance(3000)
        assert model.counts["halved"] == 0 and model.counts["iterations"] < 4 * 3000 and unbalanced(rows) < 1e-11
        assert np.diff(column(rows, "lost_at_wall")).min() >= 0
