"""Sections with a matrix, along rods, rolled profiles, and their stresses."""

import math

import numpy as np
import pytest
from conftest import refuses
from scipy.optimize import brentq

import cosserat_fenicsx as cf
from cosserat_fenicsx.cli.explain import explain
from cosserat_fenicsx.results.queries import Largest, _beyond_metals, largest_in_words
from cosserat_fenicsx.scene import stresses
from cosserat_fenicsx.scene.rolled import _table
from cosserat_fenicsx.scene.stresses import rectangle_fibres
from cosserat_fenicsx.statics.meshes import first_layout
from cosserat_fenicsx.storage.mark import difference, mark_of

pytestmark = pytest.mark.serial
STEEL = cf.Material(E=210e9, density=7850.0)
LINE = cf.Line((0, 0, 0), (0, 0, 10))
THICK, THIN = cf.Circle(0.2), cf.Tube(0.1, 0.05)


def row(section, material=STEEL):
    k = section.stiffness(material)
    return [*k.shear, k.axial], [*k.bending, k.torsion], k.mass


def test_one_section():
    rod = cf.Rod(LINE, THICK, STEEL)
    K, J, mass, *_ = rod.stiffness_at(np.array([0.0, 3.0, 10.0]))
    for i in range(3):
        assert (K[i].tolist(), J[i].tolist(), mass[i]) == row(THICK)
    assert rod.breaks == () and rod.profile.constant and rod.section_at(4.0) is THICK
    assert rod.stiffness == THICK.stiffness(STEEL)
    low, high = rod.profile.range
    assert low.K.tolist() == high.K.tolist() == row(THICK)[0]
    assert cf.Rod(LINE, THICK, cf.Material(E=1.0)).stiffness_at(np.zeros(3)).mass is None


@pytest.mark.parametrize("end", [10.0, 10 * (1 + 1e-12), None])
def test_pieces(end):
    rod = cf.Rod(LINE, [(4, THICK), (7.0, THIN), (end, THICK)], STEEL)
    assert rod.breaks == (4.0, 7.0) and rod.profile.pieces[-1][0] == rod.length and not rod.profile.constant
    for side, expected in (("right", [THICK, THIN, THIN, THICK, THICK]), ("left", [THICK, THICK, THIN, THIN, THICK])):
        s = np.array([0.0, 4.0, 5.0, 7.0, 10.0])
        for shift in (0, -1e-14, 1e-14):  # at a jump, up to rounding
            K, J, mass, *_ = rod.stiffness_at(s + shift, side=side)
            for i, section in enumerate(expected):
                assert (K[i].tolist(), J[i].tolist(), mass[i]) == row(section)
                assert rod.section_at(s[i] + shift, side=side) is section
    assert rod.stiffness_at(np.full((2, 5), 5.0)).J.shape == (2, 5, 3)
    low, high = rod.profile.range
    assert (low.J.tolist(), low.mass) == row(THIN)[1:] and (high.J.tolist(), high.mass) == row(THICK)[1:]


def test_a_section_by_a_function():
    def taper(s):
        return cf.Rectangle(0.3 - 0.02 * s, 0.1)

    rod = cf.Rod(LINE, taper, STEEL)
    s = np.linspace(0, 10, 7)
    K, J, mass, *_ = rod.stiffness_at(s)
    np.testing.assert_allclose(K[:, 2], 210e9 * (0.3 - 0.02 * s) * 0.1, rtol=1e-14)
    np.testing.assert_allclose(J[:, 1], 210e9 * 0.1 * (0.3 - 0.02 * s) ** 3 / 12, rtol=1e-14)
    np.testing.assert_allclose(mass, 7850 * (0.3 - 0.02 * s) * 0.1, rtol=1e-14)
    assert rod.breaks == () and not rod.profile.constant and rod.stiffness == taper(0.0).stiffness(STEEL)
    assert rod.profile.range[0].J[1] == pytest.approx(J[-1, 1]) and rod.profile.range[1].J[1] == pytest.approx(J[0, 1])
    joined = cf.Rod(LINE, [(5.0, taper), (None, THIN)], STEEL)
    assert joined.section_at(5.0, side="left") == taper(5.0) and joined.section_at(5.0) is THIN
    np.testing.assert_array_equal(joined.stiffness_at(np.array([2.0, 8.0])).J[0], rod.stiffness_at(2.0).J)
    for at in (4.2137, 9.99):  # elements do not end there, and errors would be estimated as far too small
        with pytest.raises(cf.SceneError, match=f"its section jumps at s = {at} m: expected pieces"):
            cf.Rod(LINE, lambda s, at=at: cf.Circle(0.1 + 1e-3 * s + 0.01 * (s > at)), STEEL)
        jump = cf.signals.Along(lambda s, at=at: (0, 0, -s - 100.0 * (s > at)))
        with pytest.raises(cf.SceneError, match=f"Along: its function jumps at s = {at} m: expected AlongPieces"):
            cf.LineForce(rod, jump)
    steep = cf.signals.Along(lambda s: (0, 0, np.tanh(1e6 * (s - math.pi))))
    assert cf.LineForce(rod, steep).force is steep


