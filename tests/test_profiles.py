"""Sections that change along the rod."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial  # independent of ranks

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


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case):
    make, words = REFUSED[case]
    with pytest.raises(cf.SceneError) as refusal:
        cf.Rod(LINE, make(), STEEL, name="rod")
    assert words in str(refusal.value)


@pytest.mark.parametrize(
    "outline", [3, [(0, 0), (1, 0)], [(0, 0), (1, 0), (1,)], [(0, 0, 0)] * 3, [(0, 0), (1, 0), (math.inf, 0)]]
)
def test_outlines(outline):
    with pytest.raises(cf.SceneError, match="Stiffness.outline = .*expected three or more corners"):
        cf.Stiffness((1, 1), 1, (1, 1), 1, outline=outline)
    assert cf.Stiffness((1, 1), 1, (1, 1), 1, outline=[[0, 0], [1, 0], [0, 1]]).outline == ((0, 0), (1, 0), (0, 1))


def test_refused_without_material_and_side():
    for section in ([(4, THICK), (None, THIN)], lambda s: THICK):
        with pytest.raises(cf.SceneError, match="Rod.material = None"):
            cf.Rod(LINE, section)
    with pytest.raises(cf.SceneError, match="side = 'middle': expected 'left' or 'right'"):
        cf.Rod(LINE, [(4, THICK), (None, THIN)], STEEL).stiffness_at(1.0, side="middle")


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
