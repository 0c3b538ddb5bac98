"""Stresses of sections, against textbooks and finite elements, and along solved rods."""

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.results.queries import largest_in_words
from cosserat_fenicsx.scene import stresses
from cosserat_fenicsx.scene.stresses import rectangle_fibres

pytestmark = pytest.mark.serial
STEEL = cf.Material(E=210e9, nu=0.25)
ZERO = np.zeros(3)


def test_shear_stresses_of_a_rectangle_are_those_of_the_tables():
    """Timoshenko & Goodier: torsion tau = T/(alpha a b^2), flexure relative to 3 V/(2 A) at nu = 1/4."""
    for width, height, alpha, wide, narrow in ((1, 1, 0.208, 1.126, 1.126), (2, 1, 0.246, 1.396, 1.033),
                                               (4, 1, 0.282, 1.988, 1.008)):  # fmt: skip
        section = cf.Rectangle(width, height)
        tau = section.stresses(STEEL, ZERO, np.array([0, 0, 7.0])).von_mises / np.sqrt(3)
        assert 7.0 / (tau * width * height**2) == pytest.approx(alpha, abs=6e-4)
        for force, ratio in (((0, 5.0, 0), wide), ((5.0, 0, 0), narrow)):
            found = section.stresses(STEEL, np.array(force), ZERO)
            assert found.von_mises / np.sqrt(3) / (1.5 * 5.0 / (width * height)) == pytest.approx(ratio, abs=1e-3)
            assert found.axial_max == found.axial_min == 0.0


def test_turning_a_rectangle_changes_nothing():
    rng = np.random.default_rng(1)
    force, moment = rng.normal(size=(2, 20, 3))
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])  # d_1 where -d_2 was
    one = cf.Rectangle(0.3, 0.7).stresses(STEEL, force, moment)
    other = cf.Rectangle(0.7, 0.3).stresses(STEEL, force @ turn.T, moment @ turn.T)
    np.testing.assert_allclose(one, other, rtol=1e-12)


@pytest.mark.parametrize("section, R, r", [(cf.Circle(0.6), 0.3, 0.0), (cf.Tube(0.6, 0.5), 0.3, 0.25)])
def test_bending_torsion_and_tension_of_round_sections(section, R, r):
    """Without shear forces the outer circumference governs."""
    rng = np.random.default_rng(2)
    force, moment = rng.normal(size=(200, 3)) * [0, 0, 1], 0.3 * rng.normal(size=(200, 3))
    A, I = np.pi * (R**2 - r**2), np.pi * (R**4 - r**4) / 4
    bending, tau = R / I * np.hypot(moment[:, 0], moment[:, 1]), R / (2 * I) * moment[:, 2]
    found = section.stresses(STEEL, force, moment)
    np.testing.assert_allclose(found.axial_max, force[:, 2] / A + bending, rtol=1e-12)
    np.testing.assert_allclose(found.axial_min, force[:, 2] / A - bending, rtol=1e-12)
    np.testing.assert_allclose(
        found.von_mises, np.hypot(np.abs(force[:, 2]) / A + bending, np.sqrt(3) * tau), rtol=1e-9
    )


#: n and m, and the largest von Mises stresses of Circle(2), Tube(2, 1.6), Tube(2, 0.6), Rectangle(1, 3) by finite
#: elements (sectionproperties 3.10.2, nu = 0.3): shear alone governs in the centre, the bore and the inside.
BY_ELEMENTS = [
    ((1, 0, 0, 0, 0, 0), (0.76448, 3.32305, 1.60137, 1.56096)),
    ((0, 1, 0, 0, 0, 0), (0.76427, 3.32307, 1.60098, 0.88133)),
    ((-0.78190836, -0.25719224, 0.00814018, -0.27560291, 1.29406381, 1.00672432), (2.09485, 4.25533, 2.14025, 3.63493)),
    ((-2.71116248, -1.88901325, -0.17477209, -0.42219041, 0.213643, 0.21732193), (2.58421, 11.31870, 5.36790, 4.59859)),
]


