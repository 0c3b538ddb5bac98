"""Axial and torsional motion by elements: closed forms, friction as a vector, steady starts."""

import numpy as np
import pytest
from axial_scenes import IMPEDANCE, MU, SPEED, WEIGHT, column, hanging, in_a_well, string, unbalanced
from scipy.linalg import eigvalsh
from torsion_scenes import LAW, PIPE, SOFT, Turn, lying, off_bottom, stick_slip
from torsion_scenes import part as part_of

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.bit_laws import EndForce
from cosserat_fenicsx.drilling.elements import AxialTorsional
from cosserat_fenicsx.drilling.protocol import PROFILE
from cosserat_fenicsx.drilling.stick_slip import cycle_of
from cosserat_fenicsx.drilling.torsion import TorsionWaves

pytestmark = [pytest.mark.serial, pytest.mark.once]
# Of the pipe and the collars, Hz, from the transcendental equation.
FREQUENCIES = {
    5e6: (0.30553636274474666, 0.9808152730876113, 1.7320998057762933, 2.5179520090783853),
    np.inf: (0.31638592263763815, 1.020855011562465, 1.8063829278567385, 2.6254960072287594),
}


@pytest.mark.parametrize("stiffness", FREQUENCIES)
def test_natural_frequencies_of_a_hanging_string(stiffness):
    """Those of the midpoint rule with the model's matrices, whose shares of mass make up for its error in time."""
    errors = []
    for dt, elements in ((0.004, 120), (0.002, 240)):
        chain = AxialTorsional(hanging(cf.drilling.Hook(stiffness)), dt, elements)._chain
        spring, free = chain.spring[:, 0], int(np.isinf(stiffness))
        K = np.diag(np.append(spring, 0) + np.append(0, spring)) - np.diag(spring, 1) - np.diag(spring, -1)
        M = np.diag(chain.mass[:, 0]) + np.diag(chain.mass_off[:, 0], 1) + np.diag(chain.mass_off[:, 0], -1)
        K[0, 0] += 0.0 if free else stiffness
        found = eigvalsh(K[free:, free:], M[free:, free:])[:4]
        found = np.arctan(dt / 2 * np.sqrt(found)) / dt / np.pi
        errors.append(np.abs(found / FREQUENCIES[stiffness] - 1).max())
    assert errors[1] < 2e-6 and errors[1] < errors[0] / 3.5


def test_a_block_that_stops():
    """As a block that starts, turned round: Z v, with collars more from 2 L/c on; with a hook that yields,
    Z v (1 - exp(-k t/Z)) first, and later what characteristics give."""
    dt = 0.001
    rows = AxialTorsional(hanging(cf.drilling.Hook(speed=1.0)), dt, 500).advance(1249)
    t, force = rows[:, 0], column(rows, "hook_load")
    first, second = (t > 0.02) & (t < 1.15), t > 2 * 3000 / SPEED + 0.008
    assert force[first] == pytest.approx(IMPEDANCE[0], rel=2e-3)
    assert force[second].mean() == pytest.approx(326805.3383015774, rel=4e-3)
    rows = AxialTorsional(hanging(cf.drilling.Hook(5e6, 1.0)), dt, 500).advance(5000)
    t, force = rows[:, 0] - dt / 2, column(rows, "hook_load")
    first = t < 1.1
    told = IMPEDANCE[0] * (1 - np.exp(-5e6 * t[first] / IMPEDANCE[0]))
    assert force[first] == pytest.approx(told, abs=1e-3 * IMPEDANCE[0])
    later = {1.5: 23482.717, 2.0: -121797.505, 2.5: -83699.092, 3.0: -87762.483, 4.0: 151227.646, 5.0: -136464.381}
    for at, value in later.items():
        assert np.interp(at, t, force) == pytest.approx(value, abs=2e-3 * 288045)
    assert force.max() == pytest.approx(288045.3722321409, rel=1e-3)
    assert unbalanced(rows) < 1e-11


@pytest.mark.parametrize("axial", [False, True])
def test_stick_slip_at_60_rpm(axial):
    model = AxialTorsional(stick_slip(), 0.005, 250, axial=axial)
    rows = model.advance(24000)
    found = cycle_of(rows, 60)
    assert found.period == pytest.approx(6.0428, rel=2e-4)
    assert found[1:] == pytest.approx((15.079233719173985, 2062.8594693619634, 8571.096531955363), rel=3e-3)
    assert model.counts["halved"] == 0 and unbalanced(rows) < 1e-11


