"""Scenes in Python and in files: the same by names and objects, and every message names the field."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from conftest import column, refused, refuses

import cosserat_fenicsx as cf

STEEL = cf.Material(E=210e9)
LINE = cf.Line((0, 0, 0), (0, 0, 1))
ROD = cf.Rod(LINE, cf.Circle(0.1), STEEL, name="rod")
OTHER = cf.Rod(LINE, cf.Circle(0.1), STEEL, name="other")
CLAMP = cf.Clamp(ROD.start)
nan, inf = math.nan, math.inf


def solved(scene):
    return cf.solve(cf.Scene(scene.rods, scene.supports, [cf.Force(ROD.end, (0, 0, 1))], scene.joints), [1.0])


REFUSED = {
    "zero diameter": (lambda: cf.Circle(0.0), "Circle.diameter = 0.0: expected a positive number (m)"),
    "negative diameter": (lambda: cf.Circle(-0.2), "Circle.diameter = -0.2"),
    "diameter is text": (lambda: cf.Circle("0.2"), "Circle.diameter = '0.2'"),
    "diameter is infinite": (lambda: cf.Circle(inf), "Circle.diameter = inf"),
    "shear factor": (lambda: cf.Circle(0.2, shear_factor=0), "Circle.shear_factor = 0"),
    "tube inside out": (lambda: cf.Tube(0.1, 0.2), "Tube.inner_diameter = 0.2: expected less than outer_diameter"),
    "rectangle": (lambda: cf.Rectangle(0.1, -1), "Rectangle.height = -1"),
    "E is NaN": (lambda: cf.Material(E=nan), "Material.E = nan: expected a positive number (Pa)"),
    "E is no number": (lambda: cf.Material(E=None), "Material.E = None"),
    "density is NaN": (lambda: cf.Material(E=1.0, density=nan), "Material.density = nan"),
    "density is negative": (lambda: cf.Material(E=1.0, density=-1), "Material.density = -1"),
    "nu = -1": (lambda: cf.Material(E=1.0, nu=-1), "nu = -1: expected a Poisson's ratio above -1 and up to 0.5"),
    "nu = 0.6": (lambda: cf.Material(E=1.0, nu=0.6), "Material.nu = 0.6"),
    "stiffness sign": (lambda: cf.Stiffness((1, 1), -1, (1, 1), 1), "Stiffness.axial = -1"),
    "stiffness count": (lambda: cf.Stiffness((1,), 1, (1, 1), 1), "Stiffness.shear = (1,)"),
    "infinite bending": (lambda: cf.Stiffness((1, 1), 1, (inf, 1), 1), "Stiffness.bending = inf"),
    "line of no length": (lambda: cf.Line((1, 2, 3), (1, 2, 3)), "Line.end = (1.0, 2.0, 3.0): expected a point apart"),
    "line of two numbers": (lambda: cf.Line((0, 0), (0, 1)), "Line.start = (0, 0): expected 3 finite numbers"),
    "line of true": (lambda: cf.Line((0, 0, 0), (True, 0, 1.0)), "Line.end = (True, 0, 1.0): expected 3 finite"),
    "d1 along the line": (lambda: cf.Line((0, 0, 0), (0, 0, 1), d1=(0, 0, 2)), "Line.d1"),
    "rod without material": (lambda: cf.Rod(LINE, cf.Circle(0.1)), "Rod.material = None"),
    "rod with a place": (lambda: cf.Rod(LINE, cf.Circle(0.1), STEEL, name="b@2"), "a name without '@'"),
    "rod with a length": (lambda: cf.Rod(20.0, cf.Circle(0.1), STEEL), "Rod.curve = 20.0"),
    "rod with a diameter": (lambda: cf.Rod(LINE, 0.1, STEEL), "Rod.section = 0.1"),
    "station beyond the end": (lambda: ROD.at(1.5), "Rod.at(s) = 1.5: expected an arc length in [0, 1] m"),
    "text for a vector": (lambda: cf.Force(ROD.end, "10 kN"), 'finite numbers (N), such as (0, 0, "-10 kN")'),
    "number for a vector": (lambda: cf.Weight(9.81), "expected 3 finite numbers (m/s^2), such as (0, 0, -9.81)"),
    "letter for a direction": (lambda: cf.Roller(ROD.end, "z"), "numbers (direction), such as (0, 0, 1)"),
    "NaN load": (lambda: cf.Force(ROD.end, (0, 0, nan)), "Force.force = (0, 0, nan): expected 3 finite numbers (N)"),
    "load of two numbers": (lambda: cf.Moment(ROD.end, (0, 1)), "Moment.moment = (0, 1)"),
    "load on a rod": (lambda: cf.Force(ROD, (0, 0, 1)), "expected a station of it"),
    "offset": (lambda: cf.EccentricForce(ROD.end, (0, 0, 1), (0, 0, 0)), "EccentricForce.offset"),
    "gravity": (lambda: cf.Weight("down"), "Weight.gravity = 'down'"),
    "no rods": (lambda: cf.Scene([], [CLAMP]), "Scene.rods is empty"),
    "a rod, not a list": (lambda: cf.Scene(ROD, [CLAMP]), "expected a list"),
    "same name twice": (lambda: cf.Scene([ROD, cf.Rod(LINE, cf.Circle(1), STEEL, name="rod")], [CLAMP]), "named 'rod'"),
    "nothing supported": (lambda: solved(cf.Scene([ROD], [])), "nothing holds rod 'rod', it is free to move"),
    "one of two supported": (lambda: solved(cf.Scene([ROD, OTHER], [CLAMP])), "nothing holds rod 'other'"),
    "no support at all": (lambda: cf.Scene([ROD], [ROD.start]), "Scene.supports[0]"),
    "support elsewhere": (lambda: cf.Scene([ROD], [cf.Clamp(OTHER.start)]), "a rod that is not in the scene"),
    "load elsewhere": (lambda: cf.Scene([ROD], [CLAMP], [cf.Force(OTHER.end, (0, 0, 1))]),
                       "other.end, a station of a rod"),
    "load is a class": (lambda: cf.Scene([ROD], [CLAMP], [cf.Force]), "Scene.loads[0]"),
    "weight without mass": (lambda: cf.Scene([ROD], [CLAMP], [cf.Weight()]), "Material.density = None"),
    "step control": (lambda: cf.StepControl(first=0), "StepControl.first = 0"),
    "step control smallest": (lambda: cf.StepControl(smallest=2), "StepControl.smallest = 2"),
    "step control largest": (lambda: cf.StepControl(largest=-1.0), "StepControl.largest = -1.0"),
    "step control iterations": (lambda: cf.StepControl(max_iterations=0), "StepControl.max_iterations = 0"),
}  # fmt: skip


test_refused = pytest.mark.serial(refuses(REFUSED))


ARGUMENTS = {
    "load factors of no kind": (dict(load_factors=None), "load_factors = None: expected numbers"),
    "no load factors": (dict(load_factors=[]), "load_factors is empty"),
    "NaN load factor": (dict(load_factors=[0.5, nan]), "load_factors holds nan: expected finite numbers"),
    "infinite load factor": (dict(load_factors=(0, inf)), "load_factors holds inf"),
    "text load factor": (dict(load_factors=["1"]), "load_factors holds '1'"),
    "model": (dict(model="spacial"), "model = 'spacial': did you mean 'spatial'?"),
    "formulation": (dict(formulation="mixt"), "formulation = 'mixt': did you mean 'mixed'?"),
    "degree": (dict(degree=7), "degree = 7: expected 1, 2, 3 or 4"),
    "elements": (dict(elements=0), "elements = 0"),
    "tol": (dict(tol=0), "tol = 0"),
    "tol is NaN": (dict(tol=nan), "tol = nan"),
    "gauss points": (dict(gauss_points=0), "gauss_points = 0"),
    "scene": (dict(scene=[ROD]), "expected a Scene"),
    "scene and settings": (dict(scene=(column()[1], {})), "scene is a tuple: expected a Scene"),
    "infinite": (dict(scene=column(section=cf.Stiffness((inf, inf), inf, (1.0, 1.0), 1.0))[1],
                      formulation="displacement"), "cannot take an infinite stiffness"),
    **{f"pair {given}": (dict(load_factors=given), f"load_factors = {given!r}: expected a tuple (a, b), between which")
       for given in ((0, 1, 2), (1,), (), "0:1")},
}  # fmt: skip


test_arguments_refused = pytest.mark.serial(
    refuses(ARGUMENTS, lambda arguments: cf.solve(**{"scene": column()[1], "load_factors": [0.1], **arguments}))
)


@pytest.mark.serial
@pytest.mark.parametrize("given", [0.1, np.float64(0.1), np.array(0.1), np.array([0.1]), [0.1], iter([0.1]), range(1)])
def test_load_factors_in_many_guises(given):
    _, scene = column()
    expected = [0.0] if isinstance(given, range) else [0.1]
    assert cf.solve(scene, given, elements=2, degree=1).load_factors.tolist() == expected


def test_not_converged_keeps_the_partial_path():
    """One Newton iteration is never enough."""
    _, scene = column()
    with pytest.raises(cf.NotConverged) as refusal:
        cf.solve(scene, [0.0, 0.5, 1.0], elements=4, steps=cf.StepControl(max_iterations=1), control="load")
    assert refusal.value.path.load_factors.tolist() == [0.0]
    assert "Newton's iterations ran out" in str(refusal.value)


def test_accuracy_that_cannot_be_met_is_refused(monkeypatch):
    from cosserat_fenicsx.statics import refinement

    monkeypatch.setattr(refinement, "_REFINEMENT", refinement.Refinement(most_elements=32))
    _, scene = column()
    with pytest.raises(cf.NotConverged, match="the accuracy tol = 1e-06 was not reached with 48 elements") as refusal:
        cf.solve(scene, [1.5], degree=1)
    assert refusal.value.path.error[0] > 1e-6


def test_interruption_keeps_what_is_done():
    from cosserat_fenicsx.statics.path.follower import Follower
    from cosserat_fenicsx.statics.path.load_control import Continuation

    _, scene = column()
    whole = Continuation._attempt

    def attempt(self, eta, **arguments):
        if eta > 0.6:
            raise KeyboardInterrupt
        return whole(self, eta, **arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Follower, "sweeps", False)
        patch.setattr(Continuation, "_attempt", attempt)
        with pytest.raises(cf.Interrupted) as stop:
            cf.solve(scene, [0.25, 0.5, 0.75, 1.0], elements=4)
    assert stop.value.path.load_factors.tolist() == [0.25, 0.5]


@pytest.mark.serial
def test_sections():
    """Against closed forms; the torsion of rectangles against Timoshenko & Goodier's table (0.1406, 0.2287, 0.3123)."""
    steel = cf.Material(E=2.6, nu=0.3)  # G = 1
    for ratio, factor in ((1, 0.1406), (2, 0.2287), (10, 0.3123)):
        for b, h in ((ratio, 1.0), (1.0, ratio)):
            assert cf.Rectangle(b, h).stiffness(steel).torsion == pytest.approx(factor * ratio, rel=4e-4)
    wide = cf.Rectangle(3.0, 1.0).stiffness(steel)  # width along d_1: stiff about d_2
    np.testing.assert_allclose(wide.bending, [2.6 * 3 / 12, 2.6 * 27 / 12])
    solid, tube = cf.Circle(0.2).stiffness(steel), cf.Tube(0.2, 0.2 * 1e-9).stiffness(steel)
    np.testing.assert_allclose(tube.shear, solid.shear)
    np.testing.assert_allclose(solid.shear[0], 6 * 1.3 / (7 + 6 * 0.3) * solid.axial / 2.6)
    thin = cf.Tube(1.0, 0.999999).stiffness(steel)
    np.testing.assert_allclose(thin.shear[0] / (thin.axial / 2.6), 2 * 1.3 / (4 + 3 * 0.3), rtol=1e-5)


