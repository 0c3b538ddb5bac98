"""The pipe above a rod as a condition at its end: its waves against closed forms, the string models and references."""

import math

import numpy as np
import pytest
from ended_motions import stop_at

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.pipe_above import DelayLines, TopEnd

pytestmark = pytest.mark.serial
G, E, DENSITY = 79.3e9, 206e9, 7850.0
STEEL = cf.Material(E=E, nu=E / (2 * G) - 1, density=DENSITY)
PIPE = cf.well.DrillPipe(length=3000.0, outer_diameter=0.127, inner_diameter=0.10861, material=STEEL)
COLLARS = {"outer_diameter": 0.1651, "inner_diameter": 0.05715, "material": STEEL}
Z_PIPE, Z_COLLARS, SPEED = 296.3752962822167, 1793.8208301221391, 3178.350331229312
# natural frequencies of the reference numbers for drill-strings: a_stability and c_axial, Hz
TORSIONAL = [0.19208807729519303, 0.627212400600027, 1.116183045133015, 1.625788564006934, 2.143329063144303]
ON_HOOK = [0.30553636274474666, 0.9808152730876113, 1.7320998057762933, 2.5179520090783853]
UNDER_RIGID_HOOK = [0.31638592263763815, 1.020855011562465, 1.8063829278567385, 2.6254960072287594]


def collars(drive=None, *loads, pipe=PIPE, damping=0.0, **more):
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
    Z, dt = np.repeat([Z_PIPE, Z_COLLARS], [15 * cells, cells]), 200 / SPEED / cells
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


def imbalance(history):
    change = history.energy - history.work + history.dissipated
    return np.abs(change - change[0]).max() / history.energy.max()


# -- the delay lines alone -------------------------------------------------------------------------------------------


def free_end(lines, duration, h):
    """Speeds of a lower end without torque, means over steps."""
    speeds = []
    for k in range(int(round(duration / h))):
        speeds.append(lines.arriving((k + 0.5) * h) / lines.dashpot)
        lines.advance(k * h, h, speeds[-1])
    return np.array(speeds)


def test_a_free_pipe_under_a_stiff_drive_turns_by_the_double_speed_in_turns():
    """Travel time of 1 s, in whole steps: 0, then twice the drive's speed for 2 s, 0 for 2 s, and so on."""
    lines = DelayLines([5.0], [1.0], [0.0, 0.0], TopEnd(lambda a, b: 3.0, stiff=True))
    speeds = free_end(lines, 9.0, 1 / 64).reshape(-1, 64).mean(axis=1)
    np.testing.assert_allclose(speeds, [0, 6, 6, 0, 0, 6, 6, 0, 0], atol=1e-12)


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


def test_parts_of_several_impedances_scatter_as_they_should():
    """The first wave that passes from Z = 5 to Z = 2 doubles by 2 x 5/(5 + 2), less than 2 at the free end."""
    lines = DelayLines([5.0, 2.0], [1.0, 1.0], [0.0, 0.0, 0.0], TopEnd(lambda a, b: 1.0, stiff=True))
    speeds = free_end(lines, 4.0, 1 / 64).reshape(-1, 64).mean(axis=1)
    np.testing.assert_allclose(speeds[:3], [0, 0, 2 * 2 * 5 / 7], atol=1e-12)


# -- with a rod ------------------------------------------------------------------------------------------------------


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
@pytest.mark.parametrize(("hook", "frequencies"), [(cf.drilling.Hook(5e6), ON_HOOK), (None, UNDER_RIGID_HOOK)])
def test_axial_natural_frequencies_are_those_of_the_reference(hook, frequencies):
    blow = pulse((0, 0, -2e4), 0.15)
    rod, scene = collars(None, lambda rod: cf.Force(rod.end, blow), hook=hook)
    history = motion(scene, 40.0, 0.01, elements=2)
    found = frequencies_near(history.times, history.velocity(rod.end)[:, 2], frequencies)
    np.testing.assert_allclose(found, frequencies, rtol=2.5e-4)


@pytest.mark.slow
def test_torsional_natural_frequencies_are_those_of_the_reference():
    rod, scene = collars(None, torque(0.2))
    history = motion(scene, 40.0, 0.01, elements=2)
    np.testing.assert_allclose(
        frequencies_near(history.times, bit_speed(history, rod), TORSIONAL), TORSIONAL, rtol=5e-5
    )


