"""Moving models for time schemes with accelerations: eq. (1) holds at the end of a step.

Their angular velocities Om and the rates of these have components in the reference frame, as in forms/inertia.py. The
rotation of a section over a step is the rotation vector theta with q_1 = q_0 exp(theta), so that a rotation at constant
Om is exact for any length of the step.

And moving spatial models that carry the rates of the directors of the nodes from step to step, by the trapezoidal rule:
with mass centres off the axis, and with the energy-conserving scheme (forms/energy.py).
"""

from dataclasses import replace

import numpy as np
import ufl
from dolfinx import fem

from cosserat_fenicsx import compat, numerics
from cosserat_fenicsx.forms import energy, equilibrium, inertia, law, rotation, spatial
from cosserat_fenicsx.forms.rotation import directors, rotation_matrix
from cosserat_fenicsx.forms.spatial import parts_of
from cosserat_fenicsx.models.compiled import along, together
from cosserat_fenicsx.models.moving import (
    MovingPlanar,
    MovingSpatial,
    PlanarStep,
    SpatialStep,
    turned_by,
    virtual_work_of_step,
)
from cosserat_fenicsx.models.rod_data import as_matrix, gauss_function
from cosserat_fenicsx.numerics import conjugate_product

# Where tan(|theta|/2)^2 is below this, the series is exact to rounding.
_SMALL = 1e-4


def rotation_over_step(q0, q1):
    """theta in reference components with q1 = q0 exp(theta), |theta| < pi, for q0 and q1 of any length."""
    t = rotation.conjugate_product(q0, q1) / ufl.dot(q0, q1)  # tan(|theta|/2) along theta
    y = ufl.dot(t, t)
    large = ufl.sqrt(ufl.max_value(y, _SMALL))
    series = 1 - y / 3 + y**2 / 5 - y**3 / 7
    return 2 * ufl.conditional(ufl.lt(y, _SMALL), series, ufl.atan(large) / large) * t


def strains_of(motion, section):
    """The six material strains v - v_0 and u - u_0."""
    e, k = equilibrium.strains(motion, section)
    return ufl.as_vector([*e, *k])


def stress_work(motion, section, viscosity, rates, test):
    """Virtual work of n and m in eq. (1), with the viscous terms of the law for given rates of the six strains."""
    T, both = equilibrium.frame(motion, section), equilibrium.strains(motion, section)
    rates = [ufl.as_vector([rates[k + i] for i in range(3)]) for k in (0, 3)]
    return equilibrium.balance(*(T * a for a in law.damped(section.law, viscosity, both, rates)), motion, test)


class SpatialCollocation(SpatialStep):
    """A `SpatialStep` with six rates per node, dr/dt and Om."""

    def increment(self, w, w0):
        """The increment of r over the step, and its rotation vector."""
        (r0, q0), (r1, q1) = parts_of(w0), parts_of(w)
        return ufl.as_vector([*(r1 - r0), *rotation_over_step(q0, q1)])

    def rate_of_momentum(self, v, a):
        """Virtual work of inertia per unit length, from velocities and accelerations at the end of the step."""
        (_, Om), (r_tt, Om_t), b = parts_of(v), parts_of(a), self.body.offset
        R = self._rotation()
        turned = inertia.rate_of_angular_momentum(R, Om, Om_t, self.body)
        z_tt = None if b is None else R * (ufl.cross(Om_t, b) + ufl.cross(Om, ufl.cross(Om, b)))
        return self._momentum(r_tt, turned, R, z_tt)

    def momentum_by(self, v):
        """Momenta times test functions per unit length, from velocities at the end of the step."""
        (r_t, Om), R, b = parts_of(v), self._rotation(), self.body.offset
        return self._momentum(r_t, R * (self.body.I_R * Om), R, None if b is None else R * ufl.cross(Om, b))

    def _momentum(self, r_t, kappa, R, z_t):
        z = None if z_t is None else R * self.body.offset
        return inertia.momentum(r_t, kappa, self.body, self.test, z, z_t)

    def _rotation(self):
        return rotation_matrix(parts_of(self.nodal)[1])

    def point_with(self, w, v, rest, frame):
        """The `Point` with unknowns w and velocities v."""
        r_t, Om = parts_of(v)
        omega = rotation_matrix(parts_of(w)[1]) * Om
        return spatial.point_of(w, along(w), rest=rest, frame=frame, r_t=r_t, omega=omega)


