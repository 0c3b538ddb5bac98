"""Studies as tables of pandas and xarray."""

import numpy as np
import pytest

import cosserat_fenicsx as cf

pytestmark = [pytest.mark.serial, pytest.mark.once]


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


def test_arrays_of_different_shapes():
    pytest.importorskip("xarray")
    found = cf.study(lambda n: np.arange(n), {"n": [2, 3]})
    assert [len(x) for x in found.to_dataframe()["result"]] == [2, 3]
    with pytest.raises(cf.SceneError, match="arrays of 'result' differ in shape"):
        found.to_xarray()


def test_long_tables_are_shown_in_part():
    def fails(i):
        if i % 2:
            raise ValueError(f"odd {i}")
        return 0.5 * i

    text = str(cf.study(fails, {"i": range(100)}))
    assert "100 cases, 100 done, 50 failed" in text and "case 3 failed: ValueError: odd 3" in text
    assert "and 38 more: Study.failures has all" in text and "..." in text and len(text.splitlines()) <= 30
