"""The law of a section that couples strains, point by point at random states, and the numbers of a matrix."""

from types import SimpleNamespace

import numpy as np
import pytest
import ufl
from test_equilibrium import VECTOR, Point, central, value
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives

from cosserat_fenicsx.forms import determinate, equilibrium, law
from cosserat_fenicsx.models import rod_data
from cosserat_fenicsx.scene.profiles import Stiffnesses

pytestmark = [pytest.mark.serial, pytest.mark.once]


def random_matrix(seed):
    """A well-conditioned symmetric positive definite matrix without zeros."""
    root = np.random.default_rng(seed).normal(size=(6, 6))
    return root @ root.T + 2 * np.eye(6)


def law_by_hand(M, kind=law.CoupledLaw):
    A, B, D = M[:3, :3], M[:3, 3:], M[3:, 3:]
    G = np.linalg.solve(A, B)
    return kind(*map(ufl.as_matrix, (A, np.linalg.inv(A), D - B.T @ G, G)))


class Numeric(law.CoupledLaw):
    """The same, evaluated to numbers at once: UFL evaluates nested expressions slowly."""

    def force(self, e, k):
        return VECTOR(value(super().force(VECTOR(value(e)), VECTOR(value(k)))))

    def moment(self, n, k):
        return VECTOR(value(super().moment(VECTOR(value(n)), VECTOR(value(k)))))

    def strain(self, n, k):
        return VECTOR(value(super().strain(VECTOR(value(n)), VECTOR(value(k)))))


class CoupledPoint(Point):
    """A `Point` whose section has a full matrix."""

    def __init__(self, seed, kind=Numeric):
        super().__init__(seed)
        self.matrix = random_matrix(seed)
        self.section = self.section._replace(law=law_by_hand(self.matrix, kind))

    def motion(self, h=0.0):
        """In numbers, which UFL evaluates faster."""
        exact = super().motion(h)
        return equilibrium.Motion(
            VECTOR(value(exact.r_s)), ufl.as_matrix(value(exact.R)), VECTOR(value(exact.curvature))
        )


def as_it_is(a):
    return a


@pytest.mark.parametrize("seed", range(3))
def test_law_is_the_matrix_and_its_partial_inverse(seed):
    M, law_here = random_matrix(seed), law_by_hand(random_matrix(seed))
    e, k = np.random.default_rng(seed).normal(size=(2, 3))
    n, m = np.split(M @ [*e, *k], 2)
    for found, expected in zip(law.stress(law_here, VECTOR(e), VECTOR(k)), (n, m), strict=True):
        np.testing.assert_allclose(value(found), expected, rtol=1e-12)
    np.testing.assert_allclose(value(law_here.moment(VECTOR(n), VECTOR(k))), m, rtol=1e-12)
    np.testing.assert_allclose(value(law_here.strain(VECTOR(n), VECTOR(k))), e, rtol=1e-11)
    assert value(law.energy(law_here, VECTOR(e), VECTOR(k))) == pytest.approx((e @ n + k @ m) / 2)


