"""Formulations, contact laws and loads that are defined outside the package, each in one file of tests/extensions."""

import numpy as np
import pytest
from extensions.augmented import Augmented
from extensions.hardening import Hardening
from extensions.pressure import AcrossRod

import cosserat_fenicsx as cf
from cosserat_fenicsx.numerics import directors

SECTION = cf.Stiffness((1e4, 1e4), 2e4, (10.0, 8.0), 7.0, mass=1.0, inertia=(0.1, 0.1, 0.2))
ROD = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), SECTION, name="column")
BENT = cf.Scene([ROD], [cf.Clamp(ROD.start)], [cf.Force(ROD.end, (3.0, 4.0, -15.0))])


@pytest.mark.slow
def test_a_formulation(tmp_path_all):
    """By its name and as a class; the penalty vanishes at the solution, which is that of the multiplier form."""
    options = {"elements": 4, "model": "spatial"}
    path, same = (cf.solve(BENT, [0.5, 1.0], formulation=x, **options) for x in ("augmented", Augmented))
    expected = cf.solve(BENT, [0.5, 1.0], formulation="multiplier", **options)
    np.testing.assert_allclose(path.position(ROD.end), expected.position(ROD.end), rtol=1e-9)
    np.testing.assert_array_equal(path.position(ROD.end), same.position(ROD.end))
    np.testing.assert_allclose(path.moment(ROD.start), expected.moment(ROD.start), rtol=1e-7)
    assert path.formulation == "augmented" and any("a multiplier and a penalty" in why for why in path.why)
    path.save(tmp_path_all / "path.h5")
    assert cf.read_path(tmp_path_all / "path.h5").formulation == "augmented"
    with pytest.raises(cf.SceneError, match="did you mean 'augmented'"):
        cf.solve(BENT, [1.0], formulation="augmentd")


def pressed(law, **wall):
    """A rod that its guides keep straight, pressed on a bed of 100 N/m^2 and against a wall of 1e3 N/m^2 by 8 N/m."""
    guides = [cf.Roller(ROD.start, axis) for axis in ((0, 0, 1.0), (0, 1.0, 0))]
    guides += [cf.Prescribed(station, rotation=(0, 0, 0)) for station in (ROD.start, ROD.end)]
    wall = cf.Wall(ROD, (0, 0, 0), (0, 0, 1.0), clearance=0.01, stiffness=1e3, law=law)
    return cf.Scene([ROD], guides, [cf.LineForce(ROD, (8.0, 0, 0)), cf.Foundation(ROD, 100.0), wall])


@pytest.mark.parametrize("model", ["planar", "spatial"])
def test_a_contact_law(model):
    """Bed and wall together balance the load; without a law the wall's part is k d."""
    for law, growth in ((Hardening(0.004), 1 / 0.004), (None, 0.0)):
        path = cf.solve(pressed(law), [1.0], elements=2, model=model)
        u = path.displacement(ROD.at(0.5))[0, 0]
        depth = u - 0.01
        assert depth > 1e-3
        assert 100.0 * u + 1e3 * depth * (1 + growth * depth) == pytest.approx(8.0, rel=1e-6)


def test_a_contact_law_in_motion():
    """A rod that flies against the wall comes to rest where k d^2/2 (1 + 2 d/(3 a)) is its energy, here and across."""
    k, a, v = 1e3, 0.004, 0.2
    scene = cf.Scene(
        [ROD], [], [cf.Wall(ROD, (0, 0, 0), (0, 0, 1.0), clearance=1e-4, stiffness=k, law=Hardening(a))],
        velocities=[cf.InitialVelocity(ROD, linear=(v, 0, 0))],
    )  # fmt: skip
    history = cf.simulate(scene, 0.2, dt=2e-4, elements=1, degree=2)
    depth = history.displacement(ROD.at(0.5))[:, 0].max() - 1e-4
    assert k * depth**2 * (1 + 2 * depth / (3 * a)) == pytest.approx(v**2, rel=1e-3)
    assert history.displacement(ROD.end)[:, 0].min() == pytest.approx(-depth - 1e-4, rel=1e-3)


def test_a_law_is_refused_in_words():
    with pytest.raises(cf.SceneError, match="Hardening.doubling = -1: expected a positive number"):
        Hardening(-1)
    with pytest.raises(cf.SceneError, match="Wall.law = 'stiff': expected Hardening"):
        pressed("stiff")


