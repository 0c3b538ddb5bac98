"""The soft string: axes of wells, reference wells, error estimates, derivatives, buckling in holes."""

import math
import sys
import warnings

import numpy as np
import pytest
import reference_wells
from reference_wells import WELLS, well
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

import cosserat_fenicsx as cf
from cosserat_fenicsx.numerics import PLACES, derivative
from cosserat_fenicsx.quantities import Units
from cosserat_fenicsx.well import criteria

pytestmark = [pytest.mark.serial, pytest.mark.once]


def arc(angle, radius, azimuth=30.0):
    """A vertical line of 100 m, then a planar arc from vertical."""
    return cf.well.WellPath.from_survey([0, 100, 100 + radius * math.radians(angle)], [0, 0, angle], [0, 200, azimuth])


@pytest.mark.parametrize("angle", [1e-4, 3.0, 40.0, 90.0, 150.0, 179.0])
def test_a_planar_arc_is_a_circle(angle):
    radius, azimuth = 300.0, 30.0
    well = arc(angle, radius, azimuth)
    phi = np.linspace(0, math.radians(angle), 7)
    md = 100 + radius * phi
    out = 2 * radius * np.sin(phi / 2) ** 2
    north, east = math.cos(math.radians(azimuth)), math.sin(math.radians(azimuth))
    exact = np.stack([out * north, out * east, 100 + radius * np.sin(phi)], axis=-1)
    assert np.abs(well.position(md) - exact).max() < 1e-12 * 300
    tangents = np.stack([np.sin(phi) * north, np.sin(phi) * east, np.cos(phi)], axis=-1)
    assert np.abs(well.tangent(md) - tangents).max() < 2e-13  # md itself is rounded at 1e3 m
    assert np.linalg.norm(well.curvature(md[1:]), axis=1) == pytest.approx(1 / radius, rel=2e-12)
    assert well.dogleg[1] == pytest.approx(math.radians(angle), rel=1e-15)
    assert well.inclination_at(md) == pytest.approx(phi, abs=2e-13)


@pytest.mark.parametrize("name", ["P", "F-12", "ISCWSA 2"])
def test_the_ends_of_reference_wells(name):
    well = reference_wells.well(name)
    assert well.position(well.length) == pytest.approx(WELLS[name]["end_NED"], abs=1e-9)
    assert well.position(0.0) == pytest.approx(0)


@pytest.mark.parametrize("name", ["P", "F-12", "ISCWSA 2"])
def test_positions_are_those_of_wellpathpy(name):
    wellpathpy = pytest.importorskip("wellpathpy")
    well = reference_wells.well(name)
    other = wellpathpy.deviation(*np.transpose(WELLS[name]["stations_md_inc_azi"])).minimum_curvature(course_length=30)
    theirs = np.stack([other.northing, other.easting, other.depth], axis=-1)
    assert np.abs(well.position(well.md) - theirs).max() < 1e-9
    assert np.abs(well.dogleg_severity / cf.units.deg_per_30m - other.dls[1:]).max() < 1e-7


def test_tangent_and_curvature_are_derivatives():
    well, h = reference_wells.well("F-12"), 1e-3
    md = np.linspace(250.0, 3430.0, 400)
    inside = np.abs(md[:, None] - well.md).min(axis=1) > h
    md = md[inside]
    assert np.abs((well.position(md + h) - well.position(md - h)) / (2 * h) - well.tangent(md)).max() < 1e-9
    assert np.abs((well.tangent(md + h) - well.tangent(md - h)) / (2 * h) - well.curvature(md)).max() < 1e-11


