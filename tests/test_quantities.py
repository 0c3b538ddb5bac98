"""Units by their definitions, quantities and the units in which they are shown, and studies as tables."""

import math

import numpy as np
import pytest
from fake_string import scene

import cosserat_fenicsx as cf
from cosserat_fenicsx import units
from cosserat_fenicsx.drilling.history import DrillingHistory
from cosserat_fenicsx.drilling.protocol import LEDGER, SERIES
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quantities import Quantity, Units, as_text

pytestmark = [pytest.mark.serial, pytest.mark.once]
LOAD = Quantity("hook_load", unit="N")


@pytest.mark.parametrize(("chosen", "expected"), [
    ("SI", ("N", 1.0)),
    ("field", ("klbf", units.kip)),
    ({"force": "kN"}, ("kN", 1e3)),
    ({"[force]": "lbf"}, ("lbf", units.lbf)),
    ({"N": "MN"}, ("MN", 1e6)),
    ({"length": "ft"}, ("N", 1.0)),
])  # fmt: skip
def test_units_are_chosen_by_dimension_or_by_unit(chosen, expected):
    assert Units(chosen).of(LOAD) == pytest.approx(expected) and Units(Units(chosen)).of(LOAD) == Units(chosen).of(LOAD)


def test_field_units():
    told = {"m": "ft", "N m": "ft-lbf", "kg/m^3": "ppg", "rad/s": "rpm", "Pa": "psi", "kg m/s": "kg m/s", "deg": "deg"}
    assert {unit: Units("field").of(Quantity("x", unit=unit))[0] for unit in told} == told
    assert Units("field").of(Quantity("x", unit="m", dimension="diameter")) == ("in", units.inch)
    assert Units("field").of(Quantity("x", unit="deg")) == ("deg", 1.0)


@pytest.mark.parametrize(("chosen", "words"), [
    ({"forse": "kN"}, "units.'forse'.: did you mean 'force'"),
    ({"force": "ft"}, "units.'force'. = 'ft': "),
    ("mm,m", "units = 'mm,m': 'mm' and a later one are units of the same kind: expected one of them"),
    ("kN, ft,in", "'ft' and a later one"),
    ("imperial", "units = 'imperial': expected 'SI', 'field' or a dict"),
])  # fmt: skip
def test_other_units_are_refused(chosen, words):
    with pytest.raises(SceneError, match=words):
        Units(chosen)


def test_prefixes_on_the_screen():
    """Those that people write: kN m, and never mN m."""
    sizes = {0.0: "N", 0.3: "N", 999.0: "N", 2e3: "kN", 3.2e6: "kN", 3.2e7: "MN", np.nan: "N"}
    assert {size: Units().on_screen(LOAD, [size])[0] for size in sizes} == sizes
    length = Quantity("x", unit="m")
    assert [Units().on_screen(length, [x])[0] for x in (2e-3, 0.5, 5e3)] == ["mm", "m", "m"]
    assert Units("field").on_screen(LOAD, [1.0]) == ("klbf", units.kip)
    assert Units().on_screen(Quantity("speed", unit="rad/s", shown="rpm"), [1.0]) == ("rpm", units.rpm)


@pytest.mark.parametrize(("text", "told"), [
    ("md = 304.8 to 609.6 m, 44.48 kN", "md = 1000 to 2000 ft, 10 klbf"),
    ("5 N m s/rad, 3 m/s, 2 N/m^2, 4 mm, 7 modes", "5 N m s/rad, 3 m/s, 2 N/m^2, 4 mm, 7 modes"),
    ("side force to 2.92 N/m (clearance 1.63e+03 N)", "side force to 0.2 lbf/ft (clearance 0.366 klbf)"),
    ("to 0.14 N m", "to 0.103 ft-lbf"),
    ("exerts (0, 0, 152609) N and (-1.5e+03, 0, 4.5) N m", "exerts (0, 0, 34.3079) klbf and (-1106, 0, 3.32) ft-lbf"),
    ("between -21 and 3 deg/30m, 30 m", "between -21.3 and 3.05 deg/100ft, 98.4 ft"),
])  # fmt: skip
def test_sentences_in_field_units(text, told):
    assert Units("field").sentence(text) == told and Units().sentence(text) == text
    assert Units({"length": "m"}).sentence("3.1 m") == "3.1 m" and Units({"m": "ft"}).sentence("1 kN") == "1 kN"


