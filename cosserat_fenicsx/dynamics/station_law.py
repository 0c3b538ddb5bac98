"""The law of one action with `Action.resists` at a node: of a force along a direction and a torque about the rod's
axis, set-valued, such as those of a bit on rock.

As walls do, it acts on the compliance of the moving rods: the motion of the node in a step is a linear function of
force and torque, by the tangent of Newton's method, and with it the law is solved exactly before Newton's step is
taken. So the node sticks as long as a torque up to the static one can keep it.

A node that is held in a step would swing about rest from then on, since its velocity at the end is twice the mean one
less that at the start. An impulse on the node alone, whose mass is its own, stops it before the next step; what that
takes of the kinetic energy counts as dissipated.
"""

import numpy as np

from cosserat_fenicsx.dynamics.contact import TouchingNodes, motion_between
from cosserat_fenicsx.numerics import directors, small_rotations


class StationLaw:
    """The law of an action in a loaded `StepProblem`; its methods are those of `NodalContact`, and `settle`."""

    def __init__(self, problem, action):
        self._problem, model = problem, problem.model
        slot = model.slot_of(action.station)
        self._nodes = TouchingNodes(problem, np.array([slot]))
        self._dofs = model.nodal[np.flatnonzero(model.slots == slot)]  # with those of other ranks' nodes
        self._law, self._time, scales = model.delays.of(action), model.time, model.scales
        #: units of motion (m, 1) and of force and torque (N, N m)
        self._motions, self._units = np.array([scales.length, 1.0]), scales.force * np.array([1.0, scales.length])
        self._forces, self._axis, self._responses = np.zeros(2), self._law.axis, None
        # energy of impulses that is not yet in the books, and of those in the books of the last step, if it is accepted
        self._stopped, self._booked = 0.0, None

    def settle(self):
        """Stop a held node, see the module; before a step is begun. Schemes with accelerations keep it as it is."""
        along, about = self._law.held
        problem = self._problem
        if not (along or about) or not problem.takes_momentum and problem.acting_share == 1:
            return
        model = problem.model
        w, rates = (self._nodes.of_local(x)[0] for x in (problem.state, model.velocity.x.array))
        turning = small_rotations(w[3:])
        axis = directors(w[None, 3:] / np.linalg.norm(w[3:]))[0] @ self._law.axis
        speeds = rates[:3] @ self._law.down * along, turning @ rates[3:] @ axis * about
        if not any(speeds):
            return
        before = problem.energies()[0]
        more = np.concatenate([-speeds[0] * self._law.down, -speeds[1] / 4 * axis @ turning])
        model.velocity.x.array[self._dofs] += more
        self._stopped += before - problem.energies()[0]

    def begin(self, h):
        self._before = self._nodes.of_local(self._problem.state)
        self._begun, self._responses, self._booked = self._forces, None, None
        self._law.start(h * self._time)

    def accept(self):
        self._booked, self._stopped = self._stopped, 0.0

    def give_up(self):
        self._forces = self._begun
        if self._booked is not None:
            self._stopped, self._booked = self._booked, None

    def _acting(self, forces):
        """(1, 6) of force and torque against the motion."""
        return -np.concatenate([forces[0] * self._law.down, forces[1] * self._axis])[None]

    def add_forces(self, b):
        self._nodes.subtract(self._acting(self._forces), b)

    def _motion(self, after):
        """(2,) motion along the direction and about the axis in the step, and the axis in its middle."""
        middle = (self._before + after)[0, 3:]
        self._axis = directors(middle[None] / np.linalg.norm(middle))[0] @ self._law.axis
        moved = motion_between(self._before, after)[0]
        return np.array([moved[:3] @ self._law.down, moved[3:] @ self._axis])

    def meet(self, x, change):
        after = self._nodes.unknowns(x, change)
        moved = self._motion(after)
        if self._responses is None:
            self._responses = [self._nodes.response(-self._acting(unit)).copy() for unit in np.eye(2)]
            turning, columns = small_rotations(after[0, 3:]), []
            for response in self._responses:
                found = self._nodes.of_vector(response)[0]
                columns.append([found[:3] @ self._law.down, turning @ found[3:] @ self._axis])
            self._compliance = np.transpose(columns)
        before = self._forces
        free = self._motions * (moved + self._compliance @ before)
        self._forces = self._law.forces(free, self._motions[:, None] * self._compliance / self._units) / self._units
        for response, more in zip(self._responses, self._forces - before, strict=True):
            change += response * more

    def books(self):
        moved = self._motion(self._nodes.of_local(self._problem.state))
        return 0.0, self._stopped + float(self._forces @ moved)

    def memory(self):
        return {"forces": np.array(self._forces), "axis": np.array(self._axis)}

    def recall(self, memory):
        self._forces, self._axis = memory["forces"].copy(), memory["axis"].copy()