def test_breaks_of_curve_and_section():
    spline = cf.Spline([(0, 0, 0), (1, 0, 0), (2, 1, 0), (2, 2, 1)])
    a, b = spline.breaks
    rod = cf.Rod(spline, [(a * (1 + 1e-13), THICK), ((a + b) / 2, THIN), (None, THICK)], STEEL)
    np.testing.assert_allclose(rod.breaks, [a, (a + b) / 2, b], rtol=1e-12)


def test_weight():
    rod = cf.Rod(LINE, [(4, THICK), (None, THIN)], STEEL)
    (density,) = cf.Weight((0, 3.0, -9.81)).data(rod, np.array([1.0, 9.0]))
    np.testing.assert_allclose(density.value, np.outer([row(THICK)[2], row(THIN)[2]], [0, 3.0, -9.81]), rtol=1e-15)
    massless = cf.Stiffness((1, 1), 1, (1, 1), 1)
    rod = cf.Rod(LINE, [(4, cf.Stiffness((1, 1), 1, (1, 1), 1, mass=2.0)), (None, massless)])
    with pytest.raises(cf.SceneError, match=r"Stiffness.mass = None"):
        cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Weight()])


def column(EI):
    return cf.Rod(LINE, EI if isinstance(EI, list) else lambda s: cf.Stiffness((1, 1), 1, EI(s), 1))


def test_euler_load():
    """Closed forms: a stepped column; EI falling with the square of the distance to an apex (Euler's equation)."""
    weak, strong = (cf.Stiffness((1, 1), 1, (EI, 9.0), 1) for EI in (1.0, 4.0))
    P = brentq(lambda P: math.tan(math.sqrt(P) / 2 * 6) * math.tan(math.sqrt(P) * 4) - 2, 1e-6, 0.15)
    assert cf.euler_load(column([(6.0, strong), (None, weak)])) == pytest.approx(P, rel=1e-11)
    assert cf.euler_load(column([(6.0, weak), (None, weak)])) == pytest.approx(math.pi**2 / 400, rel=1e-12)
    # theta = x^(-1/2) sin(b ln x), x = 1 - s/20 from 1 to 1/2, b^2 = P (20^2) - 1/4
    y = brentq(lambda b: 2 * b * math.cos(b * math.log(2)) + math.sin(b * math.log(2)), 1.2, 4.0)
    P = (y**2 + 0.25) / 400
    assert cf.euler_load(column(lambda s: (9.0, (1 - s / 20) ** 2))) == pytest.approx(P, rel=1e-11)


