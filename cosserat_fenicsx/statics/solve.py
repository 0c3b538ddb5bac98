"""`solve`: from a scene to its equilibrium path, on a mesh that is fine enough for the accuracy asked for."""

import cosserat_fenicsx.compat  # noqa: F401, I001  first: it says in words what of dolfinx is missing

import itertools
import math
import numbers
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.checks import instance
from cosserat_fenicsx.scene.choose import choose
from cosserat_fenicsx.statics.continuation import StepControl
from cosserat_fenicsx.errors import NotConverged, SceneError, nearest
from cosserat_fenicsx.statics.follow import CONTROLS
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.progress import Progress
from cosserat_fenicsx.statics.first_mesh import first_layout
from cosserat_fenicsx.statics.solvers import default_degree, solvers_of
from cosserat_fenicsx.statics.refinement import refine
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.scene.statical import check_no_mechanism
from cosserat_fenicsx.scene.supports import Prescribed
from cosserat_fenicsx.statics.tracing import Promoted, Tracing

# A prescribed rotation turns by no more than this in a step, rad: a step cannot tell it from one with a full turn more or less.
_LARGEST_TURN = 1.0


def solve(
    scene,
    load_factors,
    *,
    model="auto",
    formulation=None,
    tol=1e-6,
    elements=None,
    degree=None,
    gauss_points=None,
    steps=None,
    control="auto",
    branch=None,
    until=None,
    progress=None,
    comm=None,
):
    """Equilibrium path of a scene from its unloaded reference over the load factors.

    Args:
        scene: a `Scene`.
        load_factors: a list or array, landed on exactly in its order; or a pair (a, b), a tuple, between which the
            solver chooses its steps; or one number.
        model: "determinate", "planar" or "spatial"; or "auto", the cheapest one that is enough, which goes over to
            "spatial" where a planar answer buckles sideways. `Path.why` says why.
        formulation: "mixed" (default), "displacement" or "multiplier"; see the README.
        tol: largest estimated error of the positions along the rods, relative to the largest displacement of the
            scene at that load factor. Elements are refined until it is met, unless `elements` is given.
        elements: elements per rod; fixes the mesh, and `Path.error` is then not estimated (NaN).
        degree: 1 to 4, of r and q; default 4 (2 for the other formulations).
        gauss_points: of an element; default `degree`, which does not lock. More of them lock (README, Formulations).
        steps: a `StepControl`.
        control: "auto" steps the load factor, and goes on in the arc length of the path where that meets a limit point,
            through snap-through and snap-back, until the requested load factor is reached again. "load" never does:
            a limit point raises NotConverged. "arc" goes in arc length from the start and never turns round: each
            requested load factor is the next place along the path that has it.
        branch: 1 or -1 to leave the path at its first bifurcation, along the mode or against it (see `Event.mode`; of
            two modes at once the first); None to stay on it, stable or not.
        until: called with the Path after every recorded point; True from it ends the path there. For a pair.
        progress: True, False, or None for a bar on long runs in a terminal.
        comm: MPI communicator; default all ranks. Every rank calls, every rank gets the same Path.

    Returns:
        Path.

    Raises:
        SceneError: an argument outside its range.
        NotConverged: the path cannot be continued, or the accuracy not be met; `.path` holds what was reached.
        Interrupted: Ctrl-C; `.path` holds what was reached.
    """
    comm = comm or MPI.COMM_WORLD
    targets, free = _targets(load_factors)
    formulation = "mixed" if formulation is None else formulation
    degree = default_degree(formulation) if degree is None else degree
    check_arguments(scene, tol, elements)
    choice = choose(
        scene,
        model=model,
        formulation=formulation,
        degree=degree,
        points=gauss_points,
        follows=branch is not None or control == "arc",
    )
    steps = instance("solve", "steps", StepControl() if steps is None else steps, StepControl, "a StepControl")
    follow, until = _follow_options(steps, control, branch), _until(until, free)
    if not steps.adaptive:
        _check_jumps(scene, targets)
    elif _turn(scene):
        follow["steps"] = replace(steps, largest=min(steps.largest or math.inf, _LARGEST_TURN / _turn(scene)))

    def take(choice, bar):
        strayed = []

        def tracing(layout, *, from_rest=True):
            solvers = solvers_of(
                scene,
                layout,
                formulation=formulation,
                degree=degree,
                points=gauss_points,
                comm=comm,
                model=choice.model,
            )
            return Tracing(solvers, formulation, follow, choice, bar, from_rest=from_rest)

        def trace(layout, like=None):
            """`like`: a path whose points are found again, where the solver chose them."""
            if like is None or not free or like in strayed:
                return tracing(layout).along(targets, free, until)
            if like.control == "load":
                return tracing(layout).along(like.load_factors.tolist(), False)
            try:  # load factors that come more than once do not say where the points are
                return tracing(layout).again(like)
            except NotConverged:
                strayed.append(like)
                raise

        def correct(layout, coarse):
            if coarse.events or coarse.control == "arc" or until or not steps.adaptive:
                return None
            return tracing(layout, from_rest=False).corrected(coarse)

        if elements is not None:
            return trace(Layout.of(scene, elements))
        return refine(trace, correct, scene, first_layout(scene, degree), tol, degree)

    with Progress(targets, progress, comm) as bar:
        try:
            path = take(choice, bar)
        except Promoted as found:
            path = take(choice.in_space(found.reason), bar)
    path.why.extend(_not_located(path))
    return path


