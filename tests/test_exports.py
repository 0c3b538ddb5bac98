"""Results for other programs: CSV, dicts, pandas and xarray."""

import csv
import json
import sys
from xml.etree import ElementTree as xml

import numpy as np
import pytest
from conftest import COMM, column
from moving_scenes import SPAGHETTI

import cosserat_fenicsx as cf


@pytest.fixture(scope="module")
def path():
    """A column with an arm of a section without shape, in two points."""
    rod, scene = column()
    arm = cf.Rod(cf.Line((0, 0, 20), (1, 0, 20)), rod.stiffness, name="an/arm")
    joints = [cf.Joint(rod.end, arm.start)]
    return cf.solve(cf.Scene([rod, arm], scene.supports, scene.loads, joints, "two"), [0.4, 0.8], elements=2)


@pytest.fixture(scope="module")
def history():
    rod = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), SPAGHETTI, name="rod")
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, 2.0))])
    return cf.simulate(scene, 0.1, dt=0.05, elements=2, degree=2)


def rows_of(file):
    COMM.barrier()
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_tables_as_csv(path, history, tmp_path_all):
    path.write(tmp_path_all / "path.csv", station="column@7.5")
    rows = rows_of(tmp_path_all / "path.csv")
    assert [float(row["load factor"]) for row in rows] == [0.4, 0.8]
    heading = "column@7.5 displacement (m) x"
    assert [float(row[heading]) for row in rows] == path.displacement("column@7.5")[:, 0].tolist()
    history.write(tmp_path_all / "motion.csv")
    rows = rows_of(tmp_path_all / "motion.csv")
    assert [float(row["time (s)"]) for row in rows] == history.times.tolist() and "kinetic energy (J)" in rows[0]
    assert float(rows[-1]["rod.end velocity (m/s) z"]) == history.velocity("rod.end")[-1, 2]


def test_profiles_as_csv(path, tmp_path_all):
    """One rod at a point; all rods; unknown stresses are nan."""
    file = tmp_path_all / "profile.csv"
    path.write(file, 0, rod="column")
    rows, fields = rows_of(file), path.fields(0, "column")
    assert len(rows) == len(fields["s"]) and {row["rod"] for row in rows} == {"column"}
    for heading, values in (("s (m)", fields["s"]), ("inertial contact force (N) z", fields["force"][:, 2]),
                            ("material change of curvature (1/m) bending 2", fields["curvature"][:, 1]),
                            ("von Mises stress (Pa)", fields["von_mises"])):  # fmt: skip
        assert [float(row[heading]) for row in rows] == values.tolist()
    COMM.barrier()
    path.write(file, -1)
    rows = rows_of(file)
    assert [row["rod"] for row in rows] == ["column"] * 9 + ["an/arm"] * 9
    assert rows[-1]["von Mises stress (Pa)"] == "" and float(rows[-1]["s (m)"]) == 1.0


def test_what_does_not_fit_is_refused(path, tmp_path_all):
    for options, expected in (({"rod": "mast"}, "no rod is named 'mast'|mast"), ({"k": 7}, "expected .* from -2 to 1")):
        with pytest.raises(cf.SceneError, match=expected):
            path.write(tmp_path_all / "profile.csv", **options)
    with pytest.raises(cf.SceneError, match="station = 'column.end': expected None beside k or rod"):
        path.write(tmp_path_all / "profile.csv", 0, station="column.end")
    with pytest.raises(cf.SceneError, match="path.vtu: rod is not for the ending '.vtu': expected a file .csv"):
        path.write(tmp_path_all / "path.vtu", rod="column")
    if COMM.rank == 0:
        (tmp_path_all / "folder.csv").mkdir()
    with pytest.raises(OSError):
        path.write(tmp_path_all / "folder.csv", 0)
    assert [file.name for file in tmp_path_all.iterdir()] == ["folder.csv"]


def test_indices_are_whole_numbers(path):
    for wrong in ("x", 1.0, True):
        for asked in (lambda k: path[k], lambda k: path.at_points([k]), lambda k: path.fields(k)):
            with pytest.raises(cf.SceneError, match="expected the index of a load factor, a whole number from -2 to 1"):
                asked(wrong)
    with pytest.raises(IndexError, match=r"at_points\(\[99\]\): expected the index"):
        path.at_points([99])
    assert path[np.int64(1)].load_factors == [0.8]
    with pytest.raises(cf.SceneError, match="station = 'zz': expected 'rod.start', .* the rod one of column, an/arm"):
        path.stress("zz")


