"""Rolled profiles: the published tables, finite elements for shear, names, and where they are used."""

import math

import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.scene.rolled import _table

pytestmark = pytest.mark.serial
STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)

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
BY_ELEMENTS = {
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


@pytest.mark.parametrize("name", BY_ELEMENTS)
def test_shear_areas(name):
    for found, elements in zip(cf.Profile(name).shear_areas, BY_ELEMENTS[name], strict=True):
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


def test_stiffness():
    p, k = cf.Profile("IPE 200"), cf.Profile("IPE 200").stiffness(STEEL)
    assert k.mass == pytest.approx(22.4, abs=0.05) and k.axial == 210e9 * p.area
    assert k.bending == tuple(210e9 * I for I in p.second_moments) and k.torsion == STEEL.G * p.torsion_constant
    assert k.inertia[2] == pytest.approx(k.inertia[0] + k.inertia[1])
    xs, ys = zip(*k.outline, strict=True)
    assert (max(xs), max(ys), min(xs), min(ys)) == (0.05, 0.1, -0.05, -0.1) and len(k.outline) == 12
    following = k.outline[1:] + k.outline[:1]
    without_fillets = sum(x * v - u * y for (x, y), (u, v) in zip(k.outline, following, strict=True))
    assert without_fillets / 2 == pytest.approx(p.area - (4 - math.pi) * p.fillet**2)  # counterclockwise


@pytest.mark.parametrize(("given", "name"), [("ipe200", "IPE 200"), ("HE 160 A", "HEA 160"), (" heb 300", "HEB 300")])
def test_spellings(given, name):
    assert cf.Profile(given) == cf.Profile(name) and cf.Profile(given).name == name


@pytest.mark.parametrize(("given", "words"), [
    ("IPE 210", "Profile.name = 'IPE 210': did you mean IPE 180 or IPE 200 or IPE 220?"),
    ("INP 200", "expected IPE, HEA, HEB or HEM with its size"),
    ("HE", "expected IPE, HEA, HEB or HEM with its size"),
    (200, "Profile.name = 200: expected a name such as 'IPE 200'"),
])  # fmt: skip
def test_unknown_names(given, words):
    with pytest.raises(cf.SceneError) as refusal:
        cf.Profile(given)
    assert words in str(refusal.value)


def test_in_a_scene_file(tmp_path):
    """A cantilever by its dimensions of the table: the deflection of the beam with shear."""
    file = tmp_path / "beam.toml"
    file.write_text(
        """
supports = [{ type = "Clamp", station = "beam.start" }]
loads = [{ type = "Force", station = "beam.end", force = [0, 0, -10] }]

[[rods]]
name = "beam"
material = { E = 210e9 }
section = { type = "Profile", name = "IPE 200" }
curve = { type = "Line", start = [0, 0, 0], end = [3, 0, 0] }
"""
    )
    scene = cf.read(file).scene
    k = scene.rods[0].stiffness
    beam = 10 * 3**3 / (3 * k.bending[0]) + 10 * 3 / k.shear[1]
    assert cf.solve(scene, [1.0]).displacement("beam.end")[0, 2] == pytest.approx(-beam, rel=1e-6)
    file.write_text(file.read_text().replace("IPE 200", "IPE 201"))
    with pytest.raises(cf.SceneError, match=r"rods\[0\].section: Profile.name = 'IPE 201': did you mean .*IPE 200"):
        cf.read(file)