def _not_located(path):
    """Sentences on negative modes that came or went where no event was found."""
    if path.model != "spatial" or path.scene.follows:  # in a plane nobody looks for events; and that has been said
        return
    counts = [0, *path.negative_modes.tolist()]
    for k, (before, after) in enumerate(itertools.pairwise(counts)):
        located = sum(event.after == k - 1 for event in path.events)
        if min(before, after) >= 0 and abs(after - before) > located:
            yield (
                f"negative modes go from {before} to {after} on the way to the load factor {path.load_factors[k]:.6g}, where "
                f"{located or 'no'} event{'' if located == 1 else 's'} could be located: the path may have gone over to another one, or "
                "the loads have no potential; try load factors in between"
            )


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


def _check_jumps(scene, targets):
    """One step cannot tell a prescribed rotation from the same one with a full turn more or less."""
    farthest = max(abs(b - a) for a, b in zip([0.0, *targets[:-1]], targets, strict=True))
    turn = farthest * _turn(scene)
    if turn >= math.pi:
        raise SceneError(
            f"steps = StepControl(adaptive=False): a Prescribed rotation would turn by {turn:.3g} rad in one step: expected load "
            "factors that turn it by less than pi at a time"
        )


def _turn(scene):
    """Largest prescribed rotation of a scene at load factor 1, rad; 0.0 where there is none."""
    return max((math.hypot(*(getattr(x, "rotation", None) or (0.0,))) for x in scene.supports), default=0.0)


def _until(until, free):
    if until is not None and not (callable(until) and free):
        raise SceneError("until: expected a function of the Path, with a pair of load factors (a, b)")
    return until


def _targets(load_factors):
    """([load factors], whether the solver may choose the steps between the two)."""
    free = isinstance(load_factors, tuple) and len(load_factors) == 2
    if isinstance(load_factors, numbers.Real | np.ndarray):
        load_factors = np.atleast_1d(load_factors).tolist()
    try:
        values = list(load_factors)
    except TypeError:
        raise SceneError(f"load_factors = {load_factors!r}: expected numbers") from None
    if not values:
        raise SceneError("load_factors is empty: expected at least one number")
    for value in values:
        if isinstance(value, bool) or not isinstance(value, numbers.Real) or not math.isfinite(value):
            raise SceneError(f"load_factors holds {value!r}: expected finite numbers")
    return [float(value) for value in values], free


def check_arguments(scene, tol, elements):
    """Refuse arguments of `solve` outside their range.

    Raises:
        SceneError: naming the argument, its value and what was expected.
    """
    if not isinstance(scene, Scene):
        hint = ", which is the first of what read_scene returns" if isinstance(scene, tuple) else ""
        raise SceneError(f"scene is a {type(scene).__name__}: expected a Scene{hint}")
    if not scene.loads and not any(isinstance(support, Prescribed) for support in scene.supports):
        raise SceneError(
            "Scene.loads is empty: expected at least one load, such as Force(rod.end, (0, 0, -1)), or a Prescribed motion"
        )
    for item in scene.moving:
        raise SceneError(
            f"Scene: the {type(item).__name__} depends on time, and statics knows none: expected a vector, or a motion: "
            "cf.simulate(scene, duration) in Python, a duration under [simulate] in a scene file, --duration on the command line"
        )
    check_no_mechanism(scene)
    if isinstance(tol, bool) or not isinstance(tol, numbers.Real) or not 1e-12 <= tol < 1:
        raise SceneError(f"tol = {tol!r}: expected a number from 1e-12 to below 1")
    if elements is not None and (
        isinstance(elements, bool) or not isinstance(elements, numbers.Integral) or elements < 1
    ):
        raise SceneError(f"elements = {elements!r}: expected a whole number above zero")
