"""Results in files and for other programs: the same digits after reading, tables, copies and pickles."""

import copy
import csv
import json
import math
import pickle
import shutil
import sys
from xml.etree import ElementTree as xml

import numpy as np
import pytest
from conftest import COMM, column
from moving_scenes import SPAGHETTI

import cosserat_fenicsx as cf

OF_PATH = (
    "load_factors", "negative_modes", "stable", "error", "conservative", "control", "left", "rounding", "galerkin",
)  # fmt: skip
OF_HISTORY = ("times", "steps", "kinetic", "strain", "work", "dissipated", "balance", "linear_momentum",
              "angular_momentum", "scheme", "time_unit")  # fmt: skip
LARGEST = ("size", "station", "point")


def frame():
    """A path of two joined rods, in their plane, with a clamp, a roller, pieces of sections and loads along."""
    steel = cf.Material(210e9, 0.3, 7850.0)
    pieces = [(1.0, cf.Tube(0.1, 0.08)), (3.0, cf.Circle(0.05))]
    post = cf.Rod(cf.Line((0, 0, 0), (0, 0, 3)), pieces, steel, name="post")
    arm = cf.Rod(cf.Arc((0, 0, 2), (0, 0, 3), 1.0, axis=(0, 1, 0)), cf.Rectangle(0.05, 0.1), steel, name="an/arm")
    loads = [cf.Force(arm.end, (500.0, 0, -900.0)), cf.LineForce(arm, (0, 0, -100.0), permanent=True),
             cf.Spring(arm.end, 300.0)]  # fmt: skip
    supports = [cf.Clamp(post.start), cf.Roller(post.at(1.5), (1, 0, 0))]
    return cf.Scene([post, arm], supports, loads, [cf.Joint(post.end, arm.start)], title="a <b> & \u03b1")


