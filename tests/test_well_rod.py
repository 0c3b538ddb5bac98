"""The exact rod in contact through torque_and_drag: the ladder, what is handed on, what the answer tells, refusals."""

import json
import math
import types
from pathlib import Path

import numpy as np
import pytest
from reference_wells import well

import cosserat_fenicsx as cf
from cosserat_fenicsx.well import rod_in_hole

pytestmark = pytest.mark.few_ranks
KNOWN = json.loads((Path(__file__).parent / "reference" / "rod_in_hole.json").read_text(encoding="utf-8"))
EI = 1228200.0
STIFF = cf.Stiffness((1.35359e8, 1.35359e8), 7.03868e8, (EI, EI), 9.4e5)
STRING = cf.DrillString([cf.Component(None, STIFF, 241.13, 0.0635, name="pipe")])
MUD = cf.Mud(1200.0)


def hole(path, clearance=0.04445, mu=0.25, **settings):
    return cf.Borehole(path, cf.HoleSection(path.length, 2 * (0.0635 + clearance), mu), **settings)


def build():
    """Vertical, a build to 40 degrees, straight."""
    return cf.WellPath.from_survey([0, 100, 300, 500], [0, 0, 40, 40], [20, 20, 20, 20])


@pytest.fixture(scope="module")
def out():
    return cf.torque_and_drag(hole(build()), STRING, cf.TripOut(weight=-50e3), tol=1e-4)


def test_auto_goes_on_to_the_rod_and_says_why(out):
    assert out.model == "rod" and out.enough and out.error <= 1e-4 and out.model_error == 0
    soft = cf.torque_and_drag(hole(build()), STRING, cf.TripOut(weight=-50e3), model="soft")
    apart = out.hook_load - soft.hook_load
    assert out.differences["soft"] == pytest.approx((apart, 0.0), abs=50) and out.differences["soft"][0] == apart
    assert abs(apart) <= soft.model_error * soft.tension.max() < 8 * abs(apart)
    told = "; ".join(out.why)
    assert "clearance" in told and f"{apart:+.4g} N" in told and "tol = 0.0001 is less in the hook load" in told
    assert "NOT ENOUGH" not in str(out) and "exact rod in contact" in str(out)
    assert not soft.enough and cf.torque_and_drag(hole(build()), STRING, cf.TripOut(-50e3), tol=0.05).model == "soft"


def test_what_the_answer_of_the_rod_tells(out):
    n = len(out.md)
    for name in ("tension", "torque", "side_force", "bending_moment", "standoff", "clearance", "buckling", "helical",
                 "contact_side", "inclination", "component", "true_tension", "von_mises"):  # fmt: skip
        assert getattr(out, name).shape == (n,), name
    assert out.position.shape == out.offset.shape == (n, 3)
    assert out.tension[[0, -1]] == pytest.approx([out.hook_load, 50e3], rel=1e-6)
    assert np.linalg.norm(out.offset, axis=1) == pytest.approx((1 - out.standoff) * 0.04445, abs=1e-9)
    assert out.drag == pytest.approx(out.hook_load - 50e3 - 241.13 * np.ptp(out.position[:, 2]), rel=1e-6)
    in_arc = (out.md > 150) & (out.md < 250)
    assert out.bending_moment[in_arc] == pytest.approx(EI * math.radians(40) / 200, rel=0.02)
    # out of the hole the pipe is pulled to the high side of the build section, and lies on the low side below it
    sides = {side: sum(force for _, _, force, name in out.contacts if name == side) for side in ("high", "low")}
    assert {name for *_, name in out.contacts} == {"high", "low"} and min(sides.values()) > 1e3
    points = [md for md, end, *_ in out.contacts if md == end]
    assert len(points) >= 2 and f"{len(points)} forces of the wall at points" in str(out)
    assert out.stretch == pytest.approx(((out.tension[1:] + out.tension[:-1]) / 2 * np.diff(out.md)).sum() / 7.03868e8,
                                        rel=1e-3)  # fmt: skip
    assert np.isfinite(out.critical_load("He-Kyllingstad")).any() and math.isnan(out.neutral_point)


def test_the_difference_is_one_of_clearance():
    """What a string misses that leaves one wall for the other grows like the root of the clearance, T sqrt(4 r/R)."""
    wide, narrow = (cf.torque_and_drag(hole(well("P"), r), STRING, cf.TripOut(), model="rod").differences["soft"]
                    for r in (0.04, 0.01))  # fmt: skip
    assert wide[0] / narrow[0] == pytest.approx(2, rel=0.1)


