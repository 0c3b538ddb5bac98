"""Frames from arrays and from files with meshes, against scenes put together by hand and against statics."""

from pathlib import Path

import meshio
import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

import cosserat_fenicsx as cf
from cosserat_fenicsx import compat
from cosserat_fenicsx.models.rodmesh import RodMesh
from cosserat_fenicsx.numerics import conjugate_product
from cosserat_fenicsx.parts import to_data

pytestmark = pytest.mark.serial
STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)
THICK, THIN = cf.Circle(0.2), cf.Circle(0.1)
PORTAL = np.array([[0, 0, 0], [0, 0, 3.0], [4.0, 0, 3.0], [4.0, 0, 0], [2.0, 2.0, 0]])
LEGS = [[0, 1], [1, 2], [2, 3]]


def tip(scene, station):
    return cf.solve(scene, [1.0]).displacement(station)[-1]


def test_a_portal_is_the_scene_put_together_by_hand():
    frame = cf.frame(PORTAL, LEGS, THICK, STEEL, clamped=[0, 3])
    assert len(frame) == 3 and repr(frame) == "<Frame: 3 rods between 5 points, 2 clamped>"
    assert frame.nearest((3.9, 0.1, 2.9)) == 2 and frame.at(2).rod.name == "rod1"
    rods = [cf.Rod(cf.Line(tuple(PORTAL[a]), tuple(PORTAL[b])), THICK, STEEL, name=f"leg{a}") for a, b in LEGS]
    by_hand = cf.Scene(
        rods, [cf.Clamp(rods[0].start), cf.Clamp(rods[2].end)], [cf.Force(rods[0].end, (2e5, 3e4, -1e5))],
        [cf.Joint(rods[0].end, rods[1].start), cf.Joint(rods[1].end, rods[2].start)],
    )  # fmt: skip
    found = tip(frame.scene([cf.Force(frame.at(1), (2e5, 3e4, -1e5))]), frame.at(2))
    np.testing.assert_allclose(found, tip(by_hand, rods[1].end), rtol=1e-12)


def test_a_tripod_of_hinged_bars_carries_by_tension_alone():
    """Three equal bars under a vertical force P: N = -P/(3 cos(angle)), displacement P L/(3 EA cos^2(angle))."""
    angles = 2 * np.pi * np.arange(3) / 3
    feet = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(3)])
    frame = cf.frame([*feet, [0, 0, 2.0]], [[0, 3], [1, 3], [2, 3]], THIN, STEEL, hinged=[3])
    pins = [cf.Pin(frame.at(k)) for k in range(3)]
    spin = [cf.Spring(frame.at(k), rotational=1.0) for k in range(3)]  # about its axis a bar is free
    path = cf.solve(frame.scene([cf.Force(frame.at(3), (0, 0, -3e3)), *spin], pins), [1.0], tol=1e-9)
    length, cosine = np.sqrt(5), 2 / np.sqrt(5)
    axial = 3e3 / (3 * cosine)
    assert np.linalg.norm(path.force(frame.at(0))[-1]) == pytest.approx(axial, rel=1e-6)
    moved = path.displacement(frame.at(3))[-1]
    assert moved[2] == pytest.approx(-axial * length / (frame.rods[0].stiffness.axial * cosine), rel=1e-5)


def lattice():
    """A frame of 63 rods on clamped feet, and its uppermost points."""
    points = 3.0 * np.argwhere(np.ones((3, 3, 4)))
    near = np.isclose(np.linalg.norm(points[:, None] - points, axis=2), 3.0)
    feet = points[:, 2] == 0
    near[np.ix_(feet, feet)] = False
    edges = np.argwhere(np.triu(near))
    frame = cf.frame(points, edges, cf.Tube(0.1, 0.08), STEEL, clamped=np.flatnonzero(feet))
    return frame, np.flatnonzero(points[:, 2] == 9.0).tolist()


@pytest.mark.parametrize(("force", "steps"), [(1e4, [1, 2]), (2e5, [4, 5])], ids=["nearly linear", "bends far"])
def test_the_first_load_factor_of_many_rods_is_tried_at_once(force, steps):
    """Where that is too far, a tenth of the way follows, as where it is asked for."""
    frame, top = lattice()
    scene = frame.scene([cf.Force(frame.at(k), (force, force / 2, -force / 10)) for k in top])
    found = cf.solve(scene, [0.5, 1.0], elements=1)
    slow = cf.solve(scene, [0.5, 1.0], elements=1, steps=cf.StepControl(first=0.1))
    assert found.steps.tolist() == steps
    np.testing.assert_allclose(found.displacement(frame.at(top[0])), slow.displacement(frame.at(top[0])), rtol=1e-9)


