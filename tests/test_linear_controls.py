"""Linear controls of the drive: in motions of waves, elements and discs, in small motions, and against other truths."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling import (
    PI,
    BitOnRock,
    Discs,
    Drilling,
    LinearControl,
    Stribeck,
    TopDrive,
    ZTorque,
    frequency_response,
    simulate,
    stability,
)
from cosserat_fenicsx.drilling.linear.limits import fed_waves

pytestmark = [pytest.mark.serial, pytest.mark.once]
TRUTH = json.loads((Path(__file__).parent / "reference" / "controls.json").read_text())["drive reflection"]
GIVEN, TRUTH = TRUTH["input"], TRUTH["truth"]
Z, TAU, DELAY, OM = (GIVEN[name] for name in ("Z", "tau", "delay", "Om"))
STEEL = cf.Material(E=206e9, nu=0.3, density=7850.0)
PIPE = cf.well.DrillString([cf.well.Collar(GIVEN["L"], None, 0.127, 0.10861, material=STEEL)])


def filtered(delay=0.0):
    """`ZTorque`, and the same in matrices."""
    matrices = ((-1 / TAU,),), ((0.0, 1 / TAU),), (-1 / Z,)
    return [ZTorque(Z, TAU, delay), LinearControl(*matrices, commands="speed", delay=delay)]


def as_linear(Kp, Ki, **more):
    return LinearControl(((0.0,),), ((1.0, 0.0),), (Ki,), (Kp, 0.0), **more)


@pytest.mark.parametrize("which", [0, 1], ids=["ZTorque", "LinearControl"])
def test_reflection(which, truth):
    drive = TopDrive(OM, GIVEN["I"], filtered(DELAY)[which])
    above = frequency_response(Drilling(PIPE, drive), GIVEN["frequencies_Hz"]).drive_impedance
    rows = next(rows for name, rows in TRUTH.items() if name.startswith("Z-torque"))
    exact = [size * np.exp(1j * np.radians(angle)) for size, angle in rows]
    truth(f"drive reflection: {type(drive.control).__name__}, P/Q", -(Z - above) / (Z + above), exact, 1e-12)


@pytest.mark.parametrize("which", [0, 1], ids=["ZTorque", "LinearControl"])
def test_waves_that_a_filtered_drive_makes(which, truth):
    """From rest the wave that the drive sends down is Z Om and the part of a reflection: it falls as exp(-2 t/tau)."""
    control = filtered()[which]
    found = simulate(Drilling(PIPE, TopDrive(OM, control=control)), 0.1, dt=2e-4, progress=False)
    wave = next(rows for name, rows in TRUTH.items() if name.startswith("filtered"))
    times = [float(t) for t in wave]
    got = 2 * np.interp(times, found.mean_times, found.surface_torque) / (Z * OM) - 1
    truth(f"drive reflection: {type(control).__name__}, exp(-2 t/tau) in motion", got, list(wave.values()), 1e-3)


@pytest.mark.parametrize("model", ["torsion", "axial and torsional"])
def test_a_late_filtered_drive(model):
    """tau y' + y = Z Om - y(t - delay) for om = Om - y/Z, by its closed form in the first three delays."""
    found = simulate(
        Drilling(PIPE, TopDrive(OM, 2900.0, ZTorque(Z, TAU, DELAY))), 0.03, model=model, dt=1e-4, progress=False
    )
    t = found.mean_times
    late, later = np.maximum(t - DELAY, 0), np.maximum(t - 2 * DELAY, 0)
    y = 1 - np.exp(-late / TAU)
    y = np.where(later > 0, (1 - np.exp(-DELAY / TAU) + later / TAU) * np.exp(-later / TAU), y)
    got = 1 - (
        found.surface_torque / (Z * OM) if model == "torsion" else np.diff(found.drive_angle, prepend=0) / found.dt / OM
    )
    np.testing.assert_allclose(got[2:], y[2:], atol=6e-3 if model == "torsion" else 0.1)
    assert np.abs(found.balance).max() < 1e-9 * found.work_of_drive[-1]


