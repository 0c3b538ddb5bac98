"""Moving spatial models that carry the rates of the directors of the nodes from step to step, by the trapezoidal rule:
with mass centres off the axis (forms/eccentric.py), and with the energy-conserving scheme (forms/energy.py)."""

import numpy as np
import ufl
from dolfinx import fem

from cosserat_fenicsx import compat, numerics
from cosserat_fenicsx.forms import eccentric, energy, inertia
from cosserat_fenicsx.forms import spatial as eq
from cosserat_fenicsx.forms.rotation import directors, small_rotation
from cosserat_fenicsx.models.compiled import action_work, derivative_in, measures
from cosserat_fenicsx.models.moving import (
    MovingSpatial,
    SpatialData,
    SpatialStep,
    along,
    compile_momentum,
    compile_motion,
    parts_of,
    spun,
    turned_by,
    virtual_work_of_step,
)


class Turning:
    """Mixin of moving spatial models; it must come first among the bases.

    Attributes:
        turning: rates of the directors R(q) of the nodes at the beginning of a step, (3 x 3) row by row.
    """

    def _motion_fields(self):
        super()._motion_fields()
        element = compat.lagrange(self.mesh, self.signature.degree, 9)
        self.turning = fem.Function(compat.function_space(self.mesh, element))

    def load(self, scene, layout):
        """See `Moving`."""
        super().load(scene, layout)
        self.turning.x.array[:] = 0.0

    def set_velocity(self, linear, angular):
        """See `Moving`."""
        super().set_velocity(linear, angular)
        R = numerics.directors(self.state.x.array[self._nodal[:, 3:]])
        self.turning.x.array[:] = np.cross(angular[self._slots][:, :, None], R, axis=1).ravel()

    @property
    def ends(self):
        """See `Moving`."""
        return *super().ends, self.turning

    @property
    def rate_arrays(self):
        """See `Moving`."""
        return *super().rate_arrays, self.turning.x.array

    def accept(self, h):
        """See `Moving`."""
        super().accept(h)
        places = self._nodal[:, 3:]
        R, before = (numerics.directors(f.x.array[places]) for f in (self.state, self.start))
        W = self.turning.x.array.reshape(-1, 3, 3)
        W[:] = 2 / h * (R - before) - W


class EccentricMomenta:
    """Mixin of a `SpatialStep`, first among the bases: the momenta of forms/eccentric.py."""

    def momentum(self, w, w_t):
        """See `StepForms`."""
        (_, q), (_, q_t) = parts_of(w), parts_of(w_t)
        return self.momentum_with(w, w_t, eccentric.arm_rate(q, q_t, self.body))

    def kinetic(self, w, w_t):
        """See `StepForms`."""
        (_, q), (_, q_t) = parts_of(w), parts_of(w_t)
        return self.kinetic_with(w, w_t, eccentric.arm_rate(q, q_t, self.body))

    def momentum_with(self, w, w_t, z_t):
        """`momentum` with the rate z_t of the mass centre about the axis."""
        (_, q), (r_t, q_t), body = parts_of(w), parts_of(w_t), self.body
        kappa = inertia.angular_momentum(q, q_t, body)
        return eccentric.momentum(r_t, eccentric.arm(q, body), z_t, kappa, body, self.test)

    def kinetic_with(self, w, w_t, z_t):
        """`kinetic` likewise."""
        (_, q), (r_t, q_t) = parts_of(w), parts_of(w_t)
        return eccentric.kinetic_energy(r_t, z_t, inertia.angular_velocity(q, q_t), self.body)


class EccentricStep(EccentricMomenta, SpatialStep):
    """See `StepForms`: with the rates of the directors of `Turning`."""

    def _take_data(self):
        super()._take_data()
        W = self.model.turning
        self.turned = ufl.as_matrix([[W[3 * i + j] for j in range(3)] for i in range(3)]) * self.body.offset

    def momentum_before(self):
        """See `StepForms`."""
        return self.momentum_with(self.nodal, self.rates, self.turned)

    def kinetic_before(self):
        """See `StepForms`."""
        return self.kinetic_with(self.nodal, self.rates, self.turned)

    def momentum_after(self):
        """See `StepForms`."""
        return self.momentum_with(self.nodal, 2 * self.passed - self.rates, 2 * self._arm_passed() - self.turned)

    def of_moving_axis(self):
        """See `StepForms`."""
        return eccentric.of_moving_axis(parts_of(self.passed)[0], self._arm_passed(), self.body, self.test)

    def _arm_passed(self):
        """The rate (z_1 - z_0)/h of the step."""
        q1, q0 = parts_of(self.nodal)[1], parts_of(self.nodal0)[1]
        return (directors(q1) - directors(q0)) * self.body.offset / self.model.h


