"""The closed forms and high-precision references, against numbers computed by other methods and against each other."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from cosserat_fenicsx import NotConverged, SceneError
from cosserat_fenicsx.analytic import Tip, elastica, planar_tip, reissner, secant_delta, transverse_tip_force

pytestmark = [pytest.mark.serial, pytest.mark.once]

# The paper's rod: L = 20 m, d = 0.2 m, E = 210 GPa, nu = 0.3, e = L/100.
LENGTH, DIAMETER, E, NU = 20.0, 0.2, 210e9, 0.3
ECCENTRICITY = LENGTH / 100
AREA = math.pi * DIAMETER**2 / 4
STIFFNESS = {
    "bending": E * math.pi * DIAMETER**4 / 64,
    "axial": E * AREA,
    "shear": 6 * (1 + NU) / (7 + 6 * NU) * E / (2 * (1 + NU)) * AREA,
}
RIGID = {"bending": 1.0, "axial": math.inf, "shear": math.inf}
POINTS = json.loads((Path(__file__).parent / "reference" / "eccentric_cantilever.json").read_text(encoding="utf-8"))[
    "points"
]
ETA = np.array([point["eta"] for point in POINTS])
FIELDS = ("delta", "shortening", "tip_rotation")


def assert_tips_agree(tip, other, rtol):
    for field in FIELDS:
        np.testing.assert_allclose(getattr(tip, field), getattr(other, field), rtol=rtol, err_msg=field)


@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("model", ["elastica", "reissner"])
def test_eccentric_cantilever(model, field):
    """Shooting of the strong form with 40 digits."""
    if model == "elastica":
        tip = elastica(ETA, ECCENTRICITY, LENGTH)
    else:
        tip = reissner(ETA, ECCENTRICITY, LENGTH, **STIFFNESS)
    np.testing.assert_allclose(getattr(tip, field), [point[model][field] for point in POINTS], rtol=1e-13)


def test_turning_arm():
    """To the nine digits of the file (eight at eta = 1.5, where it rounds 15.76237478 to 15.762375)."""
    known = [point for point in POINTS if point["eccentric_arm_delta"] is not None]
    tip = reissner([point["eta"] for point in known], ECCENTRICITY, LENGTH, **STIFFNESS, arm=True)
    np.testing.assert_allclose(tip.delta, [point["eccentric_arm_delta"] for point in known], rtol=2e-8)


@pytest.mark.parametrize("eta, delta, shortening, tip_rotation", [
    (0.9, 2.1689562695492, 0.1471325194519424, 0.175892285453352),
    (1.1, 10.74888227922008, 4.091008973247912, 0.9281897906591813),
    (1.5, 15.76237478160241, 12.67348426472652, 1.716489358920807),
    (2.0, 15.97665178536152, 18.44006403193293, 2.156423151699256),
])  # fmt: skip
def test_turning_arm_in_full(eta, delta, shortening, tip_rotation):
    """Shooting of n' = 0, m' + r' x n = 0 by Taylor series with 25 digits; from 1.5 on the tip moment is negative."""
    tip = reissner(eta, ECCENTRICITY, LENGTH, **STIFFNESS, arm=True)
    assert_tips_agree(tip, Tip(delta, shortening, tip_rotation), 1e-13)


@pytest.mark.parametrize("ratio, rtol", [(1e-4, 1e-12), (0.01, 1e-13), (0.1, 5e-14), (0.5, 5e-14)])
def test_collocation_equals_elliptic_integrals(ratio, rtol):
    """Independent methods, below and beyond the buckling load and where the tip passes pi."""
    eta = [1e-6, 0.3, 0.99, 1.0, 1.2, 4.0] if ratio == 0.5 else [1e-6, 0.3, 0.99, 1.0, 1.2, 4.0, 9.0, 30.0]
    assert_tips_agree(reissner(eta, ratio * 3.0, 3.0, **RIGID), elastica(eta, ratio * 3.0, 3.0), rtol)


def test_secant_formula_is_the_limit_of_small_deflections():
    eta = np.array([0.01, 0.5, 0.9])
    np.testing.assert_allclose(elastica(eta, 1e-8, 1.0).delta, secant_delta(eta, 1e-8), rtol=1e-12)
    excess = secant_delta(0.9, ECCENTRICITY) / elastica(0.9, ECCENTRICITY, LENGTH).delta - 1
    assert excess == pytest.approx(0.0381, abs=1e-4)


