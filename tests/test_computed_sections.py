"""Sections computed by finite elements: numbers of sectionproperties 3.10.2, recorded."""

from types import SimpleNamespace

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.scene.sections import inverse

pytestmark = [pytest.mark.serial, pytest.mark.once]
STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)
_STEEL = SimpleNamespace(elastic_modulus=210e9, poissons_ratio=0.3, density=7850.0)
_STEEL_MM = SimpleNamespace(elastic_modulus=210e3, poissons_ratio=0.3, density=7.85e-6)
_ALUMINIUM_MM = SimpleNamespace(elastic_modulus=70e3, poissons_ratio=0.3, density=2.7e-6)


class Computed:
    """What a section of sectionproperties returns."""

    def __init__(self, materials=(), outline=None, **returned):
        self.materials = list(materials)
        self.geometry = SimpleNamespace(geom=outline)
        returned |= {"is_composite": bool(materials)}
        vars(self).update({name: lambda value=value: value for name, value in returned.items()})


#: 200 x 75 mm, flanges 11.5 mm, web 8.5 mm, in m; with a material of its own, and without
CHANNEL = Computed(
    [_STEEL],
    get_mass=25.81080978, get_ea=690480261.5, get_eic=(4137410.789, 359772.5697, 2.56113708e-09),
    get_eip=(4137410.789, 359772.5697), get_c=(0.02181628768, 0.1), get_sc=(-0.02106112392, 0.1000000514), get_phi=0.0,
    get_ej=25218.35637, get_eas=(199515015.4, 319682474.3), get_eas_p=(199515015.4, 319682474.3),
    get_e_eff=210e9, get_g_eff=80769230770.0,
)  # fmt: skip
BARE_CHANNEL = Computed(
    get_area=0.003288001245, get_ic=(1.970195614e-05, 1.713202713e-06, 8.470329473e-21),
    get_ip=(1.970195614e-05, 1.713202713e-06), get_c=(0.02181628768, 0.1), get_sc=(-0.02106258071, 0.1000000395),
    get_phi=0.0, get_j=1.200874113e-07, get_as=(0.0009534675402, 0.00152230205),
    get_as_p=(0.0009534675402, 0.00152230205),
)  # fmt: skip
#: an angle, 150 x 90 x 12, in mm
ANGLE = Computed(
    [_STEEL_MM],
    get_mass=0.02160260909, get_ea=577904192.2, get_eic=(1317015321000.0, 358598074200.0, -393659396400.0),
    get_eip=(1457974921000.0, 217638474400.0), get_c=(21.15419354, 50.80698801), get_sc=(6.22705473, 8.297981112),
    get_phi=-160.2988222, get_ej=28998169530.0, get_eas=(181439917.3, 323389701.4),
    get_eas_p=(186236479.6, 309196097.4), get_e_eff=210000.0, get_g_eff=80769.23077,
)  # fmt: skip
#: steel and aluminium side by side, 50 x 100 each, in mm
PAIR = Computed(
    [_STEEL_MM, _ALUMINIUM_MM],
    get_mass=0.05275, get_ea=1.4e9, get_eic=(1166666667000.0, 947916666700.0, -0.01171875),
    get_eip=(1166666667000.0, 947916666700.0), get_c=(37.5, 50.0), get_sc=(38.58266962, 50.00001809), get_phi=0.0,
    get_ej=1676185019000.0, get_eas=(998638565.4, 1159348368.0), get_eas_p=(998638565.4, 1159348368.0),
    get_e_eff=140000.0, get_g_eff=53846.15385,
)  # fmt: skip


def rectangle(b, h, outline=None):
    """A rectangle by formulas, its corner at the origin, without materials; Poisson's ratio zero."""
    k = cf.Rectangle(b, h, shear_factor=5 / 6).stiffness(cf.Material(E=1.0, nu=-0.5))  # E = G = 1
    return Computed(outline=outline, get_area=k.axial, get_ic=(*k.bending, 0.0), get_ip=k.bending,
                    get_c=(b / 2, h / 2), get_sc=(b / 2, h / 2 + 1e-9), get_phi=0.0 if b < h else -90.0,
                    get_j=k.torsion, get_as=k.shear, get_as_p=k.shear)  # fmt: skip


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_a_symmetric_section_is_the_same_as_by_formulas(unit):
    corners = [(0, 0), (0, 0.3 / unit), (0.2 / unit, 0.3 / unit), (0.2 / unit, 0), (0, 0)]  # clockwise and closed
    outline = SimpleNamespace(exterior=SimpleNamespace(coords=corners))
    k = cf.Stiffness.from_section(rectangle(0.2 / unit, 0.3 / unit, outline), STEEL, unit=unit)
    exact = cf.Rectangle(0.2, 0.3, shear_factor=5 / 6).stiffness(STEEL)
    for name in ("shear", "axial", "bending", "torsion", "mass", "inertia"):
        assert getattr(k, name) == pytest.approx(getattr(exact, name), rel=1e-12), name
    assert k.matrix is None
    x, y = np.array(k.outline).T
    assert np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2 == pytest.approx(0.06)  # counterclockwise, in m


