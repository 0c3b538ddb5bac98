"""Eq. (1), its models and the law of a section, point by point at random states."""

from types import SimpleNamespace

import numpy as np
import pytest
import ufl
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives

from cosserat_fenicsx.forms import determinate, equilibrium, law, loads, planar, spatial
from cosserat_fenicsx.forms.equilibrium import VirtualMotion
from cosserat_fenicsx.forms.law import DiagonalLaw
from cosserat_fenicsx.forms.point import variation
from cosserat_fenicsx.forms.rotation import rotation_vector
from cosserat_fenicsx.models import rod_data
from cosserat_fenicsx.scene.profiles import Stiffnesses

pytestmark = [pytest.mark.serial, pytest.mark.once]
VECTOR = ufl.as_vector


def value(expression):
    """The number, vector or matrix of an expression without coefficients."""
    shape = expression.ufl_shape
    return np.array([float(expression[i](())) for i in np.ndindex(shape)]).reshape(shape) if shape else expression(())


def quaternion_matrix(q):
    w, v = q[0], q[1:]
    skew = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + 2 * (w * skew + skew @ skew) / (q @ q)


def turned(q, theta):
    """q after a rotation by the inertial rotation vector theta."""
    angle = np.linalg.norm(theta)
    w, v = np.cos(angle / 2), np.sin(angle / 2) * theta / angle
    return np.array([w * q[0] - v @ q[1:], *(w * q[1:] + q[0] * v + np.cross(v, q[1:]))])


class Point:
    """A point of a rod in space at a random state, in a random direction, tested by random vectors."""

    def __init__(self, seed):
        random = np.random.default_rng(seed)
        self.K, self.J = random.uniform(1, 3, (2, 3))
        R_R = quaternion_matrix(random.normal(size=4))
        self.v_R = np.array([0.1, -0.2, 1.1])
        self.law = DiagonalLaw(*map(VECTOR, (self.K, 1 / self.K, self.J)))
        self.section = equilibrium.Section(self.law, ufl.as_matrix(R_R), VECTOR(self.v_R))
        self.R_R = R_R
        self.r_s, self.q, self.q_s = random.normal(size=3), random.normal(size=4), random.normal(size=4)
        self.q /= np.linalg.norm(self.q)
        self.q_s -= (self.q_s @ self.q) * self.q
        self.test = VirtualMotion(*map(VECTOR, random.normal(size=(4, 3))))
        self.d = random.normal(size=(3, 3))  # dr', the rotation, its derivative
        self.direction = VirtualMotion(VECTOR(self.d[0]), VECTOR(self.d[1]), VECTOR(self.d[0]), VECTOR(self.d[2]))

    def motion(self, h=0.0):
        """The motion at h along the direction."""
        dr_s, theta, theta_s = self.d
        q, q_s = self.q, self.q_s
        if h:
            q = turned(self.q, h * theta)
            # (exp(h theta/2) q)' to first order in h
            lift = np.array([-theta_s @ self.q[1:], *(self.q[0] * theta_s + np.cross(theta_s, self.q[1:]))]) / 2
            q_s = turned(self.q_s, h * theta) + h * lift
        return spatial.motion_of(VECTOR(self.r_s + h * dr_s), VECTOR(q), VECTOR(q_s), VECTOR(q))

    def point(self, h=0.0):
        """The `Point` for the virtual work of actions, at h along the direction; r changes as r' does."""
        q = turned(self.q, h * self.d[1]) if h else self.q
        r, r_s = self.r_s - 0.4 + h * self.d[0], self.r_s + h * self.d[0]
        U, U_s = (VECTOR([*a, *q]) for a in (r, r_s))
        return spatial.point_of(U, U_s, rest=None, frame=None)


def central(f, h=1e-5):
    return (f(h) - f(-h)) / (2 * h)


