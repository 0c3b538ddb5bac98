"""Sections with a matrix: valid input, symmetry planes, scene files and explanations."""

import numpy as np
import pytest

import cosserat_fenicsx as cf
from cosserat_fenicsx.cli.explain import explain
from cosserat_fenicsx.statics.meshes import first_layout
from cosserat_fenicsx.storage.mark import difference, mark_of

pytestmark = pytest.mark.serial
EYE = np.eye(6)
LINE = cf.Line((0, 0, 0), (0, 0, 1.0))


def changed(i, j, value, symmetric=True):
    M = EYE.copy()
    M[i, j] = value
    if symmetric:
        M[j, i] = value
    return M.tolist()


REFUSED = {
    "not symmetric": (lambda: cf.Stiffness(matrix=changed(0, 4, 0.1, symmetric=False)), "Stiffness.matrix = "),
    "not positive definite": (lambda: cf.Stiffness(matrix=changed(2, 5, 1.1)), "symmetric and positive definite"),
    "singular": (lambda: cf.Stiffness(matrix=changed(2, 5, 1.0)), "symmetric and positive definite"),
    "negative diagonal": (lambda: cf.Stiffness(matrix=changed(3, 3, -1.0)), "symmetric and positive definite"),
    "infinite": (lambda: cf.Stiffness(matrix=changed(0, 0, np.inf)), "expected 6 x 6 finite numbers"),
    "shape": (lambda: cf.Stiffness(matrix=[[1.0, 2.0], [2.0, 1.0]]), "expected 6 x 6 finite numbers"),
    "ragged": (lambda: cf.Stiffness(matrix=[[1.0], [2.0, 1.0]]), "expected 6 x 6 finite numbers"),
    "twice": (lambda: cf.Stiffness(axial=1.0, matrix=EYE), "Stiffness.axial = 1.0: expected None beside a matrix"),
    "neither": (lambda: cf.Stiffness(mass=1.0), "Stiffness.shear = None: expected two numbers"),
    "offset, infinite": (lambda: cf.Stiffness.offset((1, 1), np.inf, (1, 1), 1), "Stiffness.offset.axial = inf"),
    "offset, place": (lambda: cf.Stiffness.offset((1, 1), 1, (1, 1), 1, centroid=1), "Stiffness.offset.centroid = 1"),
    "pieces, one of them infinite": (
        lambda: cf.Rod(LINE, [(0.5, cf.Stiffness(matrix=EYE)), (None, cf.Stiffness((1, 1), np.inf, (1, 1), 1))]),
        "expected finite stiffnesses along a rod that has a section with a matrix",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case):
    make, words = REFUSED[case]
    with pytest.raises(cf.SceneError) as caught:
        make()
    assert words in str(caught.value)


def test_units_do_not_decide_what_is_positive_definite():
    unit = np.diag([1e9, 1e9, 1e12, 1e-4, 1e-4, 1e-5])
    M = unit @ (EYE + 0.5 * (np.ones((6, 6)) - EYE)) @ unit
    assert np.array_equal(cf.Stiffness(matrix=M).matrix, M)


def test_offset_is_the_energy_of_two_points():
    """The energy of the strains e + k x (x1, x2, 0) at centroid and shear centre, against the matrix."""
    shear, axial, bending, torsion = (2.0, 3.0), 7.0, (1.0, 4.0), 0.5
    centroid, shear_centre, angle = (0.2, -0.3), (-0.1, 0.4), 0.7
    section = cf.Stiffness.offset(
        shear, axial, bending, torsion, centroid=centroid, shear_centre=shear_centre, angle=angle
    )
    e, k = np.random.default_rng(0).normal(size=(2, 3))
    axes = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    stretched, sheared = (axes @ e + np.cross(axes @ k, [*place, 0]) for place in (centroid, shear_centre))
    expected = (
        np.dot(shear, sheared[:2] ** 2) + axial * stretched[2] ** 2 + np.dot([*bending, torsion], (axes @ k) ** 2)
    )
    both = np.array([*e, *k])
    assert both @ np.array(section.matrix) @ both == pytest.approx(expected, rel=1e-13)
    plain = cf.Stiffness.offset(shear, axial, bending, torsion)
    np.testing.assert_array_equal(plain.matrix, np.diag([*shear, axial, *bending, torsion]))


def test_stiffnesses_that_stand_for_a_matrix():
    """Bending about the principal axes, for any coupling; n and m from the strains and back."""
    rod = cf.Rod(LINE, cf.Stiffness.offset((2.0, 3.0), 7.0, (4.0, 1.0), 0.5, angle=0.3, mass=2.0))
    at = rod.stiffness_at(np.array([0.2, 0.8]))
    np.testing.assert_allclose(at.J, [[4.0, 1.0, 0.5]] * 2)
    np.testing.assert_allclose(at.mass, 2.0)
    rod = cf.Rod(LINE, cf.Stiffness.offset((2.0, 3.0), 7.0, (4.0, 1.0), 0.5, centroid=(0.2, 0.1)))
    at, (e, k) = rod.stiffness_at(0.5), np.random.default_rng(1).normal(size=(2, 3))
    n, m = np.split(at.matrix @ [*e, *k], 2)
    for found, expected in zip(at.strains(n, m), (e, k), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12)


def scene(section, force=(0.1, 0, -1.0), **more):
    rod = cf.Rod(LINE, section, name="rod", **more)
    return rod, cf.Scene([rod], [cf.Clamp(rod.start)], [cf.FollowerForce(rod.end, force)])


def in_plane(centroid, **more):
    return cf.Stiffness.offset((2e3, 3e3), 4e3, (1.0, 3.0), 0.5, centroid=centroid, **more)


@pytest.mark.slow
def test_a_matrix_keeps_to_a_plane_if_it_couples_nothing_with_what_leaves_it():
    rod, flat = scene(in_plane((0.05, 0)))
    path = cf.solve(flat, [1.0, 2.0], elements=6)
    assert path.model == "planar"
    space = cf.solve(flat, [1.0, 2.0], model="spatial", elements=6)
    np.testing.assert_allclose(path.displacement(rod.end), space.displacement(rod.end), atol=1e-10)
    assert path.negative_modes.tolist() == space.negative_modes.tolist()
    for name in ("strain", "curvature", "force", "moment"):
        np.testing.assert_allclose(path.fields(-1)[name], space.fields(-1)[name], atol=1e-8, err_msg=name)
    for section in (in_plane((0.05, 0.01)), in_plane((0.05, 0), angle=0.1), in_plane((0, 0), shear_centre=(0, 0.02))):
        path = cf.solve(scene(section)[1], [0.1], elements=4)
        assert path.model == "spatial" and any(
            "couples strains in the plane with those out of it" in x for x in path.why
        )


@pytest.mark.slow
def test_determinate_rungs_agree_with_space():
    """In a plane that is not a coordinate plane, and in space."""
    turn = np.array([np.cos(0.4), np.sin(0.4), 0])
    for section, model, along in (
        (in_plane((0.05, 0)), "planar", turn),
        (in_plane((0.03, 0.04), angle=0.2), "spatial", turn),
    ):
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0), d1=turn), section, name="rod")
        loads = [cf.Force(rod.end, 2.0 * along - [0, 0, 1.5]), cf.EccentricForce(rod.end, (0, 0, 1.0), (0.1, 0))]
        dead = cf.Scene([rod], [cf.Clamp(rod.start)], loads)
        a, b, c = (cf.solve(dead, [1.0], model=name, elements=8) for name in ("determinate", model, "spatial"))
        for other in (b, c):
            np.testing.assert_allclose(a.displacement(rod.end), other.displacement(rod.end), atol=1e-8)
            for name in ("strain", "curvature"):
                np.testing.assert_allclose(a.fields(-1)[name], other.fields(-1)[name], atol=1e-6, err_msg=name)