def test_a_rotating_string_climbs_and_has_torque():
    found = cf.torque_and_drag(hole(build(), 0.01), STRING, cf.RotateOffBottom(weight=-50e3), model="rod")
    hook, torque = found.differences["soft"]
    assert abs(hook) < 1e-4 * found.hook_load and -0.05 * found.surface_torque < torque < 0
    assert found.torque[0] == pytest.approx(found.surface_torque, rel=1e-6) and found.twist > 0
    lying = np.isclose(found.side_force, 241.13 * math.sin(math.radians(40)) / math.hypot(1, 0.25), rtol=1e-3)
    assert found.contact_side[lying & (found.md > 400)] == pytest.approx(math.pi - math.atan(0.25), abs=1e-3)
    assert np.count_nonzero(lying & (found.md > 400)) > 20


@pytest.mark.parametrize("case", KNOWN["stiff build"][:2], ids=lambda case: case["name"])
def test_a_build_section_against_its_strong_form(case):
    """There the upper end turns freely and friction acts on the centreline: a difference of 31 and 18 N."""
    given, alpha = case["input"], case["input"]["alpha"]
    md = np.cumsum([0, given["h"], given["R"] * math.radians(alpha), given["D"] + 50.0])
    path = cf.WellPath.from_survey(md, [0, 0, alpha, alpha], [0, 0, 0, 0])
    stiff = cf.Stiffness((1e12, 1e12), 1e12, (given["EI"],) * 2, given["EI"])
    string = cf.DrillString([cf.Component(None, stiff, given["w"], 0.06)])
    operation = {1: cf.TripOut, -1: cf.TripIn, 0: cf.Static}[given["c"]](weight=-given["T0"])
    section = cf.HoleSection(path.length, 2 * (0.06 + given["r"]), given["mu"])
    found = cf.torque_and_drag(cf.Borehole(path, section), string, operation, depth=case["rod_length"], model="rod")
    assert found.hook_load == pytest.approx(case["hook_load_vertical"], rel=2e-4)


def test_a_string_that_would_buckle_is_not_enough():
    """In a vertical hole it stays straight on the axis, far beyond the load at which it buckles."""
    path = cf.WellPath.from_survey([0, 600], [0, 0], [0, 0])
    found = cf.torque_and_drag(hole(path), STRING, cf.RotaryDrilling(30e3, 2e3), model="rod")
    assert found.error < 1e-9 and found.solved.negative_modes > 0
    assert not found.enough and found.model_error > 0 and "NOT STABLE without friction" in str(found)


def test_of_several_equilibria_the_stable_one_is_taken(monkeypatch):
    """The starts differ: each is tried until one has no negative modes; if there is none, the fewest count."""
    for modes, taken in (([2, 0], 0), ([2, -1, 1], 1), ([0], 0)):
        answers = [types.SimpleNamespace(negative_modes=x, error=0.0, of_stiffness=0.0) for x in [*modes, 9]]
        given = iter(answers)
        starts = []

        def on_mesh(string, layout, *args, given=given, starts=starts):
            starts.append(args)
            answer = next(given)
            answer.path = types.SimpleNamespace(layout=layout)
            answer.element_pressures = np.ones((sum(layout.counts), 4))
            return answer

        monkeypatch.setattr(rod_in_hole, "_on_mesh", on_mesh)
        section = {"radius": 0.1, "friction": 0.2, "slip": (1.0, 0.0)}
        last = rod_in_hole.solve_in_hole(build(), [400.0], STIFF, 241.13, 0.0635, elements=8, **section)
        assert last.negative_modes == 9 and len(starts) == len(answers)
        before = [x for x in starts[-1] if isinstance(x, types.SimpleNamespace)]
        assert before[0].negative_modes == taken


class Asked(Exception):
    """With what `solve_in_hole` was asked for."""


