"""Follows an equilibrium path: load control while it goes on, arc length where it does not, and onto a branch if asked."""

from cosserat_fenicsx.arclength import ArcLength
from cosserat_fenicsx.chord import Chord
from cosserat_fenicsx.continuation import Continuation
from cosserat_fenicsx.locator import Locator
from cosserat_fenicsx.track import AIM, Track

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

    Attributes:
        track: the `Track`.
    """

    def __init__(self, problem, newton, stability, steps, *, control="auto", branch=0, on_event=None):
        most = steps.max_iterations or (10 if problem.model.carries_force else 30)
        self.track = Track(problem, newton, stability, most)
        self._steps, self._control, self._branch, self._on_event = steps, control, branch, on_event
        self._sign = branch
        self._locator = Locator(self.track)
        self._load = Continuation(self.track, steps, self._watch)
        self._arc = ArcLength(self.track, steps, self._locator)
        self._fork = None

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
        auto = self._control == "auto" and self._steps.adaptive
        if self._control != "arc":
            done = self._load.to(target, way, on_step=on_step, patience=_PATIENCE if auto else None)
            if done or not (auto or self._fork):
                return done
        track, done = self.track, False
        here = track.here
        if not self._fork:
            done = self._arc.to(target, on_step=on_step, on_event=self._meet)
        if self._fork:
            fork, self._fork, self._branch = self._fork, None, 0  # the first bifurcation alone
            first = self._onto(fork)
            if first is not None:
                slope = track.slope_found()
                done = self._arc.to(target, first=first, slope=slope, on_step=on_step, on_event=self._meet)
        if done and len(track.history) > 1:
            before, here = track.history[-2:]
            self._load.step = abs(here.load_factor - before.load_factor) or None
        elif not done and auto and track.here is here:  # arc length was of no help: load control has the last word
            return self._load.to(target, way, on_step=on_step)
        return done

    def _meet(self, crossing):
        """Report a crossing; True where the path is to be left there."""
        if self._on_event:
            self._on_event(crossing)
        if self._branch and crossing.kind == "bifurcation":
            self._fork = crossing
        return self._fork is not None

    def _watch(self, a, b):
        """Negative modes changed on a step of load control: report what was crossed; False to leave the path there."""
        if not (self._on_event or self._branch):
            return True
        crossings = self._locator.bifurcations(Chord.balanced(self.track, a, b))
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