def test_dicts(path, history):
    told = path.to_dict()
    assert told["kind"] == "Path" and told["title"] == "two" and told["units"]["curvature"] == "1/m"
    assert told["frames"]["strain"].startswith("material")
    np.testing.assert_array_equal(told["rods"]["an/arm"]["moment"][1], path.fields(1, "an/arm")["moment"])
    np.testing.assert_array_equal(told["reaction_moment"][0], path.reaction(path.scene.supports[0])[1])
    again = json.loads(json.dumps(told, default=lambda array: array.tolist()))
    assert len(told["event_kind"]) == 0 and "event_kind" not in history.to_dict()
    assert again["load_factor"] == [0.4, 0.8] and again["support"] == ["Clamp at column.start"]
    told = history.to_dict()
    assert told["time"][-1] == 0.1 and told["rods"]["rod"]["velocity"].shape == (3, 5, 3)
    assert told["units"]["angular_momentum"] == "kg m^2/s" and told["scheme"] == history.scheme


def test_notebooks_show_a_table_and_a_picture(path, history):
    """Titles and names are text; the last line ends where the tip is, in the plane that shows most."""
    rod, scene = column()
    wild = cf.Scene([rod], scene.supports, scene.loads, title="<script>&")
    found = cf.solve(wild, np.linspace(0.1, 1.5, 12).tolist(), elements=2)
    for result, rows in ((path, 2), (history, 3), (found, 8)):
        text = result._repr_html_()
        page = xml.fromstring(text)
        assert len(text) < 4500 and len(page.findall(".//tr")) == rows + 1
    assert page.find(".//b").text == "<script>&" and "8 of 12 shown" in text
    *_, last = page.findall(".//polyline")
    corners = np.array([corner.split(",") for corner in last.get("points").split()], dtype=float)
    drawn, moved = corners[-1] - corners[0], found.position(rod.end)[-1]
    assert -drawn[1] / drawn[0] == pytest.approx(moved[2] / moved[0], abs=0.01)
    assert "&lt;Path: 0 points, empty" in found.at_points([])._repr_html_()


@pytest.mark.serial
def test_pandas(path, history, tmp_path):
    import pandas

    table = path.to_dataframe()
    path.write(tmp_path / "path.csv")
    pandas.testing.assert_frame_equal(table.reset_index(drop=True), pandas.read_csv(tmp_path / "path.csv"))
    along = history.to_dataframe(rod="rod")
    np.testing.assert_array_equal(along["velocity (m/s) z"], history.fields(-1)["velocity"][:, 2])
    assert along.index.name == "node" and table.index.name == "point"


@pytest.mark.serial
def test_xarray(path, history, tmp_path):
    """A load factor may occur twice: it is no index. The tree goes through a netCDF file."""
    import xarray

    turned = path.at_points([0, 1, 0])
    tree = turned.to_xarray()
    tree.to_netcdf(tmp_path / "path.nc", engine="h5netcdf")
    for found in (tree, xarray.open_datatree(tmp_path / "path.nc", engine="h5netcdf")):
        arm = found["an|arm"]
        assert arm["load_factor"].values.tolist() == [0.4, 0.8, 0.4] and "load_factor" not in arm.indexes
        assert arm["force"].dims == ("point", "s", "component") and arm["force"].attrs["units"] == "N"
        tip = found["column"]["displacement"].isel(point=1).sel(s=20.0, component="x")
        assert float(tip) == path.displacement("column.end")[1, 0]
        assert found["reaction_force"].sel(support="Clamp at column.start").shape == (3, 3)
        assert found["stable"].values.tolist() == [True] * 3
    tree = history.to_xarray()
    np.testing.assert_array_equal(tree["rod/velocity"][-1], history.fields(-1)["velocity"])
    assert tree["kinetic_energy"].attrs["units"] == "J" and tree["rod"]["time"].attrs["units"] == "s"


@pytest.mark.serial
def test_what_is_missing_is_told(path, monkeypatch):
    for library, method in (("pandas", "to_dataframe"), ("xarray", "to_xarray")):
        monkeypatch.setitem(sys.modules, library, None)
        with pytest.raises(cf.InstallationError, match=rf"{method} needs {library}, .* 'cosserat-fenicsx\[data\]'"):
            getattr(path, method)()