def test_what_is_handed_on(monkeypatch):
    """A bit and a stabiliser are rings, slip is that of each surface, and nothing below the string counts."""

    def asked(*args, **named):
        raise Asked(args, named)

    monkeypatch.setattr(rod_in_hole, "solve_in_hole", asked)
    path = build()
    sections = [cf.HoleSection(200, 0.25, 0.2), cf.HoleSection(450, 0.2159, 0.3), cf.HoleSection(500, 0.15, 0.4)]
    stabiliser = cf.Stabiliser(2.0, 0.21, 0.16, 0.07)
    string = cf.DrillString(
        [cf.Bit(0.2159), stabiliser, cf.Collar(50, "NC46-65"), cf.DrillPipe(size="5 in 19.50 lb/ft")]
    )
    with pytest.raises(Asked) as found:
        cf.torque_and_drag(cf.Borehole(path, sections, wall_stiffness=3e8), string, cf.Ream(0.2, 60, 30e3, 2e3),
                           mud=MUD, depth=400.0, model="rod", tol=1e-3)  # fmt: skip
    (axis, lengths, stiffness, weight, radius), named = found.value.args
    assert axis is path and lengths == pytest.approx([347.7, 50, 2, 0.3]) and len(stiffness) == 4 and min(weight) > 0
    assert radius[-2:] == [0.08, 0.35 * 0.2159]
    assert named["radius"] == [(200, 0.125), (450, 0.10795)] and named["friction"] == [(200, 0.2), (450, 0.3)]
    (s, clear, blades), (end, none, bit) = named["rings"]
    assert [s, clear, blades, end, none, bit] == pytest.approx([398.7, 0.00295, 0.105, 400, 0, 0.10795])
    turning = 2 * math.pi * 0.105
    assert named["slip"][2] == pytest.approx((-0.2 / math.hypot(0.2, turning), turning / math.hypot(0.2, turning)))
    assert (named["bottom_tension"], named["bottom_torque"], named["wall_stiffness"]) == (-30e3, 2e3, 3e8)


def test_what_cannot_be_a_rod(monkeypatch):
    path = build()
    soft = cf.DrillString([cf.Component(None, None, 241.13, 0.0635)])
    tight = hole(path, 0.0)
    for where, string, words in ((hole(path), soft, "stiffness = None: expected a Stiffness"),
                                 (tight, STRING, "contact_radius = 0.0635: expected less")):  # fmt: skip
        with pytest.raises(cf.SceneError, match=words):
            cf.torque_and_drag(where, string, cf.TripOut(), model="rod")
    settings = {"model": "rod", "torque_convention": "johancsik"}
    with pytest.raises(cf.SceneError, match="torque_convention = 'johancsik': expected 'coulomb'"):
        cf.torque_and_drag(hole(path), STRING, cf.RotateOffBottom(), **settings)
    instead = cf.torque_and_drag(hole(path), soft, cf.TripOut())
    assert instead.model == "soft" and not instead.enough
    assert any("the exact rod in contact was tried, and not solved: component: stiffness" in x for x in instead.why)

    def fails(*args, **named):
        raise cf.NotConverged("the contact alternates")

    monkeypatch.setattr(rod_in_hole, "solve_in_hole", fails)
    instead = cf.torque_and_drag(hole(path), STRING, cf.TripOut())
    assert not instead.enough and "not solved: the contact alternates" in str(instead)
    with pytest.raises(cf.NotConverged, match="alternates"):
        cf.torque_and_drag(hole(path), STRING, cf.TripOut(), model="rod")
    with pytest.raises(cf.NotConverged, match="trip out, bit at 400 m: the contact") as stop:
        cf.depth_sweep(hole(path), STRING, cf.TripOut(), [400.0, 500.0], model="rod")
    assert len(stop.value.path) == 0


def test_a_sweep_by_the_rod(out):
    found = cf.depth_sweep(hole(build()), STRING, cf.TripOut(weight=-50e3), [300.0, 500.0], model="rod")
    assert found.hook_load[0, 0, 1] == pytest.approx(out.hook_load, rel=2e-4) and len(found) == 2
    assert (found.values["model_error"] == 0).all() and (found.values["error"] <= 1e-4).all()


def test_charts_and_the_picture_show_points_and_places(out, tmp_path_all):
    pytest.importorskip("matplotlib")
    figure = out.plot()
    assert [axes.get_xlabel() for axes in figure.axes] == [
        "tension (kN)", "side force of the wall per length (N/m), peaks cut off", "forces of the wall at points (kN)"
    ]  # fmt: skip
    out.write(tmp_path_all / "out.csv")


#: Hook loads of another program (a prototype, elements of 2 m), N, with friction on the centreline: that its arm along
#: the pipe changes them by up to 41 N was found with this package.
FOUND = [
    ("P", cf.TripOut(), 907306.0), ("P", cf.TripIn(), 379920.4), ("P", cf.RotateOffBottom(), 598622.0),
    ("F-12", cf.TripOut(), 938745.5), ("F-12", cf.TripIn(), 595230.4), ("ISCWSA 2", cf.TripOut(), 1091313.3),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("name", "operation", "load"), FOUND)
def test_whole_wells(name, operation, load):
    found = cf.torque_and_drag(hole(well(name)), STRING, operation)
    assert found.model == "rod" and found.enough and found.hook_load == pytest.approx(load, rel=5e-5)
    assert not any("MORE" in line for line in found.why)  # the soft string's estimate covers the difference
