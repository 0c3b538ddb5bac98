"""Rods in space against an independent strong form; critical loads, and the right branch."""

import numpy as np
import pytest
from strong_form import shoot

import cosserat_fenicsx as cf

STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)
SCENES = {
    # section, loads as (place over the length, force over EI1/L^2, moment over EI1/L, arm over L)
    "blade, both offsets": (
        cf.Rectangle(0.1, 0.3),
        [(1.0, (0.3, 0.4, -0.2), (0, 0, 0), (0.05, -0.08)), (0.4, (-0.2, 0.1, 0.1), (0.1, -0.05, 0.2), (0, 0))],
    ),
    "soft, sheared and twisted": (
        cf.Stiffness(shear=(300.0, 50.0), axial=200.0, bending=(169.0, 1014.0), torsion=84.5, mass=0.004),
        [(1.0, (0.6, -0.8, 0.5), (0.3, 0.2, 0.4), (0, 0)), (0.7, (0.1, 0.5, -0.4), (0, 0, 0), (0.1, 0.2))],
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_against_the_strong_form(name):
    section, loads = SCENES[name]
    curve = cf.Line((100.0, -50.0, 7.0), (103.0, -46.0, 19.0), d1=(1.0, 0.5, 0.0))
    rod = cf.Rod(curve, section, STEEL)
    L, k = rod.length, rod.stiffness
    force, moment = k.bending[0] / L**2, k.bending[0] / L
    shot, acting = [], [cf.Weight((1.0, -3.0, -9.0))]
    for place, F, M, arm in loads:
        F, M, arm = np.array(F) * force, np.array(M) * moment, np.array(arm) * L
        shot.append((place * L, F, M, arm))
        station = rod.at(place * L)
        acting += [cf.EccentricForce(station, F, arm), cf.Moment(station, M)]
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], acting), [1.0], tol=1e-9)
    truth = shoot(
        L, curve.frame(0.0), (*k.shear, k.axial), (*k.bending, k.torsion), k.mass * np.array([1.0, -3.0, -9.0]), shot
    )
    assert np.linalg.norm(truth(L)["r"] - L * curve.frame(0.0)[:, 2]) > 0.15 * L  # the scene is a large one
    for s in (0.0, 0.1 * L, 0.4 * L, 0.41 * L, 0.55 * L, 0.7 * L, 0.93 * L, L):
        exact, station = truth(s), rod.at(s)
        np.testing.assert_allclose(path.position(station)[0] - curve.start, exact["r"], atol=2e-9 * L)
        np.testing.assert_allclose(path.rotation(station)[0], exact["q"], atol=1e-8)
        np.testing.assert_allclose(path.force(station)[0], exact["n"], atol=1e-6 * force)
        np.testing.assert_allclose(path.moment(station)[0], exact["m"], atol=1e-6 * moment)
    fields = path.fields(0, rod)
    for i in (0, len(fields["s"]) // 3, len(fields["s"]) // 2, -1):
        exact = truth(fields["s"][i])
        for field, size in (("strain", np.abs(exact["strain"]).max()), ("curvature", 1 / L)):
            np.testing.assert_allclose(fields[field][i], exact[field], atol=2e-6 * size)


def test_force_just_beyond_an_interior_load():
    """A force at mid-span: n is F before and 0 after it, from the next element on."""
    rod = cf.Rod(cf.Line((0, 0, 0), (10.0, 0, 0)), cf.Circle(0.2), STEEL)
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.at(5.0), (0, 0, -1000.0))]), [1.0])
    for s, expected in ((4.99, -1000.0), (5.0, -1000.0), (5.01, 0.0), (5.3, 0.0), (9.0, 0.0)):
        assert path.force(rod.at(s))[0, 2] == pytest.approx(expected, abs=1e-3), s


def test_lateral_buckling_of_a_thin_cantilever():
    """P L^2/sqrt(EI GJ) = 4.0126 (Timoshenko & Gere), for a section that is stiff in the plane of the load."""
    weak, torsion = 1.0, 0.7
    for stiff in (dict(shear=(1e6, 1e6), axial=1e6), dict(shear=(np.inf, np.inf), axial=np.inf)):
        section = cf.Stiffness(bending=(1e5, weak), torsion=torsion, **stiff)  # stiff about d1 = x
        rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), section)
        P = 4.0126 * np.sqrt(weak * torsion)
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, P, 0))])
        path = cf.solve(scene, [0.9, 0.998, 1.002, 1.1], elements=8)
        assert path.negative_modes.tolist() == [0, 0, 1, 1], stiff


def test_self_weight_column():
    """q L^3/EI = 7.8373474 (Greenhill)."""
    section = cf.Stiffness(shear=(1e7, 1e7), axial=1e7, bending=(1.0, 1.5), torsion=0.5, mass=7.8373474 / 9.81)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), section)
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Weight()]), [0.9, 0.9995, 1.0005, 1.2], elements=8)
    assert path.negative_modes.tolist() == [0, 0, 1, 1]


