"""The paper's eccentric cantilever through the public interface, against numbers computed without this package."""

import numpy as np
import pytest
from conftest import column

import cosserat_fenicsx as cf

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


def test_turning_arm(reference):
    etas = [eta for eta in ETAS if reference[eta]["eccentric_arm_delta"]]
    rod, scene = column(arm=True)
    path = cf.solve(scene, etas, tol=1e-6)
    exact = [reference[eta]["eccentric_arm_delta"] for eta in etas]
    np.testing.assert_allclose(path.displacement(rod.end)[:, 0], exact, rtol=1e-6)


@pytest.mark.parametrize("eta", [2.0, 4.0, 9.0])
def test_turning_arm_far_beyond(eta):
    """Beyond the reference file: against `analytic`, a quadrature of the strong form."""
    rod, scene = column(arm=True)
    k = rod.stiffness
    exact = cf.analytic.reissner(eta, 0.2, 20.0, bending=k.bending[1], axial=k.axial, shear=k.shear[0], arm=True)
    path = cf.solve(scene, [eta], tol=1e-6)
    assert path.displacement(rod.end)[0, 0] == pytest.approx(exact.delta, rel=1e-6)
    assert path.rotation_angle(rod.end)[0] == pytest.approx(exact.tip_rotation, abs=1e-6)


def test_contact_force_and_moment_are_those_of_statics():
    rod, scene = column()
    path = cf.solve(scene, [0.5, 1.1], elements=8)
    P = cf.euler_load(rod) * path.load_factors
    for station in (rod.start, rod.at(7.3), rod.end):
        np.testing.assert_allclose(path.force(station) / P[:, None], np.tile([0, 0, -1.0], (2, 1)), atol=1e-9)
    lever = path.displacement(rod.end)[:, 0]
    np.testing.assert_allclose(path.moment(rod.start)[:, 1], P * (0.2 + lever), rtol=1e-11)
    np.testing.assert_allclose(path.moment(rod.end)[:, 1], P * 0.2, rtol=1e-9)


@pytest.mark.parametrize("eta", [1.1, 1.5, 2.0, 4.0])
def test_asked_alone_the_answer_is_on_the_right_branch(eta, reference):
    rod, scene = column()
    path = cf.solve(scene, [eta], elements=8)
    assert path.displacement(rod.end)[0, 0] == pytest.approx(reference[eta]["reissner"]["delta"], rel=1e-7)
    assert path.stable.all()


@pytest.mark.parametrize("formulation", ["mixed", "displacement"])
@pytest.mark.parametrize("eta", [1.1, 1.5, 2.0, 4.0])
def test_one_jump_is_refused_or_called_unstable(eta, formulation):
    rod, scene = column()
    try:
        path = cf.solve(scene, [eta], elements=8, formulation=formulation, steps=cf.StepControl(adaptive=False))
    except cf.NotConverged as refusal:
        assert len(refusal.path) == 0
    else:
        assert not path.stable[0] or path.displacement(rod.end)[0, 0] > 0


def test_a_jump_to_the_wrong_side_says_unstable():
    """In one step to eta = 1.1 the mixed formulation converges to
    delta/L = -0.151; the result must be marked as unstable."""
    rod, scene = column()
    path = cf.solve(scene, [1.1], elements=8, steps=cf.StepControl(adaptive=False))
    assert path.displacement(rod.end)[0, 0] / 20 == pytest.approx(-0.15125, abs=1e-4)
    assert path.negative_modes[0] == 2


def test_perfect_column_loses_stability_at_the_critical_load():
    rod, scene = column(eccentricity=0.0)
    path = cf.solve(scene, [0.5, 0.99, 1.01, 1.5], elements=8)
    assert path.negative_modes.tolist() == [0, 0, 2, 2]  # a round section buckles in two directions
    assert path.stable.tolist() == [True, True, False, False]
    assert np.abs(path.displacement(rod.end)[:, :2]).max() < 1e-12


@pytest.mark.parametrize("far, most", [(4.0, 80), (9.0, 120)])
def test_newton_work(far, most, reference):
    rod, scene = column()
    path = cf.solve(scene, (0.0, far), elements=8)
    assert path.iterations.sum() <= most
    assert path.load_factors[0] == 0.0 and path.load_factors[-1] == far
    np.testing.assert_array_equal(path.steps, range(len(path)))
    landed = cf.solve(scene, [far], elements=8)  # the steps in between count
    assert 5 < landed.steps[0] <= path.steps[-1] + 1
    assert path.displacement(rod.end)[-1, 0] == pytest.approx(reference[far]["reissner"]["delta"], rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("turns, elements", [(1, 8), (2, 16), (4, 32), pytest.param(10, 64, marks=pytest.mark.serial)])
def test_roll_up_closes(turns, elements):
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, 20.0)), cf.Circle(0.2), cf.Material(E=210e9))
    M = 2 * np.pi * turns * rod.stiffness.bending[1] / rod.length
    scene = cf.Scene([rod], [cf.Clamp(rod.start)], [cf.Moment(rod.end, (0, M, 0))])
    path = cf.solve(scene, [1.0], elements=elements)
    assert np.linalg.norm(path.position(rod.end)) < 1e-6 * rod.length


def test_landing_again_lower_and_at_zero_retraces_the_path():
    rod, scene = column()
    path = cf.solve(scene, [0.0, 0.9, 1.2, 0.9, 0.0, 1.2, 1.2, -0.5, 0.9], elements=8)
    tip = path.displacement(rod.end)
    for again, first in ((3, 1), (4, 0), (5, 2), (6, 2), (8, 1)):
        np.testing.assert_allclose(tip[again], tip[first], atol=1e-10)
    assert path.stable.all() and path.iterations.sum() < 250


def test_hanging_and_standing_under_its_own_weight():
    """The stretch rho g L^2/(2E) of a hanging rod under its weight, and
    the contact force at the foot of a standing one."""
    steel = cf.Material(E=210e9, nu=0.3, density=7850.0)
    rod = cf.Rod(cf.Line((0, 0, 0), (0, 0, -20.0)), cf.Circle(0.2), steel)
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
