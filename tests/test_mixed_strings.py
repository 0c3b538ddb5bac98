"""Rods below a pipe, the pipe as a condition at their end, and bits that come down on rock."""

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest
from axial_scenes import column, hanging, unbalanced
from ended_motions import Stopped, stop_at
from scipy.integrate import solve_ivp, trapezoid
from torsion_scenes import COLLARS, LAW, PIPE, part

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.elements import AxialTorsional
from cosserat_fenicsx.drilling.pipe_above import DelayLines, TopEnd

pytestmark = pytest.mark.serial
SMALL = {"elements": 4, "degree": 2}
LIGHT = cf.drilling.Stribeck(1500.0, 500.0, 3.33)  # the bit slips from 1.4 s on


def drilling(law=LAW, *, drag=0.3, inertia=50.0, weight=None, **more):
    """Collars and pipe with a bit, under a drive that starts smoothly."""
    drive = cf.drilling.TopDrive(lambda t: math.pi * (1 - math.cos(math.pi * min(t, 1))))
    string = cf.well.DrillString((part(*COLLARS), part(*PIPE)))
    bit = None if law is None else cf.drilling.BitOnRock(law, weight=weight, inertia=inertia)
    return cf.drilling.Drilling(string, drive, bit, drag=cf.drilling.ViscousDrag(drag, drag), **more)


def under(control, inertia):
    """A string of 300 m with a bit that slips, under a control of the drive."""
    drive = cf.drilling.TopDrive(lambda t: 3 * (1 - math.cos(math.pi * min(t / 0.4, 1))), inertia, control)
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(1500.0, 1000.0, 3.0), inertia=50.0)
    return cf.drilling.Drilling(cf.well.DrillString((part(50.0, *COLLARS[1:]), part(250.0, *PIPE[1:]))), drive, bit)


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
    """The bit slips at 3.5 s, sticks at 8.1 s, and slips again at 9.8 s; its drag is not on the inertia of the bit."""
    string = drilling()
    mixed = cf.drilling.mixed_scene(string, 3000.0)
    history = cf.simulate(mixed.scene, 10.5, dt=0.0046, **SMALL)  # longer ones would be halved
    whole = cf.drilling.simulate(string, 10.5, dt=5e-4, model="torsion")
    times, speed = mean_speeds(history, mixed.rod)
    off = np.abs(speed - np.interp(times, whole.times, whole.bit_speed))
    assert off[times < 4].max() < 2e-3 and off.max() < 2e-2
    assert speed.max() == pytest.approx(whole.bit_speed.max(), rel=1e-3)
    sticks = np.abs(speed) < 1e-9
    assert sticks[times < 1].all() and sticks[times > 5].any()
    assert imbalance(history) < 1e-4


@pytest.fixture(scope="module")
def slips():
    """A `MixedScene` whose bit sticks and then slips, and its motion of 2 s."""
    mixed = cf.drilling.mixed_scene(drilling(LIGHT), 3000.0)
    return mixed, cf.simulate(mixed.scene, 2.0, dt=4e-3, **SMALL)


@pytest.mark.slow
def test_other_schemes_agree(slips):
    mixed, history = slips
    alpha = cf.simulate(mixed.scene, 2.0, dt=4e-3, scheme="generalised-alpha", **SMALL)
    (_, one), (_, other) = (mean_speeds(x, mixed.rod) for x in (history, alpha))
    assert one.max() > 3.9
    np.testing.assert_allclose(other, one, atol=0.015)


@pytest.mark.slow
def test_the_rows_of_a_string_are_means_between_saved_states_and_of_order_2():
    """Angles of drive and bit by the step, also where steps are halved and where few states are saved."""
    drive = cf.drilling.TopDrive(
        lambda t: 3 * (1 - math.cos(math.pi * min(t / 0.4, 1))), 100.0, cf.drilling.PI(800, 500)
    )
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(1500.0, 1000.0, 3.0), inertia=50.0)
    pieces = part(50.0, *COLLARS[1:]), part(250.0, *PIPE[1:])
    mixed, found = cf.drilling.mixed_scene(cf.drilling.Drilling(cf.well.DrillString(pieces), drive, bit), 250.0), []
    for dt in (8e-3, 4e-3, 2e-3):
        history = cf.simulate(mixed.scene, 0.64, dt=dt, elements=2, degree=2, start=1.0, save_every=16e-3)
        found.append(mixed.as_drilling(history))
    for name, order in (("drive_angle", 3.9), ("bit_angle", 3.9)):
        one, two, three = (getattr(x, name) for x in found)
        assert np.abs(one - two).max() > order * np.abs(two - three).max(), name
        assert np.abs(two - three).max() < 1e-4 * three.max(), name
    assert found[2].bit_speed.max() > 4
    taken = np.diff(found[2].bit_angle, prepend=0.0) @ found[2].torque_on_bit
    assert taken == pytest.approx(history.dissipated[-1], rel=1e-3)