def test_rods_that_bend_most_are_cut_into_more_elements():
    """Two meshes suffice: the second one has short elements where halves would not do, and says how good it is."""
    frame, top = lattice()
    scene = frame.scene([cf.Force(frame.at(k), (3e3, 1.5e3, -3e4)) for k in top])
    path, truth = cf.solve(scene, [1.0]), cf.solve(scene, [1.0], elements=8)
    assert len(frame) == 63 and min(path.elements) == 2 < max(path.elements) <= 4
    moved = [[found.displacement(rod.at(x))[0] for rod in frame.rods for x in (0.35, 0.75, 1.1)]
             for found in (path, truth)]  # fmt: skip
    largest = np.linalg.norm([truth.displacement(frame.at(k))[0] for k in top], axis=1).max()
    error = np.linalg.norm(np.subtract(*moved), axis=1).max() / largest
    assert path.errors.position[0] / 20 < error < path.errors.position[0] < 1e-6


def test_rotations_are_no_more_wrong_than_estimated_where_one_element_a_rod_is_halved():
    points = [(3.0 * i, 3.0 * j, 3.0 * k) for k in range(5) for j in range(2) for i in range(2)]
    edges = [(k, k + 4) for k in range(16)]
    edges += [(k, k + 1) for k in range(4, 20, 2)] + [(k, k + 2) for k in range(4, 20) if k % 4 < 2]
    frame = cf.frame(points, edges, cf.Circle(0.15), STEEL, clamped=range(4))
    scene = frame.scene([cf.Force(frame.at(k), (5e3, 2.5e3, -15e3)) for k in range(16, 20)])
    path, truth = cf.solve(scene, [1.0]), cf.solve(scene, [1.0], elements=6)
    places = np.linspace(0, 1, 33)
    found, exact = (np.array([x.motion(rod, places)[0, :, 3:] for rod in frame.rods]) for x in (path, truth))
    turned = 2 * np.linalg.norm(conjugate_product(found, exact), axis=-1).max()
    size = max(2 * np.linalg.norm(exact[..., 1:], axis=-1).max(), np.linalg.norm(truth.displacement(frame.at(16))) / 3)
    assert set(path.elements) == {2} and 1.2 < path.errors.rotation[0] / (turned / size) < 3


def mesh(**more):
    return meshio.Mesh(PORTAL, [("line", np.array(LEGS[:2])), ("line", np.array(LEGS[2:]))], **more)


def abaqus(folder):
    meshio.Mesh(PORTAL, [("line", np.array(LEGS))], point_sets={"FEET": np.array([0, 3])},
                cell_sets={"LEGS": [np.array([0, 2])], "BEAM": [np.array([1])]},
                ).write(folder / "portal.inp")  # fmt: skip
    return folder / "portal.inp", {"LEGS": THICK, "BEAM": THIN}, "FEET"


def gmsh(folder):
    cells = [("line", np.array(LEGS)), ("vertex", np.array([[0], [3]]))]
    tags = [np.array([7, 8, 7]), np.array([9, 9])]
    meshio.Mesh(PORTAL, cells, cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
                field_data={"legs": np.array([7, 1]), "beam": np.array([8, 1]), "feet": np.array([9, 0])},
                ).write(folder / "portal.msh", file_format="gmsh22")  # fmt: skip
    return folder / "portal.msh", {"legs": THICK, 8: THIN}, "feet"


def vtk(folder):
    mesh(cell_data={"section": [np.array([1, 2]), np.array([1])]},
         point_data={"clamped": np.array([1, 0, 0, 1, 0])}).write(folder / "portal.vtu")  # fmt: skip
    return folder / "portal.vtu", {1: THICK, 2: THIN}, "clamped"