@pytest.mark.parametrize("seed", range(3))
def test_laws_and_balance_are_eqs_1_to_5(seed):
    p = Point(seed)
    motion = p.motion()
    R = quaternion_matrix(p.q)
    T = R @ p.R_R
    q, q_s = p.q, p.q_s
    u = p.R_R.T @ (2 * (q[0] * q_s[1:] - q_s[0] * q[1:] - np.cross(q[1:], q_s[1:])))
    n, m = T @ (p.K * (T.T @ p.r_s - p.v_R)), T @ (p.J * u)
    np.testing.assert_allclose(value(motion.R), R, atol=1e-14)
    for found, expected in zip(equilibrium.contact(motion, p.section), (n, m), strict=True):
        np.testing.assert_allclose(value(found), expected, rtol=1e-13)
    phi, phi_r_s, phi_s = (value(a) for a in (p.test.phi, p.test.phi_r_s, p.test.phi_s))
    expected = n @ phi_r_s + m @ phi_s - np.cross(p.r_s, n) @ phi
    found = equilibrium.displacement(motion, p.section, p.test, lambda a: a)
    np.testing.assert_allclose(value(found), expected, rtol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_the_law_read_backwards(seed):
    p = Point(seed)
    n, _ = equilibrium.contact(p.motion(), p.section)
    np.testing.assert_allclose(value(equilibrium.tangent_of_force(n, p.motion(), p.section)), p.r_s, rtol=1e-13)
    np.testing.assert_allclose(value(equilibrium.compatibility(n, p.motion(), p.section)), 0, atol=1e-13)


def test_loads_that_turn():
    p = Point(4)
    F, arm = VECTOR([0.3, -0.2, 0.9]), VECTOR([0.4, 0.1, -0.6])
    kinds = [(kind, F) for kind in (loads.force, loads.moment, loads.follower_force, loads.follower_moment)]
    for kind, *numbers in (*kinds, (loads.eccentric_force, F, arm)):

        def work(point, test, kind=kind, numbers=numbers):
            return kind(point, test, *numbers)

        expected = central(lambda h, work=work: value(work(p.point(h), p.test)))
        np.testing.assert_allclose(
            value(variation(work, p.point(), p.test, p.direction)), expected, rtol=1e-8, atol=1e-10
        )
    turn = quaternion_matrix(p.q)
    expected = np.cross(turn @ value(arm), value(F)) @ value(p.test.phi) + value(F) @ value(p.test.phi_r)
    np.testing.assert_allclose(value(loads.eccentric_force(p.point(), p.test, F, arm)), expected, rtol=1e-13)
    for kind, phi in ((loads.follower_force, p.test.phi_r), (loads.follower_moment, p.test.phi)):
        np.testing.assert_allclose(value(kind(p.point(), p.test, F)), turn @ value(F) @ value(phi), rtol=1e-13)


def test_what_sees_position_and_rotation_changes_with_both():
    """The rotation vector, and a force that depends on r and r', in
    the direction of a small displacement and rotation."""
    p, stiff = Point(5), VECTOR([0.7, -0.4, 0.2])

    def work(point, test):
        pull = ufl.dot(point.r, point.r) * ufl.cross(point.r_s, stiff)
        return ufl.dot(pull, test.phi_r) + ufl.dot(point.theta, test.phi)

    expected = central(lambda h: value(work(p.point(h), p.test)))
    np.testing.assert_allclose(value(variation(work, p.point(), p.test, p.direction)), expected, rtol=1e-7)
    for angle in (0.0, 1e-9, 0.0199, 0.05, 3.0, 4.5, 6.2):
        axis = np.array([0.6, 0.0, 0.8])
        q = VECTOR([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])
        np.testing.assert_allclose(value(rotation_vector(q)), angle * axis, rtol=1e-11, atol=1e-15)


class PlanePoint:
    """A point of a rod in a plane, for the planar and for the spatial model."""

    def __init__(self, seed):
        random = np.random.default_rng(seed)
        self.K, self.J, angle = random.uniform(1, 3, 3), random.uniform(1, 3, 3), random.uniform(0, 6)
        self.t = np.array([np.cos(angle), np.sin(angle)])
        self.v_R = np.array([0.05, 1.1])
        self.section = planar.section_of(
            DiagonalLaw(*map(VECTOR, (self.K, 1 / self.K, self.J))), VECTOR(self.t), VECTOR(self.v_R)
        )
        self.r_s, self.theta, self.theta_s = random.normal(size=2), random.normal(), random.normal()
        self.motion = planar.motion_of(VECTOR(self.r_s), ufl.as_ufl(self.theta), self.theta_s)
        c, s = np.cos(self.theta / 2), np.sin(self.theta / 2)
        q, q_s = VECTOR([c, 0, 0, s]), VECTOR([-s * self.theta_s / 2, 0, 0, c * self.theta_s / 2])
        self.in_space = spatial.motion_of(VECTOR([*self.r_s, 0]), q, q_s, q)
        (a, a_s), (b, b_s) = random.normal(size=(2, 2, 3))
        self.phi, self.phi_s = a, a_s
        self.test = planar.tests_of(VECTOR(a), VECTOR(a_s))
        self.sideways = planar.sideways_tests_of(VECTOR(b), VECTOR(b_s))


@pytest.mark.parametrize("seed", range(3))
def test_planar_balance_by_hand(seed):
    """Reissner's plane rod: n = GA gamma a + EA epsilon t, m = EI theta', moments n_2 r_1' - n_1 r_2'."""
    p = PlanePoint(seed)
    c, s = np.cos(p.theta), np.sin(p.theta)
    t = np.array([[c, -s], [s, c]]) @ p.t
    a = np.array([-t[1], t[0]])
    n = p.K[0] * (a @ p.r_s - p.v_R[0]) * a + p.K[2] * (t @ p.r_s - p.v_R[1]) * t
    m = p.J[1] * p.theta_s
    expected = n @ p.phi_s[:2] + m * p.phi_s[2] - (p.r_s[0] * n[1] - p.r_s[1] * n[0]) * p.phi[2]
    found = value(equilibrium.displacement(p.motion, p.section, p.test, lambda a: a))
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_planar_is_spatial_in_a_plane(seed):
    p = PlanePoint(seed)
    np.testing.assert_allclose(value(p.motion.R), value(p.in_space.R), atol=1e-14)
    np.testing.assert_allclose(value(p.motion.curvature), value(p.in_space.curvature), atol=1e-14)
    n, phi_n = VECTOR([0.4, -0.8, 0]), VECTOR([0.7, 0.2, 0])
    turn = determinate.tests_of(p.test.phi, p.test.phi_s)
    for form in (
        lambda motion: equilibrium.mixed(n, motion, p.section, p.test, phi_n, lambda a: a),
        lambda motion: equilibrium.second_variation(n, motion, p.section, p.test, p.test),
        lambda motion: equilibrium.second_variation(n, motion, p.section, p.sideways, p.sideways),
        lambda motion: determinate.second_variation(n, motion, p.section, p.sideways, p.sideways),
        lambda motion: determinate.moments(n, motion, p.section, turn, lambda a: a),
    ):
        np.testing.assert_allclose(value(form(p.motion)), value(form(p.in_space)), rtol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_what_leaves_the_plane_decouples_exactly(seed):
    p = PlanePoint(seed)
    n = VECTOR([0.4, -0.8, 0])
    for form in (equilibrium.second_variation, determinate.second_variation):
        assert value(form(n, p.in_space, p.section, p.test, p.sideways)) == 0
        assert value(form(n, p.in_space, p.section, p.sideways, p.test)) == 0
        assert value(form(n, p.in_space, p.section, p.sideways, p.sideways)) != 0


def test_an_axis_that_is_not_principal_couples():
    p = PlanePoint(0)
    c, s = np.cos(0.3), np.sin(0.3)
    askew = p.section._replace(R_R=p.section.R_R * ufl.as_matrix([[c, -s, 0], [s, c, 0], [0, 0, 1]]))
    n = VECTOR([0.4, -0.8, 0])
    assert abs(value(equilibrium.second_variation(n, p.in_space, askew, p.test, p.sideways))) > 1e-3


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


@pytest.mark.parametrize("seed", range(3))
def test_coupled_law_read_backwards(seed):
    p = CoupledPoint(seed)
    n, m = (VECTOR(value(a)) for a in equilibrium.contact(p.motion(), p.section))
    np.testing.assert_allclose(value(equilibrium.tangent_of_force(n, p.motion(), p.section)), p.r_s, rtol=1e-12)
    np.testing.assert_allclose(value(equilibrium.contact_moment(n, p.motion(), p.section)), value(m), rtol=1e-12)
    plain = equilibrium.displacement(p.motion(), p.section, p.test, as_it_is)
    mixed = equilibrium.mixed(n, p.motion(), p.section, p.test, VECTOR([1, 2, 3]), as_it_is)
    assert value(mixed) == pytest.approx(value(plain), rel=1e-12)


@pytest.mark.parametrize("p", [Point(1), *map(CoupledPoint, range(3))], ids=["diagonal", *"012"])
def test_second_variation_is_the_change_of_the_balance(p):
    """Where n agrees with the motion; with n known, that of the moments."""
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