@pytest.mark.slow
def test_linear_controls_above_a_rod():
    """A PI control as a `LinearControl` is that one; others, some of them late, are those of the string; refusals."""

    def moved(control, inertia, dt=4e-3):
        mixed = cf.drilling.mixed_scene(under(control, inertia), 250.0)
        return mixed.as_drilling(cf.simulate(mixed.scene, 0.64, dt=dt, elements=2, degree=2, start=1.0))

    linear = cf.drilling.LinearControl(((0.0,),), ((1.0, 0.0),), (500.0,), (800.0, 0.0))
    one, same = moved(cf.drilling.PI(800, 500), 100.0), moved(linear, 100.0)
    for name in ("drive_speed", "surface_torque", "bit_speed"):
        np.testing.assert_allclose(
            getattr(same, name), getattr(one, name), atol=1e-9 * np.abs(getattr(one, name)).max()
        )
    Z = cf.drilling.ZTorque
    late = replace(linear, delay=0.06)
    for control, inertia in ((Z(), 0), (Z(filter=0.0), 0), (Z(filter=0.1, delay=0.04), 0), (late, 100)):
        found, whole = moved(control, inertia, 2e-3), cf.drilling.simulate(under(control, inertia), 0.64, dt=1e-4)
        for name in ("drive_speed", "surface_torque"):
            true = np.interp(found.mean_times, whole.mean_times, getattr(whole, name))
            assert np.abs(getattr(found, name) - true).max() < 1e-3 * np.abs(true).max(), (name, control)
    drive = cf.drilling.TopDrive(1.0, 100.0, cf.drilling.ZTorque(filter=0.0, delay=0.02))
    with pytest.raises(cf.SceneError, match="delay = 0.02: expected 0 .s., or a filter: ZTorque answers late"):
        cf.drilling.mixed_scene(replace(under(cf.drilling.Stiff(), 0.0), drive=drive), 250.0)


@dataclass(frozen=True)
class HeldPI(cf.drilling.SampledControl):
    """PI with the torque, or the speed, held over every sample, after a delay."""

    by_speed: bool = False
    sample: float = 0.04
    delay: float = 0.016

    of_speed = property(lambda self: self.by_speed)

    def begin(self):
        return (0.0,)

    def torque(self, state, now):
        summed = state[0] + self.sample * (now.asked - now.speed)
        return 800 * (now.asked - now.speed) + 500 * summed, (summed,)

    def speed(self, state, now):
        return now.asked - now.torque / 800 - 0.01 * now.angle, state


@pytest.mark.slow
def test_sampled_controls_above_a_rod(tmp_path, monkeypatch):
    """Torques and speeds of a control in Python are those of the string, and after an interruption the same digits."""

    def moved(dt=2e-3, **more):
        return cf.simulate(mixed.scene, 0.64, dt=dt, elements=2, degree=2, start=1.0, **more)

    ramp = cf.drilling.TopDrive(None, 100.0, cf.drilling.TorqueOverTime(cf.signals.Ramp(3e3, 0.0, 0.4), sample=0.02))
    pulled = replace(under(cf.drilling.Stiff(), 0.0), drive=ramp)
    for scene in (pulled, under(HeldPI(True), 0.0), under(HeldPI(), 100.0)):
        mixed = cf.drilling.mixed_scene(scene, 250.0)
        history, whole = moved(), cf.drilling.simulate(scene, 0.64, dt=1e-4, progress=False)
        found = mixed.as_drilling(history)
        for name in ("drive_speed", "surface_torque", "bit_speed"):
            true = np.interp(found.mean_times, whole.mean_times, getattr(whole, name))
            assert np.abs(getattr(found, name) - true).max() < 3e-3 * np.abs(true).max(), (name, scene.drive)
    with pytest.raises(cf.SceneError, match="sample = 0.04: expected a sample .* steps of one dt divide"):
        moved(3e-3)
    stop_at(monkeypatch, 150, 0.0)
    with pytest.raises(Stopped):
        moved(folder=tmp_path / "kept")
    assert np.array_equal(cf.resume(tmp_path / "kept", mixed.scene).energy, history.energy)


@pytest.mark.slow
def test_an_autodriller_above_a_rod():
    """The weight on a bit that drills rises as on the string by elements."""
    driller = cf.drilling.Autodriller(weight=1e4, Kp=2e-7, Ki=2e-7, limits=(0, 0.02))
    string = cf.well.DrillString((part(50.0, *COLLARS[1:]), part(250.0, *PIPE[1:])))
    drive, bit = cf.drilling.TopDrive(lambda t: min(t, 1.0)), cf.drilling.BitOnRock(cf.drilling.RateLaw(14e6, 2e3))
    for stiffness in (math.inf, 5e6):
        scene = cf.drilling.Drilling(string, drive, bit, hook=cf.drilling.Hook(stiffness, autodriller=driller))
        found = cf.drilling.mixed_scene(scene, 250.0).run(4.0, dt=4e-3, elements=2)
        whole = cf.drilling.simulate(scene, 4.0, dt=1e-3, elements=100, progress=False)
        assert found.weight_on_bit[-1] > 2e3
        for name in ("hook_load", "weight_on_bit", "bit_velocity"):
            true, late = np.interp(found.mean_times, whole.mean_times, getattr(whole, name)), found.times > 1
            off, size = np.abs(getattr(found, name) - true)[late].max(), np.ptp(true)
            assert off < 5e-3 * size, (name, off / size)