@pytest.mark.parametrize("chosen", ["kN, mm,MPa", {"force": "kN", "length": "mm", "pressure": "MPa"}])
def test_moments_follow_a_chosen_force(chosen):
    """kN m and kN/m, wherever a unit is shown, unless they are chosen as well."""
    text = "moment 2.262e+04 N m, shear 3 kN, (-2955.76, 0, 55169.6) N, stress 2.35e+08 Pa, 120 N/m, 0.19 m"
    told = "moment 22.62 kN m, shear 3 kN, (-2.95576, 0, 55.1696) kN, stress 235 MPa, 0.12 kN/m, 190 mm"
    assert Units(chosen).sentence(text) == told
    moment = Quantity("moment", unit="N m")
    assert Units(chosen).of(moment) == Units(chosen).on_screen(moment, [3.0]) == ("kN m", 1e3)
    assert Units({"force": "kN", "moment": "N m"}).of(moment) == ("N m", 1.0)
    assert Units("klbf,ft").of(moment) == ("ft-lbf", units.ft_lbf)
    assert Units("N,mm").sentence("2 kN, 5 kN m") == "2000 N, 5000 N m" and Units(chosen).chosen(LOAD) == ("kN", 1e3)
    with pytest.raises(SceneError, match="'ell' is none"):
        Units("kN,ell")


def test_sentences_follow_the_units():
    t = np.linspace(0, 10, 101)
    rows = np.zeros((101, 1 + len(SERIES) + len(LEDGER)))
    rows[:, 0] = t
    for name, value in (("drive_speed", 6.0), ("bit_speed", 6.0), ("surface_torque", 1e4 * cf.units.ft_lbf)):
        rows[:, 1 + SERIES.index(name)] = value
    rows[:, 1 + len(SERIES) + LEDGER.index("work_of_drive")] = 2e5 * cf.units.ft_lbf
    history = DrillingHistory(scene(), "torsion", ("torsion", "cells of 30.48 m at most"), 0.1, np.arange(2.0), rows)
    told = history.details("field")
    for words in ("surface torque 10000 to 10000 ft-lbf", "work of the drive 200000 ft-lbf", "cells of 100 ft at most"):
        assert words in told
    assert history.stick_slip().summary("field") in told and "kN m" not in told and "kJ" not in told
    assert str(history.stick_slip()).endswith("surface torque 13.56 to 13.56 kN m.")


def test_columns_and_values():
    place = Quantity("position", unit="m", parts="xyz", frame="inertial")
    values = np.array([[1.0, 2.0, 3.0]]) * units.foot
    columns = place.columns(values, Units({"m": "ft"}), "rod.end ")
    assert list(columns) == [f"rod.end position (ft) {x}" for x in "xyz"] and columns["rod.end position (ft) y"] == [2]
    assert LOAD.heading() == "hook load (N)" and Quantity("steps").heading() == "steps"
    assert [as_text(x) for x in (1.23456789, np.nan, True, "a", 3)] == ["1.23457", "-", "yes", "a", "3"]
    assert as_text(-1.887e-12, noise=1e-9) == "0"
    assert [as_text(x, 4) for x in (21987.4, -123456.7, 2e9, 1e-5)] == ["21987", "-123457", "2e+09", "1e-05"]


#: NIST Special Publication 811, appendix B: conversion factors, to all digits given there.
TABULATED = {
    "inch": 2.54e-2, "foot": 3.048e-1, "pound": 4.5359237e-1, "lbf": 4.448222, "kip": 4.448222e3,
    "kgf": 9.80665, "ft_lbf": 1.355818, "psi": 6.894757e3, "ksi": 6.894757e6, "lb_per_ft": 1.488164,
    "lbf_per_ft": 1.459390e1, "ppg": 1.198264e2, "deg": 1.745329e-2, "rpm": 1.047198e-1, "bar": 1e5,
}  # fmt: skip


@pytest.mark.parametrize("name", TABULATED)
def test_tabulated(name):
    assert getattr(units, name) == pytest.approx(TABULATED[name], rel=5e-7)


@pytest.mark.parametrize("modulus", ["210 GPa", "210000 N/mm2", "210 kN/mm^2", "21000 kN/cm^2", "210e6 kN/m^2"])
def test_units_of_stresses(modulus):
    """Those of structural engineers, in which a wrong guess is off by a million."""
    steel = cf.Material(E=modulus, nu=0.3, density="7.85 t/m^3")
    assert steel.E == pytest.approx(210e9, rel=1e-15) and steel.density == pytest.approx(7850.0, rel=1e-15)