def test_azimuth_does_not_enter_by_itself():
    """Through north, by turns, and at vertical stations; down and up again beyond 90 degrees."""
    md, inc = [0, 100, 200, 300, 400], [0, 20, 30, 110, 60]
    one = cf.well.WellPath.from_survey(md, inc, [0, 350, 10, 5, 300])
    two = cf.well.WellPath.from_survey(md, inc, [77, -10, -350, 5, -60])
    at = np.linspace(0, 400, 33)
    assert np.abs(one.position(at) - two.position(at)).max() < 1e-12 * 400
    assert np.linalg.norm(one.tangent(at), axis=1) == pytest.approx(1, abs=1e-14)
    assert np.degrees(one.dogleg[1]) < 15  # 20 degrees of azimuth at 25 of inclination, not 340
    assert one.tangent(350.0)[2] < one.tangent(400.0)[2] and one.tangent(300.0)[2] < 0


@pytest.mark.parametrize("name", ["P", "F-12", "ISCWSA 2"])
def test_the_closest_point(name):
    well, rng = reference_wells.well(name), np.random.default_rng(5)
    md = np.sort(rng.uniform(0, well.length, 300))
    away = np.cross(well.tangent(md), rng.normal(size=(300, 3)))
    points = well.position(md) + 0.05 * away / np.linalg.norm(away, axis=1)[:, None]
    assert np.abs(well.closest(points) - md).max() < 1e-9
    for near in (md + rng.uniform(-90, 90, 300), np.roll(md, 1), 0.0, well.length):
        near = np.clip(near, 0, well.length)
        assert np.abs(well.closest(points, near) - md).max() < 1e-9
    beyond = [well.position(well.length) + 3 * well.tangent(well.length), [0, 0, -2.0]]
    assert well.closest(beyond).tolist() == well.closest(beyond, near=1000.0).tolist() == [well.length, 0.0]
    assert well.closest(points[0]).shape == () and well.closest(points[None]).shape == (1, 300)
    near = well.nearest(points.reshape(2, 150, 3), 0.0)  # one depth for all points
    assert near.md == pytest.approx(md.reshape(2, 150))
    assert near.tangent.ravel() == pytest.approx(well.tangent(md).ravel())
    for given in ((points, [0.0, 1.0]), (points[:, :2], 0.0)):
        with pytest.raises(ValueError, match="shape"):
            well.nearest(*given)


def test_the_closest_point_of_a_wide_arc_far_away():
    """Half a turn, seen from a point nearer to its end than to its start, behind both."""
    well = cf.well.WellPath.from_survey([0, 100 * math.pi * 0.9], [0, 162], [0, 0])
    md = np.linspace(0, well.length, 100001)
    for point in ([-20.0, 0.0, -50.0], [205.0, 3.0, 10.0], [150.0, 0.0, -90.0], [90.0, 0.0, 1.0]):
        best = md[np.argmin(np.linalg.norm(well.position(md) - point, axis=1))]
        assert well.closest(point) == pytest.approx(best, abs=0.004)


def test_a_survey_from_a_file(tmp_path):
    file = tmp_path / "survey.csv"
    stations = "\n0;0;0\n1000;0;0\n2000;30;45\n"
    for heading, given in (
        ("MD (ft);Inc [deg];Azimuth", {"length_unit": cf.units.foot}),
        ("Measured Depth (ftKB);Inclination (deg);Azimuth (deg)", {}),
        ("# My company\nWell: A-1, 2024\n\nMD;INC;AZI\nft;deg;deg", {"length_unit": "ft"}),
        ("depth_ft;tilt;Azimuth", {"md": "Depth", "inc": "tilt"}),
        ("Hole Depth (ft);Inc.;Azi True", {}),
        ("MD;INC;AZ\n(ft);[deg];(deg)", {}),
        ("Meas. Depth (ftKB);Incl. (deg);Azim. (deg T)", {}),
    ):
        file.write_text(heading + stations, encoding="utf-8")
        well = cf.well.WellPath.from_csv(file, **given)
        assert well.md.tolist() == pytest.approx([0, 304.8, 609.6]), heading
        assert np.degrees([well.inclination[2], well.azimuth[2]]) == pytest.approx([30, 45]), heading
    for unit in ("usft", "US survey feet", "ftUS"):
        file.write_text(f"MD ({unit}),Inc (deg),Azi (deg True){stations}".replace(";", ","), encoding="utf-8")
        assert cf.well.WellPath.from_csv(file).md[2] == pytest.approx(2000 * 0.3048006096, rel=1e-10)
    for numbers in ("\n0,0;0;0\n2000,00;30,5;45\n", '\n0;0;0\n"2,000.0";30.5;45\n'):
        file.write_text(f"MD (ft);Inc (deg);Azi{numbers}", encoding="utf-8")
        assert cf.well.WellPath.from_csv(file).inclination[1] == pytest.approx(np.radians(30.5))
    file.write_text("MD (mRKB),Inc (rad),Azi\n0,0,0\n900,0.3,0.2\n", encoding="utf-8")
    assert cf.well.WellPath.from_csv(file).inclination[1] == 0.3
    file.write_text("MD,Inc,Azi\n0,0,0\n9000,30,0\n", encoding="utf-8")
    with pytest.warns(
        cf.SceneWarning, match="'MD' names no unit, so that the deepest station is at 9000 m: if these are"
    ):
        assert cf.well.WellPath.from_csv(file).length == 9000
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert cf.well.WellPath.from_csv(file, length_unit="m").length == 9000


