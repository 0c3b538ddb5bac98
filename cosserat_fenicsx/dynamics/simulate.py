"""`simulate`, the motion of a scene in time; motions in a folder, which are read and continued, and saved files."""

import cosserat_fenicsx.compat  # noqa: F401, I001  first: its message says what is missing where dolfinx is

import contextlib
import math
import numbers
import os
import warnings
from operator import itemgetter
from pathlib import Path as FilePath

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.algebra.pool import PROBLEMS
from cosserat_fenicsx.checks import File, instance, number, refuse, whole
from cosserat_fenicsx.dynamics.pace import Adaptive, Doubled, Fixed
from cosserat_fenicsx.dynamics.schemes import SCHEMES
from cosserat_fenicsx.dynamics.start import equilibrium, point_of, put_start, starts_in
from cosserat_fenicsx.dynamics.time_loop import TimeLoop, marks_of
from cosserat_fenicsx.errors import Interrupted, NotConverged, SceneError, SceneWarning, nearest
from cosserat_fenicsx.models.base import Scales
from cosserat_fenicsx.models.collocated import CollocatedPlanar, CollocatedSpatial, ConservingSpatial, EccentricSpatial
from cosserat_fenicsx.models.connections import Connections
from cosserat_fenicsx.models.moving import MovingPlanar, MovingSpatial
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.signature import Signature, not_flat
from cosserat_fenicsx.ranks import Alone, communicator
from cosserat_fenicsx.results import saved
from cosserat_fenicsx.results.history import History
from cosserat_fenicsx.results.path import Path
from cosserat_fenicsx.scene.action import describe, path_dependent
from cosserat_fenicsx.scene.loads import Weight
from cosserat_fenicsx.scene.rod import require_inertia
from cosserat_fenicsx.scene.scene import Scene, check_magnitudes, check_tensions
from cosserat_fenicsx.scene.stages import refuse_stages
from cosserat_fenicsx.statics.meshes import turning_in_law
from cosserat_fenicsx.statics.path.recorder import assembled
from cosserat_fenicsx.storage.store import Nowhere, Store
from cosserat_fenicsx.storage.stored_history import KIND, StoredHistory

#: Default elements per rod, polynomial degree and tolerance.
ELEMENTS, DEGREE, TOL = 8, 3, 1e-3
#: More steps or saved states than these are refused as a mistake.
MOST_STEPS, MOST_SAVED = 1e9, 1e6
# Steps between saved times from which on half as many are nearly twice as long.
_DOUBLED = 8


