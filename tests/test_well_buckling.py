"""Buckling of strings in holes: critical loads, the friction of helices, lock-up."""

import math

import numpy as np
import pytest
from reference_wells import WELLS
from scipy.optimize import minimize_scalar

import cosserat_fenicsx as cf
from cosserat_fenicsx.well import criteria

pytestmark = [pytest.mark.serial, pytest.mark.once]
LOCK_UP, CRITICAL = WELLS["lock-up"], WELLS["critical"]


def string(case):
    stiff = cf.Stiffness((1e9, 1e9), 7e8, (case["EI"],) * 2, 9.4e5)
    return cf.well.DrillString([cf.well.Component(None, stiff, case["w"], 0.05)])


def straight(case, length, inclination=90.0):
    path = cf.well.WellPath.from_survey([0, length], [inclination] * 2, [0, 0])
    return cf.well.Borehole(path, [cf.well.HoleSection(length, 2 * (0.05 + case["r"]), case["mu"])])


def pushed(case, length, weight, inclination=90.0, operation=cf.well.Sliding, **settings):
    hole = straight(case, length, inclination)
    return cf.well.torque_and_drag(hole, string(case), operation(weight), **{"tol": 1e-6, **settings})


def test_critical_loads():
    EI, r, w = 1228200.0, 0.04445, 241.13
    for name, inc in (("horizontal_L_100", 90), ("inc45_L_80", 45)):
        inc, truth = math.radians(inc), CRITICAL[name]
        assert criteria.dawson_paslay(EI, r, w, inc) == pytest.approx(truth["F_sin"], rel=1e-12)
        assert criteria.chen(EI, r, w, inc) == pytest.approx(truth["F_hel_Maxwell_2sqrt2"], rel=1e-12)
        assert criteria.wu(EI, r, w, inc) == pytest.approx(truth["F_hel_Wu"], rel=1e-12)
        found = criteria.he_kyllingstad(EI, r, 0.0, w * math.sin(inc), 0.0)
        assert found == pytest.approx(truth["F_sin"], rel=1e-9)
    for case in LOCK_UP["curved_hole_sinusoidal"]:  # of a build section: its normal points up
        across = -case["w"] * math.sin(math.radians(case["inclination"]))
        found = criteria.he_kyllingstad(case["EI"], case["r"], 0.0, across, 1 / case["radius"])
        assert found == pytest.approx(case["F"], rel=1e-9)
    assert criteria.lubinski(EI, w) == pytest.approx(1.94 * (EI * w**2) ** (1 / 3))


def test_the_loads_of_a_helix_in_a_vertical_hole():
    """The printed 5.55 and 0.14, lengths in (EI/w)^(1/3): 4.05 with the energy of the straight string is the mean over
    the transition from half a sine wave, and the turn's weight is less at its top."""
    turn, sine = (minimize_scalar(lambda x, c=c: c / x**2 + x / 2, (1.0, 5.0)) for c in (4 * math.pi**2, math.pi**2))
    below = 2 * turn.fun - sine.fun
    EI, w = 1228200.0, 241.13
    unit = (EI * w**2) ** (1 / 3)
    assert criteria.helix_load(EI, 0.04, w, 0.0) == pytest.approx(below * unit, rel=1e-3)
    assert criteria.earliest_helix_load(EI, 0.04, w, 0.0) == pytest.approx((below - turn.x) * unit, abs=0.01 * unit)


def test_critical_loads_along_a_string():
    case = {"EI": 1228200.0, "w": 241.13, "r": 0.04445, "mu": 0.2}
    path = cf.well.WellPath.from_survey([0, 300, 300 + 300 * math.pi / 4, 1000], [0, 0, 45, 45], [0, 0, 70, 70])
    hole = cf.well.Borehole(path, [cf.well.HoleSection(1000, 0.18890, 0.2)])
    answer = cf.well.torque_and_drag(hole, string(case), cf.well.TripIn(), model="soft")
    inclined, bent = answer.md > 600, (answer.md > 301) & (answer.md < 300 + 300 * math.pi / 4 - 1e-6)
    assert answer.critical_load("Dawson-Paslay")[inclined] == pytest.approx(137276.68, rel=1e-7)
    assert answer.critical_load("He-Kyllingstad")[inclined] == pytest.approx(137276.68, rel=1e-7)
    assert (answer.critical_load("He-Kyllingstad")[bent] > 2 * answer.critical_load("Dawson-Paslay")[bent]).all()
    assert answer.critical_load("Lubinski") == pytest.approx(criteria.lubinski(case["EI"], case["w"]))
    assert np.isnan(
        cf.well.torque_and_drag(
            hole, cf.well.DrillString([cf.well.Component(None, None, 241.13, 0.06)]), cf.well.TripIn()
        ).critical_load("Wu")
    ).all()


