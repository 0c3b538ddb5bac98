"""Quantities and the units in which they are shown."""

import numpy as np
import pytest

from cosserat_fenicsx import units
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.quantities import Quantity, Units, as_text

pytestmark = [pytest.mark.serial, pytest.mark.once]
LOAD = Quantity("hook_load", unit="N")


@pytest.mark.parametrize(
    ("chosen", "expected"),
    [
        ("SI", ("N", 1.0)),
        ("field", ("klbf", units.kip)),
        ({"force": "kN"}, ("kN", 1e3)),
        ({"[force]": "lbf"}, ("lbf", units.lbf)),
        ({"N": "MN"}, ("MN", 1e6)),
        ({"length": "ft"}, ("N", 1.0)),
    ],
)
def test_units_are_chosen_by_dimension_or_by_unit(chosen, expected):
    assert Units(chosen).of(LOAD) == pytest.approx(expected) and Units(Units(chosen)).of(LOAD) == Units(chosen).of(LOAD)


def test_field_units():
    told = {"m": "ft", "N m": "ft-lbf", "kg/m^3": "ppg", "rad/s": "rpm", "Pa": "psi", "kg m/s": "kg m/s", "deg": "deg"}
    assert {unit: Units("field").of(Quantity("x", unit=unit))[0] for unit in told} == told
    assert Units("field").of(Quantity("x", unit="m", dimension="diameter")) == ("in", units.inch)
    assert Units("field").of(Quantity("x", unit="deg")) == ("deg", 1.0)


@pytest.mark.parametrize(
    ("chosen", "words"),
    [
        ({"forse": "kN"}, "units.'forse'.: did you mean 'force'"),
        ({"force": "ft"}, "units.'force'. = 'ft': "),
        ("imperial", "units = 'imperial': expected 'SI', 'field' or a dict"),
    ],
)
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


def test_columns_and_values():
    place = Quantity("position", unit="m", parts="xyz", frame="inertial")
    values = np.array([[1.0, 2.0, 3.0]]) * units.foot
    columns = place.columns(values, Units({"m": "ft"}), "rod.end ")
    assert list(columns) == [f"rod.end position (ft) {x}" for x in "xyz"] and columns["rod.end position (ft) y"] == [2]
    assert LOAD.heading() == "hook load (N)" and Quantity("steps").heading() == "steps"
    assert [as_text(x) for x in (1.23456789, np.nan, True, "a", 3)] == ["1.23457", "-", "yes", "a", "3"]
    assert as_text(-1.887e-12, noise=1e-9) == "0"
    assert [as_text(x, 4) for x in (21987.4, -123456.7, 2e9, 1e-5)] == ["21987", "-123457", "2e+09", "1e-05"]
