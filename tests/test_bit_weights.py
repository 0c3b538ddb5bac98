"""Torques on bit that follow its weight: tables of two axes, laws of a user's own, weights over time; Karnopp's law."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling import (
    BitLaw,
    BitOnRock,
    Discs,
    Drilling,
    Hook,
    Karnopp,
    Stribeck,
    TableLaw,
    TopDrive,
    simulate,
)
from cosserat_fenicsx.drilling.bit_curves import Surface
from cosserat_fenicsx.drilling.laws import surface_of

pytestmark = [pytest.mark.serial, pytest.mark.once]
PIPE = cf.well.DrillString([cf.well.Collar("1 km", outer_diameter="5 in", inner_diameter=0.1086)])


@dataclass(frozen=True)
class Smooth(BitLaw):
    """Friction that rises with the weight, less than in proportion."""

    needs_weight = True
    scale: float = 0.1

    def torque(self, speed, weight):
        return self.scale * weight / (1 + weight / 400e3) * (0.7 + 0.3 * math.exp(-speed / 4.0))


@dataclass(frozen=True)
class Kinked(Smooth):
    def torque(self, speed, weight):
        return super().torque(speed, max(weight, 40e3))


def scene(law, weight=80e3, **more):
    return Drilling(PIPE, TopDrive("80 rpm"), BitOnRock(law, weight, inertia=200.0), **more)


def table():
    speeds, weights = np.linspace(0.0, 6.0, 25) ** 2, np.linspace(0.0, 320e3, 33)
    rows = [[Smooth().torque(s, w) for s in speeds] for w in weights]
    return TableLaw(speeds.tolist(), rows, weights.tolist())


def test_a_law_of_two_axes_is_tabulated():
    """To 1e-8 of its range between its points; what has a kink is called."""
    law, rng = Smooth(), np.random.default_rng(5)
    found = surface_of(law, "torque", 320e3)
    assert isinstance(found, Surface)
    points = np.column_stack([10 ** rng.uniform(-5, 2, 300), rng.uniform(0, 320e3, 300)])
    errors = [found(s, w) - law.torque(s, w) for s, w in points]
    assert np.abs(errors).max() <= 1e-8 * law.torque(0.0, 320e3)
    assert surface_of(Kinked(), "torque", 320e3) is None


@pytest.mark.parametrize("lowered", [False, True])
def test_c_meets_the_law(lowered):
    """With the weight of the moment where the block is lowered; a table of two axes meets it between its points, and is
    monotone."""
    hook = Hook(stiffness=5e6, speed=cf.signals.Ramp((-0.01,), start=0.5, end=1.0)) if lowered else None
    model = {"model": "axial and torsional", "elements": 40}

    def found(law):
        return simulate(scene(law, hook=hook), 4.0, progress=False, **model)

    own, called = found(Smooth()), found(_Called())
    np.testing.assert_allclose(own.torque_on_bit, called.torque_on_bit, atol=1e-5 * called.torque_on_bit.max())
    if lowered:
        assert np.ptp(own.weight_on_bit) > 20e3
    np.testing.assert_allclose(found(table()).bit_angle, own.bit_angle, atol=0.02)


@dataclass(frozen=True)
class _Called(Smooth):
    def in_c(self, weight):
        return super().in_c(weight)[0], None


def test_tables_are_monotone():
    law = TableLaw((0.0, 1.0, 5.0), ((0.0, 0.0, 0.0), (3e3, 2e3, 1900.0), (9e3, 8e3, 4e3)), (0.0, 50e3, 100e3))
    for s in (0.0, 1.0, 5.0):
        assert (np.diff([law.torque(s, w) for w in np.linspace(0, 100e3, 300)]) >= 0).all()
    for w in (50e3, 100e3):
        assert (np.diff([law.torque(s, w) for s in np.linspace(0, 6, 300)]) <= 0).all()
    assert law.torque(1.0, 50e3) == 2e3 and law.torque(9.0, 100e3) == 4e3


def test_a_weight_above_the_table_is_refused():
    law = replace(table(), torques=tuple(row for row in table().torques[:9]), weights=table().weights[:9])
    with pytest.raises(cf.SceneError, match="TableLaw.weights = .*expected weights up to .* N at least"):
        simulate(scene(law, hook=Hook(stiffness=5e6, speed=-0.01)), 4.0, model="axial and torsional", progress=False)


def test_karnopp_drops_at_once():
    """As its limit of a narrow band, to the digit."""
    string = Discs((1.0, 374.0), (473.0,), drags=(0.0, 50.0))
    found, expected = (
        simulate(Drilling(string, TopDrive(6.0), BitOnRock(law)), 8.0, dt=2e-3, progress=False).rows
        for law in (Karnopp("9 kN m", "6 kN m", "0.05 rpm"), Stribeck(9e3, 6e3))
    )
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(("string", "law"), [
    (PIPE, Smooth()), (Discs((1.0, 374.0), (473.0,), drags=(0.0, 50.0)), Stribeck(0.6, 0.4, 4.0, radius=0.1)),
], ids=["waves, own", "discs, coefficients"])  # fmt: skip
def test_weight_over_time(string, law, tmp_path):
    """Where it no longer changes, the steady torque is that of the last weight; stored and resumed to the byte."""
    weight = cf.signals.Table((1.0, 3.0), ("0 kN", "120 kN"))
    drags = {} if string is not PIPE else {"drag": cf.drilling.ViscousDrag(torsion=3.0)}
    given = Drilling(string, TopDrive("180 rpm"), BitOnRock(law, weight, inertia=200.0), **drags)
    run = {"dt": 4e-3, "progress": False}
    whole = simulate(given, 9.0, **run)
    assert whole.weight_on_bit[0] == pytest.approx(0, abs=150.0) and whole.weight_on_bit[-1] == pytest.approx(
        120e3, rel=1e-12
    )
    end = whole.times > 8.0
    torque = [law.torque(s, 120e3) for s in whole.bit_speed[end]]
    np.testing.assert_allclose(whole.torque_on_bit[end], torque, rtol=2e-3)
    middle = np.searchsorted(whole.times, 2.0)
    assert whole.torque_on_bit[middle] <= law.torque(0.0, 61e3)
    simulate(given, 2.345, folder=tmp_path / "run", **run)
    np.testing.assert_array_equal(cf.resume(tmp_path / "run", duration=9.0).rows, whole.rows)
    assert "on bit 0 N to 120 kN" in given.summary()


@pytest.mark.parametrize(("make", "words"), [
    (lambda: TableLaw((0.0, 2.0), ((1.0, 1.0),), (0.0, 1e4)),
     "TableLaw.torques = .*in a row for each of the 2 weights"),
    (lambda: TableLaw((0.0, 2.0), ((0.0, 0.0), (1.0, 1.0)), (1e4, 2e4)), "TableLaw.weights = .*begin at 0 and ascend"),
    (lambda: TableLaw((0.0, 2.0), ((0.0, 0.0), (1.0, math.nan)), (0.0, 2e4)), "TableLaw.torques"),
    (lambda: Karnopp(5e3, 4e3, 0.1), "Karnopp.band = 0.1: expected at most 0.01 rad/s"),
    (lambda: BitOnRock(Smooth(), 0.0), "BitOnRock.weight = 0.0: expected a weight on bit above 0"),
    (lambda: Karnopp(3e3, 4e3), "Karnopp.static = 3000.0: expected at least the dynamic one"),
    (lambda: BitOnRock(Stribeck(5e3, 4e3), cf.signals.Ramp((1e5,), end=1.0)),
     "BitOnRock.weight = .*acts where the torque alone"),
    (lambda: simulate(scene(Smooth(), lambda t: 1e5 - 1e5 * t), 3.0), "BitOnRock.weight = -.*not negative"),
    (lambda: BitOnRock(Smooth(), cf.signals.Ramp((-1e5,), start=5.0, end=20.0)),
     "BitOnRock.weight = -100000.0: expected a weight on bit that is not negative .*t = 20 s"),
    (lambda: BitOnRock(Smooth(), cf.signals.Ramp((0.0,), end=10.0)), "BitOnRock.weight = .* above 0 .* at some time"),
    (lambda: BitOnRock(Smooth(), lambda t: "50 kN"), "BitOnRock.weight = '50 kN': expected a finite number"),
    (lambda: simulate(scene(Smooth(), lambda t: 1e5, hook=Hook(speed=-0.01)), 1.0), "BitOnRock.weight = .*Autodriller"),
    (lambda: cf.drilling.stability(scene(Smooth(), lambda t: 1e5), [8.0]),
     r"BitOnRock.weight = .*with_case\(weight=...\)"),
])  # fmt: skip
def test_refused_by_name(make, words):
    with pytest.raises(cf.SceneError, match=words):
        make()


def test_in_a_scene_file(tmp_path):
    text = (Path(__file__).parent.parent / "demos" / "strings" / "autodriller.toml").read_text(encoding="utf-8")
    law = next(x for x in text.splitlines() if x.startswith("law"))
    for given, expected in (
        ('law = { type = "Karnopp", static = "6 kN m", dynamic = "4 kN m" }', BitOnRock(Karnopp(6e3, 4e3))),
        ('law = { type = "TableLaw", speeds = [0, 2], torques = [[0, 0], [6e3, 4e3]], weights = ["0 kN", "100 kN"] }\n'
         'weight = { type = "Ramp", value = "80 kN", end = "5 s" }',
         BitOnRock(TableLaw((0, 2), ((0, 0), (6e3, 4e3)), (0, 1e5)), cf.signals.Ramp((80e3,), end=5.0))),
    ):  # fmt: skip
        (tmp_path / "scene.toml").write_text(text.replace(law, given), encoding="utf-8")
        assert cf.read(tmp_path / "scene.toml").scene.bit == expected


def test_a_weight_over_time_is_said_to_change():
    changing = cf.signals.Ramp((50e3,), end=5.0)
    for weight, words in (
        (50e3, "the weight on bit stays as it is"),
        (changing, "weight on bit is the one given over"),
    ):
        bit = BitOnRock(Stribeck(0.4, 0.3, 2.0, radius=0.1), weight=weight, inertia=50.0)
        assert words in simulate(Drilling(PIPE, TopDrive(6.0), bit), 0.1, progress=False).why[0]


def test_the_largest_weight_of_an_oscillation_is_found():
    def weight(t):
        return 2e4 + 1.9e4 * math.sin(2 * math.pi * t)

    assert BitOnRock(Stribeck(0.6, 0.4, 3.0, radius=0.1), weight=weight).most == pytest.approx(39e3, rel=1e-4)


def test_a_fluid_that_ends_beside_a_component_cuts_no_sliver():
    string = cf.well.DrillString([cf.well.Collar(x, "NC46-65") for x in (5.1, 7.7, None)])
    laid = string.laid(1000.0)  # the top of the second one is 987.2 less rounding
    assert len(cf.well.components.in_columns(laid, cf.well.Mud([(987.2, 1200), (1000, 1210)]))) == 3