@pytest.mark.parametrize("load, elements", BY_ELEMENTS)
def test_the_largest_stress_of_the_section_and_not_of_its_outline(load, elements):
    force, moment = np.array(load[:3], dtype=float), np.array(load[3:], dtype=float)
    material = cf.Material(E=1.0, nu=0.3)
    for section, value in zip(
        (cf.Circle(2), cf.Tube(2, 1.6), cf.Tube(2, 0.6), cf.Rectangle(1, 3)), elements, strict=True
    ):
        assert section.stresses(material, force, moment).von_mises == pytest.approx(value, rel=3e-3), section


@pytest.mark.parametrize("height, nu", [(1.0, 0.3), (2.0, 0.0), (10.0, 0.3), (100.0, 0.49)])
def test_places_of_a_rectangle_are_dense_enough(height, nu, monkeypatch):
    """Against many more on every side and inside, for loads of all kinds."""
    torsion = cf.Rectangle(1, height).stiffness(cf.Material(E=1.0, nu=-0.5)).torsion
    few = rectangle_fibres.__wrapped__(1.0, height, nu, torsion)
    for name, value in (("_INTERVALS", 96), ("_NEAR", 100), ("_INSIDE", 2)):
        monkeypatch.setattr(stresses, name, value)
    many = rectangle_fibres.__wrapped__(1.0, height, nu, torsion)
    rng = np.random.default_rng(5)
    sizes = np.concatenate([np.abs(many.shear).max(axis=(0, 1)), np.abs(many.normal).max(axis=0)])[[0, 1, 3, 4, 5, 2]]
    loads = rng.normal(size=(150, 6)) * 10 ** rng.uniform(-1.5, 1.5, (150, 6)) * (rng.random((150, 6)) < 0.6) / sizes
    found, exact = (fibres.stress(loads[:, :3], loads[:, 3:]).von_mises for fibres in (few, many))
    assert (exact <= 1.007 * found).all() and (exact >= 0.999 * found).all()
    assert np.mean(exact <= 1.002 * found) > 0.97


def test_tension_bending_and_torsion_of_a_solved_rod():
    """N/A, M c/I, T r/J, and sqrt(sigma^2 + 3 tau^2) of all at once: loads so small that the rod stays straight."""
    N, M, T, R = 3.0, 0.4, 0.5, 0.05
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 2)), cf.Circle(2 * R), STEEL, name="rod")
    loads = [cf.Force(rod.end, (0, 0, N)), cf.Moment(rod.end, (0.6 * M, 0.8 * M, T))]
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], loads), [1.0], elements=2, model="spatial")
    axial, bending, tau = N / (np.pi * R**2), M * R / (np.pi * R**4 / 4), T * R / (np.pi * R**4 / 2)
    fields, (at_station,) = path.fields(0), zip(*path.stress("rod@1.3"), strict=True)
    expected = np.hypot(axial + bending, np.sqrt(3) * tau), axial + bending, axial - bending
    np.testing.assert_allclose(at_station, expected, rtol=1e-5)
    for name, value in zip(("von_mises", "axial_max", "axial_min"), expected, strict=True):
        np.testing.assert_allclose(fields[name], value, rtol=1e-5)


def test_a_cantilever_of_pieces_and_of_a_section_without_shape():
    """M c/I of a beam under a force at its end, on either side of a step; none where the shape is not known."""
    P, b, h = 2.0, 0.04, 0.06
    thick, thin = cf.Rectangle(b, 2 * h), cf.Rectangle(b, h)
    rod = cf.Rod(cf.Line((0, 0, 0), (3, 0, 0), d1=(0, 1, 0)), [(1.0, thick), (2.0, thin.stiffness(STEEL)), (3.0, thin)],
                 STEEL, name="beam")  # fmt: skip
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -P))]), [1.0], elements=6)
    for s, height in ((0.0, 2 * h), (1.0, 2 * h), (2.5, h)):
        stress = path.stress(rod.at(s))
        np.testing.assert_allclose(stress.axial_max, P * (3 - s) * (height / 2) / (b * height**3 / 12), rtol=1e-4)
        np.testing.assert_allclose(stress.axial_min, -stress.axial_max, rtol=1e-4)
    fields = path.fields(0)
    inside = (fields["s"] > 1.0 + 1e-9) & (fields["s"] < 2.0 + 1e-9)
    assert (np.isnan(fields["von_mises"]) == inside).all()
    with pytest.raises(cf.SceneError, match="stress at beam@1.5: the section there is a Stiffness"):
        path.stress("beam@1.5")
    bare = cf.Rod(rod.curve, thin.stiffness(STEEL), name="bare")
    path = cf.solve(cf.Scene([bare], [cf.Clamp(bare.start)], [cf.Force(bare.end, (0, 0, -P))]), [1.0], elements=2)
    assert "von_mises" not in path.fields(0) and not path.knows_stresses


