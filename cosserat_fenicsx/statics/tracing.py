"""One path on one mesh, recorded: as it is followed, or found again point by point from a coarser mesh."""

import dataclasses
import itertools

import numpy as np

from cosserat_fenicsx.errors import Interrupted, NotConverged
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.results.accuracy import on_mesh
from cosserat_fenicsx.results.path import Path
from cosserat_fenicsx.results.records import Event, Record
from cosserat_fenicsx.scene.choose import force_in_words
from cosserat_fenicsx.statics.chord import Chord
from cosserat_fenicsx.statics.follow import Follower
from cosserat_fenicsx.statics.track import NOTHING

# Loads in units of EI/L^2 that point to a slip in the units.
_ENORMOUS = 1e5
# A point is corrected from a coarser mesh in so many iterations, and moves and turns by no more than this (lengths, rad).
_CORRECTIONS, _NEAR = 6, 0.1
# A point on a finer mesh may lie this far beside the coarse one, over the way between the coarse one's neighbours.
_ASIDE = 0.3


class _Enough(Exception):
    """The user's `until` was met."""


class Promoted(Exception):
    """A plane answer that goes on in space alone."""

    def __init__(self, reason):
        super().__init__(reason)
        self.reason = reason


class Tracing:
    """Makes a Path.

    Args:
        solvers: the loaded problem, its Newton solver and its stability count.
        formulation: as asked for.
        follow: arguments of `Follower`.
        choice: the `Choice` of the model.
        bar: a `Progress`.
        from_rest: whether the path may be followed from the unloaded state, or is only `corrected`.
    """

    def __init__(self, solvers, formulation, follow, choice, bar, *, from_rest=True):
        self.problem, _, self.stability = solvers
        self.model, self._options, self._choice, self._bar = self.problem.model, follow, choice, bar
        self.path = Path.of(
            self.model, formulation, [*choice.why, force_in_words(self.model.shape.variant, formulation)]
        )
        if choice.model == "spatial":
            self._follower = Follower(*solvers, on_event=self._meet, from_rest=from_rest, **follow)
        else:  # in a plane load control alone, and no events: what asks for more is promoted
            self._follower = Follower(*solvers, from_rest=from_rest, **{**follow, "control": "load"})
        self.track = self._follower.track
        self._counted, self._until = 0, None
        bar.start(f"{self.path.model}, {self.model.unknowns} unknowns")

    def _meet(self, crossing):
        shape = self.model.shape_of(crossing.direction)
        size = np.linalg.norm(shape, axis=1).max()
        event = Event(crossing.kind, crossing.point.load_factor, shape / (size or 1.0), len(self.path) - 1)
        self.path.events.append(event)

    def _watch(self, point):
        self._bar.at(point)
        if self._choice.promoted and point.negative_modes:
            where = f"before the load factor {point.load_factor:.4g}"
            if self.problem.model.scene.follows:
                raise Promoted(f"negative modes appear {where}, and the spatial model follows what comes of it")
            if self.stability.sideways:
                raise Promoted(
                    f"in its plane the scene buckles sideways {where}, where motions out of the plane lose their stability"
                )
            in_plane = " in its plane" if self.model.shape.flat else ""
            raise Promoted(f"it loses its stability{in_plane} {where}, and the spatial model follows what comes of it")

    def _record(self, point):
        track = self.track
        iterations, self._counted = track.iterations - self._counted, track.iterations
        self.path.append(Record(point.load_factor, *self.model.snapshot(), point.negative_modes, iterations,
                                self.problem.multipliers(), track.neutral is not None))  # fmt: skip
        if self._until and self._until(self.path):
            raise _Enough

    def along(self, targets, free, until=None):
        """Follow the path over the load factors.

        Args:
            targets: load factors, landed on in order.
            free: whether every step from the first to the second is recorded.
            until: see `solve`.

        Raises:
            NotConverged, Interrupted: with what was reached.
        """
        track = self.track
        way = max(abs(eta) for eta in targets) or 1.0
        try:
            for k, target in enumerate(targets):
                between = free and k == 1
                self._until = until if between else None
                on_step = (lambda point: (self._watch(point), self._record(point))) if between else self._watch
                at_start = k == 0 and track.here.load_factor == target
                if not (at_start or self._follower.to(target, way, on_step=on_step)):
                    here = track.here.load_factor
                    if self._choice.promoted and self._options["control"] == "auto":
                        raise Promoted(f"load control ends at the load factor {here:.4g}, because {track.failure}")
                    raise NotConverged(
                        f"no equilibrium was found beyond the load factor {here:.6g} on the way to {target:g}: "
                        f"{track.failure}. {self._advice(here, abs(target) * self.problem.load_norm)}",
                        self.path,
                    )
                if not between:
                    self._record(track.here)
        except _Enough:
            pass
        except NotConverged as failure:
            failure.path = self.path if failure.path is None else failure.path
            raise
        except KeyboardInterrupt:
            raise Interrupted(self.path) from None
        finally:
            self.path.control, self.path.left = self._follower.used, self._follower.left
        return self.path

    def _advice(self, here, load):
        if not self._options["steps"].adaptive:
            return "Let the steps adapt, or ask for load factors in between."
        if load > _ENORMOUS:
            return f"The loads are {load:.1e} EI/L^2 there, which no slender rod bears: are the units those of SI (N, m, Pa)?"
        where = "Try"
        if here and self._options["control"] == "load":
            where = "There may be a limit point, which load control cannot pass (control='auto' can); otherwise try"
        other = "a larger tol" if self.path.formulation == "mixed" else "the formulation 'mixed'"
        return f"{where} load factors in between, more elements, or {other}."

    def corrected(self, coarse):
        """The points of a path on a coarser mesh, each by Newton's method from the coarse one; None where one strays.

        Raises:
            Interrupted: with what was reached.
        """
        problem, model, track, path = self.problem, self.model, self.track, self.path
        if not model.takes_motions:
            return None
        track.max_iterations = _CORRECTIONS
        try:
            for point, values, n in self._starts(coarse):
                obey()
                problem.begin_at(values, n, point.reactions)
                start = problem.numbers()
                solved = track.at_load(start, point.load_factor)
                if not solved.converged or track.distance(problem.numbers(), start) > _NEAR:
                    return None
                found = track.point(solved)
                if found.negative_modes != point.negative_modes:
                    return None
                self._record(found)
                self._bar.at(point)
        except KeyboardInterrupt:
            raise Interrupted(path) from None
        return path

    def _starts(self, coarse):
        """The points of a path on a coarser mesh, and what `Problem.begin_at` takes of each."""
        rq, n = on_mesh(coarse, self.path.layout)
        return zip(coarse, self.model.unknowns_of(rq), n, strict=True)

    def again(self, coarse):
        """The points of a path on a coarser mesh: each in the plane through its coarse state, across the path; the two ends
        at their load factors.

        Raises:
            NotConverged: one of them was not found.
        """
        problem, track, last = self.problem, self.track, len(coarse) - 1
        guesses = []
        for point, values, n in self._starts(coarse):
            problem.begin_at(values, n, point.reactions)
            guesses.append((problem.numbers(), point.load_factor))
        weight = min(filter(None, (self._balance(a, b) for a, b in itertools.pairwise(guesses))), default=1.0)
        before, left = None, self._to_fork(coarse) if coarse.left else -1
        try:
            for k in range(last + 1):
                obey()
                (ahead, eta_ahead), (behind, eta_behind) = guesses[min(k + 1, last)], guesses[max(k - 1, 0)]
                normal, change = ahead[0] - behind[0], eta_ahead - eta_behind
                if k == 0 and guesses[0][1] == 0:
                    point = track.origin
                    track.put(point.numbers, 0.0)
                else:
                    still = k in (0, last) or not track.square(normal)
                    point = self._found(*guesses[k], normal, weight * change, coarse[k].neutral, at_load=still)
                track.aim(point, track.slope(), normal, change, weight)
                if before is not None and k > left + 1:  # the step onto a branch shows no sign of the bifurcation
                    for crossing in self._follower.locator.crossings(Chord(track, before, point, weight)):
                        self._meet(crossing)
                track.keep(point)
                track.restore()
                self._record(point)
                self._bar.at(point)
                before = point
        except KeyboardInterrupt:
            raise Interrupted(self.path) from None
        self.path.control, self.path.left = "arc", coarse.left
        return self.path

    def _balance(self, a, b):
        """The weight of the load factor by which it goes as far as the unknowns from one guess to the next; or 0."""
        moved, change = b[0][0] - a[0][0], b[1] - a[1]
        return self.track.square(moved) / change**2 if change else 0.0

    def _to_fork(self, coarse):
        """Find again what was met up to where the path was left; index of the last point before that."""
        known = list(itertools.takewhile(lambda event: event.kind != "bifurcation", coarse.events))
        known.append(coarse.events[len(known)])
        target, way = float(coarse.load_factors[-1]), float(np.abs(coarse.load_factors).max())
        found = self._follower.to_fork(target, way)
        if not found or len(self.path.events) != len(known):
            raise NotConverged("the bifurcation was not found on a finer mesh", self.path)
        events = zip(self.path.events, known, strict=True)
        self.path.events = [dataclasses.replace(event, after=other.after) for event, other in events]
        self.track.history = [self.track.origin]
        return known[-1].after

    def _found(self, guess, eta, normal, weight, neutral, *, at_load):
        """The `Point` next to a guess, at its load factor or in the plane through it."""
        track = self.track
        track.put(guess, eta)
        track.neutral = self._neutral() if neutral else None
        solved = track.at_load(guess, eta) if at_load else track.on_plane(guess, eta, normal, weight)
        off = self.problem.numbers()[0] - guess[0]
        if solved.converged and track.product(off, off) <= _ASIDE**2 * track.product(normal, normal) + NOTHING**2:
            return track.point(solved)
        reason = "it lies elsewhere there" if solved.converged else track.failure
        raise NotConverged(f"a point of the path was not found on a finer mesh: {reason}", self.path)

    def _neutral(self):
        """The neutral motion at the state."""
        self.stability.count()
        (motion,) = self.stability.whole.modes(1)
        return motion / np.sqrt(self.track.product(motion, motion))
