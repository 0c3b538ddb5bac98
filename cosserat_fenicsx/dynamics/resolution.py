"""Step length that resolves loads and prescribed motions.

The error estimate of the motion does not detect aliasing: a load whose period is close to the step, sampled once a
step, looks like a slower load, or like a constant one that accelerates a free body. So each function of time is sampled
within every step before the step is made, at points without a common spacing, so that no frequency aliases at all of
them.

Two conditions limit the step:
- Within the step the function differs from the straight line between its ends by a small share of its range at most. A
  sine then gets at least ten steps a period.
- The impulse of a load by the rule of the scheme (its value at mid-step, or at the ends) must be accurate. For a smooth
  load f the accumulated error is h^2/24 (mid-step) or h^2/12 (ends) times the change of f', by the Euler-Maclaurin
  formula. This error of the velocity causes an error of the displacement that grows until the end of the motion or, if
  the rods are clamped, for half a period of the slowest mode.
"""

import math

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.signals import signals_of

# Sample points in a step, as shares of it: just inside its ends, where functions may jump, and between, no two
# distances in a simple ratio.
_SAMPLE_POINTS = np.array([1e-6, 0.137, 0.311, 0.5, 0.647, 0.871, 1 - 1e-6])
# Largest deviation from the straight line over the range of the function; a sine with ten steps a period has 0.024.
_LARGEST_DEVIATION = 0.02
# Samples that estimate the range of a function beforehand: over the whole motion, and at least between two jumps.
_RANGE_SAMPLES, _FEWEST_RANGE_SAMPLES = 512, 16
# A load is ignored where acting in resonance all the time would move its rod by less than this share of the allowed
# error.
_NEGLIGIBLE = 0.1
# Share of the tolerance for the errors of impulses.
_SHARE = 0.5
# The step requirement found in a step decays by the first factor per later step, since the impulse errors of equal
# steps cancel best. It is halved per step instead where the requirement has dropped below the second share of it, as
# after a jump that the user did not name.
_DECAY, _SUDDEN_DROP = 0.99, 1e-3
# Number of fixed steps that are tested, and the share of dt below which the longest resolving step causes a warning.
_TESTED_STEPS, _WARNING_SHARE = 200, 0.85
# Multiples of the golden ratio modulo 1 are evenly distributed in [0, 1] without a common spacing.
_GOLDEN = (math.sqrt(5) - 1) / 2


class Resolution:
    """The longest steps that resolve the functions of time of a scene.

    Args:
        scene: a `Scene`; duration: s; tol: see `simulate`.
        load_factor: of all loads; impulse_error: see `Stepper.impulse_error`.
    """

    def __init__(self, scene, duration, tol, load_factor, impulse_error):
        size = max(rod.length for rod in scene.rods)
        allowed = _SHARE * tol * size / max(24 * impulse_error * abs(load_factor), 1e-300)
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
        """The state that later steps depend on, see `Stepper.memory`."""
        return {"pieces": np.array([(*x.piece, x.range, x.required) for x in self._sampled]).reshape(-1, 4)}

    def recall(self, memory):
        """Restore what `memory` returned."""
        for sampled, (begin, end, *state) in zip(self._sampled, memory["pieces"].tolist(), strict=True):
            if end > begin:
                sampled.enter(begin, end)
                sampled.range, sampled.required = state


