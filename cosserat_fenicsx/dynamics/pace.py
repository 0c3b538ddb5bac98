"""Step size control: fixed steps, and adaptive ones, which resolve loads and prescribed motions.

The error estimate of the motion does not detect aliasing: a load whose period is close to the step, sampled once a
step, looks like a slower or a constant load. So each function of time is sampled within every step before the step is
made, at points without a common spacing, so that no frequency aliases at all of them.

Two conditions limit the step:
- Within the step the function differs from the straight line between its ends by at most a small share of its range. A
  sine then gets at least ten steps a period.
- The impulse of a load by the rule of the scheme (its value at mid-step, or at the ends) must be accurate. For a smooth
  load f the accumulated error is h^2/24 (mid-step) or h^2/12 (ends) times the change of f', by the Euler-Maclaurin
  formula. This error of the velocity causes an error of the displacement that grows until the end of the motion or, if
  the rods are clamped, for half a period of the slowest mode.
"""

import math
from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.signals import signals_of


class Fixed:
    """Steps of one length dt (s), shortened so that a whole number of them ends at every `Mark`; stuck: whether
    thousands of steps in a row were tiny, so that the motion makes no progress."""

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
        """A step of length h (s) failed: True to repeat it with the shorter `length`, False to halve it."""
        return False

    def watch(self, scene, duration, load_factor, impulse_error):
        """Take the loads and prescribed motions of a scene into account, see `Resolution`; warnings, sentences."""
        warning = unresolved_by_fixed_steps(scene, duration, self._dt)
        return [warning] if warning else []

    def jump(self):
        """A load jumps at the current time, or a prescribed motion has a kink."""

    def memory(self):
        """The state of the control that later steps depend on, see `Stepper.memory`."""
        return {}

    def recall(self, memory):
        """Restore what `memory` returned."""


class Doubled(Fixed):
    """Steps twice as long as those of a `History`, on the average between its saved times."""

    def __init__(self, history):
        self._times, counts = history.times, np.diff(history.steps)
        self._steps = 2 * np.diff(self._times) / np.maximum(counts, 1)

    def length(self, t, left):
        k = int(np.searchsorted(self._times, t, side="right")) - 1
        return _even(left, self._steps[min(max(k, 0), len(self._steps) - 1)])

    def watch(self, scene, duration, load_factor, impulse_error):
        return []


class Adaptive(Fixed):
    """Steps whose local errors add up to `tol` over the duration (s), and that resolve loads and prescribed motions.
    The length changes only where that saves time: every change costs a new tangent and its factorisation."""

    _AFTER_JUMP = 1 / 8  #: factor on the step after a jump
    _INITIAL = 1e-4  #: first step of a motion over the duration
    _SAFETY = 0.5  #: share of the allowed local error that steps aim at; the error per unit of time grows as h^2
    #: range of the best length over the current one in which the latter is kept; limits of one change
    _KEEP_BELOW, _KEEP_ABOVE, _LARGEST_GROWTH, _LARGEST_CUT = 1.2, 0.9, 4.0, 0.25
    #: `Stepper.error`, a difference over many steps, misses sudden changes: a step is rejected whose end differs
    #: from the predictor by more than the first number times tol, unless it is shorter than the second times the
    # duration
    _PREDICTION, _ALWAYS_ACCEPTED = 0.06, 1e-7
    _TINY, _MANY = 1e-6, 5000  #: longest tiny step, over the duration; most tiny steps in a row
    _HOLD = 24  #: steps without growth after a load has required a shorter one

    def __init__(self, tol, duration):
        super().__init__(duration * self._INITIAL)
        self._duration, self._rate, self._longest = duration, tol / duration, duration / 100
        self._largest_prediction_error, self._always_accepted = self._PREDICTION * tol, self._ALWAYS_ACCEPTED * duration
        self._tol, self._hold, self._tiny = tol, 0, 0

    def watch(self, scene, duration, load_factor, impulse_error):
        self._resolution = Resolution(scene, duration, self._tol, load_factor, impulse_error)
        return []

    @property
    def stuck(self):
        return self._tiny > self._MANY

    def length(self, t, left):
        h = _even(left, self._dt)
        resolved = self._resolution.longest(t, h)
        if resolved < h:
            self._dt, self._hold = resolved, self._HOLD
            h = _even(left, resolved)
        return h

    def accepts(self, stepper, h):
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
        self._dt = h / 2
        return h > self._always_accepted

    def jump(self):
        self._dt *= self._AFTER_JUMP

    def memory(self):
        return {"dt": self._dt, "stay": self._hold, "tiny": self._tiny, "seen": self._resolution.memory()}

    def recall(self, memory):
        self._dt, self._hold, self._tiny = memory["dt"], memory["stay"], memory["tiny"]
        self._resolution.recall(memory["seen"])


