"""How long the steps in time are."""

import math

from cosserat_fenicsx.dynamics.resolution import Resolution, coarse_for


class Fixed:
    """Steps of one length, shorter where they have to land on a time.

    Args:
        dt: s.

    Attributes:
        stuck: whether steps have been too short for so long that there is no end of it.
    """

    def __init__(self, dt):
        self._dt = dt

    stuck = False

    def length(self, t, left):
        """The next step from the time t where so much is left to the next time to land on, s."""
        return _even(left, self._dt)

    def accepts(self, stepper, h):
        """Whether a stepper's last step, of length h, stands."""
        return True

    def failed(self, h):
        """A step of length h failed: whether a shorter one is tried in its place; otherwise it is halved, whatever that gives."""
        return False

    def watch(self, scene, duration, load_factor, missed):
        """Look at the loads and the prescribed motions of a scene.

        Args: as of `Resolution`.

        Returns:
            what to be told of it, sentences.
        """
        told = coarse_for(scene, duration, self._dt)
        return [told] if told else []

    def jump(self):
        """Something jumps here."""

    def memory(self):
        """What the steps to come depend on, see `Stepper.memory`."""
        return {}

    def recall(self, memory):
        """Take back what `memory` gave."""


class Adaptive:
    """Steps whose local errors add up to `tol` over the duration, and that resolve loads and prescribed motions.

    They change where a change pays: each costs a tangent.

    Args:
        tol: see `simulate`; duration: s.
    """

    #: the first step after the start or a jump, over the one that would do, and over the duration
    _FIRST, _SHORTEST = 1 / 8, 1e-4
    #: share of the error that is allowed that steps aim at; the error over the step goes with the square of the step
    _AIM = 0.5
    #: steps stay where the next would be longer by less than the first factor and shorter by less than the second; at once
    #: they grow by no more than the third and shrink by no more than the fourth
    _LONGER, _SHORTER, _GROW, _SHRINK = 1.2, 0.9, 4.0, 0.25

    #: `error` looks far back, and sees little of what sets in all at once: a step that ends farther from where it was foretold
    #: than this share of tol is not believed, unless it is shorter than that share of the duration
    _SURPRISING, _BELIEVED = 0.06, 1e-7

    #: steps shorter than this share of the duration are tiny, and so many of them in a row too many
    _TINY, _MANY = 1e-6, 5000
    #: for so many steps after loads have asked for shorter ones they do not grow
    _STAY = 24

    def __init__(self, tol, duration):
        self._duration, self._rate, self._dt, self._longest = (
            duration,
            tol / duration,
            duration * self._SHORTEST,
            duration / 100,
        )
        self._surprising, self._believed = self._SURPRISING * tol, self._BELIEVED * duration
        self._tol, self._stay, self._tiny = tol, 0, 0

    def watch(self, scene, duration, load_factor, missed):
        """See `Fixed`: steps are to resolve them."""
        self._resolution = Resolution(scene, duration, self._tol, load_factor, missed)
        return []

    @property
    def stuck(self):
        """See `Fixed`."""
        return self._tiny > self._MANY

    def length(self, t, left):
        """See `Fixed`."""
        h = _even(left, self._dt)
        resolved = self._resolution.longest(t, h)
        if resolved < h:
            self._dt, self._stay = resolved, self._STAY
            h = _even(left, resolved)
        return h

    def accepts(self, stepper, h):
        """See `Fixed`."""
        accepted = self._accepts(stepper, h)
        if h < self._TINY * self._duration:
            self._tiny += 1
        elif accepted:
            self._tiny = 0
        self._stay -= accepted and self._stay > 0
        return accepted

    def _accepts(self, stepper, h):
        if h > self._believed and stepper.surprise() > self._surprising:
            self._dt = self._SHRINK * h
            return False
        error, allowed = stepper.error(), self._rate * h
        if error is None:  # soon after a jump steps may only grow
            error = stepper.error(early=True)
            if error is None or self._LONGER**2 * error > self._AIM * allowed:
                return True
        factor = min(self._GROW, max(self._SHRINK, math.sqrt(self._AIM * allowed / max(error, 1e-300))))
        if factor < self._SHORTER:
            self._dt = min(self._dt, factor * h)
        elif factor > self._LONGER and not self._stay and h > self._dt / self._LONGER:
            self._dt = min(factor * h, self._longest)
        return error <= 2 * allowed

    def failed(self, h):
        """See `Fixed`."""
        self._dt = h / 2
        return h > self._believed

    def jump(self):
        """See `Fixed`."""
        self._dt *= self._FIRST

    def memory(self):
        """See `Fixed`."""
        return {"dt": self._dt, "stay": self._stay, "tiny": self._tiny, "seen": self._resolution.memory()}

    def recall(self, memory):
        """See `Fixed`."""
        self._dt, self._stay, self._tiny = memory["dt"], memory["stay"], memory["tiny"]
        self._resolution.recall(memory["seen"])


def _even(left, dt):
    """A step of dt at most that goes evenly into what is left, but for rounding."""
    return left / max(1, math.ceil(left / dt - 1e-9))