@pytest.mark.parametrize("axial", [False, True])
def test_a_soft_drive_calms_it(axial):
    rows = AxialTorsional(stick_slip(**SOFT), 0.01, 250, axial=axial).advance(12000)
    assert cycle_of(rows, 60)[1:] == pytest.approx((6.627654032865599, 4879.782470503436, 5106.509919651566), rel=5e-4)
    drive = column(rows[rows[:, 0] > 60], "drive_speed")
    assert (drive.min(), drive.max()) == pytest.approx((6.227606627970457, 6.347672726001818), rel=2e-4)
    assert unbalanced(rows) < 1e-11


def test_discs_at_the_speed_where_their_steady_motion_becomes_unstable():
    """2.7652598516 rad/s under 97 347 N, for a constant torque of the motor."""
    W, R, grows = 97347.0, 0.155575, []
    discs = cf.drilling.Discs(
        (930.0, 2782.25, 750.0, 471.9698), (698.063, 1080.0, 907.48), (139.6126, 190.0, 181.49), (0.0, 0.0, 0.0, 50.0)
    )
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(0.8, 0.5, 1 / 0.9, radius=R), W)
    for speed in (2.7652598516 * 0.995, 2.7652598516 * 1.005):
        on_bit = W * R * (0.5 + 0.3 * np.exp(-0.9 * speed))
        drive = cf.drilling.TopDrive(control=cf.drilling.Motor(on_bit + 475 * speed, 425.0))
        model = AxialTorsional(cf.drilling.Drilling(discs, drive, bit), 0.01)
        x, v = model._kept["x"], model._kept["v"]
        moments = on_bit + 50 * speed
        x[1:, 0] = -np.cumsum(moments / np.array([698.063, 1080.0, 907.48]))
        v[:] = speed * 1.0001
        om = column(model.advance(200000), "bit_speed")
        grows.append(np.ptp(om[-2000:]) > np.ptp(om[20000:22000]))
    assert grows == [True, False]


def test_a_signal_that_jumps_ends_steps():
    """A string whose drive jumps within a step moves as with steps that end there."""

    def asked(t):
        return 1.0 if t < 0.0137 else 3.0

    asked.jumps = (0.0137,)
    scene = cf.drilling.Drilling(string(PIPE), cf.drilling.TopDrive(asked))
    rows = AxialTorsional(scene, 0.01, 20, axial=False).advance(20)
    assert column(rows, "drive_angle")[-1] == pytest.approx(0.0137 + 3 * (0.2 - 0.0137), rel=1e-12)
    assert unbalanced(rows) < 1e-12


class Swallow:
    """A bit that swallows all waves, which arrive with its impedances, and counts what it did."""

    def __init__(self, *impedances):
        self.tangent, self.steps = np.diag(impedances), 0

    def begin(self, model, h):
        assert model.bit_state().shape == (2, 2)
        return EndForce(np.zeros(2), self.tangent)

    def commit(self, model, h):
        self.steps += 1

    def memory(self):
        return {"steps": self.steps}

    def recall(self, memory):
        self.steps = memory["steps"]


def test_other_laws_of_the_bit_plug_in_as_end_conditions():
    cutting = cf.drilling.BitOnRock(cf.drilling.Cutting(0.1, 60e6, 0.6, 4))
    lobed = cf.drilling.BitOnRock(cf.drilling.Lobes(3, 0.002, LAW), 80e3, inertia=50.0)
    laid, drive = string(PIPE), cf.drilling.TopDrive(1.0)
    scene = cf.drilling.Drilling(laid, drive, cutting, hook=cf.drilling.Hook(speed=-0.1))
    lobes = cf.drilling.Drilling(laid, drive, lobed)
    assert column(AxialTorsional(lobes, 0.01, 50, axial=False).advance(100), "torque_on_bit").max() > 0
    Z = IMPEDANCE[0], 296.3752962822167
    end = Swallow(*Z)
    model = AxialTorsional(scene, 0.004, 200, end=end)
    rows = model.advance(1000)
    late = rows[rows[:, 0] > 3]
    for name, value in (
        ("bit_velocity", 0.1), ("bit_speed", 1.0), ("weight_on_bit", 0.1 * Z[0]), ("torque_on_bit", Z[1]),
        ("surface_torque", Z[1]), ("hook_load", -0.1 * Z[0]),
    ):  # fmt: skip
        assert column(late, name) == pytest.approx(value, rel=5e-3)
    assert end.steps == 1000 and unbalanced(rows) < 1e-12
    kept = model.memory()
    model.advance(10)
    model.recall(kept)
    assert end.steps == 1000