def test_plain_depths_that_are_as_large_as_feet_are_doubted():
    stations = [0, 9000], [0, 30], [0, 0]
    with pytest.warns(cf.SceneWarning, match="md has no unit, .* at 9000 m: if these are feet, say length_unit = 'ft'"):
        assert cf.well.WellPath.from_survey(*stations).length == 9000
    section = cf.well.HoleSection("9000 m", 0.2, 0.2)
    with pytest.warns(cf.SceneWarning, match="stations: their depths have no unit"):
        cf.well.Borehole.from_survey([section], stations=np.transpose(stations).tolist())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert cf.well.WellPath.from_survey(*stations, length_unit="m").length == 9000
        feet = cf.well.WellPath.from_survey(np.array([0, 9000]), [0, 30], [0, 0], length_unit="ft")
        assert feet.length == pytest.approx(2743.2) and feet.unit == "ft"
        assert cf.well.tortuosity(feet, 0.5, "300 ft", seed=1).unit == "ft"
    with pytest.raises(cf.SceneError, match="length_unit = 'ft': expected None, since depths have units of their own"):
        cf.well.WellPath.from_survey(["0 m", "90 m"], [0, 30], [0, 0], length_unit="ft")


def test_vertical_stations_need_no_azimuth(tmp_path):
    given = cf.well.WellPath.from_survey([0, 100, 400], [0, 0, 30], [70, 70, 70])
    text = "MD (m),Inc (deg),Azi (deg)\n0,0,\n# Tie-in\n100,0,\n400,30,70\n"
    (tmp_path / "survey.csv").write_text(text, encoding="utf-8")
    for path in (
        cf.well.WellPath.from_survey([0, 100, 400], [0, 0, 30], [None, math.nan, 70]),
        cf.well.WellPath.from_csv(tmp_path / "survey.csv"),
        cf.well.Borehole.from_survey([cf.well.HoleSection(400.0, 0.2, 0.2)],
                                     stations=[(0, 0, None), (100, 0, None), (400, 30, 70)]).path,
    ):
        assert (path.position(400.0) == given.position(400.0)).all() and path.filled == (0, 100)
    hole = cf.well.Borehole(path, cf.well.HoleSection(400.0, 0.2, 0.2))
    assert "No azimuth was given at md = 0 m, 100 m, which is vertical" in "".join(hole.sentences(Units()))
    with pytest.raises(cf.SceneError, match=r"azi\[1\] = None: expected a number, .* \(inclination 5\)"):
        cf.well.WellPath.from_survey([0, 100], [0, 5], [None, None])


