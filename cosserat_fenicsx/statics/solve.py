"""`solve`: the equilibrium path of a scene, on a mesh that is fine enough for the requested accuracy.

The stages of a scene are scenes that each start from the end of the one before. What a stage holds and releases follows
from the state at its begin, which is computed anew on every mesh: two meshes differ by the error of the whole history.
"""

import cosserat_fenicsx.compat  # noqa: F401, I001  first: it explains what is missing of dolfinx


import contextlib
import itertools
import math
import numbers
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.algebra.eigen import reference_blas
from cosserat_fenicsx.checks import instance, warn
from cosserat_fenicsx.errors import Interrupted, NotConverged, SceneError, nearest
from cosserat_fenicsx.models.signature import Choice, choose
from cosserat_fenicsx.models.formulation import formulation_of
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.parts import per_scene
from cosserat_fenicsx.progress import Progress
from cosserat_fenicsx.ranks import communicator
from cosserat_fenicsx.results.accuracy import FEW
from cosserat_fenicsx.results.compared import NAMES, Criterion, criteria_of
from cosserat_fenicsx.results.contacts import SOFT, check_passes, lifting, slanted, softness_in_words, stiffer
from cosserat_fenicsx.results.path import Path
from cosserat_fenicsx.results.staged import StagedPath
from cosserat_fenicsx.scene.action import describe, path_dependent, rubs
from cosserat_fenicsx.scene.scene import Scene, check_magnitudes, check_tensions
from cosserat_fenicsx.scene.stages import Leg
from cosserat_fenicsx.statics.meshes import first_layout, meshes_for, resolving, resolving_turns, turning_in_law
from cosserat_fenicsx.statics.path.follower import CONTROLS
from cosserat_fenicsx.statics.path.load_control import StepControl
from cosserat_fenicsx.statics.path.recorder import Tracing
from cosserat_fenicsx.statics.problem import Promoted, check_arguments, check_static, refuse_rod_contact, solvers_of
from cosserat_fenicsx.statics.refinement import refine


# Added to messages of stages that release supports.
_RELEASED = (
    " A released support is replaced by its reaction, a dead load under which the structure may be unstable: then "
    "release it where the reaction is small, or in a motion, simulate(scene, duration, start=path)."
)


@dataclass(eq=False)
class Followed:
    """How a `Leg` (None of a scene without stages) is followed: scene, without the state at its begin; load_factors and
    free of `Tracing.along`; choice of the model; arguments of `Follower`."""

    leg: Leg | None
    scene: Scene
    load_factors: list
    free: bool
    choice: Choice
    follow: dict = field(repr=False)


