"""Laws and drives of drill-strings that are defined outside the package, each in one file of tests/extensions."""

import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from extensions.karnopp import Karnopp
from extensions.sampled_speed import LimitedSpeed
from extensions.stribeck_wall import StribeckCurve

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling import BitLaw, FrictionLaw, SampledControl

pytestmark = pytest.mark.serial
TORSION, BOTH = "torsion", "axial and torsional"
COLLAR = cf.well.Collar(length=100.0, outer_diameter=0.165, inner_diameter=0.057)
PIPE = cf.well.DrillPipe(length=900.0, outer_diameter=0.127, inner_diameter=0.1086)
STRING = cf.well.DrillString((COLLAR, PIPE))
PATH = cf.well.WellPath.from_survey([0, 200, 600, 1000], [0, 0, 40, 40], [0, 0, 0, 0], degrees=True)
HOLE = cf.well.Borehole(PATH, (cf.well.HoleSection(1000.0, 0.25, friction=0.3),))


def scene(law=None, *, weight=50e3, control=cf.drilling.Stiff(), inertia=0.0, **more):
    bit = None if law is None else cf.drilling.BitOnRock(law, weight=weight, inertia=20.0, mass=200.0)
    more |= {"mud": cf.well.Mud(1200.0)} if "hole" in more else {}
    return cf.drilling.Drilling(
        STRING, cf.drilling.TopDrive(6.0, inertia, control), bit, drag=cf.drilling.ViscousDrag(0.2, 0.2), **more
    )


def same(one, other, rtol):
    """Rows of two motions, to a share of the largest value of each column."""
    one, other = (np.nan_to_num(x.rows) for x in (one, other))
    assert (np.abs(one - other) <= rtol * np.abs(other).max(axis=0)).all()


@dataclass(frozen=True)
class _Falling(BitLaw):
    """`Stribeck` once more, as a function."""

    law: BitLaw

    @property
    def needs_weight(self):
        return self.law.needs_weight

    def torque(self, speed, weight):
        return self.law.torque(speed, weight if self.needs_weight else None)


@dataclass(frozen=True)
class _Wall(FrictionLaw):
    """`WallFriction` once more, as a function."""

    law: FrictionLaw
    of_rotation: bool = False
    of_hole: bool = False

    def coefficient(self, slip):
        return self.law.coefficient(slip)


BIT_LAWS = [
    cf.drilling.Stribeck(6e3, 4e3, 2.0),
    cf.drilling.Stribeck(1.0, 0.7, 2.0, radius=0.1),
    cf.drilling.Stribeck(6e3, 4e3),
]


@pytest.mark.parametrize("law", BIT_LAWS)
@pytest.mark.parametrize("model", [TORSION, BOTH])
def test_a_bit_law_as_a_function(law, model):
    """It sticks, slips and follows the weight on bit as the law in closed form."""
    options = {"model": model, "progress": False} | ({"elements": 60} if model == BOTH else {})
    moves = {"hook": cf.drilling.Hook(stiffness=5e6, speed=-1e-3)} if model == BOTH else {}
    expected, found = (cf.drilling.simulate(scene(x, **moves), 6.0, **options) for x in (law, _Falling(law)))
    assert expected.bit_speed.max() > 6.0 and (expected.bit_speed[10:] == 0).any()
    same(found, expected, 1e-6)


def test_a_bit_law_as_a_function_starts_steadily_and_is_linearised():
    law, stiff = (
        cf.drilling.Stribeck(1.0, 0.7, 2.0, radius=0.1),
        scene(_Falling(cf.drilling.Stribeck(1.0, 0.7, 2.0, radius=0.1))),
    )
    for model in (TORSION, BOTH):
        history = cf.drilling.simulate(replace(stiff, start="steady"), 0.5, model=model, progress=False)
        assert history.torque_on_bit == pytest.approx(law.torque(6.0, 50e3), rel=1e-3)
        assert np.ptp(history.bit_speed) < 0.01
    speeds, weights = [2.0, 6.0], [30e3, 60e3]
    expected, found = (cf.drilling.stability(x, speeds, weights, up_to=2.0) for x in (scene(law), stiff))
    np.testing.assert_allclose(found.roots, expected.roots, rtol=1e-6)
    expected, found = (
        (cf.drilling.limit_speed(x, up_to=2.0), cf.drilling.limit_weight(x, 3.0, up_to=2.0))
        for x in (scene(law), stiff)
    )
    assert found == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("model", [TORSION, BOTH])
def test_karnopp(model):
    """With a narrow band it is the law that drops at once; with a wide one the bit needs more to leave it."""
    options = {"model": model, "progress": False} | ({"elements": 60} if model == BOTH else {})
    histories = {
        law: cf.drilling.simulate(scene(law), 8.0, **options)
        for law in (cf.drilling.Stribeck(6e3, 4e3), Karnopp(6e3, 4e3, 1e-5), Karnopp("6 kN m", "4 kN m", 0.5))
    }
    expected, narrow, wide = histories.values()
    np.testing.assert_allclose(narrow.bit_angle, expected.bit_angle, atol=0.1)
    assert narrow.bit_speed.max() == pytest.approx(expected.bit_speed.max(), rel=0.02)
    assert wide.torque_on_bit.max() == pytest.approx(6e3, rel=1e-9)  # all of it, while it moves within the band
    assert wide.bit_speed.max() == pytest.approx(expected.bit_speed.max(), rel=0.02)
    wide.plot()


