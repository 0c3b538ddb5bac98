"""`solve`: from a scene to its equilibrium path, on a mesh that is fine enough for the accuracy asked for."""

import cosserat_fenicsx.compat  # noqa: F401, I001  first: it says in words what of dolfinx is missing

import functools
import math
import numbers

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.checks import instance
from cosserat_fenicsx.choose import choose, force_in_words
from cosserat_fenicsx.continuation import Continuation, StepControl
from cosserat_fenicsx.errors import Interrupted, NotConverged, SceneError
from cosserat_fenicsx.models.determinate import DeterminateInPlane, DeterminateInSpace
from cosserat_fenicsx.models.planar import PlanarModel
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.shape import Shape
from cosserat_fenicsx.models.spatial import SpatialModel
from cosserat_fenicsx.problem import Problem
from cosserat_fenicsx.progress import Progress
from cosserat_fenicsx.results import Path, Record
from cosserat_fenicsx.scene import Scene
from cosserat_fenicsx.snes import Newton
from cosserat_fenicsx.stability import NegativeModes
from cosserat_fenicsx.supports import Prescribed

_MODELS = {
    ("determinate", True): DeterminateInPlane,
    ("determinate", False): DeterminateInSpace,
    ("planar", True): PlanarModel,
    ("spatial", False): SpatialModel,
}
#: Elements per rod of the first mesh, where the mesh is not given.
FIRST_ELEMENTS = 4
_MOST_ELEMENTS = 1024
# Loads in units of EI/L^2 that point to a slip in the units.
_ENORMOUS = 1e5


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
    choice = choose(scene, model=model, formulation=formulation, degree=degree, points=gauss_points)
    steps = instance("solve", "steps", StepControl() if steps is None else steps, StepControl, "a StepControl")
    run = functools.partial(
        _run, scene, formulation=formulation, degree=degree, points=gauss_points, steps=steps, comm=comm
    )
    with Progress(targets, progress, comm) as bar:

        def take(choice):
            if elements is not None:
                return run(targets, free, Layout.of(scene, elements), choice=choice, bar=bar)
            chosen = functools.partial(run, choice=choice)
            return _refine(chosen, targets, free, Layout.of(scene, FIRST_ELEMENTS), tol, degree, bar)

        try:
            return take(choice)
        except _Sideways as buckled:
            return take(choice.sideways(buckled.load_factor))


class _Sideways(Exception):
    """A planar answer that was to be promoted is unstable against motions out of its plane."""

    def __init__(self, load_factor):
        super().__init__(load_factor)
        self.load_factor = load_factor


def _refine(run, targets, free, layout, tol, degree, bar):
    """Solve on finer and finer meshes until two of them agree to `tol`."""
    coarse, failed, best = None, False, math.inf
    while True:
        elements = max(layout.counts)
        try:
            fine = run(targets, free, layout, bar=bar)
        except NotConverged:
            if failed or elements >= _MOST_ELEMENTS:
                raise
            failed, coarse = True, None
        else:
            failed = False
            if free:  # the steps that one mesh chose are landed on by the finer ones
                targets, free = fine.load_factors.tolist(), False
            if coarse is not None:
                fine.estimate_error(coarse)
                reached = float(fine.error.max())
                if reached <= tol:
                    return fine
                if elements >= _MOST_ELEMENTS or (reached > best and best < 1e-8):
                    raise NotConverged(_not_accurate(tol, min(reached, best), elements, degree), fine)
                best = min(best, reached)
            coarse = fine
        layout = layout.split(2)


def _not_accurate(tol, reached, elements, degree):
    advice = "a larger tol" if degree == 4 else "a larger tol, or degree 4"
    return (
        f"the accuracy tol = {tol:g} was not reached with {elements} elements of degree {degree} per rod: "
        f"the estimated error stays at {reached:.2g}. Ask for {advice}."
    )


def _make_solvers(comm, shape):
    """Problem, Newton solver and stability count of a shape."""
    model = _MODELS[shape.model, shape.flat](comm, shape)
    problem = Problem(model)
    return problem, Newton(problem), NegativeModes(problem)