@pytest.mark.parametrize("seed", range(3))
def test_numbers_of_a_matrix_make_its_law(seed):
    """Also with components along other axes, and with K bounded, which changes A alone."""
    M = random_matrix(seed)
    P, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    along = Stiffnesses(np.zeros((1, 1, 3)), np.zeros((1, 1, 3)), None, None, M[None, None])
    data = rod_data.law_data(along, SimpleNamespace(force=2.0, length=3.0), coupled=True)
    data = rod_data.turned(data, P[None, None])
    bound = np.minimum(data.K, 1.0)
    K, K_inv, K_stiff, J, G = (a[0, 0].reshape(3, 3) for a in rod_data.field_values(data, bound))
    back = np.diag([1, 1, 1, 3, 3, 3]) @ np.kron(np.eye(2), P.T)  # to the first axes and to units
    made = np.block([[K, K @ G], [G.T @ K, J + G.T @ K @ G]])
    np.testing.assert_allclose(2 * back @ made @ back.T, M, rtol=1e-12)
    np.testing.assert_allclose(K @ K_inv, np.eye(3), atol=1e-12)
    assert np.linalg.eigvalsh(K_stiff) == pytest.approx(np.sort(bound[0, 0]))
    np.testing.assert_allclose(K_stiff @ K, K @ K_stiff, atol=1e-12)
    n, k = np.random.default_rng(seed).normal(size=(2, 1, 1, 3))
    np.testing.assert_allclose(rod_data.strain(data, n, k)[0, 0], K_inv @ n[0, 0] - G @ k[0, 0], rtol=1e-12)
    np.testing.assert_allclose(rod_data.moment(data, n, k)[0, 0], G.T @ n[0, 0] + J @ k[0, 0], rtol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_coupled_law_read_backwards(seed):
    p = CoupledPoint(seed)
    n, m = (VECTOR(value(a)) for a in equilibrium.contact(p.motion(), p.section))
    np.testing.assert_allclose(value(equilibrium.tangent_of_force(n, p.motion(), p.section)), p.r_s, rtol=1e-12)
    np.testing.assert_allclose(value(equilibrium.contact_moment(n, p.motion(), p.section)), value(m), rtol=1e-12)
    plain = equilibrium.displacement(p.motion(), p.section, p.test, as_it_is)
    mixed = equilibrium.mixed(n, p.motion(), p.section, p.test, VECTOR([1, 2, 3]), as_it_is)
    assert value(mixed) == pytest.approx(value(plain), rel=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_coupled_second_variation_is_the_change_of_the_balance(seed):
    """Where n agrees with the motion; with n known, that of the moments."""
    p = CoupledPoint(seed)
    expected = central(lambda h: value(equilibrium.displacement(p.motion(h), p.section, p.test, as_it_is)))
    n = VECTOR(value(equilibrium.contact(p.motion(), p.section)[0]))
    found = value(equilibrium.second_variation(n, p.motion(), p.section, p.test, p.direction))
    np.testing.assert_allclose(found, expected, rtol=1e-8)
    known = VECTOR([0.3, -0.7, 0.5])
    test = determinate.tests_of(p.test.phi, p.test.phi_s)
    expected = central(lambda h: value(determinate.moments(known, p.motion(h), p.section, test, as_it_is)))
    found = value(determinate.second_variation(known, p.motion(), p.section, test, p.direction))
    np.testing.assert_allclose(found, expected, rtol=1e-8)


def test_carried_force_is_the_mixed_step_condensed():
    """For any carried n: dn solves the linearised compatibility, and the
    tangent is the change of the mixed balance with it."""
    p, h, random = CoupledPoint(5), ufl.variable(ufl.as_ufl(1.0)), np.random.default_rng(5)
    section = p.section._replace(law=law_by_hand(p.matrix))
    start = p.motion()
    changes = [random.normal(size=a.ufl_shape) for a in start]

    def along(x):
        """The motion at x along a straight line, which starts at 1."""
        return equilibrium.Motion(*(a + (x - 1) * ufl.as_tensor(da) for a, da in zip(start, changes, strict=True)))

    def derivative(a):
        found = value(apply_derivatives(apply_algebra_lowering(ufl.diff(a, h))))
        return VECTOR(found) if a.ufl_shape else ufl.as_ufl(found)

    n_k = random.normal(size=3)

    def mixed(n, x=1.0):
        """(balance, compatibility), one after the other; linear in n."""
        motion = equilibrium.Motion(*(ufl.as_tensor(value(a)) for a in along(x)))
        balance = equilibrium.mixed(VECTOR(n), motion, p.section, p.test, VECTOR([0] * 3), as_it_is)
        return np.array([value(balance), *value(equilibrium.compatibility(VECTOR(n), motion, p.section))])

    moved = central(lambda x: mixed(n_k, 1 + x))
    by_n = np.array([mixed(n_k + d) - mixed(n_k) for d in np.eye(3)]).T
    found = equilibrium.carried_force_tangent(VECTOR(n_k), along(h), section, p.test, as_it_is, derivative)
    dn = np.linalg.solve(by_n[1:], -moved[1:])
    assert value(found) == pytest.approx(moved[0] + by_n[0] @ dn, rel=1e-7)
    found = equilibrium.carried_force_update(VECTOR(n_k), along(h), section, derivative)
    step = np.linalg.solve(by_n[1:], -mixed(n_k)[1:] - moved[1:])
    np.testing.assert_allclose(value(found), n_k + step, rtol=1e-7)


@pytest.mark.parametrize("seed", range(2))
def test_diagonal_law_is_a_special_matrix(seed):
    p = CoupledPoint(seed)
    p.section, matrix = (p.section._replace(law=here) for here in (p.law, law_by_hand(np.diag([*p.K, *p.J]), Numeric)))
    n, motion = VECTOR([0.3, -0.7, 0.5]), p.motion()
    test = determinate.tests_of(p.test.phi, p.test.phi_s)
    for form in (
        lambda section: equilibrium.displacement(motion, section, p.test, as_it_is),
        lambda section: equilibrium.mixed(n, motion, section, p.test, VECTOR([0.1, 0.4, -0.6]), as_it_is),
        lambda section: equilibrium.second_variation(n, motion, section, p.test, p.direction),
        lambda section: determinate.moments(n, motion, section, test, as_it_is),
        lambda section: determinate.second_variation(n, motion, section, test, p.direction),
    ):
        assert value(form(matrix)) == pytest.approx(value(form(p.section)), rel=1e-14 * 10)
