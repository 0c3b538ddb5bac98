"""The speed asked for, as means over steps."""

import numpy as np


class MeanSpeeds:
    """Means of a `ScalarSignal` over the steps from n dt to (n + 1) dt: by Gauss's two points between its jumps, so
    that a jump within a step has the share that it has in the angle."""

    def __init__(self, signal, dt):
        self._signal, self._dt = signal, dt

    def __call__(self, first, steps):
        """(steps,) means over steps from number `first` on."""
        if self._signal.constant:
            return np.full(steps, self._signal(0.0))
        return np.array([self.between(n * self._dt, (n + 1) * self._dt) for n in range(first, first + steps)])

    def between(self, start, end):
        """Mean from one time to another (s)."""
        total, cuts = 0.0, [start, *(t for t in self._signal.jumps if start < t < end), end]
        for a, b in zip(cuts[:-1], cuts[1:], strict=True):
            middle, off = (a + b) / 2, (b - a) / (2 * 3**0.5)
            total += (b - a) * (self._signal(middle - off) + self._signal(middle + off)) / 2
        return total / (end - start)
