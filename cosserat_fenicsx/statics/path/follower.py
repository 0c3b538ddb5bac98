"""Continuation of an equilibrium path: load control where it works, else arc length; on request onto a branch."""

from dataclasses import replace
from functools import cached_property

from cosserat_fenicsx.errors import NotConverged
from cosserat_fenicsx.statics.path.arclength import ArcLength
from cosserat_fenicsx.statics.path.chord import Chord
from cosserat_fenicsx.statics.path.events import UNEXPLAINED, Locator, Lost
from cosserat_fenicsx.statics.path.load_control import Continuation, StepControl, Sweep
from cosserat_fenicsx.statics.path.track import LIMITS, NEAR, Track

#: Control parameters of the continuation, see `solve`.
CONTROLS = ("auto", "load", "arc")
_PATIENCE = 4  # rejected steps of load control after which arc length takes over
_TRIES = 8  # largest number of halvings of the first step onto a branch


def standing(problem, newton, stability, load_factor):
    """The `Track` of a loaded problem at a load factor, reached by load control, or NotConverged."""
    follower = Follower(problem, newton, stability, StepControl(), control="load")
    follower.begin([load_factor])
    if load_factor and not follower.to(load_factor):
        raise NotConverged(f"no equilibrium was found at the load factor {load_factor:g}: {follower.track.failure}")
    return follower.track