def _even(left, dt):
    """The largest step, at most dt but for rounding, that a whole number of covers `left`; s."""
    return left / max(1, math.ceil(left / dt - 1e-9))


# Sample points in a step, as shares of it: just inside its ends, where functions may jump, and between, no two
# distances in a simple ratio.
_SAMPLE_POINTS = np.array([1e-6, 0.137, 0.311, 0.5, 0.647, 0.871, 1 - 1e-6])


@dataclass(frozen=True)
class Sampling:
    """Settings of the sampling of loads and prescribed motions, and of what steps resolve of them."""

    # Largest deviation of a function of time from a straight line within a step, over its range; a sine with ten steps
    # a period has 0.024.
    deviation: float = 0.02
    range_samples: int = 512  # samples that estimate the range of a function beforehand, over the whole motion
    fewest_range_samples: int = 16  # the same between two jumps
    # A load is ignored where acting in resonance all the time would move its rod by less than this share of the allowed
    # error.
    negligible: float = 0.1
    share: float = 0.5  # of the tolerance, for the errors of impulses
    # Factor on the requirement of a step per later step, since the impulse errors of equal steps cancel best.
    decay: float = 0.99
    # The requirement is halved per step instead where it has dropped below this share, as after a jump that is not
    # declared.
    sudden_drop: float = 1e-3
    tested_steps: int = 200  # fixed steps that are tested
    warning_share: float = 0.85  # share of dt below which the longest resolving step causes a warning


_SAMPLING = Sampling()
# Multiples of the golden ratio modulo 1 are evenly distributed in [0, 1] without a common spacing.
_GOLDEN = (math.sqrt(5) - 1) / 2


class Resolution:
    """The longest steps that resolve the functions of time of a `Scene`; impulse_error: see `Stepper`."""

    def __init__(self, scene, duration, tol, load_factor, impulse_error):
        size = max(rod.length for rod in scene.rods)
        allowed = _SAMPLING.share * tol * size / max(24 * impulse_error * abs(load_factor), 1e-300)
        persistence = _persistence(scene, duration)
        self._sampled = [
            _SampledSignal(signal, _largest_acceleration(scene, item, field), persistence, duration, allowed)
            for item, field, signal in _nonlinear(scene)
        ]

    def longest(self, t, h):
        """The longest step (s) from the time t (s), at most h, that resolves all functions of time."""
        for sampled in self._sampled:
            h = sampled.longest(t, h)
        return h

    def memory(self):
        return {"pieces": np.array([(*x.piece, x.range, x.required) for x in self._sampled]).reshape(-1, 4)}

    def recall(self, memory):
        """Restore what `memory` returned."""
        for sampled, (begin, end, *state) in zip(self._sampled, memory["pieces"].tolist(), strict=True):
            if end > begin:
                sampled.enter(begin, end)
                sampled.range, sampled.required = state


def unresolved_by_fixed_steps(scene, duration, dt):
    """A warning about a function of time that fixed steps (s) do not resolve in the duration (s), or None."""
    for item, field, signal in _nonlinear(scene):
        sampled = _SampledSignal(signal, None, duration, duration, 1.0)
        steps = max(1, math.ceil(duration / dt - 1e-9))
        for t in sorted({dt * int(steps * x) for x in np.arange(_SAMPLING.tested_steps) * _GOLDEN % 1}):
            h = min([dt, *(x - t for x in signal.jumps if x > t + 1e-6 * dt)])
            if sampled.longest(t, h) < _SAMPLING.warning_share * h:
                return (
                    f"{type(item).__name__}.{field} changes faster than steps of {dt:g} s can follow, such as at "
                    f"t = {t:.4g} s: fewer than about ten steps a period, or a rise within a step. The result may be "
                    "wrong without any other warning. Try a smaller dt, or tol"
                )
    return None


def _nonlinear(scene):
    """(load or support, field, `Signal`) of a scene that are not piecewise linear in time."""
    return [
        (item, field, signal)
        for item in scene.moving
        for field, signal in signals_of(item).items()
        if not getattr(signal.function, "straight", False)
    ]


