"""What a soft string tells that it leaves out, against the exact rod: bits and stabilisers, clamps, sharp bends."""

import numpy as np
import pytest

import cosserat_fenicsx as cf

STIFF = cf.Stiffness((1.35359e8, 1.35359e8), 7.03868e8, (1228200.0, 1228200.0), 9.4e5)
PIPE = cf.well.Component(None, STIFF, 241.13, 0.0635, name="pipe")
MUD = cf.well.Mud(1200.0)


@pytest.mark.parametrize(
    "operation", [cf.well.RotaryDrilling(80e3, 5e3), cf.well.Sliding(50e3), cf.well.TripOut()], ids=str
)
def test_a_soft_string_knows_that_bit_and_stabilisers_pry(operation):
    """A stabiliser near the bit: the span above it presses it down, and the bit up."""
    near_bit, upper = cf.well.Stabiliser(1.5, 0.2127, 0.165, 0.07), cf.well.Stabiliser(1.5, 0.2096, 0.165, 0.07)
    path = cf.well.WellPath.from_survey([0, 100, 300, 500], [0, 0, 40, 40], [20, 20, 20, 20])
    collars = cf.well.Collar(18, "NC46-65"), cf.well.Collar(60, "NC46-65")
    string = cf.well.DrillString([cf.well.Bit(0.2159), near_bit, collars[0], upper, collars[1], PIPE])
    where = cf.well.Borehole(path, cf.well.HoleSection(500.0, 0.2159, 0.25))
    soft, rod = (cf.well.torque_and_drag(where, string, operation, mud=MUD, model=model) for model in ("soft", "rod"))
    sides = {side for start, end, force, side in rod.contacts if start == end > 495 and force > 9e3}
    assert sides == {"low", "high"}
    for name, scale in (
        ("hook_load", np.abs(soft.tension).max()),
        ("surface_torque", np.abs(soft.torque).max() or 1.0),
    ):
        if scale > 1.0:
            assert abs(getattr(rod, name) - getattr(soft, name)) < soft.model_error * scale


@pytest.mark.parametrize(
    "inc, operation", [((60, 60, 60, 60), cf.well.TripIn()), ((0, 0, 90, 90), cf.well.TripOut())], ids=str
)
def test_a_soft_string_knows_what_clamps_and_sharp_bends_add(inc, operation):
    """A rod hangs on the axis of a hole that is inclined from the surface on; collars in a bend of 40 m radius."""
    path = cf.well.WellPath.from_survey([0, 100, 163, 300], inc, [0, 0, 0, 0])
    string = cf.well.DrillString([cf.well.Collar(60, "NC46-65"), PIPE])
    where = cf.well.Borehole(path, cf.well.HoleSection(300.0, 0.2159, 0.25))
    given = {"mud": MUD, "depth": 180.0, "tol": 1e-3}
    soft, rod = (cf.well.torque_and_drag(where, string, operation, model=model, **given) for model in ("soft", "rod"))
    told, differs = soft.model_error * np.abs(soft.tension).max(), abs(rod.hook_load - soft.hook_load)
    assert 0.1 * told < differs < told