def test_a_matched_drive(truth):
    """Without filter, above a free lower end, from rest."""
    found = simulate(Drilling(PIPE, TopDrive(OM, control=ZTorque(Z, 0.0))), 4.0, dt=1e-3, progress=False)
    T, known = (
        TRUTH["matched, free lower end, Om asked from t = 0, from rest"]["T_s"],
        TRUTH["matched, free lower end, Om asked from t = 0, from rest"],
    )
    at = [np.searchsorted(found.mean_times, t) for t in (1.9 * T, 2.1 * T)]
    got = [*found.drive_speed[at], *found.surface_torque[at], found.bit_speed[at[0]], found.work_of_drive[-1]]
    exact = [known[name] for name in ("drive speed before 2T", "after 2T", "torque before 2T", "after",
                                      "bit speed from T on", "energy handed to the string in all (J)")]  # fmt: skip
    truth("drive reflection: matched, from rest", got, exact, 1e-6, of=np.maximum(np.abs(exact), 1.0))


@pytest.mark.parametrize("model", ["waves", "elements", "discs"])
def test_matrices_of_a_PI_control(model):
    discs = Discs((900.0, 300.0), (470.0,), drags=(0.0, 40.0))
    string = discs if model == "discs" else PIPE
    bit = BitOnRock(Stribeck(6e3, 4e3, 3.0), inertia=350.0)
    run = {} if model == "discs" else {"model": {"waves": "torsion"}.get(model, "axial and torsional")}

    def found(control):
        scene = Drilling(string, TopDrive(OM, 2900.0, control), bit, start="steady")
        return simulate(replace(scene, start="rest"), 8.0, dt=5e-3, progress=False, **run), stability(scene, [OM]).roots

    (motion, roots), (other, same) = found(PI(1200.0, 900.0)), found(as_linear(1200.0, 900.0))
    scale = np.maximum(np.abs(motion.rows).max(axis=0), 1.0)  # losses at a wall that is not there are rounding
    np.testing.assert_allclose(other.rows / scale, motion.rows / scale, atol=1e-7)
    np.testing.assert_allclose(same, roots, rtol=1e-9)


def test_steady_starts():
    """A control with an integral, and a `ZTorque`, hold the string as it is."""
    bit = BitOnRock(Stribeck(4e3, 4e3))
    for control in (as_linear(1200.0, 900.0), as_linear(1200.0, 900.0, delay=0.05), ZTorque(delay=0.01)):
        for model in ("torsion", "axial and torsional"):
            scene = Drilling(PIPE, TopDrive(OM, 2900.0, control), bit, start="steady")
            found = simulate(scene, 1.0, model=model, progress=False)
            np.testing.assert_allclose(found.drive_speed, OM, rtol=1e-9)
    scene = Drilling(PIPE, TopDrive(OM, 2900.0, ZTorque(torque=3e3)), bit, start="steady")
    with pytest.raises(cf.SceneError, match="expected 'rest' with this drive: .* ZTorque does not hold the 4000 N m"):
        simulate(scene, 1.0, progress=False)


def test_a_control_that_feeds_the_string():
    """Its fast mode is found, and grows so in the motion."""
    control = LinearControl((), (), (), (-1e5, 0.0))
    scene = Drilling(PIPE, TopDrive(OM, 2900.0, control))
    fastest = stability(scene, [OM], up_to=1.0).growth.max()
    assert fastest == pytest.approx((1e5 - Z) / 2900.0, rel=1e-6)  # waves that went down do not come back in time
    moved = simulate(scene, 0.5, dt=1e-4, progress=False)
    growth = np.diff(np.log(np.abs(moved.drive_speed - OM)[[-1000, -1]]))[0] / (moved.dt * 999)
    assert growth == pytest.approx(fastest, rel=1e-4)
    late = replace(scene, drive=TopDrive(OM, 2900.0, as_linear(3e3, 4e3, delay=1.0)))
    s = stability(late, [OM], up_to=1.0)
    k = int(np.argmax(s.growth))
    root = s.roots.ravel()[k]
    moved = simulate(late, 60.0, dt=5e-3, progress=False)
    top = np.abs(moved.drive_speed - OM)
    half = [
        top[(moved.times > t) & (moved.times < t + 2 * np.pi / root.imag)].max()
        for t in (30.0, 30.0 + 8 * np.pi / root.imag)
    ]
    assert root.real > 0.05
    assert np.log(half[1] / half[0]) / (8 * np.pi / root.imag) == pytest.approx(root.real, rel=0.02)