def test_the_same_digits_after_recall():
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(0.6, 0.3, 3.0, radius=0.1), 80e3, inertia=50.0, mass=300.0)
    hook, drive = cf.drilling.Hook(5e6, -0.001), cf.drilling.TopDrive(6.0, **SOFT)
    scene = hanging(hook, drive, bit, 300.0, drag=cf.drilling.ViscousDrag(0.2, 0.1))
    first, second = (AxialTorsional(scene, 0.01, 100) for _ in range(2))
    rows, profiles = first.advance(3000), first.profile()
    second.advance(1234)
    kept = second.memory()
    second.advance(77)
    third = AxialTorsional(scene, 0.01, 100)
    third.recall(kept)
    assert np.array_equal(third.advance(1766), rows[1234:]) and np.array_equal(third.profile(), profiles)
    assert third.counts == first.counts and third.time == first.time
    assert profiles.shape == (len(PROFILE), len(first.depths))


def test_a_step_that_fails_returns_what_was_done():
    class Broken(Swallow):
        def begin(self, model, h):
            return EndForce(np.zeros(2), self.tangent * (np.nan if model.time > 0.095 else 1.0))

    scene = cf.drilling.Drilling(string(PIPE), cf.drilling.TopDrive(1.0), cf.drilling.BitOnRock(LAW, inertia=50.0))
    model = AxialTorsional(scene, 0.01, 50, end=Broken(1.0, 1.0))
    with pytest.raises(cf.NotConverged, match="t = 0.1 s does not converge") as told:
        model.advance(20)
    assert told.value.rows[:, 0] == pytest.approx(np.arange(1, 11) * 0.01) and np.isfinite(told.value.rows).all()


def test_what_is_refused():
    steep, hard = (
        cf.drilling.Drilling(
            string(PIPE),
            cf.drilling.TopDrive(1.0),
            cf.drilling.BitOnRock(cf.drilling.Stribeck(6e3, 4e3, decay), **more),
        )
        for decay, more in ((3.0, {}), (0.1, {"inertia": 20.0}))
    )
    with pytest.raises(cf.SceneError, match="law.*666.667 N m per rad/s.*impedance.*296.375"):
        AxialTorsional(steep)
    with pytest.raises(cf.SceneError, match=r"dt = 0.01 s: expected at most about 0.00\d+ s"):
        AxialTorsional(hard, 0.01, 50)
    assert AxialTorsional(hard, elements=50).dt < 0.005
    for arguments, told in (({"dt": 0.0}, "dt"), ({"elements": 1}, "elements"), ({"elements": 20.5}, "elements")):
        with pytest.raises(cf.SceneError, match=told):
            AxialTorsional(hard, **arguments)
    discs = cf.drilling.Discs((100.0, 100.0), (500.0,))
    with pytest.raises(cf.SceneError, match="impedance"):
        AxialTorsional(cf.drilling.Drilling(discs, cf.drilling.TopDrive(1.0, control=cf.drilling.Matched())))


def test_torsion_alone_does_not_feel_the_hook():
    """Nor does a drive without inertia, whose node the hook would hold."""
    drive = cf.drilling.TopDrive(3.0, control=cf.drilling.Matched())
    rows = [
        AxialTorsional(hanging(hook, drive), 0.005, 100, axial=False).advance(300)
        for hook in (None, cf.drilling.Hook(5e6, 0.5))
    ]
    np.testing.assert_array_equal(*rows)


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
    scene = in_a_well(*STRAIGHT, cf.drilling.Hook(speed=0.3), drag=cf.drilling.ViscousDrag(axial=rate))
    rows = steady(AxialTorsional(scene, 0.0025, 100), 60)
    told = hanging_load + MU * ACROSS * 1500 + rate * rho_a * 0.3 * 1500
    load = column(rows, "hook_load")
    assert load.mean() == pytest.approx(told, rel=1e-6) and np.abs(load - told).max() < 1e-4 * told
    assert np.all(column(rows, "surface_torque") == 0)
    scene = in_a_well(*STRAIGHT, turns=2 * np.pi, drag=cf.drilling.ViscousDrag(rate))
    rows = steady(AxialTorsional(scene, 0.0025, 100), 60)
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