def test_a_matched_drive_reflects_nothing():
    """The rod moves as on a dashpot of the pipe's impedance."""
    rod, scene = collars(cf.drilling.TopDrive(0.0, control=cf.drilling.Matched()), torque())
    dashpot = cf.Scene([rod], [cf.Pin(rod.start), *scene.supports[2:]],
                       [cf.Dashpot(rod.start, rotational=Z_PIPE), torque()(rod)])  # fmt: skip
    speed, other = (bit_speed(motion(x, 4.0, 0.01), rod) for x in (scene, dashpot))
    np.testing.assert_allclose(speed, other, atol=1e-9 * np.abs(other).max())


@pytest.mark.parametrize("drag", [0.0, 0.2])
def test_a_controlled_drive_turns_the_rod_as_it_turns_the_string(drag):
    """Against the waves of the whole string, whose speeds are means over two of its steps."""
    drive = cf.drilling.TopDrive(
        lambda t: 5 * (1 - math.cos(math.pi * min(t, 2) / 2)), 2000.0, cf.drilling.PI(800.0, 200.0)
    )
    mud = {"drag": cf.drilling.ViscousDrag(drag)} if drag else {}
    rod, scene = collars(drive, damping=drag, **mud)
    string = cf.well.DrillString((cf.well.Collar(200.0, **COLLARS), PIPE))
    whole = cf.drilling.simulate(cf.drilling.Drilling(string, drive, **mud), 8.0, dt=0.0005, model="torsion")
    history = motion(scene, 8.0, 0.005)
    expected = np.interp(history.times, whole.times - (whole.times[1] - whole.times[0]) / 2, whole.bit_speed)
    np.testing.assert_allclose(bit_speed(history, rod), expected, atol=2e-4 * expected.max())


@pytest.mark.parametrize(("scheme", "allowed"), [("momentum", 1e-5), ("energy", 1e-9), ("generalised-alpha", 2e-3)])
def test_energy_balance_with_all_that_the_pipe_does(scheme, allowed):
    """Off the vertical, under a torque and a force; the first scheme keeps energy to second order alone."""
    drive = cf.drilling.TopDrive(lambda t: 3 * math.sin(t) ** 2, 2000.0, cf.drilling.PI(800.0, 200.0))
    blow = pulse((2e3, 0, -2e4), 0.5)
    rod, scene = collars(drive, torque(), lambda rod: cf.Force(rod.at(100.0), blow), hook=cf.drilling.Hook(5e6))
    assert imbalance(motion(scene, 3.0, 0.005, scheme=scheme)) < allowed


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
    times, exact = exact_bit_speed(lambda t: torque()(rod).moment(t)[2], 4.0)
    history = cf.simulate(scene, 4.0, tol=1e-5, elements=4, degree=2)
    off = bit_speed(history, rod) - np.interp(history.times, times, exact)
    assert np.abs(off).max() < 2e-3 * np.abs(exact).max()


@pytest.mark.parametrize("steps", [{"dt": 0.02}, {"tol": 1e-3}])
def test_resume_gives_identical_digits(steps, tmp_path, monkeypatch):
    drive = cf.drilling.TopDrive(3.0, 2000.0, cf.drilling.PI(800.0, 200.0))
    rod, scene = collars(drive, torque(), hook=cf.drilling.Hook(5e6))
    whole = cf.simulate(scene, 4.0, elements=2, degree=2, **steps)
    stop_at(monkeypatch, 90, 0.0)
    with pytest.raises(Exception, match="^$"):
        cf.simulate(scene, 4.0, elements=2, degree=2, folder=tmp_path / "kept", **steps)
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


def test_refusals():
    rod, scene = collars()
    drive, steel = cf.drilling.TopDrive(1.0), {"outer_diameter": 0.127, "inner_diameter": 0.10861}
    for arguments, words in (
        ((rod.at(100.0), PIPE, drive), "station = .*an end of the rod"),
        ((rod.start, (), drive), "pipe = .*at least one part"),
        ((rod.start, "pipe", drive), "pipe = .*parts of the pipe"),
        ((rod.start, cf.well.DrillPipe(**steel), drive), "length = None: expected a positive number"),
        ((rod.start, PIPE, 1.0), "drive = 1.0: expected TopDrive"),
        ((rod.start, PIPE, drive, 5e6), "hook = .*Hook"),
        ((rod.start, PIPE, drive, None, math.inf), "tension = inf: expected a finite number"),
        ((rod.start, PIPE, drive, None, 0.0, 0.3), "drag = 0.3: expected ViscousDrag"),
    ):
        with pytest.raises(cf.SceneError, match=words):
            cf.drilling.PipeAbove(*arguments)
    with pytest.raises(cf.SceneError, match="triple-jump"):
        cf.simulate(scene, 1.0, dt=0.01, scheme="triple-jump")
    with pytest.raises(cf.SceneError, match="modes: PipeAbove at collars.start"):
        cf.modes(scene)