@pytest.mark.parametrize("control", [ZTorque(filter=0.1, delay=0.02), LinearControl(
    ((-50.0, 0.0), (50.0, -50.0)), ((0.0, 50.0), (0.0, 0.0)), (0.0, -1 / 341.1), commands="speed")],
    ids=["late", "two filters"])  # fmt: skip
def test_waves_that_a_drive_feeds(control):
    """Faster than those looked for, they are told: by the reflection of the drive, and where all roots are found."""
    pipe = cf.well.DrillString([cf.well.DrillPipe(3000.0, size="5 in 19.50 lb/ft")])
    bit, drag = BitOnRock(Stribeck(6e3, 4e3, 3.0), inertia=350.0), cf.drilling.ViscousDrag(torsion=0.1)
    scene = Drilling(pipe, TopDrive(OM, 2900.0, control), bit, drag=drag)
    fed, answer = fed_waves(scene), stability(scene, [OM], up_to=20.0)
    k = np.nanargmax(answer.growth)
    assert fed.growth == pytest.approx(answer.growth.flat[k], rel=5e-3)
    assert fed.fastest == pytest.approx(answer.frequency.flat[k], abs=0.27)  # modes are 0.54 Hz apart
    found = stability(scene, [OM], up_to=2.0)
    assert not found.unstable(0) and "back larger than they come" in found.cautions[-1]
    assert "FASTER ONES DO" in str(found) and f"up_to={np.ceil(1.2 * fed.fastest):.0f}" in str(found)
    with pytest.warns(cf.SceneWarning, match="limit_speed: at every speed"):
        cf.drilling.limit_speed(scene, up_to=2.0)
    assert "CAUTION: the drive sends waves of" in str(simulate(scene, 0.1, progress=False))
    calm = replace(scene, drive=TopDrive(OM, 2900.0, ZTorque(filter=0.2, delay=0.01)))
    assert fed_waves(calm) is None and not stability(calm, [OM], up_to=2.0).cautions


@pytest.mark.parametrize("model", ["torsion", "axial and torsional"])
def test_a_motion_without_bound_is_told(model):
    control = LinearControl(((5.0,),), ((1.0, 0.0),), (900.0,), (1200.0, 0.0))
    found = simulate(Drilling(PIPE, TopDrive(OM, 2900.0, control)), 5.0, model=model, progress=False)
    assert found.stick_slip().unbounded and "UNSTABLE, the motion grows without bound" in str(found)
    assert found.why[-1].startswith("UNSTABLE: drive or bit reach") and "stick-slip" not in str(found)


def test_a_drive_without_torque_says_what_it_lacks():
    scene = Drilling(PIPE, TopDrive(OM, 2900.0, ZTorque(Z)), BitOnRock(Stribeck(3 * Z * OM, Z * OM)))
    found = simulate(scene, 5.0, progress=False)
    cycle = found.stick_slip()
    assert f"stands at {Z * OM / 1e3:.4g} kN m: torque=" in cycle.caution and "is 0 from rest" in cycle.caution
    assert f"steady rotation (about {Z * OM / 1e3:.3g} kN m)" in cycle.caution and np.isnan(cycle.severity)
    given = replace(scene, drive=TopDrive(OM, 2900.0, ZTorque(Z, torque=3 * Z * OM)))
    assert not simulate(given, 5.0, progress=False).stick_slip().caution


@pytest.mark.parametrize("model", ["torsion", "axial and torsional"])
def test_resumed_to_the_byte(model, tmp_path):
    for k, control in enumerate((ZTorque(filter=0.03, delay=0.02), as_linear(1e3, 5e2, delay=0.07))):
        scene = Drilling(
            PIPE,
            TopDrive(cf.signals.Ramp((OM,), end=2.0), 2900.0, control),
            BitOnRock(Stribeck(6e3, 4e3, 3.0), inertia=350.0),
        )
        whole = simulate(scene, 3.0, model=model, progress=False)
        simulate(scene, 1.111, model=model, folder=tmp_path / f"{k}", progress=False)
        np.testing.assert_array_equal(cf.resume(tmp_path / f"{k}", duration=3.0).rows, whole.rows)