REFUSED = {
    "no piece": (lambda: [], "section = []: expected at least one piece"),
    "no pair": (lambda: [THICK],
                "section[0] = Circle(diameter=0.2, shear_factor=None): expected a piece (s_end, section)"),
    "short of the end": (lambda: [(4, THICK), (9.9, THIN)], "section[1].to = 9.9: expected the rod's length 10 m"),
    "beyond the end": (lambda: [(11, THICK), (None, THIN)],
                       "section[0].to = 11: expected an arc length above 0 and up to 10 m"),
    "not ascending": (lambda: [(4, THICK), (4, THIN), (None, THIN)],
                      "section[1].to = 4: expected an arc length above 4"),
    "a piece at the end": (lambda: [(10, THICK), (10, THIN)], "section[1].to = 10.0: expected an arc length above 10"),
    "NaN": (lambda: [(math.nan, THICK), (None, THIN)], "section[0].to = nan"),
    "no end": (lambda: [(None, THICK), (None, THIN)], "section[0].to = None"),
    "no section in a piece": (lambda: [(4, 0.2), (None, THIN)], "Rod.section[0] = 0.2: expected a section"),
    "a class": (lambda: cf.Circle, "Rod.section = <class"),
    "a function of numbers": (lambda: lambda s: 0.1 + s, "section(0) = 0.1: expected a section"),
    "a function without a return": (lambda: lambda s: THICK if s < 9 else None, " = None: expected a section"),
    "a function of NaN": (lambda: lambda s: cf.Circle(math.nan if s > 9.99 else 0.1),
                          "section at s = 10 m: Circle.diameter = nan"),
    "a function to zero": (lambda: lambda s: cf.Circle(1 - s / 10), "section at s = 10 m: Circle.diameter = 0.0"),
}  # fmt: skip
PIECES = [(4, THICK), (None, THIN)]
REFUSED_ALSO = {
    "pieces without material": (lambda: cf.Rod(LINE, PIECES), "Rod.material = None"),
    "a function without material": (lambda: cf.Rod(LINE, lambda s: THICK), "Rod.material = None"),
    "a side": (lambda: cf.Rod(LINE, PIECES, STEEL).stiffness_at(1.0, side="middle"),
               "side = 'middle': expected 'left' or 'right'"),
    **{f"profile {name}": (lambda name=name: cf.Profile(name), words) for name, words in (
        ("IPE 210", "Profile.name = 'IPE 210': did you mean IPE 180 or IPE 200 or IPE 220?"),
        ("INP 200", "expected IPE, HEA, HEB or HEM with its size"),
        ("HE", "expected IPE, HEA, HEB or HEM with its size"),
        (200, "Profile.name = 200: expected a name such as 'IPE 200'"))},
    **{f"outline {i}": (lambda given=given: cf.Stiffness((1, 1), 1, (1, 1), 1, outline=given),
                        f"Stiffness.outline = {given}: expected three or more corners") for i, given in enumerate(
        (3, [(0, 0), (1, 0)], [(0, 0), (1, 0), (1,)], [(0, 0, 0)] * 3, [(0, 0), (1, 0), (math.inf, 0)]))},
}  # fmt: skip


test_refused = refuses(REFUSED, lambda make: cf.Rod(LINE, make(), STEEL, name="rod"))
test_refused_also = refuses(REFUSED_ALSO)


@pytest.mark.parametrize("place", [0.31, 0.68, 0.9])
def test_a_weak_spot_between_the_points_of_a_coarse_mesh_is_seen(place):
    def section(s):
        EI = 1 - 0.98 * np.exp(-(((s - place) / 0.005) ** 2))
        return cf.Stiffness((1e3, 1e3), 1e3, (EI, EI), EI)

    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), section)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0.5, 0, 0))])
    path = cf.solve(scene, [1.0], tol=1e-3)
    fine = cf.solve(scene, [1.0], elements=2000)
    x = np.linspace(0, 1, 301)
    error = np.linalg.norm(path.sample(0, rod, x)[0] - fine.sample(0, rod, x)[0], axis=1).max()
    assert error / fine.largest_displacement()[0] <= path.error[0] <= 1e-3


def test_a_scene_is_solved_again_as_it_is_now():
    """Constant data are kept, functions are evaluated again."""
    diameter = [0.02]
    tips = []
    for section in (cf.Circle(0.02), lambda s: cf.Circle(diameter[0])):
        rod = cf.Rod(LINE, section, STEEL)
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (10.0, 0, 0))])
        for diameter[0] in (0.02, 0.03):
            tips.append(cf.solve(scene, [1.0], elements=4).displacement(rod.end)[0, 0])
    assert tips[0] == tips[1] and tips[2] == pytest.approx(tips[0]) and tips[3] < 0.3 * tips[2]


