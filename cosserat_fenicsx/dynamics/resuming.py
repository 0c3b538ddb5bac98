"""Read and continue a motion of rods in a folder; `read_history` also reads a saved file."""

import cosserat_fenicsx.compat  # noqa: F401, I001  first: its message says what is missing where dolfinx is

import os
from operator import itemgetter
from pathlib import Path as FilePath

import numpy as np
from mpi4py import MPI

from cosserat_fenicsx.checks import File, instance, refuse
from cosserat_fenicsx.dynamics.schemes import SCHEMES
from cosserat_fenicsx.dynamics.simulate import check_counts, pace_of, positive_time, solvers_of
from cosserat_fenicsx.dynamics.time_loop import TimeLoop, marks_of
from cosserat_fenicsx.errors import SceneError, nearest
from cosserat_fenicsx.models.connections import Connections
from cosserat_fenicsx.models.rodmesh import Layout
from cosserat_fenicsx.models.base import Scales
from cosserat_fenicsx.ranks import Alone, communicator
from cosserat_fenicsx.results import saved
from cosserat_fenicsx.results.history import History
from cosserat_fenicsx.scene.scene import Scene
from cosserat_fenicsx.statics.path.recorder import assembled
from cosserat_fenicsx.storage.store import Store
from cosserat_fenicsx.storage.stored_history import KIND, StoredHistory


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
