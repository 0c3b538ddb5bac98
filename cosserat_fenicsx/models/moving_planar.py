"""The planar model with inertia, for scenes that move in a plane."""

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.forms import inertia
from cosserat_fenicsx.forms import planar as eq
from cosserat_fenicsx.models.moving import Moving, StepForms
from cosserat_fenicsx.models.planar import PlanarModel
from cosserat_fenicsx.scene.action import is_axial
from cosserat_fenicsx.scene.describe import describe
from cosserat_fenicsx.scene.signals import signals_of

_OFF = 1e-9


class PlanarStep(StepForms):
    """See `StepForms`."""

    def momentum(self, w, w_t):
        test, mass, J = self.test, self.model.mass[0], self.model.inertia[0]
        both = mass * (w_t[0] * test.phi_r[0] + w_t[1] * test.phi_r[1]) + J * w_t[2] * test.phi[2]
        return both + _lateral(self.model, w_t, test.phi_r)

    def kinetic(self, w, w_t):
        both = self.model.mass[0] * (w_t[0] ** 2 + w_t[1] ** 2) + self.model.inertia[0] * w_t[2] ** 2
        return (both + _lateral(self.model, w_t, w_t)) / 2


def _lateral(model, *pair):
    """`inertia.lateral` in the plane."""
    direction = None if model.lateral is None else eq.in_plane(model.lateral)
    return inertia.lateral(direction, *map(eq.in_plane, pair))


class MovingPlanar(Moving, PlanarModel):
    """The planar model with inertia."""

    step_forms, inertia_size = PlanarStep, 1

    def _section_inertia(self, J, frames):
        along = np.einsum("...ik,i->...k", frames, self.axes[2])
        return np.einsum("...k,...k->...", along**2, J)[..., None]

    def passed(self):
        now, before, _ = self._arrays
        return now - before

    def set_velocity(self, linear, angular):
        e1, e2, normal = self.axes
        off = max(np.abs(linear @ normal).max(), np.abs(angular @ e1).max(), np.abs(angular @ e2).max())
        if off > _OFF * max(np.abs(linear).max(), np.abs(angular).max(), 1e-300):
            raise SceneError("Scene.velocities leave the plane of the scene: expected model = 'spatial' in simulate")
        x = self.velocity.x.array
        x[self.nodal[:, :2]] = (linear @ self.axes[:2].T)[self.slots]
        x[self.nodal[:, 2]] = (angular @ normal)[self.slots]

    def unknowns_of(self, rq):
        off = np.abs((rq[:, :3] - self.reference) @ self.axes[2]).max(), np.abs(rq[:, 4:] @ self.axes[:2].T).max()
        if max(off) > _OFF:
            raise SceneError(
                "simulate.start lies outside the plane of the scene: expected model = 'spatial' in simulate"
            )
        return super().unknowns_of(rq)

    def loads_at(self, t):
        """See `Moving`; a SceneError for a load that leaves the plane at this time."""
        if not super().loads_at(t):
            return False
        for load, rod in (pair for term in self.actions.terms for pair in term.acting):
            for datum in load.data(rod, np.array([0.0, rod.length])):
                if datum.size != 3:
                    continue
                given = datum.value.reshape(-1, 3) @ self.axes.T
                off = given[:, :2] if is_axial(datum.unit) else given[:, 2]
                if np.abs(off).max() > _OFF * np.abs(given).max():
                    self._refuse(describe(load), t)
        return True

    def ties_at(self, t):
        """See `Moving`; a SceneError for a prescribed motion that leaves the plane at this time."""
        across = self.axes[2], self.axes[:2]
        for support in self.scene.supports:
            for field, signal in signals_of(support).items():
                given = np.array(signal(t))
                off = across[field == "rotation"] @ given
                if np.abs(off).max() > _OFF * np.abs(given).max():
                    self._refuse(f"the {field} of the {type(support).__name__} at {support.station}", t)
        return super().ties_at(t)

    def _refuse(self, what, t):
        raise SceneError(f"{what} leaves the plane at t = {t:g} s: expected model = 'spatial' in simulate")

    def rates(self):
        axes = self.axes
        return lambda nodal, rates: np.concatenate([rates[..., :2] @ axes[:2], rates[..., 2:] * axes[2]], axis=-1)

    def _momenta_of(self, p):
        return p[:, :2] @ self.axes[:2], p[:, 2:] * self.axes[2]
