"""Moving spatial models that carry the rates of the directors of the nodes from step to step, by the trapezoidal rule:
with mass centres off the axis (forms/eccentric.py), and with the energy-conserving scheme (forms/energy.py)."""

import numpy as np
import ufl
from dolfinx import fem

from cosserat_fenicsx import compat, numerics
from cosserat_fenicsx.forms import eccentric, energy, inertia
from cosserat_fenicsx.forms.rotation import directors
from cosserat_fenicsx.models.compiled import along
from cosserat_fenicsx.models.moving import (
    MovingSpatial,
    SpatialStep,
    compile_motion,
    parts_of,
    spun,
    turned_by,
    virtual_work_of_step,
)
from cosserat_fenicsx.models.rod_data import as_matrix


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


class EccentricMomenta:
    """Mixin of a `SpatialStep`, first among the bases: the momenta of forms/eccentric.py."""

    def momentum(self, w, w_t):
        (_, q), (_, q_t) = parts_of(w), parts_of(w_t)
        return self.momentum_with(w, w_t, eccentric.arm_rate(q, q_t, self.body))

    def kinetic(self, w, w_t):
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

    def __init__(self, model):
        super().__init__(model)
        self.turned = as_matrix(model.turning) * self.body.offset

    def momentum_before(self):
        return self.momentum_with(self.nodal, self.rates, self.turned)

    def kinetic_before(self):
        return self.kinetic_with(self.nodal, self.rates, self.turned)

    def momentum_after(self):
        return self.momentum_with(self.nodal, 2 * self.passed - self.rates, 2 * self._arm_passed() - self.turned)

    def of_moving_axis(self):
        return eccentric.of_moving_axis(parts_of(self.passed)[0], self._arm_passed(), self.body, self.test)

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


def compile_conserving(step):
    """The `MotionForms` of the energy-conserving scheme of a moving spatial model, from its `SpatialStep`.

    Test functions are changes of (r, q). The residual has all terms of the step except loads, and no equation |q| = 1.
    """
    model, dx, section, viscosity, body = step.model, step.dx, step.section, step.viscosity, step.body
    h, phi = model.h, step.phi
    turning = compat.alias(model.turning) if model.signature.degree == 1 else model.turning

    def line(w):
        (_, q), (r_s, q_s) = parts_of(w), parts_of(along(w))
        return energy.Configuration(r_s, q, q_s)

    before, after = line(step.start), line(step.state)
    test = energy.Variation(*parts_of(phi), *parts_of(along(phi)))

    (r0, q0), (r1, q1), (r_t, _) = parts_of(step.nodal0), parts_of(step.nodal), parts_of(step.rates)
    spin = as_matrix(turning)
    moved, turned = (r1 - r0) / h, (energy.directors(q1) - energy.directors(q0)) / h
    half = (q0 + q1) / 2
    residual = energy.rate_work(2 * (moved - r_t) / h, 2 * (turned - spin) / h, half, body, test) * dx.nodes
    residual += model.drag[0] * energy.rate_work(moved, turned, half, body, test) * dx.nodes
    residual += energy.stress_work(before, after, section, viscosity, h, test) * dx.gauss

    def of_stress(test):
        """At a clamped point delta q = phi/2: q is (1, 0, 0, 0) there."""
        q, q_s = (ufl.as_vector([0, *(a[i] / 2 for i in range(3))]) for a in (test.phi, test.phi_s))
        varied = energy.Variation(test.phi_r, q, test.phi_r_s, q_s)
        return energy.stress_work(before, after, section, viscosity, h, varied)

    of_step = virtual_work_of_step(model, of_stress, step.halfway_point)
    acting = step.actions(step.halfway_point)
    n, m = inertia.contact(step.after, section, viscosity, lambda a: ufl.derivative(a, step.state, step.velocity))
    kappa = energy.angular_momentum(q1, spin, body)
    if body.offset is None:
        momentum = inertia.momentum(r_t, kappa, body, step.test)
    else:
        momentum = eccentric.momentum(r_t, eccentric.arm(q1, body), spin * body.offset, kappa, body, step.test)
    lost = energy.viscous_loss(before, after, section, viscosity, h) * dx.gauss
    lost += 2 * h * model.drag[0] * energy.kinetic_energy(moved, turned, body) * dx.nodes
    others = {
        "momentum": momentum * dx.nodes,
        "kinetic": energy.kinetic_energy(r_t, spin, body) * dx.nodes,
        "strain": energy.strain_energy(after, section) * dx.gauss,
        "dissipated": lost,
    }
    fields, dead = model.fields_of(n, m, step.after.r_s), acting._replace(live=[])
    return compile_motion(model, residual, dead, step.derivative, fields, others, of_step, acting, turned=True)


class ConservingSpatial(Turning, MovingSpatial):
    """See `MovingSpatial`; angular velocities are those of the directors' rates."""

    scheme = staticmethod(compile_conserving)

    def accept(self, h):
        super().accept(h)
        nodal = self.nodal
        q = self.state.x.array[nodal[:, 3:]]
        omega = np.cross(numerics.directors(q), self.turning.x.array.reshape(-1, 3, 3), axis=1).sum(axis=2) / 2
        self.velocity.x.array[nodal[:, 3:]] = spun(q, omega)