@pytest.mark.serial
def test_frames_of_a_line():
    np.testing.assert_allclose(LINE.frame(0.0), np.eye(3))
    for end in ((1, 2, -2), (0, 0, -1), (1e-9, 0, -1), (-3, 1, 0)):
        R = cf.Line((0, 0, 0), end).frame(np.array([0.1]))[0]
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-14)
        assert np.linalg.det(R) == pytest.approx(1)
        np.testing.assert_allclose(R[:, 2], np.array(end) / np.linalg.norm(end))


@pytest.mark.serial
def test_what_looks_like_a_slip_is_asked_about():
    """Warnings about a forgotten joint, a section in mm, a modulus in MPa;
    none where two rods are supported at one point, or joined."""

    def scene(across=0.1, E=210e9, joints=(), clamps=("start", "end")):
        steel, section = cf.Material(E, density=7850.0), cf.Rectangle(across, across)
        one = cf.Rod(cf.Line((0, 0, 0), (0, 0, 4)), section, steel, name="one")
        two = cf.Rod(cf.Line((0, 0, 4), (5, 0, 4)), section, steel, name="two")
        held = [cf.Clamp(one.start), cf.Clamp(two.end)] + [cf.Clamp(one.end), cf.Clamp(two.start)] * ("both" in clamps)
        joined = [cf.Joint(one.end, two.start)] if joints else []
        return cf.Scene([one, two], held, [cf.Force(two.at(2.5), (0, 0, -1.0))], joined)

    assert scene().doubts == (
        "one.end and two.start lie at one point and are not joined: if they should be, add Joint(one.end, two.start)",
    )
    assert scene(joints=True).doubts == () == scene(clamps="both").doubts
    thick = scene(across=100, joints=True)
    assert "rod 'one' is 100 m across and 4 m long: are all lengths in m?" in thick.doubts
    assert ["of solid metal" in scene(across=a, joints=True).doubts[0] for a in (2.0, 3.0)] == [True, True]
    wall = cf.Rod(cf.Line((0, 0, 0), (0, 0, 4)), cf.Tube(0.1, 0.005), cf.Material(210e9), name="one")
    assert cf.Scene([wall], [cf.Clamp(wall.start)]).doubts == (
        "the tube of rod 'one' has a wall of 0.0475 m: its second number is the inner diameter; a wall of 0.005 m is "
        "Tube(0.1, 0.09)",
    )
    soft = scene(E=210e3, joints=True)
    assert "are the units SI" in soft.cautions[0]
    with pytest.raises(
        cf.SceneError, match=r"at most 0.5 EA = 1.05e\+03 N, where E = 210000 Pa of a material of 7850 kg"
    ):
        cf.solve(scene(E=210e3, joints=True), 1e6)
    path = cf.solve(scene(), [1.0])
    assert any("add Joint(one.end, two.start)" in why for why in path.why)