def simulate(
    scene: Scene,
    duration: float,
    *,
    tol: float | None = None,
    dt: float | None = None,
    model: str = "auto",
    scheme: str = "momentum",
    rho_inf: float | None = None,
    save_every: float | None = None,
    start: float | Path | tuple[Path, int] | None = None,
    load_factor: float | None = None,
    elements: int = ELEMENTS,
    degree: int = DEGREE,
    estimate: bool = False,
    folder: File | None = None,
    progress: bool | None = None,
    comm: MPI.Comm | None = None,
) -> History:
    """Compute the motion of a scene from the time 0.

    Loads and prescribed motions are those of the scene at every time (`signals`), times `load_factor`; the initial
    velocities are the scene's. A scene without supports moves freely.

    Args:
        scene: a `Scene`; every rod needs a mass and inertia.
        duration: s.
        tol: bound on the sum of the local errors of all steps over the duration, of positions over the longest rod's
            length and of rotations (rad) over 10; steps adapt to it, and resolve loads and prescribed motions. Default
            1e-3, unless `dt` is given. The mesh does not adapt, see `estimate`.
        dt: fixed step, s; shortened so that steps end at jumps and saved times. A step that fails is halved.
            `History.why` warns of loads that change faster than such steps resolve.
        model: "spatial"; "planar" for a scene that moves in a plane; or "auto", the cheapest one that is valid.
        scheme: "momentum" (exact linear and angular momentum, order 2); "triple-jump" (three steps of it, one back in
            time: order 4, for smooth motions without damping, fixed dt); "energy" (exact energy and linear momentum,
            order 2, spatial model alone); "generalised-alpha" (dissipates unresolved frequencies, order 2; the energy
            balance of the History shows how much).
        rho_inf: of "generalised-alpha": spectral radius at infinite frequency, from 0 to 1: the factor per step on
            vibrations much faster than the steps; 1 dissipates nothing (the trapezoidal rule). Default 0.8.
        save_every: s between saved states, steps end there exactly; None saves every step.
        start: None for the reference, a `Path` for its last equilibrium, or (Path, k); rods must be the same objects,
            and friction of obstacles begins there, at zero. A number is the load factor of an equilibrium of the scene
            just before t = 0.
        load_factor: multiplies all loads and prescribed motions, as in `solve`; None for `start` where that is a
            number, otherwise 1.
        elements: elements per rod.
        degree: polynomial degree of r and q, 1 to 4.
        estimate: also compute the motion with half as many elements and steps twice as long, for some 60 % more time;
            how far the two have been apart up to each time (`History.apart`) is `History.error`: in smooth motions some
            three times the largest error; in the first steps it may be less. Not with a `folder`.
        folder: folder for states and checkpoints of long runs: the History reads states from there when they are used,
            and keeps none in memory. Whatever ends the run, `resume(folder)` continues it with the same digits. It must
            not hold a motion yet, and all ranks must see it; None keeps the states in memory.
        progress: True, False, or None for a bar on long runs in a terminal.
        comm: MPI communicator; default all ranks. Every rank calls, every rank gets the same History.

    Returns:
        History.

    Raises:
        SceneError: an argument outside its range, a rod without inertia, a start that supports contradict, or a
            discontinuous prescribed motion; a function of time that raises or gives no finite numbers, `.path` then
            holds the History up to there.
        NotConverged: a step fails however short it is, or thousands of steps in a row are tiny; `.path` holds the
            History up to there.
        Interrupted: Ctrl-C; `.path` holds the History up to there.
        NotStored: the folder can no longer be written to, such as on a full disk; `.path` holds the History up to
            there.
    """
    comm = communicator(comm)
    instance("simulate", "scene", scene, Scene, "a Scene")
    duration = positive_time("duration", duration)  # of text with a unit its seconds
    dt, save_every = (value if value is None else positive_time(name, value)
                      for name, value in (("dt", dt), ("save_every", save_every)))  # fmt: skip
    pace = pace_of(duration, tol=tol, dt=dt, scheme=scheme, save_every=save_every, elements=elements)
    rho_inf = _rho_inf(scheme, rho_inf)
    if instance("simulate", "estimate", estimate, bool, "True or False"):
        if folder is not None:
            refuse("simulate", "estimate", True, "False with a folder, and `History.apart` of another motion")
        if elements < 2:
            refuse("simulate", "estimate", True, "False with one element a rod, which cannot be halved")
    given = {"model": model, "scheme": scheme, "rho_inf": rho_inf, "save_every": save_every, "start": start,
             "load_factor": load_factor, "degree": degree, "progress": progress, "comm": comm}  # fmt: skip
    stored = None
    if folder is not None:
        stored = folder, {"duration": duration, "tol": tol, "dt": dt, "elements": elements}
    history = _motion(scene, duration, pace, elements, stored, **given)
    if estimate:
        _estimate(history, duration, elements // 2, given)
    return history


def _estimate(history, duration, elements, given):
    """Set the errors of a motion by another one with fewer elements and steps twice as long."""
    history.error = np.full(len(history), np.nan)
    if (np.diff(history.steps) < _DOUBLED).any():  # steps that end at saved times could not be twice as long
        given = given | {"save_every": None}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)  # said already
        try:
            apart = history.apart(_motion(history.scene, duration, Doubled(history), elements, None, **given))
            history.error = np.maximum.accumulate(apart)
        except (NotConverged, SceneError) as problem:
            history.why.append(f"the motion with half as many elements and steps twice as long fails: {problem}")
        except Interrupted as stopped:
            history.why.append("the motion that its error is estimated by was interrupted")
            stopped.path = history
            raise