@pytest.mark.parametrize("written", [abaqus, gmsh, vtk])
def test_meshes_of_other_programs_give_the_same_frame(written, tmp_path):
    file, sections, feet = written(tmp_path)
    frame = cf.frame_from(file, sections, STEEL, clamped=feet, scale=0.5)
    given = cf.frame(PORTAL / 2, LEGS, [THICK, THIN, THICK], STEEL, clamped=[0, 3])
    np.testing.assert_array_equal(frame.points[frame.edges], given.points[given.edges])
    assert [rod.section for rod in frame.rods] == [rod.section for rod in given.rods]
    assert [x.station.full_name for x in frame.supports] == [x.station.full_name for x in given.supports]
    assert frame.points_in(feet) == [0, 3]
    assert [[rod.name for rod in frame.rods_in(group)] for group in sections] == [["rod0", "rod2"], ["rod1"]]
    pinned = cf.frame_from(file, sections, STEEL, pinned=feet)
    assert [type(x) for x in pinned.supports] == [cf.Pin] * 2 and "2 pinned" in repr(pinned)
    with pytest.raises(cf.SceneError, match=f"no points are named 'foot': .*{feet}"):
        frame.points_in("foot")
    with pytest.raises(cf.SceneError, match="no rods are in the group 'leg'"):
        frame.rods_in("leg")
    with pytest.raises(cf.SceneError, match="no lines are in the group 'leg'"):
        cf.frame_from(file, {"leg": THICK}, STEEL)
    with pytest.raises(cf.SceneError, match=f"no points are named 'foot': .*{feet}"):
        cf.frame_from(file, THICK, STEEL, clamped="foot")
    with pytest.raises(cf.SceneError, match=r"line \d is in .*: expected a section for it"):
        cf.frame_from(file, dict([*sections.items()][:1]), STEEL)


IN_A_FILE = """
[mesh]
file = "portal.inp"
material = { E = 210e9, density = 7850.0 }
clamped = "FEET"
scale = 0.5
groups = [{ name = "LEGS", section = { type = "Circle", diameter = 0.2 } },
          { name = "BEAM", section = { type = "Circle", diameter = 0.1 } }]

[[loads]]
type = "Force"
station = "DECK"
force = [1e4, 0, 0]

[[loads]]
type = "LineForce"
rod = "BEAM"
force = [0, 300.0, -5e3]

[[loads]]
type = "Force"
station = "rod1@1.0"
force = [0, 0, -2e3]
"""

SUPPORTS = """[[supports]]
type = "Pin"
station = "rod1@1.0"

[[supports]]
type = "Pin"
station = "XX"

[[loads]]"""

OF_ITS_OWN = """[[rods]]
name = "BEAM"
curve = { type = "Line", start = [0, 0, 0], end = [0, 0, -1] }
section = { type = "Circle", diameter = 0.1 }
material = { E = 210e9 }

[[loads]]"""


def test_a_scene_file_takes_the_rods_of_a_mesh_and_its_names(tmp_path):
    file = Path(__file__).parent / "reference" / "portal.inp"
    (tmp_path / "portal.inp").write_bytes(file.read_bytes())
    (tmp_path / "scene.toml").write_text(IN_A_FILE, encoding="utf-8")
    frame = cf.frame_from(file, {"LEGS": THICK, "BEAM": THIN}, STEEL, clamped="FEET", scale=0.5)
    loads = [cf.Force(frame.at(k), (1e4, 0, 0)) for k in (1, 2)]
    loads += [cf.LineForce(frame.rods[1], (0, 300.0, -5e3)), cf.Force(frame.rods[1].at(1.0), (0, 0, -2e3))]
    found = cf.read(tmp_path / "scene.toml")
    assert tip(found.scene, "rod1@0.7") == pytest.approx(tip(frame.scene(loads), "rod1@0.7"), rel=1e-9)
    cf.write(found, tmp_path / "again.toml")
    assert to_data(cf.read(tmp_path / "again.toml").scene) == to_data(found.scene)
    for given, other, words in (
        ('"FEET"', '"FOOT"', r"line 5, column 1: .*no points are named 'FOOT': did you mean 'FEET'\?"),
        ('"BEAM"\n', '"BEAMS"\n', r"line 15, column 1: Scene.loads\[1\].rod = 'BEAMS'.*mean 'BEAM'.*lines BEAM, LEGS;"),
        (
            "[[loads]]",
            SUPPORTS,
            r"line 14, column 1: Scene.supports\[1\].station = 'XX'.*points DECK, FEET; its rods are",
        ),
        ("[[loads]]", OF_ITS_OWN, "rods = 'BEAM': expected another name"),
        ('"LEGS"', '"BEAM"', r"\['BEAM', 'BEAM'\]: expected each group once"),
        ("groups = [", "section = { type = 'Circle', diameter = 0.1 }\ngroups = [", "either a section of all rods, or"),
    ):
        (tmp_path / "scene.toml").write_text(IN_A_FILE.replace(given, other, 1), encoding="utf-8")
        with pytest.raises(cf.SceneError, match=words):
            cf.read(tmp_path / "scene.toml")


