"""Bits that cut with a delay, and bits on lobes, at the end of a string: growth, closed forms, memory."""

import dataclasses
import math

import numpy as np
import pytest
from axial_scenes import column, hanging, unbalanced

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.elements import AxialTorsional

pytestmark = [pytest.mark.serial, pytest.mark.once]
BLADES, PSI, RATE = 4, 13.9, 0.5
WORN = cf.drilling.Cutting(a=0.108, epsilon=60e6, zeta=0.6, blades=4, wear=cf.drilling.Wear(60e6, 0.011, 0.6))


def lumped(speed, *, coupled):
    """The bit of Richard, Germay & Detournay in their units: with springs and dampers of both motions, or on an axial
    one that is next to nothing, below a drive that turns it as it likes."""
    spring = {"stiffnesses": (1.0,), "dampings": (0.04,)} if coupled else {"stiffnesses": (1e6,)}
    axial = {"axial_stiffnesses": (4.0,), "axial_dampings": (0.4,)} if coupled else {"axial_stiffnesses": (1e-9,)}
    discs = cf.drilling.Discs((1e-3, 1.0 if coupled else 1e6), masses=(1e-3, 1.0), **spring, **axial)
    law = cf.drilling.Cutting(a=1.0, epsilon=2.0, zeta=PSI / 2, blades=BLADES)
    weight = law.axial_stiffness * 2 * math.pi * RATE / (BLADES * speed)
    bit = cf.drilling.BitOnRock(law, weight=None if coupled else weight)
    return cf.drilling.Drilling(
        discs, cf.drilling.TopDrive(speed), bit, hook=cf.drilling.Hook(speed=-RATE), start="steady"
    )


def pushed(scene, dt, by):
    model = AxialTorsional(scene, dt)
    model._kept["v"][-1] += by
    return model


@pytest.mark.parametrize(("limit", "coupled"), [(2 * math.sqrt(2 * PSI / BLADES), False), (5.215775798890863, True)])
def test_vibrations_grow_below_the_regenerative_limit_and_decay_above_it(limit, coupled):
    """2 sqrt(2 psi/n) for axial motion alone; with torsion the limit of the quasi-polynomial (Richard et al. 2007)."""
    for speed, grows in ((0.99 * limit, True), (1.01 * limit, False)):
        rows = pushed(lumped(speed, coupled=coupled), 0.01, [1e-4, 0.0]).advance(6000)
        shaking = column(rows, "bit_advance") - RATE * rows[:, 0]
        early, late = (np.ptp(shaking[a : a + 1000]) for a in (2000, 5000))
        assert (late > 1.3 * early) if grows else (late < 0.8 * early)


def test_a_bit_that_shakes_follows_the_delay_equation_with_order_two():
    """u at 1, 2, 3 by Runge and Kutta's method with the delay that depends on the state, in published units."""
    exact = [0.0017178378340104425, 0.0034790366326158807, 0.0019899716831700367]
    start, errors = AxialTorsional(lumped(5.737353378779949, coupled=True), 0.01).bit_state()[0, 0], []
    for dt in (0.005, 0.0025):
        rows = pushed(lumped(5.737353378779949, coupled=True), dt, [0.05, 0.02]).advance(round(3 / dt))
        at = [round(t / dt) - 1 for t in (1, 2, 3)]
        errors.append(np.abs(column(rows, "bit_advance")[at] - RATE * np.arange(1, 4) - start - exact).max())
    assert errors[1] < 3e-6 and 3 < errors[0] / errors[1] < 5


def drilling(start="rest", weight=None, law=WORN, rpm=120.0, **more):
    bit = cf.drilling.BitOnRock(law, weight, inertia=41.0)
    rate = cf.drilling.Hook(speed=-1 / 120)
    return hanging(
        rate, cf.drilling.TopDrive(rpm * cf.units.rpm), bit, drag=cf.drilling.ViscousDrag(0.3, 0.5), start=start, **more
    )


def test_steady_drilling_is_a_solution():
    """Advance of the hook; weight and torque of the depth of cut and of the flats."""
    law, turns = WORN, 240 * cf.units.rpm
    rows = AxialTorsional(drilling("steady", rpm=240.0), 0.002).advance(100)
    cut, flats = 2 * math.pi / 120 / (4 * turns), 0.108 * 0.011 * 60e6
    weight = law.axial_stiffness * cut + flats
    torque = law.torsional_stiffness * cut + 0.6 * 0.108 / 2 * flats
    for name, value in (
        ("weight_on_bit", weight),
        ("torque_on_bit", torque),
        ("bit_speed", turns),
        ("bit_velocity", 1 / 120),
        ("drive_speed", turns),
    ):
        assert np.abs(column(rows, name) / value - 1).max() < 1e-6, name


def test_a_bit_that_is_pulled_up_steadily_is_free():
    """The rock does not pull it: no weight, no torque, and all of the string moves with the hook."""
    scene = hanging(
        cf.drilling.Hook(speed=0.01), cf.drilling.TopDrive(12.0), cf.drilling.BitOnRock(WORN), start="steady"
    )
    rows = AxialTorsional(scene, 0.002).advance(200)
    assert not column(rows, "weight_on_bit").any() and not column(rows, "torque_on_bit").any()
    assert np.abs(column(rows, "bit_velocity") + 0.01).max() < 1e-9