EYE = np.eye(6)
UNIT = cf.Line((0, 0, 0), (0, 0, 1.0))


def changed(i, j, value, symmetric=True):
    M = EYE.copy()
    M[i, j] = value
    if symmetric:
        M[j, i] = value
    return M.tolist()


REFUSED_MATRICES = {
    "not symmetric": (lambda: cf.Stiffness(matrix=changed(0, 4, 0.1, symmetric=False)), "Stiffness.matrix = "),
    "not positive definite": (lambda: cf.Stiffness(matrix=changed(2, 5, 1.1)), "symmetric and positive definite"),
    "singular": (lambda: cf.Stiffness(matrix=changed(2, 5, 1.0)), "symmetric and positive definite"),
    "negative diagonal": (lambda: cf.Stiffness(matrix=changed(3, 3, -1.0)), "symmetric and positive definite"),
    "infinite": (lambda: cf.Stiffness(matrix=changed(0, 0, np.inf)), "expected 6 x 6 finite numbers"),
    "shape": (lambda: cf.Stiffness(matrix=[[1.0, 2.0], [2.0, 1.0]]), "expected 6 x 6 finite numbers"),
    "ragged": (lambda: cf.Stiffness(matrix=[[1.0], [2.0, 1.0]]), "expected 6 x 6 finite numbers"),
    "twice": (lambda: cf.Stiffness(axial=1.0, matrix=EYE), "Stiffness.axial = 1.0: expected None beside a matrix"),
    "neither": (lambda: cf.Stiffness(mass=1.0), "Stiffness.shear = None: expected two numbers"),
    "offset, infinite": (lambda: cf.Stiffness.offset((1, 1), np.inf, (1, 1), 1), "Stiffness.offset.axial = inf"),
    "offset, place": (lambda: cf.Stiffness.offset((1, 1), 1, (1, 1), 1, centroid=1), "Stiffness.offset.centroid = 1"),
    "pieces, one of them infinite":
        (lambda: cf.Rod(UNIT, [(0.5, cf.Stiffness(matrix=EYE)), (None, cf.Stiffness((1, 1), np.inf, (1, 1), 1))]),
         "expected finite stiffnesses along a rod that has a section with a matrix"),
}  # fmt: skip


test_refused_matrices = refuses(REFUSED_MATRICES)


def test_units_do_not_decide_what_is_positive_definite():
    unit = np.diag([1e9, 1e9, 1e12, 1e-4, 1e-4, 1e-5])
    M = unit @ (EYE + 0.5 * (np.ones((6, 6)) - EYE)) @ unit
    assert np.array_equal(cf.Stiffness(matrix=M).matrix, M)


def test_offset_is_the_energy_of_two_points():
    """The energy of the strains e + k x (x1, x2, 0) at centroid and shear centre, against the matrix."""
    shear, axial, bending, torsion = (2.0, 3.0), 7.0, (1.0, 4.0), 0.5
    centroid, shear_centre, angle = (0.2, -0.3), (-0.1, 0.4), 0.7
    places = {"centroid": centroid, "shear_centre": shear_centre}
    section = cf.Stiffness.offset(shear, axial, bending, torsion, **places, angle=angle)
    e, k = np.random.default_rng(0).normal(size=(2, 3))
    axes = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    stretched, sheared = (axes @ e + np.cross(axes @ k, [*place, 0]) for place in (centroid, shear_centre))
    expected = np.dot([*shear, axial], [*sheared[:2] ** 2, stretched[2] ** 2])
    expected += np.dot([*bending, torsion], (axes @ k) ** 2)
    both = np.array([*e, *k])
    assert both @ np.array(section.matrix) @ both == pytest.approx(expected, rel=1e-13)
    plain = cf.Stiffness.offset(shear, axial, bending, torsion)
    np.testing.assert_array_equal(plain.matrix, np.diag([*shear, axial, *bending, torsion]))


