"""Moving spatial models that carry the rates of the directors of the nodes from step to step, by the trapezoidal rule:
with mass centres off the axis (forms/eccentric.py), and with the energy-conserving scheme (forms/energy.py)."""

import numpy as np
import ufl
from dolfinx import fem

from cosserat_fenicsx import compat, numerics
from cosserat_fenicsx.forms import eccentric, energy, inertia
from cosserat_fenicsx.forms.rotation import directors
from cosserat_fenicsx.forms.spatial import parts_of
from cosserat_fenicsx.models.compiled import along
from cosserat_fenicsx.models.moving import MovingSpatial, SpatialStep, turned_by, virtual_work_of_step
from cosserat_fenicsx.models.rod_data import as_matrix


class Turning:
    """Mixin of moving spatial models, first among the bases; turning: rates of the directors R(q) of the nodes at the
    beginning of a step, (3 x 3) row by row."""

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


class ConservingStep(SpatialStep):
    """See `StepForms`: energies and momenta of the directors' rates; test functions are changes of (r, q).

    Attributes:
        spin: rates of the directors at the beginning of the step; moved, turned: mean rates of r and of the directors
            over it.
        lines: `energy.Configuration`s of its two ends.
    """

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
        if body.offset is None:
            return inertia.momentum(r_t, kappa, body, self.test)
        return eccentric.momentum(r_t, eccentric.arm(q, body), self.spin * body.offset, kappa, body, self.test)

    def kinetic_before(self):
        return energy.kinetic_energy(parts_of(self.rates)[0], self.spin, self.body)

    def kinetic_passed(self):
        return energy.kinetic_energy(self.moved, self.turned, self.body)

    def strain(self):
        return energy.strain_energy(self.lines[1], self.section)

    def viscous_loss(self):
        return energy.viscous_loss(*self.lines, self.section, self.viscosity, self.model.h)


def compile_conserving(step):
    """The `MotionForms` of the energy-conserving scheme, from a `ConservingStep`: the residual has all terms of the
    step except loads, and no equation |q| = 1."""
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