@functools.lru_cache(maxsize=16)
def _kept_solvers(alone, shape):
    """Compiled once, used for every scene of that shape."""
    return _make_solvers(MPI.COMM_SELF if alone else MPI.COMM_WORLD, shape)


def solvers_of(scene, layout, *, formulation="mixed", degree=4, points=None, comm=None, model="spatial"):
    """The loaded problem, Newton solver and stability count for a scene on a given mesh, as `solve` uses them."""
    comm = comm or MPI.COMM_WORLD
    shape = Shape.of(scene, layout, formulation=formulation, degree=degree, points=points, model=model)
    if comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        problem, newton, stability = _kept_solvers(comm == MPI.COMM_SELF, shape)
    else:  # a user's communicator may be freed, and its handle given to another
        problem, newton, stability = _make_solvers(comm, shape)
    problem.load(scene, layout)
    stability.load()
    return problem, newton, stability


def _run(scene, targets, free, layout, *, formulation, degree, points, steps, comm, choice, bar):
    """One path on one mesh."""
    problem, newton, stability = solvers_of(
        scene, layout, formulation=formulation, degree=degree, points=points, comm=comm, model=choice.model
    )
    continuation = Continuation(problem, newton, stability, steps)
    why = [*choice.why, force_in_words(problem.model.shape.variant, formulation)]
    path = Path.of(problem.model, formulation, why)
    bar.start(f"{path.model}, {problem.model.unknowns} unknowns")
    way = max(abs(eta) for eta in targets) or 1.0
    counted = 0

    def watch(point):
        if choice.promoted and stability.sideways:
            raise _Sideways(point.load_factor)
        bar.at(point)

    def record(point):
        nonlocal counted
        path.append(Record(point.load_factor, *problem.model.snapshot(), point.negative_modes,
                           continuation.iterations - counted))  # fmt: skip
        counted = continuation.iterations

    try:
        for k, target in enumerate(targets):
            between = free and k == 1
            on_step = (lambda point: (watch(point), record(point))) if between else watch
            if not continuation.to(target, way, on_step=on_step):
                here = continuation.here.load_factor
                raise NotConverged(
                    f"no equilibrium was found beyond the load factor {here:.6g} on the way to {target:g}: "
                    f"{continuation.failure}. {_advice(steps, here, abs(target) * problem.load_norm)}",
                    path,
                )
            if not between:
                record(continuation.here)
    except KeyboardInterrupt:
        raise Interrupted(path) from None
    return path


def _advice(steps, here, load):
    if not steps.adaptive:
        return "Let the steps adapt, or ask for load factors in between."
    if load > _ENORMOUS:
        return (
            f"The loads are {load:.1e} EI/L^2 there, which no slender rod bears: are the units those of SI (N, m, Pa)?"
        )
    where = "There may be a limit point, which load control cannot pass; otherwise try" if here else "Try"
    return f"{where} load factors in between, more elements, or the formulation 'mixed'."


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


def default_degree(formulation):
    """Degree of r and q where none is asked for."""
    return 4 if formulation == "mixed" else 2


def check_arguments(scene, tol, elements):
    """Refuse arguments of `solve` outside their range.

    Raises:
        SceneError: naming the argument, its value and what was expected.
    """
    if not isinstance(scene, Scene):
        raise SceneError(f"scene = {scene!r}: expected a Scene")
    if not scene.loads and not any(isinstance(support, Prescribed) for support in scene.supports):
        raise SceneError(
            "Scene.loads is empty: expected at least one load, such as Force(rod.end, (0, 0, -1)), or a Prescribed motion"
        )
    if isinstance(tol, bool) or not isinstance(tol, numbers.Real) or not 1e-12 <= tol < 1:
        raise SceneError(f"tol = {tol!r}: expected a number from 1e-12 to below 1")
    if elements is not None and (
        isinstance(elements, bool) or not isinstance(elements, numbers.Integral) or elements < 1
    ):
        raise SceneError(f"elements = {elements!r}: expected a whole number above zero")
