"""Continuation in the load factor: adaptive steps, predictors, and a watch on the branch.

A slender rod has several equilibria under one load, and Newton from the straight state finds the unstable ones
readily (the eccentric column jumps to the far side in one step at eta = 1.1). So a step is accepted only if Newton
converged to somewhere near the prediction and not against its direction, and if no new negative mode appeared; where
one persists down to a thousandth of the way, the path itself has lost its stability, and its points say so.
"""

from dataclasses import dataclass

import numpy as np

from cosserat_fenicsx.checks import number, refuse
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.statics.track import AIM, FAR, NOTHING, Track, growth_of, through

# A step that is off its prediction by less than this may have any direction and any size.
_SLIGHT = 1e-3
# One that is off by more than this times the way that was foreseen may have leapt over a limit point.
_LEAP = 2.0
# Negative modes may change on a step that is off its prediction by less than the first share of its length; once steps
# are a thousandth of the way, by less than the second: a smooth path crosses another there, and was not left.
_SMOOTH, _NEAR = 0.01, 0.3


@dataclass(frozen=True)
class StepControl:
    """How the load factor is stepped between the requested values.

    Args:
        first: first step of the load factor; None for a tenth of the way to the farthest requested value.
        smallest: a step that has to be smaller than this times the way gives up; in (0, 1).
        largest: no step is larger; None for no bound.
        adaptive: False takes each requested value in one step, whatever it converges to; unstable points still say so.
        max_iterations: Newton iterations allowed in a step; None for 10 (mixed) or 30 (the other formulations, whose
            Newton paths are longer).
        most_steps: steps of arc length allowed on the way to one requested load factor, which may lie far along the
            path, or not on it at all.

    Raises:
        SceneError: a value outside its range.
    """

    first: float | None = None
    smallest: float = 1e-6
    largest: float | None = None
    adaptive: bool = True
    max_iterations: int | None = None
    most_steps: int = 1000

    def __post_init__(self):
        for name in ("first", "largest"):
            if getattr(self, name) is not None:
                number(self, name, getattr(self, name), "a positive load factor", lambda x: 0 < x < np.inf)
        number(self, "smallest", self.smallest, "a number in (0, 1)", lambda x: 0 < x < 1)
        if not isinstance(self.adaptive, bool):
            refuse(self, "adaptive", self.adaptive, "True or False")
        for name in ("max_iterations", "most_steps"):
            value = getattr(self, name)
            left_open = name == "max_iterations" and value is None
            if not left_open and (not isinstance(value, int) or isinstance(value, bool) or value < 1):
                refuse(self, name, value, "a whole number above zero")


