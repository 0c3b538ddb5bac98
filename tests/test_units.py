"""Units by their definitions, and by conversions that are tabulated."""

import math

import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx import units

pytestmark = [pytest.mark.serial, pytest.mark.once]

#: NIST Special Publication 811, appendix B: conversion factors, to all digits given there.
TABULATED = {
    "inch": 2.54e-2, "foot": 3.048e-1, "pound": 4.5359237e-1, "lbf": 4.448222, "kip": 4.448222e3,
    "kgf": 9.80665, "ft_lbf": 1.355818, "psi": 6.894757e3, "ksi": 6.894757e6, "lb_per_ft": 1.488164,
    "lbf_per_ft": 1.459390e1, "ppg": 1.198264e2, "deg": 1.745329e-2, "rpm": 1.047198e-1, "bar": 1e5,
}  # fmt: skip


@pytest.mark.parametrize("name", TABULATED)
def test_tabulated(name):
    assert getattr(units, name) == pytest.approx(TABULATED[name], rel=5e-7)


def test_definitions():
    assert units.foot == 0.3048 and units.lbf == 0.45359237 * 9.80665 and units.psi * units.inch**2 == units.lbf
    assert units.lb_per_ft == pytest.approx(1.48816394, abs=5e-9) and units.ppg == pytest.approx(119.826427, abs=5e-7)
    assert units.ft_lbf == pytest.approx(1.35581795, abs=5e-9)
    assert 180 * units.deg == math.pi and 60 * units.rpm == pytest.approx(2 * math.pi, rel=1e-15)
    assert units.deg_per_100ft / units.deg_per_30m == pytest.approx(30 / 30.48, rel=1e-15)
    assert (units.mm, units.kN, units.GPa, units.minute) == (1e-3, 1e3, 1e9, 60.0)


def test_all_are_floats_and_easy_to_reach():
    assert cf.units is units
    given = {name: value for name, value in vars(units).items() if not name.startswith("_") and name != "math"}
    assert all(type(value) is float and value > 0 for value in given.values()) and len(given) > 30
