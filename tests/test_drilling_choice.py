"""Which model a drill-string in motion takes, and why."""

import re
import warnings

import numpy as np
import pytest
from fake_string import scene

import cosserat_fenicsx as cf
from cosserat_fenicsx.drilling.choose import BOTH, TORSION, chosen

pytestmark = [pytest.mark.serial, pytest.mark.once]
STRAIGHT = cf.well.WellPath.from_survey([0, 2000], [0, 0], [0, 0])
BENT = cf.well.WellPath.from_survey([0, 500, 1100, 3500], [0, 0, 60, 60], [0, 0, 0, 0])
MUD = cf.well.Mud(1200.0)


def hole(path, friction=0.2):
    return cf.well.Borehole(path, [cf.well.HoleSection(path.length, 0.2159, friction)])


def bit():
    return cf.drilling.BitOnRock(cf.drilling.Stribeck(0.8, 0.5, 3.0, radius=0.1), weight=80e3)


@pytest.mark.parametrize(
    ("changed", "model", "words"),
    [
        ({}, TORSION, "nothing moves along the axis$"),
        ({"bit": bit()}, TORSION, "nothing moves along the axis, and the weight on bit stays as it is"),
        (
            {"bit": bit(), "hole": hole(BENT), "mud": MUD, "depth": 2000.0},
            TORSION,
            "and the weight on bit stays as it is",
        ),
        (
            {"bit": cf.drilling.BitOnRock(cf.drilling.Cutting(0.1, 60e6, 0.6, 4))},
            BOTH,
            "the torque on bit follows the depth of cut",
        ),
        (
            {"bit": cf.drilling.BitOnRock(cf.drilling.Lobes(3, 2e-3), weight=80e3)},
            BOTH,
            "the lobes of the rock lift the bit",
        ),
        ({"bit": None, "hook": cf.drilling.Hook(speed=0.3)}, BOTH, "the hook moves"),
        ({"bit": None, "hook": cf.drilling.Hook(speed=cf.signals.Ramp((0.3,)))}, BOTH, "the hook moves"),
        ({"hook": cf.drilling.Hook(stiffness=5e6)}, TORSION, "nothing moves along the axis"),
        ({"string": cf.drilling.Discs((9.0, 4.0), (7.0,))}, TORSION, "turn alone"),
        (
            {"string": cf.drilling.Discs((9.0, 4.0), (7.0,), masses=(1.0, 1.0), axial_stiffnesses=(1.0,))},
            BOTH,
            "have masses",
        ),
    ],
)
def test_the_cheapest_model_that_is_asked_for(changed, model, words):
    found, why = chosen(scene(**changed))
    assert found == model
    assert re.search(words, why[0]), why


def test_what_is_asked_for_is_taken_and_told():
    assert chosen(scene(), BOTH) == (BOTH, ["axial and torsional: as asked"])
    moving = scene(bit=None, hook=cf.drilling.Hook(speed=0.3))
    assert chosen(moving, TORSION)[1][1].startswith("APPROXIMATE: torsion alone leaves out the axial motion")
    with pytest.raises(cf.SceneError, match="or 'auto', since with Cutting the torque on bit follows"):
        chosen(scene(bit=cf.drilling.BitOnRock(cf.drilling.Cutting(0.1, 60e6, 0.6, 4))), TORSION)
    with pytest.raises(cf.SceneError, match="expected 'torsion' or 'auto': discs without masses turn alone"):
        chosen(scene(string=cf.drilling.Discs((9.0, 4.0), (7.0,))), BOTH)