def test_secant_formula_at_its_pole():
    np.testing.assert_array_equal(secant_delta([0.0, 1.0, 1.5], 0.2), [0.0, np.inf, np.nan])
    assert secant_delta(4 / 9, 0.2) == pytest.approx(0.2, rel=1e-15)  # sec(pi/3) = 2


def test_transverse_tip_force():
    """Mattiasson (1981): P L^2/EI, w/L, u/L, tip angle; recomputed to ten digits."""
    table = np.array(
        [
            (1, 0.3017207738, 0.0564332363, 0.4613519497),
            (2, 0.4934574804, 0.1606417208, 0.7817498316),
            (5, 0.7137915236, 0.3876283607, 1.2153681176),
            (10, 0.8106090249, 0.5549955978, 1.4302855388),
        ]
    ).T
    tip = transverse_tip_force(table[0])
    np.testing.assert_allclose([tip.delta, tip.shortening, tip.tip_rotation], table[1:], rtol=0, atol=5.1e-11)


@pytest.mark.parametrize("axial", [math.inf, 100.0])
def test_moment_alone_rolls_the_rod_up(axial):
    tip = planar_tip([0.5, 1, 10], 2.0, bending=3.0, axial=axial, moment=3 * math.pi)
    np.testing.assert_allclose(tip.delta, [4 / math.pi, 0, 0], atol=1e-13)
    np.testing.assert_allclose(tip.shortening, 2.0, atol=1e-13)
    np.testing.assert_allclose(tip.tip_rotation, [math.pi, 2 * math.pi, 20 * math.pi], rtol=1e-14)


def test_axial_force_alone():
    """Straight up to the load at which the compressed rod, P (1 + P (1/GA - 1/EA)) = P_cr, buckles; refused beyond."""
    column = {"bending": 1.0, "axial": 100.0, "shear": 40.0, "force": (0.0, -1.0)}
    critical = (math.sqrt(1 + 4 * (1 / 40 - 1 / 100) * math.pi**2 / 4) - 1) / (2 * (1 / 40 - 1 / 100))
    assert planar_tip(0.999 * critical, 1.0, **column).shortening == pytest.approx(0.00999 * critical, rel=1e-14)
    with pytest.raises(NotConverged, match=f"load factor {critical:.5f}"):
        planar_tip(2 * critical, 1.0, **column)


def test_shape_and_order_of_the_load_factors():
    scalar = reissner(1.5, 0.1, 1.0, **RIGID)
    assert all(isinstance(getattr(scalar, field), float) for field in FIELDS)
    for solve in (lambda eta: reissner(eta, 0.1, 1.0, **RIGID), lambda eta: elastica(eta, 0.1, 1.0)):
        tip = solve([[1.5, 0.2], [0.0, 1.5]])
        assert tip.delta.shape == (2, 2)
        assert tip.delta[0, 0] == tip.delta[1, 1] == pytest.approx(scalar.delta, rel=1e-13)
        assert tip.delta[1, 0] == tip.shortening[1, 0] == tip.tip_rotation[1, 0] == 0


@pytest.mark.parametrize("field, refused", [
    ("eta", lambda: secant_delta(-0.1, 0.2)),
    ("eta", lambda: elastica([0.5, np.nan], 0.2, 1.0)),
    ("eta", lambda: reissner(np.inf, 0.2, 1.0, **RIGID)),
    ("eta", lambda: secant_delta("1", 0.2)),
    ("eccentricity", lambda: secant_delta(0.5, 0.0)),
    ("eccentricity", lambda: reissner(0.5, -0.2, 1.0, **RIGID)),
    ("length", lambda: elastica(0.5, 0.2, 0.0)),
    ("bending", lambda: reissner(0.5, 0.2, 1.0, bending=np.inf, axial=1.0, shear=1.0)),
    ("axial", lambda: reissner(0.5, 0.2, 1.0, bending=1.0, axial=0.0, shear=1.0)),
    ("shear", lambda: reissner(0.5, 0.2, 1.0, bending=1.0, axial=1.0, shear=-1.0)),
    ("arm", lambda: reissner(0.5, 0.2, 1.0, **RIGID, arm=1)),
    ("load", lambda: transverse_tip_force(-1.0)),
    ("force", lambda: planar_tip(1.0, 1.0, bending=1.0, force=(0, 0, 1))),
    ("the tip turns by 2 pi", lambda: elastica(9.0, 0.5, 1.0)),
])  # fmt: skip
def test_bad_input_is_refused_by_name(field, refused):
    with pytest.raises(SceneError, match=field):
        refused()