@pytest.mark.parametrize(("changed", "words"), [
    ({"edges": [[0, 1], [1, 5]]}, r"edges\[1\] = \[1, 5\]: expected numbers of points from 0 to 4"),
    ({"edges": [[0, 1], [1, 0]]}, r"\[0, 1\] occurs twice"),
    ({"edges": [[0.0, 1.0]]}, r"edges\[0\] = \[0.0, 1.0\]: expected whole numbers"),
    ({"d1": (0, 0, 2)}, r"frame: 'rod0', from point 0 to 1: Line.d1 = \(0.0, 0.0, 2.0\): expected"),
    ({"points": [(True, 0.0, 0.0), *PORTAL[1:]]}, r"frame.points = .*: expected rows of three numbers"),
    ({"edges": [[0, 0]]}, "a point apart from start"),
    ({"points": [[0, 0], [1, 1]]}, r"expected \(points, 3\)"),
    ({"section": [THICK, THIN]}, "frame.section has 2 values: expected one, or 3"),
    ({"clamped": [4]}, "no rod meets this point"),
    ({"clamped": [0.5]}, "expected numbers of points"),
    ({"clamped": [9]}, "frame.clamped has 9: expected numbers of points from 0 to 4"),
    ({"hinged": [-1]}, "frame.hinged has -1: expected"),
    ({"hinge_axis": (0, 1, 0)}, r"frame.hinge_axis = \(0.0, 1.0, 0.0\): expected points that are pinned or hinged"),
    ({"hinged": [1], "hinge_axis": (0, 0, 0)}, "frame.hinge_axis = .*: expected a direction"),
    ({"hinged": [0]}, "1 rods meet point 0: expected points where two or more do"),
])  # fmt: skip
def test_refusals(changed, words):
    with pytest.raises(cf.SceneError, match=words):
        cf.frame(**{"points": PORTAL, "edges": LEGS, "section": THICK, "material": STEEL} | changed)


@pytest.mark.parametrize(("hinged", "balls"), [([1, 2], "rod0.end, rod1.end"), ([1], None)])
def test_hinges_of_a_portal_turn_about_one_axis(hinged, balls):
    """In its plane a portal with hinges sways as two cantilevers; balls let its beam spin, or its pinned frame fall."""
    options = {"clamped": [0, 3]} if balls else {"pinned": [0, 3]}
    portal = cf.frame(PORTAL, LEGS, THICK, STEEL, hinged=hinged, **options)
    words = f"release = .0, 1, 0. of the Joint at {balls}" if balls else "Hinge with axis = .0, 1, 0. .* Pin at rod0"
    with pytest.raises(cf.SceneError, match=f"{words}.*hinge_axis of a frame"):
        cf.solve(portal.scene([cf.Force(portal.at(1), (100.0, 0, 0))]), [1.0])
    portal = cf.frame(PORTAL, LEGS, THICK, STEEL, hinged=hinged, hinge_axis=(0, 2, 0), **options)
    assert {joint.release for joint in portal.joints} == ({(0, 1, 0)} if balls else {(0, 1, 0), None})
    bending = portal.rods[0].stiffness.bending[0]
    # H h^3/(3 EI) of each of two cantilevers; of three hinges and a corner H h^2 (h + L)/(3 EI)
    moved = 50.0 * 27 / (3 * bending) if balls else 100.0 * 9 * 7 / (3 * bending)
    loads = [cf.Force(portal.at(1), (100.0, 0, 0))]
    assert tip(portal.scene(loads), portal.at(1))[0] == pytest.approx(moved, rel=5e-3)
    if not balls:
        assert repr(portal).endswith("2 on hinges>")


def test_points_of_a_mesh_without_names_have_numbers():
    given = meshio.Mesh(PORTAL, LINES, point_sets={"FOOT": np.array([3])})
    for clamped in ([0, 3], [0, "FOOT"], np.array([0, 3])):
        assert [x.station.full_name for x in cf.frame_from(given, THICK, STEEL, clamped=clamped).supports] == [
            "rod0.start", "rod2.end"
        ]  # fmt: skip
    assert len(cf.frame_from(given, THICK, STEEL, pinned=3).supports) == 1
    with pytest.raises(cf.SceneError, match="frame.clamped has 5: expected numbers of points from 0 to 4"):
        cf.frame_from(given, THICK, STEEL, clamped=[0, 5])
    with pytest.raises(cf.SceneError, match=r"the mesh names none; expected numbers of points, such as \[0, 3\]"):
        cf.frame_from(meshio.Mesh(PORTAL, LINES), THICK, STEEL, clamped="FOOT")