class PlanarCollocation(PlanarStep):
    """A `PlanarStep` whose velocities are the rates of its unknowns."""

    def increment(self, w, w0):
        return w - w0

    def rate_of_momentum(self, v, a):
        return self.momentum(self.nodal, a)

    def momentum_by(self, v):
        return self.momentum(self.nodal, v)

    def point_with(self, w, v, rest, frame):
        return self.model.point_of(w, v, rest=rest, frame=frame)


def compile_collocated(step):
    """The `MotionForms` at the end of a step, with the changes of the six strains over it, and their rates there."""
    model, dx = step.model, step.dx
    increment = step.increment(step.nodal, step.nodal0)
    strains = [strains_of(motion, step.section) for motion in (step.before, step.after)]
    v = model.by_velocity * increment + model.known_velocity
    a = model.by_acceleration * increment + model.known_acceleration
    rates = model.by_velocity * (strains[1] - strains[0]) + model.known_strain_rate
    residual = (step.rate_of_momentum(v, a) + model.drag[0] * step.momentum_by(v)) * dx.nodes

    def of_stress(test):
        return stress_work(step.after, step.section, step.viscosity, rates, test)

    residual += of_stress(step.test) * dx.gauss
    residual += step.constraint()

    def end_point(place, rest, frame):
        w, w0, known = step.nodal, step.nodal0, model.known_velocity
        if place == "line":  # at the Gauss points: coefficients of their own, see `compat.alias`
            w, w0, known = step.state, step.start, compat.alias(known)
        return step.point_with(w, model.by_velocity * step.increment(w, w0) + known, rest, frame)

    of_step = virtual_work_of_step(model, of_stress, end_point)
    forms = step.compiled(residual, step.actions(end_point), step.actions(step.halfway_point), of_step)
    wanted = strains[1] - strains[0], ufl.derivative(strains[1], step.state, step.velocity)
    _, (change, rate) = together(model, [], [(a, forms.gauss) for a in wanted])
    return replace(forms, strain_change=change, strain_rate=rate)


_STRAINS = 6


