"""The viscous law of a scene's rods, and the model of all that resists small velocities about a state."""

from dataclasses import replace

import numpy as np
import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import law
from cosserat_fenicsx.forms.equilibrium import balance, frame
from cosserat_fenicsx.forms.point import slowed
from cosserat_fenicsx.models.compiled import acting_at, measures, nonzero, section_of
from cosserat_fenicsx.models.rod_data import gauss_function, joined, law_data, law_of, viscous_values
from cosserat_fenicsx.models.spatial import CirculatoryModel, small_motion_of
from cosserat_fenicsx.scene.rod import Damping


class Damped:
    """Mixin that adds the viscous law (Kelvin-Voigt) to a `RodModel`; viscosity: the Functions of the law of the strain
    rates, as `rod_data.law_of` takes them; damped: whether any rod has damping."""

    def _viscous_fields(self):
        """Make the Functions of the viscous law."""
        mesh, points, coupled = self.mesh, self.signature.points, self.signature.coupled
        Kt, Jt = (gauss_function(mesh, points, 9 if coupled else 3) for _ in range(2))
        self.viscosity = Kt, None, Jt, gauss_function(mesh, points, 9) if coupled else None

    def _damp(self):
        """Fill in the viscosity of the rods; against strains that infinite stiffnesses prevent it is 0."""
        scene, layout, coupled = self.scene, self.layout, self.signature.coupled
        damped = [rod.damping or Damping() for rod in scene.rods]
        units = replace(self.scales, force=self.scales.force * self.time)
        with np.errstate(invalid="ignore"):  # 0 times an infinite stiffness
            given = joined([
                law_data(damping.viscosity(rod.stiffness_at(x * rod.length)), units, coupled=coupled)
                for rod, damping, x in zip(scene.rods, damped, layout.inside(self.rule.gauss), strict=True)
            ])  # fmt: skip
        given = given._replace(K=np.where(np.isfinite(given.K), given.K, 0.0))
        data = self._section_data(self._in_space._replace(**given._asdict()))
        for function, values in zip(self.viscosity, viscous_values(data), strict=True):
            if function is not None:
                self.rods.fill(function, values)
        self.damped = damped != [Damping()] * len(damped)


class ResistingModel(Damped, CirculatoryModel):
    """A `SpatialModel` whose only form, stored as the second variation, is the virtual work of what resists small
    velocities: -d(virtual work)/d(velocities), of the viscous law and of all actions, at a state at rest."""

    def _form(self, rotations):
        self._viscous_fields()
        U, U_node, dx = self.state, compat.alias(self.state), measures(self)
        test, velocity = small_motion_of(ufl.TestFunction(rotations)), small_motion_of(ufl.TrialFunction(rotations))
        motion, section = self.motion_of(U, U_node), section_of(self)
        T = frame(motion, section)
        rates = T.T * (velocity.phi_r_s - ufl.cross(velocity.phi, motion.r_s)), T.T * velocity.phi_s
        form = balance(*(T * a for a in law.stress(law_of(*self.viscosity), *rates)), motion, test) * dx.gauss

        def point_at(place, rest, frame):
            return self.point_of(U if place == "line" else U_node, rest=rest, frame=frame)

        for _, term, factor, point in acting_at(self, point_at):
            change = slowed(term.work, point, test, velocity)
            measure = {"point": dx.ends, "line": dx.gauss, "node": dx.nodes}[term.kind.place]
            resisted = nonzero(-factor * change * measure)
            form = form if resisted is None else form + resisted
        return form

    def load(self, scene, layout, time):
        """See `RodModel`; time: the unit of time, s."""
        self.time = time
        super().load(scene, layout)
        self._damp()
