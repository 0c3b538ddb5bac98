"""The forms of `forms/collocation.py` on a model's mesh, compiled, for both rungs that move."""

import ufl

from cosserat_fenicsx.forms import collocation
from cosserat_fenicsx.forms.rotation import rotation_matrix
from cosserat_fenicsx.models.moving_forms import SpatialStep, parts_of
from cosserat_fenicsx.models.moving_planar import PlanarStep


class SpatialCollocation(SpatialStep):
    """A `SpatialStep` with rates that are six numbers a node, r' in time and Om."""

    def increment(self):
        """What the step adds to r, and the rotation vector that it turns by."""
        (r0, q0), (r1, q1) = parts_of(self.nodal0), parts_of(self.nodal)
        return ufl.as_vector([*(r1 - r0), *collocation.rotation_vector(q0, q1)])

    def rate_of_momentum(self, v, a):
        """Per length, tested, for velocities and accelerations at the end of the step."""
        (_, Om), (r_tt, Om_t) = _halves(v), _halves(a)
        return collocation.rate_of_momentum(r_tt, Om, Om_t, self.rotation_of(self.nodal), self.body, self.test)

    def momentum_by(self, v):
        """Per length, tested, for velocities at the end of the step."""
        return collocation.momentum(*_halves(v), rotation_matrix(parts_of(self.nodal)[1]), self.body, self.test)


class PlanarCollocation(PlanarStep):
    """A `PlanarStep` with the rates of its unknowns."""

    def increment(self):
        """See `SpatialCollocation`."""
        return self.nodal - self.nodal0

    def rate_of_momentum(self, v, a):
        """See `SpatialCollocation`."""
        return self.momentum(self.nodal, a)

    def momentum_by(self, v):
        """See `SpatialCollocation`."""
        return self.momentum(self.nodal, v)


def _halves(a):
    return ufl.as_vector([a[0], a[1], a[2]]), ufl.as_vector([a[3], a[4], a[5]])


def compile_collocated(step):
    """The `MotionForms` at the end of a step, and the changes of the six strains over it, and their rates at its end."""
    model, dx = step.model, step.dx
    increment, strains = (
        step.increment(),
        [collocation.strains(motion, step.section) for motion in (step.before, step.after)],
    )
    v = model.by_velocity * increment + model.known_velocity
    a = model.by_acceleration * increment + model.known_acceleration
    rates = model.by_velocity * (strains[1] - strains[0]) + model.known_strain_rate
    residual = (step.rate_of_momentum(v, a) + model.drag[0] * step.momentum_by(v)) * dx.nodes
    residual += collocation.stress(step.after, step.section, step.viscosity, rates, step.test) * dx.gauss
    residual += step.constraint()
    forms = step.compiled(residual, step.loads(step.nodal), step.loads(step.halfway))
    return forms, strains[1] - strains[0], ufl.derivative(strains[1], step.state, step.velocity)