def buckled():
    """A column in space over its bifurcation."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), cf.Stiffness((1e4, 1e4), 1e5, (1.0, 2.0), 1.0), name="rod")
    return cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -cf.euler_load(rod)))])


def swinging(force=cf.signals.Sine((0, 0, 2.0), 0.5)):
    rod = cf.Rod(cf.Line((0, 0, 0), (10, 0, 0)), SPAGHETTI, name="rod", damping=cf.Damping(drag=0.1))
    return rod, cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, force)])


def moved(scene, **more):
    return cf.simulate(scene, 0.2, dt=0.05, elements=3, degree=2, **more)


def assert_same(one, other, names):
    assert repr(one) == repr(other) and len(one) == len(other)
    assert list(one.why) == list(other.why) and one.scene.title == other.scene.title
    for name in (*names, "iterations", "along_axis", "elements", "formulation"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    for rod in one.scene.rods:
        station = f"{rod.name}@{0.37 * rod.length}"
        for query in ("position", "rotation", "rotation_angle", "force", "moment"):
            np.testing.assert_array_equal(getattr(one, query)(station), getattr(other, query)(station), err_msg=query)
        for k in (0, -1):
            fields = other.fields(k, rod.name)
            for name, values in one.fields(k, rod).items():
                np.testing.assert_array_equal(values, fields[name], err_msg=name)
    for mine, theirs in zip(one.scene.supports, other.scene.supports, strict=True):
        np.testing.assert_array_equal(one.reaction(mine), other.reaction(theirs))
    largest = other.largest()
    for name, value in one.largest().items():
        assert [str(getattr(value, x)) for x in LARGEST] == [str(getattr(largest[name], x)) for x in LARGEST]


@pytest.mark.parametrize("solved", [
    lambda: cf.solve(frame(), [0.5, 1.0], elements=2),
    lambda: cf.solve(column()[1], [0.3, 0.6], tol=1e-4),
    lambda: cf.solve(buckled(), (0.5, 1.1), elements=4, model="spatial", branch=1),
])  # fmt: skip
def test_a_path_with_the_same_digits(solved, tmp_path_all):
    path = solved()
    path.save(tmp_path_all / "path.h5")
    again = cf.read_path(tmp_path_all / "path.h5")
    assert_same(path, again, OF_PATH)
    assert type(again) is cf.Path and path.comm.size == again.comm.size and again.why == list(path.why)
    assert len(path.events) == len(again.events) == (1 if path.left else 0)
    for one, other in zip(path.events, again.events, strict=True):
        assert repr(one) == repr(other)
        np.testing.assert_array_equal(path.mode(one), again.mode(other, "rod"))


def test_a_history_with_the_same_digits(tmp_path_all):
    for history in (moved(swinging()[1]), moved(swinging()[1], folder=tmp_path_all / "motion")):
        history.save(tmp_path_all / "motion.h5")
        again = cf.read_history(tmp_path_all / "motion.h5")
        assert_same(history, again, OF_HISTORY)
        assert type(again) is cf.History and history.comm.size == again.comm.size
        for query in ("velocity", "angular_velocity"):
            np.testing.assert_array_equal(getattr(history, query)("rod.end"), getattr(again, query)("rod.end"))
    with pytest.raises(cf.SceneError, match="read_history.scene = .* expected None, since the file"):
        cf.read_history(tmp_path_all / "motion.h5", history.scene)


@pytest.mark.serial
def test_h5py_alone_reads_it(tmp_path):
    import h5py

    path = cf.solve(frame(), [0.5, 1.0], elements=2)
    path.save(tmp_path / "path.h5")
    assert [x.name for x in tmp_path.iterdir()] == ["path.h5"]
    with h5py.File(tmp_path / "path.h5") as store:
        assert store["load_factor"][:].tolist() == [0.5, 1.0]
        arm, expected = store["rods/an|arm"], path.fields(-1, "an/arm")
        assert arm.attrs["rod"] == "an/arm" and arm["moment"].attrs["units"] == "N m"
        assert arm["strain_component"].asstr()[:].tolist() == ["shear 1", "shear 2", "stretch"]
        for name, values in expected.items():
            np.testing.assert_allclose(arm[name][-1] if name != "s" else arm[name], values, rtol=1e-12, atol=1e-9)
        assert [dim.label for dim in arm["position"].dims] == ["point", "s", "component"]
        np.testing.assert_array_equal(store["reaction_force"][0], path.reaction(path.scene.supports[0])[0])
        assert json.loads(store["scene"].asstr()[()])["title"] == path.scene.title


@pytest.mark.serial
def test_damaged_and_foreign_files_are_refused(tmp_path):
    import h5py

    file, other = tmp_path / "path.h5", tmp_path / "other.h5"
    cf.solve(column()[1], [0.3], elements=2).save(file)

    def replace(store, name, value):
        crc = store[name].attrs["crc32"]
        del store[name]
        store[name] = value
        store[name].attrs["crc32"] = crc

    def swap_digit(store):
        values = store["solution/rq"][:]
        values[0, 1, 0] += 1e-15
        store["solution/rq"][...] = values

    def sparse(store):
        del store["solution/rq"]
        store.create_dataset("solution/rq", (10**6, 10**6, 7), float)

    whole = file.read_bytes()
    (tmp_path / "half.h5").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "text.h5").write_text("load factor, position\n")
    for name, expected in {"half.h5": "half.h5: it cannot be read", "text.h5": "text.h5: it cannot be read",
                           "none.h5": "none.h5: there is no such file"}.items():  # fmt: skip
        with pytest.raises(cf.SceneError, match=expected):
            cf.read_path(tmp_path / name)
    for readers, change, expected in (
        ([cf.read_path], swap_digit, "is damaged .*check sum of rq is wrong"),
        ([cf.read_path], sparse, "is damaged .*rq is neither a text nor an array"),
        ([cf.read_path], lambda store: replace(store, "scene", "{}"), "is damaged .*check sum of scene"),
        ([cf.read_path], lambda store: store.pop("solution/gauss"), "is damaged .*gauss"),
        ([cf.read_path, cf.read_result], lambda store: store.attrs.update(version=99),
         "its format is 99, and this release reads up to 1"),
        ([cf.read_path, cf.read_result], lambda store: store.attrs.update(format="another"),
         "it is of another program"),
        ([cf.read_path], lambda store: store.attrs.update(kind="History"),
         "it holds a History: expected a Path; read_result reads any"),
        ([cf.read_result], lambda store: store.attrs.update(kind="Nothing"), "is damaged .*Nothing"),
        ([cf.read_history], lambda store: None, "it holds a Path: expected a History; read_result reads any"),
    ):  # fmt: skip
        shutil.copy(file, other)
        with h5py.File(other, "r+") as store:
            change(store)
        for read in readers:
            with pytest.raises(cf.SceneError, match=f"other.h5.*{expected}"):
                read(other)


@pytest.mark.serial
def test_scenes_with_code_are_not_saved(tmp_path_all):
    """An old file stays."""
    rod, scene = column(section=lambda s: cf.Circle(0.2 + 0.001 * s))
    file = tmp_path_all / "path.h5"
    if COMM.rank == 0:
        file.write_text("old")
    path = cf.solve(scene, [0.3], elements=2)
    with pytest.raises(cf.SceneError, match=r"path.h5: rods\[0\].section: a function written in Python cannot be"):
        path.save(file)
    with pytest.raises(cf.SceneError, match="save: expected a result with at least one load factor"):
        path.at_points([]).save(file)
    COMM.barrier()
    assert file.read_text() == "old"


ETAS = [0.3, 0.9, 1.5]


@pytest.fixture(scope="module")
def solved():
    rod, scene = column()
    return rod, cf.solve(scene, ETAS, elements=4)


@pytest.fixture
def xdmf(solved, tmp_path_all):
    file = tmp_path_all / "path.xdmf"
    solved[1].write(file)
    COMM.barrier()
    return file


def check(data, rod, path, k):
    """All fields of the file against those of the path, and against each other."""
    expected = path.fields(k, rod)
    data = {name: np.asarray(data[name]) for name in data.keys()}
    data["quaternion"] = np.column_stack([data["quaternion_a"], data["quaternion_bcd"]])
    for name, field in (("position", "position"), ("displacement", "displacement"), ("quaternion", "quaternion"),
                        ("d1", "d1"), ("d2", "d2"), ("d3", "d3"), ("n", "force"), ("m", "moment"),
                        ("strain", "strain"), ("curvature", "curvature"), ("arc_length", "s"),
                        *((name, name) for name in ("von_mises", "axial_max", "axial_min"))):  # fmt: skip
        scale = np.abs(expected[field]).max()
        np.testing.assert_allclose(data[name], expected[field], atol=1e-6 * scale, err_msg=name)
    d = [np.asarray(data[name]) for name in ("d1", "d2", "d3")]
    np.testing.assert_allclose(np.cross(d[0], d[1]), d[2], atol=1e-6)
    k = rod.stiffness  # laws (2)-(3): material strains from inertial n and m
    np.testing.assert_allclose(np.einsum("ij,ij->i", d[2], data["n"]) / k.axial, data["strain"][:, 2], atol=1e-12)
    np.testing.assert_allclose(
        np.einsum("ij,ij->i", d[1], data["m"]) / k.bending[1], data["curvature"][:, 1], atol=1e-9
    )


def test_meshio_reads_the_xdmf(solved, xdmf):
    import meshio

    rod, path = solved
    with meshio.xdmf.TimeSeriesReader(xdmf) as reader:
        points, cells = reader.read_points_cells()
        assert cells[0].type == "line" and len(cells[0].data) == 4 * 4
        np.testing.assert_allclose(points[-1], [0, 0, 20])
        assert reader.num_steps == len(ETAS)
        for k, eta in enumerate(ETAS):
            time, data, _ = reader.read_data(k)
            assert time == eta
            check(data, rod, path, k)


@pytest.mark.serial
def test_pyvista_reads_the_xdmf_and_one_state_in_other_formats(solved, xdmf, tmp_path):
    import pyvista

    rod, path = solved
    reader = pyvista.get_reader(str(xdmf))
    assert reader.time_values == ETAS
    for k, eta in enumerate(ETAS):
        reader.set_active_time_value(eta)
        check(reader.read().point_data, rod, path, k)
    for ending in (".vtu", ".vtk"):
        path.write(tmp_path / f"state{ending}", k=1)
        data = pyvista.read(tmp_path / f"state{ending}")
        np.testing.assert_allclose(data.points[-1], path.position(rod.end)[1], rtol=1e-6, atol=1e-6)
        assert data["quaternion"].shape == (17, 4)


@pytest.mark.serial
def test_rods_are_told_apart(tmp_path):
    """By a number at every node; names and units stand at the top. Without a shape there are no stresses."""
    import meshio
    import pyvista

    rod, scene = column()
    bare = cf.Rod(cf.Line((0, 0, 20), (1, 0, 20)), rod.stiffness, name='bare {k} & "<arm>"')
    joints = [cf.Joint(rod.end, bare.start)]
    path = cf.solve(cf.Scene([rod, bare], scene.supports, scene.loads, joints), [0.3], elements=2, degree=2)
    path.write(tmp_path / "two.xdmf")
    with meshio.xdmf.TimeSeriesReader(tmp_path / "two.xdmf") as reader:
        reader.read_points_cells()
        assert reader.read_data(0)[1]["rod"].tolist() == [0] * 5 + [1] * 5
    data = pyvista.get_reader(str(tmp_path / "two.xdmf")).read().point_data
    assert (np.isnan(data["von_mises"]) == (data["rod"] == 1)).all() and data["arc_length"][-1] == 1.0
    top = xml.parse(tmp_path / "two.xdmf").getroot().find("Domain")
    told = {entry.get("Name"): entry.get("Value") for entry in top.findall("Information")}
    assert told["rods"] == '0: column; 1: bare {k} & "<arm>"'
    assert "von_mises: Pa" in told["units"] and "arc_length: m" in told["units"]


@pytest.mark.ranks
def test_unwritable_and_unknown_files(solved, tmp_path_all):
    _, path = solved
    (tmp_path_all / "folder.xdmf").mkdir(exist_ok=True)
    COMM.barrier()
    with pytest.raises(OSError):
        path.write(tmp_path_all / "folder.xdmf")
    with pytest.raises(cf.SceneError, match="the ending '.xyzzy' is not known"):
        path.write(tmp_path_all / "state.xyzzy")
    with pytest.raises(cf.NotConverged) as refusal:
        cf.solve(path.scene, [0.5], elements=4, steps=cf.StepControl(max_iterations=1), control="load")
    with pytest.raises(cf.SceneError, match="no point to write"):
        refusal.value.path.write(tmp_path_all / "path.xdmf")


@pytest.mark.ranks
def test_picture(solved, tmp_path_all):
    """The rods are visible in more than one colour, the title of the colour bar is black on white."""
    _, path = solved
    file = tmp_path_all / "rods.png"
    path.plot(file)
    if COMM.rank == 0:
        from matplotlib.image import imread

        image = imread(file)[:, :, :3]
        assert image.shape == (1000, 1400, 3)
        vivid = (image.max(axis=2) - image.min(axis=2)) > 0.25
        assert 0.01 < vivid.mean() < 0.3
        assert (image.min(axis=2) > 0.99).mean() > 0.5
    COMM.barrier()


@pytest.mark.serial
def test_a_polynomial_field_is_interpolated_between_nodes(solved):
    rod, path = solved
    s = path.fields(2, rod)["s"]
    at_nodes = np.array([path.position(rod.at(x))[2] for x in s])
    np.testing.assert_allclose(at_nodes, path.centreline(2), atol=1e-12 * 20)
    q = path.rotation(rod.at(7.777))
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1)


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


@pytest.mark.serial
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


@pytest.mark.serial
def test_indices_are_whole_numbers(path):
    for wrong in ("x", 1.0, True, np.array([0, 1])):
        for asked in (lambda k: path[k], lambda k: path.at_points([k]), lambda k: path.fields(k)):
            with pytest.raises(cf.SceneError, match="expected the index of a load factor, a whole number from -2 to 1"):
                asked(wrong)
    with pytest.raises(IndexError, match=r"at_points\(\[99\]\): expected the index"):
        path.at_points([99])
    assert path[np.int64(1)].load_factors == [0.8]
    with pytest.raises(cf.SceneError, match="station = 'zz': expected 'rod.start', .* the rod one of column, an/arm"):
        path.stress("zz")


@pytest.mark.serial
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


@pytest.mark.serial
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


@pytest.mark.parametrize("model", ["determinate", "planar", "spatial"])
def test_path(model):
    """Also during the computation: a copy made in `until` is complete, and the path continues."""
    rod, scene = column()
    seen = []

    def keep(path):
        seen.append((copy.deepcopy(path), pickle.loads(pickle.dumps(path)), len(path)))

    path = cf.solve(scene, (0.0, 0.9), elements=4, model=model, until=keep)
    for copied, loaded, count in seen:
        assert len(copied) == len(loaded) == count
        at = [copied.displacement(rod.end), loaded.displacement("column.end")]
        np.testing.assert_array_equal(at, [path.displacement(rod.end)[:count]] * 2)
    for other in (copy.copy(path), copy.deepcopy(path), pickle.loads(pickle.dumps(path))):
        assert_same(path, other, OF_PATH)
    loaded = pickle.loads(pickle.dumps(path))
    assert loaded.comm.size == 1 and path.comm.size == copy.deepcopy(path).comm.size == COMM.size
    assert loaded.scene is not scene and copy.deepcopy(path).scene is scene
    assert len(loaded.at_points([1, 2])) == 2
    before, other = path.position(rod.end), copy.deepcopy(path)
    other._records[0].rq[:] = 0.0
    other.events.append("something")
    np.testing.assert_array_equal(path.position(rod.end), before)
    assert not path.events
    np.testing.assert_array_equal(cf.solve(loaded.scene, [0.3], elements=4).force("column.end"),
                                  cf.solve(scene, [0.3], elements=4).force("column.end"))  # fmt: skip


def test_history(tmp_path):
    """It is refused as a start, because its velocities would be lost silently."""
    rod, scene = swinging()
    history = moved(scene)
    for other in (copy.copy(history), copy.deepcopy(history), pickle.loads(pickle.dumps(history))):
        assert_same(history, other, OF_HISTORY)
        np.testing.assert_array_equal(other.velocity("rod.end"), history.velocity(rod.end))
    assert not isinstance(history, cf.Path) and not hasattr(history, "load_factors")
    with pytest.raises(cf.SceneError, match="expected a load factor, a Path"):
        moved(scene, start=history)
    if COMM.size == 1:
        for found in (pickle.loads(pickle.dumps(x)) for x in (history, cf.solve(column()[1], [0.3], elements=4))):
            found.write(tmp_path / "path.xdmf")
            found.write(tmp_path / "point.vtu", 0)
            assert (tmp_path / "path.xdmf").stat().st_size > 0 and (tmp_path / "point.vtu").stat().st_size > 0


@pytest.mark.serial
def test_a_stored_history_goes_by_its_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rod, scene = swinging()
    history = moved(scene, folder="motion")
    text = pickle.dumps(history)
    monkeypatch.chdir("/")
    for other in (copy.copy(history), copy.deepcopy(history), pickle.loads(text)):
        assert_same(history, other, OF_HISTORY)
        assert_same(history.at_points([0, 3]), pickle.loads(pickle.dumps(other.at_points([0, 3]))), OF_HISTORY)
    (tmp_path / "motion" / "instants.npy").unlink()
    with pytest.raises(cf.SceneError, match="instants.npy: expected the 5 saved states of a motion"):
        pickle.loads(text)


@pytest.mark.serial
def test_what_cannot_be_pickled_is_named():
    """A deep copy does not need to pickle."""
    _, scene = swinging(lambda t: (0, 0, math.sin(t)))
    history = moved(scene)
    with pytest.raises(pickle.PicklingError, match=r"a History cannot be pickled .* loads\[0\] \(Force at rod.end\)"):
        pickle.dumps(history)
    assert_same(history, copy.deepcopy(history), OF_HISTORY)
    steel = cf.Material(E=210e9, nu=0.3, density=7850.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1)), lambda s: cf.Circle(0.02 + 0.01 * s), steel, name="cone")
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (1, 0, 0))]), [1.0], elements=2)
    with pytest.raises(pickle.PicklingError, match=r"a Path cannot be pickled .* rods\[0\] \(cone\)"):
        pickle.dumps(path)
    assert len(copy.deepcopy(path)) == 1