@pytest.mark.parametrize("weak", [(1.0, 1.5), (1.0, 10.0), (1.0, 1.0)])
@pytest.mark.parametrize("tilt", [1e-3, 1e-4])
def test_nearly_perfect_columns_stay_on_the_branch_of_their_tilt(weak, tilt):
    """The mirrored branch is stable if one axis is stiff: neither distance nor negative modes reveal a jump to it."""
    section = cf.Stiffness(shear=(1e5, 1e5), axial=1e5, bending=weak, torsion=0.8)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), section)
    P = np.pi**2 / 4
    for load in np.linspace(1.02, 6.0, 8):
        scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, tilt * load * P, -load * P))])
        path = cf.solve(scene, [1.0], elements=6)
        assert path.stable[0] and path.displacement(rod.end)[0, 1] > 0.1, load


@pytest.mark.parametrize("loads", [0, 7])
@pytest.mark.parametrize("degree, tol", [(2, 1e-5), (3, 1e-6), (4, 1e-6)])
def test_the_estimate_covers_the_error_everywhere(degree, tol, loads):
    """At nodes and between them, and where many stations fix the element ends of the first meshes."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(0.2), STEEL)
    P = cf.euler_load(rod)
    small = [cf.Force(rod.at(20.0 * (i + 1) / (loads + 1)), (1e-6, 0, 0)) for i in range(loads)]
    scene = cf.Scene(
        [rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -P)), cf.Moment(rod.end, (0, 0.2 * P, 0)), *small]
    )
    path = cf.solve(scene, [0.9, 1.5, 4.0], tol=tol, degree=degree)
    fine = cf.solve(scene, [0.9, 1.5, 4.0], degree=4, elements=40)
    x = np.linspace(0, 1, 333)
    for k in range(3):
        error = np.linalg.norm(path.sample(k, rod, x)[0] - fine.sample(k, rod, x)[0], axis=1).max()
        error /= fine.largest_displacement()[k]
        assert error <= max(path.error[k], 1e-12) <= tol


def test_the_estimate_is_not_fooled_by_a_boundary_layer():
    """Under a tension of 1e4 EI/L^2 the rod bends within L/100 of its clamp, which two coarse meshes do not resolve."""
    rod = cf.Rod(cf.Line((0, 0, 0), (10.0, 0, 0)), cf.Circle(0.05), STEEL)
    F = rod.stiffness.bending[0] / 100
    scene = cf.Scene(
        [rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (1e4 * F, 0, 0)), cf.Force(rod.at(3.3), (0, 1e3 * F, 0))]
    )
    path, fine = cf.solve(scene, [1.0], tol=1e-3), cf.solve(scene, [1.0], elements=256)
    x = np.linspace(0, 1, 301)
    error = (
        np.linalg.norm(path.sample(0, rod, x)[0] - fine.sample(0, rod, x)[0], axis=1).max()
        / fine.largest_displacement()[0]
    )
    assert error <= path.error[0] <= 1e-3


@pytest.mark.parametrize("formulation", ["displacement", "multiplier"])
def test_every_formulation_recovers_the_force_in_equilibrium(formulation):
    rod = cf.Rod(cf.Line((0, 0, 0), (3.0, 4.0, 12.0)), cf.Rectangle(0.3, 0.4), STEEL)
    F = min(rod.stiffness.bending) / 169
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, F, -2 * F))])
    path = cf.solve(scene, [1.0], formulation=formulation, elements=16)
    np.testing.assert_allclose(path.force(rod.start)[0], [0, F, -2 * F], atol=1e-6 * F)
    np.testing.assert_allclose(path.force(rod.at(6.5))[0], [0, F, -2 * F], atol=1e-6 * F)


@pytest.mark.parametrize("kind", ["torsion", "axial, inextensible", "zero force"])
def test_where_hardly_anything_moves(kind):
    curve, k = cf.Line((0, 0, 0), (1.0, 0, 0)), cf.Circle(0.02).stiffness(STEEL)
    rigid = cf.Stiffness((np.inf, np.inf), np.inf, k.bending, k.torsion)
    rod = cf.Rod(curve, rigid if kind.startswith("axial") else k)
    load = {"torsion": cf.Moment(rod.end, (100.0, 0, 0)), "zero force": cf.Force(rod.end, (0, 0, 0))}.get(
        kind, cf.Force(rod.end, (5.0, 0, 0))
    )
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [load]), [1.0])
    twist = 100.0 / k.torsion if kind == "torsion" else 0.0
    assert path.rotation_angle(rod.end)[0] == pytest.approx(twist, abs=1e-12)
    assert path.error[0] <= 1e-6


def test_very_slender_rods_on_fine_meshes():
    """The contact force becomes an unknown where rounding errors of
    the condensed tangent reach the bending stiffness."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(20.0 / 1e5), STEEL)
    P = cf.euler_load(rod)
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, 0, -P)), cf.Moment(rod.end, (0, 0.2 * P, 0))])
    exact = cf.analytic.elastica(np.array([0.9, 1.5]), 0.2, 20.0).delta
    for elements in (16, 32, 64, 128):
        path = cf.solve(scene, [0.9, 1.5], elements=elements)
        np.testing.assert_allclose(path.displacement(rod.end)[:, 0], exact, rtol=1e-7)
        assert path.stable.all() and path.iterations.sum() < 100