class Collocated:
    """Mixin that adds accelerations to a moving model; it must come first among the bases.

    D are the increments of the nodes' motion over a step. The scheme is a matrix that gives the rates (v, a, s) at the
    end of the step from D and the rates at its beginning: velocities, accelerations and the scheme's auxiliary rate.
    The same matrix gives strain rates from the increments of the strains at the Gauss points, so that rigid motions are
    not damped. by_velocity, by_acceleration: Constants, the factors of D in v and a; known_velocity,
    known_acceleration, known_strain_rate: Functions, the parts of the rates that do not depend on the increments.
    """

    scheme = staticmethod(compile_collocated)
    #: components of a node's velocity
    rate_size = 0

    def _motion_fields(self):
        super()._motion_fields()
        self.by_velocity, self.by_acceleration = (fem.Constant(self.mesh, np.float64(0)) for _ in range(2))
        element = compat.lagrange(self.mesh, self.signature.degree, self.rate_size)
        space = compat.function_space(self.mesh, element)
        self.known_velocity, self.known_acceleration = fem.Function(space), fem.Function(space)
        self.known_strain_rate = gauss_function(self.mesh, self.signature.points, _STRAINS)
        self._gauss_nodes = compat.cell_nodes(self.known_strain_rate.function_space).ravel()
        self._node_rates = np.zeros((2, len(self.slots) * self.rate_size))
        self._strain_rates = np.zeros((3, len(self.known_strain_rate.x.array)))

    def _at_gauss(self, expression):
        values = compat.evaluate(expression, self.mesh, self._local_cells).reshape(-1, _STRAINS)
        numbers = np.empty_like(self.known_strain_rate.x.array)
        numbers.reshape(-1, _STRAINS)[self._gauss_nodes] = values
        return numbers

    @property
    def rate_arrays(self):
        return self.velocity.x.array, *self._node_rates, *self._strain_rates

    @property
    def ends(self):
        return *super().ends, self.known_velocity, self.known_acceleration, self.known_strain_rate

    def begin_rates(self):
        """Set the strain rates from the state and its velocity; accelerations are set to zero until they are known."""
        self._node_rates[:] = self._strain_rates[:] = 0.0
        self.follow_velocities()

    def follow_velocities(self):
        """Set the strain rates at the beginning of a step from the velocities."""
        if self.damped:
            self._strain_rates[0] = self._at_gauss(self.forms.strain_rate)

    def take_scheme(self, ahead):
        """Set the scheme of the next step, at whose beginning `start` and the state must be; ahead: (3, 4), rows v, a,
        s at its end, columns D and v, a, s at its beginning."""
        self._ahead = ahead
        self.by_velocity.value, self.by_acceleration.value = ahead[:2, 0]
        rates = self._velocities(), *self._node_rates
        self.known_velocity.x.array[:], self.known_acceleration.x.array[:], _ = ahead[:, 1:] @ rates
        if self.damped:
            self.known_strain_rate.x.array[:] = ahead[0, 1:] @ self._strain_rates

    def accept(self, h):
        """See `Moving`: by the scheme of the step."""
        rates = self._ahead @ (self._increments(), self._velocities(), *self._node_rates)
        self._put_velocities(rates[0])
        self._node_rates[:] = rates[1:]
        if self.damped:
            self._strain_rates[:] = self._ahead @ (self._at_gauss(self.forms.strain_change), *self._strain_rates)

    def take_accelerations(self):
        """Set the initial accelerations to those of the step just solved; everything else of it is discarded."""
        a, s = self._node_rates
        rates = self._ahead[1] @ (self._increments(), self._velocities(), a, s)
        if self.damped:
            _, b, c = self._strain_rates
            b[:] = self._ahead[1] @ (self._at_gauss(self.forms.strain_change), *self._strain_rates)
            c[:] = 0.0
        a[:], s[:] = rates, 0.0

    # -- for subclasses to define ------------------------------------------------------------------------------------

    def _increments(self):
        """(nodes * rate_size,) D of the local nodes."""
        raise NotImplementedError

    def _velocities(self):
        """(nodes * rate_size,) from `velocity`, at the beginning of the step."""
        raise NotImplementedError

    def _put_velocities(self, v):
        """Set `velocity` from the velocities at the end of the step."""
        raise NotImplementedError


class CollocatedSpatial(Collocated, MovingSpatial):
    """Velocities are dr/dt and the angular velocity Om in reference components."""

    step_forms, rate_size = SpatialCollocation, 6

    def _increments(self):
        now, before = (f.x.array[self.nodal] for f in (self.state, self.start))
        p, w = conjugate_product(before[:, 3:], now[:, 3:]), np.einsum("ni,ni->n", before[:, 3:], now[:, 3:])
        size = np.sqrt(np.einsum("ni,ni->n", p, p))
        turned = 2 * np.where(size > 0, np.arctan2(size, w) / np.where(size > 0, size, 1.0), 1.0)
        return np.concatenate([now[:, :3] - before[:, :3], turned[:, None] * p], axis=1).ravel()

    def _velocities(self):
        q = self.start.x.array[self.nodal[:, 3:]]
        rates = self.velocity.x.array[self.nodal]
        return np.concatenate([rates[:, :3], 2 * conjugate_product(q, rates[:, 3:])], axis=1).ravel()

    def _put_velocities(self, v):
        nodal, v = self.nodal, v.reshape(-1, 6)
        Om, q = v[:, 3:], self.state.x.array[nodal[:, 3:]]
        rates = self.velocity.x.array
        rates[nodal[:, :3]] = v[:, :3]
        rates[nodal[:, 3]] = -np.einsum("ni,ni->n", q[:, 1:], Om) / 2
        rates[nodal[:, 4:]] = (q[:, :1] * Om + np.cross(q[:, 1:], Om)) / 2