@pytest.mark.slow
def test_a_torque_that_drops_at_once():
    """Coulomb: nothing moves until the static torque is reached; then Z om = 2 M_in - T_d."""
    law = cf.drilling.Stribeck(2000.0, 1000.0)
    mixed = cf.drilling.mixed_scene(drilling(law, drag=0.0, inertia=0.0), 3000.0)
    history = cf.simulate(mixed.scene, 3.0, dt=0.004, **SMALL)
    whole = cf.drilling.simulate(drilling(law, drag=0.0, inertia=0.0), 3.0, dt=2.5e-4, model="torsion")
    both = mean_speeds(history, mixed.rod), (whole.times, whole.bit_speed)
    starts, turned = ([t[np.argmax(x > 1e-6)] for t, x in both], [trapezoid(x, t) for t, x in both])
    assert starts[0] == pytest.approx(starts[1], abs=0.01) and turned[0] == pytest.approx(turned[1], rel=5e-3)


@pytest.mark.slow
def test_resume_gives_identical_digits(slips, tmp_path, monkeypatch):
    """While the bit sticks, and while it slips."""
    mixed, whole = slips
    stuck, slipping = np.interp([1.25, 1.7], *mean_speeds(whole, mixed.rod))
    assert abs(stuck) < 1e-9 and slipping > 0.1
    for steps, run in ((312, partial(cf.simulate, duration=2.0, dt=4e-3, **SMALL)), (113, cf.resume)):
        stop_at(monkeypatch, steps, 0.0)
        with pytest.raises(Stopped):
            run(scene=mixed.scene, folder=tmp_path)
    history = cf.resume(tmp_path, mixed.scene)
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
    start = mixed.rest(elements=10, degree=2)
    offset = start.displacement(mixed.rod.at(100.0))[0]
    assert np.linalg.norm(offset) == pytest.approx((0.2159 - 0.1651) / 2, rel=0.02) and offset[2] > 0
    assert np.abs(start.displacement(mixed.rod.start)).max() < 1e-5
    history = cf.simulate(mixed.scene, 0.2, dt=0.002, elements=10, degree=2, start=start)
    assert history.energy[0] > 0 and imbalance(history) < 1e-4
    assert np.abs(history.velocity(mixed.rod.at(100.0))).max() < 2e-3


def test_refusals():
    string = drilling()
    lobes = cf.drilling.BitOnRock(cf.drilling.Lobes(3, 5e-3), 2e4)
    for scene, depth, words in (
        (string, None, "depth = None: .*lowest DrillPipe"),
        (string, 3300.0, "depth = 3300.0: expected a depth .m. within the string"),
        (string, 0.0, "depth = 0.0: .*above 0 and below"),
        (replace(string, drag=cf.drilling.ViscousDrag(0.3)), 3000.0, "drag = .*the same rate"),
        (replace(string, bit=lobes), 3000.0, "rock_stiffness = inf: .*no impulses stop the end of a rod"),
    ):  # fmt: skip
        with pytest.raises(cf.SceneError, match=words):
            cf.drilling.mixed_scene(scene, depth)
    mixed = cf.drilling.mixed_scene(string, "3 km")
    assert mixed.depth == 3000.0
    assert (
        str(mixed).startswith(f"Rod of {mixed.rod.length:g} m below md = 3000 m; the pipe above")
        and len(str(mixed)) < 3000
    )
    steep = cf.drilling.mixed_scene(drilling(cf.drilling.Stribeck(1500.0, 0.0, 0.025), inertia=0.0), 3000.0)
    with pytest.raises(cf.SceneError, match="falls faster with the speed than the rod can follow"):
        cf.simulate(steep.scene, 2.0, dt=0.01, **SMALL)


G, E, DENSITY = 79.3e9, 206e9, 7850.0
STEEL = cf.Material(E=E, nu=E / (2 * G) - 1, density=DENSITY)
ABOVE = cf.well.DrillPipe(length=3000.0, outer_diameter=0.127, inner_diameter=0.10861, material=STEEL)
BELOW = {"outer_diameter": 0.1651, "inner_diameter": 0.05715, "material": STEEL}
Z_ABOVE, Z_BELOW, SPEED = 296.3752962822167, 1793.8208301221391, 3178.350331229312
# natural frequencies of the reference numbers for drill-strings: a_stability and c_axial, Hz
TORSIONAL = [0.19208807729519303, 0.627212400600027, 1.116183045133015, 1.625788564006934, 2.143329063144303]
ON_HOOK = [0.30553636274474666, 0.9808152730876113, 1.7320998057762933, 2.5179520090783853]
UNDER_RIGID_HOOK = [0.31638592263763815, 1.020855011562465, 1.8063829278567385, 2.6254960072287594]