def test_a_pipe_turned_slowly_and_back():
    """M = sqrt(2 GJ m phi); back by dphi to l2 = sqrt(GJ dphi/m), and M = m l1 - 2 m l2."""
    m = 3.52427441057226
    model = AxialTorsional(lying(cf.drilling.TopDrive(Turn(2 * np.pi, np.pi / 2, 120.0))), 0.01, 250, axial=False)
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
    pipe, drive = (
        cf.well.DrillString(parts, order="top down"),
        cf.drilling.TopDrive(8.0, 2900.0, cf.drilling.PI(1e4, 1e4)),
    )
    given = {
        "hole": cf.well.Borehole(path, cf.well.HoleSection(5000, 0.2159, 0.3)),
        "drag": cf.drilling.ViscousDrag(0.1, 0.1),
        "friction": cf.drilling.WallFriction(1.0, 0.7, 1.0, of_rotation=True, of_hole=True),
    }  # fmt: skip
    for hook in (None, cf.drilling.Hook(5e6, 0.3)):
        scene = cf.drilling.Drilling(pipe, drive, hook=hook, **given)
        model = AxialTorsional(scene, 0.01, 250)
        rows = model.advance(3000)
        assert model.counts["halved"] == 0 and model.counts["iterations"] < 4 * 3000 and unbalanced(rows) < 1e-11
        assert np.diff(column(rows, "lost_at_wall")).min() >= 0


ROCK = cf.drilling.Stribeck(6000.0, 4000.0, 3.0)
TURNING = 100 * cf.units.rpm


def drilling(drive=None, start="steady", **more):
    path = cf.well.WellPath.from_survey([0, 500, 1100, 2600], [0, 0, 40, 40], [30, 30, 30, 30])
    hole = cf.well.Borehole(path, cf.well.HoleSection(2600.0, 0.2159, 0.25))
    string = cf.well.DrillString([cf.well.Collar(90.0, "NC46-65"), cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
    drive = drive or cf.drilling.TopDrive(TURNING, 2900.0, cf.drilling.PI(38e3, 1e5))
    return cf.drilling.Drilling(string, drive, hole=hole, mud=cf.well.Mud(1200.0), start=start, **more)


@pytest.mark.parametrize("drive", [None, cf.drilling.TopDrive(TURNING)], ids=["PI", "stiff"])
@pytest.mark.parametrize("model", [
    lambda x: TorsionWaves(x, 0.011),
    lambda x: AxialTorsional(x, 0.01, 100),
    lambda x: AxialTorsional(x, 0.01, 100, axial=False),
])  # fmt: skip
def test_nothing_changes(model, drive):
    drag, friction = cf.drilling.ViscousDrag(0.3, 0.3), cf.drilling.WallFriction(0.25, 0.2, 0.5)
    scene = drilling(drive, bit=cf.drilling.BitOnRock(ROCK, 50e3, inertia=50.0), drag=drag, friction=friction)
    rows = model(scene).advance(300)
    for name in ("bit_speed", "drive_speed", "surface_torque", "torque_on_bit"):
        assert np.abs(column(rows, name) / column(rows, name)[0] - 1).max() < 1e-8, name
    assert column(rows, "bit_speed")[0] == pytest.approx(TURNING, rel=1e-9)
    assert column(rows, "torque_on_bit")[0] == pytest.approx(4000 + 2000 * np.exp(-TURNING / 3), rel=1e-9)


@pytest.mark.parametrize("model", ["torsion", "axial and torsional"])
def test_the_books_begin_with_the_energy_of_the_start(model):
    history = cf.drilling.simulate(
        drilling(bit=cf.drilling.BitOnRock(ROCK, weight=50e3, inertia=50.0)), 5.0, model=model
    )
    assert np.abs(history.balance).max() < 1e-9 * history.work_of_drive[-1] and history.kinetic[0] > 1e3
    assert any("steady" in sentence for sentence in history.why)


@pytest.mark.parametrize("model", [lambda x: TorsionWaves(x, 0.002), lambda x: AxialTorsional(x, 0.002, 600)])
def test_surface_torque_is_that_of_torque_and_drag(model):
    scene = drilling()
    asked = {"mud": scene.mud, "model": "soft", "tol": 1e-8, "torque_convention": "johancsik"}
    soft = cf.well.torque_and_drag(scene.hole, scene.string, cf.well.RotateOffBottom(), **asked)
    assert column(model(scene).advance(1), "surface_torque")[0] == pytest.approx(soft.surface_torque, rel=2e-3)


@pytest.mark.parametrize("drive", [
    cf.drilling.TopDrive(control=cf.drilling.Motor(5e3)),
    cf.drilling.TopDrive(TURNING, 0.0, cf.drilling.Matched()),
    cf.drilling.TopDrive(0.0),
    cf.drilling.TopDrive(cf.signals.RunUp((TURNING,), end=5.0)),
])  # fmt: skip
@pytest.mark.parametrize("model", [TorsionWaves, AxialTorsional])
def test_a_drive_without_a_steady_speed_is_refused(model, drive):
    with pytest.raises(cf.SceneError, match="Drilling.start = 'steady': expected 'rest'"):
        model(drilling(drive))