def test_an_end_on_a_rod_without_a_joint_is_asked_about():
    """Between the ends of straight and of curved rods, in a frame that is held together elsewhere, nearly there; not
    where it is joined, through another rod too, nor where both are held."""
    steel, section = cf.Material(210e9, density=7850.0), cf.Circle(0.1)
    points = [(0, 0, 0), (1, 0, 1), (2, 0, 1.2), (3, 0, 1), (4, 0, 0)]
    arch = cf.Rod(cf.Spline(points), section, steel, name="arch")
    beam = cf.Rod(cf.Line((0, 0, 0), (4, 0, 0)), section, steel, name="beam")

    def post(on, s, name="post", above=(0, 0, 0)):
        top = on.curve.position(s) + above
        return cf.Rod(cf.Line(top - (0, 0, 2), top), section, steel, name=name)

    def doubts(*rods, joints=(), held=()):
        supports = [cf.Clamp(x) for x in (rods[0].start, *held)]
        return cf.Scene(rods, supports, joints=[cf.Joint(*ends) for ends in joints]).doubts

    on_arch, on_beam, low = post(arch, 2.1), post(beam, 1.3), post(beam, 1.3, above=(0, 0, -0.001))
    asked = "post.end lies on rod '{0}' and is not joined to it: if it should be, add Joint(post.end, {0}@{1})"
    assert doubts(arch, on_arch, held=[on_arch.start]) == (asked.format("arch", 2.1),)
    assert doubts(beam, on_beam, held=[on_beam.start]) == (asked.format("beam", 1.3),)
    assert doubts(beam, low, held=[low.start]) == (
        "post.end is 0.001 m from beam@1.3, less than either measures across, and not joined to it: if it should be, "
        "move it to (1.3, 0, 0) and add Joint(post.end, beam@1.3)",
    )
    other = cf.Rod(cf.Line(on_beam.curve.end, (1.3, 1, 0)), section, steel, name="other")
    assert doubts(beam, on_beam, other, joints=[(on_beam.end, beam.at(1.3)), (other.start, on_beam.end)]) == ()
    assert len(doubts(beam, on_beam, other, held=[other.end], joints=[(other.start, on_beam.end)])) == 1
    assert doubts(beam, on_beam, held=[on_beam.end, beam.at(1.3)]) == ()
    more = cf.Rod(cf.Line(on_beam.curve.end, (1.3, -1, 0)), section, steel, name="more")
    assert len(doubts(on_beam, other, more, joints=[(other.start, on_beam.end)])) == 1
    assert doubts(beam, post(beam, 1.3, above=(0, 0.04, 0)), held=["post.start"]) == ()
    tie = cf.Rod(cf.Line((4, 0, 0), (0, 0, 0)), section, steel, name="tie")
    (asked,) = doubts(arch, tie, joints=[(arch.end, tie.start)])
    assert "arch.start and tie.end lie at one point and are not joined" in asked
    many = [post(beam, s, f"post_{i}") for i, s in enumerate(np.linspace(0.5, 3.5, 9))]
    assert doubts(beam, *many, held=[x.start for x in many])[-1] == (
        "4 more ends of rods lie on other rods and are not joined to them"
    )