class CollocatedPlanar(Collocated, MovingPlanar):
    """Velocities are the rates of the unknowns."""

    step_forms, rate_size = PlanarCollocation, 3

    def _increments(self):
        return (self.state.x.array - self.start.x.array)[self.nodal].ravel()

    def _velocities(self):
        return self.velocity.x.array[self.nodal].ravel()

    def _put_velocities(self, v):
        self.velocity.x.array[self.nodal.ravel()] = v


class Turning:
    """Mixin, first among the bases; turning: rates of the directors R(q) of the nodes at the step's start (3 x 3)."""

    def _motion_fields(self):
        super()._motion_fields()
        element = compat.lagrange(self.mesh, self.signature.degree, 9)
        self.turning = fem.Function(compat.function_space(self.mesh, element))

    def load(self, scene, layout):
        super().load(scene, layout)
        self.turning.x.array[:] = 0.0

    def set_velocity(self, linear, angular):
        super().set_velocity(linear, angular)
        R = numerics.directors(self.state.x.array[self.nodal[:, 3:]])
        self.turning.x.array[:] = np.cross(angular[self.slots][:, :, None], R, axis=1).ravel()

    @property
    def ends(self):
        return *super().ends, self.turning

    @property
    def rate_arrays(self):
        return *super().rate_arrays, self.turning.x.array

    def accept(self, h):
        super().accept(h)
        places = self.nodal[:, 3:]
        R, before = (numerics.directors(f.x.array[places]) for f in (self.state, self.start))
        W = self.turning.x.array.reshape(-1, 3, 3)
        W[:] = 2 / h * (R - before) - W


class EccentricStep(SpatialStep):
    """See `StepForms`: with the rates of the directors of `Turning`."""

    def __init__(self, model):
        super().__init__(model)
        self.turned = as_matrix(model.turning) * self.body.offset

    def momentum_before(self):
        return self.momentum(self.nodal, self.rates, self.turned)

    def kinetic_before(self):
        return self.kinetic(self.nodal, self.rates, self.turned)

    def momentum_after(self):
        return self.momentum(self.nodal, 2 * self.passed - self.rates, 2 * self._arm_passed() - self.turned)

    def of_moving_axis(self):
        return inertia.of_moving_axis(parts_of(self.passed)[0], self._arm_passed(), self.body, self.test)

    def _arm_passed(self):
        """The rate (z_1 - z_0)/h of the step."""
        q1, q0 = parts_of(self.nodal)[1], parts_of(self.nodal0)[1]
        return (directors(q1) - directors(q0)) * self.body.offset / self.model.h


class EccentricSpatial(Turning, MovingSpatial):
    """See `MovingSpatial`."""

    step_forms = EccentricStep

    def set_velocity(self, linear, angular):
        """See `Moving`: the rates of the directors change with the angular velocities, which differ from theirs by the
        error of the scheme, so that momenta stay the same where these do."""
        places, W = self.nodal[:, 3:], self.turning.x.array.reshape(-1, 3, 3).copy()
        q = self.state.x.array[places]
        change = angular[self.slots] - turned_by(self.velocity.x.array[places], q)
        super().set_velocity(linear, angular)
        self.turning.x.array[:] = (W + np.cross(change[:, :, None], numerics.directors(q), axis=1)).ravel()