def test_both_sides_of_a_step_and_of_a_point_moment():
    """32 M/(pi D^3): the thin side of a step governs, the loaded side of a moment; a side without shape is left out."""
    sections = {
        "stepped": [(1.0, cf.Circle(0.1)), (None, cf.Circle(0.05))],
        "turned": cf.Circle(0.1),
        "partly": [(1.0, cf.Circle(0.1).stiffness(STEEL)), (None, cf.Circle(0.05))],
    }
    rods = [cf.Rod(cf.Line((0, i, 0), (2, i, 0)), sections[x], STEEL, name=x) for i, x in enumerate(sections)]
    loads = [cf.Force(rod.end, (0, 0, -10.0)) for rod in rods] + [cf.Moment("turned@1", (0, -10.0, 0))]
    path = cf.solve(cf.Scene(rods, [cf.Clamp(rod.start) for rod in rods], loads), [1.0], elements=2)
    thick, thin = (32 * 10.0 / (np.pi * D**3) for D in (0.1, 0.05))
    for station, worst, left, right in (("stepped@1", thin, thick, thin), ("turned@1", thick, 0.0, thick)):
        for side, expected in ((None, worst), ("left", left), ("right", right)):
            stress = path.stress(station, side)
            np.testing.assert_allclose(stress.axial_max, expected, rtol=1e-4, atol=1e-4 * thick)
            np.testing.assert_allclose(stress.axial_min, -expected, rtol=1e-4, atol=1e-4 * thick)
        assert path.stress(station).von_mises == pytest.approx(worst, rel=1e-4)
    assert path.stress("partly@1") == path.stress("partly@1", "right")
    with pytest.raises(cf.SceneError, match="stress at partly@1: the section there is a Stiffness"):
        path.stress("partly@1", "left")
    with pytest.raises(cf.SceneError, match="side = 'both': expected 'left', 'right', or None"):
        path.stress("turned@1", "both")
    found = path.largest()["von Mises stress"]  # beside the foot it is the thin side of the step
    assert found.size == pytest.approx(thin, rel=1e-4) and found.station.s == pytest.approx(1.0)


def test_normal_stresses_of_a_rolled_profile():
    """By the elastic section moduli of the table, 194 and 28.5 cm^3; von Mises stresses are not computed."""
    stress = cf.Profile("IPE 200").stresses(STEEL, np.array([1.0, 2.0, 0.0]), np.array([-3.0, 0.7, 5.0]))
    assert stress.axial_max == pytest.approx(3.0 / 194e-6 + 0.7 / 28.5e-6, rel=3e-3) == -stress.axial_min
    assert np.isnan(stress.von_mises)


def test_what_the_largest_values_do_not_cover_is_told():
    """Beside a tube: a rod without a shape, and a profile whose von Mises stresses are not computed."""
    sections = cf.Tube(0.1, 0.08), cf.Stiffness((1e6, 1e6), 1e7, (1e4, 1e4), 1e4), cf.Profile("IPE 200")
    rods = [
        cf.Rod(cf.Line((0, i, 0), (1, i, 0)), section, STEEL, name=name)
        for i, (section, name) in enumerate(zip(sections, ("tube", "bare", "beam"), strict=True))
    ]
    loads = [cf.Force(rod.end, (0, 0, -10.0)) for rod in rods]
    path = cf.solve(cf.Scene(rods, [cf.Clamp(rod.start) for rod in rods], loads), [1.0], elements=2)
    told = largest_in_words(path).splitlines()[1:]
    assert [line.partition(" are ")[0] for line in told] == ["Stresses of bare", "Von Mises stresses of beam"]