def test_a_load_per_length_is_measured_on_its_own_rod_and_drag_is_no_load():
    steel, line = cf.Material(210e9, 0.3), cf.Line((0, 0, 0), (0, 0, 5000))
    long = cf.Rod(line, cf.Circle(0.1), steel, name="long")
    short = cf.Rod(cf.Line((1, 0, 0), (1.1, 0, 0)), cf.Circle(0.1), steel, name="short")
    loads = [cf.LineForce(short, (0, 0, 1e6)), cf.Drag(long, normal=61.0, current=(1.0, 0, 0))]
    scene = cf.Scene([long, short], [cf.Clamp(long.start), cf.Clamp(short.start)], loads)
    shares = [x.share for x in scene.magnitudes[:2]]
    np.testing.assert_allclose(shares, [1e5 / (0.5 * 210e9 * np.pi * 0.1**2 / 4), 0.0], rtol=1e-12)


DEMO = Path(__file__).parent.parent / "demos" / "eccentric_cantilever.toml"


def test_the_file_gives_the_same_path_as_python():
    found = cf.read(DEMO)
    scene, settings = found.scene, found.settings
    rod, expected = column()
    assert scene.title and settings["tol"] == 1e-6
    a = cf.solve(scene, [0.9], elements=4).displacement(scene.rods[0].end)
    b = cf.solve(expected, [0.9], elements=4).displacement(rod.end)
    np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-12)