def test_wall_friction_as_a_function():
    """Against rotation alone, and against axial and rotary slip together."""
    law = cf.drilling.WallFriction(0.3, 0.2, 0.05)
    turned = cf.drilling.WallFriction(1.0, 0.6, 1.0, of_rotation=True, of_hole=True)
    for ours, given in ((law, {}), (turned, {"of_rotation": True, "of_hole": True})):
        for model in (TORSION, BOTH):
            options = {"model": model, "dt": 0.01, "progress": False}
            more = {"hole": HOLE, "hook": cf.drilling.Hook(speed=-0.05) if model == BOTH else None}
            expected, found = (
                cf.drilling.simulate(scene(friction=x, **more), 4.0, **options)
                for x in (ours, _Wall(ours, **given))
            )
            assert np.abs(expected.lost_at_wall[-1]) > 1e3
            same(found, expected, 1e-5)


@pytest.mark.parametrize("model", [TORSION, BOTH])
def test_stribeck_curve(model):
    """It drags more at high speed than its kinetic friction alone, and takes as much as the ledger says."""
    curve = StribeckCurve(0.3, 0.2, "0.1 m/s", viscous=0.1)
    options = {"model": model, "dt": 0.01, "progress": False}
    film, bare = (
        cf.drilling.simulate(scene(friction=x, hole=HOLE), 8.0, **options)
        for x in (curve, replace(curve, viscous=0.0))
    )
    assert film.surface_torque[-200:].mean() > 1.02 * bare.surface_torque[-200:].mean()
    assert abs(film.balance[-1]) < 1e-3 * film.work_of_drive[-1]
    steady = cf.drilling.simulate(replace(scene(friction=curve, hole=HOLE), start="steady"), 1.0, **options)
    assert np.ptp(steady.surface_torque) < 1e-2 * steady.surface_torque.mean()


@pytest.mark.parametrize("model", [TORSION, BOTH])
def test_a_control_called_once_a_sample(model, tmp_path):
    """With short samples it is the PI control; a motion that is resumed has the same digits."""
    options = {"model": model, "dt": 2e-3, "progress": False}
    gains = {"Kp": 2000.0, "Ki": 1000.0}
    law = cf.drilling.Stribeck(3e3, 2e3, 2.0)
    ours = scene(law, control=LimitedSpeed(**gains, most=1e5, sample=2e-3), inertia=2000.0)
    theirs = scene(law, control=cf.drilling.PI(**gains), inertia=2000.0)
    whole, expected = (cf.drilling.simulate(x, 6.0, **options) for x in (ours, theirs))
    assert np.abs(whole.drive_speed - expected.drive_speed).max() < 0.05
    limited = replace(ours, drive=replace(ours.drive, control=replace(ours.drive.control, most=1500.0)))
    assert cf.drilling.simulate(limited, 6.0, **options).surface_torque.max() < expected.surface_torque.max()
    cf.drilling.simulate(ours, 2.503, folder=tmp_path / "run", **options)
    resumed = cf.resume(tmp_path / "run", ours, duration=6.0, progress=False)
    np.testing.assert_array_equal(resumed.rows, whole.rows)


FILE = """
use = ["extensions.karnopp", "extensions.sampled_speed", "extensions.stribeck_wall"]

[well]
stations = [[0, 0, 0], [200, 0, 0], [600, 40, 0], [1000, 40, 0]]
sections = [{ to = 1000.0, diameter = 0.25, friction = 0.3 }]

[string]
components = [
    { type = "Collar", length = 100.0, outer_diameter = 0.165, inner_diameter = 0.057 },
    { type = "DrillPipe", outer_diameter = 0.127, inner_diameter = 0.1086 },
]

[mud]
density = 1200.0

[drive]
speed = "60 rpm"
inertia = 2000.0
control = { type = "LimitedSpeed", Kp = 2e3, Ki = 1e3, most = "20 kN m" }

[bit]
weight = "50 kN"
law = { type = "Karnopp", static = "3 kN m", dynamic = "2 kN m" }

[wall_friction]
type = "StribeckCurve"
static = 0.3
kinetic = 0.2
speed = "0.1 m/s"

[simulate]
duration = 1.0
"""


