"""The forms of `forms/collocation.py` on a model's mesh, compiled, for the planar and the spatial model."""

import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import collocation, eccentric, spatial
from cosserat_fenicsx.forms.rotation import rotation_matrix
from cosserat_fenicsx.models.eccentric import EccentricMomenta
from cosserat_fenicsx.models.moving_forms import SpatialStep, along, parts_of, virtual_work_of_step
from cosserat_fenicsx.models.moving_planar import PlanarStep


class SpatialCollocation(SpatialStep):
    """A `SpatialStep` with six rates per node, dr/dt and Om."""

    def increment(self, w, w0):
        """The increment of r over the step, and its rotation vector."""
        (r0, q0), (r1, q1) = parts_of(w0), parts_of(w)
        return ufl.as_vector([*(r1 - r0), *collocation.rotation_vector(q0, q1)])

    def rate_of_momentum(self, v, a):
        """Virtual work of inertia per unit length, from velocities and accelerations at the end of the step."""
        (_, Om), (r_tt, Om_t) = _halves(v), _halves(a)
        R = rotation_matrix(parts_of(self.nodal)[1])
        return collocation.rate_of_momentum(r_tt, Om, Om_t, R, self.body, self.test)

    def momentum_by(self, v):
        """Momenta times test functions per unit length, from velocities at the end of the step."""
        return collocation.momentum(*_halves(v), rotation_matrix(parts_of(self.nodal)[1]), self.body, self.test)

    def point_with(self, w, v, rest, frame):
        """The `Point` with unknowns w and velocities v."""
        r_t, Om = _halves(v)
        omega = rotation_matrix(parts_of(w)[1]) * Om
        return spatial.point_of(w, along(w), rest=rest, frame=frame, r_t=r_t, omega=omega)


class EccentricCollocation(EccentricMomenta, SpatialCollocation):
    """A `SpatialCollocation` with mass centres off the axis."""

    def rate_of_momentum(self, v, a):
        """See `SpatialCollocation`."""
        (_, Om), (r_tt, Om_t) = _halves(v), _halves(a)
        R = rotation_matrix(parts_of(self.nodal)[1])
        return eccentric.rate_of_momentum(r_tt, Om, Om_t, R, self.body, self.test)

    def momentum_by(self, v):
        """See `SpatialCollocation`."""
        (r_t, Om), R, body = _halves(v), rotation_matrix(parts_of(self.nodal)[1]), self.body
        z, z_t = R * body.offset, R * ufl.cross(Om, body.offset)
        return eccentric.momentum(r_t, z, z_t, R * (body.I_R * Om), body, self.test)


class PlanarCollocation(PlanarStep):
    """A `PlanarStep` whose rates are those of its unknowns."""

    def increment(self, w, w0):
        """See `SpatialCollocation`."""
        return w - w0

    def rate_of_momentum(self, v, a):
        """See `SpatialCollocation`."""
        return self.momentum(self.nodal, a)

    def momentum_by(self, v):
        """See `SpatialCollocation`."""
        return self.momentum(self.nodal, v)

    def point_with(self, w, v, rest, frame):
        """See `SpatialCollocation`."""
        return self.point_of(w, along(w), v, rest, frame)


def _halves(a):
    return ufl.as_vector([a[0], a[1], a[2]]), ufl.as_vector([a[3], a[4], a[5]])


def compile_collocated(step):
    """The `MotionForms` at the end of a step, the changes of the six strains over it, and their rates at its end."""
    model, dx = step.model, step.dx
    increment, strains = (
        step.increment(step.nodal, step.nodal0),
        [collocation.strains(motion, step.section) for motion in (step.before, step.after)],
    )
    v = model.by_velocity * increment + model.known_velocity
    a = model.by_acceleration * increment + model.known_acceleration
    rates = model.by_velocity * (strains[1] - strains[0]) + model.known_strain_rate
    residual = (step.rate_of_momentum(v, a) + model.drag[0] * step.momentum_by(v)) * dx.nodes

    def of_stress(test):
        return collocation.stress(step.after, step.section, step.viscosity, rates, test)

    residual += of_stress(step.test) * dx.gauss
    residual += step.constraint()

    def end_point(place, rest, frame):
        w, w0, known = step.nodal, step.nodal0, model.known_velocity
        if place == "line":  # at the Gauss points: coefficients of their own, see `compat.alias`
            w, w0, known = step.state, step.start, compat.alias(known)
        return step.point_with(w, model.by_velocity * step.increment(w, w0) + known, rest, frame)

    of_step = virtual_work_of_step(model, of_stress, end_point)
    forms = step.compiled(residual, step.actions(end_point), step.actions(step.halfway_point), of_step)
    return forms, strains[1] - strains[0], ufl.derivative(strains[1], step.state, step.velocity)