def test_a_survey_from_a_workbook(tmp_path):
    """Title rows, an empty column, a formula without a value, a note beside numbers, units in the names or below."""
    book = pytest.importorskip("openpyxl").Workbook()
    book.active.append(["Well A-1, 2024", None, "1, 2, 3, 4"])
    plan = book.create_sheet("as drilled")
    for below, rows in (
        (book.active, [[], [None, "MD\n(ft)", "Inc, deg", "Azimuth (deg)"]]),
        (plan, [["md", "inclination", "azi", "=1+1"], ["ft", "deg", "deg"]]),
    ):
        first = [None] * (below is book.active)
        for row in [*rows, [*first, 0, 0, 0], [*first, 1000, 0, 0.0, "a note"], [*first, 2000.0, 30, 45]]:
            below.append(row)
    book.save(tmp_path / "survey.xlsx")
    for path in (
        cf.well.WellPath.from_xlsx(tmp_path / "survey.xlsx", inc="inc, deg"),
        cf.well.WellPath.from_xlsx(tmp_path / "survey.xlsx", "as drilled"),
        cf.well.Borehole.from_survey(
            [cf.well.HoleSection("2000 ft", 0.2, 0.2)], str(tmp_path / "survey.xlsx"), sheet="as drilled"
        ).path,
    ):
        assert path.md.tolist() == pytest.approx([0, 304.8, 609.6])
        assert np.degrees([path.inclination[2], path.azimuth[2]]) == pytest.approx([30, 45])


@pytest.mark.parametrize(("text", "given", "words"), [
    ("md,inc,azi\n0,0,0\n\n10,none,0", {}, "line 4, '10,none,0': expected numbers in md, inc, azi"),
    ("md,inc,azi\n0,0,0\nTie-in,,\n10,10,0", {}, "line 3, 'Tie-in,,'.*remove it or begin it with #"),
    ("md,inc,azi\n0,0,0\nProjected to TD,10,10,0", {}, "line 3.*remove it or begin it with #"),
    ("md;inc;azi\n0;0;0\n10;10,500;20", {}, "line 3.*decimals stand behind a point"),
    ("md,inc,azi\n0,0,0\n10,10,5,20", {}, "line 3.*no more columns than names"),
    ("MD (m),inc,azi\n0,0,0\n10,5,20", {"length_unit": "ft"}, "'MD .m.' says a unit of 1 m"),
    ("MD (m),inc,azi\n0,0,0\n10,5,20", {"length_unit": "yd"}, "length_unit = 'yd': known: cm, f"),
    ("md,inc (rad),azi\n0,0,0\n10,5,20", {"degrees": True}, "contradict"),
    ("MD (kft),inc,azi\n0,0,0\n10,5,20", {}, r"'MD \(kft\)': unit 'kft' is not known: expected m, .*; or say it by"),
    ("md,inc (grad),azi\n0,0,0\n10,5,20", {}, "unit 'grad' is not known: expected deg, .*; or say it by degrees"),
    ("md,inc,direction\n0,0,0\n10,5,20", {}, "no column 'azi' in md, inc, direction: .*columns = "),
    ("md,azim,azimuth,inc\n0,0,0,0\n10,5,5,20", {}, "no column 'azi' in"),
    ("0,0,0\n10,5,20\n", {}, "expected a row of names, such as"),
    ("md,inc,azi\n0,0,0\n", {}, "1 stations below the row of names"),
    ("MD (ft),inc,azi\n0,0,0\n9000,1,2\n8530.5,1,2", {}, r"md\[2\] = 8530.5: expected more .* before, 9000 ft"),
    ("md,inc,azi\n30,0,0\n100,5,20", {"length_unit": "ft"}, r"md\[0\] = 30.0: expected 0 ft"),
])  # fmt: skip
def test_files_that_are_refused(text, given, words, tmp_path):
    (tmp_path / "survey.csv").write_text(text, encoding="utf-8")
    with pytest.raises(cf.SceneError, match=words):
        cf.well.WellPath.from_csv(tmp_path / "survey.csv", **given)