def _motion(scene, duration, pace, elements, stored, *, model, scheme, rho_inf, save_every, start, load_factor, degree,
            progress, comm):  # fmt: skip
    """The motion in steps of a pace; stored: None, or the folder and arguments of `simulate` to keep there."""
    for rod in scene.rods:
        require_inertia(rod, "a motion")
        if math.isinf(rod.profile.range[1].K.max()):
            raise SceneError(
                f"Rod '{rod.name}': an infinite axial or shear stiffness: expected finite ones, for a motion"
            )
    marks = marks_of(scene, duration, save_every)
    if start is not None and any(load.memory and not _may_start(load, start) for load in scene.actions):
        raise SceneError(
            "simulate.start: actions with a memory begin a motion with their initial one: expected None, and a motion "
            "that applies the loads slowly; or, where these are obstacles with friction, the path of a scene in which "
            "they have none, or that is without them, and friction begins at zero"
        )
    refuse_stages("simulate", scene)
    if scene.rod_contact and (scene.rod_contact.stiffness is None or comm.size > 1):
        raise SceneError(
            "simulate: rods touch each other on one process, with elastic surfaces: expected one process, and a "
            "RodContact.stiffness (N/m^2)"
        )
    from_equilibrium = isinstance(start, numbers.Real) and not isinstance(start, bool)
    if load_factor is None:
        load_factor = start if from_equilibrium else 1.0
    number("simulate", "load_factor", load_factor, "a finite number", math.isfinite)
    scene_over = scene.over(duration)
    check_magnitudes(scene_over, load_factor)
    check_tensions(scene, [load_factor])
    _refuse_tendons(scene, load_factor)
    if comm.rank == 0:
        scene.warn()
    cautions = []
    if from_equilibrium:
        start = equilibrium(scene_over, start, model=model, elements=elements, degree=degree, comm=comm)
        if not start.stable[-1]:
            cautions = ["the equilibrium that it starts from is unstable: rounding errors decide where it goes"]
    model, why = chosen_model(scene_over, model, scheme, start)
    layout = turning_in_law(scene_over, Layout.of(scene, elements), [load_factor], elements)
    with solvers_of(scene_over, layout, degree, scheme, load_factor, comm, model) as (problem, stepper):
        stepper.rho_inf = rho_inf
        cautions += pace.watch(scene, duration, load_factor, stepper.impulse_error)
        cautions += [*put_start(problem.model, start), *_braked(scene)]
        problem.begin()
        if problem.slipping:
            problem.slipping.start(_pulls(scene_over, start))
        stepper.begin()
        history = (StoredHistory if stored else History).of(problem.model, scheme, [why, *cautions])
        store = Nowhere()
        if stored:
            folder, asked = stored
            asked |= {"scheme": scheme, "save_every": save_every, "load_factor": load_factor, "degree": degree,
                      "rho_inf": rho_inf}  # fmt: skip
            told = {"asked": asked, "durations": [duration], "told": history.told()}
            store = Store(folder, KIND, comm).make(told, scene, duration)
            history.keep_in(store)
        motion = TimeLoop(problem, stepper, pace, history, store)
        return motion.over(marks, save_every is None, progress)


def _braked(scene):
    """A sentence on drag, which a damping ratio brings, in a scene with a weight and without supports: a list."""
    drag = max((rod.damping.drag for rod in scene.rods if rod.damping is not None), default=0.0)
    pull = max((float(np.linalg.norm(load.gravity)) for load in scene.loads if isinstance(load, Weight)), default=0.0)
    if not drag or not pull or scene.supports:
        return []
    return [
        f"the drag of Damping ({drag:.4g} 1/s) brakes vibrations and falls: a free one would end at g/drag = "
        f"{pull / drag:.3g} m/s; Damping(time=...) alone leaves it as it is"
    ]


