"""The spatial model in motion with mass centres off the axis, with the momentum-conserving scheme."""

import numpy as np
import ufl

from cosserat_fenicsx import quaternions
from cosserat_fenicsx.forms import eccentric, inertia
from cosserat_fenicsx.forms.rotation import directors
from cosserat_fenicsx.models.moving import MovingSpatial, turned_by
from cosserat_fenicsx.models.moving_forms import SpatialStep, compile_momentum, parts_of
from cosserat_fenicsx.models.turning import Turning


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
        self.turning.x.array[:] = (W + np.cross(change[:, :, None], quaternions.directors(q), axis=1)).ravel()