def test_in_a_scene_file(tmp_path):
    file = Path(__file__).parent.parent / "demos" / "strings" / "autodriller.toml"
    text = file.read_text(encoding="utf-8").replace("[drive]", "\n".join([
        "[drive]", "inertia = 2900.0",
        'control = { type = "LinearControl", A = [[0.0]], B = [[1.0, 0.0]], C = [900.0], D = [1200.0, 0.0] }',
    ]))  # fmt: skip
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    assert cf.read(tmp_path / "scene.toml").scene.drive.control == as_linear(1200.0, 900.0)
    text = text.replace('"LinearControl", A = [[0.0]], B = [[1.0, 0.0]], C = [900.0], D = [1200.0, 0.0]',
                        '"ZTorque", filter = "20 ms", delay = "10 ms"')  # fmt: skip
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    assert cf.read(tmp_path / "scene.toml").scene.drive.control == ZTorque(delay=DELAY)


@pytest.mark.parametrize(("make", "words"), [
    (lambda: LinearControl(((0.0, 1.0),)), "LinearControl.A = .*square matrix"),
    (lambda: LinearControl(((0.0,),), ((1.0,),), (1.0,)), "LinearControl.B = .*1 rows of two numbers"),
    (lambda: LinearControl(((0.0,),), ((1.0, 0.0),), (1.0, 2.0)), "LinearControl.C = .*1 numbers"),
    (lambda: LinearControl(((float("nan"),),), ((1.0, 0.0),), (1.0,)), "LinearControl.A"),
    (lambda: LinearControl(), "LinearControl.D = .*answers to Om - om or M"),
    (lambda: LinearControl(D=(1e3, 1.0)), "LinearControl.D = .*factor below 1"),
    (lambda: LinearControl(D=(0.0, 1e-3), commands="speed"), "LinearControl.D = .*falls with the torque"),
    (lambda: TopDrive(OM, 0.0, as_linear(1e3, 1e3)), "TopDrive.inertia = 0.0: expected the drive's own"),
    (lambda: TopDrive(None, 2900.0, ZTorque()), "TopDrive.speed = None"),
    (lambda: ZTorque(0.0), "ZTorque.impedance = 0"),
    (lambda: ZTorque(delay=-0.01), "ZTorque.delay = -0.01"),
    (lambda: simulate(Drilling(PIPE, TopDrive(OM, control=ZTorque(delay=0.01))), 1.0, dt=0.008),
     "ZTorque.delay = 0.01: expected at least two steps"),
    (lambda: stability(Drilling(PIPE, TopDrive(OM, control=ZTorque(Z / 2, 0.0, 0.1))), [OM]),
     "ZTorque.delay = 0.1: expected 0 .s., or a filter"),
    (lambda: simulate(Drilling(PIPE, TopDrive(OM, control=ZTorque(Z, 0.0, 0.1))), 1.0, model="axial and torsional"),
     "ZTorque.delay = 0.1: expected 0 .s., or a filter"),
    (lambda: simulate(Drilling(PIPE, TopDrive(OM, 2900.0, ZTorque(filter=0.0, delay=0.01, torque=2e3))), 1.0),
     "ZTorque.delay = 0.01: expected 0 .s., or a filter"),
    (lambda: simulate(Drilling(Discs((9.0, 9.0), (5.0,)), TopDrive(OM, control=ZTorque(9.0, delay=0.1))), 1.0),
     "ZTorque.delay = 0.1: expected 0 .s., or a filter of the second order"),
    (lambda: simulate(Drilling(Discs((9.0, 9.0), (5.0,)), TopDrive(OM, control=ZTorque())), 1.0),
     "ZTorque.impedance = None: expected an impedance"),
])  # fmt: skip
def test_refused_by_name(make, words):
    with pytest.raises(cf.SceneError, match=words):
        make()


def test_a_mode_without_losses_neither_grows_nor_decays():
    found = str(stability(Drilling(PIPE, TopDrive(OM)), [OM], kind="axial", up_to=5.0))
    assert "which neither grows nor decays at" in found and "-0" not in found