def unresolved_by_fixed_steps(scene, duration, dt):
    """A warning about a function of time that fixed steps do not resolve, or None.

    Args: as of `Resolution`; dt: s.
    """
    for item, field, signal in _nonlinear(scene):
        sampled = _SampledSignal(signal, None, duration, duration, 1.0)
        steps = max(1, math.ceil(duration / dt - 1e-9))
        for t in sorted({dt * int(steps * x) for x in np.arange(_TESTED_STEPS) * _GOLDEN % 1}):
            h = min([dt, *(x - t for x in signal.jumps if x > t + 1e-6 * dt)])
            if sampled.longest(t, h) < _WARNING_SHARE * h:
                return (
                    f"{type(item).__name__}.{field} changes faster than steps of {dt:g} s can follow, such as at "
                    f"t = {t:.4g} s: fewer than about ten steps a period, or a rise within a step. The answer may be "
                    "wrong without any other sign of it. Try a smaller dt, or tol"
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
    """A function of time and the step length that it requires.

    Args:
        signal: a `Signal`.
        acceleration: the largest that it gives its rod, m/s^2 per unit of the load; None for a prescribed motion.
        persistence: how long a velocity that it gives persists, s; duration: s.
        allowed: displacement that errors of its impulse may cause, m.

    Attributes:
        piece: begin and end (s) of the current interval between two jumps.
        range: largest minus smallest value there, of the component where that is largest.
        required: 1/h^2 of the longest step h that resolves it, 1/s^2.
    """

    def __init__(self, signal, acceleration, persistence, duration, allowed):
        self._signal, self._duration, self._shortest = signal, duration, 1e-7 * duration
        self._marks = [0.0, *(t for t in signal.jumps if 0 < t < duration)]
        self._drift = 0.0 if acceleration is None else acceleration * persistence / allowed
        self._resonance = math.inf if acceleration is None else self._drift * duration / 2
        self.piece, self.range, self.required = (0.0, 0.0), 0.0, 0.0

    def enter(self, begin, end):
        """Estimate its range and mean slope in the interval between two jumps (s)."""
        count = max(_FEWEST_RANGE_SAMPLES, _RANGE_SAMPLES // len(self._marks))
        shares = np.concatenate([[1e-6, 1 - 1e-6], (np.arange(count) * _GOLDEN) % 1])
        values = self._at(begin + (end - begin) * shares)
        self.piece, self.range, self.required = (begin, end), float(np.ptp(values, axis=0).max()), 0.0
        self._slope = (values[1] - values[0]) / (end - begin)

    def longest(self, t, h):
        """See `Resolution`."""
        begin, end = self.piece
        if not begin <= t + 1e-6 * h < end:
            before = max((x for x in self._marks if x <= t + 1e-6 * h), default=0.0)
            after = min(
                (x for x in self._marks if x > t + 1e-6 * h),
                default=self._duration * math.ceil((t + h) / self._duration),
            )
            self.enter(before, after)
        before, now = self.required, self._required_in(t, h)
        self.required = max(now, before * (_DECAY if now > _SUDDEN_DROP * before else 0.5))
        while self.required * h**2 > 1 and h > self._shortest:
            h = max(h / 4, 0.95 / math.sqrt(self.required), self._shortest)
            self.required = max(self.required, self._required_in(t, h))
        return h

    def _required_in(self, t, h):
        """1/h_max^2, 1/s^2: h_max is the longest step that meets both conditions for the function as it is in (t, t +
        h)."""
        values = self._at(t + h * _SAMPLE_POINTS)
        self.range = max(self.range, float(np.ptp(values, axis=0).max()))
        if self._resonance * self.range <= _NEGLIGIBLE:
            return 0.0
        deviation = np.abs(values - values[0] - np.outer(_SAMPLE_POINTS, values[-1] - values[0])).max()
        if deviation <= 1e-5 * self.range:
            return 0.0
        slopes = np.diff(values, axis=0) / np.diff(_SAMPLE_POINTS * h)[:, None]
        impulse_error = h**2 / 24 * np.linalg.norm(slopes - self._slope, axis=1).max()
        return max(deviation / (_LARGEST_DEVIATION * self.range), self._drift * impulse_error) / h**2

    def _at(self, times):
        values = []
        for t in times:
            try:
                values.append(self._signal(t))
            except SceneError:  # raised again by the step that reaches this time
                values.append(values[-1] if values else (0.0, 0.0, 0.0))
        return np.array(values)


def _largest_acceleration(scene, item, field):
    """The largest acceleration that a load gives the end of a rod that it acts on, taken as free and rigid, m/s^2 per
    unit of the load; None for a prescribed motion."""
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
    """How long a velocity that a load gives persists, s: the duration; where clamps hold all rods, about half the
    period of the slowest mode."""
    clamped = {scene.leader(support.station.rod) for support in scene.supports if support.clamps}
    if not clamped.issuperset(map(scene.leader, scene.rods)) or not all(joint.rigid for joint in scene.joints):
        return duration
    size, soft = sum(rod.length for rod in scene.rods), []
    for rod in scene.rods:
        least, most = rod.profile.range
        soft.append(size**2 * math.sqrt(float(most.mass) / float(np.min(least.J))))
    return min(duration, *soft)
