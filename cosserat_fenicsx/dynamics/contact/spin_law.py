"""A torque at a node that resists its rotation by a set-valued law, such as that of a bit on rock, in a time step.

As walls do (`NodalContact`), it acts on the compliance of the moving rods: the rotation of the node about its axis d3
in a step is a linear function of the torque, by the tangent of Newton's method, and with it the law is solved exactly
before Newton's step is taken. The node sticks as long as a torque up to the static one can keep it.
"""

import math

import numpy as np

from cosserat_fenicsx.algebra.building import Pointers
from cosserat_fenicsx.dynamics.contact.nodes import TouchingNodes, motion_between
from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.numerics import directors, small_rotations

# Iterations of Newton's method for the speed, and its relative change that ends them.
_MOST, _SMALL = 60, 1e-14


class SpinLaw(Pointers):
    """The law of one action with `Action.resists`.

    Args:
        problem: a `StepProblem`, loaded; action: the action.
    """

    def __init__(self, problem, action):
        super().__init__()
        self._problem, self._action, model = problem, action, problem.model
        self._nodes = TouchingNodes(problem, np.array([model.slot_of(action.station)]))
        self._nodes.hold(problem.state)
        self._at_rest = action.station.rod.curve.frame(action.station.s)[:, 2]
        self._time, self._moment = model.time, model.scales.force * model.scales.length
        self._load, self._response = problem.numbering.vector(), problem.numbering.vector()
        self._torque, self._axis, self._turned = 0.0, self._at_rest, 0.0
        self._begun, self._unit = 0.0, None

    def begin(self, h):
        """See `NodalContact`."""
        self._before, self._h = self._nodes.of_local(self._problem.state), h
        self._begun, self._unit = self._torque, None

    def give_up(self):
        """See `NodalContact`."""
        self._torque = self._begun

    def _acting(self):
        return np.concatenate([np.zeros(3), self._torque * self._axis])[None]

    def add_forces(self, b):
        """See `NodalContact`."""
        self._nodes.subtract(self._acting(), b)

    def _motion(self, after):
        """Rotation about the axis in the step, and the axis in its middle."""
        middle = (self._before + after)[0, 3:]
        self._axis = directors(middle[None] / np.linalg.norm(middle))[0] @ self._at_rest
        return float(motion_between(self._before, after)[0, 3:] @ self._axis)

    def meet(self, x, change):
        """See `NodalContact`."""
        after = self._nodes.unknowns(x, change)
        turned = self._motion(after)
        if self._unit is None:
            self._find_compliance(after)
        before = self._torque
        self._torque = self._solved(turned - self._compliance * before)
        change -= self._unit * (self._torque - before)

    def _find_compliance(self, after):
        torque, self._torque = self._torque, -1.0
        self._load.set(0.0)
        self._nodes.subtract(self._acting(), self._load.array_w)
        self._torque = torque
        self._problem.solve(self._load, self._response)
        self._unit = self._response.array_r.copy()
        found = self._nodes.of_vector(self._unit)[0, 3:]
        self._compliance = float(small_rotations(after[0, 3:]) @ found @ self._axis)

    def _solved(self, free):
        """The torque by the law, from the rotation in the step without it; dimensionless."""
        hold, _ = self._law(0.0)
        C, h, size = self._compliance, self._h, abs(free)
        if size <= C * hold:
            return -free / C
        torque, slope = self._law(1e-300)
        if -slope * C >= h:
            raise SceneError(
                f"{type(self._action).__name__}: in steps of {h * self._time:.3g} s its torque falls faster with the "
                "speed than the rod can follow, and several speeds are possible: expected a shorter dt, or an inertia "
                "there"
            )
        speed = size / h  # the law is convex: after the first iteration it falls to the root
        for _ in range(_MOST):
            torque, slope = self._law(speed)
            last, speed = speed, max(speed - (speed * h + C * torque - size) / (h + C * slope), 0.0)
            if abs(speed - last) <= _SMALL * last:
                break
        return -math.copysign(self._law(speed)[0], free)

    def _law(self, speed):
        """Torque against a speed from 0 on, and its slope; dimensionless."""
        torque, slope = self._action.resists(speed / self._time)
        return torque / self._moment, slope / (self._moment * self._time)

    def books(self):
        """See `NodalContact`."""
        return 0.0, -self._torque * self._motion(self._nodes.of_local(self._problem.state))

    def memory(self):
        """See `NodalContact`."""
        return {"torque": self._torque, "axis": np.array(self._axis)}

    def recall(self, memory):
        """See `NodalContact`."""
        self._torque, self._axis = float(memory["torque"]), memory["axis"].copy()
