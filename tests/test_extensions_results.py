"""Quantities of one's own: in tables, dicts, data frames, files, in other units, and of results that were stored."""

import csv
import importlib
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import column

import cosserat_fenicsx as cf

pytestmark = pytest.mark.serial


@pytest.fixture
def path(tmp_path, monkeypatch):
    """Solved and saved before the extension is imported."""
    _, scene = column()
    solved = cf.solve(scene, [0.5, 1.0], elements=2)
    assert "sway" not in solved.quantities and "slope" not in solved.to_dict()["rods"]["column"]
    solved.save(tmp_path / "before.h5")
    monkeypatch.syspath_prepend(Path(__file__).parent / "extensions")
    monkeypatch.setattr(cf.Path, "_quantities", cf.Path._quantities)  # forgotten after the test
    importlib.import_module("sway")
    yield cf.read_path(tmp_path / "before.h5")
    del sys.modules["sway"]


def test_a_quantity_of_a_path(path, tmp_path):
    expected = np.hypot(*path.displacement("column.end")[:, :2].T)
    assert path.quantities["sway"].unit == "m" and path.quantities["sway"].axes == ("point",)
    np.testing.assert_array_equal(path.value("sway"), expected)
    np.testing.assert_allclose(path.value("sway", "field"), expected / cf.units.foot, rtol=1e-15)
    path.write(tmp_path / "path.csv", units={"length": "ft"})
    with (tmp_path / "path.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["sway of the tip (ft)"]) for row in rows] == path.value("sway", "field").tolist()
    told = path.to_dict()
    assert told["units"]["sway"] == "m" and told["sway"].tolist() == expected.tolist()
    assert path.to_dataframe()["sway of the tip (m)"].tolist() == expected.tolist()


def test_a_quantity_along_rods(path, tmp_path):
    tree = path.to_xarray("field")
    assert tree["column"]["slope"].attrs["units"] == "deg" and tree["sway"].attrs["units"] == "ft"
    assert tree["column"]["position"].attrs["units"] == "ft"
    angle = np.degrees(path.rotation_angle("column.end"))
    np.testing.assert_allclose(tree["column"]["slope"].values[:, -1], angle, rtol=1e-6)
    path.save(tmp_path / "again.h5")
    path.write(tmp_path / "path.xdmf")
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "again.h5") as store, h5py.File(tmp_path / "path.h5") as series:
        assert store["sway"].attrs["units"] == "m" and store["rods/column/slope"].shape == tree["column/slope"].shape
        np.testing.assert_array_equal(series["slope_1"], tree["column/slope"].values[1])


def test_its_own_chart(path):
    pytest.importorskip("matplotlib")
    (panel,) = path.plot_quantity("sway", units="field").axes
    assert panel.get_ylabel() == "sway of the tip (ft)" and len(panel.lines) == 2
    np.testing.assert_allclose(panel.lines[1].get_ydata(), path.value("sway", "field").max())


def test_what_is_not_known_is_refused(path):
    with pytest.raises(cf.SceneError, match="value.'sways'.: expected one of .*sway"):
        path.value("sways")
    with pytest.raises(cf.SceneError, match="path.vtu: units is not for the ending '.vtu'"):
        path.write("path.vtu", units="field")