def test_a_scene_file_holds_a_matrix(tmp_path):
    rows = ",\n".join(str(row) for row in changed(0, 4, 0.25))
    file = tmp_path / "rod.toml"
    file.write_text(f"""
[[rods]]
name = "rod"
curve = {{ type = "Line", start = [0, 0, 0], end = [0, 0, 1] }}
[rods.section]
type = "Stiffness"
mass = 2.0
matrix = [{rows}]
[[supports]]
type = "Clamp"
station = "rod.start"
[[loads]]
type = "Force"
station = "rod.end"
force = [0.01, 0, 0]
""", encoding="utf-8")  # fmt: skip
    found = cf.read(file)
    read, settings = found.scene, found.settings
    section = read.rods[0].section
    assert section.matrix[0][4] == section.matrix[4][0] == 0.25 and section.mass == 2.0
    assert "sections couple strains" in explain(read, [1.0], settings)


def test_a_stored_motion_knows_its_matrix():
    one, other = (scene(in_plane((0.05, y)))[1] for y in (0.0, 0.01))
    one, same, other = (mark_of(x, "Scene", [0.0]) for x in (one, one, other))
    assert difference(one, same, "motion") is None
    assert "Scene.rods[0].section" in difference(one, other, "motion")


def test_the_first_mesh_sees_axes_that_turn_along_the_rod():
    """The same first mesh as for a rod whose directors rotate instead, with constant principal stiffnesses."""
    rate = 40 * np.pi

    def twisted(s):
        return cf.Stiffness.offset((1e4, 1e4), 1e4, (1.0, 20.0), 1.0, angle=rate * s)

    plain = cf.Rod(cf.UniformCurvature(1.0, (0, 0, rate)), cf.Stiffness((1e4, 1e4), 1e4, (1.0, 20.0), 1.0))
    layouts = [first_layout(cf.Scene([rod], [cf.Clamp(rod.start)]), 4) for rod in (plain, cf.Rod(LINE, twisted))]
    assert layouts[0].counts == layouts[1].counts and layouts[0].counts[0] >= 16