def collars(drive=None, *loads, pipe=ABOVE, damping=0.0, **more):
    """A vertical rod of collars below the pipe, held across at both ends; loads: functions of the rod."""
    damping = cf.Damping(drag=damping) if damping else None
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, -200)), cf.Tube(0.1651, 0.05715), STEEL, name="collars", damping=damping)
    held = [cf.Roller(end, across) for end in (rod.start, rod.end) for across in ((1, 0, 0), (0, 1, 0))]
    above = cf.drilling.PipeAbove(rod.start, pipe, drive or cf.drilling.TopDrive(0.0), **more)
    return rod, cf.Scene([rod], held, [above, *(load(rod) for load in loads)])


def pulse(size, length):
    """A smooth load for `length` s, of this largest vector."""
    return lambda t: tuple(x * math.sin(math.pi * t / length) ** 2 if 0 < t < length else 0.0 for x in size)


def torque(length=0.6):
    """About the axis downwards, at the lower end."""
    return lambda rod: cf.FollowerMoment(rod.end, pulse((0, 0, 500.0), length))


def motion(scene, duration, dt, **more):
    return cf.simulate(scene, duration, dt=dt, **{"elements": 4, "degree": 2, **more})


def bit_speed(history, rod):
    return -history.angular_velocity(rod.end)[:, 2]


def exact_bit_speed(moment, duration, cells=60):
    """Times, and the speed of the lower end under a torque there, by d'Alembert's solution."""
    Z, dt = np.repeat([Z_ABOVE, Z_BELOW], [15 * cells, cells]), 200 / SPEED / cells
    down, up, found = np.zeros(len(Z)), np.zeros(len(Z)), []
    for step in range(int(duration / dt) + 2):
        speeds = np.zeros(len(Z) + 1)  # the upper end is held
        speeds[1:-1] = (down[:-1] - up[1:]) / (Z[:-1] + Z[1:])
        speeds[-1] = (down[-1] + moment(step * dt)) / Z[-1]
        down, up = up + 2 * Z * speeds[:-1], down - 2 * Z * speeds[1:]
        found.append(speeds[-1])
    return dt * np.arange(len(found)), np.array(found)


def frequencies_near(times, values, guesses):
    """Hz, of the peaks of the spectrum."""
    window, found = np.hanning(len(times)) * (values - values.mean()), []
    for guess in guesses:
        f = guess + np.linspace(-0.02, 0.02, 81)
        size = np.abs(np.exp(-2j * np.pi * f[:, None] * times) @ window)
        a, b, c = size[(k := int(size[1:-1].argmax())) : k + 3]
        found.append(f[k + 1] + (f[1] - f[0]) * 0.5 * (a - c) / (a - 2 * b + c))
    return np.array(found)


# -- the delay lines alone -------------------------------------------------------------------------------------------


def free_end(lines, duration, h):
    """Speeds of a lower end without torque, means over steps."""
    speeds = []
    for k in range(int(round(duration / h))):
        speeds.append(lines.arriving((k + 0.5) * h) / lines.dashpot)
        lines.advance(k * h, h, speeds[-1])
    return np.array(speeds)


@pytest.mark.once
def test_a_free_pipe_under_a_stiff_drive_turns_by_the_double_speed_in_turns():
    """Travel time of 1 s, in whole steps: 0, then twice the drive's speed for 2 s, 0 for 2 s, and so on."""
    lines = DelayLines([5.0], [1.0], [0.0, 0.0], TopEnd(lambda a, b: 3.0, stiff=True))
    speeds = free_end(lines, 9.0, 1 / 64).reshape(-1, 64).mean(axis=1)
    np.testing.assert_allclose(speeds, [0, 6, 6, 0, 0, 6, 6, 0, 0], atol=1e-12)


@pytest.mark.once
@pytest.mark.parametrize("split", [[1.0], [0.3, 0.7], [0.21, 0.35, 0.44]])
def test_parts_of_one_impedance_are_one_pipe_and_interpolation_creates_no_energy(split):
    """Travel times that are no whole numbers of steps; a smooth wave of 1 s goes up and down for 20 s."""

    def top(start, end):
        return math.sin(math.pi * (start + end) / 2) ** 2 if end < 1 else 0.0

    n, end, h = len(split), TopEnd(top, stiff=True), 0.0127
    speeds = free_end(DelayLines([5.0] * n, split, [0.0] * (n + 1), end), 20.0, h)
    one = free_end(DelayLines([5.0], [1.0], [0.0, 0.0], end), 20.0, h)
    np.testing.assert_allclose(speeds, one, atol=2e-3)
    energies = [(speeds[int(t / h) : int((t + 4) / h)] ** 2).sum() for t in (0.5, 4.5, 8.5, 12.5)]
    assert (np.diff(energies) <= 0).all() and energies[-1] > 0.999 * energies[0]


