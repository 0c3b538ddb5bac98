"""A bit that comes down on rock: impulses on rigid rock, forces on rock that gives way, whatever the step."""

import math

import numpy as np
import pytest
from axial_scenes import column, hanging, unbalanced
from scipy.integrate import solve_ivp

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.elements import AxialTorsional
from cosserat_fenicsx.drilling.scene import Drilling
from cosserat_fenicsx.parts import from_data, to_data

pytestmark = pytest.mark.serial
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


@pytest.mark.parametrize("mass", [0.0, MASS])
def test_a_weight_on_rigid_rock_is_that_of_the_wave_and_the_impulse_is_told(mass):
    """m v of the bit's mass at once, Z v of the wave that starts; neither depends on the step, or on the elements."""
    scene, found = bouncing(mass=mass), []
    wave = WEIGHT + scene.segments[0].axial_impedance * UP
    for dt, elements in ((4e-3, None), (2e-3, None), (1e-3, None), (5e-4, 250)):
        history = cf.drilling.simulate(scene, 0.5, dt=dt, elements=elements)
        impulse, weight = history.impulse_on_bit, history.weight_on_bit
        assert impulse[0] == pytest.approx(mass * UP, rel=0.02, abs=1e-9) and (np.diff(impulse) >= 0).all()
        assert weight[history.times < 8.5e-3].mean() == pytest.approx(wave, rel=0.04)
        found.append((weight.max(), weight.mean() + impulse[-1] / 0.5))
        assert np.abs(history.balance).max() < 1e-9 * np.abs(history.lost_at_bit).max()
    peaks, means = np.array(found).T
    assert peaks.max() < 1.15 * wave and np.ptp(peaks) < 0.06 * wave, peaks  # a jump rings for some elements
    assert np.abs(means / means[-1] - 1).max() < 0.02, means
    told = history.details()
    assert ("largest impulse" in told) == (mass > 0) and "stopped by an impulse" in told and "N s" in told
    assert any("impulse" in axes.get_ylabel() for axes in history.plot().axes) == (mass > 0)


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


def test_steps_that_do_not_resolve_an_impact_are_told():
    scene = bouncing(1e9, 300.0)
    assert AxialTorsional(scene).dt == pytest.approx(0.2 * scene.segments[0].axial_impedance / 1e9)
    told = [why for why in AxialTorsional(scene, 4e-3).why if "APPROXIMATE" in why]
    assert len(told) == 1 and "within 0.0011 s" in told[0] and "a dt of at most 0.00044 s, and elements of" in told[0]
    assert not any("APPROXIMATE" in why for why in AxialTorsional(bouncing(2.5e7), 4e-3).why)


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


def test_a_disc_that_bounces_has_its_whole_mass():
    """The mass of the last disc, on a spring, comes down on a rock that rises."""
    discs = cf.drilling.Discs((1e3, 100.0), (500.0,), masses=(1e5, 2e3), axial_stiffnesses=(1e6,))
    bit = cf.drilling.BitOnRock(cf.drilling.Lobes(LOBES, HEIGHT), 1e3, mass=500.0)
    history = cf.drilling.simulate(
        cf.drilling.Drilling(discs, cf.drilling.TopDrive(TURNS), bit, start="steady"), 0.5, dt=1e-3
    )
    assert history.impulse_on_bit[0] == pytest.approx(2500.0 * UP, rel=1e-3) and history.weight_on_bit.max() < 4e4


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


@pytest.mark.parametrize(("rpm", "stiffness"), [(60, 2.5e7), (100, 1e8)])
def test_lobes_shake_the_weight_less_where_the_rock_gives_way(rpm, stiffness):
    """`bit_bounce` and the motion agree: D k/(D + k) of the dynamic stiffness D of the string."""
    turns = rpm * cf.units.rpm
    bit = cf.drilling.BitOnRock(cf.drilling.Lobes(LOBES, 0.001), weight=80e3, mass=500.0, rock_stiffness=stiffness)
    scene = hanging(
        cf.drilling.Hook(5e6), cf.drilling.TopDrive(turns), bit, drag=cf.drilling.ViscousDrag(0.2, 0.2), start="steady"
    )
    model = AxialTorsional(scene, 0.002, 300)
    rows = model.advance(30000)[20000:]
    phase = LOBES * turns * (rows[:, 0] - model.dt / 2)
    parts = np.column_stack([np.sin(phase), np.cos(phase), np.ones(len(phase))])
    sine, cosine, mean = np.linalg.lstsq(parts, column(rows, "weight_on_bit"), rcond=None)[0]
    expected = cf.drilling.bit_bounce(scene, [turns]).amplitude[0]
    assert math.hypot(sine, cosine) == pytest.approx(expected, rel=4e-3) and mean == pytest.approx(80e3, rel=1e-3)


def test_a_rock_in_other_units_is_doubted():
    """1000 kN/mm, say, as a number of 1e3 N/m."""
    with pytest.warns(cf.SceneWarning, match="BitOnRock.rock_stiffness = 1000 N/m: 60000 N press the bit by 60 m into"):
        cf.drilling.BitOnRock(cf.drilling.Lobes(3, 8e-3), weight=6e4, rock_stiffness=1e3)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"weight": 1e4, "rock_stiffness": 0.0}, "BitOnRock.rock_stiffness = 0.0: expected a positive number or inf"),
        ({"rock_stiffness": 1e8}, "BitOnRock.weight = None: expected the weight on bit .* where the rock has"),
        (
            {"law": cf.drilling.Cutting(0.1, 6e7, 0.6, 4), "weight": 1e4, "rock_stiffness": 1e8},
            "Cutting has a depth of cut",
        ),
    ],
)
def test_refusals(given, words):
    with pytest.raises(cf.SceneError, match=words):
        cf.drilling.BitOnRock(**({"law": cf.drilling.Stribeck(1e3, 1e3)} | given))


def test_rock_in_a_scene_file(tmp_path):
    """With a unit; and what is stored of a scene has it, too."""
    text = """
        depth = 1000.0
        [string]
        components = [{ type = "DrillPipe", size = "5 in 19.50 lb/ft" }]
        [drive]
        speed = "60 rpm"
        [bit]
        weight = "50 kN"
        mass = 300.0
        rock_stiffness = "40 MN/m"
        law = { type = "Lobes", count = 3, amplitude = 0.004 }
    """
    file = tmp_path / "bounce.toml"
    file.write_text(text, encoding="utf-8")
    scene = cf.read(file).scene
    assert scene.bit.rock_stiffness == 4e7 and from_data(Drilling, to_data(scene)).bit == scene.bit


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
