"""The planar rung with inertia: a scene that moves in a plane does not pay for space."""

import numpy as np
import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.forms import inertia
from cosserat_fenicsx.forms import planar as eq
from cosserat_fenicsx.models.compiled import derivative_in, load_work, measures, with_live_loads
from cosserat_fenicsx.models.moving import Moving
from cosserat_fenicsx.models.moving_forms import compile_motion
from cosserat_fenicsx.models.planar import PlanarModel

_OFF = 1e-9


class MovingPlanar(Moving, PlanarModel):
    """Scenes that move in a plane."""

    variations = ()
    inertia_size = 1

    def _compile(self, spaces):
        self._motion_fields()
        return compile_planar(self)

    def _section_inertia(self, J, frames):
        along = np.einsum("...ik,i->...k", frames, self.axes[2])
        return np.einsum("...k,...k->...", along**2, J)[..., None]

    def passed(self):
        """See `Moving`."""
        return self.state.x.array - self.start.x.array

    def set_velocity(self, linear, angular):
        """See `Moving`."""
        e1, e2, normal = self.axes
        off = max(np.abs(linear @ normal).max(), np.abs(angular @ e1).max(), np.abs(angular @ e2).max())
        if off > _OFF * max(np.abs(linear).max(), np.abs(angular).max(), 1e-300):
            raise SceneError("Scene.velocities leave the plane of the scene: expected model = 'spatial'")
        x = self.velocity.x.array
        x[self._nodal[:, :2]] = (linear @ self.axes[:2].T)[self._slots]
        x[self._nodal[:, 2]] = (angular @ normal)[self._slots]

    def unknowns_of(self, rq):
        """See `RodModel`."""
        off = np.abs((rq[:, :3] - self.reference) @ self.axes[2]).max(), np.abs(rq[:, 4:] @ self.axes[:2].T).max()
        if max(off) > _OFF:
            raise SceneError("simulate.start lies outside the plane of the scene: expected model = 'spatial'")
        return super().unknowns_of(rq)

    def loads_at(self, t):
        """See `Moving`.

        Raises:
            SceneError: a load that leaves the plane at this time.
        """
        super().loads_at(t)
        for work, _, (vectors, *_) in self.terms:
            given = vectors.x.array.reshape(-1, 3)
            off = given[:, :2] if "moment" in work.__name__ else given[:, 2]
            if np.abs(off).max(initial=0.0) > _OFF * np.abs(given).max(initial=0.0):
                raise SceneError(
                    f"a {work.__name__.replace('_', ' ')} leaves the plane at t = {t:g} s: expected model = 'spatial'"
                )

    def rates(self):
        """See `Moving`."""
        axes = self.axes
        return lambda nodal, rates: np.concatenate([rates[..., :2] @ axes[:2], rates[..., 2:] * axes[2]], axis=-1)

    def _momenta_of(self, p):
        return p[:, :2] @ self.axes[:2], p[:, 2:] * self.axes[2]

    def _positions(self):
        return self.state.x.array[self._nodal[:, :2]] @ self.axes[:2] + self._out_of_plane()[self._slots]


def compile_planar(model):
    """The `MotionForms` of a `MovingPlanar`, momentum scheme."""
    data, dx, h = model.data, measures(model), model.h
    named = compat.alias if model.shape.degree == 1 else (lambda function: function)
    U, U0, V = model.state, model.start, model.velocity
    nodal, nodal0, rates = named(U), named(U0), named(V)

    def along(w):
        return ufl.grad(w)[:, 0]  # the mesh is the line of arc length

    def motion_of(u):
        return eq.motion_of(along(u), u[2], along(u)[2])

    def weighted(w, a):
        return model.mass[0] * (w[0] * a[0] + w[1] * a[1]) + model.inertia[0] * w[2] * a[2]

    section = eq.section_of(data.K, data.K_inv, data.J, data.R_R, data.v_R)
    viscosity = inertia.Viscosity(model.Kt, model.Jt)
    before, after, middle = (motion_of(u) for u in (U0, U, (U + U0) / 2))
    phi, trial = ufl.TestFunction(model.space), ufl.TrialFunction(model.space)
    test = eq.tests_of(phi, along(phi))
    passed = (nodal - nodal0) / h
    residual = (1 / h * weighted(2 * passed - rates, phi) + model.drag[0] * weighted(passed, phi)) * dx.nodes
    residual += inertia.averaged_stress(before, after, middle, section, viscosity, h, test) * dx.gauss
    derivative = derivative_in(trial, *dict.fromkeys((U, nodal)))
    R_middle = eq.rotation_matrix((nodal[2] + nodal0[2]) / 2)
    loads = load_work(model, dx, test, R_middle, {U, nodal})
    residual, tangent = with_live_loads(model, loads, residual, derivative(residual), derivative)
    n, m = inertia.contact(after, section, viscosity, lambda a: ufl.derivative(a, U, V))
    lost = inertia.viscous_loss(before, after, section, viscosity, h) * dx.gauss
    others = {
        "momentum": weighted(rates, phi) * dx.nodes,
        "live": sum(term for term, _, _ in loads.live) if loads.live else None,
        "kinetic": weighted(rates, rates) / 2 * dx.nodes,
        "strain": inertia.strain_energy(after, section) * dx.gauss,
        "dissipated": lost + h * model.drag[0] * weighted(passed, passed) * dx.nodes,
    }
    fields = ufl.as_vector([n[0], n[1], m[2], after.r_s[0], after.r_s[1]])
    return compile_motion(model, residual, tangent, loads.dead, fields, others)