class Follower:
    """Advances along the path from one requested load factor to the next; control: "auto", "load" or "arc"; branch: 1
    or -1 to leave the path at the first bifurcation, 0 to stay; on_event: called with every `Crossing`.

    fork: the `Crossing` at which the path is left for a branch, once it is located; left: whether it was left; used:
    "arc" once arc length was used, else "load".
    """

    def __init__(self, problem, newton, stability, steps, *, control="auto", branch=0, on_event=None):
        most = steps.max_iterations or (10 if problem.model.carries_force else 30)
        self.track = Track(problem, newton, stability, most)
        self._steps, self._control, self._on_event = steps, control, on_event
        self._branch = self._sign = branch
        self._load = Continuation(self.track, steps, self._watch)
        self._auto = control == "auto" and steps.adaptive
        self.fork, self.left, self.used = None, False, "load"

    @cached_property
    def locator(self):
        return Locator(self.track)

    @cached_property
    def _arc(self):
        return ArcLength(self.track, self._steps, self.locator, self._meet)

    @property
    def smallest(self):
        """The smallest step of the load factor that was allowed."""
        return self._load.c.smallest

    def begin(self, load_factors, start=None):
        """Begin the path over these load factors: apply the permanent loads in steps, and solve at load factor 0, from
        the reference or from a state there (`start`, arguments of `Problem.begin_at`). Raises NotConverged."""
        problem, track = self.track.problem, self.track
        self._load.reach = float(max(map(abs, load_factors))) or 1.0
        if start is not None:
            return self._begin_at(start)
        track.begin_here()
        if problem.begins:
            steps = replace(self._steps, first=None, largest=None, adaptive=True)
            if not Continuation(track, steps).to(1.0):
                softer = ", softer walls or obstacles" * any(x.at_nodes for x in problem.model.scene.actions)
                raise NotConverged(
                    f"no equilibrium under the permanent loads was found beyond {track.here.load_factor:.3g} of them: "
                    f"{track.failure}. Are the units those of SI (N, m, Pa), and do supports hold every rod? Otherwise "
                    f"try more elements{softer}, or loads that are not permanent"
                )
            problem.end_beginning()
            track.begin_here()
        if any(kind.scaled == "full" for kind in problem.model.signature.terms):
            if not track.at_load(track.here.numbers, 0.0).converged:
                raise NotConverged(f"no equilibrium was found at the load factor 0: {track.failure}")
            track.begin_here()

    def _begin_at(self, start):
        """Begin at a state under all permanent loads, at the load factor 0."""
        problem, track = self.track.problem, self.track
        if problem.begins:
            problem.end_beginning()
        problem.begin_at(*start)
        numbers = problem.numbers()
        solved = track.at_load(numbers, 0.0)
        if not solved.converged or track.distance(problem.numbers(), numbers) > NEAR:
            reason = "the nearest equilibrium is another one" if solved.converged else track.failure
            raise NotConverged(
                f"no equilibrium was found next to the last one of the stage before: {reason}. Where that one may turn "
                "or move freely, as a buckled round column may about its axis, a support or a small load decides"
            )
        track.begin_here()

    def to(self, load_factor, *, on_step=None, once=False):
        """Advance to a load factor, which is reached exactly; on_step: called with every accepted `PathPoint`; once:
        return after the first accepted step of load control. False where the path could not be continued:
        `track.failure` gives the reason, and the state is that of `track.here`."""
        track, here = self.track, self.track.here
        done = self._advance(load_factor, on_step, once)
        if self.fork and not self.left:
            self.left, self._branch, self.used = True, 0, "arc"
            first = self._onto(self.fork)
            if first is not None:
                done = self._arc.to(load_factor, first=first, on_step=on_step)
        if not done and self._auto and track.here is here:  # arc length made no step: load control down to its smallest
            return self._load.to(load_factor, on_step=on_step)
        if done and self.used == "arc" and len(track.history) > 1:
            before, here = track.history[-2:]
            self._load.c.step = abs(here.load_factor - before.load_factor)
        return done

    @property
    def in_c(self):
        """Whether points may be found in C (`Sweep`): by one process, without Python code between them."""
        model = self.track.model
        return model.comm.size == 1 and not (model.actions.memory or model.signature.lives_along_rods)

    @property
    def sweeps(self):
        """Whether the next steps may be taken in C: load control alone."""
        track = self.track
        unsure = track.here.negative_modes and track.without_potential
        return (
            self.in_c and self._steps.adaptive and self._control != "arc" and track.neutral is None
            and not (unsure or track.watches_steps or track.touching)
        )  # fmt: skip

    def sweep(self, load_factors, *, every, counted):
        """`Sweep.along` from the last point, after `begin`."""
        self._load.begin()
        return self.points.along(self.track, load_factors, self._load, _PATIENCE, every=every, counted=counted)

    @property
    def points(self):
        """The `Sweep` of the problem, which keeps it."""
        problem = self.track.problem
        if problem.sweep is None:
            problem.sweep = Sweep(self.track, problem.fields)
        return problem.sweep

    def to_fork(self, load_factor):
        """Advance towards a load factor up to the first bifurcation; whether one was found."""
        self._advance(load_factor, None)
        return self.fork is not None

    def _advance(self, load_factor, on_step, once=False):
        """Advance to the load factor; False where the path fails or is to be left for a branch before."""
        if self._control != "arc":
            patience = _PATIENCE if self._auto else None
            done = self._load.to(load_factor, on_step=on_step, patience=patience, once=once)
            if done or not self._auto or (self.fork and not self.left):
                return done
        self.used = "arc"
        return self._arc.to(load_factor, on_step=on_step)

    def _meet(self, crossing):
        """Report a `Crossing`; True where the path is to be left there."""
        if self._on_event:
            self._on_event(crossing)
        if self._branch and crossing.kind == "bifurcation":
            self.fork = crossing
        return self.fork is not None and not self.left

    def _watch(self, a, b, plain):
        """Report bifurcations in a step of load control; False to leave the path there, None where it is too long."""
        looks = a.negative_modes != b.negative_modes or (b.negative_modes > 0 and self.track.without_potential)
        if not (looks and (self._on_event or self._branch)):
            return True
        try:
            crossings = self.locator.bifurcations(Chord.balanced(self.track, a, b))
        except Lost as lost:
            self.track.failure = lost.reason
            return None
        if self._auto and not plain and not self.locator.counts_agree(a, b, crossings):
            self.track.failure = UNEXPLAINED  # arc length finds out whether the path has turned
            return None
        self.track.put(b.numbers, b.load_factor)
        return not any(self._meet(crossing) for crossing in crossings)

    def _onto(self, fork):
        """The first `PathPoint` on the branch at a bifurcation, displaced along the mode and corrected in the plane
        perpendicular to it; None where none is found."""
        track = self.track
        base = fork.point
        track.history = [base]
        size = LIMITS.intended / track.model.largest(fork.direction)
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