class EccentricSpatial(Turning, MovingSpatial):
    """See `MovingSpatial`."""

    def _compile(self, spaces):
        self._motion_fields()
        return compile_momentum(EccentricStep(self))

    def set_velocity(self, linear, angular):
        """See `Moving`: the rates of the directors change with the angular velocities, which differ from theirs by the
        error of the scheme, so that momenta stay the same where these do."""
        places, W = self._nodal[:, 3:], self.turning.x.array.reshape(-1, 3, 3).copy()
        q = self.state.x.array[places]
        change = angular[self._slots] - turned_by(self.velocity.x.array[places], q)
        super().set_velocity(linear, angular)
        self.turning.x.array[:] = (W + np.cross(change[:, :, None], numerics.directors(q), axis=1)).ravel()


def compile_conserving(model):
    """The `MotionForms` of the energy-conserving scheme of a moving spatial model.

    Test functions are changes of (r, q). The residual has all terms of the step except loads, and no equation |q| = 1.
    """
    dx, data = measures(model), SpatialData.of(model)
    named = compat.alias if model.signature.degree == 1 else (lambda function: function)
    U, U0, V, W = model.state, model.start, model.velocity, model.turning
    nodal, nodal0, rates, turning = named(U), named(U0), named(V), named(W)
    h, section, viscosity, body = model.h, data.section, data.viscosity, data.body

    def line(w):
        (_, q), (r_s, q_s) = parts_of(w), parts_of(along(w))
        return energy.Configuration(r_s, q, q_s)

    before, after = line(U0), line(U)
    phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
    test = energy.Variation(*parts_of(phi), *parts_of(along(phi)))
    derivative = derivative_in(trial, *dict.fromkeys((U, nodal)))

    (r0, q0), (r1, q1), (r_t, _) = parts_of(nodal0), parts_of(nodal), parts_of(rates)
    spin = ufl.as_matrix([[turning[3 * i + j] for j in range(3)] for i in range(3)])
    moved, turned = (r1 - r0) / h, (energy.directors(q1) - energy.directors(q0)) / h
    half = (q0 + q1) / 2
    residual = energy.rate_work(2 * (moved - r_t) / h, 2 * (turned - spin) / h, half, body, test) * dx.nodes
    residual += model.drag[0] * energy.rate_work(moved, turned, half, body, test) * dx.nodes
    residual += energy.stress_work(before, after, section, viscosity, h, test) * dx.gauss

    def point_at(place, rest, frame):
        w, w0 = (U, U0) if place == "line" else (nodal, nodal0)
        r_t, q_t = parts_of((w - w0) / h)
        middle = (w + w0) / 2
        omega = small_rotation(q_t, parts_of(middle)[1])
        return eq.point_of(middle, along(middle), rest=rest, frame=frame, r_t=r_t, omega=omega)

    def end_point(place, rest, frame):
        w = U if place == "line" else nodal
        return eq.point_of(w, along(w), rest=rest, frame=frame)

    def of_stress(test):
        """At a clamped point delta q = phi/2: q is (1, 0, 0, 0) there."""
        q, q_s = (ufl.as_vector([0, *(a[i] / 2 for i in range(3))]) for a in (test.phi, test.phi_s))
        varied = energy.Variation(test.phi_r, q, test.phi_r_s, q_s)
        return energy.stress_work(before, after, section, viscosity, h, varied)

    of_step = virtual_work_of_step(model, of_stress, point_at)
    acting = action_work(model, dx, eq.tests_of(phi, along(phi)), point_at, {U, nodal}, end_point)
    state = eq.state_of(U, along(U), U)
    n, m = inertia.contact(state, section, viscosity, lambda a: ufl.derivative(a, U, V))
    tests, kappa = eq.tests_of(phi, along(phi)), energy.angular_momentum(q1, spin, body)
    if body.offset is None:
        momentum = inertia.momentum(r_t, kappa, body, tests)
    else:
        momentum = eccentric.momentum(r_t, eccentric.arm(q1, body), spin * body.offset, kappa, body, tests)
    lost = energy.viscous_loss(before, after, section, viscosity, h) * dx.gauss
    lost += 2 * h * model.drag[0] * energy.kinetic_energy(moved, turned, body) * dx.nodes
    others = {
        "momentum": momentum * dx.nodes,
        "kinetic": energy.kinetic_energy(r_t, spin, body) * dx.nodes,
        "strain": energy.strain_energy(after, section) * dx.gauss,
        "dissipated": lost,
    }
    fields = ufl.as_vector([*n, *m, *state.r_s])
    dead = acting._replace(live=[])
    return compile_motion(model, residual, dead, derivative, fields, others, of_step, acting, turned=True)


class ConservingSpatial(Turning, MovingSpatial):
    """See `MovingSpatial`; angular velocities are those of the directors' rates."""

    def _compile(self, spaces):
        self._motion_fields()
        return compile_conserving(self)

    def accept(self, h):
        """See `Moving`."""
        super().accept(h)
        nodal = self._nodal
        q = self.state.x.array[nodal[:, 3:]]
        omega = np.cross(numerics.directors(q), self.turning.x.array.reshape(-1, 3, 3), axis=1).sum(axis=2) / 2
        self.velocity.x.array[nodal[:, 3:]] = spun(q, omega)
