"""The form that shows whether the actions on rods have a potential, on the spatial model's unknowns.

The virtual work of the actions is a one-form omega on the configurations. If its exterior derivative d omega vanishes
for all motions that the supports allow, the actions have a potential near that state, and the second variation is
symmetric. Otherwise -d omega/2 is the skew-symmetric part of the second variation (circulatory forces, Ziegler).
"""

from functools import partial

import numpy as np
import ufl

from cosserat_fenicsx import compat
from cosserat_fenicsx.forms import spatial as eq
from cosserat_fenicsx.forms.equilibrium import VirtualMotion
from cosserat_fenicsx.forms.point import NONE
from cosserat_fenicsx.models.compiled import action_work, compile_single, measures, varied_actions
from cosserat_fenicsx.models.spatial import SpatialModel


class CirculatoryModel(SpatialModel):
    """A `SpatialModel` whose only form is h of `_form`, stored as its second variation. h is None, and nothing is
    compiled, if the actions have a potential in every state, as dead forces have."""

    def _compile(self, spaces):
        return compile_single(self, self._form(*spaces))

    def _form(self, rotations):
        """h with d omega(w, psi) = h(w, psi) - h(psi, w): h(w, psi) = D_w omega(psi) + omega(w x psi)/2, because the
        Lie bracket of two fields of inertial rotations is their cross product. h is assembled, rather than d omega,
        because its norm gives the rounding error of d omega."""
        U, U_node, dx = self.state, compat.alias(self.state), measures(self)
        psi, w = ufl.TestFunction(rotations), ufl.TrialFunction(rotations)
        test, direction = eq.rotation_tests_of(psi, psi.dx(0)), eq.rotation_tests_of(w, w.dx(0))

        def point_at(place, rest, frame):
            state = U if place == "line" else U_node
            return eq.point_of(state, state.dx(0), rest=rest, frame=frame)

        work = partial(action_work, self, dx, point_at=point_at, unknowns=(U, U_node))
        form = varied_actions(work(test), test, direction)
        of_bracket = work(VirtualMotion(NONE, ufl.cross(direction.phi, test.phi), NONE, NONE))
        for factor, part in (
            *((self.load_factor, part) for part in of_bracket.dead.values()),
            *((self.permanent_factor, part) for part in of_bracket.permanent.values()),
            *((live.factor, live.form) for live in of_bracket.live),
        ):
            form += 0.5 * factor * part
        return form or None

    @property
    def remembers(self):
        """Whether an action has memory: its work then depends on the path, and it has no potential."""
        return any(kind.memory for kind in self.signature.terms)

    def take(self, rq, load_factor):
        """Set the state from (r, q) of all nodes (N, 7), dimensionless, in the scene's order, and a load factor."""
        self.set_motion(self.unknowns_of(rq), np.zeros((sum(self.signature.counts), len(self.forms.gauss), 3)))
        self.load_factor.value = load_factor
        self.actions.refresh()

    def held(self, rq, load_factor):
        """Gradients of the constraint equations of supports and joints, (equations, tied nodes, 6)."""
        if not self.ties:
            return np.zeros((0, 0, 6))
        return self.ties.on_nodes(self.ties.evaluate(rq[self.tied_slots], load_factor)[1])
