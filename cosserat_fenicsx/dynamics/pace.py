"""Step size control: fixed steps, and adaptive ones."""

import math

from cosserat_fenicsx.dynamics.resolution import Resolution, unresolved_by_fixed_steps


class Fixed:
    """Steps of one length, shortened so that a whole number of them ends at every `Mark`.

    Args:
        dt: s.

    Attributes:
        stuck: whether thousands of steps in a row were tiny, so that the motion makes no progress.
    """

    def __init__(self, dt):
        self._dt = dt

    stuck = False

    def length(self, t, left):
        """The length of the next step (s) from the time t (s), `left` (s) before the next `Mark`."""
        return _even(left, self._dt)

    def accepts(self, stepper, h):
        """Whether the last step of a stepper, of length h (s), is accepted."""
        return True

    def failed(self, h):
        """Newton's method failed in a step of length h (s).

        Returns:
            True where the step is to be repeated with the shorter `length`; False where it is to be halved, without an
            error test of the halves.
        """
        return False

    def watch(self, scene, duration, load_factor, impulse_error):
        """Take the loads and the prescribed motions of a scene into account.

        Args: as of `Resolution`.

        Returns:
            warnings, a list of sentences.
        """
        warning = unresolved_by_fixed_steps(scene, duration, self._dt)
        return [warning] if warning else []

    def jump(self):
        """A load jumps at the current time, or a prescribed motion has a kink."""

    def memory(self):
        """The state of the control that later steps depend on, see `Stepper.memory`."""
        return {}

    def recall(self, memory):
        """Restore what `memory` returned."""


class Adaptive:
    """Steps whose local errors add up to `tol` over the duration, and that resolve loads and prescribed motions.

    The length changes only where that saves time: every change costs a new tangent and its factorisation.

    Args:
        tol: see `simulate`; duration: s.
    """

    #: factor on the step after a jump; the first step of a motion over the duration
    _AFTER_JUMP, _INITIAL = 1 / 8, 1e-4
    #: share of the allowed local error that steps aim at; the error per unit of time is proportional to h^2
    _SAFETY = 0.5
    #: the length is kept where the best one lies between these factors of it; one change is limited to the other two
    _KEEP_BELOW, _KEEP_ABOVE, _LARGEST_GROWTH, _LARGEST_CUT = 1.2, 0.9, 4.0, 0.25

    #: `Stepper.error` is a difference over many steps, and hardly shows what starts suddenly: a step whose end differs
    #: from the predictor by more than the first number times tol is rejected, unless it is shorter than the second
    #: number times the duration
    _PREDICTION, _ALWAYS_ACCEPTED = 0.06, 1e-7

    #: steps shorter than this share of the duration are tiny; more than so many of them in a row are too many
    _TINY, _MANY = 1e-6, 5000
    #: number of steps that the length does not grow for after a load has required a shorter one
    _HOLD = 24

    def __init__(self, tol, duration):
        self._duration, self._rate, self._dt, self._longest = (
            duration,
            tol / duration,
            duration * self._INITIAL,
            duration / 100,
        )
        self._largest_prediction_error, self._always_accepted = self._PREDICTION * tol, self._ALWAYS_ACCEPTED * duration
        self._tol, self._hold, self._tiny = tol, 0, 0

    def watch(self, scene, duration, load_factor, impulse_error):
        """See `Fixed`: steps will resolve them."""
        self._resolution = Resolution(scene, duration, self._tol, load_factor, impulse_error)
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
            self._dt, self._hold = resolved, self._HOLD
            h = _even(left, resolved)
        return h

    def accepts(self, stepper, h):
        """See `Fixed`."""
        accepted = self._accepts(stepper, h)
        if h < self._TINY * self._duration:
            self._tiny += 1
        elif accepted:
            self._tiny = 0
        self._hold -= accepted and self._hold > 0
        return accepted

    def _accepts(self, stepper, h):
        if h > self._always_accepted and stepper.prediction_error() > self._largest_prediction_error:
            self._dt = self._LARGEST_CUT * h
            return False
        error, allowed = stepper.error(), self._rate * h
        if error is None:  # the rough estimate from few steps after a jump may only lengthen steps
            error = stepper.error(early=True)
            if error is None or self._KEEP_BELOW**2 * error > self._SAFETY * allowed:
                return True
        factor = math.sqrt(self._SAFETY * allowed / max(error, 1e-300))
        factor = min(self._LARGEST_GROWTH, max(self._LARGEST_CUT, factor))
        if factor < self._KEEP_ABOVE:
            self._dt = min(self._dt, factor * h)
        elif factor > self._KEEP_BELOW and not self._hold and h > self._dt / self._KEEP_BELOW:
            self._dt = min(factor * h, self._longest)
        return error <= 2 * allowed

    def failed(self, h):
        """See `Fixed`."""
        self._dt = h / 2
        return h > self._always_accepted

    def jump(self):
        """See `Fixed`."""
        self._dt *= self._AFTER_JUMP

    def memory(self):
        """See `Fixed`."""
        return {"dt": self._dt, "stay": self._hold, "tiny": self._tiny, "seen": self._resolution.memory()}

    def recall(self, memory):
        """See `Fixed`."""
        self._dt, self._hold, self._tiny = memory["dt"], memory["stay"], memory["tiny"]
        self._resolution.recall(memory["seen"])


def _even(left, dt):
    """The largest step, at most dt but for rounding, that a whole number of covers `left`; s."""
    return left / max(1, math.ceil(left / dt - 1e-9))
