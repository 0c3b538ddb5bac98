"""How long a step may be for what loads and prescribed motions do within it.

What an estimate of errors sees of a motion tells nothing of a load that swings about as fast as the steps come: asked for
once a step it looks like another, slower one, even like a constant one that carries a free body away. So each function of
time is looked at within a step before it is made, at places that no frequency fits.

Two things are asked of it. Straight between the ends of the step it must be what it is, but for a share of its range: that
is ten steps a period or more. And the impulse that a load gives by its value half way must be the true one: of a smooth load
f the sum of what is missed is h^2/24 times how much f' changes, with its values at the ends h^2/12 (Euler & Maclaurin). As a
speed that nothing takes back it grows to a displacement until the end of the motion, or, of what is clamped, for as long as
the rods take to swing back.
"""

import math

import numpy as np

from cosserat_fenicsx.errors import SceneError
from cosserat_fenicsx.scene.signals import signals_of

# Places in a step, its ends but for jumps that are there; no two distances between them are in a simple ratio.
_PLACES = np.array([1e-6, 0.137, 0.311, 0.5, 0.647, 0.871, 1 - 1e-6])
# Off the straight line by more of its range a function is not resolved: a sine of ten steps a period is by 0.024.
_OFF = 0.02
# A function is known before by so many values; between two jumps by so many at least.
_SCANNED, _LEAST = 512, 16
# What would move its rod by less than this share of what is allowed if it pushed in resonance all the time does not count.
_NOTHING = 0.1
# Share of the tolerance that the impulses missed may amount to.
_SHARE = 0.5
# What a step has seen counts in those after it, by so much less in each: steps of one length miss least. It is forgotten
# soon where so little of it is left: a jump that nobody told of.
_FORGOTTEN, _SUDDEN = 0.99, 1e-3
# Fixed steps are looked at in so many places, and told of where they are longer than resolves by more than this.
_LOOKED, _COARSE = 200, 0.85
_GOLDEN = (math.sqrt(5) - 1) / 2


class Resolution:
    """The functions of time of a scene.

    Args:
        scene: a `Scene`; duration: s; tol: see `simulate`.
        load_factor: of all loads; missed: see `Stepper.missed`.
    """

    def __init__(self, scene, duration, tol, load_factor, missed):
        size = max(rod.length for rod in scene.rods)
        allowed = _SHARE * tol * size / max(24 * missed * abs(load_factor), 1e-300)
        lasts = _memory_of(scene, duration)
        self._watched = [
            _Watched(signal, _sway(scene, item, field), lasts, duration, allowed)
            for item, field, signal in _curved(scene)
        ]

    def longest(self, t, h):
        """The longest step from the time t on that resolves what it passes, s, and is h at most."""
        for watched in self._watched:
            h = watched.longest(t, h)
        return h

    def memory(self):
        """What it has seen, see `Stepper.memory`."""
        return {"pieces": np.array([(*x.piece, x.range, x.bent) for x in self._watched]).reshape(-1, 4)}

    def recall(self, memory):
        """Take back what `memory` gave."""
        for watched, (begin, end, *seen) in zip(self._watched, memory["pieces"].tolist(), strict=True):
            if end > begin:
                watched.enter(begin, end)
                watched.range, watched.bent = seen


def coarse_for(scene, duration, dt):
    """What steps of one length do not resolve, a sentence, or None.

    Args: as of `Resolution`; dt: s.
    """
    for item, field, signal in _curved(scene):
        watched = _Watched(signal, None, duration, duration, 1.0)
        steps = max(1, math.ceil(duration / dt - 1e-9))
        for t in sorted({dt * int(steps * x) for x in np.arange(_LOOKED) * _GOLDEN % 1}):
            h = min([dt, *(x - t for x in signal.jumps if x > t + 1e-6 * dt)])
            if watched.longest(t, h) < _COARSE * h:
                return (
                    f"{type(item).__name__}.{field} changes faster than steps of {dt:g} s can follow, such as at t = {t:.4g} s: "
                    "fewer than about ten steps a swing, or a rise within a step; another answer may come out without a sign "
                    "of it. Try a smaller dt, or tol"
                )
    return None