@pytest.mark.parametrize(("md", "inc", "azi", "degrees", "words"), [
    ([0, 200, 100], [0, 5, 9], [0, 9, 9], None, r"md\[2\] = 100.0: expected more than the station before, 200 m"),
    ([0, 100, 100], [0, 5, 9], [0, 9, 9], None, "ascending"),
    ([-5, 100], [0, 5], [0, 9], None, r"md\[0\] = -5.0"),
    ([30, 100], [0, 5], [0, 9], None, "starts vertically"),
    ([0, 100, 200], [0, 0.5, 1.2], [0, 1, 5.5], None, "look like radians"),
    ([0, 100], [0, 40], [0, 0], False, r"inc\[1\] = 40.0: expected 0 to 3.14159 \(rad\)"),
    ([0, 100], [0, -4], [0, 0], None, r"inc\[1\] = -4.0: expected 0 to 180 \(degrees\)"),
    ([0, 100], [0, 4], [0, 400], None, r"azi\[1\] = 400.0"),
    ([0, 100], [0, math.nan], [0, 0], None, "finite"),
    ([0], [0], [0], None, "at least two stations"),
    ([0, 1, 2], [0, 9], [0, 0], None, "3 numbers"),
    ([0, 100, 200], [0, 90, 90], [0, 0, 180], None, "turns by 180 degrees between md = 100 and 200 m"),
    (["0 ft", "100 ft", "90 ft"], [0, 5, 9], [0, 9, 9], None, r"md\[2\] = 90.0: expected more .* before, 100 ft"),
])  # fmt: skip
def test_surveys_that_are_refused(md, inc, azi, degrees, words):
    with pytest.raises(cf.SceneError, match=words):
        cf.well.WellPath.from_survey(md, inc, azi, degrees)


def test_degrees_that_look_like_radians_are_taken_where_said():
    with pytest.warns(cf.SceneWarning, match="look like radians"):
        well = cf.well.WellPath.from_survey([0, 100, 200], [0, 0.5, 1.2], [0, 1, 5.5], degrees=True)
    assert well.inclination[2] == pytest.approx(math.radians(1.2))
    assert cf.well.WellPath.from_survey([0, 100], [0, 0], [0, 3]).dogleg[0] == 0  # a vertical well has nothing to doubt


PIPE = cf.well.Component(weight=241.13, contact_radius=0.0635)


def solved(path, operation, mu=0.25, string=PIPE, **settings):
    hole = cf.well.Borehole(path, [cf.well.HoleSection(path.length, 0.2159, mu)])
    return cf.well.torque_and_drag(
        hole, cf.well.DrillString([string]), operation, **{"model": "soft", "tol": 1e-10, **settings}
    )


@pytest.mark.parametrize(("name", "load", "weight"), [
    ("F-12", "bit_free", 0.0), ("F-12", "WOB_80kN", 80e3), ("ISCWSA 2", "bit_free", 0.0),
])  # fmt: skip
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


@pytest.mark.parametrize("seed", range(2))
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
        md, inc = (np.r_[0, np.cumsum(rng.uniform(*ends, 7))] for ends in ((100, 900), (-25, 40)))
        path = cf.well.WellPath.from_survey(md, inc.clip(0, 120), np.full(8, 77.0))
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


def test_no_python_for_each_station():
    string = cf.well.DrillString([cf.well.Collar(180, "NC46-65"), cf.well.DrillPipe(size="5 in 19.50 lb/ft")])
    rng, calls = np.random.default_rng(2), []
    for stations in (20, 2000):
        inc, azi = (np.cumsum(rng.uniform(a, b, stations)) * 200 / stations for a, b in ((-1, 1.6), (-4, 4)))
        path = cf.well.WellPath.from_survey(np.linspace(0, 5000, stations), np.abs(inc) % 90, azi)
        hole = cf.well.Borehole(path, [cf.well.HoleSection(2000, 0.22, 0.2), cf.well.HoleSection(5000, 0.2159, 0.3)])
        counted = []
        sys.setprofile(lambda frame, event, arg, counted=counted: counted.append(event))
        answer = cf.well.torque_and_drag(
            hole, string, cf.well.TripOut(), mud=cf.well.Mud(1200.0), model="soft", tol=1e-8
        )
        sys.setprofile(None)
        assert answer.error <= 1e-8
        calls.append(len(counted))
    assert calls[1] < 1.5 * calls[0] + 200


