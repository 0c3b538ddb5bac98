"""The interface of a time integration scheme."""

from typing import Protocol


class Stepper(Protocol):
    """A scheme with the `StepProblem` that it solves; made once for a signature, used for every scene of it.

    Attributes:
        order: of the global error in the step h.
        forms: the name of the discretisation that its models must have; problem_class: the class of its `StepProblem`.
        kinks_persist: whether velocities alternate from step to step without decay after a kink of a prescribed motion.
        adapts: whether it has `error` and `undo`.
        rho_inf: spectral radius at infinite frequency where that can be set, else None.
        impulse_error: error of a load's impulse over steps h, divided by h^2 times the change of the load's rate.
        work, dissipated: work of loads and supports, and energy dissipated by damping, since `begin`; dimensionless.
    """

    order: int
    kinks_persist: bool
    adapts: bool
    rho_inf: float | None
    impulse_error: float
    forms: str
    problem_class: type
    work: float
    dissipated: float

    def begin(self):
        """Start a motion from the current state of the problem's model."""

    def jump(self):
        """Accelerations or velocities jump at the current time: earlier states can no longer be extrapolated."""

    def drive(self, t):
        """See `start.drive`, t in s; the change of kinetic energy counts as work of the supports."""

    def kink(self):
        """The slope of a load jumps at the current time, not its value: the rate of the acceleration jumps."""

    def step(self, t, h):
        """Step from the time t to t + h, s.

        Returns:
            `Solved`. Where it has converged, the problem's x and the model's state and velocity are those of t + h;
            otherwise they are as they were at t.
        """

    def error(self, early=False):
        """Estimated local error of the last step, of positions (over the unit of length) and rotations (rad over 10).

        None where too few steps have been made since the start or a jump. With `early` few steps suffice; fast waves,
        which they do not average out, then count too.
        """

    def prediction_error(self):
        """Difference between the end of the last step and the predictor, in the norm of `error`."""

    def undo(self):
        """Return to the state before the last step."""

    def memory(self):
        """All data, besides the scene and the time, that later steps depend on: arrays, numbers, and dicts of them.

        It includes the problem's own (`StepProblem.memory`): a motion continued from it has the same digits.
        """

    def recall(self, memory):
        """Restore what `memory` returned, after `begin`, on the same scene."""