class ConservingStep(SpatialStep):
    """See `StepForms`: energies and momenta of the directors' rates; test functions are changes of (r, q). spin: rates
    of the directors at the beginning of the step; moved, turned: mean rates of r and of the directors over it; lines:
    `energy.Configuration`s of its two ends."""

    def __init__(self, model):
        super().__init__(model)
        self.spin = as_matrix(compat.alias(model.turning) if model.signature.degree == 1 else model.turning)
        (r0, q0), (r1, q1) = parts_of(self.nodal0), parts_of(self.nodal)
        self.moved, self.turned = (r1 - r0) / model.h, (directors(q1) - directors(q0)) / model.h
        self.lines = [self._line(w) for w in (self.start, self.state)]

    @staticmethod
    def _line(w):
        (_, q), (r_s, q_s) = parts_of(w), parts_of(along(w))
        return energy.Configuration(r_s, q, q_s)

    def stress_work(self, test):
        """Virtual work of the stress on an `energy.Variation`."""
        return energy.stress_work(*self.lines, self.section, self.viscosity, self.model.h, test)

    def momentum_before(self):
        (_, q), (r_t, _), body = parts_of(self.nodal), parts_of(self.rates), self.body
        kappa = energy.angular_momentum(q, self.spin, body)
        z_t = None if body.offset is None else self.spin * body.offset
        return inertia.momentum(r_t, kappa, body, self.test, inertia.arm(q, body), z_t)

    def kinetic_before(self):
        return energy.kinetic_energy(parts_of(self.rates)[0], self.spin, self.body)

    def kinetic_passed(self):
        return energy.kinetic_energy(self.moved, self.turned, self.body)

    def strain(self):
        return energy.strain_energy(self.lines[1], self.section)

    def viscous_loss(self):
        return energy.viscous_loss(*self.lines, self.section, self.viscosity, self.model.h)


def compile_conserving(step):
    """The `MotionForms` of a `ConservingStep`: the residual has all terms but loads, and no |q| = 1."""
    model, dx, body, h = step.model, step.dx, step.body, step.model.h
    q_m = (parts_of(step.nodal0)[1] + parts_of(step.nodal)[1]) / 2
    test = energy.Variation(*parts_of(step.phi), *parts_of(along(step.phi)))
    rates = 2 * (step.moved - parts_of(step.rates)[0]) / h, 2 * (step.turned - step.spin) / h
    residual = energy.rate_work(*rates, q_m, body, test) * dx.nodes
    residual += model.drag[0] * energy.rate_work(step.moved, step.turned, q_m, body, test) * dx.nodes
    residual += step.stress_work(test) * dx.gauss

    def of_stress(test):
        """At a clamped point delta q = phi/2: q is (1, 0, 0, 0) there."""
        q, q_s = (ufl.as_vector([0, *(a[i] / 2 for i in range(3))]) for a in (test.phi, test.phi_s))
        return step.stress_work(energy.Variation(test.phi_r, q, test.phi_r_s, q_s))

    of_step = virtual_work_of_step(model, of_stress, step.halfway_point)
    acting = step.actions(step.halfway_point)
    return step.compiled(residual, acting._replace(live=[]), acting, of_step, turned=True)


class ConservingSpatial(Turning, MovingSpatial):
    """See `MovingSpatial`; angular velocities are those of the directors' rates."""

    step_forms, scheme = ConservingStep, staticmethod(compile_conserving)

    def accept(self, h):
        super().accept(h)
        nodal = self.nodal
        q = self.state.x.array[nodal[:, 3:]]
        omega = np.cross(numerics.directors(q), self.turning.x.array.reshape(-1, 3, 3), axis=1).sum(axis=2) / 2
        self.velocity.x.array[nodal[:, 3:]] = numerics.spun(q, omega)