PATH = well("P")
COLLAR = cf.well.Collar(200.0, outer_diameter=0.165, inner_diameter=0.07)
STEEL_PIPE = cf.well.DrillPipe(outer_diameter=0.127, inner_diameter=0.1086)
#: names of parameters, the argument of `answer` and its value
NAMES = {"hole.sections[0].friction": ("cased", 0.2), "hole.sections[1].friction": ("open", 0.32),
         "mud.density": ("density", 1200.0), "operation.weight": ("weight", 5e4),
         "operation.torque": ("torque", 3e3)}  # fmt: skip


def cased_and_open(cased=0.2, open=0.32):
    sections = [cf.well.HoleSection(2000, 0.22, cased), cf.well.HoleSection(PATH.length, 0.2159, open)]
    return cf.well.Borehole(PATH, sections)


def answer(operation, convention, *, density=1200.0, weight=5e4, torque=3e3, tol=1e-11, **friction):
    string, acting = cf.well.DrillString([COLLAR, STEEL_PIPE]), operation(weight=weight, torque=torque)
    given = {"mud": cf.well.Mud(density), "model": "soft", "tol": tol, "torque_convention": convention}
    return cf.well.torque_and_drag(cased_and_open(**friction), string, acting, **given)


def capstan(pull=900e3, mu=0.3, weight=0.0):
    """A string without weight on a quarter circle."""
    path = cf.well.WellPath.from_survey([0, 200 * math.pi], [0, 90], [350, 350])
    hole = cf.well.Borehole(path, [cf.well.HoleSection(path.length, 0.2159, mu)])
    string = cf.well.DrillString([cf.well.Component(weight=weight, contact_radius=0.0635)])
    return cf.well.torque_and_drag(hole, string, cf.well.TripOut(weight=-pull), model="soft", tol=1e-11)


def test_capstan():
    """T = F e^(mu pi/2): by friction pi/2 T, by the pull e^(mu pi/2); and by weight, of the closed form of the arc."""
    turn, mu, pull, radius = math.pi / 2, 0.3, 900e3, 400.0
    found = capstan().sensitivity(["friction", "operation.weight", "weight"])
    assert found["friction"] == pytest.approx(turn * pull * math.exp(mu * turn), rel=1e-10)
    assert found["operation.weight"] == pytest.approx(-math.exp(mu * turn), rel=1e-10)
    # Aadnoy's form of a build: A sin(i) + B cos(i) + C e^(-mu i), linear in the weight
    A, B = -radius * (1 - mu**2) / (1 + mu**2), -2 * mu * radius / (1 + mu**2)
    assert found["weight"] == pytest.approx(B - A * math.exp(mu * turn), rel=1e-9)


@pytest.mark.parametrize("convention", ["coulomb", "johancsik"])
@pytest.mark.parametrize("operation", [cf.well.TripOut, cf.well.TripIn, cf.well.RotaryDrilling])
def test_a_well_as_by_differences_of_answers(operation, convention):
    here = answer(operation, convention)
    for query in ("hook_load", "surface_torque"):
        found = here.sensitivity(NAMES, query)
        for name, (argument, value) in NAMES.items():
            step = 2e-3 * value
            near = [getattr(answer(operation, convention, **{argument: value + k * step}), query) for k in PLACES]
            by, _ = derivative(near, step)
            assert abs(found[name] - by) <= 1e-9 * abs(by) + 1e-11 * abs(found.value / value)
    along = here.sensitivity(["friction"], "tension")["friction"]
    assert along.shape == here.md.shape
    sections = [here.sensitivity([f"hole.sections[{i}].friction"])[f"hole.sections[{i}].friction"] for i in (0, 1)]
    assert along[0] == pytest.approx(sum(sections), rel=1e-12, abs=1e-6)
    all_of_it, *parts = here.sensitivity(["weight", *(f"string.components[{i}].weight" for i in (0, 1))]).values()
    assert all_of_it == pytest.approx(sum(parts), rel=1e-12)


