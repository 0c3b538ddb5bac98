"""Torsion by waves, and natural frequencies of strings: closed forms, other computations, energy, memory."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from reference_strings import GIVEN, pipe_and_collars, public_discs, tubes
from scipy.optimize import brentq
from string_cells import turn
from torsion_scenes import (
    COLUMN,
    DENSITY,
    LAW,
    PIPE,
    SOFT,
    SPEED,
    Turn,
    imbalance,
    lying,
    off_bottom,
    part,
    run,
    starts_of,
    stick_slip,
)  # fmt: skip
from torsion_scenes import string as string_of

import cosserat_fenicsx as cf
from cosserat_fenicsx import drilling, well
from cosserat_fenicsx.drilling.choose import model_of, on_same_mesh
from cosserat_fenicsx.drilling.elements import AxialTorsional
from cosserat_fenicsx.drilling.linear.impedances import axial, torsional
from cosserat_fenicsx.drilling.linear.roots import Box, all_roots
from cosserat_fenicsx.drilling.protocol import LEDGER, PROFILE, SERIES
from cosserat_fenicsx.drilling.stick_slip import Cycle, cycle_of, step_errors
from cosserat_fenicsx.drilling.torsion import TorsionWaves, cells_of

pytestmark = [pytest.mark.serial, pytest.mark.once]
PIPE_IMPEDANCE = 296.3752962822167
ANGLE, STICKING = PROFILE.index("angle"), PROFILE.index("sticking")
#: Of the lower end off bottom after 1, 2, ... 60 s, rad, by exact waves in cells of 2.5 m with friction at their ends.
REFERENCE_ANGLES = np.array([
    0, 0, 0, 0, 0, 3.68, 13.43, 21.7, 22.21, 22.21, 23.07, 31.58, 42.44, 45.47, 45.47, 45.47, 47.85, 58.92, 69.09,
    69.97, 69.97, 69.97, 73.46, 84.49, 94.16, 94.72, 94.72, 95.48, 101.21, 112.04, 117.52, 117.76, 117.76, 120.61,
    130.02, 138.9, 140.11, 140.11, 140.17, 146.76, 158.51, 164.38, 164.38, 164.38, 165, 173.2, 184.83, 188.79, 188.8,
    188.8, 191.51, 200.94, 209.99, 212.14, 212.14, 212.15, 217.9, 228.75, 235.39, 235.71,
])  # fmt: skip


@pytest.mark.parametrize(("speed", "dt"), [(np.pi, 20 / SPEED), (2 * np.pi, 7.3 / SPEED)])
def test_the_staircase_of_a_torque_that_drops_at_once(speed, dt):
    """Bit without inertia, stiff drive: each 2L/c the wave 2 Z Om is added, and a bit that slips takes all but T_d."""
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(8000.0, 5000.0))
    scene = cf.drilling.Drilling(string_of((2000.0, *PIPE[1:])), cf.drilling.TopDrive(speed), bit)
    model = TorsionWaves(scene, dt)
    travel, Z = 2000 / SPEED, PIPE_IMPEDANCE
    t, rows = run(model, 40 * travel)
    up, angle, slips, found = 0.0, 0.0, False, []
    for k in range(19):
        down = up + 2 * Z * speed
        slips = down > (5000 if slips else 8000)
        om = (down - 5000) / Z if slips else 0.0
        up, angle = down - 2 * Z * om, angle + 2 * travel * om
        start = (2 * k + 1) * travel
        within = (t > start + 2.5 * model.dt) & (t < start + 2 * travel - model.dt / 2)
        assert np.abs(rows[within, COLUMN["bit_speed"]] - om).max() < 1e-9 * speed
        assert np.abs(rows[within, COLUMN["torque_on_bit"]] - (5000 if slips else down)).max() < 1e-6
        assert np.interp(start + 2 * travel, t, rows[:, COLUMN["bit_angle"]]) == pytest.approx(angle, abs=1e-8)
        found.append(om)
    if speed > 4:
        assert found[2] == pytest.approx(20.828609939845805, abs=1e-9)  # of the independent computation
    assert max(found) > 0 and imbalance(rows) < 1e-12


def test_pipe_and_collars_without_damping():
    t, rows = run(TorsionWaves(stick_slip(drag=0.0, of_bit=0.0), 20 / SPEED), 120)
    at = np.searchsorted(t, [10.0, 30.0, 45.0, 60.0])
    assert rows[at, COLUMN["bit_speed"]] == pytest.approx([16.10024677861, 5.24684264009, 0, 2.77614354453], abs=1e-9)
    angles = np.interp([10.0, 30.0, 45.0, 60.0], t, rows[:, COLUMN["bit_angle"]])
    assert angles == pytest.approx([49.37336037702614, 174.95888640943636, 271.9243799244091, 363.5605967335269])
    late = cycle_of(rows, 60)
    assert late[1:] == pytest.approx((16.178322295485245, -1943.8216062767813, 10531.01339814296), rel=1e-8)
    assert imbalance(rows) < 1e-12


def test_stick_slip_at_60_rpm():
    model = TorsionWaves(stick_slip(), 10 / SPEED)
    _, rows = run(model, 120)
    late = cycle_of(rows, 60)
    errors = step_errors(model.dt, lambda factor: TorsionWaves(model.scene, factor * model.dt), rows, 60)
    exact = 6.0428, 15.079233719173985, 2062.8594693619634, 8571.096531955363
    assert late.period == pytest.approx(exact[0], abs=1e-3)
    assert late[1:] == pytest.approx(exact[1:], rel=2e-3)
    assert np.all(np.abs(np.subtract(late, exact)[1:]) < errors[1:]), "the estimate of the error holds"
    assert errors.period < 1e-3 and imbalance(rows) < 1e-11


def test_a_soft_drive_calms_it():
    t, rows = run(TorsionWaves(stick_slip(**SOFT), 10 / SPEED), 120)
    late = cycle_of(rows, 60)
    assert np.isnan(late.period)
    assert late[1:] == pytest.approx((6.627654032865599, 4879.782470503436, 5106.509919651566), rel=1e-4)
    drive = rows[t >= 60, COLUMN["drive_speed"]]
    assert (drive.min(), drive.max()) == pytest.approx((6.227606627970457, 6.347672726001818), rel=1e-4)
    assert imbalance(rows) < 1e-11


@pytest.mark.parametrize(("drive", "sticks", "turns"), [({}, 97.0, 100.0), (SOFT, 50.0, 52.5)])
def test_speed_above_which_the_bit_never_sticks(drive, sticks, turns):
    for rpm, stuck in ((sticks, True), (turns, False)):
        t, rows = run(TorsionWaves(stick_slip(rpm * cf.units.rpm, **drive), 20 / SPEED), 200)
        assert (rows[t > 170, COLUMN["bit_speed"]] == 0).any() == stuck


def test_a_front_in_a_lying_pipe():
    """Speed Om - m x/(2 Z) behind the front, which stops by itself where that is zero."""
    m, Om = 3.52427441057226, 2 * np.pi
    model = TorsionWaves(lying(cf.drilling.TopDrive(Om)), 2 / SPEED)
    model.advance(round(0.2 / model.dt))
    x, (speed, torque) = model.depths, model.profile()[1:3]
    behind = (x > 4) & (x < 0.19 * SPEED)
    assert speed[behind] == pytest.approx(Om - m * x[behind] / 2 / PIPE_IMPEDANCE, rel=1e-3)
    told = PIPE_IMPEDANCE * Om + m * (SPEED * 0.2 / 2 - x[behind])
    assert torque[behind] == pytest.approx(told, rel=2e-3)
    model.advance(round(0.1335 / model.dt))
    profile = model.profile()
    assert x[profile[ANGLE] > 0].max() == pytest.approx(1056.7740703874679, rel=5e-3)
    assert profile[STICKING, x > 1060].all() and not profile[STICKING, x < 1000].any()
    t, rows = run(TorsionWaves(lying(cf.drilling.TopDrive(Om)), 10 / SPEED), 9)
    assert t[np.flatnonzero(rows[:, COLUMN["bit_angle"]])[0]] == pytest.approx(2.725, rel=2e-3)
    assert rows[:, COLUMN["surface_torque"]].max() == pytest.approx(12432.4, rel=1e-3)
    assert rows[:, COLUMN["bit_speed"]].max() == pytest.approx(12.565, rel=2e-3)
    assert imbalance(rows) < 1e-11


def test_a_pipe_turned_slowly_and_back():
    """The parabola of a string on its wall: l = sqrt(2 GJ phi/m), M = m l; back by dphi to sqrt(GJ dphi/m)."""
    m, GJ = 3.52427441057226, 941984.5211067691
    model = TorsionWaves(lying(cf.drilling.TopDrive(Turn(2 * np.pi, np.pi / 2, 60.0))), 4 / SPEED)
    _, rows = run(model, 60)
    x, angle = model.depths, model.profile()[ANGLE]
    slope, end = np.polyfit(x[x < 1700], np.sqrt(angle[x < 1700]), 1)
    assert -end / slope == pytest.approx(1832.702435380757, rel=1e-3)
    assert x[angle > 0].max() == pytest.approx(1832.702435380757, rel=4e-3)  # of nodes 4 m apart
    assert rows[-1, COLUMN["surface_torque"]] == pytest.approx(6458.946295205862, rel=2e-3)
    assert angle == pytest.approx(m / 2 / GJ * np.maximum(1832.7024 - x, 0) ** 2, abs=2e-3)
    _, rows = run(model, 60)
    l2 = np.sqrt(GJ * np.pi / 2 / m)
    assert rows[-1, COLUMN["surface_torque"]] == pytest.approx(6458.9463 - 2 * m * l2, abs=10)
    assert x[model.profile()[ANGLE] < angle - 1e-6].max() == pytest.approx(l2, abs=4)


def test_starts_off_bottom():
    scene, wall_force = off_bottom()
    model = TorsionWaves(scene, 10.0001 / 2787.5976461718205, normal_force=wall_force)
    assert model._hold.sum() == pytest.approx(18077.89943213615, rel=1e-6)
    t, rows = run(model, 24)
    starts = starts_of(t, rows[:, COLUMN["bit_speed"]])
    assert starts == pytest.approx([5.408, 10.78, 16.61, 22.49], rel=3e-3)
    assert imbalance(rows) < 1e-11


def test_how_often_a_string_starts_off_bottom():
    """Ten times in 60 s, whatever the mesh and the method, and in the angles of the reference. Speeds of single steps
    have more: where a slip ends, waves of even and odd steps stop one after the other, and the speed of the lower end
    alternates between rest and motion, which the list of the reference counts as starts."""
    scene, wall_force = off_bottom()
    parts = [(x.length, x.torsional_impedance, x.rhoJ) for x in scene.segments]
    radius = np.array([x.radius for x in scene.segments])

    def friction(md, which):
        torque = wall_force(md) * radius[which]
        return 0.3 * torque, 0.195 * torque, 1.0

    t, speed, angle = turn(parts, friction, (2900.0, 38e3, 100e3, 40 * cf.units.rpm), 0.1, 10.0, 60.0)
    ten = starts_of(t, speed)
    assert len(ten) == 10 and ten[:4] == pytest.approx([5.408, 10.78, 16.61, 22.49], rel=6e-3)
    model = TorsionWaves(scene, 10.0001 / 2787.5976461718205, normal_force=wall_force)
    steps, told = [], []
    while model.time < 60:
        told.append(model.advance(1)[0])
        steps.append(model._kept["speed"][-1])
    times, mean = np.array(told)[:, 0], np.array(told)[:, COLUMN["bit_speed"]]
    assert len(starts_of(times, mean)) == 10
    assert len(starts_of(times, np.array(steps))) > 100
    turned = np.interp(np.arange(61.0), times, np.array(told)[:, COLUMN["bit_angle"]])
    for angles in (turned, np.interp(np.arange(61.0), t, angle), np.append(0.0, REFERENCE_ANGLES)):
        rests = np.diff(angles) < 0.5
        assert (rests[:-1] & ~rests[1:]).sum() == 10 and angles[-1] == pytest.approx(236, abs=2)


def test_a_wave_goes_through_parts_of_any_length():
    """Parts of the same impedance whose travel times fit no step, between a drive without reflection and a free end:
    the end turns as the drive was asked to turn a travel time before."""
    lengths, speeds = np.array([700.3, 0.2, 1001.7, 13.1, 303.13]), np.array([3100.0, 2000.0, 2900.0, 3300.0, 3000.0])
    stiff = [cf.Stiffness((1e9,) * 2, 1e9, (1e6,) * 2, 300 * c, 20.0, inertia=(0.1, 0.1, 300 / c)) for c in speeds]
    parts = [cf.well.Component(length, each, 1, 0.1) for length, each in zip(lengths, stiff, strict=True)]
    travel = (lengths / speeds).sum()

    def asked(t):
        return 1 - np.cos(4 * t)

    errors, drive = [], cf.drilling.TopDrive(asked, control=cf.drilling.Matched(300.0))
    for dt in (0.02, 0.01):
        model = TorsionWaves(cf.drilling.Drilling(cf.well.DrillString(parts, order="top down"), drive), dt)
        t, rows = run(model, 5)
        s = np.maximum(t - travel, 0)
        errors.append(np.abs(rows[:, COLUMN["bit_angle"]] - (s - np.sin(4 * s) / 4)).max())
        assert "shorter than 1.5 cells" in " ".join(model.why) and "no whole" not in " ".join(model.why)
        assert imbalance(rows) < 1e-12
    assert errors[0] < 1e-5 and errors[1] < errors[0] / 2


def test_cells_keep_travel_time_inertia_and_compliance():
    parts = [(2513.0, *PIPE[1:]), (0.3, 0.2, 0.05), (111.7, 0.1651, 0.05715), (18.0, 0.127, 0.1), (3.1, 0.2, 0.1)]
    segments = cf.drilling.Drilling(string_of(*parts), cf.drilling.TopDrive(1.0)).segments
    found = cells_of(segments, 10 / SPEED)
    assert found.dt <= 10 / SPEED and found.joined == 2 and found.depths[-1] == pytest.approx(2646.1)
    assert (found.impedance * found.time).sum() == pytest.approx(sum(x.rhoJ * x.length for x in segments), rel=1e-12)
    assert (found.time / found.impedance).sum() == pytest.approx(sum(x.length / x.GJ for x in segments), rel=1e-12)
    times = found.time / found.dt
    assert np.all((np.abs(times - 1) < 1e-9) | ((times >= 1.5 - 1e-9) & (times < 2.5)))
    scene = cf.drilling.Drilling(string_of(PIPE, (200.0, 0.1651, 0.05715)), cf.drilling.TopDrive(1.0))
    whole = cells_of(scene.segments, 10.5 / SPEED)
    assert len(whole.time) == 320 and whole.unfit < 1e-9


def test_drag_is_of_the_second_order():
    angles = []
    drive = cf.drilling.TopDrive(lambda t: 1 - np.cos(3 * t), 2900.0, cf.drilling.PI(2e3, 5e3))
    scene = cf.drilling.Drilling(string_of(PIPE), drive, drag=cf.drilling.ViscousDrag(1.0))
    for cells in (40, 80, 160):
        angles.append(run(TorsionWaves(scene, elements=cells), 160 * 3000 / SPEED / 40)[1][-1, COLUMN["bit_angle"]])
    assert 3.7 < (angles[0] - angles[1]) / (angles[1] - angles[2]) < 4.3


def test_a_motor_and_a_wave_of_the_drag():
    """The steady speed of a given torque: over the drags of its bearings and of the mud."""
    drag = 5.0 * DENSITY * 1.1878745537285865e-05 * 3000
    drive = cf.drilling.TopDrive(inertia=1000.0, control=cf.drilling.Motor(3000.0, 100.0))
    scene = cf.drilling.Drilling(string_of(PIPE), drive, drag=cf.drilling.ViscousDrag(5.0))
    _, rows = run(TorsionWaves(scene), 200)
    for name in ("drive_speed", "bit_speed"):
        assert rows[-1, COLUMN[name]] == pytest.approx(3000 / (100 + drag), rel=1e-6)
    assert rows[-1, COLUMN["surface_torque"]] == pytest.approx(3000 / (1 + 100 / drag), rel=1e-6)
    assert imbalance(rows) < 1e-11


def test_the_same_digits_after_recall():
    scene, wall_force = off_bottom()
    drive = cf.drilling.TopDrive(Turn(30.0, 5.0, 7.03), 2900.0, cf.drilling.PI(38e3, 100e3))
    scene = replace(scene, drive=drive, bit=cf.drilling.BitOnRock(LAW, inertia=50.0))
    first, second = (TorsionWaves(scene, 0.0071, normal_force=wall_force) for _ in range(2))
    assert np.any(first.cells.turn)
    first.advance(700)
    second.recall(first.memory())
    np.testing.assert_array_equal(second.advance(400), np.concatenate([first.advance(150), first.advance(250)]))
    np.testing.assert_array_equal(second.profile(), first.profile())
    assert second.time == first.time and second.counts == first.counts


def test_wall_force_of_the_soft_string():
    """The kinetic torque is that of torque and drag where the string rotates off bottom."""
    path = cf.well.WellPath.from_survey(
        [0, 400, 900, 1300, 2200], [0, 0, 40, 70, 70], [20, 20, 20, 80, 80], degrees=True
    )
    hole = cf.well.Borehole(path, [cf.well.HoleSection(1000, 0.25, 0.2), cf.well.HoleSection(2200, 0.2159, 0.3)])
    string = cf.well.DrillString([part(200.0, 0.1651, 0.05715, weight=1000.0), part(None, *PIPE[1:], weight=250.0)])
    told = cf.well.torque_and_drag(
        hole, string, cf.well.RotateOffBottom(), model="soft", torque_convention="johancsik", tol=1e-6
    )
    friction = cf.drilling.WallFriction(1.5, 1.0, 0.1, of_hole=True)
    model = TorsionWaves(cf.drilling.Drilling(string, cf.drilling.TopDrive(1.0), hole=hole, friction=friction))
    assert model._slide.sum() == pytest.approx(told.surface_torque, rel=1e-5)
    assert model._hold.sum() == pytest.approx(1.5 * told.surface_torque, rel=1e-5)
    assert model._decay[-1] == pytest.approx(0.1 / (0.1651 / 2))
    assert np.interp(1500, model.depths, model._decay) == pytest.approx(0.1 / 0.0635)


def test_what_is_told_and_refused():
    steep = cf.drilling.WallFriction(0.5, 0.1, 0.02, of_rotation=True)
    scene, wall_force = off_bottom()
    model = TorsionWaves(replace(scene, friction=steep), 20 / SPEED, normal_force=wall_force)
    assert model.dt < 5 / SPEED and any("would have several answers" in line for line in model.why)
    sudden = cf.drilling.WallFriction(0.5, 0.1, 1e-9, of_rotation=True)
    with pytest.raises(cf.SceneError, match="Drilling.friction = .*decays more slowly"):
        TorsionWaves(replace(scene, friction=sudden))
    light = cf.drilling.BitOnRock(cf.drilling.Stribeck(6000.0, 2000.0, 1e-3), inertia=0.01)
    with pytest.raises(cf.SceneError, match="BitOnRock.law = .*a larger inertia of the bit than 0.01"):
        TorsionWaves(replace(stick_slip(), bit=light))
    bit, laid = cf.drilling.BitOnRock(cf.drilling.Stribeck(6000.0, 2000.0, 1.0)), (PIPE, (200.0, 0.1651, 0.05715))
    with pytest.raises(cf.SceneError, match="impedance of the string at the bit is 1793.82"):
        TorsionWaves(cf.drilling.Drilling(string_of(*laid), cf.drilling.TopDrive(1.0), bit))
    with pytest.raises(cf.SceneError, match="expected a DrillString; discs have no waves"):
        TorsionWaves(cf.drilling.Drilling(cf.drilling.Discs((1.0, 1.0), (1.0,)), cf.drilling.TopDrive(1.0)))
    with pytest.raises(cf.SceneError, match="TorsionWaves.scene.bit.law = .*has no depth of cut"):
        cutting = cf.drilling.BitOnRock(cf.drilling.Cutting(0.1, 60e6, 0.6, 4))
        TorsionWaves(cf.drilling.Drilling(string_of(PIPE), cf.drilling.TopDrive(1.0), cutting))
    for dt, words in ((-1, "a positive number"), (1e-9, "at least 1e-05 of the travel time")):
        with pytest.raises(cf.SceneError, match=f"TorsionWaves.dt = {dt}: expected {words}"):
            TorsionWaves(scene, dt)


def test_lobes_give_their_torque_alone():
    lobes = replace(
        stick_slip(), bit=cf.drilling.BitOnRock(cf.drilling.Lobes(3, 2e-3, law=LAW), weight=80e3, inertia=50.0)
    )
    lobed, plain = (TorsionWaves(scene, 40 / SPEED).advance(500) for scene in (lobes, stick_slip()))
    np.testing.assert_array_equal(lobed, plain)


@pytest.mark.parametrize("case", [x for x in GIVEN["natural_Hz"] if x != "hook"])
def test_reference_frequencies(case):
    expected = GIVEN["natural_Hz"][case]
    hook = cf.drilling.Hook(GIVEN["natural_Hz"]["hook"]) if "hook" in case else None
    found = cf.drilling.natural_frequencies(
        pipe_and_collars(hook=hook), len(expected), case.split()[-1], case.split()[0]
    )
    assert found == pytest.approx(expected, rel=1e-12)


def test_a_pipe_with_an_inertia_at_its_end():
    """w tan(w L/c) = Z/J between k pi and (k + 1/2) pi, by itself."""
    pipe = replace(pipe_and_collars(), string=tubes(GIVEN["sections"][0]))
    part, inertia = pipe.segments[0], 40.0
    found = cf.drilling.natural_frequencies(
        replace(pipe, bit=cf.drilling.BitOnRock(cf.drilling.Stribeck(0, 0), inertia=inertia)), 5
    )
    time, Z = part.length / part.torsional_speed, part.torsional_impedance
    for k in range(5):
        exact = brentq(lambda x: x / time * math.sin(x) * inertia - Z * math.cos(x), k * math.pi, (k + 0.5) * math.pi)
        assert 2 * math.pi * found[k] == pytest.approx(exact / time, rel=1e-12)


def many_parts(count, drive):
    """A string of parts that differ by orders of magnitude."""
    draw = np.random.default_rng(4)
    lengths, masses = draw.uniform(1, 100, count), draw.uniform(20, 300, count)
    axial, torsional = 10 ** draw.uniform(8, 10, count), 10 ** draw.uniform(5, 8, count)
    parts = []
    for length, EA, GJ, mass in zip(lengths, axial, torsional, masses, strict=True):
        stiff = cf.Stiffness((1e9, 1e9), EA, (1e6, 1e6), GJ, mass=mass, inertia=(mass / 1e3, mass / 1e3, mass / 5e2))
        parts.append(cf.well.Component(float(length), stiff, 100.0, 0.08))
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(0, 0), inertia=30.0, mass=500.0)
    return cf.drilling.Drilling(cf.well.DrillString(tuple(parts)), drive, bit, hook=cf.drilling.Hook(4e6))


@pytest.mark.parametrize(
    "drive",
    [cf.drilling.TopDrive(1.0), cf.drilling.TopDrive(None, 2000.0, cf.drilling.Motor(1.0))],
    ids=["held", "free"],
)
@pytest.mark.parametrize("kind", ["torsion", "axial"])
@pytest.mark.parametrize("bit", ["free", "fixed"])
def test_no_frequency_is_missed(drive, kind, bit):
    """Forty parts: as many frequencies as the winding number of another function says, and the same ones."""
    scene = many_parts(40, drive)
    w = 2 * math.pi * cf.drilling.natural_frequencies(scene, 40, bit, kind)
    assert (np.diff(w) > 0).all()
    guide = torsional(scene) if kind == "torsion" else axial(scene)
    columns = slice(1, None, 2) if bit == "free" else slice(0, None, 2)
    box = Box(-1.0, 1.0, 1e-3, (w[-2] + w[-1]) / 2)
    roots, _ = all_roots(lambda s: guide.bit(s)[columns], box, math.pi / guide.travel)
    assert len(roots) == 39
    assert np.abs(roots - 1j * w[:-1]).max() < 1e-10 * w[-1]


def test_discs_and_what_turns_as_a_whole():
    held, free = public_discs(cf.drilling.Stiff(), 1e4), public_discs(cf.drilling.Motor(1.0), 1e4)
    counts = [len(cf.drilling.natural_frequencies(x, 9, bit)) for x in (held, free) for bit in ("free", "fixed")]
    assert counts == [3, 2, 3, 3]
    undamped = replace(held, string=cf.drilling.Discs(held.string.inertias, held.string.stiffnesses))
    guide = torsional(undamped)
    roots, _ = all_roots(lambda s: guide.bit(s)[1::2], Box(-1, 1, 1e-3, 9.0), 1.0)
    assert roots.imag / (2 * math.pi) == pytest.approx(cf.drilling.natural_frequencies(held, 9), rel=1e-12)


def test_nothing_overflows():
    scene = pipe_and_collars("PI_stiff")
    s = np.array([1e5 + 1e6j, -300.0 + 40j, 1e-9j, 0j])
    for values in torsional(scene).bit(s):
        assert np.isfinite(values).all()
    Z = scene.segments[-1].torsional_impedance
    assert torsional(scene).impedance_at_bit(np.array([1e5 + 0j]))[0] == pytest.approx(Z, rel=1e-5)


def function_with(roots):
    """A polynomial with these roots and their conjugates, as `all_roots` takes it: value and derivative, scaled."""
    all_of_them = np.array([z for s in roots for z in ({s, s.conjugate()})])

    def f(s):
        apart = np.asarray(s)[:, None] - all_of_them
        value = np.exp(1j * np.angle(apart).sum(axis=1))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where((apart == 0).any(axis=1), 0, value), value * (1 / apart).sum(axis=1)

    return f


@pytest.mark.parametrize("seed", range(3))
def test_all_roots_of_a_polynomial(seed):
    """Some a hair apart, some real, one on the contour that is asked for, and others outside."""
    draw = np.random.default_rng(seed)
    inside = draw.uniform(-2, 1, 25) + 1j * draw.uniform(0, 30, 25)
    close = inside[:5] + 1e-5 * np.exp(2j * np.pi * draw.random(5))
    real, outside = draw.uniform(-2, 1, 3) + 0j, np.array([-2 + 7j, 1.5 + 3j, -5 + 2j, 0.3 + 31j])
    roots, box = all_roots(function_with([*inside, *close, *real, *outside]), Box(-2.0, 1.2, 0.0, 30.5), 1.0)
    expected = np.array([s for s in (*inside, *close, *real, *outside) if box.holds(s)])
    assert len(roots) == len(expected) >= 33
    assert max(np.abs(roots - s).min() for s in expected) < 1e-9


@pytest.mark.parametrize("roots", [
    [0.3 + 2j, 0.3 + 2j, 0.5 + 5j], [0.3 + 2j] * 3, [0.25, 0.25, 0.7 + 1j], [0.3 + 2j, 0.3 + 2j + 1e-7], [0.3 + 1e-6j],
], ids=["double", "triple", "real", "close", "hardly complex"])  # fmt: skip
def test_multiple_roots(roots):
    found, _ = all_roots(function_with([complex(s) for s in roots]), Box(-1.0, 1.0, 0.0, 10.0), 1.0)
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(np.array(roots, dtype=complex)), abs=1e-8)


def test_gains_of_tuned_drives():
    scene = pipe_and_collars("PI_stiff")
    for choose, name in ((cf.drilling.SoftSpeed, "SoftSpeed"), (cf.drilling.SoftTorque, "tuned")):
        expected = cf.drilling.PI(GIVEN["tops"][name]["Kp"], GIVEN["tops"][name]["Ki"])
        for given in (scene.string, scene):
            found = choose(given, 2900.0)
            assert (found.Kp, found.Ki) == pytest.approx((expected.Kp, expected.Ki), rel=1e-12)
    pipe = scene.string.components[-1]
    part = scene.segments[0]
    found = cf.drilling.SoftTorque(pipe, 2000.0)
    assert found.Ki == pytest.approx(2000 * (math.pi / 2 * part.torsional_speed / part.length) ** 2, rel=1e-12)
    assert cf.drilling.SoftTorque(cf.well.DrillString((replace(pipe, length=None),)), 2000.0, depth=3000.0) == found
    with pytest.raises(cf.SceneError, match="inertia = 0"):
        cf.drilling.SoftSpeed(pipe, 0)
    with pytest.raises(cf.SceneError, match="discs have no impedance"):
        cf.drilling.SoftSpeed(public_discs(cf.drilling.Stiff(), 1e4), 2900.0)


def test_a_bit_that_never_turned_is_no_stick_slip():
    """A torque of the drive below that which holds the bit."""
    weak = cf.drilling.TopDrive(None, 374.0, cf.drilling.Motor(500.0, 100.0))
    held = cf.drilling.BitOnRock(cf.drilling.Stribeck(6e3, 3e3))
    found = cf.drilling.simulate(cf.drilling.Drilling(cf.drilling.Discs((374.0, 374.0), (473.0,)), weak, held), 20.0)
    cycle = found.stick_slip()
    assert (found.bit_speed == 0).all() and cycle.stuck == 1 and not cycle.sticks
    assert "the bit never turned. Where the surface torque still grows" in str(cycle) and "stick-slip" not in str(cycle)


@pytest.mark.parametrize(("second", "told"), [(1.5, False), (1.0, True)])
def test_a_motion_that_is_not_periodic_says_that_its_errors_are_not_known(second, told):
    """The bit turns for 0.4 s at 0 and at 1.5 or 1 s of every 3 s."""
    rows = np.zeros((3000, 1 + len(SERIES) + len(LEDGER)))
    t = rows[:, 0] = 0.01 * np.arange(3000)
    rows[:, 1 + SERIES.index("drive_speed")] = 3.0
    rows[:, 1 + SERIES.index("bit_speed")] = 9.0 * ((t % 3 < 0.4) | ((t - second) % 3 < 0.4))
    history = cf.drilling.DrillingHistory(pipe_and_collars(), "torsion", (), 0.01, np.arange(2.0), rows)
    history.errors = Cycle(0.001, 0.01, 5.0, 5.0)
    assert history.stick_slip().irregular == told == ("The motion is not periodic" in " ".join(str(history).split()))
    assert ("no single period: starts 1 to 2 s apart, 1.5 s in the mean" in str(history.stick_slip())) == told


@pytest.mark.parametrize(
    ("drive", "bit", "severity", "words"),
    [
        (0.0, 5.0, 0.4, "severity 0.4;"),
        (0.0, 0.0, np.nan, "neither drive nor bit turns"),
        (2.0, 1.0, 1.0, "the bit swings back and does not stick: period 5 s"),
    ],
)
def test_a_bit_that_swings_or_turns_below_a_drive_that_stands(drive, bit, severity, words):
    rows = np.zeros((4001, 1 + len(SERIES) + len(LEDGER)))
    t = rows[:, 0] = 0.005 * np.arange(4001)
    rows[:, 1 + SERIES.index("drive_speed")] = drive
    rows[:, 1 + SERIES.index("bit_speed")] = (bit + 2 * np.sin(2 * np.pi * t / 5)) * (bit > 0)
    history = cf.drilling.DrillingHistory(pipe_and_collars(), "torsion", (), 0.005, np.arange(2.0), rows)
    found = history.stick_slip(since=0.0)
    assert found.severity == pytest.approx(severity, rel=1e-4, nan_ok=True)
    assert words in str(found) and ": stick-slip" not in str(found)


def test_critical_speeds_of_a_pipe(tmp_path):
    """A free end in torsion, (k + 1/2)/2 c/L; a fixed one in axial motion, k c/(2 L)."""
    bit = cf.drilling.BitOnRock(cf.drilling.Lobes(3, 0.002), weight=8e4)
    scene = replace(pipe_and_collars(), string=tubes(GIVEN["sections"][0]), bit=bit)
    part, answer = scene.segments[0], cf.drilling.campbell(scene, 20.0, up_to=4.0)
    found = answer.critical_speeds()
    w = np.arange(1, 40) * math.pi * part.axial_speed / part.length
    for name, times in answer.excitations.items():
        expected = w[(w <= 8 * math.pi) & (w <= 20 * times)] / times
        assert found["axial", name] == pytest.approx(expected, rel=1e-12)
    w = (np.arange(40) + 0.5) * math.pi * part.torsional_speed / part.length
    assert found["torsion", "1 x"] == pytest.approx(w[w <= 20.0], rel=1e-12)
    assert set(answer.excitations) == {"1 x", "3 x (lobes)"} and "kind" in answer.to_dataframe()
    assert "of torsion (bit free) and" in str(answer) and "of axial (bit fixed)" in str(answer)
    answer.plot(tmp_path / "campbell.png")
    assert (tmp_path / "campbell.png").stat().st_size > 20_000


@pytest.mark.parametrize(
    ("arguments", "words"),
    [((0,), "a number from 1"), ((3, "loose"), "'free' or 'fixed'"), ((3, "free", "lateral"), "'torsion' or 'axial'")],
)
def test_refusals(arguments, words):
    with pytest.raises(cf.SceneError, match=words):
        cf.drilling.natural_frequencies(pipe_and_collars(), *arguments)
    with pytest.raises(cf.SceneError, match="discs turn alone"):
        cf.drilling.natural_frequencies(public_discs(cf.drilling.Stiff(), 1e4), 1, kind="axial")


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
    found = cf.drilling.simulate(scene, 9, model=model, check=True, progress=False)
    # Where it sticks and slips, rounding grows: by the compiler's options errors are 0.8 to 13 % of the largest torque.
    assert 0 < found.errors.peak < 5
    assert 0 < found.errors.largest_torque == found.errors.least_torque < 0.2 * np.abs(found.surface_torque).max()
    # Such friction amplifies short waves, whose speed depends on the ratio of step and element: so another one counts.
    more = [x() for x in on_same_mesh(scene, model, model_of(scene, model))]
    assert [(x.dt, len(x.depths)) for x in more] == [(found.dt / 2, len(found.depths))] * (model != "torsion")
    for x in more:
        off = np.abs(np.subtract(cycle_of(found.rows, 4.5), cycle_of(x.advance(math.ceil(9 / x.dt - 1e-6)), 4.5)))
        assert found.errors.largest_torque >= 2 * off[2:].max() * (1 - 1e-9) > 0


def test_a_mesh_that_cannot_be_coarser_is_compared_with_a_finer_one():
    found = cf.drilling.simulate(stick_slip(), 60, model="axial and torsional", elements=2, check=True, progress=False)
    assert len(found.depths) == 4 and any("sends a jump down the string" in x for x in found.why)
    smooth = AxialTorsional(replace(stick_slip(), drive=drilling.TopDrive(cf.signals.Ramp(6.0))), found.dt, 4)
    assert not any("sends a jump" in x for x in smooth.why)
    assert not any("as short as an element" in x for x in smooth.why)
    falling = cf.drilling.BitOnRock(cf.drilling.Stribeck(1e3, 900.0, 3.0))
    absorbing = replace(stick_slip(), drive=drilling.TopDrive(6.0, control=cf.drilling.Matched()), bit=falling)
    assert any("as short as an element" in x for x in AxialTorsional(absorbing, found.dt, 4).why)
    finer = cycle_of(run(AxialTorsional(stick_slip(), found.dt / 2, 6), 60)[1], 30)
    told = 2 * np.abs(np.subtract(cycle_of(found.rows, 30), finer))
    assert found.errors == pytest.approx([*told[:2], told[2:].max(), told[2:].max()], rel=1e-6)


def test_a_matched_drive_has_the_impedance_of_the_uppermost_component_however_short_it_is():
    """A short thin sub above a stub and pipe: within a cell with them it must not change the drive."""
    laid = string_of((5.0, 0.08, 0.03), (0.7, 0.25, 0.05), (2000.0, *PIPE[1:]))
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
        string_of(PIPE),
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


def test_times_as_text():
    """Text with a unit is what its seconds are, for strings and for rods."""
    string = well.DrillString([well.Collar(90.0, "NC46-65"), well.DrillPipe(900.0, "5 in 19.50 lb/ft")])
    bit = drilling.BitOnRock(drilling.Stribeck(static="6 kN m", dynamic="4 kN m", speed=3.0), inertia=50.0)
    scene = drilling.Drilling(string, drilling.TopDrive("60 rpm"), bit)
    told = drilling.simulate(scene, "0.1 min", dt="2 ms", save_every="0.1 s", profile_every="1 s")
    same = drilling.simulate(scene, 6.0, dt=2e-3, save_every=0.1, profile_every=1.0)
    np.testing.assert_array_equal(told.bit_speed, same.bit_speed)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(0.2), cf.Material(E=210e9, nu=0.3, density=7850.0))
    pushed = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (1e3, 0, 0))])
    told, same = (cf.simulate(pushed, *times[:1], dt=times[1]) for times in (("0.1 s", "10 ms"), (0.1, 0.01)))
    np.testing.assert_array_equal(told.position(rod.end), same.position(rod.end))


def test_tool_joints_are_spread_along_the_pipe():
    """As in a string of bodies and joints, a hundred of them; frequencies are 8 % below those of the body alone."""
    pipe, parts = well.DrillPipe(960.0, "5 in 19.50 lb/ft"), []

    def tube(length, outer):
        return well.DrillPipe(length, None, outer, pipe.inner_diameter)

    body, joint = tube(960.0, pipe.outer_diameter), tube(960.0, pipe.tool_joint)
    share = (pipe.mass - body.mass) / (joint.mass - body.mass)
    for _ in range(100):
        half = tube(4.8 * (1 - share), pipe.outer_diameter)
        parts += [half, tube(9.6 * share, pipe.tool_joint), half]
    assert sum(part.mass * part.length for part in parts) == pytest.approx(960 * pipe.mass, rel=1e-12)
    inertia = sum(part.stiffness.inertia[2] * part.length for part in parts)
    assert pipe.torsion[1] == pytest.approx(inertia / 960, rel=1e-12)
    lowest = []
    for string in ([pipe], parts, [body]):
        scene = drilling.Drilling(well.DrillString(string), drilling.TopDrive(6.0))
        lowest.append(drilling.natural_frequencies(scene, 1, bit="free", kind="torsion")[0])
    assert lowest[0] == pytest.approx(lowest[1], rel=1e-5) and lowest[0] / lowest[2] == pytest.approx(0.9206, abs=1e-4)