@pytest.mark.once
def test_parts_of_several_impedances_scatter_as_they_should():
    """The first wave that passes from Z = 5 to Z = 2 doubles by 2 x 5/(5 + 2), less than 2 at the free end."""
    lines = DelayLines([5.0, 2.0], [1.0, 1.0], [0.0, 0.0, 0.0], TopEnd(lambda a, b: 1.0, stiff=True))
    speeds = free_end(lines, 4.0, 1 / 64).reshape(-1, 64).mean(axis=1)
    np.testing.assert_allclose(speeds[:3], [0, 0, 2 * 2 * 5 / 7], atol=1e-12)


# -- with a rod ------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["momentum", "energy", "generalised-alpha"])
def test_the_answer_to_a_torque_at_the_bit_is_that_of_the_whole_string(scheme):
    """Of order 2 in time, in every scheme."""
    rod, scene = collars(None, torque())
    times, exact = exact_bit_speed(lambda t: torque()(rod).moment(t)[2], 3.0)
    errors = []
    for dt in (0.006, 0.003):
        history = motion(scene, 3.0, dt, scheme=scheme)
        off = bit_speed(history, rod) - np.interp(history.times, times, exact)
        errors.append(np.abs(off).max() / np.abs(exact).max())
    assert errors[1] < 1e-3 and errors[0] > 2.5 * errors[1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hook", "axial", "torsional", "duration"),
    [(cf.drilling.Hook(5e6), ON_HOOK, [], 25.0), (None, UNDER_RIGID_HOOK, TORSIONAL, 40.0)],
)
def test_natural_frequencies_are_those_of_the_reference(hook, axial, torsional, duration):
    """After a blow and a short torque, which do not feel each other."""
    blow = pulse((0, 0, -2e4), 0.15)
    rod, scene = collars(None, torque(0.2), lambda rod: cf.Force(rod.end, blow), hook=hook)
    history = motion(scene, duration, 0.01, elements=2)
    for values, known, allowed in (
        (history.velocity(rod.end)[:, 2], axial, 2.5e-4),
        (bit_speed(history, rod), torsional, 5e-5),
    ):
        np.testing.assert_allclose(frequencies_near(history.times, values, known), known, rtol=allowed)


def test_a_matched_drive_reflects_nothing():
    """The rod moves as on a dashpot of the pipe's impedance."""
    rod, scene = collars(cf.drilling.TopDrive(0.0, control=cf.drilling.Matched()), torque())
    dashpot = cf.Scene([rod], [cf.Pin(rod.start), *scene.supports[2:]],
                       [cf.Dashpot(rod.start, rotational=Z_ABOVE), torque()(rod)])  # fmt: skip
    speed, other = (bit_speed(motion(x, 2.2, 0.01), rod) for x in (scene, dashpot))
    np.testing.assert_allclose(speed, other, atol=1e-9 * np.abs(other).max())


@pytest.mark.slow
@pytest.mark.parametrize("drag", [0.0, 0.2])
def test_a_controlled_drive_turns_the_rod_as_it_turns_the_string(drag):
    """Against the waves of the whole string, whose speeds are means over two of its steps."""
    drive = cf.drilling.TopDrive(
        lambda t: 5 * (1 - math.cos(math.pi * min(t, 2) / 2)), 2000.0, cf.drilling.PI(800.0, 200.0)
    )
    mud = {"drag": cf.drilling.ViscousDrag(drag)} if drag else {}
    rod, scene = collars(drive, damping=drag, **mud)
    string = cf.well.DrillString((cf.well.Collar(200.0, **BELOW), ABOVE))
    whole = cf.drilling.simulate(cf.drilling.Drilling(string, drive, **mud), 8.0, dt=0.0005, model="torsion")
    history = motion(scene, 8.0, 0.005)
    expected = np.interp(history.times, whole.times - (whole.times[1] - whole.times[0]) / 2, whole.bit_speed)
    np.testing.assert_allclose(bit_speed(history, rod), expected, atol=2e-4 * expected.max())


@pytest.mark.parametrize(
    ("scheme", "dt", "allowed"), [("momentum", 5e-3, 1e-5), ("energy", 1e-2, 1e-9), ("generalised-alpha", 1e-2, 2e-3)]
)
def test_energy_balance_with_all_that_the_pipe_does(scheme, dt, allowed):
    """Off the vertical, under a torque and a force; the first scheme keeps energy to second order alone."""
    drive = cf.drilling.TopDrive(lambda t: 3 * math.sin(t) ** 2, 2000.0, cf.drilling.PI(800.0, 200.0))
    blow = pulse((2e3, 0, -2e4), 0.5)
    rod, scene = collars(drive, torque(), lambda rod: cf.Force(rod.at(100.0), blow), hook=cf.drilling.Hook(5e6))
    assert imbalance(motion(scene, 2.2, dt, scheme=scheme)) < allowed