class Legs:
    """Follows the `Followed` legs of a scene, one after another, on meshes; known: {stage: `Path`} of legs that were
    followed before; prepare: called with every new `Path`; in_order: whether points have to be computed in their order;
    simple: whether they may be corrected from a coarser mesh."""

    def __init__(self, scene, legs, discretised, bar, prepare, *, until, in_order, simple, known):
        self._scene, self._legs, self._discretised, self._bar = scene, legs, discretised, bar
        self._prepare, self._until, self._in_order, self._simple = prepare, until, in_order, simple
        self._known, self._so_far, self._strayed = known or {}, {}, []
        self._ends = {}  # the last point of each leg on the last mesh
        self._last = {}  # and on whichever mesh it was computed last
        self._inertia = []  # of the equations where rods meet: the next mesh goes on with their factors

    @contextlib.contextmanager
    def _tracing(self, k, layout):
        """Context manager that gives the `Tracing` of the k-th leg."""
        leg = self._legs[k]
        start = None if k == 0 else self._end(k - 1, layout)
        scene = leg.scene if leg.leg is None else self._scene.of_leg(leg.leg, start)
        follow = leg.follow
        if k and follow["branch"] and any(path.left for path in self._so_far.values()):
            follow = {**follow, "branch": 0}
        with solvers_of(scene, layout, model=leg.choice.model, **self._discretised) as solvers:
            tracer = Tracing(solvers, follow, leg.choice, self._bar, start)
            self._prepare(tracer.path)
            try:
                yield tracer
                if scene.has_obstacles:
                    tracer.doubt()
                self._inertia = [part.interface and part.interface.inertia for part in solvers[2].parts]
            except (NotConverged, Interrupted) as failure:
                if leg.leg is not None:
                    if failure.path is not None:
                        failure.path = self._joined({**self._so_far, leg.leg.stage: failure.path})
                    if isinstance(failure, Interrupted):
                        raise Interrupted(failure.path) from None
                    failure.args = (f"{leg.leg.words}: {failure}{_RELEASED if leg.leg.released else ''}",)
                raise
            except Promoted as found:
                found.leg = k
                raise

    def _end(self, k, layout):
        """The last point of the k-th leg on a mesh."""
        key = k, tuple(layout.keys)
        if key not in self._ends:
            with self._tracing(k, layout) as tracer:
                found = tracer.corrected(self._last[k])
            if found is None:
                raise NotConverged("the end of a stage was not found on a finer mesh")
            self._keep(k, layout, found)
        return self._ends[key]

    def _keep(self, k, layout, path):
        self._ends = {key: end for key, end in self._ends.items() if key[1] == tuple(layout.keys)}
        self._last[k] = self._ends[k, tuple(layout.keys)] = path.at_points([len(path) - 1])

    def _joined(self, parts):
        return StagedPath(self._scene, parts)

    def trace(self, layout, like=None):
        """Follow all legs; `like`: a path on a coarser mesh whose points are reused where the solver chose them."""
        self._so_far, self._ended = {}, False
        for k, leg in enumerate(self._legs):
            stage = leg.leg and leg.leg.stage
            if stage is None:
                return self._traced(k, layout, like)
            if self._ended or (like is not None and stage not in like.parts):
                break
            path = self._so_far[stage] = self._traced(k, layout, like and like.parts[stage])
            self._keep(k, layout, path)
        return self._joined(self._so_far)

    def _traced(self, k, layout, like):
        leg, until = self._legs[k], self._until
        if until is not None and leg.leg is not None:
            before = dict(self._so_far)

            def until(path):
                self._ended = bool(self._until(self._joined({**before, leg.leg.stage: path})))
                return self._ended

        if like is None and leg.leg is not None and leg.leg.stage in self._known:
            like = self._known[leg.leg.stage]
            if like.layout.keys == layout.keys:
                return like
        with self._tracing(k, layout) as tracer:
            if like is None or not leg.free or like in self._strayed:
                return tracer.along(leg.load_factors, leg.free, until)
            if like.control == "load" or self._in_order:
                return tracer.along(like.load_factors.tolist(), False)
            try:  # a load factor may occur several times along the path, so that it does not identify a point
                return tracer.again(like)
            except NotConverged:
                self._strayed.append(like)
                raise

    def correct(self, layout, coarse):
        """The points of a path on a coarser mesh, corrected on this one; None where that fails."""
        if coarse.events or coarse.control == "arc" or not self._simple:
            return None
        if self._legs[0].leg is None:
            with self._tracing(0, layout) as tracer:
                return tracer.corrected(coarse)
        parts = {}
        try:
            for k, leg in enumerate(self._legs):
                points = coarse.part(leg.leg.stage)
                if points is None:
                    continue
                with self._tracing(k, layout) as tracer:
                    found = tracer.corrected(points)
                if found is None:
                    return None
                parts[leg.leg.stage] = found
        except NotConverged:
            return None
        return self._joined(parts)


# Warnings of an unstable end; without numbers, which would give one for each of many cases.
_UNSTABLE = (
    "the last state of the path is unstable: the structure would have left it (path.stable and path.events say from "
    "where on). buckling(scene) finds critical loads and their shapes, branch=1 follows the path that leaves at the "
    "first bifurcation."
)
_MISSING = " Is a support missing, such as one across the plane of a frame?"
_SNAPPED = (
    "the path passes a limit point (path.events): the structure would snap through there, and the states after it are "
    "those that it may come to rest in. A range of load factors, such as (0, 1), or control='arc' has the path between"
)
_BALLS = " Ball joints let rods turn about every axis: release=axis of a Joint, or hinge_axis of a frame, makes hinges."
# Rods of a frame from which on the BLAS decides on the time that the equations where rods meet take.
_MANY = 1000
# What `tol` bounds where contact forces oscillate.
_MOTION = ("position", "rotation")
_STEPS = StepControl()
# Whether the points of a path have to be computed in their order.
_in_order, _rubs = per_scene(path_dependent), per_scene(rubs)
# Largest change of a prescribed rotation in one step, rad: rotations that differ by a full turn are indistinguishable.
_LARGEST_TURN = 1.0