def test_stiffnesses_that_stand_for_a_matrix():
    """Bending about the principal axes, for any coupling; n and m from the strains and back."""
    rod = cf.Rod(UNIT, cf.Stiffness.offset((2.0, 3.0), 7.0, (4.0, 1.0), 0.5, angle=0.3, mass=2.0))
    at = rod.stiffness_at(np.array([0.2, 0.8]))
    np.testing.assert_allclose(at.J, [[4.0, 1.0, 0.5]] * 2)
    np.testing.assert_allclose(at.mass, 2.0)
    rod = cf.Rod(UNIT, cf.Stiffness.offset((2.0, 3.0), 7.0, (4.0, 1.0), 0.5, centroid=(0.2, 0.1)))
    at, (e, k) = rod.stiffness_at(0.5), np.random.default_rng(1).normal(size=(2, 3))
    n, m = np.split(at.matrix @ [*e, *k], 2)
    for found, expected in zip(at.strains(n, m), (e, k), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12)


def scene(section, force=(0.1, 0, -1.0), **more):
    rod = cf.Rod(UNIT, section, name="rod", **more)
    return rod, cf.Scene([rod], [cf.Clamp(rod.start)], [cf.FollowerForce(rod.end, force)])


def in_plane(centroid, **more):
    return cf.Stiffness.offset((2e3, 3e3), 4e3, (1.0, 3.0), 0.5, centroid=centroid, **more)


@pytest.mark.slow
def test_a_matrix_keeps_to_a_plane_if_it_couples_nothing_with_what_leaves_it():
    rod, flat = scene(in_plane((0.05, 0)))
    path = cf.solve(flat, [1.0, 2.0], elements=6)
    assert path.model == "planar"
    space = cf.solve(flat, [1.0, 2.0], model="spatial", elements=6)
    np.testing.assert_allclose(path.displacement(rod.end), space.displacement(rod.end), atol=1e-10)
    assert path.negative_modes.tolist() == space.negative_modes.tolist()
    for name in ("strain", "curvature", "force", "moment"):
        np.testing.assert_allclose(path.fields(-1)[name], space.fields(-1)[name], atol=1e-8, err_msg=name)
    for section in (in_plane((0.05, 0.01)), in_plane((0.05, 0), angle=0.1), in_plane((0, 0), shear_centre=(0, 0.02))):
        path = cf.solve(scene(section)[1], [0.1], elements=4)
        assert path.model == "spatial" and "couples strains in the plane with those out of it" in " ".join(path.why)
    assert "sections couple strains" in explain(flat, [1.0], {})


@pytest.mark.slow
def test_determinate_rungs_agree_with_space():
    """In a plane that is not a coordinate plane, and in space."""
    turn = np.array([np.cos(0.4), np.sin(0.4), 0])
    for section, model in ((in_plane((0.05, 0)), "planar"), (in_plane((0.03, 0.04), angle=0.2), "spatial")):
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0), d1=turn), section, name="rod")
        loads = [cf.Force(rod.end, 2.0 * turn - [0, 0, 1.5]), cf.EccentricForce(rod.end, (0, 0, 1.0), (0.1, 0))]
        dead = cf.Scene([rod], [cf.Clamp(rod.start)], loads)
        a, b, c = (cf.solve(dead, [1.0], model=name, elements=8) for name in ("determinate", model, "spatial"))
        for other in (b, c):
            np.testing.assert_allclose(a.displacement(rod.end), other.displacement(rod.end), atol=1e-8)
            for name in ("strain", "curvature"):
                np.testing.assert_allclose(a.fields(-1)[name], other.fields(-1)[name], atol=1e-6, err_msg=name)


def test_a_stored_motion_knows_its_matrix():
    one, other = (scene(in_plane((0.05, y)))[1] for y in (0.0, 0.01))
    one, same, other = (mark_of(x, "Scene", [0.0]) for x in (one, one, other))
    assert difference(one, same, "motion") is None
    assert "Scene.rods[0].section" in difference(one, other, "motion")