class _SampledSignal:
    """A `Signal` and the step length that it requires.

    acceleration: the largest that it gives its rod, m/s^2 per unit of the load; None for a prescribed motion;
    persistence: see `_persistence`, s; allowed: displacement that errors of its impulse may cause, m; piece: begin and
    end (s) of the current interval between two jumps; range: largest minus smallest value there, of the component where
    that is largest; required: 1/h^2 of the longest step h that resolves it, 1/s^2.
    """

    def __init__(self, signal, acceleration, persistence, duration, allowed):
        self._signal, self._duration, self._shortest = signal, duration, 1e-7 * duration
        self._marks = [0.0, *(t for t in signal.jumps if 0 < t < duration)]
        self._drift = 0.0 if acceleration is None else acceleration * persistence / allowed
        self._resonance = math.inf if acceleration is None else self._drift * duration / 2
        self.piece, self.range, self.required = (0.0, 0.0), 0.0, 0.0

    def enter(self, begin, end):
        """Estimate its range and mean slope in the interval between two jumps (s)."""
        count = max(_SAMPLING.fewest_range_samples, _SAMPLING.range_samples // len(self._marks))
        shares = np.concatenate([[1e-6, 1 - 1e-6], (np.arange(count) * _GOLDEN) % 1])
        values = self._at(begin + (end - begin) * shares)
        self.piece, self.range, self.required = (begin, end), float(np.ptp(values, axis=0).max()), 0.0
        self._slope = (values[1] - values[0]) / (end - begin)

    def longest(self, t, h):
        begin, end = self.piece
        if not begin <= t + 1e-6 * h < end:
            before = max((x for x in self._marks if x <= t + 1e-6 * h), default=0.0)
            after = min(
                (x for x in self._marks if x > t + 1e-6 * h),
                default=self._duration * math.ceil((t + h) / self._duration),
            )
            self.enter(before, after)
        before, now = self.required, self._required_in(t, h)
        self.required = max(now, before * (_SAMPLING.decay if now > _SAMPLING.sudden_drop * before else 0.5))
        while self.required * h**2 > 1 and h > self._shortest:
            h = max(h / 4, 0.95 / math.sqrt(self.required), self._shortest)
            self.required = max(self.required, self._required_in(t, h))
        return h

    def _required_in(self, t, h):
        """1/h_max^2, 1/s^2, with the longest step h_max that meets both conditions for the function in (t, t + h)."""
        values = self._at(t + h * _SAMPLE_POINTS)
        self.range = max(self.range, float(np.ptp(values, axis=0).max()))
        if self._resonance * self.range <= _SAMPLING.negligible:
            return 0.0
        deviation = np.abs(values - values[0] - np.outer(_SAMPLE_POINTS, values[-1] - values[0])).max()
        if deviation <= 1e-5 * self.range:
            return 0.0
        slopes = np.diff(values, axis=0) / np.diff(_SAMPLE_POINTS * h)[:, None]
        impulse_error = h**2 / 24 * np.linalg.norm(slopes - self._slope, axis=1).max()
        return max(deviation / (_SAMPLING.deviation * self.range), self._drift * impulse_error) / h**2

    def _at(self, times):
        values = []
        for t in times:
            try:
                values.append(self._signal(t))
            except SceneError:  # raised again by the step that reaches this time
                values.append(values[-1] if values else self._signal.size * (0.0,))
        return np.array(values)


def _largest_acceleration(scene, item, field):
    """The largest acceleration of the end of a free, rigid rod by a load, m/s^2 per unit; None for supports."""
    if not hasattr(item, "data"):  # a prescribed motion
        return None
    turns = getattr(item, field).unit.startswith("N m")
    found = []
    for rod in scene.rods:
        if item.station is not None and item.station.rod is not rod or item.station is None and not item.acts_on(rod):
            continue
        least = rod.profile.range[0]
        mass, length = float(least.mass) * rod.length, rod.length
        turning = mass * length**2 / 12 + float(np.min(least.inertia)) * length
        if turns:
            found.append((1.0 if item.station else length) * length / 2 / turning)
        else:
            found.append(4 / mass if item.station else length / mass)
    return max(found, default=0.0)


def _persistence(scene, duration):
    """How long a velocity due to a load persists, s: the duration, or half the slowest mode's period where clamped."""
    clamped = {scene.leader(support.station.rod) for support in scene.supports if support.clamps}
    if not clamped.issuperset(map(scene.leader, scene.rods)) or not all(joint.rigid for joint in scene.joints):
        return duration
    size, soft = sum(rod.length for rod in scene.rods), []
    for rod in scene.rods:
        least, most = rod.profile.range
        soft.append(size**2 * math.sqrt(float(most.mass) / float(np.min(least.J))))
    return min(duration, *soft)
