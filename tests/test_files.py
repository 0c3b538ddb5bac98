"""Files and pictures, read back with the usual libraries."""

from xml.etree import ElementTree as xml

import numpy as np
import pytest
from conftest import COMM, column

import cosserat_fenicsx as cf

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
def test_pyvista_reads_the_xdmf(solved, xdmf):
    import pyvista

    rod, path = solved
    reader = pyvista.get_reader(str(xdmf))
    assert reader.time_values == ETAS
    for k, eta in enumerate(ETAS):
        reader.set_active_time_value(eta)
        check(reader.read().point_data, rod, path, k)


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


@pytest.mark.serial
@pytest.mark.parametrize("ending", [".vtu", ".vtk"])
def test_one_state_in_other_formats(ending, solved, tmp_path):
    import pyvista

    rod, path = solved
    file = tmp_path / f"state{ending}"
    path.write(file, k=1)
    data = pyvista.read(file)
    np.testing.assert_allclose(data.points[-1], path.position(rod.end)[1], rtol=1e-6, atol=1e-6)
    assert data["quaternion"].shape == (17, 4)


@pytest.mark.ranks
def test_unwritable_and_unknown_files(solved, tmp_path_all):
    _, path = solved
    (tmp_path_all / "folder.xdmf").mkdir(exist_ok=True)
    COMM.barrier()
    with pytest.raises(OSError):
        path.write(tmp_path_all / "folder.xdmf")
    with pytest.raises(cf.SceneError, match="the ending '.xyzzy' is not known"):
        path.write(tmp_path_all / "state.xyzzy")


@pytest.mark.ranks
def test_an_empty_path_is_not_written(solved, tmp_path_all):
    _, scene = column()
    with pytest.raises(cf.NotConverged) as refusal:
        cf.solve(scene, [0.5], elements=4, steps=cf.StepControl(max_iterations=1), control="load")
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
