"""Fourth order by three steps of the default scheme, one of them back in time.

A symmetric scheme of order 2 gains two orders by steps gamma h, (1 - 2 gamma) h, gamma h with gamma = 1/(2 - 2^(1/3))
(Yoshida, Phys. Lett. A 150 (1990) 262, doi:10.1016/0375-9601(90)90092-3). Momenta stay exact. Loads are evaluated in
the middle of each of the three, which lies inside the whole step; prescribed motions are also evaluated up to about a
third of a step before its start and after its end.
"""

import numpy as np

from cosserat_fenicsx.algebra.newton import Solved
from cosserat_fenicsx.dynamics.steppers.momentum import Momentum
from cosserat_fenicsx.errors import SceneError

_GAMMA = 1 / (2 - 2 ** (1 / 3))


class TripleJump:
    """See `protocol.Stepper`."""

    order, adapts, rho_inf, kinks_persist = 4, False, None, True
    forms, problem_class, impulse_error = Momentum.forms, Momentum.problem_class, Momentum.impulse_error

    def __init__(self, problem):
        self.problem, self._inner = problem, Momentum(problem)

    work = property(lambda self: self._inner.work)
    dissipated = property(lambda self: self._inner.dissipated)

    def begin(self):
        """See `Stepper`.

        Raises:
            SceneError: a rod with damping, which would make the motion grow without bound back in time; an action with
                memory; or a wall that nodes touch.
        """
        if self.problem.model.damped:
            raise SceneError(
                "scheme = 'triple-jump' steps back in time: expected rods without damping, or another scheme"
            )
        if self.problem.model.actions.memory or np.isfinite(self.problem.model.delays.longest):
            raise SceneError(
                "scheme = 'triple-jump' steps back in time: expected actions without memory, or another scheme"
            )
        if self.problem.touching:
            raise SceneError(
                "scheme = 'triple-jump' steps back in time, and needs smooth motions: expected no walls such as a "
                "HoleWall, or another scheme"
            )
        self._inner.begin()

    def jump(self):
        """See `Stepper`."""
        self._inner.jump()

    def drive(self, t):
        """See `Stepper`."""
        self._inner.drive(t)

    def kink(self):
        """See `Stepper`."""
        self._inner.kink()

    def step(self, t, h):
        """See `Stepper`."""
        inner, iterations = self._inner, 0
        for done, share in enumerate((_GAMMA, 1 - 2 * _GAMMA, _GAMMA)):
            solved = inner.step(t, share * h)
            t, iterations = t + share * h, iterations + solved.iterations
            if not solved.converged:
                for _ in range(done):
                    inner.undo()
                return Solved(False, iterations, solved.reason)
        return Solved(True, iterations, "converged")

    def memory(self):
        """See `Stepper`."""
        return self._inner.memory()

    def recall(self, memory):
        """See `Stepper`."""
        self._inner.recall(memory)