def _may_start(action, start):
    """Whether an action with a memory may begin at a start: friction of obstacles, where it begins at zero."""
    return (
        action.finds_friction and not isinstance(start, numbers.Real) and not path_dependent(point_of(start)[0].scene)
    )


def _refuse_tendons(scene, load_factor):
    """Refuse (SceneError) tendons of given length or with friction that do not stretch, and friction at a load factor
    of zero."""
    for load in scene.actions:
        if (load.shortens or load.rough) and load.axial is None:
            why = "would stick with a blow" if load.rough else "would be taut with a blow"
            raise SceneError(
                f"simulate: {describe(load)} does not stretch, and {why}: expected its stiffness EA, axial= (N)"
            )
        if load.rough and load.scaled and not load_factor:
            raise SceneError(f"simulate: {describe(load)} has friction, and the load factor 0 no tension at all: "
                             "expected a tension that falls with time")  # fmt: skip


def _pulls(scene, start):
    """[tension, N] at their pulled ends of the tendons with friction of a scene, with which they have slid before a
    motion; 0 of those that the start does not have. A SceneError where they have another friction there."""
    path, k = (None, 0) if start is None else point_of(start)
    before, found = [x for x in path.scene.loads if x.is_thread] if path else [], []
    for load in scene.actions:
        if load.rough:
            there = [x for x in before if (x.rod, x.offset) == (load.rod, load.offset)]
            alike = (x for x in there if (x.friction, x.pulled) == (load.friction, load.pulled) and not x.shortens)
            known = next(alike, None)
            if there and known is None:
                raise SceneError(f"simulate.start: {describe(load)} has another friction or pulled end in the path: "
                                 "expected the same ones")  # fmt: skip
            found.append(0.0 if known is None else float(path.tendon(known).tension[k]))
            before = [x for x in before if x is not known]  # each once: several may have one offset
    return found


def pace_of(duration, *, tol=None, dt=None, scheme="momentum", save_every=None, elements=ELEMENTS):
    """The step size control, `Fixed` or `Adaptive`, from arguments of `simulate`, or a SceneError."""
    duration = positive_time("duration", duration)
    if not isinstance(scheme, str) or scheme not in SCHEMES:
        raise SceneError(f"scheme = {scheme!r}: {nearest(scheme, SCHEMES)}")
    if save_every is not None:
        positive_time("save_every", save_every)
    whole("simulate", "elements", elements)
    if dt is not None:
        if tol is not None:
            raise SceneError(
                f"simulate: dt = {dt!r} and tol = {tol!r}: expected one of them, a fixed or an adaptive step"
            )
        if positive_time("dt", dt) > duration:
            refuse("simulate", "dt", dt, f"at most the duration, {duration:g} s")
    check_counts("simulate", duration, dt, save_every)
    if dt is not None:
        return Fixed(dt)
    if not SCHEMES[scheme].adapts:
        raise SceneError(f"scheme = '{scheme}' has no error estimate: expected dt, a fixed step (s)")
    tol = TOL if tol is None else tol
    return Adaptive(
        number("simulate", "tol", tol, "a number from 1e-10 to below 1", lambda x: 1e-10 <= x < 1), duration
    )


def positive_time(name, value, owner="simulate"):
    """A positive time (s), checked, in a range where ratios of two do not overflow."""
    return number(owner, name, value, "a positive number (s), from 1e-30 to 1e30", lambda x: 1e-30 <= x <= 1e30)


def check_counts(owner, duration, dt, save_every):
    """Refuse absurd numbers of steps or of saved states, by checked arguments of `owner`."""
    given = ("dt", dt, MOST_STEPS, "steps"), ("save_every", save_every, MOST_SAVED, "saved states")
    for name, apart, most, what in given:
        if apart is not None and duration / apart > most:
            raise SceneError(
                f"{owner}: duration = {duration:g} s and {name} = {apart:g} s: expected at most {most:g} {what}"
            )