def test_a_load():
    """Across the rod in equilibrium and in motion: what holds it feels the sum of its force."""
    scene = cf.Scene([ROD], [cf.Clamp(ROD.start)], [AcrossRod(ROD, 2.0)])
    path = cf.solve(scene, [1.0], elements=4)
    s, weights = np.polynomial.legendre.leggauss(12)
    turned = [directors(path.rotation(ROD.at((1 + x) / 2)))[0, :, 0] for x in s]
    across = weights @ turned / 2
    np.testing.assert_allclose(path.reaction(scene.supports[0])[0][0], -2.0 * across, atol=1e-6)
    assert path.model == "planar"
    history = cf.simulate(scene, 0.05, dt=1e-3, elements=2)
    assert history.displacement(ROD.end)[-1, 0] > 0


HARD = cf.Wall(ROD, (0, 0, 0), (0, 0, 1.0), clearance=1e-3, stiffness=1e3, law=Hardening(0.004))


@pytest.mark.slow
@pytest.mark.parametrize("load", [pytest.param(AcrossRod(ROD, 2.0), marks=pytest.mark.serial), HARD])
def test_stored_and_resumed(load, tmp_path_all):
    """A motion that is ended early and resumed is the one that was not, to the last digit."""
    scene = cf.Scene([ROD], [cf.Clamp(ROD.start)], [cf.LineForce(ROD, (1.0, 0, 0)), load])
    options = {"dt": 1e-3, "elements": 2}
    cf.simulate(scene, 0.02, folder=tmp_path_all / "run", **options)
    resumed = cf.resume(tmp_path_all / "run", scene=scene, duration=0.04)
    whole = cf.simulate(scene, 0.04, **options)
    np.testing.assert_array_equal(resumed.position(ROD.end), whole.position(ROD.end))
    resumed.plot(tmp_path_all / "motion.png")
    cf.solve(scene, [0.5, 1.0], elements=4).plot(tmp_path_all / "shape.png")


FILE = """
use = ["extensions.augmented", "extensions.hardening", "extensions.pressure"]
[[rods]]
name = "column"
curve = { type = "Line", start = [0, 0, 0], end = [0, 0, 1] }
[rods.section]
type = "Stiffness"
shear = [1e4, 1e4]
axial = 2e4
bending = [10, 8]
torsion = 7
mass = 1
inertia = [0.1, 0.1, 0.2]
[[supports]]
type = "Clamp"
station = "column.start"
[[loads]]
type = "AcrossRod"
rod = "column"
pressure = "2 N/m"
[[loads]]
type = "Wall"
rod = "column"
point = [0, 0, 0]
direction = [0, 0, 1]
clearance = 1e-3
stiffness = 1e3
law = { type = "Hardening", doubling = "4 mm" }
"""
#: The same scene in Python.
SAME = cf.Scene([ROD], [cf.Clamp(ROD.start)], [AcrossRod(ROD, 2.0), HARD])


@pytest.mark.slow
@pytest.mark.serial  # ranks would write the file while others read it
def test_in_a_scene_file(tmp_path_all):
    """Load, law and formulation; a result is saved with its scene, and a motion resumed without a scene given."""
    file = tmp_path_all / "scene.toml"
    file.write_text(FILE + '[solve]\nload_factors = [1.0]\nelements = 4\nformulation = "augmented"\n')
    task = cf.read(file)
    path, scene = task.run(model="spatial"), task.scene
    expected = cf.solve(SAME, [1.0], model="spatial", elements=4, formulation=Augmented).position(ROD.end)
    np.testing.assert_array_equal(path.position("column.end"), expected)
    path.save(tmp_path_all / "path.h5")
    again = cf.read_path(tmp_path_all / "path.h5")
    np.testing.assert_array_equal(again.position("column.end"), path.position("column.end"))
    assert again.scene.loads[1].law == Hardening(0.004)
    cf.simulate(scene, 0.01, dt=1e-3, elements=2, folder=tmp_path_all / "run")
    resumed = cf.resume(tmp_path_all / "run", duration=0.02)
    whole = cf.simulate(SAME, 0.02, dt=1e-3, elements=2)
    np.testing.assert_array_equal(resumed.position("column.end"), whole.position(ROD.end))


@pytest.mark.serial
def test_mistakes_in_a_scene_file(tmp_path_all):
    file = tmp_path_all / "scene.toml"
    for wrong, words in (
        (("AcrossRod", "AcrosRod"), "did you mean 'AcrossRod'"),
        (("doubling", "doublin"), "did you mean 'doubling'"),
        (('"2 N/m"', '"2 N"'), "pressure = '2 N'"),
    ):
        file.write_text(FILE.replace(*wrong))
        with pytest.raises(cf.SceneError, match=words):
            cf.read(file)