@pytest.mark.slow
def test_the_first_mesh_sees_axes_that_turn_along_the_rod():
    """The same first mesh as for a rod whose directors rotate instead, with constant principal stiffnesses."""
    rate = 40 * np.pi

    def twisted(s):
        return cf.Stiffness.offset((1e4, 1e4), 1e4, (1.0, 20.0), 1.0, angle=rate * s)

    plain = cf.Rod(cf.UniformCurvature(1.0, (0, 0, rate)), cf.Stiffness((1e4, 1e4), 1e4, (1.0, 20.0), 1.0))
    layouts = [first_layout(cf.Scene([rod], [cf.Clamp(rod.start)]), 4) for rod in (plain, cf.Rod(UNIT, twisted))]
    assert layouts[0].counts == layouts[1].counts and layouts[0].counts[0] >= 16


#: A (cm^2), I_y, I_z and I_t (cm^4) as tabulated for EN 10365, with the rounding of the table.
TABULATED = {
    "IPE 80": ("7.64", "80.1", "8.49", "0.70"),
    "IPE 200": ("28.5", "1943", "142", "6.98"),
    "IPE 300": ("53.8", "8356", "604", "20.1"),
    "IPE 600": ("156", "92080", "3387", "165"),
    "HEA 100": ("21.2", "349.2", "133.8", "5.24"),
    "HEA 260": ("86.8", "10450", "3668", "52.37"),
    "HEA 1000": ("346.8", "553800", "14000", "822.4"),
    "HEB 200": ("78.1", "5696", "2003", "59.28"),
    "HEB 500": ("238.6", "107200", "12620", "538.4"),
    "HEM 100": ("53.2", "1143", "399.2", "68.21"),
    "HEM 300": ("303.1", "59200", "19400", "1408"),
    "HEM 900": ("423.6", "570400", "18450", "1671"),
}
#: Shear areas along d_1 and d_2, mm^2, by finite elements (sectionproperties 3.10.2, nu = 0).
AREAS_BY_ELEMENTS = {
    "IPE 200": (1588.6, 1096.8),
    "IPE 600": (7693.6, 7019.0),
    "HEA 200": (3650.7, 1205.7),
    "HEM 100": (3842.2, 1384.7),
}


def unit_of(text):
    """Half of the last digit that a table gives; it gives four digits where zeros fill the rest."""
    if "." in text:
        return 0.5 * 10.0 ** -len(text.split(".")[1])
    return 0.5 * 10.0 ** max(0, len(text) - 4)


@pytest.mark.parametrize("name", TABULATED)
def test_the_published_tables(name):
    profile = cf.Profile(name)
    found = (profile.area * 1e4, *(I * 1e8 for I in profile.second_moments), profile.torsion_constant * 1e8)
    for value, tabulated in zip(found, TABULATED[name], strict=True):
        assert value == pytest.approx(float(tabulated), rel=0, abs=1.01 * unit_of(tabulated))


@pytest.mark.parametrize("name", AREAS_BY_ELEMENTS)
def test_shear_areas(name):
    for found, elements in zip(cf.Profile(name).shear_areas, AREAS_BY_ELEMENTS[name], strict=True):
        assert found * 1e6 == pytest.approx(elements, rel=0.05)


def test_every_profile_of_the_table():
    """90 names; heights and thicknesses ascend in each series, and masses as in any table of steel."""
    names = list(_table())
    assert len(names) == len(set(names)) == 90
    for series in ("IPE", "HEA", "HEB", "HEM"):
        profiles = [cf.Profile(name) for name in names if name.startswith(series)]
        masses = [p.area for p in profiles]
        assert masses == sorted(masses) and [p.height for p in profiles] == sorted(p.height for p in profiles)
        assert all(p.second_moments[0] > p.second_moments[1] > p.torsion_constant > 0 for p in profiles)
        assert all(p.web < p.flange < p.width / 4 and max(p.shear_areas) < p.area for p in profiles)
    for given, name in (("ipe200", "IPE 200"), ("HE 160 A", "HEA 160"), (" heb 300", "HEB 300")):
        assert cf.Profile(given) == cf.Profile(name) and cf.Profile(given).name == name