@pytest.mark.parametrize("tol", [1e-4, 1e-12])
def test_many_cases_are_single_answers(tol):
    """In one call of C, but for those whose pieces are cut."""
    values = np.array([x for _, x in NAMES.values()]) * np.random.default_rng(3).uniform(0.6, 1.4, (5, len(NAMES)))
    for operation, convention in ((cf.well.TripIn, "coulomb"), (cf.well.RotaryDrilling, "johancsik")):
        found = answer(operation, convention, tol=tol).batch(NAMES, values)
        assert (found.by_solve.any() if tol < 1e-4 else not found.by_solve.all()) and not found.failures
        for row, loads, errors in zip(values, found.values, found.errors, strict=True):
            given = dict(zip((x for x, _ in NAMES.values()), row, strict=True))
            one = answer(operation, convention, tol=tol, **given)
            assert loads == pytest.approx([one.hook_load, one.surface_torque], rel=1e-12)
            assert errors == pytest.approx([one.solved.error, one.solved.torque_error], rel=0.1)
    whole = capstan().batch("friction", [[0.1], [0.3]]).values[:, 0]
    assert whole == pytest.approx([capstan(mu=0.1).hook_load, capstan().hook_load], rel=1e-12)
    named = capstan().batch(["string.components[0].weight", "weight"], [[100.0, 1.0]]).values[0, 0]
    assert named == pytest.approx(capstan(weight=100.0).hook_load, rel=1e-12)


def test_cases_that_are_refused():
    here = capstan()
    for names, values, words in (
        ("friction", [0.1], "rows of 1 numbers: friction"),
        ("friction", [[-0.1]], r"batch.friction = .*: expected numbers from 0 to 5"),
        ("mass", [[10.0]], "'mass' of a string: known: friction"),
        (3, [[0.1]], r"batch.over = 3: expected a list of names, such as \['friction'"),
        ("friction", [[0.1], [0.2, 0.3]], r"batch.values = .*: expected \(cases, 1\) finite numbers"),
    ):
        with pytest.raises(cf.SceneError, match=words):
            here.batch(names, values)
    with pytest.raises(cf.SceneError, match="model = 'buckled': expected the answer of"):
        cf.well.torque_and_drag(here.hole, here.string, cf.well.TripIn(), model="buckled").batch("friction", [[0.1]])


def test_doubts_of_many_cases_are_said_once(monkeypatch):
    """As `Mud` and `HoleSection` doubt one; and the cases are solved in parts, whose arrays stay small."""
    values = [[0.3, 1200.0], [0.3, 12.0], [1.5, 1150.0], [0.3, 1.2], [0.2, 1250.0]]
    with pytest.warns(cf.SceneWarning) as told:
        found = answer(cf.well.TripIn, "coulomb").batch(["friction", "mud.density"], values)
    friction, density = (str(x.message) for x in told)
    assert friction.startswith("batch: friction = 1.5, in 1 of 5 cases, is more than the wall of a well has")
    assert density.startswith("batch: mud.density = 12, in 2 of 5 cases, is hardly that of a mud")
    monkeypatch.setattr("cosserat_fenicsx.well.softstring._AT_ONCE", 2)
    with pytest.warns(cf.SceneWarning):
        parts = answer(cf.well.TripIn, "coulomb").batch(["friction", "mud.density"], values)
    assert (parts.values == found.values).all() and (parts.errors == found.errors).all()


