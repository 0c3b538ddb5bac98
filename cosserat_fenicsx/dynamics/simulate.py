"""`simulate`: the motion of a scene in time."""

import cosserat_fenicsx.compat  # noqa: F401, I001  first: it says in words what of dolfinx is missing

import math
import numbers

from mpi4py import MPI

from cosserat_fenicsx.checks import instance, number, refuse
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.results.history import History
from cosserat_fenicsx.dynamics.marks import marks_of
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.dynamics.motion import Motion
from cosserat_fenicsx.dynamics.pace import Adaptive, Fixed
from cosserat_fenicsx.storage.runfolder import RunFolder
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.dynamics.standing import equilibrium
from cosserat_fenicsx.dynamics.solvers import chosen_model, solvers_of
from cosserat_fenicsx.dynamics.start import put_start
from cosserat_fenicsx.dynamics.steppers import SCHEMES
from cosserat_fenicsx.results.stored_history import StoredHistory

#: Elements a rod, degree and tolerance where none are asked for.
ELEMENTS, DEGREE, TOL = 8, 3, 1e-3
#: More of them are a slip of the pen.
MOST_STEPS, MOST_SAVED = 1e9, 1e6


def simulate(
    scene,
    duration,
    *,
    tol=None,
    dt=None,
    model="auto",
    scheme="momentum",
    rho_inf=None,
    save_every=None,
    start=None,
    load_factor=None,
    elements=ELEMENTS,
    degree=DEGREE,
    folder=None,
    progress=None,
    comm=None,
):
    """Motion of a scene from the time 0 on.

    Loads and prescribed motions are those of the scene at every time (`signals`), times `load_factor`; the velocities
    at the start are the scene's. A scene without supports flies freely.

    Args:
        scene: a `Scene`; every rod needs a mass and inertia.
        duration: s.
        tol: what the errors of single steps may add up to over the whole duration, of positions over the longest rod's
            length and of a tenth of rotations (rad); steps adapt to it, and resolve what loads and prescribed motions do.
            Default 1e-3, unless `dt` is given. The mesh does not adapt: compare with more `elements`.
        dt: fixed step, s; shorter where it would step over a jump or a saved time. A step that fails is halved. History.why
            tells where loads change faster than it can follow.
        model: "spatial"; "planar" for a scene that moves in a plane; or "auto", the cheaper one that will do.
        scheme: "momentum" (exact linear and angular momentum, order 2); "triple-jump" (three steps of it, one back in
            time: order 4, for smooth motions without damping, fixed dt); "energy" (exact energy and linear momentum,
            order 2, in space alone); "generalised-alpha" (dissipates what the steps do not resolve, order 2; what it
            takes is seen in the balance of the History).
        rho_inf: of "generalised-alpha": from 0 to 1, by how much a step shrinks what vibrates much faster than the
            steps; 1 takes nothing (the trapezoidal rule). Default 0.8.
        save_every: s between saved states, landed on exactly; None saves every step.
        start: None for the reference, a `Path` for its last equilibrium, or (Path, k); rods must be the same objects. A
            number is the load factor of an equilibrium of the scene as it is just before t = 0 (`standing.before`).
        load_factor: multiplies all loads and prescribed motions, as in `solve`; None for that of the start where this is
            a number, otherwise 1.
        elements: elements per rod.
        degree: 1 to 4, of r and q.
        folder: where the motion is written as it goes, for long runs: the History reads its states from there as they are
            asked for, and none stays in memory. Whatever ends the run, `resume(folder)` continues it to the same digits.
            A folder that does not hold a motion yet, which all ranks must see; None keeps the states in memory.
        progress: True, False, or None for a bar on long runs in a terminal.
        comm: MPI communicator; default all ranks. Every rank calls, every rank gets the same History.

    Returns:
        History.

    Raises:
        SceneError: an argument outside its range, a rod without inertia, a start that supports contradict, or a prescribed
            motion that jumps; a function of time that raises or gives no finite numbers, `.path` then holds the History
            up to there.
        NotConverged: a step fails however short it is, or thousands of them stay tiny; `.path` holds the History up to there.
        Interrupted: Ctrl-C; `.path` holds the History up to there.
        NotStored: the folder cannot be written any more, such as on a full disk; `.path` holds the History up to there.
    """
    comm = comm or MPI.COMM_WORLD
    instance("simulate", "scene", scene, Scene, "a Scene")
    pace = pace_of(duration, tol=tol, dt=dt, scheme=scheme, save_every=save_every, elements=elements)
    rho_inf = _rho_inf(scheme, rho_inf)
    for rod in scene.rods:
        if math.isinf(rod.profile.range[1].K.max()):
            raise SceneError(
                f"Rod '{rod.name}': an infinite axial or shear stiffness: expected finite ones, for a motion"
            )
    marks = marks_of(scene, duration, save_every)
    standing = isinstance(start, numbers.Real) and not isinstance(start, bool)
    if load_factor is None:
        load_factor = start if standing else 1.0
    number("simulate", "load_factor", load_factor, "a finite number", math.isfinite)
    looked_at = scene.over(duration)
    cautions = []
    if standing:
        start = equilibrium(looked_at, start, model=model, elements=elements, degree=degree, comm=comm)
        if not start.stable[-1]:
            cautions = ["the equilibrium that it starts from is unstable: rounding decides where it goes"]
    model, why = chosen_model(looked_at, model, scheme, start)
    problem, stepper = solvers_of(looked_at, Layout.of(scene, elements), degree, scheme, load_factor, comm, model)
    stepper.rho_inf = rho_inf
    cautions += pace.watch(scene, duration, load_factor, stepper.missed)
    cautions += put_start(problem.model, start)
    problem.begin()
    stepper.begin()
    history = (History if folder is None else StoredHistory).of(problem.model, scheme, [why, *cautions])
    if folder is not None:
        asked = {"duration": duration, "tol": tol, "dt": dt, "scheme": scheme, "save_every": save_every,
                 "load_factor": load_factor, "elements": elements, "degree": degree, "rho_inf": rho_inf}  # fmt: skip
        folder = RunFolder(folder, comm).make(scene, asked, history)
    motion = Motion(problem, stepper, pace, history, folder)
    return motion.over(marks, save_every is None, progress)


