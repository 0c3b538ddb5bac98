"""Statics against independent references: the paper's cantilever, orders, invariance, space, taut wires."""

import numpy as np
import pytest
from conftest import column
from mpi4py import MPI
from scipy.optimize import brentq
from strong_form import shoot

import cosserat_fenicsx as cf

STEEL = cf.Material(E=210e9, nu=0.3, density=7850.0)
ETAS = [0.1, 0.5, 0.9, 0.99, 1.0, 1.1, 1.5, 2.0, 4.0, 9.0]


def test_default_settings_meet_their_tolerance(reference):
    rod, scene = column()
    path = cf.solve(scene, ETAS, tol=1e-6)
    tip = path.displacement(rod.end)
    for k, eta in enumerate(ETAS):
        exact = reference[eta]["reissner"]
        error = np.hypot(tip[k, 0] - exact["delta"], -tip[k, 2] - exact["shortening"])
        assert error < 1e-6 * np.hypot(exact["delta"], exact["shortening"]), eta
        assert abs(tip[k, 1]) < 1e-12
        assert path.rotation_angle(rod.end)[k] == pytest.approx(exact["tip_rotation"], abs=1e-6)
    assert path.stable.all()
    assert (path.error <= 1e-6).all()


@pytest.mark.serial
def test_turning_arm(reference):
    """Beyond the reference file against `analytic`, a quadrature of the strong form."""
    etas = [eta for eta in ETAS if reference[eta]["eccentric_arm_delta"]]
    rod, scene = column(arm=True)
    k, far = rod.stiffness, [2.0, 4.0, 9.0]
    exact = cf.analytic.reissner(far, 0.2, 20.0, bending=k.bending[1], axial=k.axial, shear=k.shear[0], arm=True)
    path = cf.solve(scene, [*etas, *far], tol=1e-6)
    delta = [*(reference[eta]["eccentric_arm_delta"] for eta in etas), *exact.delta]
    np.testing.assert_allclose(path.displacement(rod.end)[:, 0], delta, rtol=1e-6)
    assert path.rotation_angle(rod.end)[-3:] == pytest.approx(exact.tip_rotation, abs=1e-6)


def test_contact_force_and_moment_are_those_of_statics():
    rod, scene = column()
    path = cf.solve(scene, [0.5, 1.1], elements=8)
    P = cf.euler_load(rod) * path.load_factors
    for station in (rod.start, rod.at(7.3), rod.end):
        np.testing.assert_allclose(path.force(station) / P[:, None], np.tile([0, 0, -1.0], (2, 1)), atol=1e-9)
    lever = path.displacement(rod.end)[:, 0]
    np.testing.assert_allclose(path.moment(rod.start)[:, 1], P * (0.2 + lever), rtol=1e-11)
    np.testing.assert_allclose(path.moment(rod.end)[:, 1], P * 0.2, rtol=1e-9)


@pytest.mark.serial
@pytest.mark.parametrize("formulation", ["mixed", "displacement"])
@pytest.mark.parametrize("eta", [1.1, 1.5, 2.0, 4.0])
def test_one_jump_is_refused_or_called_unstable(eta, formulation):
    """In one step to eta = 1.1 the mixed formulation converges to delta/L = -0.151."""
    rod, scene = column()
    try:
        path = cf.solve(scene, [eta], elements=8, formulation=formulation, steps=cf.StepControl(adaptive=False))
    except cf.NotConverged as refusal:
        assert len(refusal.path) == 0 and (eta, formulation) != (1.1, "mixed")
        return
    delta = path.displacement(rod.end)[0, 0]
    assert not path.stable[0] or delta > 0
    if (eta, formulation) == (1.1, "mixed"):
        assert delta / 20 == pytest.approx(-0.15125, abs=1e-4) and path.negative_modes[0] == 2


@pytest.mark.serial
@pytest.mark.parametrize("far, most", [(1.1, 40), (2.0, 60), (4.0, 80), (9.0, 120)])
def test_newton_work(far, most, reference):
    """Of a path, and of its end alone, which is on the same branch: the steps in between count."""
    rod, scene = column()
    path, landed = (cf.solve(scene, asked, elements=8) for asked in ((0.0, far), [far]))
    assert path.iterations.sum() <= most
    assert path.load_factors[0] == 0.0 and path.load_factors[-1] == far
    np.testing.assert_array_equal(path.steps, range(len(path)))
    assert (5 if far > 2 else 1) < landed.steps[0] <= path.steps[-1] + 1 and landed.stable.all()
    delta = reference[far]["reissner"]["delta"]
    for found in (path, landed):
        assert found.displacement(rod.end)[-1, 0] == pytest.approx(delta, rel=1e-6 if far > 4 else 1e-7)