@pytest.mark.slow
def test_from_hanging_at_rest_the_hook_lifts_it():
    """By as much as the hook moved, one travel time before, on the mean."""
    weight = 200.0 * STEEL.density * math.pi / 4 * (0.1651**2 - 0.05715**2) * 9.80665
    lift = cf.drilling.Hook(speed=lambda t: 0.25 * (1 - math.cos(math.pi * min(t, 1))))
    rod, scene = collars(None, lambda rod: cf.Weight((0, 0, -9.80665)), hook=lift, tension=weight)
    history = motion(scene, 40.0, 0.02, start=1.0)
    up = history.displacement(rod.start)[:, 2]
    assert np.abs(up[history.times < 3000 / 5122.7 - 0.05]).max() < 1e-8
    speed, at_zero = np.polyfit(history.times[500:], up[500:], 1)
    assert abs(speed - 0.5) < 1e-3 and abs(at_zero + 0.25) < 0.05


def test_adaptive_steps_that_are_taken_back_do_not_count():
    rod, scene = collars(None, torque())
    times, exact = exact_bit_speed(lambda t: torque()(rod).moment(t)[2], 2.4)
    history = cf.simulate(scene, 2.4, tol=1e-5, elements=4, degree=2)
    off = bit_speed(history, rod) - np.interp(history.times, times, exact)
    assert np.abs(off).max() < 2e-3 * np.abs(exact).max()


@pytest.mark.parametrize("steps", [{"dt": 0.02}, {"tol": 1e-3}])
def test_pipe_resumes_to_identical_digits(steps, tmp_path, monkeypatch):
    drive = cf.drilling.TopDrive(3.0, 2000.0, cf.drilling.PI(800.0, 200.0))
    rod, scene = collars(drive, torque(), hook=cf.drilling.Hook(5e6))
    whole = cf.simulate(scene, 2.2, elements=2, degree=2, **steps)
    stop_at(monkeypatch, 60, 0.0)
    with pytest.raises(Exception, match="^$"):
        cf.simulate(scene, 2.2, elements=2, degree=2, folder=tmp_path / "kept", **steps)
    history = cf.resume(tmp_path / "kept", scene)
    for name in ("times", "energy", "work"):
        assert np.array_equal(getattr(history, name), getattr(whole, name))
    assert np.array_equal(history.position(rod.end), whole.position(rod.end))


def test_steps_longer_than_half_a_travel_time_are_halved():
    """A pipe of 100 m: 20 ms up in torsion, 12 axially."""
    short = cf.well.DrillPipe(length=100.0, outer_diameter=0.127, inner_diameter=0.10861, material=STEEL)
    rod, scene = collars(None, torque(), pipe=short)
    longest = 100 * math.sqrt(DENSITY / E) / 2
    history = motion(scene, 0.4, 0.016, save_every=0.4)
    assert history.steps[-1] == 50 and 0.016 / 2 < longest < 0.016


def test_refused_pipes():
    rod, scene = collars()
    drive, steel = cf.drilling.TopDrive(1.0), {"outer_diameter": 0.127, "inner_diameter": 0.10861}
    for arguments, words in (
        ((rod.at(100.0), ABOVE, drive), "station = .*an end of the rod"),
        ((rod.start, (), drive), "pipe = .*at least one part"),
        ((rod.start, "pipe", drive), "pipe = .*parts of the pipe"),
        ((rod.start, cf.well.DrillPipe(**steel), drive), "length = None: expected a positive number"),
        ((rod.start, ABOVE, 1.0), "drive = 1.0: expected TopDrive"),
        ((rod.start, ABOVE, drive, 5e6), "hook = .*Hook"),
        ((rod.start, ABOVE, drive, None, math.inf), "tension = inf: expected a finite number"),
        ((rod.start, ABOVE, drive, None, 0.0, 0.3), "drag = 0.3: expected ViscousDrag"),
    ):
        with pytest.raises(cf.SceneError, match=words):
            cf.drilling.PipeAbove(*arguments)
    with pytest.raises(cf.SceneError, match="triple-jump"):
        cf.simulate(scene, 1.0, dt=0.01, scheme="triple-jump")
    with pytest.raises(cf.SceneError, match="modes: PipeAbove at collars.start"):
        cf.modes(scene)


TURNS, LOBES, HEIGHT, WEIGHT, MASS = 120 * cf.units.rpm, 3, 8e-3, 6e4, 300.0
UP = LOBES * TURNS * HEIGHT  # m/s, of the rock below a bit in steady rotation, which meets it at once


def bouncing(stiffness=math.inf, mass=MASS, height=HEIGHT, law=None, **changed):
    """A uniform string of 2000 m: in the first 0.78 s nothing comes back from its top."""
    string = cf.well.DrillString([cf.well.Collar(2000.0, outer_diameter=0.2, inner_diameter=0.07)])
    bit = cf.drilling.BitOnRock(cf.drilling.Lobes(LOBES, height, law), WEIGHT, mass=mass, rock_stiffness=stiffness)
    given = {"string": string, "drive": cf.drilling.TopDrive(TURNS), "bit": bit, "start": "steady"} | changed
    return cf.drilling.Drilling(**given)


