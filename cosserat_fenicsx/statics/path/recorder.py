"""One path on one mesh, recorded: by continuation, or point by point from the same path on a coarser mesh."""

import cosserat_fenicsx.compat  # noqa: F401, I001  first: its message says what is missing where dolfinx is

import dataclasses
import itertools

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.checks import File
from cosserat_fenicsx.errors import Interrupted, NotConverged
from cosserat_fenicsx.interrupts import obey
from cosserat_fenicsx.models.base import Scales
from cosserat_fenicsx.models.connections import Connections
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.ranks import communicator
from cosserat_fenicsx.results.accuracy import on_mesh
from cosserat_fenicsx.results.contacts import check_apart, check_passes, grazing
from cosserat_fenicsx.results import saved
from cosserat_fenicsx.results.path import Path
from cosserat_fenicsx.results.records import Event, Record, Records, lost_at
from cosserat_fenicsx.results.staged import StagedPath
from cosserat_fenicsx.scene.action import rubs
from cosserat_fenicsx.statics.critical import derivatives_of
from cosserat_fenicsx.statics.path.follower import Follower, plain
from cosserat_fenicsx.statics.path.events import Chord, Lost
from cosserat_fenicsx.statics.path.track import NEAR, NOTHING, between
from cosserat_fenicsx.statics.problem import Promoted, record_of

# Loads over EA (about the axial strain) above which messages ask for the units.
_ENORMOUS = 1.0
# Factor from `StepControl.smallest` to the value advised where no first step was accepted.
_SHORTER = 1e-3
# Largest |n| h^2/EI at which an element of length h resolves boundary layers, of length sqrt(EI/|n|).
_RESOLVED = 100.0
#: Newton iterations allowed for a point corrected from a coarser mesh.
CORRECTIONS = 6
# Times that the way between two points is halved to find the events there.
_HALVINGS = 5
# Gap, dimensionless, by which obstacles are moved so that what does not press on them touches, or does not.
_BESIDE = 1e-12
# Largest distance of a point from the same one on a coarser mesh, over the distance of the latter's neighbours.
_ASIDE = 0.3


def _conservative_along(path):
    from cosserat_fenicsx.statics.small_motions import (
        conservative_along,  # late: scipy is slow to import, few ask for it
    )

    return conservative_along(path)


def _modes_along(path, count, damped):
    from cosserat_fenicsx.statics.natural_modes import modes_along  # late: scipy is slow to import

    return modes_along(path, count, damped)


class _Enough(Exception):
    """Raised where the user's `until` returns True."""


def _slackens(scene):
    """Whether the end of a rod beside an obstacle is prescribed to move towards the rod's other end."""
    if not scene.has_walls:
        return False
    for x in scene.supports:
        moved, station = getattr(x, "displacement", None), x.station
        if moved is not None and not callable(moved) and station.s in (0.0, station.rod.length):
            here, other = (
                station.rod.curve.position(station.s),
                station.rod.curve.position(station.rod.length - station.s),
            )
            if np.dot(moved, other - here) > 0:
                return True
    return False


