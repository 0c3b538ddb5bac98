"""Waves in the uniform parts of a string above a rod, by d'Alembert's solution: forces of the past, delayed.

In every part, with the torque M and the speed om of its sections, M + Z om travels down and M - Z om up without change
(axially: the thrust and the velocity downwards). So what arrives at the lower end of the parts is known from what left
their upper ends one travel time before, and the force there is M = arriving - Z om: a dashpot and a known force.

Parts meet at nodes, where M may drop by a drag; at the uppermost node a `TopEnd` turns waves round. What leaves the
nodes is stored as its mean over every time step, at the middle of the step, and read by Lagrange's interpolation with
four of them, which amplifies no wave where steps are even (Laakso et al., IEEE Signal Process. Mag. 13 (1996) 30).
"""

import numpy as np

# Samples of an interpolation; the travel time of a part over the longest step, so that all of them are known.
_SAMPLES, _LEAST = 4, 2.0
_EACH, _DIAGONAL = np.arange(_SAMPLES), np.eye(_SAMPLES)[:, :, None]
# Samples kept beyond those that may be read.
_SPARE = 512


class TopEnd:
    """What is fixed to the top: I om' = Kp (Om - om) + Ki phi + M0 - M, phi' = Om - om; or om = Om where stiff.

    Args:
        mean: a function (start, end) of times (s): the mean of the speed Om asked for. The others: the coefficients.
    """

    def __init__(self, mean, *, stiff=False, inertia=0.0, Kp=0.0, Ki=0.0, given=0.0):
        self._mean, self._stiff, self._inertia = mean, stiff, inertia
        self._Kp, self._Ki, self._given = Kp, Ki, given

    def rest(self, speed, force):
        """(om, phi) at the beginning of a motion in which the end has a speed and hands down a force; phi is the one
        that holds the force without a difference of speeds, where there is one."""
        held = (force - self._given) / self._Ki if self._Ki else 0.0
        return speed, held

    def step(self, state, start, end, impedance, wave):
        """A step, by the implicit midpoint rule.

        Args:
            state: (om, phi); start, end: s; impedance: of the string, with its drag; wave: M - Z om that arrives.

        Returns:
            the mean speed, and the new state.
        """
        asked, h, (om, phi) = self._mean(start, end), end - start, state
        if self._stiff:
            return asked, (asked, 0.0)
        inert, turned = 2 * self._inertia / h, self._Ki * h / 2
        push = inert * om + self._Ki * phi + self._given - wave + (self._Kp + turned) * asked
        mean = push / (inert + self._Kp + turned + impedance)
        return mean, (2 * mean - om, phi + h * (asked - mean))


class DelayLines:
    """The waves of one kind, torsional or axial, in parts from the top down.

    Args:
        impedance, time: (n,) of the parts, and their travel times, s. drag: (n + 1,) force over speed at the nodes,
            from the top down. top: a `TopEnd`.
    """

    def __init__(self, impedance, time, drag, top):
        self._Z, self._time, self._drag = (np.array(x, dtype=float) for x in (impedance, time, drag))
        self._top, self._parts = top, len(self._Z)
        self._delays = np.concatenate([self._time, self._time])
        #: longest step, s
        self.longest = self._time.min() / _LEAST
        self.begin(0.0, 0.0)

    @property
    def dashpot(self):
        """The factor of the speed of the lower end in the force there: the impedance of the lowest part, and drag."""
        return self._Z[-1] + self._drag[-1]

    def begin(self, speed, force):
        """Begin at the time 0, after a steady motion: all turn at a speed and hand down a force."""
        down, up = force + self._Z * speed, force - self._Z * speed
        self._first = np.concatenate([down, up])
        self._state = self._top.rest(speed, force)
        self._take(np.empty(0), np.empty((0, 2 * self._parts)))
        self._before = self._state

    def arriving(self, t):
        """What arrives at the lower end at a time (s): the force there is this minus `dashpot` times its speed."""
        return float(self._delayed(t)[self._parts - 1])

    def _delayed(self, t):
        """(2 n,) what arrives at a time (s): from above at the lower ends of parts, then from below at their tops."""
        asked, count = t - self._delays, self._count
        if not count:
            return self._first
        times = self._times[:count]
        first = np.clip(np.searchsorted(times, asked) - _SAMPLES // 2, 0, count - _SAMPLES)
        at = first + _EACH[:, None]
        known = times[at]
        factors = (asked - known) / (known[:, None] - known + _DIAGONAL)
        factors[_EACH, _EACH] = 1.0
        weights = factors.prod(axis=1)
        read = (weights * self._values[at, np.arange(len(asked))]).sum(axis=0)
        return np.where(asked < times[0], self._first, read)

    def advance(self, t, h, speed):
        """Accept a step from t to t + h (s) with this mean speed of the lower end."""
        if not self._count:  # before the start nothing changes; the spacing of the first step keeps impulses exact
            for k in range(-_SAMPLES, 0):
                self._append(t + (k + 0.5) * h, self._first)
        arrived = self._delayed(t + h / 2)
        above, below = arrived[: self._parts], arrived[self._parts :]
        Z, speeds = self._Z, np.empty(self._parts + 1)
        self._before = self._state
        speeds[0], self._state = self._top.step(self._state, t, t + h, Z[0] + self._drag[0], below[0])
        speeds[1:-1] = (above[:-1] - below[1:]) / (Z[:-1] + Z[1:] + self._drag[1:-1])
        speeds[-1] = speed
        self._append(t + h / 2, np.concatenate([below + 2 * Z * speeds[:-1], above - 2 * Z * speeds[1:]]))

    def _append(self, t, values):
        if self._count == len(self._times):
            read = np.searchsorted(self._times, self._times[-1] - self._delays.max())
            self._take(*(x[max(int(read) - 2 * _SAMPLES, 0) :] for x in (self._times, self._values)))
        self._times[self._count], self._values[self._count] = t, values
        self._count += 1

    def _take(self, times, values):
        """Take samples, with room for at least as many."""
        self._count = n = len(times)
        self._times, self._values = np.zeros(2 * n + _SPARE), np.zeros((2 * n + _SPARE, 2 * self._parts))
        self._times[:n], self._values[:n] = times, values

    def undo(self):
        """Take back the last step."""
        self._count -= 1
        self._state = self._before

    def memory(self):
        """All that later steps depend on."""
        n = self._count
        return {
            "times": self._times[:n].copy(), "values": self._values[:n].copy(), "first": self._first.copy(),
            "state": np.array(self._state), "before": np.array(self._before),
        }  # fmt: skip

    def recall(self, memory):
        """Restore what `memory` returned."""
        self._take(memory["times"], memory["values"])
        self._first = memory["first"].copy()
        self._state, self._before = (tuple(memory[name].tolist()) for name in ("state", "before"))
