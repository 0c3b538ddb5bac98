"""The soft string: reference wells, closed forms, its error estimate against an independent integration, speed."""

import math
import time

import numpy as np
import pytest
from reference_wells import WELLS, well
from scipy.integrate import solve_ivp

import cosserat_fenicsx as cf

pytestmark = [pytest.mark.serial, pytest.mark.once]
PIPE = cf.well.Component(weight=241.13, contact_radius=0.0635)


def solved(path, operation, mu=0.25, string=PIPE, **settings):
    hole = cf.well.Borehole(path, [cf.well.HoleSection(path.length, 0.2159, mu)])
    return cf.well.torque_and_drag(
        hole, cf.well.DrillString([string]), operation, **{"model": "soft", "tol": 1e-10, **settings}
    )


@pytest.mark.parametrize(
    ("name", "load", "weight"),
    [("F-12", "bit_free", 0.0), ("F-12", "WOB_80kN", 80e3), ("ISCWSA 2", "bit_free", 0.0)],
)
def test_real_wells(name, load, weight):
    truth, path = WELLS[name][load], well(name)
    assert solved(path, cf.well.TripOut()).hook_load == pytest.approx(truth["out"], rel=1e-12)
    assert solved(path, cf.well.TripIn(weight)).hook_load == pytest.approx(truth["in"], rel=1e-12)
    for convention, torque in (("johancsik", "torque_johancsik"), ("coulomb", "torque_coulomb_exact")):
        answer = solved(path, cf.well.RotaryDrilling(weight, 0.0), torque_convention=convention)
        assert answer.hook_load == pytest.approx(truth["rot"], rel=1e-12)
        assert answer.surface_torque == pytest.approx(truth[torque], rel=1e-12)


def test_well_p():
    truth, path = WELLS["P"]["case1"], well("P")
    for operation, key in ((cf.well.TripOut(), "out"), (cf.well.TripIn(), "in"), (cf.well.RotateOffBottom(), "rot")):
        answer = solved(path, operation, tol=1e-12, torque_convention="johancsik")
        assert answer.hook_load == pytest.approx(truth[key]["hook_load_N"], rel=1e-12)
        assert answer.solved.side_force.sum() == pytest.approx(truth[key]["integral_of_side_force_N"], rel=1e-12)
        assert sum(force for *_, force, _ in answer.contacts) == pytest.approx(
            truth[key]["integral_of_side_force_N"], rel=2e-3
        )
        for md, tension, torque in truth[key]["at_stations"]:
            at = np.argmin(np.abs(answer.md - md))
            assert answer.md[at] == pytest.approx(md, abs=1e-9)
            assert answer.tension[at] == pytest.approx(tension, abs=1e-6)
            assert answer.torque[at] == pytest.approx(torque, abs=1e-6)
    assert answer.surface_torque == pytest.approx(truth["rot"]["surface_torque_Nm_johancsik"], rel=1e-12)
    exact = solved(path, cf.well.RotateOffBottom()).surface_torque
    assert exact == pytest.approx(truth["rot"]["surface_torque_Nm_coulomb_exact"], rel=1e-12)


def test_well_p_with_collars_casing_and_open_hole():
    truth, path = WELLS["P"]["case2_BHA_casing_openhole"], well("P")
    hole = cf.well.Borehole(path, [cf.well.HoleSection(2000, 0.22, 0.20), cf.well.HoleSection(4700, 0.2159, 0.32)])
    collar = cf.well.Component(200.0, None, 1050.0, 0.0825)
    up, down = cf.well.DrillString([collar, PIPE]), cf.well.DrillString([PIPE, collar], order="top down")
    cases = {
        "trip_out": cf.well.TripOut(), "trip_in": cf.well.TripIn(), "rotate_off_bottom": cf.well.RotateOffBottom(),
        "drill_rotating_WOB60kN_TOB5kNm": cf.well.RotaryDrilling(60e3, 5e3), "slide_WOB60kN": cf.well.Sliding(60e3),
    }  # fmt: skip
    for name, operation in cases.items():
        for string in (up, down):
            settings = {"model": "soft", "tol": 1e-11, "torque_convention": "johancsik"}
            answer = cf.well.torque_and_drag(hole, string, operation, **settings)
            assert answer.hook_load == pytest.approx(truth[name]["hook_load_N"], rel=1e-12)
            assert answer.surface_torque == pytest.approx(truth[name]["surface_torque_Nm"], rel=1e-12)
            assert answer.solved.side_force.sum() == pytest.approx(truth[name]["side"], rel=1e-12)
    answer = solved(path, cf.well.BackReam(0.3, 60), torque_convention="johancsik")
    assert answer.hook_load == pytest.approx(truth["back_ream_V0.3_60rpm"]["hook_load_N"], rel=1e-12)
    assert answer.surface_torque == pytest.approx(truth["back_ream_V0.3_60rpm"]["surface_torque_Nm"], rel=1e-12)
    both = [solved(path, operation(0.3, 60)) for operation in (cf.well.Ream, cf.well.BackReam)]
    assert both[0].hook_load < both[0].hook_load - both[0].drag < both[1].hook_load