@pytest.mark.serial
@pytest.mark.slow
@pytest.mark.parametrize("turns, elements", [(1, 8), (4, 32)])
def test_roll_up_closes(turns, elements):
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(0.2), cf.Material(E=210e9))
    M = 2 * np.pi * turns * rod.stiffness.bending[1] / rod.length
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Moment(rod.end, (0, M, 0))])
    path = cf.solve(scene, [1.0], elements=elements)
    assert np.linalg.norm(path.position(rod.end)) < 1e-6 * rod.length


@pytest.mark.serial
def test_landing_again_lower_and_at_zero_retraces_the_path():
    rod, scene = column()
    path = cf.solve(scene, [0.0, 0.9, 1.2, 0.9, 0.0, 1.2, 1.2, -0.5, 0.9], elements=8)
    tip = path.displacement(rod.end)
    for again, first in ((3, 1), (4, 0), (5, 2), (6, 2), (8, 1)):
        np.testing.assert_allclose(tip[again], tip[first], atol=1e-10)
    assert path.stable.all() and path.iterations.sum() < 250


@pytest.mark.serial
def test_hanging_under_its_own_weight():
    """The stretch rho g L^2/(2E), and the contact force at the upper end."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, -20.0)), cf.Circle(0.2), STEEL)
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Weight()]), [1.0], elements=4)
    assert path.displacement(rod.end)[0, 2] == pytest.approx(-7850 * 9.81 * 400 / (2 * 210e9), rel=1e-5)
    weight = 7850 * 9.81 * np.pi * 0.01 * 20
    np.testing.assert_allclose(path.force(rod.start)[0], [0, 0, -weight], atol=1e-8 * weight)


def test_interior_load_and_support():
    """A cantilever held at 5 m and loaded at 15 m in its linear range: F a^3/3EI at the load."""
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(0.2), cf.Material(E=210e9))
    scene = cf.Scene([rod], [cf.Clamp(rod.at(5.0))], [cf.Force(rod.at(15.0), (1.0, 0, 0))])
    path = cf.solve(scene, [1.0], elements=4)
    k = rod.stiffness
    linear = 1000 / (3 * k.bending[1]) + 10 / k.shear[0]
    assert path.displacement(rod.at(15.0))[0, 0] == pytest.approx(linear, rel=1e-9)
    assert np.abs(path.displacement(rod.start)).max() < 1e-12


ROUND_OFF = 2e-13


@pytest.mark.parametrize("way", ["mixed", "displacement", "multiplier", "determinate", "planar"])
@pytest.mark.parametrize("degree", [2, *(pytest.param(degree, marks=pytest.mark.once) for degree in (1, 3, 4))])
@pytest.mark.serial
def test_tip_converges_with_order_2p(degree, way, reference):
    rod, scene = column()
    asked = {"model": way} if way in ("determinate", "planar") else {"model": "spatial", "formulation": way}
    exact, errors = [reference[eta]["reissner"]["delta"] for eta in (0.9, 1.5)], []
    for elements in (4, 8, 16, 32):
        path = cf.solve(scene, [0.9, 1.5], degree=degree, elements=elements, **asked)
        errors.append(np.abs(path.displacement(rod.end)[:, 0] / exact - 1))
    errors = np.array(errors)
    orders = np.log2(errors[:-1] / errors[1:])
    for column_of in range(2):
        seen = orders[errors[1:, column_of] > ROUND_OFF, column_of]
        assert len(seen) >= 1, errors
        assert seen[-1] == pytest.approx(2 * degree, abs=0.35), (errors, orders)


@pytest.mark.once
@pytest.mark.parametrize("formulation", ["displacement", "multiplier"])
@pytest.mark.serial
def test_more_gauss_points_lock(formulation, reference):
    """P2 on 8 elements, eta = 0.9: an error of 3e-5 with two Gauss points, of a fifteenth with three."""
    rod, scene = column()
    exact = reference[0.9]["reissner"]["delta"]

    def error(points):
        path = cf.solve(scene, [0.9], formulation=formulation, degree=2, elements=8, gauss_points=points)
        return path.displacement(rod.end)[0, 0] / exact - 1

    assert abs(error(2)) < 3.2e-5
    assert error(3) == pytest.approx(-0.066, abs=1e-3)


def inextensible(axial=np.inf, shear=np.inf):
    """The column with its bending stiffness, and others."""
    k = column()[0].stiffness
    return column(section=cf.Stiffness(shear=(shear, shear), axial=axial, bending=k.bending, torsion=k.torsion))


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize("degree, elements, formulation", [(2, 8, "mixed"), (3, 8, "mixed"), (2, 8, "multiplier")])
def test_same_error_at_every_slenderness(degree, elements, formulation):
    """L/d from 1e2 to 1e5 and infinite EA, GA: relative errors of delta within a factor of 2 of each other."""
    errors = []
    for rod, scene in (*(column(diameter=20.0 / slender) for slender in (1e2, 1e3, 1e4, 1e5)), inextensible()):
        k = rod.stiffness
        exact = cf.analytic.reissner([0.9, 1.5], 0.2, 20.0, bending=k.bending[1], axial=k.axial, shear=k.shear[0]).delta
        path = cf.solve(scene, [0.9, 1.5], degree=degree, elements=elements, formulation=formulation)
        errors.append(np.abs(path.displacement(rod.end)[:, 0] / exact - 1))
    errors = np.array(errors)
    assert (errors.max(axis=0) <= 2 * errors.min(axis=0)).all(), errors


@pytest.mark.serial
@pytest.mark.parametrize("finite", ["axial", "shear"])
def test_one_infinite_stiffness_beside_a_finite_one(finite):
    k = column()[0].stiffness
    rod, scene = inextensible(**{finite: k.axial if finite == "axial" else k.shear[0]})
    k = rod.stiffness
    exact = cf.analytic.reissner([0.9, 1.5], 0.2, 20.0, bending=k.bending[1], axial=k.axial, shear=k.shear[0]).delta
    path = cf.solve(scene, [0.9, 1.5], tol=1e-7)
    np.testing.assert_allclose(path.displacement(rod.end)[:, 0], exact, rtol=1e-7)


FACTORS = [0.5, 0.9, 1.1, 1.5]


def random_rotation(seed):
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


@pytest.mark.serial
@pytest.mark.parametrize("arm", [False, True])
@pytest.mark.parametrize("seed", [1, 2])
def test_rotating_the_scene_turns_the_answer(seed, arm):
    rod, scene = column(arm=arm)
    plain = cf.solve(scene, FACTORS, elements=8)
    Q, origin = random_rotation(seed), np.array([30.0, -70.0, 110.0])
    P = cf.euler_load(rod)
    turned_rod = cf.Rod(cf.Line(origin, origin + Q @ [0, 0, 20.0], d1=Q[:, 0]), rod.section, rod.material)
    loads = (
        [cf.EccentricForce(turned_rod.end, Q @ [0, 0, -P], (0.2, 0))]
        if arm
        else [cf.Force(turned_rod.end, Q @ [0, 0, -P]), cf.Moment(turned_rod.end, Q @ [0, 0.2 * P, 0])]
    )
    turned = cf.solve(cf.Scene([turned_rod], [cf.Clamp(turned_rod.start)], loads), FACTORS, elements=8)
    u, moment = plain.displacement(rod.end) @ Q.T, plain.moment(rod.start) @ Q.T
    np.testing.assert_allclose(turned.displacement(turned_rod.end), u, atol=1e-12 * 20)
    np.testing.assert_allclose(turned.moment(turned_rod.start), moment, atol=1e-12 * np.abs(moment).max())
    assert turned.iterations.tolist() == plain.iterations.tolist()
    a, b = turned.fields(-1, turned_rod), plain.fields(-1, rod)
    np.testing.assert_allclose(a["curvature"], b["curvature"], atol=1e-11 * np.abs(b["curvature"]).max())  # material


def rich_scene():
    """Loads of every kind on an inclined rod, an interior station, both n carried and n as a field."""
    curve, k = cf.Line((1, 2, 3), (4, -3, 20)), cf.Rectangle(0.2, 0.3).stiffness(STEEL)
    stiff = cf.Stiffness(shear=(np.inf, np.inf), axial=np.inf, bending=k.bending, torsion=k.torsion, mass=k.mass)
    for rod in (cf.Rod(curve, cf.Rectangle(0.2, 0.3), STEEL, name="a"), cf.Rod(curve, stiff, name="b")):
        loads = [cf.Weight(), cf.Force(rod.end, (2e4, 1e4, -3e4)), cf.EccentricForce(rod.end, (0, 5e3, 0), (0.3, 0.4)),
                 cf.Moment(rod.at(7.0), (1e4, 0, 2e4))]  # fmt: skip
        yield rod, cf.Scene([rod], [cf.Clamp(rod.start)], loads)


@pytest.mark.ranks
@pytest.mark.parametrize("elements", [1, 2, 9])
def test_number_of_ranks_changes_nothing(elements):
    """All ranks together, some without an element, against every rank alone (trivial with one process)."""
    for rod, scene in (column(), *rich_scene()):
        asked = (0.0, 1.3) if elements == 9 else [0.5]
        together, alone = (cf.solve(scene, asked, elements=elements, comm=x) for x in (MPI.COMM_WORLD, MPI.COMM_SELF))
        assert together.unknowns == alone.unknowns
        if elements < 9:
            np.testing.assert_allclose(together.centreline(), alone.centreline(), atol=1e-9 * rod.length)
            np.testing.assert_allclose(together.force(rod.start), alone.force(rod.start), rtol=1e-6, atol=1e-3)
            continue
        for name in ("iterations", "negative_modes"):
            assert getattr(together, name).tolist() == getattr(alone, name).tolist()
        np.testing.assert_allclose(together.load_factors, alone.load_factors, rtol=1e-9)
        for k in (1, len(alone) - 1):
            a, b = together.fields(k, rod), alone.fields(k, rod)
            for name in a:
                np.testing.assert_allclose(a[name], b[name], atol=1e-9 * np.abs(b[name]).max(), err_msg=name)


def test_one_problem_serves_every_scene_of_its_shape():
    """Data of a first scene must not affect a second one, and nothing is compiled again for it."""
    from cosserat_fenicsx.algebra.pool import PROBLEMS

    first, scene = column()
    before = cf.solve(scene, [0.9], elements=8).displacement(first.end)
    made = PROBLEMS.made
    other_rod, other = column(length=31.0, diameter=0.3, eccentricity=0.5)
    cf.solve(other, [0.3, 1.2], elements=8)
    np.testing.assert_array_equal(cf.solve(scene, [0.9], elements=8).displacement(first.end), before)
    assert PROBLEMS.made == made


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


@pytest.mark.serial
@pytest.mark.slow
@pytest.mark.parametrize("name", [list(SCENES)[0], pytest.param(list(SCENES)[1], marks=pytest.mark.once)])
def test_against_the_strong_form(name):
    section, loads = SCENES[name]
    curve = cf.Line((100.0, -50.0, 7.0), (103.0, -46.0, 19.0), d1=(1.0, 0.5, 0.0))
    rod = cf.Rod(curve, section, STEEL)
    L, k, gravity = rod.length, rod.stiffness, np.array([1.0, -3.0, -9.0])
    force, moment = k.bending[0] / L**2, k.bending[0] / L
    shot, acting = [], [cf.Weight(tuple(gravity))]
    for place, F, M, arm in loads:
        F, M, arm = np.array(F) * force, np.array(M) * moment, np.array(arm) * L
        shot.append((place * L, F, M, arm))
        station = rod.at(place * L)
        acting += [cf.EccentricForce(station, F, arm), cf.Moment(station, M)]
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], acting), [1.0], tol=1e-9)
    truth = shoot(L, curve.frame(0.0), (*k.shear, k.axial), (*k.bending, k.torsion), k.mass * gravity, shot)
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


@pytest.mark.serial
def test_force_just_beyond_an_interior_load():
    """A force at mid-span: n is F before and 0 after it, from the next element on."""
    rod = cf.Rod(cf.Line((0, 0, 0), (10.0, 0, 0)), cf.Circle(0.2), STEEL)
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.at(5.0), (0, 0, -1000.0))]), [1.0])
    for s, expected in ((4.99, -1000.0), (5.0, -1000.0), (5.01, 0.0), (5.3, 0.0), (9.0, 0.0)):
        assert path.force(rod.at(s))[0, 2] == pytest.approx(expected, abs=1e-3), s


@pytest.mark.serial
def test_self_weight_column():
    """q L^3/EI = 7.8373474 (Greenhill)."""
    section = cf.Stiffness(shear=(1e7, 1e7), axial=1e7, bending=(1.0, 1.5), torsion=0.5, mass=7.8373474 / 9.81)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 1.0)), section)
    path = cf.solve(cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Weight()]), [0.9, 0.9995, 1.0005, 1.2], elements=8)
    assert path.negative_modes.tolist() == [0, 0, 1, 1]


@pytest.mark.serial
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


@pytest.mark.serial
@pytest.mark.parametrize("loads", [pytest.param(0, marks=pytest.mark.serial), 7])
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


@pytest.mark.serial
@pytest.mark.parametrize("formulation", ["displacement", "multiplier"])
def test_every_formulation_recovers_the_force_in_equilibrium(formulation):
    rod = cf.Rod(cf.Line((0, 0, 0), (3.0, 4.0, 12.0)), cf.Rectangle(0.3, 0.4), STEEL)
    F = min(rod.stiffness.bending) / 169
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Force(rod.end, (0, F, -2 * F))])
    path = cf.solve(scene, [1.0], formulation=formulation, elements=16)
    np.testing.assert_allclose(path.force(rod.start)[0], [0, F, -2 * F], atol=1e-6 * F)
    np.testing.assert_allclose(path.force(rod.at(6.5))[0], [0, F, -2 * F], atol=1e-6 * F)


@pytest.mark.serial
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


def wire(diameter, move, length=110.0):
    """A steel wire under its weight, whose end is moved towards its start by `move`, m."""
    rod = cf.Rod(cf.Line((0, 0, 0), (length, 0, 0)), cf.Circle(diameter), STEEL)
    supports = [cf.Hinge(rod.start, (0, 1, 0)), cf.Prescribed(rod.end, displacement=(-move, 0, 0))]
    return rod, cf.Scene([rod], supports, [cf.Weight()])


@pytest.mark.serial
@pytest.mark.parametrize(("diameter", "move"), [(0.005, 10.0), (0.005, 1.0), (0.001, 10.0)])
def test_a_wire_drawn_straight(diameter, move):
    """Its sag is that of an elastic catenary, up to the effect of EI, with the default steps."""
    rod, scene = wire(diameter, move)
    path = cf.solve(scene, [1.0], tol=1e-5)
    w, EA = 9.81 * rod.stiffness.mass, rod.stiffness.axial
    half = lambda H: 55 * H / EA + H / w * np.arcsinh(55 * w / H)  # noqa: E731
    H = brentq(lambda H: 2 * half(H) - 110 + move, 1e-3 * w, 1e5 * w)
    sag = w * 55**2 / (2 * EA) + H / w * (np.hypot(1, 55 * w / H) - 1)
    assert path.stable.all() and path.displacement(rod.at(55.0))[0, 2] == pytest.approx(-sag, rel=5e-5)


@pytest.mark.serial
@pytest.mark.parametrize("control", ["load", "arc"])
def test_what_is_advised_helps(control):
    """The first step must be smaller than allowed; and there is no warning about the units."""
    _, scene = wire(0.005, 10.0)
    steps = cf.StepControl(smallest=0.5)
    with pytest.raises(cf.NotConverged) as refused:
        cf.solve(scene, [1.0], model="spatial", elements=16, steps=steps, control=control)
    assert "units" not in str(refused.value)
    if control == "arc":
        assert "Try control='auto'" in str(refused.value)
        return
    assert "by steps=StepControl(smallest=0.0005)" in str(refused.value)
    path = cf.solve(scene, [1.0], model="spatial", elements=16, steps=cf.StepControl(smallest=0.0005), control=control)
    assert path.stable.all()


@pytest.mark.slow
@pytest.mark.serial
def test_loads_beyond_ea_are_asked_about():
    rod, scene = column()
    with pytest.raises(cf.SceneError, match="expected at most 0.5 EA = .*, beyond which no such material is elastic"):
        cf.solve(scene, [1e9], elements=2)
    unknown = cf.Rod(rod.curve, cf.Stiffness((2e9, 2e9), 6.6e9, (1.65e7, 1.65e7), 1.27e7), name="column")
    scene = cf.Scene([unknown], [cf.Clamp(unknown.start)], [cf.Force(unknown.end, (1e3, 0, -1e5))])
    with pytest.raises(cf.NotConverged, match="times EA there, which no rod bears: are the units those of SI"):
        cf.solve(scene, [1e9], elements=2)