def solve(
    scene: Scene,
    load_factors: float | tuple[float, float] | list[float] | list[int] | np.ndarray | Iterator[float] = (0.0, 1.0),
    *,
    model: str = "auto",
    formulation: str | None = None,
    tol: float = 1e-6,
    bound: Sequence[str | Criterion | type[Criterion]] = NAMES,
    elements: int | None = None,
    degree: int | None = None,
    gauss_points: int | None = None,
    steps: StepControl | None = None,
    control: str = "auto",
    branch: int | None = None,
    until: Callable[[Path], object] | None = None,
    start: Path | None = None,
    progress: bool | None = None,
    comm: MPI.Comm | None = None,
) -> Path:
    """Equilibrium path of a scene from its unloaded reference over the load factors, and through its stages.

    Args:
        scene: a `Scene`.
        load_factors: a list or array, whose values are reached exactly and in this order; or a tuple (a, b), between
            which the solver chooses its steps, by default from 0 to 1; or one number. (A tuple of any other length is
            refused.) They are those of the scene's own loads; a `Stage` has its own.
        model: "determinate", "planar" or "spatial"; or "auto", the cheapest one that suffices, which changes to
            "spatial" where a planar solution buckles sideways. `Path.why` gives the reasons.
        formulation: "mixed" (default), "displacement" or "multiplier": see docs/models.md.
        tol: largest estimated error of positions, rotations, contact forces and contact moments anywhere along the
            rods, each relative to its own size at that load factor (see `Path.errors`). Elements are refined until the
            estimates are below it, unless `elements` is given.
        bound: the quantities that `tol` bounds, of "position", "rotation", "force" and "moment", and `Criterion`s of
            your own, see docs/accuracy.md; the errors of the others are estimated, too. Forces and moments are left
            out where rounding alone exceeds `tol`, as on very slender rods that bend, and moments on straight rods: see
            `Path.bounded` and `Path.why`.
        elements: elements per rod; fixes the mesh, and errors are then not estimated (NaN).
        degree: 1 to 4, of r and q; default 4 (2 for "displacement").
        gauss_points: per element; default `degree`, which does not lock. More of them lock (docs/models.md).
        steps: a `StepControl`.
        control: "auto": load control, and arc length from a limit point on, through snap-through and snap-back, until
            the requested load factor is reached again. "load": load control alone; a limit point raises NotConverged.
            "arc": arc length from the start, always onward: each requested load factor is landed on at the next point
            of the path that has it.
        branch: 1 or -1 to leave the path at its first bifurcation, along the mode or against it (see `Event.mode`; of
            a double bifurcation the first mode); None to stay on it, stable or not.
        until: called with the Path after every recorded point; the path ends where it returns True. Only with a tuple
            (a, b) of load factors.
        start: a Path of the same scene with fewer stages, or none, to start from; its complete stages are not computed
            again.
        progress: True, False, or None for a progress bar on long runs in a terminal.
        comm: MPI communicator; default all ranks. Every rank calls, every rank gets the same Path.

    Returns:
        Path.

    Raises:
        SceneError: an argument outside its range.
        NotConverged: the path cannot be continued, or the accuracy is not reached; `.path` holds the points so far.
        Interrupted: Ctrl-C; `.path` holds the points so far.
    """
    comm = communicator(comm)
    load_factors, free = _requested(load_factors)
    formulation = formulation_of(formulation)
    degree = formulation.default_degree if degree is None else degree
    check_arguments(scene, tol, elements, bound)
    if comm.rank == 0:
        scene.warn()
    discretised = {"formulation": formulation, "degree": degree, "points": gauss_points}
    steps = _STEPS if steps is None else instance("solve", "steps", steps, StepControl, "a StepControl")
    if _rubs(scene) or scene.rod_contact:
        if branch or control == "arc":
            why = "rods touch each other" if scene.rod_contact else "an obstacle has friction"
            raise SceneError(f"control, branch: expected load control and no branch, since {why}")
        control = "load"
    if scene.rod_contact:
        refuse_rod_contact("solve", scene, comm)
    follow = _follow_options(steps, control, branch)
    if until is not None and not (callable(until) and free):
        raise SceneError("until: expected a function of the Path, with a pair of load factors (a, b)")

    def followed(leg):
        """The scene to be followed, without stages (None) or of a `Leg`."""
        part, factors, any_between = (scene if leg is None else scene.of_leg(leg)), load_factors, free
        if leg is not None and leg.load_factors is not None:
            factors, any_between = _requested(leg.load_factors)
        try:
            check_static(part)
            check_magnitudes(part, max(map(abs, factors)))
            check_tensions(scene, factors, leg)
        except SceneError as problem:
            raise problem if leg is None else SceneError(f"{leg.words}: {problem}") from None
        options = follow
        if not steps.adaptive:
            _check_jumps(part, factors)
        elif _turn(part):
            most = min(steps.largest or math.inf, _LARGEST_TURN / _turn(part))
            options = {**follow, "steps": replace(steps, largest=most)}
        choice = choose(part, model=model, follows=branch is not None or control == "arc", **discretised)
        return Followed(leg, part, factors, any_between, choice, options)

    if scene.stages and (remembers := next((load for load in scene.all_loads if load.memory), None)):
        raise SceneError(
            f"Scene.stages: {describe(remembers)} has a memory, which stages do not pass on: expected loads and "
            "obstacles without friction or another memory, or a scene without stages"
        )
    legs = [followed(leg) for leg in scene.legs] if scene.stages else [followed(None)]
    _keep_in_space(legs)
    known = _followed_before(scene, start, legs, degree, gauss_points or degree)
    oscillates = elements is None and gauss_points is not None and gauss_points > degree
    if oscillates:
        bound = [name for name in bound if name in _MOTION] or _MOTION
    bounded, in_order = criteria_of(bound), _in_order(scene) or scene.rod_contact is not None
    simple = not (branch or control == "arc" or until or in_order) and steps.adaptive

    def prepare(path):
        if elements is None:
            path.bounded, path.criteria = bounded

    def take(legs, bar):
        along = Legs(scene, legs, {**discretised, "comm": comm}, bar, prepare, until=until, in_order=in_order,
                     simple=simple, known=known)  # fmt: skip
        if elements is not None:
            layout = Layout.of(scene, elements)
            for leg in legs:
                layout = turning_in_law(leg.scene, layout, leg.load_factors, elements)
            found = along.trace(layout)
            if scene.has_obstacles:
                check_passes(found)
            return found
        many = legs[0].free or len(legs[0].load_factors) > FEW
        given = next(iter(known.values())).layout if known else None
        if given is not None and given.fits(scene):
            layout, usual = given, None
        else:
            layout, usual = meshes_for(scene, degree, tol, many) if simple else (first_layout(scene, degree), None)
        for leg in legs:
            layout = layout if leg is legs[0] else resolving(leg.scene, layout, degree)
            turning = resolving_turns(leg.scene, layout, max(map(abs, leg.load_factors)))
            layout, usual = (layout, usual) if turning is None else (turning, None)
            layout, usual = (x and turning_in_law(leg.scene, x, leg.load_factors) for x in (layout, usual))
        return refine(along.trace, along.correct, bar, scene, layout, tol, bounded[1], degree, usual)

    with Progress(load_factors, progress, comm) as bar:
        while True:
            try:
                path = take(legs, bar)
                break
            except Promoted as found:
                for k, leg in enumerate(legs):
                    if k >= found.leg and leg.choice.model != "spatial":
                        leg.choice = leg.choice.in_space(found.reason)
        of_softness = []
        if scene.has_obstacles and not (scene.stages or in_order):
            of_softness = list(_softness(path, legs[0], {**discretised, "comm": comm}, bar))
    for part in path.parts.values() if scene.stages else [path]:
        path.why.extend(_not_located(part))
    if len(scene.rods) >= _MANY and reference_blas():
        path.why.append(
            "netlib's reference BLAS solves the equations where rods meet: OpenBLAS takes about a third of the time "
            "for them (on Debian: apt install libopenblas0-serial)"
        )
    for part in path.parts.values() if scene.stages else [path]:
        told = list(lifting(part))
        if elements is not None:
            told += [words for x in part.scene.actions if x.gaps is not None for words in slanted(part, x)]
        path.why.extend(told)
        for words in told if comm.rank == 0 else ():
            warn(words)
    if comm.rank == 0 and not (scene.follows or branch or until or control == "arc"):
        if path.negative_modes[-1] > 0:
            balls = any(joint.release == "all" for joint in scene.joints)
            missing = _MISSING if len(scene.rods) > 1 else ""
            warn("; ".join(path.cautions) or f"{_UNSTABLE}{missing}{_BALLS if balls else ''}")
        elif not free and any(event.kind == "limit" for event in path.events):
            warn(_SNAPPED)
    for words, warns in of_softness:
        path.why.append(words)
        path.cautions.append(f"{words[0].upper()}{words[1:]}.")
        if warns and comm.rank == 0:
            warn(words)
    if scene.rod_contact and scene.rod_contact.friction:
        path.why.append(
            "friction of rods that touch depends on the path: slip is counted from step to step, and stability takes "
            "contacts that stick as joined"
        )
    if oscillates:
        path.why.append(
            "with more Gauss points than the degree, contact forces and moments oscillate inside elements: tol bounds "
            f"{' and '.join(f'{name}s' for name in bound)} alone"
        )
    return path