LINES = [("line", np.array(LEGS))]


@pytest.mark.parametrize(("given", "options", "words"), [
    (meshio.Mesh(PORTAL, [*LINES, ("line3", [[0, 1, 4]])]), {}, "1 lines with more than two points"),
    (meshio.Mesh(PORTAL, LINES, cell_sets={"a": [[0, 1, 2]], "b": [[1]]}), {"section": {"a": THICK, "b": THIN}},
     "line 1 is in 'a' and 'b': expected groups without common lines"),
    (meshio.Mesh(PORTAL, LINES, cell_data={"section": [[1.7, 1.2, 2.9]]}), {"section": {1: THICK}},
     "not whole numbers"),
    (meshio.Mesh(PORTAL, LINES, cell_data={"section": [[1, 1, 2]]}, field_data={"leg": np.array([1, 1])}),
     {"section": {"leg": THICK}}, "no lines are in the group 'leg'"),
    (meshio.Mesh(PORTAL, LINES, point_data={"temperature": np.arange(5.0)}), {"clamped": "temperature"},
     "no points are named 'temperature'"),
])  # fmt: skip
def test_what_a_mesh_leaves_open_is_refused(given, options, words):
    with pytest.raises(cf.SceneError, match=words):
        cf.frame_from(given, **{"section": THICK, "material": STEEL} | options)


def test_files_that_are_no_frames_are_refused(tmp_path):
    (tmp_path / "a.vtu").write_text("nothing")
    with pytest.raises(cf.SceneError, match="cannot be read"):
        cf.frame_from(tmp_path / "a.vtu", THICK, STEEL)
    with pytest.raises(cf.SceneError, match="the mesh has triangle: expected cells of the type line"):
        cf.frame_from(meshio.Mesh(PORTAL, [("triangle", [[0, 1, 2]])]), THICK, STEEL)


@pytest.mark.slow
def test_the_demos_give_their_numbers(monkeypatch):
    """A lattice tower and a net; the gridshell takes ten seconds."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent.parent / "demos"))
    import frames
    from known_numbers import deviation

    for check in frames.main(["lattice", "net"], out=None):
        assert deviation(check) <= check.allowed, check


def test_what_is_printed_of_many_rods_fits_a_screen():
    from cosserat_fenicsx.cli.explain import explain

    points = [(4.0 * i, 0, 3.0 * j) for j in range(11) for i in range(4)]
    edges = [(k, k + 4) for k in range(40)] + [(k, k + 1) for k in range(4, 44) if k % 4 < 3]
    frame = cf.frame(points, edges, THICK, STEEL, clamped=range(4))
    scene = frame.scene([cf.Force(frame.at(k), (1e3, 0, -1e4)) for k in range(4, 44)])
    path = cf.solve(scene, [1.0], elements=1)
    printed = {"scene": repr(scene), "path": str(path), "buckling": str(cf.buckling(scene, 2, elements=1))}
    for what, text in printed.items():
        lines = text.splitlines()
        assert len(lines) <= 30 and max(map(len, lines)) <= 100, what
    assert "70 rods of 1 elements" in printed["path"] and "rod5.end and 34 more" in " ".join(printed["path"].split())
    assert "rod5 and 64 more" in printed["scene"]
    told = explain(scene, (0.0, 1.0), {})
    assert "70 rods 'rod0'" in told and "length 3 to 4 m" in told and len(told) < 3000


def test_the_mesh_of_many_chains_has_each_element_in_its_place():
    counts = 1 + np.arange(120) % 3
    ends = [np.linspace(0.0, 1.0 + k, n + 1) for k, n in enumerate(counts)]
    many = RodMesh(MPI.COMM_SELF, counts)
    many.place(ends)
    space = compat.function_space(many.mesh, compat.lagrange(many.mesh, 2, 1))
    assert sorted(many.cells) == [*range(counts.sum())]
    assert sorted(many.slots(space, 2)) == [*range(2 * counts.sum() + 120)]
    x = many.mesh.geometry.x[compat.geometry_dofs(many.mesh)[: len(many.cells)], 0]
    starts, stops = (np.concatenate([e[part] for e in ends]) for part in (slice(-1), slice(1, None)))
    np.testing.assert_array_equal(np.sort(x, axis=1), np.column_stack([starts, stops])[many.cells])
    one = fem.assemble_scalar(fem.form(1.0 * ufl.dx(domain=many.mesh)))
    assert one == pytest.approx(sum(e[-1] for e in ends), rel=1e-12)