def test_a_channel():
    """Its numbers with and without E; a force through the shear centre, and no other, turns nothing."""
    one, other = cf.Stiffness.from_section(CHANNEL), cf.Stiffness.from_section(BARE_CHANNEL, STEEL)
    M, flexible = np.array(one.matrix), inverse(np.array(one.matrix))
    np.testing.assert_allclose(M, other.matrix, rtol=0.01, atol=1e-6 * M.max())
    np.testing.assert_allclose(np.diag(M)[:5], [STEEL.G * 0.0009500715, STEEL.G * 0.0015222975, 690480261.5,
                                                4137410.789, 359772.5697], rtol=1e-6)  # fmt: skip
    assert 1 / flexible[5, 5] == pytest.approx(25218.35637 * STEEL.G / 210e9, rel=1e-9)
    arm = -0.02106112392 - 0.02181628768
    force = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    assert (flexible @ force)[5] == pytest.approx(-arm / (25218.35637 * STEEL.G / 210e9), rel=1e-6)
    assert abs((flexible @ (force + [0, 0, 0, 0, 0, arm]))[5]) < 1e-6 * (flexible @ force)[5]
    assert one.mass == pytest.approx(25.81080978) and one.inertia[0] == pytest.approx(7850 * 1.970195614e-05, rel=1e-6)


def test_an_angle_in_mm():
    """Principal axes turn back to the moments about x and y; a section that is skew leaves its inertia out."""
    k = cf.Stiffness.from_section(ANGLE, unit=1e-3)
    EIx, EIy, EIxy = (value * 1e-6 for value in ANGLE.get_eic())
    np.testing.assert_allclose(np.array(k.matrix)[3:5, 3:5], [[EIx, -EIxy], [-EIxy, EIy]], rtol=1e-8)
    assert k.mass == pytest.approx(21.60260909) and k.inertia is None
    # the shear flexibility along x and y and along the principal axes, whose coupling cannot be told from either alone
    flexible = np.linalg.inv(np.array(k.matrix)[:2, :2])
    angle = np.radians(ANGLE.get_phi())
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    for axes, areas in ((np.eye(2), ANGLE.get_eas()), (turn, ANGLE.get_eas_p())):
        expected = 210 / 80.76923077 / np.array(areas)
        np.testing.assert_allclose(np.diag(axes @ flexible @ axes.T), expected, rtol=1e-8)


def test_the_line_elsewhere():
    """Steiner's theorem; mass off the line is left out."""
    k = cf.Stiffness.from_section(CHANNEL, line=(0.0, 0.05))
    (x, y), EA = (0.02181628768, 0.05), 690480261.5
    np.testing.assert_allclose(
        np.array(k.matrix)[3:5, 3:5],
        [[4137410.789 + EA * y * y, -EA * x * y], [-EA * x * y, 359772.5697 + EA * x * x]],
        rtol=1e-9,
    )
    assert k.mass is None and k.inertia is None


def test_two_materials():
    """The centre of mass is not the centroid of E: mass is kept for a line through it alone."""
    k = cf.Stiffness.from_section(PAIR, unit=1e-3)
    assert k.mass is None and k.inertia is None  # regions unknown
    assert np.diag(k.matrix)[2:5] == pytest.approx([1.4e9, 1166666.667, 947916.6667])
    halves = [
        SimpleNamespace(material=material, geom=SimpleNamespace(area=5000.0, centroid=SimpleNamespace(x=x, y=50.0)))
        for material, x in ((_STEEL_MM, 25.0), (_ALUMINIUM_MM, 75.0))
    ]
    known = Computed(PAIR.materials, **{name: get() for name, get in vars(PAIR).items() if name.startswith("get_")})
    known.geometry.geoms = halves
    assert cf.Stiffness.from_section(known, unit=1e-3).mass is None
    k = cf.Stiffness.from_section(known, unit=1e-3, line=((7850 * 25 + 2700 * 75) / 10550, 50.0))
    assert k.mass == pytest.approx(0.5 * 0.01 * (7850 + 2700)) and k.inertia is None


def raising(message):
    def method():
        raise RuntimeError(message)

    return method


WITHOUT_WARPING = rectangle(1.0, 2.0)
WITHOUT_WARPING.get_sc = raising("Conduct a warping analysis.")
MIXED = Computed([_STEEL, SimpleNamespace(elastic_modulus=30e9, poissons_ratio=0.2, density=2400.0)],
                 **{name: getattr(CHANNEL, name)() for name in vars(CHANNEL) if name.startswith("get_")})  # fmt: skip
REFUSED = {
    "no section": ((cf.Circle(0.1), STEEL), "expected a Section of sectionproperties"),
    "no material": ((BARE_CHANNEL,), "material = None: expected a Material, since the section has none"),
    "two materials": ((CHANNEL, STEEL), "expected None, since the section has materials of its own"),
    "no warping analysis": ((WITHOUT_WARPING, STEEL), "Conduct a warping analysis. Expected a section after"),
    "Poisson's ratios": ((MIXED,), "its materials have the Poisson's ratios 0.2, 0.3"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case):
    arguments, words = REFUSED[case]
    with pytest.raises(cf.SceneError) as refusal:
        cf.Stiffness.from_section(*arguments)
    assert words in str(refusal.value)