def _softness(path, leg, discretised, bar):
    """(sentence, whether it warns) on what the stiffness of obstacles changes in the last state of a path, by the same
    state with stiffer ones on its mesh; none where that is little or not found."""
    last = path.at_points([len(path) - 1])
    try:
        scene, obstacles, by_default = stiffer(last)
        if not obstacles:
            return
        alone = Legs(scene, [replace(leg, scene=scene)], discretised, bar, lambda path: None, until=None,
                     in_order=False, simple=True, known=None)  # fmt: skip
        stiff = alone.correct(path.layout, last)
    except (NotConverged, SceneError):  # such as a stiffness beyond the largest one
        return
    except Interrupted:
        raise Interrupted(path) from None
    if stiff is not None:
        for words, moved in softness_in_words(last, stiff, obstacles):
            yield words, by_default and moved > SOFT


def _keep_in_space(legs):
    """Follow the path in space from a state in space, or in another plane."""
    for before, leg in itertools.pairwise(legs):
        models, planes = (before.choice.model, leg.choice.model), (before.scene.plane, leg.scene.plane)
        if leg.choice.promoted and ("spatial" in models or planes[0] != planes[1]):
            leg.choice = leg.choice.in_space("the stage before is followed in space, or in another plane")


def _followed_before(scene, start, legs, degree, gauss_points):
    """{stage: its `Path`} of the path to continue."""
    for leg, following in itertools.pairwise(legs):
        if leg.leg.load_factors is None and leg.load_factors[-1] != 1:
            raise SceneError(
                f"load_factors end at {leg.load_factors[-1]:g}, and {following.leg.words} goes on from there: expected "
                "1 at the end; another share of the scene's own loads is a Stage with its own load_factors"
            )
    if start is None:
        return {}
    instance("solve", "start", start, Path, "a Path")
    parts = start.parts if start.scene.stages else {-1: start}
    same = all(
        len(a) == len(b) and all(x is y or (isinstance(x, str) and x == y) for x, y in zip(a, b, strict=True))
        for a, b in (
            *((getattr(start.scene, name), getattr(scene, name)) for name in ("rods", "supports", "loads", "joints")),
            *((getattr(x, name), getattr(y, name)) for x, y in zip(start.scene.stages, scene.stages, strict=False)
              for name in ("loads", "supports", "release")),
        )
    )  # fmt: skip
    if not same or not parts.keys() <= {leg.leg and leg.leg.stage for leg in legs} or not len(start):
        raise SceneError(
            "start: expected a Path of this scene with fewer stages: "
            "dataclasses.replace(path.scene, stages=[*path.scene.stages, Stage(...)])"
        )
    ends = {leg.leg.stage: leg.load_factors[-1] for leg in legs}
    # what was interrupted is computed anew
    whole = dict(itertools.takewhile(lambda part: part[1].load_factors[-1] == ends[part[0]], parts.items()))
    if (start.degree, len(start.rule.gauss)) != (degree, gauss_points) or not whole:
        raise SceneError(
            f"start: expected a Path of degree {degree} with {gauss_points} Gauss points per element that has come to "
            "the last load factor of a stage"
        )
    return whole