@pytest.mark.parametrize("start", ["rest", "steady"])
def test_without_a_hook_the_string_follows_the_bit(start):
    """The load of the hook stays, so that the mean weight on bit does; it drills by its depth of cut."""
    turns, steel = 240 * cf.units.rpm, 26.71375795359451 * 3000 + 147.91899737466485 * 200
    scene = dataclasses.replace(drilling(start, 120e3, rpm=240.0), hook=None)
    rows = AxialTorsional(scene, 0.004).advance(5000)
    # V from weight = k cut + flats + drag of the mud
    stiffness = WORN.axial_stiffness * 2 * math.pi / (4 * turns)
    rate = (120e3 - 0.108 * 0.011 * 60e6) / (stiffness + 0.5 * steel)
    weight = 120e3 - 0.5 * steel * rate
    if start == "steady":  # before vibrations grow
        assert column(rows, "weight_on_bit")[:250] == pytest.approx(weight, rel=1e-6)
        assert column(rows, "bit_velocity")[:250] == pytest.approx(rate, rel=1e-5)
    else:
        late = rows[:, 0] > 10
        assert column(rows, "weight_on_bit")[late].mean() == pytest.approx(weight, rel=0.05)
        assert np.ptp(column(rows, "bit_advance")[late]) > 5 * rate


@pytest.mark.parametrize("weight", [None, 120e3])
def test_a_bit_that_cuts_from_rest_keeps_the_books(weight):
    rows = AxialTorsional(drilling(weight=weight), 0.002).advance(8000)
    assert unbalanced(rows) < 1e-11 and column(rows, "lost_at_bit")[-1] > 1e4
    assert (column(rows, "weight_on_bit") >= -1e-6).all() and column(rows, "bit_speed").max() > 8


def test_a_worn_bit_stands_still_until_the_weight_exceeds_that_of_its_flats():
    """It does not turn, and the hook lowers it: the flats bear all up to a l sigma."""
    scene = hanging(cf.drilling.Hook(speed=-0.02), cf.drilling.TopDrive(0.0), cf.drilling.BitOnRock(WORN))
    rows = AxialTorsional(scene, 0.005).advance(4000)
    weight, deep = column(rows, "weight_on_bit"), column(rows, "bit_advance")
    limit = 0.108 * 0.011 * 60e6
    reached = int(np.argmax(weight > 0.99 * limit))
    assert reached > 100 and np.ptp(deep[:reached]) < 1e-12 and weight[-1] > 1.01 * limit
    assert deep[-1] > 1e-4


@pytest.mark.parametrize(("rpm", "amplitude"), [(60, 31767.361251313883), (100, 36070.57264496292)])
def test_lobes_shake_the_weight_on_bit_as_the_impedance_says(rpm, amplitude):
    """Three lobes of 2 mm: forced vibration, as long as the bit stays on the rock."""
    turns = rpm * cf.units.rpm
    bit = cf.drilling.BitOnRock(cf.drilling.Lobes(3, 0.002), weight=80e3)
    scene = hanging(
        cf.drilling.Hook(5e6), cf.drilling.TopDrive(turns), bit, drag=cf.drilling.ViscousDrag(0.2, 0.2), start="steady"
    )
    model = AxialTorsional(scene, 0.002, 300)
    rows = model.advance(40000)[30000:]
    phase = 3 * turns * (rows[:, 0] - model.dt / 2)
    parts = np.column_stack([np.sin(phase), np.cos(phase), np.ones(len(phase))])
    sine, cosine, mean = np.linalg.lstsq(parts, column(rows, "weight_on_bit"), rcond=None)[0]
    assert math.hypot(sine, cosine) == pytest.approx(amplitude, rel=1e-3) and mean == pytest.approx(80e3, rel=1e-3)


def test_a_bit_on_high_lobes_leaves_the_rock_and_is_not_pulled():
    scene = hanging(
        cf.drilling.Hook(stiffness=5e6),
        cf.drilling.TopDrive(140 * cf.units.rpm),
        cf.drilling.BitOnRock(cf.drilling.Lobes(3, 0.005), weight=40e3),
        drag=cf.drilling.ViscousDrag(0.2, 0.2),
    )
    rows = AxialTorsional(scene, 0.004).advance(5000)
    weight, up = column(rows, "weight_on_bit"), -column(rows, "bit_advance")
    assert weight.min() == 0.0 and weight.max() > 80e3 and up.max() > 0.006
    assert unbalanced(rows) < 1e-11


def test_what_is_recalled_goes_on_to_the_same_digits():
    for scene in (drilling(weight=100e3), drilling(law=cf.drilling.Lobes(3, 0.002), weight=80e3)):
        model, again = AxialTorsional(scene, 0.004, 60), AxialTorsional(scene, 0.004, 60)
        model.advance(700)
        again.recall(model.memory())
        np.testing.assert_array_equal(model.advance(300), again.advance(300))


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (lambda: AxialTorsional(drilling(), axial=False), "torsion alone"),
        (lambda: AxialTorsional(drilling("steady", 80e3, cf.drilling.Stribeck(4e3, 3e3, 1.0))), "does not give way"),
        (lambda: drilling("turning"), "Drilling.start.*'rest' or 'steady'"),
        (
            lambda: AxialTorsional(
                cf.drilling.Drilling(
                    drilling().string, cf.drilling.TopDrive(control=cf.drilling.Motor(5e3)), start="steady"
                )
            ),
            "Drilling.start.*PI",
        ),
        (lambda: cf.drilling.Discs((1.0, 1.0), (1.0,), axial_stiffnesses=(1.0,)), "axial_stiffnesses.*without masses"),
        (
            lambda: cf.drilling.Drilling(
                cf.drilling.Discs((1.0, 1.0), (1.0,)), cf.drilling.TopDrive(1.0), hook=cf.drilling.Hook()
            ),
            "turn alone",
        ),
    ],
)
def test_refusals(scene, message):
    with pytest.raises(cf.SceneError, match=message):
        scene()