def test_definitions():
    assert units.foot == 0.3048 and units.lbf == 0.45359237 * 9.80665 and units.psi * units.inch**2 == units.lbf
    assert units.lb_per_ft == pytest.approx(1.48816394, abs=5e-9) and units.ppg == pytest.approx(119.826427, abs=5e-7)
    assert units.ft_lbf == pytest.approx(1.35581795, abs=5e-9)
    assert 180 * units.deg == math.pi and 60 * units.rpm == pytest.approx(2 * math.pi, rel=1e-15)
    assert units.deg_per_100ft / units.deg_per_30m == pytest.approx(30 / 30.48, rel=1e-15)
    assert (units.mm, units.kN, units.GPa, units.minute) == (1e-3, 1e3, 1e9, 60.0)
    assert cf.units is units
    given = {name: value for name, value in vars(units).items() if not name.startswith("_") and name != "math"}
    assert all(type(value) is float and value > 0 for value in given.values()) and len(given) > 30


def product(a, b):
    if (a, b) == (2, "y"):
        raise ZeroDivisionError("two and y")
    return {"size": 2 * a, "pair": [a, len(b)], "name": f"{a}{b}", "a": -a}


@pytest.fixture
def found():
    return cf.study(product, {"a": [1, 2], "b": ["x", "y", "z"]})


def test_dataframe(found):
    pytest.importorskip("pandas")
    table = found.to_dataframe()
    assert list(table.columns) == ["a", "b", "size", "pair", "name", "a (result)", "failure"]
    assert table["a"].tolist() == [1, 1, 1, 2, 2, 2] and table["b"].tolist() == list("xyzxyz")
    np.testing.assert_array_equal(table["size"], [2, 2, 2, 4, np.nan, 4])
    assert table["pair"][3].tolist() == [2, 1] and table["name"].tolist() == ["1x", "1y", "1z", "2x", "", "2z"]
    assert table["failure"].map(bool).tolist() == [False] * 4 + [True, False]


def test_xarray_over_the_grid(found):
    pytest.importorskip("xarray")
    data = found.to_xarray()
    assert data.sizes == {"a": 2, "b": 3, "pair_0": 2} and data["b"].values.tolist() == ["x", "y", "z"]
    assert data["size"].sel(a=2, b="z") == 4 and np.isnan(data["size"].sel(a=2, b="y"))
    assert data["pair"].sel(a=1, b="z").values.tolist() == [1, 1] and data["name"].dims == ("a", "b")
    assert data["failure"].sel(a=2, b="y").item().startswith("ZeroDivisionError: two and y")


def test_xarray_over_cases_one_by_one():
    pytest.importorskip("xarray")
    operations = [cf.well.TripOut(), cf.well.TripIn()]
    found = cf.study(lambda how, s=0.0: s + 1, [{"how": operations[0]}, {"how": operations[1], "s": 2.0}])
    data = found.to_xarray()
    assert data["result"].dims == ("case",) and data["result"].values.tolist() == [1.0, 3.0]
    assert data["how"].values.tolist() == ["trip out", "trip in"]
    np.testing.assert_array_equal(data["s"], [np.nan, 2.0])
    assert found.to_dataframe()["how"].tolist() == operations
    found = cf.study(lambda n: np.arange(n), {"n": [2, 3]})
    assert [len(x) for x in found.to_dataframe()["result"]] == [2, 3]
    with pytest.raises(cf.SceneError, match="arrays of 'result' differ in shape"):
        found.to_xarray()


@pytest.mark.parametrize("cases", [{"s": [1.0, 2.0]}, [{"s": 1.0}, {"s": 2.0}]])
def test_xarray_in_other_units(cases):
    """Arguments and results alike, in the units that are told."""
    pytest.importorskip("xarray")
    found = cf.study(lambda s: {"depth": 2 * s, "count": 7}, cases)
    found.units |= {"s": "m", "depth": "m"}
    for asked, unit, size in (("SI", "m", 1.0), ("field", "ft", 0.3048)):
        data = found.to_xarray(asked)
        np.testing.assert_allclose(data["depth"], np.array([2.0, 4.0]) / size, rtol=1e-15)
        np.testing.assert_allclose(data["s"], np.array([1.0, 2.0]) / size, rtol=1e-15)
        assert data["depth"].attrs["units"] == data["s"].attrs["units"] == unit
        assert data["count"].values.tolist() == [7, 7]


def test_long_tables_are_shown_in_part():
    def fails(i):
        if i % 2:
            raise ValueError(f"odd {i}")
        return 0.5 * i

    text = str(cf.study(fails, {"i": range(100)}))
    assert "100 cases, 100 done, 50 failed" in text and "case 3 failed: ValueError: odd 3" in text
    assert "and 38 more: Study.failures has all" in text and "..." in text and len(text.splitlines()) <= 30