@pytest.mark.parametrize("name", ["wicks_steel", "wicks_composite", "drill_pipe_F_bit_50kN"])
def test_lock_up(name):
    """A little shorter than the lock-up length it can be pushed, a little longer it cannot: the place is told."""
    case = LOCK_UP[name]
    length = case["lockup_with_weight"]
    answer = pushed(case, 0.95 * length, case["F_bit"])
    helix, EI, mu = answer.md[answer.helical].max(), case["EI"], case["mu"]
    assert 0.95 * length - helix == pytest.approx(case["length_unbuckled"], rel=1e-9)
    rate = math.sqrt(case["r"] / (4 * EI * case["w"]))
    exact = math.tan(math.atan(rate * case["F_helical"]) + mu * case["w"] * rate * helix) / rate
    assert -answer.hook_load == pytest.approx(exact, rel=1e-7) and answer.model == "buckled"
    assert abs(-answer.hook_load - exact) <= answer.error * exact
    assert [answer.buckling[0], answer.buckling[-1]] == [criteria.HELIX, criteria.STRAIGHT]
    with pytest.raises(cf.SceneError, match="locks up at md = ") as refused:
        pushed(case, 1.1 * length, case["F_bit"])
    place = float(str(refused.value).partition("md = ")[2].partition(" m")[0])
    assert 1.1 * length - place == pytest.approx(length, rel=2e-4)


@pytest.mark.parametrize("tol", [1e-2, 1e-9])
def test_errors_from_below_are_multiplied_by_helices(tol):
    """Just short of lock-up, with a bend at the bottom that the soft string solves to no more than its tolerance."""
    path = cf.well.WellPath.from_survey(
        [0, 800, 1500, 2500, 3200, 4200, 5200], [5, 60, 30, 90, 80, 95, 90], [0, 0, 0, 0, 3, 2, 0]
    )
    pipe = cf.well.Component(None, cf.Stiffness((1e9, 1e9), 2.6e9, (2063790.0,) * 2, 1.59e6), 315.0, 0.064)
    hole = cf.well.Borehole(path, [cf.well.HoleSection(5200, 0.21, 0.341)])
    one, best = (
        cf.well.torque_and_drag(hole, cf.well.DrillString([pipe]), cf.well.Sliding(5e4), model="buckled", tol=asked)
        for asked in (tol, 1e-10)
    )
    assert one.error <= tol and abs(one.hook_load - best.hook_load) <= one.solved.error + best.solved.error


def test_helices_in_straight_holes():
    for case in LOCK_UP["helix_horizontal_F_at"]:
        answer = pushed(case, case["z"], case["F_bit"], tol=1e-8)
        assert -answer.hook_load == pytest.approx(case["F"], rel=1e-8)
    (case,) = (case for case in LOCK_UP["helix_vertical"] if case["F_top"] == 800e3)
    answer = pushed(case, case["z"], case["F"], inclination=0.0)
    assert -answer.hook_load == pytest.approx(case["F_top"], rel=1e-7)
    assert answer.side_force == pytest.approx(case["r"] * answer.tension**2 / (4 * case["EI"]), rel=1e-9)


def test_a_rotating_helix_has_no_axial_friction_but_torque():
    case = {"EI": 1228200.0, "w": 241.13, "r": 0.04445, "mu": 0.25}
    answer = pushed(case, 500.0, 400e3, operation=lambda weight: cf.well.RotaryDrilling(weight, 0.0))
    assert answer.hook_load == pytest.approx(-400e3, rel=1e-12)
    N = (241.13 + 0.04445 * 400e3**2 / (4 * 1228200.0)) / math.sqrt(1 + 0.25**2)
    assert answer.surface_torque == pytest.approx(0.25 * 0.05 * N * 500, rel=1e-9)
    soft = pushed(case, 500.0, 400e3, model="soft", operation=lambda weight: cf.well.RotaryDrilling(weight, 0.0))
    assert soft.surface_torque < answer.surface_torque / 3


def test_auto_takes_the_first_rung_without_helices():
    case = {"EI": 1228200.0, "w": 241.13, "r": 0.04445, "mu": 0.25}
    assert pushed(case, 500.0, 10e3, tol=5e-2).model == "soft"
    helix = pushed(case, 500.0, 400e3)
    assert helix.model == "buckled" and not helix.enough
    assert any("the exact rod in contact is not tried" in line for line in helix.why)
    before, after = (pushed(case, 500.0, 400e3, model=name).hook_load for name in ("soft", "buckled"))
    assert helix.differences["soft"][0] == after - before


def test_buckled_stretches_are_told_apart():
    """A string that is a helix above and below a bend, whose wall force holds it straight."""
    path = cf.well.WellPath.from_survey([0, 1500, 1800, 3300], [90, 90, 30, 30], [0, 0, 0, 0])
    hole = cf.well.Borehole(path, [cf.well.HoleSection(3300, 0.21, 0.0)])
    pipe = cf.well.Component(None, cf.Stiffness((1e9, 1e9), 2.6e9, (2063790.0, 2063790.0), 1.59e6), 1.0, 0.064)
    answer = cf.well.torque_and_drag(hole, cf.well.DrillString([pipe]), cf.well.Sliding(60e3), model="auto")
    states = answer.buckling[(answer.md > 1600) & (answer.md < 1700)]
    assert (states == 0).all() and answer.buckling[0] == answer.buckling[-1] == 2
    assert "helical buckling at md = 0 to 1500, 1800 to 3300 m" in str(answer)