CHANGES = {
    "unknown key": ("diameter = 0.2", "diametre = 0.2",
                    "rods[0].section (Circle): unknown key 'diametre', did you mean 'diameter'?"),
    "unknown table": ("[[supports]]", "[[suports]]", "unknown key 'suports', did you mean 'supports'?"),
    "key of another table": ("diameter = 0.2", "diameter = 0.2, bound = 1",
                             "(Circle): unknown key 'bound', which is a key of [solve]"),
    "unknown type": ('type = "Clamp"', 'type = "Clmap"', "supports[0].type = 'Clmap'"),
    "unknown solve key": ("tol = 1e-6", "tolerance = 1e-6", "[solve]: unknown key 'tolerance', did you mean 'tol'?"),
    "type error": ("diameter = 0.2", 'diameter = "0.2"', "Circle.diameter = '0.2': expected a unit"),
    "type error in solve": ("tol = 1e-6", 'tol = "small"', "solve.tol = 'small': expected a finite number"),
    "missing key": (", diameter = 0.2", "", "'diameter' is missing"),
    "unknown station": ('station = "column.start"', 'station = "colum.start"',
                        "no rod is named 'colum', did you mean 'column'?"),
    "unknown place": ('station = "column.start"', 'station = "column.top"',
                      "expected 'rod.start', 'rod.end' or 'rod@s'"),
    "station is a number": ('station = "column.start"', "station = 3", "supports[0]: Clamp.station = 3"),
    "beyond the end": ('station = "column.start"', 'station = "column@21"', "expected an arc length in [0, 20] m"),
    "unknown material": ('material = "steel"', 'material = "steal"', "did you mean 'steel'?"),
    "no array": ("[[supports]]", "[supports]", "expected an array of tables, [[supports]]"),
    "not TOML": ("[[supports]]", "[[supports", "not valid TOML"),
    "vector": ("force = [0, 0, -101739.34535723379]", "force = [0, -1.0]",
               "Force.force = [0, -1.0]: expected 3 finite numbers (N)"),
    "no duration": ("[solve]", "[simulate]\ndt = 0.1\n[solve]", "[simulate]: 'duration' is missing"),
    "unknown simulate key": ("[solve]", "[simulate]\nduration = 1\nduratoin = 2\n[solve]",
                             "[simulate]: unknown key 'duratoin'"),
    "text for a duration": ("[solve]", "[simulate]\nduration = 'long'\n[solve]",
                            "simulate.duration = 'long': expected a number"),
    "parts of elements": ("[solve]", "[simulate]\nduration = 1\nelements = 2.5\n[solve]",
                          "simulate.elements = 2.5: expected a whole number"),
    "title": ('title = "Eccentrically compressed cantilever"', "title = 3", "title = 3: expected a text"),
}  # fmt: skip


@pytest.mark.serial
@pytest.mark.parametrize("case", CHANGES)
def test_refused_changes(case, tmp_path):
    old, new, words = CHANGES[case]
    text = DEMO.read_text(encoding="utf-8")
    assert old in text
    file = tmp_path / "scene.toml"
    file.write_text(text.replace(old, new))
    with pytest.raises(cf.SceneError) as refusal:
        cf.read(file)
    assert words in str(refusal.value) and str(file) in str(refusal.value)


MOTION = f"""{DEMO.read_text(encoding="utf-8").partition("[solve]")[0]}[simulate]
duration = "1 s"
"""
WELL = """[well]
stations = [[0, 0, 0], [1000, 0, 0]]
sections = [{ to = 1000.0, diameter = "8.5 in", friction = 0.3 }]

[string]
components = [{ type = "DrillPipe", size = "5 in 19.50 lb/ft" }]

[mud]
density = "10 ppg"
"""
WELLS = (
    WELL
    + """
[[operations]]
type = "TripIn"
"""
)
DRILLING = (
    WELL
    + """
[drive]
speed = "60 rpm"
"""
)
FILES = {"rods": DEMO.read_text(encoding="utf-8"), "motion": MOTION, "well": WELLS, "drilling": DRILLING}
MISTAKES = [
    ("rods", 'station = "column.end"\nforce', 'sation = "column.end"\nforce',
     (21, 1, "'sation', did you mean 'station'")),
    ("rods", "diameter = 0.2", 'diameter = "0.2 psi"', (12, 30, "psi is a unit of pressure, expected one of length")),
    ("rods", "[solve]", "[solve]\n[solve]", (30, 1, "[solve] is given twice, first at line 29, column 1")),
    ("rods", "[[rods]]", "[rods]\n[[rods]]", (10, 1, "[[rods]] is given twice, first at line 9, column 1")),
    ("motion", "duration =", "durration =", (30, 1, "[simulate]: unknown key 'durration', did you mean 'duration'")),
    ("motion", '"1 s"', '"1 m"', (30, 1, "m is a unit of length, expected one of time")),
    ("motion", '"1 s"', '"1 s"\nduration = 2', (31, 1, "simulate.duration is given twice, first at line 30, column 1")),
    ("well", "friction", "fricton", (3, 49, "unknown key 'fricton', did you mean 'friction'")),
    ("well", "10 ppg", "10 psi", (9, 1, "psi is a unit of pressure, expected one of density")),
    ("well", "[mud]", "[well]\n[mud]", (8, 1, "[well] is given twice, first at line 1, column 1")),
    ("well", "to = 1000.0", "to = 1000.0, to = 1",
     (3, 28, "well.sections[0].to is given twice, first at line 3, column 15")),
    ("drilling", "speed =", "sped =", (12, 1, "drive (TopDrive): unknown key 'sped', did you mean 'speed'")),
    ("drilling", "60 rpm", "60 ft", (12, 1, "ft is a unit of length, expected one of angular velocity")),
    ("drilling", "[drive]", "[drive]\n[[drive]]", (12, 1, "[[drive]] is given twice, first at line 11, column 1")),
]  # fmt: skip


