"""The motion of a station in a moving model, on all ranks; and what depends on its earlier motion."""

from collections import namedtuple

import numpy as np

from cosserat_fenicsx.quaternions import directors

#: At a station, inertial: displacement (m) and rotation vector (rad, below a full turn) from the reference, velocity
#: (m/s), angular velocity (rad/s), and the rotation R from the reference (3, 3).
StationMotion = namedtuple("StationMotion", "displacement rotation velocity angular_velocity R")


class StationNode:
    """The node of a station.

    Args:
        model: a spatial moving model, loaded; station: a station of its scene.
    """

    def __init__(self, model, station):
        self._model = model
        slot = model.slot_of(station)
        here = np.flatnonzero(model.slots[: model.owned_nodes] == slot)
        self._dofs = model.dofs_of_nodes[here[0]] if len(here) else None
        self._rest = model.reference[slot]

    def _everywhere(self, *functions):
        """(functions, 7) values at the node."""
        found = np.zeros((len(functions), 7))
        if self._dofs is not None:
            found[:] = [function.x.array[self._dofs] for function in functions]
        comm = self._model.comm
        return comm.allreduce(found) if comm.size > 1 else found

    def now(self):
        """The `StationMotion` of the state."""
        model = self._model
        w, rates = self._everywhere(model.state, model.velocity)
        return self._motion(w, model.rates()(w, rates))

    def of_step(self, h):
        """The `StationMotion` halfway through the step of length h (dimensionless) from `start` to the state: means."""
        model = self._model
        w, before = self._everywhere(model.state, model.start)
        middle = (w + before) / 2
        return self._motion(middle, model.rates()(middle, (w - before) / h))

    def _motion(self, w, rates):
        model = self._model
        length, q = model.scales.length, w[3:] / np.linalg.norm(w[3:])
        v, omega = rates[:3] * length / model.time, rates[3:] / model.time
        size = np.linalg.norm(q[1:])
        turned = 2 * np.arctan2(size, q[0]) / size * q[1:] if size else np.zeros(3)
        return StationMotion((w[:3] - self._rest) * length, turned, v, omega, directors(q[None])[0])


class Delays:
    """The actions of a moving model that depend on the earlier motion of their stations, see `Action.delayed`.

    Args:
        model: a moving model, loaded.

    Attributes:
        longest: the longest step that they allow, s.
    """

    def __init__(self, model):
        self._model, actions = model, [x for x in model.scene.actions if x.delayed is not None]
        self._all = [(action.delayed(), StationNode(model, action.station)) for action in actions]
        self.longest = min((delayed.longest for delayed, _ in self._all), default=np.inf)
        if actions:
            model.actions.follow({id(x): delayed for x, (delayed, _) in zip(actions, self._all, strict=True)})

    def begin(self):
        """Begin at the model's state, at the time 0."""
        for delayed, node in self._all:
            delayed.begin(node.now())

    def accept(self, t, h):
        """Accept the step from t to t + h (s) to the model's state."""
        for delayed, node in self._all:
            delayed.accept(t, h, node.of_step(h / self._model.time))

    def undo(self):
        """Take back the last step."""
        for delayed, _ in self._all:
            delayed.undo()

    def memory(self):
        """See `Stepper.memory`."""
        return {str(i): delayed.memory() for i, (delayed, _) in enumerate(self._all)}

    def recall(self, memory):
        """Restore what `memory` returned."""
        for i, (delayed, _) in enumerate(self._all):
            delayed.recall(memory[str(i)])