def test_stiffness():
    p, k = cf.Profile("IPE 200"), cf.Profile("IPE 200").stiffness(STEEL)
    assert k.mass == pytest.approx(22.4, abs=0.05) and k.axial == 210e9 * p.area
    assert cf.Stiffness((1, 1), 1, (1, 1), 1, outline=[[0, 0], [1, 0], [0, 1]]).outline == ((0, 0), (1, 0), (0, 1))
    assert k.bending == tuple(210e9 * I for I in p.second_moments) and k.torsion == STEEL.G * p.torsion_constant
    assert k.inertia[2] == pytest.approx(k.inertia[0] + k.inertia[1])
    xs, ys = zip(*k.outline, strict=True)
    assert (max(xs), max(ys), min(xs), min(ys)) == (0.05, 0.1, -0.05, -0.1) and len(k.outline) == 12
    following = k.outline[1:] + k.outline[:1]
    without_fillets = sum(x * v - u * y for (x, y), (u, v) in zip(k.outline, following, strict=True))
    assert without_fillets / 2 == pytest.approx(p.area - (4 - math.pi) * p.fillet**2)  # counterclockwise


STEEL_QUARTER = cf.Material(E=210e9, nu=0.25)
ZERO = np.zeros(3)


def test_shear_stresses_of_a_rectangle_are_those_of_the_tables():
    """Timoshenko & Goodier: torsion tau = T/(alpha a b^2), flexure relative to 3 V/(2 A) at nu = 1/4."""
    for width, height, alpha, wide, narrow in ((1, 1, 0.208, 1.126, 1.126), (2, 1, 0.246, 1.396, 1.033),
                                               (4, 1, 0.282, 1.988, 1.008)):  # fmt: skip
        section = cf.Rectangle(width, height)
        tau = section.stresses(STEEL_QUARTER, ZERO, np.array([0, 0, 7.0])).von_mises / np.sqrt(3)
        assert 7.0 / (tau * width * height**2) == pytest.approx(alpha, abs=6e-4)
        for force, ratio in (((0, 5.0, 0), wide), ((5.0, 0, 0), narrow)):
            found = section.stresses(STEEL_QUARTER, np.array(force), ZERO)
            assert found.von_mises / np.sqrt(3) / (1.5 * 5.0 / (width * height)) == pytest.approx(ratio, abs=1e-3)
            assert found.axial_max == found.axial_min == 0.0


def test_turning_a_rectangle_changes_nothing():
    rng = np.random.default_rng(1)
    force, moment = rng.normal(size=(2, 20, 3))
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])  # d_1 where -d_2 was
    one = cf.Rectangle(0.3, 0.7).stresses(STEEL_QUARTER, force, moment)
    other = cf.Rectangle(0.7, 0.3).stresses(STEEL_QUARTER, force @ turn.T, moment @ turn.T)
    np.testing.assert_allclose(one, other, rtol=1e-12)


@pytest.mark.parametrize("section, R, r", [(cf.Circle(0.6), 0.3, 0.0), (cf.Tube(0.6, 0.5), 0.3, 0.25)])
def test_bending_torsion_and_tension_of_round_sections(section, R, r):
    """Without shear forces the outer circumference governs."""
    rng = np.random.default_rng(2)
    force, moment = rng.normal(size=(200, 3)) * [0, 0, 1], 0.3 * rng.normal(size=(200, 3))
    A, I = np.pi * (R**2 - r**2), np.pi * (R**4 - r**4) / 4
    bending, tau = R / I * np.hypot(moment[:, 0], moment[:, 1]), R / (2 * I) * moment[:, 2]
    found = section.stresses(STEEL_QUARTER, force, moment)
    np.testing.assert_allclose(found.axial_max, force[:, 2] / A + bending, rtol=1e-12)
    np.testing.assert_allclose(found.axial_min, force[:, 2] / A - bending, rtol=1e-12)
    np.testing.assert_allclose(
        found.von_mises, np.hypot(np.abs(force[:, 2]) / A + bending, np.sqrt(3) * tau), rtol=1e-9
    )