def _rho_inf(scheme, rho_inf):
    known = SCHEMES[scheme].rho_inf
    if rho_inf is None:
        return known
    if known is None:
        refuse("simulate", "rho_inf", rho_inf, f"None, since scheme = '{scheme}' has no such parameter")
    return number("simulate", "rho_inf", rho_inf, "a number from 0 to 1", lambda x: 0 <= x <= 1)


_MODELS = {
    ("momentum", "spatial"): MovingSpatial,
    ("momentum", "eccentric"): EccentricSpatial,
    ("momentum", "planar"): MovingPlanar,
    ("energy", "spatial"): ConservingSpatial,
    ("collocation", "spatial"): CollocatedSpatial,
    ("collocation", "planar"): CollocatedPlanar,
}


def chosen_model(scene, model, scheme, start=None):
    """The model's name, and why, from arguments of `simulate` (start: None, a Path or (Path, k)); or a SceneError."""
    if model not in ("auto", "planar", "spatial"):
        raise SceneError(f"model = {model!r}: {nearest(model, ('auto', 'planar', 'spatial'))}")
    if model == "spatial":
        return model, "the spatial model was requested"
    reason = not_flat(scene)
    if not reason and any(rod.mass_centre for rod in scene.rods):
        reason = "the planar model has no mass centre off the axis (Rod.eccentricity)"
    if not reason and not starts_in(scene, scene.plane, start):
        reason = "the start leaves the plane of the rods"
    if not reason and ("momentum" if scheme not in SCHEMES else SCHEMES[scheme].forms, "planar") not in _MODELS:
        reason = f"the scheme '{scheme}' has no planar model"
    if not reason:
        return "planar", f"the whole scene moves in {scene.plane.words}"
    if model == "planar":
        raise SceneError(f"model = 'planar': {reason}; expected 'spatial' or 'auto'")
    return "spatial", reason


@contextlib.contextmanager
def solvers_of(scene, layout, degree, scheme, load_factor, comm, model):
    """Context manager that gives the loaded problem and stepper of a scene on a mesh; afterwards another caller may use
    them, so that results must not refer to them."""
    signature = Signature.of(scene, layout, formulation="displacement", degree=degree, model=model)
    with PROBLEMS.lend((scheme, signature), comm, lambda: _make(comm, signature, scheme), NotConverged) as solvers:
        solvers[0].load(scene, layout, load_factor)
        yield solvers


def _make(comm, signature, scheme):
    stepper = SCHEMES[scheme]
    model = _MODELS[stepper.forms, signature.model]
    if signature.eccentric:
        model = _MODELS.get((stepper.forms, "eccentric"), model)
    problem = stepper.problem_class(model(comm, signature))
    return problem, stepper(problem)


def go_on(store, scene, duration, progress):
    """`resume` of a motion of rods."""
    if duration is not None:
        seconds = positive_time("duration", duration, "resume")
        duration = seconds if isinstance(duration, str) else duration  # messages show a number as it was given
    scene, head = _opened(store, scene, duration), store.head
    until = duration or head["durations"][-1]
    check_counts("resume", until, head["asked"]["dt"], head["asked"]["save_every"])
    _check_plane(store, scene, until)
    if head["ranks"] != store.comm.size:
        raise SceneError(
            f"{store.place} was computed by {head['ranks']} rank(s), and here are {store.comm.size}: expected as many"
        )
    history = _history(store, scene)
    if store.memory()["t"] >= until:
        return history
    store.hold()
    try:
        return _over(store, scene, until, progress)
    finally:
        store.release()