def exact(scene, until):
    """Weight on bit (N) over time: m u'' = W - Z u' - F with F = k (u + h sin(n Om t)) + W, or 0 where that is less."""
    Z, bit = scene.segments[0].axial_impedance, scene.bit
    k, m = bit.rock_stiffness, bit.mass

    def weight(t, u):
        return np.maximum(k * (u + HEIGHT * np.sin(LOBES * TURNS * t)) + WEIGHT, 0.0)

    def rates(t, y):
        return [y[1], (WEIGHT - Z * y[1] - weight(t, y[0])) / m]

    found = solve_ivp(rates, (0, until), [0.0, 0.0], "Radau", rtol=1e-9, atol=1e-12, dense_output=True, max_step=1e-3)
    return lambda t: weight(t, found.sol(t)[0])


@pytest.mark.once
@pytest.mark.parametrize("mass", [0.0, MASS])
def test_a_weight_on_rigid_rock_is_that_of_the_wave_and_the_impulse_is_told(mass):
    """m v of the bit's mass at once, Z v of the wave that starts; neither depends on the step, or on the elements."""
    scene, found = bouncing(mass=mass), []
    wave = WEIGHT + scene.segments[0].axial_impedance * UP
    for dt, elements in ((4e-3, None), (2e-3, None), (1e-3, None), (5e-4, 250)):
        history = cf.drilling.simulate(scene, 0.35, dt=dt, elements=elements)
        impulse, weight = history.impulse_on_bit, history.weight_on_bit
        assert impulse[0] == pytest.approx(mass * UP, rel=0.02, abs=1e-9) and (np.diff(impulse) >= 0).all()
        assert weight[history.times < 8.5e-3].mean() == pytest.approx(wave, rel=0.04)
        found.append((weight.max(), weight.mean() + impulse[-1] / 0.35))
        assert np.abs(history.balance).max() < 1e-9 * np.abs(history.lost_at_bit).max()
    peaks, means = np.array(found).T
    assert peaks.max() < 1.15 * wave and np.ptp(peaks) < 0.06 * wave, peaks  # a jump rings for some elements
    assert np.abs(means / means[-1] - 1).max() < 0.02, means
    told = history.details()
    assert ("largest impulse" in told) == (mass > 0) and "stopped by an impulse" in told and "N s" in told
    assert any("impulse" in axes.get_ylabel() for axes in history.plot().axes) == (mass > 0)


@pytest.mark.once
@pytest.mark.parametrize(("stiffness", "mass"), [(2.5e7, 300.0), (1e8, 3000.0), (1e9, 20e3)])
def test_rock_that_gives_way_makes_a_force_that_converges(stiffness, mass):
    """The bit leaves the rock and comes down again; the largest weight is right to 1 % with the usual step."""
    scene, off = bouncing(stiffness, mass), []
    weight = exact(scene, 0.5)
    usual = AxialTorsional(scene).dt
    for share in (2.0, 1.0, 0.5):
        history = cf.drilling.simulate(scene, 0.5, dt=share * usual)
        true = weight(history.mean_times)
        off.append(np.sqrt(np.mean((history.weight_on_bit - true) ** 2)) / true.max())
        assert history.weight_on_bit.min() == 0 and (history.impulse_on_bit == 0).all()
        if share <= 1:
            assert history.weight_on_bit.max() == pytest.approx(weight(np.linspace(0, 0.5, 20001)).max(), rel=0.01)
        assert np.abs(history.balance).max() < 1e-9 * np.abs(history.lost_at_bit).max()
    assert off[1] < 0.01 and off[2] < 0.5 * off[1] < 0.5 * 0.5 * off[0], off
    assert f"a spring of {stiffness:.4g} N/m" in history.details() and "impulse" not in history.details()


@pytest.mark.once
def test_steps_that_do_not_resolve_an_impact_are_told():
    scene = bouncing(1e9, 300.0)
    assert AxialTorsional(scene).dt == pytest.approx(0.2 * scene.segments[0].axial_impedance / 1e9)
    told = [why for why in AxialTorsional(scene, 4e-3).why if "APPROXIMATE" in why]
    assert len(told) == 1 and "within 0.0011 s" in told[0] and "a dt of at most 0.00044 s, and elements of" in told[0]
    assert not any("APPROXIMATE" in why for why in AxialTorsional(bouncing(2.5e7), 4e-3).why)


@pytest.mark.once
@pytest.mark.parametrize("mass", [0.0, 2000.0])
def test_a_bit_that_is_set_down_on_rigid_rock_has_the_impulse_of_its_mass(mass):
    """It is lifted, then lowered with 1 m/s, at rest in itself: m v, and the force Z v of the wave that starts."""
    times = [0.0, 2.0, 4.0, 9.0, 11.0, 13.0]
    hook = cf.drilling.Hook(speed=cf.signals.Table(times, [(0.0,), (0.5,), (0.0,), (0.0,), (-1.0,), (-1.0,)]))
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(0.0, 0.0), 1e4, mass=mass)
    scene = hanging(hook, bit=bit, weight=300.0, drag=cf.drilling.ViscousDrag(0.0, 2.0))
    Z = scene.segments[-1].axial_impedance
    for dt in (4e-3, 2e-3):
        rows = AxialTorsional(scene, dt, 300).advance(round(12.3 / dt))
        t, (impulse, weight) = rows[:, 0], (column(rows, name) for name in ("impulse_on_bit", "weight_on_bit"))
        first = int(np.argmax((weight > 0) & (t > 5)))
        down = column(rows, "bit_velocity")[first - 2]
        assert 0.8 < down < 1.2 and impulse[first] - impulse[first - 1] == pytest.approx(mass * down, rel=0.01)
        assert weight[first + 1 : first + round(0.03 / dt)].mean() == pytest.approx(1e4 + Z * down, rel=0.03)
        assert unbalanced(rows) < 1e-11