def test_all_three_in_a_scene_file_stored_and_resumed(tmp_path):
    """Another process, which has not imported them, goes on from the folder to the same digits."""
    (tmp_path / "rig.toml").write_text(FILE)
    found = cf.read(tmp_path / "rig.toml")
    assert found.scene.bit.law == Karnopp(3e3, 2e3) and found.scene.friction == StribeckCurve(0.3, 0.2, 0.1)
    assert found.scene.drive.control == LimitedSpeed(2e3, 1e3, 2e4)
    found.run(folder=tmp_path / "run", duration=0.5, progress=False).plot(tmp_path / "run.png")
    code = f"import cosserat_fenicsx as cf; cf.resume({str(tmp_path / 'run')!r}, duration=1.0, progress=False)"
    path = [str(Path(__file__).parent), *sys.path]
    subprocess.run([sys.executable, "-c", f"import sys; sys.path[:0] = {path!r}; {code}"], check=True)
    resumed, whole = cf.resume(tmp_path / "run"), found.run(profile_every=0.5 / 400, progress=False)
    np.testing.assert_array_equal(resumed.rows, whole.rows)
    for name, wrong, words in (
        ("Karnopp", "Karnop", "'Karnop': did you mean 'Karnopp'"),
        ('"2 kN m"', '"2 kN"', "Karnopp.dynamic = '2 kN': .*N m"),
        ('"3 kN m"', '"1 kN m"', "line 24, column 27: .*Karnopp.static = 1000.0: expected at least the dynamic"),
    ):
        (tmp_path / "wrong.toml").write_text(FILE.replace(name, wrong))
        with pytest.raises(cf.SceneError, match=words):
            cf.read(tmp_path / "wrong.toml")


def test_a_control_called_once_a_sample_in_the_linear_theory():
    """It stands for its gains, where it has some."""
    control = LimitedSpeed(2000.0, 1000.0, most=1e5)
    law = cf.drilling.Stribeck(6e3, 4e3, 2.0)
    ours, theirs = (scene(law, control=x, inertia=2000.0) for x in (control, cf.drilling.PI(2000.0, 1000.0)))
    np.testing.assert_allclose(*(cf.drilling.stability(x, [6.0], up_to=1.0).roots for x in (ours, theirs)))

    @dataclass(frozen=True)
    class Blind(SampledControl):
        def torque(self, state, now):
            return 1e3, state

    blind = cf.drilling.TopDrive(6.0, 2000.0, Blind())
    with pytest.raises(cf.SceneError, match="acts in drilling.simulate, unless Blind has gains"):
        cf.drilling.stability(replace(ours, drive=blind), [6.0])
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), COLLAR.stiffness)
    with pytest.raises(cf.SceneError, match="acts in drilling.simulate"):
        cf.drilling.PipeAbove(rod.start, PIPE, blind)
    with pytest.raises(cf.SceneError, match="'rest' with this drive"):
        cf.drilling.simulate(replace(ours, start="steady"), 1.0)


@pytest.mark.parametrize(
    ("torque", "words"),
    [
        (lambda speed, weight: -speed, "torque = -1e-06: expected a number, not negative, at the speed 1e-06"),
        (lambda speed, weight: speed * weight, "torque = nan: expected a number, not negative"),
        (lambda speed, weight: 1 / 0, "torque raised ZeroDivisionError .* at the speed 0"),
        (lambda speed, weight: speed, "torque = 0 at the speed 0: expected the largest value at rest"),
    ],
)
def test_laws_that_fail_are_refused_in_words(torque, words):
    Law = dataclass(frozen=True)(type("_Law", (BitLaw,), {"torque": lambda self, *given: torque(*given)}))
    for model in (TORSION, BOTH):
        with pytest.raises(cf.SceneError, match=words):
            cf.drilling.simulate(scene(Law()), 1.0, model=model)
    with pytest.raises(cf.SceneError, match="expected a WallFriction, of which the rod's wall"):
        cf.drilling.mixed_scene(scene(friction=StribeckCurve(0.3, 0.2, 0.1), hole=HOLE), 900.0)


def test_a_law_with_an_array():
    """It cannot be hashed, and is sampled anew."""

    @dataclass(frozen=True, eq=False)
    class Table(BitLaw):
        values: np.ndarray
        __hash__ = None

        def torque(self, speed, weight):
            return np.interp(speed, *self.values)

    law, same_law = Table(np.array([[0.0, 2.0, 50.0], [6e3, 4e3, 4e3]])), cf.drilling.Stribeck(6e3, 4e3)
    history = cf.drilling.simulate(scene(law), 6.0, progress=False)
    assert history.torque_on_bit.max() == pytest.approx(same_law.static, rel=1e-3) and history.bit_speed.max() > 6.0


def test_a_law_that_fails_during_the_motion():
    @dataclass(frozen=True)
    class Fails(BitLaw):
        needs_weight = True

        def torque(self, speed, weight):
            return 4e3 if weight == 50e3 else 1 / 0

    with pytest.raises(cf.SceneError, match="Fails.torque raised ZeroDivisionError"):
        cf.drilling.simulate(
            scene(Fails(), hook=cf.drilling.Hook(5e6, -1e-3)), 2.0, model=BOTH, progress=False
        )


def test_controls_that_fail_are_refused_in_words():
    @dataclass(frozen=True)
    class Changing(SampledControl):
        def torque(self, state, now):
            return 1e3, (now.time,)

    with pytest.raises(cf.SceneError, match=r"Changing.torque = .*expected a state of 0 numbers at t = 0 s"):
        cf.drilling.simulate(scene(control=Changing(), inertia=2000.0), 1.0)
    with pytest.raises(cf.SceneError, match="expected the drive's own .* for a sampled control"):
        scene(control=Changing())
