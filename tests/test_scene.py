"""Invalid input: every message names the field, its value and what was expected."""

import math

import numpy as np
import pytest
from conftest import column

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
    "d1 along the line": (lambda: cf.Line((0, 0, 0), (0, 0, 1), d1=(0, 0, 2)), "Line.d1"),
    "rod without material": (lambda: cf.Rod(LINE, cf.Circle(0.1)), "Rod.material = None"),
    "rod with a length": (lambda: cf.Rod(20.0, cf.Circle(0.1), STEEL), "Rod.curve = 20.0"),
    "rod with a diameter": (lambda: cf.Rod(LINE, 0.1, STEEL), "Rod.section = 0.1"),
    "station beyond the end": (lambda: ROD.at(1.5), "Rod.at(s) = 1.5: expected an arc length in [0, 1] m"),
    "NaN load": (lambda: cf.Force(ROD.end, (0, 0, nan)), "Force.force = (0, 0, nan): expected 3 finite numbers (N)"),
    "load of two numbers": (lambda: cf.Moment(ROD.end, (0, 1)), "Moment.moment = (0, 1)"),
    "load on a rod": (lambda: cf.Force(ROD, (0, 0, 1)), "a station such as rod.end"),
    "offset": (lambda: cf.EccentricForce(ROD.end, (0, 0, 1), (0, 0, 0)), "EccentricForce.offset"),
    "gravity": (lambda: cf.Weight("down"), "Weight.gravity = 'down'"),
    "no rods": (lambda: cf.Scene([], [CLAMP]), "Scene.rods is empty"),
    "a rod, not a list": (lambda: cf.Scene(ROD, [CLAMP]), "expected a list"),
    "same name twice": (lambda: cf.Scene([ROD, cf.Rod(LINE, cf.Circle(1), STEEL, name="rod")], [CLAMP]), "named 'rod'"),
    "nothing supported": (lambda: solved(cf.Scene([ROD], [])), "nothing holds rod 'rod', it is free to move"),
    "one of two supported": (lambda: solved(cf.Scene([ROD, OTHER], [CLAMP])), "nothing holds rod 'other'"),
    "no support at all": (lambda: cf.Scene([ROD], [ROD.start]), "Scene.supports[0]"),
    "support elsewhere": (lambda: cf.Scene([ROD], [cf.Clamp(OTHER.start)]), "a rod that is not in the scene"),
    "load elsewhere": (
        lambda: cf.Scene([ROD], [CLAMP], [cf.Force(OTHER.end, (0, 0, 1))]),
        "other.end, a station of a rod",
    ),
    "load is a class": (lambda: cf.Scene([ROD], [CLAMP], [cf.Force]), "Scene.loads[0]"),
    "weight without mass": (lambda: cf.Scene([ROD], [CLAMP], [cf.Weight()]), "Material.density = None"),
    "step control": (lambda: cf.StepControl(first=0), "StepControl.first = 0"),
    "step control smallest": (lambda: cf.StepControl(smallest=2), "StepControl.smallest = 2"),
    "step control largest": (lambda: cf.StepControl(largest=-1.0), "StepControl.largest = -1.0"),
    "step control iterations": (lambda: cf.StepControl(max_iterations=0), "StepControl.max_iterations = 0"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case):
    make, words = REFUSED[case]
    with pytest.raises(cf.SceneError) as refusal:
        make()
    assert words in str(refusal.value)


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
}


@pytest.mark.parametrize("case", ARGUMENTS)
def test_arguments_refused(case):
    arguments, words = ARGUMENTS[case]
    _, scene = column()
    with pytest.raises(cf.SceneError) as refusal:
        cf.solve(scene, **{"load_factors": [0.1], **arguments})
    assert words in str(refusal.value)


@pytest.mark.parametrize("given", [0.1, np.float64(0.1), np.array(0.1), np.array([0.1]), [0.1], iter([0.1]), range(1)])
def test_load_factors_in_many_guises(given):
    _, scene = column()
    expected = [0.0] if isinstance(given, range) else [0.1]
    assert cf.solve(scene, given, elements=2, degree=1).load_factors.tolist() == expected


def test_scene_refused():
    with pytest.raises(cf.SceneError, match="expected a Scene"):
        cf.solve([ROD], [1.0])


def test_infinite_stiffness_needs_a_contact_force_of_its_own():
    rod, scene = column(section=cf.Stiffness((inf, inf), inf, (1.0, 1.0), 1.0))
    with pytest.raises(cf.SceneError, match="cannot take an infinite stiffness"):
        cf.solve(scene, [0.5], formulation="displacement")


def test_not_converged_keeps_the_partial_path():
    """One Newton iteration is never enough."""
    _, scene = column()
    with pytest.raises(cf.NotConverged) as refusal:
        cf.solve(scene, [0.0, 0.5, 1.0], elements=4, steps=cf.StepControl(max_iterations=1), control="load")
    assert refusal.value.path.load_factors.tolist() == [0.0]
    assert "Newton's iterations ran out" in str(refusal.value)


def test_accuracy_that_cannot_be_met_is_refused(monkeypatch):
    from cosserat_fenicsx.statics import refinement

    monkeypatch.setattr(refinement, "_MOST_ELEMENTS", 32)
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


def test_frames_of_a_line():
    np.testing.assert_allclose(LINE.frame(0.0), np.eye(3))
    for end in ((1, 2, -2), (0, 0, -1), (1e-9, 0, -1), (-3, 1, 0)):
        R = cf.Line((0, 0, 0), end).frame(np.array([0.1]))[0]
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-14)
        assert np.linalg.det(R) == pytest.approx(1)
        np.testing.assert_allclose(R[:, 2], np.array(end) / np.linalg.norm(end))


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
    soft = scene(E=210e3, joints=True)
    assert "are the units SI" in soft.cautions[0]
    path = cf.solve(scene(), [1.0])
    assert any("add Joint(one.end, two.start)" in why for why in path.why)
    with pytest.raises(cf.SceneError, match="a name without '@'"):
        cf.Rod(cf.Line((0, 0, 0), (0, 0, 4)), cf.Circle(0.1), cf.Material(1e9), name="b@2")
    with pytest.raises(cf.SceneError, match="scene is a tuple: expected a Scene"):
        cf.solve((scene(), {}), [1.0])