@pytest.mark.once
def test_a_disc_that_bounces_has_its_whole_mass():
    """The mass of the last disc, on a spring, comes down on a rock that rises."""
    discs = cf.drilling.Discs((1e3, 100.0), (500.0,), masses=(1e5, 2e3), axial_stiffnesses=(1e6,))
    bit = cf.drilling.BitOnRock(cf.drilling.Lobes(LOBES, HEIGHT), 1e3, mass=500.0)
    history = cf.drilling.simulate(
        cf.drilling.Drilling(discs, cf.drilling.TopDrive(TURNS), bit, start="steady"), 0.5, dt=1e-3
    )
    assert history.impulse_on_bit[0] == pytest.approx(2500.0 * UP, rel=1e-3) and history.weight_on_bit.max() < 4e4


@pytest.mark.once
def test_a_torque_by_the_weight_leaves_out_what_belongs_to_an_impulse():
    """Whatever the step; and what is recalled goes on to the same digits."""
    largest = []
    for dt in (2e-3, 1e-3, 5e-4):
        scene = bouncing(law=cf.drilling.Stribeck(0.3, 0.3, radius=0.1), mass=3e3)
        model, again = AxialTorsional(scene, dt, 300), AxialTorsional(scene, dt, 300)
        rows = model.advance(round(0.05 / dt))
        largest.append(column(rows, "torque_on_bit").max())
        assert largest[-1] <= 0.03 * column(rows, "weight_on_bit").max() * (1 + 1e-12)
        assert column(rows, "impulse_on_bit")[-1] > 0.9 * 3e3 * UP
    assert max(largest) < 1.4 * min(largest), largest  # a jump rings for some elements
    again.recall(model.memory())
    np.testing.assert_array_equal(model.advance(200), again.advance(200))


@pytest.mark.once
def test_a_rock_in_other_units_is_doubted():
    """1000 kN/mm, say, as a number of 1e3 N/m."""
    with pytest.warns(cf.SceneWarning, match="BitOnRock.rock_stiffness = 1000 N/m: 60000 N press the bit by 60 m into"):
        cf.drilling.BitOnRock(cf.drilling.Lobes(3, 8e-3), weight=6e4, rock_stiffness=1e3)


@pytest.mark.once
@pytest.mark.parametrize(("given", "words"), [
    ({"weight": 1e4, "rock_stiffness": 0.0}, "BitOnRock.rock_stiffness = 0.0: expected a positive number or inf"),
    ({"rock_stiffness": 1e8}, "BitOnRock.weight = None: expected the weight on bit .* where the rock has"),
    ({"law": cf.drilling.Cutting(0.1, 6e7, 0.6, 4), "weight": 1e4, "rock_stiffness": 1e8},
     "Cutting has a depth of cut"),
])  # fmt: skip
def test_refused_bits(given, words):
    with pytest.raises(cf.SceneError, match=words):
        cf.drilling.BitOnRock(**({"law": cf.drilling.Stribeck(1e3, 1e3)} | given))


@pytest.mark.once
@pytest.mark.parametrize("stiffness", [1e6, 1e8, math.inf])
def test_the_weight_of_a_hook_that_is_lowered_is_that_of_springs_in_a_row(stiffness):
    """Lines, string and rock; and in steady rotation on rock that gives way nothing changes."""
    down = cf.signals.Table([0.0, 1.0, 2.0, 60.0], [(0.0,), (-0.01,), (0.0,), (0.0,)])
    bit = cf.drilling.BitOnRock(cf.drilling.Stribeck(0.0, 0.0), 6e4, rock_stiffness=stiffness)
    scene = hanging(cf.drilling.Hook(6e6, down), bit=bit, weight=300.0, drag=cf.drilling.ViscousDrag(0.0, 3.0))
    history = cf.drilling.simulate(scene, 25.0, dt=5e-3)
    give = sum(x.length / x.EA for x in scene.segments) + 1 / 6e6 + 1 / stiffness
    assert history.weight_on_bit[-1] - 6e4 == pytest.approx(0.01 / give, rel=1e-6)
    turning = bouncing(stiffness, height=1e-12, start="steady", drag=cf.drilling.ViscousDrag(0.3, 0.3))
    assert np.ptp(cf.drilling.simulate(turning, 1.0, dt=5e-3).weight_on_bit) < 1.0