def test_buckling_in_the_hole_is_told():
    """Pipe in a vertical hole under weight on bit: sinusoidal below the depth where the compression is Lubinski's
    load."""
    pipe = cf.well.DrillString([cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
    law, weight = cf.drilling.Stribeck(3000.0, 2000.0, 3.0), 20e3
    loaded = scene(string=pipe, bit=cf.drilling.BitOnRock(law, weight=weight), hole=hole(STRAIGHT, 0.0), mud=MUD)
    why = chosen(loaded)[1]
    assert len(why) == 2 and why[1].startswith("APPROXIMATE: the compression between md = ")
    assert "buckling in the hole (rotary drilling, 20 kN)" in why[1] and why[1].endswith("that takes a rod model")
    segment = loaded.segments[0]
    EI = loaded.laid[0].component.stiffness.bending[0]
    critical = 1.94 * np.cbrt(EI * segment.weight**2)
    top = 2000 - (weight - critical) / segment.weight
    told = float(why[1].split("md = ")[1].split(" ")[0])
    assert told == pytest.approx(top, abs=60)  # at the points of the soft string
    assert len(chosen(scene(string=pipe, hole=hole(BENT), mud=MUD))[1]) == 1  # rotates off bottom, in tension
    flat = cf.well.WellPath.from_survey([0, 500, 1100, 3500], [0, 0, 88, 88], [0, 0, 0, 0])
    lowered = scene(string=pipe, bit=None, hole=hole(flat, 0.4), mud=MUD, hook=cf.drilling.Hook(speed=-0.3))
    assert "(trip in, " in chosen(lowered)[1][1]


@pytest.mark.parametrize(
    ("changed", "settings"),
    [
        ({"bit": cf.drilling.BitOnRock(cf.drilling.Stribeck(6e3, 4e3, 3.0), inertia=50.0)}, {}),
        ({"bit": None, "hook": cf.drilling.Hook(speed=0.2)}, {"elements": 40}),
        ({"string": cf.drilling.Discs((930.0, 2782.0), (700.0,))}, {}),
    ],
)
def test_every_model_moves_and_goes_on(changed, settings, tmp_path):
    """A longer motion of two parts has the digits of one; halving the step is reflected in the errors."""
    given = scene(**changed)
    whole = cf.drilling.simulate(given, 6.0, check=True, **settings)
    cf.drilling.simulate(given, 3.0, folder=tmp_path / "part", profile_every=6.0 / 400, **settings)
    again = cf.resume(tmp_path / "part", duration=6.0)
    assert np.array_equal(again.rows, whole.rows, equal_nan=True) and np.isfinite(whole.errors.peak)
    assert np.array_equal(again.angle, whole.angle) and again.sticking.shape == again.speed.shape
    assert whole.times[-1] == pytest.approx(6.0, abs=whole.dt) and "Estimated errors by the step" in str(whole)


def test_rotation_alone_moves_nothing_along_the_axis():
    """Which is why torsion is enough for a torque that follows the weight on bit: both models agree."""
    string = cf.well.DrillString([cf.well.Collar(200.0, "NC46-65"), cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
    given = scene(
        string=string, bit=bit(), hole=hole(BENT), mud=MUD, drive=cf.drilling.TopDrive(cf.signals.Ramp((6.0,), end=2.0))
    )
    found, both = (cf.drilling.simulate(given, 30.0, model=name) for name in ("auto", BOTH))
    assert found.model == TORSION and both.model == BOTH
    assert (both.weight_on_bit == 80e3).all() and not both.bit_advance.any()
    assert found.surface_torque[-1] == pytest.approx(both.surface_torque[-1], rel=1e-2)
    assert found.bit_angle[-1] == pytest.approx(both.bit_angle[-1], rel=1e-2)


def test_elements_and_steps():
    drilled = scene(bit=cf.drilling.BitOnRock(cf.drilling.Stribeck(6e3, 4e3, 3.0), inertia=50.0))
    assert len(cf.drilling.simulate(drilled, 1.0, elements=80).depths) == 81
    with pytest.raises(cf.SceneError, match="elements = 80: expected None beside dt: waves of torsion"):
        cf.drilling.simulate(drilled, 1.0, elements=80, dt=0.01)
    with pytest.raises(cf.SceneError, match="elements = 8: expected None for Discs"):
        cf.drilling.simulate(scene(string=cf.drilling.Discs((9.0, 2.0), (7.0,)), bit=None), 1.0, elements=8)


def test_more_weight_on_bit_than_the_string_has_along_the_hole_is_told():
    """Upright in air the segments' own weight; at 60 degrees half of it."""
    heavy = cf.drilling.BitOnRock(cf.drilling.Stribeck(6e3, 4e3, 3.0), weight=1e8)
    given = scene(bit=heavy)
    weighs = sum(part.weight * part.length for part in given.segments)
    told = f"the string weighs along the hole, {weighs / 1e3:.4g} kN: the hook would have to push"
    assert told in "\n".join(chosen(given)[1])
    slanted = cf.well.WellPath.from_survey([0, 2000], [60, 60], [0, 0])
    given = scene(bit=heavy, hole=hole(slanted, 0.0), mud=MUD)
    weighs = sum(part.weight * part.length for part in given.segments) / 2
    assert f"along the hole, {weighs / 1e3:.4g} kN" in "\n".join(chosen(given)[1])
    assert not any("push" in line for line in chosen(scene(bit=bit(), string=long()))[1])


def long():
    return cf.well.DrillString([cf.well.Collar(300.0, outer_diameter=0.2032, inner_diameter=0.0714),
                           cf.well.DrillPipe(1700.0, size="5 in 19.50 lb/ft")])  # fmt: skip


def test_a_small_torque_that_follows_from_the_weight_is_no_mistake_in_units():
    law = cf.drilling.Stribeck(0.06, 0.05, 3.0, radius=0.1)
    inclined = scene(bit=cf.drilling.BitOnRock(law, weight=6e3), hole=hole(BENT), mud=MUD, depth=2000.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert chosen(inclined)[0] == TORSION
    given = scene(
        bit=cf.drilling.BitOnRock(cf.drilling.Stribeck(5.0, 5.0), weight=6e3), hole=hole(BENT), mud=MUD, depth=2000.0
    )
    with pytest.warns(cf.SceneWarning, match="torque = 5 N m is hardly a torque on bit"):
        chosen(given)