def _not_located(path):
    """Sentences on changes of the number of negative modes that the events do not explain."""
    # Planar models locate no events; under loads without a potential the number need not change at an event.
    if path.model != "spatial" or path.scene.follows:
        return
    counts = path.negative_modes.tolist()
    counts = [0 if path.scene.whole is path.scene else counts[0], *counts]
    left_after = path.events[-1].after if path.left and path.events else None
    for k, (before, after) in enumerate(itertools.pairwise(counts)):
        located = sum(event.after == k - 1 for event in path.events)
        if min(before, after) < 0 or left_after == k - 1:
            continue
        change = f"negative modes go from {before} to {after} on the way to the load factor {path.load_factors[k]:.6g}"
        events = f"{located or 'no'} event{'' if located == 1 else 's'}"
        if abs(after - before) > located:
            yield (
                f"{change}, where {events} could be located: the tangent was not found to become singular there. The "
                "path may have changed to another branch, or the loads have no potential; try load factors in between"
            )
        elif (located - after + before) % 2:
            yield f"{change}, where {events} were located: there must be one more; try load factors in between"


def _follow_options(steps, control, branch):
    """Arguments of `Follower`, checked."""
    if control not in CONTROLS:
        raise SceneError(f"control = {control!r}: {nearest(control, CONTROLS)}")
    if branch not in (None, 1, -1) or isinstance(branch, bool):
        raise SceneError(f"branch = {branch!r}: expected 1, -1 or None")
    if branch and control == "load":
        raise SceneError("branch: expected control 'auto' or 'arc', since load control cannot leave a path")
    if not steps.adaptive and (branch or control == "arc"):
        raise SceneError("steps = StepControl(adaptive=False): expected adaptive steps for arc length and branches")
    return {"steps": steps, "control": control, "branch": branch or 0}


