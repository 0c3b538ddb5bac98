"""Axial and torsional motion by elements, without a wall: closed forms, other computations, energy, memory, words."""

import numpy as np
import pytest
from axial_scenes import IMPEDANCE, SPEED, column, hanging, string, unbalanced
from scipy.linalg import eigvalsh
from torsion_scenes import LAW, PIPE, SOFT, stick_slip

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.bit_laws import EndForce
from cosserat_fenicsx.drilling.elements import AxialTorsional
from cosserat_fenicsx.drilling.protocol import PROFILE
from cosserat_fenicsx.drilling.stick_slip import cycle_of

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


@pytest.mark.parametrize(
    ("weight", "torque", "releases", "peak"),
    [
        (97347.0, 10e3, (167.50634780, 175.81200608, 184.11850238), 6.694376635),
        (53018.0, 6e3, (175.02624880, 181.82270104, 188.61915386), 5.092853190),
    ],
)
def test_four_discs(weight, torque, releases, peak):
    """E. M. Navarro-Lopez & D. Cortes, J. Sound Vib. 307 (2007) 152, doi:10.1016/j.jsv.2007.06.037: limit cycles."""
    discs = cf.drilling.Discs(
        (930.0, 2782.25, 750.0, 471.9698), (698.063, 1080.0, 907.48), (139.6126, 190.0, 181.49), (0.0, 0.0, 0.0, 50.0)
    )
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(0.8, 0.5, 1 / 0.9, radius=0.155575), weight)
    model = AxialTorsional(
        cf.drilling.Drilling(discs, cf.drilling.TopDrive(control=cf.drilling.Motor(torque, 425.0)), bit), 0.0025
    )
    rows = model.advance(80000)
    t, om = rows[:, 0], column(rows, "bit_speed")
    starts = t[:-1][(om[1:] > 0) & (om[:-1] == 0) & (t[:-1] > releases[0] - 1)]
    assert starts[:3] == pytest.approx(releases, abs=0.01)
    assert om[t > 160].max() == pytest.approx(peak, rel=1e-3)
    assert unbalanced(rows) < 1e-11 and np.isnan(column(rows, "hook_load")).all()


def test_discs_at_the_speed_where_their_steady_motion_becomes_unstable():
    """2.7652598516 rad/s under 97 347 N, for a constant torque of the motor."""
    W, R, grows = 97347.0, 0.155575, []
    discs = cf.drilling.Discs(
        (930.0, 2782.25, 750.0, 471.9698), (698.063, 1080.0, 907.48), (139.6126, 190.0, 181.49), (0.0, 0.0, 0.0, 50.0)
    )
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(0.8, 0.5, 1 / 0.9, radius=R), W)
    for speed in (2.7652598516 * 0.995, 2.7652598516 * 1.005):
        on_bit = W * R * (0.5 + 0.3 * np.exp(-0.9 * speed))
        model = AxialTorsional(
            cf.drilling.Drilling(
                discs, cf.drilling.TopDrive(control=cf.drilling.Motor(on_bit + 475 * speed, 425.0)), bit
            ),
            0.01,
        )
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
    scene = cf.drilling.Drilling(
        string(PIPE),
        cf.drilling.TopDrive(1.0),
        cf.drilling.BitOnRock(cf.drilling.Cutting(0.1, 60e6, 0.6, 4)),
        hook=cf.drilling.Hook(speed=-0.1),
    )
    lobes = cf.drilling.Drilling(
        scene.string, scene.drive, cf.drilling.BitOnRock(cf.drilling.Lobes(3, 0.002, LAW), 80e3, inertia=50.0)
    )
    assert column(AxialTorsional(lobes, 0.01, 50, axial=False).advance(100), "torque_on_bit").max() > 0
    Z = IMPEDANCE[0], 296.3752962822167
    end = Swallow(*Z)
    model = AxialTorsional(scene, 0.004, 200, end=end)
    rows = model.advance(1000)
    late = rows[rows[:, 0] > 3]
    for name, value in (
        ("bit_velocity", 0.1),
        ("bit_speed", 1.0),
        ("weight_on_bit", 0.1 * Z[0]),
        ("torque_on_bit", Z[1]),
        ("surface_torque", Z[1]),
        ("hook_load", -0.1 * Z[0]),
    ):
        assert column(late, name) == pytest.approx(value, rel=5e-3)
    assert end.steps == 1000 and unbalanced(rows) < 1e-12
    kept = model.memory()
    model.advance(10)
    model.recall(kept)
    assert end.steps == 1000


def test_the_same_digits_after_recall():
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(0.6, 0.3, 3.0, radius=0.1), 80e3, inertia=50.0, mass=300.0)
    scene = hanging(
        cf.drilling.Hook(5e6, -0.001),
        cf.drilling.TopDrive(6.0, **SOFT),
        bit,
        300.0,
        drag=cf.drilling.ViscousDrag(0.2, 0.1),
    )
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
    steep = cf.drilling.Drilling(
        string(PIPE), cf.drilling.TopDrive(1.0), cf.drilling.BitOnRock(cf.drilling.Stribeck(6000.0, 4000.0, 3.0))
    )
    with pytest.raises(cf.SceneError, match="law.*666.667 N m per rad/s.*impedance.*296.375"):
        AxialTorsional(steep)
    hard = cf.drilling.Drilling(
        string(PIPE),
        cf.drilling.TopDrive(1.0),
        cf.drilling.BitOnRock(cf.drilling.Stribeck(6000.0, 4000.0, 0.1), inertia=20.0),
    )
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
