"""Follows an equilibrium path: load control while it goes on, arc length where it does not, and onto a branch if asked."""

from cosserat_fenicsx.statics.arclength import ArcLength
from cosserat_fenicsx.statics.chord import Chord
from cosserat_fenicsx.statics.continuation import Continuation
from cosserat_fenicsx.statics.locator import Locator
from cosserat_fenicsx.statics.track import AIM, Track

#: How the path is followed.
CONTROLS = ("auto", "load", "arc")
# Load control gives way to arc length after this many refused steps.
_PATIENCE = 4
# Halvings of the first step onto a branch.
_TRIES = 8


class Follower:
    """Goes from one requested load factor to the next.

    Args:
        problem: a loaded `Problem`.
        newton, stability: the problem's solvers, made once for its shape.
        steps: a `StepControl`.
        control: "auto", "load" or "arc".
        branch: 1 or -1 to leave the path at the first bifurcation; 0 to stay on it.
        on_event: called with every `Crossing`.
        from_rest: see `Track`.

    Attributes:
        track: the `Track`.
        locator: its `Locator`.
        fork: the `Crossing` where the path is left, once it was met; left: whether it was.
        used: "arc" once arc length was used, else "load".
    """

    def __init__(self, problem, newton, stability, steps, *, control="auto", branch=0, on_event=None, from_rest=True):
        most = steps.max_iterations or (10 if problem.model.carries_force else 30)
        self.track = Track(problem, newton, stability, most, from_rest=from_rest)
        self._steps, self._control, self._branch, self._on_event = steps, control, branch, on_event
        self._sign = branch
        self.locator = Locator(self.track)
        self._load = Continuation(self.track, steps, self._watch)
        self._arc = ArcLength(self.track, steps, self.locator)
        self._auto = control == "auto" and steps.adaptive
        self.fork, self.left, self.used = None, False, "load"

    def to(self, target, way, *, on_step=None):
        """Go on to the load factor `target`, landing on it exactly.

        Args:
            target: load factor.
            way: size of the whole path, which steps of the load factor are measured against.
            on_step: called with every accepted `Point`.

        Returns:
            bool: False where the path could not be continued; `track.failure` says why, and the state is that of
            `track.here`.
        """
        track, here = self.track, self.track.here
        done = self._advance(target, way, on_step)
        if self.fork and not self.left:
            self.left, self._branch, self.used = True, 0, "arc"
            first = self._onto(self.fork)
            if first is not None:
                slope = track.slope_found()
                done = self._arc.to(target, first=first, slope=slope, on_step=on_step, on_event=self._meet)
        if not done and self._auto and track.here is here:  # arc length was of no help: load control has the last word
            return self._load.to(target, way, on_step=on_step)
        if done and self.used == "arc" and len(track.history) > 1:
            before, here = track.history[-2:]
            self._load.step = abs(here.load_factor - before.load_factor) or None
        return done

    def to_fork(self, target, way):
        """Go on towards a load factor to the first bifurcation, and stay there; whether there was one."""
        self._advance(target, way, None)
        return self.fork is not None

    def _advance(self, target, way, on_step):
        """To the load factor, or to where the path is to be left: then False."""
        if self._control != "arc":
            done = self._load.to(target, way, on_step=on_step, patience=_PATIENCE if self._auto else None)
            if done or not self._auto or (self.fork and not self.left):
                return done
        self.used = "arc"
        return self._arc.to(target, on_step=on_step, on_event=self._meet)

    def _meet(self, crossing):
        """Report a crossing; True where the path is to be left there."""
        if self._on_event:
            self._on_event(crossing)
        if self._branch and crossing.kind == "bifurcation":
            self.fork = crossing
        return self.fork is not None and not self.left

    def _watch(self, a, b):
        """Negative modes changed on a step of load control: report what was crossed; False to leave the path there."""
        if not (self._on_event or self._branch):
            return True
        crossings = self.locator.bifurcations(Chord.balanced(self.track, a, b))
        self.track.put(b.numbers, b.load_factor)
        return not any(self._meet(crossing) for crossing in crossings)

    def _onto(self, fork):
        """The first `Point` on the branch at a bifurcation, found in the plane across the mode; None where there is none."""
        track = self.track
        base = fork.point
        track.history = [base]
        size = AIM / track.model.largest(fork.direction)
        for _ in range(_TRIES):
            guess = [values.copy() for values in base.numbers]
            guess[0] += self._sign * size * fork.direction
            solved = track.on_plane(guess, base.load_factor, fork.direction, 0.0)
            if solved.converged:
                numbers = track.problem.numbers()
                if track.distance(numbers, guess) < 0.5 * track.distance(guess, base.numbers):
                    point = track.point(solved)
                    if fork.partner is not None and track.stability.whole.is_neutral():
                        track.neutral = fork.partner
                        point.negative_modes = track.stability.count(neutral=True)
                    return point
            size /= 2
        track.failure = "no branch was found at the bifurcation"
        track.restore()
        return None