@pytest.mark.serial
@pytest.mark.parametrize(("kind", "old", "new", "expected"), MISTAKES)
def test_mistakes_are_refused_with_their_places(kind, old, new, expected, tmp_path):
    """An unknown key, a unit of another dimension and what is given twice, in every kind of scene file."""
    text, file = FILES[kind], tmp_path / "scene.toml"
    line, column, words = expected
    assert old in text
    file.write_text(text, encoding="utf-8")
    cf.read(file)
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(cf.SceneError) as refusal:
        cf.read(file)
    assert str(refusal.value).startswith(f"{file}, line {line}, column {column}: ") and words in str(refusal.value)


@pytest.mark.serial
@pytest.mark.parametrize(
    ("text", "line", "column"),
    [("[a\n", 1, 3), ("a = 1\n[a]\n[b\n", 2, 1), ("a = {}\n[a.b]\n", 2, 5), ("x = 5 m\n", 1, 7), ("[[a]]\n[a]", 2, 1)],
)
def test_what_is_no_toml_is_refused_with_its_place(text, line, column, tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(cf.SceneError) as refusal:
        cf.read(file)
    assert str(refusal.value).startswith(f"{file}, line {line}, column {column}: ")


@pytest.mark.serial
@pytest.mark.parametrize(("text", "quoted"), [
    ("force = [0, 0, -20 kN]", "-20 kN"), ("force = -20 kN # down", "-20 kN"), ("a = { d = 1.5e2mm }", "1.5e2mm"),
    ("load_factors = 0.5:1", "0.5:1"), ("a = [1,\n 8 1/2 in,\n 3]", "8 1/2 in"), ("# kN \u2028\na = 5 m", "5 m"),
])  # fmt: skip
def test_numbers_with_units_are_quoted(text, quoted, tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(text, encoding="utf-8")
    with refused(f'not valid TOML: expected quotes, "{quoted}"; text, and a number with its unit, stand in quotes'):
        cf.read(file)


@pytest.mark.serial
def test_marks_and_encodings_of_editors(tmp_path):
    """A mark at the beginning of UTF-8 is skipped; other encodings are named."""
    text = DEMO.read_text(encoding="utf-8").replace("Eccentrically", "B\u00fcgel")
    (tmp_path / "marked.toml").write_text(text, encoding="utf-8-sig")
    assert cf.read(tmp_path / "marked.toml").scene.title.startswith("B\u00fcgel")
    (tmp_path / "latin.toml").write_text(text, encoding="latin-1")
    with pytest.raises(cf.SceneError, match="latin.toml: not UTF-8 .*: save it as UTF-8"):
        cf.read(tmp_path / "latin.toml")


HEAVY = cf.Material(E=210e9, density=7850.0)
FRAME = """
rods = [
  { name = "post", curve = { type = "Line", start = [0, 0, 0], end = [0, 0, 2] }, section = { type = "Circle", diameter = 0.02 }, material = { E = 210e9, density = 7850.0 } },
]
supports = [{ type = "Clamp", station = "post.start" }]
loads = [{ type = "Force", station = "post.end", force = [10, 0, 0] }]
solve = { load_factors = "0:1", elements = 2, degree = 2 }
"""  # noqa: E501


def rods():
    post = cf.Rod(cf.Line((0, 0, 0), (0, 0, 2)), cf.Circle(0.02), HEAVY, name="post")
    beam = cf.Rod(cf.Line((0, 0, 2), (1, 0, 2)), cf.Circle(0.02), HEAVY, name="beam")
    return [post, beam]


def framed(named=True):
    """Stations and rods are given by their names, or as objects."""
    post, beam = rods()
    ends = ("post.start", "post.end", "beam.start", "beam.end", "beam@0.5") if named else (
        post.start, post.end, beam.start, beam.end, beam.at(0.5))  # fmt: skip
    foot, head, inner, outer, middle = ends
    low, high = ("post", "beam") if named else (post, beam)
    loads = [
        cf.Force(middle, (0, 0, -5.0)),
        cf.LineForce(low, cf.signals.AlongTable([0, 2], [(0, 0, 0), (3.0, 0, 0)])),
        cf.Foundation(high, 10.0),
        cf.Wall(low, (0, 0, 0), (0, 0, 1), 0.5, 1e3),
        cf.Spring(head, stiffness=20.0),
        cf.Drag(low, 1.0, current=(1.0, 0, 0)),
    ]
    return cf.Scene([post, beam], [cf.Clamp(foot), cf.Roller(outer, (0, 0, 1))], loads, [cf.Joint(head, inner)])


@pytest.mark.serial
def test_names_and_objects_are_the_same():
    named, plain = (cf.solve(scene, [1.0], elements=2, degree=2) for scene in (framed(), framed(named=False)))
    np.testing.assert_array_equal(named.position("beam.end"), plain.position("beam.end"))
    for given in ("beam.end", named.scene.station("beam.end"), named.scene.supports[1]):
        np.testing.assert_array_equal(named.reaction(given), plain.reaction(plain.scene.supports[1]))
    with pytest.raises(cf.SceneError, match=r"post\.end is no support .*Clamp at post\.start, Roller at beam\.end"):
        named.reaction("post.end")


@pytest.mark.serial
def test_a_support_given_by_name_is_known_as_it_was_given():
    post = rods()[0]
    held = cf.Clamp("post.start")

    def push(t):
        return t, 0, 0

    loads = [cf.Force("post.end", push), cf.PointMass("post.end", 1.0)]
    scene = cf.Scene([post], [held], loads, velocities=[cf.InitialVelocity("post", angular=(0, 0, 0))])
    assert held.station == "post.start" and scene.supports[0].station == post.start
    assert scene.supports_of(held) == scene.supports_of(scene.supports[0]) == [0]
    assert scene.loads[0].force.place == "post.end" and scene.loads[0].force.function is push
    assert scene.loads[0].force(2.0) == (2.0, 0.0, 0.0) and scene.velocities[0].rod is post
    # the same parts belong to another scene too; and parts of a class of one's own are given by name as well
    other = rods()[0]
    assert cf.Scene([other], [held], loads).loads[0].station.rod is other
    assert cf.Scene([post], (), [Own("post.end")]).loads[0].station == post.end
    assert repr(framed(named=False)) == "<Scene: rods post, beam; 2 supports, 6 loads, 1 joints>"
    assert repr(post) == "<Rod 'post': Line, length 2 m>"


@dataclass(frozen=True)
class Own(cf.PointAction):
    station: object


REFUSED_NAMES = {
    "an unknown station": (lambda r: cf.Scene(r, [cf.Clamp("pots.start")]), "Scene.supports[0].station = 'pots.start'"),
    "its nearest": (lambda r: cf.Scene(r, [cf.Clamp("pots.start")]), "did you mean 'post'?"),
    "no station": (lambda r: cf.Scene(r, [cf.Clamp("post")]), "it is a rod, expected 'post.start', 'post.end' or"),
    "a load as a support": (lambda r: cf.Scene(r, [cf.Force("post.end", (0, 0, -1))]), "Force at post.end belongs in"),
    "a joint as a support": (lambda r: cf.Scene(r, [cf.Joint("post.end", "beam.start")]), "Joint belongs in joints="),
    "a list as a station": (lambda r: cf.Scene(r).station(["post.end"]), "station = ['post.end']: expected 'rod"),
    "an unknown rod": (lambda r: cf.Scene(r, (), [cf.Foundation("pier", 1.0)]), "Scene.loads[0].rod = 'pier'"),
    "a place inside a wall": (
        lambda r: cf.Scene(r, (), [cf.Wall("beam", (0, 0, 0), (0, 0, 1), 0.1)]), "rod 'beam' lies beyond its surface"),
    "a joint apart": (lambda r: cf.Scene(r, (), (), [cf.Joint("post.start", "beam.start")]), "they are 2 m apart"),
    "a number": (lambda r: cf.Clamp(3), "Clamp.station = 3: expected a station such as rod.end, or its name"),
    "of one's own": (lambda r: cf.Scene(r, (), [Own(3)]), "Scene.loads[0].station = 3: expected a station"),
    "another of its name": (lambda r: cf.Scene(r, [cf.Clamp(rods()[0].end)]),
                            "acts at post.end, of another rod that is named 'post' too"),
    "a rod for a station": (lambda r: cf.Clamp(r[0]),
                            "Line, length 2 m>: expected a station of it, such as 'post.start'"),
}  # fmt: skip


test_refused_names = pytest.mark.serial(refuses(REFUSED_NAMES, lambda make: make(rods())))


@pytest.mark.serial
def test_what_a_file_says_is_what_solve_takes(tmp_path):
    file = tmp_path / "post.toml"
    file.write_text(FRAME)
    found = cf.read(file)
    scene, settings = found.scene, found.settings
    assert settings["load_factors"] == (0.0, 1.0)
    path = cf.solve(scene, **settings)
    assert path.load_factors[-1] == 1.0
    assert (cf.solve(scene, elements=2, degree=2).load_factors == path.load_factors).all()
    file.write_text(FRAME.replace("0:1", "0.25,1"))
    assert cf.read(file).settings["load_factors"] == [0.25, 1.0]
    file.write_text(FRAME.replace("0:1", "0:1:2"))
    with pytest.raises(cf.SceneError, match="load factors '0:1:2': expected A:B"):
        cf.read(file)


def test_one_point_of_a_path_is_a_path():
    path = cf.solve(framed(), [0.5, 1.0], elements=1, degree=2)
    last, both = path[-1], path[:]
    assert type(last) is type(path) and last.load_factors.tolist() == [1.0] and len(both) == 2
    np.testing.assert_array_equal(last.position("post.end")[0], path.position("post.end")[1])
    assert [part.load_factors[0] for part in path] == [0.5, 1.0]
    with pytest.raises(IndexError, match=r"\[2\]: expected the index of a load factor, a whole number from -2 to 1"):
        path[2]


def soft():
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Circle(0.02), cf.Material(E=210.0, density=1.0), name="rod")
    return cf.Scene([rod], [cf.Clamp("rod.start")], [cf.Force("rod.end", (1e-9, 0, 0))])


@pytest.mark.serial
def test_a_probable_mistake_in_units_is_a_warning_where_the_caller_is():
    for call in (lambda: cf.solve(soft(), 1.0, elements=1), lambda: cf.simulate(soft(), 0.01, dt=0.01, elements=1)):
        with pytest.warns(cf.SceneWarning, match="E = 210 Pa is softer than most rubbers") as told:
            call()
        assert told[0].filename == __file__


@pytest.mark.serial
def test_moduli_that_no_metal_has_are_asked_about_and_soft_ones_are_not():
    """Steel typed in kPa, by its density or as a rolled profile; rubber, catheter and titanium are not asked about."""

    def doubts(E, density, section=None):
        rod = cf.Rod(cf.Line((0, 0, 0), (3, 0, 0)), section or cf.Circle(0.01), cf.Material(E, 0.3, density), name="r")
        return cf.Scene([rod], [cf.Clamp(rod.start)]).doubts

    assert "E = 2.1e+08 Pa of a material of 7850 kg/m^3 is less" in doubts(210e6, 7850.0)[0]
    assert "E = 2.1e+08 Pa of a rolled profile is less" in doubts(210e6, None, cf.Profile("IPE 200"))[0]
    assert "is more than" in doubts(210e12, 7850.0)[0]
    for E, density in ((210e9, 7850.0), (2e6, 1100.0), (200e6, 1050.0), (110e9, 4500.0), (16e9, 11340.0)):
        assert doubts(E, density) == ()


@pytest.mark.serial
def test_profiles_that_nobody_turned_into_the_plane_are_asked_about():
    """A post of a plane frame bends about its weak axis by default; not a bar that no load bends, nor one with d1."""
    steel = cf.Material(210e9)

    def doubts(force, top=(0, 0, 3), **d1):
        rod = cf.Rod(cf.Line((0, 0, 0), top, **d1), cf.Profile("HEA 160"), steel, name="post")
        return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, force)]).doubts

    (doubt,) = doubts((1e3, 0, -1e3))
    assert "weaker axis in the x-z plane: 'post': d1 = (0, 1, 0) of the curve" in doubt
    assert doubts((0, 0, -1e3)) == doubts((1e3, 0, 0), d1=(1, 0, 0)) == doubts((1e3, 0, 0), d1=(0, 1, 0)) == ()
    assert doubts((0, 0, 1.0), top=(3, 0, 0)) == ()  # a beam stands upright
    assert "'post' of HEA 160 is 3000 m long: are all lengths in m (of" in doubts((0, 0, 1.0), top=(3000, 0, 0))[0]
    light = cf.Rod(cf.Line((0, 0, 0), (0, 0, 3)), cf.Circle(0.1), cf.Material(E=210e9, density=7.85))
    (doubt,) = cf.Scene([light], [cf.Clamp(light.start)]).doubts
    assert "a density of 7.85 kg/m^3 with E of a metal: is it in g/cm^3" in doubt


def test_sections_that_nobody_turned_are_told():
    def told(section, **d1):
        rod = cf.Rod(cf.Line((0, 0, 0), (3, 0, 0), **d1), section, cf.Material(E=210e9, nu=0.3), name="beam")
        return cf.Scene([rod], [cf.Clamp(rod.start)]).by_default

    (sentence,) = told(cf.Rectangle(0.1, 0.2))
    assert "stand upright by default" in sentence and "'beam'; `d1=`" in sentence
    assert told(cf.Rectangle(0.1, 0.2), d1=(0, 1, 0)) == told(cf.Circle(0.1)) == told(cf.Rectangle(0.1, 0.1)) == []