def _curved(scene):
    """(load or support, field, `Signal`) of a scene that are not straight between their jumps."""
    return [
        (item, field, signal)
        for item in scene.moving
        for field, signal in signals_of(item).items()
        if not getattr(signal.function, "straight", False)
    ]


class _Watched:
    """A function of time.

    Args:
        signal: a `Signal`.
        sway: m/s^2 that a unit of it moves its rod with at most; None of a prescribed motion.
        lasts: how long a speed lasts that it gives, s; duration: s; allowed: m.
    """

    def __init__(self, signal, sway, lasts, duration, allowed):
        self._signal, self._duration, self._shortest = signal, duration, 1e-7 * duration
        self._marks = [0.0, *(t for t in signal.jumps if 0 < t < duration)]
        self._drift = 0.0 if sway is None else sway * lasts / allowed
        self._resonance = math.inf if sway is None else self._drift * duration / 2
        self.piece, self.range, self.bent = (0.0, 0.0), 0.0, 0.0

    def enter(self, begin, end):
        """Take a look at what it does between two jumps."""
        count = max(_LEAST, _SCANNED // len(self._marks))
        places = np.concatenate([[1e-6, 1 - 1e-6], (np.arange(count) * _GOLDEN) % 1])
        values = self._at(begin + (end - begin) * places)
        self.piece, self.range, self.bent = (begin, end), float(np.ptp(values, axis=0).max()), 0.0
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
        before, now = self.bent, self._bent(t, h)
        self.bent = max(now, before * (_FORGOTTEN if now > _SUDDEN * before else 0.5))
        while self.bent * h**2 > 1 and h > self._shortest:
            h = max(h / 4, 0.95 / math.sqrt(self.bent), self._shortest)
            self.bent = max(self.bent, self._bent(t, h))
        return h

    def _bent(self, t, h):
        """1/s^2, over the square of the longest step that would do if the function went on as it does in this one."""
        values = self._at(t + h * _PLACES)
        self.range = max(self.range, float(np.ptp(values, axis=0).max()))
        if self._resonance * self.range <= _NOTHING:
            return 0.0
        off = np.abs(values - values[0] - np.outer(_PLACES, values[-1] - values[0])).max()
        if off <= 1e-5 * self.range:
            return 0.0
        slopes = np.diff(values, axis=0) / np.diff(_PLACES * h)[:, None]
        missed = h**2 / 24 * np.linalg.norm(slopes - self._slope, axis=1).max()
        return max(off / (_OFF * self.range), self._drift * missed) / h**2

    def _at(self, times):
        values = []
        for t in times:
            try:
                values.append(self._signal(t))
            except SceneError:  # a step that gets there will say so
                values.append(values[-1] if values else (0.0, 0.0, 0.0))
        return np.array(values)


def _sway(scene, item, field):
    """m/s^2 that a unit of a load gives to the end of its rod, the lightest it may act on, when that is free and stiff."""
    if field not in ("force", "moment"):
        return None
    found = []
    for rod in scene.rods:
        if item.station is not None and item.station.rod is not rod or item.station is None and not item.acts_on(rod):
            continue
        least = rod.profile.range[0]
        mass, length = float(least.mass) * rod.length, rod.length
        turning = mass * length**2 / 12 + float(np.min(least.inertia)) * length
        if field == "moment":
            found.append((1.0 if item.station else length) * length / 2 / turning)
        else:
            found.append(4 / mass if item.station else length / mass)
    return max(found, default=0.0)


def _memory_of(scene, duration):
    """How long a speed lasts that a load gives, s: to the end, or where clamps hold all, while the softest rod swings back."""
    clamped = {scene.leader(support.station.rod) for support in scene.supports if support.clamps}
    if not clamped.issuperset(map(scene.leader, scene.rods)) or not all(joint.rigid for joint in scene.joints):
        return duration
    size, soft = sum(rod.length for rod in scene.rods), []
    for rod in scene.rods:
        least, most = rod.profile.range
        soft.append(size**2 * math.sqrt(float(most.mass) / float(np.min(least.J))))
    return min(duration, *soft)
