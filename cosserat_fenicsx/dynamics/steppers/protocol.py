"""What `dynamics` asks of a scheme."""

from typing import Protocol


class Stepper(Protocol):
    """A scheme at work on a `StepProblem`; made once for a shape, used for every scene of it.

    Attributes:
        order: of the error in the step h.
        forms: the name of the discretisation that its models must have; problem_class: what it solves, a `StepProblem`.
        keeps_kinks: whether a kink of a prescribed motion would make its velocities alternate for good.
        adapts: whether `error` and `undo` are known.
        rho_inf: by how much a step shrinks what vibrates much faster than the steps, where that can be set; else None.
        missed: impulse that steps h miss of a load, over h^2 times how much its rate of change rises meanwhile.
        work, dissipated: dimensionless, since `begin`: what loads and supports have done, and what damping has taken.
    """

    order: int
    keeps_kinks: bool
    adapts: bool
    rho_inf: float | None
    missed: float
    forms: str
    problem_class: type
    work: float
    dissipated: float

    def begin(self):
        """A motion starts where the problem's model is."""

    def jump(self):
        """Something jumps here: what was before does not foretell what comes."""

    def drive(self, t):
        """See `start.drive`, t in s; the kinetic energy that it gives or takes is work of the supports."""

    def bend(self):
        """A load bends here without a jump: rates of change of accelerations do."""

    def step(self, t, h):
        """Go from the time t to t + h, s.

        Returns:
            `Solved`. The problem's x and the model's state and velocity are those of t + h; where it has not
            converged, all is as it was at t.
        """

    def error(self, early=False):
        """Estimated local error of the last step, of positions (lengths) and rotations (rad); None where too few steps
        are known since the start or a jump. `early`: also from few steps; what waves do in them then counts too."""

    def surprise(self):
        """How far the last step ended from where the steps before foretold it, as `error` measures it."""

    def undo(self):
        """Take the last step back."""

    def memory(self):
        """All that the steps to come depend on beside the scene and the time: arrays, numbers, and dicts of them.

        With the problem's own (`StepProblem.memory`): a motion that goes on from it has the same digits.
        """

    def recall(self, memory):
        """Take back what `memory` gave, after `begin`, on the same scene."""
