"""Orders of convergence of the tip, locking, and insensitivity to slenderness."""

import numpy as np
import pytest
from conftest import column

import cosserat_fenicsx as cf

ROUND_OFF = 2e-13


@pytest.mark.parametrize("formulation", ["mixed", "displacement", "multiplier"])
@pytest.mark.parametrize("degree", [1, 2, 3, 4])
@pytest.mark.serial
def test_tip_converges_with_order_2p(degree, formulation, reference):
    rod, scene = column()
    errors = []
    for elements in (4, 8, 16, 32):
        path = cf.solve(scene, [0.9, 1.5], degree=degree, elements=elements, formulation=formulation)
        exact = [reference[eta]["reissner"]["delta"] for eta in (0.9, 1.5)]
        errors.append(np.abs(path.displacement(rod.end)[:, 0] / exact - 1))
    errors = np.array(errors)
    orders = np.log2(errors[:-1] / errors[1:])
    for column_of in range(2):
        seen = orders[errors[1:, column_of] > ROUND_OFF, column_of]
        assert len(seen) >= 1, errors
        assert seen[-1] == pytest.approx(2 * degree, abs=0.35), (errors, orders)


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


@pytest.mark.parametrize("degree, elements, formulation", [(2, 8, "mixed"), (3, 8, "mixed"), (2, 8, "multiplier")])
def test_same_error_at_every_slenderness(degree, elements, formulation):
    """L/d from 1e2 to 1e5 and infinite EA, GA: relative errors of delta within a factor of 2 of each other."""
    errors = []
    for slenderness in (1e2, 1e3, 1e4, 1e5, np.inf):
        rod, scene = column(diameter=20.0 / slenderness if np.isfinite(slenderness) else 0.2)
        k = rod.stiffness
        axial, shear = k.axial, k.shear[0]
        if np.isinf(slenderness):
            axial = shear = np.inf
            section = cf.Stiffness(shear=(shear, shear), axial=axial, bending=k.bending, torsion=k.torsion)
            rod, scene = column(section=section)
        exact = cf.analytic.reissner([0.9, 1.5], 0.2, 20.0, bending=k.bending[1], axial=axial, shear=shear).delta
        path = cf.solve(scene, [0.9, 1.5], degree=degree, elements=elements, formulation=formulation)
        errors.append(np.abs(path.displacement(rod.end)[:, 0] / exact - 1))
    errors = np.array(errors)
    assert (errors.max(axis=0) <= 2 * errors.min(axis=0)).all(), errors


@pytest.mark.parametrize("finite", ["axial", "shear"])
def test_one_infinite_stiffness_beside_a_finite_one(finite):
    k = column()[0].stiffness
    axial = k.axial if finite == "axial" else np.inf
    shear = k.shear[0] if finite == "shear" else np.inf
    section = cf.Stiffness(shear=(shear, shear), axial=axial, bending=k.bending, torsion=k.torsion)
    rod, scene = column(section=section)
    exact = cf.analytic.reissner([0.9, 1.5], 0.2, 20.0, bending=k.bending[1], axial=axial, shear=shear).delta
    path = cf.solve(scene, [0.9, 1.5], tol=1e-7)
    np.testing.assert_allclose(path.displacement(rod.end)[:, 0], exact, rtol=1e-7)