class Continuation:
    """Steps a track by load control.

    Args:
        track: a `Track`.
        control: a `StepControl`.
        watch: called as watch(a, b) with the two points of a step on which the negative modes changed, before b is
            accepted; False refuses the step for good.

    Attributes:
        step: the next step of the load factor; None where it is still to be chosen.
    """

    def __init__(self, track: Track, control: StepControl, watch=None):
        self.track, self.control, self._watch = track, control, watch
        self.step, self._shrink = None, 0.5

    def to(self, target, way, *, on_step=None, patience=None):
        """Step to the load factor `target`, landing on it exactly.

        Args:
            target: load factor.
            way: size of the whole path, which steps are measured against.
            on_step: called with every accepted `Point`.
            patience: give up after this many refused steps without two between that went well; None to go on to
                the `StepControl`'s smallest step.

        Returns:
            bool: False where patience ended, the steps became too small or the watch refused one; the track's
            `failure` says why, and its state is that of `here`.
        """
        control, track = self.control, self.track
        if not control.adaptive:
            return self._attempt(target, guard=False, on_step=on_step)
        self.step = self.step or control.first or way / 10
        self._refused, refusals, going = False, 0, False
        while track.here.load_factor != target:
            left = target - track.here.load_factor
            step = min(self.step, control.largest or np.inf)
            if abs(left) <= min(1.2 * step, control.largest or np.inf):
                goal = target
            elif abs(left) < 2 * step:
                goal = track.here.load_factor + left / 2
            else:
                goal = track.here.load_factor + np.copysign(step, left)
            taken = abs(goal - track.here.load_factor)
            # A new negative mode is believed once the step that meets it is this small.
            if self._attempt(goal, guard=taken > 1e-3 * way, on_step=on_step):
                refusals, going = 0 if going else refusals, True
            else:
                refusals, going = refusals + 1, False
                self.step = taken * self._shrink
                if self._refused or self.step < control.smallest * way or refusals == patience:
                    self.step = None
                    return False
        return True

    def _attempt(self, eta, *, guard, on_step):
        """One step: predict, correct, judge. Accepts it (True) or restores the last point (False)."""
        obey()
        track, adaptive = self.track, self.control.adaptive
        here = track.here
        predicted = self._predict(eta) if adaptive else here.numbers
        solved = track.at_load(predicted, eta)
        self._shrink = 0.5
        if not solved.converged:
            return track.restore()
        numbers = track.problem.numbers()
        off = track.distance(numbers, predicted)
        if adaptive and off > _SLIGHT and not self._near(numbers, predicted, off, eta):
            return track.restore()
        point = track.point(solved)
        changed = point.negative_modes != here.negative_modes
        if adaptive and changed:
            if not self._smooth(numbers[0], predicted[0], _SMOOTH if guard else _NEAR):
                track.failure = "the step crossed a point where stability changes"
                return track.restore()
            if self._watch and not self._watch(here, point):
                self._refused = True
                return track.restore()
        taken = abs(eta - here.load_factor)
        track.keep(point)
        if adaptive:
            growth = growth_of(off, min(len(track.history) - 1, 3), solved.iterations)
            self.step = max(self.step, taken * growth) if growth >= 1 else taken * growth
        if on_step:
            on_step(point)
        return True

    def _smooth(self, found, predicted, share):
        """Whether a step is off its prediction by less than a share of its length."""
        track = self.track
        move, off = found - track.here.numbers[0], found - predicted
        return track.product(off, off) <= share**2 * track.product(move, move) + NOTHING**2

    def _near(self, found, predicted, off, eta):
        """Whether a step that is off its prediction may still be one along the path."""
        track = self.track
        if off > FAR:
            track.failure = "the equilibrium jumped away from the path"
            self._shrink = min(max((AIM / off) ** (1 / len(track.history)), 0.1), 0.5)
            return False
        here = track.here.numbers
        move, foreseen = found[0] - here[0], predicted[0] - here[0]
        size = track.product(foreseen, foreseen)
        if len(track.history) > 1:
            # The mirrored branch of a nearly perfect pitchfork is stable about a section's stiff axis, so that neither
            # the distance nor the count of negative modes gives it away.
            if track.product(move, foreseen) <= 0 < size:
                track.failure = "the equilibrium lies on the other side of the path's direction"
                return False
            if track.product(move - foreseen, move - foreseen) <= _LEAP**2 * size:
                return True
        if self._leapt(move, eta - track.here.load_factor):
            track.failure = "the equilibrium jumped away from the path's direction"
            return False
        return True

    def _leapt(self, move, change):
        """Whether a step is twice as long as the slopes at its two ends say: it has leapt over a limit point to another
        part of the path."""
        track = self.track
        end, eta = track.problem.numbers(), track.problem.load_factor
        slopes = track.slope()
        track.restore()
        slopes += track.slope()
        track.put(end, eta)
        return track.product(slopes, slopes) * change**2 < track.product(move, move)

    def _predict(self, eta):
        """Numbers at eta by the polynomial through the last points (constant, secant, quadratic)."""
        known = self.track.history
        places = [point.load_factor for point in known]
        if len(set(places)) < len(places):  # the path came back to a load factor: its last point counts
            latest = dict(zip(places, known, strict=True))
            places, known = list(latest), list(latest.values())
        return through(known, places, eta)[0]
