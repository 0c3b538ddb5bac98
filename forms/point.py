"""The state at a point of a rod, the argument of an action's virtual work, and the derivative of that work."""

from functools import cached_property

import ufl
from cosserat_fenicsx.forms.equilibrium import VirtualMotion

NONE = ufl.as_vector([0, 0, 0])
AXES = tuple(ufl.as_vector([float(i == j) for j in range(3)]) for i in range(3))


class Point:
    """The state at a point of a rod, inertial components.

    Args:
        r: position, from the origin of the rod's structure; r_s: its derivative along the rod. None in the determinate
            models, where positions are computed afterwards.
        R: rotation from the reference, a matrix.
        theta: rotation vector from the reference; in space for angles below a full turn, in a plane for any angle.
        curvature: axial vector of R^T R', `equilibrium.Motion.curvature`; None in the determinate models.
        r_t, omega: velocity and angular velocity; zero at rest.
        fixed: see the property.
        rest, frame: functions that give the position at rest, from the same origin, and [d_1R d_2R d_3R], the directors
            at rest as columns. They are called only where a virtual work needs them.
    """

    def __init__(self, r, r_s, R, theta, *, rest, frame, curvature=None, r_t=NONE, omega=NONE, fixed=None):
        self.r, self.r_s, self.R, self.theta, self.curvature = r, r_s, R, theta, curvature
        self.r_t, self.omega = r_t, omega
        self._rest, self._frame, self._fixed = rest, frame, fixed

    @property
    def fixed(self):
        """The same point with values that `variation` does not differentiate, such as for the limit of friction."""
        return self._fixed or self

    @cached_property
    def rest(self):
        """Position at rest."""
        return self._rest()

    @cached_property
    def u(self):
        """Displacement from the reference."""
        return self.r - self.rest

    @cached_property
    def directors(self):
        """[d_1 d_2 d_3], the current directors as columns; d_3 is the tangent of an unsheared rod."""
        return self.R * self._frame()

    def variable(self):
        """The same point with r, r_s, R and curvature as UFL variables, by which expressions can be differentiated."""
        *moved, curvature = (None if x is None else ufl.variable(x) for x in (self.r, self.r_s, self.R, self.curvature))
        turned = moved[2] * self.R.T  # the identity; its derivative is that of R
        small = (
            ufl.as_vector([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]) / 2
        )
        theta = self.theta + _by_small_rotation(self.theta, small)
        unchanged = {"rest": self._rest, "frame": self._frame, "r_t": self.r_t, "omega": self.omega}
        return Point(*moved, theta, curvature=curvature, **unchanged, fixed=self)


def _by_small_rotation(theta, phi):
    """The change of the rotation vector theta by a small inertial rotation phi: phi - theta x phi/2 + c theta x (theta
    x phi), c = (1 - (a/2) cot(a/2))/a^2 with a = |theta|."""
    square = ufl.dot(theta, theta)
    angle = ufl.sqrt(ufl.max_value(square, 1e-4))
    closed = (1 - angle / 2 * ufl.cos(angle / 2) / ufl.sin(angle / 2)) / angle**2
    c = ufl.conditional(ufl.lt(square, 1e-4), 1 / 12 + square / 720, closed)
    across = ufl.cross(theta, phi)
    return phi - across / 2 + c * ufl.cross(theta, across)


def variation(work, point, test, direction):
    """The change of a virtual work `work(point, test)` in a direction of small displacement and inertial rotation.
    direction: a `VirtualMotion`: phi_r, phi_r_s, phi and phi_s, with dR = phi x R and d(curvature) = R^T phi_s."""
    moved = point.variable()
    value = work(moved, test)
    change = 0
    bent = None if moved.curvature is None else point.R.T * direction.phi_s
    for of, by in ((moved.r, direction.phi_r), (moved.r_s, direction.phi_r_s), (moved.curvature, bent)):
        if of is not None:
            change += ufl.dot(ufl.diff(value, of), by)
    slope = ufl.diff(value, moved.R)
    turned = [ufl.cross(direction.phi, point.R[:, j]) for j in range(3)]
    return change + sum(slope[i, j] * turned[j][i] for i in range(3) for j in range(3))


def slowed(work, point, test, velocity):
    """The change of a virtual work `work(point, test)`, at rest, by a small velocity: the factors of phi_r and phi of
    a `VirtualMotion` are velocity and angular velocity."""
    r_t, omega = ufl.variable(NONE), ufl.variable(NONE)
    point = Point(
        point.r, point.r_s, point.R, point.theta, curvature=point.curvature, rest=point._rest, frame=point._frame,
        r_t=r_t, omega=omega,
    )  # fmt: skip
    value = work(point, test)
    return ufl.dot(ufl.diff(value, r_t), velocity.phi_r) + ufl.dot(ufl.diff(value, omega), velocity.phi)


def resultants(work, point):
    """Force and moment of a virtual work, inertial: the factors of phi_r and phi in it."""
    force = [work(point, VirtualMotion(axis, NONE, NONE, NONE)) for axis in AXES]
    moment = [work(point, VirtualMotion(NONE, axis, NONE, NONE)) for axis in AXES]
    return ufl.as_vector(force), ufl.as_vector(moment)