@pytest.mark.parametrize("angles", [(0.0, 60.0), (20.0, 100.0), (70.0, 10.0)])
def test_closed_forms_of_planar_arcs(angles):
    """Out: Aadnoy's form where the string lies on the high side (build); on the low side of a drop it is the same with
    the other sign of friction."""
    i1, i2 = np.radians(angles)
    radius, w, mu, pull = 400.0, 241.13, 0.3, 900e3
    sign = 1 if i2 > i1 else -1
    path = cf.well.WellPath.from_survey([0, radius * abs(i2 - i1)], angles, [350, 350])
    answer = solved(path, cf.well.TripOut(weight=-pull), mu=mu, tol=1e-12)
    m, R = sign * mu, sign * radius  # a drop is a build with the signs of curvature and of the wall's side reversed
    A, B = -w * R * (1 - m**2) / (1 + m**2), -2 * m * w * R / (1 + m**2)
    C = (pull - A * math.sin(i2) - B * math.cos(i2)) * math.exp(m * i2)
    exact = A * math.sin(i1) + B * math.cos(i1) + C * math.exp(-m * i1)
    assert answer.hook_load == pytest.approx(exact, rel=1e-12)
    assert math.cos(answer.contact_side[10]) == pytest.approx(sign)  # the high side, or the low one


def by_vectors(path, w, mu, operation, radius):
    """Hook load and torque by SciPy, from vectors in space, section by section and split where |q| is least."""
    c, e = operation.direction(radius)
    climb, state = math.sqrt(1 + (e * mu) ** 2), [-operation.weight, operation.torque]

    def side(s, T):
        t = path.tangent(s)
        return np.linalg.norm(T * path.curvature(s) + w * (np.array([0, 0, 1.0]) - t * t[2]))

    def rates(s, y):
        N = side(s, y[0]) / climb
        return [-w * path.tangent(s)[2] - c * mu * N, -e * mu * radius * N]

    for top, bottom in zip(path.md[-2::-1], path.md[:0:-1], strict=True):
        inside = bottom - 1e-12 * (bottom - top), top + 1e-12 * (bottom - top)
        found = solve_ivp(rates, inside, state, method="DOP853", rtol=1e-12, atol=1e-9, max_step=(bottom - top) / 20)
        state = found.y[:, -1]
    return state


def random_well(rng, stations=6):
    inc, azi = np.cumsum(rng.uniform(-8, 14, stations)), np.cumsum(rng.uniform(-30, 30, stations))
    return cf.well.WellPath.from_survey(np.arange(stations) * 200.0, np.abs(inc), azi)


@pytest.mark.parametrize("seed", range(4))
def test_random_wells_against_vectors_in_space(seed):
    rng = np.random.default_rng(seed)
    path, mu, w = random_well(rng), rng.uniform(0, 0.5), rng.uniform(50, 900)
    for operation in (cf.well.TripOut(), cf.well.Sliding(rng.uniform(0, 2e5)), cf.well.Ream(0.1, 30, 1e4, 2e3)):
        exact = by_vectors(path, w, mu, operation, 0.07)
        string = cf.well.Component(weight=w, contact_radius=0.07)
        for tol in (1e-2, 1e-6, 1e-9):
            answer = solved(path, operation, mu, string, tol=tol)
            wrong = abs(answer.hook_load - exact[0]) / np.abs(answer.tension).max()
            assert wrong <= answer.error + 1e-10 and answer.error <= tol  # 1e-10: of the integration with SciPy
            if exact[1]:
                wrong = abs(answer.surface_torque - exact[1]) / exact[1]
                assert wrong <= answer.error + 1e-10


def test_the_estimate_at_kinks_covers_the_error():
    """Wells in a vertical plane, whose wall force has kinks; truth: the same at 1e-12."""
    rng = np.random.default_rng(11)
    for _ in range(20):
        md = np.cumsum(np.r_[0, rng.uniform(100, 900, 7)])
        path = cf.well.WellPath.from_survey(
            md, np.r_[0, np.cumsum(rng.uniform(-25, 40, 7))].clip(0, 120), np.full(8, 77.0)
        )
        for operation in (cf.well.TripOut(-2e5), cf.well.TripIn(1e5), cf.well.RotateOffBottom()):
            truth = solved(path, operation, 0.35, tol=1e-12)
            for tol in (1e-2, 1e-4, 1e-7):
                answer = solved(path, operation, 0.35, tol=tol)
                scale = np.abs(answer.tension).max()
                assert abs(answer.hook_load - truth.hook_load) <= (answer.error + truth.error) * scale
                twisted = np.abs(answer.torque).max()
                assert abs(answer.surface_torque - truth.surface_torque) <= (answer.error + truth.error) * twisted


def test_without_friction_the_hook_load_is_weight_times_depth():
    path = well("F-12")
    for operation in (cf.well.Static(weight=5e4), cf.well.TripIn(weight=5e4)):
        answer = solved(path, operation, mu=0.0 if operation.slip[0] else 0.3)
        assert answer.hook_load == pytest.approx(241.13 * path.position(path.length)[2] - 5e4, rel=1e-13)
        assert answer.drag == pytest.approx(0, abs=1e-6) and answer.surface_torque == 0


def test_a_well_of_200_stations_takes_5_ms():
    rng = np.random.default_rng(2)
    inc, azi = np.cumsum(rng.uniform(-1, 1.6, 200)), np.cumsum(rng.uniform(-4, 4, 200))
    path = cf.well.WellPath.from_survey(np.arange(200) * 25.0, np.abs(inc), azi)
    hole = cf.well.Borehole(path, [cf.well.HoleSection(2000, 0.22, 0.2), cf.well.HoleSection(path.length, 0.2159, 0.3)])
    string = cf.well.DrillString([cf.well.Collar(180, "NC46-65"), cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
    best = np.inf
    for _ in range(30):
        before = time.process_time()
        answer = cf.well.torque_and_drag(
            hole, string, cf.well.TripOut(), mud=cf.well.Mud(1200.0), model="soft", tol=1e-8
        )
        best = min(best, time.process_time() - before)
    assert answer.error <= 1e-8 and best < 5e-3
