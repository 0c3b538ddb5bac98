"""A path on one mesh through the stages of a scene, which each are a scene that goes on from the end of the one before.

What a stage holds and releases follows from the state at its begin, which is computed anew on every mesh. So two meshes
differ by the error of the whole history.
"""

import contextlib
from dataclasses import dataclass, field

from cosserat_fenicsx.errors import Interrupted, NotConverged
from cosserat_fenicsx.models.choose import Choice
from cosserat_fenicsx.results.staged import StagedPath
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.scene.stages import Leg
from cosserat_fenicsx.statics.path.recorder import Tracing
from cosserat_fenicsx.statics.problem import Promoted, solvers_of

# What is added to messages of stages that release supports.
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
            except (NotConverged, Interrupted) as failure:
                if leg.leg is not None:
                    if failure.path is not None:
                        failure.path = self._joined({**self._so_far, leg.leg.stage: failure.path})
                    if isinstance(failure, NotConverged):
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
