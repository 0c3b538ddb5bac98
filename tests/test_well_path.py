"""Axes of wells: closed forms of arcs, another program's positions, the closest point, and surveys that are refused."""

import math

import numpy as np
import pytest
import reference_wells
from reference_wells import WELLS

import cosserat_fenicsx as cf

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
    ):
        file.write_text(heading + stations, encoding="utf-8")
        well = cf.well.WellPath.from_csv(file, **given)
        assert well.md.tolist() == pytest.approx([0, 304.8, 609.6]), heading
        assert np.degrees([well.inclination[2], well.azimuth[2]]) == pytest.approx([30, 45]), heading
    file.write_text("MD (m),Inc (rad),Azi\n0,0,0\n900,0.3,0.2\n", encoding="utf-8")
    assert cf.well.WellPath.from_csv(file).inclination[1] == 0.3


@pytest.mark.parametrize(
    ("text", "given", "words"),
    [
        ("md,inc,azi\n0,0,0\n\n10,none,0", {}, "line 4, '10,none,0': expected numbers in md, inc, azi"),
        ("md;inc;azi\n0;0;0\n10;10,5;20", {}, "line 3.*decimals stand behind a point"),
        ("md,inc,azi\n0,0,0\n10,10,5,20", {}, "line 3.*no more columns than names"),
        ("MD (m),inc,azi\n0,0,0\n10,5,20", {"length_unit": "ft"}, "'MD .m.' says a unit of 1 m"),
        ("MD (m),inc,azi\n0,0,0\n10,5,20", {"length_unit": "yd"}, "length_unit = 'yd': known: cm, f"),
        ("md,inc (rad),azi\n0,0,0\n10,5,20", {"degrees": True}, "contradict"),
        ("md,inc,direction\n0,0,0\n10,5,20", {}, "no column 'azi' in md, inc, direction: .*columns = "),
        ("md,azim,azimuth,inc\n0,0,0,0\n10,5,5,20", {}, "no column 'azi' in"),
        ("0,0,0\n10,5,20\n", {}, "expected a row of names, such as"),
        ("md,inc,azi\n0,0,0\n", {}, "1 stations below the row of names"),
    ],
)
def test_files_that_are_refused(text, given, words, tmp_path):
    (tmp_path / "survey.csv").write_text(text, encoding="utf-8")
    with pytest.raises(cf.SceneError, match=words):
        cf.well.WellPath.from_csv(tmp_path / "survey.csv", **given)


@pytest.mark.parametrize(
    ("md", "inc", "azi", "degrees", "words"),
    [
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
    ],
)
def test_surveys_that_are_refused(md, inc, azi, degrees, words):
    with pytest.raises(cf.SceneError, match=words):
        cf.well.WellPath.from_survey(md, inc, azi, degrees)


def test_degrees_that_look_like_radians_are_taken_where_said():
    with pytest.warns(cf.SceneWarning, match="look like radians"):
        well = cf.well.WellPath.from_survey([0, 100, 200], [0, 0.5, 1.2], [0, 1, 5.5], degrees=True)
    assert well.inclination[2] == pytest.approx(math.radians(1.2))
    assert cf.well.WellPath.from_survey([0, 100], [0, 0], [0, 3]).dogleg[0] == 0  # a vertical well has nothing to doubt