def test_uncertainty_of_a_hook_load_with_a_fit():
    """The coefficients of a fit, with their correlation, tell how uncertain a hook load is: as readings of exactly
    this load would."""
    hole = cased_and_open()
    string, rng, measurements = cf.well.DrillString([COLLAR, STEEL_PIPE]), np.random.default_rng(5), []
    for depth in (1500.0, 2500.0, 3500.0, 4500.0):
        for operation in (cf.well.TripOut(), cf.well.TripIn()):
            exact = cf.well.torque_and_drag(hole, string, operation, mud=cf.well.Mud(1200.0), depth=depth, model="soft")
            measurements.append(cf.well.RigMeasurement(depth, operation, exact.hook_load + 5e3 * rng.normal()))
    fit = cf.well.calibrate_friction(hole, string, measurements, mud=cf.well.Mud(1200.0))
    half = np.diff(fit.interval)[:, 0] / 2
    assert half / fit.standard_error == pytest.approx([half[0] / fit.standard_error[0]] * 2)  # Student's quantile
    here = cf.well.torque_and_drag(fit.hole, string, cf.well.TripOut(), mud=cf.well.Mud(1200.0), model="soft")
    names = ["hole.sections[0].friction", "hole.sections[1].friction"]
    given = dict(zip(names, fit.standard_error, strict=True))
    found = here.uncertainty(given, correlation=fit.correlation)
    slopes = np.array(list(here.sensitivity(names).values()))
    covariance = fit.correlation * np.outer(fit.standard_error, fit.standard_error)
    assert found.standard_deviation == pytest.approx(math.sqrt(slopes @ covariance @ slopes), rel=1e-12)
    assert sum(found.shares.values()) == pytest.approx(1.0)
    assert "% from hole.sections[1].friction" in str(found)
    by_text = here.uncertainty({"operation.weight": "2 klbf", names[0]: 0.02})
    assert by_text.given == {"operation.weight": 2 * cf.units.kip, names[0]: 0.02}
    with pytest.raises(cf.SceneError, match="psi is a unit of pressure"):
        here.uncertainty({"operation.weight": "2 psi"})


def test_refusals_in_words():
    here = capstan()
    for name, words in (
        ("hole.sections[3].friction", r"hole.sections\[i\].friction with i from 0 to 0"),
        (
            "operation.rpm",
            r"known: friction, weight, operation.weight, operation.torque, hole.sections\[i\].friction "
            r"with i from 0 to 0, string.components\[i\].weight with i from 0 to 0$",
        ),  # fmt: skip
        ("mud.density", "known: friction"),  # there is no mud
        (3, "known"),
    ):
        with pytest.raises(cf.SceneError, match=words):
            here.sensitivity([name])
    with pytest.raises(cf.SceneError, match="did you mean 'hook_load'"):
        here.sensitivity(["friction"], "hook")
    hole = cf.well.Borehole(PATH, [cf.well.HoleSection(PATH.length, 0.2159, 0.25)])
    string, given = cf.well.DrillString([COLLAR, STEEL_PIPE]), {"mud": cf.well.Mud(1200.0), "model": "buckled"}
    buckled = cf.well.torque_and_drag(hole, string, cf.well.Sliding(90e3), **given)
    assert buckled.solved.helical.any()
    with pytest.raises(cf.SceneError, match="a string with a helix .model = 'buckled'.*model='soft'"):
        buckled.sensitivity(["friction"])


def test_what_is_printed_has_names_and_units():
    found = capstan().sensitivity(["friction", "operation.weight"])
    first, by_friction, by_weight = str(found).splitlines()
    assert first == f"hook_load = {found.value:.6g} N"
    assert by_friction == f"d/d(friction) = {found['friction']:.6g} N"  # of all sections: it has no one value
    assert by_weight == f"d/d(operation.weight) = {found['operation.weight']:.6g} N per N, at -900000"
    told = str(found.uncertainty({"operation.weight": 1e3}))
    assert told.startswith(f"hook_load = {found.value:.6g} +- {1e3 * abs(found['operation.weight']):.6g} N (one")


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
    bare = cf.well.DrillString([cf.well.Component(None, None, 241.13, 0.06)])
    assert np.isnan(cf.well.torque_and_drag(hole, bare, cf.well.TripIn()).critical_load("Wu")).all()


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