def _check_plane(store, scene, until):
    """Refuse a longer duration in which the scene leaves the plane that the motion was computed in."""
    if store.head["told"]["model"] != "planar":
        return
    before, (after, why) = scene.over(store.head["asked"]["duration"]).plane, scene.over(until).flatness
    if after is not None and not np.allclose(after.axes[2], before.axes[2], rtol=0, atol=1e-9):
        why = f"the scene moves in {after.words}"
    if why:
        raise SceneError(
            f"resume.duration = {until:g}: {store.place} was computed in {before.words}, and until then {why}: "
            "expected a shorter duration, or a motion in space, by another simulate(..., model='spatial')"
        )


def _over(store, scene, until, progress):
    """Continue the motion to a time, s."""
    asked, durations = store.head["asked"], store.head["durations"]
    marks = marks_of(scene, until, asked["save_every"], [t for t in durations if t < until])
    scene_over, layout = scene.over(asked["duration"]), Layout.of(scene, asked["elements"])
    scheme, load_factor, model = asked["scheme"], asked["load_factor"], store.head["told"]["model"]
    with solvers_of(scene_over, layout, asked["degree"], scheme, load_factor, store.comm, model) as (problem, stepper):
        history = _history(store, scene, problem.model.expansion())
        stepper.rho_inf = asked["rho_inf"]
        problem.begin()
        stepper.begin()
        pace = pace_of(asked["duration"], tol=asked["tol"], dt=asked["dt"], scheme=scheme)
        pace.watch(scene, asked["duration"], load_factor, stepper.impulse_error)
        motion = TimeLoop(problem, stepper, pace, history, store)
        memory = store.memory(motion.memory(), motion.recall)
        alike = np.array_equal(memory["nodes"], problem.model.slots)
        if not store.comm.allreduce(alike, op=MPI.LAND):
            raise SceneError(
                f"{store.place}: its nodes are numbered differently here: expected the release of dolfinx that it was "
                "computed with"
            )
        if until > durations[-1]:
            store.extend(scene, until, durations=[*durations, until])
        return motion.over(marks, asked["save_every"] is None, progress)


def read(store, scene):
    scene = _opened(store, scene)
    history = _history(store, scene)
    store.check_rows(itemgetter("time"))
    return history


def read_history(folder: File, scene: Scene | None = None, *, comm: MPI.Comm | None = None) -> History:
    """The states that a motion has saved so far; another process may still be computing it.

    Args:
        folder: as of `resume`; or the file that `History.save` wrote.
        scene: as of `resume`; None for a file, which holds its scene.
        comm: MPI communicator with any number of ranks; default all.

    Returns:
        History.

    Raises:
        SceneError: no such folder or file, another scene, or a file that is damaged or of a newer release.
    """
    comm = communicator(comm)
    if isinstance(folder, str | os.PathLike) and FilePath(folder).is_file():
        if scene is not None:
            refuse("read_history", "scene", scene, f"None, since the file {folder} holds its scene")
        return saved.read(folder, History, assembled, comm)
    return read(Store(folder, KIND, comm).open(), scene)


def _opened(store, scene, duration=None):
    """The scene, checked to be that of the motion up to `duration` (s)."""
    store.comm = communicator(None if store.comm is Alone else store.comm)
    if scene is not None:
        instance("resume", "scene", scene, Scene, "a Scene, or None for the folder's own")
    scheme, last = store.head["asked"]["scheme"], store.head["durations"][-1]
    if scheme not in SCHEMES:
        raise SceneError(f"{store.place}: scheme '{scheme}': {nearest(scheme, SCHEMES)}")
    if duration is not None and duration < last:
        refuse("resume", "duration", duration, f"None or at least {last:g} s, the last duration requested")
    return store.scene(scene, duration or last)


def _history(store, scene, expand=None):
    layout, scales = Layout.of(scene, store.head["asked"]["elements"]), Scales.of(scene)
    connections = Connections.of(scene, layout)
    told = store.head["told"]
    return StoredHistory.as_told(told, scene, layout, scales, store.comm, connections, expand).keep_in(store)