def _check_jumps(scene, load_factors):
    """Refuse prescribed rotations by pi or more in one step, which equal smaller opposite ones."""
    farthest = max(abs(b - a) for a, b in zip([0.0, *load_factors[:-1]], load_factors, strict=True))
    turn = farthest * _turn(scene)
    if turn >= math.pi:
        raise SceneError(
            f"steps = StepControl(adaptive=False): a Prescribed rotation would turn by {turn:.3g} rad in one step: "
            "expected load factors that turn it by less than pi at a time"
        )


def _turn(scene):
    """Largest prescribed rotation of a scene at load factor 1, rad; 0.0 where there is none."""
    return max((math.hypot(*(getattr(x, "rotation", None) or (0.0,))) for x in scene.supports), default=0.0)


def _requested(load_factors):
    """([load factors], whether the solver may choose the steps between the two)."""
    if isinstance(load_factors, str) or (isinstance(load_factors, tuple) and len(load_factors) != 2):
        raise SceneError(
            f"load_factors = {load_factors!r}: expected a tuple (a, b), between which the solver chooses its steps, or "
            "a list [a, b, c], whose values are reached exactly"
        )
    free = isinstance(load_factors, tuple)
    if isinstance(load_factors, numbers.Real | np.ndarray):
        load_factors = np.atleast_1d(load_factors).tolist()
    try:
        values = list(load_factors)
    except TypeError:
        raise SceneError(f"load_factors = {load_factors!r}: expected numbers") from None
    if not values:
        raise SceneError("load_factors is empty: expected at least one number")
    for value in values:
        if type(value) is float and math.isfinite(value):
            continue
        if isinstance(value, bool) or not isinstance(value, numbers.Real) or not math.isfinite(value):
            raise SceneError(f"load_factors holds {value!r}: expected finite numbers")
    return [float(value) for value in values], free