def pace_of(duration, *, tol=None, dt=None, scheme="momentum", save_every=None, elements=ELEMENTS):
    """What chooses the steps of `simulate`.

    Args: as `simulate` takes them.

    Raises:
        SceneError: one of them is outside its range.
    """
    duration = positive_time("duration", duration)
    if not isinstance(scheme, str) or scheme not in SCHEMES:
        raise SceneError(f"scheme = {scheme!r}: {nearest(scheme, SCHEMES)}")
    if save_every is not None:
        positive_time("save_every", save_every)
    if isinstance(elements, bool) or not isinstance(elements, numbers.Integral) or elements < 1:
        refuse("simulate", "elements", elements, "a whole number above zero")
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
        raise SceneError(f"scheme = '{scheme}' knows no error of its steps: expected dt, a fixed step (s)")
    tol = TOL if tol is None else tol
    return Adaptive(
        number("simulate", "tol", tol, "a number from 1e-10 to below 1", lambda x: 1e-10 <= x < 1), duration
    )


def positive_time(name, value, owner="simulate"):
    """A time that can be divided by another one, s.

    Raises:
        SceneError: it is something else.
    """
    return number(owner, name, value, "a positive number (s), from 1e-30 to 1e30", lambda x: 1e-30 <= x <= 1e30)


def check_counts(owner, duration, dt, save_every):
    """Refuse more steps or saved states than can ever be.

    Args:
        owner: for the words; the others as `simulate` takes them, checked.

    Raises:
        SceneError: naming the two that do not go together.
    """
    for name, apart, most, what in (
        ("dt", dt, MOST_STEPS, "steps"),
        ("save_every", save_every, MOST_SAVED, "saved states"),
    ):
        if apart is not None and duration / apart > most:
            raise SceneError(
                f"{owner}: duration = {duration:g} s and {name} = {apart:g} s: expected at most {most:g} {what}"
            )


def _rho_inf(scheme, rho_inf):
    known = SCHEMES[scheme].rho_inf
    if rho_inf is None:
        return known
    if known is None:
        refuse("simulate", "rho_inf", rho_inf, f"None, for scheme = '{scheme}' has nothing of the kind")
    return number("simulate", "rho_inf", rho_inf, "a number from 0 to 1", lambda x: 0 <= x <= 1)