class Tracing:
    """Computes and records a `Path`; follow: arguments of `Follower`; start: a path whose last point is the state at
    the load factor 0, on any mesh; None for the reference."""

    def __init__(self, solvers, follow, choice, bar, start=None):
        self.problem, _, self.stability = solvers
        self.model, self._options, self._choice, self._bar = self.problem.model, follow, choice, bar
        why = [*choice.why, self.model.signature.formulation.words]
        self.path = Path.of(self.model, why, _conservative_along, derivatives_of, _modes_along)
        if choice.model == "spatial" and not self.problem.touching:
            self._follower = Follower(*solvers, on_event=self._meet, **follow)
        else:  # load control without events: of planar models, which the spatial one follows, and of rods that touch
            self._follower = Follower(*solvers, **{**follow, "control": "load"})
        self.track, self._start = self._follower.track, start
        self._counted, self._until, self._stable_at = 0, None, 0.0
        bar.start(f"{self.path.model}, {self.model.unknowns} unknowns")

    def _meet(self, crossing):
        shape = self.model.shape_of(crossing.direction)
        size = np.linalg.norm(shape, axis=1).max()
        event = Event(
            crossing.kind, crossing.point.load_factor, shape / (size or 1.0), len(self.path) - 1, crossing.residual
        )
        self.path.events.append(event)

    def _watch(self, point):
        self._bar.at(point)
        if self.track.watches_steps or self.track.touching:
            here = Path.of(self.model, ())
            here.append(record_of(self.problem, point.load_factor, 0, 0, 0))
        if self.track.watches_steps:  # a rod that is beyond an obstacle in a later state has passed through it in one
            check_passes(here, whole=self.path)
        if self.track.touching:
            check_apart(here, whole=self.path)
        if self._choice.promoted and point.negative_modes:
            where = f"before the load factor {point.load_factor:.4g}"
            if self.problem.model.scene.follows:
                reason = f"negative modes appear {where}, and the spatial model continues the path"
            elif self.stability.sideways:
                reason = (
                    f"in its plane the scene buckles sideways {where}, "
                    "where motions out of the plane lose their stability"
                )
            else:
                in_plane = " in its plane" if self.model.signature.flat else ""
                reason = f"it loses its stability{in_plane} {where}, and the spatial model continues the path"
            raise Promoted(reason, None if self._resolved() else (self._stable_at, point.load_factor))
        if point.negative_modes and self.stability.sideways and not self.path.cautions:
            self.path.cautions.append(
                f"Unstable out of its plane at the load factor {point.load_factor:.4g}, the first one where this was "
                f"seen after {self._stable_at:.4g}: the planar model counts it and does not follow it. A structure "
                "that is braced across its plane needs supports there, such as Rollers."
            )
            self.path.why += self.path.cautions
        self._stable_at = point.load_factor

    def _resolved(self):
        """Whether elements are short enough for the boundary layers of the contact force at the state."""
        model = self.model
        nodal, gauss = model.snapshot()
        load_factor = np.array([self.problem.load_factor])
        _, fields = model.expansion()(load_factor, nodal[None], None if gauss is None else gauss[None])
        n = np.linalg.norm(fields[0, ..., :3], axis=2).max(axis=1)
        sizes = self.path.layout.sizes(model.scene) / model.scales.length
        return bool((n * sizes**2 < _RESOLVED * model.section.J.max(axis=(1, 2))).all())

    def _record(self, point):
        track = self.track
        iterations, self._counted = track.iterations - self._counted, track.iterations
        neutral = track.neutral is not None
        self.path.append(
            record_of(self.problem, point.load_factor, point.negative_modes, iterations, track.steps, neutral)
        )
        if self._until and self._until(self.path):
            raise _Enough

    def along(self, load_factors, free, until=None):
        """Continue the path over the load factors, reached exactly and in this order; free: whether every step from the
        first to the second is recorded; until: see `solve`. NotConverged and Interrupted have the path so far."""
        track = self.track
        try:
            self._begin(load_factors, recorded=free)
            k = 0
            while (k := self._swept_from(k, load_factors, free, until)) < len(load_factors):
                load_factor, between = load_factors[k], free and k == 1
                self._until = until if between else None
                on_step = (lambda point: (self._watch(point), self._record(point))) if between else self._watch
                at_start = k == 0 and track.here.load_factor == load_factor
                # within a range C takes over again after a step
                if not (at_start or self._follower.to(load_factor, on_step=on_step, once=between)):
                    here = track.here.load_factor
                    if self._choice.promoted and self._options["control"] == "auto":
                        raise Promoted(f"load control ends at the load factor {here:.4g}, because {track.failure}")
                    raise NotConverged(
                        f"no equilibrium was found beyond the load factor {here:.6g} on the way to {load_factor:g}: "
                        f"{track.failure}. {self._advice(here, load_factor)}",
                        self.path,
                    )
                if not between:
                    self._record(track.here)
                once = between and self._follower.used == "load"
                k += not once or track.here.load_factor == load_factor
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

    def _begin(self, load_factors, *, recorded=True):
        if self._start is None:
            self._follower.begin(load_factors, recorded=recorded)
            return
        ((point, values, n),) = self._starts(self._start.at_points([len(self._start) - 1]))
        multipliers = np.zeros_like(self.problem.multipliers())  # the equations are linear in these
        if self.problem.tensions:
            multipliers[-len(self.problem.tensions.values) :] = self.problem.tensions.values
        self._follower.begin(load_factors, (values, n, multipliers), recorded=recorded)

    def _swept_from(self, k, load_factors, free, until):
        """Advance from the k-th load factor on in C while steps are accepted; the index of the next load factor."""
        between, here = free and k == 1, self.track.here
        watched = self._choice.promoted and here.negative_modes
        if k == len(load_factors) or watched or (between and until) or not self._follower.sweeps:
            return k
        wanted = load_factors[k:] if not free or between else load_factors[:1]
        sweep = self._follower.sweep(wanted, every=between, counted=self.track.iterations - self._counted)
        try:
            while True:
                swept = next(sweep)
                self._record_all(swept, self.track.here.negative_modes)
        except StopIteration as end:
            done, left = end.value
        self._counted, self._stable_at = self.track.iterations - left, self.track.here.load_factor
        return self._swept_from(1, load_factors, free, until) if free and k < done else k + done

    def _record_all(self, swept, negative_modes):
        self._bar.reached(float(swept.load_factors[-1]))
        count, model, problem = len(swept.load_factors), self.model, self.problem
        nodal, fields = model.snapshots(swept.x, swept.fields)
        multipliers, forces = problem.at_ties(swept.x, swept.load_factors)
        columns = {
            "load_factor": swept.load_factors.copy(),
            "rq": nodal,
            "gauss_fields": fields,
            "negative_modes": np.full(count, negative_modes),
            "iterations": swept.iterations.astype(int),
            "reactions": multipliers,
            "neutral": np.zeros(count, dtype=bool),
            "densities": model.densities.at(swept.load_factors),
            "tie_forces": forces,
            "clamp_loads": model.clamps.loads(swept.load_factors[:, None, None]) + np.zeros((count, 1, 1)),
            "steps": swept.steps.astype(int),
            "rod_forces": None,
        }
        self.path.extend(Records(Record, columns))

    def doubt(self):
        """Take the number of negative modes for unknown (-1) where it is another one with and without the nodes that
        touch an obstacle and do not press on it: for what may lift off there, it is between both."""
        which = np.flatnonzero(grazing(self.path) & (self.path.negative_modes >= 0))
        if not len(which) or rubs(self.model.scene):  # friction of states before the last one is not known
            return
        for k, (point, values, n) in zip(which, self._starts(self.path.at_points(which)), strict=True):
            self.problem.begin_at(values, n, point.reactions)
            self.problem.set_load_factor(point.load_factor)
            counts = [self._count_beside(gap) for gap in (_BESIDE, -_BESIDE)]
            if counts[0] != counts[1]:
                self.path._all["negative_modes"][k] = -1
        self._count_beside(0.0)
        self.path._forget()

    def _count_beside(self, gap):
        """The number of negative modes, with obstacles farther from rods by a gap."""
        self.model.actions.withdraw(gap)
        for part in self.stability.parts:
            part.form.refresh()
        return self.stability.count()

    def _advice(self, here, load_factor):
        if not self._options["steps"].adaptive:
            return "Allow adaptive steps, or ask for load factors in between."
        load, most = abs(load_factor) * self.problem.load_norm, self.model.section.K.max()
        strain = load / most
        if strain > _ENORMOUS:
            return (
                f"The loads are {strain:.1e} times EA there, which no rod bears: are the units those of SI (N, m, Pa)?"
            )
        self.track.put(self.track.here.numbers, here)
        if self.problem.tensions and (found := self.problem.tensions.too_short(load_factor, most)):
            tendon, length = found
            return (
                f"The {type(tendon).__name__} of {tendon.rod.name} hardly gets shorter than its way along the rod "
                f"there, {length:.6g} m: its tension would exceed EA of the rod. Expected a smaller shortening, or a "
                "tendon that stretches, axial="
            )
        scene, where = self.model.scene, "Try"
        if len(self.track.history) == 1 and self._options["control"] == "arc":
            where = "Try control='auto',"
        elif len(self.track.history) == 1:
            shorter = _SHORTER * self._options["steps"].smallest
            where = (
                f"Try a first step below {self._follower.smallest:.1g}, by steps=StepControl(smallest={shorter:.1g}),"
            )
        if _slackens(scene):
            way = "" if rubs(scene) else " move it upwards in one Stage and inwards in the next, or"
            where = (
                f"A cable whose end is prescribed inwards is pressed before it sags:{way} pull by a Force in place of "
                "the Prescribed displacement; otherwise try"
            )
        elif rubs(scene) and abs(load_factor) < abs(here):
            where = "Friction has not settled on the way back: try one step, steps=StepControl(adaptive=False), or"
        elif here and rubs(scene):
            where = "Friction may not hold more; otherwise try"
        elif here and (self._options["control"] == "load" or self.path.model != "spatial"):
            can = "control='auto'" if self._options["control"] == "load" else "model='spatial'"
            where = f"There may be a limit point, which load control cannot pass ({can} can); otherwise try"
        elif self.path.events:
            where = f"{lost_at(self.path)}; to go on beyond it try"
        softer = ", a softer wall" if any(action.at_nodes for action in scene.actions) else ""
        return f"{where} load factors in between, more elements{softer}, or {self.model.signature.formulation.advice}."

    def corrected(self, coarse):
        """The points of a path on a coarser mesh, corrected on this mesh by Newton's method at their load factors; None
        where one fails to converge, moves too far or changes its number of negative modes. Interrupted has the path so
        far."""
        problem, track, path = self.problem, self.track, self.path
        if problem.begins:
            problem.end_beginning()
        track.max_iterations = CORRECTIONS
        try:
            if self._follower.in_c:
                return path if self._corrected_in_c(coarse) else None
            for point, values, n in self._starts(coarse):
                obey()
                problem.begin_at(values, n, point.reactions)
                start = problem.numbers()
                solved = track.at_load(start, point.load_factor)
                if not solved.converged or track.distance(problem.numbers(), start) > NEAR:
                    return None
                found = track.point(solved)
                if found.negative_modes != point.negative_modes:
                    return None
                track.steps += 1
                self._record(found)
                self._bar.at(point)
        except KeyboardInterrupt:
            raise Interrupted(path) from None
        return path

    def _corrected_in_c(self, coarse):
        """`corrected` by C; whether all points were found."""
        rq, n = on_mesh(coarse, self.path.layout)
        starts, done = self.problem.starts(self.model.unknowns_of(rq), n, coarse._stacked("reactions")), 0
        negative_modes = coarse.negative_modes
        points = self._follower.points.corrected(self.track, starts, coarse.load_factors, negative_modes, NEAR)
        for swept in points:
            if swept is None:
                return False
            first, done = done, done + len(swept.load_factors)
            self._record_all(swept, negative_modes[first:done])
        return True

    def _starts(self, coarse):
        """(point, values, n) for each point of a path on a coarser mesh: the arguments of `Problem.begin_at`."""
        rq, n = on_mesh(coarse, self.path.layout)
        return zip(coarse._records, self.model.unknowns_of(rq), n, strict=True)

    def again(self, coarse):
        """The points of a path on a coarser mesh, corrected on this mesh in the plane perpendicular to the path, the
        two ends at their load factors; NotConverged where one was not found."""
        self._begin(coarse.load_factors)
        problem, track, last = self.problem, self.track, len(coarse) - 1
        guesses = []
        for point, values, n in self._starts(coarse):
            problem.begin_at(values, n, point.reactions)
            guesses.append((problem.numbers(), point.load_factor))
        weights = (track.balance(b[0][0] - a[0][0], b[1] - a[1]) for a, b in itertools.pairwise(guesses))
        weight = min(filter(None, weights), default=1.0)
        before, left = None, self._to_fork(coarse) if coarse.left else -1
        try:
            for k in range(last + 1):
                obey()
                (ahead, factor_ahead), (behind, factor_behind) = guesses[min(k + 1, last)], guesses[max(k - 1, 0)]
                normal, change = ahead[0] - behind[0], factor_ahead - factor_behind
                if k == 0 and guesses[0][1] == 0:
                    point = track.origin
                    track.put(point.numbers, 0.0)
                else:
                    still = k in (0, last) or not track.square(normal)
                    point = self._found(*guesses[k], normal, weight * change, coarse._records[k].neutral, at_load=still)
                track.set_tangent(point, track.slope(), (normal, change), weight)
                if before is not None and k > left + 1:  # nothing changes sign in the step onto a branch
                    self._meet_between(before, point, weight)
                track.keep(point)
                track.restore()
                self._record(point)
                self._bar.at(point)
                before = point
        except KeyboardInterrupt:
            raise Interrupted(self.path) from None
        self.path.control, self.path.left = "arc", coarse.left
        return self.path

    def _meet_between(self, a, b, weight, halvings=_HALVINGS):
        """Report events between two points of a coarser path: in halves of the way where they are not resolved."""
        scale = self.track.length(between(self.track.origin, a), weight)
        chord = Chord(self.track, a, b, weight, short=plain(self.track, a, b, weight, scale))
        try:
            crossings = self._follower.locator.crossings(chord)
        except Lost as lost:
            middle = chord.at(0.5) if halvings else None
            if middle is None:
                raise NotConverged(
                    f"an event of the path was not found on a finer mesh: {lost.reason}", self.path
                ) from None
            self._meet_between(a, middle[1], weight, halvings - 1)
            self._meet_between(middle[1], b, weight, halvings - 1)
        else:
            for crossing in crossings:
                self._meet(crossing)

    def _to_fork(self, coarse):
        """Locate the events up to the bifurcation where the path was left; index of the last point before that."""
        known = list(itertools.takewhile(lambda event: event.kind != "bifurcation", coarse.events))
        known.append(coarse.events[len(known)])
        found = self._follower.to_fork(float(coarse.load_factors[-1]))
        if not found or len(self.path.events) != len(known):
            raise NotConverged("the bifurcation was not found on a finer mesh", self.path)
        events = zip(self.path.events, known, strict=True)
        self.path.events = [dataclasses.replace(event, after=other.after) for event, other in events]
        self.track.history = [self.track.origin]
        return known[-1].after

    def _found(self, guess, load_factor, normal, weight, neutral, *, at_load):
        """The `PathPoint` next to a guess, at its load factor or in the plane through it."""
        track = self.track
        track.put(guess, load_factor)
        track.neutral = self._neutral() if neutral else None
        solved = track.at_load(guess, load_factor) if at_load else track.on_plane(guess, load_factor, normal, weight)
        off = self.problem.numbers()[0] - guess[0]
        if solved.converged and track.product(off, off) <= _ASIDE**2 * track.product(normal, normal) + NOTHING**2:
            return track.point(solved)
        reason = "it converged too far from the coarse one" if solved.converged else track.failure
        raise NotConverged(f"a point of the path was not found on a finer mesh: {reason}", self.path)

    def _neutral(self):
        """The neutral motion at the state: the eigenvector of the second variation nearest zero, normalised."""
        self.stability.count()
        (motion,) = self.stability.whole.modes(1)
        return motion / np.sqrt(self.track.product(motion, motion))


def read_path(file: File, *, comm: MPI.Comm | None = None) -> Path:
    """The `Path` that `Path.save` wrote, with the same digits.

    Its scene is a copy: stations are those of `path.rod(name)`, or are given by name.

    Args:
        file: its name.
        comm: MPI communicator of the path, whose ranks all read the file; default all.

    Raises:
        SceneError: it cannot be read, is damaged, holds something else, or is of a newer release.
    """
    path = saved.read(file, Path, assembled, communicator(comm), StagedPath)
    if not path.scene.stages:
        path._potential, path._differentiated, path._vibrating = _conservative_along, derivatives_of, _modes_along
    for part in path.parts.values() if path.scene.stages else ():
        part._potential = _conservative_along
    return path


def assembled(scene, breaks, scales):
    """The `Layout`, the `Scales` and the `Connections` of a result from what `saved.read` passes."""
    layout = Layout(tuple(breaks))
    return layout, Scales(**scales), Connections.of(scene, layout)