#: n and m, and the largest von Mises stresses of Circle(2), Tube(2, 1.6), Tube(2, 0.6), Rectangle(1, 3) by finite
#: elements (sectionproperties 3.10.2, nu = 0.3): shear alone governs in the centre, the bore and the inside.
BY_ELEMENTS_STRESSES = [
    ((1, 0, 0, 0, 0, 0), (0.76448, 3.32305, 1.60137, 1.56096)),
    ((0, 1, 0, 0, 0, 0), (0.76427, 3.32307, 1.60098, 0.88133)),
    ((-0.78190836, -0.25719224, 0.00814018, -0.27560291, 1.29406381, 1.00672432), (2.09485, 4.25533, 2.14025, 3.63493)),
    ((-2.71116248, -1.88901325, -0.17477209, -0.42219041, 0.213643, 0.21732193), (2.58421, 11.31870, 5.36790, 4.59859)),
]


@pytest.mark.parametrize("load, elements", BY_ELEMENTS_STRESSES)
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
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 2)), cf.Circle(2 * R), STEEL_QUARTER, name="rod")
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
    sections = [(1.0, thick), (2.0, thin.stiffness(STEEL_QUARTER)), (3.0, thin)]
    rod = cf.Rod(cf.Line((0, 0, 0), (3, 0, 0), d1=(0, 1, 0)), sections, STEEL_QUARTER, name="beam")
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
    bare = cf.Rod(rod.curve, thin.stiffness(STEEL_QUARTER), name="bare")
    path = cf.solve(cf.Scene([bare], [cf.Clamp(bare.start)], [cf.Force(bare.end, (0, 0, -P))]), [1.0], elements=2)
    assert "von_mises" not in path.fields(0) and not path.knows_stresses


def test_both_sides_of_a_step_and_of_a_point_moment():
    """32 M/(pi D^3): the thin side of a step governs, the loaded side of a moment; a side without shape is left out."""
    sections = {
        "stepped": [(1.0, cf.Circle(0.1)), (None, cf.Circle(0.05))],
        "turned": cf.Circle(0.1),
        "partly": [(1.0, cf.Circle(0.1).stiffness(STEEL_QUARTER)), (None, cf.Circle(0.05))],
    }
    rods = [cf.Rod(cf.Line((0, i, 0), (2, i, 0)), sections[x], STEEL_QUARTER, name=x) for i, x in enumerate(sections)]
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
    stress = cf.Profile("IPE 200").stresses(STEEL_QUARTER, np.array([1.0, 2.0, 0.0]), np.array([-3.0, 0.7, 5.0]))
    assert stress.axial_max == pytest.approx(3.0 / 194e-6 + 0.7 / 28.5e-6, rel=3e-3) == -stress.axial_min
    assert np.isnan(stress.von_mises)


def test_what_the_largest_values_do_not_cover_is_told():
    """Beside a tube: a rod without a shape, and a profile whose von Mises stresses are not computed."""
    sections = cf.Tube(0.1, 0.08), cf.Stiffness((1e6, 1e6), 1e7, (1e4, 1e4), 1e4), cf.Profile("IPE 200")
    rods = [
        cf.Rod(cf.Line((0, i, 0), (1, i, 0)), section, STEEL_QUARTER, name=name)
        for i, (section, name) in enumerate(zip(sections, ("tube", "bare", "beam"), strict=True))
    ]
    loads = [cf.Force(rod.end, (0, 0, -10.0)) for rod in rods]
    path = cf.solve(cf.Scene(rods, [cf.Clamp(rod.start) for rod in rods], loads), [1.0], elements=2)
    told = largest_in_words(path).splitlines()[1:]
    assert [line.partition(" are ")[0] for line in told] == ["Stresses of bare", "Von Mises stresses of beam"]


@pytest.mark.parametrize(("E", "size", "cautions"), [(210e9, 26e9, 1), (210e9, 1e9, 0), (1e9, 0.5e9, 0)])
def test_stresses_beyond_what_metals_bear_are_told(E, size, cautions):
    """E/8 of steel, but neither 1 GPa of steel nor E/2 of a plastic."""
    rod = cf.Rod(cf.Line((0, 0, 0), (1, 0, 0)), cf.Circle(0.1), cf.Material(E=E, nu=0.3))
    assert len([*_beyond_metals({"normal stress": Largest(size, rod.end, 0, "Pa")})]) == cautions
